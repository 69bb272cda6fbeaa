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
/// [`Contents::floor_height`]. Before a portal that lies flat (a hatch), they stand on a semicircle
/// across it whatever the floor. Of cells that `contents` does not have, nothing is known but outlines.
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
        let is_level = level.length() > 1e-3;
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
    let center = if is_level {
        let floor = contents.floor_height(interior, from, portal);
        let height = floor + interior.eye_height;
        target + up * (height - target.dot(up))
    } else {
        target
    };
    let radius = portal.semicircle_radius(up);
    // The cameras.
    let each_side = (options.views / 2) as i64;
    // A NaN is as good as nothing given.
    let span = match options.span.is_nan() {
        true => SemicircleOptions::default().span,
        false => options.span.clamp(0.0, std::f64::consts::PI),
    };
    let camera = |i: i64| {
        let angle = match each_side {
            0 => 0.0,
            n => 0.5 * span * i as f64 / n as f64,
        };
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
