//! Single pixels of the exact field, before they are rounded to bytes: what `crate::rounding`
//! compares with its bounds.

use super::lanes::{LANES, Lane};
use super::source::Tile;
use super::{Engine, Seen, shade};
use crate::frame::Frame;
use crate::held::Held;
use crate::photos::PhotoError;
use crate::rays::RayMap;
use glam::Vec4;

/// The colours of pixels: premultiplied, 0…255, coverage last; zero where nothing is seen. By the
/// engine's own steps, with every source view asked.
///
/// # Errors
/// A photo that is needed cannot be decoded.
pub(crate) fn colors(
    frame: &Frame<'_>,
    pixels: &[(u32, u32)],
    photos: &Held<'_>,
) -> Result<Vec<Vec4>, PhotoError> {
    let rays = RayMap::of(&frame.desired);
    let engine = Engine::new(frame, &rays);
    let views: Vec<(f32, u32)> = frame.taking_part().map(|i| (0.0, i as u32)).collect();
    let mut all = Vec::new();
    let mut seen = Seen::default();
    for pixels in pixels.chunks(LANES) {
        let mut tile = Tile::nothing();
        for (k, &(x, y)) in pixels.iter().enumerate() {
            let (x, y) = (x as usize, y as usize);
            if let (Some(ray), Some(plane)) = (rays.ray(x, y), frame.surface.plane_of(x, y)) {
                tile.set(k, ray, plane);
            }
        }
        engine.score(&views, f32::INFINITY, &tile, &mut seen);
        seen.weigh(&frame.options);
        let mut color = [Vec4::ZERO; LANES];
        let mut sum: Lane = [0.0; LANES];
        for (i, sight, term) in seen.iter() {
            let (photo, exposure) = (photos.get(i)?, engine.source(i).exposure);
            shade::add(photo, exposure, sight, &term.weight, &mut color, &mut sum);
        }
        let mean = |k: usize| match sum[k] > 0.0 {
            true => color[k] / sum[k],
            false => Vec4::ZERO,
        };
        all.extend((0..pixels.len()).map(mean));
    }
    Ok(all)
}
