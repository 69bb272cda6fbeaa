//! A dataset on disk: the folder a user would have, with the truth beside it.

use crate::picture::{LensRays, depth_through, render_through};
use crate::{Dataset, DatasetError, Photo};
use calibrate::{Reconstruction, colmap};
use capture::folder::{beside, left_beside, place_of, take_place};
use image::{DynamicImage, ImageBuffer, Luma};
use std::path::{Path, PathBuf};

/// Depth maps of a [`Dataset`] hold this many steps to a world unit: millimetres, as its units are metres.
pub const DEPTH_STEPS_PER_UNIT: f64 = 1000.0;

/// The photos that are kept aside.
const SPLIT: &str = "split.json";
const README: &str = "README.md";
/// When photos were taken, where something moves.
const TIMES: &str = "times.csv";

/// What [`write()`] has written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Written {
    /// Where.
    pub folder: PathBuf,
    /// How many photos, each with a depth map.
    pub photos: usize,
    /// How many of them are kept aside for scoring.
    pub held_out: usize,
    /// How many sparse points.
    pub points: usize,
    /// How often these are seen, all photos together.
    pub observations: usize,
}

/// Renders and writes a dataset: `images/`, `depth/`, `sparse/0/` (COLMAP, binary),
/// `split.json`, `README.md` and, where something moves, `times.csv`.
///
/// Everything is written into a folder beside `folder` that takes its name only when it
/// is complete.
///
/// # Errors
/// `folder` exists and is not empty, or something cannot be written; then nothing stays
/// behind.
pub fn write(dataset: &Dataset, folder: &Path) -> Result<Written, DatasetError> {
    in_new_folder(folder, |_| false, |partial| fill(dataset, partial))?;
    Ok(capture_of(dataset).written(folder))
}

/// The files that [`write()`] makes of a dataset, by path from its folder.
pub fn files(dataset: &Dataset) -> Vec<PathBuf> {
    let of_photo = |photo: &Photo| {
        let images = Path::new("images").join(&photo.name);
        [images, depth_map_of(photo)]
    };
    let model = ["cameras", "images", "points3D"].map(|file| format!("sparse/0/{file}.bin"));
    let mut files: Vec<PathBuf> = dataset.photos.iter().flat_map(of_photo).collect();
    files.extend(model.map(PathBuf::from));
    files.extend([SPLIT, README].map(PathBuf::from));
    files.extend(dataset.motion.is_some().then(|| PathBuf::from(TIMES)));
    files
}

/// A photo's depth map, by path from the dataset's folder.
fn depth_map_of(photo: &Photo) -> PathBuf {
    Path::new("depth").join(Path::new(&photo.name).with_extension("png"))
}

/// Whether [`in_new_folder`] may fill a folder: to be asked before long work.
///
/// # Errors
/// The folder is there and not empty, and `may_be_replaced` does not say that it may go; it cannot be read.
pub fn check_free(
    folder: &Path,
    may_be_replaced: impl Fn(&Path) -> bool,
) -> Result<(), DatasetError> {
    if folder.exists() && !is_empty(folder)? && !may_be_replaced(folder) {
        let folder = folder.to_owned();
        return Err(DatasetError::NotEmpty { folder });
    }
    Ok(())
}

/// Fills a folder that takes its name only when it is complete. What was there goes only then.
///
/// # Errors
/// As [`check_free`]; the path ends in no name, as `/` does; whatever `fill` fails with; the file system's.
/// Then nothing stays behind. What a process that is killed leaves is removed by the next that fills this folder.
pub fn in_new_folder<E: From<DatasetError>>(
    folder: &Path,
    may_be_replaced: impl Fn(&Path) -> bool,
    fill: impl FnOnce(&Path) -> Result<(), E>,
) -> Result<(), E> {
    // 1. A place to work, next to the destination: renaming must not cross disks.
    let place = place_of(folder).map_err(|source| io(folder, source))?;
    check_free(folder, &may_be_replaced)?;
    remove_left(&place);
    let partial = beside(&place, &format!("partial-{}", std::process::id()));
    if partial.exists() {
        // In containers processes share their numbers: one that was killed had this one's.
        std::fs::remove_dir_all(&partial).map_err(|source| io(&partial, source))?;
    }
    make_folder(&partial)?;
    // 2. Fill it, and let it take the destination's place, unless others have filled that since.
    let done = fill(&partial).and_then(|()| {
        check_free(folder, &may_be_replaced)?;
        Ok(take_place(&partial, &place).map_err(|source| io(folder, source))?)
    });
    if done.is_err() {
        // The first error is the one to tell.
        let _ = std::fs::remove_dir_all(&partial);
    }
    done
}

/// Removes what processes that are gone have left of the same folder.
fn remove_left(place: &Path) {
    for (left, end) in left_beside(place) {
        let is_folder = std::fs::symlink_metadata(&left).is_ok_and(|left| left.is_dir());
        if is_folder && end.is_empty() {
            // Others' that may not be removed are in nobody's way.
            let _ = std::fs::remove_dir_all(left);
        }
    }
}

fn fill<'a>(dataset: &'a Dataset, folder: &Path) -> Result<(), DatasetError> {
    let mut last: Option<(&Photo, LensRays)> = None;
    let seen = |photo: &'a Photo| {
        // Photos through one lens share its rays.
        let lens_rays = match last.take() {
            Some((before, lens_rays)) if before.camera == photo.camera => lens_rays,
            _ => LensRays::of(&photo.view),
        };
        let scene = dataset.scene_of(photo);
        let picture = render_through(&scene, &photo.view, dataset.samples_per_side, &lens_rays);
        let picture = DynamicImage::from(picture);
        let picture = if dataset.matte {
            picture
        } else {
            DynamicImage::from(picture.into_rgb8())
        };
        let depths = depth_through(&scene, &photo.view, &lens_rays);
        last = Some((photo, lens_rays));
        (picture, depths)
    };
    capture_of(dataset).fill(folder, seen)?;
    if dataset.motion.is_some() {
        write_text(&folder.join(TIMES), &times(dataset))?;
    }
    Ok(())
}

fn capture_of(dataset: &Dataset) -> Capture<'_> {
    Capture {
        photos: &dataset.photos,
        held_out: &dataset.held_out,
        reconstruction: &dataset.reconstruction,
        depth_steps_per_unit: DEPTH_STEPS_PER_UNIT,
        readme: readme(dataset),
    }
}

/// What every capture has, but for its pictures.
pub(crate) struct Capture<'a> {
    pub(crate) photos: &'a [Photo],
    pub(crate) held_out: &'a [String],
    pub(crate) reconstruction: &'a Reconstruction,
    /// Of its depth maps, to a world unit.
    pub(crate) depth_steps_per_unit: f64,
    pub(crate) readme: String,
}

impl<'a> Capture<'a> {
    /// Writes it into a folder, photo by photo: the picture, and the depth along z of each
    /// pixel's centre, row by row.
    pub(crate) fn fill(
        &self,
        folder: &Path,
        mut seen: impl FnMut(&'a Photo) -> (DynamicImage, Vec<f64>),
    ) -> Result<(), DatasetError> {
        let [images, depths, sparse] =
            ["images", "depth", "sparse/0"].map(|name| folder.join(name));
        for folder in [&images, &depths, &sparse] {
            make_folder(folder)?;
        }
        colmap::write_binary(self.reconstruction, &sparse)?;
        for photo in self.photos {
            let (picture, depth) = seen(photo);
            save(picture, &images.join(&photo.name))?;
            let depth = DynamicImage::from(depth_steps(photo, &depth, self.depth_steps_per_unit));
            save(depth, &folder.join(depth_map_of(photo)))?;
        }
        write_text(&folder.join(SPLIT), &split(self.held_out))?;
        write_text(&folder.join(README), &self.readme)
    }

    pub(crate) fn written(&self, folder: &Path) -> Written {
        let points = &self.reconstruction.points;
        Written {
            folder: folder.to_owned(),
            photos: self.photos.len(),
            held_out: self.held_out.len(),
            points: points.len(),
            observations: points.values().map(|point| point.track.len()).sum(),
        }
    }
}

/// Depth along z in steps; 0 where there is no surface or it is too far to say.
fn depth_steps(
    photo: &Photo,
    depths: &[f64],
    steps_per_unit: f64,
) -> ImageBuffer<Luma<u16>, Vec<u16>> {
    let steps = depths.iter().map(|depth| {
        let steps = (depth * steps_per_unit).round();
        if (0.0..=f64::from(u16::MAX)).contains(&steps) {
            steps as u16
        } else {
            0
        }
    });
    let steps = steps.collect();
    ImageBuffer::from_raw(photo.view.width, photo.view.height, steps).expect("a step a pixel")
}

/// Seconds of each photo, digits enough to read back the same.
fn times(dataset: &Dataset) -> String {
    let timed = dataset
        .photos
        .iter()
        .filter_map(|p| Some((&p.name, p.time_s?)));
    let lines = timed.map(|(name, time_s)| format!("{name},{time_s}\n"));
    format!("name,seconds\n{}", lines.collect::<String>())
}

fn split(held_out: &[String]) -> String {
    // Names are ours: nothing in them needs escaping.
    let names: Vec<String> = held_out
        .iter()
        .map(|name| format!("  \"{name}\""))
        .collect();
    format!("{{\n \"test\": [\n{}\n ]\n}}\n", names.join(",\n"))
}

fn readme(dataset: &Dataset) -> String {
    let camera = &dataset.photos[0].camera;
    let params: Vec<String> = camera.params.iter().map(f64::to_string).collect();
    let points = &dataset.reconstruction.points;
    let observations: usize = points.values().map(|point| point.track.len()).sum();
    format!(
        "# {name}\n\
         \n\
         - Source: `lumigraph generate {name}`, a procedural scene. Licence: as the program's.\n\
         - Kind: {kind}\n\
         - {photos} images of {width} x {height} (images/), depth/; {held_out} held out in \
         split.json (every 8th by name).\n\
         - Camera: {model} (shared), params {params}.\n\
         - {points} points, mean track length {track:.1}, reprojection error 0: points and \
         keypoints are exact.\n\
         - Calibration: poses, points and depth are exact by construction. depth/NAME.png is \
         16-bit along z at pixel centres, 1/{steps} of a world unit a step, 0 = no surface.\n\
         - Photos: {samples}x{samples} rays a pixel, averaged in linear light, stored as \
         sRGB{alpha}.\n\
         - Stresses: {stresses}\n",
        name = dataset.name,
        kind = dataset.kind,
        photos = dataset.photos.len(),
        width = camera.width,
        height = camera.height,
        held_out = dataset.held_out.len(),
        model = camera.model.name(),
        params = params.join(", "),
        points = points.len(),
        track = observations as f64 / points.len().max(1) as f64,
        steps = DEPTH_STEPS_PER_UNIT,
        samples = dataset.samples_per_side,
        alpha = if dataset.matte {
            "; alpha is the part of them that met the object"
        } else {
            ""
        },
        stresses = dataset.stresses,
    )
}

fn is_empty(folder: &Path) -> Result<bool, DatasetError> {
    let mut entries = std::fs::read_dir(folder).map_err(|source| io(folder, source))?;
    Ok(entries.next().is_none())
}

fn make_folder(folder: &Path) -> Result<(), DatasetError> {
    std::fs::create_dir_all(folder).map_err(|source| io(folder, source))
}

fn write_text(path: &Path, text: &str) -> Result<(), DatasetError> {
    std::fs::write(path, text).map_err(|source| io(path, source))
}

fn save(picture: DynamicImage, path: &Path) -> Result<(), DatasetError> {
    picture.save(path).map_err(|source| DatasetError::Picture {
        path: path.to_owned(),
        source,
    })
}

pub(crate) fn io(path: &Path, source: std::io::Error) -> DatasetError {
    DatasetError::Io {
        path: path.to_owned(),
        source,
    }
}
