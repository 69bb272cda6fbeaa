use super::damaged::damaged_text;
use capture::{as_argument, unread_photos};
use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};

/// Why a scene cannot be made, read, written or rendered from.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The calibration cannot be found or read.
    #[error(transparent)]
    Calibration(#[from] calibrate::colmap::ColmapError),
    /// There is no calibration at all.
    #[error(
        "{source}; or have the photos calibrated: `lumigraph import {} -o SCENE` runs COLMAP",
        as_argument(folder)
    )]
    Uncalibrated {
        /// The capture.
        folder: PathBuf,
        /// Where it was looked for.
        source: calibrate::colmap::ColmapError,
    },
    /// A folder's scene is not in its place, as an import is at work there or was stopped.
    #[error(
        "{}: the scene lies aside, as an import that replaces it is at work here or was stopped; wait until it has \
         ended, or run it again: it goes on, or where it fails puts the scene back",
        folder.display()
    )]
    Aside {
        /// The folder.
        folder: PathBuf,
    },
    /// An OpenCV calibration cannot be read.
    #[error(transparent)]
    OpenCv(#[from] calibrate::opencv::OpenCvError),
    /// Another program's calibration cannot be read.
    #[error(transparent)]
    Format(#[from] calibrate::formats::FormatError),
    /// What is wrong with a capture that was opened without `import`, where options of that mend it.
    #[error("{source}; {whose}")]
    OfImport {
        /// What is wrong.
        source: Box<SceneError>,
        /// Which of the options that it suggests are whose.
        whose: String,
    },
    /// An OpenCV calibration's poses cannot be given to the photos.
    #[error("{}: the file holds {problem}", path.display())]
    Poses {
        /// The file.
        path: PathBuf,
        /// What it holds, what was expected, and what to do.
        problem: String,
    },
    /// OpenCV's calibration speaks of a photo as it is shown, and no camera here sees it as it is stored.
    #[error(
        "{}: OpenCV reads it as it is shown (EXIF orientation {orientation}), and {problem}; store the photos as they \
         are shown (`mogrify -auto-orient`) or, where the calibration speaks of them as they are stored, write \
         `ignore_orientation: 1` into {}",
        photo.display(),
        file.display()
    )]
    Turned {
        /// The photo.
        photo: PathBuf,
        /// As its EXIF data say.
        orientation: u8,
        /// What is wrong with that.
        problem: &'static str,
        /// The calibration.
        file: PathBuf,
    },
    /// A camera is unusable.
    #[error("camera of {name}: {source}")]
    Camera {
        /// The photo.
        name: String,
        /// What is wrong with its camera.
        source: calibrate::CameraError,
    },
    /// A photo that may be a copy of what was calibrated, of another size.
    #[error(
        "{0}; if it was reduced or enlarged since, both sides alike, `lumigraph import --resized` scales its camera to \
         it"
    )]
    Resized(capture::CaptureError),
    /// The photos cannot be undistorted.
    #[error(transparent)]
    Undistort(#[from] calibrate::undistort::UndistortError),
    /// Photos cannot be written under their names.
    #[error(transparent)]
    Name(#[from] super::NameError),
    /// The photos cannot be listed, or one of them is not as calibrated.
    #[error(transparent)]
    Capture(#[from] capture::CaptureError),
    /// A depth map that was asked for, or that a scene names, cannot be used.
    #[error("{0}; `import --no-depth` does without any")]
    DepthMap(capture::CaptureError),
    /// An ignore mask or a silhouette cannot be used.
    #[error("{0}; `import --no-masks` does without any")]
    Mask(capture::CaptureError),
    /// A turntable's photos are not all of one size.
    #[error(
        "{}: the photo has {} × {} pixels and {other} {} × {}; a turntable's photos come from one \
         camera: leave out those of another size", path.display(), found.0, found.1, expected.0, expected.1
    )]
    TurntableSizes {
        /// The photo's file.
        path: PathBuf,
        /// Its width and height in pixels.
        found: (u32, u32),
        /// The name of another photo.
        other: String,
        /// The other's width and height in pixels.
        expected: (u32, u32),
    },
    /// The photos' silhouettes fit no turntable.
    #[error(
        "{}: no turntable's cameras: {source}{}{}",
        folder.display(),
        upright(turned.as_deref()),
        gap.as_ref().map_or_else(String::new, |gap| format!("; {gap}"))
    )]
    Turntable {
        /// The folder of the photos.
        folder: PathBuf,
        /// What does not fit.
        source: proxy::hull::TurntableError,
        /// Which photos are stored turned, if any are.
        turned: Option<String>,
        /// Where photos seem to be missing, if they do.
        gap: Option<String>,
    },
    /// A kind of proxy does not suit the scene.
    #[error("{0}")]
    Unfit(String),
    /// Photos, or what says which part of them is the object, that cannot be decoded, by name, with what is
    /// wrong with each.
    #[error("{}", damaged_text(.0))]
    Damaged(BTreeMap<String, String>),
    /// The list of times cannot be read.
    #[error(transparent)]
    Times(#[from] capture::TimeListError),
    /// The photos' names do not count frames.
    #[error(
        "no times by frame rate: {0}; expected names such as frame_000123.jpg that differ in \
         one number, or give the times as a list"
    )]
    FrameNumbers(String),
    /// The scene's proxy cannot be read or written.
    #[error(transparent)]
    ProxyFile(#[from] proxy::FileError),
    /// The scene's own proxy is lost or damaged.
    #[error(transparent)]
    LostProxy(#[from] super::LostProxy),
    /// Dense points that were found in none of the scene's photos.
    #[error(
        "{}: its points were found in {}, and the scene has none of these photos, but {}; find points in those with \
         `lumigraph proxy … dense`", path.display(), examples(names), examples(known)
    )]
    OtherPhotos {
        /// The proxy's file.
        path: PathBuf,
        /// The photos that it names.
        names: Vec<String>,
        /// The scene's.
        known: Vec<String>,
    },
    /// No proxy can be fitted.
    #[error(transparent)]
    Fit(#[from] proxy::FitError),
    /// There is nothing at the given path.
    #[error("{}: there is no such folder; check the path", .0.display())]
    NoFolder(PathBuf),
    /// There is a file at the given path.
    #[error(
        "{}: a file, and a folder is expected: a scene's, or that of photos and their calibration{}",
        path.display(), more(remedy_of_model(path).as_deref())
    )]
    NotFolder {
        /// The file.
        path: PathBuf,
    },
    /// The capture holds no photos.
    #[error(
        "{}: no photos here, neither in it nor in `images` or other folders within; give the folder \
         that holds the photos, and their calibration with `import --calibration`{}",
        .0.display(),
        unread_text(.1)
    )]
    NoPhotos(PathBuf, Vec<String>),
    /// Nor are there photos beside a calibration that names some elsewhere.
    #[error(
        "{}: there are no photos beside it, and those that it names are in {}; give that folder: `lumigraph import {} \
         --calibration {} -o SCENE`",
        file.display(),
        folder.display(),
        as_argument(folder),
        as_argument(file)
    )]
    PhotosElsewhere {
        /// The calibration.
        file: PathBuf,
        /// The folder around the photos.
        folder: PathBuf,
    },
    /// A folder of masks, mattes or depth maps has none for any photo.
    #[error(
        "{}: no {kind} for any photo here; that of {example} would be called {example}.png, or \
         so without its own extension{}", folder.display(), more(unread.as_deref())
    )]
    NothingBeside {
        /// The folder.
        folder: PathBuf,
        /// What was looked for.
        kind: capture::Beside,
        /// A photo's name.
        example: String,
        /// What there is in its place and why it is not read, if there is anything.
        unread: Option<String>,
    },
    /// A photo is missing or corrupt and none may be.
    #[error("photo {name}: {reason}; without --strict it would be left out")]
    Strict {
        /// The photo.
        name: String,
        /// What is wrong.
        reason: String,
    },
    /// Too many photos are missing or corrupt.
    #[error(
        "{left_out} of {total} calibrated photos cannot be used, and too few remain (at least 2 \
         are needed): {name}: {reason}; {remedy}"
    )]
    TooFew {
        /// How many are missing or corrupt.
        left_out: usize,
        /// How many are calibrated.
        total: usize,
        /// The first of them.
        name: String,
        /// What is wrong with it.
        reason: String,
        /// What to do.
        remedy: String,
    },
    /// A file or folder cannot be read or written.
    #[error("{}: cannot {doing}: {source}", path.display())]
    Io {
        /// Which.
        path: PathBuf,
        /// What was tried.
        doing: &'static str,
        /// Why not.
        source: std::io::Error,
    },
    /// A file or folder that is to be named in a file has a path that no JSON holds.
    #[error(
        "{}: the path is not UTF-8, and scene files hold UTF-8 names; rename what is not, or choose \
         another folder", .0.display()
    )]
    NotUnicode(PathBuf),
    /// A file is not the JSON that was expected.
    #[error("{}: not {expected}: {source}", path.display())]
    Json {
        /// The file.
        path: PathBuf,
        /// What it should be.
        expected: &'static str,
        /// What is wrong.
        source: serde_json::Error,
    },
    /// The scene is from a later version of the program.
    #[error("{}: scene version {found}; this program reads version 1", path.display())]
    Version {
        /// Its `scene.json`.
        path: PathBuf,
        /// Its version.
        found: u32,
    },
    /// `scene.json` contradicts itself or the model.
    #[error("{}: {problem}; import the photos again", path.display())]
    Inconsistent {
        /// Its `scene.json`.
        path: PathBuf,
        /// What does not fit.
        problem: String,
    },
    /// The output folder holds something else.
    #[error("{}: {problem}", path.display())]
    Occupied {
        /// The folder.
        path: PathBuf,
        /// What is in the way, and what to do.
        problem: String,
    },
    /// A photo is asked for that the scene does not have.
    #[error("no photo is called {name}; the scene has {}", examples(known))]
    UnknownPhoto {
        /// The name asked for.
        name: String,
        /// The scene's.
        known: Vec<String>,
    },
    /// Photos are to be held out that the scene does not have.
    #[error(
        "{}: the scene has no {}; it has {}; name those, or choose others with --hold-out FILE (or, \
         to `evaluate`, --every N)", path.display(), names.join(", "), examples(known)
    )]
    UnknownHeldOut {
        /// The split file.
        path: PathBuf,
        /// What it names.
        names: Vec<String>,
        /// The scene's photos.
        known: Vec<String>,
    },
    /// A split that names no photo.
    #[error("{}: \"test\" names no photo; name some to hold out", .0.display())]
    EmptySplit(PathBuf),
    /// None of the photos that a split names can be used.
    #[error(
        "{}: all of its photos are missing or corrupt; choose others with --hold-out FILE or \
         --every N", .0.display()
    )]
    UnusableSplit(PathBuf),
    /// Every photo is held out or corrupt.
    #[error("no photo is left to render from: all {0} are held out or corrupt")]
    NothingLeft(usize),
}

impl SceneError {
    /// Of a capture without photos that are read.
    pub(super) fn no_photos(capture: &Path) -> Self {
        Self::NoPhotos(capture.to_owned(), unread_photos(capture))
    }

    /// Of what was to be a folder and is none.
    pub(super) fn no_folder(path: &Path) -> Self {
        let path = path.to_owned();
        match path.is_file() {
            true => Self::NotFolder { path },
            false => Self::NoFolder(path),
        }
    }
}

/// What takes a file that is called like a model.
pub fn remedy_of_model(path: &Path) -> Option<String> {
    let end = path.extension().unwrap_or_default();
    let argument = as_argument(path);
    end.eq_ignore_ascii_case("glb")
        .then(|| format!("`lumigraph interior {argument} -o INTERIOR` takes models"))
}

/// What to do where photos are stored turned, after all.
/// What is said of photos of kinds that are not read.
fn unread_text(names: &[String]) -> String {
    match names {
        [] => String::new(),
        [first, ..] => format!(
            "; read are JPEG and PNG: convert the {} photos of other kinds ({first}, for one)",
            names.len()
        ),
    }
}

fn upright(turned: Option<&str>) -> String {
    turned.map_or_else(String::new, |turned| {
        format!("; {turned}: photos must stand upright, as `mogrify -auto-orient` makes them")
    })
}

/// What else there is to say, after all.
fn more(said: Option<&str>) -> String {
    said.map_or_else(String::new, |said| format!("; {said}"))
}

/// The first few names, for people.
fn examples(known: &[String]) -> String {
    match known {
        [] => "none".to_owned(),
        [a] => a.clone(),
        [a, b] => format!("{a} and {b}"),
        [a, b, rest @ ..] => format!("{a}, {b} and {} more", rest.len()),
    }
}

/// What the user should know about photos that are not used and choices that were made.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Warning {
    /// A calibrated photo is missing or corrupt.
    LeftOut {
        /// The photo.
        name: String,
        /// What is wrong with it.
        reason: String,
    },
    /// Photos without a camera.
    Uncalibrated {
        /// How many.
        count: usize,
        /// How many photos there are.
        total: usize,
        /// One of them.
        example: String,
    },
    /// Something was chosen or guessed.
    Note(String),
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::LeftOut { name, reason } => write!(f, "photo {name} is left out: {reason}"),
            Self::Note(note) => f.write_str(note),
            Self::Uncalibrated {
                count,
                total,
                example,
            } => write!(
                f,
                "{count} of {total} photos are not in the calibration and stay unused \
                 ({example}, for one)"
            ),
        }
    }
}
