use crate::CaptureError;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// What a photo's name may end in.
pub(crate) const EXTENSIONS: [&str; 3] = ["jpg", "jpeg", "png"];

/// The photos in a folder and the folders within.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PhotoSet {
    /// The folder that the names are relative to.
    pub root: PathBuf,
    /// Sorted by name, byte by byte.
    pub photos: Vec<PhotoFile>,
}

/// A photo that has not been opened yet.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PhotoFile {
    /// Its path relative to the set's root, `/` between the parts: what calibrations
    /// call it.
    pub name: String,
    /// Where it lies.
    pub path: PathBuf,
}

impl PhotoSet {
    /// Lists the JPEG and PNG files of a folder and the folders within, by their
    /// extensions in any case. Names that begin with a dot are left out, and scenes within, whose files an import made.
    ///
    /// # Errors
    /// A folder that cannot be listed or holds no photo; a photo whose name is not UTF-8.
    pub fn open(folder: &Path) -> Result<PhotoSet, CaptureError> {
        let mut photos = Vec::new();
        collect(
            folder,
            "",
            has_photo_extension,
            &mut Vec::new(),
            &mut photos,
        )?;
        if photos.is_empty() {
            return Err(CaptureError::NoPhotos {
                folder: folder.to_owned(),
            });
        }
        photos.sort_by(|a, b| a.name.cmp(&b.name));
        Ok(PhotoSet {
            root: folder.to_owned(),
            photos,
        })
    }

    /// The photo of a name.
    pub fn find(&self, name: &str) -> Option<&PhotoFile> {
        let index = self
            .photos
            .binary_search_by(|photo| photo.name.as_str().cmp(name))
            .ok()?;
        Some(&self.photos[index])
    }
}

/// The visible files in a folder and the folders within whose extensions are no photo's, by names like
/// photos' and sorted by them.
///
/// # Errors
/// A folder that cannot be listed; a file whose name is not UTF-8.
pub(crate) fn other_files(folder: &Path) -> Result<Vec<PhotoFile>, CaptureError> {
    let mut files = Vec::new();
    let is_other = |path: &Path| !has_photo_extension(path);
    collect(folder, "", is_other, &mut Vec::new(), &mut files)?;
    files.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(files)
}

/// What a folder holds that is a scene.
const SCENE_FILE: &str = "scene.json";

/// What photos' files end in that are of kinds not read here.
const UNREAD: [&str; 18] = [
    "heic", "heif", "avif", "webp", "tif", "tiff", "bmp", "jxl", "jp2", "dng", "cr2", "cr3", "nef",
    "arw", "orf", "raf", "rw2", "jpe",
];

/// The photos in a folder, and in those within it, that are of kinds which are not read, by their extensions: their names, sorted.
/// None where it cannot be listed.
pub fn unread_photos(folder: &Path) -> Vec<String> {
    let is_unread = |path: &Path| {
        let end = path.extension().unwrap_or_default();
        UNREAD.iter().any(|known| end.eq_ignore_ascii_case(known))
    };
    let mut files = Vec::new();
    let listed = collect(folder, "", is_unread, &mut Vec::new(), &mut files);
    let mut names: Vec<String> = files.into_iter().map(|file| file.name).collect();
    names.sort();
    listed.map_or_else(|_| Vec::new(), |()| names)
}

/// Where a capture's photos are: in its folder `images`, or else in the capture itself if
/// it directly holds some.
pub fn find_photos_folder(capture: &Path) -> Option<PathBuf> {
    let images = capture.join("images");
    if images.is_dir() {
        return Some(images);
    }
    let holds_photo = fs::read_dir(capture).ok()?.flatten().any(|entry| {
        let path = entry.path();
        is_photo(&path) && path.is_file()
    });
    holds_photo.then(|| capture.to_owned())
}

/// The same; else the capture itself if folders within hold some, as where each camera of a rig has
/// its own. Not asked are hidden ones, those directly in the capture that are called as one of
/// `others`, and captures of their own, which have `images` in them.
pub fn find_photos_within(capture: &Path, others: &[&str]) -> Option<PathBuf> {
    find_photos_folder(capture).or_else(|| {
        let is_other = |path: &Path| {
            let name = path.file_name().and_then(|name| name.to_str());
            name.is_some_and(|name| others.contains(&name))
        };
        let mut folders = folders_in(capture).into_iter();
        let holds_some =
            folders.any(|path| !is_other(&path) && holds_photos(&path, &mut Vec::new()));
        holds_some.then(|| capture.to_owned())
    })
}

/// Whether a folder, or one within, holds a photo, and is no capture of its own.
fn holds_photos(folder: &Path, around: &mut Vec<PathBuf>) -> bool {
    // As in `collect`, of links.
    let Ok(real) = fs::canonicalize(folder) else {
        return false;
    };
    if around.contains(&real) || folder.join("images").is_dir() {
        return false;
    }
    around.push(real);
    let photos = find_photos_folder(folder);
    let found = photos.is_some()
        || folders_in(folder)
            .iter()
            .any(|path| holds_photos(path, around));
    around.pop();
    found
}

/// The visible folders in one; none where it cannot be listed.
fn folders_in(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let paths = entries.map(|entry| entry.path());
    paths
        .filter(|path| !is_hidden(path) && path.is_dir())
        .collect()
}

/// Appends the visible files in `folder` that are wanted, whose own name within the set is `prefix`.
fn collect(
    folder: &Path,
    prefix: &str,
    is_wanted: fn(&Path) -> bool,
    around: &mut Vec<PathBuf>,
    photos: &mut Vec<PhotoFile>,
) -> Result<(), CaptureError> {
    let failed = |source: io::Error| CaptureError::List {
        folder: folder.to_owned(),
        source,
    };
    // A link to a folder around this one would lead in a circle.
    let real = fs::canonicalize(folder).map_err(failed)?;
    if around.contains(&real) {
        return Ok(());
    }
    around.push(real);
    for entry in fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        let Some(file_name) = path.file_name() else {
            continue;
        };
        if is_hidden(&path) || !(is_wanted(&path) || path.is_dir()) {
            continue;
        }
        // What an import put there is none of the photos.
        if path.join(SCENE_FILE).is_file() {
            continue;
        }
        let Some(file_name) = file_name.to_str() else {
            return Err(CaptureError::Name { path });
        };
        let name = format!("{prefix}{file_name}");
        if path.is_dir() {
            collect(&path, &format!("{name}/"), is_wanted, around, photos)?;
        } else {
            photos.push(PhotoFile { name, path });
        }
    }
    around.pop();
    Ok(())
}

fn is_hidden(path: &Path) -> bool {
    path.file_name()
        .is_some_and(|name| name.as_encoded_bytes().starts_with(b"."))
}

/// Whether a name is a photo's: visible, with one of the extensions.
fn is_photo(path: &Path) -> bool {
    !is_hidden(path) && has_photo_extension(path)
}

/// Whether a name ends in what photos' names may end in: `.jpg`, `.jpeg` or `.png`, in any case.
pub fn has_photo_extension(path: &Path) -> bool {
    let extension = path.extension().and_then(|extension| extension.to_str());
    let known = |extension: &str| {
        EXTENSIONS
            .iter()
            .any(|known| extension.eq_ignore_ascii_case(known))
    };
    extension.is_some_and(known)
}
