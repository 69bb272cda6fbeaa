//! Finding the source views that count without asking all: the same field, to the last bit.

use crate::common;

use calibrate::{Distortion, Lens, Rigid3, View};
use common::Random;
use glam::{DVec2, DVec3};
use image::{Rgba, RgbaImage};
use proxy::{Mesh, MeshKind, Plane, Proxy, Solid};
use render::field::TriangulatedField;
use render::reference::blend_at;
use render::{
    Blend, FieldOptions, Frame, Lumigraph, Method, Moment, Part, PhotoStore, ProxyPoint,
    Resolution, Skips, SourceView, Visibility, cpu,
};
use std::sync::Arc;

fn lumigraph(views: Vec<View>, random: &mut Random) -> Lumigraph {
    let mut source = |(i, view): (usize, View)| SourceView {
        name: format!("{i}"),
        view,
        gain: [1.0; 3],
        time_s: (random.within(0.0, 1.0) < 0.9).then(|| random.within(0.0, 1.0)),
        quarters: 0,
    };
    Lumigraph {
        points: Vec::new(),
        photos: PhotoStore::new(views.len(), |i| Err(format!("{i} is not needed"))),
        sources: views.into_iter().enumerate().map(&mut source).collect(),
        proxy: Proxy::Plane(Plane::new(DVec3::Z * 4.0, DVec3::NEG_Z).unwrap()),
        visibility: None,
    }
}

fn lens_of(focal: f64, width: f64, height: f64) -> Lens {
    Lens::pinhole(DVec2::splat(focal), 0.5 * DVec2::new(width, height))
}

/// Cameras as people and machines place them, and as nobody would.
fn crowd(kind: usize, random: &mut Random) -> Vec<View> {
    let count = 30 + (random.within(0.0, 1.0) * 500.0) as usize;
    let lens = lens_of(80.0, 100.0, 75.0);
    let fisheye = Lens::new(
        DVec2::splat(40.0),
        DVec2::new(50.0, 37.5),
        Distortion::Fisheye {
            k: [0.02, -0.01, 0.0, 0.0],
        },
    );
    let spot = random.vector(1.0);
    (0..count)
        .map(|i| {
            let v = random.vector(1.0);
            let (center, target) = match kind {
                // A gantry, a walk, a turntable, a heap, photos all round, one spot, anything.
                0 => (DVec3::new(v.x, v.y, 0.0), DVec3::new(v.x, v.y, 4.0)),
                1 => (DVec3::Z * (0.01 * i as f64 - 3.0), DVec3::Z * 9.0),
                2 => {
                    let turn = DVec2::from_angle(0.05 * i as f64) * 3.0;
                    (DVec3::new(turn.x, 0.3 * v.y, 4.0 + turn.y), DVec3::Z * 4.0)
                }
                3 => (0.01 * v, DVec3::Z * 4.0 + v),
                4 => (v, v + random.vector(1.0)),
                5 => (spot, spot + DVec3::Z + 0.5 * v),
                _ => (10_f64.powf(4.0 * v.x) * v, 5.0 * random.vector(1.0)),
            };
            let lens = if i % 17 == 3 { fisheye } else { lens };
            View {
                lens,
                width: 100,
                height: 75,
                camera_from_world: Rigid3::looking_at(center, target, DVec3::Y),
            }
        })
        .collect()
}

#[test]
fn the_field_is_that_of_all_views() {
    let mut random = Random(20);
    let (mut compared, mut contributing) = (0, 0);
    for round in 0..140 {
        let views = crowd(round % 7, &mut random);
        let desired = View {
            camera_from_world: Rigid3::looking_at(
                0.7 * random.vector(1.0),
                DVec3::Z * 4.0,
                DVec3::Y,
            ),
            ..views[0].clone()
        };
        let options = FieldOptions {
            k: 1 + (random.within(0.0, 1.0) * 15.0) as usize,
            beta: [0.0, 0.1, 2.0][round % 3],
            blend: [Blend::Consistent, Blend::Paper][round % 2],
            resolution: [
                Resolution::Footprint,
                Resolution::Distance,
                Resolution::Length,
            ][round / 3 % 3],
            ..FieldOptions::default()
        };
        let lumigraph = lumigraph(views, &mut random);
        let mut part = Part::default();
        if round % 5 == 4 {
            part.moment = Some(Moment {
                time_s: random.within(0.0, 1.0),
                period_s: None,
                window_s: Some(0.2),
            });
        }
        let frame = Frame::with(&lumigraph, desired, options, &part);
        for i in 0..40 {
            let ray = DVec3::Z + random.vector(1.0);
            let point = ProxyPoint {
                ray,
                inverse_distance: match i % 8 {
                    0 => 0.0,
                    1 => 1e-9,
                    _ => 0.25 * 10_f64.powf(random.vector(1.0).x),
                },
                plane: DVec3::Z / 4.0,
            };
            let found = frame.blend_at(&point);
            assert_eq!(found, blend_at(&frame, &point), "round {round}, {point:?}");
            compared += 1;
            contributing += usize::from(!found.is_empty());
        }
    }
    assert!(contributing * 3 > compared, "{contributing} of {compared}");
}

#[test]
fn a_triangulated_field_of_many_views_is_close_to_the_exact_one() {
    let mut random = Random(3);
    for kind in [0, 1, 2, 4] {
        let views = crowd(kind, &mut random);
        let desired = View {
            width: 200,
            height: 150,
            lens: lens_of(160.0, 200.0, 150.0),
            camera_from_world: Rigid3::looking_at(
                DVec3::new(0.03, -0.02, -0.1),
                DVec3::Z * 4.0,
                DVec3::Y,
            ),
        };
        let lumigraph = lumigraph(views, &mut random);
        let frame = Frame::new(&lumigraph, desired, FieldOptions::default());
        let field = TriangulatedField::new(&frame, 32).unwrap();
        let desired = frame.desired.clone();
        let asking_all = Frame::new(&lumigraph, desired, frame.options).skipping(Skips::NONE);
        assert_eq!(field, TriangulatedField::new(&asking_all, 32).unwrap());
        let found = field.contributors(&frame);
        let (mut sum, mut count) = (0.0, 0);
        for (i, found) in found.iter().enumerate().step_by(7) {
            let pixel = calibrate::Pixel::center_of(i as u32 % 200, i as u32 / 200);
            let exact = frame
                .proxy_point(pixel)
                .map_or(Vec::new(), |p| blend_at(&frame, &p));
            assert_eq!(found.is_empty(), exact.is_empty(), "kind {kind}, {pixel:?}");
            let mut off = vec![0.0; lumigraph.sources.len()];
            exact.iter().for_each(|c| off[c.source_idx] += c.weight);
            found.iter().for_each(|c| off[c.source_idx] -= c.weight);
            sum += 0.5 * off.iter().map(|w: &f64| w.abs()).sum::<f64>();
            count += 1;
        }
        let mean = sum / f64::from(count);
        assert!(mean < 0.02, "kind {kind}: {mean}");
    }
}

#[test]
fn pictures_are_the_same_bytes_when_all_views_are_asked() {
    let mut random = Random(7);
    for kind in [0, 2, 4] {
        let mut lumigraph = lumigraph(crowd(kind, &mut random), &mut random);
        let count = lumigraph.sources.len();
        lumigraph.photos = PhotoStore::new(count, |i| {
            Ok(RgbaImage::from_fn(100, 75, |x, y| {
                let wave = |n: u32| (x * 7 * n + y * 3 + 40 * i as u32 * n) as u8;
                Rgba([wave(1), wave(2), wave(3), 255])
            }))
        });
        let desired = View {
            width: 101,
            height: 67,
            lens: lens_of(80.0, 101.0, 67.0),
            ..lumigraph.sources[count / 2].view.clone()
        };
        let new = || Frame::new(&lumigraph, desired.clone(), FieldOptions::default());
        for method in [Method::Exact, Method::TRIANGULATED] {
            let picture = cpu::render(&new(), method).unwrap();
            let frame = new().skipping(Skips::NONE);
            let asking_all = cpu::render(&frame, method).unwrap();
            assert!(picture == asking_all, "{kind}, {method:?}");
            // All were, whenever any was.
            let scored = frame.scored();
            assert_eq!(scored.scorings, scored.questions * count as u64);
            assert!(scored.ever.iter().all(|ever| *ever), "{kind}, {method:?}");
            assert!(picture.pixels().any(|p| p.0[3] > 0), "{kind}");
        }
    }
}

/// Of photos that differ alike the first decide: those beyond what may contribute, and one more whose
/// difference caps the threshold, change nothing.
#[test]
fn a_crowd_at_one_place_is_as_good_as_its_first_seventeen() {
    let mut random = Random(11);
    let lens = lens_of(80.0, 100.0, 75.0);
    let spot = DVec3::new(0.2, -0.1, 0.0);
    let view = |center: DVec3, target: DVec3| View {
        lens,
        width: 100,
        height: 75,
        camera_from_world: Rigid3::looking_at(center, target, DVec3::Y),
    };
    let others: Vec<View> = (0..20)
        .map(|_| {
            let center = random.vector(1.0) * DVec3::new(1.0, 1.0, 0.2);
            view(center, DVec3::Z * 4.0 + 0.3 * random.vector(1.0))
        })
        .collect();
    // The wall that all see, or a part of it that a triangle before it hides.
    let wall = Proxy::Plane(Plane::new(DVec3::Z * 4.0, DVec3::NEG_Z).unwrap());
    let corners = |z: f64, reach: f64| {
        [(-1.0, -1.0), (1.0, -1.0), (0.0, 1.0)].map(|(x, y)| DVec3::new(reach * x, reach * y, z))
    };
    let two = Mesh {
        positions: [corners(4.0, 20.0), corners(3.0, 0.4)].concat(),
        triangles: vec![[0, 1, 2], [3, 4, 5]],
    };
    let mesh = Proxy::Mesh(Arc::new(Solid::new(MeshKind::Mesh, two)));
    for proxy in [wall, mesh] {
        let drawn = |crowd: usize| {
            // They have all of the picture: of what they have in part, a triangle has no room for all.
            let size = |i: usize| if i < 20 { (100, 75) } else { (400, 300) };
            let alike = (0..crowd).map(|_| View {
                lens: lens_of(80.0, 400.0, 300.0),
                width: 400,
                height: 300,
                ..view(spot, DVec3::Z * 4.0)
            });
            let views: Vec<View> = others.iter().cloned().chain(alike).collect();
            let mut lumigraph = lumigraph(views, &mut Random(1));
            lumigraph.visibility = Visibility::of(&proxy, &lumigraph.sources);
            lumigraph.proxy = proxy.clone();
            lumigraph.photos = PhotoStore::new(lumigraph.sources.len(), move |i| {
                let (width, height) = size(i);
                Ok(RgbaImage::from_fn(width, height, |x, y| {
                    let wave = |n: u32| (x * 7 * n + y * 3 + 40 * i as u32 * n) as u8;
                    Rgba([wave(1), wave(2), wave(3), 255])
                }))
            });
            let desired = View {
                camera_from_world: Rigid3::looking_at(
                    DVec3::new(0.1, 0.0, -0.3),
                    DVec3::Z * 4.0,
                    DVec3::Y,
                ),
                ..others[0].clone()
            };
            let frame = Frame::new(&lumigraph, desired, FieldOptions::default());
            let methods = match lumigraph.visibility {
                None => vec![Method::Exact, Method::TRIANGULATED],
                Some(_) => vec![Method::Exact],
            };
            let drawn = |method| cpu::render(&frame, method).unwrap();
            methods.into_iter().map(drawn).collect::<Vec<_>>()
        };
        let few = drawn(17);
        assert!(few[0].pixels().any(|p| p.0[3] > 0));
        assert!(drawn(300) == few, "{}", proxy.kind());
    }
}
