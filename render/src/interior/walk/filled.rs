//! Portals filled with images.

use super::compose::mixed;
use super::{FrameCost, Walk, WalkError};
use crate::interior::reference::plane_of;
use crate::interior::{
    Beyond, Captured, LdiSource, Painter, Pinhole, PortalFill, PortalLdi, Reference, Shown, Target,
    Window, texture, warp,
};
use crate::ldi::{Clipped, FreeOptions};
use glam::DVec3;
use proxy::interior::{CellId, Pass, Portal};
use rayon::prelude::*;
use std::sync::Arc;

/// Where geometry is alone, in shares of where it begins to be mixed in.
const ALONE: f64 = 2.0 / 3.0;

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

impl Filled<'_> {
    /// Whether what is behind shows where the image has that alpha: where it has nothing, or one of two
    /// LDIs has not.
    pub(super) fn leaves_open(&self, alpha: u8) -> bool {
        let is_mixed = self.shown.is_some_and(|shown| shown.other.is_some());
        alpha == 0 || (is_mixed && alpha < u8::MAX)
    }
}

impl Walk<'_> {
    /// The portals among those open that are filled with images.
    pub(super) fn fills<'p>(
        &self,
        fill: PortalFill,
        cell: Option<CellId>,
        open: &[(&'p Pass, CellId)],
        camera: &Pinhole,
    ) -> Vec<Filled<'p>> {
        let eye = camera.center;
        let entered = match self.painter.captured() {
            Some(_) => self.share_entered(cell, eye),
            None => 1.0,
        };
        let photos = self.painter.captured().and_then(Captured::depth_maps);
        let is_of_photos = fill == PortalFill::Ldi
            && self.options.library.ldi_of == LdiSource::Photos
            && photos.is_some();
        let near = match is_of_photos {
            true => self.options.near_photos,
            false => self.options.near,
        };
        let filled = |&(pass, into): &(&'p Pass, CellId)| {
            let portal = self.interior.portal(pass.portal);
            let share = entered * self.share_of_image(portal, eye, near);
            let shown = || match fill {
                PortalFill::Ldi => {
                    let (id, from) = (pass.portal, pass.from);
                    self.library.shown(self.interior, id, from, into, eye)
                }
                _ => None,
            };
            (share > 0.0).then(|| Filled {
                shown: shown(),
                pass,
                into,
                plane: plane_of(camera, portal, Some(into)),
                window: Window::of(&pass.region, camera),
                share,
            })
        };
        let filled = open.iter().filter_map(filled);
        filled.take(usize::from(u16::MAX) - 1).collect()
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

    /// Draws images where one sees through portals.
    pub(super) fn fill(
        &mut self,
        fill: PortalFill,
        fills: &[Filled<'_>],
        images: &[Images],
        camera: &Pinhole,
        cost: &mut FrameCost,
    ) {
        self.filled.clear(camera.width, camera.height);
        self.owners.clear();
        self.owners.resize(self.filled.color.len(), 0);
        for (k, (f, images)) in fills.iter().zip(images).enumerate() {
            for y in 0..camera.height {
                let open = f.window.row(y);
                let first = y as usize * camera.width as usize;
                let row = first + open.start as usize..first + open.end as usize;
                self.owners[row].fill(k as u16 + 1);
            }
            let into = &mut self.filled;
            match images {
                Images::References(images) => {
                    // The nearest last.
                    for reference in images.iter().rev() {
                        cost.samples += match fill {
                            PortalFill::Texture => {
                                texture(reference, &f.plane, camera, &f.window, into)
                            }
                            _ => warp(reference, camera, &f.window, self.options.splat, into),
                        };
                    }
                }
                Images::Ldis(portals) => {
                    let mut portals = portals.iter().filter_map(|portal| portal.as_ref().as_ref());
                    let painter = &mut self.painter;
                    let (options, is_whole) = (&self.options.ldi, self.options.whole_ldis);
                    let mut draw = |portal, into: &mut Target| {
                        draw_ldi(painter, portal, f, camera, options, is_whole, into, cost);
                    };
                    let Some(first) = portals.next() else {
                        continue;
                    };
                    draw(first, into);
                    if let (Some(other), Some((_, share))) =
                        (portals.next(), f.shown.and_then(|shown| shown.other))
                    {
                        self.mixed_in.clear(camera.width, camera.height);
                        draw(other, &mut self.mixed_in);
                        mix(&f.window, into, &self.mixed_in, share);
                    }
                }
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
    options: &FreeOptions,
    is_whole: bool,
    into: &mut Target,
    cost: &mut FrameCost,
) {
    let ldi = &portal.ldi;
    let reach = f64::from(options.reach());
    let columns = match is_whole {
        true => Clipped::whole(ldi),
        false => portal.tree.columns(ldi, camera, &f.window, reach),
    };
    let took = painter.free((ldi, &columns), camera, &f.window, options, into);
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
