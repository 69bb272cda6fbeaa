//! A picture within a given error of the exact one: each frame takes the coarsest grid that a
//! measurement allows, or else the exact field.
//!
//! What is measured is the picture: at a few thousand pixels, spread evenly, the field is
//! evaluated exactly and by interpolation, and photos are sampled by both. Everything is
//! computed in f64 from the frame alone, so that all engines and any number of threads choose
//! the same.

use crate::RenderError;
use crate::blend::Contributor;
use crate::engine::Prepared;
use crate::field::TriangulatedField;
use crate::frame::{Frame, ProxyPoint};
use crate::held::Held;
use crate::options::Method;
use crate::photos::PhotoError;
use crate::raster::Raster;
use crate::reference::color_at;
use calibrate::Pixel;
use rayon::prelude::*;

/// Grids to choose from, in cells across the image's width. A coarser one than the default
/// is no faster: larger triangles meet more borders, and those cost more at every pixel.
pub const GRIDS: [u32; 3] = [32, 64, 128];

/// Pixels that are measured, about.
const SAMPLES: f64 = 4096.0;
/// Standard errors of the mean squared error that are added to it.
const MARGIN: f64 = 6.0;
/// Steps of 255 that fast engines' f32 may be off.
const ROUNDING: f64 = 1e-4;
/// Steps of 255 by which one more pixel is taken to be off, as if it had been missed: where a mesh
/// can hide something from photos, a wrong outline of a few pixels is far off, and so is a border that is a
/// pixel aside between photos of which one alone paints each pixel. Chosen so
/// that more than 95 % of frames keep within their bounds; see benches/README.md, `error_bound`.
const MISSED: f64 = 5.0;
const MISSED_BY_FAR: f64 = 50.0;

/// What [`prepare_within`] chose for a frame.
#[derive(Clone, Debug)]
pub struct Bounded {
    /// The frame, made ready.
    pub prepared: Prepared,
    /// Cells of its grid; `None` for the exact field.
    pub cells_across: Option<u32>,
    /// [`ErrorEstimate::at_most`] of what was chosen: zero for the exact field, `None` where
    /// nothing was measured.
    pub error: Option<f64>,
}

/// Prepares a frame so that its picture is within `max_error` of the exact field's: the root
/// of the mean squared difference of 8-bit colours, composited on black, over all pixels and
/// channels. It is the coarsest of [`GRIDS`] whose error, as [`Samples`] measures it, is no
/// more; the exact field where none is or is likely to be (finer ones are not measured where a coarser one's error is so
/// large that they would still have too much), and where the triangulation refuses the view. No bound
/// (infinity) is [`Method::TRIANGULATED`], unmeasured; zero, less or NaN is the exact field.
///
/// # Errors
/// A photo or mask that is sampled cannot be decoded; without a bound as [`Prepared::new`].
pub fn prepare_within(frame: &Frame<'_>, max_error: f64) -> Result<Bounded, RenderError> {
    if max_error == f64::INFINITY {
        return Bounded::unmeasured(frame, Method::TRIANGULATED);
    }
    let exact = Bounded {
        error: Some(0.0),
        ..Bounded::EXACT
    };
    if !(max_error > 0.0) {
        return Ok(exact);
    }
    // No estimate is less than what samples may miss.
    let (width, height) = (frame.desired.width, frame.desired.height);
    let count = positions(width, height)
        .into_iter()
        .map(|(_, row)| row.len());
    if missed(frame, count.sum()).sqrt() > max_error {
        return Ok(exact);
    }
    let samples = Samples::new(frame)?;
    for cells_across in GRIDS {
        let Ok(field) = TriangulatedField::new(frame, cells_across) else {
            break;
        };
        let estimate = samples.error_of(&field)?;
        let error = estimate.at_most();
        if error <= max_error {
            return Ok(Bounded {
                prepared: Prepared::Field(field),
                cells_across: Some(cells_across),
                error: Some(error),
            });
        }
        // A finer grid's values differ by as much less as its cells are smaller, squared, at best.
        let finest = f64::from(cells_across) / f64::from(GRIDS[GRIDS.len() - 1]);
        let at_best = estimate.mean_square.sqrt() * finest * finest;
        if at_best > max_error {
            break;
        }
    }
    Ok(exact)
}

impl Bounded {
    /// The exact field.
    pub const EXACT: Self = Self {
        prepared: Prepared::Exact,
        cells_across: None,
        error: None,
    };

    /// A frame by a method that was chosen otherwise.
    ///
    /// # Errors
    /// As [`Prepared::new`].
    pub fn unmeasured(frame: &Frame<'_>, method: Method) -> Result<Self, RenderError> {
        Ok(Self {
            prepared: Prepared::new(frame, method)?,
            cells_across: match method {
                Method::Exact => None,
                Method::Triangulated { cells_across } => Some(cells_across),
            },
            error: None,
        })
    }
}

/// The exact picture at some pixels of a frame, to measure others by.
#[derive(Debug)]
pub struct Samples<'a> {
    frame: &'a Frame<'a>,
    photos: Held<'a>,
    rows: Vec<Row>,
}

#[derive(Debug)]
struct Row {
    y: u32,
    samples: Vec<Sample>,
}

#[derive(Debug)]
struct Sample {
    x: u32,
    point: Option<ProxyPoint>,
    /// Premultiplied, 0…1.
    exact: [f64; 4],
}

/// A column, what is seen there, and who paints it.
type Painted = (u32, Option<ProxyPoint>, Vec<Contributor>);

/// How far a picture is from the exact one, in steps of 255.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorEstimate {
    /// The mean squared difference over the samples and their channels.
    pub mean_square: f64,
    /// Its standard error.
    pub uncertainty: f64,
    /// What a sample that was missed would add to the mean.
    pub missed: f64,
}

impl ErrorEstimate {
    /// The root of the mean squared difference, with a margin for what the samples may have
    /// missed.
    pub fn at_most(&self) -> f64 {
        (self.mean_square + MARGIN * self.uncertainty + self.missed).sqrt()
    }
}

impl<'a> Samples<'a> {
    /// Evaluates the exact picture.
    ///
    /// # Errors
    /// A photo or mask that is sampled cannot be decoded.
    pub fn new(frame: &'a Frame<'a>) -> Result<Self, PhotoError> {
        // 1. Who paints them.
        frame.view_tree();
        let at = positions(frame.desired.width, frame.desired.height);
        let of_row = |(y, columns): &(u32, Vec<u32>)| {
            let painted = |&x: &u32| {
                let point = frame.proxy_point(Pixel::center_of(x, *y));
                let contributors = point.map_or_else(Vec::new, |p| frame.blend_at(&p));
                (x, point, contributors)
            };
            (*y, columns.iter().map(painted).collect())
        };
        let fields: Vec<(u32, Vec<Painted>)> = at.par_iter().map(of_row).collect();
        // 2. With what.
        let painted = fields.iter().flat_map(|(_, row)| row);
        let mut wanted: Vec<usize> = painted
            .flat_map(|(.., contributors)| contributors.iter().map(|c| c.source_idx))
            .collect();
        wanted.sort_unstable();
        wanted.dedup();
        let photos = Held::new(frame, &wanted).uncounted();
        let sample = |(x, point, contributors): Painted| {
            let exact = match &point {
                Some(point) => color_at(frame, &photos, point, &contributors)?,
                None => [0.0; 4],
            };
            Ok(Sample { x, point, exact })
        };
        let row = |(y, painted): (u32, Vec<Painted>)| {
            let samples = painted.into_iter().map(sample).collect::<Result<_, _>>()?;
            Ok(Row { y, samples })
        };
        let rows: Vec<Result<Row, PhotoError>> = fields.into_par_iter().map(row).collect();
        let rows = rows.into_iter().collect::<Result<_, _>>()?;
        frame.check_masks()?;
        Ok(Self {
            frame,
            photos,
            rows,
        })
    }

    /// How far the picture of a field of this frame is from the exact one.
    ///
    /// # Errors
    /// A photo that is sampled cannot be decoded.
    pub fn error_of(&self, field: &TriangulatedField) -> Result<ErrorEstimate, PhotoError> {
        let raster = Raster::new(field);
        let of_row = |row: &Row| {
            let mut spans = Vec::new();
            raster.spans(row.y as usize, &mut spans);
            let square = |sample: &Sample| {
                let x = sample.x as usize;
                let span = spans.iter().find(|s| (s.start..s.end).contains(&x));
                let color = match (&sample.point, span) {
                    (Some(point), Some(span)) => {
                        let shares = raster.barycentric(span.triangle_idx, x, row.y as usize);
                        let shares = shares.map(f64::from);
                        let field = field.interpolate(self.frame, span.triangle_idx, shares, point);
                        color_at(self.frame, &self.photos, point, &field)?
                    }
                    _ => [0.0; 4],
                };
                let squares = (0..3).map(|c| expected_square(255.0 * (color[c] - sample.exact[c])));
                Ok(squares.sum::<f64>() / 3.0)
            };
            row.samples.iter().map(square).collect()
        };
        let squares: Vec<Result<Vec<f64>, PhotoError>> = self.rows.par_iter().map(of_row).collect();
        let squares: Vec<Vec<f64>> = squares.into_iter().collect::<Result<_, _>>()?;
        let squares = squares.concat();
        let count = squares.len().max(1) as f64;
        let mean_square = squares.iter().sum::<f64>() / count;
        let variance = squares
            .iter()
            .map(|s| (s - mean_square).powi(2))
            .sum::<f64>()
            / count;
        Ok(ErrorEstimate {
            mean_square,
            uncertainty: (variance / count).sqrt(),
            missed: missed(self.frame, squares.len()),
        })
    }
}

/// What a pixel that so many samples miss adds to the mean square.
fn missed(frame: &Frame<'_>, samples: usize) -> f64 {
    let can_hide = frame.lumigraph.visibility.is_some();
    let steps = match can_hide || frame.options.is_of_one(frame.taking_part().count()) {
        true => MISSED_BY_FAR,
        false => MISSED,
    };
    steps * steps / samples.max(1) as f64
}

/// What the square of a difference of two values is after both were rounded to whole steps,
/// on average over where they lie between steps.
fn expected_square(difference: f64) -> f64 {
    let steps = difference.abs() + ROUNDING;
    let (whole, part) = (steps.floor(), steps.fract());
    (1.0 - part) * whole * whole + part * (whole + 1.0) * (whole + 1.0)
}

/// Rows of pixels with their columns: one pixel in each of about [`SAMPLES`] equal rectangles,
/// at places that no grid repeats.
fn positions(width: u32, height: u32) -> Vec<(u32, Vec<u32>)> {
    let size = [width, height].map(f64::from);
    let pitch = (size[0] * size[1] / SAMPLES).sqrt().max(1.0);
    let [columns, rows] = size.map(|side| (side / pitch).round().max(1.0));
    // The powers of the inverse plastic number: the two-dimensional golden section.
    let [f, g] = [0.754_877_666_246_692_7, 0.569_840_290_998_053_3];
    let row = |j: u32| {
        let j = f64::from(j);
        let column = |k: u32| {
            let k = f64::from(k);
            let within = (0.5 + f * k + g * j).fract();
            ((k + within) * size[0] / columns) as u32
        };
        let y = (j + (0.5 + f * j).fract()) * size[1] / rows;
        (
            (y as u32).min(height - 1),
            (0..columns as u32)
                .map(|k| column(k).min(width - 1))
                .collect(),
        )
    };
    (0..rows as u32).map(row).collect()
}
