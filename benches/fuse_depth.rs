//! Depth maps fused into a surface: time, memory and error against depth maps held out.

#[path = "../proxy/tests/surfaces/common/mod.rs"]
mod common;

use common::{capture, decode, errors, find_capture, shown};
use cpu_time::ProcessTime;
use proxy::depth::{Options, fuse};
use std::path::PathBuf;
use std::time::Instant;

fn main() {
    let given: Vec<PathBuf> = std::env::args()
        .skip(1)
        .filter(|a| !a.starts_with("--"))
        .map(PathBuf::from)
        .collect();
    let folders = match given.is_empty() {
        true => find_capture("house-walk").into_iter().collect(),
        false => given,
    };
    println!(
        "{:16} {:>8} {:>9} {:>8} {:>7} {:>7} {:>7} | {:>8} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8}",
        "capture",
        "voxel",
        "triangles",
        "of",
        "wall s",
        "CPU s",
        "MB",
        "mean",
        "of near",
        "median",
        "95 %",
        "complete",
        "in front",
        "missing"
    );
    for folder in folders {
        let capture = capture(&folder);
        println!(
            "the depth maps used show {:.4} of those held out",
            shown(&capture, 0.05)
        );
        let sized = |voxel_size, max_triangles| Options {
            voxel_size,
            max_triangles,
            ..Options::default()
        };
        for options in [
            sized(None, None),
            sized(None, Some(200_000)),
            sized(Some(0.02), None),
            sized(Some(0.04), None),
        ] {
            let (cpu, wall) = (ProcessTime::now(), Instant::now());
            let before = resident("VmRSS:");
            // Resets the peak.
            let _ = std::fs::write("/proc/self/clear_refs", "5");
            let used = &capture.used;
            let fusion = fuse(used.len(), |i| decode(&used[i]), &options);
            let (cpu, wall) = (cpu.elapsed(), wall.elapsed());
            let held = resident("VmHWM:") - before;
            let fusion = match fusion {
                Ok(fusion) => fusion,
                Err(error) => {
                    println!("{}: {error}", folder.display());
                    continue;
                }
            };
            let errors = errors(&fusion.mesh, &capture.held_out, 0.05);
            println!(
                "{:16} {:8.4} {:9} {:8} {:7.2} {:7.2} {:7.0} | {:8.4} {:8.4} {:8.4} {:8.4} {:8.4} {:8.4} {:8.4}",
                folder.file_name().unwrap_or_default().to_string_lossy(),
                fusion.voxel_size,
                fusion.mesh.triangles.len(),
                fusion.triangles_before,
                wall.as_secs_f64(),
                cpu.as_secs_f64(),
                held / 1e6,
                errors.mean,
                errors.mean_near,
                errors.median,
                errors.percentile_95,
                errors.complete,
                errors.in_front,
                errors.missing
            );
            eprintln!(
                "noise {:.5} blocks {} {:.0} MB",
                fusion.noise,
                fusion.blocks,
                fusion.bytes as f64 / 1e6
            );
        }
    }
}

/// Memory of this process in bytes, where Linux says; else 0.
fn resident(which: &str) -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix(which));
    let kibibytes = line.and_then(|line| line.trim().trim_end_matches(" kB").parse::<f64>().ok());
    kibibytes.unwrap_or(0.0) * 1024.0
}
