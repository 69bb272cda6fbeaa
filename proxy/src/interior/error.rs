use super::PolygonError;
use glam::DVec3;
use std::path::PathBuf;

/// What makes an interior contradict itself.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum InteriorError {
    /// A portal's outline.
    #[error("portal `{0}`: {1}")]
    Portal(String, PolygonError),
    /// A floor's outline.
    #[error("the floor of cell `{0}`: {1}")]
    Floor(String, PolygonError),
    /// A portal leads to a cell that is not there.
    #[error("portal `{portal}` leads to the cell `{cell}`; there are: {known}")]
    UnknownCell {
        /// The portal.
        portal: String,
        /// What it calls the cell.
        cell: String,
        /// The cells' names.
        known: String,
    },
    /// Both sides of a portal are the same.
    #[error("portal `{0}` leads from {1} to {1}; a portal joins two cells, or one and null")]
    SameCell(String, String),
    /// Two of a kind share a name.
    #[error("two {0} are called `{1}`; give each its own name")]
    DuplicateName(&'static str, String),
    /// A name is empty.
    #[error("a {0} has no name; give it one")]
    NoName(&'static str),
    /// A box encloses nothing.
    #[error(
        "the box of cell `{0}` is empty or not finite: min must be less than max on every axis"
    )]
    Box(String),
    /// A cell says nothing, or too much, about what is in it.
    #[error(
        "cell `{0}` must have one of `box`, `nodes` and `scene`, or `scene` and `box`, and has {1}"
    )]
    Content(String, usize),
    /// A length that is none.
    #[error("{0} is {1}; expected a positive number")]
    Length(String, f64),
    /// A number of which nothing can be computed.
    #[error(
        "{0}: {1:e} is too large; expected no more than 1e12 world units: correct it, or scale the model"
    )]
    Huge(String, f64),
    /// No direction.
    #[error("`up` is {0:?}; expected a direction such as [0, 1, 0]")]
    Up([f64; 3]),
    /// Nowhere to be.
    #[error("there are no cells; give at least one")]
    NoCells,
    /// The cells' content is in a model, but none is named.
    #[error("cell `{0}` shows a part of a model, but no `model` is named")]
    NoModel(String),
    /// A node that is not in the model.
    #[error(
        "cell `{cell}` shows the node `{node}`, which the model does not have; correct its `nodes`; there are: {known}"
    )]
    UnknownNode {
        /// The cell.
        cell: String,
        /// The node's name.
        node: String,
        /// The names of nodes that it may be.
        known: String,
    },
    /// Nothing in a model says where its cells are.
    #[error(
        "no node is called `cell:NAME`; name the rooms' nodes so, and those of openings \
         `portal:A|B`, or give the rooms with --rooms"
    )]
    NoCellNodes,
    /// A node's name would be a cell's or a portal's without capitals.
    #[error(
        "node `{0}`: names of rooms begin with `cell:`, and of openings with `portal:`, in small letters; rename it, \
         or let rooms be found with --find"
    )]
    MisspeltNode(String),
    /// A node that stands for a portal does not say of what, or has no outline.
    #[error("node `{0}`: {1}")]
    PortalNode(String, String),
}

/// What is wrong with an interior's file.
#[derive(Debug, thiserror::Error)]
pub enum InteriorFileError {
    /// It cannot be read.
    #[error("{path}: {error}", path = .0.display(), error = .1)]
    Io(PathBuf, std::io::Error),
    /// It cannot be written.
    #[error("{path}: cannot write: {error}", path = .0.display(), error = .1)]
    Write(PathBuf, std::io::Error),
    /// It is not the JSON that was expected.
    #[error("{path}: not {what}: {error}", path = .0.display(), what = .1, error = .2)]
    Json(PathBuf, &'static str, serde_json::Error),
    /// It is from a later version.
    #[error("{path}: version {found}; this program reads version 1", path = .0.display(), found = .1)]
    Version(PathBuf, u64),
    /// It contradicts itself.
    #[error("{path}: {error}", path = .0.display(), error = .1)]
    Interior(PathBuf, InteriorError),
}

/// What is odd about an interior, and can be worked with.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum InteriorWarning {
    /// Two boxes share space.
    #[error("the boxes of cells `{0}` and `{1}` overlap: what is in both is drawn for either")]
    Overlap(String, String),
    /// Eyes are over all ceilings, or as good as on the floor.
    #[error(
        "`eye_height` is {eye_height}, and the cells are {least} to {most} high: eyes see nothing of them, or little; \
         it is in world units as boxes are: correct it"
    )]
    EyeHeight {
        /// In world units.
        eye_height: f64,
        /// How high the lowest cell is, likewise.
        least: f64,
        /// How high the highest is.
        most: f64,
    },
    /// A cell that nobody sees from elsewhere.
    #[error("cell `{0}` has no portal: it cannot be seen from elsewhere")]
    NoPortal(String),
    /// A portal is not at its cell's box.
    #[error("portal `{portal}` is {distance} away from the box of its cell `{cell}`")]
    Away {
        /// The portal.
        portal: String,
        /// The cell.
        cell: String,
        /// In world units, from the portal's centre.
        distance: f64,
    },
    /// A floor is not in its cell's box.
    #[error(
        "the floor of cell `{cell}` is outside the cell's box, {}: eyes are placed over it, on tours and \
         before portals; correct its `floor`, or its `box`",
        how_far(.distance)
    )]
    FloorAway {
        /// The cell.
        cell: String,
        /// In world units; zero where they touch.
        distance: f64,
    },
    /// A floor that nobody stands on.
    #[error(
        "the floor of cell `{0}` is as steep as a wall: eyes are placed over it, on tours and before portals; give \
         the outline of what one stands on, as seen from above"
    )]
    FloorSteep(String),
    /// A portal's outline goes the other way round.
    #[error(
        "portal `{0}` seems to be turned round: its corners are to be counter-clockwise as seen \
         from the first of its cells"
    )]
    Turned(String),
    /// A cell without a triangle.
    #[error("nothing of the model is in cell `{0}`")]
    Empty(String),
    /// Rooms were looked for on a coarser floor grid than was asked for.
    #[error(
        "the floor plan's squares are {found:.2} m wide, not {asked:.2}, as what stands at eye height \
         reaches far: narrow openings may be missed; leave out what is far away, or give the rooms by hand"
    )]
    Coarse {
        /// The squares' side, in metres.
        found: f64,
        /// What it was to be.
        asked: f64,
    },
    /// Up may be another direction.
    #[error(
        "up is taken to be y, as glTF has it, though more floor or wall lies across {0:.2}: if the house lies on its \
         side, say --up with that, or with its opposite"
    )]
    OnItsSide(DVec3),
    /// There is no ceiling as far up as is looked, and walls go on: units may be no metres.
    #[error(
        "walls are {0} m high or more, and no ceiling is lower: is the scale right? --meter says how many world units \
         a metre is"
    )]
    TallWalls(f64),
    /// Rooms were looked for on one storey, and there is another.
    #[error(
        "another storey's floor is {0:.1} m over that of the rooms that were found: it has no rooms; give them by \
         hand, or name the rooms' nodes, if one is to walk there"
    )]
    Storey(f64),
    /// Portals hide what is seen.
    #[error(
        "{hidden} of {tried} lines of sight meet what portals hide, such as the one from {eye} in cell `{cell}` to \
         {seen}: frames may lack it there; let the portal that it passes, or the cell's box, reach farther, or add \
         the opening that it passes"
    )]
    Hidden {
        /// Lines of sight.
        hidden: usize,
        /// All that were tried.
        tried: usize,
        /// Where the first begins.
        cell: String,
        /// Its eye, in the world.
        eye: DVec3,
        /// What it sees.
        seen: DVec3,
    },
    /// Triangles that no cell has.
    #[error("{0} triangles are in no cell; they are drawn whatever is visible")]
    Elsewhere(usize),
}

/// For messages: how far away something is, in world units.
fn how_far(distance: &f64) -> String {
    match *distance > 0.0 {
        true => format!("{distance} away"),
        false => "which it only touches".to_owned(),
    }
}
