//! The order in which LDIs are drawn, against depths.

use crate::house;

use calibrate::{Lens, Rigid3, View};
use glam::{DVec2, DVec3};
use house::{random, small_house, view};
use proxy::interior::{SemicircleOptions, semicircles};
use rayon::prelude::*;
use render::interior::{CellGeometry, Pinhole, Reference, Target, Warp, Window};
use render::ldi::{
    Clipped, ConstructOptions, Ends, Layered, Look, Ordered, OrderedOptions, Run, Sample, Stamp,
    Traversal, construct, ordered, ordered_by,
};

/// Some portals' LDIs.
fn ldis() -> Vec<Layered> {
    let (house, contents) = small_house(3, 4);
    let geometry = CellGeometry::new(&house.model, &contents);
    let places = semicircles(&house.interior, &contents, &SemicircleOptions::default());
    let make = |side: &[_]| {
        let one = |p| Reference::new(&house.interior, &house.model, &geometry, p, [64, 64]);
        let images: Vec<Reference> = side.iter().map(one).collect();
        let images: Vec<&Reference> = images.iter().collect();
        construct(&images, &ConstructOptions::default())
            .unwrap()
            .ldi
    };
    places.chunks(13).take(6).map(make).collect()
}

/// The nearest inverse depth in every pixel, of all samples as points.
fn nearest(ldi: &Layered, camera: &Pinhole) -> Vec<f32> {
    let (width, height) = (camera.width as usize, camera.height as usize);
    let warp = Warp::new(&ldi.camera, camera);
    let mut depths = vec![0.0_f32; width * height];
    for row in 0..ldi.size()[1] {
        for i in ldi.samples_of(0..ldi.size()[0], row) {
            let (pixel, s) = ldi.place(i, row);
            let Some(at) = warp.at(pixel, s) else {
                continue;
            };
            let (x, y) = (at.pixel.x.floor(), at.pixel.y.floor());
            if (0.0..width as f64).contains(&x) && (0.0..height as f64).contains(&y) {
                let depth = &mut depths[y as usize * width + x as usize];
                *depth = depth.max(at.inverse_depth as f32);
            }
        }
    }
    depths
}

/// Inverse depths apart by more than this ratio are two surfaces.
const FAR: f32 = 0.9;

/// Pixels drawn; those that show what is a tenth farther than the nearest sample; and of
/// those the ones without a depth edge beside them.
fn compare(ours: &Target, nearest: &[f32]) -> [usize; 3] {
    let (width, height) = (ours.width as i32, ours.height as i32);
    let mut counts = [0; 3];
    for y in 0..height {
        for x in 0..width {
            let i = (y * width + x) as usize;
            let (a, b) = (ours.inverse_depth[i], nearest[i]);
            counts[0] += usize::from(a > 0.0);
            if b > 0.0 && a > 0.0 && a < FAR * b {
                counts[1] += 1;
                let around = (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (x + dx, y + dy)));
                let is_edge = around
                    .filter(|(x, y)| (0..width).contains(x) && (0..height).contains(y))
                    .map(|(x, y)| nearest[(y * width + x) as usize])
                    .any(|s| s < FAR * b || s > b / FAR);
                counts[2] += usize::from(!is_edge);
            }
        }
    }
    counts
}

/// A viewer of an LDI's portal, mostly before it.
fn viewer(ldi: &Layered, seed: u64) -> View {
    let mut r = random(seed);
    let camera = &ldi.camera;
    let to_world = camera.rotation.transpose();
    // The portal is about that far.
    let unit = ldi.near;
    let aside = DVec3::new(2.4 * (r() - 0.5), 0.8 * (r() - 0.5), 1.6 * (r() - 0.75));
    let eye = camera.center + unit * (to_world * aside);
    let at = DVec3::new(r() - 0.5, r() - 0.5, 1.0 + 2.0 * r());
    view(eye, camera.center + unit * (to_world * at), [160, 120])
}

#[test]
fn points_in_order_show_what_is_nearest() {
    // 10,000 take a minute.
    let count = std::env::var("LUMIGRAPH_LDI_WARPS").ok();
    let count: u64 = count.and_then(|n| n.parse().ok()).unwrap_or(600);
    let ldis = ldis();
    let one = |seed: u64| {
        let ldi = &ldis[seed as usize % ldis.len()];
        let camera = Pinhole::new(&viewer(ldi, seed)).unwrap();
        let nearest = nearest(ldi, &camera);
        let window = Window::whole(camera.width, camera.height);
        let all = Clipped::whole(ldi);
        let mut scratch = Ordered::default();
        [Stamp::One, Stamp::Five, Stamp::Three, Stamp::Sized].map(|stamp| {
            let options = OrderedOptions {
                stamp,
                fragments: 1,
            };
            let mut target = Target::new(camera.width, camera.height);
            ordered(
                ldi,
                &all,
                &camera,
                &window,
                &options,
                &mut scratch,
                &mut target,
            );
            compare(&target, &nearest)
        })
    };
    let sum = |mut a: [[usize; 3]; 4], b: [[usize; 3]; 4]| {
        a.iter_mut()
            .flatten()
            .zip(b.iter().flatten())
            .for_each(|(a, b)| *a += b);
        a
    };
    let sums = (0..count)
        .into_par_iter()
        .map(one)
        .reduce(Default::default, sum);
    for (name, [all, wrong, inside]) in ["points", "five", "3 x 3", "sized"].iter().zip(sums) {
        let share = 100.0 * wrong as f64 / all as f64;
        eprintln!(
            "{count} warps, {name}: {wrong} of {all} wrong, {share:.4} %; {inside} off edges"
        );
    }
    let [all, wrong, inside] = sums[0];
    assert!(
        all as u64 > 1000 * count && 10_000 * wrong <= 5 * all,
        "{wrong} of {all}"
    );
    // Some are two pixels from one.
    assert!(
        10 * inside <= wrong,
        "{inside} of {wrong} are not beside an edge"
    );
}

/// Every pixel a few samples of any depth: nothing but edges.
fn noise(seed: u64) -> Layered {
    let mut r = random(seed);
    let camera_from_world = Rigid3::IDENTITY;
    let view = View {
        lens: Lens::pinhole(DVec2::splat(60.0), DVec2::splat(32.0)),
        width: 64,
        height: 64,
        camera_from_world,
    };
    let counts: Vec<u8> = (0..64 * 64).map(|_| 1 + (2.0 * r()) as u8).collect();
    let mut samples = Vec::new();
    for count in &counts {
        let mut depths: Vec<f32> = (0..*count).map(|_| 0.1 + 0.9 * r() as f32).collect();
        depths.sort_by(f32::total_cmp);
        samples.extend(depths.into_iter().map(|inverse_depth| Sample {
            color: [(256.0 * r()) as u8, 9, 9, 255],
            inverse_depth,
            offset: [(256.0 * r() - 128.0) as i8, (256.0 * r() - 128.0) as i8],
            look: Look::default(),
            ends: Ends::default(),
        }));
    }
    Layered::new(view, 0, &counts, samples.into_iter()).unwrap()
}

/// The share of wrong pixels in an order, over many views with the epipole in the image.
fn wrong(change: impl Fn(Traversal) -> Traversal, is_in_front: bool) -> f64 {
    let mut sums = [0; 3];
    for seed in 0..60 {
        let ldi = noise(seed);
        let mut r = random(99 + seed);
        let along = if is_in_front { 0.4 } else { -0.4 };
        let eye = DVec3::new(0.3 * (r() - 0.5), 0.3 * (r() - 0.5), along);
        let desired = View {
            // Large, so that few samples share a pixel that are not on one line.
            lens: Lens::pinhole(DVec2::splat(240.0), DVec2::splat(192.0)),
            width: 384,
            height: 384,
            camera_from_world: Rigid3 {
                translation: -eye,
                ..Rigid3::IDENTITY
            },
        };
        let camera = Pinhole::new(&desired).unwrap();
        let traversal = change(Traversal::new(&ldi, &camera));
        let mut target = Target::new(384, 384);
        let (all, window) = (Clipped::whole(&ldi), Window::whole(384, 384));
        let options = OrderedOptions {
            stamp: Stamp::One,
            fragments: 1,
        };
        let scratch = &mut Ordered::default();
        ordered_by(
            &traversal,
            &ldi,
            &all,
            &camera,
            &window,
            &options,
            scratch,
            &mut target,
        );
        let counts = compare(&target, &nearest(&ldi, &camera));
        sums.iter_mut().zip(counts).for_each(|(a, b)| *a += b);
    }
    sums[1] as f64 / sums[0] as f64
}

#[test]
fn other_orders_are_wrong() {
    let turn = |runs: [Run; 3]| {
        let [a, b, c] = runs.map(|run| Run {
            is_reversed: !run.is_reversed,
            ..run
        });
        [c, b, a]
    };
    for is_in_front in [true, false] {
        let right = wrong(|t| t, is_in_front);
        let reversed = wrong(
            |t| Traversal {
                rows: turn(t.rows),
                columns: turn(t.columns),
            },
            is_in_front,
        );
        // The epipole's own row and column at the other end.
        let other_end = |[a, b, c]: [Run; 3]| if is_in_front { [c, a, b] } else { [b, c, a] };
        let sheets = wrong(
            |t| Traversal {
                rows: other_end(t.rows),
                columns: other_end(t.columns),
            },
            is_in_front,
        );
        let swapped = wrong(
            |t| Traversal {
                rows: t.columns,
                columns: t.rows,
            },
            is_in_front,
        );
        eprintln!(
            "in front {is_in_front}: right {:.3} %, reversed {:.2} %, sheets {:.3} %, swapped {:.2} %",
            100.0 * right,
            100.0 * reversed,
            100.0 * sheets,
            100.0 * swapped
        );
        assert!(reversed > 5.0 * right, "{reversed} {right}");
        assert!(sheets > 1.3 * right, "{sheets} {right}");
        assert!(swapped > 5.0 * right, "{swapped} {right}");
    }
}

#[test]
fn the_epipoles_row_and_column_come_at_the_right_end() {
    // One line through the epipole, at (32.5 + 0.3, 32.5 + 0.3): a sample of its own pixel's row,
    // below it, and one of the next row, farther from the epipole: they meet.
    let view = View {
        lens: Lens::pinhole(DVec2::splat(60.0), DVec2::splat(32.5)),
        width: 65,
        height: 65,
        camera_from_world: Rigid3::IDENTITY,
    };
    for (along, own_is_near) in [(0.5, true), (-0.5, false)] {
        let eye = DVec3::new(along * 0.3 / 60.0, along * 0.3 / 60.0, along);
        let camera = Pinhole::new(&View {
            camera_from_world: Rigid3 {
                translation: -eye,
                ..Rigid3::IDENTITY
            },
            ..view.clone()
        })
        .unwrap();
        for axis in 0..2 {
            let warp = |s: f64, at: DVec2| {
                let here =
                    render::ldi::Layered::new(view.clone(), 0, &[0; 65 * 65], [].into_iter());
                Warp::new(&here.unwrap().camera, &camera)
                    .at(at, s)
                    .unwrap()
                    .pixel
            };
            // Along the other axis the same place.
            let place = |off: f64| {
                let mut at = DVec2::splat(32.8);
                at[axis] += off;
                at
            };
            // The one beside the epipole is drawn where the other one is: solve for its depth.
            let (own, next) = (place(0.15), place(0.45));
            let target = warp(0.5, next);
            let (mut low, mut high) = (0.0, 1.9);
            for _ in 0..60 {
                let s = 0.5 * (low + high);
                // What is nearer moves more: away from the epipole in front, towards it behind.
                let is_short = (warp(s, own)[axis] < target[axis]) == (along > 0.0);
                if is_short { low = s } else { high = s }
            }
            let own_depth = 0.5 * (low + high);
            if !(own_depth > 0.05 && own_depth < 1.85) {
                continue;
            }
            assert_eq!(own_depth > 0.5, own_is_near);
            let mut counts = vec![0_u8; 65 * 65];
            let mut samples = Vec::new();
            let mut list = [(own, own_depth), (next, 0.5)];
            list.sort_by(|a, b| {
                (a.0.y.floor(), a.0.x)
                    .partial_cmp(&(b.0.y.floor(), b.0.x))
                    .unwrap()
            });
            for (at, s) in list {
                counts[at.y as usize * 65 + at.x as usize] += 1;
                let offset = (256.0 * (at - at.floor() - 0.5)).round();
                samples.push(Sample {
                    color: [(100.0 * s) as u8, 0, 0, 255],
                    inverse_depth: s as f32,
                    offset: [offset.x as i8, offset.y as i8],
                    look: Look::default(),
                    ends: Ends::default(),
                });
            }
            let ldi = Layered::new(view.clone(), 0, &counts, samples.into_iter()).unwrap();
            let (all, window) = (Clipped::whole(&ldi), Window::whole(65, 65));
            let mut target = Target::new(65, 65);
            let options = OrderedOptions {
                stamp: Stamp::Three,
                fragments: 1,
            };
            ordered(
                &ldi,
                &all,
                &camera,
                &window,
                &options,
                &mut Ordered::default(),
                &mut target,
            );
            let depths = nearest(&ldi, &camera);
            let most = depths.iter().copied().fold(0.0, f32::max);
            let shown: Vec<f32> = target
                .inverse_depth
                .iter()
                .copied()
                .filter(|s| *s > 0.0)
                .collect();
            assert!(
                shown.iter().filter(|s| **s == most).count() >= 9,
                "{along} {axis} {shown:?}"
            );
        }
    }
}
