//! The blending field is continuous where cameras leave the field of view.

use crate::blend::{dense, grid};
use crate::common::pinhole;

use calibrate::Pixel;
use glam::DVec3;
use render::reference::blend_at;
use render::{Blend, FieldOptions, Frame, Lumigraph};

/// The largest jump of the weights (half the sum of their changes: the part of the total
/// that moves) left when the worst steps along a way through the picture are bisected to
/// nothing. Only where a photo sees the point at both ends.
fn largest_jump(at: impl Fn(f64) -> Vec<f64>) -> f64 {
    const STEPS: usize = 400;
    const WORST: usize = 12;
    let change = |a: &[f64], b: &[f64]| -> f64 {
        let covered = |w: &[f64]| w.iter().any(|w| *w > 0.0);
        if !covered(a) || !covered(b) {
            return 0.0;
        }
        0.5 * a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum::<f64>()
    };
    let samples: Vec<Vec<f64>> = (0..=STEPS).map(|i| at(i as f64 / STEPS as f64)).collect();
    let mut steps: Vec<usize> = (0..STEPS).collect();
    steps.sort_by(|&i, &j| {
        let of = |i: usize| change(&samples[i], &samples[i + 1]);
        of(j).total_cmp(&of(i))
    });
    let mut largest = 0.0_f64;
    for &i in &steps[..WORST] {
        let (mut low, mut high) = (i as f64 / STEPS as f64, (i + 1) as f64 / STEPS as f64);
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            let (a, m, b) = (at(low), at(middle), at(high));
            if change(&a, &m) >= change(&m, &b) {
                high = middle;
            } else {
                low = middle;
            }
        }
        largest = largest.max(change(&at(low), &at(high)));
    }
    largest
}

/// Over rows of the picture and over moves of the desired camera.
fn largest_jump_of(lumigraph: &Lumigraph, options: FieldOptions) -> f64 {
    let count = lumigraph.sources.len();
    let mut largest = 0.0_f64;
    for i in 0..5 {
        let y = 0.25 * f64::from(i);
        let desired = |x: f64| {
            pinhole(
                DVec3::new(x, y, -3.3 - y),
                DVec3::new(0.8, 0.5, 0.0),
                80.0,
                (160, 120),
            )
        };
        let field = |frame: &Frame<'_>, pixel: Pixel| {
            let point = frame
                .proxy_point(pixel)
                .expect("the wall fills the picture");
            dense(&blend_at(frame, &point), count)
        };
        let frame = Frame::new(lumigraph, desired(0.6), options);
        let along_a_row = |s: f64| field(&frame, Pixel::new(160.0 * s, 10.0 + 25.0 * f64::from(i)));
        let along_a_path = |s: f64| {
            let frame = Frame::new(lumigraph, desired(2.0 * s - 0.3), options);
            field(&frame, Pixel::new(20.0 + 30.0 * f64::from(i), 50.0))
        };
        largest = largest
            .max(largest_jump(along_a_row))
            .max(largest_jump(along_a_path));
    }
    largest
}

#[test]
fn weights_are_continuous_where_a_camera_leaves_the_field_of_view() {
    // Few cameras, of which some pixels see only one; and many. (The cap of sixteen does
    // jump, 9 % at k = 16; about k views contribute, so at the default it does nothing.)
    let lumigraph = grid(4, 3);
    let few = largest_jump_of(&lumigraph, FieldOptions::default());
    let many = largest_jump_of(&grid(8, 8), FieldOptions::default());
    let more = largest_jump_of(
        &grid(8, 8),
        FieldOptions {
            k: 3,
            ..FieldOptions::default()
        },
    );
    let paper = largest_jump_of(
        &lumigraph,
        FieldOptions {
            blend: Blend::Paper,
            ..FieldOptions::default()
        },
    );
    println!("largest jumps: {few:e} of few, {many:e} and {more:e} of many; paper {paper}");
    assert!(few.max(many).max(more) <= 0.002, "{few}, {many}, {more}");
    assert!(
        paper > 0.02,
        "the paper's form jumps, or this test finds no jumps: {paper}"
    );
}
