//! Sampling photos: the f32 twin of [`crate::reference::sample`].

use crate::photos::Pyramid;
use glam::Vec4;

/// Trilinear; premultiplied, 0…255.
#[inline]
pub(crate) fn sample(photo: &Pyramid, u: f32, v: f32, level: f32) -> Vec4 {
    if level <= 0.0 {
        return bilinear(photo, u, v, 0);
    }
    let level = level.min((photo.levels.len() - 1) as f32);
    let lower = level as usize;
    let fraction = level - lower as f32;
    let color = bilinear(photo, u, v, lower);
    if fraction > 0.0 {
        color + (bilinear(photo, u, v, lower + 1) - color) * fraction
    } else {
        color
    }
}

#[inline]
fn bilinear(photo: &Pyramid, u: f32, v: f32, level: usize) -> Vec4 {
    let image = &photo.levels[level];
    let texels: &[[u8; 4]] = bytemuck::cast_slice(image.as_raw());
    let (last_x, last_y) = (image.width() as i32 - 1, image.height() as i32 - 1);
    let scale = 1.0 / (1_u32 << level) as f32;
    // The pixel lies inside the photo, so a shift by one keeps truncation a floor.
    let (x, y) = (u * scale + 0.5, v * scale + 0.5);
    let (right, bottom) = (x as i32, y as i32);
    let (fx, fy) = (x - right as f32, y - bottom as f32);
    let x0 = (right - 1).clamp(0, last_x) as usize;
    let x1 = right.clamp(0, last_x) as usize;
    let pitch = image.width() as usize;
    let row0 = (bottom - 1).clamp(0, last_y) as usize * pitch;
    let row1 = bottom.clamp(0, last_y) as usize * pitch;
    let texel = |i: usize| {
        let [r, g, b, a] = texels[i];
        Vec4::new(f32::from(r), f32::from(g), f32::from(b), f32::from(a))
    };
    let top = texel(row0 + x0) + (texel(row0 + x1) - texel(row0 + x0)) * fx;
    let low = texel(row1 + x0) + (texel(row1 + x1) - texel(row1 + x0)) * fx;
    top + (low - top) * fy
}
