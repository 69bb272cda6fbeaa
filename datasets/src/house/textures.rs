//! Pictures for walls and furniture. Those that repeat do so without a seam.

use crate::noise::{hash, unit};
use image::{Rgba, RgbaImage};

/// What a picture shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Picture {
    Plaster,
    Stripes,
    Planks,
    Tiles,
    Grain,
    Fabric,
    Foliage,
    /// All of a rug.
    Rug(u32),
    /// All of a painting.
    Painting(u32),
    /// All that a window shows of the outside.
    Outside,
}

const SIZE: u32 = 256;

impl Picture {
    /// Metres that it covers before it repeats; none where it covers the whole thing.
    pub(super) fn metres(self) -> Option<f64> {
        match self {
            Self::Plaster => Some(2.0),
            Self::Stripes => Some(0.8),
            Self::Planks => Some(1.6),
            Self::Tiles => Some(1.2),
            Self::Grain => Some(0.8),
            Self::Fabric => Some(0.25),
            Self::Foliage => Some(0.5),
            Self::Rug(_) | Self::Painting(_) | Self::Outside => None,
        }
    }

    /// Codes near white where it is to be tinted.
    pub(super) fn draw(self) -> RgbaImage {
        RgbaImage::from_fn(SIZE, SIZE, |x, y| {
            let at = [
                f64::from(x) / f64::from(SIZE),
                f64::from(y) / f64::from(SIZE),
            ];
            let code = |c: f64| (255.0 * c.clamp(0.0, 1.0)).round() as u8;
            let [r, g, b] = self.color(at);
            Rgba([code(r), code(g), code(b), 255])
        })
    }

    fn color(self, [x, y]: [f64; 2]) -> [f64; 3] {
        let grey = |g: f64| [g; 3];
        match self {
            Self::Plaster => grey(0.93 + 0.08 * (noise(1, [x, y], [16, 16], 4) - 0.5)),
            Self::Stripes => {
                let stripe = (x * 8.0).fract();
                let dark = if (0.1..0.5).contains(&stripe) {
                    0.86
                } else {
                    0.96
                };
                let dot = ((x * 8.0 + 0.7).fract() - 0.5).hypot((y * 8.0).fract() - 0.5);
                let dark = if dot < 0.12 { 0.76 } else { dark };
                grey(dark + 0.03 * (noise(2, [x, y], [32, 32], 2) - 0.5))
            }
            Self::Planks => {
                let row = (y * 8.0).floor();
                let shift = unit(3, row as i32, 0, 0);
                let place = (x + shift).fract();
                let plank = (2.0 * place).floor();
                let tone = unit(4, row as i32, plank as i32, 0);
                let grain = noise(5 + row as u32, [x, y], [6, 128], 3);
                let seam = (y * 8.0).fract() < 0.04 || (2.0 * place).fract() < 0.006;
                let light = 0.72 + 0.14 * tone + 0.22 * (grain - 0.5);
                let light = if seam { 0.45 * light } else { light };
                [light, 0.74 * light, 0.5 * light]
            }
            Self::Tiles => {
                let (column, row) = ((x * 4.0).floor(), (y * 4.0).floor());
                let (u, v) = ((x * 4.0).fract(), (y * 4.0).fract());
                let grout = u.min(v) < 0.03;
                let tone = 0.05 * unit(6, column as i32, row as i32, 0);
                let cloud = 0.06 * (noise(7, [x, y], [8, 8], 4) - 0.5);
                grey(if grout { 0.6 } else { 0.9 + tone + cloud })
            }
            Self::Grain => {
                let wave = noise(8, [x, y], [4, 4], 2);
                let rings = (8.0 * (x + 0.35 * wave) * std::f64::consts::TAU).sin();
                let fibre = noise(9, [x, y], [128, 8], 2);
                grey(0.84 + 0.08 * rings + 0.14 * (fibre - 0.5))
            }
            Self::Fabric => {
                let thread = |t: f64| (t * 32.0 * std::f64::consts::PI).sin().abs();
                let over = (x * 32.0).floor() as i32 + (y * 32.0).floor() as i32;
                let light = if over % 2 == 0 { thread(x) } else { thread(y) };
                grey(0.74 + 0.2 * light + 0.08 * (noise(10, [x, y], [8, 8], 3) - 0.5))
            }
            Self::Foliage => {
                let cloud = noise(11, [x, y], [16, 16], 3);
                [0.5 + 0.3 * cloud, 0.75 + 0.3 * (cloud - 0.5), 0.35]
            }
            Self::Rug(seed) => rug(seed, x, y),
            Self::Painting(seed) => painting(seed, x, y),
            Self::Outside => outside(x, y),
        }
    }
}

fn palette(seed: u32, k: i32) -> [f64; 3] {
    const COLORS: [u32; 10] = [
        0x9c3b2e, 0x2f4b6e, 0xd8b45a, 0xe8dfc8, 0x3f5d45, 0x7a4a63, 0xc9773f, 0x1f2a36, 0x86a7b5,
        0xb9563d,
    ];
    let color = COLORS[hash(seed, k, 0, 21) as usize % COLORS.len()];
    [16, 8, 0].map(|shift| f64::from(color >> shift & 0xff) / 255.0)
}

fn rug(seed: u32, x: f64, y: f64) -> [f64; 3] {
    let edge = x.min(1.0 - x).min(y).min(1.0 - y);
    let cell = ((x * 12.0).fract() - 0.5).abs() + ((y * 12.0).fract() - 0.5).abs();
    let k = match edge {
        e if e < 0.03 => 0,
        e if e < 0.08 => 1,
        e if e < 0.1 => 0,
        _ if (x - 0.5).abs() + (y - 0.5).abs() < 0.22 => 3,
        _ if cell < 0.3 => 1,
        _ => 2,
    };
    let weave = 0.9 + 0.1 * unit(seed, (x * 256.0) as i32, (y * 256.0) as i32, 1);
    palette(seed, k).map(|c| c * weave)
}

fn painting(seed: u32, x: f64, y: f64) -> [f64; 3] {
    let stroke = noise(seed, [x, y], [12, 40], 3) - 0.5;
    let mut color = palette(seed, 0);
    let horizon =
        0.45 + 0.2 * unit(seed, 1, 1, 1) + 0.1 * (noise(seed + 1, [x, 0.0], [6, 1], 3) - 0.5);
    if y > horizon {
        color = palette(seed, 1);
    }
    for k in 2..7 {
        let [cx, cy, r] = [1, 2, 3].map(|i| unit(seed, k, i, 5));
        if (x - cx).hypot(y - cy) < 0.06 + 0.14 * r {
            color = palette(seed, k);
        }
    }
    color.map(|c| c * (1.0 + 0.3 * stroke))
}

fn outside(x: f64, y: f64) -> [f64; 3] {
    let cloud = ((noise(31, [x, y], [4, 8], 4) - 0.45) * 4.0).clamp(0.0, 1.0);
    let mix = |a: [f64; 3], b: [f64; 3], t: f64| [0, 1, 2].map(|k| a[k] + t * (b[k] - a[k]));
    let sky = mix([0.45, 0.66, 0.93], [0.85, 0.92, 1.0], y);
    let sky = mix(sky, [1.0; 3], 0.8 * cloud * (1.0 - y));
    let hills = 0.62 + 0.1 * (noise(32, [x, 0.0], [4, 1], 4) - 0.5);
    let trees = 0.7 + 0.16 * (noise(33, [x, 0.0], [16, 1], 3) - 0.5);
    let leaves = noise(34, [x, y], [32, 32], 3) - 0.5;
    match y {
        y if y > trees => [0.22 + 0.2 * leaves, 0.42 + 0.3 * leaves, 0.16],
        y if y > hills => [0.45 + 0.1 * leaves, 0.6 + 0.1 * leaves, 0.42],
        _ => sky,
    }
}

/// Octaves of value noise that repeat at 1 in x and y; about 0 to 1.
fn noise(seed: u32, at: [f64; 2], cells: [i32; 2], octaves: u32) -> f64 {
    let (mut sum, mut total, mut weight) = (0.0, 0.0, 1.0);
    let mut cells = cells;
    for octave in 0..octaves {
        let place = |k: usize| at[k] * f64::from(cells[k]);
        let (x, y) = (place(0), place(1));
        let smooth = |t: f64| t * t * (3.0 - 2.0 * t);
        let (tx, ty) = (smooth(x - x.floor()), smooth(y - y.floor()));
        let corner = |dx: i32, dy: i32| {
            let column = (x.floor() as i32 + dx).rem_euclid(cells[0]);
            let row = (y.floor() as i32 + dy).rem_euclid(cells[1]);
            unit(seed, column, row, octave as i32)
        };
        let mix = |a: f64, b: f64, t: f64| a + t * (b - a);
        let value = mix(
            mix(corner(0, 0), corner(1, 0), tx),
            mix(corner(0, 1), corner(1, 1), tx),
            ty,
        );
        sum += weight * value;
        total += weight;
        weight *= 0.5;
        cells = cells.map(|n| 2 * n);
    }
    sum / total
}
