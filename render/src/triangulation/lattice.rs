//! The snapping lattice and the grid's lines on it.
//!
//! Every vertex is an integer multiple of 1/64 px, so that orientation and circle tests
//! are exact and a vertex shared by two cells is the same vertex.

use std::ops::RangeInclusive;

use glam::DVec2;

use super::{Grid, TriangulationError};

/// Lattice steps in a pixel.
pub(super) const STEPS_PER_PIXEL: i64 = 64;

/// The largest image side, in pixels. Lattice coordinates then have 26 bits: orientation
/// tests fit in an i64, circle tests in an i128.
pub(super) const MAX_SIDE: u32 = 1 << 20;

/// More cells than this are a mistake, not a triangulation.
const MAX_CELLS: u64 = 1 << 24;

/// A lattice point; ordered by x, then y.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) struct Point {
    pub x: i64,
    pub y: i64,
}

impl Point {
    pub(super) fn new(x: i64, y: i64) -> Self {
        Self { x, y }
    }

    /// The lattice point nearest to a position in pixels (halves away from zero).
    pub(super) fn snap(pixel: DVec2) -> Self {
        let steps = (pixel * STEPS_PER_PIXEL as f64).round();
        Self::new(steps.x as i64, steps.y as i64)
    }

    /// The position in pixels, exactly.
    pub(super) fn to_pixel(self) -> DVec2 {
        DVec2::new(self.x as f64, self.y as f64) / STEPS_PER_PIXEL as f64
    }
}

/// A straight piece of a constraint: its lexicographically smaller end first.
pub(super) type Piece = [Point; 2];

/// Twice the signed area of a, b, c: positive where c lies clockwise of a→b on the screen
/// (y down). Exact for points in the image.
pub(super) fn orient(a: Point, b: Point, c: Point) -> i64 {
    (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x)
}

/// Where d lies for the circle through a, b, c with `orient(a, b, c) > 0`: positive
/// inside, zero on it, negative outside. Exact.
pub(super) fn in_circle(a: Point, b: Point, c: Point, d: Point) -> i128 {
    let row = |p: Point| {
        let (x, y) = (i128::from(p.x - d.x), i128::from(p.y - d.y));
        (x, y, x * x + y * y)
    };
    let ((ax, ay, a2), (bx, by, b2), (cx, cy, c2)) = (row(a), row(b), row(c));
    a2 * (bx * cy - cx * by) - b2 * (ax * cy - cx * ay) + c2 * (ax * by - bx * ay)
}

/// numerator / denominator to the nearest integer, halves up; the denominator is positive.
pub(super) fn divide_rounded(numerator: i128, denominator: i128) -> i64 {
    (2 * numerator + denominator).div_euclid(2 * denominator) as i64
}

/// The grid's lines on the lattice. Cells and corners are numbered row by row.
#[derive(Clone, Debug)]
pub(super) struct Lines {
    /// Vertical lines' x, from 0 to the image's width, strictly increasing.
    pub xs: Vec<i64>,
    /// Horizontal lines' y, likewise.
    pub ys: Vec<i64>,
}

impl Lines {
    pub(super) fn new(width: u32, height: u32, grid: Grid) -> Result<Self, TriangulationError> {
        if width.min(height) == 0 || width.max(height) > MAX_SIDE {
            return Err(TriangulationError::ImageSize { width, height });
        }
        let lines = |side: u32, cells: u32| -> Option<Vec<i64>> {
            let (steps, cells) = (i64::from(side) * STEPS_PER_PIXEL, i64::from(cells));
            // With a step or more to a cell, no two lines round to the same place.
            (1..=steps).contains(&cells).then(|| {
                (0..=cells)
                    .map(|i| divide_rounded((i * steps).into(), cells.into()))
                    .collect()
            })
        };
        let few = u64::from(grid.columns) * u64::from(grid.rows) <= MAX_CELLS;
        match (lines(width, grid.columns), lines(height, grid.rows)) {
            (Some(xs), Some(ys)) if few => Ok(Self { xs, ys }),
            _ => Err(TriangulationError::GridSize {
                width,
                height,
                grid,
            }),
        }
    }

    pub(super) fn columns(&self) -> usize {
        self.xs.len() - 1
    }

    pub(super) fn rows(&self) -> usize {
        self.ys.len() - 1
    }

    /// The image's size on the lattice.
    pub(super) fn size(&self) -> Point {
        Point::new(self.xs[self.columns()], self.ys[self.rows()])
    }

    /// Inside the image or on its border.
    pub(super) fn contains(&self, p: Point) -> bool {
        let size = self.size();
        (0..=size.x).contains(&p.x) && (0..=size.y).contains(&p.y)
    }

    pub(super) fn is_corner(&self, p: Point) -> bool {
        self.xs.binary_search(&p.x).is_ok() && self.ys.binary_search(&p.y).is_ok()
    }

    /// Whether a piece whose ends share a cell runs along one of the grid's lines.
    pub(super) fn is_along(&self, [a, b]: Piece) -> bool {
        (a.x == b.x && self.xs.binary_search(&a.x).is_ok())
            || (a.y == b.y && self.ys.binary_search(&a.y).is_ok())
    }

    /// The cells that contain a point of the image: one inside a cell, two on a line.
    pub(super) fn cells_of(&self, p: Point) -> impl Iterator<Item = u32> + use<> {
        let (columns, rows) = (intervals(&self.xs, p.x), intervals(&self.ys, p.y));
        let across = self.columns();
        rows.flat_map(move |row| {
            columns
                .clone()
                .map(move |column| (row * across + column) as u32)
        })
    }

    /// The one cell that holds a piece which runs along no line.
    pub(super) fn cell_of_piece(&self, [a, b]: Piece) -> u32 {
        let last_below = |lines: &[i64], twice: i64| lines.partition_point(|l| 2 * l < twice) - 1;
        let column = last_below(&self.xs, a.x + b.x);
        let row = last_below(&self.ys, a.y + b.y);
        (row * self.columns() + column) as u32
    }

    /// A cell's top-left and bottom-right corners.
    pub(super) fn bounds(&self, cell: u32) -> [Point; 2] {
        let (row, column) = (
            cell as usize / self.columns(),
            cell as usize % self.columns(),
        );
        [
            Point::new(self.xs[column], self.ys[row]),
            Point::new(self.xs[column + 1], self.ys[row + 1]),
        ]
    }

    /// The numbers of a cell's corners, by x, then y: the lexicographic order.
    pub(super) fn corners(&self, cell: u32) -> [u32; 4] {
        let (row, column) = (
            cell as usize / self.columns(),
            cell as usize % self.columns(),
        );
        let stride = self.columns() + 1;
        let top_left = row * stride + column;
        [
            top_left,
            top_left + stride,
            top_left + 1,
            top_left + stride + 1,
        ]
        .map(|i| i as u32)
    }
}

/// The one or two intervals between lines that contain a value.
fn intervals(lines: &[i64], value: i64) -> RangeInclusive<usize> {
    let first = lines.partition_point(|&l| l < value).saturating_sub(1);
    let last = (lines.partition_point(|&l| l <= value) - 1).min(lines.len() - 2);
    first..=last
}
