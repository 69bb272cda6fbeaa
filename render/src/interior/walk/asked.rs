//! The triangles that a frame asks for.

use super::everywhere;
use super::filled::Filled;
use super::openings::Opening;
use crate::interior::{CellGeometry, Pinhole, Runs, Window};
use proxy::interior::{Interior, Region, Visibility, VisibleCell, visible_through};

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
        openings: &[Opening<'_>],
        visibility: &Visibility,
    ) -> Vec<(Runs<'g>, Window)> {
        let mut windows = self.runs(only(visibility.cells.first().cloned()));
        if self.is_captured {
            return windows;
        }
        let eye = self.camera.center;
        for opening in openings {
            let (id, regions) = (opening.pass.portal, opening.regions.iter());
            let share = opening.fill.map_or(0.0, |k| fills[k].share);
            let Some(into) = opening.pass.into.filter(|_| share < 1.0) else {
                continue;
            };
            let beyond = match opening.is_entered() {
                // What is beyond its own portals is theirs to say.
                true => only(Some(VisibleCell {
                    cell: into,
                    regions: regions.copied().cloned().collect(),
                })),
                false => regions
                    .map(|region| visible_through(self.interior, id, into, eye, region))
                    .reduce(together)
                    .unwrap_or_default(),
            };
            windows.push((self.seen(beyond), opening.window(self.camera)));
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

/// The cells that either has, each where it is seen in either.
fn together(mut visibility: Visibility, more: Visibility) -> Visibility {
    for cell in more.cells {
        let mut known = visibility.cells.iter_mut();
        match known.find(|known| known.cell == cell.cell) {
            Some(known) => known.regions.extend(cell.regions),
            None => visibility.cells.push(cell),
        }
    }
    visibility
}

/// One cell, or none.
fn only(cell: Option<VisibleCell>) -> Visibility {
    Visibility {
        cells: cell.into_iter().collect(),
        passes: Vec::new(),
    }
}
