//! Where photos contradict each other: how unlike those are that share a place of a picture.
//!
//! Where the proxy is off, or photos look past what hides it, they show different things of one point, and the details of
//! their blend are of neither. How unlike they are is asked once a cell of the picture, of mip levels as coarse as the cell,
//! so that details which are but a little out of place there are no contradiction.

use crate::frame::{Frame, ProxyPoint};
use crate::photos::PhotoError;
use crate::surface::Surface;
use calibrate::Pixel;
use rayon::prelude::*;

/// Cells across a picture's longer side.
const CELLS: f64 = 128.0;

/// So many cells, across and down, are asked about together, as the same source views matter to them.
const TOGETHER: usize = 8;

/// A cell counts twice what those beside it do.
const TAPS: [f32; 3] = [0.25, 0.5, 0.25];

/// A cell, and the variance there.
type Known = ([usize; 2], f32);

/// How unlike the photos are that share a place of a frame's picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Contradictions {
    cell_px: usize,
    columns: usize,
    rows: usize,
    /// Row by row.
    by_cell: Vec<f32>,
}

impl Contradictions {
    /// Whether they are of interest. Not those of a proxy that is a plane: whoever asks for one wants to see what lies off it.
    pub(crate) fn may_be(frame: &Frame<'_>) -> bool {
        matches!(&frame.surface, Surface::Facets(map) if !map.planes.is_empty())
    }

    /// Looks at a frame's proxy in the middle of each cell. `variances` gives for some points that are near one another
    /// how far photos' colours, 0…1, are from their mean, squared, in the mean over channels and by what they weigh;
    /// `None` where no photo has one.
    ///
    /// # Errors
    /// Those of `variances`.
    pub(crate) fn of<S: Send>(
        frame: &Frame<'_>,
        scratch: impl Fn() -> S + Sync + Send,
        variances: impl Fn(&mut S, &[ProxyPoint]) -> Result<Vec<Option<f32>>, PhotoError> + Sync + Send,
    ) -> Result<Self, PhotoError> {
        let is_moved = |i: usize| match &frame.surface {
            Surface::Facets(map) => map.is_moved(map.facet_of[i]),
            _ => false,
        };
        let size = [frame.desired.width, frame.desired.height].map(|side| side as usize);
        let cell_px = cell_px(frame);
        let [columns, rows] = size.map(|side| side.div_ceil(cell_px));
        // 1. What is seen in the middle of each cell. What was moved there says nothing of what is shown.
        let point = |cell: [usize; 2]| {
            let [x, y]: [usize; 2] =
                std::array::from_fn(|i| (cell[i] * cell_px + cell_px / 2).min(size[i] - 1));
            let center = Pixel::center_of(x as u32, y as u32);
            let point = frame.proxy_point(center)?;
            if is_moved(y * size[0] + x) {
                return None;
            }
            (point.inverse_distance >= 0.0).then_some(point)
        };
        let [across, down] = [columns, rows].map(|side| side.div_ceil(TOGETHER));
        let of_block = |scratch: &mut S, block: usize| {
            let first = [block % across, block / across].map(|i| i * TOGETHER);
            let columns = first[0]..(first[0] + TOGETHER).min(columns);
            let rows = first[1]..(first[1] + TOGETHER).min(rows);
            let cells = rows.flat_map(|row| columns.clone().map(move |column| [column, row]));
            let seen = cells.filter_map(|cell| Some((cell, point(cell)?)));
            let (cells, points): (Vec<[usize; 2]>, Vec<ProxyPoint>) = seen.unzip();
            let variances = match points.is_empty() {
                true => Vec::new(),
                false => variances(scratch, &points)?,
            };
            let known = cells.into_iter().zip(variances);
            Ok(known
                .filter_map(|(cell, variance)| Some((cell, variance?)))
                .collect())
        };
        let blocks = (0..across * down).into_par_iter();
        let known: Vec<Result<Vec<Known>, PhotoError>> =
            blocks.map_init(scratch, of_block).collect();
        // 2. By cell: the variance and one; twice nothing where nobody knows it. The first error in order, whichever
        // thread is the first to meet one.
        let mut of_cells = vec![[0.0; 2]; columns * rows];
        for known in known {
            for ([column, row], variance) in known? {
                of_cells[row * columns + column] = [variance, 1.0];
            }
        }
        // 3. The mean of those around each.
        let near =
            |at: usize, k: usize, side: usize| (at + k).checked_sub(1).filter(|at| *at < side);
        let around = |i: usize| {
            let (column, row) = (i % columns, i / columns);
            let mut sums = [0.0; 2];
            for (j, down) in TAPS.into_iter().enumerate() {
                for (k, along) in TAPS.into_iter().enumerate() {
                    let cell = near(row, j, rows).zip(near(column, k, columns));
                    if let Some((row, column)) = cell {
                        let own = of_cells[row * columns + column];
                        (0..2).for_each(|c| sums[c] += own[c] * down * along);
                    }
                }
            }
            let [variance, known]: [f32; 2] = sums;
            if known > 0.0 {
                (variance / known).sqrt()
            } else {
                0.0
            }
        };
        Ok(Self {
            cell_px,
            columns,
            rows,
            by_cell: (0..columns * rows).map(around).collect(),
        })
    }

    /// Of the photos that share a pixel, how far their colours, 0…1, are from their mean: the root of its squares' mean; of
    /// the pixels of a row, from the left.
    pub fn row(&self, y: usize) -> impl Iterator<Item = f32> {
        let (above, below, down) = self.between(y, self.rows);
        let [above, below] =
            [above, below].map(|row| &self.by_cell[row * self.columns..][..self.columns]);
        let cells = above.iter().zip(below);
        let cells: Vec<f32> = cells.map(|(a, b)| a + (b - a) * down).collect();
        (0..).map(move |x| {
            let (left, right, along) = self.between(x, self.columns);
            cells[left] + (cells[right] - cells[left]) * along
        })
    }

    /// The middles of cells, of so many in a row or column, between which a pixel lies, and how far from the first to
    /// the second.
    fn between(&self, at: usize, side: usize) -> (usize, usize, f32) {
        let Some(past) = at.checked_sub(self.cell_px / 2) else {
            return (0, 0, 0.0);
        };
        let first = (past / self.cell_px).min(side - 1);
        let along = (past % self.cell_px) as f32 / self.cell_px as f32;
        (first, (first + 1).min(side - 1), along)
    }
}

/// How wide and high a frame's cells are.
fn cell_px(frame: &Frame<'_>) -> usize {
    let longer = f64::from(frame.desired.width.max(frame.desired.height));
    (longer / CELLS).round().max(1.0) as usize
}

/// A frame whose photos are sampled as coarsely as its cells are.
pub(crate) fn frame_of_cells<'f>(frame: &Frame<'f>) -> Frame<'f> {
    frame.of_samples(1.0 / cell_px(frame) as f64)
}
