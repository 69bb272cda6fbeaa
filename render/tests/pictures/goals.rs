//! The goals of unstructured lumigraph rendering: Buehler et al. 2001, §3 and Table 1, one test
//! each. The eighth, Real-time, is no matter of right or wrong: `benches/frame.rs` measures it.

use crate::common;

use calibrate::{Distortion, Lens, Pixel, View};
use common::{METHODS, Random, Shot, by_all, pinhole, psnr_covered};
use glam::{DVec2, DVec3};
use proptest::prelude::*;
use proxy::{Mesh, MeshKind, Plane, Proxy, Solid};
use render::reference::blend_at;
use render::{
    Blend, FieldOptions, Frame, Lumigraph, Method, PhotoStore, ProxyPoint, SourceView, Visibility,
    cpu,
};
use std::sync::{Arc, OnceLock};

/// Views of a proxy, without photos.
fn lumigraph(views: Vec<View>, proxy: Proxy) -> Lumigraph {
    let photos = PhotoStore::new(views.len(), |i| Err(format!("{i} is not needed")));
    let source = |(i, view): (usize, View)| SourceView {
        name: format!("{i}"),
        view,
        gain: [1.0; 3],
        time_s: None,
        quarters: 0,
    };
    let sources: Vec<SourceView> = views.into_iter().enumerate().map(source).collect();
    Lumigraph {
        visibility: Visibility::of(&proxy, &sources),
        points: Vec::new(),
        photos,
        sources,
        proxy,
    }
}

fn plane(point: DVec3, normal: DVec3) -> Proxy {
    Proxy::Plane(Plane::new(point, normal).unwrap())
}

/// A weight for every source view.
fn weights(frame: &Frame<'_>, point: &ProxyPoint) -> Vec<f64> {
    let mut weights = vec![0.0; frame.sources.len()];
    for c in blend_at(frame, point) {
        weights[c.source_idx] = c.weight;
    }
    weights
}

/// A point in the world as a frame sees it.
fn point_in_world(frame: &Frame<'_>, point: &ProxyPoint) -> DVec3 {
    let world_from_camera = frame.desired.camera_from_world.rotation.conjugate();
    frame.desired.center() + world_from_camera * point.ray / point.inverse_distance
}

/// Smooth hills over −3…3 × −3…3, up to 0.4 high towards −z: they hide their far sides from
/// cameras low beside them, and nothing from those above.
fn hills() -> Arc<Solid> {
    const CELLS: u32 = 60;
    static HILLS: OnceLock<Arc<Solid>> = OnceLock::new();
    let make = || {
        let at = |i: u32| 6.0 * f64::from(i) / f64::from(CELLS) - 3.0;
        let indices = || (0..=CELLS).flat_map(|j| (0..=CELLS).map(move |i| (i, j)));
        let position = |(i, j)| {
            let (x, y) = (at(i), at(j));
            DVec3::new(x, y, 0.4 * (2.0 * x).sin() * (1.7 * y + 0.3).cos())
        };
        let cells = indices().filter(|&(i, j)| i < CELLS && j < CELLS);
        let triangles = cells.flat_map(|(i, j)| {
            let a = j * (CELLS + 1) + i;
            let (b, c, d) = (a + 1, a + CELLS + 2, a + CELLS + 1);
            [[a, b, c], [a, c, d]]
        });
        let mesh = Mesh {
            positions: indices().map(position).collect(),
            triangles: triangles.collect(),
        };
        Arc::new(Solid::new(MeshKind::Mesh, mesh))
    };
    Arc::clone(HILLS.get_or_init(make))
}

/// Goal: geometry that is known is used: a ray is made of the photos of the point where it meets
/// the proxy, and of those photos that see that point. Shown by pictures of a wall, right with
/// the wall as the proxy and wrong with another plane; and by a camera that a screen keeps from
/// seeing the point, which gets no weight to speak of.
#[test]
fn use_of_geometric_proxies() {
    let shot = Shot::of("wall", 6, None);
    let desired = shot.views[1].between(&shot.views[4], 0.5);
    let truth = datasets::render_view(&shot.dataset.scene, &desired, 2);
    let with = |proxy: Proxy| {
        let lumigraph = Lumigraph {
            proxy,
            ..shot.lumigraph()
        };
        let frame = Frame::new(&lumigraph, desired.clone(), FieldOptions::default());
        psnr_covered(&cpu::render(&frame, Method::Exact).unwrap(), &truth)
    };
    let (wall, normal) = (shot.plane.point(), shot.plane.normal());
    let right = with(plane(wall, normal));
    let wrong = with(plane(wall.lerp(desired.center(), 0.5), normal));
    println!("{right:.1} dB with the wall, {wrong:.1} dB with a plane half as far");
    assert!(right > wrong + 10.0, "{right} dB, {wrong} dB");

    // A wall, and a screen before its left half: the left camera looks round it.
    let quad = |x: [f64; 2], z: f64| Mesh {
        positions: [(0, -9.0), (1, -9.0), (1, 9.0), (0, 9.0)]
            .map(|(i, y)| DVec3::new(x[i], y, z))
            .to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
    };
    let mut mesh = quad([-9.0, 9.0], 4.0);
    mesh.append(&quad([-0.7, -0.2], 2.0));
    let straight = |x: f64| {
        let center = DVec3::new(x, 0.0, 0.0);
        pinhole(center, center + DVec3::Z, 60.0, (100, 80))
    };
    let views = vec![straight(-1.0), straight(1.0)];
    let solid = Arc::new(Solid::new(MeshKind::Mesh, mesh));
    let lumigraph = lumigraph(views, Proxy::Mesh(solid));
    let frame = Frame::new(&lumigraph, straight(0.0), FieldOptions::default());
    let ahead = frame.proxy_point(Pixel::center_of(50, 40)).unwrap();
    let hidden = weights(&frame, &ahead)[0];
    assert!(hidden > 0.0 && hidden < 0.01, "{hidden}");
}

/// Goal: a ray through a source camera's centre is that camera's own ray, whatever the proxy.
/// Shown for random cameras on a desired ray between viewer and proxy, with three proxies: all
/// weight is theirs, and they are sampled where the ray is.
#[test]
fn epipole_consistency() {
    let mut random = Random(21);
    for _ in 0..200 {
        let desired = pinhole(
            DVec3::new(0.0, 0.0, -5.0) + random.vector(0.5),
            random.vector(1.0),
            80.0,
            (80, 60),
        );
        let at = Pixel::new(random.within(0.0, 80.0), random.within(0.0, 60.0));
        let world_from_camera = desired.camera_from_world.rotation.conjugate();
        let ray = (world_from_camera * desired.lens.unproject(at).unwrap()).normalize();
        let center = desired.center() + random.within(0.1, 3.0) * ray;
        // It looks elsewhere, but has the ray in its picture.
        let target = center + ray + random.vector(0.2);
        let mut views = vec![pinhole(center, target, 80.0, (80, 60))];
        for _ in 0..8 {
            let center = DVec3::new(0.0, 0.0, -4.0) + random.vector(1.0);
            views.push(pinhole(center, random.vector(1.0), 80.0, (80, 60)));
        }
        let own = views[0].project(center + ray).unwrap();
        for depth in [-0.5, 1.0, 30.0] {
            let normal = DVec3::Z + random.vector(0.2);
            let lumigraph = lumigraph(views.clone(), plane(depth * DVec3::Z, normal));
            let frame = Frame::new(&lumigraph, desired.clone(), FieldOptions::default());
            let point = frame.proxy_point(at).unwrap();
            let weight = weights(&frame, &point)[0];
            assert!(weight >= 1.0 - 1e-9, "{weight} with a plane at {depth}");
            let sampled = frame.project(0, &point).unwrap();
            assert!((sampled.x - own.x).hypot(sampled.y - own.y) < 1e-9);
        }
    }
}

/// Goal: photos that show a point coarsely do not blur a view that shows it finely. Shown by two
/// cameras at one angle on either side of the viewer: the farther one of them is, or the shorter
/// its lens, the less it counts; with β = 0 that is all the same.
#[test]
fn resolution_sensitivity() {
    let coarse_share = |distance: f64, focal: f64, beta: f64| {
        let from = |x: f64, distance: f64, focal: f64| {
            let center = distance * DVec3::new(x, 0.0, -1.0);
            pinhole(center, DVec3::ZERO, focal, (80, 60))
        };
        let views = vec![from(0.2, 1.0, 80.0), from(-0.2, distance, focal)];
        let lumigraph = lumigraph(views, plane(DVec3::ZERO, DVec3::Z));
        let options = FieldOptions {
            beta,
            ..FieldOptions::default()
        };
        let frame = Frame::new(&lumigraph, from(0.0, 1.0, 80.0), options);
        weights(&frame, &frame.proxy_point(Pixel::new(40.0, 30.0)).unwrap())[1]
    };
    for beta in [0.1, 1.0] {
        let shares = [1.0, 1.5, 2.0, 4.0, 8.0].map(|d| coarse_share(d, 80.0, beta));
        println!("beta {beta}: the share of a camera 1, 1.5, 2, 4, 8 times as far: {shares:.3?}");
        assert!(shares.windows(2).all(|pair| pair[1] < 0.95 * pair[0]));
        // Half the focal length is twice the footprint.
        assert!((coarse_share(1.0, 40.0, beta) - coarse_share(2.0, 80.0, beta)).abs() < 0.02);
    }
    assert!((coarse_share(8.0, 80.0, 0.0) - 0.5).abs() < 1e-9);
}

/// Goal: photos from anywhere will do. Shown by cameras of several lenses, sizes, distances and
/// rolls strewn before a wall: a view between them is right wherever any of them sees the wall,
/// and each photo comes back from its own place (which rebinning to a grid would spoil).
#[test]
fn unstructured_input() {
    let shot = Shot::of("wall", 2, None);
    let scene = &shot.dataset.scene;
    let (wall, normal) = (shot.plane.point(), shot.plane.normal());
    let far = shot.plane.signed_distance(shot.views[0].center());
    let across = normal.any_orthonormal_vector();
    let along = normal.cross(across);
    let middle = shot.views[0].center().lerp(shot.views[1].center(), 0.5);
    let foot = middle - shot.plane.signed_distance(middle) * normal;
    let mut random = Random(5);
    let views: Vec<View> = (0..14)
        .map(|i| {
            let mut place = |reach: f64| {
                far.abs()
                    * (random.within(-reach, reach) * across + random.within(-reach, reach) * along)
            };
            let (beside, aim) = (place(0.35), foot + place(0.1));
            let center = foot + beside + far * random.within(0.7, 1.2) * normal;
            let size = [(160, 120), (120, 160), (128, 128)][i % 3];
            let focal = random.within(90.0, 140.0);
            let mut view = pinhole(center, aim, focal, size);
            let roll = glam::DQuat::from_rotation_z(random.within(-3.0, 3.0));
            let rotation = roll * view.camera_from_world.rotation;
            view.camera_from_world = calibrate::Rigid3::new(rotation, -(rotation * center));
            if i % 4 == 3 {
                let fisheye = Distortion::Fisheye { k: [0.0; 4] };
                view.lens = Lens::new(DVec2::splat(90.0), view.lens.principal, fisheye);
            }
            view
        })
        .collect();
    let photos = views.iter().map(|v| datasets::render_view(scene, v, 2));
    let lumigraph = Lumigraph {
        photos: PhotoStore::from_images(photos.collect()),
        ..lumigraph(views.clone(), plane(wall, normal))
    };
    let desired = pinhole(foot + far * normal, foot, 130.0, (160, 120));
    let truth = datasets::render_view(scene, &desired, 2);
    let frame = Frame::new(&lumigraph, desired, FieldOptions::default());
    for method in METHODS {
        for (engine, picture) in by_all(&frame, method) {
            let db = psnr_covered(&picture.unwrap(), &truth);
            println!("{engine}, {method:?}: {db:.1} dB");
            assert!(db > 30.0, "{engine}, {method:?}: {db} dB");
        }
    }
    for (i, view) in views.into_iter().enumerate() {
        let frame = Frame::new(&lumigraph, view, FieldOptions::default());
        let own = lumigraph.photos.get(i).unwrap();
        let db = psnr_covered(&cpu::render(&frame, Method::Exact).unwrap(), &own.levels[0]);
        assert!(db > 50.0, "photo {i}: {db} dB");
    }
}

/// Cameras of all kinds that look at the hills, or a plane among them.
fn strewn(random: &mut Random, count: usize) -> Vec<View> {
    let view = |_| {
        let center = DVec3::new(0.0, 0.0, -3.0) + random.vector(2.0);
        let focal = random.within(40.0, 120.0);
        pinhole(center, random.vector(1.0), focal, (80, 60))
    };
    (0..count).map(view).collect()
}

/// Weights of a ray that two desired cameras share; `None` where they see something else along
/// it, or nothing that a photo shows.
fn weights_of_a_shared_ray(
    lumigraph: &Lumigraph,
    options: FieldOptions,
    random: &mut Random,
) -> Option<[Vec<f64>; 2]> {
    // 1. A camera, a ray, and where that ends.
    let [first] = &strewn(random, 1)[..] else {
        return None;
    };
    let at = Pixel::center_of(random.below(80) as u32, random.below(60) as u32);
    let frame = Frame::new(lumigraph, first.clone(), options);
    let point = frame.proxy_point(at)?;
    let p = point_in_world(&frame, &point);
    let shown = |source: &SourceView| {
        let pixel = source.view.project(p);
        pixel.is_some_and(|pixel| source.view.contains(pixel))
    };
    if !(p.length() < 20.0) || !lumigraph.sources.iter().any(shown) {
        return None;
    }

    // 2. Another on the same line, nearer or farther, that has the ray in the middle of a pixel:
    // surfaces of many facets are looked up there.
    let center = first.center().lerp(p, random.within(-0.5, 0.9));
    let focal = random.within(5.0, 20.0);
    let mut second = pinhole(center, p + random.vector(0.3), focal, (8, 6));
    let lands = second.project(p)?;
    second.lens.principal += DVec2::new(3.5 - lands.x, 2.5 - lands.y);
    let other = Frame::new(lumigraph, second, options);
    let same = other.proxy_point(Pixel::center_of(3, 2))?;
    if point_in_world(&other, &same).distance(p) > 1e-9 {
        return None;
    }
    Some([weights(&frame, &point), weights(&other, &same)])
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(200) })]

    /// Goal: a line of sight through empty space is reconstructed the same from wherever along
    /// it one looks (but for resolution). Shown for random cameras that share a ray to a plane
    /// or to a mesh that hides parts of itself from the photos: with β = 0 all weights agree.
    #[test]
    fn equivalent_ray_consistency(seed: u64, k in 1..=8_usize, paper: bool, meshed: bool) {
        let mut random = Random(seed);
        let count = 2 + random.below(20);
        let views = strewn(&mut random, count);
        let proxy = if meshed {
            Proxy::Mesh(hills())
        } else {
            plane(random.vector(0.3), DVec3::Z + random.vector(0.4))
        };
        let lumigraph = lumigraph(views, proxy);
        let blend = if paper { Blend::Paper } else { Blend::Consistent };
        let options = FieldOptions { k, beta: 0.0, blend, ..FieldOptions::default() };
        let mut compared = 0;
        for _ in 0..100 {
            let Some([a, b]) = weights_of_a_shared_ray(&lumigraph, options, &mut random) else {
                continue;
            };
            for (a, b) in a.iter().zip(&b) {
                prop_assert!((a - b).abs() <= 1e-9, "{} and {}", a, b);
            }
            compared += 1;
            if compared == 4 {
                break;
            }
        }
        prop_assert!(compared == 4, "only {} rays could be compared", compared);
    }
}

/// What a pixel of a view on a path is made of, and which source views have the point in their
/// images and which have something before it.
struct Sample {
    weights: Vec<f64>,
    in_image: Vec<bool>,
    hidden: Vec<bool>,
}

/// What happens along a path.
#[derive(Debug, Default)]
struct Changes {
    /// The greatest share of the weight that still moves when the worst steps are halved often.
    jump: f64,
    /// How often a point enters or leaves a photo, and how often something comes before it.
    borders: usize,
    hidings: usize,
}

impl Changes {
    /// Adds those of a path from 0 to 1.
    fn add(&mut self, halvings: usize, at: impl Fn(f64) -> Sample) {
        const STEPS: usize = 300;
        const WORST: usize = 8;
        let place = |i: usize| i as f64 / STEPS as f64;
        let moved = |a: &Sample, b: &Sample| -> f64 {
            let covered = |s: &Sample| s.weights.iter().any(|w| *w > 0.0);
            if !covered(a) || !covered(b) {
                return 0.0;
            }
            let each = a.weights.iter().zip(&b.weights);
            0.5 * each.map(|(a, b)| (a - b).abs()).sum::<f64>()
        };
        let samples: Vec<Sample> = (0..=STEPS).map(|i| at(place(i))).collect();
        let differing = |a: &[bool], b: &[bool]| a.iter().zip(b).filter(|(a, b)| a != b).count();
        for pair in samples.windows(2) {
            self.borders += differing(&pair[0].in_image, &pair[1].in_image);
            self.hidings += differing(&pair[0].hidden, &pair[1].hidden);
        }
        let mut steps: Vec<usize> = (0..STEPS).collect();
        let of = |i: usize| moved(&samples[i], &samples[i + 1]);
        steps.sort_by(|&i, &j| of(j).total_cmp(&of(i)));
        for &i in &steps[..WORST] {
            let (mut low, mut high) = (place(i), place(i + 1));
            let (mut a, mut b) = (at(low), at(high));
            for _ in 0..halvings {
                let middle = 0.5 * (low + high);
                let m = at(middle);
                if moved(&a, &m) >= moved(&m, &b) {
                    (high, b) = (middle, m);
                } else {
                    (low, a) = (middle, m);
                }
            }
            self.jump = self.jump.max(moved(&a, &b));
        }
    }

    /// Of several sweeps over the proxy; the ray is in the middle of a picture of 3 × 3 pixels.
    fn along_sweeps(lumigraph: &Lumigraph, blend: Blend, halvings: usize) -> Self {
        let options = FieldOptions {
            blend,
            ..FieldOptions::default()
        };
        let mut changes = Self::default();
        for i in 0..6 {
            let y = 0.3 * f64::from(i) - 0.7;
            changes.add(halvings, |s| {
                let center = DVec3::new(1.6 * s - 0.9, y, -4.0 + 0.4 * s);
                let target = DVec3::new(3.0 * s - 1.6, 0.8 * y + 0.3 * (4.0 * s).sin(), 0.0);
                let desired = pinhole(center, target, 80.0, (3, 3));
                let frame = Frame::new(lumigraph, desired, options);
                Sample::of(&frame, Pixel::center_of(1, 1))
            });
        }
        changes
    }
}

impl Sample {
    fn of(frame: &Frame<'_>, pixel: Pixel) -> Self {
        let point = frame.proxy_point(pixel).expect("the proxy is everywhere");
        let shown = |i: usize| {
            let pixel = frame.project(i, &point)?;
            let inside = frame.lumigraph.sources[i].view.contains(pixel);
            inside.then(|| frame.visible(i, &point, pixel))
        };
        let shown: Vec<Option<f64>> = (0..frame.sources.len()).map(shown).collect();
        Self {
            weights: weights(frame, &point),
            in_image: shown.iter().map(Option::is_some).collect(),
            hidden: shown.iter().map(|v| v.is_some_and(|v| v < 0.5)).collect(),
        }
    }
}

/// Goal: near rays that meet the proxy near one another get near colours; weights fade towards
/// the border of a photo and towards what hides the point from it. Shown along smooth sweeps over
/// a plane, past the borders of many photos, and over hills that hide points from cameras low
/// beside them: no more than 0.2 % of the weight moves at once. The paper's own formula, whose
/// threshold jumps when another camera enters, moves more than 10 % on the plane.
#[test]
fn continuity() {
    // Narrow pictures of small patches, side by side and at several distances.
    let mut random = Random(8);
    let narrow = |i: i32| {
        let (x, y) = (f64::from(i % 6), f64::from(i / 6));
        let center = DVec3::new(0.7 * x - 1.7, 0.7 * y - 1.2, -3.5) + random.vector(0.3);
        let target = DVec3::new(center.x, center.y, 0.0) + random.vector(0.3);
        pinhole(center, target, 130.0, (100, 80))
    };
    let wall = lumigraph(
        (0..24).map(narrow).collect(),
        plane(DVec3::ZERO, DVec3::new(0.1, -0.05, 1.0)),
    );
    let low = |i: i32| {
        let (sin, cos) = (f64::from(i) * std::f64::consts::TAU / 20.0).sin_cos();
        let center = DVec3::new(4.2 * cos, 4.2 * sin, -1.3 - 0.5 * f64::from(i % 3));
        pinhole(center, DVec3::ZERO, 90.0, (160, 120))
    };
    let above = |i: i32| {
        let center = DVec3::new(f64::from(i) - 1.0, 0.3, -6.0);
        pinhole(center, DVec3::ZERO, 90.0, (160, 120))
    };
    let beside: Vec<View> = (0..20).map(low).collect();
    let around = [beside.clone(), (0..3).map(above).collect()].concat();
    let around = lumigraph(around, Proxy::Mesh(hills()));
    let beside = lumigraph(beside, Proxy::Mesh(hills()));

    let fields_of_view = Changes::along_sweeps(&wall, Blend::Consistent, 12);
    let visibility = Changes::along_sweeps(&around, Blend::Consistent, 12);
    let first_to_see = Changes::along_sweeps(&beside, Blend::Consistent, 12);
    let paper = Changes::along_sweeps(&wall, Blend::Paper, 12);
    println!(
        "plane: {fields_of_view:?}\nhills: {visibility:?}\nhills, seen only from beside: \
         {first_to_see:?}\nthe paper's, plane: {paper:?}"
    );
    assert!(fields_of_view.borders > 50, "{fields_of_view:?}");
    assert!(visibility.hidings > 50, "{visibility:?}");
    for changes in [fields_of_view, visibility, first_to_see] {
        assert!(changes.jump <= 0.002, "{changes:?}");
    }
    assert!(paper.jump > 0.1, "the paper's form jumps: {paper:?}");
}

/// Goal: closeness of rays is measured by the angle at the proxy. Shown with β = 0: among random
/// cameras that see the point whole, a smaller angle never has less weight; and in the paper's
/// Figure 5, where the ray passes the plane of the cameras nearer to the other one.
#[test]
fn minimal_angular_deviation() {
    let options = FieldOptions {
        beta: 0.0,
        ..FieldOptions::default()
    };
    let mut random = Random(13);
    for _ in 0..100 {
        let ahead = |random: &mut Random| {
            let center = DVec3::new(0.0, 0.0, -4.0) + random.vector(2.0);
            pinhole(center, random.vector(0.1), 50.0, (80, 60))
        };
        let views: Vec<View> = (0..30).map(|_| ahead(&mut random)).collect();
        let lumigraph = lumigraph(views, plane(random.vector(0.1), DVec3::Z));
        let frame = Frame::new(&lumigraph, ahead(&mut random), options);
        let point = frame.proxy_point(Pixel::new(40.0, 30.0)).unwrap();
        let p = point_in_world(&frame, &point);
        let to_viewer = frame.desired.center() - p;
        let angle = |i: usize| to_viewer.angle_between(lumigraph.sources[i].view.center() - p);
        let mut by_angle: Vec<(f64, f64)> = weights(&frame, &point)
            .into_iter()
            .enumerate()
            .map(|(i, weight)| (angle(i), weight))
            .collect();
        by_angle.sort_by(|a, b| a.0.total_cmp(&b.0));
        assert!(by_angle.windows(2).all(|pair| pair[0].1 >= pair[1].1));
        assert!(by_angle[1].1 > 0.0 && by_angle[29].1 == 0.0);
    }

    // Figure 5: the point is 1 off the plane of the cameras, the ray 60° oblique.
    let p = DVec3::Z;
    let crossing = f64::to_radians(60.0).tan();
    let at = |x: f64| pinhole(DVec3::new(x, 0.0, 0.0), p, 50.0, (80, 60));
    let views = vec![at(crossing - 0.6), at(crossing + 0.8)];
    let lumigraph = lumigraph(views, plane(p, DVec3::Z));
    let frame = Frame::new(&lumigraph, at(crossing), options);
    let point = frame.proxy_point(Pixel::new(40.0, 30.0)).unwrap();
    let weights = weights(&frame, &point);
    assert!(weights[1] > weights[0], "{weights:?}");
}
