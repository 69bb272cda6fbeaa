//! What cells hold, in runs that are passed over where they are out of sight.
//!
//! A run is a leaf of a tree that halves space: small, so that little of it is in sight where all
//! of it is not.

use glam::DVec3;
use proxy::interior::{CellId, Contents, Region, Visibility};
use proxy::mesh::Model;
use rayon::prelude::*;

/// Triangles that are near one another, in the model's order, with the box and the ball around
/// them.
#[derive(Clone, Debug, PartialEq)]
struct Run {
    triangles: Vec<u32>,
    low: DVec3,
    high: DVec3,
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
    /// The least and the greatest coordinates of each list's corners.
    boxes: Vec<[DVec3; 2]>,
    /// How many triangles the cells have that were asked for, those passed over included.
    pub asked: usize,
}

/// Triangles in a run, at most.
const RUN: usize = 96;
/// More triangles than this are halved on two threads.
const ALONE: usize = 4096;
/// Rounding, in shares of the distance.
const SLACK: f64 = 1e-9;

impl CellGeometry {
    /// Prepares what the cells hold.
    pub fn new(model: &Model, contents: &Contents) -> Self {
        Self {
            cells: contents.triangles.iter().map(|l| runs(model, l)).collect(),
            elsewhere: runs(model, &contents.elsewhere),
        }
    }

    /// The same triangles as if there were no cells, each once.
    pub fn without_cells(model: &Model, contents: &Contents) -> Self {
        let lists = contents.triangles.iter().chain([&contents.elsewhere]);
        let mut all: Vec<u32> = lists.flatten().copied().collect();
        all.sort_unstable();
        all.dedup();
        Self {
            cells: Vec::new(),
            elsewhere: runs(model, &all),
        }
    }

    /// All triangles of some cells that lie where those are seen, from an eye, and those of no cell
    /// that lie in a region, which is the view.
    pub fn seen<'a>(&'a self, eye: DVec3, visibility: &Visibility, view: &Region) -> Runs<'a> {
        let mut found = Runs::default();
        found.add(&self.elsewhere, eye, std::slice::from_ref(view));
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
    fn add(&mut self, runs: &'a [Run], eye: DVec3, regions: &[Region]) {
        for run in runs {
            self.asked += run.triangles.len();
            let offset = run.center - eye;
            let reach = run.radius + SLACK * (offset.length() + run.radius);
            let touches = |cone: &Region| {
                let mut sides = cone.sides().iter();
                sides.all(|side| side.dot(offset) >= -reach)
            };
            if regions.iter().any(touches) {
                self.lists.push(&run.triangles);
                self.balls.push((run.center, run.radius));
                self.boxes.push([run.low, run.high]);
            }
        }
    }

    /// Each list with the ball around it.
    pub(crate) fn balls(&self) -> impl Iterator<Item = (&'a [u32], DVec3, f64)> + '_ {
        let lists = self.lists.iter().zip(&self.balls);
        lists.map(|(list, (center, radius))| (*list, *center, *radius))
    }

    /// Each list with the box around it.
    pub(super) fn boxes(&self) -> impl Iterator<Item = (&'a [u32], [DVec3; 2])> + '_ {
        let lists = self.lists.iter().zip(&self.boxes);
        lists.map(|(list, corners)| (*list, *corners))
    }

    /// How many triangles are to be drawn; one in several lists counts for each.
    pub fn count(&self) -> usize {
        self.lists.iter().map(|list| list.len()).sum()
    }
}

/// Triangles in runs.
fn runs(model: &Model, triangles: &[u32]) -> Vec<Run> {
    let middle = |i: &u32| {
        let [a, b, c] = model.mesh.corners(*i as usize);
        (a + b + c, *i)
    };
    let mut middles: Vec<(DVec3, u32)> = triangles.par_iter().map(middle).collect();
    halved(model, &mut middles)
}

/// Halves triangles across where their middles are farthest apart, until they are few.
fn halved(model: &Model, middles: &mut [(DVec3, u32)]) -> Vec<Run> {
    if middles.is_empty() {
        return Vec::new();
    }
    if middles.len() <= RUN {
        let mut triangles: Vec<u32> = middles.iter().map(|(_, i)| *i).collect();
        triangles.sort_unstable();
        return vec![run(model, triangles)];
    }
    let (low, high) = spanned(middles.iter().map(|(middle, _)| *middle));
    let wide = high - low;
    let axis = (0..3)
        .max_by(|a, b| wide[*a].total_cmp(&wide[*b]))
        .unwrap_or(0);
    let half = middles.len() / 2;
    middles.select_nth_unstable_by(half, |a, b| {
        a.0[axis].total_cmp(&b.0[axis]).then(a.1.cmp(&b.1))
    });
    let is_large = middles.len() > ALONE;
    let (a, b) = middles.split_at_mut(half);
    let (mut runs, more) = match is_large {
        true => rayon::join(|| halved(model, a), || halved(model, b)),
        false => (halved(model, a), halved(model, b)),
    };
    runs.extend(more);
    runs
}

fn spanned(points: impl Iterator<Item = DVec3>) -> (DVec3, DVec3) {
    points.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| {
        (l.min(p), h.max(p))
    })
}

fn run(model: &Model, triangles: Vec<u32>) -> Run {
    let corners = || {
        triangles
            .iter()
            .flat_map(|i| model.mesh.corners(*i as usize))
    };
    let (low, high) = spanned(corners());
    let center = low.midpoint(high);
    let radius = corners().map(|p| p.distance(center)).fold(0.0, f64::max);
    Run {
        low,
        high,
        center,
        radius,
        triangles,
    }
}
