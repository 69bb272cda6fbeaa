//! The box around the way through a hallway (Buehler et al. 2001, §5, Hallway): "a six sided
//! rectangular tunnel that is roughly aligned with the hallway walls".
//!
//! Fitted to the sparse points and the cameras with nothing to click: the direction comes
//! from the path and from where cameras look, six walls from where the points are. Furniture
//! inside is left standing before the walls.

mod direction;
mod fit;
mod fitting;

use crate::Mesh;
use calibrate::Rigid3;
use glam::DVec3;

pub use fit::fit;

/// A box with the cameras inside, but for those far off the way of the others, which are taken
/// to be misplaced.
///
/// Its frame has x right, y down and z along the way, as a camera that walks through it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tunnel {
    /// Where the box lies.
    pub tunnel_from_world: Rigid3,
    /// The left wall, the ceiling and the near end, in the tunnel's frame.
    pub min: DVec3,
    /// The right wall, the floor and the far end.
    pub max: DVec3,
    /// How many points lie on each wall: left, ceiling, near end, right, floor, far end.
    /// Where next to none do, the wall was not found: it lies where the points end, and the
    /// ends of an open tunnel with it.
    pub points_on: [usize; 6],
    /// How many points the fit knew, outliers far from everything left out.
    pub points: usize,
    /// The share of those within [`ON_WALL`] of the surface.
    pub share_on_walls: f64,
    /// How far the cameras went along it, in world units.
    pub walked: f64,
    /// How many times as large errors of the points on its walls come out, at most; see
    /// [`crate::ILL_CONDITIONED`].
    pub condition: f64,
}

/// A point lies on a wall within this share of the mean of the tunnel's width and height.
pub const ON_WALL: f64 = 0.03;
/// A tunnel that is one has at least this share of its points on its walls: of the captures at
/// hand a corridor full of plants has a fifth.
const LEAST_SHARE: f64 = 0.15;
/// A wall that is one holds this share of the points.
const LEAST_WALL: f64 = 0.01;
/// Who takes a hallway for one walks at least this far along it, in means of width and height.
const LEAST_WALKED: f64 = 1.5;

/// Why there is no tunnel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TunnelError {
    /// No camera that the tunnel could be around.
    #[error("there is no photo with a finite pose to lay a tunnel around; import some first")]
    NoViews,
    /// Too few points to tell walls by.
    #[error(
        "a tunnel needs at least {expected} sparse points around the cameras, and there are \
         {found}; try the plane instead (`proxy SCENE plane`)"
    )]
    TooFewPoints {
        /// How many there are, far outliers left out.
        found: usize,
        /// How many it takes.
        expected: usize,
    },
    /// The points lie along a line, or in one place.
    #[error(
        "the sparse points lie on a line through the cameras, and tell no walls; try the plane \
         instead (`proxy SCENE plane`)"
    )]
    NoWalls,
}

impl Tunnel {
    /// From wall to wall, in world units.
    pub fn width(&self) -> f64 {
        self.max.x - self.min.x
    }

    /// From floor to ceiling, in world units.
    pub fn height(&self) -> f64 {
        self.max.y - self.min.y
    }

    /// From end to end, in world units.
    pub fn length(&self) -> f64 {
        self.max.z - self.min.z
    }

    /// How far a point is from the box's surface, in world units.
    pub fn distance(&self, point_in_world: DVec3) -> f64 {
        let point = self.tunnel_from_world * point_in_world;
        let beyond = (self.min - point).max(point - self.max);
        if beyond.max_element() <= 0.0 {
            -beyond.max_element()
        } else {
            beyond.max(DVec3::ZERO).length()
        }
    }

    /// Whether a point lies in the box or on it.
    pub fn contains(&self, point_in_world: DVec3) -> bool {
        let point = self.tunnel_from_world * point_in_world;
        point.cmpge(self.min).all() && point.cmple(self.max).all()
    }

    /// Whether the scene is a hallway, for a choice that nobody looks at: the cameras went
    /// along it, enough points lie on its walls, and both walls and floor or ceiling are among
    /// those found.
    pub fn is_hallway(&self) -> bool {
        let walked = self.walked >= LEAST_WALKED * 0.5 * (self.width() + self.height());
        let least = LEAST_WALL * self.points as f64;
        let found = self.points_on.map(|count| count as f64 >= least);
        let [left, ceiling, _, right, floor, _] = found;
        walked && self.share_on_walls >= LEAST_SHARE && left && right && (ceiling || floor)
    }

    /// The box as twelve triangles that face inwards. It is closed: every ray from inside
    /// meets it.
    pub fn mesh(&self) -> Mesh {
        let world_from_tunnel = self.tunnel_from_world.inverse();
        let corner = |i: usize| {
            let end = |axis: usize| match i >> axis & 1 {
                0 => self.min[axis],
                _ => self.max[axis],
            };
            world_from_tunnel * DVec3::new(end(0), end(1), end(2))
        };
        // Corner i has x, y and z of `max` where its bits 0, 1 and 2 are set. Each side in
        // the order in which it is counter-clockwise as seen from inside.
        const SIDES: [[u32; 4]; 6] = [
            [0, 2, 6, 4],
            [0, 4, 5, 1],
            [0, 1, 3, 2],
            [1, 5, 7, 3],
            [2, 3, 7, 6],
            [4, 6, 7, 5],
        ];
        Mesh {
            positions: (0..8).map(corner).collect(),
            triangles: SIDES
                .iter()
                .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
                .collect(),
        }
    }
}

#[cfg(test)]
mod tests;
