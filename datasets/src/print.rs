//! Printed and painted surfaces: labels, books, toy blocks, framed pictures.

use crate::noise::{fractal2, hash, signed, unit};
use crate::shape::{Surface, TURN};
use crate::texture::{Motif, band, edge, lines, rgb, wood};
use glam::{DVec2, DVec3};

/// A small bitmap alphabet.
pub(crate) mod glyphs {
    use glam::DVec2;

    /// What can be printed.
    pub(crate) const ALPHABET: &[u8] = b"LUMIGRAPHXO";

    /// Five columns (the high bit is the left one) and seven rows, from the top.
    const BITMAPS: [[u8; 7]; ALPHABET.len()] = [
        [
            0b10000, 0b10000, 0b10000, 0b10000, 0b10000, 0b10000, 0b11111,
        ],
        [
            0b10001, 0b10001, 0b10001, 0b10001, 0b10001, 0b10001, 0b01110,
        ],
        [
            0b10001, 0b11011, 0b10101, 0b10101, 0b10001, 0b10001, 0b10001,
        ],
        [
            0b01110, 0b00100, 0b00100, 0b00100, 0b00100, 0b00100, 0b01110,
        ],
        [
            0b01110, 0b10001, 0b10000, 0b10111, 0b10001, 0b10001, 0b01110,
        ],
        [
            0b11110, 0b10001, 0b10001, 0b11110, 0b10100, 0b10010, 0b10001,
        ],
        [
            0b01110, 0b10001, 0b10001, 0b11111, 0b10001, 0b10001, 0b10001,
        ],
        [
            0b11110, 0b10001, 0b10001, 0b11110, 0b10000, 0b10000, 0b10000,
        ],
        [
            0b10001, 0b10001, 0b10001, 0b11111, 0b10001, 0b10001, 0b10001,
        ],
        [
            0b10001, 0b10001, 0b01010, 0b00100, 0b01010, 0b10001, 0b10001,
        ],
        [
            0b01110, 0b10001, 0b10001, 0b10001, 0b10001, 0b10001, 0b01110,
        ],
    ];

    /// How much ink lies at a place: (0, 0) is the glyph's centre, a dot of its bitmap
    /// is 1 wide, y points down; `soft` is the edges' width. Unknown glyphs are blank.
    pub(crate) fn coverage(glyph: u8, at: DVec2, soft: f64) -> f64 {
        let Some(bitmap) = ALPHABET.iter().position(|&g| g == glyph) else {
            return 0.0;
        };
        if at.x.abs() > 3.5 || at.y.abs() > 4.5 {
            return 0.0;
        }
        // Interpolating the dots rounds the corners; a soft threshold is the outline.
        let at = at + DVec2::new(2.0, 3.0);
        let cell = at.floor();
        let t = at - cell;
        let dot = |dx: i32, dy: i32| {
            let (x, y) = (cell.x as i32 + dx, cell.y as i32 + dy);
            let inside = (0..5).contains(&x) && (0..7).contains(&y);
            f64::from(inside && BITMAPS[bitmap][y as usize] >> (4 - x) & 1 == 1)
        };
        let top = dot(0, 0) + (dot(1, 0) - dot(0, 0)) * t.x;
        let bottom = dot(0, 1) + (dot(1, 1) - dot(0, 1)) * t.x;
        super::edge(top + (bottom - top) * t.y, 0.45, soft.clamp(0.1, 1.0))
    }
}

/// One of the alphabet's glyphs.
pub(crate) fn random_glyph(seed: u32, i: i32, j: i32) -> u8 {
    glyphs::ALPHABET[hash(seed, i, j, 77) as usize % glyphs::ALPHABET.len()]
}

/// Ink of a line of text centred on (0, 0), `height` tall, y upwards.
fn text(words: &str, at: DVec2, height: f64, finest: f64) -> f64 {
    let dot = height / 7.0;
    let advance = 6.5 * dot;
    let count = words.len() as f64;
    let place = at.x / advance + 0.5 * count;
    if place < 0.0 || place >= count {
        return 0.0;
    }
    let within = DVec2::new((place - place.floor() - 0.5) * 6.5, -at.y / dot);
    glyphs::coverage(words.as_bytes()[place as usize], within, finest / dot)
}

/// Ink of lines of small print.
fn small_print(at: DVec2, height: f64, seed: u32, finest: f64) -> f64 {
    let dot = height / 7.0;
    let (advance, leading) = (6.5 * dot, 11.0 * dot);
    let (column, row) = ((at.x / advance).floor(), (at.y / leading).floor());
    let (i, j) = (column as i32, row as i32);
    if unit(seed, i, j, 5) < 0.18 {
        return 0.0;
    }
    let within = DVec2::new(
        at.x / dot - (column + 0.5) * 6.5,
        (row + 0.5) * 11.0 - at.y / dot,
    );
    glyphs::coverage(random_glyph(seed, i, j), within, finest / dot)
}

pub(crate) fn label(
    at: &Surface,
    paper: DVec3,
    band_color: DVec3,
    ink: DVec3,
    half_height: f64,
    seed: u32,
    finest: f64,
) -> DVec3 {
    let p = at.along;
    let grain = 1.0 + 0.12 * (fractal2(seed, p, 0.02, finest) - 0.5);
    if at.face != 0 {
        // A tin's lid: rings.
        let r = p.length();
        let rings = 0.5 + 0.5 * (TURN * r / (5.0 * finest)).sin();
        return DVec3::splat(0.35 + 0.15 * rings) * grain;
    }
    let y = p.y / half_height;
    let soft = finest / half_height;
    let rim = edge(y.abs(), 0.95, soft);
    let bands = edge(y.abs(), 0.62, soft) * (1.0 - rim);
    let hairline = band(y.abs(), 0.55, 0.58, soft);
    // The front is repeated on the back.
    let radius = DVec2::new(at.point.x, at.point.z).length();
    let half_turn = 0.5 * TURN * radius;
    let x = p.x - half_turn * (p.x / half_turn).round();
    let title = text(
        "LUMI",
        DVec2::new(x, p.y - 0.27 * half_height),
        (0.36 * half_height).min(0.5 * radius),
        finest,
    );
    let subtitle = text(
        "GRAPH",
        DVec2::new(x, p.y + 0.06 * half_height),
        (0.24 * half_height).min(0.38 * radius),
        finest,
    );
    let below = band(p.y, -0.53 * half_height, -0.24 * half_height, finest);
    let print = 0.8 * below * small_print(p, 0.085 * half_height, seed, finest);
    let dots = {
        let step = 0.16 * half_height;
        let q = DVec2::new(
            p.x - step * (p.x / step).round(),
            p.y.abs() - 0.78 * half_height,
        );
        1.0 - edge(q.length(), 0.05 * half_height, finest)
    };
    let mut color = paper.lerp(band_color, bands).lerp(band_color, hairline);
    color = color.lerp(ink, title.max(subtitle).max(print));
    color = color.lerp(paper, dots * bands);
    color.lerp(DVec3::splat(0.5), rim) * grain
}

pub(crate) fn book(
    at: &Surface,
    cloth: DVec3,
    half: DVec3,
    title: &str,
    seed: u32,
    finest: f64,
) -> DVec3 {
    let p = at.along;
    let weave = fractal2(seed, p, 0.012, finest) - 0.5;
    let worn = fractal2(seed + 3, p, 0.15, 0.02) - 0.5;
    let cloth = cloth * (1.0 + 0.5 * weave + 0.3 * worn);
    let gilt = rgb(0xd9b45a) * (1.0 + 0.5 * weave);
    match at.face {
        // The edges: pages between two boards.
        0 | 1 => {
            let board = edge(p.y.abs(), half.y - 0.004, finest);
            let leaves = fractal2(seed, DVec2::new(0.05 * p.x, p.y), 0.012, 0.5 * finest) - 0.5;
            let pages = rgb(0xe6dabd) * (1.0 + 0.7 * leaves);
            pages.lerp(cloth, board)
        }
        // The boards: a gilt frame.
        2 | 3 => {
            let away = (DVec2::new(half.x, half.z) - p.abs()).min_element();
            let frame = band(away, 0.014, 0.018, finest).max(band(away, 0.023, 0.025, finest));
            cloth.lerp(gilt, 0.8 * frame)
        }
        // The back: title and bands.
        _ => {
            let raised = [0.62, 0.78, 0.82]
                .iter()
                .map(|&part| band(p.x.abs() / half.x, part, part + 0.02, finest / half.x))
                .fold(0.0, f64::max);
            let x = if at.face == 4 { p.x } else { -p.x };
            let letters = text(title, DVec2::new(x, p.y), 1.05 * half.y, finest);
            cloth.lerp(gilt, 0.9 * raised.max(letters))
        }
    }
}

pub(crate) fn block(
    at: &Surface,
    paint: DVec3,
    half: f64,
    letters: &str,
    seed: u32,
    finest: f64,
) -> DVec3 {
    let p = at.along;
    let bare = wood(
        p + DVec2::splat(f64::from(at.face)),
        rgb(0xe8c48e),
        rgb(0xc8955a),
        10.0,
        seed + u32::from(at.face),
        finest,
    );
    let away = half - p.abs().max_element();
    let border = band(away, 0.08 * half, 0.24 * half, finest);
    let letter = letters
        .as_bytes()
        .get(at.face as usize % letters.len().max(1))
        .copied()
        .unwrap_or(b' ');
    let dot = half / 6.5;
    let mirrored = if matches!(at.face, 0 | 5) { -1.0 } else { 1.0 };
    let upright = if at.face == 2 { 1.0 } else { -1.0 };
    let place = DVec2::new(mirrored * p.x, upright * p.y) / dot;
    let ink = glyphs::coverage(letter, place, finest / dot).max(border);
    bare.lerp(paint, 0.9 * ink)
}

pub(crate) fn painting(at: &Surface, half: DVec3, motif: Motif, seed: u32, finest: f64) -> DVec3 {
    let p = at.along;
    let frame_wood =
        |along: DVec2| wood(along, rgb(0x7a4a26), rgb(0x4a2914), 10.0, seed + 5, finest);
    if at.face != 4 {
        return frame_wood(p);
    }
    let half = half.truncate();
    // 1. From outside in: frame, gilt line, mount, canvas.
    let from_side = half - p.abs();
    let away = from_side.min_element();
    let upright = from_side.x < from_side.y;
    let along = if upright { DVec2::new(p.y, p.x) } else { p };
    // Mitred bars that catch the light from the upper left.
    let lit = match (upright, p.x > 0.0, p.y > 0.0) {
        (true, false, _) | (false, _, true) => 1.25,
        _ => 0.75,
    };
    let frame_width = 0.028;
    let bevel = 1.0 + 0.5 * (TURN * away / frame_width).sin();
    let frame = frame_wood(along) * lit * bevel;
    let gilt = rgb(0xe0bd66) * lit;
    let mount = rgb(0xf2ebda) * (1.0 + 0.15 * (fractal2(seed, p, 0.01, finest) - 0.5));
    let canvas_half = half - DVec2::splat(frame_width + 0.034);
    let canvas = match motif {
        Motif::Hills => hills(p / canvas_half.y, seed, finest / canvas_half.y),
        Motif::Abstract => discs(p / canvas_half.x, seed, finest / canvas_half.x),
    };
    let mut color = frame;
    color = color.lerp(gilt, band(away, frame_width - 0.006, frame_width, finest));
    color = color.lerp(mount, edge(away, frame_width, finest));
    let line = band(away, frame_width + 0.026, frame_width + 0.028, finest);
    color = color.lerp(rgb(0x6f6047), 0.8 * line);
    color.lerp(canvas, edge(away, frame_width + 0.034, finest))
}

/// Hills under an evening sky; y from −1 to 1.
fn hills(p: DVec2, seed: u32, finest: f64) -> DVec3 {
    let stroke = fractal2(seed, p * DVec2::new(1.0, 2.2), 0.35, finest) - 0.5;
    let mut color = rgb(0xf6c97f).lerp(rgb(0x5f8fb8), edge(p.y, 0.45, 1.3));
    let clouds = fractal2(seed + 4, p * DVec2::new(0.6, 2.0), 0.9, finest);
    color = color.lerp(
        rgb(0xfbe6cf),
        0.8 * edge(clouds, 0.55, 0.15) * edge(p.y, 0.2, 0.4),
    );
    let sun = p.distance(DVec2::new(0.45, 0.22));
    color = color.lerp(rgb(0xfff3c4), 1.0 - edge(sun, 0.15, 2.0 * finest));
    let layers = [
        (0.18, 0x6f86a6),
        (-0.05, 0x56798a),
        (-0.30, 0x567a4a),
        (-0.62, 0x2f5133),
    ];
    for (layer, (level, hue)) in layers.into_iter().enumerate() {
        let along = DVec2::new(p.x, 9.0 * layer as f64);
        let ridge = level + 0.5 * (fractal2(seed + 20, along, 0.9, finest) - 0.5);
        let inside = 1.0 - edge(p.y, ridge, 1.5 * finest);
        let fields = 1.0 + 0.35 * edge(ridge - p.y, 0.12, 0.25);
        color = color.lerp(rgb(hue) * fields, inside);
    }
    color * (1.0 + 0.55 * stroke)
}

/// Overlapping discs and bars; x from −1 to 1.
fn discs(p: DVec2, seed: u32, finest: f64) -> DVec3 {
    const HUES: [u32; 6] = [0xc8442f, 0xe6a52e, 0x2c6e7a, 0x1f2f46, 0xe9dcc0, 0x7f9a5a];
    let grain = fractal2(seed, p, 0.2, finest) - 0.5;
    let mut color = rgb(0xeee3cb);
    for i in 0..7 {
        let center = DVec2::new(0.75 * signed(seed, i, 0, 0), 1.05 * signed(seed, i, 1, 0));
        let radius = 0.16 + 0.36 * unit(seed, i, 2, 0);
        let r = p.distance(center);
        let hue = rgb(HUES[i as usize % HUES.len()]);
        let shape = if i % 3 == 2 {
            band(r, 0.6 * radius, radius, 1.5 * finest)
        } else {
            1.0 - edge(r, radius, 1.5 * finest)
        };
        color = color.lerp(hue, 0.93 * shape);
    }
    let slanted = 0.8 * p.x + 0.6 * p.y;
    let bars = lines(slanted, 0.55, 0.035, 1.5 * finest);
    color = color.lerp(rgb(0x1f2f46), 0.9 * bars);
    color * (1.0 + 0.4 * grain)
}
