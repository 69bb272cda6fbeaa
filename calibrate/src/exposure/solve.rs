//! One channel's gains: robust least squares in the logarithms.

use super::Observation;
use super::ties::Ties;
use std::ops::Range;

/// One channel of the observations, ordered by point.
#[derive(Clone, Debug, Default)]
pub(super) struct Channel {
    photo_count: usize,
    /// Of each observation: its photo, the logarithm of its value, what it counts for.
    photo: Vec<usize>,
    log: Vec<f64>,
    evidence: Vec<f64>,
    /// Of each point: where its observations begin; and the end of the last.
    start: Vec<usize>,
}

/// Sensor noise and blur weigh more where it is dark: a value counts for v²/(v² + v₀²).
const HALF_TRUSTED: f64 = 32.0;
/// Tukey's constant for 95 % efficiency on Gaussian noise (Holland and Welsch 1977).
const TUKEY: f64 = 4.685;
/// Huber's constant for the same; its steps bring Tukey's near the answer.
const HUBER: f64 = 1.345;
const HUBER_STEPS: usize = 5;
const TUKEY_STEPS: usize = 10;
/// How much of equal values their differences may keep by rounding.
const ROUNDING: f64 = 16.0 * f64::EPSILON;
/// No noise is assumed smaller than half a step of the stored values at white.
const MIN_NOISE: f64 = 0.5 / 255.0;

impl Channel {
    /// The observations that have a value in channel `c` and whose point `counts`; points
    /// with a single such observation say nothing and are left out.
    pub(super) fn new(
        photo_count: usize,
        by_point: &[&Observation],
        c: usize,
        counts: impl Fn(usize) -> bool,
    ) -> Self {
        let mut channel = Self {
            photo_count,
            ..Self::default()
        };
        for same_point in by_point.chunk_by(|a, b| a.point_idx == b.point_idx) {
            let values = || {
                same_point
                    .iter()
                    .filter_map(|o| Some((o.photo_idx, o.rgb[c]?)))
            };
            let count = values().count();
            if count < 2 || !counts(same_point[0].point_idx) {
                continue;
            }
            // All of a point's observations count alike, or the brighter would win.
            let mean = values().map(|(_, v)| v).sum::<f64>() / count as f64;
            let evidence = mean * mean / (mean * mean + HALF_TRUSTED * HALF_TRUSTED);
            channel.start.push(channel.photo.len());
            for (photo_idx, value) in values() {
                channel.photo.push(photo_idx);
                channel.log.push(value.ln());
                channel.evidence.push(evidence);
            }
        }
        channel.start.push(channel.photo.len());
        channel
    }

    /// How many observations each photo has here.
    pub(super) fn counts(&self) -> Vec<usize> {
        let mut counts = vec![0; self.photo_count];
        self.photo.iter().for_each(|&photo| counts[photo] += 1);
        counts
    }

    /// For each photo the lowest photo that shared points link it to; itself if none.
    fn groups(&self) -> Vec<usize> {
        let mut group: Vec<usize> = (0..self.photo_count).collect();
        // Whoever asks brings what it passes nearer to the root: long strips would be long ways.
        fn root(group: &mut [usize], mut i: usize) -> usize {
            while group[i] != i {
                group[i] = group[group[i]];
                i = group[i];
            }
            i
        }
        for range in self.start.windows(2) {
            let first = self.photo[range[0]];
            for &photo in &self.photo[range[0]..range[1]] {
                let a = root(&mut group, first);
                let b = root(&mut group, photo);
                group[a.max(b)] = a.min(b);
            }
        }
        for i in 0..group.len() {
            let lowest = root(&mut group, i);
            group[i] = lowest;
        }
        group
    }

    /// Robust least squares over log gainᵢ and log albedoₚ: iteratively reweighted, by
    /// Huber's function and then by Tukey's. Returns log gains by photo, which have the
    /// mean zero over each linked group, where each photo counts for its share.
    ///
    /// Beside the observations, whose noise is estimated, stands the prior that a log gain
    /// has the mean zero and the variance 1 / `precision`.
    pub(super) fn fit(&self, precision: f64, shares: &[f64]) -> Vec<f64> {
        let ties = Ties::new(self.photo_count, &self.photo, &self.start);
        self.fit_by(ties, precision, shares)
    }

    /// Some points by `ties`, the others one by one.
    fn fit_by(&self, mut ties: Ties, precision: f64, shares: &[f64]) -> Vec<f64> {
        let groups = self.groups();
        let mut log_gains = vec![0.0; self.photo_count];
        let mut weights = self.evidence.clone();
        let mut prior = 0.0;
        for step in 0..HUBER_STEPS + TUKEY_STEPS {
            self.solve(&mut ties, &weights, prior, &mut log_gains);
            center(&groups, shares, &mut log_gains);
            let residuals = self.residuals(&weights, &log_gains);
            let noise = self.noise(&residuals);
            prior = precision * noise * noise;
            for i in 0..residuals.len() {
                let u = residuals[i].abs() * self.evidence[i].sqrt() / noise;
                let robust = if step < HUBER_STEPS {
                    (HUBER / u).min(1.0)
                } else {
                    (1.0 - (u / TUKEY).powi(2)).max(0.0).powi(2)
                };
                weights[i] = self.evidence[i] * robust;
            }
        }
        log_gains
    }

    /// What is left of each observation's logarithm without its photo's gain and its
    /// point's albedo.
    fn residuals(&self, weights: &[f64], log_gains: &[f64]) -> Vec<f64> {
        let mut residuals: Vec<f64> = (0..self.log.len())
            .map(|i| self.log[i] - log_gains[self.photo[i]])
            .collect();
        self.less_point_means(weights, &mut residuals);
        residuals
    }

    /// Subtracts from the values of each point's observations their weighted mean, or
    /// where all weights are zero their plain mean.
    fn less_point_means(&self, weights: &[f64], values: &mut [f64]) {
        for (range, total) in self.start.windows(2).zip(self.totals(weights)) {
            let range = range[0]..range[1];
            let mean = mean(weights, total, range.clone(), |i| values[i]);
            values[range].iter_mut().for_each(|v| *v -= mean);
        }
    }

    /// The points' weights, each all of its observations'.
    fn totals(&self, weights: &[f64]) -> Vec<f64> {
        let total = |range: &[usize]| {
            let weights = weights[range[0]..range[1]].iter();
            weights.fold(0.0, |sum, weight| sum + weight)
        };
        self.start.windows(2).map(total).collect()
    }

    /// The median absolute residual as a Gaussian's standard deviation; a mean of n
    /// observations takes up 1/n of each one's variance.
    fn noise(&self, residuals: &[f64]) -> f64 {
        let mut sizes = Vec::with_capacity(residuals.len());
        for range in self.start.windows(2) {
            let n = (range[1] - range[0]) as f64;
            let whole = (n / (n - 1.0)).sqrt();
            let size = |i: usize| whole * residuals[i].abs() * self.evidence[i].sqrt();
            sizes.extend((range[0]..range[1]).map(size));
        }
        if sizes.is_empty() {
            return MIN_NOISE;
        }
        let middle = sizes.len() / 2;
        let (_, median, _) = sizes.select_nth_unstable_by(middle, f64::total_cmp);
        (1.4826 * *median).max(MIN_NOISE)
    }

    /// Adds to the photos' sums each value less its point's [`mean`], times its weight, of the given points'
    /// observations. `totals` are the points' weights.
    fn add_points(
        &self,
        points: impl Iterator<Item = usize>,
        weights: &[f64],
        totals: &[f64],
        value: impl Fn(usize) -> f64,
        sums: &mut [f64],
    ) {
        for point in points {
            let range = self.start[point]..self.start[point + 1];
            let mean = mean(weights, totals[point], range.clone(), &value);
            for i in range {
                sums[self.photo[i]] += weights[i] * (value(i) - mean);
            }
        }
    }

    /// The weighted least-squares gains, points eliminated (Schur's complement), by
    /// conjugate gradients with Jacobi's preconditioner from the gains given.
    fn solve(&self, ties: &mut Ties, weights: &[f64], prior: f64, x: &mut [f64]) {
        let count = self.photo_count;
        let totals = self.totals(weights);
        let mut b = vec![0.0; count];
        let all = 0..totals.len();
        self.add_points(all, weights, &totals, |i| self.log[i], &mut b);
        // S·x: each observation's x less its point's mean, weighted, summed by photo.
        ties.weigh(&self.photo, &self.start, weights, &totals);
        let rest = ties.rest().iter().copied();
        let multiply = |x: &[f64], product: &mut [f64]| {
            product.fill(0.0);
            ties.add_differences(x, product);
            let value = |i: usize| x[self.photo[i]];
            self.add_points(rest.clone(), weights, &totals, value, product);
        };
        let mut diagonal = vec![prior; count];
        for (&photo, weight) in self.photo.iter().zip(weights) {
            diagonal[photo] += weight;
        }
        let precondition = |r: &[f64]| -> Vec<f64> {
            let one = |(r, d): (&f64, &f64)| if *d > 0.0 { r / d } else { 0.0 };
            r.iter().zip(&diagonal).map(one).collect()
        };
        let dot = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };

        let mut product = vec![0.0; count];
        multiply(x, &mut product);
        let mut r: Vec<f64> = (0..count)
            .map(|i| b[i] - product[i] - prior * x[i])
            .collect();
        let mut z = precondition(&r);
        let mut p = z.clone();
        let mut rz = dot(&r, &z);
        // Where all values are alike b is nothing but their rounding.
        let squares = self.log.iter().zip(weights).map(|(log, w)| w * log * log);
        let rounding = ROUNDING * ROUNDING * squares.sum::<f64>();
        let enough = (1e-24 * dot(&b, &precondition(&b))).max(rounding);
        for _ in 0..20 * count.max(10) {
            if !(rz > enough) {
                break;
            }
            multiply(&p, &mut product);
            for i in 0..count {
                product[i] += prior * p[i];
            }
            // Along gains that nothing ties down, a whole group's or those beyond a link
            // without weight, the sum of squares is flat: what curvature is left is rounding,
            // and a step by it goes anywhere.
            let curvature = dot(&p, &product);
            let untied: f64 = diagonal.iter().zip(&p).map(|(d, p)| d * p * p).sum();
            if !(curvature > ROUNDING * untied) {
                break;
            }
            let step = rz / curvature;
            for i in 0..count {
                x[i] += step * p[i];
                r[i] -= step * product[i];
            }
            z = precondition(&r);
            let next = dot(&r, &z);
            for i in 0..count {
                p[i] = z[i] + next / rz * p[i];
            }
            rz = next;
        }
    }
}

/// The weighted mean of a point's observations, or where all their weights are zero the plain mean; `total` is what
/// the weights add up to.
fn mean(weights: &[f64], total: f64, range: Range<usize>, value: impl Fn(usize) -> f64) -> f64 {
    if total > 0.0 {
        let weighted = range.map(|i| weights[i] * value(i));
        weighted.fold(0.0, |sum, value| sum + value) / total
    } else {
        range.clone().map(value).sum::<f64>() / range.len() as f64
    }
}

/// Only ratios of gains are seen: the geometric mean of each linked group is one, where
/// each photo counts for its share. A group without shares stays as it is.
fn center(groups: &[usize], shares: &[f64], log_gains: &mut [f64]) {
    let mut sums = vec![(0.0, 0.0); log_gains.len()];
    for ((value, share), &group) in log_gains.iter().zip(shares).zip(groups) {
        sums[group].0 += share * value;
        sums[group].1 += share;
    }
    for (value, &group) in log_gains.iter_mut().zip(groups) {
        let (sum, total) = sums[group];
        if total > 0.0 {
            *value -= sum / total;
        }
    }
}

#[cfg(test)]
mod tests;
