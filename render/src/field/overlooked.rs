//! Source views that only pixels between the points that were asked know of.
//!
//! What a triangle lists is found by its corners and some points between them. Where a surface jumps, a pixel
//! between those may see something else altogether, and the only views that have it may have nothing of what they
//! see: without them it stayed empty.

use crate::frame::{Frame, ProxyPoint};
use crate::reference::shown;
use calibrate::Pixel;
use glam::DVec2;

/// So many pixels of a triangle that no view has are asked about, at most: where many see what is in no photo, all
/// of their neighbours do.
const FRUITLESS: usize = 8;

/// For each pixel whose centre is in a triangle of the image plane and that none of the `listed` source views has,
/// the one that has it and differs least; each once, in no order. Not all such pixels' are found where more than a few
/// are in no photo. `corners` are in pixels, on the lattice that pixels' centres are on, too; of equal differences the
/// first view counts.
pub(super) fn overlooked(frame: &Frame<'_>, corners: [DVec2; 3], listed: &[usize]) -> Vec<usize> {
    let [a, b, c] = corners;
    let turn = (b - a).perp_dot(c - a).signum();
    // Exact: the lattice is coarse.
    let is_inside = |p: DVec2| {
        let mut sides = [(a, b), (b, c), (c, a)].into_iter();
        sides.all(|(from, to)| turn * (to - from).perp_dot(p - from) >= 0.0)
    };
    let (least, most) = (a.min(b).min(c), a.max(b).max(c));
    let pixels = |least: f64, most: f64, count: u32| {
        let end = most.ceil().clamp(0.0, f64::from(count)) as u32;
        (least.floor().max(0.0) as u32).min(end)..end
    };
    let columns = pixels(least.x, most.x, frame.desired.width);

    let mut found = Vec::new();
    // The view that has the last pixel mostly has the next.
    let mut last = listed.first().copied();
    let mut fruitless = 0;
    for y in pixels(least.y, most.y, frame.desired.height) {
        for x in columns.clone() {
            let center = Pixel::center_of(x, y);
            if !is_inside(DVec2::new(center.x, center.y)) {
                continue;
            }
            let Some(point) = frame.proxy_point(center) else {
                continue;
            };
            if last.is_some_and(|i| has(frame, i, &point)) {
                continue;
            }
            let mut known = listed.iter().chain(&found).copied();
            last = known.find(|i| has(frame, *i, &point));
            if last.is_some() {
                continue;
            }
            let near = frame.near(&point, 0.0, frame.first_guess());
            let candidates = near.candidates.iter();
            let best = candidates.min_by(|x, y| x.diff.total_cmp(&y.diff));
            last = best.map(|best| best.source_idx);
            found.extend(last);
            if last.is_none() {
                fruitless += 1;
                if fruitless == FRUITLESS {
                    return found;
                }
            }
        }
    }
    found
}

/// Whether a source view may paint a point: what hides it does not leave it empty.
fn has(frame: &Frame<'_>, source_idx: usize, point: &ProxyPoint) -> bool {
    let pixel = frame.project(source_idx, point);
    pixel.is_some_and(|pixel| shown(frame, source_idx, point, pixel).is_some())
}
