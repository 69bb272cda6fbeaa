//! Several samples of a pixel where the surface jumps: outlines without stairs.
//!
//! A pixel whose middle falls on one side of an outline shows that side alone. Where a mesh jumps between a pixel and
//! one beside it, and the two do not look alike, both are the mean of samples of the exact field: nearly all of what a
//! picture of four times the pixels gains, for a fraction of its cost. All other pixels stay as they are.

use crate::frame::{Frame, FrameSource, ProxyPoint};
use crate::photos::PhotoError;
use crate::rays::ray_of;
use crate::sight::{Between, Seen, Views};
use crate::surface::{FacetMap, NO_FACET, Surface};
use crate::tiles::TILE;
use crate::visibility::TOLERANCE;
use calibrate::Pixel;
use glam::DVec3;
use image::RgbaImage;
use proxy::{Hit, Proxy, RAYS_TOGETHER, Solid};
use rayon::prelude::*;

/// How many samples of a pixel, across and down, do for most: with 3 and 4 held-out photos of temple-ring gain 0.07 and
/// 0.10 dB more, those of fern 0.02.
pub const EDGE_SAMPLES: u32 = 2;

/// Where neighbours differ by no more than so many steps of 255, in each channel, stairs are not seen.
const ALIKE: i32 = 20;

/// Samples that are drawn together, about.
const TOGETHER: usize = 512;

/// The pixels of a frame at which its surface jumps, to be looked at more closely.
pub(crate) struct Edges<'f> {
    frame: &'f Frame<'f>,
    map: &'f FacetMap,
    solid: &'f Solid,
    /// Where something can hide what they look at.
    between: Option<Between<'f>>,
    /// Their places in the picture, tile by tile, as the same source views matter to those that are near one another.
    pixels: Vec<usize>,
    /// Samples of each, across and down.
    across: usize,
}

impl<'f> Edges<'f> {
    /// Of a frame that was drawn as `picture`; `None` where there are none, where its proxy is no mesh, which alone can hide
    /// a part of itself, and where a photo was taken from: its pixels are what there is to see.
    /// `views` are the frame's.
    pub(crate) fn of(
        frame: &'f Frame<'f>,
        views: &'f Views<'f>,
        picture: &RgbaImage,
        across: u32,
    ) -> Option<Self> {
        let (Proxy::Mesh(solid), Surface::Facets(map)) = (&frame.lumigraph.proxy, &frame.surface)
        else {
            return None;
        };
        let is_of_viewer = |s: &FrameSource| s.takes_part() && s.center == DVec3::ZERO;
        if across < 2 || frame.sources.iter().any(is_of_viewer) {
            return None;
        }
        let mut pixels = find(frame, map, picture);
        let width = picture.width() as usize;
        let tile = |i: &usize| (i / width / TILE, i % width / TILE, *i);
        pixels.sort_unstable_by_key(tile);
        (!pixels.is_empty()).then_some(Self {
            frame,
            map,
            solid,
            between: frame.lumigraph.visibility.as_ref().map(|visibility| {
                let photos = &frame.lumigraph.photos;
                Between::new(map, &frame.desired, views, visibility, photos)
            }),
            pixels,
            across: across as usize,
        })
    }

    /// What photos are sampled by.
    pub(crate) fn frame_of_samples(&self) -> Frame<'f> {
        self.frame.of_samples(self.across as f64)
    }

    /// How many pixels they are.
    pub(crate) fn count(&self) -> usize {
        self.pixels.len()
    }

    /// Puts the means of samples into the frame's picture, of colours by their alpha. `draw` gives the colours of what
    /// some see of the proxy, straight RGBA; `None` where no photo has it: for those the others of their pixel stand.
    ///
    /// # Errors
    /// Those of `draw`.
    pub(crate) fn put<S: Send>(
        &self,
        scratch: impl Fn() -> S + Sync + Send,
        draw: impl Fn(&mut S, &[ProxyPoint]) -> Result<Vec<Option<[u8; 4]>>, PhotoError> + Sync + Send,
        picture: &mut RgbaImage,
    ) -> Result<(), PhotoError> {
        let run = (TOGETHER / (self.across * self.across)).max(1);
        let runs = self.pixels.par_chunks(run);
        let colors = runs.map_init(scratch, |scratch, pixels| {
            let of_pixels: Vec<Vec<Option<ProxyPoint>>> =
                pixels.iter().map(|i| self.samples_of(*i)).collect();
            let seeing: Vec<ProxyPoint> = of_pixels.iter().flatten().flatten().copied().collect();
            let mut drawn = draw(scratch, &seeing)?.into_iter();
            let mut color = |sample: Option<ProxyPoint>| match sample {
                None => Some([0; 4]),
                Some(_) => drawn.next().flatten(),
            };
            let mean_of = |samples: Vec<Option<ProxyPoint>>| {
                let colors: Vec<[u8; 4]> = samples.into_iter().filter_map(&mut color).collect();
                (!colors.is_empty()).then(|| mean(&colors))
            };
            Ok(of_pixels.into_iter().map(mean_of).collect())
        });
        let colors: Vec<Result<Vec<Option<[u8; 4]>>, PhotoError>> = colors.collect();
        // The first error in order, whichever thread is the first to meet one.
        let colors: Vec<Vec<Option<[u8; 4]>>> = colors.into_iter().collect::<Result<_, _>>()?;
        let width = picture.width() as usize;
        for (i, color) in self.pixels.iter().zip(colors.into_iter().flatten()) {
            if let Some(color) = color {
                let (x, y) = ((i % width) as u32, (i / width) as u32);
                picture.get_pixel_mut(x, y).0 = color;
            }
        }
        Ok(())
    }

    /// What the samples of a pixel look at, row by row.
    fn samples_of(&self, i: usize) -> Vec<Option<ProxyPoint>> {
        let width = self.frame.desired.width as usize;
        let (x, y) = (i % width, i / width);
        let moved = self.moved_around(x, y);
        let step = 1.0 / self.across as f64;
        let at = |first: usize, k: usize| first as f64 + step * (k as f64 + 0.5);
        let ray_of_sample = |k: usize| {
            let place = Pixel::new(at(x, k % self.across), at(y, k / self.across));
            ray_of(&self.frame.desired.lens, place)
        };
        let rays: Vec<Option<DVec3>> = (0..self.across * self.across).map(ray_of_sample).collect();
        let planes = rays
            .chunks(RAYS_TOGETHER)
            .flat_map(|rays| self.planes_along(rays));
        let sample = |(ray, own): (&Option<DVec3>, Option<DVec3>)| {
            let (ray, own) = ((*ray)?, own?);
            let s = own.dot(ray);
            let seen = match &self.between {
                Some(between) if s > 0.0 => between.who_sees((x, y), ray, s),
                _ => Seen::Beside,
            };
            let as_nearby = || moved_with(&moved, own, ray);
            let before = || self.between.as_ref()?.shown_before((x, y), ray, s);
            let moved = match seen {
                Seen::ByOne => None,
                Seen::ByNone => as_nearby().or_else(before),
                Seen::Beside => as_nearby(),
            };
            let plane = moved.unwrap_or(own);
            Some(ProxyPoint {
                ray,
                inverse_distance: plane.dot(ray),
                plane,
            })
        };
        rays.iter().zip(planes).map(sample).collect()
    }

    /// The plane of the triangle that a ray meets first.
    fn plane_along(&self, ray: DVec3) -> Option<DVec3> {
        let desired = &self.frame.desired;
        let in_world = desired.camera_from_world.rotation.conjugate() * ray;
        let hit = self.solid.first_hit(desired.center(), in_world)?;
        Some(self.plane_of(&hit))
    }

    /// Those of some rays that are near one another, up to [`RAYS_TOGETHER`]; none where there is no ray.
    fn planes_along(&self, rays: &[Option<DVec3>]) -> [Option<DVec3>; RAYS_TOGETHER] {
        let desired = &self.frame.desired;
        let world_from_camera = desired.camera_from_world.rotation.conjugate();
        let in_world = std::array::from_fn(|k| match rays.get(k) {
            Some(Some(ray)) => world_from_camera * *ray,
            _ => DVec3::NAN,
        });
        let hits = self.solid.first_hits(desired.center(), in_world);
        hits.map(|hit| hit.map(|hit| self.plane_of(&hit)))
    }

    fn plane_of(&self, hit: &Hit) -> DVec3 {
        FacetMap::plane_of_triangle(self.solid, hit.triangle_idx, &self.frame.desired)
    }

    /// Of a pixel and those around it what they meet, by its inverse distance, and where to that was moved, if it was; none
    /// where none was.
    fn moved_around(&self, x: usize, y: usize) -> Vec<(f64, Option<DVec3>)> {
        let [width, height] = [self.frame.desired.width, self.frame.desired.height];
        let near = |at: usize, side: u32| at.saturating_sub(1)..(at + 2).min(side as usize);
        let rows = near(y, height);
        let around = rows.flat_map(|y| near(x, width).map(move |x| (x, y)));
        let facet_at = |(x, y): (usize, usize)| self.map.facet_of[y * width as usize + x];
        if !around.clone().any(|at| self.map.is_moved(facet_at(at))) {
            return Vec::new();
        }
        let met = |at: (usize, usize)| {
            let center = Pixel::center_of(at.0 as u32, at.1 as u32);
            let ray = ray_of(&self.frame.desired.lens, center)?;
            let facet = facet_at(at);
            let seen = self.map.plane_of(facet)?;
            Some(match self.map.is_moved(facet) {
                true => (inverse_distance(self.plane_along(ray)?, ray), Some(seen)),
                false => (inverse_distance(seen, ray), None),
            })
        };
        around.filter_map(met).collect()
    }
}

/// Of what a plane is at along a ray.
fn inverse_distance(plane: DVec3, ray: DVec3) -> f64 {
    plane.dot(ray) / ray.length()
}

/// Where what a ray meets, whose plane is its `own`, is moved with the same surface in a pixel nearby; `None` where that
/// is not moved.
fn moved_with(around: &[(f64, Option<DVec3>)], own: DVec3, ray: DVec3) -> Option<DVec3> {
    let s = inverse_distance(own, ray);
    let off = |met: f64| (met - s).abs();
    let (met, moved) = around.iter().min_by(|a, b| off(a.0).total_cmp(&off(b.0)))?;
    moved.filter(|plane| off(*met) <= TOLERANCE * s && plane.dot(ray) > 0.0)
}

/// The mean of straight colours, by their alpha.
fn mean(samples: &[[u8; 4]]) -> [u8; 4] {
    let (mut sum, mut alphas) = ([0_u32; 3], 0);
    for [r, g, b, alpha] in samples {
        let alpha = u32::from(*alpha);
        for (sum, color) in sum.iter_mut().zip([r, g, b]) {
            *sum += alpha * u32::from(*color);
        }
        alphas += alpha;
    }
    let rounded = |sum: u32, by: u32| ((sum + by / 2) / by) as u8;
    match rounded(alphas, samples.len() as u32) {
        0 => [0; 4],
        alpha => {
            let [r, g, b] = sum.map(|sum| rounded(sum, alphas));
            [r, g, b, alpha]
        }
    }
}

/// The pixels between which and one beside them, which does not look alike, the surface jumps; row by row.
fn find(frame: &Frame<'_>, map: &FacetMap, picture: &RgbaImage) -> Vec<usize> {
    let (width, height) = (frame.desired.width as usize, frame.desired.height as usize);
    let colors = picture.as_raw().as_chunks::<4>().0;
    let look = |i: usize| {
        let plane = map.plane_of(map.facet_of[i])?;
        let center = Pixel::center_of((i % width) as u32, (i / width) as u32);
        Some((frame.desired.lens.unproject(center)?, plane))
    };
    let is_jump = |a: usize, b: usize| {
        let [facet_a, facet_b] = [map.facet_of[a], map.facet_of[b]];
        if facet_a == facet_b || are_alike(colors[a], colors[b]) {
            return false;
        }
        if facet_a == NO_FACET || facet_b == NO_FACET {
            return true;
        }
        look(a).zip(look(b)).is_some_and(|(a, b)| jumps(a, b))
    };
    // Of each pixel whether it jumps to the one at its right, and to the one below.
    let of_row = |y: usize| {
        let row = y * width..(y + 1) * width;
        let of_pixel = |i| {
            let right = i + 1 < (y + 1) * width && is_jump(i, i + 1);
            [right, y + 1 < height && is_jump(i, i + width)]
        };
        row.map(of_pixel).collect()
    };
    let rows = || (0..height).into_par_iter().with_min_len(8);
    let all: Vec<Vec<[bool; 2]>> = rows().map(of_row).collect();
    let is_edge = |x: usize, y: usize| {
        let from_before = (x > 0 && all[y][x - 1][0]) || (y > 0 && all[y - 1][x][1]);
        all[y][x][0] || all[y][x][1] || from_before
    };
    let edges_of_row = |y: usize| {
        let edges = (0..width).filter(move |x| is_edge(*x, y));
        edges.map(move |x| y * width + x)
    };
    rows().flat_map_iter(edges_of_row).collect()
}

/// Whether two pixels of straight alpha differ by little.
fn are_alike(a: [u8; 4], b: [u8; 4]) -> bool {
    let shown = |[r, g, b, alpha]: [u8; 4]| {
        let alpha = i32::from(alpha);
        let [r, g, b] = [r, g, b].map(|c| i32::from(c) * alpha / 255);
        [r, g, b, alpha]
    };
    let channels = shown(a).into_iter().zip(shown(b));
    channels.fold(true, |is_alike, (a, b)| is_alike & ((a - b).abs() <= ALIKE))
}

/// Whether what two rays meet is not one surface: neither's plane leads to what the other meets.
fn jumps((ray_a, a): (DVec3, DVec3), (ray_b, b): (DVec3, DVec3)) -> bool {
    let is_off = |led: f64, met: f64| (led - met).abs() > TOLERANCE * met.abs();
    is_off(a.dot(ray_b), b.dot(ray_b)) && is_off(b.dot(ray_a), a.dot(ray_a))
}
