//! Where to look into a cell from: semicircles before its portals.
//!
//! Rafferty et al. 1998, "Images for accelerating architectural walkthroughs", §2.2 and 4.1 and
//! Figure 2: reference images from a semicircle before each portal at eye height.

use super::{CellId, Contents, Interior, Portal, PortalId};
use calibrate::Rigid3;
use glam::DVec3;

/// How the cameras stand before a portal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SemicircleOptions {
    /// How many cameras for each portal and direction: odd, 2n + 1, so that one is in the
    /// middle. An even number is taken as the next odd one.
    pub views: usize,
    /// The angle at the portal that they span, in radians, of 0 to π: at π the outermost stand in
    /// the portal's plane.
    pub span: f64,
}

impl Default for SemicircleOptions {
    fn default() -> Self {
        Self {
            views: 13,
            span: 120_f64.to_radians(),
        }
    }
}

/// A camera before a portal.
#[derive(Clone, Debug, PartialEq)]
pub struct SemicircleView {
    /// The portal, which is looked through.
    pub portal: PortalId,
    /// The viewer's side; none is the outside.
    pub from: Option<CellId>,
    /// The cell beyond, which is to be seen.
    pub into: CellId,
    /// From the portal's normal, in radians; 0 is the middle, positive to the right of who looks
    /// at the portal.
    pub angle: f64,
    /// Whether it stands in the viewer's cell, as far as that is known; else the radius is too
    /// large for the room.
    pub is_inside: bool,
    /// Aimed at the portal's centre, upright.
    pub camera_from_world: Rigid3,
}

/// The cameras before every portal and on each of its sides from which a cell can be seen, in
/// the portals' order, from left to right.
///
/// They stand on the viewer's side at eye height over the floor that is before the portal there; see
/// [`Contents::floor_height`]; where some would be behind a portal that leans, at the height of its centre. Before one
/// that lies flat (a hatch; [`Portal::lies_flat`]), they stand on a semicircle across it whatever the floor. Of cells that `contents` does not have, nothing is known but outlines.
pub fn semicircles(
    interior: &Interior,
    contents: &Contents,
    options: &SemicircleOptions,
) -> Vec<SemicircleView> {
    let ids = (0..).map(PortalId);
    let portals = ids.zip(&interior.portals);
    let sides = portals.flat_map(|(id, portal)| {
        let [front, back] = portal.cells;
        [(id, portal, front, back), (id, portal, back, front)]
    });
    sides
        .filter_map(|(id, portal, from, into)| Some((id, portal, from, into?)))
        .flat_map(|(id, portal, from, into)| {
            before(interior, contents, id, portal, from, into, options)
        })
        .collect()
}

/// How far behind a portal a camera is taken for one in its plane, in radii.
const ROUNDING: f64 = 1e-3;

/// How a semicircle lies before a portal.
struct Axes {
    /// Whether it is level; across a portal that lies flat it stands.
    is_level: bool,
    /// Towards the viewer.
    ahead: DVec3,
    /// To the right of who looks at the portal.
    right: DVec3,
}

impl Axes {
    fn before(up: DVec3, portal: &Portal, from: Option<CellId>) -> Self {
        let normal = portal.normal_into(from);
        // Whoever looks against `ahead` has `right` on the right.
        let level = normal - up * normal.dot(up);
        let is_level = !portal.lies_flat(up);
        let ahead = if is_level { level.normalize() } else { normal };
        let right = match up.cross(ahead).try_normalize() {
            Some(right) if is_level => right,
            _ => ahead.any_orthonormal_vector(),
        };
        Self {
            is_level,
            ahead,
            right,
        }
    }
}

/// The angle at which an eye stands before a portal, as [`SemicircleView::angle`] has it: 0 in the
/// middle, positive to the right of who looks at the portal, beyond ±π/2 behind it.
pub fn angle_before(interior: &Interior, portal: &Portal, from: Option<CellId>, eye: DVec3) -> f64 {
    let axes = Axes::before(interior.up, portal, from);
    let offset = eye - portal.polygon.center();
    let angle = offset.dot(axes.right).atan2(offset.dot(axes.ahead));
    if angle.is_nan() { 0.0 } else { angle }
}

fn before(
    interior: &Interior,
    contents: &Contents,
    id: PortalId,
    portal: &Portal,
    from: Option<CellId>,
    into: CellId,
    options: &SemicircleOptions,
) -> Vec<SemicircleView> {
    let up = interior.up;
    let target = portal.polygon.center();
    let Axes {
        is_level,
        ahead,
        right,
    } = Axes::before(up, portal, from);
    let radius = portal.semicircle_radius(up);
    let each_side = (options.views / 2) as i64;
    // A NaN is as good as nothing given.
    let span = match options.span.is_nan() {
        true => SemicircleOptions::default().span,
        false => options.span.clamp(0.0, std::f64::consts::PI),
    };
    let angle = |i: i64| match each_side {
        0 => 0.0,
        n => 0.5 * span * i as f64 / n as f64,
    };
    // How high.
    let center = if is_level {
        let floor = contents.floor_height(interior, from, portal);
        let height = floor + interior.eye_height;
        let at_eyes = target + up * (height - target.dot(up));
        let outermost = at_eyes + radius * angle(each_side).cos() * ahead;
        let before = (outermost - target).dot(portal.normal_into(from));
        match before < -ROUNDING * radius {
            true => target,
            false => at_eyes,
        }
    } else {
        target
    };
    // The cameras.
    let camera = |i: i64| {
        let angle = angle(i);
        let place = center + radius * (angle.cos() * ahead + angle.sin() * right);
        SemicircleView {
            portal: id,
            from,
            into,
            angle,
            is_inside: is_inside(interior, contents, from, place),
            camera_from_world: Rigid3::looking_at(place, target, up),
        }
    };
    (-each_side..=each_side).map(camera).collect()
}

fn is_inside(interior: &Interior, contents: &Contents, cell: Option<CellId>, place: DVec3) -> bool {
    let Some(id) = cell else {
        return true;
    };
    let room = contents.bounds_of(id);
    let floor = interior.cells.get(id.0 as usize);
    let floor = floor.and_then(|cell| cell.floor.as_ref());
    room.is_none_or(|room| room.contains(place))
        && floor.is_none_or(|floor| floor.covers(place, 0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::interior::parse_rooms;
    use crate::mesh::Model;
    use std::path::Path;

    /// A room over another with an opening between them, and the places before it, by side.
    fn places(polygon: &str) -> (Interior, [Vec<DVec3>; 2]) {
        let text = format!(
            r#"{{"version": 1, "rooms": [
                {{"name": "below", "min": [0, 0, 0], "max": [4, 2.5, 4]}},
                {{"name": "above", "min": [0, 2.5, 0], "max": [4, 5, 4]}}],
                "openings": [{{"name": "hatch", "between": ["below", "above"], "polygon": {polygon}}}]}}"#
        );
        let (interior, _) = parse_rooms(Path::new("r.json"), text.as_bytes(), "m.glb").unwrap();
        let (contents, _) = Contents::new(&interior, &Model::default()).unwrap();
        let views = semicircles(&interior, &contents, &SemicircleOptions::default());
        let of_side = |side: u32| {
            let views = views.iter().filter(|view| view.from == Some(CellId(side)));
            views.map(|view| view.camera_from_world.center()).collect()
        };
        let sides = [of_side(0), of_side(1)];
        (interior, sides)
    }

    /// How far the nearest of some places is before a portal, on a cell's side.
    fn nearest(portal: &Portal, side: u32, places: &[DVec3]) -> f64 {
        let normal = portal.normal_into(Some(CellId(side)));
        let before = |place: &DVec3| (*place - portal.polygon.center()).dot(normal);
        places.iter().map(before).fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn before_an_opening_that_lies_almost_flat_cameras_stand_as_before_one_that_does() {
        let (of_flat, expected) = places("[[1, 2.5, 1], [2, 2.5, 1], [2, 2.5, 2], [1, 2.5, 2]]");
        let width = of_flat.portals[0].width(of_flat.up);
        // A centimetre askew; a quarter of a metre, either way.
        for (askew, off) in [
            (
                "[[1, 2.5, 1], [2, 2.51, 1], [2, 2.51, 2], [1, 2.5, 2]]",
                0.03,
            ),
            (
                "[[1, 2.5, 1], [2, 2.75, 1], [2, 2.75, 2], [1, 2.5, 2]]",
                0.6,
            ),
            (
                "[[1, 2.75, 1], [2, 2.75, 1], [2, 2.5, 2], [1, 2.5, 2]]",
                0.6,
            ),
        ] {
            let (interior, sides) = places(askew);
            let portal = &interior.portals[0];
            assert!(portal.lies_flat(interior.up));
            assert!((portal.width(interior.up) - width).abs() < 0.05, "{askew}");
            for side in [0, 1] {
                let [places, expected] = [&sides, &expected].map(|sides| &sides[side]);
                assert_eq!(places.len(), 13);
                assert!(nearest(portal, side as u32, places) > 0.7, "{askew}");
                // The one in the middle, straight over or under it.
                assert!(
                    places[6].distance(expected[6]) < off,
                    "{askew}: {}",
                    places[6]
                );
            }
        }
    }

    #[test]
    fn no_camera_is_behind_an_opening_that_leans() {
        // 30° from upright: by the floor below, far under the eyes of who is above; and the other way.
        for (low, of_center) in [(0.2, 1), (3.5, 0)] {
            let high = low + 0.866;
            let polygon = format!(
                "[[1, {low}, 2.25], [2, {low}, 2.25], [2, {high}, 1.75], [1, {high}, 1.75]]"
            );
            let (interior, sides) = places(&polygon);
            let portal = &interior.portals[0];
            assert!(!portal.lies_flat(interior.up));
            for (side, places) in sides.iter().enumerate() {
                assert!(nearest(portal, side as u32, places) > 0.0, "{low}: {side}");
                let off = places[0].y - portal.polygon.center().y;
                assert_eq!(off.abs() < 1e-9, side == of_center, "{low}: {side}, {off}");
            }
        }
    }
}
