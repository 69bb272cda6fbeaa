//! Silhouettes of photos before a plain background.

use super::Silhouette;
use glam::{DMat3, DVec3};

/// The background is looked for in a frame this wide, as a part of the shorter side.
const FRAME: f64 = 0.02;
/// Rounds of fitting the background's colour, each without what was far from the last.
const ROUNDS: usize = 6;
/// So many of the frame's pixels may show something else.
const MOST_OTHERS: f64 = 0.3;
/// Colours stray from the background's by so much at most (standard deviation, steps of 255).
const MOST_NOISE: f64 = 8.0;
/// What is farther from the background's colour than this many standard deviations and steps
/// is the object.
const THRESHOLD: (f64, f64) = (5.0, 8.0);
/// Islands smaller than this part of the largest are noise.
const SMALLEST_ISLAND: f64 = 0.02;
/// Holes smaller than this part of the object are noise.
const SMALLEST_HOLE: f64 = 0.002;
/// The object is at least this part of the photo, and at most that.
const SIZES: (f64, f64) = (0.002, 0.95);

/// Why a photo's background is not plain.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum BackgroundError {
    /// There is no picture.
    #[error("the picture has {found} values where {expected} were expected, three a pixel")]
    Size {
        /// How many there are.
        found: usize,
        /// How many there should be.
        expected: usize,
    },
    /// The border has many colours.
    #[error(
        "the background is not plain: {:.0} % of the photo's border differs from its main \
         colour (at most {:.0} % may); give masks", 100.0 * share, 100.0 * MOST_OTHERS
    )]
    Cluttered {
        /// The share of the border's pixels that differ.
        share: f64,
    },
    /// The border has no one colour.
    #[error(
        "the background is not plain: its colour varies by {noise:.0} of 255 steps (at most \
         {MOST_NOISE:.0}); give masks"
    )]
    Uneven {
        /// The standard deviation from a colour that changes evenly over the photo.
        noise: f64,
    },
    /// Nothing stands out, or all does.
    #[error(
        "{:.1} % of the photo differs from its border's colour, too {} for an object before a \
         plain background; give masks",
        100.0 * share, if *share < 0.5 { "little" } else { "much" }
    )]
    NoObject {
        /// The share of pixels that differ.
        share: f64,
    },
}

/// The silhouette of what stands before a plain background.
///
/// `rgb` holds three bytes a pixel, row by row. The background's colour is that of the photo's
/// border, fitted robustly as a linear function of the place, as light falls off. What differs
/// clearly is the object; small islands and holes are noise and go. A shadow on the background
/// that differs as clearly is taken for the object.
///
/// # Errors
/// The border is not of one colour, more or less, or nothing stands out.
pub fn plain_background(
    width: u32,
    height: u32,
    rgb: &[u8],
) -> Result<Silhouette, BackgroundError> {
    let (columns, rows) = (width as usize, height as usize);
    let expected = 3 * columns * rows;
    if rgb.len() != expected || expected == 0 {
        return Err(BackgroundError::Size {
            found: rgb.len(),
            expected,
        });
    }
    let color = |i: usize| DVec3::from_array([0, 1, 2].map(|c| f64::from(rgb[3 * i + c])));
    let place = |i: usize| {
        let (x, y) = (i % columns, i / columns);
        let part = |v: usize, size: usize| (v as f64 + 0.5) / size as f64 - 0.5;
        DVec3::new(1.0, part(x, columns), part(y, rows))
    };
    // 1. The border, and the colour most of it has.
    let band = ((FRAME * columns.min(rows) as f64) as usize).max(2);
    let border: Vec<usize> = (0..columns * rows)
        .filter(|i| {
            let (x, y) = (i % columns, i / columns);
            x < band || y < band || x + band >= columns || y + band >= rows
        })
        .collect();
    let background = Background::fit(&border, &color, &place);
    let off = |i: usize| color(i).distance(background.at(place(i)));
    let limit = THRESHOLD.0 * background.noise + THRESHOLD.1;
    let others = border.iter().filter(|i| off(**i) > limit).count();
    let share = others as f64 / border.len() as f64;
    if background.noise > MOST_NOISE {
        return Err(BackgroundError::Uneven {
            noise: background.noise,
        });
    }
    if share > MOST_OTHERS {
        return Err(BackgroundError::Cluttered { share });
    }
    // 2. What differs from it, without specks.
    let mut inside: Vec<bool> = (0..columns * rows).map(|i| off(i) > limit).collect();
    let islands = regions(&inside, true, columns);
    let largest = islands.iter().map(Vec::len).max().unwrap_or(0);
    for island in &islands {
        if (island.len() as f64) < SMALLEST_ISLAND * largest as f64 {
            island.iter().for_each(|i| inside[*i] = false);
        }
    }
    let area = inside.iter().filter(|i| **i).count();
    for hole in regions(&inside, false, columns) {
        if (hole.len() as f64) < SMALLEST_HOLE * area as f64 {
            hole.iter().for_each(|i| inside[*i] = true);
        }
    }
    let share = inside.iter().filter(|i| **i).count() as f64 / (columns * rows) as f64;
    if !(SIZES.0..=SIZES.1).contains(&share) {
        return Err(BackgroundError::NoObject { share });
    }
    Ok(Silhouette::new(width, height, inside).expect("a value a pixel"))
}

/// A colour that changes evenly over a photo.
struct Background {
    /// The colour is `by_place` · (1, x, y), x and y from −½ to ½.
    by_place: DMat3,
    /// The standard deviation from it.
    noise: f64,
}

impl Background {
    fn fit(
        border: &[usize],
        color: &impl Fn(usize) -> DVec3,
        place: &impl Fn(usize) -> DVec3,
    ) -> Self {
        let channel = |c: usize| median(border.iter().map(|i| color(*i)[c]).collect());
        let middle = DVec3::new(channel(0), channel(1), channel(2));
        let mut found = Self {
            by_place: DMat3::from_cols(middle, DVec3::ZERO, DVec3::ZERO),
            noise: 0.0,
        };
        for round in 0..=ROUNDS {
            let off: Vec<f64> = border
                .iter()
                .map(|i| color(*i).distance(found.at(place(*i))))
                .collect();
            let typical = median(off.clone());
            // Of three channels' equal noise: the median distance is 1.54 deviations.
            found.noise = typical / 1.54;
            if round == ROUNDS {
                break;
            }
            // Least squares over what is near: A = Σ c pᵀ (Σ p pᵀ)⁻¹.
            let near = 2.5 * typical + 1.0;
            let (mut products, mut squares) = (DMat3::ZERO, DMat3::ZERO);
            for (i, off) in border.iter().zip(off) {
                if off <= near {
                    let (c, p) = (color(*i), place(*i));
                    products += DMat3::from_cols(c * p.x, c * p.y, c * p.z);
                    squares += DMat3::from_cols(p * p.x, p * p.y, p * p.z);
                }
            }
            let fitted = products * squares.inverse();
            if !fitted.is_finite() {
                break;
            }
            found.by_place = fitted;
        }
        found
    }

    fn at(&self, place: DVec3) -> DVec3 {
        self.by_place * place
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// The connected regions of pixels with a value: through sides and, if they are inside,
/// through corners.
fn regions(inside: &[bool], value: bool, columns: usize) -> Vec<Vec<usize>> {
    let rows = inside.len() / columns;
    let mut seen = vec![false; inside.len()];
    let mut found = Vec::new();
    for start in 0..inside.len() {
        if inside[start] != value || seen[start] {
            continue;
        }
        seen[start] = true;
        let mut region = vec![start];
        let mut next = 0;
        while next < region.len() {
            let (x, y) = (
                (region[next] % columns) as i64,
                (region[next] / columns) as i64,
            );
            next += 1;
            for (dx, dy) in (-1..=1).flat_map(|dx| (-1..=1).map(move |dy| (dx, dy))) {
                let (nx, ny) = (x + dx, y + dy);
                let across = dx != 0 && dy != 0;
                let within = (0..columns as i64).contains(&nx) && (0..rows as i64).contains(&ny);
                if !within || (across && !value) {
                    continue;
                }
                let i = ny as usize * columns + nx as usize;
                if inside[i] == value && !seen[i] {
                    seen[i] = true;
                    region.push(i);
                }
            }
        }
        found.push(region);
    }
    found
}
