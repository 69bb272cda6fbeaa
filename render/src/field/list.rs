//! Which source views a triangle carries, and with what.

use super::known::{ByLeast, Known, NOWHERE, known};
use super::overlooked::overlooked;
use super::patch::Patch;
use super::vertex::Vertex;
use super::{FieldEntry, MAX_LISTED};
use crate::blend::Contributor;
use crate::frame::{Frame, ProxyPoint};
use crate::near::{Near, is_time_to_see};
use crate::surface::{FacetMap, Surface};
use crate::view_tree::Ball;
use calibrate::Pixel;
use std::cell::OnceCell;
use std::collections::{BTreeMap, BTreeSet};

/// Pixels by which a triangle must clear a border to be on one side of it. Edges that are
/// straight in the desired image are not quite so in a photo.
const CLEARANCE_PX: f64 = 2.0;

/// How much of a view's weight may come or go between a triangle's corners.
const TURNOVER: f64 = 0.5;

/// So many are looked at sooner than sorted, where nothing can hide what they see.
const FEW: usize = 48;

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
    /// that are and have it in their images, or in sight where that is all of the triangle.
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
            // Nothing is near a corner: only what the others say counts.
            return Self::of_weights(frame, corners);
        };

        let ends_with_lens = corners.iter().any(|corner| corner.is_beyond_lens);

        // 1. The views that may matter: where the corners' differences bound the threshold, all
        // within it.
        let triangle = Triangle {
            frame,
            corners,
            points: [a, b, c],
            // What is seen of it may lie beside all three.
            reaches: match ends_with_lens {
                true => [f64::INFINITY; 3],
                false => reaches([a, b, c]),
            },
            ends_with_lens,
            patch: OnceCell::new(),
            asked: OnceCell::new(),
        };
        let mut listed = triangle.seen();
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
        // 4. Where none has all of it, pixels between those points may see what only others have.
        let overlooked = triangle.overlooked(&listed);
        for &source_idx in &overlooked {
            let mut view = Listed::unknown(source_idx, Sees::Part);
            triangle.measure(&mut view);
            let at = listed.partition_point(|other| other.source_idx < source_idx);
            listed.insert(at, view);
        }

        let bordered = listed.iter().any(|view| view.sees == Sees::Part);
        if !bordered && !weights_turn_over(frame, corners) {
            return Self::of_weights(frame, corners);
        }
        if listed.len() > MAX_LISTED {
            // More borders than there is room for: the nearest of each part of the triangle
            // come first, then the second nearest. (The nearest of all alone left holes
            // beyond their borders.)
            let ranks = triangle.ranks(&listed, &overlooked);
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
    fn of_weights(frame: &Frame<'_>, corners: [&Vertex; 3]) -> Self {
        let weights = corners.map(|corner| corner.weights(frame));
        let all = weights.iter().flat_map(|weights| weights.iter());
        let mut listed: Vec<usize> = all.map(|w| w.source_idx).collect();
        listed.sort_unstable();
        listed.dedup();
        let weight = |weights: &[Contributor], i: usize| {
            let own = weights.iter().find(|w| w.source_idx == i);
            own.map_or(0.0, |w| w.weight as f32)
        };
        let entry = |i: usize| FieldEntry {
            source_idx: i as u32,
            values: weights.map(|weights| weight(weights, i)),
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
fn weights_turn_over(frame: &Frame<'_>, corners: [&Vertex; 3]) -> bool {
    let weights = corners.map(|corner| corner.weights(frame));
    let weight = |weights: &[Contributor], source_idx: usize| {
        let own = weights.iter().find(|w| w.source_idx == source_idx);
        own.map_or(0.0, |w| w.weight)
    };
    let least = |i: usize| {
        weights
            .map(|w| weight(w, i))
            .into_iter()
            .fold(1.0, f64::min)
    };
    let mut all = weights.iter().flat_map(|weights| weights.iter());
    all.any(|w| w.weight - least(w.source_idx) > TURNOVER)
}

/// How far a triangle reaches from each corner, in the world; infinitely far where one is at infinity.
fn reaches(points: [ProxyPoint; 3]) -> [f64; 3] {
    let [a, b, c] = points.map(|p| p.ray / p.inverse_distance);
    let sides = [a.distance(b), b.distance(c), c.distance(a)];
    let [ab, bc, ca] = sides.map(|side| {
        if side.is_finite() {
            side
        } else {
            f64::INFINITY
        }
    });
    [ab.max(ca), ab.max(bc), bc.max(ca)]
}

/// A triangle of the image plane, with what is worked out about it when needed.
struct Triangle<'a> {
    frame: &'a Frame<'a>,
    corners: [&'a Vertex; 3],
    /// Those of the corners.
    points: [ProxyPoint; 3],
    /// How far it reaches from each, in the world.
    reaches: [f64; 3],
    /// Whether the desired lens has no ray at some corner: then they don't tell how a view sees the triangle.
    ends_with_lens: bool,
    patch: OnceCell<Patch>,
    asked: OnceCell<Vec<Near>>,
}

impl Triangle<'_> {
    fn patch(&self) -> &Patch {
        self.patch
            .get_or_init(|| Patch::new(self.frame, self.corners))
    }

    /// How those that the corners know of see the triangle, in the order of the views; without those that
    /// differ by so much that the others tell of them that they cannot contribute.
    fn seen(&self) -> Vec<Listed> {
        let nears = self.corners.map(|corner| &corner.near);
        // What a corner does not know of, but may see some of the triangle, differs by more there.
        let others = [0, 1, 2].map(|c| match self.is_told_of_all(c) {
            true => nears[c].within,
            false => 0.0,
        });
        let known = known(nears, others);
        let listed = |view: Known| self.listed(view.source_idx as usize, view.places);
        let is_much = self.frame.lumigraph.visibility.is_some() || known.len() > FEW;
        if !(is_much && self.frame.may_skip()) {
            return known.into_iter().map(listed).collect();
        }
        let mut all_listed = Vec::with_capacity(MAX_LISTED);
        // The differences of those that see all of it.
        let mut seeing_all = Vec::with_capacity(MAX_LISTED);
        for (view, asked) in ByLeast::of(known).zip(0..) {
            if is_time_to_see(asked) && self.is_enough(&seeing_all, view.least) {
                break;
            }
            let view = listed(view);
            if view.sees == Sees::All {
                seeing_all.push(view.diffs);
            }
            all_listed.push(view);
        }
        all_listed.sort_unstable_by_key(|view| view.source_idx);
        all_listed
    }

    /// Whether the threshold is `least` or less at each corner, and no more than the corner has told of.
    fn is_enough(&self, all: &[[f64; 3]], least: f64) -> bool {
        let options = &self.frame.options;
        (0..3).all(|c| {
            let most = least.min(self.corners[c].near.within);
            options.is_threshold_of_seen_within(all.iter().map(|diffs| diffs[c]), most)
        })
    }

    /// Whether a corner has told of all views that see some of the triangle and differ by no more than it was
    /// asked for: those in sight of it.
    fn is_told_of_all(&self, c: usize) -> bool {
        self.reaches[c] <= self.corners[c].near.sight
    }

    /// Adds source views that are not listed yet, in order.
    fn add(&self, others: Vec<u32>, listed: &mut Vec<Listed>) {
        let known = listed.len();
        for i in others.into_iter().map(|i| i as usize) {
            let before = listed[..known].binary_search_by_key(&i, |view| view.source_idx);
            if before.is_err() {
                listed.push(self.measured(i));
            }
        }
        listed.sort_unstable_by_key(|view| view.source_idx);
    }

    /// How a source view sees the triangle; with what the corners know of it, if they do.
    fn listed(&self, source_idx: usize, places: [u32; 3]) -> Listed {
        let frame = self.frame;
        let known = [0, 1, 2].map(|c| {
            let of_views = &self.corners[c].near.of_views;
            of_views.get(places[c] as usize).copied()
        });
        let pixels = [0, 1, 2].map(|c| {
            let project = || frame.project(source_idx, &self.points[c]);
            known[c].map_or_else(project, |(_, pixel)| pixel)
        });
        let is_in_image = |pixel: Pixel| frame.fov_blend(source_idx, pixel) >= 0.0;
        Listed {
            source_idx,
            sees: match self.ends_with_lens {
                true => Sees::Part,
                false => self.how_it_is_seen(source_idx, pixels),
            },
            diffs: known.map(|at| at.map_or(f64::INFINITY, |(diff, _)| diff)),
            unsure: [0, 1, 2].map(|c| {
                known[c].is_none() && !self.is_told_of_all(c) && !pixels[c].is_some_and(is_in_image)
            }),
        }
    }

    /// The same of one that they don't know, with all of its differences.
    fn measured(&self, source_idx: usize) -> Listed {
        let mut view = self.listed(source_idx, [NOWHERE; 3]);
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

    /// What there is to know at points spread over the triangle, its corners among them.
    fn asked(&self) -> impl Iterator<Item = &Near> {
        let between = self
            .asked
            .get_or_init(|| self.ask(self.patch().inner(), 0.0));
        self.corners
            .iter()
            .map(|corner| &corner.near)
            .chain(between)
    }

    /// What there is to know at points of the triangle, and which views may see something within a distance of
    /// them.
    fn ask(&self, points: impl Iterator<Item = ProxyPoint>, sight: f64) -> Vec<Near> {
        let within = self.corners.map(|corner| corner.near.within);
        let mut guess = within.into_iter().fold(self.frame.first_guess(), f64::max);
        let near = |point| {
            let near = self.frame.near(&point, sight, guess);
            guess = near.guess().unwrap_or(guess);
            near
        };
        points.map(near).collect()
    }

    /// Those that see all of a triangle bound the threshold at each corner from above.
    fn bounds(&self, listed: &[Listed]) -> [f64; 3] {
        let mut diffs = Vec::with_capacity(listed.len());
        [0, 1, 2].map(|c| {
            let mut threshold_within = |most: f64| {
                let all = listed.iter().filter(|view| view.sees == Sees::All);
                diffs.clear();
                diffs.extend(all.map(|view| view.diffs[c]).filter(|diff| *diff <= most));
                self.frame.options.threshold_of_seen(&mut diffs)
            };
            // Mostly it is no more than what the corner told of, and what differs by more does not matter.
            let within = self.corners[c].near.within;
            let threshold = threshold_within(within);
            match threshold <= within {
                true => threshold,
                false => threshold_within(f64::INFINITY),
            }
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
                return self.counting();
            }
            let sight = 0.5 * self.reaches.into_iter().fold(0.0, f64::max);
            let nears = self.ask(self.patch().between(), sight);
            views.extend(nears.iter().flat_map(|near| &near.views));
        } else {
            let mut found = Vec::new();
            for c in (0..3).filter(|&c| bounds[c] > self.corners[c].near.within) {
                let ball = Ball::around(&self.points[c], self.reaches[c]);
                frame.views_within(ball.as_ref(), bounds[c], &mut found);
                views.extend_from_slice(&found);
            }
        }
        views.sort_unstable();
        views.dedup();
        views
    }

    /// The source views that see some of the points and may count there, in order. As a surface that can hide a
    /// part of itself may jump between them, others may count there: of these as many as there is room for, that
    /// may differ least.
    fn counting(&self) -> Vec<u32> {
        let frame = self.frame;
        let candidates = self.asked().flat_map(|near| &near.candidates);
        let counting = candidates.filter(|c| c.mask > 0.0);
        let mut views: Vec<u32> = counting.map(|c| c.source_idx as u32).collect();
        views.sort_unstable();
        views.dedup();
        let room = MAX_LISTED.saturating_sub(views.len());
        if room > 0 {
            let most = self.asked().map(|near| near.within).fold(0.0, f64::max);
            let mut others = Vec::new();
            frame.views_by_least(self.patch().ball().as_ref(), most, &mut others);
            others.retain(|i| views.binary_search(i).is_err());
            views.extend(others.into_iter().take(room));
            views.sort_unstable();
        }
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
            let candidates = self.asked().flat_map(|near| &near.candidates);
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

    /// The source views that pixels need which none of those listed has: where the surface jumps and none of them
    /// has all of the triangle. (Where it does not, what is between the corners falls between them in photos, too.)
    fn overlooked(&self, listed: &[Listed]) -> Vec<usize> {
        let is_whole = || listed.iter().any(|view| view.sees == Sees::All);
        let is_flat = || !matches!(self.frame.surface, Surface::Facets(_));
        if is_whole() || is_flat() || self.patch().is_smooth() {
            return Vec::new();
        }
        let known: Vec<usize> = listed.iter().map(|view| view.source_idx).collect();
        overlooked(self.frame, self.corners.map(|corner| corner.at), &known)
    }

    /// The best rank, by difference, that listed views have among those of them that count at a
    /// point, for points spread over the triangle.
    fn ranks(&self, listed: &[Listed], overlooked: &[usize]) -> BTreeMap<usize, usize> {
        let is_listed = |i: usize| {
            listed
                .binary_search_by_key(&i, |view| view.source_idx)
                .is_ok()
        };
        // For some pixel it is the only one.
        let mut ranks: BTreeMap<usize, usize> = overlooked.iter().map(|i| (*i, 0)).collect();
        if let Surface::Facets(map) = &self.frame.surface {
            ranks.extend(self.moved_to(map).map(|source_idx| (source_idx, 0)));
        }
        for near in self.asked() {
            let seeing = near.candidates.iter().filter(|c| c.mask > 0.0);
            let seeing = seeing.filter(|c| is_listed(c.source_idx));
            let mut seeing: Vec<(f64, usize)> = seeing.map(|c| (c.diff, c.source_idx)).collect();
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
