//! LDIs that are kept as files.

use super::Walk;
use crate::RenderError;
use crate::interior::PortalLdi;
use std::path::Path;
use std::sync::Arc;

impl Walk<'_> {
    /// From now on LDIs that have a file in this folder are read from it
    /// ([`Library::use_files`](crate::interior::Library::use_files)). Pictures are the same where the files are those
    /// that a walk with the same options wrote, of the same interior, model and photos.
    pub fn use_ldi_files(&mut self, folder: &Path) {
        self.library.use_files(folder, self.interior);
    }

    /// Makes the LDI of a place, to be kept as a file; nothing where its images make none. What was made for
    /// other sides is let go.
    ///
    /// # Errors
    /// The photos' engine's.
    pub fn make_ldi(&mut self, place: usize) -> Result<Arc<Option<PortalLdi>>, RenderError> {
        let (interior, model, geometry) = (self.interior, self.model, &self.geometry);
        let captured = self.painter.captured_mut();
        self.library
            .make_alone(place, interior, model, geometry, captured)
    }
}
