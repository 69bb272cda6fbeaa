//! Exact distances on a grid.

/// The squared distance of each square of a grid to the nearest of some, in squares, and which
/// that is; infinite where there are none (Felzenszwalb and Huttenlocher 2012, "Distance
/// transforms of sampled functions").
pub(super) fn squared_distances(
    [width, height]: [usize; 2],
    is_source: impl Fn(usize) -> bool,
) -> (Vec<f64>, Vec<u32>) {
    let mut distances = vec![f64::INFINITY; width * height];
    let mut nearest = vec![u32::MAX; width * height];
    for i in 0..width * height {
        if is_source(i) {
            distances[i] = 0.0;
            nearest[i] = i as u32;
        }
    }
    let mut line = Envelope::default();
    for x in 0..width {
        line.transform(&mut distances, &mut nearest, x, width, height);
    }
    for y in 0..height {
        line.transform(&mut distances, &mut nearest, y * width, 1, width);
    }
    (distances, nearest)
}

/// The lower envelope of parabolas along a line.
#[derive(Default)]
struct Envelope {
    values: Vec<(f64, u32)>,
    /// A parabola's apex, and from where on it is the lowest.
    parabolas: Vec<(usize, f64)>,
}

impl Envelope {
    fn transform(
        &mut self,
        distances: &mut [f64],
        nearest: &mut [u32],
        first: usize,
        stride: usize,
        count: usize,
    ) {
        self.values.clear();
        self.parabolas.clear();
        let at = |i: usize| first + i * stride;
        self.values
            .extend((0..count).map(|i| (distances[at(i)], nearest[at(i)])));
        let height = |i: usize| self.values[i].0 + (i * i) as f64;
        for i in (0..count).filter(|i| self.values[*i].0.is_finite()) {
            let mut from = f64::NEG_INFINITY;
            while let Some((apex, since)) = self.parabolas.last().copied() {
                from = (height(i) - height(apex)) / (2.0 * (i - apex) as f64);
                if from > since {
                    break;
                }
                self.parabolas.pop();
                from = f64::NEG_INFINITY;
            }
            self.parabolas.push((i, from));
        }
        if self.parabolas.is_empty() {
            return;
        }
        let mut k = 0;
        for i in 0..count {
            while k + 1 < self.parabolas.len() && self.parabolas[k + 1].1 < i as f64 {
                k += 1;
            }
            let apex = self.parabolas[k].0;
            let off = i as f64 - apex as f64;
            distances[at(i)] = self.values[apex].0 + off * off;
            nearest[at(i)] = self.values[apex].1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::squared_distances;

    #[test]
    fn distances_are_those_of_trying_all() {
        let size = [23, 17];
        for seed in 0..20_usize {
            let is_source = |i: usize| seed > 0 && (i * 7919 + seed * 104_729).is_multiple_of(61);
            let (distances, nearest) = squared_distances(size, is_source);
            for i in 0..size[0] * size[1] {
                let from = |j: usize| {
                    let x = (i % size[0]) as f64 - (j % size[0]) as f64;
                    let y = (i / size[0]) as f64 - (j / size[0]) as f64;
                    x * x + y * y
                };
                let all = (0..size[0] * size[1]).filter(|j| is_source(*j));
                let least = all.map(from).fold(f64::INFINITY, f64::min);
                assert_eq!(distances[i], least);
                if least.is_finite() {
                    assert!(is_source(nearest[i] as usize));
                    assert_eq!(from(nearest[i] as usize), least);
                }
            }
        }
    }
}
