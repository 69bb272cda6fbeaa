//! Which source views a triangle carries, and with what.

use super::vertex::{Vertex, point_at};
use super::{FieldEntry, MAX_LISTED};
use crate::frame::{Frame, ProxyPoint};
use crate::reference::candidate;
use crate::view_tree::Ball;
use calibrate::Pixel;
use glam::DVec2;
use std::collections::{BTreeMap, BTreeSet};

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

/// A source view that may matter in a triangle.
struct Listed {
    source_idx: usize,
    sees: Sees,
    /// By corner: its difference there.
    diffs: [f64; 3],
}

impl List {
    pub(super) fn of(frame: &Frame<'_>, corners: [&Vertex; 3]) -> Self {
        let [Some(a), Some(b), Some(c)] = corners.map(|corner| corner.point) else {
            // The lens ends inside the triangle. With nothing known beyond, only what the
            // other corners say counts.
            return Self::of_weights(corners);
        };
        let points = [a, b, c];

        // 1. The views that may matter: where the corners' differences bound the threshold, all
        // within it.
        let nears = corners.map(|corner| &corner.near);
        let mut views: Vec<u32> = nears.iter().flat_map(|n| n.views.iter().copied()).collect();
        let mut listed = listed_of(frame, corners, &points, &mut views);
        let mut bounds = bounds_of(frame, &listed);
        if (0..3).any(|c| bounds[c] > nears[c].within) {
            views.extend(others_within(frame, corners, bounds));
            listed = listed_of(frame, corners, &points, &mut views);
            bounds = bounds_of(frame, &listed);
        }

        // 2. Where pixels look at what was moved into some photo, corners don't tell which.
        let somewhere = seen_where_moved(frame, corners);
        for &source_idx in &somewhere {
            match listed.binary_search_by_key(&source_idx, |l| l.source_idx) {
                Ok(at) => listed[at].sees = Sees::Part,
                Err(at) => listed.insert(
                    at,
                    Listed {
                        source_idx,
                        sees: Sees::Part,
                        diffs: points.map(|point| frame.difference(source_idx, &point)),
                    },
                ),
            }
        }

        // 3. A view that differs by more at every corner cannot contribute anywhere.
        listed.retain(|view| {
            somewhere.binary_search(&view.source_idx).is_ok()
                || view.sees != Sees::Nothing && (0..3).any(|c| view.diffs[c] <= bounds[c])
        });
        let bordered = listed.iter().any(|view| view.sees == Sees::Part);
        if !bordered && !weights_turn_over(corners) {
            return Self::of_weights(corners);
        }
        if listed.len() > MAX_LISTED {
            // More borders than there is room for: the nearest of each part of the triangle
            // come first, then the second nearest. (The nearest of all alone left holes
            // beyond their borders.)
            let ranks = ranks_within(frame, corners, &listed);
            let least = |view: &Listed| view.diffs.iter().copied().fold(f64::MAX, f64::min);
            let rank = |view: &Listed| ranks.get(&view.source_idx).copied().unwrap_or(usize::MAX);
            listed.sort_by(|x, y| {
                let by_rank = rank(x).cmp(&rank(y));
                let nearer = least(x).total_cmp(&least(y));
                by_rank.then(nearer).then(x.source_idx.cmp(&y.source_idx))
            });
            listed.truncate(MAX_LISTED);
            listed.sort_by_key(|view| view.source_idx);
        }
        let entry = |view: Listed| FieldEntry {
            source_idx: view.source_idx as u32,
            values: view.diffs.map(|diff| diff as f32),
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

/// Steps between points that are spread over a triangle, along each side.
const STEPS: u32 = 4;

/// Points spread over a triangle.
fn spread_over(corners: [&Vertex; 3]) -> impl Iterator<Item = DVec2> {
    let [a, b, c] = corners.map(|corner| corner.at);
    let step = |i: u32| f64::from(i) / f64::from(STEPS);
    let steps = (0..=STEPS).flat_map(|i| (0..=STEPS - i).map(move |j| (i, j)));
    steps.map(move |(i, j)| a + step(i) * (b - a) + step(j) * (c - a))
}

/// The views of these indices, in order, and how they see a triangle.
fn listed_of(
    frame: &Frame<'_>,
    corners: [&Vertex; 3],
    points: &[ProxyPoint; 3],
    views: &mut Vec<u32>,
) -> Vec<Listed> {
    views.sort_unstable();
    views.dedup();
    let of = |&i: &u32| {
        let source_idx = i as usize;
        let at = [0, 1, 2].map(|c| {
            let anew = || {
                let point = &points[c];
                (
                    frame.difference(source_idx, point),
                    frame.project(source_idx, point),
                )
            };
            corners[c].near.of_view(source_idx).unwrap_or_else(anew)
        });
        Listed {
            source_idx,
            sees: how_it_sees(frame, source_idx, points, at.map(|a| a.1)),
            diffs: at.map(|a| a.0),
        }
    };
    views.iter().map(of).collect()
}

/// Those that see all of a triangle bound the threshold at each corner from above.
fn bounds_of(frame: &Frame<'_>, listed: &[Listed]) -> [f64; 3] {
    let all = || listed.iter().filter(|view| view.sees == Sees::All);
    [0, 1, 2].map(|c| {
        let diffs = all().map(|view| view.diffs[c]).collect();
        frame.options.threshold_of_seen(diffs)
    })
}

/// The source views that may matter in a triangle whose corners don't know of all that do. Where
/// hardly any sees all of it, those that points within it say.
fn others_within(frame: &Frame<'_>, corners: [&Vertex; 3], bounds: [f64; 3]) -> Vec<u32> {
    let points = corners.map(|corner| corner.point.map(|p| p.ray / p.inverse_distance));
    let ball = match points {
        [Some(a), Some(b), Some(c)] if (a + b + c).is_finite() => {
            let center = (a + b + c) / 3.0;
            let far = [a, b, c].map(|p| p.distance(center));
            Some(Ball {
                center,
                radius: far.into_iter().fold(0.0, f64::max),
            })
        }
        _ => None,
    };
    let mut most = bounds.into_iter().fold(0.0, f64::max);
    if most == f64::INFINITY && frame.view_tree().is_large() {
        // Borders anywhere: what points spread over it need, all of it may.
        let mut guess = frame.first_guess();
        let needed = spread_over(corners).filter_map(|at| point_at(frame, at));
        most = needed
            .map(|point| frame.near(&point, 0.0, &mut guess).within)
            .fold(0.0, f64::max);
    }
    let mut views = Vec::new();
    frame.views_within(ball.as_ref(), most, &mut views);
    views
}

/// The source views that count at any point of a triangle in which some were moved; none where
/// none were. In order.
fn seen_where_moved(frame: &Frame<'_>, corners: [&Vertex; 3]) -> Vec<usize> {
    let pixel = |at: DVec2| Pixel::new(at.x, at.y);
    if !spread_over(corners).any(|at| frame.surface.is_moved_at(pixel(at))) {
        return Vec::new();
    }
    let mut seen = BTreeSet::new();
    let mut guess = frame.first_guess();
    for point in spread_over(corners).filter_map(|at| point_at(frame, at)) {
        let near = frame.near(&point, 0.0, &mut guess);
        seen.extend(near.candidates.iter().map(|c| c.source_idx));
    }
    seen.into_iter().collect()
}

/// The best rank, by difference, that listed views have among those of them that see a point, for
/// points spread over a triangle.
fn ranks_within(
    frame: &Frame<'_>,
    corners: [&Vertex; 3],
    listed: &[Listed],
) -> BTreeMap<usize, usize> {
    let mut ranks = BTreeMap::new();
    for point in spread_over(corners).filter_map(|at| point_at(frame, at)) {
        let seeing = listed.iter().filter_map(|view| {
            let i = view.source_idx;
            let pixel = frame.project(i, &point)?;
            let seen = candidate(frame, i, &point, pixel, || frame.difference(i, &point))?;
            Some((seen.diff, i))
        });
        let mut seeing: Vec<(f64, usize)> = seeing.collect();
        seeing.sort_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
        for (rank, (_, i)) in seeing.into_iter().enumerate() {
            let best = ranks.entry(i).or_insert(rank);
            *best = rank.min(*best);
        }
    }
    ranks
}

fn how_it_sees(
    frame: &Frame<'_>,
    source_idx: usize,
    points: &[ProxyPoint; 3],
    pixels: [Option<Pixel>; 3],
) -> Sees {
    let [Some(a), Some(b), Some(c)] = pixels else {
        let none = pixels.iter().all(Option::is_none);
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
        let levels = points.map(|point| frame.level_of_detail(source_idx, &point));
        let coarsest = levels.into_iter().fold(0.0, f64::max).ceil();
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
