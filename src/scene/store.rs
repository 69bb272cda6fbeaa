//! A scene's folder.

use super::file::{PhotoEntry, SceneFile};
use super::own::proxy_file;
use super::parts::{COLMAP_FOLDER, FRAMES_FOLDER, MODEL_FOLDER, PARTS, SCENE_FILE, WORK_PREFIX};
use super::put_back::{NEW_FOLDER, OLD_FOLDER};
use super::relative::relative;
use super::{Photo, Scene, SceneError, SceneProxy, Warning};
use calibrate::colmap;
use capture::folder::exchange;
use capture::hold::hold;
use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// What a photo's brightness may be multiplied by: more is none of a picture's.
const GAINS: RangeInclusive<f64> = 1e-6..=1e6;

impl Scene {
    /// Opens a scene's folder, or imports a capture's in memory with the defaults.
    ///
    /// Photos are checked as by [`Scene::import`].
    ///
    /// # Errors
    /// As for [`Scene::import`]; a damaged `scene.json`.
    pub fn open(folder: &Path, strict: bool) -> Result<(Self, Vec<Warning>), SceneError> {
        let path = folder.join(SCENE_FILE);
        if !Self::is_scene(folder) {
            return Self::open_capture(folder, strict, None);
        }
        let bytes = std::fs::read(&path).map_err(|e| io(&path, "read the scene", e))?;
        let file = SceneFile::parse(&path, &bytes)?;
        let mut scene = Self::from_file(file, folder, &path)?;
        let warnings = scene.leave_out_unusable(strict, &BTreeMap::new())?;
        scene.check_beside()?;
        Ok((scene, warnings))
    }

    /// Whether a folder is a scene's.
    pub fn is_scene(folder: &Path) -> bool {
        folder.join(SCENE_FILE).is_file()
    }

    fn from_file(file: SceneFile, folder: &Path, path: &Path) -> Result<Self, SceneError> {
        let inconsistent = |problem: String| SceneError::Inconsistent {
            path: path.to_owned(),
            problem,
        };
        let mut reconstruction = colmap::read_model(&folder.join(&file.model))?;
        let posed: BTreeSet<&str> = reconstruction
            .images
            .values()
            .map(|i| i.name.as_str())
            .collect();
        let at = |path: &Option<String>| path.as_ref().map(|p| folder.join(p));
        let mut photos = Vec::new();
        for entry in file.photos {
            if !posed.contains(entry.name.as_str()) {
                let problem = format!("photo {} is not in the model", entry.name);
                return Err(inconsistent(problem));
            }
            if !entry.gain.iter().flatten().all(|g| GAINS.contains(g)) {
                let problem = format!(
                    "photo {}: a gain must be positive, and between {} and {}",
                    entry.name,
                    GAINS.start(),
                    GAINS.end()
                );
                return Err(inconsistent(problem));
            }
            let is_positive = |step: f64| step > 0.0 && step.is_finite();
            if !entry.depth_scale.is_none_or(is_positive) {
                let problem = format!("photo {}: the depth scale must be positive", entry.name);
                return Err(inconsistent(problem));
            }
            if let Some([near, far]) = entry.depth_bounds
                && !(near > 0.0 && near < far && far.is_finite())
            {
                let name = &entry.name;
                return Err(inconsistent(format!(
                    "photo {name}: the depth bounds are {near} and {far}, expected 0 < nearest < farthest"
                )));
            }
            if let Some(orientation) = entry.orientation
                && !(1..=8).contains(&orientation)
            {
                let name = &entry.name;
                return Err(inconsistent(format!(
                    "photo {name}: the orientation is {orientation}, expected EXIF's 1 to 8"
                )));
            }
            photos.push(Photo {
                path: folder.join(&entry.path),
                original: entry.original,
                ignore_mask: at(&entry.ignore_mask),
                object_matte: at(&entry.object_matte),
                silhouette: at(&entry.silhouette),
                depth_map: at(&entry.depth_map),
                depth_scale: entry.depth_scale,
                time_s: entry.time_s,
                gain: entry.gain,
                depth_bounds: entry.depth_bounds,
                orientation: entry.orientation,
                other: entry.other,
                name: entry.name,
            });
        }
        photos.sort_by(|a, b| a.name.cmp(&b.name));
        if let Some(pair) = photos.windows(2).find(|pair| pair[0].name == pair[1].name) {
            return Err(inconsistent(format!(
                "photo {} is listed twice",
                pair[0].name
            )));
        }
        if photos.is_empty() {
            return Err(inconsistent("no photo is listed".to_owned()));
        }
        // Images without a photo take no part, just as at the import.
        let listed: BTreeSet<&str> = photos.iter().map(|p| p.name.as_str()).collect();
        let unlisted: BTreeSet<String> = posed
            .difference(&listed)
            .map(|&name| name.to_owned())
            .collect();
        reconstruction.remove_images(&unlisted);
        Ok(Self {
            photos,
            reconstruction,
            proxy: file.proxy.map(|entry| SceneProxy::read(entry, folder)),
            exposure: file.exposure,
            capture: at(&file.settings.capture),
            video: at(&file.settings.video),
            calibration: at(&file.settings.calibration),
            settings: file.settings,
            folder: Some(folder.to_owned()),
            left_out: file.left_out,
            other: file.other,
        })
    }

    /// The folder of a scene in which COLMAP works, for photos without a calibration.
    pub fn colmap_folder(folder: &Path) -> PathBuf {
        folder.join(COLMAP_FOLDER)
    }

    /// The folder of a scene for photos that are taken out of a video.
    pub fn frames_folder(folder: &Path) -> PathBuf {
        folder.join(FRAMES_FOLDER)
    }

    /// Writes the scene's files, complete or not at all. COLMAP's work and the frames of a
    /// video, which may be in the folder already, stay.
    ///
    /// # Errors
    /// As [`Scene::check_free`] and [`Scene::check_apart`]; files that cannot be written.
    pub fn save(&mut self, folder: &Path, replace: bool) -> Result<(), SceneError> {
        self.write_folder(folder, replace, |_, _| Ok(()))
    }

    /// [`Scene::save`]; `fill` first puts further files into the folder in the making and
    /// has the scene name them.
    pub(super) fn write_folder(
        &mut self,
        folder: &Path,
        replace: bool,
        fill: impl FnOnce(&mut Self, &Path) -> Result<(), SceneError>,
    ) -> Result<(), SceneError> {
        Self::check_free(folder, replace)?;
        Self::check_apart(folder, self.inputs())?;
        let is_missing = |path: &&Path| !path.as_os_str().is_empty() && !path.exists();
        let missing: Vec<&Path> = folder.ancestors().take_while(is_missing).collect();
        let written = self.write_parts(folder, replace, fill);
        if written.is_err() {
            for path in missing {
                // One that is not empty stays.
                let _ = std::fs::remove_dir(path);
            }
        }
        written
    }

    /// Whether no file or folder that a scene is made of goes as it is written to a folder:
    /// those within a part of an earlier scene there would.
    ///
    /// # Errors
    /// One would go.
    pub fn check_apart(
        folder: &Path,
        inputs: impl IntoIterator<Item = PathBuf>,
    ) -> Result<(), SceneError> {
        let Ok(real) = folder.canonicalize() else {
            return Ok(());
        };
        let is_replaced = |input: &PathBuf| {
            let input = input.canonicalize();
            input.is_ok_and(|input| PARTS.iter().any(|part| input.starts_with(real.join(part))))
        };
        match inputs.into_iter().find(is_replaced) {
            None => Ok(()),
            Some(input) => Err(SceneError::Occupied {
                path: folder.to_owned(),
                problem: format!(
                    "the new scene is made of {}, which would be replaced; choose another folder",
                    input.display()
                ),
            }),
        }
    }

    /// The files and folders that the scene refers to or was calibrated by.
    fn inputs(&self) -> Vec<PathBuf> {
        let given = self.calibration.as_ref().or(self.capture.as_ref());
        let model = given.and_then(|folder| colmap::find_model(folder).ok());
        let mut inputs: Vec<PathBuf> = model.into_iter().collect();
        inputs.extend(self.calibration.clone());
        for photo in &self.photos {
            inputs.push(photo.path.clone());
            let beside = [
                &photo.ignore_mask,
                &photo.object_matte,
                &photo.silhouette,
                &photo.depth_map,
            ];
            inputs.extend(beside.into_iter().flatten().cloned());
        }
        inputs.extend(self.capture.clone());
        inputs.extend(self.video.clone());
        inputs
    }

    /// Writes all parts and has them take their places, all or none.
    fn write_parts(
        &mut self,
        folder: &Path,
        replace: bool,
        fill: impl FnOnce(&mut Self, &Path) -> Result<(), SceneError>,
    ) -> Result<(), SceneError> {
        // 1. Everything into a folder within it, which goes away on errors.
        std::fs::create_dir_all(folder).map_err(|e| io(folder, "make the folder", e))?;
        let (made, new) = make_within(folder)?;
        // So that no other import takes it for what is left of one that was killed. One may be looking just now.
        let _held = hold(made.path());
        fill(self, &new)?;
        colmap::write_text(&self.reconstruction, &new.join(MODEL_FOLDER))?;
        if let Some(own) = &mut self.proxy {
            own.file = proxy_file(own.surface()?).to_owned();
            proxy::write(&new.join(&own.file), own.surface()?, &[], &[])?;
        }
        self.write_file(&new.join(SCENE_FILE), folder)?;

        // 2. They take their places, if no other scene has meanwhile. Of two that do so at once one would take the other's
        // parts away, and take those that it puts back for its own.
        let _exchanging = hold_above(folder);
        Self::check_free(folder, replace)?;
        let old = made.path().join(OLD_FOLDER);
        std::fs::create_dir(&old).map_err(|e| io(&old, "make the folder", e))?;
        let exchanged = exchange(&PARTS, &new, folder, &old);
        if exchanged.is_err() && std::fs::remove_dir(&old).is_err() {
            // It still holds what could not be put back.
            let _ = made.keep();
        }
        exchanged.map_err(|e| io(folder, "replace the scene", e))?;
        self.folder = Some(folder.to_owned());
        Ok(())
    }

    /// Writes `scene.json` to `path`, its paths relative to `folder`.
    fn write_file(&self, path: &Path, folder: &Path) -> Result<(), SceneError> {
        let from_here = |path: &Option<PathBuf>| {
            let path = path.as_ref().map(|p| relative(folder, p));
            path.transpose()
        };
        let entry = |photo: &Photo| {
            Ok(PhotoEntry {
                name: photo.name.clone(),
                path: relative(folder, &photo.path)?,
                original: photo.original.clone(),
                ignore_mask: from_here(&photo.ignore_mask)?,
                object_matte: from_here(&photo.object_matte)?,
                silhouette: from_here(&photo.silhouette)?,
                depth_map: from_here(&photo.depth_map)?,
                depth_scale: photo.depth_scale,
                time_s: photo.time_s,
                gain: photo.gain,
                depth_bounds: photo.depth_bounds,
                orientation: photo.orientation,
                other: photo.other.clone(),
            })
        };
        let photos: Result<Vec<PhotoEntry>, SceneError> = self.photos.iter().map(entry).collect();
        let own = self.proxy.as_ref().map(SceneProxy::entry).transpose()?;
        let mut settings = self.settings.clone();
        settings.capture = from_here(&self.capture)?;
        settings.calibration = from_here(&self.calibration)?;
        // Nothing is read of it again: where its path is one that no JSON holds, it is not named.
        let video = self.video.as_ref();
        settings.video = video.and_then(|video| relative(folder, video).ok());
        let file = SceneFile {
            version: 1,
            photos: photos?,
            left_out: self.left_out.clone(),
            model: MODEL_FOLDER.to_owned(),
            proxy: own,
            exposure: self.exposure.clone(),
            settings,
            other: self.other.clone(),
        };
        write_json(path, &file)
    }
}

/// Makes a folder within another, which goes away on errors, and one in it for what is new there.
pub(super) fn make_within(folder: &Path) -> Result<(TempDir, PathBuf), SceneError> {
    let made = tempfile::Builder::new()
        .prefix(WORK_PREFIX)
        .tempdir_in(folder)
        .map_err(|e| io(folder, "make a folder within", e))?;
    let new = made.path().join(NEW_FOLDER);
    std::fs::create_dir(&new).map_err(|e| io(&new, "make the folder", e))?;
    Ok((made, new))
}

/// Holds the folder that a scene's lies in: the scene's own an import may hold as COLMAP works there. For as long as
/// parts of the scene change places; see [`hold`] for what `None` is.
pub(super) fn hold_above(scene: &Path) -> Option<File> {
    hold(scene.canonicalize().ok()?.parent()?)
}

/// Into a folder in the making.
pub(super) fn write_json(path: &Path, value: &impl serde::Serialize) -> Result<(), SceneError> {
    let text = serde_json::to_string_pretty(value).map_err(|source| SceneError::Json {
        path: path.to_owned(),
        expected: "writable as JSON",
        source,
    })?;
    std::fs::write(path, text + "\n").map_err(|e| io(path, "write", e))
}

pub(super) fn io(path: &Path, doing: &'static str, source: std::io::Error) -> SceneError {
    SceneError::Io {
        path: path.to_owned(),
        doing,
        source,
    }
}
