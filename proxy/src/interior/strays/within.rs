//! Lines of sight all around from places in a cell, wherever its portals are.

use super::{LINES, NEXT_2, NEXT_3, Strays, TRIES, at_heights, height_over, hidden};
use crate::interior::by_cell::PortalsByCell;
use crate::interior::seen::Seen;
use crate::interior::visibility::all_around;
use crate::interior::{CellId, Contents, Interior, RoomBox};
use glam::DVec3;
use std::f64::consts::TAU;

/// Eyes in each cell besides, each with as many lines to all sides: with [`LINES`] 4,096 a cell.
const EYES_WITHIN: u32 = 32;
/// They stand lower than any ceiling, and so far from the cell's sides that they are in no wall; in eyes' heights.
const HEIGHTS_WITHIN: [f64; 2] = [0.1, 1.2];
const FROM_SIDES: f64 = 0.2;
/// Nearer to a side than this one may stand in a wall that two cells share, half of it each; in eyes' heights.
const HALF_A_WALL: f64 = 0.5;
/// The floor below them is so near to where it should be; in eyes' heights.
const UNEVEN: f64 = 0.25;
/// Who sees more of what is hidden than this share is not in the cell: in a shaft that its outline takes in, say.
const MOST_HIDDEN: f64 = 0.25;

/// What is seen all around from places spread over a cell's floor, with no more portals looked at than so many; `None`
/// of a cell whose place is unknown.
pub(super) fn within(
    interior: &Interior,
    portals: &PortalsByCell,
    contents: &Contents,
    seen: &Seen,
    from: CellId,
    most: usize,
) -> Option<Strays> {
    // 1. Where eyes are tried: over the floor's outline, which stays as it is where boxes grow, else in the bounds.
    let heights = HEIGHTS_WITHIN.map(|height| height * interior.eye_height * interior.up);
    let floor = interior.cell(from).floor.as_ref();
    let place = match floor {
        Some(floor) => {
            let corners = floor.corners().iter();
            let corners = corners.flat_map(|corner| heights.map(|height| *corner + height));
            let none = (DVec3::INFINITY, DVec3::NEG_INFINITY);
            let (min, max) = corners.fold(none, |(l, h), p| (l.min(p), h.max(p)));
            RoomBox { min, max }
        }
        None => contents.bounds.get(from.0 as usize).copied().flatten()?,
    };
    let lowest = contents.floor_of(interior, from)?;
    let mut strays = Strays::default();
    let mut eyes = 0;
    for i in 1..=EYES_WITHIN * TRIES {
        // 2. One that stands in it.
        let share = NEXT_3.map(|step| (step * f64::from(i)).fract());
        let point = place.min + DVec3::from_array(share) * (place.max - place.min);
        let height = floor.map_or(point.dot(interior.up) - lowest, |floor| {
            height_over(interior, floor, point)
        });
        let (eye, height) = at_heights(interior, point, height, HEIGHTS_WITHIN);
        if contents.locate(interior, eye) != Some(from)
            || !goes_on_around(interior, contents, from, eye, FROM_SIDES)
            || is_in_wall(interior, contents, seen, from, eye)
            || !is_over_floor(interior, seen, eye, height)
        {
            continue;
        }
        // 3. All around.
        let left = most.saturating_sub(strays.looked_at);
        let Some((visibility, looked_at)) = all_around(interior, portals, from, eye, left) else {
            strays.is_cut = true;
            break;
        };
        strays.looked_at += looked_at;
        let mut around = Strays::default();
        for k in 0..LINES {
            let number = f64::from(eyes * LINES + k);
            let [z, turn] = NEXT_2.map(|step| (step * number).fract());
            let (z, (sin, cos)) = (2.0 * z - 1.0, (TAU * turn).sin_cos());
            let ray = (1.0 - z * z).sqrt() * DVec3::new(cos, sin, 0.0) + z * DVec3::Z;
            if let Some(hit) = seen.first(eye, ray) {
                around.tried += 1;
                let stray = hidden(seen, &visibility, from, eye, ray, hit);
                around.found.extend(stray);
            }
        }
        if around.found.len() as f64 <= MOST_HIDDEN * around.tried as f64 {
            strays.append(around);
        }
        eyes += 1;
        if eyes == EYES_WITHIN {
            break;
        }
    }
    Some(strays)
}

/// Whether all around a place, at its height, the cell goes on so far, in eyes' heights.
fn goes_on_around(
    interior: &Interior,
    contents: &Contents,
    from: CellId,
    eye: DVec3,
    reach: f64,
) -> bool {
    let is_in = |place: DVec3| contents.room_around(interior, from, place).is_some();
    let mut steps = level_ways(interior).map(|way| reach * interior.eye_height * way);
    steps.all(|step| is_in(eye + step))
}

/// Whether a place near the cell's sides is inside of a wall: most of what is next to it at its height is seen from
/// behind. Farther in, a model whose triangles face the wrong way looks no different.
fn is_in_wall(
    interior: &Interior,
    contents: &Contents,
    seen: &Seen,
    from: CellId,
    eye: DVec3,
) -> bool {
    if goes_on_around(interior, contents, from, eye, HALF_A_WALL) {
        return false;
    }
    let met = level_ways(interior).filter_map(|way| seen.is_first_from_behind(eye, way));
    let (met, behind) = met.fold((0, 0), |(met, n), is| (met + 1, n + usize::from(is)));
    2 * behind > met
}

/// Eight ways all around that keep the height.
fn level_ways(interior: &Interior) -> impl Iterator<Item = DVec3> {
    let (x, y) = interior.up.any_orthonormal_pair();
    let diagonals = [x + y, x - y].map(DVec3::normalize);
    let ways = [x, y, diagonals[0], diagonals[1]];
    ways.into_iter().flat_map(|way| [way, -way])
}

/// Whether what is next below a place is about as far below it as its floor should be.
fn is_over_floor(interior: &Interior, seen: &Seen, eye: DVec3, height: f64) -> bool {
    let uneven = UNEVEN * interior.eye_height;
    let reach = height + uneven;
    let below = seen.first(eye, -reach * interior.up);
    below.is_some_and(|(along, _)| along <= 1.0 && along * reach >= height - uneven)
}
