//! Which proxy suits a scene: decided by photos held out for it.

use super::fit::{Fitted, Kind, unfit};
use super::{Scene, SceneError};
use proxy::Proxy;
use render::{FieldOptions, Frame, Method, cpu, score};
use std::collections::BTreeSet;

/// Photos held out to decide, at most; of fewer than [`FEWEST`] none is.
const HELD_OUT: usize = 4;
const FEWEST: usize = 6;
/// Pixels along the longer side of the pictures that decide.
const LONG_SIDE: u32 = 240;
/// Differences that mean nothing: the kind that is fitted and drawn faster is taken.
const TIED_DB: f64 = 0.1;
/// Comparing so many photos with one another takes longer than anyone waits unasked.
const MOST_COMPARED: usize = 400;

/// What became of a kind of proxy that was tried.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    /// Which.
    pub kind: Kind,
    /// The mean PSNR of the pictures that decide, in dB, or why there is none.
    pub score: Result<f64, String>,
}

impl Scene {
    /// The kind of proxy that shows best what photos left out for the purpose show, fitted
    /// without the photos of the given names, which have no say in it.
    ///
    /// # Errors
    /// Nothing can be fitted; photos that cannot be decoded.
    pub fn fit_best(&self, without: &BTreeSet<String>) -> Result<Fitted, SceneError> {
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

        // 1. Too few photos to spare any: the kind that suits most scenes.
        if rest.len() < FEWEST {
            let kinds = [Kind::Points, Kind::Plane];
            let kind = kinds.into_iter().find(|k| candidates.contains(k));
            let mut fitted = self.fit(kind.unwrap_or(Kind::Plane), without)?;
            fitted.note.get_or_insert_with(|| {
                format!("{} photos are too few to compare proxies by", rest.len())
            });
            return Ok(fitted);
        }

        // 2. Each kind, without some photos spread over the rest.
        let count = HELD_OUT.min(rest.len() / 3);
        let judges: Vec<&str> = (0..count)
            .map(|i| rest[(2 * i + 1) * rest.len() / (2 * count)])
            .collect();
        let mut fewer = without.clone();
        fewer.extend(judges.iter().map(|name| (*name).to_owned()));
        let mut trials: Vec<Trial> = Vec::new();
        for kind in candidates {
            let score = if kind == Kind::Dense && rest.len() > MOST_COMPARED {
                Err(format!("{} photos take long to compare", rest.len()))
            } else {
                // A box may happen to suit a few photos of anything.
                let fitted = match kind {
                    Kind::Tunnel => self.fit_hallway(&fewer),
                    _ => self.fit_coarsely(kind, &fewer, LONG_SIDE),
                };
                fitted
                    .and_then(|fitted| self.judge(fitted.proxy, &fewer, &judges))
                    .map_err(|error| error.to_string())
            };
            trials.push(Trial { kind, score });
        }

        // 3. The first that is as good as the best, from all.
        let score = |trial: &Trial| trial.score.as_ref().copied().unwrap_or(f64::NEG_INFINITY);
        let most = trials.iter().map(score).fold(f64::NEG_INFINITY, f64::max);
        let best = trials.iter().find(|trial| score(trial) >= most - TIED_DB);
        let mut fitted = self.fit(best.map_or(Kind::Plane, |t| t.kind), without)?;
        fitted.trials = trials;
        Ok(fitted)
    }

    /// Whether a scene has at all what a kind of proxy is made from.
    fn may_have(&self, kind: Kind) -> bool {
        match kind {
            Kind::Plane => true,
            Kind::DominantPlane
            | Kind::ViewPlane
            | Kind::Tunnel
            | Kind::Points
            | Kind::Carved
            | Kind::Dense => self.reconstruction.points.len() >= 3,
            Kind::Hull => self.photos.iter().all(|p| p.object_matte.is_some()),
            Kind::Depth => self.photos.iter().any(|p| p.depth_map.is_some()),
        }
    }

    /// The mean PSNR of small pictures of the photos of the given names, in dB.
    fn judge(
        &self,
        proxy: Proxy,
        without: &BTreeSet<String>,
        judges: &[&str],
    ) -> Result<f64, SceneError> {
        let lumigraph = self.lumigraph(without, proxy)?;
        let mut scores = Vec::new();
        for name in judges {
            let view = self.view(name)?;
            let (width, height) = capture::reduced_size((view.width, view.height), LONG_SIDE);
            let photo = self.photos.iter().find(|p| p.name == *name);
            // One that cannot be decoded is no judge; drawing will report it.
            let truth = photo.and_then(|p| p.decode((view.width, view.height)).ok());
            let Some(truth) = truth else { continue };
            let truth = capture::resize(&truth, width, height);
            let frame = Frame::new(
                &lumigraph,
                view.resized(width, height),
                FieldOptions::default(),
            );
            let picture = cpu::render(&frame, Method::Exact);
            let picture = picture.map_err(unfit)?;
            let score = score::score(&picture, &truth);
            scores.push(score.map_err(unfit)?.psnr);
        }
        if scores.is_empty() {
            return Err(unfit("no photo to judge by"));
        }
        Ok(scores.iter().sum::<f64>() / scores.len() as f64)
    }
}

/// What the trials came to, for people.
pub fn trials_text(trials: &[Trial]) -> String {
    let of = |trial: &Trial| match &trial.score {
        Ok(db) => format!("{} {db:.2} dB", trial.kind.name()),
        Err(why) => format!("no {} ({why})", trial.kind.name()),
    };
    trials.iter().map(of).collect::<Vec<_>>().join(", ")
}
