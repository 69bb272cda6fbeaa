//! How much of what a photo shows a rendered picture covers.

use crate::score::{HALF, ScoreError, mean_of};
use calibrate::Pixel;
use image::{GrayImage, RgbaImage};
use serde::Serialize;

/// How much a rendered picture covers of an object, and of what lies behind it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MatteCoverage {
    /// The mean alpha inside the object's matte, 0…1; `None` where it is nowhere.
    pub coverage_matte: Option<f64>,
    /// The mean alpha outside, 0…1: best is 0. `None` where all is object.
    pub coverage_background: Option<f64>,
    /// The share of the pixels inside that are covered, by half or more: unlike a mean of alpha it
    /// does not count the soft rim of the matte itself as a lack.
    pub covered_matte: Option<f64>,
    /// The share of those outside that are: best is 0.
    pub covered_background: Option<f64>,
}

/// The share of the given places whose pixels are covered, each counted: of the points that a photo
/// shows and others see too, how many the picture shows. Places outside the picture do not
/// count; `None` where none is inside.
pub fn coverage_points(
    rendered: &RgbaImage,
    places: impl IntoIterator<Item = Pixel>,
) -> Option<f64> {
    let (width, height) = rendered.dimensions();
    let (mut covered, mut count) = (0_usize, 0_usize);
    for place in places {
        let inside = (0.0..f64::from(width)).contains(&place.x)
            && (0.0..f64::from(height)).contains(&place.y);
        if inside {
            let pixel = rendered.get_pixel(place.x as u32, place.y as u32);
            covered += usize::from(pixel.0[3] >= HALF);
            count += 1;
        }
    }
    (count > 0).then(|| covered as f64 / count as f64)
}

/// How much a rendered picture covers of the pixels inside a matte, where it is half or more,
/// and of the others. Pixels that are `used` less than half count as neither.
///
/// # Errors
/// The sizes differ.
pub fn coverage_matte(
    rendered: &RgbaImage,
    matte: &GrayImage,
    used: Option<&GrayImage>,
) -> Result<MatteCoverage, ScoreError> {
    for mask in [Some(matte), used].into_iter().flatten() {
        if mask.dimensions() != rendered.dimensions() {
            return Err(ScoreError::MaskSize {
                mask: mask.dimensions(),
                photo: rendered.dimensions(),
            });
        }
    }
    // The sums of alpha, those covered, and the pixels: inside and outside.
    let mut sums = [(0_u64, 0_u64, 0_u64); 2];
    for (i, pixel) in rendered.pixels().enumerate() {
        if used.is_none_or(|used| used.as_raw()[i] >= HALF) {
            let (sum, covered, count) = &mut sums[usize::from(matte.as_raw()[i] < HALF)];
            *sum += u64::from(pixel.0[3]);
            *covered += u64::from(pixel.0[3] >= HALF);
            *count += 1;
        }
    }
    let [coverage_matte, coverage_background] =
        sums.map(|(sum, _, count)| (count > 0).then(|| sum as f64 / (255.0 * count as f64)));
    let [covered_matte, covered_background] =
        sums.map(|(_, covered, count)| (count > 0).then(|| covered as f64 / count as f64));
    Ok(MatteCoverage {
        coverage_matte,
        coverage_background,
        covered_matte,
        covered_background,
    })
}

/// The means of those that there are; `None` of nothing.
pub fn mean_matte(coverages: &[MatteCoverage]) -> Option<MatteCoverage> {
    let mean = |value: fn(&MatteCoverage) -> Option<f64>| {
        mean_of(&coverages.iter().filter_map(value).collect::<Vec<_>>())
    };
    (!coverages.is_empty()).then(|| MatteCoverage {
        coverage_matte: mean(|c| c.coverage_matte),
        coverage_background: mean(|c| c.coverage_background),
        covered_matte: mean(|c| c.covered_matte),
        covered_background: mean(|c| c.covered_background),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{Luma, Rgba};

    #[test]
    fn points_are_covered_where_their_pixels_are() {
        // Left half covered, the middle column only a little.
        let rendered = RgbaImage::from_fn(9, 4, |x, _| match x {
            0..4 => Rgba([0, 0, 0, 128]),
            4 => Rgba([0, 0, 0, 127]),
            _ => Rgba([0; 4]),
        });
        let at = |places: &[(f64, f64)]| {
            coverage_points(&rendered, places.iter().map(|&(x, y)| Pixel::new(x, y)))
        };
        assert_eq!(at(&[(0.0, 0.0), (3.99, 3.99)]), Some(1.0));
        assert_eq!(
            at(&[(0.5, 0.5), (4.0, 1.0), (8.9, 2.0), (2.0, 3.0)]),
            Some(0.5)
        );
        // Outside, on the far border, nowhere.
        let outside = [
            (-0.1, 1.0),
            (9.0, 1.0),
            (1.0, 4.0),
            (f64::NAN, 1.0),
            (1e300, 1.0),
        ];
        assert_eq!(at(&outside), None);
        assert_eq!(at(&[outside[0], (1.0, 1.0)]), Some(1.0));
        assert_eq!(at(&[]), None);
    }

    #[test]
    fn matte_and_background_are_covered_each_by_itself() {
        // The object is the left half; what is drawn reaches beyond it, and lacks its top.
        let matte = GrayImage::from_fn(10, 4, |x, _| Luma([if x < 5 { 128 } else { 127 }]));
        let rendered = RgbaImage::from_fn(10, 4, |x, y| match (x, y) {
            (_, 0) => Rgba([9, 9, 9, 0]),
            (0..5, _) => Rgba([9, 9, 9, 255]),
            (5, _) => Rgba([9, 9, 9, 51]),
            _ => Rgba([0; 4]),
        });
        let found = coverage_matte(&rendered, &matte, None).unwrap();
        assert_eq!(found.coverage_matte, Some(0.75));
        assert!((found.coverage_background.unwrap() - 0.2 * 3.0 / 20.0).abs() < 1e-12);
        assert_eq!(found.covered_matte, Some(0.75));
        assert_eq!(found.covered_background, Some(0.0));

        // What is ignored is neither.
        let used = GrayImage::from_fn(10, 4, |x, y| Luma([if x < 5 && y > 0 { 255 } else { 0 }]));
        let found = coverage_matte(&rendered, &matte, Some(&used)).unwrap();
        assert_eq!(found.coverage_matte, Some(1.0));
        assert_eq!(found.coverage_background, None);
        let nothing = GrayImage::new(10, 4);
        let none = coverage_matte(&rendered, &nothing, None).unwrap();
        assert_eq!(none.coverage_matte, None);
        let mean = mean_matte(&[found, none]).unwrap();
        assert_eq!(mean.coverage_matte, Some(1.0));
        assert_eq!(mean.coverage_background, none.coverage_background);
        assert_eq!(mean_matte(&[]), None);

        let error = coverage_matte(&rendered, &GrayImage::new(4, 10), None).unwrap_err();
        assert_eq!(
            error.to_string(),
            "the mask has 4 × 10 pixels and the photo 10 × 4; make them as large as each other"
        );
        assert!(coverage_matte(&rendered, &matte, Some(&GrayImage::new(4, 10))).is_err());
    }
}
