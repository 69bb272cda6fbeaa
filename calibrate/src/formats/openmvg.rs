//! OpenMVG's `sfm_data.json`, after its documentation ("sfm/sfm_data", "cameras") and
//! `sfm_data_io_cereal.cpp`.
//!
//! - The file is cereal's: maps are arrays of {key, value}, and a polymorphic value names
//!   its type only where the type is first met (`polymorphic_name`); later ones repeat the
//!   lower 31 bits of its `polymorphic_id`.
//! - A pose (`extrinsics`) is the rotation camera from world, by rows, and the camera's
//!   centre in the world; the camera has x right, y down, z forward.
//! - OpenMVG puts the first pixel's centre at (0, 0): its undistortion reads the pixel of
//!   column i at x = i. So +0.5 brings the principal point and keypoints to ours.
//! - `pinhole_radial_k1`, `_k3`, `pinhole_brown_t2` and `fisheye` are OpenCV's models with
//!   fewer terms; focal lengths are in pixels.
//! - Views without a pose or intrinsics were not registered and are left out.

use super::build::{self, Builder};
use super::error::{FormatError, Problem};
use super::json::{self, Json};
use crate::{Camera, CameraId, ImageId, ModelKind, Pixel, Point3DId, Reconstruction, Rigid3};
use glam::{DMat3, DVec3};
use std::collections::HashMap;
use std::path::Path;

/// Set in a polymorphic id where the type's name stands beside it.
const NAMED: u32 = 1 << 31;

/// Reads a `sfm_data.json`. Images have OpenMVG's view ids, and names relative to its
/// `root_path`; sparse points come from `structure`.
///
/// # Errors
/// An unreadable file, a pose that is no rotation, a lens that is not read here, two
/// views of one name.
pub fn read_openmvg(path: &Path) -> Result<Reconstruction, FormatError> {
    parse_openmvg(path, &build::read(path)?)
}

/// Reads the content of a file; `path` is only named in errors.
///
/// # Errors
/// As for [`read_openmvg`].
pub fn parse_openmvg(path: &Path, bytes: &[u8]) -> Result<Reconstruction, FormatError> {
    let value = json::parse(path, bytes)?;
    let root = Json::root(path, &value);
    let mut builder = Builder::new(path);

    let mut poses = HashMap::new();
    for item in root.field("extrinsics")?.items()? {
        let pose = read_pose(&item.field("value")?)?;
        poses.insert(item.field("key")?.whole()?, pose);
    }
    let cameras = read_cameras(&root, &mut builder)?;
    for item in root.field("views")?.items()? {
        let data = item.field("value")?.field("ptr_wrapper")?.field("data")?;
        let stored = data.field("filename")?;
        let folder = data
            .optional("local_path")
            .map_or(Ok(""), |folder| folder.text())?;
        let folder = folder.trim_matches(['/', '\\']);
        let name = build::name(&format!("{folder}/{}", stored.text()?))
            .map(|name| name.trim_start_matches('/').to_owned())
            .map_err(|problem| stored.error(problem))?;
        let data = data.called(&name);
        let id = data.field("id_view")?.whole()?;
        let pose = poses.get(&data.field("id_pose")?.whole()?);
        let camera = cameras.get(&data.field("id_intrinsic")?.whole()?);
        if let (Some(&pose), Some(&camera_id)) = (pose, camera) {
            builder.image(&data.record, ImageId(id), &name, camera_id, pose)?;
        }
    }
    if let Some(structure) = root.optional("structure") {
        for item in structure.items()? {
            read_point(&mut builder, &item)?;
        }
    }
    builder.finish("views")
}

fn read_pose(value: &Json<'_>) -> Result<Rigid3, FormatError> {
    let rotation = value.field("rotation")?;
    let [x, y, z] = rotation.exactly::<3>()?;
    let axes = [x.numbers()?, y.numbers()?, z.numbers()?].map(DVec3::from_array);
    let center = DVec3::from_array(value.field("center")?.numbers()?);
    // Rows of camera from world are the camera's axes in the world.
    let [x, y, z] = axes;
    build::pose(DMat3::from_cols(x, y, z), center).map_err(|p| rotation.error(p))
}

/// Reads `intrinsics` and tells which camera each key became.
fn read_cameras(
    root: &Json<'_>,
    builder: &mut Builder<'_>,
) -> Result<HashMap<u32, CameraId>, FormatError> {
    let mut names: HashMap<u32, &str> = HashMap::new();
    let mut cameras = HashMap::new();
    for item in root.field("intrinsics")?.items()? {
        let value = item.field("value")?;
        let id = value.field("polymorphic_id")?;
        if let Some(name) = value.optional("polymorphic_name") {
            names.insert(id.whole()? & !NAMED, name.text()?);
        }
        let name = names.get(&(id.whole()? & !NAMED)).ok_or_else(|| {
            let problem = "found a type that no earlier entry names, expected polymorphic_name";
            id.error(Problem::broken(problem))
        })?;
        let data = value.field("ptr_wrapper")?.field("data")?;
        let camera = read_camera(name, &value, &data)?;
        let camera_id = builder.camera(&data.record, camera)?;
        cameras.insert(item.field("key")?.whole()?, camera_id);
    }
    Ok(cameras)
}

fn read_camera(name: &str, value: &Json<'_>, data: &Json<'_>) -> Result<Camera, FormatError> {
    let (model, distortion) = match name {
        "pinhole" => (ModelKind::Pinhole, Vec::new()),
        "pinhole_radial_k1" => {
            let [k1] = data.field("disto_k1")?.numbers()?;
            (ModelKind::OpenCv, vec![k1, 0.0, 0.0, 0.0])
        }
        "pinhole_radial_k3" => {
            let [k1, k2, k3] = data.field("disto_k3")?.numbers()?;
            let k = vec![k1, k2, 0.0, 0.0, k3, 0.0, 0.0, 0.0];
            (ModelKind::FullOpenCv, k)
        }
        "pinhole_brown_t2" => {
            let [k1, k2, k3, t1, t2] = data.field("disto_t2")?.numbers()?;
            let k = vec![k1, k2, t1, t2, k3, 0.0, 0.0, 0.0];
            (ModelKind::FullOpenCv, k)
        }
        "fisheye" => {
            let k: [f64; 4] = data.field("fisheye")?.numbers()?;
            (ModelKind::OpenCvFisheye, k.to_vec())
        }
        _ => {
            return Err(value.error(Problem::new(
                format!(
                    "found the lens {name:?}, expected pinhole, pinhole_radial_k1, \
                     pinhole_radial_k3, pinhole_brown_t2 or fisheye"
                ),
                "undistort the photos with openMVG_main_ExportUndistortedImages",
            )));
        }
    };
    let focal = data.field("focal_length")?.number()?;
    let [cx, cy] = data.field("principal_point")?.numbers()?;
    let mut params = vec![focal, focal, cx + 0.5, cy + 0.5];
    params.extend(distortion);
    Ok(Camera {
        model,
        width: data.field("width")?.whole()?,
        height: data.field("height")?.whole()?,
        params,
    })
}

fn read_point(builder: &mut Builder<'_>, item: &Json<'_>) -> Result<(), FormatError> {
    let id = Point3DId(item.field("key")?.whole()?.into());
    let value = item.field("value")?;
    let position = DVec3::from_array(value.field("X")?.numbers()?);
    let mut observations = Vec::new();
    for observation in value.field("observations")?.items()? {
        let view = observation.field("key")?.whole()?;
        let [x, y] = observation.field("value")?.field("x")?.numbers()?;
        observations.push((ImageId(view), Pixel::new(x + 0.5, y + 0.5)));
    }
    // OpenMVG keeps no colours.
    builder.point(&item.record, id, position, [0; 3], &observations)
}
