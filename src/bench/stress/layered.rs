//! Layered depth images that try to break their warps.

use crate::bench::Random;
use calibrate::{Lens, Rigid3, View};
use glam::{DVec2, DVec3};
use render::interior::{Pinhole, Target, Window};
use render::ldi::{
    ClipTree, Clipped, Ends, Free, FreeOptions, Layered, Look, Ordered, OrderedOptions, Sample,
    Stamp, free, ordered,
};

/// Pixels of the layered image and of the desired view.
const SIZE: [u32; 2] = [17, 13];
const DESIRED: [u32; 2] = [40, 30];
/// Pixels of the layered image a radian.
const FOCAL: f64 = 20.0;

/// Warps the layered image of a number in all ways and checks what must hold:
///
/// - depths are finite and none is behind;
/// - clipped is unclipped;
/// - fragments and threads change nothing.
///
/// # Errors
/// What does not hold, with the scene.
pub(super) fn check(seed: u64) -> Result<(), String> {
    let mut random = Random(seed ^ 0x1d1);
    let (layers, ldi) = layered(&mut random)?;
    let (place, desired) = desired(&mut random);
    let named = |what: &str| format!("{layers}, seen from {place}: {what}");
    let camera = Pinhole::new(&desired).map_err(|error| named(&error.to_string()))?;
    let whole = Clipped::whole(&ldi);
    let open = Window::whole(desired.width, desired.height);
    let clipped = ClipTree::new(&ldi).columns(&ldi, &camera, &open, 4.0);

    let drawn = |columns: &Clipped| {
        let mut target = Target::new(camera.width, camera.height);
        let options = FreeOptions::default();
        let room = &mut Free::default();
        free(&ldi, columns, &camera, &open, &options, room, &mut target);
        target
    };
    let first = drawn(&whole);
    is_sound(&first).map_err(named)?;
    if first != drawn(&clipped) {
        return Err(named("clipping changes the picture in any order"));
    }
    if first != super::on_one_thread(|| drawn(&whole))? {
        return Err(named("threads change the picture in any order"));
    }

    for stamp in [Stamp::One, Stamp::Two, Stamp::Five, Stamp::Sized] {
        let drawn = |columns: &Clipped, fragments: usize| {
            let mut target = Target::new(camera.width, camera.height);
            let options = OrderedOptions { stamp, fragments };
            let room = &mut Ordered::default();
            ordered(&ldi, columns, &camera, &open, &options, room, &mut target);
            target
        };
        let serial = drawn(&whole, 1);
        is_sound(&serial).map_err(named)?;
        if serial != drawn(&clipped, 1 + random.below(64)) {
            return Err(named(&format!("clipping or fragments change {stamp:?}")));
        }
    }
    Ok(())
}

fn is_sound(target: &Target) -> Result<(), &'static str> {
    let is_depth = |s: &f32| s.is_finite() && *s >= 0.0;
    match target.inverse_depth.iter().all(is_depth) {
        true => Ok(()),
        false => Err("a depth that is none"),
    }
}

/// Samples as many as any pixel may have, near, far, in steps along columns.
fn layered(random: &mut Random) -> Result<(&'static str, Layered), String> {
    let kinds = [
        "no samples",
        "a sample a pixel",
        "a few layers",
        "a pixel of 255",
    ];
    let kind = random.below(kinds.len());
    let pixels = (SIZE[0] * SIZE[1]) as usize;
    let counts: Vec<u8> = (0..pixels)
        .map(|i| match kind {
            0 => 0,
            1 => 1,
            2 => random.below(5) as u8,
            _ => [255, 1][usize::from(i != pixels / 2)],
        })
        .collect();
    let column = |i: usize| i % SIZE[0] as usize;
    let in_steps = random.below(2) == 0;
    let mut samples = Vec::new();
    for (i, count) in counts.iter().enumerate() {
        for _ in 0..*count {
            // Edges in depth between columns, and everything on pixels' centres.
            let step = if column(i) % 4 < 2 { 1.0 } else { 0.25 };
            let (inverse_depth, offset) = match in_steps {
                true => (step, [0; 2]),
                false => {
                    let offset = [0; 2].map(|_: i32| random.within(-128.0, 127.0) as i8);
                    (10.0_f64.powf(random.within(-6.0, 1.0)), offset)
                }
            };
            samples.push(Sample {
                color: [random.below(256) as u8, random.below(256) as u8, 7, 255],
                inverse_depth: inverse_depth as f32,
                offset,
                look: Look(random.below(1 << 16) as u16),
                ends: Ends(random.below(16) as u8),
            });
        }
    }
    let view = View {
        lens: Lens::pinhole(DVec2::splat(FOCAL), DVec2::new(8.5, 6.5)),
        width: SIZE[0],
        height: SIZE[1],
        camera_from_world: Rigid3::IDENTITY,
    };
    let ldi = Layered::new(view, 3, &counts, samples.into_iter()).map_err(|e| e.to_string())?;
    Ok((kinds[kind], ldi))
}

/// Where an epipole is hard to order by.
fn desired(random: &mut Random) -> (&'static str, View) {
    // Of a place in the image, by halves of pixels: corners, edges and centres.
    let mut along = || {
        let half =
            |random: &mut Random, side: u32| random.below(2 * side as usize + 1) as f64 / 2.0;
        let at = DVec2::new(half(random, SIZE[0]), half(random, SIZE[1]));
        ((at - DVec2::new(8.5, 6.5)) / FOCAL).extend(1.0)
    };
    let ahead = along();
    let (place, eye) = match random.below(7) {
        0 => ("the same place", DVec3::ZERO),
        1 => (
            "a pixel's corner, edge or centre, ahead",
            ahead * random.within(0.01, 3.0),
        ),
        2 => (
            "a pixel's corner, edge or centre, behind",
            -ahead * random.within(0.01, 3.0),
        ),
        3 => ("aside, the epipole at infinity", ahead.with_z(0.0)),
        4 => {
            let size = 10.0_f64.powf(random.within(-300.0, -3.0));
            ("nearly aside", ahead.with_z(size))
        }
        5 => ("afar", ahead * 10.0_f64.powf(random.within(3.0, 9.0))),
        _ => ("anywhere", random.vector(2.0)),
    };
    let target = eye + DVec3::new(0.0, 0.0, [1.0, -1.0][random.below(2)]) + random.vector(0.5);
    let lens = Lens::pinhole(DVec2::splat(30.0), DVec2::new(20.0, 15.0));
    let camera_from_world = match random.below(2) {
        0 => Rigid3::new(glam::DQuat::IDENTITY, -eye),
        _ => Rigid3::looking_at(eye, target, DVec3::Y),
    };
    let [width, height] = DESIRED;
    (
        place,
        View {
            lens,
            width,
            height,
            camera_from_world,
        },
    )
}
