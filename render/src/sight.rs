//! The proxy moved to where photos can see it.

#[cfg(test)]
mod exhaustive;
mod hidden;
mod known;
mod reach;
#[cfg(test)]
mod tests;
mod views;

use crate::frame::FrameSource;
use crate::photos::PhotoStore;
use crate::surface::FacetMap;
use crate::tiles::TILE;
use crate::visibility::Visibility;
use calibrate::{Pixel, View};
use glam::{DVec2, DVec3};
pub(crate) use hidden::{Between, Seen};
use known::Known;
use proxy::Rays;
use rayon::prelude::*;
use reach::Beam;
use std::ops::Range;
pub(crate) use views::Views;

/// The factor between inverse distances that are tried, and how many on either side.
const STEP: f64 = 1.15;
const STEPS: i32 = 24;
/// More than rounding makes of a position in a photo.
const MARGIN_PX: f64 = 1e-3;
/// The same of what engines round to 32 bits: some thirty times 2⁻²⁴. Of a position it is a part of the
/// focal length or of the photo's longer side, of a direction it is radians. See [`edge`].
const EDGE: f64 = 2e-6;
/// Halvings of a step in the end.
const HALVINGS: u32 = 6;

/// As many times an inverse distance as none is that is tried in its place: one step more.
fn nearest_tried() -> f64 {
    factor(STEPS + 1)
}

/// The factor of so many steps. (`powi` may round otherwise from one place of a program to the next.)
fn factor(steps: i32) -> f64 {
    const OF: [f64; STEPS as usize + 2] = {
        let mut of = [1.0; STEPS as usize + 2];
        let mut k = 1;
        while k < of.len() {
            of[k] = STEP * of[k - 1];
            k += 1;
        }
        of
    };
    let of = OF[steps.unsigned_abs() as usize];
    if steps < 0 { 1.0 / of } else { of }
}

/// Whether the point at ray / s lies in a source view's image.
fn sees(source: &FrameSource, ray: DVec3, s: f64) -> bool {
    source.takes_part() && shows(source, from_source(source, ray, s), 0.0)
}

/// The same beyond doubt, for engines that round to 32 bits, too: neither on the very border of the image
/// nor where the lens just ceases to see. To be blind by a hair to what was moved for its sake leaves a hole.
fn sees_well(source: &FrameSource, ray: DVec3, s: f64) -> bool {
    if !source.takes_part() {
        return false;
    }
    let point = from_source(source, ray, s);
    let edge = edge(source, point, s);
    let [width, height] = source.size;
    let edge_px = edge * source.lens.mean_focal().max(width).max(height);
    // Whatever the lens, this one lies farther from its axis.
    let aside = point - DVec3::Z * (edge * point.length());
    shows(source, point, edge_px) && source.lens.project(aside).is_some()
}

/// [`EDGE`] of a point in a source camera's frame, times s. Its terms are rounded: where the viewer is farther
/// from the camera than the point is, they are larger than their sum.
fn edge(source: &FrameSource, point: DVec3, s: f64) -> f64 {
    EDGE * (source.translation.length() * s / point.length()).max(1.0)
}

/// The point at ray / s in a source camera's frame, times s.
fn from_source(source: &FrameSource, ray: DVec3, s: f64) -> DVec3 {
    source.rotation * ray + source.translation * s
}

/// Whether a point in a source camera's frame lies so many pixels within its image.
fn shows(source: &FrameSource, point: DVec3, margin: f64) -> bool {
    let [right, bottom] = source.size.map(|side| side - margin);
    let is_inside = |p: Pixel| p.x >= margin && p.y >= margin && p.x <= right && p.y <= bottom;
    source.lens.project(point).is_some_and(is_inside)
}

/// Which source views what was moved was moved to, by parts of the picture.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Seers {
    across: usize,
    /// Tiles of 8 × 8 pixels, row by row: the views, in order. Empty where nothing was moved.
    tiles: Vec<Vec<u32>>,
}

impl Seers {
    fn new([width, height]: [usize; 2]) -> Self {
        let across = width.div_ceil(TILE);
        Self {
            across,
            tiles: vec![Vec::new(); across * height.div_ceil(TILE)],
        }
    }

    fn note(&mut self, (x, y): (usize, usize), source_idx: u32) {
        let tile = &mut self.tiles[y / TILE * self.across + x / TILE];
        if let Err(at) = tile.binary_search(&source_idx) {
            tile.insert(at, source_idx);
        }
    }

    /// Those of all tiles that a rectangle touches, with repeats.
    pub(crate) fn within(&self, least: DVec2, most: DVec2) -> impl Iterator<Item = u32> {
        let tile = |at: f64| (at.max(0.0) / TILE as f64) as usize;
        let down = self.tiles.len().checked_div(self.across).unwrap_or(0);
        let columns = tile(least.x)..(tile(most.x) + 1).min(self.across);
        let rows = tile(least.y)..(tile(most.y) + 1).min(down);
        rows.flat_map(move |row| {
            let row = &self.tiles[row * self.across..(row + 1) * self.across];
            row.get(columns.clone()).unwrap_or_default()
        })
        .flatten()
        .copied()
    }
}

/// Moves what no source view has in its image along its ray, to the nearest inverse distance at
/// which one has, beyond doubt of rounding.
///
/// Where no photo shows the proxy, its depth is a guess anyway: beside the points that it is
/// made of, or on a dome. A guess that photos can answer paints what they show there, and
/// not nothing. (Of house-walk's held-out pixels that are 2 to 4 %, black before.)
///
/// Pixels are asked one by one only where no photo has all that is seen of a facet; where facets are small,
/// or rays bend, only in tiles of which none has all that they show.
///
/// Source views are asked about what is in their reach alone (`reach.rs`): where none can see what is looked at, each is
/// held against a tile once, and not against each pixel at each inverse distance that is tried.
///
/// `rays` are the desired view's, where they are known.
pub(crate) fn within_sight(
    map: FacetMap,
    desired: &View,
    rays: Option<&Rays>,
    views: &Views<'_>,
) -> FacetMap {
    let moved = to_move(&map, desired, rays, views);
    with_moved(map, moved)
}

/// Moves what every photo that has it in its image has something before along its ray, to the nearest
/// place before it that one shows. See `hidden.rs`.
pub(crate) fn out_of_hiding(
    map: FacetMap,
    desired: &View,
    rays: Option<&Rays>,
    views: &Views<'_>,
    visibility: &Visibility,
    photos: &PhotoStore,
) -> FacetMap {
    let moved = hidden::hidden(&map, desired, rays, views, visibility, photos);
    with_moved(map, moved)
}

/// What is to be moved, row by row.
fn to_move(
    map: &FacetMap,
    desired: &View,
    rays: Option<&Rays>,
    views: &Views<'_>,
) -> Vec<Vec<Moved>> {
    let known = rays.map_or_else(Known::default, |rays| Known::of(map, rays, views));
    if known.is_all {
        return Vec::new();
    }
    moved(map, desired, rays, views, &known)
}

/// The map with that moved.
fn with_moved(mut map: FacetMap, moved: Vec<Vec<Moved>>) -> FacetMap {
    if moved.iter().any(|row| !row.is_empty()) && map.seers.tiles.is_empty() {
        map.seers = Seers::new(map.size.map(|side| side as usize));
    }
    let width = map.size[0] as usize;
    for (y, row) in moved.into_iter().enumerate() {
        for moved in row {
            map.seers.note((moved.x, y), moved.source_idx);
            map.tiles.mix(moved.x, y);
            let at = y * width + moved.x;
            // It may move twice.
            let before = map.shift_px(map.facet_of[at]);
            map.shifts_px.push(before.max(moved.shift_px));
            map.facet_of[at] = map.planes.len() as u32;
            map.planes.push(moved.plane);
        }
    }
    map
}

/// A pixel of a row that looks at something else now.
struct Moved {
    x: usize,
    plane: DVec3,
    /// The first source view that has it.
    source_idx: u32,
    /// How far apart that has it from where it was, in pixels of the desired view: by so much it is a guess.
    shift_px: f32,
}

/// The angle by which a source view has the point at ray / s apart from that at ray / `to`, in pixels of a desired view.
fn shift_px(source: &FrameSource, desired: &View, ray: DVec3, s: f64, to: f64) -> f32 {
    let [a, b] = [s, to].map(|s| from_source(source, ray, s));
    let angle = a.cross(b).length().atan2(a.dot(b));
    (desired.lens.mean_focal() * angle) as f32
}

/// Whether the source view of a guess has all points between some well inside its image.
fn guess_has_all<const N: usize>(
    sources: &[FrameSource],
    guess: usize,
    corners: &[(DVec3, f64); N],
) -> bool {
    let guess = sources.get(guess);
    guess.is_some_and(|source| has_well_inside(source, corners))
}

/// The same of the first that sees the first of these points, which is the next guess: if any does, it is among some.
fn first_has_all<const N: usize>(
    views: &Views<'_>,
    among: impl IntoIterator<Item = u32>,
    guess: &mut usize,
    corners: &[(DVec3, f64); N],
) -> bool {
    let (ray, s) = corners[0];
    // What lies behind the viewer nobody has.
    if !(s >= 0.0) {
        return false;
    }
    match views.first(among, ray, s) {
        Some(found) => {
            *guess = found;
            has_well_inside(&views.sources[found], corners)
        }
        None => false,
    }
}

/// Pixels of a run that are asked together where no photo has all of it.
const PART: usize = 32;

/// For each tile of a row the views that may see something of what its pixels look at, wherever that is moved:
/// found when they are first asked for.
type InReach = [Option<Vec<u32>>];

/// A pixel's ray and the inverse distance of what it sees, if it is anything.
fn look(
    map: &FacetMap,
    desired: &View,
    rays: Option<&Rays>,
    x: usize,
    y: usize,
) -> Option<(DVec3, f64)> {
    let plane = map
        .planes
        .get(map.facet_of[y * map.size[0] as usize + x] as usize)?;
    let ray = match rays {
        Some(rays) => rays.at(x, y)?.extend(1.0),
        None => desired
            .lens
            .unproject(Pixel::center_of(x as u32, y as u32))?,
    };
    Some((ray, plane.dot(ray)))
}

/// What the tile around a pixel looks at, wherever that is moved.
fn beam_of_tile(
    map: &FacetMap,
    looks: &impl Fn(usize, usize) -> Option<(DVec3, f64)>,
    x: usize,
    y: usize,
) -> Beam {
    let of_tile = |at: usize, side: u32| {
        let first = at / TILE * TILE;
        first..(first + TILE).min(side as usize)
    };
    let [width, height] = map.size;
    let mut beam = Beam::NONE;
    for y in of_tile(y, height) {
        for x in of_tile(x, width) {
            if let Some((ray, s)) = looks(x, y) {
                beam = beam.with(ray, s);
            }
        }
    }
    beam.nearer(nearest_tried())
}

/// What is moved, row by row. What is known to be seen is skipped.
fn moved(
    map: &FacetMap,
    desired: &View,
    rays: Option<&Rays>,
    views: &Views<'_>,
    known: &Known,
) -> Vec<Vec<Moved>> {
    let [width, height] = map.size.map(|side| side as usize);
    let nearest_tried = nearest_tried();
    let is_straight = rays.is_some_and(Rays::are_straight);
    let looks = |x: usize, y: usize| look(map, desired, rays, x, y);
    let in_reach = |x: usize, y: usize| -> Vec<u32> {
        views.within(&beam_of_tile(map, &looks, x, y)).collect()
    };
    // What a run along straight rays sees lies on a line.
    let is_seen = |pixels: &Range<usize>, y: usize, last: &mut usize, near: &mut InReach| {
        let ends = || Some([looks(pixels.start, y)?, looks(pixels.end - 1, y)?]);
        let Some(ends) = is_straight.then(ends).flatten() else {
            return false;
        };
        guess_has_all(views.sources, *last, &ends) || {
            let near = near[pixels.start / TILE].get_or_insert_with(|| in_reach(pixels.start, y));
            first_has_all(views, near.iter().copied(), last, &ends)
        }
    };
    let of_row = |y: usize, tiles: &[(Range<usize>, Option<u32>)], near: &mut InReach| {
        let row = &map.facet_of[y * width..(y + 1) * width];
        // The view that saw the last pixel mostly sees the next.
        let mut last = 0;
        let mut along = Vec::new();
        let mut moved = Vec::new();
        for run in known.open_runs(row, tiles) {
            if is_seen(&run, y, &mut last, near) {
                continue;
            }
            let parts = run.clone().step_by(PART);
            for part in parts.map(|x| x..(x + PART).min(run.end)) {
                if run.len() > PART && is_seen(&part, y, &mut last, near) {
                    continue;
                }
                for x in part {
                    let Some((ray, s)) = looks(x, y) else {
                        continue;
                    };
                    if !(s >= 0.0) || views.sees(last, ray, s) {
                        continue;
                    }
                    let near = near[x / TILE].get_or_insert_with(|| in_reach(x, y));
                    if let Some(found) = views.first(near.iter().copied(), ray, s) {
                        last = found;
                        continue;
                    }
                    views.along(near, ray, s * nearest_tried, &mut along);
                    if along.is_empty() {
                        continue;
                    }
                    let seer = |s: f64| views.first_well(&along, ray, s);
                    let nearest = nearest_seen(s, &mut |s: f64| seer(s).is_some());
                    if let Some((to, found)) = nearest.and_then(|to| Some((to, seer(to)?))) {
                        last = found;
                        moved.push(Moved {
                            x,
                            plane: ray * (to / ray.length_squared()),
                            source_idx: found as u32,
                            shift_px: shift_px(&views.sources[found], desired, ray, s, to),
                        });
                    }
                }
            }
        }
        moved
    };
    let of_tiles = |tile_row: usize| {
        let tiles = known.open_tiles(map, tile_row);
        let mut near: Vec<Option<Vec<u32>>> = vec![None; width.div_ceil(TILE)];
        let rows = tile_row * TILE..((tile_row + 1) * TILE).min(height);
        rows.map(move |y| of_row(y, &tiles, &mut near))
    };
    let tile_rows = (0..map.tiles.down()).into_par_iter();
    tile_rows.flat_map_iter(of_tiles).collect()
}

/// Whether all points between some, each at ray / s, lie inside a source view's image, beyond doubt
/// of rounding.
fn has_well_inside<const N: usize>(source: &FrameSource, corners: &[(DVec3, f64); N]) -> bool {
    let points = corners.map(|(ray, s)| source.rotation * ray + source.translation * s);
    let is_ahead = points.iter().all(|p| p.z > 0.0) && corners.iter().all(|(_, s)| *s >= 0.0);
    if !source.takes_part() || !is_ahead {
        return false;
    }
    let flat = points.map(|p| p.truncate() / p.z);
    let farthest = flat.iter().map(|p| p.length()).fold(0.0, f64::max);
    let Some(bend) = source.lens.bend(farthest) else {
        return false;
    };
    let apart = |from: &DVec2| flat.map(|to| to.distance_squared(*from));
    let squared = flat.iter().flat_map(apart).fold(0.0, f64::max);
    let margin = MARGIN_PX + 0.5 * bend * squared;
    let [width, height] = source.size;
    let is_inside = |p: Pixel| p.x.min(width - p.x).min(p.y).min(height - p.y) >= margin;
    let mut pixels = points.into_iter().map(|p| source.lens.project(p));
    pixels.all(|pixel| pixel.is_some_and(is_inside))
}

/// The inverse distance nearest to `s`, by its ratio, that is seen; `None` if none tried is.
fn nearest_seen(s: f64, seen: &mut impl FnMut(f64) -> bool) -> Option<f64> {
    let sides = (1..=STEPS).flat_map(|k| [k, -k]);
    let mut found = sides.into_iter().map(|k| (k, s * factor(k)));
    let Some((k, mut near)) = found.find(|(_, s)| seen(*s)) else {
        return seen(0.0).then_some(0.0);
    };
    // Between it and the one before, so that neighbouring pixels move alike.
    let mut beyond = s * factor(k - k.signum());
    for _ in 0..HALVINGS {
        let middle = (near * beyond).sqrt();
        if seen(middle) {
            near = middle;
        } else {
            beyond = middle;
        }
    }
    Some(near)
}
