//! Convex pieces of a polygon.
//!
//! Ears are cut off, one after the other; then the cuts go that pieces can do without, as what is on both
//! sides of them is convex together (Hertel and Mehlhorn 1983, "Fast triangulation of simple polygons"): at
//! most four times as many pieces are left as it takes.

use super::{Polygon, cross, thin};
use glam::{DVec2, DVec3};
use std::sync::OnceLock;

/// A corner that is no farther inside the line between its neighbours is on it, in shares of the
/// extent: files round positions to f32. Without it the polygon is larger by as much.
pub(super) const STRAIGHT_INSIDE: f64 = 1e-6;
/// The same outside of it: without that corner the polygon is smaller, and nothing may be hidden.
const STRAIGHT_OUTSIDE: f64 = 1e-12;
/// A piece of more than three corners is convex from wherever one looks if all of them are outside the line
/// between their neighbours by so many times what any is off the plane.
const ASLANT: f64 = 100.0;

/// A polygon's convex pieces once somebody has asked for them. They follow from its corners, so that they make no
/// difference between polygons.
#[derive(Clone, Debug, Default)]
pub(super) struct Pieces(OnceLock<Vec<Vec<DVec3>>>);

impl PartialEq for Pieces {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl Polygon {
    /// Convex pieces, each counter-clockwise around the normal: itself, or what it takes. Corners on a
    /// straight side are left out, as rounding would bend it inwards there. They are found once, when they are first
    /// asked for.
    pub fn convex_pieces(&self) -> &[Vec<DVec3>] {
        self.pieces.0.get_or_init(|| self.find_pieces())
    }

    fn find_pieces(&self) -> Vec<Vec<DVec3>> {
        let flat = self.flattened();
        let outline = self.bends(&flat);
        let is_convex = |i: usize| {
            let corner = |k: usize| flat[outline[(i + k) % outline.len()]];
            cross(corner(0), corner(1), corner(2)) >= 0.0
        };
        let pieces = match (0..outline.len()).all(is_convex) {
            true => vec![outline],
            false => self.merged(&flat, ears(&flat, outline)),
        };
        let corners =
            |piece: &Vec<usize>| -> Vec<DVec3> { piece.iter().map(|k| self.corners[*k]).collect() };
        pieces.iter().map(corners).collect()
    }

    /// The corners that are not on a straight side, in order; `flat` are all of them on the plane.
    fn bends(&self, flat: &[DVec2]) -> Vec<usize> {
        let straight = -STRAIGHT_INSIDE * self.size..=STRAIGHT_OUTSIDE * self.size;
        let mut left: Vec<usize> = (0..flat.len()).collect();
        thin(&mut left, |corners| {
            straight.contains(&outside(flat, corners))
        });
        left
    }

    /// Triangles without the cuts between them that convex pieces can do without, in the order of
    /// [`ears`].
    fn merged(&self, flat: &[DVec2], triangles: Vec<Vec<usize>>) -> Vec<Vec<usize>> {
        // Whoever looks aslant sees corners that are off the plane beside their places.
        let off = self.corners.iter().map(|p| self.height(*p).abs());
        let aslant = ASLANT * off.fold(0.0, f64::max);
        let straight = STRAIGHT_OUTSIDE * self.size;
        let convex = |piece: &[usize]| {
            let mut left = piece.to_vec();
            if aslant <= straight {
                thin(&mut left, |corners| {
                    outside(flat, corners).abs() <= straight
                });
            }
            let n = left.len();
            let is_convex = |i: usize| {
                let corners = [(i + n - 1) % n, i, (i + 1) % n].map(|k| left[k]);
                outside(flat, corners) > straight.max(aslant)
            };
            (0..n).all(is_convex).then_some(left)
        };
        // A sliver that rounding turned over is no part of anything.
        let is_sliver = |piece: &[usize]| match *piece {
            [a, b, c] => !(cross(flat[a], flat[b], flat[c]) > 0.0),
            _ => false,
        };
        let last = triangles.len() - 1;
        let cuts: Vec<[usize; 2]> = triangles[..last].iter().map(|t| [t[0], t[2]]).collect();
        let mut pieces = triangles;
        for [a, c] in cuts {
            let (Some([one, start]), Some([other, end])) =
                (with_side(&pieces, [c, a]), with_side(&pieces, [a, c]))
            else {
                continue;
            };
            if is_sliver(&pieces[one]) || is_sliver(&pieces[other]) {
                continue;
            }
            // From a to c, and back.
            let (mut both, mut back) = (pieces[one].clone(), pieces[other].clone());
            both.rotate_left(start);
            back.rotate_left(end);
            both.extend_from_slice(&back[1..back.len() - 1]);
            if convex(&both).is_some() {
                pieces[one] = both;
                pieces[other].clear();
            }
        }
        pieces.retain(|piece| !piece.is_empty());
        let thinned = |piece: Vec<usize>| convex(&piece).unwrap_or(piece);
        pieces.into_iter().map(thinned).collect()
    }
}

/// How far a corner is outside the line between its neighbours, given between them; NaN where these are one.
fn outside(flat: &[DVec2], corners: [usize; 3]) -> f64 {
    let [a, b, c] = corners.map(|k| flat[k]);
    cross(a, b, c) / a.distance(c)
}

/// Triangles of an outline, each cut off what is left of it by the side from its last corner to its first, but for the
/// last one.
fn ears(flat: &[DVec2], mut left: Vec<usize>) -> Vec<Vec<usize>> {
    let mut triangles = Vec::new();
    while left.len() > 3 {
        let n = left.len();
        let ear = |i: usize| {
            let [a, b, c] = [left[(i + n - 1) % n], left[i], left[(i + 1) % n]];
            let (p, q, r) = (flat[a], flat[b], flat[c]);
            let mut others = left.iter().filter(|o| ![a, b, c].contains(o));
            cross(p, q, r) > 0.0
                && others.all(|o| {
                    let o = flat[*o];
                    let is_outside =
                        cross(p, q, o) < 0.0 || cross(q, r, o) < 0.0 || cross(r, p, o) < 0.0;
                    is_outside || o == p || o == q || o == r
                })
        };
        // A simple polygon has one; rounding may hide it in a sliver, which then goes.
        let i = (0..n).find(|i| ear(*i)).unwrap_or(0);
        triangles.push(vec![left[(i + n - 1) % n], left[i], left[(i + 1) % n]]);
        left.remove(i);
    }
    triangles.push(left);
    triangles
}

/// The piece that has a side from one corner to another, and the place of that other one in it.
fn with_side(pieces: &[Vec<usize>], [from, to]: [usize; 2]) -> Option<[usize; 2]> {
    let place = |piece: &Vec<usize>| {
        let n = piece.len();
        let mut places = (0..n).filter(|k| piece[*k] == from);
        places
            .find(|k| piece[(k + 1) % n] == to)
            .map(|k| (k + 1) % n)
    };
    let mut places = pieces.iter().map(place).enumerate();
    places.find_map(|(i, place)| place.map(|place| [i, place]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;
    use std::f64::consts::TAU;

    /// What convex pieces of a polygon cover together.
    fn area(of: &Polygon, pieces: &[Vec<DVec3>]) -> f64 {
        let twice = |p: &Vec<DVec3>| {
            let across = |i: usize| (p[i] - p[0]).cross(p[i + 1] - p[0]);
            let fan = (1..p.len() - 1).map(|i| across(i).dot(of.normal()));
            fan.inspect(|a| assert!(*a > 0.0)).sum::<f64>()
        };
        0.5 * pieces.iter().map(twice).sum::<f64>()
    }

    /// An outline with four more corners on each side, turned, so that rounding bends the sides.
    fn with_corners_on_sides(corners: &[[f64; 2]], rounded: impl Fn(DVec3) -> DVec3) -> Polygon {
        let turned = DQuat::from_rotation_y(30_f64.to_radians());
        let side = |i: usize| {
            let [a, b] = [i, (i + 1) % corners.len()].map(|k| DVec2::from_array(corners[k]));
            (0..5).map(move |k| a.lerp(b, f64::from(k) / 5.0).extend(3.0))
        };
        let all = (0..corners.len()).flat_map(side);
        Polygon::new(all.map(|p| rounded(turned * p)).collect()).unwrap()
    }

    const L: [[f64; 2]; 6] = [
        [0.0, 0.0],
        [2.0, 0.0],
        [2.0, 1.0],
        [1.0, 1.0],
        [1.0, 3.0],
        [0.0, 3.0],
    ];

    #[test]
    fn corners_on_its_sides_do_not_take_it_to_pieces() {
        let doorway = [[0.0, 0.0], [1.0, 0.0], [1.0, 2.0], [0.0, 2.0]];
        let exact = with_corners_on_sides(&doorway, |p| p);
        assert_eq!(exact.corners().len(), 20);
        let pieces = exact.convex_pieces();
        assert_eq!((pieces.len(), pieces[0].len()), (1, 4));
        assert!((area(&exact, pieces) - 2.0).abs() < 1e-12);
        // As files have it.
        let coarse = with_corners_on_sides(&doorway, |p| p.as_vec3().as_dvec3());
        let pieces = coarse.convex_pieces();
        assert_eq!(pieces.len(), 1);
        assert!((area(&coarse, pieces) - 2.0).abs() < 1e-5);
        // What is concave stays so.
        let l = with_corners_on_sides(&L, |p| p);
        let pieces = l.convex_pieces();
        assert_eq!(pieces.len(), 2);
        assert!((area(&l, pieces) - 4.0).abs() < 1e-12);
    }

    #[test]
    fn pieces_are_convex_and_cover_it() {
        // An L, far from the origin.
        let far = DVec3::new(5e5, 5e6, 100.0);
        let l = L.map(|p| far + DVec2::from_array(p).extend(0.0));
        let l = Polygon::new(l.to_vec()).unwrap();
        let pieces = l.convex_pieces();
        assert_eq!(pieces.len(), 2);
        assert!((area(&l, pieces) - 4.0).abs() < 1e-9);
    }

    #[test]
    fn pieces_are_found_once_and_make_no_difference() {
        let l = Polygon::new(L.map(|p| DVec2::from_array(p).extend(0.0)).to_vec()).unwrap();
        let unasked = l.clone();
        let pieces = l.convex_pieces();
        assert!(std::ptr::eq(pieces, l.convex_pieces()));
        assert_eq!(l, unasked);
        assert_eq!(pieces, unasked.convex_pieces());
        // From behind they are others.
        let behind = l.reversed();
        assert!((area(&behind, behind.convex_pieces()) - 4.0).abs() < 1e-12);
    }

    #[test]
    fn an_arch_has_a_few_pieces_and_what_is_not_flat_has_its_triangles() {
        // A half-circle on a post that is narrower.
        let arc = (0..=30).map(|k| DVec2::from_angle(TAU * f64::from(k) / 60.0));
        let arch = |bulge: f64| {
            let post = [DVec2::new(-0.9, 0.0), DVec2::new(-0.9, -2.0)];
            let post = post
                .into_iter()
                .chain(post.map(|p| -p * DVec2::new(1.0, -1.0)).into_iter().rev());
            let corner = |p: DVec2| p.extend(bulge * p.x * p.y);
            Polygon::new(arc.clone().chain(post).map(corner).collect()).unwrap()
        };
        let flat = arch(0.0).convex_pieces().len();
        assert!(flat <= 4, "{flat}");
        // Seen aslant its corners move beside their places by more than it bends.
        let bent = arch(1e-3).convex_pieces().len();
        assert!(bent > 16, "{bent}");
    }

    /// Numbers from 0 to 1.
    fn random(seed: u64) -> impl FnMut() -> f64 {
        let mut state = seed;
        move || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        }
    }

    /// A simple outline around the origin, with sides as short as rounding has them and corners on sides.
    fn outline(seed: u64) -> Vec<DVec2> {
        let mut r = random(seed);
        let count = 5 + (25.0 * r()) as usize;
        let mut corners = Vec::new();
        for k in 0..count {
            let angle = (k as f64 + 0.9 * r()) / count as f64 * TAU;
            let length = [1.0, 0.5, 0.3 + 0.7 * r()][(3.0 * r()) as usize];
            corners.push(length * DVec2::from_angle(angle));
            if r() < 0.2 {
                let tiny = 10_f64.powf(-3.0 - 10.0 * r());
                let [along, across] = [angle + tiny * r(), 1.0 + tiny * (r() - 0.5)];
                corners.push(length * across * DVec2::from_angle(along));
            }
        }
        let side = |k: usize| {
            let (a, b) = (corners[k], corners[(k + 1) % corners.len()]);
            let on_side = (r() < 0.3).then(|| a.lerp(b, r()));
            std::iter::once(a).chain(on_side)
        };
        (0..corners.len()).flat_map(side).collect()
    }

    #[test]
    fn merged_pieces_cover_what_triangles_do_and_each_place_once() {
        let (mut of_triangles, mut of_pieces) = (0, 0);
        for seed in 0..300 {
            let turned = DQuat::from_euler(glam::EulerRot::XYZ, 0.3, seed as f64, 1.1);
            let corners = outline(seed).into_iter();
            let corners = corners.map(|p| turned * p.extend(2.0)).collect();
            let polygon = Polygon::new(corners).unwrap();
            let flat = polygon.flattened();
            let triangles = ears(&flat, polygon.bends(&flat));
            let pieces = polygon.merged(&flat, triangles.clone());
            let twice = |piece: &Vec<usize>| {
                let fan = piece[1..].windows(2);
                fan.map(|w| cross(flat[piece[0]], flat[w[0]], flat[w[1]]))
                    .sum::<f64>()
            };
            let all = |of: &[Vec<usize>]| of.iter().map(twice).sum::<f64>();
            let (before, after) = (all(&triangles), all(&pieces));
            assert!((before - after).abs() < 1e-10, "{seed}: {before} {after}");
            let is_in = |piece: &Vec<usize>, at: DVec2| {
                let next = |k: usize| piece[(k + 1) % piece.len()];
                (0..piece.len()).all(|k| cross(flat[piece[k]], flat[next(k)], at) > 0.0)
            };
            for piece in &pieces {
                let around = piece.iter().chain(&piece[..2]).copied().collect::<Vec<_>>();
                let mut bends = around.windows(3).map(|w| [w[0], w[1], w[2]]);
                let is_convex = bends.all(|w| outside(&flat, w) > 0.0);
                assert!(piece.len() == 3 || is_convex, "{seed}");
            }
            for triangle in triangles.iter().filter(|t| twice(t) > 1e-6) {
                let middle = triangle.iter().map(|k| flat[*k]).sum::<DVec2>() / 3.0;
                let count = pieces.iter().filter(|piece| is_in(piece, middle)).count();
                assert_eq!(count, 1, "{seed}");
            }
            of_triangles += triangles.len();
            of_pieces += pieces.len();
        }
        // About half of them.
        assert!(
            5 * of_pieces < 3 * of_triangles,
            "{of_pieces} {of_triangles}"
        );
    }
}
