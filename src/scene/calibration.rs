//! Reading a capture's calibration, whichever program made it.

pub(super) use super::source::{Source, find};

use super::listed::Listed;
use super::turned::Pixels;
use super::turntable::by_numbers;
use super::{ImportOptions, SceneError, Warning};
use calibrate::formats::{self, Format};
use calibrate::opencv::{self, Keys, OpenCvCalibration, OpenCvError};
use calibrate::{Reconstruction, colmap};
use capture::{PhotoSet, find_photos_folder, photo_size};
use std::cell::{Cell, OnceCell};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Reads COLMAP's model. Where its points have no tracks but its images tell who observes which, says so.
///
/// # Errors
/// As for [`colmap::read_model`].
pub(super) fn read_colmap(
    model: &Path,
    warnings: &mut Vec<Warning>,
) -> Result<Reconstruction, SceneError> {
    let mut whole = colmap::read_model(model)?;
    let count = whole.take_tracks_from_keypoints();
    if count > 0 {
        warnings.push(Warning::Note(format!(
            "{}: no point of points3D has a track; who observes which is taken from the {count} keypoints in images \
             that name one",
            model.display()
        )));
    }
    Ok(whole)
}

/// Reads another program's calibration. Its photos are found by the ends of their paths; what they are called is
/// told by these, too.
///
/// Where the calibration leaves their sizes to the photos, one that is missing or corrupt is
/// taken to be as large as the others: it is not left out here, but once it is known why.
pub(super) fn read_other(
    format: Format,
    path: &Path,
    photos: &PhotoSet,
    warnings: &mut Vec<Warning>,
) -> Result<(Reconstruction, BTreeMap<String, String>), SceneError> {
    let some_size = OnceCell::new();
    let any_size = || {
        let mut sizes = photos.photos.iter().map(|photo| photo_size(&photo.path));
        *some_size.get_or_init(|| sizes.find_map(Result::ok).unwrap_or((1, 1)))
    };
    let listed = Listed::of(photos);
    let size_of = |path: &str| {
        let photo = listed.photo(path);
        let own = photo.and_then(|photo| photo_size(&photo.path).ok());
        Some(own.unwrap_or_else(any_size))
    };
    let names: Vec<String> = photos.photos.iter().map(|p| p.name.clone()).collect();
    let mut notes = Vec::new();
    let mut whole = formats::read(format, path, &size_of, &names, &mut notes)?;
    warnings.extend(notes.into_iter().map(Warning::Note));
    let called = listed.names(whole.images.values().map(|image| image.name.as_str()));
    let mut paths: BTreeMap<String, String> = BTreeMap::new();
    for image in whole.images.values_mut() {
        let name = &called[&image.name];
        let own = std::mem::replace(&mut image.name, name.clone());
        if let Some(other) = paths.get(name) {
            return Err(SceneError::Poses {
                path: path.to_owned(),
                problem: format!(
                    "two poses whose paths both end in that of the photo {name}, {other} and {own}; remove one of \
                     them, or give the folder of photos in which both are found by longer ends of their paths"
                ),
            });
        }
        paths.insert(name.clone(), own);
    }
    Ok((whole, called))
}

/// Whether the cameras' image sizes are those of the photos.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sizes {
    /// As the file or the photos say.
    Known,
    /// Nobody says: they are 1 × 1, and lengths that depend on them in parts of it.
    Unknown,
}

/// Reads another program's calibration without a capture around it. Photos are looked for
/// beside it, only for their sizes and names.
///
/// # Errors
/// As [`calibrate::formats::read`].
pub fn read_bare(format: Format, path: &Path) -> Result<(Reconstruction, Sizes), SceneError> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let photos = find_photos_folder(folder).and_then(|photos| PhotoSet::open(&photos).ok());
    let listed = photos.as_ref().map(Listed::of);
    let sizes = Cell::new(Sizes::Known);
    let size_of = |path: &str| {
        let photo = listed.as_ref().and_then(|listed| listed.photo(path));
        // Splits of NeRF's have theirs in folders of their own, and leave out what files end in.
        let beside = || {
            let files = [path.to_owned(), format!("{path}.png")].into_iter();
            files
                .map(|file| folder.join(file))
                .find_map(|file| photo_size(&file).ok())
        };
        let size = photo.and_then(|photo| photo_size(&photo.path).ok());
        let size = size.or_else(beside);
        // LLFF's file has a size of its own.
        if size.is_none() && format != Format::Llff {
            sizes.set(Sizes::Unknown);
            return Some((1, 1));
        }
        size
    };
    let whole = formats::read(format, path, &size_of, &[], &mut Vec::new())?;
    Ok((whole, sizes.get()))
}

/// The size of the pictures that a calibration is of, a file or a folder, where it says one for all of them.
pub fn calibrated_size(calibration: &Path, keys: &Keys) -> Option<(u32, u32)> {
    let options = ImportOptions {
        calibration: Some(calibration.to_owned()),
        keys: keys.clone(),
        ..ImportOptions::default()
    };
    let source = find(calibration, &options, &mut Vec::new()).ok()?;
    let of_cameras = |whole: &Reconstruction| -> BTreeSet<(u32, u32)> {
        let cameras = whole.cameras.values();
        cameras
            .map(|camera| (camera.width, camera.height))
            .collect()
    };
    let sizes = match source {
        Source::Colmap(model) => of_cameras(&colmap::read_model(&model).ok()?),
        Source::OpenCv(file) => {
            let calibration = opencv::read_calibration(&file, keys).ok()?;
            let sizes = calibration.cameras.iter().map(|camera| camera.size);
            sizes.collect::<Option<_>>()?
        }
        Source::Other(format, file) => match read_bare(format, &file).ok()? {
            (whole, Sizes::Known) => of_cameras(&whole),
            (_, Sizes::Unknown) => return None,
        },
    };
    let first = sizes.first().copied();
    first.filter(|_| sizes.len() == 1)
}

/// The nearest and farthest depth that LLFF's file says of each photo.
pub(super) fn depth_bounds(
    path: &Path,
    photos: &PhotoSet,
) -> Result<BTreeMap<String, [f64; 2]>, SceneError> {
    // A row a photo, in the order of their names.
    let names = photos.photos.iter().map(|photo| photo.name.clone());
    Ok(names.zip(formats::read_llff_bounds(path)?).collect())
}

/// Reads an OpenCV calibration and finds which of the photos each pose is of. Says of which pixels it speaks.
pub(super) fn read_opencv(
    path: &Path,
    options: &ImportOptions,
    photos: &PhotoSet,
    warnings: &mut Vec<Warning>,
) -> Result<(Reconstruction, Pixels), SceneError> {
    let calibration = opencv::read_calibration(path, &options.keys)?;
    let refuse = |problem: String| SceneError::Poses {
        path: path.to_owned(),
        problem,
    };
    let notes = calibration.notes.iter().cloned();
    warnings.extend(notes.map(Warning::Note));

    // 1. One pose a photo.
    let count = calibration.photo_poses().len();
    if count == 0 {
        let path = path.to_owned();
        return Err(OpenCvError::NoPoses { path }.into());
    }
    if calibration.cameras.len() > 1 && !calibration.poses.is_empty() {
        let names: Vec<&str> = calibration
            .cameras
            .iter()
            .map(|c| c.name.as_str())
            .collect();
        return Err(refuse(format!(
            "the poses of one camera, but {} cameras ({}); choose with --camera-matrix KEY",
            names.len(),
            names.join(", ")
        )));
    }

    // 2. Their photos.
    let names = photo_names(&calibration, count, path, photos, warnings).map_err(refuse)?;
    let mut named = BTreeSet::new();
    if let Some(twice) = names.iter().find(|name| !named.insert(*name)) {
        return Err(refuse(format!(
            "poses, but the list of photos names {twice} twice; expected a photo for each of {count} poses"
        )));
    }

    // 3. Where the file does not say, the image size is the photos'.
    let is_open = calibration.cameras.iter().any(|c| c.size.is_none());
    let known = names.iter().filter_map(|name| photos.find(name));
    let mut sizes = known.map(|photo| photo_size(&photo.path));
    let size = if is_open {
        // What is wrong with photos is told when they are left out.
        sizes.find_map(Result::ok)
    } else {
        None
    };
    let whole = calibration.reconstruction(&names, size.unwrap_or((1, 1)));
    for (id, camera) in &whole.cameras {
        camera.lens().map_err(|source| SceneError::Camera {
            name: format!("{}, camera {}", path.display(), id.0),
            source,
        })?;
    }
    let pixels = if calibration.ignores_orientation {
        Pixels::Stored
    } else {
        Pixels::Shown { is_sized: !is_open }
    };
    Ok((whole, pixels))
}

/// The photo of each pose: by the list that came with the calibration, else in the order
/// of their names; or what is wrong.
fn photo_names(
    calibration: &OpenCvCalibration,
    count: usize,
    path: &Path,
    photos: &PhotoSet,
    warnings: &mut Vec<Warning>,
) -> Result<Vec<String>, String> {
    if calibration.image_names.len() == count {
        let listed = Listed::of(photos);
        let names = &calibration.image_names;
        let called = listed.names(names.iter().map(String::as_str));
        return Ok(names.iter().map(|path| called[path].clone()).collect());
    }
    if photos.photos.len() != count {
        return Err(format!(
            "{count} poses, but {} has {} photos, and no list says which are meant; put the list \
             that OpenCV calibrated from beside it as images.yml, or give a folder with only the \
             calibrated photos",
            photos.root.display(),
            photos.photos.len()
        ));
    }
    let names: Vec<String> = photos.photos.iter().map(|p| p.name.clone()).collect();
    warnings.push(Warning::Note(format!(
        "the {count} poses in {} are taken to be of the photos in the order of their names{}; if \
         that is wrong, put the list of photos beside it as images.yml",
        path.display(),
        which_order(&names)
    )));
    Ok(names)
}

/// What to add where names, which are in the order of their characters, are in another by the numbers within.
fn which_order(names: &[String]) -> String {
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let mut numbered = names.clone();
    numbered.sort_by(|a, b| by_numbers(a, b));
    let Some(first) = (0..names.len()).find(|&i| numbered[i] != names[i]) else {
        return String::new();
    };
    // From one before the first that differs.
    let from = first.saturating_sub(1);
    let to = names.len().min(from + 3);
    let shown = |names: &[&str]| {
        let before = if from > 0 { "…, " } else { "" };
        let after = if to < names.len() { ", …" } else { "" };
        format!("({before}{}{after})", names[from..to].join(", "))
    };
    format!(
        " as OpenCV's glob has them {}, not of the numbers in them {}",
        shown(&names),
        shown(&numbered)
    )
}

#[cfg(test)]
mod tests {
    use super::which_order;

    #[test]
    fn names_whose_numbers_are_in_another_order_are_shown_in_both() {
        let said = |numbers: std::ops::RangeInclusive<u32>| {
            let mut names: Vec<String> = numbers.map(|n| format!("img{n}.png")).collect();
            names.sort();
            which_order(&names)
        };
        assert_eq!(said(1..=9), "");
        assert_eq!(said(10..=20), "");
        assert_eq!(
            said(1..=12),
            " as OpenCV's glob has them (img1.png, img10.png, img11.png, …), not of the numbers in them (img1.png, \
             img2.png, img3.png, …)"
        );
        assert_eq!(
            said(8..=10),
            " as OpenCV's glob has them (img10.png, img8.png, img9.png), not of the numbers in them (img8.png, \
             img9.png, img10.png)"
        );
    }
}
