//! Which triangle of the image plane covers which pixel, in exact integers.

use crate::field::TriangulatedField;

/// Where no triangle covers a pixel.
pub(crate) const NO_TRIANGLE: u32 = u32::MAX;

/// Lattice steps a pixel; triangulations have their vertices on this lattice.
const STEPS: i64 = 64;

/// A run of pixels of one row, `start..end`, covered by one triangle.
pub(crate) struct Span {
    pub triangle_idx: usize,
    pub start: usize,
    pub end: usize,
}

/// An edge function: a·x + b·y + c in pixel indices, at pixel centres; ≥ 0 inside. On a
/// shared edge exactly one of the two triangles owns the zero; the other's c is less by 1.
#[derive(Clone, Copy)]
struct Edge {
    a: i64,
    b: i64,
    c: i64,
}

struct Prepared {
    /// Opposite corner 0, 1, 2.
    edges: [Edge; 3],
    inverse_area: f32,
}

/// The triangles of a field, ready to be scanned row by row.
pub(crate) struct Raster {
    triangles: Vec<Prepared>,
    /// The triangles that may cross each row, in order, one row after the other.
    of_rows: Vec<u32>,
    /// By row, where its triangles begin; one more at the end.
    first: Vec<usize>,
}

impl Raster {
    pub(crate) fn new(field: &TriangulatedField) -> Self {
        let corner = |i: u32| {
            let on_lattice = field.vertices[i as usize] * STEPS as f64;
            debug_assert_eq!(
                on_lattice,
                on_lattice.round(),
                "vertices lie on the lattice"
            );
            [on_lattice.x as i64, on_lattice.y as i64]
        };
        let mut rows: Vec<(usize, usize)> = Vec::with_capacity(field.triangles.len());
        let mut prepare = |corners: [u32; 3]| {
            let [a, b, c] = corners.map(corner);
            let top = a[1].min(b[1]).min(c[1]).div_euclid(STEPS).max(0);
            let bottom = a[1].max(b[1]).max(c[1]).div_euclid(STEPS) + 1;
            rows.push((top as usize, bottom.max(0) as usize));
            let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
            Prepared {
                edges: [edge(b, c), edge(c, a), edge(a, b)],
                inverse_area: 1.0 / area as f32,
            }
        };
        let triangles = field.triangles.iter().map(|t| prepare(t.corners)).collect();
        // Which of them each row may have.
        let count = rows.iter().map(|(_, bottom)| *bottom).max().unwrap_or(0);
        let mut first = vec![0; count + 1];
        for &(top, bottom) in &rows {
            (top..bottom).for_each(|row| first[row + 1] += 1);
        }
        for row in 0..count {
            first[row + 1] += first[row];
        }
        let mut next = first.clone();
        let mut of_rows = vec![0; first[count]];
        for (i, &(top, bottom)) in (0..).zip(&rows) {
            for next in &mut next[top.min(count)..bottom] {
                of_rows[*next] = i;
                *next += 1;
            }
        }
        Self {
            triangles,
            of_rows,
            first,
        }
    }

    /// The spans of a row, in the triangles' order; replaces what `spans` held.
    pub(crate) fn spans(&self, row: usize, spans: &mut Vec<Span>) {
        spans.clear();
        let of_row = match self.first.get(row..row + 2) {
            Some(of_row) => &self.of_rows[of_row[0]..of_row[1]],
            None => &[],
        };
        for triangle_idx in of_row.iter().map(|i| *i as usize) {
            let triangle = &self.triangles[triangle_idx];
            let (mut start, mut end) = (0, i64::MAX);
            for edge in triangle.edges {
                let constant = edge.b * row as i64 + edge.c;
                // a·x + constant ≥ 0
                match edge.a {
                    0 if constant < 0 => end = 0,
                    0 => {}
                    a if a > 0 => {
                        start = start.max(
                            (-constant).div_euclid(a) + i64::from((-constant).rem_euclid(a) != 0),
                        )
                    }
                    a => end = end.min(constant.div_euclid(-a) + 1),
                }
            }
            if start < end {
                spans.push(Span {
                    triangle_idx,
                    start: start as usize,
                    end: end as usize,
                });
            }
        }
    }

    /// Notes for the pixels of a row which triangle covers each; the others stay as they are. `spans` is
    /// room to work in.
    pub(crate) fn cover(&self, row: usize, spans: &mut Vec<Span>, pixels: &mut [u32]) {
        self.spans(row, spans);
        let width = pixels.len();
        for span in spans.iter() {
            pixels[span.start..span.end.min(width)].fill(span.triangle_idx as u32);
        }
    }

    /// The shares of a triangle's corners in a pixel that it covers.
    #[inline]
    pub(crate) fn barycentric(&self, triangle_idx: usize, column: usize, row: usize) -> [f32; 3] {
        self.shares(triangle_idx, [column, row], [[0; 2]])
            .map(|[share]| share)
    }

    /// The same of several pixels, so far to the right of and below the first.
    #[inline(always)]
    pub(crate) fn shares<const COUNT: usize>(
        &self,
        triangle_idx: usize,
        [column, row]: [usize; 2],
        places: [[usize; 2]; COUNT],
    ) -> [[f32; COUNT]; 3] {
        let triangle = &self.triangles[triangle_idx];
        let mut shares = [[0.0; COUNT]; 3];
        for (shares, edge) in shares.iter_mut().zip(&triangle.edges) {
            // These whole numbers are exact in f64, which a vector of pixels has at once.
            let (a, b) = (edge.a as f64, edge.b as f64);
            let first = (edge.a * column as i64 + edge.b * row as i64 + edge.c) as f64;
            for k in 0..COUNT {
                let [right, down] = places[k].map(|steps| steps as f64);
                shares[k] = (a * right + b * down + first) as f32 * triangle.inverse_area;
            }
        }
        shares
    }
}

/// The edge function of p ↦ (b − a) × (p − a), p the centre of pixel (x, y).
fn edge(a: [i64; 2], b: [i64; 2]) -> Edge {
    let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
    let owns_zero = dy > 0 || (dy == 0 && dx > 0);
    let half = STEPS / 2;
    Edge {
        a: -dy * STEPS,
        b: dx * STEPS,
        c: dx * (half - a[1]) - dy * (half - a[0]) - i64::from(!owns_zero),
    }
}
