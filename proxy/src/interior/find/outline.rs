//! Rooms' outlines on the plan.

use super::columns::Columns;
use super::openings::Opening;
use crate::interior::polygon::thin;
use glam::DVec2;
use std::ops::Range;

/// A room that fills this much of a rectangle is one.
const RECTANGLE: f64 = 0.9;
/// Outlines are simplified by this, in metres; more until they have few enough corners.
const SIMPLER: f64 = 0.15;
const MOST_CORNERS: usize = 120;

/// Where a room's squares are on the plan: in these columns, and in these rows.
pub(super) type Bounds = [Range<usize>; 2];

/// The bounds of labels from 1 on to the last: whoever asks for each room's squares would otherwise go through the
/// whole plan for every room. Empty where a label has no squares.
pub(super) fn bounds(width: usize, labels: &[u32], last: u32) -> Vec<Bounds> {
    let mut found = vec![[0..0, 0..0]; last as usize];
    for (y, row) in labels.chunks_exact(width).enumerate() {
        for (x, label) in row.iter().enumerate().filter(|(_, label)| **label > 0) {
            let Some(bounds) = found.get_mut(*label as usize - 1) else {
                continue;
            };
            for (range, k) in bounds.iter_mut().zip([x, y]) {
                *range = match range.start == range.end {
                    true => k..k + 1,
                    false => range.start.min(k)..range.end.max(k + 1),
                };
            }
        }
    }
    found
}

/// The squares with a label that lies within bounds, row by row.
pub(super) fn squares<'a>(
    width: usize,
    labels: &'a [u32],
    label: u32,
    [columns, rows]: &Bounds,
) -> impl Iterator<Item = usize> + use<'a> {
    let columns = columns.clone();
    let all = rows
        .clone()
        .flat_map(move |y| columns.clone().map(move |x| y * width + x));
    all.filter(move |i| labels[*i] == label)
}

/// A room's outline, counter-clockwise, in the level's frame: a rectangle if it is about one.
pub(super) fn outline(
    columns: &Columns,
    labels: &[u32],
    label: u32,
    bounds: &Bounds,
) -> Vec<DVec2> {
    let at = |p: [f64; 2]| columns.origin + columns.step * DVec2::from_array(p);
    if let Some(corners) = rectangle(columns.size, labels, label, bounds) {
        return corners.map(|p| at(p.map(|x| x as f64))).to_vec();
    }
    // The longest way around it.
    let around = longest_loop(columns.size, labels, label, bounds);
    let mut within = columns.squares(SIMPLER);
    loop {
        let simple = simplified(&around, within);
        if simple.len() <= MOST_CORNERS {
            return simple.into_iter().map(at).collect();
        }
        within *= 1.5;
    }
}

/// The rectangle whose sides are where most of a room's are, if it is about that.
fn rectangle(
    [width, _]: [usize; 2],
    labels: &[u32],
    label: u32,
    bounds: &Bounds,
) -> Option<[[usize; 2]; 4]> {
    let ends =
        |lines: &Range<usize>, along: &Range<usize>, index: &dyn Fn(usize, usize) -> usize| {
            let (mut first, mut last) = (Vec::new(), Vec::new());
            for line in lines.clone() {
                let mut of = along.clone().filter(|k| labels[index(line, *k)] == label);
                if let Some(from) = of.next() {
                    first.push(from);
                    last.push(of.next_back().unwrap_or(from) + 1);
                }
            }
            first.sort_unstable();
            last.sort_unstable();
            let median = |list: &[usize]| list.get(list.len() / 2).copied().unwrap_or(0);
            [median(&first), median(&last)]
        };
    let [columns, rows] = bounds;
    let [x0, x1] = ends(rows, columns, &|y, x| y * width + x);
    let [y0, y1] = ends(columns, rows, &|x, y| y * width + x);
    let is_in = |i: usize| {
        let (x, y) = (i % width, i / width);
        x >= x0 && x < x1 && y >= y0 && y < y1
    };
    let mine = || squares(width, labels, label, bounds);
    let (all, inside) = (mine().count(), mine().filter(|i| is_in(*i)).count());
    let rectangle = x1.saturating_sub(x0) * y1.saturating_sub(y0);
    let shared = inside as f64 / (all + rectangle - inside).max(1) as f64;
    (shared >= RECTANGLE).then_some([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
}

/// Follows squares' sides with the room on the left; turns left where two squares touch at a
/// corner only.
fn longest_loop(
    [width, height]: [usize; 2],
    labels: &[u32],
    label: u32,
    bounds: &Bounds,
) -> Vec<[f64; 2]> {
    let is_in = |x: isize, y: isize| {
        let is_there = x >= 0 && y >= 0 && (x as usize) < width && (y as usize) < height;
        is_there && labels[y as usize * width + x as usize] == label
    };
    // The squares on the left and right of a step from a corner.
    const WAYS: [(isize, isize); 4] = [(1, 0), (0, 1), (-1, 0), (0, -1)];
    let sides = |x: isize, y: isize, way: usize| match way {
        0 => (is_in(x, y), is_in(x, y - 1)),
        1 => (is_in(x - 1, y), is_in(x, y)),
        2 => (is_in(x - 1, y - 1), is_in(x - 1, y)),
        _ => (is_in(x, y - 1), is_in(x - 1, y - 1)),
    };
    let goes = |x: isize, y: isize, way: usize| {
        let (left, right) = sides(x, y, way);
        left && !right
    };
    // Steps along the first axis are below squares of the room.
    let [columns, rows] = bounds;
    let place = |x: isize, y: isize| {
        (y as usize - rows.start) * columns.len() + (x as usize - columns.start)
    };
    let mut is_done = vec![false; columns.len() * rows.len()];
    let mut best: Vec<[f64; 2]> = Vec::new();
    let mut best_area = 0.0;
    for i in squares(width, labels, label, bounds) {
        // Each loop has such a step.
        let (x, y) = ((i % width) as isize, (i / width) as isize);
        if is_done[place(x, y)] || !goes(x, y, 0) {
            continue;
        }
        let mut corners: Vec<[f64; 2]> = Vec::new();
        let (mut px, mut py, mut way) = (x, y, 0);
        let mut area = 0.0;
        loop {
            if way == 0 {
                is_done[place(px, py)] = true;
            }
            corners.push([px as f64, py as f64]);
            let (nx, ny) = (px + WAYS[way].0, py + WAYS[way].1);
            area += 0.5 * (px * ny - nx * py) as f64;
            (px, py) = (nx, ny);
            let turns = [(way + 1) % 4, way, (way + 3) % 4];
            let next = turns.into_iter().find(|w| goes(px, py, *w));
            let Some(next) = next else { break };
            way = next;
            if (px, py, way) == (x, y, 0) {
                break;
            }
        }
        if area > best_area {
            best_area = area;
            best = corners;
        }
    }
    best
}

/// A closed line with fewer corners, nowhere farther from it than said (Douglas and Peucker
/// 1973, between two corners far apart).
fn simplified(corners: &[[f64; 2]], within: f64) -> Vec<[f64; 2]> {
    let n = corners.len();
    if n < 5 {
        return corners.to_vec();
    }
    let p = |i: usize| DVec2::from_array(corners[i % n]);
    let extreme = |key: &dyn Fn(DVec2) -> f64| {
        (0..n).fold(0, |b, i| if key(p(i)) < key(p(b)) { i } else { b })
    };
    let a = extreme(&|p| p.x + p.y);
    let b = extreme(&|q| -q.distance_squared(p(a)));
    let (a, b) = (a.min(b), a.max(b));
    let mut keep = vec![false; n];
    keep[a] = true;
    keep[b] = true;
    let mut stack = vec![(a, b), (b, a + n)];
    while let Some((from, to)) = stack.pop() {
        let (start, end) = (p(from), p(to));
        let along = (end - start).normalize_or_zero();
        let off = |i: usize| {
            let d = p(i) - start;
            let t = d.dot(along).clamp(0.0, start.distance(end));
            d.distance(t * along)
        };
        let far = (from + 1..to).fold(None, |best: Option<(usize, f64)>, i| match best {
            Some((_, most)) if off(i) <= most => best,
            _ => Some((i, off(i))),
        });
        if let Some((i, most)) = far
            && most > within
        {
            keep[i % n] = true;
            stack.push((from, i));
            stack.push((i, to));
        }
    }
    (0..n).filter(|i| keep[*i]).map(|i| corners[i]).collect()
}

/// Makes what nearly lines up line up: sides of rooms with those of their neighbours, and
/// with the openings between them; but not both sides of a room that is narrower than that, which would be
/// none any more.
pub(super) fn snap(outlines: &mut [Vec<DVec2>], openings: &mut [Opening], within: f64) {
    for axis in 0..2 {
        let of_rooms = outlines.iter().flatten().map(|p| (p[axis], false));
        let of_openings = openings.iter().filter(|o| o.axis == axis);
        let mut all: Vec<(f64, bool)> = of_rooms.chain(of_openings.map(|o| (o.at, true))).collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        let spans: Vec<[f64; 2]> = outlines.iter().map(|o| span(o, axis)).collect();
        // Whether a group from one place on has a narrow room's lesser side, and another is nearer to the greater.
        let is_across = |start: f64, x: f64| {
            let is_narrow = |[low, high]: [f64; 2]| low >= start && high - start <= within;
            let mut narrow = spans.iter().filter(|span| is_narrow(**span));
            narrow.any(|[low, high]| x - low > high - x)
        };
        // From the first of a group to its last, and what takes their place.
        let mut groups: Vec<([f64; 2], f64)> = Vec::new();
        let mut start = 0;
        for i in 1..=all.len() {
            let (from, next) = (all.get(start), all.get(i));
            if let Some((from, next)) = from.zip(next)
                && next.0 - from.0 <= within
                && !is_across(from.0, next.0)
            {
                continue;
            }
            let Some(group) = all.get(start..i).filter(|g| !g.is_empty()) else {
                break;
            };
            let has_opening = group.iter().any(|g| g.1);
            let of = group.iter().filter(|g| g.1 == has_opening);
            let (sum, count) = of.fold((0.0, 0.0), |(s, n), g| (s + g.0, n + 1.0));
            groups.push(([group[0].0, group[group.len() - 1].0], sum / count));
            start = i;
        }
        let moved = |x: f64| {
            let group = groups.iter().find(|g| g.0[0] <= x && x <= g.0[1]);
            group.map_or(x, |g| g.1)
        };
        for point in outlines.iter_mut().flatten() {
            point[axis] = moved(point[axis]);
        }
        for opening in openings.iter_mut().filter(|o| o.axis == axis) {
            opening.at = moved(opening.at);
        }
    }
    for outline in outlines {
        tidy(outline);
    }
}

/// The least and the greatest of an outline's places on an axis.
fn span(outline: &[DVec2], axis: usize) -> [f64; 2] {
    let places = outline.iter().map(|p| p[axis]);
    places.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| {
        [low.min(x), high.max(x)]
    })
}

/// Removes corners that are the same or on a line.
fn tidy(outline: &mut Vec<DVec2>) {
    thin(outline, |[a, b, c]| {
        (b - a).perp_dot(c - b).abs() < 1e-9 * (c - a).length_squared().max(1e-18)
            || a.distance(b) < 1e-9
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Squares by their labels: a hall, a room with a corner, one in two parts around a shaft, and one that is none.
    const PLAN: [&str; 9] = [
        "...............",
        ".111111.2222...",
        ".111111.2222...",
        ".111111.22.....",
        ".111111.22.....",
        "..........33333",
        ".3........3...3",
        "33........3..33",
        ".3........33333",
    ];

    #[test]
    fn what_a_room_is_within_its_bounds_it_is_on_the_whole_plan() {
        let size = [PLAN[0].len(), PLAN.len()];
        let letters = PLAN.iter().flat_map(|row| row.chars());
        let labels: Vec<u32> = letters.map(|c| c.to_digit(10).unwrap_or(0)).collect();
        let all = bounds(size[0], &labels, 4);
        assert_eq!(
            all,
            [[1..7, 1..5], [8..12, 1..5], [0..15, 5..9], [0..0, 0..0]]
        );
        let whole = [0..size[0], 0..size[1]];
        for (label, within) in (1..).zip(&all) {
            let squares = |bounds| squares(size[0], &labels, label, bounds).collect::<Vec<_>>();
            assert_eq!(squares(within), squares(&whole));
            let around = |bounds| longest_loop(size, &labels, label, bounds);
            assert_eq!(around(within), around(&whole), "{label}");
            let rectangle = |bounds| rectangle(size, &labels, label, bounds);
            assert_eq!(rectangle(within), rectangle(&whole), "{label}");
            assert_eq!(rectangle(within).is_some(), label == 1);
        }
        // Around the larger part, and not around the shaft in it.
        let around = longest_loop(size, &labels, 3, &all[2]);
        assert!(around.contains(&[15.0, 9.0]) && !around.contains(&[0.0, 7.0]));
    }

    fn corners([x0, y0]: [f64; 2], [x1, y1]: [f64; 2]) -> Vec<DVec2> {
        let corners = [[x0, y0], [x1, y0], [x1, y1], [x0, y1]];
        corners.map(DVec2::from_array).to_vec()
    }

    #[test]
    fn sides_of_neighbours_line_up_and_those_of_a_narrow_room_stay_apart() {
        let doorway = |at: f64| Opening {
            rooms: [3, 2],
            axis: 0,
            at,
            from: 1.0,
            to: 4.0,
            sill: 0.0,
            head: 2.0,
            is_deep: false,
        };
        // Squares are one wide: a hall, a closet, and another hall behind its door.
        for width in [1.0, 2.0, 2.5] {
            let mut outlines = [
                corners([-20.0, -9.0], [-1.0, 9.0]),
                corners([0.0, 0.0], [width, 6.0]),
                corners([width, -9.0], [30.0, 9.5]),
            ];
            let mut openings = [doorway(width - 0.25)];
            snap(&mut outlines, &mut openings, 2.5);
            let spans = outlines.each_ref().map(|outline| span(outline, 0));
            let west = spans[0][1];
            assert!((-1.0..=0.0).contains(&west), "{width}: {spans:?}");
            let east = width - 0.25;
            assert_eq!(openings[0].at, east);
            assert_eq!(spans, [[-20.0, west], [west, east], [east, 30.0]]);
            assert_eq!(outlines[1].len(), 4);
        }
        // As before where it is wide enough.
        let mut outlines = [
            corners([-20.0, -9.0], [-1.0, 9.0]),
            corners([0.0, 0.0], [4.0, 6.0]),
        ];
        snap(&mut outlines, &mut [], 2.5);
        let spans = outlines.each_ref().map(|outline| span(outline, 0));
        assert_eq!(spans, [[-20.0, -0.5], [-0.5, 4.0]]);
    }
}
