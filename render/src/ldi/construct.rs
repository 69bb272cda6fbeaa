//! An LDI of the images that a portal's semicircle has, or of photos that see through the portal.

use super::ends::quarter_turns;
use super::fit::{Offered, fitted};
use super::layered::pinhole_view;
use super::{Ends, Layered, LdiError, Look, Sample};
use crate::interior::{MAX_SIDE, Pinhole, Reference, Warp, normal_at};
use glam::{DVec2, DVec3};
use proxy::interior::SemicircleView;
use rayon::prelude::*;
use std::ops::Range;

/// When two samples count as one surface, and what becomes of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Conflict {
    /// The one that sees the smaller patch of the surface stays; two of one image both do
    /// (Rafferty et al. 1998, "Images for accelerating architectural walkthroughs", §4.1). Not so
    /// those that are farther apart than half the larger patch's side: they are of different places
    /// of a surface that is seen along; nor those of another colour, between which there is an edge.
    SmallerPatch {
        /// The greatest difference of a channel that is the same colour, of 255: 255 is the paper's rule.
        same_color: u8,
    },
    /// The first stays; another colour is another surface (Popescu et al. 1998, §3.1).
    RangeThenColor {
        /// The greatest difference of a channel that is the same colour, of 255.
        same_color: u8,
    },
    /// Their mean stays (Gortler et al. 1997).
    Average,
}

/// How an LDI is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConstructOptions {
    /// Samples nearer to one another than this, in shares of their depth, are one surface.
    pub range: f64,
    /// What becomes of them.
    pub conflict: Conflict,
    /// Whether the central image's sample is in slot one of its pixel, drawn last, even where
    /// another one is nearer: at the edge of something within the pixel. The papers' rule; without
    /// it samples lie in depth order, and a tenth fewer points are drawn over nearer ones.
    pub center_in_front: bool,
    /// How far the LDI reaches to each side of the central image, in widths and heights of that.
    pub margin: f64,
    /// Whether colours are fitted to all samples offered, those that gave way, too.
    pub fit: bool,
}

impl Default for Conflict {
    fn default() -> Self {
        Self::SmallerPatch { same_color: 16 }
    }
}

impl Default for ConstructOptions {
    fn default() -> Self {
        Self {
            range: 0.01,
            conflict: Conflict::default(),
            center_in_front: true,
            margin: 3.0,
            fit: true,
        }
    }
}

/// An LDI and what became of the images' samples.
#[derive(Clone, Debug)]
pub struct Constructed {
    /// As large as its samples need.
    pub ldi: Layered,
    /// Samples of all images.
    pub offered: usize,
    /// Those that gave way, or were averaged.
    pub merged: usize,
    /// Those beside the LDI's image, or behind its camera.
    pub outside: usize,
    /// Those for which their pixel had no room.
    pub crowded: usize,
    /// Those nearer than the central image's sample in their pixel.
    pub before_center: usize,
}

/// A sample while the LDI is made; lists of them hang on pixels.
#[derive(Clone, Copy)]
struct Node {
    sample: Sample,
    /// The patch's area.
    area: f64,
    /// Whether the LDI's camera sees along its surface.
    is_seen_along: bool,
    /// Which image it is of; 0 is the central one.
    image: u32,
    /// How many samples it is the mean of.
    of: u32,
    /// Standard deviation of its depth, in world units.
    deviation: f64,
    next: u32,
}

const NONE: u32 = u32::MAX;
/// Bands of rows that are made at once.
const BANDS: usize = 16;
/// The least cosine that a patch's area is divided by.
const GRAZING: f64 = 1e-3;
/// A surface is seen along where the cosine between its normal and the ray is less.
const ALONG: f64 = 0.5;
/// Samples of a surface that is seen along whose depths differ by more sides of the larger patch are of
/// different places: what stayed of a doorway's jamb, say, would not cover it.
const PATCHES: f64 = 0.5;
/// Measured depths that differ by up to so many standard deviations of their difference may be of
/// one surface.
const SAME_SURFACE: f64 = 3.0;

/// An LDI of a portal's images, from left to right: the middle one's camera is the LDI's, and its
/// samples come first and stay. Then come the others', those made near the middle first.
///
/// # Errors
/// No images; a camera that is none.
pub fn construct(
    images: &[&Reference],
    options: &ConstructOptions,
) -> Result<Constructed, LdiError> {
    construct_around(images, images.len() / 2, options)
}

/// As [`construct`], where the central image is any of them: near the ends of a semicircle it is not the
/// middle of those nearest to it.
///
/// # Errors
/// No such image; a camera that is none.
pub fn construct_around(
    images: &[&Reference],
    center: usize,
    options: &ConstructOptions,
) -> Result<Constructed, LdiError> {
    let central = *images.get(center).ok_or(LdiError::NoImages)?;
    let mut order: Vec<usize> = (0..images.len()).collect();
    order.sort_by_key(|i| (i.abs_diff(center), *i));
    let images: Vec<&Reference> = order.into_iter().map(|i| images[i]).collect();
    made(&central.place, &central.camera, &images, 0, 0.0, options)
}

/// About the most bytes that making an LDI of so many images takes, of so many pixels each and all of them
/// showing something: beside the images, what is kept of all their pixels, and of those of one of them.
pub(crate) fn making_bytes(images: u64, pixels: u64, options: &ConstructOptions) -> u64 {
    let kept = match options.fit {
        true => size_of::<Node>() + size_of::<Offered>(),
        false => size_of::<Node>(),
    };
    pixels * (images * kept as u64 + size_of::<(usize, Node)>() as u64)
}

/// An LDI of photos with measured depths, the most trusted first, as a camera at a place sees what
/// they show. There is no central image: all samples are alike, in depth order.
///
/// `noise` is the standard deviation of the photos' inverse depths: samples are one surface within
/// the range that the options say, or within what two such depths differ by. Colours decide nothing, and
/// are those of the photos.
///
/// # Errors
/// No images; a camera that is none.
pub fn construct_of_photos(
    place: &SemicircleView,
    camera: &Pinhole,
    photos: &[&Reference],
    noise: f64,
    options: &ConstructOptions,
) -> Result<Constructed, LdiError> {
    if photos.is_empty() {
        return Err(LdiError::NoImages);
    }
    // Photos differ by exposure, focus and noise of depths, not only where there is an edge.
    let mut options = ConstructOptions {
        fit: false,
        ..*options
    };
    if let Conflict::SmallerPatch { same_color } = &mut options.conflict {
        *same_color = u8::MAX;
    }
    made(place, camera, photos, 1, noise.max(0.0), &options)
}

/// Images in order, the first of which is so-manieth: the central one is 0.
fn made(
    place: &SemicircleView,
    camera: &Pinhole,
    images: &[&Reference],
    first: u32,
    noise: f64,
    options: &ConstructOptions,
) -> Result<Constructed, LdiError> {
    // 1. How much the LDI shows: what the samples need.
    let size = DVec2::new(f64::from(camera.width), f64::from(camera.height));
    let room = if options.margin > 0.0 {
        options.margin.min(16.0)
    } else {
        0.0
    };
    let (mut low, mut high) = (DVec2::ZERO, size);
    for image in &images[usize::from(first == 0)..] {
        let warp = Warp::new(&image.camera, camera);
        let of_row = |y: u32| {
            let row = pixels(image, y).filter_map(|(pixel, s)| warp.at(pixel, s));
            row.fold((low, high), |(low, high), at| {
                (low.min(at.pixel), high.max(at.pixel))
            })
        };
        let rows = (0..image.seen.height).into_par_iter().map(of_row);
        (low, high) = rows.reduce(|| (low, high), |a, b| (a.0.min(b.0), a.1.max(b.1)));
    }
    let most = (room * size).floor();
    let [mut left, mut right] = [-low.floor().max(-most), high.ceil().min(size + most) - size];
    for axis in 0..2 {
        // No larger than pictures may be: the side that is farther from the central image gives way.
        let spare = (f64::from(MAX_SIDE) - size[axis]).max(0.0);
        left[axis] = left[axis].min((0.5 * spare).floor().max(spare - right[axis]));
        right[axis] = right[axis].min(spare - left[axis]);
    }
    let low = -left;
    let size = (size + left + right).max(DVec2::ONE);
    let view = pinhole_view(
        place.camera_from_world,
        camera.focal,
        camera.principal - low,
        [size.x as u32, size.y as u32],
    );
    let width = view.width as usize;
    let ldi_camera = Pinhole::new(&view)?;
    // 2. Samples, image by image, into bands of the LDI, each of which keeps that order.
    let rows = (view.height as usize).div_ceil(BANDS);
    let mut bands: Vec<Making> = (0..BANDS)
        .map(|band| {
            let of = |row: usize| width * row.min(view.height as usize);
            Making::new(of(band * rows)..of((band + 1) * rows), *options)
        })
        .collect();
    let (mut offered, mut outside) = (0, 0);
    for (rank, &image) in (first..).zip(images) {
        let warp = Warp::new(&image.camera, &ldi_camera);
        let turn = ldi_camera.rotation * image.camera.rotation.transpose();
        let quarters = quarter_turns(turn);
        let size_of_image = [image.seen.width, image.seen.height].map(|n| n as usize);
        let node = |(pixel, s): (DVec2, f64)| {
            let at = warp.at(pixel, s)?;
            let corner = at.pixel.floor();
            let inverse_depth = at.inverse_depth as f32;
            let is_inside = corner.cmpge(DVec2::ZERO).all() && corner.cmplt(size).all();
            if !is_inside || !(inverse_depth > 0.0) || !inverse_depth.is_finite() {
                return None;
            }
            let (normal, area) = patch(image, pixel, s);
            let normal = turn * normal;
            let i = index(image, pixel);
            let ends = Ends::of(&image.seen.inverse_depth, size_of_image, i, noise);
            let ray = (at.pixel - ldi_camera.principal) / ldi_camera.focal;
            let ray = ray.extend(1.0);
            let cosine = normal.dot(ray).abs() / (normal.length() * ray.length());
            let offset = (256.0 * (at.pixel - corner - 0.5)).floor();
            let sample = Sample {
                color: image.seen.color[i],
                inverse_depth,
                offset: [offset.x as i8, offset.y as i8],
                look: Look::new(normal, area.sqrt() * at.inverse_depth),
                ends: ends.turned(quarters),
            };
            // Depth here is there / s plus what no depth changes.
            let change = warp.pixel_from_pixel.row(2).dot(pixel.extend(1.0)).abs() / (s * s);
            let node = Node {
                sample,
                area,
                is_seen_along: cosine < ALONG,
                image: rank,
                of: 1,
                deviation: noise * change,
                next: NONE,
            };
            Some((corner.y as usize * width + corner.x as usize, node))
        };
        let row = |y: u32| Row::of(pixels(image, y).map(node));
        let rows: Vec<Row> = (0..image.seen.height).into_par_iter().map(row).collect();
        offered += rows
            .iter()
            .map(|row| row.nodes.len() + row.outside)
            .sum::<usize>();
        outside += rows.iter().map(|row| row.outside).sum::<usize>();
        bands.par_iter_mut().for_each(|band| {
            let pixels = band.pixels.clone();
            for row in rows.iter().filter(|row| row.may_meet(&pixels)) {
                for (pixel, node) in &row.nodes {
                    if pixels.contains(pixel) {
                        band.add(*node, *pixel);
                    }
                }
            }
        });
    }
    // 3. Back to front.
    let sorted: Vec<Sorted> = bands.par_iter().map(Making::sorted).collect();
    let counts: Vec<u8> = sorted.iter().flat_map(|s| &s.counts).copied().collect();
    let samples: Vec<Sample> = sorted.iter().flat_map(|s| &s.samples).copied().collect();
    let crowded = sorted.iter().map(|s| s.crowded).sum();
    let before_center = sorted.iter().map(|s| s.before_center).sum();
    let merged = bands.iter().map(|band| band.merged).sum();
    let mut ldi = Layered::new(view, place.portal.0, &counts, samples.into_iter())?;
    // 4. Their colours.
    if options.fit {
        let offered: Vec<&[Offered]> = bands.iter().map(|b| b.offered.as_slice()).collect();
        let colors = fitted(&ldi, &offered, rows, options.range);
        ldi.color[..colors.len()].copy_from_slice(&colors);
    }
    Ok(Constructed {
        ldi,
        offered,
        merged,
        outside,
        crowded,
        before_center,
    })
}

/// What of a row of an image an LDI is offered.
struct Row {
    /// The LDI's pixels, and the samples.
    nodes: Vec<(usize, Node)>,
    /// From the first of the pixels to past the last.
    pixels: Range<usize>,
    /// Samples that fall beside the LDI.
    outside: usize,
}

impl Row {
    fn of(offered: impl Iterator<Item = Option<(usize, Node)>>) -> Self {
        let (mut nodes, mut outside) = (Vec::new(), 0);
        let (mut low, mut past) = (usize::MAX, 0);
        for node in offered {
            let Some((pixel, node)) = node else {
                outside += 1;
                continue;
            };
            (low, past) = (low.min(pixel), past.max(pixel + 1));
            nodes.push((pixel, node));
        }
        Self {
            nodes,
            pixels: low..past,
            outside,
        }
    }

    fn may_meet(&self, pixels: &Range<usize>) -> bool {
        self.pixels.start < pixels.end && pixels.start < self.pixels.end
    }
}

/// The middles of a row's pixels that show anything, with their inverse depths.
fn pixels(image: &Reference, y: u32) -> impl Iterator<Item = (DVec2, f64)> + '_ {
    let width = image.seen.width as usize;
    let row = &image.seen.inverse_depth[y as usize * width..][..width];
    let seen = row.iter().enumerate().filter(|(_, s)| **s > 0.0);
    seen.map(move |(x, s)| (DVec2::new(x as f64, f64::from(y)) + 0.5, f64::from(*s)))
}

fn index(image: &Reference, pixel: DVec2) -> usize {
    pixel.y as usize * image.seen.width as usize + pixel.x as usize
}

/// The normal of what a pixel shows, in its camera's frame, and the area of what of it the pixel
/// sees.
///
/// A pixel's solid angle is |q|⁻³ / (fx·fy), q its ray with z = 1; what it sees is Z²·|q|² times
/// that over the cosine |n·q| / (|n|·|q|): Z² / (fx·fy·|n·q|) with |n| = 1.
fn patch(image: &Reference, pixel: DVec2, s: f64) -> (DVec3, f64) {
    let camera = &image.camera;
    let normal = normal_at(camera, &image.seen.inverse_depth, index(image, pixel));
    let cosine = (s / normal.length()).clamp(GRAZING, 1e3);
    let area = 1.0 / (s * s * camera.focal.x * camera.focal.y * cosine);
    (normal, area)
}

/// A band of rows of an LDI that is being made.
struct Making {
    /// Its pixels, counted row by row.
    pixels: Range<usize>,
    heads: Vec<u32>,
    nodes: Vec<Node>,
    /// All samples that fall in it, if colours are fitted to them.
    offered: Vec<Offered>,
    options: ConstructOptions,
    merged: usize,
}

/// What a band holds in the end.
struct Sorted {
    /// By pixel.
    counts: Vec<u8>,
    /// Pixel by pixel, back to front.
    samples: Vec<Sample>,
    crowded: usize,
    before_center: usize,
}

impl Making {
    fn new(pixels: Range<usize>, options: ConstructOptions) -> Self {
        Self {
            heads: vec![NONE; pixels.len()],
            pixels,
            nodes: Vec::new(),
            offered: Vec::new(),
            options,
            merged: 0,
        }
    }

    fn sorted(&self) -> Sorted {
        let mut sorted = Sorted {
            counts: Vec::with_capacity(self.heads.len()),
            samples: Vec::with_capacity(self.nodes.len()),
            crowded: 0,
            before_center: 0,
        };
        let mut pixel: Vec<&Node> = Vec::new();
        for head in &self.heads {
            pixel.clear();
            let mut at = *head;
            while let Some(node) = self.nodes.get(at as usize) {
                pixel.push(node);
                at = node.next;
            }
            let depth = |node: &Node| node.sample.inverse_depth;
            pixel.sort_by(|a, b| {
                let in_front = |node: &Node| self.options.center_in_front && node.image == 0;
                let slot = in_front(a).cmp(&in_front(b));
                slot.then(depth(a).total_cmp(&depth(b)))
                    .then(a.image.cmp(&b.image))
            });
            let center = pixel.iter().find(|node| node.image == 0).copied();
            if let Some(center) = center {
                let nearer = pixel.iter().filter(|node| depth(node) > depth(center));
                sorted.before_center += nearer.count();
            }
            // Of too many the farthest go, but for the central image's.
            let most = pixel.len().min(Layered::MOST);
            let from = pixel.len() - most;
            sorted.crowded += from;
            if from > 0
                && let Some(i) = pixel[..from].iter().position(|node| node.image == 0)
            {
                pixel[i..=from].rotate_left(1);
            }
            sorted.counts.push(most as u8);
            let samples = pixel[from..].iter().map(|node| node.sample);
            sorted.samples.extend(samples);
        }
        sorted
    }

    /// Puts a sample into a pixel's list, or merges it with the one nearest in depth of those that it
    /// is in conflict with.
    fn add(&mut self, new: Node, pixel: usize) {
        if self.options.fit {
            let (pixel, sample) = (pixel as u32, new.sample);
            self.offered.push(Offered { pixel, sample });
        }
        let pixel = pixel - self.pixels.start;
        let (sample, s) = (new.sample, f64::from(new.sample.inverse_depth));
        let mut found: Option<(usize, f64)> = None;
        let mut at = self.heads[pixel];
        while let Some(node) = self.nodes.get(at as usize) {
            let other = f64::from(node.sample.inverse_depth);
            // Of the depths' difference the share of the greater: 1 - s₁/s₂.
            let apart = 1.0 - s.min(other) / s.max(other);
            let noise = SAME_SURFACE * new.deviation.hypot(node.deviation) * s.min(other);
            let is_like = |same_color| {
                let [a, b] = [node.sample.color, sample.color];
                (0..3).all(|k| a[k].abs_diff(b[k]) <= same_color)
            };
            let is_other = match self.options.conflict {
                Conflict::SmallerPatch { same_color } => {
                    node.image != new.image && is_like(same_color)
                }
                Conflict::RangeThenColor { same_color } => is_like(same_color),
                Conflict::Average => true,
            };
            // Of a surface that is seen along a pixel has several places, each with its own patch.
            let range = match self.options.conflict {
                Conflict::SmallerPatch { .. } if new.is_seen_along || node.is_seen_along => {
                    let side = new.area.max(node.area).sqrt();
                    self.options.range.min(PATCHES * side * s.min(other))
                }
                _ => self.options.range,
            };
            let is_near = apart <= range.max(noise);
            if is_other && is_near && found.is_none_or(|(_, d)| apart < d) {
                found = Some((at as usize, apart));
            }
            at = node.next;
        }
        let Some((i, _)) = found else {
            let next = self.heads[pixel];
            self.nodes.push(Node { next, ..new });
            self.heads[pixel] = self.nodes.len() as u32 - 1;
            return;
        };
        self.merged += 1;
        let node = &mut self.nodes[i];
        match self.options.conflict {
            Conflict::SmallerPatch { .. } => {
                if node.image != 0 && new.area < node.area {
                    *node = Node {
                        next: node.next,
                        ..new
                    };
                }
            }
            Conflict::RangeThenColor { .. } => {}
            Conflict::Average => node.average(sample),
        }
    }
}

impl Node {
    fn average(&mut self, other: Sample) {
        self.of += 1;
        let share = 1.0 / f64::from(self.of);
        let mean = |a: f64, b: f64| a + share * (b - a);
        let ours = &mut self.sample;
        for k in 0..3 {
            let mean = mean(f64::from(ours.color[k]), f64::from(other.color[k]));
            ours.color[k] = mean.round() as u8;
        }
        for k in 0..2 {
            let mean = mean(f64::from(ours.offset[k]), f64::from(other.offset[k]));
            ours.offset[k] = mean.round() as i8;
        }
        let mean = mean(
            f64::from(ours.inverse_depth),
            f64::from(other.inverse_depth),
        );
        ours.inverse_depth = mean as f32;
    }
}
