//! Reducing photos: their sizes, and that what they show stays as it was.

use capture::{reduced_size, resize};
use image::{Rgba, RgbaImage};

#[test]
fn reduced_sizes_keep_the_shape() {
    assert_eq!(reduced_size((4000, 3000), 1000), (1000, 750));
    assert_eq!(reduced_size((751, 1000), 100), (75, 100));
    assert_eq!(reduced_size((640, 480), 640), (640, 480));
    assert_eq!(reduced_size((640, 480), 5000), (640, 480), "never enlarged");
    assert_eq!(reduced_size((5000, 2), 100), (100, 1), "never nothing");
    assert_eq!(reduced_size((640, 480), 0), (1, 1));
}

#[test]
fn whole_factors_average_exactly() {
    let image = RgbaImage::from_fn(6, 4, |x, y| Rgba([(40 * x) as u8, (60 * y) as u8, 8, 255]));
    let half = resize(&image, 3, 2);
    for (x, y, pixel) in half.enumerate_pixels() {
        let expected = [(80 * x + 20) as u8, (120 * y + 30) as u8, 8, 255];
        assert_eq!(pixel.0, expected, "at {x}, {y}");
    }
}

/// A detail stays where it is, to a tenth of a source pixel, at any ratio.
#[test]
fn reduction_moves_nothing() {
    let image = RgbaImage::from_fn(240, 3, |x, _| Rgba([x as u8, 0, 0, 255]));
    for width in [239, 200, 171, 150, 120, 97, 60, 31, 7] {
        let ratio = 240.0 / f64::from(width);
        let small = resize(&image, width, 3);
        // Near the borders the filter has less to go by.
        let margin = if width > 20 { 3 } else { 1 };
        for x in margin..width - margin {
            let expected = (f64::from(x) + 0.5) * ratio - 0.5;
            let found = f64::from(small.get_pixel(x, 1)[0]);
            // Half a level is rounding.
            assert!(
                (found - expected).abs() <= 0.5 + 0.1 * ratio.max(1.0),
                "240 → {width} at {x}: {found} instead of {expected}"
            );
        }
    }
}

#[test]
fn the_transparent_does_not_bleed_in() {
    // Red where opaque, green where transparent.
    let image = RgbaImage::from_fn(4, 2, |x, _| match x {
        0 | 2 => Rgba([200, 0, 0, 255]),
        _ => Rgba([0, 255, 0, 0]),
    });
    for pixel in resize(&image, 2, 1).pixels() {
        assert_eq!(pixel.0[1], 0);
        assert!(pixel.0[0].abs_diff(200) <= 1, "{pixel:?}");
        assert!(pixel.0[3].abs_diff(128) <= 1, "{pixel:?}");
    }
}

#[test]
fn a_flat_picture_stays_flat_at_any_size() {
    let image = RgbaImage::from_pixel(37, 23, Rgba([12, 200, 255, 255]));
    for (width, height) in [(1, 1), (36, 22), (10, 23), (80, 50), (37, 5)] {
        let other = resize(&image, width, height);
        assert_eq!(other.dimensions(), (width, height));
        assert!(other.pixels().all(|pixel| pixel.0 == [12, 200, 255, 255]));
    }
}
