//! What the source views see of a tile of pixels.

mod lens;

use super::lanes::{LANES, Lane, angle, each, log2, vectorised};
use crate::frame::{Frame, LEVEL_BIAS};
use crate::options::Resolution;
use glam::DVec3;
use lens::Lens32;

/// Neighbouring pixels of one row: their rays (desired camera's frame) and proxy points.
pub(crate) struct Tile {
    pub x: Lane,
    pub y: Lane,
    pub z: Lane,
    /// Inverse distance along the ray; negative where there is no proxy point.
    pub s: Lane,
    /// The proxy's plane there: s = q · ray.
    pub q: [Lane; 3],
}

/// A source view in f32, relative to the desired camera.
pub(crate) struct Source {
    rotation: [[f32; 3]; 3],
    translation: [f32; 3],
    center: [f32; 3],
    lens: Lens32,
    size: [f32; 2],
    inverse_feather: f32,
    footprint_ratio: f32,
    footprint_ratio_squared_less_one: f32,
    /// Of focal lengths, source to desired.
    focal_ratio_squared: f32,
    by_distance: bool,
    desired_by_distance: bool,
    /// What colours are multiplied by; alpha by one.
    pub exposure: glam::Vec4,
    beta: f32,
    by_length: bool,
    time_penalty: f32,
    /// Whether something can hide points from it.
    occluded: bool,
}

/// Where a tile's proxy points fall in one photo, and what they are worth there.
pub(crate) struct Sight {
    /// Pixels of the photo.
    pub u: Lane,
    pub v: Lane,
    /// Relevance: fovBlend, times the mask where that was asked for; zero where the photo
    /// does not see the point.
    pub a: Lane,
    /// Mip level, ≥ 0.
    pub level: Lane,
    /// Inverse distance from the source centre; only where something can hide the point.
    pub inverse_distance: Lane,
}

impl Sight {
    /// Room for one.
    pub(crate) fn nothing() -> Self {
        Self {
            u: [0.0; LANES],
            v: [0.0; LANES],
            a: [0.0; LANES],
            level: [0.0; LANES],
            inverse_distance: [0.0; LANES],
        }
    }
}

/// What keeps a view on its image's very edge in play when there is no other: too little
/// to be seen beside any.
const EDGE: f32 = 1e-12;

impl Source {
    pub(crate) fn new(frame: &Frame<'_>, source_idx: usize) -> Self {
        let source = &frame.sources[source_idx];
        let row = |r: usize| source.rotation.row(r).as_vec3().to_array();
        let g = source.footprint_ratio;
        Self {
            rotation: [row(0), row(1), row(2)],
            translation: source.translation.as_vec3().to_array(),
            center: source.center.as_vec3().to_array(),
            lens: Lens32::new(&source.lens),
            size: source.size.map(|v| v as f32),
            inverse_feather: (1.0 / source.feather_px.max(1e-9)) as f32,
            footprint_ratio: g as f32,
            footprint_ratio_squared_less_one: (g * g - 1.0) as f32,
            focal_ratio_squared: frame.area_scale(source_idx, DVec3::ZERO) as f32,
            by_distance: source.lens.is_wide(),
            desired_by_distance: frame.desired.lens.is_wide(),
            exposure: DVec3::from_array(source.exposure).as_vec3().extend(1.0),
            beta: frame.options.beta as f32,
            by_length: frame.options.resolution == Resolution::Length,
            time_penalty: source.time_penalty as f32,
            occluded: frame.lumigraph.visibility.is_some(),
        }
    }

    /// Projects a tile into the photo; false where it sees nothing of it.
    pub(crate) fn see(&self, tile: &Tile, sight: &mut Sight) -> bool {
        vectorised(
            #[inline(always)]
            || self.see_by_lanes(tile, sight),
        )
    }

    #[inline(always)]
    fn see_by_lanes(&self, tile: &Tile, sight: &mut Sight) -> bool {
        let [rx, ry, rz] = self.rotation;
        let [tx, ty, tz] = self.translation;
        let turn = |r: [f32; 3], t: f32| {
            each(|k| r[0] * tile.x[k] + r[1] * tile.y[k] + r[2] * tile.z[k] + t * tile.s[k])
        };
        let (x, y, z) = (turn(rx, tx), turn(ry, ty), turn(rz, tz));

        // 1. Through the lens.
        let (u, v) = self.lens.project(&x, &y, &z);

        // 2. fovBlend.
        let [width, height] = self.size;
        let mut seen = false;
        for k in 0..LANES {
            let border = u[k].min(width - u[k]).min(v[k].min(height - v[k]));
            let f = (border * self.inverse_feather).clamp(0.0, 1.0);
            let fov = (f * f * (3.0 - 2.0 * f)).max(EDGE);
            let inside = (border >= 0.0) & (tile.s[k] >= 0.0);
            sight.a[k] = if inside { fov } else { 0.0 };
            seen |= inside;
        }
        if !seen {
            return false;
        }

        // 3. Mip level; see [`Frame::level_of_detail`].
        let [cx, cy, cz] = self.center;
        let [qx, qy, qz] = &tile.q;
        sight.level = each(
            #[inline(always)]
            |k| {
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
                let height = (1.0 - cx * qx[k] - cy * qy[k] - cz * qz[k]).abs();
                let area = self.focal_ratio_squared * height * ratio * ratio * ratio;
                (0.5 * log2(area.max(1.0)) - LEVEL_BIAS as f32).max(0.0)
            },
        );
        if self.occluded {
            sight.inverse_distance =
                each(|k| tile.s[k] / (x[k] * x[k] + y[k] * y[k] + z[k] * z[k]).sqrt());
        }
        (sight.u, sight.v) = (u, v);
        true
    }

    /// angDiff + β·resDiff and what time adds; see [`Frame::difference`].
    pub(crate) fn difference(&self, tile: &Tile) -> Lane {
        vectorised(
            #[inline(always)]
            || self.difference_by_lanes(tile),
        )
    }

    #[inline(always)]
    fn difference_by_lanes(&self, tile: &Tile) -> Lane {
        let [cx, cy, cz] = self.center;
        let center_squared = cx * cx + cy * cy + cz * cz;
        let g = self.footprint_ratio;
        // Each loop without a branch, and its closure part of it: else it is no vector code.
        let angles = each(
            #[inline(always)]
            |k| {
                let (x, y, z, s) = (tile.x[k], tile.y[k], tile.z[k], tile.s[k]);
                let (ax, ay, az) = (cy * z - cz * y, cz * x - cx * z, cx * y - cy * x);
                let across = s * (ax * ax + ay * ay + az * az).sqrt();
                let ray_squared = x * x + y * y + z * z;
                let towards = x * cx + y * cy + z * cz;
                angle(across, ray_squared - s * towards)
            },
        );
        let resolutions = if self.by_length {
            each(
                #[inline(always)]
                |k| {
                    let (x, y, z, s) = (tile.x[k], tile.y[k], tile.z[k], tile.s[k]);
                    let ray_squared = x * x + y * y + z * z;
                    let squares = s * center_squared - 2.0 * (x * cx + y * cy + z * cz);
                    let (dx, dy, dz) = (x - s * cx, y - s * cy, z - s * cz);
                    squares / ((dx * dx + dy * dy + dz * dz).sqrt() + ray_squared.sqrt())
                },
            )
        } else {
            each(
                #[inline(always)]
                |k| {
                    let (x, y, z, s) = (tile.x[k], tile.y[k], tile.z[k], tile.s[k]);
                    let ray_squared = x * x + y * y + z * z;
                    let towards = x * cx + y * cy + z * cz;
                    let excess = (s * s * center_squared - 2.0 * s * towards) / ray_squared;
                    (self.footprint_ratio_squared_less_one + g * g * excess)
                        / (g * (1.0 + excess).max(0.0).sqrt() + 1.0)
                },
            )
        };
        each(
            #[inline(always)]
            |k| angles[k] + self.time_penalty + self.beta * resolutions[k].max(0.0),
        )
    }
}

#[cfg(test)]
mod tests;
