//! Line segments of a map, found by its squares.

use glam::DVec2;
use std::collections::BTreeMap;

/// As many squares' sides, more or less, as all segments together are long, at most; longer ones
/// have larger squares. More segments are then looked at for a step, and the same ones are in the
/// way. A house has thousands.
const MOST_SIDES: f64 = 262_144.0;
/// So many squares lie between the map's origin and any segment, at most: their numbers are `i32`.
const MOST_AWAY: f64 = 1e9;
/// Nothing is farther away than this: sums of lengths stay finite.
const FARTHEST: f64 = 1e100;

/// Segments by square of the map.
#[derive(Clone, Debug)]
pub(super) struct Squares {
    side: f64,
    /// What is nearer to a square than this is found from it.
    radius: f64,
    segments: BTreeMap<(i32, i32), Vec<[DVec2; 2]>>,
}

impl Squares {
    /// Squares of a side of four radii, unless segments are so long, or so far away, that there
    /// would be too many.
    pub(super) fn new(mut segments: Vec<[DVec2; 2]>, radius: f64) -> Self {
        let is_near = |p: &DVec2| p.abs().cmplt(DVec2::splat(FARTHEST)).all();
        segments.retain(|ends| ends.iter().all(is_near));
        // Triangles of two cells, and walls cut at several heights.
        segments.sort_by_key(|ends| ends.map(key));
        segments.dedup();
        let lengths = segments.iter().map(|[a, b]| (*b - *a).abs().element_sum());
        let length: f64 = lengths.sum();
        let away = segments.iter().flatten().map(|p| p.abs().max_element());
        let away = away.fold(0.0, f64::max);
        let mut squares = Self {
            side: (4.0 * radius)
                .max(length / MOST_SIDES)
                .max(away / MOST_AWAY),
            radius,
            segments: BTreeMap::new(),
        };
        for ends in segments {
            squares.insert(ends);
        }
        squares
    }

    /// Row by row, into the squares beside the part of it that is beside the row.
    fn insert(&mut self, ends: [DVec2; 2]) {
        let [a, b] = ends;
        let along = b - a;
        let first = self.number(a.y.min(b.y) - self.radius);
        let last = self.number(a.y.max(b.y) + self.radius);
        for row in first..=last {
            let low = f64::from(row) * self.side - self.radius;
            let high = low + self.side + 2.0 * self.radius;
            let at = |y: f64| a.x + along.x * ((y - a.y) / along.y).clamp(0.0, 1.0);
            let [from, to] = match along.y == 0.0 {
                true => [a.x, b.x],
                false => [at(low), at(high)],
            };
            let left = self.number(from.min(to) - self.radius);
            let right = self.number(from.max(to) + self.radius);
            for column in left..=right {
                let list = self.segments.entry((column, row)).or_default();
                list.push(ends);
            }
        }
    }

    fn number(&self, v: f64) -> i32 {
        (v / self.side).floor() as i32
    }

    /// All segments that are within the radius of a point, and others.
    pub(super) fn near(&self, point: DVec2) -> &[[DVec2; 2]] {
        let square = (self.number(point.x), self.number(point.y));
        self.segments.get(&square).map_or(&[], Vec::as_slice)
    }
}

/// Something to sort by that is the same wherever bits are.
fn key(point: DVec2) -> [u64; 2] {
    [point.x.to_bits(), point.y.to_bits()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::TAU;

    const RADIUS: f64 = 0.25;

    fn count(squares: &Squares) -> usize {
        squares.segments.values().map(Vec::len).sum()
    }

    #[test]
    fn long_segments_are_in_few_squares() {
        // Five metres in millimetres, aslant.
        let aslant = [DVec2::ZERO, DVec2::splat(3_536.0)];
        let squares = Squares::new(vec![aslant], RADIUS);
        assert_eq!(squares.side, 4.0 * RADIUS);
        assert!(count(&squares) < 20_000, "{}", count(&squares));
        // Farther than squares of this side can be numbered.
        for reach in [1e10, 1e18, 1e99] {
            let vast = [DVec2::splat(-reach), DVec2::new(reach, 0.5 * reach)];
            let squares = Squares::new(vec![vast, aslant], RADIUS);
            assert!(count(&squares) < 1_000_000, "{}", count(&squares));
            for way in [0.0, 0.3, 0.7, 1.0] {
                let on = vast[0].lerp(vast[1], way);
                assert!(squares.near(on).contains(&vast), "{reach} {way}");
            }
            assert!(squares.near(DVec2::splat(1.0)).contains(&aslant));
        }
        let endless = [DVec2::ZERO, DVec2::new(f64::INFINITY, f64::NAN)];
        assert_eq!(count(&Squares::new(vec![endless], RADIUS)), 0);
    }

    #[test]
    fn segments_along_the_axes_are_in_the_squares_about_them() {
        let along_x = [DVec2::new(0.4, 0.5), DVec2::new(3.5, 0.5)];
        let along_y = [DVec2::new(0.9, 3.5), DVec2::new(0.9, 0.4)];
        let numbers = |segment| {
            let squares = Squares::new(vec![segment], RADIUS);
            squares.segments.into_keys().collect::<Vec<_>>()
        };
        assert_eq!(numbers(along_x), [(0, 0), (1, 0), (2, 0), (3, 0)]);
        let both = [0, 1].map(|x| [0, 1, 2, 3].map(|y| (x, y)));
        assert_eq!(numbers(along_y), both.as_flattened());
    }

    proptest! {
        #[test]
        fn what_is_within_the_radius_is_found(
            corners in prop::collection::vec(prop::array::uniform4(-20.0..20.0), 1..8),
            way in 0.0..1.0,
            angle in 0.0..TAU,
            distance in 0.0..0.999 * RADIUS,
        ) {
            let segment = |&[x, y, z, w]: &[f64; 4]| [DVec2::new(x, y), DVec2::new(z, w)];
            let segments: Vec<[DVec2; 2]> = corners.iter().map(segment).collect();
            let squares = Squares::new(segments.clone(), RADIUS);
            for ends in segments {
                let point = ends[0].lerp(ends[1], way) + distance * DVec2::from_angle(angle);
                prop_assert!(squares.near(point).contains(&ends));
            }
        }
    }
}
