//! A scene, a proxy and an engine, drawing views one after the other.

mod in_order;
#[cfg(test)]
mod tests;

use super::budget;
use super::damaged::{leave_out, left_out_text};
use super::exposure::{ExposureArgs, ExposureUsed};
use super::ledger::Ledger;
use super::options::{DrawArgs, FieldArgs, FinishArgs};
use super::output::say;
use super::report::Costs;
use super::surface::{ChosenProxy, ProxyArgs};
use super::time::{Clock, InWindow, TimeArgs};
use anyhow::bail;
use calibrate::View;
use cpu_time::ProcessTime;
use glam::DVec3;
use image::RgbaImage;
use indicatif::{ProgressBar, ProgressStyle};
use lumigraph::scene::{Scene, SceneError, Truth};
use render::{
    DeviceChoice, Engine, FieldOptions, Frame, Lumigraph, Method, Moment, Part, PhotoError,
    Prepared, RenderError, Residency, Skips,
};
use serde_json::Value;
use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::io::IsTerminal as _;
use std::time::Duration;

/// Everything needed to draw.
pub(super) struct Session {
    pub(super) scene: Scene,
    pub(super) proxy: ChosenProxy,
    pub(super) exposure: ExposureUsed,
    pub(super) options: FieldOptions,
    pub(super) method: Method,
    /// Steps of 255: in [`Self::draw_all`] it chooses each frame's method.
    pub(super) max_error: Option<f64>,
    /// Across a pixel at which the proxy jumps.
    edge_samples: u32,
    sharp: bool,
    /// Where time plays a part.
    pub(super) clock: Option<Clock>,
    pub(super) in_window: InWindow,
    /// Of the frames that were drawn one after the other.
    pub(super) ledger: Ledger,
    pub(super) costs: Costs,
    /// Why frames of a path may show nothing, for people (see [`super::frames::Asked::why_empty`]).
    pub(super) why_empty: [&'static str; 2],
    /// What was said of what draws, before anything was drawn.
    notes: Vec<String>,
    /// How much of what the engine has to say was said.
    notes_said: usize,
    /// Held-out photos, and those found corrupt.
    without: BTreeSet<String>,
    /// The latter, with what is wrong with each.
    left_out: BTreeMap<String, String>,
    /// Photos that were brought to the graphics processor before another was left out.
    uploaded: BTreeSet<String>,
    lumigraph: Lumigraph,
    engine: Option<Engine>,
    device: DeviceChoice,
    strict: bool,
    decodes_all: bool,
    skips: Skips,
    cpu_memory: Option<u64>,
    gpu_memory: Option<u64>,
}

/// A view drawn, and how long that took.
pub(super) struct Timed {
    pub(super) picture: RgbaImage,
    /// Processor time for the picture, decoding photos not included.
    pub(super) cpu: Duration,
}

impl Session {
    /// A session without the photos of the given names; they play no part in fitting the
    /// proxy and matching exposures either.
    pub(super) fn new(
        mut scene: Scene,
        mut without: BTreeSet<String>,
        strict: bool,
        proxy: &ProxyArgs,
        exposure: &ExposureArgs,
        field: &FieldArgs,
        draw: &DrawArgs,
        time: &TimeArgs,
        time_s: Option<f64>,
    ) -> anyhow::Result<Self> {
        if scene.photos.iter().all(|p| without.contains(&p.name)) {
            return Err(SceneError::NothingLeft(scene.photos.len()).into());
        }
        let (exposure, proxy) = if proxy.is_searched(&scene, &without) {
            // What is drawn to choose a proxy is exposed as all that is drawn later.
            let exposure = exposure.choose(&mut scene, &without);
            leave_out(&scene, &exposure.left_out, &mut without, strict)?;
            (exposure, proxy.choose(&scene, &without, strict)?)
        } else {
            // What cannot be read is said at once.
            let proxy = proxy.choose(&scene, &without, strict)?;
            (exposure.choose(&mut scene, &without), proxy)
        };
        // Whichever frames ask for them, those that are known to be damaged show in none.
        without.extend(proxy.left_out.keys().cloned());
        leave_out(&scene, &exposure.left_out, &mut without, strict)?;
        let mut left_out = exposure.left_out.clone();
        left_out.extend(proxy.left_out.clone());
        let mut lumigraph = scene.lumigraph(&without, proxy.proxy.clone())?;
        lumigraph
            .photos
            .set_budget(budget::of_photos(draw.cpu_memory));
        let clock = Clock::of(time, time_s, &lumigraph)?;
        Ok(Self {
            scene,
            clock,
            in_window: InWindow::default(),
            ledger: Ledger::new(),
            costs: Costs::default(),
            why_empty: [""; 2],
            notes: Vec::new(),
            notes_said: 0,
            proxy,
            exposure,
            options: field.options(),
            method: field.method(),
            max_error: None,
            edge_samples: 1,
            sharp: true,
            without,
            left_out,
            uploaded: BTreeSet::new(),
            lumigraph,
            engine: None,
            device: draw.device(),
            strict,
            decodes_all: draw.decodes_all(),
            skips: draw.skips(),
            cpu_memory: draw.cpu_memory,
            gpu_memory: draw.gpu_memory,
        })
    }

    pub(super) fn lumigraph(&self) -> &Lumigraph {
        &self.lumigraph
    }

    /// What frames leave out.
    pub(super) fn skips(&self) -> Skips {
        self.skips
    }

    /// The sparse points that do not rest on held-out photos, in the world.
    pub(super) fn points(&self) -> Vec<DVec3> {
        points(&self.scene, &self.without)
    }

    /// What draws, for people.
    pub(super) fn device(&self) -> String {
        let engine = self.engine.as_ref();
        engine.map_or_else(|| "nothing yet".to_owned(), Engine::description)
    }

    /// What draws, once it is open.
    pub(super) fn engine(&self) -> Option<&Engine> {
        self.engine.as_ref()
    }

    /// What photos took on the graphics processor, where one draws.
    pub(super) fn gpu_residency(&self) -> Option<Residency> {
        Some(self.engine()?.gpu()?.residency())
    }

    /// Whether a photo was ever brought to the graphics processor.
    pub(super) fn was_uploaded(&self, source_idx: usize) -> bool {
        let gpu = self.engine.as_ref().and_then(Engine::gpu);
        let name = &self.lumigraph.sources[source_idx].name;
        gpu.is_some_and(|gpu| gpu.was_loaded(&self.lumigraph.photos, source_idx))
            || self.uploaded.contains(name)
    }

    /// Opens the engine; with `--no-skip` decodes every photo. Drawing does so by itself,
    /// but messages look better before a progress bar than in it.
    pub(super) fn prepare(&mut self) -> anyhow::Result<()> {
        if self.engine.is_some() {
            return Ok(());
        }
        let mut engine = Engine::open(self.device)?;
        if let Some(gpu) = engine.gpu_mut() {
            gpu.set_budget(self.gpu_memory);
        }
        if self.device == DeviceChoice::Auto && engine.gpu().is_none() {
            let note = "no graphics processor answers; drawing on the CPU";
            self.notes.push(note.to_owned());
        }
        if self.gpu_memory.is_some() && engine.gpu().is_none() {
            let note = "--gpu-memory changes nothing: no graphics processor draws";
            self.notes.push(note.to_owned());
        }
        self.notes.iter().for_each(|note| say!("note: {note}"));
        self.engine = Some(engine);
        if self.decodes_all {
            for source_idx in 0..self.lumigraph.photos.len() {
                // What cannot be decoded waits for whoever asks for it, as without --no-skip: pictures
                // are the same.
                if let Err(error) = self.lumigraph.photos.get(source_idx)
                    && self.strict
                {
                    return self.leave_out(&error);
                }
            }
        }
        Ok(())
    }

    /// What a frame of [`Self::draw_all`] has cost, for `--json`.
    pub(super) fn cost_json(&self, frame_idx: usize) -> Value {
        let mut cost = self.costs.json_of(frame_idx);
        cost["stages"] = self.ledger.of_frame(frame_idx).json();
        cost
    }

    /// What time had to do with it, for `--json`.
    pub(super) fn time_json(&self) -> Option<Value> {
        let clock = self.clock.as_ref()?;
        Some(self.in_window.json(clock))
    }

    /// The moment of a view of this name and time; `None` where time plays no part.
    pub(super) fn moment(&self, name: &str, own: Option<f64>) -> anyhow::Result<Option<Moment>> {
        let clock = self.clock.as_ref();
        clock.map(|clock| clock.moment(name, own)).transpose()
    }

    /// What is done to pictures once they are drawn; nothing where that is not said.
    pub(super) fn finish_as(&mut self, finish: &FinishArgs) {
        self.edge_samples = finish.edge_samples;
        self.sharp = finish.sharp;
    }

    /// Draws a view. Photos that turn out corrupt are reported and left out from then on
    /// and the view drawn again, unless `--strict`.
    pub(super) fn draw(
        &mut self,
        desired: &View,
        moment: Option<&Moment>,
    ) -> anyhow::Result<RgbaImage> {
        self.prepare()?;
        loop {
            let frame = frame(&self.lumigraph, desired, self.options, moment, self.skips);
            let Some(engine) = &mut self.engine else {
                bail!("the engine was opened above");
            };
            let drawn = Prepared::new(&frame, self.method).and_then(|prepared| {
                let mut picture = engine.draw(&frame, &prepared)?;
                engine.smooth(&frame, &prepared, self.edge_samples, &mut picture)?;
                if !self.sharp {
                    engine.soften(&frame, &prepared, &mut picture)?;
                }
                Ok(picture)
            });
            say_notes(engine, &mut self.notes_said);
            match drawn {
                Ok(picture) => {
                    if moment.is_some() {
                        self.in_window.note(frame.taking_part().count());
                    }
                    return Ok(picture);
                }
                Err(RenderError::Photo(error)) => self.leave_out(&error)?,
                Err(error) => return Err(error.into()),
            }
        }
    }

    /// Draws those views that are not there, one after the other, and gives each picture to `take`. While
    /// one is drawn the next is prepared and its photos are decoded, and the one before is taken.
    ///
    /// All are drawn of the same photos. Those that turn out corrupt are reported and left out, unless
    /// `--strict`, and all views are drawn without them, also those that were there: from the one that asked for
    /// them on, and then those before. What they have cost so far is forgotten, `again` is told of
    /// all photos that were left out, and `is_there` is false of every view from then on.
    pub(super) fn draw_all(
        &mut self,
        views: &[(View, Option<Moment>)],
        is_there: &mut [bool],
        mut take: impl FnMut(usize, RgbaImage) -> anyhow::Result<()> + Send,
        mut again: impl FnMut(&BTreeMap<String, String>) -> anyhow::Result<()>,
    ) -> anyhow::Result<()> {
        self.prepare()?;
        let mut order: Vec<usize> = (0..views.len()).filter(|i| !is_there[*i]).collect();
        let mut done = 0;
        while let Err(error) = self.draw_in_order(views, &order, &mut done, &mut take) {
            match error.downcast_ref() {
                Some(RenderError::Photo(error)) => self.leave_out(error)?,
                _ => return Err(error),
            }
            again(&self.left_out)?;
            is_there.fill(false);
            let asked = order[done];
            order = (asked..views.len()).chain(0..asked).collect();
            done = 0;
        }
        if let Some(note) = self.note_of_empty() {
            say!("note: {note}");
        }
        Ok(())
    }

    /// Has something to say, too, before anything is drawn.
    pub(super) fn note(&mut self, note: &str) {
        self.notes.push(note.to_owned());
    }

    /// All that was said of what draws, of photos left out and of pictures that show nothing.
    pub(super) fn notes(&self) -> Vec<String> {
        let engine = self.engine.as_ref().map(Engine::notes).unwrap_or_default();
        let said = self.notes.iter().chain(engine).cloned();
        let left_out = self.left_out.iter().map(left_out_text);
        said.chain(left_out).chain(self.note_of_empty()).collect()
    }

    /// What to say of pictures that show nothing, if there are any.
    pub(super) fn note_of_empty(&self) -> Option<String> {
        let photos = self.lumigraph.photos.len();
        self.costs.note_of_empty(photos, self.why_empty)
    }

    /// How visible seams are in a view: see [`render::seams`].
    pub(super) fn seams(
        &mut self,
        desired: &View,
        moment: Option<&Moment>,
    ) -> anyhow::Result<Option<f64>> {
        loop {
            let frame = frame(&self.lumigraph, desired, self.options, moment, self.skips);
            match render::seams(&frame) {
                Ok(seams) => return Ok(seams),
                Err(error) => self.leave_out(&error)?,
            }
        }
    }

    /// Draws a view and takes the time; twice where the first drawing had photos to decode.
    pub(super) fn draw_timed(
        &mut self,
        desired: &View,
        moment: Option<&Moment>,
    ) -> anyhow::Result<Timed> {
        let decoded_before = self.lumigraph.photos.decoded();
        let mut start = ProcessTime::now();
        let mut picture = self.draw(desired, moment)?;
        if self.lumigraph.photos.decoded() != decoded_before {
            start = ProcessTime::now();
            picture = self.draw(desired, moment)?;
        }
        let cpu = start.elapsed();
        if let Some(engine) = &self.engine {
            let (lumigraph, options) = (&self.lumigraph, self.options);
            let again = || frame(lumigraph, desired, options, moment, self.skips);
            self.costs.note_alone(engine, &picture, again);
        }
        Ok(Timed { picture, cpu })
    }

    /// A photo of the scene to compare with; `None`, with a warning, for one that is corrupt,
    /// unless `--strict`.
    pub(super) fn truth(&mut self, name: &str) -> anyhow::Result<Option<Truth>> {
        match self.scene.truth(name, &self.without)? {
            Ok(truth) => Ok(Some(truth)),
            Err(error) if self.strict => Err(error.into()),
            Err(error) => {
                self.say_left_out(name, &error.to_string());
                Ok(None)
            }
        }
    }

    /// Leaves out photos that were found corrupt before, by name with what is wrong with each. Whether there is
    /// one among them that was not left out yet: what was drawn so far is to be drawn again then.
    pub(super) fn leave_out_known(
        &mut self,
        damaged: &BTreeMap<String, String>,
    ) -> anyhow::Result<bool> {
        let sources = self.lumigraph.sources.iter().enumerate();
        let known = sources.filter_map(|(i, source)| Some((i, damaged.get(&source.name)?.clone())));
        let known: BTreeMap<usize, String> = known.collect();
        if known.is_empty() {
            return Ok(false);
        }
        self.leave_out_all(&known)?;
        Ok(true)
    }

    /// Leaves out a photo that was asked for in vain, and all others that were for the same picture: that drawn
    /// without one of them asks for the rest again, and each time all that is drawn from is made anew.
    fn leave_out(&mut self, error: &PhotoError) -> anyhow::Result<()> {
        let mut damaged = BTreeMap::from([(error.source_idx, error.message.clone())]);
        if !self.strict {
            for missed in self.lumigraph.photos.take_missed() {
                damaged.entry(missed.source_idx).or_insert(missed.message);
            }
        }
        self.leave_out_all(&damaged)
    }

    /// Leaves out photos, by source view with what is wrong with each, as long as enough others remain. What has
    /// been drawn is to be drawn again without them, so what that has cost is forgotten.
    fn leave_out_all(&mut self, damaged: &BTreeMap<usize, String>) -> anyhow::Result<()> {
        for (source_idx, message) in damaged {
            let name = self.lumigraph.sources[*source_idx].name.clone();
            if self.strict {
                bail!("photo {name}: {message}; without --strict it would be left out");
            }
            self.say_left_out(&name, message);
            self.without.insert(name);
        }
        self.scene.check_enough(&self.without, &self.left_out)?;
        let count = self.lumigraph.sources.len();
        let uploaded = (0..count).filter(|i| self.was_uploaded(*i));
        let uploaded = uploaded.map(|i| self.lumigraph.sources[i].name.clone());
        self.uploaded = uploaded.collect();
        let proxy = self.proxy.proxy.clone();
        let fewer = self.scene.lumigraph(&self.without, proxy)?;
        let before = std::mem::replace(&mut self.lumigraph, fewer);
        // The report is on the whole run.
        let photos = &mut self.lumigraph.photos;
        photos.go_on_from(before.photos, &damaged.keys().copied().collect());
        self.forget();
        Ok(())
    }

    /// Forgets what pictures have cost, as they are drawn again.
    pub(super) fn forget(&mut self) {
        self.in_window = InWindow::default();
        self.ledger = Ledger::new();
        self.costs = Costs::default();
    }

    fn say_left_out(&mut self, name: &str, reason: &str) {
        let known = self.left_out.insert(name.to_owned(), reason.to_owned());
        if known.is_none() {
            say!("warning: {}", left_out_text((name, reason)));
        }
    }
}

/// Says what the engine has to say, once.
fn say_notes(engine: &Engine, said: &mut usize) {
    let new = engine.notes().iter().skip(*said);
    new.for_each(|note| say!("note: {note}"));
    *said = engine.notes().len();
}

/// A view of the lumigraph, at a moment where time plays a part.
fn frame<'a>(
    lumigraph: &'a Lumigraph,
    desired: &View,
    options: FieldOptions,
    moment: Option<&Moment>,
    skips: Skips,
) -> Frame<'a> {
    let part = Part {
        moment: moment.copied(),
        ..Part::default()
    };
    Frame::with(lumigraph, desired.clone(), options, &part).skipping(skips)
}

/// A scene's sparse points that do not rest on the photos left out, in the world.
pub(super) fn points(scene: &Scene, without: &BTreeSet<String>) -> Vec<DVec3> {
    let rest = scene.reconstruction.without_images(without);
    rest.points.values().map(|p| p.position).collect()
}

/// A progress bar on stderr, where that is a terminal.
pub(super) fn progress(total: usize, doing: impl Into<Cow<'static, str>>) -> ProgressBar {
    let bar = ProgressBar::new(total as u64);
    if let Ok(style) = ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len} {eta}") {
        bar.set_style(style);
    }
    bar.set_message(doing);
    bar
}

/// A sign of life on stderr, where that is a terminal, while something takes its time.
pub(super) fn spinner(doing: &'static str) -> ProgressBar {
    let spinner = ProgressBar::new_spinner();
    spinner.set_message(doing);
    // On a thread of its own, which is for nothing where nobody sees it.
    if std::io::stderr().is_terminal() {
        spinner.enable_steady_tick(Duration::from_millis(200));
    }
    spinner
}
