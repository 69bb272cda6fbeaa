//! Wide passages between two ends of wall that face each other, as folding doors leave them.
//!
//! They are no bottlenecks, and there is no lintel, but people see two rooms.

use super::columns::Columns;

/// Ends of wall are thinner than twice this; metres.
const HALF_THICK: f64 = 0.4;
/// Two that face each other may be out of line by twice this; metres.
const HALF_OFF: f64 = 0.2;
/// How far each reaches into the room at least, and the passage may be wide; metres.
const REACHES: f64 = 0.5;
const WIDEST: f64 = 7.0;
/// A passage is less than this of the room's width.
const PASSAGE: f64 = 0.8;

/// Closes passages between facing ends of wall as lintels do.
pub(super) fn close(columns: &mut Columns) {
    let mut closed = Vec::new();
    for axis in 0..2 {
        close_across(columns, axis, &mut closed);
    }
    closed.into_iter().for_each(|i| columns.close(i));
}

#[derive(Clone, Copy, PartialEq)]
enum Part {
    /// Nothing but wall, or nothing known.
    Solid,
    /// A thin wall with room on both sides.
    Stub,
    Free,
}

fn close_across(columns: &Columns, axis: usize, closed: &mut Vec<usize>) {
    let [most, length] = match axis {
        0 => columns.size,
        _ => [columns.size[1], columns.size[0]],
    };
    let index = |at: usize, along: usize| match axis {
        0 => along * columns.size[0] + at,
        _ => at * columns.size[0] + along,
    };
    let (flank, off) = (
        columns.squares(HALF_THICK).round() as usize,
        columns.squares(HALF_OFF).round() as usize,
    );
    // Of neighbouring places, the one with the narrowest passage: at, from, to.
    let mut best: Vec<(usize, usize, usize)> = Vec::new();
    for at in flank..most.saturating_sub(flank + 1) {
        let part = |along: usize| {
            let is_free = |at: usize| columns.is_free(index(at, along));
            let is_wall = |at: usize| columns.is_wall(index(at, along));
            if !(is_free(at - flank) && is_free(at + flank)) {
                Part::Solid
            } else if (at - off..=at + off).any(is_wall) {
                Part::Stub
            } else if (at - off..=at + off).all(is_free) {
                Part::Free
            } else {
                Part::Solid
            }
        };
        // Runs of the same.
        let mut runs: Vec<(Part, usize, usize)> = Vec::new();
        for along in 0..length {
            let part = part(along);
            match runs.last_mut() {
                Some(run) if run.0 == part => run.2 = along + 1,
                _ => runs.push((part, along, along + 1)),
            }
        }
        for five in runs.windows(5) {
            let kinds = [Part::Solid, Part::Stub, Part::Free, Part::Stub, Part::Solid];
            let width = |k: usize| (five[k].2 - five[k].1) as f64 * columns.step_m;
            let is_passage = (0..5).all(|k| five[k].0 == kinds[k])
                && width(1) >= REACHES
                && width(3) >= REACHES
                && width(2) <= WIDEST
                && width(2) <= PASSAGE * (width(1) + width(2) + width(3));
            if is_passage {
                best.push((at, five[2].1, five[2].2));
            }
        }
    }
    // The middle of each group of places.
    let mut from = 0;
    for i in 1..=best.len() {
        let goes_on = i < best.len()
            && best[i].0 - best[i - 1].0 <= 1
            && best[i].1 < best[i - 1].2
            && best[i - 1].1 < best[i].2;
        if !goes_on {
            let (at, start, end) = best[(from + i - 1) / 2];
            closed.extend((start..end).map(|along| index(at, along)));
            // To both ends of wall, wherever they are in line.
            for along in [start.wrapping_sub(1), end] {
                closed.extend((at - off..=at + off).map(|at| index(at, along)));
            }
            from = i;
        }
    }
}
