//! The shipped CPU engine: f32, a row of pixels at a time, all threads.
//!
//! Every pixel is computed from its own inputs alone, so any number of threads gives the
//! same bytes.

mod asked;
mod exact;
pub(crate) mod lanes;
mod mark;
pub(crate) mod probe;
pub(crate) mod scalar;
mod shade;
pub(crate) mod source;
mod triangulated;
mod weights;

use crate::RenderError;
use crate::field::TriangulatedField;
use crate::frame::Frame;
use crate::held::Held;
use crate::options::Method;
use crate::photos::PhotoError;
use crate::rays::{RayCache, RayMap};
use exact::draw_exact;
use glam::Vec4;
use image::RgbaImage;
use lanes::{LANES, Lane, vectorised};
use rayon::prelude::*;
use source::{Sight, Source, Tile};
use std::sync::OnceLock;
use triangulated::draw_field;
use weights::Term;

/// Rows that one thread does in one go.
const BAND: usize = 8;

/// The engine, with what it keeps between frames.
#[derive(Debug, Default)]
pub struct Cpu {
    rays: RayCache,
}

impl Cpu {
    /// Draws a frame.
    ///
    /// # Errors
    /// A photo that is needed cannot be decoded; the triangulation refuses the view.
    pub fn render(&mut self, frame: &Frame<'_>, method: Method) -> Result<RgbaImage, RenderError> {
        let rays = self.rays.of(&frame.desired);
        match method {
            Method::Exact => Ok(draw_exact(frame, rays)?),
            Method::Triangulated { cells_across } => {
                let field = TriangulatedField::new(frame, cells_across)?;
                Ok(draw_field(frame, &field, rays)?)
            }
        }
    }

    /// Draws a triangulated field.
    ///
    /// # Errors
    /// A photo or mask that is needed cannot be decoded.
    pub fn render_field(
        &mut self,
        frame: &Frame<'_>,
        field: &TriangulatedField,
    ) -> Result<RgbaImage, RenderError> {
        Ok(draw_field(frame, field, self.rays.of(&frame.desired))?)
    }
}

/// Draws a single frame, keeping nothing for the next.
///
/// # Errors
/// As [`Cpu::render`].
pub fn render(frame: &Frame<'_>, method: Method) -> Result<RgbaImage, RenderError> {
    Cpu::default().render(frame, method)
}

/// The source views that see something of a tile, in order.
#[derive(Default)]
struct Seen {
    source_idxs: Vec<usize>,
    /// At least one for each of them.
    sights: Vec<Sight>,
    terms: Vec<Term>,
    /// While they are sorted: which of them comes first, and so on.
    order: Vec<usize>,
}

impl Seen {
    fn clear(&mut self) {
        self.source_idxs.clear();
    }

    /// Where to put what is found out about the next source view.
    fn next(&mut self) -> (&mut Sight, &mut Term) {
        let at = self.source_idxs.len();
        if self.sights.len() <= at {
            self.sights.push(Sight::nothing());
            self.terms.push(Term::nothing());
        }
        (&mut self.sights[at], &mut self.terms[at])
    }

    /// Keeps what was put there.
    fn keep(&mut self, source_idx: usize) {
        self.source_idxs.push(source_idx);
    }

    /// By source view.
    fn sort(&mut self) {
        let Self {
            source_idxs, order, ..
        } = self;
        order.clear();
        order.extend(0..source_idxs.len());
        order.sort_unstable_by_key(|&i| source_idxs[i]);
        // At most as many exchanges as there are views, as each moves a kilobyte. What belongs here may
        // have been moved by one before.
        for at in 0..self.order.len() {
            let mut from = self.order[at];
            while from < at {
                from = self.order[from];
            }
            if from != at {
                self.source_idxs.swap(at, from);
                self.sights.swap(at, from);
                self.terms.swap(at, from);
            }
        }
    }

    fn kept(&mut self) -> (&mut [Sight], &mut [Term]) {
        let count = self.source_idxs.len();
        (&mut self.sights[..count], &mut self.terms[..count])
    }

    fn iter(&self) -> impl Iterator<Item = (usize, &Sight, &Term)> {
        let each = self.source_idxs.iter().zip(&self.sights).zip(&self.terms);
        each.map(|((i, sight), term)| (*i, sight, term))
    }
}

/// What all pixels of a frame share.
struct Engine<'a> {
    frame: &'a Frame<'a>,
    /// Each made when first asked for.
    sources: Vec<OnceLock<Source>>,
    rays: &'a RayMap,
}

impl<'a> Engine<'a> {
    fn new(frame: &'a Frame<'a>, rays: &'a RayMap) -> Self {
        let sources = frame.lumigraph.sources.iter();
        Self {
            frame,
            sources: sources.map(|_| OnceLock::new()).collect(),
            rays,
        }
    }

    fn source(&self, source_idx: usize) -> &Source {
        self.sources[source_idx].get_or_init(|| Source::new(self.frame, source_idx))
    }

    /// The rays of a tile and where they meet the proxy.
    fn tile(&self, x0: usize, row: usize, wanted: impl Fn(usize) -> bool) -> Tile {
        let mut tile = Tile::nothing();
        let width = self.frame.desired.width as usize;
        for k in 0..LANES.min(width - x0) {
            let surface = &self.frame.surface;
            let plane = surface.plane_of(x0 + k, row).filter(|_| wanted(k));
            if let (Some(ray), Some(plane)) = (self.rays.ray(x0 + k, row), plane) {
                tile.set(k, ray, plane);
            }
        }
        tile
    }

    /// Takes what a photo's mask ignores and what hides points from it off its relevance, in
    /// the pixels that are `wanted`.
    fn mask(&self, source_idx: usize, sight: &mut Sight, wanted: impl Fn(usize) -> bool) {
        let lumigraph = self.frame.lumigraph;
        let seen = |sight: &Sight, k: usize| sight.a[k] > 0.0 && wanted(k);
        if let Some(mask) = lumigraph.photos.mask(source_idx) {
            let left = vectorised(
                #[inline(always)]
                || shade::left_by(mask, sight, |k| seen(sight, k)),
            );
            for k in 0..LANES {
                if seen(sight, k) {
                    sight.a[k] *= left[k];
                }
            }
        }
        if let Some(visibility) = &lumigraph.visibility {
            if !(0..LANES).any(|k| seen(sight, k)) {
                return;
            }
            let map = visibility.map(source_idx);
            let visible = vectorised(
                #[inline(always)]
                || shade::visible(map, sight),
            );
            for k in 0..LANES {
                if seen(sight, k) {
                    sight.a[k] *= visible[k];
                }
            }
        }
    }

    /// Blends the photos of a tile and writes its pixels.
    fn shade(
        &self,
        photos: &Held<'_>,
        seen: &Seen,
        weight: impl for<'s> Fn(&'s Sight, &'s Term) -> &'s Lane,
        out: &mut [u8],
    ) -> Result<(), PhotoError> {
        let count = out.len() / 4;
        let mut color = [Vec4::ZERO; LANES];
        let mut sum = [0.0_f32; LANES];
        for (i, sight, term) in seen.iter() {
            let weight = weight(sight, term);
            if weight[..count].iter().all(|w| *w == 0.0) {
                continue;
            }
            let photo = photos.get(i)?;
            let exposure = self.source(i).exposure;
            vectorised(
                #[inline(always)]
                || {
                    shade::add(
                        photo,
                        exposure,
                        sight,
                        &weight[..count],
                        &mut color,
                        &mut sum,
                    )
                },
            );
        }
        vectorised(
            #[inline(always)]
            || {
                let (out, _) = out.as_chunks_mut::<4>();
                for (k, out) in out.iter_mut().enumerate() {
                    if sum[k] > 0.0 {
                        *out = shade::straight_rgba8(color[k], sum[k]);
                    }
                }
            },
        );
        Ok(())
    }
}

/// Runs `band(band, scratch, pixels)` for every band of rows of the picture, in parallel.
fn draw<S: Default + Send>(
    frame: &Frame<'_>,
    band: impl Fn(usize, &mut S, &mut [u8]) -> Result<(), PhotoError> + Sync,
) -> Result<RgbaImage, PhotoError> {
    let (width, height) = (frame.desired.width, frame.desired.height);
    let pitch = width as usize * 4;
    let mut pixels = vec![0; pitch * height as usize];
    pixels
        .par_chunks_mut(pitch * BAND)
        .enumerate()
        .map_init(S::default, |scratch, (i, pixels)| band(i, scratch, pixels))
        // The first error from the top, whichever thread is the first to meet one.
        .find_map_first(Result::err)
        .map_or(Ok(()), Err)?;
    frame.lumigraph.photos.check_masks()?;
    Ok(RgbaImage::from_raw(width, height, pixels).expect("the size was computed above"))
}
