//! Photos that judge proxies: each is drawn small from all the others and compared.

use super::beside::USED;
use super::carved_points::{CarvedPoints, on_surface};
use super::cutout::Cutout;
use super::fit::{Fitted, Kind, unfit};
use super::{Scene, SceneError};
use calibrate::View;
use image::{GrayImage, RgbaImage};
use proxy::dense::{DensePoints, Matching};
use proxy::{Proxy, Solid, SparsePoint};
use rayon::prelude::*;
use render::score::PSNR_CAP_DB;
use render::{FieldOptions, Frame, Lumigraph, Method, Part, RenderError, Visibility, cpu, score};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// Pixels along the longer side of the pictures that decide.
const LONG_SIDE: u32 = 400;
/// And of the photos that they are painted from.
const PHOTO_SIDE: u32 = 640;
/// What is fitted to photos is fitted without one of so many of them at a time, at most.
const FOLD: usize = 6;
/// And what is made of points, which gaps between photos cost more.
const FOLD_OF_POINTS: usize = 24;
/// Of a photo of which a mask leaves less than this share, that would say too little, and all judges.
const LEAST_USED: f64 = 0.05;
/// A kind that is so far behind after so many judges is not tried on the rest.
const HOPELESS_DB: f64 = 2.0;
const EARLIEST: usize = 3;

/// A photo that is drawn from the others.
struct Judge {
    source_idx: usize,
    name: String,
    desired: View,
    truth: RgbaImage,
    /// What to use of it, where a mask says so: the rest does not judge, unless it is nearly all.
    used: Option<GrayImage>,
}

/// The scene made small, and the photos that judge.
pub(super) struct Trials<'a> {
    scene: &'a Scene,
    without: &'a BTreeSet<String>,
    names: Vec<String>,
    judges: Vec<Judge>,
    /// Whose proxy changes with what is on trial.
    lumigraph: Lumigraph,
    /// With what is to be said of depth maps that it cannot use.
    matching: Option<(Matching, Option<String>)>,
    /// Of dense points, without the judges of each fold.
    dense: Vec<CarvedPoints>,
    /// The hull that bounds points, of all photos, where they are cut out; found when asked for.
    cutout: Option<Option<Cutout>>,
    /// And without the judges of each fold.
    bounds: BTreeMap<usize, Option<Arc<Solid>>>,
}

/// How a proxy did: PSNR in dB for each judge, at its own exposure; `None` for those that were not asked.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Scores(Vec<Option<f64>>);

impl Scores {
    /// How many judges were asked.
    pub(super) fn asked(&self) -> usize {
        self.0.iter().flatten().count()
    }

    /// Whether all were.
    pub(super) fn complete(&self) -> bool {
        self.asked() == self.0.len()
    }

    /// Over the judges asked.
    pub(super) fn mean(&self) -> f64 {
        self.0.iter().flatten().sum::<f64>() / self.asked() as f64
    }

    /// Whether another is so far ahead that the judges not asked yet need not be.
    fn is_hopeless_beside(&self, leader: &Self) -> bool {
        let both = self.0.iter().zip(&leader.0);
        let behind = both.filter_map(|(own, other)| Some((*other)? - (*own)?));
        let count = self.asked();
        count >= EARLIEST && behind.sum::<f64>() > HOPELESS_DB * count as f64
    }
}

impl<'a> Trials<'a> {
    /// The photos but those of the names in `without`, `count` of which judge.
    ///
    /// # Errors
    /// A camera without a lens; [`SceneError::Damaged`] of judges that cannot be decoded.
    pub(super) fn new(
        scene: &'a Scene,
        without: &'a BTreeSet<String>,
        count: usize,
    ) -> Result<Self, SceneError> {
        let lumigraph = scene.reduced_lumigraph(without, Proxy::ViewPlane, PHOTO_SIDE)?;
        let names: Vec<String> = lumigraph.sources.iter().map(|s| s.name.clone()).collect();
        let spread = (0..count).map(|i| (2 * i + 1) * names.len() / (2 * count));
        let (mut judges, mut damaged) = (Vec::new(), BTreeMap::new());
        for source_idx in spread {
            let name = &names[source_idx];
            let view = scene.view(name)?;
            let (width, height) = capture::reduced_size((view.width, view.height), LONG_SIDE);
            match scene.truth(name, without)? {
                Ok(truth) => {
                    let truth = truth.resized(width, height);
                    let is_enough = |used: &GrayImage| {
                        let count = used.pixels().filter(|p| p.0[0] >= USED).count();
                        count as f64 >= LEAST_USED * f64::from(width * height)
                    };
                    judges.push(Judge {
                        source_idx,
                        name: name.clone(),
                        desired: view.resized(width, height),
                        truth: truth.pixels,
                        used: truth.used.filter(is_enough),
                    });
                }
                Err(error) => {
                    damaged.insert(name.clone(), error.to_string());
                }
            }
        }
        if !damaged.is_empty() {
            return Err(SceneError::Damaged(damaged));
        }
        Ok(Self {
            scene,
            without,
            names,
            judges,
            lumigraph,
            matching: None,
            dense: Vec::new(),
            cutout: None,
            bounds: BTreeMap::new(),
        })
    }

    /// Makes all photos ready to be compared, as some kinds ask for: so those that cannot be decoded are found at
    /// once, before any kind was tried with them.
    ///
    /// # Errors
    /// [`SceneError::Damaged`] of these. What else may be wrong is said of the kinds that ask for it.
    pub(super) fn find_damaged(&mut self) -> Result<(), SceneError> {
        match self.take_matching() {
            Ok(matching) => self.matching = Some(matching),
            Err(damaged @ SceneError::Damaged(_)) => return Err(damaged),
            Err(_) => {}
        }
        Ok(())
    }

    /// How well a kind of proxy does, made without the photos it is judged by; given up where
    /// the `leader` is too far ahead. Of a mesh, both as it is and as if it hid nothing from
    /// anyone, where that makes a difference.
    ///
    /// # Errors
    /// It cannot be fitted; [`SceneError::Damaged`] of photos that cannot be decoded, without which
    /// all kinds are to be judged.
    pub(super) fn scores(
        &mut self,
        kind: Kind,
        leader: Option<&Scores>,
    ) -> Result<(Scores, Option<Scores>), SceneError> {
        let count = self.judges.len();
        let of_points = matches!(
            kind,
            Kind::Points | Kind::ViewPlane | Kind::Dense | Kind::CarvedDense
        );
        let folds = if of_points {
            self.folds_of_points()
        } else {
            self.folds()
        };
        let mut plain = Scores(vec![None; count]);
        let mut occluding = plain.clone();
        for members in self.members(folds) {
            self.prepare(kind, &members)?;
            let visibility = self.lumigraph.visibility.take();
            for &judge in &members {
                plain.0[judge] = Some(self.score(judge)?);
            }
            if visibility.is_some() {
                self.lumigraph.visibility = visibility;
                for &judge in &members {
                    occluding.0[judge] = Some(self.score(judge)?);
                }
            }
            let hopeless = |leader: &Scores| {
                let mut tried = [&plain, &occluding].into_iter().filter(|s| s.asked() > 0);
                tried.all(|s| s.is_hopeless_beside(leader))
            };
            if leader.is_some_and(hopeless) {
                break;
            }
        }
        Ok(if occluding.asked() == 0 {
            (plain, None)
        } else {
            (occluding, Some(plain))
        })
    }

    /// The dense points of all photos, which are half known where they were on trial.
    pub(super) fn dense(&mut self) -> Result<Fitted, SceneError> {
        let within = self.bound_of_all()?;
        Ok(self.dense_of_all()?.dense(self.names.clone(), within))
    }

    /// The surface carved out of them.
    pub(super) fn carved_dense(&mut self) -> Result<Fitted, SceneError> {
        let within = self.bound_of_all()?;
        self.dense_of_all()?.surface(within)
    }

    fn dense_of_all(&mut self) -> Result<CarvedPoints, SceneError> {
        let sparse = self.scene.observed_points(self.without, &self.names);
        let taken = self.take_matching()?;
        let (matching, note) = self.matching.insert(taken);
        let (points, note) = (matching.points(&sparse, &[]), note.clone());
        Ok(CarvedPoints::of_all(&self.views(&[]), points, sparse.len())?.with_note(note))
    }

    /// Dense points without the judges of a judge's fold, those of all folds found at once: much of it takes one
    /// thread each.
    fn dense_without(&mut self, judge: usize) -> Result<&CarvedPoints, SceneError> {
        let folds = self.folds_of_points();
        if self.dense.is_empty() {
            let (mut matching, note) = self.take_matching()?;
            let members = self.members(folds);
            let gone: Vec<Vec<usize>> = members.iter().map(|m| self.sources(m)).collect();
            matching.compare(&gone);
            let find = |(members, gone): (&Vec<usize>, &Vec<usize>)| {
                let sparse = self.sparse_without(members);
                let points = matching.points(&sparse, gone);
                CarvedPoints::new(&self.views(gone), points, sparse.len())
            };
            self.dense = members.par_iter().zip(&gone).map(find).collect();
            self.matching = Some((matching, note));
        }
        Ok(&self.dense[judge % folds])
    }

    /// The names of photos that are not used where some judges are not, either.
    fn names_without(&self, judges: &[usize]) -> BTreeSet<String> {
        let judges = judges.iter().map(|&j| self.judges[j].name.clone());
        self.without.iter().cloned().chain(judges).collect()
    }

    /// The sparse points, as all but some judges observe them.
    fn sparse_without(&self, judges: &[usize]) -> Vec<SparsePoint> {
        self.scene
            .observed_points(&self.names_without(judges), &self.names)
    }

    /// The judges' source views.
    fn sources(&self, judges: &[usize]) -> Vec<usize> {
        judges.iter().map(|&j| self.judges[j].source_idx).collect()
    }

    /// The photos' views. Those of photos that were never taken are where another is: a camera's place
    /// is known to be free.
    fn views(&self, gone: &[usize]) -> Vec<View> {
        let sources = &self.lumigraph.sources;
        let other = (0..sources.len()).find(|i| !gone.contains(i)).unwrap_or(0);
        let view = |i: usize| &sources[if gone.contains(&i) { other } else { i }].view;
        (0..sources.len()).map(|i| view(i).clone()).collect()
    }

    /// The sparse points of all photos.
    pub(super) fn points(&mut self) -> Result<Fitted, SceneError> {
        let within = self.bound_of_all()?;
        Ok(Fitted::points(within))
    }

    /// How many times what is fitted to photos is fitted, each time without a few judges.
    fn folds(&self) -> usize {
        let at_once = (self.names.len() / FOLD).max(1);
        self.judges.len().div_ceil(at_once)
    }

    /// And what is made of points: a multiple of that, so that each of these folds lies within one of those.
    fn folds_of_points(&self) -> usize {
        let at_once = (self.names.len() / FOLD_OF_POINTS).max(1);
        self.judges
            .len()
            .div_ceil(at_once)
            .next_multiple_of(self.folds())
    }

    /// The judges of each fold; there may be more folds than judges.
    fn members(&self, folds: usize) -> Vec<Vec<usize>> {
        let count = self.judges.len();
        let of_fold = |fold: usize| (fold..count).step_by(folds).collect();
        (0..folds.min(count)).map(of_fold).collect()
    }

    fn cutout(&mut self) -> Result<&Option<Cutout>, SceneError> {
        let found = match self.cutout.take() {
            Some(found) => found,
            None => self.scene.cutout(self.without, None)?,
        };
        Ok(self.cutout.insert(found))
    }

    /// What bounds points of all photos.
    fn bound_of_all(&mut self) -> Result<Option<Arc<Solid>>, SceneError> {
        Ok(self.cutout()?.as_ref().map(|c| Arc::clone(&c.hull)))
    }

    /// What bounds points where a judge is drawn: carved without it, and with it a few others.
    fn bound(&mut self, judge: usize) -> Result<Option<Arc<Solid>>, SceneError> {
        let Some(like) = self.cutout()?.clone() else {
            return Ok(None);
        };
        let folds = self.folds();
        let fold = judge % folds;
        if let Some(bound) = self.bounds.get(&fold) {
            return Ok(bound.clone());
        }
        let members: Vec<usize> = (fold..self.judges.len()).step_by(folds).collect();
        let carved = self
            .scene
            .cutout(&self.names_without(&members), Some(&like))?;
        let bound = carved.map(|carved| carved.hull);
        self.bounds.insert(fold, bound.clone());
        Ok(bound)
    }

    /// Makes the lumigraph's proxy without some of the judges.
    fn prepare(&mut self, kind: Kind, judges: &[usize]) -> Result<(), SceneError> {
        let fewer = self.names_without(judges);
        let within = match kind {
            Kind::Points | Kind::Dense | Kind::CarvedDense => self.bound(judges[0])?,
            _ => None,
        };
        let (proxy, points) = match kind {
            Kind::Points => {
                let views = self.views(&self.sources(judges));
                let points = on_surface(&views, self.sparse_without(judges));
                (Proxy::Points { within }, points)
            }
            Kind::ViewPlane => (Proxy::ViewPlane, self.sparse_without(judges)),
            Kind::Dense => {
                let points = self.dense_without(judges[0])?.points.clone();
                let dense = DensePoints {
                    within,
                    ..DensePoints::default()
                };
                (Proxy::Dense(Arc::new(dense)), points)
            }
            Kind::CarvedDense => {
                let mut solid = self.dense_without(judges[0])?.solid()?;
                solid.keep_within(within);
                (Proxy::Mesh(Arc::new(solid)), Vec::new())
            }
            // A box may happen to suit a few photos of anything.
            Kind::Tunnel => (self.scene.fit_hallway(&fewer)?.proxy, Vec::new()),
            _ => (self.scene.fit_to_all(kind, &fewer)?.proxy, Vec::new()),
        };
        self.lumigraph.visibility = Visibility::of(&proxy, &self.lumigraph.sources);
        self.lumigraph.proxy = proxy;
        self.lumigraph.points = points;
        Ok(())
    }

    fn take_matching(&mut self) -> Result<(Matching, Option<String>), SceneError> {
        match self.matching.take() {
            Some(matching) => Ok(matching),
            None => self.scene.matching(self.without),
        }
    }

    /// PSNR of a judge's picture, in dB: of what is to be used of the photo, at the photo's own exposure, which no surface
    /// tells.
    fn score(&self, judge: usize) -> Result<f64, SceneError> {
        let judge = &self.judges[judge];
        let part = Part {
            without: &[judge.source_idx],
            ..Part::default()
        };
        let (desired, options) = (judge.desired.clone(), FieldOptions::default());
        let frame = Frame::with(&self.lumigraph, desired, options, &part);
        let picture = cpu::render(&frame, Method::Exact).map_err(|e| self.undrawn(e))?;
        let psnr = |used: Option<&GrayImage>| {
            score::psnr_exposed(&picture, &judge.truth, used).map_err(unfit)
        };
        // A mask that is nowhere half or more does not judge.
        let psnr = match psnr(judge.used.as_ref())? {
            Some(psnr) => psnr,
            None => psnr(None)?.unwrap_or(PSNR_CAP_DB),
        };
        // What none differs in says nothing of the others.
        Ok(psnr.min(PSNR_CAP_DB))
    }

    /// Why a picture could not be drawn.
    fn undrawn(&self, error: RenderError) -> SceneError {
        match error {
            RenderError::Photo(error) => {
                let name = self.names[error.source_idx].clone();
                SceneError::Damaged(BTreeMap::from([(name, error.message)]))
            }
            error => unfit(error),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::wall;
    use super::*;
    use image::Luma;

    #[test]
    fn the_more_photos_there_are_the_more_judges_share_what_is_made_without_them() {
        let none = BTreeSet::new();
        for photos in [6, 9, 24, 47, 48, 100, 250] {
            let (_folder, capture) = wall(photos, 1);
            let (scene, _) = Scene::open(&capture, false).unwrap();
            let trials = Trials::new(&scene, &none, photos.min(8)).unwrap();
            let (coarse, fine) = (trials.folds(), trials.folds_of_points());
            let members = trials.members(fine);
            // 1. Each judges once, and never too many of the photos are missing.
            let mut all = members.concat();
            all.sort_unstable();
            assert!(all.into_iter().eq(0..trials.judges.len()), "{photos}");
            let most = members.iter().map(Vec::len).max();
            assert!(most <= Some((photos / FOLD_OF_POINTS).max(1)), "{photos}");
            assert_eq!(members.len() == 1, photos >= 8 * FOLD_OF_POINTS);
            // 2. What bounds points is made without any that judges them.
            for members in members {
                let fold = members[0] % coarse;
                assert!(members.iter().all(|m| m % coarse == fold), "{photos}");
            }
        }
    }

    #[test]
    fn how_a_judge_is_exposed_does_not_judge() {
        let (_folder, capture) = wall(6, 1);
        let none = BTreeSet::new();
        let (scene, _) = Scene::open(&capture, false).unwrap();
        let scores = || {
            let mut trials = Trials::new(&scene, &none, 2).unwrap();
            let first = trials.judges[0].name.clone();
            let (scores, _) = trials.scores(Kind::Plane, None).unwrap();
            (first, scores.0[0].unwrap())
        };
        let (first, clean) = scores();
        let mut photos = scene.photos.iter();
        let path = &photos.find(|photo| photo.name == first).unwrap().path;
        let mut picture = image::open(path).unwrap().into_rgb8();
        picture.iter_mut().for_each(|value| *value /= 2);
        picture.save(path).unwrap();
        let (_, halved) = scores();
        // As a picture of half the light, all differences are half as large.
        let expected = clean + 2.0_f64.log10() * 20.0;
        assert!((halved - expected).abs() < 1.0, "{halved} dB, {clean} dB");
    }

    #[test]
    fn what_masks_cover_does_not_judge() {
        let (_folder, capture) = wall(6, 1);
        let none = BTreeSet::new();
        let scores = |scene: &Scene| {
            let mut trials = Trials::new(scene, &none, 2).unwrap();
            let (scores, _) = trials.scores(Kind::Plane, None).unwrap();
            assert!(scores.complete());
            scores.0.into_iter().flatten().collect::<Vec<_>>()
        };
        let (mut scene, _) = Scene::open(&capture, false).unwrap();
        let clean = scores(&scene);
        // What nobody else sees, at other places in other photos.
        for (i, photo) in scene.photos.iter_mut().enumerate() {
            let left = 9 * i as u32;
            let hides = |x: u32, y: u32| (left..left + 9).contains(&x) && y >= 24;
            let mut picture = image::open(&photo.path).unwrap().into_rgba8();
            for (x, y, pixel) in picture.enumerate_pixels_mut() {
                if hides(x, y) {
                    pixel.0 = [255, 0, 255, 255];
                }
            }
            picture.save(&photo.path).unwrap();
            let mask = GrayImage::from_fn(64, 48, |x, y| Luma([if hides(x, y) { 0 } else { 255 }]));
            let file = capture.join(format!("mask{i}.png"));
            mask.save(&file).unwrap();
            photo.ignore_mask = Some(file);
        }
        let masked = scores(&scene);
        for (masked, clean) in masked.iter().zip(&clean) {
            assert!(
                (masked - clean).abs() < 2.5,
                "{masked} dB, clean {clean} dB"
            );
        }
        // Without masks it does.
        for photo in &mut scene.photos {
            photo.ignore_mask = None;
        }
        let all = scores(&scene);
        assert!(
            all.iter()
                .zip(&clean)
                .all(|(all, clean)| all + 3.0 < *clean),
            "{all:?}"
        );
    }
}
