//! What a photo, or a distance map, may give around a place.

use super::interval::Interval;
use crate::cpu::scalar::Scalar;
use crate::pyramid::Pyramid;
use crate::visibility::{DistanceMap, FADE, TOLERANCE, visible};

/// Texels across and down that are looked at singly; a larger part may be anything.
const MOST_CELLS: f64 = 6.0;

/// How a device filters.
#[derive(Clone, Copy)]
pub(super) struct Filter {
    /// By how much it may be beside, in texels and in levels.
    pub beside: f64,
    /// By how much a filtered value may be off, in steps of 255.
    pub steps: f64,
}

/// A photo's colours around a place: premultiplied, 0…255.
pub(super) fn sample<const N: u32>(
    photo: &Pyramid,
    [u, v]: [Interval<N>; 2],
    level: Interval<N>,
    filter: Filter,
) -> [Interval<N>; 4] {
    let any = [Interval::new(0.0, 255.0); 4];
    let last = (photo.levels.len() - 1) as f64;
    let level = level.wider(filter.beside);
    let level = level.within(photo.finest as f64, last);
    let mut all: Option<[Interval<N>; 4]> = None;
    let mut lower = level.lo.floor();
    while lower <= level.hi {
        let share = Interval::<N>::new((level.lo - lower).max(0.0), (level.hi - lower).min(1.0));
        let of = |level: f64| {
            let image = &photo.levels[level as usize];
            let texel = |x: u32, y: u32| image.get_pixel(x, y).0.map(f64::from);
            let scale = Interval::<N>::of(0.5_f32.powi(level as i32));
            bilinear(image.dimensions(), [u * scale, v * scale], filter, texel)
        };
        let Some(fine) = of(lower) else { return any };
        let here = if share.hi > 0.0 && lower < last {
            let Some(coarse) = of(lower + 1.0) else {
                return any;
            };
            std::array::from_fn(|c| fine[c] + (coarse[c] - fine[c]) * share)
        } else {
            fine
        };
        all = Some(all.map_or(here, |all| std::array::from_fn(|c| all[c].with(here[c]))));
        lower += 1.0;
    }
    all.map_or(any, |all| {
        all.map(|value| value.wider(filter.steps).within(0.0, 255.0))
    })
}

/// At a place in texels; `None` where that may be anywhere.
fn bilinear<const N: u32, const C: usize>(
    (width, height): (u32, u32),
    [x, y]: [Interval<N>; 2],
    filter: Filter,
    texel: impl Fn(u32, u32) -> [f64; C],
) -> Option<[Interval<N>; C]> {
    // Beyond the border there is only the border. As the engine has it: from half a texel after,
    // which is rounded, a whole one back, which is not.
    let inside = |at: Interval<N>, side: u32| {
        let Interval { lo, hi } = at + Interval::of(0.5);
        let at = Interval::<N>::new(lo - 1.0, hi - 1.0).wider(filter.beside);
        at.within(-0.5, f64::from(side) - 0.5)
    };
    let (x, y) = (inside(x, width), inside(y, height));
    if !(x.hi - x.lo < MOST_CELLS && y.hi - y.lo < MOST_CELLS) {
        return None;
    }
    let mut all: Option<[Interval<N>; C]> = None;
    let cells = |at: Interval<N>| at.lo.floor() as i64..=at.hi.floor() as i64;
    for row in cells(y) {
        for column in cells(x) {
            let share = |at: Interval<N>, cell: i64| {
                let cell = cell as f64;
                Interval::<N>::new((at.lo - cell).max(0.0), (at.hi - cell).min(1.0))
            };
            let (fx, fy) = (share(x, column), share(y, row));
            let clamped = |i: i64, side: u32| i.clamp(0, i64::from(side) - 1) as u32;
            let at = |dx: i64, dy: i64| {
                let exact = texel(clamped(column + dx, width), clamped(row + dy, height));
                exact.map(|value| Interval::<N>::new(value, value))
            };
            let along = |a: [Interval<N>; C], b: [Interval<N>; C], share: Interval<N>| {
                std::array::from_fn(|c| a[c] + (b[c] - a[c]) * share)
            };
            let top = along(at(0, 0), at(1, 0), fx);
            let low = along(at(0, 1), at(1, 1), fx);
            let here: [Interval<N>; C] = along(top, low, fy);
            all = Some(all.map_or(here, |all| std::array::from_fn(|c| all[c].with(here[c]))));
        }
    }
    all
}

/// What is left of a photo's relevance where something may be before the point.
pub(super) fn shown<const N: u32>(
    map: &DistanceMap,
    [u, v]: [Interval<N>; 2],
    inverse_distance: Interval<N>,
    filter: Filter,
) -> Interval<N> {
    let [width, height] = map.size;
    let scale = Interval::rounded(1.0 / f64::from(map.reduction));
    let texel = |x: u32, y: u32| [f64::from(map.values[(y * width + x) as usize])];
    let nearest = bilinear((width, height), [u * scale, v * scale], filter, texel);
    let nearest = nearest.map_or_else(
        || {
            Interval::new(
                0.0,
                map.values.iter().fold(0.0_f32, |a, b| a.max(*b)).into(),
            )
        },
        |[nearest]| nearest,
    );
    let here = inverse_distance / Interval::rounded(map.unit);
    // It falls with what is before the point, and grows with how near that is. Differences of two
    // numbers that are rounded, over a small part of one: the margin.
    let margin = 16.0 * Interval::<N>::ERROR / (TOLERANCE * FADE);
    let at = |here: f64, nearest: f64| visible(here.max(0.0), nearest.max(0.0));
    let lo = at(here.lo * (1.0 - margin), nearest.hi * (1.0 + margin));
    let hi = at(here.hi * (1.0 + margin), nearest.lo * (1.0 - margin));
    Interval::new(lo, hi).after_rounding().within(0.0, 1.0)
}
