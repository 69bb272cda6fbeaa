//! Whether there is another storey over the one whose rooms are found.

use super::columns::{BIN, Columns, LEAST_CEILING, band, height_of};
use std::collections::BTreeMap;

/// A storey has so much room over its floor, on this area at least, at about the same heights; metres, square metres.
const HEADROOM: f64 = 1.9;
const LEAST_AREA: f64 = 4.0;

/// How high over the floor the next storey's is, in metres, if there is one with a ceiling within reach.
pub(super) fn floor_above(columns: &Columns) -> Option<f64> {
    // 1. Surfaces over this storey with nothing between them, by bins, and how many squares have them.
    let over = band([LEAST_CEILING, f64::INFINITY]);
    let apart = (HEADROOM / BIN).round() as u32;
    let mut counts: BTreeMap<[u32; 2], usize> = BTreeMap::new();
    for taken in &columns.taken {
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
    let best = counts.iter().max_by_key(|(bins, n)| (around(**bins), **n));
    let area = |bins: [u32; 2]| around(bins) as f64 * columns.step_m * columns.step_m;
    let ([floor, ceiling], _) = best?;
    let is_there = area([*floor, *ceiling]) >= LEAST_AREA;
    is_there.then(|| height_of(*floor as usize) + 0.5 * BIN)
}
