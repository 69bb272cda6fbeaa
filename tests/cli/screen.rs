//! A virtual screen, and the program in a window on it, with keys and a mouse.

use glam::DVec3;
use image::RgbaImage;
use serde_json::Value;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// More than anything takes, even on a machine that does much else.
const PATIENCE: Duration = Duration::from_secs(90);
pub(crate) const SIZE: (u32, u32) = (320, 240);
/// Of the window that shows the wall.
const TITLE: &str = "wall – lumigraph";

/// Whether a virtual screen, someone to type and someone to look at it are installed; where they
/// are not, says so, or fails if the environment has `LUMIGRAPH_REQUIRE_TOOLS=1`.
pub(crate) fn has_tools() -> bool {
    let is_there = |name: &&str| {
        let mut command = Command::new(name);
        let command = command.arg("-version").stdout(Stdio::null());
        command.stderr(Stdio::null()).status().is_ok()
    };
    let mut missing = ["Xvfb", "xdotool", "xprop", "ffmpeg"]
        .into_iter()
        .filter(|n| !is_there(n));
    let Some(name) = missing.next() else {
        return true;
    };
    let required = std::env::var("LUMIGRAPH_REQUIRE_TOOLS").as_deref() == Ok("1");
    assert!(
        !required,
        "LUMIGRAPH_REQUIRE_TOOLS is 1, but there is no {name}"
    );
    eprintln!("SKIPPED: {name} is not installed");
    false
}

/// A virtual screen.
pub(crate) struct Screen {
    server: Child,
    name: String,
}

impl Screen {
    pub(crate) fn open() -> Self {
        // It chooses a number that is free, and says so.
        let mut server = Command::new("Xvfb")
            .args([
                "-displayfd",
                "1",
                "-screen",
                "0",
                "400x300x24",
                "-nolisten",
                "tcp",
            ])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut number = String::new();
        let mut said = BufReader::new(server.stdout.take().unwrap());
        said.read_line(&mut number).unwrap();
        let name = format!(":{}", number.trim());
        Self { server, name }
    }

    pub(crate) fn do_all(&self, words: &str) {
        let status = Command::new("xdotool")
            .args(words.split(' '))
            .env("DISPLAY", &self.name)
            .stdout(Stdio::null())
            .status()
            .unwrap();
        assert!(status.success(), "xdotool {words}");
    }

    /// Asks for so many dots an inch, as desktops do.
    pub(crate) fn set_dpi(&self, dpi: u32) {
        let dpi = format!("Xft.dpi: {dpi}");
        // winit looks at the screen's where it is told of its own window's.
        for of in [&["-root"][..], &["-name", TITLE]] {
            let status = Command::new("xprop")
                .args(of)
                .args(["-f", "RESOURCE_MANAGER", "8s", "-set", "RESOURCE_MANAGER"])
                .arg(&dpi)
                .env("DISPLAY", &self.name)
                .status()
                .unwrap();
            assert!(status.success(), "xprop {of:?}");
        }
    }

    /// What is on the screen where the window is.
    pub(crate) fn look(&self, folder: &Path) -> RgbaImage {
        let file = folder.join("screen.png");
        let size = format!("{}x{}", SIZE.0, SIZE.1);
        let mut command = Command::new("ffmpeg");
        command.args([
            "-loglevel",
            "error",
            "-y",
            "-f",
            "x11grab",
            "-draw_mouse",
            "0",
        ]);
        command.args(["-video_size", &size, "-i", &self.name, "-frames:v", "1"]);
        assert!(command.arg(&file).status().unwrap().success());
        image::open(&file).unwrap().into_rgba8()
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

/// The program with its window.
pub(crate) struct Window<'s> {
    screen: &'s Screen,
    program: Child,
    trace: PathBuf,
    /// Lines of the trace that were read.
    read: usize,
}

impl<'s> Window<'s> {
    /// Waits for the picture.
    pub(crate) fn open(screen: &'s Screen, folder: &Path, line: &str) -> Self {
        let mut window = Self::start(screen, folder, line);
        window.wait("a picture in full", |frame| {
            is_settled(frame) && frame["doing"].is_null()
        });
        window.focus();
        window
    }

    pub(crate) fn focus(&self) {
        let line = "search --sync --name lumigraph windowfocus --sync";
        self.screen.do_all(line);
    }

    pub(crate) fn start(screen: &'s Screen, folder: &Path, line: &str) -> Self {
        let trace = folder.join("trace.jsonl");
        // Of a window before.
        let _ = std::fs::remove_file(&trace);
        let program = Command::new(env!("CARGO_BIN_EXE_lumigraph"))
            .current_dir(folder)
            .args(line.split(' '))
            .args([
                "--device",
                "cpu",
                "--size",
                "320x240",
                "--trace",
                "trace.jsonl",
            ])
            .env("DISPLAY", &screen.name)
            .env_remove("WAYLAND_DISPLAY")
            .env_remove("WAYLAND_SOCKET")
            .spawn()
            .unwrap();
        Self {
            screen,
            program,
            trace,
            read: 0,
        }
    }

    /// Waits for a frame after those that were waited for before.
    #[track_caller]
    pub(crate) fn wait(&mut self, what: &str, is_it: impl Fn(&Value) -> bool) -> Value {
        let start = Instant::now();
        let mut last = Value::Null;
        while start.elapsed() < PATIENCE {
            let text = std::fs::read_to_string(&self.trace).unwrap_or_default();
            // The last line may not be complete.
            let complete = text.rsplit_once('\n').map_or("", |(complete, _)| complete);
            for line in complete.lines().skip(self.read) {
                self.read += 1;
                last = serde_json::from_str(line).unwrap();
                if is_it(&last) {
                    return last;
                }
            }
            if let Some(status) = self.program.try_wait().unwrap() {
                panic!("waiting for {what}: the program ended, {status}");
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        panic!("waited for {what}; the last frame was {last}");
    }

    pub(crate) fn key(&self, keys: &str) {
        self.screen.do_all(&format!("key {keys}"));
    }

    /// Takes a screenshot; its file's name.
    #[track_caller]
    pub(crate) fn shoot(&mut self, number: u32) -> String {
        let name = format!("shot_{number:04}.png");
        self.key("p");
        self.wait(&name, |f| says(f, &name));
        name
    }

    pub(crate) fn close(mut self) -> ExitStatus {
        self.key("Escape");
        let start = Instant::now();
        loop {
            if let Some(status) = self.program.try_wait().unwrap() {
                return status;
            }
            assert!(start.elapsed() < PATIENCE, "it does not close");
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

impl Drop for Window<'_> {
    fn drop(&mut self) {
        let _ = self.program.kill();
        let _ = self.program.wait();
    }
}

pub(crate) fn is_settled(frame: &Value) -> bool {
    frame["picture"]["is_settled"] == true
}

pub(crate) fn says(frame: &Value, text: &str) -> bool {
    frame["said"]
        .as_str()
        .is_some_and(|said| said.contains(text))
}

pub(crate) fn triple(frame: &Value, key: &str) -> DVec3 {
    let at = |i: usize| frame[key][i].as_f64().unwrap();
    DVec3::new(at(0), at(1), at(2))
}

pub(crate) fn pixels(path: &Path) -> RgbaImage {
    image::open(path).unwrap().into_rgba8()
}
