//! Layered depth images before portals.
//!
//! An LDI is an image with any number of samples in a pixel, nearest last: what several images
//! saw through a portal, each surface once (Gortler, He and Cohen 1997; Rafferty et al. 1998,
//! "Images for accelerating architectural walkthroughs"; Popescu et al. 1998). [`construct`]
//! makes one of the [`Reference`](crate::interior::Reference) images of a portal's semicircle;
//! [`ordered`] draws it as the papers do, in an order that needs no depths; [`free`] in any
//! order, which is the default and the better picture; [`ClipTree`] tells which of its columns
//! one can see; [`read()`] and [`write()`] keep it.

mod clip;
mod construct;
mod ends;
mod file;
mod fill;
mod fit;
mod fragments;
mod free;
mod layered;
mod look;
mod order;
mod ordered;
mod project;
mod splat;
mod stats;

pub use clip::{ClipTree, Clipped};
pub use construct::{
    Conflict, ConstructOptions, Constructed, construct, construct_around, construct_of_photos,
};
pub use ends::Ends;
pub use file::{LdiFileError, fault, parse, read, read_before, write};
pub use fragments::Pieces;
pub use free::{Free, FreeCost, FreeOptions, free};
pub use layered::{Layered, LdiError, Sample};
pub use look::Look;
pub use order::{Run, Traversal};
pub use ordered::{Ordered, OrderedCost, OrderedOptions, ordered, ordered_by};
pub use splat::Stamp;
pub use stats::{Layers, layers};

pub(crate) use construct::making_bytes;
// What the twin on a graphics device shares.
pub(crate) use fill::fill;
pub(crate) use free::{BEYOND, bounds};
pub(crate) use look::Sizes;
pub(crate) use project::Projection;
