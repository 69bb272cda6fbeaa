//! Which source views a triangle carries, and with what.

use super::vertex::{Vertex, candidates, point_at, sources_at};
use super::{FieldEntry, MAX_LISTED};
use crate::frame::Frame;
use calibrate::Pixel;
use glam::DVec2;

/// Pixels by which a triangle must clear a border to be on one side of it. Edges that are
/// straight in the desired image are not quite so in a photo.
const CLEARANCE_PX: f64 = 2.0;

/// How much of a view's weight may come or go between a triangle's corners.
const TURNOVER: f64 = 0.5;

/// The source views of one triangle.
pub(super) struct List {
    pub(super) entries: Vec<FieldEntry>,
    pub(super) bordered: bool,
}

/// How a source view sees a triangle.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Sees {
    /// With fovBlend and mask one all over.
    All,
    Nothing,
    Part,
}

impl List {
    pub(super) fn of(frame: &Frame<'_>, corners: [&Vertex; 3]) -> Self {
        if corners.iter().any(|c| c.sources.is_empty()) {
            // The lens ends inside the triangle. With nothing known beyond, only what the
            // other corners say counts.
            return Self::of_weights(corners);
        }
        let mut sees: Vec<Sees> = (0..frame.sources.len())
            .map(|i| how_it_sees(frame, i, corners))
            .collect();
        // Where pixels look at what was moved into some photo, corners don't tell which.
        let somewhere = seen_where_moved(frame, corners);
        for &i in &somewhere {
            sees[i] = Sees::Part;
        }
        if !sees.contains(&Sees::Part) && !weights_turn_over(corners) {
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
            somewhere.binary_search(&i).is_ok()
                || sees[i] != Sees::Nothing
                    && (0..3).any(|c| corners[c].sources[i].diff <= bounds[c])
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

/// Whether some view's weight differs so much between corners that it is no linear function:
/// at an epipole a view has all the weight, and where another is nearly on the line of sight,
/// too, it has lost it within a pixel. Differences are linear there.
fn weights_turn_over(corners: [&Vertex; 3]) -> bool {
    let weight = |corner: &Vertex, source_idx: usize| {
        let own = corner.weights.iter().find(|w| w.source_idx == source_idx);
        own.map_or(0.0, |w| w.weight)
    };
    let least = |i: usize| {
        corners
            .map(|c| weight(c, i))
            .into_iter()
            .fold(1.0, f64::min)
    };
    let mut all = corners.iter().flat_map(|c| &c.weights);
    all.any(|w| w.weight - least(w.source_idx) > TURNOVER)
}

/// Points spread over a triangle.
fn spread_over(corners: [&Vertex; 3]) -> impl Iterator<Item = DVec2> {
    // Steps between points, along each side.
    const STEPS: u32 = 4;
    let [a, b, c] = corners.map(|corner| corner.at);
    let step = |i: u32| f64::from(i) / f64::from(STEPS);
    let steps = (0..=STEPS).flat_map(|i| (0..=STEPS - i).map(move |j| (i, j)));
    steps.map(move |(i, j)| a + step(i) * (b - a) + step(j) * (c - a))
}

/// The source views that see any point of a triangle in which some were moved; none where none
/// were. In order.
fn seen_where_moved(frame: &Frame<'_>, corners: [&Vertex; 3]) -> Vec<usize> {
    let pixel = |at: DVec2| Pixel::new(at.x, at.y);
    if !spread_over(corners).any(|at| frame.surface.is_moved_at(pixel(at))) {
        return Vec::new();
    }
    let mut seen = vec![false; frame.sources.len()];
    for point in spread_over(corners).filter_map(|at| point_at(frame, at)) {
        let sources = sources_at(frame, &point);
        candidates(frame, &point, &sources).for_each(|c| seen[c.source_idx] = true);
    }
    (0..seen.len()).filter(|&i| seen[i]).collect()
}

/// For each source view the best rank, by difference, that it has among the views that see
/// a point, for points spread over a triangle.
fn ranks_within(frame: &Frame<'_>, corners: [&Vertex; 3]) -> Vec<usize> {
    let mut ranks = vec![usize::MAX; frame.sources.len()];
    for at in spread_over(corners) {
        let Some(point) = point_at(frame, at) else {
            continue;
        };
        let sources = sources_at(frame, &point);
        let seeing = candidates(frame, &point, &sources);
        let mut seeing: Vec<(f64, usize)> = seeing.map(|c| (c.diff, c.source_idx)).collect();
        seeing.sort_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
        for (rank, (_, i)) in seeing.into_iter().enumerate() {
            ranks[i] = ranks[i].min(rank);
        }
    }
    ranks
}

fn how_it_sees(frame: &Frame<'_>, source_idx: usize, corners: [&Vertex; 3]) -> Sees {
    let [Some(a), Some(b), Some(c)] = corners.map(|c| c.sources[source_idx].pixel) else {
        let unseen = |c: &Vertex| c.sources[source_idx].pixel.is_none();
        let none = corners.into_iter().all(unseen);
        return if none { Sees::Nothing } else { Sees::Part };
    };
    let source = &frame.sources[source_idx];
    let [width, height] = source.size;
    let (left, right) = (a.x.min(b.x).min(c.x), a.x.max(b.x).max(c.x));
    let (top, bottom) = (a.y.min(b.y).min(c.y), a.y.max(b.y).max(c.y));
    let beyond = (-right).max(left - width).max(-bottom).max(top - height);
    let inside = left.min(width - right).min(top).min(height - bottom);
    if beyond > CLEARANCE_PX {
        return Sees::Nothing;
    }
    if let Some(mask) = frame.lumigraph.photos.mask(source_idx) {
        // Filtering reaches two texels of the coarser of its two levels.
        let points = corners.iter().filter_map(|c| c.point.as_ref());
        let levels = points.map(|point| frame.level_of_detail(source_idx, point));
        let coarsest = levels.fold(0.0, f64::max).ceil();
        let reach = CLEARANCE_PX + 2.0 * coarsest.min((mask.levels.len() - 1) as f64).exp2();
        match mask.range([left - reach, top - reach], [right + reach, bottom + reach]) {
            (_, 0) => return Sees::Nothing,
            (255, _) => {}
            _ => return Sees::Part,
        }
    }
    // What hides something from a view has borders anywhere.
    let hidden = frame.lumigraph.visibility.is_some();
    if !hidden && inside >= source.feather_px + CLEARANCE_PX {
        Sees::All
    } else {
        Sees::Part
    }
}
