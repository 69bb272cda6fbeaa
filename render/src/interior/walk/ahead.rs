//! LDIs made before a frame needs them.

use super::filled::Filled;
use super::{FrameCost, Walk, WalkError};
use crate::interior::background::Background;
use crate::interior::{Reference, Shown};
use glam::DVec3;
use proxy::interior::{CellId, PortalId};
use std::io;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread::Scope;
use std::time::Instant;

/// How many frames ahead one looks: as many as an LDI or two take.
const FRAMES: [f64; 4] = [0.0, 4.0, 8.0, 16.0];

impl<'a> Walk<'a> {
    /// From now on a thread of low priority makes the LDIs of views that frames will need soon
    /// ([`LibraryOptions::ldi_views`](crate::interior::LibraryOptions::ldi_views); Gortler, He and Cohen
    /// 1997 have such a thread make the current one). It ends when the walk does. Pictures are the same
    /// without it, but frames make for themselves what they need. Where photos colour the images, each frame makes
    /// up to one for it, as nothing but the frames' thread has the photos' engine.
    ///
    /// # Errors
    /// The system's, where it gives no thread; then the walk goes on without.
    pub fn make_ahead(&mut self, scope: &'a Scope<'a, '_>) -> io::Result<()> {
        if self.options.library.ldi_views.is_some() {
            self.background = Some(Background::start(scope)?);
        }
        Ok(())
    }

    /// Takes what the thread has made, and waits for it where a frame needs that.
    pub(super) fn take_ahead(
        &mut self,
        needed: &[usize],
        cost: &mut FrameCost,
    ) -> Result<(), WalkError> {
        let Some(background) = &mut self.background else {
            return Ok(());
        };
        let mut done = background.poll();
        if let Some(place) = background.at()
            && needed.contains(&place)
            && !self.library.has_ldi(place)
        {
            let start = Instant::now();
            done = background.wait();
            cost.waited = start.elapsed();
        }
        match done {
            Some(Ok(Some(made))) => {
                cost.ldis_ahead += 1;
                let is_needed = needed.contains(&made.place);
                self.library.take(made, is_needed);
                Ok(())
            }
            Some(Err(said)) => Err(WalkError::Ahead(said)),
            None | Some(Ok(None)) => Ok(()),
        }
    }

    /// Lets the thread make what will be needed first, if it has nothing to do.
    pub(super) fn ask_ahead(&mut self, fills: &[Filled<'_>], eye: DVec3) -> Result<(), WalkError> {
        let Some(background) = &self.background else {
            return Ok(());
        };
        let at = background.at();
        let mut soon = self.soon(fills, eye);
        self.last_eye = Some(eye);
        soon.retain(|place| Some(*place) != at);
        let Some(recipe) = self.library.ahead(&soon) else {
            return Ok(());
        };
        let (interior, model) = (self.interior, self.model);
        if let Some(captured) = self.painter.captured_mut()
            && let Some(place) = recipe.missing()
        {
            let geometry = &self.geometry;
            self.library
                .add_image(place, interior, model, geometry, Some(captured))?;
            return Ok(());
        }
        if let Some(background) = &mut self.background {
            let geometry = Arc::clone(&self.geometry);
            background.ask(recipe.place, move |is_over| {
                let made = recipe.make(|view, size| match is_over.load(Ordering::Relaxed) {
                    true => Err(()),
                    false => Ok(Reference::new(interior, model, &geometry, view, size)),
                });
                made.ok()
            });
        }
        Ok(())
    }

    /// Places whose LDIs frames may need soon, the sooner the earlier: as far as one goes on as since the last
    /// frame.
    fn soon(&self, fills: &[Filled<'_>], eye: DVec3) -> Vec<usize> {
        let step = self.last_eye.map_or(DVec3::ZERO, |last| eye - last);
        let (mut in_view, mut others) = (Vec::new(), Vec::new());
        for frames in FRAMES {
            let eye = eye + frames * step;
            let Some(from) = self.contents.locate(self.interior, eye) else {
                continue;
            };
            self.each_filled(from, eye, |from, id, into| {
                let is_in_view = fills.iter().any(|f| f.pass.portal == id);
                let soon = if is_in_view {
                    &mut in_view
                } else {
                    &mut others
                };
                let shown = self.library.shown(self.interior, id, from, into, eye);
                soon.extend(shown.into_iter().flat_map(Shown::places));
            });
        }
        // Whichever way one turns.
        let shown = fills.iter().filter_map(|f| f.shown);
        let beside = shown.flat_map(|shown| self.library.beside(shown.place));
        in_view.into_iter().chain(others).chain(beside).collect()
    }
}

impl Walk<'_> {
    /// The portals that are filled for an eye in a cell, whichever way it looks: those of the cell, and in a model
    /// those of cells beyond portals that are near.
    fn each_filled(
        &self,
        cell: CellId,
        eye: DVec3,
        mut with: impl FnMut(CellId, PortalId, CellId),
    ) {
        let is_captured = self.painter.captured().is_some();
        let mut cells = vec![cell];
        let mut next = 0;
        while let Some(&from) = cells.get(next) {
            next += 1;
            for (id, portal) in self.interior.portals_of(Some(from)) {
                let Some(Some(into)) = portal.beyond(Some(from)) else {
                    continue;
                };
                if self.share_of_image(portal, eye, self.options.near) > 0.0 {
                    if self.has_views(portal) {
                        with(from, id, into);
                    }
                } else if !is_captured && !cells.contains(&into) {
                    cells.push(into);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::interior::{PortalFill, WalkOptions};
    use calibrate::{Lens, View};
    use datasets::house::{HouseOptions, house};
    use glam::DVec2;
    use proxy::interior::Contents;

    #[test]
    fn what_fails_ahead_is_an_error_of_the_next_frame_and_of_no_other() {
        let options = HouseOptions {
            rooms: 2,
            ..HouseOptions::default()
        };
        let house = house(&options).unwrap();
        let (contents, _) = Contents::new(&house.interior, &house.model).unwrap();
        let view = View {
            lens: Lens::pinhole(DVec2::splat(20.0), DVec2::splat(8.0)),
            width: 16,
            height: 16,
            camera_from_world: calibrate::Rigid3::IDENTITY,
        };
        let mut options = WalkOptions::default();
        options.library.ldi_views = Some(1);
        options.library.size = [8, 8];
        std::thread::scope(|scope| {
            let mut walk = Walk::new(&house.interior, &contents, &house.model, options);
            walk.make_ahead(scope).unwrap();
            let background = walk.background.as_mut().unwrap();
            background.ask(0, |_| panic!("no way"));
            let failed = loop {
                match walk.draw(&view, PortalFill::Ldi) {
                    Ok(_) => std::thread::yield_now(),
                    Err(error) => break error,
                }
            };
            assert_eq!(failed, WalkError::Ahead("no way".to_owned()));
            assert!(walk.draw(&view, PortalFill::Ldi).is_ok());
        });
    }
}
