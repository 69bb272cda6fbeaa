//! A proxy fitted, and the held-out photos drawn with it.

use calibrate::View;
use cpu_time::ProcessTime;
use lumigraph::scene::{Fitted, Kind, Scene, SceneError, Truth, TruthScore, trials_text};
use render::{FieldOptions, Frame, Lumigraph, Method, cpu};
use serde::Serialize;
use std::collections::BTreeSet;

/// What a kind of proxy scores on one capture.
#[derive(Serialize)]
pub(super) struct Scored {
    /// The mean over the held-out photos.
    #[serde(flatten)]
    pub(super) mean: TruthScore,
    /// Processor seconds that fitting took, over all threads; of `auto` with all trials.
    pub(super) fit_cpu_s: f64,
    /// How the proxy came about.
    from: String,
    /// Of `auto`: the kind it chose, and what each kind scored in its trials.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) chosen: Option<String>,
}

/// A proxy, and what fitting it took.
pub(super) struct Fit {
    pub(super) fitted: Fitted,
    cpu_s: f64,
}

/// A held-out photo and its camera, of the size to render.
pub(super) struct HeldOut {
    desired: View,
    truth: Truth,
}

/// The held-out photos, reduced; those that cannot be decoded are passed over.
pub(super) fn truths(
    scene: &Scene,
    held_out: &BTreeSet<String>,
    long_side: u32,
) -> Result<Vec<HeldOut>, SceneError> {
    let mut truths = Vec::new();
    for name in held_out {
        let view = scene.view(name)?;
        let (width, height) = capture::reduced_size((view.width, view.height), long_side);
        match scene.truth(name, held_out)? {
            Ok(truth) => truths.push(HeldOut {
                desired: view.resized(width, height),
                truth: truth.resized(width, height),
            }),
            Err(error) => eprintln!("{name}: {error}"),
        }
    }
    Ok(truths)
}

/// Fits a proxy, `auto` where no kind is given, without the photos of the given names.
pub(super) fn fit(
    scene: &Scene,
    kind: Option<Kind>,
    held_out: &BTreeSet<String>,
) -> Result<Fit, SceneError> {
    let start = ProcessTime::now();
    let fitted = match kind {
        Some(kind) => scene.fit(kind, held_out)?,
        None => scene.fit_best(held_out)?,
    };
    let cpu_s = start.elapsed().as_secs_f64();
    Ok(Fit { fitted, cpu_s })
}

/// Draws and scores the held-out photos.
pub(super) fn score(
    lumigraph: &Lumigraph,
    fit: &Fit,
    truths: &[HeldOut],
) -> Result<Scored, SceneError> {
    let unfit = |error: &dyn std::error::Error| SceneError::Unfit(error.to_string());
    let mut scores = Vec::new();
    for HeldOut { desired, truth } in truths {
        let frame = Frame::new(lumigraph, desired.clone(), FieldOptions::default());
        let picture = cpu::render(&frame, Method::Exact).map_err(|e| unfit(&e))?;
        scores.push(truth.score(&picture).map_err(|e| unfit(&e))?);
    }
    let mean = TruthScore::mean(&scores);
    let mean = mean.ok_or_else(|| SceneError::Unfit("no photo is held out".to_owned()))?;
    let Fitted {
        how, trials, proxy, ..
    } = &fit.fitted;
    let chosen = format!("{}: {}", proxy.kind(), trials_text(trials));
    Ok(Scored {
        mean,
        fit_cpu_s: fit.cpu_s,
        from: how.clone(),
        chosen: (!trials.is_empty()).then_some(chosen),
    })
}
