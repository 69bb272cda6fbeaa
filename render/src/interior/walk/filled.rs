//! Portals filled with images.

use super::compose::mixed;
use super::{FrameCost, Walk, WalkError, WalkOptions};
use crate::interior::reference::plane_of;
use crate::interior::{
    Beyond, Captured, LdiSource, Painter, Pinhole, PortalFill, PortalLdi, Reference, Shown, Target,
    Window, texture, warp,
};
use crate::ldi::Clipped;
use glam::DVec3;
use proxy::interior::{CellId, Pass, Portal};
use rayon::prelude::*;
use std::sync::Arc;

/// Where geometry is alone, in shares of where it begins to be mixed in.
const ALONE: f64 = 5.0 / 6.0;

/// From where geometry is alone beyond a portal the portals of the cell beyond are filled with images in their turn,
/// with LDIs from [`ENTERED`] on: more and more, and from so much of that distance on alone. Whoever changes cells sees
/// the same images before and after.
const NESTED_ALONE: f64 = 0.75;

/// From where on images are shown beyond a capture's other portals once one has come through one, in
/// radii of its semicircle: whoever changes cells sees all of it as geometry, before and after.
const ENTERED: f64 = 0.25;

/// What fills a portal.
pub(super) enum Images {
    /// Reference images, the nearest first.
    References(Vec<Arc<Reference>>),
    /// One or two; nothing where there are no images, or they make none.
    Ldis(Vec<Arc<Option<PortalLdi>>>),
}

/// A portal that is filled with images in this frame.
pub(super) struct Filled<'p> {
    pub(super) pass: &'p Pass,
    into: CellId,
    pub(super) plane: Beyond,
    pub(super) window: Window,
    /// Of the image; the rest is geometry.
    pub(super) share: f64,
    /// The LDIs that it is filled with, if it is.
    pub(super) shown: Option<Shown>,
}

/// A portal that one sees through, of the viewer's cell or of one that is geometry beyond a portal that is
/// near.
pub(super) struct Opening<'p> {
    pub(super) pass: &'p Pass,
    /// The opening that it is seen through, by place in their list.
    parent: Option<usize>,
    /// Its place among what is filled.
    pub(super) fill: Option<usize>,
    /// Whether the cell beyond is geometry, and its portals are openings, too.
    pub(super) is_entered: bool,
}

impl Images {
    /// Whether there are images, and none makes an LDI.
    pub(super) fn make_nothing(&self) -> bool {
        match self {
            Self::References(_) => false,
            Self::Ldis(ldis) => ldis.iter().all(|ldi| ldi.is_none()),
        }
    }
}

impl Filled<'_> {
    /// Whether what is behind shows where the image has that alpha: where it has nothing, or one of two
    /// LDIs has not.
    pub(super) fn leaves_open(&self, alpha: u8) -> bool {
        let is_mixed = self.shown.is_some_and(|shown| shown.other.is_some());
        alpha == 0 || (is_mixed && alpha < u8::MAX)
    }
}

impl Walk<'_> {
    /// The portals that one sees through, in the order of the passes, and those of them that are filled with
    /// images. What is beyond one that is near is geometry; in a model its cell's own portals are
    /// filled in their turn.
    pub(super) fn fills<'p>(
        &self,
        fill: PortalFill,
        cell: Option<CellId>,
        passes: &'p [Pass],
        camera: &Pinhole,
    ) -> (Vec<Opening<'p>>, Vec<Filled<'p>>) {
        let eye = camera.center;
        let is_captured = self.painter.captured().is_some();
        let entered = match is_captured {
            true => self.share_entered(cell, eye),
            false => 1.0,
        };
        let photos = self.painter.captured().and_then(Captured::depth_maps);
        let is_of_photos = fill == PortalFill::Ldi
            && self.options.library.ldi_of == LdiSource::Photos
            && photos.is_some();
        let near = match is_of_photos {
            true => self.options.near_photos,
            false => self.options.near,
        };
        let (mut openings, mut fills): (Vec<Opening<'p>>, Vec<Filled<'p>>) = Default::default();
        // The passes that lead to the next one, each with its place among the openings and the share of images
        // in what is beyond it: of those that are entered.
        let mut way: Vec<Option<(usize, f64)>> = Vec::new();
        for pass in passes {
            way.truncate(pass.depth as usize);
            let before = match way.last() {
                None => Some((None, entered)),
                Some(last) => last.map(|(place, share)| (Some(place), share)),
            };
            let Some((parent, most)) = before else {
                way.push(None);
                continue;
            };
            let portal = self.interior.portal(pass.portal);
            let by_distance = match pass.into {
                Some(_) => self.share_of_image(portal, eye, near),
                None => 0.0,
            };
            let of_image = match is_of_photos || self.has_views(portal) {
                true => by_distance,
                false => 0.0,
            };
            let is_near = pass.into.is_some() && by_distance <= 0.0;
            let beyond = match is_near && !is_captured {
                true => most * self.share_of_nested(fill, portal, eye, near),
                false => 0.0,
            };
            let share = most * of_image;
            if let Some(into) = pass.into.filter(|_| share > 0.0) {
                let (id, from) = (pass.portal, pass.from);
                let shown = || {
                    self.library
                        .shown(self.interior, id, from, into, eye)
                        .filter(|_| fill == PortalFill::Ldi)
                };
                fills.push(Filled {
                    shown: shown(),
                    pass,
                    into,
                    plane: plane_of(camera, portal, Some(into)),
                    window: Window::of(&pass.region, camera),
                    share,
                });
            }
            way.push((beyond > 0.0).then_some((openings.len(), beyond)));
            openings.push(Opening {
                pass,
                parent,
                fill: (share > 0.0).then(|| fills.len() - 1),
                is_entered: beyond > 0.0,
            });
        }
        (openings, fills)
    }

    /// What portals are filled with, made now if it is not in memory.
    pub(super) fn images(
        &mut self,
        fill: PortalFill,
        fills: &[Filled<'_>],
        eye: DVec3,
        cost: &mut FrameCost,
    ) -> Result<Vec<Images>, WalkError> {
        if fill == PortalFill::Ldi {
            return self.ldis(fills, cost);
        }
        let (interior, model, geometry) = (self.interior, self.model, &self.geometry);
        let nearest = |f: &Filled<'_>| {
            let (id, from) = (f.pass.portal, f.pass.from);
            let count = fill.references();
            self.library.nearest(interior, id, from, f.into, eye, count)
        };
        let needed: Vec<Vec<usize>> = fills.iter().map(nearest).collect();
        let all: Vec<usize> = needed.iter().flatten().copied().collect();
        all.iter().for_each(|i| self.is_used[*i] = true);
        let photos = self.painter.captured_mut();
        let (images, made) = self
            .library
            .images(&all, interior, model, geometry, photos)?;
        cost.references_made = made;
        let mut images = images.into_iter();
        let of_fills = needed
            .iter()
            .map(|needed| Images::References(images.by_ref().take(needed.len()).collect()));
        Ok(of_fills.collect())
    }

    /// The LDIs that portals are filled with.
    fn ldis(
        &mut self,
        fills: &[Filled<'_>],
        cost: &mut FrameCost,
    ) -> Result<Vec<Images>, WalkError> {
        let places = |f: &Filled<'_>| f.shown.into_iter().flat_map(Shown::places);
        let all: Vec<usize> = fills.iter().flat_map(places).collect();
        self.take_ahead(&all, cost)?;
        for &place in &all {
            self.is_used[self.library.len() + place] = true;
        }
        let (interior, model, geometry) = (self.interior, self.model, &self.geometry);
        let photos = self.painter.captured_mut();
        let (ldis, took) = self.library.ldis(&all, interior, model, geometry, photos)?;
        cost.references_made = took.images;
        cost.ldis_made = took.made;
        cost.ldis_read = took.read;
        let mut ldis = ldis.into_iter();
        let of_fills = fills
            .iter()
            .map(|f| Images::Ldis(ldis.by_ref().take(places(f).count()).collect()));
        Ok(of_fills.collect())
    }

    /// Whether images of views fill a portal: not one that lies flat. They are made in one plane across it, and one
    /// looks through it from all around.
    pub(super) fn has_views(&self, portal: &Portal) -> bool {
        !portal.lies_flat(self.interior.up)
    }

    /// Of an image in what is drawn of a portal, 0 to 1, by the eye's distance from it.
    pub(super) fn share_of_image(&self, portal: &Portal, eye: DVec3, near: f64) -> f64 {
        let far = near * portal.semicircle_radius(self.interior.up);
        let near = ALONE * far;
        let distance = portal.polygon.distance(eye);
        if !(distance > near) {
            return 0.0;
        }
        if far > near {
            ((distance - near) / (far - near)).min(1.0)
        } else {
            1.0
        }
    }

    /// Of images in what is beyond the portals of a cell that is geometry beyond this one, 0 to 1, by the eye's
    /// distance from it.
    fn share_of_nested(&self, fill: PortalFill, portal: &Portal, eye: DVec3, near: f64) -> f64 {
        let most = match fill {
            // They take longer than the geometry beyond.
            PortalFill::Ldi => ENTERED,
            _ => f64::INFINITY,
        };
        let far = (ALONE * near).min(most) * portal.semicircle_radius(self.interior.up);
        let near = NESTED_ALONE * far;
        let distance = portal.polygon.distance(eye);
        match far > near {
            true => ((far - distance) / (far - near)).clamp(0.0, 1.0),
            // On its plane.
            false => 1.0,
        }
    }

    /// Of images in all that is beyond a cell's portals, 0 to 1, by the eye's distance from the one that
    /// it may just have come through.
    fn share_entered(&self, cell: Option<CellId>, eye: DVec3) -> f64 {
        let portals = self.interior.portals_of(cell).map(|(_, portal)| portal);
        let ways = portals.filter(|portal| matches!(portal.beyond(cell), Some(Some(_))));
        let share = |portal: &Portal| {
            let reach = ENTERED * portal.semicircle_radius(self.interior.up);
            portal.polygon.distance(eye) / reach
        };
        ways.map(share).fold(1.0, f64::min)
    }

    /// Says which portal each pixel shows, if images fill it: of those that one sees through there, filled or
    /// not, the nearest; where that is entered, of those of the cell beyond. (From one arm of a room with a corner one sees
    /// portals of the other arm behind its own, and the walls between do not hide them.) Whether one
    /// sees through two that are filled anywhere.
    pub(super) fn share_out(
        &mut self,
        openings: &[Opening<'_>],
        fills: &[Filled<'_>],
        camera: &Pinhole,
    ) -> bool {
        let width = camera.width as usize;
        self.owners.clear();
        self.owners.resize(width * camera.height as usize, 0);
        if fills.is_empty() {
            return false;
        }
        // 1. By opening, one more than its place.
        let mut planes: Vec<Beyond> = Vec::with_capacity(openings.len());
        for (place, opening) in openings.iter().enumerate() {
            let pass = opening.pass;
            let own = opening.fill.map(|k| &fills[k]);
            let plane = own.map_or_else(
                || plane_of(camera, self.interior.portal(pass.portal), pass.into),
                |f| f.plane,
            );
            planes.push(plane);
            let seen_through;
            let window = match own {
                Some(f) => &f.window,
                None => {
                    seen_through = Window::of(&pass.region, camera);
                    &seen_through
                }
            };
            // The opening beside this one that a pixel shows, or one seen through it.
            let beside = |shown: u16| {
                let mut at = usize::from(shown).checked_sub(1)?;
                while openings[at].parent != opening.parent {
                    at = openings[at].parent?;
                }
                Some(at)
            };
            let free = opening.parent.map_or(0, |parent| parent as u16 + 1);
            for y in 0..camera.height {
                let open = window.row(y);
                let row = &mut self.owners[y as usize * width..][..width];
                let shown = &mut row[open.start as usize..open.end as usize];
                for (x, shown) in open.zip(shown) {
                    let is_shown = *shown == free
                        || beside(*shown).is_some_and(|other| {
                            let ray = camera.ray(x, y);
                            plane.inverse_depth(ray) > planes[other].inverse_depth(ray)
                        });
                    if is_shown {
                        *shown = place as u16 + 1;
                    }
                }
            }
        }
        // 2. By fill.
        let fill_of = |opening: &Opening<'_>| opening.fill.map_or(0, |k| k as u16 + 1);
        let fill_of: Vec<u16> = std::iter::once(0)
            .chain(openings.iter().map(fill_of))
            .collect();
        if fill_of.iter().zip(0..).any(|(fill, place)| *fill != place) {
            let owners = self.owners.iter_mut();
            owners.for_each(|shown| *shown = fill_of[usize::from(*shown)]);
        }
        are_apart(fills, camera.height)
    }

    /// Draws images where one sees through portals, each in its own pixels: those of portals that are seen
    /// one before the other are drawn `apart`.
    pub(super) fn fill(
        &mut self,
        fill: PortalFill,
        fills: &[Filled<'_>],
        images: &[Images],
        camera: &Pinhole,
        apart: bool,
        cost: &mut FrameCost,
    ) {
        self.filled.clear(camera.width, camera.height);
        for (k, (f, images)) in fills.iter().zip(images).enumerate() {
            if !apart {
                let (painter, options) = (&mut self.painter, &self.options);
                let into = [&mut self.filled, &mut self.mixed_in];
                draw(fill, f, images, camera, painter, options, into, cost);
                continue;
            }
            self.apart.clear(camera.width, camera.height);
            let (painter, options) = (&mut self.painter, &self.options);
            let into = [&mut self.apart, &mut self.mixed_in];
            draw(fill, f, images, camera, painter, options, into, cost);
            for y in 0..camera.height {
                let first = y as usize * camera.width as usize;
                for pixel in f.window.row(y).map(|x| first + x as usize) {
                    if usize::from(self.owners[pixel]) == k + 1 {
                        self.filled.color[pixel] = self.apart.color[pixel];
                        self.filled.inverse_depth[pixel] = self.apart.inverse_depth[pixel];
                    }
                }
            }
        }
    }
}

/// Whether one sees through two portals that are filled in some pixel, or there are too many to tell.
fn are_apart(fills: &[Filled<'_>], height: u32) -> bool {
    const FEW: usize = 64;
    let meet = |a: &Filled<'_>, b: &Filled<'_>| {
        (0..height).any(|y| {
            let (a, b) = (a.window.row(y), b.window.row(y));
            a.start.max(b.start) < a.end.min(b.end)
        })
    };
    let mut pairs = fills
        .iter()
        .enumerate()
        .flat_map(|(k, a)| fills[..k].iter().map(move |b| (a, b)));
    fills.len() > FEW || pairs.any(|(a, b)| meet(a, b))
}

/// Draws a portal's images; the second target is for one that is mixed into another.
fn draw(
    fill: PortalFill,
    f: &Filled<'_>,
    images: &Images,
    camera: &Pinhole,
    painter: &mut Painter,
    options: &WalkOptions,
    [into, mixed_in]: [&mut Target; 2],
    cost: &mut FrameCost,
) {
    match images {
        Images::References(images) => {
            // The nearest last.
            for reference in images.iter().rev() {
                cost.samples += match fill {
                    PortalFill::Texture => texture(reference, &f.plane, camera, &f.window, into),
                    _ => warp(reference, camera, &f.window, options.splat, into),
                };
            }
        }
        Images::Ldis(portals) => {
            let mut portals = portals.iter().filter_map(|portal| portal.as_ref().as_ref());
            let mut draw = |portal, into: &mut Target| {
                draw_ldi(painter, portal, f, camera, options, into, cost);
            };
            let Some(first) = portals.next() else {
                return;
            };
            draw(first, into);
            if let (Some(other), Some((_, share))) =
                (portals.next(), f.shown.and_then(|shown| shown.other))
            {
                mixed_in.clear(camera.width, camera.height);
                draw(other, mixed_in);
                mix(&f.window, into, mixed_in, share);
            }
        }
    }
}

/// Draws an LDI where one sees through its portal.
fn draw_ldi(
    painter: &mut Painter,
    portal: &PortalLdi,
    f: &Filled<'_>,
    camera: &Pinhole,
    options: &WalkOptions,
    into: &mut Target,
    cost: &mut FrameCost,
) {
    let ldi = &portal.ldi;
    let reach = f64::from(options.ldi.reach());
    let columns = match options.whole_ldis {
        true => Clipped::whole(ldi),
        false => portal.tree.columns(ldi, camera, &f.window, reach),
    };
    let free = options.ldi.for_width(camera.width);
    let took = painter.free((ldi, &columns), camera, &f.window, &free, into);
    cost.samples += took.drawn;
    if took.pixels > 0 {
        cost.samples_clipped += ldi.len() - took.samples;
    }
}

/// Mixes another picture into one, in a window: colours with coverage, and the depths of what is there.
fn mix(window: &Window, into: &mut Target, other: &Target, share: f64) {
    let width = into.width.max(1) as usize;
    let colors = into.color.par_chunks_mut(width);
    let rows = colors.zip(into.inverse_depth.par_chunks_mut(width));
    rows.enumerate().for_each(|(y, (colors, depths))| {
        let open = window.row(y as u32);
        for x in open.start as usize..(open.end as usize).min(width) {
            let pixel = y * width + x;
            colors[x] = mixed(colors[x], other.color[pixel], share);
            let (a, b) = (depths[x], other.inverse_depth[pixel]);
            depths[x] = match (a > 0.0, b > 0.0) {
                (true, true) => a + share as f32 * (b - a),
                _ => a.max(b),
            };
        }
    });
}
