//! LLFF's `poses_bounds.npy` (Mildenhall's `LLFF/README.md`, "Using your own poses").
//!
//! - One row of 17 numbers a photo: a 3×5 matrix by rows, then the nearest and farthest
//!   depth. The matrix is camera to world, its columns the camera's
//!   down, right and back axes, its centre, and (height, width, focal length in pixels).
//! - The principal point is the image's centre, which in our pixels is (w/2, h/2).
//! - The rows are the photos in the order of their sorted names, which are not stored.
//! - Photos are often smaller than the file says: the focal length is brought to the size
//!   they have.

use super::build::{self, Builder, SizeOf};
use super::error::{FormatError, Problem};
use crate::{Camera, ImageId, ModelKind, Reconstruction};
use glam::{DMat3, DVec3};
use std::path::Path;

const COLUMNS: usize = 17;
const MAGIC: &[u8] = b"\x93NUMPY";

/// Reads a `poses_bounds.npy` for the photos of these names, which are sorted here; without
/// any, images are called by their rows.
/// `size_of` is asked for every photo; where it knows one, the camera gets that size,
/// which must have the file's shape to within a pixel. Images are numbered from 0.
///
/// # Errors
/// An unreadable file, an array of another type or shape, another number of photos, a
/// pose that is no rotation, a camera without a lens, a photo of another shape.
pub fn read_llff(
    path: &Path,
    names: &[String],
    size_of: SizeOf<'_>,
) -> Result<Reconstruction, FormatError> {
    parse_llff(path, &build::read(path)?, names, size_of)
}

/// Reads the content of a file; `path` is only named in errors.
///
/// # Errors
/// As for [`read_llff`].
pub fn parse_llff(
    path: &Path,
    bytes: &[u8],
    names: &[String],
    size_of: SizeOf<'_>,
) -> Result<Reconstruction, FormatError> {
    let rows = rows(bytes).map_err(|problem| problem.at(path, "header"))?;
    let mut names = names.to_vec();
    names.sort();
    if names.is_empty() {
        names.extend((0..rows.len()).map(|row| format!("{row:04}")));
    }
    if rows.len() != names.len() {
        return Err(Problem::new(
            format!("found {} poses for {} photos", rows.len(), names.len()),
            "give the folder with the very photos that the poses were computed for",
        )
        .at(path, "header"));
    }

    let mut builder = Builder::new(path);
    for (index, (row, name)) in rows.iter().zip(&names).enumerate() {
        let record = format!("row {index} ({name})");
        let at = |problem: Problem| problem.at(path, record.as_str());
        let name = build::name(name).map_err(at)?;
        if row.iter().any(|value| !value.is_finite()) {
            let problem = Problem::broken(format!("found {row:?}, expected finite numbers"));
            return Err(at(problem));
        }
        let column = |j: usize| DVec3::new(row[j], row[5 + j], row[10 + j]);
        let (down, right, back) = (column(0), column(1), column(2));
        let pose = build::pose(DMat3::from_cols(right, down, -back), column(3)).map_err(at)?;
        let camera = camera(column(4), size_of(&name)).map_err(at)?;
        let camera_id = builder.camera(&record, camera)?;
        builder.image(&record, ImageId(index as u32), &name, camera_id, pose)?;
    }
    builder.finish("rows")
}

/// The nearest and farthest depth along z that each row of a `poses_bounds.npy` gives.
///
/// # Errors
/// An unreadable file, an array of another type or shape, bounds that are not 0 < near < far.
pub fn read_llff_bounds(path: &Path) -> Result<Vec<[f64; 2]>, FormatError> {
    let rows = rows(&build::read(path)?).map_err(|problem| problem.at(path, "header"))?;
    let bounds = |(index, row): (usize, &[f64; COLUMNS])| {
        let [near, far] = [row[15], row[16]];
        if near > 0.0 && near < far && far.is_finite() {
            return Ok([near, far]);
        }
        let problem = format!("the depths are {near} and {far}, expected 0 < nearest < farthest");
        Err(Problem::broken(problem).at(path, format!("row {index}")))
    };
    rows.iter().enumerate().map(bounds).collect()
}

/// The camera of (height, width, focal), brought to the photo's size.
fn camera(height_width_focal: DVec3, photo: Option<(u32, u32)>) -> Result<Camera, Problem> {
    let [height, width, focal] = height_width_focal.to_array();
    let whole = |value: f64| value.fract() == 0.0 && (1.0..=f64::from(u32::MAX)).contains(&value);
    if !(whole(height) && whole(width)) {
        return Err(Problem::broken(format!(
            "the image's height and width are {height} and {width}, expected whole numbers"
        )));
    }
    let (w, h) = photo.unwrap_or((width as u32, height as u32));
    let (w_f64, h_f64) = (f64::from(w), f64::from(h));
    let scale = w_f64 / width;
    if (height * scale - h_f64).abs() > 1.0 && (width * h_f64 / height - w_f64).abs() > 1.0 {
        return Err(Problem::new(
            format!("the photo is {w} × {h}, but the pose is for {width} × {height}"),
            "give the photos that the poses were computed for, or scaled copies of them",
        ));
    }
    Ok(Camera {
        model: ModelKind::Pinhole,
        width: w,
        height: h,
        params: vec![
            focal * scale,
            focal * h_f64 / height,
            w_f64 / 2.0,
            h_f64 / 2.0,
        ],
    })
}

/// The rows of an `.npy` file: little-endian floats, N × 17 in C order. The format is
/// described in NumPy's `numpy.lib.format`.
fn rows(bytes: &[u8]) -> Result<Vec<[f64; COLUMNS]>, Problem> {
    let cut = || Problem::broken("the file ends within its header");
    let rest = bytes.strip_prefix(MAGIC).ok_or_else(|| {
        Problem::new(
            "found no NumPy array, expected one saved with numpy.save",
            "give LLFF's poses_bounds.npy",
        )
    })?;
    let major = *rest.first().ok_or_else(cut)?;
    let length_bytes = if major == 1 { 2 } else { 4 };
    let length = rest.get(2..2 + length_bytes).ok_or_else(cut)?;
    let length = length
        .iter()
        .rev()
        .fold(0, |sum, &byte| sum << 8 | usize::from(byte));
    let rest = &rest[2 + length_bytes..];
    let header = rest.get(..length).ok_or_else(cut)?;
    let header: String = String::from_utf8_lossy(header)
        .chars()
        .filter(|c| !c.is_whitespace())
        .collect();
    let data = &rest[length..];

    let expected = "expected float64 or float32, little-endian, C order, N × 17";
    let unfit = || {
        Problem::new(
            format!("the array is {header:.200}, {expected}"),
            "save it with numpy.save(\"poses_bounds.npy\", array.astype(\"<f8\"))",
        )
    };
    let value_of = |key: &str| {
        let (_, value) = header.split_once(&format!("'{key}':"))?;
        Some(value)
    };
    let width = match value_of("descr") {
        Some(value) if value.starts_with("'<f8'") => 8,
        Some(value) if value.starts_with("'<f4'") => 4,
        _ => return Err(unfit()),
    };
    let order = value_of("fortran_order").ok_or_else(unfit)?;
    let shape = value_of("shape").and_then(|value| value.strip_prefix('('));
    let (shape, _) = shape
        .and_then(|value| value.split_once(')'))
        .ok_or_else(unfit)?;
    let count: usize = match shape.split(',').collect::<Vec<_>>()[..] {
        [count, "17"] => count.parse().map_err(|_| unfit())?,
        _ => return Err(unfit()),
    };
    if !order.starts_with("False") {
        return Err(unfit());
    }
    if count.checked_mul(COLUMNS * width) != Some(data.len()) {
        return Err(Problem::broken(format!(
            "found {} bytes of numbers, expected {count} rows of {COLUMNS} of {width} bytes",
            data.len()
        )));
    }
    let number = |bytes: &[u8]| match bytes.try_into() {
        Ok(bytes) => f64::from_le_bytes(bytes),
        Err(_) => f64::from(f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])),
    };
    let row = |bytes: &[u8]| {
        let mut row = [0.0; COLUMNS];
        for (value, bytes) in row.iter_mut().zip(bytes.chunks_exact(width)) {
            *value = number(bytes);
        }
        row
    };
    Ok(data.chunks_exact(COLUMNS * width).map(row).collect())
}
