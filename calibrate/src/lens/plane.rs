//! Brown–Conrady with a rational radial term and thin prisms, on the plane z = 1: OpenCV's
//! formula.

use super::invert::{invert_monotone, invert_on_disc, scan};
use glam::{DMat2, DVec2};

/// The distorted point and the Jacobian of the mapping.
#[inline]
pub(super) fn rational(point: DVec2, k: &[f64; 6], p: &[f64; 2]) -> (DVec2, DMat2) {
    let r2 = point.length_squared();
    let above = 1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[2]));
    let below = 1.0 + r2 * (k[3] + r2 * (k[4] + r2 * k[5]));
    let radial = above / below;
    // d radial / d r²
    let d_above = k[0] + r2 * (2.0 * k[1] + r2 * 3.0 * k[2]);
    let d_below = k[3] + r2 * (2.0 * k[4] + r2 * 3.0 * k[5]);
    let slope = (d_above - radial * d_below) / below;
    let (shift, d_shift) = tangential(point, p);
    (
        point * radial + shift,
        radial_jacobian(point, radial, slope) + d_shift,
    )
}

/// The Jacobian of x ↦ x·radial(r²), where `slope` is d radial / d r².
#[inline]
pub(super) fn radial_jacobian(point: DVec2, radial: f64, slope: f64) -> DMat2 {
    let DVec2 { x, y } = point;
    let xy = 2.0 * x * y * slope;
    DMat2::from_cols(
        DVec2::new(radial + 2.0 * x * x * slope, xy),
        DVec2::new(xy, radial + 2.0 * y * y * slope),
    )
}

/// The tangential terms, (2p₁xy + p₂(r² + 2x²), 2p₂xy + p₁(r² + 2y²)), and their Jacobian.
///
/// That is 2(q·x)I + 2(qxᵀ + xqᵀ) with q = (p₂, p₁): symmetric, its eigenvalues at least
/// −6|q|r.
#[inline]
pub(super) fn tangential(point: DVec2, p: &[f64; 2]) -> (DVec2, DMat2) {
    let DVec2 { x, y } = point;
    let r2 = x * x + y * y;
    let dxy = 2.0 * p[0] * x + 2.0 * p[1] * y;
    (
        DVec2::new(
            2.0 * p[0] * x * y + p[1] * (r2 + 2.0 * x * x),
            2.0 * p[1] * x * y + p[0] * (r2 + 2.0 * y * y),
        ),
        DMat2::from_cols(
            DVec2::new(2.0 * p[0] * y + 6.0 * p[1] * x, dxy),
            DVec2::new(dxy, 2.0 * p[1] * x + 6.0 * p[0] * y),
        ),
    )
}

/// Thin prisms, (s₁r² + s₂r⁴, s₃r² + s₄r⁴), and their Jacobian: 2a·xᵀ with
/// a = (s₁ + 2s₂r², s₃ + 2s₄r²), of whose symmetric part the eigenvalues are at least
/// −2|a|r.
#[inline]
pub(super) fn prism(point: DVec2, s: &[f64; 4]) -> (DVec2, DMat2) {
    let r2 = point.length_squared();
    let (once, twice) = (DVec2::new(s[0], s[2]), DVec2::new(s[1], s[3]));
    let a = once + 2.0 * r2 * twice;
    let jacobian = DMat2::from_cols(a * (2.0 * point.x), a * (2.0 * point.y));
    (r2 * (once + r2 * twice), jacobian)
}

/// What the least eigenvalue of the tangential and the prism terms' Jacobians together is
/// above, negated, where r is at most that long; divided by r.
pub(super) fn sideways_bound(r: f64, p: &[f64; 2], s: &[f64; 4]) -> f64 {
    let (once, twice) = (s[0].hypot(s[2]), s[1].hypot(s[3]));
    6.0 * p[0].hypot(p[1]) + 2.0 * (once + 2.0 * r * r * twice)
}

/// [`rational`] with thin prisms.
#[inline]
pub(super) fn rational_prism(
    point: DVec2,
    k: &[f64; 6],
    p: &[f64; 2],
    s: &[f64; 4],
) -> (DVec2, DMat2) {
    let (without, d_without) = rational(point, k, p);
    let (shift, d_shift) = prism(point, s);
    (without + shift, d_without + d_shift)
}

/// r·radial(r²) and its derivative: the model along a radius.
fn rational_radius(r: f64, k: &[f64; 6]) -> (f64, f64) {
    let (point, jacobian) = rational(DVec2::new(r, 0.0), k, &[0.0; 2]);
    (point.x, jacobian.x_axis.x)
}

/// The radius up to which [`rational_prism`] is one to one; infinite where it is so throughout.
///
/// The radial terms' Jacobian is symmetric, with the eigenvalues f/r and f'; the others are
/// bounded by [`sideways_bound`]. Where the sum is positive definite on a disc, which is
/// convex, the mapping is one to one there.
pub(super) fn limit(k: &[f64; 6], p: &[f64; 2], s: &[f64; 4]) -> f64 {
    if always_grows(k, p, s) {
        return f64::INFINITY;
    }
    let grows = |r: f64| {
        let (value, slope) = rational_radius(r, k);
        slope.min(value / r) > sideways_bound(r, p, s) * r
    };
    // 1. To 88.9° off the axis, in small steps.
    const NEAR: f64 = 50.0;
    let near = scan(NEAR, 20_000, f64::INFINITY, grows);
    if near.is_finite() {
        return near;
    }
    // 2. To within a millionth of a degree of 90°, in steps of 1 %: small coefficients fold the image
    // there, and what is beyond would come back into its middle.
    let radius = |steps: f64| NEAR * (0.01 * steps).exp();
    let far = scan(1450.0, 1450, f64::INFINITY, |steps| grows(radius(steps)));
    // Infinity stays what it is.
    radius(far)
}

/// Whether it is plain that a mapping is one to one throughout: looking for the radius up to which it is takes
/// long then, as there is none. The eigenvalues are 1 + k₁r² or more, which is 2√k₁·r or more.
fn always_grows(k: &[f64; 6], p: &[f64; 2], s: &[f64; 4]) -> bool {
    // Powers of the largest radius are numbers, too.
    let usual = k.iter().all(|k| (0.0..1e9).contains(k));
    let sideways = sideways_bound(0.0, p, s);
    // By far more than rounding.
    usual && k[3..] == [0.0; 3] && *s == [0.0; 4] && sideways * sideways <= 3.9 * k[0]
}

/// The point that [`rational_prism`] maps to a distorted one.
pub(super) fn invert(
    distorted: DVec2,
    k: &[f64; 6],
    p: &[f64; 2],
    s: &[f64; 4],
    limit: f64,
) -> Option<DVec2> {
    // The radial terms alone are a problem of one dimension and have a sure answer.
    let only_radial = *p == [0.0; 2] && *s == [0.0; 4];
    let radius = distorted.length();
    let start = match invert_monotone(radius, limit, |r| rational_radius(r, k)) {
        Some(undistorted) if radius > 0.0 => distorted * (undistorted / radius),
        Some(_) => distorted,
        // The others may still bring the point within reach.
        None if !only_radial && limit.is_finite() => distorted * (limit / radius),
        None => return None,
    };
    if only_radial {
        return Some(start);
    }
    invert_on_disc(distorted, start, limit, |x| rational_prism(x, k, p, s))
}

/// A bound of the second derivative along any line within a radius, without terms below the bar. Along
/// a line with the direction u, p·r²ⁱ has 2u·(r²ⁱ)' + p·(r²ⁱ)'', and (r²)' ≤ 2r, (r²)'' = 2; so it is
/// (2i + 1)·2i·r²ⁱ⁻¹ at most.
pub(super) fn bend(k: &[f64], p: &[f64; 2], radius: f64) -> f64 {
    let radial = |(i, k): (i32, &f64)| {
        let power = 2 * i;
        f64::from(power * (power + 1)) * k.abs() * radius.powi(power - 1)
    };
    // 2xy has 4uₓuᵧ ≤ 2, and r² + 2x² has 2 + 4uₓ² ≤ 6: of both coordinates no more than 8.
    let tangential = 8.0 * (p[0].abs() + p[1].abs());
    (1..).zip(k).map(radial).sum::<f64>() + tangential
}

#[cfg(test)]
mod tests {
    use super::super::difference;
    use super::*;

    #[test]
    fn what_plainly_grows_always_is_found_to() {
        let scanned = |k: &[f64; 6], p: &[f64; 2]| {
            let grows = |r: f64| {
                let (value, slope) = rational_radius(r, k);
                slope.min(value / r) > sideways_bound(r, p, &[0.0; 4]) * r
            };
            let places = (1..2000).map(|step| 1e-4 * (0.0135 * f64::from(step)).exp());
            places.into_iter().all(grows)
        };
        for k1 in [0.0_f64, 1e-9, 0.004, 0.05, 2.0, 9e8] {
            for k2 in [0.0, 1e-7, 0.3] {
                let k = [k1, k2, 0.1 * k2, 0.0, 0.0, 0.0];
                // The most that is plain, and somewhat more than may be.
                let most = (3.9 * k1).sqrt() / 6.0;
                for p in [[0.0, 0.0], [0.999 * most, 0.0], [0.6 * most, -0.7 * most]] {
                    assert!(always_grows(&k, &p, &[0.0; 4]), "{k1} {k2} {p:?}");
                    assert!(scanned(&k, &p), "{k1} {k2} {p:?}");
                }
                assert!(!always_grows(&k, &[1.1 * most + 1e-9, 0.0], &[0.0; 4]));
            }
        }
        assert!(!always_grows(
            &[0.1, -0.01, 0.0, 0.0, 0.0, 0.0],
            &[0.0; 2],
            &[0.0; 4]
        ));
        assert!(!always_grows(
            &[0.1, 0.01, 0.0, 0.1, 0.0, 0.0],
            &[0.0; 2],
            &[0.0; 4]
        ));
    }

    #[test]
    fn derivatives_meet_finite_differences() {
        let k = [-0.3, 0.1, -0.02, 0.2, 0.05, -0.01];
        let p = [0.01, -0.02];
        let s = [0.02, -0.01, -0.03, 0.005];
        for x in [-0.9, -0.2, 0.0, 0.35, 0.7] {
            for y in [-0.6, 0.0, 0.15, 0.8] {
                let at = DVec2::new(x, y);
                let expected = difference(|point| rational_prism(point, &k, &p, &s).0, at);
                let found = rational_prism(at, &k, &p, &s).1;
                let close = (found - expected).to_cols_array();
                assert!(
                    close.iter().all(|e| e.abs() < 1e-8),
                    "at {at}: {found} instead of {expected}"
                );
            }
        }
    }
}
