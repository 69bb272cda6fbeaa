//! What clipping, fragments and threads must not change.

use super::*;

/// Views of a portal from near the middle of its semicircle, some with only a half of it in the
/// picture.
pub(super) fn viewers(set: &Set, side: usize, count: u64, size: [u32; 2]) -> Vec<(View, Window)> {
    let place = &set.sides[side][0].place;
    let interior = &set.house.interior;
    let portal = interior.portal(place.portal);
    let radius = portal.semicircle_radius(interior.up);
    let middle = semicircles(
        interior,
        &set.contents,
        &SemicircleOptions {
            views: 1,
            span: 1.0,
        },
    );
    let is_meant = |p: &&SemicircleView| (p.portal, p.from) == (place.portal, place.from);
    let center = middle
        .iter()
        .find(is_meant)
        .unwrap()
        .camera_from_world
        .center();
    let mut found = Vec::new();
    for seed in 0..count {
        let mut r = random(seed);
        let eye =
            center + radius * DVec3::new(1.4 * (r() - 0.5), 0.4 * (r() - 0.5), 1.4 * (r() - 0.5));
        // Every other one has the portal's middle at the picture's left or right side.
        let aside = [0.0, 0.5_f64.atan2(0.6), 0.0, -0.5_f64.atan2(0.6)][seed as usize % 4];
        let turn = DQuat::from_axis_angle(interior.up, aside);
        let to = eye + turn * (portal.polygon.center() - eye);
        let desired = view(eye, to, size);
        let open = window(interior, place.from, place.portal, &desired);
        found.push((desired, open));
    }
    found
}

/// The columns that have a sample in sight.
fn needed(ldi: &Layered, camera: &Pinhole, open: &Window) -> Clipped {
    let warp = Warp::new(&ldi.camera, camera);
    let [width, height] = ldi.size();
    let is_seen = |(row, i): (u32, usize)| {
        let (pixel, s) = ldi.place(i, row);
        warp.at(pixel, s).is_some_and(|at| {
            let (x, y) = (at.pixel.x.floor(), at.pixel.y.floor());
            y >= 0.0 && x >= 0.0 && open.row(y as u32).contains(&(x as u32))
        })
    };
    let is_needed = |x: &u32| {
        let rows = (0..height).flat_map(|y| ldi.samples_of(*x..*x + 1, y).map(move |i| (y, i)));
        rows.into_iter().any(is_seen)
    };
    let kept = (0..width).filter(is_needed).map(|x| x..x + 1).collect();
    Clipped::of_columns(ldi, kept)
}

#[test]
fn clipping_changes_nothing_and_spares_columns() {
    let set = set(3, 4, 96, 13, 2);
    let (mut kept, mut all, mut least) = ([0.0; 2], [0.0_f64; 2], [0.0; 2]);
    let mut narrow = [0.0; 2];
    for (i, side) in set.sides.iter().enumerate().take(5) {
        let ldi = ldi_of(side);
        let tree = ClipTree::new(&ldi);
        for (k, (desired, open)) in viewers(&set, i, 12, [640, 512]).iter().enumerate() {
            let camera = Pinhole::new(desired).unwrap();
            let whole = Clipped::whole(&ldi);
            let some = tree.columns(&ldi, &camera, open, 4.0);
            for row in 0..ldi.size()[1] {
                let kept = some.of_row(row);
                assert!(kept.windows(2).all(|pair| pair[0].end < pair[1].start));
            }
            assert!(
                drawn_free(&ldi, &some, &camera, open) == drawn_free(&ldi, &whole, &camera, open)
            );
            let [a, b] = [&some, &whole]
                .map(|columns| drawn_ordered(&ldi, columns, &camera, open, Stamp::Sized, 1));
            assert!(a == b);
            if (0..512).any(|y| !open.row(y).is_empty()) {
                kept[k % 2] += some.samples(&ldi) as f64;
                let points = tree.columns(&ldi, &camera, open, 1.0);
                narrow[k % 2] += points.samples(&ldi) as f64;
                let needed = needed(&ldi, &camera, open);
                least[k % 2] += needed.samples(&ldi) as f64;
                all[k % 2] += ldi.len() as f64;
            } else {
                assert!(some.is_empty());
            }
        }
    }
    let [whole, part] = [0, 1].map(|k| 100.0 * kept[k] / all[k]);
    let [need_whole, need_part] = [0, 1].map(|k| 100.0 * least[k] / all[k]);
    eprintln!("of them columns with anything in sight: {need_whole:.1} %, {need_part:.1} %");
    eprintln!("kept: {whole:.1} % looking at portals, {part:.1} % with half of them in sight");
    let [narrow_whole, narrow_part] = [0, 1].map(|k| 100.0 * narrow[k] / all[k]);
    eprintln!("for stamps of a pixel's reach: {narrow_whole:.1} %, {narrow_part:.1} %");
    assert!(narrow_part <= 52.0 && whole < 80.0);
}

#[test]
fn what_a_window_closes_changes_nothing_that_it_leaves_open() {
    let set = set(3, 4, 96, 13, 4);
    let [width, height] = [160, 128];
    for (i, side) in set.sides.iter().enumerate().take(3) {
        let ldi = ldi_of(side);
        let columns = Clipped::whole(&ldi);
        for (desired, _) in viewers(&set, i, 6, [width, height]) {
            let camera = Pinhole::new(&desired).unwrap();
            // A square on its corner, which reaches all sides of the picture but not its corners.
            let across = (2.0_f64.sqrt() * 0.52 * f64::from(width)) as u32;
            let forward = camera.rotation.transpose() * DVec3::Z;
            let up = camera.rotation.transpose() * DVec3::new(1.0, -1.0, 0.0);
            let corner_down = View {
                width: across,
                height: across,
                lens: Lens::pinhole(camera.focal, DVec2::splat(0.5 * f64::from(across))),
                camera_from_world: Rigid3::looking_at(camera.center, camera.center + forward, up),
            };
            let open = Window::of(&Region::of(&corner_down), &camera);
            assert!(open.row(0).start > 0 && open.row(height / 2) == (0..width));
            let drawn = |window: &Window| {
                let options = FreeOptions {
                    fill: 0,
                    ..FreeOptions::default()
                };
                let mut target = Target::new(width, height);
                let scratch = &mut Free::default();
                free(
                    &ldi,
                    &columns,
                    &camera,
                    window,
                    &options,
                    scratch,
                    &mut target,
                );
                target
            };
            let (some, all) = (drawn(&open), drawn(&Window::whole(width, height)));
            assert!(all.color.iter().any(|color| color[3] > 0));
            for y in 0..height {
                for x in 0..width {
                    let k = (y * width + x) as usize;
                    let expected = match open.row(y).contains(&x) {
                        true => (all.color[k], all.inverse_depth[k]),
                        false => ([0; 4], 0.0),
                    };
                    assert_eq!((some.color[k], some.inverse_depth[k]), expected, "{x} {y}");
                }
            }
        }
    }
}

#[test]
fn fragments_and_threads_change_nothing() {
    let set = set(3, 4, 96, 13, 4);
    let one = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .unwrap();
    let three = rayon::ThreadPoolBuilder::new()
        .num_threads(3)
        .build()
        .unwrap();
    for (i, side) in set.sides.iter().enumerate().take(3) {
        let ldi = ldi_of(side);
        let whole = Clipped::whole(&ldi);
        let tree = ClipTree::new(&ldi);
        let mut all = viewers(&set, i, 6, [160, 128]);
        // With the epipole in the image, and nearly at infinity.
        let forward = ldi.camera.rotation.transpose();
        let size = ldi.near;
        for ahead in [0.5, -0.5, 1e-9, 0.0] {
            let off = DVec3::new(0.02, 0.01, ahead);
            let eye = ldi.camera.center + size * (forward * off);
            let desired = view(eye, eye + forward * DVec3::Z, [160, 128]);
            all.push((desired, Window::whole(160, 128)));
        }
        for (desired, open) in &all {
            let camera = Pinhole::new(desired).unwrap();
            let some = tree.columns(&ldi, &camera, open, 4.0);
            for stamp in [
                Stamp::One,
                Stamp::Two,
                Stamp::Three,
                Stamp::Five,
                Stamp::Sized,
            ] {
                let serial = drawn_ordered(&ldi, &whole, &camera, open, stamp, 1);
                for fragments in [2, 3, 4, 7, 8, 16, 31, 64] {
                    let draw = || drawn_ordered(&ldi, &some, &camera, open, stamp, fragments);
                    let pool = if fragments % 2 == 0 { &three } else { &one };
                    assert!(pool.install(draw) == serial, "{stamp:?} {fragments}");
                }
            }
            let draw = || drawn_free(&ldi, &whole, &camera, open);
            assert!(one.install(draw) == three.install(draw));
        }
    }
}

#[test]
fn every_number_of_fragments_draws_the_same() {
    let set = set(2, 3, 64, 5, 9);
    let ldi = ldi_of(&set.sides[0]);
    let whole = Clipped::whole(&ldi);
    for (desired, open) in viewers(&set, 0, 2, [160, 128]) {
        let camera = Pinhole::new(&desired).unwrap();
        for stamp in [Stamp::Three, Stamp::Sized] {
            let serial = drawn_ordered(&ldi, &whole, &camera, &open, stamp, 1);
            for fragments in 1..=64 {
                let drawn = drawn_ordered(&ldi, &whole, &camera, &open, stamp, fragments);
                assert!(drawn == serial, "{stamp:?} {fragments}");
            }
        }
    }
}

/// Pixels of the LDI that are many of the picture's wide, so that a sample may be drawn far beyond the cut that
/// its pixel's middle lies on this side of.
#[test]
fn fragments_change_nothing_where_pixels_are_huge() {
    for seed in 0..6 {
        let ldi = places::random_ldi(&[255; 16 * 12], [16, 12], seed);
        let whole = Clipped::whole(&ldi);
        for (z, x) in [(1.0, 1.0), (1.5, -1.0), (2.0, 1.0), (2.0, -1.0), (3.0, 1.0)] {
            let eye = DVec3::new(0.0, 0.0, z);
            let desired = view(eye, eye + DVec3::new(x, 0.1, 0.2), [40, 30]);
            let camera = Pinhole::new(&desired).unwrap();
            let open = Window::whole(40, 30);
            for stamp in [Stamp::Five, Stamp::Sized] {
                let serial = drawn_ordered(&ldi, &whole, &camera, &open, stamp, 1);
                for fragments in [2, 5, 16] {
                    let drawn = drawn_ordered(&ldi, &whole, &camera, &open, stamp, fragments);
                    assert!(drawn == serial, "{seed} {z} {stamp:?} {fragments}");
                }
            }
        }
    }
}
