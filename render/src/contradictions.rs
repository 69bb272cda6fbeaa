//! Where photos contradict each other: how unlike those are that share a place of a picture.
//!
//! Where the proxy is off, or photos look past what hides it, they show different things of one point, and the details of
//! their blend are of neither. How unlike they are is asked once a cell of the picture, of mip levels as coarse as the cell,
//! so that details which are but a little out of place there are no contradiction. Nor is it one that a photo shows the same
//! in another light: each is taken as much brighter or darker as makes it most like the blend.

use crate::frame::{Frame, ProxyPoint};
use crate::photos::PhotoError;
use crate::surface::Surface;
use calibrate::{Distortion, Pixel, View};
use glam::Vec3;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::ops::RangeInclusive;

/// Cells across a picture's longer side.
const CELLS: f64 = 128.0;

/// So many cells, across and down, are asked about together, as the same source views matter to them.
const TOGETHER: usize = 8;

/// A cell counts twice what those beside it do.
const TAPS: [f32; 3] = [0.25, 0.5, 0.25];

/// By how much a photo is taken for brighter, or darker: what would have to differ by more differs.
const FACTORS: RangeInclusive<f32> = 0.4..=2.5;

/// As if photos were as they are in so many points more: of what one shows in few, light would explain whatever it is.
const AS_IT_IS: f32 = 32.0;

/// What a photo shows of a proxy point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Shown {
    pub source_idx: usize,
    pub weight: f32,
    /// 0…1, at the frame's exposure.
    pub color: Vec3,
}

/// A cell, and what photos show there.
type Known = ([usize; 2], Vec<Shown>);

/// How unlike the photos are that share a place of a frame's picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Contradictions {
    cell_px: usize,
    columns: usize,
    rows: usize,
    /// Pixels across, where the first column is beside the last: of a picture that goes all round.
    all_round: Option<usize>,
    /// Row by row.
    by_cell: Vec<f32>,
}

impl Contradictions {
    /// Whether they are of interest. Not those of a proxy that is a plane: whoever asks for one wants to see what lies off it.
    pub(crate) fn may_be(frame: &Frame<'_>) -> bool {
        matches!(&frame.surface, Surface::Facets(map) if !map.planes.is_empty())
    }

    /// Looks at a frame's proxy in the middle of each cell. `shown` gives what photos show of some points that are near one
    /// another.
    ///
    /// # Errors
    /// Those of `shown`.
    pub(crate) fn of<S: Send>(
        frame: &Frame<'_>,
        scratch: impl Fn() -> S + Sync + Send,
        shown: impl Fn(&mut S, &[ProxyPoint]) -> Result<Vec<Vec<Shown>>, PhotoError> + Sync + Send,
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
            let shown = match points.is_empty() {
                true => Vec::new(),
                false => shown(scratch, &points)?,
            };
            Ok(cells.into_iter().zip(shown).collect())
        };
        let blocks = (0..across * down).into_par_iter();
        let known: Vec<Result<Vec<Known>, PhotoError>> =
            blocks.map_init(scratch, of_block).collect();
        // 2. By cell. The first error in order, whichever thread is the first to meet one.
        let mut shown = vec![Vec::new(); columns * rows];
        for known in known {
            for ([column, row], all) in known? {
                shown[row * columns + column] = all;
            }
        }
        let factors = factors(&shown);
        // The variance and one; twice nothing where nobody knows it.
        let of_cell = |all: &Vec<Shown>| {
            let factor = |source_idx| factors.get(&source_idx).copied().unwrap_or(1.0);
            let variance = variance(all, factor);
            variance.map_or([0.0; 2], |variance| [variance, 1.0])
        };
        let cells = shown.par_iter().with_min_len(columns);
        let of_cells: Vec<[f32; 2]> = cells.map(of_cell).collect();
        // 3. The mean of those around each.
        let all_round = goes_all_round(&frame.desired).then_some(size[0]);
        let near =
            |at: usize, k: usize, side: usize| (at + k).checked_sub(1).filter(|at| *at < side);
        let near_column = |at: usize, k: usize| match all_round {
            Some(_) => Some((at + k + columns - 1) % columns),
            None => near(at, k, columns),
        };
        let around = |i: usize| {
            let (column, row) = (i % columns, i / columns);
            let mut sums = [0.0; 2];
            for (j, down) in TAPS.into_iter().enumerate() {
                for (k, along) in TAPS.into_iter().enumerate() {
                    let cell = near(row, j, rows).zip(near_column(column, k));
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
            all_round,
            by_cell: (0..columns * rows).map(around).collect(),
        })
    }

    /// Of the photos that share a pixel, how far their colours, 0…1, are from their mean: the root of its squares' mean; of
    /// the pixels of a row, from the left.
    pub fn row(&self, y: usize) -> impl Iterator<Item = f32> {
        let (above, below, down) = self.between(y, self.rows, None);
        let [above, below] =
            [above, below].map(|row| &self.by_cell[row * self.columns..][..self.columns]);
        let cells = above.iter().zip(below);
        let cells: Vec<f32> = cells.map(|(a, b)| a + (b - a) * down).collect();
        (0..).map(move |x| {
            let (left, right, along) = self.between(x, self.columns, self.all_round);
            cells[left] + (cells[right] - cells[left]) * along
        })
    }

    /// The middles of cells, of so many in a row or column, between which a pixel lies, and how far from the first to
    /// the second; where the first is beside the last, given how many pixels that is around.
    fn between(&self, at: usize, side: usize, around: Option<usize>) -> (usize, usize, f32) {
        let half = self.cell_px / 2;
        let last = (side - 1) * self.cell_px + half;
        if let Some(around) = around
            && (at < half || at >= last)
        {
            // The last cell may be cut off within its half.
            let last = last.min(around - 1);
            let past = (at + around - last) % around;
            let apart = around - last + half;
            return (side - 1, 0, past as f32 / apart as f32);
        }
        let Some(past) = at.checked_sub(half) else {
            return (0, 0, 0.0);
        };
        let first = (past / self.cell_px).min(side - 1);
        let along = (past % self.cell_px) as f32 / self.cell_px as f32;
        (first, (first + 1).min(side - 1), along)
    }
}

/// Whether a view's left border is beside its right one: of a panorama that was not cut.
pub(crate) fn goes_all_round(view: &View) -> bool {
    let around_px = TAU * view.lens.focal.x;
    let is_whole = (around_px - f64::from(view.width)).abs() < 0.5;
    view.lens.distortion() == Distortion::Equirectangular && is_whole
}

/// The blend of what photos show of a point; `None` where none does.
fn blend(shown: &[Shown]) -> Option<Vec3> {
    let weights: f32 = shown.iter().map(|own| own.weight).sum();
    let sum: Vec3 = shown.iter().map(|own| own.color * own.weight).sum();
    (weights > 0.0).then(|| sum / weights)
}

/// How far what photos show of a point, each multiplied by a factor, is from its mean, squared, in the mean over channels and
/// by what they weigh; `None` where none shows it.
fn variance(shown: &[Shown], factor: impl Fn(usize) -> f32) -> Option<f32> {
    let lit = |own: &Shown| Shown {
        color: own.color * factor(own.source_idx),
        ..*own
    };
    let shown: Vec<Shown> = shown.iter().map(lit).collect();
    let mean = blend(&shown)?;
    let (mut squares, mut weights) = (0.0, 0.0);
    for own in &shown {
        squares += own.weight * (own.color - mean).length_squared();
        weights += own.weight;
    }
    Some(squares / (3.0 * weights))
}

/// What each photo's colours are to be multiplied by, so that what it shows looks most like the blend: by least squares over all
/// points, and by what it weighs in each.
fn factors(shown: &[Vec<Shown>]) -> BTreeMap<usize, f32> {
    // Of its colours' products with the blend, of their squares, and of its shares.
    let mut sums: BTreeMap<usize, [f32; 3]> = BTreeMap::new();
    for all in shown {
        let Some(blend) = blend(all) else {
            continue;
        };
        let weights: f32 = all.iter().map(|own| own.weight).sum();
        for own in all {
            let share = own.weight / weights;
            let of = [own.color.dot(blend), own.color.length_squared(), 1.0];
            let sums = sums.entry(own.source_idx).or_default();
            (0..3).for_each(|k| sums[k] += share * of[k]);
        }
    }
    let factor = |[products, squares, shares]: [f32; 3]| {
        let as_it_is = AS_IT_IS * squares / shares;
        match squares > 0.0 && shares > 0.0 {
            true => ((products + as_it_is) / (squares + as_it_is))
                .clamp(*FACTORS.start(), *FACTORS.end()),
            false => 1.0,
        }
    };
    sums.into_iter()
        .map(|(source_idx, sums)| (source_idx, factor(sums)))
        .collect()
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

#[cfg(test)]
mod tests {
    use super::*;
    use calibrate::{Lens, Rigid3};
    use glam::DVec2;
    use std::f64::consts::PI;

    fn shown(of: &[(usize, f32)]) -> Vec<Shown> {
        let one = |&(source_idx, gray): &(usize, f32)| Shown {
            source_idx,
            weight: 1.0,
            color: Vec3::splat(gray),
        };
        of.iter().map(one).collect()
    }

    #[test]
    fn light_is_what_differs_alike_in_many_points() {
        // The second photo has 0.6 of the first one's light, whatever is there.
        let grays = (0..2000).map(|i| 0.2 + 0.6 * (i % 7) as f32 / 7.0);
        let mut all: Vec<Vec<Shown>> = grays.map(|g| shown(&[(0, g), (1, 0.6 * g)])).collect();
        // A third one shows something else in one place alone.
        all.push(shown(&[(0, 0.6), (2, 0.1)]));
        let factors = factors(&all);
        let off = |all: &[Shown]| variance(all, |i| factors[&i]).unwrap().sqrt();
        assert!(all[..2000].iter().all(|all| off(all) < 0.01));
        assert!(off(&all[2000]) > 0.15, "{}", off(&all[2000]));
        assert!((factors[&2] - 1.0).abs() < 0.2, "{factors:?}");
    }

    #[test]
    fn a_panorama_that_is_cut_goes_not_all_round() {
        let panorama = |width: u32| View {
            lens: Lens::new(
                DVec2::splat(128.0 / PI),
                DVec2::new(0.5 * f64::from(width), 64.0),
                Distortion::Equirectangular,
            ),
            width,
            height: 128,
            camera_from_world: Rigid3::IDENTITY,
        };
        assert!(goes_all_round(&panorama(256)));
        assert!(goes_all_round(&panorama(256).resized(100, 50)));
        assert!(!goes_all_round(&panorama(128)) && !goes_all_round(&panorama(255)));
    }
}
