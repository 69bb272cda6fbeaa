use crate::dataset::Plan;
use crate::noise::signed;
use crate::props::{MATTE, SATIN, cuboid, mottled, object};
use crate::texture::rgb;
use crate::{
    Dataset, DatasetError, Finish, Lighting, Motif, Object, Options, Scene, Shape, Texture,
};
use calibrate::{ModelKind, Rigid3};
use glam::{DQuat, DVec2, DVec3};
use std::f64::consts::{FRAC_PI_2, PI};

const SEED: u32 = 23;

/// A room with walls across the world's axes, in world units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Room {
    /// Its corner with the least coordinates.
    pub min: DVec3,
    /// Its opposite corner.
    pub max: DVec3,
}

/// The walls, the floor, the ceiling and both ends of [`hallway`]. The way goes along −z.
pub const HALLWAY: Room = Room {
    min: DVec3::new(-1.1, 0.0, -7.0),
    max: DVec3::new(1.1, 2.6, 7.0),
};

/// A hallway that the cameras walk down, looking ahead (Buehler et al. 2001, §5, Hallway).
///
/// By default 28 photos of 480 × 360 on the way from one end past the middle. Units are
/// metres, y is up; [`HALLWAY`] has the true walls. Doors, pictures and cabinets stand out
/// from them.
///
/// # Errors
/// An option out of its range.
pub fn hallway(options: &Options) -> Result<Dataset, DatasetError> {
    let chosen = options.or_defaults((480, 360), 28)?;
    let (width, height) = (f64::from(chosen.width), f64::from(chosen.height));
    let focal = 0.8 * width.max(height * 4.0 / 3.0);
    // As fine as the walls beside the next few steps of the way show it.
    let finest = 6.0 / focal;
    let plan = Plan {
        name: "hallway",
        kind: "synthetic: a hallway, walking ahead.",
        stresses: "The epipoles lie inside the image and every wall is seen from near and far, \
                   so that resolution decides between photos; doors, cabinets and frames stand \
                   out from the walls of a tunnel.",
        scene: scene(finest),
        model: ModelKind::SimplePinhole,
        params: vec![focal, 0.5 * width, 0.5 * height],
        poses: (0..chosen.views).map(|i| step(i, chosen.views)).collect(),
        times_s: Vec::new(),
        matte: false,
        motion: None,
        points: 2500,
        seed: SEED,
    };
    Ok(plan.into_dataset(&chosen))
}

/// Camera `i` of `count`: down the way, swaying a little.
fn step(i: usize, count: usize) -> Rigid3 {
    let part = i as f64 / (count - 1) as f64;
    let r = |k: i32| signed(SEED, i as i32, k, 5);
    let center = DVec3::new(
        0.12 * (9.0 * part).sin() + 0.04 * r(0),
        1.5 + 0.03 * r(1),
        5.8 - 7.6 * part + 0.04 * r(2),
    );
    let ahead = DVec3::new(
        0.06 * r(3) + 0.05 * (7.0 * part).cos(),
        -0.05 + 0.03 * r(4),
        -1.0,
    );
    let roll = Rigid3::new(DQuat::from_rotation_z(0.02 * r(5)), DVec3::ZERO);
    roll * Rigid3::looking_at(center, center + ahead, DVec3::Y)
}

fn scene(finest: f64) -> Scene {
    let mut objects = Vec::new();
    walls(&mut objects);
    lamps(&mut objects);
    for (side, at, seed) in [
        (-1.0, 4.2, 31),
        (1.0, 3.0, 32),
        (-1.0, 0.6, 33),
        (1.0, -1.2, 34),
        (-1.0, -3.4, 35),
        (1.0, -4.9, 36),
    ] {
        door(side, at, seed, &mut objects);
    }
    pictures(&mut objects);
    furniture(&mut objects);
    let lighting = Lighting {
        lamp: DVec3::new(0.0, 2.45, 0.0),
        lamp_radius: 0.3,
        lamp_color: 0.35 * DVec3::new(1.0, 0.95, 0.86),
        sky: 0.60 * DVec3::new(0.97, 0.98, 1.0),
        ground: 0.42 * DVec3::new(1.0, 0.94, 0.86),
        up: DVec3::Y,
        corner_reach: 0.25,
    };
    Scene::new(objects, lighting, finest)
}

/// Turns a rectangle or a box's +z side to face along x into the hallway, from the wall on
/// that side (−1 left, 1 right).
fn facing(side: f64) -> DQuat {
    DQuat::from_rotation_y(-side * FRAC_PI_2)
}

fn walls(objects: &mut Vec<Object>) {
    let Room { min, max } = HALLWAY;
    let middle = 0.5 * (min + max);
    let half = 0.5 * (max - min);
    for side in [-1.0, 1.0] {
        let paper = Texture::Wallpaper {
            ground: rgb(0xa9b7a0),
            figure: rgb(0xd9d3b4),
            period: 0.24,
            seed: if side < 0.0 { 11 } else { 12 },
        };
        let shape = Shape::Rectangle {
            half: DVec2::new(half.z, half.y),
        };
        let at = middle.with_x(side * half.x);
        objects.push(object(shape, at, facing(side), paper, MATTE));
        // A skirting board.
        let skirting = cuboid(DVec3::new(half.z, 0.05, 0.008));
        let at = DVec3::new(side * (half.x - 0.008), 0.05, 0.0);
        objects.push(object(
            skirting,
            at,
            facing(side),
            mottled(0xe6e0d0, 0.1, 0.3, 13),
            MATTE,
        ));
    }
    // Planks along the way; their finish shines.
    let floor = Shape::Rectangle {
        half: DVec2::new(half.z, half.x),
    };
    let lying = DQuat::from_rotation_y(FRAC_PI_2) * DQuat::from_rotation_x(-FRAC_PI_2);
    let planks = Texture::Wood {
        light: rgb(0xb58a58),
        dark: rgb(0x6f4626),
        plank: 0.18,
        seed: 21,
    };
    objects.push(object(
        floor.clone(),
        middle.with_y(min.y),
        lying,
        planks,
        SATIN,
    ));
    let hanging = DQuat::from_rotation_y(FRAC_PI_2) * DQuat::from_rotation_x(FRAC_PI_2);
    let plaster = mottled(0xe4e2da, 0.25, 0.4, 22);
    objects.push(object(floor, middle.with_y(max.y), hanging, plaster, MATTE));
    let end = Shape::Rectangle {
        half: DVec2::new(half.x, half.y),
    };
    let bricks = |seed| Texture::Bricks {
        size: DVec2::new(0.44, 0.22),
        color: DVec3::new(0.40, 0.25, 0.19),
        seed,
    };
    let still = DQuat::IDENTITY;
    objects.push(object(
        end.clone(),
        middle.with_z(min.z),
        still,
        bricks(23),
        MATTE,
    ));
    let back = DQuat::from_rotation_y(PI);
    objects.push(object(end, middle.with_z(max.z), back, bricks(24), MATTE));
}

fn lamps(objects: &mut Vec<Object>) {
    for i in -2..=2 {
        let at = DVec3::new(0.0, HALLWAY.max.y - 0.02, 2.7 * f64::from(i));
        let panel = cuboid(DVec3::new(0.16, 0.02, 0.6));
        let mut lamp = object(
            panel,
            at,
            DQuat::IDENTITY,
            mottled(0xfdfbf2, 0.06, 0.2, 25),
            Finish::Flat,
        );
        lamp.casts_shadow = false;
        objects.push(lamp);
    }
}

/// A door in the wall on one side: frame, leaf, handle.
fn door(side: f64, at_z: f64, seed: u32, objects: &mut Vec<Object>) {
    let wall = side * HALLWAY.max.x;
    let place = |out: f64, y: f64, along: f64| DVec3::new(wall - side * out, y, at_z + along);
    let frame = mottled(0xd8d2c2, 0.12, 0.1, seed);
    objects.push(object(
        cuboid(DVec3::new(0.52, 1.06, 0.012)),
        place(0.012, 1.06, 0.0),
        facing(side),
        frame,
        MATTE,
    ));
    objects.push(object(
        cuboid(DVec3::new(0.44, 1.0, 0.006)),
        place(0.030, 1.0, 0.0),
        facing(side),
        Texture::Drawers {
            color: rgb(0x9a6236),
            period: 0.44,
            seed: seed + 10,
        },
        SATIN,
    ));
    objects.push(object(
        Shape::Sphere { radius: 0.03 },
        place(0.075, 1.02, 0.36),
        DQuat::IDENTITY,
        mottled(0xc9a24a, 0.1, 0.02, seed),
        Finish::Glossy {
            highlight: 1.0,
            exponent: 120.0,
            mirror: 0.0,
        },
    ));
}

fn pictures(objects: &mut Vec<Object>) {
    for (i, (side, at_z, half, motif)) in [
        (-1.0, 2.4, DVec2::new(0.36, 0.27), Motif::Hills),
        (1.0, 1.0, DVec2::new(0.27, 0.36), Motif::Abstract),
        (-1.0, -1.4, DVec2::new(0.40, 0.28), Motif::Abstract),
        (1.0, -3.0, DVec2::new(0.33, 0.25), Motif::Hills),
        (-1.0, -5.4, DVec2::new(0.25, 0.33), Motif::Hills),
        (1.0, 5.2, DVec2::new(0.34, 0.26), Motif::Abstract),
    ]
    .into_iter()
    .enumerate()
    {
        let half = half.extend(0.014);
        let at = DVec3::new(side * (HALLWAY.max.x - half.z), 1.6, at_z);
        let painting = Texture::Painting {
            half,
            motif,
            seed: 51 + i as u32,
        };
        objects.push(object(cuboid(half), at, facing(side), painting, MATTE));
    }
    let half = DVec3::new(0.45, 0.34, 0.014);
    let at = DVec3::new(0.05, 1.55, HALLWAY.min.z + half.z);
    let painting = Texture::Painting {
        half,
        motif: Motif::Hills,
        seed: 61,
    };
    objects.push(object(cuboid(half), at, DQuat::IDENTITY, painting, MATTE));
}

/// A cabinet with books on it, a bench, and a bin.
fn furniture(objects: &mut Vec<Object>) {
    let right = HALLWAY.max.x;
    let half = DVec3::new(0.5, 0.42, 0.16);
    let at = DVec3::new(right - half.z, half.y, -2.9);
    let fronts = Texture::Drawers {
        color: rgb(0x8a5a34),
        period: 0.5,
        seed: 71,
    };
    objects.push(object(cuboid(half), at, facing(1.0), fronts, MATTE));
    for (i, (cloth, title)) in [(0x7a2b2b, "GRAPH"), (0x274a63, "LUMI"), (0x53683a, "OPAL")]
        .into_iter()
        .enumerate()
    {
        let half = DVec3::new(0.15, 0.025, 0.11);
        let height = 0.84 + half.y * (2.0 * i as f64 + 1.0);
        let turn = facing(1.0) * DQuat::from_rotation_y(0.15 * i as f64 - 0.1);
        let book = Texture::Book {
            cloth: rgb(cloth),
            half,
            title,
            seed: 81 + i as u32,
        };
        let at = DVec3::new(right - 0.15, height, -2.75);
        objects.push(object(cuboid(half), at, turn, book, MATTE));
    }
    let seat = cuboid(DVec3::new(0.6, 0.03, 0.17));
    let cloth = Texture::Cloth {
        colors: [rgb(0xeae0c8), rgb(0xb24a38), rgb(0x2f6470)],
        period: 0.3,
        seed: 91,
    };
    let at = DVec3::new(-right + 0.17, 0.43, -1.4);
    objects.push(object(seat, at, facing(-1.0), cloth, MATTE));
    for (along, out) in [(-0.55, 0.05), (-0.55, 0.29), (0.55, 0.05), (0.55, 0.29)] {
        let leg = cuboid(DVec3::new(0.02, 0.2, 0.02));
        let at = DVec3::new(-right + out, 0.2, -1.4 + along);
        objects.push(object(
            leg,
            at,
            DQuat::IDENTITY,
            mottled(0x4f3a22, 0.3, 0.05, 92),
            MATTE,
        ));
    }
    objects.push(object(
        Shape::Cylinder {
            radius: 0.14,
            half_height: 0.19,
        },
        DVec3::new(right - 0.17, 0.19, -0.2),
        DQuat::from_rotation_y(0.4),
        Texture::Label {
            paper: rgb(0xdfe6d8),
            band: rgb(0x2b6b5f),
            ink: rgb(0x3a2a20),
            half_height: 0.19,
            seed: 101,
        },
        MATTE,
    ));
}
