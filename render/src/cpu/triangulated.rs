//! Frames of the triangulated field.

use super::lanes::{LANES, Lane, each, vectorised};
use super::{BAND, Engine, PLACES, Seen, TILE, draw, put, tiles_of_band};
use crate::field::TriangulatedField;
use crate::frame::Frame;
use crate::held::Held;
use crate::photos::PhotoError;
use crate::raster::{NO_TRIANGLE, Raster, Span};
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
    let width = frame.desired.width as usize;
    draw(frame, |band, scratch: &mut Scratch, pixels| {
        let Scratch {
            spans,
            covering,
            parts,
            mentions,
            seen,
        } = scratch;
        // The triangle of each pixel.
        covering.clear();
        covering.resize(width * BAND, NO_TRIANGLE);
        for (y, covering) in covering.chunks_mut(width).enumerate() {
            raster.cover(band * BAND + y, spans, covering);
        }
        let mut done = Ok(());
        for [x, y] in tiles_of_band(width) {
            Part::of_tile(covering, width, [x, y], parts);
            if parts.is_empty() {
                continue;
            }
            let mut is_covered = [false; LANES];
            parts.iter().for_each(|part| part.mark(&mut is_covered));
            let first = [x, band * BAND + y];
            let tile = engine.tile(first, |k| is_covered[k]);
            if tile.s.iter().all(|s| *s < 0.0) {
                continue;
            }
            // 1. The triangles that cross the tile, and what they list, view by view.
            let mut is_bordered = [false; LANES];
            for part in parts.iter_mut() {
                part.bordered = field.triangles[part.triangle_idx].bordered;
                if part.bordered {
                    part.mark(&mut is_bordered);
                }
                vectorised(
                    #[inline(always)]
                    || {
                        part.shares = raster.shares(part.triangle_idx, first, PLACES);
                        part.find_least();
                    },
                );
            }
            for k in 0..LANES {
                is_bordered[k] &= tile.s[k] >= 0.0;
            }
            let any_bordered = is_bordered.contains(&true);
            mentions.of_parts(parts, field);
            // 2. Each pixel's own fovBlend: a factor of the weight, or in a bordered
            // triangle, with the mask, a term of the blend. Of the latter the views that
            // differ least come first, as far as they leave room for more.
            seen.clear();
            for (asked, view) in mentions.views().iter().enumerate() {
                if may_skip && seen.is_enough(asked, &frame.options, view.least, &is_bordered) {
                    break;
                }
                let (sight, term) = seen.next();
                if !engine.source(view.source_idx).see(&tile, sight) {
                    continue;
                }
                let listed = mentions.interpolated(view, parts);
                if any_bordered {
                    // Elsewhere the masks of all that is listed are one.
                    engine.mask(view.source_idx, sight, |k| listed.blended[k] > 0.0);
                    term.differ(&listed.diff);
                    term.a = each(|k| sight.a[k] * listed.blended[k]);
                }
                sight.a = each(|k| sight.a[k] * listed.weight[k]);
                seen.keep(view.source_idx);
            }
            if any_bordered {
                seen.weigh(&frame.options);
                seen.add_weights();
            }
            let colors = engine.shade(&photos, seen, |sight, _| &sight.a);
            done = done.and(colors.map(|colors| put(&colors, pixels, width * 4, [x, y])));
        }
        done
    })
}

/// A triangle and the pixels of a tile that it covers.
struct Part {
    triangle_idx: usize,
    covers: [bool; LANES],
    bordered: bool,
    /// Its corners', in all of the tile's pixels.
    shares: [Lane; 3],
    /// Of those in the pixels that it covers the least, corner by corner, and their sum in one: all have the same,
    /// up to rounding.
    least: ([f32; 3], f32),
}

impl Part {
    /// All of a tile, which begins in this column and row of a band of so wide a picture, by the triangles that
    /// cover its pixels.
    fn of_tile(covering: &[u32], width: usize, [x, y]: [usize; 2], parts: &mut Vec<Self>) {
        parts.clear();
        for (row, covering) in covering.chunks(width).skip(y).take(TILE[1]).enumerate() {
            for (column, &triangle) in covering[x..].iter().take(TILE[0]).enumerate() {
                if triangle == NO_TRIANGLE {
                    continue;
                }
                let triangle_idx = triangle as usize;
                let known = parts.iter().rposition(|p| p.triangle_idx == triangle_idx);
                let at = known.unwrap_or_else(|| {
                    parts.push(Self {
                        triangle_idx,
                        covers: [false; LANES],
                        bordered: false,
                        shares: [[0.0; LANES]; 3],
                        least: ([0.0; 3], 0.0),
                    });
                    parts.len() - 1
                });
                parts[at].covers[row * TILE[0] + column] = true;
            }
        }
    }

    /// Finds what is least of the shares.
    #[inline(always)]
    fn find_least(&mut self) {
        let least = |of: &Lane| {
            // They are not negative where it covers a pixel: in order as their bits are, of which vectors find
            // the least.
            let mut least = u32::MAX;
            for k in 0..LANES {
                let bits = if self.covers[k] {
                    of[k].to_bits()
                } else {
                    u32::MAX
                };
                least = least.min(bits);
            }
            f32::from_bits(least)
        };
        let first = self.covers.iter().position(|covers| *covers).unwrap_or(0);
        self.least = (
            self.shares.each_ref().map(least),
            self.shares.iter().map(|share| share[first]).sum(),
        );
    }

    /// At most what is interpolated between so much at the corners, none of which is negative, in any of the
    /// pixels that it covers.
    fn at_least(&self, values: &[f32; 3]) -> f32 {
        /// Of what is summed, more than rounding can take.
        const SLACK: f32 = 4e-6;
        let (shares, sum) = self.least;
        let least = values.iter().copied().fold(f32::INFINITY, f32::min);
        let above = |c: usize| shares[c] * (values[c] - least);
        let most = values.iter().copied().fold(0.0, f32::max);
        (sum * least + above(0) + above(1) + above(2) - SLACK * most).max(0.0)
    }

    /// Says so of the pixels that it covers.
    fn mark(&self, lanes: &mut [bool; LANES]) {
        for k in 0..LANES {
            lanes[k] |= self.covers[k];
        }
    }
}

/// What a thread uses again for every tile that it draws of a triangulated field.
#[derive(Default)]
struct Scratch {
    spans: Vec<Span>,
    /// Of the band, row by row: the triangle that covers a pixel.
    covering: Vec<u32>,
    parts: Vec<Part>,
    mentions: Mentions,
    seen: Seen,
}

/// What the triangles that cross a tile list.
#[derive(Default)]
struct Mentions {
    /// Which of the tile's parts has a source view, and the corners' values; view by view.
    all: Vec<(usize, [f32; 3])>,
    /// Those that may count, by the least difference.
    views: Vec<Mentioned>,
    /// Of each part, which of the field's entries are yet to come.
    next: Vec<Range<usize>>,
}

/// A source view that some triangle lists.
struct Mentioned {
    source_idx: usize,
    /// At most its least difference in bordered triangles; less than any where it has weights, too.
    least: f32,
    /// Which of all mentions are of it.
    mentions: Range<usize>,
}

impl Mentions {
    fn of_parts(&mut self, parts: &[Part], field: &TriangulatedField) {
        let Self { all, views, next } = self;
        all.clear();
        views.clear();
        next.clear();
        next.extend(parts.iter().map(|part| {
            let triangle = &field.triangles[part.triangle_idx];
            let first = triangle.first_entry as usize;
            first..first + triangle.entry_count as usize
        }));
        // Each triangle lists them in order.
        let entry = |at: &Range<usize>| (!at.is_empty()).then(|| &field.entries[at.start]);
        while let Some(source_idx) = next
            .iter()
            .filter_map(|at| Some(entry(at)?.source_idx))
            .min()
        {
            let start = all.len();
            let mut least = f32::INFINITY;
            for (i, (at, part)) in next.iter_mut().zip(parts).enumerate() {
                let Some(entry) = entry(at).filter(|entry| entry.source_idx == source_idx) else {
                    continue;
                };
                at.start += 1;
                let values = entry.values;
                least = least.min(match part.bordered {
                    true => part.at_least(&values),
                    false if values == [0.0; 3] => f32::INFINITY,
                    false => -1.0,
                });
                all.push((i, values));
            }
            if least == f32::INFINITY {
                all.truncate(start);
                continue;
            }
            views.push(Mentioned {
                source_idx: source_idx as usize,
                least,
                mentions: start..all.len(),
            });
        }
        views.sort_by(|x, y| x.least.total_cmp(&y.least));
    }

    /// Those that may count; the least different first, of equal ones the first.
    fn views(&self) -> &[Mentioned] {
        &self.views
    }

    /// What the triangles say of a view in each of the tile's pixels.
    fn interpolated(&self, view: &Mentioned, parts: &[Part]) -> Interpolated {
        let mut into = Interpolated {
            weight: [0.0; LANES],
            diff: [1.0; LANES],
            blended: [0.0; LANES],
        };
        vectorised(
            #[inline(always)]
            || {
                for (part, [v0, v1, v2]) in &self.all[view.mentions.clone()] {
                    let part = &parts[*part];
                    let values = match part.bordered {
                        true => &mut into.diff,
                        false => &mut into.weight,
                    };
                    let [a, b, c] = &part.shares;
                    for k in 0..LANES {
                        let value = a[k] * v0 + b[k] * v1 + c[k] * v2;
                        values[k] = if part.covers[k] { value } else { values[k] };
                    }
                    let blended = if part.bordered { 1.0 } else { 0.0 };
                    for k in 0..LANES {
                        into.blended[k] = if part.covers[k] {
                            blended
                        } else {
                            into.blended[k]
                        };
                    }
                }
            },
        );
        into
    }
}

/// What a field says of one source view over a tile.
struct Interpolated {
    /// In triangles that no photo's or mask's border crosses; zero elsewhere.
    weight: Lane,
    /// In the others.
    diff: Lane,
    /// One where `diff` counts, else zero.
    blended: Lane,
}
