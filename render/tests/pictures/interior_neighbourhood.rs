//! LDIs of the views nearest to the viewer: what they show, that nothing pops between them, and that no
//! picture tells when they were made.

use crate::house;

use calibrate::View;
use house::{small_house, view, viewpoint};
use proxy::interior::{CellId, Contents, Interior, PortalId};
use proxy::mesh::Model;
use render::interior::{Pinhole, PortalFill, Target, Walk, WalkError, WalkOptions};
use std::thread::{scope, sleep};
use std::time::Duration;

/// Beside the default: LDIs of so many views, which are of so many pixels.
fn options(views: Option<usize>, size: u32) -> WalkOptions {
    let mut options = WalkOptions::default();
    options.library.size = [size; 2];
    options.library.ldi_views = views;
    options
}

/// A portal's side, before which one walks on a semicircle.
struct Side {
    portal: PortalId,
    from: CellId,
}

impl Side {
    /// Those of a house before which there is room, to 60° to each side.
    fn all(interior: &Interior, contents: &Contents, radii: f64) -> Vec<Self> {
        let ids = (0..interior.portals.len() as u32).map(PortalId);
        let sides = ids.flat_map(|portal| {
            let [a, b] = interior.portal(portal).cells;
            let side =
                |from, into: Option<CellId>| into.and(from).map(|from| Side { portal, from });
            [side(a, b), side(b, a)].into_iter().flatten()
        });
        let has_room = |side: &Side| {
            let mut angles = [-1.05, -0.5, 0.0, 0.5, 1.05].into_iter();
            angles.all(|angle| {
                let eye = side
                    .view((interior, contents), angle, radii, [8, 8])
                    .center();
                contents.locate(interior, eye) == Some(side.from)
            })
        };
        sides.filter(has_room).collect()
    }

    /// From an angle before the portal, looking at it.
    fn view(
        &self,
        (interior, contents): (&Interior, &Contents),
        angle: f64,
        radii: f64,
        size: [u32; 2],
    ) -> View {
        let portal = interior.portal(self.portal);
        let center = portal.polygon.center();
        let ahead = portal.normal_into(Some(self.from));
        let right = interior.up.cross(ahead).normalize();
        let off = angle.cos() * ahead + angle.sin() * right;
        let up = interior.up;
        let floor = contents.floor_height(interior, Some(self.from), portal);
        let height = floor + interior.eye_height;
        let middle = center + up * (height - center.dot(up));
        let eye = middle + radii * portal.semicircle_radius(up) * off;
        view(eye, center, size)
    }
}

/// The mean difference of two pictures over black, in codes.
fn change(a: &Target, b: &Target) -> f64 {
    let over_black = |c: &[u8; 4], k: usize| f64::from(c[k]) * f64::from(c[3]) / 255.0;
    let difference = |(a, b): (&[u8; 4], &[u8; 4])| {
        (0..3)
            .map(|k| (over_black(a, k) - over_black(b, k)).abs())
            .sum()
    };
    let sum: f64 = a
        .color
        .iter()
        .zip(&b.color)
        .map(|p| -> f64 { difference(p) })
        .sum();
    sum / (3 * a.color.len()) as f64
}

/// Squared error, pixels, holes and samples in what is seen through a portal.
#[derive(Clone, Copy, Default)]
struct Sum {
    error: f64,
    pixels: f64,
    holes: f64,
    samples: f64,
    views: f64,
}

impl Sum {
    fn db(&self) -> f64 {
        10.0 * (255.0 * 255.0 * self.pixels / self.error).log10()
    }

    fn add(&mut self, ours: &Target, truth: &[u8], pixels: &[usize], samples: usize) {
        self.samples += samples as f64;
        self.views += 1.0;
        for &i in pixels {
            let difference = |c: usize| f64::from(ours.color[i][c]) - f64::from(truth[4 * i + c]);
            self.error += (0..3).map(|c| difference(c).powi(2)).sum::<f64>() / 3.0;
            self.pixels += 1.0;
            self.holes += f64::from(u8::from(ours.color[i][3] == 0));
        }
    }

    fn and(self, other: Self) -> Self {
        Self {
            error: self.error + other.error,
            pixels: self.pixels + other.pixels,
            holes: self.holes + other.holes,
            samples: self.samples + other.samples,
            views: self.views + other.views,
        }
    }
}

/// Pixels that see what is beyond the portal through its opening, by the true depths.
fn beyond(interior: &Interior, side: &Side, view: &View, depths: &[f64]) -> Vec<usize> {
    let polygon = &interior.portal(side.portal).polygon;
    let camera = Pinhole::new(view).unwrap();
    let eye = view.center();
    let world = view.camera_from_world.inverse();
    let is_in = |i: &usize| {
        let (x, y) = (*i as u32 % view.width, *i as u32 / view.width);
        let ray = world.rotation * camera.ray(x, y);
        let along = -polygon.height(eye) / polygon.normal().dot(ray);
        along > 0.0 && depths[*i] > along && polygon.covers(eye + along * ray, 0.0)
    };
    (0..depths.len()).filter(is_in).collect()
}

#[test]
fn ldis_of_the_nearest_views_show_no_less_than_those_of_all() {
    let number = |name: &str| std::env::var(name).ok().and_then(|n| n.parse::<u32>().ok());
    let width = number("LUMIGRAPH_LDI_WIDTH").unwrap_or(200);
    let every = number("LUMIGRAPH_LDI_EVERY").unwrap_or(8) as usize;
    let radii = [1.05, 1.25, 2.0, 3.0];
    let radii = match number("LUMIGRAPH_LDI_WIDTH") {
        Some(_) => &radii[..],
        None => &radii[1..2],
    };
    let (house, contents) = small_house(6, 1);
    let interior = &house.interior;
    const VIEWS: [Option<usize>; 4] = [None, Some(3), Some(5), Some(7)];
    // At places, and in the middle between two.
    const ANGLES: [f64; 7] = [0.0, 10.0, 15.0, 30.0, 40.0, 45.0, 60.0];
    let walk = |views| Walk::new(interior, &contents, &house.model, options(views, 256));
    let mut walks = VIEWS.map(walk);
    let sides = Side::all(interior, &contents, 1.25);
    for radii in radii {
        let mut sums = [[Sum::default(); ANGLES.len()]; VIEWS.len()];
        for side in sides.iter().step_by(every) {
            let signed = ANGLES.iter().enumerate();
            for (k, angle) in signed.flat_map(|(k, angle)| [(k, *angle), (k, -angle)]) {
                let size = [width, width * 4 / 5];
                let view = side.view((interior, &contents), angle.to_radians(), *radii, size);
                if contents.locate(interior, view.center()) != Some(side.from) {
                    continue;
                }
                let (truth, depths) = datasets::house::render(house, &view);
                let pixels = beyond(interior, side, &view, &depths);
                for (walk, sums) in walks.iter_mut().zip(&mut sums) {
                    let cost = walk.draw(&view, PortalFill::Ldi).unwrap();
                    sums[k].add(walk.picture(), truth.as_raw(), &pixels, cost.samples);
                }
            }
        }
        let all = sums.map(|sums| sums.into_iter().reduce(Sum::and).unwrap());
        let views = all[0].views;
        eprintln!("at {radii} radii, {views} views, dB by angle {ANGLES:?}");
        for (views, (sums, all)) in VIEWS.iter().zip(sums.iter().zip(&all)) {
            let by_angle: Vec<String> = sums.iter().map(|sum| format!("{:.2}", sum.db())).collect();
            eprintln!(
                "of {views:?}: {:.2} dB, holes {:.4} %, {:.0} samples drawn; {}; {:.0?}",
                all.db(),
                100.0 * all.holes / all.pixels,
                all.samples / all.views,
                by_angle.join(" "),
                sums.map(|sum| sum.samples / sum.views)
            );
        }
        let [one, three, ..] = &all;
        assert!(views >= 14.0 || *radii > 1.25);
        assert!(three.db() >= one.db() - 0.1 && three.holes <= one.holes + 1e-3 * one.pixels);
    }
}

#[test]
fn nothing_pops_between_neighbourhoods() {
    const SIZE: [u32; 2] = [120, 96];
    let (house, contents) = small_house(6, 1);
    let interior = &house.interior;
    let walk = |views| Walk::new(interior, &contents, &house.model, options(views, 96));
    let (mut one, mut near) = (walk(None), walk(Some(3)));
    let sides = Side::all(interior, &contents, 1.25);
    let side = &sides[0];
    // Where geometry is mixed in, too.
    for radii in [1.25, 0.85] {
        let draw = |walk: &mut Walk<'_>, angle: f64| {
            let view = side.view((interior, &contents), angle, radii, SIZE);
            let cost = walk.draw(&view, PortalFill::Ldi).unwrap();
            assert!(cost.filled > 0);
            walk.picture().clone()
        };
        // 1. On a way past the portal no step is larger than out of one LDI, but for what 3 views show
        // otherwise than 13.
        let steps = |walk: &mut Walk<'_>| {
            let pictures = (-120..=120).map(|i| draw(walk, f64::from(i) * 0.25_f64.to_radians()));
            let pictures: Vec<Target> = pictures.collect();
            let changes = pictures.windows(2).map(|pair| change(&pair[0], &pair[1]));
            changes.fold(0.0, f64::max)
        };
        let [most_of_one, most] = [steps(&mut one), steps(&mut near)];
        eprintln!(
            "{radii} radii: a step changes {most:.3} codes at most, of one LDI {most_of_one:.3}"
        );
        assert!(most < 1.15 * most_of_one);
        // 2. Where a second LDI comes in, is half, and is alone, all of the change is motion: of what is
        // left no value changes by more than its rounding.
        for degrees in [7.0_f64, 10.0, 13.0, 27.0, 30.0] {
            let mut all = Vec::new();
            for step in [1e-2, 1e-4, 1e-6, 1e-8] {
                let angles = [-0.5, 0.5].map(|share| degrees.to_radians() + share * step);
                let [a, b] = angles.map(|angle| draw(&mut near, angle));
                let values = a.color.as_flattened().iter().zip(b.color.as_flattened());
                let most = values.map(|(a, b)| a.abs_diff(*b)).max();
                all.push((change(&a, &b), most.unwrap()));
            }
            eprintln!("{degrees}°, steps of 1e-2 to 1e-8: {all:.5?}");
            assert!(all[3].0 < 0.1 && all[3].1 <= 1, "{degrees}: {all:?}");
        }
    }
}

/// Views of a house, in some order, with the portals that they show filled.
fn views(interior: &Interior) -> Vec<View> {
    let seeds = (1..14).filter(|seed| seed % 8 != 0);
    let view = |seed| {
        let (eye, target) = viewpoint(interior, seed);
        view(eye, target, [64, 48])
    };
    seeds.map(view).collect()
}

#[test]
fn pictures_do_not_tell_the_thread_the_budget_or_what_was_drawn_before() {
    let (house, contents) = small_house(5, 3);
    let interior = &house.interior;
    let views = views(interior);
    let options = |budget: Option<u64>| {
        let mut options = options(Some(3), 48);
        options.library.budget = budget;
        options
    };
    let alone = || Walk::new(interior, &contents, &house.model, options(None));
    let draw = |walk: &mut Walk<'_>, view: &View| {
        walk.draw(view, PortalFill::Ldi).unwrap();
        walk.picture().clone()
    };
    // 1. Each frame alone.
    let pictures: Vec<Target> = views.iter().map(|view| draw(&mut alone(), view)).collect();
    // 2. One after the other, and back, with little memory and much, without a thread and with.
    let mut free = alone();
    let there: Vec<Target> = views.iter().map(|view| draw(&mut free, view)).collect();
    assert!(there == pictures);
    let held = free.library().residency().held;
    for budget in [None, Some(1), Some(held / 3)] {
        scope(|scope| {
            let mut walk = Walk::new(interior, &contents, &house.model, options(budget));
            walk.make_ahead(scope).unwrap();
            for (i, view) in views.iter().enumerate().rev() {
                assert!(draw(&mut walk, view) == pictures[i], "{i} {budget:?}");
                // Whatever is ready by now.
                sleep(Duration::from_millis(5 * (i as u64 % 3)));
                assert!(draw(&mut walk, view) == pictures[i], "{i} {budget:?}");
            }
            let kept = walk.library().residency();
            assert!(kept.evictions > 0 || budget.is_none());
        });
    }
    // 3. On one thread.
    let pool = rayon_pool(1);
    let again: Vec<Target> = pool.install(|| {
        let mut walk = alone();
        views.iter().map(|view| draw(&mut walk, view)).collect()
    });
    assert!(again == pictures);
}

fn rayon_pool(threads: usize) -> rayon::ThreadPool {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
    pool.build().unwrap()
}

#[test]
fn what_is_ahead_is_there_when_one_comes() {
    let (house, contents) = small_house(6, 1);
    let interior = &house.interior;
    let sides = Side::all(interior, &contents, 1.25);
    let walked = |budget: Option<u64>| {
        scope(|scope| {
            let mut options = options(Some(3), 64);
            options.library.budget = budget;
            let mut walk = Walk::new(interior, &contents, &house.model, options);
            walk.make_ahead(scope).unwrap();
            let (mut made, mut ahead) = (0, 0);
            for i in -10..=10 {
                let view = sides[0].view((interior, &contents), 0.1 * f64::from(i), 1.25, [32, 24]);
                // Until nothing comes any more.
                let mut quiet = 0;
                while quiet < 20 {
                    let cost = walk.draw(&view, PortalFill::Ldi).unwrap();
                    made += cost.ldis_made;
                    ahead += cost.ldis_ahead;
                    quiet = if cost.ldis_ahead > 0 { 0 } else { quiet + 1 };
                    sleep(Duration::from_millis(3));
                }
                if i == -10 {
                    // Nobody could know.
                    assert!(made > 0);
                    made = 0;
                }
            }
            let kept = walk.library().residency();
            eprintln!("budget {budget:?}: {ahead} LDIs ahead, frames made {made}; {kept:?}");
            (made, ahead, kept)
        })
    };
    let (made, ahead, free) = walked(None);
    assert!(made <= 1 && ahead >= 6, "{made} {ahead}");
    // With less memory there is less ahead, but what is there is within it.
    let budget = free.peak * 2 / 3;
    let (.., some) = walked(Some(budget));
    assert!(some.peak <= budget && some.evictions > 0, "{some:?}");
}

#[test]
fn a_walk_ends_with_what_is_being_made_ahead() {
    let (house, contents) = small_house(3, 2);
    let interior = &house.interior;
    let views = views(interior);
    for _ in 0..3 {
        scope(|scope| {
            let new = || Walk::new(interior, &contents, &house.model, options(Some(3), 256));
            let mut walk = new();
            walk.make_ahead(scope).unwrap();
            for view in &views {
                walk.draw(view, PortalFill::Ldi).unwrap();
            }
            // The scope ends when its threads do.
        });
    }
}

#[test]
fn any_number_of_views_and_sides_without_views_are_answered() {
    let (house, contents) = small_house(3, 2);
    let interior = &house.interior;
    let all = views(interior);
    let drawn = |views: usize, of: usize, span: f64| {
        let mut options = options(Some(views), 32);
        options.library.semicircles.views = of;
        options.library.semicircles.span = span;
        let mut walk = Walk::new(interior, &contents, &house.model, options);
        let draw = |view: &View| {
            walk.draw(view, PortalFill::Ldi).unwrap();
            walk.picture().clone()
        };
        all.iter().map(draw).collect::<Vec<_>>()
    };
    let span = 2.0;
    assert!(drawn(0, 5, span) == drawn(1, 5, span));
    assert!(drawn(5, 5, span) == drawn(usize::MAX, 5, span));
    // All of one place are one.
    drawn(3, 1, span);
    drawn(3, 5, 0.0);
    drawn(3, 5, f64::NAN);
    // No portals, no places.
    let mut closed = interior.clone();
    closed.portals.clear();
    let (contents, _) = Contents::new(&closed, &Model::default()).unwrap();
    let model = Model::default();
    scope(|scope| {
        let mut walk = Walk::new(&closed, &contents, &model, options(Some(3), 32));
        walk.make_ahead(scope).unwrap();
        for view in &all {
            let cost = walk.draw(view, PortalFill::Ldi).unwrap();
            assert_eq!((cost.filled, cost.ldis_made, cost.ldis_ahead), (0, 0, 0));
        }
    });
    let error = WalkError::Ahead("no memory".to_owned()).to_string();
    let expected = "a layered depth image could not be made ahead: no memory";
    assert_eq!(error, expected);
}
