//! What a run took of time and memory.

use cpu_time::ProcessTime;
use render::Residency;
use serde::{Serialize, Serializer};
use serde_json::json;
use std::time::Instant;

/// When a command began.
pub(super) struct Start {
    wall: Instant,
    cpu: ProcessTime,
}

impl Start {
    pub(super) fn now() -> Self {
        Self {
            wall: Instant::now(),
            cpu: ProcessTime::now(),
        }
    }

    /// What the whole process has taken since.
    pub(super) fn took(&self) -> Took {
        Took {
            seconds: self.wall.elapsed().as_secs_f64(),
            cpu_seconds: self.cpu.elapsed().as_secs_f64(),
            peak_memory_bytes: peak_memory_bytes(),
        }
    }
}

/// What a run took: a part of its report.
#[derive(Serialize)]
pub(super) struct Took {
    seconds: f64,
    cpu_seconds: f64,
    /// `None` where the system does not say.
    peak_memory_bytes: Option<u64>,
}

impl Took {
    /// `1.2 s (2.3 CPU s) on CPU, peak memory 34 MB`, by what drew.
    pub(super) fn text(&self, device: &str) -> String {
        let peak = self.peak_memory_bytes.map_or_else(String::new, |bytes| {
            format!(", peak memory {}", megabytes(bytes))
        });
        let (seconds, cpu_seconds) = (self.seconds, self.cpu_seconds);
        format!("{seconds:.1} s ({cpu_seconds:.1} CPU s) on {device}{peak}")
    }
}

/// What photos took of a memory.
#[derive(Clone, Copy)]
pub(super) struct Memory(pub(super) Residency);

impl Memory {
    /// `12 MB at most`, and what the budget had to do with it.
    pub(super) fn text(self) -> String {
        let took = self.0;
        let mut text = format!("{} at most", megabytes(took.peak));
        if let Some(budget) = took.budget {
            text += &format!(" of {}", megabytes(budget));
        }
        if took.evictions > 0 {
            text += &format!(", {} let go", took.evictions);
        }
        if took.level_cap > 0 {
            let (frames, level) = (took.capped_frames, took.level_cap);
            text += &format!(", too little for {frames} drawings: mip levels from {level} on");
        }
        text
    }
}

impl Serialize for Memory {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let took = self.0;
        json!({
            "budget_bytes": took.budget,
            "held_bytes": took.held,
            "peak_bytes": took.peak,
            "loads": took.loads,
            "evictions": took.evictions,
            "level_cap": took.level_cap,
            "capped_drawings": took.capped_frames,
        })
        .serialize(serializer)
    }
}

/// In megabytes, or in less where that would be none.
pub(super) fn megabytes(bytes: u64) -> String {
    match bytes {
        0 => "0 MB".to_owned(),
        1 => "1 byte".to_owned(),
        2..1000 => format!("{bytes} bytes"),
        1000..999_500 => format!("{:.0} kB", bytes as f64 / 1e3),
        _ => format!("{:.0} MB", bytes as f64 / 1e6),
    }
}

/// The most memory that the process ever held, as Linux counts it.
fn peak_memory_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kibibytes * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn little_memory_is_not_none() {
        let texts = [0, 1, 7, 1024, 999_499, 999_500, 44_100_000].map(megabytes);
        let expected = [
            "0 MB", "1 byte", "7 bytes", "1 kB", "999 kB", "1 MB", "44 MB",
        ];
        assert_eq!(texts, expected);
    }
}
