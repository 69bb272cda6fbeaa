//! Scenes that try to break things, as many as there is time for.

use super::super::output::{print, print_json, say};
use super::super::session::progress;
use anyhow::bail;
use lumigraph::bench::stress::{Outcome, watched};
use serde_json::json;
use std::time::{Duration, Instant};

/// A scene that takes longer hangs.
const PATIENCE: Duration = Duration::from_secs(120);

/// Runs scenes from a number on for so many minutes.
pub(super) fn run(minutes: f64, first: u64, as_json: bool) -> anyhow::Result<()> {
    let start = Instant::now();
    let limit = Duration::from_secs_f64(60.0 * minutes);
    let bar = progress(limit.as_secs() as usize, "stress");
    let mut bad = Vec::new();
    let mut seed = first;
    while start.elapsed() < limit {
        let outcome = watched(seed, PATIENCE);
        if outcome != Outcome::Held {
            bar.suspend(|| say!("{seed}: {outcome:?}"));
            bad.push((seed, format!("{outcome:?}")));
        }
        seed += 1;
        bar.set_position(start.elapsed().as_secs());
    }
    bar.finish_and_clear();
    let (count, seconds) = (seed - first, start.elapsed().as_secs_f64());
    if as_json {
        print_json(&json!({"first": first, "scenes": count, "seconds": seconds, "bad": bad}))?;
    } else {
        print(&format!(
            "{count} scenes from {first} on in {seconds:.0} s, {} bad\n",
            bad.len()
        ))?;
    }
    if !bad.is_empty() {
        bail!(
            "{} of {count} scenes broke what must hold; their numbers are above",
            bad.len()
        );
    }
    Ok(())
}
