//! Walking through an interior.
//!
//! The cell that a viewer is in is drawn as geometry, coloured by the model or by photos of it; what lies behind its portals as geometry,
//! too, or out of images that were made before the portals (Rafferty et al. 1998, "3D image
//! warping in architectural walkthroughs" and "Images for accelerating architectural
//! walkthroughs"). [`Walk`] draws frames; the rest is what it is made of.

mod background;
mod captured;
mod fill;
mod floor_map;
mod geometry;
mod library;
mod neighbourhood;
mod painter;
mod photographed;
mod pinhole;
mod projected;
mod raster;
mod recipe;
mod reference;
mod shade;
mod shelf;
mod squares;
mod target;
mod texture;
mod tour;
mod triangle;
mod walk;
mod warp;
mod window;

pub use captured::Captured;
pub use fill::PortalFill;
pub use geometry::{CellGeometry, Runs};
pub use library::{LdiCost, LdiSource, Library, LibraryOptions, PortalLdi};
pub use neighbourhood::Shown;
pub use painter::Painter;
pub use photographed::DepthMaps;
pub(crate) use pinhole::MAX_SIDE;
pub use pinhole::{Pinhole, PinholeError};
pub use raster::{Beyond, DrawOptions, Met, Raster};
pub use reference::{CAPTURED_REFERENCE_SIZE, REFERENCE_SIZE, Reference};
pub use target::Target;
pub use texture::texture;
pub use tour::{Tour, TourError};
pub use walk::{FrameCost, Walk, WalkError, WalkOptions};
pub use warp::{Splat, Warp, Warped, warp};
pub use window::Window;

pub(crate) use warp::normal_at;
