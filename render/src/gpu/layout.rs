//! The structs that shaders read, byte for byte. A test compares them with what the
//! shader compiler lays out.

use super::groups::Rect;
use crate::frame::{Frame, FrameSource};
use crate::options::{Blend, Resolution};
use crate::sensor::focal_and_sensor;
use crate::surface::Surface;
use bytemuck::{Pod, Zeroable};
use calibrate::Distortion;
use glam::DVec3;

/// `Params` of common.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct Params {
    pub plane: [f32; 3],
    pub rays_in_table: u32,
    pub ray_scale: [f32; 2],
    pub ray_offset: [f32; 2],
    pub array_size: [f32; 2],
    pub size: [u32; 2],
    pub source_count: u32,
    pub desired_by_distance: u32,
    pub beta: f32,
    pub full_weight: f32,
    pub k: u32,
    pub blend: u32,
    pub resolution: u32,
    pub plane_seen: u32,
    pub exposures_differ: u32,
    pub timed: u32,
    pub facets: u32,
    pub finest: f32,
    pub part_origin: [u32; 2],
    pub part_size: [u32; 2],
}

/// A source view: the texels that common.wgsl names, in order.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct Source {
    pub axes: [[f32; 4]; 3],
    pub focal: [f32; 2],
    pub principal: [f32; 2],
    /// k₁, k₂, p₁, p₂; of lenses in closed form their own parameters.
    pub lens: [f32; 4],
    /// k₃ to k₆.
    pub lens_rest: [f32; 4],
    pub size: [f32; 2],
    pub inverse_feather: f32,
    pub limit: f32,
    pub kind: f32,
    pub layer: f32,
    pub footprint_excess: f32,
    pub wide: f32,
    pub center: [f32; 4],
    pub exposure: [f32; 4],
    pub prism: [f32; 4],
    pub shear: [f32; 2],
    pub horizon: [f32; 2],
    pub mask_layer: f32,
    pub time_penalty: f32,
    pub distance_layer: f32,
    /// What turns the inverse of a scaled distance into the distance map's units.
    pub distance_scale: f32,
}

/// `Corner`'s inputs of triangulated.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct Corner {
    /// In normalised device coordinates, y upwards.
    pub at: [f32; 2],
    pub list: [u32; 2],
}

/// A texel of triangulated.wgsl's entries.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct Entry {
    pub source_idx: f32,
    pub values: [f32; 3],
}

/// Source views of a row of their texture.
pub(crate) const SOURCES_PER_ROW: u32 = 128;
/// Texels of a row of the sources' texture, and of the entries'.
pub(crate) const SOURCE_ROW: u32 = SOURCES_PER_ROW * (size_of::<Source>() / 16) as u32;
/// See [`SOURCE_ROW`].
pub(crate) const ENTRY_ROW: u32 = 1024;

pub(super) const LENS_PINHOLE: f32 = 0.0;
pub(super) const LENS_RATIONAL: f32 = 1.0;
pub(super) const LENS_FISHEYE: f32 = 2.0;
pub(super) const LENS_BROWN: f32 = 3.0;
pub(super) const LENS_THIN_PRISM: f32 = 4.0;
pub(super) const LENS_BENT_PRISM: f32 = 5.0;
pub(super) const LENS_FOV: f32 = 6.0;
pub(super) const LENS_DIVISION: f32 = 7.0;
pub(super) const LENS_EUCM: f32 = 8.0;
pub(super) const LENS_EQUIRECTANGULAR: f32 = 9.0;
pub(super) const LENS_INVERSE_RADIAL: f32 = 10.0;
pub(super) const LENS_TILTED: f32 = 11.0;
pub(super) const LENS_SKEWED_FISHEYE: f32 = 12.0;

impl Params {
    pub(crate) fn of(frame: &Frame<'_>, array_size: [u32; 2], finest: usize, part: Rect) -> Self {
        let lens = frame.desired.lens;
        Self {
            plane: common_plane(frame).as_vec3().to_array(),
            rays_in_table: u32::from(lens.distortion() != Distortion::None),
            ray_scale: (1.0 / lens.focal).as_vec2().to_array(),
            ray_offset: lens.principal.as_vec2().to_array(),
            array_size: array_size.map(|v| v as f32),
            size: [frame.desired.width, frame.desired.height],
            source_count: frame.taking_part().count() as u32,
            desired_by_distance: u32::from(lens.is_wide()),
            beta: frame.options.beta as f32,
            full_weight: frame.options.full_weight() as f32,
            k: frame.options.k as u32,
            blend: match frame.options.blend {
                Blend::Consistent => 0,
                Blend::Paper => 1,
            },
            resolution: match frame.options.resolution {
                Resolution::Footprint | Resolution::Distance => 0,
                Resolution::Length => 1,
            },
            plane_seen: u32::from(frame.surface != Surface::Nothing),
            exposures_differ: u32::from(frame.exposures_differ()),
            timed: u32::from(frame.sources.iter().any(|s| s.time_penalty > 0.0)),
            facets: u32::from(matches!(frame.surface, Surface::Facets(_))),
            finest: finest as f32,
            part_origin: part.origin,
            part_size: part.size,
        }
    }
}

impl Source {
    /// `layers` are those of the photo's, the mask's and the distance map's array; of a photo
    /// that is not on the device any will do.
    pub(crate) fn of(
        frame: &Frame<'_>,
        source_idx: usize,
        [photo, mask, distances]: [Option<u32>; 3],
    ) -> Self {
        let source: &FrameSource = &frame.sources[source_idx];
        // Depths scaled by the cube root of the ratio of areas make the ratio's cube the
        // area (facets add a factor of their own). In the plane of the proxy that is zero,
        // but nothing is seen from there.
        let area = frame.area_scale(source_idx, common_plane(frame));
        let scale = area.clamp(1e-12, 1e12).cbrt().recip();
        let axis = |r: usize| {
            let row = source.rotation.row(r).extend(source.translation[r]);
            (row * scale).as_vec4().to_array()
        };
        let g = source.footprint_ratio;
        let limit = source.lens.limit();
        let f = |v: f64| v as f32;
        let none = [0.0; 4];
        let (lens, lens_rest, prism, limit) = match source.lens.distortion() {
            Distortion::None => (none, none, none, f64::INFINITY),
            Distortion::Rational { k, p } => (
                [k[0], k[1], p[0], p[1]],
                [k[2], k[3], k[4], k[5]],
                none,
                limit * limit,
            ),
            Distortion::Tilted { k, p, s, .. } => (
                [k[0], k[1], p[0], p[1]],
                [k[2], k[3], k[4], k[5]],
                [s[0], s[2], s[1], s[3]],
                limit * limit,
            ),
            Distortion::Fisheye { k } | Distortion::SkewedFisheye { k, .. } => {
                ([k[0], k[1], 0.0, 0.0], [k[2], k[3], 0.0, 0.0], none, limit)
            }
            Distortion::ThinPrismFisheye { k, p, s } => (
                [k[0], k[1], p[0], p[1]],
                [k[2], k[3], 0.0, 0.0],
                [s[0], s[1], 0.0, 0.0],
                limit,
            ),
            // Its tangential terms are numbered the other way round.
            Distortion::RadTanThinPrismFisheye { k, p, s } => (
                [k[0], k[1], p[1], p[0]],
                [k[2], k[3], k[4], k[5]],
                [s[0], s[2], s[1], s[3]],
                limit,
            ),
            Distortion::Fov { omega } => {
                let omega = omega.abs();
                let lens = [2.0 * (0.5 * omega).tan(), 1.0 / omega, 0.0, 0.0];
                (lens, none, none, limit)
            }
            Distortion::Division { k } | Distortion::InverseRadial { k } => {
                ([k, 0.0, 0.0, 0.0], none, none, limit)
            }
            Distortion::Eucm { alpha, beta } => {
                let cotangent = limit.cos() / limit.sin();
                ([alpha, beta, cotangent, 0.0], none, none, limit)
            }
            Distortion::Equirectangular => (none, none, none, limit),
        };
        let (focal, sensor) = focal_and_sensor(&source.lens);
        Self {
            axes: [axis(0), axis(1), axis(2)],
            focal: focal.as_vec2().to_array(),
            principal: source.lens.principal.as_vec2().to_array(),
            lens: lens.map(f),
            lens_rest: lens_rest.map(f),
            size: source.size.map(f),
            inverse_feather: f(1.0 / source.feather_px.max(1e-9)),
            limit: f(limit.min(1e30)),
            kind: lens_kind(source.lens.distortion()),
            layer: photo.unwrap_or(0) as f32,
            footprint_excess: f(g * g - 1.0),
            wide: f32::from(u8::from(source.lens.is_wide())),
            center: source.center.as_vec3().extend(f(g)).to_array(),
            exposure: DVec3::from_array(source.exposure)
                .as_vec3()
                .extend(1.0)
                .to_array(),
            prism: prism.map(f),
            shear: sensor.map_or([0.0; 2], |sensor| sensor.shear.as_vec2().to_array()),
            horizon: sensor.map_or([0.0; 2], |sensor| sensor.horizon.as_vec2().to_array()),
            mask_layer: mask.map_or(-1.0, |layer| layer as f32),
            time_penalty: f(source.time_penalty),
            distance_layer: distances.map_or(-1.0, |layer| layer as f32),
            distance_scale: distances.map_or(0.0, |_| {
                let visibility = frame.lumigraph.visibility.as_ref();
                visibility.map_or(0.0, |v| f(scale / v.map(source_idx).unit))
            }),
        }
    }
}

/// The plane that all pixels see; zero where there are many.
fn common_plane(frame: &Frame<'_>) -> DVec3 {
    match frame.surface {
        Surface::Plane(plane) => plane,
        Surface::Nothing | Surface::Facets(_) => DVec3::ZERO,
    }
}

/// What shaders are specialised to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Special {
    /// The kind of lens that all source views have, if it is one; as the shaders number
    /// them.
    pub common_lens: Option<f32>,
    /// Whether any source view has an ignore mask.
    pub masked: bool,
    /// Whether the proxy can hide a part of itself.
    pub occluded: bool,
}

impl Special {
    pub(crate) fn of(frame: &Frame<'_>) -> Self {
        let mut kinds = frame.sources.iter().map(|s| lens_kind(s.lens.distortion()));
        let first = kinds.next();
        Self {
            common_lens: first.filter(|first| kinds.all(|kind| kind == *first)),
            masked: frame.lumigraph.photos.any_masked(),
            occluded: frame.lumigraph.visibility.is_some(),
        }
    }

    /// The shaders' constants.
    pub(super) fn constants(self) -> [(&'static str, f64); 3] {
        let lens = f64::from(self.common_lens.unwrap_or(-1.0));
        let flag = |set: bool| f64::from(u8::from(set));
        [
            ("COMMON_LENS", lens),
            ("MASKED", flag(self.masked)),
            ("OCCLUDED", flag(self.occluded)),
        ]
    }

    /// Different for each.
    pub(super) fn key(self) -> (u32, bool, bool) {
        // Lenses' numbers are small and whole; those of views that differ share one more.
        let lens = self.common_lens.map_or(u32::MAX, |lens| lens as u32);
        (lens, self.masked, self.occluded)
    }
}

fn lens_kind(distortion: Distortion) -> f32 {
    match distortion {
        Distortion::None => LENS_PINHOLE,
        Distortion::Rational { k, .. } if k[2..] == [0.0; 4] => LENS_BROWN,
        Distortion::Rational { .. } => LENS_RATIONAL,
        Distortion::Tilted { .. } => LENS_TILTED,
        Distortion::Fisheye { .. } => LENS_FISHEYE,
        Distortion::SkewedFisheye { .. } => LENS_SKEWED_FISHEYE,
        Distortion::ThinPrismFisheye { .. } => LENS_THIN_PRISM,
        Distortion::RadTanThinPrismFisheye { .. } => LENS_BENT_PRISM,
        Distortion::Fov { .. } => LENS_FOV,
        Distortion::Division { .. } => LENS_DIVISION,
        Distortion::InverseRadial { .. } => LENS_INVERSE_RADIAL,
        Distortion::Eucm { .. } => LENS_EUCM,
        Distortion::Equirectangular => LENS_EQUIRECTANGULAR,
    }
}

#[cfg(test)]
mod tests;
