//! Portals filled with images.

use super::{FrameCost, Walk};
use crate::RenderError;
use crate::interior::reference::plane_of;
use crate::interior::{
    Beyond, Captured, LdiSource, Pinhole, PortalFill, PortalLdi, Reference, Window, texture, warp,
};
use crate::ldi::Clipped;
use glam::DVec3;
use proxy::interior::{CellId, Pass, Portal};
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
    /// Nothing where there are no images, or they make none.
    Ldi(Arc<Option<PortalLdi>>),
}

/// What a frame's portals are filled with.
pub(super) struct Needed {
    pub(super) of_fills: Vec<Images>,
    /// Reference images made for it.
    pub(super) made: usize,
}

/// A portal that is filled with images in this frame.
pub(super) struct Filled<'p> {
    pub(super) pass: &'p Pass,
    into: CellId,
    pub(super) plane: Beyond,
    pub(super) window: Window,
    /// Of the image; the rest is geometry.
    pub(super) share: f64,
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
            (share > 0.0).then(|| Filled {
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
    ) -> Result<Needed, RenderError> {
        let (interior, model, geometry) = (self.interior, self.model, &self.geometry);
        if fill == PortalFill::Ldi {
            let side = |f: &Filled<'_>| self.library.side(f.pass.portal, f.pass.from, f.into);
            let sides: Vec<Option<usize>> = fills.iter().map(side).collect();
            let all: Vec<usize> = sides.iter().flatten().copied().collect();
            for &side in &all {
                self.is_used[self.library.len() + side] = true;
            }
            let photos = self.painter.captured_mut();
            let (ldis, made) = self.library.ldis(&all, interior, model, geometry, photos)?;
            let mut ldis = ldis.into_iter();
            let ldi = |side: &Option<usize>| {
                Images::Ldi(side.and_then(|_| ldis.next()).unwrap_or_default())
            };
            let of_fills = sides.iter().map(ldi);
            return Ok(Needed {
                of_fills: of_fills.collect(),
                made,
            });
        }
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
        let mut images = images.into_iter();
        let of_fills = needed
            .iter()
            .map(|needed| Images::References(images.by_ref().take(needed.len()).collect()));
        Ok(Needed {
            of_fills: of_fills.collect(),
            made,
        })
    }

    /// Of an image in what is drawn of a portal, 0 to 1, by the eye's distance from it.
    fn share_of_image(&self, portal: &Portal, eye: DVec3, near: f64) -> f64 {
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
        images: &Needed,
        camera: &Pinhole,
        cost: &mut FrameCost,
    ) {
        self.filled.clear(camera.width, camera.height);
        self.owners.clear();
        self.owners.resize(self.filled.color.len(), 0);
        for (k, (f, images)) in fills.iter().zip(&images.of_fills).enumerate() {
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
                Images::Ldi(portal) => {
                    let Some(portal) = portal.as_ref() else {
                        continue;
                    };
                    let (ldi, options) = (&portal.ldi, &self.options.ldi);
                    let reach = f64::from(options.reach());
                    let columns = match self.options.whole_ldis {
                        true => Clipped::whole(ldi),
                        false => portal.tree.columns(ldi, camera, &f.window, reach),
                    };
                    let drawn = (ldi, &columns);
                    let took = self.painter.free(drawn, camera, &f.window, options, into);
                    cost.samples += took.drawn;
                    if took.pixels > 0 {
                        cost.samples_clipped += ldi.len() - took.samples;
                    }
                }
            }
        }
    }
}
