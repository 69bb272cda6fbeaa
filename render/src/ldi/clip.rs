//! Which columns of an LDI one can see through its portal (Popescu et al. 1998, §3.2.4).
//!
//! A binary tree has the least and the greatest inverse depth of runs of columns. A run lies
//! between eight points: its corners at both. What they span in the desired image holds all of
//! its samples. Here a column is in sixteen parts, one above the other, each with its own depths:
//! floors and ceilings are near where walls are not.

use super::Layered;
use super::free::bounds;
use crate::interior::{Pinhole, Target, Warp, Window};
use glam::DVec2;
use std::ops::Range;

/// The columns that are left.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Clipped {
    /// From left to right, apart from one another.
    pub kept: Vec<Range<u32>>,
}

impl Clipped {
    /// All columns.
    pub fn whole(ldi: &Layered) -> Self {
        let kept = std::iter::once(0..ldi.size()[0]).collect();
        Self { kept }
    }

    /// How many samples they have.
    pub fn samples(&self, ldi: &Layered) -> usize {
        let rows = 0..ldi.size()[1];
        let in_row = |row| {
            let count = |columns: &Range<u32>| ldi.samples_of(columns.clone(), row).len();
            self.kept.iter().map(count).sum::<usize>()
        };
        rows.map(in_row).sum()
    }
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
            let part = y as usize * PARTS / height as usize;
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
        let mut kept = Clipped::default();
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
        self.ask(&warp, [low, high], 1, 0..leaves as u32, &mut kept);
        kept
    }

    fn ask(
        &self,
        warp: &Warp,
        open: [DVec2; 2],
        node: usize,
        columns: Range<u32>,
        kept: &mut Clipped,
    ) {
        let to = columns.end.min(self.width);
        let parts = self.nodes[node].iter().enumerate();
        let places = parts
            .filter(|(_, [least, greatest])| least <= greatest)
            .map(|(part, depths)| self.place(warp, open, columns.start..to, part, *depths));
        match places.fold(Place::Outside, Place::max) {
            Place::Outside => {}
            Place::Across if node < self.nodes.len() / 2 => {
                let middle = columns.start.midpoint(columns.end);
                self.ask(warp, open, 2 * node, columns.start..middle, kept);
                self.ask(warp, open, 2 * node + 1, middle..columns.end, kept);
            }
            _ => match kept.kept.last_mut() {
                Some(last) if last.end == columns.start => last.end = to,
                _ => kept.kept.push(columns.start..to),
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
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Place {
    Outside,
    Across,
    Inside,
}
