//! Which photos the exact field samples, found before any is decoded.

use super::Engine;
use super::lanes::LANES;
use super::weights::{Term, weigh};
use crate::held::Held;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

/// Holds the photos that the exact field samples. `sources` are those that take part. Where
/// the store has room for all of them, nothing needs to be found out.
pub(super) fn hold<'a>(engine: &Engine<'a>, sources: &[usize]) -> Held<'a> {
    if Held::fit(engine.frame, sources) {
        return Held::new(engine.frame, sources);
    }
    Held::new(engine.frame, &marked(engine, sources))
}

/// The source views that have any weight at any pixel.
fn marked(engine: &Engine<'_>, sources: &[usize]) -> Vec<usize> {
    let used: Vec<AtomicBool> = sources.iter().map(|_| AtomicBool::new(false)).collect();
    let width = engine.frame.desired.width as usize;
    let of_row = |row: usize| {
        for x0 in (0..width).step_by(LANES) {
            let tile = engine.tile(x0, row, |_| true);
            let count = LANES.min(width - x0);
            let (seeing, mut terms): (Vec<usize>, Vec<Term>) = (0..sources.len())
                .filter_map(|at| {
                    let i = sources[at];
                    let mut sight = engine.sources[i].see(&tile)?;
                    engine.mask(i, &mut sight, |_| true);
                    let term = Term {
                        diff: engine.sources[i].difference(&tile),
                        a: sight.a,
                        weight: [0.0; LANES],
                    };
                    Some((at, term))
                })
                .unzip();
            weigh(&mut terms, &engine.frame.options);
            for (at, term) in seeing.into_iter().zip(&terms) {
                if term.weight[..count].iter().any(|w| *w > 0.0) {
                    used[at].store(true, Ordering::Relaxed);
                }
            }
        }
    };
    let rows = 0..engine.frame.desired.height as usize;
    rows.into_par_iter().for_each(of_row);
    let marked = sources.iter().zip(&used);
    marked
        .filter(|(_, used)| used.load(Ordering::Relaxed))
        .map(|(i, _)| *i)
        .collect()
}
