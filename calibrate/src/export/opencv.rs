//! A calibration as OpenCV's `calibration.cpp` writes it: `FileStorage` YAML 1.0.
//!
//! OpenCV puts the first pixel's centre at (0, 0), half a pixel less than we do. A pose is
//! a row of `extrinsic_parameters`: rotation vector, translation. The photos' names, in
//! the order of the rows, are under `images`.

use super::ExportError;
use super::lens::{Terms, terms};
use crate::{Image, Point3D, Reconstruction, Rigid3};
use glam::DVec3;
use std::collections::BTreeSet;
use std::fmt::Write;

/// The text of an OpenCV calibration: one camera and the poses of all images, in the order
/// of their ids. Where every image observes every sparse point, as those of a calibration
/// board, these are written too (`grid_points`, `image_points`).
///
/// # Errors
/// No image, several cameras, a camera without a lens or one whose lens is none of OpenCV's.
pub fn opencv_yaml(
    reconstruction: &Reconstruction,
    path_of: &dyn Fn(&Image) -> String,
) -> Result<String, ExportError> {
    let images: Vec<&Image> = reconstruction.images.values().collect();
    let used: BTreeSet<_> = images.iter().map(|image| image.camera_id).collect();
    let id = *used.first().ok_or(ExportError::NoImages)?;
    if used.len() > 1 {
        return Err(ExportError::Cameras(used.len()));
    }
    let camera = &reconstruction.cameras[&id];
    let (lens, terms) = terms(id, camera, "OpenCV's calibration file")?;
    let (is_fisheye, coefficients, skew) = match terms {
        // 5 as OpenCV's own programs write them, more where the further ones are needed.
        Terms::Standard { k, p, s, tau } => {
            let all = [&k[..2], &p, &k[2..], &s, &tau].concat();
            let is_enough = |count: &usize| all[*count..].iter().all(|term| *term == 0.0);
            let count = [5, 8, 12].into_iter().find(is_enough).unwrap_or(14);
            (false, all[..count].to_vec(), 0.0)
        }
        Terms::Fisheye { k, alpha } => (true, k.to_vec(), alpha * lens.focal.x),
    };
    let (focal, principal) = (lens.focal, lens.principal - 0.5);
    #[rustfmt::skip]
    let matrix = [
        focal.x, skew, principal.x,
        0.0, focal.y, principal.y,
        0.0, 0.0, 1.0,
    ];
    let rows: Vec<f64> = images
        .iter()
        .flat_map(|image| rotation_and_translation(&image.camera_from_world))
        .collect();

    let mut yaml = Yaml("%YAML:1.0\n---\n".to_owned());
    yaml.value("nframes", images.len());
    yaml.value("image_width", camera.width);
    yaml.value("image_height", camera.height);
    // Of pixels as stored, which OpenCV turns as EXIF data say unless it is told not to.
    yaml.value("ignore_orientation", 1);
    yaml.value("fisheye_model", u8::from(is_fisheye));
    yaml.matrix("camera_matrix", (3, 3, 1), &matrix);
    let shape = (coefficients.len(), 1, 1);
    yaml.matrix("distortion_coefficients", shape, &coefficients);
    yaml.matrix("extrinsic_parameters", (images.len(), 6, 1), &rows);
    yaml.texts("images", images.iter().map(|image| path_of(image)));
    if let Some((corners, found)) = board(reconstruction) {
        let count = corners.len() / 3;
        yaml.matrix("grid_points", (1, count, 3), &corners);
        yaml.matrix("image_points", (images.len(), count, 2), &found);
    }
    Ok(yaml.0)
}

/// Whether [`opencv_yaml`] writes the sparse points: those of a calibration board.
pub fn has_board(reconstruction: &Reconstruction) -> bool {
    board(reconstruction).is_some()
}

/// OpenCV's six numbers of a pose: the rotation's axis times its angle, the translation.
fn rotation_and_translation(camera_from_world: &Rigid3) -> [f64; 6] {
    let mut rotation = camera_from_world.rotation;
    // Of the two quaternions, that of the smaller angle.
    if rotation.w < 0.0 {
        rotation = -rotation;
    }
    let sin = rotation.xyz().length();
    let angle_per_sin = if sin > 0.0 {
        2.0 * sin.atan2(rotation.w) / sin
    } else {
        2.0
    };
    let [a, b, c] = (rotation.xyz() * angle_per_sin).to_array();
    let [x, y, z] = camera_from_world.translation.to_array();
    [a, b, c, x, y, z]
}

/// The points' positions, and for each image their pixels in OpenCV's convention; `None`
/// where not every image observes every point, once.
fn board(reconstruction: &Reconstruction) -> Option<(Vec<f64>, Vec<f64>)> {
    let Reconstruction { images, points, .. } = reconstruction;
    let in_all = |point: &Point3D| {
        let by: BTreeSet<_> = point.track.iter().map(|(id, _)| id).collect();
        by.len() == images.len() && point.track.len() == images.len()
    };
    if points.is_empty() || !points.values().all(in_all) {
        return None;
    }
    let corners = points.values().map(|point| point.position);
    let corners = corners.flat_map(|position: DVec3| position.to_array());
    let mut found = Vec::new();
    for id in images.keys() {
        for point in points.values() {
            let (_, index) = point.track.iter().find(|(image_id, _)| image_id == id)?;
            let keypoint = images[id].keypoints.get(*index as usize)?;
            found.extend([keypoint.x - 0.5, keypoint.y - 0.5]);
        }
    }
    Some((corners.collect(), found))
}

/// The text in the making. `{:?}` prints a number with as many digits as it takes, and
/// always a point or an exponent, without which OpenCV would take it for an integer.
struct Yaml(String);

impl Yaml {
    fn value(&mut self, key: &str, value: impl std::fmt::Display) {
        let _ = writeln!(self.0, "{key}: {value}");
    }

    fn matrix(
        &mut self,
        key: &str,
        (rows, cols, channels): (usize, usize, usize),
        numbers: &[f64],
    ) {
        let dt = match channels {
            1 => "d".to_owned(),
            // In quotes, as OpenCV writes it: else it reads a number and stops at the letter.
            channels => format!("\"{channels}d\""),
        };
        let _ = write!(
            self.0,
            "{key}: !!opencv-matrix\n   rows: {rows}\n   cols: {cols}\n   dt: {dt}\n   data: ["
        );
        for (i, number) in numbers.iter().enumerate() {
            let comma = if i == 0 { "" } else { "," };
            // OpenCV's reader wants lines of less than a few thousand characters.
            let space = if i > 0 && i % 6 == 0 {
                "\n       "
            } else {
                " "
            };
            let _ = write!(self.0, "{comma}{space}{number:?}");
        }
        self.0 += " ]\n";
    }

    fn texts(&mut self, key: &str, texts: impl Iterator<Item = String>) {
        let _ = writeln!(self.0, "{key}:");
        for text in texts {
            let escaped = text
                .replace('\\', r"\\")
                .replace('"', "\\\"")
                .replace('\n', r"\n");
            let _ = writeln!(self.0, "   - \"{escaped}\"");
        }
    }
}
