//! How samples lie in layers: the papers' tables.

use super::Layered;

/// Samples by layer.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Layers {
    /// Samples in layer 1, 2, …: pixels with at least so many.
    pub samples: Vec<usize>,
}

impl Layers {
    /// All samples.
    pub fn total(&self) -> usize {
        self.samples.iter().sum()
    }

    /// The share of all samples in layers `from` to `to`, both counted from 1.
    pub fn share(&self, from: usize, to: usize) -> f64 {
        let last = to.min(self.samples.len());
        let some: usize = self.samples[(from.max(1) - 1).min(last)..last].iter().sum();
        some as f64 / self.total().max(1) as f64
    }
}

/// Counts an LDI's samples by layer (Popescu et al. 1998, Table 1; Rafferty et al. 1998, "Images
/// for accelerating architectural walkthroughs", Figure 5).
pub fn layers(ldi: &Layered) -> Layers {
    let mut samples = Vec::new();
    for count in ldi.counts() {
        let count = usize::from(count);
        if samples.len() < count {
            samples.resize(count, 0);
        }
        samples[..count].iter_mut().for_each(|n| *n += 1);
    }
    Layers { samples }
}
