//! What the corners of a triangle know of source views, put together.

use crate::near::Near;

/// A source view that some corners of a triangle know of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Known {
    /// How little it differs at any corner, at least, if it sees anything of the triangle.
    pub(super) least: f64,
    pub(super) source_idx: u32,
    /// By corner: its place in what that knows; [`NOWHERE`] where it does not.
    pub(super) places: [u32; 3],
}

/// Not among what a corner knows.
pub(super) const NOWHERE: u32 = u32::MAX;

/// Views that are sorted at first: mostly no more are needed. Then as many again as there were so far.
const SORTED: usize = 24;

/// The views that three corners know of, in order. What is not among what one knows differs by `others` there,
/// at least.
pub(super) fn known(nears: [&Near; 3], others: [f64; 3]) -> Vec<Known> {
    let view_at = |c: usize, place: usize| nears[c].views.get(place).copied();
    let mut next = [0; 3];
    let mut heads = [0, 1, 2].map(|c| view_at(c, 0).unwrap_or(NOWHERE));
    let mut known = Vec::with_capacity(nears.iter().map(|near| near.views.len()).sum());
    loop {
        // The least of all that come next.
        let source_idx = heads[0].min(heads[1]).min(heads[2]);
        if source_idx == NOWHERE {
            return known;
        }
        let (mut least, mut places) = (f64::INFINITY, [NOWHERE; 3]);
        for c in 0..3 {
            let is_known = heads[c] == source_idx;
            let here = match is_known {
                true => nears[c].of_views[next[c]].0,
                false => others[c],
            };
            least = least.min(here);
            if is_known {
                places[c] = next[c] as u32;
                next[c] += 1;
                heads[c] = view_at(c, next[c]).unwrap_or(NOWHERE);
            }
        }
        known.push(Known {
            least,
            source_idx,
            places,
        });
    }
}

/// Those that may differ least come first; of those that may differ alike, in the order of the views.
pub(super) struct ByLeast {
    known: Vec<Known>,
    next: usize,
    /// So many are where they belong.
    sorted: usize,
}

impl ByLeast {
    pub(super) fn of(known: Vec<Known>) -> Self {
        Self {
            known,
            next: 0,
            sorted: 0,
        }
    }
}

impl Iterator for ByLeast {
    type Item = Known;

    fn next(&mut self) -> Option<Known> {
        if self.next == self.sorted {
            let order = |x: &Known, y: &Known| {
                let by_least = x.least.total_cmp(&y.least);
                by_least.then(x.source_idx.cmp(&y.source_idx))
            };
            let rest = &mut self.known[self.sorted..];
            let more = self.sorted.max(SORTED);
            let count = rest.len().min(more);
            if rest.len() > more {
                rest.select_nth_unstable_by(more, order);
            }
            rest[..count].sort_unstable_by(order);
            self.sorted += count;
        }
        let view = self.known.get(self.next).copied();
        self.next += usize::from(view.is_some());
        view
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(views: &[(u32, f64)]) -> Near {
        Near {
            views: views.iter().map(|view| view.0).collect(),
            of_views: views.iter().map(|view| (view.1, None)).collect(),
            ..Near::default()
        }
    }

    #[test]
    fn views_come_in_order_of_how_little_they_may_differ() {
        let a = near(&[(2, 0.5), (7, 0.1), (9, 0.3)]);
        let b = near(&[(2, 0.2), (9, 0.3)]);
        let c = near(&[]);
        let by_least: Vec<Known> = ByLeast::of(known([&a, &b, &c], [0.4, 0.25, 0.9])).collect();
        let told = |view: &Known| (view.source_idx, view.least, view.places);
        let expected = [
            (7, 0.1, [1, NOWHERE, NOWHERE]),
            (2, 0.2, [0, 0, NOWHERE]),
            (9, 0.3, [2, 1, NOWHERE]),
        ];
        assert_eq!(by_least.iter().map(told).collect::<Vec<_>>(), expected);
    }

    #[test]
    fn many_views_come_in_the_same_order_as_when_all_are_sorted() {
        // Some of them differ alike.
        let views = |step: u32| (0..200).map(move |i| (i * step, f64::from(i * 37 % 61)));
        let nears = [1, 2, 3].map(|step| near(&views(step).collect::<Vec<_>>()));
        let known = known(nears.each_ref(), [70.0; 3]);
        let by_least: Vec<Known> = ByLeast::of(known.clone()).collect();
        assert!(known.is_sorted_by(|x, y| x.source_idx < y.source_idx));
        let mut sorted = known.clone();
        sorted.sort_by(|x, y| x.least.total_cmp(&y.least));
        assert_eq!(by_least, sorted);
        let has = |i: u32| {
            known
                .binary_search_by_key(&i, |view| view.source_idx)
                .is_ok()
        };
        assert!((0..200).all(|i| [1, 2, 3].iter().all(|step| has(i * step))));
    }
}
