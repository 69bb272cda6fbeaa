//! The blending field, its triangulation, and the engine that draws it.
//!
//! Unstructured lumigraph rendering after Buehler et al. 2001. A [`Frame`] is one desired
//! view of a [`Lumigraph`]; three engines draw it: [`reference`](mod@reference), plain
//! f64, is the specification; [`cpu`] and [`gpu`] are fast and compared with it.

pub mod blend;
mod bounded;
mod contradictions;
pub mod coverage;
pub mod cpu;
mod edges;
mod engine;
pub mod field;
mod frame;
pub mod gpu;
mod held;
mod image_out;
pub mod interior;
pub mod ldi;
mod lens_edge;
mod lumigraph;
mod mask;
mod near;
mod options;
pub mod path;
mod photos;
pub mod picture;
mod planted;
mod pyramid;
mod raster;
mod rays;
pub mod reference;
mod residency;
pub mod rounding;
mod rows;
pub mod score;
mod seams;
mod sensor;
mod sight;
mod snapshot;
mod soft;
mod spare;
mod surface;
mod tally;
mod tiles;
mod time;
pub mod trajectory;
pub mod triangulation;
mod view_tree;
mod visibility;

pub use bounded::{Bounded, ErrorEstimate, GRIDS, Samples, prepare_within};
pub use contradictions::Contradictions;
pub use edges::EDGE_SAMPLES;
pub use engine::{DeviceChoice, Engine, Prepared, Ready};
pub use field::TriangulatedField;
pub use frame::{Frame, FrameSource, LEVEL_BIAS, Part, ProxyPoint};
pub use held::{Held, decode_ahead};
pub use lumigraph::{Lumigraph, SourceView};
pub use mask::Mask;
pub use options::{Blend, FieldOptions, MAX_BETA, MAX_CONTRIBUTORS, Method, Resolution, Skips};
pub use path::{CameraPath, PathFrame};
pub use photos::{PhotoError, PhotoStore};
pub use pyramid::{MAX_LEVELS, Pyramid};
pub use residency::{Residency, photo_bytes};
pub use rows::{Contributions, FieldRows};
pub use score::Score;
pub use seams::seams;
pub use snapshot::snapshots;
pub use soft::{Softened, soften};
pub use spare::PixelNumbers;
pub use surface::{FacetMap, NO_FACET, Surface};
pub use tally::Scored;
pub use time::{Moment, TIME_COST, WINDOW_TURNS};
pub use trajectory::Trajectory;
pub use visibility::{DistanceMap, Visibility};

/// Why a frame could not be drawn.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RenderError {
    /// A photo that is needed cannot be decoded.
    #[error(transparent)]
    Photo(#[from] PhotoError),
    /// The image plane could not be triangulated.
    #[error(transparent)]
    Triangulation(#[from] triangulation::TriangulationError),
    /// The graphics device is missing, failed, or cannot draw such a frame.
    #[error("graphics device: {0}")]
    Gpu(String),
    /// The graphics device has too little memory.
    #[error("graphics device: {0}")]
    DeviceFull(String),
    /// The graphics device is gone for good, as after a reset of its driver.
    #[error("graphics device: it was lost ({0})")]
    DeviceLost(String),
    /// The file of a layered depth image cannot be used.
    #[error("{} (`lumigraph ldis` makes it again; where it is removed, the walk does)", ldi::fault(.0))]
    LdiFile(String),
}
