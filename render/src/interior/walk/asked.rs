//! The triangles that a frame asks for.

use super::{everywhere, filled::Filled};
use crate::interior::{CellGeometry, Pinhole, Runs, Window};
use proxy::interior::{CellId, Interior, Pass, Region, Visibility, visible_through};

/// What is asked of an interior's geometry.
pub(super) struct Asked<'g> {
    pub(super) interior: &'g Interior,
    pub(super) geometry: &'g CellGeometry,
    /// Of a capture walls may be open where no portal was found, so that all cells may be in sight.
    pub(super) is_captured: bool,
    /// Whether what is out of sight is passed over.
    pub(super) may_skip: bool,
    /// What the image shows.
    pub(super) view: Region,
    pub(super) camera: &'g Pinhole,
}

impl<'g> Asked<'g> {
    /// All that is visible.
    pub(super) fn runs(&self, visibility: Visibility) -> Vec<(Runs<'g>, Window)> {
        let visibility = match self.is_captured {
            true => Visibility::default(),
            false => visibility,
        };
        let whole = Window::whole(self.camera.width, self.camera.height);
        vec![(self.seen(visibility), whole)]
    }

    /// The viewer's own cell, and what is beyond portals that images do not fill, or not alone; of a
    /// capture all.
    pub(super) fn runs_beside(
        &self,
        fills: &[Filled<'_>],
        open: &[(&Pass, CellId)],
        visibility: &Visibility,
    ) -> Vec<(Runs<'g>, Window)> {
        let mut windows = self.runs(Visibility {
            cells: visibility.cells.first().into_iter().cloned().collect(),
            passes: Vec::new(),
        });
        if self.is_captured {
            return windows;
        }
        let eye = self.camera.center;
        for &(pass, into) in open {
            let (id, region) = (pass.portal, &pass.region);
            let is_filled = |f: &Filled<'_>| std::ptr::eq(f.pass, pass) && f.share >= 1.0;
            if !fills.iter().any(is_filled) {
                let beyond = visible_through(self.interior, id, into, eye, region);
                windows.push((self.seen(beyond), Window::of(region, self.camera)));
            }
        }
        windows
    }

    fn seen(&self, visibility: Visibility) -> Runs<'g> {
        let eye = self.camera.center;
        match self.may_skip {
            true => self.geometry.seen(eye, &visibility, &self.view),
            false => self
                .geometry
                .seen(eye, &everywhere(visibility), &Region::ALL),
        }
    }
}
