//! A room with a corner: from one of its arms a portal of the other is seen behind one of its own.

use crate::house;

use glam::DVec3;
use house::view;
use proxy::interior::{CellId, Contents, Interior, parse_rooms};
use proxy::mesh::{Mesh, Model};
use render::interior::{PortalFill, Walk, WalkOptions};
use std::path::Path;

/// The room, one within its corner, and one beyond the end of its other arm.
const ROOMS: &str = r#"{
  "version": 1,
  "rooms": [
    {"name": "corner", "min": [0, 0, 0], "max": [6, 3, 6],
     "floor": [[0, 0, 0], [0, 0, 6], [2, 0, 6], [2, 0, 2], [6, 0, 2], [6, 0, 0]]},
    {"name": "within", "min": [2, 0, 2], "max": [5.5, 3, 6]},
    {"name": "end", "min": [6, 0, 0], "max": [9, 3, 2]}
  ],
  "openings": [OPENINGS]
}"#;
const WITHIN: &str = r#"{"name": "within", "between": ["corner", "within"],
  "polygon": [[2, 0, 3], [2, 0, 5], [2, 2, 5], [2, 2, 3]]}"#;
const END: &str = r#"{"name": "end", "between": ["corner", "end"],
  "polygon": [[6, 0, 0.5], [6, 0, 1.5], [6, 2, 1.5], [6, 2, 0.5]]}"#;

/// Four corners of a wall.
pub(crate) fn quad(model: &mut Model, node: &str, corners: [[f64; 3]; 4], color: [u8; 4]) {
    let mesh = Mesh {
        positions: corners.map(DVec3::from_array).to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
    };
    let first = model.colors.len();
    model.append(&mesh, node);
    model.colors[first..].fill(color);
}

/// A wall across x from one z to another, with an opening if there is one.
fn across_x(model: &mut Model, x: f64, z: [f64; 2], door: Option<[f64; 2]>, color: [u8; 4]) {
    let mut part = |z: [f64; 2], y: [f64; 2]| {
        let corners = [
            [x, y[0], z[0]],
            [x, y[0], z[1]],
            [x, y[1], z[1]],
            [x, y[1], z[0]],
        ];
        quad(model, "wall", corners, color);
    };
    match door {
        None => part(z, [0.0, 3.0]),
        Some(door) => {
            part([z[0], door[0]], [0.0, 3.0]);
            part([door[1], z[1]], [0.0, 3.0]);
            part(door, [2.0, 3.0]);
        }
    }
}

/// Walls across x are all that these views see: grey, red in the room within, blue in that at the end.
fn model() -> Model {
    let mut model = Model::default();
    let (grey, red, blue) = ([120, 120, 120, 255], [220, 0, 0, 255], [0, 0, 220, 255]);
    across_x(&mut model, 2.0, [2.0, 6.0], Some([3.0, 5.0]), grey);
    across_x(&mut model, 6.0, [0.0, 2.0], Some([0.5, 1.5]), grey);
    across_x(&mut model, 5.5, [2.0, 6.0], None, red);
    across_x(&mut model, 9.0, [0.0, 2.0], None, blue);
    // The room within is closed towards the other arm.
    let side = [
        [2.0, 0.0, 2.01],
        [5.5, 0.0, 2.01],
        [5.5, 3.0, 2.01],
        [2.0, 3.0, 2.01],
    ];
    quad(&mut model, "side", side, red);
    model
}

fn interior(openings: [&str; 2]) -> Interior {
    let text = ROOMS.replace("OPENINGS", &openings.join(","));
    let (interior, _) = parse_rooms(Path::new("rooms.json"), text.as_bytes(), "m.glb").unwrap();
    interior
}

#[test]
fn a_portal_shows_what_is_beyond_it_not_beyond_another_behind_it() {
    let model = model();
    let ways = [[WITHIN, END], [END, WITHIN]].map(interior);
    let contents = ways
        .each_ref()
        .map(|interior| Contents::new(interior, &model).unwrap().0);
    let target = DVec3::new(6.0, 1.2, 1.0);
    let (mut crossed, mut alone) = (0, 0);
    for eye in [[0.5, 1.4, 5.2], [1.0, 1.2, 4.6], [1.95, 1.2, 4.4]].map(DVec3::from_array) {
        let desired = view(eye, target, [160, 120]);
        for fill in [
            PortalFill::Texture,
            PortalFill::Warp1,
            PortalFill::Ldi,
            PortalFill::Geometry,
        ] {
            let pictures = [0, 1].map(|way: usize| {
                // Nearer than it may as a rule a portal is filled.
                let mut options = WalkOptions {
                    near: 0.3,
                    ..WalkOptions::default()
                };
                options.library.size = [96; 2];
                options.library.semicircles.views = 3;
                let mut walk = Walk::new(&ways[way], &contents[way], &model, options);
                let cost = walk.draw(&desired, fill).unwrap();
                assert_eq!(cost.cell, Some(CellId(0)));
                crossed += usize::from(cost.filled == 2);
                alone += usize::from(cost.filled == 1);
                walk.picture().clone()
            });
            assert!(pictures[0] == pictures[1], "{fill:?} from {eye}");
            // Through the opening within the corner one sees red alone, wherever the other is.
            let is_blue = |pixel: &&[u8; 4]| pixel[2] > 150 && pixel[0] < 100;
            let blue = pictures[0].color.iter().filter(is_blue).count();
            assert_eq!(blue, 0, "{fill:?} from {eye}");
        }
    }
    assert!(crossed > 0 && alone > 0, "{crossed} {alone}");
}
