//! A mesh as a proxy: its kind, and rays that meet it.

use crate::{Kept, Mesh};
use glam::{DVec3, Vec3A};
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;
use obvhs::ray::{Ray, RayHit};
use obvhs::{Boundable, BvhBuildParams};
use std::fmt;
use std::sync::Arc;
use std::time::Duration;

/// Where a mesh came from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MeshKind {
    /// A box around the way through a hallway.
    Tunnel,
    /// What all silhouettes leave of space.
    Hull,
    /// The sparse points' tetrahedra, free space carved away.
    Carved,
    /// The same of dense points.
    CarvedDense,
    /// Depth maps, fused.
    Depth,
    /// A file from elsewhere.
    Mesh,
}

impl MeshKind {
    /// All of them.
    pub const ALL: [Self; 6] = [
        Self::Tunnel,
        Self::Hull,
        Self::Carved,
        Self::CarvedDense,
        Self::Depth,
        Self::Mesh,
    ];

    /// As the command line and files spell it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Tunnel => "tunnel",
            Self::Hull => "hull",
            Self::Carved => "carved",
            Self::CarvedDense => "carved-dense",
            Self::Depth => "depth",
            Self::Mesh => "mesh",
        }
    }

    /// Whether one part of such a surface can hide another from a camera. The cameras are
    /// inside a tunnel's box, which is convex.
    pub fn can_occlude_itself(self) -> bool {
        self != Self::Tunnel
    }

    /// Whether only the sides of triangles that are counter-clockwise count. Between free space and
    /// solid nothing else can be seen from free space; and a desired view that strays into
    /// what no line of sight carved looks out of it instead of at its near wall. From within a hull
    /// nothing is seen.
    pub fn has_front_sides_only(self) -> bool {
        matches!(self, Self::Hull | Self::Carved | Self::CarvedDense)
    }
}

/// A mesh and what finds its triangles.
pub struct Solid {
    kind: MeshKind,
    occludes: bool,
    mesh: Mesh,
    /// What every ray's point is kept within.
    within: Option<Arc<Solid>>,
    bvh: Bvh2,
    /// Where the hierarchy's origin lies in the world: f32 has digits only around it.
    origin: DVec3,
}

/// Where a ray first meets a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Which triangle; see [`Solid::corners`].
    pub triangle_idx: u32,
    /// How far along, in lengths of the ray's direction.
    pub along: f64,
}

/// How much larger boxes are than what they hold, relative to their distance from the origin
/// or to the mesh's typical size: rays and boxes are rounded to f32.
const ROUNDING: f64 = 1e-6;
/// How far beyond its sides a triangle is still met, in shares of itself: neighbours leave
/// no gap.
const GAP: f64 = 1e-12;

struct Bounds(Aabb);

impl Boundable for Bounds {
    fn aabb(&self) -> Aabb {
        self.0
    }
}

impl Solid {
    /// A mesh made ready for rays.
    pub fn new(kind: MeshKind, mesh: Mesh) -> Self {
        let origin = median(&mesh.positions);
        let offset = |p: &DVec3| (*p - origin).abs().max_element();
        let mut offsets: Vec<f64> = mesh.positions.iter().map(offset).collect();
        let middle = offsets.len() / 2;
        let typical = match offsets.len() {
            0 => 0.0,
            _ => *offsets.select_nth_unstable_by(middle, f64::total_cmp).1,
        };
        let bounds = |i: usize| {
            let corners = mesh.corners(i).map(|p| p - origin);
            let (least, greatest) = corners.iter().fold(
                (DVec3::INFINITY, DVec3::NEG_INFINITY),
                |(least, greatest), &p| (least.min(p), greatest.max(p)),
            );
            let far = least.abs().max(greatest.abs()).max_element();
            let room = DVec3::splat(ROUNDING * (far + typical));
            let corner = |p: DVec3| Vec3A::from(p.as_vec3());
            Bounds(Aabb::new(corner(least - room), corner(greatest + room)))
        };
        let bounds: Vec<Bounds> = (0..mesh.triangles.len()).map(bounds).collect();
        let mut spent = Duration::default();
        let bvh = build_bvh2(&bounds, BvhBuildParams::fast_build(), &mut spent);
        Self {
            kind,
            occludes: kind.can_occlude_itself(),
            mesh,
            within: None,
            bvh,
            origin,
        }
    }

    /// From now on no part of it is taken to hide another: where it is far from the truth, what
    /// it would hide from photos is what they show best.
    pub fn hide_nothing(&mut self) {
        self.occludes = false;
    }

    /// From now on what a ray meets is kept within a closed mesh, if there is one, as [`Self::keep`] has it: what
    /// lies outside goes to the nearest of its sides, and what misses it meets nothing.
    pub fn keep_within(&mut self, hull: Option<Arc<Self>>) {
        self.within = hull;
    }

    /// The closed mesh that bounds it, if there is one.
    pub fn within(&self) -> Option<&Self> {
        self.within.as_deref()
    }

    /// How many triangles a ray may meet: its own, and those of what bounds it.
    pub fn triangle_count(&self) -> usize {
        let bound = self.within().map_or(0, Self::triangle_count);
        self.mesh.triangles.len() + bound
    }

    /// The corners of a triangle that a ray meets. Those of what bounds it come after its own.
    pub fn corners(&self, triangle_idx: usize) -> [DVec3; 3] {
        let own = self.mesh.triangles.len();
        match &self.within {
            Some(hull) if triangle_idx >= own => hull.corners(triangle_idx - own),
            _ => self.mesh.corners(triangle_idx),
        }
    }

    /// Whether what lies behind a part of it counts as hidden.
    pub fn occludes(&self) -> bool {
        self.occludes
    }

    /// Where it came from.
    pub fn kind(&self) -> MeshKind {
        self.kind
    }

    /// The mesh itself, without what bounds it.
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    /// The first triangle that a ray from a point meets, from either side but for kinds that
    /// [have front sides only](MeshKind::has_front_sides_only); kept within what bounds it.
    pub fn first_hit(&self, from_in_world: DVec3, direction: DVec3) -> Option<Hit> {
        let front_only = self.kind.has_front_sides_only();
        let own = self.first_own_hit(from_in_world, direction, front_only);
        let Some(hull) = &self.within else {
            return own;
        };
        let along = own.map_or(f64::INFINITY, |hit| hit.along);
        match hull.keep_on_ray(from_in_world, direction, along) {
            Kept::Nowhere => None,
            Kept::AsItIs => own,
            Kept::On {
                triangle_idx,
                inverse,
            } => Some(Hit {
                triangle_idx: self.mesh.triangles.len() as u32 + triangle_idx,
                along: inverse.recip(),
            }),
        }
    }

    /// Of its own triangles alone, if asked to of those whose corners the ray sees counter-clockwise.
    pub(crate) fn first_own_hit(
        &self,
        from_in_world: DVec3,
        direction: DVec3,
        front_only: bool,
    ) -> Option<Hit> {
        let from = from_in_world - self.origin;
        if self.mesh.triangles.is_empty() || !from.is_finite() || !direction.is_finite() {
            return None;
        }
        // Unit length, so that the distances compared in f32 are those of the world.
        let length = direction.length();
        let unit = direction / length;
        if !unit.is_finite() {
            return None;
        }
        let ray = Ray::new_inf(from.as_vec3().into(), unit.as_vec3().into());
        let mut nearest: Option<Hit> = None;
        self.bvh.ray_traverse(ray, &mut RayHit::none(), |_, slot| {
            let triangle_idx = self.bvh.primitive_indices[slot];
            let corners = self.mesh.corners(triangle_idx as usize);
            let Some(along) = meet(corners.map(|p| p - from_in_world), unit, front_only) else {
                return f32::INFINITY;
            };
            let first = nearest.is_none_or(|n| {
                let order = along.total_cmp(&n.along);
                order.then(triangle_idx.cmp(&n.triangle_idx)).is_lt()
            });
            if first {
                nearest = Some(Hit {
                    triangle_idx,
                    along,
                });
            }
            // A little farther than it is, so that rounding hides nothing nearer.
            (along * (1.0 + 4.0 * ROUNDING)) as f32
        });
        nearest.map(|hit| Hit {
            along: hit.along / length,
            ..hit
        })
    }
}

/// Two meshes are alike where their triangles are; the rest follows from them.
impl PartialEq for Solid {
    fn eq(&self, other: &Self) -> bool {
        (self.kind, self.occludes) == (other.kind, other.occludes)
            && self.mesh == other.mesh
            && self.within == other.within
    }
}

impl fmt::Debug for Solid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (kind, count) = (self.kind.name(), self.mesh.triangles.len());
        write!(f, "Solid({kind}, {count} triangles)")
    }
}

/// How far along a ray from the origin meets a triangle (Möller and Trumbore 1997); if asked
/// to, only one whose corners it sees counter-clockwise.
fn meet([a, b, c]: [DVec3; 3], direction: DVec3, front_only: bool) -> Option<f64> {
    let (ab, ac) = (b - a, c - a);
    let across = direction.cross(ac);
    let volume = ab.dot(across);
    let share_b = -a.dot(across) / volume;
    let turned = -a.cross(ab);
    let share_c = direction.dot(turned) / volume;
    let along = ac.dot(turned) / volume;
    let inside = share_b >= -GAP && share_c >= -GAP && share_b + share_c <= 1.0 + GAP;
    let seen = !front_only || volume > 0.0;
    // A NaN, of a triangle seen edge on, is no hit.
    (inside && seen && along > 0.0 && along < f64::INFINITY).then_some(along)
}

fn median(positions: &[DVec3]) -> DVec3 {
    let axis = |k: usize| {
        let mut values: Vec<f64> = positions.iter().map(|p| p[k]).collect();
        let middle = values.len() / 2;
        match values.len() {
            0 => 0.0,
            _ => *values.select_nth_unstable_by(middle, f64::total_cmp).1,
        }
    };
    DVec3::new(axis(0), axis(1), axis(2))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A sphere of the given radius, its poles along y.
    fn globe(center: DVec3, radius: f64) -> Mesh {
        let (around, down) = (48_u32, 24_u32);
        let mut mesh = Mesh::default();
        for row in 0..=down {
            for column in 0..around {
                let theta = std::f64::consts::PI * f64::from(row) / f64::from(down);
                let phi = std::f64::consts::TAU * f64::from(column) / f64::from(around);
                let at = DVec3::new(
                    theta.sin() * phi.cos(),
                    theta.cos(),
                    theta.sin() * phi.sin(),
                );
                mesh.positions.push(center + radius * at);
            }
        }
        for row in 0..down {
            for column in 0..around {
                let at = |r: u32, c: u32| r * around + c % around;
                let (a, b) = (at(row, column), at(row, column + 1));
                let (c, d) = (at(row + 1, column), at(row + 1, column + 1));
                mesh.triangles.extend([[a, b, c], [b, d, c]]);
            }
        }
        mesh
    }

    proptest! {
        #[test]
        fn from_inside_a_closed_surface_every_ray_meets_it(
            x in -0.9..0.9, y in -0.3..0.3, theta in 0.0..std::f64::consts::PI,
            phi in 0.0..std::f64::consts::TAU, scale in -6..6, shift in 0.0..1e7,
        ) {
            // Far from the world's origin, at any scale; along seams of the mesh, too.
            let radius = 10_f64.powi(scale);
            let center = DVec3::new(shift, -shift, 0.5 * shift) * radius;
            let solid = Solid::new(MeshKind::Mesh, globe(center, radius));
            let from = center + radius * DVec3::new(x, y, 0.1);
            let ray = DVec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin());
            let seam = DVec3::new(0.0, (theta * 8.0).round() / 8.0, -1.0);
            for direction in [ray, seam, DVec3::Y, DVec3::X] {
                let hit = solid.first_hit(from, direction);
                prop_assert!(hit.is_some());
                let at = from + direction * hit.unwrap().along;
                let off = (at - center).length() / radius;
                prop_assert!((0.98..1.001).contains(&off), "{off}");
            }
        }
    }

    #[test]
    fn the_nearest_counts_and_a_dome_far_away_takes_no_digits() {
        let mut mesh = globe(DVec3::new(1e6, 0.0, 0.0), 1.0);
        let near = mesh.triangles.len() as u32;
        mesh.append(&globe(DVec3::new(1e6, 0.0, 0.0), 1e5));
        let solid = Solid::new(MeshKind::Mesh, mesh);
        let from = DVec3::new(1e6, 0.0, -3.0);
        let hit = solid.first_hit(from, DVec3::Z * 2.0).unwrap();
        assert!(hit.triangle_idx < near);
        assert!((hit.along - 1.0).abs() < 0.01, "{}", hit.along);
        let beyond = solid.first_hit(from, DVec3::NEG_Z).unwrap();
        assert!(beyond.triangle_idx >= near);
    }

    #[test]
    fn out_of_what_was_not_carved_one_sees_what_lies_beyond() {
        // Solid around a view, in a free space with a wall around it.
        let mut mesh = globe(DVec3::ZERO, 1.0);
        let own = mesh.triangles.len() as u32;
        let mut wall = globe(DVec3::ZERO, 10.0);
        wall.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        mesh.append(&wall);
        let carved = Solid::new(MeshKind::Carved, mesh.clone());
        let far = carved.first_hit(DVec3::ZERO, DVec3::Z).unwrap();
        assert!(far.triangle_idx >= own && far.along > 9.0, "{far:?}");
        // From free space it is met.
        let near = carved.first_hit(DVec3::Z * 5.0, DVec3::NEG_Z).unwrap();
        assert!(near.triangle_idx < own, "{near:?}");
        // A file's triangles may be any way round.
        let any = Solid::new(MeshKind::Mesh, mesh);
        let near = any.first_hit(DVec3::ZERO, DVec3::Z).unwrap();
        assert!(near.triangle_idx < own, "{near:?}");
    }

    #[test]
    fn nothing_is_met_where_there_is_nothing() {
        let empty = Solid::new(MeshKind::Mesh, Mesh::default());
        assert_eq!(empty.first_hit(DVec3::ZERO, DVec3::Z), None);
        let flat = Mesh {
            positions: vec![DVec3::ZERO, DVec3::X, DVec3::X * 2.0],
            triangles: vec![[0, 1, 2]],
        };
        let flat = Solid::new(MeshKind::Mesh, flat);
        assert_eq!(flat.first_hit(DVec3::NEG_Z, DVec3::Z), None);
        let globe = Solid::new(MeshKind::Mesh, globe(DVec3::ZERO, 1.0));
        assert_eq!(globe.first_hit(DVec3::Z * 3.0, DVec3::Z), None);
        assert_eq!(globe.first_hit(DVec3::Z * 3.0, DVec3::ZERO), None);
        assert_eq!(globe.first_hit(DVec3::NAN, DVec3::Z), None);
    }
}
