//! The pieces of a mesh that hang together.

use super::Mesh;

impl Mesh {
    /// Drops every connected piece of fewer than `min_triangles` triangles, and corners that
    /// no triangle uses. The order of what stays is kept.
    pub fn drop_small_pieces(&mut self, min_triangles: usize) {
        let mut parent: Vec<u32> = (0..self.positions.len() as u32).collect();
        for [a, b, c] in &self.triangles {
            let root = find(&mut parent, *a);
            for other in [*b, *c] {
                let other = find(&mut parent, other);
                parent[other as usize] = root;
            }
        }
        let mut sizes = vec![0_usize; self.positions.len()];
        for t in &self.triangles {
            sizes[find(&mut parent, t[0]) as usize] += 1;
        }
        let mut is_large = |t: &[u32; 3]| sizes[find(&mut parent, t[0]) as usize] >= min_triangles;
        self.triangles.retain(|t| is_large(t));
        self.drop_unused();
    }

    /// Drops corners that no triangle uses.
    pub fn drop_unused(&mut self) {
        const UNUSED: u32 = u32::MAX;
        let mut renumbered = vec![UNUSED; self.positions.len()];
        for i in self.triangles.iter().flatten() {
            renumbered[*i as usize] = 0;
        }
        let mut used = 0;
        for (i, number) in renumbered.iter_mut().enumerate() {
            if *number != UNUSED {
                *number = used;
                self.positions[used as usize] = self.positions[i];
                used += 1;
            }
        }
        self.positions.truncate(used as usize);
        for i in self.triangles.iter_mut().flatten() {
            *i = renumbered[*i as usize];
        }
    }
}

/// The root of a corner's tree, the path to it halved.
fn find(parent: &mut [u32], mut i: u32) -> u32 {
    while parent[i as usize] != i {
        parent[i as usize] = parent[parent[i as usize] as usize];
        i = parent[i as usize];
    }
    i
}
