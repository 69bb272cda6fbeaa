//! Meshes that their files' numbers are too coarse for.

use super::Mesh;
use std::fmt;

/// How coarse the numbers are that a mesh was stored in.
///
/// Whatever a file holds, 32-bit floating-point numbers or few digits, is seen by the coordinates themselves: numbers of 64
/// bits that somebody measured are hardly ever such of 32.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coarse {
    /// The greatest distance of a corner from the origin along an axis.
    farthest: f64,
    /// How far apart two numbers of 32 bits are there.
    step: f64,
    /// The median length of edges.
    edge: f64,
}

/// Steps above this share of an edge make another shape of it.
const LEAST_STEP: f64 = 0.05;

impl Coarse {
    /// `None` of a mesh whose coordinates are as fine as its edges need.
    pub fn of(mesh: &Mesh) -> Option<Self> {
        let coordinates = || mesh.positions.iter().flat_map(|p| p.to_array());
        let is_short = |x: f64| f64::from(x as f32) == x;
        if mesh.triangles.is_empty() || !coordinates().all(is_short) {
            return None;
        }
        let farthest = coordinates().map(f64::abs).fold(0.0, f64::max) as f32;
        let step = f64::from(farthest.next_up()) - f64::from(farthest);
        let edges = || {
            (0..mesh.triangles.len()).flat_map(|i| {
                let [a, b, c] = mesh.corners(i);
                [a.distance(b), b.distance(c), c.distance(a)]
            })
        };
        let short = edges().filter(|edge| step > LEAST_STEP * edge).count();
        if 2 * short <= 3 * mesh.triangles.len() {
            return None;
        }
        let mut edges: Vec<f64> = edges().collect();
        let middle = edges.len() / 2;
        let edge = *edges.select_nth_unstable_by(middle, f64::total_cmp).1;
        Some(Self {
            farthest: f64::from(farthest),
            step,
            edge,
        })
    }
}

impl fmt::Display for Coarse {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [farthest, step, edge] = [self.farthest, self.step, self.edge].map(crate::shown_number);
        write!(
            f,
            "its corners lie up to {farthest} from the origin, where its numbers are {step} apart or more, and its edges are \
             {edge} long (median): what it was stored in has lost its shape; export it around an origin of its own"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    /// A strip of triangles whose edges are about `edge` long, from a corner on.
    fn strip(from: DVec3, edge: f64) -> Mesh {
        let corner = |i: u32| {
            let (along, across) = (f64::from(i / 2), f64::from(i % 2));
            from + edge * DVec3::new(along, across, 0.1 * along.sin())
        };
        Mesh {
            positions: (0..40).map(corner).collect(),
            triangles: (0..38).map(|i| [i, i + 1, i + 2]).collect(),
        }
    }

    fn rounded(mut mesh: Mesh, by: impl Fn(f64) -> f64) -> Mesh {
        for p in &mut mesh.positions {
            *p = DVec3::from_array(p.to_array().map(&by));
        }
        mesh
    }

    #[test]
    fn shapes_that_their_numbers_have_lost_are_found() {
        let far = DVec3::new(500_000.0, 5_000_000.0, 100.0);
        let short = |x: f64| f64::from(x as f32);
        let coarse = Coarse::of(&rounded(strip(far, 0.3), short)).unwrap();
        assert_eq!(coarse.step, 0.5);
        // As many exporters write numbers: six digits.
        assert!(Coarse::of(&rounded(strip(far, 3.0), |x| (x / 10.0).round() * 10.0)).is_some());
        // All in one place.
        assert!(Coarse::of(&rounded(strip(far, 0.001), short)).is_some());
    }

    #[test]
    fn others_are_fine() {
        let far = DVec3::new(500_000.0, 5_000_000.0, 100.0);
        let short = |x: f64| f64::from(x as f32);
        assert_eq!(Coarse::of(&strip(far, 0.3)), None);
        assert_eq!(Coarse::of(&rounded(strip(far, 100.0), short)), None);
        assert_eq!(Coarse::of(&rounded(strip(DVec3::ONE, 0.001), short)), None);
        assert_eq!(Coarse::of(&strip(DVec3::ZERO, 1.0)), None);
        assert_eq!(Coarse::of(&Mesh::default()), None);
    }
}
