//! Triangles that are ready, drawn: bands of rows by themselves, in each of which triangle after triangle.

use super::rays::{BLOCK, Bent, Bounds};
use super::{BAND, Prepared, Rays, Scan, Threads};
use glam::DVec3;
use pulp::Arch;
use rayon::prelude::*;
use std::ops::Range;

/// Rows of a triangle that are asked at once for their columns.
const TOGETHER: usize = 4;

/// Which triangle each pixel sees first, over whatever is there; and the inverse depths, over zeros.
pub(super) fn draw_all(
    triangles: &[Vec<Prepared>],
    threads: Threads,
    rays: &Rays,
    ids: &mut [u32],
    depths: Option<&mut [f64]>,
) {
    let [width, height] = rays.size;
    let bands = by_bands(triangles.iter().flatten(), |triangle| triangle, height);
    let pixels = (BAND * width).max(1);
    let draw =
        |own: &mut Vec<f64>, band_idx: usize, ids: &mut [u32], depths: Option<&mut [f64]>| {
            let (band, first) = (&bands[band_idx][..], band_idx * BAND);
            ids.fill(Scan::NOTHING);
            let depths = match depths {
                Some(depths) => depths,
                None if rays.bent.is_none() && are_few(band, width) => {
                    return draw_few(band, first, width, ids);
                }
                None => {
                    own.clear();
                    own.resize(ids.len(), 0.0);
                    own.as_mut_slice()
                }
            };
            Arch::new().dispatch(
                #[inline(always)]
                move || match &rays.bent {
                    None => {
                        for triangle in band {
                            triangle.draw(first, width, ids, depths);
                        }
                    }
                    Some(bent) => {
                        for triangle in band {
                            triangle.draw_bent(first, width, bent, ids, depths);
                        }
                    }
                },
            );
        };
    let ids = ids.par_chunks_mut(pixels).enumerate();
    let ids = ids.with_min_len(threads.at_least(1));
    match depths {
        None => ids.for_each_init(Vec::new, |own, (i, ids)| draw(own, i, ids, None)),
        Some(depths) => {
            let both = ids.zip(depths.par_chunks_mut(pixels));
            both.for_each(|((i, ids), depths)| draw(&mut Vec::new(), i, ids, Some(depths)));
        }
    }
}

/// Whether triangles are so few for a band of so wide a picture that pixels may well be in one at most.
fn are_few(band: &[&Prepared], width: usize) -> bool {
    const PIXELS: usize = 8;
    band.len() * PIXELS <= width
}

/// Which of few triangles a pinhole's pixels in a band of rows see first, over nothing: where each pixel of a row is in one at
/// most no depths are compared.
fn draw_few(band: &[&Prepared], first: usize, width: usize, ids: &mut [u32]) {
    // 1. What each row meets, triangle by triangle.
    let mut rows: [Vec<Span<'_>>; BAND] = Default::default();
    for triangle in band {
        triangle.each_row(first, width, ids.len(), |row, columns| {
            if !columns.is_empty() {
                rows[row - first].push((columns, triangle));
            }
        });
    }
    // 2. What is nearest.
    let mut depths = Vec::new();
    for (i, (spans, ids)) in rows.iter().zip(ids.chunks_mut(width)).enumerate() {
        let row = first + i;
        if are_apart(spans, row) {
            for (columns, triangle) in spans {
                ids[columns.clone()].fill(triangle.triangle_idx);
            }
            continue;
        }
        depths.clear();
        depths.resize(width, 0.0);
        Arch::new().dispatch(
            #[inline(always)]
            || {
                for (columns, triangle) in spans {
                    let (ids, depths) = (&mut ids[columns.clone()], &mut depths[columns.clone()]);
                    triangle.draw_columns(row, columns.start, ids, depths);
                }
            },
        );
    }
}

/// Columns of a row, and which triangle's.
type Span<'a> = (Range<usize>, &'a Prepared);

/// Whether each pixel of a pinhole's row is in one span at most, all in front: then nothing need be
/// compared.
fn are_apart(spans: &[Span<'_>], row: usize) -> bool {
    let mut columns: Vec<[usize; 2]> = spans.iter().map(|(c, _)| [c.start, c.end]).collect();
    columns.sort_unstable();
    let is_in_front = |(columns, triangle): &Span<'_>| {
        let mut ends = [columns.start, columns.end - 1].into_iter();
        ends.all(|column| triangle.inverse_depth_at(row, column) > 0.0)
    };
    columns.windows(2).all(|two| two[0][1] <= two[1][0]) && spans.iter().all(is_in_front)
}

/// Which of some, that have triangles, reach which bands, in order.
pub(super) fn by_bands<'a, T>(
    all: impl Iterator<Item = &'a T>,
    triangle: impl Fn(&T) -> &Prepared,
    height: usize,
) -> Vec<Vec<&'a T>> {
    let mut bands: Vec<Vec<&T>> = vec![Vec::new(); height.div_ceil(BAND)];
    for own in all {
        let rows = &triangle(own).rows;
        let last = (rows.end - 1) / BAND;
        bands[rows.start / BAND..=last]
            .iter_mut()
            .for_each(|band| band.push(own));
    }
    bands
}

impl Prepared {
    /// The rows of it that lie in a band that begins with one of a picture so wide, and has so many pixels.
    #[inline(always)]
    pub(super) fn rows_in(&self, first: usize, width: usize, pixels: usize) -> Range<usize> {
        self.rows.start.max(first)..self.rows.end.min(first + pixels / width)
    }

    /// Draws it over what is farther in a band of rows, ray by ray.
    #[inline(always)]
    fn draw_bent(
        &self,
        first: usize,
        width: usize,
        bent: &Bent,
        ids: &mut [u32],
        depths: &mut [f64],
    ) {
        let is_beyond = |bounds: &Bounds| {
            let mut sides = self.sides.iter().zip(self.slack);
            sides.any(|(side, slack)| bounds.most_of(*side) < -slack)
        };
        // What is narrower is as soon asked ray by ray.
        let is_wide = self.columns.len() > BLOCK;
        let [a, b, c] = self.sides;
        let [least_a, least_b, least_c] = self.slack.map(|slack| -slack);
        let blocks = width.div_ceil(BLOCK);
        for row in self.rows_in(first, width, ids.len()) {
            if is_wide && is_beyond(&bent.rows[row]) {
                continue;
            }
            let of_row = (row - first) * width;
            for block in self.columns.start / BLOCK..self.columns.end.div_ceil(BLOCK) {
                if is_wide && is_beyond(&bent.blocks[row * blocks + block]) {
                    continue;
                }
                let start = self.columns.start.max(block * BLOCK);
                let end = self.columns.end.min((block + 1) * BLOCK);
                let at = &bent.at[row * width..][start..end];
                let drawn = ids[of_row..][start..end].iter_mut();
                let drawn = drawn.zip(&mut depths[of_row..][start..end]);
                for ((id, depth), at) in drawn.zip(at) {
                    let of = |side: DVec3| side.x * at.x + side.y * at.y + side.z;
                    let here = of(self.inverse_depth);
                    let is_inside = (of(a) >= least_a) & (of(b) >= least_b) & (of(c) >= least_c);
                    let is_nearer = is_inside & (here > *depth);
                    *depth = if is_nearer { here } else { *depth };
                    *id = if is_nearer { self.triangle_idx } else { *id };
                }
            }
        }
    }

    /// Calls `each` with the rows of it in a band, as [`Self::rows_in`] has them, and the columns of a pinhole's pixels there
    /// whose centres are inside of all sides.
    #[inline(always)]
    fn each_row(
        &self,
        first: usize,
        width: usize,
        pixels: usize,
        mut each: impl FnMut(usize, Range<usize>),
    ) {
        let rows = self.rows_in(first, width, pixels);
        for start in rows.clone().step_by(TOGETHER) {
            let columns = self.columns_in(start, width);
            for (row, [least, most]) in (start..rows.end).zip(columns) {
                each(row, least..most);
            }
        }
    }

    /// From which column to before which, of a pinhole's row and of the next, the centres of pixels are inside of all sides.
    #[inline(always)]
    fn columns_in(&self, row: usize, width: usize) -> [[usize; 2]; TOGETHER] {
        let (mut least, mut most) = ([0.0_f64; TOGETHER], [width as f64; TOGETHER]);
        for (side, slack) in self.sides.iter().zip(self.slack) {
            for k in 0..TOGETHER {
                // side.x · x + rest ≥ 0
                let y = (row + k) as f64 + 0.5;
                let rest = side.y * y + side.z + slack;
                let at = -rest / side.x - 0.5;
                if side.x > 0.0 {
                    least[k] = least[k].max(at.ceil());
                } else if side.x < 0.0 {
                    most[k] = most[k].min(at.floor() + 1.0);
                } else if rest < 0.0 {
                    most[k] = 0.0;
                }
            }
        }
        std::array::from_fn(|k| {
            let most = most[k].max(0.0);
            [least[k].min(most), most].map(|column| column as usize)
        })
    }

    /// Calls `put(column, 1/z)` for all pixels of a row that look at it or, where the viewer is
    /// between its corners, away from it.
    pub(super) fn each_pixel(&self, row: usize, rays: &Rays, mut put: impl FnMut(usize, f64)) {
        let [width, _] = rays.size;
        match &rays.bent {
            None => {
                let at = DVec3::new(0.0, row as f64 + 0.5, 1.0);
                let rest = self.inverse_depth.dot(at);
                let [[least, most], ..] = self.columns_in(row, width);
                for column in least..most {
                    put(column, self.inverse_depth.x * (column as f64 + 0.5) + rest);
                }
            }
            Some(bent) => {
                for column in self.columns.clone() {
                    let at = bent.at[row * width + column].extend(1.0);
                    let mut sides = self.sides.iter().zip(self.slack);
                    if sides.all(|(side, slack)| side.dot(at) >= -slack) {
                        put(column, self.inverse_depth.dot(at));
                    }
                }
            }
        }
    }

    /// 1/z at the centre of a pinhole's pixel.
    fn inverse_depth_at(&self, row: usize, column: usize) -> f64 {
        let rest = self.inverse_depth.y * (row as f64 + 0.5) + self.inverse_depth.z;
        self.inverse_depth.x * (column as f64 + 0.5) + rest
    }

    /// Draws it over what is farther in a band of a pinhole's rows.
    #[inline(always)]
    fn draw(&self, first: usize, width: usize, ids: &mut [u32], depths: &mut [f64]) {
        self.each_row(
            first,
            width,
            ids.len(),
            #[inline(always)]
            |row, columns| {
                let of_row = (row - first) * width;
                let ids = &mut ids[of_row..][columns.clone()];
                let depths = &mut depths[of_row..][columns.clone()];
                self.draw_columns(row, columns.start, ids, depths);
            },
        );
    }

    /// Draws it over what is farther in pixels of a pinhole's row, from a column on.
    #[inline(always)]
    fn draw_columns(&self, row: usize, first: usize, ids: &mut [u32], depths: &mut [f64]) {
        let rest = self.inverse_depth.y * (row as f64 + 0.5) + self.inverse_depth.z;
        let slope = self.inverse_depth.x;
        for (column, (id, depth)) in (first as i32..).zip(ids.iter_mut().zip(depths)) {
            let here = slope * (f64::from(column) + 0.5) + rest;
            let is_nearer = here > *depth;
            *depth = if is_nearer { here } else { *depth };
            *id = if is_nearer { self.triangle_idx } else { *id };
        }
    }
}
