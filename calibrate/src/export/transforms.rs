//! `transforms.json`, as nerfstudio reads it (`nerfstudio_dataparser.py`).
//!
//! Poses are camera to world in OpenGL's axes (x right, y up, z back) and the world is the
//! scene's own, so `applied_transform` is the identity. Pixels are ours. Intrinsics stand
//! at the top where all frames share a camera, else in each frame; `camera_model` always at
//! the top, where alone it is read. nerfstudio's k1, k2, p1, p2 and k3 are OpenCV's, so
//! every model without a denominator is an `OPENCV` camera, the fisheyes without further
//! terms are `OPENCV_FISHEYE`, exactly. Panoramas that go all round are `EQUIRECTANGULAR`; what nerfstudio has for
//! focal lengths is then half the width, and the height.

use super::ExportError;
use super::lens::{Terms, lens, refused, terms};
use crate::{Camera, CameraId, Image, ModelKind, Reconstruction};
use glam::DVec2;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;

const FORMAT: &str = "transforms.json";

/// The files of a frame, by their paths from the folder that `transforms.json` lies in, and its time.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameFiles {
    /// The photo.
    pub photo: String,
    /// What to ignore in it: black, as in COLMAP.
    pub mask: Option<String>,
    /// Depth along z, 16-bit grey. nerfstudio takes 1000 steps for a unit, if it is not told
    /// otherwise.
    pub depth: Option<String>,
    /// When the photo was taken, in seconds, where known.
    pub time_s: Option<f64>,
}

/// The text of a `transforms.json`: a frame for each image, in the order of their ids.
/// Sparse points have no place in it. nerfstudio wants masks for all photos or for none, and
/// so depth maps.
///
/// # Errors
/// No image; a camera without a lens, or one whose lens is no panorama's and none of OpenCV's or has a
/// denominator; a panorama of another size than its photos; fisheyes, or panoramas, beside others.
pub fn transforms_json(
    reconstruction: &Reconstruction,
    files_of: &dyn Fn(&Image) -> FrameFiles,
) -> Result<String, ExportError> {
    // 1. The cameras that took photos.
    let mut used: BTreeMap<CameraId, &Camera> = BTreeMap::new();
    for image in reconstruction.images.values() {
        used.insert(image.camera_id, &reconstruction.cameras[&image.camera_id]);
    }
    let mut intrinsics = BTreeMap::new();
    let mut kinds: BTreeMap<Kind, CameraId> = BTreeMap::new();
    for (&id, &camera) in &used {
        let (kind, keys) = keys(id, camera)?;
        kinds.entry(kind).or_insert(id);
        intrinsics.insert(id, keys);
    }
    let (&kind, &some) = kinds.last_key_value().ok_or(ExportError::NoImages)?;
    if let (Kind::Fisheye | Kind::Panorama, Some((_, &other))) = (kind, kinds.first_key_value())
        && kinds.len() > 1
    {
        return Err(ExportError::Mixed {
            camera_id: some.0,
            model: used[&some].model,
            other: other.0,
            other_model: used[&other].model,
        });
    }

    // 2. What all frames share.
    let mut whole = Map::new();
    whole.insert("camera_model".to_owned(), json!(kind.name()));
    let shared = used.len() == 1;
    if shared {
        whole.extend(intrinsics.values().flat_map(Map::clone));
    }
    whole.insert(
        "applied_transform".to_owned(),
        json!([
            [1.0, 0.0, 0.0, 0.0],
            [0.0, 1.0, 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.0]
        ]),
    );

    // 3. The frames.
    let frame = |image: &Image| {
        let FrameFiles {
            photo,
            mask,
            depth,
            time_s,
        } = files_of(image);
        let mut frame = Map::new();
        frame.insert("file_path".to_owned(), json!(photo));
        if let Some(mask) = mask {
            frame.insert("mask_path".to_owned(), json!(mask));
        }
        if let Some(depth) = depth {
            frame.insert("depth_file_path".to_owned(), json!(depth));
        }
        if let Some(time_s) = time_s {
            frame.insert("time".to_owned(), json!(time_s));
        }
        if !shared {
            frame.extend(intrinsics[&image.camera_id].clone());
        }
        frame.insert("transform_matrix".to_owned(), camera_to_world(image));
        Value::Object(frame)
    };
    let frames = reconstruction.images.values().map(frame).collect();
    whole.insert("frames".to_owned(), Value::Array(frames));
    Ok(format!("{:#}\n", Value::Object(whole)))
}

/// Nerfstudio's camera models, the simpler first.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Kind {
    Pinhole,
    OpenCv,
    Fisheye,
    Panorama,
}

impl Kind {
    fn name(self) -> &'static str {
        match self {
            Self::Pinhole => "PINHOLE",
            Self::OpenCv => "OPENCV",
            Self::Fisheye => "OPENCV_FISHEYE",
            Self::Panorama => "EQUIRECTANGULAR",
        }
    }
}

/// A camera's model and its intrinsics by their keys.
fn keys(id: CameraId, camera: &Camera) -> Result<(Kind, Map<String, Value>), ExportError> {
    if camera.model == ModelKind::Equirectangular {
        return Ok((Kind::Panorama, panorama(id, camera)?));
    }
    let (lens, terms) = terms(id, camera, FORMAT)?;
    let mut keys = shared_keys(camera, lens.focal, lens.principal).to_vec();
    let mut add = |names: &[&'static str], values: &[f64]| {
        let values = values.iter().map(|value| json!(value));
        keys.extend(names.iter().copied().zip(values));
    };
    let kind = match terms {
        Terms::Standard { k, .. } if k[3..] != [0.0; 3] => {
            let what = " with a denominator (k4, k5, k6)";
            return Err(refused(id, camera, what, FORMAT));
        }
        Terms::Standard { s, tau, .. } if s != [0.0; 4] || tau != [0.0; 2] => {
            let what = " with thin prisms or a tilted sensor";
            return Err(refused(id, camera, what, FORMAT));
        }
        Terms::Fisheye { alpha, .. } if alpha != 0.0 => {
            return Err(refused(id, camera, " with skew", FORMAT));
        }
        Terms::Standard { k, p, .. } if k == [0.0; 6] && p == [0.0; 2] => Kind::Pinhole,
        Terms::Standard { k, p, .. } => {
            add(&["k1", "k2", "p1", "p2"], &[k[0], k[1], p[0], p[1]]);
            if k[2] != 0.0 {
                add(&["k3"], &k[2..3]);
            }
            Kind::OpenCv
        }
        Terms::Fisheye { k, .. } => {
            add(&["k1", "k2", "k3", "k4"], &k);
            Kind::Fisheye
        }
    };
    let keys = keys.into_iter().map(|(key, value)| (key.to_owned(), value));
    Ok((kind, keys.collect()))
}

/// The intrinsics of a panorama, which goes all round.
fn panorama(id: CameraId, camera: &Camera) -> Result<Map<String, Value>, ExportError> {
    lens(id, camera)?;
    let size = DVec2::new(f64::from(camera.width), f64::from(camera.height));
    if camera.params != size.to_array() {
        return Err(refused(
            id,
            camera,
            " of another size than its photos",
            FORMAT,
        ));
    }
    let keys = shared_keys(camera, DVec2::new(0.5 * size.x, size.y), 0.5 * size);
    let keys = keys.into_iter().map(|(key, value)| (key.to_owned(), value));
    Ok(keys.collect())
}

/// The intrinsics that cameras of all kinds have, in pixels.
fn shared_keys(camera: &Camera, focal: DVec2, principal: DVec2) -> [(&'static str, Value); 6] {
    [
        ("w", json!(camera.width)),
        ("h", json!(camera.height)),
        ("fl_x", json!(focal.x)),
        ("fl_y", json!(focal.y)),
        ("cx", json!(principal.x)),
        ("cy", json!(principal.y)),
    ]
}

/// The rows of world from camera, OpenGL's y and z being ours turned round.
fn camera_to_world(image: &Image) -> Value {
    let r = image.camera_from_world.matrix().transpose();
    let center = image.camera_from_world.center();
    let row = |i: usize| {
        let r = r.row(i);
        json!([r.x, -r.y, -r.z, center[i]])
    };
    json!([row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]])
}
