//! Scenes that move: photos count by their times.

use crate::common;

use calibrate::{PeriodError, Pixel, View, find_period};
use common::{Random, Shot, assert_close, gpu, psnr, psnr_covered};
use image::RgbaImage;
use render::{
    FieldOptions, Frame, Lumigraph, Method, Moment, Part, PhotoStore, TriangulatedField, cpu,
    field, reference, snapshots,
};
use std::collections::BTreeMap;
use std::sync::OnceLock;

const METHODS: [Method; 2] = [Method::Exact, Method::TRIANGULATED];
/// Of the helicopter's rotor.
const PERIOD_S: f64 = 1.37;

fn helicopter() -> &'static Shot {
    static SHOT: OnceLock<Shot> = OnceLock::new();
    SHOT.get_or_init(|| Shot::of("helicopter", 72, None))
}

/// A lumigraph of some of a shot's photos.
fn lumigraph_of(shot: &Shot, which: &[usize]) -> Lumigraph {
    let sources = shot.sources();
    Lumigraph {
        sources: which.iter().map(|&i| sources[i].clone()).collect(),
        photos: PhotoStore::from_images(which.iter().map(|&i| shot.photos[i].clone()).collect()),
        ..shot.lumigraph()
    }
}

fn moment(time_s: f64) -> Moment {
    Moment {
        time_s,
        period_s: Some(PERIOD_S),
        window_s: None,
    }
}

fn frame<'a>(lumigraph: &'a Lumigraph, desired: &View, moment: &Moment) -> Frame<'a> {
    let part = Part {
        moment: Some(*moment),
        ..Part::default()
    };
    Frame::with(lumigraph, desired.clone(), FieldOptions::default(), &part)
}

/// By every fast engine there is.
fn by_engines(frame: &Frame<'_>, method: Method) -> Vec<(&'static str, RgbaImage)> {
    let mut pictures = vec![("cpu", cpu::render(frame, method).unwrap())];
    if let Some(mut gpu) = gpu() {
        pictures.push(("gpu", gpu.render(frame, method).unwrap()));
    }
    pictures
}

// ---------------------------------------------------------------------------- Penalties

#[test]
fn penalties_are_zero_at_the_moment_and_infinite_at_the_windows_edge() {
    let one = Moment {
        time_s: 10.0,
        period_s: None,
        window_s: Some(2.0),
    };
    let times = [10.0, 11.0, 9.0, 12.0, 7.0, 11.999_999].map(Some);
    let penalties = one.penalties(&times, 2);
    assert_eq!(penalties[0], 0.0);
    assert_eq!(penalties[1], render::TIME_COST / 3.0);
    assert_eq!(penalties[1], penalties[2]);
    assert_eq!(penalties[3..5], [f64::INFINITY; 2]);
    assert!(penalties[5] > 1e4 && penalties[5].is_finite());
    assert_eq!(one.penalties(&[None, Some(10.0)], 1), [f64::INFINITY, 0.0]);
    // No photo near: the nearest two, and the window widens to hold them.
    let far = Moment {
        time_s: 100.0,
        ..one
    };
    let penalties = far.penalties(&[0.0, 10.0, 20.0].map(Some), 2);
    assert!(penalties[2] < penalties[1] && penalties[1] < f64::INFINITY);
    assert_eq!(far.window_s(&[0.0, 10.0, 20.0], 2), 135.0);
    // Cameras that all fire at once.
    let at_once = Moment {
        window_s: None,
        time_s: 3.0,
        ..one
    };
    let times = [2.0, 3.0, 3.0, 4.0].map(Some);
    let inf = f64::INFINITY;
    assert_eq!(at_once.penalties(&times, 2), [inf, 0.0, 0.0, inf]);
}

#[test]
fn moments_that_make_no_sense_are_refused() {
    let check = |time_s, period_s, window_s| {
        Moment {
            time_s,
            period_s,
            window_s,
        }
        .check()
    };
    assert_eq!(check(1.0, None, Some(1.0)), Ok(()));
    let said = |result: Result<(), String>| result.unwrap_err();
    assert_eq!(
        said(check(f64::NAN, None, None)),
        "the time is NaN; it must be finite"
    );
    assert_eq!(
        said(check(0.0, Some(0.0), None)),
        "the period is 0 s; it must be positive"
    );
    let window = said(check(0.0, None, Some(-1.0)));
    assert_eq!(window, "the time window is -1 s; it must be positive");
}

#[test]
fn times_wrap_around_the_period() {
    let mut random = Random(5);
    let times: Vec<Option<f64>> = (0..60).map(|_| Some(random.within(-50.0, 900.0))).collect();
    for _ in 0..50 {
        let period_s = random.within(0.1, 7.0);
        let at = Moment {
            time_s: random.within(-20.0, 20.0),
            period_s: Some(period_s),
            window_s: Some(random.within(0.01, 1.0) * period_s),
        };
        let later = Moment {
            time_s: at.time_s + 3.0 * period_s,
            ..at
        };
        let (before, after) = (at.penalties(&times, 5), later.penalties(&times, 5));
        for ((a, b), time_s) in before.iter().zip(&after).zip(times.iter().flatten()) {
            assert!(
                a == b || (a - b).abs() < 1e-5 * a,
                "{a} {b} at {time_s}, {at:?}"
            );
            // |((tᵢ − t + P/2) mod P) − P/2|
            let half = 0.5 * period_s;
            let expected = ((time_s - at.time_s + half).rem_euclid(period_s) - half).abs();
            assert!((at.distance_s(*time_s) - expected).abs() < 1e-9 * period_s);
        }
    }
}

// ------------------------------------------------------------------------ Continuity

/// The largest change of any photo's weight, over places of the picture and from moment to
/// moment of a sweep over a period and a little more.
fn largest_jump(lumigraph: &Lumigraph, desired: &View, steps: usize) -> f64 {
    let weights_at = |time_s: f64| -> Vec<BTreeMap<usize, f64>> {
        let frame = frame(lumigraph, desired, &moment(time_s));
        let places = [(20.5, 30.5), (80.5, 60.5), (140.5, 100.5), (70.5, 20.5)];
        let blend = |(x, y)| {
            let point = frame.proxy_point(Pixel::new(x, y)).unwrap();
            let list = reference::blend_at(&frame, &point);
            list.into_iter().map(|c| (c.source_idx, c.weight)).collect()
        };
        places.map(blend).to_vec()
    };
    let mut before = weights_at(0.0);
    let mut largest = 0.0_f64;
    for step in 1..=steps + steps / 10 {
        let now = weights_at(PERIOD_S * step as f64 / steps as f64);
        for (a, b) in before.iter().zip(&now) {
            for i in a.keys().chain(b.keys()) {
                let weight = |list: &BTreeMap<usize, f64>| list.get(i).copied().unwrap_or(0.0);
                largest = largest.max((weight(a) - weight(b)).abs());
            }
        }
        before = now;
    }
    largest
}

#[test]
fn weights_change_continuously_as_time_goes_on() {
    let shot = helicopter();
    let lumigraph = shot.lumigraph();
    let desired = shot.views[3].between(&shot.views[11], 0.4);
    let coarse = largest_jump(&lumigraph, &desired, 1000);
    let fine = largest_jump(&lumigraph, &desired, 4000);
    println!("largest change of a weight: {coarse:.4} in P/1000, {fine:.4} in P/4000");
    // A jump would stay as it is, however small the step.
    assert!(fine < 0.02 && fine < 0.35 * coarse, "{coarse}, {fine}");
}

#[test]
fn pictures_change_smoothly_as_time_goes_on() {
    let shot = helicopter();
    let lumigraph = shot.lumigraph();
    let desired = shot.views[3].between(&shot.views[11], 0.4);
    // The worst from moment to moment, over an eighth of a period with its end in it.
    let worst = |steps: u32| {
        let moments = (steps * 15 / 16..=steps * 17 / 16)
            .map(|step| moment(PERIOD_S * f64::from(step) / f64::from(steps)));
        let pictures: Vec<RgbaImage> = moments
            .map(|at| cpu::render(&frame(&lumigraph, &desired, &at), Method::Exact).unwrap())
            .collect();
        // What only one photo in the window covers goes with it, at once.
        let changes = pictures
            .windows(2)
            .map(|two| psnr_covered(&two[0], &two[1]));
        changes.fold(f64::INFINITY, f64::min)
    };
    let (coarse, fine) = (worst(240), worst(960));
    println!("worst change: {coarse:.1} dB in P/240, {fine:.1} dB in P/960");
    // A quarter of the change is 12 dB; a jump would stay as it is.
    assert!(fine > coarse + 9.0, "{coarse}, {fine} dB");
}

// ---------------------------------------------------------------------- The same bytes

#[test]
fn a_whole_period_later_the_bytes_are_the_same() {
    let shot = helicopter();
    let lumigraph = shot.lumigraph();
    for (time_s, desired) in [(0.4, &shot.views[9]), (1.3, &shot.views[20])] {
        for method in METHODS {
            let now = by_engines(&frame(&lumigraph, desired, &moment(time_s)), method);
            let later = moment(time_s + 2.0 * PERIOD_S);
            let later = by_engines(&frame(&lumigraph, desired, &later), method);
            for ((engine, now), (_, later)) in now.iter().zip(&later) {
                assert!(now == later, "{engine}, {method:?}, {time_s}");
            }
        }
    }
}

#[test]
fn times_alone_change_nothing() {
    let shot = helicopter();
    let timed = shot.lumigraph();
    let mut untimed = shot.lumigraph();
    untimed.sources.iter_mut().for_each(|s| s.time_s = None);
    let mut at_once = shot.lumigraph();
    at_once
        .sources
        .iter_mut()
        .for_each(|s| s.time_s = Some(7.0));
    let desired = shot.views[3].between(&shot.views[11], 0.4);
    let plain = |lumigraph| Frame::new(lumigraph, desired.clone(), FieldOptions::default());
    for method in METHODS {
        let expected = by_engines(&plain(&untimed), method);
        assert!(by_engines(&plain(&timed), method) == expected, "{method:?}");
        let all = frame(&at_once, &desired, &moment(7.0));
        assert_eq!(all.taking_part().count(), 72);
        assert!(
            by_engines(&all, method) == expected,
            "{method:?}, all at once"
        );
    }
}

#[test]
fn a_source_view_that_takes_no_part_might_as_well_not_be_there() {
    let shot = helicopter();
    let all: Vec<usize> = (0..shot.views.len()).collect();
    let gone = 5;
    let rest: Vec<usize> = all.iter().copied().filter(|&i| i != gone).collect();
    let (with, without) = (lumigraph_of(shot, &all), lumigraph_of(shot, &rest));
    let desired = &shot.views[gone];
    let options = FieldOptions::default();
    let frames = |moment: Option<Moment>| {
        let part = |without| Part { without, moment };
        let frame = |of, without| Frame::with(of, desired.clone(), options, &part(without));
        (frame(&with, &[gone][..]), frame(&without, &[]))
    };
    for method in METHODS {
        let (with, without) = frames(None);
        assert_eq!(
            with.taking_part().count(),
            without.taking_part().count(),
            "{method:?}"
        );
        assert!(
            by_engines(&with, method) == by_engines(&without, method),
            "{method:?}"
        );
        // Whatever the time.
        let (with, without) = frames(Some(moment(0.3)));
        assert!(
            by_engines(&with, method) == by_engines(&without, method),
            "{method:?}"
        );
    }
}

#[test]
fn the_order_of_photos_does_not_matter() {
    let shot = helicopter();
    let mut order: Vec<usize> = (0..shot.views.len()).collect();
    let desired = shot.views[3].between(&shot.views[11], 0.4);
    let in_order = lumigraph_of(shot, &order);
    Random(8).shuffle(&mut order);
    let shuffled = lumigraph_of(shot, &order);
    for method in METHODS {
        let before = by_engines(&frame(&in_order, &desired, &moment(0.9)), method);
        let after = by_engines(&frame(&shuffled, &desired, &moment(0.9)), method);
        for ((engine, before), (_, after)) in before.iter().zip(&after) {
            assert_close(before, after, &format!("{engine}, {method:?}"));
        }
    }
}

// ----------------------------------------------------------------- Engine against engine

#[test]
fn engines_agree_and_decode_only_photos_in_the_window() {
    let shot = helicopter();
    let desired = shot.views[3].between(&shot.views[11], 0.4);
    for method in METHODS {
        for time_s in [0.1, 1.36] {
            let lumigraph = shot.lumigraph();
            let frame = frame(&lumigraph, &desired, &moment(time_s));
            let expected = match method {
                Method::Exact => reference::render_exact(&frame).unwrap(),
                Method::Triangulated { cells_across } => {
                    let field = TriangulatedField::new(&frame, cells_across).unwrap();
                    field::render_reference(&frame, &field).unwrap()
                }
            };
            for (engine, picture) in by_engines(&frame, method) {
                assert_close(
                    &expected,
                    &picture,
                    &format!("{engine}, {method:?}, {time_s}"),
                );
            }
            let taking_part = frame.taking_part().count();
            assert!((5..30).contains(&taking_part), "{taking_part}");
            assert!(lumigraph.photos.decoded() <= taking_part);
        }
    }
}

#[test]
fn triangulated_pictures_are_close_to_exact_ones() {
    let shot = helicopter();
    let lumigraph = shot.lumigraph();
    let desired = shot.views[3].between(&shot.views[11], 0.4);
    for time_s in [0.0, 0.5, 1.0] {
        let frame = frame(&lumigraph, &desired, &moment(time_s));
        let [exact, triangulated] = METHODS.map(|method| cpu::render(&frame, method).unwrap());
        let db = psnr(&exact, &triangulated);
        println!("at {time_s} s: {db:.1} dB");
        assert!(db > 50.0, "at {time_s} s: {db} dB");
    }
}

// ---------------------------------------------------------------------------- The point

/// Mean PSNR over every eighth photo, rendered from the others.
fn held_out_db(shot: &Shot, moment: impl Fn(f64) -> Option<Moment>) -> f64 {
    let count = shot.views.len();
    let rest: Vec<usize> = (0..count).filter(|i| i % 8 != 0).collect();
    let lumigraph = lumigraph_of(shot, &rest);
    let scores = (0..count).step_by(8).map(|i| {
        let desired = shot.views[i].clone();
        let part = Part {
            moment: moment(shot.dataset.photos[i].time_s.unwrap()),
            ..Part::default()
        };
        let frame = Frame::with(&lumigraph, desired, FieldOptions::default(), &part);
        psnr(
            &cpu::render(&frame, Method::TRIANGULATED).unwrap(),
            &shot.photos[i],
        )
    });
    let scores: Vec<f64> = scores.collect();
    scores.iter().sum::<f64>() / scores.len() as f64
}

#[test]
fn the_frozen_phase_beats_ignoring_time_with_the_period_given_or_found() {
    let shot = helicopter();
    let rest: Vec<usize> = (0..shot.views.len()).filter(|i| i % 8 != 0).collect();
    let found = find_period(&snapshots(&lumigraph_of(shot, &rest))).unwrap();
    println!("found {found:?}");
    assert!((found.period_s / PERIOD_S - 1.0).abs() < 0.01, "{found:?}");

    let ignoring = held_out_db(shot, |_| None);
    let with = |period_s: f64| {
        held_out_db(shot, |time_s| {
            Some(Moment {
                period_s: Some(period_s),
                ..moment(time_s)
            })
        })
    };
    let (given, automatic, wrong) = (with(PERIOD_S), with(found.period_s), with(1.1));
    println!(
        "ignoring time {ignoring:.2} dB, period given {given:.2}, found {automatic:.2}, wrong {wrong:.2}"
    );
    assert!(given > ignoring + 2.0, "{given}, {ignoring} dB");
    assert!(automatic > ignoring + 2.0, "{automatic}, {ignoring} dB");
    assert!(wrong < given - 2.0, "{wrong}, {given} dB");
}

/// Mattes of many programs are a few steps less than 255 within the object.
#[test]
fn photos_of_nearly_whole_alpha_tell_the_same_period() {
    let shot = helicopter();
    let matted = shot.photos.iter().map(|photo| {
        let mut photo = photo.clone();
        for (x, y, pixel) in photo.enumerate_pixels_mut() {
            pixel.0[3] = pixel.0[3].min(240 + ((x + 3 * y) % 16) as u8);
        }
        photo
    });
    let matted = Lumigraph {
        photos: PhotoStore::from_images(matted.collect()),
        ..shot.lumigraph()
    };
    let (opaque, matted) = (snapshots(&shot.lumigraph()), snapshots(&matted));
    assert_eq!(opaque.len(), matted.len());
    for (opaque, matted) in opaque.iter().zip(&matted) {
        for (opaque, matted) in opaque.colors.iter().zip(&matted.colors) {
            assert_eq!(opaque.is_some(), matted.is_some());
            let both = opaque.iter().flatten().zip(matted.iter().flatten());
            for (opaque, matted) in both {
                assert!((opaque - matted).abs() < 0.01, "{opaque} {matted}");
            }
        }
    }
    let found = find_period(&matted).unwrap();
    assert!((found.period_s / PERIOD_S - 1.0).abs() < 0.01, "{found:?}");
}

/// Its blades are of one shape: half a turn, or a third, explains something of a few turns' photos.
#[test]
fn no_part_of_a_turn_is_taken_for_the_period() {
    let shot = helicopter();
    let of_first = |count: usize| {
        let which: Vec<usize> = (0..count).collect();
        find_period(&snapshots(&lumigraph_of(shot, &which)))
    };
    let error = of_first(31).unwrap_err();
    println!("{error}");
    let PeriodError::Multiple { longer_s, .. } = error else {
        panic!("{error:?}");
    };
    assert!((longer_s / PERIOD_S - 1.0).abs() < 0.03, "{longer_s}");
    // The third was told here, as the candidates missed the turn.
    let found = of_first(38).unwrap();
    println!("found {found:?}");
    assert!((found.period_s / PERIOD_S - 1.0).abs() < 0.03, "{found:?}");
}

/// What does not repeat has no period: the shelf, with times.
#[test]
fn no_period_is_found_where_nothing_moves() {
    let shot = Shot::of("shelf", 20, None);
    let mut lumigraph = shot.lumigraph();
    for (i, source) in lumigraph.sources.iter_mut().enumerate() {
        source.time_s = Some(0.5 * i as f64);
    }
    let error = find_period(&snapshots(&lumigraph)).unwrap_err();
    println!("{error}");
}
