//! The shipped CPU engine: f32, a tile of pixels at a time, all threads.
//!
//! Every pixel is computed from its own inputs alone, so any number of threads gives the
//! same bytes.

mod asked;
mod contradictions;
mod exact;
pub(crate) mod lanes;
mod mark;
pub(crate) mod probe;
pub(crate) mod scalar;
mod shade;
pub(crate) mod source;
mod triangulated;
mod weights;

use crate::RenderError;
use crate::contradictions::{Contradictions, frame_of_cells};
use crate::edges::Edges;
use crate::field::TriangulatedField;
use crate::frame::{Frame, ProxyPoint};
use crate::held::Held;
use crate::near::is_time_to_see;
use crate::options::{FieldOptions, Method};
use crate::photos::PhotoError;
use crate::rays::{RayCache, RayMap};
use asked::Asked;
use exact::draw_exact;
use glam::Vec4;
use image::RgbaImage;
use lanes::{LANES, Lane, each, vectorised};
use rayon::prelude::*;
use source::{Sight, Source, Tile};
use std::sync::OnceLock;
use triangulated::draw_field;
use weights::Term;

/// Rows that one thread does in one go.
const BAND: usize = 8;

/// Pixels that are worked on together, across and down: near one another, so that the same source views
/// matter to them.
const TILE: [usize; 2] = [8, LANES / 8];
/// The column and row of each of its pixels.
const PLACES: [[usize; 2]; LANES] = {
    let mut places = [[0; 2]; LANES];
    let mut k = 0;
    while k < LANES {
        places[k] = [k % TILE[0], k / TILE[0]];
        k += 1;
    }
    places
};

/// The engine, with what it keeps between frames.
#[derive(Debug, Default)]
pub struct Cpu {
    rays: RayCache,
}

impl Cpu {
    /// Draws a frame.
    ///
    /// # Errors
    /// A photo that is needed cannot be decoded; the triangulation refuses the view.
    pub fn render(&mut self, frame: &Frame<'_>, method: Method) -> Result<RgbaImage, RenderError> {
        let rays = self.rays.of(&frame.desired);
        match method {
            Method::Exact => Ok(draw_exact(frame, rays)?),
            Method::Triangulated { cells_across } => {
                let field = TriangulatedField::new(frame, cells_across)?;
                Ok(draw_field(frame, &field, rays)?)
            }
        }
    }

    /// Draws a triangulated field.
    ///
    /// # Errors
    /// A photo or mask that is needed cannot be decoded.
    pub fn render_field(
        &mut self,
        frame: &Frame<'_>,
        field: &TriangulatedField,
    ) -> Result<RgbaImage, RenderError> {
        Ok(draw_field(frame, field, self.rays.of(&frame.desired))?)
    }

    /// Draws edges into their frame's picture, of the photos that its field lists, if it has one.
    ///
    /// # Errors
    /// A photo that is needed cannot be decoded.
    pub(crate) fn smooth(
        &mut self,
        frame: &Frame<'_>,
        field: Option<&TriangulatedField>,
        edges: &Edges<'_>,
        picture: &mut RgbaImage,
    ) -> Result<(), PhotoError> {
        self.ask(frame, field, &edges.frame_of_samples(), |engine, photos| {
            let draw = |scratch: &mut (Asked, Seen), points: &[ProxyPoint]| {
                engine.draw_points(photos, scratch, points)
            };
            edges.put(Default::default, draw, picture)
        })
    }

    /// Where the photos of a frame contradict each other, of those that its field lists, if it has one.
    ///
    /// # Errors
    /// A photo or mask that is needed cannot be decoded.
    pub(crate) fn contradictions(
        &mut self,
        frame: &Frame<'_>,
        field: Option<&TriangulatedField>,
    ) -> Result<Option<Contradictions>, PhotoError> {
        if !Contradictions::may_be(frame) {
            return Ok(None);
        }
        self.ask(frame, field, &frame_of_cells(frame), |engine, photos| {
            let shown = |scratch: &mut (Asked, Seen), points: &[ProxyPoint]| {
                engine.shown(photos, scratch, points)
            };
            Contradictions::of(frame, Default::default, shown)
        })
        .map(Some)
    }

    /// Asks about proxy points of a frame of `samples` of one that was drawn, of the photos that its field lists, if it has
    /// one.
    fn ask<R>(
        &mut self,
        frame: &Frame<'_>,
        field: Option<&TriangulatedField>,
        samples: &Frame<'_>,
        then: impl FnOnce(&Engine<'_>, &Held<'_>) -> Result<R, PhotoError>,
    ) -> Result<R, PhotoError> {
        frame.view_tree();
        let rays = self.rays.of(&frame.desired);
        let wanted = match field {
            Some(field) => field.listed(),
            None => mark::wanted(&Engine::new(frame, rays), frame.taking_part().collect()),
        };
        let mut engine = Engine::new(samples, rays);
        let photos = Held::again(frame, &wanted);
        if field.is_some() {
            let mut among = vec![false; frame.sources.len()];
            wanted.iter().for_each(|i| among[*i] = true);
            engine.among = Some(among);
        }
        let result = then(&engine, &photos)?;
        frame.check_masks()?;
        Ok(result)
    }
}

/// Draws a single frame, keeping nothing for the next.
///
/// # Errors
/// As [`Cpu::render`].
pub fn render(frame: &Frame<'_>, method: Method) -> Result<RgbaImage, RenderError> {
    Cpu::default().render(frame, method)
}

/// The source views that see something of a tile.
#[derive(Default)]
struct Seen {
    /// Of each, in the order in which they were kept; `sights` and `terms` may hold more.
    source_idxs: Vec<usize>,
    sights: Vec<Sight>,
    terms: Vec<Term>,
    /// Where they are, in the order of the views. (Each is a kilobyte to move.)
    order: Vec<usize>,
}

impl Seen {
    fn clear(&mut self) {
        self.source_idxs.clear();
        self.order.clear();
    }

    /// Where to put what is found out about the next source view.
    fn next(&mut self) -> (&mut Sight, &mut Term) {
        let at = self.source_idxs.len();
        if self.sights.len() <= at {
            self.sights.push(Sight::nothing());
            self.terms.push(Term::nothing());
        }
        (&mut self.sights[at], &mut self.terms[at])
    }

    /// Keeps what was put there.
    fn keep(&mut self, source_idx: usize) {
        let before = |&i: &usize| self.source_idxs[i] < source_idx;
        let at = self.order.partition_point(before);
        self.order.insert(at, self.source_idxs.len());
        self.source_idxs.push(source_idx);
    }

    /// Finds the weights of their terms: see [`weights::weigh`].
    fn weigh(&mut self, options: &FieldOptions) -> Lane {
        weights::weigh(&mut self.terms, &self.order, options)
    }

    /// Whether, so many views having been asked, it is looked into and found that in the pixels that are `wanted`
    /// views that differ by `least` or more would change no weight: see [`weights::is_enough`].
    fn is_enough(
        &self,
        asked: usize,
        options: &FieldOptions,
        least: f32,
        wanted: &[bool; LANES],
    ) -> bool {
        is_time_to_see(asked)
            && weights::is_enough(&self.terms, &self.order, options, least, wanted)
    }

    /// Adds the terms' weights to what the sights are worth.
    fn add_weights(&mut self) {
        for &i in &self.order {
            let (sight, term) = (&mut self.sights[i], &self.terms[i]);
            sight.a = each(|k| sight.a[k] + term.weight[k]);
        }
    }

    /// In the order of the views.
    fn iter(&self) -> impl Iterator<Item = (usize, &Sight, &Term)> {
        let order = self.order.iter();
        order.map(|&i| (self.source_idxs[i], &self.sights[i], &self.terms[i]))
    }
}

/// What all pixels of a frame share.
struct Engine<'a> {
    frame: &'a Frame<'a>,
    /// Each made when first asked for: of many photos a frame mostly needs few.
    sources: Vec<OnceLock<Box<Source>>>,
    rays: &'a RayMap,
    /// The source views of which alone the exact field is made, where it is not of all.
    among: Option<Vec<bool>>,
}

impl<'a> Engine<'a> {
    fn new(frame: &'a Frame<'a>, rays: &'a RayMap) -> Self {
        let sources = frame.lumigraph.sources.iter();
        Self {
            frame,
            sources: sources.map(|_| OnceLock::new()).collect(),
            rays,
            among: None,
        }
    }

    fn source(&self, source_idx: usize) -> &Source {
        let new = || Box::new(Source::new(self.frame, source_idx));
        self.sources[source_idx].get_or_init(new)
    }

    /// The rays of a tile and where they meet the proxy, where that is wanted. It begins at a pixel, and
    /// may reach out of the picture, where nothing is.
    fn tile(&self, [x0, y0]: [usize; 2], wanted: impl Fn(usize) -> bool) -> Tile {
        let desired = &self.frame.desired;
        let (width, height) = (desired.width as usize, desired.height as usize);
        // Where all see one plane no pixel is asked alone.
        let (columns, rows) = (x0..x0 + TILE[0], y0..y0 + TILE[1]);
        if columns.end <= width
            && rows.end <= height
            && let RayMap::Pinhole(pinhole) = self.rays
            && (0..LANES).all(&wanted)
            && let Some(plane) = self.frame.surface.plane_of_all(columns, rows)
        {
            return vectorised(
                #[inline(always)]
                || {
                    let [x, y] = [(x0, 0), (y0, 1)].map(
                        #[inline(always)]
                        |(first, axis)| {
                            each(
                                #[inline(always)]
                                |k| pinhole.at(axis, first + PLACES[k][axis]),
                            )
                        },
                    );
                    Tile::of_plane(x, y, plane)
                },
            );
        }
        let mut tile = Tile::nothing();
        for (k, [x, y]) in PLACES.into_iter().enumerate() {
            let (x, y) = (x0 + x, y0 + y);
            if x < width && y < height && wanted(k) {
                let plane = self.frame.surface.plane_of(x, y);
                if let (Some(ray), Some(plane)) = (self.rays.ray(x, y), plane) {
                    tile.set(k, ray, plane);
                }
            }
        }
        tile
    }

    /// Takes what a photo's mask ignores and what hides points from it off its relevance, in
    /// the pixels that are `wanted`.
    fn mask(&self, source_idx: usize, sight: &mut Sight, wanted: impl Fn(usize) -> bool) {
        let lumigraph = self.frame.lumigraph;
        let seen = |sight: &Sight, k: usize| sight.a[k] > 0.0 && wanted(k);
        if let Some(mask) = lumigraph.photos.mask(source_idx) {
            let left = vectorised(
                #[inline(always)]
                || shade::left_by(mask, sight, |k| seen(sight, k)),
            );
            for k in 0..LANES {
                if seen(sight, k) {
                    sight.a[k] *= left[k];
                }
            }
        }
        if let Some(visibility) = &lumigraph.visibility {
            if !(0..LANES).any(|k| seen(sight, k)) {
                return;
            }
            let map = visibility.map(source_idx);
            let visible = vectorised(
                #[inline(always)]
                || shade::visible(map, sight),
            );
            for k in 0..LANES {
                if seen(sight, k) {
                    sight.a[k] *= visible[k];
                }
            }
        }
    }

    /// Blends the photos of a tile: its pixels, straight RGBA. All of them are asked for, also after one that cannot
    /// be had.
    fn shade(
        &self,
        photos: &Held<'_>,
        seen: &Seen,
        weight: impl for<'s> Fn(&'s Sight, &'s Term) -> &'s Lane,
    ) -> Result<[[u8; 4]; LANES], PhotoError> {
        let mut color = [Vec4::ZERO; LANES];
        let mut sum = [0.0_f32; LANES];
        let mut had = Ok(());
        for (i, sight, term) in seen.iter() {
            let weight = weight(sight, term);
            if weight.iter().all(|w| *w == 0.0) {
                continue;
            }
            let photo = match photos.get(i) {
                Ok(photo) => photo,
                Err(error) => {
                    had = had.and(Err(error));
                    continue;
                }
            };
            let exposure = self.source(i).exposure;
            vectorised(
                #[inline(always)]
                || shade::add(photo, exposure, sight, weight, &mut color, &mut sum),
            );
        }
        had?;
        let mut pixels = [[0; 4]; LANES];
        vectorised(
            #[inline(always)]
            || {
                for k in 0..LANES {
                    if sum[k] > 0.0 {
                        pixels[k] = shade::straight_rgba8(color[k], sum[k]);
                    }
                }
            },
        );
        Ok(pixels)
    }
}

/// Where the tiles of a band begin in a picture so wide: column, and row in the band.
fn tiles_of_band(width: usize) -> impl Iterator<Item = [usize; 2]> {
    let columns = (0..width).step_by(TILE[0]);
    columns.flat_map(|x| (0..BAND).step_by(TILE[1]).map(move |y| [x, y]))
}

/// Puts a tile's pixels, as far as they are in the picture, into a band of rows, each of `pitch` bytes.
fn put(tile: &[[u8; 4]; LANES], band: &mut [u8], pitch: usize, [x, y]: [usize; 2]) {
    for (row, tile) in band.chunks_mut(pitch).skip(y).zip(tile.chunks(TILE[0])) {
        let (row, _) = row[4 * x..].as_chunks_mut::<4>();
        let count = row.len().min(tile.len());
        row[..count].copy_from_slice(&tile[..count]);
    }
}

/// Runs `band(band, scratch, pixels)` for every band of rows of the picture, in parallel. Where one fails the others
/// still ask for their photos: see [`crate::PhotoStore::take_missed`].
fn draw<S: Default + Send>(
    frame: &Frame<'_>,
    band: impl Fn(usize, &mut S, &mut [u8]) -> Result<(), PhotoError> + Sync,
) -> Result<RgbaImage, PhotoError> {
    let (width, height) = (frame.desired.width, frame.desired.height);
    let pitch = width as usize * 4;
    let mut pixels = vec![0; pitch * height as usize];
    let drawn: Vec<Result<(), PhotoError>> = pixels
        .par_chunks_mut(pitch * BAND)
        .enumerate()
        .map_init(S::default, |scratch, (i, pixels)| band(i, scratch, pixels))
        .collect();
    // The first error from the top, whichever thread is the first to meet one.
    drawn.into_iter().collect::<Result<(), _>>()?;
    frame.check_masks()?;
    Ok(RgbaImage::from_raw(width, height, pixels).expect("the size was computed above"))
}
