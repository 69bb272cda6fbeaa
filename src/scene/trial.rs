//! Photos that judge proxies: each is drawn small from all the others and compared.

use super::fit::{Fitted, Kind, unfit, usable};
use super::{Scene, SceneError};
use calibrate::View;
use image::{DynamicImage, RgbaImage};
use proxy::dense::{DenseOptions, Matching};
use proxy::{Proxy, SparsePoint};
use render::{FieldOptions, Frame, Lumigraph, Method, PhotoStore, Visibility, cpu, score};
use std::collections::BTreeSet;
use std::sync::Arc;

/// Pixels along the longer side of the pictures that decide.
const LONG_SIDE: u32 = 400;
/// And of the photos that they are painted from.
const PHOTO_SIDE: u32 = 640;
/// What is fitted to photos is fitted without so large a share of them at a time, at most.
/// (What is made of points is made without each alone.)
const FOLD: usize = 6;
/// A kind that is so far behind after so many judges is not tried on the rest.
const HOPELESS_DB: f64 = 2.0;
const EARLIEST: usize = 3;

/// A photo that is drawn from the others.
struct Judge {
    source_idx: usize,
    name: String,
    desired: View,
    truth: RgbaImage,
}

/// The scene made small, and the photos that judge.
pub(super) struct Trials<'a> {
    scene: &'a Scene,
    without: &'a BTreeSet<String>,
    names: Vec<String>,
    judges: Vec<Judge>,
    /// Whose proxy changes with what is on trial.
    lumigraph: Lumigraph,
    matching: Option<Matching>,
}

/// How a proxy did, judge by judge.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Scores {
    /// In dB; as many as there are judges, or the first few.
    pub(super) psnr: Vec<f64>,
    /// Whether all judges were asked.
    pub(super) complete: bool,
}

impl Scores {
    /// Over the judges asked.
    pub(super) fn mean(&self) -> f64 {
        self.psnr.iter().sum::<f64>() / self.psnr.len() as f64
    }

    /// Whether this one is so far ahead of another's first few scores that the rest need not
    /// be known.
    fn beats(&self, others: &[f64]) -> bool {
        let count = others.len().min(self.psnr.len());
        let ahead = self.psnr.iter().zip(others).map(|(own, other)| own - other);
        count >= EARLIEST && ahead.sum::<f64>() > HOPELESS_DB * count as f64
    }
}

impl<'a> Trials<'a> {
    /// The photos but those of the names in `without`, `count` of which judge.
    ///
    /// # Errors
    /// A camera without a lens; none of the judges can be decoded.
    pub(super) fn new(
        scene: &'a Scene,
        without: &'a BTreeSet<String>,
        count: usize,
    ) -> Result<Self, SceneError> {
        let lumigraph = reduced(scene, without)?;
        let names: Vec<String> = lumigraph.sources.iter().map(|s| s.name.clone()).collect();
        let spread = (0..count).map(|i| (2 * i + 1) * names.len() / (2 * count));
        let judge = |source_idx: usize| {
            let name = &names[source_idx];
            let view = scene.view(name).ok()?;
            let photo = scene.photos.iter().find(|p| p.name == *name)?;
            let (width, height) = capture::reduced_size((view.width, view.height), LONG_SIDE);
            // One that cannot be decoded is no judge; drawing will report it.
            let truth = photo.decode((view.width, view.height)).ok()?;
            Some(Judge {
                source_idx,
                name: name.clone(),
                desired: view.resized(width, height),
                truth: capture::resize(&truth, width, height),
            })
        };
        let judges: Vec<Judge> = spread.filter_map(judge).collect();
        if judges.is_empty() {
            return Err(unfit("no photo to judge by"));
        }
        Ok(Self {
            scene,
            without,
            names,
            judges,
            lumigraph,
            matching: None,
        })
    }

    /// How well a kind of proxy does, made without the photos it is judged by; given up where
    /// the `leader` is too far ahead. Of a mesh, both as it is and as if it hid nothing from
    /// anyone, where that makes a difference.
    ///
    /// # Errors
    /// It cannot be fitted.
    pub(super) fn scores(
        &mut self,
        kind: Kind,
        leader: Option<&Scores>,
    ) -> Result<(Scores, Option<Scores>), SceneError> {
        let count = self.judges.len();
        let of_points = matches!(kind, Kind::Points | Kind::ViewPlane | Kind::Dense);
        let folds = if of_points {
            count
        } else {
            count.div_ceil((self.names.len() / FOLD).max(1))
        };
        let mut shown: Vec<Vec<f64>> = vec![Vec::new(); 2];
        for fold in 0..folds {
            let members: Vec<usize> = (fold..count).step_by(folds).collect();
            self.prepare(kind, &members)?;
            let visibility = self.lumigraph.visibility.take();
            for &judge in &members {
                shown[1].push(self.score(judge)?);
            }
            if visibility.is_some() {
                self.lumigraph.visibility = visibility;
                for &judge in &members {
                    shown[0].push(self.score(judge)?);
                }
            }
            // The leader's are in the order of judges, these in that of folds.
            let order = (0..=fold).flat_map(|f| (f..count).step_by(folds));
            let hopeless = leader.is_some_and(|leader| {
                let same = Scores {
                    psnr: order.map(|i| leader.psnr[i]).collect(),
                    complete: true,
                };
                shown.iter().all(|s| s.is_empty() || same.beats(s))
            });
            if hopeless {
                break;
            }
        }
        let order: Vec<usize> = (0..folds).flat_map(|f| (f..count).step_by(folds)).collect();
        let sorted = |scores: &[f64]| {
            let mut by_judge: Vec<(usize, f64)> =
                order.iter().copied().zip(scores.iter().copied()).collect();
            by_judge.sort_by_key(|(judge, _)| *judge);
            Scores {
                psnr: by_judge.into_iter().map(|(_, db)| db).collect(),
                complete: scores.len() == count,
            }
        };
        let [occluding, plain] = [&shown[0], &shown[1]].map(|s| sorted(s));
        Ok(if occluding.psnr.is_empty() {
            (plain, None)
        } else {
            (occluding, Some(plain))
        })
    }

    /// The dense points of all photos, which are half known where they were on trial.
    pub(super) fn dense(&mut self) -> Result<Fitted, SceneError> {
        let sparse = self.scene.sparse_points(self.without, &self.names);
        let points = self.matching()?.points(&sparse, None);
        Ok(Fitted::dense(self.names.clone(), points, sparse.len()))
    }

    /// Makes the lumigraph's proxy without some of the judges.
    fn prepare(&mut self, kind: Kind, judges: &[usize]) -> Result<(), SceneError> {
        let mut fewer = self.without.clone();
        fewer.extend(judges.iter().map(|&j| self.judges[j].name.clone()));
        let sparse: Vec<SparsePoint> = self.scene.sparse_points(&fewer, &self.names);
        let (proxy, points) = match kind {
            Kind::Points => (Proxy::Points, sparse),
            Kind::ViewPlane => (Proxy::ViewPlane, sparse),
            Kind::Dense => {
                let gone = self.judges[judges[0]].source_idx;
                let points = self.matching()?.points(&sparse, Some(gone));
                (Proxy::Dense(Arc::default()), points)
            }
            // A box may happen to suit a few photos of anything.
            Kind::Tunnel => (self.scene.fit_hallway(&fewer)?.proxy, Vec::new()),
            _ => (self.scene.fit(kind, &fewer)?.proxy, Vec::new()),
        };
        self.lumigraph.visibility = Visibility::of(&proxy, &self.lumigraph.sources);
        self.lumigraph.proxy = proxy;
        self.lumigraph.points = points;
        Ok(())
    }

    fn matching(&mut self) -> Result<&Matching, SceneError> {
        if self.matching.is_none() {
            let sources = self.scene.sources(self.without)?;
            let sparse = self.scene.sparse_points(self.without, &self.names);
            let views: Vec<View> = sources.iter().map(|(_, view)| view.clone()).collect();
            let photo = |i: usize| usable(sources[i].0, &views[i]);
            self.matching = Some(Matching::new(
                &views,
                &sparse,
                photo,
                &DenseOptions::default(),
            ));
        }
        self.matching
            .as_ref()
            .ok_or_else(|| unfit("no photos to compare"))
    }

    /// PSNR of a judge's picture, in dB.
    fn score(&self, judge: usize) -> Result<f64, SceneError> {
        let judge = &self.judges[judge];
        let frame = Frame::without(
            &self.lumigraph,
            judge.desired.clone(),
            FieldOptions::default(),
            Some(judge.source_idx),
        );
        let picture = cpu::render(&frame, Method::Exact).map_err(unfit)?;
        Ok(score::score(&picture, &judge.truth).map_err(unfit)?.psnr)
    }
}

/// The lumigraph of reduced photos, whatever its proxy.
fn reduced(scene: &Scene, without: &BTreeSet<String>) -> Result<Lumigraph, SceneError> {
    let mut lumigraph = scene.lumigraph(without, Proxy::Points)?;
    let sizes: Vec<(u32, u32)> = lumigraph
        .sources
        .iter_mut()
        .map(|source| {
            let own = (source.view.width, source.view.height);
            let (width, height) = capture::reduced_size(own, PHOTO_SIDE);
            source.view = source.view.clone().resized(width, height);
            own
        })
        .collect();
    let small: Vec<(u32, u32)> = lumigraph
        .sources
        .iter()
        .map(|s| (s.view.width, s.view.height))
        .collect();
    let by_name = |name: &str| scene.photos.iter().find(|photo| photo.name == name);
    let photos = lumigraph.sources.iter().filter_map(|s| by_name(&s.name));
    let photos: Arc<Vec<_>> = Arc::new(photos.cloned().zip(sizes.into_iter().zip(small)).collect());
    let of_masks = Arc::clone(&photos);
    let masked: Vec<bool> = photos
        .iter()
        .map(|(p, _)| p.ignore_mask.is_some())
        .collect();
    let store = PhotoStore::new(photos.len(), move |i| {
        let (photo, (own, (width, height))) = &photos[i];
        let pixels = photo.decode(*own).map_err(|error| error.to_string())?;
        Ok(capture::resize(&pixels, *width, *height))
    });
    lumigraph.photos = store.with_masks(&masked, move |i| {
        let (photo, (own, (width, height))) = &of_masks[i];
        let mask = photo.decode_ignore_mask(*own);
        let mask = mask.map_err(|error| error.to_string())?;
        let mask = mask.ok_or_else(|| format!("{}: no ignore mask", photo.name))?;
        let mask = DynamicImage::from(mask).into_rgba8();
        Ok(DynamicImage::from(capture::resize(&mask, *width, *height)).into_luma8())
    });
    Ok(lumigraph)
}
