//! Warps on a graphics device, against the CPU's.

use super::spared::viewers;
use super::*;
use render::gpu::{DeviceLimits, GpuWarp};
use render::ldi::FreeCost;

/// A device; none, said aloud, where no driver answers.
fn device() -> Option<GpuWarp> {
    match GpuWarp::open(&DeviceLimits::default(), false) {
        Ok(warp) => Some(warp),
        Err(error) => {
            let is_required = std::env::var("LUMIGRAPH_REQUIRE_GPU").as_deref() == Ok("1");
            assert!(!is_required, "LUMIGRAPH_REQUIRE_GPU is 1, but: {error}");
            eprintln!("SKIPPED: LDIs on the graphics device: {error}");
            None
        }
    }
}

/// A drawing over nothing, and what it took.
type Drawing = (Target, FreeCost);

/// By the device and by the CPU.
fn both(
    warp: &mut GpuWarp,
    (ldi, columns): (&Layered, &Clipped),
    (camera, window): (&Pinhole, &Window),
    options: &FreeOptions,
) -> [Drawing; 2] {
    let new = || Target::new(camera.width, camera.height);
    let [mut by_device, mut by_cpu] = [new(), new()];
    let into = &mut by_device;
    let first = warp.free(ldi, columns, camera, window, options, into);
    let first = first.unwrap();
    let scratch = &mut Free::default();
    let into = &mut by_cpu;
    let second = free(ldi, columns, camera, window, options, scratch, into);
    [(by_device, first), (by_cpu, second)]
}

/// How many pixels differ by more than two steps, or a thousandth in depth.
fn unlike(a: &Target, b: &Target) -> usize {
    let is_unlike = |i: &usize| {
        let colors = a.color[*i].iter().zip(&b.color[*i]);
        let (s, t) = (a.inverse_depth[*i], b.inverse_depth[*i]);
        colors.into_iter().any(|(a, b)| a.abs_diff(*b) > 2) || (s - t).abs() > 1e-3 * s.max(t)
    };
    (0..a.color.len()).filter(is_unlike).count()
}

#[test]
fn a_device_draws_what_the_cpu_does() {
    let Some(mut warp) = device() else { return };
    let set = set(3, 4, 96, 13, 4);
    let (mut pixels, mut off, mut views) = (0, 0, 0);
    for (i, side) in set.sides.iter().enumerate().take(3) {
        let ldi = ldi_of(side);
        let whole = Clipped::whole(&ldi);
        let tree = ClipTree::new(&ldi);
        for (desired, open) in viewers(&set, i, 6, [160, 128]) {
            let camera = Pinhole::new(&desired).unwrap();
            for fill in [0, 8] {
                let options = FreeOptions {
                    fill,
                    ..FreeOptions::default()
                };
                let seen = (&camera, &open);
                let [(ours, took), (theirs, expected)] =
                    both(&mut warp, (&ldi, &whole), seen, &options);
                views += 1;
                pixels += took.pixels;
                off += unlike(&ours, &theirs);
                assert_eq!(
                    (took.samples, took.pixels),
                    (expected.samples, expected.pixels)
                );
                assert!(
                    took.drawn.abs_diff(expected.drawn) <= 2,
                    "{took:?} {expected:?}"
                );
                assert!(
                    took.holes.abs_diff(expected.holes) <= 4,
                    "{took:?} {expected:?}"
                );
                // What is out of sight changes nothing, nor does the order of samples.
                let reach = f64::from(options.reach());
                let some = tree.columns(&ldi, &camera, &open, reach);
                let mut clipped = Target::new(160, 128);
                let into = &mut clipped;
                warp.free(&ldi, &some, &camera, &open, &options, into)
                    .unwrap();
                assert!(clipped == ours);
            }
        }
    }
    eprintln!("{off} of {pixels} pixels of {views} pictures are unlike");
    assert!(views > 20 && pixels > 50_000);
    assert!((off as f64) < 1e-3 * pixels as f64, "{off} of {pixels}");
}

/// Samples one beside the other, all as far away.
fn wall(side: u32) -> Layered {
    let view = View {
        lens: Lens::pinhole(
            DVec2::splat(f64::from(side)),
            DVec2::splat(0.5 * f64::from(side)),
        ),
        width: side,
        height: side,
        camera_from_world: Rigid3::IDENTITY,
    };
    let samples = (0..side * side).map(|i| Sample {
        color: [200, (i % 251) as u8, 7, 255],
        inverse_depth: 0.5,
        offset: [0, 0],
        look: Look::new(DVec3::Z, 1.0 / f64::from(side)),
        ends: Ends((i % 16) as u8),
    });
    let counts = vec![1; (side * side) as usize];
    Layered::new(view, 0, &counts, samples.collect::<Vec<_>>().into_iter()).unwrap()
}

/// As many samples in a pixel as overflow 32 bits, one by one in any order.
#[test]
fn all_samples_in_one_pixel_add_up() {
    let Some(mut warp) = device() else { return };
    let ldi = wall(200);
    let far = View {
        camera_from_world: Rigid3 {
            translation: DVec3::new(0.0, 0.0, 5000.0),
            ..Rigid3::IDENTITY
        },
        width: 40,
        height: 30,
        lens: Lens::pinhole(DVec2::splat(40.0), DVec2::new(20.5, 15.5)),
    };
    let camera = Pinhole::new(&far).unwrap();
    let open = Window::whole(40, 30);
    let options = FreeOptions::default();
    let drawn = (&ldi, &Clipped::whole(&ldi));
    let [(ours, took), (theirs, expected)] = both(&mut warp, drawn, (&camera, &open), &options);
    assert_eq!(took, expected);
    assert_eq!(took.drawn, 40_000);
    assert_eq!(unlike(&ours, &theirs), 0);
    assert_eq!(ours.color[15 * 40 + 20][0], 200);
}

#[test]
fn nothing_and_nonsense_are_drawn_as_the_cpu_does() {
    let Some(mut warp) = device() else { return };
    let ldi = wall(16);
    let none = Layered::new(ldi.view.clone(), 0, &[0; 256], [].into_iter()).unwrap();
    // From where no pixel's middle lies on a patch's rim.
    let eye = DVec3::new(0.0123, 0.0345, -1.0);
    let camera = Pinhole::new(&view(eye, DVec3::Z, [40, 30])).unwrap();
    let options = nonsense();
    for ldi in [&ldi, &none] {
        for open in [
            Window::whole(40, 30),
            Window::default(),
            Window::whole(900, 900),
        ] {
            for options in [FreeOptions::default(), options] {
                let all = Clipped::whole(ldi);
                let seen = (&camera, &open);
                let [(ours, took), (theirs, expected)] =
                    both(&mut warp, (ldi, &all), seen, &options);
                assert_eq!(took, expected);
                // Narrow Gaussians have weights of less than a millionth.
                let is_narrow = options.deviation.is_nan();
                assert!(is_narrow || unlike(&ours, &theirs) == 0);
            }
        }
        let mut small = Target::new(7, 7);
        let open = Window::whole(40, 30);
        let all = Clipped::whole(ldi);
        let options = FreeOptions::default();
        let took = warp.free(ldi, &all, &camera, &open, &options, &mut small);
        assert_eq!(took, Ok(FreeCost::default()));
        assert!(small == Target::new(7, 7));
    }
}

/// More than a device holds is an error that says so, and nothing is drawn.
#[test]
fn too_much_for_a_device_is_said() {
    if device().is_none() {
        return;
    }
    let limits = DeviceLimits {
        buffer_bytes: Some(1 << 18),
        ..DeviceLimits::default()
    };
    let mut warp = GpuWarp::open(&limits, false).unwrap();
    let ldi = wall(200);
    let camera = Pinhole::new(&view(DVec3::NEG_Z, DVec3::Z, [40, 30])).unwrap();
    let all = Clipped::whole(&ldi);
    let mut target = Target::new(40, 30);
    let open = Window::whole(40, 30);
    let options = FreeOptions::default();
    let error = warp.free(&ldi, &all, &camera, &open, &options, &mut target);
    let error = error.unwrap_err().to_string();
    assert!(
        error.contains("samples of a layered depth image"),
        "{error}"
    );
    assert!(target == Target::new(40, 30));
}
