//! The proxy as one desired view sees it.

use crate::frame::FrameSource;
use crate::lumigraph::Lumigraph;
use crate::sight::{Seers, within_sight};
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

/// Calls `each(pixels, facet)` for the runs of pixels of a row that see one facet.
pub(crate) fn each_run(row: &[u32], mut each: impl FnMut(Range<usize>, u32)) {
    let Some(mut facet) = row.first().copied() else {
        return;
    };
    let mut start = 0;
    for (i, pixels) in row.chunks(BLOCK).enumerate() {
        let goes_on = |same, other: &u32| same & (*other == facet);
        if pixels.iter().fold(true, goes_on) {
            continue;
        }
        for (x, &other) in (i * BLOCK..).zip(pixels) {
            if other != facet {
                each(start..x, facet);
                (start, facet) = (x, other);
            }
        }
    }
    each(start..row.len(), facet);
}

/// Pixels that are compared together.
const BLOCK: usize = 32;

/// No facet.
pub const NO_FACET: u32 = Scan::NOTHING;

/// Flat facets and which of them each pixel sees.
#[derive(Clone, Debug, PartialEq)]
pub struct FacetMap {
    /// The facets' vectors q, in the desired camera's frame.
    pub planes: Vec<DVec3>,
    /// Row by row, the facet at each pixel's centre; [`NO_FACET`] where the lens has no ray.
    pub facet_of: Vec<u32>,
    pub(crate) size: [u32; 2],
    /// From this facet on they are pixels' own, moved to where a photo has them.
    pub(crate) moved_from: u32,
    /// Which photos have what was moved.
    pub(crate) seers: Seers,
}

impl Surface {
    /// The surface of a lumigraph's proxy from a desired view.
    pub(crate) fn of(lumigraph: &Lumigraph, desired: &View, sources: &[FrameSource]) -> Self {
        let views = || -> Vec<View> { lumigraph.sources.iter().map(|s| s.view.clone()).collect() };
        let of_plane = |plane: Plane| {
            let q = plane.inverse_distance_from(desired.center());
            q.map_or(Self::Nothing, |q| {
                Self::Plane(desired.camera_from_world.rotation * q)
            })
        };
        let rays = || Rays::of(&desired.lens, (desired.width, desired.height));
        match &lumigraph.proxy {
            Proxy::Plane(plane) => of_plane(*plane),
            Proxy::ViewPlane => {
                let plane = fit_plane_for_view(desired, &views(), &lumigraph.points);
                plane.map_or(Self::Nothing, of_plane)
            }
            proxy @ (Proxy::Points { .. } | Proxy::Dense(_)) => {
                let facets = points::facets(desired, &views(), &lumigraph.points);
                facets.map_or(Self::Nothing, |facets| {
                    let rays = rays();
                    let map = FacetMap::of_facets(facets, desired, rays.as_ref(), proxy.within());
                    Self::Facets(within_sight(map, desired, rays.as_ref(), sources))
                })
            }
            Proxy::Mesh(solid) => {
                let rays = rays();
                let map = FacetMap::of_mesh(solid, desired, rays.as_ref());
                Self::Facets(within_sight(map, desired, rays.as_ref(), sources))
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

    /// q at the centres of all pixels of a rectangle, where it is one.
    #[inline]
    pub(crate) fn plane_of_all(&self, columns: Range<usize>, rows: Range<usize>) -> Option<DVec3> {
        match self {
            Self::Nothing => None,
            Self::Plane(q) => Some(*q),
            Self::Facets(map) => {
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

    fn is_moved(&self, facet: u32) -> bool {
        facet != NO_FACET && facet >= self.moved_from
    }

    /// Whether any pixel of a rectangle sees a facet.
    pub(crate) fn any_within(&self, least: DVec2, most: DVec2) -> bool {
        let [width, height] = self.size;
        let (x0, y0) = (least.x.max(0.0) as usize, least.y.max(0.0) as usize);
        let beyond = |at: f64, side: u32| at.ceil().clamp(0.0, f64::from(side)) as usize;
        let (x1, y1) = (beyond(most.x, width), beyond(most.y, height));
        (y0..y1).any(|y| {
            let row = y * width as usize;
            let pixels = self.facet_of.get(row + x0..row + x1);
            pixels.is_some_and(|pixels| pixels.iter().any(|&facet| facet != NO_FACET))
        })
    }

    /// The centre of the pixel nearest to a position, within so many columns and rows, that sees a
    /// facet.
    pub(crate) fn nearest(&self, pixel: Pixel, within: i64) -> Option<Pixel> {
        let [width, height] = self.size.map(i64::from);
        let (x, y) = (pixel.x.floor() as i64, pixel.y.floor() as i64);
        let center = |x: i64, y: i64| Pixel::center_of(x as u32, y as u32);
        let far = |p: &Pixel| (p.x - pixel.x).powi(2) + (p.y - pixel.y).powi(2);
        // Ring by ring. One may hold what is nearer than the first found, but hardly.
        (0..=within).find_map(|r| {
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

    /// The vectors q of facets, and the facet at each pixel's centre; of many facets only those that are seen, by
    /// other numbers, in the order of the pixels.
    pub(crate) fn few_planes(&self) -> (Cow<'_, [DVec3]>, Cow<'_, [u32]>) {
        /// So many cost nothing.
        const FEW: usize = 4096;
        if self.planes.len() <= FEW {
            return (
                self.planes.as_slice().into(),
                self.facet_of.as_slice().into(),
            );
        }
        let mut seen = Vec::new();
        let mut number_of = vec![NO_FACET; self.planes.len()];
        let renumber = |&facet: &u32| {
            if facet == NO_FACET {
                return NO_FACET;
            }
            let number = &mut number_of[facet as usize];
            if *number == NO_FACET {
                *number = seen.len() as u32;
                seen.push(self.planes[facet as usize]);
            }
            *number
        };
        let facet_of: Vec<u32> = self.facet_of.iter().map(renumber).collect();
        (seen.into(), facet_of.into())
    }

    fn plane_of(&self, facet: u32) -> Option<DVec3> {
        (facet != NO_FACET).then(|| self.planes[facet as usize])
    }

    /// Facets, and which of them each pixel's centre sees, row by row; [`NO_FACET`] for none.
    pub(crate) fn of_pixels(planes: Vec<DVec3>, facet_of: Vec<u32>, desired: &View) -> Self {
        Self {
            moved_from: planes.len() as u32,
            planes,
            facet_of,
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
        let Some(hull) = within else {
            return map;
        };
        let world_from_camera = desired.camera_from_world.rotation.conjugate();
        let keep = |i: usize| {
            let (x, y) = (i as u32 % desired.width, i as u32 / desired.width);
            let ray = desired.lens.unproject(Pixel::center_of(x, y));
            let seen = ray.zip(map.plane_of(map.facet_of[i]));
            seen.map_or(Kept::Nowhere, |(ray, plane)| {
                let along = plane.dot(ray).recip();
                hull.keep_on_ray(desired.center(), world_from_camera * ray, along)
            })
        };
        let pixels = (0..map.facet_of.len()).into_par_iter();
        let kept: Vec<Kept> = pixels.map(keep).collect();
        map.kept(&kept, hull, desired)
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

    fn of_mesh(solid: &Solid, desired: &View, rays: Option<&Rays>) -> Self {
        let center = desired.center();
        let rotation = desired.camera_from_world.rotation;
        let plane =
            |i: usize| Self::plane_through(solid.corners(i).map(|p| rotation * (p - center)));
        let triangles = (0..solid.triangle_count()).into_par_iter();
        let planes: Vec<DVec3> = triangles.map(plane).collect();
        if let Some(rays) = rays {
            let facet_of = solid.triangles_along(desired, rays);
            return Self::of_pixels(planes, facet_of, desired);
        }
        let world_from_camera = rotation.conjugate();
        let facet_of = Self::found(desired, |ray, _| {
            let hit = solid.first_hit(center, world_from_camera * ray);
            hit.map_or(NO_FACET, |hit| hit.triangle_idx)
        });
        Self::of_pixels(planes, facet_of, desired)
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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::collection::vec;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn runs_are_what_neighbours_share(lengths in vec((0_u32..4, 1_usize..90), 0..12)) {
            let row: Vec<u32> = lengths.iter().flat_map(|(f, n)| vec![*f; *n]).collect();
            let mut found = Vec::new();
            each_run(&row, |pixels, facet| found.push((pixels, facet)));
            let mut next = 0;
            let expected = row.chunk_by(|a, b| a == b).map(|run| {
                next += run.len();
                (next - run.len()..next, run[0])
            });
            prop_assert!(found.iter().cloned().eq(expected));
        }

        #[test]
        fn few_planes_are_those_that_are_seen(facets in vec(0_u32..6000, 20..=20), spare in 0_usize..6000) {
            let planes: Vec<DVec3> = (0..6000 - spare).map(|i| DVec3::splat(i as f64)).collect();
            let seen = |f: &u32| if (*f as usize) < planes.len() { *f } else { NO_FACET };
            let map = FacetMap {
                moved_from: planes.len() as u32,
                facet_of: facets.iter().map(seen).collect(),
                planes,
                seers: Seers::default(),
                size: [5, 4],
            };
            let (few, facet_of) = map.few_planes();
            let of = |facet: &u32| few.get(*facet as usize).copied();
            prop_assert!(facet_of.iter().map(of).eq(map.facet_of.iter().map(|f| map.plane_of(*f))));
            prop_assert!(few.len() <= 4096);
        }
    }
}
