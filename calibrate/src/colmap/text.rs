//! The text format: one line a camera or point, two lines an image.
//!
//! Lines that are empty or begin with `#` are skipped, except an image's second line,
//! which lists its keypoints and is empty where there are none.

use super::check;
use super::error::{ColmapError, Place, malformed};
use crate::{
    Camera, CameraId, Image, ImageId, Keypoint, ModelKind, Point3D, Point3DId, Reconstruction,
};
use capture::without_byte_order_mark;
use std::collections::BTreeMap;
use std::io::{self, Write};
use std::path::Path;
use std::str::{FromStr, SplitWhitespace};

/// Reads `cameras.txt`.
pub(super) fn read_cameras(
    path: &Path,
    bytes: &[u8],
) -> Result<BTreeMap<CameraId, Camera>, ColmapError> {
    let mut cameras = BTreeMap::new();
    let mut lines = Lines::new(path, bytes)?;
    while let Some(line) = lines.next_record() {
        let mut fields = line.fields();
        let id = fields.parse("the camera's id")?;
        let name = fields.word("the camera's model")?;
        let model = ModelKind::from_name(name).ok_or_else(|| ColmapError::UnknownModel {
            path: path.to_owned(),
            place: line.place(),
            camera_id: id,
            model: name.to_owned(),
        })?;
        let width = fields.parse("the width in pixels")?;
        let height = fields.parse("the height in pixels")?;
        let params = fields.rest("a parameter")?;
        let camera = Camera {
            model,
            width,
            height,
            params,
        };
        let added = check::insert(&mut cameras, "camera", CameraId(id), camera);
        line.accept(added)?;
    }
    Ok(cameras)
}

/// Reads `images.txt`.
pub(super) fn read_images(
    path: &Path,
    bytes: &[u8],
) -> Result<BTreeMap<ImageId, Image>, ColmapError> {
    let mut images = BTreeMap::new();
    let mut lines = Lines::new(path, bytes)?;
    while let Some(line) = lines.next_record() {
        let mut fields = line.fields();
        let id = fields.parse("the image's id")?;
        let wxyz = fields.numbers("the rotation")?;
        let translation = fields.numbers("the translation")?;
        let camera_from_world = line.accept(check::pose(wxyz, translation))?;
        let camera_id = CameraId(fields.parse("the camera's id")?);
        let name = line.accept(check::name(line.after_words(9)))?;
        // The last image's empty line may be missing at the file's end.
        let keypoints = match lines.next_line() {
            Some(line) => read_keypoints(&line)?,
            None => Vec::new(),
        };
        let image = Image {
            name,
            camera_id,
            camera_from_world,
            keypoints,
        };
        let added = check::insert(&mut images, "image", ImageId(id), image);
        line.accept(added)?;
    }
    Ok(images)
}

/// How many images `images.txt` lists, whether or not they can be read; `None` where it is no
/// text.
pub(super) fn count_images(path: &Path, bytes: &[u8]) -> Option<u64> {
    let mut lines = Lines::new(path, bytes).ok()?;
    let mut count = 0;
    while lines.next_record().is_some() {
        lines.next_line();
        count += 1;
    }
    Some(count)
}

/// Reads an image's second line: x, y and a point's id (−1 for none), again and again.
fn read_keypoints(line: &Line<'_>) -> Result<Vec<Keypoint>, ColmapError> {
    let words = line.text.split_whitespace().count();
    // A name of three words makes twelve.
    if !words.is_multiple_of(3) || is_image(line) {
        let found = match words % 3 {
            0 => "an image".to_owned(),
            _ => format!("{words} words"),
        };
        return Err(line.malformed(format!(
            "found {found}, expected the keypoints of the image on the line before, three words \
             each (an image without any has an empty second line)"
        )));
    }
    let mut fields = line.fields();
    let mut keypoints = Vec::with_capacity(words / 3);
    for index in 0..words / 3 {
        let [x, y] = fields.numbers("a keypoint")?;
        let point = match fields.word("a point's id")? {
            "-1" => None,
            word => Some(line.parse(word, "a point's id")?),
        };
        // COLMAP's "no point" as an unsigned number.
        let point = point.filter(|&id| id != u64::MAX).map(Point3DId);
        keypoints.push(line.accept(check::keypoint(index, x, y, point))?);
    }
    Ok(keypoints)
}

/// Whether a line is an image's first one: it begins with an id, and has the beginning of a name
/// where the fourth keypoint would have a number.
fn is_image(line: &Line<'_>) -> bool {
    let mut words = line.text.split_whitespace();
    let has_id = words.next().is_some_and(|id| id.parse::<u32>().is_ok());
    has_id && words.nth(8).is_some_and(|x| x.parse::<f64>().is_err())
}

/// Reads `points3D.txt`.
pub(super) fn read_points(
    path: &Path,
    bytes: &[u8],
) -> Result<BTreeMap<Point3DId, Point3D>, ColmapError> {
    let mut points = BTreeMap::new();
    let mut lines = Lines::new(path, bytes)?;
    while let Some(line) = lines.next_record() {
        let mut fields = line.fields();
        let id = fields.parse("the point's id")?;
        let position = line.accept(check::position(id, fields.numbers("the position")?))?;
        let mut color = [0; 3];
        for channel in &mut color {
            *channel = fields.parse("the colour, 0 to 255")?;
        }
        let error_px = check::error_px(fields.parse("the error")?);
        let track: Vec<u32> = fields.rest("a track's image or keypoint")?;
        let (pairs, odd) = track.as_chunks();
        if !odd.is_empty() {
            return Err(line.malformed(format!(
                "the track has {} numbers, expected pairs of an image's id and a keypoint's index",
                track.len()
            )));
        }
        let point = Point3D {
            position,
            color,
            error_px,
            track: pairs.iter().map(|&[i, k]| (ImageId(i), k)).collect(),
        };
        let added = check::insert(&mut points, "point", Point3DId(id), point);
        line.accept(added)?;
    }
    Ok(points)
}

/// The lines of a file, numbered.
struct Lines<'a> {
    path: &'a Path,
    lines: std::iter::Enumerate<capture::Lines<'a>>,
}

impl<'a> Lines<'a> {
    fn new(path: &'a Path, bytes: &'a [u8]) -> Result<Self, ColmapError> {
        let bytes = without_byte_order_mark(bytes);
        let text = str::from_utf8(bytes).map_err(|error| {
            let before = &bytes[..error.valid_up_to()];
            let line = 1 + before.iter().filter(|&&byte| byte == b'\n').count();
            malformed(
                path,
                Place::Line(line),
                "the line is not UTF-8 text".to_owned(),
            )
        })?;
        Ok(Self {
            path,
            lines: capture::lines(text).enumerate(),
        })
    }

    fn next_line(&mut self) -> Option<Line<'a>> {
        let (index, text) = self.lines.next()?;
        Some(Line {
            path: self.path,
            number: index + 1,
            text: text.trim(),
        })
    }

    /// The next line that is neither empty nor a comment.
    fn next_record(&mut self) -> Option<Line<'a>> {
        loop {
            let line = self.next_line()?;
            if !(line.text.is_empty() || line.text.starts_with('#')) {
                return Some(line);
            }
        }
    }
}

/// One line without the white space around it.
struct Line<'a> {
    path: &'a Path,
    number: usize,
    text: &'a str,
}

impl<'a> Line<'a> {
    fn place(&self) -> Place {
        Place::Line(self.number)
    }

    fn malformed(&self, problem: String) -> ColmapError {
        malformed(self.path, self.place(), problem)
    }

    /// Says where a problem is.
    fn accept<T>(&self, checked: Result<T, String>) -> Result<T, ColmapError> {
        checked.map_err(|problem| self.malformed(problem))
    }

    fn parse<T: FromStr>(&self, word: &str, what: &str) -> Result<T, ColmapError> {
        word.parse()
            .map_err(|_| self.malformed(format!("found {word:?}, expected {what}")))
    }

    fn fields(&self) -> Fields<'_, 'a> {
        Fields {
            line: self,
            words: self.text.split_whitespace(),
        }
    }

    /// What follows the first `count` words, white space within it kept.
    fn after_words(&self, count: usize) -> &'a str {
        let mut rest = self.text;
        for _ in 0..count {
            let end = rest.find(char::is_whitespace).unwrap_or(rest.len());
            rest = rest[end..].trim_start();
        }
        rest
    }
}

/// The words of a line, read from left to right.
struct Fields<'l, 'a> {
    line: &'l Line<'a>,
    words: SplitWhitespace<'a>,
}

impl<'a> Fields<'_, 'a> {
    fn word(&mut self, what: &str) -> Result<&'a str, ColmapError> {
        self.words.next().ok_or_else(|| {
            self.line
                .malformed(format!("the line ends, expected {what}"))
        })
    }

    fn parse<T: FromStr>(&mut self, what: &str) -> Result<T, ColmapError> {
        let word = self.word(what)?;
        self.line.parse(word, what)
    }

    fn numbers<const N: usize>(&mut self, what: &str) -> Result<[f64; N], ColmapError> {
        let mut numbers = [0.0; N];
        for number in &mut numbers {
            *number = self.parse(what)?;
        }
        Ok(numbers)
    }

    fn rest<T: FromStr>(&mut self, what: &str) -> Result<Vec<T>, ColmapError> {
        let line = self.line;
        self.words
            .by_ref()
            .map(|word| line.parse(word, what))
            .collect()
    }
}

// Rust prints the shortest decimal that reads back as the same f64.

/// Writes `cameras.txt`.
pub(super) fn write_cameras(model: &Reconstruction, out: &mut dyn Write) -> io::Result<()> {
    writeln!(out, "# Camera list with one line of data per camera:")?;
    writeln!(out, "#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]")?;
    writeln!(out, "# Number of cameras: {}", model.cameras.len())?;
    for (id, camera) in &model.cameras {
        let (name, width, height) = (camera.model.name(), camera.width, camera.height);
        write!(out, "{} {name} {width} {height}", id.0)?;
        for param in &camera.params {
            write!(out, " {param}")?;
        }
        writeln!(out)?;
    }
    Ok(())
}

/// Writes `images.txt`.
pub(super) fn write_images(model: &Reconstruction, out: &mut dyn Write) -> io::Result<()> {
    writeln!(out, "# Image list with two lines of data per image:")?;
    writeln!(
        out,
        "#   IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME"
    )?;
    writeln!(out, "#   POINTS2D[] as (X, Y, POINT3D_ID)")?;
    writeln!(out, "# Number of images: {}", model.images.len())?;
    for (id, image) in &model.images {
        let [x, y, z, w] = image.camera_from_world.rotation.to_array();
        write!(out, "{} {w} {x} {y} {z}", id.0)?;
        for value in image.camera_from_world.translation.to_array() {
            write!(out, " {value}")?;
        }
        writeln!(out, " {} {}", image.camera_id.0, image.name)?;
        for (index, &Keypoint { x, y, point }) in image.keypoints.iter().enumerate() {
            let space = if index == 0 { "" } else { " " };
            match point {
                Some(point) => write!(out, "{space}{x} {y} {}", point.0)?,
                None => write!(out, "{space}{x} {y} -1")?,
            }
        }
        writeln!(out)?;
    }
    Ok(())
}

/// Writes `points3D.txt`.
pub(super) fn write_points(model: &Reconstruction, out: &mut dyn Write) -> io::Result<()> {
    writeln!(out, "# 3D point list with one line of data per point:")?;
    writeln!(
        out,
        "#   POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)"
    )?;
    writeln!(out, "# Number of points: {}", model.points.len())?;
    for (id, point) in &model.points {
        write!(out, "{}", id.0)?;
        for value in point.position.to_array() {
            write!(out, " {value}")?;
        }
        let [r, g, b] = point.color;
        write!(out, " {r} {g} {b} {}", point.error_px)?;
        for (image_id, keypoint) in &point.track {
            write!(out, " {} {keypoint}", image_id.0)?;
        }
        writeln!(out)?;
    }
    Ok(())
}
