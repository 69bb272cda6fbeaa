//! A frame of a walk: the viewer's cell as geometry, what is beyond its portals as one chooses.
//!
//! 1. The triangles of the viewer's cell, and of what is beyond portals that are near, are met.
//! 2. Every other portal that is visible is filled out of reference images, in the pixels where
//!    one sees through it.
//! 3. A pixel shows the cell's own surface where that is before the portal, else the fill, else
//!    whatever surface there is. Only what is shown is coloured.

use super::reference::plane_of;
use super::{
    Beyond, CellGeometry, Library, LibraryOptions, Pinhole, PinholeError, PortalFill, Raster, Runs,
    Splat, Target, Window, texture, warp,
};
use calibrate::View;
use glam::DVec3;
use proxy::interior::{
    CellId, Contents, Interior, Pass, Portal, Region, Visibility, visible, visible_through,
};
use proxy::mesh::Model;
use rayon::prelude::*;
use std::time::{Duration, Instant};

/// What can be chosen about a walk.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WalkOptions {
    /// Reference images.
    pub library: LibraryOptions,
    /// How large samples are drawn.
    pub splat: Splat,
    /// Nearer to a portal than this, in radii of its semicircle, what is beyond is geometry:
    /// from there one sees farther aside than the images do.
    pub near: f64,
    /// Farther than this, in radii, it is images; between the two it is a mix.
    pub far: f64,
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
            near: 2.0 / 3.0,
            far: 1.0,
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
    /// Those among them filled with images, even if mixed with geometry.
    pub filled: usize,
    /// Triangles of the cells that are drawn as geometry.
    pub triangles_in_cells: usize,
    /// Those of them in runs that are in sight.
    pub triangles_tried: usize,
    /// Those of them that touch a pixel's centre.
    pub triangles_met: usize,
    /// Samples of reference images that were drawn, or pixels of textures.
    pub samples: usize,
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

/// A walker through an interior, and what is kept between frames.
#[derive(Debug)]
pub struct Walk<'a> {
    interior: &'a Interior,
    contents: &'a Contents,
    model: &'a Model,
    geometry: CellGeometry,
    library: Library,
    options: WalkOptions,
    raster: Raster,
    filled: Target,
    /// By pixel: one more than the place in the frame's list of fills; 0 for none.
    owners: Vec<u16>,
    picture: Target,
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
    /// A walk; reference images are made when they are needed.
    pub fn new(
        interior: &'a Interior,
        contents: &'a Contents,
        model: &'a Model,
        options: WalkOptions,
    ) -> Self {
        Self {
            interior,
            contents,
            model,
            geometry: CellGeometry::new(model, contents),
            library: Library::new(interior, &options.library),
            options,
            raster: Raster::default(),
            filled: Target::default(),
            owners: Vec::new(),
            picture: Target::default(),
        }
    }

    /// The reference images.
    pub fn library(&self) -> &Library {
        &self.library
    }

    /// The last frame drawn.
    pub fn picture(&self) -> &Target {
        &self.picture
    }

    /// Draws a view. Where the viewer is in no cell, or on a portal's plane, all that may be
    /// visible is geometry.
    ///
    /// # Errors
    /// A view that interiors are not drawn for.
    pub fn draw(&mut self, view: &View, fill: PortalFill) -> Result<FrameCost, PinholeError> {
        let camera = Pinhole::new(view)?;
        let mut cost = FrameCost::default();
        // 1. What is visible.
        let start = Instant::now();
        let eye = camera.center;
        let cell = self.contents.locate(self.interior, eye);
        let visibility = visible(self.interior, cell, view);
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
            Some(_) if fill != PortalFill::Geometry => {
                let alone = in_sight(Visibility {
                    cells: visibility.cells.first().into_iter().cloned().collect(),
                    passes: Vec::new(),
                });
                windows.push((geometry.seen(eye, &alone), whole));
                for &(pass, into) in &open {
                    let portal = self.interior.portal(pass.portal);
                    let share = self.share_of_image(portal, eye);
                    let window = Window::of(&pass.region, &camera);
                    if share < 1.0 {
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
            _ => windows.push((geometry.seen(eye, &in_sight(visibility.clone())), whole)),
        }
        cost.filled = fills.len();
        cost.visibility = start.elapsed();
        // 2. Triangles.
        let start = Instant::now();
        self.raster.clear(&camera);
        for (runs, window) in &windows {
            cost.triangles_in_cells += runs.asked;
            cost.triangles_tried += runs.count();
            cost.triangles_met += self
                .raster
                .draw(self.model, &runs.lists, &camera, window, None);
        }
        cost.geometry = start.elapsed();
        // 3. Fills.
        let start = Instant::now();
        let needed: Vec<Vec<usize>> = fills
            .iter()
            .map(|f| {
                let (id, from) = (f.pass.portal, f.pass.from);
                let count = fill.references();
                self.library
                    .nearest(self.interior, id, from, f.into, eye, count)
            })
            .collect();
        let image = |i: usize| self.library.image(i, self.interior, self.model, geometry);
        for &i in needed.iter().flatten() {
            cost.references_made += usize::from(!self.library.is_made(i));
            image(i);
        }
        cost.references = start.elapsed();
        let start = Instant::now();
        self.filled.clear(camera.width, camera.height);
        self.owners.clear();
        self.owners.resize(self.filled.color.len(), 0);
        for (k, (f, images)) in fills.iter().zip(&needed).enumerate() {
            for y in 0..camera.height {
                let open = f.window.row(y);
                let first = y as usize * camera.width as usize;
                let row = first + open.start as usize..first + open.end as usize;
                self.owners[row].fill(k as u16 + 1);
            }
            // The nearest last.
            for &i in images.iter().rev() {
                let (reference, into) = (image(i), &mut self.filled);
                cost.samples += match fill {
                    PortalFill::Texture => texture(reference, &f.plane, &camera, &f.window, into),
                    _ => warp(reference, &camera, &f.window, self.options.splat, into),
                };
            }
        }
        cost.fill = start.elapsed();
        // 4. Colours.
        let start = Instant::now();
        cost.holes = self.compose(&camera, &fills);
        cost.shade = start.elapsed();
        Ok(cost)
    }

    /// Of an image in what is drawn of a portal, 0 to 1, by the eye's distance from it.
    fn share_of_image(&self, portal: &Portal, eye: DVec3) -> f64 {
        let radius = portal.semicircle_radius(self.interior.up);
        let (near, far) = (self.options.near * radius, self.options.far * radius);
        let distance = distance(portal, eye);
        if !(distance > near) {
            return 0.0;
        }
        if far > near {
            ((distance - near) / (far - near)).min(1.0)
        } else {
            1.0
        }
    }

    /// The picture; how many pixels of portals nothing was drawn in.
    fn compose(&mut self, camera: &Pinhole, fills: &[Filled<'_>]) -> usize {
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
        self.raster
            .shade(self.model, camera, &mut self.picture, is_wanted);
        if fills.is_empty() {
            return 0;
        }
        let raster = &self.raster;
        let colors = self.picture.color.par_chunks_mut(width);
        let rows = colors.zip(self.picture.inverse_depth.par_chunks_mut(width));
        let row = |(y, (colors, depths)): (usize, (&mut [[u8; 4]], &mut [f32]))| {
            let mut holes = 0;
            for (x, (color, depth)) in colors.iter_mut().zip(depths).enumerate() {
                let pixel = y * width + x;
                let Some(f) = fill_of(pixel) else {
                    continue;
                };
                let image = filled.color[pixel];
                let own = raster.at(pixel);
                if own.is_some_and(|(_, s)| is_before(pixel, f, s)) {
                    continue;
                }
                if image[3] == 0 {
                    if own.is_none() {
                        holes += 1;
                        if last.color.len() == owners.len() {
                            *color = last.color[pixel];
                        }
                    }
                    continue;
                }
                if f.share >= 1.0 || own.is_none() {
                    *color = image;
                    *depth = filled.inverse_depth[pixel];
                    continue;
                }
                for k in 0..3 {
                    let (a, b) = (f64::from(color[k]), f64::from(image[k]));
                    color[k] = (a + f.share * (b - a)).round() as u8;
                }
            }
            holes
        };
        rows.enumerate().map(row).sum()
    }
}

/// The same cells, seen everywhere.
fn everywhere(mut visibility: Visibility) -> Visibility {
    for cell in &mut visibility.cells {
        cell.regions = vec![Region::ALL];
    }
    visibility
}

/// How far an eye is from the nearest point of a portal.
fn distance(portal: &Portal, eye: DVec3) -> f64 {
    let polygon = &portal.polygon;
    let height = polygon.height(eye);
    if polygon.covers(eye, 0.0) {
        return height.abs();
    }
    let corners = polygon.corners();
    let side = |i: usize| {
        let (a, b) = (corners[i], corners[(i + 1) % corners.len()]);
        let along = b - a;
        let t = ((eye - a).dot(along) / along.length_squared()).clamp(0.0, 1.0);
        let t = if t.is_nan() { 0.0 } else { t };
        eye.distance(a + t * along)
    };
    (0..corners.len()).map(side).fold(f64::INFINITY, f64::min)
}
