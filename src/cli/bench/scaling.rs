//! How time grows with photos, pixels, faces and threads.

use super::scatter::{Axis, Dot, escape, round, scatter};
use super::times::{Times, timed};
use indicatif::ProgressBar;
use lumigraph::bench::made_up::{Surroundings, desired, lumigraph};
use lumigraph::bench::{Exponent, fit_exponent};
use render::cpu::Cpu;
use render::{FieldOptions, Frame, Lumigraph, Method};
use serde::Serialize;
use std::fmt::Write;

/// Of the photos.
const PHOTO: (u32, u32) = (320, 240);
const REPEATS: usize = 5;

/// A line: times against a size.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Series {
    /// Of what, and of how large the rest is.
    name: String,
    /// What grows: photos, pixels, faces, threads.
    of: &'static str,
    /// Size and time.
    points: Vec<(f64, Times)>,
    /// Of CPU time; of threads, of wall time.
    grows: Option<Exponent>,
}

/// All of them.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Scaling(Vec<Series>);

/// The median time of a triangulated picture, its photos decoded before.
fn picture_time(set: &Lumigraph, kind: Surroundings, size: (u32, u32)) -> anyhow::Result<Times> {
    let mut cpu = Cpu::default();
    let view = desired(kind, size);
    let mut draw = || {
        let (drawn, times) = timed(|| {
            let frame = Frame::new(set, view.clone(), FieldOptions::default());
            cpu.render(&frame, Method::TRIANGULATED)
        });
        drawn.map(|_| times)
    };
    draw()?;
    let times = (0..REPEATS)
        .map(|_| draw())
        .collect::<Result<Vec<_>, _>>()?;
    Ok(Times::median(&times))
}

impl Scaling {
    /// Measures all; `thorough` up to 100,000 photos, which takes some minutes.
    pub(super) fn measure(thorough: bool, bar: &ProgressBar) -> anyhow::Result<Self> {
        let plane = Surroundings::Plane;
        let middle = (960, 720);
        let mut all = Vec::new();
        let mut add =
            |name: String, of, sizes: &[f64], time: &dyn Fn(f64) -> anyhow::Result<Times>| {
                let mut points = Vec::new();
                for &size in sizes {
                    bar.set_message(format!("{name}: {size} {of}"));
                    points.push((size, time(size)?));
                }
                let pairs: Vec<(f64, f64)> = points
                    .iter()
                    .map(|(s, t)| (*s, if of == "threads" { t.wall_ms } else { t.cpu_ms }))
                    .collect();
                all.push(Series {
                    name,
                    of,
                    grows: fit_exponent(&pairs),
                    points,
                });
                anyhow::Ok(())
            };
        let counts: &[f64] = if thorough {
            &[10.0, 100.0, 1e3, 1e4, 1e5]
        } else {
            &[10.0, 100.0, 1e3]
        };
        let kinds: &[Surroundings] = match thorough {
            true => &[plane, Surroundings::Tunnel, Surroundings::BALL],
            false => &[plane],
        };
        for &kind in kinds {
            // Each photo of a ball has a map of distances: more would fill the memory.
            let counts = if kind == Surroundings::BALL {
                &counts[..counts.len().min(3)]
            } else {
                counts
            };
            add(
                format!("{}, 960 × 720", kind.name()),
                "photos",
                counts,
                &|count| picture_time(&lumigraph(kind, count as usize, PHOTO), kind, middle),
            )?;
        }
        let hundred = lumigraph(plane, 100, PHOTO);
        let widths: &[f64] = if thorough {
            &[240.0, 480.0, 960.0, 1920.0, 3840.0]
        } else {
            &[240.0, 480.0, 960.0]
        };
        let pixels: Vec<f64> = widths.iter().map(|w| w * w * 0.75).collect();
        add(
            "plane, 100 photos".to_owned(),
            "pixels",
            &pixels,
            &|pixels| {
                let width = (pixels / 0.75).sqrt().round() as u32;
                picture_time(&hundred, plane, (width, width * 3 / 4))
            },
        )?;
        let sides: &[u32] = if thorough {
            &[8, 16, 32, 64, 128]
        } else {
            &[8, 16, 32]
        };
        let faces: Vec<f64> = sides.iter().map(|n| f64::from(2 * n * (n - 1))).collect();
        add(
            "hull, 40 photos, 640 × 480".to_owned(),
            "faces",
            &faces,
            &|faces| {
                // faces = 2·n·(n − 1).
                let sides = (0.5 + (0.25 + 0.5 * faces).sqrt()).round() as u32;
                let kind = Surroundings::Ball { sides };
                picture_time(&lumigraph(kind, 40, PHOTO), kind, (640, 480))
            },
        )?;
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let threads: Vec<f64> = (0..)
            .map(|power| 1 << power)
            .take_while(|n| *n < cores)
            .chain([cores])
            .map(|n: usize| n as f64)
            .collect();
        add(
            "plane, 100 photos, 960 × 720".to_owned(),
            "threads",
            &threads,
            &|count| {
                let pool = rayon::ThreadPoolBuilder::new();
                let pool = pool.num_threads(count as usize).build()?;
                pool.install(|| picture_time(&hundred, plane, middle))
            },
        )?;
        Ok(Self(all))
    }

    /// For people.
    pub(super) fn text(&self) -> String {
        let mut text = String::new();
        for series in &self.0 {
            let _ = writeln!(text, "{}: {}", series.name, series.exponent_text());
            for (size, times) in &series.points {
                let _ = writeln!(
                    text,
                    "  {size:>9} {}  {:>8} CPU ms  {:>8} wall ms",
                    series.of,
                    round(times.cpu_ms),
                    round(times.wall_ms)
                );
            }
        }
        text
    }

    pub(super) fn html(&self) -> String {
        let mut html =
            "<h2>Growth</h2><p>Made-up photos, on the CPU; a picture's time.</p>\n".to_owned();
        for series in &self.0 {
            let by_wall = series.of == "threads";
            let name = |size: f64| round(size);
            let names: Vec<String> = series.points.iter().map(|p| name(p.0)).collect();
            let dots: Vec<Dot<'_>> = series
                .points
                .iter()
                .zip(&names)
                .map(|((size, times), name)| Dot {
                    name,
                    family: series.of,
                    at: (*size, if by_wall { times.wall_ms } else { times.cpu_ms }),
                    is_default: false,
                })
                .collect();
            let line: Vec<usize> = (0..dots.len()).collect();
            let across = Axis {
                title: series.of,
                is_log: true,
            };
            let up = if by_wall { "wall ms" } else { "CPU ms" };
            let up = Axis {
                title: up,
                is_log: true,
            };
            let _ = writeln!(
                html,
                "<h3>{}</h3><p>{}</p>{}",
                escape(&series.name),
                escape(&series.exponent_text()),
                scatter(&dots, &line, &across, &up)
            );
        }
        html
    }
}

impl Series {
    fn exponent_text(&self) -> String {
        let Some(grows) = self.grows else {
            return format!("one size only; nothing to tell of {}", self.of);
        };
        let what = if self.of == "threads" {
            "wall time"
        } else {
            "CPU time"
        };
        let spread = grows
            .confidence
            .map_or(String::new(), |c| format!(" ± {c:.2}"));
        format!(
            "{what} grows as {}^({:.2}{spread})",
            self.of, grows.exponent
        )
    }
}
