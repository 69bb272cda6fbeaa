//! What nobody saw of a room.

use super::columns::Columns;

/// Gaps in walls narrower than twice this do not let a room through, and parts that are narrower than
/// twice this are not added to it; metres.
const NARROW: f64 = 0.3;
/// Parts of rooms narrower than twice this do not extend a room: a glance through a gap; metres.
const GLANCE: f64 = 0.15;

/// Gives squares of which nothing is known to the room that one meets both along the one axis and
/// along the other, with no wall in between: the room's missing corners. A capture's lines of sight
/// end where its photos do; that is no reason for a wall to stand there. What lies behind a wall that
/// was seen, and what is beyond all that was seen, stays unknown.
pub(super) fn complete(columns: &Columns, labels: &mut [u32]) {
    let stops = columns.closed(NARROW, |i| columns.is_wall(i) || columns.is_lintel(i));
    let broad = opened(columns, GLANCE, |i| labels[i] != 0);
    // 1. What one meets in each direction: how far it is, and which room.
    let [width, height] = columns.size;
    let mut met_at = vec![[[None::<(u32, u32)>; 2]; 2]; labels.len()];
    for (axis, [lines, length]) in [[height, width], [width, height]].into_iter().enumerate() {
        let index = |line: usize, k: usize| match axis {
            0 => line * width + k,
            _ => k * width + line,
        };
        for line in 0..lines {
            for (way, is_back) in [false, true].into_iter().enumerate() {
                let mut met: Option<(u32, u32)> = None;
                for k in 0..length {
                    let i = index(line, if is_back { length - 1 - k } else { k });
                    met = match met {
                        _ if labels[i] != 0 && broad[i] => Some((0, labels[i])),
                        _ if stops[i] => None,
                        met => met.map(|(steps, label)| (steps + 1, label)),
                    };
                    met_at[i][axis][way] = met;
                }
            }
        }
    }
    // 2. The nearest that is met along both axes, but for narrow strips.
    let room = |i: usize| {
        if labels[i] != 0 || stops[i] {
            return labels[i];
        }
        let [along, across] = met_at[i].map(|of| of.into_iter().flatten());
        let pairs = along.flat_map(|a| across.clone().map(move |b| (a, b)));
        let same = pairs
            .filter(|(a, b)| a.1 == b.1)
            .map(|(a, b)| (a.0 + b.0, a.1));
        same.min().map_or(0, |(_, label)| label)
    };
    let rooms: Vec<u32> = (0..labels.len()).map(room).collect();
    let broad = opened(columns, NARROW, |i| rooms[i] != 0 || stops[i]);
    for (i, label) in labels.iter_mut().enumerate() {
        if *label == 0 && broad[i] {
            *label = rooms[i];
        }
    }
}

/// A set without its parts that are narrower than twice a radius along an axis; corners stay.
fn opened(columns: &Columns, radius: f64, is_in: impl Fn(usize) -> bool) -> Vec<bool> {
    let out: Vec<bool> = (0..columns.count()).map(|i| !is_in(i)).collect();
    let inside = widened(columns, radius, out).into_iter().map(|is| !is);
    widened(columns, radius, inside.collect())
}

/// A set with all that is within a radius of it along each axis.
fn widened(columns: &Columns, radius: f64, mut set: Vec<bool>) -> Vec<bool> {
    let reach = columns.squares(radius).round() as usize;
    let [width, height] = columns.size;
    for (step, length, lines, first) in [(1, width, height, width), (width, height, width, 1)] {
        for line in 0..lines {
            let at = |k: usize| line * first + k * step;
            let is: Vec<usize> = (0..length).filter(|k| set[at(*k)]).collect();
            for k in is {
                (k.saturating_sub(reach)..=(k + reach).min(length - 1))
                    .for_each(|k| set[at(k)] = true);
            }
        }
    }
    set
}
