//! What fills holes: the farther of what is around.
//!
//! A hole opens where something near moved away from what is behind it, so it is that which
//! belongs there. Such holes are narrow; a wide one is where there is nothing, as where a room has
//! no ceiling, and stays open.

use crate::interior::{Target, Window};
use rayon::prelude::*;
use std::ops::Range;

/// Neighbours within this share of the farthest's inverse depth are the same surface.
const SAME: f32 = 1.2;

/// What is first met along a line.
#[derive(Clone, Copy)]
enum Met {
    /// A pixel that shows something, so many steps away.
    Pixel(usize, i32),
    /// The window's end.
    End(i32),
    /// Neither, within reach.
    Nothing,
}

impl Met {
    fn step(self) -> Option<i32> {
        match self {
            Self::Pixel(_, step) | Self::End(step) => Some(step),
            Self::Nothing => None,
        }
    }

    fn pixel(self) -> Option<(usize, i32)> {
        match self {
            Self::Pixel(i, step) => Some((i, step)),
            Self::End(_) | Self::Nothing => None,
        }
    }
}

/// Fills the pixels of a window that show nothing from those that do, along their row and
/// column, where one of the two is open over no more than a distance, be it once the others are filled;
/// how many are left.
pub(crate) fn fill(
    window: &Window,
    box_of_pixels: [&Range<u32>; 2],
    reach: u32,
    into: &mut Target,
) -> usize {
    let [filled, left] = fill_narrow(window, box_of_pixels, reach, into);
    match (filled, left) {
        (0, _) | (_, 0) => left,
        _ => fill_narrow(window, box_of_pixels, reach, into)[1],
    }
}

/// Fills those that are narrow now; how many, and how many are left.
fn fill_narrow(
    window: &Window,
    [across, down]: [&Range<u32>; 2],
    reach: u32,
    into: &mut Target,
) -> [usize; 2] {
    let width = into.width as usize;
    let reach = reach.min(1 << 20) as i32;
    let (colors, depths) = (&into.color, &into.inverse_depth);
    let open = |y: u32| {
        let row = window.row(y);
        row.start..row.end.min(across.end)
    };
    // The nearest pixel along a line that shows something and that is open.
    let look = |x: u32, y: u32, [dx, dy]: [i32; 2]| {
        for step in 1..=reach {
            let (x, y) = (x as i32 + step * dx, y as i32 + step * dy);
            if x < 0 || !down.contains(&(y.max(0) as u32)) || y < 0 {
                return Met::End(step);
            }
            if !open(y as u32).contains(&(x as u32)) {
                // Beside a slanted outline there may be more.
                if dy == 0 {
                    return Met::End(step);
                }
                continue;
            }
            let i = y as usize * width + x as usize;
            if colors[i][3] > 0 {
                return Met::Pixel(i, step);
            }
        }
        Met::Nothing
    };
    let is_narrow = |[a, b]: [Met; 2]| {
        let across = a.step().zip(b.step()).map(|(a, b)| a + b - 1);
        across.is_some_and(|across| across <= reach) && (a.pixel().is_some() || b.pixel().is_some())
    };
    let fill_row = |y: u32| {
        let mut filled: Vec<(usize, [u8; 4], f32)> = Vec::new();
        let mut left = 0;
        for x in open(y) {
            let i = y as usize * width + x as usize;
            if colors[i][3] > 0 {
                continue;
            }
            let row = [[-1, 0], [1, 0]].map(|way| look(x, y, way));
            let column = [[0, -1], [0, 1]].map(|way| look(x, y, way));
            if !is_narrow(row) && !is_narrow(column) {
                left += 1;
                continue;
            }
            let met = [row[0], row[1], column[0], column[1]];
            let found: Vec<(usize, i32)> = met.into_iter().filter_map(Met::pixel).collect();
            let farthest = found.iter().map(|(i, _)| depths[*i]);
            let farthest = farthest.fold(f32::INFINITY, f32::min);
            let (mut sum, mut weight, mut depth) = ([0.0; 3], 0.0, 0.0);
            for (j, step) in found {
                if depths[j] <= SAME * farthest {
                    let w = 1.0 / step as f32;
                    weight += w;
                    depth += w * depths[j];
                    for k in 0..3 {
                        sum[k] += w * f32::from(colors[j][k]);
                    }
                }
            }
            if weight > 0.0 {
                let [r, g, b] = sum.map(|v| (v / weight + 0.5) as u8);
                filled.push((i, [r, g, b, 255], depth / weight));
            } else {
                left += 1;
            }
        }
        (filled, left)
    };
    let rows: Vec<_> = down.clone().into_par_iter().map(fill_row).collect();
    let [mut count, mut left] = [0; 2];
    for (row, unfilled) in rows {
        count += row.len();
        left += unfilled;
        for (i, color, depth) in row {
            into.color[i] = color;
            into.inverse_depth[i] = depth;
        }
    }
    [count, left]
}
