//! Time and fit of visual hulls: `cargo bench -p proxy --bench hull`; see benches/README.md.

use calibrate::View;
use cpu_time::ProcessTime;
use proxy::hull::{Options, Silhouette, carve, turntable};
use std::time::Instant;

const PHOTOS: usize = 40;
/// Repeats, of which the median counts.
const REPEATS: usize = 5;

fn main() {
    let scene = datasets::Options {
        size: Some((640, 480)),
        views: Some(PHOTOS),
        samples_per_side: Some(1),
    };
    let car = datasets::by_name("car", &scene).expect("the car is built in");
    let views: Vec<View> = car.photos.iter().map(|p| p.view.clone()).collect();
    let silhouettes: Vec<Silhouette> = views
        .iter()
        .map(|view| {
            let depth = datasets::render_depth(&car.scene, view);
            let inside = depth.iter().map(|z| z.is_finite()).collect();
            Silhouette::new(view.width, view.height, inside).expect("a depth a pixel")
        })
        .collect();
    println!("{PHOTOS} masks of 640 × 480; median of {REPEATS}\n");
    println!(
        "{:28}{:>10}{:>10}{:>8}{:>11}{:>8}",
        "", "CPU ms", "wall ms", "faces", "coverage", "IoU"
    );
    for (name, faces) in [("as carved", None), ("500 faces", Some(500))] {
        let options = Options {
            faces,
            ..Options::default()
        };
        let hull = carve(&views, &silhouettes, &options).expect("the car has a hull");
        let (cpu, wall) = timed(|| drop(carve(&views, &silhouettes, &options)));
        let m = hull.measures;
        println!(
            "{name:28}{cpu:>10.0}{wall:>10.0}{:>8}{:>11.5}{:>8.4}",
            m.faces, m.coverage, m.iou
        );
    }
    let step_degrees = 360.0 / PHOTOS as f64;
    let (cpu, wall) = timed(|| drop(turntable(&silhouettes, step_degrees)));
    println!("{:28}{cpu:>10.0}{wall:>10.0}", "turntable");
}

/// CPU and wall time in milliseconds.
fn timed(work: impl Fn()) -> (f64, f64) {
    let mut times: Vec<(f64, f64)> = (0..REPEATS)
        .map(|_| {
            let (cpu, wall) = (ProcessTime::now(), Instant::now());
            work();
            (
                cpu.elapsed().as_secs_f64() * 1e3,
                wall.elapsed().as_secs_f64() * 1e3,
            )
        })
        .collect();
    times.sort_by(|a, b| a.0.total_cmp(&b.0));
    times[REPEATS / 2]
}
