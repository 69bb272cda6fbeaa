//! Fragments of an LDI that are drawn at once (Popescu et al. 1998, §3.2.3).
//!
//! They are cut along epipolar lines, so that as many samples lie in each. Samples stay on their
//! line, so those of two fragments meet only beside a cut: where a sample's stamp may reach a cut
//! it is left to the buffer zone.

use super::{Clipped, Layered};
use glam::{DVec2, DVec3};
use std::f64::consts::PI;
use std::ops::Range;

/// Where an LDI is cut.
#[derive(Clone, Debug, PartialEq)]
pub struct Pieces {
    /// Of each fragment, its columns in rows, top to bottom.
    pub(super) spans: Vec<Vec<(u32, Range<u32>)>>,
    /// Between which lines it lies.
    pub(super) wedges: Vec<Wedge>,
}

/// What lies between two lines through the epipole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Wedge {
    /// Positive within, where the wedge is less than half a turn: a line of the LDI's pixels.
    pub(super) lines: [DVec3; 2],
    pub(super) is_convex: bool,
}

/// Pixels of a block whose samples are counted together, each way.
const BLOCK: u32 = 8;
/// Angles that are told apart.
const BINS: usize = 4096;
/// One over the distance of the farthest epipole, in pixels.
const NEAREST_INFINITY: f64 = 1e-9;
/// A line that is nowhere near.
const NOWHERE: DVec3 = DVec3::new(0.0, 0.0, 1e30);

/// The direction from a pixel to the epipole.
struct Pencil {
    epipole: DVec3,
    /// From the image's middle.
    ahead: DVec2,
}

impl Pencil {
    fn direction(&self, pixel: DVec2) -> DVec2 {
        self.epipole.truncate() - pixel * self.epipole.z
    }

    /// From the direction of the image's middle, -π to π.
    fn angle(&self, pixel: DVec2) -> f64 {
        let d = self.direction(pixel);
        let angle = self.ahead.perp_dot(d).atan2(self.ahead.dot(d));
        if angle.is_nan() { 0.0 } else { angle }
    }

    /// The direction at an angle.
    fn at(&self, angle: f64) -> DVec2 {
        DVec2::from_angle(angle).rotate(self.ahead)
    }

    /// Of pixels p, the line u × direction(p) = 0, positive where p's angle is the greater.
    fn line(&self, angle: f64) -> DVec3 {
        let (u, e) = (self.at(angle), self.epipole);
        DVec3::new(u.y * e.z, -u.x * e.z, u.x * e.y - u.y * e.x)
    }
}

impl Pieces {
    /// Cuts an LDI into that many fragments, around the epipole (homogeneous, in its pixels), by
    /// the samples in its columns.
    pub fn new(ldi: &Layered, columns: &Clipped, epipole: DVec3, count: usize) -> Self {
        let [width, height] = ldi.size();
        let size = DVec2::new(f64::from(width), f64::from(height));
        let epipole = match epipole.abs().max_element() {
            most if most > 0.0 && most.is_finite() => epipole / most,
            // Nothing moves: any lines do.
            _ => DVec3::X,
        };
        let mut epipole = if epipole.z < 0.0 { -epipole } else { epipole };
        // One at infinity is far off instead: its lines are parallel to a thousandth of a pixel.
        epipole.z = epipole.z.max(NEAREST_INFINITY);
        let middle = 0.5 * size;
        let mut pencil = Pencil {
            epipole,
            ahead: DVec2::X,
        };
        pencil.ahead = pencil.direction(middle).try_normalize().unwrap_or(DVec2::X);
        let at = epipole.truncate() / epipole.z;
        let is_inside = at.cmpge(DVec2::ZERO).all() && at.cmple(size).all();
        let cuts = cuts(ldi, columns, &pencil, count);
        // Which pixels of each row lie between which rays.
        let last = cuts.len();
        let mut spans = vec![Vec::new(); last + 1];
        let rays: Vec<(DVec2, DVec3)> = cuts
            .iter()
            .map(|a| (pencil.at(*a), pencil.line(*a)))
            .collect();
        let turn = is_inside.then(|| (-pencil.ahead, pencil.line(PI)));
        let mut crossings: Vec<u32> = Vec::new();
        for row in 0..height {
            let y = f64::from(row) + 0.5;
            crossings.clear();
            crossings.extend([0, width]);
            for (u, line) in rays.iter().chain(&turn) {
                let x = -(line.y * y + line.z) / line.x;
                let is_ahead = pencil.direction(DVec2::new(x, y)).dot(*u) >= 0.0;
                if x > 0.0 && x < size.x && is_ahead {
                    // The first pixel whose middle is beyond.
                    crossings.push((x + 0.5) as u32);
                }
            }
            // Beyond the epipole in its own row directions are the other ones.
            if at.x > 0.0 && at.x < size.x {
                crossings.push((at.x + 0.5) as u32);
            }
            crossings.sort_unstable();
            for pair in crossings.windows(2).filter(|pair| pair[0] < pair[1]) {
                let x = 0.5 * (f64::from(pair[0]) + f64::from(pair[1]));
                let angle = pencil.angle(DVec2::new(x, y));
                let i = cuts.partition_point(|cut| *cut <= angle);
                spans[i].push((row, pair[0]..pair[1]));
            }
        }
        let edge = |i: usize| match (i, is_inside) {
            (i, _) if i > 0 && i <= last => (cuts[i - 1], pencil.line(cuts[i - 1])),
            (0, true) => (-PI, pencil.line(-PI)),
            (_, true) => (PI, pencil.line(PI)),
            (0, false) => (-PI, NOWHERE),
            _ => (PI, -NOWHERE),
        };
        let wedge = |i: usize| {
            let [(from, a), (to, b)] = [edge(i), edge(i + 1)];
            Wedge {
                lines: [a, -b],
                // Outside of the epipole's turn all directions lie in half of one.
                is_convex: !is_inside || to - from < PI,
            }
        };
        Self {
            wedges: (0..=last).map(wedge).collect(),
            spans,
        }
    }

    /// How many samples each fragment has.
    pub fn areas(&self, ldi: &Layered, columns: &Clipped) -> Vec<usize> {
        let in_span = |(row, span): &(u32, Range<u32>)| {
            let common = columns.of_row(*row).iter().map(|c| overlap(c, span));
            common.map(|c| ldi.samples_of(c, *row).len()).sum::<usize>()
        };
        self.spans
            .iter()
            .map(|spans| spans.iter().map(in_span).sum())
            .collect()
    }
}

pub(super) fn overlap(a: &Range<u32>, b: &Range<u32>) -> Range<u32> {
    let start = a.start.max(b.start);
    start..a.end.min(b.end).max(start)
}

/// The angles that part an LDI's samples into equal shares, ascending.
fn cuts(ldi: &Layered, columns: &Clipped, pencil: &Pencil, count: usize) -> Vec<f64> {
    let [width, height] = ldi.size();
    let count = count.clamp(1, 1024);
    if count == 1 {
        return Vec::new();
    }
    let mut blocks: Vec<(f64, usize)> = Vec::new();
    for top in (0..height).step_by(BLOCK as usize) {
        for left in (0..width).step_by(BLOCK as usize) {
            let block = left..(left + BLOCK).min(width);
            let rows = top..(top + BLOCK).min(height);
            let in_row = |row| -> usize {
                let common = columns.of_row(row).iter().map(|c| overlap(c, &block));
                common.map(|c| ldi.samples_of(c, row).len()).sum()
            };
            let samples: usize = rows.map(in_row).sum();
            if samples > 0 {
                let half = 0.5 * f64::from(BLOCK);
                let middle = DVec2::new(f64::from(left), f64::from(top)) + half;
                blocks.push((pencil.angle(middle), samples));
            }
        }
    }
    let total: usize = blocks.iter().map(|(_, n)| n).sum();
    let angles = blocks.iter().map(|(angle, _)| *angle);
    let (low, high) = angles.fold((PI, -PI), |(l, h), a| (l.min(a), h.max(a)));
    let span = (high - low).max(1e-12);
    let mut bins = vec![0; BINS];
    for (angle, samples) in &blocks {
        let bin = ((angle - low) / span * BINS as f64) as usize;
        bins[bin.min(BINS - 1)] += samples;
    }
    let mut cuts: Vec<f64> = Vec::new();
    let mut sum = 0;
    for (bin, samples) in bins.iter().enumerate() {
        sum += samples;
        let next = cuts.len() + 1;
        if next < count && sum * count >= next * total && bin + 1 < BINS {
            let angle = low + span * (bin as f64 + 1.0) / BINS as f64;
            cuts.push(angle);
        }
    }
    cuts
}
