//! Times, and what has them taken in turn.

use cpu_time::ProcessTime;
use indicatif::ProgressBar;
use lumigraph::bench::median;
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// CPU and wall time in milliseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Times {
    pub(super) cpu_ms: f64,
    pub(super) wall_ms: f64,
}

impl Times {
    /// The median of each; zero of nothing.
    pub(super) fn median(times: &[Self]) -> Self {
        let of = |value: fn(&Self) -> f64| {
            median(&times.iter().map(value).collect::<Vec<_>>()).unwrap_or_default()
        };
        Self {
            cpu_ms: of(|t| t.cpu_ms),
            wall_ms: of(|t| t.wall_ms),
        }
    }
}

pub(super) fn timed<T>(work: impl FnOnce() -> T) -> (T, Times) {
    let (cpu, wall) = (ProcessTime::now(), Instant::now());
    let done = work();
    let times = Times {
        cpu_ms: 1e3 * cpu.elapsed().as_secs_f64(),
        wall_ms: 1e3 * wall.elapsed().as_secs_f64(),
    };
    (done, times)
}

/// Times of settings, each of which draws all views: by setting, the mean over the views of each
/// repeat. All take turns, over and over, each time beginning with another.
pub(super) fn in_turn(
    settings: usize,
    repeats: usize,
    views: usize,
    bar: &ProgressBar,
    mut draw: impl FnMut(usize, usize) -> anyhow::Result<()>,
) -> anyhow::Result<Vec<Vec<Times>>> {
    let mut all: Vec<Vec<Times>> = vec![Vec::new(); settings];
    for repeat in 0..repeats {
        for step in 0..settings {
            let i = (step + repeat * settings / repeats) % settings;
            let mut sum = Times::default();
            for view in 0..views {
                let (drawn, times) = timed(|| draw(i, view));
                drawn?;
                sum.cpu_ms += times.cpu_ms / views as f64;
                sum.wall_ms += times.wall_ms / views as f64;
            }
            all[i].push(sum);
            bar.inc(1);
        }
    }
    Ok(all)
}
