//! The floor plan: cells, portals, and where one is.

use crate::content::House;
use calibrate::Rigid3;
use egui::{Color32, Painter, Pos2, Rect, Shape, Stroke, pos2, vec2};
use glam::{DVec2, DVec3};
use proxy::interior::{CellId, Portal, RoomBox};

/// A map of an interior as seen from above.
#[derive(Clone, Debug)]
pub(crate) struct Plan {
    /// To the right and down on the map, in the world.
    axes: [DVec3; 2],
    /// By cell: the corners of its floor.
    cells: Vec<Vec<DVec2>>,
    /// Ends, and whether one can walk through.
    portals: Vec<([DVec2; 2], bool)>,
    least: DVec2,
    most: DVec2,
}

impl Plan {
    /// The map of an interior.
    pub(crate) fn new(house: &House) -> Self {
        let interior = &house.interior;
        let up = interior.up;
        // As far as may be along the world's axes, so that walls are straight.
        let right = [DVec3::X, DVec3::Z, DVec3::Y]
            .into_iter()
            .find(|axis| up.dot(*axis).abs() < 0.9)
            .map_or(up.any_orthonormal_vector(), |axis| {
                (axis - up * axis.dot(up)).normalize()
            });
        // Seen from above, x to the right: down the map is towards the viewer.
        let axes = [right, right.cross(up)];
        let flat = |p: DVec3| DVec2::new(p.dot(axes[0]), p.dot(axes[1]));
        let cells = interior.cells.iter().enumerate().map(|(i, cell)| {
            let room = house.contents.bounds.get(i).copied().flatten();
            match (&cell.floor, room) {
                (Some(floor), _) => floor.corners().iter().map(|p| flat(*p)).collect(),
                (None, Some(room)) => outline(&room, flat),
                (None, None) => Vec::new(),
            }
        });
        let cells: Vec<Vec<DVec2>> = cells.collect();
        let is_door = |p: &Portal| house.contents.is_door(interior, p);
        let portals = interior
            .portals
            .iter()
            .map(|p| (ends(p, up, flat), is_door(p)));
        let portals: Vec<_> = portals.collect();
        let places = || {
            cells
                .iter()
                .flatten()
                .chain(portals.iter().flat_map(|(ends, _)| ends))
        };
        let least = places().fold(DVec2::INFINITY, |a, p| a.min(*p));
        let most = places().fold(DVec2::NEG_INFINITY, |a, p| a.max(*p));
        Self {
            axes,
            cells,
            portals,
            least,
            most,
        }
    }

    fn flat(&self, point: DVec3) -> DVec2 {
        DVec2::new(point.dot(self.axes[0]), point.dot(self.axes[1]))
    }

    /// Draws it, with the viewer.
    pub(crate) fn paint(&self, painter: &Painter, rect: Rect, pose: &Rigid3, cell: Option<CellId>) {
        let size = self.most - self.least;
        if !(size.max_element() > 0.0) || !size.is_finite() {
            return;
        }
        let inner = rect.shrink(8.0);
        let scale = (f64::from(inner.width()) / size.x.max(1e-12))
            .min(f64::from(inner.height()) / size.y.max(1e-12));
        let margin = vec2(
            inner.width() - (size.x * scale) as f32,
            inner.height() - (size.y * scale) as f32,
        );
        let corner = inner.min + 0.5 * margin;
        let place = |p: DVec2| {
            let p = (p - self.least) * scale;
            corner + vec2(p.x as f32, p.y as f32)
        };
        painter.rect_filled(rect, 4.0, Color32::from_black_alpha(170));
        for (i, outline) in self.cells.iter().enumerate() {
            let is_here = cell == Some(CellId(i as u32));
            let fill = match is_here {
                true => Color32::from_rgb(60, 110, 150),
                false => Color32::from_rgb(60, 60, 68),
            };
            let points: Vec<Pos2> = outline.iter().map(|p| place(*p)).collect();
            // Floors may have corners that point inwards, which egui does not fill.
            if points.len() <= 4 {
                painter.add(Shape::convex_polygon(points.clone(), fill, Stroke::NONE));
            }
            let color = if is_here {
                Color32::from_rgb(120, 200, 255)
            } else {
                Color32::GRAY
            };
            painter.add(Shape::closed_line(points, Stroke::new(1.0, color)));
        }
        for (ends, is_door) in &self.portals {
            let color = match is_door {
                true => Color32::from_rgb(255, 200, 60),
                false => Color32::from_rgb(120, 160, 220),
            };
            let ends = ends.map(place);
            painter.line_segment(ends, Stroke::new(3.0, color));
        }
        // The viewer looks ahead.
        let eye = place(self.flat(pose.center()));
        let ahead = self
            .flat(pose.rotation.conjugate() * DVec3::Z)
            .normalize_or_zero();
        let ahead = vec2(ahead.x as f32, ahead.y as f32);
        let aside = ahead.rot90();
        let wedge = vec![
            eye,
            eye + 22.0 * ahead + 14.0 * aside,
            eye + 22.0 * ahead - 14.0 * aside,
        ];
        let light = Color32::from_rgba_unmultiplied(255, 255, 255, 70);
        painter.add(Shape::convex_polygon(wedge, light, Stroke::NONE));
        painter.circle_filled(eye, 4.0, Color32::WHITE);
    }
}

fn outline(room: &RoomBox, flat: impl Fn(DVec3) -> DVec2) -> Vec<DVec2> {
    let corners = (0..8).map(|i| {
        let pick = |bit: usize, low: f64, high: f64| if i >> bit & 1 == 0 { low } else { high };
        flat(DVec3::new(
            pick(0, room.min.x, room.max.x),
            pick(1, room.min.y, room.max.y),
            pick(2, room.min.z, room.max.z),
        ))
    });
    let corners: Vec<DVec2> = corners.collect();
    let low = corners.iter().fold(DVec2::INFINITY, |a, p| a.min(*p));
    let high = corners.iter().fold(DVec2::NEG_INFINITY, |a, p| a.max(*p));
    vec![
        low,
        DVec2::new(high.x, low.y),
        high,
        DVec2::new(low.x, high.y),
    ]
}

/// The two corners that are the farthest apart on the map.
fn ends(portal: &Portal, up: DVec3, flat: impl Fn(DVec3) -> DVec2) -> [DVec2; 2] {
    let across = up
        .cross(portal.polygon.normal())
        .normalize_or(portal.polygon.normal().any_orthonormal_vector());
    let corners = portal.polygon.corners();
    let along = |p: &&DVec3| p.dot(across);
    let first = corners.iter().min_by(|a, b| along(a).total_cmp(&along(b)));
    let last = corners.iter().max_by(|a, b| along(a).total_cmp(&along(b)));
    [first, last].map(|p| flat(*p.unwrap_or(&DVec3::ZERO)))
}

/// Where the plan is drawn: in a corner, at most a third of the picture.
pub(crate) fn place(of: Rect) -> Rect {
    let side = (0.34 * of.width().min(of.height())).clamp(60.0, 260.0);
    let corner = pos2(of.left() + 10.0, of.bottom() - 10.0 - side);
    Rect::from_min_size(corner, vec2(side, side))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_leaves_most_of_the_picture_free() {
        for size in [vec2(800.0, 600.0), vec2(320.0, 240.0), vec2(5000.0, 4000.0)] {
            let rect = place(Rect::from_min_size(pos2(0.0, 0.0), size));
            assert!(rect.width() <= 260.0 && rect.height() <= 0.35 * size.y);
        }
    }
}
