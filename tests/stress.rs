//! Scenes that try to break things: `lumigraph bench --stress MINUTES` runs as many as one likes.

use lumigraph::bench::stress::{Outcome, watched};
use std::time::Duration;

/// Each crowd of photos before each surface several times.
const SCENES: u64 = 144;

/// Scenes that something was wrong with once.
const FOUND: [(u64, &str); 11] = [
    (
        145,
        "f32's rounding decided how photos at the viewer's place share",
    ),
    (
        150,
        "so did the world's place where two photos are at one place",
    ),
    (
        209,
        "seven and more photos at one place gave no points at all",
    ),
    (3437, "the photos' order"),
    (3622, "the photos' order"),
    (3689, "the photos' order"),
    (3841, "the photos' order"),
    (3985, "the photos' order"),
    (4345, "the photos' order"),
    (4993, "the photos' order"),
    (21353, "ties below what makes a difference"),
];

#[test]
fn whatever_the_scene_what_must_hold_holds() {
    let patience = Duration::from_secs(60);
    let seeds = (0..SCENES).chain(FOUND.map(|(seed, _)| seed));
    let bad: Vec<(u64, Outcome)> = seeds
        .map(|seed| (seed, watched(seed, patience)))
        .filter(|(_, outcome)| *outcome != Outcome::Held)
        .collect();
    assert!(bad.is_empty(), "{} of them: {bad:#?}", bad.len());
}
