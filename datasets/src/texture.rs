//! Procedural textures: linear-light colours from place to place on a surface.
//!
//! Nothing finer than the scene's `finest` wavelength is drawn: noise stops there and
//! edges are that wide, so that photos at the intended distance don't alias.

use crate::noise::{fractal2, fractal3, signed, unit};
use crate::print::{self, glyphs};
use crate::shape::{Surface, TURN, longitude};
use glam::{DVec2, DVec3};
use proxy::mesh::linear_from_srgb;
use std::sync::LazyLock;

/// A texture. Lengths are world units, colours linear light, `seed` chooses its noise.
#[derive(Clone, Debug, PartialEq)]
pub enum Texture {
    /// One colour, mottled.
    Mottled {
        /// The mean colour.
        color: DVec3,
        /// How far it varies, as a part of it.
        contrast: f64,
        /// The longest wavelength of its noise.
        wavelength: f64,
        /// Chooses the noise.
        seed: u32,
    },
    /// Planks along the surface's first coordinate.
    Wood {
        /// Early wood.
        light: DVec3,
        /// Late wood.
        dark: DVec3,
        /// A plank's width.
        plank: f64,
        /// Chooses the noise.
        seed: u32,
    },
    /// Drawer fronts in a row, of wood.
    Drawers {
        /// The wood's mean colour.
        color: DVec3,
        /// From drawer to drawer.
        period: f64,
        /// Chooses the noise.
        seed: u32,
    },
    /// Wallpaper: broad stripes under staggered rosettes.
    Wallpaper {
        /// The stripes' colour.
        ground: DVec3,
        /// The rosettes'.
        figure: DVec3,
        /// From rosette to rosette.
        period: f64,
        /// Chooses the noise.
        seed: u32,
    },
    /// A woven cloth, striped across its first coordinate.
    Cloth {
        /// Its threads' colours.
        colors: [DVec3; 3],
        /// From stripe to stripe.
        period: f64,
        /// Chooses the noise.
        seed: u32,
    },
    /// Brickwork, each brick of another shade and printed with a glyph.
    Bricks {
        /// A brick's width and height.
        size: DVec2,
        /// The bricks' mean colour.
        color: DVec3,
        /// Chooses the noise.
        seed: u32,
    },
    /// A cylinder's printed label: bands, a title, an emblem and small print.
    Label {
        /// The unprinted colour.
        paper: DVec3,
        /// The bands' colour.
        band: DVec3,
        /// The print's.
        ink: DVec3,
        /// The cylinder's half height.
        half_height: f64,
        /// Chooses the small print.
        seed: u32,
    },
    /// A book (a cuboid whose back shows on its ±z sides): cloth, gilt title, pages.
    Book {
        /// The binding's colour.
        cloth: DVec3,
        /// Half the book's size.
        half: DVec3,
        /// The title: what glyphs there are, see `glyphs`.
        title: &'static str,
        /// Chooses the noise.
        seed: u32,
    },
    /// A toy block (a cuboid): a letter on every face.
    Block {
        /// The painted letter's and border's colour.
        paint: DVec3,
        /// Half its side.
        half: f64,
        /// One glyph for each face.
        letters: &'static str,
        /// Chooses the noise.
        seed: u32,
    },
    /// A globe: continents by height, and a graticule.
    Globe {
        /// Chooses the world.
        seed: u32,
    },
    /// Blue painting on a white glaze, repeated around the y axis.
    Porcelain {
        /// Lowest and highest point.
        span: DVec2,
        /// Chooses the noise.
        seed: u32,
    },
    /// A framed painting on a cuboid's +z side, frame and mount included.
    Painting {
        /// Half the cuboid's size.
        half: DVec3,
        /// What is painted.
        motif: Motif,
        /// Chooses the noise.
        seed: u32,
    },
    /// A room as reflections see it, on the inside of a large sphere: a bright window
    /// towards a direction.
    Room {
        /// Where the window is (unit length).
        window: DVec3,
    },
}

/// What a painting shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motif {
    /// Hills under an evening sky.
    Hills,
    /// Overlapping discs and bars.
    Abstract,
}

impl Texture {
    /// The diffuse colour at a place of a surface; `finest` is the shortest wavelength to
    /// draw.
    pub fn color(&self, at: &Surface, finest: f64) -> DVec3 {
        match self {
            Self::Mottled {
                color,
                contrast,
                wavelength,
                seed,
            } => {
                let noise = fractal3(*seed, at.point, *wavelength, finest);
                *color * (1.0 + 2.0 * contrast * (noise - 0.5))
            }
            Self::Wood {
                light,
                dark,
                plank,
                seed,
            } => wood(at.along, *light, *dark, *plank, *seed, finest),
            Self::Drawers {
                color,
                period,
                seed,
            } => drawers(at.along, *color, *period, *seed, finest),
            Self::Wallpaper {
                ground,
                figure,
                period,
                seed,
            } => wallpaper(at.along, *ground, *figure, *period, *seed, finest),
            Self::Cloth {
                colors,
                period,
                seed,
            } => cloth(at.along, colors, *period, *seed, finest),
            Self::Bricks { size, color, seed } => bricks(at.along, *size, *color, *seed, finest),
            Self::Label {
                paper,
                band,
                ink,
                half_height,
                seed,
            } => print::label(at, *paper, *band, *ink, *half_height, *seed, finest),
            Self::Book {
                cloth,
                half,
                title,
                seed,
            } => print::book(at, *cloth, *half, title, *seed, finest),
            Self::Block {
                paint,
                half,
                letters,
                seed,
            } => print::block(at, *paint, *half, letters, *seed, finest),
            Self::Globe { seed } => globe(at.point, *seed, finest),
            Self::Porcelain { span, seed } => porcelain(at.point, *span, *seed, finest),
            Self::Painting { half, motif, seed } => {
                print::painting(at, *half, *motif, *seed, finest)
            }
            Self::Room { window } => room(at.point, *window),
        }
    }
}

/// The linear light of an sRGB colour such as 0xff8000.
pub(crate) fn rgb(hex: u32) -> DVec3 {
    // Textures ask for the same few at every sample: their powers are taken once.
    static LINEAR: LazyLock<[f64; 256]> =
        LazyLock::new(|| std::array::from_fn(|code| linear_from_srgb(code as f64 / 255.0)));
    let channel = |shift: u32| LINEAR[((hex >> shift) & 0xff) as usize];
    DVec3::new(channel(16), channel(8), channel(0))
}

/// 0 well below `at`, 1 well above, with a transition `width` long.
pub(crate) fn edge(x: f64, at: f64, width: f64) -> f64 {
    let t = ((x - at) / width + 0.5).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// 1 between `low` and `high`, 0 outside, with soft ends.
pub(crate) fn band(x: f64, low: f64, high: f64, width: f64) -> f64 {
    edge(x, low, width) * (1.0 - edge(x, high, width))
}

/// 1 within a line of `thickness` at every multiple of `period`.
pub(crate) fn lines(x: f64, period: f64, thickness: f64, width: f64) -> f64 {
    let away = (x - period * (x / period).round()).abs();
    1.0 - edge(away, 0.5 * thickness, width)
}

pub(crate) fn wood(
    along: DVec2,
    light: DVec3,
    dark: DVec3,
    plank: f64,
    seed: u32,
    finest: f64,
) -> DVec3 {
    let row = (along.y / plank).floor();
    let shift = DVec2::new(7.0 * unit(seed, row as i32, 0, 1), 0.0);
    let own = seed.wrapping_add(row as u32);
    // Rings: bands across the grain, drawn out and bent along it.
    let drawn_out = DVec2::new(along.x / 9.0, along.y) + shift;
    let bend = fractal2(own, drawn_out, 0.12, finest);
    let rings = 0.5 + 0.5 * (TURN * (along.y / 0.021 + 5.0 * bend)).sin();
    let pores = fractal2(
        own + 7,
        DVec2::new(along.x / 14.0, along.y) + shift,
        0.012,
        finest,
    );
    let tone = (0.5 * rings + 0.9 * (pores - 0.5) + 0.6 * (bend - 0.5) + 0.25).clamp(0.0, 1.0);
    let shade = 1.0 + 0.16 * signed(seed, row as i32, 3, 0);
    let seam = lines(along.y, plank, 0.2 * finest, 1.2 * finest);
    light.lerp(dark, tone) * shade * (1.0 - 0.6 * seam)
}

fn drawers(along: DVec2, color: DVec3, period: f64, seed: u32, finest: f64) -> DVec3 {
    let x = along.x / period;
    let own = seed + (x.floor() + 50.0) as u32;
    let grain = wood(along, color * 1.15, color * 0.72, 10.0, own, finest);
    // The joint between drawers, and a moulding inside each.
    let from_joint = (x - x.round()).abs() * period;
    let joint = 1.0 - edge(from_joint, 0.004, finest);
    let moulding = band(from_joint, 0.035, 0.041, finest);
    grain * (1.0 - 0.75 * joint) * (1.0 - 0.35 * moulding)
}

fn wallpaper(
    along: DVec2,
    ground: DVec3,
    figure: DVec3,
    period: f64,
    seed: u32,
    finest: f64,
) -> DVec3 {
    // 1. Stripes as wide as the lattice, and the paper's grain.
    let stripe = 0.5 + 0.5 * (TURN * along.x / period).sin();
    let stripe = edge(stripe, 0.5, (4.0 * finest / period).min(1.0));
    let grain = fractal2(seed, along * DVec2::new(1.0, 2.0), 0.03, finest) - 0.5;
    let worn = fractal2(seed + 9, along, 0.5, 0.1) - 0.5;
    let mut color = ground * (0.93 + 0.1 * stripe + 0.30 * grain + 0.25 * worn);
    // 2. Rosettes at the points of a staggered lattice.
    let column = (along.x / period).round();
    let half_step = if column.rem_euclid(2.0) > 0.5 {
        0.5
    } else {
        0.0
    };
    let row = (along.y / period - half_step).round() + half_step;
    let q = along / period - DVec2::new(column, row);
    let (r, angle) = (q.length(), q.y.atan2(q.x));
    let soft = finest / period;
    let petals = 0.23 + 0.09 * (6.0 * angle).cos();
    let rosette = band(r, 0.11, petals, soft) + 1.0 - edge(r, 0.055, soft);
    let leaf = 0.5 * band(r, 0.36, 0.40, soft) * edge((4.0 * angle).cos(), -0.2, 0.4);
    let ink = (rosette + leaf).clamp(0.0, 1.0) * (0.85 + 0.6 * grain);
    color = color.lerp(figure * (1.0 + 0.25 * worn), ink.clamp(0.0, 1.0));
    color
}

fn cloth(along: DVec2, colors: &[DVec3; 3], period: f64, seed: u32, finest: f64) -> DVec3 {
    let x = (along.x / period).rem_euclid(1.0) * period;
    let mut color = colors[0];
    for (low, high, which) in [
        (0.10, 0.34, 1),
        (0.40, 0.45, 2),
        (0.52, 0.55, 1),
        (0.58, 0.61, 1),
        (0.70, 0.90, 2),
        (0.77, 0.83, 0),
    ] {
        let inside = band(x, low * period, high * period, finest);
        color = color.lerp(colors[which], inside);
    }
    // Threads over and under.
    let thread = 3.0 * finest;
    let weave = (TURN * along.x / thread).sin() * (TURN * along.y / thread).sin();
    let uneven = fractal2(seed, along * DVec2::new(1.0, 3.0), 0.02, finest) - 0.5;
    color * (1.0 + 0.10 * weave + 0.45 * uneven)
}

fn bricks(along: DVec2, size: DVec2, color: DVec3, seed: u32, finest: f64) -> DVec3 {
    let row = (along.y / size.y).floor();
    let shift = 0.5 * row.rem_euclid(2.0);
    let column = (along.x / size.x + shift).floor();
    let within = along - DVec2::new((column - shift) * size.x, row * size.y);
    let (i, j) = (column as i32, row as i32);
    // 1. How deep inside the brick.
    let margin = within.min(size - within).min_element();
    let mortar_half = 0.035 * size.y;
    let inside = edge(margin, mortar_half, finest);
    // 2. Its own tone, and noise over everything.
    let hue = DVec3::new(
        signed(seed, i, j, 1),
        signed(seed, i, j, 2),
        signed(seed, i, j, 3),
    );
    let noise = fractal2(seed, along, 0.8 * size.x, finest) - 0.5;
    let own = color * (1.0 + 0.35 * hue + 0.3 * signed(seed, i, j, 4));
    // 3. A glyph stamped on it.
    let center = DVec2::new(within.x - 0.5 * size.x, 0.5 * size.y - within.y);
    let glyph = print::random_glyph(seed, i, j);
    let stamp = glyphs::coverage(glyph, center / (0.1 * size.y), finest / (0.1 * size.y));
    let own = own.lerp(own * 0.35, 0.8 * stamp);
    let mortar = DVec3::splat(0.55);
    mortar.lerp(own, inside) * (1.0 + 0.9 * noise)
}

fn globe(point: DVec3, seed: u32, finest: f64) -> DVec3 {
    let radius = point.length();
    let direction = point / radius;
    let finest_angle = finest / radius;
    let height = fractal3(seed, direction, 0.9, finest_angle);
    let detail = fractal3(seed + 31, direction, 0.2, finest_angle) - 0.5;
    let coast = edge(height, 0.515, 0.012);
    let sea = rgb(0x2f7fa6).lerp(rgb(0x7fc0c6), edge(height, 0.47, 0.1)) * (1.0 + 0.2 * detail);
    let lowland = rgb(0x86a85a).lerp(rgb(0xd8c07a), edge(height + 0.2 * detail, 0.57, 0.05));
    let land = lowland.lerp(rgb(0x9a6a44), edge(height + 0.3 * detail, 0.63, 0.06));
    let shore = band(height, 0.505, 0.52, 0.012);
    let mut color = sea.lerp(land * (1.0 + 0.5 * detail), coast) * (1.0 - 0.55 * shore);
    // The graticule every 15 degrees.
    let latitude = direction.y.clamp(-1.0, 1.0).asin();
    let step = TURN / 24.0;
    let meridian = lines(
        longitude(point),
        step,
        0.3 * finest_angle / latitude.cos().max(0.1),
        finest_angle / latitude.cos().max(0.1),
    );
    let parallel = lines(latitude, step, 0.3 * finest_angle, finest_angle);
    color *= 1.0 - 0.35 * meridian.max(parallel);
    color
}

fn porcelain(point: DVec3, span: DVec2, seed: u32, finest: f64) -> DVec3 {
    let height = (point.y - span.x) / (span.y - span.x);
    let soft = finest / (span.y - span.x);
    let angle = longitude(point);
    let brush = fractal3(seed, point, 0.02, finest) - 0.5;
    let glaze = rgb(0xe0dccf) * (1.0 + 0.06 * brush);
    let cobalt = rgb(0x1d3f94).lerp(rgb(0x4f7fd0), (0.5 + 1.6 * brush).clamp(0.0, 1.0));
    let petal = (5.0 * angle).cos().abs();
    // Lotus petals at the foot, a scroll around the belly, bands between, leaves above.
    let foot = band(height, 0.03 + 0.12 * petal, 0.05 + 0.15 * petal, soft).max(band(
        height,
        0.0,
        0.08 * petal,
        soft,
    ));
    let wave = 0.42 + 0.06 * (5.0 * angle).sin();
    let scroll = band(height, wave - 0.012, wave + 0.012, soft);
    let flower = |phase: f64, at: f64| {
        let across = (5.0 * angle + phase).rem_euclid(TURN) - 0.5 * TURN;
        let q = DVec2::new(across / 5.0 * 0.34, (height - at) * 1.0);
        let petals = 0.046 + 0.016 * (5.0 * q.y.atan2(q.x)).cos();
        let r = q.length();
        band(r, 0.02, petals, soft).max(1.0 - edge(r, 0.009, soft))
    };
    let flowers = flower(0.5 * TURN, 0.375).max(flower(0.0, 0.475));
    let bands = [(0.225, 0.24), (0.25, 0.255), (0.6, 0.605), (0.615, 0.63)]
        .iter()
        .chain(&[(0.93, 0.95), (0.965, 0.972)])
        .map(|&(low, high)| band(height, low, high, soft))
        .fold(0.0, f64::max);
    let leaf = (4.0 * angle).sin().abs();
    let leaves = band(height, 0.64, 0.66 + 0.2 * leaf * leaf, soft)
        * (1.0 - band(height, 0.66, 0.64 + 0.16 * leaf * leaf, soft));
    let ink = foot.max(scroll).max(flowers).max(bands).max(leaves);
    glaze.lerp(cobalt, 0.92 * ink)
}

fn room(point: DVec3, window: DVec3) -> DVec3 {
    let direction = point.normalize();
    let up = DVec3::Y;
    let across = up.cross(window).normalize();
    let upright = window.cross(across);
    let facing = direction.dot(window);
    let walls = rgb(0x3a2f26).lerp(rgb(0xb9a88f), edge(direction.y, 0.1, 1.6));
    if facing <= 0.0 {
        return walls;
    }
    // The window: two by three panes.
    let q = DVec2::new(direction.dot(across), direction.dot(upright)) / facing;
    let inside = band(q.x, -0.30, 0.30, 0.02) * band(q.y, -0.42, 0.42, 0.02);
    let bars = lines(q.x, 0.30, 0.03, 0.02).max(lines(q.y + 0.14, 0.28, 0.03, 0.02));
    walls.lerp(DVec3::new(5.0, 5.2, 5.6), inside * (1.0 - bars))
}
