use super::*;
use image::{Luma, Rgba};

/// Repeatable noise in 0..256.
fn noise(x: u32, y: u32, salt: u32) -> u8 {
    let mut h = x.wrapping_mul(0x9E37_79B1) ^ y.wrapping_mul(0x85EB_CA77) ^ salt;
    h = (h ^ (h >> 15)).wrapping_mul(0x2C1B_3C6D);
    h = (h ^ (h >> 12)).wrapping_mul(0x297A_2D39);
    (h >> 24) as u8
}

fn picture(width: u32, height: u32) -> RgbaImage {
    RgbaImage::from_fn(width, height, |x, y| {
        let base = 40 + 2 * x + y;
        let at = |salt: u32| (base + u32::from(noise(x, y, salt)) / 8).min(255) as u8;
        Rgba([at(1), at(2), at(3), 255])
    })
}

#[test]
fn identical_pictures_score_best() {
    let photo = picture(40, 23);
    let s = score(&photo, &photo).unwrap();
    assert_eq!(s.psnr, f64::INFINITY);
    assert_eq!(s.ssim, 1.0);
    assert_eq!(s.psnr_covered, Some(f64::INFINITY));
    assert_eq!(s.coverage, 1.0);
    let json = serde_json::to_string(&s).unwrap();
    assert_eq!(
        json,
        r#"{"psnr":99.0,"psnr_exposed":99.0,"ssim":1.0,"psnr_covered":99.0,"coverage":1.0}"#
    );
}

#[test]
fn constants_by_hand() {
    let gray = |v: u8| RgbaImage::from_pixel(16, 12, Rgba([v, v, v, 255]));
    let s = score(&gray(100), &gray(110)).unwrap();
    // 20·log₁₀(255/10), and with no variance only the term of the means.
    assert!((s.psnr - 28.130_803_608_679_1).abs() < 1e-9);
    let ssim = (2.0 * 100.0 * 110.0 + C1) / (100.0 * 100.0 + 110.0 * 110.0 + C1);
    assert!((s.ssim - ssim).abs() < 1e-9);
    let s = score(&gray(0), &gray(255)).unwrap();
    assert_eq!(s.psnr, 0.0);
    assert!((s.ssim - C1 / (255.0 * 255.0 + C1)).abs() < 1e-12);
}

#[test]
fn noise_of_known_power_has_known_psnr() {
    let photo = picture(64, 48);
    // ±3 in every channel: the mean squared error is 9.
    let mut rendered = photo.clone();
    for (x, y, p) in rendered.enumerate_pixels_mut() {
        for c in 0..3 {
            let sign = if noise(x, y, 7 + c as u32) < 128 {
                3
            } else {
                -3
            };
            p.0[c] = p.0[c].saturating_add_signed(sign);
            assert!(p.0[c] < 255);
        }
    }
    let s = score(&rendered, &photo).unwrap();
    assert!((s.psnr - 20.0 * (255.0_f64 / 3.0).log10()).abs() < 1e-12);
    assert!(s.ssim < 1.0 && s.ssim > 0.8, "{}", s.ssim);
}

#[test]
fn a_picture_can_be_given_the_photos_exposure() {
    let photo = picture(40, 23);
    let mut darker = photo.clone();
    for p in darker.pixels_mut() {
        // Even values halve exactly.
        p.0 = [p.0[0] / 2, p.0[1], p.0[2] / 2, 255];
    }
    let mut even = photo.clone();
    for p in even.pixels_mut() {
        p.0 = [p.0[0] & 0xFE, p.0[1], p.0[2] & 0xFE, 255];
    }
    let s = score(&darker, &even).unwrap();
    // Red and blue are off by as much as they are.
    let off = darker.pixels().map(|p| {
        let [r, _, b, _] = p.0.map(u64::from);
        r * r + b * b
    });
    assert_eq!(s.psnr, psnr(off.sum::<u64>() as f64, 40 * 23));
    assert_eq!(s.psnr_exposed, f64::INFINITY);
    // What is not covered has no say.
    let mut half = darker.clone();
    for (x, _, p) in half.enumerate_pixels_mut() {
        if x < 20 {
            p.0 = [250, 0, 250, 0];
        }
    }
    let mut seen = even.clone();
    for (x, _, p) in seen.enumerate_pixels_mut() {
        if x < 20 {
            p.0 = [0; 4];
        }
    }
    assert_eq!(score(&half, &seen).unwrap().psnr_exposed, f64::INFINITY);
    let black = RgbaImage::from_pixel(40, 23, Rgba([0, 0, 0, 255]));
    let s = score(&black, &photo).unwrap();
    assert_eq!(s.psnr, s.psnr_exposed);
}

#[test]
fn exposures_are_fitted_inside_masks() {
    let photo = picture(40, 23);
    let all = psnr_exposed(&picture(40, 23), &photo, None).unwrap();
    assert_eq!(all, Some(f64::INFINITY));
    // Even, so that halves are exact; magenta where the mask is less than half.
    let mask = GrayImage::from_fn(40, 23, |x, _| Luma([if x < 20 { 127 } else { 128 }]));
    let (mut even, mut halved) = (photo.clone(), photo);
    for (x, y, pixel) in even.enumerate_pixels_mut() {
        let [r, g, b, _] = pixel.0.map(|v| v / 2);
        pixel.0 = [2 * r, 2 * g, 2 * b, 255];
        let hidden = [255, 0, 255, 255];
        halved.get_pixel_mut(x, y).0 = if x < 20 { hidden } else { [r, g, b, 255] };
    }
    let of = |mask: Option<&GrayImage>| psnr_exposed(&even, &halved, mask).unwrap();
    assert_eq!(of(Some(&mask)), Some(f64::INFINITY));
    let whole = score(&even, &halved).unwrap().psnr_exposed;
    assert_eq!(of(None), Some(whole));
    assert!(whole < 20.0, "{whole}");
    assert_eq!(of(Some(&GrayImage::new(40, 23))), None);
    assert!(psnr_exposed(&even, &halved, Some(&GrayImage::new(23, 40))).is_err());
}

#[test]
fn a_fitted_exposure_is_not_rounded() {
    // 39 of 49 columns of one grey, and the rest of another.
    let greys = |dark: u8, bright: u8| {
        RgbaImage::from_fn(49, 12, |x, _| {
            let v = if x < 39 { dark } else { bright };
            Rgba([v, v, v, 255])
        })
    };
    let db = |off: f64| 10.0 * (255.0 * 255.0 / (off / 49.0)).log10();
    // What is 100, and right, would be 101: worse than before.
    let s = score(&greys(100, 200), &greys(100, 202)).unwrap();
    let gain: f64 = (390_000.0 + 404_000.0) / (390_000.0 + 400_000.0);
    assert!(gain * 100.0 > 100.5);
    let (dark, bright) = (gain * 100.0 - 100.0, gain * 200.0 - 202.0);
    let expected = db(39.0 * dark * dark + 10.0 * bright * bright);
    assert!((s.psnr_exposed - expected).abs() < 1e-9, "{s:?}");
    assert!(s.psnr_exposed > s.psnr + 3.0, "{s:?}");
    // Nothing is brighter than white.
    let s = score(&greys(100, 255), &greys(200, 255)).unwrap();
    let gain: f64 = (780_000.0 + 650_250.0) / (390_000.0 + 650_250.0);
    let dark = gain * 100.0 - 200.0;
    assert!(
        (s.psnr_exposed - db(39.0 * dark * dark)).abs() < 1e-9,
        "{s:?}"
    );
}

#[test]
fn what_is_not_covered_is_black() {
    let photo = RgbaImage::from_pixel(20, 20, Rgba([100, 100, 100, 255]));
    let rendered = RgbaImage::from_fn(20, 20, |x, _| match x {
        0..5 => Rgba([0, 0, 0, 0]),
        5..10 => Rgba([200, 200, 200, 127]),
        _ => Rgba([110, 110, 110, 255]),
    });
    let s = score(&rendered, &photo).unwrap();
    // 200 · 127/255 rounds to 100: right by chance, yet less than half covered.
    let mse = (0.25 * 100.0 * 100.0) + 0.5 * 100.0;
    assert!((s.psnr - 10.0 * (255.0_f64.powi(2) / mse).log10()).abs() < 1e-12);
    assert!((s.psnr_covered.unwrap() - 20.0 * 25.5_f64.log10()).abs() < 1e-12);
    assert!((s.coverage - (0.25 * 127.0 / 255.0 + 0.5)).abs() < 1e-12);

    let nothing = RgbaImage::new(20, 20);
    let s = score(&nothing, &photo).unwrap();
    assert_eq!((s.psnr_covered, s.coverage), (None, 0.0));
    // A transparent photo is black as well, whatever its hidden colour.
    let hidden = RgbaImage::from_pixel(20, 20, Rgba([9, 8, 7, 0]));
    assert_eq!(score(&nothing, &hidden).unwrap().psnr, f64::INFINITY);
}

/// The definition, window by window and moment by moment.
fn plain_ssim(a: &RgbaImage, b: &RgbaImage) -> f64 {
    let w = window();
    let (mut sum, mut count) = (0.0, 0.0);
    for c in 0..3 {
        for top in 0..=a.height() - 11 {
            for left in 0..=a.width() - 11 {
                let mean = |value: &dyn Fn(f64, f64) -> f64| {
                    let mut mean = 0.0;
                    for j in 0..11 {
                        for i in 0..11 {
                            let at = |image: &RgbaImage| {
                                let pixel = image.get_pixel(left + i, top + j);
                                f64::from(pixel.0[c])
                            };
                            mean += w[i as usize] * w[j as usize] * value(at(a), at(b));
                        }
                    }
                    mean
                };
                let (mx, my) = (mean(&|x, _| x), mean(&|_, y| y));
                let vx = mean(&|x, _| (x - mx) * (x - mx));
                let vy = mean(&|_, y| (y - my) * (y - my));
                let cov = mean(&|x, y| (x - mx) * (y - my));
                sum += (2.0 * mx * my + C1) * (2.0 * cov + C2)
                    / ((mx * mx + my * my + C1) * (vx + vy + C2));
                count += 1.0;
            }
        }
    }
    sum / count
}

#[test]
fn ssim_equals_its_slow_twin() {
    let photo = picture(27, 19);
    let rendered = RgbaImage::from_fn(27, 19, |x, y| {
        let [r, g, b, _] = photo.get_pixel(26 - x, y).0;
        Rgba([noise(x, y, 5), g / 2, b.max(r), 255])
    });
    let fast = score(&rendered, &photo).unwrap().ssim;
    let slow = plain_ssim(&rendered, &photo);
    assert!((fast - slow).abs() < 1e-10, "{fast} {slow}");
    let once_more = score(&photo, &rendered).unwrap().ssim;
    assert!((fast - once_more).abs() < 1e-12, "symmetric");
}

#[test]
fn ssim_of_one_window_has_one_place() {
    let photo = picture(11, 11);
    let mut rendered = photo.clone();
    rendered.get_pixel_mut(5, 5).0[0] ^= 64;
    let fast = score(&rendered, &photo).unwrap().ssim;
    assert!((fast - plain_ssim(&rendered, &photo)).abs() < 1e-10);
}

#[test]
fn pictures_that_cannot_be_compared_are_named() {
    let error = score(&RgbaImage::new(20, 30), &RgbaImage::new(30, 20)).unwrap_err();
    assert_eq!(
        error.to_string(),
        "the rendered picture has 20 × 30 pixels and the photo 30 × 20; \
         render at the photo's size"
    );
    let error = score(&RgbaImage::new(20, 10), &RgbaImage::new(20, 10)).unwrap_err();
    assert_eq!(
        error.to_string(),
        "the pictures have 20 × 10 pixels; SSIM needs at least 11 × 11"
    );
}

#[test]
fn inside_a_mask_only_what_lies_there_counts() {
    let photo = RgbaImage::from_pixel(40, 20, Rgba([100, 100, 100, 255]));
    let rendered = RgbaImage::from_fn(40, 20, |x, _| match x {
        0..20 => Rgba([110, 110, 110, 255]),
        20..30 => Rgba([0; 4]),
        _ => Rgba([255; 4]),
    });
    let mask_of = |inside: fn(u32) -> bool| {
        GrayImage::from_fn(40, 20, |x, _| Luma([if inside(x) { 200 } else { 100 }]))
    };
    let whole = score(&rendered, &photo).unwrap();
    let all = score_masked(&rendered, &photo, &mask_of(|_| true))
        .unwrap()
        .unwrap();
    assert_eq!(all.psnr_masked, whole.psnr);
    assert_eq!(all.ssim_masked, Some(whole.ssim));
    assert_eq!(all.coverage_masked, whole.coverage);

    let left = score_masked(&rendered, &photo, &mask_of(|x| x < 10))
        .unwrap()
        .unwrap();
    assert!((left.psnr_masked - 20.0 * 25.5_f64.log10()).abs() < 1e-12);
    let ssim = (2.0 * 100.0 * 110.0 + C1) / (100.0 * 100.0 + 110.0 * 110.0 + C1);
    assert!((left.ssim_masked.unwrap() - ssim).abs() < 1e-9);
    assert_eq!(left.coverage_masked, 1.0);
    let margin = score_masked(&rendered, &photo, &mask_of(|x| x < 5))
        .unwrap()
        .unwrap();
    assert_eq!(margin.ssim_masked, None);

    assert_eq!(
        score_masked(&rendered, &photo, &mask_of(|_| false)),
        Ok(None)
    );
    let error = score_masked(&rendered, &photo, &GrayImage::new(40, 21)).unwrap_err();
    assert_eq!(
        error.to_string(),
        "the mask has 40 × 21 pixels and the photo 40 × 20; make them as large as each other"
    );
    assert_eq!(mean_masked(&[]), None);
    let mean = mean_masked(&[left, margin]).unwrap();
    assert_eq!(mean.ssim_masked, left.ssim_masked);
    assert!((mean.psnr_masked - left.psnr_masked).abs() < 1e-12);
}

#[test]
fn means_are_of_decibels() {
    let one = |psnr, psnr_covered| Score {
        psnr,
        psnr_exposed: psnr,
        ssim: 0.5,
        psnr_covered,
        coverage: 0.25,
    };
    assert_eq!(mean(&[]), None);
    let scores = [one(20.0, Some(30.0)), one(30.0, None)];
    assert_eq!(mean(&scores), Some(one(25.0, Some(30.0))));
    let with_perfect = [one(1.0, None), one(f64::INFINITY, None)];
    assert_eq!(mean(&with_perfect).unwrap().psnr, 50.0);
}
