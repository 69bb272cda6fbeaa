//! Step 3: triangulate one cell.

use spade::{ConstrainedDelaunayTriangulation, Point2, Triangulation as _};

use super::lattice::{Piece, Point, in_circle, orient};
use crate::planted::{Fault, is_planted};

/// A triangle of indices into a list of points, clockwise on the screen.
pub(super) type Triangle = [u32; 3];

/// The two triangles of a rectangle whose corners are in lexicographic order: the diagonal
/// starts at the smallest.
pub(super) fn plain([top_left, bottom_left, top_right, bottom_right]: [u32; 4]) -> [Triangle; 2] {
    [
        [top_left, top_right, bottom_right],
        [top_left, bottom_right, bottom_left],
    ]
}

/// The constrained Delaunay triangulation of a convex region: sorted points without
/// repeats, and pieces between them that cross nothing. Where more than three points lie
/// on an empty circle, the triangles fan out from the lexicographically smallest, so the
/// answer is unique. Also returns how many pieces spade declined.
pub(super) fn delaunay(points: &[Point], pieces: &[Piece]) -> (Vec<Triangle>, usize) {
    // Coordinates from the first point: small integers, exact in f64.
    let origin = points[0];
    let vertices = points
        .iter()
        .map(|p| Point2::new((p.x - origin.x) as f64, (p.y - origin.y) as f64))
        .collect();
    let index = |p: &Point| points.binary_search(p).expect("pieces end at vertices");
    let mut constraints: Vec<[u32; 2]> = pieces
        .iter()
        .map(|[a, b]| [index(a) as u32, index(b) as u32])
        .collect();
    constraints.sort_unstable();
    if is_planted(Fault::MissingConstraint) {
        constraints.pop();
    }
    let edges = constraints
        .iter()
        .map(|edge| edge.map(|i| i as usize))
        .collect();

    let mut declined = Vec::new();
    let triangulation = ConstrainedDelaunayTriangulation::<Point2<f64>>::try_bulk_load_cdt(
        vertices,
        edges,
        |edge| {
            declined.push([edge[0].min(edge[1]) as u32, edge[0].max(edge[1]) as u32]);
        },
    )
    .expect("lattice coordinates are finite and moderate");
    constraints.retain(|edge| !declined.contains(edge));

    let mut triangles: Vec<Triangle> = triangulation
        .inner_faces()
        .map(|face| face.vertices().map(|v| v.fix().index() as u32))
        .collect();
    settle_ties(points, &constraints, &mut triangles);
    for triangle in &mut triangles {
        let first = (0..3).min_by_key(|&k| triangle[k]).unwrap();
        triangle.rotate_left(first);
    }
    triangles.sort_unstable();
    (triangles, declined.len())
}

/// Flips diagonals of cocircular quadrilaterals until each starts at the quadrilateral's
/// smallest vertex. `constraints` is sorted.
///
/// It ends: a flip raises the number of edges at a vertex and lowers it only at larger
/// ones. It ends at the fans: in any other triangulation of a cocircular polygon some
/// triangle at the smallest vertex has a neighbour across the edge opposite to it.
fn settle_ties(points: &[Point], constraints: &[[u32; 2]], triangles: &mut [Triangle]) {
    let at = |i: u32| points[i as usize];
    loop {
        // Every edge with its triangle and the corner opposite to it; twins end up adjacent.
        let mut edges: Vec<([u32; 2], usize, usize)> = triangles
            .iter()
            .enumerate()
            .flat_map(|(t, triangle)| {
                (0..3).map(move |k| {
                    let (a, b) = (triangle[(k + 1) % 3], triangle[(k + 2) % 3]);
                    ([a.min(b), a.max(b)], t, k)
                })
            })
            .collect();
        edges.sort_unstable();

        let mut changed = vec![false; triangles.len()];
        for twins in edges.windows(2) {
            let [(edge, t, k), (other, u, l)] = [twins[0], twins[1]];
            if edge != other || changed[t] || changed[u] {
                continue;
            }
            let (apex, opposite) = (triangles[t][k], triangles[u][l]);
            // The edge's ends are sorted, the points too: indices compare like points.
            if edge[0] < apex.min(opposite) || constraints.binary_search(&edge).is_ok() {
                continue;
            }
            let [from, to] = [triangles[t][(k + 1) % 3], triangles[t][(k + 2) % 3]];
            debug_assert!(orient(at(apex), at(from), at(to)) > 0);
            if in_circle(at(apex), at(from), at(to), at(opposite)) == 0 {
                triangles[t] = [apex, from, opposite];
                triangles[u] = [apex, opposite, to];
                (changed[t], changed[u]) = (true, true);
            }
        }
        if !changed.contains(&true) {
            return;
        }
    }
}
