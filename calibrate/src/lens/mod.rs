//! Projection through a lens and back.
//!
//! Every model of COLMAP, OpenCV and the other programs read here is one of [`Distortion`]'s,
//! some with coefficients zero; pixel centres are COLMAP's.

mod closed;
mod distortion;
mod equirectangular;
mod fisheye;
mod invert;
mod pixel;
mod plane;
mod sensor;
mod turn;

pub use distortion::Distortion;
pub use pixel::Pixel;

use glam::{DMat2, DVec2, DVec3};

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
    limit: f64,
    edge: f64,
    wide: bool,
}

/// Where a point falls, and how that changes as the point moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projection {
    /// Where it falls.
    pub pixel: Pixel,
    /// The gradients of the pixel's x and y by the point.
    pub gradients: [DVec3; 2],
}

impl Lens {
    /// A lens; the range in which its distortion can be inverted is found here. Where
    /// coefficients are zero, [`Lens::distortion`] is the simplest variant without them.
    pub fn new(focal: DVec2, principal: DVec2, distortion: Distortion) -> Self {
        let distortion = distortion.simplest();
        let limit = distortion.limit();
        Self {
            focal,
            principal,
            distortion,
            limit,
            edge: distortion.edge(limit),
            wide: distortion.is_wide(),
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

    /// How far from the axis the lens maps rays one to one: for [`Distortion::None`],
    /// [`Distortion::Rational`] and [`Distortion::Tilted`] a radius on the plane z = 1, infinite for a pinhole; for
    /// all others an angle in radians, π/2 or less for those that see only what is in front.
    pub fn limit(&self) -> f64 {
        self.limit
    }

    /// How far from the principal point, in focal lengths, everything on the image is seen by the lens:
    /// the radius at which the image ends, or the least where that is no circle. Infinite where it ends
    /// nowhere, and for [`Distortion::Equirectangular`], whose image is a rectangle.
    pub fn edge(&self) -> f64 {
        self.edge
    }

    /// How much the lens bends what is straight: the most that the second derivative of the pixel can
    /// be, by a place on the plane z = 1 no farther than `radius` from the axis, along any direction.
    /// So of a convex figure there of diameter d, no pixel is farther than ½·bend·d² from the convex
    /// hull of its corners' pixels. `None` where no bound is known.
    pub fn bend(&self, radius: f64) -> Option<f64> {
        let bend = match self.distortion {
            Distortion::None => 0.0,
            Distortion::Rational { k, p } if k[3..] == [0.0; 3] => plane::bend(&k[..3], &p, radius),
            _ => return None,
        };
        Some(bend * self.focal.max_element())
    }

    /// Whether the size of things in the image follows their distance, as a fisheye's,
    /// rather than their depth, as a pinhole's: whichever describes the lens better.
    pub fn is_wide(&self) -> bool {
        self.wide
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

    /// Pixels per radian at the image's centre: the geometric mean along x and y.
    pub fn mean_focal(&self) -> f64 {
        let central = match self.distortion {
            Distortion::Fov { omega } => 2.0 * (0.5 * omega).tan() / omega,
            Distortion::Tilted { tau, .. } => (tau[0].cos() * tau[1].cos()).sqrt().recip(),
            _ => 1.0,
        };
        central * (self.focal.x * self.focal.y).sqrt()
    }

    /// Where a point falls in the image (or outside it).
    ///
    /// `None` where the lens does not see: behind a camera that only looks forward, and
    /// beyond the radius or angle where the distortion turns back on itself: there the
    /// formula gives a pixel, but no camera does. Lenses whose formula holds beyond 90°
    /// see there, though COLMAP lets most of them see only what has z > 0.
    pub fn project(&self, point_in_camera: DVec3) -> Option<Pixel> {
        let DVec3 { x, y, z } = point_in_camera;
        let distorted = match self.distortion {
            Distortion::None if z > 0.0 => DVec2::new(x / z, y / z),
            Distortion::None => return None,
            Distortion::Rational { k, p } => {
                plane::rational(self.on_plane(point_in_camera)?, &k, &p).0
            }
            Distortion::Tilted { k, p, s, .. } => {
                plane::rational_prism(self.on_plane(point_in_camera)?, &k, &p, &s).0
            }
            Distortion::ThinPrismFisheye { k, p, s } => {
                fisheye::thin_prism(self.by_angle(point_in_camera)?, &k, &p, &s).0
            }
            Distortion::RadTanThinPrismFisheye { k, p, s } => {
                fisheye::rad_tan_thin_prism(self.by_angle(point_in_camera)?, &k, &p, &s).0
            }
            Distortion::Equirectangular => equirectangular::angles(point_in_camera)?.0,
            Distortion::Fisheye { .. }
            | Distortion::SkewedFisheye { .. }
            | Distortion::Fov { .. }
            | Distortion::Division { .. }
            | Distortion::InverseRadial { .. }
            | Distortion::Eucm { .. } => {
                let rho = x.hypot(y);
                let (r, slope) = self.profile(rho, z)?;
                // r / ρ tends to r' / z on the axis.
                let scale = if rho > 0.0 { r / rho } else { slope / z };
                DVec2::new(x, y) * scale
            }
        };
        self.pixel(match self.distortion.sensor() {
            None => distorted,
            Some(homography) => sensor::apply(homography, distorted)?.0,
        })
    }

    /// [`Self::project`] with its derivatives, for optimisation.
    pub fn project_with_gradients(&self, point_in_camera: DVec3) -> Option<Projection> {
        let DVec3 { x, y, z } = point_in_camera;
        // 1. The point's own coordinates, undistorted, or distorted where that is symmetric.
        let (before, gradients) = match self.distortion {
            Distortion::None | Distortion::Rational { .. } | Distortion::Tilted { .. } => {
                let before = if let Distortion::None = self.distortion {
                    (z > 0.0).then(|| DVec2::new(x / z, y / z))?
                } else {
                    self.on_plane(point_in_camera)?
                };
                let by_x = DVec3::new(1.0, 0.0, -before.x) / z;
                let by_y = DVec3::new(0.0, 1.0, -before.y) / z;
                (before, [by_x, by_y])
            }
            Distortion::Equirectangular => equirectangular::angles(point_in_camera)?,
            _ => {
                let rho = x.hypot(y);
                let (r, slope) = match self.distortion {
                    Distortion::ThinPrismFisheye { .. }
                    | Distortion::RadTanThinPrismFisheye { .. } => {
                        (self.by_angle(point_in_camera)?.length(), 1.0)
                    }
                    _ => self.profile(rho, z)?,
                };
                symmetric(point_in_camera, rho, r, slope)
            }
        };
        // 2. What distorts them further.
        let (mut distorted, mut jacobian) = match self.distortion {
            Distortion::Rational { k, p } => plane::rational(before, &k, &p),
            Distortion::Tilted { k, p, s, .. } => plane::rational_prism(before, &k, &p, &s),
            Distortion::ThinPrismFisheye { k, p, s } => fisheye::thin_prism(before, &k, &p, &s),
            Distortion::RadTanThinPrismFisheye { k, p, s } => {
                fisheye::rad_tan_thin_prism(before, &k, &p, &s)
            }
            _ => (before, DMat2::IDENTITY),
        };
        // 3. The sensor.
        if let Some(homography) = self.distortion.sensor() {
            let (mapped, by_distorted) = sensor::apply(homography, distorted)?;
            (distorted, jacobian) = (mapped, by_distorted * jacobian);
        }
        let row = |r: usize| {
            let row = jacobian.row(r) * self.focal[r];
            row.x * gradients[0] + row.y * gradients[1]
        };
        Some(Projection {
            pixel: self.pixel(distorted)?,
            gradients: [row(0), row(1)],
        })
    }

    /// The ray through a pixel: a unit direction in the camera's frame.
    ///
    /// `None` where no ray within the lens' one-to-one range falls on that pixel, and
    /// where it lies so far out that numbers overflow.
    pub fn unproject(&self, pixel: Pixel) -> Option<DVec3> {
        let mut distorted = (DVec2::new(pixel.x, pixel.y) - self.principal) / self.focal;
        if let Some(homography) = self.distortion.sensor() {
            distorted = sensor::apply(homography.inverse(), distorted)?.0;
        }
        if !distorted.is_finite() {
            return None;
        }
        let radius = distorted.length();
        let sideways = |(rho, z): (f64, f64)| {
            let direction = if radius > 0.0 {
                distorted / radius
            } else {
                DVec2::ZERO
            };
            (direction * rho).extend(z).try_normalize()
        };
        let at_angle = |undistorted: DVec2| {
            let theta = undistorted.length();
            let (sin, cos) = theta.sin_cos();
            let per_angle = if theta > 0.0 { sin / theta } else { 1.0 };
            (undistorted * per_angle).extend(cos)
        };
        match self.distortion {
            Distortion::None => distorted.extend(1.0).try_normalize(),
            Distortion::Rational { k, p } => {
                let undistorted = plane::invert(distorted, &k, &p, &[0.0; 4], self.limit)?;
                undistorted.extend(1.0).try_normalize()
            }
            Distortion::Tilted { k, p, s, .. } => {
                let undistorted = plane::invert(distorted, &k, &p, &s, self.limit)?;
                undistorted.extend(1.0).try_normalize()
            }
            Distortion::Fisheye { k } | Distortion::SkewedFisheye { k, .. } => {
                let theta = invert::invert_monotone(radius, self.limit, |theta| {
                    fisheye::polynomial(theta, &k)
                })?;
                sideways(theta.sin_cos())
            }
            Distortion::ThinPrismFisheye { k, p, s } => {
                fisheye::invert_thin_prism(distorted, &k, &p, &s, self.limit).map(at_angle)
            }
            Distortion::RadTanThinPrismFisheye { k, p, s } => {
                fisheye::invert_rad_tan_thin_prism(distorted, &k, &p, &s, self.limit).map(at_angle)
            }
            Distortion::Fov { omega } => closed::invert_fov(radius, omega).and_then(sideways),
            Distortion::Division { k } => closed::invert_division(radius, k).and_then(sideways),
            Distortion::InverseRadial { k } => {
                closed::invert_inverse_radial(radius, k).and_then(sideways)
            }
            Distortion::Eucm { alpha, beta } => {
                closed::invert_eucm(radius, alpha, beta).and_then(sideways)
            }
            Distortion::Equirectangular => equirectangular::ray(distorted),
        }
    }

    fn pixel(&self, distorted: DVec2) -> Option<Pixel> {
        let DVec2 { x, y } = distorted * self.focal + self.principal;
        (x.is_finite() && y.is_finite()).then_some(Pixel { x, y })
    }

    /// (x/z, y/z), in front and within the limit.
    fn on_plane(&self, point_in_camera: DVec3) -> Option<DVec2> {
        let DVec3 { x, y, z } = point_in_camera;
        let undistorted = DVec2::new(x / z, y / z);
        (z > 0.0 && undistorted.length() <= self.limit).then_some(undistorted)
    }

    /// (x, y) at the length θ, within the limit.
    fn by_angle(&self, point_in_camera: DVec3) -> Option<DVec2> {
        let DVec3 { x, y, z } = point_in_camera;
        let rho = x.hypot(y);
        let theta = rho.atan2(z);
        if rho > 0.0 {
            (theta <= self.limit).then(|| DVec2::new(x, y) * (theta / rho))
        } else {
            (z > 0.0).then_some(DVec2::ZERO)
        }
    }

    /// The distorted radius of a symmetric lens, and its derivative by the angle.
    fn profile(&self, rho: f64, z: f64) -> Option<closed::Profile> {
        match self.distortion {
            Distortion::Fisheye { k } | Distortion::SkewedFisheye { k, .. } => {
                let theta = rho.atan2(z);
                (theta <= self.limit && (rho > 0.0 || z > 0.0))
                    .then(|| fisheye::polynomial(theta, &k))
            }
            Distortion::Fov { omega } => closed::fov(rho, z, omega),
            Distortion::Division { k } => closed::division(rho, z, k),
            Distortion::InverseRadial { k } => closed::inverse_radial(rho, z, k),
            Distortion::Eucm { alpha, beta } => closed::eucm(rho, z, alpha, beta),
            _ => None,
        }
    }
}

/// The point at radius r in the direction of (x, y), and its gradients, where r depends on
/// the angle from the axis alone: dθ = (z·dρ − ρ·dz)/(ρ² + z²).
fn symmetric(point: DVec3, rho: f64, r: f64, slope: f64) -> (DVec2, [DVec3; 2]) {
    let DVec3 { x, y, z } = point;
    let d2 = point.length_squared();
    let (scale, along) = if rho > 0.0 {
        let scale = r / rho;
        (scale, (slope * z / d2 - scale) / (rho * rho))
    } else {
        (slope / z, 0.0)
    };
    let gradient =
        |axis: DVec3, v: f64| scale * axis + v * DVec3::new(along * x, along * y, -slope / d2);
    (
        DVec2::new(x, y) * scale,
        [gradient(DVec3::X, x), gradient(DVec3::Y, y)],
    )
}

/// Central differences of a mapping of the plane.
#[cfg(test)]
fn difference(f: impl Fn(DVec2) -> DVec2, at: DVec2) -> DMat2 {
    let h = 1e-6;
    let along = |step: DVec2| (f(at + step) - f(at - step)) / (2.0 * h);
    DMat2::from_cols(along(DVec2::new(h, 0.0)), along(DVec2::new(0.0, h)))
}
