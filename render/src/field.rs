//! The triangulated blending field: Buehler et al. 2001, §4.2.
//!
//! The field is evaluated at the vertices of a triangulation of the image plane (a regular
//! grid, the epipoles, the projected edges of the proxy) and interpolated.
//!
//! Where every source view either sees all of a triangle or nothing of it, the corners'
//! weights are interpolated, as in the paper. Where the border of a photo crosses the
//! triangle, weights change faster than any grid can follow: fovBlend rises within a few
//! pixels, and the threshold t of all the others moves with it. There the *differences*
//! are interpolated, which are smooth, and each pixel blends by its own fovBlend.
//! (Interpolating feathered weights instead cost 15 to 20 dB against the exact picture;
//! interpolating weights and feathering each pixel still cost 5 to 20 dB near borders.)

use crate::blend::{Candidate, Contributor, blend};
use crate::frame::{Frame, ProxyPoint};
use crate::photos::PhotoError;
use crate::raster::{Raster, triangle_map};
use crate::reference;
use crate::triangulation::{self, Constraints, Grid, TriangulationError};
use calibrate::{Lens, Pixel};
use glam::{DVec2, DVec3};
use image::RgbaImage;
use rayon::prelude::*;

/// The field over the triangles of the image plane that show the proxy.
#[derive(Clone, Debug, PartialEq)]
pub struct TriangulatedField {
    /// In pixels of the desired image.
    pub vertices: Vec<DVec2>,
    /// The triangles through which the proxy is seen.
    pub triangles: Vec<FieldTriangle>,
    /// The triangles' lists of source views, one after the other.
    pub entries: Vec<FieldEntry>,
    /// The epipoles that became vertices, by source view.
    pub epipoles: Vec<(usize, DVec2)>,
}

/// One triangle and its part of [`TriangulatedField::entries`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FieldTriangle {
    /// Indices of vertices.
    pub corners: [u32; 3],
    /// Index of its first entry.
    pub first_entry: u32,
    /// How many entries it has; at most [`MAX_LISTED`].
    pub entry_count: u32,
    /// Whether the border of a photo crosses it: its entries are differences, and each
    /// pixel blends by its own fovBlend. Otherwise they are weights.
    pub bordered: bool,
}

/// A source view's value at the three corners of a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldEntry {
    /// Which source view.
    pub source_idx: u32,
    /// By corner: its weight, or in a bordered triangle angDiff + β·resDiff.
    pub values: [f32; 3],
}

/// Source views that a triangle lists, at most: those of least difference.
pub const MAX_LISTED: usize = 32;
/// Epipoles that become vertices in one cell of the grid, at most.
const EPIPOLES_PER_CELL: usize = 4;
/// Pixels by which a triangle must clear a border to be on one side of it. Edges that are
/// straight in the desired image are not quite so in a photo.
const CLEARANCE_PX: f64 = 2.0;

impl TriangulatedField {
    /// Evaluates the field of a frame on a grid of `cells_across` cells.
    ///
    /// # Errors
    /// The triangulation refuses its input; the message says why.
    pub fn new(frame: &Frame<'_>, cells_across: u32) -> Result<Self, TriangulationError> {
        let (width, height) = (frame.desired.width, frame.desired.height);
        let grid = Grid::for_image(width, height, cells_across);

        // 1. What the triangulation must respect.
        let epipoles = epipole_vertices(frame, grid);
        let points: Vec<DVec2> = epipoles.iter().map(|(_, at)| *at).collect();
        let edges = horizon(frame);
        let constraints = Constraints {
            points: &points,
            edges: &edges,
        };
        let plane = triangulation::triangulate(width, height, grid, &constraints)?;

        // 2. The field at every vertex. A plane looks the same from both sides of an edge,
        // so a vertex needs one value.
        let vertices: Vec<Vertex> = plane
            .vertices
            .par_iter()
            .map(|at| Vertex::new(frame, *at))
            .collect();

        // 3. The triangles through which the proxy is seen, each with the views it needs.
        let seen = |corners: &[u32; 3]| {
            let sum: DVec2 = corners.iter().map(|&i| plane.vertices[i as usize]).sum();
            let centroid = sum / 3.0;
            frame
                .proxy_point(Pixel::new(centroid.x, centroid.y))
                .is_some()
        };
        let visible: Vec<[u32; 3]> = plane.triangles.into_iter().filter(seen).collect();
        let lists: Vec<List> = visible
            .par_iter()
            .map(|corners| List::of(frame, corners.map(|i| &vertices[i as usize])))
            .collect();
        let mut field = Self {
            vertices: plane.vertices,
            triangles: Vec::new(),
            entries: Vec::new(),
            epipoles,
        };
        for (corners, list) in visible.into_iter().zip(lists) {
            field.triangles.push(FieldTriangle {
                corners,
                first_entry: field.entries.len() as u32,
                entry_count: list.entries.len() as u32,
                bordered: list.bordered,
            });
            field.entries.extend(list.entries);
        }
        Ok(field)
    }

    /// The source views of a triangle.
    pub fn entries_of(&self, triangle_idx: usize) -> &[FieldEntry] {
        let triangle = &self.triangles[triangle_idx];
        &self.entries[triangle.first_entry as usize..][..triangle.entry_count as usize]
    }

    /// The interpolated field at every pixel, row by row: for each, who paints it.
    pub fn contributors(&self, frame: &Frame<'_>) -> Vec<Vec<Contributor>> {
        let (width, height) = (frame.desired.width as usize, frame.desired.height as usize);
        let raster = Raster::new(self);
        let map = triangle_map(&raster, width, height);
        let at_pixel = |i: usize| {
            let (x, y) = (i % width, i / width);
            let point = frame.proxy_point(Pixel::center_of(x as u32, y as u32));
            let Some(point) = point.filter(|_| map[i] != u32::MAX) else {
                return Vec::new();
            };
            let shares = raster.barycentric(map[i] as usize, x, y).map(f64::from);
            self.interpolate(frame, map[i] as usize, shares, &point)
        };
        (0..width * height).into_par_iter().map(at_pixel).collect()
    }

    /// The field at a proxy point seen through a triangle, with the corners' shares of it.
    fn interpolate(
        &self,
        frame: &Frame<'_>,
        triangle_idx: usize,
        shares: [f64; 3],
        point: &ProxyPoint,
    ) -> Vec<Contributor> {
        let value = |entry: &FieldEntry| -> f64 {
            (0..3).map(|c| shares[c] * f64::from(entry.values[c])).sum()
        };
        let fov = |source_idx| Some(frame.fov_blend(source_idx, frame.project(source_idx, point)?));
        let entries = self.entries_of(triangle_idx).iter();
        if self.triangles[triangle_idx].bordered {
            let candidates: Vec<Candidate> = entries
                .filter_map(|entry| {
                    let source_idx = entry.source_idx as usize;
                    let fov = fov(source_idx).filter(|fov| *fov >= 0.0)?;
                    Some(Candidate {
                        source_idx,
                        diff: value(entry),
                        fov,
                    })
                })
                .collect();
            return blend(&candidates, &frame.options);
        }
        let mut contributors: Vec<Contributor> = entries
            .filter_map(|entry| {
                let source_idx = entry.source_idx as usize;
                let weight = value(entry) * fov(source_idx)?;
                (weight > 0.0).then_some(Contributor { source_idx, weight })
            })
            .collect();
        let sum: f64 = contributors.iter().map(|c| c.weight).sum();
        contributors.iter_mut().for_each(|c| c.weight /= sum);
        contributors
    }
}

/// The picture of a triangulated field in plain f64: what [`crate::cpu`] and
/// [`crate::gpu`] draw fast.
///
/// # Errors
/// A photo that is needed cannot be decoded.
pub fn render_reference(
    frame: &Frame<'_>,
    field: &TriangulatedField,
) -> Result<RgbaImage, PhotoError> {
    let width = frame.desired.width as usize;
    let contributors = field.contributors(frame);
    reference::render(frame, |(x, y), _| {
        contributors[y as usize * width + x as usize].clone()
    })
}

/// The field at a vertex.
struct Vertex {
    /// In pixels of the desired image.
    at: DVec2,
    /// By source view; empty where the lens has no ray.
    sources: Vec<VertexSource>,
    /// The exact blend, by source view.
    weights: Vec<Contributor>,
}

struct VertexSource {
    diff: f64,
    /// Where the proxy point falls in the photo or outside it.
    pixel: Option<Pixel>,
}

impl Vertex {
    fn new(frame: &Frame<'_>, at: DVec2) -> Self {
        let sources = sources_at(frame, at);
        let candidates: Vec<Candidate> = sources
            .iter()
            .enumerate()
            .filter_map(|(source_idx, source)| {
                let fov = frame.fov_blend(source_idx, source.pixel?);
                (fov >= 0.0).then_some(Candidate {
                    source_idx,
                    diff: source.diff,
                    fov,
                })
            })
            .collect();
        Self {
            at,
            sources,
            weights: blend(&candidates, &frame.options),
        }
    }
}

/// What every source view makes of the proxy point at a position in the desired image;
/// empty where the lens has no ray.
fn sources_at(frame: &Frame<'_>, at: DVec2) -> Vec<VertexSource> {
    let Some(ray) = frame.desired.lens.unproject(Pixel::new(at.x, at.y)) else {
        return Vec::new();
    };
    // Snapping may have put a vertex of the horizon a little beyond it.
    let inverse_distance = frame.plane.map_or(0.0, |q| q.dot(ray)).max(0.0);
    let point = ProxyPoint {
        ray,
        inverse_distance,
    };
    (0..frame.sources.len())
        .map(|source_idx| VertexSource {
            diff: frame.difference(source_idx, &point),
            pixel: frame.project(source_idx, &point),
        })
        .collect()
}

/// The source views of one triangle.
struct List {
    entries: Vec<FieldEntry>,
    bordered: bool,
}

/// How a source view sees a triangle.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Sees {
    /// With fovBlend one all over.
    All,
    Nothing,
    Part,
}

impl List {
    fn of(frame: &Frame<'_>, corners: [&Vertex; 3]) -> Self {
        if corners.iter().any(|c| c.sources.is_empty()) {
            // The lens ends inside the triangle. With nothing known beyond, only what the
            // other corners say counts.
            return Self::of_weights(corners);
        }
        let sees: Vec<Sees> = (0..frame.sources.len())
            .map(|i| how_it_sees(frame, i, corners.map(|c| c.sources[i].pixel)))
            .collect();
        if !sees.contains(&Sees::Part) {
            return Self::of_weights(corners);
        }

        // Those that see all of it bound the threshold at each corner from above; a view
        // beyond that everywhere cannot contribute anywhere.
        let bound = |corner: &Vertex| {
            let all = (0..sees.len()).filter(|&i| sees[i] == Sees::All);
            let diffs = all.map(|i| corner.sources[i].diff).collect();
            frame.options.threshold_of_seen(diffs)
        };
        let bounds = corners.map(bound);
        let within = |&i: &usize| {
            sees[i] != Sees::Nothing && (0..3).any(|c| corners[c].sources[i].diff <= bounds[c])
        };
        let mut listed: Vec<(f64, usize)> = (0..sees.len())
            .filter(within)
            .map(|i| {
                (
                    corners
                        .iter()
                        .map(|c| c.sources[i].diff)
                        .fold(f64::MAX, f64::min),
                    i,
                )
            })
            .collect();
        if listed.len() > MAX_LISTED {
            // More borders than there is room for: the nearest of each part of the triangle
            // come first, then the second nearest. (The nearest of all alone left holes
            // beyond their borders.)
            let ranks = ranks_within(frame, corners);
            listed.sort_by(|x, y| {
                let by_rank = ranks[x.1].cmp(&ranks[y.1]);
                by_rank.then(x.0.total_cmp(&y.0)).then(x.1.cmp(&y.1))
            });
            listed.truncate(MAX_LISTED);
        }
        listed.sort_by_key(|(_, i)| *i);
        let entry = |(_, i): (f64, usize)| FieldEntry {
            source_idx: i as u32,
            values: corners.map(|c| c.sources[i].diff as f32),
        };
        Self {
            entries: listed.into_iter().map(entry).collect(),
            bordered: true,
        }
    }

    /// The union of the corners' contributors, with their weights.
    fn of_weights(corners: [&Vertex; 3]) -> Self {
        let mut listed: Vec<usize> = corners
            .iter()
            .flat_map(|c| c.weights.iter().map(|w| w.source_idx))
            .collect();
        listed.sort_unstable();
        listed.dedup();
        let weight = |corner: &Vertex, i: usize| {
            corner
                .weights
                .iter()
                .find(|w| w.source_idx == i)
                .map_or(0.0, |w| w.weight as f32)
        };
        let entry = |i: usize| FieldEntry {
            source_idx: i as u32,
            values: corners.map(|c| weight(c, i)),
        };
        let mut entries: Vec<FieldEntry> = listed.into_iter().map(entry).collect();
        if entries.len() > MAX_LISTED {
            let total = |e: &FieldEntry| e.values.iter().sum::<f32>();
            entries.sort_by(|x, y| total(y).total_cmp(&total(x)));
            entries.truncate(MAX_LISTED);
            entries.sort_by_key(|e| e.source_idx);
        }
        Self {
            entries,
            bordered: false,
        }
    }
}

/// For each source view the best rank, by difference, that it has among the views that see
/// a point, for points spread over a triangle.
fn ranks_within(frame: &Frame<'_>, corners: [&Vertex; 3]) -> Vec<usize> {
    // Steps between points, along each side.
    const STEPS: u32 = 4;
    let [a, b, c] = corners.map(|corner| corner.at);
    let step = |i: u32| f64::from(i) / f64::from(STEPS);
    let mut ranks = vec![usize::MAX; frame.sources.len()];
    for (i, j) in (0..=STEPS).flat_map(|i| (0..=STEPS - i).map(move |j| (i, j))) {
        let sources = sources_at(frame, a + step(i) * (b - a) + step(j) * (c - a));
        let seeing = sources.iter().enumerate().filter_map(|(i, source)| {
            let sees = frame.fov_blend(i, source.pixel?) >= 0.0;
            sees.then_some((source.diff, i))
        });
        let mut seeing: Vec<(f64, usize)> = seeing.collect();
        seeing.sort_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
        for (rank, (_, i)) in seeing.into_iter().enumerate() {
            ranks[i] = ranks[i].min(rank);
        }
    }
    ranks
}

fn how_it_sees(frame: &Frame<'_>, source_idx: usize, corners: [Option<Pixel>; 3]) -> Sees {
    let [Some(a), Some(b), Some(c)] = corners else {
        let none = corners.iter().all(Option::is_none);
        return if none { Sees::Nothing } else { Sees::Part };
    };
    let source = &frame.sources[source_idx];
    let [width, height] = source.size;
    let (left, right) = (a.x.min(b.x).min(c.x), a.x.max(b.x).max(c.x));
    let (top, bottom) = (a.y.min(b.y).min(c.y), a.y.max(b.y).max(c.y));
    let beyond = (-right).max(left - width).max(-bottom).max(top - height);
    let inside = left.min(width - right).min(top).min(height - bottom);
    if inside >= source.feather_px + CLEARANCE_PX {
        Sees::All
    } else if beyond > CLEARANCE_PX {
        Sees::Nothing
    } else {
        Sees::Part
    }
}

/// The epipoles worth a vertex: inside the image, their view among the first two of the
/// field there, the strongest few of each cell.
///
/// A view behind the desired one has its epipole where the line through both centres
/// meets the image: the difference of angles vanishes there as well.
fn epipole_vertices(frame: &Frame<'_>, grid: Grid) -> Vec<(usize, DVec2)> {
    let (width, height) = (
        f64::from(frame.desired.width),
        f64::from(frame.desired.height),
    );
    let candidate = |source_idx: usize| {
        let center = frame.sources[source_idx].center;
        let lens = &frame.desired.lens;
        let ahead = lens.project(center).or_else(|| lens.project(-center))?;
        let inside = (0.0..=width).contains(&ahead.x) && (0.0..=height).contains(&ahead.y);
        let point = inside.then(|| frame.proxy_point(ahead)).flatten()?;
        let field = reference::blend_at(frame, &point);
        let own = field.iter().find(|c| c.source_idx == source_idx)?.weight;
        let stronger = field.iter().filter(|c| c.weight > own).count();
        (stronger < 2).then_some((source_idx, own, DVec2::new(ahead.x, ahead.y)))
    };
    let mut candidates: Vec<(usize, f64, DVec2)> = (0..frame.sources.len())
        .into_par_iter()
        .filter_map(candidate)
        .collect();
    candidates.sort_by(|x, y| y.1.total_cmp(&x.1).then(x.0.cmp(&y.0)));
    let cells = DVec2::new(
        f64::from(grid.columns) / width,
        f64::from(grid.rows) / height,
    );
    let mut taken = std::collections::BTreeMap::new();
    candidates.retain(|(_, _, at)| {
        let cell = (*at * cells).floor();
        let count = taken.entry((cell.x as i64, cell.y as i64)).or_insert(0);
        *count += 1;
        *count <= EPIPOLES_PER_CELL
    });
    candidates
        .into_iter()
        .map(|(source_idx, _, at)| (source_idx, at))
        .collect()
}

/// The horizon of the plane in the desired image: where its inverse distance is zero.
fn horizon(frame: &Frame<'_>) -> Vec<[DVec2; 2]> {
    let Some(q) = frame.plane else {
        return Vec::new();
    };
    // The directions along the plane, by angle from the one that looks most forward.
    let normal = q.normalize();
    let forward = DVec3::Z - normal * normal.z;
    let Some(u) = forward.try_normalize() else {
        return Vec::new();
    };
    let v = normal.cross(u);
    let direction = |angle: f64| u * angle.cos() + v * angle.sin();
    let lens: &Lens = &frame.desired.lens;
    let project = |angle: f64| lens.project(direction(angle)).map(|p| DVec2::new(p.x, p.y));

    let near_image = |p: DVec2| {
        let size = DVec2::new(
            f64::from(frame.desired.width),
            f64::from(frame.desired.height),
        );
        p.cmpge(-size).all() && p.cmple(2.0 * size).all()
    };
    let mut edges = Vec::new();
    // Splits until straight within 1/16 px, where that matters.
    fn refine(
        from: (f64, DVec2),
        to: (f64, DVec2),
        depth: u32,
        project: &dyn Fn(f64) -> Option<DVec2>,
        near_image: &dyn Fn(DVec2) -> bool,
        edges: &mut Vec<[DVec2; 2]>,
    ) {
        let middle = 0.5 * (from.0 + to.0);
        if let Some(at) = project(middle) {
            let chord = to.1 - from.1;
            let off = chord.perp_dot(at - from.1).abs() / chord.length().max(1e-12);
            let relevant = near_image(from.1) || near_image(to.1) || near_image(at);
            if depth > 0 && off > 1.0 / 16.0 && relevant {
                refine(from, (middle, at), depth - 1, project, near_image, edges);
                refine((middle, at), to, depth - 1, project, near_image, edges);
                return;
            }
        }
        edges.push([from.1, to.1]);
    }
    const PIECES: i32 = 32;
    // Just short of ±π, and symmetric, so that a pinhole's ±π/2 is avoided.
    let angle_of = |i: i32| std::f64::consts::PI * (f64::from(i) + 0.5) / f64::from(PIECES);
    for i in -PIECES..PIECES {
        let (a, b) = (angle_of(i), angle_of(i + 1));
        if let (Some(from), Some(to)) = (project(a), project(b)) {
            refine((a, from), (b, to), 16, &project, &near_image, &mut edges);
        }
    }
    edges
}
