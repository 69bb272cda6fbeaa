//! Depths from costs: semi-global matching.

use super::DepthMap;
use super::small::SmallPhoto;
use super::sweep::Costs;
use pulp::Arch;

/// What it costs neighbours to be one step apart, and to be farther apart; the latter less
/// across an edge of the photo.
const STEP: u16 = 8;
const JUMP: u16 = 80;
const LEAST_JUMP: u16 = 20;
/// More than any path costs.
const WALL: u16 = u16::MAX / 2;
/// Steps of gray that halve the cost of a jump.
const EDGE: f32 = 8.0;

/// The inverse depth of each pixel that the photo uses.
pub(super) fn depths(photo: &SmallPhoto, costs: &Costs) -> DepthMap {
    let (width, height, count) = (photo.width, photo.height, costs.count);
    let sums = vec![0_u16; costs.costs.len()];
    // A closure that gives away what it has is compiled for wide vectors: see `Comparison::new`.
    let sums = Arch::new().dispatch(
        #[inline(always)]
        move || all_paths(photo, costs, sums),
    );
    let inverse_depth = |pixel: usize| -> f32 {
        if !photo.used[pixel] {
            return 0.0;
        }
        let sums = &sums[pixel * count..][..count];
        // In two passes, of which the first is one for vectors.
        let least = sums.iter().copied().fold(u16::MAX, u16::min);
        let best = sums.iter().position(|sum| *sum == least).unwrap_or(0);
        if best == 0 || best == count - 1 {
            // On the range's end it may as well lie beyond.
            return 0.0;
        }
        let [before, at, after] = [best - 1, best, best + 1].map(|d| f64::from(sums[d]));
        let bend = before - 2.0 * at + after;
        let shift = if bend > 0.0 {
            0.5 * (before - after) / bend
        } else {
            0.0
        };
        (costs.first + costs.step * (best as f64 + shift.clamp(-0.5, 0.5))) as f32
    };
    DepthMap {
        step: costs.step,
        inverse_depths: (0..width * height).map(inverse_depth).collect(),
    }
}

/// Adds the least costs of paths in all directions.
#[inline(always)]
fn all_paths(photo: &SmallPhoto, costs: &Costs, mut sums: Vec<u16>) -> Vec<u16> {
    // Four directions on the way down, and their opposites on the way up.
    for backwards in [false, true] {
        for (dx, dy) in [(1_isize, 0_isize), (1, 1), (0, 1), (-1, 1)] {
            add_path(photo, costs, [dx, dy], backwards, &mut sums);
        }
    }
    sums
}

/// Adds the least costs of paths in one direction.
#[inline(always)]
fn add_path(
    photo: &SmallPhoto,
    costs: &Costs,
    [dx, dy]: [isize; 2],
    backwards: bool,
    sums: &mut [u16],
) {
    let (width, height, count) = (photo.width, photo.height, costs.count);
    let towards = if backwards { 1 } else { -1 };
    // Of this row and the one before it: each pixel's values between two walls that no path
    // goes through, and the least of them.
    let stride = count + 3;
    let mut last = vec![WALL; width * stride];
    let mut current = last.clone();
    for row in 0..height {
        let y = if backwards { height - 1 - row } else { row };
        std::mem::swap(&mut last, &mut current);
        for column in 0..width {
            let x = if backwards {
                width - 1 - column
            } else {
                column
            };
            let pixel = y * width + x;
            let own = &costs.costs[pixel * count..][..count];
            let (px, py) = (x as isize + towards * dx, y as isize + towards * dy);
            let inside = px >= 0 && py >= 0 && px < width as isize && py < height as isize;
            if inside {
                let px = px as usize;
                let (previous, out) = if dy > 0 {
                    (&last[px * stride..], &mut current[x * stride..])
                } else if px < x {
                    let (previous, out) = current.split_at_mut(x * stride);
                    (&previous[px * stride..], out)
                } else {
                    let (out, previous) = current.split_at_mut(px * stride);
                    (&*previous, &mut out[x * stride..])
                };
                let before = py as usize * width + px;
                let difference = (photo.grays[pixel] - photo.grays[before]).abs();
                let jump = (f32::from(JUMP) / (1.0 + difference / EDGE)) as u16;
                let jump = jump.max(LEAST_JUMP);
                step_path(&previous[..stride], own, jump, &mut out[..stride]);
            } else {
                start_path(own, &mut current[x * stride..][..stride]);
            }
            let path = &current[x * stride + 1..][..count];
            let sums = &mut sums[pixel * count..][..count];
            let sums = sums.iter_mut().zip(path);
            sums.for_each(|(s, p)| *s = s.saturating_add(*p));
        }
    }
}

#[inline(always)]
fn start_path(own: &[u8], out: &mut [u16]) {
    let count = own.len();
    for (out, own) in out[1..=count].iter_mut().zip(own) {
        *out = u16::from(*own);
    }
    out[count + 2] = out[1..=count].iter().copied().fold(WALL, u16::min);
}

/// Hirschmüller 2008, equation 13.
#[inline(always)]
fn step_path(previous: &[u16], own: &[u8], jump: u16, out: &mut [u16]) {
    let count = own.len();
    let floor = previous[count + 2];
    let far = floor + jump;
    // Saturating sums, which compile to a few instructions for many depths.
    let around = previous[..count]
        .iter()
        .zip(&previous[1..])
        .zip(&previous[2..]);
    let into = out[1..=count].iter_mut().zip(own);
    let mut least = WALL;
    for ((out, own), ((below, at), above)) in into.zip(around) {
        let beside = (*below).min(*above).saturating_add(STEP);
        let best = (*at).min(beside).min(far).saturating_sub(floor);
        *out = u16::from(*own).saturating_add(best);
        least = least.min(*out);
    }
    out[count + 2] = least;
}
