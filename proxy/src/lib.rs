//! The approximate surface that carries rays to the photos.
//!
//! A desired ray meets the proxy at a point, and that point is looked up in the photos.
//! The surfaces are the [`Plane`] of Buehler et al. 2001 (§5, Pond), the sparse [`points`]
//! themselves, triangulated anew for each desired view, and meshes ([`Solid`]), of which the
//! [`tunnel`] is one.

mod axes;
pub mod carve;
mod cloud;
mod condition;
pub mod dense;
pub mod depth;
mod facets;
mod file;
mod fit;
mod glb;
pub mod hull;
pub mod interior;
pub mod mesh;
mod order;
mod plane;
mod planes;
pub mod points;
mod scan;
mod shell;
mod shown;
mod solid;
pub mod tunnel;

use std::sync::Arc;

pub use axes::{PLACE_ROUNDING, is_one_place, plane_across_axes, plane_of_one_place};
pub use cloud::{CloudStatistics, geometric_median, isolated_points, statistics};
pub use condition::ILL_CONDITIONED;
pub use dense::DensePoints;
pub use facets::Facets;
pub use file::{FileError, Form, parse, read, write};
pub use fit::{FitBasis, FitError, PlaneFit, fit_plane};
pub use mesh::Mesh;
pub use plane::{Plane, PlaneError};
pub use planes::{
    DominantPlane, DominantPlaneError, FocusError, dominant_plane, fit_plane_for_view,
    plane_focused_on,
};
pub use points::SparsePoint;
pub use scan::{Kept, Rays, Scan};
pub use shell::shell;
pub use shown::{shown_name, shown_number};
pub use solid::{Hit, MeshKind, RAYS_TOGETHER, Solid};
pub use tunnel::{Tunnel, TunnelError};

/// The approximate surface.
#[derive(Clone, Debug, PartialEq)]
pub enum Proxy {
    /// An infinite plane, seen from both sides.
    Plane(Plane),
    /// A plane through what each desired view sees of the sparse points, fitted anew for each:
    /// nearer to the scene than one plane for all, but equal rays no longer meet equal points.
    ViewPlane,
    /// The sparse points that views like the desired one observe; see [`points`].
    Points {
        /// The hull of the object that photos are cut out to: it bounds what is made of points.
        within: Option<Arc<Solid>>,
    },
    /// As [`Self::Points`], with more points than the capture's own; see [`dense`].
    Dense(Arc<DensePoints>),
    /// Triangles.
    Mesh(Arc<Solid>),
}

impl Proxy {
    /// The plane, if it is one.
    pub fn plane(&self) -> Option<Plane> {
        match self {
            Self::Plane(plane) => Some(*plane),
            Self::ViewPlane | Self::Points { .. } | Self::Dense(_) | Self::Mesh(_) => None,
        }
    }

    /// The closed mesh that bounds it, if there is one.
    pub fn within(&self) -> Option<&Solid> {
        match self {
            Self::Points { within } => within.as_deref(),
            Self::Dense(dense) => dense.within.as_deref(),
            Self::Mesh(solid) => solid.within(),
            Self::Plane(_) | Self::ViewPlane => None,
        }
    }

    /// The kind's name, as the command line and files spell it.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Plane(_) => "plane",
            Self::ViewPlane => "view-plane",
            Self::Points { .. } => "points",
            Self::Dense(_) => "dense",
            Self::Mesh(solid) => solid.kind().name(),
        }
    }
}
