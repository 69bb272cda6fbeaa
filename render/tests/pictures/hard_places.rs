//! Where the field turns faster than any grid: at a plane's horizon and at epipoles.

use crate::common;

use calibrate::Pixel;
use common::{Shot, psnr};
use glam::{DVec2, DVec3};
use proxy::{Plane, Proxy};
use render::{FieldOptions, Frame, Method, TriangulatedField, cpu};

const SIZE: (u32, u32) = (480, 360);

/// How far the triangulated picture is from the exact one.
fn db(frame: &Frame<'_>) -> f64 {
    let [exact, triangulated] =
        [Method::Exact, Method::TRIANGULATED].map(|m| cpu::render(frame, m).unwrap());
    assert!(exact.pixels().any(|p| p.0[3] > 0));
    psnr(&triangulated, &exact)
}

#[test]
fn views_of_a_planes_horizon_are_as_exact() {
    let shot = Shot::of("hallway", 12, None);
    // The floor ends half way up the picture. The ceiling and a wall are so near that the field
    // turns beside their horizons, too.
    let floor = DVec3::new(-1.1, 0.0, 0.0);
    let ceiling = DVec3::Y * 2.6;
    for (on_it, normal, name, least) in [
        (floor, DVec3::Y, "floor", 55.0),
        (ceiling, DVec3::Y, "ceiling", 50.0),
        (floor, DVec3::X, "wall", 50.0),
    ] {
        let mut lumigraph = shot.lumigraph();
        lumigraph.proxy = Proxy::Plane(Plane::new(on_it, normal).unwrap());
        for (first, share) in [(1, 0.5), (4, 0.3), (7, 0.5), (9, 0.05)] {
            let desired = shot.views[first].between(&shot.views[first + 1], share);
            let frame = Frame::new(
                &lumigraph,
                desired.resized(SIZE.0, SIZE.1),
                FieldOptions::default(),
            );
            let sees = |x: u32, y: u32| frame.proxy_point(Pixel::center_of(x, y)).is_some();
            let corners = [
                (0, 0),
                (SIZE.0 - 1, 0),
                (0, SIZE.1 - 1),
                (SIZE.0 - 1, SIZE.1 - 1),
            ];
            let seen = corners.iter().filter(|(x, y)| sees(*x, *y)).count();
            assert!((1..4).contains(&seen), "{name}, {first}: no horizon");
            let db = db(&frame);
            println!("{name}, {first}, {share}: {db:.1} dB");
            assert!(db >= least, "{name}, {first}, {share}: {db} dB");
        }
    }
}

#[test]
fn views_along_the_way_ahead_are_as_exact() {
    let shot = Shot::of("hallway", 12, None);
    let end = Plane::new(DVec3::Z * -7.0, DVec3::Z).unwrap();
    for (plane, name) in [(shot.plane, "fitted"), (end, "end")] {
        let mut lumigraph = shot.lumigraph();
        lumigraph.proxy = Proxy::Plane(plane);
        for (first, share) in [(1, 0.01), (1, 0.5), (5, 0.01), (5, 0.4), (8, 0.02)] {
            let desired = shot.views[first].between(&shot.views[first + 1], share);
            let frame = Frame::new(
                &lumigraph,
                desired.resized(SIZE.0, SIZE.1),
                FieldOptions::default(),
            );
            let field = TriangulatedField::new(&frame, 32).unwrap();
            let size = DVec2::new(f64::from(SIZE.0), f64::from(SIZE.1));
            let well_inside = |at: DVec2| at.cmpgt(0.1 * size).all() && at.cmplt(0.9 * size).all();
            let inside = field.epipoles.iter().filter(|(_, at)| well_inside(*at));
            assert!(inside.count() > 0, "{name}, {first}: no epipole");
            let db = db(&frame);
            println!("{name}, {first}, {share}: {db:.1} dB");
            assert!(db >= 60.0, "{name}, {first}, {share}: {db} dB");
        }
    }
}
