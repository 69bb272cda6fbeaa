//! Whatever the place one looks from.

use super::*;

/// Draws an LDI in all ways; pictures must be finite.
pub(super) fn draw_all(ldi: &Layered, desired: &View) {
    let camera = Pinhole::new(desired).unwrap();
    let open = Window::whole(desired.width, desired.height);
    let tree = ClipTree::new(ldi);
    let some = tree.columns(ldi, &camera, &open, 4.0);
    let whole = Clipped::whole(ldi);
    let target = drawn_free(ldi, &whole, &camera, &open);
    assert!(target == drawn_free(ldi, &some, &camera, &open));
    assert!(
        target
            .inverse_depth
            .iter()
            .all(|s| s.is_finite() && *s >= 0.0)
    );
    for stamp in [Stamp::One, Stamp::Two, Stamp::Five, Stamp::Sized] {
        let serial = drawn_ordered(ldi, &whole, &camera, &open, stamp, 1);
        assert!(serial == drawn_ordered(ldi, &some, &camera, &open, stamp, 5));
        assert!(
            serial
                .inverse_depth
                .iter()
                .all(|s| s.is_finite() && *s >= 0.0)
        );
    }
}

pub(super) fn random_ldi(counts: &[u8], size: [u32; 2], seed: u64) -> Layered {
    let mut r = random(seed);
    let view = View {
        lens: Lens::pinhole(DVec2::splat(20.0), DVec2::new(8.0, 6.5)),
        width: size[0],
        height: size[1],
        camera_from_world: Rigid3::IDENTITY,
    };
    let total = counts.iter().map(|n| usize::from(*n)).sum();
    let sample = |_| Sample {
        color: [(255.0 * r()) as u8, (255.0 * r()) as u8, 7, 255],
        inverse_depth: (0.1 + 0.9 * r()) as f32,
        offset: [(255.0 * r() - 128.0) as i8, (255.0 * r() - 128.0) as i8],
        look: Look((65535.0 * r()) as u16),
        ends: Ends((16.0 * r()) as u8),
    };
    let samples: Vec<Sample> = (0..total).map(sample).collect();
    Layered::new(view, 3, counts, samples.into_iter()).unwrap()
}

#[test]
fn whatever_the_place_there_is_a_picture() {
    let mut r = random(5);
    let mut ldis = vec![
        random_ldi(&[0; 16 * 12], [16, 12], 1),
        random_ldi(&[255; 16 * 12], [16, 12], 2),
        random_ldi(&[200], [1, 1], 3),
    ];
    let counts: Vec<u8> = (0..17 * 13).map(|_| (4.0 * r()) as u8).collect();
    ldis.push(random_ldi(&counts, [17, 13], 4));
    let mut views = Vec::new();
    for eye in [
        DVec3::ZERO,
        // The epipole on a pixel's corner, edge and middle, in front and behind.
        DVec3::new(0.0, 0.025 * 0.3, 0.3),
        DVec3::new(0.05, 0.0, 1.0),
        DVec3::new(-0.05, 0.025, -1.0),
        DVec3::new(0.025, 0.0, 1.0),
        // At infinity.
        DVec3::new(1.0, 0.0, 0.0),
        DVec3::new(0.0, -1.0, 0.0),
        DVec3::new(0.3, 0.2, 0.0),
        DVec3::new(1.0, 1.0, 1e-300),
        DVec3::new(1.0, 1.0, -1e-12),
        DVec3::new(0.0, 0.0, 1e-12),
        // Beyond everything, and far off.
        DVec3::new(0.0, 0.0, 30.0),
        DVec3::new(0.0, 0.0, 2.0),
        DVec3::new(1e7, 0.0, -1e7),
    ] {
        for (x, z) in [(0.0, 1.0), (0.0, -1.0), (1.0, 0.2), (-1.0, 1.0)] {
            views.push(view(eye, eye + DVec3::new(x, 0.1, z), [40, 30]));
            views.push(View {
                camera_from_world: Rigid3 {
                    translation: -eye,
                    ..Rigid3::IDENTITY
                },
                ..view(eye, eye + DVec3::Z, [40, 30])
            });
        }
    }
    for ldi in &ldis {
        for desired in &views {
            draw_all(ldi, desired);
        }
    }
    // Seen from far off, all samples share a pixel.
    let far = View {
        camera_from_world: Rigid3 {
            translation: DVec3::new(0.0, 0.0, 5000.0),
            ..Rigid3::IDENTITY
        },
        ..views[0].clone()
    };
    draw_all(&ldis[1], &far);
    // Pictures of another size than the camera's, and windows that are none.
    let camera = Pinhole::new(&views[0]).unwrap();
    let whole = Clipped::whole(&ldis[1]);
    for (target, open) in [
        (Target::new(7, 7), Window::whole(40, 30)),
        (Target::new(40, 30), Window::default()),
        (Target::new(40, 30), Window::whole(0, 0)),
        (Target::new(40, 30), Window::whole(900, 900)),
    ] {
        let mut target = target;
        free(
            &ldis[1],
            &whole,
            &camera,
            &open,
            &FreeOptions::default(),
            &mut Free::default(),
            &mut target,
        );
        ordered(
            &ldis[1],
            &whole,
            &camera,
            &open,
            &OrderedOptions {
                stamp: Stamp::Sized,
                fragments: 3,
            },
            &mut Ordered::default(),
            &mut target,
        );
    }
    let options = nonsense();
    let mut target = Target::new(40, 30);
    let open = Window::whole(40, 30);
    free(
        &ldis[3],
        &Clipped::whole(&ldis[3]),
        &camera,
        &open,
        &options,
        &mut Free::default(),
        &mut target,
    );
}
