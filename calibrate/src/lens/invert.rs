//! Where a mapping stops being one to one, and its inverse up to there.

use glam::{DMat2, DVec2};

/// Newton's method stops when a step is this small (normalised coordinates), or fails.
const STEP_TOLERANCE: f64 = 1e-15;
const MAX_STEPS: usize = 50;
/// Newton's method inside a bracket may need to double its way out of a pole, or bisect
/// all bits of the bracket.
const MAX_BRACKETED_STEPS: usize = 200;
/// A root is believed when the distorted point returns to within this.
const RESIDUAL_TOLERANCE: f64 = 1e-12;

/// How far from 0 a mapping grows; `at_end` if as far as `end`.
///
/// It is scanned in small steps for the first place where it stops growing (a pole shows as
/// a slope or a value that is not positive), and that place is then bisected.
pub(super) fn scan(end: f64, steps: u32, at_end: f64, grows: impl Fn(f64) -> bool) -> f64 {
    let mut good = 0.0;
    for step in 1..=steps {
        let r = end * f64::from(step) / f64::from(steps);
        if grows(r) {
            good = r;
            continue;
        }
        let mut bad = r;
        for _ in 0..60 {
            let middle = 0.5 * (good + bad);
            if grows(middle) {
                good = middle
            } else {
                bad = middle
            }
        }
        return good;
    }
    at_end
}

/// Solves f(x) = value for x in [0, limit] where f grows from 0 and returns its slope too:
/// Newton's method kept inside a shrinking bracket, so it cannot run away.
pub(super) fn invert_monotone(
    value: f64,
    limit: f64,
    f: impl Fn(f64) -> (f64, f64),
) -> Option<f64> {
    let mut low = 0.0;
    let mut high = if limit.is_finite() {
        limit
    } else {
        // Find some radius beyond the value.
        let mut high = value.max(1.0);
        while f(high).0 < value {
            high *= 2.0;
            if high > 1e9 {
                return None;
            }
        }
        high
    };
    let reachable = f(high).0;
    if value > reachable {
        // The image's corners often lie a rounding error beyond the fold.
        return (value <= reachable * (1.0 + 1e-12)).then_some(high);
    }
    let mut x = if value < high {
        value
    } else {
        0.5 * (low + high)
    };
    for _ in 0..MAX_BRACKETED_STEPS {
        let (fx, slope) = f(x);
        if (fx - value).abs() <= f64::EPSILON * value {
            return Some(x);
        }
        if fx > value {
            high = x
        } else {
            low = x
        }
        let newton = x - (fx - value) / slope;
        // Close to a pole Newton's steps are tiny though the root is far: a step that
        // changes nothing ends the search only where the value is met, and gives way to
        // bisection, which ends with the bracket, elsewhere.
        let moves = (newton - x).abs() > 4.0 * f64::EPSILON * x;
        let near = (fx - value).abs() <= RESIDUAL_TOLERANCE * (1.0 + value);
        if near && !moves {
            return Some(newton.clamp(0.0, limit));
        }
        let next = if newton > low && newton < high && moves {
            newton
        } else {
            0.5 * (low + high)
        };
        if (next - x).abs() <= f64::EPSILON * x {
            x = next;
            break;
        }
        x = next;
    }
    // Believe it only where it gives the value.
    let found = (f(x).0 - value).abs() <= RESIDUAL_TOLERANCE * (1.0 + value);
    found.then_some(x)
}

/// Solves map(x) = value on the disc of radius `limit`, in which the map is one to one, by
/// Newton's method. The map returns its Jacobian too.
pub(super) fn invert_on_disc(
    value: DVec2,
    start: DVec2,
    limit: f64,
    map: impl Fn(DVec2) -> (DVec2, DMat2),
) -> Option<DVec2> {
    // 1. Newton's steps, halved while they do not help.
    let mut x = start;
    let (mut mapped, mut jacobian) = map(x);
    let mut error = (mapped - value).length();
    for _ in 0..MAX_STEPS {
        if jacobian.determinant() == 0.0 {
            return None;
        }
        let mut step = jacobian.inverse() * (value - mapped);
        let mut next = map(x + step);
        let off = |next: &(DVec2, DMat2)| (next.0 - value).length();
        let mut halvings = 0;
        while !(off(&next) <= error) && halvings < 30 {
            step *= 0.5;
            next = map(x + step);
            halvings += 1;
        }
        if !(off(&next) <= error) {
            break;
        }
        x += step;
        error = off(&next);
        (mapped, jacobian) = next;
        if step.length() <= STEP_TOLERANCE * (1.0 + x.length()) {
            break;
        }
    }
    // 2. Believe it only where it gives the value, on the near side of the fold.
    let found = error <= RESIDUAL_TOLERANCE * (1.0 + value.length())
        && x.length() <= limit
        && jacobian.determinant() > 0.0;
    found.then_some(x)
}
