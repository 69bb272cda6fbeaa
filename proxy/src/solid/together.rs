//! Rays from one point that are met together.
//!
//! Rays of a pixel go through the same boxes of the hierarchy, so each box is looked at once for all of them, side by
//! side. What each meets is what it meets alone: which boxes are looked into decides nothing but time.

use super::{GAP, Hit, ROUNDING, Solid};
use glam::{BVec4A, DVec3, Vec3A, Vec4};
use obvhs::aabb::Aabb;
use obvhs::bvh2::node::Bvh2Node;
use pulp::Arch;
use std::array::from_fn;

/// So many rays.
pub const RAYS_TOGETHER: usize = 4;

/// A number of each.
type Each = [f64; RAYS_TOGETHER];

/// What is known of them, number by number.
struct Rays {
    /// In the hierarchy; and one over their directions.
    from: Vec3A,
    inverse: [Vec4; 3],
    /// In the world; and their directions, in unit length.
    from_in_world: DVec3,
    units: [Each; 3],
    /// How far along each the nearest triangle is that was found. Before everything for those that are not asked.
    nearest: Vec4,
}

impl Rays {
    /// How far along each a box begins; infinite where none of it lies before the nearest triangle.
    #[inline(always)]
    fn begin(&self, within: &Aabb) -> Vec4 {
        let (low, high) = (within.min - self.from, within.max - self.from);
        let (mut first, mut last) = (Vec4::NEG_INFINITY, Vec4::INFINITY);
        for k in 0..3 {
            let (a, b) = (self.inverse[k] * low[k], self.inverse[k] * high[k]);
            first = first.max(a.min(b));
            last = last.min(a.max(b));
        }
        let is_ahead = last.cmpge(first) & last.cmpge(Vec4::ZERO);
        Vec4::select(is_ahead & self.are_before(first), first, Vec4::INFINITY)
    }

    /// Which have met nothing up to there.
    #[inline(always)]
    fn are_before(&self, along: Vec4) -> BVec4A {
        along.cmplt(self.nearest)
    }
}

impl Solid {
    /// What [`Self::first_hit`] says of each of some rays from one point, which had better be near one another. (Of a
    /// direction that is no number that is `None`.)
    pub fn first_hits(
        &self,
        from_in_world: DVec3,
        directions: [DVec3; RAYS_TOGETHER],
    ) -> [Option<Hit>; RAYS_TOGETHER] {
        if self.within.is_some() {
            return directions.map(|direction| self.first_hit(from_in_world, direction));
        }
        let rays = directions.map(|direction| self.ray(from_in_world, direction));
        let Some((first, ..)) = rays.iter().flatten().next() else {
            return [None; RAYS_TOGETHER];
        };
        let mut asked = Rays {
            from: first.origin,
            inverse: from_fn(|k| {
                let inverse = rays.map(|ray| ray.map_or(1.0, |(ray, ..)| ray.inv_direction[k]));
                Vec4::from_array(inverse)
            }),
            from_in_world,
            units: from_fn(|k| rays.map(|ray| ray.map_or(f64::NAN, |(_, unit, _)| unit[k]))),
            nearest: Vec4::from_array(rays.map(|ray| match ray {
                Some(_) => f32::INFINITY,
                None => f32::NEG_INFINITY,
            })),
        };
        let mut hits = [None; RAYS_TOGETHER];
        Arch::new().dispatch(
            #[inline(always)]
            || self.visit(&mut asked, &mut hits),
        );
        let mut lengths = rays.into_iter().map(|ray| ray.map(|(.., length)| length));
        hits.map(|hit: Option<Hit>| {
            let length = lengths.next().flatten();
            hit.zip(length).map(|(hit, length)| Hit {
                along: hit.along / length,
                ..hit
            })
        })
    }

    /// Goes into boxes, the nearer of two first.
    #[inline(always)]
    fn visit(&self, rays: &mut Rays, hits: &mut [Option<Hit>; RAYS_TOGETHER]) {
        let nodes = &self.bvh.nodes;
        let Some(root) = nodes.first() else {
            return;
        };
        let first = rays.begin(root.aabb());
        if first.min_element() == f32::INFINITY {
            return;
        }
        if root.is_leaf() {
            return self.meet_within(root, first, rays, hits);
        }
        // Pairs of boxes that are yet to be looked into, by the first of each.
        let mut open = Vec::with_capacity(64);
        open.push(root.first_index as usize);
        while let Some(at) = open.pop() {
            let mut pair = [&nodes[at], &nodes[at + 1]].map(|node| (node, rays.begin(node.aabb())));
            if pair[1].1.min_element() < pair[0].1.min_element() {
                pair.swap(0, 1);
            }
            let mut near = None;
            for (node, first) in pair {
                if !rays.are_before(first).any() {
                    continue;
                }
                if node.is_leaf() {
                    self.meet_within(node, first, rays, hits);
                    continue;
                }
                let below = node.first_index as usize;
                match near {
                    None => near = Some(below),
                    Some(_) => open.push(below),
                }
            }
            open.extend(near);
        }
    }

    /// Meets the triangles of a leaf, which begins so far along each ray.
    #[inline(always)]
    fn meet_within(
        &self,
        leaf: &Bvh2Node,
        first: Vec4,
        rays: &mut Rays,
        hits: &mut [Option<Hit>; RAYS_TOGETHER],
    ) {
        let front_only = self.kind.has_front_sides_only();
        let slots = leaf.first_index..leaf.first_index + leaf.prim_count;
        let asked = rays.are_before(first).bitmask();
        for &triangle_idx in slots.flat_map(|slot| self.boxed.within(slot as usize)) {
            let corners = self.mesh.corners(triangle_idx as usize);
            let corners = corners.map(|corner| corner - rays.from_in_world);
            let met = meet_each(corners, &rays.units, front_only);
            for (lane, along) in met.into_iter().enumerate() {
                if asked >> lane & 1 == 0 || along == f64::INFINITY {
                    continue;
                }
                let hit = &mut hits[lane];
                if hit.is_none_or(|known| is_nearer((along, triangle_idx), &known)) {
                    *hit = Some(Hit {
                        triangle_idx,
                        along,
                    });
                }
                // A little farther than it is, so that rounding hides nothing nearer.
                let bound = (along * self.scale * (1.0 + 4.0 * ROUNDING)) as f32;
                rays.nearest[lane] = rays.nearest[lane].min(bound);
            }
        }
    }
}

/// How far along each ray from the origin meets a triangle, by the arithmetic of [`meet`](super::meet); infinite where it
/// does not.
#[inline(always)]
fn meet_each([a, b, c]: [DVec3; 3], [x, y, z]: &[Each; 3], front_only: bool) -> Each {
    let (ab, ac) = (b - a, c - a);
    let turned = -a.cross(ab);
    let reached = ac.dot(turned);
    let p = each(|i| y[i] * ac.z - ac.y * z[i]);
    let q = each(|i| z[i] * ac.x - ac.z * x[i]);
    let r = each(|i| x[i] * ac.y - ac.x * y[i]);
    let volume = each(|i| ab.x * p[i] + ab.y * q[i] + ab.z * r[i]);
    let share_b = each(|i| -(a.x * p[i] + a.y * q[i] + a.z * r[i]) / volume[i]);
    let share_c = each(|i| (x[i] * turned.x + y[i] * turned.y + z[i] * turned.z) / volume[i]);
    let along = each(|i| reached / volume[i]);
    each(|i| {
        let (b, c) = (share_b[i], share_c[i]);
        let is_inside = (b >= -GAP) & (c >= -GAP) & (b + c <= 1.0 + GAP);
        let is_seen = !front_only | (volume[i] > 0.0);
        match is_inside & is_seen & (along[i] > 0.0) {
            true => along[i],
            false => f64::INFINITY,
        }
    })
}

#[inline(always)]
fn each(f: impl Fn(usize) -> f64) -> Each {
    let mut all = [0.0; RAYS_TOGETHER];
    for i in 0..RAYS_TOGETHER {
        all[i] = f(i);
    }
    all
}

/// Whether a triangle is met before another one, or is the first of two that are met at once.
pub(super) fn is_nearer((along, triangle_idx): (f64, u32), other: &Hit) -> bool {
    let order = along.total_cmp(&other.along);
    order.then(triangle_idx.cmp(&other.triangle_idx)).is_lt()
}
