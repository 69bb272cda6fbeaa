//! What ffmpeg says of a video that it cannot decode whole. It ends with success all the same, and
//! fills in what is missing of a frame, which looks sharp.

use std::fmt;

/// What is wrong with a video of which some was decoded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Damage {
    /// Lines in which ffmpeg reports an error.
    pub errors: usize,
    /// The first of them, without the part of ffmpeg that says so.
    pub first: String,
    /// Frames that are not whole, or may be predicted from such ones.
    pub frames: usize,
}

impl fmt::Display for Damage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.errors {
            1 => write!(f, "ffmpeg reports an error: {}", self.first),
            errors => write!(
                f,
                "ffmpeg reports {errors} errors, the first: {}",
                self.first
            ),
        }
    }
}

/// Said of a frame before anything else is. Before ffmpeg 7 the file's name stands before it and
/// the stream's number behind it.
const CORRUPT_FRAME: &str = "corrupt decoded frame";
/// Warnings that are errors of the file, said by demuxers and by ffmpeg itself.
const OF_FILE: [&str; 3] = [CORRUPT_FRAME, "corrupt input packet", "Packet corrupt"];
/// What begins its decoder's lines about an MJPEG, whose frames it never calls corrupt, and what those are about that
/// say what is wrong with the next frame's picture, and not with notes within it.
const OF_MJPEG: &str = "[mjpeg @ ";
const OF_PICTURE: [&str; 4] = ["overread ", "error count: ", "error dc", "error y="];
/// How lines of errors are marked where levels are printed (`-v level+…`).
const LEVELS: [&str; 3] = ["[error] ", "[fatal] ", "[panic] "];
/// What begins the line about each decoded frame that `-debug_ts` prints, and what frames between two
/// others are called there.
const DECODED: &str = "decoder -> ";
const BETWEEN: &str = "3";

/// The text of a line that tells of an error.
fn error_in(line: &str) -> Option<&str> {
    let level = |marker: &str| from(line, marker).map(|told| &told[marker.len()..]);
    let error = LEVELS.into_iter().find_map(level);
    error
        .or_else(|| OF_FILE.into_iter().find_map(|text| from(line, text)))
        .map(str::trim)
}

/// A line from where it says something; `None` where it is only information: titles and the files' names may read
/// like anything.
fn from<'a>(line: &'a str, text: &str) -> Option<&'a str> {
    let at = line.find(text)?;
    (!line[..at].contains("[info] ")).then(|| &line[at..])
}

/// Whether a line says that the next frame is not whole.
fn is_of_frame(line: &str) -> bool {
    let of_mjpeg = line.strip_prefix(OF_MJPEG);
    let error = of_mjpeg.and_then(|line| line.split_once("] [error] "));
    let is_of_picture = |(_, error): (&str, &str)| OF_PICTURE.iter().any(|b| error.starts_with(*b));
    from(line, CORRUPT_FRAME).is_some() || error.is_some_and(is_of_picture)
}

/// A frame as it came out of the decoder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Decoded {
    /// By ffmpeg's word.
    is_corrupt: bool,
    /// Predicted from no other.
    is_key: bool,
    /// May be predicted from a later one.
    is_between: bool,
}

impl Decoded {
    /// From the line about it; `None` from other lines.
    fn parse(line: &str, is_corrupt: bool) -> Option<Self> {
        let (_, told) = line.split_once(DECODED)?;
        let word = |key: &str| told.split_once(key)?.1.split_whitespace().next();
        Some(Self {
            is_corrupt,
            is_key: word("keyframe:")? == "1",
            is_between: word("frame_type:")? == BETWEEN,
        })
    }
}

/// What the lines that ffmpeg prints on stderr tell of damage.
#[derive(Default)]
pub(super) struct Log {
    errors: usize,
    first: Option<String>,
    /// Whether the next frame is.
    is_corrupt: bool,
    decoded: Vec<Decoded>,
}

impl Log {
    pub(super) fn read(&mut self, line: &str) {
        if let Some(error) = error_in(line) {
            self.errors += 1;
            self.first.get_or_insert_with(|| error.to_owned());
        }
        self.is_corrupt |= is_of_frame(line);
        if let Some(decoded) = Decoded::parse(line, self.is_corrupt) {
            self.decoded.push(decoded);
            self.is_corrupt = false;
        }
    }

    /// Which frames are damaged, in the order in which they are shown, as far as it is told.
    pub(super) fn damaged(&self) -> Vec<bool> {
        let mut is_damaged = false;
        let mut marks = Vec::new();
        for frame in &self.decoded {
            is_damaged = frame.is_corrupt || (is_damaged && !frame.is_key);
            marks.push(is_damaged);
        }
        for i in (1..marks.len()).rev() {
            if marks[i] && self.decoded[i - 1].is_between {
                marks[i - 1] = true;
            }
        }
        marks
    }

    /// What is wrong, if anything is; `frames` are damaged.
    pub(super) fn damage(self, frames: usize) -> Option<Damage> {
        self.first.map(|first| Damage {
            errors: self.errors,
            first,
            frames,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_told_from_what_is_only_said() {
        let first = |lines: &[&str]| {
            let mut log = Log::default();
            lines.iter().for_each(|line| log.read(line));
            log.damage(7)
        };
        let told = |errors, first: &str| {
            Some(Damage {
                errors,
                first: first.to_owned(),
                frames: 7,
            })
        };
        for fine in [
            "[h264 @ 0x55] [info] concealing 319 DC, 319 AC, 319 MV errors in I frame",
            "[mov,mp4 @ 0x55] [warning] multiple edit list entries, a/v desync might occur",
            "[info]     title           : [error] my corrupt film",
            "[info]     title           : Packet corrupt",
            "[info] Input #0, mov,mp4, from 'corrupt decoded frame.mp4':",
        ] {
            assert_eq!(first(&[fine]), None, "{fine}");
        }
        let mut log = Log::default();
        log.read("[info] Input #0, mov,mp4, from 'corrupt decoded frame.mp4':");
        log.read("[info] decoder -> pts:0 keyframe:1 frame_type:1");
        assert_eq!(log.damaged(), [false]);
        // Of ffmpeg 4 to 6, then of 7 on.
        let old = [
            "[h264 @ 0x55] [error] error while decoding MB 0 8, bytestream 13273",
            "[warning] file:bad.mp4: corrupt decoded frame in stream 0",
        ];
        let damage = first(&old);
        assert_eq!(
            damage,
            told(2, "error while decoding MB 0 8, bytestream 13273")
        );
        assert_eq!(
            damage.unwrap().to_string(),
            "ffmpeg reports 2 errors, the first: error while decoding MB 0 8, bytestream 13273"
        );
        let new = ["[vist#0:0/h264 @ 0x2] [dec:h264 @ 0x3] [warning] corrupt decoded frame"];
        let damage = first(&new);
        assert_eq!(damage, told(1, "corrupt decoded frame"));
        let said = damage.unwrap().to_string();
        assert_eq!(said, "ffmpeg reports an error: corrupt decoded frame");
        let cut_off = ["[in#0/mov,mp4 @ 0x55] [error] stream 0, offset 0x121ad: partial file"];
        assert_eq!(
            first(&cut_off),
            told(1, "stream 0, offset 0x121ad: partial file")
        );
        let packet = ["[mpegts @ 0x55] [warning] Packet corrupt (stream = 0, dts = 283500)."];
        assert_eq!(
            first(&packet),
            told(1, "Packet corrupt (stream = 0, dts = 283500).")
        );
    }

    #[test]
    fn errors_in_pictures_of_an_mjpeg_are_of_the_next_frame() {
        let mut log = Log::default();
        let frame = "[info] decoder -> ist_index:0 type:video frame_pts:0 keyframe:1 frame_type:1";
        for line in [
            frame,
            "[mjpeg @ 0x55] [error] overread 8",
            "[mjpeg @ 0x55] [warning] EOI missing, emulating",
            frame,
            "[mjpeg @ 0x55] [error] unable to decode APP fields: Invalid data found",
            frame,
            "[h264 @ 0x55] [error] error y=1 x=2",
            frame,
            "[mjpeg @ 0x55] [error] error y=1 x=2",
            "[mjpeg @ 0x55] [error] overread 8",
            frame,
            frame,
        ] {
            log.read(line);
        }
        assert_eq!(log.damaged(), [false, true, false, false, true, false]);
        assert_eq!(log.damage(2).unwrap().errors, 5);
    }

    #[test]
    fn damage_lasts_until_a_whole_key_frame_and_reaches_back_to_those_between() {
        // Of each frame its type, and whether it is a key frame or corrupt.
        let marks = |frames: &str, is_new: bool| {
            let mut log = Log::default();
            for frame in frames.split_whitespace() {
                if frame.contains('!') {
                    log.read(match is_new {
                        true => "[dec:h264 @ 0x3] [warning] corrupt decoded frame",
                        false => "[warning] file:b.mp4: corrupt decoded frame in stream 0",
                    });
                }
                let kind = frame[..1].parse::<u8>().unwrap();
                let key = u8::from(frame.contains('k'));
                log.read(&match is_new {
                    true => format!(
                        "[dec:h264 @ 0x3] [info] decoder -> pts:0 pts_time:0 duration:512 \
                         keyframe:{key} frame_type:{kind} time_base:1/12288"
                    ),
                    false => format!(
                        "[info] decoder -> ist_index:0 type:video frame_pts:0 keyframe:{key} \
                         frame_type:{kind} time_base:1/12288"
                    ),
                });
                log.read("[Parsed_showinfo_2 @ 0x5] [info] n:   0 pts:      0 pts_time:0");
            }
            let marks = log
                .damaged()
                .into_iter()
                .map(|is| if is { 'x' } else { '.' });
            marks.collect::<String>()
        };
        for is_new in [false, true] {
            for (frames, expected) in [
                ("1k 2 2 1k 2", "....."),
                ("1k 2 2! 2 1k 2", "..xx.."),
                // Those before the corrupt one are predicted from it.
                ("1k 3 3 2! 3 1k", ".xxxx."),
                ("1k! 2 1k! 2 1k", "xxxx."),
                ("1k 1k! 1k", ".x."),
                ("1k 2 3 3! 3 2 1k", "..xxxx."),
            ] {
                assert_eq!(marks(frames, is_new), expected, "{frames}");
            }
        }
    }
}
