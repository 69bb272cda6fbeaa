use super::{closed, fisheye, plane};
use std::f64::consts::{FRAC_PI_4, PI};

/// How a lens bends rays away from the pinhole's.
///
/// Each maps a point (x, y, z) of the camera's frame to distorted coordinates, which focal
/// lengths and principal point turn into pixels. ρ is the distance from the axis,
/// √(x² + y²), and θ the angle from it, atan2(ρ, z). Where only a radius is given, the
/// direction stays that of (x, y).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Distortion {
    /// Pinhole: (x/z, y/z).
    None,
    /// On the plane z = 1, with r² = x² + y²:
    /// x' = x·(1 + k₁r² + k₂r⁴ + k₃r⁶)/(1 + k₄r² + k₅r⁴ + k₆r⁶) + 2p₁xy + p₂(r² + 2x²),
    /// and y' likewise with p₁ and p₂ exchanged (Brown 1971; OpenCV).
    Rational {
        /// Radial terms: k₁, k₂, k₃ above the bar, k₄, k₅, k₆ below it.
        k: [f64; 6],
        /// Tangential terms.
        p: [f64; 2],
    },
    /// r' = θ(1 + k₁θ² + k₂θ⁴ + k₃θ⁶ + k₄θ⁸) (Kannala and Brandt 2006; OpenCV). All zero:
    /// equidistant.
    Fisheye {
        /// The polynomial.
        k: [f64; 4],
    },
    /// With (x, y) of length θ and r = θ:
    /// x' = x(1 + k₁r² + … + k₄r⁸) + 2p₁xy + p₂(r² + 2x²) + s₁r², and y' likewise with p₁
    /// and p₂ exchanged and s₂ (ETH3D; COLMAP's `THIN_PRISM_FISHEYE`).
    ThinPrismFisheye {
        /// Radial terms.
        k: [f64; 4],
        /// Tangential terms.
        p: [f64; 2],
        /// Prism terms.
        s: [f64; 2],
    },
    /// With (x, y) of length θ(1 + k₀θ² + … + k₅θ¹²) = r:
    /// x' = x + 2p₁xy + p₀(r² + 2x²) + s₀r² + s₁r⁴,
    /// y' = y + 2p₀xy + p₁(r² + 2y²) + s₂r² + s₃r⁴ (Project Aria's `FisheyeRadTanThinPrism`;
    /// COLMAP's `RAD_TAN_THIN_PRISM_FISHEYE`). Its p₀ and p₁ are the other models' p₂ and p₁.
    RadTanThinPrismFisheye {
        /// Radial terms.
        k: [f64; 6],
        /// Tangential terms.
        p: [f64; 2],
        /// Prism terms.
        s: [f64; 4],
    },
    /// r' = atan(2 tan(ω/2)·ρ/z)/ω (Devernay and Faugeras 2001), |ω| < π.
    Fov {
        /// ω, the field of view in radians.
        omega: f64,
    },
    /// r' with ρ/z = r'/(1 + k·r'²) (Fitzgibbon 2001). With k < 0 it sees behind itself.
    Division {
        /// k.
        k: f64,
    },
    /// r' = ρ/(α√(βρ² + z²) + (1 − α)z) (Khomutenko, Garcia and Martinet 2016), 0 ≤ α ≤ 1,
    /// β > 0. With α > 0 it sees behind itself.
    Eucm {
        /// α.
        alpha: f64,
        /// β.
        beta: f64,
    },
    /// x' the azimuth atan2(x, z), y' the elevation atan2(y, √(x² + z²)), in radians: all
    /// round. The image ends at ±π and ±π/2.
    Equirectangular,
}

impl Distortion {
    /// See [`super::Lens::limit`].
    pub(super) fn limit(&self) -> f64 {
        match self {
            Distortion::None => f64::INFINITY,
            Distortion::Rational { k, p } => plane::rational_limit(k, p),
            Distortion::Fisheye { k } => fisheye::polynomial_limit(k),
            Distortion::ThinPrismFisheye { k, p, s } => fisheye::thin_prism_limit(k, p, s),
            Distortion::RadTanThinPrismFisheye { k, p, s } => {
                fisheye::rad_tan_thin_prism_limit(k, p, s)
            }
            Distortion::Fov { .. } => 0.5 * PI,
            Distortion::Division { k } => closed::division_limit(*k),
            Distortion::Eucm { alpha, beta } => closed::eucm_limit(*alpha, *beta),
            Distortion::Equirectangular => PI,
        }
    }

    /// See [`super::Lens::is_wide`].
    ///
    /// A solid angle at θ from the axis covers r·r'/sin θ times the area it covers at the
    /// centre: 1/cos³θ times for a pinhole, about as much for a fisheye. Lenses in between are
    /// taken for what they are closer to at 45°.
    pub(super) fn is_wide(&self) -> bool {
        let (sin, cos) = FRAC_PI_4.sin_cos();
        let (at_45, central) = match *self {
            Distortion::None | Distortion::Rational { .. } => return false,
            Distortion::Fisheye { .. }
            | Distortion::ThinPrismFisheye { .. }
            | Distortion::RadTanThinPrismFisheye { .. }
            | Distortion::Equirectangular => return true,
            Distortion::Fov { omega } => {
                let central = closed::fov(0.0, 1.0, omega).map_or(1.0, |(_, slope)| slope);
                (closed::fov(sin, cos, omega), central)
            }
            Distortion::Division { k } => (closed::division(sin, cos, k), 1.0),
            Distortion::Eucm { alpha, beta } => (closed::eucm(sin, cos, alpha, beta), 1.0),
        };
        let pinhole = 1.0 / (cos * cos * cos);
        at_45.is_some_and(|(r, slope)| r * slope / sin < pinhole.sqrt() * central * central)
    }
}
