//! The photos' silhouettes, which the visual hull and a turntable's cameras are made of.

use super::fit::unfit;
use super::undistort::SILHOUETTES_FOLDER;
use super::{Photo, Scene, SceneError};
use calibrate::View;
use capture::{Beside, write_mask};
use image::{GrayImage, ImageDecoder, ImageReader, RgbaImage};
use proxy::hull::{Silhouette, plain_background};
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// Alpha from which on a pixel belongs to the object.
const OPAQUE: u8 = 128;

impl Photo {
    /// Whether something says what of it is the object: a matte, a silhouette among its masks,
    /// or an alpha channel. Asks only the header of its file.
    pub fn has_silhouette(&self) -> bool {
        self.is_cut_out() || self.silhouette.is_some()
    }

    /// Whether it shows nothing but an object: it has a matte, or an alpha channel.
    pub(super) fn is_cut_out(&self) -> bool {
        self.object_matte.is_some() || has_alpha(&self.path)
    }

    /// What of it is the object, by its matte, else by its alpha if that is not opaque, else by
    /// a silhouette among its masks, else by what stands before a plain background.
    ///
    /// # Errors
    /// A file that cannot be decoded or is not `size`; nothing of these shows an object.
    pub(super) fn decode_silhouette(&self, size: (u32, u32)) -> Result<Silhouette, SceneError> {
        let pixels = self.decode(size)?;
        let (width, height) = pixels.dimensions();
        let alpha: Vec<u8> = pixels.pixels().map(|p| p.0[3]).collect();
        let of_values = |values: &[u8]| {
            Silhouette::from_values(width, height, values)
                .ok_or_else(|| unfit(format!("photo {}: it has no pixels", self.name)))
        };
        if self.object_matte.is_some() || alpha.iter().any(|a| *a < OPAQUE) {
            return of_values(&alpha);
        }
        if let Some(path) = &self.silhouette {
            let mask = capture::decode_mask(Beside::ObjectMatte, path, &self.name, size)?;
            return of_values(mask.as_raw());
        }
        self.before_plain_background(&pixels)
    }

    fn before_plain_background(&self, pixels: &RgbaImage) -> Result<Silhouette, SceneError> {
        let (width, height) = pixels.dimensions();
        let rgb: Vec<u8> = pixels.pixels().flat_map(|p| p.0[..3].to_vec()).collect();
        plain_background(width, height, &rgb).map_err(|e| {
            unfit(format!(
                "photo {} has no matte, and its background does not show one: {e}; give mattes \
                 with `import --mattes DIR`",
                self.name
            ))
        })
    }
}

impl Scene {
    /// Whether all photos have a silhouette (see [`Photo::has_silhouette`]), as a visual hull
    /// needs.
    pub fn has_silhouettes(&self) -> bool {
        self.photos.iter().all(Photo::has_silhouette)
    }

    /// Writes the scene as [`Scene::save`] does, and into its folder, as `silhouettes/NAME.png`,
    /// the silhouettes that were found before a plain background.
    ///
    /// # Errors
    /// As [`Scene::save`]; a photo without any silhouette.
    pub fn save_with_silhouettes(
        &mut self,
        folder: &Path,
        replace: bool,
    ) -> Result<(), SceneError> {
        let mut saved = self.clone();
        saved.write_folder(folder, replace, |scene, new| {
            let found: Vec<Result<Option<PathBuf>, _>> = self
                .sources(&Default::default())?
                .into_par_iter()
                .map(|(photo, view)| found_silhouette(photo, &view, new))
                .collect();
            for (photo, file) in scene.photos.iter_mut().zip(found) {
                if let Some(file) = file? {
                    photo.silhouette = Some(folder.join(file));
                }
            }
            Ok(())
        })?;
        *self = saved;
        Ok(())
    }
}

/// Writes the silhouette of a photo that has none of its own into a folder; its path from there.
fn found_silhouette(
    photo: &Photo,
    view: &View,
    folder: &Path,
) -> Result<Option<PathBuf>, SceneError> {
    if photo.has_silhouette() {
        return Ok(None);
    }
    let silhouette = photo.decode_silhouette((view.width, view.height))?;
    let values = silhouette.inside().iter().map(|i| 255 * u8::from(*i));
    let mask = GrayImage::from_raw(view.width, view.height, values.collect());
    let mask = mask.ok_or_else(|| unfit(format!("photo {}: it has no pixels", photo.name)))?;
    let file = Path::new(SILHOUETTES_FOLDER).join(format!("{}.png", photo.name));
    write_mask(&folder.join(&file), &mask)?;
    Ok(Some(file))
}

/// Whether a picture's file has an alpha channel; not where it cannot be read.
fn has_alpha(path: &Path) -> bool {
    let reader = ImageReader::open(path).and_then(ImageReader::with_guessed_format);
    let decoder = reader.ok().and_then(|r| r.into_decoder().ok());
    decoder.is_some_and(|d| d.color_type().has_alpha())
}
