//! What a run has cost.

use super::session::Session;
use super::time::InWindow;
use cpu_time::ProcessTime;
use serde::Serialize;
use serde_json::Value;
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
        format!(
            "{} of {} photos decoded ({}), {:.1} s ({:.1} CPU s) on {}{peak}{}",
            self.photos_decoded,
            self.photos_total,
            megabytes(self.photos_bytes as u64),
            self.seconds,
            self.cpu_seconds,
            self.device,
            self.in_window.text(),
        )
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
