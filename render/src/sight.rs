//! The proxy moved to where photos can see it.

use crate::frame::FrameSource;
use crate::surface::{FacetMap, NO_FACET};
use calibrate::{Distortion, Pixel, View};
use glam::{DVec2, DVec3};
use rayon::prelude::*;

/// The factor between inverse distances that are tried, and how many on either side.
const STEP: f64 = 1.15;
const STEPS: i32 = 24;
/// More than rounding makes of a position in a photo.
const MARGIN_PX: f64 = 1e-3;
/// Halvings of a step in the end.
const HALVINGS: u32 = 6;

/// Whether the point at ray / s lies in a source view's image.
fn sees(source: &FrameSource, ray: DVec3, s: f64) -> bool {
    if !source.takes_part() {
        return false;
    }
    let pixel = source
        .lens
        .project(source.rotation * ray + source.translation * s);
    let [width, height] = source.size;
    pixel.is_some_and(|p| p.x >= 0.0 && p.y >= 0.0 && p.x <= width && p.y <= height)
}

/// Pixels along a side of a tile.
const TILE: usize = 8;

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
/// which one has.
///
/// Where no photo shows the proxy, its depth is a guess anyway: beside the points that it is
/// made of, or on a dome. A guess that photos can answer paints what they show there, and
/// not nothing. (Of house-walk's held-out pixels that are 2 to 4 %, black before.)
///
/// What pixels of a row see of one facet lies on a line, in a photo, too, as long as neither lens
/// bends. So where a photo has both ends of it well inside it has all of it.
pub(crate) fn within_sight(mut map: FacetMap, desired: &View, sources: &[FrameSource]) -> FacetMap {
    let [width, height] = map.size.map(|side| side as usize);
    let is_straight = desired.lens.distortion() == Distortion::None;
    let moved_in_row = |y: usize| {
        let facets = &map.facet_of[y * width..(y + 1) * width];
        // The pixel's ray and the inverse distance of what it sees.
        let looks = |x: usize| {
            let center = Pixel::center_of(x as u32, y as u32);
            let ray = desired.lens.unproject(center)?;
            Some((ray, map.planes[facets[x] as usize].dot(ray)))
        };
        // The view that saw the last pixel mostly sees the next.
        let mut last = 0;
        let mut moved = Vec::new();
        let mut next = 0;
        for run in facets.chunk_by(|a, b| a == b) {
            let pixels = next..next + run.len();
            next = pixels.end;
            if run[0] == NO_FACET {
                continue;
            }
            if is_straight && let Some(source) = sources.get(last) {
                let ends = [pixels.start, pixels.end - 1].map(looks);
                let is_inside = |end: Option<(DVec3, f64)>| {
                    end.is_some_and(|(ray, s)| s >= 0.0 && has_well_inside(source, ray, s))
                };
                if ends.into_iter().all(is_inside) {
                    continue;
                }
            }
            for x in pixels {
                let Some((ray, s)) = looks(x) else { continue };
                let mut seen = |s: f64| {
                    let hint = sources.get(last).filter(|source| sees(source, ray, s));
                    let found = match hint {
                        Some(_) => Some(last),
                        None => sources.iter().position(|source| sees(source, ray, s)),
                    };
                    last = found.unwrap_or(last);
                    found.is_some()
                };
                if !(s >= 0.0) || seen(s) {
                    continue;
                }
                if let Some(s) = nearest_seen(s, &mut seen) {
                    // The last that was found to see anything sees that.
                    moved.push((x, ray * (s / ray.length_squared()), last as u32));
                }
            }
        }
        moved
    };
    let moved: Vec<Vec<(usize, DVec3, u32)>> =
        (0..height).into_par_iter().map(moved_in_row).collect();
    if moved.iter().any(|row| !row.is_empty()) {
        map.seers = Seers::new([width, height]);
    }
    for (y, row) in moved.into_iter().enumerate() {
        for (x, plane, source_idx) in row {
            map.seers.note((x, y), source_idx);
            map.facet_of[y * width + x] = map.planes.len() as u32;
            map.planes.push(plane);
        }
    }
    map
}

/// Whether the point at ray / s lies inside a source view's image, beyond doubt of rounding, and
/// its lens does not bend.
fn has_well_inside(source: &FrameSource, ray: DVec3, s: f64) -> bool {
    if !source.takes_part() || source.lens.distortion() != Distortion::None {
        return false;
    }
    let point = source.rotation * ray + source.translation * s;
    let [width, height] = source.size;
    source.lens.project(point).is_some_and(|p| {
        let inside = p.x.min(width - p.x).min(p.y).min(height - p.y);
        inside >= MARGIN_PX
    })
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
    use super::*;
    use calibrate::{Lens, Rigid3};

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

    /// Every pixel sees the plane at a depth of 2.
    fn flat() -> FacetMap {
        FacetMap {
            planes: vec![DVec3::Z / 2.0],
            facet_of: vec![0; 1600],
            size: [40, 40],
            moved_from: 1,
            seers: Seers::default(),
        }
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
}
