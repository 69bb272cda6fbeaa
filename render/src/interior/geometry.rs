//! What cells hold, in runs that are passed over where they are out of sight.
//!
//! A run is a leaf of a tree that halves space: small, so that little of it is in sight where all
//! of it is not. It has its triangles' corners at hand, each once: wherever a model keeps them, they are
//! read one after the other.

use glam::DVec3;
use proxy::interior::{CellId, Contents, Region, Visibility};
use proxy::mesh::Model;
use rayon::prelude::*;

/// Triangles that are near one another, in the model's order, with the box and the ball around
/// them.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Run {
    /// At most [`RUN`].
    pub(super) triangles: Vec<u32>,
    /// Of each triangle, which of the run's points its corners are.
    pub(super) corners: Vec<[u16; 3]>,
    /// In the world, each once.
    pub(super) points: Vec<DVec3>,
    /// The points' least and greatest coordinates.
    pub(super) low: DVec3,
    pub(super) high: DVec3,
    center: DVec3,
    radius: f64,
}

/// The triangles of each cell.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CellGeometry {
    cells: Vec<Vec<Run>>,
    elsewhere: Vec<Run>,
}

/// Runs of triangles to draw.
#[derive(Clone, Debug, Default)]
pub struct Runs<'a> {
    /// A triangle may be in several.
    pub(super) runs: Vec<&'a Run>,
    /// How many triangles the cells have that were asked for, those passed over included.
    pub asked: usize,
}

/// Triangles in a run, at most.
pub(super) const RUN: usize = 96;
/// Runs that are worth a thread to be looked at.
pub(super) const FEW_RUNS: usize = 256;
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
        Self::of(model, &all)
    }

    /// Some triangles, as if there were no cells.
    ///
    /// # Panics
    /// If the model does not have one of them.
    pub fn of(model: &Model, triangles: &[u32]) -> Self {
        Self {
            cells: Vec::new(),
            elsewhere: runs(model, triangles),
        }
    }

    /// All that there is.
    pub fn all(&self) -> Runs<'_> {
        let runs: Vec<&Run> = self.cells.iter().flatten().chain(&self.elsewhere).collect();
        let asked = runs.iter().map(|run| run.triangles.len()).sum();
        Runs { runs, asked }
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
        let is_seen = |run: &Run| {
            let offset = run.center - eye;
            let reach = run.radius + SLACK * (offset.length() + run.radius);
            let touches = |cone: &Region| {
                let mut sides = cone.sides().iter();
                sides.all(|side| side.dot(offset) >= -reach)
            };
            regions.iter().any(touches)
        };
        let with = |mut found: Self, run: &'a Run| {
            found.asked += run.triangles.len();
            if is_seen(run) {
                found.runs.push(run);
            }
            found
        };
        let parts = runs.par_iter().with_min_len(FEW_RUNS);
        let found = parts.fold(Self::default, with);
        let found = found.reduce(Self::default, Self::and);
        *self = std::mem::take(self).and(found);
    }

    /// Both, in order.
    fn and(mut self, more: Self) -> Self {
        self.runs.extend(more.runs);
        self.asked += more.asked;
        self
    }

    /// Each run's triangles, and the centre and radius of the ball around them.
    pub(crate) fn balls(&self) -> impl Iterator<Item = (&'a [u32], DVec3, f64)> + '_ {
        let ball = |run: &&'a Run| (&run.triangles[..], run.center, run.radius);
        self.runs.iter().map(ball)
    }

    /// How many triangles are to be drawn; one in several runs counts for each.
    pub fn count(&self) -> usize {
        self.runs.iter().map(|run| run.triangles.len()).sum()
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
    // 1. Each corner once, in the model's order.
    let of = |i: &u32| model.mesh.triangles[*i as usize];
    let mut idxs: Vec<u32> = triangles.iter().flat_map(of).collect();
    idxs.sort_unstable();
    idxs.dedup();
    let place = |idx: u32| idxs.partition_point(|other| *other < idx) as u16;
    let corners = triangles.iter().map(|i| of(i).map(place)).collect();
    let point = |idx: &u32| model.mesh.positions[*idx as usize];
    let points: Vec<DVec3> = idxs.iter().map(point).collect();
    // 2. What is around them.
    let (low, high) = spanned(points.iter().copied());
    let center = low.midpoint(high);
    let distances = points.iter().map(|point| point.distance(center));
    let radius = distances.fold(0.0, f64::max);
    Run {
        corners,
        points,
        low,
        high,
        center,
        radius,
        triangles,
    }
}
