//! Which proxy suits a scene: decided by photos held out for it.

use super::fit::{FEWEST_POINTS, Fitted, Kind};
use super::trial::{Scores, Trials};
use super::{Scene, SceneError};
use proxy::Proxy;
use std::collections::BTreeSet;
use std::sync::Arc;

/// Photos that judge, at most; of fewer than [`FEWEST`] none does.
const JUDGES: usize = 8;
const FEWEST: usize = 6;
/// Differences that mean nothing: the kind that is fitted and drawn faster is taken.
const TIED_DB: f64 = 0.05;
/// Comparing so many photos with one another takes longer than anyone waits unasked.
const MOST_COMPARED: usize = 400;

/// What became of a kind of proxy that was tried.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    /// Which.
    pub kind: Kind,
    /// Whether what lies behind a part of it counted as hidden.
    pub occludes: bool,
    /// The mean PSNR of the pictures that decide, each at its photo's own exposure, in dB, or why there is none.
    pub score: Result<f64, String>,
}

impl Scene {
    /// The kind of proxy that shows best what photos left out for the purpose show, fitted
    /// without the photos of the given names, which have no say in it; nor have those that cannot
    /// be decoded, as long as two others remain; see [`Fitted::left_out`].
    ///
    /// # Errors
    /// Nothing can be fitted; too few photos that can be decoded.
    pub fn fit_best(&self, without: &BTreeSet<String>) -> Result<Fitted, SceneError> {
        self.fit_without_damaged(without, |fewer| self.best_of_all(fewer))
    }

    /// The same, all other photos having a say.
    ///
    /// # Errors
    /// As [`Self::fit_best`]; [`SceneError::Damaged`] of photos that cannot be decoded.
    fn best_of_all(&self, without: &BTreeSet<String>) -> Result<Fitted, SceneError> {
        let rest: Vec<&str> = self
            .photos
            .iter()
            .map(|photo| photo.name.as_str())
            .filter(|name| !without.contains(*name))
            .collect();
        let candidates: Vec<Kind> = Kind::ALL
            .into_iter()
            .filter(|k| self.may_have(*k))
            .collect();

        // 1. Too few photos to spare any: a kind that suits most scenes.
        if rest.len() < FEWEST {
            let why = format!("{} photos are too few to compare proxies by", rest.len());
            return self.fit_usual(&candidates, without, rest.len(), why);
        }

        // 2. Each kind, judged by photos spread over the rest, each drawn without itself.
        let mut trials: Vec<Trial> = Vec::new();
        let mut bench = Trials::new(self, without, JUDGES.min(rest.len()))?;
        if rest.len() <= MOST_COMPARED {
            bench.find_damaged()?;
        }
        let mut leader: Option<Scores> = None;
        let mut best: Option<(Kind, bool)> = None;
        for &kind in &candidates {
            if matches!(kind, Kind::Dense | Kind::CarvedDense) && rest.len() > MOST_COMPARED {
                let score = Err(format!("{} photos take long to compare", rest.len()));
                trials.push(Trial::of(kind, true, score));
                continue;
            }
            let (scores, plain) = match bench.scores(kind, leader.as_ref()) {
                Ok(scores) => scores,
                // It would have a say in some kinds and not in others.
                Err(damaged @ SceneError::Damaged(_)) => return Err(damaged),
                Err(error) => {
                    trials.push(Trial::of(kind, true, Err(error.to_string())));
                    continue;
                }
            };
            for (occludes, scores) in [(true, Some(scores)), (false, plain)] {
                let Some(scores) = scores else { continue };
                let score = if scores.complete() {
                    Ok(scores.mean())
                } else {
                    let (asked, behind) = (scores.asked(), scores.mean());
                    Err(format!("given up at {behind:.2} dB after {asked} photos"))
                };
                trials.push(Trial::of(kind, occludes, score));
                let most = leader.as_ref().map_or(f64::NEG_INFINITY, Scores::mean);
                if scores.complete() && scores.mean() > most + TIED_DB {
                    leader = Some(scores);
                    best = Some((kind, occludes));
                }
            }
        }

        // 3. The best, from all.
        let Some((kind, occludes)) = best else {
            let why = "no kind of proxy could be judged by photos".to_owned();
            let fitted = self.fit_usual(&candidates, without, rest.len(), why)?;
            return Ok(Fitted { trials, ..fitted });
        };
        let mut fitted = match kind {
            Kind::Dense => bench.dense()?,
            Kind::CarvedDense => bench.carved_dense()?,
            Kind::Points => bench.points()?,
            _ => self.fit_to_all(kind, without)?,
        };
        if let (false, Proxy::Mesh(solid)) = (occludes, &mut fitted.proxy)
            && let Some(own) = Arc::get_mut(solid)
        {
            own.hide_nothing();
        }
        fitted.trials = trials;
        Ok(fitted)
    }

    /// Of the kinds that suit most scenes the first that can be fitted to so many photos, where these do not
    /// tell which is best, and a note of why and of what could not be fitted before it.
    ///
    /// # Errors
    /// Not even a plane can be fitted; [`SceneError::Damaged`] of photos that cannot be decoded.
    fn fit_usual(
        &self,
        candidates: &[Kind],
        without: &BTreeSet<String>,
        photos: usize,
        why: String,
    ) -> Result<Fitted, SceneError> {
        let takes_long = |kind: Kind| kind == Kind::Dense && photos > MOST_COMPARED;
        // Of one photo of several none is left, as nobody else saw them.
        let points = self.observed(without)?.1.len();
        // Points of one alone, where it has some, lie where no other agrees that they do; dense ones it has not.
        let needs_others = |kind: Kind| matches!(kind, Kind::Points | Kind::Dense);
        let mut said = vec![why];
        for kind in [Kind::Points, Kind::Hull, Kind::Dense] {
            if !candidates.contains(&kind) || takes_long(kind) {
                continue;
            }
            if kind == Kind::Points && points < FEWEST_POINTS {
                let few = format!("no points ({points} sparse points are too few for a surface)");
                said.push(few);
                continue;
            }
            if needs_others(kind) && photos < 2 {
                let name = kind.name();
                said.push(format!(
                    "no {name} (one photo alone does not tell where things are)"
                ));
                continue;
            }
            match self.fit_to_all(kind, without) {
                Ok(fitted) => return Ok(noted(fitted, said)),
                // Without these photos all kinds may be fitted.
                Err(damaged @ SceneError::Damaged(_)) => return Err(damaged),
                Err(error) => said.push(format!("no {} ({error})", kind.name())),
            }
        }
        match self.fit_to_all(Kind::Plane, without) {
            // Photos of one place that look all around.
            Err(error) if self.suits_any_distance() => {
                said.push(format!("no plane ({error})"));
                Ok(noted(self.fit_to_all(Kind::Carved, without)?, said))
            }
            plane => Ok(noted(plane?, said)),
        }
    }

    /// Whether a scene has at all what a kind of proxy is made from.
    fn may_have(&self, kind: Kind) -> bool {
        match kind {
            Kind::Plane => true,
            Kind::DominantPlane | Kind::Tunnel => self.reconstruction.points.len() >= FEWEST_POINTS,
            Kind::Carved if self.suits_any_distance() => true,
            Kind::ViewPlane | Kind::Points | Kind::Carved => self.observed_count() >= FEWEST_POINTS,
            // Photos are compared whatever there is of points.
            Kind::Dense | Kind::CarvedDense => true,
            Kind::Hull => self.has_silhouettes(),
            Kind::Depth => self.photos.iter().any(|p| p.depth_map.is_some()),
        }
    }
}

/// A proxy with what was said before it was fitted, ahead of its own note.
fn noted(mut fitted: Fitted, mut said: Vec<String>) -> Fitted {
    said.extend(fitted.note.take());
    fitted.note = Some(said.join("; "));
    fitted
}

impl Trial {
    fn of(kind: Kind, occludes: bool, score: Result<f64, String>) -> Self {
        Self {
            kind,
            occludes,
            score,
        }
    }
}

/// What the trials came to, for people.
pub fn trials_text(trials: &[Trial]) -> String {
    let of = |trial: &Trial| {
        let name = trial.kind.name();
        let how = if trial.occludes {
            ""
        } else {
            " that hides nothing"
        };
        match &trial.score {
            Ok(db) => format!("{name}{how} {db:.2} dB"),
            Err(why) => format!("no {name}{how} ({why})"),
        }
    };
    trials.iter().map(of).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::super::tests;
    use super::*;
    use tempfile::TempDir;

    /// A scene of five photos of a wall, without depth maps.
    fn wall() -> (TempDir, Scene) {
        let (folder, capture) = tests::wall(5, 2);
        let (mut scene, _) = Scene::open(&capture, false).unwrap();
        for photo in &mut scene.photos {
            photo.depth_map = None;
        }
        (folder, scene)
    }

    /// What is said of the plane that is taken of the first photo alone: once its calibration has depths,
    /// without which there is none.
    fn note_of_plane(scene: &mut Scene, others: &BTreeSet<String>) -> String {
        let error = scene.fit_best(others).unwrap_err().to_string();
        assert!(error.contains("give the plane by hand"), "{error}");
        scene.photos[0].depth_bounds = Some([2.0, 6.0]);
        let fitted = scene.fit_best(others).unwrap();
        assert_eq!(fitted.proxy.kind(), "plane");
        fitted.note.unwrap()
    }

    #[test]
    fn points_that_nobody_else_saw_are_not_taken() {
        let (_folder, mut scene) = wall();
        let all_but =
            |count: usize| -> BTreeSet<String> { scene.names().into_iter().skip(count).collect() };
        let (others, but_two) = (all_but(1), all_but(2));
        let fitted = scene.fit_best(&but_two).unwrap();
        assert_eq!(fitted.proxy.kind(), "points");
        // Of those that the photo left saw with others nothing is known without these.
        let note = note_of_plane(&mut scene, &others);
        let said = "; no points (0 sparse points are too few for a surface); no dense (";
        assert!(note.contains(said), "{note}");
    }

    /// Which nothing tells the distance of, nor has to.
    #[test]
    fn photos_of_one_place_that_tell_no_distances_have_a_plane_or_a_dome() {
        let (_folder, mut scene) = wall();
        scene.reconstruction.points.clear();
        for (step_deg, kind) in [(20.0_f64, "plane"), (72.0, "carved")] {
            for (i, image) in scene.reconstruction.images.values_mut().enumerate() {
                image.keypoints.clear();
                let angle = i as f64 * step_deg.to_radians();
                let pose = &mut image.camera_from_world;
                pose.rotation = glam::DQuat::from_rotation_y(angle);
                pose.translation = glam::DVec3::ZERO;
            }
            let fitted = scene.fit_best(&BTreeSet::new()).unwrap();
            assert_eq!(fitted.proxy.kind(), kind);
            let note = fitted.note.unwrap();
            assert!(
                note.contains("one place, where any distance serves"),
                "{note}"
            );
        }
        let error = scene.fit(Kind::Plane, &BTreeSet::new()).unwrap_err();
        assert_eq!(
            error.to_string(),
            "all photos were taken from one place and look all around, which no one plane lies before; try carved, \
             a dome around them"
        );
    }

    /// As of a capture of one photo, whose points nobody else saw from the start.
    #[test]
    fn of_one_photo_a_plane_is_taken_as_no_other_agrees_on_its_points() {
        let (_folder, mut scene) = wall();
        scene.photos.truncate(1);
        let name = scene.photos[0].name.clone();
        let whole = &mut scene.reconstruction;
        whole.images.retain(|_, image| image.name == name);
        for point in whole.points.values_mut() {
            point.track.retain(|(id, _)| whole.images.contains_key(id));
        }
        assert!(scene.observed_count() >= FEWEST_POINTS);

        let fitted = scene.fit_best(&BTreeSet::new()).unwrap();
        assert_eq!(fitted.proxy.kind(), "plane");
        assert!(
            fitted.how.contains(" observations of points"),
            "{}",
            fitted.how
        );
        assert_eq!(
            fitted.note.unwrap(),
            "1 photos are too few to compare proxies by; no points (one photo alone does not tell where things are); \
             no dense (one photo alone does not tell where things are)"
        );
    }

    #[test]
    fn few_photos_without_points_are_compared_before_a_plane_is_taken() {
        let (_folder, mut scene) = wall();
        scene.reconstruction.points.clear();
        for image in scene.reconstruction.images.values_mut() {
            image.keypoints.clear();
        }

        // 1. Photos that overlap.
        let fitted = scene.fit_best(&BTreeSet::new()).unwrap();
        assert_eq!(fitted.proxy.kind(), "dense");
        let note = fitted.note.unwrap();
        assert_eq!(note, "5 photos are too few to compare proxies by");

        // 2. One alone agrees with none, and tells no depths.
        let others: BTreeSet<String> = scene.names().into_iter().skip(1).collect();
        let note = note_of_plane(&mut scene, &others);
        assert!(
            note.starts_with("1 photos are too few to compare proxies by; no dense ("),
            "{note}"
        );
        let own = "; the proxy is a plane fitted to the nearest and farthest depths of 1 photos";
        assert!(note.contains(own), "{note}");
    }
}
