//! The structs that shaders read, byte for byte. A test compares them with what the
//! shader compiler lays out.

use crate::frame::{Frame, FrameSource};
use crate::options::{Blend, Resolution};
use bytemuck::{Pod, Zeroable};
use calibrate::Distortion;
use glam::{DVec3, Vec3};

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
}

/// `Source` of common.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct Source {
    pub axes: [[f32; 4]; 3],
    pub center: [f32; 4],
    pub focal: [f32; 2],
    pub principal: [f32; 2],
    pub size: [f32; 2],
    pub inverse_feather: f32,
    pub area_scale: f32,
    pub k1234: [f32; 4],
    pub k56p12: [f32; 4],
    pub limit: f32,
    pub footprint_excess: f32,
    pub lens: u32,
    pub layer: u32,
    pub gain: [f32; 4],
}

/// `Corner`'s inputs of triangulated.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct Corner {
    pub pixel: [f32; 2],
    pub list: [u32; 2],
}

/// `Entry` of triangulated.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct Entry {
    pub source_idx: u32,
    pub values: [f32; 3],
}

const LENS_PINHOLE: u32 = 0;
const LENS_RATIONAL: u32 = 1;
const LENS_FISHEYE: u32 = 2;
const LENS_POLYNOMIAL: u32 = 3;

impl Params {
    pub(crate) fn of(frame: &Frame<'_>, array_size: [u32; 2]) -> Self {
        let lens = frame.desired.lens;
        Self {
            plane: frame.plane.unwrap_or(DVec3::ZERO).as_vec3().to_array(),
            rays_in_table: u32::from(lens.distortion() != Distortion::None),
            ray_scale: (1.0 / lens.focal).as_vec2().to_array(),
            ray_offset: lens.principal.as_vec2().to_array(),
            array_size: array_size.map(|v| v as f32),
            size: [frame.desired.width, frame.desired.height],
            source_count: frame.sources.len() as u32,
            desired_by_distance: u32::from(is_fisheye(lens.distortion())),
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
            plane_seen: u32::from(frame.plane.is_some()),
        }
    }
}

impl Source {
    pub(crate) fn of(frame: &Frame<'_>, source_idx: usize, layer: u32, last_level: usize) -> Self {
        let source: &FrameSource = &frame.sources[source_idx];
        let axis = |r: usize| {
            let w = source.translation[r] as f32;
            source.rotation.row(r).as_vec3().extend(w).to_array()
        };
        let g = source.footprint_ratio;
        let limit = source.lens.limit();
        let f = |v: f64| v as f32;
        let (lens, k1234, k56p12, limit) = match source.lens.distortion() {
            Distortion::None => (LENS_PINHOLE, [0.0; 4], [0.0; 4], f64::INFINITY),
            Distortion::Rational { k, p } => {
                let simple = k[3..] == [0.0; 3] && p == [0.0; 2];
                let lens = if simple {
                    LENS_POLYNOMIAL
                } else {
                    LENS_RATIONAL
                };
                (
                    lens,
                    [k[0], k[1], k[2], k[3]],
                    [k[4], k[5], p[0], p[1]],
                    limit * limit,
                )
            }
            Distortion::Fisheye { k } => (LENS_FISHEYE, k, [0.0; 4], limit),
        };
        let gain = Vec3::from_array(frame.lumigraph.sources[source_idx].gain.map(f));
        Self {
            axes: [axis(0), axis(1), axis(2)],
            center: source.center.as_vec3().extend(f(g)).to_array(),
            focal: source.lens.focal.as_vec2().to_array(),
            principal: source.lens.principal.as_vec2().to_array(),
            size: source.size.map(f),
            inverse_feather: f(1.0 / source.feather_px.max(1e-9)),
            area_scale: f(frame.area_scale(source_idx, frame.plane.unwrap_or(DVec3::ZERO))),
            k1234: k1234.map(f),
            k56p12: k56p12.map(f),
            limit: f(limit.min(1e30)),
            footprint_excess: f(g * g - 1.0),
            lens,
            layer,
            gain: gain.extend(last_level as f32).to_array(),
        }
    }
}

fn is_fisheye(distortion: Distortion) -> bool {
    matches!(distortion, Distortion::Fisheye { .. })
}
