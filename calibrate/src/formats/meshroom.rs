//! Meshroom's (AliceVision's) `.sfm` files, after `sfmDataIO/jsonIO.cpp`.
//!
//! - Every number is written as a string. A pose is the rotation camera from world, *by
//!   columns* (Eigen's order), and the camera's centre in the world; the camera has x
//!   right, y down, z forward.
//! - The principal point is an offset from the image's centre in pixels (before version
//!   1.2.1: a position). AliceVision puts the first pixel's centre at (0, 0): its
//!   undistortion reads the pixel of column i at x = i. So +0.5 brings it to ours.
//! - The focal length is in pixels before version 1.2.2, then in millimetres of a sensor
//!   of `sensorWidth`; `pixelRatio` was fx/fy before version 1.2.5, and is fy/fx since.
//! - `radial1`, `radial3`, `brown` and `fisheye4` are OpenCV's models with fewer terms.
//! - Views without a pose were not registered and are left out.

use super::build::{self, Builder};
use super::error::{FormatError, Problem};
use super::json::{self, Json};
use crate::{Camera, ImageId, ModelKind, Pixel, Point3DId, Reconstruction, Rigid3};
use glam::{DMat3, DVec3};
use std::collections::HashMap;
use std::path::Path;

/// Reads a `.sfm` file. Images have AliceVision's view ids; sparse points come from
/// `structure` where the file has one, with their tracks where it has features.
///
/// # Errors
/// An unreadable file, a pose that is no rotation, a lens that is not read here, a view
/// of a rig, two views of one name.
pub fn read_meshroom(path: &Path) -> Result<Reconstruction, FormatError> {
    parse_meshroom(path, &build::read(path)?)
}

/// Reads the content of a file; `path` is only named in errors.
///
/// # Errors
/// As for [`read_meshroom`].
pub fn parse_meshroom(path: &Path, bytes: &[u8]) -> Result<Reconstruction, FormatError> {
    let value = json::parse(path, bytes)?;
    let root = Json::root(path, &value);
    let version: [f64; 3] = root.field("version")?.numbers()?;

    let mut poses = HashMap::new();
    for item in list(&root, "poses")? {
        poses.insert(item.field("poseId")?.whole()?, read_pose(&item)?);
    }
    let mut intrinsics = HashMap::new();
    for item in list(&root, "intrinsics")? {
        intrinsics.insert(item.field("intrinsicId")?.whole()?, item);
    }

    let mut builder = Builder::new(path);
    for view in root.field("views")?.items()? {
        let stored = view.field("path")?;
        let name = build::name(stored.text()?).map_err(|p| stored.error(p))?;
        let view = view.called(&name);
        let id = view.field("viewId")?.whole()?;
        let pose_id = view
            .optional("poseId")
            .map_or(Ok(id), |pose| pose.whole())?;
        let Some(&pose) = poses.get(&pose_id) else {
            continue;
        };
        if let Some(rig) = view.optional("rigId") {
            return Err(rig.error(Problem::new(
                "the view belongs to a rig, whose poses are not read here",
                "export it with Meshroom's ConvertSfMFormat node without rigs",
            )));
        }
        let intrinsic_id = view.field("intrinsicId")?;
        let intrinsic = intrinsics.get(&intrinsic_id.whole()?).ok_or_else(|| {
            let problem = "there are no intrinsics of that id in the file";
            intrinsic_id.error(Problem::broken(problem))
        })?;
        let camera_id = builder.camera(&intrinsic.record, read_camera(intrinsic, version)?)?;
        builder.image(&view.record, ImageId(id), &name, camera_id, pose)?;
    }
    for landmark in list(&root, "structure")? {
        read_point(&mut builder, &landmark)?;
    }
    builder.finish("views")
}

/// The elements of an array that may be missing.
fn list<'a>(root: &Json<'a>, name: &str) -> Result<Vec<Json<'a>>, FormatError> {
    match root.optional(name) {
        Some(array) => Ok(array.items()?.collect()),
        None => Ok(Vec::new()),
    }
}

fn read_pose(item: &Json<'_>) -> Result<Rigid3, FormatError> {
    let transform = item.field("pose")?.field("transform")?;
    let rotation = transform.field("rotation")?;
    let camera_from_world = DMat3::from_cols_array(&rotation.numbers()?);
    let center = DVec3::from_array(transform.field("center")?.numbers()?);
    build::pose(camera_from_world.transpose(), center).map_err(|p| rotation.error(p))
}

fn read_camera(json: &Json<'_>, version: [f64; 3]) -> Result<Camera, FormatError> {
    let before = |patch: f64| version < [1.0, 2.0, patch];
    let width = json.field("width")?.whole()?;
    let height = json.field("height")?.whole()?;
    let (w, h) = (f64::from(width), f64::from(height));

    let [mut cx, mut cy] = json.field("principalPoint")?.numbers()?;
    if !before(1.0) {
        cx += w / 2.0;
        cy += h / 2.0;
    }
    let [fx, fy] = if before(0.0) {
        [json.field("pxFocalLength")?.number()?; 2]
    } else if before(2.0) {
        json.field("pxFocalLength")?.numbers()?
    } else {
        let sensor_width = json.field("sensorWidth")?.number()?;
        let fx = json.field("focalLength")?.number()? / sensor_width * w;
        let ratio = json
            .optional("pixelRatio")
            .map_or(Ok(1.0), |r| r.number())?;
        [fx, if before(5.0) { fx / ratio } else { fx * ratio }]
    };
    for key in ["undistortionOffset", "undistortionParams"] {
        if let Some(array) = json.optional(key)
            && let Ok(items) = array.items()
            && items
                .into_iter()
                .any(|item| !matches!(item.number(), Ok(0.0)))
        {
            return Err(foreign(&array, "a correction of its own for undistortion"));
        }
    }
    let (model, distortion) = read_lens(json)?;
    let mut params = vec![fx, fy, cx + 0.5, cy + 0.5];
    params.extend(distortion);
    Ok(Camera {
        model,
        width,
        height,
        params,
    })
}

/// The model and the parameters that follow the focal lengths and the centre.
fn read_lens(json: &Json<'_>) -> Result<(ModelKind, Vec<f64>), FormatError> {
    let kind = json.field("type")?;
    // Newer versions call every such lens "pinhole" and name its distortion apart.
    let name = match json.optional("distortionType") {
        Some(distortion) if kind.text()? == "pinhole" => distortion.text()?,
        _ => kind.text()?,
    };
    // An empty list is written as an empty string.
    let mut k = Vec::new();
    if let Some(array) = json.optional("distortionParams")
        && !matches!(array.text(), Ok(""))
    {
        for item in array.items()? {
            k.push(item.number()?);
        }
    }
    match (name, &k[..]) {
        ("pinhole" | "none", _) if k.iter().all(|&k| k == 0.0) => {
            Ok((ModelKind::Pinhole, Vec::new()))
        }
        ("radial1" | "radialk1", &[k1]) => Ok((ModelKind::OpenCv, vec![k1, 0.0, 0.0, 0.0])),
        ("radial3" | "radialk3", &[k1, k2, k3]) => Ok((
            ModelKind::FullOpenCv,
            vec![k1, k2, 0.0, 0.0, k3, 0.0, 0.0, 0.0],
        )),
        ("brown", &[k1, k2, k3, t1, t2]) => Ok((
            ModelKind::FullOpenCv,
            vec![k1, k2, t1, t2, k3, 0.0, 0.0, 0.0],
        )),
        ("fisheye4", &[_, _, _, _]) => Ok((ModelKind::OpenCvFisheye, k)),
        _ => Err(foreign(
            &kind,
            &format!("the lens {name:?} with {} distortion parameters", k.len()),
        )),
    }
}

fn foreign(json: &Json<'_>, found: &str) -> FormatError {
    json.error(Problem::new(
        format!(
            "found {found}, expected pinhole, radial1 (1 parameter), radial3 (3), brown (5) or \
             fisheye4 (4)"
        ),
        "undistort the photos with Meshroom's PrepareDenseScene or ExportImages node",
    ))
}

fn read_point(builder: &mut Builder<'_>, json: &Json<'_>) -> Result<(), FormatError> {
    let id = json.field("landmarkId")?.whole()?;
    let position = DVec3::from_array(json.field("X")?.numbers()?);
    let color = match json.optional("color") {
        Some(color) => color.numbers::<3>()?.map(|value| value as u8),
        None => [0; 3],
    };
    let mut observations = Vec::new();
    for observation in list(json, "observations")? {
        // Files may be saved without features: then only who sees the point is known.
        if let Some(x) = observation.optional("x") {
            let [x, y] = x.numbers()?;
            let view = observation.field("observationId")?.whole()?;
            observations.push((ImageId(view), Pixel::new(x + 0.5, y + 0.5)));
        }
    }
    let id = Point3DId(id.into());
    builder.point(&json.record, id, position, color, &observations)
}
