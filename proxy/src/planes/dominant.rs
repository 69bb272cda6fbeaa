//! The plane that holds the most points: a facade, a floor, a table.
//!
//! RANSAC with local optimisation (Chum, Matas and Kittler 2003), always with the same
//! random numbers.

use crate::Plane;
use crate::cloud::median;
use crate::condition::thinnest;
use glam::DVec3;

/// A plane that holds many of the points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DominantPlane {
    /// The plane. Its normal points to either side.
    pub plane: Plane,
    /// How many points lie on it.
    pub inliers: usize,
    /// Of how many, far outliers left out.
    pub points: usize,
    /// Within what distance they lie on it, in world units.
    pub tolerance: f64,
    /// How many times as large errors of the points, relative to their extent, turn it, at most; see
    /// [`crate::ILL_CONDITIONED`].
    pub condition: f64,
}

/// Why no plane holds the points.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum DominantPlaneError {
    /// Three are a plane, whatever they are of.
    #[error(
        "there are {found} sparse points, too few to tell a plane among them; give it by hand \
         (`proxy SCENE plane --point X,Y,Z --normal X,Y,Z`)"
    )]
    TooFewPoints {
        /// How many.
        found: usize,
    },
    /// They have no extent, or only one.
    #[error(
        "the sparse points lie on a line, and any plane around it holds them; give one by hand \
         (`proxy SCENE plane --point X,Y,Z --normal X,Y,Z`)"
    )]
    Collinear,
    /// No plane stands out.
    #[error(
        "no plane holds more than {inliers} of the {points} sparse points; try the points \
         themselves (`--proxy points`)"
    )]
    NonePrevails {
        /// On the best.
        inliers: usize,
        /// Of all.
        points: usize,
    },
}

/// Fewer points are not asked.
const LEAST_POINTS: usize = 4;
/// Triples tried. At a fifth of inliers 600 find an outlier-free one with 99 %.
const TRIES: u32 = 800;
/// Points, spread over the list, that tell a try's worth.
const SAMPLE: usize = 2000;
/// What counts as on the plane, in shares of the points' median distance from their middle.
const TOLERANCE: f64 = 0.02;
/// Rounds of least squares.
const ROUNDS: usize = 12;
/// Then the tolerance shrinks to this many standard deviations of what lies on it.
const SIGMAS: f64 = 3.0;
/// A plane through the middle of a ball holds 2.3 % of it at this tolerance, the best of many
/// hardly 5 %. A plane that prevails holds more than this share.
const LEAST_SHARE: f64 = 0.15;
/// Points farther than this many times the median from the middle do not count.
const FAR: f64 = 100.0;
/// A second extent below this share of the first is none.
const THIN: f64 = 1e-6;

/// The plane that holds the most of the points, robust against any others.
///
/// # Errors
/// Too few points, points on a line, or no plane that holds more than a few of them.
pub fn dominant_plane(points_in_world: &[DVec3]) -> Result<DominantPlane, DominantPlaneError> {
    // 1. Around their middle, with their own measure.
    let finite: Vec<DVec3> = points_in_world
        .iter()
        .copied()
        .filter(|p| p.is_finite())
        .collect();
    if finite.len() < LEAST_POINTS {
        return Err(DominantPlaneError::TooFewPoints {
            found: finite.len(),
        });
    }
    let middle = |axis: usize| median(finite.iter().map(|p| p[axis]).collect());
    let origin = DVec3::new(middle(0), middle(1), middle(2));
    let mut points: Vec<DVec3> = finite.iter().map(|p| *p - origin).collect();
    let radius = median(points.iter().map(|p| p.length()).collect());
    points.retain(|p| p.length() <= FAR * radius);
    if points.len() < LEAST_POINTS {
        return Err(DominantPlaneError::TooFewPoints {
            found: points.len(),
        });
    }
    let tolerance = TOLERANCE * radius;

    // 2. Triples; the plane near which the few are cheapest, refined whenever one is better.
    let stride = points.len().div_ceil(SAMPLE);
    let few: Vec<DVec3> = points.iter().step_by(stride).copied().collect();
    let mut best: Option<(f64, Flat)> = None;
    for attempt in 0..TRIES {
        let pick = |k: u32| few[random(3 * attempt + k) as usize % few.len()];
        let Some(flat) = Flat::through(pick(0), pick(1), pick(2), radius) else {
            continue;
        };
        let cost = flat.cost(&few, tolerance);
        if best.is_none_or(|(least, _)| cost < least) {
            let refined = flat.refined(&few, tolerance, 2);
            let refined_cost = refined.cost(&few, tolerance);
            best = Some(if refined_cost < cost {
                (refined_cost, refined)
            } else {
                (cost, flat)
            });
        }
    }
    let Some((_, flat)) = best else {
        return Err(DominantPlaneError::Collinear);
    };

    // 3. All points, with a tolerance as fine as theirs.
    let flat = flat.refined(&points, tolerance, ROUNDS);
    let on: Vec<f64> = points
        .iter()
        .map(|p| flat.distance(*p))
        .filter(|d| *d <= tolerance)
        .collect();
    let prevails = on.len() >= LEAST_POINTS && on.len() as f64 > LEAST_SHARE * points.len() as f64;
    if !prevails {
        return Err(DominantPlaneError::NonePrevails {
            inliers: on.len(),
            points: points.len(),
        });
    }
    let sigma = 1.4826 * median(on);
    // Not below what digits tell.
    let finer = (SIGMAS * sigma).clamp(1e-3 * tolerance, tolerance);
    let flat = flat.refined(&points, finer, ROUNDS);
    let inliers: Vec<DVec3> = points
        .iter()
        .copied()
        .filter(|p| flat.distance(*p) <= finer)
        .collect();
    if on_a_line(&inliers) {
        return Err(DominantPlaneError::Collinear);
    }
    let plane =
        Plane::new(origin + flat.point, flat.normal).map_err(|_| DominantPlaneError::Collinear)?;
    Ok(DominantPlane {
        plane,
        inliers: inliers.len(),
        points: points.len(),
        tolerance: finer,
        condition: thinnest(inliers.iter().copied()).map_or(f64::INFINITY, |t| t.condition),
    })
}

/// A plane by a point and a unit normal, around the points' middle.
#[derive(Clone, Copy)]
struct Flat {
    point: DVec3,
    normal: DVec3,
}

impl Flat {
    /// `None` for triples too thin to tell by.
    fn through(a: DVec3, b: DVec3, c: DVec3, radius: f64) -> Option<Self> {
        let across = ((b - a) / radius).cross((c - a) / radius);
        let longest = (b - a).length().max((c - a).length()) / radius;
        let wide = across.length() > THIN * longest * longest;
        wide.then(|| Self {
            point: a,
            normal: across.normalize(),
        })
    }

    fn distance(&self, point: DVec3) -> f64 {
        self.normal.dot(point - self.point).abs()
    }

    /// Squared distances, those beyond the tolerance alike (Torr and Zisserman's MSAC).
    fn cost(&self, points: &[DVec3], tolerance: f64) -> f64 {
        let of = |p: &DVec3| (self.distance(*p) / tolerance).powi(2).min(1.0);
        points.iter().map(of).sum()
    }

    /// Least squares through the points near it, again and again.
    fn refined(self, points: &[DVec3], tolerance: f64, rounds: usize) -> Self {
        let mut flat = self;
        for _ in 0..rounds {
            let near = points.iter().filter(|p| flat.distance(**p) <= tolerance);
            let near: Vec<DVec3> = near.copied().collect();
            if near.len() < 3 || on_a_line(&near) {
                break;
            }
            let Some(thinnest) = thinnest(near.iter().copied()) else {
                break;
            };
            let mean = near.iter().sum::<DVec3>() / near.len() as f64;
            flat = Self {
                point: mean,
                normal: thinnest.direction.normalize_or(flat.normal),
            };
        }
        flat
    }
}

/// Whether points have no second extent.
fn on_a_line(points: &[DVec3]) -> bool {
    let Some(&first) = points.first() else {
        return true;
    };
    let farthest = points
        .iter()
        .map(|p| *p - first)
        .max_by(|a, b| a.length().total_cmp(&b.length()))
        .unwrap_or_default();
    let Some(along) = farthest.try_normalize() else {
        return true;
    };
    let aside = |p: &DVec3| (*p - first).reject_from_normalized(along).length();
    points.iter().map(aside).fold(0.0, f64::max) <= THIN * farthest.length()
}

/// A number from a number (the finaliser of MurmurHash3).
fn random(i: u32) -> u32 {
    let mut h = i.wrapping_add(1).wrapping_mul(0x9e37_79b9);
    h ^= h >> 16;
    h = h.wrapping_mul(0x85eb_ca6b);
    h ^= h >> 13;
    h = h.wrapping_mul(0xc2b2_ae35);
    h ^ (h >> 16)
}
