//! A mesh as a proxy: its kind, and rays that meet it.

mod runs;
mod together;

use crate::{Kept, Mesh};
use glam::{DVec3, Vec3A};
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;
use obvhs::ray::{Ray, RayHit};
use obvhs::{Boundable, BvhBuildParams};
use rayon::prelude::*;
use runs::Runs;
pub(crate) use runs::Sight;
use std::collections::HashSet;
use std::fmt;
use std::ops::{Range, RangeInclusive};
use std::sync::Arc;
use std::time::Duration;
pub use together::RAYS_TOGETHER;
use together::is_nearer;

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
    boxed: Boxed,
    runs: Runs,
    /// Where the hierarchy's origin lies in the world: f32 has digits only around it.
    origin: DVec3,
    /// What lengths are multiplied by in the hierarchy: f32 has no others than about one.
    scale: f64,
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
/// Typical sizes of meshes, in the world, that the hierarchy takes as they are.
const SIZES: RangeInclusive<f64> = 1e-12..=1e12;
/// The hierarchy's coordinates are no larger: areas of boxes are to be finite in f32.
const FARTHEST: f64 = 1e18;
/// How far beyond its sides a triangle is still met, in shares of itself: neighbours leave
/// no gap.
const GAP: f64 = 1e-12;

#[derive(Clone, Copy)]
struct Bounds(Aabb);

impl Boundable for Bounds {
    fn aabb(&self) -> Aabb {
        self.0
    }
}

impl Bounds {
    /// The same for equal boxes.
    fn bits(&self) -> [u32; 6] {
        let [a, b, c] = self.0.min.to_array();
        let [d, e, f] = self.0.max.to_array();
        [a, b, c, d, e, f].map(f32::to_bits)
    }
}

/// The triangles that rays can meet, by their boxes. A hierarchy of boxes takes time with the square
/// of how many are equal, so it has each but once.
struct Boxed {
    triangles: Vec<u32>,
    /// Where those of each of the hierarchy's slots begin, and where the last end.
    first: Vec<u32>,
}

impl Boxed {
    /// With the hierarchy around them, the boxes in the order of their first triangles.
    fn new(mesh: &Mesh, bounds: impl Fn(usize) -> Bounds + Sync) -> (Self, Bvh2) {
        // 1. What has equal boxes is side by side, in the mesh's order. A point or a line is met
        //    by no ray.
        let can_be_met = |i: &u32| {
            let [a, b, c] = mesh.corners(*i as usize);
            a != b && b != c && c != a
        };
        let mut sorted: Vec<([u32; 6], u32)> = (0..mesh.triangles.len() as u32)
            .into_par_iter()
            .filter(can_be_met)
            .map(|i| (bounds(i as usize).bits(), i))
            .collect();
        sorted.par_sort_unstable();
        let mut groups: Vec<&[([u32; 6], u32)]> = sorted.chunk_by(|a, b| a.0 == b.0).collect();
        groups.par_sort_unstable_by_key(|group| group[0].1);

        // 2. The hierarchy.
        let boxes: Vec<Bounds> = groups.iter().map(|g| bounds(g[0].1 as usize)).collect();
        let mut spent = Duration::default();
        let bvh = build_bvh2(&boxes, BvhBuildParams::fast_build(), &mut spent);

        // 3. What is in its slots. Of triangles with the same corners a ray meets the first.
        let mut triangles = Vec::with_capacity(sorted.len());
        let mut first = vec![0];
        for &place in &bvh.primitive_indices {
            let group = groups[place as usize];
            let mut known = HashSet::new();
            let corners = |i: u32| {
                let corners = mesh.corners(i as usize);
                corners.map(|p| p.to_array().map(f64::to_bits))
            };
            let mut is_new = |i: &u32| group.len() == 1 || known.insert(corners(*i));
            triangles.extend(group.iter().map(|(_, i)| *i).filter(|i| is_new(i)));
            first.push(triangles.len() as u32);
        }
        (Self { triangles, first }, bvh)
    }

    /// The triangles in one of the hierarchy's slots.
    #[inline]
    fn within(&self, slot: usize) -> &[u32] {
        &self.triangles[self.first[slot] as usize..self.first[slot + 1] as usize]
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
        let scale = scale_of(typical);
        let bounds = |i: usize| {
            let corners = mesh.corners(i).map(|p| p - origin);
            let (least, greatest) = corners.iter().fold(
                (DVec3::INFINITY, DVec3::NEG_INFINITY),
                |(least, greatest), &p| (least.min(p), greatest.max(p)),
            );
            let far = least.abs().max(greatest.abs()).max_element();
            let room = DVec3::splat(ROUNDING * (far + typical));
            let corner = |p: DVec3| Vec3A::from((p * scale).as_vec3());
            // What reaches farther may be met by any ray.
            if !((far + room.x) * scale <= FARTHEST) {
                let all = Vec3A::splat(FARTHEST as f32);
                return Bounds(Aabb::new(-all, all));
            }
            Bounds(Aabb::new(corner(least - room), corner(greatest + room)))
        };
        let (boxed, bvh) = Boxed::new(&mesh, bounds);
        Self {
            kind,
            occludes: kind.can_occlude_itself(),
            runs: Runs::new(&mesh),
            mesh,
            within: None,
            bvh,
            boxed,
            origin,
            scale,
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

    /// Those of its own triangles that may be in sight, in order.
    pub(crate) fn in_sight(&self, sight: &Sight) -> Vec<Range<usize>> {
        self.runs.in_sight(self.mesh.triangles.len(), sight)
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
        let (ray, unit, length) = self.ray(from_in_world, direction)?;
        let mut nearest: Option<Hit> = None;
        self.bvh.ray_traverse(ray, &mut RayHit::none(), |_, slot| {
            let mut bound = f32::INFINITY;
            for &triangle_idx in self.boxed.within(slot) {
                let corners = self.mesh.corners(triangle_idx as usize);
                let Some(along) = meet(corners.map(|p| p - from_in_world), unit, front_only) else {
                    continue;
                };
                if nearest.is_none_or(|known| is_nearer((along, triangle_idx), &known)) {
                    nearest = Some(Hit {
                        triangle_idx,
                        along,
                    });
                }
                // A little farther than it is, so that rounding hides nothing nearer.
                bound = bound.min((along * self.scale * (1.0 + 4.0 * ROUNDING)) as f32);
            }
            bound
        });
        nearest.map(|hit| Hit {
            along: hit.along / length,
            ..hit
        })
    }

    /// Its own triangles that a ray meets, from either side, no farther along than that, in lengths of the ray's
    /// direction; in order. Of those with the same corners it is the first.
    pub(crate) fn own_hits_until(
        &self,
        from_in_world: DVec3,
        direction: DVec3,
        along: f64,
    ) -> Vec<u32> {
        let mut met = Vec::new();
        let Some((ray, unit, length)) = self.ray(from_in_world, direction) else {
            return met;
        };
        let farthest = along * length;
        let ray = Ray {
            tmax: (farthest * self.scale * (1.0 + 4.0 * ROUNDING)) as f32,
            ..ray
        };
        self.bvh.ray_traverse(ray, &mut RayHit::none(), |_, slot| {
            for &triangle_idx in self.boxed.within(slot) {
                let corners = self.mesh.corners(triangle_idx as usize);
                let there = meet(corners.map(|p| p - from_in_world), unit, false);
                if there.is_some_and(|there| there <= farthest) {
                    met.push(triangle_idx);
                }
            }
            // None ends the search.
            f32::INFINITY
        });
        met.sort_unstable();
        met
    }

    /// The ray for the hierarchy, the direction in unit length, and its length; `None` where nothing can be met.
    #[inline]
    fn ray(&self, from_in_world: DVec3, direction: DVec3) -> Option<(Ray, DVec3, f64)> {
        let from = (from_in_world - self.origin) * self.scale;
        // Nor from beyond what f32 holds.
        let is_near = from.is_finite() && from.abs().max_element() <= FARTHEST;
        if self.boxed.triangles.is_empty() || !is_near || !direction.is_finite() {
            return None;
        }
        // Unit length, so that the distances compared in f32 are those of the world, scaled.
        let length = direction.length();
        let unit = direction / length;
        if !unit.is_finite() {
            return None;
        }
        let ray = Ray::new_inf(from.as_vec3().into(), unit.as_vec3().into());
        Some((ray, unit, length))
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

/// What a mesh of this typical size is multiplied by to be of a size that f32 holds: one as a rule, else a power of
/// two, which costs no digits.
fn scale_of(typical: f64) -> f64 {
    if typical == 0.0 || SIZES.contains(&typical) {
        return 1.0;
    }
    // As far as powers of two and what they are multiplied by are finite.
    let exponent = typical.log2().floor().clamp(-1000.0, 1000.0);
    2.0_f64.powi(-exponent as i32)
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
mod tests;
