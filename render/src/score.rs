//! How close a rendered picture comes to the photo that was taken there.

use image::{GrayImage, RgbaImage};
use rayon::prelude::*;
use serde::{Serialize, Serializer};

/// What a rendered picture scores against a photo.
///
/// As JSON, a PSNR above [`PSNR_CAP_DB`] (infinite for identical pictures, which JSON cannot
/// say) is written as that cap; PSNR and SSIM of nothing ([`Self::is_of_nothing`]) are `null`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Score {
    /// Peak signal-to-noise ratio in dB over the whole picture; infinite where it is
    /// identical.
    pub psnr: f64,
    /// PSNR in dB over the whole picture when it is first given the photo's exposure: red,
    /// green and blue are each multiplied by the factor that fits the covered pixels best, by least squares, and
    /// then clipped at white, but not rounded again.
    pub psnr_exposed: f64,
    /// Structural similarity over the whole picture; 1 where it is identical.
    pub ssim: f64,
    /// PSNR in dB over the covered pixels, those with half coverage or more; `None` where
    /// there are none.
    pub psnr_covered: Option<f64>,
    /// The mean alpha of the rendered picture, 0…1.
    pub coverage: f64,
}

impl Score {
    /// Whether the picture shows nothing, nor does the photo: that they are equal says nothing of how good either is.
    pub fn is_of_nothing(&self) -> bool {
        self.coverage == 0.0 && self.psnr >= PSNR_CAP_DB
    }
}

impl Serialize for Score {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Entries {
            psnr: Option<f64>,
            psnr_exposed: Option<f64>,
            ssim: Option<f64>,
            psnr_covered: Option<f64>,
            coverage: f64,
        }
        let told = |value: f64| (!self.is_of_nothing()).then_some(value);
        let entries = Entries {
            psnr: told(self.psnr.min(PSNR_CAP_DB)),
            psnr_exposed: told(self.psnr_exposed.min(PSNR_CAP_DB)),
            ssim: told(self.ssim),
            psnr_covered: self.psnr_covered.map(|psnr| psnr.min(PSNR_CAP_DB)),
            coverage: self.coverage,
        };
        entries.serialize(serializer)
    }
}

/// What a rendered picture scores against a photo where a mask says that it matters: the
/// object, or what is not ignored.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MaskedScore {
    /// PSNR in dB over the pixels inside; infinite where they are identical.
    #[serde(serialize_with = "capped")]
    pub psnr_masked: f64,
    /// The mean structural similarity of the windows whose middle lies inside; `None` where
    /// no window's does.
    pub ssim_masked: Option<f64>,
    /// The mean alpha inside, 0…1.
    pub coverage_masked: f64,
}

/// No PSNR counts for more than this in [`mean`] and in JSON, so that one photo reproduced
/// exactly does not outweigh all others.
pub const PSNR_CAP_DB: f64 = 99.0;

/// A rendered pixel is covered when its alpha is at least this, and a mask's value inside.
pub(crate) const HALF: u8 = 128;

/// Wang et al. 2004, "Image quality assessment: from error visibility to structural
/// similarity", §III: an 11 × 11 Gaussian window with σ = 1.5, K₁ = 0.01, K₂ = 0.03.
const WINDOW: usize = 11;
const SIGMA: f64 = 1.5;
const C1: f64 = (0.01 * 255.0) * (0.01 * 255.0);
const C2: f64 = (0.03 * 255.0) * (0.03 * 255.0);

/// Why two pictures cannot be compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ScoreError {
    /// They differ in size.
    #[error(
        "the rendered picture has {} × {} pixels and the photo {} × {}; render at the photo's size",
        rendered.0, rendered.1, photo.0, photo.1
    )]
    Size {
        /// Width and height in pixels.
        rendered: (u32, u32),
        /// Width and height in pixels.
        photo: (u32, u32),
    },
    /// The mask differs from the photo in size.
    #[error(
        "the mask has {} × {} pixels and the photo {} × {}; make them as large as each other",
        mask.0, mask.1, photo.0, photo.1
    )]
    MaskSize {
        /// Width and height in pixels.
        mask: (u32, u32),
        /// Width and height in pixels.
        photo: (u32, u32),
    },
    /// They are smaller than the window of SSIM.
    #[error("the pictures have {0} × {1} pixels; SSIM needs at least {WINDOW} × {WINDOW}")]
    TooSmall(u32, u32),
}

/// Scores a rendered picture (straight alpha, alpha = coverage) against its photo.
///
/// Both are composited on black and rounded to 8-bit sRGB, so what is not covered counts as
/// black. PSNR is 10·log₁₀(255²/MSE), the mean over all pixels and their three channels.
/// SSIM is computed in each of R, G and B with a Gaussian window, only where the window lies
/// within the picture, and averaged over places and channels: scikit-image's
/// `structural_similarity` with `gaussian_weights`, `channel_axis`, `data_range=255` and
/// without `use_sample_covariance`.
///
/// # Errors
/// The sizes differ, or are below 11 × 11 pixels.
pub fn score(rendered: &RgbaImage, photo: &RgbaImage) -> Result<Score, ScoreError> {
    check_sizes(rendered, photo)?;
    let width = rendered.width();
    let (ours, theirs) = (on_black(rendered), on_black(photo));
    let squared_error =
        |i: usize| -> u64 { (0..3).map(|c| squared(ours[i][c], theirs[i][c])).sum() };
    let alphas = || rendered.pixels().map(|p| p.0[3]);
    let count = ours.len();
    let total: u64 = (0..count).map(squared_error).sum();
    let covered = || (0..count).zip(alphas()).filter(|(_, a)| *a >= HALF);
    let covered_count = covered().count();
    let covered_total: u64 = covered().map(|(i, _)| squared_error(i)).sum();
    let alpha_sum: u64 = alphas().map(u64::from).sum();
    Ok(Score {
        psnr: psnr(total as f64, count),
        psnr_exposed: exposed(rendered, &ours, &theirs, |_| true),
        ssim: ssim(&ours, &theirs, width as usize, |_| true).unwrap_or(f64::NAN),
        psnr_covered: (covered_count > 0).then(|| psnr(covered_total as f64, covered_count)),
        coverage: alpha_sum as f64 / (255.0 * count as f64),
    })
}

/// Scores a rendered picture against its photo, as [`score`], inside a mask: where it is half
/// or more. `None` where it is nowhere.
///
/// # Errors
/// The sizes differ, or are below 11 × 11 pixels.
pub fn score_masked(
    rendered: &RgbaImage,
    photo: &RgbaImage,
    mask: &GrayImage,
) -> Result<Option<MaskedScore>, ScoreError> {
    check_sizes(rendered, photo)?;
    check_mask(mask, photo)?;
    let (ours, theirs) = (on_black(rendered), on_black(photo));
    let inside = |i: usize| mask.as_raw()[i] >= HALF;
    let indices = || (0..ours.len()).filter(|&i| inside(i));
    let count = indices().count();
    if count == 0 {
        return Ok(None);
    }
    let squared_error =
        |i: usize| -> u64 { (0..3).map(|c| squared(ours[i][c], theirs[i][c])).sum() };
    let alpha = |i: usize| u64::from(rendered.as_raw()[4 * i + 3]);
    Ok(Some(MaskedScore {
        psnr_masked: psnr(indices().map(squared_error).sum::<u64>() as f64, count),
        ssim_masked: ssim(&ours, &theirs, rendered.width() as usize, inside),
        coverage_masked: indices().map(alpha).sum::<u64>() as f64 / (255.0 * count as f64),
    }))
}

/// [`Score::psnr_exposed`] alone, inside a mask where there is one: the factors are those that fit the covered pixels
/// there. `None` where the mask is nowhere half or more.
///
/// # Errors
/// As for [`score_masked`].
pub fn psnr_exposed(
    rendered: &RgbaImage,
    photo: &RgbaImage,
    mask: Option<&GrayImage>,
) -> Result<Option<f64>, ScoreError> {
    check_sizes(rendered, photo)?;
    let inside = |i: usize| mask.is_none_or(|mask| mask.as_raw()[i] >= HALF);
    if let Some(mask) = mask {
        check_mask(mask, photo)?;
    }
    let (ours, theirs) = (on_black(rendered), on_black(photo));
    let is_somewhere = (0..ours.len()).any(inside);
    Ok(is_somewhere.then(|| exposed(rendered, &ours, &theirs, inside)))
}

/// The same of pixels on black, over those that count, by their index.
fn exposed(
    rendered: &RgbaImage,
    ours: &[[u8; 3]],
    theirs: &[[u8; 3]],
    counts: impl Fn(usize) -> bool,
) -> f64 {
    let indices = || (0..ours.len()).filter(|&i| counts(i));
    let is_covered = |i: &usize| rendered.as_raw()[4 * i + 3] >= HALF;
    let gain: [f64; 3] = std::array::from_fn(|c| {
        let pairs = indices().filter(is_covered);
        best_gain(pairs.map(|i| (ours[i][c], theirs[i][c])))
    });
    // Not rounded: where gains are near one that would cost more than they bring.
    let value = |i: usize, c: usize| (f64::from(ours[i][c]) * gain[c]).min(255.0);
    let squared_error = |i: usize| -> f64 {
        let difference = |c: usize| value(i, c) - f64::from(theirs[i][c]);
        (0..3).map(|c| difference(c).powi(2)).sum()
    };
    psnr(indices().map(squared_error).sum(), indices().count())
}

/// The mean of scores inside masks, as [`mean`]; `None` of nothing.
pub fn mean_masked(scores: &[MaskedScore]) -> Option<MaskedScore> {
    let mean = |value: &dyn Fn(&MaskedScore) -> Option<f64>| {
        mean_of(&scores.iter().filter_map(value).collect::<Vec<_>>())
    };
    Some(MaskedScore {
        psnr_masked: mean(&|s| Some(s.psnr_masked.min(PSNR_CAP_DB)))?,
        ssim_masked: mean(&|s| s.ssim_masked),
        coverage_masked: mean(&|s| Some(s.coverage_masked))?,
    })
}

/// The mean of numbers; `None` of none.
pub fn mean_of(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

fn check_sizes(rendered: &RgbaImage, photo: &RgbaImage) -> Result<(), ScoreError> {
    let (width, height) = rendered.dimensions();
    if photo.dimensions() != (width, height) {
        return Err(ScoreError::Size {
            rendered: (width, height),
            photo: photo.dimensions(),
        });
    }
    check_size(width, height)
}

fn check_mask(mask: &GrayImage, photo: &RgbaImage) -> Result<(), ScoreError> {
    if mask.dimensions() != photo.dimensions() {
        return Err(ScoreError::MaskSize {
            mask: mask.dimensions(),
            photo: photo.dimensions(),
        });
    }
    Ok(())
}

/// Fails where pictures of so many pixels are too small for [`score`].
///
/// # Errors
/// A side is below 11 pixels.
pub fn check_size(width: u32, height: u32) -> Result<(), ScoreError> {
    if (width.min(height) as usize) < WINDOW {
        return Err(ScoreError::TooSmall(width, height));
    }
    Ok(())
}

/// The mean of per-photo scores, PSNR as the mean of dB values of at most [`PSNR_CAP_DB`];
/// `psnr_covered` over those that have one. `None` of nothing.
pub fn mean(scores: &[Score]) -> Option<Score> {
    let all = |value: fn(&Score) -> f64| mean_of(&scores.iter().map(value).collect::<Vec<_>>());
    let covered: Vec<f64> = scores
        .iter()
        .filter_map(|s| Some(s.psnr_covered?.min(PSNR_CAP_DB)))
        .collect();
    Some(Score {
        psnr: all(|s| s.psnr.min(PSNR_CAP_DB))?,
        psnr_exposed: all(|s| s.psnr_exposed.min(PSNR_CAP_DB))?,
        ssim: all(|s| s.ssim)?,
        psnr_covered: mean_of(&covered),
        coverage: all(|s| s.coverage)?,
    })
}

/// The factor by which the first values of all pairs come closest to the second, in least
/// squares; one where all are zero.
fn best_gain(pairs: impl Iterator<Item = (u8, u8)>) -> f64 {
    let (mut product, mut square) = (0.0, 0.0);
    for (a, b) in pairs {
        let (a, b) = (f64::from(a), f64::from(b));
        product += a * b;
        square += a * a;
    }
    if square > 0.0 { product / square } else { 1.0 }
}

fn capped<S: Serializer>(psnr: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_f64(psnr.min(PSNR_CAP_DB))
}

/// The colours over black, row by row, rounded to the nearest byte.
pub fn on_black(image: &RgbaImage) -> Vec<[u8; 3]> {
    let pixels = image.pixels().map(|p| {
        let [r, g, b, a] = p.0;
        [r, g, b].map(|v| ((u32::from(v) * u32::from(a) + 127) / 255) as u8)
    });
    pixels.collect()
}

fn squared(a: u8, b: u8) -> u64 {
    let difference = u64::from(a.abs_diff(b));
    difference * difference
}

/// In dB, from the sum of squared differences of `count` pixels' three channels.
fn psnr(sum: f64, count: usize) -> f64 {
    let mean_squared_error = sum / (3.0 * count as f64);
    10.0 * (255.0 * 255.0 / mean_squared_error).log10()
}

/// The window along one axis; it sums to one.
fn window() -> [f64; WINDOW] {
    let weights: [f64; WINDOW] = std::array::from_fn(|i| {
        let x = i as f64 - (WINDOW / 2) as f64;
        (-x * x / (2.0 * SIGMA * SIGMA)).exp()
    });
    let sum: f64 = weights.iter().sum();
    weights.map(|w| w / sum)
}

/// Mean SSIM of the windows whose middle pixel counts, by its index; `None` where none does.
/// One row of windows at a time: first down the columns, then along the row. Rows are summed
/// in order, so the result does not depend on the threads.
fn ssim(
    ours: &[[u8; 3]],
    theirs: &[[u8; 3]],
    width: usize,
    counts: impl Fn(usize) -> bool + Sync,
) -> Option<f64> {
    let weights = window();
    let rows = ours.len() / width - WINDOW + 1;
    let columns = width - WINDOW + 1;
    let row = |y: usize| -> (f64, usize) {
        // x, y, x² + y² and xy of each channel, the window applied down the columns.
        let mut down = vec![[0.0; 12]; width];
        for (k, &weight) in weights.iter().enumerate() {
            let row = (y + k) * width..(y + k + 1) * width;
            let pixels = ours[row.clone()].iter().zip(&theirs[row]);
            for (sums, (a, b)) in down.iter_mut().zip(pixels) {
                for c in 0..3 {
                    let (a, b) = (f64::from(a[c]), f64::from(b[c]));
                    sums[4 * c] += weight * a;
                    sums[4 * c + 1] += weight * b;
                    sums[4 * c + 2] += weight * (a * a + b * b);
                    sums[4 * c + 3] += weight * (a * b);
                }
            }
        }
        let mut total = 0.0;
        let mut count = 0;
        for x in 0..columns {
            if !counts((y + WINDOW / 2) * width + x + WINDOW / 2) {
                continue;
            }
            count += 1;
            let mut moments = [0.0; 12];
            for (weight, sums) in weights.iter().zip(&down[x..]) {
                for i in 0..12 {
                    moments[i] += weight * sums[i];
                }
            }
            for m in moments.as_chunks::<4>().0 {
                total += similarity(m);
            }
        }
        (total, count)
    };
    let totals: Vec<(f64, usize)> = (0..rows).into_par_iter().map(row).collect();
    let count: usize = totals.iter().map(|t| t.1).sum();
    let total: f64 = totals.iter().map(|t| t.0).sum();
    (count > 0).then(|| total / (3 * count) as f64)
}

/// Wang et al. 2004, eq. 13, from the windowed means of x, y, x² + y² and xy. Exactly one
/// where x = y.
fn similarity(&[x, y, squares, product]: &[f64; 4]) -> f64 {
    let means = x * x + y * y;
    let covariance = product - x * y;
    let variances = squares - means;
    ((2.0 * (x * y) + C1) * (2.0 * covariance + C2)) / ((means + C1) * (variances + C2))
}

#[cfg(test)]
mod tests;
