//! What both formats ask of a record, and of the three files together.

use super::ColmapError;
use crate::{Camera, CameraId, Image, ImageId, Keypoint, Point3DId, Reconstruction, Rigid3};
use glam::{DQuat, DVec3};
use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

/// How far from 1 a stored quaternion's length may be: hand-written ones have few digits.
const QUATERNION_TOLERANCE: f64 = 1e-3;
/// A quaternion this close to unit length is kept to the last bit, so that a model that
/// is read and written stays the same.
const ALREADY_UNIT: f64 = 1e-14;

/// The pose of a stored quaternion (scalar first) and translation, or what is wrong.
pub(super) fn pose(wxyz: [f64; 4], translation: [f64; 3]) -> Result<Rigid3, String> {
    let [w, x, y, z] = wxyz;
    let rotation = DQuat::from_xyzw(x, y, z, w);
    let translation = DVec3::from_array(translation);
    if !rotation.is_finite() {
        return Err(format!(
            "the rotation is ({w}, {x}, {y}, {z}), expected four finite numbers"
        ));
    }
    if !translation.is_finite() {
        return Err(format!(
            "the translation is {translation}, expected three finite numbers"
        ));
    }
    let length = rotation.length();
    if !((length - 1.0).abs() <= QUATERNION_TOLERANCE) {
        return Err(format!(
            "the rotation's quaternion ({w}, {x}, {y}, {z}) has length {length}, expected 1"
        ));
    }
    Ok(if (length - 1.0).abs() <= ALREADY_UNIT {
        Rigid3 {
            rotation,
            translation,
        }
    } else {
        Rigid3::new(rotation, translation)
    })
}

/// A photo's name with `/` between its parts, or what is wrong with it.
pub(super) fn name(stored: &str) -> Result<String, String> {
    if stored.trim().is_empty() {
        return Err("the image has no name, expected its photo's path".to_owned());
    }
    Ok(stored.replace('\\', "/"))
}

/// A keypoint, or what is wrong with it.
pub(super) fn keypoint(
    index: usize,
    x: f64,
    y: f64,
    point: Option<Point3DId>,
) -> Result<Keypoint, String> {
    if !(x.is_finite() && y.is_finite()) {
        return Err(format!(
            "keypoint {index} is at ({x}, {y}), expected finite numbers"
        ));
    }
    Ok(Keypoint { x, y, point })
}

/// A point's position, or what is wrong with it.
pub(super) fn position(id: u64, xyz: [f64; 3]) -> Result<DVec3, String> {
    let position = DVec3::from_array(xyz);
    if !position.is_finite() {
        return Err(format!(
            "point {id} is at {position}, expected three finite numbers"
        ));
    }
    Ok(position)
}

/// A point's reprojection error, or −1 (never computed) for what is not a number.
pub(super) fn error_px(stored: f64) -> f64 {
    if stored.is_finite() { stored } else { -1.0 }
}

/// Adds a record under its id, which must be new.
pub(super) fn insert<Id: Copy + Ord + Into<u64>, Record>(
    records: &mut BTreeMap<Id, Record>,
    kind: &str,
    id: Id,
    record: Record,
) -> Result<(), String> {
    match records.insert(id, record) {
        None => Ok(()),
        Some(_) => Err(twice(kind, id)),
    }
}

/// Checks that every camera has a lens.
pub(super) fn lenses(cameras: &BTreeMap<CameraId, Camera>, path: &Path) -> Result<(), ColmapError> {
    for (&id, camera) in cameras {
        camera.lens().map_err(|source| ColmapError::Camera {
            path: path.to_owned(),
            camera_id: id.0,
            source,
        })?;
    }
    Ok(())
}

/// What is wrong with two records of one id.
pub(super) fn twice(kind: &str, id: impl Into<u64>) -> String {
    format!("{kind} {} is there twice, expected once", id.into())
}

/// Finds records by id: at once where ids leave few numbers out, as COLMAP's do, else as
/// the map does. Millions of observations each ask for two.
struct Lookup<'a, Id, Record> {
    records: &'a BTreeMap<Id, Record>,
    /// By id, where that is not much longer than `records`.
    table: Vec<Option<&'a Record>>,
}

impl<'a, Id: Copy + Ord + Into<u64>, Record> Lookup<'a, Id, Record> {
    fn new(records: &'a BTreeMap<Id, Record>) -> Self {
        let last = records.last_key_value().map_or(0, |(&id, _)| index(id));
        let mut table = Vec::new();
        if last / 8 <= records.len() {
            table.resize(last + 1, None);
            for (&id, record) in records {
                table[index(id)] = Some(record);
            }
        }
        Self { records, table }
    }

    fn get(&self, id: Id) -> Option<&'a Record> {
        match self.table.get(index(id)) {
            Some(&found) => found,
            None => self.records.get(&id),
        }
    }
}

/// An id as an index; the last one of all where it is too large for one.
fn index(id: impl Into<u64>) -> usize {
    usize::try_from(id.into()).unwrap_or(usize::MAX)
}

/// Checks what only the three `files` together can show.
pub(super) fn references(
    reconstruction: &Reconstruction,
    files: &[PathBuf; 3],
) -> Result<(), ColmapError> {
    let Reconstruction {
        cameras,
        images,
        points,
    } = reconstruction;
    let [cameras_path, images_path, points_path] = files;

    lenses(cameras, cameras_path)?;
    let image_of = Lookup::new(images);
    let point_of = Lookup::new(points);
    if images.is_empty() {
        return Err(ColmapError::NoImages {
            path: images_path.clone(),
        });
    }
    let mut names: HashMap<&str, ImageId> = HashMap::new();
    for (&id, image) in images {
        let called = || format!("image {} ({:?})", id.0, image.name);
        if let Some(earlier) = names.insert(&image.name, id) {
            return Err(inconsistent(
                images_path,
                format!(
                    "images {} and {} are both named {:?}",
                    earlier.0, id.0, image.name
                ),
            ));
        }
        if !cameras.contains_key(&image.camera_id) {
            return Err(inconsistent(
                images_path,
                format!(
                    "{} was taken with camera {}, which {} does not hold",
                    called(),
                    image.camera_id.0,
                    file_name(cameras_path)
                ),
            ));
        }
        for (index, keypoint) in image.keypoints.iter().enumerate() {
            if let Some(point) = keypoint.point
                && point_of.get(point).is_none()
            {
                return Err(inconsistent(
                    images_path,
                    format!(
                        "keypoint {index} of {} observes point {}, which {} does not hold",
                        called(),
                        point.0,
                        file_name(points_path)
                    ),
                ));
            }
        }
    }
    for (id, point) in points {
        for &(image_id, keypoint) in &point.track {
            track_element(image_of.get(image_id), image_id, keypoint, images_path).map_err(
                |problem| inconsistent(points_path, format!("point {} is {problem}", id.0)),
            )?;
        }
    }
    Ok(())
}

fn track_element(
    image: Option<&Image>,
    id: ImageId,
    keypoint: u32,
    images_path: &Path,
) -> Result<(), String> {
    let Some(image) = image else {
        return Err(format!(
            "seen by image {}, which {} does not hold",
            id.0,
            file_name(images_path)
        ));
    };
    if keypoint as usize >= image.keypoints.len() {
        return Err(format!(
            "keypoint {keypoint} of image {} ({:?}), which has only {} keypoints, the first \
             being 0",
            id.0,
            image.name,
            image.keypoints.len()
        ));
    }
    Ok(())
}

fn inconsistent(path: &Path, problem: String) -> ColmapError {
    ColmapError::Inconsistent {
        path: path.to_owned(),
        problem,
    }
}

fn file_name(path: &Path) -> String {
    path.file_name()
        .unwrap_or(path.as_os_str())
        .to_string_lossy()
        .into_owned()
}
