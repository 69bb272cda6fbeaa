//! Which source views a frame scored. No picture depends on it.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// Counts, on all threads; the same whatever their number.
#[derive(Debug, Default)]
pub(crate) struct Tally {
    /// By source view.
    ever: Vec<AtomicBool>,
    questions: AtomicU64,
    scorings: AtomicU64,
}

impl Tally {
    pub(crate) fn new(sources: usize) -> Self {
        Self {
            ever: (0..sources).map(|_| AtomicBool::new(false)).collect(),
            ..Self::default()
        }
    }

    /// That when it was asked for a point, triangle or tile of pixels, the views `found` are scored.
    pub(crate) fn note(&self, found: impl ExactSizeIterator<Item = u32>) {
        self.questions.fetch_add(1, Ordering::Relaxed);
        let count = found.len() as u64;
        self.scorings.fetch_add(count, Ordering::Relaxed);
        for i in found {
            let ever = &self.ever[i as usize];
            // Mostly they were, and a line of cache that is only read is shared.
            if !ever.load(Ordering::Relaxed) {
                ever.store(true, Ordering::Relaxed);
            }
        }
    }

    pub(crate) fn scored(&self) -> Scored {
        Scored {
            questions: self.questions.load(Ordering::Relaxed),
            scorings: self.scorings.load(Ordering::Relaxed),
            ever: self
                .ever
                .iter()
                .map(|e| e.load(Ordering::Relaxed))
                .collect(),
        }
    }
}

/// What was scored for a frame so far: see [`Frame::scored`](crate::Frame::scored).
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Scored {
    /// How often it was asked which views to score: for vertices, triangles and tiles of pixels,
    /// again where too few were found.
    pub questions: u64,
    /// How many views were, over all of them.
    pub scorings: u64,
    /// Whether a source view ever was.
    pub ever: Vec<bool>,
}
