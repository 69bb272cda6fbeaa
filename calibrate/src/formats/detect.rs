use capture::without_byte_order_mark;
use serde::Deserialize;
use serde::de::IgnoredAny;
use std::fs::File;
use std::io::{BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::Path;

/// The formats read here.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Format {
    /// instant-ngp's and nerfstudio's `transforms.json`.
    Transforms,
    /// Bundler's `bundle.out`.
    Bundler,
    /// VisualSFM's `.nvm`.
    Nvm,
    /// LLFF's `poses_bounds.npy`.
    Llff,
    /// Meshroom's (AliceVision's) `.sfm`.
    Meshroom,
    /// OpenMVG's `sfm_data.json`.
    OpenMvg,
}

/// The keys that tell the JSON formats apart; their values are skipped, not kept.
#[derive(Deserialize)]
struct Keys {
    frames: Option<Vec<Frame>>,
    views: Option<IgnoredAny>,
    intrinsics: Option<IgnoredAny>,
    extrinsics: Option<IgnoredAny>,
    poses: Option<IgnoredAny>,
    version: Option<serde_json::Value>,
    sfm_data_version: Option<IgnoredAny>,
}

#[derive(Deserialize)]
struct Frame {
    file_path: Option<IgnoredAny>,
    transform_matrix: Option<IgnoredAny>,
}

/// Which format a file is in, told by its content, whatever its name; `None` for a file
/// that is none of them, is cut short, or cannot be read. A JSON file is read once to its
/// end, without keeping it; of any other only the beginning is read.
pub fn detect(path: &Path) -> Option<Format> {
    detect_content(BufReader::new(File::open(path).ok()?))
}

/// The same for a file's content, read from where `file` stands, its beginning.
pub fn detect_content(mut file: impl BufRead + Seek) -> Option<Format> {
    let mut start = Vec::new();
    file.by_ref().take(256).read_to_end(&mut start).ok()?;
    let mark = start.len() - without_byte_order_mark(&start).len();
    start.drain(..mark);
    let begins = |magic: &str| start.starts_with(magic.as_bytes());
    if begins("# Bundle file v0.") {
        return Some(Format::Bundler);
    }
    if begins("NVM_V3") {
        return Some(Format::Nvm);
    }
    if start.starts_with(b"\x93NUMPY") {
        // Two axes, the second of 17: any other array is no poses_bounds.
        let header = String::from_utf8_lossy(&start).replace(' ', "");
        return header.contains(",17)").then_some(Format::Llff);
    }
    if start.iter().find(|byte| !byte.is_ascii_whitespace()) != Some(&b'{') {
        return None;
    }
    file.seek(SeekFrom::Start(mark as u64)).ok()?;
    let keys: Keys = serde_json::from_reader(file).ok()?;
    if keys.sfm_data_version.is_some() && keys.views.is_some() && keys.extrinsics.is_some() {
        return Some(Format::OpenMvg);
    }
    if keys.version.is_some_and(|version| version.is_array())
        && keys.views.is_some()
        && (keys.intrinsics.is_some() || keys.poses.is_some())
    {
        return Some(Format::Meshroom);
    }
    let frame = keys.frames.as_ref()?.first()?;
    (frame.file_path.is_some() && frame.transform_matrix.is_some()).then_some(Format::Transforms)
}

/// Which format a file is called after, whatever is in it: `transforms.json` and its like
/// (`transforms_train.json`), `bundle.out`, `*.nvm`, `poses_bounds.npy`, `*.sfm`,
/// `sfm_data.json`. One that [`detect`] does not know is damaged, or something else.
pub fn by_name(path: &Path) -> Option<Format> {
    let name = path.file_name()?.to_str()?.to_ascii_lowercase();
    let is = |start: &str, end: &str| name.starts_with(start) && name.ends_with(end);
    // Copies to other systems may leave `._model.nvm` beside `model.nvm`.
    if name.starts_with('.') {
        None
    } else if name == "transforms.json" || is("transforms_", ".json") {
        Some(Format::Transforms)
    } else if is("", "bundle.out") || is("bundle_", ".out") {
        Some(Format::Bundler)
    } else if is("", ".nvm") {
        Some(Format::Nvm)
    } else if name == "poses_bounds.npy" {
        Some(Format::Llff)
    } else if is("", ".sfm") {
        Some(Format::Meshroom)
    } else if is("sfm_data", ".json") {
        Some(Format::OpenMvg)
    } else {
        None
    }
}

/// Which format a file was meant to be that [`detect`] does not know: by its name, or by keys
/// that its beginning has where that is JSON's.
pub fn meant(path: &Path) -> Option<Format> {
    // As far as the first frame, view or pose.
    const BEGINNING: u64 = 1 << 16;
    by_name(path).or_else(|| {
        let mut start = Vec::new();
        let file = File::open(path).ok()?;
        file.take(BEGINNING).read_to_end(&mut start).ok()?;
        let start = String::from_utf8_lossy(without_byte_order_mark(&start));
        let has = |key: &str| start.contains(&format!("\"{key}\""));
        let is_json = start.trim_start().starts_with('{');
        if !is_json {
            None
        } else if has("transform_matrix") {
            Some(Format::Transforms)
        } else if has("sfm_data_version") {
            Some(Format::OpenMvg)
        } else if has("views") && has("intrinsicId") {
            Some(Format::Meshroom)
        } else {
            None
        }
    })
}
