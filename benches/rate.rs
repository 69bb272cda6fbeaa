//! Frames a second on a graphics device along a path among made-up photos:
//! `cargo bench --bench rate [-- --photos N --proxies NAME,NAME… --size WxH --frames N --workers N --readers N
//! --json FILE]`; see README.md.
//!
//! First frame by frame, each waited for; then as fast as they come: threads prepare the frames to come, the
//! device draws one after the other, others read pictures back.

use calibrate::{Rigid3, View};
use clap::Parser;
use cpu_time::ProcessTime;
use glam::{DQuat, DVec3};
use image::RgbaImage;
use lumigraph::bench::made_up::{Surroundings, desired, lumigraph};
use render::gpu::{Drawing, Gpu};
use render::{FieldOptions, Frame, Lumigraph, Method, TriangulatedField};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Measures how many frames a graphics device draws a second.
#[derive(Parser)]
struct Args {
    /// How many photos
    #[arg(long, default_value_t = 100)]
    photos: usize,
    /// Of so many pixels
    #[arg(long, value_parser = size, default_value = "640x480")]
    photo_size: (u32, u32),
    /// What they show: plane, tunnel, hull
    #[arg(long, value_delimiter = ',', default_values_t = ["plane", "tunnel", "hull"].map(String::from))]
    proxies: Vec<String>,
    /// The pictures' size
    #[arg(long, value_parser = size, default_value = "1920x1080")]
    size: (u32, u32),
    /// Frames of the path
    #[arg(long, default_value_t = 600)]
    frames: usize,
    /// Threads that prepare frames [default: all but the readers and one]
    #[arg(long)]
    workers: Option<usize>,
    /// Threads that read pictures back
    #[arg(long, default_value_t = 2)]
    readers: usize,
    /// A file for the figures
    #[arg(long)]
    json: Option<PathBuf>,
    /// What cargo passes
    #[arg(long, hide = true)]
    bench: bool,
}

/// Frames that are waited for one by one.
const ALONE: usize = 40;

fn size(text: &str) -> Result<(u32, u32), String> {
    let sides = text.split_once('x').map(|(w, h)| (w.parse(), h.parse()));
    match sides {
        Some((Ok(width @ 1..), Ok(height @ 1..))) => Ok((width, height)),
        _ => Err("expected a size, as in 1920x1080".to_owned()),
    }
}

fn main() {
    let args = Args::parse();
    let mut gpu = match Gpu::open() {
        Ok(gpu) => gpu,
        Err(error) => return println!("{error}"),
    };
    let (width, height) = args.size;
    println!(
        "{}; {} photos; {width} × {height}",
        gpu.description(),
        args.photos
    );
    println!(
        "frame by frame: medians, ms wall (and of the CPU's in all); in flight: frames a second\n"
    );
    let stages = ["frame", "field", "load", "tell", "wait", "device", "CPU"];
    print!("{:8}", "proxy");
    stages.iter().for_each(|stage| print!("{stage:>8}"));
    println!(
        "{:>10}{:>8}{:>10}{:>8}{:>8}",
        "in turn", "rate", "CPU ms", "tell", "read"
    );
    let mut lines = Vec::new();
    for kind in [
        Surroundings::Plane,
        Surroundings::Tunnel,
        Surroundings::BALL,
    ] {
        if args.proxies.iter().any(|name| name == kind.name()) {
            lines.push(measure(&args, kind, &mut gpu));
        }
    }
    if let Some(file) = &args.json {
        let text = serde_json::to_string_pretty(&lines).expect("plain numbers");
        std::fs::write(file, text).unwrap_or_else(|e| println!("{}: {e}", file.display()));
    }
}

/// Small steps to and fro, and a turn of the head.
fn path(kind: Surroundings, args: &Args) -> Vec<View> {
    let view = desired(kind, args.size);
    let at = |i: usize| {
        let (sin, cos) = (0.02 * i as f64).sin_cos();
        let turned = Rigid3 {
            rotation: DQuat::from_rotation_y(0.05 * sin),
            translation: 0.1 * DVec3::new(cos, sin, 0.5 * sin),
        };
        View {
            camera_from_world: turned * view.camera_from_world,
            ..view.clone()
        }
    };
    (0..args.frames.max(ALONE)).map(at).collect()
}

fn measure(args: &Args, kind: Surroundings, gpu: &mut Gpu) -> Value {
    let lumigraph = lumigraph(kind, args.photos, args.photo_size);
    let path = path(kind, args);
    // Photos come to the device, and pipelines are made.
    for view in path.iter().step_by(10) {
        gpu.render(&prepare(&lumigraph, view), Method::TRIANGULATED)
            .expect("it draws");
    }
    let (alone, first) = one_by_one(&lumigraph, &path[..ALONE], gpu);
    print!("{:8}", kind.name());
    alone.iter().for_each(|ms| print!("{ms:>8.2}"));
    let waited: f64 = alone[..5].iter().sum();
    print!("{:>10.0}", 1e3 / waited);
    let flight = in_flight(args, &lumigraph, &path, gpu);
    assert!(flight.first == first, "frames in flight are others");
    let per_frame = |time: Duration| time.as_secs_f64() * 1e3 / path.len() as f64;
    let rate = 1e3 / per_frame(flight.wall);
    let [cpu, tell, read] = [flight.cpu, flight.tell, flight.read].map(per_frame);
    println!("{rate:>8.0}{cpu:>10.1}{tell:>8.2}{read:>8.2}");
    json!({
        "proxy": kind.name(), "photos": args.photos, "size": args.size, "device": gpu.description(),
        "alone_ms": {
            "frame": alone[0], "field": alone[1], "load": alone[2], "tell": alone[3], "wait": alone[4],
            "device": alone[5], "cpu": alone[6],
        },
        "frames_a_second": rate, "cpu_ms_a_frame": cpu, "tell_ms_a_frame": tell, "read_ms_a_frame": read,
    })
}

fn prepare<'a>(lumigraph: &'a Lumigraph, view: &View) -> Frame<'a> {
    Frame::new(lumigraph, view.clone(), FieldOptions::default())
}

fn field(frame: &Frame<'_>) -> TriangulatedField {
    let Method::Triangulated { cells_across } = Method::TRIANGULATED else {
        unreachable!("the default method is triangulated")
    };
    TriangulatedField::new(frame, cells_across).expect("the grid fits")
}

/// The stages' medians in milliseconds, what the device took and the CPU in all; and the first picture.
fn one_by_one(lumigraph: &Lumigraph, path: &[View], gpu: &mut Gpu) -> ([f64; 7], RgbaImage) {
    let mut times: [Vec<Duration>; 7] = Default::default();
    let mut first = None;
    let mut picture = RgbaImage::default();
    for view in path {
        let cpu = ProcessTime::now();
        let (frame, made) = timed(|| prepare(lumigraph, view));
        let (field, found) = timed(|| field(&frame));
        let (loaded, load) = timed(|| gpu.load(&frame, Some(&field)).expect("photos are made up"));
        let (drawing, told) = timed(|| gpu.begin(&frame, Some(&field), &loaded).expect("it draws"));
        let (device, waited) = timed(|| drawing.finish_into(&mut picture).expect("it draws"));
        let all = [
            made,
            found,
            load,
            told,
            waited,
            device.unwrap_or_default(),
            cpu.elapsed(),
        ];
        times
            .iter_mut()
            .zip(all)
            .for_each(|(times, time)| times.push(time));
        first.get_or_insert_with(|| picture.clone());
    }
    let medians = times.map(|mut times| {
        times.sort_unstable();
        times[times.len() / 2].as_secs_f64() * 1e3
    });
    (medians, first.expect("some frames"))
}

struct Flight {
    wall: Duration,
    cpu: Duration,
    /// Of the thread that loads and tells.
    tell: Duration,
    /// Of the threads that wait and read, together.
    read: Duration,
    first: RgbaImage,
}

fn in_flight(args: &Args, lumigraph: &Lumigraph, path: &[View], gpu: &mut Gpu) -> Flight {
    let readers = args.readers.max(1);
    let workers = args.workers.unwrap_or_else(|| {
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        threads.saturating_sub(readers + 1)
    });
    let workers = workers.max(1);
    let next = AtomicUsize::new(0);
    let (prepared, coming) = sync_channel(workers);
    let (begun, drawings) = sync_channel::<(usize, Drawing)>(readers);
    let drawings = Mutex::new(drawings);
    let (wall, cpu) = (Instant::now(), ProcessTime::now());
    let mut tell = Duration::ZERO;
    let (read, first) = std::thread::scope(|scope| {
        for _ in 0..workers {
            let (next, prepared) = (&next, prepared.clone());
            scope.spawn(move || work(lumigraph, path, next, &prepared));
        }
        drop(prepared);
        let readers: Vec<_> = (0..readers)
            .map(|_| scope.spawn(|| read(&drawings)))
            .collect();
        // In the path's order.
        let mut waiting = BTreeMap::new();
        for i in 0..path.len() {
            let (frame, field) = loop {
                if let Some(there) = waiting.remove(&i) {
                    break there;
                }
                let (at, frame, field) = coming.recv().expect("all frames come");
                waiting.insert(at, (frame, field));
            };
            let (drawing, time) = timed(|| {
                let loaded = gpu.load(&frame, Some(&field)).expect("photos are made up");
                gpu.begin(&frame, Some(&field), &loaded).expect("it draws")
            });
            tell += time;
            begun.send((i, drawing)).expect("readers wait");
        }
        drop(begun);
        let read: Vec<_> = readers
            .into_iter()
            .map(|r| r.join().expect("it reads"))
            .collect();
        let first = read.iter().find_map(|(_, first)| first.clone());
        (read.iter().map(|(time, _)| *time).sum(), first)
    });
    Flight {
        wall: wall.elapsed(),
        cpu: cpu.elapsed(),
        tell,
        read,
        first: first.expect("some frames"),
    }
}

type Prepared<'a> = (usize, Frame<'a>, TriangulatedField);

/// Prepares frames, one at a time and each on this thread alone: there are enough of them.
fn work<'a>(
    lumigraph: &'a Lumigraph,
    path: &[View],
    next: &AtomicUsize,
    prepared: &SyncSender<Prepared<'a>>,
) {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .use_current_thread();
    let pool = pool.build().expect("a pool of this thread");
    loop {
        let i = next.fetch_add(1, Ordering::Relaxed);
        let Some(view) = path.get(i) else { return };
        let (frame, field) = pool.install(|| {
            let frame = prepare(lumigraph, view);
            let field = field(&frame);
            (frame, field)
        });
        if prepared.send((i, frame, field)).is_err() {
            return;
        }
    }
}

/// Reads pictures back; how long that took, and the path's first, if it was among them.
fn read(drawings: &Mutex<Receiver<(usize, Drawing)>>) -> (Duration, Option<RgbaImage>) {
    let mut picture = RgbaImage::default();
    let (mut time, mut first) = (Duration::ZERO, None);
    loop {
        let drawing = drawings
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .recv();
        let Ok((i, drawing)) = drawing else {
            return (time, first);
        };
        let (read, took) = timed(|| drawing.finish_into(&mut picture));
        read.expect("it draws");
        time += took;
        if i == 0 {
            first = Some(picture.clone());
        }
    }
}

fn timed<T>(work: impl FnOnce() -> T) -> (T, Duration) {
    let start = Instant::now();
    let made = work();
    (made, start.elapsed())
}
