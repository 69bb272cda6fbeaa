//! Layered depth images: `cargo bench --bench ldi [-- --rooms 6 --sides 6 --repeats 9 --json FILE]`;
//! see README.md.
//!
//! 1. Making LDIs of 13 images of 256 × 256: time, samples, layers.
//! 2. Drawing them at 640 × 512, the whole portal in sight: in order by stamp and in any order, CPU
//!    time on one thread, and wall time on one and two.
//! 3. Fragments: how alike they are, and what buffer zones draw twice.
//! 4. Clipping: time and what is kept.

use calibrate::{Lens, View};
use clap::Parser;
use cpu_time::ProcessTime;
use datasets::house::{self, HouseOptions};
use glam::DVec2;
use proxy::interior::{Contents, SemicircleOptions, SemicircleView, semicircles, visible};
use render::gpu::{DeviceLimits, GpuWarp};
use render::interior::{CellGeometry, Pinhole, Reference, Target, Window};
use render::ldi::{
    ClipTree, Clipped, ConstructOptions, Free, FreeOptions, Layered, Ordered, OrderedOptions,
    Stamp, construct, free, layers, ordered,
};
use serde_json::{Value, json};
use std::path::PathBuf;
use std::time::Instant;

/// Measures layered depth images.
#[derive(Parser)]
struct Args {
    /// Rooms of the house
    #[arg(long, default_value_t = 6)]
    rooms: usize,
    /// Portals' sides looked through
    #[arg(long, default_value_t = 6)]
    sides: usize,
    /// Of each time the least of so many counts
    #[arg(long, default_value_t = 9)]
    repeats: usize,
    /// Also draw with whatever graphics driver there is
    #[arg(long)]
    gpu: bool,
    /// Where to write the numbers, too
    #[arg(long)]
    json: Option<PathBuf>,
    /// What cargo passes
    #[arg(long, hide = true)]
    bench: bool,
}

const SIZE: [u32; 2] = [640, 512];
const ANGLES: [f64; 3] = [0.0, 30.0, 60.0];
const STAMPS: [(&str, Stamp); 5] = [
    ("1 x 1", Stamp::One),
    ("five", Stamp::Five),
    ("2 x 2", Stamp::Two),
    ("3 x 3", Stamp::Three),
    ("sized, alpha", Stamp::Sized),
];

/// An LDI, a camera before it and what it sees of the portal.
struct Look {
    ldi: usize,
    camera: Pinhole,
    window: Window,
}

fn main() {
    let args = Args::parse();
    let options = HouseOptions {
        rooms: args.rooms,
        ..HouseOptions::default()
    };
    let house = house::house(&options).expect("a house");
    let interior = &house.interior;
    let (contents, _) = Contents::new(interior, &house.model).expect("contents");
    let geometry = CellGeometry::new(&house.model, &contents);
    let places = semicircles(interior, &contents, &SemicircleOptions::default());
    let step = (places.len() / 13).div_ceil(args.sides.max(1)).max(1);
    let mut ldis: Vec<(Layered, ClipTree)> = Vec::new();
    let mut looks: Vec<Look> = Vec::new();
    let mut made_s: Vec<f64> = Vec::new();
    let mut table = [0.0; 5];
    println!(
        "{:<6} {:>10} {:>9} {:>8} {:>7} {:>7} {:>7} {:>7} {:>7}",
        "side", "size", "samples", "made ms", "1 %", "2 %", "3 %", "4+ %", "2-3 %"
    );
    for (i, side) in places.chunks(13).enumerate().step_by(step) {
        let make = |place| Reference::new(interior, &house.model, &geometry, place, [256; 2]);
        let images: Vec<Reference> = side.iter().map(make).collect();
        let images: Vec<&Reference> = images.iter().collect();
        let mut least = f64::INFINITY;
        let mut ldi = None;
        for _ in 0..args.repeats.max(1) {
            let start = ProcessTime::now();
            let made = construct(&images, &ConstructOptions::default()).expect("an LDI");
            least = least.min(start.elapsed().as_secs_f64());
            ldi = Some(made.ldi);
        }
        let ldi = ldi.expect("made at least once");
        made_s.push(least);
        let found = layers(&ldi);
        let shares =
            [(1, 1), (2, 2), (3, 3), (4, 255), (2, 3)].map(|(a, b)| 100.0 * found.share(a, b));
        let [width, height] = ldi.size();
        let size = format!("{width} x {height}");
        let [a, b, c, d, e] = shares;
        println!(
            "{i:<6} {size:>10} {:>9} {:>8.0} {a:>7.1} {b:>7.1} {c:>7.1} {d:>7.1} {e:>7.1}",
            ldi.len(),
            1e3 * least
        );
        table
            .iter_mut()
            .zip(shares)
            .for_each(|(sum, share)| *sum += share);
        let tree = ClipTree::new(&ldi);
        ldis.push((ldi, tree));
        looks.extend(
            before(&house, &contents, &side[0])
                .into_iter()
                .map(|(camera, window)| Look {
                    ldi: ldis.len() - 1,
                    camera,
                    window,
                }),
        );
    }
    let count = ldis.len() as f64;
    let table = table.map(|sum| sum / count);
    println!(
        "mean: 1 {:.1}, 2-3 {:.1}, 4+ {:.1} %\n",
        table[0], table[4], table[3]
    );
    let pool = |threads| {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("threads")
    };
    let pools = [pool(1), pool(2)];
    // Least CPU and wall ms of a drawing, the mean of all looks; wall on one thread and on two.
    let timed = |draw: &mut dyn FnMut(&Look)| {
        let mut sums = [0.0; 3];
        for look in &looks {
            let mut least = [f64::INFINITY; 3];
            for _ in 0..args.repeats.max(1) {
                let (cpu, wall) = (ProcessTime::now(), Instant::now());
                draw(look);
                let times = [cpu.elapsed(), wall.elapsed()].map(|t| 1e3 * t.as_secs_f64());
                least = [least[0].min(times[0]), least[1].min(times[1]), 0.0];
            }
            sums.iter_mut()
                .zip(least)
                .for_each(|(sum, t)| *sum += t / looks.len() as f64);
        }
        sums
    };
    // As far as samples in any order are drawn.
    let reach = f64::from(FreeOptions::default().reach());
    let mut scratch = Ordered::default();
    let mut loose = Free::default();
    let mut target = Target::default();
    let mut free_target = Target::default();
    let mut rows: Vec<Value> = Vec::new();
    println!("{} views of {} x {}", looks.len(), SIZE[0], SIZE[1]);
    println!(
        "{:<24} {:>9} {:>9} {:>9} {:>9} {:>9}",
        "", "1: CPU ms", "1: wall", "2: CPU", "2: wall", "speed-up"
    );
    let mut line = |name: &str, one: [f64; 3], two: [f64; 3]| {
        println!(
            "{name:<24} {:>9.2} {:>9.2} {:>9.2} {:>9.2} {:>9.2}",
            one[0],
            one[1],
            two[0],
            two[1],
            one[1] / two[1]
        );
        rows.push(json!({"name": name, "cpu_ms": one[0], "wall_ms": one[1], "two_cpu_ms": two[0], "two_wall_ms": two[1]}));
    };
    let mut draw = |look: &Look, stamp: Stamp, fragments: usize| {
        let (ldi, _) = &ldis[look.ldi];
        target.clear(SIZE[0], SIZE[1]);
        ordered(
            ldi,
            &Clipped::whole(ldi),
            &look.camera,
            &look.window,
            &OrderedOptions { stamp, fragments },
            &mut scratch,
            &mut target,
        )
    };
    for (name, stamp) in STAMPS {
        let [one, two] = [(0, 1), (1, 8)].map(|(k, fragments)| {
            pools[k].install(|| {
                timed(&mut |look| {
                    draw(look, stamp, fragments);
                })
            })
        });
        line(&format!("in order, {name}"), one, two);
    }
    for clip in [false, true] {
        let [one, two] = [0, 1].map(|k| {
            pools[k].install(|| {
                timed(&mut |look| {
                    let (ldi, tree) = &ldis[look.ldi];
                    let columns = match clip {
                        false => Clipped::whole(ldi),
                        true => tree.columns(ldi, &look.camera, &look.window, reach),
                    };
                    free_target.clear(SIZE[0], SIZE[1]);
                    let options = FreeOptions::default();
                    free(
                        ldi,
                        &columns,
                        &look.camera,
                        &look.window,
                        &options,
                        &mut loose,
                        &mut free_target,
                    );
                })
            })
        });
        line(
            if clip {
                "in any order, clipped"
            } else {
                "in any order"
            },
            one,
            two,
        );
    }
    let warp = args
        .gpu
        .then(|| GpuWarp::open(&DeviceLimits::default(), false));
    match warp {
        Some(Ok(mut warp)) => {
            let [cpu, wall, _] = timed(&mut |look| {
                let (ldi, tree) = &ldis[look.ldi];
                let (camera, window) = (&look.camera, &look.window);
                let columns = tree.columns(ldi, camera, window, reach);
                free_target.clear(SIZE[0], SIZE[1]);
                let options = FreeOptions::default();
                let into = &mut free_target;
                warp.free(ldi, &columns, camera, window, &options, into)
                    .expect("it draws");
            });
            println!(
                "in any order, clipped, by {}: {cpu:.2} CPU ms, {wall:.2} wall",
                warp.description()
            );
            rows.push(json!({"name": "in any order, device", "cpu_ms": cpu, "wall_ms": wall}));
        }
        Some(Err(error)) => println!("graphics: {error}"),
        None => {}
    }
    // Fragments, by count.
    println!(
        "\n{:<10} {:>12} {:>12} {:>9} {:>9} {:>9}",
        "fragments", "least area", "most area", "buffer %", "again %", "CPU ms"
    );
    let mut fragments_rows: Vec<Value> = Vec::new();
    for fragments in [1, 2, 4, 8, 16, 32, 64] {
        // Of the mean area.
        let [mut least, mut most, mut buffer, mut again] = [0.0; 4];
        for look in &looks {
            let cost = draw(look, Stamp::Five, fragments);
            let mean = cost.samples as f64 / cost.areas.len() as f64;
            let share = 1.0 / looks.len() as f64;
            let area = |n: Option<&usize>| n.map_or(0.0, |n| *n as f64 / mean) * share;
            least += area(cost.areas.iter().min());
            most += area(cost.areas.iter().max());
            buffer += 100.0 * cost.buffer as f64 / cost.drawn.max(1) as f64 * share;
            again += 100.0 * cost.again as f64 / cost.drawn.max(1) as f64 * share;
        }
        let [cpu, ..] = pools[0].install(|| {
            timed(&mut |look| {
                draw(look, Stamp::Five, fragments);
            })
        });
        println!(
            "{fragments:<10} {least:>12.3} {most:>12.3} {buffer:>9.1} {again:>9.1} {cpu:>9.2}"
        );
        fragments_rows.push(json!({"fragments": fragments, "least_area": least, "most_area": most, "buffer_percent": buffer, "again_percent": again, "cpu_ms": cpu}));
    }
    // Clipping.
    let clipped = |look: &Look| {
        let (ldi, tree) = &ldis[look.ldi];
        tree.columns(ldi, &look.camera, &look.window, reach)
    };
    let mut any_left = true;
    let clip = timed(&mut |look| any_left &= !clipped(look).is_empty());
    assert!(any_left, "a whole portal is in sight");
    let share = |look: &Look| {
        let (ldi, _) = &ldis[look.ldi];
        100.0 * clipped(look).samples(ldi) as f64 / ldi.len() as f64
    };
    let shares: Vec<f64> = looks.iter().map(share).collect();
    let mean = shares.iter().sum::<f64>() / shares.len() as f64;
    let worst = shares.iter().copied().fold(0.0, f64::max);
    println!(
        "\nclipping: {:.3} ms, whole portals keep {mean:.1} %, at worst {worst:.1} %",
        clip[1]
    );
    if let Some(file) = &args.json {
        let all = json!({"made_s": made_s, "layers_percent": table, "draw": rows, "fragments": fragments_rows,
            "clip_ms": clip[1], "clip_kept_percent": mean, "clip_worst_percent": worst});
        std::fs::write(
            file,
            serde_json::to_string_pretty(&all).expect("plain numbers"),
        )
        .expect("writable");
    }
}

/// Cameras at 1.25 radii before a portal that see all of it.
fn before(
    house: &house::House,
    contents: &Contents,
    place: &SemicircleView,
) -> Vec<(Pinhole, Window)> {
    let mut wide = house.interior.clone();
    for portal in &mut wide.portals {
        portal.radius = Some(1.25 * portal.semicircle_radius(wide.up));
    }
    let size = DVec2::from(SIZE.map(f64::from));
    let mut found = Vec::new();
    for angle in ANGLES {
        let options = SemicircleOptions {
            views: if angle > 0.0 { 3 } else { 1 },
            span: (2.0 * angle).to_radians(),
        };
        let all = semicircles(&wide, contents, &options);
        let is_meant = |p: &&SemicircleView| {
            (p.portal, p.from) == (place.portal, place.from)
                && (p.angle.to_degrees() - angle).abs() < 1e-6
        };
        for p in all.iter().filter(is_meant) {
            let view = View {
                lens: Lens::pinhole(DVec2::splat(0.7 * size.x), 0.5 * size),
                width: SIZE[0],
                height: SIZE[1],
                camera_from_world: p.camera_from_world,
            };
            let camera = Pinhole::new(&view).expect("a pinhole");
            let visibility = visible(&house.interior, p.from, &view);
            let passes = visibility.passes.iter();
            let mut passes = passes.filter(|pass| pass.depth == 0 && pass.portal == p.portal);
            if let Some(pass) = passes.next() {
                let window = Window::of(&pass.region, &camera);
                found.push((camera, window));
            }
        }
    }
    found
}
