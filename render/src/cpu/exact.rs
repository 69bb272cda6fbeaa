//! Frames of the exact field.

use super::asked::{Asked, Extent};
use super::lanes::{LANES, any};
use super::source::Tile;
use super::weights::weigh;
use super::{BAND, Engine, Seen, draw, mark};
use crate::frame::Frame;
use crate::photos::PhotoError;
use crate::rays::RayMap;
use crate::view_tree::Ball;
use image::RgbaImage;
use std::array::from_fn;

/// What the exact field weighs together: pixels as near one another as may be, as what they need are the
/// same source views; and what asks for those together, from the top of a band to its bottom.
const TILE: [usize; 2] = [8, LANES / 8];
const BLOCK_WIDTH: usize = 32;
const TILES_OF_BLOCK: usize = BLOCK_WIDTH * BAND / LANES;

/// The exact field at every pixel; the fast twin of [`crate::reference::render_exact`].
pub(super) fn draw_exact(frame: &Frame<'_>, rays: &RayMap) -> Result<RgbaImage, PhotoError> {
    let engine = Engine::new(frame, rays);
    let sources: Vec<usize> = frame.taking_part().collect();
    let photos = mark::hold(&engine, &sources);
    let pitch = frame.desired.width as usize * 4;
    draw(frame, |band, scratch: &mut (Asked, Seen), pixels| {
        engine.weigh_band(band, scratch, |[x0, y0], seen| {
            let mut out = [0; LANES * 4];
            engine.shade(&photos, seen, |_, term| &term.weight, &mut out)?;
            let rows = pixels.chunks_mut(pitch).skip(y0 - band * BAND);
            for (row, out) in rows.zip(out.chunks(TILE[0] * 4)) {
                let row = &mut row[x0 * 4..];
                let count = row.len().min(out.len());
                row[..count].copy_from_slice(&out[..count]);
            }
            Ok(())
        })
    })
}

impl Engine<'_> {
    /// As [`Self::tile`], of pixels as near one another as may be.
    fn square(&self, [x0, y0]: [usize; 2]) -> Tile {
        let mut tile = Tile::nothing();
        let desired = &self.frame.desired;
        let (width, height) = (desired.width as usize, desired.height as usize);
        for (k, y) in (y0..(y0 + TILE[1]).min(height)).enumerate() {
            for (i, x) in (x0..(x0 + TILE[0]).min(width)).enumerate() {
                let plane = self.frame.surface.plane_of(x, y);
                if let (Some(ray), Some(plane)) = (self.rays.ray(x, y), plane) {
                    tile.set(k * TILE[0] + i, ray, plane);
                }
            }
        }
        tile
    }

    /// The exact field of a band of rows: for each tile in which there is something, its first pixel, the
    /// source views that see it, and what they weigh.
    pub(super) fn weigh_band(
        &self,
        band: usize,
        (asked, seen): &mut (Asked, Seen),
        mut then: impl FnMut([usize; 2], &Seen) -> Result<(), PhotoError>,
    ) -> Result<(), PhotoError> {
        asked.forget(self.frame);
        for x0 in (0..self.frame.desired.width as usize).step_by(BLOCK_WIDTH) {
            let across = BLOCK_WIDTH / TILE[0];
            let corner = |i: usize| {
                [
                    x0 + i % across * TILE[0],
                    band * BAND + i / across * TILE[1],
                ]
            };
            let tiles: [Tile; TILES_OF_BLOCK] = from_fn(|i| self.square(corner(i)));
            let extents: [Extent; TILES_OF_BLOCK] = from_fn(|i| Extent::of(&tiles[i]));
            asked.enter(extents.iter().copied().fold(Extent::EMPTY, Extent::and));
            for (i, (tile, extent)) in tiles.iter().zip(&extents).enumerate() {
                if !extent.is_empty() {
                    self.weigh(tile, extent.ball().as_ref(), asked, seen);
                    then(corner(i), seen)?;
                }
            }
        }
        Ok(())
    }

    /// The exact field of a tile, of more source views where those asked first don't settle it.
    fn weigh(&self, tile: &Tile, ball: Option<&Ball>, asked: &mut Asked, seen: &mut Seen) {
        let mut within = asked.first(ball);
        loop {
            let views = asked.views(self.frame, ball, within).iter();
            self.score(views.map(|&i| i as usize), within as f32, tile, seen);
            let reach = weigh(seen.kept().1, &self.frame.options);
            let wanted = (0..LANES).filter(|&k| tile.s[k] >= 0.0);
            match asked.settles(within, wanted.map(|k| reach[k]).fold(0.0, f32::max)) {
                Ok(()) => return,
                Err(wider) => within = wider,
            }
        }
    }

    /// Of some source views those that see something of a tile and differ there by `within` or less,
    /// and by what they differ.
    pub(super) fn score(
        &self,
        views: impl Iterator<Item = usize>,
        within: f32,
        tile: &Tile,
        seen: &mut Seen,
    ) {
        seen.clear();
        for source_idx in views {
            let source = self.source(source_idx);
            let (sight, term) = seen.next();
            term.diff = source.difference(tile);
            let little = |k: usize| (tile.s[k] >= 0.0) & !(term.diff[k] > within);
            if !any(little) || !source.see(tile, sight) {
                continue;
            }
            self.mask(source_idx, sight, |_| true);
            term.a = sight.a;
            seen.keep(source_idx);
        }
    }
}
