//! Lenses that are symmetric about the axis and inverted in closed form.
//!
//! Each has a profile, the distorted radius from the distance ρ off the axis and the depth
//! z of a point (only their ratio matters), with its derivative by the angle θ, and the way
//! back from the radius to some (ρ, z).

use std::f64::consts::{FRAC_PI_2, PI};

/// A distorted radius and its derivative by the angle from the axis.
pub(super) type Profile = (f64, f64);

/// The field-of-view model (Devernay and Faugeras 2001): atan(2 tan(ω/2)·ρ/z)/ω, for z > 0.
///
/// COLMAP replaces it by a series where ω² or r² is below 1e-4. That of r is within 2e-9 of
/// the formula; that of ω has the wrong sign (it is its own inverse's), and we keep to the
/// formula.
pub(super) fn fov(rho: f64, z: f64, omega: f64) -> Option<Profile> {
    let c = 2.0 * (0.5 * omega).tan();
    let d2 = rho * rho + z * z;
    let slope = c / omega * d2 / (c * c * rho * rho + z * z);
    (z > 0.0).then(|| ((c * rho).atan2(z) / omega, slope))
}

/// (ρ, z) from the radius of [`fov`].
pub(super) fn invert_fov(radius: f64, omega: f64) -> Option<(f64, f64)> {
    let bent = radius * omega.abs();
    let c = 2.0 * (0.5 * omega.abs()).tan();
    (bent < FRAC_PI_2).then(|| (bent.sin(), c * bent.cos()))
}

/// The division model (Fitzgibbon 2001): (ρ, z) ∼ (r, 1 + k·r²), of whose two solutions
/// this is the smaller, 2ρ/(z + √(z² − 4kρ²)).
///
/// With k < 0 it sees all but the direction straight back; otherwise what lies in front,
/// up to tan θ = 1/(2√k).
pub(super) fn division(rho: f64, z: f64, k: f64) -> Option<Profile> {
    let square = z * z - 4.0 * k * rho * rho;
    if !(square > 0.0) || (z <= 0.0 && (k >= 0.0 || rho == 0.0)) {
        return None;
    }
    let root = square.sqrt();
    // Behind, z + root would cancel.
    let r = if z >= 0.0 {
        2.0 * rho / (z + root)
    } else {
        (z - root) / (2.0 * k * rho)
    };
    // The derivative of k·sin θ·r² − cos θ·r + sin θ = 0.
    let slope = (r * (k * z * r + rho) + z) / root;
    Some((r, slope))
}

/// The largest angle that [`division`] sees.
pub(super) fn division_limit(k: f64) -> f64 {
    if k < 0.0 {
        PI
    } else {
        1.0_f64.atan2(2.0 * k.sqrt())
    }
}

/// (ρ, z) from the radius of [`division`].
pub(super) fn invert_division(radius: f64, k: f64) -> Option<(f64, f64)> {
    let z = 1.0 + k * radius * radius;
    // Beyond 1/√k lie the larger solutions.
    (k <= 0.0 || z < 2.0).then_some((radius, z))
}

/// The inverse of a cubic (Wu 2014, "Critical configurations for radial distortion
/// self-calibration"; VisualSFM and PBA distort so): r with ρ/z = r(1 + k·r²), for z > 0.
///
/// With r = 2 sinh φ/√(3k) the cubic is sinh 3φ = 3√(3k)·ρ/2z; sines where k < 0.
pub(super) fn inverse_radial(rho: f64, z: f64, k: f64) -> Option<Profile> {
    let root = (3.0 * k.abs()).sqrt();
    let sine = 1.5 * root * (rho / z);
    let r = if k >= 0.0 {
        (sine.asinh() / 3.0).sinh() * 2.0 / root
    } else {
        (sine.asin() / 3.0).sin() * 2.0 / root
    };
    let slope = (1.0 + (rho / z) * (rho / z)) / (1.0 + 3.0 * k * r * r);
    // Where the sine is 1 the image folds.
    (z > 0.0 && (k >= 0.0 || sine < 1.0)).then_some((r, slope))
}

/// The largest angle that [`inverse_radial`] sees.
pub(super) fn inverse_radial_limit(k: f64) -> f64 {
    if k >= 0.0 {
        FRAC_PI_2
    } else {
        2.0_f64.atan2(3.0 * (-3.0 * k).sqrt())
    }
}

/// (ρ, z) from the radius of [`inverse_radial`].
pub(super) fn invert_inverse_radial(radius: f64, k: f64) -> Option<(f64, f64)> {
    let term = k * radius * radius;
    (1.0 + 3.0 * term > 0.0).then_some((radius * (1.0 + term), 1.0))
}

/// The enhanced unified camera model (Khomutenko, Garcia and Martinet 2016):
/// ρ/(α√(βρ² + z²) + (1 − α)z), as far as it grows with the angle.
///
/// COLMAP refuses z ≤ 0, which most lenses calibrated with it see.
pub(super) fn eucm(rho: f64, z: f64, alpha: f64, beta: f64) -> Option<Profile> {
    let seen = z > 0.0 || (rho > 0.0 && z >= rho * eucm_cotangent(alpha, beta));
    if !seen {
        return None;
    }
    let distance = (beta * rho * rho + z * z).sqrt();
    let (a, b) = (alpha * distance, (1.0 - alpha) * z);
    // Behind, a + b would cancel.
    let below = if z >= 0.0 {
        a + b
    } else {
        (alpha * alpha * beta * rho * rho + (2.0 * alpha - 1.0) * z * z) / (a - b)
    };
    let d_below = rho * (alpha * (beta - 1.0) * z / distance - (1.0 - alpha));
    let slope = (z * below - rho * d_below) / (below * below);
    (below > 0.0).then_some((rho / below, slope))
}

/// z/ρ where [`eucm`] ends: its radius grows no more (α > 1/2) or is infinite.
fn eucm_cotangent(alpha: f64, beta: f64) -> f64 {
    -alpha.min(1.0 - alpha) * (beta / (2.0 * alpha - 1.0).abs()).sqrt()
}

/// The largest angle that [`eucm`] sees.
pub(super) fn eucm_limit(alpha: f64, beta: f64) -> f64 {
    if alpha == 0.5 {
        return PI;
    }
    1.0_f64.atan2(eucm_cotangent(alpha, beta))
}

/// (ρ, z) from the radius of [`eucm`].
pub(super) fn invert_eucm(radius: f64, alpha: f64, beta: f64) -> Option<(f64, f64)> {
    let r2 = radius * radius;
    let square = 1.0 - (2.0 * alpha - 1.0) * beta * r2;
    let below = alpha * square.max(0.0).sqrt() + (1.0 - alpha);
    let z = (1.0 - alpha * alpha * beta * r2) / below;
    (square >= 0.0 && below > 0.0).then_some((radius, z))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Over the angles up to the limit: slopes against central differences, and the way
    /// back.
    fn check(
        name: &str,
        limit: f64,
        profile: impl Fn(f64, f64) -> Option<Profile>,
        invert: impl Fn(f64) -> Option<(f64, f64)>,
    ) {
        let at = |theta: f64| profile(theta.sin(), theta.cos());
        for i in 0..100 {
            let theta = 0.99 * limit * f64::from(i) / 100.0;
            let h = 1e-5;
            let (r, slope) = at(theta).unwrap();
            if i > 0 {
                let expected = (at(theta + h).unwrap().0 - at(theta - h).unwrap().0) / (2.0 * h);
                let error = (slope - expected).abs();
                assert!(
                    error < 1e-6 * expected.max(1.0),
                    "{name}, {theta}: {slope}, {expected}"
                );
            }
            assert!(slope > 0.0, "{name}, {theta}");
            let (rho, z) = invert(r).unwrap();
            assert!((rho.atan2(z) - theta).abs() < 1e-10, "{name}, {theta}");
        }
        let beyond = limit + 1e-6;
        if beyond < PI {
            assert_eq!(at(beyond), None, "{name}");
        }
        assert_eq!(profile(0.0, -1.0), None, "{name}");
        assert_eq!(profile(0.0, 0.0), None, "{name}");
        assert_eq!(profile(f64::NAN, 1.0).filter(|(r, _)| !r.is_nan()), None);
    }

    #[test]
    fn profiles_grow_as_they_say_and_lead_back() {
        for omega in [1e-6, 0.3, -0.9, 2.5] {
            let name = format!("fov {omega}");
            check(
                &name,
                FRAC_PI_2,
                |r, z| fov(r, z, omega),
                |r| invert_fov(r, omega),
            );
        }
        for k in [-2.0, -0.2, -1e-9, 1e-9, 0.2, 2.0] {
            let name = format!("division {k}");
            let limit = division_limit(k);
            check(
                &name,
                limit,
                |r, z| division(r, z, k),
                |r| invert_division(r, k),
            );
        }
        for k in [-2.0, -0.2, -1e-9, 1e-9, 0.2, 2.0] {
            let name = format!("inverse radial {k}");
            let limit = inverse_radial_limit(k);
            check(
                &name,
                limit,
                |r, z| inverse_radial(r, z, k),
                |r| invert_inverse_radial(r, k),
            );
        }
        for alpha in [0.0, 0.1, 0.499, 0.5, 0.501, 0.59, 0.9, 1.0] {
            for beta in [0.5, 1.0, 1.7] {
                let limit = eucm_limit(alpha, beta);
                check(
                    &format!("eucm {alpha} {beta}"),
                    limit,
                    |r, z| eucm(r, z, alpha, beta),
                    |r| invert_eucm(r, alpha, beta),
                );
            }
        }
        assert_eq!(invert_fov(FRAC_PI_2, 1.0), None);
        assert_eq!(invert_division(1.01, 1.0), None);
        assert_eq!(invert_inverse_radial(1.01, -1.0 / 3.0), None);
        assert_eq!(invert_eucm(1.01, 1.0, 1.0), None);
    }
}
