//! Walks through interiors: `cargo bench --bench walk [-- --house FILE.glb --outlines ROOMS.json]`;
//! see README.md.
//!
//! 1. A tour of a house of Brooks House's size (Rafferty et al. 1998) at 15 frames a second, frames drawn once
//!    each as they come: which are late, with LDIs of all views and of the nearest, made ahead or not.
//! 2. CPU time of each of its frames, by what portals are filled with.
//! 3. How far what portals show is from the truth, off their axis.

use calibrate::{Camera, Lens, Rigid3, View};
use clap::Parser;
use cpu_time::ProcessTime;
use datasets::house::{self, House, HouseOptions};
use glam::DVec2;
use image::RgbaImage;
use lumigraph::bench::before_doorways;
use proxy::interior::{Contents, Interior, SemicircleOptions, SemicircleView, read_rooms};
use proxy::mesh::{Model, read_model};
use render::DeviceChoice;
use render::interior::{
    CellGeometry, DrawOptions, FrameCost, Painter, Pinhole, PortalFill, Raster, Target, Tour, Walk,
    WalkOptions, Window,
};
use render::path::PathFrame;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Measures walks through interiors.
#[derive(Parser)]
struct Args {
    /// Rooms of the house walked through
    #[arg(long, default_value_t = 19)]
    rooms: usize,
    /// Its triangles
    #[arg(long, default_value_t = 1_744_000)]
    triangles: usize,
    /// Frames of the tour; 0 leaves it out
    #[arg(long, default_value_t = 520)]
    frames: usize,
    /// A model whose portals are looked through, too
    #[arg(long, requires = "outlines")]
    house: Option<PathBuf>,
    /// Its rooms and openings
    #[arg(long)]
    outlines: Option<PathBuf>,
    /// Only what portals are filled with in these ways, of the tour alone: culling, geometry, …, ldi near
    #[arg(long, value_delimiter = ',')]
    only: Vec<String>,
    /// How often each of the tour's frames is drawn; the least of its times counts
    #[arg(long, default_value_t = 3)]
    times: usize,
    /// Only this of the tour's frames, from 0 on: for profiles
    #[arg(long, value_name = "N")]
    frame: Option<usize>,
    /// Draw the tour's geometry with whatever graphics driver there is
    #[arg(long)]
    gpu: bool,
    /// What cargo passes
    #[arg(long, hide = true)]
    bench: bool,
}

const SIZE: [u32; 2] = [640, 512];
/// Frames a second.
const FPS: f64 = 15.0;
/// Views that LDIs are made of where those nearest to the viewer are taken.
const NEAREST: usize = 3;
const ANGLES: [f64; 5] = [0.0, 15.0, 30.0, 45.0, 60.0];

fn lens() -> Lens {
    let size = DVec2::new(f64::from(SIZE[0]), f64::from(SIZE[1]));
    Lens::pinhole(DVec2::splat(0.7 * size.x), 0.5 * size)
}

fn main() {
    let args = Args::parse();
    if args.frames > 0 {
        tours(&args);
    }
    if !args.only.is_empty() {
        return;
    }
    let options = HouseOptions {
        rooms: 6,
        ..HouseOptions::default()
    };
    let small = house::house(&options).expect("a house");
    let truth = |view: &View| house::render(&small, view).0;
    through_doors(
        "procedural house, 6 rooms",
        &small.interior,
        &small.model,
        truth,
    );
    if let (Some(file), Some(outlines)) = (&args.house, &args.outlines) {
        let (model, _) = read_model(file).expect("a model");
        let given = read_rooms(outlines, "house.glb", 1.0).expect("its rooms");
        let interior = given.interior;
        let all: Vec<u32> = (0..model.mesh.triangles.len() as u32).collect();
        let all = CellGeometry::of(&model, &all);
        let truth = |view: &View| {
            let camera = Pinhole::new(view).expect("a pinhole");
            let mut raster = Raster::default();
            raster.clear(&camera);
            let window = Window::whole(SIZE[0], SIZE[1]);
            raster.draw(&[(all.all(), window)], &camera, &DrawOptions::default());
            let mut target = Target::new(SIZE[0], SIZE[1]);
            raster.shade(&model, &camera, &mut target, |_, _| true);
            target.picture()
        };
        through_doors("house.glb", &interior, &model, truth);
    }
}

/// A frame's CPU and wall time in ms, reference images made before: the least of some. And how long
/// making them took.
fn timed(
    walk: &mut Walk<'_>,
    view: &View,
    fill: PortalFill,
    times: usize,
) -> ([f64; 2], FrameCost, Duration) {
    let mut least: Option<([f64; 2], FrameCost)> = None;
    let mut made = Duration::ZERO;
    let mut left = times.max(1);
    while left > 0 {
        let (cpu, wall) = (ProcessTime::now(), Instant::now());
        let cost = walk.draw(view, fill).expect("a pinhole");
        let took = [cpu.elapsed(), wall.elapsed()].map(|t| 1e3 * t.as_secs_f64());
        if cost.references_made + cost.ldis_made > 0 {
            made += cost.references;
            continue;
        }
        left -= 1;
        if least.as_ref().is_none_or(|(least, _)| took[0] < least[0]) {
            least = Some((took, cost));
        }
    }
    let (times, cost) = least.expect("it was drawn");
    (times, cost, made)
}

fn tours(args: &Args) {
    let start = Instant::now();
    let options = HouseOptions {
        rooms: args.rooms,
        triangles: Some(args.triangles),
        seed: 1,
    };
    let house = house::house(&options).expect("a house");
    let (contents, _) = Contents::new(&house.interior, &house.model).expect("contents");
    println!(
        "{} rooms, {} portals, {} triangles; made in {:.1} s",
        house.interior.cells.len(),
        house.interior.portals.len(),
        house.model.mesh.triangles.len(),
        start.elapsed().as_secs_f64()
    );
    let camera = Camera::of(&lens(), SIZE[0], SIZE[1]);
    let mut path = Tour::new(
        &house.interior,
        &contents,
        &house.model,
        &camera,
        args.frames,
        FPS,
    )
    .expect("a tour")
    .path;
    if let Some(frame) = args.frame {
        path.frames = vec![path.frames[frame].clone()];
    }
    let device = match args.gpu {
        true => DeviceChoice::Gpu,
        false => DeviceChoice::Cpu,
    };
    if args.only.is_empty() && args.frame.is_none() {
        paced(device, &house, &contents, &path.frames);
    }
    println!(
        "\n{:<10} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8} {:>10} {:>9} {:>8} {:>7} {:>9} {:>9}",
        "portals",
        "median",
        "95 %",
        "worst",
        "at worst",
        "speed-up",
        "up to",
        "overall",
        "triangles",
        "samples",
        "holes %",
        "images",
        "images s",
        "wall, med"
    );
    let mut culling: Vec<f64> = Vec::new();
    let whole = ("culling", PortalFill::Geometry, true, None);
    let others = PortalFill::ALL.map(|fill| (fill.name(), fill, false, None));
    let nearest = ("ldi near", PortalFill::Ldi, false, Some(NEAREST));
    for (name, fill, whole_cells, ldi_views) in [whole].into_iter().chain(others).chain([nearest]) {
        // Culling is what the others are compared with.
        if !(whole_cells || args.only.is_empty() || args.only.iter().any(|only| only == name)) {
            continue;
        }
        let mut options = WalkOptions {
            whole_cells,
            ..WalkOptions::default()
        };
        options.library.ldi_views = ldi_views;
        let painter = Painter::open(device, &house.model);
        let (interior, model) = (&house.interior, &house.model);
        let mut walk = Walk::with(painter, interior, &contents, model, options);
        let mut made = Duration::ZERO;
        let draw = |frame: &PathFrame| {
            let (times, cost, took) = timed(&mut walk, &frame.view, fill, args.times);
            made += took;
            (times, cost)
        };
        let frames: Vec<([f64; 2], FrameCost)> = path.frames.iter().map(draw).collect();
        let images_s = made.as_secs_f64();
        let cpu: Vec<f64> = frames.iter().map(|(t, _)| t[0]).collect();
        if whole_cells {
            culling.clone_from(&cpu);
        }
        let worst = (0..cpu.len())
            .max_by(|a, b| culling[*a].total_cmp(&culling[*b]))
            .unwrap_or(0);
        let mean = |of: &dyn Fn(&FrameCost) -> usize| {
            frames.iter().map(|(_, c)| of(c)).sum::<usize>() as f64 / frames.len() as f64
        };
        let ratios = culling.iter().zip(&cpu).map(|(a, b)| a / b);
        let most_gained = ratios.fold(0.0, f64::max);
        let overall = culling.iter().sum::<f64>() / cpu.iter().sum::<f64>();
        let wall: Vec<f64> = frames.iter().map(|(t, _)| t[1]).collect();
        let [median, most, greatest] = spread(&cpu);
        println!(
            "{:<10} {median:>8.1} {most:>8.1} {greatest:>8.1} {:>8.1} {:>8.2} {most_gained:>8.2} {overall:>8.2} {:>10.0} {:>9.0} {:>8.2} {:>7} {:>9.1} {:>9.1}",
            name,
            cpu[worst],
            culling[worst] / cpu[worst],
            mean(&|c| c.triangles_tried),
            mean(&|c| c.samples),
            100.0 * mean(&|c| c.holes) / f64::from(SIZE[0] * SIZE[1]),
            walk.library().residency().loads,
            images_s,
            spread(&wall)[0],
        );
        let at = |of: fn(&FrameCost) -> Duration| {
            let times: Vec<f64> = frames
                .iter()
                .map(|(_, c)| 1e3 * of(c).as_secs_f64())
                .collect();
            let [median, _, greatest] = spread(&times);
            format!("{median:.1} / {greatest:.1} / {:.1}", times[worst])
        };
        println!(
            "           wall, median / worst / at worst (frame {worst}): visible {}, fills {}, triangles {}, colours {}",
            at(|c| c.visibility),
            at(|c| c.fill),
            at(|c| c.geometry),
            at(|c| c.shade),
        );
    }
}

/// Frames as they come, at their rate: how long what is asked for takes, images and LDIs included.
fn paced(device: DeviceChoice, house: &House, contents: &Contents, frames: &[PathFrame]) {
    println!(
        "\nat {FPS} frames a second: wall ms of a frame with all it needs, and what it waited for"
    );
    println!(
        "{:<10} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8} {:>9} {:>9} {:>10}",
        "portals",
        "median",
        "95 %",
        "worst",
        "late",
        "LDIs",
        "ahead",
        "waits",
        "waited ms",
        "stall ms",
        "CPU s, all"
    );
    let modes = [("ldi", None, false), ("ldi near", Some(NEAREST), false)];
    for (name, views, is_ahead) in modes.into_iter().chain([("ahead", Some(NEAREST), true)]) {
        let mut options = WalkOptions::default();
        options.library.ldi_views = views;
        let start = ProcessTime::now();
        let (walls, costs): (Vec<f64>, Vec<FrameCost>) = std::thread::scope(|scope| {
            let painter = Painter::open(device, &house.model);
            let mut walk = Walk::with(painter, &house.interior, contents, &house.model, options);
            if is_ahead {
                walk.make_ahead(scope).expect("a thread");
            }
            let draw = |frame: &PathFrame| {
                let start = Instant::now();
                let cost = walk.draw(&frame.view, PortalFill::Ldi).expect("a pinhole");
                let took = start.elapsed();
                let left = Duration::from_secs_f64(1.0 / FPS).saturating_sub(took);
                std::thread::sleep(left);
                (1e3 * took.as_secs_f64(), cost)
            };
            frames.iter().map(draw).unzip()
        });
        let [median, most, worst] = spread(&walls);
        let late = walls.iter().filter(|wall| **wall > 1e3 / FPS).count();
        let sum = |of: &dyn Fn(&FrameCost) -> f64| costs.iter().map(of).sum::<f64>();
        println!(
            "{name:<10} {median:>8.1} {most:>8.1} {worst:>8.1} {late:>8} {:>8} {:>8} {:>8} {:>9.0} {:>9.0} {:>10.1}",
            sum(&|c| c.ldis_made as f64),
            sum(&|c| c.ldis_ahead as f64),
            sum(&|c| f64::from(u8::from(!c.waited.is_zero()))),
            sum(&|c| 1e3 * c.waited.as_secs_f64()),
            sum(&|c| 1e3 * c.references.as_secs_f64()),
            start.elapsed().as_secs_f64(),
        );
    }
}

fn spread(values: &[f64]) -> [f64; 3] {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    [0.5, 0.95, 1.0].map(|share| {
        let i = (share * sorted.len() as f64).ceil() as usize;
        sorted[i.saturating_sub(1)]
    })
}

/// Looks through every portal from 1.25 radii off, at some angles.
fn through_doors(
    name: &str,
    interior: &Interior,
    model: &Model,
    truth: impl Fn(&View) -> RgbaImage,
) {
    let (contents, _) = Contents::new(interior, model).expect("contents");
    let mut walk = Walk::new(interior, &contents, model, WalkOptions::default());
    println!("\n{name}: dB in the portal's pixels, % of them holes");
    println!(
        "{:<6} {:>6} {}",
        "angle",
        "views",
        PortalFill::ALL
            .map(|f| format!("{:>20}", f.name()))
            .concat()
    );
    for angle in ANGLES {
        let options = SemicircleOptions {
            views: if angle > 0.0 { 3 } else { 1 },
            span: (2.0 * angle).to_radians(),
        };
        let places = before_doorways(interior, &contents, 1.25, &options);
        let is_meant =
            |place: &&SemicircleView| (place.angle.abs().to_degrees() - angle).abs() < 1e-6;
        // Squared error, pixels and holes.
        let mut sums = [[0.0; 3]; PortalFill::ALL.len()];
        let mut views = 0;
        for place in places.iter().filter(is_meant) {
            let view = View {
                lens: lens(),
                width: SIZE[0],
                height: SIZE[1],
                camera_from_world: place.camera_from_world,
            };
            let expected = truth(&view);
            let pixels = inside(interior, place, &view);
            views += 1;
            for (k, fill) in PortalFill::ALL.into_iter().enumerate() {
                walk.draw(&view, fill).expect("a pinhole");
                let picture = walk.picture();
                for &i in &pixels {
                    let (ours, theirs) = (picture.color[i], expected.as_raw());
                    let error = |c: usize| {
                        let d = f64::from(ours[c]) - f64::from(theirs[4 * i + c]);
                        d * d
                    };
                    sums[k][0] += (error(0) + error(1) + error(2)) / 3.0;
                    sums[k][1] += 1.0;
                    sums[k][2] += f64::from(u8::from(ours[3] == 0 && theirs[4 * i + 3] > 0));
                }
            }
        }
        let text = |[error, count, holes]: [f64; 3]| {
            let psnr = 10.0 * (255.0 * 255.0 / (error / count)).log10();
            format!("{psnr:>10.2} {:>8.2}%", 100.0 * holes / count)
        };
        println!("{angle:<6} {views:>6} {}", sums.map(text).concat());
    }
}

/// The pixels through which one sees a portal's opening.
fn inside(interior: &Interior, place: &SemicircleView, view: &View) -> Vec<usize> {
    let polygon = &interior.portal(place.portal).polygon;
    let camera = Pinhole::new(view).expect("a pinhole");
    let eye = view.center();
    let world: Rigid3 = view.camera_from_world.inverse();
    let is_in = |i: &usize| {
        let (x, y) = (*i as u32 % SIZE[0], *i as u32 / SIZE[0]);
        let ray = world.rotation * camera.ray(x, y);
        let along = -polygon.height(eye) / polygon.normal().dot(ray);
        along > 0.0 && polygon.covers(eye + along * ray, 0.0)
    };
    (0..(SIZE[0] * SIZE[1]) as usize).filter(is_in).collect()
}
