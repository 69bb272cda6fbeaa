//! Held-out photos, and what a picture rendered in their place scores.

use super::{Photo, Scene, SceneError};
use calibrate::{ImageId, Pixel};
use capture::CaptureError;
use image::{GrayImage, Luma, RgbaImage};
use render::coverage::{MatteCoverage, coverage_matte, coverage_points, mean_matte};
use render::score::{
    MaskedScore, Score, ScoreError, mean, mean_masked, mean_of, score, score_masked,
};
use serde::Serialize;
use std::collections::BTreeSet;

/// A photo to compare a rendered picture with.
#[derive(Clone, Debug)]
pub struct Truth {
    /// Its pixels, cut out by its matte.
    pub pixels: RgbaImage,
    /// Where it shows its object and nothing that is to be ignored, 0…255; `None` where
    /// neither mask nor alpha tells.
    pub inside: Option<GrayImage>,
    /// Its object's matte; `None` where the photo is opaque all over.
    pub matte: Option<GrayImage>,
    /// What to use of it (255) and what to ignore (0), where a mask says so.
    pub used: Option<GrayImage>,
    /// Where it shows sparse points that two or more source photos see, too; of its object only,
    /// if it has a matte.
    pub points: Vec<Pixel>,
}

/// What a picture scores against a photo.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TruthScore {
    /// Over the whole picture.
    #[serde(flatten)]
    pub score: Score,
    /// The share of [`Truth::points`] that fall on covered pixels; `None` where there are none.
    pub coverage_points: Option<f64>,
    /// Inside the photo's own mask or matte, if it has one.
    #[serde(flatten)]
    pub masked: Option<MaskedScore>,
    /// Of its matte and of its background, if it has a matte.
    #[serde(flatten)]
    pub matte: Option<MatteCoverage>,
}

impl Truth {
    fn new(pixels: RgbaImage, used: Option<GrayImage>, mut points: Vec<Pixel>) -> Self {
        let (width, height) = pixels.dimensions();
        let alpha = |x, y| pixels.get_pixel(x, y).0[3];
        let opaque = pixels.pixels().all(|p| p.0[3] == 255);
        let inside = (!opaque || used.is_some()).then(|| {
            GrayImage::from_fn(width, height, |x, y| {
                let used = used.as_ref().map_or(255, |m| m.get_pixel(x, y).0[0]);
                Luma([alpha(x, y).min(used)])
            })
        });
        let matte =
            (!opaque).then(|| GrayImage::from_fn(width, height, |x, y| Luma([alpha(x, y)])));
        points.retain(|&place| coverage_points(&pixels, [place]) != Some(0.0));
        Self {
            pixels,
            inside,
            matte,
            used,
            points,
        }
    }

    /// The photo: straight alpha.
    pub fn picture(&self) -> &RgbaImage {
        &self.pixels
    }

    /// The same in another size, reduced by area; what is ignored does not bleed into what is used.
    #[must_use]
    pub fn resized(self, width: u32, height: u32) -> Self {
        let (old_width, old_height) = self.pixels.dimensions();
        if (old_width, old_height) == (width, height) {
            return self;
        }
        let mask = |mask: GrayImage| capture::resize_mask(&mask, width, height);
        let (x, y) = (
            f64::from(width) / f64::from(old_width),
            f64::from(height) / f64::from(old_height),
        );
        let points = self.points.into_iter();
        Self {
            pixels: match &self.used {
                Some(used) => capture::resize_used(&self.pixels, used, width, height),
                None => capture::resize(&self.pixels, width, height),
            },
            inside: self.inside.map(mask),
            matte: self.matte.map(mask),
            used: self.used.map(mask),
            points: points.map(|p| Pixel::new(x * p.x, y * p.y)).collect(),
        }
    }

    /// What a picture of the same size scores.
    ///
    /// # Errors
    /// As [`score`].
    pub fn score(&self, rendered: &RgbaImage) -> Result<TruthScore, ScoreError> {
        let masked = match &self.inside {
            Some(inside) => score_masked(rendered, &self.pixels, inside)?,
            None => None,
        };
        let matte = self.matte.as_ref();
        let matte = matte.map(|matte| coverage_matte(rendered, matte, self.used.as_ref()));
        Ok(TruthScore {
            score: score(rendered, &self.pixels)?,
            coverage_points: coverage_points(rendered, self.points.iter().copied()),
            masked,
            matte: matte.transpose()?,
        })
    }
}

impl TruthScore {
    /// Whether the picture shows nothing, nor does the photo: that they are equal says nothing of how good either is.
    pub fn is_of_nothing(&self) -> bool {
        self.score.is_of_nothing()
    }

    /// The mean, each figure over the photos that have it; those of nothing count for their coverage alone, unless
    /// all are. `None` of nothing.
    pub fn mean(scores: &[Self]) -> Option<Self> {
        let of = |value: fn(&Self) -> Option<f64>| {
            mean_of(&scores.iter().filter_map(value).collect::<Vec<_>>())
        };
        let masked: Vec<MaskedScore> = scores.iter().filter_map(|s| s.masked).collect();
        let matte: Vec<MatteCoverage> = scores.iter().filter_map(|s| s.matte).collect();
        let all: Vec<Score> = scores.iter().map(|s| s.score).collect();
        let telling = scores.iter().filter(|s| !s.is_of_nothing());
        let telling: Vec<Score> = telling.map(|s| s.score).collect();
        let of_all = mean(&all)?;
        let score = mean(&telling).map_or(of_all, |score| Score {
            coverage: of_all.coverage,
            ..score
        });
        Some(Self {
            score,
            coverage_points: of(|s| s.coverage_points),
            masked: mean_masked(&masked),
            matte: mean_matte(&matte),
        })
    }
}

impl Scene {
    /// A photo to compare with what is rendered without the photos of the given names.
    ///
    /// # Errors
    /// No such photo, or its camera has no lens: the outer error. It cannot be decoded: the
    /// inner one.
    pub fn truth(
        &self,
        name: &str,
        without: &BTreeSet<String>,
    ) -> Result<Result<Truth, CaptureError>, SceneError> {
        let view = self.view(name)?;
        let photo = self.photos.iter().find(|photo| photo.name == name);
        let photo = photo.ok_or_else(|| self.unknown_photo(name))?;
        let decode = |photo: &Photo, size| {
            let pixels = photo.decode(size)?;
            let used = photo.decode_ignore_mask(size)?;
            Ok((pixels, used))
        };
        let decoded = decode(photo, (view.width, view.height));
        Ok(decoded
            .map(|(pixels, used)| Truth::new(pixels, used, self.seen_elsewhere(name, without))))
    }

    /// Where a photo shows sparse points that two or more others see, those of the given names
    /// left out: in its own pixels, in the order of the points.
    fn seen_elsewhere(&self, name: &str, without: &BTreeSet<String>) -> Vec<Pixel> {
        let images = &self.reconstruction.images;
        let Some((own_id, own)) = images.iter().find(|(_, image)| image.name == name) else {
            return Vec::new();
        };
        let is_source = |id: &&ImageId| {
            let image = images.get(*id);
            *id != own_id && image.is_some_and(|image| !without.contains(&image.name))
        };
        let points = self.reconstruction.points.values();
        let place = |point: &calibrate::Point3D| {
            let here = point.track.iter().find(|(id, _)| id == own_id)?.1;
            let track = point.track.iter().map(|(id, _)| id);
            let sources: BTreeSet<&ImageId> = track.filter(is_source).collect();
            let keypoint = own.keypoints.get(here as usize)?;
            (sources.len() >= 2).then_some(Pixel::new(keypoint.x, keypoint.y))
        };
        points.filter_map(place).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgba;
    use render::score::PSNR_CAP_DB;

    #[test]
    fn a_truth_reduced_keeps_its_parts_in_place() {
        let pixels = RgbaImage::from_fn(48, 24, |x, _| {
            Rgba([200, 100, 50, if x < 24 { 255 } else { 0 }])
        });
        let used = GrayImage::from_fn(48, 24, |_, y| Luma([if y < 12 { 255 } else { 0 }]));
        let truth = Truth::new(
            pixels,
            Some(used),
            vec![Pixel::new(12.0, 6.0), Pixel::new(40.0, 6.0)],
        );
        let small = truth.resized(24, 12);
        assert_eq!(small.points, [Pixel::new(6.0, 3.0)]);
        for (x, y, inside, matte) in [(3, 3, 255, 255), (20, 3, 0, 0), (3, 9, 0, 255)] {
            assert_eq!(small.inside.as_ref().unwrap().get_pixel(x, y).0[0], inside);
            assert_eq!(small.matte.as_ref().unwrap().get_pixel(x, y).0[0], matte);
        }
        let scores = small.score(&small.pixels).unwrap();
        assert_eq!(scores.coverage_points, Some(1.0));
        let matte = scores.matte.unwrap();
        assert_eq!(matte.coverage_matte, Some(1.0));
        assert_eq!(matte.coverage_background, Some(0.0));
        assert_eq!(scores.masked.unwrap().coverage_masked, 1.0);
        let nothing = small.score(&RgbaImage::new(24, 12)).unwrap();
        assert_eq!(nothing.coverage_points, Some(0.0));
        let mean = TruthScore::mean(&[scores, nothing]).unwrap();
        assert_eq!(mean.coverage_points, Some(0.5));
        assert_eq!(mean.matte.unwrap().coverage_matte, Some(0.5));
    }

    #[test]
    fn what_is_ignored_has_no_say_in_a_reduced_truth() {
        let used = GrayImage::from_fn(72, 48, |x, y| {
            let hidden = (11..38).contains(&x) && (7..30).contains(&y);
            Luma([if hidden { 0 } else { 255 }])
        });
        let truth = |hidden: Option<[u8; 3]>| {
            let pixels = RgbaImage::from_fn(72, 48, |x, y| match hidden {
                Some([r, g, b]) if used.get_pixel(x, y).0[0] == 0 => Rgba([r, g, b, 255]),
                _ => Rgba([(3 * x) as u8, (5 * y) as u8, (x * y % 250) as u8, 255]),
            });
            Truth::new(pixels, Some(used.clone()), Vec::new())
        };
        for (width, height) in [(36, 24), (24, 16), (50, 33)] {
            let rendered = RgbaImage::from_pixel(width, height, Rgba([90, 110, 130, 255]));
            let psnr = |hidden| {
                let truth = truth(hidden).resized(width, height);
                truth.score(&rendered).unwrap().masked.unwrap().psnr_masked
            };
            assert_eq!(psnr(None), psnr(Some([255, 0, 255])), "{width}");
            assert_eq!(psnr(None), psnr(Some([0; 3])), "{width}");
        }
    }

    #[test]
    fn an_opaque_photo_has_neither_matte_nor_inside() {
        let truth = Truth::new(
            RgbaImage::from_pixel(16, 16, Rgba([9, 9, 9, 255])),
            None,
            Vec::new(),
        );
        let scores = truth.score(&truth.pixels).unwrap();
        assert_eq!(scores.coverage_points, None);
        assert!(scores.masked.is_none() && scores.matte.is_none());
        assert_eq!(TruthScore::mean(&[]), None);
    }

    #[test]
    fn nothing_compared_with_nothing_says_nothing() {
        let of = |alpha| {
            Truth::new(
                RgbaImage::from_pixel(16, 16, Rgba([200, 0, 0, alpha])),
                None,
                Vec::new(),
            )
        };
        let nothing = RgbaImage::new(16, 16);
        let score = |alpha: u8| of(alpha).score(&nothing).unwrap();
        assert!(score(0).is_of_nothing() && !score(255).is_of_nothing());
        let json = |score: TruthScore| serde_json::to_value(score).unwrap();
        for key in ["psnr", "psnr_exposed", "ssim"] {
            assert!(json(score(0))[key].is_null() && json(score(255))[key].is_f64());
        }
        let mean = TruthScore::mean(&[score(0), score(255)]).unwrap();
        assert_eq!(mean.score, score(255).score);
        let mean = TruthScore::mean(&[score(0)]).unwrap();
        assert!(mean.is_of_nothing());
        // Half of the covered ones.
        let shown = of(255).score(&of(255).pixels).unwrap();
        let mean = TruthScore::mean(&[score(0), shown]).unwrap();
        assert_eq!((mean.score.psnr, mean.score.coverage), (PSNR_CAP_DB, 0.5));
    }

    #[test]
    fn points_of_a_held_out_photo_need_two_source_photos() {
        let options = datasets::Options {
            size: Some((48, 36)),
            samples_per_side: Some(1),
            ..datasets::Options::default()
        };
        let wall = datasets::by_name("wall", &options).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("wall");
        datasets::write(&wall, &path).unwrap();
        let (scene, _) = Scene::open(&path, false).unwrap();
        let named = |names: &[&str]| names.iter().map(|n| (*n).to_owned()).collect();
        let count = |without: &BTreeSet<String>| {
            let truth = scene.truth("0000.png", without).unwrap().unwrap();
            truth.points.len()
        };
        let tracks: Vec<Vec<u32>> = scene
            .reconstruction
            .points
            .values()
            .map(|p| p.track.iter().map(|(id, _)| id.0).collect())
            .collect();
        let here = tracks.iter().filter(|t| t.contains(&1));
        // A photo is no source of itself, whether it was named or not.
        let with_two = here.clone().filter(|t| t.len() >= 3).count();
        assert!(with_two > 10);
        assert_eq!(count(&named(&["0000.png"])), with_two);
        assert_eq!(count(&BTreeSet::new()), with_two);
        // The names are 0000.png… and ids 1….
        let most: Vec<String> = scene.names().into_iter().skip(3).collect();
        let few = here.filter(|t| t.contains(&2) && t.contains(&3)).count();
        assert_eq!(count(&most.iter().cloned().collect()), few);
        let fewer: BTreeSet<String> = scene.names().into_iter().skip(2).collect();
        assert_eq!(count(&fewer), 0);
        assert!(scene.truth("x.png", &fewer).is_err());
    }
}
