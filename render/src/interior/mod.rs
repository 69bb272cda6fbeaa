//! Walking through an interior.
//!
//! The cell that a viewer is in is drawn as geometry; what lies behind its portals as geometry,
//! too, or out of images that were made before the portals (Rafferty et al. 1998, "3D image
//! warping in architectural walkthroughs" and "Images for accelerating architectural
//! walkthroughs").

mod geometry;
mod pinhole;
mod raster;
mod target;
mod window;

pub use geometry::{CellGeometry, Runs};
pub use pinhole::{Pinhole, PinholeError};
pub use raster::{Beyond, Raster};
pub use target::Target;
pub use window::Window;
