//! Which source views a triangle carries, and with what.

use super::triangle::{Listed, Sees, Triangle};
use super::vertex::Vertex;
use super::{FieldEntry, MAX_LISTED};
use crate::blend::Contributor;
use crate::frame::Frame;

/// How much of a view's weight may come or go between a triangle's corners.
const TURNOVER: f64 = 0.5;

/// The source views of one triangle.
pub(super) struct List {
    pub(super) entries: Vec<FieldEntry>,
    pub(super) bordered: bool,
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
        let triangle = Triangle::new(frame, corners, [a, b, c], ends_with_lens);
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
