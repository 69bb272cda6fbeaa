//! Small holes in a mesh, closed.

use super::Mesh;
use glam::DVec3;

/// Not on the way.
const NOWHERE: usize = usize::MAX;

impl Mesh {
    /// Closes holes whose border is no longer than `longest`, in world units, with triangles around
    /// the middle of the border; how many. The outer border of a piece is none: what closes it would look
    /// the other way.
    pub fn close_holes(&mut self, longest: f64) -> usize {
        // 1. Sides that one triangle has, by their first corner.
        let sides = |t: &[u32; 3]| [0, 1, 2].map(|k| (t[k], t[(k + 1) % 3]));
        let mut all: Vec<(u32, u32, u32)> = Vec::with_capacity(3 * self.triangles.len());
        for (i, triangle) in (0..).zip(&self.triangles) {
            all.extend(sides(triangle).map(|(a, b)| (a, b, i)));
        }
        all.sort_unstable();
        let has = |a: u32, b: u32| {
            let at = all.partition_point(|side| (side.0, side.1) < (a, b));
            all.get(at).is_some_and(|side| (side.0, side.1) == (a, b))
        };
        let open = all.iter().filter(|(a, b, _)| !has(*b, *a));
        let open: Vec<(u32, u32, u32)> = open.copied().collect();
        // 2. Simple loops of them: where a way comes to a corner again it has closed one.
        let mut is_done = vec![false; open.len()];
        let mut place = vec![NOWHERE; self.positions.len()];
        let mut closed = 0;
        for start in 0..open.len() {
            let mut way: Vec<(u32, u32, u32)> = Vec::new();
            let mut corner = open[start].0;
            loop {
                let from = place[corner as usize];
                if from != NOWHERE {
                    let border = way.split_off(from);
                    for side in &border {
                        place[side.0 as usize] = NOWHERE;
                    }
                    closed += usize::from(self.close(&border, longest));
                }
                let first = open.partition_point(|side| side.0 < corner);
                let sides = open[first..].iter().take_while(|side| side.0 == corner);
                let Some((i, side)) = (first..).zip(sides).find(|(i, _)| !is_done[*i]) else {
                    break;
                };
                is_done[i] = true;
                place[corner as usize] = way.len();
                way.push(*side);
                corner = side.1;
            }
            for side in &way {
                place[side.0 as usize] = NOWHERE;
            }
        }
        closed
    }

    /// Closes a loop of sides, given with their triangles, unless it is too long or what closes it
    /// would look the other way.
    fn close(&mut self, border: &[(u32, u32, u32)], longest: f64) -> bool {
        let position = |i: u32| self.positions[i as usize];
        let lengths = border
            .iter()
            .map(|(a, b, _)| position(*a).distance(position(*b)));
        if border.len() < 3 || !(lengths.sum::<f64>() <= longest) {
            return false;
        }
        let sum: DVec3 = border.iter().map(|(a, ..)| position(*a)).sum();
        let middle = sum / border.len() as f64;
        let facing: f64 = border
            .iter()
            .map(|(a, b, of)| {
                let lid = (position(*a) - position(*b)).cross(middle - position(*b));
                let [p, q, r] = self.corners(*of as usize);
                lid.dot((q - p).cross(r - p).normalize_or_zero())
            })
            .sum();
        if !(facing > 0.0 && middle.is_finite()) {
            return false;
        }
        if let [(a, ..), (b, ..), (c, ..)] = *border {
            self.triangles.push([a, c, b]);
            return true;
        }
        let center = self.positions.len() as u32;
        self.positions.push(middle);
        let lids = border.iter().map(|(a, b, _)| [*b, *a, center]);
        self.triangles.extend(lids);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of so many squares, two triangles each, counter-clockwise from above, but for some.
    fn grid(count: u32, is_there: impl Fn(u32, u32) -> bool) -> Mesh {
        let side = count + 1;
        let corners = (0..side * side).map(|i| (f64::from(i % side), f64::from(i / side)));
        let mut mesh = Mesh {
            positions: corners.map(|(x, y)| DVec3::new(x, y, 0.1 * x)).collect(),
            triangles: Vec::new(),
        };
        for (x, y) in (0..count * count).map(|i| (i % count, i / count)) {
            if is_there(x, y) {
                let a = y * side + x;
                let quad = [[a, a + 1, a + side + 1], [a, a + side + 1, a + side]];
                mesh.triangles.extend(quad);
            }
        }
        mesh
    }

    fn area(mesh: &Mesh) -> DVec3 {
        let corners = (0..mesh.triangles.len()).map(|i| mesh.corners(i));
        corners.map(|[a, b, c]| 0.5 * (b - a).cross(c - a)).sum()
    }

    #[test]
    fn small_holes_are_closed_and_nothing_else() {
        let whole = grid(8, |_, _| true);
        // A hole of one square, and one of 2 × 3.
        let is_there = |x, y| (x, y) != (1, 1) && !((4..6).contains(&x) && (3..6).contains(&y));
        let holed = grid(8, is_there);
        let mut some = holed.clone();
        assert_eq!(some.close_holes(5.0), 1);
        let mut all = holed.clone();
        assert_eq!(all.close_holes(12.0), 2);
        assert!((area(&all) - area(&whole)).length() < 1e-9);
        assert!((area(&whole) - area(&some)).z > 5.9);
        // The square's own border is long, but is none even if all is allowed.
        assert_eq!(all.clone().close_holes(1e9), 0);
        assert_eq!(whole.clone().close_holes(1e9), 0);
        // Again there is nothing to do.
        assert_eq!(all.close_holes(12.0), 0);
    }

    #[test]
    fn odd_meshes_do_no_harm() {
        assert_eq!(Mesh::default().close_holes(1.0), 0);
        let mut flat = Mesh {
            positions: vec![DVec3::ZERO; 3],
            triangles: vec![[0, 1, 2], [0, 0, 1]],
        };
        assert_eq!(flat.close_holes(1.0), 0);
        let mut lost = Mesh {
            positions: vec![DVec3::NAN, DVec3::X, DVec3::Y],
            triangles: vec![[0, 1, 2]],
        };
        assert_eq!(lost.close_holes(1.0), 0);
        // Two holes that share a corner.
        let mut touching = grid(4, |x, y| (x, y) != (1, 1) && (x, y) != (2, 2));
        let whole = grid(4, |_, _| true);
        assert_eq!(touching.close_holes(100.0), 2);
        assert!((area(&touching) - area(&whole)).length() < 1e-9);
    }
}
