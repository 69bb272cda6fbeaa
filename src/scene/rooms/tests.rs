use super::*;
use calibrate::{Distortion, Lens, Rigid3};
use glam::{DQuat, DVec2};
use image::{Rgba, RgbaImage};
use proxy::MeshKind;
use std::f64::consts::FRAC_PI_2;

/// A room of 4 × 3 × 5 around the origin, its walls in squares, wound as seen from within.
fn room() -> Mesh {
    const SQUARES: u32 = 8;
    let mut mesh = Mesh::default();
    for (axis, side) in [0, 1, 2].into_iter().flat_map(|a| [(a, -1.0), (a, 1.0)]) {
        let first = mesh.positions.len() as u32;
        for i in 0..=SQUARES {
            for j in 0..=SQUARES {
                let across = |k: u32| 2.0 * f64::from(k) / f64::from(SQUARES) - 1.0;
                let mut at = [0.0; 3];
                at[axis] = side;
                at[(axis + 1) % 3] = across(i);
                at[(axis + 2) % 3] = across(j);
                let half = DVec3::new(2.0, 1.5, 2.5);
                mesh.positions.push(half * DVec3::from_array(at));
            }
        }
        for i in 0..SQUARES {
            for j in 0..SQUARES {
                let at = |i: u32, j: u32| first + i * (SQUARES + 1) + j;
                let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
                let mut two = [[a, b, c], [a, c, d]];
                if side > 0.0 {
                    two.iter_mut().for_each(|t| t.swap(1, 2));
                }
                mesh.triangles.extend(two);
            }
        }
    }
    mesh
}

fn seen_by(lens: Lens, (width, height): (u32, u32)) -> View {
    View {
        lens,
        width,
        height,
        camera_from_world: Rigid3::looking_at(
            DVec3::new(0.3, -0.2, 0.1),
            DVec3::new(1.0, 0.5, 2.0),
            DVec3::Y,
        ),
    }
}

const COLOR: [u8; 4] = [10, 200, 30, 255];

#[test]
fn lenses_that_look_aside_and_behind_see_the_room_around_them() {
    let solid = Solid::new(MeshKind::Mesh, room());
    // 190° across, and all round.
    let fisheye = Distortion::Fisheye { k: [0.0; 4] };
    let fisheye = Lens::new(DVec2::splat(116.0), DVec2::splat(192.0), fisheye);
    let all_round = Lens::new(
        DVec2::splat(384.0 / std::f64::consts::TAU),
        DVec2::new(192.0, 96.0),
        Distortion::Equirectangular,
    );
    for (lens, size, least) in [(fisheye, (384, 384), 0.8), (all_round, (384, 192), 1.0)] {
        let view = seen_by(lens, size);
        assert!(solid.scan(&view, 1).is_none());
        // 1. What is seen lies on the walls, before and behind the camera.
        let map = depth_of(&solid, &view);
        let world_from_camera = view.camera_from_world.inverse();
        let mut behind = 0;
        for (i, depth) in map.depths.iter().enumerate().filter(|(_, d)| **d != 0.0) {
            let pixel = Pixel::center_of(i as u32 % size.0, i as u32 / size.0);
            let ray = view.lens.unproject(pixel).unwrap();
            let point = world_from_camera * (ray * f64::from(*depth));
            let off = (point.abs() / DVec3::new(2.0, 1.5, 2.5)).max_element() - 1.0;
            assert!(off.abs() < 1e-4, "{point} in pixel {i}");
            behind += usize::from(ray.z < 0.0);
        }
        assert!(behind > 0);
        let lines = sights(&view, &map, 4);
        let forward = view.forward();
        let looks_back = |[from, to]: &[DVec3; 2]| forward.dot(*to - *from) < 0.0;
        assert!(lines.iter().any(looks_back) && !lines.iter().all(looks_back));
        // 2. A photo colours each wall that its lens sees.
        let mut painting = Painting::new(solid.mesh(), 0.0, false);
        let photo = RgbaImage::from_pixel(size.0, size.1, Rgba(COLOR));
        painting.add(&view, &photo, &map);
        let colors = painting.colors();
        let painted = colors.iter().filter(|c| **c == COLOR).count();
        let share = painted as f64 / colors.len() as f64;
        assert!(share >= least, "{share}");
    }
}

#[test]
fn up_is_what_is_up_where_photos_are_shown() {
    let pinhole = Lens::pinhole(DVec2::splat(40.0), DVec2::new(48.0, 36.0));
    let upright = seen_by(pinhole, (96, 72));
    for quarters in 0..4 {
        // Stored as it is before it is turned.
        let mut stored = upright.clone();
        let back = DQuat::from_rotation_z(-FRAC_PI_2 * f64::from(quarters));
        stored.camera_from_world.rotation = back * upright.camera_from_world.rotation;
        let off = up_as_shown(&stored, quarters).distance(upright.up());
        assert!(off < 1e-12, "{quarters}: {off}");
    }
}

#[test]
fn rays_find_the_depths_that_a_scan_does() {
    let solid = Solid::new(MeshKind::Mesh, room());
    let pinhole = Lens::pinhole(DVec2::splat(40.0), DVec2::new(48.0, 36.0));
    let view = seen_by(pinhole, (96, 72));
    let map = depth_of(&solid, &view);
    let by_rays = depths_by_rays(&solid, &view, DepthAlong::Axis);
    for (a, b) in map.depths.iter().zip(&by_rays) {
        assert!(*a > 0.0 && (a / b - 1.0).abs() < 1e-5, "{a} {b}");
    }
}
