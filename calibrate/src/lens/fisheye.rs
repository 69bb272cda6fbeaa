//! Fisheyes: polynomials in the angle from the axis, with tangential and thin-prism terms.
//!
//! Kannala and Brandt 2006 as OpenCV has it; COLMAP's `THIN_PRISM_FISHEYE` (the model of
//! ETH3D) and `RAD_TAN_THIN_PRISM_FISHEYE` (Meta's Project Aria). All of them distort the
//! point θ·(x, y)/|(x, y)|, whose distance from the origin is the angle θ.

use super::invert::{invert_monotone, invert_on_disc, scan};
use super::plane::{prism, radial_jacobian, sideways_bound, tangential};
use glam::{DMat2, DVec2};
use std::f64::consts::PI;

/// θ(1 + k₁θ² + k₂θ⁴ + …) and its derivative.
pub(super) fn polynomial<const N: usize>(theta: f64, k: &[f64; N]) -> (f64, f64) {
    let t2 = theta * theta;
    let (factor, d_factor) = even(t2, k);
    (theta * factor, factor + 2.0 * t2 * d_factor)
}

/// 1 + k₁θ² + k₂θ⁴ + … and its derivative by θ², from θ².
fn even<const N: usize>(t2: f64, k: &[f64; N]) -> (f64, f64) {
    let (mut value, mut slope) = (0.0, 0.0);
    for &coefficient in k.iter().rev() {
        slope = slope * t2 + value;
        value = value * t2 + coefficient;
    }
    (1.0 + t2 * value, value + t2 * slope)
}

/// The angle up to which the polynomial grows.
pub(super) fn polynomial_limit(k: &[f64; 4]) -> f64 {
    scan(PI, 4_000, PI, |theta| polynomial(theta, k).1 > 0.0)
}

/// The point whose polynomial is the distorted one.
fn straighten<const N: usize>(distorted: DVec2, k: &[f64; N], limit: f64) -> Option<DVec2> {
    let radius = distorted.length();
    let theta = invert_monotone(radius, limit, |theta| polynomial(theta, k))?;
    Some(if radius > 0.0 {
        distorted * (theta / radius)
    } else {
        distorted
    })
}

/// `THIN_PRISM_FISHEYE`: radial, tangential and prism terms of the same point, and the
/// Jacobian.
pub(super) fn thin_prism(point: DVec2, k: &[f64; 4], p: &[f64; 2], s: &[f64; 2]) -> (DVec2, DMat2) {
    let t2 = point.length_squared();
    let (factor, d_factor) = even(t2, k);
    let (shift, d_shift) = tangential(point, p);
    let (slant, d_slant) = prism(point, &squares(s));
    (
        point * factor + shift + slant,
        radial_jacobian(point, factor, d_factor) + d_shift + d_slant,
    )
}

/// The angle up to which [`thin_prism`] is one to one: where the eigenvalues of the radial
/// Jacobian outweigh those of the others.
pub(super) fn thin_prism_limit(k: &[f64; 4], p: &[f64; 2], s: &[f64; 2]) -> f64 {
    let sideways = sideways_bound(0.0, p, &squares(s));
    scan(PI, 4_000, PI, |theta| {
        let (value, slope) = polynomial(theta, k);
        slope.min(value / theta) > sideways * theta
    })
}

/// Prism terms by r² alone.
fn squares([x, y]: &[f64; 2]) -> [f64; 4] {
    [*x, 0.0, *y, 0.0]
}

/// The point that [`thin_prism`] maps to a distorted one.
pub(super) fn invert_thin_prism(
    distorted: DVec2,
    k: &[f64; 4],
    p: &[f64; 2],
    s: &[f64; 2],
    limit: f64,
) -> Option<DVec2> {
    // The other terms may bring a point within reach that the polynomial cannot.
    let start =
        straighten(distorted, k, limit).unwrap_or_else(|| distorted.normalize_or_zero() * limit);
    invert_on_disc(distorted, start, limit, |x| thin_prism(x, k, p, s))
}

/// `RAD_TAN_THIN_PRISM_FISHEYE`: tangential and prism terms of the radially distorted
/// point, and the Jacobian.
pub(super) fn rad_tan_thin_prism(
    point: DVec2,
    k: &[f64; 6],
    p: &[f64; 2],
    s: &[f64; 4],
) -> (DVec2, DMat2) {
    let (factor, d_factor) = even(point.length_squared(), k);
    let (value, jacobian) = sideways(point * factor, p, s);
    (value, jacobian * radial_jacobian(point, factor, d_factor))
}

/// The second half of [`rad_tan_thin_prism`]. COLMAP's p₀ and p₁ are OpenCV's p₂ and p₁.
fn sideways(point: DVec2, p: &[f64; 2], s: &[f64; 4]) -> (DVec2, DMat2) {
    let (shift, d_shift) = tangential(point, &[p[1], p[0]]);
    let (slant, d_slant) = prism(point, s);
    (point + shift + slant, DMat2::IDENTITY + d_shift + d_slant)
}

/// The angle up to which [`rad_tan_thin_prism`] is one to one: the polynomial grows there,
/// and on the disc that it fills the second half's Jacobian is positive definite.
pub(super) fn rad_tan_thin_prism_limit(k: &[f64; 6], p: &[f64; 2], s: &[f64; 4]) -> f64 {
    scan(PI, 4_000, PI, |theta| {
        let (r, slope) = polynomial(theta, k);
        slope > 0.0 && sideways_bound(r, p, s) * r < 1.0
    })
}

/// The point that [`rad_tan_thin_prism`] maps to a distorted one.
pub(super) fn invert_rad_tan_thin_prism(
    distorted: DVec2,
    k: &[f64; 6],
    p: &[f64; 2],
    s: &[f64; 4],
    limit: f64,
) -> Option<DVec2> {
    let reach = polynomial(limit, k).0;
    let start = distorted.clamp_length_max(reach);
    let radially = invert_on_disc(distorted, start, reach, |x| sideways(x, p, s))?;
    straighten(radially, k, limit)
}

#[cfg(test)]
mod tests {
    use super::super::difference;
    use super::*;

    #[test]
    fn derivatives_meet_finite_differences() {
        let k = [-0.1, 0.05, -0.02, 0.003];
        let k6 = [-0.1, 0.05, -0.02, 0.003, 0.01, -0.002];
        for theta in [0.0, 0.1, 0.7, 1.5, 2.0] {
            let h = 1e-6;
            let slope = |f: &dyn Fn(f64) -> f64| (f(theta + h) - f(theta - h)) / (2.0 * h);
            let expected = slope(&|t| polynomial(t, &k).0);
            assert!((polynomial(theta, &k).1 - expected).abs() < 1e-8, "{theta}");
            let expected = slope(&|t| polynomial(t, &k6).0);
            assert!(
                (polynomial(theta, &k6).1 - expected).abs() < 2e-8,
                "{theta}"
            );
        }
        let (p, s) = ([0.02, -0.01], [0.03, 0.01, -0.02, 0.005]);
        for x in [-1.2, -0.2, 0.0, 0.35, 0.7] {
            for y in [-0.6, 0.0, 0.15, 1.1] {
                let at = DVec2::new(x, y);
                let close = |found: DMat2, expected: DMat2| {
                    let off = (found - expected).to_cols_array();
                    assert!(
                        off.iter().all(|e| e.abs() < 2e-8),
                        "{at}: {found}, {expected}"
                    );
                };
                let s2 = [s[0], s[1]];
                let expected = difference(|point| thin_prism(point, &k, &p, &s2).0, at);
                close(thin_prism(at, &k, &p, &s2).1, expected);
                let expected = difference(|point| rad_tan_thin_prism(point, &k6, &p, &s).0, at);
                close(rad_tan_thin_prism(at, &k6, &p, &s).1, expected);
            }
        }
    }
}
