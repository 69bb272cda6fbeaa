//! Frames of the exact field.

use super::asked::{Asked, Extent, in_f32};
use super::lanes::{LANES, any, each};
use super::source::Tile;
use super::{BAND, Engine, Seen, TILE, draw, mark, put, tiles_of_band};
use crate::frame::{Frame, ProxyPoint};
use crate::held::Held;
use crate::photos::PhotoError;
use crate::rays::RayMap;
use crate::view_tree::Ball;
use image::RgbaImage;

/// Tiles that ask for source views together, first: from the top of a band to its bottom.
const TILES_OF_BLOCK: usize = 4 * BAND / TILE[1];

/// The exact field at every pixel; the fast twin of [`crate::reference::render_exact`].
pub(super) fn draw_exact(frame: &Frame<'_>, rays: &RayMap) -> Result<RgbaImage, PhotoError> {
    frame.view_tree();
    let engine = Engine::new(frame, rays);
    let photos = Held::new(frame, &mark::wanted(&engine, frame.taking_part().collect()));
    let pitch = frame.desired.width as usize * 4;
    draw(frame, |band, scratch: &mut (Asked, Seen), pixels| {
        engine.weigh_band(band, scratch, |at, seen| {
            let tile = engine.shade(&photos, seen, |_, term| &term.weight)?;
            put(&tile, pixels, pitch, at);
            Ok(())
        })
    })
}

impl Engine<'_> {
    /// The exact field of a band of rows: for each tile in which there is something, where in the band it
    /// begins, the source views that see it, and what they weigh. All tiles have their turn, also after one that
    /// fails.
    pub(super) fn weigh_band(
        &self,
        band: usize,
        (asked, seen): &mut (Asked, Seen),
        mut then: impl FnMut([usize; 2], &Seen) -> Result<(), PhotoError>,
    ) -> Result<(), PhotoError> {
        asked.forget(self.frame);
        let places: Vec<_> = tiles_of_band(self.frame.desired.width as usize).collect();
        let mut done = Ok(());
        for block in places.chunks(TILES_OF_BLOCK) {
            let tile = |&[x, y]: &[usize; 2]| self.tile([x, band * BAND + y], |_| true);
            let tiles: Vec<Tile> = block.iter().map(tile).collect();
            done = done.and(self.weigh_block(&tiles, asked, seen, |i, seen| then(block[i], seen)));
        }
        done
    }

    /// The exact field of tiles that are near one another: for each in which there is something, its number, the source
    /// views that see it, and what they weigh.
    fn weigh_block(
        &self,
        tiles: &[Tile],
        asked: &mut Asked,
        seen: &mut Seen,
        mut then: impl FnMut(usize, &Seen) -> Result<(), PhotoError>,
    ) -> Result<(), PhotoError> {
        let extents: Vec<Extent> = tiles.iter().map(Extent::of).collect();
        let balls = tiles.iter().zip(&extents);
        let balls: Vec<Option<Ball>> = balls.map(|(tile, all)| all.ball_of(tile)).collect();
        let around = extents.iter().copied().fold(Extent::EMPTY, Extent::and);
        asked.enter(around.ball_of_all(&balls));
        let mut done = Ok(());
        for (i, ((tile, extent), ball)) in tiles.iter().zip(&extents).zip(&balls).enumerate() {
            if !extent.is_empty() {
                self.weigh(tile, ball.as_ref(), asked, seen);
                done = done.and(then(i, seen));
            }
        }
        done
    }

    /// The exact field of proxy points that are near one another, in tiles of as many as there are lanes: for each in which
    /// there is something, its number, the source views that see it, and what they weigh.
    pub(super) fn weigh_points(
        &self,
        points: &[ProxyPoint],
        (asked, seen): &mut (Asked, Seen),
        then: impl FnMut(usize, &Seen) -> Result<(), PhotoError>,
    ) -> Result<(), PhotoError> {
        let tile = |points: &[ProxyPoint]| {
            let mut tile = Tile::nothing();
            for (k, point) in points.iter().enumerate() {
                tile.set(k, point.ray.as_vec3().to_array(), point.plane);
            }
            tile
        };
        let tiles: Vec<Tile> = points.chunks(LANES).map(tile).collect();
        asked.forget(self.frame);
        self.weigh_block(&tiles, asked, seen, then)
    }

    /// The exact picture of some proxy points that are near one another, straight RGBA; `None` where no photo has one.
    pub(super) fn draw_points(
        &self,
        photos: &Held<'_>,
        scratch: &mut (Asked, Seen),
        points: &[ProxyPoint],
    ) -> Result<Vec<Option<[u8; 4]>>, PhotoError> {
        let mut colors = vec![None; points.len().next_multiple_of(LANES)];
        self.weigh_points(points, scratch, |i, seen| {
            let mut weight = [0.0_f32; LANES];
            for (_, _, term) in seen.iter() {
                weight = each(|k| weight[k] + term.weight[k]);
            }
            let tile = self.shade(photos, seen, |_, term| &term.weight)?;
            let tile = tile.iter().zip(weight);
            for (color, (shown, weight)) in colors[i * LANES..].iter_mut().zip(tile) {
                *color = (weight > 0.0).then_some(*shown);
            }
            Ok(())
        })?;
        colors.truncate(points.len());
        Ok(colors)
    }

    /// The exact field of a tile, of more source views where those asked first don't settle it.
    fn weigh(&self, tile: &Tile, ball: Option<&Ball>, asked: &mut Asked, seen: &mut Seen) {
        let mut within = asked.first(ball);
        loop {
            let views = asked.views(self.frame, ball, within);
            let scored = self.score(views, within as f32, tile, seen);
            let scored = views[..scored].iter().map(|(_, view)| *view);
            self.frame.tally.note(scored);
            let reach = seen.weigh(&self.frame.options);
            let wanted = (0..LANES).filter(|&k| tile.s[k] >= 0.0);
            match asked.settles(within, wanted.map(|k| reach[k]).fold(0.0, f32::max)) {
                Ok(()) => return,
                Err(wider) => within = wider,
            }
        }
    }

    /// Of some source views those that see something of a tile and differ there by `within` or less,
    /// and by what they differ. Of each it is known how much it differs at least; they are in order by that. How
    /// many there were until no further one could count.
    pub(super) fn score(
        &self,
        views: &[(f32, u32)],
        within: f32,
        tile: &Tile,
        seen: &mut Seen,
    ) -> usize {
        seen.clear();
        let may_skip = self.frame.may_skip();
        let is_there = std::array::from_fn(|k| tile.s[k] >= 0.0);
        for (asked, &(least, view)) in views.iter().enumerate() {
            let least = in_f32(least);
            if may_skip && seen.is_enough(asked, &self.frame.options, least, &is_there) {
                return asked;
            }
            let source_idx = view as usize;
            if self.among.as_ref().is_some_and(|among| !among[source_idx]) {
                continue;
            }
            let source = self.source(source_idx);
            let (sight, term) = seen.next();
            let diff = source.difference(tile);
            let little = |k: usize| is_there[k] & !(diff[k] > within);
            if !any(little) || !source.see(tile, sight) {
                continue;
            }
            self.mask(source_idx, sight, |_| true);
            term.differ(&diff);
            term.a = sight.a;
            seen.keep(source_idx);
        }
        views.len()
    }
}
