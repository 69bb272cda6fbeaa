//! What a run has cost.

use super::session::Session;
use super::time::InWindow;
pub(super) use super::took::megabytes;
use super::took::{Memory, Start, Took};
use calibrate::Distortion;
use image::RgbaImage;
use render::gpu::Gpu;
use render::{Bounded, Engine, Frame, Ready, Softened, SourceView, photo_bytes};
use serde::Serialize;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::time::Duration;

/// The run report, printed at the end and part of `--json`.
#[derive(Serialize)]
pub(super) struct Report {
    device: String,
    photos_decoded: usize,
    photos_total: usize,
    photos_bytes: usize,
    cpu_memory: Memory,
    /// Where a graphics processor draws.
    #[serde(skip_serializing_if = "Option::is_none")]
    gpu_memory: Option<Memory>,
    /// What draws in place of what was asked for, what the graphics device did not do, and what became of it; which
    /// photos were found damaged; and what is odd about the frames.
    notes: Vec<String>,
    /// Those that show nothing at all.
    frames_empty: usize,
    /// As many as say so themselves, whatever device was asked for.
    frames_by_cpu: usize,
    /// Those that a graphics device was to draw.
    #[serde(skip)]
    frames_instead: u64,
    /// Where frames were drawn one after the other: what each stage has taken.
    #[serde(skip_serializing_if = "Option::is_none")]
    stages: Option<Value>,
    #[serde(skip)]
    stages_text: String,
    /// Decoding in any of the stages, summed over the threads that did it.
    decode_seconds: f64,
    #[serde(flatten)]
    device_time: DeviceTime,
    #[serde(flatten)]
    photos_used: PhotosUsed,
    /// With `--max-error`.
    #[serde(skip_serializing_if = "Option::is_none")]
    max_error: Option<MaxError>,
    skipped: Skipped,
    #[serde(flatten)]
    took: Took,
    /// Where time plays a part.
    #[serde(skip_serializing_if = "Option::is_none")]
    time: Option<Value>,
    #[serde(skip)]
    in_window: InWindow,
}

impl Report {
    pub(super) fn new(session: &Session, start: &Start) -> Self {
        let photos = &session.lumigraph().photos;
        let engine = session.engine();
        let costs = &session.costs;
        let stages = session.ledger.total();
        let drawn = !costs.frames.is_empty();
        Self {
            notes: session.notes(),
            frames_empty: costs.empty() + costs.alone_empty,
            frames_by_cpu: costs.by_cpu() + costs.alone_by_cpu,
            frames_instead: engine.map_or(0, Engine::frames_by_cpu),
            stages: drawn.then(|| stages.json()),
            stages_text: stages.text(),
            decode_seconds: photos.decode_time().as_secs_f64(),
            device_time: DeviceTime::of(session),
            photos_used: PhotosUsed::of(costs),
            max_error: MaxError::of(session),
            skipped: Skipped::of(session),
            device: session.device(),
            photos_decoded: photos.decoded(),
            photos_total: photos.len(),
            photos_bytes: photos.bytes(),
            cpu_memory: Memory(photos.residency()),
            gpu_memory: session.gpu_residency().map(Memory),
            took: start.took(),
            time: session.time_json(),
            in_window: session.in_window,
        }
    }

    /// A few lines for people.
    pub(super) fn text(&self) -> String {
        let mut memory = self.cpu_memory.text();
        if let Some(gpu) = self.gpu_memory {
            memory += &format!("; on the device {}", gpu.text());
        }
        let mut text = format!(
            "{} of {} photos decoded ({memory}), {}{}",
            self.photos_decoded,
            self.photos_total,
            self.took.text(&self.device),
            self.in_window.text(),
        );
        if self.stages.is_some() {
            text += &format!(
                "\nseconds (CPU) by stage: {}; decoding {:.2}; {}",
                self.stages_text,
                self.decode_seconds,
                self.device_time.text()
            );
            text += &self.photos_used.text();
            if let Some(max_error) = &self.max_error {
                text += &max_error.text();
            }
            text += &format!("\nskipped: {}", self.skipped.text());
        }
        if self.frames_instead > 0 {
            text += &format!(
                "\n{} frames were drawn by the CPU in place of the graphics device",
                self.frames_instead
            );
        }
        text
    }
}

/// What the frames that were drawn one after the other have cost, besides time.
#[derive(Default)]
pub(super) struct Costs {
    /// By place in the path, in whatever order they are drawn.
    frames: BTreeMap<usize, FrameCost>,
    /// Views that were drawn each by itself, of photos held out; how many of them the CPU drew, and how many
    /// show nothing.
    alone: usize,
    alone_by_cpu: usize,
    alone_empty: usize,
    /// And how many of the latter see the proxy, where no photo shows it.
    alone_unshown: usize,
    /// By source view, whether any frame scored it.
    ever_scored: Vec<bool>,
}

struct FrameCost {
    /// Cells across; `None` for the exact field.
    grid: Option<u32>,
    /// Where it was measured.
    error: Option<f64>,
    photos_used: Option<usize>,
    parts: usize,
    device: Option<Duration>,
    cameras_scored: usize,
    cameras: usize,
    /// `None` where the graphics processor scores all at every pixel.
    scorings: Option<u64>,
    scorings_omitted: u64,
    by_cpu: bool,
    softened: Softened,
    /// Drawn of several samples.
    edge_pixels: usize,
    /// No pixel is covered, not even in part.
    is_empty: bool,
    /// And yet the proxy is seen: no photo shows what is seen of it.
    is_unshown: bool,
}

impl Costs {
    /// Notes a frame that was just drawn.
    pub(super) fn note(
        &mut self,
        frame_idx: usize,
        frame: &Frame<'_>,
        chosen: &Bounded,
        engine: &Engine,
        ready: &Ready,
        picture: &RgbaImage,
    ) {
        let scored = frame.scored();
        let taking_part = frame.taking_part().count();
        let by_cpu = engine.last_by_cpu();
        let of_all = chosen.cells_across.is_none() && !by_cpu;
        let ever: Vec<bool> = (0..frame.sources.len())
            .map(|i| scored.ever[i] || (of_all && frame.sources[i].time_penalty < f64::INFINITY))
            .collect();
        if self.ever_scored.len() != ever.len() {
            self.ever_scored = vec![false; ever.len()];
        }
        for (of_any, of_this) in self.ever_scored.iter_mut().zip(&ever) {
            *of_any |= of_this;
        }
        let gpu = engine.gpu().filter(|_| !by_cpu);
        let photos_used = match gpu {
            Some(_) => ready.photos_used(),
            None => Some(frame.lumigraph.photos.last_sampled()),
        };
        let is_empty = is_empty(picture);
        let cost = FrameCost {
            grid: chosen.cells_across,
            error: chosen.error,
            photos_used,
            parts: if by_cpu { 1 } else { ready.parts() },
            device: gpu.and_then(Gpu::device_time),
            cameras_scored: ever.iter().filter(|scored| **scored).count(),
            cameras: ever.len(),
            scorings: (!of_all).then_some(scored.scorings),
            scorings_omitted: if of_all {
                0
            } else {
                (scored.questions * taking_part as u64).saturating_sub(scored.scorings)
            },
            // The reference is no engine that stands in, but runs there, too.
            by_cpu: gpu.is_none(),
            softened: Softened::default(),
            edge_pixels: 0,
            is_empty,
            is_unshown: is_empty && frame.sees_proxy(),
        };
        self.frames.insert(frame_idx, cost);
    }

    /// Notes how many pixels of that frame were drawn softly.
    pub(super) fn note_softened(&mut self, frame_idx: usize, softened: Softened) {
        if let Some(cost) = self.frames.get_mut(&frame_idx) {
            cost.softened = softened;
        }
    }

    /// Notes how many pixels of that frame were drawn anew, of several samples.
    pub(super) fn note_edges(&mut self, frame_idx: usize, edge_pixels: usize) {
        if let Some(cost) = self.frames.get_mut(&frame_idx) {
            cost.edge_pixels = edge_pixels;
        }
    }

    /// Notes a view that was drawn by itself, however often; `frame` makes it ready again.
    pub(super) fn note_alone<'a>(
        &mut self,
        engine: &Engine,
        picture: &RgbaImage,
        frame: impl FnOnce() -> Frame<'a>,
    ) {
        let by_cpu = engine.gpu().is_none() || engine.last_by_cpu();
        let is_empty = is_empty(picture);
        self.alone += 1;
        self.alone_by_cpu += usize::from(by_cpu);
        self.alone_empty += usize::from(is_empty);
        self.alone_unshown += usize::from(is_empty && frame().sees_proxy());
    }

    /// How many frames the CPU drew.
    fn by_cpu(&self) -> usize {
        self.frames.values().filter(|cost| cost.by_cpu).count()
    }

    /// How many frames show nothing at all.
    fn empty(&self) -> usize {
        self.frames.values().filter(|cost| cost.is_empty).count()
    }

    /// What to say of pictures that show nothing at all, if there are any, where there are so many photos;
    /// `why_empty` is why frames of a path may: where they see no proxy, and where no photo shows what they see of it.
    pub(super) fn note_of_empty(&self, photos: usize, why_empty: [&str; 2]) -> Option<String> {
        let (of_path, alone) = (self.empty(), self.alone_empty);
        let of_all =
            |[empty, unshown]: [usize; 2], all: usize, what: &str, otherwise: [&str; 2]| {
                let why = match photos {
                    0 | 1 => "one photo alone does not tell where things are",
                    // Where some see no proxy that comes first.
                    _ => otherwise[usize::from(unshown == empty)],
                };
                note_of_empty(empty, all, what, why)
            };
        let unseen = "the proxy does not reach where those photos look; hold out fewer, or try another \
                      --proxy";
        let unshown = self.frames.values().filter(|cost| cost.is_unshown).count();
        let of_path = [of_path, unshown];
        let alone = [alone, self.alone_unshown];
        of_all(of_path, self.frames.len(), "frames", why_empty)
            .or_else(|| of_all(alone, self.alone, "pictures", [unseen, UNSHOWN]))
    }

    /// A frame's, for `--json`.
    pub(super) fn json_of(&self, frame_idx: usize) -> Value {
        let Some(cost) = self.frames.get(&frame_idx) else {
            return json!({});
        };
        json!({
            "photos_used": cost.photos_used,
            "parts": cost.parts,
            "drawn_by_cpu": cost.by_cpu,
            "guessed_pixels": cost.softened.guessed,
            "contradicted_pixels": cost.softened.contradicted,
            "edge_pixels": cost.edge_pixels,
            "grid": cost.grid,
            "error_at_most": cost.error,
            "device_seconds": cost.device.map(|time| time.as_secs_f64()),
            "cameras_scored": cost.cameras_scored,
            "cameras_never_scored": cost.cameras - cost.cameras_scored,
            "scorings": cost.scorings,
            "scorings_omitted": cost.scorings_omitted,
        })
    }
}

/// Why pictures may show nothing though they see the proxy, for people.
pub(super) const UNSHOWN: &str = "no photo shows what they see of the proxy: it lies outside all photos, or masks, mattes \
                                  or the photos' alpha hide it";

/// What to say of pictures, called so, of which some show nothing at all; nothing if there are none.
pub(super) fn note_of_empty(empty: usize, all: usize, what: &str, why: &str) -> Option<String> {
    (empty > 0).then(|| format!("{empty} of {all} {what} show nothing: {why}"))
}

/// Whether no pixel is covered, not even in part.
pub(super) fn is_empty(picture: &RgbaImage) -> bool {
    // Of most pictures the first pixels tell.
    picture.pixels().all(|pixel| pixel.0[3] == 0)
}

/// How long the graphics device drew.
#[derive(Serialize)]
struct DeviceTime {
    /// `None` where it does not tell, or none draws.
    device_seconds: Option<f64>,
    #[serde(skip)]
    why_not: &'static str,
}

impl DeviceTime {
    fn of(session: &Session) -> Self {
        let frames = &session.costs.frames;
        let gpu = session.engine().and_then(Engine::gpu);
        let times = frames.values().filter_map(|frame| frame.device);
        let any = times.clone().next().is_some();
        Self {
            device_seconds: any.then(|| times.map(|t| t.as_secs_f64()).sum()),
            why_not: match gpu {
                None => "no graphics device draws",
                Some(gpu) if gpu.tells_time() => "the device told no time",
                Some(_) => "the device has no timestamps",
            },
        }
    }

    fn text(&self) -> String {
        self.device_seconds.map_or_else(
            || self.why_not.to_owned(),
            |seconds| format!("on the device {seconds:.2}"),
        )
    }
}

/// Photos that a frame samples.
#[derive(Serialize)]
struct PhotosUsed {
    /// The least and the most; `None` where no frame told.
    photos_used_per_frame: Option<[usize; 2]>,
}

impl PhotosUsed {
    fn of(costs: &Costs) -> Self {
        let used = costs.frames.values().filter_map(|frame| frame.photos_used);
        let (least, most) = (used.clone().min(), used.max());
        Self {
            photos_used_per_frame: least.zip(most).map(|(least, most)| [least, most]),
        }
    }

    fn text(&self) -> String {
        match self.photos_used_per_frame {
            None => String::new(),
            Some([least, most]) if least == most => format!("; {most} photos a frame"),
            Some([least, most]) => format!("; {least} to {most} photos a frame"),
        }
    }
}

/// What `--max-error` made of the frames.
#[derive(Serialize)]
struct MaxError {
    /// Steps of 255; `None` for no bound.
    bound: Option<f64>,
    /// How many frames took a grid of so many cells across.
    frames_by_grid: BTreeMap<u32, usize>,
    frames_exact: usize,
    /// The most that any frame was found to be off; `None` where none was measured.
    error_at_most: Option<f64>,
}

impl MaxError {
    fn of(session: &Session) -> Option<Self> {
        let bound = session.max_error?;
        let frames = &session.costs.frames;
        let mut frames_by_grid = BTreeMap::new();
        for grid in frames.values().filter_map(|frame| frame.grid) {
            *frames_by_grid.entry(grid).or_default() += 1;
        }
        Some(Self {
            bound: bound.is_finite().then_some(bound),
            frames_by_grid,
            frames_exact: frames.values().filter(|frame| frame.grid.is_none()).count(),
            error_at_most: frames.values().filter_map(|f| f.error).reduce(f64::max),
        })
    }

    /// A line of its own.
    fn text(&self) -> String {
        let grids = self.frames_by_grid.iter();
        let mut frames: Vec<String> = grids
            .map(|(grid, count)| format!("{count} frames at grid {grid}"))
            .collect();
        if self.frames_exact > 0 {
            frames.push(format!("{} exact", self.frames_exact));
        }
        let error = self.error_at_most.map_or_else(
            || "not measured".to_owned(),
            |error| format!("at most {error:.2} steps of 255"),
        );
        format!("\nerror {error}: {}", frames.join(", "))
    }
}

/// What was not done because the frames do not need it. Counts, the same in every run.
#[derive(Serialize)]
struct Skipped {
    photos_never_decoded: usize,
    /// In memory, with mip levels.
    bytes_never_decoded: u64,
    /// `None` where no graphics device draws.
    photos_never_uploaded: Option<usize>,
    bytes_never_uploaded: Option<u64>,
    /// By no frame's field, as far as frames were drawn one after the other.
    cameras_never_scored: Option<usize>,
    /// Of cameras that take part in a frame, at its vertices, triangles and blocks.
    scorings_omitted: u64,
    #[serde(skip)]
    scorings: u64,
    /// Photos whose lens needs no more than a division, unless each is seen through as if it bent: which graphics
    /// devices never do.
    lens_maths_omitted_photos: usize,
    /// Photos that nothing asks whether they see a point, as the proxy hides nothing of itself.
    visibility_tests_omitted_photos: usize,
    /// Photos without an ignore mask.
    mask_tests_omitted_photos: usize,
}

impl Skipped {
    fn of(session: &Session) -> Self {
        let lumigraph = session.lumigraph();
        let photos = &lumigraph.photos;
        let count = photos.len();
        let never = |was: &dyn Fn(usize) -> bool| {
            let never = (0..count).filter(|&i| !was(i));
            never.fold((0, 0), |(photos, bytes), i| {
                let view = &lumigraph.sources[i].view;
                (
                    photos + 1,
                    bytes + photo_bytes([view.width, view.height], 0),
                )
            })
        };
        let decoded = never(&|i| photos.was_decoded(i));
        let gpu = session.engine().and_then(Engine::gpu);
        let uploaded = gpu.map(|_| never(&|i| session.was_uploaded(i)));
        let costs = &session.costs;
        let unscored = costs.ever_scored.iter().filter(|scored| !**scored);
        let pinhole = |source: &&SourceView| source.view.lens.distortion() == Distortion::None;
        Self {
            photos_never_decoded: decoded.0,
            bytes_never_decoded: decoded.1,
            photos_never_uploaded: uploaded.map(|never| never.0),
            bytes_never_uploaded: uploaded.map(|never| never.1),
            cameras_never_scored: (!costs.frames.is_empty()).then(|| unscored.count()),
            scorings_omitted: costs.frames.values().map(|f| f.scorings_omitted).sum(),
            scorings: costs.frames.values().filter_map(|f| f.scorings).sum(),
            lens_maths_omitted_photos: match session.skips().lenses || gpu.is_some() {
                true => lumigraph.sources.iter().filter(pinhole).count(),
                false => 0,
            },
            visibility_tests_omitted_photos: match lumigraph.visibility {
                Some(_) => 0,
                None => count,
            },
            mask_tests_omitted_photos: (0..count).filter(|&i| !photos.is_masked(i)).count(),
        }
    }

    fn text(&self) -> String {
        let mut text = format!(
            "{} photos ({}) never decoded",
            self.photos_never_decoded,
            megabytes(self.bytes_never_decoded)
        );
        if let (Some(photos), Some(bytes)) = (self.photos_never_uploaded, self.bytes_never_uploaded)
        {
            text += &format!(", {photos} ({}) never uploaded", megabytes(bytes));
        }
        if let Some(cameras) = self.cameras_never_scored {
            text += &format!(", {cameras} cameras never scored");
        }
        if self.scorings + self.scorings_omitted > 0 {
            let (omitted, all) = (self.scorings_omitted, self.scorings + self.scorings_omitted);
            text += &format!(", {omitted} of {all} scorings");
        }
        for (photos, what) in [
            (self.lens_maths_omitted_photos, "lens maths"),
            (self.visibility_tests_omitted_photos, "visibility tests"),
            (self.mask_tests_omitted_photos, "mask tests"),
        ] {
            if photos > 0 {
                text += &format!(", {what} of {photos} photos");
            }
        }
        text
    }
}
