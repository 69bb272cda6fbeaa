//! Portals that are not convex: each is one, however many pieces its outline has.

use crate::house;
use crate::interior_corner::quad;

use glam::DVec3;
use house::view;
use proxy::interior::{Contents, Interior, parse_rooms};
use proxy::mesh::Model;
use render::interior::{FrameCost, Pinhole, PortalFill, Target, Walk, WalkOptions};
use std::path::Path;

/// Rooms one behind the other along x, and openings between them.
fn interior(outline: &[[f64; 2]]) -> Interior {
    let room = |i: usize, name: &str| {
        let [from, to] = [4 * i, 4 * i + 4];
        format!(r#"{{"name": "{name}", "min": [{from}, 0, 0], "max": [{to}, 3, 4]}}"#)
    };
    let rooms = ["a", "b", "c"]
        .iter()
        .enumerate()
        .map(|(i, name)| room(i, name));
    let rooms = rooms.collect::<Vec<_>>().join(",");
    let opening = |x: f64, between: &str| {
        let corners = outline.iter().map(|[y, z]| format!("[{x}, {y}, {z}]"));
        let corners = corners.collect::<Vec<_>>().join(",");
        format!(r#"{{"name": "{x}", "between": [{between}], "polygon": [{corners}]}}"#)
    };
    let openings = [opening(4.0, r#""a", "b""#), opening(8.0, r#""b", "c""#)].join(",");
    let text = format!(r#"{{"version": 1, "rooms": [{rooms}], "openings": [{openings}]}}"#);
    let (interior, _) = parse_rooms(Path::new("rooms.json"), text.as_bytes(), "m.glb").unwrap();
    interior
}

/// y and z of a U, its notch above.
const U: [[f64; 2]; 8] = [
    [0.0, 1.0],
    [0.0, 3.0],
    [2.0, 3.0],
    [2.0, 2.5],
    [1.0, 2.5],
    [1.0, 1.5],
    [2.0, 1.5],
    [2.0, 1.0],
];
/// Its bounds.
const AROUND: [[f64; 2]; 4] = [[0.0, 1.0], [0.0, 3.0], [2.0, 3.0], [2.0, 1.0]];

/// The rooms, each in colours of its own, with walls between them that leave the U open.
fn model() -> Model {
    let mut model = Model::default();
    for (room, shade) in [(0.0, 60), (1.0, 130), (2.0, 200)] {
        let [from, to] = [4.0 * room, 4.0 * room + 4.0];
        let along = |[y, z]: [f64; 2], [v, w]: [f64; 2]| {
            [[from, y, z], [to, y, z], [to, v, w], [from, v, w]]
        };
        let sides = [
            along([0.0, 0.0], [0.0, 4.0]),
            along([3.0, 0.0], [3.0, 4.0]),
            along([0.0, 0.0], [3.0, 0.0]),
            along([0.0, 4.0], [3.0, 4.0]),
        ];
        for (i, side) in sides.into_iter().enumerate() {
            let color = [shade, 255 - shade, 60 * i as u8, 255];
            quad(&mut model, "side", side, color);
        }
    }
    let mut across = |x: f64, [y, v]: [f64; 2], [z, w]: [f64; 2]| {
        let corners = [[x, y, z], [x, y, w], [x, v, w], [x, v, z]];
        quad(&mut model, "wall", corners, [240, 240, 240, 255]);
    };
    for x in [4.0, 8.0] {
        across(x, [0.0, 3.0], [0.0, 1.0]);
        across(x, [0.0, 3.0], [3.0, 4.0]);
        across(x, [2.0, 3.0], [1.0, 3.0]);
        across(x, [1.0, 2.0], [1.5, 2.5]);
    }
    across(0.0, [0.0, 3.0], [0.0, 4.0]);
    across(12.0, [0.0, 3.0], [0.0, 4.0]);
    model
}

/// A picture, and what it took.
fn drawn(
    model: &Model,
    outline: &[[f64; 2]],
    eye: DVec3,
    near: f64,
    fill: PortalFill,
) -> (Target, FrameCost) {
    let interior = interior(outline);
    let (contents, _) = Contents::new(&interior, model).unwrap();
    let mut options = WalkOptions {
        near,
        ..WalkOptions::default()
    };
    options.library.size = [64; 2];
    options.library.semicircles.views = 3;
    let mut walk = Walk::new(&interior, &contents, model, options);
    let cost = walk.draw(&desired(eye), fill).unwrap();
    (walk.picture().clone(), cost)
}

fn desired(eye: DVec3) -> calibrate::View {
    view(eye, DVec3::new(8.0, 1.1, 2.03), [120, 90])
}

/// Far from the first opening, and before it.
const FAR: DVec3 = DVec3::new(0.5, 1.37, 1.91);
const NEAR: DVec3 = DVec3::new(3.6, 0.95, 1.55);

#[test]
fn a_portal_that_is_not_convex_is_filled_and_counted_once() {
    let model = model();
    for fill in [PortalFill::Texture, PortalFill::Warp2, PortalFill::Ldi] {
        // With images before the first one, and, where that is near, before the one behind it.
        for eye in [FAR, NEAR] {
            let (_, cost) = drawn(&model, &U, eye, 0.5, fill);
            assert_eq!((cost.portals, cost.filled), (1, 1), "{fill:?} from {eye}");
        }
    }
}

#[test]
fn what_is_beside_a_portal_that_is_not_convex_is_not_filled() {
    let model = model();
    let (whole, _) = drawn(&model, &U, FAR, 1.0, PortalFill::Whole);
    let camera = Pinhole::new(&desired(FAR)).unwrap();
    for fill in [PortalFill::Texture, PortalFill::Warp2, PortalFill::Ldi] {
        let (picture, cost) = drawn(&model, &U, FAR, 0.5, fill);
        assert_eq!(cost.filled, 1);
        let (mut before, mut beyond) = (0, 0);
        for y in 0..90 {
            for x in 0..120 {
                let pixel = (y * 120 + x) as usize;
                let s = f64::from(whole.inverse_depth[pixel]);
                let point = FAR + camera.rotation.transpose() * (camera.ray(x, y) / s);
                if point.x < 4.0 + 1e-5 {
                    assert_eq!(picture.color[pixel], whole.color[pixel], "{fill:?} {x} {y}");
                    before += 1;
                } else {
                    beyond += usize::from(picture.color[pixel][3] == 255);
                }
            }
        }
        assert!(before > 1000 && beyond > 300, "{fill:?} {before} {beyond}");
    }
}

#[test]
fn geometry_beyond_portals_that_are_not_convex_is_asked_for_once() {
    let model = model();
    for eye in [FAR, NEAR] {
        let (whole, _) = drawn(&model, &U, eye, 1.0, PortalFill::Whole);
        let (culled, _) = drawn(&model, &U, eye, 1.0, PortalFill::Geometry);
        assert!(whole == culled, "{eye}");
        // So near that all of it is geometry.
        let [u, around] = [&U[..], &AROUND[..]]
            .map(|outline| drawn(&model, outline, eye, 100.0, PortalFill::Warp2));
        assert!(whole == u.0 && whole == around.0, "{eye}");
        assert_eq!(u.1.filled, 0);
        let asked = [&u, &around].map(|(_, cost)| cost.triangles_in_cells);
        assert_eq!(asked[0], asked[1], "{eye}");
    }
}
