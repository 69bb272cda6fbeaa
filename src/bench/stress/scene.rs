//! Scenes that try to break things.

use crate::bench::{Random, made_up};
use calibrate::{Distortion, Lens, Pixel, Rigid3, View};
use glam::{DQuat, DVec2, DVec3};
use image::{Rgba, RgbaImage};
use proxy::{Mesh, MeshKind, Plane, Proxy, Solid, SparsePoint};
use render::{Lumigraph, PhotoStore, SourceView, Visibility};
use std::sync::Arc;

/// Where a scene lies in the world: new = scale · (rotation · old) + translation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Above zero.
    pub scale: f64,
    /// A unit quaternion.
    pub rotation: DQuat,
    /// In the new world's units.
    pub translation: DVec3,
}

impl Placement {
    /// As it is made: about ten units large, around the origin.
    pub const OWN: Self = Self {
        scale: 1.0,
        rotation: DQuat::IDENTITY,
        translation: DVec3::ZERO,
    };

    fn point(&self, p: DVec3) -> DVec3 {
        self.scale * (self.rotation * p) + self.translation
    }

    fn view(&self, view: &View) -> View {
        let rotation = (view.camera_from_world.rotation * self.rotation.conjugate()).normalize();
        let center = self.point(view.center());
        View {
            camera_from_world: Rigid3::new(rotation, -(rotation * center)),
            ..view.clone()
        }
    }
}

/// A scene and a view of it.
#[derive(Debug)]
pub struct Case {
    /// What it is made of, for people.
    pub name: String,
    /// What it is rendered from.
    pub lumigraph: Lumigraph,
    /// What is to be drawn.
    pub desired: View,
    /// Whether the smallest change may change what is seen: a viewer on a surface, say. Then
    /// pictures are only drawn, not compared with those of the world moved.
    pub is_on_edge: bool,
}

/// Pixels of the desired view and of the photos.
const SIZE: (u32, u32) = (48, 36);
const PHOTO: (u32, u32) = (24, 18);
/// How far ahead of the cameras the scene about is.
const DISTANCE: f64 = 4.0;

/// Where photos are taken from.
const CROWDS: [&str; 8] = [
    "one photo",
    "all at one point",
    "on a line",
    "on the line of sight",
    "in a plane",
    "in a cloud",
    "in pairs at one point",
    "far away, nearly parallel",
];
/// What carries rays to them.
const PROXIES: [&str; 9] = [
    "a plane ahead",
    "a grazing plane",
    "a plane through the viewer",
    "a plane through a photo's centre",
    "a ball ahead",
    "a ball around all",
    "a ball touched",
    "slivers",
    "sparse points",
];
/// Where they are looked at from.
const VIEWERS: [&str; 6] = [
    "among them",
    "at a photo's place",
    "beside a photo's place by rounding",
    "between two photos",
    "with an epipole on a corner of the grid",
    "far behind",
];
/// Through what.
const LENSES: [&str; 4] = ["a usual lens", "1° wide", "169° wide", "a fisheye"];

impl Case {
    /// The scene of a number, somewhere. Every number is another one.
    pub fn new(seed: u64, placement: &Placement) -> Self {
        let mut random = Random(seed);
        // Numbers in a row go through all crowds and surfaces.
        let crowd = seed as usize % CROWDS.len();
        let kind = seed as usize / CROWDS.len() % PROXIES.len();
        let viewer = random.below(VIEWERS.len());
        let lens = random.below(LENSES.len());
        let sources = crowd_of(crowd, lens, &mut random);
        let desired = desired(viewer, lens, &sources, &mut random);
        let (proxy, points) = proxy_of(kind, &sources, &desired, &mut random);

        let sources: Vec<View> = sources.iter().map(|view| placement.view(view)).collect();
        let named = sources.into_iter().enumerate().map(|(i, view)| SourceView {
            name: format!("{i}"),
            view,
            gain: [1.0; 3],
            time_s: None,
            quarters: 0,
        });
        let sources: Vec<SourceView> = named.collect();
        let proxy = moved(proxy, placement);
        let points = points.into_iter().map(|point| SparsePoint {
            position: placement.point(point.position),
            ..point
        });
        let count = sources.len();
        Self {
            name: format!(
                "{count} photos {}, {}, seen {}, {}",
                CROWDS[crowd], PROXIES[kind], VIEWERS[viewer], LENSES[lens]
            ),
            desired: placement.view(&desired),
            is_on_edge: matches!(kind, 1 | 2 | 3 | 6 | 7) || crowd == 7 || lens == 2,
            lumigraph: Lumigraph {
                points: points.collect(),
                visibility: Visibility::of(&proxy, &sources),
                photos: PhotoStore::new(count, move |i| Ok(photo(i))),
                sources,
                proxy,
            },
        }
    }

    /// The same with its photos in another order: the last first.
    #[must_use]
    pub fn reversed(seed: u64) -> Self {
        let mut case = Self::new(seed, &Placement::OWN);
        let count = case.lumigraph.sources.len();
        case.lumigraph.sources.reverse();
        case.lumigraph.photos = PhotoStore::new(count, move |i| Ok(photo(count - 1 - i)));
        for point in &mut case.lumigraph.points {
            for index in &mut point.seen_by {
                *index = count as u32 - 1 - *index;
            }
        }
        let (proxy, sources) = (&case.lumigraph.proxy, &case.lumigraph.sources);
        case.lumigraph.visibility = Visibility::of(proxy, sources);
        case
    }
}

/// Smooth, so that a small shift changes little, and different for each.
fn photo(index: usize) -> RgbaImage {
    let tint = 3.0 * (index as f64 * 0.618_034).fract();
    RgbaImage::from_fn(PHOTO.0, PHOTO.1, |x, y| {
        let wave = |phase: f64| {
            let at = 0.18 * f64::from(x) + 0.11 * f64::from(y) + phase + tint;
            (128.0 + 90.0 * at.sin()) as u8
        };
        Rgba([wave(0.0), wave(1.7), wave(3.1), 255])
    })
}

fn lens_of(lens: usize, (width, height): (u32, u32)) -> Lens {
    let half = 0.5 * DVec2::new(f64::from(width), f64::from(height));
    let pinhole = |degrees: f64| {
        let focal = half.x / (0.5 * degrees.to_radians()).tan();
        Lens::pinhole(DVec2::splat(focal), half)
    };
    match lens {
        0 => pinhole(62.0),
        1 => pinhole(1.0),
        2 => pinhole(169.0),
        _ => Lens::new(
            DVec2::splat(half.x),
            half,
            Distortion::Fisheye {
                k: [0.01, -0.004, 0.001, 0.0],
            },
        ),
    }
}

fn crowd_of(crowd: usize, lens: usize, random: &mut Random) -> Vec<View> {
    // Few, more than a hierarchy begins with, or rarely very many.
    let count = match (crowd, random.below(40)) {
        (0, _) => 1,
        (1, 0) => 1000,
        (_, 1..12) => 60 + random.below(200),
        _ => 2 + random.below(12),
    };
    let (origin, along) = (random.vector(0.5), random.vector(1.0));
    let mut last = DVec3::ZERO;
    let views = (0..count).map(|i| {
        let share = if count > 1 {
            i as f64 / (count - 1) as f64
        } else {
            0.5
        };
        let center = match crowd {
            0 | 1 => origin,
            2 => origin + along * (share - 0.5),
            3 => DVec3::Z * (3.0 * share - 2.0),
            4 => random.vector(1.0) * DVec3::new(1.0, 1.0, 0.0),
            6 if i % 2 == 1 => last,
            7 => DVec3::new(0.0, 0.0, -1e5) + random.vector(1.0),
            _ => random.vector(1.0),
        };
        last = center;
        let target = DVec3::Z * DISTANCE + random.vector(0.7);
        // From afar all is small.
        let lens = if crowd == 7 {
            let half = 0.5 * DVec2::new(f64::from(PHOTO.0), f64::from(PHOTO.1));
            Lens::pinhole(DVec2::splat(half.x * 5e4), half)
        } else {
            lens_of(lens, PHOTO)
        };
        View {
            lens,
            width: PHOTO.0,
            height: PHOTO.1,
            camera_from_world: Rigid3::looking_at(center, target, DVec3::Y),
        }
    });
    views.collect()
}

fn desired(viewer: usize, lens: usize, sources: &[View], random: &mut Random) -> View {
    let first = &sources[random.below(sources.len())];
    let second = &sources[random.below(sources.len())];
    let lens = lens_of(lens, SIZE);
    let at = |center: DVec3, target: DVec3| View {
        lens,
        width: SIZE.0,
        height: SIZE.1,
        camera_from_world: Rigid3::looking_at(center, target, DVec3::Y),
    };
    let ahead = DVec3::Z * DISTANCE;
    match viewer {
        0 => at(random.vector(0.8), ahead + random.vector(0.5)),
        1 => at(first.center(), ahead),
        2 => at(first.center() * (1.0 + 1e-15) + random.vector(1e-14), ahead),
        3 => {
            let middle = 0.5 * (first.center() + second.center());
            at(middle, ahead)
        }
        4 => {
            // A photo's centre is put on the ray through a corner of the default grid's cells.
            let pixel = Pixel::new(1.5 * random.below(33) as f64, 1.5 * random.below(25) as f64);
            let ray = lens.unproject(pixel).unwrap_or(DVec3::Z);
            let center = first.center() - ray.normalize() * random.within(0.1, 2.0);
            View {
                camera_from_world: Rigid3::new(DQuat::IDENTITY, -center),
                ..at(center, ahead)
            }
        }
        _ => at(DVec3::Z * -random.within(20.0, 1e4), ahead),
    }
}

fn proxy_of(
    kind: usize,
    sources: &[View],
    desired: &View,
    random: &mut Random,
) -> (Proxy, Vec<SparsePoint>) {
    let ahead = DVec3::Z * DISTANCE;
    let plane = |point: DVec3, normal: DVec3| {
        let plane = Plane::new(point, normal.try_normalize().unwrap_or(DVec3::Z));
        Proxy::Plane(plane.expect("finite numbers, a unit normal"))
    };
    let mesh = |mesh: Mesh| Proxy::Mesh(Arc::new(Solid::new(MeshKind::Hull, mesh)));
    let ball = |center, radius| made_up::ball(center, radius, 8, 7);
    let tilted = |random: &mut Random| DVec3::NEG_Z + random.vector(0.5);
    let proxy = match kind {
        0 => plane(ahead, tilted(random)),
        1 => {
            // Seen under a hundredth of a degree.
            let across = (ahead - desired.center()).cross(random.vector(1.0));
            let normal = across.normalize_or(DVec3::X) + 1e-4 * random.vector(1.0);
            plane(ahead, normal)
        }
        2 => plane(desired.center(), tilted(random)),
        3 => plane(
            sources[random.below(sources.len())].center(),
            tilted(random),
        ),
        4 => mesh(ball(ahead, 1.0)),
        5 => mesh(ball(DVec3::ZERO, 40.0)),
        6 => mesh(ball(desired.center() + DVec3::Z, 1.0)),
        7 => mesh(slivers(random)),
        _ => Proxy::Points { within: None },
    };
    let points = if kind == 8 {
        let count = random.below(120);
        let seen_by: Vec<u32> = (0..sources.len().min(40) as u32).collect();
        let point = |_| SparsePoint {
            position: ahead + random.vector(2.0),
            seen_by: seen_by.clone(),
        };
        (0..count).map(point).collect()
    } else {
        Vec::new()
    };
    (proxy, points)
}

/// Triangles thousands of times longer than wide, degenerate ones among them, before a wall.
fn slivers(random: &mut Random) -> Mesh {
    let mut mesh = Mesh::default();
    let mut add = |corners: [DVec3; 3]| {
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(corners);
        mesh.triangles.push([first, first + 1, first + 2]);
    };
    let (left, right) = (DVec3::new(-30.0, -30.0, 8.0), DVec3::new(30.0, -30.0, 8.0));
    add([left, right, DVec3::new(0.0, 60.0, 8.0)]);
    for _ in 0..30 {
        let from = DVec3::Z * DISTANCE + random.vector(2.0);
        let along = random.vector(3.0);
        let width = 10.0_f64.powf(random.within(-12.0, -2.0));
        add([
            from,
            from + along,
            from + 0.5 * along + random.vector(width),
        ]);
    }
    let twice = DVec3::Z * DISTANCE;
    add([twice, twice, twice + DVec3::X]);
    mesh
}

fn moved(proxy: Proxy, placement: &Placement) -> Proxy {
    match proxy {
        Proxy::Plane(plane) => {
            let (point, normal) = (plane.point(), plane.normal());
            let moved = Plane::new(placement.point(point), placement.rotation * normal);
            Proxy::Plane(moved.expect("finite numbers, a unit normal"))
        }
        Proxy::Mesh(solid) => {
            let mut mesh = solid.mesh().clone();
            for position in &mut mesh.positions {
                *position = placement.point(*position);
            }
            Proxy::Mesh(Arc::new(Solid::new(solid.kind(), mesh)))
        }
        other => other,
    }
}
