//! Sums over square windows, row after row of an image.

/// The side of the windows, in pixels.
pub(super) const WINDOW: usize = 5;
const RADIUS: usize = WINDOW / 2;

/// The last rows of an image of `C` numbers a pixel, each summed along itself; what lies beyond the
/// image's borders is zero. Whoever calls should be compiled for wide vectors.
pub(super) struct Windows<const C: usize> {
    width: usize,
    rows: [[Vec<f32>; C]; WINDOW],
    /// The row that enters next takes this one's place.
    oldest: usize,
    /// A row before it is summed, with nothing on both sides.
    line: [Vec<f32>; C],
}

impl<const C: usize> Windows<C> {
    pub(super) fn new(width: usize) -> Self {
        let rows = std::array::from_fn(|_| std::array::from_fn(|_| vec![0.0; width]));
        Self {
            width,
            rows,
            oldest: 0,
            line: std::array::from_fn(|_| vec![0.0; width + 2 * RADIUS]),
        }
    }

    /// Begins another image.
    pub(super) fn clear(&mut self) {
        self.rows.iter_mut().flatten().for_each(|row| row.fill(0.0));
        self.oldest = 0;
    }

    /// The next row, which `write` writes.
    #[inline(always)]
    pub(super) fn enter(&mut self, write: impl FnOnce([&mut [f32]; C])) {
        let width = self.width;
        write(self.line.each_mut().map(
            #[inline(always)]
            |line| &mut line[RADIUS..][..width],
        ));
        for (row, line) in self.rows[self.oldest].iter_mut().zip(&self.line) {
            sum_along(line, row);
        }
        self.oldest = (self.oldest + 1) % WINDOW;
    }

    /// A row beyond the image's border.
    pub(super) fn enter_nothing(&mut self) {
        let rows = &mut self.rows[self.oldest];
        rows.iter_mut().for_each(|row| row.fill(0.0));
        self.oldest = (self.oldest + 1) % WINDOW;
    }

    /// The sums over the windows whose last row entered last.
    #[inline(always)]
    pub(super) fn sums(&self, out: [&mut [f32]; C]) {
        for (channel, out) in out.into_iter().enumerate() {
            sum_rows(self.rows.each_ref().map(|row| &row[channel][..]), out);
        }
    }
}

#[inline(always)]
fn sum_along(line: &[f32], out: &mut [f32]) {
    let width = out.len();
    let [a, b, c, d, e] = std::array::from_fn(|shift| &line[shift..][..width]);
    for x in 0..width {
        out[x] = (a[x] + b[x]) + (c[x] + d[x]) + e[x];
    }
}

/// Rows are added in the order in which they lie in memory: of one window always the same, so
/// that the sums of equal images are equal.
#[inline(always)]
fn sum_rows([a, b, c, d, e]: [&[f32]; WINDOW], out: &mut [f32]) {
    let width = out.len();
    let (a, b, c, d, e) = (
        &a[..width],
        &b[..width],
        &c[..width],
        &d[..width],
        &e[..width],
    );
    for x in 0..width {
        out[x] = (a[x] + b[x]) + (c[x] + d[x]) + e[x];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_are_those_of_the_windows_pixels() {
        for (width, height) in [(1, 1), (2, 7), (9, 3), (23, 11)] {
            let value = |x: usize, y: usize| ((x * 7 + y * 13) % 29) as f32 - 11.0;
            let mut windows = Windows::<2>::new(width);
            // What was there before is forgotten.
            windows.enter(|[a, b]| {
                a.fill(5.0);
                b.fill(7.0);
            });
            windows.clear();
            for last in 0..height + RADIUS {
                if last < height {
                    windows.enter(|[a, b]| {
                        for x in 0..width {
                            a[x] = value(x, last);
                            b[x] = 1.0;
                        }
                    });
                } else {
                    windows.enter_nothing();
                }
                let Some(y) = last.checked_sub(RADIUS) else {
                    continue;
                };
                let mut sums = [vec![0.0; width], vec![0.0; width]];
                let [a, b] = &mut sums;
                windows.sums([a, b]);
                for x in 0..width {
                    let rows = y.saturating_sub(RADIUS)..(y + RADIUS + 1).min(height);
                    let columns = x.saturating_sub(RADIUS)..(x + RADIUS + 1).min(width);
                    let around = rows.flat_map(|y| columns.clone().map(move |x| (x, y)));
                    let sum: f32 = around.clone().map(|(x, y)| value(x, y)).sum();
                    let found = [sums[0][x], sums[1][x]];
                    assert_eq!(found, [sum, around.count() as f32], "{x} {y}");
                }
            }
        }
    }
}
