//! Which source views a triangle carries, and with what.

use super::patch::Patch;
use super::vertex::Vertex;
use super::{FieldEntry, MAX_LISTED};
use crate::frame::{Frame, ProxyPoint};
use crate::near::Near;
use crate::options::MAX_CONTRIBUTORS;
use crate::surface::{FacetMap, Surface};
use crate::view_tree::Ball;
use calibrate::Pixel;
use std::cell::OnceCell;
use std::collections::{BTreeMap, BTreeSet, HashMap};

/// Pixels by which a triangle must clear a border to be on one side of it. Edges that are
/// straight in the desired image are not quite so in a photo.
const CLEARANCE_PX: f64 = 2.0;

/// How much of a view's weight may come or go between a triangle's corners.
const TURNOVER: f64 = 0.5;

/// How many views see all of a triangle, by their differences at its corners. Of those that differ alike,
/// as photos from one place do, the first decide: one more than may contribute, as its difference caps the
/// threshold.
type Crowds = HashMap<[u64; 3], usize>;

/// With fewer views nobody looks for crowds.
const MANY: usize = 128;

/// A source view's difference at a triangle's corner, and where its photo has that.
type AtCorner = (f64, Option<Pixel>);

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
    /// By corner: its difference there; infinite while it is not known.
    diffs: [f64; 3],
    /// Of those that are not known, which may be within what the corner was asked for: it has told of all
    /// that are and have it in their images, and maybe of no others.
    unsure: [bool; 3],
}

impl Listed {
    /// Whose differences are not known.
    fn unknown(source_idx: usize, sees: Sees) -> Self {
        Self {
            source_idx,
            sees,
            diffs: [f64::INFINITY; 3],
            unsure: [true; 3],
        }
    }
}

impl List {
    pub(super) fn of(frame: &Frame<'_>, corners: [&Vertex; 3]) -> Self {
        let [Some(a), Some(b), Some(c)] = corners.map(|corner| corner.point) else {
            // The lens ends inside the triangle. With nothing known beyond, only what the
            // other corners say counts.
            return Self::of_weights(corners);
        };

        // 1. The views that may matter: where the corners' differences bound the threshold, all
        // within it.
        let triangle = Triangle {
            frame,
            corners,
            points: [a, b, c],
            patch: OnceCell::new(),
            asked: OnceCell::new(),
        };
        let mut listed = triangle.known();
        let mut bounds = triangle.bounds(&listed);
        if (0..3).any(|c| bounds[c] > corners[c].near.within) {
            // What was not known may matter.
            listed.iter_mut().for_each(|view| triangle.measure(view));
            bounds = triangle.bounds(&listed);
        }
        if (0..3).any(|c| bounds[c] > corners[c].near.within) {
            triangle.add(triangle.others_within(bounds), &mut listed);
            bounds = triangle.bounds(&listed);
        }

        // 2. Where pixels look at what was moved into some photo, corners don't tell which.
        let somewhere = triangle.seen_where_moved();
        for &source_idx in &somewhere {
            match listed.binary_search_by_key(&source_idx, |l| l.source_idx) {
                Ok(at) => listed[at].sees = Sees::Part,
                Err(at) => listed.insert(at, Listed::unknown(source_idx, Sees::Part)),
            }
        }

        // 3. A view that differs by more at every corner cannot contribute anywhere.
        listed.retain_mut(|view| {
            let stays = somewhere.binary_search(&view.source_idx).is_ok()
                || view.sees != Sees::Nothing
                    && (0..3).any(|c| triangle.difference(view, c) <= bounds[c]);
            if stays {
                triangle.measure(view);
            }
            stays
        });
        let bordered = listed.iter().any(|view| view.sees == Sees::Part);
        if !bordered && !weights_turn_over(corners) {
            return Self::of_weights(corners);
        }
        if listed.len() > MAX_LISTED {
            // More borders than there is room for: the nearest of each part of the triangle
            // come first, then the second nearest. (The nearest of all alone left holes
            // beyond their borders.)
            let ranks = triangle.ranks(&listed);
            let least = |view: &Listed| view.diffs.iter().copied().fold(f64::MAX, f64::min);
            let rank = |view: &Listed| ranks.get(&view.source_idx).copied().unwrap_or(usize::MAX);
            let key = |view: &Listed| (rank(view), least(view), view.source_idx);
            let keys: Vec<(usize, f64, usize)> = listed.iter().map(key).collect();
            let order = |x: &(usize, f64, usize), y: &(usize, f64, usize)| {
                let by_rank = x.0.cmp(&y.0);
                by_rank.then(x.1.total_cmp(&y.1)).then(x.2.cmp(&y.2))
            };
            let (_, &mut last, _) = keys.clone().select_nth_unstable_by(MAX_LISTED - 1, order);
            let mut stays = keys.iter().map(|key| order(key, &last).is_le());
            listed.retain(|_| stays.next() == Some(true));
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

/// A triangle of the image plane, with what is worked out about it when needed.
struct Triangle<'a> {
    frame: &'a Frame<'a>,
    corners: [&'a Vertex; 3],
    /// Those of the corners.
    points: [ProxyPoint; 3],
    patch: OnceCell<Patch>,
    asked: OnceCell<Vec<Near>>,
}

impl Triangle<'_> {
    fn patch(&self) -> &Patch {
        self.patch
            .get_or_init(|| Patch::new(self.frame, self.corners))
    }

    /// The source views that the corners know of, in order, and how they see the triangle.
    fn known(&self) -> Vec<Listed> {
        let nears = self.corners.map(|corner| &corner.near);
        let mut next = [0; 3];
        let mut listed = Vec::with_capacity(nears.iter().map(|n| n.views.len()).sum());
        let mut crowds = (listed.capacity() > MANY).then(Crowds::default);
        // The least of all that come next.
        while let Some(&i) = (0..3).filter_map(|c| nears[c].views.get(next[c])).min() {
            let known = [0, 1, 2].map(|c| {
                let is_known = nears[c].views.get(next[c]) == Some(&i);
                next[c] += usize::from(is_known);
                is_known.then(|| nears[c].of_views[next[c] - 1])
            });
            let Some(crowds) = &mut crowds else {
                listed.push(self.listed(i as usize, known));
                continue;
            };
            let view = self.measured(i as usize, known);
            let alike = crowds.entry(view.diffs.map(f64::to_bits)).or_insert(0);
            if *alike <= MAX_CONTRIBUTORS {
                *alike += usize::from(view.sees == Sees::All);
                listed.push(view);
            }
        }
        listed
    }

    /// Adds source views that are not listed yet, in order.
    fn add(&self, others: Vec<u32>, listed: &mut Vec<Listed>) {
        let known = listed.len();
        for i in others.into_iter().map(|i| i as usize) {
            let before = listed[..known].binary_search_by_key(&i, |view| view.source_idx);
            if before.is_err() {
                listed.push(self.measured(i, [None; 3]));
            }
        }
        listed.sort_unstable_by_key(|view| view.source_idx);
    }

    /// How a source view sees the triangle; with what is known of it at the corners.
    fn listed(&self, source_idx: usize, known: [Option<AtCorner>; 3]) -> Listed {
        let frame = self.frame;
        let pixels = [0, 1, 2].map(|c| {
            let project = || frame.project(source_idx, &self.points[c]);
            known[c].map_or_else(project, |(_, pixel)| pixel)
        });
        let is_in_image = |pixel: Pixel| frame.fov_blend(source_idx, pixel) >= 0.0;
        Listed {
            source_idx,
            sees: self.how_it_is_seen(source_idx, pixels),
            diffs: known.map(|at| at.map_or(f64::INFINITY, |(diff, _)| diff)),
            unsure: [0, 1, 2].map(|c| known[c].is_none() && !pixels[c].is_some_and(is_in_image)),
        }
    }

    /// The same with all of its differences.
    fn measured(&self, source_idx: usize, known: [Option<AtCorner>; 3]) -> Listed {
        let mut view = self.listed(source_idx, known);
        self.measure(&mut view);
        view
    }

    /// A view's difference at a corner, if it can be what the corner was asked for; else more than that.
    fn difference(&self, view: &mut Listed, c: usize) -> f64 {
        if view.unsure[c] {
            view.unsure[c] = false;
            view.diffs[c] = self.frame.difference(view.source_idx, &self.points[c]);
        }
        view.diffs[c]
    }

    /// Finds what is not known of a view's differences.
    fn measure(&self, view: &mut Listed) {
        view.unsure = [false; 3];
        for c in 0..3 {
            if view.diffs[c] == f64::INFINITY {
                view.diffs[c] = self.frame.difference(view.source_idx, &self.points[c]);
            }
        }
    }

    /// What counts at points spread over the triangle.
    fn asked(&self) -> &[Near] {
        self.asked.get_or_init(|| self.ask(self.patch().points()))
    }

    /// What counts at points of the triangle, with the views in sight of them.
    fn ask(&self, points: impl Iterator<Item = ProxyPoint>) -> Vec<Near> {
        let within = self.corners.map(|corner| corner.near.within);
        let mut guess = within.into_iter().fold(self.frame.first_guess(), f64::max);
        let sight = 0.5 * (0..3).map(|c| self.reach(c)).fold(0.0, f64::max);
        let near = |point| self.frame.near(&point, sight, &mut guess);
        points.map(near).collect()
    }

    /// How far the triangle reaches from a corner, in the world.
    fn reach(&self, c: usize) -> f64 {
        let places = self.points.map(|p| p.ray / p.inverse_distance);
        let others = [(c + 1) % 3, (c + 2) % 3];
        let far = others.map(|other| places[c].distance(places[other]));
        if far.iter().all(|far| far.is_finite()) {
            far[0].max(far[1])
        } else {
            f64::INFINITY
        }
    }

    /// Those that see all of a triangle bound the threshold at each corner from above.
    fn bounds(&self, listed: &[Listed]) -> [f64; 3] {
        let mut diffs = Vec::with_capacity(listed.len());
        [0, 1, 2].map(|c| {
            diffs.clear();
            let all = listed.iter().filter(|view| view.sees == Sees::All);
            diffs.extend(all.map(|view| view.diffs[c]));
            self.frame.options.threshold_of_seen(&mut diffs)
        })
    }

    /// The source views that may matter where the corners don't know of all that do, in order. Where
    /// hardly any sees all of the triangle, those that points within it say.
    fn others_within(&self, bounds: [f64; 3]) -> Vec<u32> {
        let frame = self.frame;
        let mut views = Vec::new();
        if bounds.contains(&f64::INFINITY) && frame.view_tree().is_large() {
            // Borders anywhere: what the corners and points between them need, all of it may.
            if frame.lumigraph.visibility.is_some() {
                // Where a surface can hide a part of itself it may jump between them.
                let most = self.asked().iter().map(|near| near.within);
                let most = most.fold(0.0, f64::max);
                frame.views_within(self.patch().ball().as_ref(), most, &mut views);
                views.extend(self.asked().iter().flat_map(|near| &near.views));
            } else {
                let nears = self.ask(self.patch().between());
                views.extend(nears.iter().flat_map(|near| &near.views));
            }
        } else {
            let mut found = Vec::new();
            for c in (0..3).filter(|&c| bounds[c] > self.corners[c].near.within) {
                let ball = Ball::around(&self.points[c], self.reach(c));
                frame.views_within(ball.as_ref(), bounds[c], &mut found);
                views.extend_from_slice(&found);
            }
        }
        views.sort_unstable();
        views.dedup();
        views
    }

    /// The source views that count at any point of a triangle in which some were moved, and those
    /// that pixels nearby were moved to; none where none were. In order.
    fn seen_where_moved(&self) -> Vec<usize> {
        let Surface::Facets(map) = &self.frame.surface else {
            return Vec::new();
        };
        if !map.any_is_moved() {
            return Vec::new();
        }
        // Few pixels may have been moved, between all that are asked.
        let mut seen: BTreeSet<usize> = self.moved_to(map).collect();
        if !seen.is_empty() || self.patch().is_moved {
            let candidates = self.asked().iter().flat_map(|near| &near.candidates);
            seen.extend(candidates.map(|c| c.source_idx));
        }
        seen.into_iter().collect()
    }

    /// The source views that pixels around were moved to.
    fn moved_to(&self, map: &FacetMap) -> impl Iterator<Item = usize> {
        let [a, b, c] = self.corners.map(|corner| corner.at);
        let seers = map.seers.within(a.min(b).min(c), a.max(b).max(c));
        seers.map(|source_idx| source_idx as usize)
    }

    /// The best rank, by difference, that listed views have among those of them that count at a
    /// point, for points spread over the triangle.
    fn ranks(&self, listed: &[Listed]) -> BTreeMap<usize, usize> {
        let is_listed = |i: usize| {
            listed
                .binary_search_by_key(&i, |view| view.source_idx)
                .is_ok()
        };
        let mut ranks = BTreeMap::new();
        if let Surface::Facets(map) = &self.frame.surface {
            // For some pixel it is the only one.
            ranks.extend(self.moved_to(map).map(|source_idx| (source_idx, 0)));
        }
        for near in self.asked() {
            let candidates = near.candidates.iter().filter(|c| is_listed(c.source_idx));
            let mut seeing: Vec<(f64, usize)> =
                candidates.map(|c| (c.diff, c.source_idx)).collect();
            seeing.sort_unstable_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
            for (rank, (_, i)) in seeing.into_iter().enumerate() {
                let best = ranks.entry(i).or_insert(rank);
                *best = rank.min(*best);
            }
        }
        ranks
    }

    /// How a source view sees the triangle, whose corners fall on these pixels of its photo.
    fn how_it_is_seen(&self, source_idx: usize, pixels: [Option<Pixel>; 3]) -> Sees {
        let frame = self.frame;
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
            let levels = self.points.map(|p| frame.level_of_detail(source_idx, &p));
            let coarsest = levels.into_iter().fold(0.0, f64::max).ceil();
            let reach = CLEARANCE_PX + 2.0 * coarsest.min((mask.levels.len() - 1) as f64).exp2();
            match mask.range([left - reach, top - reach], [right + reach, bottom + reach]) {
                (_, 0) => return Sees::Nothing,
                (255, _) => {}
                _ => return Sees::Part,
            }
        }
        if inside < source.feather_px + CLEARANCE_PX {
            return Sees::Part;
        }
        match &frame.lumigraph.visibility {
            Some(visibility)
                if !self
                    .patch()
                    .is_open_to(frame, source_idx, visibility.map(source_idx)) =>
            {
                Sees::Part
            }
            _ => Sees::All,
        }
    }
}
