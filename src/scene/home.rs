//! Which folder's photos a calibration is of: COLMAP leaves those that it undistorts beside their model.

use super::beside::{DEPTH_FOLDER, MASKS_FOLDER};
use super::calibration::{Source, read_bare};
use super::{Scene, SceneError, Warning};
use capture::as_argument;
use std::path::{Path, PathBuf};

/// Photos beside a model's folder.
pub(super) const IMAGES: &str = "images";

/// The folder with the photos that a calibration is of, and with what lies beside them: the capture, or the one in
/// it where a COLMAP model lies in `sparse` and photos in `images`, as in `dense`.
pub(super) fn home_of(source: &Source, capture: &Path) -> PathBuf {
    let own = own_folder(source).filter(|own| absolute(own).starts_with(absolute(capture)));
    own.unwrap_or(capture).to_owned()
}

/// What to say where there are photos beside the model as well as those that are taken.
pub(super) fn note_of_home(source: &Source, capture: &Path, home: &Path) -> Option<Warning> {
    let own = own_folder(source)?;
    if absolute(own) == absolute(capture) {
        return None;
    }
    if home == own {
        let photos = Scene::photos_of(capture).ok().map(|found| found.root);
        let beside = [MASKS_FOLDER, DEPTH_FOLDER].map(|name| capture.join(name));
        let beside = beside.into_iter().filter(|folder| folder.is_dir());
        let unused: Vec<String> = photos
            .into_iter()
            .chain(beside)
            .map(|folder| folder.display().to_string())
            .collect();
        let note = format!(
            "the photos are those in {}, beside their COLMAP model; not used: {}",
            own.join(IMAGES).display(),
            unused.join(", ")
        );
        return (!unused.is_empty()).then_some(Warning::Note(note));
    }
    let taken = Scene::photos_of(capture).ok()?.root;
    let real = |folder: &Path| folder.canonicalize().ok();
    (real(&taken) != real(&own.join(IMAGES))).then(|| {
        Warning::Note(format!(
            "{} lies beside photos in {}, and may be of those: `lumigraph import {}` takes them",
            source.text(),
            own.join(IMAGES).display(),
            as_argument(own)
        ))
    })
}

/// The folder around the `sparse` that a COLMAP model lies in, if photos lie there, too.
fn own_folder(source: &Source) -> Option<&Path> {
    let Source::Colmap(model) = source else {
        return None;
    };
    let around = match model.parent().filter(|_| model.ends_with("sparse"))? {
        nameless if nameless == Path::new("") => Path::new("."),
        around => around,
    };
    around.join(IMAGES).is_dir().then_some(around)
}

/// The error of a capture without photos; where those that its calibration names are elsewhere, it says so.
pub(super) fn error_of_photos(source: &Source, error: SceneError) -> SceneError {
    let (Source::Other(format, file), SceneError::NoPhotos(..)) = (source, &error) else {
        return error;
    };
    let Ok((whole, _)) = read_bare(*format, file) else {
        return error;
    };
    let around = file.parent().unwrap_or(Path::new(""));
    let photos = whole.images.values().map(|image| around.join(&image.name));
    let mut photos = photos.filter(|photo| photo.is_file());
    let Some(first) = photos.next() else {
        return error;
    };
    let common = |folder: PathBuf, photo: PathBuf| -> PathBuf {
        let mut up = folder.ancestors();
        let shared = up.find(|up| photo.starts_with(up));
        shared.unwrap_or(Path::new("")).to_owned()
    };
    let folder = first.parent().unwrap_or(Path::new("")).to_owned();
    SceneError::PhotosElsewhere {
        file: file.clone(),
        folder: photos.fold(folder, common),
    }
}

fn absolute(path: &Path) -> PathBuf {
    std::path::absolute(path).unwrap_or_else(|_| path.to_owned())
}
