//! `scene.json`, version 1.
//!
//! ```json
//! {
//!   "version": 1,
//!   "photos": [{"name": "a.jpg", "path": "../capture/images/a.jpg"}],
//!   "model": "model",
//!   "proxy": {"kind": "plane", "file": "proxy.json", "fitted_without": []},
//!   "settings": {"capture": "../capture"}
//! }
//! ```
//!
//! Paths are relative to the scene's folder, with `/` between their parts. Keys that this
//! version does not know are kept when the file is written again.

use super::SceneError;
use capture::without_byte_order_mark;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Keys that this version does not know, with their values.
pub type Extra = serde_json::Map<String, serde_json::Value>;

/// The file.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SceneFile {
    /// Of the format: 1.
    pub version: u32,
    /// By name.
    pub photos: Vec<PhotoEntry>,
    /// The photos that the import had to leave out, by what the capture calls them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub left_out: Vec<String>,
    /// The folder of the COLMAP model.
    pub model: String,
    /// The scene's own proxy.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub proxy: Option<ProxyEntry>,
    /// How the photos' gains were found; absent where they were not, or given by hand.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exposure: Option<ExposureEntry>,
    /// How the scene was made.
    #[serde(default)]
    pub settings: Settings,
    /// Everything else.
    #[serde(flatten)]
    pub other: Extra,
}

impl SceneFile {
    /// Reads the content of a file; `path` is only named in errors.
    ///
    /// # Errors
    /// It is not the JSON that was expected, or of a later version.
    pub fn parse(path: &Path, bytes: &[u8]) -> Result<Self, SceneError> {
        let json = |source| SceneError::Json {
            path: path.to_owned(),
            expected: "a scene",
            source,
        };
        let bytes = without_byte_order_mark(bytes);
        // The version first: of a later one nothing else need be readable.
        let value: serde_json::Value = serde_json::from_slice(bytes).map_err(json)?;
        let version = value.get("version").and_then(serde_json::Value::as_u64);
        if let Some(version) = version.filter(|&v| v != 1) {
            return Err(SceneError::Version {
                path: path.to_owned(),
                found: u32::try_from(version).unwrap_or(u32::MAX),
            });
        }
        serde_json::from_slice(bytes).map_err(json)
    }
}

/// A photo.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PhotoEntry {
    /// As in the model.
    pub name: String,
    /// The photo's file.
    pub path: String,
    /// What the capture calls it, where undistorting gave it another name.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub original: Option<String>,
    /// The file of a mask of what to ignore.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ignore_mask: Option<String>,
    /// The file of an object's silhouette.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub object_matte: Option<String>,
    /// The file of a mask that only says where the object is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub silhouette: Option<String>,
    /// The file of a depth map.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth_map: Option<String>,
    /// World units a step of the depth map.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth_scale: Option<f64>,
    /// Seconds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_s: Option<f64>,
    /// Exposure of red, green and blue, relative to the other photos.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gain: Option<[f64; 3]>,
    /// The nearest and farthest depth along z that it shows: 0 < nearest < farthest.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth_bounds: Option<[f64; 2]>,
    /// EXIF's orientation of its stored pixels, 1 to 8; absent where nothing says that they are turned or mirrored.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub orientation: Option<u8>,
    /// Everything else.
    #[serde(flatten)]
    pub other: Extra,
}

impl PhotoEntry {
    /// The files that it names: the photo's, and those of what lies beside it.
    pub(super) fn files(&self) -> impl Iterator<Item = &str> {
        let beside = [
            &self.ignore_mask,
            &self.object_matte,
            &self.silhouette,
            &self.depth_map,
        ];
        let beside = beside.into_iter().flatten();
        beside.chain([&self.path]).map(String::as_str)
    }
}

/// The scene's own proxy.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ProxyEntry {
    /// Of the surface: `plane`.
    pub kind: String,
    /// Its file.
    pub file: String,
    /// For a fitted one, the photos that were held out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fitted_without: Option<Vec<String>>,
    /// Everything else.
    #[serde(flatten)]
    pub other: Extra,
}

/// How the photos' gains were found. A matched scene without gains is one whose photos
/// do not differ.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ExposureEntry {
    /// The photos that were held out.
    #[serde(default)]
    pub matched_without: Vec<String>,
    /// Everything else.
    #[serde(flatten)]
    pub other: Extra,
}

/// How a scene was made.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// The folder that was imported.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub capture: Option<String>,
    /// The video that the photos were taken out of.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub video: Option<String>,
    /// The calibration that was given beside it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibration: Option<String>,
    /// Of an OpenCV calibration, what the camera matrix was said to be called.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera_matrix: Option<String>,
    /// The same of its distortion coefficients.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub distortion: Option<String>,
    /// Whether its coefficients were said to be a fisheye's.
    #[serde(default, skip_serializing_if = "is_false")]
    pub fisheye: bool,
    /// Whether the photos were undistorted: the scene's folder holds them.
    #[serde(default, skip_serializing_if = "is_false")]
    pub undistorted: bool,
    /// Where the cameras were found from a turntable's silhouettes: degrees from photo to photo.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub turntable_degrees: Option<f64>,
    /// Whether a missing or corrupt photo was an error.
    #[serde(default)]
    pub strict: bool,
    /// The program and its version.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub program: Option<String>,
    /// Everything else.
    #[serde(flatten)]
    pub other: Extra,
}

/// Settings that were not chosen are not written.
fn is_false(value: &bool) -> bool {
    !value
}
