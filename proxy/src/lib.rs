//! The approximate surface that carries rays to the photos.
//!
//! A desired ray meets the proxy at a point, and that point is looked up in the photos.
//! Today's surface is the [`Plane`] of Buehler et al. 2001 (§5, Pond); others join the
//! [`Proxy`] enum.

mod cloud;
mod file;
mod fit;
mod glb;
mod plane;

pub use cloud::{CloudStatistics, isolated_points, statistics};
pub use file::{FileError, parse, read, write};
pub use fit::{FitError, PlaneFit, fit_plane};
pub use plane::{Plane, PlaneError};

/// The approximate surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Proxy {
    /// An infinite plane, seen from both sides.
    Plane(Plane),
}

impl Proxy {
    /// The kind's name, as the command line and files spell it.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Plane(_) => "plane",
        }
    }
}
