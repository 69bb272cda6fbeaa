//! Which facets look like a surface (Labatut, Pons and Keriven 2009, §4.2): those whose
//! two tetrahedra have large empty balls on their own sides, as facets of a β-skeleton have.

use super::delaunay::Delaunay;
use super::lattice::vector;
use super::sight::OTHERS;
use glam::DVec3;
use rayon::prelude::*;

/// For each finite tetrahedron and each of its facets, the cosine of the angle between the
/// facet and the tetrahedron's circumscribed sphere; negative where the sphere's centre lies
/// beyond the facet.
pub(super) fn cosines(delaunay: &Delaunay) -> Vec<[f32; 4]> {
    (0..delaunay.finite as u32)
        .into_par_iter()
        .map(|t| {
            let corners = delaunay.corners(t).map(vector);
            let center = circumcenter(corners);
            let radius = center.length();
            [0, 1, 2, 3].map(|k| {
                let [a, b, c] = OTHERS[k].map(|i| corners[i] - corners[0]);
                // Away from corner k.
                let normal = (b - a).cross(c - a);
                let cosine = normal.dot(a - center) / (normal.length() * radius);
                if cosine.is_finite() {
                    cosine as f32
                } else {
                    -1.0
                }
            })
        })
        .collect()
}

/// The centre of the circumscribed sphere, from the first corner.
fn circumcenter([o, a, b, c]: [DVec3; 4]) -> DVec3 {
    let (a, b, c) = (a - o, b - o, c - o);
    let (bc, ca, ab) = (b.cross(c), c.cross(a), a.cross(b));
    let sum = bc * a.length_squared() + ca * b.length_squared() + ab * c.length_squared();
    sum / (2.0 * a.dot(bc))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_angles_of_a_corner_of_a_cube() {
        let sites = vec![[0, 0, 0], [10, 0, 0], [0, 10, 0], [0, 0, 10]];
        let delaunay = Delaunay::new(sites).unwrap();
        let mut found = cosines(&delaunay)[0];
        found.sort_by(f32::total_cmp);
        // The centre is (5, 5, 5): beyond the long facet by 5/√3, 5 from the others.
        let radius = 75f32.sqrt();
        let expected = [
            -5.0 / 3f32.sqrt() / radius,
            5.0 / radius,
            5.0 / radius,
            5.0 / radius,
        ];
        for (a, b) in found.iter().zip(expected) {
            assert!((a - b).abs() < 1e-6, "{found:?}");
        }
    }
}
