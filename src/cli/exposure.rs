//! Whether and how photos are brought to one exposure.

use super::session::spinner;
use calibrate::exposure::{Evidence, Verdict};
use clap::Args;
use lumigraph::scene::{Matched, Scene};
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::time::Instant;

/// Whether photos are brought to one exposure.
#[derive(Args, Clone, Default)]
pub(super) struct ExposureArgs {
    /// Blend photos as they were exposed, without matching them
    #[arg(long)]
    no_exposure: bool,
}

/// What became of the photos' exposures.
pub(super) struct ExposureUsed {
    /// Smallest and largest gain of all channels and photos that are not held out; `None` where none is used.
    range: Option<(f64, f64)>,
    how: How,
    seconds: f64,
    /// Photos that could not be decoded as exposures were matched, by name, with what is wrong with
    /// each: whoever draws is to leave them out from the first picture on.
    pub(super) left_out: BTreeMap<String, String>,
}

enum How {
    Off,
    Stored,
    Matched(Verdict),
}

impl ExposureArgs {
    /// Forgets the scene's own gains if none are to be used.
    #[cfg(feature = "window")]
    pub(super) fn forget(&self, scene: &mut Scene) {
        if self.no_exposure {
            scene.forget_exposure();
        }
    }

    /// Whether a scene has no gains, and is to be given some: until then it is drawn as without any.
    #[cfg(feature = "window")]
    pub(super) fn is_awaited(&self, scene: &Scene, without: &BTreeSet<String>) -> bool {
        let has_none = scene.photos.iter().all(|photo| photo.gain.is_none());
        !self.no_exposure && has_none && !keeps_own(scene, without)
    }

    /// Gives the scene's photos the gains to draw with: its own if it has been written
    /// with some that rest on none of the photos in `without`, else new ones.
    pub(super) fn choose(&self, scene: &mut Scene, without: &BTreeSet<String>) -> ExposureUsed {
        self.choose_by(scene, without, |scene| scene.match_exposure(without))
    }

    /// The same for a scene that is to be written: what draws leaves out, unless asked to keep it, has no say.
    pub(super) fn choose_to_write(&self, scene: &mut Scene) -> ExposureUsed {
        self.choose_by(scene, &BTreeSet::new(), Scene::match_exposure_by_trusted)
    }

    fn choose_by(
        &self,
        scene: &mut Scene,
        without: &BTreeSet<String>,
        matching: impl FnOnce(&mut Scene) -> Matched,
    ) -> ExposureUsed {
        let start = Instant::now();
        let mut left_out = BTreeMap::new();
        let how = if self.no_exposure {
            scene.forget_exposure();
            How::Off
        } else if keeps_own(scene, without) {
            How::Stored
        } else {
            let bar = spinner("matching exposures");
            let matched = matching(scene);
            bar.finish_and_clear();
            left_out = matched.left_out;
            How::Matched(matched.verdict)
        };
        // Of photos that are drawn from one without a gain counts as if it were 1.
        let drawn = || scene.photos.iter().filter(|p| !without.contains(&p.name));
        let has_gains = drawn().any(|p| p.gain.is_some());
        let gains = drawn().filter(|_| has_gains);
        let gains = gains.flat_map(|p| p.gain.unwrap_or([1.0; 3]));
        let range = gains.fold(None, |range: Option<(f64, f64)>, gain| {
            let (low, high) = range.unwrap_or((gain, gain));
            Some((low.min(gain), high.max(gain)))
        });
        ExposureUsed {
            range,
            how,
            seconds: start.elapsed().as_secs_f64(),
            left_out,
        }
    }
}

/// Whether a scene's own gains are drawn with, or that it has none: it was written with what rests on
/// none of the photos in `without`.
pub(super) fn keeps_own(scene: &Scene, without: &BTreeSet<String>) -> bool {
    scene.folder.is_some() && scene.exposure_is_without(without)
}

impl ExposureUsed {
    /// For people.
    pub(super) fn text(&self) -> String {
        let range = self.range.map_or_else(String::new, |(low, high)| {
            format!("gains {low:.3} to {high:.3}")
        });
        let percent = |v: f64| 100.0 * v;
        match (&self.how, self.range) {
            (How::Off, _) => "as it is (--no-exposure)".to_owned(),
            (How::Stored, Some(_)) => format!("{range} (the scene's own)"),
            (How::Stored, None) => "as it is (the scene has no gains)".to_owned(),
            (How::Matched(Verdict::Matched(e)), _) => {
                let error = percent(e.error);
                format!("{range}, ±{error:.1} % (matched in {:.1} s)", self.seconds)
            }
            (How::Matched(Verdict::NotMeasurable(e)), _) => format!(
                "as it is (gains differ by {:.1} %, too little or too unsure, ±{:.1} %; found in \
                 {:.1} s)",
                percent(e.spread),
                percent(e.error),
                self.seconds
            ),
            (How::Matched(Verdict::NoLinks), _) => {
                "as it is (photos share too few sparse points to match them by that they show whole, neither too dark \
                 nor too bright)"
                    .to_owned()
            }
        }
    }

    pub(super) fn json(&self) -> Value {
        let (how, evidence): (&str, Option<Evidence>) = match self.how {
            How::Off => ("off", None),
            How::Stored if self.range.is_some() => ("the scene's own", None),
            How::Stored => ("the scene has none", None),
            How::Matched(Verdict::Matched(e)) => ("matched", Some(e)),
            How::Matched(Verdict::NotMeasurable(e)) => ("not measurable", Some(e)),
            How::Matched(Verdict::NoLinks) => ("no links", None),
        };
        json!({
            "used": self.range.is_some(),
            "how": how,
            "range": self.range.map(|(low, high)| [low, high]),
            "spread": evidence.map(|e| e.spread),
            "error": evidence.map(|e| e.error),
            "seconds": self.seconds,
        })
    }
}
