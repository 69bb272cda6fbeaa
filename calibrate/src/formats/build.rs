//! Puts a reconstruction together and checks what every format owes us.

use super::error::{FormatError, Problem};
use crate::{
    Camera, CameraId, Image, ImageId, Keypoint, ModelKind, Pixel, Point3D, Point3DId,
    Reconstruction, Rigid3,
};
use capture::without_byte_order_mark;
use glam::{DMat3, DVec3};
use std::collections::HashMap;
use std::path::Path;

/// How far RᵀR may be from I in any entry: files round to few digits, and single
/// precision leaves 1e-7; a matrix that scales is far beyond.
const ROTATION_TOLERANCE: f64 = 1e-4;

/// Tells a photo's width and height in pixels by the name the calibration gives it, for
/// formats that do not store them; `None` where there is no such photo.
pub type SizeOf<'a> = &'a dyn Fn(&str) -> Option<(u32, u32)>;

/// A reconstruction in the making.
pub(super) struct Builder<'a> {
    path: &'a Path,
    whole: Reconstruction,
    /// The record that took each name.
    names: HashMap<String, String>,
    /// Cameras that are the same to the last bit are one camera.
    known_cameras: HashMap<(ModelKind, u32, u32, Vec<u64>), CameraId>,
}

impl<'a> Builder<'a> {
    pub(super) fn new(path: &'a Path) -> Self {
        Self {
            path,
            whole: Reconstruction::default(),
            names: HashMap::new(),
            known_cameras: HashMap::new(),
        }
    }

    /// Adds a camera, or finds the one that is equal to it.
    pub(super) fn camera(&mut self, record: &str, camera: Camera) -> Result<CameraId, FormatError> {
        let bits = camera.params.iter().map(|value| value.to_bits()).collect();
        let key = (camera.model, camera.width, camera.height, bits);
        if let Some(&id) = self.known_cameras.get(&key) {
            return Ok(id);
        }
        camera.lens().map_err(|source| FormatError::Camera {
            path: self.path.to_owned(),
            record: record.to_owned(),
            source,
        })?;
        let id = CameraId(self.whole.cameras.len() as u32 + 1);
        self.whole.cameras.insert(id, camera);
        self.known_cameras.insert(key, id);
        Ok(id)
    }

    /// Adds an image, whose id and name must be new.
    pub(super) fn image(
        &mut self,
        record: &str,
        id: ImageId,
        name: &str,
        camera_id: CameraId,
        camera_from_world: Rigid3,
    ) -> Result<(), FormatError> {
        if let Some(earlier) = self.names.insert(name.to_owned(), record.to_owned()) {
            return Err(Problem::new(
                format!("the image is named {name:?}, as {earlier} already is"),
                "remove one of the two, or give each photo a name of its own",
            )
            .at(self.path, record));
        }
        // Finite rotations and centres may still overflow together.
        if !camera_from_world.is_finite() {
            return Err(Problem::broken(
                "the camera's centre is too far away for its pose to be finite",
            )
            .at(self.path, record));
        }
        let image = Image {
            name: name.to_owned(),
            camera_id,
            camera_from_world,
            keypoints: Vec::new(),
        };
        if self.whole.images.insert(id, image).is_some() {
            return Err(
                Problem::broken(format!("a second image has the id {}", id.0))
                    .at(self.path, record),
            );
        }
        Ok(())
    }

    /// The camera of an image that was added.
    pub(super) fn camera_of(&self, id: ImageId) -> Option<&Camera> {
        self.whole
            .cameras
            .get(&self.whole.images.get(&id)?.camera_id)
    }

    /// Adds a sparse point with the pixels that observe it. Observations by images that
    /// have no pose are left out.
    pub(super) fn point(
        &mut self,
        record: &str,
        id: Point3DId,
        position: DVec3,
        color: [u8; 3],
        observations: &[(ImageId, Pixel)],
    ) -> Result<(), FormatError> {
        let refuse = |problem: String| Err(Problem::broken(problem).at(self.path, record));
        if !position.is_finite() {
            return refuse(format!(
                "the point is at {position}, expected finite numbers"
            ));
        }
        let mut track = Vec::with_capacity(observations.len());
        for &(image_id, Pixel { x, y }) in observations {
            if !(x.is_finite() && y.is_finite()) {
                return refuse(format!(
                    "image {} observes the point at ({x}, {y}), expected finite numbers",
                    image_id.0
                ));
            }
            if let Some(image) = self.whole.images.get_mut(&image_id) {
                track.push((image_id, image.keypoints.len() as u32));
                let point = Some(id);
                image.keypoints.push(Keypoint { x, y, point });
            }
        }
        let point = Point3D {
            position,
            color,
            error_px: -1.0,
            track,
        };
        if self.whole.points.insert(id, point).is_some() {
            return refuse(format!("a second point has the id {}", id.0));
        }
        Ok(())
    }

    /// The reconstruction, which must hold an image.
    pub(super) fn finish(self, looked_for: &str) -> Result<Reconstruction, FormatError> {
        if self.whole.images.is_empty() {
            return Err(Problem::new(
                "the file holds no image with a pose",
                "export it after the cameras were computed",
            )
            .at(self.path, looked_for));
        }
        Ok(self.whole)
    }
}

/// A photo's name with `/` between its parts and without a leading `./`.
pub(super) fn name(stored: &str) -> Result<String, Problem> {
    let mut name = stored.trim().replace('\\', "/");
    while let Some(rest) = name.strip_prefix("./") {
        name = rest.trim_start_matches('/').to_owned();
    }
    if name.is_empty() || name == "." {
        return Err(Problem::broken(format!(
            "the image's name is {stored:?}, expected its photo's path"
        )));
    }
    Ok(name)
}

/// A photo's size, which must be known.
pub(super) fn size(size_of: SizeOf<'_>, name: &str) -> Result<(u32, u32), Problem> {
    size_of(name).ok_or_else(|| {
        Problem::new(
            format!("the format does not say the size of {name:?}, and no such photo was found"),
            "give the folder that holds the photos",
        )
    })
}

/// The pose of a camera by its axes (as columns: right, down, forward) and centre in the
/// world.
///
/// Axes that are a rotation only to the digits that files keep become the nearest one.
pub(super) fn pose(world_from_camera: DMat3, center: DVec3) -> Result<Rigid3, Problem> {
    let rotation = nearest_rotation(world_from_camera)?.transpose();
    if !center.is_finite() {
        return Err(Problem::broken(format!(
            "the camera's centre is {center}, expected finite numbers"
        )));
    }
    let turned =
        Rigid3::from_matrix(rotation, DVec3::ZERO, ROTATION_TOLERANCE).expect("orthonormal by now");
    Ok(Rigid3::new(turned.rotation, -(turned.rotation * center)))
}

fn nearest_rotation(matrix: DMat3) -> Result<DMat3, Problem> {
    if !matrix.is_finite() {
        return Err(Problem::broken(
            "the rotation has entries that are no finite numbers",
        ));
    }
    let worst = Rigid3::deviation(matrix);
    if !(worst <= ROTATION_TOLERANCE) {
        let gram = matrix.transpose() * matrix;
        let [x, y, z] = [gram.x_axis.x, gram.y_axis.y, gram.z_axis.z].map(f64::sqrt);
        return Err(Problem::new(
            format!(
                "the rotation's columns have the lengths {x}, {y} and {z} and RᵀR differs from \
                 the identity by up to {worst:.3e}, expected a rotation matrix"
            ),
            "take the scale or shear out of the matrix, or export it again with more digits",
        ));
    }
    if matrix.determinant() < 0.0 {
        return Err(Problem::new(
            "the rotation mirrors (its determinant is −1), expected a rotation matrix",
            "check that no axis was negated on the way",
        ));
    }
    // Newton and Schulz's iteration for the polar factor squares the deviation each time:
    // 1e-4, 1e-8, 1e-16.
    let mut rotation = matrix;
    for _ in 0..3 {
        let gram = rotation.transpose() * rotation;
        rotation = rotation * (DMat3::IDENTITY * 3.0 - gram) * 0.5;
    }
    Ok(rotation)
}

/// The bytes of a file.
pub(super) fn read(path: &Path) -> Result<Vec<u8>, FormatError> {
    std::fs::read(path).map_err(|source| FormatError::Read {
        path: path.to_owned(),
        source,
    })
}

/// A file's bytes as text, without the byte order mark that some editors put first.
pub(super) fn text<'a>(path: &Path, bytes: &'a [u8]) -> Result<&'a str, FormatError> {
    let content = without_byte_order_mark(bytes);
    str::from_utf8(content).map_err(|error| {
        let at = bytes.len() - content.len() + error.valid_up_to();
        Problem::broken("found a byte that is not UTF-8, expected text")
            .at(path, format!("byte {at}"))
    })
}
