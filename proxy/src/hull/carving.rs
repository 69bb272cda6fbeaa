//! How many misses masks need, and what a hull of few faces is made from.

use super::octree::Level;
use super::witness::{self, Witness};
use super::{HullError, Measures, Options, Silhouette, bounds, measure, pieces, simplify, surface};
use crate::Mesh;
use calibrate::View;
use rayon::prelude::*;

/// Steps from the tolerance and misses asked for, each one pixel or one miss.
const MOST_STEPS: usize = 3;
/// Of so many photos one may miss, two of twice as many, and so on.
const PHOTOS_A_MISS: usize = 10;
/// A surface that few faces follow this badly has more holes than they can follow: the IoU's
/// part that is left.
const FOLLOWED: f64 = 0.8;
/// So many more misses may close such holes.
const CLOSING_MISSES: u16 = 2;

/// Photos that say something, ready to be carved by.
pub(super) struct Carving<'a> {
    views: Vec<&'a View>,
    silhouettes: Vec<&'a Silhouette>,
    /// The same, no larger than asked for.
    reduced: Vec<(View, Silhouette)>,
    options: &'a Options,
}

/// A surface as carved.
pub(super) struct Carved {
    pub(super) mesh: Mesh,
    pub(super) measures: Measures,
    /// The side of the cells.
    pub(super) cell: f64,
    pub(super) tolerance_px: f64,
    pub(super) misses: u16,
}

impl<'a> Carving<'a> {
    pub(super) fn new(
        views: Vec<&'a View>,
        silhouettes: Vec<&'a Silhouette>,
        options: &'a Options,
    ) -> Self {
        let pairs = views.par_iter().zip(&silhouettes);
        let reduced = pairs.map(|(v, s)| reduce(v, s, options.longest_side_px));
        Self {
            reduced: reduced.collect(),
            views,
            silhouettes,
            options,
        }
    }

    /// The surface with the least tolerance and misses, from those asked for on, that cover
    /// as much of the silhouettes as asked for.
    ///
    /// Where silhouettes contradict one another a pixel more or a photo more may miss,
    /// whichever suffices and adds less around; if neither does, whichever covers more is
    /// where the next step is made from.
    pub(super) fn consistent(&self) -> Result<Carved, HullError> {
        let options = self.options;
        let mut best = self.surface(options.tolerance_px, options.misses)?;
        for _ in 0..MOST_STEPS {
            if best.measures.coverage >= options.least_coverage {
                break;
            }
            let (tolerance_px, misses) = (best.tolerance_px, best.misses);
            let next = [
                self.may_miss(misses + 1)
                    .then(|| self.surface(tolerance_px, misses + 1)),
                Some(self.surface(tolerance_px + 1.0, misses)),
            ];
            let next: Vec<Carved> = next.into_iter().flatten().filter_map(Result::ok).collect();
            let coverage = |carved: &Carved| carved.measures.coverage;
            let key = |carved: &Carved| {
                let suffices = coverage(carved) >= options.least_coverage;
                let value = if suffices {
                    carved.measures.iou
                } else {
                    coverage(carved)
                };
                (suffices, value)
            };
            let better = next
                .into_iter()
                .filter(|carved| coverage(carved) > coverage(&best))
                .reduce(|a, b| if key(&b) > key(&a) { b } else { a });
            match better {
                Some(better) => best = better,
                None => break,
            }
        }
        Ok(best)
    }

    /// The surface with so many faces, or as near to that as simplifying comes; it contains
    /// the one given.
    ///
    /// Where so few faces follow it badly they are given to one with more misses, which has
    /// fewer holes.
    pub(super) fn simplified(&self, carved: &Carved, faces: usize) -> (Mesh, Measures) {
        let mut best = self.with_faces(&carved.mesh, faces);
        let follows = |found: &(Mesh, Measures)| {
            found.1.faces <= faces && found.1.iou >= FOLLOWED * carved.measures.iou
        };
        for more in 1..=CLOSING_MISSES {
            let misses = carved.misses + more;
            if follows(&best) || !self.may_miss(misses) {
                break;
            }
            let Ok(fuller) = self.surface(carved.tolerance_px, misses) else {
                break;
            };
            let found = self.with_faces(&fuller.mesh, faces);
            let key = |found: &(Mesh, Measures)| (found.1.faces <= faces, found.1.iou);
            if found.1.coverage >= carved.measures.coverage && key(&found) > key(&best) {
                best = found;
            }
        }
        best
    }

    fn may_miss(&self, misses: u16) -> bool {
        PHOTOS_A_MISS * usize::from(misses) <= self.views.len()
    }

    fn surface(&self, tolerance_px: f64, misses: u16) -> Result<Carved, HullError> {
        let witnesses: Vec<Witness> = self
            .reduced
            .par_iter()
            .map(|(view, silhouette)| Witness::new(view, silhouette, tolerance_px))
            .collect();
        // 1. Where the object is, and the cells around its surface.
        let (views, silhouettes): (Vec<&View>, Vec<&Silhouette>) =
            self.reduced.iter().map(|(view, s)| (view, s)).unzip();
        let bounds = bounds::find(&views, &silhouettes, &witnesses, misses)?;
        let level = self.finest(&bounds, &witnesses, misses);
        // 2. The surface.
        let surface = surface::extract(&level, &witnesses);
        if surface.triangles.is_empty() {
            return Err(HullError::Contradiction {
                photos: self.views.len(),
            });
        }
        let mesh = pieces::needed(&surface, &self.views, &self.silhouettes);
        let measures = self.measured(&mesh);
        Ok(Carved {
            mesh,
            measures,
            cell: level.side,
            tolerance_px,
            misses,
        })
    }

    fn measured(&self, mesh: &Mesh) -> Measures {
        measure::compare(mesh, &self.views, &self.silhouettes)
    }

    fn with_faces(&self, mesh: &Mesh, faces: usize) -> (Mesh, Measures) {
        // Specks that the rest has grown around go, so that what stays gets their faces.
        let mut simple = simplify(mesh, 3 * faces);
        for _ in 0..2 {
            simple = pieces::needed(&simple, &self.views, &self.silhouettes);
            simple = simplify(&simple, faces);
        }
        let measures = self.measured(&simple);
        (simple, measures)
    }

    /// The level of cells that are as small as asked for.
    fn finest(&self, bounds: &bounds::Bounds, witnesses: &[Witness], misses: u16) -> Level {
        let extent = bounds.high - bounds.low;
        let middle = bounds.low + 0.5 * extent;
        let mut pixels: Vec<f64> = self
            .views
            .iter()
            .zip(witnesses)
            .map(|(view, witness)| view.center().distance(middle) * witness.pixel_angle())
            .collect();
        pixels.sort_by(f64::total_cmp);
        let wanted = self.options.cell_px * pixels[pixels.len() / 2];
        let across = (1.02 * extent.max_element() / wanted).max(f64::from(FEWEST_CELLS_ACROSS));
        let levels = (across.log2().ceil() as i32).clamp(1, MOST_LEVELS);
        let cell = 1.02 * extent.max_element() / across;
        let side =
            cell.max(1.02 * extent.max_element() / 2.0_f64.powi(levels)) * 2.0_f64.powi(levels);
        let origin = middle - 0.5 * side;
        let mut level = Level::root(origin, side, witnesses.len(), misses);
        for _ in 0..levels {
            let next = level.divided(witnesses).level;
            if next.cells.len() > self.options.most_cells {
                break;
            }
            level = next;
        }
        level
    }
}

/// Small objects are carved in no fewer cells than this.
const FEWEST_CELLS_ACROSS: u32 = 24;
/// Coordinates of cells must fit 20 bits, corners beyond the last included.
const MOST_LEVELS: i32 = 18;

/// A photo at a whole fraction of its size; as it is where that leaves no silhouette.
fn reduce(view: &View, silhouette: &Silhouette, longest_side_px: u32) -> (View, Silhouette) {
    let factor = view.width.max(view.height).div_ceil(longest_side_px);
    let smaller = silhouette.reduced(factor);
    if factor > 1 && smaller.has_border() {
        return (witness::reduced(view, factor), smaller);
    }
    (view.clone(), silhouette.clone())
}
