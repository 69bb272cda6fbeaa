//! What frames over captures' own meshes take, stage by stage:
//! `cargo bench --bench dense -- CAPTURE=PROXY.ply …`; see README.md.

#[expect(dead_code, reason = "others make scenes, too")]
mod common;

use common::on_the_way;
use cpu_time::ProcessTime;
use lumigraph::scene::Scene;
use render::{DeviceChoice, EDGE_SAMPLES, Engine, FieldOptions, Frame, Method, Prepared};
use std::collections::BTreeSet;
use std::error::Error;
use std::path::Path;
use std::time::Duration;

/// The longer side of a picture.
const LONG_SIDE: u32 = 960;
/// Desired views of a capture, spread over its photos.
const VIEWS: usize = 5;
/// Interleaved repeats, of which the least counts: what else the machine does only adds to it.
const REPEATS: usize = 5;
/// What is timed, in order.
const STAGES: [&str; 5] = ["surface", "field", "draw", "edges", "soften"];

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let pairs: Vec<(&str, &str)> = arguments.iter().filter_map(|a| a.split_once('=')).collect();
    println!(
        "{LONG_SIDE} pixels long, on the CPU, least CPU ms of {REPEATS}, mean of {VIEWS} views midway between photos\n"
    );
    print!("{:24}", "");
    STAGES.iter().for_each(|name| print!("{name:>10}"));
    println!("{:>10}{:>20}", "all", "bytes");
    for (capture, proxy) in pairs {
        if let Err(error) = measure(Path::new(capture), Path::new(proxy)) {
            println!("{capture}: {error}");
        }
    }
}

fn measure(capture: &Path, proxy: &Path) -> Result<(), Box<dyn Error>> {
    let (scene, _) = Scene::open(capture, false)?;
    let lumigraph = scene.lumigraph(&BTreeSet::new(), proxy::read(proxy)?)?;
    let mut engine = Engine::open(DeviceChoice::Cpu)?;
    let mut sums = [Duration::ZERO; STAGES.len()];
    let mut hash = 0_u64;
    for i in 0..VIEWS {
        let first = (i + 1) * (lumigraph.sources.len() - 1) / (VIEWS + 1);
        let desired = on_the_way(&lumigraph, first, 0.5, LONG_SIDE);
        let mut least = [Duration::MAX; STAGES.len()];
        // The first one decodes photos and makes distance maps.
        for repeat in 0..=REPEATS {
            let mut stage = 0;
            let mut then = ProcessTime::now();
            let mut took = || {
                let now = ProcessTime::now();
                if repeat > 0 {
                    least[stage] = least[stage].min(now.duration_since(then));
                }
                (stage, then) = (stage + 1, now);
            };
            let frame = Frame::new(&lumigraph, desired.clone(), FieldOptions::default());
            took();
            let prepared = Prepared::new(&frame, Method::TRIANGULATED)?;
            took();
            let mut picture = engine.draw(&frame, &prepared)?;
            took();
            engine.smooth(&frame, &prepared, EDGE_SAMPLES, &mut picture)?;
            took();
            engine.soften(&frame, &prepared, &mut picture)?;
            took();
            if repeat == 0 {
                // Whether two programs draw the same.
                hash = picture.as_raw().iter().fold(hash, |hash, byte| {
                    (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3)
                });
            }
        }
        sums.iter_mut()
            .zip(least)
            .for_each(|(sum, own)| *sum += own);
    }
    let name = capture.file_name().unwrap_or_default().to_string_lossy();
    let mean = |sum: Duration| sum.as_secs_f64() * 1e3 / VIEWS as f64;
    print!("{name:24}");
    sums.iter().for_each(|sum| print!("{:>10.1}", mean(*sum)));
    println!("{:>10.1}{hash:>20x}", mean(sums.iter().sum()));
    Ok(())
}
