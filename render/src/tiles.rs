//! The facets that tiles of a picture see, where each sees one: most do where facets are large.

use crate::cpu::lanes::vectorised;
use crate::surface::NO_FACET;
use glam::DVec2;
use rayon::prelude::*;
use std::ops::Range;

/// Pixels along a side of a tile.
pub(crate) const TILE: usize = 8;

/// Of a tile whose pixels differ.
const MIXED: u32 = NO_FACET - 1;

/// For each tile, row by row, the facet that all of its pixels see.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct FacetTiles {
    across: usize,
    facet_of: Vec<u32>,
}

impl FacetTiles {
    /// Of a picture's pixels, row by row. Tiles at the right and at the bottom may be smaller.
    pub(crate) fn of(facet_of: &[u32], width: usize) -> Self {
        let across = width.div_ceil(TILE);
        let height = facet_of.len().checked_div(width).unwrap_or(0);
        let mut tiles = vec![MIXED; across * height.div_ceil(TILE)];
        let rows = facet_of.par_chunks(TILE * width.max(1));
        let of_row = |(rows, tiles): (&[u32], &mut [u32])| {
            vectorised(
                #[inline(always)]
                // The tiles are given away, so that it can be called but once: others are not compiled for vectors.
                move || {
                    let tiles = tiles;
                    mark_whole(rows, width, tiles);
                },
            );
        };
        let all = rows.zip(tiles.par_chunks_mut(across.max(1)));
        all.for_each(of_row);
        Self {
            across,
            facet_of: tiles,
        }
    }

    /// The facet, or [`NO_FACET`], that all pixels of the tile around a pixel see; `None` where they may differ.
    #[inline]
    pub(crate) fn at(&self, column: usize, row: usize) -> Option<u32> {
        of_whole(self.facet_of[self.number(column, row)])
    }

    /// The number of the tile around a pixel, row by row.
    #[inline]
    pub(crate) fn number(&self, column: usize, row: usize) -> usize {
        row / TILE * self.across + column / TILE
    }

    /// How many tiles there are.
    pub(crate) fn count(&self) -> usize {
        self.facet_of.len()
    }

    /// Takes note that a pixel sees another facet.
    pub(crate) fn mix(&mut self, column: usize, row: usize) {
        let tile = self.number(column, row);
        self.facet_of[tile] = MIXED;
    }

    /// Of the squares around a pixel, so many pixels to each side, the smallest in which a tile may see a facet; `None`
    /// if there is none up to `within`. Pixels may lie outside of the picture.
    pub(crate) fn least_ring(&self, [x, y]: [i64; 2], within: i64) -> Option<i64> {
        let tile = |at: i64| at.div_euclid(TILE as i64);
        let down = self.down();
        let reach = |at: i64, count: usize| {
            tile(at - within).max(0)..(tile(at + within) + 1).min(count as i64)
        };
        // How far the nearest of a tile's pixels is.
        let far = |at: i64, tile: i64| {
            let first = tile * TILE as i64;
            (first - at).max(at - (first + TILE as i64 - 1)).max(0)
        };
        let sees = |column: i64, row: i64| {
            self.facet_of[row as usize * self.across + column as usize] != NO_FACET
        };
        let rings = reach(y, down).flat_map(|row| {
            let seeing = reach(x, self.across).filter(move |&column| sees(column, row));
            seeing.map(move |column| far(x, column).max(far(y, row)))
        });
        rings.min().filter(|ring| *ring <= within)
    }

    /// What each tile sees, as [`Self::at`] says it, row by row, and the tile's first pixel.
    pub(crate) fn iter(&self) -> impl Iterator<Item = ([usize; 2], Option<u32>)> {
        let place = |i: usize| [i % self.across * TILE, i / self.across * TILE];
        let facets = self.facet_of.iter().enumerate();
        facets.map(move |(i, &facet)| (place(i), of_whole(facet)))
    }

    /// How many rows of tiles there are.
    pub(crate) fn down(&self) -> usize {
        self.facet_of.len().checked_div(self.across).unwrap_or(0)
    }

    /// What the tiles of one of their rows see, as [`Self::at`] says it, and their columns of pixels.
    pub(crate) fn of_row(
        &self,
        row: usize,
        width: usize,
    ) -> impl Iterator<Item = (Range<usize>, Option<u32>)> {
        let tiles = &self.facet_of[row * self.across..][..self.across];
        let starts = (0..width).step_by(TILE);
        starts
            .zip(tiles)
            .map(move |(start, &facet)| (start..(start + TILE).min(width), of_whole(facet)))
    }

    /// Whether any pixel of a rectangle, of the picture `facet_of`, sees a facet.
    pub(crate) fn any_within(
        &self,
        facet_of: &[u32],
        [width, height]: [usize; 2],
        least: DVec2,
        most: DVec2,
    ) -> bool {
        let (x0, y0) = (least.x.max(0.0) as usize, least.y.max(0.0) as usize);
        let beyond = |at: f64, side: usize| at.ceil().clamp(0.0, side as f64) as usize;
        let (x1, y1) = (beyond(most.x, width), beyond(most.y, height));
        let sees = |[column, row]: [usize; 2]| match self.at(column, row) {
            Some(facet) => facet != NO_FACET,
            None => (row.max(y0)..(row + TILE).min(y1)).any(|y| {
                let columns = column.max(x0)..(column + TILE).min(x1);
                let pixels = &facet_of[y * width..][columns];
                pixels.iter().any(|&facet| facet != NO_FACET)
            }),
        };
        // Also where the rectangle lies in a tile that reaches beyond the picture.
        if x0 >= x1 || y0 >= y1 {
            return false;
        }
        let first = |at: usize| at / TILE * TILE;
        let mut rows = (first(y0)..y1).step_by(TILE);
        rows.any(|row| {
            (first(x0)..x1)
                .step_by(TILE)
                .any(|column| sees([column, row]))
        })
    }
}

/// What all of a tile's pixels see.
#[inline]
fn of_whole(facet: u32) -> Option<u32> {
    (facet != MIXED).then_some(facet)
}

/// Notes what a row of tiles sees, given its rows of pixels; row by row, as memory has them.
#[inline(always)]
fn mark_whole(rows: &[u32], width: usize, tiles: &mut [u32]) {
    for (tile, pixels) in tiles.iter_mut().zip(rows.chunks(TILE)) {
        *tile = pixels[0];
    }
    // The bits in which any pixel differs from the first.
    let mut off = vec![0; tiles.len()];
    for row in rows.chunks_exact(width) {
        let (whole, rest) = row.as_chunks::<TILE>();
        for ((off, tile), pixels) in off.iter_mut().zip(tiles.iter()).zip(whole) {
            *off |= pixels.iter().fold(0, |off, facet| off | (facet ^ tile));
        }
        if let (Some(off), Some(tile)) = (off.get_mut(whole.len()), tiles.get(whole.len())) {
            *off |= rest.iter().fold(0, |off, facet| off | (facet ^ tile));
        }
    }
    let mixed = tiles.iter_mut().zip(off).filter(|(_, off)| *off != 0);
    mixed.for_each(|(tile, _)| *tile = MIXED);
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::collection::vec;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn tiles_say_what_their_pixels_do(
            width in 1_usize..40, spots in vec((0_usize..900, 1_usize..60, 0_u32..3), 0..8),
            corners in [-5.0..45.0, -5.0..45.0, -5.0..45.0, -5.0..45.0_f64],
        ) {
            let height = (900 / width).min(33);
            let mut facet_of = vec![NO_FACET; width * height];
            for (start, length, facet) in spots {
                let here = facet_of.iter_mut().skip(start).take(length);
                here.for_each(|f| *f = [0, 7, NO_FACET][facet as usize]);
            }
            let tiles = FacetTiles::of(&facet_of, width);
            for (i, facet) in facet_of.iter().enumerate() {
                let at = tiles.at(i % width, i / width);
                prop_assert!(at.is_none_or(|of_all| of_all == *facet));
            }
            for ([column, row], facet) in tiles.iter() {
                let of = |y: usize| &facet_of[y * width..][column..(column + TILE).min(width)];
                let rows = (row..(row + TILE).min(height)).flat_map(of);
                let first = facet_of[row * width + column];
                prop_assert_eq!(facet, rows.clone().all(|f| *f == first).then_some(first));
            }
            for row in 0..tiles.down() {
                for (columns, facet) in tiles.of_row(row, width) {
                    prop_assert_eq!(facet, tiles.at(columns.start, row * TILE));
                    prop_assert!(columns.end == width || columns.end % TILE == 0);
                }
            }
            let [a, b, c, d] = corners;
            let [x, y] = [a, c].map(|at| at as i64);
            let ring = |i: usize| ((i % width) as i64 - x).abs().max(((i / width) as i64 - y).abs());
            let nearest = (0..facet_of.len()).filter(|i| facet_of[*i] != NO_FACET).map(ring).min();
            match (tiles.least_ring([x, y], 30), nearest) {
                // A tile's nearest pixel may see nothing.
                (Some(least), Some(nearest)) => prop_assert!((least..least + 8).contains(&nearest)),
                (least, nearest) => prop_assert!(least.is_none() && nearest.is_none_or(|ring| ring > 30)),
            }
            let (least, most) = (DVec2::new(a.min(b), c.min(d)), DVec2::new(a.max(b), c.max(d)));
            let is_within = |i: usize| {
                let at = DVec2::new((i % width) as f64, (i / width) as f64);
                at.cmpgt(least - 1.0).all() && at.cmplt(most).all()
            };
            let expected = (0..facet_of.len()).any(|i| facet_of[i] != NO_FACET && is_within(i));
            prop_assert_eq!(tiles.any_within(&facet_of, [width, height], least, most), expected);
        }
    }
}
