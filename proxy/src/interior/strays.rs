//! Lines of sight that leave a cell beside all of its portals.
//!
//! Culling by portals draws what the whole model would if there are none. Where rooms are found, cells are boxes
//! and portals rectangles on a grid, and a leaf that stands open beside a doorway is in one room, but seen
//! from the other past the doorway's outline; a closed door beyond the middle of its wall is in the box of the room
//! behind it alone. [`fit_to_sight`] lets boxes and outlines reach as far as is seen.

#[cfg(test)]
mod tests;
mod within;

use super::by_cell::PortalsByCell;
use super::locate::tolerance;
use super::seen::Seen;
use super::visibility::all_around;
use super::{
    CellId, Content, Contents, Interior, InteriorError, InteriorWarning, Polygon, Portal, RoomBox,
    Visibility,
};
use crate::mesh::Model;
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use std::collections::BTreeSet;
use within::within;

/// A line of sight from a cell to a triangle that its portals hide.
#[derive(Clone, Debug, PartialEq)]
pub struct Stray {
    /// Where the eye is.
    pub from: CellId,
    /// In the world.
    pub eye: DVec3,
    /// What it sees, in the world.
    pub seen: DVec3,
    /// The cells that portals show in that direction; none of them has what is seen.
    pub shown: Vec<CellId>,
}

/// Lines of sight that were tried, and those that portals hide.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Strays {
    /// How many met a triangle.
    pub tried: usize,
    /// In the order of portals, and of their sides; then in that of cells.
    pub found: Vec<Stray>,
    /// Whether some places were left out, as too many ways lead from there through portals.
    pub is_cut: bool,
    /// How many portals were looked at to tell, each as often as it was.
    looked_at: usize,
}

impl Strays {
    /// What is to be said of them, if there are any.
    pub fn warning(&self, interior: &Interior) -> Option<InteriorWarning> {
        let first = self.found.first()?;
        Some(InteriorWarning::Hidden {
            hidden: self.found.len(),
            tried: self.tried,
            cell: interior.cell(first.from).name.clone(),
            eye: first.eye,
            seen: first.seen,
        })
    }

    /// What is to be said where not all was looked at.
    pub fn cut_warning(&self) -> Option<InteriorWarning> {
        self.is_cut
            .then_some(InteriorWarning::SightsCut(self.tried))
    }

    fn append(&mut self, other: Self) {
        self.tried += other.tried;
        self.found.extend(other.found);
        self.is_cut |= other.is_cut;
        self.looked_at += other.looked_at;
    }
}

/// Eyes before each side of a portal, and lines of sight from each.
const EYES: u32 = 64;
const LINES: u32 = 128;
/// Places that are tried for each eye.
const TRIES: u32 = 16;
/// Portals that are looked at, each as often as ways lead to it, for the eyes before one side of a portal, or within one
/// cell. Of a house of 40 rooms that is some 10,000. Of one that is taken for a hundred rooms, as its units are no
/// metres, it would be millions.
const PORTALS: usize = 1 << 18;
/// Eyes stand between these heights over the floor, and look past the portal by so much, in eyes' heights.
const HEIGHTS: [f64; 2] = [0.1, 1.6];
const BESIDE: f64 = 1.0;
/// A hit so little nearer than what is aimed at, in shares of the distance, is that; and what lies so little behind
/// a hit, in shares of the distance and of places' coordinates, is in the same place: files round these to f32.
const THERE: f64 = 1e-6;
/// From one place to the next in two and in three dimensions, so that they are spread evenly: powers of
/// the inverse of the number whose third, or fourth, power is one more than itself (Roberts 2018).
const NEXT_2: [f64; 2] = [0.754_877_666_246_692_7, 0.569_840_290_998_053_2];
const NEXT_3: [f64; 3] = [
    0.819_172_513_396_164_5,
    0.671_043_606_703_788_8,
    0.549_700_477_901_970_2,
];

/// Looks through and past every portal from many places before it, and all around from places in every cell, and
/// finds what portals hide though it is seen. From where too many ways lead through portals, fewer places are looked
/// from: [`Strays::is_cut`].
///
/// The same for any number of threads.
///
/// # Errors
/// A cell shows a node that the model does not have.
pub fn strays(interior: &Interior, model: &Model) -> Result<Strays, InteriorError> {
    let (contents, _) = Contents::new(interior, model)?;
    let seen = Seen::new(model, &contents.triangles, &contents.elsewhere);
    Ok(look(interior, &contents, &seen, PORTALS))
}

/// What needs so much of the reach is fitted first; then what needs twice as much, and so on.
const SHARES: [f64; 5] = [1.0 / 16.0, 1.0 / 8.0, 1.0 / 4.0, 1.0 / 2.0, 1.0];
/// A box rather reaches so many times as far as a portal would have to; and in all so many times the reach beyond where
/// it was at first: floor and ceiling that are seen through an opening that is no portal would carry it on, step by step.
const BOXES_FIRST: f64 = 4.0;
/// Beyond what was seen, in shares of the reach.
const MARGIN: f64 = 0.05;
/// What came to reach farther by no more than this, in margins, had what is seen well within it before: that is hidden for
/// another reason, and asks for the same again and again, but for rounding.
const SAME: f64 = 0.5;
/// How often strays are fitted with the same share. Each asks for a portal or a box once, and so for about as many as it
/// passes rooms, which are far fewer; more is rounding's doing, where it is coarser than margins are.
const ROUNDS: usize = 256;
/// How often it is looked from everywhere anew.
const LOOKS: usize = 8;

/// Lets cells' boxes, and portals that are upright rectangles, reach as far as lines of sight show that they
/// must: what needs the least first, portals by at most about `reach` at once, in world units, again and again, and
/// sides of boxes by at most about four times as much in all. What portals hide all the same is left over, as what is
/// seen through openings that are no portals.
///
/// # Errors
/// A cell shows a node that the model does not have.
pub fn fit_to_sight(
    interior: &mut Interior,
    model: &Model,
    reach: f64,
) -> Result<Strays, InteriorError> {
    let (mut contents, _) = Contents::new(interior, model)?;
    let mut seen = Seen::new(model, &contents.triangles, &contents.elsewhere);
    let mut strays = look(interior, &contents, &seen, PORTALS);
    let margin = MARGIN * reach;
    let widest = widest(interior, reach);
    // Not many more portals are looked at, before it is looked for the last time, than may be for one look.
    let most = PORTALS * (2 * interior.portals.len() + interior.cells.len());
    let mut looked_at = strays.looked_at;
    for _ in 1..LOOKS {
        if looked_at > most {
            break;
        }
        let mut left = strays.found.clone();
        let mut is_fitted = false;
        for share in SHARES {
            for _ in 0..ROUNDS {
                if looked_at > most {
                    break;
                }
                let fitted = left
                    .iter()
                    .filter_map(|stray| fit(interior, &widest, stray, share * reach, margin));
                let fitted: Vec<Fitted> = fitted.collect();
                if fitted.is_empty() {
                    break;
                }
                is_fitted = true;
                let grown: BTreeSet<CellId> = fitted.iter().filter_map(|one| one.cell).collect();
                if !grown.is_empty() {
                    contents.refill(interior, model, &grown);
                    seen.regroup(&contents.triangles);
                }
                let again = look_again(interior, &seen, &left);
                left = again.0;
                looked_at += again.1;
                if fitted.iter().all(|one| one.farther <= SAME * margin) {
                    break;
                }
            }
        }
        if !is_fitted {
            break;
        }
        let before = strays.found.len();
        strays = look(interior, &contents, &seen, PORTALS);
        looked_at += strays.looked_at;
        // What is left is hidden for other reasons, as where rooms are none.
        if strays.found.len() >= before {
            break;
        }
    }
    Ok(strays)
}

/// What reaches farther than before.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Fitted {
    /// Whose box it is; none of a portal.
    cell: Option<CellId>,
    /// By how much to one side at most, in world units; more than zero.
    farther: f64,
}

/// By cell, what its box may take in at most, if it has one: as much around as boxes may reach farther.
fn widest(interior: &Interior, reach: f64) -> Vec<Option<RoomBox>> {
    let farther = BOXES_FIRST * reach;
    let around = |room: RoomBox| RoomBox {
        min: room.min - farther,
        max: room.max + farther,
    };
    let cells = interior.cells.iter();
    cells.map(|cell| cell.content.room().map(around)).collect()
}

/// Fits what a stray is nearest to, if that is no farther than said, with a margin, and of boxes if the stray ends in
/// the widest of that cell; `None` if nothing changes.
fn fit(
    interior: &mut Interior,
    widest: &[Option<RoomBox>],
    stray: &Stray,
    reach: f64,
    margin: f64,
) -> Option<Fitted> {
    // 1. Of what leads on from where it is shown, and not from behind, the outline that it passes nearest to.
    let ray = stray.seen - stray.eye;
    let leads_on = |portal: &Portal| {
        let is_shown = portal
            .cells
            .map(|id| id.map(|id| stray.shown.contains(&id)));
        let shown = match is_shown {
            [Some(true), Some(false)] => portal.cells[0],
            [Some(false), Some(true)] => portal.cells[1],
            _ => return false,
        };
        // Whoever is behind it, as seen from there, sees nothing through it, however far it reaches.
        let from_center = stray.eye - portal.polygon.center();
        from_center.dot(portal.normal_into(shown)) >= -tolerance(portal)
    };
    let portals = interior.portals.iter().enumerate();
    let portals = portals.filter(|(_, portal)| leads_on(portal));
    let passed = portals.filter_map(|(i, portal)| {
        let along = -portal.polygon.height(stray.eye) / ray.dot(portal.polygon.normal());
        let at = stray.eye + along * ray;
        (along > 0.0 && along <= 1.0).then(|| (portal.polygon.distance(at), i, at))
    });
    let passed = passed.min_by(|a, b| a.0.total_cmp(&b.0));
    // 2. The box that it ends nearest to, of those that may reach there.
    let boxes = stray.shown.iter().filter_map(|id| {
        let room = interior.cell(*id).content.room()?;
        let may_reach = widest[id.0 as usize]?.contains(stray.seen);
        may_reach.then(|| (room.distance(stray.seen) / BOXES_FIRST, *id))
    });
    let ended = boxes.min_by(|a, b| a.0.total_cmp(&b.0));
    // 3. Whichever is nearer.
    let least = passed.map_or(f64::INFINITY, |(distance, ..)| distance);
    if let Some((distance, id)) = ended
        && distance <= least.min(reach)
    {
        let (Content::Box(room)
        | Content::Scene {
            room: Some(room), ..
        }) = &mut interior.cells[id.0 as usize].content
        else {
            return None;
        };
        let min = room.min.min(stray.seen - margin);
        let max = room.max.max(stray.seen + margin);
        let farther = (room.min - min).max(max - room.max).max_element();
        *room = RoomBox { min, max };
        return (farther > 0.0).then_some(Fitted {
            cell: Some(id),
            farther,
        });
    }
    let (_, i, at) = passed.filter(|_| least <= reach)?;
    let polygon = &mut interior.portals[i].polygon;
    let frame = Frame::of(polygon, interior.up);
    let before = frame.span(polygon);
    let place = frame.place(at);
    let (low, high) = (before[0].min(place - margin), before[1].max(place + margin));
    let farther = (before[0] - low).max(high - before[1]).max_element();
    // What is as it was is not written anew, which would round it.
    if !(farther > 0.0) {
        return None;
    }
    let corners = [
        low,
        DVec2::new(high.x, low.y),
        high,
        DVec2::new(low.x, high.y),
    ];
    *polygon = Polygon::new(corners.map(|corner| frame.at(corner)).to_vec()).ok()?;
    Some(Fitted {
        cell: None,
        farther,
    })
}

/// From everywhere, with no more portals looked at than so many before each side of a portal, and within each cell.
fn look(interior: &Interior, contents: &Contents, seen: &Seen, most: usize) -> Strays {
    let sides = interior.portals.iter().flat_map(|portal| {
        let from = portal.cells.into_iter().flatten();
        from.map(move |from| (portal, from))
    });
    let sides: Vec<(&Portal, CellId)> = sides.collect();
    let portals = PortalsByCell::new(interior);
    let before = |side: (&Portal, CellId)| before(interior, &portals, contents, seen, side, most);
    let mut found: Vec<Strays> = sides.into_par_iter().map(before).collect();
    let ids = (0..interior.cells.len() as u32).into_par_iter().map(CellId);
    let within = |id| within(interior, &portals, contents, seen, id, most).unwrap_or_default();
    let within = ids.map(within);
    found.extend(within.collect::<Vec<Strays>>());
    found.into_iter().fold(Strays::default(), |mut all, some| {
        all.append(some);
        all
    })
}

/// Those of some lines of sight that are still hidden, and how many portals were looked at to tell.
fn look_again(interior: &Interior, seen: &Seen, strays: &[Stray]) -> (Vec<Stray>, usize) {
    let of_eyes: Vec<&[Stray]> = strays
        .chunk_by(|a, b| a.eye == b.eye && a.from == b.from)
        .collect();
    let portals = PortalsByCell::new(interior);
    let left = of_eyes.into_par_iter().filter_map(|of_eye| {
        let (from, eye) = (of_eye[0].from, of_eye[0].eye);
        let (visibility, looked_at) = all_around(interior, &portals, from, eye, usize::MAX)?;
        let again = |old: &Stray| {
            let ray = old.seen - eye;
            let hit = seen.first(eye, ray)?;
            hidden(seen, &visibility, from, eye, ray, hit)
        };
        let left: Vec<Stray> = of_eye.iter().filter_map(again).collect();
        Some((left, looked_at))
    });
    let left: Vec<(Vec<Stray>, usize)> = left.collect();
    let looked_at = left.iter().map(|(_, looked_at)| looked_at).sum();
    (
        left.into_iter().flat_map(|(left, _)| left).collect(),
        looked_at,
    )
}

/// What is seen from the places on one side of a portal from which one sees through it.
fn before(
    interior: &Interior,
    portals: &PortalsByCell,
    contents: &Contents,
    seen: &Seen,
    (portal, from): (&Portal, CellId),
    most: usize,
) -> Strays {
    let mut strays = Strays::default();
    let Some(bounds) = contents.bounds.get(from.0 as usize).copied().flatten() else {
        return strays;
    };
    let frame = Frame::of(&portal.polygon, interior.up);
    let span = frame.span(&portal.polygon);
    let outer = DVec2::splat(BESIDE * interior.eye_height);
    let aim =
        |[low, high]: [DVec2; 2], [x, y]: [f64; 2]| frame.at(low + DVec2::new(x, y) * (high - low));
    let mut eyes = 0;
    for i in 1..=EYES * TRIES {
        // 1. A place in the cell from which a place in the portal is seen.
        let share = NEXT_3.map(|step| (step * f64::from(i)).fract());
        let point = bounds.min + DVec3::from_array(share) * (bounds.max - bounds.min);
        let Some(eye) = stand(interior, contents, from, point) else {
            continue;
        };
        let ray = aim(span, [share[1], share[2]]) - eye;
        let is_open = portal.polygon.covers(eye + ray, 0.0)
            && seen.first(eye, ray).is_none_or(|hit| hit.0 > 1.0 - THERE);
        if !is_open {
            continue;
        }
        // 2. Past it.
        let left = most.saturating_sub(strays.looked_at);
        let Some((visibility, looked_at)) = all_around(interior, portals, from, eye, left) else {
            strays.is_cut = true;
            break;
        };
        strays.looked_at += looked_at;
        for k in 0..LINES {
            let number = f64::from(eyes * LINES + k);
            let place = NEXT_2.map(|step| (step * number).fract());
            let ray = aim([span[0] - outer, span[1] + outer], place) - eye;
            if let Some(hit) = seen.first(eye, ray) {
                strays.tried += 1;
                let stray = hidden(seen, &visibility, from, eye, ray, hit);
                strays.found.extend(stray);
            }
        }
        eyes += 1;
        if eyes == EYES {
            break;
        }
    }
    strays
}

/// A line of sight, if portals hide what it meets: so many of its lengths away, of some cells. What is of no
/// cell is never hidden, nor what shares its place with something that is not, as walls of two rooms in one plane do.
fn hidden(
    seen: &Seen,
    visibility: &Visibility,
    from: CellId,
    eye: DVec3,
    ray: DVec3,
    (along, cells): (f64, &[CellId]),
) -> Option<Stray> {
    let visible = visibility.cells.iter();
    let shown = visible.filter(|visible| visible.regions.iter().any(|r| r.contains(ray)));
    let shown: Vec<CellId> = shown.map(|visible| visible.cell).collect();
    let is_drawn = |cells: &[CellId]| cells.is_empty() || cells.iter().any(|id| shown.contains(id));
    let place = eye + along * ray;
    let until = along + THERE * (along + place.abs().max_element() / ray.length());
    let is_hidden = !is_drawn(cells) && !seen.any_until(eye, ray, until, is_drawn);
    is_hidden.then_some(Stray {
        from,
        eye,
        seen: place,
        shown,
    })
}

/// A point of a cell's bounds, if it is in the cell: over the cell's floor, if it has one, at an eye's height.
fn stand(interior: &Interior, contents: &Contents, from: CellId, point: DVec3) -> Option<DVec3> {
    let eye = match &interior.cell(from).floor {
        Some(floor) => {
            let height = height_over(interior, floor, point);
            at_heights(interior, point, height, HEIGHTS).0
        }
        None => point,
    };
    (contents.locate(interior, eye) == Some(from)).then_some(eye)
}

/// How far a point is over a floor, which may face either way.
fn height_over(interior: &Interior, floor: &Polygon, point: DVec3) -> f64 {
    floor.height(point) * floor.normal().dot(interior.up).signum()
}

/// A point that is so high over a floor at a height between two, in eyes' heights, that goes with it; and how high
/// it is then.
fn at_heights(
    interior: &Interior,
    point: DVec3,
    height: f64,
    [low, high]: [f64; 2],
) -> (DVec3, f64) {
    let share = low + (height / interior.eye_height).rem_euclid(high - low);
    let there = share * interior.eye_height;
    (point + (there - height) * interior.up, there)
}

/// Axes in a polygon's plane.
struct Frame {
    origin: DVec3,
    across: DVec3,
    along: DVec3,
}

impl Frame {
    /// The second goes as far up as the plane does.
    fn of(polygon: &Polygon, up: DVec3) -> Self {
        let normal = polygon.normal();
        let across = match up.cross(normal) {
            across if across.length() > 1e-3 => across.normalize(),
            _ => normal.any_orthonormal_vector(),
        };
        Self {
            origin: polygon.center(),
            across,
            along: normal.cross(across),
        }
    }

    fn at(&self, place: DVec2) -> DVec3 {
        self.origin + place.x * self.across + place.y * self.along
    }

    fn place(&self, point: DVec3) -> DVec2 {
        let from = point - self.origin;
        DVec2::new(from.dot(self.across), from.dot(self.along))
    }

    /// The least and the greatest of the places of a polygon's corners.
    fn span(&self, polygon: &Polygon) -> [DVec2; 2] {
        let places = polygon.corners().iter().map(|p| self.place(*p));
        places.fold([DVec2::INFINITY, DVec2::NEG_INFINITY], |[l, h], p| {
            [l.min(p), h.max(p)]
        })
    }
}
