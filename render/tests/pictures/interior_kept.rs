//! What a walk keeps between frames: images within a budget, and nothing that shows.

use crate::house;

use glam::DVec3;
use house::{small_house, view, viewpoint};
use proxy::interior::{CellId, PortalId};
use render::interior::{PortalFill, Reference, Target, Walk, WalkOptions};

#[test]
fn a_budget_lets_images_go_and_changes_no_byte() {
    let (house, contents) = small_house(5, 3);
    let one = Reference::bytes([64, 64]);
    let walk = |budget: Option<u64>| {
        let mut options = WalkOptions::default();
        options.library.size = [64, 64];
        options.library.budget = budget;
        Walk::new(&house.interior, &contents, &house.model, options)
    };
    let budgets = [None, Some(1), Some(3 * one), Some(6 * one + one / 2)];
    let mut walks = budgets.map(walk);
    let mut most_of_a_frame = 0;
    for seed in (1..30).chain(1..30) {
        let (eye, target) = viewpoint(&house.interior, seed);
        let view = view(eye, target, [64, 48]);
        let mut first = Target::default();
        for (walk, budget) in walks.iter_mut().zip(budgets) {
            let cost = walk.draw(&view, PortalFill::Warp2).unwrap();
            most_of_a_frame = most_of_a_frame.max(2 * cost.filled as u64);
            let kept = walk.library().residency();
            assert!(kept.held <= budget.unwrap_or(u64::MAX).max(most_of_a_frame * one));
            match budget {
                None => first = walk.picture().clone(),
                Some(_) => assert!(*walk.picture() == first, "{seed}, {budget:?}"),
            }
        }
    }
    let [free, none, three, six] = walks.each_ref().map(|w| w.library().residency());
    assert_eq!((free.evictions, free.held), (0, free.loads * one));
    assert!(free.loads > 10, "{}", free.loads);
    // More room, less work.
    assert!(none.loads > three.loads && three.loads > six.loads && six.loads > free.loads);
    assert!(none.evictions > three.evictions && three.evictions > six.evictions);
    let used = walks.map(|walk| walk.references_used() as u64);
    assert_eq!(used, [free.loads; 4]);
}

#[test]
fn layered_images_go_and_come_again_by_the_same_rule() {
    let (house, contents) = small_house(5, 3);
    let walk = |budget: Option<u64>| {
        let mut options = WalkOptions::default();
        options.library.size = [48, 48];
        options.library.semicircles.views = 5;
        options.library.budget = budget;
        Walk::new(&house.interior, &contents, &house.model, options)
    };
    let views: Vec<_> = (1..15)
        .map(|seed| {
            let (eye, target) = viewpoint(&house.interior, seed);
            view(eye, target, [64, 48])
        })
        .collect();
    let draw = |budget: Option<u64>| {
        let mut walk = walk(budget);
        let pictures: Vec<Target> = [&views, &views]
            .into_iter()
            .flatten()
            .map(|view| {
                walk.draw(view, PortalFill::Ldi).unwrap();
                walk.picture().clone()
            })
            .collect();
        (pictures, walk.library().residency())
    };
    let (free_pictures, free) = draw(None);
    let (none_pictures, none) = draw(Some(1));
    let (some_pictures, some) = draw(Some(free.held / 2));
    assert!(free_pictures == none_pictures && free_pictures == some_pictures);
    assert!(free.evictions == 0 && none.evictions > some.evictions && some.evictions > 0);
    assert!(none.loads > some.loads && some.loads > free.loads);
    assert!(free.held > 0 && some.peak <= free.held / 2 + none.peak);
}

#[test]
fn one_walk_draws_all_kinds_with_the_same_images() {
    let (house, contents) = small_house(3, 2);
    let new = || {
        Walk::new(
            &house.interior,
            &contents,
            &house.model,
            WalkOptions::default(),
        )
    };
    let mut shared = new();
    for fill in PortalFill::ALL {
        let mut own = new();
        shared.begin();
        for seed in 1..12 {
            let (eye, target) = viewpoint(&house.interior, seed);
            let view = view(eye, target, [64, 48]);
            shared.draw(&view, fill).unwrap();
            own.draw(&view, fill).unwrap();
            assert!(shared.picture() == own.picture(), "{} {seed}", fill.name());
        }
        assert_eq!(shared.references_used(), own.references_used());
        assert_eq!(own.references_used() > 0, fill != PortalFill::Geometry);
        if fill == PortalFill::Warp2 {
            // Those of the second nearest include the nearest.
            let used = shared.references_used() as u64;
            assert_eq!(shared.library().residency().loads, used);
        }
    }
}

/// The mean difference of two pictures over black, in codes.
fn change(a: &Target, b: &Target) -> f64 {
    let over_black = |c: &[u8; 4], k: usize| f64::from(c[k]) * f64::from(c[3]) / 255.0;
    let pixels = a.color.iter().zip(&b.color);
    let sum: f64 = pixels
        .map(|(a, b)| {
            (0..3)
                .map(|k| (over_black(a, k) - over_black(b, k)).abs())
                .sum::<f64>()
        })
        .sum();
    sum / (3 * a.color.len()) as f64
}

/// How much the picture changes from step to step of a straight way through a doorway, in small
/// steps: by geometry, which is motion alone, and as it is drawn.
fn steps(fill: PortalFill, angle: f64) -> Vec<[f64; 2]> {
    const STEPS: usize = 240;
    let (house, contents) = small_house(2, 1);
    let interior = &house.interior;
    let portal = interior.portal(PortalId(0));
    let radius = portal.semicircle_radius(interior.up);
    let into = portal.cells[1].unwrap();
    // From one side through the middle to the other.
    let normal = portal.normal_into(Some(CellId(portal.cells[0].unwrap().0)));
    let aside = normal.cross(DVec3::Y);
    let ahead = -(normal * f64::cos(angle) + aside * f64::sin(angle));
    let center = portal.polygon.center();
    let mut options = WalkOptions::default();
    // No finer than they are seen: images that are drawn smaller than they are flicker, as nothing
    // filters them.
    options.library.size = [64; 2];
    let new = || Walk::new(interior, &contents, &house.model, options);
    let (mut truth, mut walk) = (new(), new());
    let mut last: Option<[Target; 2]> = None;
    let mut found = Vec::new();
    let mut cells = Vec::new();
    for i in 0..=STEPS {
        let off = 1.3 * radius * (1.0 - 1.4 * i as f64 / STEPS as f64);
        let eye = center - off * ahead;
        let view = view(eye, eye + ahead, [80, 64]);
        truth.draw(&view, PortalFill::Geometry).unwrap();
        let cost = walk.draw(&view, fill).unwrap();
        cells.extend(cost.cell);
        let now = [truth.picture().clone(), walk.picture().clone()];
        if let Some(before) = &last {
            found.push([0, 1].map(|k| change(&before[k], &now[k])));
        }
        last = Some(now);
    }
    assert!(cells.contains(&into) && cells[0] != into, "it goes through");
    found
}

#[test]
fn nothing_pops_on_the_way_through_a_doorway() {
    for fill in [PortalFill::Texture, PortalFill::Warp1, PortalFill::Warp2] {
        for angle in [0.0, 0.35] {
            let steps = steps(fill, angle);
            let most = |k: usize| steps.iter().map(|s| s[k]).fold(0.0, f64::max);
            eprintln!(
                "{} at {angle}: a step changes {:.2} codes at most, motion alone {:.2}",
                fill.name(),
                most(1),
                most(0)
            );
            // Images move in whole pixels, so the worst of their steps is a little worse.
            assert!(most(1) < 1.6 * most(0), "{} at {angle}", fill.name());
        }
    }
}

/// From one cell into the next, by a millimetre: what other portals show, seen from the first and through the
/// doorway, stays.
#[test]
fn nothing_pops_where_one_changes_cells() {
    let (house, contents) = small_house(6, 1);
    let interior = &house.interior;
    let mut options = WalkOptions::default();
    options.library.size = [64; 2];
    let new = || Walk::new(interior, &contents, &house.model, options);
    let (mut truth, mut walk) = (new(), new());
    let mut shown = 0;
    for (id, portal) in interior.portals.iter().enumerate() {
        let [Some(a), Some(b)] = portal.cells else {
            continue;
        };
        let step = 5e-4 * portal.normal_into(Some(b));
        let center = portal.polygon.center();
        let others = interior.portals.iter().enumerate();
        let others = others.filter(|(other, portal)| {
            let of_cells = portal.cells.iter().flatten();
            *other != id && of_cells.clone().any(|cell| *cell == a || *cell == b)
        });
        for (_, other) in others {
            let target = other.polygon.center();
            let views = [center - step, center + step].map(|eye| view(eye, target, [80, 64]));
            for fill in [PortalFill::Texture, PortalFill::Warp1, PortalFill::Ldi] {
                let mut drawn = Vec::new();
                for view in &views {
                    truth.draw(view, PortalFill::Geometry).unwrap();
                    let cost = walk.draw(view, fill).unwrap();
                    drawn.push((
                        cost.cell,
                        cost.filled,
                        truth.picture().clone(),
                        walk.picture().clone(),
                    ));
                }
                if (drawn[0].0, drawn[1].0) != (Some(a), Some(b)) {
                    continue;
                }
                shown += drawn[0].1.min(drawn[1].1);
                let motion = change(&drawn[0].2, &drawn[1].2);
                let pop = change(&drawn[0].3, &drawn[1].3);
                assert!(
                    pop < motion + 0.3,
                    "portal {id} to {target}, {}: {pop:.2} codes, motion alone {motion:.2}",
                    fill.name()
                );
            }
        }
    }
    assert!(shown > 10, "{shown} portals were filled on both sides");
}
