use crate::dataset::Plan;
use crate::texture::rgb;
use crate::{
    Dataset, DatasetError, Finish, Lighting, Material, Object, Options, Scene, Shape, Texture,
};
use calibrate::{ModelKind, Rigid3};
use glam::{DQuat, DVec2, DVec3};
use std::f64::consts::TAU;

const SEED: u32 = 83;
/// From the cameras to the point of the axis that they look at.
const DISTANCE: f64 = 0.85;
/// The cameras' height above that point, as an angle seen from it.
const ELEVATION: f64 = 0.30;
/// What they look at: a point of the turntable's axis.
const TARGET: DVec3 = DVec3::new(0.0, 0.05, 0.0);
/// Pixels to a radian, for each pixel of the photos' width.
const RELATIVE_FOCAL: f64 = 1.5;
/// Where the wheels' centres are, before and behind the middle.
const WHEEL_BASE: f64 = 0.088;
/// Their distance from the ground.
const WHEEL_RADIUS: f64 = 0.030;

/// A toy car on a turntable, and nothing else: Buehler et al. 2001, §5, Car.
///
/// The cameras lie on a perfect circle and look inwards; photo i is a whole turn's i-th part
/// of as many as there are, counter-clockwise as seen from above. By default 36 photos of
/// 640 × 480. Alpha is the part of a pixel that the car covers. Units are metres, y is up
/// and the ground (which is not there) is y = 0.
///
/// # Errors
/// An option out of its range.
pub fn car(options: &Options) -> Result<Dataset, DatasetError> {
    let chosen = options.or_defaults((640, 480), 36)?;
    let (width, height) = (f64::from(chosen.width), f64::from(chosen.height));
    let focal = RELATIVE_FOCAL * width.min(height * 4.0 / 3.0);
    let pose = |i: usize| {
        let (sin, cos) = (TAU * i as f64 / chosen.views as f64).sin_cos();
        let outwards = DVec3::new(
            sin * ELEVATION.cos(),
            ELEVATION.sin(),
            cos * ELEVATION.cos(),
        );
        Rigid3::looking_at(TARGET + DISTANCE * outwards, TARGET, DVec3::Y)
    };
    let plan = Plan {
        name: "car",
        kind: "synthetic: a toy car on a turntable, alone in the picture, with exact mattes.",
        stresses: "A visual hull is the proxy: silhouettes are exact, the wheel arches are \
                   hollow where no silhouette shows it. Glossy paint.",
        scene: scene(2.0 * DISTANCE / focal),
        model: ModelKind::SimplePinhole,
        params: vec![focal, 0.5 * width, 0.5 * height],
        poses: (0..chosen.views).map(pose).collect(),
        times_s: Vec::new(),
        motion: None,
        points: 12_000,
        matte: true,
        seed: SEED,
    };
    Ok(plan.into_dataset(&chosen))
}

fn scene(finest: f64) -> Scene {
    let lighting = Lighting {
        lamp: DVec3::new(-0.8, 1.6, 0.9),
        lamp_radius: 0.15,
        lamp_color: 0.75 * DVec3::new(1.0, 0.96, 0.9),
        sky: 0.55 * DVec3::new(0.94, 0.97, 1.0),
        ground: 0.3 * DVec3::new(1.0, 0.96, 0.9),
        up: DVec3::Y,
        corner_reach: 0.02,
    };
    let mut objects = vec![body(), cabin()];
    for side in [-1.0, 1.0] {
        for x in [-WHEEL_BASE, WHEEL_BASE] {
            wheel(&mut objects, x, side);
        }
        for end in [-1.0, 1.0] {
            objects.push(lamp(end, side));
        }
        objects.push(mirror(side));
    }
    objects.push(spoiler());
    Scene::new(objects, lighting, finest)
}

fn object(shape: Shape, at: DVec3, rotation: DQuat, color: u32, seed: u32) -> Object {
    Object {
        shape,
        world_from_shape: Rigid3::new(rotation, at),
        material: Material {
            texture: Texture::Mottled {
                color: rgb(color),
                contrast: 0.45,
                wavelength: 0.02,
                seed: SEED + seed,
            },
            finish: Finish::Matte,
        },
        casts_shadow: true,
    }
}

fn prism(outline: &[[f64; 2]], half_depth: f64) -> Shape {
    Shape::Prism {
        outline: outline.iter().map(|p| DVec2::from_array(*p)).collect(),
        half_depth,
    }
}

/// Bonnet, sides with wheel arches, boot; the car drives towards +x.
fn body() -> Object {
    let (base, arch) = (WHEEL_BASE, WHEEL_RADIUS + 0.006);
    let mut outline = vec![[-0.148, 0.024]];
    for x in [-base, base] {
        // Over the wheel from behind: half a circle, as far as it is above the sill.
        for step in 0..=8 {
            let angle = std::f64::consts::PI * (1.0 - f64::from(step) / 8.0);
            let y = WHEEL_RADIUS + arch * angle.sin();
            outline.push([x + arch * angle.cos(), y.max(0.024)]);
        }
    }
    outline.extend([
        [0.150, 0.024],
        [0.152, 0.050],
        [0.140, 0.062],
        [0.058, 0.074],
        [-0.112, 0.076],
        [-0.146, 0.072],
        [-0.152, 0.052],
    ]);
    let mut body = object(
        prism(&outline, 0.060),
        DVec3::ZERO,
        DQuat::IDENTITY,
        0xb8322a,
        0,
    );
    body.material.finish = Finish::Glossy {
        highlight: 0.4,
        exponent: 60.0,
        mirror: 0.0,
    };
    body
}

/// The roof and the windows.
fn cabin() -> Object {
    let outline = [
        [0.060, 0.072],
        [0.018, 0.110],
        [-0.062, 0.113],
        [-0.108, 0.074],
    ];
    object(
        prism(&outline, 0.050),
        DVec3::ZERO,
        DQuat::IDENTITY,
        0x6f93a8,
        1,
    )
}

fn wheel(objects: &mut Vec<Object>, x: f64, side: f64) {
    let shape = Shape::Cylinder {
        radius: WHEEL_RADIUS,
        half_height: 0.011,
    };
    let at = DVec3::new(x, WHEEL_RADIUS, side * 0.052);
    let upright = DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2);
    objects.push(object(shape, at, upright, 0x3a3a3e, 2));
    let hub = Shape::Cylinder {
        radius: 0.014,
        half_height: 0.003,
    };
    let at = at.with_z(side * 0.064);
    objects.push(object(hub, at, upright, 0xc8c8c4, 3));
}

fn lamp(end: f64, side: f64) -> Object {
    let color = if end > 0.0 { 0xf0e6b0 } else { 0xd05a20 };
    let shape = Shape::Sphere { radius: 0.009 };
    let at = DVec3::new(end * 0.148, 0.054, side * 0.044);
    object(shape, at, DQuat::IDENTITY, color, 4)
}

fn mirror(side: f64) -> Object {
    let half = DVec3::new(0.004, 0.006, 0.009);
    let at = DVec3::new(0.038, 0.082, side * 0.064);
    let shape = Shape::Cuboid { half };
    object(shape, at, DQuat::IDENTITY, 0x8e2620, 5)
}

/// A board across the boot.
fn spoiler() -> Object {
    let outline = [
        [-0.150, 0.070],
        [-0.136, 0.070],
        [-0.140, 0.090],
        [-0.156, 0.092],
    ];
    object(
        prism(&outline, 0.052),
        DVec3::ZERO,
        DQuat::IDENTITY,
        0x9c2a24,
        6,
    )
}
