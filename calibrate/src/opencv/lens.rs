//! OpenCV's lenses, all of them: the rational model with thin prisms and a tilted sensor
//! (`cv::projectPoints`), and the fisheye with skew (`cv::fisheye`).
//!
//! The formulas are those of OpenCV's documentation of `calib3d`; pixels have our
//! convention, the first pixel's centre at (0.5, 0.5), half a pixel more than OpenCV's.

use crate::lens::rational;
use crate::{Camera, Distortion, Lens, ModelKind, Pixel};
use glam::{DMat2, DMat3, DVec2, DVec3};

/// Intrinsics as OpenCV has them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OpenCvLens {
    /// Focal lengths along x and y, in pixels.
    pub focal: DVec2,
    /// Principal point in pixels, the first pixel's centre at (0.5, 0.5).
    pub principal: DVec2,
    distortion: OpenCvDistortion,
    /// The rational model or the fisheye alone, in normalised coordinates.
    core: Lens,
}

/// How OpenCV's lenses bend rays away from the pinhole's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum OpenCvDistortion {
    /// 0, 4, 5, 8, 12 or 14 coefficients, k₁ k₂ p₁ p₂ k₃ k₄ k₅ k₆ s₁ s₂ s₃ s₄ τx τy: the
    /// rational model of [`Distortion::Rational`], plus (s₁r² + s₂r⁴, s₃r² + s₄r⁴), seen
    /// on a sensor that is turned by τx around x and then by τy around y.
    Standard {
        /// Radial terms: k₁, k₂, k₃ above the bar, k₄, k₅, k₆ below it.
        k: [f64; 6],
        /// Tangential terms.
        p: [f64; 2],
        /// Thin prism terms.
        s: [f64; 4],
        /// The sensor's tilt in radians.
        tau: [f64; 2],
    },
    /// The fisheye of [`Distortion::Fisheye`] with skew: x' = r'·x/r + α·r'·y/r.
    Fisheye {
        /// The polynomial.
        k: [f64; 4],
        /// Skew.
        alpha: f64,
    },
}

/// What the renderer cannot draw with yet.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error(
    "the {what} of this calibration is not supported by the renderer yet; calibrate without \
     {flags}, or undistort the photos with OpenCV and import them as a pinhole camera"
)]
pub struct UnsupportedLens {
    what: String,
    flags: &'static str,
}

const MAX_STEPS: usize = 50;
/// A root is believed when the distorted point returns to within this.
const RESIDUAL_TOLERANCE: f64 = 1e-12;

impl OpenCvDistortion {
    /// The distortion of coefficients in OpenCV's order; `None` for a number of them that
    /// OpenCV does not have.
    pub fn standard(c: &[f64]) -> Option<Self> {
        if ![0, 4, 5, 8, 12, 14].contains(&c.len()) {
            return None;
        }
        let at = |i: usize| c.get(i).copied().unwrap_or(0.0);
        Some(Self::Standard {
            k: [at(0), at(1), at(4), at(5), at(6), at(7)],
            p: [at(2), at(3)],
            s: [at(8), at(9), at(10), at(11)],
            tau: [at(12), at(13)],
        })
    }
}

impl OpenCvLens {
    /// A lens; the range in which its distortion can be inverted is found here.
    pub fn new(focal: DVec2, principal: DVec2, distortion: OpenCvDistortion) -> Self {
        let core = match distortion {
            OpenCvDistortion::Standard { k, p, .. } => Distortion::Rational { k, p },
            OpenCvDistortion::Fisheye { k, .. } => Distortion::Fisheye { k },
        };
        Self {
            focal,
            principal,
            distortion,
            core: Lens::new(DVec2::ONE, DVec2::ZERO, core),
        }
    }

    /// How rays are bent.
    pub fn distortion(&self) -> OpenCvDistortion {
        self.distortion
    }

    /// Where a point falls in the image (or outside it); `None` behind the camera, and
    /// beyond the radius or angle where the radial terms turn back on themselves.
    pub fn project(&self, point_in_camera: DVec3) -> Option<Pixel> {
        let distorted = match self.distortion {
            OpenCvDistortion::Standard { k, p, s, tau } => {
                let DVec3 { x, y, z } = point_in_camera;
                let point = DVec2::new(x, y) / z;
                if !(z > 0.0 && point.length() <= self.core.limit()) {
                    return None;
                }
                tilted(thin_prism(point, &k, &p, &s).0, tilt(tau))
            }
            OpenCvDistortion::Fisheye { alpha, .. } => {
                let Pixel { x, y } = self.core.project(point_in_camera)?;
                DVec2::new(x + alpha * y, y)
            }
        };
        let pixel = distorted * self.focal + self.principal;
        pixel.is_finite().then(|| Pixel::new(pixel.x, pixel.y))
    }

    /// The ray through a pixel: a unit direction in the camera's frame. `None` where no
    /// ray within the one-to-one range falls on that pixel.
    pub fn unproject(&self, pixel: Pixel) -> Option<DVec3> {
        let distorted = (DVec2::new(pixel.x, pixel.y) - self.principal) / self.focal;
        if !distorted.is_finite() {
            return None;
        }
        match self.distortion {
            OpenCvDistortion::Standard { k, p, s, tau } => {
                let upright = tilted(distorted, tilt(tau).inverse());
                let point = invert_thin_prism(upright, &self.core, &k, &p, &s)?;
                Some(point.extend(1.0).normalize())
            }
            OpenCvDistortion::Fisheye { alpha, .. } => {
                let x = distorted.x - alpha * distorted.y;
                self.core.unproject(Pixel::new(x, distorted.y))
            }
        }
    }

    /// The same camera by one of COLMAP's names.
    ///
    /// # Errors
    /// Thin prism terms, tilt or skew that are not zero.
    pub fn camera(&self, width: u32, height: u32) -> Result<Camera, UnsupportedLens> {
        let refuse = |what: String, flags| Err(UnsupportedLens { what, flags });
        let mut params = vec![
            self.focal.x,
            self.focal.y,
            self.principal.x,
            self.principal.y,
        ];
        let model = match self.distortion {
            OpenCvDistortion::Standard { s, .. } if s != [0.0; 4] => {
                let what = format!("thin prism distortion (s1..s4 = {s:?})");
                return refuse(what, "CALIB_THIN_PRISM_MODEL");
            }
            OpenCvDistortion::Standard { tau, .. } if tau != [0.0; 2] => {
                let what = format!("sensor's tilt (τx, τy = {tau:?})");
                return refuse(what, "CALIB_TILTED_MODEL");
            }
            OpenCvDistortion::Fisheye { alpha, .. } if alpha != 0.0 => {
                let what = format!("fisheye's skew (α = {alpha})");
                return refuse(what, "skew (set fisheye::CALIB_FIX_SKEW)");
            }
            OpenCvDistortion::Standard { k, p, .. } => {
                if k == [0.0; 6] && p == [0.0; 2] {
                    ModelKind::Pinhole
                } else {
                    params.extend([k[0], k[1], p[0], p[1]]);
                    if k[2..] == [0.0; 4] {
                        ModelKind::OpenCv
                    } else {
                        params.extend(&k[2..]);
                        ModelKind::FullOpenCv
                    }
                }
            }
            OpenCvDistortion::Fisheye { k, .. } => {
                params.extend(k);
                ModelKind::OpenCvFisheye
            }
        };
        Ok(Camera {
            model,
            width,
            height,
            params,
        })
    }
}

/// The homography from the plane z = 1 to a sensor turned by (τx, τy) around the axis:
/// OpenCV's `computeTiltProjectionMatrix`.
fn tilt(tau: [f64; 2]) -> DMat3 {
    let ((sx, cx), (sy, cy)) = (tau[0].sin_cos(), tau[1].sin_cos());
    let around_x = DMat3::from_cols_array(&[1.0, 0.0, 0.0, 0.0, cx, -sx, 0.0, sx, cx]);
    let around_y = DMat3::from_cols_array(&[cy, 0.0, sy, 0.0, 1.0, 0.0, -sy, 0.0, cy]);
    let turned = around_y * around_x;
    let r = turned.z_axis;
    let onto_sensor = DMat3::from_cols(
        DVec3::new(r.z, 0.0, 0.0),
        DVec3::new(0.0, r.z, 0.0),
        DVec3::new(-r.x, -r.y, 1.0),
    );
    onto_sensor * turned
}

fn tilted(point: DVec2, homography: DMat3) -> DVec2 {
    let h = homography * point.extend(1.0);
    h.truncate() / h.z
}

/// The rational model with thin prisms: the distorted point and the Jacobian.
fn thin_prism(point: DVec2, k: &[f64; 6], p: &[f64; 2], s: &[f64; 4]) -> (DVec2, DMat2) {
    let (without, d_without) = rational(point, k, p);
    let r2 = point.length_squared();
    let prism = DVec2::new(r2 * (s[0] + r2 * s[1]), r2 * (s[2] + r2 * s[3]));
    // d r² / d(x, y) = 2(x, y).
    let d_prism = DVec2::new(s[0] + 2.0 * r2 * s[1], s[2] + 2.0 * r2 * s[3]);
    let d_prism = DMat2::from_cols(2.0 * point.x * d_prism, 2.0 * point.y * d_prism);
    (without + prism, d_without + d_prism)
}

/// Solves the rational model with thin prisms for the undistorted point.
fn invert_thin_prism(
    distorted: DVec2,
    without_prism: &Lens,
    k: &[f64; 6],
    p: &[f64; 2],
    s: &[f64; 4],
) -> Option<DVec2> {
    // 1. Without the prisms, whose terms are small.
    let start = without_prism.unproject(Pixel::new(distorted.x, distorted.y));
    if *s == [0.0; 4] {
        return start.map(|ray| ray.truncate() / ray.z);
    }
    let mut x = start.map_or(distorted, |ray| ray.truncate() / ray.z);
    // 2. Newton's method from there, with the step halved while it does not help.
    let residual = |x: DVec2| (thin_prism(x, k, p, s).0 - distorted).length();
    let mut error = residual(x);
    for _ in 0..MAX_STEPS {
        let (value, jacobian) = thin_prism(x, k, p, s);
        let mut step = jacobian.inverse() * (distorted - value);
        let mut next = residual(x + step);
        for _ in 0..30 {
            if next < error {
                break;
            }
            step *= 0.5;
            next = residual(x + step);
        }
        if !(next < error) {
            break;
        }
        x += step;
        error = next;
    }
    // 3. Believe it only where it reproduces the pixel, on the near side of the fold.
    let found = error <= RESIDUAL_TOLERANCE * (1.0 + distorted.length())
        && x.length() <= without_prism.limit()
        && thin_prism(x, k, p, s).1.determinant() > 0.0;
    found.then_some(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_meet_finite_differences() {
        let (k, p) = ([-0.3, 0.1, -0.02, 0.2, 0.05, -0.01], [0.01, -0.02]);
        let s = [0.02, -0.01, -0.03, 0.005];
        let h = 1e-6;
        for x in [-0.9, -0.2, 0.0, 0.35, 0.7] {
            for y in [-0.6, 0.0, 0.15, 0.8] {
                let at = DVec2::new(x, y);
                let f = |point| thin_prism(point, &k, &p, &s).0;
                let along = |step: DVec2| (f(at + step) - f(at - step)) / (2.0 * h);
                let expected = DMat2::from_cols(along(DVec2::X * h), along(DVec2::Y * h));
                let found = thin_prism(at, &k, &p, &s).1;
                let worst = (found - expected).to_cols_array();
                assert!(worst.iter().all(|e| e.abs() < 1e-8), "at {at}: {worst:?}");
            }
        }
    }

    #[test]
    fn no_tilt_changes_nothing() {
        assert_eq!(tilt([0.0; 2]), DMat3::IDENTITY);
    }
}
