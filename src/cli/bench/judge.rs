//! Whether the default is worth its time.

use super::measured::Measured;
use lumigraph::bench::{Cost, front};

/// Times that differ by less say nothing.
const TIME_SHARE: f64 = 0.08;
/// Nor do differences of so many dB.
const ERROR_DB: f64 = 0.05;

/// What the measurements say of the default.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Verdict {
    /// The settings that nothing beats, fastest first.
    pub(super) front: Vec<usize>,
    /// The names of those that beat the default in one and are no worse in the other.
    pub(super) better: Vec<String>,
}

/// Judges settings by CPU time and PSNR.
pub(super) fn judge(settings: &[Measured]) -> Verdict {
    let cost = |m: &Measured| Cost {
        time: m.frame.cpu_ms,
        error: -m.psnr,
    };
    let costs: Vec<Cost> = settings.iter().map(cost).collect();
    let default = settings.iter().find(|m| m.is_default()).map(cost);
    let better = default.map(|default| {
        let beats = |m: &&Measured| cost(m).dominates(&default, TIME_SHARE, ERROR_DB);
        settings
            .iter()
            .filter(beats)
            .map(|m| m.name.clone())
            .collect()
    });
    Verdict {
        front: front(&costs),
        better: better.unwrap_or_default(),
    }
}

impl Verdict {
    /// For people.
    pub(super) fn text(&self) -> String {
        if self.better.is_empty() {
            return format!(
                "No setting is better than the default in time or error by more than {} % or \
                 {ERROR_DB} dB and no worse in the other.",
                100.0 * TIME_SHARE
            );
        }
        format!("Better than the default here: {}.", self.better.join(", "))
    }
}
