//! The point of a polyhedron nearest to a given one.

use glam::DVec3;

/// The points x with normal · x ≥ offset.
#[derive(Clone, Copy, Debug)]
pub(super) struct HalfSpace {
    /// Unit length.
    pub(super) normal: DVec3,
    pub(super) offset: f64,
}

/// Half-spaces are kept to within this part of the target's length and their offsets.
const ROUNDING: f64 = 1e-13;
/// Planes whose normals' sine is less are parallel.
const PARALLEL: f64 = 1e-9;

/// The point nearest to `target` among those in all half-spaces; `None` where they share
/// none.
///
/// Seidel 1991's incremental method for linear programs, which serves any strictly convex
/// aim: half-spaces are added one by one, and where the nearest point so far lies outside one,
/// the nearest of all so far lies on its plane, a problem of one dimension less. Quick for
/// the few half-spaces around an edge.
pub(super) fn closest_point(half_spaces: &[HalfSpace], target: DVec3) -> Option<DVec3> {
    let scale = half_spaces
        .iter()
        .map(|h| h.offset.abs())
        .fold(target.length(), f64::max);
    let rounding = ROUNDING * scale;
    let mut nearest = target;
    for (i, added) in half_spaces.iter().enumerate() {
        if !added.has(nearest, rounding) {
            nearest = on_plane(&half_spaces[..i], added, target, rounding)?;
        }
    }
    Some(nearest)
}

impl HalfSpace {
    fn has(&self, point: DVec3, rounding: f64) -> bool {
        self.normal.dot(point) >= self.offset - rounding
    }
}

fn on_plane(
    half_spaces: &[HalfSpace],
    plane: &HalfSpace,
    target: DVec3,
    rounding: f64,
) -> Option<DVec3> {
    let target = target + plane.normal * (plane.offset - plane.normal.dot(target));
    let mut nearest = target;
    for (i, added) in half_spaces.iter().enumerate() {
        if added.has(nearest, rounding) {
            continue;
        }
        // The line where both planes meet.
        let direction = plane.normal.cross(added.normal);
        let sine_squared = direction.length_squared();
        if sine_squared < PARALLEL * PARALLEL {
            return None;
        }
        let towards = added.normal - plane.normal * plane.normal.dot(added.normal);
        let short = added.offset - added.normal.dot(target);
        let start = target + towards * (short / sine_squared);
        let direction = direction / sine_squared.sqrt();
        nearest = on_line(&half_spaces[..i], start, direction, rounding)?;
    }
    Some(nearest)
}

/// `start` is the line's point nearest to the target.
fn on_line(
    half_spaces: &[HalfSpace],
    start: DVec3,
    direction: DVec3,
    rounding: f64,
) -> Option<DVec3> {
    let (mut least, mut most) = (f64::NEG_INFINITY, f64::INFINITY);
    for added in half_spaces {
        let slope = added.normal.dot(direction);
        let short = added.offset - added.normal.dot(start);
        if slope.abs() < PARALLEL {
            if short > rounding {
                return None;
            }
        } else if slope > 0.0 {
            least = least.max(short / slope);
        } else {
            most = most.min(short / slope);
        }
    }
    if least > most {
        // Three planes through one line, but for rounding.
        let nearly = least - most <= rounding;
        return nearly.then(|| start + direction * (0.5 * (least + most)));
    }
    Some(start + direction * 0.0_f64.clamp(least, most))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn vector() -> impl Strategy<Value = DVec3> {
        proptest::array::uniform3(-1.0..1.0).prop_map(DVec3::from_array)
    }

    proptest! {
        /// The way from the nearest point to the target is a sum of the normals of the
        /// planes it lies on, reversed: no step within the polyhedron leads nearer.
        #[test]
        fn no_step_within_leads_nearer(
            normals in proptest::collection::vec((vector(), 0.0..0.5), 1..12),
            target in vector(),
            steps in proptest::collection::vec(vector(), 32),
        ) {
            let half_spaces: Vec<HalfSpace> = normals
                .iter()
                .filter_map(|(n, away)| {
                    Some(HalfSpace { normal: n.try_normalize()?, offset: -away })
                })
                .collect();
            // All have the origin.
            let nearest = closest_point(&half_spaces, 4.0 * target).unwrap();
            for h in &half_spaces {
                prop_assert!(h.has(nearest, 1e-9));
            }
            for step in steps {
                for length in [1.0, 0.1, 0.01] {
                    let there = nearest + length * step;
                    if half_spaces.iter().all(|h| h.has(there, 0.0)) {
                        let [before, after] = [nearest, there].map(|p| p.distance(4.0 * target));
                        prop_assert!(after >= before - 1e-9);
                    }
                }
            }
        }
    }

    #[test]
    fn half_spaces_that_share_nothing_have_no_nearest_point() {
        let slab = |n: DVec3| {
            [n, -n].map(|normal| HalfSpace {
                normal,
                offset: 0.1,
            })
        };
        assert_eq!(closest_point(&slab(DVec3::X), DVec3::ZERO), None);
        let mut all = slab(DVec3::Y).to_vec();
        all.insert(
            1,
            HalfSpace {
                normal: DVec3::Z,
                offset: 0.0,
            },
        );
        assert_eq!(closest_point(&all, -DVec3::Z), None);
    }
}
