//! Periods of made-up scenes.

use calibrate::{PeriodError, Snapshot, find_period};
use glam::DVec3;

const PLACES: usize = 200;

/// Pseudo-random in −1…1.
fn noise(seed: u64) -> f64 {
    let z = (seed + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
}

/// A tenth of the places follows `shows` (place, time), the rest stands still; a hand-held
/// camera swings to and fro once in 6.1 s, exposure wavers and everything is a bit noisy.
fn photos(times_s: &[f64], shows: impl Fn(usize, f64) -> f64) -> Vec<Snapshot> {
    let photo = |(i, &time_s): (usize, &f64)| {
        let seed = (i * 1000) as u64;
        let swing = (std::f64::consts::TAU * time_s / 6.1).sin();
        let exposure = 0.03 * noise(seed + 999);
        let color = |place: usize| {
            let seen = noise(seed + 500 + place as u64 % 97) > -0.9;
            let still = 0.4 + 0.2 * noise(place as u64) + 0.05 * swing * noise(7 * place as u64);
            let value = if place.is_multiple_of(10) {
                shows(place, time_s)
            } else {
                still
            };
            let value = value + exposure + 0.01 * noise(seed + place as u64);
            seen.then_some([value as f32, 0.8 * value as f32, 0.3])
        };
        Snapshot {
            time_s,
            center: DVec3::new(swing + 0.02 * noise(seed + 998), 0.0, 0.0),
            colors: (0..PLACES).map(color).collect(),
        }
    };
    times_s.iter().enumerate().map(photo).collect()
}

/// A light that runs around: a place is bright for a fifth of each period.
fn running_light(period_s: f64) -> impl Fn(usize, f64) -> f64 {
    move |place, time_s| {
        let phase = (time_s / period_s + noise(place as u64)).rem_euclid(1.0);
        if phase < 0.2 { 0.9 } else { 0.2 }
    }
}

fn every(step_s: f64, count: usize) -> Vec<f64> {
    (0..count).map(|i| step_s * i as f64).collect()
}

#[test]
fn a_period_is_found_to_a_hundredth_and_not_its_multiples() {
    for period_s in [0.61, 1.37, 2.0, 3.3] {
        let found = find_period(&photos(&every(0.2, 100), running_light(period_s))).unwrap();
        println!("{period_s}: {found:?}");
        assert!(
            (found.period_s / period_s - 1.0).abs() < 0.01,
            "{period_s}: {found:?}"
        );
    }
    // Irregular times, of any order and origin.
    let mut times: Vec<f64> = (0..120_u64)
        .map(|i| 1e5 + 0.17 * (i as f64 + noise(i)))
        .collect();
    times.reverse();
    let found = find_period(&photos(&times, running_light(0.9))).unwrap();
    assert!((found.period_s / 0.9 - 1.0).abs() < 0.01, "{found:?}");
}

#[test]
fn the_order_of_photos_and_the_origin_of_time_do_not_matter() {
    let mut shots = photos(&every(0.2, 80), running_light(1.37));
    let found = find_period(&shots).unwrap();
    shots.reverse();
    assert_eq!(find_period(&shots).unwrap(), found);
    shots.iter_mut().for_each(|s| s.time_s += 512.0);
    let later = find_period(&shots).unwrap();
    assert!((later.period_s / found.period_s - 1.0).abs() < 1e-3);
}

/// Three cameras of a rig that stand still take each moment at once, and have far more pairs at no distance than
/// are compared.
#[test]
fn the_order_of_photos_taken_at_once_does_not_matter() {
    let times: Vec<f64> = (0..72).map(|i| 0.2 * f64::from(i / 3)).collect();
    let mut shots = photos(&times, running_light(1.37));
    for (i, shot) in shots.iter_mut().enumerate() {
        shot.center = DVec3::new((i % 3) as f64, 0.0, 0.0);
    }
    let found = find_period(&shots);
    for turn in 1..6 {
        shots
            .chunks_mut(3)
            .enumerate()
            .for_each(|(i, moment)| moment.rotate_left((i * turn) % 3));
        assert_eq!(find_period(&shots), found, "{turn}");
    }
}

/// Of photos at even steps lags lie on the borders of bins, where rounding dealt them.
#[test]
fn lags_on_borders_are_not_dealt_by_rounding() {
    for (count, period_s) in [(33, 1.37), (65, 0.61), (100, 2.0)] {
        let shots = photos(&every(0.2, count), running_light(period_s));
        let found = find_period(&shots).unwrap();
        for (zero_s, nearly) in [
            (64.0, 1e-9),
            (512.0, 1e-9),
            (-4096.0, 1e-9),
            (2f64.powi(30), 1e-6),
        ] {
            let mut later = shots.clone();
            later.iter_mut().for_each(|s| s.time_s += zero_s);
            let later = find_period(&later).unwrap();
            let off = (later.period_s / found.period_s - 1.0).abs();
            assert!(off < nearly, "{count} from {zero_s} s: {found:?} {later:?}");
            assert!((later.explained - found.explained).abs() < 1e-9, "{count}");
        }
    }
}

/// A third of it explains something, and the photos hardly reach over three turns.
#[test]
fn a_part_of_a_period_is_not_taken_for_it() {
    let error = find_period(&photos(&every(0.2, 30), running_light(2.0))).unwrap_err();
    println!("{error}");
    let PeriodError::Multiple {
        best_s, longer_s, ..
    } = error
    else {
        panic!("{error:?}");
    };
    assert!(best_s < 1.0, "{best_s}");
    assert!((longer_s / 2.0 - 1.0).abs() < 0.03, "{longer_s}");
    assert!(error.to_string().contains("give the period in seconds"));
}

#[test]
fn what_does_not_repeat_has_no_period() {
    type Shows<'a> = &'a dyn Fn(usize, f64) -> f64;
    let still: Shows<'_> = &|place, _| 0.4 + 0.2 * noise(place as u64);
    let drifts: Shows<'_> = &|place, t| 0.3 + 0.02 * t * noise(place as u64);
    let flickers: Shows<'_> =
        &|place, t| 0.5 + 0.4 * noise(place as u64 + 7919 * (10.0 * t).round() as u64);
    for (name, shows) in [("still", still), ("drifts", drifts), ("flickers", flickers)] {
        let error = find_period(&photos(&every(0.2, 100), shows)).unwrap_err();
        println!("{name}: {error}");
        assert!(matches!(error, PeriodError::Unclear { .. }), "{name}");
        assert!(error.to_string().contains("give the period in seconds"));
    }
}

#[test]
fn few_photos_are_not_enough() {
    for count in [0, 1, 11] {
        let error = find_period(&photos(&every(0.2, count), running_light(0.9))).unwrap_err();
        assert_eq!(error, PeriodError::TooFew { photos: count });
    }
    let at_once = photos(&[1.0; 30], running_light(0.9));
    let error = find_period(&at_once).unwrap_err();
    assert_eq!(
        error.to_string(),
        "no period can be found among 1 photos with different times; at least 12 are needed: \
         give the period in seconds"
    );
}
