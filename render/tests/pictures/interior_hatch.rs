//! What one sees through a hatch: from all around it, where images before a doorway are seen from one side.

use crate::house;

use glam::DVec3;
use house::view;
use proxy::interior::{Contents, Interior, parse_rooms};
use proxy::mesh::{Mesh, Model};
use render::interior::{LdiSource, PortalFill, Walk, WalkOptions};
use std::path::Path;

/// Two rooms, one over the other, with a hatch of 1 × 1 m between them; every corner has a colour of its own.
fn storeys() -> (Interior, Model) {
    let mut mesh = Mesh::default();
    let mut quad = |corners: [[f64; 3]; 4]| {
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(corners.map(DVec3::from_array));
        let halves = [[0, 1, 2], [0, 2, 3]].map(|half| half.map(|i| first + i));
        mesh.triangles.extend(halves);
    };
    let mut level = |y: f64, [x, z]: [f64; 2], [end, far]: [f64; 2]| {
        quad([[x, y, z], [end, y, z], [end, y, far], [x, y, far]]);
    };
    level(0.0, [0.0, 0.0], [6.0, 6.0]);
    level(5.0, [0.0, 0.0], [6.0, 6.0]);
    // Around the hatch.
    level(2.5, [0.0, 0.0], [2.5, 6.0]);
    level(2.5, [3.5, 0.0], [6.0, 6.0]);
    level(2.5, [2.5, 0.0], [3.5, 2.5]);
    level(2.5, [2.5, 3.5], [3.5, 6.0]);
    for [x, z, end, far] in [
        [0.0, 0.0, 6.0, 0.0],
        [6.0, 0.0, 6.0, 6.0],
        [6.0, 6.0, 0.0, 6.0],
        [0.0, 6.0, 0.0, 0.0],
    ] {
        quad([[x, 0.0, z], [end, 0.0, far], [end, 5.0, far], [x, 5.0, z]]);
    }
    let mut model = Model::default();
    model.append(&mesh, "storeys");
    for (i, color) in model.colors.iter_mut().enumerate() {
        *color = [
            (37 * i % 256) as u8,
            (101 * i % 256) as u8,
            (199 * i % 256) as u8,
            255,
        ];
    }
    let text = r#"{"version": 1, "rooms": [
        {"name": "below", "min": [0, 0, 0], "max": [6, 2.5, 6]},
        {"name": "above", "min": [0, 2.5, 0], "max": [6, 5, 6]}],
        "openings": [{"name": "hatch", "between": ["below", "above"],
            "polygon": [[2.5, 2.5, 2.5], [3.5, 2.5, 2.5], [3.5, 2.5, 3.5], [2.5, 2.5, 3.5]]}]}"#;
    let read = parse_rooms(Path::new("r.json"), text.as_bytes(), "m.glb");
    (read.unwrap().0, model)
}

#[test]
fn through_a_hatch_one_sees_the_same_from_all_around_whatever_fills_portals() {
    let (interior, model) = storeys();
    let (contents, _) = Contents::new(&interior, &model).unwrap();
    let mut options = WalkOptions::default();
    options.library.size = [64, 64];
    options.library.ldi_of = LdiSource::Views;
    let mut walk = Walk::new(&interior, &contents, &model, options);
    // No image would be used.
    assert_eq!(walk.library().len(), 0);
    let hatch = interior.portals[0].polygon.center();
    for eighth in 0..8 {
        let around = std::f64::consts::FRAC_PI_4 * f64::from(eighth);
        let aside = 2.2 * DVec3::new(around.cos(), 0.0, around.sin());
        // From the floor above, and from the one below.
        for height in [4.1, 1.6] {
            let eye = aside + hatch.with_y(height);
            let desired = view(eye, hatch, [80, 64]);
            walk.draw(&desired, PortalFill::Geometry).unwrap();
            let expected = walk.picture().color.clone();
            assert!(expected.iter().all(|color| color[3] == 255));
            for fill in PortalFill::ALL {
                let cost = walk.draw(&desired, fill).unwrap();
                assert_eq!((cost.portals, cost.filled, cost.holes), (1, 0, 0));
                let same = walk.picture().color == expected;
                assert!(same, "{} at {eye}", fill.name());
            }
        }
    }
}
