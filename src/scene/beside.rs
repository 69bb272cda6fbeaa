//! What lies beside the photos: masks, mattes and depth maps, found by name and checked.

use super::meant::Meant;
use super::undistort::{MATTES_FOLDER, SILHOUETTES_FOLDER};
use super::{ImportOptions, Photo, Scene, SceneError, Warning};
use capture::{
    Beside, CaptureError, DepthMap, Matched, apply_matte, check_beside, is_black_and_white,
    is_in_alpha, match_by_name, match_jpegs_by_name, match_others_by_name,
};
use image::{GrayImage, RgbaImage};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Where masks and depth maps are looked for in a capture, if nobody says, and where they are
/// in a scene that was undistorted.
pub(super) const MASKS_FOLDER: &str = "masks";
pub(super) const DEPTH_FOLDER: &str = "depth";
/// Folders in a capture that hold none of its photos.
pub(super) const FOLDERS: [&str; 4] = [
    MASKS_FOLDER,
    DEPTH_FOLDER,
    MATTES_FOLDER,
    SILHOUETTES_FOLDER,
];

/// Whether a file of a capture is no photo, but a mask, a matte or a depth map by its place.
pub(super) fn is_beside(name: &str) -> bool {
    let folder = name.split_once('/').map(|(folder, _)| folder);
    folder.is_some_and(|folder| FOLDERS.contains(&folder))
}

/// World units a step of depth maps, if nobody says: millimetres where units are metres.
pub const DEPTH_UNITS_PER_STEP: f64 = 0.001;

/// An ignore mask's value below which neither depth nor colour is compared with other photos': masks have soft borders, and some are JPEG.
pub(super) const USED: u8 = 128;
/// So many masks, spread over the photos, decide whether all are silhouettes.
pub(super) const MASKS_JUDGED: usize = 5;

impl Photo {
    /// Its pixels as stored, cut out by its object matte if it has one.
    ///
    /// # Errors
    /// One of the files cannot be decoded or has another size than `size`.
    pub fn decode(&self, size: (u32, u32)) -> Result<RgbaImage, CaptureError> {
        let mut pixels = capture::decode(&self.path, Some(size))?;
        if let Some(path) = &self.object_matte {
            let matte = capture::decode_mask(Beside::ObjectMatte, path, &self.name, size)?;
            apply_matte(&mut pixels, &matte);
        }
        Ok(pixels)
    }

    /// Its pixels as [`Self::decode`] has them, transparent also where its ignore mask ignores them.
    ///
    /// # Errors
    /// As for [`Self::decode`] and [`Self::decode_ignore_mask`].
    pub fn decode_usable(&self, size: (u32, u32)) -> Result<RgbaImage, CaptureError> {
        let mut pixels = self.decode(size)?;
        if let Some(mask) = self.decode_ignore_mask(size)? {
            for (pixel, used) in pixels.pixels_mut().zip(mask.pixels()) {
                pixel.0[3] = pixel.0[3].min(used.0[0]);
            }
        }
        Ok(pixels)
    }

    /// Decodes it and all that lies beside it, only to find what is damaged.
    ///
    /// # Errors
    /// One of the files cannot be decoded or has another size than `size`; a depth map that is not 16-bit grey.
    pub(super) fn check(&self, size: (u32, u32)) -> Result<(), CaptureError> {
        self.decode_usable(size)?;
        if let Some(path) = &self.silhouette {
            capture::decode_mask(Beside::ObjectMatte, path, &self.name, size)?;
        }
        if let Some(path) = &self.depth_map {
            capture::decode_depth_steps(path, &self.name, size)?;
        }
        Ok(())
    }

    /// Its ignore mask, if it has one: 0 = ignore, 255 = use.
    ///
    /// # Errors
    /// It cannot be decoded or has another size than `size`, the photo's.
    pub fn decode_ignore_mask(&self, size: (u32, u32)) -> Result<Option<GrayImage>, CaptureError> {
        let decode =
            |path: &PathBuf| capture::decode_mask(Beside::IgnoreMask, path, &self.name, size);
        self.ignore_mask.as_ref().map(decode).transpose()
    }

    /// Its depth map, if it has one. Where its ignore mask ignores the photo the depth is unknown:
    /// what is not to be seen is no surface, either.
    ///
    /// # Errors
    /// It cannot be decoded, is not 16-bit grey or has another size than `size`, the photo's; as for
    /// [`Self::decode_ignore_mask`].
    pub fn decode_depth(&self, size: (u32, u32)) -> Result<Option<DepthMap>, CaptureError> {
        let scale = self.depth_scale.unwrap_or(DEPTH_UNITS_PER_STEP);
        let Some(path) = &self.depth_map else {
            return Ok(None);
        };
        let mut map = capture::decode_depth(path, &self.name, size, scale)?;
        if let Some(mask) = self.decode_ignore_mask(size)? {
            for (depth, used) in map.depths.iter_mut().zip(mask.pixels()) {
                if used.0[0] < USED {
                    *depth = 0.0;
                }
            }
        }
        Ok(Some(map))
    }

    /// What lies beside it, with its kind.
    fn beside(&self) -> impl Iterator<Item = (Beside, &PathBuf)> {
        let files = [
            (Beside::IgnoreMask, &self.ignore_mask),
            (Beside::ObjectMatte, &self.object_matte),
            (Beside::ObjectMatte, &self.silhouette),
            (Beside::DepthMap, &self.depth_map),
        ];
        files
            .into_iter()
            .filter_map(|(kind, path)| Some((kind, path.as_ref()?)))
    }
}

impl Scene {
    /// Gives the photos the masks, mattes and depth maps asked for, and those that lie in
    /// the `masks` and `depth` of the folder that the photos are at home in. Folders are given as they are, or
    /// as the capture's own. What is called like the file that is `meant` by a photo's name is that photo's, too.
    pub(super) fn find_beside(
        &mut self,
        home: &Path,
        meant: &Meant,
        options: &ImportOptions,
        warnings: &mut Vec<Warning>,
    ) -> Result<(), SceneError> {
        let within = |name: &str| Some(home.join(name)).filter(|folder| folder.is_dir());
        let capture = self.capture.as_deref().unwrap_or(home);
        let given = |folder: &Option<PathBuf>| folder.as_ref().map(|f| folder_of(capture, f));
        let mattes = given(&options.mattes).transpose()?;
        let masks = match given(&options.masks).transpose()? {
            Some(folder) => Some(folder),
            None if options.no_masks => None,
            // One folder does not serve as both, unless that is what was said.
            None => within(MASKS_FOLDER).filter(|found| {
                let real = |folder: &Path| folder.canonicalize().ok();
                mattes.as_ref().is_none_or(|m| real(m) != real(found))
            }),
        };
        let depth = match given(&options.depth).transpose()? {
            Some(folder) => Some(folder),
            None if options.no_depth => None,
            None => within(DEPTH_FOLDER),
        };
        for (kind, folder, asked) in [
            (Beside::IgnoreMask, masks, options.masks.is_some()),
            (Beside::ObjectMatte, mattes, true),
            (Beside::DepthMap, depth, options.depth.is_some()),
        ] {
            if let Some(folder) = folder {
                self.attach(kind, &folder, asked, meant, options, warnings)?;
            }
        }
        Ok(())
    }

    /// Gives the photos the pictures of a folder that belong to them by name.
    fn attach(
        &mut self,
        kind: Beside,
        folder: &Path,
        asked: bool,
        meant: &Meant,
        options: &ImportOptions,
        warnings: &mut Vec<Warning>,
    ) -> Result<(), SceneError> {
        // What belongs to photos that are left out is not astray.
        let photos = self.photos.iter().map(|p| &p.name);
        let names = photos.chain(&self.left_out);
        let names: Vec<&str> = names.map(String::as_str).collect();
        let total = self.photos.len();
        let by_name = meant.matched(&names, |names| match_by_name(folder, names));
        let (mut matched, has_pictures) = match by_name {
            Err(CaptureError::NoPhotos { .. }) => (Matched::default(), false),
            matched => (matched?, true),
        };
        let mut unread = None;
        if matched.by_photo.is_empty() {
            match jpegs(kind, folder, &names, meant) {
                Ok(masks) => matched = masks,
                Err(why) => unread = why,
            }
        }
        let unread = unread.or_else(|| others(kind, folder, &names, meant, &matched.by_photo));
        let note_of_unread =
            |unread: String| Warning::Note(format!("{}: {unread}", folder.display()));
        if !has_pictures && !asked {
            // An empty folder that nobody mentioned is none.
            warnings.extend(unread.map(note_of_unread));
            return Ok(());
        }
        let Matched {
            mut by_photo,
            unmatched,
        } = matched;
        if kind != Beside::DepthMap {
            warnings.extend(note_of_alpha(kind, &by_photo));
        }
        let is_found = |p: &&Photo| by_photo.contains_key(&p.name);
        let found = self.photos.iter().filter(is_found).count();
        if let (0, true, Some(example)) = (found, asked, names.first()) {
            return Err(SceneError::NothingBeside {
                folder: folder.to_owned(),
                kind,
                example: (*example).to_owned(),
                unread,
            });
        }
        warnings.extend(unread.map(note_of_unread));
        if found < total {
            warnings.push(Warning::Note(format!(
                "{}: {found} of {total} photos have their {kind} here",
                folder.display()
            )));
        }
        if let Some(example) = unmatched.first() {
            warnings.push(Warning::Note(format!(
                "{}: {} files belong to no calibrated photo ({example}, for one)",
                folder.display(),
                unmatched.len()
            )));
        }
        for photo in &mut self.photos {
            let path = by_photo.remove(&photo.name);
            match kind {
                Beside::IgnoreMask => photo.ignore_mask = path,
                Beside::ObjectMatte => photo.object_matte = path,
                Beside::DepthMap => {
                    let scale = options.depth_scale.unwrap_or(DEPTH_UNITS_PER_STEP);
                    photo.depth_scale = path.is_some().then_some(scale);
                    photo.depth_map = path;
                }
            }
        }
        Ok(())
    }

    /// Compares the sizes of masks, mattes and depth maps with their photos'. A mask that
    /// cannot be read is an error: without it the photo would show what it should not.
    pub(super) fn check_beside(&self) -> Result<(), SceneError> {
        let images = self.images_by_name();
        for photo in &self.photos {
            let camera = &self.reconstruction.cameras[&images[photo.name.as_str()].camera_id];
            for (kind, path) in photo.beside() {
                let size = (camera.width, camera.height);
                let checked = check_beside(kind, path, &photo.name, size);
                checked.map_err(|error| match kind {
                    Beside::DepthMap => SceneError::DepthMap(error),
                    // Mattes are asked for.
                    _ if photo.object_matte.as_ref() == Some(path) => SceneError::Capture(error),
                    _ => SceneError::Mask(error),
                })?;
            }
        }
        Ok(())
    }
}

/// The JPEG files in a folder without PNG files for any photo, where they are black and white; of others why
/// they are not used, if there are any.
fn jpegs(
    kind: Beside,
    folder: &Path,
    names: &[&str],
    meant: &Meant,
) -> Result<Matched, Option<String>> {
    // What two photos could claim is none's.
    let matched = meant.matched(names, |names| match_jpegs_by_name(folder, names));
    let Ok(matched) = matched else {
        return Err(None);
    };
    let Some((example, _)) = matched.by_photo.first_key_value() else {
        return Err(None);
    };
    let is_mask = |file: &PathBuf| is_black_and_white(file).unwrap_or(false);
    let why = match kind {
        Beside::DepthMap => "depth does not fit into JPEG files: write 16-bit grey PNG",
        _ if some_of(&matched.by_photo).all(is_mask) => return Ok(matched),
        _ => "the JPEG files are not black and white: write PNG",
    };
    let count = matched.by_photo.len();
    Err(Some(unread_text(kind, count, names.len(), example, why)))
}

/// Why files in a folder are not used whose names are those of photos that have nothing else there, if there
/// are any: they are neither PNG nor JPEG. `found` is what other photos have.
fn others(
    kind: Beside,
    folder: &Path,
    names: &[&str],
    meant: &Meant,
    found: &BTreeMap<String, PathBuf>,
) -> Option<String> {
    let is_open = |name: &str| !found.contains_key(name);
    let open: Vec<&str> = names.iter().copied().filter(|name| is_open(name)).collect();
    if open.is_empty() {
        return None;
    }
    // As of JPEG files.
    let matched = meant.matched(&open, |names| match_others_by_name(folder, names));
    let mut files = matched.ok()?.by_photo;
    files.retain(|name, _| is_open(name));
    let (_, example) = files.first_key_value()?;
    let example = example.strip_prefix(folder).unwrap_or(example);
    let why = match kind {
        Beside::DepthMap => "only 16-bit grey PNG is read: write depths so",
        _ => "only PNG is read, and JPEG in black and white: convert them",
    };
    let example = example.display().to_string();
    Some(unread_text(kind, files.len(), names.len(), &example, why))
}

/// That some of all photos have a file that is not read, and why not.
fn unread_text(kind: Beside, count: usize, total: usize, example: &str, why: &str) -> String {
    format!(
        "{count} of {total} photos have a file of their name here that is no {kind} ({example}, for one): {why}"
    )
}

/// What to say of masks that have their shape in their alpha channel, if some that are asked do.
fn note_of_alpha(kind: Beside, by_photo: &BTreeMap<String, PathBuf>) -> Option<Warning> {
    let file = some_of(by_photo).find(|file| is_in_alpha(file).unwrap_or(false))?;
    Some(Warning::Note(format!(
        "{}: an {kind} of one colour all over, whose alpha channel is not read: write in grey what is \
         transparent there",
        file.display()
    )))
}

/// A few of the files, spread over all.
fn some_of(by_photo: &BTreeMap<String, PathBuf>) -> impl Iterator<Item = &PathBuf> {
    let step = by_photo.len().div_ceil(MASKS_JUDGED).max(1);
    by_photo.values().step_by(step)
}

/// A folder as given, or else the capture's own of that name.
fn folder_of(capture: &Path, given: &Path) -> Result<PathBuf, SceneError> {
    let own = capture.join(given);
    [given.to_owned(), own]
        .into_iter()
        .find(|folder| folder.is_dir())
        .ok_or_else(|| SceneError::NoFolder(given.to_owned()))
}
