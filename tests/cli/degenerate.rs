//! Scenes that tell little about themselves: every kind of surface makes do or says why not.

use crate::run::lumigraph;
use glam::DVec3;
use image::{Rgb, RgbImage};
use proxy::Proxy;
use std::fmt::Write;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

const KINDS: [&str; 11] = [
    "plane",
    "dominant-plane",
    "view-plane",
    "points",
    "tunnel",
    "carved",
    "hull",
    "depth",
    "dense",
    "carved-dense",
    "auto",
];
const SIZE: (u32, u32) = (48, 36);
const FOCAL: f64 = 40.0;

/// Repeatable numbers in −1…1.
fn noise(i: usize, salt: u32) -> f64 {
    let mut h = (i as u32).wrapping_mul(0x9E37_79B1) ^ salt.wrapping_mul(0x85EB_CA77);
    h = (h ^ (h >> 15)).wrapping_mul(0x2C1B_3C6D);
    h = (h ^ (h >> 12)).wrapping_mul(0x297A_2D39);
    f64::from(h >> 8) / f64::from(1 << 23) - 1.0
}

/// Points in the room before the cameras, from 4 to 6 away.
fn ordinary(count: usize) -> Vec<DVec3> {
    let point = |i| DVec3::new(2.0 * noise(i, 1), 1.5 * noise(i, 2), 5.0 + noise(i, 3));
    (0..count).map(point).collect()
}

/// Cameras side by side that look along z.
fn in_a_row(count: usize) -> Vec<DVec3> {
    (0..count)
        .map(|i| DVec3::new(0.3 * i as f64 - 0.9, 0.05 * noise(i, 4), 0.0))
        .collect()
}

/// A capture `c` of photos by cameras at the given places, each of which sees all points.
fn capture(cameras: &[DVec3], points: &[DVec3]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let images = folder.path().join("c/images");
    let model = folder.path().join("c/sparse/0");
    fs::create_dir_all(&images).unwrap();
    fs::create_dir_all(&model).unwrap();
    let (width, height) = SIZE;
    let (middle_x, middle_y) = (f64::from(width) / 2.0, f64::from(height) / 2.0);
    let mut text = String::new();
    for (i, center) in cameras.iter().enumerate() {
        let photo = RgbImage::from_fn(width, height, |x, y| {
            let value =
                |salt| (128.0 + 100.0 * noise((y * width + x + 7 * i as u32) as usize, salt)) as u8;
            Rgb([value(5), value(6), value(7)])
        });
        photo.save(images.join(format!("{i}.png"))).unwrap();
        let id = i + 1;
        let [x, y, z] = (-*center).to_array();
        writeln!(text, "{id} 1 0 0 0 {x:e} {y:e} {z:e} 1 {i}.png").unwrap();
        for (k, point) in points.iter().enumerate() {
            let seen = *point - *center;
            let [x, y] = [seen.x, seen.y].map(|v| (FOCAL * v / seen.z).clamp(-1e3, 1e3));
            let [x, y] = [x, y].map(|v| if v.is_finite() { v } else { 0.0 });
            write!(text, "{} {} {} ", middle_x + x, middle_y + y, k + 1).unwrap();
        }
        text += "\n";
    }
    fs::write(model.join("images.txt"), text).unwrap();
    let camera = format!("1 SIMPLE_PINHOLE {width} {height} {FOCAL} {middle_x} {middle_y}\n");
    fs::write(model.join("cameras.txt"), camera).unwrap();
    let mut text = String::new();
    for (k, point) in points.iter().enumerate() {
        let [x, y, z] = point.to_array();
        write!(text, "{} {x:e} {y:e} {z:e} 90 90 90 0.5", k + 1).unwrap();
        for i in 0..cameras.len() {
            write!(text, " {} {k}", i + 1).unwrap();
        }
        text += "\n";
    }
    fs::write(model.join("points3D.txt"), text).unwrap();
    folder
}

/// Whether all numbers of a proxy's file are finite.
fn is_finite(file: &Path) -> bool {
    match proxy::read(file).unwrap() {
        Proxy::Plane(plane) => plane.point().is_finite() && plane.normal().is_finite(),
        Proxy::Mesh(solid) => solid.mesh().positions.iter().all(|v| v.is_finite()),
        Proxy::Dense(dense) => dense.points.iter().all(|p| p.position.is_finite()),
        Proxy::ViewPlane | Proxy::Points { .. } => true,
    }
}

/// Tries every kind: a surface to draw with, or one clear error. Returns the kinds that have
/// none.
fn without_surface(cameras: &[DVec3], points: &[DVec3]) -> Vec<&'static str> {
    let folder = capture(cameras, points);
    lumigraph(folder.path(), "import c -o scene").ok();
    let mut none = Vec::new();
    for kind in KINDS {
        let ran = lumigraph(folder.path(), &format!("proxy scene {kind}"));
        if ran.code != 0 {
            let error = ran.error(1);
            println!("{kind}: {error}");
            // It says what to do, and no more than can be read.
            let remedy = ["try", "give", "name"]
                .iter()
                .any(|word| error.contains(word));
            assert!(remedy && error.len() < 400, "{kind}: {error}");
            none.push(kind);
            continue;
        }
        let (file, text) = ran.stdout.split_once(": ").unwrap();
        assert!(
            !text.contains("NaN") && !text.contains("inf"),
            "{kind}: {text}"
        );
        assert!(is_finite(&folder.path().join(file)), "{kind}");
        let line = format!("evaluate scene --every 3 --proxy {kind} --json");
        let ran = lumigraph(folder.path(), &line);
        if ran.code != 0 {
            // Fewer photos may be too few.
            println!("{kind}, held out: {}", ran.error(1));
            continue;
        }
        let mean = ran.json()["mean"].clone();
        for key in ["psnr", "psnr_exposed", "ssim"] {
            assert!(mean[key].is_f64(), "{kind}: {mean}");
        }
        let coverage = mean["coverage"].as_f64().unwrap();
        assert!((0.0..=1.0).contains(&coverage), "{kind}: {mean}");
    }
    none
}

/// Every capture has neither mattes nor depth maps.
#[track_caller]
fn only_these_fail(cameras: &[DVec3], points: &[DVec3], expected: &[&str]) {
    let mut expected = [expected, &["hull", "depth"]].concat();
    expected.sort_unstable();
    let mut found = without_surface(cameras, points);
    found.sort_unstable();
    assert_eq!(found, expected);
}

#[test]
fn points_on_a_line() {
    let line = |i: usize| DVec3::new(0.0, 0.0, 4.0) + 0.05 * i as f64 * DVec3::new(1.0, 0.3, 0.4);
    let points: Vec<DVec3> = (0..40).map(line).collect();
    only_these_fail(&in_a_row(7), &points, &["dominant-plane"]);
}

#[test]
fn points_in_a_plane() {
    let points: Vec<DVec3> = ordinary(60).iter().map(|p| p.with_z(5.0)).collect();
    only_these_fail(&in_a_row(7), &points, &[]);
}

#[test]
fn five_points_and_fewer() {
    only_these_fail(&in_a_row(7), &ordinary(5), &["dominant-plane", "tunnel"]);
    only_these_fail(&in_a_row(7), &ordinary(1), &["dominant-plane", "tunnel"]);
    let of_points = ["dominant-plane", "view-plane", "points", "tunnel", "carved"];
    // Nor do the cameras' axes meet; but photos can be compared.
    let all = [&of_points[..], &["plane"]].concat();
    only_these_fail(&in_a_row(7), &[], &all);
}

#[test]
fn points_at_one_place() {
    let points = vec![DVec3::new(0.1, 0.2, 5.0); 30];
    only_these_fail(&in_a_row(7), &points, &["dominant-plane"]);
}

#[test]
fn points_at_infinity() {
    for far in [1e9, 1e30, 1e300] {
        let points: Vec<DVec3> = ordinary(40).iter().map(|p| far * *p).collect();
        println!("{far:e}");
        // Squares of the last overflow.
        let fail: &[&str] = if far > 1e150 {
            &["dominant-plane", "tunnel"]
        } else {
            &[]
        };
        only_these_fail(&in_a_row(7), &points, fail);
    }
}

#[test]
fn outliers_far_away() {
    for far in [1e9, 1e300] {
        let mut points = ordinary(60);
        for (i, point) in points.iter_mut().enumerate().step_by(20) {
            *point *= if i % 40 == 0 { far } else { -far };
        }
        println!("{far:e}");
        only_these_fail(&in_a_row(7), &points, &["dominant-plane"]);
    }
}

#[test]
fn sizes_that_nothing_is_drawn_in_are_told() {
    for scale in [1e39, 1e-40] {
        let scaled = |places: Vec<DVec3>| -> Vec<DVec3> {
            places.into_iter().map(|place| scale * place).collect()
        };
        let folder = capture(&scaled(in_a_row(5)), &scaled(ordinary(60)));
        let ran = lumigraph(folder.path(), "evaluate c --proxy carved --every 3");
        if ran.code != 0 {
            println!("{scale:e}: {}", ran.error(1));
        }
        let said = "pictures are drawn in 32 bits, which hold 1e-30 to 1e30; scale the calibration";
        assert!(ran.stderr.contains(said), "{}", ran.stderr);
    }
}

#[test]
fn points_behind_the_cameras() {
    let points: Vec<DVec3> = ordinary(40).iter().map(|p| -*p).collect();
    only_these_fail(&in_a_row(7), &points, &["plane", "carved", "carved-dense"]);
}

#[test]
fn two_photos() {
    only_these_fail(&in_a_row(2), &ordinary(60), &["dominant-plane"]);
}

#[test]
fn cameras_at_one_place() {
    let cameras = vec![DVec3::new(0.1, 0.0, 0.2); 7];
    only_these_fail(&cameras, &ordinary(60), &["dominant-plane"]);
    // Nothing tells how far away things are, and it is no matter: a plane before them and a dome around them show all.
    let compared = ["dense", "carved-dense"];
    let of_points = ["dominant-plane", "view-plane", "points", "tunnel"];
    only_these_fail(&cameras, &[], &[&of_points[..], &compared].concat());
    let folder = capture(&cameras, &[]);
    let line = "render c --path orbit --frames 2 --size 24x18 -o out --json";
    let ran = lumigraph(folder.path(), line).ok();
    assert_eq!(ran.json()["report"]["frames_empty"], 0);
    assert!(
        ran.stderr.contains(": the path stands still\n"),
        "{}",
        ran.stderr
    );
}

#[test]
fn paths_of_one_place_stand_still_and_that_is_said() {
    let said = |cameras: &[DVec3]| {
        let folder = capture(cameras, &ordinary(60));
        ["orbit", "dolly", "sweep"].map(|kind| {
            let line = format!("render c --proxy view-plane --path {kind} --frames 2 -o {kind}");
            let ran = lumigraph(folder.path(), &line).ok();
            ran.stderr.contains(": the path stands still\n")
        })
    };
    assert_eq!(said(&[DVec3::new(0.1, 0.0, 0.2); 7]), [true; 3]);
    assert_eq!(said(&in_a_row(7)), [false; 3]);
}

#[test]
fn points_in_the_cameras() {
    let cameras = in_a_row(7);
    only_these_fail(
        &cameras,
        &cameras,
        &["plane", "tunnel", "carved", "carved-dense"],
    );
}
