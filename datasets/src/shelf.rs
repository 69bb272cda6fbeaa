use crate::dataset::Plan;
use crate::hand_held::HandHeldGrid;
use crate::noise::unit;
use crate::props::{GLAZED, MATTE, SATIN, cuboid, mottled, object};
use crate::shape::smooth_profile;
use crate::texture::rgb;
use crate::{
    Dataset, DatasetError, Finish, Lighting, Motif, Object, Options, Scene, Shape, Texture,
};
use calibrate::{ModelKind, Rigid3};
use glam::{DQuat, DVec2, DVec3};
use std::f64::consts::FRAC_PI_2;

const SEED: u32 = 7;
/// From the cameras to what they look at, in metres.
const DISTANCE: f64 = 3.1;
/// What they look at: the sideboard's top is y = 0, x points right, z to the viewer.
const TARGET: DVec3 = DVec3::new(0.0, 0.30, 0.0);
/// The wall is z = −`BACK`, the sideboard's front z = `FRONT`.
const BACK: f64 = 0.32;
const FRONT: f64 = 0.30;

/// A still life on a sideboard before a papered wall: the demonstration scene.
///
/// By default 20 photos of 480 × 360 from a shaken 5 × 4 grid whose neighbours are 5 % of
/// the distance apart. Units are metres, y is up.
///
/// # Errors
/// An option out of its range.
pub fn shelf(options: &Options) -> Result<Dataset, DatasetError> {
    let chosen = options.or_defaults((480, 360), 20)?;
    let (width, height) = (f64::from(chosen.width), f64::from(chosen.height));
    let focal = 1.86 * width.max(height * 4.0 / 3.0);
    let footprint = DISTANCE / focal;
    let plan = Plan {
        name: "shelf",
        kind: "synthetic: still life on a sideboard, forward-facing 2-D grid of viewpoints.",
        stresses: "Thin twigs before a patterned wall, contact shadows, highlights and \
                   mirror images that move with the viewer (vase, globe, red ball, knobs); \
                   depth stays within 15 % of its mean.",
        scene: scene(2.0 * footprint),
        model: ModelKind::SimpleRadial,
        params: vec![focal, 0.5 * width, 0.5 * height, -0.05],
        poses: (0..chosen.views)
            .map(|i| hand_held(i, chosen.views))
            .collect(),
        times_s: Vec::new(),
        motion: None,
        points: 2500,
        matte: false,
        seed: SEED,
    };
    Ok(plan.into_dataset(&chosen))
}

/// Camera `i` of `count`: on a grid, with an unsteady hand.
fn hand_held(i: usize, count: usize) -> Rigid3 {
    let grid = HandHeldGrid {
        target: TARGET,
        distance: DISTANCE,
        // Looking down on the still life by a sixth of the distance.
        towards: DVec3::new(0.02, 0.22, 1.0),
        columns_per_row: 1.25,
        spacing: 0.05,
        aim: 0.03,
        seed: SEED,
    };
    grid.camera_from_world(i, count)
}

fn scene(finest: f64) -> Scene {
    let lamp = DVec3::new(-1.7, 2.3, 2.2);
    let mut objects = Vec::new();
    room(lamp, &mut objects);
    pictures(&mut objects);
    books_and_bowl(&mut objects);
    vase(&mut objects);
    globe(&mut objects);
    toys_and_tins(&mut objects);
    let lighting = Lighting {
        lamp,
        lamp_radius: 0.22,
        lamp_color: 0.95 * DVec3::new(1.0, 0.93, 0.82),
        sky: 0.52 * DVec3::new(0.92, 0.97, 1.0),
        ground: 0.34 * DVec3::new(1.0, 0.90, 0.78),
        up: DVec3::Y,
        corner_reach: 0.13,
    };
    Scene::new(objects, lighting, finest)
}

/// The wall, the sideboard, a runner on it, and the rest of the room for reflections.
fn room(lamp: DVec3, objects: &mut Vec<Object>) {
    let still = DQuat::IDENTITY;
    objects.push(object(
        Shape::Sphere { radius: 14.0 },
        DVec3::ZERO,
        still,
        Texture::Room {
            window: lamp.normalize(),
        },
        Finish::Flat,
    ));
    objects.push(object(
        Shape::Rectangle {
            half: DVec2::new(6.0, 3.0),
        },
        DVec3::new(0.0, 1.0, -BACK),
        still,
        Texture::Wallpaper {
            ground: rgb(0x6f9a92),
            figure: rgb(0xc9caa9),
            period: 0.15,
            seed: 11,
        },
        MATTE,
    ));
    // The top overhangs the drawers a little.
    let depth = 0.5 * (BACK + FRONT);
    objects.push(object(
        cuboid(DVec3::new(5.0, 0.018, depth)),
        DVec3::new(0.0, -0.018, FRONT - depth),
        still,
        Texture::Wood {
            light: rgb(0xb9804a),
            dark: rgb(0x7d4c26),
            plank: 0.155,
            seed: 21,
        },
        SATIN,
    ));
    objects.push(object(
        cuboid(DVec3::new(5.0, 0.5, depth)),
        DVec3::new(0.0, -0.536, FRONT - depth - 0.02),
        still,
        Texture::Drawers {
            color: rgb(0xa06a3a),
            period: 0.52,
            seed: 31,
        },
        MATTE,
    ));
    for i in -2..=2 {
        objects.push(object(
            Shape::Sphere { radius: 0.018 },
            DVec3::new(0.26 + 0.52 * f64::from(i), -0.125, FRONT - 0.005),
            still,
            mottled(0xd8a84c, 0.1, 0.02, 33),
            Finish::Glossy {
                highlight: 1.0,
                exponent: 120.0,
                mirror: 0.35,
            },
        ));
    }
    objects.push(object(
        cuboid(DVec3::new(0.43, 0.002, 0.165)),
        DVec3::new(0.0, 0.002, 0.0),
        DQuat::from_rotation_y(0.05),
        Texture::Cloth {
            colors: [rgb(0xeae0c8), rgb(0xb24a38), rgb(0x2f6470)],
            period: 0.215,
            seed: 41,
        },
        MATTE,
    ));
}

fn pictures(objects: &mut Vec<Object>) {
    let hung = [
        (
            DVec3::new(-0.43, 0.60, 0.0),
            DVec2::new(0.225, 0.165),
            Motif::Hills,
            51,
        ),
        (
            DVec3::new(0.44, 0.62, 0.0),
            DVec2::new(0.150, 0.195),
            Motif::Abstract,
            60,
        ),
    ];
    for (at, half, motif, seed) in hung {
        let half = half.extend(0.014);
        objects.push(object(
            cuboid(half),
            at.with_z(-BACK + half.z),
            DQuat::IDENTITY,
            Texture::Painting { half, motif, seed },
            MATTE,
        ));
    }
}

/// A lying stack of books with a bowl of fruit on it, and books standing at the right.
fn books_and_bowl(objects: &mut Vec<Object>) {
    let lying = [
        (DVec3::new(0.165, 0.026, 0.115), 0x7a2b2b, "GRAPH", 0.08),
        (DVec3::new(0.155, 0.020, 0.110), 0x274a63, "LUMI", -0.10),
        (DVec3::new(0.140, 0.024, 0.100), 0x53683a, "OPAL", 0.16),
    ];
    let mut top = 0.0;
    for (i, (half, cloth, title, turn)) in lying.into_iter().enumerate() {
        objects.push(object(
            cuboid(half),
            DVec3::new(-0.50 + 0.012 * i as f64, top + half.y, -0.12),
            DQuat::from_rotation_y(turn),
            Texture::Book {
                cloth: rgb(cloth),
                half,
                title,
                seed: 71 + i as u32,
            },
            MATTE,
        ));
        top += 2.0 * half.y;
    }
    // The bowl: out, over the rim, and back in.
    let bowl = [
        (0.030, 0.000),
        (0.034, 0.008),
        (0.068, 0.030),
        (0.088, 0.062),
        (0.094, 0.080),
    ];
    let through: Vec<DVec2> = bowl.iter().map(|&(r, y)| DVec2::new(r, y)).collect();
    let foot = DVec3::new(-0.485, top, -0.12);
    objects.push(object(
        Shape::Lathe {
            profile: smooth_profile(&through, 3),
        },
        foot,
        DQuat::IDENTITY,
        mottled(0x2c8a8f, 0.35, 0.03, 81),
        GLAZED,
    ));
    let fruit = [
        (DVec3::new(-0.034, 0.074, 0.022), 0.041, 0xe08a1e),
        (DVec3::new(0.040, 0.076, 0.018), 0.038, 0xc9352b),
        (DVec3::new(0.004, 0.078, -0.044), 0.040, 0xd9b52c),
        (DVec3::new(0.004, 0.118, 0.004), 0.036, 0xe2952a),
    ];
    for (i, (at, radius, color)) in fruit.into_iter().enumerate() {
        objects.push(object(
            Shape::Sphere { radius },
            foot + at,
            DQuat::IDENTITY,
            mottled(color, 0.35, 0.03, 91 + i as u32),
            SATIN,
        ));
    }
}

/// The glazed vase and its twigs of berries.
fn vase(objects: &mut Vec<Object>) {
    let profile = [
        (0.050, 0.000),
        (0.052, 0.012),
        (0.080, 0.070),
        (0.097, 0.140),
        (0.084, 0.205),
        (0.048, 0.260),
        (0.036, 0.295),
        (0.052, 0.330),
    ];
    let through: Vec<DVec2> = profile.iter().map(|&(r, y)| DVec2::new(r, y)).collect();
    let foot = DVec3::new(-0.10, 0.004, -0.10);
    objects.push(object(
        Shape::Lathe {
            profile: smooth_profile(&through, 3),
        },
        foot,
        DQuat::from_rotation_y(0.3),
        Texture::Porcelain {
            span: DVec2::new(0.0, 0.33),
            seed: 101,
        },
        GLAZED,
    ));
    let mouth = foot + DVec3::new(0.0, 0.30, 0.0);
    let tips = [
        (-0.17, 0.33, 0.05),
        (-0.06, 0.43, -0.05),
        (0.07, 0.39, 0.06),
        (0.17, 0.27, -0.02),
    ];
    for (twig, (x, y, z)) in tips.into_iter().enumerate() {
        let along = DVec3::new(x, y, z);
        objects.push(object(
            Shape::Cylinder {
                radius: 0.0042,
                half_height: 0.5 * along.length(),
            },
            mouth + 0.5 * along,
            DQuat::from_rotation_arc(DVec3::Y, along.normalize()),
            mottled(0x4f3a22, 0.4, 0.02, 111),
            MATTE,
        ));
        // Berries along the upper half, in turn on all sides.
        for berry in 0..5 {
            let r = |k: i32| unit(SEED, 100 + twig as i32, berry, k);
            let part = 0.48 + 0.13 * f64::from(berry) + 0.04 * r(0);
            let angle = 2.4 * f64::from(berry) + 6.0 * r(1);
            let radius = 0.011 + 0.005 * r(2);
            let (u, v) = along.normalize().any_orthonormal_pair();
            let aside = (radius + 0.004) * (angle.cos() * u + angle.sin() * v);
            objects.push(object(
                Shape::Sphere { radius },
                mouth + part * along + aside,
                DQuat::IDENTITY,
                mottled(if berry == 2 { 0xd9662a } else { 0xb3202a }, 0.3, 0.02, 121),
                SATIN,
            ));
        }
    }
}

fn globe(objects: &mut Vec<Object>) {
    let foot = DVec3::new(0.25, 0.004, -0.09);
    let profile = [
        (0.072, 0.000),
        (0.070, 0.010),
        (0.030, 0.022),
        (0.014, 0.045),
        (0.018, 0.060),
    ];
    let through: Vec<DVec2> = profile.iter().map(|&(r, y)| DVec2::new(r, y)).collect();
    objects.push(object(
        Shape::Lathe {
            profile: smooth_profile(&through, 3),
        },
        foot,
        DQuat::IDENTITY,
        mottled(0x9a6a34, 0.3, 0.03, 131),
        SATIN,
    ));
    objects.push(object(
        Shape::Sphere { radius: 0.125 },
        foot + DVec3::new(0.0, 0.18, 0.0),
        DQuat::from_rotation_z(-0.41) * DQuat::from_rotation_y(1.2),
        Texture::Globe { seed: 144 },
        Finish::Glossy {
            highlight: 0.5,
            exponent: 90.0,
            mirror: 0.03,
        },
    ));
}

fn toys_and_tins(objects: &mut Vec<Object>) {
    let tin = |at: DVec3, half_height: f64, radius: f64, turn: f64, colors: [u32; 3], seed| {
        object(
            Shape::Cylinder {
                radius,
                half_height,
            },
            at + DVec3::Y * half_height,
            DQuat::from_rotation_y(turn),
            Texture::Label {
                paper: rgb(colors[0]),
                band: rgb(colors[1]),
                ink: rgb(colors[2]),
                half_height,
                seed,
            },
            SATIN,
        )
    };
    objects.push(tin(
        DVec3::new(0.53, 0.0, -0.06),
        0.115,
        0.072,
        -0.15,
        [0xf0e2c0, 0xb5372c, 0x27323f],
        151,
    ));
    objects.push(tin(
        DVec3::new(0.67, 0.0, -0.19),
        0.17,
        0.062,
        0.2,
        [0xdfe6d8, 0x2b6b5f, 0x3a2a20],
        161,
    ));
    let half = 0.036;
    let blocks = [
        (DVec3::new(0.36, half, 0.13), 0.35, 0x2c64a8, "GHAOLM"),
        (DVec3::new(0.455, half, 0.10), -0.25, 0xc23a2e, "RPXULI"),
        (
            DVec3::new(0.405, 3.0 * half, 0.115),
            0.12,
            0x3a8a4a,
            "LAOXUG",
        ),
    ];
    for (i, (at, turn, paint, letters)) in blocks.into_iter().enumerate() {
        objects.push(object(
            cuboid(DVec3::splat(half)),
            at,
            DQuat::from_rotation_y(turn),
            Texture::Block {
                paint: rgb(paint),
                half,
                letters,
                seed: 171 + i as u32,
            },
            SATIN,
        ));
    }
    // A lacquered ball, a dull marble and a candle.
    objects.push(object(
        Shape::Sphere { radius: 0.062 },
        DVec3::new(0.09, 0.066, 0.10),
        DQuat::IDENTITY,
        mottled(0xa8141c, 0.15, 0.05, 181),
        Finish::Glossy {
            highlight: 1.2,
            exponent: 500.0,
            mirror: 0.09,
        },
    ));
    objects.push(object(
        Shape::Sphere { radius: 0.034 },
        DVec3::new(-0.02, 0.038, 0.145),
        DQuat::from_rotation_x(FRAC_PI_2),
        mottled(0x5b86b8, 0.7, 0.03, 191),
        GLAZED,
    ));
    objects.push(object(
        Shape::Cylinder {
            radius: 0.033,
            half_height: 0.065,
        },
        DVec3::new(-0.29, 0.065, 0.11),
        DQuat::IDENTITY,
        mottled(0xf1e6cf, 0.12, 0.05, 201),
        MATTE,
    ));
    objects.push(object(
        Shape::Cylinder {
            radius: 0.0025,
            half_height: 0.010,
        },
        DVec3::new(-0.29, 0.139, 0.11),
        DQuat::IDENTITY,
        mottled(0x2a2320, 0.2, 0.01, 202),
        MATTE,
    ));
}
