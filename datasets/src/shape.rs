//! Shapes in their own frames: where a ray meets them, how far away they are.

use glam::{DVec2, DVec3};
use std::f64::consts::PI;

/// A surface around the origin of its own frame; lengths are world units.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// The rectangle |x| ≤ half.x, |y| ≤ half.y in the plane z = 0, seen from both sides.
    Rectangle {
        /// Half its sides.
        half: DVec2,
    },
    /// A sphere, seen from outside or inside.
    Sphere {
        /// Its radius.
        radius: f64,
    },
    /// A box with faces across the axes.
    Cuboid {
        /// Half its sides.
        half: DVec3,
    },
    /// A cylinder around the y axis, closed at both ends.
    Cylinder {
        /// Its radius.
        radius: f64,
        /// Half its height.
        half_height: f64,
    },
    /// A profile turned around the y axis, open at both ends: a vase.
    Lathe {
        /// (radius, y) from the bottom upwards, y strictly growing, joined by straight
        /// lines; shading smooths over the joints.
        profile: Vec<DVec2>,
    },
    /// A polygon in the plane z = 0 that is drawn out to both sides along z: a wedge, a
    /// car's body.
    Prism {
        /// The polygon's corners, counter-clockwise as seen from +z; its edges do not cross.
        outline: Vec<DVec2>,
        /// Half its extent along z.
        half_depth: f64,
    },
}

/// Where a ray meets a shape, in the shape's frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Touch {
    /// Along the ray, in lengths of its direction.
    pub(crate) t: f64,
    pub(crate) point: DVec3,
    /// Outwards (towards +z for a rectangle), unit length.
    pub(crate) normal: DVec3,
    /// Which side of the shape: see [`Surface::face`].
    pub(crate) face: u8,
}

/// A point of a surface, as textures see it.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// In the shape's frame.
    pub point: DVec3,
    /// Along the surface, in world units: (x, y) on a rectangle and on a box's front and
    /// back, (z, y) on its sides, (x, z) on its top and bottom and on a cylinder's ends,
    /// (arc from the +z side towards +x, height) around spheres, cylinders and lathes,
    /// (x, y) on a prism's ends and (z, x) on its walls.
    pub along: DVec2,
    /// A box's +x, −x, +y, −y, +z, −z side: 0 to 5; a cylinder's wall, top, bottom: 0 to
    /// 2; a prism's +z and −z end: 0 and 1, and its walls in their order: 2 and on;
    /// otherwise 0.
    pub face: u8,
}

impl Shape {
    /// A sphere around the shape: centre and radius.
    pub(crate) fn ball(&self) -> (DVec3, f64) {
        match self {
            Self::Rectangle { half } => (DVec3::ZERO, half.length()),
            Self::Sphere { radius } => (DVec3::ZERO, *radius),
            Self::Cuboid { half } => (DVec3::ZERO, half.length()),
            Self::Cylinder {
                radius,
                half_height,
            } => (DVec3::ZERO, radius.hypot(*half_height)),
            Self::Lathe { profile } => {
                let low = profile.first().map_or(0.0, |p| p.y);
                let high = profile.last().map_or(0.0, |p| p.y);
                let center = DVec2::new(0.0, 0.5 * (low + high));
                let radius = profile
                    .iter()
                    .map(|p| p.distance(center))
                    .fold(0.0, f64::max);
                (DVec3::new(0.0, center.y, 0.0), radius)
            }
            Self::Prism {
                outline,
                half_depth,
            } => {
                let start = outline.first().copied().unwrap_or_default();
                let (low, high) = outline
                    .iter()
                    .fold((start, start), |(low, high), p| (low.min(*p), high.max(*p)));
                let center = 0.5 * (low + high);
                let radius = outline
                    .iter()
                    .map(|p| p.distance(center))
                    .fold(0.0, f64::max);
                (center.extend(0.0), radius.hypot(*half_depth))
            }
        }
    }

    /// The first place beyond `nearest` along the ray where it meets the surface.
    pub(crate) fn meet(&self, origin: DVec3, direction: DVec3, nearest: f64) -> Option<Touch> {
        match self {
            Self::Rectangle { half } => {
                let t = -origin.z / direction.z;
                let point = origin + direction * t;
                let inside = point.x.abs() <= half.x && point.y.abs() <= half.y;
                (t > nearest && inside).then_some(Touch {
                    t,
                    point: point.with_z(0.0),
                    normal: DVec3::Z,
                    face: 0,
                })
            }
            Self::Sphere { radius } => {
                let a = direction.length_squared();
                let b = origin.dot(direction);
                let c = origin.length_squared() - radius * radius;
                let t = first_root(a, b, c, nearest, |_| true)?;
                let normal = (origin + direction * t).normalize();
                Some(Touch {
                    t,
                    point: normal * *radius,
                    normal,
                    face: 0,
                })
            }
            Self::Cuboid { half } => meet_cuboid(*half, origin, direction, nearest),
            Self::Cylinder {
                radius,
                half_height,
            } => meet_cylinder(*radius, *half_height, origin, direction, nearest),
            Self::Lathe { profile } => meet_lathe(profile, origin, direction, nearest),
            Self::Prism {
                outline,
                half_depth,
            } => meet_prism(outline, *half_depth, origin, direction, nearest),
        }
    }

    /// Distance from a point outside to the surface.
    pub(crate) fn distance(&self, point: DVec3) -> f64 {
        match self {
            Self::Rectangle { half } => {
                let over = (point.truncate().abs() - *half).max(DVec2::ZERO);
                over.extend(point.z).length()
            }
            Self::Sphere { radius } => (point.length() - radius).abs(),
            Self::Cuboid { half } => (point.abs() - *half).max(DVec3::ZERO).length(),
            Self::Cylinder {
                radius,
                half_height,
            } => {
                let radial = DVec2::new(point.x, point.z).length() - radius;
                let over = DVec2::new(radial, point.y.abs() - half_height);
                over.max(DVec2::ZERO).length()
            }
            Self::Lathe { profile } => {
                let p = DVec2::new(DVec2::new(point.x, point.z).length(), point.y);
                profile
                    .windows(2)
                    .map(|ends| distance_squared_to_segment(p, ends[0], ends[1]))
                    .fold(f64::INFINITY, f64::min)
                    .sqrt()
            }
            Self::Prism {
                outline,
                half_depth,
            } => {
                let p = point.truncate();
                let across = if contains(outline, p) {
                    0.0
                } else {
                    edges(outline)
                        .map(|(a, b)| distance_squared_to_segment(p, a, b))
                        .fold(f64::INFINITY, f64::min)
                        .sqrt()
                };
                across.hypot((point.z.abs() - half_depth).max(0.0))
            }
        }
    }

    /// The surface coordinates of a point on it.
    pub(crate) fn surface(&self, point: DVec3, face: u8) -> Surface {
        let arc = |radius: f64| radius * point.x.atan2(point.z);
        let along = match self {
            Self::Rectangle { .. } => point.truncate(),
            Self::Sphere { radius } => {
                let latitude = (point.y / radius).clamp(-1.0, 1.0).asin();
                DVec2::new(arc(*radius), radius * latitude)
            }
            Self::Cuboid { .. } => match face {
                0 | 1 => DVec2::new(point.z, point.y),
                2 | 3 => DVec2::new(point.x, point.z),
                _ => DVec2::new(point.x, point.y),
            },
            Self::Cylinder { radius, .. } => match face {
                0 => DVec2::new(arc(*radius), point.y),
                _ => DVec2::new(point.x, point.z),
            },
            Self::Lathe { .. } => DVec2::new(arc(point.x.hypot(point.z)), point.y),
            Self::Prism { .. } => match face {
                0 | 1 => point.truncate(),
                _ => DVec2::new(point.z, point.x),
            },
        };
        Surface { point, along, face }
    }
}

/// The least t > `nearest` with a·t² + 2b·t + c = 0 that is `accepted`.
fn first_root(a: f64, b: f64, c: f64, nearest: f64, accepted: impl Fn(f64) -> bool) -> Option<f64> {
    let discriminant = b * b - a * c;
    if !(discriminant >= 0.0) {
        return None;
    }
    // q has the sign of b: no cancellation in either root.
    let q = -(b + discriminant.sqrt().copysign(b));
    let (t0, t1) = (q / a, c / q);
    let (t0, t1) = if t0 <= t1 { (t0, t1) } else { (t1, t0) };
    [t0, t1].into_iter().find(|&t| t > nearest && accepted(t))
}

fn meet_cuboid(half: DVec3, origin: DVec3, direction: DVec3, nearest: f64) -> Option<Touch> {
    // Slabs: the ray is inside between the last entry and the first exit.
    let inverse = direction.recip();
    let (a, b) = ((-half - origin) * inverse, (half - origin) * inverse);
    let (enter, exit) = (a.min(b), a.max(b));
    let (t_in, t_out) = (enter.max_element(), exit.min_element());
    if !(t_in <= t_out) {
        return None;
    }
    let (t, slabs) = if t_in > nearest {
        (t_in, enter)
    } else if t_out > nearest {
        (t_out, exit)
    } else {
        return None;
    };
    let axis = (0..3).find(|&axis| slabs[axis] == t)?;
    let mut point = origin + direction * t;
    let mut normal = DVec3::ZERO;
    normal[axis] = 1.0_f64.copysign(point[axis]);
    point[axis] = half[axis].copysign(point[axis]);
    let face = 2 * axis as u8 + u8::from(normal[axis] < 0.0);
    Some(Touch {
        t,
        point,
        normal,
        face,
    })
}

fn meet_cylinder(
    radius: f64,
    half_height: f64,
    origin: DVec3,
    direction: DVec3,
    nearest: f64,
) -> Option<Touch> {
    let at = |t: f64| origin + direction * t;
    let (o, d) = (
        DVec2::new(origin.x, origin.z),
        DVec2::new(direction.x, direction.z),
    );
    let (a, b, c) = (
        d.length_squared(),
        o.dot(d),
        o.length_squared() - radius * radius,
    );
    let wall = first_root(a, b, c, nearest, |t| at(t).y.abs() <= half_height).map(|t| {
        let point = at(t);
        Touch {
            t,
            point,
            normal: point.with_y(0.0).normalize(),
            face: 0,
        }
    });
    let end = |side: f64| {
        let t = (side * half_height - origin.y) / direction.y;
        let point = at(t).with_y(side * half_height);
        let inside = DVec2::new(point.x, point.z).length() <= radius;
        (t > nearest && inside).then_some(Touch {
            t,
            point,
            normal: DVec3::Y * side,
            face: if side > 0.0 { 1 } else { 2 },
        })
    };
    [wall, end(1.0), end(-1.0)]
        .into_iter()
        .flatten()
        .min_by(|a, b| a.t.total_cmp(&b.t))
}

fn meet_lathe(profile: &[DVec2], origin: DVec3, direction: DVec3, nearest: f64) -> Option<Touch> {
    let (o, d) = (
        DVec2::new(origin.x, origin.z),
        DVec2::new(direction.x, direction.z),
    );
    let mut best: Option<(f64, usize)> = None;
    for (segment, ends) in profile.windows(2).enumerate() {
        let (low, high) = (ends[0], ends[1]);
        // 1. The cone x² + z² = (r + slope·(y − y₀))² through this segment.
        let slope = (high.x - low.x) / (high.y - low.y);
        let r = low.x + slope * (origin.y - low.y);
        let dr = slope * direction.y;
        let (a, b, c) = (
            d.length_squared() - dr * dr,
            o.dot(d) - r * dr,
            o.length_squared() - r * r,
        );
        // 2. Only its part between the segment's ends.
        let hit = first_root(a, b, c, nearest, |t| {
            let y = origin.y + direction.y * t;
            (low.y..=high.y).contains(&y)
        });
        if let Some(t) = hit
            && best.is_none_or(|(nearest_t, _)| t < nearest_t)
        {
            best = Some((t, segment));
        }
    }
    let (t, segment) = best?;
    let point = origin + direction * t;
    // 3. A normal that turns smoothly from joint to joint.
    let outwards = |i: usize| {
        let before = profile[i.saturating_sub(1)];
        let after = profile[(i + 1).min(profile.len() - 1)];
        let tangent = after - before;
        DVec2::new(tangent.y, -tangent.x).normalize()
    };
    let (low, high) = (profile[segment], profile[segment + 1]);
    let along = (point.y - low.y) / (high.y - low.y);
    let n = outwards(segment).lerp(outwards(segment + 1), along);
    let radial = DVec2::new(point.x, point.z).normalize_or(DVec2::X);
    Some(Touch {
        t,
        point,
        normal: DVec3::new(radial.x * n.x, n.y, radial.y * n.x).normalize(),
        face: 0,
    })
}

fn meet_prism(
    outline: &[DVec2],
    half_depth: f64,
    origin: DVec3,
    direction: DVec3,
    nearest: f64,
) -> Option<Touch> {
    let mut best: Option<Touch> = None;
    let mut consider = |touch: Touch| {
        if touch.t > nearest && best.is_none_or(|found| touch.t < found.t) {
            best = Some(touch);
        }
    };
    // 1. The ends.
    for (face, side) in [(0, 1.0), (1, -1.0)] {
        let t = (side * half_depth - origin.z) / direction.z;
        let point = (origin + direction * t).with_z(side * half_depth);
        if t.is_finite() && contains(outline, point.truncate()) {
            consider(Touch {
                t,
                point,
                normal: DVec3::Z * side,
                face,
            });
        }
    }
    // 2. The walls.
    let (o, d) = (origin.truncate(), direction.truncate());
    for (i, (a, b)) in edges(outline).enumerate() {
        let along = b - a;
        let facing = d.perp_dot(along);
        let t = (a - o).perp_dot(along) / facing;
        let s = (a - o).perp_dot(d) / facing;
        let z = origin.z + direction.z * t;
        if t.is_finite() && (0.0..=1.0).contains(&s) && z.abs() <= half_depth {
            consider(Touch {
                t,
                point: (a + along * s).extend(z),
                // Inside lies to the left of an edge.
                normal: DVec2::new(along.y, -along.x).normalize().extend(0.0),
                face: (2 + i).min(255) as u8,
            });
        }
    }
    best
}

/// A polygon's edges in order.
fn edges(outline: &[DVec2]) -> impl Iterator<Item = (DVec2, DVec2)> {
    let next = outline.iter().cycle().skip(1);
    outline.iter().zip(next).map(|(a, b)| (*a, *b))
}

/// Whether a point lies inside a polygon: a ray from it crosses an odd number of edges.
fn contains(outline: &[DVec2], p: DVec2) -> bool {
    let crossed = edges(outline).filter(|(a, b)| {
        (a.y > p.y) != (b.y > p.y) && p.x < a.x + (b.x - a.x) * (p.y - a.y) / (b.y - a.y)
    });
    crossed.count() % 2 == 1
}

fn distance_squared_to_segment(p: DVec2, a: DVec2, b: DVec2) -> f64 {
    let ab = b - a;
    let along = ((p - a).dot(ab) / ab.length_squared()).clamp(0.0, 1.0);
    p.distance_squared(a + ab * along)
}

/// A smooth profile through a few (radius, y) points: Catmull–Rom, `pieces` straight
/// lines between neighbours.
pub(crate) fn smooth_profile(through: &[DVec2], pieces: usize) -> Vec<DVec2> {
    let at = |i: isize| through[i.clamp(0, through.len() as isize - 1) as usize];
    let mut profile = vec![through[0]];
    for i in 0..through.len() as isize - 1 {
        let (p0, p1, p2, p3) = (at(i - 1), at(i), at(i + 1), at(i + 2));
        for piece in 1..=pieces {
            let t = piece as f64 / pieces as f64;
            let smooth = 0.5
                * (2.0 * p1
                    + (p2 - p0) * t
                    + (2.0 * p0 - 5.0 * p1 + 4.0 * p2 - p3) * t * t
                    + (3.0 * p1 - p0 - 3.0 * p2 + p3) * t * t * t);
            // Heights stay linear, so that they surely grow.
            profile.push(DVec2::new(smooth.x, p1.y + (p2.y - p1.y) * t));
        }
    }
    profile
}

/// The longitude of a surface point around the y axis, 0 at +z, growing towards +x.
pub(crate) fn longitude(point: DVec3) -> f64 {
    point.x.atan2(point.z)
}

/// A whole turn.
pub(crate) const TURN: f64 = 2.0 * PI;

#[cfg(test)]
mod tests {
    use super::*;

    /// Rays from many sides: the point found lies on the surface, on the ray, and the
    /// normal is that of the distance's gradient.
    #[test]
    fn points_found_lie_on_the_surface_and_on_the_ray() {
        let shapes = [
            Shape::Rectangle {
                half: DVec2::new(0.5, 0.8),
            },
            Shape::Sphere { radius: 0.7 },
            Shape::Cuboid {
                half: DVec3::new(0.3, 0.5, 0.7),
            },
            Shape::Cylinder {
                radius: 0.4,
                half_height: 0.6,
            },
            Shape::Lathe {
                profile: smooth_profile(
                    &[
                        DVec2::new(0.3, -0.5),
                        DVec2::new(0.6, 0.0),
                        DVec2::new(0.2, 0.5),
                    ],
                    8,
                ),
            },
            Shape::Prism {
                outline: [
                    [-0.6, -0.3],
                    [0.6, -0.3],
                    [0.5, 0.2],
                    [0.1, 0.1],
                    [-0.4, 0.5],
                ]
                .map(DVec2::from_array)
                .to_vec(),
                half_depth: 0.35,
            },
        ];
        for shape in &shapes {
            let mut hits = 0;
            for i in 0..400 {
                let r = |k| crate::noise::signed(3, i, k, 0);
                let origin = DVec3::new(r(0), r(1), r(2)).normalize() * 3.0;
                let target = DVec3::new(r(3), r(4), r(5)) * 0.5;
                let direction = target - origin;
                let Some(touch) = shape.meet(origin, direction, 0.0) else {
                    continue;
                };
                hits += 1;
                let on_ray = origin + direction * touch.t;
                assert!((on_ray - touch.point).length() < 1e-12);
                assert!(shape.distance(touch.point) < 1e-12, "{shape:?}");
                assert!((touch.normal.length() - 1.0).abs() < 1e-12);
                let (center, radius) = shape.ball();
                assert!(touch.point.distance(center) <= radius + 1e-12);
                let step = 1e-6;
                let outside = shape.distance(touch.point + step * touch.normal);
                // The lathe's normals are smoothed.
                let smoothed = matches!(shape, Shape::Lathe { .. });
                let tolerance = if smoothed { 0.1 } else { 1e-4 };
                assert!((outside / step - 1.0).abs() < tolerance, "{shape:?}");
            }
            assert!(hits > 100, "{shape:?} was hit {hits} times");
        }
    }

    #[test]
    fn a_ray_from_inside_a_sphere_meets_its_far_side() {
        let touch = Shape::Sphere { radius: 2.0 }
            .meet(DVec3::ZERO, DVec3::X, 1e-9)
            .unwrap();
        assert_eq!(touch.point, DVec3::new(2.0, 0.0, 0.0));
    }
}
