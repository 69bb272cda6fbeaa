use super::{closed, fisheye, plane, sensor};
use glam::{DMat3, DVec2};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};

/// Directions in which the edge of a lens is looked for where it is no circle.
const EDGE_DIRECTIONS: u32 = 64;

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
    /// [`Distortion::Rational`] plus thin prisms, (s₁r² + s₂r⁴, s₃r² + s₄r⁴), seen on a sensor
    /// that is turned by τx around x and then by τy around y (OpenCV's 12 and 14
    /// coefficients). Tilts are less than a right angle.
    Tilted {
        /// Radial terms: k₁, k₂, k₃ above the bar, k₄, k₅, k₆ below it.
        k: [f64; 6],
        /// Tangential terms.
        p: [f64; 2],
        /// Thin prism terms.
        s: [f64; 4],
        /// The sensor's tilt in radians, (τx, τy).
        tau: [f64; 2],
    },
    /// r' = θ(1 + k₁θ² + k₂θ⁴ + k₃θ⁶ + k₄θ⁸) (Kannala and Brandt 2006; OpenCV). All zero:
    /// equidistant.
    Fisheye {
        /// The polynomial.
        k: [f64; 4],
    },
    /// [`Distortion::Fisheye`] on a sensor whose axes are not at right angles: with its
    /// (x, y), x' = x + αy and y' = y (OpenCV's fisheye with skew).
    SkewedFisheye {
        /// The polynomial.
        k: [f64; 4],
        /// Skew, α.
        alpha: f64,
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
    /// r' with ρ/z = r'(1 + k·r'²): what straightens is the polynomial, not what distorts (Wu
    /// 2014; VisualSFM). With k < 0 as far as r' = 1/√(−3k).
    InverseRadial {
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
    /// The distortion of OpenCV's pinhole cameras with these coefficients,
    /// k₁ k₂ p₁ p₂ k₃ k₄ k₅ k₆ s₁ s₂ s₃ s₄ τx τy or the first 0, 4, 5, 8 or 12 of them; `None`
    /// for another number.
    pub fn of_opencv(coefficients: &[f64]) -> Option<Self> {
        if ![0, 4, 5, 8, 12, 14].contains(&coefficients.len()) {
            return None;
        }
        let at = |i: usize| coefficients.get(i).copied().unwrap_or(0.0);
        let all = Self::Tilted {
            k: [at(0), at(1), at(4), at(5), at(6), at(7)],
            p: [at(2), at(3)],
            s: [at(8), at(9), at(10), at(11)],
            tau: [at(12), at(13)],
        };
        Some(all.simplest())
    }

    /// The simplest formula that is the same mapping within the precision of f64.
    pub(super) fn simplest(self) -> Self {
        match self {
            Self::Tilted { k, p, s, tau } if s == [0.0; 4] && tau == [0.0; 2] => {
                Self::Rational { k, p }.simplest()
            }
            Self::SkewedFisheye { k, alpha: 0.0 } => Self::Fisheye { k },
            Self::Rational { k, p } if k == [0.0; 6] && p == [0.0; 2] => Self::None,
            Self::Fov { omega } if omega.abs() < 1e-9 => Self::None,
            Self::Division { k: 0.0 } | Self::InverseRadial { k: 0.0 } => Self::None,
            Self::Eucm { alpha: 0.0, .. } => Self::None,
            other => other,
        }
    }

    /// The homography from distorted coordinates to the sensor's, (x', y', w) from (x, y, 1),
    /// where the sensor is tilted or skewed. It keeps the origin, and its last entry is 1.
    /// Nothing is seen where w ≤ 0.
    pub fn sensor(&self) -> Option<DMat3> {
        match *self {
            Self::Tilted { tau, .. } => Some(sensor::tilt(tau)),
            Self::SkewedFisheye { alpha, .. } => Some(sensor::skew(alpha)),
            _ => None,
        }
    }

    /// See [`super::Lens::limit`].
    pub(super) fn limit(&self) -> f64 {
        match self {
            Distortion::None => f64::INFINITY,
            Distortion::Rational { k, p } => plane::limit(k, p, &[0.0; 4]),
            Distortion::Tilted { k, p, s, .. } => plane::limit(k, p, s),
            Distortion::Fisheye { k } | Distortion::SkewedFisheye { k, .. } => {
                fisheye::polynomial_limit(k)
            }
            Distortion::ThinPrismFisheye { k, p, s } => fisheye::thin_prism_limit(k, p, s),
            Distortion::RadTanThinPrismFisheye { k, p, s } => {
                fisheye::rad_tan_thin_prism_limit(k, p, s)
            }
            Distortion::Fov { .. } => 0.5 * PI,
            Distortion::Division { k } => closed::division_limit(*k),
            Distortion::InverseRadial { k } => closed::inverse_radial_limit(*k),
            Distortion::Eucm { alpha, beta } => closed::eucm_limit(*alpha, *beta),
            Distortion::Equirectangular => PI,
        }
    }

    /// See [`super::Lens::edge`].
    pub(super) fn edge(&self, limit: f64) -> f64 {
        let edge = match *self {
            Self::None | Self::Equirectangular => f64::INFINITY,
            Self::Fov { omega } => FRAC_PI_2 / omega.abs(),
            Self::Division { k } if k > 0.0 => k.sqrt().recip(),
            Self::InverseRadial { k } if k < 0.0 => (-3.0 * k).sqrt().recip(),
            Self::Eucm { alpha, beta } if alpha > 0.5 => {
                ((2.0 * alpha - 1.0) * beta).sqrt().recip()
            }
            // Growing without end, as far as they see.
            Self::Division { .. } | Self::InverseRadial { .. } | Self::Eucm { .. } => f64::INFINITY,
            _ if !limit.is_finite() => f64::INFINITY,
            Self::Fisheye { k } => fisheye::polynomial(limit, &k).0,
            Self::Rational { .. }
            | Self::Tilted { .. }
            | Self::SkewedFisheye { .. }
            | Self::ThinPrismFisheye { .. }
            | Self::RadTanThinPrismFisheye { .. } => self.least_edge(limit),
        };
        // Of coefficients that are no numbers nothing is known.
        if edge.is_nan() { f64::INFINITY } else { edge }
    }

    /// The least distance of the image of a circle around the axis from the principal point, for lenses that
    /// distort it.
    fn least_edge(&self, limit: f64) -> f64 {
        let sensor = self.sensor();
        let radius = |direction: u32| {
            let angle = TAU / f64::from(EDGE_DIRECTIONS) * f64::from(direction);
            let on_edge = limit * DVec2::from_angle(angle);
            let distorted = match *self {
                Self::Rational { k, p } => plane::rational(on_edge, &k, &p).0,
                Self::Tilted { k, p, s, .. } => plane::rational_prism(on_edge, &k, &p, &s).0,
                Self::SkewedFisheye { k, .. } => {
                    DVec2::from_angle(angle) * fisheye::polynomial(limit, &k).0
                }
                Self::ThinPrismFisheye { k, p, s } => fisheye::thin_prism(on_edge, &k, &p, &s).0,
                Self::RadTanThinPrismFisheye { k, p, s } => {
                    fisheye::rad_tan_thin_prism(on_edge, &k, &p, &s).0
                }
                _ => return f64::INFINITY,
            };
            let on_sensor = match sensor {
                None => Some(distorted),
                Some(homography) => sensor::apply(homography, distorted).map(|(at, _)| at),
            };
            // Beyond a sensor's horizon there is no edge.
            on_sensor.map_or(f64::INFINITY, DVec2::length)
        };
        (0..EDGE_DIRECTIONS)
            .map(radius)
            .fold(f64::INFINITY, f64::min)
    }

    /// See [`super::Lens::is_wide`].
    ///
    /// A solid angle at θ from the axis covers r·r'/sin θ times the area it covers at the
    /// centre: 1/cos³θ times for a pinhole, about as much for a fisheye. Lenses in between are
    /// taken for what they are closer to at 45°.
    pub(super) fn is_wide(&self) -> bool {
        let (sin, cos) = FRAC_PI_4.sin_cos();
        let (at_45, central) = match *self {
            Distortion::None | Distortion::Rational { .. } | Distortion::Tilted { .. } => {
                return false;
            }
            Distortion::Fisheye { .. }
            | Distortion::SkewedFisheye { .. }
            | Distortion::ThinPrismFisheye { .. }
            | Distortion::RadTanThinPrismFisheye { .. }
            | Distortion::Equirectangular => return true,
            Distortion::Fov { omega } => {
                let central = closed::fov(0.0, 1.0, omega).map_or(1.0, |(_, slope)| slope);
                (closed::fov(sin, cos, omega), central)
            }
            Distortion::Division { k } => (closed::division(sin, cos, k), 1.0),
            Distortion::InverseRadial { k } => (closed::inverse_radial(sin, cos, k), 1.0),
            Distortion::Eucm { alpha, beta } => (closed::eucm(sin, cos, alpha, beta), 1.0),
        };
        let pinhole = 1.0 / (cos * cos * cos);
        at_45.is_some_and(|(r, slope)| r * slope / sin < pinhole.sqrt() * central * central)
    }
}
