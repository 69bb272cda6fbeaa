//! Which photos the exact field samples, found before any is decoded.

use super::asked::Asked;
use super::{BAND, Engine, Seen};
use crate::held::Held;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

/// Those of `sources`, which take part, that the exact field samples. Where the store has room for all of them, nothing
/// needs to be found out.
pub(super) fn wanted(engine: &Engine<'_>, sources: Vec<usize>) -> Vec<usize> {
    match Held::fit(engine.frame, &sources) {
        true => sources,
        false => marked(engine),
    }
}

/// The source views that have any weight at any pixel, in order.
fn marked(engine: &Engine<'_>) -> Vec<usize> {
    let sources = engine.frame.lumigraph.sources.iter();
    let used: Vec<AtomicBool> = sources.map(|_| AtomicBool::new(false)).collect();
    let of_band = |scratch: &mut (Asked, Seen), band: usize| {
        let done = engine.weigh_band(band, scratch, |_, seen| {
            for (i, _, term) in seen.iter() {
                if term.weight.iter().any(|w| *w > 0.0) {
                    used[i].store(true, Ordering::Relaxed);
                }
            }
            Ok(())
        });
        done.expect("no photo is asked for");
    };
    let bands = 0..(engine.frame.desired.height as usize).div_ceil(BAND);
    bands
        .into_par_iter()
        .for_each_init(Default::default, of_band);
    let used = used.iter().enumerate();
    used.filter(|(_, used)| used.load(Ordering::Relaxed))
        .map(|(i, _)| i)
        .collect()
}
