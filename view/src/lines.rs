//! Many lines as one mesh: egui's own take five times as long, and they are drawn in every frame.

use egui::{Color32, Mesh, Painter, Pos2, Rect, Shape, Stroke};

/// Lines that are painted together.
#[derive(Debug, Default)]
pub(crate) struct LineMesh {
    mesh: Mesh,
}

impl LineMesh {
    /// Adds a line, if any of it is in `clip`. Its edges fade over `feather`, the size of a pixel;
    /// a line that is thinner is paler instead.
    pub(crate) fn add(&mut self, [a, b]: [Pos2; 2], stroke: Stroke, clip: Rect, feather: f32) {
        let along = b - a;
        let length = along.length();
        // What is far outside only costs time; so do numbers that are none.
        let is_seen = clip.expand(2.0).intersects(Rect::from_two_pos(a, b));
        let has_length = length > 1e-6 && length.is_finite();
        if !(is_seen && has_length) {
            return;
        }
        let aside = along.rot90() / length;
        let half = 0.5 * stroke.width;
        let color = match stroke.width < feather {
            true => stroke.color.gamma_multiply(stroke.width / feather),
            false => stroke.color,
        };
        let inner = (half - 0.5 * feather).max(0.0);
        let outer = inner + feather;
        let first = self.mesh.vertices.len() as u32;
        for end in [a, b] {
            for (off, color) in [
                (-outer, Color32::TRANSPARENT),
                (-inner, color),
                (inner, color),
                (outer, Color32::TRANSPARENT),
            ] {
                self.mesh.colored_vertex(end + off * aside, color);
            }
        }
        for i in [0, 1, 2].map(|strip| first + strip) {
            self.mesh.add_triangle(i, i + 1, i + 4);
            self.mesh.add_triangle(i + 1, i + 4, i + 5);
        }
    }

    /// The same lines, all places times a factor.
    pub(crate) fn scaled(&self, factor: f32) -> Self {
        let mut mesh = self.mesh.clone();
        for vertex in &mut mesh.vertices {
            vertex.pos = (vertex.pos.to_vec2() * factor).to_pos2();
        }
        Self { mesh }
    }

    /// How many there are.
    pub(crate) fn len(&self) -> usize {
        self.mesh.vertices.len() / 8
    }

    /// Paints them.
    pub(crate) fn paint(self, painter: &Painter) {
        if self.len() > 0 {
            painter.add(Shape::mesh(self.mesh));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use egui::pos2;

    #[test]
    fn lines_are_as_wide_as_they_are_said_to_be_and_none_is_made_of_nonsense() {
        let clip = Rect::from_min_max(pos2(0.0, 0.0), pos2(100.0, 80.0));
        let mut lines = LineMesh::default();
        let mut add = |a: Pos2, b: Pos2, width: f32| {
            lines.add([a, b], Stroke::new(width, Color32::WHITE), clip, 0.5);
            lines.len()
        };
        assert_eq!(add(pos2(10.0, 10.0), pos2(10.0, 10.0), 1.0), 0);
        assert_eq!(add(pos2(f32::NAN, 10.0), pos2(20.0, 10.0), 1.0), 0);
        assert_eq!(add(pos2(f32::INFINITY, 10.0), pos2(20.0, 10.0), 1.0), 0);
        assert_eq!(add(pos2(500.0, 10.0), pos2(120.0, 10.0), 1.0), 0);
        assert_eq!(add(pos2(10.0, 20.0), pos2(30.0, 20.0), 3.0), 1);
        let bounds = lines.mesh.calc_bounds();
        assert_eq!((bounds.top(), bounds.bottom()), (18.25, 21.75));
        // Half as wide as a pixel: half as strong.
        lines.add(
            [pos2(10.0, 20.0), pos2(30.0, 20.0)],
            Stroke::new(0.25, Color32::WHITE),
            clip,
            0.5,
        );
        let inner = lines.mesh.vertices[9].color;
        assert!((120..=136).contains(&inner.a()), "{inner:?}");
        assert!(lines.mesh.is_valid());
        let twice = lines.scaled(2.0);
        assert_eq!(twice.mesh.calc_bounds().bottom(), 43.5);
    }
}
