use super::damage::{Damage, Log};
use super::range::HighRange;
use super::shape::Shape;
use super::{ScoredFrame, VideoError, VideoProgress};
use crate::{Tool, ToolError};
use std::ffi::OsString;
use std::io::{self, BufRead, BufReader};
use std::path::Path;

/// Frames are reduced to this longer side before they are scored: what is sharp to the
/// pixel in a full frame is often only its noise.
const SCORED_SIDE: u32 = 480;

/// What begins ffmpeg's line about a file that it takes for a terminal's text, by its name (`.txt`): pictures of letters
/// are no photos.
const OF_TEXT: &str = "[info] Input #0, tty, ";

/// What begins the lines of the filter `showinfo` about a frame.
const OF_FRAME: &str = "[Parsed_showinfo";
/// What these say of frames whose colours are converted as JPEG's are: how pixels are stored, and which matrix they are
/// in. ffmpeg takes BT.601 for granted where a video does not say so.
const JPEG_PIXELS: [&str; 2] = ["yuv420p", "yuvj420p"];
const JPEG_MATRICES: [&str; 3] = ["unknown", "smpte170m", "bt470bg"];

/// Decodes a video once, reduced, and scores every frame.
///
/// # Errors
/// `ffmpeg` is missing, or the file is nothing that it can decode, or a text.
pub fn scan(
    ffmpeg: &Tool,
    video: &Path,
    report: &mut dyn FnMut(VideoProgress),
) -> Result<Vec<ScoredFrame>, VideoError> {
    Ok(scan_with(ffmpeg, spelling(ffmpeg)?, video, report)?.frames)
}

/// A video's frames, and what is wrong with it.
pub(super) struct Scan {
    pub(super) frames: Vec<ScoredFrame>,
    pub(super) damage: Option<Damage>,
    /// How the first of them is stored, where ffmpeg tells.
    pub(super) shape: Option<Shape>,
    /// Whether its colours are those of photos, but for their range, as ffmpeg tells.
    pub(super) is_jpeg_like: bool,
    /// Whether most of its frames are interlaced, and were deinterlaced before they were scored.
    pub(super) is_interlaced: bool,
    /// How its colours are stored, if they are of a high dynamic range.
    pub(super) range: Option<HighRange>,
    /// How they were decoded: to have the same ones again, as many of a damaged video.
    pub(super) decoding: Decoding,
}

impl Scan {
    /// What makes whole frames of interlaced ones, one of each, and leaves others as they are; nothing where most are whole.
    pub(super) fn deinterlaced(&self) -> &'static str {
        match self.is_interlaced {
            true => DEINTERLACED,
            false => "",
        }
    }

    /// Whether frames are as the first version of this program made them.
    pub(super) fn is_as_in_first_version(&self) -> bool {
        self.is_jpeg_like && !self.is_interlaced && self.range.is_none()
    }
}

/// See [`Scan::deinterlaced`].
const DEINTERLACED: &str = "bwdif=mode=send_frame:deint=interlaced,";

/// How ffmpeg decodes.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Decoding {
    /// With as many threads as it likes, several frames at once: it may not tell which are corrupt.
    Fast,
    /// One after the other, each with a line about it.
    Told,
}

/// A video with which anything is wrong is decoded a second time, to know which frames are damaged.
pub(super) fn scan_with(
    ffmpeg: &Tool,
    spelling: Spelling,
    video: &Path,
    report: &mut dyn FnMut(VideoProgress),
) -> Result<Scan, VideoError> {
    let mut once = |decoding, whole| scan_once(ffmpeg, spelling, video, decoding, whole, report);
    let mut scan = once(Decoding::Fast, "")?;
    if scan.damage.is_some() {
        scan = once(Decoding::Told, "")?;
    }
    // Torn edges pass for sharp ones.
    match scan.deinterlaced() {
        "" => Ok(scan),
        whole => once(scan.decoding, whole),
    }
}

fn scan_once(
    ffmpeg: &Tool,
    spelling: Spelling,
    video: &Path,
    decoding: Decoding,
    whole: &str,
    report: &mut dyn FnMut(VideoProgress),
) -> Result<Scan, VideoError> {
    // Frames come on stdout, each with its size, and what they are on stderr, line by line, as they are stored.
    let filter = format!(
        "showinfo=checksum=0,{whole}scale=w={SCORED_SIDE}:h={SCORED_SIDE}:\
         force_original_aspect_ratio=decrease:flags=area,format=gray"
    );
    let mut arguments = input(video, decoding);
    arguments.extend(["-vf", &filter].map(Into::into));
    arguments.extend(spelling.passthrough.map(Into::into));
    arguments.extend("-c:v pgm -f image2pipe pipe:1".split(' ').map(Into::into));
    let mut times_s: Vec<f64> = Vec::new();
    let mut log = Log::default();
    let mut shape = None;
    let mut colors = JpegColors::default();
    let mut is_text = false;
    let (mut interlaced, mut range) = (0, None);
    // Where the filters were made anew, and count from zero again.
    let mut changed_s = None;
    let mut on_line = |line: &str| {
        log.read(line);
        colors.read(line);
        is_text |= line.starts_with(OF_TEXT);
        if let Some(curve) = told(line, " color_trc:") {
            let known = |key| told(line, key).unwrap_or("unknown");
            let [primaries, matrix] = [" color_primaries:", " color_space:"].map(known);
            range = range.or_else(|| HighRange::new(curve, primaries, matrix));
        }
        let Some(time_s) = shown_at_s(line) else {
            return;
        };
        if times_s.is_empty() {
            shape = Shape::parse(line);
        }
        if told(line, " n:") == Some("0") && !times_s.is_empty() {
            changed_s = changed_s.or(Some(time_s));
        }
        interlaced += usize::from(matches!(told(line, " i:"), Some("T" | "B")));
        times_s.push(time_s);
        report(VideoProgress::Scored {
            frames: times_s.len(),
            time_s,
        });
    };
    let scores = ffmpeg.stream(&arguments, &mut on_line, |stdout| {
        let mut stdout = BufReader::new(stdout);
        let mut scores = Vec::new();
        while let Some(picture) = read_pgm(&mut stdout)? {
            scores.push(sharpness(&picture.pixels, picture.width));
        }
        Ok(scores)
    });
    if is_text {
        return Err(VideoError::Text {
            path: video.to_owned(),
        });
    }
    if let Some(at_s) = changed_s {
        return Err(VideoError::Changes {
            path: video.to_owned(),
            at_s,
        });
    }
    let scores = scores.map_err(|source| match source {
        ToolError::Failed { .. } => VideoError::Decode {
            path: video.to_owned(),
            source,
        },
        other => other.into(),
    })?;
    let mut is_damaged = log.damaged().into_iter();
    let frame = |(time_s, sharpness)| ScoredFrame {
        time_s,
        sharpness,
        is_damaged: is_damaged.next().unwrap_or(false),
    };
    let frames: Vec<ScoredFrame> = times_s.into_iter().zip(scores).map(frame).collect();
    let count = frames.len();
    let damaged = frames.iter().filter(|frame| frame.is_damaged).count();
    Ok(Scan {
        frames,
        damage: log.damage(damaged),
        shape,
        is_jpeg_like: colors.are_all(),
        is_interlaced: 2 * interlaced > count,
        range,
        decoding,
    })
}

/// The word behind a key in a line of the filter `showinfo` about a frame.
fn told<'l>(line: &'l str, key: &str) -> Option<&'l str> {
    let line = line.strip_prefix(OF_FRAME)?;
    line.split_once(key)?.1.split_whitespace().next()
}

/// Whether all that is told of frames' colours is what JPEG's are.
#[derive(Default)]
struct JpegColors {
    /// Whether so far pixels, and matrices, were told, and as JPEG has them.
    pixels: Option<bool>,
    matrix: Option<bool>,
}

impl JpegColors {
    fn read(&mut self, line: &str) {
        for (so_far, found, of_jpeg) in [
            (&mut self.pixels, told(line, " fmt:"), &JPEG_PIXELS[..]),
            (
                &mut self.matrix,
                told(line, " color_space:"),
                &JPEG_MATRICES[..],
            ),
        ] {
            if let Some(found) = found {
                *so_far = Some(so_far.unwrap_or(true) && of_jpeg.contains(&found));
            }
        }
    }

    /// Not where nothing is told.
    fn are_all(&self) -> bool {
        self.pixels == Some(true) && self.matrix == Some(true)
    }
}

/// What all calls begin with. Each line that is printed has its level.
pub(super) fn input(video: &Path, decoding: Decoding) -> Vec<OsString> {
    let mut words = "-hide_banner -nostdin -nostats -v level+info".to_owned();
    if decoding == Decoding::Told {
        words += " -debug_ts -threads 1";
    }
    let mut arguments: Vec<OsString> = words.split(' ').map(Into::into).collect();
    arguments.extend(["-i".into(), file(video)]);
    arguments.extend("-map 0:v:0 -an -sn -dn".split(' ').map(Into::into));
    arguments
}

/// A file's path as ffmpeg is to be told it: a name with a colon would be taken for a protocol's.
pub(super) fn file(path: &Path) -> OsString {
    let mut argument = OsString::from("file:");
    argument.push(path);
    argument
}

/// What this ffmpeg calls options whose names have changed.
#[derive(Clone, Copy)]
pub(super) struct Spelling {
    /// Lets every frame through, once: changed in ffmpeg 5.1.
    pub(super) passthrough: [&'static str; 2],
    /// Takes a filter from a file: changed in ffmpeg 7.
    pub(super) filter_file: &'static str,
}

pub(super) fn spelling(ffmpeg: &Tool) -> Result<Spelling, ToolError> {
    let help = ffmpeg.text(&["-hide_banner", "-h", "long"])?;
    Ok(Spelling {
        passthrough: if help.contains("-fps_mode") {
            ["-fps_mode", "passthrough"]
        } else {
            ["-vsync", "passthrough"]
        },
        filter_file: if help.contains("-filter_script") {
            "-filter_script:v"
        } else {
            "-/filter:v"
        },
    })
}

/// The time in a line that the filter `showinfo` prints of a frame.
fn shown_at_s(line: &str) -> Option<f64> {
    if !line.contains("showinfo") {
        return None;
    }
    let (_, time) = line.split_once("pts_time:")?;
    time.split_whitespace().next()?.parse().ok()
}

struct GreyPicture {
    width: usize,
    pixels: Vec<u8>,
}

/// A binary grey picture of 8 bits; `None` at the end.
fn read_pgm(stream: &mut impl BufRead) -> io::Result<Option<GreyPicture>> {
    if stream.fill_buf()?.is_empty() {
        return Ok(None);
    }
    let mut words = Vec::new();
    while words.len() < 4 {
        let mut line = String::new();
        if stream.read_line(&mut line)? == 0 {
            break;
        }
        words.extend(line.split_whitespace().map(str::to_owned));
    }
    let number = |i: usize| words.get(i).and_then(|w| w.parse::<usize>().ok());
    let (Some("P5"), Some(width), Some(height), Some(255)) = (
        words.first().map(String::as_str),
        number(1),
        number(2),
        number(3),
    ) else {
        return Err(io::Error::other("expected grey pictures of 8 bits"));
    };
    let mut pixels = vec![0; width * height];
    stream.read_exact(&mut pixels)?;
    Ok(Some(GreyPicture { width, pixels }))
}

/// How sharp a grey picture is, row by row: the variance of its Laplacian (Pech-Pacheco
/// et al., "Diatom autofocusing in brightfield microscopy", ICPR 2000). 0 where a side has
/// less than three pixels.
pub fn sharpness(pixels: &[u8], width: usize) -> f64 {
    if width < 3 || pixels.len() < 3 * width {
        return 0.0;
    }
    let (mut count, mut sum, mut sum_of_squares) = (0_i64, 0_i64, 0_i64);
    for y in 1..pixels.len() / width - 1 {
        for x in 1..width - 1 {
            let at = y * width + x;
            let [left, right, above, below] =
                [at - 1, at + 1, at - width, at + width].map(|i| i64::from(pixels[i]));
            let laplacian = left + right + above + below - 4 * i64::from(pixels[at]);
            count += 1;
            sum += laplacian;
            sum_of_squares += laplacian * laplacian;
        }
    }
    let mean = sum as f64 / count as f64;
    sum_of_squares as f64 / count as f64 - mean * mean
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blur_lowers_the_score_and_brightness_does_not_change_it() {
        let stripes: Vec<u8> = (0..64 * 64)
            .map(|i| 40 + 80 * ((i / 4) % 2) as u8)
            .collect();
        let mut blurred = stripes.clone();
        for i in 1..stripes.len() - 1 {
            let sum: u32 = stripes[i - 1..=i + 1].iter().map(|&p| u32::from(p)).sum();
            blurred[i] = (sum / 3) as u8;
        }
        let brighter: Vec<u8> = stripes.iter().map(|p| p + 100).collect();
        assert!(sharpness(&stripes, 64) > 2.0 * sharpness(&blurred, 64));
        assert_eq!(sharpness(&stripes, 64), sharpness(&brighter, 64));
        assert_eq!(sharpness(&[7; 64], 8), 0.0);
        assert_eq!(sharpness(&[7; 4], 2), 0.0);
    }

    #[test]
    fn pictures_follow_each_other_in_the_pipe() {
        let mut pipe = io::Cursor::new(b"P5\n3 2\n255\nabcdefP5 1 1 255\n\n");
        let first = read_pgm(&mut pipe).unwrap().unwrap();
        assert_eq!((first.width, first.pixels), (3, b"abcdef".to_vec()));
        assert_eq!(read_pgm(&mut pipe).unwrap().unwrap().pixels, b"\n");
        assert!(read_pgm(&mut pipe).unwrap().is_none());
        assert!(read_pgm(&mut &b"P5\n3 2\n255\nab"[..]).is_err());
        assert!(read_pgm(&mut &b"P6\n3 2\n255\nabcdef"[..]).is_err());
    }

    #[test]
    fn colours_are_as_jpegs_where_all_frames_say_so() {
        let are_all = |frames: &[[&str; 2]]| {
            let mut colors = JpegColors::default();
            colors.read("[info]     title           : fmt:gray color_space:gbr");
            for [pixels, matrix] in frames {
                let of_frame = "[Parsed_showinfo_0 @ 0x55] [info]";
                colors.read(&format!("{of_frame} n: 0 pts_time:0 fmt:{pixels} sar:1/1"));
                colors.read(&format!(
                    "{of_frame} color_range:tv color_space:{matrix} color_primaries:unknown"
                ));
            }
            colors.are_all()
        };
        let [plain, phone] = [["yuv420p", "smpte170m"], ["yuv420p", "bt709"]];
        assert!(are_all(&[plain, ["yuvj420p", "unknown"]]));
        assert!(!are_all(&[plain, phone, plain]));
        assert!(!are_all(&[["yuv422p", "unknown"], plain]));
        assert!(!are_all(&[]));
    }

    #[test]
    fn times_are_found_in_what_the_filter_prints() {
        let line = "[Parsed_showinfo_2 @ 0x55] n:   3 pts:   1536 pts_time:0.12    pos: 1 fmt:gray";
        assert_eq!(shown_at_s(line), Some(0.12));
        assert_eq!(
            shown_at_s("[Parsed_showinfo_2 @ 0x55] color_range:tv"),
            None
        );
        assert_eq!(shown_at_s("frame pts_time:0.5"), None);
    }
}
