//! Photos within a memory budget: pictures depend on the budget and the frame alone.

use crate::common;

use calibrate::View;
use common::{METHODS, gpu, pinhole};
use glam::DVec3;
use image::{Rgba, RgbaImage};
use proptest::prelude::*;
use proxy::{Plane, Proxy};
use render::{
    FieldOptions, Frame, Held, Lumigraph, Method, PhotoStore, Prepared, Pyramid, Residency,
    SourceView, cpu, decode_ahead, reference,
};
use std::sync::atomic::AtomicBool;

const COUNT: usize = 24;
const SIZE: (u32, u32) = (100, 80);

/// A wall, and photos along it of which each shows a part.
struct Shot {
    views: Vec<View>,
    photos: Vec<RgbaImage>,
}

impl Shot {
    fn lumigraph(&self) -> Lumigraph {
        let source = |(i, view): (usize, &View)| SourceView {
            name: i.to_string(),
            view: view.clone(),
            gain: [1.0; 3],
            time_s: None,
            quarters: 0,
        };
        Lumigraph {
            sources: self.views.iter().enumerate().map(source).collect(),
            photos: PhotoStore::from_images(self.photos.clone()),
            proxy: Proxy::Plane(Plane::new(DVec3::ZERO, DVec3::Z).unwrap()),
            points: Vec::new(),
            visibility: None,
        }
    }
}

fn shot() -> Shot {
    shot_of(COUNT)
}

fn shot_of(count: usize) -> Shot {
    let view = |i: usize| {
        let x = 0.5 * i as f64;
        pinhole(
            DVec3::new(x, 0.0, 2.0),
            DVec3::new(x, 0.0, 0.0),
            100.0,
            SIZE,
        )
    };
    // Finer than any mip level but the first shows, and no two alike.
    let photo = |i: usize| {
        let noise = |x: u32, y: u32| (x * 73 + y * 151 + (x * y) % 97 + i as u32 * 37) as u8;
        let pixel = |x, y| Rgba([noise(x, y), noise(y, x), noise(x + y, x), 255]);
        RgbaImage::from_fn(SIZE.0, SIZE.1, pixel)
    };
    Shot {
        views: (0..count).map(view).collect(),
        photos: (0..count).map(photo).collect(),
    }
}

fn photo_bytes(shot: &Shot) -> u64 {
    Pyramid::new(shot.photos[0].clone()).bytes() as u64
}

/// Bytes of a layer on the device, whose sides are multiples of 64 texels.
const LAYER: u64 = 4 * (128 * 128 + 64 * 64 + 32 * 32 + 16 * 16 + 8 * 8 + 4 * 4 + 2 * 2);

/// Between the photos' cameras.
fn path(shot: &Shot) -> Vec<View> {
    let pair = |i: usize| shot.views[i].between(&shot.views[i + 1], 0.4);
    (0..COUNT - 1).step_by(3).map(pair).collect()
}

fn within(shot: &Shot, budget: Option<u64>) -> Lumigraph {
    let mut lumigraph = shot.lumigraph();
    lumigraph.photos.set_budget(budget);
    lumigraph
}

fn options() -> FieldOptions {
    FieldOptions {
        k: 2,
        ..FieldOptions::default()
    }
}

fn frame<'a>(lumigraph: &'a Lumigraph, view: &View) -> Frame<'a> {
    Frame::new(lumigraph, view.clone(), options())
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Engine {
    Reference,
    Cpu,
}

fn draw(engine: Engine, lumigraph: &Lumigraph, view: &View, method: Method) -> RgbaImage {
    let frame = frame(lumigraph, view);
    match engine {
        Engine::Reference => common::by_reference(&frame, method).unwrap(),
        Engine::Cpu => cpu::render(&frame, method).unwrap(),
    }
}

/// How many photos each frame of the path needs at most, by drawing it afresh.
fn most_needed(shot: &Shot, method: Method) -> usize {
    let of_frame = |view: &View| {
        let lumigraph = within(shot, None);
        match method {
            Method::Exact => {
                draw(Engine::Cpu, &lumigraph, view, method);
                lumigraph.photos.decoded()
            }
            Method::Triangulated { cells_across } => {
                let frame = frame(&lumigraph, view);
                let field = render::TriangulatedField::new(&frame, cells_across).unwrap();
                field.listed().len()
            }
        }
    };
    path(shot).iter().map(of_frame).max().unwrap()
}

#[test]
fn a_path_within_a_budget_looks_as_without_one() {
    let shot = shot();
    let bytes = photo_bytes(&shot);
    for method in METHODS {
        let most = most_needed(&shot, method);
        assert!(most < COUNT - 2, "{method:?} needs {most}");
        let budget = bytes * (most as u64 + 1) + 7;
        for engine in [Engine::Cpu, Engine::Reference] {
            let unlimited = within(&shot, None);
            let limited = within(&shot, Some(budget));
            for view in path(&shot) {
                let expected = draw(engine, &unlimited, &view, method);
                assert!(draw(engine, &limited, &view, method) == expected);
                let took = limited.photos.residency();
                assert!(took.held <= took.peak && took.peak <= budget, "{took:?}");
            }
            let took = limited.photos.residency();
            println!("{method:?}, {engine:?}, {most} photos a frame: {took:?}");
            assert!(took.evictions > 0);
            assert_eq!((took.level_cap, took.capped_frames), (0, 0));
            // As many as were decoded and not let go.
            assert_eq!((took.loads - took.evictions) * bytes, took.held);
            let all = unlimited.photos.residency();
            assert_eq!((all.evictions, all.budget), (0, None));
            assert!(all.peak > budget && all.loads == unlimited.photos.decoded() as u64);
        }
    }
}

#[test]
fn too_little_memory_draws_from_coarser_levels_whatever_came_before() {
    let shot = shot();
    let bytes = photo_bytes(&shot);
    let views = path(&shot);
    for method in METHODS {
        let most = most_needed(&shot, method) as u64;
        for (budget, engines) in [
            (bytes * most / 2, &[Engine::Cpu, Engine::Reference][..]),
            (bytes / 3, &[Engine::Cpu]),
            (1, &[Engine::Cpu]),
        ] {
            for &engine in engines {
                let toured = within(&shot, Some(budget));
                let order = (0..views.len()).rev().chain([3, 0, 3, 5]);
                let mut differs = false;
                for i in order {
                    let fresh = within(&shot, Some(budget));
                    let alone = draw(engine, &fresh, &views[i], method);
                    assert!(draw(engine, &toured, &views[i], method) == alone);
                    differs |= alone != draw(engine, &within(&shot, None), &views[i], method);
                }
                let took = toured.photos.residency();
                println!("{method:?}, {engine:?}, {budget} bytes: {took:?}");
                assert!(differs && took.level_cap > 0 && took.capped_frames > 0);
                if budget > 1 {
                    assert!(took.peak <= budget, "{took:?}");
                }
            }
        }
    }
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let shot = shot();
    let bytes = photo_bytes(&shot);
    for method in METHODS {
        let budget = bytes * most_needed(&shot, method) as u64 * 2 / 3;
        let on = |threads: usize| -> (Vec<RgbaImage>, Residency) {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            pool.build().unwrap().install(|| {
                let lumigraph = within(&shot, Some(budget));
                let draw = |view| draw(Engine::Cpu, &lumigraph, view, method);
                let pictures = path(&shot).iter().map(draw).collect();
                (pictures, lumigraph.photos.residency())
            })
        };
        assert!(on(1) == on(4), "{method:?}");
    }
}

#[test]
fn a_capped_picture_is_one_of_photos_without_their_finest_levels() {
    // The engines agree on it, so both sample the same levels.
    let shot = shot();
    let budget = Some(photo_bytes(&shot));
    let view = &path(&shot)[2];
    for method in METHODS {
        let by_cpu = draw(Engine::Cpu, &within(&shot, budget), view, method);
        let by_reference = draw(Engine::Reference, &within(&shot, budget), view, method);
        common::assert_close(&by_cpu, &by_reference, "capped");
    }
}

#[test]
fn photos_asked_for_one_by_one_stay_as_the_budget_allows() {
    let shot = shot();
    let bytes = photo_bytes(&shot);
    let lumigraph = within(&shot, Some(2 * bytes));
    let photos = &lumigraph.photos;
    for i in [0, 1, 0, 2, 0, 1] {
        assert_eq!(
            *photos.get(i).unwrap(),
            Pyramid::new(shot.photos[i].clone())
        );
    }
    // 1 was the least recently used when 2 came, and 2 when 1 came back.
    let took = photos.residency();
    assert_eq!((took.loads, took.evictions, took.held), (4, 2, 2 * bytes));
    assert_eq!(photos.decoded(), 3);
    // One that does not fit on its own is not kept.
    let small = within(&shot, Some(bytes - 1));
    small.photos.get(5).unwrap();
    assert_eq!(small.photos.residency().peak, 0);
    // Less of it lets go at once, and more brings nothing back.
    let mut lumigraph = lumigraph;
    lumigraph.photos.set_budget(Some(bytes));
    assert_eq!(lumigraph.photos.residency().held, bytes);
    lumigraph.photos.set_budget(None);
    assert_eq!(lumigraph.photos.residency().held, bytes);
}

#[test]
fn whoever_holds_a_photo_has_it_when_the_store_lets_it_go() {
    let shot = shot();
    let lumigraph = within(&shot, Some(photo_bytes(&shot)));
    let frame = frame(&lumigraph, &shot.views[0]);
    let held = Held::new(&frame, &[3]);
    let before = held.get(3).unwrap().clone();
    let other = Held::new(&frame, &[4]);
    other.get(4).unwrap();
    assert_eq!(lumigraph.photos.residency().evictions, 1);
    assert!(*held.get(3).unwrap() == before);
}

#[test]
fn seams_are_measured_within_the_budget() {
    let shot = shot();
    let view = &path(&shot)[1];
    let unlimited = render::seams(&frame(&within(&shot, None), view)).unwrap();
    let lumigraph = within(&shot, Some(photo_bytes(&shot)));
    let limited = render::seams(&frame(&lumigraph, view)).unwrap();
    assert!(lumigraph.photos.residency().peak <= photo_bytes(&shot));
    // They look at coarse levels anyway.
    assert!(
        (unlimited.unwrap() - limited.unwrap()).abs() < 0.5,
        "{unlimited:?}, {limited:?}"
    );
}

#[test]
fn decoding_ahead_keeps_to_the_budget_and_changes_no_picture() {
    let shot = shot();
    let bytes = photo_bytes(&shot);
    let views = path(&shot);
    let most = most_needed(&shot, Method::TRIANGULATED) as u64;
    let going = AtomicBool::new(false);
    let unlimited = within(&shot, None);
    // Room for one frame, for one and a half, for two, for all; and for none.
    for budget in [most, most * 3 / 2, 2 * most, 99, most / 2] {
        let lumigraph = within(&shot, Some(budget * bytes));
        for pair in views.windows(2) {
            let next = frame(&lumigraph, &pair[1]);
            let wanted = Prepared::new(&next, Method::TRIANGULATED).unwrap().listed();
            let picture = std::thread::scope(|scope| {
                scope.spawn(|| decode_ahead(&next, &wanted, &[], &going));
                draw(Engine::Cpu, &lumigraph, &pair[0], Method::TRIANGULATED)
            });
            let expected = draw(Engine::Cpu, &unlimited, &pair[0], Method::TRIANGULATED);
            assert!(picture == expected || budget < most, "{budget} photos");
            if budget >= most {
                let took = lumigraph.photos.residency();
                assert!(took.peak <= budget * bytes, "{took:?}");
            }
        }
        let took = lumigraph.photos.residency();
        println!("room for {budget}: {took:?}");
        assert_eq!(took.capped_frames > 0, budget < most);
    }
}

#[test]
fn photos_decoded_ahead_are_those_of_the_next_frame() {
    let shot = shot();
    let bytes = photo_bytes(&shot);
    let views = path(&shot);
    let lumigraph = within(&shot, Some(20 * bytes));
    let next = frame(&lumigraph, &views[0]);
    let wanted = Prepared::new(&next, Method::TRIANGULATED).unwrap().listed();
    decode_ahead(&next, &wanted, &[], &AtomicBool::new(true));
    decode_ahead(&next, &wanted, &wanted, &AtomicBool::new(false));
    assert_eq!(
        lumigraph.photos.decoded(),
        0,
        "stopped, or without all of them"
    );
    decode_ahead(&next, &wanted, &wanted[..1], &AtomicBool::new(false));
    assert_eq!(lumigraph.photos.residency().loads, wanted.len() as u64 - 1);
    cpu::render(&next, Method::TRIANGULATED).unwrap();
    assert!(lumigraph.photos.residency().loads <= wanted.len() as u64);
    // What a frame cannot have in full is left to it.
    let small = within(&shot, Some(bytes));
    let next = frame(&small, &views[0]);
    decode_ahead(&next, &wanted, &[], &AtomicBool::new(false));
    assert_eq!(small.photos.decoded(), 0);
}

/// Draws a path on the device within a budget; every picture, and what it took.
fn on_device(
    lumigraph: &Lumigraph,
    views: &[View],
    method: Method,
    budget: Option<u64>,
) -> Option<(Vec<RgbaImage>, Residency)> {
    let mut gpu = gpu()?;
    gpu.set_budget(budget);
    let before = gpu.residency();
    let draw = |view| gpu.render(&frame(lumigraph, view), method).unwrap();
    let pictures = views.iter().map(draw).collect();
    let mut took = gpu.residency();
    // The most that was held, and the cap, are those of all tests.
    took.loads -= before.loads;
    took.evictions -= before.evictions;
    took.capped_frames -= before.capped_frames;
    gpu.set_budget(None);
    Some((pictures, took))
}

#[test]
fn the_device_draws_a_path_within_its_budget() {
    let shot = shot();
    let views = path(&shot);
    for method in METHODS {
        let Some((expected, _)) = on_device(&within(&shot, None), &views, method, None) else {
            return;
        };
        let most = most_needed(&shot, method) as u64;
        // The memory of the host is small, too.
        let lumigraph = within(&shot, Some(3 * photo_bytes(&shot)));
        let (pictures, took) =
            on_device(&lumigraph, &views, method, Some(LAYER * (most + 1))).unwrap();
        println!("{method:?}, {most} photos a frame: {took:?}");
        assert!(pictures == expected, "{method:?}");
        assert!(took.evictions > 0 && took.held <= LAYER * (most + 1));
        assert_eq!(took.capped_frames, 0);
        assert!(lumigraph.photos.residency().peak <= 3 * photo_bytes(&shot));
        // Too little: coarser levels, in any order.
        for budget in [LAYER * most / 2, LAYER / 2, 1] {
            let (pictures, took) = on_device(&lumigraph, &views, method, Some(budget)).unwrap();
            assert!(took.capped_frames > 0);
            assert!(pictures != expected);
            if budget > 1 {
                assert!(took.held <= budget, "{took:?}");
            }
            for i in [5, 2] {
                let fresh = within(&shot, None);
                let alone = on_device(&fresh, &views[i..=i], method, Some(budget))
                    .unwrap()
                    .0;
                assert!(alone[0] == pictures[i], "{method:?}, {budget}, {i}");
            }
        }
        // And all is well again without a limit.
        let (again, _) = on_device(&lumigraph, &views[..2], method, None).unwrap();
        assert!(again[..] == expected[..2]);
    }
}

#[test]
fn without_a_budget_photos_are_not_brought_again_and_again() {
    const MANY: usize = 128;
    let shot = shot_of(MANY);
    let pair = |i: usize| shot.views[i].between(&shot.views[i + 1], 0.4);
    let views: Vec<View> = (0..MANY - 1).map(pair).collect();
    let lumigraph = within(&shot, None);
    let Some((_, took)) = on_device(&lumigraph, &views, Method::TRIANGULATED, None) else {
        return;
    };
    println!("{MANY} photos: {took:?}");
    // All that are there, each time that there are half as many more.
    assert!(took.loads <= 4 * MANY as u64, "{took:?}");
}

#[test]
fn the_device_and_the_processor_leave_out_the_same_levels() {
    let shot = shot();
    let view = &path(&shot)[2];
    for method in METHODS {
        let most = most_needed(&shot, method) as u64;
        let budget = Some(LAYER * most / 2);
        let Some((pictures, _)) = on_device(
            &shot.lumigraph(),
            std::slice::from_ref(view),
            method,
            budget,
        ) else {
            return;
        };
        let lumigraph = within(&shot, Some(photo_bytes(&shot) * most / 2));
        let by_cpu = draw(Engine::Cpu, &lumigraph, view, method);
        assert_eq!(lumigraph.photos.residency().level_cap, 1);
        common::assert_close(&pictures[0], &by_cpu, "capped");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 6, ..ProptestConfig::default() })]

    #[test]
    fn any_budget_and_any_order_give_each_frame_its_own_bytes(
        budget in 1_u64..600_000,
        order in proptest::collection::vec(0_usize..7, 1..5),
    ) {
        let shot = shot();
        let views = path(&shot);
        let toured = within(&shot, Some(budget));
        for i in order {
            let fresh = within(&shot, Some(budget));
            let alone = draw(Engine::Cpu, &fresh, &views[i], Method::TRIANGULATED);
            prop_assert!(draw(Engine::Cpu, &toured, &views[i], Method::TRIANGULATED) == alone);
        }
    }
}

#[test]
fn the_reference_says_so_itself() {
    // `render_exact` is public and holds its own photos.
    let shot = shot();
    let lumigraph = within(&shot, Some(photo_bytes(&shot) / 2));
    let frame = frame(&lumigraph, &path(&shot)[1]);
    reference::render_exact(&frame).unwrap();
    assert_eq!(lumigraph.photos.residency().capped_frames, 1);
}
