//! Meshes whose triangles follow one another as they lie in space.

use super::Mesh;
use glam::DVec3;
use rayon::prelude::*;

/// Digits of a coordinate that count: three of them fit a number.
const BITS: u32 = 21;

impl Mesh {
    /// The same with its triangles, and the corners as these first have them, along a curve through space (Morton 1966):
    /// what is near in space is near in memory, and the triangles that follow one another are in sight together, or not.
    /// Of triangles in one place the order stays; corners that no triangle has come last.
    pub(crate) fn along_a_curve(&self) -> Self {
        let Some((low, high)) = self.bounds() else {
            return self.clone();
        };
        // 1. Triangles.
        let side = (high - low).max_element();
        let place = |i: usize| {
            let [a, b, c] = self.corners(i);
            let share = ((a + b + c) / 3.0 - low) / side;
            code(share * f64::from((1_u32 << BITS) - 1))
        };
        let numbers = 0..self.triangles.len();
        let mut order: Vec<(u64, usize)> = numbers.into_par_iter().map(|i| (place(i), i)).collect();
        order.par_sort_unstable();
        // 2. Corners.
        let mut moved = vec![u32::MAX; self.positions.len()];
        let mut positions = Vec::with_capacity(self.positions.len());
        let mut to = |from: u32| {
            let moved = &mut moved[from as usize];
            if *moved == u32::MAX {
                *moved = positions.len() as u32;
                positions.push(self.positions[from as usize]);
            }
            *moved
        };
        let triangles = order.iter().map(|(_, i)| self.triangles[*i].map(&mut to));
        let triangles: Vec<[u32; 3]> = triangles.collect();
        (0..self.positions.len() as u32).for_each(|i| {
            to(i);
        });
        Self {
            positions,
            triangles,
        }
    }
}

/// Where on the curve a point of three whole numbers is; what is no number counts as zero.
fn code(point: DVec3) -> u64 {
    let coordinates = point.to_array().map(|v| v as u64);
    let bit = |k: u32| {
        let of = |axis: usize| (coordinates[axis] >> k & 1) << (3 * k + axis as u32);
        of(0) | of(1) | of(2)
    };
    (0..BITS).fold(0, |code, k| code | bit(k))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangles_and_corners_stay_and_what_is_near_comes_together() {
        // Squares of a plane, scattered, and a corner that nothing has.
        let side = 16_u32;
        let corner = |x: u32, y: u32| y * (side + 1) + x;
        let mut positions: Vec<DVec3> = (0..(side + 1) * (side + 1))
            .map(|i| DVec3::new(f64::from(i % (side + 1)), f64::from(i / (side + 1)), 0.5))
            .collect();
        positions.push(DVec3::splat(3.0));
        let square = |k: u32| {
            let i = k * 101 % (side * side);
            let (x, y) = (i % side, i / side);
            [corner(x, y), corner(x + 1, y), corner(x, y + 1)]
        };
        let mesh = Mesh {
            positions,
            triangles: (0..side * side).map(square).collect(),
        };
        let sorted = mesh.along_a_curve();
        let all = |mesh: &Mesh| {
            let bits = |i: usize| mesh.corners(i).map(|p| p.to_array().map(f64::to_bits));
            let mut all: Vec<_> = (0..mesh.triangles.len()).map(bits).collect();
            all.sort_unstable();
            all
        };
        assert_eq!(all(&sorted), all(&mesh));
        assert_eq!(sorted.positions.len(), mesh.positions.len());
        assert_eq!(sorted.positions.last(), Some(&DVec3::splat(3.0)));
        // By four squares, how far their first corners are apart.
        let spread = |mesh: &Mesh| -> f64 {
            let fours = mesh.triangles.chunks(4);
            let apart = fours.map(|four| {
                let at = |k: usize| mesh.positions[four[k][0] as usize];
                (1..4).map(|k| at(k).distance(at(0))).fold(0.0, f64::max)
            });
            apart.sum()
        };
        assert!(spread(&sorted) < 0.2 * spread(&mesh));
        // Nothing of nothing, and it is the same again.
        assert_eq!(Mesh::default().along_a_curve(), Mesh::default());
        assert_eq!(sorted.along_a_curve(), sorted);
    }
}
