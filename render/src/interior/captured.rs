//! Surfaces in a walk that photos show: coloured by the lumigraph, not by the model.
//!
//! What a pixel sees is found as for any model: which triangle, and how far. Only its colour comes
//! from the photos, by the blending field of Buehler et al. 2001 over those triangles. So cells,
//! portals and images before them compose as they do with models, and images before portals are made of
//! photos, too.

use super::{DepthMaps, Pinhole, Raster, Target};
use crate::engine::Engine;
use crate::frame::Frame;
use crate::lumigraph::Lumigraph;
use crate::options::{FieldOptions, Method};
use crate::surface::{FacetMap, NO_FACET};
use crate::{PhotoError, RenderError};
use calibrate::View;
use proxy::depth::DepthNoise;
use proxy::interior::{Contents, Interior};
use proxy::mesh::Model;
use rayon::prelude::*;
use std::ops::Range;

/// The photos of an interior's cells, and the engine that draws from them.
#[derive(Debug)]
pub struct Captured {
    lumigraph: Lumigraph,
    engine: Engine,
    options: FieldOptions,
    method: Method,
    /// By triangle: whether photos show it.
    is_shown: Vec<bool>,
    /// Triangles that stand for what is far away: where no photo shows them, nothing is there.
    backdrop: Range<u32>,
    /// Photos that cannot be decoded.
    gone: Vec<usize>,
    notes: Vec<String>,
    depth_maps: Option<DepthMaps>,
    /// By triangle: its facet in the frame that is drawn; all [`NO_FACET`] between frames.
    facet_of_triangle: Vec<u32>,
}

impl Captured {
    /// Photos that show the triangles of all cells that are scenes, and where there are such, those of no
    /// cell. The lumigraph's proxy is the model's mesh. `backdrop` are triangles for what is behind all
    /// surfaces: where no photo shows them, nothing is drawn.
    ///
    /// # Panics
    /// If the options fail [`FieldOptions::check`].
    pub fn new(
        lumigraph: Lumigraph,
        engine: Engine,
        options: FieldOptions,
        method: Method,
        interior: &Interior,
        contents: &Contents,
        model: &Model,
        backdrop: Range<u32>,
    ) -> Self {
        assert_eq!(options.check(), Ok(()));
        let mut is_shown = vec![false; model.mesh.triangles.len()];
        let cells = interior.cells.iter().zip(&contents.triangles);
        let scenes = cells.filter(|(cell, _)| cell.content.scene().is_some());
        let scenes: Vec<&Vec<u32>> = scenes.map(|(_, triangles)| triangles).collect();
        let elsewhere = match scenes.is_empty() {
            true => &[][..],
            false => &contents.elsewhere,
        };
        for i in scenes.into_iter().flatten().chain(elsewhere) {
            is_shown[*i as usize] = true;
        }
        Self {
            facet_of_triangle: vec![NO_FACET; is_shown.len()],
            lumigraph,
            engine,
            options,
            method,
            is_shown,
            backdrop,
            gone: Vec::new(),
            notes: Vec::new(),
            depth_maps: None,
        }
    }

    /// With the photos' depth maps, so that LDIs can be made of the photos themselves.
    pub fn with_depth_maps(mut self, depth_maps: DepthMaps) -> Self {
        self.depth_maps = Some(depth_maps);
        self
    }

    /// The photos' depth maps, if they were given.
    pub(super) fn depth_maps(&self) -> Option<&DepthMaps> {
        self.depth_maps.as_ref()
    }

    /// How noisy the depth maps are; nothing without any, or where they cannot be used, with a note.
    pub(super) fn depth_noise(&mut self) -> Option<DepthNoise> {
        let sources = &self.lumigraph.sources;
        let noise = self.depth_maps.as_ref()?;
        let noise = noise.noise(|i| sources[i].view.clone());
        match noise {
            Ok(noise) => Some(noise),
            Err(error) => {
                let why = "LDIs are made of views: the depth maps cannot be used";
                self.note(format!("{why}: {error}"));
                None
            }
        }
    }

    /// What is drawn from.
    pub fn lumigraph(&self) -> &Lumigraph {
        &self.lumigraph
    }

    /// What draws.
    pub fn engine(&self) -> &Engine {
        &self.engine
    }

    /// What could not be drawn as asked, for people; each once.
    pub fn notes(&self) -> impl Iterator<Item = &String> {
        self.notes.iter().chain(self.engine.notes())
    }

    /// Finds out what each photo sees of the surface, all at once; else it is found photo by photo
    /// when it is needed.
    pub fn prepare(&self) {
        if let Some(visibility) = &self.lumigraph.visibility {
            let photos = (0..self.lumigraph.sources.len()).into_par_iter();
            photos.for_each(|i| {
                visibility.map(i);
            });
        }
    }

    /// Colours what was met, but for pixels that `is_wanted` declines: from photos where they show
    /// it, else by the model.
    ///
    /// # Errors
    /// The engine's; but photos that cannot be decoded are left out from then on, with a note.
    pub(super) fn shade(
        &mut self,
        model: &Model,
        raster: &Raster,
        view: &View,
        camera: &Pinhole,
        target: &mut Target,
        is_wanted: impl Fn(usize, f32) -> bool + Sync,
    ) -> Result<(), RenderError> {
        // 1. The facets that are seen.
        let count = target.color.len();
        let mut facet_of = vec![NO_FACET; count];
        let mut seen = Vec::new();
        for (pixel, facet) in facet_of.iter_mut().enumerate() {
            let Some((idx, inverse_depth)) = raster.at(pixel) else {
                continue;
            };
            if !self.is_shown[idx as usize] || !is_wanted(pixel, inverse_depth) {
                continue;
            }
            let known = &mut self.facet_of_triangle[idx as usize];
            if *known == NO_FACET {
                *known = seen.len() as u32;
                seen.push(idx);
            }
            *facet = *known;
        }
        for idx in &seen {
            self.facet_of_triangle[*idx as usize] = NO_FACET;
        }
        if seen.is_empty() {
            raster.shade(model, camera, target, is_wanted);
            return Ok(());
        }
        let plane = |idx: &u32| {
            let corners = model.mesh.corners(*idx as usize);
            FacetMap::plane_through(corners.map(|p| camera.point(p)))
        };
        let planes: Vec<_> = seen.par_iter().map(plane).collect();
        // 2. What the photos show.
        let map = FacetMap::of_pixels(planes, facet_of, view);
        let picture = loop {
            let frame = Frame::over(
                &self.lumigraph,
                view.clone(),
                self.options,
                &self.gone,
                map.clone(),
            );
            match self.engine.render(&frame, self.method) {
                Ok(picture) => break picture,
                Err(RenderError::Photo(error)) => self.leave_out(error)?,
                Err(error) => return Err(error),
            }
        };
        // 3. The model where they show nothing, or not all.
        let shown = |pixel: usize| picture.as_raw()[4 * pixel + 3];
        let is_backdrop =
            |pixel: usize| matches!(raster.at(pixel), Some((i, _)) if self.backdrop.contains(&i));
        raster.shade(model, camera, target, |pixel, inverse_depth| {
            let shown = shown(pixel) == u8::MAX || is_backdrop(pixel);
            !shown && is_wanted(pixel, inverse_depth)
        });
        for (pixel, color) in target.color.iter_mut().enumerate() {
            let alpha = shown(pixel);
            if alpha == 0 {
                continue;
            }
            let photo = &picture.as_raw()[4 * pixel..4 * pixel + 3];
            let over = |k: usize| mixed(color[k], photo[k], alpha);
            *color = match is_backdrop(pixel) {
                true => [photo[0], photo[1], photo[2], alpha],
                false => [over(0), over(1), over(2), u8::MAX],
            };
            target.inverse_depth[pixel] = raster.at(pixel).map_or(0.0, |(_, s)| s);
        }
        Ok(())
    }

    /// Says something to people, once.
    pub(super) fn note(&mut self, note: String) {
        if !self.notes.contains(&note) {
            self.notes.push(note);
        }
    }

    /// Whether a photo was found to be of no use.
    pub(super) fn is_left_out(&self, source_idx: usize) -> bool {
        self.gone.contains(&source_idx)
    }

    /// Goes on without a photo; with the last one it is an error.
    pub(super) fn leave_out(&mut self, error: PhotoError) -> Result<(), RenderError> {
        let sources = &self.lumigraph.sources;
        if self.gone.contains(&error.source_idx) || self.gone.len() + 1 >= sources.len() {
            return Err(RenderError::Photo(error));
        }
        let name = &sources[error.source_idx].name;
        self.notes
            .push(format!("photo {name} is left out: {error}"));
        self.gone.push(error.source_idx);
        Ok(())
    }
}

/// A colour over another, rounded.
fn mixed(below: u8, above: u8, alpha: u8) -> u8 {
    let (below, above, alpha) = (u32::from(below), u32::from(above), u32::from(alpha));
    ((above * alpha + below * (255 - alpha) + 127) / 255) as u8
}
