//! How source views see a triangle of the image plane, and which may matter in it.

use super::MAX_LISTED;
use super::known::{ByLeast, Known, NOWHERE, known};
use super::overlooked::overlooked;
use super::patch::Patch;
use super::vertex::Vertex;
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

/// So many are looked at sooner than sorted, where nothing can hide what they see.
const FEW: usize = 48;

/// How a source view sees a triangle.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Sees {
    /// With fovBlend and mask one all over.
    All,
    Nothing,
    Part,
}

/// A source view that may matter in a triangle.
pub(super) struct Listed {
    pub(super) source_idx: usize,
    pub(super) sees: Sees,
    /// By corner: its difference there; infinite while it is not known.
    pub(super) diffs: [f64; 3],
    /// Of those that are not known, which may be within what the corner was asked for: it has told of all
    /// that are and have it in their images, or in sight where that is all of the triangle.
    unsure: [bool; 3],
}

impl Listed {
    /// Whose differences are not known.
    pub(super) fn unknown(source_idx: usize, sees: Sees) -> Self {
        Self {
            source_idx,
            sees,
            diffs: [f64::INFINITY; 3],
            unsure: [true; 3],
        }
    }
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
pub(super) struct Triangle<'a> {
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

impl<'a> Triangle<'a> {
    /// With its corners' points; whether the desired lens has no ray at some corner.
    pub(super) fn new(
        frame: &'a Frame<'a>,
        corners: [&'a Vertex; 3],
        points: [ProxyPoint; 3],
        ends_with_lens: bool,
    ) -> Self {
        Self {
            frame,
            corners,
            points,
            // What is seen of it may lie beside all three.
            reaches: match ends_with_lens {
                true => [f64::INFINITY; 3],
                false => reaches(points),
            },
            ends_with_lens,
            patch: OnceCell::new(),
            asked: OnceCell::new(),
        }
    }

    fn patch(&self) -> &Patch {
        self.patch
            .get_or_init(|| Patch::new(self.frame, self.corners))
    }

    /// How those that the corners know of see the triangle, in the order of the views; without those that
    /// differ by so much that the others tell of them that they cannot contribute.
    pub(super) fn seen(&self) -> Vec<Listed> {
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
    pub(super) fn add(&self, others: Vec<u32>, listed: &mut Vec<Listed>) {
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
    pub(super) fn difference(&self, view: &mut Listed, c: usize) -> f64 {
        if view.unsure[c] {
            view.unsure[c] = false;
            view.diffs[c] = self.frame.difference(view.source_idx, &self.points[c]);
        }
        view.diffs[c]
    }

    /// Finds what is not known of a view's differences.
    pub(super) fn measure(&self, view: &mut Listed) {
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
            guess = near.generous_guess().unwrap_or(guess);
            near
        };
        points.map(near).collect()
    }

    /// Those that see all of a triangle bound the threshold at each corner from above.
    pub(super) fn bounds(&self, listed: &[Listed]) -> [f64; 3] {
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
    pub(super) fn others_within(&self, bounds: [f64; 3]) -> Vec<u32> {
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
            let most = |near: &Near| near.within.max(near.generous_guess().unwrap_or(0.0));
            let most = self.asked().map(most).fold(0.0, f64::max);
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
    pub(super) fn seen_where_moved(&self) -> Vec<usize> {
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
    pub(super) fn overlooked(&self, listed: &[Listed]) -> Vec<usize> {
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
    pub(super) fn ranks(&self, listed: &[Listed], overlooked: &[usize]) -> BTreeMap<usize, usize> {
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
        // Within a disc, what is between the corners is no nearer to its edge than one of them.
        let inside = match &source.lens_edge {
            None => inside,
            Some(edge) => [a, b, c]
                .into_iter()
                .map(|corner| edge.distance_px(corner))
                .fold(inside, f64::min),
        };
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
