use crate::dataset::Plan;
use crate::hand_held::HandHeldGrid;
use crate::props::{GLAZED, MATTE, SATIN, cuboid, mottled, object, rod, turned};
use crate::texture::rgb;
use crate::{
    Dataset, DatasetError, Finish, Lighting, Motif, Object, Options, Scene, Shape, Texture,
};
use calibrate::{ModelKind, Rigid3};
use glam::{DQuat, DVec2, DVec3};
use std::f64::consts::TAU;

const SEED: u32 = 61;
/// From the cameras to the middle row, in metres.
const DISTANCE: f64 = 1.15;
/// What they look at: the table's top is y = 0, x points right, z to the viewer.
const TARGET: DVec3 = DVec3::new(0.0, 0.10, 0.0);
/// The wall behind the table.
const WALL: f64 = -1.1;

/// Small things in rows on a table, close to the cameras (Buehler et al. 2001, §5,
/// Knick-knacks): one sees between the bars and legs of some at others.
///
/// By default 25 photos of 480 × 360 from a shaken 5 × 5 grid whose neighbours are 7 % of
/// the distance apart. Units are metres, y is up.
///
/// # Errors
/// An option out of its range.
pub fn knick_knacks(options: &Options) -> Result<Dataset, DatasetError> {
    let chosen = options.or_defaults((480, 360), 25)?;
    let (width, height) = (f64::from(chosen.width), f64::from(chosen.height));
    let focal = 1.15 * width.max(height * 4.0 / 3.0);
    let plan = Plan {
        name: "knick-knacks",
        kind: "synthetic: knick-knacks on a table, close by, 2-D grid of viewpoints.",
        stresses: "Depths from one to three, thin bars and gaps in front of other things, and \
                   neighbouring views that see clearly different parts of them: no plane is a \
                   fair proxy.",
        scene: scene(2.2 * DISTANCE / focal),
        model: ModelKind::SimpleRadial,
        params: vec![focal, 0.5 * width, 0.5 * height, -0.05],
        poses: (0..chosen.views)
            .map(|i| hand_held(i, chosen.views))
            .collect(),
        times_s: Vec::new(),
        matte: false,
        motion: None,
        points: 3000,
        seed: SEED,
    };
    Ok(plan.into_dataset(&chosen))
}

/// Camera `i` of `count`: on a grid, with an unsteady hand.
fn hand_held(i: usize, count: usize) -> Rigid3 {
    let grid = HandHeldGrid {
        target: TARGET,
        distance: DISTANCE,
        towards: DVec3::new(0.03, 0.30, 1.0),
        columns_per_row: 1.0,
        spacing: 0.07,
        aim: 0.02,
        seed: SEED,
    };
    grid.camera_from_world(i, count)
}

fn scene(finest: f64) -> Scene {
    let lamp = DVec3::new(-1.2, 1.9, 1.6);
    let mut objects = Vec::new();
    room(lamp, &mut objects);
    front_row(&mut objects);
    bird_cage(DVec3::new(-0.19, 0.0, 0.02), &mut objects);
    pencils(DVec3::new(0.29, 0.0, 0.03), &mut objects);
    arch(&mut objects);
    back_row(&mut objects);
    let lighting = Lighting {
        lamp,
        lamp_radius: 0.18,
        lamp_color: 0.9 * DVec3::new(1.0, 0.94, 0.84),
        sky: 0.52 * DVec3::new(0.93, 0.97, 1.0),
        ground: 0.34 * DVec3::new(1.0, 0.91, 0.80),
        up: DVec3::Y,
        corner_reach: 0.10,
    };
    Scene::new(objects, lighting, finest)
}

/// The table, the wall behind it, the floor between, and the rest for reflections.
fn room(lamp: DVec3, objects: &mut Vec<Object>) {
    let still = DQuat::IDENTITY;
    let window = Texture::Room {
        window: lamp.normalize(),
    };
    let around = Shape::Sphere { radius: 12.0 };
    objects.push(object(around, DVec3::ZERO, still, window, Finish::Flat));
    let wall = Shape::Rectangle {
        half: DVec2::new(6.0, 4.0),
    };
    let paper = Texture::Wallpaper {
        ground: rgb(0x8c7f9e),
        figure: rgb(0xd8c7a6),
        period: 0.13,
        seed: 11,
    };
    objects.push(object(
        wall,
        DVec3::new(0.0, 0.5, WALL),
        still,
        paper,
        MATTE,
    ));
    let table = cuboid(DVec3::new(2.0, 0.02, 0.55));
    let boards = Texture::Wood {
        light: rgb(0xc79a62),
        dark: rgb(0x84552f),
        plank: 0.12,
        seed: 21,
    };
    objects.push(object(
        table,
        DVec3::new(0.0, -0.02, 0.0),
        still,
        boards,
        SATIN,
    ));
}

/// Chess pieces and marbles, the nearest things of all.
fn front_row(objects: &mut Vec<Object>) {
    let pawn = [
        (0.026, 0.000),
        (0.025, 0.008),
        (0.012, 0.022),
        (0.009, 0.045),
        (0.016, 0.052),
        (0.010, 0.058),
        (0.0165, 0.070),
        (0.0125, 0.084),
        (0.003, 0.088),
    ];
    for (i, (x, z, size, color)) in [
        (-0.36, 0.29, 1.0, 0xe8d9b0),
        (-0.245, 0.36, 1.25, 0x4a2f22),
        (-0.10, 0.30, 1.0, 0xe8d9b0),
        (0.045, 0.38, 1.1, 0x4a2f22),
        (0.17, 0.29, 1.35, 0xe8d9b0),
        (0.33, 0.33, 1.0, 0x4a2f22),
    ]
    .into_iter()
    .enumerate()
    {
        let through: Vec<(f64, f64)> = pawn.iter().map(|&(r, y)| (size * r, size * y)).collect();
        let at = DVec3::new(x, 0.0, z);
        let texture = mottled(color, 0.35, 0.015, 31 + i as u32);
        objects.push(object(
            turned(&through),
            at,
            DQuat::IDENTITY,
            texture,
            SATIN,
        ));
    }
    for (i, (x, z, radius, color)) in [
        (-0.16, 0.40, 0.016, 0x5b86b8),
        (0.115, 0.345, 0.020, 0xa8141c),
        (0.25, 0.41, 0.015, 0x3a8a4a),
        (-0.30, 0.22, 0.018, 0xd9b52c),
    ]
    .into_iter()
    .enumerate()
    {
        let texture = mottled(color, 0.7, 0.02, 41 + i as u32);
        let at = DVec3::new(x, radius, z);
        let ball = Shape::Sphere { radius };
        objects.push(object(ball, at, DQuat::IDENTITY, texture, GLAZED));
    }
}

/// A cage of thin bars with a bird inside.
fn bird_cage(foot: DVec3, objects: &mut Vec<Object>) {
    const BARS: usize = 14;
    let (radius, height) = (0.085, 0.21);
    let brass = || mottled(0xb98a3a, 0.25, 0.01, 51);
    let disc = |radius: f64, half_height: f64| Shape::Cylinder {
        radius,
        half_height,
    };
    let still = DQuat::IDENTITY;
    objects.push(object(
        disc(0.095, 0.006),
        foot + 0.006 * DVec3::Y,
        still,
        brass(),
        SATIN,
    ));
    for i in 0..BARS {
        let (sin, cos) = (TAU * (i as f64 + 0.3) / BARS as f64).sin_cos();
        let out = radius * DVec3::new(cos, 0.0, sin);
        let (low, high) = (foot + out, foot + out + height * DVec3::Y);
        objects.push(rod(low, high, 0.0022, brass(), SATIN));
        objects.push(rod(
            high,
            foot + (height + 0.07) * DVec3::Y,
            0.0022,
            brass(),
            SATIN,
        ));
    }
    let knob = Shape::Sphere { radius: 0.012 };
    objects.push(object(
        knob,
        foot + (height + 0.08) * DVec3::Y,
        still,
        brass(),
        GLAZED,
    ));
    let perch = foot + 0.07 * DVec3::Y;
    let across = (radius - 0.001) * DVec3::new(0.8, 0.0, 0.6);
    let twig = mottled(0x5a4026, 0.4, 0.02, 52);
    objects.push(rod(perch - across, perch + across, 0.004, twig, MATTE));
    let plumage = |color, seed| mottled(color, 0.4, 0.012, seed);
    for (at, radius, color) in [
        (DVec3::new(0.0, 0.034, 0.0), 0.030, 0xe0b020),
        (DVec3::new(0.016, 0.072, 0.008), 0.019, 0xe8c040),
    ] {
        let ball = Shape::Sphere { radius };
        objects.push(object(ball, perch + at, still, plumage(color, 53), MATTE));
    }
    let beak = perch + DVec3::new(0.032, 0.070, 0.016);
    objects.push(rod(
        beak,
        beak + DVec3::new(0.014, -0.003, 0.007),
        0.003,
        plumage(0xc4561c, 54),
        MATTE,
    ));
}

/// A mug of pencils that lean every way.
fn pencils(foot: DVec3, objects: &mut Vec<Object>) {
    let mug = [
        (0.034, 0.0),
        (0.040, 0.01),
        (0.042, 0.05),
        (0.040, 0.09),
        (0.041, 0.10),
    ];
    let china = Texture::Porcelain {
        span: DVec2::new(0.0, 0.10),
        seed: 61,
    };
    objects.push(object(turned(&mug), foot, DQuat::IDENTITY, china, GLAZED));
    for (i, color) in [0xc23a2e, 0x2c64a8, 0xe0b020, 0x3a8a4a, 0x7a3a8a, 0xe07a1e]
        .into_iter()
        .enumerate()
    {
        let (sin, cos) = (TAU * i as f64 / 6.0 + 0.4).sin_cos();
        let lean = DVec3::new(cos, 0.0, sin);
        let (low, high) = (foot - 0.012 * lean, foot + 0.062 * lean);
        let top = high + (0.17 + 0.008 * i as f64) * DVec3::Y;
        let paint = mottled(color, 0.15, 0.02, 62 + i as u32);
        objects.push(rod(low + 0.012 * DVec3::Y, top, 0.0038, paint, SATIN));
    }
}

/// Toy blocks piled up to an arch; one sees through it.
fn arch(objects: &mut Vec<Object>) {
    let half = 0.026;
    let side = 2.0 * half;
    let mut block = |at: DVec3, turn: f64, paint: u32, letters: &'static str, seed: u32| {
        let texture = Texture::Block {
            paint: rgb(paint),
            half,
            letters,
            seed,
        };
        let turn = DQuat::from_rotation_y(turn);
        objects.push(object(cuboid(DVec3::splat(half)), at, turn, texture, SATIN));
    };
    let foot = DVec3::new(0.06, half, 0.05);
    for (x, turn) in [(-0.075, 0.06), (0.075, -0.05)] {
        for level in 0..3 {
            let at = foot + DVec3::new(x, side * f64::from(level), 0.0);
            let turn = turn * (1.0 + f64::from(level));
            let letters = if x < 0.0 { "GHAOLM" } else { "RPXULI" };
            let paint = [0x2c64a8, 0xc23a2e, 0x3a8a4a][level as usize];
            block(at, turn, paint, letters, 71 + level as u32);
        }
    }
    block(
        foot + DVec3::new(0.0, 4.0 * side + 0.001, 0.0),
        0.3,
        0xe0a020,
        "LAOXUG",
        75,
    );
    let lintel = cuboid(DVec3::new(0.115, half, 0.03));
    let wood = Texture::Wood {
        light: rgb(0xd0a060),
        dark: rgb(0x9a6030),
        plank: 0.05,
        seed: 76,
    };
    let at = foot + DVec3::new(0.0, 3.0 * side, 0.0);
    objects.push(object(lintel, at, DQuat::IDENTITY, wood, SATIN));
}

/// Books, a globe, tins and a picture, behind everything else.
fn back_row(objects: &mut Vec<Object>) {
    let still = DQuat::IDENTITY;
    let mut x = -0.52;
    for (i, (cloth, title, thick, tall)) in [
        (0x7a2b2b, "GRAPH", 0.022, 0.125),
        (0x274a63, "LUMI", 0.017, 0.115),
        (0x53683a, "OPAL", 0.026, 0.135),
        (0x8a6a2a, "GRAPH", 0.015, 0.110),
        (0x4a2a5a, "LUMI", 0.020, 0.128),
    ]
    .into_iter()
    .enumerate()
    {
        // Standing, the back to the viewer.
        let half = DVec3::new(tall, thick, 0.085);
        let upright = DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2);
        let book = Texture::Book {
            cloth: rgb(cloth),
            half,
            title,
            seed: 81 + i as u32,
        };
        x += thick;
        objects.push(object(
            cuboid(half),
            DVec3::new(x, tall, -0.36),
            upright,
            book,
            MATTE,
        ));
        x += thick + 0.002;
    }
    let stand = [
        (0.055, 0.0),
        (0.050, 0.010),
        (0.018, 0.022),
        (0.012, 0.045),
        (0.015, 0.055),
    ];
    let foot = DVec3::new(0.10, 0.0, -0.30);
    let wood = mottled(0x9a6a34, 0.3, 0.03, 91);
    objects.push(object(turned(&stand), foot, still, wood, SATIN));
    let tilt = DQuat::from_rotation_z(-0.41) * DQuat::from_rotation_y(2.2);
    let globe = Shape::Sphere { radius: 0.11 };
    let at = foot + DVec3::new(0.0, 0.16, 0.0);
    objects.push(object(globe, at, tilt, Texture::Globe { seed: 144 }, SATIN));
    for (x, z, radius, half_height, seed, colors) in [
        (0.36, -0.33, 0.06, 0.10, 101, [0xf0e2c0, 0xb5372c, 0x27323f]),
        (0.51, -0.27, 0.05, 0.14, 102, [0xdfe6d8, 0x2b6b5f, 0x3a2a20]),
    ] {
        let label = Texture::Label {
            paper: rgb(colors[0]),
            band: rgb(colors[1]),
            ink: rgb(colors[2]),
            half_height,
            seed,
        };
        let tin = Shape::Cylinder {
            radius,
            half_height,
        };
        objects.push(object(
            tin,
            DVec3::new(x, half_height, z),
            still,
            label,
            SATIN,
        ));
    }
    let half = DVec3::new(0.26, 0.19, 0.012);
    let painting = Texture::Painting {
        half,
        motif: Motif::Hills,
        seed: 111,
    };
    let at = DVec3::new(-0.12, 0.36, WALL + half.z);
    objects.push(object(cuboid(half), at, still, painting, MATTE));
}
