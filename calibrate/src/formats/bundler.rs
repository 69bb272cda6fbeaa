//! Bundler's `bundle.out` with its `list.txt` (Snavely's user's manual, "Output format").
//!
//! - A camera has x right, y up and looks along −z; R and t map the world to it.
//! - A point P = R·X + t falls on p = −P/P_z, then f·(1 + k₁|p|² + k₂|p|⁴)·p, relative to
//!   the image's centre, y up: COLMAP's RADIAL with the principal point at (w/2, h/2). The
//!   origin is the centre of the image however one counts its pixels, so there is no half
//!   pixel to shift.
//! - The file knows no names and no sizes: names are the lines of the list, which lies
//!   beside it (`list.txt`, or `NAME.list.txt` as COLMAP calls it) or one folder up.
//! - A camera that was not registered is all zeros. It is left out, and its observations.

use super::build::{self, Builder, SizeOf};
use super::error::{FormatError, Problem};
use super::words::{WORD, Words};
use crate::excerpt::excerpt;
use crate::{Camera, ImageId, ModelKind, Pixel, Point3DId, Reconstruction};
use glam::{DMat3, DVec3};
use std::path::{Path, PathBuf};

const HEADER: &str = "# Bundle file v0.";

/// Reads a `bundle.out` and its list. Images are numbered from 0, as in the file, and so
/// are points; keypoints are in the order of the points that they observe. `size_of` is
/// asked for every image.
///
/// # Errors
/// An unreadable file, a list that is missing or of another length, a pose that is no
/// rotation, a camera without a lens, a photo of unknown size, two photos of one name.
pub fn read_bundler(path: &Path, size_of: SizeOf<'_>) -> Result<Reconstruction, FormatError> {
    let bytes = build::read(path)?;
    let list = find_list(path)?;
    parse_bundler(path, &bytes, (&list, &build::read(&list)?), size_of)
}

/// Reads the content of a `bundle.out` and of its list; the paths are only named in errors.
///
/// # Errors
/// As for [`read_bundler`].
pub fn parse_bundler(
    path: &Path,
    bytes: &[u8],
    list: (&Path, &[u8]),
    size_of: SizeOf<'_>,
) -> Result<Reconstruction, FormatError> {
    let mut words = Words::new(path, build::text(path, bytes)?);
    let header = words.line().unwrap_or_default();
    if !header.starts_with(HEADER) {
        let problem = format!("found {}, expected \"{HEADER}3\"", excerpt(header, WORD));
        return Err(words.error("header", Problem::broken(problem)));
    }
    let camera_count: usize = words.parse("header", "the number of cameras")?;
    let point_count: u64 = words.parse("header", "the number of points")?;
    let names = names(list)?;
    if names.len() != camera_count {
        return Err(words.error(
            "header",
            Problem::new(
                format!(
                    "found {camera_count} cameras, but the list has {} photos",
                    names.len()
                ),
                "put the list that this model was made from beside it, as list.txt",
            ),
        ));
    }

    let mut builder = Builder::new(path);
    for (index, name) in names.iter().enumerate() {
        let of = format!("camera {index}, {name}");
        read_camera(&mut words, &mut builder, &of, index as u32, name, size_of)?;
    }
    for id in 0..point_count {
        read_point(&mut words, &mut builder, id, camera_count)?;
    }
    if let Some(word) = words.next() {
        let found = excerpt(word, WORD);
        let problem = format!("found {found}, expected the end after {point_count} points");
        return Err(words.error("end", Problem::broken(problem)));
    }
    builder.finish("cameras")
}

fn read_camera(
    words: &mut Words<'_>,
    builder: &mut Builder<'_>,
    of: &str,
    index: u32,
    name: &str,
    size_of: SizeOf<'_>,
) -> Result<(), FormatError> {
    let [f, k1, k2] = words.numbers(of, "a focal length, k1 and k2")?;
    let place = words.place(of);
    let rows: [f64; 9] = words.numbers(of, "the rotation's nine numbers")?;
    let translation = DVec3::from_array(words.numbers(of, "the translation's three numbers")?);
    if f == 0.0 && rows == [0.0; 9] {
        return Ok(());
    }
    // Rows of R are the camera's axes in the world: right, up, back.
    let right_up_back = DMat3::from_cols_array(&rows);
    let center = -(right_up_back * translation);
    let axes = DMat3::from_cols(
        right_up_back.x_axis,
        -right_up_back.y_axis,
        -right_up_back.z_axis,
    );
    let pose = build::pose(axes, center).map_err(|problem| words.error(of, problem))?;
    let (width, height) = build::size(size_of, name).map_err(|problem| words.error(of, problem))?;
    let camera = Camera {
        model: ModelKind::Radial,
        width,
        height,
        params: vec![f, f64::from(width) / 2.0, f64::from(height) / 2.0, k1, k2],
    };
    let camera_id = builder.camera(&place, camera)?;
    builder.image(&place, ImageId(index), name, camera_id, pose)
}

fn read_point(
    words: &mut Words<'_>,
    builder: &mut Builder<'_>,
    id: u64,
    camera_count: usize,
) -> Result<(), FormatError> {
    let of = format!("point {id}");
    let position = DVec3::from_array(words.numbers(&of, "a position of three numbers")?);
    let color = words.color(&of)?;
    let views: u64 = words.parse(&of, "the number of views")?;
    let mut observations = Vec::new();
    for _ in 0..views {
        let camera: u32 = words.parse(&of, "a camera's number")?;
        let _key: u64 = words.parse(&of, "a keypoint's number")?;
        let [x, y] = words.numbers(&of, "a keypoint's x and y")?;
        if camera as usize >= camera_count {
            let problem = format!("found camera {camera}, expected less than {camera_count}");
            return Err(words.error(&of, Problem::broken(problem)));
        }
        let id = ImageId(camera);
        // An image without a pose has no camera; the builder leaves its pixel out.
        let (width, height) = builder
            .camera_of(id)
            .map_or((0, 0), |camera| (camera.width, camera.height));
        let (x, y) = (f64::from(width) / 2.0 + x, f64::from(height) / 2.0 - y);
        observations.push((id, Pixel::new(x, y)));
    }
    let place = words.place(&of);
    builder.point(&place, Point3DId(id), position, color, &observations)
}

/// Where the list of the photos lies.
fn find_list(bundle: &Path) -> Result<PathBuf, FormatError> {
    let folder = bundle.parent().unwrap_or(Path::new(""));
    let stem = bundle.file_stem().unwrap_or_default().to_string_lossy();
    let places: [PathBuf; 3] = [
        folder.join("list.txt"),
        folder.join(format!("{}.list.txt", stem.trim_end_matches(".bundle"))),
        folder.join("..").join("list.txt"),
    ];
    let list = places.iter().find(|place| place.is_file());
    list.cloned().ok_or_else(|| {
        let looked: Vec<_> = places.iter().map(|p| p.display().to_string()).collect();
        Problem::new(
            format!(
                "the format does not name the photos, and there is no list of them ({})",
                looked.join(", ")
            ),
            "put Bundler's list.txt beside the file",
        )
        .at(bundle, "header")
    })
}

/// The photos' names, one a line. A line may end with Bundler's "0 FOCAL".
fn names((list, bytes): (&Path, &[u8])) -> Result<Vec<String>, FormatError> {
    let mut names = Vec::new();
    for (index, line) in capture::lines(build::text(list, bytes)?).enumerate() {
        if line.trim().is_empty() {
            continue;
        }
        let name = build::name(without_focal(line.trim()))
            .map_err(|problem| problem.at(list, format!("line {}", index + 1)))?;
        names.push(name);
    }
    Ok(names)
}

/// A line without Bundler's "0 FOCAL" (or a lone "0") at its end. Names may have spaces.
fn without_focal(line: &str) -> &str {
    let split = |text: &'_ str| {
        text.trim_end()
            .rsplit_once(char::is_whitespace)
            .map(|(a, b)| (a.len(), b.to_owned()))
    };
    match split(line) {
        Some((end, zero)) if zero == "0" => line[..end].trim_end(),
        Some((end, focal)) if focal.parse::<f64>().is_ok() => match split(&line[..end]) {
            Some((end, zero)) if zero == "0" => line[..end].trim_end(),
            _ => line,
        },
        _ => line,
    }
}
