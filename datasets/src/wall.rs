use crate::dataset::Plan;
use crate::noise::signed;
use crate::{
    Dataset, DatasetError, Finish, Lighting, Material, Object, Options, Scene, Shape, Texture,
};
use calibrate::{ModelKind, Rigid3};
use glam::{DQuat, DVec2, DVec3};

const SEED: u32 = 41;
/// From the cameras to the wall.
const DISTANCE: f64 = 3.0;

/// One brick plane in a general position, without highlights, that fills every photo: a
/// plane proxy is the exact truth.
///
/// The plane is that of `scene.objects()[0]`, the z = 0 plane of its frame. By default 9
/// photos of 480 × 360 from general positions, every ninth one much closer; pinhole.
///
/// # Errors
/// An option out of its range.
pub fn wall(options: &Options) -> Result<Dataset, DatasetError> {
    let chosen = options.or_defaults((480, 360), 9)?;
    let (width, height) = (f64::from(chosen.width), f64::from(chosen.height));
    let focal = 1.25 * width.max(height);
    let footprint = DISTANCE / focal;
    let world_from_wall = Rigid3::new(
        DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -0.7).normalize(), 0.6),
        DVec3::new(0.7, -0.4, 1.9),
    );
    let bricks = Object {
        shape: Shape::Rectangle {
            half: DVec2::splat(40.0),
        },
        world_from_shape: world_from_wall,
        material: Material {
            texture: Texture::Bricks {
                size: DVec2::new(0.42, 0.21),
                color: DVec3::new(0.36, 0.22, 0.17),
                seed: SEED,
            },
            finish: Finish::Flat,
        },
        casts_shadow: false,
    };
    let lighting = Lighting {
        lamp: world_from_wall * DVec3::new(-1.0, 2.0, 4.0),
        lamp_radius: 0.2,
        lamp_color: DVec3::ZERO,
        sky: DVec3::ONE,
        ground: DVec3::ONE,
        up: world_from_wall.rotation * DVec3::Y,
        corner_reach: 0.1,
    };
    let poses = (0..chosen.views)
        .map(|i| camera_from_wall(i) * world_from_wall.inverse())
        .collect();
    let plan = Plan {
        name: "wall",
        kind: "synthetic: one brick plane in a general position, no highlights.",
        stresses: "A plane proxy is the exact truth: whatever differs from a held-out \
                   photo is resampling. Every ninth camera is much closer than the others.",
        scene: Scene::new(vec![bricks], lighting, 3.0 * footprint),
        model: ModelKind::Pinhole,
        params: vec![focal, focal, 0.5 * width, 0.5 * height],
        poses,
        times_s: Vec::new(),
        motion: None,
        points: 1000,
        matte: false,
        seed: SEED,
    };
    Ok(plan.into_dataset(&chosen))
}

/// Camera `i`, in the wall's frame (the wall is z = 0, seen from z > 0).
fn camera_from_wall(i: usize) -> Rigid3 {
    let r = |k: i32| signed(SEED, i as i32, k, 8);
    let forward = i % 9 == 8;
    // A 3 × 3 grid, shaken; the ninth steps forward in the middle instead.
    let (column, row) = ((i % 9 % 3) as f64 - 1.0, (i % 9 / 3) as f64 - 1.0);
    let (center, target) = if forward {
        let center = DVec3::new(0.15, -0.1, 0.6 * DISTANCE) + 0.1 * DVec3::new(r(0), r(1), r(2));
        (center, DVec3::new(0.1 * r(3), 0.1 * r(4), 0.0))
    } else {
        let shaken = DVec3::new(0.12 * r(0), 0.12 * r(1), DISTANCE * (1.0 + 0.12 * r(2)));
        let center = DVec3::new(0.4 * column, 0.35 * row, 0.0) + shaken;
        (center, DVec3::new(0.25 * r(3), 0.25 * r(4), 0.0))
    };
    let roll = Rigid3::new(DQuat::from_rotation_z(0.15 * r(5)), DVec3::ZERO);
    roll * Rigid3::looking_at(center, target, DVec3::Y)
}
