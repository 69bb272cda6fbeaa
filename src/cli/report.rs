//! What a run has cost.

use super::session::Session;
use super::time::InWindow;
use cpu_time::ProcessTime;
use render::Residency;
use serde::{Serialize, Serializer};
use serde_json::{Value, json};
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
}

/// The run report, printed at the end and part of `--json`.
#[derive(Serialize)]
pub(super) struct Report {
    device: String,
    photos_decoded: usize,
    photos_total: usize,
    photos_bytes: usize,
    cpu_memory: Memory,
    /// Where a graphics processor draws.
    #[serde(skip_serializing_if = "Option::is_none")]
    gpu_memory: Option<Memory>,
    seconds: f64,
    cpu_seconds: f64,
    /// `None` where the system does not say.
    peak_memory_bytes: Option<u64>,
    /// Where time plays a part.
    #[serde(skip_serializing_if = "Option::is_none")]
    time: Option<Value>,
    #[serde(skip)]
    in_window: InWindow,
}

impl Report {
    pub(super) fn new(session: &Session, start: &Start) -> Self {
        let photos = &session.lumigraph().photos;
        Self {
            device: session.device(),
            photos_decoded: photos.decoded(),
            photos_total: photos.len(),
            photos_bytes: photos.bytes(),
            cpu_memory: Memory(photos.residency()),
            gpu_memory: session.gpu_residency().map(Memory),
            seconds: start.wall.elapsed().as_secs_f64(),
            cpu_seconds: start.cpu.elapsed().as_secs_f64(),
            peak_memory_bytes: peak_memory_bytes(),
            time: session.time_json(),
            in_window: session.in_window,
        }
    }

    /// One line for people.
    pub(super) fn text(&self) -> String {
        let peak = self.peak_memory_bytes.map_or_else(String::new, |bytes| {
            format!(", peak memory {}", megabytes(bytes))
        });
        let mut memory = self.cpu_memory.text();
        if let Some(gpu) = self.gpu_memory {
            memory += &format!("; on the device {}", gpu.text());
        }
        format!(
            "{} of {} photos decoded ({}), {:.1} s ({:.1} CPU s) on {}{peak}{}",
            self.photos_decoded,
            self.photos_total,
            memory,
            self.seconds,
            self.cpu_seconds,
            self.device,
            self.in_window.text(),
        )
    }
}

/// What photos took of a memory.
#[derive(Clone, Copy)]
struct Memory(Residency);

impl Memory {
    /// `12 MB at most`, and what the budget had to do with it.
    fn text(self) -> String {
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

pub(super) fn megabytes(bytes: u64) -> String {
    format!("{:.0} MB", bytes as f64 / 1e6)
}

/// The most memory that the process ever held, as Linux counts it.
fn peak_memory_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kibibytes * 1024)
}
