//! Whether there is another storey over the one whose rooms are found.

use super::columns::{BIN, Columns, LEAST_CEILING, band, height_of};
use std::collections::BTreeMap;

/// A storey has so much room over its floor, on this area at least, at about the same heights; metres, square metres.
const HEADROOM: f64 = 1.9;
const LEAST_AREA: f64 = 4.0;
/// And on so much of what has that floor and anything over it. A loft has ceilings at all heights: of a pitched
/// roof one of 0.05 to 0.13 is at about the same.
const LEAST_SHARE: f64 = 0.2;

/// How high over the floor the next storey's is, in metres, if there is one with a ceiling within reach.
pub(super) fn floor_above(columns: &Columns) -> Option<f64> {
    // 1. Surfaces over this storey with nothing between them, by bins, and how many squares have them; and how many
    //    have anything over surface at a bin, or the next.
    let over = band([LEAST_CEILING, f64::INFINITY]);
    let apart = (HEADROOM / BIN).round() as u32;
    let mut counts: BTreeMap<[u32; 2], usize> = BTreeMap::new();
    let mut covered = [0_usize; u128::BITS as usize];
    for taken in &columns.taken {
        let mut about = (taken | taken << 1 | taken >> 1) & over;
        while about != 0 {
            let floor = about.trailing_zeros();
            about &= about - 1;
            let above = taken.checked_shr(floor + 2).unwrap_or(0);
            covered[floor as usize] += usize::from(above != 0);
        }
        let mut left = taken & over;
        while left != 0 {
            let floor = left.trailing_zeros();
            left &= left - 1;
            let ceiling = left.trailing_zeros();
            if left != 0 && ceiling - floor > apart {
                *counts.entry([floor, ceiling]).or_default() += 1;
            }
        }
    }
    // 2. The two that most have, or about those.
    let around = |[floor, ceiling]: [u32; 2]| -> usize {
        let near = |bins: &[u32; 2]| bins[0].abs_diff(floor) <= 1 && bins[1].abs_diff(ceiling) <= 1;
        let counts = counts.iter().filter(|(bins, _)| near(bins));
        counts.map(|(_, count)| count).sum()
    };
    let is_there = |bins: [u32; 2]| {
        let count = around(bins) as f64;
        let area = count * columns.step_m * columns.step_m;
        area >= LEAST_AREA && count >= LEAST_SHARE * covered[bins[0] as usize] as f64
    };
    let there = counts.iter().filter(|(bins, _)| is_there(**bins));
    let best = there.max_by_key(|(bins, n)| (around(**bins), **n));
    best.map(|([floor, _], _)| height_of(*floor as usize) + 0.5 * BIN)
}
