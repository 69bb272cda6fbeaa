//! The files that pictures and calibrations follow from.

use calibrate::colmap;
use capture::{PhotoSet, find_photos_folder};
use lumigraph::scene::file::SceneFile;
use lumigraph::scene::{self, Photo, Scene};
use proxy::interior::Interior;
use proxy::mesh::files_beside;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// The files of a scene that decide what its pictures are.
pub(super) fn files_of(scene: &Scene) -> Vec<PathBuf> {
    let of_photo = |p: &Photo| {
        let beside = [&p.ignore_mask, &p.object_matte, &p.silhouette, &p.depth_map];
        let beside = beside.into_iter().flatten().cloned();
        std::iter::once(p.path.clone())
            .chain(beside)
            .collect::<Vec<_>>()
    };
    let own = scene.folder.iter().flat_map(|folder| {
        let proxy = scene.proxy.iter().map(|p| folder.join(&p.file));
        proxy.chain([folder.join("scene.json")])
    });
    own.chain(scene.photos.iter().flat_map(of_photo)).collect()
}

/// All files that belong to a scene or a capture, whether or not they decide any picture: its photos, those
/// left out, too, the video that they were taken out of, its calibration, its splits.
pub(super) fn files_behind_scene(given: &Path, scene: &Scene) -> Vec<PathBuf> {
    let mut all = files_of(scene);
    all.extend(files_of_places(given));
    all.extend(video_of(given));
    let origin = scene.calibration.as_deref().or(scene.capture.as_deref());
    let origin = origin.and_then(calibration_in);
    all.extend(origin.iter().flat_map(|path| parts_of(path)));
    let folders = [&scene.folder, &scene.capture].into_iter().flatten();
    all.extend(folders.map(|folder| folder.join("split.json")));
    // What cannot be listed holds none that could be told from other files.
    let found = photo_folders(scene).into_iter();
    let found = found.filter_map(|folder| PhotoSet::open(&folder).ok());
    all.extend(found.flat_map(|set| set.photos).map(|p| p.path));
    all
}

/// The folders of which all pictures, in whatever folders within, are photos to an import: that of a scene's capture,
/// and its own if it has copies of them.
pub(super) fn photo_folders(scene: &Scene) -> Vec<PathBuf> {
    let of_capture = scene.capture.as_ref().and_then(|capture| {
        let of_cameras = || Some(Scene::photos_of(capture).ok()?.root);
        find_photos_folder(capture).or_else(of_cameras)
    });
    let own = scene.folder.as_ref().and_then(|folder| {
        let images = find_photos_folder(folder).filter(|images| images != folder)?;
        // Pictures may have been drawn there.
        let real = images.canonicalize().ok()?;
        let photos = scene.photos.iter();
        let folders: BTreeSet<&Path> = photos.filter_map(|photo| photo.path.parent()).collect();
        let is_within = |folder: &Path| folder.canonicalize().is_ok_and(|f| f.starts_with(&real));
        folders.into_iter().any(is_within).then_some(images)
    });
    own.into_iter().chain(of_capture).collect()
}

/// The files that frames are made of, besides photos and what lies beside these: those that options name (of a
/// folder, the COLMAP model in it; of a mesh, what it has beside it, too), and the calibrations of scenes and captures.
pub(super) fn files_behind(
    named: impl IntoIterator<Item = PathBuf>,
    scenes: &[PathBuf],
) -> Vec<PathBuf> {
    let mut all = Vec::new();
    for path in named {
        match colmap::find_model(&path) {
            Ok(model) => all.extend(model_files(&model)),
            Err(_) => all.extend(files_of_mesh(path)),
        }
    }
    all.extend(scenes.iter().flat_map(|folder| files_of_places(folder)));
    all
}

/// A mesh's or a model's file, and those beside it that it has numbers and textures in; of any other file, that
/// alone.
pub(super) fn files_of_mesh(file: PathBuf) -> Vec<PathBuf> {
    // What is wrong with it is said where it is read.
    let mut files = files_beside(&file).unwrap_or_default();
    files.push(file);
    files
}

/// The folders of the scenes that show an interior's cells; `file` is the interior's.
pub(super) fn scenes_of(file: &Path, interior: &Interior) -> Vec<PathBuf> {
    let beside = file.parent().unwrap_or(Path::new(""));
    let folders = interior.cells.iter().filter_map(|c| c.content.scene());
    let folders: BTreeSet<&str> = folders.collect();
    folders.into_iter().map(|f| beside.join(f)).collect()
}

/// The files that say where the photos of a scene or a capture were taken, and of a capture, when. Some
/// may not be there.
pub(super) fn files_of_places(folder: &Path) -> Vec<PathBuf> {
    let calibration = calibration_of(folder);
    let of_calibration = calibration.iter().flat_map(|path| parts_of(path));
    if Scene::is_scene(folder) {
        return of_calibration.collect();
    }
    let mut files = vec![folder.join("times.csv")];
    files.extend(of_calibration);
    // Some calibrations leave it to a list which photos they are of; a model does not.
    if !calibration.is_some_and(|path| path.is_dir()) {
        let is_list = |file: &PathBuf| {
            let name = file.file_name().unwrap_or_default().to_string_lossy();
            name.to_ascii_lowercase().contains("list")
        };
        files.extend(files_in(folder).into_iter().filter(is_list));
    }
    files
}

/// The model of a scene's folder, or the calibration of a capture.
pub(super) fn calibration_of(folder: &Path) -> Option<PathBuf> {
    match scene_file(folder) {
        Some(scene) => Some(folder.join(scene.model)),
        None => calibration_in(folder),
    }
}

/// The video that the photos of a scene's folder were taken out of, if they were.
pub(super) fn video_of(folder: &Path) -> Option<PathBuf> {
    Some(folder.join(scene_file(folder)?.settings.video?))
}

/// What makes a folder a scene, if it is one.
fn scene_file(folder: &Path) -> Option<SceneFile> {
    let file = folder.join("scene.json");
    let bytes = std::fs::read(&file).ok()?;
    SceneFile::parse(&file, &bytes).ok()
}

/// The calibration that `import` reads of a capture's folder, or is told by a file: a COLMAP model's folder or a
/// file.
pub(super) fn calibration_in(path: &Path) -> Option<PathBuf> {
    if path.is_file() {
        let folder = path.parent().unwrap_or(Path::new(""));
        let is_model = model_files(folder).iter().any(|file| file == path);
        return Some(if is_model { folder } else { path }.to_owned());
    }
    scene::calibration_in(path)
}

/// The files of a calibration: its own, or those of a COLMAP model in a folder.
pub(super) fn parts_of(calibration: &Path) -> Vec<PathBuf> {
    match calibration.is_dir() {
        true => model_files(calibration),
        false => vec![calibration.to_owned()],
    }
}

/// The files of a COLMAP model, of either format: a binary model hides a text model beside it.
pub(super) fn model_files(folder: &Path) -> Vec<PathBuf> {
    let parts = ["cameras", "images", "points3D"].into_iter();
    let files = parts.flat_map(|part| ["bin", "txt"].map(|end| format!("{part}.{end}")));
    files.map(|name| folder.join(name)).collect()
}

/// A folder's files, by name.
fn files_in(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut files: Vec<PathBuf> = entries.map(|e| e.path()).filter(|p| p.is_file()).collect();
    files.sort();
    files
}
