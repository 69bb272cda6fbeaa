//! What is known of views without looking at each is true of them.

use super::*;
use calibrate::{Rigid3, View};
use glam::DVec2;

/// Evenly in −1…1, by a number of a sequence and which of several.
fn spread(i: u32, of: u32) -> f64 {
    let step = 0.618_033_988_7 + 0.1 * f64::from(of).sqrt();
    2.0 * (f64::from(i + 1) * step).fract() - 1.0
}

fn vector(i: u32, of: u32) -> DVec3 {
    DVec3::new(spread(i, of), spread(i, of + 1), spread(i, of + 2))
}

/// All around a place, views of it.
fn sources(count: u32, round: u32) -> Vec<FrameSource> {
    let view = |center: DVec3| View {
        lens: Lens::pinhole(DVec2::splat(80.0), DVec2::new(50.0, 37.5)),
        width: 100,
        height: 75,
        camera_from_world: Rigid3::looking_at(center, 5.0 * DVec3::Z, DVec3::Y),
    };
    let scale = [0.01, 1.0, 3.0][round as usize % 3];
    let all = (0..count).map(|i| view(scale * vector(i, 7 * round)));
    let desired = view(DVec3::ZERO);
    all.map(|view| FrameSource::of(&view, &desired)).collect()
}

/// Whatever is known of where a ball's points lie, no view differs by less than it is said to, and none
/// that differs by so little is left out; and it is said to differ by no less for what is known.
#[test]
fn what_views_differ_by_at_least_they_do() {
    let measure = Measure {
        beta: 0.0,
        by_length: false,
    };
    let (mut sum, mut sum_unknown) = (0.0, 0.0);
    for round in 0..60 {
        let sources = sources(200, round);
        let tree = ViewTree::new(&sources, true);
        // As a wall is that is seen along: near one another in direction, not in distance.
        let towards = (DVec3::Z + 0.3 * vector(round, 1)).normalize();
        let (aside, along) = (0.02 * f64::from(1 + round % 4), 0.4 * f64::from(round % 5));
        let points: Vec<DVec3> = (0..40)
            .map(|i| {
                let there = 4.0 + along * spread(i, 3);
                there * (towards + aside * vector(i, 4)).normalize()
            })
            .collect();
        let center = 4.0 * towards;
        let most_of = |f: &dyn Fn(&DVec3) -> f64| points.iter().map(f).fold(1e-9, f64::max);
        let ball = Ball {
            center,
            radius: most_of(&|p| p.distance(center)),
            sight: f64::INFINITY,
            apart: Apart {
                aside: most_of(&|p| p.angle_between(center)) + SLACK,
                along: most_of(&|p| (p.length() - 4.0).abs()),
            },
        };
        let unknown = Ball {
            apart: Apart::UNKNOWN,
            ..ball
        };
        let differs = |i: u32| {
            let center = sources[i as usize].center;
            let angle = |p: &DVec3| (center - *p).angle_between(-*p);
            points.iter().map(angle).fold(f64::INFINITY, f64::min)
        };
        let found = |ball: &Ball, most: f64| {
            let (mut around, mut found) = (Around::default(), Vec::new());
            tree.around(ball, measure, most, &mut around);
            around.within(ball, measure, most, &mut found);
            found
        };
        for most in [0.02, 0.1, f64::INFINITY] {
            let found = found(&ball, most);
            assert!(found.is_sorted_by_key(|(least, _)| *least));
            for (least, i) in &found {
                let differs = differs(*i);
                assert!(
                    f64::from(*least) <= differs * (1.0 + 1e-6),
                    "{round}: {least}, {differs}"
                );
            }
            let is_found = |i: u32| found.iter().any(|(_, view)| *view == i);
            assert!(
                (0..200).all(|i| is_found(i) || differs(i) > most),
                "{round}"
            );
        }
        let sum_of = |ball: &Ball| -> f64 {
            let found = found(ball, f64::INFINITY);
            found.iter().map(|(least, _)| f64::from(*least)).sum()
        };
        sum += sum_of(&ball);
        sum_unknown += sum_of(&unknown);
    }
    assert!(sum > 1.05 * sum_unknown, "{sum}, {sum_unknown}");
}
