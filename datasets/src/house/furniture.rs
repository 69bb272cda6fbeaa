//! Things that stand in rooms. Each is built around its stand: x along the wall behind it, y
//! up, z into the room, from the wall at z = 0.

use super::builder::{Builder, Look, pictured, plain};
use super::textures::Picture;
use crate::noise::{hash, unit};
use glam::DVec3;

/// What can stand along a wall: its name, width and depth, and who builds it.
#[derive(Clone, Copy)]
pub(super) struct Item {
    pub(super) name: &'static str,
    pub(super) width: f64,
    pub(super) depth: f64,
    /// Whether it fits under a window.
    pub(super) is_low: bool,
    pub(super) build: fn(&mut Builder, f64, u32),
}

const fn item(
    name: &'static str,
    width: f64,
    depth: f64,
    build: fn(&mut Builder, f64, u32),
) -> Item {
    Item {
        name,
        width,
        depth,
        is_low: false,
        build,
    }
}

const fn low(item: Item) -> Item {
    Item {
        is_low: true,
        ..item
    }
}

const SOFA: Item = low(item("sofa", 2.1, 0.95, sofa));
const SHELF: Item = item("bookshelf", 1.2, 0.32, bookshelf);
const CABINET: Item = item("cabinet", 1.6, 0.45, cabinet);
const BED: Item = low(item("bed", 1.6, 2.1, bed));
const WARDROBE: Item = item("wardrobe", 1.5, 0.62, wardrobe);
const DESK: Item = item("desk", 1.4, 1.15, desk);
const COUNTER: Item = item("counter", 2.2, 0.62, counter);
const PLANT: Item = item("plant", 0.6, 0.6, plant);
const LAMP: Item = item("lamp", 0.5, 0.5, lamp);
const CHAIR: Item = item("chair", 0.5, 0.6, |b, _, seed| {
    chair(b, DVec3::Z * 0.3, 1.0, seed)
});

/// What rooms are for, and what stands in them, the most important first.
pub(super) const ROOMS: [(&str, &[Item]); 5] = [
    (
        "living room",
        &[SOFA, CABINET, SHELF, PLANT, LAMP, SHELF, CHAIR],
    ),
    ("bedroom", &[BED, WARDROBE, CABINET, LAMP, PLANT]),
    ("kitchen", &[COUNTER, CABINET, COUNTER, CHAIR, PLANT]),
    ("study", &[DESK, SHELF, SHELF, SHELF, PLANT, LAMP]),
    ("dining room", &[CABINET, SHELF, PLANT, LAMP, CHAIR]),
];

const WOODS: [u32; 4] = [0xb98a5a, 0x8a5a36, 0xd9b98c, 0x5f3f2a];
const CLOTHS: [u32; 6] = [0x8f9aa8, 0xa8624a, 0x5c7a6a, 0xc2b59b, 0x56607a, 0xb58a3c];

fn wood(seed: u32) -> Look {
    pictured(Picture::Grain, WOODS[hash(seed, 1, 0, 0) as usize % 4])
}

fn cloth(seed: u32, k: i32) -> Look {
    pictured(Picture::Fabric, CLOTHS[hash(seed, 2, k, 0) as usize % 6])
}

fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

fn sofa(b: &mut Builder, width: f64, seed: u32) {
    let (half, look) = (0.5 * width, cloth(seed, 0));
    b.cuboid(v(-half + 0.05, 0.1, 0.08), v(half - 0.05, 0.3, 0.88), look);
    for side in [-1.0, 1.0] {
        let arm = v(side * (half - 0.11), 0.33, 0.49);
        b.cushion(arm, v(0.11, 0.27, 0.44), 0.35, look);
        for z in [0.14, 0.82] {
            let foot = v(side * (half - 0.15), 0.0, z);
            b.lathe(foot, &[(0.02, 0.0), (0.03, 0.1)], plain(0x2a211b));
        }
    }
    b.cushion(v(0.0, 0.45, 0.14), v(half - 0.15, 0.36, 0.12), 0.3, look);
    let seats = 3;
    let each = (width - 0.48) / f64::from(seats);
    for i in 0..seats {
        let x = -half + 0.24 + (f64::from(i) + 0.5) * each;
        b.cushion(v(x, 0.36, 0.54), v(0.5 * each, 0.11, 0.36), 0.35, look);
        b.cushion(v(x, 0.62, 0.28), v(0.47 * each, 0.2, 0.1), 0.5, look);
    }
    let pillow = cloth(seed, 1);
    b.cushion(v(-half + 0.45, 0.6, 0.46), v(0.2, 0.19, 0.09), 0.6, pillow);
}

fn bookshelf(b: &mut Builder, width: f64, seed: u32) {
    let (half, look, height, depth) = (0.5 * width, wood(seed), 2.0, 0.32);
    for x in [-half, half - 0.03] {
        b.cuboid(v(x, 0.0, 0.01), v(x + 0.03, height, depth), look);
    }
    b.cuboid(
        v(-half + 0.03, 0.0, 0.01),
        v(half - 0.03, height, 0.025),
        look,
    );
    let boards = 5;
    for board in 0..=boards {
        let y = f64::from(board) * (height - 0.03) / f64::from(boards);
        b.cuboid(
            v(-half + 0.03, y, 0.025),
            v(half - 0.03, y + 0.03, depth),
            look,
        );
        if board == boards {
            break;
        }
        let mut x = -half + 0.04;
        let mut k = 0;
        while x < half - 0.12 {
            let r = |j: i32| unit(seed, board, k, j);
            let (thick, tall) = (0.02 + 0.035 * r(0), 0.2 + 0.12 * r(1));
            if r(2) < 0.12 {
                // A gap, with something in it.
                let foot = v(x + 0.07, y + 0.03, 0.18);
                let profile = [(0.03, 0.0), (0.055, 0.06), (0.02, 0.13), (0.03, 0.16)];
                b.lathe(foot, &profile, plain(CLOTHS[k as usize % 6]));
                x += 0.16;
            } else {
                let color = CLOTHS[hash(seed, board, k, 7) as usize % 6] >> 1 & 0x7f7f7f;
                let deep = 0.2 + 0.06 * r(3);
                let corner = v(x + 0.9 * thick, y + 0.03 + tall, 0.03 + deep);
                b.cuboid(v(x, y + 0.03, 0.03), corner, plain(color + 0x302820));
                x += thick;
            }
            k += 1;
        }
    }
}

fn cabinet(b: &mut Builder, width: f64, seed: u32) {
    let (half, look) = (0.5 * width, wood(seed));
    b.cuboid(v(-half, 0.08, 0.01), v(half, 0.62, 0.42), look);
    for i in 0..3 {
        let x = -half + 0.02 + f64::from(i) * (width - 0.04) / 3.0;
        let door = x + (width - 0.04) / 3.0 - 0.02;
        b.cuboid(v(x, 0.1, 0.42), v(door, 0.6, 0.435), look);
        b.cushion(
            v(door - 0.06, 0.4, 0.45),
            DVec3::splat(0.015),
            1.0,
            plain(0xc8b070),
        );
    }
    for x in [-half + 0.06, half - 0.06] {
        b.lathe(
            v(x, 0.0, 0.36),
            &[(0.015, 0.0), (0.025, 0.08)],
            plain(0x2a211b),
        );
        b.lathe(
            v(x, 0.0, 0.06),
            &[(0.015, 0.0), (0.025, 0.08)],
            plain(0x2a211b),
        );
    }
    if hash(seed, 5, 0, 0) & 1 == 0 {
        b.cuboid(v(-0.55, 0.7, 0.12), v(0.55, 1.32, 0.16), plain(0x15171a));
        b.cuboid(v(-0.2, 0.62, 0.08), v(0.2, 0.7, 0.24), plain(0x202326));
    } else {
        let profile = [
            (0.05, 0.0),
            (0.11, 0.1),
            (0.12, 0.2),
            (0.04, 0.32),
            (0.06, 0.38),
        ];
        b.lathe(
            v(-0.4, 0.62, 0.22),
            &profile,
            plain(CLOTHS[seed as usize % 6]),
        );
        let bowl = [
            (0.05, 0.0),
            (0.14, 0.05),
            (0.19, 0.12),
            (0.17, 0.11),
            (0.0, 0.04),
        ];
        b.lathe(v(0.3, 0.62, 0.22), &bowl, plain(0xdcd6c8));
    }
}

fn bed(b: &mut Builder, width: f64, seed: u32) {
    let (half, look) = (0.5 * width, wood(seed));
    b.cuboid(v(-half, 0.12, 0.06), v(half, 0.32, 2.05), look);
    b.cuboid(v(-half, 0.0, 0.01), v(half, 0.85, 0.06), look);
    for (x, z) in [(-half + 0.08, 1.95), (half - 0.08, 1.95)] {
        b.lathe(v(x, 0.0, z), &[(0.04, 0.0), (0.04, 0.12)], look);
    }
    let linen = pictured(Picture::Fabric, 0xf2ece0);
    b.cushion(v(0.0, 0.41, 1.05), v(half - 0.03, 0.13, 0.97), 0.2, linen);
    b.cushion(
        v(0.0, 0.46, 1.32),
        v(half + 0.01, 0.12, 0.72),
        0.25,
        cloth(seed, 3),
    );
    for side in [-0.5, 0.5] {
        let pillow = v(side * width * 0.48, 0.58, 0.36);
        b.cushion(pillow, v(0.33, 0.1, 0.22), 0.6, linen);
    }
}

fn wardrobe(b: &mut Builder, width: f64, seed: u32) {
    let (half, look) = (0.5 * width, wood(seed));
    b.cuboid(v(-half, 0.0, 0.01), v(half, 2.1, 0.58), look);
    b.cuboid(v(-half - 0.02, 2.1, 0.01), v(half + 0.02, 2.15, 0.61), look);
    for i in 0..2 {
        let x = -half + 0.02 + f64::from(i) * (half - 0.01);
        b.cuboid(v(x, 0.1, 0.58), v(x + half - 0.03, 2.06, 0.6), look);
        let inset = [v(x + 0.1, 0.25, 0.6), v(x + half - 0.13, 1.9, 0.608)];
        b.cuboid(inset[0], inset[1], look);
    }
    for x in [-0.06, 0.06] {
        b.cushion(v(x, 1.0, 0.62), v(0.012, 0.06, 0.02), 0.7, plain(0xc8b070));
    }
}

fn desk(b: &mut Builder, width: f64, seed: u32) {
    table(b, DVec3::Z * 0.33, [width, 0.64], wood(seed));
    b.cuboid(v(-0.3, 0.86, 0.14), v(0.3, 1.2, 0.17), plain(0x1a1c20));
    b.cuboid(v(-0.27, 0.89, 0.17), v(0.27, 1.17, 0.172), plain(0x4a6c8c));
    b.lathe(
        v(0.0, 0.75, 0.16),
        &[(0.11, 0.0), (0.11, 0.015), (0.02, 0.02), (0.02, 0.12)],
        plain(0x2a2c30),
    );
    b.cuboid(v(-0.2, 0.75, 0.36), v(0.2, 0.77, 0.5), plain(0xd8d8d6));
    let mug = [(0.035, 0.0), (0.04, 0.1), (0.034, 0.1), (0.03, 0.01)];
    b.lathe(v(0.45, 0.75, 0.4), &mug, plain(0xb04a3a));
    chair(b, DVec3::Z * 0.82, -1.0, seed);
}

fn counter(b: &mut Builder, width: f64, _seed: u32) {
    let half = 0.5 * width;
    let front = plain(0xe6e2d8);
    b.cuboid(v(-half, 0.1, 0.01), v(half, 0.88, 0.58), front);
    b.cuboid(v(-half, 0.0, 0.01), v(half, 0.1, 0.5), plain(0x3a3a3c));
    b.cuboid(
        v(-half, 0.88, 0.01),
        v(half, 0.92, 0.61),
        pictured(Picture::Plaster, 0x5a5e62),
    );
    let wall = pictured(Picture::Tiles, 0xd6e4e6);
    b.cuboid(v(-half, 0.92, 0.0), v(half, 1.45, 0.012), wall);
    b.cuboid(v(-half, 1.45, 0.0), v(half, 2.1, 0.34), front);
    let doors = 4;
    for i in 0..doors {
        let x = -half + f64::from(i) * width / f64::from(doors);
        let next = x + width / f64::from(doors);
        b.cuboid(
            v(x + 0.01, 0.13, 0.58),
            v(next - 0.01, 0.86, 0.598),
            plain(0xcfd6cc),
        );
        b.cuboid(
            v(x + 0.01, 1.47, 0.34),
            v(next - 0.01, 2.08, 0.356),
            plain(0xcfd6cc),
        );
        b.cushion(
            v(next - 0.07, 0.8, 0.61),
            v(0.03, 0.012, 0.02),
            0.7,
            plain(0x9a9a9a),
        );
    }
    let sink = [(0.2, 0.012), (0.21, 0.005), (0.19, 0.004), (0.05, 0.002)];
    b.lathe(v(-0.45 * half, 0.92, 0.3), &sink, plain(0xb8bcc0));
    let tap = [(0.02, 0.0), (0.015, 0.26), (0.03, 0.28), (0.0, 0.3)];
    b.lathe(v(-0.45 * half, 0.92, 0.1), &tap, plain(0xc4c8cc));
    let pot = [
        (0.1, 0.0),
        (0.12, 0.02),
        (0.12, 0.14),
        (0.11, 0.15),
        (0.02, 0.17),
        (0.0, 0.2),
    ];
    b.lathe(v(0.5 * half, 0.92, 0.32), &pot, plain(0x8a3a30));
}

fn plant(b: &mut Builder, _width: f64, seed: u32) {
    let foot = DVec3::Z * 0.3;
    let pot = [
        (0.11, 0.0),
        (0.16, 0.3),
        (0.17, 0.32),
        (0.15, 0.32),
        (0.14, 0.27),
        (0.0, 0.27),
    ];
    b.lathe(foot, &pot, plain(0xa8603c));
    b.lathe(foot, &[(0.02, 0.25), (0.015, 0.9)], plain(0x6b5236));
    for i in 0..14 {
        let r = |j: i32| unit(seed, i, j, 31);
        let (sin, cos) = (std::f64::consts::TAU * r(0)).sin_cos();
        let out = 0.05 + 0.1 * r(1);
        let middle = foot + v(out * cos, 0.5 + 0.75 * r(2), out * sin);
        let half = v(0.05 + 0.07 * r(3), 0.03 + 0.05 * r(4), 0.05 + 0.07 * r(5));
        b.cushion(middle, half, 0.9, pictured(Picture::Foliage, 0xffffff));
    }
}

fn lamp(b: &mut Builder, _width: f64, seed: u32) {
    let foot = DVec3::Z * 0.25;
    let stand = [(0.15, 0.0), (0.14, 0.02), (0.015, 0.04), (0.012, 1.4)];
    b.lathe(foot, &stand, plain(0x3a3632));
    let shade = [(0.2, 1.25), (0.13, 1.58)];
    b.lathe(foot, &shade, cloth(seed, 4));
    let shining = Look {
        shines: true,
        ..plain(0xfff2d0)
    };
    b.cushion(foot + DVec3::Y * 1.42, DVec3::splat(0.05), 1.0, shining);
}

/// A chair in the middle of its place; it faces along z (1) or against it (−1).
pub(super) fn chair(b: &mut Builder, at: DVec3, facing: f64, seed: u32) {
    let look = wood(seed);
    for (x, z) in [(-0.18, -0.18), (0.18, -0.18), (-0.18, 0.18), (0.18, 0.18)] {
        b.lathe(at + v(x, 0.0, z), &[(0.015, 0.0), (0.022, 0.43)], look);
    }
    b.cushion(
        at + DVec3::Y * 0.45,
        v(0.22, 0.035, 0.22),
        0.3,
        cloth(seed, 5),
    );
    let back = -0.2 * facing;
    for x in [-0.18, 0.18] {
        b.lathe(at + v(x, 0.43, back), &[(0.02, 0.0), (0.014, 0.48)], look);
    }
    for y in [0.6, 0.78] {
        b.cuboid(
            at + v(-0.19, y, back - 0.012),
            at + v(0.19, y + 0.08, back + 0.012),
            look,
        );
    }
}

/// A table in the middle of its place.
pub(super) fn table(b: &mut Builder, at: DVec3, [width, depth]: [f64; 2], look: Look) {
    let (x, z) = (0.5 * width, 0.5 * depth);
    b.cuboid(at + v(-x, 0.71, -z), at + v(x, 0.75, z), look);
    for (sx, sz) in [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)] {
        let foot = at + v(sx * (x - 0.06), 0.0, sz * (z - 0.06));
        let leg = [(0.02, 0.0), (0.03, 0.3), (0.025, 0.5), (0.035, 0.71)];
        b.lathe(foot, &leg, look);
    }
}

/// What stands in the middle of a room: a rug, and on it a table.
pub(super) fn middle(b: &mut Builder, size: [f64; 2], with_chairs: bool, seed: u32) {
    let (x, z) = (0.5 * size[0], 0.5 * size[1]);
    let rug = pictured(Picture::Rug(seed % 5), 0xffffff);
    let corner = v(-x, 0.008, -z);
    b.rectangle(
        corner,
        [DVec3::X * size[0], DVec3::Z * size[1]],
        DVec3::Y,
        rug,
    );
    if with_chairs {
        table(b, DVec3::ZERO, [1.5, 0.85], wood(seed));
        for side in [-0.4, 0.4] {
            chair(b, v(side, 0.0, -0.55), 1.0, seed);
            chair(b, v(side, 0.0, 0.55), -1.0, seed);
        }
        let bowl = [
            (0.06, 0.0),
            (0.16, 0.05),
            (0.22, 0.13),
            (0.2, 0.12),
            (0.0, 0.04),
        ];
        b.lathe(DVec3::Y * 0.75, &bowl, plain(0xe8e0d0));
        for (i, (dx, dz)) in [(0.0, 0.05), (0.07, -0.04), (-0.07, -0.03)]
            .into_iter()
            .enumerate()
        {
            let fruit = [0xc23b2a, 0xd9a428, 0x7fa03a][i];
            b.cushion(v(dx, 0.86, dz), DVec3::splat(0.055), 1.0, plain(fruit));
        }
    } else {
        let look = wood(seed);
        b.cuboid(v(-0.5, 0.36, -0.3), v(0.5, 0.4, 0.3), look);
        for (sx, sz) in [(-0.43, -0.23), (0.43, -0.23), (-0.43, 0.23), (0.43, 0.23)] {
            b.lathe(v(sx, 0.0, sz), &[(0.02, 0.0), (0.03, 0.36)], look);
        }
        b.cuboid(v(-0.3, 0.4, -0.1), v(-0.05, 0.425, 0.08), plain(0x3f5d78));
        let vase = [(0.04, 0.0), (0.07, 0.08), (0.03, 0.2), (0.045, 0.24)];
        b.lathe(v(0.2, 0.4, 0.05), &vase, plain(0x86a7b5));
    }
}

/// A framed picture on the wall, its middle at eye height.
pub(super) fn painting(b: &mut Builder, [width, height]: [f64; 2], picture: Picture, shines: bool) {
    let (x, y) = (0.5 * width, 0.5 * height);
    let look = Look {
        shines,
        ..pictured(picture, 0xffffff)
    };
    let corner = v(-x, 1.6 - y, 0.012);
    b.rectangle(
        corner,
        [DVec3::X * width, DVec3::Y * height],
        DVec3::Z,
        look,
    );
    let (frame, f) = (
        if shines {
            plain(0xf0ede4)
        } else {
            plain(0x4a3524)
        },
        0.05,
    );
    for (from, to) in [
        (v(-x - f, 1.6 - y - f, 0.0), v(x + f, 1.6 - y, 0.03)),
        (v(-x - f, 1.6 + y, 0.0), v(x + f, 1.6 + y + f, 0.03)),
        (v(-x - f, 1.6 - y, 0.0), v(-x, 1.6 + y, 0.03)),
        (v(x, 1.6 - y, 0.0), v(x + f, 1.6 + y, 0.03)),
    ] {
        b.cuboid(from, to, frame);
    }
    if shines {
        b.cuboid(v(-0.015, 1.6 - y, 0.012), v(0.015, 1.6 + y, 0.026), frame);
        b.cuboid(
            v(-x - 0.08, 1.55 - y - f, 0.0),
            v(x + 0.08, 1.6 - y - f, 0.14),
            frame,
        );
    }
}
