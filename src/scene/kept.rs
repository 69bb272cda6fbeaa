//! What ignore masks keep of their photos: whether they are an object's silhouettes, or labels.

use super::beside::{MASKS_FOLDER, MASKS_JUDGED, USED};
use super::{Photo, Scene, Warning};
use capture::as_argument;
use image::GrayImage;
use std::path::{Path, PathBuf};

/// Alpha and mask agree where both are on the same side of half in this share of pixels.
const AGREES: f64 = 0.99;

impl Scene {
    /// Says so where ignore masks are an object's silhouettes, and unless they were `asked`
    /// for, keeps them as that only: as ignore masks they would take the background away, and
    /// with it most of the picture. Of those that are looked at for that, says where their values are labels.
    pub(super) fn judge_masks(&mut self, asked: bool, warnings: &mut Vec<Warning>) {
        let masked = self.photos.iter().filter(|p| p.ignore_mask.is_some());
        let masked: Vec<&Photo> = masked.collect();
        let Some(first) = masked.first() else {
            return;
        };
        let mask = usable_mask(first);
        let repeats = |mask: &GrayImage| repeats_alpha(first, mask);
        let note = if mask.as_ref().is_some_and(repeats) {
            let remedy = if asked {
                "--no-masks leaves them out"
            } else {
                "they ignore nothing"
            };
            format!(
                "the ignore masks repeat the photos' alpha ({}, for one), which is an object \
                 matte already; {remedy}",
                first.name
            )
        } else {
            // What was asked for is not judged, but its first mask is there.
            let kept = Kept::of(&masked, mask, if asked { 1 } else { MASKS_JUDGED });
            warnings.extend(kept.note_of_faint());
            if asked || !kept.is_little {
                return;
            }
            let folder = self.masks_folder();
            let argument = as_argument(&folder);
            let folder = folder.display();
            format!(
                "the masks in {folder} keep less than half of each photo, as an object's \
                 silhouettes do, and serve the hull only; --mattes {argument} cuts the photos \
                 out along them, --masks {argument} ignores all else"
            )
        };
        warnings.push(Warning::Note(note));
        if !asked {
            for photo in &mut self.photos {
                photo.silhouette = photo.ignore_mask.take();
            }
        }
    }

    /// Says so where masks, mattes or the photos' own alpha leave nothing of their photos, as far as a few tell:
    /// those that are inverted do, or that are read for what they are not.
    pub(super) fn note_of_hidden(&self) -> Option<Warning> {
        let photos: Vec<&Photo> = self.photos.iter().collect();
        let masked = photos.iter().filter(|p| p.ignore_mask.is_some());
        let masked: Vec<&Photo> = masked.copied().collect();
        let (what, all, remedy) = if is_each(&masked, hides_all) {
            (
                "ignore masks",
                masked,
                "they are to be 0 where photos are to be ignored and 255 where they are to be used: are they \
                 inverted?",
            )
        } else if is_each(&photos, shows_no_object) {
            (
                "mattes or alpha channels",
                photos,
                "they are to be 255 where photos show the object and 0 elsewhere: are they inverted?",
            )
        } else {
            return None;
        };
        Some(Warning::Note(format!(
            "the {what} of {} photos leave nothing of them, as far as some of them tell ({}, for one); {remedy}",
            all.len(),
            all[0].name
        )))
    }

    /// Where the first ignore mask lies, as options may name it: from the capture's folder, if it
    /// is in there.
    fn masks_folder(&self) -> PathBuf {
        let mut masks = self.photos.iter().filter_map(|p| p.ignore_mask.as_deref());
        let folder = masks.next().and_then(Path::parent);
        let capture = self.capture.as_deref().unwrap_or(Path::new(""));
        let within = folder.map(|folder| match folder.strip_prefix(capture) {
            Ok(within) if within != Path::new("") => within,
            _ => folder,
        });
        match within {
            // Or in folders of the same names as the photos'.
            Some(folder) if !folder.starts_with(MASKS_FOLDER) => folder.to_owned(),
            _ => PathBuf::from(MASKS_FOLDER),
        }
    }
}

/// Whether something is so of a few of the photos, spread over all; not of none.
fn is_each(photos: &[&Photo], is_so: fn(&Photo) -> bool) -> bool {
    let step = photos.len().div_ceil(MASKS_JUDGED).max(1);
    !photos.is_empty() && photos.iter().step_by(step).all(|photo| is_so(photo))
}

/// Whether a photo's ignore mask ignores all of it.
fn hides_all(photo: &Photo) -> bool {
    usable_mask(photo).is_some_and(|mask| mask.iter().all(|value| *value == 0))
}

/// Whether a photo's matte, or its alpha, is zero all over.
fn shows_no_object(photo: &Photo) -> bool {
    if !photo.is_cut_out() {
        return false;
    }
    // As of masks.
    let pixels = capture::photo_size(&photo.path).and_then(|size| photo.decode(size));
    pixels.is_ok_and(|pixels| pixels.pixels().all(|pixel| pixel.0[3] == 0))
}

/// A photo's ignore mask, if it has one that can be decoded: what is wrong with a file is said when it is needed.
fn usable_mask(photo: &Photo) -> Option<GrayImage> {
    let size = capture::photo_size(&photo.path).ok()?;
    photo.decode_ignore_mask(size).ok()?
}

/// Whether a photo's ignore mask only repeats its alpha channel.
fn repeats_alpha(photo: &Photo, mask: &GrayImage) -> bool {
    // As of masks.
    let Ok(pixels) = photo.decode(mask.dimensions()) else {
        return false;
    };
    if pixels.pixels().all(|p| p.0[3] == 255) {
        return false;
    }
    let both = pixels.pixels().zip(mask.pixels());
    let agreeing = both
        .filter(|(p, m)| (p.0[3] >= 128) == (m.0[0] >= 128))
        .count();
    agreeing as f64 >= AGREES * pixels.pixels().len() as f64
}

/// What a few ignore masks, spread over all, keep of their photos.
struct Kept {
    /// Whether each keeps less than half.
    is_little: bool,
    /// The first whose values are all less than [`USED`], though not all zero, and the greatest of them.
    faint: Option<(PathBuf, u8)>,
}

impl Kept {
    /// Of `most` of the photos that have masks, the first of which has this one, if it can be decoded. No more
    /// are looked at than it takes to know that one keeps as much as half.
    fn of(masked: &[&Photo], mut first: Option<GrayImage>, most: usize) -> Self {
        let step = masked.len().div_ceil(most).max(1);
        let mut kept = Self {
            is_little: true,
            faint: None,
        };
        for photo in masked.iter().step_by(step) {
            let mask = first.take().or_else(|| usable_mask(photo));
            kept.is_little = mask.is_some_and(|mask| kept.add(photo, &mask));
            if !kept.is_little {
                break;
            }
        }
        kept
    }

    /// Whether one more mask keeps less than half of its photo. Of labels it keeps all but 0, as is meant by them.
    fn add(&mut self, photo: &Photo, mask: &GrayImage) -> bool {
        let greatest = mask.iter().copied().max().unwrap_or(0);
        let is_faint = (1..USED).contains(&greatest);
        if is_faint && self.faint.is_none() {
            let file = photo.ignore_mask.clone();
            self.faint = file.map(|file| (file, greatest));
        }
        let least = if is_faint { 1 } else { USED };
        let kept = mask.iter().filter(|value| **value >= least).count();
        2 * kept < mask.len()
    }

    /// What to say of masks of small values, if there are any.
    fn note_of_faint(&self) -> Option<Warning> {
        let (file, greatest) = self.faint.as_ref()?;
        Some(Warning::Note(format!(
            "{}: the greatest value of the ignore mask is {greatest}, of 255 for what is used: what has less \
             than {USED} is not compared with other photos, nor fused, nor matched in exposure; write 255 where \
             the photo is to be used",
            file.display()
        )))
    }
}
