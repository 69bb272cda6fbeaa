//! Polygons and strips of mesh files, cut into triangles.

use super::Mesh;
use glam::{DVec2, DVec3};
use std::collections::VecDeque;
use std::ops::Range;

/// So much of its area a polygon's triangles may cover that it does not: corners on a line are on it
/// only to the digits that a file has.
const BEYOND: f64 = 1e-5;
/// Polygons of more corners stay as they were cut first: cutting off ears takes time with the square of
/// their number.
const MOST_CORNERS: usize = 4096;
/// How often all corners are asked anew whether they are ears. Of a simple polygon once is enough, but for
/// corners that touch sides.
const ROUNDS: usize = 8;

/// A polygon cut into triangles that share its first corner.
#[derive(Default)]
pub(super) struct Fan {
    first: Option<u32>,
    last: Option<u32>,
}

impl Fan {
    /// Takes in the next corner.
    pub(super) fn corner(&mut self, index: u32, triangles: &mut Vec<[u32; 3]>) {
        match (self.first, self.last) {
            (None, _) => self.first = Some(index),
            (Some(first), Some(last)) => {
                triangles.push([first, last, index]);
                self.last = Some(index);
            }
            (Some(_), None) => self.last = Some(index),
        }
    }
}

/// Triangles that share two corners with the one before, and another with the next.
#[derive(Default)]
pub(super) struct Strip {
    /// How many corners there were, and the last two.
    count: usize,
    last: [u32; 2],
}

impl Strip {
    /// Takes in the next corner.
    pub(super) fn corner(&mut self, index: u32, triangles: &mut Vec<[u32; 3]>) {
        let [a, b] = self.last;
        // Every other triangle is turned.
        match (self.count < 2, self.count % 2) {
            (true, _) => (),
            (false, 0) => triangles.push([a, b, index]),
            (false, _) => triangles.push([b, a, index]),
        }
        self.last = [b, index];
        self.count += 1;
    }
}

/// Which of a mesh's triangles are [`Fan`]s of several. Whether these are right shows only when all
/// corners are known, which may follow their faces in a file.
#[derive(Default)]
pub(super) struct Fans {
    triangles: Vec<Range<usize>>,
}

impl Fans {
    /// Takes in the triangles of one polygon.
    pub(super) fn note(&mut self, triangles: Range<usize>) {
        if triangles.len() > 1 {
            self.triangles.push(triangles);
        }
    }

    /// Cuts anew what its fan does not cover, or not alone: polygons that are not convex. Theirs are
    /// as many triangles in the same place of the mesh. What is too large, crosses itself or covers
    /// nothing stays a fan.
    pub(super) fn mend(self, mesh: &mut Mesh) {
        for fan in self.triangles {
            let triangles = &mut mesh.triangles[fan];
            let place = |corner: u32| mesh.positions[corner as usize];
            let Some(normal) = turned_over(triangles, place) else {
                continue;
            };
            let [first, second, _] = triangles[0];
            let others = triangles.iter().map(|t| t[2]);
            let corners: Vec<u32> = [first, second].into_iter().chain(others).collect();
            if corners.len() > MOST_CORNERS {
                continue;
            }
            let x = normal.any_orthonormal_vector();
            let y = normal.cross(x);
            // Relative to a corner: digits far from the world's origin.
            let flat = |corner: &u32| {
                let offset = place(*corner) - place(first);
                DVec2::new(offset.dot(x), offset.dot(y))
            };
            let flat: Vec<DVec2> = corners.iter().map(flat).collect();
            if let Some(ears) = ears(&flat) {
                let corners_of = |ear: [usize; 3]| ear.map(|i| corners[i]);
                let ears = ears.into_iter().map(corners_of);
                triangles.iter_mut().zip(ears).for_each(|(t, ear)| *t = ear);
            }
        }
    }
}

/// The unit normal of a fan of which some triangles are turned over; `None` where none is, or it
/// covers nothing.
fn turned_over(fan: &[[u32; 3]], place: impl Fn(u32) -> DVec3) -> Option<DVec3> {
    let area = |t: &[u32; 3]| {
        let [a, b, c] = t.map(&place);
        (b - a).cross(c - a)
    };
    // Newell's normal, twice the polygon's area long.
    let newell: DVec3 = fan.iter().map(area).sum();
    let wrong = |t: &[u32; 3]| (-area(t).dot(newell)).max(0.0);
    let wrong: f64 = fan.iter().map(wrong).sum();
    // What is too small or too large to be squared is left alone.
    let is_wrong = wrong > BEYOND * newell.length_squared();
    let normal = newell.try_normalize();
    normal.filter(|_| is_wrong)
}

/// The triangles of a counter-clockwise polygon, by its corners, two less than these: ears, which have no
/// other corner in them, cut off one after the other (Meisters 1975, "Polygons have ears"). `None` where
/// there is none though some is left, as the polygon crosses itself.
fn ears(flat: &[DVec2]) -> Option<Vec<[usize; 3]>> {
    let count = flat.len();
    let mut next: Vec<usize> = (0..count).map(|i| (i + 1) % count).collect();
    let mut before: Vec<usize> = (0..count).map(|i| (i + count - 1) % count).collect();
    let turn = |[a, b, c]: [usize; 3]| (flat[b] - flat[a]).perp_dot(flat[c] - flat[a]);
    let area = |left: usize, next: &[usize]| {
        let mut at = next[left];
        let mut sum = 0.0;
        while next[at] != left {
            sum += turn([left, at, next[at]]);
            at = next[at];
        }
        sum
    };
    let spare = BEYOND * area(0, &next);
    // Only corners that are not convex can be in the way. Cutting makes some convex, and none the reverse.
    let mut dents: Vec<usize> = (0..count)
        .filter(|&i| !(turn([before[i], i, next[i]]) > 0.0))
        .collect();
    let mut is_left = vec![true; count];
    let mut cut = Vec::with_capacity(count - 2);
    for _ in 0..ROUNDS {
        let before_round = cut.len();
        // Whether a corner is an ear changes only as its neighbours do, mostly.
        let mut asked: VecDeque<usize> = (0..count).filter(|&i| is_left[i]).collect();
        while let Some(i) = asked.pop_front() {
            if cut.len() + 3 == count {
                break;
            }
            let ear = [before[i], i, next[i]];
            let is_in_the_way = |&dent: &usize| {
                let at = flat[dent];
                let is_outside = (0..3).any(|k| {
                    let [from, to] = [ear[k], ear[(k + 1) % 3]].map(|corner| flat[corner]);
                    (to - from).perp_dot(at - from) < 0.0
                });
                // Where a hole is joined to the outline corners come twice.
                !is_outside && ear.iter().all(|&corner| flat[corner] != at)
            };
            // A corner that comes twice in a row is an ear of no area.
            let [p, q, r] = ear.map(|corner| flat[corner]);
            let is_ear = || turn(ear) > 0.0 && !dents.iter().any(is_in_the_way);
            if !is_left[i] || !(p == q || q == r || is_ear()) {
                continue;
            }
            cut.push(ear);
            is_left[i] = false;
            let [a, _, c] = ear;
            (next[a], before[c]) = (c, a);
            dents.retain(|&dent| {
                let is_beside = dent == a || dent == c;
                dent != i && !(is_beside && turn([before[dent], dent, next[dent]]) > 0.0)
            });
            asked.extend([a, c]);
        }
        if cut.len() == before_round {
            break;
        }
    }
    // What is left is a triangle, or lies on a line.
    let first = is_left.iter().position(|left| *left)?;
    let rest = area(first, &next);
    let is_whole = cut.len() + 3 == count && rest >= -spare;
    if !(is_whole || rest.abs() <= spare) {
        return None;
    }
    let mut at = next[first];
    while next[at] != first {
        cut.push([first, at, next[at]]);
        at = next[at];
    }
    Some(cut)
}
