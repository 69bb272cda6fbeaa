//! Which cells a view sees, and where in its image.
//!
//! Rafferty et al. 1998, "Images for accelerating architectural walkthroughs", §2.1: from the
//! viewer's cell on, whatever cells are joined by a portal that is visible. They test portals'
//! bounds on the screen; here the part of a portal that is visible is the exact intersection of
//! cones with their apex at the eye, so that nothing depends on a near plane or on the image.

use super::by_cell::PortalsByCell;
use super::locate::tolerance;
use super::{CellId, Interior, Portal, PortalId};
use calibrate::{Pixel, View};
use glam::DVec3;

/// A convex cone of directions from the eye, or all of them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Region {
    corners: Vec<DVec3>,
    /// Unit normals of the sides, inwards.
    sides: Vec<DVec3>,
}

/// How far outside a cone directions still count as inside, in radians: rounding must not
/// hide what lies along an edge.
const MARGIN: f64 = 1e-9;
/// Corners nearer to one another than this, in radians, are one.
const SAME: f64 = 1e-10;
/// Cones of less than this, in radians across, are seen edge on but for rounding.
const FLAT: f64 = 1e-15;

impl Region {
    /// All directions.
    pub const ALL: Self = Self {
        corners: Vec::new(),
        sides: Vec::new(),
    };

    /// The directions that a view's image shows, in the world: a pinhole's exactly, of other
    /// lenses a pyramid around them. All where any reaches 87° from the axis, as a pyramid around such has hardly
    /// fewer in front, and none behind.
    pub fn of(view: &View) -> Self {
        /// Pixels of each side of the image that are asked about.
        const STEPS: u32 = 32;
        let (width, height) = (f64::from(view.width), f64::from(view.height));
        let shares = (0..STEPS).map(|i| f64::from(i) / f64::from(STEPS));
        let outline = shares.flat_map(|t| {
            [
                Pixel::new(t * width, 0.0),
                Pixel::new(width, t * height),
                Pixel::new((1.0 - t) * width, height),
                Pixel::new(0.0, (1.0 - t) * height),
            ]
        });
        let (mut low, mut high) = (glam::DVec2::INFINITY, glam::DVec2::NEG_INFINITY);
        for pixel in outline {
            let Some(ray) = view.lens.unproject(pixel).filter(|ray| ray.z > 0.05) else {
                return Self::ALL;
            };
            let at = ray.truncate() / ray.z;
            (low, high) = (low.min(at), high.max(at));
        }
        if view.lens.distortion() != calibrate::Distortion::None {
            // Between the pixels asked about.
            let room = 0.01 * (high - low);
            (low, high) = (low - room, high + room);
        }
        let world_from_camera = view.camera_from_world.rotation.conjugate();
        // Counter-clockwise for who looks along the axis, y down.
        let corners = [
            (low.x, low.y),
            (low.x, high.y),
            (high.x, high.y),
            (high.x, low.y),
        ];
        let corners = corners.map(|(x, y)| world_from_camera * DVec3::new(x, y, 1.0));
        Self::cone(&corners).unwrap_or(Self::ALL)
    }

    /// Whether it has all directions.
    pub fn is_all(&self) -> bool {
        self.sides.is_empty()
    }

    /// The directions of its edges, unit length in the world, counter-clockwise as the eye sees
    /// them; none where it has all directions.
    pub fn corners(&self) -> &[DVec3] {
        &self.corners
    }

    /// Unit normals of its sides, inwards; none of all directions.
    pub fn sides(&self) -> &[DVec3] {
        &self.sides
    }

    /// Whether it has a direction; any length will do.
    pub fn contains(&self, direction: DVec3) -> bool {
        let slack = -MARGIN * direction.length();
        self.sides.iter().all(|side| side.dot(direction) >= slack)
    }

    /// A cone of edges that are counter-clockwise as seen from its apex, the origin; none if
    /// it holds nothing.
    fn cone(edges: &[DVec3]) -> Option<Self> {
        let mut corners: Vec<DVec3> = Vec::with_capacity(edges.len());
        for edge in edges.iter().filter_map(|e| e.try_normalize()) {
            if corners.last().is_none_or(|last| last.distance(edge) > SAME) {
                corners.push(edge);
            }
        }
        while corners.len() > 1 && corners[0].distance(corners[corners.len() - 1]) <= SAME {
            corners.pop();
        }
        if corners.len() < 3 {
            return None;
        }
        let n = corners.len();
        let side = |i: usize| corners[(i + 1) % n].cross(corners[i]).try_normalize();
        let sides: Vec<DVec3> = (0..n).filter_map(side).collect();
        // Seen edge on it is flat, and its sides' planes are all the same.
        let middle: DVec3 = corners.iter().sum();
        let is_open = |side: &DVec3| side.dot(middle) > FLAT * middle.length();
        (sides.len() >= 3 && sides.iter().all(is_open)).then_some(Self { corners, sides })
    }

    /// The part of a convex polygon, relative to the eye, that lies within.
    fn clip(&self, polygon: &[DVec3]) -> Vec<DVec3> {
        let mut left = polygon.to_vec();
        for side in &self.sides {
            left = clip(&left, |p| side.dot(p) + MARGIN * p.length());
        }
        left
    }

    /// Whether it has all that another has.
    fn covers(&self, other: &Self) -> bool {
        let has_all = |corners: &[DVec3]| corners.iter().all(|c| self.contains(*c));
        self.is_all() || (!other.is_all() && has_all(&other.corners))
    }
}

/// The part of a convex polygon where a function that is about linear is not negative
/// (Sutherland and Hodgman 1974).
pub fn clip(polygon: &[DVec3], height: impl Fn(DVec3) -> f64) -> Vec<DVec3> {
    let mut left = Vec::with_capacity(polygon.len() + 1);
    for (i, &p) in polygon.iter().enumerate() {
        let q = polygon[(i + 1) % polygon.len()];
        let (at_p, at_q) = (height(p), height(q));
        if at_p >= 0.0 {
            left.push(p);
        }
        if (at_p >= 0.0) != (at_q >= 0.0) {
            left.push(p.lerp(q, at_p / (at_p - at_q)));
        }
    }
    left
}

/// A portal that one sees through.
#[derive(Clone, Debug, PartialEq)]
pub struct Pass {
    /// The portal.
    pub portal: PortalId,
    /// On the eye's side of it.
    pub from: CellId,
    /// Beyond; none is the outside.
    pub into: Option<CellId>,
    /// How many portals are between it and the eye.
    pub depth: u32,
    /// Where one sees through it and the portals before it.
    pub region: Region,
}

/// A cell, and where one sees it.
#[derive(Clone, Debug, PartialEq)]
pub struct VisibleCell {
    /// Which.
    pub cell: CellId,
    /// It is seen in all of these and nowhere else. They may overlap.
    pub regions: Vec<Region>,
}

/// What a view sees of an interior.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Visibility {
    /// Each cell once, the viewer's first, the others in the order they were reached in.
    pub cells: Vec<VisibleCell>,
    /// Portals that one sees through, those nearer to the eye before those behind them. A
    /// portal may be there more than once: on several ways, or in convex pieces.
    pub passes: Vec<Pass>,
}

impl Visibility {
    fn add(&mut self, cell: CellId, region: &Region) {
        let at = self.cells.iter().position(|c| c.cell == cell);
        let at = at.unwrap_or_else(|| {
            let regions = Vec::new();
            self.cells.push(VisibleCell { cell, regions });
            self.cells.len() - 1
        });
        let regions = &mut self.cells[at].regions;
        if !regions.iter().any(|known| known.covers(region)) {
            regions.push(region.clone());
        }
    }
}

/// Passes that are followed before all cells are called visible instead.
const MAX_PASSES: usize = 1 << 14;
/// Portals one behind the other, likewise.
const MAX_DEPTH: u32 = 256;

/// The cells that a viewer in `cell` sees, and where.
///
/// A line of sight passes each portal at most once, so ways that come back to a cell end. A
/// viewer on a portal's plane and inside its outline sees all that both sides show. A viewer in no
/// cell may see all of them, and so it is where portals are too many to follow. The cell must be
/// the one that the view's centre is in ([`Contents::locate`](super::Contents::locate)); through a
/// portal to the outside one sees nothing.
pub fn visible(interior: &Interior, cell: Option<CellId>, view: &View) -> Visibility {
    let region = Region::of(view);
    let eye = view.center();
    let Some(cell) = cell.filter(|id| eye.is_finite() && (id.0 as usize) < interior.cells.len())
    else {
        return everything(interior, cell, &region);
    };
    let portals = PortalsByCell::new(interior);
    let mut search = Search::new(interior, &portals, eye);
    match search.visit(cell, &region, None, 0) {
        Ok(()) => search.found,
        Err(TooMany) => everything(interior, Some(cell), &region),
    }
}

/// The cells that an eye in one sees all around, and how many portals were looked at to tell, each as often as it
/// was; `None` where it takes more than `most`.
pub(super) fn all_around(
    interior: &Interior,
    portals: &PortalsByCell,
    cell: CellId,
    eye: DVec3,
    most: usize,
) -> Option<(Visibility, usize)> {
    let mut search = Search::new(interior, portals, eye);
    search.most = most;
    let end = search.visit(cell, &Region::ALL, None, 0);
    let looked_at = search.looked_at;
    match end {
        _ if looked_at > most => None,
        Ok(()) => Some((search.found, looked_at)),
        Err(TooMany) => Some((everything(interior, Some(cell), &Region::ALL), looked_at)),
    }
}

/// What an eye sees through a portal: the cells beyond it, the nearest first, and where. `region` is
/// where it sees through it, as a [`Pass`] says; what the portal's outline leaves of it is up to
/// the caller. The eye is on the other side of the portal; where it is, and behind what, is no matter.
pub fn visible_through(
    interior: &Interior,
    portal: PortalId,
    into: CellId,
    eye: DVec3,
    region: &Region,
) -> Visibility {
    let is_known = (into.0 as usize) < interior.cells.len()
        && (portal.0 as usize) < interior.portals.len()
        && eye.is_finite();
    if !is_known {
        return everything(interior, None, region);
    }
    let portals = PortalsByCell::new(interior);
    let mut search = Search::new(interior, &portals, eye);
    search.is_passed[portal.0 as usize] = true;
    let entrance = interior.portal(portal);
    let inwards = entrance.normal_into(Some(into));
    match search.visit(into, region, Some((entrance, inwards)), 1) {
        Ok(()) => search.found,
        Err(TooMany) => everything(interior, Some(into), region),
    }
}

/// All cells, the viewer's first.
fn everything(interior: &Interior, own: Option<CellId>, region: &Region) -> Visibility {
    let mut found = Visibility::default();
    let all = (0..interior.cells.len() as u32).map(CellId);
    for cell in own.into_iter().chain(all) {
        if (cell.0 as usize) < interior.cells.len() {
            found.add(cell, region);
        }
    }
    found
}

struct TooMany;

struct Search<'a> {
    interior: &'a Interior,
    portals: &'a PortalsByCell,
    eye: DVec3,
    /// Whether a portal is part of the way that is being followed.
    is_passed: Vec<bool>,
    /// How many portals were looked at, each as often as it was; and how many may be.
    looked_at: usize,
    most: usize,
    found: Visibility,
}

impl<'a> Search<'a> {
    fn new(interior: &'a Interior, portals: &'a PortalsByCell, eye: DVec3) -> Self {
        Self {
            interior,
            portals,
            eye,
            is_passed: vec![false; interior.portals.len()],
            looked_at: 0,
            most: usize::MAX,
            found: Visibility::default(),
        }
    }

    /// Visibility(cell, frustum), and so on behind its portals. `entrance` is the portal that one
    /// looks through, with its normal into this cell.
    fn visit(
        &mut self,
        cell: CellId,
        region: &Region,
        entrance: Option<(&Portal, DVec3)>,
        depth: u32,
    ) -> Result<(), TooMany> {
        self.found.add(cell, region);
        let (interior, portals) = (self.interior, self.portals);
        for &id in portals.of(cell) {
            let portal = interior.portal(id);
            if self.is_passed[id.0 as usize] {
                continue;
            }
            self.looked_at += 1;
            if self.looked_at > self.most {
                return Err(TooMany);
            }
            let into = portal.beyond(Some(cell)).flatten();
            for seen in self.through(portal, cell, region, entrance) {
                if self.found.passes.len() >= MAX_PASSES || depth >= MAX_DEPTH {
                    return Err(TooMany);
                }
                self.found.passes.push(Pass {
                    portal: id,
                    from: cell,
                    into,
                    depth,
                    region: seen.clone(),
                });
                if let Some(into) = into {
                    self.is_passed[id.0 as usize] = true;
                    let normal = portal.normal_into(Some(into));
                    self.visit(into, &seen, Some((portal, normal)), depth + 1)?;
                    self.is_passed[id.0 as usize] = false;
                }
            }
        }
        Ok(())
    }

    /// Where one sees through a portal out of a cell, in convex pieces.
    fn through(
        &self,
        portal: &Portal,
        cell: CellId,
        region: &Region,
        entrance: Option<(&Portal, DVec3)>,
    ) -> Vec<Region> {
        // In the doorway.
        if portal.is_around(self.eye) {
            return vec![region.clone()];
        }
        let is_front = portal.cells[0] == Some(cell);
        let height = (self.eye - portal.polygon.center()).dot(portal.normal_into(Some(cell)));
        // From behind it one does not look out of this cell.
        if !(height > 0.0) {
            return Vec::new();
        }
        let pieces = portal.polygon.convex_pieces().iter();
        pieces
            .filter_map(|piece| {
                let mut seen: Vec<DVec3> = piece.iter().map(|p| *p - self.eye).collect();
                // Counter-clockwise as the eye sees it.
                if !is_front {
                    seen.reverse();
                }
                // Not what is nearer than the way in.
                if let Some((entrance, inwards)) = entrance {
                    let margin = tolerance(entrance);
                    let center = entrance.polygon.center() - self.eye;
                    seen = clip(&seen, |p| (p - center).dot(inwards) + margin);
                }
                Region::cone(&region.clip(&seen))
            })
            .collect()
    }
}
