//! Floor plans to look at: seen from above, the level's first axis to the right.

use super::{FoundInterior, Place};
use glam::{DVec2, DVec3};
use image::{Rgb, RgbImage};
use std::fmt::Write;

/// Of rooms, one after the other.
const COLORS: [u32; 8] = [
    0xcfe3f7, 0xf9dcc0, 0xd3efd0, 0xf6d0d8, 0xe3d7f3, 0xf5f0bd, 0xcdeeea, 0xe8dccb,
];
const WALL: u32 = 0x333333;
const LINTEL: u32 = 0xb0a090;
const FREE: u32 = 0xe4e4e4;
const DOORWAY: u32 = 0xc0392b;
const WINDOW: u32 = 0x2c6fbb;
/// Pixels for a square of the floor grid.
const SCALE: usize = 4;
/// Pixels of a picture's longer side.
const MOST_PIXELS: usize = 4096;

fn fill(place: Place) -> Option<u32> {
    match place {
        Place::Unknown => None,
        Place::Wall => Some(WALL),
        Place::Lintel => Some(LINTEL),
        Place::Free => Some(FREE),
        Place::Room(id) => Some(COLORS[id.0 as usize % COLORS.len()]),
    }
}

/// What is drawn over the squares, in squares from the plan's first corner.
struct Lines {
    /// By cell.
    outlines: Vec<Vec<DVec2>>,
    /// Both ends, and the colour.
    portals: Vec<([DVec2; 2], u32)>,
}

impl FoundInterior {
    fn lines(&self) -> Lines {
        let plan = &self.plan;
        let place = |p: DVec3| (plan.level.to_level(p).truncate() - plan.origin) / plan.cell_size;
        let outlines = self.interior.cells.iter().map(|cell| {
            let corners: Vec<DVec3> = match (&cell.floor, cell.content.room()) {
                (Some(floor), _) => floor.corners().to_vec(),
                (None, Some(room)) => {
                    // A box without a floor lies along the level's axes.
                    let [a, b] = [room.min, room.max].map(|p| plan.level.to_level(p));
                    let (low, high) = (a.min(b), a.max(b));
                    let corners = [
                        (low.x, low.y),
                        (high.x, low.y),
                        (high.x, high.y),
                        (low.x, high.y),
                    ];
                    let world = |(x, y)| plan.level.to_world(DVec2::new(x, y), 0.0);
                    corners.map(world).to_vec()
                }
                (None, None) => Vec::new(),
            };
            corners.into_iter().map(place).collect()
        });
        let outlines = outlines.collect();
        let portals = self.interior.portals.iter().map(|portal| {
            let corners = portal.polygon.corners();
            let heights = corners.iter().map(|p| plan.level.height(*p));
            let sill = heights.fold(f64::INFINITY, f64::min);
            let color = if sill > 1e-6 { WINDOW } else { DOORWAY };
            let places: Vec<DVec2> = corners.iter().map(|p| place(*p)).collect();
            // The corner farthest from the first on the plan.
            let far = places.iter().fold(places[0], |best, p| {
                match p.distance(places[0]) > best.distance(places[0]) {
                    true => *p,
                    false => best,
                }
            });
            ([places[0], far], color)
        });
        let portals = portals.collect();
        Lines { outlines, portals }
    }

    /// The floor plan as SVG: walls as found, rooms' outlines, doorways red, windows blue.
    pub fn svg(&self) -> String {
        let [width, height] = self.plan.size;
        let scale = SCALE as f64;
        let (w, h) = (width as f64 * scale, height as f64 * scale);
        let at = |p: DVec2| (p.x * scale, h - p.y * scale);
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {w} {h}\" width=\"{w}\" \
             height=\"{h}\" font-family=\"sans-serif\" font-size=\"14\">\n\
             <rect width=\"{w}\" height=\"{h}\" fill=\"white\"/>\n"
        );
        let lines = self.lines();
        // Writing to a string cannot fail.
        for (i, outline) in lines.outlines.iter().enumerate() {
            let points = points(outline.iter().map(|p| at(*p)));
            let color = COLORS[i % COLORS.len()];
            let _ = writeln!(
                svg,
                "<polygon points=\"{points}\" fill=\"#{color:06x}\" stroke=\"#777\"/>"
            );
        }
        for (kind, color) in [(Place::Lintel, LINTEL), (Place::Wall, WALL)] {
            let mut path = String::new();
            for y in 0..height {
                let row = &self.plan.places[y * width..(y + 1) * width];
                let mut x = 0;
                while x < width {
                    let run = row[x..].iter().take_while(|p| **p == kind).count();
                    if run > 0 {
                        let (px, py) = at(DVec2::new(x as f64, y as f64 + 1.0));
                        let _ = write!(path, "M{px} {py}h{}v{scale}H{px}z", run as f64 * scale);
                    }
                    x += run.max(1);
                }
            }
            let _ = writeln!(svg, "<path d=\"{path}\" fill=\"#{color:06x}\"/>");
        }
        for ((ends, color), portal) in lines.portals.iter().zip(&self.interior.portals) {
            let [(ax, ay), (bx, by)] = ends.map(at);
            let _ = writeln!(
                svg,
                "<path d=\"M{ax:.1} {ay:.1}L{bx:.1} {by:.1}\" stroke=\"#{color:06x}\" \
                 stroke-width=\"4\"><title>{}</title></path>",
                escaped(&portal.name)
            );
        }
        for (cell, outline) in self.interior.cells.iter().zip(&lines.outlines) {
            let (x, y) = at(middle(outline));
            let _ = writeln!(
                svg,
                "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"middle\">{}</text>",
                escaped(&cell.name)
            );
        }
        // A metre, or whatever the world's unit is.
        let unit = scale / self.plan.cell_size;
        let _ = writeln!(
            svg,
            "<path d=\"M10 {0:.1}h{unit:.1}m0 -4v8M10 {1:.1}v8\" stroke=\"black\" fill=\"none\"/>\
             <text x=\"10\" y=\"{2:.1}\">1 unit</text>",
            h - 10.0,
            h - 14.0,
            h - 18.0
        );
        svg + "</svg>\n"
    }

    /// The floor plan as a picture; rooms are numbered from 1 as their cells are.
    pub fn picture(&self) -> RgbImage {
        let [width, height] = self.plan.size;
        let scale = (MOST_PIXELS / width.max(height).max(1)).clamp(1, SCALE);
        let size = [width, height].map(|n| (n * scale) as u32);
        let rgb = |color: u32| Rgb([16, 8, 0].map(|shift| (color >> shift) as u8));
        let square = |x: u32, y: u32| {
            let (x, y) = (x as usize / scale, height - 1 - y as usize / scale);
            let place = self.plan.places[y * width + x];
            rgb(fill(place).unwrap_or(0xffffff))
        };
        let mut picture = RgbImage::from_fn(size[0], size[1], square);
        let lines = self.lines();
        let mut dot = |p: DVec2, color: u32, reach: i64| {
            let (cx, cy) = (p.x * scale as f64, size[1] as f64 - p.y * scale as f64);
            for y in -reach..=reach {
                for x in -reach..=reach {
                    let (x, y) = (cx as i64 + x, cy as i64 + y);
                    if x >= 0 && y >= 0 && x < size[0].into() && y < size[1].into() {
                        picture.put_pixel(x as u32, y as u32, rgb(color));
                    }
                }
            }
        };
        for outline in &lines.outlines {
            for (i, a) in outline.iter().enumerate() {
                let b = outline[(i + 1) % outline.len()];
                let steps = (a.distance(b) * scale as f64).ceil().max(1.0) as usize;
                (0..=steps).for_each(|k| dot(a.lerp(b, k as f64 / steps as f64), 0x2e8b57, 0));
            }
        }
        for ([a, b], color) in &lines.portals {
            let steps = (a.distance(*b) * scale as f64).ceil().max(1.0) as usize;
            (0..=steps).for_each(|k| dot(a.lerp(*b, k as f64 / steps as f64), *color, 1));
        }
        for (i, outline) in lines.outlines.iter().enumerate() {
            let digits = (i + 1).to_string();
            let pixel = 3.0 / scale as f64;
            for (k, digit) in digits.bytes().enumerate() {
                let glyph = DIGITS[usize::from(digit - b'0')];
                for bit in (0..15).filter(|bit| glyph >> (14 - bit) & 1 == 1) {
                    let column = (bit % 3) as f64 + 4.0 * k as f64 - 2.0 * digits.len() as f64;
                    let offset = DVec2::new(column, 2.0 - (bit / 3) as f64);
                    dot(middle(outline) + pixel * offset, 0x000000, 1);
                }
            }
        }
        picture
    }
}

/// Three by five bits each, the first row first.
const DIGITS: [u16; 10] = [
    0b111_101_101_101_111,
    0b010_110_010_010_111,
    0b111_001_111_100_111,
    0b111_001_111_001_111,
    0b101_101_111_001_001,
    0b111_100_111_001_111,
    0b111_100_111_101_111,
    0b111_001_010_010_010,
    0b111_101_111_101_111,
    0b111_101_111_001_111,
];

fn middle(outline: &[DVec2]) -> DVec2 {
    outline.iter().sum::<DVec2>() / outline.len().max(1) as f64
}

fn points(places: impl Iterator<Item = (f64, f64)>) -> String {
    let mut text = String::new();
    for (x, y) in places {
        let _ = write!(text, "{x:.1},{y:.1} ");
    }
    text.trim_end().to_owned()
}

fn escaped(name: &str) -> String {
    name.replace('&', "&amp;").replace('<', "&lt;")
}
