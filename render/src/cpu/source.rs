//! What the source views see of a tile of pixels.

use super::lanes::{LANES, Lane, angle, each, log2};
use crate::frame::{Frame, LEVEL_BIAS};
use crate::options::Resolution;
use calibrate::Distortion;
use glam::DVec3;

/// Neighbouring pixels of one row: their rays (desired camera's frame) and proxy points.
pub(crate) struct Tile {
    pub x: Lane,
    pub y: Lane,
    pub z: Lane,
    /// Inverse distance along the ray; negative where there is no proxy point.
    pub s: Lane,
}

/// A source view in f32, relative to the desired camera.
pub(crate) struct Source {
    rotation: [[f32; 3]; 3],
    translation: [f32; 3],
    center: [f32; 3],
    focal: [f32; 2],
    principal: [f32; 2],
    distortion: Distortion32,
    size: [f32; 2],
    inverse_feather: f32,
    footprint_ratio: f32,
    footprint_ratio_squared_less_one: f32,
    /// Ratio of areas at equal depth, desired to source pixels.
    area_scale: f32,
    by_distance: bool,
    desired_by_distance: bool,
    pub gain: [f32; 3],
    beta: f32,
    by_length: bool,
}

/// The lens formulas, the cheapest that is exact.
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
    Fisheye {
        k: [f32; 4],
        limit: f32,
    },
}

/// Where a tile's proxy points fall in one photo, and what they are worth there.
pub(crate) struct Sight {
    /// Pixels of the photo.
    pub u: Lane,
    pub v: Lane,
    /// fovBlend; zero where the photo does not see the point.
    pub a: Lane,
    /// Mip level, ≥ 0.
    pub level: Lane,
}

/// What keeps a view on its image's very edge in play when there is no other: too little
/// to be seen beside any.
const EDGE: f32 = 1e-12;

impl Source {
    pub(crate) fn new(frame: &Frame<'_>, source_idx: usize) -> Self {
        let source = &frame.sources[source_idx];
        let row = |r: usize| source.rotation.row(r).as_vec3().to_array();
        let limit = source.lens.limit();
        let distortion = match source.lens.distortion() {
            Distortion::None => Distortion32::None,
            Distortion::Rational { k, p } if k[3..] == [0.0; 3] && p == [0.0; 2] => {
                let k = [k[0] as f32, k[1] as f32, k[2] as f32];
                Distortion32::Polynomial {
                    k,
                    limit_squared: (limit * limit) as f32,
                }
            }
            Distortion::Rational { k, p } => Distortion32::Rational {
                k: k.map(|v| v as f32),
                p: p.map(|v| v as f32),
                limit_squared: (limit * limit) as f32,
            },
            Distortion::Fisheye { k } => Distortion32::Fisheye {
                k: k.map(|v| v as f32),
                limit: limit as f32,
            },
        };
        let is_fisheye = |d| matches!(d, Distortion::Fisheye { .. });
        let g = source.footprint_ratio;
        Self {
            rotation: [row(0), row(1), row(2)],
            translation: source.translation.as_vec3().to_array(),
            center: source.center.as_vec3().to_array(),
            focal: source.lens.focal.as_vec2().to_array(),
            principal: source.lens.principal.as_vec2().to_array(),
            distortion,
            size: source.size.map(|v| v as f32),
            inverse_feather: (1.0 / source.feather_px.max(1e-9)) as f32,
            footprint_ratio: g as f32,
            footprint_ratio_squared_less_one: (g * g - 1.0) as f32,
            area_scale: frame.area_scale(source_idx, frame.plane.unwrap_or(DVec3::ZERO)) as f32,
            by_distance: is_fisheye(source.lens.distortion()),
            desired_by_distance: is_fisheye(frame.desired.lens.distortion()),
            gain: frame.lumigraph.sources[source_idx].gain.map(|v| v as f32),
            beta: frame.options.beta as f32,
            by_length: frame.options.resolution == Resolution::Length,
        }
    }

    /// Projects a tile into the photo; `None` where it sees nothing of it.
    pub(crate) fn see(&self, tile: &Tile) -> Option<Sight> {
        let [rx, ry, rz] = self.rotation;
        let [tx, ty, tz] = self.translation;
        let turn = |r: [f32; 3], t: f32| {
            each(|k| r[0] * tile.x[k] + r[1] * tile.y[k] + r[2] * tile.z[k] + t * tile.s[k])
        };
        let (x, y, z) = (turn(rx, tx), turn(ry, ty), turn(rz, tz));

        // 1. Through the lens. What it cannot see is put far outside the image.
        const OUTSIDE: f32 = -1e9;
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
                    let r2 = a * a + b * b;
                    let radial = (1.0 + r2 * (c[0] + r2 * (c[1] + r2 * c[2])))
                        / (1.0 + r2 * (c[3] + r2 * (c[4] + r2 * c[5])));
                    let du = 2.0 * p[0] * a * b + p[1] * (r2 + 2.0 * a * a);
                    let dv = 2.0 * p[1] * a * b + p[0] * (r2 + 2.0 * b * b);
                    let seen = (z[k] > 0.0) & (r2 <= *limit_squared);
                    u[k] = if seen { a * radial + du } else { OUTSIDE };
                    v[k] = if seen { b * radial + dv } else { OUTSIDE };
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
        }
        let u = each(|k| u[k] * self.focal[0] + self.principal[0]);
        let v = each(|k| v[k] * self.focal[1] + self.principal[1]);

        // 2. fovBlend.
        let [width, height] = self.size;
        let mut seen = false;
        let mut a = [0.0; LANES];
        for k in 0..LANES {
            let border = u[k].min(width - u[k]).min(v[k].min(height - v[k]));
            let f = (border * self.inverse_feather).clamp(0.0, 1.0);
            let fov = (f * f * (3.0 - 2.0 * f)).max(EDGE);
            let inside = (border >= 0.0) & (tile.s[k] >= 0.0);
            a[k] = if inside { fov } else { 0.0 };
            seen |= inside;
        }
        if !seen {
            return None;
        }

        // 3. Mip level.
        let level = each(|k| {
            let there = if self.by_distance {
                (x[k] * x[k] + y[k] * y[k] + z[k] * z[k]).sqrt()
            } else {
                z[k]
            };
            let here = if self.desired_by_distance {
                (tile.x[k] * tile.x[k] + tile.y[k] * tile.y[k] + tile.z[k] * tile.z[k]).sqrt()
            } else {
                tile.z[k]
            };
            let ratio = here / there;
            let area = self.area_scale * ratio * ratio * ratio;
            (0.5 * log2(area.max(1.0)) - LEVEL_BIAS as f32).max(0.0)
        });
        Some(Sight { u, v, a, level })
    }

    /// angDiff + β·resDiff; see [`Frame::difference`].
    pub(crate) fn difference(&self, tile: &Tile) -> Lane {
        let [cx, cy, cz] = self.center;
        let center_squared = cx * cx + cy * cy + cz * cz;
        let g = self.footprint_ratio;
        each(|k| {
            let (x, y, z, s) = (tile.x[k], tile.y[k], tile.z[k], tile.s[k]);
            let (ax, ay, az) = (cy * z - cz * y, cz * x - cx * z, cx * y - cy * x);
            let across = s * (ax * ax + ay * ay + az * az).sqrt();
            let ray_squared = x * x + y * y + z * z;
            let towards = x * cx + y * cy + z * cz;
            let ang = angle(across, ray_squared - s * towards);
            let resolution = if self.by_length {
                let squares = s * center_squared - 2.0 * towards;
                let (dx, dy, dz) = (x - s * cx, y - s * cy, z - s * cz);
                squares / ((dx * dx + dy * dy + dz * dz).sqrt() + ray_squared.sqrt())
            } else {
                let excess = (s * s * center_squared - 2.0 * s * towards) / ray_squared;
                (self.footprint_ratio_squared_less_one + g * g * excess)
                    / (g * (1.0 + excess).max(0.0).sqrt() + 1.0)
            };
            ang + self.beta * resolution.max(0.0)
        })
    }
}
