//! Projection through a lens and back.
//!
//! The formulas are OpenCV's (Brown–Conrady with a rational radial term; Kannala–Brandt
//! for fisheyes), with COLMAP's pixel centres. Every model that COLMAP calls by a name of
//! its own is one of these three with some coefficients zero.

use glam::{DMat2, DVec2, DVec3};

/// A position in an image, in pixels: (0, 0) is the top-left corner, (0.5, 0.5) the first
/// pixel's centre. Not to be mixed up with normalised coordinates on the plane z = 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pixel {
    /// To the right.
    pub x: f64,
    /// Downwards.
    pub y: f64,
}

impl Pixel {
    /// The pixel at (x, y).
    pub fn new(x: f64, y: f64) -> Self {
        Self { x, y }
    }

    /// The centre of the pixel in a column and a row.
    pub fn center_of(column: u32, row: u32) -> Self {
        Self {
            x: f64::from(column) + 0.5,
            y: f64::from(row) + 0.5,
        }
    }

    /// Euclidean distance in pixels.
    pub fn distance(self, other: Self) -> f64 {
        (self.x - other.x).hypot(self.y - other.y)
    }
}

/// How a lens bends rays away from the pinhole's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Distortion {
    /// Pinhole.
    None,
    /// On the plane z = 1, with r² = x² + y²:
    /// x' = x·(1 + k₁r² + k₂r⁴ + k₃r⁶)/(1 + k₄r² + k₅r⁴ + k₆r⁶) + 2p₁xy + p₂(r² + 2x²),
    /// and y' likewise with p₁ and p₂ exchanged.
    Rational {
        /// Radial terms: k₁, k₂, k₃ above the bar, k₄, k₅, k₆ below it.
        k: [f64; 6],
        /// Tangential terms.
        p: [f64; 2],
    },
    /// With θ the angle from the axis: r' = θ(1 + k₁θ² + k₂θ⁴ + k₃θ⁶ + k₄θ⁸).
    Fisheye {
        /// The polynomial.
        k: [f64; 4],
    },
}

/// Intrinsics: focal lengths, principal point and distortion, all in pixels.
///
/// ```
/// use calibrate::{Distortion, Lens};
/// use glam::{DVec2, DVec3};
///
/// let barrel = Distortion::Rational { k: [-0.15, 0.0, 0.0, 0.0, 0.0, 0.0], p: [0.0; 2] };
/// let lens = Lens::new(DVec2::splat(800.0), DVec2::new(500.0, 375.0), barrel);
/// let pixel = lens.project(DVec3::new(0.2, 0.1, 1.0)).unwrap();
/// let ray = lens.unproject(pixel).unwrap();
/// assert!((ray / ray.z - DVec3::new(0.2, 0.1, 1.0)).length() < 1e-12);
/// assert!(lens.project(DVec3::new(0.0, 0.0, -1.0)).is_none(), "behind the camera");
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    /// Focal lengths along x and y, in pixels.
    pub focal: DVec2,
    /// Principal point, in pixels.
    pub principal: DVec2,
    distortion: Distortion,
    /// Up to here the mapping is one to one: a limit of the undistorted radius (rational)
    /// or of θ (fisheye).
    limit: f64,
}

/// Newton's method stops when a step is this small (normalised coordinates), or fails.
const STEP_TOLERANCE: f64 = 1e-15;
const MAX_STEPS: usize = 50;
/// Newton's method inside a bracket may need to double its way out of a pole, or bisect
/// all bits of the bracket.
const MAX_BRACKETED_STEPS: usize = 200;
/// A root is believed when the distorted point returns to within this.
const RESIDUAL_TOLERANCE: f64 = 1e-12;

impl Lens {
    /// A lens; the range in which its distortion can be inverted is found here.
    pub fn new(focal: DVec2, principal: DVec2, distortion: Distortion) -> Self {
        let distortion = match distortion {
            Distortion::Rational { k, p } if k == [0.0; 6] && p == [0.0; 2] => Distortion::None,
            other => other,
        };
        Self {
            focal,
            principal,
            distortion,
            limit: monotone_limit(&distortion),
        }
    }

    /// A lens without distortion.
    pub fn pinhole(focal: DVec2, principal: DVec2) -> Self {
        Self::new(focal, principal, Distortion::None)
    }

    /// How rays are bent.
    pub fn distortion(&self) -> Distortion {
        self.distortion
    }

    /// The largest undistorted radius (on z = 1), or angle for a fisheye, that the lens
    /// maps one to one; infinite for a pinhole.
    pub fn limit(&self) -> f64 {
        self.limit
    }

    /// The lens of the same camera with its image stretched by (sx, sy).
    pub fn scaled(&self, sx: f64, sy: f64) -> Self {
        let s = DVec2::new(sx, sy);
        Self {
            focal: self.focal * s,
            principal: self.principal * s,
            ..*self
        }
    }

    /// The geometric mean of the two focal lengths: the scale of the image's centre.
    pub fn mean_focal(&self) -> f64 {
        (self.focal.x * self.focal.y).sqrt()
    }

    /// Where a point falls in the image (or outside it).
    ///
    /// `None` behind the camera, and beyond the radius or angle where the distortion
    /// turns back on itself: there the formula gives a pixel, but no camera does.
    pub fn project(&self, point_in_camera: DVec3) -> Option<Pixel> {
        let DVec3 { x, y, z } = point_in_camera;
        let distorted = match self.distortion {
            Distortion::Fisheye { k } => {
                let radius = x.hypot(y);
                let theta = radius.atan2(z);
                if !(theta <= self.limit) || (radius == 0.0 && z <= 0.0) {
                    return None;
                }
                // θ_d / r tends to 1/z on the axis.
                let scale = if radius > 0.0 {
                    fisheye(theta, &k).0 / radius
                } else {
                    1.0 / z
                };
                DVec2::new(x, y) * scale
            }
            Distortion::None if z > 0.0 => DVec2::new(x / z, y / z),
            Distortion::Rational { k, p } if z > 0.0 => {
                let undistorted = DVec2::new(x / z, y / z);
                if !(undistorted.length() <= self.limit) {
                    return None;
                }
                rational(undistorted, &k, &p).0
            }
            _ => return None,
        };
        let pixel = distorted * self.focal + self.principal;
        pixel.is_finite().then_some(Pixel {
            x: pixel.x,
            y: pixel.y,
        })
    }

    /// The ray through a pixel: a unit direction in the camera's frame.
    ///
    /// `None` where no ray within the lens' one-to-one range falls on that pixel.
    pub fn unproject(&self, pixel: Pixel) -> Option<DVec3> {
        let distorted = (DVec2::new(pixel.x, pixel.y) - self.principal) / self.focal;
        if !distorted.is_finite() {
            return None;
        }
        match self.distortion {
            Distortion::None => Some(distorted.extend(1.0).normalize()),
            Distortion::Rational { k, p } => {
                let undistorted = invert_rational(distorted, &k, &p, self.limit)?;
                Some(undistorted.extend(1.0).normalize())
            }
            Distortion::Fisheye { k } => {
                let radius = distorted.length();
                let theta = invert_monotone(radius, self.limit, |theta| fisheye(theta, &k))?;
                let (sin, cos) = theta.sin_cos();
                let sideways = if radius > 0.0 {
                    distorted * (sin / radius)
                } else {
                    DVec2::ZERO
                };
                Some(sideways.extend(cos))
            }
        }
    }
}

/// The distorted point and the Jacobian of the mapping.
fn rational(point: DVec2, k: &[f64; 6], p: &[f64; 2]) -> (DVec2, DMat2) {
    let DVec2 { x, y } = point;
    let r2 = x * x + y * y;
    let above = 1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[2]));
    let below = 1.0 + r2 * (k[3] + r2 * (k[4] + r2 * k[5]));
    let radial = above / below;
    // d radial / d r²
    let d_above = k[0] + r2 * (2.0 * k[1] + r2 * 3.0 * k[2]);
    let d_below = k[3] + r2 * (2.0 * k[4] + r2 * 3.0 * k[5]);
    let slope = (d_above - radial * d_below) / below;
    let distorted = DVec2::new(
        x * radial + 2.0 * p[0] * x * y + p[1] * (r2 + 2.0 * x * x),
        y * radial + 2.0 * p[1] * x * y + p[0] * (r2 + 2.0 * y * y),
    );
    let dxx = radial + 2.0 * x * x * slope + 2.0 * p[0] * y + 6.0 * p[1] * x;
    let dyy = radial + 2.0 * y * y * slope + 2.0 * p[1] * x + 6.0 * p[0] * y;
    let dxy = 2.0 * x * y * slope + 2.0 * p[0] * x + 2.0 * p[1] * y;
    (
        distorted,
        DMat2::from_cols(DVec2::new(dxx, dxy), DVec2::new(dxy, dyy)),
    )
}

/// r·radial(r²) and its derivative: the rational model along a radius.
fn rational_radius(r: f64, k: &[f64; 6]) -> (f64, f64) {
    let (point, jacobian) = rational(DVec2::new(r, 0.0), k, &[0.0; 2]);
    (point.x, jacobian.x_axis.x)
}

/// θ_d and dθ_d/dθ.
fn fisheye(theta: f64, k: &[f64; 4]) -> (f64, f64) {
    let t2 = theta * theta;
    let value = theta * (1.0 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3]))));
    let slope = 1.0 + t2 * (3.0 * k[0] + t2 * (5.0 * k[1] + t2 * (7.0 * k[2] + t2 * 9.0 * k[3])));
    (value, slope)
}

/// How far from the axis the mapping is one to one.
fn monotone_limit(distortion: &Distortion) -> f64 {
    // A mapping is scanned in small steps for the first place where it stops growing (a
    // pole of the rational term shows as a slope or a value that is not positive), and
    // that place is then bisected.
    fn scan(end: f64, steps: u32, at_end: f64, grows: impl Fn(f64) -> bool) -> f64 {
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
    match distortion {
        Distortion::None => f64::INFINITY,
        Distortion::Rational { k, p } => {
            // The tangential terms' Jacobian is 2(q·x)I + 2(qxᵀ + xqᵀ) with q = (p₂, p₁):
            // symmetric, its eigenvalues at least −6|q|r. The radial terms' is symmetric
            // too, with the eigenvalues f/r and f'. Where the sum is positive definite on
            // a disc, which is convex, the mapping is one to one there.
            let tangential = 6.0 * p[0].hypot(p[1]);
            // Radius 50 is 88.9° off the axis.
            scan(50.0, 20_000, f64::INFINITY, |r| {
                let (value, slope) = rational_radius(r, k);
                slope.min(value / r) > tangential * r
            })
        }
        Distortion::Fisheye { k } => {
            let pi = std::f64::consts::PI;
            scan(pi, 4_000, pi, |theta| fisheye(theta, k).1 > 0.0)
        }
    }
}

/// Solves f(x) = value for x in [0, limit] where f grows from 0 and returns its slope too:
/// Newton's method kept inside a shrinking bracket, so it cannot run away.
fn invert_monotone(value: f64, limit: f64, f: impl Fn(f64) -> (f64, f64)) -> Option<f64> {
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

/// Solves the rational model for the undistorted point.
fn invert_rational(distorted: DVec2, k: &[f64; 6], p: &[f64; 2], limit: f64) -> Option<DVec2> {
    // 1. Without the tangential terms the problem has one dimension and a sure answer.
    let radius = distorted.length();
    let start = match invert_monotone(radius, limit, |r| rational_radius(r, k)) {
        Some(undistorted) if radius > 0.0 => distorted * (undistorted / radius),
        Some(_) => distorted,
        // Tangential terms may still bring the point within reach.
        None if *p != [0.0; 2] && limit.is_finite() => distorted * (limit / radius),
        None => return None,
    };
    if *p == [0.0; 2] {
        return Some(start);
    }
    // 2. Newton's method from there, with the step halved while it does not help.
    let residual = |x: DVec2| rational(x, k, p).0 - distorted;
    let mut x = start;
    let mut error = residual(x).length();
    for _ in 0..MAX_STEPS {
        let (value, jacobian) = rational(x, k, p);
        if jacobian.determinant() == 0.0 {
            return None;
        }
        let mut step = jacobian.inverse() * (distorted - value);
        let mut next_error = residual(x + step).length();
        let mut halvings = 0;
        while !(next_error <= error) && halvings < 30 {
            step *= 0.5;
            next_error = residual(x + step).length();
            halvings += 1;
        }
        if !(next_error <= error) {
            break;
        }
        x += step;
        error = next_error;
        if step.length() <= STEP_TOLERANCE * (1.0 + x.length()) {
            break;
        }
    }
    // 3. Believe it only where it reproduces the pixel, on the near side of the fold.
    let found = error <= RESIDUAL_TOLERANCE * (1.0 + distorted.length())
        && x.length() <= limit
        && rational(x, k, p).1.determinant() > 0.0;
    found.then_some(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Central differences of a mapping of the plane.
    fn difference(f: impl Fn(DVec2) -> DVec2, at: DVec2) -> DMat2 {
        let h = 1e-6;
        let along = |step: DVec2| (f(at + step) - f(at - step)) / (2.0 * h);
        DMat2::from_cols(along(DVec2::new(h, 0.0)), along(DVec2::new(0.0, h)))
    }

    #[test]
    fn derivatives_meet_finite_differences() {
        let k = [-0.3, 0.1, -0.02, 0.2, 0.05, -0.01];
        let p = [0.01, -0.02];
        for x in [-0.9, -0.2, 0.0, 0.35, 0.7] {
            for y in [-0.6, 0.0, 0.15, 0.8] {
                let at = DVec2::new(x, y);
                let expected = difference(|point| rational(point, &k, &p).0, at);
                let found = rational(at, &k, &p).1;
                assert!(
                    (found - expected)
                        .to_cols_array()
                        .iter()
                        .all(|e| e.abs() < 1e-8),
                    "at {at}: {found} instead of {expected}"
                );
            }
        }
        let k = [-0.1, 0.05, -0.02, 0.003];
        for theta in [0.0, 0.1, 0.7, 1.5, 2.0] {
            let h = 1e-6;
            let expected = (fisheye(theta + h, &k).0 - fisheye(theta - h, &k).0) / (2.0 * h);
            assert!((fisheye(theta, &k).1 - expected).abs() < 1e-8, "at {theta}");
        }
    }
}
