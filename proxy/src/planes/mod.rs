//! Planes by other means than [`fit_plane`](crate::fit_plane)'s: focused on a pixel, the one
//! that holds most points, and one made anew for each desired view.

mod dominant;
mod focus;
mod of_view;

pub use dominant::{DominantPlane, DominantPlaneError, dominant_plane};
pub use focus::{FocusError, plane_focused_on};
pub use of_view::fit_plane_for_view;

#[cfg(test)]
mod tests;
