//! Masks of an object, and how far each pixel is from their border.

/// Which pixels of a photo show the object.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Silhouette {
    width: u32,
    height: u32,
    inside: Vec<bool>,
}

impl Silhouette {
    /// From a grey mask or an alpha channel, row by row: 128 and more is the object. `None`
    /// where the number of values is not width × height.
    pub fn from_values(width: u32, height: u32, values: &[u8]) -> Option<Self> {
        Self::new(width, height, values.iter().map(|v| *v >= 128).collect())
    }

    /// From one truth value a pixel, row by row. `None` where there are not width × height.
    pub fn new(width: u32, height: u32, inside: Vec<bool>) -> Option<Self> {
        let pixels = width as usize * height as usize;
        (inside.len() == pixels).then_some(Self {
            width,
            height,
            inside,
        })
    }

    /// Pixels across and down.
    pub fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// One truth value a pixel, row by row.
    pub fn inside(&self) -> &[bool] {
        &self.inside
    }

    /// How many pixels show the object.
    pub fn area(&self) -> usize {
        self.inside.iter().filter(|i| **i).count()
    }

    /// Whether it has a border: some pixels show the object and others don't.
    pub fn has_border(&self) -> bool {
        let area = self.area();
        area > 0 && area < self.inside.len()
    }

    /// Whether the object comes within so many pixels of the image's border, so that it may
    /// go on beyond it.
    pub(crate) fn reaches_border(&self, within_px: u32) -> bool {
        let band = within_px.max(1);
        let near = |i: u32, size: u32| i < band || i + band >= size;
        let width = self.width as usize;
        self.inside.iter().enumerate().any(|(i, inside)| {
            *inside
                && (near((i % width) as u32, self.width) || near((i / width) as u32, self.height))
        })
    }

    /// The silhouette at a whole fraction of its size: a pixel shows the object where half of
    /// the pixels that it takes the place of do. What is left over at the right and at the
    /// bottom counts as not the object.
    pub(crate) fn reduced(&self, factor: u32) -> Self {
        let (width, height) = (self.width.div_ceil(factor), self.height.div_ceil(factor));
        let mut counts = vec![0_u32; width as usize * height as usize];
        for (i, inside) in self.inside.iter().enumerate() {
            let (column, row) = (i as u32 % self.width, i as u32 / self.width);
            let to = (row / factor) as usize * width as usize + (column / factor) as usize;
            counts[to] += u32::from(*inside);
        }
        let half = factor * factor;
        Self {
            width,
            height,
            inside: counts.iter().map(|count| 2 * count >= half).collect(),
        }
    }

    /// For every pixel's centre, how many pixels it is from the silhouette's border:
    /// positive inside, negative outside, zero midway between neighbours that differ.
    ///
    /// Exact Euclidean distances by Felzenszwalb and Huttenlocher 2012 ("Distance
    /// Transforms of Sampled Functions"), less the half pixel to the border. The silhouette
    /// must have a border.
    pub(crate) fn signed_distances_px(&self) -> Vec<f32> {
        let (width, height) = (self.width as usize, self.height as usize);
        let to_outside = distances_squared(&self.inside, width, height, false);
        let to_inside = distances_squared(&self.inside, width, height, true);
        let signed = to_outside.iter().zip(&to_inside);
        signed
            .map(|(outside, inside)| {
                if *inside == 0.0 {
                    outside.sqrt() - 0.5
                } else {
                    0.5 - inside.sqrt()
                }
            })
            .collect()
    }
}

/// The squared distance from every pixel to the nearest whose value is `wanted`.
fn distances_squared(values: &[bool], width: usize, height: usize, wanted: bool) -> Vec<f32> {
    // 1. Along columns: whole numbers, in two sweeps.
    let far = (width + height) as u32;
    let mut steps = vec![far; width * height];
    for row in 0..height {
        for column in 0..width {
            let i = row * width + column;
            steps[i] = match () {
                () if values[i] == wanted => 0,
                () if row > 0 => (steps[i - width] + 1).min(far),
                () => far,
            };
        }
    }
    for i in (0..width * height.saturating_sub(1)).rev() {
        steps[i] = steps[i].min(steps[i + width] + 1);
    }
    // 2. Along rows: the lower envelope of the parabolas (x − i)² + steps[i]².
    let mut result = vec![0.0_f32; width * height];
    let mut apexes: Vec<(usize, f64)> = Vec::with_capacity(width);
    let mut starts: Vec<f64> = Vec::with_capacity(width);
    for row in 0..height {
        apexes.clear();
        starts.clear();
        for (i, step) in steps[row * width..][..width].iter().enumerate() {
            let value = f64::from(*step) * f64::from(*step);
            let x = i as f64;
            let mut start = f64::NEG_INFINITY;
            while let Some(&(j, other)) = apexes.last() {
                let y = j as f64;
                let meet = ((value + x * x) - (other + y * y)) / (2.0 * (x - y));
                if meet > starts[starts.len() - 1] {
                    start = meet;
                    break;
                }
                apexes.pop();
                starts.pop();
            }
            apexes.push((i, value));
            starts.push(start);
        }
        let mut lowest = 0;
        for (i, out) in result[row * width..][..width].iter_mut().enumerate() {
            while lowest + 1 < starts.len() && starts[lowest + 1] < i as f64 {
                lowest += 1;
            }
            let (apex, value) = apexes[lowest];
            let along = i as f64 - apex as f64;
            *out = (along * along + value) as f32;
        }
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn distances_are_those_of_a_plain_search(
            values in proptest::collection::vec(any::<bool>(), 7 * 5)
        ) {
            let silhouette = Silhouette::new(7, 5, values).unwrap();
            prop_assume!(silhouette.has_border());
            let found = silhouette.signed_distances_px();
            for i in 0..35_usize {
                let here = silhouette.inside()[i];
                let nearest = (0..35_usize)
                    .filter(|j| silhouette.inside()[*j] != here)
                    .map(|j| (i % 7).abs_diff(j % 7).pow(2) + (i / 7).abs_diff(j / 7).pow(2))
                    .min()
                    .unwrap();
                let distance = (nearest as f32).sqrt() - 0.5;
                let expected = if here { distance } else { -distance };
                prop_assert!((found[i] - expected).abs() < 1e-5);
            }
        }
    }

    #[test]
    fn halves_count_as_the_object_and_leftovers_do_not() {
        let values = [255, 255, 0, 255, 0, 0, 0, 255, 0, 0, 0, 255];
        let silhouette = Silhouette::from_values(4, 3, &values).unwrap();
        assert_eq!(silhouette.area(), 5);
        let half = silhouette.reduced(2);
        assert_eq!(half.size(), (2, 2));
        assert_eq!(half.inside(), [true, true, false, false]);
        assert!(silhouette.reaches_border(1));
        assert_eq!(Silhouette::from_values(4, 4, &values), None);
    }
}
