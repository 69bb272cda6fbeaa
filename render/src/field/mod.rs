//! The triangulated blending field: Buehler et al. 2001, §4.2.
//!
//! The field is evaluated at the vertices of a triangulation of the image plane (a regular
//! grid, the epipoles, the projected edges of the proxy) and interpolated.
//!
//! Where every source view that can count either sees all of a triangle or nothing of it, the corners'
//! weights are interpolated, as in the paper. Where the border of a photo, or of what its
//! mask ignores, crosses the triangle, weights change faster than any grid can follow: fovBlend rises within a few
//! pixels, and the threshold t of all the others moves with it. There the *differences*
//! are interpolated, which are smooth, and each pixel blends by its own fovBlend and masks.
//! So they are where the desired lens ends, beyond which corners have the differences of what it sees nearby.
//! (Interpolating feathered weights instead cost 15 to 20 dB against the exact picture;
//! interpolating weights and feathering each pixel still cost 5 to 20 dB near borders.)

mod constraints;
mod known;
mod list;
mod overlooked;
mod patch;
mod triangle;
mod vertex;

use crate::blend::{Candidate, Contributor, blend};
use crate::frame::{Frame, ProxyPoint};
use crate::held::Held;
use crate::photos::PhotoError;
use crate::reference::{self, candidate};
use crate::rows::{Contributions, FieldRows};
use crate::surface::Surface;
use crate::triangulation::{self, Constraints, Grid, TriangulationError};
use constraints::{epipole_vertices, horizon};
use glam::{DVec2, DVec3};
use image::RgbaImage;
use list::List;
use rayon::prelude::*;
use vertex::{Vertex, ray_within};

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
    /// Index of its first entry; they are in order of the source views.
    pub first_entry: u32,
    /// How many entries it has; at most [`MAX_LISTED`].
    pub entry_count: u32,
    /// Whether the border of a photo or of a mask crosses it, or it reaches beyond the desired lens: its entries
    /// are differences, and each pixel blends by its own fovBlend and masks. Otherwise they are weights.
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

/// Vertices that are evaluated one after the other.
const RUN: usize = 32;

impl TriangulatedField {
    /// Evaluates the field of a frame on a grid of `cells_across` cells.
    ///
    /// # Errors
    /// The triangulation refuses its input; the message says why.
    pub fn new(frame: &Frame<'_>, cells_across: u32) -> Result<Self, TriangulationError> {
        let (width, height) = (frame.desired.width, frame.desired.height);
        let grid = Grid::for_image(width, height, cells_across);

        // 1. What the triangulation must respect.
        frame.view_tree();
        let epipoles = epipole_vertices(frame, grid);
        let points: Vec<DVec2> = epipoles.iter().map(|(_, at)| *at).collect();
        let edges = horizon(frame);
        let constraints = Constraints {
            points: &points,
            edges: &edges,
        };
        let plane = triangulation::triangulate(width, height, grid, &constraints)?;

        // 2. The triangles through which the proxy is seen.
        let seen = |corners: &[u32; 3]| {
            let [a, b, c] = corners.map(|i| plane.vertices[i as usize]);
            match &frame.surface {
                Surface::Nothing => false,
                Surface::Plane(q) => shows_plane(frame, *q, [a, b, c]),
                // Any pixel may have it, as long as edges of the proxy are not.
                Surface::Facets(map) => map.any_within(a.min(b).min(c), a.max(b).max(c)),
            }
        };
        let visible: Vec<[u32; 3]> = plane.triangles.into_par_iter().filter(seen).collect();
        let mut is_used = vec![false; plane.vertices.len()];
        for &corner in visible.iter().flatten() {
            is_used[corner as usize] = true;
        }

        // 3. The field at their vertices. A plane looks the same from both sides of an edge,
        // so a vertex needs one value.
        let cell = DVec2::new(
            f64::from(width) / f64::from(grid.columns),
            f64::from(height) / f64::from(grid.rows),
        );
        // Of the grid's corners each takes the one before's guess, in runs that do not depend on the
        // threads: lists are made of what was found, and what was asked for decides that, too.
        let of_run = |(run, is_used): (&[DVec2], &[bool])| {
            let mut guess = frame.first_guess();
            let of_vertex = |(at, is_used): (&DVec2, &bool)| match is_used {
                true => {
                    let vertex = Vertex::new(frame, *at, cell, guess);
                    guess = vertex.near.guess().unwrap_or(guess);
                    vertex
                }
                false => Vertex::unused(*at),
            };
            run.iter().zip(is_used).map(of_vertex).collect::<Vec<_>>()
        };
        let [columns, rows] = [grid.columns, grid.rows].map(|cells| cells as usize);
        let corners = (columns + 1) * (rows + 1);
        let (of_grid, others) = plane.vertices.split_at(corners);
        let runs = of_grid.par_chunks(RUN).zip(is_used.par_chunks(RUN));
        let of_grid: Vec<Vertex> = runs.flat_map_iter(of_run).collect();
        // All others take that of the corner nearest to them.
        let of_other = |(at, is_used): (&DVec2, &bool)| match is_used {
            true => {
                let nearest = (*at / cell).round();
                let column = (nearest.x as usize).min(columns);
                let row = (nearest.y as usize).min(rows);
                let known = of_grid[row * (columns + 1) + column].near.guess();
                Vertex::new(
                    frame,
                    *at,
                    cell,
                    known.unwrap_or_else(|| frame.first_guess()),
                )
            }
            false => Vertex::unused(*at),
        };
        let others = others.par_iter().zip(&is_used[corners..]).map(of_other);
        let others: Vec<Vertex> = others.collect();
        let vertices: Vec<Vertex> = of_grid.into_iter().chain(others).collect();

        // 4. What each triangle needs.
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

    /// The source views that any triangle lists, in order: no other photo is sampled.
    pub fn listed(&self) -> Vec<usize> {
        let mut listed: Vec<usize> = self.entries.iter().map(|e| e.source_idx as usize).collect();
        listed.sort_unstable();
        listed.dedup();
        listed
    }

    /// The source views of a triangle.
    pub fn entries_of(&self, triangle_idx: usize) -> &[FieldEntry] {
        let triangle = &self.triangles[triangle_idx];
        &self.entries[triangle.first_entry as usize..][..triangle.entry_count as usize]
    }

    /// The interpolated field at every pixel, row by row: for each, who paints it.
    pub fn contributors(&self, frame: &Frame<'_>) -> Contributions {
        FieldRows::new(frame, Some(self)).all()
    }

    /// The field at a proxy point seen through a triangle, with the corners' shares of it.
    pub(crate) fn interpolate(
        &self,
        frame: &Frame<'_>,
        triangle_idx: usize,
        shares: [f64; 3],
        point: &ProxyPoint,
    ) -> Vec<Contributor> {
        let value = |entry: &FieldEntry| -> f64 {
            (0..3).map(|c| shares[c] * f64::from(entry.values[c])).sum()
        };
        let entries = self.entries_of(triangle_idx).iter();
        if self.triangles[triangle_idx].bordered {
            let candidates: Vec<Candidate> = entries
                .filter_map(|entry| {
                    let source_idx = entry.source_idx as usize;
                    let pixel = frame.project(source_idx, point)?;
                    candidate(frame, source_idx, point, pixel, || value(entry))
                })
                .collect();
            return blend(&candidates, &frame.options);
        }
        let mut contributors: Vec<Contributor> = entries
            .filter_map(|entry| {
                let source_idx = entry.source_idx as usize;
                let pixel = frame.project(source_idx, point)?;
                let weight = value(entry) * frame.fov_blend(source_idx, pixel);
                (weight > 0.0).then_some(Contributor { source_idx, weight })
            })
            .collect();
        let sum: f64 = contributors.iter().map(|c| c.weight).sum();
        contributors.iter_mut().for_each(|c| c.weight /= sum);
        contributors
    }
}

/// Whether the plane q is seen through a triangle with these corners: its horizon is an edge of the
/// triangulation, but where the desired lens ends is none.
fn shows_plane(frame: &Frame<'_>, q: DVec3, corners: [DVec2; 3]) -> bool {
    let [a, b, c] = corners;
    let centroid = (a + b + c) / 3.0;
    if let Some(ray) = ray_within(frame, centroid, 0.0) {
        return q.dot(ray) >= 0.0;
    }
    let far = corners.map(|corner| corner.distance(centroid));
    let reach = far.into_iter().fold(0.0, f64::max);
    let ray = |at: DVec2| ray_within(frame, at, reach);
    let shows = |at: DVec2| ray(at).is_some_and(|ray| q.dot(ray) >= 0.0);
    ray(centroid).is_some() && [centroid, a, b, c].into_iter().any(shows)
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
    let photos = Held::new(frame, &field.listed());
    reference::render(frame, &photos, |(x, y), _| {
        contributors.list(y as usize * width + x as usize).to_vec()
    })
}
