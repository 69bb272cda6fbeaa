//! Step 2: within a cell, split the pieces until nothing crosses.
//!
//! This is snap rounding (Hobby 1999; Guibas and Marimont 1998). The vertices are what is
//! given and every crossing, moved to its nearest lattice point. A vertex owns the square
//! of side one step around it, and every piece that passes through the square is bent to
//! pass through the vertex. The theorem: then no two pieces cross, and none passes through
//! a vertex but at its ends. Splitting crossings one by one has no such end: near-parallel
//! pieces, bent by rounding, cross anew for ever.

use super::cut::ordered;
use super::lattice::{Piece, Point, divide_rounded, orient};

/// A cell's pieces, crossing nothing and passing through no vertex.
pub(super) struct Split {
    /// Sorted, no repeats, none along the cell's border.
    pub pieces: Vec<Piece>,
    /// The crossings. One on the cell's border must become a vertex of the neighbour too;
    /// there it lies on no piece, as pieces touch the border with their ends only.
    pub crossings: Vec<Point>,
}

/// Splits sorted pieces at each other and at the vertices inside the cell. The result
/// depends on the set of pieces and vertices only, not on an order.
pub(super) fn split(pieces: Vec<Piece>, inside: &[Point], [low, high]: [Point; 2]) -> Split {
    if pieces.len() == 1 && inside.is_empty() {
        return Split {
            pieces,
            crossings: Vec::new(),
        };
    }
    let crossings = crossings(&pieces);
    let mut vertices: Vec<Point> = pieces.as_flattened().to_vec();
    vertices.extend_from_slice(inside);
    vertices.extend_from_slice(&crossings);
    vertices.sort_unstable();
    vertices.dedup();

    let along_border = |[a, b]: Piece| {
        (a.x == b.x && (a.x == low.x || a.x == high.x))
            || (a.y == b.y && (a.y == low.y || a.y == high.y))
    };
    let mut chains = Vec::with_capacity(pieces.len() + 2 * crossings.len());
    let mut stops: Vec<Point> = Vec::new();
    for &piece in &pieces {
        let [a, b] = piece;
        let first = vertices.partition_point(|v| v.x < a.x);
        stops.clear();
        stops.extend(
            vertices[first..]
                .iter()
                .take_while(|v| v.x <= b.x)
                .filter(|&&v| passes(piece, v)),
        );
        // Along a straight line squares come in order of x and of y.
        let slope = (b.y - a.y).signum();
        stops.sort_unstable_by_key(|v| (v.x, v.y * slope));
        chains.extend(
            stops
                .windows(2)
                .map(|pair| ordered([pair[0], pair[1]]))
                .filter(|&piece| !along_border(piece)),
        );
    }
    chains.sort_unstable();
    chains.dedup();
    Split {
        pieces: chains,
        crossings,
    }
}

/// The lattice points nearest to where pieces cross inside both, with repeats. They stay in
/// the cell, whose sides lie on the lattice.
fn crossings(pieces: &[Piece]) -> Vec<Point> {
    let mut crossings = Vec::new();
    for (i, &[a, b]) in pieces.iter().enumerate() {
        let (low_y, high_y) = (a.y.min(b.y), a.y.max(b.y));
        // Sorted pieces: the first to start right of this one ends the search.
        for &[c, d] in pieces[i + 1..].iter().take_while(|piece| piece[0].x <= b.x) {
            if c.y.max(d.y) < low_y || c.y.min(d.y) > high_y {
                continue;
            }
            let opposite = |s: i64, t: i64| s.signum() * t.signum() < 0;
            if opposite(orient(a, b, c), orient(a, b, d))
                && opposite(orient(c, d, a), orient(c, d, b))
            {
                crossings.push(crossing([a, b], [c, d]));
            }
        }
    }
    crossings
}

/// The lattice point nearest to where two crossing pieces meet, halves up.
fn crossing([a, b]: Piece, [c, d]: Piece) -> Point {
    let (from_a, from_b) = (i128::from(orient(c, d, a)), i128::from(orient(c, d, b)));
    let (part, whole) = match from_a - from_b {
        whole if whole < 0 => (-from_a, -whole),
        whole => (from_a, whole),
    };
    let at =
        |a: i64, b: i64| divide_rounded(i128::from(a) * whole + i128::from(b - a) * part, whole);
    Point::new(at(a.x, b.x), at(a.y, b.y))
}

/// Whether a piece meets a vertex' square [x − ½, x + ½) × [y − ½, y + ½): the points that
/// round to the vertex, halves up.
fn passes([a, b]: Piece, v: Point) -> bool {
    // The piece's bounding box meets the square.
    if v.x < a.x || v.x > b.x || v.y < a.y.min(b.y) || v.y > a.y.max(b.y) {
        return false;
    }
    // So it is the line that counts. Twice the orientation of the square's centre, against
    // the most that a corner's can differ from it. A line that only touches the square
    // does so in a corner; the square owns just the one with the smallest x and y.
    let (dx, dy) = (b.x - a.x, b.y - a.y);
    let center = 2 * orient(a, b, v);
    let reach = dx.abs() + dy.abs();
    center.abs() < reach || (center.abs() == reach && center - dx + dy == 0)
}
