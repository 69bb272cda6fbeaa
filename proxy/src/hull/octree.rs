//! The cells of space that the silhouettes' borders cross, level by level.

use super::witness::Witness;
use glam::{DVec3, UVec3};
use rayon::prelude::*;

/// Cells judged in one go by one thread.
const BATCH: usize = 512;

/// One level of the octree: of all its cubes, those that are neither known to lie outside
/// the hull nor inside.
///
/// Larger cubes that are known are not kept, nor is anything above this level: the hull's
/// surface runs through these cells only.
#[derive(Clone, Debug)]
pub(super) struct Level {
    /// The corner of the root with the least coordinates, in the world.
    pub(super) origin: DVec3,
    /// A cell's side.
    pub(super) side: f64,
    /// How many of them make a side of the root.
    pub(super) across: u32,
    /// In an order that depends on the root alone.
    pub(super) cells: Vec<Cell>,
    /// The photos that the cells leave open, one list after the other.
    open: Vec<u16>,
}

/// A cell of a level.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cell {
    /// Its place in the root, counted in cells.
    pub(super) at: UVec3,
    /// Of the photos that may still contradict, so many may.
    misses_left: u16,
    open_count: u16,
    open_start: u32,
}

/// What a level's cells turned out to be when they were divided.
pub(super) struct Divided {
    /// Their children that are still open.
    pub(super) level: Level,
    /// The places of children known to lie inside.
    pub(super) inside: Vec<UVec3>,
}

enum Verdict {
    Outside,
    Inside,
    Open { misses_left: u16 },
}

impl Level {
    /// The root alone, with nothing known about it.
    pub(super) fn root(origin: DVec3, side: f64, photos: usize, misses: u16) -> Self {
        let cell = Cell {
            at: UVec3::ZERO,
            misses_left: misses,
            open_count: photos as u16,
            open_start: 0,
        };
        Self {
            origin,
            side,
            across: 1,
            cells: vec![cell],
            open: (0..photos as u16).collect(),
        }
    }

    /// Where a corner of the lattice lies in the world.
    pub(super) fn corner(&self, at: UVec3) -> DVec3 {
        self.origin + self.side * at.as_dvec3()
    }

    /// How far inside the hull a point of a cell lies, in pixels: the least of what its
    /// photos say, but for so many of them as may be wrong.
    pub(super) fn depth_px(&self, cell: &Cell, witnesses: &[Witness], point: DVec3) -> f64 {
        let said = self.open(cell);
        let said = said.iter().map(|i| witnesses[usize::from(*i)].at(point));
        least_but(usize::from(cell.misses_left), said)
    }

    fn open(&self, cell: &Cell) -> &[u16] {
        &self.open[cell.open_start as usize..][..usize::from(cell.open_count)]
    }

    /// Divides every cell into eight and drops those that are known to lie outside or
    /// inside. What a photo says of a cell for certain holds for its children, which are
    /// not asked about it again.
    pub(super) fn divided(&self, witnesses: &[Witness]) -> Divided {
        let side = 0.5 * self.side;
        let half_diagonal = 0.5 * 3.0_f64.sqrt() * side;
        let batches: Vec<_> = self
            .cells
            .par_chunks(BATCH)
            .map(|cells| {
                let (mut kept, mut open, mut inside) = (Vec::new(), Vec::new(), Vec::new());
                for cell in cells {
                    for child in 0..8 {
                        let at = 2 * cell.at + bits(child);
                        let center = self.origin + side * (at.as_dvec3() + 0.5);
                        let open_start = open.len();
                        match self.judge(cell, witnesses, center, half_diagonal, &mut open) {
                            Verdict::Outside => {}
                            Verdict::Inside => inside.push(at),
                            Verdict::Open { misses_left } => kept.push(Cell {
                                at,
                                misses_left,
                                open_count: (open.len() - open_start) as u16,
                                open_start: open_start as u32,
                            }),
                        }
                    }
                }
                (kept, open, inside)
            })
            .collect();
        let mut level = Self {
            origin: self.origin,
            side,
            across: 2 * self.across,
            cells: Vec::new(),
            open: Vec::new(),
        };
        let mut inside = Vec::new();
        for (kept, open, known) in batches {
            let start = level.open.len() as u32;
            level.cells.extend(kept.into_iter().map(|cell| Cell {
                open_start: cell.open_start + start,
                ..cell
            }));
            level.open.extend(open);
            inside.extend(known);
        }
        Divided { level, inside }
    }

    /// Judges a child of `cell`; the photos that it leaves open are added to `open`.
    fn judge(
        &self,
        cell: &Cell,
        witnesses: &[Witness],
        center: DVec3,
        radius: f64,
        open: &mut Vec<u16>,
    ) -> Verdict {
        let before = open.len();
        let mut misses_left = cell.misses_left;
        for &i in self.open(cell) {
            let (low, high) = witnesses[usize::from(i)].range(center, radius);
            if high < 0.0 {
                let Some(left) = misses_left.checked_sub(1) else {
                    open.truncate(before);
                    return Verdict::Outside;
                };
                misses_left = left;
            } else if low <= 0.0 {
                open.push(i);
            }
        }
        if open.len() - before > usize::from(misses_left) {
            return Verdict::Open { misses_left };
        }
        open.truncate(before);
        Verdict::Inside
    }
}

/// The corner of a unit cube: its bits are x, y and z.
pub(super) fn bits(corner: u32) -> UVec3 {
    UVec3::new(corner & 1, corner >> 1 & 1, corner >> 2 & 1)
}

/// The least of some values when the `count` least ones don't count; infinite where there
/// are no more.
fn least_but(count: usize, values: impl Iterator<Item = f64>) -> f64 {
    if count == 0 {
        return values.fold(f64::INFINITY, f64::min);
    }
    let mut values: Vec<f64> = values.collect();
    if values.len() <= count {
        return f64::INFINITY;
    }
    *values.select_nth_unstable_by(count, f64::total_cmp).1
}
