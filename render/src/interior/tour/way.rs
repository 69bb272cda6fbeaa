//! The line that a tour goes along.

use glam::DVec3;

/// A line from stop to stop.
pub(super) struct Way {
    stops: Vec<DVec3>,
    /// How far along each is.
    along: Vec<f64>,
}

impl Way {
    pub(super) fn new(stops: Vec<DVec3>) -> Self {
        let mut along = vec![0.0];
        for pair in stops.windows(2) {
            along.push(along[along.len() - 1] + pair[0].distance(pair[1]));
        }
        Self { stops, along }
    }

    pub(super) fn length(&self) -> f64 {
        self.along[self.along.len() - 1]
    }

    pub(super) fn at(&self, along: f64) -> DVec3 {
        let along = along.clamp(0.0, self.length());
        let after = self.along.partition_point(|a| *a < along).max(1);
        let Some(&q) = self.stops.get(after) else {
            return self.stops[self.stops.len() - 1];
        };
        let (from, to) = (self.along[after - 1], self.along[after]);
        let share = if to > from {
            (along - from) / (to - from)
        } else {
            0.0
        };
        self.stops[after - 1].lerp(q, share)
    }

    /// The mean over some way before and after, less the farther.
    pub(super) fn smoothed(&self, along: f64, reach: f64) -> DVec3 {
        let weight = |k: i32| f64::from(9 - k.abs());
        let steps = -8..=8;
        let sum: DVec3 = steps
            .clone()
            .map(|k| weight(k) * self.at(along + 2.0 * reach * f64::from(k) / 8.0))
            .sum();
        sum / steps.map(weight).sum::<f64>()
    }
}
