//! Of scans.

use super::*;
use crate::{Mesh, MeshKind};
use calibrate::{Distortion, Lens, Pixel, Rigid3};
use glam::{DQuat, DVec2};
use proptest::prelude::*;

/// Triangles of any size around the origin, some of them neighbours.
fn mesh(corners: &[[f64; 3]]) -> Mesh {
    let mut mesh = Mesh {
        positions: corners.iter().map(|&p| DVec3::from_array(p)).collect(),
        triangles: Vec::new(),
    };
    let count = corners.len() as u32;
    for i in 0..count.saturating_sub(2) {
        mesh.triangles.push([i, i + 1, i + 2]);
        mesh.triangles.push([i, (i * 7 + 3) % count, i + 2]);
    }
    mesh
}

/// Boxes, each with its own corners.
pub(super) fn boxes(of: &[(DVec3, DVec3)]) -> Mesh {
    let mut mesh = Mesh::default();
    for &(least, most) in of {
        let first = mesh.positions.len() as u32;
        mesh.positions.extend((0..8).map(|i: u32| {
            let pick = |bit: u32, axis: usize| {
                if i >> bit & 1 == 1 {
                    most[axis]
                } else {
                    least[axis]
                }
            };
            DVec3::new(pick(0, 0), pick(1, 1), pick(2, 2))
        }));
        let faces = [
            [0, 2, 3, 1],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 4, 6, 2],
            [1, 3, 7, 5],
        ];
        for [a, b, c, d] in faces.map(|face| face.map(|i: u32| first + i)) {
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh
}

/// Compares a scan with a ray for each pixel. How many pixels see something.
fn compare(solid: &Solid, view: &View, reduction: u32) -> usize {
    let Some(scan) = solid.scan(view, reduction) else {
        assert_ne!(view.lens.distortion(), Distortion::None);
        return 0;
    };
    // Without depths, which need not be compared everywhere, it is the same.
    let rays = Rays::reduced(view, reduction).unwrap();
    let mut alone = vec![7; scan.triangle_of.len()];
    solid.triangles_along(view, &rays, &mut alone);
    assert_eq!(alone, scan.triangle_of);
    let world_from_camera = view.camera_from_world.rotation.conjugate();
    let mut seen = 0;
    for (i, (&id, &s)) in scan.triangle_of.iter().zip(&scan.inverse_depth).enumerate() {
        let at = |i: usize| (i as f64 + 0.5) * f64::from(reduction);
        let pixel = Pixel::new(at(i % scan.width), at(i / scan.width));
        let Some(ray) = view.lens.unproject(pixel) else {
            assert_eq!(id, Scan::NOTHING);
            continue;
        };
        let hit = solid.first_hit(view.center(), world_from_camera * (ray / ray.z));
        let place = (i % scan.width, i / scan.width);
        match hit {
            None => assert_eq!(id, Scan::NOTHING, "{place:?}"),
            Some(hit) => {
                assert_ne!(id, Scan::NOTHING, "{place:?}");
                let off = (s * hit.along - 1.0).abs();
                assert!(off < 1e-6, "{place:?}: {off:e}");
                assert!(id == hit.triangle_idx || off < 1e-9, "{place:?}");
                seen += 1;
            }
        }
    }
    assert!(scan.inverse_depth.iter().all(|s| s.is_finite()));
    seen
}

fn view(center: DVec3, turn: DQuat, (width, height): (u32, u32), focal: f64) -> View {
    View {
        lens: Lens::pinhole(
            DVec2::new(focal, 1.1 * focal),
            DVec2::new(0.45 * f64::from(width), 0.6 * f64::from(height)),
        ),
        width,
        height,
        camera_from_world: Rigid3 {
            rotation: turn,
            translation: -(turn * center),
        },
    }
}

proptest! {
    #[test]
    fn a_scan_is_a_ray_for_every_pixel(
        corners in proptest::collection::vec(prop::array::uniform3(-2.0..2.0), 3..20),
        center in prop::array::uniform3(-2.5..2.5),
        turn in prop::array::uniform3(-3.0..3.0),
        focal in 5.0..80.0,
        reduction in 1_u32..4,
        shift in prop_oneof![Just(0.0), Just(1e5)],
        carved: bool,
        k1 in prop_oneof![Just(0.0), -0.2..0.2],
    ) {
        let shift = DVec3::new(shift, -shift, shift);
        let mut mesh = mesh(&corners);
        mesh.positions.iter_mut().for_each(|p| *p += shift);
        let kind = if carved { MeshKind::Carved } else { MeshKind::Mesh };
        let solid = Solid::new(kind, mesh);
        let turn = DQuat::from_scaled_axis(DVec3::from_array(turn));
        let mut view = view(DVec3::from_array(center) + shift, turn, (37, 35), focal);
        let bent = Distortion::Rational { k: [k1, 0.0, 0.0, 0.0, 0.0, 0.0], p: [0.0; 2] };
        view.lens = Lens::new(view.lens.focal, view.lens.principal, bent);
        compare(&solid, &view, reduction);
    }
}

/// Pixels' centres on sides and corners, triangles that share them, and a view inside.
#[test]
fn neighbours_leave_no_gap() {
    let at = |i: u32| f64::from(i) - 4.0;
    let grid = |z: f64| -> Vec<DVec3> {
        (0..81)
            .map(|i| DVec3::new(at(i % 9), at(i / 9), z))
            .collect()
    };
    let cell = |i: u32| {
        let a = i / 8 * 9 + i % 8;
        [[a, a + 1, a + 10], [a, a + 10, a + 9]]
    };
    let mesh = Mesh {
        positions: grid(4.0),
        triangles: (0..64).flat_map(cell).collect(),
    };
    let solid = Solid::new(MeshKind::Mesh, mesh);
    // A cell is 16 pixels, its corners are pixels' centres.
    let mut view = view(DVec3::ZERO, DQuat::IDENTITY, (96, 96), 64.0);
    view.lens = Lens::pinhole(DVec2::splat(64.0), DVec2::splat(48.5));
    assert_eq!(compare(&solid, &view, 1), 96 * 96);
    assert_eq!(compare(&solid, &view, 2), 48 * 48);
    // As if the lens bent.
    let bent = Distortion::Rational {
        k: [1e-30, 0.0, 0.0, 0.0, 0.0, 0.0],
        p: [0.0; 2],
    };
    view.lens = Lens::new(view.lens.focal, view.lens.principal, bent);
    assert_eq!(compare(&solid, &view, 1), 96 * 96);
}

/// Small boxes all around.
#[test]
fn what_is_out_of_sight_is_passed_over() {
    let around = |i: u32| {
        let (sin, cos) = (2.4 * f64::from(i)).sin_cos();
        let y = f64::from(i) / 200.0 - 1.0;
        let level = (1.0 - y * y).sqrt();
        let center = 5.0 * DVec3::new(level * sin, y, level * cos);
        (center - 0.2, center + 0.2)
    };
    let all: Vec<(DVec3, DVec3)> = (0..400).map(around).collect();
    let mesh = boxes(&all);
    let count = mesh.triangles.len();
    let solid = Solid::new(MeshKind::Mesh, mesh);
    for k1 in [0.0, -0.05] {
        for turn in [0.0, 1.3, 3.1] {
            let turn = DQuat::from_scaled_axis(DVec3::new(0.3, turn, -0.2));
            let mut view = view(DVec3::new(0.2, -0.1, 0.3), turn, (64, 48), 50.0);
            let bent = Distortion::Rational {
                k: [k1, 0.0, 0.0, 0.0, 0.0, 0.0],
                p: [0.0; 2],
            };
            view.lens = Lens::new(view.lens.focal, view.lens.principal, bent);
            assert!(compare(&solid, &view, 1) > 200);
            let rays = Rays::reduced(&view, 1).unwrap();
            let plane_from_world =
                rays.plane_from_camera() * DMat3::from_quat(view.camera_from_world.rotation);
            let sight = rays.sight(view.center(), plane_from_world);
            let tried: usize = solid.in_sight(&sight).iter().map(Range::len).sum();
            assert!(tried > 0 && tried < count / 4, "{tried} of {count}");
        }
    }
}

/// Two boxes, one before the other: as a hull, whose back sides do not count, and as any mesh.
#[test]
fn from_outside_a_closed_surface_back_sides_change_nothing() {
    let [low, high] = [DVec3::new(-1.0, -0.7, 0.0), DVec3::new(1.0, 1.1, 1.0)];
    let mesh = boxes(&[2.0, 5.0].map(|z| (low + z * DVec3::Z, high + z * DVec3::Z)));
    let [hull, any] = [MeshKind::Hull, MeshKind::Mesh].map(|kind| Solid::new(kind, mesh.clone()));
    for (center, turn) in [
        (DVec3::ZERO, 0.0),
        (DVec3::new(4.0, 0.4, 2.5), 1.4),
        (DVec3::new(-0.3, 0.2, 4.0), 0.1),
    ] {
        let view = view(center, DQuat::from_rotation_y(turn), (96, 64), 40.0);
        let scan = hull.scan(&view, 1).unwrap();
        assert_eq!(scan, any.scan(&view, 1).unwrap());
        let seen = compare(&hull, &view, 1);
        assert!(seen > 500, "{seen}");
    }
    let within = view(DVec3::new(0.1, 0.2, 2.4), DQuat::IDENTITY, (8, 6), 40.0);
    let first = hull.scan(&within, 1).unwrap().triangle_of[0];
    assert!(first >= 12 && first != Scan::NOTHING, "{first}");
}

#[test]
fn nothing_is_seen_of_nothing() {
    let empty = Solid::new(MeshKind::Mesh, Mesh::default());
    let view = view(DVec3::ZERO, DQuat::IDENTITY, (20, 10), 10.0);
    let scan = empty.scan(&view, 1).unwrap();
    assert!(scan.triangle_of.iter().all(|&id| id == Scan::NOTHING));
    let positions = vec![DVec3::new(f64::NAN, 0.0, 1.0), DVec3::X, DVec3::Z];
    let triangles = vec![[0, 1, 2], [1, 1, 2]];
    let odd = Solid::new(
        MeshKind::Mesh,
        Mesh {
            positions,
            triangles,
        },
    );
    assert_eq!(odd.scan(&view, 1).unwrap(), scan);
}
