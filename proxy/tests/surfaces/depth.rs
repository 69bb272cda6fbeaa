//! Depth maps fused: against exact shapes, with what sensors get wrong, and with nonsense.

use crate::common;

use calibrate::{DepthAlong, Distortion, Lens, Pixel, Rigid3, View};
use capture::DepthMap;
use glam::{DQuat, DVec2, DVec3};
use proptest::prelude::*;
use proxy::Mesh;
use proxy::depth::{DepthError, DepthNoise, Fusion, Options, believed, fuse};
use std::collections::{BTreeMap, BTreeSet};
use std::convert::Infallible;

const SIZE: (u32, u32) = (160, 120);

fn view(center: DVec3, target: DVec3) -> View {
    let (width, height) = SIZE;
    let middle = DVec2::new(width.into(), height.into()) / 2.0;
    View {
        lens: Lens::pinhole(DVec2::splat(140.0), middle),
        width,
        height,
        camera_from_world: Rigid3::looking_at(center, target, DVec3::Z),
    }
}

/// What a view sees of a shape: the distance along a unit ray to its nearest point.
fn seen(view: &View, distance: impl Fn(DVec3, DVec3) -> Option<f64>) -> (View, DepthMap) {
    let world_from_camera = view.camera_from_world.rotation.conjugate();
    let along = DepthAlong::of_view(view);
    let mut depths = Vec::new();
    for row in 0..view.height {
        for column in 0..view.width {
            let ray = view.lens.unproject(Pixel::center_of(column, row)).unwrap();
            let distance = distance(view.center(), world_from_camera * ray);
            depths.push(distance.map_or(0.0, |d| along.depth(d * ray) as f32));
        }
    }
    let (width, height) = (view.width, view.height);
    (
        view.clone(),
        DepthMap {
            width,
            height,
            depths,
        },
    )
}

fn sphere(center: DVec3, radius: f64) -> impl Fn(DVec3, DVec3) -> Option<f64> {
    move |from, ray| {
        let way = center - from;
        let middle = way.dot(ray);
        let half = radius * radius - (way - ray * middle).length_squared();
        (half >= 0.0)
            .then(|| middle - half.sqrt())
            .filter(|d| *d > 0.0)
    }
}

/// The inside of a box around the origin.
fn room(half: DVec3) -> impl Fn(DVec3, DVec3) -> Option<f64> {
    move |from, ray| {
        let wall = |k: usize| (half[k].copysign(ray[k]) - from[k]) / ray[k];
        let nearest = (0..3)
            .map(wall)
            .filter(|d| *d > 0.0)
            .fold(f64::INFINITY, f64::min);
        nearest.is_finite().then_some(nearest)
    }
}

/// The nearer of two shapes.
fn nearer(
    a: impl Fn(DVec3, DVec3) -> Option<f64>,
    b: impl Fn(DVec3, DVec3) -> Option<f64>,
) -> impl Fn(DVec3, DVec3) -> Option<f64> {
    move |from, ray| match (a(from, ray), b(from, ray)) {
        (Some(a), Some(b)) => Some(a.min(b)),
        (a, b) => a.or(b),
    }
}

/// A square of the plane z = `z`, |x|, |y| ≤ half.
fn square(z: f64, half: f64) -> impl Fn(DVec3, DVec3) -> Option<f64> {
    move |from, ray| {
        let distance = (z - from.z) / ray.z;
        let at = from + ray * distance;
        (distance > 0.0 && at.x.abs() <= half && at.y.abs() <= half).then_some(distance)
    }
}

fn fused(frames: &[(View, DepthMap)], options: &Options) -> Result<Fusion, DepthError> {
    fuse(
        frames.len(),
        |i| Ok::<_, Infallible>(frames[i].clone()),
        options,
    )
}

fn voxels(size: f64) -> Options {
    Options {
        voxel_size: Some(size),
        ..Options::default()
    }
}

/// Views of the origin from the corners and faces of a cube.
fn around(distance: f64) -> Vec<View> {
    let mut views = Vec::new();
    for x in -1..=1 {
        for y in -1..=1 {
            for z in -1..=1_i32 {
                let from = DVec3::new(x.into(), y.into(), z.into());
                if from.length_squared() % 2.0 == 1.0 {
                    views.push(view(from.normalize() * distance, DVec3::ZERO));
                }
            }
        }
    }
    views
}

fn sphere_frames() -> Vec<(View, DepthMap)> {
    around(3.0)
        .iter()
        .map(|v| seen(v, sphere(DVec3::ZERO, 1.0)))
        .collect()
}

/// How often each directed edge occurs.
fn sides(mesh: &Mesh) -> BTreeMap<(u32, u32), usize> {
    let mut sides = BTreeMap::new();
    for [a, b, c] in &mesh.triangles {
        for side in [(*a, *b), (*b, *c), (*c, *a)] {
            *sides.entry(side).or_default() += 1;
        }
    }
    sides
}

/// Sides without a neighbour that runs the other way.
fn open_sides(mesh: &Mesh) -> usize {
    let sides = sides(mesh);
    let open = sides
        .iter()
        .filter(|((a, b), n)| sides.get(&(*b, *a)) != Some(*n));
    open.count()
}

fn volume(mesh: &Mesh) -> f64 {
    let of = |i| {
        let [a, b, c] = mesh.corners(i);
        a.dot(b.cross(c)) / 6.0
    };
    (0..mesh.triangles.len()).map(of).sum()
}

#[test]
fn a_sphere_is_closed_turned_outwards_and_as_exact_as_voxels_allow() {
    let frames = sphere_frames();
    let mut last = f64::INFINITY;
    for size in [0.16, 0.08, 0.04] {
        let fusion = fused(&frames, &voxels(size)).unwrap();
        let mesh = &fusion.mesh;
        let errors = mesh.positions.iter().map(|p| (p.length() - 1.0).abs());
        let (mean, worst) = errors.fold((0.0, 0.0_f64), |(sum, worst), e| (sum + e, worst.max(e)));
        let mean = mean / mesh.positions.len() as f64;
        eprintln!(
            "voxels of {size}: mean {mean:.5}, worst {worst:.5}, {} triangles",
            mesh.triangles.len()
        );
        assert_eq!(open_sides(mesh), 0);
        let exact = 4.0 / 3.0 * std::f64::consts::PI;
        assert!(
            (volume(mesh) / exact - 1.0).abs() < size,
            "{}",
            volume(mesh)
        );
        assert!(mean < 0.15 * size && worst < 0.5 * size, "{mean} {worst}");
        assert!(mean < 0.6 * last, "errors fall with the voxels' size");
        last = mean;
    }
}

#[test]
fn a_room_is_flat_and_turned_inwards() {
    let half = DVec3::new(2.0, 1.5, 1.2);
    let views: Vec<View> = (0..8)
        .map(|i| {
            let angle = f64::from(i) * std::f64::consts::FRAC_PI_4;
            let ahead = DVec3::new(angle.cos(), angle.sin(), 0.0);
            let tilt = if i % 2 == 0 { 0.5 } else { -0.5 };
            view(ahead * -0.8, ahead + DVec3::Z * tilt)
        })
        .collect();
    let frames: Vec<_> = views.iter().map(|v| seen(v, room(half))).collect();
    let fusion = fused(&frames, &voxels(0.05)).unwrap();
    let mesh = &fusion.mesh;
    let off = |p: &DVec3| (half - p.abs()).min_element().abs();
    let mut errors: Vec<f64> = mesh.positions.iter().map(off).collect();
    errors.sort_by(f64::total_cmp);
    let [median, most] = [50, 95].map(|p| errors[errors.len() * p / 100]);
    eprintln!("room: median {median:.6}, 95 % {most:.6}");
    assert!(median < 1e-4 && most < 0.01, "{median} {most}");
    let inwards = |i: &usize| {
        let [a, b, c] = mesh.corners(*i);
        (b - a).cross(c - a).dot(-(a + b + c)) > 0.0
    };
    let count = (0..mesh.triangles.len()).filter(inwards).count();
    let share = count as f64 / mesh.triangles.len() as f64;
    assert!(share > 0.999, "{share}");
}

/// All round, and 324° from corner to corner: what lies behind has no depth along the axis.
#[test]
fn a_room_is_whole_by_photos_that_look_behind_themselves() {
    let half = DVec3::new(2.0, 1.5, 1.2);
    let all_round = Lens::new(
        DVec2::splat(320.0 / std::f64::consts::TAU),
        DVec2::new(160.0, 80.0),
        Distortion::Equirectangular,
    );
    let fisheye = Lens::new(
        DVec2::splat(60.0),
        DVec2::splat(120.0),
        Distortion::Fisheye { k: [0.0; 4] },
    );
    for (lens, width, height) in [(all_round, 320, 160), (fisheye, 240, 240)] {
        let views = [0.3, 1.7, 3.3, 4.9].map(|angle: f64| {
            let ahead = DVec3::new(angle.cos(), angle.sin(), 0.1);
            View {
                lens,
                width,
                height,
                camera_from_world: Rigid3::looking_at(ahead * 0.4, ahead * 2.0, DVec3::Z),
            }
        });
        let frames: Vec<_> = views.iter().map(|v| seen(v, room(half))).collect();
        let mesh = fused(&frames, &voxels(0.05)).unwrap().mesh;
        let mut errors: Vec<f64> = mesh
            .positions
            .iter()
            .map(|p| (half - p.abs()).min_element().abs())
            .collect();
        errors.sort_by(f64::total_cmp);
        let [median, most] = [50, 95].map(|p| errors[errors.len() * p / 100]);
        eprintln!("{width} × {height}: median {median:.6}, 95 % {most:.6}");
        assert!(median < 2e-3 && most < 0.03, "{median} {most}");
        // As much of each wall as there is.
        for k in 0..3 {
            for side in [-1.0, 1.0] {
                let is_on = |p: &&DVec3| (p[k] * side - half[k]).abs() < 0.02;
                let count = mesh.positions.iter().filter(is_on).count() as f64;
                let area = 4.0 * half[(k + 1) % 3] * half[(k + 2) % 3];
                let share = count * 0.05 * 0.05 / area;
                assert!(
                    share > 0.8,
                    "{width} × {height}: {share} of wall {k}, {side}"
                );
            }
        }
    }
}

/// What others ask for are depths along the axis, whatever the maps say.
#[test]
fn believed_depths_are_along_the_axis() {
    let lens = Lens::new(
        DVec2::splat(160.0 / std::f64::consts::TAU),
        DVec2::new(80.0, 40.0),
        Distortion::Equirectangular,
    );
    let view = View {
        lens,
        width: 160,
        height: 80,
        camera_from_world: Rigid3::looking_at(DVec3::ZERO, DVec3::X, DVec3::Z),
    };
    let half = DVec3::new(2.0, 1.5, 1.2);
    let (view, map) = seen(&view, room(half));
    let noise = DepthNoise {
        inverse_depth: 1e-3,
        depth: 1.5,
    };
    let inverse = believed(&view, &map, noise, 1.4).unwrap();
    let at = |column: usize, row: usize| f64::from(inverse[row * 160 + column]);
    // Ahead all of the wall is as deep; behind nothing is.
    for (column, row) in [(80, 40), (72, 44), (90, 36)] {
        let depth = at(column, row).recip();
        assert!((depth - half.x).abs() < 1e-4, "{column}, {row}: {depth}");
    }
    for column in [0, 20, 140] {
        assert_eq!(at(column, 40), 0.0, "{column}");
    }
}

/// A square before a wall, seen from a few places; `spoil` changes depth maps.
fn square_before_wall(spoil: impl Fn(&mut DepthMap)) -> Vec<(View, DepthMap)> {
    let views = [-0.3, 0.0, 0.3].map(|x| view(DVec3::new(x, 0.1, -2.0), DVec3::new(0.0, 0.0, 1.0)));
    let frames = views.iter().map(|v| {
        let (view, mut depth) = seen(v, nearer(square(0.0, 0.4), square(1.0, 10.0)));
        spoil(&mut depth);
        (view, depth)
    });
    frames.collect()
}

fn between(mesh: &Mesh) -> usize {
    mesh.positions
        .iter()
        .filter(|p| p.z > 0.1 && p.z < 0.9)
        .count()
}

#[test]
fn no_skin_joins_a_silhouette_to_what_is_behind() {
    let clean = fused(&square_before_wall(|_| ()), &voxels(0.03))
        .unwrap()
        .mesh;
    assert_eq!(between(&clean), 0);
    let on_square = |mesh: &Mesh| mesh.positions.iter().filter(|p| p.z.abs() < 0.02).count();
    assert!(on_square(&clean) > 500);
    // A sensor mixes the depths of pixels at edges, over two pixels.
    let mixed = fused(
        &square_before_wall(|depth| {
            let (sharp, width) = (depth.depths.clone(), depth.width as usize);
            for (i, value) in depth.depths.iter_mut().enumerate() {
                if i % width > 0 && i % width + 2 < width {
                    *value = (sharp[i - 1] + sharp[i] + sharp[i + 1]) / 3.0;
                }
            }
        }),
        &voxels(0.03),
    );
    let mixed = mixed.unwrap().mesh;
    assert_eq!(between(&mixed), 0);
    assert!(on_square(&mixed) * 10 > on_square(&clean) * 8);
}

/// Voxels lie askew: as they come its sides go in steps of one.
#[test]
fn the_border_of_a_square_is_straight() {
    let fusion = fused(&square_before_wall(|_| ()), &voxels(0.03)).unwrap();
    let sides = sides(&fusion.mesh);
    let open = sides.keys().filter(|(a, b)| !sides.contains_key(&(*b, *a)));
    let corners: BTreeSet<u32> = open.flat_map(|(a, b)| [*a, *b]).collect();
    let corners = corners.iter().map(|i| fusion.mesh.positions[*i as usize]);
    let is_right = |p: &DVec3| p.z.abs() < 0.02 && p.x > 0.25 && p.y.abs() < 0.25;
    let right: Vec<f64> = corners.filter(is_right).map(|p| p.x).collect();
    let mean = right.iter().sum::<f64>() / right.len() as f64;
    let squares = right.iter().map(|x| (x - mean).powi(2)).sum::<f64>();
    let deviation = (squares / right.len() as f64).sqrt() / 0.03;
    eprintln!(
        "border: {} corners, {mean:.4}, deviation {deviation:.3} voxels",
        right.len()
    );
    assert!(right.len() > 12 && (mean - 0.4).abs() < 0.04, "{mean}");
    assert!(deviation < 0.2, "{deviation}");
}

#[test]
fn noise_is_found_and_makes_voxels_coarser_and_errors_smaller() {
    let mut state = 7_u64;
    let mut noise = move || {
        // Twelve uniform numbers are Gaussian enough.
        let mut uniform = || {
            state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            (state >> 33) as f64 / f64::from(1_u32 << 31)
        };
        (0..12).map(|_| uniform()).sum::<f64>() - 6.0
    };
    let clean = sphere_frames();
    let mut noisy = clean.clone();
    for value in noisy.iter_mut().flat_map(|(_, d)| &mut d.depths) {
        *value *= (1.0 + 0.01 * noise()) as f32;
    }
    let found = fused(&noisy, &Options::default()).unwrap();
    // 1 % of about 2.2.
    assert!(found.noise > 0.015 && found.noise < 0.03, "{}", found.noise);
    assert!(found.voxel_size > fused(&clean, &Options::default()).unwrap().voxel_size);
    let errors = found
        .mesh
        .positions
        .iter()
        .map(|p| (p.length() - 1.0).abs());
    let mean = errors.sum::<f64>() / found.mesh.positions.len() as f64;
    eprintln!(
        "noise {:.4}, voxels {:.4}, mean error {mean:.4}",
        found.noise, found.voxel_size
    );
    assert!(mean < 0.6 * found.noise, "{mean}");
}

#[test]
fn what_went_away_is_carved_and_what_stays_is_not_moved() {
    let wall = || square(1.0, 10.0);
    let ball = || sphere(DVec3::new(0.0, 0.0, 0.2), 0.3);
    let views: Vec<View> = (0..9)
        .map(|i| view(DVec3::new(0.1 * f64::from(i) - 0.4, 0.0, -2.0), DVec3::Z))
        .collect();
    let with_ball = |v: &View| seen(v, nearer(ball(), wall()));
    let without = |v: &View| seen(v, wall());
    let before: Vec<_> = views.iter().map(with_ball).collect();
    let is_ball = |p: &&DVec3| p.z < 0.7;
    let there = fused(&before, &voxels(0.04)).unwrap().mesh;
    assert!(there.positions.iter().filter(is_ball).count() > 200);
    let mut after: Vec<_> = views.iter().map(without).collect();
    after[..2].clone_from_slice(&before[..2]);
    let gone = fused(&after, &voxels(0.04)).unwrap().mesh;
    assert_eq!(gone.positions.iter().filter(is_ball).count(), 0);
    let worst = gone
        .positions
        .iter()
        .map(|p| (p.z - 1.0).abs())
        .fold(0.0, f64::max);
    assert!(worst < 1e-3, "{worst}");
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let frames = sphere_frames();
    let options = Options {
        max_triangles: Some(2000),
        ..voxels(0.06)
    };
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| fused(&frames, &options).unwrap())
    };
    assert_eq!(with(1), with(3));
}

#[test]
fn far_from_the_origin_and_at_any_scale_it_is_the_same() {
    let frames = sphere_frames();
    let near = fused(&frames, &Options::default()).unwrap();
    for (shift, scale) in [
        (DVec3::new(5e5, 5.4e6, 300.0), 1.0),
        (DVec3::ZERO, 1e-6),
        (DVec3::ZERO, 1e6),
    ] {
        let moved: Vec<_> = frames
            .iter()
            .map(|(view, depth)| {
                let mut view = view.clone();
                let rotation = view.camera_from_world.rotation;
                let center = view.center() * scale + shift;
                view.camera_from_world = Rigid3::new(rotation, -(rotation * center));
                let mut depth = depth.clone();
                depth.depths.iter_mut().for_each(|d| *d *= scale as f32);
                (view, depth)
            })
            .collect();
        let far = fused(&moved, &Options::default()).unwrap();
        assert!((far.voxel_size / scale / near.voxel_size - 1.0).abs() < 1e-5);
        let errors = far
            .mesh
            .positions
            .iter()
            .map(|p| (((*p - shift) / scale).length() - 1.0).abs());
        let worst = errors.fold(0.0, f64::max);
        assert!(worst < 0.5 * near.voxel_size, "{worst}");
    }
}

#[test]
fn however_the_world_is_turned_it_is_the_same() {
    let frames = square_before_wall(|_| {});
    let fusion = fused(&frames, &Options::default()).unwrap();
    let turn = DQuat::from_rotation_y(0.7) * DQuat::from_rotation_x(1.1);
    let world_from_turned = Rigid3::new(turn, DVec3::new(3.0, -40.0, 5.0));
    let turned: Vec<_> = frames
        .into_iter()
        .map(|(mut view, depth)| {
            view.camera_from_world = view.camera_from_world * world_from_turned;
            (view, depth)
        })
        .collect();
    let again = fused(&turned, &Options::default()).unwrap();
    assert_eq!(again.mesh.triangles, fusion.mesh.triangles);
    let pairs = again.mesh.positions.iter().zip(&fusion.mesh.positions);
    let off = pairs.map(|(p, q)| (world_from_turned * *p).distance(*q) / fusion.voxel_size);
    let off: Vec<f64> = off.collect();
    // Whether a corner of the border would turn a triangle over may be a matter of rounding.
    let moved = off.iter().filter(|off| **off > 1e-5).count();
    let worst = off.iter().copied().fold(0.0, f64::max);
    eprintln!(
        "turned: {moved} of {} corners, at most {worst:.3} voxels",
        off.len()
    );
    assert!(1000 * moved <= off.len() && worst <= 1.0, "{moved} {worst}");
}

#[test]
fn one_frame_and_cameras_in_one_place_are_enough() {
    let frame = seen(&view(DVec3::ZERO, DVec3::X), room(DVec3::splat(2.0)));
    let one = fused(std::slice::from_ref(&frame), &Options::default()).unwrap();
    let same = fused(&[frame.clone(), frame.clone(), frame], &Options::default()).unwrap();
    for fusion in [one, same] {
        let off = fusion
            .mesh
            .positions
            .iter()
            .map(|p| (2.0 - p.abs().max_element()).abs());
        let mean = off.sum::<f64>() / fusion.mesh.positions.len() as f64;
        assert!(mean < 0.002, "{mean}");
    }
}

#[test]
fn fewer_triangles_are_nearly_the_same_surface() {
    let frames = sphere_frames();
    let options = Options {
        max_triangles: Some(1500),
        ..voxels(0.04)
    };
    let fusion = fused(&frames, &options).unwrap();
    let mesh = &fusion.mesh;
    assert!(fusion.triangles_before > 10_000);
    assert!(mesh.triangles.len() <= 1500 && mesh.triangles.len() > 1400);
    assert_eq!(open_sides(mesh), 0);
    let worst = mesh
        .positions
        .iter()
        .map(|p| (p.length() - 1.0).abs())
        .fold(0.0, f64::max);
    assert!(worst < 0.02, "{worst}");
    assert!(volume(mesh) > 4.1, "{}", volume(mesh));
}

#[test]
fn coarser_voxels_are_taken_where_memory_is_short() {
    let frames = sphere_frames();
    let short = Options {
        max_bytes: 2 << 20,
        ..Options::default()
    };
    let fusion = fused(&frames, &short).unwrap();
    assert!(fusion.bytes <= 2 << 20);
    let given = Options {
        voxel_size: Some(0.01),
        ..short
    };
    let error = fused(&frames, &given).unwrap_err();
    let DepthError::TooFine { fitting, .. } = error else {
        panic!("{error}");
    };
    assert!(
        fused(
            &frames,
            &Options {
                voxel_size: Some(fitting * 1.5),
                ..given
            }
        )
        .is_ok()
    );
}

#[test]
fn what_cannot_be_fused_is_said() {
    let error = |frames: &[(View, DepthMap)], options: &Options| {
        fused(frames, options).unwrap_err().to_string()
    };
    let good = seen(&view(DVec3::ZERO, DVec3::X), room(DVec3::splat(2.0)));
    let standard = Options::default();
    assert_eq!(
        error(&[], &standard),
        "no photo has a depth map; name their folder with --depth when importing"
    );
    let with = |value: f32| {
        let mut frame = good.clone();
        frame.1.depths.fill(value);
        frame
    };
    for nothing in [0.0, -1.0, f32::NAN, f32::INFINITY, f32::MIN_POSITIVE / 4.0] {
        let error = fused(&[with(nothing)], &standard);
        assert!(
            matches!(
                error,
                Err(DepthError::NoDepth(1) | DepthError::NoSurface(_))
            ),
            "{nothing} {error:?}"
        );
    }
    let mut small = good.clone();
    small.1.depths.pop();
    assert_eq!(
        error(&[good.clone(), small], &standard),
        "depth map 1 is 160 × 120 with 19199 values; its camera takes 160 × 120: resample the \
         depth map, or leave it out"
    );
    let mut nowhere = good.clone();
    nowhere.0.camera_from_world.translation.y = f64::NAN;
    assert_eq!(
        error(&[nowhere], &standard),
        "the camera of depth map 0 has no finite pose; leave it out"
    );
    assert_eq!(
        error(std::slice::from_ref(&good), &voxels(f64::NAN)),
        "the voxels' size is NaN; it must be positive, in world units"
    );
    let lost = fuse(1, |_| Err("no such file"), &standard).unwrap_err();
    assert_eq!(lost.to_string(), "depth map 0: no such file");
    // Far depths among near ones take no memory.
    let mut mixed = good.clone();
    mixed.1.depths[..4000].fill(1e30);
    let fusion = fused(&[mixed, good], &standard).unwrap();
    assert!(
        fusion
            .mesh
            .positions
            .iter()
            .all(|p| p.abs().max_element() < 2.5)
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]
    #[test]
    fn nonsense_is_no_panic(
        depths in prop::collection::vec(
            prop_oneof![
                4 => 0.5..3.0_f32,
                1 => prop_oneof![Just(0.0), Just(f32::NAN), Just(f32::INFINITY), Just(-1.0), Just(1e30), Just(1e-30)],
            ],
            24 * 18,
        ),
        runs in 1..200_usize,
    ) {
        let (width, height) = (24, 18);
        let mut view = view(DVec3::ZERO, DVec3::X);
        view = view.resized(width, height);
        // Runs of one depth, or nothing would be believed.
        let depths = (0..depths.len()).map(|i| depths[i / runs]).collect();
        let frame = (view, DepthMap { width, height, depths });
        if let Ok(fusion) = fused(&[frame.clone(), frame], &Options { min_piece: 1, max_bytes: 16 << 20, ..Options::default() }) {
            let corners = fusion.mesh.positions.len() as u32;
            prop_assert!(fusion.mesh.positions.iter().all(|p| p.is_finite()));
            prop_assert!(fusion.mesh.triangles.as_flattened().iter().all(|i| *i < corners));
        }
    }
}

#[test]
fn a_walk_through_a_house_is_met_by_depth_maps_held_out() {
    let Some(folder) = common::find_capture("house-walk") else {
        return;
    };
    let capture = common::capture(&folder);
    let used = &capture.used;
    let fusion = fuse(used.len(), |i| common::decode(&used[i]), &voxels(0.04)).unwrap();
    let errors = common::errors(&fusion.mesh, &capture.held_out, 0.05);
    eprintln!("{errors:?}");
    assert!(
        errors.median < 0.001 && errors.percentile_95 < 0.03,
        "{errors:?}"
    );
    // The depth maps used show 95 % of those held out.
    assert!(
        errors.complete > 0.88 && errors.in_front < 0.005,
        "{errors:?}"
    );
}
