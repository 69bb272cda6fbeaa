//! Step 1: snap the constraints and cut them where they cross the grid's lines.

use glam::DVec2;

use super::lattice::{Lines, Piece, Point, divide_rounded};
use super::{Constraints, TriangulationError};

/// Coordinates up to this (in pixels, about 10¹⁵) are cut exactly; edges that reach
/// farther are first shortened in floating point.
const FAR: f64 = (1_i64 << 50) as f64;

/// Constraints on the lattice.
#[derive(Default)]
pub(super) struct Cut {
    /// Points, edge ends and crossings with the grid inside the image; with repeats.
    pub vertices: Vec<Point>,
    /// Pieces of edges with the cell that holds each; those along the grid's lines, which
    /// are constraints already, are left out. Sorted, no repeats.
    pub pieces: Vec<(u32, Piece)>,
}

/// Snaps and cuts all constraints.
pub(super) fn cut(lines: &Lines, constraints: &Constraints) -> Result<Cut, TriangulationError> {
    let mut cut = Cut::default();
    for (index, &pixel) in constraints.points.iter().enumerate() {
        if !pixel.is_finite() {
            return Err(TriangulationError::PointNotFinite { index, pixel });
        }
        // What lies beyond the i64's range saturates, and is outside as well.
        let point = Point::snap(pixel);
        if lines.contains(point) {
            cut.vertices.push(point);
        }
    }
    let mut stops = Vec::new();
    for (index, &[start, end]) in constraints.edges.iter().enumerate() {
        if !(start.is_finite() && end.is_finite()) {
            return Err(TriangulationError::EdgeNotFinite { index, start, end });
        }
        if let Some(edge) = snap_edge([start, end]) {
            stops_along(lines, edge, &mut stops);
            cut.vertices.extend_from_slice(&stops);
            for pair in stops.windows(2) {
                let piece = ordered([pair[0], pair[1]]);
                if !lines.is_along(piece) {
                    cut.pieces.push((lines.cell_of_piece(piece), piece));
                }
            }
        }
    }
    cut.pieces.sort_unstable();
    cut.pieces.dedup();
    Ok(cut)
}

/// A piece with its lexicographically smaller end first.
pub(super) fn ordered([a, b]: Piece) -> Piece {
    [a.min(b), a.max(b)]
}

/// The edge on the lattice, not yet clipped to the image; none if it shrinks to a point or
/// stays beyond [`FAR`]. The same for both directions of the edge.
fn snap_edge([start, end]: [DVec2; 2]) -> Option<Piece> {
    let is_ordered = (start.x, start.y) <= (end.x, end.y);
    let (a, b) = if is_ordered {
        (start, end)
    } else {
        (end, start)
    };
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    if a.abs().max_element().max(b.abs().max_element()) > FAR {
        // Liang–Barsky against the box ±FAR; quarters, so that differences stay finite.
        for (from, to) in [(a.x, b.x), (a.y, b.y)] {
            let (from, to, bound) = (from / 4.0, to / 4.0, FAR / 4.0);
            let direction = to - from;
            if direction == 0.0 {
                if from.abs() > bound {
                    return None;
                }
                continue;
            }
            let (low, high) = ((-bound - from) / direction, (bound - from) / direction);
            enter = enter.max(low.min(high));
            leave = leave.min(low.max(high));
        }
        if !(enter < leave) {
            return None;
        }
    }
    let at = |t: f64| {
        let exact = if t == 0.0 {
            a
        } else if t == 1.0 {
            b
        } else {
            a * (1.0 - t) + b * t
        };
        Point::snap(exact.clamp(DVec2::splat(-FAR), DVec2::splat(FAR)))
    };
    let edge = [at(enter), at(leave)];
    (edge[0] != edge[1]).then_some(ordered(edge))
}

/// The edge's vertices in the image, in order along it: its ends and its crossings with
/// the grid's lines (the image's border among them), to the nearest lattice point.
///
/// A crossing depends on the edge and the line alone, so both cells at the line get the
/// same one. Rounding keeps order along x and along y and passes no lattice line; hence
/// two consecutive stops always share a cell.
fn stops_along(lines: &Lines, [a, b]: Piece, stops: &mut Vec<Point>) {
    stops.clear();
    let size = lines.size();
    let (low_y, high_y) = (a.y.min(b.y), a.y.max(b.y));
    if b.x < 0 || a.x > size.x || high_y < 0 || low_y > size.y {
        return;
    }
    stops.extend([a, b].into_iter().filter(|&end| lines.contains(end)));

    // y where the edge meets a vertical line, if inside the image; x and y swap roles below.
    let crossing = |a: (i64, i64), b: (i64, i64), line: i64, limit: i64| -> Option<i64> {
        let run = i128::from(b.0 - a.0);
        let value = i128::from(a.1) * run + i128::from(b.1 - a.1) * i128::from(line - a.0);
        let (value, run) = if run < 0 {
            (-value, -run)
        } else {
            (value, run)
        };
        (value >= 0 && value <= i128::from(limit) * run).then(|| divide_rounded(value, run))
    };
    if a.x != b.x {
        for &x in between(&lines.xs, a.x, b.x) {
            let y = crossing((a.x, a.y), (b.x, b.y), x, size.y);
            stops.extend(y.map(|y| Point::new(x, y)));
        }
    }
    if a.y != b.y {
        for &y in between(&lines.ys, low_y, high_y) {
            let x = crossing((a.y, a.x), (b.y, b.x), y, size.x);
            stops.extend(x.map(|x| Point::new(x, y)));
        }
    }
    let slope = (b.y - a.y).signum();
    stops.sort_unstable_by_key(|p| (p.x, p.y * slope));
    stops.dedup();
}

/// The lines from `low` to `high`.
fn between(lines: &[i64], low: i64, high: i64) -> &[i64] {
    &lines[lines.partition_point(|&l| l < low)..lines.partition_point(|&l| l <= high)]
}
