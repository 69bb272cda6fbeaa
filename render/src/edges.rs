//! Several samples of a pixel where the surface jumps: outlines without stairs.
//!
//! A pixel whose middle falls on one side of an outline shows that side alone. Where a mesh jumps between a pixel and
//! one beside it, and the two do not look alike, both are the mean of samples: pixels of a finer picture of the exact
//! field that shows nothing else. All others stay as they are. So nearly all of what a picture of four times the
//! pixels gains is had for a fraction of its cost.

use crate::frame::Frame;
use crate::surface::{FacetMap, NO_FACET, Surface};
use crate::visibility::TOLERANCE;
use calibrate::Pixel;
use glam::DVec3;
use image::RgbaImage;
use proxy::{Proxy, Rays};
use rayon::prelude::*;
use std::ops::Range;

/// Where neighbours differ by no more than so many steps of 255, in each channel, stairs are not seen.
const ALIKE: i32 = 20;

/// The pixels of a frame at which its surface jumps, to be looked at more closely.
#[derive(Debug)]
pub struct Edges<'a> {
    /// A picture of their samples; empty elsewhere.
    pub samples: Frame<'a>,
    /// How many there are of a pixel, across and down.
    across: usize,
    /// Row by row, whether a pixel of the frame is one of them.
    is_edge: Vec<bool>,
}

impl<'a> Edges<'a> {
    /// Of a frame that was drawn as `picture`; `None` where there are none, and where its proxy is no mesh, which
    /// alone can hide a part of itself. At most 16 samples `across`.
    pub fn of(frame: &Frame<'a>, picture: &RgbaImage, across: u32) -> Option<Self> {
        let (Proxy::Mesh(solid), Surface::Facets(map)) = (&frame.lumigraph.proxy, &frame.surface)
        else {
            return None;
        };
        let across = across.clamp(1, 16);
        if across == 1 {
            return None;
        }
        // 1. Which pixels.
        let is_edge = find(frame, map, picture);
        if !is_edge.contains(&true) {
            return None;
        }
        // 2. What their samples see, and nobody else.
        let desired = &frame.desired;
        let fine = desired.resized(across * desired.width, across * desired.height);
        let rays = Rays::of(&fine.lens, (fine.width, fine.height));
        let across = across as usize;
        let width = desired.width as usize;
        let is_wanted = |columns: &Range<usize>, rows: &Range<usize>| {
            let [columns, rows] =
                [columns, rows].map(|range| range.start / across..range.end.div_ceil(across));
            let mut rows = rows.map(|y| &is_edge[y * width..][columns.clone()]);
            rows.any(|row| row.contains(&true))
        };
        let map = map.finer(solid, &fine, rays.as_ref(), is_wanted);
        Some(Self {
            samples: frame.seeing(fine, map, rays.as_ref()),
            across,
            is_edge,
        })
    }

    /// How many pixels they are.
    pub fn count(&self) -> usize {
        self.is_edge.iter().filter(|is_edge| **is_edge).count()
    }

    /// Puts the means of the samples, which were drawn as a picture, into the frame's: of colours by their alpha.
    pub fn put(&self, samples: &RgbaImage, picture: &mut RgbaImage) {
        let (width, across) = (picture.width() as usize, self.across);
        let pitch = across * width;
        let samples = samples.as_raw().as_chunks::<4>().0;
        let pixels = picture.as_chunks_mut::<4>().0;
        for (i, pixel) in pixels
            .iter_mut()
            .enumerate()
            .filter(|(i, _)| self.is_edge[*i])
        {
            let (x, y) = (i % width, i / width);
            let (mut sum, mut alphas) = ([0_u32; 3], 0);
            for row in across * y..across * (y + 1) {
                for [r, g, b, alpha] in &samples[row * pitch + across * x..][..across] {
                    let alpha = u32::from(*alpha);
                    for (sum, color) in sum.iter_mut().zip([r, g, b]) {
                        *sum += alpha * u32::from(*color);
                    }
                    alphas += alpha;
                }
            }
            let rounded = |sum: u32, by: u32| ((sum + by / 2) / by) as u8;
            let alpha = rounded(alphas, (across * across) as u32);
            *pixel = match alpha {
                0 => [0; 4],
                _ => {
                    let [r, g, b] = sum.map(|sum| rounded(sum, alphas));
                    [r, g, b, alpha]
                }
            };
        }
    }
}

/// Row by row, whether the surface jumps between a pixel and one beside it that does not look alike.
fn find(frame: &Frame<'_>, map: &FacetMap, picture: &RgbaImage) -> Vec<bool> {
    let (width, height) = (frame.desired.width as usize, frame.desired.height as usize);
    let colors = picture.as_raw().as_chunks::<4>().0;
    let look = |i: usize| {
        let plane = map.plane_of(map.facet_of[i])?;
        let center = Pixel::center_of((i % width) as u32, (i / width) as u32);
        Some((frame.desired.lens.unproject(center)?, plane))
    };
    let is_jump = |a: usize, b: usize| {
        let [facet_a, facet_b] = [map.facet_of[a], map.facet_of[b]];
        if facet_a == facet_b || are_alike(colors[a], colors[b]) {
            return false;
        }
        if facet_a == NO_FACET || facet_b == NO_FACET {
            return true;
        }
        look(a).zip(look(b)).is_some_and(|(a, b)| jumps(a, b))
    };
    // Of each pixel whether it jumps to the one at its right, and to the one below.
    let of_row = |y: usize| {
        let row = y * width..(y + 1) * width;
        row.map(move |i| {
            let right = i + 1 < (y + 1) * width && is_jump(i, i + 1);
            [right, y + 1 < height && is_jump(i, i + width)]
        })
    };
    let rows = (0..height).into_par_iter().with_min_len(8);
    let all: Vec<[bool; 2]> = rows.flat_map_iter(of_row).collect();
    let mut is_edge: Vec<bool> = all.iter().map(|[right, below]| right | below).collect();
    for (i, [right, below]) in all.into_iter().enumerate() {
        if right {
            is_edge[i + 1] = true;
        }
        if below {
            is_edge[i + width] = true;
        }
    }
    is_edge
}

/// Whether two pixels of straight alpha differ by little.
fn are_alike(a: [u8; 4], b: [u8; 4]) -> bool {
    let shown = |[r, g, b, alpha]: [u8; 4]| {
        let alpha = i32::from(alpha);
        let [r, g, b] = [r, g, b].map(|c| i32::from(c) * alpha / 255);
        [r, g, b, alpha]
    };
    let channels = shown(a).into_iter().zip(shown(b));
    channels.fold(true, |is_alike, (a, b)| is_alike & ((a - b).abs() <= ALIKE))
}

/// Whether what two rays meet is not one surface: neither's plane leads to what the other meets.
fn jumps((ray_a, a): (DVec3, DVec3), (ray_b, b): (DVec3, DVec3)) -> bool {
    let is_off = |led: f64, met: f64| (led - met).abs() > TOLERANCE * met.abs();
    is_off(a.dot(ray_b), b.dot(ray_b)) && is_off(b.dot(ray_a), a.dot(ray_a))
}
