//! The photos' gains.

use super::beside::USED;
use super::file::{ExposureEntry, Extra};
use super::{Photo, Scene};
use calibrate::exposure::{self, Verdict};
use calibrate::{Image, TRUSTED_TIE};
use capture::CaptureError;
use image::RgbaImage;
use std::collections::{BTreeMap, BTreeSet};

/// What matching the exposures of a scene's photos has found.
#[derive(Clone, Debug)]
pub struct Matched {
    /// Whether they differ.
    pub verdict: Verdict,
    /// Photos that could not be decoded, and had no say: by name, with what is wrong with each.
    pub left_out: BTreeMap<String, String>,
}

impl Scene {
    /// Estimates every photo's gain, and sets it, from those of their colours at the sparse
    /// points, as if the photos of the given names had never been taken; these have none
    /// then. Where gains do not differ measurably no photo has one.
    ///
    /// Decodes each photo that sees a point, and keeps none. See
    /// [`calibrate::exposure`].
    pub fn match_exposure(&mut self, without: &BTreeSet<String>) -> Matched {
        let rest = self.reconstruction.without_images(without);
        let used = || self.photos.iter().filter(|p| !without.contains(&p.name));
        let names: Vec<&str> = used().map(|p| p.name.as_str()).collect();
        let photos: Vec<&Photo> = used().collect();
        let patches = exposure::patches(&rest, &names);
        let images = self.images_by_name();
        let (observations, failed) = exposure::sample_all(&patches, |idx| {
            // Only photos with a pose see points.
            self.what_counts(photos[idx], images[names[idx]])
        });
        let matched = exposure::estimate(names.len(), &patches.points_in_world, &observations);

        let failed = failed.into_iter();
        let left_out = failed.map(|(idx, error)| (names[idx].to_owned(), error.to_string()));
        let left_out = left_out.collect();
        let differ = matches!(matched.verdict, Verdict::Matched(_));
        let mut gains = matched.gains.into_iter();
        for photo in &mut self.photos {
            photo.gain = None;
            if !without.contains(&photo.name) {
                photo.gain = gains.next().filter(|_| differ);
            }
        }
        self.exposure = Some(ExposureEntry {
            matched_without: without.iter().cloned().collect(),
            other: Extra::new(),
        });
        Matched {
            verdict: matched.verdict,
            left_out,
        }
    }

    /// The same for a scene that is to be written, by what draws alone: photos whose places are unsure, those that are
    /// [misplaced](Self::misplaced), and points that all theirs contradict have no say. Such photos have gains, too, for whoever
    /// uses them: relative to the others, as matching all of them has it.
    pub fn match_exposure_by_trusted(&mut self) -> Matched {
        let without = BTreeSet::new();
        let tied = self.reconstruction.weakly_tied(TRUSTED_TIE);
        if tied.is_empty() && self.misplaced().is_empty() && self.contradicted_points().is_empty() {
            // A model may be large.
            return self.match_exposure(&without);
        }
        let mut trusted = self.clone();
        trusted.drop_weak();
        trusted.drop_misplaced();
        trusted.drop_contradicted();
        let mut matched = trusted.match_exposure(&without);
        let known = trusted.photos.iter();
        let known = known.filter_map(|photo| Some((photo.name.clone(), photo.gain?)));
        let known: BTreeMap<String, [f64; 3]> = known.collect();
        let better = |photo: &Photo| known.get(&photo.name).copied();

        let has_others = trusted.photos.len() < self.photos.len();
        if has_others && matches!(matched.verdict, Verdict::Matched(_)) {
            let whole = self.match_exposure(&without);
            matched.left_out.extend(whole.left_out);
            let better: Vec<Option<[f64; 3]>> = self.photos.iter().map(better).collect();
            let all = self.photos.iter().map(|p| p.gain.unwrap_or([1.0; 3]));
            let all: Vec<[f64; 3]> = all.collect();
            let gains = exposure::completed(&better, &all);
            for (photo, gain) in self.photos.iter_mut().zip(gains) {
                photo.gain = Some(gain);
            }
        } else {
            for photo in &mut self.photos {
                photo.gain = better(photo);
            }
        }
        self.exposure = trusted.exposure;
        matched
    }

    /// A photo's pixels, transparent where its matte says so or its ignore mask ignores them.
    fn what_counts(&self, photo: &Photo, image: &Image) -> Result<RgbaImage, CaptureError> {
        let camera = &self.reconstruction.cameras[&image.camera_id];
        let size = (camera.width, camera.height);
        let mut pixels = photo.decode(size)?;
        if let Some(mask) = photo.decode_ignore_mask(size)? {
            for (pixel, used) in pixels.pixels_mut().zip(mask.pixels()) {
                if used.0[0] < USED {
                    pixel.0[3] = 0;
                }
            }
        }
        Ok(pixels)
    }

    /// Whether the scene's gains rest on none of the photos of the given names: they were
    /// matched without them, or given by hand.
    pub fn exposure_is_without(&self, names: &BTreeSet<String>) -> bool {
        self.exposure
            .as_ref()
            .is_none_or(|own| names.iter().all(|name| own.matched_without.contains(name)))
    }

    /// Forgets all gains.
    pub fn forget_exposure(&mut self) {
        self.exposure = None;
        self.photos.iter_mut().for_each(|photo| photo.gain = None);
    }
}
