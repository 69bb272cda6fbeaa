//! From a capture to a scene.

use super::beside;
use super::calibration::{self, Source};
use super::file::{Extra, Settings};
use super::home::{error_of_photos, home_of, note_of_home};
use super::meant::Meant;
use super::misfit;
use super::named::Named;
use super::resized::{self, is_resized};
use super::times::{Clues, TimeSource, set_times, taken};
use super::turned::{self, Pixels};
use super::{Photo, Scene, SceneError, Warning};
use calibrate::formats::Format;
use calibrate::opencv::Keys;
use calibrate::{Reconstruction, colmap};
use capture::{CaptureError, PhotoFile, PhotoSet, find_photos_within, photo_size};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Display;
use std::path::{Path, PathBuf};

/// How photos are imported.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ImportOptions {
    /// Where the calibration is: a COLMAP model or a folder with one, or a file by OpenCV
    /// or another program that [`calibrate::formats`] knows;
    /// `None`: in the capture's folder.
    pub calibration: Option<PathBuf>,
    /// Which of an OpenCV file's matrices to use.
    pub keys: Keys,
    /// Where the photos' times come from.
    pub times: TimeSource,
    /// Cameras follow photos that were reduced or enlarged since they were calibrated, which are an error else.
    pub resized: bool,
    /// A missing or corrupt photo is an error rather than left out.
    pub strict: bool,
    /// The folder with ignore masks, `a.jpg.png` or `a.png` for the photo `a.jpg`, as is or
    /// within the capture; `None`: the capture's `masks`, if it has one.
    pub masks: Option<PathBuf>,
    /// Without [`Self::masks`], use none.
    pub no_masks: bool,
    /// The folder with object mattes, named likewise; `None`: there are none but the
    /// photos' alpha channels.
    pub mattes: Option<PathBuf>,
    /// The folder with depth maps, named likewise; `None`: the capture's `depth`, if it has
    /// one.
    pub depth: Option<PathBuf>,
    /// Without [`Self::depth`], use none.
    pub no_depth: bool,
    /// World units a step of the depth maps; `None`: what a calibration that names them says, else
    /// [`DEPTH_UNITS_PER_STEP`](super::DEPTH_UNITS_PER_STEP).
    pub depth_scale: Option<f64>,
}

/// Photos that must remain for others to be left out.
pub(super) const ENOUGH: usize = 2;
/// What to do where too few of a calibration's photos are there, or of a scene's.
const OTHERS: &str = "check that the calibration belongs to these photos";
const MOVED: &str = "photos stay where they are, and a scene says how to get there from its own folder: move \
                     them or the scene back, or import them again";

impl Scene {
    /// Imports a capture, a folder of photos with a calibration in it or beside it. Where COLMAP's model of
    /// photos that it undistorted is taken, the photos are those, which lie beside it.
    ///
    /// Every photo's size is compared with its camera's, and those of masks, mattes and depth
    /// maps with their photos', from the files' headers. Photos get times where some are to be
    /// had (see [`TimeSource`]). A photo that the calibration calls otherwise in letters' case, in how marks are
    /// written or in what it ends in alone is found, with a note. A calibrated photo that is missing, or whose
    /// header cannot be read, is left out with a warning as long as two others remain. Depth maps that cannot be
    /// used are passed over with a note where nobody asked for them.
    ///
    /// # Errors
    /// No calibration or no photos where they should be; a damaged calibration; a photo of
    /// another size than calibrated; a mask or matte of another size than its photo, or
    /// unreadable, or such a depth map of [`ImportOptions::depth`]; a list of times with a mistake;
    /// too few photos left, or with [`ImportOptions::strict`] any missing or corrupt one.
    pub fn import(
        capture: &Path,
        options: &ImportOptions,
    ) -> Result<(Self, Vec<Warning>), SceneError> {
        // 1. The calibration.
        let mut warnings = Vec::new();
        if !capture.is_dir() {
            return Err(SceneError::no_folder(capture));
        }
        let source = calibration::find(capture, options, &mut warnings)?;

        // 2. The photos, matched by name.
        let home = home_of(&source, capture);
        warnings.extend(note_of_home(&source, capture, &home));
        let found = Self::photos_of(&home).map_err(|error| error_of_photos(&source, error))?;
        let mut pixels = Pixels::Stored;
        let mut called = BTreeMap::new();
        let mut reconstruction = match &source {
            Source::Colmap(model) => calibration::read_colmap(model, &mut warnings)?,
            // OpenCV may leave it to the photos which is which.
            Source::OpenCv(file) => {
                let read = calibration::read_opencv(file, options, &found, &mut warnings)?;
                pixels = read.1;
                read.0
            }
            Source::Other(format, file) => {
                let read = calibration::read_other(*format, file, &found, &mut warnings)?;
                called = read.1;
                read.0
            }
        };
        let bounds = match &source {
            Source::Other(Format::Llff, file) => calibration::depth_bounds(file, &found)?,
            _ => BTreeMap::new(),
        };
        let meant = Meant::of(&mut reconstruction, &found, &home, source.path());
        let mut scene = Self::of(reconstruction, capture, &found, &bounds, options);
        for photo in &mut scene.photos {
            if let Some(file) = meant.photos.get(&photo.name) {
                photo.path.clone_from(&file.path);
            }
        }
        warnings.extend(meant.note(scene.photos.len()));
        let names = scene.photos.iter().map(|photo| photo.name.as_str());
        let files = meant.photos.values().map(|file| file.name.as_str());
        let names: BTreeSet<&str> = names.chain(files).collect();
        let named = Named::of(&source, &called)?;
        let photos = found.photos.iter();
        let mut unused: Vec<&PhotoFile> = photos
            .filter(|photo| !names.contains(photo.name.as_str()))
            .collect();
        let mut total = found.photos.len();
        if let (Some(named), false) = (&named, unused.is_empty()) {
            // Masks and depth maps may lie where photos are looked for.
            total -= unused.len();
            let beside = named.real_files();
            let real = |photo: &PhotoFile| photo.path.canonicalize().ok();
            unused.retain(|photo| real(photo).is_none_or(|file| !beside.contains(&file)));
            total += unused.len();
        }
        if let Some(example) = unused.first() {
            warnings.push(Warning::Uncalibrated {
                count: unused.len(),
                total,
                example: example.name.clone(),
            });
        }
        let clues = Clues {
            capture,
            found: &found,
            meant: &meant,
            named: named.as_ref(),
        };
        let taken = taken(&scene.photos);
        let times = &options.times;
        set_times(&mut scene.photos, times, &taken, &clues, &mut warnings)?;
        turned::set(&mut scene.photos, &taken);
        warnings.extend(match pixels {
            Pixels::Stored => turned::note(&scene.photos),
            Pixels::Shown { is_sized } => turned::undo(&mut scene, source.path(), is_sized)?,
        });

        // 3. Are they what was calibrated, or copies of that?
        if options.resized {
            warnings.push(resized::follow(&mut scene)?);
        }
        warnings.extend(misfit::of(&scene.reconstruction));
        warnings.extend(misfit::of_principal(&scene.reconstruction));
        warnings.extend(misfit::of_extent(&scene.reconstruction));
        warnings.extend(scene.leave_out_unusable(options.strict, &meant.near)?);

        // 4. What lies beside them.
        scene.find_beside(&home, &meant, options, &mut warnings)?;
        let passed_over = scene.pass_over_depth(&home, options, &mut warnings);
        if let Some(mut named) = named {
            named.forget_depth(&passed_over);
            scene.add_named(named, options, &mut warnings);
        }
        scene.check_beside()?;
        warnings.extend(scene.note_of_hidden());
        scene.judge_masks(options.masks.is_some(), &mut warnings);
        scene.judge_depth(&mut warnings);
        Ok((scene, warnings))
    }

    /// The photos of a capture: those in its folder `images`, or else in itself and the folders within, but for
    /// those where masks, mattes, silhouettes and depth maps are.
    ///
    /// # Errors
    /// There are none; a folder that cannot be listed; a name that is not UTF-8.
    pub fn photos_of(capture: &Path) -> Result<PhotoSet, SceneError> {
        if !capture.is_dir() {
            return Err(SceneError::no_folder(capture));
        }
        let folder = find_photos_within(capture, &beside::FOLDERS)
            .ok_or_else(|| SceneError::no_photos(capture))?;
        let mut found = PhotoSet::open(&folder)?;
        if folder == capture {
            // Photos that lie in the capture itself have their masks within.
            found.photos.retain(|photo| !beside::is_beside(&photo.name));
        }
        Ok(found)
    }

    /// A scene of a reconstruction's photos and nothing beside them yet.
    pub(super) fn of(
        reconstruction: Reconstruction,
        capture: &Path,
        found: &PhotoSet,
        bounds: &BTreeMap<String, [f64; 2]>,
        options: &ImportOptions,
    ) -> Self {
        let mut names: Vec<&String> = reconstruction.images.values().map(|i| &i.name).collect();
        names.sort();
        let photo = |name: &String| Photo {
            name: name.clone(),
            path: found.root.join(name),
            original: None,
            ignore_mask: None,
            object_matte: None,
            silhouette: None,
            depth_map: None,
            depth_scale: None,
            time_s: None,
            gain: None,
            depth_bounds: bounds.get(name.as_str()).copied(),
            orientation: None,
            other: Extra::new(),
        };
        Self {
            photos: names.into_iter().map(photo).collect(),
            reconstruction,
            proxy: None,
            exposure: None,
            settings: Settings {
                camera_matrix: options.keys.camera_matrix.clone(),
                distortion: options.keys.distortion.clone(),
                fisheye: options.keys.fisheye,
                strict: options.strict,
                program: Some(concat!("lumigraph ", env!("CARGO_PKG_VERSION")).to_owned()),
                ..Settings::default()
            },
            folder: None,
            capture: Some(capture.to_owned()),
            video: None,
            calibration: options.calibration.clone(),
            left_out: Vec::new(),
            other: Extra::new(),
        }
    }

    /// Compares every photo's size with its camera's, and leaves out what cannot be used. `near` says of
    /// names what is called nearly so.
    pub(super) fn leave_out_unusable(
        &mut self,
        strict: bool,
        near: &BTreeMap<String, String>,
    ) -> Result<Vec<Warning>, SceneError> {
        let images = self.images_by_name();
        let mut unusable: Vec<(String, String)> = Vec::new();
        for photo in &self.photos {
            let camera = &self.reconstruction.cameras[&images[photo.name.as_str()].camera_id];
            let expected = (camera.width, camera.height);
            match photo_size(&photo.path) {
                Ok(found) if found == expected => {}
                Ok(found) => {
                    let path = photo.path.clone();
                    let size = CaptureError::Size {
                        path,
                        found,
                        expected,
                    };
                    return Err(match is_resized(found, expected) {
                        true => SceneError::Resized(size),
                        false => SceneError::Capture(size),
                    });
                }
                Err(error) => {
                    let near = near.get(&photo.name);
                    let near = near.map_or_else(String::new, |near| format!("; {near}"));
                    unusable.push((photo.name.clone(), format!("{error}{near}")));
                }
            }
        }
        self.leave_out(unusable, strict)
    }

    /// Leaves out the photos whose names the model in a scene's folder cannot hold.
    ///
    /// # Errors
    /// As where photos are missing.
    pub fn leave_out_unwritable(&mut self, strict: bool) -> Result<Vec<Warning>, SceneError> {
        const REASON: &str = "a scene cannot hold its name, which begins or ends with white space or has a line break \
                              or a `\\`; rename the photo, in the calibration, too";
        let names = self.photos.iter().map(|photo| photo.name.as_str());
        let unwritable = names.filter(|name| !colmap::fits_text(name));
        let unwritable: Vec<(String, &str)> =
            unwritable.map(|name| (name.to_owned(), REASON)).collect();
        self.leave_out(unwritable, strict)
    }

    /// Fails of the first photo that cannot be decoded, or of which a mask, a matte, a silhouette or a depth map cannot:
    /// headers tell nothing of that.
    ///
    /// # Errors
    /// As said; as where a missing photo is one.
    pub fn check_photos(&self) -> Result<(), SceneError> {
        let images = self.images_by_name();
        let wrong = |photo: &Photo| {
            let camera = &self.reconstruction.cameras[&images[photo.name.as_str()].camera_id];
            let error = photo.check((camera.width, camera.height)).err()?;
            Some(SceneError::Strict {
                name: photo.name.clone(),
                reason: error.to_string(),
            })
        };
        let first = self.photos.par_iter().find_map_first(wrong);
        first.map_or(Ok(()), Err)
    }

    /// Leaves out photos for what is wrong with them, as long as enough others remain.
    pub(super) fn leave_out(
        &mut self,
        unusable: Vec<(String, impl Display)>,
        strict: bool,
    ) -> Result<Vec<Warning>, SceneError> {
        let Some((name, reason)) = unusable.first() else {
            return Ok(Vec::new());
        };
        let (name, reason) = (name.clone(), reason.to_string());
        if strict {
            return Err(SceneError::Strict { name, reason });
        }
        if self.photos.len() - unusable.len() < ENOUGH {
            let is_gone = |photo: &Photo| photo.name == name && !photo.path.exists();
            let was_moved = self.folder.is_some() && self.photos.iter().any(is_gone);
            let remedy = if was_moved { MOVED } else { OTHERS };
            return Err(SceneError::TooFew {
                left_out: unusable.len(),
                total: self.photos.len(),
                remedy: remedy.to_owned(),
                name,
                reason,
            });
        }
        let names: BTreeSet<String> = unusable.iter().map(|(name, _)| name.clone()).collect();
        self.take_out(&names);
        let unusable = unusable.into_iter();
        let warnings = unusable.map(|(name, reason)| Warning::LeftOut {
            name,
            reason: reason.to_string(),
        });
        Ok(warnings.collect())
    }
}
