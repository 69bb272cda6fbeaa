//! Colours of the pixels of a [`Raster`], each found once.
//!
//! What colours a triangle is made ready once for all its pixels in a band of rows, square by square,
//! so that few triangles are at hand at a time.

use super::triangle::{TOGETHER, edges, together};
use super::{Pinhole, Raster, Target};
use crate::cpu::lanes::vectorised;
use glam::DVec3;
use proxy::mesh::{Coloring, FEW, Model, Neighbours, Part, Skin};
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
const SQUARE: usize = 32;
/// Triangles at hand, a power of 2.
const AT_HAND: usize = 256;

const _: () = assert!(FEW == TOGETHER);

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
        let band = |(faces, coloring): &mut (Faces<'m>, Coloring<'m>), (i, band)| {
            vectorised(
                #[inline(always)]
                || self.shade_band(model, camera, faces, coloring, i * BAND, band, &is_wanted),
            )
        };
        let band = bands.enumerate().map_init(Default::default, band);
        band.sum()
    }

    /// Colours rows from a first one on.
    #[inline(always)]
    #[expect(
        clippy::too_many_arguments,
        reason = "compiled in place, where all is at hand"
    )]
    fn shade_band<'a>(
        &self,
        model: &'a Model,
        camera: &Pinhole,
        faces: &mut Faces<'a>,
        coloring: &mut Coloring<'a>,
        first: usize,
        (colors, depths): Band<'_>,
        is_wanted: &impl Fn(usize, f32) -> bool,
    ) -> usize {
        let width = camera.width as usize;
        let row_count = colors.len() / width;
        let mut put = |here: u32, code: [u8; 4]| colors[here as usize] = code;
        let mut total = 0;
        for left in (0..width).step_by(SQUARE) {
            let end = (left + SQUARE).min(width);
            for y in 0..row_count {
                let dy = camera.rows[first + y];
                let mut x = left;
                while x < end {
                    let (pixel, here) = ((first + y) * width + x, y * width + x);
                    // 1. Neighbours that see the same triangle.
                    let Some((idx, _)) = self.at(pixel) else {
                        x += 1;
                        continue;
                    };
                    let mut count = 0;
                    while count < FEW.min(end - x) {
                        match self.at(pixel + count) {
                            Some((i, s)) if i == idx && is_wanted(pixel + count, s) => {
                                depths[here + count] = s;
                            }
                            _ => break,
                        }
                        count += 1;
                    }
                    if count == 0 {
                        x += 1;
                        continue;
                    }
                    // 2. Where on it.
                    let face = faces.at(model, camera, idx);
                    let places = face.places(&together(&camera.columns, x), dy);
                    coloring.add(&face.skin, &places, here as u32, count, &mut put);
                    total += count;
                    x += count;
                }
            }
        }
        coloring.finish(&mut put);
        total
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
    /// Where rays meet it, by their x in a row.
    #[inline(always)]
    fn places(&self, across: &[f64; FEW], dy: f64) -> Neighbours {
        let [second, third, all] = &self.weights;
        let mut rest = [0.0; 3];
        for k in 0..3 {
            rest[k] = self.weights[k].y * dy + self.weights[k].z;
        }
        let mut places = Neighbours::default();
        for k in 0..FEW {
            let dx = across[k];
            let scale = 1.0 / (all.x * dx + rest[2]);
            let second = ((second.x * dx + rest[0]) * scale).max(0.0);
            let third = ((third.x * dx + rest[1]) * scale).max(0.0);
            // Rounding does not leave the triangle; nor does what is seen edge on.
            let second = second.min(1.0);
            places.second[k] = second;
            places.third[k] = third.min(1.0 - second);
            places.footprint[k] = self.footprint * (scale * scale * scale).abs();
        }
        places
    }

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
