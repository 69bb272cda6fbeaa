//! Openings as holes in a strip of wall: what is open of it, square by square along it, each with a bit for every height.

use super::columns::{bin_at, height_of};
use std::ops::Range;

/// Openings' least width, height and area; metres. Of squares that are free: jambs take one on each side, so that
/// openings of 0.4 m are found wherever the grid's lines are.
pub(super) const LEAST: f64 = 0.35;
const LEAST_AREA: f64 = 0.15;
/// Of the most that a hole is open across, heights at which it is open by this part or less do not join what is above and below.
const SLIT: usize = 10;

/// Rectangles of what hangs together by more than slits: from and to along, and bins from and to.
pub(super) fn holes(open: &[u128], step: f64) -> Vec<[usize; 4]> {
    let bins = bin_at(f64::INFINITY);
    let mut left = open.to_vec();
    let mut found = Vec::new();
    for first in 0..left.len() {
        while left[first] != 0 {
            // 1. All that hangs together.
            let mut piece = vec![0_u128; left.len()];
            let mut stack = vec![(first, left[first].trailing_zeros())];
            while let Some((s, bin)) = stack.pop() {
                if left[s] >> bin & 1 == 0 {
                    continue;
                }
                left[s] &= !(1 << bin);
                piece[s] |= 1 << bin;
                if s > 0 {
                    stack.push((s - 1, bin));
                }
                if s + 1 < left.len() {
                    stack.push((s + 1, bin));
                }
                if bin > 0 {
                    stack.push((s, bin - 1));
                }
                if (bin as usize) + 1 < bins {
                    stack.push((s, bin + 1));
                }
            }
            // 2. Its rectangle: what is open by half as much as where it is most. Where a screen
            // stands in it, its tall parts first.
            let least = (LEAST / step).ceil() as usize;
            let mut of_piece = Vec::new();
            loop {
                let tall = |s: usize| piece[s].count_ones() as usize;
                let highest = (0..piece.len()).map(tall).max().unwrap_or(0);
                let is_tall = |s: &usize| 3 * tall(*s) >= 2 * highest && highest > 0;
                let run = longest_run(piece.len(), is_tall);
                if highest == 0 {
                    break;
                }
                let is_open = |s: &usize| tall(*s) > 0;
                let ahead = (run.end..piece.len()).take_while(is_open).count();
                let behind = (0..run.start).rev().take_while(is_open).count();
                // Ragged ends belong to it, also where more hangs together with it at the other.
                let is_ragged = ahead + behind < 2 * least;
                let more = |count: usize| {
                    if is_ragged || count <= least {
                        count
                    } else {
                        0
                    }
                };
                let range = run.start - more(behind)..run.end + more(ahead);
                let mut part = vec![0; piece.len()];
                part[range.clone()].copy_from_slice(&piece[range.clone()]);
                piece[range].fill(0);
                let parts = parts_by_height(&part);
                of_piece.extend(parts.iter().filter_map(|p| rectangle(p, step)));
            }
            found.extend(joined(of_piece));
        }
    }
    found
}

/// Rectangles of one piece, those that go on from one to the next at the same heights as one: what is below a part of them,
/// beyond a slit, had parted them.
fn joined(mut rectangles: Vec<[usize; 4]>) -> Vec<[usize; 4]> {
    rectangles.sort_unstable();
    let mut all: Vec<[usize; 4]> = Vec::new();
    for [from, to, sill, head] in rectangles {
        let goes_on = |last: &&mut [usize; 4]| last[1..] == [from, sill, head];
        match all.iter_mut().find(goes_on) {
            Some(last) => last[1] = to,
            None => all.push([from, to, sill, head]),
        }
    }
    all
}

/// The longest run of numbers that are so.
fn longest_run(count: usize, is_so: impl Fn(&usize) -> bool) -> Range<usize> {
    let mut best = 0..0;
    let mut start = 0;
    for i in 0..=count {
        if i < count && is_so(&i) {
            continue;
        }
        if i - start > best.len() {
            best = start..i;
        }
        start = i + 1;
    }
    best
}

/// A piece's parts above one another: those that slits alone join are holes of their own.
fn parts_by_height(piece: &[u128]) -> Vec<Vec<u128>> {
    let wide: Vec<usize> = (0..bin_at(f64::INFINITY))
        .map(|bin| width_at(piece, bin))
        .collect();
    let most = wide.iter().copied().max().unwrap_or(0);
    let is_slit = |bin: usize| SLIT * wide[bin] <= most;
    let mut masks = Vec::new();
    let mut mask = 0_u128;
    for bin in 0..=wide.len() {
        if bin < wide.len() && !is_slit(bin) {
            mask |= 1 << bin;
        } else if mask != 0 {
            masks.push(std::mem::take(&mut mask));
        }
    }
    let part = |mask: u128| piece.iter().map(|open| open & mask).collect();
    masks.into_iter().map(part).collect()
}

/// How wide a piece is open at a height, in squares.
fn width_at(piece: &[u128], bin: usize) -> usize {
    piece.iter().filter(|open| **open >> bin & 1 == 1).count()
}

/// About the rectangle that a piece fills, if it is large enough.
fn rectangle(piece: &[u128], step: f64) -> Option<[usize; 4]> {
    let tall = |s: usize| piece[s].count_ones() as usize;
    let wide = |bin: usize| width_at(piece, bin);
    let span = |count: usize, of: &dyn Fn(usize) -> usize| {
        let most = (0..count).map(of).max().unwrap_or(0);
        let is_much = |i: &usize| 2 * of(*i) >= most;
        let from = (0..count).find(is_much).unwrap_or(0);
        let to = (0..count).rev().find(is_much).unwrap_or(0) + 1;
        (from, to)
    };
    let (from, to) = span(piece.len(), &tall);
    let (sill, head) = span(bin_at(f64::INFINITY), &wide);
    let (width, height) = ((to - from) as f64 * step, height_of(head) - height_of(sill));
    let area = piece.iter().map(|p| p.count_ones()).sum::<u32>();
    let area = f64::from(area) * step * (height_of(1) - height_of(0));
    let is_large = width >= LEAST && height >= LEAST && area >= LEAST_AREA;
    is_large.then_some([from, to, sill, head])
}

#[cfg(test)]
mod tests {
    use super::super::columns::band;
    use super::*;

    /// Two doorways, and over the low wall between them a window.
    #[test]
    fn a_window_ends_where_doorways_begin_however_ragged_these_are() {
        let (doorway, window) = (band([0.0, 2.2]), band([1.2, 2.2]));
        let step = 0.05;
        for ragged in [0, 1, 3] {
            let mut open = vec![band([0.0, 1.4]); ragged];
            open.extend([doorway; 20]);
            open.extend([window; 90]);
            open.extend([doorway; 27]);
            open.extend(vec![band([0.5, 1.9]); ragged]);
            let mut found = holes(&open, step);
            found.sort_unstable();
            let spans: Vec<[usize; 2]> = found.iter().map(|[from, to, ..]| [*from, *to]).collect();
            let ends = [ragged + 20, ragged + 110];
            assert_eq!(spans[1], ends, "{ragged}: {spans:?}");
            assert!(spans[0][1] == ends[0] && spans[2][0] == ends[1] && spans.len() == 3);
            assert!(found[1][2] > found[0][2]);
        }
    }

    /// A window over a low wall with a crack, which reaches up to the window beside its jamb.
    #[test]
    fn a_crack_below_a_window_does_not_lower_its_sill() {
        let (window, crack) = (band([1.9, 2.9]), band([1.6, 1.75]));
        let mut open = vec![window | crack; 60];
        let whole = holes(&vec![window; 60], 0.05);
        assert_eq!(whole.len(), 1);
        assert_eq!(holes(&open, 0.05), whole);
        open[0] = band([1.6, 2.9]);
        assert_eq!(holes(&open, 0.05), whole);
        // Nor does a hole below the crack part it.
        let mut holed = open.clone();
        holed[20..40].fill(band([0.5, 1.75]) | window);
        holed[20] = band([0.5, 2.9]);
        let found = holes(&holed, 0.05);
        assert!(found.contains(&whole[0]), "{found:?}");
        // One that is open halfway is of it.
        open[..30].fill(band([1.6, 2.9]));
        assert_eq!(holes(&open, 0.05)[0][2], bin_at(1.6));
    }
}
