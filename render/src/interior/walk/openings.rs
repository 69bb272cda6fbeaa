//! Portals that one sees through, and which of them each pixel shows.

use super::Walk;
use super::filled::Filled;
use crate::interior::reference::plane_of;
use crate::interior::target::fill_all;
use crate::interior::{Beyond, Captured, LdiSource, Pinhole, PortalFill, Window};
use glam::DVec3;
use proxy::interior::{CellId, Pass, Portal, PortalId, Region};
use std::collections::HashMap;

/// Where geometry is alone, in shares of where it begins to be mixed in.
const ALONE: f64 = 5.0 / 6.0;

/// From where geometry is alone beyond a portal the portals of the cell beyond are filled with images in their turn,
/// with LDIs from [`ENTERED`] on: more and more, and from so much of that distance on alone. Whoever changes cells sees
/// the same images before and after.
const NESTED_ALONE: f64 = 0.75;

/// From where on images are shown beyond a capture's other portals once one has come through one, in
/// radii of its semicircle: whoever changes cells sees all of it as geometry, before and after.
const ENTERED: f64 = 0.25;

/// A portal that one sees through, of the viewer's cell or of one that is geometry beyond a portal that is
/// near.
pub(super) struct Opening<'p> {
    /// The first of its passes.
    pub(super) pass: &'p Pass,
    /// Where one sees through it, in convex pieces: those of its outline, of the openings that it is seen through,
    /// or of both. They may overlap.
    pub(super) regions: Vec<&'p Region>,
    /// The opening that it is seen through, by place in their list.
    parent: Option<usize>,
    /// Its place among what is filled.
    pub(super) fill: Option<usize>,
    /// Of images in what is beyond it, if that cell is geometry, and its portals are openings, too; else 0.
    beyond: f64,
}

impl Opening<'_> {
    /// Whether the cell beyond is geometry, and its portals are openings, too.
    pub(super) fn is_entered(&self) -> bool {
        self.beyond > 0.0
    }

    /// The pixels that it is seen in, and those of a row between them.
    pub(super) fn window(&self, camera: &Pinhole) -> Window {
        let mut window = Window::default();
        for region in &self.regions {
            window.take_in(&Window::of(region, camera));
        }
        window
    }
}

impl Walk<'_> {
    /// The portals that one sees through, in the order of the passes, and those of them that are filled with
    /// images; each once for each way that leads to it, whatever the pieces that one sees through. What is
    /// beyond one that is near is geometry; in a model its cell's own portals are filled in their turn.
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
        // By the opening before it and by portal, the place of an opening.
        let mut known: HashMap<(Option<usize>, PortalId), usize> = HashMap::new();
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
            if let Some(&place) = known.get(&(parent, pass.portal)) {
                let opening = &mut openings[place];
                opening.regions.push(&pass.region);
                if let Some(k) = opening.fill {
                    fills[k].window.take_in(&Window::of(&pass.region, camera));
                }
                way.push(opening.is_entered().then_some((place, opening.beyond)));
                continue;
            }
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
            known.insert((parent, pass.portal), openings.len());
            openings.push(Opening {
                pass,
                regions: vec![&pass.region],
                parent,
                fill: (share > 0.0).then(|| fills.len() - 1),
                beyond,
            });
        }
        (openings, fills)
    }

    /// Whether images of views fill a portal: not one that lies flat. They are made in one plane across it, and one
    /// looks through it from all around.
    pub(super) fn has_views(&self, portal: &Portal) -> bool {
        !portal.lies_flat(self.interior.up)
    }

    /// Of an image in what is drawn of a portal, 0 to 1, by the eye's distance from it.
    pub(super) fn share_of_image(&self, portal: &Portal, eye: DVec3, near: f64) -> f64 {
        if portal.is_around(eye) {
            return 0.0;
        }
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
        if fills.is_empty() {
            self.owners.clear();
            return false;
        }
        let width = camera.width as usize;
        fill_all(&mut self.owners, width * camera.height as usize, 0);
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
            let windows: Vec<Window> = match (own, &opening.regions[..]) {
                (Some(f), [_]) => vec![f.window.clone()],
                (_, regions) => regions.iter().map(|r| Window::of(r, camera)).collect(),
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
            let rows = windows
                .iter()
                .flat_map(|window| (0..camera.height).map(move |y| (y, window.row(y))));
            for (y, open) in rows {
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
