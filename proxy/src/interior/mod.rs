//! Interiors: cells joined by portals.
//!
//! One sees into another cell only through a portal, so what a view needs to draw follows from
//! portals alone (Airey 1990, Teller and Séquin 1991; as Rafferty et al. 1998 use them). A
//! portal stands wherever a line of sight may leave its cell: where it does not, something of
//! the cell's content ends it.

mod arrays;
mod by_cell;
mod check;
mod compare;
mod contents;
mod error;
mod file;
pub mod find;
mod floors;
mod locate;
mod overlap;
mod polygon;
mod rooms;
mod seen;
mod semicircle;
mod strays;
mod turned;
mod visibility;

pub use compare::{ComparedCell, ComparedPortal, Comparison, compare};
pub use contents::{Contents, surface_of};
pub use error::{InteriorError, InteriorFileError, InteriorWarning};
pub use file::{parse_interior, read_interior, write_interior};
pub use overlap::triangle_touches_box;
pub use polygon::{Polygon, PolygonError};
pub use rooms::{
    EYE_HEIGHT, GivenRooms, interior_from_nodes, interior_from_rooms, parse_rooms, read_rooms,
};
pub use semicircle::{SemicircleOptions, SemicircleView, angle_before, semicircles};
pub use strays::{Stray, Strays, fit_to_sight, strays};
pub use visibility::{Pass, Region, Visibility, VisibleCell, clip, visible, visible_through};

use glam::{BVec3, DVec3};

/// Keys that this version does not know, with their values.
pub type Extra = serde_json::Map<String, serde_json::Value>;

/// Which cell of an interior: an index into [`Interior::cells`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct CellId(pub u32);

/// Which portal of an interior: an index into [`Interior::portals`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PortalId(pub u32);

/// Cells joined by portals.
#[derive(Clone, Debug, PartialEq)]
pub struct Interior {
    /// The model's file, beside `interior.json`; none where all cells are scenes.
    pub model: Option<String>,
    /// Which way is up, in the world; unit length.
    pub up: DVec3,
    /// How high the eyes are over the floor, in world units.
    pub eye_height: f64,
    /// By [`CellId`]. No two share a name.
    pub cells: Vec<Cell>,
    /// By [`PortalId`]. No two share a name.
    pub portals: Vec<Portal>,
    /// Photos of the cells' scenes, by name, that took no part in making this, and are not drawn
    /// from: pictures can be compared with them.
    pub held_out: Vec<String>,
    /// What the file says beyond this version's keys.
    pub other: Extra,
}

/// A region of space whose inside one sees as a whole.
#[derive(Clone, Debug, PartialEq)]
pub struct Cell {
    /// Not empty.
    pub name: String,
    /// What is in it.
    pub content: Content,
    /// The outline of its floor in the world, where it is known. Then only points over it are in
    /// the cell.
    pub floor: Option<Polygon>,
    /// What the file says beyond this version's keys.
    pub other: Extra,
}

/// What a cell shows.
#[derive(Clone, Debug, PartialEq)]
pub enum Content {
    /// A scene's or capture's photos: they colour the model's triangles that touch the box.
    Scene {
        /// The scene's folder, relative to the interior's.
        folder: String,
        /// Without one the cell has no surface, and nothing of it is drawn.
        room: Option<RoomBox>,
    },
    /// The model's nodes of these names, and all below them.
    Nodes(Vec<String>),
    /// All triangles of the model that touch a box; a triangle may be part of several cells.
    Box(RoomBox),
}

impl Content {
    /// The box that bounds it, if one does.
    pub fn room(&self) -> Option<RoomBox> {
        match self {
            Self::Scene { room, .. } => *room,
            Self::Box(room) => Some(*room),
            Self::Nodes(_) => None,
        }
    }

    /// The folder of the scene whose photos show it, relative to the interior's.
    pub fn scene(&self) -> Option<&str> {
        match self {
            Self::Scene { folder, .. } => Some(folder),
            Self::Box(_) | Self::Nodes(_) => None,
        }
    }
}

/// A box along the world's axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RoomBox {
    /// Its least coordinates.
    pub min: DVec3,
    /// Its greatest.
    pub max: DVec3,
}

impl RoomBox {
    /// Whether a point is inside or on its border.
    pub fn contains(&self, point: DVec3) -> bool {
        point.cmpge(self.min).all() && point.cmple(self.max).all()
    }

    /// How far a point is outside; zero inside.
    pub fn distance(&self, point: DVec3) -> f64 {
        point.distance(point.clamp(self.min, self.max))
    }

    /// Its corners; corner i has x, y and z of `max` where bits 0, 1 and 2 of i are set.
    pub fn corners(&self) -> [DVec3; 8] {
        std::array::from_fn(|i| {
            DVec3::select(
                BVec3::new(i & 1 > 0, i & 2 > 0, i & 4 > 0),
                self.max,
                self.min,
            )
        })
    }

    /// Its volume.
    pub fn volume(&self) -> f64 {
        let size = self.max - self.min;
        size.x * size.y * size.z
    }
}

/// An opening between two cells, or between a cell and nothing.
#[derive(Clone, Debug, PartialEq)]
pub struct Portal {
    /// Not empty.
    pub name: String,
    /// Its outline in the world, counter-clockwise as the first cell sees it: its normal
    /// points into that cell.
    pub polygon: Polygon,
    /// The cells in front of it and behind it; none is the outside. Not both are none.
    pub cells: [Option<CellId>; 2],
    /// Of the semicircles before it, in world units, where 1.5 times its width won't do.
    pub radius: Option<f64>,
    /// What the file says beyond this version's keys.
    pub other: Extra,
}

/// A semicircle's radius by default, in widths of its portal.
pub const RADIUS_IN_WIDTHS: f64 = 1.5;

/// An opening lies flat from this cosine of the angle between its normal and up on: 45°.
const FLAT: f64 = std::f64::consts::FRAC_1_SQRT_2;

impl Portal {
    /// Whether it lies rather than stands, as a hatch does and a window in a low roof: within 45° of level.
    pub fn lies_flat(&self, up: DVec3) -> bool {
        self.polygon.normal().dot(up).abs() > FLAT
    }

    /// How wide it is, across `up`; where it lies flat, the longer side of what it spans.
    pub fn width(&self, up: DVec3) -> f64 {
        let normal = self.polygon.normal();
        let upright = (!self.lies_flat(up)).then(|| up.cross(normal).normalize());
        let (across, along) = match upright {
            Some(across) => (across, None),
            None => {
                let along = normal.cross(up.any_orthonormal_vector()).normalize();
                (along.cross(normal), Some(along))
            }
        };
        let extent = |axis: DVec3| {
            let places = self.polygon.corners().iter().map(|p| p.dot(axis));
            let (low, high) = places.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| {
                (l.min(x), h.max(x))
            });
            high - low
        };
        along.map_or(extent(across), |along| extent(across).max(extent(along)))
    }

    /// The radius of the semicircles before it, in world units.
    pub fn semicircle_radius(&self, up: DVec3) -> f64 {
        self.radius
            .unwrap_or_else(|| RADIUS_IN_WIDTHS * self.width(up))
    }

    /// The cell beyond, where `from` is one of its two sides: `Some(None)` is the outside.
    pub fn beyond(&self, from: Option<CellId>) -> Option<Option<CellId>> {
        match self.cells {
            [front, back] if front == from => Some(back),
            [front, back] if back == from => Some(front),
            _ => None,
        }
    }

    /// Whether an eye is in it: inside its outline, and on its plane but for rounding. What it sees may be on either
    /// side.
    pub fn is_around(&self, eye: DVec3) -> bool {
        let margin = locate::tolerance(self);
        self.polygon.height(eye).abs() <= margin && self.polygon.covers(eye, margin)
    }

    /// The normal on the side of `cell`, into it.
    pub fn normal_into(&self, cell: Option<CellId>) -> DVec3 {
        match self.cells[0] == cell {
            true => self.polygon.normal(),
            false => -self.polygon.normal(),
        }
    }
}

impl Interior {
    /// Lets the photos of a scene, by its folder relative to the interior's, show all cells that
    /// are boxes.
    pub fn show_photos(&mut self, folder: &str) {
        for cell in &mut self.cells {
            if let Content::Box(room) = cell.content {
                cell.content = Content::Scene {
                    folder: folder.to_owned(),
                    room: Some(room),
                };
            }
        }
    }

    /// A cell.
    pub fn cell(&self, id: CellId) -> &Cell {
        &self.cells[id.0 as usize]
    }

    /// A portal.
    pub fn portal(&self, id: PortalId) -> &Portal {
        &self.portals[id.0 as usize]
    }

    /// The portals of a cell (none: of the outside), in order.
    pub fn portals_of(
        &self,
        cell: Option<CellId>,
    ) -> impl Iterator<Item = (PortalId, &Portal)> + '_ {
        let ids = (0..self.portals.len() as u32).map(PortalId);
        let all = ids.zip(&self.portals);
        all.filter(move |(_, portal)| portal.cells.contains(&cell))
    }
}
