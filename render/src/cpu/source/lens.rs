//! Lenses in f32, the cheapest formula that is exact for each; `Lens` in `calibrate` says
//! what they mean.

use super::super::lanes::{LANES, Lane, angle, each};
use crate::sensor::{Sensor, focal_and_sensor};
use calibrate::{Distortion, Lens};

/// Keeps a sphere's seam and poles in the image: no rounding error takes them across its
/// border, and it is a thousandth of a pixel at most.
const ALMOST_PI: f32 = 3.141_591;

/// A lens in f32.
pub(super) struct Lens32 {
    focal: [f32; 2],
    principal: [f32; 2],
    distortion: Distortion32,
    sensor: Option<Sensor>,
}

/// What a lens does not see is put here, far outside the image.
const OUTSIDE: f32 = -1e9;
/// Newton's steps for a cubic from 1, which approach its root from one side; beyond this
/// term they stop outside every image.
const CUBIC_STEPS: usize = 8;
const LARGEST_CUBIC_TERM: f32 = 1e6;

enum Distortion32 {
    None,
    Polynomial {
        k: [f32; 3],
        limit_squared: f32,
    },
    Rational {
        k: [f32; 6],
        p: [f32; 2],
        limit_squared: f32,
    },
    /// Rational with thin prisms.
    RationalPrism {
        k: [f32; 6],
        p: [f32; 2],
        /// By r² and by r⁴.
        s: [[f32; 2]; 2],
        limit_squared: f32,
    },
    Fisheye {
        k: [f32; 4],
        limit: f32,
    },
    /// Both fisheyes with tangential and prism terms: those are of the undistorted point, or
    /// of the bent one.
    Prism {
        k: [f32; 6],
        p: [f32; 2],
        /// By r² and by r⁴.
        s: [[f32; 2]; 2],
        of_bent: bool,
        limit: f32,
    },
    Fov {
        /// 2 tan(ω/2)
        c: f32,
        inverse_omega: f32,
    },
    Division {
        k: f32,
    },
    InverseRadial {
        k: f32,
    },
    Eucm {
        alpha: f32,
        beta: f32,
        /// z/ρ at the limit.
        cotangent: f32,
    },
    Equirectangular,
}

impl Lens32 {
    pub(super) fn new(lens: &Lens) -> Self {
        let limit = lens.limit();
        let f = |v: f64| v as f32;
        let distortion = match lens.distortion() {
            Distortion::None => Distortion32::None,
            Distortion::Rational { k, p } if k[3..] == [0.0; 3] && p == [0.0; 2] => {
                Distortion32::Polynomial {
                    k: [f(k[0]), f(k[1]), f(k[2])],
                    limit_squared: f(limit * limit),
                }
            }
            Distortion::Rational { k, p } => Distortion32::Rational {
                k: k.map(f),
                p: p.map(f),
                limit_squared: f(limit * limit),
            },
            Distortion::Tilted { k, p, s, .. } => Distortion32::RationalPrism {
                k: k.map(f),
                p: p.map(f),
                s: [[f(s[0]), f(s[2])], [f(s[1]), f(s[3])]],
                limit_squared: f(limit * limit),
            },
            Distortion::Fisheye { k } | Distortion::SkewedFisheye { k, .. } => {
                Distortion32::Fisheye {
                    k: k.map(f),
                    limit: f(limit),
                }
            }
            Distortion::ThinPrismFisheye { k, p, s } => Distortion32::Prism {
                k: [f(k[0]), f(k[1]), f(k[2]), f(k[3]), 0.0, 0.0],
                p: p.map(f),
                s: [s.map(f), [0.0; 2]],
                of_bent: false,
                limit: f(limit),
            },
            Distortion::RadTanThinPrismFisheye { k, p, s } => Distortion32::Prism {
                k: k.map(f),
                p: [f(p[1]), f(p[0])],
                s: [[f(s[0]), f(s[2])], [f(s[1]), f(s[3])]],
                of_bent: true,
                limit: f(limit),
            },
            Distortion::Fov { omega } => Distortion32::Fov {
                c: f(2.0 * (0.5 * omega.abs()).tan()),
                inverse_omega: f(1.0 / omega.abs()),
            },
            Distortion::Division { k } => Distortion32::Division { k: f(k) },
            Distortion::InverseRadial { k } => Distortion32::InverseRadial { k: f(k) },
            Distortion::Eucm { alpha, beta } => Distortion32::Eucm {
                alpha: f(alpha),
                beta: f(beta),
                cotangent: f(limit.cos() / limit.sin()),
            },
            Distortion::Equirectangular => Distortion32::Equirectangular,
        };
        let (focal, sensor) = focal_and_sensor(lens);
        Self {
            focal: focal.to_array(),
            principal: lens.principal.as_vec2().to_array(),
            distortion,
            sensor,
        }
    }

    /// The pixels of points in the camera's frame; what the lens cannot see is put far
    /// outside the image.
    #[inline(always)]
    pub(super) fn project(&self, x: &Lane, y: &Lane, z: &Lane) -> (Lane, Lane) {
        let mut u = [OUTSIDE; LANES];
        let mut v = [OUTSIDE; LANES];
        match &self.distortion {
            Distortion32::None => {
                for k in 0..LANES {
                    let inverse_z = 1.0 / z[k];
                    u[k] = if z[k] > 0.0 {
                        x[k] * inverse_z
                    } else {
                        OUTSIDE
                    };
                    v[k] = if z[k] > 0.0 {
                        y[k] * inverse_z
                    } else {
                        OUTSIDE
                    };
                }
            }
            Distortion32::Polynomial {
                k: [k1, k2, k3],
                limit_squared,
            } => {
                for k in 0..LANES {
                    let inverse_z = 1.0 / z[k];
                    let (a, b) = (x[k] * inverse_z, y[k] * inverse_z);
                    let r2 = a * a + b * b;
                    let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
                    let seen = (z[k] > 0.0) & (r2 <= *limit_squared);
                    u[k] = if seen { a * radial } else { OUTSIDE };
                    v[k] = if seen { b * radial } else { OUTSIDE };
                }
            }
            Distortion32::Rational {
                k: c,
                p,
                limit_squared,
            } => {
                for k in 0..LANES {
                    let inverse_z = 1.0 / z[k];
                    let (a, b) = (x[k] * inverse_z, y[k] * inverse_z);
                    let (r2, [bent_a, bent_b]) = rational(a, b, c, p);
                    let seen = (z[k] > 0.0) & (r2 <= *limit_squared);
                    u[k] = if seen { bent_a } else { OUTSIDE };
                    v[k] = if seen { bent_b } else { OUTSIDE };
                }
            }
            Distortion32::RationalPrism {
                k: c,
                p,
                s: [once, twice],
                limit_squared,
            } => {
                for k in 0..LANES {
                    let inverse_z = 1.0 / z[k];
                    let (a, b) = (x[k] * inverse_z, y[k] * inverse_z);
                    let (r2, [bent_a, bent_b]) = rational(a, b, c, p);
                    let du = r2 * (once[0] + r2 * twice[0]);
                    let dv = r2 * (once[1] + r2 * twice[1]);
                    let seen = (z[k] > 0.0) & (r2 <= *limit_squared);
                    u[k] = if seen { bent_a + du } else { OUTSIDE };
                    v[k] = if seen { bent_b + dv } else { OUTSIDE };
                }
            }
            Distortion32::Fisheye { k: c, limit } => {
                for k in 0..LANES {
                    let radius = (x[k] * x[k] + y[k] * y[k]).sqrt();
                    let theta = angle(radius, z[k]);
                    let t2 = theta * theta;
                    let bent = theta * (1.0 + t2 * (c[0] + t2 * (c[1] + t2 * (c[2] + t2 * c[3]))));
                    let scale = if radius > 0.0 {
                        bent / radius
                    } else {
                        1.0 / z[k]
                    };
                    let seen = (theta <= *limit) & ((radius > 0.0) | (z[k] > 0.0));
                    u[k] = if seen { x[k] * scale } else { OUTSIDE };
                    v[k] = if seen { y[k] * scale } else { OUTSIDE };
                }
            }
            Distortion32::Prism {
                k: c,
                p,
                s: [once, twice],
                of_bent,
                limit,
            } => {
                for k in 0..LANES {
                    let radius = (x[k] * x[k] + y[k] * y[k]).sqrt();
                    let theta = angle(radius, z[k]);
                    let t2 = theta * theta;
                    let higher = c[2] + t2 * (c[3] + t2 * (c[4] + t2 * c[5]));
                    let factor = 1.0 + t2 * (c[0] + t2 * (c[1] + t2 * higher));
                    let unbent = if radius > 0.0 {
                        theta / radius
                    } else {
                        1.0 / z[k]
                    };
                    let scale = if *of_bent { unbent * factor } else { unbent };
                    let (a, b) = (x[k] * scale, y[k] * scale);
                    let r2 = a * a + b * b;
                    let du = 2.0 * p[0] * a * b
                        + p[1] * (r2 + 2.0 * a * a)
                        + r2 * (once[0] + r2 * twice[0]);
                    let dv = 2.0 * p[1] * a * b
                        + p[0] * (r2 + 2.0 * b * b)
                        + r2 * (once[1] + r2 * twice[1]);
                    let bent = unbent * factor;
                    let seen = (theta <= *limit) & ((radius > 0.0) | (z[k] > 0.0));
                    u[k] = if seen { x[k] * bent + du } else { OUTSIDE };
                    v[k] = if seen { y[k] * bent + dv } else { OUTSIDE };
                }
            }
            Distortion32::Fov { c, inverse_omega } => {
                for k in 0..LANES {
                    let radius = (x[k] * x[k] + y[k] * y[k]).sqrt();
                    let bent = angle(c * radius, z[k]) * inverse_omega;
                    let scale = if radius > 0.0 {
                        bent / radius
                    } else {
                        c * inverse_omega / z[k]
                    };
                    u[k] = if z[k] > 0.0 { x[k] * scale } else { OUTSIDE };
                    v[k] = if z[k] > 0.0 { y[k] * scale } else { OUTSIDE };
                }
            }
            Distortion32::Division { k: c } => {
                for k in 0..LANES {
                    let four = 4.0 * c * (x[k] * x[k] + y[k] * y[k]);
                    let square = z[k] * z[k] - four;
                    let root = square.max(0.0).sqrt();
                    // z + root, without its cancelling behind.
                    let below = if z[k] >= 0.0 {
                        z[k] + root
                    } else {
                        -four / (root - z[k])
                    };
                    // Straight back is nowhere.
                    let seen = (square > 0.0) & ((z[k] > 0.0) | (*c < 0.0)) & (below > 1e-6 * root);
                    u[k] = if seen { x[k] * (2.0 / below) } else { OUTSIDE };
                    v[k] = if seen { y[k] * (2.0 / below) } else { OUTSIDE };
                }
            }
            Distortion32::InverseRadial { k: c } => {
                for k in 0..LANES {
                    let inverse_z = 1.0 / z[k];
                    let (a, b) = (x[k] * inverse_z, y[k] * inverse_z);
                    // r = ρg/z, of which the cubic is g + t·g³ = 1.
                    let t = c * (a * a + b * b);
                    let mut g = 1.0;
                    for _ in 0..CUBIC_STEPS {
                        let term = t * g * g;
                        g = (1.0 + 2.0 * term * g) / (1.0 + 3.0 * term);
                    }
                    // Where t is −4/27 the image folds.
                    let seen = (z[k] > 0.0) & (t > -4.0 / 27.0) & (t < LARGEST_CUBIC_TERM);
                    u[k] = if seen { a * g } else { OUTSIDE };
                    v[k] = if seen { b * g } else { OUTSIDE };
                }
            }
            Distortion32::Eucm {
                alpha,
                beta,
                cotangent,
            } => {
                for k in 0..LANES {
                    let r2 = x[k] * x[k] + y[k] * y[k];
                    let distance = (beta * r2 + z[k] * z[k]).sqrt();
                    let (a, b) = (alpha * distance, (1.0 - alpha) * z[k]);
                    // a + b, without its cancelling behind.
                    let below = if z[k] >= 0.0 {
                        a + b
                    } else {
                        (alpha * alpha * beta * r2 + (2.0 * alpha - 1.0) * z[k] * z[k]) / (a - b)
                    };
                    let seen = (z[k] >= cotangent * r2.sqrt()) & (below > 1e-12 * distance);
                    u[k] = if seen { x[k] / below } else { OUTSIDE };
                    v[k] = if seen { y[k] / below } else { OUTSIDE };
                }
            }
            Distortion32::Equirectangular => {
                for k in 0..LANES {
                    let level = (x[k] * x[k] + z[k] * z[k]).sqrt();
                    u[k] = angle(x[k].abs(), z[k]).min(ALMOST_PI).copysign(x[k]);
                    v[k] = angle(y[k].abs(), level).min(0.5 * ALMOST_PI).copysign(y[k]);
                }
            }
        }
        if let Some(Sensor { shear, horizon }) = &self.sensor {
            for k in 0..LANES {
                let (a, b) = (u[k], v[k]);
                let w = 1.0 + horizon.x * a + horizon.y * b;
                let seen = (a != OUTSIDE) & (w > 0.0);
                u[k] = if seen { (a + shear.x * b) / w } else { OUTSIDE };
                v[k] = if seen { (b + shear.y * a) / w } else { OUTSIDE };
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
fn rational(a: f32, b: f32, k: &[f32; 6], p: &[f32; 2]) -> (f32, [f32; 2]) {
    let r2 = a * a + b * b;
    let radial = (1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[2])))
        / (1.0 + r2 * (k[3] + r2 * (k[4] + r2 * k[5])));
    let du = 2.0 * p[0] * a * b + p[1] * (r2 + 2.0 * a * a);
    let dv = 2.0 * p[1] * a * b + p[0] * (r2 + 2.0 * b * b);
    (r2, [a * radial + du, b * radial + dv])
}
