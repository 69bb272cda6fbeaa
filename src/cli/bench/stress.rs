//! Scenes that try to break things, as many as there is time for.

use super::super::output::{print, print_json, say};
use super::super::session::progress;
use anyhow::bail;
use lumigraph::bench::median;
use lumigraph::bench::stress::{Outcome, Rounding, quantile, watched};
use render::gpu::Gpu;
use serde_json::json;
use std::time::{Duration, Instant};

/// A scene that takes longer hangs.
const PATIENCE: Duration = Duration::from_secs(120);

/// Pixels that are looked at for rounding, in no more than a half of the time.
const PIXELS: usize = 10_000;

/// Runs scenes from a number on for so many minutes.
pub(super) fn run(minutes: f64, first: u64, as_json: bool) -> anyhow::Result<()> {
    let start = Instant::now();
    let limit = Duration::from_secs_f64(60.0 * minutes);
    let bar = progress(limit.as_secs() as usize, "stress");
    let rounding = rounding(first, start + limit / 2)?;
    let begun = Instant::now();
    let mut bad = Vec::new();
    let mut seed = first;
    // One at least.
    while seed == first || start.elapsed() < limit {
        let outcome = watched(seed, PATIENCE);
        if outcome != Outcome::Held {
            bar.suspend(|| say!("{seed}: {outcome:?}"));
            bad.push((seed, format!("{outcome:?}")));
        }
        seed += 1;
        bar.set_position(start.elapsed().as_secs());
    }
    bar.finish_and_clear();
    let (count, seconds) = (seed - first, begun.elapsed().as_secs_f64());
    if as_json {
        let spread = |values: &[f64]| json!({"median": median(values), "within_95_percent": quantile(values, 0.95)});
        print_json(&json!({
            "first": first,
            "scenes": count,
            "seconds": seconds,
            "bad": bad,
            "rounding": {
                "pixels": rounding.fragments,
                "pixels_by_device": rounding.gpu_fragments,
                "bound_steps": spread(&rounding.bounds),
                "cpu_steps": spread(&rounding.observed),
                "cpu_of_bound": spread(&rounding.shares()),
                "device_bound_steps": spread(&rounding.gpu_bounds),
                "beyond": rounding.beyond,
            },
        }))?;
    } else {
        print(&format!(
            "{}{count} scenes from {first} on in {seconds:.0} s, {} bad\n",
            rounding.text(),
            bad.len()
        ))?;
    }
    if !rounding.beyond.is_empty() {
        let all = rounding.beyond.len();
        bail!(
            "f32 is beyond its bound {all} times; {}",
            rounding.beyond[0]
        );
    }
    if !bad.is_empty() {
        bail!(
            "{} of {count} scenes broke what must hold; their numbers are above",
            bad.len()
        );
    }
    Ok(())
}

/// f32 against its bound, by the CPU and by a graphics device if there is one.
fn rounding(first: u64, until: Instant) -> anyhow::Result<Rounding> {
    let mut gpu = Gpu::open().ok();
    let mut all = Rounding::default();
    for seed in first.. {
        if all.fragments >= PIXELS || Instant::now() > until {
            break;
        }
        all.look_at(seed, gpu.as_mut())?;
    }
    Ok(all)
}
