//! A frame of a walk: the viewer's cell as geometry, what is beyond its portals as one chooses.
//!
//! 1. The triangles of the viewer's cell, and of what is beyond portals that are near, are met.
//! 2. Every other portal that is visible is filled out of reference images, in the pixels where
//!    one sees through it.
//! 3. A pixel shows the cell's own surface where that is before the portal, else the fill, else
//!    whatever surface there is. Only what is shown is coloured. Where geometry is mixed in, a
//!    pixel that the images leave open fades away with its geometry, so that nothing pops.

use super::reference::plane_of;
use super::{
    Beyond, CellGeometry, Library, LibraryOptions, Painter, Pinhole, PinholeError, PortalFill,
    PortalLdi, Reference, Runs, Splat, Target, Window, texture, warp,
};
use crate::RenderError;
use crate::ldi::{Clipped, Free, FreeOptions, free};
use calibrate::View;
use glam::DVec3;
use proxy::interior::{
    CellId, Contents, Interior, Pass, Portal, Region, Visibility, VisibleCell, visible,
    visible_through,
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
    /// beyond, and from two thirds of it on it is alone: from there one sees farther aside than
    /// the images do.
    pub near: f64,
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
            whole_cells: false,
            persist: false,
        }
    }
}

/// Where geometry is alone, in shares of where it begins to be mixed in.
const ALONE: f64 = 2.0 / 3.0;

/// From where on images are shown beyond a capture's other portals once one has come through one, in
/// radii of its semicircle: whoever changes cells sees all of it as geometry, before and after.
const ENTERED: f64 = 0.25;

/// What a frame took and what was left out.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameCost {
    /// Where the viewer was found.
    pub cell: Option<CellId>,
    /// Cells that one sees, drawn as geometry or in images.
    pub visible_cells: usize,
    /// Portals of the viewer's cell that one sees through to a cell.
    pub portals: usize,
    /// Those among them filled with images, even if mixed with geometry.
    pub filled: usize,
    /// Triangles of the cells that are drawn as geometry.
    pub triangles_in_cells: usize,
    /// Those of them in runs that are in sight.
    pub triangles_tried: usize,
    /// Those of them that touch a pixel's centre; a graphics device does not tell.
    pub triangles_met: Option<usize>,
    /// Samples of images that were drawn, or pixels of textures.
    pub samples: usize,
    /// Samples of LDIs in columns that were clipped away.
    pub samples_clipped: usize,
    /// Pixels of portals that nothing was drawn in.
    pub holes: usize,
    /// Reference images made for this frame.
    pub references_made: usize,
    /// Making them.
    pub references: Duration,
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
    /// All of the frame but making reference images.
    pub fn time(&self) -> Duration {
        self.visibility + self.geometry + self.fill + self.shade
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
}

/// A walker through an interior, and what is kept between frames.
#[derive(Debug)]
pub struct Walk<'a> {
    interior: &'a Interior,
    contents: &'a Contents,
    model: &'a Model,
    geometry: CellGeometry,
    library: Library,
    options: WalkOptions,
    painter: Painter,
    filled: Target,
    /// Memory of the last LDI's drawing.
    scratch: Free,
    /// By pixel: one more than the place in the frame's list of fills; 0 for none.
    owners: Vec<u16>,
    picture: Target,
    /// By place of the library, then by side: whether the walk needed its image or LDI.
    is_used: Vec<bool>,
}

/// What fills a portal.
enum Images {
    /// Reference images, the nearest first.
    References(Vec<Arc<Reference>>),
    /// Nothing where there are no images, or they make none.
    Ldi(Arc<Option<PortalLdi>>),
}

/// What a frame's portals are filled with.
struct Needed {
    of_fills: Vec<Images>,
    /// Reference images made for it.
    made: usize,
}

/// A portal that is filled with images in this frame.
struct Filled<'p> {
    pass: &'p Pass,
    into: CellId,
    plane: Beyond,
    window: Window,
    /// Of the image; the rest is geometry.
    share: f64,
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
        options: WalkOptions,
    ) -> Self {
        let library = Library::new(interior, &options.library);
        Self {
            interior,
            contents,
            model,
            geometry: CellGeometry::new(model, contents),
            is_used: vec![false; library.len() + library.side_count()],
            library,
            options,
            painter,
            filled: Target::default(),
            scratch: Free::default(),
            owners: Vec::new(),
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
        // Of a capture walls may be open where no portal was found, so that all cells may be in sight.
        let is_captured = self.painter.captured().is_some() && fill != PortalFill::Whole;
        let in_view = is_captured.then(|| all_cells(self.interior, &Region::of(view)));
        let in_sight = |visibility: Visibility| match self.options.whole_cells {
            true => everywhere(visibility),
            false => visibility,
        };
        cost.cell = cell;
        cost.visible_cells = visibility.cells.len();
        let own = visibility.passes.iter().filter(|pass| pass.depth == 0);
        let open: Vec<(&Pass, CellId)> = own.filter_map(|p| Some((p, p.into?))).collect();
        cost.portals = open.len();
        let geometry = &self.geometry;
        let mut windows: Vec<(Runs<'_>, Window)> = Vec::new();
        let mut fills: Vec<Filled<'_>> = Vec::new();
        let whole = Window::whole(camera.width, camera.height);
        match cell {
            Some(_) if fill.references() > 0 || fill == PortalFill::Ldi => {
                let alone = in_sight(Visibility {
                    cells: visibility.cells.first().into_iter().cloned().collect(),
                    passes: Vec::new(),
                });
                let own = in_view.as_ref().unwrap_or(&alone);
                windows.push((geometry.seen(eye, own), whole));
                let entered = match is_captured {
                    true => self.share_entered(cell, eye),
                    false => 1.0,
                };
                for &(pass, into) in &open {
                    let portal = self.interior.portal(pass.portal);
                    let share = entered * self.share_of_image(portal, eye);
                    let window = Window::of(&pass.region, &camera);
                    if share < 1.0 && !is_captured {
                        let (id, region) = (pass.portal, &pass.region);
                        let beyond = visible_through(self.interior, id, into, eye, region);
                        let runs = geometry.seen(eye, &in_sight(beyond));
                        windows.push((runs, window.clone()));
                    }
                    if share > 0.0 && fills.len() < usize::from(u16::MAX) {
                        fills.push(Filled {
                            pass,
                            into,
                            plane: plane_of(&camera, portal, Some(into)),
                            window,
                            share,
                        });
                    }
                }
            }
            _ => {
                let all = in_view.unwrap_or_else(|| in_sight(visibility.clone()));
                windows.push((geometry.seen(eye, &all), whole));
            }
        }
        cost.filled = fills.len();
        cost.visibility = start.elapsed();
        // 2. Triangles.
        let start = Instant::now();
        for (runs, _) in &windows {
            cost.triangles_in_cells += runs.asked;
            cost.triangles_tried += runs.count();
        }
        cost.triangles_met = self.painter.meet(self.model, &windows, &camera);
        cost.geometry = start.elapsed();
        // 3. Fills.
        let start = Instant::now();
        let images = self.images(fill, &fills, eye)?;
        cost.references_made = images.made;
        cost.references = start.elapsed();
        let start = Instant::now();
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
                                texture(reference, &f.plane, &camera, &f.window, into)
                            }
                            _ => warp(reference, &camera, &f.window, self.options.splat, into),
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
                        false => portal.tree.columns(ldi, &camera, &f.window, reach),
                    };
                    let scratch = &mut self.scratch;
                    let took = free(ldi, &columns, &camera, &f.window, options, scratch, into);
                    cost.samples += took.drawn;
                    if took.pixels > 0 {
                        cost.samples_clipped += ldi.len() - took.samples;
                    }
                }
            }
        }
        cost.fill = start.elapsed();
        // 4. Colours.
        let start = Instant::now();
        cost.holes = self.compose(view, &camera, &fills)?;
        cost.shade = start.elapsed();
        Ok(cost)
    }

    /// What portals are filled with, made now if it is not in memory.
    fn images(
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
    fn share_of_image(&self, portal: &Portal, eye: DVec3) -> f64 {
        let far = self.options.near * portal.semicircle_radius(self.interior.up);
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

    /// The picture; how many pixels of portals nothing was drawn in.
    fn compose(
        &mut self,
        view: &View,
        camera: &Pinhole,
        fills: &[Filled<'_>],
    ) -> Result<usize, RenderError> {
        let width = camera.width as usize;
        let (owners, filled) = (&self.owners, &self.filled);
        let fill_of = |pixel: usize| fills.get(usize::from(owners[pixel]).wrapping_sub(1));
        let is_before = |pixel: usize, f: &Filled<'_>, inverse_depth: f32| {
            let ray = camera.ray((pixel % width) as u32, (pixel / width) as u32);
            !f.plane.has(ray, f64::from(inverse_depth))
        };
        let last = match self.options.persist {
            true => std::mem::take(&mut self.picture),
            false => Target::default(),
        };
        self.picture.clear(camera.width, camera.height);
        let is_wanted = |pixel: usize, inverse_depth: f32| match fill_of(pixel) {
            None => true,
            Some(f) => {
                f.share < 1.0 || filled.color[pixel][3] == 0 || is_before(pixel, f, inverse_depth)
            }
        };
        self.painter
            .shade(self.model, view, camera, &mut self.picture, is_wanted)?;
        if fills.is_empty() {
            return Ok(0);
        }
        let painter = &self.painter;
        let is_captured = painter.captured().is_some();
        let colors = self.picture.color.par_chunks_mut(width);
        let rows = colors.zip(self.picture.inverse_depth.par_chunks_mut(width));
        let row = |(y, (colors, depths)): (usize, (&mut [[u8; 4]], &mut [f32]))| {
            let mut holes = 0;
            for (x, (color, depth)) in colors.iter_mut().zip(depths).enumerate() {
                let pixel = y * width + x;
                let Some(f) = fill_of(pixel) else {
                    continue;
                };
                let own = painter.inverse_depth(pixel);
                if own.is_some_and(|s| is_before(pixel, f, s)) {
                    continue;
                }
                let mut image = filled.color[pixel];
                if image[3] == 0 && own.is_some() && is_captured {
                    // All that might be there was met.
                    continue;
                }
                if image[3] == 0 {
                    holes += usize::from(own.is_none());
                    if last.color.len() == owners.len() {
                        image = last.color[pixel];
                    }
                }
                if f.share < 1.0 {
                    *color = mixed(*color, image, f.share);
                } else if own.is_none() || filled.color[pixel][3] > 0 {
                    *color = image;
                }
                if own.is_none() || (f.share >= 1.0 && filled.color[pixel][3] > 0) {
                    *depth = filled.inverse_depth[pixel];
                }
            }
            holes
        };
        Ok(rows.enumerate().map(row).sum())
    }
}

/// Colours with coverage mixed, `share` of the second.
fn mixed(a: [u8; 4], b: [u8; 4], share: f64) -> [u8; 4] {
    let weights = [(1.0 - share) * f64::from(a[3]), share * f64::from(b[3])];
    let alpha = weights[0] + weights[1];
    if alpha < 0.5 {
        return [0; 4];
    }
    let part = weights[1] / alpha;
    let mix = |k: usize| f64::from(a[k]) + part * (f64::from(b[k]) - f64::from(a[k]));
    [mix(0), mix(1), mix(2), alpha].map(|v| v.round() as u8)
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
