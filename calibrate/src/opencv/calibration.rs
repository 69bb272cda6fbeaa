//! From storage files to cameras, poses and a reconstruction.

use super::OpenCvError;
use super::board::{self, Board};
use super::cameras::{self, Keys, OpenCvCamera};
use super::poses;
use super::storage::{FileStorage, Value};
use super::values::{Values, plain};
use crate::{
    Camera, CameraId, Image, ImageId, Keypoint, Point3D, Point3DId, Reconstruction, Rigid3,
};
use std::path::{Path, PathBuf};

/// What OpenCV's calibration left in files.
#[derive(Clone, Debug, PartialEq)]
pub struct OpenCvCalibration {
    /// One camera; several for a stereo rig, left before right, or where a file holds more.
    pub cameras: Vec<OpenCvCamera>,
    /// `camera_from_world` of each view, in the order of the photos given to OpenCV. The
    /// world is the board's frame.
    pub poses: Vec<Rigid3>,
    /// Of a stereo rig, `right_from_left`.
    pub right_from_left: Option<Rigid3>,
    /// The photos' names in the order of the poses, as the file or the list beside it
    /// writes them; none where neither does.
    pub image_names: Vec<String>,
    /// The board, where the file says how its corners were found.
    pub board: Option<Board>,
    /// Whether it speaks of photos as they are stored, not turned as their EXIF data say, which is how OpenCV reads
    /// them: where the file says `ignore_orientation: 1`, after `cv::IMREAD_IGNORE_ORIENTATION`.
    pub ignores_orientation: bool,
    /// What had to be guessed or looked for elsewhere, for people.
    pub notes: Vec<String>,
}

/// Reads the calibration in a file that OpenCV's `FileStorage` wrote.
///
/// What a file lacks is looked for beside it: the stereo rig's `R` and `T` in
/// `extrinsics.yml` for an `intrinsics.yml`, the photos' names in `images.yml`,
/// `imagelist.xml` and their like.
///
/// # Errors
/// The file cannot be read or is damaged; no camera has a name known here or in `keys`; a
/// value that makes no camera or no pose; the model of another program.
pub fn read_calibration(path: &Path, keys: &Keys) -> Result<OpenCvCalibration, OpenCvError> {
    calibration_and_beside(path, &FileStorage::read(path)?, keys)
}

/// The same of a file that was read already.
pub(super) fn calibration_and_beside(
    path: &Path,
    storage: &FileStorage,
    keys: &Keys,
) -> Result<OpenCvCalibration, OpenCvError> {
    let mut calibration = calibration(path, storage, keys)?;
    let notes = &mut calibration.notes;
    if calibration.cameras.len() == 2 && calibration.right_from_left.is_none() {
        calibration.right_from_left = rig_beside(path, notes)?;
    }
    if calibration.image_names.is_empty() {
        calibration.image_names = names_beside(path, views(&calibration.poses), notes);
    }
    Ok(calibration)
}

/// The calibration in a storage file's values alone; `path` is only named in errors.
///
/// # Errors
/// As for [`read_calibration`].
pub fn calibration(
    path: &Path,
    storage: &FileStorage,
    keys: &Keys,
) -> Result<OpenCvCalibration, OpenCvError> {
    let values = Values::of(path, storage);
    let mut notes = Vec::new();
    let cameras = cameras::cameras(&values, keys, &mut notes)?;
    let poses = poses::of_views(&values)?;
    let right_from_left = match cameras.len() {
        2 => poses::of_rig(&values)?,
        _ => None,
    };
    let board = match cameras.as_slice() {
        [camera] => board::board(&values, camera, &poses, &mut notes),
        _ => None,
    };
    let ignores_orientation = values.find_within(&["ignoreorientation"]);
    let ignores_orientation = ignores_orientation.and_then(|named| named.node.number());
    let mut image_names = names_within(&values);
    if image_names.len() != views(&poses) {
        image_names.clear();
    }
    Ok(OpenCvCalibration {
        cameras,
        poses,
        right_from_left,
        image_names,
        board,
        ignores_orientation: ignores_orientation.is_some_and(|flag| flag != 0.0),
        notes,
    })
}

/// How many photos a file with these poses speaks of: a stereo rig's two without any.
fn views(poses: &[Rigid3]) -> usize {
    if poses.is_empty() { 2 } else { poses.len() }
}

/// The stereo rig's pose in the file that OpenCV's stereo sample writes beside this one.
fn rig_beside(path: &Path, notes: &mut Vec<String>) -> Result<Option<Rigid3>, OpenCvError> {
    let Some(name) = path.file_name().and_then(|name| name.to_str()) else {
        return Ok(None);
    };
    let beside = path.with_file_name(name.replace("intrinsic", "extrinsic"));
    if beside == path || !beside.is_file() {
        return Ok(None);
    }
    let storage = FileStorage::read(&beside)?;
    let rig = poses::of_rig(&Values::of(&beside, &storage))?;
    if rig.is_some() {
        notes.push(format!(
            "the stereo rig's pose is from {}",
            beside.display()
        ));
    }
    Ok(rig)
}

/// What lists of photos are called, as keys and as files.
const LISTS: [&str; 8] = [
    "images",
    "usedimages",
    "imagelist",
    "imagenames",
    "imagefiles",
    "imagefilenames",
    "imagepaths",
    "filenames",
];

fn names_within(values: &Values<'_>) -> Vec<String> {
    values
        .find_within(&LISTS)
        .map_or(Vec::new(), |named| texts(&named.node.value))
}

/// A value's texts; none where it holds anything else.
fn texts(value: &Value) -> Vec<String> {
    match value {
        Value::Text(text) => vec![text.clone()],
        Value::Sequence(nodes) => {
            let texts = nodes.iter().map(|node| node.text().map(str::to_owned));
            texts.collect::<Option<_>>().unwrap_or_default()
        }
        _ => Vec::new(),
    }
}

/// The names in a list of as many photos in the same folder.
fn names_beside(path: &Path, count: usize, notes: &mut Vec<String>) -> Vec<String> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let folder = if folder.as_os_str().is_empty() {
        Path::new(".")
    } else {
        folder
    };
    let is_list = |file: &PathBuf| {
        let stem = file.file_stem().unwrap_or_default().to_string_lossy();
        file != path && is_storage_name(file) && LISTS.contains(&plain(&stem).as_str())
    };
    for file in files(folder).into_iter().filter(is_list) {
        let Ok(storage) = FileStorage::read(&file) else {
            continue;
        };
        let lists = storage.entries.iter().map(|(_, node)| texts(&node.value));
        if let Some(names) = lists.into_iter().find(|names| names.len() == count) {
            let name = file.file_name().unwrap_or_default().to_string_lossy();
            notes.push(format!("the order of the photos is from {name}"));
            return names;
        }
    }
    Vec::new()
}

/// The files in a folder, sorted by name.
pub(super) fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut files: Vec<PathBuf> = entries.map(|e| e.path()).filter(|p| p.is_file()).collect();
    files.sort();
    files
}

/// Whether a name ends like a storage file's.
pub fn is_storage_name(file: &Path) -> bool {
    let extension = file.extension().unwrap_or_default().to_string_lossy();
    let known = ["yml", "yaml", "xml", "json", "gz"];
    known.contains(&extension.to_ascii_lowercase().as_str())
}

impl OpenCvCalibration {
    /// The poses of the photos, in their order: of the views, or of a stereo rig's left
    /// and right camera with the left one's frame as the world.
    pub fn photo_poses(&self) -> Vec<Rigid3> {
        match self.right_from_left {
            Some(right_from_left) if self.poses.is_empty() => {
                vec![Rigid3::IDENTITY, right_from_left]
            }
            _ => self.poses.clone(),
        }
    }

    /// The photos with their cameras and poses, and the board's corners as sparse points.
    /// `names` are the photos' in the order of [`OpenCvCalibration::photo_poses`];
    /// `photo_size` is used for cameras whose size the file does not say.
    ///
    /// # Panics
    /// The numbers of names and poses differ.
    pub fn reconstruction(&self, names: &[String], photo_size: (u32, u32)) -> Reconstruction {
        let poses = self.photo_poses();
        assert_eq!(names.len(), poses.len(), "a name for each pose");
        let mut whole = Reconstruction::default();
        for (i, camera) in self.cameras.iter().enumerate() {
            let (width, height) = camera.size.unwrap_or(photo_size);
            let camera = Camera::of(&camera.lens, width, height);
            whole.cameras.insert(CameraId(i as u32 + 1), camera);
        }
        let is_rig = self.poses.is_empty();
        for (i, (name, pose)) in names.iter().zip(poses).enumerate() {
            let found = self.board.iter().flat_map(|board| &board.found[i]);
            let keypoint = |(k, pixel): (usize, &crate::Pixel)| Keypoint {
                x: pixel.x,
                y: pixel.y,
                point: Some(Point3DId(k as u64 + 1)),
            };
            let image = Image {
                name: name.clone(),
                camera_id: CameraId(if is_rig { i as u32 + 1 } else { 1 }),
                camera_from_world: pose,
                keypoints: found.enumerate().map(keypoint).collect(),
            };
            whole.images.insert(ImageId(i as u32 + 1), image);
        }
        self.add_corners(&mut whole);
        whole
    }

    /// The board's corners as points that every image sees.
    fn add_corners(&self, whole: &mut Reconstruction) {
        let Some(board) = &self.board else { return };
        let views = self.poses.len();
        for (k, &position) in board.corners.iter().enumerate() {
            let errors = self.poses.iter().zip(&board.found).map(|(pose, found)| {
                let projected = self.cameras[0].lens.project(*pose * position);
                projected.map_or(f64::INFINITY, |pixel| pixel.distance(found[k]))
            });
            let error_px = errors.sum::<f64>() / views as f64;
            let point = Point3D {
                position,
                // Nobody looked.
                color: [128; 3],
                error_px: if error_px.is_finite() { error_px } else { -1.0 },
                track: (1..=views).map(|i| (ImageId(i as u32), k as u32)).collect(),
            };
            whole.points.insert(Point3DId(k as u64 + 1), point);
        }
    }
}
