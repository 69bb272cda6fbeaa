//! Which source views a block of pixels is to ask.

use super::lanes::LANES;
use super::{BAND, Engine};
use crate::near::wider;
use crate::view_tree::Ball;
use glam::DVec3;

/// For a thread: the views that the tiles of the rows it works on ask, each with those below and
/// above it in a band. What is asked before changes time alone: views that matter are always among
/// them in the end.
#[derive(Default)]
pub(super) struct Asked {
    band: Option<usize>,
    /// `None` where no tile of the band asked yet.
    blocks: Vec<Option<Block>>,
}

#[derive(Clone)]
struct Block {
    /// Where its proxy points are; `None` where they are everywhere.
    ball: Option<Ball>,
    /// All that differ by as much or less are among the views, unless they are `stale`.
    within: f64,
    views: Vec<u32>,
    stale: bool,
    /// The most that a tile needed.
    needed: f64,
}

/// Over what a tile needed, for rounding to f32.
const MARGIN: f64 = 1.001;
/// And for the next tile.
const ROOM: f64 = 1.1;
/// Asking again for fewer pays from here on.
const TOO_MUCH: f64 = 1.5;

impl Asked {
    /// The views for a tile of a row, by index.
    pub(super) fn views(&mut self, engine: &Engine<'_>, tile_idx: usize, row: usize) -> &[u32] {
        let frame = engine.frame;
        if self.band != Some(row / BAND) {
            self.band = Some(row / BAND);
            let tiles = (frame.desired.width as usize).div_ceil(LANES);
            self.blocks.clear();
            self.blocks.resize(tiles, None);
        }
        let before = tile_idx.checked_sub(1);
        let before = before.and_then(|i| Some(self.blocks[i].as_ref()?.needed));
        let block = self.blocks[tile_idx].get_or_insert_with(|| {
            let ball = ball_of(engine, tile_idx, row / BAND);
            let guess = match before {
                Some(needed) if needed < f64::INFINITY => ROOM * needed,
                _ => frame.first_guess(),
            };
            Block {
                within: ball.map_or(f64::INFINITY, |_| guess),
                ball,
                views: Vec::new(),
                stale: true,
                needed: 0.0,
            }
        });
        if block.stale {
            frame.views_within(block.ball.as_ref(), block.within, &mut block.views);
            block.stale = false;
        }
        &block.views
    }

    /// Whether a tile that needs views as different as `reach` had them all; if not, it asks for
    /// more next.
    pub(super) fn settles(&mut self, tile_idx: usize, reach: f32) -> bool {
        let Some(block) = &mut self.blocks[tile_idx] else {
            return false;
        };
        let needed = MARGIN * f64::from(reach);
        if needed <= block.within {
            block.needed = needed.max(block.needed);
            // The tiles below will hardly need more.
            if block.within > TOO_MUCH * block.needed {
                block.within = ROOM * block.needed;
                block.stale = true;
            }
            return true;
        }
        block.within = if needed < f64::INFINITY {
            ROOM * needed
        } else {
            wider(block.within)
        };
        block.stale = true;
        false
    }
}

/// What holds the proxy points of a block of pixels; `None` where one is at infinity.
fn ball_of(engine: &Engine<'_>, tile_idx: usize, band: usize) -> Option<Ball> {
    let desired = &engine.frame.desired;
    let rows = band * BAND..((band + 1) * BAND).min(desired.height as usize);
    let (mut least, mut most) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for row in rows {
        let tile = engine.tile(tile_idx * LANES, row, |_| true);
        for k in (0..LANES).filter(|&k| tile.s[k] >= 0.0) {
            let ray = DVec3::new(tile.x[k].into(), tile.y[k].into(), tile.z[k].into());
            let point = ray / f64::from(tile.s[k]);
            least = least.min(point);
            most = most.max(point);
        }
    }
    let center = 0.5 * (least + most);
    // Of nothing at all it is not finite either.
    let radius = 0.5 * (most - least).length() * (1.0 + 1e-5);
    (center.is_finite() && radius.is_finite()).then_some(Ball {
        center,
        radius,
        sight: radius,
    })
}
