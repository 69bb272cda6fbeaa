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
        let center = desired.center();
        let rotation = desired.camera_from_world.rotation;
        let plane =
            |i: usize| Self::plane_through(solid.corners(i).map(|p| rotation * (p - center)));
        let triangles = (0..solid.triangle_count()).into_par_iter();
        let planes: Vec<DVec3> = triangles.map(plane).collect();
        if let Some(rays) = rays {
            let mut facet_of =
                PixelNumbers::of_any(desired.width as usize * desired.height as usize);
            solid.triangles_along(desired, rays, &mut facet_of);
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
    use crate::{PhotoStore, SourceView};
    use calibrate::{Distortion, Lens, Rigid3};
    use image::RgbaImage;
    use proptest::collection::vec;
    use proptest::prelude::*;
    use proxy::{Mesh, MeshKind, SparsePoint};
    use std::sync::Arc;

    /// Two photos ahead, and points seen by both, all far to the left of a view between them, at a depth
    /// of 5.
    fn lumigraph(within: Option<Arc<Solid>>) -> Lumigraph {
        let source = |x: f64| SourceView {
            name: format!("{x}"),
            view: ahead(DVec3::X * x, Distortion::None),
            gain: [1.0; 3],
            time_s: None,
            quarters: 0,
        };
        let point = |i: i32| SparsePoint {
            position: DVec3::new(-30.0, 0.2 * f64::from(i), 5.0),
            seen_by: vec![0, 1],
        };
        Lumigraph {
            sources: vec![source(-1.0), source(1.0)],
            photos: PhotoStore::from_images(vec![RgbaImage::new(40, 40); 2]),
            proxy: Proxy::Points { within },
            points: (-20..20).map(point).collect(),
            visibility: None,
        }
    }

    fn ahead(center: DVec3, distortion: Distortion) -> View {
        View {
            lens: Lens::new(DVec2::splat(20.0), DVec2::splat(20.0), distortion),
            width: 40,
            height: 40,
            camera_from_world: Rigid3::looking_at(center, center + DVec3::Z, DVec3::NEG_Y),
        }
    }

    /// Straight rays, bent ones, and some that look back, which are not known beforehand.
    fn blank_views() -> [View; 3] {
        let fisheye = Distortion::Fisheye { k: [0.0; 4] };
        let mut views = [Distortion::None, fisheye, fisheye].map(|d| ahead(DVec3::ZERO, d));
        views[2].lens = Lens::new(DVec2::splat(11.0), DVec2::splat(20.0), fisheye);
        let are_known = views.each_ref().map(|v| rays(v).is_some());
        assert_eq!(are_known, [true, true, false]);
        views
    }

    fn rays(view: &View) -> Option<Rays> {
        Rays::of(&view.lens, (view.width, view.height))
    }

    #[test]
    fn a_view_of_no_points_looks_at_a_plane() {
        let lumigraph = lumigraph(None);
        let [pinhole, ..] = blank_views();
        let surface = Surface::of(&lumigraph, &pinhole, &[]);
        for at in [0.5, 20.0, 39.5] {
            let q = surface.plane_at(Pixel::new(at, at)).unwrap();
            assert!((1.0 / q.z - 5.0).abs() < 0.3, "{at}: {q}");
        }
        // Nobody knows where anything is.
        let nothing = Lumigraph {
            points: Vec::new(),
            ..lumigraph
        };
        assert_eq!(Surface::of(&nothing, &pinhole, &[]), Surface::Nothing);
    }

    #[test]
    fn a_plane_for_want_of_points_stays_within_the_hull() {
        // A box before the plane, one unit to either side of the axis.
        let corner = |i: u32| {
            let pick = |bit: u32, low: f64, high: f64| if i >> bit & 1 == 1 { high } else { low };
            DVec3::new(pick(0, -1.0, 1.0), pick(1, -1.0, 1.0), pick(2, 2.0, 3.0))
        };
        let faces = [
            [0, 2, 3, 1],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 4, 6, 2],
            [1, 3, 7, 5],
        ];
        let triangles = faces.map(|[a, b, c, d]: [u32; 4]| [[a, b, c], [a, c, d]]);
        let mesh = Mesh {
            positions: (0..8).map(corner).collect(),
            triangles: triangles.concat(),
        };
        let hull = Arc::new(Solid::new(MeshKind::Hull, mesh));
        let lumigraph = lumigraph(Some(hull));
        let [pinhole, ..] = blank_views();
        let surface = Surface::of(&lumigraph, &pinhole, &[]);
        let q = surface.plane_at(Pixel::new(20.5, 19.5)).unwrap();
        assert!((1.0 / q.z - 3.0).abs() < 1e-9, "{q}");
        assert_eq!(surface.plane_at(Pixel::new(1.5, 20.5)), None);
        // Of a plane through the box, ray by ray it is the same.
        let q = DVec3::new(0.3, 0.0, 0.35);
        for view in blank_views() {
            let within = lumigraph.proxy.within();
            let map = FacetMap::of_plane(q, &view, rays(&view).as_ref(), within);
            let one_by_one = FacetMap::of_plane(q, &view, None, within);
            let mut seen = 0;
            for i in 0..1600 {
                let ray = view.lens.unproject(Pixel::center_of(i % 40, i / 40));
                let s = [&map, &one_by_one].map(|map| {
                    let plane = map.plane_of(map.facet_of[i as usize])?;
                    Some(plane.dot(ray?))
                });
                match s {
                    [Some(a), Some(b)] => {
                        assert!((a - b).abs() < 1e-9, "{i}: {a} {b}");
                        seen += 1;
                    }
                    other => assert_eq!(other, [None, None], "{i}"),
                }
            }
            assert!((50..800).contains(&seen), "{seen}");
        }
    }

    #[test]
    fn a_plane_is_seen_as_far_as_its_horizon() {
        for view in blank_views() {
            let map = FacetMap::of_plane(DVec3::Y, &view, rays(&view).as_ref(), None);
            let rows = map.facet_of.chunks(40).map(|row| row[20] != NO_FACET);
            assert_eq!(rows.filter(|is_seen| *is_seen).count(), 20);
        }
    }

    proptest! {
        #[test]
        fn packed_planes_are_those_that_are_seen(
            facets in vec(0_u32..6000, 20), spare in 0_usize..6000, [width, height] in [1_u32..30, 1_u32..30],
        ) {
            let planes: Vec<DVec3> = (0..6000 - spare).map(|i| DVec3::splat(i as f64)).collect();
            let seen = |f: &u32| if (*f as usize) < planes.len() { *f } else { NO_FACET };
            // Some tiles see one, others several.
            let facet = |i: u32| facets[(i % width / 5 + i / width / 7 * 3) as usize % facets.len()];
            let facet_of: Vec<u32> = (0..width * height).map(|i| seen(&facet(i))).collect();
            let desired = View {
                lens: Lens::pinhole(DVec2::ONE, DVec2::ONE),
                width,
                height,
                camera_from_world: Rigid3::IDENTITY,
            };
            let map = FacetMap::of_pixels(planes, facet_of, &desired);
            let Packed { planes, numbers } = map.packed(true);
            for (i, facet) in map.facet_of.iter().enumerate() {
                let (x, y) = (i % width as usize, i / width as usize);
                let of_tile = numbers[y / TILE * (width as usize).div_ceil(TILE) + x / TILE] as usize;
                let number = match of_tile % 2 {
                    0 => of_tile / 2,
                    _ => numbers[of_tile / 2 + y % TILE * TILE + x % TILE] as usize,
                };
                let plane = number.checked_sub(1).map(|at| planes[at]);
                prop_assert_eq!(plane, map.plane_of(*facet));
            }
            prop_assert!(planes.len() <= 4096);
            let one_by_one = map.packed(false);
            for (number, facet) in one_by_one.numbers.iter().zip(map.facet_of.iter()) {
                let plane = number.checked_sub(1).map(|at| one_by_one.planes[at as usize]);
                prop_assert_eq!(plane, map.plane_of(*facet));
            }
        }
    }
}
