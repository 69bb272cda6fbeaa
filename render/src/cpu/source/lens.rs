//! Lenses by the cheapest formula that is exact for each; `Lens` in `calibrate` says
//! what they mean.

use super::super::lanes::{LANES, LARGEST_CUBIC_TERM, Lane, each};
use super::super::scalar::Scalar;
use crate::sensor::{Sensor, focal_and_sensor};
use calibrate::{Distortion, Lens};

/// Keeps a sphere's seam and poles in the image: no rounding error takes them across its
/// border, and it is a thousandth of a pixel at most.
const ALMOST_PI: f32 = 3.141_591;

/// A lens in numbers of a kind.
pub(super) struct LensOf<T> {
    focal: [T; 2],
    principal: [T; 2],
    distortion: DistortionOf<T>,
    /// Shear and horizon: see [`Sensor`].
    sensor: Option<[[T; 2]; 2]>,
}

/// What a lens does not see is put here, far outside the image.
const OUTSIDE: f32 = -1e9;
enum DistortionOf<T> {
    None,
    Polynomial {
        k: [T; 3],
        limit_squared: T,
    },
    Rational {
        k: [T; 6],
        p: [T; 2],
        limit_squared: T,
    },
    /// Rational with thin prisms.
    RationalPrism {
        k: [T; 6],
        p: [T; 2],
        /// By r² and by r⁴.
        s: [[T; 2]; 2],
        limit_squared: T,
    },
    Fisheye {
        k: [T; 4],
        limit: T,
    },
    /// Both fisheyes with tangential and prism terms: those are of the undistorted point, or
    /// of the bent one.
    Prism {
        k: [T; 6],
        p: [T; 2],
        /// By r² and by r⁴.
        s: [[T; 2]; 2],
        of_bent: bool,
        limit: T,
    },
    Fov {
        /// 2 tan(ω/2)
        c: T,
        inverse_omega: T,
    },
    Division {
        k: T,
    },
    InverseRadial {
        k: T,
    },
    Eucm {
        alpha: T,
        beta: T,
        /// z/ρ at the limit.
        cotangent: T,
    },
    Equirectangular,
}

impl<T: Scalar> LensOf<T> {
    /// Without distortion by a formula of its own, if it `may_skip` the others.
    pub(super) fn new(lens: &Lens, may_skip: bool) -> Self {
        let limit = lens.limit();
        let f = T::rounded;
        let distortion = match lens.distortion() {
            Distortion::None if may_skip => DistortionOf::None,
            Distortion::None => DistortionOf::Polynomial {
                k: [f(0.0); 3],
                limit_squared: f(f64::INFINITY),
            },
            Distortion::Rational { k, p } if k[3..] == [0.0; 3] && p == [0.0; 2] => {
                DistortionOf::Polynomial {
                    k: [f(k[0]), f(k[1]), f(k[2])],
                    limit_squared: f(limit * limit),
                }
            }
            Distortion::Rational { k, p } => DistortionOf::Rational {
                k: k.map(f),
                p: p.map(f),
                limit_squared: f(limit * limit),
            },
            Distortion::Tilted { k, p, s, .. } => DistortionOf::RationalPrism {
                k: k.map(f),
                p: p.map(f),
                s: [[f(s[0]), f(s[2])], [f(s[1]), f(s[3])]],
                limit_squared: f(limit * limit),
            },
            Distortion::Fisheye { k } | Distortion::SkewedFisheye { k, .. } => {
                DistortionOf::Fisheye {
                    k: k.map(f),
                    limit: f(limit),
                }
            }
            Distortion::ThinPrismFisheye { k, p, s } => DistortionOf::Prism {
                k: [f(k[0]), f(k[1]), f(k[2]), f(k[3]), f(0.0), f(0.0)],
                p: p.map(f),
                s: [s.map(f), [f(0.0); 2]],
                of_bent: false,
                limit: f(limit),
            },
            Distortion::RadTanThinPrismFisheye { k, p, s } => DistortionOf::Prism {
                k: k.map(f),
                p: [f(p[1]), f(p[0])],
                s: [[f(s[0]), f(s[2])], [f(s[1]), f(s[3])]],
                of_bent: true,
                limit: f(limit),
            },
            Distortion::Fov { omega } => DistortionOf::Fov {
                c: f(2.0 * (0.5 * omega.abs()).tan()),
                inverse_omega: f(1.0 / omega.abs()),
            },
            Distortion::Division { k } => DistortionOf::Division { k: f(k) },
            Distortion::InverseRadial { k } => DistortionOf::InverseRadial { k: f(k) },
            Distortion::Eucm { alpha, beta } => DistortionOf::Eucm {
                alpha: f(alpha),
                beta: f(beta),
                cotangent: f(limit.cos() / limit.sin()),
            },
            Distortion::Equirectangular => DistortionOf::Equirectangular,
        };
        let (focal, sensor) = focal_and_sensor(lens);
        Self {
            focal: focal.to_array().map(f),
            principal: lens.principal.to_array().map(f),
            distortion,
            sensor: sensor
                .map(|Sensor { shear, horizon }| [shear, horizon].map(|v| v.to_array().map(f))),
        }
    }

    /// The pixels of points in the camera's frame; what the lens cannot see is put far
    /// outside the image.
    #[inline(always)]
    pub(super) fn project(&self, x: &Lane<T>, y: &Lane<T>, z: &Lane<T>) -> (Lane<T>, Lane<T>) {
        let [zero, one, two] = [0.0, 1.0, 2.0].map(T::of);
        let outside = T::of(OUTSIDE);
        let mut u = [outside; LANES];
        let mut v = [outside; LANES];
        match &self.distortion {
            DistortionOf::None => {
                for k in 0..LANES {
                    let inverse_z = one / z[k];
                    let seen = z[k].above(zero);
                    u[k] = T::either(seen, x[k] * inverse_z, outside);
                    v[k] = T::either(seen, y[k] * inverse_z, outside);
                }
            }
            DistortionOf::Polynomial {
                k: [k1, k2, k3],
                limit_squared,
            } => {
                for k in 0..LANES {
                    let inverse_z = one / z[k];
                    let (a, b) = (x[k] * inverse_z, y[k] * inverse_z);
                    let r2 = a.squared() + b.squared();
                    let radial = one + r2 * (*k1 + r2 * (*k2 + r2 * *k3));
                    let seen = z[k].above(zero) & limit_squared.at_least(r2);
                    u[k] = T::either(seen, a * radial, outside);
                    v[k] = T::either(seen, b * radial, outside);
                }
            }
            DistortionOf::Rational {
                k: c,
                p,
                limit_squared,
            } => {
                for k in 0..LANES {
                    let inverse_z = one / z[k];
                    let (a, b) = (x[k] * inverse_z, y[k] * inverse_z);
                    let (r2, [bent_a, bent_b]) = rational(a, b, c, p);
                    let seen = z[k].above(zero) & limit_squared.at_least(r2);
                    u[k] = T::either(seen, bent_a, outside);
                    v[k] = T::either(seen, bent_b, outside);
                }
            }
            DistortionOf::RationalPrism {
                k: c,
                p,
                s: [once, twice],
                limit_squared,
            } => {
                for k in 0..LANES {
                    let inverse_z = one / z[k];
                    let (a, b) = (x[k] * inverse_z, y[k] * inverse_z);
                    let (r2, [bent_a, bent_b]) = rational(a, b, c, p);
                    let du = r2 * (once[0] + r2 * twice[0]);
                    let dv = r2 * (once[1] + r2 * twice[1]);
                    let seen = z[k].above(zero) & limit_squared.at_least(r2);
                    u[k] = T::either(seen, bent_a + du, outside);
                    v[k] = T::either(seen, bent_b + dv, outside);
                }
            }
            DistortionOf::Fisheye { k: c, limit } => {
                for k in 0..LANES {
                    let radius = (x[k].squared() + y[k].squared()).sqrt();
                    let theta = T::angle(radius, z[k]);
                    let t2 = theta.squared();
                    let bent = theta * (one + t2 * (c[0] + t2 * (c[1] + t2 * (c[2] + t2 * c[3]))));
                    let aside = radius.above(zero);
                    let scale = T::either(aside, bent / radius, one / z[k]);
                    let seen = limit.at_least(theta) & (aside | z[k].above(zero));
                    u[k] = T::either(seen, x[k] * scale, outside);
                    v[k] = T::either(seen, y[k] * scale, outside);
                }
            }
            DistortionOf::Prism {
                k: c,
                p,
                s: [once, twice],
                of_bent,
                limit,
            } => {
                for k in 0..LANES {
                    let radius = (x[k].squared() + y[k].squared()).sqrt();
                    let theta = T::angle(radius, z[k]);
                    let t2 = theta.squared();
                    let higher = c[2] + t2 * (c[3] + t2 * (c[4] + t2 * c[5]));
                    let factor = one + t2 * (c[0] + t2 * (c[1] + t2 * higher));
                    let aside = radius.above(zero);
                    let unbent = T::either(aside, theta / radius, one / z[k]);
                    let scale = if *of_bent { unbent * factor } else { unbent };
                    let (a, b) = (x[k] * scale, y[k] * scale);
                    let r2 = a.squared() + b.squared();
                    let du = two * p[0] * a * b
                        + p[1] * (r2 + two * a.squared())
                        + r2 * (once[0] + r2 * twice[0]);
                    let dv = two * p[1] * a * b
                        + p[0] * (r2 + two * b.squared())
                        + r2 * (once[1] + r2 * twice[1]);
                    let bent = unbent * factor;
                    let seen = limit.at_least(theta) & (aside | z[k].above(zero));
                    u[k] = T::either(seen, x[k] * bent + du, outside);
                    v[k] = T::either(seen, y[k] * bent + dv, outside);
                }
            }
            DistortionOf::Fov { c, inverse_omega } => {
                for k in 0..LANES {
                    let radius = (x[k].squared() + y[k].squared()).sqrt();
                    let bent = T::angle(*c * radius, z[k]) * *inverse_omega;
                    let straight = *c * *inverse_omega / z[k];
                    let scale = T::either(radius.above(zero), bent / radius, straight);
                    let seen = z[k].above(zero);
                    u[k] = T::either(seen, x[k] * scale, outside);
                    v[k] = T::either(seen, y[k] * scale, outside);
                }
            }
            DistortionOf::Division { k: c } => {
                for k in 0..LANES {
                    let four = T::of(4.0) * *c * (x[k].squared() + y[k].squared());
                    let square = z[k].squared() - four;
                    let root = square.max(zero).sqrt();
                    // z + root, without its cancelling behind.
                    let behind = -four / (root - z[k]);
                    let below = T::either(z[k].at_least(zero), z[k] + root, behind);
                    // Straight back is nowhere.
                    let seen = square.above(zero)
                        & (z[k].above(zero) | zero.above(*c))
                        & below.above(T::of(1e-6) * root);
                    u[k] = T::either(seen, x[k] * (two / below), outside);
                    v[k] = T::either(seen, y[k] * (two / below), outside);
                }
            }
            DistortionOf::InverseRadial { k: c } => {
                for k in 0..LANES {
                    let inverse_z = one / z[k];
                    let (a, b) = (x[k] * inverse_z, y[k] * inverse_z);
                    // r = ρg/z, of which the cubic is g + t·g³ = 1.
                    let t = *c * (a.squared() + b.squared());
                    let g = t.cubic_root();
                    // Where t is −4/27 the image folds.
                    let seen = z[k].above(zero)
                        & t.above(T::of(-4.0 / 27.0))
                        & T::of(LARGEST_CUBIC_TERM).above(t);
                    u[k] = T::either(seen, a * g, outside);
                    v[k] = T::either(seen, b * g, outside);
                }
            }
            DistortionOf::Eucm {
                alpha,
                beta,
                cotangent,
            } => {
                for k in 0..LANES {
                    let r2 = x[k].squared() + y[k].squared();
                    let distance = (*beta * r2 + z[k].squared()).sqrt();
                    let (a, b) = (*alpha * distance, (one - *alpha) * z[k]);
                    // a + b, without its cancelling behind.
                    let behind = (*alpha * *alpha * *beta * r2
                        + (two * *alpha - one) * z[k] * z[k])
                        / (a - b);
                    let below = T::either(z[k].at_least(zero), a + b, behind);
                    let seen = z[k].at_least(*cotangent * r2.sqrt())
                        & below.above(T::of(1e-12) * distance);
                    u[k] = T::either(seen, x[k] / below, outside);
                    v[k] = T::either(seen, y[k] / below, outside);
                }
            }
            DistortionOf::Equirectangular => {
                let most = T::of(ALMOST_PI);
                for k in 0..LANES {
                    let level = (x[k].squared() + z[k].squared()).sqrt();
                    let azimuth = T::angle(x[k].abs(), z[k]).min(most);
                    let elevation = T::angle(y[k].abs(), level).min(T::of(0.5 * ALMOST_PI));
                    u[k] = azimuth.with_sign_of(x[k]);
                    v[k] = elevation.with_sign_of(y[k]);
                }
            }
        }
        if let Some([shear, horizon]) = &self.sensor {
            for k in 0..LANES {
                let (a, b) = (u[k], v[k]);
                let w = one + horizon[0] * a + horizon[1] * b;
                let seen = a.above(outside) & w.above(zero);
                u[k] = T::either(seen, (a + shear[0] * b) / w, outside);
                v[k] = T::either(seen, (b + shear[1] * a) / w, outside);
            }
        }
        (
            each(|k| u[k] * self.focal[0] + self.principal[0]),
            each(|k| v[k] * self.focal[1] + self.principal[1]),
        )
    }
}

/// r² and the distorted point of the rational model.
#[inline(always)]
fn rational<T: Scalar>(a: T, b: T, k: &[T; 6], p: &[T; 2]) -> (T, [T; 2]) {
    let [one, two] = [1.0, 2.0].map(T::of);
    let r2 = a.squared() + b.squared();
    let radial = (one + r2 * (k[0] + r2 * (k[1] + r2 * k[2])))
        / (one + r2 * (k[3] + r2 * (k[4] + r2 * k[5])));
    let du = two * p[0] * a * b + p[1] * (r2 + two * a.squared());
    let dv = two * p[1] * a * b + p[0] * (r2 + two * b.squared());
    (r2, [a * radial + du, b * radial + dv])
}
