//! The exact field at a point of the proxy, from the source views that can count there.

use crate::blend::{Candidate, Contributor, SAME_RAY, blend};
use crate::frame::{Frame, ProxyPoint};
use crate::options::Resolution;
use crate::reference::candidate;
use crate::view_tree::{Around, Ball, Measure};
use calibrate::Pixel;
use glam::DVec3;

/// What there is to know about a point of the proxy without asking all source views.
#[derive(Clone, Debug, Default)]
pub(crate) struct Near {
    /// All that see the point and may have a weight there, in the order of the views.
    pub candidates: Vec<Candidate>,
    /// All views that differ by `within` or less at the point and may see something in sight of
    /// it, and a few more; in order.
    pub views: Vec<u32>,
    /// Of each of them, its difference and where the point falls in its photo or outside it.
    pub of_views: Vec<(f64, Option<Pixel>)>,
    /// Radians. No view that differs by more has a weight at the point.
    pub within: f64,
    /// The distance.
    pub sight: f64,
    /// What `within` need have been; zero where nothing is known of it.
    pub reach: f64,
    /// The least difference that weights count from.
    pub smallest: f64,
}

/// Source views that are asked before it is seen whether others may count, and again after so many more.
const FIRST_ASKED: usize = 6;
const THEN_ASKED: usize = 2;
/// From here on after a share of those that were asked, so that to see takes no longer than to ask.
const MANY_ASKED: usize = 128;

/// Whether to see, once so many were asked, whether others may count.
pub(crate) fn is_time_to_see(asked: usize) -> bool {
    let then = match asked {
        ..MANY_ASKED => THEN_ASKED,
        _ => THEN_ASKED << (asked / MANY_ASKED).ilog2(),
    };
    asked >= FIRST_ASKED && (asked - FIRST_ASKED).is_multiple_of(then)
}

impl Near {
    /// For a point nearby, of the difference that matters there. `None` where this one does not tell: at
    /// infinity, and where a view has the very ray.
    pub(crate) fn guess(&self) -> Option<f64> {
        (self.reach > SAME_RAY).then(|| self.beyond(MARGIN))
    }

    /// So many times as far from the smallest difference as it reaches. Where all that count differ alike, as where photos
    /// are coarser than the view, a difference half as large again finds several times as many views.
    fn beyond(&self, times: f64) -> f64 {
        let beyond = self.smallest + times * (self.reach - self.smallest);
        beyond.max(LEAST_MARGIN * self.reach)
    }

    /// A guess with room to spare, however alike all that count differ: for what lies beside the point.
    pub(crate) fn generous_guess(&self) -> Option<f64> {
        (self.reach > SAME_RAY).then_some(MARGIN * self.reach)
    }

    /// Lets go of what a point nearby needed and this one does not: triangles look at all that is left.
    pub(crate) fn let_go(&mut self) {
        let most = self.beyond(KEPT);
        if self.reach <= SAME_RAY || most >= self.within {
            return;
        }
        self.within = most;
        let mut of_views = self.of_views.iter();
        self.views
            .retain(|_| of_views.next().is_some_and(|(diff, _)| *diff <= most));
        self.of_views.retain(|(diff, _)| *diff <= most);
        self.candidates.retain(|c| c.diff <= most);
    }
}

/// From one guess to the next, and the last.
const WIDER: f64 = 3.0;
const WIDEST: f64 = 4.0;
/// A guess for the next point, over what this one needed; and what is kept of more than that.
const MARGIN: f64 = 1.2;
const KEPT: f64 = 1.5;
const LEAST_MARGIN: f64 = 1.05;

/// The difference to try after one within which too few views were found.
pub(crate) fn wider(within: f64) -> f64 {
    if within < WIDEST {
        WIDER * within.max(1e-6)
    } else {
        f64::INFINITY
    }
}

impl Frame<'_> {
    /// A difference to begin with, in radians: the more views there are, the nearer is the nearest.
    pub(crate) fn first_guess(&self) -> f64 {
        1.0 / (self.sources.len() as f64).sqrt()
    }

    /// The source views, in order, that may differ by `most` or less somewhere in a ball and may
    /// see something in sight of it; all that do are among them. All that take part where the ball
    /// is `None`: at infinity. They are about to be scored.
    pub(crate) fn views_within(&self, ball: Option<&Ball>, most: f64, found: &mut Vec<u32>) {
        match ball {
            Some(ball) => {
                self.view_tree().within(ball, self.measure(), most, found);
                self.note(ball, most, found);
                if !self.may_skip() {
                    found.sort_unstable();
                }
            }
            None => {
                found.clear();
                found.extend(self.taking_part().map(|i| i as u32));
                self.tally.note(found.iter().copied());
            }
        }
    }

    /// Counts the views that were found by bounds, of a difference of `most` or less somewhere in a ball, as scored.
    ///
    /// Where no view is to be passed over, each that takes part is asked, and counted, and those that bounds should not
    /// have ruled out are added at the end. There are none if bounds are true; and those that they do rule out must
    /// not be: what triangles list depends on what was found.
    fn note(&self, ball: &Ball, most: f64, found: &mut Vec<u32>) {
        if self.may_skip() {
            self.tally.note(found.iter().copied());
            return;
        }
        let mut known = found.clone();
        known.sort_unstable();
        let all: Vec<u32> = self.taking_part().map(|i| i as u32).collect();
        self.tally.note(all.iter().copied());
        let missed = all.into_iter().filter(|view| {
            self.may_count_in(ball, *view as usize, most) && known.binary_search(view).is_err()
        });
        found.extend(missed);
    }

    /// Whether a source view differs by `most` or less in the middle of a ball, and has it in its image.
    fn may_count_in(&self, ball: &Ball, source_idx: usize, most: f64) -> bool {
        let middle = ProxyPoint {
            ray: ball.center,
            inverse_distance: 1.0,
            plane: DVec3::ZERO,
        };
        let pixel = self.project(source_idx, &middle);
        let is_seen = pixel.is_some_and(|pixel| self.fov_blend(source_idx, pixel) >= 0.0);
        self.difference(source_idx, &middle) <= most && is_seen
    }

    /// The same views; those that may differ least come first. They are counted as scored, whoever is.
    pub(crate) fn views_by_least(&self, ball: Option<&Ball>, most: f64, found: &mut Vec<u32>) {
        let Some(ball) = ball else {
            return self.views_within(ball, most, found);
        };
        let (mut around, mut by_least) = (Around::default(), Vec::new());
        self.views_around(ball, most, &mut around);
        around.within(ball, self.measure(), most, &mut by_least);
        found.clear();
        found.extend(by_least.into_iter().map(|(_, i)| i));
        self.note(ball, most, found);
    }

    /// The same views, for parts of the ball to ask them: who scores some says so.
    pub(crate) fn views_around(&self, ball: &Ball, most: f64, found: &mut Around) {
        self.view_tree().around(ball, self.measure(), most, found);
    }

    pub(crate) fn measure(&self) -> Measure {
        Measure {
            beta: self.options.beta,
            by_length: self.options.resolution == Resolution::Length,
        }
    }

    /// What [`blend`](crate::blend::blend) needs at a point, exactly: with it the weights
    /// are those of all views. Views that see something within a distance of it, `sight`, are
    /// found, too. The guess is of the difference that matters: time depends on it, and which views
    /// are found besides those that count, but no weight.
    ///
    /// Views are asked for within a difference. Where those found make a threshold within it,
    /// others cannot count, as they could only lower it; else they are asked for again.
    pub(crate) fn near(&self, point: &ProxyPoint, sight: f64, guess: f64) -> Near {
        let ball = Ball::around(point, sight);
        let mut near = Near {
            within: if ball.is_some() { guess } else { f64::INFINITY },
            sight,
            ..Near::default()
        };
        loop {
            self.views_within(ball.as_ref(), near.within, &mut near.views);
            near.candidates.clear();
            near.of_views.clear();
            near.of_views.reserve(near.views.len());
            near.candidates.reserve(near.views.len());
            for &i in &near.views {
                let source_idx = i as usize;
                let pixel = self.project(source_idx, point);
                let diff = self.difference(source_idx, point);
                near.of_views.push((diff, pixel));
                let seen = pixel.and_then(|p| candidate(self, source_idx, point, p, || diff));
                near.candidates.extend(seen);
            }
            let (smallest, reach) = self.options.reach(&near.candidates);
            // Nor can more be found where it is no number.
            if !(reach > near.within) {
                if ball.is_some() && reach < f64::INFINITY {
                    near.reach = reach;
                    near.smallest = smallest;
                }
                return near;
            }
            near.within = if reach < f64::INFINITY {
                reach
            } else {
                wider(near.within)
            };
        }
    }

    /// The exact blending field at a proxy point, as [`crate::reference::blend_at`] has it, without
    /// asking all source views.
    pub fn blend_at(&self, point: &ProxyPoint) -> Vec<Contributor> {
        let near = self.near(point, 0.0, self.first_guess());
        blend(&near.candidates, &self.options)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is let go is what differs by much more than what counts, beside one another in all lists; and where all that
    /// count differ alike, a guess is not far beyond.
    #[test]
    fn what_a_neighbour_needed_and_a_point_does_not_is_let_go() {
        for (smallest, guess, kept) in [(0.0, 1.2, 7), (0.8, 1.05, 6), (1.0, 1.05, 5)] {
            // Every other one is out of its photo; the fourth is what is reached.
            let diffs = [smallest, 0.95, 0.97, 1.0, smallest, 1.09, 1.4, 1.6, 2.0];
            let candidate = |(diff, source_idx): (f64, usize)| Candidate {
                source_idx,
                diff,
                fov: 1.0,
                mask: 1.0,
            };
            let numbered = || diffs.into_iter().zip(0..);
            let seen = numbered().filter(|(_, i)| i % 2 == 0);
            let mut near = Near {
                candidates: seen.map(candidate).collect(),
                views: numbered().map(|(_, i)| i as u32).collect(),
                of_views: diffs.map(|diff| (diff, None)).to_vec(),
                within: 2.0,
                reach: 1.0,
                smallest,
                ..Near::default()
            };
            near.let_go();
            assert!((near.guess().unwrap() - guess).abs() < 1e-12);
            assert!(near.within >= near.guess().unwrap() && near.within < 2.0);
            assert_eq!(near.views.len(), kept, "{smallest}");
            let of_views = near.views.iter().zip(&near.of_views);
            for (view, (diff, _)) in of_views {
                assert_eq!(*diff, diffs[*view as usize]);
            }
            let is_kept = |i: usize| near.candidates.iter().any(|c| c.source_idx == i);
            for (diff, i) in numbered() {
                let within = diff <= near.within;
                assert_eq!(near.views.contains(&(i as u32)), within, "{smallest} {i}");
                assert_eq!(is_kept(i), within && i % 2 == 0, "{smallest} {i}");
            }
        }
        // A view that has the very ray tells nothing of others.
        let mut near = Near {
            within: 2.0,
            views: vec![3],
            of_views: vec![(1.5, None)],
            reach: SAME_RAY,
            ..Near::default()
        };
        near.let_go();
        assert_eq!((near.guess(), near.views.len()), (None, 1));
    }

    #[test]
    fn to_see_whether_others_count_takes_no_longer_than_to_ask() {
        for asked in [100, 1000, 20_000, 300_000] {
            let seen: usize = (0..asked).filter(|asked| is_time_to_see(*asked)).sum();
            assert!(seen > asked && seen < 150 * asked, "{asked}: {seen}");
        }
        let first: Vec<usize> = (0..12).filter(|asked| is_time_to_see(*asked)).collect();
        assert_eq!(first, [6, 8, 10]);
    }
}
