//! What one sees through doorways, against the truth.

use super::*;

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
        let made = |options| construct(&images, &options).unwrap().ldi;
        let ldi = &made(ConstructOptions::default());
        let papers = &made(of_the_papers());
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
            let all = semicircles(&wide, &set.contents, &options);
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
                let (truth, depths) = datasets::house::render(set.house, &desired);
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
                let all = Clipped::whole(papers);
                let three = drawn_ordered(papers, &all, &camera, &open, Stamp::Three, 1);
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
    assert!(ours.db(0) >= three.db(0) + 4.5 && ours.db(1) >= three.db(1) + 6.0);
    assert!(ours.db(0) > one.db(0));
}
