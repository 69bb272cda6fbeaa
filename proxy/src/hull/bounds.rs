//! Where the object is, from cameras and silhouettes alone.

use super::HullError;
use super::octree::{Divided, Level};
use super::silhouette::Silhouette;
use super::witness::{Witness, middle_ray};
use calibrate::View;
use glam::{DMat3, DVec3, UVec3};

/// The first cube searched is this many times as wide as the farthest camera is away.
const FIRST_ROOT: f64 = 4.0;
/// If the hull goes on beyond it, larger cubes are tried, each this many times as wide.
const GROWTH: f64 = 8.0;
const ROOTS: usize = 3;
/// The hull is found when so many cells lie across it.
const CELLS_ACROSS: u32 = 12;
/// A box that shrinks by less than this from one level to the next has settled.
const SETTLED: f64 = 0.8;
/// More levels mean a hull of less than a millionth of the cameras' distance.
const MOST_LEVELS: usize = 22;

/// A box around the hull.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bounds {
    pub(super) low: DVec3,
    pub(super) high: DVec3,
}

/// A box around all that the silhouettes allow, found by carving a large cube coarsely.
pub(super) fn find(
    views: &[&View],
    silhouettes: &[&Silhouette],
    witnesses: &[Witness],
    misses: u16,
) -> Result<Bounds, HullError> {
    // 1. The rays through the silhouettes' middles pass by the object.
    let rays: Vec<(DVec3, DVec3)> = views
        .iter()
        .zip(silhouettes)
        .filter_map(|(view, s)| Some((view.center(), middle_ray(view, s)?)))
        .collect();
    let first = rays.first().map_or(DVec3::ZERO, |ray| ray.0);
    let spread = rays
        .iter()
        .map(|ray| ray.0.distance(first))
        .fold(0.0, f64::max);
    let middle = nearest_to_rays(&rays).ok_or(HullError::NoParallax {
        photos: views.len(),
    })?;
    let farthest = rays
        .iter()
        .map(|ray| ray.0.distance(middle))
        .fold(0.0, f64::max);
    let scale = farthest.max(spread);
    if !(scale > 0.0) || !(spread > 1e-9 * middle.distance(first)) {
        return Err(HullError::NoParallax {
            photos: views.len(),
        });
    }
    // 2. Carve a cube around the object; if what is left touches its sides, a larger one.
    let mut side = FIRST_ROOT * scale;
    for _ in 0..ROOTS {
        // Odd parts: cameras arranged around a middle don't lie on the corners of cells.
        let origin = middle - side * DVec3::new(0.4871, 0.5093, 0.5037);
        let root = Level::root(origin, side, witnesses.len(), misses);
        match search(root, witnesses)? {
            Some(bounds) => return Ok(bounds),
            None => side *= GROWTH,
        }
    }
    Err(HullError::Unbounded {
        photos: views.len(),
    })
}

/// The box around what is left of a root; `None` where that touches the root's sides.
fn search(root: Level, witnesses: &[Witness]) -> Result<Option<Bounds>, HullError> {
    let photos = witnesses.len();
    let mut level = root;
    let mut solid: Option<Bounds> = None;
    let mut extent_before = f64::INFINITY;
    for _ in 0..MOST_LEVELS {
        let Divided {
            level: next,
            inside,
        } = level.divided(witnesses);
        level = next;
        let cells = |at: UVec3| Bounds {
            low: level.corner(at),
            high: level.corner(at + UVec3::ONE),
        };
        solid = inside
            .into_iter()
            .map(cells)
            .chain(solid)
            .reduce(Bounds::with);
        let open = level.cells.iter().map(|cell| cells(cell.at));
        let Some(all) = open.chain(solid).reduce(Bounds::with) else {
            return Err(HullError::Contradiction { photos });
        };
        // Cells around cameras are open until they are small: the box must have settled.
        let extent = (all.high - all.low).max_element();
        let settled = extent > SETTLED * extent_before;
        extent_before = extent;
        if !settled || extent < level.side * (f64::from(CELLS_ACROSS) - 0.5) {
            continue;
        }
        let last = level.corner(UVec3::splat(level.across));
        let clear = (all.low - level.origin).min(last - all.high).min_element();
        if clear > 0.5 * level.side {
            return Ok(Some(all));
        }
        // At first everything touches.
        if level.across > 4 * CELLS_ACROSS {
            return Ok(None);
        }
    }
    Err(HullError::Contradiction { photos })
}

impl Bounds {
    fn with(self, other: Self) -> Self {
        Self {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
        }
    }
}

/// The point nearest to all rays taken as lines, in the sense of least squares; `None`
/// where all are parallel.
fn nearest_to_rays(rays: &[(DVec3, DVec3)]) -> Option<DVec3> {
    let start = rays.first()?.0;
    let (mut matrix, mut sum) = (DMat3::ZERO, DVec3::ZERO);
    for (center, direction) in rays {
        let column = |i: usize| *direction * direction[i];
        let across = DMat3::IDENTITY - DMat3::from_cols(column(0), column(1), column(2));
        matrix += across;
        sum += across * (*center - start);
    }
    let scale = rays.len() as f64;
    if !(matrix.determinant() > 1e-9 * scale.powi(3)) {
        return None;
    }
    let middle = start + matrix.inverse() * sum;
    middle.is_finite().then_some(middle)
}
