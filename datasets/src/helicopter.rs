use crate::dataset::Plan;
use crate::noise::signed;
use crate::texture::rgb;
use crate::{
    Dataset, DatasetError, Finish, Lighting, Material, Motion, Object, Options, Scene, Shape,
    Texture,
};
use calibrate::{ModelKind, Rigid3};
use glam::{DQuat, DVec2, DVec3};
use std::f64::consts::{FRAC_PI_2, TAU};

const SEED: u32 = 67;
/// From the camera to what it looks at.
const DISTANCE: f64 = 2.4;
/// What it looks at: the ground is y = 0.
const TARGET: DVec3 = DVec3::new(0.0, 0.12, 0.0);
/// The rotor's hub.
const HUB: DVec3 = DVec3::new(0.0, 0.27, 0.0);
/// A turn of the rotor.
const PERIOD_S: f64 = 1.37;
/// From photo to photo: 5 a second.
const STEP_S: f64 = 0.2;

/// A toy helicopter on a paved yard, its rotor turning, as a hand-held camera sees it from
/// above that swings to and fro: Buehler et al. 2001, §5, Helicopter.
///
/// The rotor's blades differ in colour, so that it looks the same only after a whole turn,
/// [`Motion::period_s`]. By default 96 photos of 480 × 360, five a second, over 14 turns
/// and five passes of the camera; their phases are spread evenly. Units are metres, y is
/// up.
///
/// # Errors
/// An option out of its range.
pub fn helicopter(options: &Options) -> Result<Dataset, DatasetError> {
    let chosen = options.or_defaults((480, 360), 96)?;
    let (width, height) = (f64::from(chosen.width), f64::from(chosen.height));
    let focal = 1.9 * width.max(height * 4.0 / 3.0);
    let times_s: Vec<f64> = (0..chosen.views).map(|i| STEP_S * i as f64).collect();
    let (scene, object_idxs) = scene(2.0 * DISTANCE / focal);
    let plan = Plan {
        name: "helicopter",
        kind: "synthetic: a toy helicopter whose rotor turns, hand-held from above; times in \
               times.csv, seconds.",
        stresses: "Motion that repeats every 1.37 s, its shadow included; few photos of any \
                   one moment. Sparse points lie on what stands still.",
        scene,
        model: ModelKind::SimplePinhole,
        params: vec![focal, 0.5 * width, 0.5 * height],
        poses: times_s
            .iter()
            .enumerate()
            .map(|(i, &time_s)| hand_held(i, time_s))
            .collect(),
        times_s,
        motion: Some(Motion {
            object_idxs,
            center: HUB,
            axis: DVec3::Y,
            period_s: PERIOD_S,
        }),
        points: 2500,
        matte: false,
        seed: SEED,
    };
    Ok(plan.into_dataset(&chosen))
}

/// Photo `i`: a swing from side to side, slowly to and fro, with an unsteady hand.
fn hand_held(i: usize, time_s: f64) -> Rigid3 {
    let r = |k: i32| signed(SEED, i as i32, k, 4);
    let side = 0.15 * (TAU * time_s / 7.7).sin() + 0.008 * r(0);
    let tilt = 0.1 + 0.05 * (TAU * time_s / 17.0).cos() + 0.008 * r(1);
    let direction = DVec3::new(side.sin() * tilt.cos(), side.cos() * tilt.cos(), tilt.sin());
    let center = TARGET + DISTANCE * (1.0 + 0.02 * r(2)) * direction;
    let target = TARGET + 0.02 * DVec3::new(r(3), r(4), r(5));
    let roll = Rigid3::new(DQuat::from_rotation_z(0.02 * r(6)), DVec3::ZERO);
    roll * Rigid3::looking_at(center, target, DVec3::NEG_Z)
}

/// The scene at time 0, and which of its objects turn.
fn scene(finest: f64) -> (Scene, Vec<usize>) {
    let lamp = DVec3::new(-1.3, 3.0, 1.1);
    let mut objects = vec![ground()];
    body(&mut objects);
    let still = objects.len();
    rotor(&mut objects);
    let turning = (still..objects.len()).collect();
    let lighting = Lighting {
        lamp,
        lamp_radius: 0.25,
        lamp_color: 0.75 * DVec3::new(1.0, 0.95, 0.86),
        sky: 0.5 * DVec3::new(0.92, 0.97, 1.0),
        ground: 0.3 * DVec3::new(1.0, 0.92, 0.82),
        up: DVec3::Y,
        corner_reach: 0.1,
    };
    (Scene::new(objects, lighting, finest), turning)
}

fn object(shape: Shape, at: DVec3, rotation: DQuat, texture: Texture) -> Object {
    Object {
        // The ground shades nothing.
        casts_shadow: shape.ball().1 < 1.0,
        shape,
        world_from_shape: Rigid3::new(rotation, at),
        material: Material {
            texture,
            finish: Finish::Matte,
        },
    }
}

fn ground() -> Object {
    let half = DVec2::splat(40.0);
    let paving = Texture::Bricks {
        size: DVec2::new(0.20, 0.10),
        color: DVec3::new(0.30, 0.29, 0.26),
        seed: SEED,
    };
    let flat = DQuat::from_rotation_x(-FRAC_PI_2);
    object(Shape::Rectangle { half }, DVec3::ZERO, flat, paving)
}

/// Cabin, tail, skids and mast, along x.
fn body(objects: &mut Vec<Object>) {
    let paint = |color: u32, seed: u32| Texture::Mottled {
        color: rgb(color),
        contrast: 0.35,
        wavelength: 0.05,
        seed,
    };
    let mut add = |shape: Shape, at: [f64; 3], color: u32| {
        let seed = SEED + 10 + objects.len() as u32;
        let (at, texture) = (DVec3::from_array(at), paint(color, seed));
        objects.push(object(shape, at, DQuat::IDENTITY, texture));
    };
    let cuboid = |x: f64, y: f64, z: f64| Shape::Cuboid {
        half: DVec3::new(x, y, z),
    };
    add(
        Shape::Sphere { radius: 0.11 },
        [-0.03, 0.135, 0.0],
        0x3f7d4e,
    );
    add(
        Shape::Sphere { radius: 0.075 },
        [-0.105, 0.125, 0.0],
        0x9fc3d6,
    );
    add(cuboid(0.20, 0.022, 0.022), [0.24, 0.15, 0.0], 0x3f7d4e);
    add(cuboid(0.03, 0.06, 0.006), [0.43, 0.18, 0.0], 0xd8d2c0);
    for side in [-0.09, 0.09] {
        add(cuboid(0.17, 0.008, 0.010), [-0.03, 0.008, side], 0x4a4640);
        for foot in [-0.10, 0.05] {
            add(cuboid(0.008, 0.035, 0.008), [foot, 0.045, side], 0x4a4640);
        }
    }
    let mast = Shape::Cylinder {
        radius: 0.012,
        half_height: 0.03,
    };
    add(mast, [0.0, 0.245, 0.0], 0x8a8478);
}

/// The hub and three blades, each of its own colour.
fn rotor(objects: &mut Vec<Object>) {
    let hub = Shape::Cylinder {
        radius: 0.035,
        half_height: 0.012,
    };
    let plain = |color: u32, seed: u32| Texture::Mottled {
        color: rgb(color),
        contrast: 0.2,
        wavelength: 0.04,
        seed,
    };
    objects.push(object(hub, HUB, DQuat::IDENTITY, plain(0xd8d2c0, 91)));
    for (i, color) in [0xd0342c, 0xf0c030, 0x2e5fb8].into_iter().enumerate() {
        let turn = DQuat::from_rotation_y(TAU * i as f64 / 3.0);
        let half = DVec3::new(0.19, 0.006, 0.05);
        // So far out that the blades, all of one height, do not overlap.
        let at = HUB + turn * DVec3::new(0.23, 0.0, 0.0);
        let texture = plain(color, 92 + i as u32);
        objects.push(object(Shape::Cuboid { half }, at, turn, texture));
    }
}
