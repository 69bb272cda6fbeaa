//! Floor that cells of two interiors share, exactly: convex pieces of their outlines clip one another on the plan.

use crate::interior::floors::extent;
use crate::interior::{Cell, Interior, clip};
use glam::DVec3;

/// So much of the lower box's height two boxes have in common that are of one storey.
const LEVEL: f64 = 0.5;
/// What areas are off due to rounding, in shares of them.
const ROUNDING: f64 = 1e-9;
/// An outline stands upright, and has no floor, where its normal and up have no greater cosine.
const UPRIGHT: f64 = 1e-6;

/// Areas of floor, by cell.
pub(super) struct Shared {
    known: Vec<f64>,
    found: Vec<f64>,
    /// By known cell, then by found cell.
    both: Vec<f64>,
}

impl Shared {
    /// What cells with boxes share: where they share half of the lower one's height, too, else nothing.
    pub(super) fn new(known: &Interior, found: &Interior) -> Self {
        let up = known.up;
        let of = |interior: &Interior| -> Vec<Footprint> {
            let cells = interior.cells.iter();
            cells.map(|cell| Footprint::of(cell, up)).collect()
        };
        let (of_known, of_found) = (of(known), of(found));
        let shared = |(a, b): (&Footprint, &Footprint)| match a.is_beside(b) {
            true => a.shared(b, up),
            false => 0.0,
        };
        let pairs = of_known
            .iter()
            .flat_map(|a| of_found.iter().map(move |b| (a, b)));
        let both = pairs.map(shared).collect();
        let areas = |of: &[Footprint]| of.iter().map(|footprint| footprint.area(up)).collect();
        Self {
            known: areas(&of_known),
            found: areas(&of_found),
            both,
        }
    }

    /// Floor that a known cell and a found one both have, over floor that either has; nothing where all of it is rounding.
    pub(super) fn iou(&self, t: usize, f: usize) -> f64 {
        let both = self.both(t, f);
        let either = self.known[t] + self.found[f] - both;
        match both > ROUNDING * either {
            true => both / either,
            false => 0.0,
        }
    }

    /// Whether that is half of the smaller one's; neighbours share a sliver, too.
    pub(super) fn is_half(&self, t: usize, f: usize) -> bool {
        let smaller = self.known[t].min(self.found[f]);
        2.0 * self.both(t, f) >= (1.0 - ROUNDING) * smaller
    }

    fn both(&self, t: usize, f: usize) -> f64 {
        self.both[t * self.found.len() + f]
    }
}

/// A cell's place on the plan.
struct Footprint {
    /// From where to where its box reaches along `up`.
    heights: Option<[f64; 2]>,
    /// None overlap.
    pieces: Vec<Piece>,
}

/// A convex part of the plan.
struct Piece {
    /// Counter-clockwise around `up`; how high they are is of no account.
    corners: Vec<DVec3>,
    /// What bounds it. From the sides themselves, not from corners: of what clipping leaves these may be one but for
    /// rounding, and the side between them any.
    sides: Vec<Side>,
}

/// Within are the places where normal · place + offset is not negative; the normal is level, of any length.
#[derive(Clone, Copy)]
struct Side {
    normal: DVec3,
    offset: f64,
}

impl Footprint {
    fn of(cell: &Cell, up: DVec3) -> Self {
        let Some(room) = cell.content.room() else {
            return Self {
                heights: None,
                pieces: Vec::new(),
            };
        };
        // 1. What a level plane through the box's middle has of it.
        let middle = room.min.midpoint(room.max);
        let half = 0.5 * (room.max - room.min);
        let of_box = (0..3).flat_map(|k| {
            let level = DVec3::AXES[k] - up * up[k];
            [level, -level].map(|normal| Side {
                normal,
                offset: half[k] - normal.dot(middle),
            })
        });
        let of_box: Vec<Side> = of_box.collect();
        let across = up.any_orthonormal_vector() * 2.0 * half.length();
        let along = up.cross(across);
        let around = [
            -across - along,
            across - along,
            across + along,
            along - across,
        ];
        let around = around.map(|off| middle + off);
        // 2. Of that, what is over each convex piece of the outline, if there is one.
        let of_outline: Vec<Vec<Side>> = match &cell.floor {
            Some(floor) => {
                let facing = floor.normal().dot(up);
                let pieces = floor.convex_pieces().iter();
                let is_level = facing.abs() > UPRIGHT;
                let pieces = pieces.filter(|_| is_level);
                pieces.map(|piece| sides(piece, up, facing)).collect()
            }
            None => vec![Vec::new()],
        };
        let piece = |outline: Vec<Side>| {
            let sides = [&of_box[..], &outline].concat();
            Piece {
                corners: within(&around, &sides),
                sides,
            }
        };
        Self {
            heights: Some(extent(&room.corners(), up)),
            pieces: of_outline.into_iter().map(piece).collect(),
        }
    }

    /// Whether another is of one storey with it.
    fn is_beside(&self, other: &Self) -> bool {
        match (self.heights, other.heights) {
            (Some([a, b]), Some([c, d])) => b.min(d) - a.max(c) >= LEVEL * (b - a).min(d - c),
            _ => false,
        }
    }

    fn area(&self, up: DVec3) -> f64 {
        self.pieces.iter().map(|p| area(&p.corners, up)).sum()
    }

    /// The area that another has, too.
    fn shared(&self, other: &Self, up: DVec3) -> f64 {
        let of_other = other.pieces.iter();
        let shared = of_other.flat_map(|b| {
            let own = self.pieces.iter();
            own.map(move |a| area(&within(&a.corners, &b.sides), up))
        });
        shared.sum()
    }
}

/// The sides of a convex piece of an outline, of which `facing` is the cosine between its normal and up.
fn sides(piece: &[DVec3], up: DVec3, facing: f64) -> Vec<Side> {
    let side = |i: usize| {
        let (a, b) = (piece[i], piece[(i + 1) % piece.len()]);
        let normal = facing.signum() * up.cross(b - a);
        Side {
            normal,
            offset: -normal.dot(a),
        }
    };
    (0..piece.len()).map(side).collect()
}

/// The part of a convex polygon that is within sides.
fn within(corners: &[DVec3], sides: &[Side]) -> Vec<DVec3> {
    let all = corners.to_vec();
    sides.iter().fold(all, |left, side| {
        clip(&left, |p| side.normal.dot(p) + side.offset)
    })
}

/// The area on the plan of a convex polygon, counter-clockwise around `up`.
fn area(corners: &[DVec3], up: DVec3) -> f64 {
    let offsets = corners.iter().map(|p| *p - corners[0]);
    let offsets: Vec<DVec3> = offsets.collect();
    let twice = offsets.windows(2).map(|w| w[0].cross(w[1]).dot(up));
    0.5 * twice.sum::<f64>().max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::interior::{Content, Polygon, RoomBox, parse_rooms};
    use std::path::Path;

    /// A room from x, z to x, z, so far from the world's origin, with an outline, if one is given.
    fn room(far: DVec3, [x0, z0, x1, z1]: [f64; 4], outline: &[[f64; 2]]) -> Interior {
        let text = r#"{"version": 1, "rooms": [{"name": "room", "min": [0, 0, 0], "max": [4, 2.5, 3]}],
            "openings": []}"#;
        let read = parse_rooms(Path::new("rooms.json"), text.as_bytes(), "m.glb");
        let mut interior = read.unwrap().0;
        interior.cells[0].content = Content::Box(RoomBox {
            min: far + DVec3::new(x0, 0.0, z0),
            max: far + DVec3::new(x1, 2.5, z1),
        });
        let corners = outline.iter().map(|[x, z]| far + DVec3::new(*x, 0.0, *z));
        interior.cells[0].floor = Polygon::new(corners.collect()).ok();
        interior
    }

    #[test]
    fn what_floors_share_is_exact() {
        let l = [
            [0.0, 0.0],
            [4.0, 0.0],
            [4.0, 1.0],
            [1.0, 1.0],
            [1.0, 4.0],
            [0.0, 4.0],
        ];
        let mut turned = l;
        turned.reverse();
        let tip = [[2.0, 0.0], [4.0, 2.0], [2.0, 4.0], [0.0, 2.0]];
        let (square, inset) = ([0.0, 0.0, 4.0, 4.0], [0.035, 0.035, 3.965, 3.965]);
        let (middle, east) = ([0.5, 0.5, 3.0, 3.0], [1.5, 0.0, 4.0, 4.0]);
        let whole: [[f64; 2]; 0] = [];
        for far in [DVec3::ZERO, DVec3::new(5e5, 100.0, -5e5)] {
            for (outline, other, [first, second, both]) in [
                (&whole[..], inset, [16.0, 3.93 * 3.93, 3.93 * 3.93]),
                (&l[..], middle, [7.0, 6.25, 2.25]),
                (&turned[..], middle, [7.0, 6.25, 2.25]),
                (&tip[..], east, [8.0, 10.0, 5.75]),
                (&whole[..], [4.0, 0.0, 6.0, 4.0], [16.0, 8.0, 0.0]),
            ] {
                let (a, b) = (room(far, square, outline), room(far, other, &[]));
                let expected = both / (first + second - both);
                for (known, found) in [(&a, &b), (&b, &a)] {
                    let shared = Shared::new(known, found);
                    let iou = shared.iou(0, 0);
                    assert!((iou - expected).abs() < 1e-8, "{iou} {expected}");
                    let is_half = 2.0 * both >= f64::min(first, second);
                    assert_eq!(shared.is_half(0, 0), is_half, "{outline:?} {other:?}");
                }
            }
        }
    }

    #[test]
    fn where_up_is_aslant_a_box_has_what_a_level_plane_through_its_middle_has_of_it() {
        let mut aslant = room(DVec3::ZERO, [0.0, 0.0, 4.0, 3.0], &[]);
        aslant.up = DVec3::new(0.6, 0.8, 0.0);
        let shared = Shared::new(&aslant, &aslant);
        // It leaves the box at floor and ceiling.
        let expected = 2.5 / 0.6 * 3.0;
        assert!((shared.known[0] - expected).abs() < 1e-9);
        assert!((shared.iou(0, 0) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn an_outline_that_stands_upright_has_no_floor() {
        let mut upright = room(DVec3::ZERO, [0.0, 0.0, 4.0, 3.0], &[]);
        let wall = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [4.0, 2.0, 0.0]];
        upright.cells[0].floor = Polygon::new(wall.map(DVec3::from_array).to_vec()).ok();
        let shared = Shared::new(&upright, &room(DVec3::ZERO, [0.0, 0.0, 4.0, 3.0], &[]));
        assert_eq!((shared.known[0], shared.iou(0, 0)), (0.0, 0.0));
    }
}
