//! A reference image as a picture on the portal's plane.

use super::{Beyond, Pinhole, Reference, Target, Warp, Window};
use crate::cpu::lanes::vectorised;
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
        vectorised(
            #[inline(always)]
            || {
                let mut count = 0;
                for x in window.row(y as u32) {
                    let inverse_depth = plane.inverse_depth(desired.ray(x, y as u32));
                    if !(inverse_depth > 0.0 && inverse_depth < f64::INFINITY) {
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
            },
        )
    };
    rows.enumerate().map(row).sum()
}

/// Bilinear among the pixels that show anything.
#[inline(always)]
fn sample(seen: &Target, at: DVec2) -> Option<[u8; 4]> {
    let corner = (at - 0.5).floor();
    let share = (at - 0.5 - corner).as_vec2();
    let (width, height) = (f64::from(seen.width), f64::from(seen.height));
    // As far as a pixel off, whose neighbours may be inside.
    let is_near = |at: f64, count: f64| at >= -1.0 && at < count;
    if !(is_near(corner.x, width) && is_near(corner.y, height)) {
        return None;
    }
    let (left, top) = (corner.x as i32, corner.y as i32);
    // Red, green, blue, weight.
    let mut sum = [0.0_f32; 4];
    for (dx, dy, weight) in [
        (0, 0, (1.0 - share.x) * (1.0 - share.y)),
        (1, 0, share.x * (1.0 - share.y)),
        (0, 1, (1.0 - share.x) * share.y),
        (1, 1, share.x * share.y),
    ] {
        let (x, y) = (left + dx, top + dy);
        // Compared without a sign, what is below 0 is beyond, too.
        if x as u32 >= seen.width || y as u32 >= seen.height {
            continue;
        }
        let color = seen.color[y as usize * seen.width as usize + x as usize];
        let weight = if color[3] == 0 { 0.0 } else { weight };
        for k in 0..3 {
            sum[k] += weight * f32::from(color[k]);
        }
        sum[3] += weight;
    }
    // The outline's last pixels have no neighbours beyond.
    let [r, g, b, weight] = sum;
    (weight > 1e-3).then(|| {
        // Rounded without a call: they are not negative.
        let code = |sum: f32| (sum / weight + 0.5) as u8;
        [code(r), code(g), code(b), 255]
    })
}
