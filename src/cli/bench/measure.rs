//! A scene measured: time, memory and error of each setting.

use super::measured::{Effort, Measured, Pictures, Subject};
use super::settings::{Renderer, Setting, settings};
use super::skips::{skips, start_up};
use super::times::{Times, in_turn, timed};
use super::variants::{HeldOut, Variants, default_proxy, draw, held_out, tried};
use crate::cli::evaluate::say_lost_capture;
use crate::cli::exposure::keeps_own;
use anyhow::Context;
use calibrate::View;
use indicatif::ProgressBar;
use lumigraph::scene::{Kind, Scene, TruthScore};
use render::score::{PSNR_CAP_DB, Score, score};
use render::{DeviceChoice, Engine, Lumigraph, Method};
use std::collections::BTreeMap;

/// Measures a scene. `read_ms` is what opening it took.
pub(super) fn measure(
    mut scene: Scene,
    read_ms: f64,
    name: &str,
    effort: Effort,
    device: DeviceChoice,
    bar: &ProgressBar,
) -> anyhow::Result<(Subject, Pictures)> {
    say_lost_capture(&scene);
    let without = scene.held_out_by_default()?;
    let held_out = held_out(&scene, &without, effort)?;
    let first_view = &held_out.first().context("no photo can be held out")?.view;
    let size = [first_view.width, first_view.height];

    // 1. What every run begins with.
    let unmatched = {
        let mut unmatched = scene.clone();
        unmatched.forget_exposure();
        unmatched
    };
    // As `render` has it.
    let ((), exposure) = timed(|| {
        if !keeps_own(&scene, &without) {
            scene.match_exposure(&without);
        }
    });
    bar.set_message(format!("{name}: fitting"));
    let (default, fit) = timed(|| default_proxy(&scene, &without, effort.thorough));
    let (default, default_kind, proxy_text) = default?;
    let mut engine = Engine::open(device)?;
    let mut variants = Variants {
        scene: &scene,
        unmatched,
        without: &without,
        default,
        fitted: BTreeMap::new(),
    };

    // 2. The surfaces that the scene can have.
    let message = |kind: Kind| bar.set_message(format!("{name}: fitting {}", kind.name()));
    let (kinds, failed) = fit_others(
        &mut variants,
        default_kind.as_deref(),
        effort.thorough,
        message,
    );
    let settings = settings(effort.thorough, &kinds);

    let start_up = start_up(
        &mut engine,
        &variants,
        first_view,
        [read_ms, exposure.wall_ms, fit.wall_ms],
    )?;
    let skips = skips(&variants, first_view)?;

    // 3. The first frame of each from photos on disk.
    bar.set_length(settings.len() as u64 * (1 + effort.repeats as u64));
    bar.set_message(format!("{name}: measuring"));
    let drawn = first_frames(&mut engine, &variants, &settings, first_view, bar)?;

    // 4. Scores, and the difference from the exact picture; photos are decoded on the way.
    let (scored, pictures) = scores(&mut engine, &settings, &drawn, &held_out)?;

    // 5. Times: all settings in turn, over and over, each time beginning with another.
    let repeats = in_turn(
        settings.len(),
        effort.repeats,
        held_out.len(),
        bar,
        |i, view| {
            let (lumigraph, view) = (drawn.lumigraph(i), &held_out[view].view);
            Ok(draw(&mut engine, lumigraph, view, &settings[i]).map(drop)?)
        },
    )?;

    let measured = settings.iter().enumerate().map(|(i, setting)| {
        let (score, steps) = scored[i];
        let (first, image_bytes, images_made) = drawn.first[i];
        let mut measured = Measured {
            name: setting.name(),
            knob: setting.knob.to_owned(),
            value: setting.value.clone(),
            frame: Times::default(),
            cpu_ms_range: [0.0; 2],
            first,
            image_bytes,
            images_made,
            psnr: score.psnr.min(PSNR_CAP_DB),
            ssim: score.ssim,
            coverage: score.coverage,
            holes: None,
            steps_from_exact: steps,
            psnr_to_exact: (20.0 * (255.0 / steps).log10()).min(PSNR_CAP_DB),
        };
        measured.set_times(&repeats[i]);
        measured
    });
    let about = format!(
        "{} photos, {} of them held out, {} of these drawn at {} × {}; {}; surface {proxy_text}",
        scene.photos.len(),
        without.len(),
        held_out.len(),
        size[0],
        size[1],
        engine.description(),
    );
    let result = Subject {
        name: name.to_owned(),
        is_interior: false,
        about,
        views: held_out.iter().map(|h| h.name.clone()).collect(),
        size,
        start_up: Some(start_up),
        skips,
        settings: measured.collect(),
        failed,
    };
    Ok((result, pictures))
}

/// Fits the kinds of surface that are tried beside the default one: which could be, and why others not.
fn fit_others(
    variants: &mut Variants<'_>,
    default: Option<&str>,
    thorough: bool,
    begins: impl Fn(Kind),
) -> (Vec<Kind>, BTreeMap<String, String>) {
    let mut kinds = Vec::new();
    let mut failed = BTreeMap::new();
    for kind in tried(thorough) {
        if Some(kind.name()) == default {
            continue;
        }
        begins(kind);
        match variants.scene.fit(kind, variants.without) {
            Ok(fitted) => {
                variants.fitted.insert(kind.name(), fitted.proxy);
                kinds.push(kind);
            }
            Err(error) => {
                failed.insert(format!("proxy {}", kind.name()), error.to_string());
            }
        }
    }
    (kinds, failed)
}

/// What settings draw from, and what their first frames took.
struct Drawn {
    /// Each for all settings that draw from the same.
    lumigraphs: Vec<Lumigraph>,
    /// By setting, which of them.
    of_setting: Vec<usize>,
    /// By setting: the first frame's times, the bytes of the photos decoded for it, and their number.
    first: Vec<(Times, u64, usize)>,
}

impl Drawn {
    fn lumigraph(&self, setting: usize) -> &Lumigraph {
        &self.lumigraphs[self.of_setting[setting]]
    }
}

/// Draws the first frame of each setting from photos on disk; those that draw from the same keep them.
fn first_frames(
    engine: &mut Engine,
    variants: &Variants<'_>,
    settings: &[Setting],
    view: &View,
    bar: &ProgressBar,
) -> anyhow::Result<Drawn> {
    let mut drawn = Drawn {
        lumigraphs: Vec::new(),
        of_setting: Vec::new(),
        first: Vec::new(),
    };
    let mut sources = Vec::new();
    for setting in settings {
        let fresh = variants.lumigraph(setting)?;
        let (picture, times) = timed(|| draw(engine, &fresh, view, setting));
        picture?;
        let residency = fresh.photos.residency();
        drawn
            .first
            .push((times, residency.held, fresh.photos.decoded()));
        let source = (setting.kind, setting.reduced, setting.exposure);
        let known = sources.iter().position(|other| *other == source);
        drawn.of_setting.push(known.unwrap_or_else(|| {
            sources.push(source);
            drawn.lumigraphs.push(fresh);
            sources.len() - 1
        }));
        bar.inc(1);
    }
    Ok(drawn)
}

/// By setting, its mean score and the root mean square difference from its exact picture in steps of 255;
/// and the default setting's pictures of the first view.
fn scores(
    engine: &mut Engine,
    settings: &[Setting],
    drawn: &Drawn,
    held_out: &[HeldOut],
) -> anyhow::Result<(Vec<(Score, f64)>, Pictures)> {
    let mut scored = Vec::new();
    let mut pictures: Option<Pictures> = None;
    for (k, setting) in settings.iter().enumerate() {
        let lumigraph = drawn.lumigraph(k);
        let exact = Setting {
            renderer: Renderer::By(Method::Exact),
            ..setting.clone()
        };
        let (mut scores, mut squared) = (Vec::new(), 0.0);
        for (i, HeldOut { view, truth, .. }) in held_out.iter().enumerate() {
            let picture = draw(engine, lumigraph, view, setting)?;
            scores.push(truth.score(&picture)?);
            let exact = draw(engine, lumigraph, view, &exact)?;
            squared += 255.0_f64.powi(2) * 10.0_f64.powf(-0.1 * score(&picture, &exact)?.psnr);
            if i == 0 && setting.is_default() {
                pictures = Some(Pictures {
                    truth: truth.picture().clone(),
                    setting: setting.name(),
                    drawn: picture,
                    exact: Some(exact),
                });
            }
        }
        let mean = TruthScore::mean(&scores).context("nothing was drawn")?;
        scored.push((mean.score, (squared / held_out.len() as f64).sqrt()));
    }
    Ok((scored, pictures.context("the default was drawn")?))
}
