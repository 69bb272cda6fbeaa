//! A procedural house: rooms, openings, furniture, baked light; a model, its interior, and the
//! truth about what any camera in it sees.
//!
//! With 19 rooms it has the 52 openings of Brooks House (Rafferty et al. 1998), and as many
//! triangles as are asked for.
//!
//! ```
//! use datasets::house::{HouseOptions, house};
//!
//! let options = HouseOptions { rooms: 2, ..HouseOptions::default() };
//! let house = house(&options).unwrap();
//! assert_eq!(house.interior.cells.len(), 2);
//! assert!(!house.interior.portals.is_empty());
//! ```

mod bake;
mod builder;
mod furniture;
mod plan;
mod render;
mod textures;
mod walls;
mod write;

pub use render::render;
pub use write::write;

use crate::DatasetError;
use crate::noise::{hash, unit};
use builder::{Builder, Look, Stand, plain};
use furniture::ROOMS;
use glam::{DVec2, DVec3};
use plan::{HEIGHT, Plan, Rect};
use proxy::interior::{
    Cell, CellId, Content, Extra, Interior, Polygon, Portal, RoomBox, interior_from_rooms,
};
use proxy::mesh::Model;
use proxy::{MeshKind, Solid};
use textures::Picture;
use walls::Side;

/// What can be chosen about a house.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HouseOptions {
    /// How many rooms, 2 to 64: each is a cell.
    pub rooms: usize,
    /// At least so many triangles, up to 20 million; none is 12,000 for each room. A house has
    /// some 6,000 for each room however few are asked for.
    pub triangles: Option<usize>,
    /// Another number is another house.
    pub seed: u32,
}

impl Default for HouseOptions {
    fn default() -> Self {
        Self {
            rooms: 6,
            triangles: None,
            seed: 1,
        }
    }
}

/// A house, in metres, y up.
#[derive(Debug)]
pub struct House {
    /// Its rooms and openings. A room's box reaches to the middle of its walls and a portal
    /// lies in the middle of its wall, so every line of sight from room to room meets one.
    pub interior: Interior,
    /// Its triangles and how they look. Positions are as a GLB holds them.
    pub model: Model,
    solid: Solid,
}

/// The name of the model's file.
pub const MODEL_FILE: &str = "house.glb";
/// The name of the interior's file.
pub const INTERIOR_FILE: &str = "interior.json";
/// How high eyes are over the floor, in metres.
pub(crate) const EYE_HEIGHT: f64 = 1.6;
const TRIANGLES_PER_ROOM: usize = 12_000;

/// A house by its options: the same for the same options, whatever the machine's threads.
///
/// # Errors
/// An option out of its range.
pub fn house(options: &HouseOptions) -> Result<House, DatasetError> {
    let refuse = |option, found: usize, expected| {
        let found = found.to_string();
        Err(DatasetError::Option {
            option,
            found,
            expected,
        })
    };
    if !(2..=64).contains(&options.rooms) {
        return refuse("the number of rooms", options.rooms, "2 to 64");
    }
    let wanted = options
        .triangles
        .unwrap_or(TRIANGLES_PER_ROOM * options.rooms);
    if wanted > 20_000_000 {
        return refuse("the number of triangles", wanted, "20000000 or fewer");
    }
    let plan = plan::plan(options.rooms, options.seed);
    // Finer until there are enough.
    let mut density = 1.0;
    let mut builder = build(&plan, density, options.seed);
    while builder.triangle_count() < wanted {
        let ratio = wanted as f64 / builder.triangle_count() as f64;
        density *= (0.97 * ratio.sqrt()).max(1.02);
        builder = build(&plan, density, options.seed);
    }
    let solid = Solid::new(MeshKind::Mesh, builder.mesh());
    let colors = bake::bake(&builder, &plan, &solid);
    Ok(House {
        interior: interior(&plan, options.seed),
        model: builder.model(colors),
        solid,
    })
}

fn use_of(room: usize, seed: u32) -> usize {
    // Every kind in turn, beginning anywhere.
    (room + hash(seed, 50, 0, 0) as usize) % ROOMS.len()
}

fn name(room: usize, seed: u32) -> String {
    format!("{} {}", ROOMS[use_of(room, seed)].0, room + 1)
}

fn interior(plan: &Plan, seed: u32) -> Interior {
    let cell = |(i, room): (usize, &Rect)| Cell {
        name: name(i, seed),
        content: Content::Box(RoomBox {
            min: DVec3::new(room.min.x, 0.0, room.min.y),
            max: DVec3::new(room.max.x, HEIGHT, room.max.y),
        }),
        floor: None,
        other: Extra::new(),
    };
    let portal = |(i, opening): (usize, &plan::Opening)| {
        let point = |along: f64, up: f64| {
            let mut at = DVec2::ZERO;
            at[opening.axis] = opening.at;
            at[1 - opening.axis] = along;
            DVec3::new(at.x, up, at.y)
        };
        let (from, to) = (opening.from, opening.to);
        let corners = vec![
            point(from, opening.sill),
            point(to, opening.sill),
            point(to, opening.head),
            point(from, opening.head),
        ];
        Portal {
            name: format!("{} {}", opening.kind.name(), i + 1),
            polygon: Polygon::new(corners).expect("an opening is a rectangle"),
            cells: opening.rooms.map(|room| Some(CellId(room as u32))),
            radius: None,
            other: Extra::new(),
        }
    };
    let interior = Interior {
        model: Some(MODEL_FILE.to_owned()),
        up: DVec3::Y,
        eye_height: EYE_HEIGHT,
        cells: plan.rooms.iter().enumerate().map(cell).collect(),
        portals: plan.openings.iter().enumerate().map(portal).collect(),
        held_out: Vec::new(),
        other: Extra::new(),
    };
    let (interior, _) = interior_from_rooms(interior).expect("a plan does not contradict itself");
    interior
}

fn build(plan: &Plan, density: f64, seed: u32) -> Builder {
    let mut b = Builder::new(density);
    for room in 0..plan.rooms.len() {
        let kind = use_of(room, seed);
        let node = b.node(name(room, seed), None);
        walls::shell(&mut b, plan, room, kind == 2, seed);
        furnish(&mut b, plan, room, kind, node, seed);
    }
    b.node("linings".to_owned(), None);
    for opening in &plan.openings {
        walls::lining(&mut b, opening);
    }
    b
}

/// The floor that something takes, along a wall and into the room.
fn footprint(side: &Side, from: f64, to: f64, depth: f64) -> Rect {
    let (p, q) = (side.point(from, 0.0, 0.0), side.point(to, 0.0, depth));
    let (p, q) = (DVec2::new(p.x, p.z), DVec2::new(q.x, q.z));
    Rect {
        min: p.min(q),
        max: p.max(q),
    }
}

/// A free place of some width along a wall, the nearest to its middle.
fn free_place(side: &Side, [width, depth]: [f64; 2], taken: &[&[Rect]]) -> Option<f64> {
    let middle = 0.5 * (side.from + side.to);
    let reach = 0.5 * (side.to - side.from - width) - 0.03;
    let steps = (reach / 0.1).floor();
    if !(reach >= 0.0) {
        return None;
    }
    let offsets = (0..=steps as i32).flat_map(|i| [0.1 * f64::from(i), -0.1 * f64::from(i)]);
    offsets.map(|offset| middle + offset).find(|at| {
        let place = footprint(side, at - 0.5 * width, at + 0.5 * width, depth);
        !taken
            .iter()
            .any(|list| list.iter().any(|t| t.overlaps(&place)))
    })
}

fn furnish(b: &mut Builder, plan: &Plan, room: usize, kind: usize, parent: u32, seed: u32) {
    let rect = plan.rooms[room];
    let seed = hash(seed, room as i32, 60, 0);
    let mut sides = Side::all(plan, room);
    sides.rotate_left(seed as usize % 4);
    // What is taken by anything, and what is by windows.
    let (mut taken, mut windows): (Vec<Rect>, Vec<Rect>) = (Vec::new(), Vec::new());
    // 1. One must get through doors, and see out of windows.
    for side in &sides {
        for opening in side.openings(plan, room) {
            let (from, to) = (opening.from - 0.08, opening.to + 0.08);
            match opening.sill > 0.0 {
                true => windows.push(footprint(side, from, to, 0.35)),
                false => taken.push(footprint(side, from, to, 0.75)),
            }
        }
    }
    // 2. The middle.
    let middle = rect.middle();
    let stand = |at: DVec2, front: DVec3| Stand {
        origin: DVec3::new(at.x, 0.0, at.y),
        front,
    };
    let size = rect.size();
    let front = if size.x > size.y { DVec3::Z } else { DVec3::X };
    let (across, along) = (size.max_element(), size.min_element());
    let has_table = [0, 4].contains(&kind) && along > 3.2;
    if has_table || kind == 1 {
        b.node("rug".to_owned(), Some(parent));
    }
    b.stand = stand(middle, front);
    if has_table {
        let rug = [(across - 1.6).min(2.6), (along - 1.6).min(1.9)];
        furniture::middle(b, rug, kind == 4, seed);
        let half = if kind == 4 { [0.85, 0.9] } else { [0.55, 0.35] };
        let half = if front == DVec3::Z {
            DVec2::from_array(half)
        } else {
            DVec2::new(half[1], half[0])
        };
        taken.push(Rect {
            min: middle - half,
            max: middle + half,
        });
    }
    // 3. Windows to the outside, that are but pictures.
    for side in sides.iter().filter(|side| !side.is_shared(plan)) {
        if let Some(at) = free_place(side, [1.6, 0.2], &[&taken, &windows]) {
            b.node("window".to_owned(), Some(parent));
            b.stand = Stand {
                origin: side.point(at, 0.0, 0.0),
                front: side.normal(),
            };
            furniture::painting(b, [1.3, 1.15], Picture::Outside, true);
            windows.push(footprint(side, at - 0.75, at + 0.75, 0.2));
        }
    }
    // 4. Along the walls.
    for (i, item) in ROOMS[kind].1.iter().enumerate() {
        let clear: &[&[Rect]] = match item.is_low {
            true => &[&taken],
            false => &[&taken, &windows],
        };
        // Wide things come in a narrower size, too.
        let narrower = if item.width > 1.0 { 0.65 } else { 1.0 };
        let place = [item.width, narrower * item.width]
            .into_iter()
            .find_map(|width| {
                let at = |side: &Side| {
                    let at = free_place(side, [width, item.depth], clear)?;
                    Some((*side, at, width))
                };
                sides.iter().find_map(at)
            });
        let Some((side, at, width)) = place else {
            continue;
        };
        b.node(item.name.to_owned(), Some(parent));
        b.stand = Stand {
            origin: side.point(at, 0.0, 0.0),
            front: side.normal(),
        };
        (item.build)(b, width, seed.wrapping_add(i as u32));
        let half = 0.5 * width + 0.04;
        taken.push(footprint(&side, at - half, at + half, item.depth + 0.02));
        // The next wall next.
        sides.rotate_left(1);
    }
    // 5. Pictures where walls are free.
    for k in 0..2 {
        let [w, h] = [0, 1].map(|i| 0.5 + 0.4 * unit(seed, k, i, 70));
        let place = sides.iter().find_map(|side| {
            let at = free_place(side, [w + 0.2, 0.1], &[&taken, &windows])?;
            Some((*side, at))
        });
        if let Some((side, at)) = place {
            b.node("painting".to_owned(), Some(parent));
            b.stand = Stand {
                origin: side.point(at, 0.0, 0.0),
                front: side.normal(),
            };
            let picture = Picture::Painting(hash(seed, k, 71, 0) % 6);
            furniture::painting(b, [w, h], picture, false);
            taken.push(footprint(&side, at - 0.5 * w, at + 0.5 * w, 0.1));
        }
    }
    // 6. The lamp.
    b.node("ceiling lamp".to_owned(), Some(parent));
    b.stand = stand(middle, front);
    let top = DVec3::Y * HEIGHT;
    b.lathe(
        top - DVec3::Y * 0.2,
        &[(0.012, 0.0), (0.012, 0.2)],
        plain(0x3a3632),
    );
    let shining = Look {
        shines: true,
        ..plain(0xfff4dc)
    };
    b.cushion(
        top - DVec3::Y * 0.28,
        DVec3::new(0.2, 0.1, 0.2),
        1.0,
        shining,
    );
}
