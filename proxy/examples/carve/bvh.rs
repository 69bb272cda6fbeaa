//! Rays against a mesh.

use glam::DVec3;
use proxy::Mesh;

/// A tree of boxes around a mesh's triangles.
pub(crate) struct Bvh<'a> {
    mesh: &'a Mesh,
    order: Vec<u32>,
    nodes: Vec<Node>,
}

struct Node {
    low: DVec3,
    high: DVec3,
    first: u32,
    count: u32,
    /// The second child's index; the first one's is the next.
    second: u32,
}

impl<'a> Bvh<'a> {
    pub(crate) fn new(mesh: &'a Mesh) -> Self {
        let mut bvh = Self {
            mesh,
            order: (0..mesh.triangles.len() as u32).collect(),
            nodes: Vec::new(),
        };
        bvh.split(0, mesh.triangles.len());
        bvh
    }

    fn split(&mut self, first: usize, count: usize) {
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for &t in &self.order[first..first + count] {
            for p in self.mesh.corners(t as usize) {
                (low, high) = (low.min(p), high.max(p));
            }
        }
        let at = self.nodes.len();
        self.nodes.push(Node {
            low,
            high,
            first: first as u32,
            count: count as u32,
            second: 0,
        });
        if count <= 4 {
            return;
        }
        let size = high - low;
        let axis = if size.x >= size.y && size.x >= size.z {
            0
        } else if size.y >= size.z {
            1
        } else {
            2
        };
        let mesh = self.mesh;
        let key = |t: &u32| {
            mesh.corners(*t as usize)
                .iter()
                .map(|p| p[axis])
                .sum::<f64>()
        };
        self.order[first..first + count]
            .select_nth_unstable_by(count / 2, |a, b| key(a).total_cmp(&key(b)));
        self.nodes[at].count = 0;
        self.split(first, count / 2);
        self.nodes[at].second = self.nodes.len() as u32;
        self.split(first + count / 2, count - count / 2);
    }

    /// The nearest hit: the ray's multiple and the triangle.
    pub(crate) fn hit(&self, origin: DVec3, ray: DVec3) -> Option<(f64, u32)> {
        let mut best: Option<(f64, u32)> = None;
        let mut stack = vec![0usize];
        while let Some(at) = stack.pop() {
            let node = &self.nodes[at];
            let (a, b) = ((node.low - origin) / ray, (node.high - origin) / ray);
            let enter = a.min(b).max_element().max(0.0);
            let leave = a.max(b).min_element();
            if !(enter <= leave * (1.0 + 1e-12)) || best.is_some_and(|(t, _)| enter > t) {
                continue;
            }
            if node.second == 0 {
                let first = node.first as usize;
                for &t in &self.order[first..first + node.count as usize] {
                    let along = meet(self.mesh.corners(t as usize), origin, ray);
                    if let Some(along) = along
                        && best.is_none_or(|(least, _)| along < least)
                    {
                        best = Some((along, t));
                    }
                }
            } else {
                stack.push(node.second as usize);
                stack.push(at + 1);
            }
        }
        best
    }
}

/// Where a ray meets a triangle, either side.
fn meet([a, b, c]: [DVec3; 3], origin: DVec3, ray: DVec3) -> Option<f64> {
    let (a, b, c) = (a - origin, b - origin, c - origin);
    let [u, v, w] = [b.cross(c), c.cross(a), a.cross(b)].map(|n| n.dot(ray));
    let inside = (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
    let normal = (b - a).cross(c - a);
    let along = normal.dot(a) / normal.dot(ray);
    (inside && along > 0.0 && along.is_finite()).then_some(along)
}
