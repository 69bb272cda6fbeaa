//! The triangulated blending field: Buehler et al. 2001, §4.2.
//!
//! The field is evaluated at the vertices of a triangulation of the image plane (a regular
//! grid, the epipoles, the projected edges of the proxy) and interpolated.
//!
//! Unlike the paper's, vertices carry the blend *without* fovBlend, also for cameras whose
//! images end a little before the vertex; each pixel multiplies by its own fovBlend and
//! renormalises. The feather is narrower than a grid cell, and interpolating it cost 15 to
//! 20 dB.

use crate::blend::Contributor;
use crate::blend::{SAME_RAY, threshold};
use crate::frame::{Frame, ProxyPoint};
use crate::options::Blend;
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
    /// How many entries it has.
    pub entry_count: u32,
}

/// A source view's weight at the three corners of a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldEntry {
    /// Which source view.
    pub source_idx: u32,
    /// By corner, without fovBlend.
    pub weights: [f32; 3],
}

/// How far beyond its image's border a source view is still carried at a vertex, as a
/// fraction of the image's longer side: it may come into view before the next vertex.
const BEYOND_BORDER: f64 = 0.25;
/// Epipoles that become vertices in one cell of the grid, at most.
const EPIPOLES_PER_CELL: usize = 4;

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
        // so a vertex needs one value; beyond the horizon it is held at the horizon.
        let at_vertex = |vertex: &DVec2| {
            let Some(ray) = frame.desired.lens.unproject(Pixel::new(vertex.x, vertex.y)) else {
                return Vec::new();
            };
            let inverse_distance = frame.plane.map_or(0.0, |q| q.dot(ray)).max(0.0);
            vertex_weights(
                frame,
                &ProxyPoint {
                    ray,
                    inverse_distance,
                },
            )
        };
        let weights: Vec<Vec<(u32, f32)>> = plane.vertices.par_iter().map(at_vertex).collect();

        // 3. Each triangle carries the union of its corners' views.
        let mut field = Self {
            vertices: plane.vertices,
            triangles: Vec::new(),
            entries: Vec::new(),
            epipoles,
        };
        for corners in plane.triangles {
            let centroid = corners
                .iter()
                .map(|&i| field.vertices[i as usize])
                .sum::<DVec2>()
                / 3.0;
            if frame
                .proxy_point(Pixel::new(centroid.x, centroid.y))
                .is_none()
            {
                continue;
            }
            let first = field.entries.len();
            merge(
                corners.map(|i| weights[i as usize].as_slice()),
                &mut field.entries,
            );
            field.triangles.push(FieldTriangle {
                corners,
                first_entry: first as u32,
                entry_count: (field.entries.len() - first) as u32,
            });
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
            if map[i] == u32::MAX {
                return Vec::new();
            }
            let (triangle_idx, x, y) = (map[i] as usize, i % width, i / width);
            let Some(point) = frame.proxy_point(Pixel::center_of(x as u32, y as u32)) else {
                return Vec::new();
            };
            let shares = raster.barycentric(triangle_idx, x, y).map(f64::from);
            let weight = |entry: &FieldEntry| {
                let source_idx = entry.source_idx as usize;
                let fov = frame.fov_blend(source_idx, frame.project(source_idx, &point)?);
                let interpolated: f64 = (0..3)
                    .map(|c| shares[c] * f64::from(entry.weights[c]))
                    .sum();
                // On the very edge of its image a view counts where there is no other.
                let weight = interpolated * fov.max(1e-12);
                (fov >= 0.0 && weight > 0.0).then_some(Contributor { source_idx, weight })
            };
            let mut contributors: Vec<Contributor> = self
                .entries_of(triangle_idx)
                .iter()
                .filter_map(weight)
                .collect();
            let sum: f64 = contributors.iter().map(|c| c.weight).sum();
            contributors.iter_mut().for_each(|c| c.weight /= sum);
            contributors
        };
        (0..width * height).into_par_iter().map(at_pixel).collect()
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

/// The blend at a vertex, without fovBlend, by source view.
///
/// The threshold is that of the views whose images hold the point, with their fovBlend; a
/// view beyond its border gets the weight that it would have. So where no border is near,
/// a pixel at the vertex has the exact field.
fn vertex_weights(frame: &Frame<'_>, point: &ProxyPoint) -> Vec<(u32, f32)> {
    struct Near {
        source_idx: usize,
        diff: f64,
        a: f64,
    }
    let near = |source_idx: usize| {
        let [width, height] = frame.sources[source_idx].size;
        let pixel = frame.project(source_idx, point)?;
        let beyond = (-pixel.x)
            .max(pixel.x - width)
            .max(-pixel.y)
            .max(pixel.y - height);
        (beyond <= BEYOND_BORDER * width.max(height)).then(|| Near {
            source_idx,
            diff: frame.difference(source_idx, point),
            a: frame.fov_blend(source_idx, pixel).max(0.0),
        })
    };
    let near: Vec<Near> = (0..frame.sources.len()).filter_map(near).collect();

    // The threshold, from the views that see the point, or from all where none does.
    let sees = |n: &&Near| n.a > 0.0;
    let mut sorted: Vec<(f64, f64)> = near.iter().filter(sees).map(|n| (n.diff, n.a)).collect();
    if sorted.is_empty() {
        sorted = near.iter().map(|n| (n.diff, 1.0)).collect();
    }
    sorted.sort_by(|x, y| x.0.total_cmp(&y.0));
    let Some(&(smallest, _)) = sorted.first() else {
        return Vec::new();
    };
    let t = match frame.options.blend {
        Blend::Consistent => threshold(&sorted, frame.options.full_weight()),
        Blend::Paper => sorted[frame.options.k.min(sorted.len()) - 1].0,
    };

    // The weights, and where they all vanish (ties) equal ones for the nearest.
    let weight = |n: &Near| {
        let relevance = if t > 0.0 {
            (1.0 - n.diff / t).max(0.0)
        } else {
            0.0
        };
        match frame.options.blend {
            Blend::Consistent => relevance / n.diff.max(SAME_RAY),
            Blend::Paper => relevance,
        }
    };
    let mut weights: Vec<(u32, f64)> = near
        .iter()
        .map(|n| (n.source_idx as u32, weight(n)))
        .filter(|w| w.1 > 0.0)
        .collect();
    if weights.is_empty() {
        let tied = near.iter().filter(|n| n.diff <= smallest.max(SAME_RAY));
        weights = tied.map(|n| (n.source_idx as u32, 1.0)).collect();
    }
    let sum: f64 = weights.iter().map(|w| w.1).sum();
    weights
        .into_iter()
        .map(|(i, w)| (i, (w / sum) as f32))
        .collect()
}

/// Merges three lists sorted by source view into entries.
fn merge(corners: [&[(u32, f32)]; 3], entries: &mut Vec<FieldEntry>) {
    let mut next = [0; 3];
    loop {
        let head = |c: usize| corners[c].get(next[c]).map_or(u32::MAX, |w| w.0);
        let source_idx = head(0).min(head(1)).min(head(2));
        if source_idx == u32::MAX {
            return;
        }
        let mut weights = [0.0; 3];
        for c in 0..3 {
            if head(c) == source_idx {
                weights[c] = corners[c][next[c]].1;
            }
        }
        for c in 0..3 {
            if corners[c].get(next[c]).is_some_and(|w| w.0 == source_idx) {
                next[c] += 1;
            }
        }
        entries.push(FieldEntry {
            source_idx,
            weights,
        });
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
