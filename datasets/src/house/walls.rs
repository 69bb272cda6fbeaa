//! Walls with holes, floors, ceilings, door frames.

use super::builder::{Builder, IN_PLACE, Look, pictured, plain};
use super::plan::{HALF_WALL, HEIGHT, Opening, Plan};
use super::textures::Picture;
use crate::noise::hash;
use glam::{DVec2, DVec3};

/// One wall of a room, as the room sees it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Side {
    /// 0 where it is across x, 1 where it is across z.
    pub(super) axis: usize,
    /// The wall's middle on that axis.
    pub(super) at: f64,
    /// Into the room: 1 or −1 on that axis.
    pub(super) inwards: f64,
    /// Along the wall, between its neighbours' faces.
    pub(super) from: f64,
    pub(super) to: f64,
}

impl Side {
    /// The four of a room.
    pub(super) fn all(plan: &Plan, room: usize) -> [Self; 4] {
        let rect = plan.rooms[room];
        let side = |axis: usize, inwards: f64| {
            let along = 1 - axis;
            Self {
                axis,
                at: if inwards > 0.0 {
                    rect.min[axis]
                } else {
                    rect.max[axis]
                },
                inwards,
                from: rect.min[along] + HALF_WALL,
                to: rect.max[along] - HALF_WALL,
            }
        };
        [side(0, 1.0), side(0, -1.0), side(1, 1.0), side(1, -1.0)]
    }

    /// On the wall's face, or in front of it.
    pub(super) fn point(&self, along: f64, up: f64, off: f64) -> DVec3 {
        let across = self.at + self.inwards * (HALF_WALL + off);
        let mut at = DVec2::ZERO;
        at[self.axis] = across;
        at[1 - self.axis] = along;
        DVec3::new(at.x, up, at.y)
    }

    pub(super) fn normal(&self) -> DVec3 {
        let mut normal = DVec2::ZERO;
        normal[self.axis] = self.inwards;
        DVec3::new(normal.x, 0.0, normal.y)
    }

    fn along(&self) -> DVec3 {
        if self.axis == 0 { DVec3::Z } else { DVec3::X }
    }

    /// The openings in it, in order.
    pub(super) fn openings<'a>(&self, plan: &'a Plan, room: usize) -> Vec<&'a Opening> {
        let is_in =
            |o: &&Opening| o.rooms.contains(&room) && o.axis == self.axis && o.at == self.at;
        let mut found: Vec<&Opening> = plan.openings.iter().filter(is_in).collect();
        found.sort_by(|a, b| a.from.total_cmp(&b.from));
        found
    }

    /// Whether there is another room behind some of it.
    pub(super) fn is_shared(&self, plan: &Plan) -> bool {
        let beyond = self.at - self.inwards * HALF_WALL;
        plan.rooms.iter().any(|room| {
            let along = 1 - self.axis;
            let within = |k: usize, x: f64| room.min[k] < x && x < room.max[k];
            within(self.axis, beyond) && room.min[along] < self.to && room.max[along] > self.from
        })
    }
}

const PAINTS: [u32; 6] = [0xf0e6d2, 0xdde6e8, 0xe8dcd0, 0xd9e2d0, 0xf2ead8, 0xe6d8d4];

/// A room's shell.
pub(super) fn shell(b: &mut Builder, plan: &Plan, room: usize, is_tiled: bool, seed: u32) {
    b.stand = IN_PLACE;
    let rect = plan.rooms[room];
    let h = hash(seed, room as i32, 40, 0);
    let paint = PAINTS[(h >> 8) as usize % PAINTS.len()];
    let wall = match h % 3 {
        0 => pictured(Picture::Stripes, paint),
        _ => pictured(Picture::Plaster, paint),
    };
    let floor = match is_tiled {
        true => pictured(Picture::Tiles, 0xd8d0c4),
        false => pictured(
            Picture::Planks,
            [0xffffff, 0xffe6c8, 0xd8c8b8][(h >> 16) as usize % 3],
        ),
    };
    let low = rect.min + DVec2::splat(HALF_WALL);
    let size = rect.size() - DVec2::splat(2.0 * HALF_WALL);
    let sides = [DVec3::X * size.x, DVec3::Z * size.y];
    b.rectangle(DVec3::new(low.x, 0.0, low.y), sides, DVec3::Y, floor);
    let ceiling = pictured(Picture::Plaster, 0xf6f4ee);
    b.rectangle(
        DVec3::new(low.x, HEIGHT, low.y),
        sides,
        DVec3::NEG_Y,
        ceiling,
    );
    for side in Side::all(plan, room) {
        let openings = side.openings(plan, room);
        let mut panel = |from: f64, to: f64, low: f64, high: f64| {
            if from < to && low < high {
                let spans = [side.along() * (to - from), DVec3::Y * (high - low)];
                b.rectangle(side.point(from, low, 0.0), spans, side.normal(), wall);
            }
        };
        let mut at = side.from;
        for opening in &openings {
            panel(at, opening.from, 0.0, HEIGHT);
            panel(opening.from, opening.to, 0.0, opening.sill);
            panel(opening.from, opening.to, opening.head, HEIGHT);
            at = opening.to;
        }
        panel(at, side.to, 0.0, HEIGHT);
        for opening in openings {
            frame(b, &side, opening);
        }
    }
}

const FRAME: Look = plain(0xf4f1ea);

/// The frame around an opening, on one side of the wall.
fn frame(b: &mut Builder, side: &Side, opening: &Opening) {
    let (wide, thick) = (0.0625, 0.015625);
    let mut bar = |from: f64, to: f64, low: f64, high: f64| {
        let (p, q) = (side.point(from, low, 0.0), side.point(to, high, thick));
        b.cuboid(p.min(q), p.max(q), FRAME);
    };
    let (from, to) = (opening.from, opening.to);
    bar(from - wide, from, opening.sill, opening.head + wide);
    bar(to, to + wide, opening.sill, opening.head + wide);
    bar(from, to, opening.head, opening.head + wide);
    if opening.sill > 0.0 {
        bar(from - wide, to + wide, opening.sill - wide, opening.sill);
    }
}

/// What lines an opening, from one side of the wall to the other.
pub(super) fn lining(b: &mut Builder, opening: &Opening) {
    b.stand = IN_PLACE;
    let point = |along: f64, up: f64| {
        let mut at = DVec2::ZERO;
        at[opening.axis] = opening.at - HALF_WALL;
        at[1 - opening.axis] = along;
        DVec3::new(at.x, up, at.y)
    };
    let (along, through) = match opening.axis {
        0 => (DVec3::Z, DVec3::X),
        _ => (DVec3::X, DVec3::Z),
    };
    let through = through * (2.0 * HALF_WALL);
    let tall = DVec3::Y * (opening.head - opening.sill);
    let wide = along * (opening.to - opening.from);
    b.rectangle(
        point(opening.from, opening.sill),
        [through, tall],
        along,
        FRAME,
    );
    b.rectangle(
        point(opening.to, opening.sill),
        [through, tall],
        -along,
        FRAME,
    );
    b.rectangle(
        point(opening.from, opening.head),
        [wide, through],
        DVec3::NEG_Y,
        FRAME,
    );
    let threshold = if opening.sill > 0.0 {
        FRAME
    } else {
        pictured(Picture::Grain, 0x9a7048)
    };
    b.rectangle(
        point(opening.from, opening.sill),
        [wide, through],
        DVec3::Y,
        threshold,
    );
}
