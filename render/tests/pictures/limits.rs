//! Devices that hold little, and such as are lost.

use crate::common;

use calibrate::View;
use common::{METHODS, assert_close, pinhole};
use glam::DVec3;
use image::{GrayImage, Luma, Rgba, RgbaImage};
use proxy::{Plane, Proxy};
use render::gpu::{DeviceLimits, Gpu, ShadeBy};
use render::{
    Engine, FieldOptions, Frame, Lumigraph, Method, PhotoStore, Prepared, RenderError, SourceView,
    cpu,
};

const COUNT: usize = 30;
const SIZE: (u32, u32) = (100, 80);
/// Bytes of a photo on the device, whose sides are multiples of 64 texels there.
const LAYER: u64 = 4 * (128 * 128 + 64 * 64 + 32 * 32 + 16 * 16 + 8 * 8 + 4 * 4 + 2 * 2);

/// A wall, and photos along it of which each shows a part.
struct Shot {
    photos: Vec<RgbaImage>,
    sources: Vec<SourceView>,
}

impl Shot {
    fn lumigraph(&self) -> Lumigraph {
        Lumigraph {
            sources: self.sources.clone(),
            photos: PhotoStore::from_images(self.photos.clone()),
            proxy: Proxy::Plane(Plane::new(DVec3::ZERO, DVec3::Z).unwrap()),
            points: Vec::new(),
            visibility: None,
        }
    }

    /// Photos of which each ignores a part.
    fn masked(&self) -> PhotoStore {
        let mask = |i: usize| {
            let value = |x, y| Luma([255 * u8::from((x + y + i as u32) % 40 > 15)]);
            Ok(GrayImage::from_fn(SIZE.0, SIZE.1, value))
        };
        PhotoStore::from_images(self.photos.clone()).with_masks(&[true; COUNT], mask)
    }
}

fn view(x: f64, z: f64) -> View {
    pinhole(DVec3::new(x, 0.1, z), DVec3::new(x, 0.0, 0.0), 100.0, SIZE)
}

fn shot() -> Shot {
    let photo = |i: usize| {
        let wave = |x: u32, y: u32| ((x * (3 + i as u32) + y * 5) / 9 * 13 % 256) as u8;
        let pixel = |x, y| Rgba([wave(x, y), wave(y, x), wave(x + y, x), 255]);
        RgbaImage::from_fn(SIZE.0, SIZE.1, pixel)
    };
    let source = |i: usize| SourceView {
        name: i.to_string(),
        view: view(0.5 * i as f64, 2.0),
        gain: [1.0; 3],
        time_s: None,
        quarters: 0,
    };
    Shot {
        photos: (0..COUNT).map(photo).collect(),
        sources: (0..COUNT).map(source).collect(),
    }
}

/// The first and the last show the whole wall, and most photos.
fn path() -> [View; 3] {
    [view(7.2, 14.0), view(3.3, 3.0), view(7.9, 12.0)]
}

/// A device within limits, where there is one; see [`common::gpu`].
fn open(limits: DeviceLimits) -> Option<Gpu> {
    drop(common::gpu()?);
    Some(Gpu::open_within(limits).unwrap())
}

fn frame<'a>(lumigraph: &'a Lumigraph, view: &View) -> Frame<'a> {
    let options = FieldOptions {
        k: 3,
        ..FieldOptions::default()
    };
    Frame::new(lumigraph, view.clone(), options)
}

#[test]
fn pictures_do_not_depend_on_what_a_device_holds() {
    let shot = shot();
    let lumigraph = shot.lumigraph();
    let Some(mut gpu) = open(DeviceLimits::default()) else {
        return;
    };
    let all = METHODS.map(|method| {
        let render = |view: &View| gpu.render(&frame(&lumigraph, view), method).unwrap();
        path().iter().map(render).collect::<Vec<_>>()
    });
    for limits in [
        DeviceLimits {
            array_layers: Some(12),
            ..DeviceLimits::default()
        },
        DeviceLimits {
            array_bytes: Some(14 * LAYER),
            ..DeviceLimits::default()
        },
        DeviceLimits {
            buffer_bytes: Some(1 << 15),
            ..DeviceLimits::default()
        },
        DeviceLimits {
            shade_by: Some(ShadeBy::Fragments),
            array_layers: Some(12),
            ..DeviceLimits::default()
        },
        DeviceLimits {
            shade_by: Some(ShadeBy::Workgroups),
            array_layers: Some(12),
            ..DeviceLimits::default()
        },
    ] {
        let mut small = open(limits).unwrap();
        for (method, expected) in METHODS.into_iter().zip(&all) {
            let mut most_parts = 0;
            for (view, expected) in path().iter().zip(expected) {
                let frame = frame(&lumigraph, view);
                let prepared = Prepared::new(&frame, method).unwrap();
                let loaded = small.load(&frame, prepared.field()).unwrap();
                most_parts = most_parts.max(loaded.parts());
                let picture = small.draw(&frame, prepared.field(), &loaded).unwrap();
                assert!(picture == *expected, "{method:?}, {limits:?}");
            }
            let took = small.residency();
            println!("{method:?}, {limits:?}: {most_parts} parts, {took:?}");
            assert_eq!((took.level_cap, took.capped_frames), (0, 0));
            if limits.buffer_bytes.is_none() || method != Method::Exact {
                assert!(most_parts > 1, "{method:?}, {limits:?}");
            }
        }
    }
}

#[test]
fn where_memory_is_full_photos_of_the_frame_before_stay() {
    let shot = shot();
    let lumigraph = shot.lumigraph();
    // Along the wall, so that each photo comes and goes once.
    let views: Vec<View> = (0..57).map(|i| view(0.25 * f64::from(i), 2.0)).collect();
    let listed: Vec<Vec<usize>> = views
        .iter()
        .map(|view| {
            let frame = frame(&lumigraph, view);
            Prepared::new(&frame, Method::TRIANGULATED)
                .unwrap()
                .listed()
        })
        .collect();
    let most = listed.iter().map(Vec::len).max().unwrap() as u64;
    assert!(most < 16, "{most} photos a frame");
    for spare in 1..4 {
        let limits = DeviceLimits {
            array_bytes: Some((most + spare) * LAYER),
            ..DeviceLimits::default()
        };
        let Some(mut gpu) = open(limits) else { return };
        for view in &views {
            let frame = frame(&lumigraph, view);
            gpu.render(&frame, Method::TRIANGULATED).unwrap();
        }
        let took = gpu.residency();
        println!("{most} photos a frame, room for {spare} more: {took:?}");
        // OpenGL takes an array of six layers, or twelve, for cubes: such have one more.
        assert!(took.held <= (most + spare + 1) * LAYER);
        // Each once, those again that were there when memory ran out, and a few that come and go.
        assert!(took.loads <= COUNT as u64 + 2 * (most + spare), "{took:?}");
    }
}

#[test]
fn frames_in_flight_are_what_they_are_one_by_one() {
    let shot = shot();
    let lumigraph = shot.lumigraph();
    // With few layers the photos of a frame make room for the next's while it is drawn.
    for array_layers in [None, Some(12)] {
        let limits = DeviceLimits {
            array_layers,
            ..DeviceLimits::default()
        };
        let Some(mut gpu) = open(limits) else {
            return;
        };
        for method in METHODS {
            let frames = path().map(|view| frame(&lumigraph, &view));
            let alone = frames
                .each_ref()
                .map(|frame| gpu.render(frame, method).unwrap());
            let drawings = frames.each_ref().map(|frame| {
                let prepared = Prepared::new(frame, method).unwrap();
                let loaded = gpu.load(frame, prepared.field()).unwrap();
                gpu.begin(frame, prepared.field(), &loaded).unwrap()
            });
            // The last first, each on a thread of its own.
            let mut picture = RgbaImage::default();
            for (drawing, alone) in drawings.into_iter().zip(&alone).rev() {
                let read = || drawing.finish_into(&mut picture).unwrap();
                std::thread::scope(|scope| scope.spawn(read).join().unwrap());
                assert!(picture == *alone, "{method:?}, {limits:?}");
            }
        }
    }
}

#[test]
fn masks_go_with_their_parts() {
    let shot = shot();
    let lumigraph = Lumigraph {
        photos: shot.masked(),
        ..shot.lumigraph()
    };
    let frame = frame(&lumigraph, &path()[0]);
    let Some(mut gpu) = open(DeviceLimits::default()) else {
        return;
    };
    let mut small = open(DeviceLimits {
        array_layers: Some(14),
        ..DeviceLimits::default()
    })
    .unwrap();
    let prepared = Prepared::new(&frame, Method::TRIANGULATED).unwrap();
    let loaded = small.load(&frame, prepared.field()).unwrap();
    assert!(loaded.parts() > 1);
    let picture = small.draw(&frame, prepared.field(), &loaded).unwrap();
    assert!(picture == gpu.render(&frame, Method::TRIANGULATED).unwrap());
}

#[test]
fn what_a_device_cannot_draw_the_cpu_draws_and_it_is_said() {
    let shot = shot();
    let mut lumigraph = shot.lumigraph();
    let views = path();
    for (limits, masked, said) in [
        (
            DeviceLimits {
                texture_side: Some(96),
                ..DeviceLimits::default()
            },
            false,
            "a picture of 100 × 80 is more than this device draws",
        ),
        (
            DeviceLimits {
                array_layers: Some(2),
                ..DeviceLimits::default()
            },
            false,
            "more photos are needed at once than this device holds",
        ),
        (
            DeviceLimits {
                array_bytes: Some(1000),
                ..DeviceLimits::default()
            },
            false,
            "photos",
        ),
        (
            DeviceLimits {
                array_layers: Some(16),
                ..DeviceLimits::default()
            },
            true,
            "more masks are needed at once than this device holds",
        ),
    ] {
        if masked {
            lumigraph.photos = shot.masked();
        }
        let Some(gpu) = open(limits) else { return };
        let mut engine = Engine::with(gpu);
        for view in &views {
            let frame = frame(&lumigraph, view);
            let by_cpu = cpu::render(&frame, Method::Exact).unwrap();
            assert!(engine.render(&frame, Method::Exact).unwrap() == by_cpu);
        }
        let notes = engine.notes();
        assert_eq!(notes.len(), 1, "{notes:?}");
        assert!(
            notes[0].contains(said) && notes[0].contains("the CPU draws"),
            "{notes:?}"
        );
        assert!(engine.gpu().is_some() && engine.frames_by_cpu() == 3);
    }
}

#[test]
fn a_lost_device_is_opened_anew() {
    let shot = shot();
    let lumigraph = shot.lumigraph();
    let views = path();
    for method in METHODS {
        let Some(gpu) = open(DeviceLimits::default()) else {
            return;
        };
        let mut engine = Engine::with(gpu);
        let frame = frame(&lumigraph, &views[0]);
        let expected = engine.render(&frame, method).unwrap();
        let before = engine.gpu().unwrap().residency();
        engine.gpu_mut().unwrap().lose(false);
        assert!(engine.render(&frame, method).unwrap() == expected);
        let after = engine.gpu().unwrap().residency();
        assert!(after.loads == 2 * before.loads && after.held == before.held);
        // Between loading and drawing, too.
        let prepared = Prepared::new(&frame, method).unwrap();
        let ready = engine.ready(&frame, &prepared).unwrap();
        engine.gpu_mut().unwrap().lose(false);
        assert!(engine.draw_ready(&frame, &prepared, &ready).unwrap() == expected);
        let notes = engine.notes();
        assert!(
            notes[0].contains("it was lost") && notes[0].contains("goes on"),
            "{notes:?}"
        );
    }
}

#[test]
fn the_cpu_goes_on_where_a_device_is_gone_for_good() {
    let shot = shot();
    let lumigraph = shot.lumigraph();
    let frame = frame(&lumigraph, &path()[1]);
    for method in METHODS {
        let Some(gpu) = open(DeviceLimits::default()) else {
            return;
        };
        let mut engine = Engine::with(gpu);
        engine.render(&frame, method).unwrap();
        engine.gpu_mut().unwrap().lose(true);
        let by_cpu = cpu::render(&frame, method).unwrap();
        for _ in 0..2 {
            assert!(engine.render(&frame, method).unwrap() == by_cpu);
        }
        assert!(engine.gpu().is_none() && engine.frames_by_cpu() == 2);
        let notes = engine.notes();
        assert!(
            notes.len() == 1 && notes[0].ends_with("the CPU goes on"),
            "{notes:?}"
        );
    }
}

#[test]
fn a_lost_device_says_so_itself() {
    let shot = shot();
    let lumigraph = shot.lumigraph();
    let frame = frame(&lumigraph, &path()[0]);
    let Some(mut gpu) = open(DeviceLimits::default()) else {
        return;
    };
    gpu.lose(false);
    for method in METHODS {
        let error = gpu.render(&frame, method).unwrap_err();
        assert!(matches!(error, RenderError::DeviceLost(_)), "{error}");
    }
    gpu.reopen().unwrap();
    let by_cpu = cpu::render(&frame, Method::Exact).unwrap();
    assert_close(
        &gpu.render(&frame, Method::Exact).unwrap(),
        &by_cpu,
        "again",
    );
}
