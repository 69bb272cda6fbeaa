//! The visual hull: all that silhouettes leave of space (Buehler et al. 2001, §5, Car).
//!
//! A point lies in the hull where no photo that shows the whole object sees it outside the
//! silhouette. [`carve`] finds where that is, given cameras and [`Silhouette`]s, as a closed
//! mesh of few faces: [`simplify`] never cuts into what it simplifies, so every pixel of the
//! silhouettes that met the hull still does. [`plain_background`] makes silhouettes of photos
//! before a plain background, [`turntable`] cameras of silhouettes alone.

mod background;
mod bounds;
mod carving;
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
pub use turntable::{TURNTABLE_STEPS, Turntable, TurntableError, turntable};

use crate::Mesh;
use calibrate::View;
use carving::Carving;

/// How [`carve`] goes about it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Silhouettes grow by so many pixels before they carve; 0 or more. Covers rounding to
    /// pixels and small errors of masks and cameras.
    pub tolerance_px: f64,
    /// So many photos may see a point outside their silhouettes and it stays in the hull
    /// nevertheless. Covers silhouettes that are wrong here and there.
    pub misses: u16,
    /// Silhouettes contradict one another where the hull covers less than this part of their
    /// pixels: then more pixels of tolerance and more misses (one of ten photos at most) are
    /// allowed, as few as will do. 0 allows none but those above.
    pub least_coverage: f64,
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
            least_coverage: 0.985,
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
    /// By so many pixels silhouettes grew before they carved.
    pub tolerance_px: f64,
    /// So many photos were allowed to miss.
    pub misses: u16,
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
         from other sides, or ones that show all of it (are the masks the right way round, white \
         where the object is?)"
    )]
    Unbounded {
        /// How many photos.
        photos: usize,
    },
    /// Nothing is left.
    #[error(
        "the silhouettes of {photos} photos have no point in common; check that masks and \
         cameras belong together, leave out photos where they do not (`--hold-out`), or try the \
         proxy `points` or `carved`, which need no masks"
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
    // 1. The photos that say something.
    let (used, left_out) = choose(silhouettes)?;
    let carving = Carving::new(
        used.iter().map(|i| &views[*i]).collect(),
        used.iter().map(|i| &silhouettes[*i]).collect(),
        options,
    );
    // 2. The surface, and less of it.
    let carved = carving.consistent()?;
    let (mesh, measures) = match options.faces {
        Some(faces) if faces < carved.measures.faces => carving.simplified(&carved, faces),
        _ => (carved.mesh, carved.measures),
    };
    Ok(Hull {
        mesh,
        measures,
        carved: carved.measures,
        cell: carved.cell,
        tolerance_px: carved.tolerance_px,
        misses: carved.misses,
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
    if !(0.0..=1.0).contains(&options.least_coverage) {
        let found = options.least_coverage;
        return refuse("the least coverage", found, "0 to 1");
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
