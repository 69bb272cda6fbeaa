//! Which layered depth images show what is beyond a portal, by where one stands before it.
//!
//! Gortler, He and Cohen 1997 keep one LDI of the few images in a cache that are best for the
//! current camera. Here some places of a semicircle have an LDI each, of the views nearest to it, and the eye's
//! angle before the portal says which is shown. We differ in two things. The choice is a function of the
//! eye's place alone, not of when a thread was ready, and between two such places there is an angle in which
//! both LDIs are drawn and mixed, so that nothing pops. And all LDIs of a side are in the camera of
//! its middle view, not of the nearest one: seen from aside a portal is narrow, and so are samples' patches
//! across it.

use std::ops::Range;

/// The LDIs that show what is beyond a portal to an eye, by their places.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shown {
    /// The place that the LDI is for.
    pub place: usize,
    /// That of another that is mixed in, and its share, above 0 and below 1.
    pub other: Option<(usize, f64)>,
}

impl Shown {
    /// An LDI alone.
    pub(super) fn alone(place: usize) -> Self {
        Self { place, other: None }
    }

    /// One, or both.
    pub fn places(self) -> impl Iterator<Item = usize> {
        [Some(self.place), self.other.map(|(place, _)| place)]
            .into_iter()
            .flatten()
    }
}

/// Where two LDIs are drawn, in shares of the angle between their places: the less, the faster.
const BAND: f64 = 0.3;

/// Those of a side's places that have an LDI of so many views, from left to right. Neighbours share the view
/// that is as far from one as from the other.
pub(super) fn places(side: &Range<usize>, count: usize) -> Vec<usize> {
    let count = count.max(1);
    let stride = (count - 1).max(1);
    // Of views to the left of a place, and to its right.
    let [to_left, to_right] = [count / 2, count - 1 - count / 2];
    let mut places: Vec<usize> = side.clone().collect();
    places.retain(|place| place.abs_diff(middle(side)).is_multiple_of(stride));
    // Where views are left over at the ends.
    if places
        .first()
        .is_some_and(|first| first - side.start > to_left)
    {
        places.insert(0, side.start);
    }
    if places
        .last()
        .is_some_and(|last| side.end - 1 - last > to_right)
    {
        places.push(side.end - 1);
    }
    places
}

/// Which LDIs an eye sees at an angle before the portal, of those at some angles, from left to right;
/// beyond the outermost, that one.
///
/// # Panics
/// If there are none.
pub(super) fn shown(places: &[usize], angle: impl Fn(usize) -> f64, eye_angle: f64) -> Shown {
    let right = places.partition_point(|place| angle(*place) <= eye_angle);
    if right == 0 || right == places.len() {
        return Shown::alone(places[right.saturating_sub(1)]);
    }
    let [left, right] = [places[right - 1], places[right]];
    let along = (eye_angle - angle(left)) / (angle(right) - angle(left));
    let share = (along - 0.5) / BAND + 0.5;
    if share > 0.0 && share < 1.0 {
        Shown {
            place: left,
            other: Some((right, share)),
        }
    } else if share >= 1.0 {
        Shown::alone(right)
    } else {
        Shown::alone(left)
    }
}

/// The middle one of a side's places: that of the camera of its LDIs.
pub(super) fn middle(side: &Range<usize>) -> usize {
    side.start + side.len() / 2
}

/// So many of a side's places, at least one, that are nearest to one of them, and the middle one, which every
/// LDI has for its central image; from left to right.
pub(super) fn views(side: &Range<usize>, place: usize, count: usize) -> Vec<usize> {
    let count = count.clamp(1, side.len().max(1));
    let first = place.saturating_sub(count / 2).max(side.start);
    let first = first.min(side.end.saturating_sub(count));
    let mut views: Vec<usize> = (first..first + count).collect();
    if let Err(at) = views.binary_search(&middle(side)) {
        views.insert(at, middle(side));
    }
    views
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_go_from_place_to_place_without_a_step() {
        let places = [1, 3, 4];
        let angle = |place: usize| 0.2 * place as f64;
        let weights = |eye_angle: f64| {
            let shown = shown(&places, angle, eye_angle);
            let mut weights = [0.0; 5];
            let share = shown.other.map_or(0.0, |(_, share)| share);
            weights[shown.place] += 1.0 - share;
            if let Some((other, share)) = shown.other {
                weights[other] += share;
            }
            weights
        };
        let step = 1e-4;
        for i in -3000..11000 {
            let [a, b] = [i, i + 1].map(|i| weights(step * f64::from(i)));
            for (a, b) in a.iter().zip(b) {
                // A slope of one over the band.
                assert!((a - b).abs() <= 1.001 * step / (0.2 * BAND), "{i}");
            }
        }
        for place in places {
            assert_eq!(shown(&places, angle, angle(place)), Shown::alone(place));
        }
        assert_eq!(shown(&places, angle, -9.0), Shown::alone(1));
        assert_eq!(shown(&places, angle, 9.0), Shown::alone(4));
        assert_eq!(shown(&places, angle, 0.4).other.unwrap().0, 3);
        assert_eq!(shown(&places[..1], angle, 0.3), Shown::alone(1));
        // A semicircle of no span.
        assert_eq!(shown(&places, |_| 0.0, 0.0).other, None);
    }

    #[test]
    fn ldis_of_more_views_are_fewer_and_leave_none_out() {
        assert_eq!(places(&(13..26), 3), [13, 15, 17, 19, 21, 23, 25]);
        assert_eq!(places(&(13..26), 5), [15, 19, 23]);
        assert_eq!(places(&(13..26), 8), [13, 19, 25]);
        assert_eq!(places(&(13..26), 13), [19]);
        for count in [0, 1, 2] {
            assert_eq!(places(&(13..26), count).len(), 13);
        }
        for count in 0..40 {
            let all = places(&(13..26), count);
            let seen = |i: &usize| all.iter().any(|p| views(&(13..26), *p, count).contains(i));
            assert!((13..26).all(|i| seen(&i)), "{count}");
        }
        assert_eq!(places(&(4..5), 3), [4]);
        assert_eq!(places(&(4..5), usize::MAX), [4]);
    }

    #[test]
    fn the_nearest_views_are_of_one_side_and_the_middle_one_is_among_them() {
        let views = |place, count| views(&(13..26), place, count);
        assert_eq!(views(19, 3), [18, 19, 20]);
        assert_eq!(views(13, 3), [13, 14, 15, 19]);
        assert_eq!(views(25, 5), [19, 21, 22, 23, 24, 25]);
        assert_eq!(views(14, 1), [14, 19]);
        assert_eq!(views(21, 0), [19, 21]);
        assert_eq!(views(20, 99), (13..26).collect::<Vec<_>>());
    }
}
