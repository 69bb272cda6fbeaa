//! The structs that shaders read, byte for byte. A test compares them with what the
//! shader compiler lays out.

use super::groups::Rect;
use crate::frame::{Frame, FrameSource};
use crate::options::{Blend, Resolution};
use crate::sensor::focal_and_sensor;
use crate::surface::Surface;
use crate::tiles::TILE;
use bytemuck::{Pod, Zeroable};
use calibrate::Distortion;
use glam::DVec3;

/// `Params` of common.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct Params {
    pub plane: [f32; 3],
    pub beta: f32,
    pub ray_scale: [f32; 2],
    pub ray_offset: [f32; 2],
    /// Of any source view.
    pub image: [f32; 4],
    pub array_size: [f32; 2],
    pub part_origin: [u32; 2],
    pub part_size: [u32; 2],
    pub full_weight: f32,
    pub k: u32,
    pub finest: f32,
    pub plane_seen: f32,
    /// Bits of a place within a row of the planes' table, and of the facets'.
    pub table_row_bits: u32,
    /// Of the facets' table.
    pub tiles_across: u32,
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
    /// Size, inverse feather, the lens' limit.
    pub image: [f32; 4],
    pub kind: f32,
    pub layer: f32,
    pub footprint_excess: f32,
    /// See KIND of common.wgsl.
    pub edge: f32,
    pub center: [f32; 4],
    pub exposure: [f32; 3],
    /// How many source views there are; their table says, when it is made.
    pub count: f32,
    pub prism: [f32; 4],
    pub shear: [f32; 2],
    pub horizon: [f32; 2],
    pub mask_layer: f32,
    pub time_penalty: f32,
    pub distance_layer: f32,
    /// What turns the inverse of a distance into the distance map's units.
    pub distance_scale: f32,
}

/// A vertex of seen.wgsl: in normalised device coordinates, y upwards.
pub(crate) type Corner = [f32; 2];

/// Two texels of triangulated.wgsl's triangles.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct Triangle {
    /// In pixels.
    pub corners: [[f32; 2]; 3],
    pub first_entry: u32,
    /// Twice the number of entries, one more if it is bordered.
    pub count_and_bordered: u32,
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
    pub(crate) fn of(
        frame: &Frame<'_>,
        array_size: [u32; 2],
        finest: usize,
        part: Rect,
        table_row_bits: u32,
    ) -> Self {
        let lens = frame.desired.lens;
        Self {
            plane: common_plane(frame).as_vec3().to_array(),
            beta: frame.options.beta as f32,
            ray_scale: (1.0 / lens.focal).as_vec2().to_array(),
            ray_offset: lens.principal.as_vec2().to_array(),
            image: frame.sources.first().map_or([0.0; 4], image),
            array_size: array_size.map(|v| v as f32),
            part_origin: part.origin,
            part_size: part.size,
            full_weight: frame.options.full_weight() as f32,
            k: frame.options.k as u32,
            finest: finest as f32,
            plane_seen: f32::from(u8::from(frame.surface != Surface::Nothing)),
            table_row_bits,
            tiles_across: frame.desired.width.div_ceil(TILE as u32),
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
        let axis = |r: usize| source.rotation.row(r).extend(source.translation[r]) * scale;
        let mut axes = [axis(0), axis(1), axis(2)];
        if source.lens.distortion() == Distortion::None {
            let (focal, principal) = (source.lens.focal, source.lens.principal);
            axes[0] = axes[0] * focal.x + axes[2] * principal.x;
            axes[1] = axes[1] * focal.y + axes[2] * principal.y;
        }
        let g = source.footprint_ratio;
        let f = |v: f64| v as f32;
        let none = [0.0; 4];
        let (lens, lens_rest, prism) = match source.lens.distortion() {
            Distortion::None | Distortion::Equirectangular => (none, none, none),
            Distortion::Rational { k, p } => {
                ([k[0], k[1], p[0], p[1]], [k[2], k[3], k[4], k[5]], none)
            }
            Distortion::Tilted { k, p, s, .. } => (
                [k[0], k[1], p[0], p[1]],
                [k[2], k[3], k[4], k[5]],
                [s[0], s[2], s[1], s[3]],
            ),
            Distortion::Fisheye { k } | Distortion::SkewedFisheye { k, .. } => {
                ([k[0], k[1], 0.0, 0.0], [k[2], k[3], 0.0, 0.0], none)
            }
            Distortion::ThinPrismFisheye { k, p, s } => (
                [k[0], k[1], p[0], p[1]],
                [k[2], k[3], 0.0, 0.0],
                [s[0], s[1], 0.0, 0.0],
            ),
            // Its tangential terms are numbered the other way round.
            Distortion::RadTanThinPrismFisheye { k, p, s } => (
                [k[0], k[1], p[1], p[0]],
                [k[2], k[3], k[4], k[5]],
                [s[0], s[2], s[1], s[3]],
            ),
            Distortion::Fov { omega } => {
                let omega = omega.abs();
                let lens = [2.0 * (0.5 * omega).tan(), 1.0 / omega, 0.0, 0.0];
                (lens, none, none)
            }
            Distortion::Division { k } | Distortion::InverseRadial { k } => {
                ([k, 0.0, 0.0, 0.0], none, none)
            }
            Distortion::Eucm { alpha, beta } => {
                let limit = source.lens.limit();
                ([alpha, beta, limit.cos() / limit.sin(), 0.0], none, none)
            }
        };
        let (focal, sensor) = focal_and_sensor(&source.lens);
        Self {
            axes: axes.map(|axis| axis.as_vec4().to_array()),
            focal: focal.as_vec2().to_array(),
            principal: source.lens.principal.as_vec2().to_array(),
            lens: lens.map(f),
            lens_rest: lens_rest.map(f),
            image: image(source),
            kind: lens_kind(source.lens.distortion()),
            layer: photo.unwrap_or(0) as f32,
            footprint_excess: f(g * g - 1.0),
            edge: edge(source),
            center: source.center.as_vec3().extend(f(g)).to_array(),
            exposure: source.exposure.map(f),
            count: 0.0,
            prism: prism.map(f),
            shear: sensor.map_or([0.0; 2], |sensor| sensor.shear.as_vec2().to_array()),
            horizon: sensor.map_or([0.0; 2], |sensor| sensor.horizon.as_vec2().to_array()),
            mask_layer: mask.map_or(-1.0, |layer| layer as f32),
            time_penalty: f(source.time_penalty),
            distance_layer: distances.map_or(-1.0, |layer| layer as f32),
            distance_scale: distances.map_or(0.0, |_| {
                let visibility = frame.lumigraph.visibility.as_ref();
                visibility.map_or(0.0, |v| f(1.0 / v.map(source_idx).unit))
            }),
        }
    }
}

/// IMAGE of common.wgsl.
fn image(source: &FrameSource) -> [f32; 4] {
    let limit = source.lens.limit();
    let limit = match source.lens.distortion() {
        Distortion::None => f64::INFINITY,
        Distortion::Rational { .. } | Distortion::Tilted { .. } => limit * limit,
        _ => limit,
    };
    let [width, height] = source.size;
    let inverse_feather = 1.0 / source.feather_px.max(1e-9);
    [width, height, inverse_feather, limit.min(1e30)].map(|v| v as f32)
}

/// The radius of the lens's edge within its photo, 1e30 where it has none; negative unless the level of
/// detail follows the distance.
fn edge(source: &FrameSource) -> f32 {
    let radius = source.lens_edge.map_or(1e30, |edge| edge.radius as f32);
    if source.lens.is_wide() {
        radius
    } else {
        -radius
    }
}

/// The plane that all pixels see; zero where there are many.
fn common_plane(frame: &Frame<'_>) -> DVec3 {
    match frame.surface {
        Surface::Plane(plane) => plane,
        Surface::Nothing | Surface::Facets(_) => DVec3::ZERO,
    }
}

/// What shaders are specialised to: the constants that common.wgsl names.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Special {
    /// The kind of lens that all source views have, if it is one; as the shaders number
    /// them.
    common_lens: Option<u8>,
    same_images: bool,
    lens_edges: bool,
    masked: bool,
    occluded: bool,
    facets: bool,
    rays_in_table: bool,
    by_distance: bool,
    exposed: bool,
    timed: bool,
    blend_of_paper: bool,
    resolution_by_length: bool,
}

impl Special {
    pub(crate) fn of(frame: &Frame<'_>) -> Self {
        // Lenses' numbers are small and whole.
        let mut kinds = frame
            .sources
            .iter()
            .map(|s| lens_kind(s.lens.distortion()) as u8);
        let first = kinds.next();
        let mut images = frame.sources.iter().map(image);
        let first_image = images.next();
        let desired = frame.desired.lens;
        Self {
            common_lens: first.filter(|first| kinds.all(|kind| kind == *first)),
            same_images: images.all(|image| Some(image) == first_image),
            lens_edges: frame.sources.iter().any(|s| s.lens_edge.is_some()),
            masked: frame.lumigraph.photos.any_masked(),
            occluded: frame.lumigraph.visibility.is_some(),
            facets: matches!(frame.surface, Surface::Facets(_)),
            rays_in_table: desired.distortion() != Distortion::None,
            by_distance: desired.is_wide(),
            exposed: frame.exposures_differ(),
            timed: frame.sources.iter().any(|s| s.time_penalty > 0.0),
            blend_of_paper: frame.options.blend == Blend::Paper,
            resolution_by_length: frame.options.resolution == Resolution::Length,
        }
    }

    /// The shaders' constants.
    pub(super) fn constants(self) -> [(&'static str, f64); 12] {
        let flag = |set: bool| f64::from(u8::from(set));
        [
            ("COMMON_LENS", self.common_lens.map_or(-1.0, f64::from)),
            ("SAME_IMAGES", flag(self.same_images)),
            ("LENS_EDGES", flag(self.lens_edges)),
            ("MASKED", flag(self.masked)),
            ("OCCLUDED", flag(self.occluded)),
            ("FACETS", flag(self.facets)),
            ("RAYS_IN_TABLE", flag(self.rays_in_table)),
            ("BY_DISTANCE", flag(self.by_distance)),
            ("EXPOSED", flag(self.exposed)),
            ("TIMED", flag(self.timed)),
            ("BLEND_OF_PAPER", flag(self.blend_of_paper)),
            ("RESOLUTION_BY_LENGTH", flag(self.resolution_by_length)),
        ]
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
