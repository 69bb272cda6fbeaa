//! The hull that bounds surfaces of points, where photos show nothing but an object.

use super::damaged::of_each;
use super::fit::unfit;
use super::{Scene, SceneError};
use calibrate::View;
use proxy::hull::{self, Silhouette};
use proxy::{MeshKind, Solid};
use std::collections::BTreeSet;
use std::sync::Arc;

/// The hull is there to say where the object is not: it follows its silhouettes closely, but what
/// it lacks is lost.
const CLOSE: hull::Options = hull::Options {
    tolerance_px: 0.3,
    misses: 0,
    least_coverage: 0.993,
    cell_px: 3.5,
    most_cells: 4_000_000,
    longest_side_px: 1600,
    faces: Some(20_000),
};
/// One that covers less than this part of the silhouettes bounds nothing.
const LEAST_COVERAGE: f64 = 0.98;

/// A hull to bound points by, and how it was carved.
#[derive(Clone, Debug)]
pub(super) struct Cutout {
    pub(super) hull: Arc<Solid>,
    tolerance_px: f64,
    misses: u16,
}

impl Scene {
    /// The hull of the object that all photos but those of the given names are cut out to; `None`
    /// where they show more than an object, or nothing bounds it. `like` is one of more photos, whose
    /// allowances it takes.
    ///
    /// # Errors
    /// Photos or their mattes that cannot be decoded ([`SceneError::Damaged`]).
    pub(super) fn cutout(
        &self,
        without: &BTreeSet<String>,
        like: Option<&Cutout>,
    ) -> Result<Option<Cutout>, SceneError> {
        let sources = self.sources(without)?;
        if !sources.iter().all(|(photo, _)| photo.is_cut_out()) {
            return Ok(None);
        }
        let views: Vec<View> = sources.iter().map(|(_, view)| view.clone()).collect();
        let silhouettes = of_each(&sources, |photo, size| {
            let pixels = photo.decode(size)?;
            let alpha: Vec<u8> = pixels.pixels().map(|p| p.0[3]).collect();
            Silhouette::from_values(pixels.width(), pixels.height(), &alpha)
                .ok_or_else(|| unfit(format!("photo {}: it has no pixels", photo.name)))
        })?;
        let opaque = |s: &Silhouette| s.inside().iter().all(|inside| *inside);
        if silhouettes.iter().all(opaque) {
            return Ok(None);
        }
        let options = match like {
            None => CLOSE,
            Some(like) => hull::Options {
                tolerance_px: like.tolerance_px,
                misses: like.misses,
                least_coverage: 0.0,
                faces: None,
                ..CLOSE
            },
        };
        // What bounds no object bounds no points, and that is no error.
        let carved = hull::carve(&views, &silhouettes, &options).ok();
        let carved = carved.filter(|hull| hull.measures.coverage >= LEAST_COVERAGE);
        Ok(carved.map(|carved| Cutout {
            tolerance_px: carved.tolerance_px,
            misses: carved.misses,
            hull: Arc::new(Solid::new(MeshKind::Hull, carved.mesh)),
        }))
    }
}
