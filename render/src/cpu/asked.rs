//! Which source views a tile of pixels is to ask.

use super::lanes::{LANES, vectorised};
use super::source::Tile;
use crate::frame::Frame;
use crate::near::wider;
use crate::view_tree::Ball;
use glam::{DVec3, Vec3};

/// For a thread: what it knows of the source views that the tiles of a block of pixels need. What it
/// knows changes time alone: views that matter are always among those that are asked in the end.
#[derive(Default)]
pub(super) struct Asked {
    /// Where the block's proxy points are; `None` where one is at infinity.
    around: Option<Ball>,
    /// Those groups of views in which all are that differ by `covered` or less there.
    groups: Vec<u32>,
    covered: f64,
    /// By how much those differ that the next tile may need.
    guess: f64,
    views: Vec<u32>,
}

/// Over what a tile needed, for rounding to f32.
const MARGIN: f64 = 1.001;
/// And for the next tile.
const ROOM: f64 = 1.1;

impl Asked {
    /// Forgets what it knows: for the first block of some.
    pub(super) fn forget(&mut self, frame: &Frame<'_>) {
        self.guess = frame.first_guess();
    }

    /// Goes on to the next block, by where its tiles' points are.
    pub(super) fn enter(&mut self, block: Extent) {
        self.around = block.ball();
        self.covered = f64::NEG_INFINITY;
    }

    /// Of a tile of the block, the difference within which to ask first.
    pub(super) fn first(&self, tile: Option<&Ball>) -> f64 {
        tile.map_or(f64::INFINITY, |_| self.guess)
    }

    /// The views, by index, that may differ by `within` or less in a tile of the block.
    pub(super) fn views(&mut self, frame: &Frame<'_>, tile: Option<&Ball>, within: f64) -> &[u32] {
        let views = &mut self.views;
        match (&self.around, tile) {
            (Some(around), Some(tile)) => {
                if within > self.covered {
                    // With room for what its other tiles need.
                    self.covered = ROOM * within;
                    frame.groups_within(around, self.covered, &mut self.groups);
                }
                frame.views_of_groups(&self.groups, tile, within, views);
            }
            _ => frame.views_within(tile, within, views),
        }
        views
    }

    /// Learns that a tile, having asked `within` a difference, needs views as different as `reach`.
    ///
    /// # Errors
    /// It did not have them all: the difference within which to ask next.
    pub(super) fn settles(&mut self, within: f64, reach: f32) -> Result<(), f64> {
        let needed = MARGIN * f64::from(reach);
        if needed > within {
            // More views can only lower what is needed.
            return Err(wider(within).min(ROOM * needed));
        }
        if needed < f64::INFINITY {
            self.guess = ROOM * needed;
        }
        Ok(())
    }
}

/// A box around points in the desired camera's frame; of none at all it is empty.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent {
    least: Vec3,
    most: Vec3,
}

impl Extent {
    /// Around none.
    pub(super) const EMPTY: Self = Self {
        least: Vec3::INFINITY,
        most: Vec3::NEG_INFINITY,
    };

    /// Around a tile's proxy points.
    pub(super) fn of(tile: &Tile) -> Self {
        vectorised(
            #[inline(always)]
            || {
                let along = |ray: &[f32; LANES]| {
                    let (mut least, mut most) = ([f32::INFINITY; 8], [f32::NEG_INFINITY; 8]);
                    for k in 0..LANES {
                        let there = ray[k] / tile.s[k];
                        let is_there = tile.s[k] >= 0.0;
                        let low = if is_there { there } else { f32::INFINITY };
                        let high = if is_there { there } else { f32::NEG_INFINITY };
                        least[k % 8] = least[k % 8].min(low);
                        most[k % 8] = most[k % 8].max(high);
                    }
                    let least = least.into_iter().fold(f32::INFINITY, f32::min);
                    (least, most.into_iter().fold(f32::NEG_INFINITY, f32::max))
                };
                let (x, y, z) = (along(&tile.x), along(&tile.y), along(&tile.z));
                Self {
                    least: Vec3::new(x.0, y.0, z.0),
                    most: Vec3::new(x.1, y.1, z.1),
                }
            },
        )
    }

    /// Around two.
    pub(super) fn and(self, other: Self) -> Self {
        Self {
            least: self.least.min(other.least),
            most: self.most.max(other.most),
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        // Of points at infinity some coordinates are no numbers, but not all.
        self.least.cmpgt(self.most).all()
    }

    /// What holds all that it is around; `None` where that goes to infinity.
    pub(super) fn ball(&self) -> Option<Ball> {
        /// What rounding to f32 makes of a point, relative to its distance.
        const ROUNDING: f64 = 1e-6;
        let (least, most): (DVec3, DVec3) = (self.least.into(), self.most.into());
        let center = 0.5 * (least + most);
        let radius = 0.5 * (most - least).length();
        let radius = radius + ROUNDING * (center.length() + radius);
        // Of nothing at all it is not finite either.
        (center.is_finite() && radius.is_finite()).then_some(Ball {
            center,
            radius,
            sight: radius,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tile(points: &[[f32; 4]]) -> Tile {
        let mut tile = Tile::nothing();
        for (k, &[x, y, z, s]) in points.iter().enumerate() {
            (tile.x[k], tile.y[k], tile.z[k], tile.s[k]) = (x, y, z, s);
        }
        tile
    }

    #[test]
    fn balls_hold_their_tiles_points() {
        let points = [
            [0.1, 0.2, 1.0, 0.5],
            [-0.3, 0.1, 1.0, 0.25],
            [0.0, 0.7, 1.0, 2.0],
        ];
        let ball = Extent::of(&tile(&points)).ball().unwrap();
        for [x, y, z, s] in points.map(|point| point.map(f64::from)) {
            let distance = (DVec3::new(x, y, z) / s).distance(ball.center);
            assert!(distance <= ball.radius && ball.radius < 3.0);
        }
        let more = Extent::of(&tile(&[[9.0, 0.0, 1.0, 1.0]]));
        let both = Extent::of(&tile(&points)).and(more).ball().unwrap();
        assert!(both.radius > ball.radius);
    }

    #[test]
    fn what_is_at_infinity_has_no_ball_but_is_there() {
        assert!(Extent::of(&Tile::nothing()).is_empty());
        assert!(Extent::EMPTY.is_empty() && Extent::EMPTY.ball().is_none());
        for ray in [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, -2.0, 0.5]] {
            let [x, y, z] = ray;
            let extent = Extent::of(&tile(&[[x, y, z, 0.0]]));
            assert!(!extent.is_empty() && extent.ball().is_none(), "{ray:?}");
            let with_others = extent.and(Extent::of(&tile(&[[0.1, 0.2, 1.0, 0.5]])));
            assert!(with_others.ball().is_none(), "{ray:?}");
        }
    }
}
