//! Cameras on a perfect circle that look inwards, found from silhouettes alone (Buehler et
//! al. 2001, §5, Car: "We simultaneously adjust the camera focal lengths to give the best
//! reconstruction").
//!
//! Instead of reconstructing for each focal length, we ask what any two silhouettes say of
//! each other. All planes through two camera centres form a pencil. The object touches just
//! two outer ones of these, from within, and what touches the object touches its silhouettes
//! in both photos: both must see it between the same two planes (the epipolar tangency of
//! frontier points; Cipolla, Åström and Giblin 1995). So a plane of the pencil that is tangent
//! to one silhouette is a line in the other photo, and how far that is from touching the
//! silhouette there is an error in pixels, which only the convex hulls of the silhouettes are
//! needed for. The circle has two unknowns, focal length and elevation; its radius is the
//! unit of length.

use super::Silhouette;
use calibrate::{Lens, Rigid3, View};
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use std::f64::consts::PI;
use std::ops::RangeInclusive;

/// Degrees from photo to photo, either way round.
pub const TURNTABLE_STEPS: RangeInclusive<f64> = 0.1..=120.0;

/// Angles between the photos that are compared, in radians, at most. Beyond it the epipoles
/// come close to the silhouettes.
const MOST_TURNED: f64 = 0.95 * PI;
/// Errors beyond this many pixels, for a photo 1000 pixels wide, hardly count more.
const LARGE_PX: f64 = 4.0;
/// The search at first: focal lengths as parts of the photo's longer side, and elevations.
const FOCALS: (f64, f64, usize) = (0.4, 8.0, 24);
const ELEVATIONS: (f64, f64, usize) = (-1.35, 1.35, 28);
/// Then around the best, in ever smaller steps.
const ZOOMS: usize = 48;
const ZOOM: f64 = 0.75;
/// Silhouettes fit no circle if they are farther than this from one another's tangents, for a
/// photo 1000 pixels wide.
const MOST_ERROR_PX: f64 = 6.0;
/// A focal length is found if with one this many times as long, or as short, errors are
/// larger by the second number.
const DISTINCT: (f64, f64) = (1.5, 1.1);

/// Cameras on a circle.
#[derive(Clone, Debug, PartialEq)]
pub struct Turntable {
    /// One for each silhouette. The world's y axis is the circle's, upwards; all look at its
    /// origin from distance 1. Photo i is i steps counter-clockwise from the +z axis, as seen
    /// from above.
    pub views: Vec<View>,
    /// Focal length in pixels.
    pub focal_px: f64,
    /// How far above the circle's centre the cameras lie, as an angle in radians.
    pub elevation: f64,
    /// How far tangents are from touching where they should, in pixels: the typical error
    /// (root mean square, large ones bounded).
    pub error_px: f64,
}

/// Why no turntable's cameras could be found.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TurntableError {
    /// Too few photos.
    #[error("{usable} of {photos} masks show an object with a background; a turntable needs 4")]
    Few {
        /// How many silhouettes.
        photos: usize,
        /// How many of them can be used.
        usable: usize,
    },
    /// Not one size.
    #[error("the masks differ in size; those of a turntable come from one camera")]
    Sizes,
    /// The step is no angle.
    #[error("the step from photo to photo is {found}°; expected between 0.1° and 120° either way")]
    Step {
        /// What was given, in degrees.
        found: f64,
    },
    /// The silhouettes contradict every such circle.
    #[error(
        "the silhouettes fit no camera that circles the object in steps of {step_degrees}°: \
         they are {error_px:.1} pixels off at best; turn the step's sign if the table turns \
         the other way, or calibrate the photos"
    )]
    NoCircle {
        /// The step that was given.
        step_degrees: f64,
        /// The least error.
        error_px: f64,
    },
    /// The silhouettes fit many circles.
    #[error(
        "the silhouettes do not tell the focal length: too much the same from all sides, seen \
         from too far away, or the step is another (turn the step's sign if the table turns the \
         other way); calibrate the photos"
    )]
    Undetermined,
}

/// Finds the cameras of photos that a turntable's object was taken with, or a car from a
/// circle around it: the same step between neighbours, one focal length, square pixels, the
/// axis upright in the image's middle.
///
/// A step is positive where the camera moves counter-clockwise around the object as seen from
/// above: the object turns clockwise. Silhouettes that are all object or all background say
/// nothing; their photos get cameras nevertheless. Lengths are in units of the cameras'
/// distance from the point they look at.
///
/// # Errors
/// See [`TurntableError`].
pub fn turntable(
    silhouettes: &[Silhouette],
    step_degrees: f64,
) -> Result<Turntable, TurntableError> {
    if !TURNTABLE_STEPS.contains(&step_degrees.abs()) {
        return Err(TurntableError::Step {
            found: step_degrees,
        });
    }
    let usable: Vec<usize> = (0..silhouettes.len())
        .filter(|i| silhouettes[*i].has_border() && !silhouettes[*i].reaches_border(1))
        .collect();
    if usable.len() < 4 {
        return Err(TurntableError::Few {
            photos: silhouettes.len(),
            usable: usable.len(),
        });
    }
    let size = silhouettes[0].size();
    if silhouettes.iter().any(|s| s.size() != size) {
        return Err(TurntableError::Sizes);
    }
    let longer = f64::from(size.0.max(size.1));
    let problem = Problem {
        step: step_degrees.to_radians(),
        hulls: silhouettes
            .par_iter()
            .map(|s| {
                if s.has_border() {
                    convex_hull(s)
                } else {
                    Vec::new()
                }
            })
            .collect(),
        pairs: pairs(&usable, step_degrees.to_radians()),
        large_px: LARGE_PX * longer / 1000.0,
    };
    // 1. Everywhere, coarsely; then around the best.
    let spaced = |(low, high, count): (f64, f64, usize), i: usize| {
        low + (high - low) * i as f64 / (count - 1) as f64
    };
    let focals = (FOCALS.0.ln(), FOCALS.1.ln(), FOCALS.2);
    let grid: Vec<[f64; 2]> = (0..FOCALS.2 * ELEVATIONS.2)
        .map(|i| {
            let focal = spaced(focals, i % FOCALS.2).exp() * longer;
            [focal.ln(), spaced(ELEVATIONS, i / FOCALS.2)]
        })
        .collect();
    let steps = [
        (focals.1 - focals.0) / (FOCALS.2 - 1) as f64,
        (ELEVATIONS.1 - ELEVATIONS.0) / (ELEVATIONS.2 - 1) as f64,
    ];
    let (start, _) = problem.best_of(&grid).ok_or(TurntableError::Undetermined)?;
    let (best, cost) = problem.zoomed(start, steps);
    // 2. Is it a circle, and is it this one?
    let error_px = cost.sqrt();
    if !(error_px <= MOST_ERROR_PX * longer / 1000.0) {
        return Err(TurntableError::NoCircle {
            step_degrees,
            error_px,
        });
    }
    for factor in [DISTINCT.0, 1.0 / DISTINCT.0] {
        let other = [best[0] + factor.ln(), best[1]];
        let (_, other_cost) = problem.zoomed(other, [0.0, steps[1]]);
        if !(other_cost.sqrt() > DISTINCT.1 * error_px + 0.02) {
            return Err(TurntableError::Undetermined);
        }
    }
    let [focal_px, elevation] = [best[0].exp(), best[1]];
    let view = |i: usize| View {
        lens: Lens::pinhole(
            DVec2::splat(focal_px),
            0.5 * DVec2::new(f64::from(size.0), f64::from(size.1)),
        ),
        width: size.0,
        height: size.1,
        camera_from_world: pose(problem.step * i as f64, elevation),
    };
    Ok(Turntable {
        views: (0..silhouettes.len()).map(view).collect(),
        focal_px,
        elevation,
        error_px,
    })
}

struct Problem {
    /// From photo to photo, in radians.
    step: f64,
    /// The corners of each silhouette's convex hull, from the image's middle, in pixels.
    hulls: Vec<Vec<DVec2>>,
    /// The photos compared.
    pairs: Vec<(usize, usize)>,
    large_px: f64,
}

impl Problem {
    /// The best of some (logarithms of focal lengths, elevations) and its cost; `None` where
    /// none can be told.
    fn best_of(&self, candidates: &[[f64; 2]]) -> Option<([f64; 2], f64)> {
        let costs: Vec<f64> = candidates.par_iter().map(|c| self.cost(*c)).collect();
        let best = (0..costs.len()).min_by(|a, b| costs[*a].total_cmp(&costs[*b]))?;
        costs[best]
            .is_finite()
            .then(|| (candidates[best], costs[best]))
    }

    /// The best near a start, by grids of 5 × 5 in ever smaller steps.
    fn zoomed(&self, start: [f64; 2], mut steps: [f64; 2]) -> ([f64; 2], f64) {
        let mut best = (start, self.cost(start));
        for _ in 0..ZOOMS {
            let around: Vec<[f64; 2]> = (0..25)
                .map(|i| {
                    let offset = |k: i32| 0.5 * f64::from(k - 2);
                    let [x, y] = best.0;
                    [x + steps[0] * offset(i % 5), y + steps[1] * offset(i / 5)]
                })
                .collect();
            if let Some(found) = self.best_of(&around)
                && found.1 < best.1
            {
                best = found;
            }
            steps = steps.map(|step| ZOOM * step);
        }
        best
    }

    /// The mean square of how far tangents miss, in pixels, large ones bounded (Geman and
    /// McClure); infinite where few of the pairs can be compared.
    fn cost(&self, [log_focal, elevation]: [f64; 2]) -> f64 {
        if elevation.abs() > 1.5 {
            return f64::INFINITY;
        }
        let focal = log_focal.exp();
        let poses: Vec<Rigid3> = (0..self.hulls.len())
            .map(|i| pose(self.step * i as f64, elevation))
            .collect();
        let (mut sum, mut count) = (0.0, 0);
        for &(i, j) in &self.pairs {
            for (i, j) in [(i, j), (j, i)] {
                let Some(misses) = self.misses_px(i, j, &poses, focal) else {
                    continue;
                };
                for miss in misses {
                    let square = miss * miss;
                    sum += square / (1.0 + square / (self.large_px * self.large_px));
                }
                count += 2;
            }
        }
        if count < 2 * self.pairs.len() {
            return f64::INFINITY;
        }
        sum / f64::from(count as u32)
    }

    /// By how many pixels the planes through both centres that are tangent to silhouette i
    /// miss being tangent to silhouette j; `None` where a centre is seen among the other's
    /// silhouette.
    fn misses_px(&self, i: usize, j: usize, poses: &[Rigid3], focal: f64) -> Option<[f64; 2]> {
        let centers = [poses[i].center(), poses[j].center()];
        // 1. Directions across the baseline: `inwards` towards the object, and `across`.
        let baseline = (centers[1] - centers[0]).try_normalize()?;
        let middle = -0.5 * (centers[0] + centers[1]);
        let inwards = (middle - baseline * baseline.dot(middle)).try_normalize()?;
        let across = baseline.cross(inwards);
        // 2. The least and the greatest slope under which silhouette i is seen.
        let camera = |k: usize, v: DVec3| poses[k].rotation * v;
        let slopes = |k: usize| {
            let (u, v) = (camera(k, across), camera(k, inwards));
            let mut range = (f64::INFINITY, f64::NEG_INFINITY);
            for point in &self.hulls[k] {
                let ray = point.extend(focal);
                let ahead = ray.dot(v);
                if !(ahead > 0.05 * ray.length()) {
                    return None;
                }
                let slope = ray.dot(u) / ahead;
                range = (range.0.min(slope), range.1.max(slope));
            }
            Some(range)
        };
        let (least, greatest) = slopes(i)?;
        slopes(j)?;
        // 3. Those planes in the other photo: lines; how far beyond them the silhouette goes.
        let beyond = |normal: DVec3| {
            let line = camera(j, normal);
            let scale = line.truncate().length();
            let values = self.hulls[j]
                .iter()
                .map(|p| p.extend(focal).dot(line) / scale);
            values.fold(f64::NEG_INFINITY, f64::max)
        };
        let misses = [
            beyond(across - inwards * greatest),
            beyond(inwards * least - across),
        ];
        misses.iter().all(|miss| miss.is_finite()).then_some(misses)
    }
}

fn pose(angle: f64, elevation: f64) -> Rigid3 {
    let (sin, cos) = angle.sin_cos();
    let outwards = DVec3::new(
        sin * elevation.cos(),
        elevation.sin(),
        cos * elevation.cos(),
    );
    Rigid3::looking_at(outwards, DVec3::ZERO, DVec3::Y)
}

/// Pairs of photos, each with some of those after it, near and far.
fn pairs(usable: &[usize], step: f64) -> Vec<(usize, usize)> {
    let mut found = Vec::new();
    let count = usable.len();
    let strides = [1, 2, 3, 5, 7, 9, 12, 15, 18];
    for a in 0..count {
        for stride in strides.into_iter().filter(|s| a + s < count) {
            let (i, j) = (usable[a], usable[a + stride]);
            let turned = (step * (j - i) as f64).rem_euclid(2.0 * PI);
            if turned.min(2.0 * PI - turned) <= MOST_TURNED && turned.sin().abs() > 0.01 {
                found.push((i, j));
            }
        }
    }
    found
}

/// The corners of a silhouette's convex hull, relative to the image's middle (Andrew 1979).
fn convex_hull(silhouette: &Silhouette) -> Vec<DVec2> {
    let (width, height) = silhouette.size();
    let middle = 0.5 * DVec2::new(f64::from(width), f64::from(height));
    // The first and the last pixel of each row will do, rows in order.
    let mut points: Vec<[i64; 2]> = Vec::new();
    for (y, row) in silhouette.inside().chunks(width as usize).enumerate() {
        let first = row.iter().position(|inside| *inside);
        let last = row.iter().rposition(|inside| *inside);
        for x in first.into_iter().chain(last) {
            points.push([x as i64, y as i64]);
        }
    }
    points.sort_unstable();
    points.dedup();
    let turns_left = |a: [i64; 2], b: [i64; 2], c: [i64; 2]| {
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > 0
    };
    let half = |points: &mut dyn Iterator<Item = [i64; 2]>| {
        let mut chain: Vec<[i64; 2]> = Vec::new();
        for point in points {
            while let [.., a, b] = chain[..]
                && !turns_left(a, b, point)
            {
                chain.pop();
            }
            chain.push(point);
        }
        chain.pop();
        chain
    };
    let mut hull = half(&mut points.iter().copied());
    hull.extend(half(&mut points.iter().rev().copied()));
    if hull.is_empty() {
        hull = points;
    }
    hull.iter()
        .map(|p| DVec2::new(p[0] as f64 + 0.5, p[1] as f64 + 0.5) - middle)
        .collect()
}
