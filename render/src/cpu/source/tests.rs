use super::*;
use crate::frame::every_lens::{self, TOLERANCE_PX};

fn tile(points: &[[f32; 4]]) -> Tile {
    let lane = |c: usize| each(|k| points[k.min(points.len() - 1)][c]);
    Tile {
        x: lane(0),
        y: lane(1),
        z: lane(2),
        s: lane(3),
        q: every_lens::PLANE.to_array().map(|v| [v as f32; LANES]),
    }
}

#[test]
fn every_lens_projects_as_the_f64_model_does() {
    let lumigraph = every_lens::lumigraph();
    let frame = every_lens::frame(&lumigraph);
    for (source_idx, view) in lumigraph.sources.iter().enumerate() {
        let source = Source::new(&frame, source_idx);
        let mut worst = 0.0_f64;
        let points = every_lens::points(&frame, source_idx);
        for chunk in points.chunks(LANES) {
            let rays: Vec<[f32; 4]> = chunk.iter().map(|(point, _)| *point).collect();
            let mut sight = Sight::nothing();
            assert!(source.see(&tile(&rays), &mut sight));
            for (k, (_, pixel)) in chunk.iter().enumerate() {
                let found = [sight.u[k], sight.v[k]];
                let error = every_lens::distance(&frame.sources[source_idx], found, *pixel);
                worst = worst.max(error);
                assert!(sight.a[k] > 0.0, "{}: {pixel:?}", view.name);
                let of_frame = &frame.sources[source_idx];
                every_lens::check_fov(of_frame, found, sight.a[k], &view.name);
            }
        }
        println!("{}: {} points, {worst:.5} px", view.name, points.len());
        assert!(worst < TOLERANCE_PX, "{}: {worst} px", view.name);

        let unseen = every_lens::unseen(&frame, source_idx);
        for chunk in unseen.chunks(LANES) {
            let mut sight = Sight::nothing();
            assert!(!source.see(&tile(chunk), &mut sight), "{}", view.name);
        }
    }
}

/// What a lens makes of points in intervals holds what f64 and f32 make of them, and little else.
#[test]
fn every_lens_stays_within_its_bounds() {
    type Bound = crate::rounding::Interval<1>;
    let lumigraph = every_lens::lumigraph();
    let frame = every_lens::frame(&lumigraph);
    for (source_idx, view) in lumigraph.sources.iter().enumerate() {
        let source = Source::new(&frame, source_idx);
        let of_bounds: Source<Bound> = Source::new(&frame, source_idx);
        let mut widest = Vec::new();
        let points = every_lens::points(&frame, source_idx);
        for chunk in points.chunks(LANES).step_by(3) {
            let rays: Vec<[f32; 4]> = chunk.iter().map(|(point, _)| *point).collect();
            let tile = tile(&rays);
            let exactly = |lane: &Lane| each(|k| Bound::of(lane[k]));
            let bounds = Tile {
                x: exactly(&tile.x),
                y: exactly(&tile.y),
                z: exactly(&tile.z),
                s: exactly(&tile.s),
                q: [0, 1, 2].map(|c| exactly(&tile.q[c])),
            };
            let (mut sight, mut bound) = (Sight::nothing(), Sight::nothing());
            assert!(source.see(&tile, &mut sight) && of_bounds.see(&bounds, &mut bound));
            for (k, (_, pixel)) in chunk.iter().enumerate() {
                for (bound, exact, found) in [
                    (bound.u[k], pixel.x, sight.u[k]),
                    (bound.v[k], pixel.y, sight.v[k]),
                ] {
                    let (lo, hi) = (bound.lo, bound.hi);
                    let values = [exact, f64::from(found)];
                    let within = values.iter().all(|v| lo <= *v && *v <= hi);
                    assert!(within, "{}: {values:?} not in {lo} to {hi}", view.name);
                    widest.push(hi - lo);
                }
                let (lo, hi) = (bound.a[k].lo, bound.a[k].hi);
                let fov = frame.fov_blend(source_idx, *pixel).max(f64::from(EDGE));
                let values = [fov, f64::from(sight.a[k])];
                let within = values.iter().all(|v| lo <= *v && *v <= hi);
                assert!(within, "{}: {values:?} not in {lo} to {hi}", view.name);
            }
        }
        widest.sort_by(f64::total_cmp);
        let (middle, most) = (widest[widest.len() / 2], widest[widest.len() * 99 / 100]);
        println!("{}: {middle:.5} px, 99 % {most:.5} px", view.name);
        assert!(middle < TOLERANCE_PX, "{}: {middle} px", view.name);
    }
}

#[test]
fn levels_of_detail_are_those_of_the_f64_model() {
    let lumigraph = every_lens::lumigraph();
    let frame = every_lens::frame(&lumigraph);
    for (source_idx, view) in lumigraph.sources.iter().enumerate() {
        let source = Source::new(&frame, source_idx);
        for chunk in every_lens::points(&frame, source_idx).chunks(LANES) {
            let rays: Vec<[f32; 4]> = chunk.iter().map(|(point, _)| *point).collect();
            let mut sight = Sight::nothing();
            assert!(source.see(&tile(&rays), &mut sight));
            for (k, [x, y, z, s]) in rays.iter().enumerate().filter(|(_, ray)| ray[2] > 0.01) {
                let point = crate::ProxyPoint {
                    ray: glam::Vec3::new(*x, *y, *z).as_dvec3(),
                    inverse_distance: f64::from(*s),
                    plane: every_lens::PLANE,
                };
                let expected = frame.level_of_detail(source_idx, &point);
                let error = (f64::from(sight.level[k]) - expected).abs();
                assert!(
                    error < 1e-3,
                    "{}: {} is not {expected}",
                    view.name,
                    sight.level[k]
                );
            }
        }
    }
}
