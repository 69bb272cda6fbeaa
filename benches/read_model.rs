//! Time to read a large COLMAP model: `cargo bench -p calibrate --bench read_model`; see
//! README.md.

use calibrate::colmap;
use calibrate::{
    Camera, CameraId, Image, ImageId, Keypoint, ModelKind, Point3D, Point3DId, Reconstruction,
    Rigid3,
};
use cpu_time::ProcessTime;
use glam::{DQuat, DVec3};
use std::hint::black_box;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

const IMAGES: u32 = 10_000;
const POINTS: u64 = 2_000_000;
/// Images that see a point.
const TRACK: u64 = 5;
/// Keypoints of an image that are of no point.
const UNMATCHED: usize = 200;
/// Interleaved repeats, of which the median counts.
const REPEATS: usize = 5;

/// Reads a model given as argument again and again, timing pycolmap alone.
const PYTHON: &str = "
import sys, time, pycolmap
for _ in range(int(sys.argv[2])):
    start = time.process_time()
    model = pycolmap.Reconstruction(sys.argv[1])
    print((time.process_time() - start) * 1e3)
";

fn main() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path();
    colmap::write_binary(&synthetic(), path).expect("the temporary folder takes the model");
    let size: u64 = files(path)
        .iter()
        .map(|file| std::fs::metadata(file).expect("written").len())
        .sum();
    println!(
        "{IMAGES} images, {POINTS} points, {} observations, {} MB; CPU ms, median of {REPEATS}\n",
        POINTS * TRACK,
        size / 1_000_000
    );

    let (mut bytes_ms, mut ours_ms) = (Vec::new(), Vec::new());
    for _ in 0..REPEATS {
        let model = timed(&mut ours_ms, || {
            colmap::read_model(path).expect("just written")
        });
        timed(&mut bytes_ms, || bytes_and_room(path, &model));
    }
    let floor = median(bytes_ms);
    let line = |name: &str, ms: f64| println!("{name:40}{ms:8.0}{:8.2} ×", ms / floor);
    line("the bytes read, the result allocated", floor);
    line("read_model", median(ours_ms));
    match with_pycolmap(path) {
        Ok(ms) => line("pycolmap", ms),
        Err(reason) => println!("pycolmap: {reason}; PYTHON may name a python that has it"),
    }
}

/// The least that reading takes: every file's bytes, and what [`colmap::read_model`]
/// returns with the same vectors and maps, but zeros in place of what the bytes say.
fn bytes_and_room(path: &Path, model: &Reconstruction) -> Reconstruction {
    for file in files(path) {
        black_box(std::fs::read(file).expect("just written"));
    }
    let no_keypoint = Keypoint {
        x: 0.0,
        y: 0.0,
        point: None,
    };
    let image = |image: &Image| Image {
        name: "0".repeat(image.name.len()),
        camera_id: CameraId(0),
        camera_from_world: Rigid3::IDENTITY,
        keypoints: vec![no_keypoint; image.keypoints.len()],
    };
    let point = |point: &Point3D| Point3D {
        position: DVec3::ZERO,
        color: [0; 3],
        error_px: 0.0,
        track: vec![(ImageId(0), 0); point.track.len()],
    };
    Reconstruction {
        cameras: model.cameras.clone(),
        images: model.images.iter().map(|(&id, i)| (id, image(i))).collect(),
        points: model.points.iter().map(|(&id, p)| (id, point(p))).collect(),
    }
}

fn files(path: &Path) -> [std::path::PathBuf; 3] {
    ["cameras.bin", "images.bin", "points3D.bin"].map(|name| path.join(name))
}

/// Runs `work` and drops what it makes outside the time that is noted.
fn timed<T>(noted_ms: &mut Vec<f64>, work: impl FnOnce() -> T) -> T {
    let start = ProcessTime::now();
    let made = black_box(work());
    noted_ms.push(milliseconds(start.elapsed()));
    made
}

fn milliseconds(duration: Duration) -> f64 {
    duration.as_secs_f64() * 1e3
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// COLMAP's own reader, where the environment's `PYTHON` (else `python3`) has it.
fn with_pycolmap(path: &Path) -> Result<f64, String> {
    let python = std::env::var("PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let ran = Command::new(python)
        .args(["-c", PYTHON])
        .arg(path)
        .arg(REPEATS.to_string())
        .output()
        .map_err(|error| error.to_string())?;
    let text = String::from_utf8_lossy(&ran.stdout);
    let times: Vec<f64> = text.lines().filter_map(|line| line.parse().ok()).collect();
    if times.len() != REPEATS {
        let error = String::from_utf8_lossy(&ran.stderr);
        return Err(error.lines().last().unwrap_or("no times").to_owned());
    }
    Ok(median(times))
}

/// A walk along a wall: each point is seen by images that follow each other.
fn synthetic() -> Reconstruction {
    let camera = Camera {
        model: ModelKind::SimpleRadial,
        width: 4000,
        height: 3000,
        params: vec![3000.0, 2000.0, 1500.0, -0.05],
    };
    let mut images: Vec<Image> = (0..IMAGES)
        .map(|i| Image {
            name: format!("day/{i:05}.jpg"),
            camera_id: CameraId(1),
            camera_from_world: Rigid3::new(
                DQuat::from_rotation_y(1e-4 * f64::from(i)),
                DVec3::new(-0.1 * f64::from(i), 0.0, 0.0),
            ),
            keypoints: Vec::new(),
        })
        .collect();
    let mut points = Vec::new();
    for id in 0..POINTS {
        let first = id * u64::from(IMAGES) / POINTS;
        let mut track = Vec::new();
        for i in (first..first + TRACK).map(|i| (i % u64::from(IMAGES)) as u32) {
            let keypoints = &mut images[i as usize].keypoints;
            track.push((ImageId(i + 1), keypoints.len() as u32));
            let point = Some(Point3DId(id + 1));
            keypoints.push(Keypoint {
                x: 0.5 + (id % 4000) as f64,
                y: f64::from(i % 3000),
                point,
            });
        }
        let point = Point3D {
            position: DVec3::new(first as f64 * 0.1, (id % 7) as f64, 5.0),
            color: [10, 20, 30],
            error_px: 0.5,
            track,
        };
        points.push((Point3DId(id + 1), point));
    }
    for image in &mut images {
        let unmatched = |i| Keypoint {
            x: i as f64,
            y: 7.25,
            point: None,
        };
        image.keypoints.extend((0..UNMATCHED).map(unmatched));
    }
    Reconstruction {
        cameras: [(CameraId(1), camera)].into(),
        images: (1..).map(ImageId).zip(images).collect(),
        points: points.into_iter().collect(),
    }
}
