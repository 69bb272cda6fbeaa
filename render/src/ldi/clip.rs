//! Which columns of an LDI one can see through its portal (Popescu et al. 1998, §3.2.4).
//!
//! A binary tree has the least and the greatest inverse depth of runs of columns. A run lies
//! between eight points: its corners at both. What they span in the desired image holds all of
//! its samples. Here a column is in sixteen parts, one above the other, each with its own depths
//! and kept or not by itself: floors and ceilings are near where walls are not, and out of sight.

use super::Layered;
use super::free::bounds;
use crate::interior::{Pinhole, Target, Warp, Window};
use glam::DVec2;
use std::ops::Range;

/// The columns that are left, in each part of the rows.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Clipped {
    /// From left to right, apart from one another; parts from top to bottom.
    parts: Vec<Vec<Range<u32>>>,
    height: u32,
}

impl Clipped {
    /// All columns.
    pub fn whole(ldi: &Layered) -> Self {
        let [width, height] = ldi.size();
        Self {
            parts: vec![std::iter::once(0..width).collect()],
            height,
        }
    }

    /// Given columns, in all rows.
    pub fn of_columns(ldi: &Layered, columns: Vec<Range<u32>>) -> Self {
        Self {
            parts: vec![columns],
            height: ldi.size()[1],
        }
    }

    /// Those of a row.
    pub fn of_row(&self, row: u32) -> &[Range<u32>] {
        &self.parts[part_of(row, self.height, self.parts.len())]
    }

    /// Whether nothing is left.
    pub fn is_empty(&self) -> bool {
        self.parts.iter().all(Vec::is_empty)
    }

    /// How many samples they have.
    pub fn samples(&self, ldi: &Layered) -> usize {
        let rows = 0..ldi.size()[1];
        let in_row = |row| {
            let count = |columns: &Range<u32>| ldi.samples_of(columns.clone(), row).len();
            self.of_row(row).iter().map(count).sum::<usize>()
        };
        rows.map(in_row).sum()
    }
}

/// Which of so many parts a row is in.
fn part_of(row: u32, height: u32, parts: usize) -> usize {
    row as usize * parts / height as usize
}

/// The least and greatest inverse depths of runs of columns.
#[derive(Clone, Debug)]
pub struct ClipTree {
    width: u32,
    height: u32,
    /// The first is all columns; below the i-th are the 2i-th and the next, counted from 1.
    /// The least is above the greatest where there are no samples.
    nodes: Vec<[[f32; 2]; PARTS]>,
}

/// Parts of a column.
const PARTS: usize = 16;
const EMPTY: [f32; 2] = [f32::INFINITY, f32::NEG_INFINITY];
/// Added to how far splats reach, in pixels: rounding to f32.
const SLACK: f64 = 0.5;

impl ClipTree {
    /// Of an LDI.
    pub fn new(ldi: &Layered) -> Self {
        let [width, height] = ldi.size();
        let leaves = (width as usize).next_power_of_two();
        let mut nodes = vec![[EMPTY; PARTS]; 2 * leaves];
        for y in 0..height {
            let part = part_of(y, height, PARTS);
            for i in ldi.samples_of(0..width, y) {
                let s = ldi.inverse_depth[i];
                // At most half a pixel from its column's middle, so in it.
                let column = (ldi.x[i] as u32).min(width - 1);
                let leaf = &mut nodes[leaves + column as usize][part];
                *leaf = [leaf[0].min(s), leaf[1].max(s)];
            }
        }
        for i in (1..leaves).rev() {
            let [a, b] = [nodes[2 * i], nodes[2 * i + 1]];
            for part in 0..PARTS {
                let ([low, high], [l, h]) = (a[part], b[part]);
                nodes[i][part] = [low.min(l), high.max(h)];
            }
        }
        Self {
            width,
            height,
            nodes,
        }
    }

    /// What it takes in memory.
    pub fn bytes(&self) -> u64 {
        size_of_val(self.nodes.as_slice()) as u64
    }

    /// The columns of which something may be drawn in a window, where no splat reaches farther
    /// than that many pixels from its sample's place. Of another LDI's size, nothing is
    /// promised.
    pub fn columns(
        &self,
        ldi: &Layered,
        desired: &Pinhole,
        window: &Window,
        reach: f64,
    ) -> Clipped {
        let mut kept = Clipped {
            parts: vec![Vec::new(); PARTS],
            height: self.height,
        };
        // Only its size is asked.
        let target = Target {
            width: desired.width,
            height: desired.height,
            ..Target::default()
        };
        let Some([across, down]) = bounds(window, &target) else {
            return kept;
        };
        let far = reach + SLACK;
        let low = DVec2::new(f64::from(across.start), f64::from(down.start)) - far;
        let high = DVec2::new(f64::from(across.end), f64::from(down.end)) + far;
        let warp = Warp::new(&ldi.camera, desired);
        let leaves = self.nodes.len() / 2;
        for (part, kept) in kept.parts.iter_mut().enumerate() {
            self.ask(&warp, [low, high], part, 1, 0..leaves as u32, kept);
        }
        kept
    }

    fn ask(
        &self,
        warp: &Warp,
        open: [DVec2; 2],
        part: usize,
        node: usize,
        columns: Range<u32>,
        kept: &mut Vec<Range<u32>>,
    ) {
        let to = columns.end.min(self.width);
        let depths = self.nodes[node][part];
        if !(depths[0] <= depths[1]) {
            return;
        }
        match self.place(warp, open, columns.start..to, part, depths) {
            Place::Outside => {}
            Place::Across if node < self.nodes.len() / 2 => {
                let middle = columns.start.midpoint(columns.end);
                self.ask(warp, open, part, 2 * node, columns.start..middle, kept);
                self.ask(warp, open, part, 2 * node + 1, middle..columns.end, kept);
            }
            _ => match kept.last_mut() {
                Some(last) if last.end == columns.start => last.end = to,
                _ => kept.push(columns.start..to),
            },
        }
    }

    fn place(
        &self,
        warp: &Warp,
        [low, high]: [DVec2; 2],
        columns: Range<u32>,
        part: usize,
        depths: [f32; 2],
    ) -> Place {
        // The first rows of a part and of the next.
        let row = |part: usize| (part * self.height as usize).div_ceil(PARTS) as f64;
        let (mut least, mut most) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        let (mut before, mut behind) = (0, 0);
        for x in [columns.start, columns.end].map(f64::from) {
            for y in [row(part), row(part + 1)] {
                let ray = warp.pixel_from_pixel * DVec2::new(x, y).extend(1.0);
                for s in depths.map(f64::from) {
                    let at = ray + s * warp.shift;
                    if at.z > 0.0 {
                        before += 1;
                        let at = at.truncate() / at.z;
                        (least, most) = (least.min(at), most.max(at));
                    } else {
                        behind += 1;
                    }
                }
            }
        }
        let is_apart = least.cmpgt(high).any() || most.cmplt(low).any();
        let is_within = least.cmpge(low).all() && most.cmple(high).all();
        match (before, behind) {
            (0, _) => Place::Outside,
            (_, 0) if is_apart => Place::Outside,
            (_, 0) if is_within => Place::Inside,
            _ => Place::Across,
        }
    }
}

/// How what a run of columns may cover lies to what is open.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Place {
    Outside,
    Across,
    Inside,
}
