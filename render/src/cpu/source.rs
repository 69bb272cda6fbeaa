//! What the source views see of a tile of pixels.

mod lens;

use super::lanes::{LANES, Lane, each, vectorised};
use super::scalar::Scalar;
use crate::frame::{Frame, LEVEL_BIAS};
use crate::lens_edge::{LEAST_PX, LensEdge};
use crate::options::Resolution;
use glam::DVec3;
use lens::LensOf;

/// Pixels: their rays (desired camera's frame) and proxy points.
pub(crate) struct Tile<T = f32> {
    pub x: Lane<T>,
    pub y: Lane<T>,
    pub z: Lane<T>,
    /// Inverse distance along the ray; negative where there is no proxy point.
    pub s: Lane<T>,
    /// The proxy's plane there: s = q · ray.
    pub q: [Lane<T>; 3],
}

impl<T: Scalar> Tile<T> {
    /// Of pixels that see nothing.
    pub(crate) fn nothing() -> Self {
        let lane = |value: f32| [T::of(value); LANES];
        Self {
            x: lane(0.0),
            y: lane(0.0),
            z: lane(1.0),
            s: lane(-1.0),
            q: [lane(0.0); 3],
        }
    }

    /// Of pixels whose rays are (x, y, 1), and that see one plane of the proxy.
    #[inline(always)]
    pub(crate) fn of_plane(x: Lane<T>, y: Lane<T>, plane: DVec3) -> Self {
        let [qx, qy, qz] = plane.to_array().map(T::rounded);
        let one = T::of(1.0);
        Self {
            s: each(
                #[inline(always)]
                |k| qx * x[k] + qy * y[k] + qz * one,
            ),
            x,
            y,
            z: [one; LANES],
            q: [[qx; LANES], [qy; LANES], [qz; LANES]],
        }
    }

    /// Lets a pixel see a plane of the proxy along its ray.
    #[inline(always)]
    pub(crate) fn set(&mut self, k: usize, [x, y, z]: [T; 3], plane: DVec3) {
        let [qx, qy, qz] = plane.to_array().map(T::rounded);
        (self.x[k], self.y[k], self.z[k]) = (x, y, z);
        self.s[k] = qx * x + qy * y + qz * z;
        (self.q[0][k], self.q[1][k], self.q[2][k]) = (qx, qy, qz);
    }
}

/// A source view, relative to the desired camera.
pub(crate) struct Source<T = f32> {
    rotation: [[T; 3]; 3],
    translation: [T; 3],
    center: [T; 3],
    lens: LensOf<T>,
    size: [T; 2],
    inverse_feather: T,
    /// Where the lens ends within the photo.
    lens_edge: Option<EdgeOf<T>>,
    footprint_ratio: T,
    footprint_ratio_squared_less_one: T,
    /// Of focal lengths, source to desired.
    focal_ratio_squared: T,
    by_distance: bool,
    desired_by_distance: bool,
    /// What colours are multiplied by; alpha by one.
    pub exposure: glam::Vec4,
    beta: T,
    by_length: bool,
    time_penalty: T,
    /// Whether something can hide points from it.
    occluded: bool,
}

/// Where a tile's proxy points fall in one photo, and what they are worth there.
pub(crate) struct Sight<T = f32> {
    /// Pixels of the photo.
    pub u: Lane<T>,
    pub v: Lane<T>,
    /// Relevance: fovBlend, times the mask where that was asked for; zero where the photo
    /// does not see the point.
    pub a: Lane<T>,
    /// Mip level, ≥ 0.
    pub level: Lane<T>,
    /// Inverse distance from the source centre; only where something can hide the point.
    pub inverse_distance: Lane<T>,
}

impl<T: Scalar> Sight<T> {
    /// Room for one.
    pub(crate) fn nothing() -> Self {
        let zeros = [T::of(0.0); LANES];
        Self {
            u: zeros,
            v: zeros,
            a: zeros,
            level: zeros,
            inverse_distance: zeros,
        }
    }
}

/// What keeps a view on its image's very edge in play when there is no other: too little
/// to be seen beside any.
pub(crate) const EDGE: f32 = 1e-12;

/// A [`LensEdge`] in numbers of a kind.
struct EdgeOf<T> {
    principal: [T; 2],
    inverse_focal: [T; 2],
    radius: T,
    pixels_per_unit: T,
}

impl<T: Scalar> EdgeOf<T> {
    fn new(edge: &LensEdge) -> Self {
        Self {
            principal: edge.principal.to_array().map(T::rounded),
            inverse_focal: edge.focal.recip().to_array().map(T::rounded),
            radius: T::rounded(edge.radius),
            pixels_per_unit: T::rounded(edge.pixels_per_unit()),
        }
    }

    /// Distances of pixels from the photo's border, or from the lens's edge where that is nearer.
    #[inline(always)]
    fn nearer(&self, border: &Lane<T>, u: &Lane<T>, v: &Lane<T>) -> Lane<T> {
        each(
            #[inline(always)]
            |k| {
                let x = (u[k] - self.principal[0]) * self.inverse_focal[0];
                let y = (v[k] - self.principal[1]) * self.inverse_focal[1];
                let left = self.radius - (x.squared() + y.squared()).sqrt();
                border[k].min((left * self.pixels_per_unit).max(T::of(LEAST_PX)))
            },
        )
    }
}

/// A row of a source's transform applied to a tile's points.
#[inline(always)]
fn turned<T: Scalar>(tile: &Tile<T>, row: [T; 3], translation: T) -> Lane<T> {
    let [a, b, c] = row;
    each(
        #[inline(always)]
        |k| a * tile.x[k] + b * tile.y[k] + c * tile.z[k] + translation * tile.s[k],
    )
}

impl<T: Scalar> Source<T> {
    pub(crate) fn new(frame: &Frame<'_>, source_idx: usize) -> Self {
        let source = &frame.sources[source_idx];
        let row = |r: usize| source.rotation.row(r).to_array().map(T::rounded);
        let g = source.footprint_ratio;
        Self {
            rotation: [row(0), row(1), row(2)],
            translation: source.translation.to_array().map(T::rounded),
            center: source.center.to_array().map(T::rounded),
            lens: LensOf::new(&source.lens, frame.skips.lenses),
            size: source.size.map(T::rounded),
            inverse_feather: T::rounded(1.0 / source.feather_px.max(1e-9)),
            lens_edge: source.lens_edge.as_ref().map(EdgeOf::new),
            footprint_ratio: T::rounded(g),
            footprint_ratio_squared_less_one: T::rounded(g * g - 1.0),
            focal_ratio_squared: T::rounded(frame.area_scale(source_idx, DVec3::ZERO)),
            by_distance: source.lens.is_wide(),
            desired_by_distance: frame.desired.lens.is_wide(),
            exposure: DVec3::from_array(source.exposure).as_vec3().extend(1.0),
            beta: T::rounded(frame.options.beta),
            by_length: frame.options.resolution == Resolution::Length,
            time_penalty: T::rounded(source.time_penalty),
            occluded: frame.lumigraph.visibility.is_some(),
        }
    }

    /// Projects a tile into the photo; false where it sees nothing of it.
    pub(crate) fn see(&self, tile: &Tile<T>, sight: &mut Sight<T>) -> bool {
        vectorised(
            #[inline(always)]
            || self.see_by_lanes(tile, sight),
        )
    }

    #[inline(always)]
    fn see_by_lanes(&self, tile: &Tile<T>, sight: &mut Sight<T>) -> bool {
        let [zero, one] = [0.0, 1.0].map(T::of);
        let [rx, ry, rz] = self.rotation;
        let [tx, ty, tz] = self.translation;
        let x = turned(tile, rx, tx);
        let y = turned(tile, ry, ty);
        let z = turned(tile, rz, tz);

        // 1. Through the lens.
        let (u, v) = self.lens.project(&x, &y, &z);

        // 2. fovBlend.
        let [width, height] = self.size;
        let border = each(
            #[inline(always)]
            |k| u[k].min(width - u[k]).min(v[k].min(height - v[k])),
        );
        let within = match &self.lens_edge {
            None => border,
            Some(edge) => edge.nearer(&border, &u, &v),
        };
        let mut seen = false;
        for k in 0..LANES {
            let f = (within[k] * self.inverse_feather).clamp01();
            let fov = (f.squared() * (T::of(3.0) - T::of(2.0) * f)).max(T::of(EDGE));
            let inside = border[k].at_least(zero) & tile.s[k].at_least(zero);
            sight.a[k] = T::either(inside, fov, zero);
            seen |= T::may(inside);
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
                    (x[k].squared() + y[k].squared() + z[k].squared()).sqrt()
                } else {
                    z[k]
                };
                let here = if self.desired_by_distance {
                    (tile.x[k].squared() + tile.y[k].squared() + tile.z[k].squared()).sqrt()
                } else {
                    tile.z[k]
                };
                let ratio = here / there;
                let height = (one - cx * qx[k] - cy * qy[k] - cz * qz[k]).abs();
                let area = self.focal_ratio_squared * height * ratio * ratio * ratio;
                (T::of(0.5) * area.max(one).log2() - T::of(LEVEL_BIAS as f32)).max(zero)
            },
        );
        if self.occluded {
            sight.inverse_distance = each(
                #[inline(always)]
                |k| tile.s[k] / (x[k].squared() + y[k].squared() + z[k].squared()).sqrt(),
            );
        }
        (sight.u, sight.v) = (u, v);
        true
    }

    /// angDiff + β·resDiff and what time adds; see [`Frame::difference`].
    pub(crate) fn difference(&self, tile: &Tile<T>) -> Lane<T> {
        vectorised(
            #[inline(always)]
            || self.difference_by_lanes(tile),
        )
    }

    #[inline(always)]
    fn difference_by_lanes(&self, tile: &Tile<T>) -> Lane<T> {
        let [zero, one, two] = [0.0, 1.0, 2.0].map(T::of);
        let [cx, cy, cz] = self.center;
        let center_squared = cx.squared() + cy.squared() + cz.squared();
        let g = self.footprint_ratio;
        // Each loop without a branch, and its closure part of it: else it is no vector code.
        let angles = each(
            #[inline(always)]
            |k| {
                let (x, y, z, s) = (tile.x[k], tile.y[k], tile.z[k], tile.s[k]);
                let (ax, ay, az) = (cy * z - cz * y, cz * x - cx * z, cx * y - cy * x);
                let across = s * (ax.squared() + ay.squared() + az.squared()).sqrt();
                let ray_squared = x.squared() + y.squared() + z.squared();
                let towards = x * cx + y * cy + z * cz;
                T::angle(across, ray_squared - s * towards)
            },
        );
        let resolutions = if self.by_length {
            each(
                #[inline(always)]
                |k| {
                    let (x, y, z, s) = (tile.x[k], tile.y[k], tile.z[k], tile.s[k]);
                    let ray_squared = x.squared() + y.squared() + z.squared();
                    let squares = s * center_squared - two * (x * cx + y * cy + z * cz);
                    let (dx, dy, dz) = (x - s * cx, y - s * cy, z - s * cz);
                    let there = (dx.squared() + dy.squared() + dz.squared()).sqrt();
                    squares / (there + ray_squared.sqrt())
                },
            )
        } else {
            each(
                #[inline(always)]
                |k| {
                    let (x, y, z, s) = (tile.x[k], tile.y[k], tile.z[k], tile.s[k]);
                    let ray_squared = x.squared() + y.squared() + z.squared();
                    let towards = x * cx + y * cy + z * cz;
                    let excess = (s * s * center_squared - two * s * towards) / ray_squared;
                    (self.footprint_ratio_squared_less_one + g * g * excess)
                        / (g * (one + excess).max(zero).sqrt() + one)
                },
            )
        };
        each(
            #[inline(always)]
            |k| angles[k] + self.time_penalty + self.beta * resolutions[k].max(zero),
        )
    }
}

#[cfg(test)]
mod tests;
