//! Rooms and doorways found in a surface.
//!
//! The surface and what cameras saw past it become columns over a floor grid (`columns`, in the
//! frame that `level` estimates). Walls are columns that are taken at eye height or below the
//! ceiling; rooms are the basins of the distance to them (`regions`), so doorways are its
//! bottlenecks, as robots' maps are segmented (Bormann et al. 2016, "Room segmentation: survey,
//! implementation, and analysis", the distance-transform and Voronoi methods). A lintel is a
//! wall, too, so that wide doorways part rooms; a beam parts nothing, for below it everything is
//! open (`openings`). Rooms reach to the middle of their walls, and every hole there is a portal.

mod columns;
mod complete;
mod corridors;
mod distance;
mod grid;
mod holes;
mod level;
mod merge;
mod openings;
mod outline;
mod picture;
mod regions;
mod sights;
mod storeys;
mod stubs;
mod thick;
mod upside;

pub use level::{Level, up_of_cameras};
pub use sights::sights;

use super::check::away;
use super::{
    Cell, CellId, Content, Extra, Interior, InteriorError, InteriorWarning, Polygon, Portal,
    RoomBox, triangle_touches_box,
};
use crate::mesh::Mesh;
use columns::Columns;
use glam::{DVec2, DVec3};
use openings::Opening;
use rayon::prelude::*;

/// How rooms are looked for. Lengths are in metres; [`Self::meter`] says what that is.
#[derive(Clone, Debug, PartialEq)]
pub struct FindOptions {
    /// Which way is up in the world, where it is known.
    pub up: Option<DVec3>,
    /// A metre in world units.
    pub meter: f64,
    /// Side of the floor grid's squares, in metres; coarser, and told, where what stands at eye
    /// height spreads over hectares.
    pub cell_size: f64,
    /// A passage parts two rooms if it is narrower than this share of the narrower one.
    pub bottleneck: f64,
    /// What passages may measure across at most, in metres, where no lintel marks them.
    pub max_passage: f64,
    /// Smaller ones are no rooms; square metres.
    pub min_area: f64,
}

impl Default for FindOptions {
    fn default() -> Self {
        Self {
            up: None,
            meter: 1.0,
            cell_size: 0.05,
            bottleneck: 0.7,
            max_passage: 2.2,
            min_area: 1.5,
        }
    }
}

/// What is known of a place.
#[derive(Clone, Copy, Debug)]
pub struct Evidence<'a> {
    /// Its surface, in the world.
    pub mesh: &'a Mesh,
    /// Where cameras stood, and which way was up for them; none of a model.
    pub cameras: &'a [(DVec3, DVec3)],
    /// From a camera to where it met a surface: what is between is free. Where there are any,
    /// only what they pass counts as free.
    pub sights: &'a [[DVec3; 2]],
}

/// What a square of a floor plan is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Nothing is known of it.
    Unknown,
    /// Wall, at eye height.
    Wall,
    /// Open at eye height, wall above.
    Lintel,
    /// Free, and part of no room.
    Free,
    /// Part of a room.
    Room(CellId),
}

/// The floor grid, to draw.
#[derive(Clone, Debug, PartialEq)]
pub struct FloorPlan {
    /// Its frame.
    pub level: Level,
    /// Squares along its first axis, and along its second.
    pub size: [usize; 2],
    /// Where the first square's first corner is, in the frame of [`Self::level`].
    pub origin: DVec2,
    /// The squares' side, in world units.
    pub cell_size: f64,
    /// Row by row, the first axis fastest.
    pub places: Vec<Place>,
}

/// Rooms and doorways, and how they were found.
#[derive(Clone, Debug, PartialEq)]
pub struct FoundInterior {
    /// Cells with boxes, and their floors at the height where one stands: boxes begin below.
    pub interior: Interior,
    /// What is odd about it.
    pub warnings: Vec<InteriorWarning>,
    /// To check it by.
    pub plan: FloorPlan,
    /// Height of the ceiling over the floor, in world units, where one was found.
    pub ceiling: Option<f64>,
}

/// Why there are no rooms.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FindError {
    /// There is nothing.
    #[error("the surface has no triangles of any size; rooms are found in a mesh or depth maps")]
    NoSurface,
    /// No floor, where a metre is so many world units.
    #[error(
        "no floor: nothing level lies below; is the scale right (--meter says how many world units a metre is; now \
         {0}), and which way is up (--up)? Else give the rooms by hand (--rooms)"
    )]
    NoFloor(f64),
    /// A floor, but nobody could stand there, or there is no surface around most places where one could: the least
    /// area of a room in square metres, and a metre in world units.
    #[error(
        "no rooms: over the floor nothing of {0} m² or more is free at eye height and enclosed; \
         is the scale right (--meter says how many world units a metre is; now {1}), and which way is up (--up)?"
    )]
    NoRooms(f64, f64),
    /// An option is out of range.
    #[error("{0} is {1}; expected a positive number")]
    Option(&'static str, f64),
    /// What was found contradicts itself.
    #[error(transparent)]
    Interior(#[from] InteriorError),
}

/// Finds the rooms of one storey and the openings between them. `model` is the file of the
/// surface, beside the `interior.json` to be.
///
/// The same for any number of threads; moving and turning the world moves the result with it,
/// but for the rounding of the floor grid.
///
/// # Errors
/// A surface without floor or rooms; options out of range.
pub fn find_interior(
    evidence: &Evidence,
    model: &str,
    options: &FindOptions,
) -> Result<FoundInterior, FindError> {
    let lengths = [
        ("the metre", options.meter),
        ("the cells' size", options.cell_size),
        ("the bottleneck's share", options.bottleneck),
        ("the widest passage", options.max_passage),
        ("the least area", options.min_area),
    ];
    if let Some((name, value)) = lengths.iter().find(|(_, v)| !(*v > 0.0 && v.is_finite())) {
        return Err(FindError::Option(name, *value));
    }
    // 1. Where the floor is.
    let level::Estimate { level, better } = level::estimate(evidence, options)?;
    // 2. What is free over it.
    let columns = Columns::new(evidence, &level, options)?;
    // 3. Rooms, and the holes between them.
    let (grown, openings) = merge::rooms(&columns, regions::regions(&columns, options), options);
    if grown.count == 0 {
        return Err(FindError::NoRooms(options.min_area, options.meter));
    }
    // 4. Cells and portals.
    let (interior, ids) = interior(evidence, &columns, &grown, openings, model, options)?;
    let mut warnings = interior.check()?;
    // The plan says which room is before a portal, whatever boxes and outlines on a coarse one let guess.
    warnings.retain(|warning| !matches!(warning, InteriorWarning::Turned(_)));
    if columns.step_m > options.cell_size * (1.0 + 1e-9) {
        warnings.push(InteriorWarning::Coarse {
            found: columns.step_m,
            asked: options.cell_size,
        });
    }
    // Rooms have most of a house that stands upright.
    let count = evidence.mesh.triangles.len();
    let has_little = || 2 * in_rooms(evidence, &interior, options.meter) < count;
    if let Some(better) = better.filter(|better| better.is_likely || has_little()) {
        // Either way round; no zeros below 0.
        let direction = better.direction;
        let direction = direction.dot(DVec3::ONE).signum() * direction + DVec3::ZERO;
        warnings.push(InteriorWarning::OnItsSide(direction));
    }
    // Of a model only its things tell which way up it is.
    let is_guessed = options.up.is_none() && evidence.cameras.is_empty();
    let is_down = |height: f64| {
        let ceiling = height * options.meter;
        upside::is_upside_down(evidence.mesh, &level, ceiling, options.meter)
    };
    if is_guessed && columns.ceiling.is_some_and(is_down) {
        // No zeros below 0.
        warnings.push(InteriorWarning::UpsideDown(-level.up() + DVec3::ZERO));
    }
    let is_beyond = |height: &f64| *height >= columns::REACH[1] - columns::BIN;
    if let Some(height) = columns.ceiling.filter(is_beyond) {
        warnings.push(InteriorWarning::TallWalls(height.round()));
    }
    if columns.seen.is_none()
        && let Some(height) = storeys::floor_above(&columns)
    {
        warnings.push(InteriorWarning::Storey(height));
    }
    let place = |i: usize| match grown.labels[i] {
        _ if columns.is_wall(i) => Place::Wall,
        _ if columns.is_lintel(i) => Place::Lintel,
        0 if columns.is_free(i) => Place::Free,
        0 => Place::Unknown,
        label => match ids[label as usize - 1] {
            Some(id) => Place::Room(id),
            None if columns.is_free(i) => Place::Free,
            None => Place::Unknown,
        },
    };
    let plan = FloorPlan {
        level,
        size: columns.size,
        origin: columns.origin,
        cell_size: columns.step,
        places: (0..columns.count()).map(place).collect(),
    };
    Ok(FoundInterior {
        interior,
        warnings,
        plan,
        ceiling: columns.ceiling.map(|height| height * options.meter),
    })
}

/// How far from a room's box what is in its walls may lie, in metres.
const IN_WALL: f64 = 0.5;

/// How many triangles have their middle in a room, or in its walls.
fn in_rooms(evidence: &Evidence, interior: &Interior, meter: f64) -> usize {
    let rooms: Vec<_> = interior
        .cells
        .iter()
        .filter_map(|cell| cell.content.room())
        .collect();
    let is_in_one = |i: &usize| {
        let [a, b, c] = evidence.mesh.corners(*i);
        let middle = (a + b + c) / 3.0;
        rooms
            .iter()
            .any(|room| room.distance(middle) <= IN_WALL * meter)
    };
    (0..evidence.mesh.triangles.len()).filter(is_in_one).count()
}

/// Eyes are this high where no camera says otherwise, in metres.
const EYE_HEIGHT: f64 = 1.6;
/// Boxes begin below the floor and end above the ceiling by this, in metres: surfaces are rough.
const HEADROOM: f64 = 0.1;

/// Cells and portals; and by label, less one, the room's cell. What no triangle is in, or is as flat as a line on
/// the plan, is no room, and has none.
///
/// # Errors
/// Most of what was found is no room.
fn interior(
    evidence: &Evidence,
    columns: &Columns,
    grown: &regions::Grown,
    mut openings: Vec<Opening>,
    model: &str,
    options: &FindOptions,
) -> Result<(Interior, Vec<Option<CellId>>), FindError> {
    let level = columns.level;
    let bounds = outline::bounds(columns.size[0], &grown.labels, grown.count);
    let mut outlines: Vec<Vec<DVec2>> = (1..)
        .zip(&bounds)
        .map(|(label, bounds)| outline::outline(columns, &grown.labels, label, bounds))
        .collect();
    outline::snap(&mut outlines, &mut openings, 2.5 * columns.step);
    let mut cells = Vec::new();
    let mut ids = Vec::new();
    for (i, outline) in outlines.iter().enumerate() {
        let label = i as u32 + 1;
        let top = columns.top_of(&grown.labels, label, &bounds[i]) * options.meter;
        let heights = [-HEADROOM * options.meter, top + HEADROOM * options.meter];
        let corners = outline
            .iter()
            .flat_map(|p| heights.map(|h| level.to_world(*p, h)));
        let (min, max) = corners.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| {
            (l.min(p), h.max(p))
        });
        let room = RoomBox { min, max };
        if !min.cmplt(max).all() || !is_any_in(evidence.mesh, &room) {
            ids.push(None);
            continue;
        }
        ids.push(Some(CellId(cells.len() as u32)));
        cells.push(Cell {
            name: format!("room {}", cells.len() + 1),
            content: Content::Box(room),
            floor: floor(&level, outline),
            other: Extra::new(),
        });
    }
    if 2 * cells.len() < outlines.len() {
        return Err(FindError::NoRooms(options.min_area, options.meter));
    }
    let mut portals = Vec::new();
    for opening in &openings {
        let rooms = opening.rooms.map(|label| ids[label as usize - 1]);
        if rooms.contains(&None) {
            continue;
        }
        let [from, to] = opening.ends();
        let corners = vec![
            level.to_world(from, opening.sill),
            level.to_world(to, opening.sill),
            level.to_world(to, opening.head),
            level.to_world(from, opening.head),
        ];
        if opening.is_deep {
            for id in rooms.into_iter().flatten() {
                reach(&mut cells[id.0 as usize], &corners);
            }
        }
        let kind = match opening.sill > 0.0 {
            true => "window",
            false => "doorway",
        };
        // The outline's front is the side that the plan's axes say, not where boxes are.
        let polygon = Polygon::new(corners);
        let Ok(mut polygon) = polygon else { continue };
        let inwards = level.direction(opening.normal());
        if polygon.normal().dot(inwards) < 0.0 {
            polygon = polygon.reversed();
        }
        // On a coarse plan outlines are brought into line by more than a portal measures.
        for id in rooms.into_iter().flatten() {
            let cell = &mut cells[id.0 as usize];
            if cell
                .content
                .room()
                .is_some_and(|room| away(&polygon, &room).is_some())
            {
                reach(cell, polygon.corners());
            }
        }
        portals.push(Portal {
            name: format!("{kind} {}", portals.len() + 1),
            polygon,
            cells: rooms,
            radius: None,
            other: Extra::new(),
        });
    }
    let heights = evidence.cameras.iter().map(|(c, _)| level.height(*c));
    let mut heights: Vec<f64> = heights.filter(|h| *h > 0.0).collect();
    heights.sort_by(f64::total_cmp);
    let usual = EYE_HEIGHT * options.meter;
    let eye_height = heights.get(heights.len() / 2).copied().unwrap_or(usual);
    let interior = Interior {
        model: Some(model.to_owned()),
        up: level.up(),
        eye_height,
        cells,
        portals,
        held_out: Vec::new(),
        other: Extra::new(),
    };
    Ok((interior, ids))
}

/// Lets a cell's box reach as far as some points.
fn reach(cell: &mut Cell, points: &[DVec3]) {
    if let Content::Box(room) = &mut cell.content {
        for point in points {
            room.min = room.min.min(*point);
            room.max = room.max.max(*point);
        }
    }
}

/// Whether any of a mesh's triangles is in a box.
fn is_any_in(mesh: &Mesh, room: &RoomBox) -> bool {
    let all = (0..mesh.triangles.len()).into_par_iter();
    all.any(|i| triangle_touches_box(mesh.corners(i), room))
}

/// The floor of a room with an outline on the plan; where that is no polygon, the rectangle around it.
fn floor(level: &Level, outline: &[DVec2]) -> Option<Polygon> {
    let polygon = |corners: &[DVec2]| {
        let corners = corners.iter().map(|p| level.to_world(*p, 0.0));
        Polygon::new(corners.collect()).ok()
    };
    let corners = outline.iter();
    let (low, high) = corners.fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(l, h), p| {
        (l.min(*p), h.max(*p))
    });
    let around = [
        low,
        DVec2::new(high.x, low.y),
        high,
        DVec2::new(low.x, high.y),
    ];
    polygon(outline).or_else(|| polygon(&around))
}
