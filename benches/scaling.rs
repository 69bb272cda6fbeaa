//! A frame's time by stage against the number of photos: `cargo bench --bench scaling
//! [-- --photos N,N… --proxies NAME,NAME… --alone field|cpu|exact --json FILE --gpu]`; see README.md.

use calibrate::{Lens, Pixel, Rigid3, View};
use cpu_time::ProcessTime;
use glam::{DVec2, DVec3, Vec3Swizzles};
use image::RgbaImage;
use proxy::{Mesh, MeshKind, Plane, Proxy, Solid};
use render::cpu::Cpu;
use render::gpu::Gpu;
use render::score::score;
use render::{
    FieldOptions, Frame, Lumigraph, Method, PhotoStore, SourceView, TriangulatedField, Visibility,
};
use serde_json::json;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Of the photos.
const PHOTO: (u32, u32) = (320, 240);
/// Interleaved repeats, of which the median counts.
const REPEATS: usize = 5;
/// More photos than this would fill the memory with the distances they see.
const MOST_OCCLUDED: usize = 10_000;
/// Above this, the exact picture is not drawn.
const MOST_EXACT: usize = 10_000;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let value = |name: &str| {
        let at = arguments.iter().position(|a| a == name)?;
        arguments.get(at + 1).cloned()
    };
    let counts: Vec<usize> = value("--photos").map_or_else(
        || vec![10, 100, 1_000, 10_000, 100_000],
        |list| list.split(',').filter_map(|n| n.parse().ok()).collect(),
    );
    let mut gpu = arguments
        .iter()
        .any(|a| a == "--gpu")
        .then(Gpu::open)
        .and_then(Result::ok);

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
    let asked = value("--proxies");
    let is_asked = |kind: &&str| {
        let asked = asked.as_ref();
        asked.is_none_or(|list| list.split(',').any(|name| name == *kind))
    };
    for kind in ["plane", "tunnel", "hull"].into_iter().filter(is_asked) {
        for size in [(960, 720), (1920, 1080)] {
            for &count in &counts {
                if kind == "hull" && count > MOST_OCCLUDED {
                    continue;
                }
                let lumigraph = lumigraph(kind, count);
                let desired = desired(kind, size);
                if let Some(stage) = value("--alone") {
                    alone(&stage, kind, &lumigraph, &desired);
                    continue;
                }
                lines.push(measure(kind, &lumigraph, &desired, &mut gpu));
            }
        }
    }
    if let Some(file) = value("--json") {
        let text = serde_json::to_string_pretty(&lines).expect("plain numbers");
        std::fs::write(&file, text).unwrap_or_else(|e| println!("{file}: {e}"));
    }
}

/// Evenly in −1…1: the fractional parts of multiples of an irrational number.
fn spread(i: usize, step: f64) -> f64 {
    2.0 * ((i + 1) as f64 * step).fract() - 1.0
}

/// Places around the origin, spread like photos held by hand: more across than ahead.
fn place(i: usize) -> DVec3 {
    let [x, y, z] = [0.819_172_513_4, 0.671_043_606_7, 0.549_700_477_9].map(|s| spread(i, s));
    DVec3::new(x, 0.6 * y, 0.3 * z)
}

/// A photo set that looks along z, or of the hull, from all around.
fn lumigraph(kind: &str, count: usize) -> Lumigraph {
    let pose = |i: usize| {
        let v = place(i);
        let target = 0.3 * DVec3::new(spread(i, 0.381_966), spread(i, 0.267_949), 0.0);
        match kind {
            "hull" => {
                // As many from every side.
                let (cos, around) = (v.x, std::f64::consts::TAU * spread(i, 0.754_877_666_2));
                let aside = (1.0 - cos * cos).sqrt();
                let direction = DVec3::new(aside * around.cos(), aside * around.sin(), cos);
                let center = direction * (3.0 + 0.5 * v.z);
                Rigid3::looking_at(center, 0.3 * target, DVec3::Y)
            }
            "tunnel" => {
                let center = DVec3::new(0.3 * v.x, 0.3 * v.y, 10.0 * v.z);
                Rigid3::looking_at(center, center + DVec3::Z + target, DVec3::Y)
            }
            _ => Rigid3::looking_at(v, v + DVec3::Z + 0.5 * target, DVec3::Y),
        }
    };
    let (width, height) = PHOTO;
    let size = DVec2::new(f64::from(width), f64::from(height));
    let lens = Lens::pinhole(DVec2::splat(0.8 * size.x), 0.5 * size);
    let source = |i: usize| SourceView {
        name: format!("{i}"),
        view: View {
            lens,
            width,
            height,
            camera_from_world: pose(i),
        },
        gain: [1.0; 3],
        time_s: None,
    };
    let sources: Vec<SourceView> = (0..count).map(source).collect();
    let proxy = match kind {
        "hull" => Proxy::Mesh(Arc::new(Solid::new(MeshKind::Hull, globe(16, 16)))),
        "tunnel" => Proxy::Mesh(Arc::new(Solid::new(MeshKind::Tunnel, hallway()))),
        _ => Proxy::Plane(Plane::new(DVec3::Z * 4.0, DVec3::NEG_Z).expect("finite")),
    };
    Lumigraph {
        points: Vec::new(),
        visibility: Visibility::of(&proxy, &sources),
        photos: {
            let views: Vec<View> = sources.iter().map(|s| s.view.clone()).collect();
            let proxy = proxy.clone();
            PhotoStore::new(count, move |i| Ok(photo(&views[i], &proxy)))
        },
        sources,
        proxy,
    }
}

/// What a view sees of the proxy, painted by place: photos agree but for their resolution.
fn photo(view: &View, proxy: &Proxy) -> RgbaImage {
    let center = view.center();
    let world_from_camera = view.camera_from_world.rotation.conjugate();
    RgbaImage::from_fn(view.width, view.height, |x, y| {
        let ray = view
            .lens
            .unproject(Pixel::center_of(x, y))
            .expect("a pinhole");
        let ray = world_from_camera * ray;
        let along = match proxy {
            Proxy::Mesh(solid) => solid.first_hit(center, ray).map(|hit| hit.along),
            _ => Some((4.0 - center.z) / ray.z),
        };
        let Some(along) = along else {
            return image::Rgba([20, 20, 20, 255]);
        };
        let p = center + ray * along;
        let wave = |turned: DVec3| 127.0 + 70.0 * (9.0 * turned.x).sin() * (7.0 * turned.y).cos();
        let fine = 30.0 * (61.0 * p.x).sin() * (53.0 * (p.y + p.z)).sin();
        let [r, g, b] = [p, p.yzx(), p.zxy()].map(|turned| (wave(turned) + fine) as u8);
        image::Rgba([r, g, b, 255])
    })
}

/// A ball around the origin of 2·around·(down − 1) faces.
fn globe(around: u32, down: u32) -> Mesh {
    let mut mesh = Mesh::default();
    for row in 0..=down {
        for column in 0..around {
            let theta = std::f64::consts::PI * f64::from(row) / f64::from(down);
            let phi = std::f64::consts::TAU * f64::from(column) / f64::from(around);
            let (sin, cos) = theta.sin_cos();
            mesh.positions
                .push(DVec3::new(sin * phi.cos(), cos, sin * phi.sin()));
        }
    }
    for row in 0..down {
        for column in 0..around {
            let at = |r: u32, c: u32| r * around + c % around;
            let (a, b) = (at(row, column), at(row, column + 1));
            let (c, d) = (at(row + 1, column), at(row + 1, column + 1));
            if row > 0 {
                mesh.triangles.push([a, b, c]);
            }
            if row + 1 < down {
                mesh.triangles.push([b, d, c]);
            }
        }
    }
    mesh
}

/// A box along z.
fn hallway() -> Mesh {
    let corner = |i: u32| {
        let side = |bit: u32, reach: f64| if i & bit == 0 { -reach } else { reach };
        DVec3::new(side(1, 1.0), side(2, 1.0), side(4, 12.0))
    };
    Mesh {
        positions: (0..8).map(corner).collect(),
        triangles: [
            [0, 1, 3, 2],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 3, 7, 6],
            [0, 2, 6, 4],
            [1, 3, 7, 5],
        ]
        .iter()
        .flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]])
        .collect(),
    }
}

fn desired(kind: &str, (width, height): (u32, u32)) -> View {
    let size = DVec2::new(f64::from(width), f64::from(height));
    let pose = match kind {
        "hull" => Rigid3::looking_at(DVec3::new(0.4, 0.3, -3.1), DVec3::ZERO, DVec3::Y),
        _ => {
            let center = DVec3::new(0.03, -0.02, -0.05);
            Rigid3::looking_at(center, center + DVec3::Z, DVec3::Y)
        }
    };
    View {
        lens: Lens::pinhole(DVec2::splat(0.8 * size.x), 0.5 * size),
        width,
        height,
        camera_from_world: pose,
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

/// Prints the time of one stage, over and over, for profiles.
fn alone(stage: &str, kind: &str, lumigraph: &Lumigraph, desired: &View) {
    const FRAMES: u32 = 40;
    let Method::Triangulated { cells_across } = Method::TRIANGULATED else {
        unreachable!("the default method is triangulated")
    };
    let mut cpu = Cpu::default();
    let mut work = || {
        let frame = Frame::new(lumigraph, desired.clone(), FieldOptions::default());
        let (cpu, wall) = timed(|| match stage {
            "field" => drop(TriangulatedField::new(&frame, cells_across).expect("it fits")),
            "exact" => drop(cpu.render(&frame, Method::Exact).expect("made up")),
            _ => drop(cpu.render(&frame, Method::TRIANGULATED).expect("made up")),
        });
        (ms(cpu), ms(wall))
    };
    work();
    let mut times: Vec<(f64, f64)> = (0..FRAMES).map(|_| work()).collect();
    times.sort_by(|x, y| x.0.total_cmp(&y.0));
    let (cpu, wall) = times[times.len() / 2];
    let size = format!("{} × {}", desired.width, desired.height);
    let count = lumigraph.sources.len();
    println!("{kind:8}{size:>12}{count:>9}  {stage} {cpu:.1} / {wall:.1}");
}

fn timed(work: impl FnOnce()) -> (Duration, Duration) {
    let (cpu, wall) = (ProcessTime::now(), Instant::now());
    work();
    (cpu.elapsed(), wall.elapsed())
}

fn ms(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}
