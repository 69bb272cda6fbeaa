//! Where pixels' rays meet the plane before the camera.

use super::Threads;
use calibrate::{Distortion, Lens, Pixel, View};
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};

/// Pixels of a row whose bounds are kept together.
pub(super) const BLOCK: usize = 16;
/// Rays that are nearer than this to the plane z = 0, the z of unit vectors, are not ahead.
const AHEAD: f64 = 0.1;

/// The rays of all pixels' centres of a picture, where they all look ahead: a pinhole's as they are
/// needed, any other lens' in a table.
#[derive(Clone, Debug)]
pub struct Rays {
    pub(super) lens: Lens,
    /// Pixels across and down.
    pub(super) size: [usize; 2],
    pub(super) bent: Option<Arc<Bent>>,
}

/// Rays of a lens that bends them, each by where it meets the plane z = 1.
#[derive(Clone, Debug)]
pub(super) struct Bent {
    /// Row by row; not a number where the lens has no ray.
    pub(super) at: Vec<DVec2>,
    /// Of so many pixels of a row, row by row.
    pub(super) blocks: Vec<Bounds>,
    pub(super) rows: Vec<Bounds>,
    /// The least and the most that any column or one before it, or after it, has.
    columns_until: Vec<f64>,
    columns_from: Vec<f64>,
    rows_until: Vec<f64>,
    rows_from: Vec<f64>,
    /// Of all.
    pub(super) all: Bounds,
}

/// A rectangle in the plane z = 1.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    pub(super) least: DVec2,
    pub(super) most: DVec2,
}

impl Bounds {
    const NONE: Self = Self {
        least: DVec2::INFINITY,
        most: DVec2::NEG_INFINITY,
    };

    fn with(self, other: Self) -> Self {
        Self {
            least: self.least.min(other.least),
            most: self.most.max(other.most),
        }
    }

    /// Of points; those that are no numbers don't count.
    fn of(points: &[DVec2]) -> Self {
        let mut bounds = Self::NONE;
        for p in points.iter().filter(|p| !p.is_nan()) {
            bounds = bounds.with(Self {
                least: *p,
                most: *p,
            });
        }
        bounds
    }

    /// The most that side·(x, y, 1) is inside.
    pub(super) fn most_of(&self, side: DVec3) -> f64 {
        let x = if side.x > 0.0 {
            self.most.x
        } else {
            self.least.x
        };
        let y = if side.y > 0.0 {
            self.most.y
        } else {
            self.least.y
        };
        side.x * x + side.y * y + side.z
    }
}

impl Rays {
    /// Rays of so many pixels, of one lens or of several, are kept for whoever asks for them again: 64 MiB.
    pub const MOST_KEPT: usize = 1 << 22;

    /// `None` where some pixel looks aside or back.
    pub fn of(lens: &Lens, size: (u32, u32)) -> Option<Self> {
        Self::by(Threads::All, lens, size)
    }

    fn by(threads: Threads, lens: &Lens, (width, height): (u32, u32)) -> Option<Self> {
        let size = [width as usize, height as usize];
        let mut rays = Self {
            lens: *lens,
            size,
            bent: None,
        };
        if lens.distortion() != Distortion::None {
            rays.bent = Some(kept(lens, size, || Bent::of(threads, lens, size))?);
        }
        Some(rays)
    }

    /// Of a view's picture reduced so many times: the pixel in column i and row j looks along the ray
    /// of the view's pixel ((i + ½)·reduction, (j + ½)·reduction).
    pub fn reduced(view: &View, reduction: u32) -> Option<Self> {
        Self::reduced_by(Threads::All, view, reduction)
    }

    /// [`Self::reduced`] on this thread alone: see [`Solid::scan_alone`](crate::Solid::scan_alone).
    pub fn reduced_alone(view: &View, reduction: u32) -> Option<Self> {
        Self::reduced_by(Threads::This, view, reduction)
    }

    fn reduced_by(threads: Threads, view: &View, reduction: u32) -> Option<Self> {
        let step = f64::from(reduction).recip();
        let size = [view.width, view.height].map(|side| side.div_ceil(reduction));
        Self::by(threads, &view.lens.scaled(step, step), size.into())
    }

    /// Where the ray of a pixel's centre meets the plane z = 1; `None` where the lens has none.
    pub fn at(&self, column: usize, row: usize) -> Option<DVec2> {
        match &self.bent {
            None => {
                let center = DVec2::new(column as f64 + 0.5, row as f64 + 0.5);
                Some((center - self.lens.principal) / self.lens.focal)
            }
            Some(bent) => Some(bent.at[row * self.size[0] + column]).filter(|at| !at.is_nan()),
        }
    }

    /// Whether what pixels of a row see of a plane lies on a line.
    pub fn are_straight(&self) -> bool {
        self.bent.is_none()
    }
}

/// Of a lens, and a picture of so many pixels.
type OfLens = (Lens, [usize; 2], Arc<Bent>);

/// The last that were asked for, the latest last: photos of one camera have the same, and a photo that is drawn again.
static LAST: Mutex<Vec<OfLens>> = Mutex::new(Vec::new());

/// Those that are known, or what `find` finds. That may take long: others do not wait for it, and find the same.
fn kept(lens: &Lens, size: [usize; 2], find: impl FnOnce() -> Option<Bent>) -> Option<Arc<Bent>> {
    let lock = || LAST.lock().unwrap_or_else(PoisonError::into_inner);
    let take = |last: &mut Vec<OfLens>| {
        let place = last.iter().position(|of| (of.0, of.1) == (*lens, size));
        place.map(|place| last.remove(place))
    };
    {
        let mut last = lock();
        if let Some(known) = take(&mut last) {
            let bent = Arc::clone(&known.2);
            last.push(known);
            return Some(bent);
        }
    }
    let bent = Arc::new(find()?);
    if bent.at.len() <= Rays::MOST_KEPT {
        let mut last = lock();
        take(&mut last);
        last.push((*lens, size, Arc::clone(&bent)));
        while last.iter().map(|of| of.2.at.len()).sum::<usize>() > Rays::MOST_KEPT {
            last.remove(0);
        }
    }
    Some(bent)
}

impl Bent {
    fn of(threads: Threads, lens: &Lens, [width, height]: [usize; 2]) -> Option<Self> {
        let row = |y: usize| -> Option<Vec<DVec2>> {
            let of_column = |x: usize| {
                let center = Pixel::center_of(x as u32, y as u32);
                match lens.unproject(center) {
                    None => Some(DVec2::NAN),
                    Some(ray) => (ray.z > AHEAD).then(|| ray.truncate() / ray.z),
                }
            };
            (0..width).map(of_column).collect()
        };
        let at: Option<Vec<Vec<DVec2>>> = match threads {
            Threads::All => (0..height).into_par_iter().map(row).collect(),
            Threads::This => (0..height).map(row).collect(),
        };
        let at = at?.concat();
        let mut blocks = Vec::new();
        let mut rows = Vec::new();
        let mut columns = vec![Bounds::NONE; width];
        for row in at.chunks(width.max(1)) {
            let first = blocks.len();
            blocks.extend(row.chunks(BLOCK).map(Bounds::of));
            let of_row = blocks[first..].iter().copied();
            rows.push(of_row.fold(Bounds::NONE, Bounds::with));
            for (column, at) in columns.iter_mut().zip(row) {
                *column = column.with(Bounds::of(std::slice::from_ref(at)));
            }
        }
        let until = |bounds: &[Bounds], axis: usize| {
            let mut most = f64::NEG_INFINITY;
            let next = |b: &Bounds| {
                most = most.max(b.most[axis]);
                most
            };
            bounds.iter().map(next).collect::<Vec<f64>>()
        };
        let from = |bounds: &[Bounds], axis: usize| {
            let mut least = f64::INFINITY;
            let next = |b: &Bounds| {
                least = least.min(b.least[axis]);
                least
            };
            let mut all: Vec<f64> = bounds.iter().rev().map(next).collect();
            all.reverse();
            all
        };
        Some(Self {
            all: rows.iter().copied().fold(Bounds::NONE, Bounds::with),
            columns_until: until(&columns, 0),
            columns_from: from(&columns, 0),
            rows_until: until(&rows, 1),
            rows_from: from(&rows, 1),
            at,
            blocks,
            rows,
        })
    }

    /// The columns and rows that may have rays between two places.
    pub(super) fn within(&self, least: DVec2, most: DVec2) -> [Range<usize>; 2] {
        let range = |until: &[f64], from: &[f64], least: f64, most: f64| {
            // Before the first, none so far reaches it; from the last on all are beyond.
            let first = until.partition_point(|reached| *reached < least);
            let last = from.partition_point(|begun| *begun <= most);
            first..last.max(first)
        };
        [
            range(&self.columns_until, &self.columns_from, least.x, most.x),
            range(&self.rows_until, &self.rows_from, least.y, most.y),
        ]
    }
}
