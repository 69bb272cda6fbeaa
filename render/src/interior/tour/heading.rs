//! Where one looks who goes along a way.

use super::way::Way;
use glam::{DVec2, DVec3};
use std::f64::consts::{PI, TAU};

/// How far ahead one looks, and how far before and after a place what one sees there counts; in eye
/// heights.
const LOOK_AHEAD: f64 = 0.8;
const TURN: f64 = 0.6;
/// Between places where it is asked which way is ahead, likewise, and how many there are at most.
const STEP: f64 = 0.02;
const MOST: f64 = 2e5;
/// As good as straight back, in radians: rounding is not to say to which side one turns.
const TIE: f64 = 1e-6;

/// The headings along a way: at each place the mean, over [`TURN`] before and after it, of the angles at
/// which one looks ahead.
///
/// Angles go on from place to place, past a whole turn too, so whoever turns back sweeps over all
/// directions between; the mean of such directions as vectors is none.
pub(super) struct Headings {
    /// The directions of angles 0 and a quarter turn.
    axes: [DVec3; 2],
    /// Half of what the mean is over, in world units.
    reach: f64,
    /// Between places.
    step: f64,
    /// At each place, in radians.
    angles: Vec<f64>,
    /// Their integral from the start.
    sums: Vec<f64>,
}

impl Headings {
    /// Along a way smoothed over `smooth`; `unit` is the eyes' height. Where nothing says which way is
    /// ahead, as straight up a hatch, it is as it was before, or at the start as it will be.
    pub(super) fn new(way: &Way, up: DVec3, unit: f64, smooth: f64) -> Self {
        let across = up.any_orthonormal_vector();
        let axes = [across, up.cross(across)];
        let length = way.length();
        let steps = (length / (STEP * unit)).ceil().clamp(1.0, MOST);
        let step = length / steps;
        // 1. Which way is ahead.
        let ahead = |i: usize| {
            let along = step * i as f64;
            let there = way.smoothed(along + LOOK_AHEAD * unit, smooth);
            let off = there - way.smoothed(along, smooth);
            let off = DVec2::new(off.dot(axes[0]), off.dot(axes[1]));
            (off.length() > 1e-6 * unit).then(|| off.y.atan2(off.x))
        };
        let known: Vec<Option<f64>> = (0..=steps as usize).map(ahead).collect();
        // 2. Each angle within half a turn of the one before.
        let mut angle = known.iter().flatten().next().copied().unwrap_or(0.0);
        let mut angles = Vec::with_capacity(known.len());
        for ahead in known {
            angle += ahead.map_or(0.0, |ahead| turn(angle, ahead));
            angles.push(angle);
        }
        // 3. Their integral.
        let mut sums = vec![0.0];
        for pair in angles.windows(2) {
            sums.push(sums[sums.len() - 1] + 0.5 * step * (pair[0] + pair[1]));
        }
        Self {
            axes,
            reach: TURN * unit,
            step,
            angles,
            sums,
        }
    }

    /// The heading so far along the way, of unit length and level.
    pub(super) fn at(&self, along: f64) -> DVec3 {
        let [from, to] = [along - self.reach, along + self.reach].map(|s| self.integral(s));
        let angle = (to - from) / (2.0 * self.reach);
        angle.cos() * self.axes[0] + angle.sin() * self.axes[1]
    }

    /// Of the angles from the start so far; beside the way they are as at its ends.
    fn integral(&self, along: f64) -> f64 {
        let last = self.angles.len() - 1;
        let length = self.step * last as f64;
        if along <= 0.0 {
            return along * self.angles[0];
        }
        if along >= length {
            return self.sums[last] + (along - length) * self.angles[last];
        }
        let at = along / self.step;
        let i = (at as usize).min(last - 1);
        let share = at - i as f64;
        let [from, to] = [self.angles[i], self.angles[i + 1]];
        let here = from + share * (to - from);
        self.sums[i] + 0.5 * share * self.step * (from + here)
    }
}

/// How far to turn from an angle to another, in radians: at most half a turn, and straight back always to
/// the same side.
fn turn(from: f64, to: f64) -> f64 {
    let turn = (to - from).rem_euclid(TAU);
    if turn > PI + TIE { turn - TAU } else { turn }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Degrees from each of so many headings to the next.
    fn turns(stops: &[[f64; 3]], count: usize) -> Vec<f64> {
        let way = Way::new(stops.iter().map(|p| DVec3::from_array(*p)).collect());
        let headings = Headings::new(&way, DVec3::Y, 1.6, 0.35);
        let at = |i: usize| headings.at(way.length() * i as f64 / count as f64);
        let headings: Vec<DVec3> = (0..=count).map(at).collect();
        let turn = |pair: &[DVec3]| {
            assert!((pair[0].length() - 1.0).abs() < 1e-9 && pair[0].y.abs() < 1e-9);
            pair[0].angle_between(pair[1]).to_degrees()
        };
        headings.windows(2).map(turn).collect()
    }

    #[test]
    fn who_comes_back_from_a_dead_end_turns_round_by_and_by() {
        // Four metres there and back, of 2 cm each: half a turn within 1.92 m.
        let turns = turns(&[[0.0; 3], [4.0, 0.0, 0.0], [0.0; 3]], 400);
        let most = turns.iter().copied().fold(0.0, f64::max);
        assert!(most < 2.0, "{most}");
        assert!((turns.iter().sum::<f64>() - 180.0).abs() < 0.1);
        // Always to the same side, whatever rounding does.
        for noise in [-1e-9, 0.0, 1e-9] {
            let turn = turn(0.3, 0.3 - PI + noise);
            assert!((turn - PI).abs() < 1e-8, "{turn}");
        }
        assert!((turn(0.1, -0.1) + 0.2).abs() < 1e-12);
    }

    #[test]
    fn who_goes_straight_on_or_up_turns_nowhere() {
        let ahead = [[0.0; 3], [1.0, 0.0, 0.5], [4.0, 0.0, 2.0]];
        let hatch = [[0.0; 3], [3.0, 0.0, 0.0], [3.0, 3.0, 0.0]];
        for stops in [&ahead, &hatch] {
            assert!(turns(stops, 100).iter().all(|turn| *turn < 1e-3));
        }
    }
}
