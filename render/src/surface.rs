//! The proxy as one desired view sees it.

use crate::frame::FrameSource;
use crate::lumigraph::Lumigraph;
use crate::sight::{Seers, Views, out_of_hiding, within_sight};
use crate::spare::PixelNumbers;
use crate::tiles::{FacetTiles, TILE};
use calibrate::{Pixel, View};
use glam::{DVec2, DVec3};
use proxy::{Facets, Kept, Plane, Proxy, Rays, Scan, Solid, fit_plane_for_view, points};
use rayon::prelude::*;
use std::borrow::Cow;
use std::cell::OnceCell;
use std::ops::Range;

/// What each pixel of the desired view looks at: a plane, by its vector q (a ray v meets
/// it at v / s with s = q · v), in the desired camera's frame.
#[derive(Clone, Debug, PartialEq)]
pub enum Surface {
    /// Nothing: a plane seen edge on, say.
    Nothing,
    /// One plane all over.
    Plane(DVec3),
    /// A facet of many.
    Facets(FacetMap),
}

/// No facet.
pub const NO_FACET: u32 = Scan::NOTHING;

/// Flat facets and which of them each pixel sees.
#[derive(Clone, Debug, PartialEq)]
pub struct FacetMap {
    /// The facets' vectors q, in the desired camera's frame.
    pub planes: Vec<DVec3>,
    /// Row by row, the facet at each pixel's centre; [`NO_FACET`] where the lens has no ray.
    pub facet_of: PixelNumbers,
    pub(crate) size: [u32; 2],
    pub(crate) tiles: FacetTiles,
    /// From this facet on they are pixels' own, moved to where a photo has or shows them.
    pub(crate) moved_from: u32,
    /// By how much each of those is a guess, in pixels: how far apart the photo that it was moved to has it from where it was.
    pub(crate) shifts_px: Vec<f32>,
    /// Which photos have what was moved.
    pub(crate) seers: Seers,
}

/// Which of some planes each pixel sees, in few numbers where facets are large.
pub(crate) struct Packed<'a> {
    /// The vectors q of facets; of many only those that are seen, in another order.
    pub planes: Cow<'a, [DVec3]>,
    /// For each pixel, row by row, the number of its plane, which is one more than its place, zero where it sees none.
    /// By tiles: first one for each tile, row by row: twice the number of the plane that all of its pixels see. Where they differ, it is one more than twice the place
    /// at which their numbers begin, row by row, as if all tiles were whole.
    pub numbers: Vec<u32>,
}

impl Surface {
    /// The surface of a lumigraph's proxy from a desired view.
    pub(crate) fn of(lumigraph: &Lumigraph, desired: &View, sources: &[FrameSource]) -> Self {
        let views = || -> Vec<View> { lumigraph.sources.iter().map(|s| s.view.clone()).collect() };
        let seen = |plane: Plane| {
            let q = plane.inverse_distance_from(desired.center());
            q.map(|q| desired.camera_from_world.rotation * q)
        };
        let of_plane = |plane: Plane| seen(plane).map_or(Self::Nothing, Self::Plane);
        let rays = || Rays::of(&desired.lens, (desired.width, desired.height));
        match &lumigraph.proxy {
            Proxy::Plane(plane) => of_plane(*plane),
            Proxy::ViewPlane => {
                let (views, sparse) = (views(), &lumigraph.points);
                let plane = match sparse.is_empty() {
                    // Nobody observes any: what the photos look at.
                    true => points::plane_without_facets(desired, &views, sparse),
                    false => fit_plane_for_view(desired, &views, sparse),
                };
                plane.map_or(Self::Nothing, of_plane)
            }
            proxy @ (Proxy::Points { .. } | Proxy::Dense(_)) => {
                let (views, rays) = (views(), rays());
                let rays = rays.as_ref();
                let map = match points::facets(desired, &views, &lumigraph.points) {
                    Some(facets) => {
                        let map = FacetMap::of_facets(facets, desired, rays, proxy.within());
                        Some(map)
                    }
                    // Too few points are in sight, but photos may show all of it.
                    None => points::plane_without_facets(desired, &views, &lumigraph.points)
                        .and_then(seen)
                        .map(|q| FacetMap::of_plane(q, desired, rays, proxy.within())),
                };
                map.map_or(Self::Nothing, |map| {
                    Self::Facets(within_sight(map, desired, rays, &Views::new(sources)))
                })
            }
            Proxy::Mesh(solid) => {
                let (rays, views) = (rays(), Views::new(sources));
                let map = FacetMap::of_mesh(solid, desired, rays.as_ref());
                let map = within_sight(map, desired, rays.as_ref(), &views);
                Self::Facets(match &lumigraph.visibility {
                    None => map,
                    Some(seen) => {
                        let photos = &lumigraph.photos;
                        out_of_hiding(map, desired, rays.as_ref(), &views, seen, photos)
                    }
                })
            }
        }
    }

    /// Whether the pixel around a position looks at something that was moved to where a photo
    /// has it; see `sight.rs`.
    pub(crate) fn is_moved_at(&self, pixel: Pixel) -> bool {
        match self {
            Self::Facets(map) => map.is_moved(map.facet_at(pixel)),
            Self::Nothing | Self::Plane(_) => false,
        }
    }

    /// q at a position in the desired image, of the pixel around it.
    pub fn plane_at(&self, pixel: Pixel) -> Option<DVec3> {
        match self {
            Self::Nothing => None,
            Self::Plane(q) => Some(*q),
            Self::Facets(map) => map.plane_of(map.facet_at(pixel)),
        }
    }

    /// q at the centres of all pixels of a rectangle within a tile, where it is one.
    #[inline]
    pub(crate) fn plane_of_all(&self, columns: Range<usize>, rows: Range<usize>) -> Option<DVec3> {
        match self {
            Self::Nothing => None,
            Self::Plane(q) => Some(*q),
            Self::Facets(map) => {
                if let Some(facet) = map.tiles.at(columns.start, rows.start) {
                    return map.plane_of(facet);
                }
                let width = map.size[0] as usize;
                let first = map.facet_of[rows.start * width + columns.start];
                let is_one = |row: usize| {
                    let row = &map.facet_of[row * width..][columns.clone()];
                    row.iter()
                        .fold(true, |is_one, &facet| is_one & (facet == first))
                };
                rows.into_iter().all(is_one).then(|| map.plane_of(first))?
            }
        }
    }

    /// q at the centre of a pixel.
    #[inline]
    pub(crate) fn plane_of(&self, column: usize, row: usize) -> Option<DVec3> {
        match self {
            Self::Nothing => None,
            Self::Plane(q) => Some(*q),
            Self::Facets(map) => map.plane_of(map.facet_of[row * map.size[0] as usize + column]),
        }
    }
}

impl FacetMap {
    /// For every pixel, row by row, whether it looks at something that was moved along its
    /// ray to where a photo has it: there the proxy is a guess.
    pub fn moved(&self) -> impl Iterator<Item = bool> {
        self.facet_of.iter().map(|&facet| self.is_moved(facet))
    }

    /// Whether any pixel looks at something that was moved.
    pub(crate) fn any_is_moved(&self) -> bool {
        (self.moved_from as usize) < self.planes.len()
    }

    pub(crate) fn is_moved(&self, facet: u32) -> bool {
        facet != NO_FACET && facet >= self.moved_from
    }

    /// By how many pixels a facet is a guess; by none where it was not moved.
    pub(crate) fn shift_px(&self, facet: u32) -> f32 {
        let moved = facet.wrapping_sub(self.moved_from) as usize;
        self.shifts_px.get(moved).copied().unwrap_or(0.0)
    }

    /// Whether any pixel of a rectangle sees a facet.
    pub(crate) fn any_within(&self, least: DVec2, most: DVec2) -> bool {
        let size = self.size.map(|side| side as usize);
        self.tiles.any_within(&self.facet_of, size, least, most)
    }

    /// The centre of the pixel nearest to a position, within so many columns and rows, that sees a
    /// facet.
    pub(crate) fn nearest(&self, pixel: Pixel, within: i64) -> Option<Pixel> {
        let [width, height] = self.size.map(i64::from);
        let (x, y) = (pixel.x.floor() as i64, pixel.y.floor() as i64);
        let least = self.tiles.least_ring([x, y], within)?;
        let center = |x: i64, y: i64| Pixel::center_of(x as u32, y as u32);
        let far = |p: &Pixel| (p.x - pixel.x).powi(2) + (p.y - pixel.y).powi(2);
        // Ring by ring. One may hold what is nearer than the first found, but hardly.
        (least..=within).find_map(|r| {
            let ring = (-r..=r).flat_map(|i| [(i, -r), (i, r), (-r, i), (r, i)]);
            let inside = ring
                .map(|(dx, dy)| (x + dx, y + dy))
                .filter(|(x, y)| (0..width).contains(x) && (0..height).contains(y));
            let seen = inside.filter(|(x, y)| self.facet_of[(y * width + x) as usize] != NO_FACET);
            seen.map(|(x, y)| center(x, y))
                .min_by(|a, b| far(a).total_cmp(&far(b)))
        })
    }

    /// The facet at the pixel around a position.
    pub(crate) fn facet_at(&self, pixel: Pixel) -> u32 {
        let [width, height] = self.size;
        let column = pixel.x.clamp(0.0, f64::from(width - 1)) as usize;
        let row = pixel.y.clamp(0.0, f64::from(height - 1)) as usize;
        self.facet_of[row * width as usize + column]
    }

    /// The same, as a device looks it up: by tiles or for each pixel.
    pub(crate) fn packed(&self, by_tiles: bool) -> Packed<'_> {
        /// So many cost nothing.
        const FEW: usize = 4096;
        let is_few = self.planes.len() <= FEW;
        let mut seen = Vec::new();
        let mut numbered = vec![0; if is_few { 0 } else { self.planes.len() }];
        let mut number = |facet: u32| {
            if is_few || facet == NO_FACET {
                return facet.wrapping_add(1);
            }
            let number = &mut numbered[facet as usize];
            if *number == 0 {
                seen.push(self.planes[facet as usize]);
                *number = seen.len() as u32;
            }
            *number
        };
        let numbers = match by_tiles {
            true => self.numbers_by_tiles(number),
            false => self.facet_of.iter().map(|facet| number(*facet)).collect(),
        };
        Packed {
            planes: if is_few {
                self.planes.as_slice().into()
            } else {
                seen.into()
            },
            numbers,
        }
    }

    /// See [`Packed::numbers`]; `number` is that of a facet's plane.
    fn numbers_by_tiles(&self, mut number: impl FnMut(u32) -> u32) -> Vec<u32> {
        let [width, height] = self.size.map(|side| side as usize);
        let mut numbers = vec![0; self.tiles.iter().count()];
        for (i, ([column, row], facet)) in self.tiles.iter().enumerate() {
            if let Some(facet) = facet {
                numbers[i] = 2 * number(facet);
                continue;
            }
            let start = numbers.len();
            numbers[i] = 2 * start as u32 + 1;
            numbers.resize(start + TILE * TILE, 0);
            let rows = numbers[start..].chunks_exact_mut(TILE);
            for (y, numbers) in (row..height).zip(rows) {
                let facets = &self.facet_of[y * width..(y + 1) * width][column..];
                numbers
                    .iter_mut()
                    .zip(facets)
                    .for_each(|(n, facet)| *n = number(*facet));
            }
        }
        numbers
    }

    pub(crate) fn plane_of(&self, facet: u32) -> Option<DVec3> {
        (facet != NO_FACET).then(|| self.planes[facet as usize])
    }

    /// Facets, and which of them each pixel's centre sees, row by row; [`NO_FACET`] for none.
    pub(crate) fn of_pixels(
        planes: Vec<DVec3>,
        facet_of: impl Into<PixelNumbers>,
        desired: &View,
    ) -> Self {
        let facet_of = facet_of.into();
        Self {
            moved_from: planes.len() as u32,
            tiles: FacetTiles::of(&facet_of, desired.width as usize),
            planes,
            facet_of,
            shifts_px: Vec::new(),
            seers: Seers::default(),
            size: [desired.width, desired.height],
        }
    }

    /// The plane of a triangle whose corners are relative to the desired centre, in its camera's
    /// frame.
    pub(crate) fn plane_through([a, b, c]: [DVec3; 3]) -> DVec3 {
        let normal = (b - a).cross(c - a);
        let q = normal / normal.dot(a);
        // Seen edge on, it is seen nowhere.
        if q.is_finite() { q } else { DVec3::ZERO }
    }

    fn of_facets(
        facets: Facets,
        desired: &View,
        rays: Option<&Rays>,
        within: Option<&Solid>,
    ) -> Self {
        if let Some(rays) = rays {
            let mut scan = facets.scan(rays);
            Self::fill(&facets, &mut scan, desired);
            let map = Self::of_pixels(facets.planes, scan.triangle_of, desired);
            return match within {
                None => map,
                Some(hull) => {
                    let kept = hull.keep(desired, rays, &scan.inverse_depth);
                    map.kept(&kept, hull, desired)
                }
            };
        }
        let neighbours = facets.neighbours();
        let facet_of = Self::found(desired, |ray, last| {
            let start = if last == NO_FACET { 0 } else { last };
            facets.locate(&neighbours, ray, start)
        });
        let map = Self::of_pixels(facets.planes, facet_of, desired);
        match within {
            None => map,
            Some(hull) => map.kept_along_rays(hull, desired),
        }
    }

    /// One plane all over, or as far as its horizon; kept within a hull, all of which is before what lies
    /// beyond that.
    fn of_plane(q: DVec3, desired: &View, rays: Option<&Rays>, within: Option<&Solid>) -> Self {
        let facet_of = Self::found(desired, |ray, _| {
            let is_seen = within.is_some() || q.dot(ray) > 0.0;
            if is_seen { 0 } else { NO_FACET }
        });
        let map = Self::of_pixels(vec![q], facet_of, desired);
        match (within, rays) {
            (None, _) => map,
            (Some(hull), None) => map.kept_along_rays(hull, desired),
            (Some(hull), Some(rays)) => {
                let width = desired.width as usize;
                let inverse_depth = (0..map.facet_of.len()).map(|i| {
                    let at = rays.at(i % width, i / width);
                    at.map_or(0.0, |at| q.dot(at.extend(1.0)))
                });
                let inverse_depth: Vec<f64> = inverse_depth.collect();
                let kept = hull.keep(desired, rays, &inverse_depth);
                map.kept(&kept, hull, desired)
            }
        }
    }

    /// What pixels see, kept within a hull, ray by ray.
    fn kept_along_rays(self, hull: &Solid, desired: &View) -> Self {
        let world_from_camera = desired.camera_from_world.rotation.conjugate();
        let keep = |i: usize| {
            let (x, y) = (i as u32 % desired.width, i as u32 / desired.width);
            let ray = desired.lens.unproject(Pixel::center_of(x, y));
            let seen = ray.zip(self.plane_of(self.facet_of[i]));
            seen.map_or(Kept::Nowhere, |(ray, plane)| {
                let along = plane.dot(ray).recip();
                hull.keep_on_ray(desired.center(), world_from_camera * ray, along)
            })
        };
        let pixels = (0..self.facet_of.len()).into_par_iter();
        let kept: Vec<Kept> = pixels.map(keep).collect();
        self.kept(&kept, hull, desired)
    }

    /// What pixels see, kept within a hull as was found.
    fn kept(mut self, kept: &[Kept], hull: &Solid, desired: &View) -> Self {
        let center = desired.center();
        let rotation = desired.camera_from_world.rotation;
        // The facets of the hull's triangles that are seen.
        let mut facet_of = vec![NO_FACET; hull.mesh().triangles.len()];
        for (facet, kept) in self.facet_of.iter_mut().zip(kept) {
            match *kept {
                Kept::AsItIs => {}
                Kept::Nowhere => *facet = NO_FACET,
                Kept::On { triangle_idx, .. } => {
                    let own = &mut facet_of[triangle_idx as usize];
                    if *own == NO_FACET {
                        *own = self.planes.len() as u32;
                        let corners = hull.mesh().corners(triangle_idx as usize);
                        let corners = corners.map(|p| rotation * (p - center));
                        self.planes.push(Self::plane_through(corners));
                    }
                    *facet = *own;
                }
            }
        }
        Self::of_pixels(self.planes, self.facet_of, desired)
    }

    /// Facets tile all directions: a pixel without one lies where rounding has turned one over.
    fn fill(facets: &Facets, scan: &mut Scan, desired: &View) {
        let neighbours = OnceCell::new();
        for (i, facet) in scan.triangle_of.iter_mut().enumerate() {
            if *facet != NO_FACET {
                continue;
            }
            let center = Pixel::center_of((i % scan.width) as u32, (i / scan.width) as u32);
            if let Some(ray) = desired.lens.unproject(center) {
                let neighbours = neighbours.get_or_init(|| facets.neighbours());
                *facet = facets.locate(neighbours, ray, 0);
                if let Some(plane) = facets.planes.get(*facet as usize) {
                    scan.inverse_depth[i] = plane.dot(ray) / ray.z;
                }
            }
        }
    }

    pub(crate) fn of_mesh(solid: &Solid, desired: &View, rays: Option<&Rays>) -> Self {
        // 1. The triangle at each pixel's centre.
        let mut facet_of = match rays {
            Some(rays) => {
                let pixels = desired.width as usize * desired.height as usize;
                let mut triangle_of = PixelNumbers::of_any(pixels);
                solid.triangles_along(desired, rays, &mut triangle_of);
                triangle_of
            }
            None => {
                let world_from_camera = desired.camera_from_world.rotation.conjugate();
                let found = Self::found(desired, |ray, _| {
                    let hit = solid.first_hit(desired.center(), world_from_camera * ray);
                    hit.map_or(NO_FACET, |hit| hit.triangle_idx)
                });
                found.into()
            }
        };
        // 2. Those that are seen, which of a fine mesh are few, are the facets.
        let seen = numbered(&mut facet_of, solid.triangle_count());
        let plane = |i: &u32| Self::plane_of_triangle(solid, *i, desired);
        let planes = seen.par_iter().with_min_len(256).map(plane).collect();
        Self::of_pixels(planes, facet_of, desired)
    }

    /// The plane of a mesh's triangle, in the desired camera's frame.
    pub(crate) fn plane_of_triangle(solid: &Solid, triangle_idx: u32, desired: &View) -> DVec3 {
        let (center, rotation) = (desired.center(), desired.camera_from_world.rotation);
        let corners = solid.corners(triangle_idx as usize);
        Self::plane_through(corners.map(|p| rotation * (p - center)))
    }

    /// The facet at each pixel's centre, row by row: `find` says which a ray meets, given what its
    /// left neighbour's did.
    fn found(desired: &View, find: impl Fn(DVec3, u32) -> u32 + Sync) -> Vec<u32> {
        let (width, height) = (desired.width as usize, desired.height as usize);
        let row = |y: usize| {
            let mut last = NO_FACET;
            (0..width)
                .map(|x| {
                    let center = Pixel::center_of(x as u32, y as u32);
                    let Some(ray) = desired.lens.unproject(center) else {
                        return NO_FACET;
                    };
                    last = find(ray, last);
                    last
                })
                .collect::<Vec<u32>>()
        };
        let rows: Vec<Vec<u32>> = (0..height).into_par_iter().map(row).collect();
        rows.concat()
    }
}

/// Numbers what pixels see, of so many things, as they first come, row by row, and says which each number stands for.
fn numbered(seen: &mut [u32], count: usize) -> Vec<u32> {
    let mut things = Vec::new();
    // One more than each thing's number; zero where it has none yet.
    let mut numbers = vec![0_u32; count];
    // Neighbours mostly see the same.
    let mut last = (NO_FACET, NO_FACET);
    for own in seen {
        if *own != last.0 {
            let number = match *own {
                NO_FACET => NO_FACET,
                thing => {
                    let number = &mut numbers[thing as usize];
                    if *number == 0 {
                        things.push(thing);
                        *number = things.len() as u32;
                    }
                    *number - 1
                }
            };
            last = (*own, number);
        }
        *own = last.1;
    }
    things
}

#[cfg(test)]
mod tests;
