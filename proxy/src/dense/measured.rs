//! What sensors measured, as reduced photos have it.

use super::small::SmallPhoto;
use calibrate::View;

/// The inverse depths of a reduced photo's pixels, row by row, out of those of all pixels of its view; zero where
/// unknown. Those of the nearest pixels: between the depths of two surfaces there is none.
pub(super) fn reduced(photo: &SmallPhoto, view: &View, inverse_depths: &[f32]) -> Vec<f32> {
    let (width, height) = (view.width as usize, view.height as usize);
    assert_eq!(
        inverse_depths.len(),
        width * height,
        "depth maps have a depth for each pixel"
    );
    let of_pixel = |i: usize| {
        let ray = photo.ray(i % photo.width, i / photo.width);
        let pixel = view.lens.project(ray).filter(|p| view.contains(*p));
        // It may lie on the last pixel's far border.
        pixel.filter(|_| photo.used[i]).map_or(0.0, |p| {
            let (column, row) = (
                (p.x as usize).min(width - 1),
                (p.y as usize).min(height - 1),
            );
            inverse_depths[row * width + column]
        })
    };
    (0..photo.width * photo.height).map(of_pixel).collect()
}
