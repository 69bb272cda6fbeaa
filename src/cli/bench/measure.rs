//! A scene measured: time, memory and error of each setting.

use super::settings::{Renderer, Setting, settings};
use anyhow::Context;
use calibrate::{Distortion, View};
use cpu_time::ProcessTime;
use image::RgbaImage;
use indicatif::ProgressBar;
use lumigraph::bench::median;
use lumigraph::scene::{Kind, Scene, Truth, TruthScore};
use proxy::Proxy;
use render::score::{PSNR_CAP_DB, score};
use render::{
    DeviceChoice, Engine, Frame, Lumigraph, Method, Prepared, RenderError, Skips, SourceView,
    prepare_within,
};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::time::Instant;

/// How much is measured.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Effort {
    /// Every value of every knob, every kind of surface; else the most telling.
    pub(super) thorough: bool,
    /// Pixels along the longer side of the pictures.
    pub(super) long_side: u32,
    /// Held-out photos that are drawn, at most.
    pub(super) views: usize,
    /// Interleaved repeats, of which the median counts.
    pub(super) repeats: usize,
}

/// CPU and wall time in milliseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Times {
    pub(super) cpu_ms: f64,
    pub(super) wall_ms: f64,
}

impl Times {
    /// The median of each; zero of nothing.
    pub(super) fn median(times: &[Self]) -> Self {
        let of = |value: fn(&Self) -> f64| {
            median(&times.iter().map(value).collect::<Vec<_>>()).unwrap_or_default()
        };
        Self {
            cpu_ms: of(|t| t.cpu_ms),
            wall_ms: of(|t| t.wall_ms),
        }
    }
}

/// What became of a setting.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Measured {
    pub(super) name: String,
    pub(super) knob: String,
    pub(super) value: String,
    /// A frame's, photos decoded before: the median of the repeats' means over the views.
    pub(super) frame: Times,
    /// The least and the greatest repeat's CPU time, in milliseconds.
    pub(super) cpu_ms_range: [f64; 2],
    /// The first view's from photos on disk.
    pub(super) first: Times,
    /// What the photos decoded, or images made, for that first view took, and their number.
    pub(super) image_bytes: u64,
    pub(super) images_made: usize,
    /// Against the photos held out, or the truth: means over the views.
    pub(super) psnr: f64,
    pub(super) ssim: f64,
    pub(super) coverage: f64,
    /// The share of pixels that nothing paints and something should; of interiors.
    pub(super) holes: Option<f64>,
    /// The root mean square difference from the same setting's exact picture, in steps of 255,
    /// and the same as PSNR; zero and [`PSNR_CAP_DB`] of the exact one.
    pub(super) steps_from_exact: f64,
    pub(super) psnr_to_exact: f64,
}

/// From the command to the first picture, in milliseconds of wall time.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct StartUp {
    /// Reading the calibration and finding the photos.
    pub(super) read_ms: f64,
    /// Matching exposures.
    pub(super) exposure_ms: f64,
    /// Fitting the default surface.
    pub(super) fit_ms: f64,
    /// Preparing the first frame: distance maps, surface and field.
    pub(super) prepare_ms: f64,
    /// Drawing it, with decoding its photos.
    pub(super) draw_ms: f64,
    /// Of that, the floor: decoding the photos that it uses, once, on all threads.
    pub(super) decode_ms: f64,
    pub(super) photos_used: usize,
}

/// What leaving one thing out is worth, for the first view.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Skip {
    /// As `--no-skip` has it.
    pub(super) name: String,
    /// What was left out, for people; `None` where there was nothing to leave out.
    pub(super) fired: Option<String>,
    /// A picture's, with and without.
    pub(super) with: Times,
    pub(super) without: Times,
    /// Whether the bytes are the same.
    pub(super) same_bytes: bool,
}

impl Skip {
    /// CPU time without it over that with it.
    pub(super) fn ratio(&self) -> f64 {
        self.without.cpu_ms / self.with.cpu_ms.max(1e-6)
    }
}

/// All that was measured of a scene or an interior.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Subject {
    pub(super) name: String,
    pub(super) is_interior: bool,
    /// What it is and what was drawn, for people.
    pub(super) about: String,
    pub(super) views: Vec<String>,
    pub(super) size: [u32; 2],
    pub(super) start_up: Option<StartUp>,
    pub(super) skips: Vec<Skip>,
    pub(super) settings: Vec<Measured>,
    /// Settings that could not be measured, and why.
    pub(super) failed: BTreeMap<String, String>,
}

impl Subject {
    pub(super) fn psnr_title(&self) -> &'static str {
        match self.is_interior {
            true => "PSNR against the model drawn whole, dB",
            false => "PSNR of held-out photos, dB",
        }
    }

    pub(super) fn steps_title(&self) -> &'static str {
        match self.is_interior {
            true => "difference from the model drawn whole, steps of 255 (rms)",
            false => "difference from the exact field, steps of 255 (rms)",
        }
    }
}

impl Measured {
    /// Takes the medians of repeats.
    pub(super) fn set_times(&mut self, repeats: &[Times]) {
        self.frame = Times::median(repeats);
        let cpu = repeats.iter().map(|t| t.cpu_ms);
        self.cpu_ms_range = [
            cpu.clone().fold(f64::INFINITY, f64::min),
            cpu.fold(0.0, f64::max),
        ];
    }

    pub(super) fn is_default(&self) -> bool {
        self.knob == "default"
    }
}

/// Pictures of a view for the report.
pub(super) struct Pictures {
    pub(super) truth: RgbaImage,
    pub(super) default: RgbaImage,
    pub(super) exact: RgbaImage,
}

struct HeldOut {
    name: String,
    view: View,
    truth: Truth,
}

/// A scene with what can be changed of it.
struct Variants<'a> {
    scene: &'a Scene,
    unmatched: Scene,
    without: &'a BTreeSet<String>,
    default: Proxy,
    fitted: BTreeMap<&'static str, Proxy>,
}

impl Variants<'_> {
    /// What a setting draws from, no photo decoded.
    fn lumigraph(&self, setting: &Setting) -> anyhow::Result<Lumigraph> {
        let scene = if setting.exposure {
            self.scene
        } else {
            &self.unmatched
        };
        let proxy = match setting.kind {
            None => &self.default,
            Some(kind) => self.fitted.get(kind.name()).context("was fitted before")?,
        };
        let sizes = self.scene.reconstruction.cameras.values();
        let longest = sizes.map(|c| c.width.max(c.height)).max().unwrap_or(1);
        let long_side = match setting.reduced {
            1 => u32::MAX,
            times => (longest / times).max(16),
        };
        Ok(scene.reduced_lumigraph(self.without, proxy.clone(), long_side)?)
    }
}

pub(super) fn timed<T>(work: impl FnOnce() -> T) -> (T, Times) {
    let (cpu, wall) = (ProcessTime::now(), Instant::now());
    let done = work();
    let times = Times {
        cpu_ms: 1e3 * cpu.elapsed().as_secs_f64(),
        wall_ms: 1e3 * wall.elapsed().as_secs_f64(),
    };
    (done, times)
}

fn draw(
    engine: &mut Engine,
    lumigraph: &Lumigraph,
    view: &View,
    setting: &Setting,
) -> Result<RgbaImage, RenderError> {
    let frame = Frame::new(lumigraph, view.clone(), setting.options);
    match setting.renderer {
        Renderer::By(method) => engine.render(&frame, method),
        Renderer::Within(bound) => {
            let chosen = prepare_within(&frame, bound)?;
            engine.draw(&frame, &chosen.prepared)
        }
    }
}

/// Measures a scene. `read_ms` is what opening it took.
pub(super) fn measure(
    mut scene: Scene,
    read_ms: f64,
    name: &str,
    effort: Effort,
    device: DeviceChoice,
    bar: &ProgressBar,
) -> anyhow::Result<(Subject, Pictures)> {
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
    let ((), exposure) = timed(|| {
        scene.match_exposure(&without);
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
    let mut failed = BTreeMap::new();
    let mut kinds = Vec::new();
    for kind in tried(effort.thorough) {
        if Some(kind.name()) == default_kind.as_deref() {
            continue;
        }
        bar.set_message(format!("{name}: fitting {}", kind.name()));
        match scene.fit(kind, &without) {
            Ok(fitted) => {
                variants.fitted.insert(kind.name(), fitted.proxy);
                kinds.push(kind);
            }
            Err(error) => {
                failed.insert(format!("proxy {}", kind.name()), error.to_string());
            }
        }
    }
    let settings = settings(effort.thorough, &kinds);

    let start_up = start_up(
        &mut engine,
        &variants,
        first_view,
        [read_ms, exposure.wall_ms, fit.wall_ms],
    )?;
    let skips = skips(&variants, first_view)?;

    // 3. The first frame of each from photos on disk; those that draw from the same keep them.
    let mut sets: Vec<(Setting, Lumigraph)> = Vec::new();
    let mut of_setting = Vec::new();
    let mut first = Vec::new();
    bar.set_length(settings.len() as u64 * (1 + effort.repeats as u64));
    bar.set_message(format!("{name}: measuring"));
    for setting in &settings {
        let fresh = variants.lumigraph(setting)?;
        let (drawn, times) = timed(|| draw(&mut engine, &fresh, first_view, setting));
        drawn?;
        let residency = fresh.photos.residency();
        first.push((times, residency.held, fresh.photos.decoded()));
        let is_same = |(other, _): &(Setting, Lumigraph)| {
            (other.kind, other.reduced, other.exposure)
                == (setting.kind, setting.reduced, setting.exposure)
        };
        of_setting.push(sets.iter().position(is_same).unwrap_or_else(|| {
            sets.push((setting.clone(), fresh));
            sets.len() - 1
        }));
        bar.inc(1);
    }

    // 4. Scores, and the difference from the exact picture; photos are decoded on the way.
    let mut scored = Vec::new();
    let mut pictures: Option<Pictures> = None;
    for (setting, &set) in settings.iter().zip(&of_setting) {
        let lumigraph = &sets[set].1;
        let exact = Setting {
            renderer: Renderer::By(Method::Exact),
            ..setting.clone()
        };
        let (mut scores, mut squared) = (Vec::new(), 0.0);
        for (i, HeldOut { view, truth, .. }) in held_out.iter().enumerate() {
            let picture = draw(&mut engine, lumigraph, view, setting)?;
            scores.push(truth.score(&picture)?);
            let exact = draw(&mut engine, lumigraph, view, &exact)?;
            squared += 255.0_f64.powi(2) * 10.0_f64.powf(-0.1 * score(&picture, &exact)?.psnr);
            if i == 0 && setting.is_default() {
                pictures = Some(Pictures {
                    truth: truth.picture().clone(),
                    default: picture,
                    exact,
                });
            }
        }
        let mean = TruthScore::mean(&scores).context("nothing was drawn")?;
        scored.push((mean.score, (squared / held_out.len() as f64).sqrt()));
    }

    // 5. Times: all settings in turn, over and over, each time beginning with another.
    let repeats = in_turn(
        settings.len(),
        effort.repeats,
        held_out.len(),
        bar,
        |i, view| {
            let (lumigraph, view) = (&sets[of_setting[i]].1, &held_out[view].view);
            Ok(draw(&mut engine, lumigraph, view, &settings[i]).map(drop)?)
        },
    )?;

    let measured = settings.iter().enumerate().map(|(i, setting)| {
        let (score, steps) = scored[i];
        let (times, image_bytes, images_made) = first[i];
        let mut measured = Measured {
            name: setting.name(),
            knob: setting.knob.to_owned(),
            value: setting.value.clone(),
            frame: Times::default(),
            cpu_ms_range: [0.0; 2],
            first: times,
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
    Ok((result, pictures.context("the default was drawn")?))
}

/// Times of settings, each of which draws all views: by setting, the mean over the views of each
/// repeat. All take turns, over and over, each time beginning with another.
pub(super) fn in_turn(
    settings: usize,
    repeats: usize,
    views: usize,
    bar: &ProgressBar,
    mut draw: impl FnMut(usize, usize) -> anyhow::Result<()>,
) -> anyhow::Result<Vec<Vec<Times>>> {
    let mut all: Vec<Vec<Times>> = vec![Vec::new(); settings];
    for repeat in 0..repeats {
        for step in 0..settings {
            let i = (step + repeat * settings / repeats) % settings;
            let mut sum = Times::default();
            for view in 0..views {
                let (drawn, times) = timed(|| draw(i, view));
                drawn?;
                sum.cpu_ms += times.cpu_ms / views as f64;
                sum.wall_ms += times.wall_ms / views as f64;
            }
            all[i].push(sum);
            bar.inc(1);
        }
    }
    Ok(all)
}

/// The photos that judge, spread evenly over those held out, reduced.
fn held_out(
    scene: &Scene,
    without: &BTreeSet<String>,
    effort: Effort,
) -> anyhow::Result<Vec<HeldOut>> {
    let names: Vec<&String> = without.iter().collect();
    let count = effort.views.min(names.len());
    let mut all = Vec::new();
    for i in 0..count {
        let name = names[(2 * i + 1) * names.len() / (2 * count)];
        let view = scene.view(name)?;
        let (width, height) = capture::reduced_size((view.width, view.height), effort.long_side);
        all.push(HeldOut {
            name: name.clone(),
            view: view.resized(width, height),
            truth: scene.truth(name, without)??.resized(width, height),
        });
    }
    Ok(all)
}

/// The surface that `render` would take, its kind where it was fitted, and what to say of it. What
/// takes minutes to choose is chosen only where time does not matter.
fn default_proxy(
    scene: &Scene,
    without: &BTreeSet<String>,
    thorough: bool,
) -> anyhow::Result<(Proxy, Option<String>, String)> {
    let own = scene.proxy.as_ref().filter(|own| {
        let unseen = own.fitted_without.as_ref();
        unseen.is_none_or(|unseen| without.iter().all(|name| unseen.contains(name)))
    });
    if let Some(own) = own {
        return Ok((own.proxy.clone(), None, "the scene's own".to_owned()));
    }
    let fitted = if thorough {
        scene.fit_best(without)?
    } else {
        let kinds = [Kind::Points, Kind::Hull, Kind::Plane];
        let fitted = kinds.into_iter().find_map(|k| scene.fit(k, without).ok());
        fitted.context("no surface can be fitted")?
    };
    let kind = fitted.proxy.kind().to_owned();
    let text = format!("{kind}: {}", fitted.how);
    Ok((fitted.proxy, Some(kind), text))
}

/// Kinds of surface that are tried.
fn tried(thorough: bool) -> Vec<Kind> {
    match thorough {
        true => Kind::ALL.to_vec(),
        false => vec![
            Kind::Plane,
            Kind::ViewPlane,
            Kind::Points,
            Kind::Tunnel,
            Kind::Hull,
        ],
    }
}

fn start_up(
    engine: &mut Engine,
    variants: &Variants<'_>,
    view: &View,
    [read_ms, exposure_ms, fit_ms]: [f64; 3],
) -> anyhow::Result<StartUp> {
    let default = &Setting::default_one();
    let start = Instant::now();
    let lumigraph = variants.lumigraph(default)?;
    let frame = Frame::new(&lumigraph, view.clone(), default.options);
    let prepared = Prepared::new(&frame, Method::TRIANGULATED)?;
    let prepare_ms = 1e3 * start.elapsed().as_secs_f64();
    let (drawn, draw) = timed(|| engine.draw(&frame, &prepared));
    drawn?;
    // The floor.
    let fresh = variants.lumigraph(default)?;
    let used: Vec<usize> = (0..lumigraph.photos.len())
        .filter(|&i| lumigraph.photos.was_decoded(i))
        .collect();
    let decode_ms = decode_all(&fresh, &used)?;
    Ok(StartUp {
        read_ms,
        exposure_ms,
        fit_ms,
        prepare_ms,
        draw_ms: draw.wall_ms,
        decode_ms,
        photos_used: used.len(),
    })
}

/// Wall time of decoding photos on all threads, in milliseconds.
fn decode_all(lumigraph: &Lumigraph, photos: &[usize]) -> anyhow::Result<f64> {
    use rayon::prelude::*;
    let decode = |&i: &usize| lumigraph.photos.get(i).map(drop);
    let (decoded, times) = timed(|| photos.par_iter().map(decode).collect::<Result<(), _>>());
    decoded?;
    Ok(times.wall_ms)
}

/// Of skips that are measured, repeats.
const SKIP_REPEATS: usize = 5;

/// Draws a picture with and without something left out, in turn: their times, the pictures' bytes.
pub(super) fn skip(
    name: &str,
    fired: Option<String>,
    mut draw: impl FnMut(bool) -> anyhow::Result<(RgbaImage, Times)>,
) -> anyhow::Result<Skip> {
    let same_bytes = draw(true)?.0 == draw(false)?.0;
    let (mut with, mut without) = (Vec::new(), Vec::new());
    for _ in 0..SKIP_REPEATS {
        with.push(draw(true)?.1);
        without.push(draw(false)?.1);
    }
    Ok(Skip {
        name: name.to_owned(),
        fired,
        with: Times::median(&with),
        without: Times::median(&without),
        same_bytes,
    })
}

/// Each on its own, of the first view's triangulated picture by the CPU.
fn skips(variants: &Variants<'_>, view: &View) -> anyhow::Result<Vec<Skip>> {
    let default = &Setting::default_one();
    let lumigraph = variants.lumigraph(default)?;
    let render = |lumigraph: &Lumigraph, skips: Skips| {
        let frame = Frame::new(lumigraph, view.clone(), default.options).skipping(skips);
        let picture = Engine::open(DeviceChoice::Cpu)?.render(&frame, Method::TRIANGULATED)?;
        Ok::<_, anyhow::Error>((picture, frame.scored().scorings))
    };
    let drawn = |skips: Skips| {
        let (drawn, times) = timed(|| render(&lumigraph, skips));
        Ok((drawn?.0, times))
    };
    let (_, few) = render(&lumigraph, Skips::ALL)?;
    let views = Skips {
        views: false,
        ..Skips::ALL
    };
    let (_, all) = render(&lumigraph, views)?;
    let (used, photos) = (lumigraph.photos.decoded(), lumigraph.photos.len());
    let pinhole = |s: &&SourceView| s.view.lens.distortion() == Distortion::None;
    let pinholes = lumigraph.sources.iter().filter(pinhole).count();
    let lenses = Skips {
        lenses: false,
        ..Skips::ALL
    };
    let or = |skips: bool, others: Skips| if skips { Skips::ALL } else { others };
    Ok(vec![
        // From photos on disk.
        skip(
            "photos",
            (used < photos).then(|| format!("{} of {photos} photos", photos - used)),
            |skips| {
                let fresh = variants.lumigraph(default)?;
                let (drawn, times) = timed(|| {
                    if !skips {
                        decode_all(&fresh, &(0..photos).collect::<Vec<_>>())?;
                    }
                    render(&fresh, Skips::ALL)
                });
                Ok((drawn?.0, times))
            },
        )?,
        skip(
            "views",
            (few < all).then(|| format!("{} of {all} scorings", all - few)),
            |skips| drawn(or(skips, views)),
        )?,
        skip(
            "lenses",
            (pinholes > 0).then(|| format!("{pinholes} of {photos} lenses")),
            |skips| drawn(or(skips, lenses)),
        )?,
    ])
}
