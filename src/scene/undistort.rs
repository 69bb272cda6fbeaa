//! A scene whose photos are a pinhole's: its folder holds them, in `images/`, and in
//! `masks/`, `mattes/`, `silhouettes/` and `depth/` what belongs to them.

use super::beside::{DEPTH_FOLDER, MASKS_FOLDER};
use super::{Photo, Scene, SceneError, Warning, picture_files};
use calibrate::undistort::{Undistortion, undistort};
use calibrate::{Camera, DepthAlong, Lens, Pixel};
use capture::{
    Beside, CaptureError, Footprint, Kernel, apply_matte, copy_photo, decode_depth_steps,
    take_usable_colors, warp, warp_depth_steps, write_depth_steps, write_mask, write_png,
};
use image::{DynamicImage, GrayImage, ImageBuffer, Luma};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Photos, in a scene that was undistorted.
pub(super) const IMAGES_FOLDER: &str = "images";
/// Mattes, in a scene that was undistorted.
pub(super) const MATTES_FOLDER: &str = "mattes";
/// Silhouettes for the hull alone, in a scene that was undistorted or that found them itself.
pub(super) const SILHOUETTES_FOLDER: &str = "silhouettes";
/// Sharper than a tent, and computed without a transcendental function, so that every machine
/// writes the same bytes.
const KERNEL: Kernel = Kernel::CatmullRom;

impl Scene {
    /// Undistorts the photos and writes the scene with them as a new folder, complete or not
    /// at all, as [`Scene::save`] does.
    ///
    /// A pinhole's photos are copied as they are. All others become PNG files of the size that
    /// [`calibrate::undistort`] chooses, called as [`picture_files`] says; [`Photo::original`]
    /// is what they were called. Masks, mattes and silhouettes are undistorted likewise, as
    /// `masks/NAME.png`, `mattes/NAME.png` and `silhouettes/NAME.png`, and depth maps by their nearest pixels, as
    /// `depth/NAME.png` in the same steps: the optical axis stays, and with it depth along z; that
    /// along rays becomes it.
    /// Where a photo does not fill its picture, that is ignored. What masks ignore and mattes cut out
    /// lends the rest no colour. `progress` is called after each photo.
    ///
    /// # Errors
    /// As [`Scene::save`]; a camera that has no undistorted picture; two photos that would
    /// have one name. A photo that cannot be decoded, or what lies beside it, is left out, or
    /// with `strict` an error, as at the import; but a depth map that cannot be is left out alone, which a note says,
    /// unless maps were `asked` for: then it is an error.
    pub fn save_undistorted(
        &mut self,
        folder: &Path,
        replace: bool,
        strict: bool,
        asked: bool,
        progress: &(dyn Fn() + Sync),
    ) -> Result<Vec<Warning>, SceneError> {
        Self::check_free(folder, replace)?;
        let (reconstruction, undistortions) = undistort(&self.reconstruction)?;
        let cameras: BTreeMap<&str, &Undistortion> = self
            .images_by_name()
            .into_iter()
            .map(|(name, image)| (name, &undistortions[&image.camera_id]))
            .collect();
        let names = self.photos.iter().map(|photo| {
            let name = photo.name.as_str();
            (name, !cameras[name].is_identity())
        });
        let new_names = picture_files("photo", names, Path::new(""))?;

        let mut warnings = Vec::new();
        let mut undistorted = self.clone();
        undistorted.reconstruction = reconstruction;
        undistorted.settings.undistorted = true;
        undistorted.write_folder(folder, replace, |scene, new| {
            // 1. The photos, each by itself.
            let jobs: Vec<(&Photo, &PathBuf)> = self.photos.iter().zip(&new_names).collect();
            let written: Vec<Result<Written, CaptureError>> = jobs
                .into_par_iter()
                .map(|(photo, new_name)| {
                    let done = write_photo(photo, cameras[photo.name.as_str()], new_name, new);
                    progress();
                    done
                })
                .collect();

            // 2. The scene names them, where they will be.
            let (mut unusable, mut damaged_maps) = (Vec::new(), Vec::new());
            let photos = scene.photos.iter_mut().zip(&new_names);
            for ((photo, new_name), written) in photos.zip(written) {
                match written {
                    Ok(Written {
                        photo:
                            Photo {
                                name,
                                path,
                                ignore_mask,
                                object_matte,
                                silhouette,
                                depth_map,
                                ..
                            },
                        damaged_map,
                    }) => {
                        let there = |file: PathBuf| folder.join(file);
                        match damaged_map {
                            Some(error) if strict => unusable.push((photo.name.clone(), error)),
                            Some(error) if asked => return Err(error.into()),
                            Some(error) => {
                                photo.depth_scale = None;
                                damaged_maps.push(error);
                            }
                            None => {}
                        }
                        photo.original.get_or_insert_with(|| photo.name.clone());
                        if photo.original.as_ref() == Some(&name) {
                            photo.original = None;
                        }
                        photo.path = there(path);
                        photo.ignore_mask = ignore_mask.map(there);
                        photo.object_matte = object_matte.map(there);
                        photo.silhouette = silhouette.map(there);
                        photo.depth_map = depth_map.map(there);
                        photo.name = name;
                    }
                    Err(error @ CaptureError::Write { .. }) => return Err(error.into()),
                    Err(error) => {
                        remove_photo(new_name, new);
                        unusable.push((photo.name.clone(), error));
                    }
                }
            }
            let renamed: BTreeMap<&str, String> = self
                .photos
                .iter()
                .zip(&new_names)
                .map(|(photo, new_name)| (photo.name.as_str(), slashed(new_name)))
                .collect();
            warnings = scene.leave_out(unusable, strict)?;
            if let Some(error) = damaged_maps.first() {
                warnings.push(Warning::Note(format!(
                    "{} of {} depth maps are not used, for one: {error}; --no-depth leaves all of them out",
                    damaged_maps.len(),
                    self.photos.iter().filter(|p| p.depth_map.is_some()).count()
                )));
            }
            for image in scene.reconstruction.images.values_mut() {
                if let Some(name) = renamed.get(image.name.as_str()) {
                    image.name.clone_from(name);
                }
            }
            scene.photos.sort_by(|a, b| a.name.cmp(&b.name));
            Ok(())
        })?;
        *self = undistorted;
        Ok(warnings)
    }
}

/// A photo that was written, with its new name and paths from the scene's folder.
struct Written {
    photo: Photo,
    /// Why it has no depth map any more.
    damaged_map: Option<CaptureError>,
}

/// Writes a photo without distortion, and what lies beside it, into the scene's folder. Nothing needs a depth map that
/// cannot be decoded.
fn write_photo(
    photo: &Photo,
    undistortion: &Undistortion,
    new_name: &Path,
    folder: &Path,
) -> Result<Written, CaptureError> {
    let file = Path::new(IMAGES_FOLDER).join(new_name);
    let Camera { width, height, .. } = undistortion.camera();
    let size = (width, height);
    let footprint_of = |column, row| footprint(undistortion, column, row);

    // 1. The photo. One that stays is decoded, too, so that a damaged one is found now.
    let picture = capture::decode(&photo.path, undistortion.is_identity().then_some(size))?;
    let photo_size = picture.dimensions();
    let decoded = |path: &Option<PathBuf>| {
        let decode = |path: &PathBuf| {
            let kind = Beside::ObjectMatte;
            capture::decode_mask(kind, path, &photo.name, photo_size)
        };
        path.as_ref().map(decode).transpose()
    };
    let ignore_mask = photo.decode_ignore_mask(photo_size)?;
    let matte = decoded(&photo.object_matte)?;
    if undistortion.is_identity() {
        copy_photo(&photo.path, &folder.join(&file))?;
    } else {
        let mut flat = warp(&picture, size, KERNEL, footprint_of);
        let mut usable = picture;
        for hidden in [&ignore_mask, &matte].into_iter().flatten() {
            apply_matte(&mut usable, hidden);
        }
        if ignore_mask.is_some() || matte.is_some() {
            take_usable_colors(&mut flat, &warp(&usable, size, KERNEL, footprint_of));
        }
        write_png(&folder.join(&file), &flat)?;
    }

    // 2. What lies beside it, named after it.
    let warped = |mask: GrayImage| {
        let mask = DynamicImage::from(mask).into_rgba8();
        DynamicImage::from(warp(&mask, size, KERNEL, footprint_of)).into_luma8()
    };
    let written = |folder_name: &str, mask: Option<GrayImage>| {
        let Some(mask) = mask else { return Ok(None) };
        let file = beside(folder_name, new_name);
        write_mask(&folder.join(&file), &mask)?;
        Ok(Some(file))
    };
    // To ignore: what was, and what the photo does not fill.
    let ignored = match ignore_mask {
        None if undistortion.is_filled() => None,
        Some(mask) => Some(warped(mask)),
        None => Some(warped(GrayImage::from_pixel(
            photo_size.0,
            photo_size.1,
            Luma([255]),
        ))),
    };
    let matte = matte.map(warped);
    let silhouette = decoded(&photo.silhouette)?.map(warped);
    let decode_map = |path: &PathBuf| decode_depth_steps(path, &photo.name, photo_size);
    let (depth_map, damaged_map) = match photo.depth_map.as_ref().map(decode_map) {
        Some(Ok(steps)) => {
            let steps = along_axis(steps, undistortion.lens());
            let file = beside(DEPTH_FOLDER, new_name);
            let steps = warp_depth_steps(&steps, size, footprint_of);
            write_depth_steps(&folder.join(&file), &steps)?;
            (Some(file), None)
        }
        Some(Err(error)) => (None, Some(error)),
        None => (None, None),
    };
    let photo = Photo {
        name: slashed(new_name),
        path: file,
        ignore_mask: written(MASKS_FOLDER, ignored)?,
        object_matte: written(MATTES_FOLDER, matte)?,
        silhouette: written(SILHOUETTES_FOLDER, silhouette)?,
        depth_map,
        ..photo.clone()
    };
    Ok(Written { photo, damaged_map })
}

/// The file of what lies beside a photo, by its path from the scene's folder.
fn beside(folder_name: &str, new_name: &Path) -> PathBuf {
    let mut name = new_name.as_os_str().to_owned();
    name.push(".png");
    Path::new(folder_name).join(name)
}

/// The files that [`write_photo`] can write for a photo of this new name, by their paths from the scene's folder.
pub(super) fn files_of(new_name: &Path) -> [PathBuf; 5] {
    let [masks, mattes, silhouettes, depth] = [
        MASKS_FOLDER,
        MATTES_FOLDER,
        SILHOUETTES_FOLDER,
        DEPTH_FOLDER,
    ]
    .map(|folder_name| beside(folder_name, new_name));
    let photo = Path::new(IMAGES_FOLDER).join(new_name);
    [photo, masks, mattes, silhouettes, depth]
}

/// Removes what [`write_photo`] wrote into the scene's folder before it failed: no part of the scene.
fn remove_photo(new_name: &Path, folder: &Path) {
    for file in files_of(new_name) {
        // Most of them are not there.
        let _ = std::fs::remove_file(folder.join(file));
    }
}

/// A depth map's steps along the axis, 0 for what lies aside or behind.
fn along_axis(
    mut steps: ImageBuffer<Luma<u16>, Vec<u16>>,
    lens: &Lens,
) -> ImageBuffer<Luma<u16>, Vec<u16>> {
    let along = DepthAlong::of(lens, steps.width(), steps.height());
    if along == DepthAlong::Ray {
        for (column, row, step) in steps.enumerate_pixels_mut() {
            let ray = lens.unproject(Pixel::center_of(column, row));
            let inverse = ray.map_or(0.0, |ray| {
                along.inverse_along_axis(ray, f64::from(step.0[0]).recip())
            });
            step.0[0] = match inverse > 0.0 {
                true => inverse.recip().round() as u16,
                false => 0,
            };
        }
    }
    steps
}

fn footprint(undistortion: &Undistortion, column: u32, row: u32) -> Option<Footprint> {
    let place = undistortion.in_photo(Pixel::center_of(column, row))?;
    let row = |i: usize| place.jacobian.row(i).to_array();
    Some(Footprint {
        center: [place.pixel.x, place.pixel.y],
        jacobian: [row(0), row(1)],
    })
}

/// A path as photos' names have it.
fn slashed(path: &Path) -> String {
    let parts: Vec<_> = path.iter().map(|part| part.to_string_lossy()).collect();
    parts.join("/")
}

#[cfg(test)]
mod tests {
    use super::*;
    use calibrate::{CameraId, ModelKind};
    use image::{Rgba, RgbaImage};

    /// What is hidden of the photos.
    fn is_hidden(x: u32, y: u32) -> bool {
        (30..50).contains(&x) && (20..45).contains(&y)
    }

    #[test]
    fn what_is_hidden_lends_the_rest_no_colour() {
        let camera = Camera {
            model: ModelKind::OpenCv,
            width: 96,
            height: 72,
            params: vec![92.0, 92.0, 47.2, 36.4, -0.2, 0.03, 1e-3, -1e-3],
        };
        let undistortion = Undistortion::new(CameraId(1), &camera).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let mask = GrayImage::from_fn(96, 72, |x, y| Luma([if is_hidden(x, y) { 0 } else { 255 }]));
        let mask_file = folder.path().join("mask.png");
        write_mask(&mask_file, &mask).unwrap();

        for ignored in [true, false] {
            let written = [false, true].map(|painted| {
                let picture = RgbaImage::from_fn(96, 72, |x, y| match painted && is_hidden(x, y) {
                    true => Rgba([255, 0, 255, 255]),
                    false => Rgba([(2 * x) as u8, (3 * y) as u8, (x * y % 200) as u8, 255]),
                });
                let path = folder.path().join("0.png");
                write_png(&path, &picture).unwrap();
                let photo = Photo {
                    name: "0.png".to_owned(),
                    path,
                    original: None,
                    ignore_mask: ignored.then(|| mask_file.clone()),
                    object_matte: (!ignored).then(|| mask_file.clone()),
                    silhouette: None,
                    depth_map: None,
                    depth_scale: None,
                    time_s: None,
                    gain: None,
                    depth_bounds: None,
                    orientation: None,
                    other: serde_json::Map::new(),
                };
                let name = Path::new("0.png");
                let flat = write_photo(&photo, &undistortion, name, folder.path())
                    .unwrap()
                    .photo;
                let open = |path: &Path| image::open(folder.path().join(path)).unwrap();
                let mask = match ignored {
                    true => flat.ignore_mask.unwrap(),
                    false => flat.object_matte.unwrap(),
                };
                (open(&flat.path).into_rgba8(), open(&mask).into_luma8())
            });
            let [(own, mask), (painted, same_mask)] = written;
            assert_eq!(mask, same_mask);
            let (mut soft, mut differ) = (0, 0);
            for ((own, painted), mask) in own.pixels().zip(painted.pixels()).zip(mask.iter()) {
                assert_eq!(own.0[3], 255);
                if *mask > 0 {
                    assert_eq!(own, painted, "where the mask is {mask}");
                    soft += u32::from(*mask < 255);
                } else {
                    differ += u32::from(own != painted);
                }
            }
            // There is a border between the two, and what is hidden stays in the file.
            assert!(soft > 40 && differ > 300, "{soft} and {differ}");
        }
    }
}
