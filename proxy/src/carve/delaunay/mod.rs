//! The Delaunay tetrahedralisation of lattice places, by insertion (Bowyer 1981; Watson
//! 1981).
//!
//! One vertex at infinity closes the hull: a tetrahedron that has it (a ghost) stands for the
//! half-space beyond a hull facet. A new point takes away the tetrahedra in *strict* conflict
//! with it, those whose open ball holds it, and is joined to the border of the hole. Because
//! the triangulation before was Delaunay, that hole is star-shaped around the point and no
//! new tetrahedron is flat, however many points lie on one sphere or plane: of cospherical
//! points the order of insertion decides. All predicates are exact.

mod order;
mod predicates;

use super::lattice::Site;
pub(super) use order::hilbert;
use order::insertion_order;
use predicates::{in_sphere, orientation};
use std::cmp::Ordering;

/// The vertex at infinity.
pub(super) const INFINITE: u32 = u32::MAX;
const NONE: u32 = u32::MAX;

/// Tetrahedra and who is next to whom.
///
/// A facet is named `4 · tetrahedron + k` and lies opposite the tetrahedron's corner k.
#[derive(Clone, Debug)]
pub(super) struct Delaunay {
    /// The vertices, all distinct.
    pub(super) sites: Vec<Site>,
    /// Corners, positively oriented. The finite ones come first; after them the ghosts, which
    /// have [`INFINITE`] for one corner.
    pub(super) tetrahedra: Vec<[u32; 4]>,
    /// The same facet as its other tetrahedron names it.
    pub(super) across: Vec<[u32; 4]>,
    /// How many tetrahedra are finite.
    pub(super) finite: usize,
}

/// All sites lie on one plane (or line, or there are fewer than four).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Flat;

impl Delaunay {
    /// Triangulates distinct sites.
    pub(super) fn new(sites: Vec<Site>) -> Result<Self, Flat> {
        let order = insertion_order(&sites);
        let first = first_four(&sites, &order).ok_or(Flat)?;
        let mut builder = Builder::new(sites, first);
        for vertex in order {
            if !first.contains(&vertex) {
                builder.insert(vertex);
            }
        }
        Ok(builder.finish())
    }

    /// Whether a tetrahedron has the vertex at infinity.
    pub(super) fn is_ghost(&self, tetrahedron: u32) -> bool {
        tetrahedron as usize >= self.finite
    }

    /// The places of a finite tetrahedron's corners.
    pub(super) fn corners(&self, tetrahedron: u32) -> [Site; 4] {
        self.tetrahedra[tetrahedron as usize].map(|v| self.sites[v as usize])
    }

    /// The tetrahedron that holds a place, found by walking from `start`; a ghost where it
    /// lies outside the hull.
    pub(super) fn locate(&self, place: Site, start: u32) -> u32 {
        locate(&self.sites, &self.tetrahedra, &self.across, place, start)
    }

    /// For each vertex one finite tetrahedron that has it.
    pub(super) fn tetrahedron_of_vertex(&self) -> Vec<u32> {
        let mut of_vertex = vec![NONE; self.sites.len()];
        for (t, corners) in self.tetrahedra[..self.finite].iter().enumerate() {
            for &v in corners {
                of_vertex[v as usize] = t as u32;
            }
        }
        of_vertex
    }
}

/// Four sites that span space, the first such in order, positively oriented.
fn first_four(sites: &[Site], order: &[u32]) -> Option<[u32; 4]> {
    let site = |v: u32| sites[v as usize];
    let mut rest = order.iter().copied();
    let (a, b) = (rest.next()?, rest.next()?);
    let across = |c: u32| {
        let [ab, ac] = [b, c].map(|p| [0, 1, 2].map(|i| i64::from(site(p)[i] - site(a)[i])));
        [(1, 2), (2, 0), (0, 1)].map(|(i, j)| ab[i] * ac[j] - ab[j] * ac[i])
    };
    let c = rest.by_ref().find(|&c| across(c) != [0; 3])?;
    for d in rest {
        match orientation([a, b, c, d].map(site)) {
            Ordering::Greater => return Some([a, b, c, d]),
            Ordering::Less => return Some([a, c, b, d]),
            Ordering::Equal => {}
        }
    }
    None
}

/// See [`Delaunay::locate`].
fn locate(
    sites: &[Site],
    tetrahedra: &[[u32; 4]],
    across: &[[u32; 4]],
    place: Site,
    start: u32,
) -> u32 {
    let site = |v: u32| sites[v as usize];
    let mut at = start;
    // From a ghost, through its hull facet.
    if let Some(k) = tetrahedra[at as usize].iter().position(|&v| v == INFINITE) {
        at = across[at as usize][k] >> 2;
    }
    let mut from = NONE;
    let mut turn = 0;
    // Such a walk ends in any Delaunay triangulation (Edelsbrunner 1990).
    'walk: loop {
        turn += 1;
        let corners = tetrahedra[at as usize];
        for k in 0..4 {
            let k = (k + turn) & 3;
            let next = across[at as usize][k] >> 2;
            if next == from {
                continue;
            }
            let mut four = corners.map(site);
            four[k] = place;
            if orientation(four) == Ordering::Less {
                if tetrahedra[next as usize].contains(&INFINITE) {
                    return next;
                }
                (from, at) = (at, next);
                continue 'walk;
            }
        }
        return at;
    }
}

/// A triangulation that grows.
struct Builder {
    sites: Vec<Site>,
    tetrahedra: Vec<[u32; 4]>,
    across: Vec<[u32; 4]>,
    /// Twice the insertion that last looked at a tetrahedron, plus one if it was kept.
    mark: Vec<u32>,
    stamp: u32,
    /// Slots that no tetrahedron uses.
    free: Vec<u32>,
    /// Where the next walk starts.
    last: u32,
    hole: Vec<u32>,
    border: Vec<Border>,
}

/// A facet of the hole's border.
struct Border {
    /// The tetrahedron inside the hole, and which of its facets.
    inside: u32,
    facet: usize,
    /// The tetrahedron that fills the hole there.
    new: u32,
}

impl Builder {
    fn new(sites: Vec<Site>, first: [u32; 4]) -> Self {
        let mut tetrahedra = vec![first];
        // A ghost has the same facet the other way round: swap two of its corners.
        for k in 0..4 {
            let mut ghost = first;
            ghost[k] = INFINITE;
            ghost.swap((k + 1) % 4, (k + 2) % 4);
            tetrahedra.push(ghost);
        }
        let across = (0..5).map(|t| across_of(&tetrahedra, t)).collect();
        Self {
            sites,
            mark: vec![0; tetrahedra.len()],
            tetrahedra,
            across,
            stamp: 0,
            free: Vec::new(),
            last: 0,
            hole: Vec::new(),
            border: Vec::new(),
        }
    }

    fn insert(&mut self, vertex: u32) {
        let place = self.sites[vertex as usize];
        self.stamp += 1;
        let (gone, kept) = (2 * self.stamp, 2 * self.stamp + 1);

        // 1. The hole: everything in conflict is connected.
        let start = locate(
            &self.sites,
            &self.tetrahedra,
            &self.across,
            place,
            self.last,
        );
        self.hole.clear();
        self.border.clear();
        self.hole.push(start);
        self.mark[start as usize] = gone;
        let mut done = 0;
        while let Some(&inside) = self.hole.get(done) {
            done += 1;
            for facet in 0..4 {
                let next = self.across[inside as usize][facet] >> 2;
                let mark = self.mark[next as usize];
                if mark == gone {
                    continue;
                }
                if mark != kept && self.in_conflict(next, place) {
                    self.mark[next as usize] = gone;
                    self.hole.push(next);
                    continue;
                }
                self.mark[next as usize] = kept;
                self.border.push(Border {
                    inside,
                    facet,
                    new: NONE,
                });
            }
        }

        // 2. A tetrahedron from each facet of its border to the new point.
        for i in 0..self.border.len() {
            let Border { inside, facet, .. } = self.border[i];
            let mut corners = self.tetrahedra[inside as usize];
            corners[facet] = vertex;
            let outside = self.across[inside as usize][facet];
            let mut across = [NONE; 4];
            across[facet] = outside;
            let new = self.take_slot(corners, across);
            self.across[outside as usize >> 2][outside as usize & 3] = 4 * new + facet as u32;
            self.border[i].new = new;
        }

        // 3. Joined to each other: around each edge of the border, through the hole.
        for i in 0..self.border.len() {
            let Border { inside, facet, new } = self.border[i];
            for k in (0..4).filter(|&k| k != facet) {
                if self.across[new as usize][k] == NONE {
                    let (other, other_k) = self.around_edge(inside, facet, k, kept);
                    self.across[new as usize][k] = 4 * other + other_k;
                    self.across[other as usize][other_k as usize] = 4 * new + k as u32;
                }
            }
        }
        self.free.append(&mut self.hole);
        self.last = self.border[self.border.len() - 1].new;
    }

    /// Whether the tetrahedron's open ball holds the place; a ghost's ball is the open
    /// half-space beyond its facet and, in the facet's plane, the open disc around it.
    fn in_conflict(&self, tetrahedron: u32, place: Site) -> bool {
        let corners = self.tetrahedra[tetrahedron as usize];
        let site = |v: u32| self.sites[v as usize];
        let Some(k) = corners.iter().position(|&v| v == INFINITE) else {
            return in_sphere(corners.map(site), place) == Ordering::Greater;
        };
        let mut four = corners.map(|v| if v == INFINITE { place } else { site(v) });
        match orientation(four) {
            Ordering::Greater => true,
            Ordering::Less => false,
            Ordering::Equal => {
                let finite = self.across[tetrahedron as usize][k] >> 2;
                four = self.tetrahedra[finite as usize].map(site);
                in_sphere(four, place) == Ordering::Greater
            }
        }
    }

    /// From the border's facet, around its edge that does not touch corner `k`, through the
    /// hole to the border's next facet: the new tetrahedron there, and which of its facets
    /// holds that edge and the new point.
    fn around_edge(&self, inside: u32, facet: usize, k: usize, kept: u32) -> (u32, u32) {
        let index_of = |t: u32, v: u32| {
            let corners = self.tetrahedra[t as usize];
            corners
                .iter()
                .position(|&c| c == v)
                .expect("a shared corner")
        };
        // `third` is the corner beside the edge in the facet that is crossed.
        let (mut at, mut through) = (inside, k);
        let mut third = self.tetrahedra[inside as usize][facet];
        loop {
            let code = self.across[at as usize][through];
            let (next, entry) = (code >> 2, code as usize & 3);
            // What was outside points at the new tetrahedron by now.
            if self.mark[next as usize] == kept {
                let beyond = self.across[next as usize][entry] >> 2;
                return (beyond, index_of(beyond, third) as u32);
            }
            through = index_of(next, third);
            third = self.tetrahedra[next as usize][entry];
            at = next;
        }
    }

    fn take_slot(&mut self, corners: [u32; 4], across: [u32; 4]) -> u32 {
        if let Some(slot) = self.free.pop() {
            self.tetrahedra[slot as usize] = corners;
            self.across[slot as usize] = across;
            self.mark[slot as usize] = 0;
            return slot;
        }
        self.tetrahedra.push(corners);
        self.across.push(across);
        self.mark.push(0);
        self.tetrahedra.len() as u32 - 1
    }

    /// Drops unused slots and puts the ghosts last.
    fn finish(self) -> Delaunay {
        let Self {
            sites,
            tetrahedra,
            across,
            mark,
            free,
            ..
        } = self;
        drop(mark);
        let mut new_index = vec![0; tetrahedra.len()];
        for slot in free {
            new_index[slot as usize] = NONE;
        }
        let mut kept = Vec::new();
        for ghosts in [false, true] {
            for (t, corners) in tetrahedra.iter().enumerate() {
                if new_index[t] != NONE && corners.contains(&INFINITE) == ghosts {
                    kept.push(t as u32);
                }
            }
        }
        for (new, &old) in kept.iter().enumerate() {
            new_index[old as usize] = new as u32;
        }
        let is_finite = |t: &&u32| !tetrahedra[**t as usize].contains(&INFINITE);
        let finite = kept.iter().take_while(is_finite).count();
        let renamed = |code: u32| 4 * new_index[code as usize >> 2] + (code & 3);
        Delaunay {
            sites,
            finite,
            tetrahedra: kept.iter().map(|&t| tetrahedra[t as usize]).collect(),
            across: kept
                .iter()
                .map(|&t| across[t as usize].map(renamed))
                .collect(),
        }
    }
}

/// The facets of one of a few tetrahedra, by searching all.
fn across_of(tetrahedra: &[[u32; 4]], t: usize) -> [u32; 4] {
    let without = |t: usize, k: usize| {
        let mut facet: Vec<u32> = tetrahedra[t].to_vec();
        facet.remove(k);
        facet.sort_unstable();
        facet
    };
    [0, 1, 2, 3].map(|k| {
        let shared = (0..tetrahedra.len() * 4)
            .find(|&code| code >> 2 != t && without(code >> 2, code & 3) == without(t, k));
        shared.expect("five tetrahedra close") as u32
    })
}

#[cfg(test)]
mod tests;
