//! Colours of the pixels of a [`Raster`], each found once.
//!
//! What colours a triangle is made ready once for all its pixels in a band of rows, square by square,
//! so that few triangles are at hand at a time.

use super::triangle::edges;
use super::{Pinhole, Raster, Target};
use crate::cpu::lanes::vectorised;
use glam::DVec3;
use proxy::mesh::{MOST_PLACES, Model, Part, Places, Skin};
use rayon::prelude::*;

/// A triangle made ready to be coloured.
struct Face<'a> {
    idx: u32,
    /// The second corner's weight along a ray with z = 1, the third's, and all three's.
    weights: [DVec3; 3],
    /// Of its footprint in a pixel, what does not depend on the pixel.
    footprint: f64,
    skin: Skin<'a>,
}

/// Triangles that are made ready, each in the place that its index says.
struct Faces<'a> {
    places: Vec<Option<Face<'a>>>,
    /// Of the last that was made ready.
    part: Option<&'a Part>,
}

/// Rows in a band, and columns in a square.
const BAND: usize = 16;
const SQUARE: usize = MOST_PLACES;
/// Triangles at hand, a power of 2.
const AT_HAND: usize = 256;

impl Raster {
    /// Colours what was drawn, but for pixels that `is_wanted` declines (by pixel, and its inverse
    /// depth); the others stay as they are. How many were coloured.
    pub fn shade<'m>(
        &self,
        model: &'m Model,
        camera: &Pinhole,
        target: &mut Target,
        is_wanted: impl Fn(usize, f32) -> bool + Sync,
    ) -> usize {
        let pixels = BAND * camera.width as usize;
        let colors = target.color.par_chunks_mut(pixels);
        let bands = colors.zip(target.inverse_depth.par_chunks_mut(pixels));
        let band = |faces: &mut Faces<'m>, (i, (colors, depths)): (usize, Band<'_>)| {
            vectorised(
                #[inline(always)]
                || self.shade_band(model, camera, faces, i * BAND, colors, depths, &is_wanted),
            )
        };
        let band = bands.enumerate().map_init(Faces::default, band);
        band.sum()
    }

    /// Colours rows from a first one on.
    #[inline(always)]
    fn shade_band<'a>(
        &self,
        model: &'a Model,
        camera: &Pinhole,
        faces: &mut Faces<'a>,
        first: usize,
        colors: &mut [[u8; 4]],
        depths: &mut [f32],
        is_wanted: &impl Fn(usize, f32) -> bool,
    ) -> usize {
        let width = camera.width as usize;
        let mut count = 0;
        let mut places = Places::default();
        let mut wanted = [0; SQUARE];
        for left in (0..width).step_by(SQUARE) {
            let columns = left..(left + SQUARE).min(width);
            for y in 0..colors.len() / width {
                let dy = camera.rows[first + y];
                // The triangle of the pixel before, and its weights in this row but for x.
                let mut last = None;
                let mut rest = [0.0; 3];
                places.clear();
                for x in columns.clone() {
                    let (pixel, here) = ((first + y) * width + x, y * width + x);
                    let Some((idx, inverse_depth)) = self.at(pixel) else {
                        continue;
                    };
                    if !is_wanted(pixel, inverse_depth) {
                        continue;
                    }
                    let face = faces.at(model, camera, idx);
                    if last != Some(idx) {
                        last = Some(idx);
                        for k in 0..3 {
                            rest[k] = face.weights[k].y * dy + face.weights[k].z;
                        }
                    }
                    let dx = camera.columns[x];
                    let [second, third, all] = &face.weights;
                    let scale = 1.0 / (all.x * dx + rest[2]);
                    let second = ((second.x * dx + rest[0]) * scale).max(0.0);
                    let third = ((third.x * dx + rest[1]) * scale).max(0.0);
                    // Rounding does not leave the triangle; nor does what is seen edge on.
                    let second = second.min(1.0);
                    wanted[places.len()] = here;
                    let footprint = face.footprint * (scale * scale * scale).abs();
                    places.add(&face.skin, second, third.min(1.0 - second), footprint);
                    depths[here] = inverse_depth;
                }
                if places.is_empty() {
                    continue;
                }
                let codes = places.colors();
                for (i, here) in wanted[..places.len()].iter().enumerate() {
                    // Rounded without a call: they are not negative.
                    let [r, g, b] = [0, 1, 2].map(|k| (codes[k][i] + 0.5) as u8);
                    colors[*here] = [r, g, b, 255];
                }
                count += places.len();
            }
        }
        count
    }
}

/// Colours and inverse depths of a band's pixels.
type Band<'t> = (&'t mut [[u8; 4]], &'t mut [f32]);

impl Default for Faces<'_> {
    fn default() -> Self {
        Self {
            places: (0..AT_HAND).map(|_| None).collect(),
            part: None,
        }
    }
}

impl<'a> Faces<'a> {
    /// A triangle, made ready now if it is not at hand.
    #[inline(always)]
    fn at(&mut self, model: &'a Model, camera: &Pinhole, idx: u32) -> &Face<'a> {
        let place = idx as usize % AT_HAND;
        if !matches!(&self.places[place], Some(face) if face.idx == idx) {
            let part = self.part.filter(|part| part.triangles.contains(&idx));
            self.part = part.or_else(|| model.part_of(idx));
            self.places[place] = Some(Face::new(model, self.part, camera, idx));
        }
        self.places[place].as_ref().expect("it was just made ready")
    }
}

impl<'a> Face<'a> {
    #[inline(never)]
    fn new(model: &'a Model, part: Option<&Part>, camera: &Pinhole, idx: u32) -> Self {
        let [a, b, c] = model.mesh.triangles[idx as usize];
        let corner = |i: u32| camera.point(model.mesh.positions[i as usize]);
        let corners = [corner(a), corner(b), corner(c)];
        let [a, b, c] = edges(corners);
        // As `proxy::mesh::footprint` has it.
        let volume = corners[0].dot(a);
        Self {
            idx,
            weights: [b, c, a + b + c],
            footprint: volume * volume / (camera.focal.x * camera.focal.y),
            skin: Skin::new(model, part, idx),
        }
    }
}
