//! From a layer's values to what the window shows.

use crate::camera::angle_between;
use crate::content::Stop;
use crate::picture::{Layer, Look};
use calibrate::{Pixel, View};
use egui::{Color32, ColorImage};
use glam::DVec3;
use image::RgbaImage;
use rayon::prelude::*;
use render::{Pyramid, reference};

/// What is behind what no photo covers, unless something else is chosen.
pub(crate) const BEHIND: [u8; 3] = [28, 28, 32];
/// What marks it where one asks for it.
const UNCOVERED: [u8; 3] = [214, 40, 160];

/// The two greys of the squares that stand for transparency, and the squares' side in pixels.
const SQUARES: [[u8; 3]; 2] = [[96; 3], [128; 3]];
const SQUARE: usize = 8;

/// A picture with straight alpha over the look's background.
pub(crate) fn over_background(picture: &RgbaImage, look: &Look) -> ColorImage {
    let (width, height) = picture.dimensions();
    let behind = |i: usize| match (look.layer, look.background) {
        (Layer::Coverage, _) => UNCOVERED,
        (_, Some(color)) => color,
        (_, None) => {
            let (x, y) = (i % width as usize, i / width as usize);
            SQUARES[(x / SQUARE + y / SQUARE) % 2]
        }
    };
    let exposure_stops = look.exposure_stops;
    let factor = 2f64.powf(exposure_stops);
    let lighter: Vec<u8> = (0..=255)
        .map(|v| (f64::from(v) * factor).round().clamp(0.0, 255.0) as u8)
        .collect();
    let mix = |(i, rgba): (usize, &[u8])| {
        let behind = behind(i);
        let alpha = u32::from(rgba[3]);
        let channel = |c: usize| {
            let own = u32::from(lighter[usize::from(rgba[c])]);
            ((own * alpha + u32::from(behind[c]) * (255 - alpha) + 127) / 255) as u8
        };
        Color32::from_rgb(channel(0), channel(1), channel(2))
    };
    let pixels = picture
        .as_raw()
        .par_chunks_exact(4)
        .enumerate()
        .with_min_len(4096)
        .map(mix);
    ColorImage::new([width as usize, height as usize], pixels.collect())
}

/// Inverse depths as a picture: light is near, by the nearest and farthest twentieth. Transparent
/// where nothing is.
pub(crate) fn depth_picture(width: u32, height: u32, inverse_depths: &[f64]) -> RgbaImage {
    let mut sorted: Vec<f64> = inverse_depths
        .iter()
        .copied()
        .filter(|s| *s > 0.0)
        .collect();
    sorted.sort_by(f64::total_cmp);
    let at = |share: f64| {
        let i = (share * sorted.len() as f64) as usize;
        sorted
            .get(i.min(sorted.len().saturating_sub(1)))
            .copied()
            .unwrap_or(0.0)
    };
    let (far, near) = (at(0.05), at(0.95));
    let span = (near - far).max(f64::MIN_POSITIVE);
    let shade = |s: &f64| match *s > 0.0 {
        true => {
            let share = ((s - far) / span).clamp(0.0, 1.0);
            let level = (40.0 + 215.0 * share) as u8;
            [level, level, (60.0 + 160.0 * share) as u8, 255]
        }
        false => [0; 4],
    };
    let bytes: Vec<u8> = inverse_depths.iter().flat_map(shade).collect();
    RgbaImage::from_raw(width, height, bytes).expect("four bytes a pixel")
}

/// Surfaces lit from the viewer: `facing` is the cosine of the angle between a pixel's ray and
/// the surface's normal, where there is one.
pub(crate) fn shaded_picture(width: u32, height: u32, facing: &[Option<f64>]) -> RgbaImage {
    let shade = |cosine: &Option<f64>| match cosine {
        Some(cosine) => {
            let level = 0.15 + 0.85 * cosine.abs().min(1.0);
            [
                (205.0 * level) as u8,
                (215.0 * level) as u8,
                (225.0 * level) as u8,
                255,
            ]
        }
        None => [0; 4],
    };
    let bytes: Vec<u8> = facing.iter().flat_map(shade).collect();
    RgbaImage::from_raw(width, height, bytes).expect("four bytes a pixel")
}

/// A photo as `view` would show it were all that it shows far away: the photo itself where the
/// view is the photo's own camera. It is as light as the look's pictures, and where it ends, over their background.
pub(crate) fn photo_picture(
    photo: &Pyramid,
    source: &View,
    view: &View,
    look: &Look,
) -> ColorImage {
    let turn = source.camera_from_world.rotation * view.camera_from_world.rotation.conjugate();
    let level = (source.lens.mean_focal() / view.lens.mean_focal())
        .log2()
        .max(0.0);
    let (width, height) = (view.width as usize, view.height as usize);
    let at = |i: usize| {
        let pixel = Pixel::center_of((i % width) as u32, (i / width) as u32);
        let seen = view.lens.unproject(pixel).and_then(|ray| {
            let seen = source.lens.project(turn * ray)?;
            source.contains(seen).then_some(seen)
        });
        let color = seen.map_or([0.0; 4], |seen| reference::sample(photo, seen, level));
        // Straight alpha, as pictures have it.
        let alpha = color[3];
        let over = if alpha > 0.0 { alpha } else { 1.0 };
        let byte = |v: f64| (255.0 * v).round().clamp(0.0, 255.0) as u8;
        let [r, g, b] = [color[0], color[1], color[2]].map(|v| byte(v / over));
        [r, g, b, byte(alpha)]
    };
    let pixels: Vec<[u8; 4]> = (0..width * height)
        .into_par_iter()
        .with_min_len(1024)
        .map(at)
        .collect();
    let picture = RgbaImage::from_raw(view.width, view.height, pixels.into_flattened());
    let picture = picture.expect("four bytes a pixel");
    // What this photo does not cover others may.
    let look = Look {
        layer: Layer::Picture,
        ..look.clone()
    };
    over_background(&picture, &look)
}

/// Which stop is the nearest to a view: in place, where `depth` counts as much as a radian, and
/// in direction. `None` of none.
pub(crate) fn nearest_stop(stops: &[Stop], view: &View, depth: f64) -> Option<usize> {
    let (center, forward) = (view.center(), view.forward());
    let off = |other: &View| {
        let aside: DVec3 = other.center() - center;
        let angle = angle_between(other.forward(), forward);
        aside.length() / depth + angle
    };
    let offs = stops.iter().map(|stop| off(&stop.view)).enumerate();
    let finite = offs.filter(|(_, off)| off.is_finite());
    finite.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(i, _)| i)
}

#[cfg(test)]
mod tests {
    use super::*;
    use calibrate::{Lens, Rigid3};
    use glam::DVec2;
    use image::Rgba;

    fn view(focal: f64) -> View {
        View {
            lens: Lens::pinhole(DVec2::splat(focal), DVec2::new(16.0, 12.0)),
            width: 32,
            height: 24,
            camera_from_world: Rigid3::looking_at(DVec3::ONE, DVec3::new(1.0, 1.0, 9.0), DVec3::Y),
        }
    }

    #[test]
    fn a_photo_at_its_own_camera_is_the_photo() {
        let photo = RgbaImage::from_fn(32, 24, |x, y| Rgba([x as u8 * 7, y as u8 * 9, 100, 255]));
        let look = Look::default();
        let pyramid = Pyramid::new(photo.clone());
        let shown = photo_picture(&pyramid, &view(30.0), &view(30.0), &look);
        let pixels = shown.pixels.iter().zip(photo.pixels());
        for (shown, photo) in pixels {
            let (shown, photo) = (shown.to_array(), photo.0);
            assert!(
                (0..4).all(|c| shown[c].abs_diff(photo[c]) <= 1),
                "{shown:?} {photo:?}"
            );
        }
        // Twice as wide a view shows it in its middle.
        let wide = photo_picture(&pyramid, &view(30.0), &view(15.0), &look);
        let [r, g, b] = BEHIND;
        assert_eq!(wide.pixels[0], Color32::from_rgb(r, g, b));
        assert_eq!(wide.pixels[12 * 32 + 16].b(), 100);
    }

    #[test]
    fn both_sides_of_a_wipe_are_as_light_and_over_the_same_background() {
        let alphas = [255, 128, 0];
        let photo = RgbaImage::from_fn(32, 24, |x, y| {
            Rgba([x as u8 * 7, y as u8 * 9, 100, alphas[x as usize / 11]])
        });
        let pyramid = Pyramid::new(photo.clone());
        let mut look = Look {
            exposure_stops: 1.0,
            background: Some([1, 2, 3]),
            ..Look::default()
        };
        let picture = over_background(&photo, &look);
        let shown = photo_picture(&pyramid, &view(30.0), &view(30.0), &look);
        for (shown, picture) in shown.pixels.iter().zip(&picture.pixels) {
            let (shown, picture) = (shown.to_array(), picture.to_array());
            let is_close = (0..4).all(|c| shown[c].abs_diff(picture[c]) <= 2);
            assert!(is_close, "{shown:?} {picture:?}");
        }
        // Beyond its border others may cover what it does not.
        look.layer = Layer::Coverage;
        let wide = photo_picture(&pyramid, &view(30.0), &view(15.0), &look);
        assert_eq!(wide.pixels[0], Color32::from_rgb(1, 2, 3));
    }

    #[test]
    fn what_is_behind_shows_through() {
        let picture = RgbaImage::from_raw(2, 1, vec![200, 0, 0, 0, 100, 50, 0, 255]).unwrap();
        let mut look = Look {
            exposure_stops: 1.0,
            ..Look::default()
        };
        let shown = over_background(&picture, &look);
        let [r, g, b] = BEHIND;
        let expected = [Color32::from_rgb(r, g, b), Color32::from_rgb(200, 100, 0)];
        assert_eq!(shown.pixels, expected);
        look.background = Some([1, 2, 3]);
        let shown = over_background(&picture, &look);
        assert_eq!(shown.pixels[0], Color32::from_rgb(1, 2, 3));
        look.background = None;
        let clear = RgbaImage::new(20, 10);
        let squares = over_background(&clear, &look).pixels;
        let grey = |x: usize, y: usize| squares[20 * y + x].r();
        assert_eq!([grey(0, 0), grey(8, 0), grey(8, 8)], [96, 128, 96]);
        look.layer = Layer::Coverage;
        let marked = over_background(&picture, &look);
        assert_eq!(marked.pixels[0], Color32::from_rgb(214, 40, 160));
    }

    #[test]
    fn near_is_light_and_nothing_is_clear() {
        let picture = depth_picture(3, 1, &[0.5, 0.1, 0.0]);
        let level = |x: u32| picture.get_pixel(x, 0).0[0];
        assert!(level(0) > level(1));
        assert_eq!(picture.get_pixel(2, 0).0[3], 0);
        assert_eq!(depth_picture(1, 1, &[0.0]).get_pixel(0, 0).0[3], 0);
    }
}
