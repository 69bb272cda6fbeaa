//! What cells hold, in runs that are passed over where they are out of sight.

use glam::DVec3;
use proxy::interior::{CellId, Contents, Region, Visibility};
use proxy::mesh::Model;
use rayon::prelude::*;

/// Triangles one after the other, with the ball around them.
#[derive(Clone, Debug, PartialEq)]
struct Run {
    triangles: Vec<u32>,
    center: DVec3,
    radius: f64,
}

/// The triangles of each cell.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CellGeometry {
    cells: Vec<Vec<Run>>,
    elsewhere: Vec<Run>,
}

/// Lists of triangles to draw.
#[derive(Clone, Debug, Default)]
pub struct Runs<'a> {
    /// A triangle may be in several.
    pub lists: Vec<&'a [u32]>,
    /// Around each list's triangles: centre and radius.
    balls: Vec<(DVec3, f64)>,
    /// How many triangles the cells have that were asked for, those passed over included.
    pub asked: usize,
}

/// Triangles in a run: those of a file lie near one another, being of one thing.
const RUN: usize = 96;
/// Rounding, in shares of the distance.
const SLACK: f64 = 1e-9;

impl CellGeometry {
    /// Prepares what the cells hold.
    pub fn new(model: &Model, contents: &Contents) -> Self {
        let runs = |list: &Vec<u32>| -> Vec<Run> {
            list.par_chunks(RUN).map(|part| run(model, part)).collect()
        };
        Self {
            cells: contents.triangles.iter().map(runs).collect(),
            elsewhere: runs(&contents.elsewhere),
        }
    }

    /// All triangles of some cells that lie where those are seen, and of no cell, from an eye.
    pub fn seen<'a>(&'a self, eye: DVec3, visibility: &Visibility) -> Runs<'a> {
        let mut found = Runs::default();
        found.add(&self.elsewhere, eye, &[]);
        for cell in &visibility.cells {
            found.add(self.cell(cell.cell), eye, &cell.regions);
        }
        found
    }

    fn cell(&self, id: CellId) -> &[Run] {
        self.cells.get(id.0 as usize).map_or(&[], Vec::as_slice)
    }
}

impl<'a> Runs<'a> {
    /// `regions`: none is everywhere.
    fn add(&mut self, runs: &'a [Run], eye: DVec3, regions: &[Region]) {
        for run in runs {
            self.asked += run.triangles.len();
            let offset = run.center - eye;
            let reach = run.radius + SLACK * (offset.length() + run.radius);
            let touches = |cone: &Region| {
                let mut sides = cone.sides().iter();
                sides.all(|side| side.dot(offset) >= -reach)
            };
            if regions.is_empty() || regions.iter().any(touches) {
                self.lists.push(&run.triangles);
                self.balls.push((run.center, run.radius));
            }
        }
    }

    /// Each list with the ball around it.
    pub(crate) fn balls(&self) -> impl Iterator<Item = (&'a [u32], DVec3, f64)> + '_ {
        let lists = self.lists.iter().zip(&self.balls);
        lists.map(|(list, (center, radius))| (*list, *center, *radius))
    }

    /// How many triangles are to be drawn; one in several lists counts for each.
    pub fn count(&self) -> usize {
        self.lists.iter().map(|list| list.len()).sum()
    }
}

fn run(model: &Model, triangles: &[u32]) -> Run {
    let corners = || {
        triangles
            .iter()
            .flat_map(|i| model.mesh.corners(*i as usize))
    };
    let (low, high) = corners().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| {
        (l.min(p), h.max(p))
    });
    let center = low.midpoint(high);
    let radius = corners().map(|p| p.distance(center)).fold(0.0, f64::max);
    Run {
        triangles: triangles.to_vec(),
        center,
        radius,
    }
}
