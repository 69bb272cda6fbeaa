//! Portals filled with images.

use super::compose::mixed;
use super::{FrameCost, Walk, WalkError, WalkOptions};
use crate::interior::{
    Beyond, Painter, Pinhole, PortalFill, PortalLdi, Reference, Shown, Target, Window, texture,
    warp,
};
use crate::ldi::Clipped;
use glam::DVec3;
use proxy::interior::{CellId, Pass};
use rayon::prelude::*;
use std::sync::Arc;

/// What fills a portal.
pub(super) enum Images {
    /// Reference images, the nearest first.
    References(Vec<Arc<Reference>>),
    /// One or two; nothing where there are no images, or they make none.
    Ldis(Vec<Arc<Option<PortalLdi>>>),
}

/// A portal that is filled with images in this frame.
pub(super) struct Filled<'p> {
    /// The first of its opening's passes.
    pub(super) pass: &'p Pass,
    pub(super) into: CellId,
    pub(super) plane: Beyond,
    /// What is drawn in: the pixels that it is seen in, and those of a row between them, which show what else there is.
    pub(super) window: Window,
    /// Of the image; the rest is geometry.
    pub(super) share: f64,
    /// The LDIs that it is filled with, if it is.
    pub(super) shown: Option<Shown>,
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
        if !fills.is_empty() {
            self.filled.clear(camera.width, camera.height);
        }
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
