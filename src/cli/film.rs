//! Films of frames: which of them are made now, what is behind them, and the video.

mod kept;

use super::Usage;
use super::options::positive;
use super::output::{say, temporary_folder};
use super::stamp::in_unicode;
use super::targets::{check_file, check_film, check_inputs};
use anyhow::Context;
use calibrate::View;
use capture::video::{FILMS, is_film};
use image::{Rgba, RgbaImage};
use render::score::on_black;
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Which frames: so many of a derived path, or a part of a path.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct FrameChoice {
    /// Of a derived path, where it is said.
    count: Option<u32>,
    /// Those that are drawn; `None` for all.
    range: Option<Range<usize>>,
}

const MOST: u32 = 100_000;

/// A number of frames.
fn count(text: &str) -> Option<u32> {
    text.parse().ok().filter(|n| (1..=MOST).contains(n))
}

/// `60`: how many frames a derived path has of which one is looked at.
pub(super) fn frame_count(text: &str) -> Result<u32, String> {
    count(text).ok_or_else(|| {
        format!("expected a number of frames up to {MOST}, as in 60; --view names one of them")
    })
}

/// `60`, `120..240` or `120..240/300`.
pub(super) fn frame_choice(text: &str) -> Result<FrameChoice, String> {
    let parse = || {
        let Some((first, rest)) = text.split_once("..") else {
            let count = Some(count(text)?);
            return Some(FrameChoice { count, range: None });
        };
        let (last, all) = rest
            .split_once('/')
            .map_or((rest, None), |(l, n)| (l, Some(n)));
        let count = match all {
            Some(all) => Some(count(all)?),
            None => None,
        };
        let range: Range<usize> = first.parse().ok()?..last.parse().ok()?;
        (!range.is_empty()).then_some(FrameChoice {
            count,
            range: Some(range),
        })
    };
    parse().ok_or_else(|| {
        format!(
            "expected a number of frames up to {MOST}, as in 60; frames of a path from the first \
             (counted from 0) to before the last, as in 120..240; or 120..240/300 of a derived path"
        )
    })
}

impl FrameChoice {
    /// How many frames a derived path has.
    pub(super) fn count(&self, otherwise: u32) -> u32 {
        self.count.unwrap_or(otherwise)
    }

    /// Fails where so many frames are asked for of a path that has its own.
    pub(super) fn check(&self, is_derived: bool) -> anyhow::Result<()> {
        let text = match (self.count.filter(|_| !is_derived), &self.range) {
            (None, _) => return Ok(()),
            (Some(count), None) => format!(
                "--frames {count}: the path has its own frames; for the first {count} of them it is \
                 --frames 0..{count}"
            ),
            (Some(count), Some(Range { start, end })) => format!(
                "--frames {start}..{end}/{count}: the path has its own frames; for some of them it is \
                 --frames {start}..{end}"
            ),
        };
        Err(Usage(text).into())
    }

    /// Whether only a part of a path is drawn.
    pub(super) fn is_part(&self) -> bool {
        self.range.is_some()
    }

    /// Fails where frames are asked for that a path of so many does not have.
    pub(super) fn check_end(&self, count: usize) -> anyhow::Result<()> {
        let Some(range) = self.range.as_ref().filter(|range| range.end > count) else {
            return Ok(());
        };
        let all = self
            .count
            .map_or(String::new(), |count| format!("/{count}"));
        let text = format!(
            "--frames {}..{}{all}: the path has {count} frames",
            range.start, range.end
        );
        Err(Usage(text).into())
    }

    /// Keeps the frames that are to be drawn.
    pub(super) fn of<T>(&self, mut frames: Vec<T>) -> anyhow::Result<Vec<T>> {
        self.check_end(frames.len())?;
        let Some(range) = &self.range else {
            return Ok(frames);
        };
        frames.truncate(range.end);
        frames.drain(..range.start);
        Ok(frames)
    }
}

/// A film of the frames.
#[derive(clap::Args)]
pub(super) struct FilmArgs {
    /// Also make a film of the frames, with ffmpeg: .mp4, .webm, .mkv, …. Where frames' width or height is odd
    /// the film has one more of their last column or row
    #[arg(long, value_name = "FILE")]
    video: Option<PathBuf>,
    /// Its frames a second [default: the path's own, else 30]; which moments of the scene frames show stays as it is
    #[arg(long, value_name = "N", value_parser = positive, requires = "video")]
    fps: Option<f64>,
    /// What is behind where nothing is shown: #RRGGBB, or transparent; in a film transparent
    /// is black
    #[arg(long, value_name = "COLOR", default_value = "transparent", value_parser = background)]
    background: Background,
    /// Go on where an interrupted run with --resume stopped: frames that are there stay. The command
    /// line, the photos and all other files that frames are made of must be those of before
    #[arg(long)]
    resume: bool,
}

/// What is behind the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Background(pub(super) Option<[u8; 3]>);

pub(super) fn background(text: &str) -> Result<Background, String> {
    if text == "transparent" {
        return Ok(Background(None));
    }
    let parse = || {
        let digits = text
            .strip_prefix('#')
            .filter(|d| d.len() == 6 && d.is_ascii())?;
        let channel = |i: usize| u8::from_str_radix(&digits[2 * i..2 * i + 2], 16).ok();
        Some([channel(0)?, channel(1)?, channel(2)?])
    };
    let color = parse().ok_or("expected transparent or a colour, as in #20242c")?;
    Ok(Background(Some(color)))
}

impl Background {
    fn behind(self, picture: &mut RgbaImage) {
        let Some(color) = self.0 else { return };
        for Rgba([r, g, b, a]) in picture.pixels_mut() {
            let alpha = u32::from(*a);
            for (own, behind) in [r, g, b].into_iter().zip(color) {
                let sum = u32::from(*own) * alpha + u32::from(behind) * (255 - alpha);
                *own = ((sum + 127) / 255) as u8;
            }
            *a = 255;
        }
    }
}

impl FilmArgs {
    /// Fails early where a film cannot be made of the frames in a folder: by making a short one.
    pub(super) fn check(&self, frames: &Path) -> anyhow::Result<()> {
        let Some(video) = &self.video else {
            return Ok(());
        };
        let named = format!("--video {}", video.display());
        let whole = |path: &Path| std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        if video.is_dir() || whole(frames).starts_with(whole(video)) {
            let text = format!(
                "{named}: a folder has that name, or would have it for the frames (-o {}); give the film \
                 another",
                frames.display()
            );
            return Err(Usage(text).into());
        }
        check_file(video, "--video")?;
        capture::video::ffmpeg().text(&["-version"])?;
        let folder = temporary_folder().with_context(|| named.clone())?;
        let trial = folder.path().join(video.file_name().unwrap_or_default());
        let (size, fps) = ((16, 16), self.fps.unwrap_or(30.0));
        // Of one frame alone ffmpeg makes a picture, too (.png).
        let frames = [(); 2].map(|()| Ok(vec![0; 3 * 16 * 16])).into_iter();
        let made = capture::video::encode(&trial, size, fps, frames);
        match made {
            Err(_) if !is_film(video) => Err(Usage(format!(
                "{named}: ffmpeg makes no film of that name; films end in {}, …",
                FILMS.map(|end| format!(".{end}")).join(", ")
            ))
            .into()),
            made => made.with_context(|| {
                let folder = folder.path().display();
                format!("{named}: cannot try it on two frames in {folder} (the variable TMPDIR names another)")
            }),
        }
    }

    /// Fails early where frames of these names and views make no film, as they are not of one size.
    pub(super) fn check_sizes<'a>(
        &self,
        frames: impl IntoIterator<Item = (&'a str, &'a View)>,
    ) -> anyhow::Result<()> {
        let Some(video) = &self.video else {
            return Ok(());
        };
        let mut frames = frames.into_iter();
        let Some((first, own)) = frames.next() else {
            return Ok(());
        };
        let size = |view: &View| (view.width, view.height);
        match frames.find(|(_, view)| size(view) != size(own)) {
            None => Ok(()),
            Some((other, view)) => Err(Usage(format!(
                "--video {}: frames of a film are of one size, but {first} has {}x{} pixels and \
                 {other} {}x{}; give --size",
                video.display(),
                own.width,
                own.height,
                view.width,
                view.height
            ))
            .into()),
        }
    }

    /// Which frames of a folder are there already, and whole: of `files`, which this run makes. `all` are those of
    /// the whole film, and `inputs` the files that frames are made of, over which none is written. Without
    /// `--resume` none counts as there.
    pub(super) fn begin(
        &self,
        folder: &Path,
        files: &[PathBuf],
        all: &[PathBuf],
        inputs: &[PathBuf],
    ) -> anyhow::Result<Vec<bool>> {
        check_inputs(all.iter().map(PathBuf::as_path), inputs)?;
        check_film(self.file(), inputs)?;
        if !self.resume {
            return Ok(vec![false; files.len()]);
        }
        kept::begin(folder, all, inputs)?;
        Ok(files.iter().map(|file| kept::is_whole(file)).collect())
    }

    /// The photos without which frames of a folder are made, as a run found them damaged: by name, with what is
    /// wrong with each. Runs know of each other with `--resume` alone.
    ///
    /// # Errors
    /// A run without it has put a picture in the place of one of the film's frames since it began.
    pub(super) fn left_out(&self, folder: &Path) -> anyhow::Result<BTreeMap<String, String>> {
        match self.resume {
            true => kept::left_out(folder),
            false => Ok(BTreeMap::new()),
        }
    }

    /// Goes on without photos that were found damaged: with `--resume` frames that were made with them are
    /// removed, those of other runs too, which is said. The files are those of [`Self::begin`].
    pub(super) fn leave_out(
        &self,
        damaged: &BTreeMap<String, String>,
        folder: &Path,
        files: &[PathBuf],
        all: &[PathBuf],
    ) -> anyhow::Result<()> {
        if !self.resume {
            return Ok(());
        }
        let count = |files: &[PathBuf]| files.iter().filter(|file| file.exists()).count();
        let before = count(all).saturating_sub(count(files));
        kept::leave_out(damaged, folder, files, all)?;
        let gone = before.saturating_sub(count(all));
        if gone > 0 {
            say!(
                "note: other runs made frames of this film with that photo: {gone} removed from {}; the same \
                 command for all frames draws them",
                folder.display()
            );
        }
        Ok(())
    }

    /// Removes frames that are to be drawn again, so that none of them is taken for one that is.
    pub(super) fn remove(&self, files: &[PathBuf]) -> anyhow::Result<()> {
        match self.resume {
            true => kept::remove(files),
            false => Ok(()),
        }
    }

    /// Writes a frame.
    pub(super) fn write(&self, file: &Path, mut picture: RgbaImage) -> anyhow::Result<()> {
        self.background.behind(&mut picture);
        match self.resume {
            true => Ok(capture::write_png(file, &picture)?),
            false => write_picture(file, &picture),
        }
    }

    /// Makes the film of written frames, if one is asked for.
    pub(super) fn finish(&self, files: &[PathBuf], fps: f64) -> anyhow::Result<()> {
        let (Some(video), Some(first)) = (&self.video, files.first()) else {
            return Ok(());
        };
        let read = |file: &PathBuf| {
            let opened = image::open(file);
            anyhow::Ok(
                opened
                    .with_context(|| file.display().to_string())?
                    .to_rgba8(),
            )
        };
        let size = read(first)?.dimensions();
        let frames = files.iter().map(|file| {
            let picture = read(file).map_err(std::io::Error::other)?;
            if picture.dimensions() != size {
                let text = format!("{}: not as large as the first frame", file.display());
                return Err(std::io::Error::other(text));
            }
            Ok(on_black(&picture).into_iter().flatten().collect())
        });
        super::output::make_parent(video)?;
        capture::video::encode(video, size, self.fps.unwrap_or(fps), frames)
            .with_context(|| video.display().to_string())
    }

    /// What to say of a film whose frames are as of moments of the scene so many seconds apart, where it shows them
    /// at another rate.
    pub(super) fn note_of_rate(&self, apart_s: f64) -> Option<String> {
        let asked = self.fps?;
        let pace = asked * apart_s.abs();
        if !(pace > 0.0) {
            return None;
        }
        let (times, how) = match pace < 1.0 {
            true => (pace.recip(), "slower"),
            false => (pace, "faster"),
        };
        let times = (100.0 * times).round() / 100.0;
        let fps = (100.0 / apart_s.abs()).round() / 100.0;
        (times != 1.0).then(|| {
            format!(
                "--fps {asked}: frames show the moments of a path of {fps} frames a second: in the film what moves is \
                 {times} times {how}"
            )
        })
    }

    /// The film's file, if one is asked for.
    pub(super) fn file(&self) -> Option<&Path> {
        self.video.as_deref()
    }

    /// The film as JSON names it, if one is asked for.
    pub(super) fn video(&self) -> Option<PathBuf> {
        self.video.as_deref().map(in_unicode)
    }
}

/// Writes a picture of a run without `--resume`. A film of runs that have it gives way where it has a frame of that
/// name, which is said: they no longer go on with it.
pub(super) fn write_picture(file: &Path, picture: &RgbaImage) -> anyhow::Result<()> {
    let given_up = kept::give_up(file)?;
    let here = std::env::current_dir().unwrap_or_default();
    for film in &given_up {
        let folder = film.folder.strip_prefix(&here);
        let folder = folder.ok().filter(|folder| *folder != Path::new(""));
        say!(
            "note: {}: frames that runs with --resume left here are no longer gone on with, as this run has none",
            folder.unwrap_or(&film.folder).display()
        );
    }
    // Their folders are held until it is there.
    Ok(capture::write_png(file, picture)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_counted_or_chosen() {
        let all = |count| FrameChoice {
            count: Some(count),
            range: None,
        };
        assert_eq!(frame_choice("60"), Ok(all(60)));
        let part = frame_choice("2..4").unwrap();
        assert_eq!(part.of(vec![0, 1, 2, 3, 4]).unwrap(), [2, 3]);
        assert_eq!(
            part.of(vec![0, 1, 2]).unwrap_err().to_string(),
            "--frames 2..4: the path has 3 frames"
        );
        assert_eq!(part.count(30), 30);
        let of_derived = frame_choice("1..2/7").unwrap();
        assert_eq!(of_derived.count(30), 7);
        assert!(of_derived.check_end(7).is_ok() && all(60).check_end(7).is_ok());
        let beyond = frame_choice("3..5/4").unwrap().check_end(4).unwrap_err();
        assert_eq!(beyond.to_string(), "--frames 3..5/4: the path has 4 frames");
        assert!(part.check(false).is_ok() && FrameChoice::default().check(false).is_ok());
        for count in [of_derived, all(60)] {
            assert!(count.check(true).is_ok() && count.check(false).is_err());
        }
        for bad in [
            "", "0", "4..4", "5..2", "-1..3", "1..", "100001", "1..2/0", "a..b",
        ] {
            assert!(frame_choice(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn frames_that_are_cut_short_do_not_count_as_there() {
        let folder = tempfile::tempdir().unwrap();
        let frame = folder.path().join("0.png");
        assert!(!kept::is_whole(&frame));
        capture::write_png(&frame, &RgbaImage::new(8, 8)).unwrap();
        assert!(kept::is_whole(&frame));
        let bytes = std::fs::read(&frame).unwrap();
        for count in [0, 8, 15, bytes.len() - 1] {
            std::fs::write(&frame, &bytes[..count]).unwrap();
            assert!(!kept::is_whole(&frame), "{count} bytes");
        }
        // As long as it was, where the file system kept its length alone.
        std::fs::write(&frame, vec![0; bytes.len()]).unwrap();
        assert!(!kept::is_whole(&frame));
    }

    #[test]
    fn a_background_shows_as_far_as_the_picture_does_not() {
        assert_eq!(background("#0a10ff"), Ok(Background(Some([10, 16, 255]))));
        assert!(
            ["#12345", "red", "#12345g", "#1234567", "#ßßß"]
                .iter()
                .all(|b| background(b).is_err())
        );
        let mut picture = RgbaImage::from_pixel(1, 1, Rgba([100, 200, 0, 51]));
        background("#0a10ff").unwrap().behind(&mut picture);
        assert_eq!(picture.get_pixel(0, 0).0, [28, 53, 204, 255]);
        let kept = picture.clone();
        background("transparent").unwrap().behind(&mut picture);
        assert_eq!(picture, kept);
    }
}
