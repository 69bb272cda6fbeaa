//! An LDI of views, in two steps that any thread may do.

use super::{PortalLdi, Reference};
use crate::ldi::{ConstructOptions, construct_around};
use proxy::interior::SemicircleView;
use std::sync::Arc;

/// What an LDI is made of.
#[derive(Debug)]
pub(super) struct Recipe {
    /// The place before the portal that it is for.
    pub(super) place: usize,
    /// The view that is its central image.
    pub(super) center: usize,
    /// Of its views: their numbers and places, from left to right.
    pub(super) views: Vec<(usize, SemicircleView)>,
    /// What they see, where that is known.
    pub(super) images: Vec<Option<Arc<Reference>>>,
    pub(super) size: [u32; 2],
    pub(super) options: ConstructOptions,
}

/// An LDI that was made.
#[derive(Debug)]
pub(super) struct Made {
    /// The place before the portal that it is for.
    pub(super) place: usize,
    /// Nothing where its images make none.
    pub(super) ldi: Option<PortalLdi>,
    /// Images that were made for it, by place.
    pub(super) images: Vec<(usize, Arc<Reference>)>,
}

impl Recipe {
    /// The first of its views whose image is not known.
    pub(super) fn missing(&self) -> Option<usize> {
        let mut views = self.views.iter().zip(&self.images);
        views.find_map(|((number, _), image)| image.is_none().then_some(*number))
    }

    /// The LDI; `image` makes what is missing of its images.
    ///
    /// # Errors
    /// Those of `image`.
    pub(super) fn make<E>(
        self,
        mut image: impl FnMut(&SemicircleView, [u32; 2]) -> Result<Reference, E>,
    ) -> Result<Made, E> {
        let mut made = Vec::new();
        let mut all = Vec::new();
        for ((number, view), known) in self.views.iter().zip(self.images) {
            all.push(match known {
                Some(image) => image,
                None => {
                    let image = Arc::new(image(view, self.size)?);
                    made.push((*number, image.clone()));
                    image
                }
            });
        }
        let images: Vec<&Reference> = all.iter().map(|image| &**image).collect();
        let center = self.views.iter().position(|(i, _)| *i == self.center);
        let center = center.unwrap_or(images.len() / 2);
        let constructed = construct_around(&images, center, &self.options);
        Ok(Made {
            place: self.place,
            ldi: constructed.ok().map(|made| PortalLdi::new(made.ldi)),
            images: made,
        })
    }
}
