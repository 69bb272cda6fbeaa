//! A frame's time by stage against the number of photos: `cargo bench --bench scaling
//! [-- --photos N,N… --proxies NAME,NAME… --widths N,N… --alone frame|field|cpu|exact|gpu --frames N --json FILE --gpu]`;
//! see README.md.

use calibrate::View;
use clap::Parser;
use cpu_time::ProcessTime;
use lumigraph::bench::made_up::{Surroundings, desired, lumigraph};
use render::cpu::Cpu;
use render::gpu::Gpu;
use render::score::score;
use render::{FieldOptions, Frame, Lumigraph, Method, TriangulatedField};
use serde_json::json;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Of the photos.
const PHOTO: (u32, u32) = (320, 240);
/// Interleaved repeats, of which the median counts.
const REPEATS: usize = 5;
/// More photos than this would fill the memory with the distances they see.
const MOST_OCCLUDED: usize = 10_000;
/// Above this, the exact picture is not drawn.
const MOST_EXACT: usize = 10_000;

/// Measures frames of made-up photo sets.
#[derive(Parser)]
struct Args {
    /// How many photos
    #[arg(long, value_delimiter = ',', default_values_t = [10, 100, 1_000, 10_000, 100_000])]
    photos: Vec<usize>,
    /// What they show: plane, tunnel, hull; crowd, a hull from one place
    #[arg(long, value_delimiter = ',', default_values_t = ["plane", "tunnel", "hull"].map(String::from))]
    proxies: Vec<String>,
    /// How wide pictures are: 960 (× 720), 1920 (× 1080)
    #[arg(long, value_delimiter = ',', default_values_t = [960, 1920])]
    widths: Vec<u32>,
    /// Only one stage, over and over, for profiles
    #[arg(long, value_parser = ["frame", "field", "cpu", "exact", "gpu"])]
    alone: Option<String>,
    /// How often it is repeated
    #[arg(long, default_value_t = 40, requires = "alone")]
    frames: usize,
    /// Also draw with whatever graphics driver there is
    #[arg(long)]
    gpu: bool,
    /// A file for the figures
    #[arg(long)]
    json: Option<PathBuf>,
    /// What cargo passes
    #[arg(long, hide = true)]
    bench: bool,
}

fn main() {
    let args = Args::parse();
    let with_gpu = args.gpu || args.alone.as_deref() == Some("gpu");
    let mut gpu = with_gpu.then(Gpu::open).and_then(Result::ok);

    println!(
        "CPU ms / wall ms, median of {REPEATS}; photos of {} × {}; dB of the triangulated \
         picture against the exact one\n",
        PHOTO.0, PHOTO.1
    );
    let stages = ["frame", "field", "cpu triang.", "cpu exact", "gpu triang."];
    print!("{:8}{:>12}{:>9}", "proxy", "size", "photos");
    stages.iter().for_each(|name| print!("{name:>16}"));
    println!("{:>8}{:>8}", "used", "dB");

    let mut lines = Vec::new();
    let all = [
        Surroundings::Plane,
        Surroundings::Tunnel,
        Surroundings::BALL,
        Surroundings::Crowd,
    ];
    let is_asked = |kind: &Surroundings| args.proxies.iter().any(|name| name == kind.name());
    for kind in all.into_iter().filter(is_asked) {
        let is_wanted = |(width, _): &(u32, u32)| args.widths.contains(width);
        for size in [(960, 720), (1920, 1080)].into_iter().filter(is_wanted) {
            for &count in &args.photos {
                let occluded = matches!(kind, Surroundings::Ball { .. } | Surroundings::Crowd);
                if occluded && count > MOST_OCCLUDED {
                    continue;
                }
                let lumigraph = lumigraph(kind, count, PHOTO);
                let desired = desired(kind, size);
                if let Some(stage) = &args.alone {
                    alone(
                        stage,
                        args.frames,
                        kind.name(),
                        &lumigraph,
                        &desired,
                        &mut gpu,
                    );
                    continue;
                }
                lines.push(measure(kind.name(), &lumigraph, &desired, &mut gpu));
            }
        }
    }
    if let Some(file) = &args.json {
        let text = serde_json::to_string_pretty(&lines).expect("plain numbers");
        std::fs::write(file, text).unwrap_or_else(|e| println!("{}: {e}", file.display()));
    }
}

fn measure(
    kind: &str,
    lumigraph: &Lumigraph,
    desired: &View,
    gpu: &mut Option<Gpu>,
) -> serde_json::Value {
    let count = lumigraph.sources.len();
    let Method::Triangulated { cells_across } = Method::TRIANGULATED else {
        unreachable!("the default method is triangulated")
    };
    let new = || Frame::new(lumigraph, desired.clone(), FieldOptions::default());
    let frame = new();
    let mut cpu = Cpu::default();
    let draw = |cpu: &mut Cpu, frame: &Frame<'_>, method| {
        cpu.render(frame, method).expect("the photos are made up")
    };
    let triangulated = draw(&mut cpu, &frame, Method::TRIANGULATED);
    let exact = (count <= MOST_EXACT).then(|| draw(&mut cpu, &frame, Method::Exact));
    let used = lumigraph.photos.decoded();
    let db = exact
        .as_ref()
        .and_then(|exact| Some(score(&triangulated, exact).ok()?.psnr));
    if let Some(gpu) = gpu {
        // The first frame makes pipelines and uploads photos.
        gpu.render(&frame, Method::TRIANGULATED).expect("it draws");
    }
    let mut times: [Vec<(Duration, Duration)>; 5] = Default::default();
    for _ in 0..REPEATS {
        times[0].push(timed(|| drop(new())));
        // What a frame keeps is made anew.
        let frame = new();
        times[1].push(timed(|| {
            drop(TriangulatedField::new(&frame, cells_across).expect("the grid fits"));
        }));
        let frame = new();
        times[2].push(timed(|| drop(draw(&mut cpu, &frame, Method::TRIANGULATED))));
        if exact.is_some() {
            let frame = new();
            times[3].push(timed(|| drop(draw(&mut cpu, &frame, Method::Exact))));
        }
        if let Some(gpu) = gpu {
            let frame = new();
            times[4].push(timed(|| {
                drop(gpu.render(&frame, Method::TRIANGULATED).expect("it draws"));
            }));
        }
    }
    let size = format!("{} × {}", desired.width, desired.height);
    print!("{kind:8}{size:>12}{count:>9}");
    let medians = times.map(|mut times| {
        times.sort();
        let median = times
            .get(times.len() / 2)
            .map(|(cpu, wall)| (ms(*cpu), ms(*wall)));
        let text = median.map_or("-".into(), |(cpu, wall)| format!("{cpu:.1} / {wall:.1}"));
        print!("{text:>16}");
        median
    });
    println!(
        "{used:>8}{:>8}",
        db.map_or("-".into(), |db| format!("{db:.1}"))
    );
    let [frame, field, cpu_triangulated, cpu_exact, gpu_triangulated] = medians;
    json!({
        "proxy": kind, "width": desired.width, "height": desired.height, "photos": count,
        "cpu_ms_wall_ms": {
            "frame": frame, "field": field, "cpu_triangulated": cpu_triangulated,
            "cpu_exact": cpu_exact, "gpu_triangulated": gpu_triangulated,
        },
        "photos_decoded": used, "triangulated_db": db,
    })
}

/// Prints the time of one stage, over and over, for profiles: the median, and the least CPU time.
fn alone(
    stage: &str,
    frames: usize,
    kind: &str,
    lumigraph: &Lumigraph,
    desired: &View,
    gpu: &mut Option<Gpu>,
) {
    let Method::Triangulated { cells_across } = Method::TRIANGULATED else {
        unreachable!("the default method is triangulated")
    };
    let mut cpu = Cpu::default();
    let mut work = || {
        let prepare = || Frame::new(lumigraph, desired.clone(), FieldOptions::default());
        let frame = prepare();
        let (cpu, wall) = timed(|| match stage {
            "frame" => drop(prepare()),
            "field" => drop(TriangulatedField::new(&frame, cells_across).expect("it fits")),
            "exact" => drop(cpu.render(&frame, Method::Exact).expect("made up")),
            "gpu" => {
                let gpu = gpu.as_mut().expect("there is a driver");
                drop(gpu.render(&frame, Method::TRIANGULATED).expect("made up"));
            }
            _ => drop(cpu.render(&frame, Method::TRIANGULATED).expect("made up")),
        });
        (ms(cpu), ms(wall))
    };
    work();
    let mut times: Vec<(f64, f64)> = (0..frames.max(1)).map(|_| work()).collect();
    times.sort_by(|x, y| x.0.total_cmp(&y.0));
    let ((least, _), (cpu, wall)) = (times[0], times[times.len() / 2]);
    let size = format!("{} × {}", desired.width, desired.height);
    let count = lumigraph.sources.len();
    println!("{kind:8}{size:>12}{count:>9}  {stage} {cpu:.1} / {wall:.1}, least {least:.1}");
}

fn timed(work: impl FnOnce()) -> (Duration, Duration) {
    let (cpu, wall) = (ProcessTime::now(), Instant::now());
    work();
    (cpu.elapsed(), wall.elapsed())
}

fn ms(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}
