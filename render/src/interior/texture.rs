//! A reference image as a picture on the portal's plane.

use super::{Beyond, Pinhole, Reference, Target, Warp, Window};
use glam::DVec2;
use rayon::prelude::*;

/// Draws a reference image as if it were painted on the portal's plane, over what is there, in
/// the pixels of a window (Aliaga and Lastra 1997, "Architectural walkthroughs using portal
/// textures"). It is right where the desired camera is the reference's. How many pixels were
/// drawn.
pub fn texture(
    reference: &Reference,
    plane: &Beyond,
    desired: &Pinhole,
    window: &Window,
    into: &mut Target,
) -> usize {
    // The warp the other way, every pixel at the plane's depth.
    let warp = Warp::new(desired, &reference.camera);
    let width = into.width as usize;
    if width == 0 || (into.width, into.height) != (desired.width, desired.height) {
        return 0;
    }
    let colors = into.color.par_chunks_mut(width);
    let rows = colors.zip(into.inverse_depth.par_chunks_mut(width));
    let row = |(y, (colors, depths)): (usize, (&mut [[u8; 4]], &mut [f32]))| {
        let mut count = 0;
        for x in window.row(y as u32) {
            let inverse_depth = plane.inverse_depth(desired.ray(x, y as u32));
            if !(inverse_depth > 0.0 && inverse_depth.is_finite()) {
                continue;
            }
            let center = DVec2::new(f64::from(x) + 0.5, y as f64 + 0.5);
            let Some(at) = warp.at(center, inverse_depth) else {
                continue;
            };
            if let Some(color) = sample(&reference.seen, at.pixel) {
                colors[x as usize] = color;
                depths[x as usize] = inverse_depth as f32;
                count += 1;
            }
        }
        count
    };
    rows.enumerate().map(row).sum()
}

/// Bilinear among the pixels that show anything.
fn sample(seen: &Target, at: DVec2) -> Option<[u8; 4]> {
    let corner = (at - 0.5).floor();
    let share = at - 0.5 - corner;
    let mut sum = [0.0; 3];
    let mut weight = 0.0;
    for (dx, dy) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
        let (x, y) = (corner.x + dx, corner.y + dy);
        let is_inside =
            x >= 0.0 && y >= 0.0 && x < f64::from(seen.width) && y < f64::from(seen.height);
        if !is_inside {
            continue;
        }
        let color = seen.color[y as usize * seen.width as usize + x as usize];
        if color[3] == 0 {
            continue;
        }
        let along = |share: f64, step: f64| if step > 0.0 { share } else { 1.0 - share };
        let w = along(share.x, dx) * along(share.y, dy);
        weight += w;
        for k in 0..3 {
            sum[k] += w * f64::from(color[k]);
        }
    }
    // The outline's last pixels have no neighbours beyond.
    (weight > 1e-3).then(|| {
        let [r, g, b] = sum.map(|v| (v / weight).round() as u8);
        [r, g, b, 255]
    })
}
