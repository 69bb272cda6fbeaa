//! Photos with depth maps, as images of what lies beyond a portal, wherever they were taken.
//!
//! Semicircles say where such photos are best taken from (Rafferty et al. 1998, §4.1). Here any photo
//! will do that shows something one sees through the portal from there.

use super::reference::lens;
use super::{Captured, Pinhole, Reference, Target, normal_at};
use crate::{Lumigraph, PhotoError, RenderError};
use calibrate::{Distortion, Lens, View};
use capture::DepthMap;
use glam::{DVec2, DVec3};
use image::GrayImage;
use proxy::depth::{self, DepthNoise};
use proxy::interior::{Interior, Portal, Region, SemicircleView, clip};
use rayon::prelude::*;
use std::fmt;
use std::sync::OnceLock;

/// The depth maps of a lumigraph's photos, decoded each time they are asked for.
pub struct DepthMaps {
    /// By source view.
    has: Vec<bool>,
    load: Box<dyn Fn(usize) -> Result<DepthMap, String> + Send + Sync>,
    noise: OnceLock<Result<DepthNoise, String>>,
}

impl DepthMaps {
    /// Of the source views of which `has` says so. `load` decodes one, in world units (as
    /// [`calibrate::DepthAlong`] says) and as large as the photo, or says what is wrong, naming the file.
    pub fn new(
        has: Vec<bool>,
        load: impl Fn(usize) -> Result<DepthMap, String> + Send + Sync + 'static,
    ) -> Self {
        Self {
            has,
            load: Box::new(load),
            noise: OnceLock::new(),
        }
    }

    /// How noisy those are that can be decoded. `view` gives a source view's camera.
    ///
    /// # Errors
    /// They say nothing, or what is wrong with the first if none can be decoded.
    pub fn noise(&self, view: impl Fn(usize) -> View) -> Result<DepthNoise, String> {
        let found = self.noise.get_or_init(|| {
            let with: Vec<usize> = (0..self.has.len()).filter(|i| self.has[*i]).collect();
            let mut first_error = None;
            let frame = |k: usize| {
                let view = view(with[k]);
                let (width, height) = (view.width, view.height);
                let count = width as usize * height as usize;
                let fits =
                    |m: &DepthMap| (m.width, m.height, m.depths.len()) == (width, height, count);
                let map = (self.load)(with[k]);
                let map = map.map_err(|error| first_error.get_or_insert(error).clone());
                let nothing = || DepthMap {
                    width,
                    height,
                    depths: vec![0.0; count],
                };
                let map = map.ok().filter(fits).unwrap_or_else(nothing);
                Ok::<_, String>((view, map))
            };
            let noise = depth::noise(with.len(), frame);
            noise.map_err(|error| first_error.unwrap_or_else(|| error.to_string()))
        });
        found.clone()
    }

    /// Whether a source view has one.
    pub fn has(&self, source_idx: usize) -> bool {
        self.has[source_idx]
    }

    /// The inverse depths of one that neighbours confirm: see [`depth::believed`].
    ///
    /// # Errors
    /// It cannot be decoded, or does not fit its view.
    pub fn believed(
        &self,
        source_idx: usize,
        view: &View,
        noise: DepthNoise,
    ) -> Result<Vec<f32>, String> {
        let map = (self.load)(source_idx)?;
        let inverse = depth::believed(view, &map, noise, MAX_SLANT);
        inverse.map_err(|error| error.to_string())
    }
}

impl fmt::Debug for DepthMaps {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let count = self.has.iter().filter(|has| **has).count();
        f.debug_struct("DepthMaps").field("count", &count).finish()
    }
}

/// Photos of what is beyond a portal.
pub(super) struct Photographed {
    /// The most central first.
    pub(super) images: Vec<Reference>,
    /// The standard deviation of their inverse depths.
    pub(super) noise: f64,
    /// A camera at the middle of the semicircle that the portal fills.
    pub(super) camera: Pinhole,
}

/// Photos that are tried, for each that is asked for.
const TRIED: usize = 4;
/// A photo that shows less of what is beyond than this share of its pixels is passed over.
const LEAST: f64 = 0.002;
/// Slants of more than this are not believed, radians; as where depth maps are fused.
const MAX_SLANT: f64 = 80.0 * std::f64::consts::PI / 180.0;
/// The least cosine at which a surface faces who looks at it: noise turns the normals of what is seen
/// edge on.
const FACING: f64 = -0.1;

/// The photos with depth maps that show what one sees through a portal from its semicircle, the most
/// central first: those that see part of the portal from its front, by their distance from
/// the semicircle's middle, then those that stand beyond it. As many as the semicircle has places.
///
/// What enters of a photo is what lies beyond the portal's plane and is seen through its outline
/// from a place of the semicircle, from the side that the photo saw. What stands between does not matter:
/// an LDI holds all that is on a ray.
///
/// # Errors
/// All photos are corrupt; those that are while others are not are left out.
pub(super) fn photographed(
    interior: &Interior,
    side: &[SemicircleView],
    size: [u32; 2],
    captured: &mut Captured,
) -> Result<Option<Photographed>, RenderError> {
    let Some(place) = side.get(side.len() / 2) else {
        return Ok(None);
    };
    let Some(noise) = captured.depth_noise() else {
        return Ok(None);
    };
    let portal = interior.portal(place.portal);
    let camera = Pinhole::new(&View {
        lens: lens(portal, place, size),
        width: size[0],
        height: size[1],
        camera_from_world: place.camera_from_world,
    });
    let (Ok(camera), Some(maps)) = (camera, captured.depth_maps()) else {
        return Ok(None);
    };
    let sources = &captured.lumigraph().sources;
    // 1. Who may see it.
    let mut ranked: Vec<(bool, f64, usize)> = (0..sources.len())
        .filter(|i| maps.has(*i) && !captured.is_left_out(*i))
        .filter_map(|i| {
            let view = &sources[i].view;
            let is_beyond = before(portal, place, view.center()) < 0.0;
            let off = view.center().distance(camera.center);
            (is_beyond || sees(view, portal)).then_some((is_beyond, off, i))
        })
        .collect();
    ranked.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)));
    // 2. What they show; as many at once as may be missing, and judged in their order.
    let opening = Opening::new(portal, side);
    let mut found: Vec<(usize, Reference)> = Vec::new();
    let mut rest: Vec<usize> = ranked.into_iter().map(|(_, _, i)| i).collect();
    rest.truncate(TRIED * side.len());
    while !rest.is_empty() && found.len() < side.len() {
        let later = rest.split_off(rest.len().min(side.len() - found.len()));
        let (lumigraph, maps) = (captured.lumigraph(), captured.depth_maps());
        let image = |i: &usize| image(lumigraph, maps?, *i, noise, &opening, place).transpose();
        let images: Vec<Option<Result<Reference, Unusable>>> = rest.par_iter().map(image).collect();
        for (i, image) in rest.into_iter().zip(images) {
            match image {
                Some(Ok(image)) => found.push((i, image)),
                Some(Err(Unusable::DepthMap(error))) => {
                    let name = &captured.lumigraph().sources[i].name;
                    let note = format!("the depth map of photo {name} is left out: {error}");
                    captured.note(note);
                }
                Some(Err(Unusable::Photo(error))) => captured.leave_out(error)?,
                None => {}
            }
        }
        rest = later;
    }
    // 3. Exposed alike.
    let sources = &captured.lumigraph().sources;
    let count = found.len().max(1) as f64;
    let mean = found
        .iter()
        .map(|(i, _)| DVec3::from(sources[*i].gain))
        .sum::<DVec3>()
        / count;
    for (i, image) in &mut found {
        let factor = mean / DVec3::from(sources[*i].gain);
        if factor != DVec3::ONE && factor.is_finite() {
            for color in &mut image.seen.color {
                for k in 0..3 {
                    color[k] = (f64::from(color[k]) * factor[k]).round() as u8;
                }
            }
        }
    }
    Ok(Some(Photographed {
        images: found.into_iter().map(|(_, image)| image).collect(),
        noise: noise.inverse_depth,
        camera,
    }))
}

/// How far a point is before a portal, on the side of who looks through it.
fn before(portal: &Portal, place: &SemicircleView, point: DVec3) -> f64 {
    let into = portal.normal_into(Some(place.into));
    into.dot(portal.polygon.center() - point)
}

/// Whether any of a portal may be in a view's image.
fn sees(view: &View, portal: &Portal) -> bool {
    let (region, eye) = (Region::of(view), view.center());
    portal.polygon.convex_pieces().iter().any(|piece| {
        let all: Vec<DVec3> = piece.iter().map(|p| *p - eye).collect();
        let sides = region.sides().iter();
        let left = sides.fold(all, |left, side| clip(&left, |p| side.dot(p)));
        !left.is_empty()
    })
}

/// What one sees through a portal from its semicircle.
struct Opening {
    point: DVec3,
    /// Away from who looks.
    normal: DVec3,
    /// From each place, the middle ones first: the eye, and the inward normals of the cone around a
    /// convex piece of the outline.
    cones: Vec<(DVec3, Vec<DVec3>)>,
}

impl Opening {
    fn new(portal: &Portal, side: &[SemicircleView]) -> Self {
        let middle = side.len() / 2;
        let mut order: Vec<usize> = (0..side.len()).collect();
        order.sort_by_key(|i| (i.abs_diff(middle), *i));
        let pieces = portal.polygon.convex_pieces();
        let mut cones = Vec::new();
        for place in order.into_iter().map(|i| &side[i]) {
            let eye = place.camera_from_world.center();
            for piece in pieces {
                let mut edges: Vec<DVec3> = piece.iter().map(|p| *p - eye).collect();
                // Counter-clockwise as the eye sees them.
                if portal.polygon.height(eye) < 0.0 {
                    edges.reverse();
                }
                let next = |k: usize| edges[(k + 1) % edges.len()];
                let side = |k: usize| next(k).cross(edges[k]);
                cones.push((eye, (0..edges.len()).map(side).collect()));
            }
        }
        Self {
            point: portal.polygon.center(),
            normal: portal.normal_into(side.first().map(|place| place.into)),
            cones,
        }
    }

    /// Whether a point with a normal, away from who sees its face, is seen from anywhere.
    fn shows(&self, point: DVec3, normal: DVec3) -> bool {
        let is_beyond = self.normal.dot(point - self.point) >= 0.0;
        is_beyond
            && self.cones.iter().any(|(eye, sides)| {
                let ray = point - eye;
                sides.iter().all(|side| side.dot(ray) >= 0.0)
                    && normal.dot(ray) >= FACING * ray.length() * normal.length()
            })
    }
}

/// Why a photo is of no use.
enum Unusable {
    DepthMap(String),
    Photo(PhotoError),
}

/// What a photo shows through an opening, in its own colours; nothing where that is hardly anything.
///
/// # Errors
/// Its depth map, or itself, cannot be decoded.
fn image(
    lumigraph: &Lumigraph,
    maps: &DepthMaps,
    source_idx: usize,
    noise: DepthNoise,
    opening: &Opening,
    place: &SemicircleView,
) -> Result<Option<Reference>, Unusable> {
    // 1. The depths that neighbours confirm.
    let view = lumigraph.sources[source_idx].view.clone();
    let inverse = maps.believed(source_idx, &view, noise);
    let inverse = inverse.map_err(Unusable::DepthMap)?;
    // 2. In a camera without distortion, by the nearest pixels.
    let straight = View {
        lens: Lens::pinhole(view.lens.focal, view.lens.principal),
        ..view.clone()
    };
    let Ok(camera) = Pinhole::new(&straight) else {
        return Ok(None);
    };
    let (width, height) = (view.width as usize, view.height as usize);
    let is_straight = view.lens.distortion() == Distortion::None;
    let pixel_of = |i: usize| {
        if is_straight {
            return Some(i);
        }
        let at = view
            .lens
            .project(camera.ray((i % width) as u32, (i / width) as u32))?;
        let at = DVec2::new(at.x, at.y).floor();
        let is_in = at.x >= 0.0 && at.y >= 0.0 && at.x < width as f64 && at.y < height as f64;
        is_in.then(|| at.y as usize * width + at.x as usize)
    };
    let pixels: Vec<Option<usize>> = (0..width * height).into_par_iter().map(pixel_of).collect();
    let depths: Vec<f32> = pixels
        .iter()
        .map(|i| i.map_or(0.0, |i| inverse[i]))
        .collect();
    // 3. What of it is seen through the opening.
    let world_from_camera = camera.rotation.transpose();
    let is_shown = |i: usize| {
        let s = f64::from(depths[i]);
        let normal = normal_at(&camera, &depths, i);
        let ray = camera.ray((i % width) as u32, (i / width) as u32);
        let point = camera.center + world_from_camera * (ray / s);
        s > 0.0 && opening.shows(point, world_from_camera * normal)
    };
    let is_shown: Vec<bool> = (0..width * height).into_par_iter().map(is_shown).collect();
    let count = is_shown.iter().filter(|is| **is).count();
    if (count as f64) < LEAST * (width * height) as f64 {
        return Ok(None);
    }
    // 4. Its colours.
    let photos = &lumigraph.photos;
    let photo = photos.get(source_idx).map_err(Unusable::Photo)?;
    let texels = &photo.levels[0];
    let mask = photos.mask(source_idx).map(|mask| &mask.levels[0]);
    let mut seen = Target::new(view.width, view.height);
    for (i, pixel) in pixels.iter().enumerate() {
        let Some(at) = pixel.filter(|_| is_shown[i]) else {
            continue;
        };
        let (x, y) = ((at % width) as u32, (at / width) as u32);
        let color = texels.get_pixel(x, y).0;
        // One that cannot be decoded has a single pixel, which says no.
        let use_of = |mask: &GrayImage| mask.get_pixel_checked(x, y).map_or(0, |p| p.0[0]);
        let is_used = mask.is_none_or(|mask| use_of(mask) == u8::MAX);
        if color[3] == u8::MAX && is_used {
            seen.color[i] = color;
            seen.inverse_depth[i] = depths[i];
        }
    }
    // 5. What lost the neighbours of its own surface would pass for a part of another, seen edge on.
    let least_cos = MAX_SLANT.cos();
    let is_slanted = |i: &usize| {
        let ray = camera.ray((i % width) as u32, (i / width) as u32);
        let normal = normal_at(&camera, &seen.inverse_depth, *i);
        normal.dot(ray) < least_cos * normal.length() * ray.length()
    };
    let slanted: Vec<usize> = (0..width * height)
        .into_par_iter()
        .filter(is_slanted)
        .collect();
    for i in slanted {
        (seen.color[i], seen.inverse_depth[i]) = ([0; 4], 0.0);
    }
    let place = SemicircleView {
        camera_from_world: view.camera_from_world,
        ..place.clone()
    };
    Ok(Some(Reference {
        place,
        camera,
        seen,
    }))
}
