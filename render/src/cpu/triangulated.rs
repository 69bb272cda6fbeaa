//! Frames of the triangulated field.

use super::lanes::{LANES, Lane, each, vectorised};
use super::weights::weigh;
use super::{BAND, Engine, Seen, draw};
use crate::field::{FieldEntry, TriangulatedField};
use crate::frame::Frame;
use crate::held::Held;
use crate::photos::PhotoError;
use crate::raster::{Raster, Span};
use crate::rays::RayMap;
use image::RgbaImage;
use std::ops::Range;

/// The field interpolated over triangles. What changes faster than that (fovBlend, the
/// proxy point, the photos) is evaluated at every pixel.
pub(super) fn draw_field(
    frame: &Frame<'_>,
    field: &TriangulatedField,
    rays: &RayMap,
) -> Result<RgbaImage, PhotoError> {
    let engine = Engine::new(frame, rays);
    let raster = Raster::new(field);
    let photos = Held::new(frame, &field.listed());
    let may_skip = frame.may_skip();
    let draw_row = |row: usize, scratch: &mut Scratch, pixels: &mut [u8]| {
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
    };
    let pitch = frame.desired.width as usize * 4;
    draw(frame, |band, scratch: &mut Scratch, pixels| {
        let rows = pixels.chunks_mut(pitch).enumerate();
        rows.map(|(y, pixels)| draw_row(band * BAND + y, scratch, pixels))
            .try_for_each(|done| done)
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
