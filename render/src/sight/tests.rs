//! What moves, moves to where a photo has it, and nothing else does.

use super::known::facets_seen_whole;
use super::*;
use crate::surface::NO_FACET;
use calibrate::{Distortion, Lens, Rigid3};
use proptest::prelude::*;
use proptest::{array, collection};

/// Looks along z from a place on the x axis, 45° to either side.
fn view(x: f64) -> View {
    let center = DVec3::X * x;
    View {
        lens: Lens::pinhole(DVec2::splat(20.0), DVec2::splat(20.0)),
        width: 40,
        height: 40,
        camera_from_world: Rigid3::looking_at(center, center + DVec3::Z, DVec3::Y),
    }
}

fn within_sight(map: FacetMap, desired: &View, sources: &[FrameSource]) -> FacetMap {
    let rays = Rays::of(&desired.lens, (desired.width, desired.height));
    super::within_sight(map, desired, rays.as_ref(), &Views::new(sources))
}

/// Every pixel sees the plane at a depth of 2.
fn flat() -> FacetMap {
    FacetMap::of_pixels(vec![DVec3::Z / 2.0], vec![0; 1600], &view(0.0))
}

#[test]
fn what_a_photo_sees_stays_and_the_rest_moves_just_into_its_image() {
    let (desired, source) = (view(0.0), view(1.0));
    let map = within_sight(flat(), &desired, &[FrameSource::of(&source, &desired)]);
    let mut moved = 0;
    for y in 0..40 {
        for x in 0..40 {
            let ray = desired.lens.unproject(Pixel::center_of(x, y)).unwrap();
            let q = map.planes[map.facet_of[(y * 40 + x) as usize] as usize];
            let s = q.dot(ray);
            let ray_in_world = desired.camera_from_world.rotation.conjugate() * ray;
            let at = |s: f64| source.project(ray_in_world / s);
            let seen = |p: Option<Pixel>| p.is_some_and(|p| source.contains(p));
            let before = ray.z / 2.0;
            if seen(at(before)) {
                assert_eq!(s, before);
            } else {
                // The cameras stand side by side: only farther away does it see more.
                moved += 1;
                assert!(s < before && seen(at(s)), "{x} {y}: {s}");
                let p = at(s * 1.01).unwrap();
                assert!(!source.contains(p), "{x} {y}: {p:?} is well inside");
            }
        }
    }
    // The plane is 4 wide, and the camera stands 1 aside.
    assert_eq!(moved, 10 * 40);
    let seers = |x: f64, y: f64| {
        map.seers
            .within(DVec2::new(x, y), DVec2::new(x + 4.0, y + 4.0))
    };
    assert_eq!(seers(33.0, 33.0).collect::<Vec<_>>(), [0]);
    assert_eq!(seers(3.0, 3.0).count() + seers(90.0, 90.0).count(), 0);
    assert!(seers(-9.0, -9.0).count() <= 1);
}

#[test]
fn what_moves_ends_where_a_photo_has_it_after_rounding_too() {
    // From where the photos were taken, and from so far behind that what is rounded nearly cancels.
    for back in [0.0, 30.0, 100.0, 300.0] {
        let depth = back + 2.0;
        let center = DVec3::NEG_Z * back;
        let desired = View {
            lens: Lens::pinhole(DVec2::splat(10.0 * depth), DVec2::splat(20.0)),
            camera_from_world: Rigid3::looking_at(center, center + DVec3::Z, DVec3::Y),
            ..view(0.0)
        };
        let flat = FacetMap::of_pixels(vec![DVec3::Z / depth], vec![0; 1600], &desired);
        let mut moved = 0;
        for step in 0..60 {
            // All look at what lies ahead, from aside: each pixel ends elsewhere in its photo.
            let angle = 0.1 * f64::from(step);
            let place = DVec3::new(angle.cos(), angle.sin(), 0.3 * (3.0 * angle).cos());
            let pose = Rigid3::looking_at(place, DVec3::Z * 20.0, DVec3::Y);
            let source = View {
                camera_from_world: pose,
                ..view(0.0)
            };
            let source = FrameSource::of(&source, &desired);
            let map = within_sight(flat.clone(), &desired, &[source]);
            for (i, _) in map.moved().enumerate().filter(|(_, is_moved)| *is_moved) {
                let pixel = Pixel::center_of(i as u32 % 40, i as u32 / 40);
                let ray = desired.lens.unproject(pixel).unwrap();
                let s = map.planes[map.facet_of[i] as usize].dot(ray);
                let point = from_source(&source, ray, s);
                // What the plane it was kept as makes of it is off by f64's rounding.
                let edge_px = 0.99 * 40.0 * edge(&source, point, s);
                assert!(shows(&source, point, edge_px), "{back} {step}: {i}");
                moved += 1;
            }
        }
        assert!(moved > 5_000, "{back}: {moved}");
    }
}

#[test]
fn what_nobody_ever_sees_stays_where_it_is() {
    let desired = view(0.0);
    let away = View {
        camera_from_world: Rigid3::looking_at(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y),
        ..view(0.0)
    };
    assert_eq!(
        within_sight(flat(), &desired, &[FrameSource::of(&away, &desired)]),
        flat()
    );
    assert_eq!(within_sight(flat(), &desired, &[]), flat());
    let mut none = flat();
    none.facet_of.fill(NO_FACET);
    let source = FrameSource::of(&view(0.5), &desired);
    assert_eq!(within_sight(none.clone(), &desired, &[source]), none);
}

proptest! {
    /// Facets that are known to be seen are skipped, and no pixel notices, whatever the lenses.
    #[test]
    fn what_is_known_to_be_seen_is(
        planes in collection::vec((0.05..1.0_f64, array::uniform3(-0.2..0.2)), 30),
        places in collection::vec((array::uniform3(-1.5..1.5), -0.25..0.25_f64), 1..5),
        desired_bends in prop_oneof![Just(0.0), -0.2..0.2_f64],
    ) {
        let bent = |view: View, k1: f64| View {
            lens: Lens::new(view.lens.focal, view.lens.principal, Distortion::Rational {
                k: [k1, 0.0, 0.0, 0.0, 0.0, 0.0],
                p: [0.1 * k1, -0.05 * k1],
            }),
            ..view
        };
        let desired = bent(view(0.0), desired_bends);
        let sources: Vec<FrameSource> = places
            .iter()
            .map(|(place, k1)| {
                let place = DVec3::from_array(*place);
                let pose = Rigid3::looking_at(place, 3.0 * DVec3::Z, DVec3::Y);
                let source = View { camera_from_world: pose, ..view(0.0) };
                FrameSource::of(&bent(source, *k1), &desired)
            })
            .collect();
        let q = |(s, tilt): &(f64, [f64; 3])| (DVec3::Z + DVec3::from_array(*tilt)) * *s;
        // Pieces of 8 × 7 pixels.
        let facet_of: Vec<u32> = (0..1600).map(|i| i % 40 / 8 + i / 40 / 7 * 5).collect();
        let map = FacetMap::of_pixels(planes.iter().map(q).collect(), facet_of, &desired);
        if let Some(rays) = Rays::of(&desired.lens, (40, 40)) {
            let all = super::within_sight(map.clone(), &desired, Some(&rays), &Views::new(&sources));
            let views = Views::new(&sources);
            let known = Known::of(&map, &rays, &views);
            let (facets, _) = facets_seen_whole(&map, &rays, &views, &Known::default());
            let one_by_one = moved(&map, &desired, None, &views, &Known::default());
            for (y, row) in one_by_one.iter().enumerate() {
                for at in row {
                    let facet = map.facet_of[y * 40 + at.x] as usize;
                    prop_assert!(!facets[facet], "{} {y} of {facet}", at.x);
                    let tile = y / TILE * known.across + at.x / TILE;
                    prop_assert!(!known.tiles[tile], "{} {y} of tile {tile}", at.x);
                    prop_assert!(!known.facets[facet], "{} {y} of {facet}", at.x);
                }
            }
            let count: usize = one_by_one.iter().map(Vec::len).sum();
            prop_assert_eq!(all.planes.len() - 30, count);
        }
    }
}
