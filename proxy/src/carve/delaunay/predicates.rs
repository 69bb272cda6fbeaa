//! Exact signs of determinants of lattice places.
//!
//! Each is computed in f64 first, with a bound on the rounding error (the idea of Shewchuk
//! 1997, "Adaptive precision floating-point arithmetic and fast robust geometric
//! predicates"); only where that cannot tell the sign, in `i128`, which is exact.

use super::super::lattice::{Site, vector};
use std::cmp::Ordering;

/// Rounding of the f64 determinants relative to the largest difference to the power of their
/// degree. Both sums have fewer than 30 terms of at most that size with at most 8 roundings
/// each: 240 · 2⁻⁵³ < 2⁻⁴⁵.
const ROUNDING: f64 = 1.0 / (1u64 << 45) as f64;

/// `Greater` where det(b − a, c − a, d − a) > 0: seen from d, the triangle a, b, c runs
/// counter-clockwise.
pub(crate) fn orientation([a, b, c, d]: [Site; 4]) -> Ordering {
    let from_a = |p: Site| vector(p) - vector(a);
    let (b_f, c_f, d_f) = (from_a(b), from_a(c), from_a(d));
    let det = b_f.dot(c_f.cross(d_f));
    let size = b_f.abs().max(c_f.abs()).max(d_f.abs()).max_element();
    let bound = ROUNDING * size * size * size;
    if det.abs() > bound {
        return det.total_cmp(&0.0);
    }
    volume6([a, b, c, d]).cmp(&0)
}

/// det(b − a, c − a, d − a), six times the tetrahedron's volume.
pub(crate) fn volume6([a, b, c, d]: [Site; 4]) -> i128 {
    let from_a = |p: Site| [0, 1, 2].map(|i| i64::from(p[i] - a[i]));
    let (b, c, d) = (from_a(b), from_a(c), from_a(d));
    let minor = |i: usize, j: usize| i128::from(c[i] * d[j] - c[j] * d[i]);
    i128::from(b[0]) * minor(1, 2) + i128::from(b[1]) * minor(2, 0) + i128::from(b[2]) * minor(0, 1)
}

/// `Greater` where e lies strictly inside the sphere through a, b, c and d, which must be
/// positively oriented.
pub(crate) fn in_sphere([a, b, c, d]: [Site; 4], e: Site) -> Ordering {
    let from_e = |p: Site| vector(p) - vector(e);
    let corners = [a, b, c, d].map(from_e);
    let size = corners
        .iter()
        .fold(glam::DVec3::ZERO, |m, p| m.max(p.abs()))
        .max_element();
    let det = in_sphere_f64(corners);
    let squared = size * size;
    if det.abs() > ROUNDING * squared * squared * size {
        return det.total_cmp(&0.0);
    }
    in_sphere_exact([a, b, c, d], e)
}

fn in_sphere_f64([a, b, c, d]: [glam::DVec3; 4]) -> f64 {
    let minor = |p: glam::DVec3, q: glam::DVec3| p.x * q.y - q.x * p.y;
    let (ab, bc, cd, da) = (minor(a, b), minor(b, c), minor(c, d), minor(d, a));
    let (ac, bd) = (minor(a, c), minor(b, d));
    let abc = a.z * bc - b.z * ac + c.z * ab;
    let bcd = b.z * cd - c.z * bd + d.z * bc;
    let cda = c.z * da + d.z * ac + a.z * cd;
    let dab = d.z * ab + a.z * bd + b.z * da;
    let lift = |p: glam::DVec3| p.dot(p);
    (lift(c) * dab - lift(d) * abc) + (lift(a) * bcd - lift(b) * cda)
}

fn in_sphere_exact(corners: [Site; 4], e: Site) -> Ordering {
    let [a, b, c, d] = corners.map(|p| [0, 1, 2].map(|i| i64::from(p[i] - e[i])));
    let minor = |p: [i64; 3], q: [i64; 3]| i128::from(p[0] * q[1] - q[0] * p[1]);
    let (ab, bc, cd, da) = (minor(a, b), minor(b, c), minor(c, d), minor(d, a));
    let (ac, bd) = (minor(a, c), minor(b, d));
    let z = |p: [i64; 3]| i128::from(p[2]);
    let abc = z(a) * bc - z(b) * ac + z(c) * ab;
    let bcd = z(b) * cd - z(c) * bd + z(d) * bc;
    let cda = z(c) * da + z(d) * ac + z(a) * cd;
    let dab = z(d) * ab + z(a) * bd + z(b) * da;
    let lift = |p: [i64; 3]| i128::from(p.iter().map(|x| x * x).sum::<i64>());
    let det = (lift(c) * dab - lift(d) * abc) + (lift(a) * bcd - lift(b) * cda);
    det.cmp(&0)
}

#[cfg(test)]
mod tests {
    use super::super::super::lattice::BITS;
    use super::*;
    use proptest::prelude::*;

    const LAST: i32 = (1 << BITS) - 1;

    #[test]
    fn signs_are_as_defined() {
        let [o, x, y, z] = [[0, 0, 0], [2, 0, 0], [0, 2, 0], [0, 0, 2]];
        assert_eq!(orientation([o, x, y, z]), Ordering::Greater);
        assert_eq!(orientation([o, y, x, z]), Ordering::Less);
        assert_eq!(in_sphere([o, x, y, z], [1, 1, 1]), Ordering::Greater);
        assert_eq!(in_sphere([o, x, y, z], [2, 2, 2]), Ordering::Equal);
        assert_eq!(in_sphere([o, x, y, z], [3, 2, 2]), Ordering::Less);
    }

    #[test]
    fn the_lattice_corners_do_not_overflow() {
        let corner = |i: i32| [0, 1, 2].map(|k| if i >> k & 1 == 1 { LAST } else { 0 });
        // A cube's corners lie on one sphere; one step inwards is inside it.
        let four = [corner(0), corner(1), corner(2), corner(4)];
        assert_eq!(in_sphere(four, corner(7)), Ordering::Equal);
        assert_eq!(in_sphere(four, [LAST, LAST, LAST - 1]), Ordering::Greater);
        assert_eq!(
            orientation([corner(0), corner(1), corner(2), corner(3)]),
            Ordering::Equal
        );
    }

    fn site(range: i32) -> impl Strategy<Value = Site> {
        prop::array::uniform3(0..=range)
    }

    fn any_site() -> impl Strategy<Value = Site> {
        prop_oneof![site(3), site(1000), site(LAST)]
    }

    proptest! {
        #[test]
        fn filtered_signs_are_the_exact_ones(
            four in prop::array::uniform4(any_site()), e in any_site(),
        ) {
            prop_assert_eq!(orientation(four), volume6(four).cmp(&0));
            prop_assert_eq!(in_sphere(four, e), in_sphere_exact(four, e));
        }

        #[test]
        fn swapping_corners_swaps_signs(four in prop::array::uniform4(site(6)), e in site(6)) {
            let [a, b, c, d] = four;
            prop_assert_eq!(orientation([b, a, c, d]), orientation(four).reverse());
            prop_assert_eq!(in_sphere([b, a, c, d], e), in_sphere(four, e).reverse());
        }
    }
}
