//! A triangulation of the desired image's plane: Buehler et al. 2001, §4.2.
//!
//! Vertices: a regular grid, given points (epipoles), the ends of given edges (the proxy's),
//! and every crossing of an edge with an edge or the grid. Constraints: the grid's lines and
//! the edges. Everything lies on a lattice of 1/64 px, so that all tests are exact.
//!
//! ```text
//! points, edges ─ cut ─► pieces by cell ─ split ─► pieces that cross nothing ─ cell ─► triangles
//! ```
//!
//! The grid's lines are constraints, so each cell is a triangulation of its own; most are
//! two triangles. The cells run in parallel. The result depends on neither the number of
//! threads nor the order of the input.

mod cell;
mod cut;
mod lattice;
mod split;
mod svg;
#[cfg(test)]
mod tests;

use glam::DVec2;
use rayon::prelude::*;

use cell::Triangle;
use lattice::{Lines, Piece, Point};

pub use svg::to_svg;

/// What must be in the triangulation, in pixels (the image's top-left corner is (0, 0)).
#[derive(Clone, Copy, Debug, Default)]
pub struct Constraints<'a> {
    /// Vertices: the epipoles. Those outside the image are left out.
    pub points: &'a [DVec2],
    /// Edges: the visible proxy edges. They may cross each other and the grid, overlap,
    /// and reach far outside the image. Edges shorter than the lattice's step may vanish.
    pub edges: &'a [[DVec2; 2]],
}

/// The regular grid: its cells across and down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Grid {
    /// Cells across the image.
    pub columns: u32,
    /// Cells down the image.
    pub rows: u32,
}

impl Grid {
    /// A grid of about square cells, of a pixel or more; so many across the image's width.
    ///
    /// ```
    /// use render::triangulation::Grid;
    ///
    /// assert_eq!(Grid::for_image(1024, 768, 32), Grid { columns: 32, rows: 24 });
    /// assert_eq!(Grid::for_image(768, 1024, 32), Grid { columns: 32, rows: 43 });
    /// ```
    pub fn for_image(width: u32, height: u32, cells_across: u32) -> Self {
        let columns = cells_across.clamp(1, width.max(1));
        let rows = f64::from(columns) * f64::from(height) / f64::from(width.max(1));
        Self {
            columns,
            rows: (rows.round() as u32).clamp(1, height.max(1)),
        }
    }
}

/// The image's plane in triangles, without gaps, overlaps or T-junctions.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Triangulation {
    /// In pixels, each a multiple of 1/64. First the grid's corners row by row, then the
    /// others by x, then y.
    pub vertices: Vec<DVec2>,
    /// Indices of vertices, clockwise on the screen (y down): (b − a) × (c − a) > 0, never
    /// zero. Ordered by cell, row by row.
    pub triangles: Vec<[u32; 3]>,
    /// Pieces of edges that the triangulation would not take. Pieces cross nothing by
    /// then, so 0 unless there is a bug.
    pub constraints_declined: usize,
    /// Cells that are two triangles, as nothing lies in them.
    pub cells_plain: usize,
    /// Cells that were triangulated on their own.
    pub cells_triangulated: usize,
}

/// Why there is no triangulation.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TriangulationError {
    /// An image without pixels, or larger than the exact tests allow.
    #[error(
        "cannot triangulate an image of {width}x{height} pixels: each side must be from 1 to {max}",
        max = lattice::MAX_SIDE
    )]
    ImageSize {
        /// Pixels across.
        width: u32,
        /// Pixels down.
        height: u32,
    },
    /// A grid without cells, or with cells finer than the lattice.
    #[error(
        "cannot lay a grid of {}x{} cells over an image of {width}x{height} pixels: expected at \
         least one cell, at most 64 to a pixel each way and 16777216 in all; try fewer cells",
        grid.columns, grid.rows
    )]
    GridSize {
        /// Pixels across.
        width: u32,
        /// Pixels down.
        height: u32,
        /// The grid asked for.
        grid: Grid,
    },
    /// A point is NaN or infinite.
    #[error("point {index} is not finite: ({}, {}); leave out epipoles at infinity", pixel.x, pixel.y)]
    PointNotFinite {
        /// Its place in [`Constraints::points`].
        index: usize,
        /// What was found.
        pixel: DVec2,
    },
    /// An end of an edge is NaN or infinite.
    #[error(
        "edge {index} is not finite: ({}, {}) to ({}, {}); clip proxy edges at the near plane",
        start.x, start.y, end.x, end.y
    )]
    EdgeNotFinite {
        /// Its place in [`Constraints::edges`].
        index: usize,
        /// One end as found.
        start: DVec2,
        /// The other.
        end: DVec2,
    },
}

/// Triangulates an image of `width` × `height` pixels: a constrained Delaunay triangulation
/// whose constraints are the grid's lines and the given edges, snapped to 1/64 px and split
/// where they cross. Where several triangulations are Delaunay (a plain cell's corners are
/// cocircular), triangles fan out from the lexicographically smallest vertex.
///
/// Errors if the image or grid is empty or too large, or a coordinate is NaN or infinite.
///
/// ```
/// use glam::DVec2;
/// use render::triangulation::{Constraints, Grid, triangulate};
///
/// let epipole = DVec2::new(10.0, 20.0);
/// let constraints = Constraints { points: &[epipole], edges: &[] };
/// let image = triangulate(64, 48, Grid { columns: 4, rows: 3 }, &constraints).unwrap();
/// assert_eq!((image.cells_plain, image.cells_triangulated), (11, 1));
/// assert_eq!(image.triangles.len(), 11 * 2 + 4);
/// assert!(image.vertices.contains(&epipole));
/// ```
pub fn triangulate(
    width: u32,
    height: u32,
    grid: Grid,
    constraints: &Constraints,
) -> Result<Triangulation, TriangulationError> {
    let lines = Lines::new(width, height, grid)?;
    Ok(fill(&arrange(lines, constraints)?))
}

/// The vertices and constraints before they are triangulated.
struct Arrangement {
    lines: Lines,
    /// All vertices but the grid's corners; sorted, no repeats.
    vertices: Vec<Point>,
    /// The pieces of each cell that has some: they cross nothing and end at vertices.
    /// Sorted by cell.
    pieces: Vec<(u32, Vec<Piece>)>,
}

/// Cuts the constraints at the grid and splits them within each cell.
fn arrange(lines: Lines, constraints: &Constraints) -> Result<Arrangement, TriangulationError> {
    let cut::Cut {
        mut vertices,
        pieces,
    } = cut::cut(&lines, constraints)?;
    sort_unique(&mut vertices);

    // Only vertices inside a cell can lie on pieces.
    let mut inside: Vec<(u32, Point)> = Vec::new();
    for &vertex in &vertices {
        let mut cells = lines.cells_of(vertex);
        if let (Some(cell), None) = (cells.next(), cells.next()) {
            let [low, high] = lines.bounds(cell);
            if low.x < vertex.x && vertex.x < high.x && low.y < vertex.y && vertex.y < high.y {
                inside.push((cell, vertex));
            }
        }
    }
    inside.sort_unstable();

    let by_cell: Vec<&[(u32, Piece)]> = pieces.chunk_by(|a, b| a.0 == b.0).collect();
    let splits: Vec<(u32, split::Split)> = by_cell
        .par_iter()
        .map(|pieces| {
            let cell = pieces[0].0;
            let inside: Vec<Point> = of_cell(&inside, cell).iter().map(|&(_, p)| p).collect();
            let pieces = pieces.iter().map(|&(_, piece)| piece).collect();
            (cell, split::split(pieces, &inside, lines.bounds(cell)))
        })
        .collect();

    let mut pieces = Vec::with_capacity(splits.len());
    for (cell, split) in splits {
        vertices.extend_from_slice(&split.crossings);
        if !split.pieces.is_empty() {
            pieces.push((cell, split.pieces));
        }
    }
    sort_unique(&mut vertices);
    vertices.retain(|&vertex| !lines.is_corner(vertex));
    Ok(Arrangement {
        lines,
        vertices,
        pieces,
    })
}

/// Triangulates every cell of an arrangement.
fn fill(arrangement: &Arrangement) -> Triangulation {
    let Arrangement {
        lines,
        vertices,
        pieces,
    } = arrangement;
    let cells = (lines.columns() * lines.rows()) as u32;
    let corners = lines.xs.len() * lines.ys.len();

    // A vertex on a grid line belongs to the cells on both sides: no T-junctions.
    let mut members: Vec<(u32, u32)> = Vec::with_capacity(2 * vertices.len());
    for (i, &vertex) in vertices.iter().enumerate() {
        members.extend(
            lines
                .cells_of(vertex)
                .map(|cell| (cell, (corners + i) as u32)),
        );
    }
    members.sort_unstable();

    let mut busy: Vec<u32> = members
        .iter()
        .map(|m| m.0)
        .chain(pieces.iter().map(|p| p.0))
        .collect();
    sort_unique(&mut busy);
    let filled: Vec<(Vec<Triangle>, usize)> = busy
        .par_iter()
        .map(|&cell| {
            let pieces = match pieces.binary_search_by_key(&cell, |p| p.0) {
                Ok(found) => pieces[found].1.as_slice(),
                Err(_) => &[],
            };
            fill_cell(lines, vertices, cell, of_cell(&members, cell), pieces)
        })
        .collect();

    let mut triangles = Vec::with_capacity(
        2 * (cells as usize - busy.len()) + filled.iter().map(|f| f.0.len()).sum::<usize>(),
    );
    let mut next = 0;
    for cell in 0..cells {
        if busy.get(next) == Some(&cell) {
            triangles.extend_from_slice(&filled[next].0);
            next += 1;
        } else {
            triangles.extend(cell::plain(lines.corners(cell)));
        }
    }
    let grid = lines
        .ys
        .iter()
        .flat_map(|&y| lines.xs.iter().map(move |&x| Point::new(x, y)));
    Triangulation {
        vertices: grid
            .chain(vertices.iter().copied())
            .map(Point::to_pixel)
            .collect(),
        triangles,
        constraints_declined: filled.iter().map(|f| f.1).sum::<usize>(),
        cells_plain: cells as usize - busy.len(),
        cells_triangulated: busy.len(),
    }
}

/// The triangles of a cell in the whole triangulation's numbers, and the pieces declined.
/// `members` are the cell's vertices besides its corners.
fn fill_cell(
    lines: &Lines,
    vertices: &[Point],
    cell: u32,
    members: &[(u32, u32)],
    pieces: &[Piece],
) -> (Vec<Triangle>, usize) {
    let [low, high] = lines.bounds(cell);
    let corners = [
        low,
        Point::new(low.x, high.y),
        Point::new(high.x, low.y),
        high,
    ];
    let corner_count = lines.xs.len() * lines.ys.len();
    let mut local: Vec<(Point, u32)> = corners.into_iter().zip(lines.corners(cell)).collect();
    local.extend(
        members
            .iter()
            .map(|&(_, id)| (vertices[id as usize - corner_count], id)),
    );
    local.sort_unstable();
    let points: Vec<Point> = local.iter().map(|l| l.0).collect();
    let (mut triangles, declined) = cell::delaunay(&points, pieces);
    for triangle in &mut triangles {
        *triangle = triangle.map(|i| local[i as usize].1);
    }
    (triangles, declined)
}

/// A cell's part of a list sorted by cell.
fn of_cell<T>(list: &[(u32, T)], cell: u32) -> &[(u32, T)] {
    let start = list.partition_point(|item| item.0 < cell);
    let length = list[start..].partition_point(|item| item.0 == cell);
    &list[start..start + length]
}

fn sort_unique<T: Ord>(list: &mut Vec<T>) {
    list.sort_unstable();
    list.dedup();
}
