//! Layered depth images: made, drawn, clipped, kept in files.

mod house;

use calibrate::{Lens, Rigid3, View};
use datasets::house::House;
use glam::{DQuat, DVec2, DVec3};
use house::{random, small_house, view};
use proptest::prelude::*;
use proxy::interior::{
    CellId, Contents, Interior, PortalId, SemicircleOptions, SemicircleView, semicircles, visible,
};
use render::interior::{
    Beyond, CellGeometry, Pinhole, Reference, Splat, Target, Warp, Window, warp,
};
use render::ldi::{
    ClipTree, Clipped, Conflict, ConstructOptions, Free, FreeOptions, Layered, Look, Ordered,
    OrderedOptions, Sample, Stamp, construct, free, layers, ordered, parse, read, write,
};
use std::path::Path;

/// A house and the images before its portals, side by side.
struct Set {
    house: House,
    contents: Contents,
    sides: Vec<Vec<Reference>>,
}

fn set(rooms: usize, seed: u32, size: u32, views: usize, step: usize) -> Set {
    let (house, contents) = small_house(rooms, seed);
    let geometry = CellGeometry::new(&house.model, &contents);
    let options = SemicircleOptions {
        views,
        ..SemicircleOptions::default()
    };
    let places = semicircles(&house.interior, &options);
    let make =
        |p: &SemicircleView| Reference::new(&house.interior, &house.model, &geometry, p, [size; 2]);
    let side = |side: &[SemicircleView]| side.iter().map(make).collect();
    let sides = places.chunks(views).step_by(step).map(side).collect();
    Set {
        house,
        contents,
        sides,
    }
}

fn ldi_of(side: &[Reference]) -> Layered {
    let images: Vec<&Reference> = side.iter().collect();
    construct(&images, &ConstructOptions::default())
        .unwrap()
        .ldi
}

/// Where one sees through a portal; nowhere if one doesn't.
fn window(interior: &Interior, from: Option<CellId>, portal: PortalId, view: &View) -> Window {
    let camera = Pinhole::new(view).unwrap();
    let visibility = visible(interior, from, view);
    let is_meant = |pass: &&proxy::interior::Pass| pass.depth == 0 && pass.portal == portal;
    let pass = visibility.passes.iter().find(is_meant);
    pass.map_or_else(Window::default, |pass| Window::of(&pass.region, &camera))
}

fn drawn_free(ldi: &Layered, columns: &Clipped, camera: &Pinhole, window: &Window) -> Target {
    let mut target = Target::new(camera.width, camera.height);
    let options = FreeOptions::default();
    free(
        ldi,
        columns,
        camera,
        window,
        &options,
        &mut Free::default(),
        &mut target,
    );
    target
}

fn drawn_ordered(
    ldi: &Layered,
    columns: &Clipped,
    camera: &Pinhole,
    window: &Window,
    stamp: Stamp,
    fragments: usize,
) -> Target {
    let mut target = Target::new(camera.width, camera.height);
    let options = OrderedOptions { stamp, fragments };
    ordered(
        ldi,
        columns,
        camera,
        window,
        &options,
        &mut Ordered::default(),
        &mut target,
    );
    target
}

#[test]
fn the_central_image_stays_and_the_rest_is_added() {
    let set = set(4, 2, 128, 13, 3);
    for side in &set.sides {
        let images: Vec<&Reference> = side.iter().collect();
        for center_in_front in [false, true] {
            let options = ConstructOptions {
                center_in_front,
                ..ConstructOptions::default()
            };
            let made = construct(&images, &options).unwrap();
            let ldi = &made.ldi;
            let central = &side[6];
            let shift = ldi.camera.principal - central.camera.principal;
            let shift = [shift.x.round() as u32, shift.y.round() as u32];
            let mut pixels = 0;
            for y in 0..128 {
                for x in 0..128 {
                    let i = (y * 128 + x) as usize;
                    let s = central.seen.inverse_depth[i];
                    if s == 0.0 {
                        continue;
                    }
                    pixels += 1;
                    let samples: Vec<Sample> = ldi.pixel(x + shift[0], y + shift[1]).collect();
                    let is_it = |sample: &Sample| {
                        sample.color == central.seen.color[i]
                            && (sample.inverse_depth / s - 1.0).abs() < 1e-5
                            && sample.offset.iter().all(|o| o.abs() <= 1)
                    };
                    let at = samples.iter().position(is_it).expect("it stays");
                    if center_in_front {
                        assert_eq!(at, samples.len() - 1);
                    } else {
                        let depths = samples.iter().map(|s| s.inverse_depth);
                        assert!(depths.is_sorted());
                    }
                }
            }
            let all: usize = side
                .iter()
                .map(|r| r.seen.color.iter().filter(|c| c[3] > 0).count())
                .sum();
            assert_eq!(made.offered, all);
            assert_eq!(ldi.len() + made.merged + made.outside + made.crowded, all);
            assert!(ldi.len() > pixels && ldi.len() < all / 2);
            let table = layers(ldi);
            assert_eq!(table.total(), ldi.len());
            assert!(table.samples[0] >= pixels && table.share(1, 1) > 0.5);
            // A few pixels have something before what the centre saw of them: edges.
            assert!(
                made.before_center * 10 < ldi.len(),
                "{}",
                made.before_center
            );
        }
    }
}

/// An image of a wall across the view, at a depth.
fn wall(place: SemicircleView, size: u32, focal: f64, depth: f32, color: [u8; 4]) -> Reference {
    let view = View {
        lens: Lens::pinhole(DVec2::splat(focal), DVec2::splat(0.5 * f64::from(size))),
        width: size,
        height: size,
        camera_from_world: place.camera_from_world,
    };
    let mut seen = Target::new(size, size);
    seen.color.fill(color);
    seen.inverse_depth.fill(1.0 / depth);
    Reference {
        place,
        camera: Pinhole::new(&view).unwrap(),
        seen,
    }
}

#[test]
fn conflicts_are_resolved_by_each_papers_rule() {
    let set = set(2, 1, 8, 3, 50);
    let place = SemicircleView {
        camera_from_world: Rigid3::IDENTITY,
        ..set.sides[0][0].place.clone()
    };
    let [red, blue, green] = [[200, 0, 0, 255], [0, 0, 200, 255], [0, 200, 0, 255]];
    // The centre looks at nothing, so others decide; the third sees smaller patches, and four
    // samples fall in each pixel.
    let images = |depths: [f32; 2], colors: [[u8; 4]; 2]| {
        let mut center = wall(place.clone(), 16, 20.0, 1.0, red);
        center.seen.clear(16, 16);
        let coarse = wall(place.clone(), 16, 20.0, depths[0], colors[0]);
        let fine = wall(place.clone(), 32, 40.0, depths[1], colors[1]);
        [coarse, center, fine]
    };
    let made = |conflict, depths, colors| {
        let images = images(depths, colors);
        let images: Vec<&Reference> = images.iter().collect();
        let options = ConstructOptions {
            conflict,
            range: 0.01,
            ..ConstructOptions::default()
        };
        construct(&images, &options).unwrap().ldi
    };
    let at = |ldi: &Layered| -> Vec<[u8; 4]> { ldi.pixel(8, 8).map(|s| s.color).collect() };
    // The smaller patch wins, and all four of its image are kept.
    let ldi = made(Conflict::SmallerPatch, [2.0, 2.01], [blue, green]);
    assert_eq!(at(&ldi), [green; 4]);
    // Farther apart than the range, all are.
    let ldi = made(Conflict::SmallerPatch, [2.0, 2.1], [blue, green]);
    assert_eq!(at(&ldi), [green, green, green, green, blue]);
    // The first stays; another colour is another surface.
    let rule = Conflict::RangeThenColor { same_color: 10 };
    assert_eq!(at(&made(rule, [2.0, 2.01], [blue, blue])), [blue]);
    assert_eq!(at(&made(rule, [2.0, 2.01], [blue, green])).len(), 2);
    assert_eq!(at(&made(rule, [2.0, 2.1], [blue, blue])).len(), 2);
    // The mean of five.
    let [only] = at(&made(Conflict::Average, [2.0, 2.0], [blue, green]))[..] else {
        panic!("one sample");
    };
    assert!(
        only[2].abs_diff(40) <= 2 && only[1].abs_diff(160) <= 2,
        "{only:?}"
    );
    // And the centre's is never displaced.
    let mut images = images([2.0, 2.01], [blue, green]);
    images[1].seen.color.fill(red);
    images[1].seen.inverse_depth.fill(0.5);
    let images: Vec<&Reference> = images.iter().collect();
    let ldi = construct(&images, &ConstructOptions::default())
        .unwrap()
        .ldi;
    assert_eq!(at(&ldi), [red]);
}

/// Squared error and pixels: of all, of those covered before filling; holes before and after.
#[derive(Clone, Copy, Default)]
struct Sum {
    error: [f64; 2],
    count: [f64; 2],
    left: f64,
}

impl Sum {
    fn db(&self, k: usize) -> f64 {
        10.0 * (255.0 * 255.0 / (self.error[k] / self.count[k])).log10()
    }

    fn holes(&self) -> f64 {
        1.0 - self.count[1] / self.count[0]
    }

    fn add(&mut self, ours: &Target, covered: &Target, truth: &[u8], pixels: &[usize]) {
        for &i in pixels {
            let difference = |c: usize| f64::from(ours.color[i][c]) - f64::from(truth[4 * i + c]);
            let error = (0..3).map(|c| difference(c).powi(2)).sum::<f64>() / 3.0;
            self.error[0] += error;
            self.count[0] += 1.0;
            self.left += f64::from(u8::from(ours.color[i][3] == 0));
            if covered.color[i][3] > 0 {
                self.error[1] += error;
                self.count[1] += 1.0;
            }
        }
    }
}

#[test]
fn what_one_sees_through_doorways_is_there() {
    let size = std::env::var("LUMIGRAPH_LDI_WIDTH").ok();
    let width: u32 = size.and_then(|n| n.parse().ok()).unwrap_or(320);
    let every = std::env::var("LUMIGRAPH_LDI_EVERY").ok();
    let every: usize = every.and_then(|n| n.parse().ok()).unwrap_or(17);
    let set = set(6, 1, 256, 13, every);
    let interior = &set.house.interior;
    let mut wide = interior.clone();
    for portal in &mut wide.portals {
        portal.radius = Some(1.25 * portal.semicircle_radius(interior.up));
    }
    let size = [width, width * 4 / 5];
    let lens = Lens::pinhole(
        DVec2::splat(0.7 * f64::from(size[0])),
        0.5 * DVec2::from(size.map(f64::from)),
    );
    let mut sums = [Sum::default(); 3];
    let mut views = 0;
    let [mut table, mut total] = [[0.0; 4]; 2];
    for side in &set.sides {
        let place = &side[0].place;
        let images: Vec<&Reference> = side.iter().collect();
        let ldi = &construct(&images, &ConstructOptions::default())
            .unwrap()
            .ldi;
        let found = layers(ldi);
        for (k, (from, to)) in [(1, 1), (2, 3), (4, 255), (1, 255)].into_iter().enumerate() {
            table[k] += found.share(from, to) * found.total() as f64;
            total[k] += found.total() as f64;
        }
        for angle in [0.0_f64, 20.0, 40.0, 60.0] {
            let options = SemicircleOptions {
                views: if angle > 0.0 { 3 } else { 1 },
                span: (2.0 * angle).to_radians(),
            };
            let all = semicircles(&wide, &options);
            let is_meant = |p: &&SemicircleView| {
                let eye = p.camera_from_world.center();
                let bounds = p.from.and_then(|id| set.contents.bounds[id.0 as usize]);
                let inset = 0.3 * (DVec3::ONE - interior.up.abs());
                (p.portal, p.from) == (place.portal, place.from)
                    && (p.angle.abs().to_degrees() - angle).abs() < 1e-6
                    && bounds.is_some_and(|b| eye.clamp(b.min + inset, b.max - inset) == eye)
                    && set.contents.locate(interior, eye) == p.from
            };
            for target in all.iter().filter(is_meant) {
                let desired = View {
                    lens,
                    width: size[0],
                    height: size[1],
                    camera_from_world: target.camera_from_world,
                };
                let camera = Pinhole::new(&desired).unwrap();
                let open = window(interior, target.from, target.portal, &desired);
                let (truth, depths) = datasets::house::render(&set.house, &desired);
                let truth = truth.as_raw();
                // What is beyond the portal, and seen through it.
                let portal = interior.portal(target.portal);
                let normal = portal.normal_into(Some(target.into));
                let plane = Beyond::new(&camera, portal.polygon.center(), normal);
                let rows = (0..size[1]).flat_map(|y| open.row(y).map(move |x| (x, y)));
                let is_beyond = |(x, y): &(u32, u32)| {
                    let depth = depths[(y * size[0] + x) as usize];
                    depth > 0.0 && plane.has(camera.ray(*x, *y), 1.0 / depth)
                };
                let pixels: Vec<usize> = rows
                    .filter(is_beyond)
                    .map(|(x, y)| (y * size[0] + x) as usize)
                    .collect();
                views += 1;
                let all = Clipped::whole(ldi);
                let filled = drawn_free(ldi, &all, &camera, &open);
                let mut bare = Target::new(size[0], size[1]);
                let options = FreeOptions {
                    fill: 0,
                    ..FreeOptions::default()
                };
                free(
                    ldi,
                    &all,
                    &camera,
                    &open,
                    &options,
                    &mut Free::default(),
                    &mut bare,
                );
                let three = drawn_ordered(ldi, &all, &camera, &open, Stamp::Three, 1);
                let off = |r: &&Reference| (r.place.angle - target.angle).abs();
                let nearest = side
                    .iter()
                    .min_by(|a, b| off(a).total_cmp(&off(b)))
                    .unwrap();
                let mut one = Target::new(size[0], size[1]);
                warp(nearest, &camera, &open, Splat::Footprint, &mut one);
                sums[0].add(&filled, &bare, truth, &pixels);
                sums[1].add(&three, &three, truth, &pixels);
                sums[2].add(&one, &one, truth, &pixels);
            }
        }
    }
    let [a, b, c, all] = table.map(|n| 100.0 * n / total[0]);
    eprintln!("layers 1, 2-3, 4+: {a:.1} {b:.1} {c:.1} % of {all:.0} %");
    for (name, sum) in ["order-free", "3 x 3 in order", "nearest image"]
        .iter()
        .zip(sums)
    {
        let (whole, covered) = (sum.db(0), sum.db(1));
        let [holes, left] = [sum.holes(), sum.left / sum.count[0]].map(|share| 100.0 * share);
        eprintln!(
            "{views} views, {name}: {whole:.2} dB, covered {covered:.2} dB, holes {holes:.3} %, left {left:.3} %"
        );
    }
    let [ours, three, one] = sums;
    assert!(views >= 7);
    assert!(ours.holes() <= 0.03 && ours.holes() <= 0.2 * one.holes());
    assert_eq!(ours.left, 0.0);
    assert!(ours.db(0) >= three.db(0) + 3.0 && ours.db(0) > one.db(0));
}

/// Views of a portal from near the middle of its semicircle, some with only a half of it in the
/// picture.
fn viewers(set: &Set, side: usize, count: u64, size: [u32; 2]) -> Vec<(View, Window)> {
    let place = &set.sides[side][0].place;
    let interior = &set.house.interior;
    let portal = interior.portal(place.portal);
    let radius = portal.semicircle_radius(interior.up);
    let middle = semicircles(
        interior,
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

/// Draws an LDI in all ways; pictures must be finite.
fn draw_all(ldi: &Layered, desired: &View) {
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

fn random_ldi(counts: &[u8], size: [u32; 2], seed: u64) -> Layered {
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
    let options = FreeOptions {
        tolerance: f32::NAN,
        deviation: f32::NAN,
        grow: f32::INFINITY,
        least: -1.0,
        wide: f32::NAN,
        least_wide: 1e9,
        most: f32::NAN,
        fill: u32::MAX,
    };
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

#[test]
fn images_of_nothing_make_an_empty_ldi_and_no_images_none() {
    assert!(construct(&[], &ConstructOptions::default()).is_err());
    let set = set(2, 1, 8, 3, 50);
    let mut images: Vec<Reference> = set.sides[0].clone();
    for image in &mut images {
        image.seen.clear(8, 8);
    }
    let ldi = ldi_of(&images);
    assert!(ldi.is_empty() && layers(&ldi).total() == 0 && ldi.near == 0.0);
    draw_all(&ldi, &view(DVec3::ZERO, DVec3::Z, [20, 10]));
    // More samples than a pixel has room for: the central one stays.
    let place = &set.sides[0][0].place;
    let many: Vec<Reference> = (0..301_u16)
        .map(|i| {
            wall(
                place.clone(),
                1,
                1.0,
                1.0 + 0.1 * f32::from(i.abs_diff(150)),
                [9, (i % 256) as u8, 0, 255],
            )
        })
        .collect();
    let images: Vec<&Reference> = many.iter().collect();
    let options = ConstructOptions {
        range: 0.0,
        ..ConstructOptions::default()
    };
    let made = construct(&images, &options).unwrap();
    assert_eq!(made.ldi.count(0, 0), 151);
    assert_eq!(made.merged, 150);
    let many: Vec<Reference> = (0..301_u16)
        .map(|i| {
            wall(
                place.clone(),
                1,
                1.0,
                if i == 150 {
                    900.0
                } else {
                    1.0 + 0.1 * f32::from(i)
                },
                [9, 0, 0, 255],
            )
        })
        .collect();
    let images: Vec<&Reference> = many.iter().collect();
    let made = construct(&images, &options).unwrap();
    assert_eq!((made.ldi.count(0, 0), made.crowded), (255, 46));
    let is_center = |s: Sample| (s.inverse_depth - 1.0 / 900.0).abs() < 1e-9;
    assert!(made.ldi.pixel(0, 0).any(is_center));
}

#[test]
fn files_read_back_the_same_and_bad_ones_are_refused() {
    let set = set(2, 5, 48, 5, 9);
    let ldi = ldi_of(&set.sides[0]);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("0-1.ldi");
    write(&path, &ldi).unwrap();
    let back = read(&path).unwrap();
    assert!(back.samples() == ldi.samples() && back.counts().eq(ldi.counts()));
    assert_eq!(
        (back.portal, back.near, back.size()),
        (ldi.portal, ldi.near, ldi.size())
    );
    let camera = Pinhole::new(&view(ldi.camera.center, DVec3::ZERO, [64, 48])).unwrap();
    let open = Window::whole(64, 48);
    let [a, b] = [&ldi, &back].map(|l| drawn_free(l, &Clipped::whole(l), &camera, &open));
    assert!(a == b);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    let good = std::fs::read(&path).unwrap();
    write(&path, &back).unwrap();
    assert!(good == std::fs::read(&path).unwrap());
    let text = |content: &[u8]| parse(Path::new("a.ldi"), content).unwrap_err().to_string();
    assert_eq!(text(b""), "a.ldi: no LDI: it does not begin with LUMI-LDI");
    assert_eq!(
        text(&good[..40]),
        "a.ldi: 40 bytes, expected 128 for a header; make it again"
    );
    let changed = |at: usize, bytes: &[u8]| {
        let mut bad = good.clone();
        bad[at..at + bytes.len()].copy_from_slice(bytes);
        bad
    };
    assert_eq!(
        text(&changed(8, &[9])),
        "a.ldi: LDI version 9; expected 1: make it again with this program"
    );
    // Sizes that would need more memory than there is.
    for (at, bytes) in [
        (116, [255; 8].as_slice()),
        (120, &[255; 4]),
        (12, &[255; 4]),
        (12, &[1]),
    ] {
        assert!(
            text(&changed(at, bytes)).contains("bytes, expected"),
            "{at}"
        );
    }
    assert!(text(&good[..good.len() - 1]).contains("samples; make it again"));
    assert!(text(&changed(128 + 4, &[255; 4])).contains("row 1 begins at sample 4294967295"));
    assert!(text(&changed(72, &f64::NAN.to_le_bytes())).contains("camera"));
    assert!(text(&changed(16, &f64::NAN.to_le_bytes())).contains("camera"));
    let last = good.len() - 8;
    assert!(text(&changed(last, &(-1.0_f32).to_le_bytes())).contains("expected a positive number"));
}

proptest! {
    #[test]
    fn corrupt_files_are_no_trouble(at in 0_usize..2000, byte: u8, cut in 0_usize..2000) {
        let ldi = random_ldi(&[2; 20], [5, 4], 9);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.ldi");
        write(&path, &ldi).unwrap();
        let mut content = std::fs::read(&path).unwrap();
        let at = at % content.len();
        content[at] = byte;
        if let Ok(ldi) = parse(&path, &content) {
            draw_all(&ldi, &view(DVec3::new(0.1, 0.0, 0.2), DVec3::Z, [20, 16]));
        }
        content.truncate(cut);
        let _ = parse(&path, &content);
    }

    #[test]
    fn looks_are_close_to_what_they_are_of(x in -1.0..1.0, y in -1.0..1.0, side in -13.0..1.0) {
        let normal = DVec3::new(x, y, 0.4).normalize();
        let look = Look::new(-3.0 * normal, f64::exp2(side));
        prop_assert!(look.normal().dot(normal) > 0.995);
        prop_assert!((look.side().log2() - side).abs() < 0.13);
    }
}
