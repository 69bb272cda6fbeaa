//! Drawing a scene for the window, as `render` would, and what is to be seen of why.

use crate::compose::{depth_picture, nearest_stop, over_background, photo_picture, shaded_picture};
use crate::content::Space;
use crate::memory::Memories;
use crate::overlay::mesh_of;
use crate::picture::{DepthGrid, Hover, Layer, Lines, Look, Request, Shown, Support};
use calibrate::{Pixel, View};
use egui::ColorImage;
use glam::{DVec2, DVec3};
use image::RgbaImage;
use proxy::Proxy;
use rayon::prelude::*;
use render::{
    EDGE_SAMPLES, Engine, FieldOptions, FieldRows, Frame, Lumigraph, Method, Moment, Part,
    Prepared, RenderError, Skips, TriangulatedField, picture,
};
use std::cell::OnceCell;
use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Instant;

/// The stage in which outlines are drawn anew, and what nobody knows softly, where nothing moves.
pub(crate) const FINISH: &str = "finish";
/// More triangles than this are thinned out before their edges are shown.
const MOST_EDGED: usize = 6000;
/// More points than this are.
const MOST_POINTS: usize = 4000;
/// Places across and down at which support is asked for.
const ASKED: (u32, u32) = (8, 6);

/// Draws a lumigraph, and keeps what the next picture may need again.
pub(crate) struct SceneDrawer<'a> {
    lumigraph: &'a Lumigraph,
    space: &'a Space,
    skips: Skips,
    ready: Option<Ready<'a>>,
    palette: Vec<[u8; 3]>,
    /// A photo that cannot be decoded.
    gone: Vec<usize>,
    /// The share of the last picture that photos cover.
    covered: f64,
}

struct Ready<'a> {
    view: View,
    options: FieldOptions,
    method: Method,
    moment: Option<Moment>,
    frame: Frame<'a>,
    prepared: Prepared,
    /// The share of the picture that photos cover, once it was drawn.
    covered: OnceCell<f64>,
    /// The picture with its outlines drawn anew, once it was, and what want of memory did to it.
    smooth: OnceCell<(RgbaImage, String)>,
}

/// A picture as files have it, and as it is shown.
pub(crate) type Drawn = (RgbaImage, Shown);

impl<'a> SceneDrawer<'a> {
    /// Nothing is drawn yet.
    pub(crate) fn new(lumigraph: &'a Lumigraph, space: &'a Space, skips: Skips) -> Self {
        Self {
            lumigraph,
            space,
            skips,
            ready: None,
            palette: Vec::new(),
            gone: Vec::new(),
            covered: 1.0,
        }
    }

    /// The photos that are left out, as they cannot be decoded.
    pub(crate) fn gone(&self) -> &[usize] {
        &self.gone
    }

    /// The photo itself, half as large, for a view from its own camera: there before anything else
    /// is decoded. `None` for views from elsewhere.
    pub(crate) fn preview(&self, request: &Request) -> Option<Shown> {
        let asked = &request.view;
        let stops = &self.space.stops;
        let nearest = nearest_stop(stops, asked, self.space.depth)?;
        let source = &stops[nearest].view;
        if source.center().distance(asked.center()) > 1e-6 * self.space.depth {
            return None;
        }
        let view = asked.resized(asked.width.div_ceil(2), asked.height.div_ceil(2));
        let mut stages = Vec::new();
        let image = timed(&mut stages, "photo", || {
            let photo = self.lumigraph.photos.get(nearest).ok()?;
            Some(photo_picture(&photo, source, &view, &request.look))
        });
        Some(Shown {
            id: request.id,
            view: asked.clone(),
            reduction: 2,
            image: Arc::new(image?),
            photo: None,
            lines: Lines::default(),
            mesh: Arc::default(),
            depths: DepthGrid::default(),
            support: None,
            hover: None,
            cell: None,
            stages,
            skipped: "all but the first photo".to_owned(),
            device: "CPU".to_owned(),
            revision: 0,
        })
    }

    /// Draws what is asked for, `reduction` times smaller. A photo that cannot be decoded is left
    /// out from then on.
    ///
    /// # Errors
    /// No photo is left; a plane that cannot be triangulated.
    pub(crate) fn draw(
        &mut self,
        engine: &mut Engine,
        request: &Request,
        reduction: u32,
    ) -> Result<Drawn, RenderError> {
        loop {
            match self.try_draw(engine, request, reduction) {
                Err(RenderError::Photo(error)) if self.may_leave_out(error.source_idx) => {
                    self.gone.push(error.source_idx);
                    // All that the picture asked for in vain go at once.
                    for missed in self.lumigraph.photos.take_missed() {
                        if self.may_leave_out(missed.source_idx) {
                            self.gone.push(missed.source_idx);
                        }
                    }
                    self.ready = None;
                }
                drawn => return drawn,
            }
        }
    }

    /// Whether that is news, and any photo is left.
    fn may_leave_out(&self, source_idx: usize) -> bool {
        let is_last = self.gone.len() + 1 >= self.lumigraph.sources.len();
        !is_last && !self.gone.contains(&source_idx)
    }

    fn try_draw(
        &mut self,
        engine: &mut Engine,
        request: &Request,
        reduction: u32,
    ) -> Result<Drawn, RenderError> {
        let look = &request.look;
        let mut stages = Vec::new();
        let asked = &request.view;
        let view = match reduction {
            1 => asked.clone(),
            _ => asked.resized(
                asked.width.div_ceil(reduction),
                asked.height.div_ceil(reduction),
            ),
        };
        // 1. The surface and the field, if they are others than before.
        let is_same = |r: &Ready<'_>| {
            r.view == view
                && r.options == look.options
                && r.method == look.method
                && r.moment == look.moment
        };
        if !self.ready.as_ref().is_some_and(is_same) {
            self.ready = None;
            let frame = timed(&mut stages, "surface", || {
                let part = Part {
                    without: &self.gone,
                    moment: look.moment,
                };
                let frame = Frame::with(self.lumigraph, view.clone(), look.options, &part);
                frame.skipping(self.skips)
            });
            let prepared = timed(&mut stages, "field", || Prepared::new(&frame, look.method))?;
            self.ready = Some(Ready {
                view,
                options: look.options,
                method: look.method,
                moment: look.moment,
                frame,
                prepared,
                covered: OnceCell::new(),
                smooth: OnceCell::new(),
            });
        }
        let Some(Ready {
            frame,
            prepared,
            covered,
            smooth,
            ..
        }) = &self.ready
        else {
            unreachable!("made above");
        };
        let (width, height) = (frame.desired.width, frame.desired.height);
        let memories = Memories::now(&self.lumigraph.photos, engine);
        // 2. The layer.
        let mut known = None;
        let picture = match look.layer {
            Layer::Picture | Layer::Coverage => {
                // As files have it, where one looks long enough to see stairs.
                let kept = smooth.get().filter(|_| !request.is_moving);
                if let Some((picture, coarse)) = kept {
                    known = Some(coarse.clone());
                    picture.clone()
                } else {
                    let draw = || engine.draw(frame, prepared);
                    let mut picture = timed(&mut stages, "draw", draw)?;
                    covered.get_or_init(|| covered_share(&picture));
                    if !request.is_moving {
                        let finish = || {
                            engine.smooth(frame, prepared, EDGE_SAMPLES, &mut picture)?;
                            engine.soften(frame, prepared, &mut picture)
                        };
                        timed(&mut stages, FINISH, finish)?;
                        let coarse =
                            Memories::now(&self.lumigraph.photos, engine).told_since(memories);
                        smooth.get_or_init(|| (picture.clone(), coarse));
                    }
                    picture
                }
            }
            Layer::Field => timed(&mut stages, "field picture", || {
                if self.palette.is_empty() {
                    self.palette = picture::palette(self.lumigraph.sources.len());
                }
                let field = FieldRows::new(frame, prepared.field());
                picture::field_picture(&field, &self.palette)
            }),
            Layer::Depth => timed(&mut stages, "depth", || {
                let inverse =
                    every_pixel(width, height, |p| inverse_depth(frame, p).unwrap_or(0.0));
                depth_picture(width, height, &inverse)
            }),
            Layer::Shaded => timed(&mut stages, "proxy", || {
                let facing = every_pixel(width, height, |p| facing(frame, p));
                shaded_picture(width, height, &facing)
            }),
        };
        // Photos cover as much of a view whatever is shown of it: the proxy is there where no photo sees it, too. While one
        // moves that is not worth a picture which nobody sees.
        if covered.get().is_none() && !request.is_moving {
            let drawn = timed(&mut stages, "draw", || engine.draw(frame, prepared))?;
            covered.get_or_init(|| covered_share(&drawn));
        }
        self.covered = covered.get().copied().unwrap_or(self.covered);
        // 3. What goes with it.
        let mut lines = Lines::default();
        let scale = f64::from(asked.width) / f64::from(width);
        let mesh = timed(&mut stages, "overlays", || {
            if let Some(field) = prepared.field() {
                if look.triangulation {
                    lines.triangulation = edges_of_field(field, scale);
                }
                let epipoles = field.epipoles.iter();
                lines.epipoles = epipoles.map(|(i, p)| (*i, *p * scale)).collect();
            }
            if look.wireframe {
                lines.wireframe = edges_of_proxy(self.lumigraph, asked, self.space.depth);
            }
            mesh_of(&lines, asked)
        });
        let photo = look
            .photo
            .then(|| timed(&mut stages, "photo", || self.photo(frame, look)));
        let (depths, support) = timed(&mut stages, "support", || {
            let depths = DepthGrid::new(width, height, |p| inverse_depth(frame, p));
            (depths, support(frame, self.covered))
        });
        let hover = request.hover.map(|pixel| hover(frame, asked, pixel));
        let image = timed(&mut stages, "compose", || over_background(&picture, look));
        let store = &self.lumigraph.photos;
        let coarse = known.unwrap_or_else(|| Memories::now(store, engine).told_since(memories));
        let scored = frame.scored();
        let shown = Shown {
            id: request.id,
            view: asked.clone(),
            reduction,
            image: Arc::new(image),
            photo: photo.flatten().map(|(i, photo)| (i, Arc::new(photo))),
            lines,
            mesh: Arc::new(mesh),
            depths,
            support: Some(support),
            hover,
            cell: None,
            stages,
            skipped: format!(
                "{} of {} photos never decoded, {} never asked{coarse}",
                store.len() - store.decoded(),
                store.len(),
                scored.ever.iter().filter(|was| !**was).count()
            ),
            device: engine.description(),
            revision: 0,
        };
        Ok((picture, shown))
    }

    fn photo(&self, frame: &Frame<'_>, look: &Look) -> Option<(usize, ColorImage)> {
        let nearest = nearest_stop(&self.space.stops, &frame.desired, self.space.depth)?;
        let photo = self.lumigraph.photos.get(nearest).ok()?;
        let source = &self.lumigraph.sources[nearest].view;
        let picture = photo_picture(&photo, source, &frame.desired, look);
        Some((nearest, picture))
    }
}

/// Runs a stage and notes its time.
pub(crate) fn timed<T>(
    stages: &mut Vec<(&'static str, f64)>,
    name: &'static str,
    run: impl FnOnce() -> T,
) -> T {
    let start = Instant::now();
    let result = run();
    stages.push((name, 1e3 * start.elapsed().as_secs_f64()));
    result
}

fn every_pixel<T: Send>(width: u32, height: u32, at: impl Fn(Pixel) -> T + Sync) -> Vec<T> {
    let pixel =
        |i: usize| Pixel::center_of((i % width as usize) as u32, (i / width as usize) as u32);
    let all = (0..width as usize * height as usize)
        .into_par_iter()
        .with_min_len(1024);
    all.map(|i| at(pixel(i))).collect()
}

/// 1 / z of what a pixel sees of the proxy.
fn inverse_depth(frame: &Frame<'_>, pixel: Pixel) -> Option<f64> {
    let point = frame.proxy_point(pixel)?;
    // p = ray / s, so z = ray.z / s.
    Some(point.inverse_distance / point.ray.z).filter(|s| s.is_finite())
}

/// The cosine of the angle at which a pixel sees the proxy.
fn facing(frame: &Frame<'_>, pixel: Pixel) -> Option<f64> {
    let point = frame.proxy_point(pixel)?;
    let cosine = point
        .ray
        .normalize_or_zero()
        .dot(point.plane.normalize_or_zero());
    Some(cosine).filter(|c| c.is_finite())
}

/// The share of a picture's pixels that are covered by half or more.
fn covered_share(picture: &RgbaImage) -> f64 {
    let covered = picture.pixels().filter(|p| p.0[3] >= 128).count();
    covered as f64 / f64::from(picture.width() * picture.height()).max(1.0)
}

fn support(frame: &Frame<'_>, covered: f64) -> Support {
    let (width, height) = (frame.desired.width, frame.desired.height);
    let (across, down) = ASKED;
    let difference = |i: u32| {
        let place =
            |i: u32, of: u32, side: u32| (f64::from(i) + 0.5) / f64::from(of) * f64::from(side);
        let pixel = Pixel::new(
            place(i % across, across, width),
            place(i / across, down, height),
        );
        let point = frame.proxy_point(pixel)?;
        let contributors = frame.blend_at(&point);
        let differences = contributors
            .iter()
            .map(|c| frame.difference(c.source_idx, &point));
        let least = differences.fold(f64::INFINITY, f64::min);
        Some(least.min(std::f64::consts::PI))
    };
    let mut differences: Vec<f64> = (0..across * down).filter_map(difference).collect();
    differences.sort_by(f64::total_cmp);
    let median = differences.get(differences.len() / 2).copied();
    Support {
        covered,
        difference: median.unwrap_or(std::f64::consts::PI),
    }
}

/// `pixel` is one of `asked`, which the frame may be a smaller one of.
fn hover(frame: &Frame<'_>, asked: &View, pixel: Pixel) -> Hover {
    let scale = f64::from(frame.desired.width) / f64::from(asked.width);
    let point = frame.proxy_point(Pixel::new(pixel.x * scale, pixel.y * scale));
    let in_world = point.as_ref().and_then(|p| {
        let point_in_camera = p.ray / p.inverse_distance;
        let point = frame.desired.camera_from_world.inverse() * point_in_camera;
        point.is_finite().then_some(point)
    });
    let contributors = point
        .map(|point| frame.blend_at(&point))
        .unwrap_or_default();
    let mut weights: Vec<(usize, f64)> = contributors
        .iter()
        .map(|c| (c.source_idx, c.weight))
        .collect();
    weights.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    Hover {
        pixel,
        point_in_world: in_world,
        weights,
    }
}

fn edges_of_field(field: &TriangulatedField, scale: f64) -> Vec<[DVec2; 2]> {
    let mut edges = BTreeSet::new();
    for triangle in &field.triangles {
        let [a, b, c] = triangle.corners;
        for (a, b) in [(a, b), (b, c), (c, a)] {
            edges.insert((a.min(b), a.max(b)));
        }
    }
    let place = |i: u32| field.vertices[i as usize] * scale;
    edges
        .into_iter()
        .map(|(a, b)| [place(a), place(b)])
        .collect()
}

/// The proxy's edges as a view sees them, hidden ones too: of a mesh its triangles' (thinned out
/// where there are many), of a plane lines, of points small crosses.
fn edges_of_proxy(lumigraph: &Lumigraph, view: &View, depth: f64) -> Vec<[DVec2; 2]> {
    let project = |p: DVec3| {
        let in_camera = view.camera_from_world * p;
        let pixel = (in_camera.z > 1e-3 * depth)
            .then(|| view.project(p))
            .flatten()?;
        Some(DVec2::new(pixel.x, pixel.y))
    };
    let line = |a: DVec3, b: DVec3| Some([project(a)?, project(b)?]);
    match &lumigraph.proxy {
        Proxy::Mesh(solid) => {
            let mesh = solid.mesh();
            let step = mesh.triangles.len().div_ceil(MOST_EDGED).max(1);
            let of = |i: usize| {
                let [a, b, c] = mesh.corners(i);
                [line(a, b), line(b, c), line(c, a)]
            };
            let triangles = (0..mesh.triangles.len()).step_by(step);
            triangles.flat_map(of).flatten().collect()
        }
        Proxy::Plane(plane) => {
            let middle = plane.intersect(view.center(), view.forward());
            let middle = middle.unwrap_or(plane.point());
            let x = plane.normal().any_orthonormal_vector();
            let y = plane.normal().cross(x);
            let place = |u: f64, v: f64| middle + 0.2 * depth * (u * x + v * y);
            let lines = (-10..=10).flat_map(|i| {
                let i = f64::from(i);
                // In pieces, so that what is behind the viewer takes little with it.
                (-10..10).flat_map(move |k| {
                    let (from, to) = (f64::from(k), f64::from(k + 1));
                    [(i, from, i, to), (from, i, to, i)]
                })
            });
            let lines = lines.filter_map(|(a, b, c, d)| line(place(a, b), place(c, d)));
            lines.collect()
        }
        Proxy::Points { .. } | Proxy::Dense(_) | Proxy::ViewPlane => {
            let step = lumigraph.points.len().div_ceil(MOST_POINTS).max(1);
            let seen = lumigraph.points.iter().step_by(step);
            let seen = seen.filter_map(|p| project(p.position));
            let cross = |p: DVec2| {
                let arm = DVec2::new(2.0, 0.0);
                [[p - arm, p + arm], [p - arm.perp(), p + arm.perp()]]
            };
            seen.flat_map(cross).collect()
        }
    }
}
