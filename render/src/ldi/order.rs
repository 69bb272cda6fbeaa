//! The order in which an LDI's pixels need no depths (McMillan and Bishop 1995; for LDIs Gortler et
//! al. 1997; Popescu et al. 1998, §3.2).
//!
//! A sample moves along the line through its pixel and the epipole, the desired centre as the
//! LDI's camera sees it. Of two that meet, the one nearer to the epipole is the nearer one where
//! the desired centre is in front of the camera, the farther one where it is behind. So pixels
//! are visited towards the epipole or away from it: in one, two or four sheets, beside, above
//! and below it. Samples in the epipole's own row and column may lie to each side of it: those
//! pixels come last or first. Layers go back to front.

use super::Layered;
use crate::interior::{Pinhole, Warp};
use crate::planted::{Fault, is_planted};
use std::ops::Range;

/// Rows, or columns, one after the other.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Run {
    /// Which.
    pub range: Range<u32>,
    /// From the last to the first.
    pub is_reversed: bool,
}

impl Run {
    /// In its order.
    pub fn iter(&self) -> impl Iterator<Item = u32> + use<> {
        let Range { start, end } = self.range.clone();
        let is_reversed = self.is_reversed;
        (start..end).map(move |i| if is_reversed { start + end - 1 - i } else { i })
    }
}

/// How to visit pixels: rows in order, and in each of them columns in order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Traversal {
    /// Any may be empty.
    pub rows: [Run; 3],
    /// Any may be empty.
    pub columns: [Run; 3],
}

impl Traversal {
    /// For a desired camera.
    pub fn new(ldi: &Layered, desired: &Pinhole) -> Self {
        let center = Warp::new(&ldi.camera, desired).center;
        let [width, height] = ldi.size();
        let is_in_front = center.z >= 0.0;
        let is_towards = is_in_front != is_planted(Fault::FrontToBack);
        let axis = |axis: usize, count: u32| {
            // At infinity it is before all or after all; 0/0, where nothing moves along the axis,
            // is wherever one likes.
            let at = center[axis] / center.z.abs();
            let at = if is_in_front { at } else { -at };
            let at = at * ldi.camera.focal[axis] + ldi.camera.principal[axis];
            let at = if at.is_nan() { 0.0 } else { at };
            runs(at, count, is_towards)
        };
        Self {
            columns: axis(0, width),
            rows: axis(1, height),
        }
    }
}

/// Pixels along an axis with the epipole at `at`.
fn runs(at: f64, count: u32, is_towards: bool) -> [Run; 3] {
    // As u32 saturates.
    let start = at.floor().clamp(0.0, f64::from(count)) as u32;
    let end = (at.floor() + 1.0).clamp(0.0, f64::from(count)) as u32;
    let run = |range: Range<u32>, is_reversed| Run { range, is_reversed };
    if is_towards {
        [
            run(0..start, false),
            run(end..count, true),
            run(start..end, false),
        ]
    } else {
        [
            run(start..end, false),
            run(0..start, true),
            run(end..count, false),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_pixel_once_and_the_epipoles_last_or_first() {
        for at in [
            -1e300, -3.0, -0.5, 0.0, 0.5, 3.0, 3.999, 7.0, 9.5, 10.0, 1e300,
        ] {
            for is_towards in [true, false] {
                let visited: Vec<u32> = runs(at, 10, is_towards)
                    .iter()
                    .flat_map(Run::iter)
                    .collect();
                let mut sorted = visited.clone();
                sorted.sort_unstable();
                assert_eq!(sorted, (0..10).collect::<Vec<_>>(), "{at}");
                let own = at.floor();
                if (0.0..10.0).contains(&own) {
                    let place = if is_towards { visited[9] } else { visited[0] };
                    assert_eq!(f64::from(place), own, "{at}");
                }
                // On each side the distance from the epipole falls, or grows.
                for side in [true, false] {
                    let far = |x: &&u32| (f64::from(**x) > own) == side;
                    let side: Vec<f64> = visited
                        .iter()
                        .filter(far)
                        .map(|x| (f64::from(*x) - own).abs())
                        .collect();
                    let falls = side.windows(2).all(|d| d[0] >= d[1]);
                    let grows = side.windows(2).all(|d| d[0] <= d[1]);
                    assert!(if is_towards { falls } else { grows }, "{at} {side:?}");
                }
            }
        }
    }
}
