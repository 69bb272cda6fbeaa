//! The visual hull: all that silhouettes leave of space (Buehler et al. 2001, §5, Car).
//!
//! A point lies in the hull where no photo that shows the whole object sees it outside the
//! silhouette. [`carve`] finds where that is, given cameras and [`Silhouette`]s, as a closed
//! mesh of few faces: [`simplify`] never cuts into what it simplifies, so every pixel of the
//! silhouettes that met the hull still does. [`plain_background`] makes silhouettes of photos
//! before a plain background, [`turntable`] cameras of silhouettes alone.

mod background;
mod bounds;
mod closest;
mod measure;
mod octree;
mod pieces;
mod silhouette;
mod simplify;
mod surface;
mod turntable;
mod witness;

pub use background::{BackgroundError, plain_background};
pub use measure::{Measures, measure, outline};
pub use silhouette::Silhouette;
pub use simplify::simplify;
pub use turntable::{Turntable, TurntableError, turntable};

use crate::Mesh;
use calibrate::View;
use octree::Level;
use rayon::prelude::*;
use witness::Witness;

/// How [`carve`] goes about it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Silhouettes grow by so many pixels before they carve; 0 or more. Covers rounding to
    /// pixels and small errors of masks and cameras.
    pub tolerance_px: f64,
    /// So many photos may see a point outside their silhouettes and it stays in the hull
    /// nevertheless. Covers silhouettes that are wrong here and there.
    pub misses: u16,
    /// The side of the smallest cells, in pixels of a typical photo; more than 0.
    pub cell_px: f64,
    /// Cells are divided no further where this many would be left.
    pub most_cells: usize,
    /// Silhouettes are reduced by whole numbers until no side is longer.
    pub longest_side_px: u32,
    /// The simplified mesh's triangles at most, where that does not cost the shape (see
    /// [`simplify`]); `None` leaves the mesh as it was carved.
    pub faces: Option<usize>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            tolerance_px: 1.0,
            misses: 0,
            cell_px: 3.5,
            most_cells: 4_000_000,
            longest_side_px: 1600,
            faces: Some(500),
        }
    }
}

/// A visual hull and how well it fits.
#[derive(Clone, Debug, PartialEq)]
pub struct Hull {
    /// The surface: closed, winding counter-clockwise from outside, simplified.
    pub mesh: Mesh,
    /// How it compares with the silhouettes.
    pub measures: Measures,
    /// How the surface did before it was simplified.
    pub carved: Measures,
    /// The side of the cells it was carved in, in world units.
    pub cell: f64,
    /// Indices of the photos that took no part: their masks are all object or all not.
    pub left_out: Vec<usize>,
}

/// Why there is no hull.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum HullError {
    /// Views and silhouettes come in pairs.
    #[error("there are {silhouettes} masks for {views} photos; give each photo one")]
    Count {
        /// How many views.
        views: usize,
        /// How many silhouettes.
        silhouettes: usize,
    },
    /// A silhouette is not its photo's.
    #[error(
        "the mask of photo {photo} is {} × {} pixels and the photo {} × {}; masks must be as \
         large as their photos", found.0, found.1, expected.0, expected.1
    )]
    Size {
        /// Index of the photo.
        photo: usize,
        /// The mask's width and height.
        found: (u32, u32),
        /// The photo's.
        expected: (u32, u32),
    },
    /// A camera's pose is no pose.
    #[error("the camera of photo {photo} is posed by numbers that are not finite")]
    Pose {
        /// Index of the photo.
        photo: usize,
    },
    /// An option is out of its range.
    #[error("{option} is {found}; expected {expected}")]
    Option {
        /// Which.
        option: &'static str,
        /// Its value.
        found: f64,
        /// Its range.
        expected: &'static str,
    },
    /// There are not two silhouettes.
    #[error(
        "of {photos} masks {empty} show no object and {full} nothing else; a hull needs two \
         silhouettes or more (are the masks the right way round, white where the object is?)"
    )]
    NoSilhouettes {
        /// How many there are.
        photos: usize,
        /// How many are black all over.
        empty: usize,
        /// How many are white all over.
        full: usize,
    },
    /// The cameras all see the same.
    #[error(
        "the {photos} photos with silhouettes were taken from one place, or look the same way \
         from afar; a hull needs views from several sides"
    )]
    NoParallax {
        /// How many photos.
        photos: usize,
    },
    /// The hull goes on for ever.
    #[error(
        "the silhouettes of {photos} photos do not bound the object from all sides; add photos \
         from other sides, or ones that show all of it"
    )]
    Unbounded {
        /// How many photos.
        photos: usize,
    },
    /// Nothing is left.
    #[error(
        "the silhouettes of {photos} photos have no point in common; allow more pixels of \
         tolerance or more misses, or check that masks and cameras belong together"
    )]
    Contradiction {
        /// How many photos.
        photos: usize,
    },
}

/// Carves the hull that silhouettes leave, from cameras and silhouettes alone.
///
/// Views and silhouettes come in pairs of one size; the mesh lies in the views' world. Photos
/// whose masks are all object or all background say nothing and take no part. One whose
/// silhouette reaches the image's border shows only a part of the object, and nothing is
/// concluded from what lies outside its field of view.
///
/// Space is divided adaptively: cells that lie inside or outside the hull for certain are not
/// divided further. The surface is then followed within the smallest cells, so that it lies
/// where the silhouettes' borders are to a small part of a cell; parts of the hull thinner
/// than a cell may be missed. Deterministic.
///
/// # Errors
/// Input that does not fit together or bounds no object; see [`HullError`].
pub fn carve(
    views: &[View],
    silhouettes: &[Silhouette],
    options: &Options,
) -> Result<Hull, HullError> {
    check(views, silhouettes, options)?;
    // 1. The photos that say something, as functions of space.
    let (used, left_out) = choose(silhouettes)?;
    let used_views: Vec<&View> = used.iter().map(|i| &views[*i]).collect();
    let reduced: Vec<(View, Silhouette)> = used
        .par_iter()
        .map(|i| reduce(&views[*i], &silhouettes[*i], options.longest_side_px))
        .collect();
    let witnesses: Vec<Witness> = reduced
        .par_iter()
        .map(|(view, silhouette)| Witness::new(view, silhouette, options.tolerance_px))
        .collect();
    // 2. Where the object is, and the cells around its surface.
    let (small_views, small): (Vec<&View>, Vec<&Silhouette>) =
        reduced.iter().map(|(view, s)| (view, s)).unzip();
    let bounds = bounds::find(&small_views, &small, &witnesses, options.misses)?;
    let level = finest(&bounds, &used_views, &witnesses, options);
    // 3. The surface, and less of it.
    let surface = surface::extract(&level, &witnesses);
    if surface.triangles.is_empty() {
        return Err(HullError::Contradiction { photos: used.len() });
    }
    let used_silhouettes: Vec<&Silhouette> = used.iter().map(|i| &silhouettes[*i]).collect();
    let carved_mesh = pieces::needed(&surface, &used_views, &used_silhouettes);
    let carved = measure::compare(&carved_mesh, &used_views, &used_silhouettes);
    let (mesh, measures) = match options.faces {
        Some(faces) if faces < carved.faces => {
            // Specks that the rest has grown around go, so that what stays gets their faces.
            let mut mesh = simplify(&carved_mesh, 3 * faces);
            for _ in 0..2 {
                mesh = pieces::needed(&mesh, &used_views, &used_silhouettes);
                mesh = simplify(&mesh, faces);
            }
            let measures = measure::compare(&mesh, &used_views, &used_silhouettes);
            (mesh, measures)
        }
        _ => (carved_mesh, carved),
    };
    Ok(Hull {
        mesh,
        measures,
        carved,
        cell: level.side,
        left_out,
    })
}

fn check(views: &[View], silhouettes: &[Silhouette], options: &Options) -> Result<(), HullError> {
    if views.len() != silhouettes.len() {
        return Err(HullError::Count {
            views: views.len(),
            silhouettes: silhouettes.len(),
        });
    }
    for (photo, (view, silhouette)) in views.iter().zip(silhouettes).enumerate() {
        let (found, expected) = (silhouette.size(), (view.width, view.height));
        if found != expected {
            return Err(HullError::Size {
                photo,
                found,
                expected,
            });
        }
        if !view.camera_from_world.is_finite() {
            return Err(HullError::Pose { photo });
        }
    }
    let refuse = |option, found, expected| {
        Err(HullError::Option {
            option,
            found,
            expected,
        })
    };
    if !(0.0..=1000.0).contains(&options.tolerance_px) {
        return refuse("the tolerance", options.tolerance_px, "0 to 1000 pixels");
    }
    if !(0.01..=1000.0).contains(&options.cell_px) {
        return refuse("a cell's side", options.cell_px, "0.01 to 1000 pixels");
    }
    if options.longest_side_px < 8 {
        let found = f64::from(options.longest_side_px);
        return refuse("the masks' longest side", found, "8 pixels or more");
    }
    Ok(())
}

/// The photos whose silhouettes have a border, and the others.
fn choose(silhouettes: &[Silhouette]) -> Result<(Vec<usize>, Vec<usize>), HullError> {
    let all = 0..silhouettes.len();
    let (used, left_out): (Vec<usize>, Vec<usize>) =
        all.partition(|i| silhouettes[*i].has_border());
    let empty = left_out
        .iter()
        .filter(|i| silhouettes[**i].area() == 0)
        .count();
    // Photos are counted in 16 bits.
    if used.len() < 2 || used.len() > usize::from(u16::MAX) {
        return Err(HullError::NoSilhouettes {
            photos: silhouettes.len(),
            empty,
            full: left_out.len() - empty,
        });
    }
    Ok((used, left_out))
}

/// A photo at a whole fraction of its size; as it is where that leaves no silhouette.
fn reduce(view: &View, silhouette: &Silhouette, longest_side_px: u32) -> (View, Silhouette) {
    let factor = view.width.max(view.height).div_ceil(longest_side_px);
    let smaller = silhouette.reduced(factor);
    if factor > 1 && smaller.has_border() {
        return (witness::reduced(view, factor), smaller);
    }
    (view.clone(), silhouette.clone())
}

/// The level of cells that are as small as asked for.
fn finest(
    bounds: &bounds::Bounds,
    views: &[&View],
    witnesses: &[Witness],
    options: &Options,
) -> Level {
    let extent = bounds.high - bounds.low;
    let middle = bounds.low + 0.5 * extent;
    let mut pixels: Vec<f64> = views
        .iter()
        .zip(witnesses)
        .map(|(view, witness)| view.center().distance(middle) * witness.pixel_angle())
        .collect();
    pixels.sort_by(f64::total_cmp);
    let wanted = options.cell_px * pixels[pixels.len() / 2];
    let across = (1.02 * extent.max_element() / wanted).max(f64::from(FEWEST_CELLS_ACROSS));
    let levels = (across.log2().ceil() as i32).clamp(1, MOST_LEVELS);
    let cell = 1.02 * extent.max_element() / across;
    let side = cell.max(1.02 * extent.max_element() / 2.0_f64.powi(levels)) * 2.0_f64.powi(levels);
    let origin = middle - 0.5 * side;
    let mut level = Level::root(origin, side, witnesses.len(), options.misses);
    for _ in 0..levels {
        let next = level.divided(witnesses).level;
        if next.cells.len() > options.most_cells {
            break;
        }
        level = next;
    }
    level
}

/// Small objects are carved in no fewer cells than this.
const FEWEST_CELLS_ACROSS: u32 = 24;
/// Coordinates of cells must fit 20 bits, corners beyond the last included.
const MOST_LEVELS: i32 = 18;
