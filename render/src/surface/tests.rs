use super::*;
use crate::{PhotoStore, SourceView};
use calibrate::{Distortion, Lens, Rigid3};
use image::RgbaImage;
use proptest::collection::vec;
use proptest::prelude::*;
use proxy::{Mesh, MeshKind, SparsePoint};
use std::sync::Arc;

/// Two photos ahead, and points seen by both, all far to the left of a view between them, at a depth
/// of 5.
fn lumigraph(within: Option<Arc<Solid>>) -> Lumigraph {
    let source = |x: f64| SourceView {
        name: format!("{x}"),
        view: ahead(DVec3::X * x, Distortion::None),
        gain: [1.0; 3],
        time_s: None,
        quarters: 0,
    };
    let point = |i: i32| SparsePoint {
        position: DVec3::new(-30.0, 0.2 * f64::from(i), 5.0),
        seen_by: vec![0, 1],
    };
    Lumigraph {
        sources: vec![source(-1.0), source(1.0)],
        photos: PhotoStore::from_images(vec![RgbaImage::new(40, 40); 2]),
        proxy: Proxy::Points { within },
        points: (-20..20).map(point).collect(),
        visibility: None,
    }
}

fn ahead(center: DVec3, distortion: Distortion) -> View {
    View {
        lens: Lens::new(DVec2::splat(20.0), DVec2::splat(20.0), distortion),
        width: 40,
        height: 40,
        camera_from_world: Rigid3::looking_at(center, center + DVec3::Z, DVec3::NEG_Y),
    }
}

/// Straight rays, bent ones, and some that look back, which are not known beforehand.
fn blank_views() -> [View; 3] {
    let fisheye = Distortion::Fisheye { k: [0.0; 4] };
    let mut views = [Distortion::None, fisheye, fisheye].map(|d| ahead(DVec3::ZERO, d));
    views[2].lens = Lens::new(DVec2::splat(11.0), DVec2::splat(20.0), fisheye);
    let are_known = views.each_ref().map(|v| rays(v).is_some());
    assert_eq!(are_known, [true, true, false]);
    views
}

fn rays(view: &View) -> Option<Rays> {
    Rays::of(&view.lens, (view.width, view.height))
}

#[test]
fn a_view_of_no_points_looks_at_a_plane() {
    let lumigraph = lumigraph(None);
    let [pinhole, ..] = blank_views();
    let surface = Surface::of(&lumigraph, &pinhole, &[]);
    for at in [0.5, 20.0, 39.5] {
        let q = surface.plane_at(Pixel::new(at, at)).unwrap();
        assert!((1.0 / q.z - 5.0).abs() < 0.3, "{at}: {q}");
    }
    // Nobody knows where anything is.
    let nothing = Lumigraph {
        points: Vec::new(),
        ..lumigraph
    };
    assert_eq!(Surface::of(&nothing, &pinhole, &[]), Surface::Nothing);
}

#[test]
fn a_plane_for_want_of_points_stays_within_the_hull() {
    // A box before the plane, one unit to either side of the axis.
    let corner = |i: u32| {
        let pick = |bit: u32, low: f64, high: f64| if i >> bit & 1 == 1 { high } else { low };
        DVec3::new(pick(0, -1.0, 1.0), pick(1, -1.0, 1.0), pick(2, 2.0, 3.0))
    };
    let faces = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let triangles = faces.map(|[a, b, c, d]: [u32; 4]| [[a, b, c], [a, c, d]]);
    let mesh = Mesh {
        positions: (0..8).map(corner).collect(),
        triangles: triangles.concat(),
    };
    let hull = Arc::new(Solid::new(MeshKind::Hull, mesh));
    let lumigraph = lumigraph(Some(hull));
    let [pinhole, ..] = blank_views();
    let surface = Surface::of(&lumigraph, &pinhole, &[]);
    let q = surface.plane_at(Pixel::new(20.5, 19.5)).unwrap();
    assert!((1.0 / q.z - 3.0).abs() < 1e-9, "{q}");
    assert_eq!(surface.plane_at(Pixel::new(1.5, 20.5)), None);
    // Of a plane through the box, ray by ray it is the same.
    let q = DVec3::new(0.3, 0.0, 0.35);
    for view in blank_views() {
        let within = lumigraph.proxy.within();
        let map = FacetMap::of_plane(q, &view, rays(&view).as_ref(), within);
        let one_by_one = FacetMap::of_plane(q, &view, None, within);
        let mut seen = 0;
        for i in 0..1600 {
            let ray = view.lens.unproject(Pixel::center_of(i % 40, i / 40));
            let s = [&map, &one_by_one].map(|map| {
                let plane = map.plane_of(map.facet_of[i as usize])?;
                Some(plane.dot(ray?))
            });
            match s {
                [Some(a), Some(b)] => {
                    assert!((a - b).abs() < 1e-9, "{i}: {a} {b}");
                    seen += 1;
                }
                other => assert_eq!(other, [None, None], "{i}"),
            }
        }
        assert!((50..800).contains(&seen), "{seen}");
    }
}

#[test]
fn a_plane_is_seen_as_far_as_its_horizon() {
    for view in blank_views() {
        let map = FacetMap::of_plane(DVec3::Y, &view, rays(&view).as_ref(), None);
        let rows = map.facet_of.chunks(40).map(|row| row[20] != NO_FACET);
        assert_eq!(rows.filter(|is_seen| *is_seen).count(), 20);
    }
}

proptest! {
    #[test]
    fn packed_planes_are_those_that_are_seen(
        facets in vec(0_u32..6000, 20), spare in 0_usize..6000, [width, height] in [1_u32..30, 1_u32..30],
    ) {
        let planes: Vec<DVec3> = (0..6000 - spare).map(|i| DVec3::splat(i as f64)).collect();
        let seen = |f: &u32| if (*f as usize) < planes.len() { *f } else { NO_FACET };
        // Some tiles see one, others several.
        let facet = |i: u32| facets[(i % width / 5 + i / width / 7 * 3) as usize % facets.len()];
        let facet_of: Vec<u32> = (0..width * height).map(|i| seen(&facet(i))).collect();
        let desired = View {
            lens: Lens::pinhole(DVec2::ONE, DVec2::ONE),
            width,
            height,
            camera_from_world: Rigid3::IDENTITY,
        };
        let map = FacetMap::of_pixels(planes, facet_of, &desired);
        let Packed { planes, numbers } = map.packed(true);
        for (i, facet) in map.facet_of.iter().enumerate() {
            let (x, y) = (i % width as usize, i / width as usize);
            let of_tile = numbers[y / TILE * (width as usize).div_ceil(TILE) + x / TILE] as usize;
            let number = match of_tile % 2 {
                0 => of_tile / 2,
                _ => numbers[of_tile / 2 + y % TILE * TILE + x % TILE] as usize,
            };
            let plane = number.checked_sub(1).map(|at| planes[at]);
            prop_assert_eq!(plane, map.plane_of(*facet));
        }
        prop_assert!(planes.len() <= 4096);
        let one_by_one = map.packed(false);
        for (number, facet) in one_by_one.numbers.iter().zip(map.facet_of.iter()) {
            let plane = number.checked_sub(1).map(|at| one_by_one.planes[at as usize]);
            prop_assert_eq!(plane, map.plane_of(*facet));
        }
    }
}
