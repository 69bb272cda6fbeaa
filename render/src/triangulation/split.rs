//! Step 2: within a cell, split the pieces until nothing crosses.

use super::cut::ordered;
use super::lattice::{Piece, Point, divide_rounded, orient};

/// Snapping a crossing bends its pieces by up to half a lattice step, which can make new
/// crossings. Adversarial scenes settled within a handful of rounds; after this many,
/// what still crosses is declined.
const MAX_ROUNDS: usize = 64;

/// A cell's pieces, crossing nothing and passing through no vertex.
pub(super) struct Split {
    /// Sorted, no repeats, none along the cell's border.
    pub pieces: Vec<Piece>,
    /// The vertices that splitting made. One on the cell's border must become a vertex of
    /// the neighbour too; it can split nothing there, as only ends of pieces touch a border.
    pub new_vertices: Vec<Point>,
    /// Pieces given up because they still crossed another after many rounds.
    pub declined: usize,
}

/// Splits pieces at each other and at the vertices inside the cell.
///
/// Each round looks at all pieces as they are and splits each at all its crossings, so the
/// result depends on the set of pieces only, not on an order.
pub(super) fn split(pieces: Vec<Piece>, inside: &[Point], [low, high]: [Point; 2]) -> Split {
    let mut split = Split {
        pieces,
        new_vertices: Vec::new(),
        declined: 0,
    };
    if split.pieces.len() == 1 && inside.is_empty() {
        return split;
    }
    let along_border = |[a, b]: Piece| {
        (a.x == b.x && (a.x == low.x || a.x == high.x))
            || (a.y == b.y && (a.y == low.y || a.y == high.y))
    };
    let mut vertices = inside.to_vec();
    for _ in 0..MAX_ROUNDS {
        vertices.sort_unstable();
        vertices.dedup();

        // Where each piece has to be split.
        let mut cuts: Vec<(usize, Point)> = Vec::new();
        for_each_crossing(&split.pieces, |i, j| {
            let crossing = crossing(split.pieces[i], split.pieces[j]);
            for k in [i, j] {
                if !split.pieces[k].contains(&crossing) {
                    cuts.push((k, crossing));
                }
            }
        });
        split
            .new_vertices
            .extend(cuts.iter().map(|&(_, point)| point));
        for_each_touch(&split.pieces, &vertices, |i, vertex| cuts.push((i, vertex)));
        if cuts.is_empty() {
            return split;
        }

        // Replace each such piece by the chain through its cuts.
        let along = |i: usize, p: Point| {
            let [a, b] = split.pieces[i];
            (b.x - a.x) * (p.x - a.x) + (b.y - a.y) * (p.y - a.y)
        };
        cuts.sort_unstable_by_key(|&(i, p)| (i, along(i, p), p));
        cuts.dedup();
        let mut next = Vec::with_capacity(split.pieces.len() + cuts.len());
        let mut rest = cuts.as_slice();
        for (i, &[a, b]) in split.pieces.iter().enumerate() {
            let (mine, others) = rest.split_at(rest.partition_point(|&(k, _)| k == i));
            rest = others;
            let mut from = a;
            for to in mine.iter().map(|&(_, p)| p).chain([b]) {
                let piece = ordered([from, to]);
                if !along_border(piece) {
                    next.push(piece);
                }
                from = to;
            }
        }
        next.sort_unstable();
        next.dedup();
        split.pieces = next;
        vertices.extend(cuts.iter().map(|&(_, point)| point));
    }

    // It did not settle: keep the pieces that no earlier one crosses.
    let mut declined = vec![false; split.pieces.len()];
    for_each_crossing(&split.pieces, |_, j| declined[j] = true);
    for_each_touch(&split.pieces, &vertices, |i, _| declined[i] = true);
    split.declined = declined.iter().filter(|&&d| d).count();
    let mut declined = declined.into_iter();
    split.pieces.retain(|_| declined.next() == Some(false));
    split
}

/// Calls back with i < j for every two pieces that cross in a point inside both.
/// The pieces are sorted, thus ordered by their smallest x.
fn for_each_crossing(pieces: &[Piece], mut found: impl FnMut(usize, usize)) {
    for (i, &[a, b]) in pieces.iter().enumerate() {
        let (low_y, high_y) = (a.y.min(b.y), a.y.max(b.y));
        for (j, &[c, d]) in pieces.iter().enumerate().skip(i + 1) {
            if c.x > b.x {
                break;
            }
            if c.y.max(d.y) < low_y || c.y.min(d.y) > high_y {
                continue;
            }
            let opposite = |s: i64, t: i64| s.signum() * t.signum() < 0;
            if opposite(orient(a, b, c), orient(a, b, d))
                && opposite(orient(c, d, a), orient(c, d, b))
            {
                found(i, j);
            }
        }
    }
}

/// Calls back for every vertex that lies inside a piece, its ends apart. Overlapping
/// pieces are found so too: an end of one lies inside the other.
fn for_each_touch(pieces: &[Piece], vertices: &[Point], mut found: impl FnMut(usize, Point)) {
    for (i, &[a, b]) in pieces.iter().enumerate() {
        // Sorted ends: what lies inside a piece comes between them.
        let first = vertices.partition_point(|&v| v <= a);
        for &v in vertices[first..].iter().take_while(|&&v| v < b) {
            if orient(a, b, v) == 0 {
                found(i, v);
            }
        }
    }
}

/// The lattice point nearest to where two crossing pieces meet. It stays within the cell,
/// whose sides lie on the lattice.
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
