//! The approximate surface that carries rays to the photos.
//!
//! A desired ray meets the proxy at a point, and that point is looked up in the photos.
//! The surfaces are the [`Plane`] of Buehler et al. 2001 (§5, Pond) and the sparse
//! [`points`] themselves, triangulated anew for each desired view. A [`Mesh`] comes from
//! [`depth`] maps, or from a file ([`mesh::read`]).

mod axes;
mod cloud;
pub mod depth;
mod facets;
mod file;
mod fit;
mod glb;
pub mod mesh;
mod plane;
pub mod points;

pub use axes::plane_across_axes;
pub use cloud::{CloudStatistics, isolated_points, statistics};
pub use facets::Facets;
pub use file::{FileError, parse, read, write};
pub use fit::{FitBasis, FitError, PlaneFit, fit_plane};
pub use mesh::Mesh;
pub use plane::{Plane, PlaneError};
pub use points::SparsePoint;

/// The approximate surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Proxy {
    /// An infinite plane, seen from both sides.
    Plane(Plane),
    /// The sparse points that views like the desired one observe; see [`points`].
    Points,
}

impl Proxy {
    /// The plane, if it is one.
    pub fn plane(&self) -> Option<Plane> {
        match self {
            Self::Plane(plane) => Some(*plane),
            Self::Points => None,
        }
    }

    /// The kind's name, as the command line and files spell it.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Plane(_) => "plane",
            Self::Points => "points",
        }
    }
}
