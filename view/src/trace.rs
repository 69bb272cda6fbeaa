//! What each drawn frame was, as JSON lines in a file, written on a thread of its own.

use serde_json::Value;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;
use std::sync::mpsc::{Sender, channel};
use std::thread::JoinHandle;

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
