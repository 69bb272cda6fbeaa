//! Masks, depth maps and times that the calibration names.

use super::calibration::Source;
use super::{DEPTH_UNITS_PER_STEP, ImportOptions, Scene, SceneError, Warning};
use calibrate::formats::{self, FilesBeside, Format};
use capture::{Beside, CaptureError, check_beside};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// What a `transforms.json` says beside cameras and poses, by the photos' names.
pub(super) struct Named {
    pub(super) file: PathBuf,
    pub(super) beside: FilesBeside,
}

impl Named {
    /// `None` of any other calibration. `called` has the photos' names by the calibration's paths.
    pub(super) fn of(
        source: &Source,
        called: &BTreeMap<String, String>,
    ) -> Result<Option<Self>, SceneError> {
        let Source::Other(Format::Transforms, file) = source else {
            return Ok(None);
        };
        let mut beside = formats::read_files_beside(file)?;
        beside.masks = by_photo(beside.masks, called);
        beside.depth_maps = by_photo(beside.depth_maps, called);
        beside.times = by_photo(beside.times, called);
        let file = file.clone();
        Ok(Some(Self { file, beside }))
    }

    /// The masks and depth maps that are there, by paths without links.
    pub(super) fn real_files(&self) -> BTreeSet<PathBuf> {
        let FilesBeside {
            masks, depth_maps, ..
        } = &self.beside;
        let files = masks.values().chain(depth_maps.values());
        files.filter_map(|file| file.canonicalize().ok()).collect()
    }

    /// Forgets depth maps that are passed over for these photos: what is wrong with them is said.
    pub(super) fn forget_depth(&mut self, passed_over: &BTreeMap<String, PathBuf>) {
        let real = |path: &Path| path.canonicalize().ok();
        self.beside.depth_maps.retain(|photo, map| {
            let over = passed_over.get(photo);
            over.is_none_or(|over| real(over) != real(map))
        });
    }
}

fn by_photo<T>(
    named: BTreeMap<String, T>,
    called: &BTreeMap<String, String>,
) -> BTreeMap<String, T> {
    let named = named.into_iter();
    let by_name = named.filter_map(|(path, it)| Some((called.get(&path)?.clone(), it)));
    by_name.collect()
}

impl Scene {
    /// Gives photos the ignore masks and depth maps that a calibration names for them,
    /// where folders gave them none and none were asked for, and says what of it is not used.
    pub(super) fn add_named(
        &mut self,
        named: Named,
        options: &ImportOptions,
        warnings: &mut Vec<Warning>,
    ) {
        let Named { file, beside } = named;
        let FilesBeside {
            masks,
            depth_maps,
            depth_scale,
            unscaled_depth_maps,
            points,
            applied_scale,
            times: _,
        } = beside;
        let mut note = |text: String| {
            let file = file.display();
            warnings.push(Warning::Note(format!("{file} names {text}")));
        };
        if options.masks.is_none() && !options.no_masks {
            let missing = self.add_masks(&masks);
            if let Some(example) = missing.first() {
                note(format!(
                    "{} ignore masks that are not there ({}, for one); nothing is ignored in \
                     their photos",
                    missing.len(),
                    example.display()
                ));
            }
        }
        if options.depth.is_none() && !options.no_depth {
            // A scale that was asked for is that of the scene's units.
            let scale = options.depth_scale.or(depth_scale);
            let scale = scale.unwrap_or(DEPTH_UNITS_PER_STEP * applied_scale);
            let unused = self.add_depth_maps(&depth_maps, scale);
            if let Some(reason) = unused.first() {
                note(format!(
                    "{} depth maps that are not used, for one: {reason}",
                    unused.len()
                ));
            }
            if unscaled_depth_maps > 0 {
                note(format!(
                    "{unscaled_depth_maps} depth maps (depth_path) that are not used: it lacks integer_depth_scale, the \
                     world units a step; add it, or give --depth DIR --depth-scale UNITS"
                ));
            }
        }
        if let Some(points) = points.filter(|points| points.is_file()) {
            note(format!(
                "the sparse points in {}, which are not read: the scene has none",
                points.display()
            ));
        }
    }

    /// Gives photos without an ignore mask theirs; those that are not there.
    fn add_masks(&mut self, named: &BTreeMap<String, PathBuf>) -> Vec<PathBuf> {
        let real = |path: &Path| path.canonicalize().ok();
        let mut missing = Vec::new();
        for photo in self.photos.iter_mut().filter(|p| p.ignore_mask.is_none()) {
            let Some(mask) = named.get(&photo.name) else {
                continue;
            };
            if !mask.is_file() {
                missing.push(mask.clone());
                continue;
            }
            // One file does not serve as both.
            let matte = photo.object_matte.as_deref();
            let is_matte = matte.is_some_and(|matte| real(matte) == real(mask));
            if !is_matte {
                photo.ignore_mask = Some(mask.clone());
            }
        }
        missing
    }

    /// Gives photos without a depth map theirs; what is wrong with those that cannot be used.
    /// Other programs make depth maps of any size and kind fit.
    fn add_depth_maps(
        &mut self,
        named: &BTreeMap<String, PathBuf>,
        scale: f64,
    ) -> Vec<CaptureError> {
        let images = self.reconstruction.images.values();
        let camera_ids: BTreeMap<&str, _> =
            images.map(|i| (i.name.as_str(), i.camera_id)).collect();
        let mut unused = Vec::new();
        for photo in self.photos.iter_mut().filter(|p| p.depth_map.is_none()) {
            let Some(map) = named.get(&photo.name) else {
                continue;
            };
            let camera = &self.reconstruction.cameras[&camera_ids[photo.name.as_str()]];
            let size = (camera.width, camera.height);
            match check_beside(Beside::DepthMap, map, &photo.name, size) {
                Ok(()) => {
                    photo.depth_scale = Some(scale);
                    photo.depth_map = Some(map.clone());
                }
                Err(reason) => unused.push(reason),
            }
        }
        unused
    }
}
