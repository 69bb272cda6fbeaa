//! A frame of a walk: the viewer's cell as geometry, what is beyond its portals as one chooses.
//!
//! 1. Every portal that is visible and not near is filled out of reference images, in the pixels
//!    where one sees through it. Beyond one that is near the next cell is geometry, and its portals are
//!    filled in their turn: so crossing a doorway changes nothing.
//! 2. The triangles of the viewer's cell, and of what is beyond portals that are near, are met,
//!    but for those that images or other triangles hide.
//! 3. A pixel shows the cell's own surface where that is before the portal, else the fill, else
//!    whatever surface there is. Only what is shown is coloured. Where geometry is mixed in, a
//!    pixel that the images leave open fades away with its geometry, so that nothing pops.

mod ahead;
mod asked;
mod compose;
mod files;
mod filled;
mod openings;

use super::background::Background;
use super::recipe::Made;
use super::{
    CellGeometry, Library, LibraryOptions, Painter, Pinhole, PinholeError, PortalFill, Splat,
    Target,
};
use crate::RenderError;
use crate::ldi::FreeOptions;
use asked::Asked;
use calibrate::View;
use filled::Filled;
use glam::DVec3;
use proxy::interior::{
    CellId, Contents, Interior, Pass, PortalId, Region, Visibility, VisibleCell, visible,
};
use proxy::mesh::Model;
use rayon::prelude::*;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// What can be chosen about a walk.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WalkOptions {
    /// Reference images.
    pub library: LibraryOptions,
    /// How large samples of images are drawn.
    pub splat: Splat,
    /// How LDIs are drawn.
    pub ldi: FreeOptions,
    /// Whether columns of an LDI that are out of sight are drawn, too. The pictures are the same.
    pub whole_ldis: bool,
    /// Nearer to a portal than this, in radii of its semicircle, geometry is mixed into what is
    /// beyond, and from five sixths of it on it is alone: from there one sees farther aside than
    /// the images do.
    pub near: f64,
    /// The same of LDIs that are made of photos: those show what is aside from wherever they were
    /// taken.
    pub near_photos: f64,
    /// Whether all of a visible cell is drawn, as the papers do, not only what of it is in sight.
    /// The pictures are the same.
    pub whole_cells: bool,
    /// Whether what no image shows keeps the last picture's colour. Then a picture depends on
    /// the one before it.
    pub persist: bool,
}

impl Default for WalkOptions {
    fn default() -> Self {
        Self {
            library: LibraryOptions::default(),
            splat: Splat::default(),
            ldi: FreeOptions::default(),
            whole_ldis: false,
            near: 1.0,
            near_photos: 0.55,
            whole_cells: false,
            persist: false,
        }
    }
}

/// What a frame took and what was left out.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameCost {
    /// Where the viewer was found.
    pub cell: Option<CellId>,
    /// Cells that one sees, drawn as geometry or in images.
    pub visible_cells: usize,
    /// Portals of the viewer's cell that one sees through to a cell.
    pub portals: usize,
    /// Portals filled with images, even if mixed with geometry: those among them, and those seen through one
    /// that is near.
    pub filled: usize,
    /// Triangles of the cells that are drawn as geometry, and of what is in none; of a capture all. Each counts as often
    /// as it is drawn: for each portal through which it is, and for each cell that it lies in.
    pub triangles_in_cells: usize,
    /// Those of them in runs that are in sight.
    pub triangles_tried: usize,
    /// Those of them that touch a pixel's centre where nothing was known to hide them; a graphics device
    /// does not tell.
    pub triangles_met: Option<usize>,
    /// Samples of images that were drawn, or pixels of textures.
    pub samples: usize,
    /// Samples of LDIs in columns that were clipped away.
    pub samples_clipped: usize,
    /// Pixels of portals that nothing was drawn in. Where images leave open what geometry is mixed into, a pixel
    /// counts as far as images are in it, which is how far it is transparent.
    pub holes: usize,
    /// Reference images made for this frame.
    pub references_made: usize,
    /// Layered depth images made for this frame.
    pub ldis_made: usize,
    /// Those read from files for this frame.
    pub ldis_read: usize,
    /// Those that had been made ahead of need, and came in with this frame.
    pub ldis_ahead: usize,
    /// Making images and LDIs, reading LDIs, and waiting for one.
    pub references: Duration,
    /// Of that, waiting for an LDI that was being made ahead of need.
    pub waited: Duration,
    /// Finding what is visible.
    pub visibility: Duration,
    /// Meeting triangles.
    pub geometry: Duration,
    /// Filling portals.
    pub fill: Duration,
    /// Colouring and composing.
    pub shade: Duration,
}

impl FrameCost {
    /// Drawing the frame: all of it but [`Self::references`].
    pub fn time(&self) -> Duration {
        self.visibility + self.geometry + self.fill + self.shade
    }

    /// All of the frame: how long one stands still for it.
    pub fn with_making(&self) -> Duration {
        self.time() + self.references
    }
}

/// Why a view was not drawn.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum WalkError {
    /// A view that interiors are not drawn for.
    #[error(transparent)]
    View(#[from] PinholeError),
    /// The photos' engine's.
    #[error(transparent)]
    Photos(#[from] RenderError),
    /// What a panic said of a layered depth image that was being made ahead of need.
    #[error("a layered depth image could not be made ahead: {0}")]
    Ahead(String),
}

/// A walker through an interior, and what is kept between frames.
#[derive(Debug)]
pub struct Walk<'a> {
    interior: &'a Interior,
    contents: &'a Contents,
    model: &'a Model,
    geometry: Arc<CellGeometry>,
    library: Library,
    options: WalkOptions,
    painter: Painter,
    background: Option<Background<'a, Option<Made>>>,
    /// Where the last frame was drawn from that looked ahead; no picture depends on it.
    last_eye: Option<DVec3>,
    filled: Target,
    /// What is mixed into that.
    mixed_in: Target,
    /// One portal's, where one is seen before another.
    apart: Target,
    /// By pixel: one more than the place in the frame's list of fills; 0 for none. Of a frame without any nothing.
    owners: Vec<u16>,
    /// See [`Self::find_floor`].
    floor: Vec<f32>,
    picture: Target,
    /// By place of the library, of images, then of LDIs: whether the walk needed it.
    is_used: Vec<bool>,
}

impl<'a> Walk<'a> {
    /// A walk drawn by the CPU; reference images are made when they are needed.
    pub fn new(
        interior: &'a Interior,
        contents: &'a Contents,
        model: &'a Model,
        options: WalkOptions,
    ) -> Self {
        Self::with(Painter::cpu(), interior, contents, model, options)
    }

    /// A walk whose geometry a painter draws that was opened for the model. Reference images are
    /// the CPU's all the same.
    pub fn with(
        painter: Painter,
        interior: &'a Interior,
        contents: &'a Contents,
        model: &'a Model,
        mut options: WalkOptions,
    ) -> Self {
        let captured = painter.captured();
        options.library = options.library.with_photos(captured);
        let library = Library::new(interior, contents, &options.library);
        Self {
            interior,
            contents,
            model,
            geometry: Arc::new(match captured {
                Some(_) => CellGeometry::without_cells(model, contents),
                None => CellGeometry::new(model, contents),
            }),
            is_used: vec![false; 2 * library.len()],
            library,
            options,
            painter,
            background: None,
            last_eye: None,
            filled: Target::default(),
            mixed_in: Target::default(),
            apart: Target::default(),
            owners: Vec::new(),
            floor: Vec::new(),
            picture: Target::default(),
        }
    }

    /// The reference images.
    pub fn library(&self) -> &Library {
        &self.library
    }

    /// What draws the geometry.
    pub fn painter(&self) -> &Painter {
        &self.painter
    }

    /// See [`Self::painter`].
    pub fn painter_mut(&mut self) -> &mut Painter {
        &mut self.painter
    }

    /// Begins anew, with the reference images that there are: the last picture is forgotten, and
    /// which images were used.
    pub fn begin(&mut self) {
        self.picture = Target::default();
        self.last_eye = None;
        self.is_used.fill(false);
    }

    /// How many reference images and LDIs were used since the beginning.
    pub fn references_used(&self) -> usize {
        self.is_used.iter().filter(|is| **is).count()
    }

    /// The last frame drawn.
    pub fn picture(&self) -> &Target {
        &self.picture
    }

    /// Draws a view. Where the viewer is in no cell, or on a portal's plane, all that may be
    /// visible is geometry.
    ///
    /// # Errors
    /// A view that interiors are not drawn for; where photos colour it, their engine's.
    pub fn draw(&mut self, view: &View, fill: PortalFill) -> Result<FrameCost, WalkError> {
        let camera = Pinhole::new(view)?;
        let mut cost = FrameCost::default();
        // 1. What is visible.
        let start = Instant::now();
        let eye = camera.center;
        let cell = self.contents.locate(self.interior, eye);
        let visibility = match fill {
            PortalFill::Whole => all_cells(self.interior, &Region::ALL),
            _ => visible(self.interior, cell, view),
        };
        cost.cell = cell;
        cost.visible_cells = visibility.cells.len();
        let passes = &visibility.passes;
        let is_open = |pass: &&Pass| pass.depth == 0 && pass.into.is_some();
        // Convex pieces of one portal follow one another.
        let mut own: Vec<PortalId> = passes.iter().filter(is_open).map(|p| p.portal).collect();
        own.dedup();
        cost.portals = own.len();
        // Where there are too many portals to tell what one sees through them, all is geometry.
        let is_known = !passes.is_empty() || visibility.cells.len() <= 1;
        let has_images = fill.shows_images() && cell.is_some() && is_known;
        let (openings, mut fills) = match has_images {
            true => self.fills(fill, cell, passes, &camera),
            false => Default::default(),
        };
        cost.filled = fills.len();
        cost.visibility = start.elapsed();
        // 2. Fills.
        let start = Instant::now();
        let images = self.images(fill, &fills, eye, &mut cost)?;
        for (f, images) in fills.iter_mut().zip(&images) {
            if images.make_nothing() {
                // Geometry rather than a hole.
                f.share = 0.0;
            }
        }
        if fill == PortalFill::Ldi {
            self.ask_ahead(&fills, eye)?;
        }
        cost.references = start.elapsed();
        let start = Instant::now();
        let apart = self.share_out(&openings, &fills, &camera);
        self.fill(fill, &fills, &images, &camera, apart, &mut cost);
        cost.fill = start.elapsed();
        // 3. Triangles.
        let start = Instant::now();
        let may_skip = fill != PortalFill::Whole && !self.options.whole_cells;
        let asked = Asked {
            interior: self.interior,
            geometry: &self.geometry,
            is_captured: self.painter.captured().is_some(),
            may_skip,
            view: Region::of(view),
            camera: &camera,
        };
        let windows = match has_images {
            true => asked.runs_beside(&fills, &openings, &visibility),
            false => asked.runs(visibility.clone()),
        };
        cost.triangles_in_cells = windows.iter().map(|(runs, _)| runs.asked).sum();
        let mut floor = std::mem::take(&mut self.floor);
        self.find_floor(&fills, &camera, &mut floor);
        let met = self.painter.meet(
            self.model,
            &windows,
            &camera,
            may_skip.then_some(&floor[..]),
        );
        cost.triangles_tried = met.tried;
        cost.triangles_met = met.touching;
        cost.geometry = start.elapsed();
        // 4. Colours.
        let start = Instant::now();
        cost.holes = self.compose(view, &camera, &fills, &floor)?;
        self.floor = floor;
        cost.shade = start.elapsed();
        Ok(cost)
    }

    /// By pixel, the inverse depth of the plane that hides what is beyond it: where images fill a
    /// portal and nothing is mixed in; else 0. Empty where no pixel has one.
    fn find_floor(&self, fills: &[Filled<'_>], camera: &Pinhole, floor: &mut Vec<f32>) {
        let Some(last) = fills.iter().rposition(|f| f.share >= 1.0) else {
            return floor.clear();
        };
        let width = camera.width as usize;
        let (owners, filled) = (&self.owners, &self.filled);
        let of_pixel = |x: usize, y: usize| {
            let pixel = y * width + x;
            let owner = usize::from(owners[pixel]);
            if owner == 0 || owner > last + 1 {
                return 0.0;
            }
            let f = &fills[owner - 1];
            if f.leaves_open(filled.color[pixel][3]) {
                return 0.0;
            }
            let plane = f.plane.inverse_depth(camera.ray(x as u32, y as u32));
            match f.share >= 1.0 && f.plane.is_ahead() && plane > 0.0 && plane.is_finite() {
                true => plane as f32,
                false => 0.0,
            }
        };
        floor.resize(owners.len(), 0.0);
        let rows = floor.par_chunks_mut(width).enumerate();
        rows.for_each(|(y, floor)| {
            let pixels = floor.iter_mut().enumerate();
            pixels.for_each(|(x, floor)| *floor = of_pixel(x, y));
        });
    }
}

/// All cells, in one region.
pub(super) fn all_cells(interior: &Interior, region: &Region) -> Visibility {
    let cells = (0..interior.cells.len() as u32).map(|id| VisibleCell {
        cell: CellId(id),
        regions: vec![region.clone()],
    });
    Visibility {
        cells: cells.collect(),
        passes: Vec::new(),
    }
}

/// The same cells, seen everywhere.
fn everywhere(mut visibility: Visibility) -> Visibility {
    for cell in &mut visibility.cells {
        cell.regions = vec![Region::ALL];
    }
    visibility
}
