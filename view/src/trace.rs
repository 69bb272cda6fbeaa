//! What each drawn frame was, as JSON lines in a file, written on a thread of its own.

use cpu_time::ThreadTime;
use serde_json::Value;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;
use std::sync::mpsc::{Sender, channel};
use std::thread::JoinHandle;
use std::time::Instant;

/// What a step took.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Took {
    /// By the clock.
    pub(crate) ms: f64,
    /// Of this thread alone, without what other threads had of its core meanwhile.
    pub(crate) cpu_ms: f64,
}

impl std::ops::AddAssign for Took {
    fn add_assign(&mut self, other: Self) {
        self.ms += other.ms;
        self.cpu_ms += other.cpu_ms;
    }
}

/// Takes a step's time.
pub(crate) struct Watch {
    wall: Instant,
    cpu: ThreadTime,
}

impl Watch {
    /// From now on.
    pub(crate) fn start() -> Self {
        Self {
            wall: Instant::now(),
            cpu: ThreadTime::now(),
        }
    }

    /// Since the start.
    pub(crate) fn took(&self) -> Took {
        Took {
            ms: 1e3 * self.wall.elapsed().as_secs_f64(),
            cpu_ms: 1e3 * self.cpu.elapsed().as_secs_f64(),
        }
    }
}

/// A file that grows by a line for each frame.
#[derive(Debug)]
pub(crate) struct Trace {
    lines: Option<Sender<Value>>,
    writer: Option<JoinHandle<()>>,
}

impl Trace {
    /// Begins the file.
    ///
    /// # Errors
    /// It cannot be made.
    pub(crate) fn create(path: &Path) -> std::io::Result<Self> {
        let mut out = BufWriter::new(File::create(path)?);
        let (lines, received) = channel::<Value>();
        let writer = std::thread::spawn(move || {
            for line in received {
                // A full disk must not close the window.
                let _ = writeln!(out, "{line}").and_then(|()| out.flush());
            }
        });
        Ok(Self {
            lines: Some(lines),
            writer: Some(writer),
        })
    }

    /// Adds a line.
    pub(crate) fn add(&self, line: Value) {
        if let Some(lines) = &self.lines {
            // The writer lives as long as this does.
            let _ = lines.send(line);
        }
    }
}

impl Drop for Trace {
    fn drop(&mut self) {
        self.lines = None;
        if let Some(writer) = self.writer.take() {
            let _ = writer.join();
        }
    }
}
