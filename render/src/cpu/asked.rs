//! Which source views a tile of pixels is to ask.

use super::lanes::{LANES, vectorised};
use super::source::Tile;
use crate::frame::Frame;
use crate::near::wider;
use crate::view_tree::{Apart, Around, Ball};
use glam::{DVec3, Vec3};

/// For a thread: what it knows of the source views that the tiles of a block of pixels need. What it
/// knows changes time alone: views that matter are always among those that are asked in the end.
#[derive(Default)]
pub(super) struct Asked {
    /// Where the block's proxy points are; `None` where one is at infinity.
    around: Option<Ball>,
    /// The views that may differ by `covered` or less there.
    known: Around,
    covered: f64,
    /// By how much those differ that the next tile may need.
    guess: f64,
    views: Vec<(f32, u32)>,
}

/// Over what a tile needed, for rounding to f32.
const MARGIN: f64 = 1.001;
/// And for the next tile.
const ROOM: f64 = 1.1;
/// What rounding to f32 is taken to lower an angle by, in radians, however small.
const NOISE: f32 = 1e-6;

/// What a difference may be in f32 that is at least so much.
pub(super) fn in_f32(least: f32) -> f32 {
    least / MARGIN as f32 - NOISE
}

impl Asked {
    /// Forgets what it knows: for the first block of some.
    pub(super) fn forget(&mut self, frame: &Frame<'_>) {
        self.guess = frame.first_guess();
    }

    /// Goes on to the next block, by what is around its tiles' points.
    pub(super) fn enter(&mut self, block: Option<Ball>) {
        self.around = block;
        self.covered = f64::NEG_INFINITY;
    }

    /// Of a tile of the block, the difference within which to ask first.
    pub(super) fn first(&self, tile: Option<&Ball>) -> f64 {
        tile.map_or(f64::INFINITY, |_| self.guess)
    }

    /// The views that may differ by `within` or less in a tile of the block: by how much at least, and their
    /// indices. Those that may differ least come first. Where no view is to be passed over, all.
    pub(super) fn views(
        &mut self,
        frame: &Frame<'_>,
        tile: Option<&Ball>,
        within: f64,
    ) -> &[(f32, u32)] {
        let Some(tile) = tile.filter(|_| frame.may_skip()) else {
            self.views.clear();
            let all = frame.taking_part().map(|i| (0.0, i as u32));
            self.views.extend(all);
            return &self.views;
        };
        match &self.around {
            Some(around) if within > self.covered => {
                // With room for what its other tiles need.
                self.covered = ROOM * within;
                frame.views_around(around, self.covered, &mut self.known);
            }
            Some(_) => {}
            None => frame.views_around(tile, within, &mut self.known),
        }
        let measure = frame.measure();
        self.known.within(tile, measure, within, &mut self.views);
        &self.views
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
    fn ball(&self) -> Option<Ball> {
        let (least, most): (DVec3, DVec3) = (self.least.into(), self.most.into());
        let center = 0.5 * (least + most);
        let radius = 0.5 * (most - least).length();
        let radius = radius + ROUNDING * (center.length() + radius);
        // Of nothing at all it is not finite either.
        (center.is_finite() && radius.is_finite()).then_some(Ball {
            center,
            radius,
            sight: radius,
            apart: Apart::UNKNOWN,
        })
    }

    /// What holds a tile's proxy points, which it is around.
    pub(super) fn ball_of(&self, tile: &Tile) -> Option<Ball> {
        let ball = self.ball()?;
        let here = ball.center.length();
        let towards = (ball.center / here).as_vec3();
        // How far they are from the middle: as chords of a unit's sphere, and in distance. They are not
        // negative: in order as their bits are.
        let (mut chord, mut along) = (0_u32, 0_u32);
        vectorised(
            #[inline(always)]
            || {
                for k in 0..LANES {
                    let (x, y, z, s) = (tile.x[k], tile.y[k], tile.z[k], tile.s[k]);
                    let length = (x * x + y * y + z * z).sqrt();
                    let scale = 1.0 / length;
                    let (dx, dy, dz) = (
                        x * scale - towards.x,
                        y * scale - towards.y,
                        z * scale - towards.z,
                    );
                    let squared = dx * dx + dy * dy + dz * dz;
                    let off = (length / s - here as f32).abs();
                    let is_there = s >= 0.0;
                    chord = chord.max(if is_there { squared.to_bits() } else { 0 });
                    along = along.max(if is_there { off.to_bits() } else { 0 });
                }
            },
        );
        let chord = f64::from(f32::from_bits(chord)).sqrt() + ROUNDING;
        let along = f64::from(f32::from_bits(along)) + ROUNDING * (here + ball.radius);
        Some(Ball {
            apart: Apart {
                aside: more_than_angle(chord),
                along,
            },
            ..ball
        })
    }

    /// What holds all that it is around: these balls, of tiles. `None` where one goes to infinity.
    pub(super) fn ball_of_all(&self, tiles: &[Option<Ball>]) -> Option<Ball> {
        let ball = self.ball()?;
        let here = ball.center.length();
        let towards = ball.center / here;
        let mut apart = Apart {
            aside: 0.0,
            along: 0.0,
        };
        for tile in tiles.iter().flatten() {
            let there = tile.center.length();
            let chord = towards.distance(tile.center / there) + ROUNDING;
            let aside = more_than_angle(chord) + tile.apart.aside;
            let along = (here - there).abs() + tile.apart.along;
            apart = Apart {
                aside: apart.aside.max(aside),
                along: apart.along.max(along),
            };
        }
        Some(Ball { apart, ..ball })
    }
}

/// What rounding to f32 makes of a point, relative to its distance.
const ROUNDING: f64 = 1e-6;

/// At least the angle between directions so far apart, as points of a unit's sphere; infinite where that is
/// much.
fn more_than_angle(chord: f64) -> f64 {
    // 2 asin(c/2) = c + c³/24 + …, of which the rest is less than a fifth up to one.
    if chord < 1.0 {
        chord * (1.0 + 0.05 * chord * chord)
    } else {
        f64::INFINITY
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
        let of = |tile: &Tile| Extent::of(tile).ball_of(tile).unwrap();
        let ball = of(&tile(&points));
        let here = ball.center.length();
        for [x, y, z, s] in points.map(|point| point.map(f64::from)) {
            let point = DVec3::new(x, y, z) / s;
            let distance = point.distance(ball.center);
            assert!(distance <= ball.radius && ball.radius < 3.0);
            let Apart { aside, along } = ball.apart;
            let angle = point.angle_between(ball.center);
            assert!(angle <= aside && aside < 1.5, "{angle}, {aside}");
            let off = (point.length() - here).abs();
            assert!(off <= along && along < 3.0, "{off}, {along}");
        }
        let more = tile(&[[3.0, 0.0, 1.0, 1.0]]);
        let extent = Extent::of(&tile(&points)).and(Extent::of(&more));
        let both = extent.ball_of_all(&[Some(ball), Some(of(&more)), None]);
        let both = both.unwrap();
        assert!(both.radius > ball.radius);
        for point in [DVec3::new(3.0, 0.0, 1.0), DVec3::new(-0.3, 0.1, 1.0) / 0.25] {
            assert!(point.angle_between(both.center) <= both.apart.aside);
            let off = (point.length() - both.center.length()).abs();
            assert!(off <= both.apart.along && both.apart.along < 5.0);
        }
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
            assert!(with_others.ball_of_all(&[]).is_none(), "{ray:?}");
        }
    }
}
