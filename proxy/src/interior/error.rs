use super::PolygonError;
use crate::{shown_name, shown_number};
use glam::DVec3;
use std::path::PathBuf;

/// What makes an interior contradict itself.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum InteriorError {
    /// A portal's outline.
    #[error("portal `{}`: {}", shown_name(.0), .1)]
    Portal(String, PolygonError),
    /// A floor's outline.
    #[error("the floor of cell `{}`: {}", shown_name(.0), .1)]
    Floor(String, PolygonError),
    /// A portal leads to a cell that is not there.
    #[error(
        "portal `{}` leads to the cell `{}`; there are: {}",
        shown_name(.portal),
        shown_name(.cell),
        shown_name(.known)
    )]
    UnknownCell {
        /// The portal.
        portal: String,
        /// What it calls the cell.
        cell: String,
        /// The cells' names.
        known: String,
    },
    /// Both sides of a portal are the same.
    #[error(
        "portal `{portal}` leads from {side} to {side}; a portal joins two cells, or one and null",
        portal = shown_name(.0),
        side = shown_name(.1)
    )]
    SameCell(String, String),
    /// Two of a kind share a name.
    #[error("two {} are called `{}`; give each its own name", .0, shown_name(.1))]
    DuplicateName(&'static str, String),
    /// A name is empty.
    #[error("a {0} has no name; give it one")]
    NoName(&'static str),
    /// A box encloses nothing.
    #[error(
        "the box of cell `{}` is empty or not finite: min must be less than max on every axis",
        shown_name(.0)
    )]
    Box(String),
    /// A cell says nothing, or too much, about what is in it.
    #[error(
        "cell `{}` must have one of `box`, `nodes` and `scene`, or `scene` and `box`, and has {}",
        shown_name(.0),
        .1
    )]
    Content(String, usize),
    /// A length that is none.
    #[error("{} is {}; expected a positive number", shown_name(.0), .1)]
    Length(String, f64),
    /// A number of which nothing can be computed.
    #[error(
        "{}: {:e} is too large; expected no more than 1e12 world units: correct it, or scale the model",
        shown_name(.0),
        .1
    )]
    Huge(String, f64),
    /// No direction.
    #[error("`up` is {0:?}; expected a direction such as [0, 1, 0]")]
    Up([f64; 3]),
    /// Nowhere to be.
    #[error("there are no cells; give at least one")]
    NoCells,
    /// The cells' content is in a model, but none is named.
    #[error("cell `{}` shows a part of a model, but no `model` is named", shown_name(.0))]
    NoModel(String),
    /// A node that is not in the model.
    #[error(
        "cell `{}` shows the node `{}`, which the model does not have; correct its `nodes`; there are: {}",
        shown_name(.cell),
        shown_name(.node),
        shown_name(.known)
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
        "node `{}`: names of rooms begin with `cell:`, and of openings with `portal:`, in small letters; rename it, \
         or let rooms be found with --find",
        shown_name(.0)
    )]
    MisspeltNode(String),
    /// A node that stands for a portal does not say of what, or has no outline.
    #[error("node `{}`: {}", shown_name(.0), .1)]
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
    #[error(
        "the boxes of cells `{}` and `{}` overlap: what is in both is drawn for either",
        shown_name(.0),
        shown_name(.1)
    )]
    Overlap(String, String),
    /// Eyes are over all ceilings, or as good as on the floor.
    #[error(
        "`eye_height` is {}, and the cells are {} to {} high: eyes see nothing of them, or little; \
         it is in world units as boxes are: correct it",
        shown(.eye_height),
        shown(.least),
        shown(.most)
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
    #[error("cell `{}` has no portal: it cannot be seen from elsewhere", shown_name(.0))]
    NoPortal(String),
    /// A portal is not at its cell's box.
    #[error(
        "portal `{}` is {} away from the box of its cell `{}`",
        shown_name(.portal),
        shown(.distance),
        shown_name(.cell)
    )]
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
        "the floor of cell `{}` is outside the cell's box, {}: eyes are placed over it, on tours and \
         before portals; correct its `floor`, or its `box`",
        shown_name(.cell),
        how_far(.distance)
    )]
    FloorAway {
        /// The cell.
        cell: String,
        /// In world units; zero where they touch.
        distance: f64,
    },
    /// A floor so high in its cell's box that eyes over it are above the box.
    #[error(
        "the floor of cell `{}` is so high that eyes over it, on tours and before portals, are above the cell's \
         box; correct its `floor`, or its `box`",
        shown_name(.0)
    )]
    FloorHigh(String),
    /// A floor that nobody stands on.
    #[error(
        "the floor of cell `{}` is as steep as a wall: eyes are placed over it, on tours and before portals; give \
         the outline of what one stands on, as seen from above",
        shown_name(.0)
    )]
    FloorSteep(String),
    /// A cell names photos that are to be held out, which only the whole file does.
    #[error(
        "cell `{}` has a `held_out`, which counts for the whole file alone: these photos are not held out; move it out \
         of the cell, beside `cells`",
        shown_name(.0)
    )]
    HeldOut(String),
    /// A portal's outline goes the other way round.
    #[error(
        "portal `{}` seems to be turned round: its corners are to be counter-clockwise as seen \
         from the first of its cells",
        shown_name(.0)
    )]
    Turned(String),
    /// A cell without a triangle.
    #[error("nothing of the model is in cell `{}`", shown_name(.0))]
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
    /// The house may be upside down; what is up then.
    #[error(
        "far more hangs below the ceiling than stands on the floor: if the house is upside down, say --up with {0:.2}"
    )]
    UpsideDown(DVec3),
    /// Another direction than what was up for the photos' cameras.
    #[error(
        "`up` is {given}, but the photos were held with about {next} up: what is drawn would lie on its side or upside \
         down; correct it"
    )]
    UpOfCameras {
        /// Unit length.
        given: DVec3,
        /// The axis of the world next to the cameras'.
        next: DVec3,
    },
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
        "{hidden} of {tried} lines of sight meet what portals hide, such as the one from {eye} in cell `{}` to \
         {seen}: frames may lack it there; let the portal that it passes, or the cell's box, reach farther, or add \
         the opening that it passes",
        shown_name(.cell)
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
    /// Not all was looked at to tell what portals hide: lines of sight that were tried.
    #[error(
        "the openings lead on in so many ways that what portals hide was looked for no further after {0} lines of \
         sight: they may hide more than is told"
    )]
    SightsCut(usize),
    /// Triangles that no cell has.
    #[error("{0} triangles are in no cell; they are drawn whatever is visible")]
    Elsewhere(usize),
}

/// For messages: how far away something is, in world units.
fn how_far(distance: &f64) -> String {
    match *distance > 0.0 {
        true => format!("{} away", shown(distance)),
        false => "which it only touches".to_owned(),
    }
}

/// For messages: a length, in world units.
fn shown(length: &f64) -> String {
    shown_number(*length)
}
