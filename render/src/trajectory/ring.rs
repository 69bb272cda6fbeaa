//! Cameras around a place that they look at.

use super::PI;
use super::capture::median;
use glam::DVec3;

/// Directions to within 10° of straight above or below something tell no azimuth.
const POLE: f64 = PI / 18.0;
/// The cameras leave gaps of azimuths below this where they go around something.
const WIDEST_GAP: f64 = PI / 2.0;
/// So many azimuths are an arc around something, where only one gap is wider.
const LEAST_ARC: f64 = 2.0 * PI / 3.0;
/// Cameras around something are few where their spacing is so much of the radius in plan, or more: of 24 evenly all around.
/// A mean of those about a place lies well within the ring, where no photo was taken.
const FEW_AROUND: f64 = 0.5;

/// Nearer to what they surround than so many times the nearest camera is, means of their places lie within the ring.
const WITHIN: f64 = 0.9;
/// The sine of 25°. Whoever passes by closer to straight above something, looking at it, whirls round: by more than
/// twice as much as anywhere else.
const ABOVE: f64 = 0.42;

/// Cameras around a place.
pub(super) struct Ring {
    pub(super) focus: DVec3,
    pub(super) up: DVec3,
    /// Towards the reference camera; azimuths grow to its right.
    pub(super) zero: DVec3,
    pub(super) quarter: DVec3,
    /// Azimuth, elevation and distance.
    pub(super) cameras: Vec<[f64; 3]>,
}

impl Ring {
    /// Whether the cameras go around, or along an arc, in plan.
    pub(super) fn surrounds(&self) -> bool {
        let aside = self.cameras.iter().filter(|c| c[1].abs() < PI / 2.0 - POLE);
        let azimuths: Vec<f64> = aside.map(|c| c[0]).collect();
        let are_most = 2 * azimuths.len() > self.cameras.len();
        let mut widths: Vec<f64> = gaps(azimuths).iter().map(|gap| gap.0).collect();
        widths.sort_by(|a, b| b.total_cmp(a));
        let limits = [2.0 * PI - LEAST_ARC, WIDEST_GAP];
        are_most && widths.iter().zip(limits).all(|(gap, limit)| *gap < limit)
    }

    /// Whether it is of few cameras, so far apart; see [`FEW_AROUND`].
    pub(super) fn is_sparse(&self, spacing: f64) -> bool {
        let in_plan = |c: &[f64; 3]| c[2] * c[1].cos();
        let radius = median(self.cameras.iter().map(in_plan).collect());
        radius.is_some_and(|radius| spacing >= FEW_AROUND * radius)
    }

    /// Whether a place is as far off as cameras are, and beside what they surround rather than above or below it; see
    /// [`WITHIN`] and [`ABOVE`].
    pub(super) fn is_beside(&self, place: DVec3) -> bool {
        let distances = self.cameras.iter().map(|c| c[2]);
        let nearest = distances.fold(f64::INFINITY, f64::min);
        let off = place - self.focus;
        let far = off.length();
        far >= WITHIN * nearest && off.cross(self.up).length() >= ABOVE * far
    }

    /// Azimuths from where to where, and whether that is all around: it is where no gap
    /// reaches 90°. Otherwise the gap is left out, and a tenth of the rest at both ends.
    pub(super) fn arc(&self) -> (f64, f64, bool) {
        let gaps = gaps(self.cameras.iter().map(|c| c[0]).collect());
        let wider = |widest: (f64, f64), gap: (f64, f64)| match gap.0 > widest.0 {
            true => gap,
            false => widest,
        };
        let (gap, start) = gaps.into_iter().fold((0.0, 0.0), wider);
        if gap < WIDEST_GAP {
            return (0.0, 2.0 * PI, true);
        }
        let span = 2.0 * PI - gap;
        (start + 0.1 * span, start + 0.9 * span, false)
    }

    /// The place at an azimuth, its distance and elevation the mean of the cameras'
    /// thereabouts (a window of some 20°).
    pub(super) fn at(&self, azimuth: f64) -> DVec3 {
        const SHARPNESS: f64 = 8.0;
        let off = |c: &[f64; 3]| 1.0 - (c[0] - azimuth).cos();
        let nearest = self.cameras.iter().map(off).fold(f64::INFINITY, f64::min);
        let (mut sum, mut elevation, mut distance) = (0.0, 0.0, 0.0);
        for c in &self.cameras {
            let weight = (SHARPNESS * (nearest - off(c))).exp();
            sum += weight;
            elevation += weight * c[1];
            distance += weight * c[2];
        }
        // Just short of the pole, where there would be no up.
        let elevation = (elevation / sum).clamp(-0.47 * PI, 0.47 * PI);
        let level = self.zero * azimuth.cos() + self.quarter * azimuth.sin();
        let direction = level * elevation.cos() + self.up * elevation.sin();
        self.focus + direction * (distance / sum)
    }
}

/// The gaps between azimuths that follow one another, once around: how wide each is, and where it ends.
fn gaps(mut azimuths: Vec<f64>) -> Vec<(f64, f64)> {
    azimuths.sort_by(f64::total_cmp);
    let again = azimuths.first().map(|first| first + 2.0 * PI);
    let ends = azimuths.iter().copied().skip(1).chain(again);
    let both = azimuths.iter().zip(ends);
    both.map(|(start, end)| (end - start, end)).collect()
}
