//! Photos without a calibration, and videos: what `import` has other programs do.

use super::options::WARNINGS_SHOWN;
use super::output::say;
use super::session::{progress, spinner};
use calibrate::colmap::run::{self, Event, Matching, Options, Outcome, Step};
use capture::unread_photos;
use capture::video::{self, Curve, Damage, FrameCount, FrameShape, VideoFrame, VideoProgress};
use clap::ValueEnum;
use indicatif::ProgressBar;
use lumigraph::scene::{Aside, Scene};
use std::path::{Path, PathBuf};

/// How photos without a calibration are had.
#[derive(clap::Args)]
pub(super) struct UncalibratedArgs {
    /// Without a calibration: which pairs of photos COLMAP matches [default: neighbours of 30
    /// and more frames of a video or numbered photos, else all]
    #[arg(long, value_enum)]
    matching: Option<MatchingName>,
    /// Of a video: take the sharpest frames of so many equal stretches [default: 3 a second,
    /// at least 20 and at most 150]
    #[arg(long, value_name = "N", conflicts_with = "fps", value_parser = frame_count)]
    frames: Option<usize>,
    /// Of a video: take so many frames a second
    #[arg(long, value_parser = positive)]
    fps: Option<f64>,
}

#[derive(Clone, Copy, ValueEnum)]
enum MatchingName {
    /// Each photo with those near it in the order of names
    Sequential,
    /// All pairs
    Exhaustive,
}

/// How many frames: of one alone no calibration is had.
fn frame_count(text: &str) -> Result<usize, String> {
    let count = text.parse::<usize>().ok().filter(|&count| count > 1);
    count.ok_or_else(|| "expected a whole number above one, as in 60".to_owned())
}

fn positive(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(value) if value > 0.0 && f64::is_finite(value) => Ok(value),
        _ => Err("expected a number greater than zero".to_owned()),
    }
}

impl UncalibratedArgs {
    pub(super) fn asks_for_frames(&self) -> bool {
        self.frames.is_some() || self.fps.is_some()
    }

    pub(super) fn asks_for_matching(&self) -> bool {
        self.matching.is_some()
    }

    fn count(&self) -> FrameCount {
        match (self.frames, self.fps) {
            (Some(frames), _) => FrameCount::Frames(frames),
            (None, Some(fps)) => FrameCount::PerSecond(fps),
            (None, None) => FrameCount::Auto,
        }
    }

    /// Puts a scene aside whose frames would be replaced, or takes over one that a killed import has put there.
    pub(super) fn put_aside(
        &self,
        video: &Path,
        shape: FrameShape,
        output: &Path,
    ) -> anyhow::Result<Option<Aside>> {
        if let Some(left) = Aside::left(output) {
            return Ok(Some(left));
        }
        let frames = Scene::frames_folder(output);
        match video::would_stay(video, self.count(), shape, &frames)? {
            true => Ok(None),
            false => Ok(Aside::put(output)?),
        }
    }

    /// Writes a video's sharpest frames into a folder.
    pub(super) fn extract(
        &self,
        video: &Path,
        shape: FrameShape,
        folder: &Path,
    ) -> anyhow::Result<Vec<VideoFrame>> {
        let count = self.count();
        let bar = spinner("scoring frames");
        let mut report = |at: VideoProgress| match at {
            VideoProgress::Scored { frames, time_s } => {
                bar.set_message(format!("scoring frames: {frames}, up to {time_s:.1} s"));
            }
            VideoProgress::Damaged(damage) => bar.suspend(|| {
                say!("note: {}: {}", video.display(), damaged(&damage));
            }),
            VideoProgress::Stretched { from, to } => bar.suspend(|| {
                say!("note: {}: {}", video.display(), stretched(from, to));
            }),
            VideoProgress::Deinterlaced => bar.suspend(|| {
                say!("note: {}: {DEINTERLACED}", video.display());
            }),
            VideoProgress::HighDynamicRange(curve) => bar.suspend(|| {
                say!("note: {}: {}", video.display(), high_dynamic_range(curve));
            }),
            VideoProgress::Writing { frames } => {
                bar.set_message(format!("writing {frames} frames"));
            }
            VideoProgress::Done { frames } => bar.suspend(|| {
                say!("note: the {frames} frames were taken by an earlier run");
            }),
        };
        let ffmpeg = video::ffmpeg();
        let frames = video::extract(&ffmpeg, video, count, shape, folder, &mut report);
        bar.finish_and_clear();
        let frames = frames?;
        let (count, folder) = (frames.len(), folder.display());
        say!(
            "note: {count} frames of {} are in {folder}",
            video.display()
        );
        Ok(frames)
    }

    /// Has COLMAP calibrate a capture's photos, says what it could not do, and returns the
    /// folder of the model.
    pub(super) fn calibrate(
        &self,
        capture: &Path,
        is_video: bool,
        work: &Path,
    ) -> anyhow::Result<PathBuf> {
        let photos = Scene::photos_of(capture)?;
        let mut options = Options::for_photos(&photos, is_video)?;
        match self.matching {
            Some(MatchingName::Sequential) => options.matching = Matching::Sequential,
            Some(MatchingName::Exhaustive) => options.matching = Matching::Exhaustive,
            None => {}
        }
        say!(
            "note: no calibration comes with the {} photos; COLMAP works it out in {}",
            photos.photos.len(),
            work.display()
        );
        let unread = unread_photos(&photos.root);
        if let Some(first) = unread.first() {
            say!(
                "note: {} photos of other kinds than JPEG and PNG are passed over ({first}, for one): convert them, if they \
                 are to be used",
                unread.len()
            );
        }
        let mut bars = Bars::default();
        let made = run::run(&run::colmap(), &photos, work, &options, &mut |event| {
            bars.show(event);
        });
        bars.end();
        let made = made?;
        report(&made, photos.photos.len(), options.matching);
        Ok(made.model)
    }
}

/// What is said of a video whose pixels are not square.
fn stretched(from: (u32, u32), to: (u32, u32)) -> String {
    let [from, to] = [from, to].map(|(width, height)| format!("{width} × {height}"));
    format!(
        "its pixels are not square, so its frames of {from} are drawn out to {to}, as players show them"
    )
}

/// What is said of an interlaced video.
const DEINTERLACED: &str =
    "its frames are interlaced, every other line at another moment, and are deinterlaced";

/// What is said of a video of a high dynamic range.
fn high_dynamic_range(curve: Curve) -> String {
    format!(
        "its colours are HDR ({curve}), and frames are brought to the range of photos: what is brighter than white paper \
         comes close to white"
    )
}

/// What is said of a video that could not all be decoded.
fn damaged(damage: &Damage) -> String {
    let passed_over = match damage.frames {
        0 => String::new(),
        1 => ", and one damaged frame is passed over".to_owned(),
        frames => format!(", and {frames} damaged frames are passed over"),
    };
    format!(
        "{damage}; some of it may be missing{passed_over}: copy the file again if it should be whole"
    )
}

/// A progress bar for the step at hand.
#[derive(Default)]
struct Bars {
    current: Option<(Step, ProgressBar)>,
}

impl Bars {
    fn show(&mut self, event: Event) {
        match event {
            Event::StartingOver => {
                say!("note: photos or options changed since COLMAP last ran: it starts over");
            }
            Event::Finished(step) => say!("note: {step} was finished by an earlier run"),
            Event::PhotosAreClose => {
                self.end();
                say!(
                    "note: COLMAP places few photos or none from two that see the scene at the angle \
                     it asks for; it tries closer ones to begin with"
                );
            }
            Event::Progress { step, done, total } => {
                if self.current.as_ref().is_none_or(|(of, _)| *of != step) {
                    self.end();
                    let doing = format!("COLMAP: {step}");
                    self.current = Some((step, progress(total as usize, doing)));
                }
                if let Some((_, bar)) = &self.current {
                    bar.set_length(total);
                    bar.set_position(done);
                }
            }
        }
    }

    fn end(&mut self) {
        if let Some((_, bar)) = self.current.take() {
            bar.finish_and_clear();
        }
    }
}

fn report(made: &Outcome, photos: usize, matching: Matching) {
    for photo in made.unplaced.iter().take(WARNINGS_SHOWN) {
        say!("warning: photo {} is not placed: {}", photo.name, photo.why);
    }
    if let Some(more) = made.unplaced.len().checked_sub(WARNINGS_SHOWN + 1) {
        say!("warning: and {} more photos are not placed", more + 1);
    }
    if !made.unplaced.is_empty() && matching == Matching::Sequential {
        say!("note: --matching exhaustive takes longer and may place more photos");
    }
    say!(
        "note: COLMAP placed {} of {photos} photos; `info` gives the reprojection error",
        made.reconstruction.images.len()
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_a_damaged_video_it_is_said_what_is_left_out_and_what_to_do() {
        let damage = |errors, frames| Damage {
            errors,
            first: "error while decoding MB 0 8".to_owned(),
            frames,
        };
        assert_eq!(
            damaged(&damage(39, 22)),
            "ffmpeg reports 39 errors, the first: error while decoding MB 0 8; some of it may be \
             missing, and 22 damaged frames are passed over: copy the file again if it should be whole"
        );
        assert_eq!(
            damaged(&damage(1, 0)),
            "ffmpeg reports an error: error while decoding MB 0 8; some of it may be missing: copy \
             the file again if it should be whole"
        );
    }
}
