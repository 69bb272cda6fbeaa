//! The blending field as colours: which photo paints which pixel.

use crate::blend::Contributor;
use crate::rows::{Contributions, FieldRows};
use image::{Rgba, RgbaImage};
use rayon::prelude::*;

/// One colour per source view, as sRGB.
///
/// The colour of an index does not depend on `count`. Hue and lightness step by the powers
/// of the plastic number, the two-dimensional golden section: any run of indices from zero
/// fills the square of both evenly. They are those of OKLCH (Ottosson 2020, "A perceptual
/// color space for image processing"), where equal steps look equal.
pub fn palette(count: usize) -> Vec<[u8; 3]> {
    // The root of x³ = x + 1.
    const PLASTIC: f64 = 1.324_717_957_244_746;
    const DARKEST: f64 = 0.40;
    const LIGHTEST: f64 = 0.92;
    const CHROMA: f64 = 0.2;
    let color = |i: usize| {
        let turns = (i as f64 / PLASTIC).fract();
        let level = (0.5 + i as f64 / (PLASTIC * PLASTIC)).fract();
        let lightness = DARKEST + (LIGHTEST - DARKEST) * level;
        // What lies outside sRGB loses chroma until it fits.
        let mut chroma = CHROMA;
        loop {
            let rgb = linear_srgb_from_oklch(lightness, chroma, std::f64::consts::TAU * turns);
            if chroma < 1e-3 || rgb.iter().all(|v| (0.0..=1.0).contains(v)) {
                return rgb.map(srgb_byte);
            }
            chroma *= 0.97;
        }
    };
    (0..count).map(color).collect()
}

/// Ottosson's matrices, as published.
fn linear_srgb_from_oklch(lightness: f64, chroma: f64, hue: f64) -> [f64; 3] {
    let (a, b) = (chroma * hue.cos(), chroma * hue.sin());
    let l = (lightness + 0.396_337_777_4 * a + 0.215_803_757_3 * b).powi(3);
    let m = (lightness - 0.105_561_345_8 * a - 0.063_854_172_8 * b).powi(3);
    let s = (lightness - 0.089_484_177_5 * a - 1.291_485_548_0 * b).powi(3);
    [
        4.076_741_662_1 * l - 3.307_711_591_3 * m + 0.230_969_929_2 * s,
        -1.268_438_004_6 * l + 2.609_757_401_1 * m - 0.341_319_396_5 * s,
        -0.004_196_086_3 * l - 0.703_418_614_7 * m + 1.707_614_701_0 * s,
    ]
}

fn srgb_byte(linear: f64) -> u8 {
    let v = linear.clamp(0.0, 1.0);
    let encoded = if v <= 0.003_130_8 {
        12.92 * v
    } else {
        1.055 * v.powf(1.0 / 2.4) - 0.055
    };
    (encoded * 255.0).round() as u8
}

/// The picture of a field: each pixel the mix of its contributors' colours (by source
/// view) in the shares of their weights, opaque; transparent where nothing contributes.
///
/// # Panics
/// If a contributor has no colour.
pub fn field_picture(field: &FieldRows<'_>, colors: &[[u8; 3]]) -> RgbaImage {
    field_picture_and(field, colors, |_| ()).0
}

/// The same, and what is made of each row of the field, from the top. No more rows are held at once than there are
/// threads.
///
/// # Panics
/// As for [`field_picture`].
pub fn field_picture_and<T: Send>(
    field: &FieldRows<'_>,
    colors: &[[u8; 3]],
    of_row: impl Fn(&Contributions) -> T + Sync,
) -> (RgbaImage, Vec<T>) {
    let [width, height] = field.size();
    let mut picture = RgbaImage::new(width, height);
    let rows = picture.par_chunks_exact_mut(4 * width as usize);
    let paint = |(y, pixels): (usize, &mut [u8])| {
        let lists = field.row(y as u32);
        for (pixel, list) in pixels.chunks_exact_mut(4).zip(lists.iter()) {
            pixel.copy_from_slice(&mix(list, colors).0);
        }
        of_row(&lists)
    };
    let made: Vec<T> = rows.enumerate().map(paint).collect();
    (picture, made)
}

fn mix(contributors: &[Contributor], colors: &[[u8; 3]]) -> Rgba<u8> {
    let sum: f64 = contributors.iter().map(|c| c.weight).sum();
    if !(sum > 0.0) {
        return Rgba([0; 4]);
    }
    let channel = |c: usize| {
        let weighted = |k: &Contributor| k.weight * f64::from(colors[k.source_idx][c]);
        let value: f64 = contributors.iter().map(weighted).sum();
        (value / sum).round() as u8
    };
    Rgba([channel(0), channel(1), channel(2), 255])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FieldOptions, Frame, Lumigraph, PhotoStore, SourceView, TriangulatedField};
    use calibrate::{Lens, Rigid3, View};
    use glam::{DVec2, DVec3};
    use proxy::{Plane, Proxy};

    fn view(center: DVec3, width: u32, height: u32) -> View {
        let size = DVec2::new(f64::from(width), f64::from(height));
        View {
            lens: Lens::pinhole(DVec2::splat(size.x), 0.5 * size),
            width,
            height,
            camera_from_world: Rigid3::looking_at(center, center + DVec3::Z, DVec3::NEG_Y),
        }
    }

    /// Two views side by side in front of a wall.
    fn lumigraph() -> Lumigraph {
        let source = |x: f64| SourceView {
            name: format!("{x}"),
            view: view(DVec3::new(x, 0.0, 0.0), 40, 30),
            gain: [1.0; 3],
            time_s: None,
            quarters: 0,
        };
        let wall = Plane::new(DVec3::new(0.0, 0.0, 4.0), DVec3::Z).unwrap();
        Lumigraph {
            points: Vec::new(),
            sources: vec![source(-1.0), source(1.0)],
            photos: PhotoStore::from_images(vec![RgbaImage::new(40, 30); 2]),
            proxy: Proxy::Plane(wall),
            visibility: None,
        }
    }

    #[test]
    fn pixels_mix_the_colors_of_who_paints_them() {
        let share = |source_idx, weight| Contributor { source_idx, weight };
        let mixed = |list: &[Contributor]| mix(list, &[[200, 0, 40], [100, 80, 0]]).0;
        assert_eq!(mixed(&[share(1, 1.0)]), [100, 80, 0, 255]);
        assert_eq!(mixed(&[share(0, 0.25), share(1, 0.75)]), [125, 60, 10, 255]);
        assert_eq!(mixed(&[]), [0, 0, 0, 0]);
    }

    #[test]
    fn a_view_at_a_source_camera_has_its_color() {
        let lumigraph = lumigraph();
        let colors = palette(2);
        let desired = lumigraph.sources[1].view.clone();
        let frame = Frame::new(&lumigraph, desired, FieldOptions::default());
        let picture = field_picture(&FieldRows::new(&frame, None), &colors);
        let [r, g, b] = colors[1];
        assert!(picture.pixels().all(|p| p.0 == [r, g, b, 255]));
    }

    #[test]
    fn exact_and_triangulated_pictures_look_alike_and_leave_the_rest_clear() {
        let lumigraph = lumigraph();
        let colors = palette(2);
        let desired = view(DVec3::new(0.3, 0.1, -3.0), 64, 48);
        let frame = Frame::new(&lumigraph, desired, FieldOptions::default());
        let exact = FieldRows::new(&frame, None);
        let lists = exact.all();
        assert_eq!(lists.iter().count(), 64 * 48);
        for list in lists.iter().filter(|l| !l.is_empty()) {
            let sum: f64 = list.iter().map(|c| c.weight).sum();
            assert!((sum - 1.0).abs() < 1e-12);
        }
        let field = TriangulatedField::new(&frame, 16).unwrap();
        let a = field_picture(&exact, &colors);
        let b = field_picture(&FieldRows::new(&frame, Some(&field)), &colors);
        assert!(
            a.pixels().any(|p| p.0[3] == 0),
            "the wall outside both photos"
        );
        let close = |(p, q): (&Rgba<u8>, &Rgba<u8>)| (0..4).all(|c| p.0[c].abs_diff(q.0[c]) <= 8);
        let alike = a.pixels().zip(b.pixels()).filter(|&pq| close(pq)).count();
        assert!(alike * 100 >= 97 * 64 * 48, "{alike}");
    }

    #[test]
    fn colors_are_stable_and_distinct() {
        let many = palette(256);
        assert_eq!(palette(10), many[..10]);
        assert!(palette(0).is_empty());
        let distance = |a: [u8; 3], b: [u8; 3]| {
            let square = |c: usize| i32::from(a[c].abs_diff(b[c])).pow(2);
            f64::from(square(0) + square(1) + square(2)).sqrt()
        };
        let closest = |colors: &[[u8; 3]]| {
            let mut closest = f64::INFINITY;
            for (i, &a) in colors.iter().enumerate() {
                for &b in &colors[..i] {
                    closest = closest.min(distance(a, b));
                }
            }
            closest
        };
        assert!(closest(&many[..8]) > 50.0, "{}", closest(&many[..8]));
        assert!(closest(&many[..24]) > 20.0, "{}", closest(&many[..24]));
        assert!(closest(&many) > 5.0, "{}", closest(&many));
    }
}
