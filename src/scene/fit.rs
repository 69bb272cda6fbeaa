//! Fitting a scene's proxy.

use super::auto::Trial;
use super::{Photo, Scene, SceneError};
use calibrate::View;
use image::RgbaImage;
use proxy::dense::{DenseOptions, DensePoints, densify};
use proxy::{FitBasis, FitError, PlaneFit, Proxy};
use std::collections::BTreeSet;
use std::sync::Arc;

/// Proxies that can be fitted to a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Parallel to the image planes.
    Plane,
    /// The sparse points that views like the desired one observe.
    Points,
    /// These, and those that photos agree on between them.
    Dense,
}

impl Kind {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Plane, Self::Points, Self::Dense];

    /// As the command line spells it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Plane => "plane",
            Self::Points => "points",
            Self::Dense => "dense",
        }
    }

    /// The kind of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }
}

/// A fitted proxy, and what to say of it.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// The surface.
    pub proxy: Proxy,
    /// How it came about, for people.
    pub how: String,
    /// What people should know of it, if anything.
    pub note: Option<String>,
    /// Where the kind was chosen by trial: what became of each.
    pub trials: Vec<Trial>,
}

impl Scene {
    /// Fits a proxy when the photos of the given names were never taken.
    ///
    /// # Errors
    /// The scene does not have what it takes; the message says what that is.
    pub fn fit(&self, kind: Kind, without: &BTreeSet<String>) -> Result<Fitted, SceneError> {
        self.fit_with(kind, without, &DenseOptions::default())
    }

    /// As [`Self::fit`], no finer than pictures of `long_side` pixels can tell.
    pub(super) fn fit_coarsely(
        &self,
        kind: Kind,
        without: &BTreeSet<String>,
        long_side: u32,
    ) -> Result<Fitted, SceneError> {
        let spacing = 3;
        self.fit_with(kind, without, &DenseOptions { long_side, spacing })
    }

    fn fit_with(
        &self,
        kind: Kind,
        without: &BTreeSet<String>,
        dense: &DenseOptions,
    ) -> Result<Fitted, SceneError> {
        match kind {
            Kind::Plane => {
                let fit = self.fit_plane(without)?;
                let note = match fit.basis {
                    FitBasis::Points { .. } => None,
                    basis => Some(format!("the proxy is a plane fitted to {basis}")),
                };
                Ok(Fitted {
                    how: format!("fitted at distance {:.4} to {}", fit.distance, fit.basis),
                    proxy: Proxy::Plane(fit.plane),
                    note,
                    trials: Vec::new(),
                })
            }
            Kind::Points => Ok(Fitted {
                proxy: Proxy::Points,
                how: "made for every view".to_owned(),
                note: None,
                trials: Vec::new(),
            }),
            Kind::Dense => self.fit_dense(without, dense),
        }
    }

    /// The plane that fits the sparse points when the photos of the given names were never
    /// taken; without points, that through what the cameras look at.
    ///
    /// # Errors
    /// Nothing to fit to.
    pub fn fit_plane(&self, without: &BTreeSet<String>) -> Result<PlaneFit, SceneError> {
        let rest = self.reconstruction.without_images(without);
        match proxy::fit_plane(&rest) {
            Err(FitError::NoPoints) => {
                let bounds = self.photos.iter().filter_map(|photo| {
                    let bounds = photo.depth_bounds?;
                    Some((photo.name.clone(), bounds))
                });
                Ok(proxy::plane_across_axes(&rest, &bounds.collect())?)
            }
            fit => Ok(fit?),
        }
    }

    fn fit_dense(
        &self,
        without: &BTreeSet<String>,
        options: &DenseOptions,
    ) -> Result<Fitted, SceneError> {
        let sources = self.sources(without)?;
        let views: Vec<View> = sources.iter().map(|(_, view)| view.clone()).collect();
        let names: Vec<String> = sources.iter().map(|(p, _)| p.name.clone()).collect();
        let sparse = self.sparse_points(without, &names);
        let photo = |i: usize| usable(sources[i].0, &views[i]);
        let points = densify(&views, &sparse, photo, options);
        let how = format!(
            "{} points, {} of them found between the sparse ones",
            points.len(),
            points.len() - sparse.len()
        );
        Ok(Fitted {
            proxy: Proxy::Dense(Arc::new(DensePoints { names, points })),
            how,
            note: None,
            trials: Vec::new(),
        })
    }
}

/// A photo, transparent where its mask ignores it; `None` where it cannot be decoded, which
/// drawing will report.
fn usable(photo: &Photo, view: &View) -> Option<RgbaImage> {
    let size = (view.width, view.height);
    let mut pixels = photo.decode(size).ok()?;
    if let Some(mask) = photo.decode_ignore_mask(size).ok()? {
        for (pixel, used) in pixels.pixels_mut().zip(mask.pixels()) {
            pixel.0[3] = pixel.0[3].min(used.0[0]);
        }
    }
    Some(pixels)
}
