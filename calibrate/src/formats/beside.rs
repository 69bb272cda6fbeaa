//! What a `transforms.json` says beside cameras and poses.
//!
//! - nerfstudio's `mask_path` is an ignore mask as ours are: 0 = ignore.
//! - Its `depth_file_path` is depth along z, in steps of which nerfstudio takes 1000 to a unit.
//!   `applied_scale` scaled the poses that are in the file and not the depths.
//! - instant-ngp's `depth_path` is depth along z, too, in steps of `integer_depth_scale` of the poses' units; without
//!   that, or where `enable_depth_loading` is false, it reads none. nerfstudio's go before them.
//! - `ply_file_path` are the sparse points.
//! - D-NeRF's `time` of a frame, which nerfstudio reads, too, often goes from 0 to 1. Nothing says
//!   in what unit.
//! - Paths count from the folder that the file lies in.

use super::build;
use super::error::{FormatError, Problem};
use super::json::{self, Json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Files that a `transforms.json` names beside the photos, which need not exist, and when these
/// were taken.
#[derive(Clone, Debug, PartialEq)]
pub struct FilesBeside {
    /// Ignore masks, by the images' names as [`read_transforms`](super::read_transforms) has
    /// them.
    pub masks: BTreeMap<String, PathBuf>,
    /// Depth maps, likewise.
    pub depth_maps: BTreeMap<String, PathBuf>,
    /// The poses' units a step of the depth maps, where the file says: of instant-ngp's.
    pub depth_scale: Option<f64>,
    /// How many depth maps are named but for their scale, without which they say nothing.
    pub unscaled_depth_maps: usize,
    /// Times of photos, likewise, in a unit of the file's own.
    pub times: BTreeMap<String, f64>,
    /// The sparse points.
    pub points: Option<PathBuf>,
    /// What depths are to be multiplied by to be in the poses' units.
    pub applied_scale: f64,
}

/// Reads which files a `transforms.json` names beside the photos, and when these were taken.
///
/// # Errors
/// An unreadable file; paths that are no texts, times that are no finite numbers, a scale that is
/// no positive one.
pub fn read_files_beside(path: &Path) -> Result<FilesBeside, FormatError> {
    parse_files_beside(path, &build::read(path)?)
}

/// Reads the content of a file at `path`.
///
/// # Errors
/// As for [`read_files_beside`].
pub fn parse_files_beside(path: &Path, bytes: &[u8]) -> Result<FilesBeside, FormatError> {
    let value = json::parse(path, bytes)?;
    let root = Json::root(path, &value);
    let folder = path.parent().unwrap_or(Path::new(""));
    let file = |json: &Json<'_>, key: &str| -> Result<Option<PathBuf>, FormatError> {
        let Some(stored) = json.optional(key) else {
            return Ok(None);
        };
        // An empty text is none.
        let name = build::name(stored.text()?).ok();
        Ok(name.map(|name| folder.join(name)))
    };
    let mut beside = FilesBeside {
        masks: BTreeMap::new(),
        depth_maps: BTreeMap::new(),
        depth_scale: None,
        unscaled_depth_maps: 0,
        times: BTreeMap::new(),
        points: file(&root, "ply_file_path")?,
        applied_scale: 1.0,
    };
    if let Some(scale) = root.optional("applied_scale") {
        beside.applied_scale = scale.number()?;
        if beside.applied_scale <= 0.0 {
            let problem = format!("found {}, expected more than 0", beside.applied_scale);
            return Err(scale.error(Problem::broken(problem)));
        }
    }
    let mut of_ngp = BTreeMap::new();
    for frame in root.field("frames")?.items()? {
        let file_path = frame.field("file_path")?;
        let name = build::name(file_path.text()?).map_err(|p| file_path.error(p))?;
        if let Some(mask) = file(&frame, "mask_path")? {
            beside.masks.insert(name.clone(), mask);
        }
        if let Some(time) = frame.optional("time") {
            beside.times.insert(name.clone(), time.number()?);
        }
        if let Some(depth) = file(&frame, "depth_path")? {
            of_ngp.insert(name.clone(), depth);
        }
        if let Some(depth) = file(&frame, "depth_file_path")? {
            beside.depth_maps.insert(name, depth);
        }
    }
    let is_loaded = root.optional("enable_depth_loading");
    let is_loaded = is_loaded.map_or(Ok(true), |json| json.flag())?;
    if beside.depth_maps.is_empty() && is_loaded {
        let scale = root.optional("integer_depth_scale");
        let scale = scale.map(|json| json.number()).transpose()?;
        beside.depth_scale = scale.filter(|scale| *scale > 0.0);
        match beside.depth_scale {
            Some(_) => beside.depth_maps = of_ngp,
            None => beside.unscaled_depth_maps = of_ngp.len(),
        }
    }
    Ok(beside)
}
