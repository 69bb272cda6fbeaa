//! Where the floor grid is, and how fine.

use super::columns::{EYE_BAND, REACH};
use super::{Evidence, FindError, FindOptions, Level};
use crate::interior::clip;
use glam::{DVec2, DVec3};
use rayon::prelude::*;

/// Squares of the floor grid.
const MOST_COLUMNS: f64 = 4e6;
/// Squares around what is there, for what grows out of rooms.
const MARGIN: f64 = 12.0;
/// Of what lies around all that stands at eye height so much is within the grid, in widest passages:
/// nowhere is it as narrow as one, which would part it.
const AROUND: f64 = 2.0;

/// Squares on the plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Grid {
    /// Along both axes.
    pub(super) size: [usize; 2],
    /// Of the first square's first corner, in the level's frame.
    pub(super) origin: DVec2,
    /// The squares' side, in world units.
    pub(super) step: f64,
}

/// The least and the greatest of places on the plan.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Extent {
    low: DVec2,
    high: DVec2,
}

impl Extent {
    const NONE: Self = Self {
        low: DVec2::INFINITY,
        high: DVec2::NEG_INFINITY,
    };

    fn of<'a>(points: impl IntoIterator<Item = &'a DVec3>) -> Self {
        let one = |p: &DVec3| Self {
            low: p.truncate(),
            high: p.truncate(),
        };
        let all = points.into_iter().map(one);
        all.fold(Self::NONE, Self::with)
    }

    fn with(self, other: Self) -> Self {
        Self {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
        }
    }
}

impl Grid {
    /// Over all that is near what reaches to eye height: level ground encloses nothing, however far it
    /// goes. `places` are the mesh's corners in the level's frame. Squares are larger than asked for
    /// where there would be too many.
    pub(super) fn new(
        evidence: &Evidence,
        places: &[DVec3],
        level: &Level,
        options: &FindOptions,
    ) -> Result<Self, FindError> {
        // 1. What there is, and what of it one cannot look over, or was looked through.
        let [lowest, highest] = REACH.map(|h| h * options.meter);
        let in_reach = |p: &&DVec3| p.is_finite() && p.z > lowest && p.z < highest;
        let all = Extent::of(places.iter().filter(in_reach));
        if !(all.high - all.low).is_finite() {
            return Err(FindError::NoSurface);
        }
        let band = EYE_BAND.map(|h| h * options.meter);
        let triangles = evidence.mesh.triangles.par_iter();
        let triangles = triangles.map(|t| in_band(&t.map(|i| places[i as usize]), band));
        let sights = evidence.sights.par_iter();
        let sights = sights.map(|ends| in_band(&ends.map(|p| level.to_level(p)), band));
        let upright = triangles.chain(sights);
        let upright = upright.reduce(|| Extent::NONE, Extent::with);
        // 2. The one, as far as it is around the other.
        let around = DVec2::splat(AROUND * options.max_passage * options.meter);
        let low = all.low.max(upright.low - around);
        let extent = all.high.min(upright.high + around) - low;
        if !(extent.min_element() >= 0.0) {
            return Err(FindError::NoRooms(options.min_area, options.meter));
        }
        // 3. How fine.
        let vast = (extent.x * extent.y / MOST_COLUMNS).sqrt();
        let long = extent.max_element() / MOST_COLUMNS.sqrt() / 4.0;
        if vast.max(long) > options.max_passage * options.meter {
            // Kilometres: no square is as narrow as a passage between two rooms.
            return Err(FindError::NoRooms(options.min_area, options.meter));
        }
        let step = (options.cell_size * options.meter).max(vast).max(long);
        let size = [extent.x, extent.y].map(|e| (e / step + 2.0 * MARGIN).ceil() as usize);
        Ok(Self {
            size,
            origin: low - MARGIN * step,
            step,
        })
    }

    /// Its last square's last corner.
    fn end(&self) -> DVec2 {
        let size = DVec2::new(self.size[0] as f64, self.size[1] as f64);
        self.origin + size * self.step
    }

    /// Whether all of a triangle is over it.
    pub(super) fn has(&self, corners: &[DVec3; 3]) -> bool {
        let end = self.end();
        corners.iter().all(|p| {
            let at = p.truncate();
            at.cmpge(self.origin).all() && at.cmple(end).all()
        })
    }

    /// The part of a triangle over it, in triangles.
    pub(super) fn part_of(&self, corners: [DVec3; 3]) -> Vec<[DVec3; 3]> {
        let (low, high) = (self.origin, self.end());
        let mut part = corners.to_vec();
        for k in 0..2 {
            part = clip(&part, |p| p[k] - low[k]);
            part = clip(&part, |p| high[k] - p[k]);
        }
        let fan = 1..part.len().saturating_sub(1);
        fan.map(|i| [part[0], part[i], part[i + 1]]).collect()
    }
}

/// What of a triangle or a line is between two heights.
fn in_band(corners: &[DVec3], [low, high]: [f64; 2]) -> Extent {
    let is_off = corners.iter().all(|p| p.z < low)
        || corners.iter().all(|p| p.z > high)
        || !corners.iter().all(|p| p.is_finite());
    if is_off {
        return Extent::NONE;
    }
    if corners.iter().all(|p| p.z >= low && p.z <= high) {
        return Extent::of(corners);
    }
    let part = clip(corners, |p| p.z - low);
    Extent::of(&clip(&part, |p| high - p.z))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Mesh;
    use glam::DMat3;

    /// Up is the third axis, and the floor is at 0.
    const LEVEL: Level = Level {
        origin: DVec3::ZERO,
        world_from_level: DMat3::IDENTITY,
    };

    /// The grid for some triangles.
    fn grid(triangles: &[[[f64; 3]; 3]]) -> Result<Grid, FindError> {
        let corners = triangles.as_flattened().iter();
        let count = triangles.len() as u32;
        let mesh = Mesh {
            positions: corners.map(|p| DVec3::from_array(*p)).collect(),
            triangles: (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
        };
        let evidence = Evidence {
            mesh: &mesh,
            cameras: &[],
            sights: &[],
        };
        Grid::new(&evidence, &mesh.positions, &LEVEL, &FindOptions::default())
    }

    const WALL: [[f64; 3]; 3] = [[0.0, 0.0, 0.0], [8.0, 6.0, 0.0], [0.0, 0.0, 2.5]];

    /// Ground that reaches so far.
    fn ground(reach: f64) -> [[f64; 3]; 3] {
        [
            [-reach, -reach, 0.0],
            [reach, -reach, 0.0],
            [0.0, reach, 0.0],
        ]
    }

    #[test]
    fn it_reaches_as_far_as_what_stands_at_eye_height_and_around_it() {
        // At 1.3 m the wall is still 8 · (1 − 1.3 / 2.5) = 3.84 m long.
        let found = grid(&[WALL, ground(400.0)]).unwrap();
        assert_eq!(found.step, 0.05);
        let most = [3.84_f64, 2.88].map(|e| ((e + 8.8) / 0.05 + 24.0).ceil() as usize);
        assert!(found.size[0].abs_diff(most[0]) <= 1 && found.size[1].abs_diff(most[1]) <= 1);
        assert!((found.origin - DVec2::splat(-4.4 - 0.6)).length() < 1e-9);
        // No farther than there is anything.
        let found = grid(&[WALL, ground(1.0)]).unwrap();
        assert!((found.origin - DVec2::splat(-1.0 - 0.6)).length() < 1e-9);
        let none = FindError::NoRooms(1.5, 1.0);
        assert_eq!(grid(&[ground(400.0)]), Err(none));
    }

    #[test]
    fn squares_are_larger_where_there_would_be_too_many() {
        let long = WALL.map(|[x, y, z]| [200.0 * x, y, z]);
        let found = grid(&[long]).unwrap();
        assert!(found.step > 0.05 && found.size[0] * found.size[1] < 5_000_000);
        let vast = WALL.map(|[x, y, z]| [1e5 * x, y, z]);
        assert!(grid(&[vast]).is_err());
    }

    #[test]
    fn parts_of_triangles_cover_what_of_them_is_over_it() {
        let grid = Grid {
            size: [40, 20],
            origin: DVec2::ZERO,
            step: 0.1,
        };
        let area = |parts: &[[DVec3; 3]]| -> f64 {
            let twice = |t: &[DVec3; 3]| (t[1] - t[0]).cross(t[2] - t[0]).length();
            0.5 * parts.iter().map(twice).sum::<f64>()
        };
        let far = ground(1000.0).map(DVec3::from_array);
        assert!(!grid.has(&far));
        assert!((area(&grid.part_of(far)) - 8.0).abs() < 1e-9);
        let within = [[0.0, 0.0, 1.0], [4.0, 0.0, 1.0], [4.0, 2.0, 1.0]].map(DVec3::from_array);
        assert!(grid.has(&within));
        assert!((area(&grid.part_of(within)) - 4.0).abs() < 1e-9);
        let beside = within.map(|p| p + DVec3::X * 9.0);
        assert!(grid.part_of(beside).is_empty());
    }
}
