//! The proxy moved to where photos can see it.

mod known;

use crate::frame::FrameSource;
use crate::surface::FacetMap;
use crate::tiles::TILE;
use calibrate::{Pixel, View};
use glam::{DVec2, DVec3};
use known::Known;
use proxy::Rays;
use rayon::prelude::*;
use std::ops::Range;

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
/// from the camera than the point is, they are larger than their sum. (Of 400,000 points on photos' borders the
/// farthest was rounded by 5e-7 with both as far, and by 4e-7 times the ratio of distances up to 10,000.)
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

/// The view that saw the last point, if it sees this one, too; else the first that does.
fn seer(
    sources: &[FrameSource],
    last: &mut usize,
    sees: impl Fn(&FrameSource) -> bool,
) -> Option<usize> {
    let found = match sources.get(*last) {
        Some(source) if sees(source) => Some(*last),
        _ => sources.iter().position(sees),
    };
    *last = found.unwrap_or(*last);
    found
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
/// `rays` are the desired view's, where they are known.
pub(crate) fn within_sight(
    mut map: FacetMap,
    desired: &View,
    rays: Option<&Rays>,
    sources: &[FrameSource],
) -> FacetMap {
    let known = rays.map_or_else(Known::default, |rays| Known::of(&map, rays, sources));
    if known.is_all {
        return map;
    }
    let moved = moved(&map, desired, rays, sources, &known);
    if moved.iter().any(|row| !row.is_empty()) {
        map.seers = Seers::new(map.size.map(|side| side as usize));
    }
    let width = map.size[0] as usize;
    for (y, row) in moved.into_iter().enumerate() {
        for moved in row {
            map.seers.note((moved.x, y), moved.source_idx);
            map.tiles.mix(moved.x, y);
            map.facet_of[y * width + moved.x] = map.planes.len() as u32;
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
}

/// Whether the source view of a guess has all points between some well inside its image, or the
/// first that sees one of them, which is the next guess.
fn has_all<const N: usize>(
    sources: &[FrameSource],
    guess: &mut usize,
    corners: &[(DVec3, f64); N],
) -> bool {
    let has_all = |source: &FrameSource| has_well_inside(source, corners);
    if sources.get(*guess).is_some_and(has_all) {
        return true;
    }
    let (ray, s) = corners[0];
    match sources.iter().position(|source| sees(source, ray, s)) {
        Some(found) => {
            *guess = found;
            has_all(&sources[found])
        }
        None => false,
    }
}

/// Pixels of a run that are asked together where no photo has all of it.
const PART: usize = 32;

/// What is moved, row by row. What is known to be seen is skipped.
fn moved(
    map: &FacetMap,
    desired: &View,
    rays: Option<&Rays>,
    sources: &[FrameSource],
    known: &Known,
) -> Vec<Vec<Moved>> {
    let [width, height] = map.size.map(|side| side as usize);
    let first_well = |ray, s| sources.iter().position(|source| sees_well(source, ray, s));
    let is_straight = rays.is_some_and(Rays::are_straight);
    let ray = |x: usize, y: usize| match rays {
        Some(rays) => rays.at(x, y).map(|at| at.extend(1.0)),
        None => desired.lens.unproject(Pixel::center_of(x as u32, y as u32)),
    };
    let of_row = |y: usize, tiles: &[(Range<usize>, Option<u32>)]| {
        let row = &map.facet_of[y * width..(y + 1) * width];
        // The pixel's ray and the inverse distance of what it sees.
        let looks = |x: usize| {
            let ray = ray(x, y)?;
            Some((ray, map.planes[row[x] as usize].dot(ray)))
        };
        // The view that saw the last pixel mostly sees the next.
        let mut last = 0;
        let mut moved = Vec::new();
        // What a run along straight rays sees lies on a line.
        let is_seen = |pixels: &Range<usize>, last: &mut usize| {
            let ends = || Some([looks(pixels.start)?, looks(pixels.end - 1)?]);
            is_straight && ends().is_some_and(|ends| has_all(sources, last, &ends))
        };
        for run in known.open_runs(row, tiles) {
            if is_seen(&run, &mut last) {
                continue;
            }
            let parts = run.clone().step_by(PART);
            for part in parts.map(|x| x..(x + PART).min(run.end)) {
                if run.len() > PART && is_seen(&part, &mut last) {
                    continue;
                }
                for x in part {
                    let Some((ray, s)) = looks(x) else { continue };
                    let has = |source: &FrameSource| sees(source, ray, s);
                    if !(s >= 0.0) || seer(sources, &mut last, has).is_some() {
                        continue;
                    }
                    let mut seen = |s: f64| {
                        let has = |source: &FrameSource| sees_well(source, ray, s);
                        seer(sources, &mut last, has).is_some()
                    };
                    let nearest = nearest_seen(s, &mut seen);
                    let nearest = nearest.and_then(|s| Some((s, first_well(ray, s)?)));
                    if let Some((s, source_idx)) = nearest {
                        moved.push(Moved {
                            x,
                            plane: ray * (s / ray.length_squared()),
                            source_idx: source_idx as u32,
                        });
                    }
                }
            }
        }
        moved
    };
    let of_tiles = |tile_row: usize| {
        let tiles = known.open_tiles(map, tile_row);
        let rows = tile_row * TILE..((tile_row + 1) * TILE).min(height);
        rows.map(move |y| of_row(y, &tiles))
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
    let mut found = sides.into_iter().map(|k| (k, s * STEP.powi(k)));
    let Some((k, mut near)) = found.find(|(_, s)| seen(*s)) else {
        return seen(0.0).then_some(0.0);
    };
    // Between it and the one before, so that neighbouring pixels move alike.
    let mut beyond = s * STEP.powi(k - k.signum());
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

#[cfg(test)]
mod tests {
    use super::known::facets_seen_whole;
    use super::*;
    use crate::surface::NO_FACET;
    use calibrate::{Distortion, Lens, Rigid3};
    use proptest::prelude::*;
    use proptest::{array, collection};

    /// Looks along z from a place on the x axis, 45° to either side.
    fn view(x: f64) -> View {
        let center = DVec3::X * x;
        View {
            lens: Lens::pinhole(DVec2::splat(20.0), DVec2::splat(20.0)),
            width: 40,
            height: 40,
            camera_from_world: Rigid3::looking_at(center, center + DVec3::Z, DVec3::Y),
        }
    }

    fn within_sight(map: FacetMap, desired: &View, sources: &[FrameSource]) -> FacetMap {
        let rays = Rays::of(&desired.lens, (desired.width, desired.height));
        super::within_sight(map, desired, rays.as_ref(), sources)
    }

    /// Every pixel sees the plane at a depth of 2.
    fn flat() -> FacetMap {
        FacetMap::of_pixels(vec![DVec3::Z / 2.0], vec![0; 1600], &view(0.0))
    }

    #[test]
    fn what_a_photo_sees_stays_and_the_rest_moves_just_into_its_image() {
        let (desired, source) = (view(0.0), view(1.0));
        let map = within_sight(flat(), &desired, &[FrameSource::of(&source, &desired)]);
        let mut moved = 0;
        for y in 0..40 {
            for x in 0..40 {
                let ray = desired.lens.unproject(Pixel::center_of(x, y)).unwrap();
                let q = map.planes[map.facet_of[(y * 40 + x) as usize] as usize];
                let s = q.dot(ray);
                let ray_in_world = desired.camera_from_world.rotation.conjugate() * ray;
                let at = |s: f64| source.project(ray_in_world / s);
                let seen = |p: Option<Pixel>| p.is_some_and(|p| source.contains(p));
                let before = ray.z / 2.0;
                if seen(at(before)) {
                    assert_eq!(s, before);
                } else {
                    // The cameras stand side by side: only farther away does it see more.
                    moved += 1;
                    assert!(s < before && seen(at(s)), "{x} {y}: {s}");
                    let p = at(s * 1.01).unwrap();
                    assert!(!source.contains(p), "{x} {y}: {p:?} is well inside");
                }
            }
        }
        // The plane is 4 wide, and the camera stands 1 aside.
        assert_eq!(moved, 10 * 40);
        let seers = |x: f64, y: f64| {
            map.seers
                .within(DVec2::new(x, y), DVec2::new(x + 4.0, y + 4.0))
        };
        assert_eq!(seers(33.0, 33.0).collect::<Vec<_>>(), [0]);
        assert_eq!(seers(3.0, 3.0).count() + seers(90.0, 90.0).count(), 0);
        assert!(seers(-9.0, -9.0).count() <= 1);
    }

    #[test]
    fn what_moves_ends_where_a_photo_has_it_after_rounding_too() {
        // From where the photos were taken, and from so far behind that what is rounded nearly cancels.
        for back in [0.0, 30.0, 100.0, 300.0] {
            let depth = back + 2.0;
            let center = DVec3::NEG_Z * back;
            let desired = View {
                lens: Lens::pinhole(DVec2::splat(10.0 * depth), DVec2::splat(20.0)),
                camera_from_world: Rigid3::looking_at(center, center + DVec3::Z, DVec3::Y),
                ..view(0.0)
            };
            let flat = FacetMap::of_pixels(vec![DVec3::Z / depth], vec![0; 1600], &desired);
            let mut moved = 0;
            for step in 0..60 {
                // All look at what lies ahead, from aside: each pixel ends elsewhere in its photo.
                let angle = 0.1 * f64::from(step);
                let place = DVec3::new(angle.cos(), angle.sin(), 0.3 * (3.0 * angle).cos());
                let pose = Rigid3::looking_at(place, DVec3::Z * 20.0, DVec3::Y);
                let source = View {
                    camera_from_world: pose,
                    ..view(0.0)
                };
                let source = FrameSource::of(&source, &desired);
                let map = within_sight(flat.clone(), &desired, &[source]);
                for (i, _) in map.moved().enumerate().filter(|(_, is_moved)| *is_moved) {
                    let pixel = Pixel::center_of(i as u32 % 40, i as u32 / 40);
                    let ray = desired.lens.unproject(pixel).unwrap();
                    let s = map.planes[map.facet_of[i] as usize].dot(ray);
                    let point = from_source(&source, ray, s);
                    // What the plane it was kept as makes of it is off by f64's rounding.
                    let edge_px = 0.99 * 40.0 * edge(&source, point, s);
                    assert!(shows(&source, point, edge_px), "{back} {step}: {i}");
                    moved += 1;
                }
            }
            assert!(moved > 5_000, "{back}: {moved}");
        }
    }

    #[test]
    fn what_nobody_ever_sees_stays_where_it_is() {
        let desired = view(0.0);
        let away = View {
            camera_from_world: Rigid3::looking_at(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y),
            ..view(0.0)
        };
        assert_eq!(
            within_sight(flat(), &desired, &[FrameSource::of(&away, &desired)]),
            flat()
        );
        assert_eq!(within_sight(flat(), &desired, &[]), flat());
        let mut none = flat();
        none.facet_of.fill(NO_FACET);
        let source = FrameSource::of(&view(0.5), &desired);
        assert_eq!(within_sight(none.clone(), &desired, &[source]), none);
    }

    proptest! {
        /// Facets that are known to be seen are skipped, and no pixel notices, whatever the lenses.
        #[test]
        fn what_is_known_to_be_seen_is(
            planes in collection::vec((0.05..1.0_f64, array::uniform3(-0.2..0.2)), 30),
            places in collection::vec((array::uniform3(-1.5..1.5), -0.25..0.25_f64), 1..5),
            desired_bends in prop_oneof![Just(0.0), -0.2..0.2_f64],
        ) {
            let bent = |view: View, k1: f64| View {
                lens: Lens::new(view.lens.focal, view.lens.principal, Distortion::Rational {
                    k: [k1, 0.0, 0.0, 0.0, 0.0, 0.0],
                    p: [0.1 * k1, -0.05 * k1],
                }),
                ..view
            };
            let desired = bent(view(0.0), desired_bends);
            let sources: Vec<FrameSource> = places
                .iter()
                .map(|(place, k1)| {
                    let place = DVec3::from_array(*place);
                    let pose = Rigid3::looking_at(place, 3.0 * DVec3::Z, DVec3::Y);
                    let source = View { camera_from_world: pose, ..view(0.0) };
                    FrameSource::of(&bent(source, *k1), &desired)
                })
                .collect();
            let q = |(s, tilt): &(f64, [f64; 3])| (DVec3::Z + DVec3::from_array(*tilt)) * *s;
            // Pieces of 8 × 7 pixels.
            let facet_of: Vec<u32> = (0..1600).map(|i| i % 40 / 8 + i / 40 / 7 * 5).collect();
            let map = FacetMap::of_pixels(planes.iter().map(q).collect(), facet_of, &desired);
            if let Some(rays) = Rays::of(&desired.lens, (40, 40)) {
                let all = super::within_sight(map.clone(), &desired, Some(&rays), &sources);
                let known = Known::of(&map, &rays, &sources);
                let (facets, _) = facets_seen_whole(&map, &rays, &sources, &Known::default());
                let one_by_one = moved(&map, &desired, None, &sources, &Known::default());
                for (y, row) in one_by_one.iter().enumerate() {
                    for at in row {
                        let facet = map.facet_of[y * 40 + at.x] as usize;
                        prop_assert!(!facets[facet], "{} {y} of {facet}", at.x);
                        let tile = y / TILE * known.across + at.x / TILE;
                        prop_assert!(!known.tiles[tile], "{} {y} of tile {tile}", at.x);
                        prop_assert!(!known.facets[facet], "{} {y} of {facet}", at.x);
                    }
                }
                let count: usize = one_by_one.iter().map(Vec::len).sum();
                prop_assert_eq!(all.planes.len() - 30, count);
            }
        }
    }
}
