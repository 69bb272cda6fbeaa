//! Images of what lies beyond a portal, made before it.

use super::walk::all_cells;
use super::{Beyond, Captured, CellGeometry, DrawOptions, Pinhole, Raster, Target, Window};
use crate::RenderError;
use calibrate::{Lens, View};
use glam::{DVec2, DVec3};
use proxy::interior::{CellId, Interior, Portal, Region, SemicircleView, visible_through};
use proxy::mesh::Model;

/// An image with depth of what one sees through a portal, and nothing else.
#[derive(Clone, Debug)]
pub struct Reference {
    /// Where it was made from.
    pub place: SemicircleView,
    /// Its camera: the portal fills the image, whatever that does to the shape of pixels.
    pub camera: Pinhole,
    /// What it sees: beyond the portal's plane, along rays through its outline.
    pub seen: Target,
}

/// A reference image's width and height by default: those of Rafferty et al. 1998, §4.1.
pub const REFERENCE_SIZE: [u32; 2] = [256, 256];

/// Of reference images made of photos: with 256 house-walk's held-out photos lose 0.5 dB to LDIs, with
/// this 0.2 dB.
pub const CAPTURED_REFERENCE_SIZE: [u32; 2] = [512, 512];

/// Pixels that are left around the portal.
const ROOM: f64 = 1.0;
/// The most that an image spans to each side of its axis, as x / z.
const WIDEST: f64 = 5.0;

/// The plane of a portal as a camera sees it, and what is beyond on the side of `into`. It goes through the eye of
/// one that is in the portal: rounding must not say which side of it the eye is on.
pub(super) fn plane_of(camera: &Pinhole, portal: &Portal, into: Option<CellId>) -> Beyond {
    let point = match portal.is_around(camera.center) {
        true => camera.center,
        false => portal.polygon.center(),
    };
    Beyond::new(camera, point, portal.normal_into(into))
}

impl Reference {
    /// Bytes of an image of that size.
    pub fn bytes([width, height]: [u32; 2]) -> u64 {
        const COLOR_AND_DEPTH: u64 = 4 + 4;
        let (width, height) = (u64::from(width), u64::from(height));
        // And the rays of its columns and rows.
        COLOR_AND_DEPTH * (width * height + width + height)
    }

    /// Draws the image of a place before a portal, in the model's own colours.
    ///
    /// What is in the way on the viewer's side is left out, so the place need not be free, or
    /// even in the viewer's cell.
    pub fn new(
        interior: &Interior,
        model: &Model,
        geometry: &CellGeometry,
        place: &SemicircleView,
        size: [u32; 2],
    ) -> Self {
        let met = Self::met(interior, geometry, place, size, false);
        let Some((_, raster, mut image)) = met else {
            return Self::nothing(place);
        };
        raster.shade(model, &image.camera, &mut image.seen, |_, _| true);
        image
    }

    /// As [`Self::new`], coloured from photos as far as they show what is seen; of all cells, as a
    /// capture's walls may be open where no portal was found.
    ///
    /// # Errors
    /// The photos' engine's.
    pub fn of_photos(
        interior: &Interior,
        model: &Model,
        geometry: &CellGeometry,
        place: &SemicircleView,
        size: [u32; 2],
        captured: &mut Captured,
    ) -> Result<Self, RenderError> {
        let met = Self::met(interior, geometry, place, size, true);
        let Some((view, raster, mut image)) = met else {
            return Ok(Self::nothing(place));
        };
        let (camera, seen) = (&image.camera, &mut image.seen);
        captured.shade(model, &raster, &view, camera, seen, |_, _| true)?;
        Ok(image)
    }

    /// A place that is no place sees nothing.
    fn nothing(place: &SemicircleView) -> Self {
        Self {
            place: place.clone(),
            camera: Pinhole::nowhere(),
            seen: Target::default(),
        }
    }

    /// What the place's camera meets, of all cells or of those that portals show; not coloured yet.
    /// `None` for a place that is none.
    fn met(
        interior: &Interior,
        geometry: &CellGeometry,
        place: &SemicircleView,
        [width, height]: [u32; 2],
        of_all_cells: bool,
    ) -> Option<(View, Raster, Self)> {
        let portal = interior.portal(place.portal);
        let eye = place.camera_from_world.center();
        let view = View {
            lens: lens(portal, place, [width, height]),
            width,
            height,
            camera_from_world: place.camera_from_world,
        };
        let camera = Pinhole::new(&view).ok()?;
        let region = Region::of(&view);
        let visibility = match of_all_cells {
            true => all_cells(interior, &region),
            false => visible_through(interior, place.portal, place.into, eye, &region),
        };
        let runs = geometry.seen(eye, &visibility, &region);
        let beyond = plane_of(&camera, portal, Some(place.into));
        let pieces = portal.polygon.convex_pieces().iter().map(|piece| {
            let mut edges: Vec<DVec3> = piece.iter().map(|p| *p - eye).collect();
            // Counter-clockwise as the eye sees it.
            if portal.polygon.height(eye) < 0.0 {
                edges.reverse();
            }
            (runs.clone(), Window::of_cone(&edges, &camera))
        });
        let options = DrawOptions {
            beyond: Some(&beyond),
            ..DrawOptions::default()
        };
        let mut raster = Raster::default();
        raster.clear(&camera);
        raster.draw(&pieces.collect::<Vec<_>>(), &camera, &options);
        let image = Self {
            place: place.clone(),
            camera,
            seen: Target::new(width, height),
        };
        Some((view, raster, image))
    }
}

/// A lens whose image the portal's outline just fills.
pub(super) fn lens(portal: &Portal, place: &SemicircleView, [width, height]: [u32; 2]) -> Lens {
    let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    for corner in portal.polygon.corners() {
        let p = place.camera_from_world * *corner;
        let at = match p.z > 0.0 {
            true => p.truncate() / p.z,
            // Beside the eye.
            false => WIDEST * p.truncate().normalize_or_zero(),
        };
        let at = at.clamp(DVec2::splat(-WIDEST), DVec2::splat(WIDEST));
        (low, high) = (low.min(at), high.max(at));
    }
    let size = DVec2::new(f64::from(width), f64::from(height));
    let span = (high - low).max(DVec2::splat(1e-6));
    let focal = (size - 2.0 * ROOM).max(DVec2::ONE) / span;
    let middle = 0.5 * (low + high);
    Lens::pinhole(focal, 0.5 * size - middle * focal)
}
