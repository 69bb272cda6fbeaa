//! The shipped CPU engine: f32, a row of pixels at a time, all threads.
//!
//! Every pixel is computed from its own inputs alone, so any number of threads gives the
//! same bytes.

mod asked;
pub(crate) mod lanes;
mod mark;
pub(crate) mod probe;
pub(crate) mod scalar;
mod shade;
pub(crate) mod source;
mod weights;

use crate::RenderError;
use crate::field::{FieldEntry, TriangulatedField};
use crate::frame::Frame;
use crate::held::Held;
use crate::options::Method;
use crate::photos::PhotoError;
use crate::raster::{Raster, Span};
use crate::rays::{RayCache, RayMap};
use asked::Asked;
use glam::Vec4;
use image::RgbaImage;
use lanes::{LANES, Lane, each, vectorised};
use rayon::prelude::*;
use source::{Sight, Source, Tile};
use std::ops::Range;
use std::sync::OnceLock;
use weights::{Term, weigh};

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

/// The exact field at every pixel; the fast twin of [`crate::reference::render_exact`].
fn draw_exact(frame: &Frame<'_>, rays: &RayMap) -> Result<RgbaImage, PhotoError> {
    let engine = Engine::new(frame, rays);
    let sources: Vec<usize> = frame.taking_part().collect();
    let photos = mark::hold(&engine, &sources);
    draw(frame, |row, (asked, seen): &mut (Asked, Seen), pixels| {
        for (tile_idx, out) in pixels.chunks_mut(LANES * 4).enumerate() {
            // 1. Who sees the tile, and what that weighs.
            engine.weigh_tile(asked, tile_idx, row, seen);
            // 2. The photos' colours.
            engine.shade(&photos, seen, |_, term| &term.weight, out)?;
        }
        Ok(())
    })
}

/// The field interpolated over triangles. What changes faster than that (fovBlend, the
/// proxy point, the photos) is evaluated at every pixel.
fn draw_field(
    frame: &Frame<'_>,
    field: &TriangulatedField,
    rays: &RayMap,
) -> Result<RgbaImage, PhotoError> {
    let engine = Engine::new(frame, rays);
    let raster = Raster::new(field);
    let photos = Held::new(frame, &field.listed());
    let may_skip = frame.may_skip();
    draw(frame, |row, scratch: &mut Scratch, pixels| {
        let Scratch {
            spans,
            crossing,
            active,
            order,
            seen,
        } = scratch;
        raster.spans(row, spans);
        for (tile_idx, out) in pixels.chunks_mut(LANES * 4).enumerate() {
            let x0 = tile_idx * LANES;
            let within = |s: &Span| s.start.max(x0) - x0..s.end.min(x0 + LANES) - x0;
            let (mut is_covered, mut is_bordered) = ([false; LANES], [false; LANES]);
            crossing.clear();
            for (i, span) in spans.iter().enumerate() {
                if span.start < x0 + LANES && span.end > x0 {
                    is_covered[within(span)].fill(true);
                    crossing.push(i);
                }
            }
            let tile = engine.tile(x0, row, |k| is_covered[k]);
            if tile.s.iter().all(|s| *s < 0.0) {
                continue;
            }
            // 1. The interpolated weights, or differences, of the triangles that cross the
            // tile.
            active.clear();
            for span in crossing.iter().map(|&i| &spans[i]) {
                let lanes = within(span);
                let bordered = field.triangles[span.triangle_idx].bordered;
                is_bordered[lanes.clone()].fill(bordered);
                vectorised(
                    #[inline(always)]
                    || {
                        let shares = raster.shares(span.triangle_idx, x0, row);
                        let entries = field.entries_of(span.triangle_idx);
                        interpolate(active, entries, bordered, &lanes, &shares);
                    },
                );
            }
            for k in 0..LANES {
                is_bordered[k] &= tile.s[k] >= 0.0;
            }
            let any_bordered = is_bordered.contains(&true);
            // 2. Each pixel's own fovBlend: a factor of the weight, or in a bordered
            // triangle, with the mask, a term of the blend. Of the latter the views that
            // differ least come first, as far as they leave room for more.
            order.clear();
            vectorised(
                #[inline(always)]
                || {
                    for (i, source) in active.iter().enumerate() {
                        let least = source.least(&is_bordered);
                        if least < f32::INFINITY {
                            order.push((least, i));
                        }
                    }
                },
            );
            order.sort_unstable_by(|a, b| {
                let source_idx = |i: usize| active[i].source_idx;
                a.0.total_cmp(&b.0)
                    .then_with(|| source_idx(a.1).cmp(&source_idx(b.1)))
            });
            seen.clear();
            let mut check = FIRST_ASKED;
            for (asked, &(least, i)) in order.iter().enumerate() {
                let source = &active[i];
                if asked >= check && least >= 0.0 && may_skip {
                    let reach = weigh(seen.kept().1, &frame.options);
                    let wanted = (0..LANES).filter(|&k| is_bordered[k]);
                    if wanted.map(|k| reach[k]).fold(0.0, f32::max) <= least {
                        break;
                    }
                    check = asked + THEN_ASKED;
                }
                let (sight, term) = seen.next();
                if !engine.source(source.source_idx).see(&tile, sight) {
                    continue;
                }
                if any_bordered {
                    // Elsewhere the masks of all that is listed are one.
                    engine.mask(source.source_idx, sight, |k| source.blended[k] > 0.0);
                    term.diff = source.diff;
                    term.a = each(|k| sight.a[k] * source.blended[k]);
                }
                sight.a = each(|k| sight.a[k] * source.weight[k]);
                seen.keep(source.source_idx);
            }
            if any_bordered {
                seen.sort();
                let (sights, terms) = seen.kept();
                weigh(terms, &frame.options);
                for (sight, term) in sights.iter_mut().zip(terms) {
                    sight.a = each(|k| sight.a[k] + term.weight[k]);
                }
            }
            engine.shade(&photos, seen, |sight, _| &sight.a, out)?;
        }
        Ok(())
    })
}

/// Source views that are asked about a tile before it is seen whether others may count, and again
/// after so many more.
const FIRST_ASKED: usize = 8;
const THEN_ASKED: usize = 4;

/// What a thread uses again for every tile that it draws of a triangulated field.
#[derive(Default)]
struct Scratch {
    /// Of the row, and the indices of those that cross the tile.
    spans: Vec<Span>,
    crossing: Vec<usize>,
    active: Vec<Interpolated>,
    /// Of what is active, by the least difference: that and its index.
    order: Vec<(f32, usize)>,
    seen: Seen,
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

/// Adds a triangle's list to what a field says of source views, over the pixels that it covers, in which its
/// corners have these shares.
#[inline(always)]
fn interpolate(
    active: &mut Vec<Interpolated>,
    entries: &[FieldEntry],
    bordered: bool,
    lanes: &Range<usize>,
    shares: &[Lane; 3],
) {
    for entry in entries {
        let source_idx = entry.source_idx as usize;
        let at = active.iter().position(|s| s.source_idx == source_idx);
        let at = at.unwrap_or_else(|| {
            active.push(Interpolated::nothing(source_idx));
            active.len() - 1
        });
        let into = &mut active[at];
        let [v0, v1, v2] = entry.values;
        let values = match bordered {
            true => &mut into.diff,
            false => &mut into.weight,
        };
        for k in 0..LANES {
            let value = shares[0][k] * v0 + shares[1][k] * v1 + shares[2][k] * v2;
            values[k] = if lanes.contains(&k) { value } else { values[k] };
        }
        if bordered {
            into.blended[lanes.clone()].fill(1.0);
        }
    }
}

/// What a field says of one source view over a tile.
struct Interpolated {
    source_idx: usize,
    /// In triangles that no photo's or mask's border crosses; zero elsewhere.
    weight: Lane,
    /// In the others.
    diff: Lane,
    /// One where `diff` counts, else zero.
    blended: Lane,
}

impl Interpolated {
    fn nothing(source_idx: usize) -> Self {
        Self {
            source_idx,
            weight: [0.0; LANES],
            diff: [1.0; LANES],
            blended: [0.0; LANES],
        }
    }

    /// The least difference in bordered triangles; less than any where it has weights, too, and
    /// infinite where it has nothing.
    #[inline(always)]
    fn least(&self, is_bordered: &[bool; LANES]) -> f32 {
        if self.weight != [0.0; LANES] {
            return -1.0;
        }
        let mut least = [f32::INFINITY; 8];
        for k in 0..LANES {
            let counts = is_bordered[k] & (self.blended[k] > 0.0);
            let diff = if counts {
                self.diff[k].max(0.0)
            } else {
                f32::INFINITY
            };
            least[k % 8] = least[k % 8].min(diff);
        }
        least.into_iter().fold(f32::INFINITY, f32::min)
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

    /// The exact field of a tile: the source views that see it, and what they weigh; of more views
    /// where those asked first don't settle it.
    fn weigh_tile(&self, asked: &mut Asked, tile_idx: usize, row: usize, seen: &mut Seen) {
        let tile = self.tile(tile_idx * LANES, row, |_| true);
        if tile.s.iter().all(|s| *s < 0.0) {
            return seen.clear();
        }
        loop {
            let views = asked.views(self, tile_idx, row).iter();
            self.score(views.map(|&i| i as usize), &tile, seen);
            let reach = weigh(seen.kept().1, &self.frame.options);
            let wanted = (0..LANES).filter(|&k| tile.s[k] >= 0.0);
            if asked.settles(tile_idx, wanted.map(|k| reach[k]).fold(0.0, f32::max)) {
                return;
            }
        }
    }

    /// Of some source views those that see something of a tile, and by what they differ.
    fn score(&self, views: impl Iterator<Item = usize>, tile: &Tile, seen: &mut Seen) {
        seen.clear();
        for source_idx in views {
            let source = self.source(source_idx);
            let (sight, term) = seen.next();
            if !source.see(tile, sight) {
                continue;
            }
            self.mask(source_idx, sight, |_| true);
            term.diff = source.difference(tile);
            term.a = sight.a;
            seen.keep(source_idx);
        }
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

/// Runs `row(row, scratch, pixels)` for every row of the picture, in parallel.
fn draw<S: Default + Send>(
    frame: &Frame<'_>,
    row: impl Fn(usize, &mut S, &mut [u8]) -> Result<(), PhotoError> + Sync,
) -> Result<RgbaImage, PhotoError> {
    let (width, height) = (frame.desired.width, frame.desired.height);
    let pitch = width as usize * 4;
    let mut pixels = vec![0; pitch * height as usize];
    pixels
        .par_chunks_mut(pitch * BAND)
        .enumerate()
        .map_init(S::default, |scratch, (band, rows)| {
            let rows = rows.chunks_mut(pitch).enumerate();
            rows.map(|(y, pixels)| row(band * BAND + y, scratch, pixels))
                .try_for_each(|done| done)
        })
        // The first error from the top, whichever thread is the first to meet one.
        .find_map_first(Result::err)
        .map_or(Ok(()), Err)?;
    frame.lumigraph.photos.check_masks()?;
    Ok(RgbaImage::from_raw(width, height, pixels).expect("the size was computed above"))
}
