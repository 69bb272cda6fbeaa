//! Walking at eye height: walls stop one, openings let one through.
//!
//! Seen from above, whatever reaches into the band between half the eyes' height and the eyes is cut
//! into line segments, and who walks is a disc that they keep out. A doorway is where there are
//! none. Who came to be in something that is only as high as what stands on tables is let out of it.

mod enclosed;
mod squares;
mod standing;

use glam::{DVec2, DVec3};
use proxy::interior::{CellId, Contents, Interior};
use proxy::mesh::Model;
use squares::Squares;

/// Heights at which things are cut, in eye heights over the floor. Tables and beds are lower:
/// walking through them is better than being caught between them; hatches are not walked through.
const CUTS: [f64; 3] = [0.5, 0.7, 0.9];
/// How wide who walks is, in eye heights: 22 cm about an axis at 1.6 m.
const RADIUS: f64 = 0.14;

/// What of an interior's model is in the way.
#[derive(Clone, Debug)]
pub struct Obstacles {
    up: DVec3,
    /// What lies across `up`.
    axes: [DVec3; 2],
    eye_height: f64,
    radius: f64,
    /// From the lowest.
    floors: Vec<Floor>,
    /// How high each cell's floor is, along `up`.
    floor_of_cell: Vec<Option<f64>>,
}

#[derive(Clone, Debug)]
struct Floor {
    height: f64,
    /// What is in the way, seen from above.
    squares: Squares,
    /// What of it is cut higher than what stands on tables: walls and cupboards are.
    higher: Squares,
}

impl Obstacles {
    /// Cuts the model.
    pub fn new(interior: &Interior, contents: &Contents, model: &Model) -> Self {
        let up = interior.up;
        let across = up.any_orthonormal_vector();
        let eye_height = interior.eye_height.abs().max(1e-9);
        let ids = (0..interior.cells.len() as u32).map(CellId);
        let floor_of_cell: Vec<Option<f64>> =
            ids.map(|id| contents.floor_of(interior, id)).collect();
        let mut walker = Self {
            up,
            axes: [across, up.cross(across)],
            eye_height,
            radius: RADIUS * eye_height,
            floors: Vec::new(),
            floor_of_cell,
        };
        // Cells whose floors are alike share one.
        let mut heights: Vec<f64> = walker.floor_of_cell.iter().flatten().copied().collect();
        heights.sort_by(f64::total_cmp);
        heights.dedup_by(|a, b| (*a - *b).abs() < 0.05 * eye_height);
        for height in heights {
            let floor = walker.cut(height, contents, model);
            walker.floors.push(floor);
        }
        walker
    }

    fn cut(&self, height: f64, contents: &Contents, model: &Model) -> Floor {
        let (mut segments, mut higher) = (Vec::new(), Vec::new());
        let lists = contents.triangles.iter().chain([&contents.elsewhere]);
        for i in lists.flatten() {
            let corners = model.mesh.corners(*i as usize);
            let heights = corners.map(|p| p.dot(self.up) - height);
            for (k, cut) in CUTS.iter().enumerate() {
                if let Some(ends) = cut_triangle(corners, heights, cut * self.eye_height) {
                    let ends = ends.map(|p| self.seen_from_above(p));
                    segments.push(ends);
                    higher.extend((k > 0).then_some(ends));
                }
            }
        }
        Floor {
            height,
            squares: Squares::new(segments, self.radius),
            higher: Squares::new(higher, self.radius),
        }
    }

    fn seen_from_above(&self, point: DVec3) -> DVec2 {
        DVec2::new(point.dot(self.axes[0]), point.dot(self.axes[1]))
    }

    /// Who walks' radius, in world units.
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// Where the eyes are over the floor of a cell.
    pub fn at_eye_height(&self, cell: Option<CellId>, eye: DVec3) -> DVec3 {
        match self.height_of(cell) {
            Some(floor) => eye + self.up * (floor + self.eye_height - eye.dot(self.up)),
            None => eye,
        }
    }

    /// Where one arrives who stands at `eye` in a cell and goes by `motion`, of which only what
    /// is level counts: along walls, where they are in the way. In short steps, so that no wall
    /// is jumped.
    pub fn walk(&self, cell: Option<CellId>, eye: DVec3, motion: DVec3) -> DVec3 {
        let level = self.seen_from_above(motion);
        let length = level.length();
        if !(length > 0.0) || !length.is_finite() {
            return eye;
        }
        let Some(floor) = self.floor_of(cell).or_else(|| self.floor_below(eye)) else {
            return eye + motion - self.up * motion.dot(self.up);
        };
        let steps = (length / (0.4 * self.radius)).ceil().clamp(1.0, 10_000.0);
        let start = self.seen_from_above(eye);
        let mut at = start;
        for _ in 0..steps as usize {
            let next = self.kept_out(floor, at, at + level / steps);
            if next == at {
                break;
            }
            at = next;
        }
        let moved = at - start;
        eye + self.axes[0] * moved.x + self.axes[1] * moved.y
    }

    /// One short step from `from` towards `to`: the nearest place with room for who walks. None
    /// found, or one behind a wall: no step.
    fn kept_out(&self, floor: &Floor, from: DVec2, to: DVec2) -> DVec2 {
        // Who stands in what is on a table is let out of it.
        let squares = match self.is_enclosed(&floor.squares, from) {
            true => &floor.higher,
            false => &floor.squares,
        };
        let mut at = to;
        for _ in 0..8 {
            let Some((on, distance)) = nearest(squares, at) else {
                break;
            };
            if distance >= self.radius * (1.0 - 1e-9) {
                break;
            }
            at = on + (at - on).normalize_or_zero() * self.radius;
        }
        // Who stands where there is too little room may still go where there is more.
        let enough = self.room(squares, from).min(0.99 * self.radius);
        let is_free = self.room(squares, at) >= enough && !self.crosses(squares, [from, at]);
        if is_free { at } else { from }
    }

    /// How far away the nearest thing is; infinitely, where nothing is near.
    fn room(&self, squares: &Squares, at: DVec2) -> f64 {
        nearest(squares, at).map_or(f64::INFINITY, |near| near.1)
    }

    fn crosses(&self, squares: &Squares, [a, b]: [DVec2; 2]) -> bool {
        let side = |p: DVec2, q: DVec2, r: DVec2| (q - p).perp_dot(r - p);
        squares.near(a).iter().any(|&[c, d]| {
            side(a, b, c) * side(a, b, d) < 0.0 && side(c, d, a) * side(c, d, b) <= 0.0
        })
    }

    /// How high a cell's floor is, along `up`.
    fn height_of(&self, cell: Option<CellId>) -> Option<f64> {
        self.floor_of_cell.get(cell?.0 as usize).copied().flatten()
    }

    /// A cell's floor, whatever other floors are under the eyes: one of another room may be only a
    /// few steps higher.
    fn floor_of(&self, cell: Option<CellId>) -> Option<&Floor> {
        let height = self.height_of(cell)?;
        let off = |f: &Floor| (f.height - height).abs();
        self.floors.iter().min_by(|a, b| off(a).total_cmp(&off(b)))
    }

    /// The highest floor under the eyes.
    fn floor_below(&self, eye: DVec3) -> Option<&Floor> {
        let height = eye.dot(self.up);
        let below = |f: &&Floor| f.height <= height - 0.3 * self.eye_height;
        self.floors.iter().rev().find(below)
    }
}

/// Where a triangle meets a level; `heights` are its corners'.
fn cut_triangle(corners: [DVec3; 3], heights: [f64; 3], level: f64) -> Option<[DVec3; 2]> {
    let mut ends = [DVec3::ZERO; 2];
    let mut count = 0;
    for i in 0..3 {
        let j = (i + 1) % 3;
        let (a, b) = (heights[i] - level, heights[j] - level);
        // Each crossing once: a corner on the level counts as above.
        if (a < 0.0) != (b < 0.0) && count < 2 {
            ends[count] = corners[i].lerp(corners[j], a / (a - b));
            count += 1;
        }
    }
    let is_usable = count == 2 && ends.iter().all(|p| p.is_finite());
    is_usable.then_some(ends)
}

/// The nearest point of what is in the way, and how far away it is.
fn nearest(squares: &Squares, point: DVec2) -> Option<(DVec2, f64)> {
    let on = squares
        .near(point)
        .iter()
        .map(|ends| nearest_on(*ends, point));
    let with_distance = on.map(|p| (p, p.distance(point)));
    with_distance.min_by(|a, b| a.1.total_cmp(&b.1))
}

fn nearest_on([a, b]: [DVec2; 2], point: DVec2) -> DVec2 {
    let along = b - a;
    let squared = along.length_squared();
    if squared > 0.0 {
        a + along * ((point - a).dot(along) / squared).clamp(0.0, 1.0)
    } else {
        a
    }
}

#[cfg(test)]
mod tests;
