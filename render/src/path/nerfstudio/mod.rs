//! Camera paths of nerfstudio: what its viewer's render tab writes and `ns-render camera-path`
//! reads, of both generations of the viewer.
//!
//! Frames are `camera_path`: poses as `camera_to_world` (row by row, OpenGL's axes: x right, y up,
//! z back) with a vertical field of view in degrees; one size for all. `keyframes` serve the viewer
//! alone. Its world is the dataset's after the dataparser turned, moved and scaled it, which
//! `dataparser_transforms.json` in the output folder tells.
//!
//! `render_time`, which runs from 0 to 1 over a capture whose seconds it does not know, is neither
//! read nor written.

mod read;
mod write;

pub(super) use read::{frames, is_nerfstudio, keyframes};
pub use write::write_nerfstudio;

use super::file::{PathFileError, ROTATION_TOLERANCE, pose_of_matrix};
use calibrate::Rigid3;
use capture::without_byte_order_mark;
use glam::{DMat3, DVec3};
use serde::Deserialize;
use std::path::Path;

/// How nerfstudio's world lies: a point of it is `scale` times the moved point of ours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NerfstudioFrame {
    /// Turns and moves, before the scale.
    moved_from_world: Rigid3,
    scale: f64,
}

impl Default for NerfstudioFrame {
    /// The same world.
    fn default() -> Self {
        Self {
            moved_from_world: Rigid3::IDENTITY,
            scale: 1.0,
        }
    }
}

/// `dataparser_transforms.json`.
#[derive(Deserialize)]
struct StoredTransform {
    /// 3 × 4, row by row.
    transform: Vec<Vec<f64>>,
    scale: f64,
}

impl NerfstudioFrame {
    /// Reads `dataparser_transforms.json`.
    ///
    /// # Errors
    /// It cannot be read; it does not hold a rotation, a translation and a scale.
    pub fn read(path: &Path) -> Result<Self, PathFileError> {
        let bytes = std::fs::read(path).map_err(|e| PathFileError::Io(path.to_owned(), e))?;
        let bad = |reason: String| {
            let reason = format!(
                "{reason}; expected nerfstudio's dataparser_transforms.json: {{\"transform\": 3 \
                 rows of 4, \"scale\": s}}"
            );
            PathFileError::Nerfstudio(path.to_owned(), reason)
        };
        let text = without_byte_order_mark(&bytes);
        let stored: StoredTransform =
            serde_json::from_slice(text).map_err(|e| bad(e.to_string()))?;
        let rows = stored.transform;
        if rows.len() != 3 || rows.iter().any(|row| row.len() != 4) {
            return Err(bad("transform is not 3 × 4".to_owned()));
        }
        let row = |r: usize| DVec3::new(rows[r][0], rows[r][1], rows[r][2]);
        let rotation = DMat3::from_cols(row(0), row(1), row(2)).transpose();
        let translation = DVec3::new(rows[0][3], rows[1][3], rows[2][3]);
        let Some(moved_from_world) = Rigid3::from_matrix(rotation, translation, ROTATION_TOLERANCE)
        else {
            return Err(bad("transform does not begin with a rotation".to_owned()));
        };
        if !(stored.scale > 0.0 && stored.scale.is_finite()) {
            return Err(bad(format!("scale is {}, not above zero", stored.scale)));
        }
        Ok(Self {
            moved_from_world,
            scale: stored.scale,
        })
    }

    /// A `camera_from_world` of a rotation from OpenGL's camera to nerfstudio's world, and a centre
    /// there. `None` of what is no rotation.
    fn camera_from_world(&self, c2w: DMat3, center: DVec3) -> Option<Rigid3> {
        let moved_from_camera = DMat3::from_cols(c2w.x_axis, -c2w.y_axis, -c2w.z_axis);
        let center = center / self.scale;
        let turn = self.moved_from_world.matrix();
        // Without a turn nothing is rounded.
        let (world_from_camera, center) = match *self == Self::default() {
            true => (moved_from_camera, center),
            false => (
                turn.transpose() * moved_from_camera,
                self.moved_from_world.inverse() * center,
            ),
        };
        let rotation = world_from_camera.transpose();
        pose_of_matrix(rotation, -(rotation * center))
    }

    /// The 4 × 4 matrix `camera_to_world`, row by row.
    fn camera_to_world(&self, camera_from_world: &Rigid3) -> [f64; 16] {
        let mut world_from_camera = camera_from_world.matrix().transpose();
        let mut center = camera_from_world.center();
        if *self != Self::default() {
            world_from_camera = self.moved_from_world.matrix() * world_from_camera;
            center = self.scale * (self.moved_from_world * center);
        }
        let [x, y, z] = [
            world_from_camera.x_axis,
            -world_from_camera.y_axis,
            -world_from_camera.z_axis,
        ];
        [
            x.x, y.x, z.x, center.x, //
            x.y, y.y, z.y, center.y, //
            x.z, y.z, z.z, center.z, //
            0.0, 0.0, 0.0, 1.0,
        ]
    }
}

/// Seconds from one keyframe to the next where a file does not say: the viewer's own.
const TRANSITION_S: f64 = 2.0;

#[cfg(test)]
mod tests;
