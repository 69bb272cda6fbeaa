//! A photo set made ready for rendering, in memory and as a folder.
//!
//! The folder holds `scene.json` (format: [`mod@file`]), a COLMAP text model in `model/`
//! and, once there is one, the proxy's file. Photos stay where they are and are named by
//! their path relative to the folder. For photos that came without a calibration, COLMAP's
//! work is in `colmap/`; those taken out of a video are in `photos/`; of a turntable's, the
//! silhouettes found before a plain background are in `silhouettes/`.

mod aside;
mod auto;
mod beside;
mod calibration;
mod carved_points;
mod cutout;
mod damaged;
mod depth;
mod error;
mod exposure;
pub mod file;
mod fit;
mod home;
mod import;
mod kept;
mod listed;
mod lumigraph;
mod meant;
mod misfit;
mod named;
mod names;
mod observed;
mod own;
mod parts;
mod put_back;
mod relative;
mod resized;
mod rooms;
mod silhouettes;
mod source;
mod split;
mod store;
mod suggested;
#[cfg(test)]
mod tests;
mod times;
mod trial;
mod truth;
mod turned;
mod turntable;
mod undistort;

pub use aside::Aside;
pub use auto::{Trial, trials_text};
pub use beside::DEPTH_UNITS_PER_STEP;
pub use calibration::{Sizes, calibrated_size, read_bare};
pub use error::{SceneError, Warning, remedy_of_model};
pub use exposure::Matched;
pub use fit::{Fitted, Kind};
pub use import::ImportOptions;
pub use misfit::DOUBTFUL_PX;
pub use names::{NameError, picture_files};
pub use own::{LostProxy, SceneProxy};
pub use parts::other_within;
pub use relative::{relative, relative_lossy};
pub use rooms::SceneSurface;
pub use source::{calibration_in, other_models, unused_keys};
pub use split::{Split, SplitFile};
pub use times::TimeSource;
pub use truth::{Truth, TruthScore};

use calibrate::{Point3DId, Reconstruction, TRUSTED_TIE, WeakGroup};
use file::{ExposureEntry, Extra, Settings};
use std::collections::BTreeSet;
use std::path::PathBuf;

/// A photo set made ready for rendering.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Photos with a camera and a pose, by name.
    pub photos: Vec<Photo>,
    /// Their cameras and poses, and the sparse points.
    pub reconstruction: Reconstruction,
    /// The surface that was made for this scene, if any.
    pub proxy: Option<SceneProxy>,
    /// How the photos' gains were found; `None` where they were not, or given by hand.
    pub exposure: Option<ExposureEntry>,
    /// How the scene was made.
    pub settings: Settings,
    /// The folder it was read from or saved to; `None` for a capture that was imported in
    /// memory.
    pub folder: Option<PathBuf>,
    /// The folder with the photos and their calibration, where known.
    pub capture: Option<PathBuf>,
    /// The video that the photos were taken out of, if they were.
    pub video: Option<PathBuf>,
    /// The calibration that was given beside it, if one was.
    pub calibration: Option<PathBuf>,
    /// Photos that are calibrated but missing or corrupt, now or at the import, or dropped as weakly
    /// tied or misplaced; by what the capture calls them.
    pub left_out: Vec<String>,
    /// What `scene.json` says beyond this version's keys.
    pub other: Extra,
}

/// One calibrated photo and what belongs to it.
#[derive(Clone, Debug, PartialEq)]
pub struct Photo {
    /// As in the reconstruction: the path relative to the photo folder, `/` between parts.
    pub name: String,
    /// Where the file is.
    pub path: PathBuf,
    /// What the capture calls it, where undistorting gave it another name.
    pub original: Option<String>,
    /// A mask of what to ignore (people, cars), if any.
    pub ignore_mask: Option<PathBuf>,
    /// The silhouette of the object that the photo is about, if any.
    pub object_matte: Option<PathBuf>,
    /// A mask that shows the object but neither cuts it out nor ignores the rest, if any: for
    /// the visual hull.
    pub silhouette: Option<PathBuf>,
    /// Depth, as [`calibrate::DepthAlong`] says, if known.
    pub depth_map: Option<PathBuf>,
    /// World units a step of the depth map.
    pub depth_scale: Option<f64>,
    /// When it was taken, in seconds from any moment common to the scene.
    pub time_s: Option<f64>,
    /// Exposure per colour channel, relative to the other photos.
    pub gain: Option<[f64; 3]>,
    /// The nearest and farthest depth along z that it shows, where the calibration says.
    pub depth_bounds: Option<[f64; 2]>,
    /// EXIF's orientation of its stored pixels, where that is not upright.
    pub orientation: Option<u8>,
    /// What `scene.json` says beyond this version's keys.
    pub other: Extra,
}

impl Scene {
    /// Leaves out the photos that share too few points with the rest to be placed surely,
    /// and returns them. The rest must be the majority; see [`Reconstruction::weakly_tied`].
    pub fn drop_weak(&mut self) -> Vec<WeakGroup> {
        let weak = self.reconstruction.weakly_tied(TRUSTED_TIE);
        let names: BTreeSet<String> = weak.iter().flat_map(|g| g.names.iter().cloned()).collect();
        self.take_out(&names);
        weak
    }

    /// The names of photos that are misplaced, as they see most of their own sparse points behind them, beyond what
    /// their lens sees, or more than [`DOUBTFUL_PX`] from where the calibration has them, while most photos do not; sorted.
    pub fn misplaced(&self) -> Vec<String> {
        misfit::misplaced(&self.reconstruction)
    }

    /// Leaves out the photos that are [misplaced](Self::misplaced), and returns their names.
    pub fn drop_misplaced(&mut self) -> Vec<String> {
        let names = self.misplaced();
        self.take_out(&names.iter().cloned().collect());
        names
    }

    /// The sparse points that all photos observing them see behind them, beyond what their lens sees, or more than
    /// [`DOUBTFUL_PX`] from where the calibration has them, while photos usually do not.
    pub fn contradicted_points(&self) -> BTreeSet<Point3DId> {
        misfit::contradicted(&self.reconstruction)
    }

    /// Leaves out the sparse points that are [contradicted](Self::contradicted_points), so that no surface is made of
    /// them, and returns how many they are.
    pub fn drop_contradicted(&mut self) -> usize {
        let gone = self.contradicted_points();
        self.reconstruction.remove_points(&gone);
        gone.len()
    }

    /// Takes photos out of the scene, and notes that they were left out.
    fn take_out(&mut self, names: &BTreeSet<String>) {
        if names.is_empty() {
            return;
        }
        let (gone, rest): (Vec<Photo>, Vec<Photo>) = std::mem::take(&mut self.photos)
            .into_iter()
            .partition(|photo| names.contains(&photo.name));
        self.photos = rest;
        self.reconstruction.remove_images(names);
        // Splits, which may name them, speak of the capture's photos.
        let called = |photo: Photo| photo.original.unwrap_or(photo.name);
        self.left_out.extend(gone.into_iter().map(called));
    }
}
