use crate::photos::PhotoStore;
use crate::visibility::Visibility;
use calibrate::View;
use proxy::{Proxy, SparsePoint};

/// One photo with its camera.
#[derive(Clone, Debug, PartialEq)]
pub struct SourceView {
    /// The photo's name.
    pub name: String,
    /// Where it was taken from, and with which lens.
    pub view: View,
    /// Exposure per colour channel, relative to the other photos; 1 where unknown.
    pub gain: [f64; 3],
    /// When it was taken, in seconds from any moment common to all; where known.
    pub time_s: Option<f64>,
    /// By how many quarters, clockwise, the photo is turned when it is shown as its camera says: 0 to 3.
    pub quarters: u8,
}

/// An unstructured lumigraph: everything a view is rendered from.
#[derive(Debug)]
pub struct Lumigraph {
    /// The source views. Ties between them go to the lower index.
    pub sources: Vec<SourceView>,
    /// Their photos, by the same index, decoded when first needed.
    pub photos: PhotoStore,
    /// The surface that carries rays to them.
    pub proxy: Proxy,
    /// The capture's sparse points, for a proxy that is made of them.
    pub points: Vec<SparsePoint>,
    /// Which photos see what of the proxy, where it can hide a part of itself and that is
    /// to count; see [`Visibility::of`].
    pub visibility: Option<Visibility>,
}
