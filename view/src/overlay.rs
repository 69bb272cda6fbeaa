//! Lines over the picture: cameras, epipoles, the triangulation, the proxy's edges, the wipe.

use crate::content::{Space, Stop};
use crate::lines::LineMesh;
use crate::picture::Lines;
use calibrate::{Pixel, View};
use egui::{Align2, Color32, FontId, Painter, Pos2, Rect, Stroke, pos2, vec2};
use glam::{DVec2, DVec3};

/// More cameras than this are not drawn: the nearest are.
const MOST_FRUSTA: usize = 300;
/// How long a camera's frustum is, in typical depths.
const FRUSTUM: f64 = 0.07;
/// So near, in pixels, one has to click at a camera.
const CLICK_PX: f64 = 16.0;

const CAMERA: Color32 = Color32::from_rgb(255, 200, 60);
const CAMERA_NEAR: Color32 = Color32::from_rgb(90, 220, 255);
const EPIPOLE: Color32 = Color32::from_rgb(255, 90, 90);
const KEYFRAME: Color32 = Color32::from_rgb(150, 255, 120);

/// The lines that go with a picture, as large as its view is, in pixels.
pub(crate) fn mesh_of(lines: &Lines, view: &View) -> LineMesh {
    let whole = Rect::from_min_size(Pos2::ZERO, vec2(view.width as f32, view.height as f32));
    let mut mesh = LineMesh::default();
    let triangulation = Stroke::new(0.6, Color32::from_rgba_unmultiplied(255, 255, 255, 130));
    let wireframe = Stroke::new(0.7, Color32::from_rgba_unmultiplied(110, 235, 160, 150));
    for (edges, stroke) in [
        (&lines.triangulation, triangulation),
        (&lines.wireframe, wireframe),
    ] {
        for ends in edges {
            let ends = ends.map(|p| pos2(p.x as f32, p.y as f32));
            mesh.add(ends, stroke, whole, 1.0);
        }
    }
    mesh
}

/// Draws over a picture of a view.
pub(crate) struct Overlay<'a> {
    /// Clipped to the picture.
    painter: &'a Painter,
    /// Pixels of the view a point of the painter.
    pixels_per_point: f32,
    /// Of the picture.
    view: &'a View,
    lines: LineMesh,
}

impl<'a> Overlay<'a> {
    /// Draws over a picture of `view`, which fills what `painter` is clipped to.
    pub(crate) fn new(painter: &'a Painter, view: &'a View) -> Self {
        Self {
            painter,
            pixels_per_point: view.width as f32 / painter.clip_rect().width().max(1.0),
            view,
            lines: LineMesh::default(),
        }
    }

    /// Paints the lines that were drawn.
    pub(crate) fn finish(self) {
        self.lines.paint(self.painter);
    }

    fn at(&self, pixel: DVec2) -> Pos2 {
        let place = |v: f64| v as f32 / self.pixels_per_point;
        pos2(place(pixel.x), place(pixel.y))
    }

    fn line(&mut self, ends: [DVec2; 2], stroke: Stroke) {
        let ends = ends.map(|end| self.at(end));
        let feather = 1.0 / self.painter.pixels_per_point();
        let clip = self.painter.clip_rect();
        self.lines.add(ends, stroke, clip, feather);
    }

    /// Edges of the triangulation and of the proxy.
    pub(crate) fn edges(&self, mesh: &LineMesh) {
        mesh.scaled(1.0 / self.pixels_per_point).paint(self.painter);
    }

    /// Where other cameras' centres are seen.
    pub(crate) fn epipoles(&self, epipoles: &[(usize, DVec2)]) {
        for (_, at) in epipoles {
            let at = self.at(*at);
            self.painter
                .circle_stroke(at, 4.0, Stroke::new(1.5, EPIPOLE));
            self.painter.circle_filled(at, 1.2, EPIPOLE);
        }
    }

    /// The photos' cameras, `nearest` in a colour of its own.
    pub(crate) fn frusta(&mut self, stops: &[Stop], depth: f64, nearest: Option<usize>) {
        for i in nearest_few(stops, self.view) {
            let color = if Some(i) == nearest {
                CAMERA_NEAR
            } else {
                CAMERA
            };
            let length = FRUSTUM * depth;
            self.frustum(&stops[i].view, length, Stroke::new(1.0, color));
        }
    }

    /// The keyframes of the path in the making, and the way between them.
    pub(crate) fn keyframes(
        &mut self,
        poses: &[calibrate::Rigid3],
        chosen: Option<usize>,
        length: f64,
    ) {
        for (i, pose) in poses.iter().enumerate() {
            let view = View {
                camera_from_world: *pose,
                ..self.view.clone()
            };
            let width = if Some(i) == chosen { 2.5 } else { 1.0 };
            self.frustum(&view, length, Stroke::new(width, KEYFRAME));
        }
        for pair in poses.windows(2) {
            if let [Some(a), Some(b)] = [pair[0], pair[1]].map(|p| self.seen(p.center(), length)) {
                self.line([a, b], Stroke::new(1.0, KEYFRAME));
            }
        }
    }

    fn seen(&self, point: DVec3, length: f64) -> Option<DVec2> {
        seen(self.view, point, length)
    }

    fn frustum(&mut self, camera: &View, length: f64, stroke: Stroke) {
        let center = camera.center();
        let world_from_camera = camera.camera_from_world.inverse();
        let (w, h) = (f64::from(camera.width), f64::from(camera.height));
        let corners = [(0.0, 0.0), (w, 0.0), (w, h), (0.0, h)].map(|(x, y)| {
            let ray = camera.lens.unproject(Pixel::new(x, y))?;
            let ray = ray.normalize_or_zero();
            self.seen(world_from_camera * (ray * length), length)
        });
        let apex = self.seen(center, length);
        for i in 0..4 {
            if let (Some(a), Some(b)) = (corners[i], corners[(i + 1) % 4]) {
                self.line([a, b], stroke);
            }
            if let (Some(a), Some(b)) = (corners[i], apex) {
                self.line([a, b], stroke);
            }
        }
    }

    /// Outlines of portals.
    pub(crate) fn portals(&mut self, interior: &proxy::interior::Interior, length: f64) {
        for portal in &interior.portals {
            let corners = portal.polygon.corners();
            for (i, a) in corners.iter().enumerate() {
                let b = corners[(i + 1) % corners.len()];
                if let [Some(a), Some(b)] = [*a, b].map(|p| self.seen(p, length)) {
                    self.line([a, b], Stroke::new(1.2, CAMERA_NEAR));
                }
            }
        }
    }

    /// A line down the picture with what is on its sides.
    pub(crate) fn wipe(&self, share: f64, photo: &str) {
        let rect = self.painter.clip_rect();
        let x = rect.left() + share as f32 * rect.width();
        let stroke = Stroke::new(1.5, Color32::WHITE);
        self.painter
            .line_segment([pos2(x, rect.top()), pos2(x, rect.bottom())], stroke);
        let font = FontId::proportional(12.0);
        let y = rect.bottom() - 8.0;
        let text = |at: Pos2, align: Align2, text: &str| {
            self.painter.text(
                at + vec2(1.0, 1.0),
                align,
                text,
                font.clone(),
                Color32::BLACK,
            );
            self.painter
                .text(at, align, text, font.clone(), Color32::WHITE);
        };
        text(pos2(x - 6.0, y), Align2::RIGHT_BOTTOM, "rendering");
        text(pos2(x + 6.0, y), Align2::LEFT_BOTTOM, photo);
    }
}

/// Where a point is seen; not where it is nearly beside the viewer.
fn seen(view: &View, point: DVec3, length: f64) -> Option<DVec2> {
    let depth = (view.camera_from_world * point).z;
    let pixel = (depth > 0.02 * length)
        .then(|| view.project(point))
        .flatten()?;
    Some(DVec2::new(pixel.x, pixel.y)).filter(|p| p.is_finite() && p.abs().max_element() < 1e6)
}

/// The stops that are nearest to a view's centre, in order of index.
fn nearest_few(stops: &[Stop], view: &View) -> Vec<usize> {
    let mut all: Vec<usize> = (0..stops.len()).collect();
    if all.len() > MOST_FRUSTA {
        let center = view.center();
        let off = |i: &usize| stops[*i].view.center().distance_squared(center);
        all.select_nth_unstable_by(MOST_FRUSTA, |a, b| off(a).total_cmp(&off(b)).then(a.cmp(b)));
        all.truncate(MOST_FRUSTA);
        all.sort_unstable();
    }
    all
}

/// The photo's camera that a click means, if it is near one that is drawn.
pub(crate) fn clicked(space: &Space, view: &View, at: Pixel) -> Option<usize> {
    let length = FRUSTUM * space.depth;
    let off = |i: usize| {
        let camera = &space.stops[i].view;
        // Its tip, or the middle of what it looks through.
        let ahead = camera.center() + camera.forward() * length;
        let places = [camera.center(), ahead]
            .into_iter()
            .filter_map(|p| seen(view, p, length));
        places
            .map(|p| p.distance(DVec2::new(at.x, at.y)))
            .fold(f64::INFINITY, f64::min)
    };
    let offs = nearest_few(&space.stops, view)
        .into_iter()
        .map(|i| (i, off(i)));
    let near = offs.filter(|(_, off)| *off < CLICK_PX);
    near.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(i, _)| i)
}

#[cfg(test)]
mod tests {
    use super::*;
    use calibrate::{Lens, Rigid3};

    fn stop(x: f64) -> Stop {
        let pose = Rigid3::looking_at(DVec3::X * x, DVec3::new(x, 0.0, 9.0), DVec3::NEG_Y);
        Stop {
            name: x.to_string(),
            view: View {
                lens: Lens::pinhole(DVec2::splat(100.0), DVec2::new(50.0, 40.0)),
                width: 100,
                height: 80,
                camera_from_world: pose,
            },
            cell: None,
        }
    }

    #[test]
    fn a_click_means_the_camera_that_is_seen_there() {
        let space = Space {
            up: DVec3::NEG_Y,
            speed: 1.0,
            depth: 5.0,
            stops: vec![stop(-1.0), stop(0.0), stop(1.0)],
            cameras: Vec::new(),
            is_interior: false,
            times: None,
            meanwhile: String::new(),
        };
        let mut view = stop(0.0).view;
        view.camera_from_world = Rigid3::looking_at(-4.0 * DVec3::Z, DVec3::Z, DVec3::NEG_Y);
        // 4 units ahead, 1 to the right: 25 pixels off the middle.
        assert_eq!(clicked(&space, &view, Pixel::new(76.0, 41.0)), Some(2));
        assert_eq!(clicked(&space, &view, Pixel::new(51.0, 40.0)), Some(1));
        assert_eq!(clicked(&space, &view, Pixel::new(50.0, 5.0)), None);
        // From among them none is in front.
        assert_eq!(
            clicked(&space, &stop(0.5).view, Pixel::new(99.0, 79.0)),
            None
        );
    }

    #[test]
    fn of_many_cameras_the_nearest_are_drawn() {
        let stops: Vec<Stop> = (0..1000).map(|i| stop(f64::from(i))).collect();
        let few = nearest_few(&stops, &stop(500.0).view);
        assert_eq!(few.len(), MOST_FRUSTA);
        assert!(few.contains(&500) && few[0] > 300 && few.is_sorted());
    }
}
