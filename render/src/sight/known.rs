//! What is known without asking for each pixel: that some photo sees it, or that none could wherever it was.

use super::reach::Beam;
use super::views::Views;
use super::{first_has_all, guess_has_all, nearest_tried};
use crate::surface::{FacetMap, NO_FACET};
use crate::tiles::TILE;
use glam::{DVec2, DVec3};
use proxy::Rays;
use rayon::prelude::*;
use std::ops::Range;

/// What needs no asking for each pixel.
#[derive(Default)]
pub(super) struct Known {
    pub(super) across: usize,
    /// By tile, row by row: whether some source view has all that its pixels see, or none would have any of it wherever it
    /// is moved.
    pub(super) tiles: Vec<bool>,
    /// By facet: whether some source view has all that pixels of other tiles see of it.
    pub(super) facets: Vec<bool>,
    /// Whether that is true of all facets that these see.
    pub(super) is_all: bool,
}

impl Known {
    pub(super) fn of(map: &FacetMap, rays: &Rays, views: &Views<'_>) -> Self {
        // Large facets are asked alone, which mostly is enough.
        if rays.are_straight() && map.planes.len() * TILE * TILE <= map.facet_of.len() {
            let (facets, is_all) = facets_seen_whole(map, rays, views, &Self::default());
            return Self {
                facets,
                is_all,
                ..Self::default()
            };
        }
        let mut known = Self {
            across: (map.size[0] as usize).div_ceil(TILE),
            tiles: tiles_seen_whole_or_never(map, rays, views),
            ..Self::default()
        };
        (known.facets, known.is_all) = facets_seen_whole(map, rays, views, &known);
        known
    }

    /// The tiles of one of their rows of which nothing is known: their columns of pixels, and the facet that all
    /// of these see, if it is one.
    pub(super) fn open_tiles(
        &self,
        map: &FacetMap,
        row: usize,
    ) -> Vec<(Range<usize>, Option<u32>)> {
        let tiles = map.tiles.of_row(row, map.size[0] as usize);
        let numbered = tiles.zip(row * self.across..);
        let is_open = |((_, facet), tile): &((Range<usize>, Option<u32>), usize)| {
            !self.has_tile(*tile) && facet.is_none_or(|facet| self.is_open(facet))
        };
        numbered.filter(is_open).map(|(tile, _)| tile).collect()
    }

    /// The runs of pixels of a row that see one facet, which is not known to be seen, within tiles that are not
    /// either.
    pub(super) fn open_runs(
        &self,
        row: &[u32],
        tiles: &[(Range<usize>, Option<u32>)],
    ) -> Vec<Range<usize>> {
        let mut open: Vec<Range<usize>> = Vec::new();
        for (columns, _) in tiles {
            let mut start = columns.start;
            for run in runs(&row[columns.clone()]) {
                let pixels = start..start + run.len();
                start = pixels.end;
                match open.last_mut() {
                    _ if !self.is_open(run[0]) => {}
                    Some(last) if last.end == pixels.start && row[last.start] == run[0] => {
                        last.end = pixels.end;
                    }
                    _ => open.push(pixels),
                }
            }
        }
        open
    }

    /// Whether a pixel sees something, which is not known to be seen by a source view.
    fn is_open(&self, facet: u32) -> bool {
        facet != NO_FACET && self.facets.get(facet as usize) != Some(&true)
    }

    fn has_tile(&self, tile: usize) -> bool {
        self.tiles.get(tile) == Some(&true)
    }
}

/// The runs of equal numbers; mostly there is one.
fn runs(row: &[u32]) -> impl Iterator<Item = &[u32]> {
    let off = row.iter().fold(0, |off, facet| off | (facet ^ row[0]));
    let (whole, parts) = if off == 0 {
        (row, &row[..0])
    } else {
        (&row[..0], row)
    };
    let whole = Some(whole).filter(|row| !row.is_empty());
    whole.into_iter().chain(parts.chunk_by(|a, b| a == b))
}

/// For each tile, whether some source view has all that its pixels see: all between the least and the
/// greatest inverse depth before the smallest rectangle around their rays, in the plane z = 1. Or whether none
/// reaches into that, from infinity to as near as anything is moved.
fn tiles_seen_whole_or_never(map: &FacetMap, rays: &Rays, views: &Views<'_>) -> Vec<bool> {
    let [width, height] = map.size.map(|side| side as usize);
    let across = width.div_ceil(TILE);
    let mut whole = vec![false; across * height.div_ceil(TILE)];
    let of_row = |(row, whole): (usize, &mut [bool])| {
        // Tiles beside one another are mostly seen by the same.
        let mut last = 0;
        for (i, whole) in whole.iter_mut().enumerate() {
            let (mut least, mut most) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
            let (mut far, mut near) = (f64::INFINITY, f64::NEG_INFINITY);
            for y in row * TILE..((row + 1) * TILE).min(height) {
                for x in i * TILE..((i + 1) * TILE).min(width) {
                    let facet = map.facet_of[y * width + x];
                    if facet == NO_FACET {
                        continue;
                    }
                    if let Some(at) = rays.at(x, y) {
                        let s = map.planes[facet as usize].dot(at.extend(1.0));
                        (least, most) = (least.min(at), most.max(at));
                        (far, near) = (far.min(s), near.max(s));
                    }
                }
            }
            if !(least.x <= most.x) {
                // It sees nothing.
                *whole = true;
                continue;
            }
            let corner = |k: usize| {
                let side =
                    |bit: usize, low: f64, high: f64| if k >> bit & 1 == 0 { low } else { high };
                let at = DVec2::new(side(0, least.x, most.x), side(1, least.y, most.y));
                (at.extend(1.0), side(2, far, near))
            };
            let corners = std::array::from_fn::<_, 8, _>(corner);
            *whole = guess_has_all(views.sources, last, &corners) || {
                let beam = Beam::NONE.with(least.extend(1.0), near);
                let beam = beam.with(most.extend(1.0), near);
                let beam = beam.nearer(nearest_tried());
                let mut in_reach = views.within(&beam).peekable();
                in_reach.peek().is_none() || first_has_all(views, in_reach, &mut last, &corners)
            };
        }
    };
    let rows = whole.par_chunks_mut(across.max(1)).enumerate();
    rows.for_each(of_row);
    whole
}

/// For each facet, whether some source view has all that pixels of tiles that are not known yet see
/// of it: then it has the part of the facet's plane before the smallest rectangle around their rays,
/// in the plane z = 1. And whether that is true of all that these pixels see.
pub(super) fn facets_seen_whole(
    map: &FacetMap,
    rays: &Rays,
    views: &Views<'_>,
    known: &Known,
) -> (Vec<bool>, bool) {
    // 1. The rectangles.
    let [width, height] = map.size.map(|side| side as usize);
    let of_run = |pixels: Range<usize>, y: usize| {
        // A pixel without a ray sees nothing.
        let at = |x: usize| rays.at(x, y);
        if rays.are_straight() {
            let ends = [pixels.start, pixels.end - 1];
            ends.into_iter().filter_map(at).fold(NO_BOX, grown)
        } else {
            pixels.filter_map(at).fold(NO_BOX, grown)
        }
    };
    let of_tiles = |mut boxes: Vec<Rectangle>, tile_row: usize| {
        let rows = tile_row * TILE..((tile_row + 1) * TILE).min(height);
        // Of straight rays the first and the last row are as far as any.
        let step = if rays.are_straight() {
            (rows.len() - 1).max(1)
        } else {
            1
        };
        let mut grow = |facet: u32, of_run: Rectangle| {
            let all = &mut boxes[facet as usize];
            *all = both(*all, of_run);
        };
        for (columns, facet) in known.open_tiles(map, tile_row) {
            if let Some(facet) = facet {
                let ends = rows.clone().step_by(step);
                ends.for_each(|y| grow(facet, of_run(columns.clone(), y)));
                continue;
            }
            for y in rows.clone() {
                let row = &map.facet_of[y * width..][..columns.end];
                let mut start = columns.start;
                while start < columns.end {
                    let facet = row[start];
                    let others = row[start..].iter().position(|other| *other != facet);
                    let end = others.map_or(columns.end, |run| start + run);
                    if known.is_open(facet) {
                        grow(facet, of_run(start..end, y));
                    }
                    start = end;
                }
            }
        }
        boxes
    };
    let none = || vec![NO_BOX; map.planes.len()];
    let tile_rows = (0..map.tiles.down()).into_par_iter();
    let boxes = tile_rows.with_min_len(TILE_ROWS).fold(none, of_tiles);
    let of_both = |mut boxes: Vec<Rectangle>, others: Vec<Rectangle>| {
        let pairs = boxes.iter_mut().zip(others);
        pairs.for_each(|(own, other)| *own = both(*own, other));
        boxes
    };
    let boxes = boxes.reduce(none, of_both);

    // 2. Whether they are seen.
    let mut whole = vec![false; boxes.len()];
    let facets = boxes.par_chunks(FACETS).zip(map.planes.par_chunks(FACETS));
    let work = whole.par_chunks_mut(FACETS).zip(facets);
    work.for_each(|(whole, (boxes, planes))| {
        // Facets beside one another are mostly seen by the same. Else only those are asked that may see something of
        // all of them.
        let mut last = 0;
        let mut near = None;
        for (whole, (seen, plane)) in whole.iter_mut().zip(boxes.iter().zip(planes)) {
            let Some(corners) = corners_of(seen, *plane) else {
                continue;
            };
            *whole = guess_has_all(views.sources, last, &corners) || {
                let near: &mut Vec<u32> = near.get_or_insert_with(|| {
                    let all = boxes.iter().zip(planes);
                    let all = all.filter_map(|(seen, plane)| corners_of(seen, *plane));
                    let with = |beam: Beam, (ray, s): (DVec3, f64)| beam.with(ray, s);
                    let beam = all.flatten().fold(Beam::NONE, with);
                    views.within(&beam).collect()
                });
                first_has_all(views, near.iter().copied(), &mut last, &corners)
            };
        }
    });
    let is_open = |(whole, (least, most)): (&bool, &Rectangle)| !whole && least.x <= most.x;
    let is_all = !whole.iter().zip(&boxes).any(is_open);
    (whole, is_all)
}

/// The corners of a part of a facet's plane, before a rectangle: rays, and at which inverse distances; `None` of
/// nothing.
fn corners_of((least, most): &Rectangle, plane: DVec3) -> Option<[(DVec3, f64); 4]> {
    let corners = [
        *least,
        DVec2::new(most.x, least.y),
        *most,
        DVec2::new(least.x, most.y),
    ];
    let at = |corner: DVec2| (corner.extend(1.0), plane.dot(corner.extend(1.0)));
    (least.x <= most.x).then(|| corners.map(at))
}

/// Its least and its greatest coordinates.
type Rectangle = (DVec2, DVec2);

/// A rectangle of nothing.
const NO_BOX: Rectangle = (DVec2::INFINITY, DVec2::NEG_INFINITY);

/// The smallest around two.
fn both(one: Rectangle, other: Rectangle) -> Rectangle {
    (one.0.min(other.0), one.1.max(other.1))
}

/// A rectangle with a point more.
fn grown((least, most): Rectangle, p: DVec2) -> Rectangle {
    (least.min(p), most.max(p))
}

/// Rows of tiles that are looked at one after the other, at the least.
const TILE_ROWS: usize = 16;
/// Facets that are asked one after the other.
const FACETS: usize = 256;
