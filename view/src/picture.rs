//! What is asked of the thread that draws, and what comes back.

use crate::compose::BEHIND;
use crate::lines::LineMesh;
use calibrate::{Pixel, View};
use egui::ColorImage;
use glam::{DVec2, DVec3};
use render::interior::PortalFill;
use render::{FieldOptions, Method, Moment};
use std::sync::Arc;

/// What pixels show.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Layer {
    /// The picture.
    #[default]
    Picture,
    /// Which photo paints which pixel, a colour for each.
    Field,
    /// How far away things are: near is light.
    Depth,
    /// The picture, with what no photo covers marked.
    Coverage,
    /// The proxy, lit from the viewer.
    Shaded,
}

impl Layer {
    /// All, in the order of the panel.
    pub const ALL: [Self; 5] = [
        Self::Picture,
        Self::Field,
        Self::Depth,
        Self::Coverage,
        Self::Shaded,
    ];

    /// Whether interiors have it, too: of theirs there is neither a blending field nor a proxy.
    pub fn is_of_interiors(self) -> bool {
        !matches!(self, Self::Field | Self::Shaded)
    }

    /// For people, and for the trace.
    pub fn name(self) -> &'static str {
        match self {
            Self::Picture => "picture",
            Self::Field => "field",
            Self::Depth => "depth",
            Self::Coverage => "coverage",
            Self::Shaded => "proxy",
        }
    }
}

/// Everything besides the view that decides what is drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct Look {
    /// What pixels show.
    pub layer: Layer,
    /// How photos are weighted.
    pub options: FieldOptions,
    /// How the field is evaluated.
    pub method: Method,
    /// What is seen through the portals of an interior.
    pub portals: PortalFill,
    /// When, of a scene that moves.
    pub moment: Option<Moment>,
    /// Whether the field's triangulation is wanted.
    pub triangulation: bool,
    /// Whether the proxy's edges are wanted.
    pub wireframe: bool,
    /// Whether the nearest photo is wanted, for the wipe.
    pub photo: bool,
    /// Stops by which the picture is shown lighter or darker.
    pub exposure_stops: f64,
    /// What is behind what no photo covers; `None` for squares, as it is transparent.
    pub background: Option<[u8; 3]>,
}

impl Default for Look {
    fn default() -> Self {
        Self {
            layer: Layer::Picture,
            options: FieldOptions::default(),
            method: Method::TRIANGULATED,
            portals: PortalFill::Geometry,
            moment: None,
            triangulation: false,
            wireframe: false,
            photo: false,
            exposure_stops: 0.0,
            background: Some(BEHIND),
        }
    }
}

/// A picture that is wanted.
#[derive(Clone, Debug, PartialEq)]
pub struct Request {
    /// Counts up.
    pub id: u64,
    /// From where, and how large.
    pub view: View,
    /// How.
    pub look: Look,
    /// Whether the next one will soon be wanted, so that a coarser one will do.
    pub is_moving: bool,
    /// A pixel about which more is to be said.
    pub hover: Option<Pixel>,
}

/// A picture that was drawn.
#[derive(Clone, Debug)]
pub struct Shown {
    /// Of the request.
    pub id: u64,
    /// The view that was asked for, at the size that was asked for.
    pub view: View,
    /// How many times smaller it was drawn.
    pub reduction: u32,
    /// The picture, over what is behind it.
    pub image: Arc<ColorImage>,
    /// The nearest source view, and its photo as this view would show it were all far away.
    pub photo: Option<(usize, Arc<ColorImage>)>,
    /// Lines over it, in pixels of the view.
    pub lines: Lines,
    /// Those that are many, as they are painted.
    pub(crate) mesh: Arc<LineMesh>,
    /// How far away things are.
    pub depths: DepthGrid,
    /// How well the photos support it; none of interiors.
    pub support: Option<Support>,
    /// About the pixel asked for.
    pub hover: Option<Hover>,
    /// Which cell of an interior the viewer is in.
    pub cell: Option<usize>,
    /// What took how long, in ms.
    pub stages: Vec<(&'static str, f64)>,
    /// What was skipped, for people.
    pub skipped: String,
    /// What drew it.
    pub device: String,
    /// Which content it shows: counts up as better ones come.
    pub revision: u64,
}

impl Shown {
    /// All stages, in ms.
    pub fn time_ms(&self) -> f64 {
        self.stages.iter().map(|(_, ms)| ms).sum()
    }
}

/// Lines and places, in pixels of the view.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lines {
    /// Edges of the field's triangulation.
    pub triangulation: Vec<[DVec2; 2]>,
    /// Edges of the proxy.
    pub wireframe: Vec<[DVec2; 2]>,
    /// Source views and where their centres are seen, of those that matter to the field.
    pub epipoles: Vec<(usize, DVec2)>,
}

/// How well photos support a view.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Support {
    /// The share of the picture that they cover.
    pub covered: f64,
    /// Of the nearest photo of a ray, in radians: the median over the picture.
    pub difference: f64,
}

impl Support {
    /// 1 where photos support the view, 0 where they hardly do.
    pub fn share(&self) -> f64 {
        let fade = |value: f64, good: f64, bad: f64| ((bad - value) / (bad - good)).clamp(0.0, 1.0);
        // A photo 20° off shows most of what there is, one 60° off little of it.
        fade(self.difference, 0.35, 1.05).min(fade(1.0 - self.covered, 0.3, 0.8))
    }
}

/// About one pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Hover {
    /// Which.
    pub pixel: Pixel,
    /// The point that it sees, in the world.
    pub point_in_world: Option<DVec3>,
    /// Who paints it, and how much; the greatest first.
    pub weights: Vec<(usize, f64)>,
}

/// Depths of a few pixels of a view, spread evenly over it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DepthGrid {
    /// Across.
    pub columns: usize,
    /// Down.
    pub rows: usize,
    /// Row by row, of the places' centres: 1 / z in the camera's frame; 0 where nothing is seen.
    pub inverse_depths: Vec<f64>,
}

impl DepthGrid {
    /// Places across the longer side.
    const ACROSS: u32 = 40;

    /// A grid for pictures of a size, filled by `inverse_depth` of a pixel.
    pub fn new(width: u32, height: u32, inverse_depth: impl Fn(Pixel) -> Option<f64>) -> Self {
        let longest = width.max(height).max(1);
        let across = |side: u32| (side * Self::ACROSS).div_ceil(longest).max(1) as usize;
        let (columns, rows) = (across(width), across(height));
        let at = |i: usize| {
            let (x, y) = (i % columns, i / columns);
            let place =
                |i: usize, of: usize, side: u32| (i as f64 + 0.5) / of as f64 * f64::from(side);
            let pixel = Pixel::new(place(x, columns, width), place(y, rows, height));
            let found = inverse_depth(pixel).filter(|s| s.is_finite() && *s > 0.0);
            found.unwrap_or(0.0)
        };
        Self {
            columns,
            rows,
            inverse_depths: (0..columns * rows).map(at).collect(),
        }
    }

    /// 1 / z at a pixel of the view, or near it where nothing is seen there.
    pub fn at(&self, view: &View, pixel: Pixel) -> Option<f64> {
        let index = |v: f64, side: u32, of: usize| {
            (v / f64::from(side.max(1)) * of as f64).clamp(0.0, of as f64 - 1.0) as i64
        };
        if self.inverse_depths.is_empty() {
            return None;
        }
        let column = index(pixel.x, view.width, self.columns);
        let row = index(pixel.y, view.height, self.rows);
        // Rings around the place, up to a quarter of the picture.
        for ring in 0..=(self.columns.max(self.rows) as i64 / 4) {
            let mut found: Vec<f64> = Vec::new();
            for y in row - ring..=row + ring {
                for x in column - ring..=column + ring {
                    let is_on_ring = (x - column).abs().max((y - row).abs()) == ring;
                    let is_in =
                        (0..self.columns as i64).contains(&x) && (0..self.rows as i64).contains(&y);
                    if is_on_ring && is_in {
                        let s = self.inverse_depths[y as usize * self.columns + x as usize];
                        found.extend((s > 0.0).then_some(s));
                    }
                }
            }
            found.sort_by(f64::total_cmp);
            if let Some(s) = found.get(found.len() / 2) {
                return Some(*s);
            }
        }
        None
    }

    /// The point of the world at a pixel of the view, `otherwise` so deep where nothing is known.
    pub fn point(&self, view: &View, pixel: Pixel, otherwise: f64) -> DVec3 {
        let depth = self.at(view, pixel).map_or(otherwise, |s| 1.0 / s);
        on_ray(view, pixel, depth)
    }
}

/// The point of the world that a pixel of a view sees so deep.
pub(crate) fn on_ray(view: &View, pixel: Pixel, depth: f64) -> DVec3 {
    let ray = view.lens.unproject(pixel).filter(|ray| ray.z > 1e-6);
    let ray = ray.map_or(DVec3::Z, |ray| ray / ray.z);
    view.camera_from_world.inverse() * (ray * depth)
}

#[cfg(test)]
mod tests {
    use super::*;
    use calibrate::{Lens, Rigid3};

    fn view() -> View {
        View {
            lens: Lens::pinhole(DVec2::splat(100.0), DVec2::new(50.0, 40.0)),
            width: 100,
            height: 80,
            camera_from_world: Rigid3::looking_at(DVec3::ONE, DVec3::new(1.0, 1.0, 9.0), DVec3::Y),
        }
    }

    #[test]
    fn a_point_is_where_its_depth_says_or_as_deep_as_its_neighbours() {
        let view = view();
        let half = DepthGrid::new(100, 80, |p| (p.x < 50.0).then_some(0.25));
        for (x, depth) in [(10.0, 4.0), (55.0, 4.0), (99.0, 7.0)] {
            let pixel = Pixel::new(x, 30.0);
            let point = half.point(&view, pixel, 7.0);
            assert!(((view.camera_from_world * point).z - depth).abs() < 1e-9);
            assert!(view.project(point).unwrap().distance(pixel) < 1e-9);
        }
        assert_eq!(DepthGrid::default().at(&view, Pixel::new(1.0, 1.0)), None);
    }

    #[test]
    fn support_fades() {
        let share = |covered, difference| {
            Support {
                covered,
                difference,
            }
            .share()
        };
        assert_eq!(share(1.0, 0.0), 1.0);
        assert_eq!((share(0.0, 0.0), share(1.0, 2.0)), (0.0, 0.0));
        assert!((0.3..0.7).contains(&share(1.0, 0.7)));
    }
}
