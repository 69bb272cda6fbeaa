//! Portal culling: whatever a ray meets first is in a cell that is visible, and where it is.

use crate::common;
use crate::house;

use calibrate::Lens;
use datasets::house::House;
use glam::{DMat4, DVec2, DVec3};
use house::{random, rays, regions, room, small_house, view, viewpoint, visible_triangles};
use proptest::prelude::*;
use proxy::interior::{
    CellId, Content, Contents, Interior, Polygon, Region, Visibility, parse_rooms, visible,
};
use proxy::mesh::{Mesh, Model};
use proxy::{MeshKind, Solid};
use rayon::prelude::*;
use std::path::Path;

/// How much of a house is drawn for a view, and whether each ray's first triangle is among it.
fn check(house: &House, contents: &Contents, seed: u64) -> f64 {
    let interior = &house.interior;
    let (eye, target) = viewpoint(interior, seed);
    let view = view(eye, target, [64, 48]);
    let cell = contents.locate(interior, eye);
    assert!(cell.is_some(), "{eye}");
    let seen = visible(interior, cell, &view);
    assert_eq!(seen.cells[0].cell, cell.unwrap());
    for (i, cell) in seen.cells.iter().enumerate() {
        assert!(!cell.regions.is_empty());
        assert!(seen.cells[..i].iter().all(|other| other.cell != cell.cell));
    }
    let drawn = visible_triangles(contents, &seen);
    for ray in rays(&view) {
        let Some(hit) = house.first_hit(eye, ray) else {
            panic!("a house is closed: {eye} {ray}");
        };
        assert!(
            drawn.binary_search(&hit.triangle_idx).is_ok(),
            "seed {seed}: {eye} {ray} {hit:?}"
        );
        // It is in a cell that is seen right there.
        let is_here = seen.cells.iter().any(|cell| {
            let triangles = &contents.triangles[cell.cell.0 as usize];
            triangles.binary_search(&hit.triangle_idx).is_ok()
                && cell.regions.iter().any(|region| region.contains(ray))
        });
        assert!(is_here, "seed {seed}: {eye} {ray} {hit:?}");
    }
    drawn.len() as f64 / house.model.mesh.triangles.len() as f64
}

/// The mean share of the triangles that is drawn.
fn drawn(rooms: usize, seed: u32, views: u64) -> f64 {
    let (house, contents) = small_house(rooms, seed);
    let all = (0..views).into_par_iter();
    let drawn: Vec<f64> = all
        .map(|i| check(house, &contents, u64::from(seed) * 10_000 + i))
        .collect();
    let mean = drawn.iter().sum::<f64>() / views as f64;
    eprintln!(
        "{rooms} rooms: {:.1} % of the triangles drawn",
        100.0 * mean
    );
    mean
}

// 2000 viewpoints in all; the more rooms, the less of them one sees.

#[test]
fn in_two_rooms_whatever_is_met_first_is_drawn() {
    assert!(drawn(2, 1, 400) < 0.9);
}

#[test]
fn in_five_rooms_whatever_is_met_first_is_drawn() {
    assert!(drawn(5, 2, 500) < 0.6);
}

#[test]
fn in_nine_rooms_whatever_is_met_first_is_drawn() {
    assert!(drawn(9, 3, 550) < 0.45);
}

#[test]
fn in_nineteen_rooms_whatever_is_met_first_is_drawn() {
    assert!(drawn(19, 4, 550) < 0.3);
}

#[test]
fn in_the_captured_house_whatever_is_met_first_is_drawn() {
    let Some(folder) = common::find_capture("interior-house") else {
        return;
    };
    let (model, _) = proxy::mesh::read_model(&folder.join("house.glb")).unwrap();
    let rooms = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/interior-house-rooms.json");
    let given = proxy::interior::read_rooms(&rooms, "house.glb", 1.0).unwrap();
    let interior = given.interior;
    let (contents, _) = Contents::new(&interior, &model).unwrap();
    let solid = Solid::new(MeshKind::Mesh, model.mesh.clone());
    let missed = |seed: u64| {
        let mut r = random(seed);
        let room = room(&interior, seed as usize % 3);
        // Within the walls: their boxes are somewhat larger.
        let (low, high) = (
            room.min.max(DVec3::new(-9.2, 0.4, -3.0)),
            room.max.min(DVec3::new(9.2, 2.2, 5.3)),
        );
        let eye = low + (high - low) * DVec3::new(r(), r(), r());
        let target = eye + DVec3::new(r() - 0.5, 0.3 * (r() - 0.5), r() - 0.5);
        let view = view(eye, target, [64, 48]);
        let cell = contents.locate(&interior, eye);
        assert_eq!(cell, Some(CellId(seed as u32 % 3)));
        let drawn = visible_triangles(&contents, &visible(&interior, cell, &view));
        let hits = rays(&view)
            .into_iter()
            .filter_map(|ray| solid.first_hit(eye, ray));
        hits.filter(|hit| drawn.binary_search(&hit.triangle_idx).is_err())
            .count()
    };
    let missed: usize = (0..150_u64).into_par_iter().map(missed).sum();
    assert_eq!(missed, 0);
}

#[test]
fn in_a_turned_house_of_named_nodes_whatever_is_met_first_is_drawn() {
    let (house, boxes) = small_house(5, 2);
    let there = DMat4::from_rotation_y(30_f64.to_radians());
    let mut model = house.model.clone();
    model.mesh.transform(&there);
    let mut interior = house.interior.clone();
    for cell in &mut interior.cells {
        cell.content = Content::Nodes(vec![cell.name.clone()]);
    }
    for portal in &mut interior.portals {
        let corners = portal.polygon.corners().iter();
        let corners = corners.map(|p| there.transform_point3(*p)).collect();
        portal.polygon = Polygon::new(corners).unwrap();
    }
    let (contents, _) = Contents::new(&interior, &model).unwrap();
    let solid = Solid::new(MeshKind::Mesh, model.mesh.clone());
    let unclear = |at: DVec3| {
        let bounds = contents.bounds.iter().flatten();
        bounds.filter(|room| room.contains(at)).count() > 1
    };
    // Where bounds do not tell, and what is missed.
    let look = |seed: u64| {
        let (eye, target) = viewpoint(&house.interior, seed);
        let [at, to] = [eye, target].map(|p| there.transform_point3(p));
        let cell = contents.locate(&interior, at);
        // In a doorway either will do.
        if !seed.is_multiple_of(8) {
            let truth = boxes.locate(&house.interior, eye);
            assert_eq!(cell, truth, "seed {seed}: {eye}");
        }
        let view = view(at, to, [32, 24]);
        let drawn = visible_triangles(&contents, &visible(&interior, cell, &view));
        let hits = rays(&view)
            .into_iter()
            .filter_map(|ray| solid.first_hit(at, ray));
        let missed = hits.filter(|hit| drawn.binary_search(&hit.triangle_idx).is_err());
        (usize::from(unclear(at)), missed.count())
    };
    let seeds = (0..200_u64).into_par_iter();
    let (unclear, missed) = seeds
        .map(look)
        .reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
    assert!(unclear > 20, "{unclear}");
    assert_eq!(missed, 0);
}

#[test]
fn pictures_of_what_is_visible_are_those_of_all() {
    // The same said by drawing.
    let (house, contents) = small_house(7, 5);
    for seed in 0..12 {
        let (eye, target) = viewpoint(&house.interior, seed);
        let view = view(eye, target, [64, 48]);
        let cell = contents.locate(&house.interior, eye);
        let drawn = visible_triangles(&contents, &visible(&house.interior, cell, &view));
        let mesh = &house.model.mesh;
        let culled = Mesh {
            positions: mesh.positions.clone(),
            triangles: drawn.iter().map(|i| mesh.triangles[*i as usize]).collect(),
        };
        let culled = Solid::new(MeshKind::Mesh, culled);
        for ray in rays(&view) {
            let all = house.first_hit(eye, ray).unwrap();
            let some = culled.first_hit(eye, ray).unwrap();
            assert_eq!(drawn[some.triangle_idx as usize], all.triangle_idx);
            assert_eq!(some.along, all.along);
        }
    }
}

#[test]
fn viewers_on_a_walk_are_where_they_are_found() {
    let (house, contents) = small_house(9, 6);
    let interior = &house.interior;
    let mut crossings = 0;
    let mut r = random(7);
    let mut eye = room(interior, 0).min.midpoint(room(interior, 0).max);
    let mut cell = contents.locate(interior, eye);
    let mut heading = DVec3::X;
    for _ in 0..20_000 {
        heading = (heading + 0.4 * DVec3::new(r() - 0.5, 0.0, r() - 0.5)).normalize();
        let step = 0.15 * heading;
        // Not through walls or furniture.
        let hit = house.first_hit(eye, step).filter(|hit| hit.along < 1.2);
        if hit.is_some() {
            heading = DVec3::new(r() - 0.5, 0.0, r() - 0.5).normalize();
            continue;
        }
        eye += step;
        let found = contents.locate(interior, eye);
        if found != cell {
            // Only through an opening between the two.
            let mut ways = interior.portals_of(cell);
            assert!(
                ways.any(|(_, portal)| portal.beyond(cell) == Some(found)),
                "{eye}"
            );
            crossings += 1;
        }
        cell = found;
    }
    assert!(crossings > 20, "{crossings}");
}

/// Cells along x, 2 wide, with an opening between each and the next, and one to nowhere.
fn row(openings: &str) -> Interior {
    let text = format!(
        r#"{{"version": 1, "rooms": [
            {{"name": "a", "min": [0, 0, 0], "max": [2, 2, 2]}},
            {{"name": "b", "min": [2, 0, 0], "max": [4, 2, 2]}},
            {{"name": "c", "min": [4, 0, 0], "max": [6, 2, 2]}}],
            "openings": [{openings}]}}"#
    );
    parse_rooms(Path::new("r.json"), text.as_bytes(), "m.glb")
        .unwrap()
        .0
}

/// Across x, from z 0.5 to 1.5.
fn door(name: &str, between: &str, x: f64, [bottom, top]: [f64; 2]) -> String {
    format!(
        r#"{{"name": "{name}", "between": {between}, "polygon": [[{x}, {bottom}, 0.5],
            [{x}, {bottom}, 1.5], [{x}, {top}, 1.5], [{x}, {top}, 0.5]]}}"#
    )
}

const ALL: [f64; 2] = [0.0, 2.0];
const EYE: DVec3 = DVec3::new(1.0, 1.0, 1.0);

fn seen(interior: &Interior, eye: DVec3, direction: DVec3) -> Visibility {
    let (contents, _) = Contents::new(interior, &Model::default()).unwrap();
    let cell = contents.locate(interior, eye);
    visible(interior, cell, &view(eye, eye + direction, [64, 48]))
}

fn cells(visibility: &Visibility) -> Vec<u32> {
    visibility.cells.iter().map(|c| c.cell.0).collect()
}

#[test]
fn one_sees_through_aligned_openings_and_no_others() {
    let [ab, bc] = [r#"["a", "b"]"#, r#"["b", "c"]"#];
    let aligned = row(&[door("1", ab, 2.0, ALL), door("2", bc, 4.0, ALL)].join(","));
    assert_eq!(cells(&seen(&aligned, EYE, DVec3::X)), [0, 1, 2]);
    assert_eq!(cells(&seen(&aligned, EYE, DVec3::NEG_X)), [0]);
    // One low and one high: through both of them one sees from below only.
    let (low, high) = ([0.0, 0.9], [1.1, 2.0]);
    let staggered = row(&[door("1", ab, 2.0, low), door("2", bc, 4.0, high)].join(","));
    assert_eq!(cells(&seen(&staggered, EYE, DVec3::X)), [0, 1]);
    assert_eq!(
        cells(&seen(&staggered, EYE.with_y(0.3), DVec3::X)),
        [0, 1, 2]
    );
    // The part that is seen is the second opening as it is cut off by the first.
    let far = seen(&aligned, EYE.with_z(1.9), DVec3::new(1.0, 0.0, -0.5));
    let regions = regions(&far, 2);
    let expected = |z: f64| {
        regions
            .iter()
            .any(|r| r.contains(DVec3::new(3.0, 0.0, z - 1.9)))
    };
    // Through (2, z = 0.5) the line meets x = 4 at z = −2.3: nothing is cut off on that side; on
    // the other, z = 1.5 at x = 2 leads to 0.7.
    assert!(expected(0.6) && expected(0.69) && !expected(0.71) && !expected(0.49));
}

#[test]
fn cells_without_portals_and_portals_to_nowhere_end_there() {
    let window = door("w", r#"["a", null]"#, 0.0, [0.8, 1.8]);
    let interior = row(&[door("1", r#"["a", "b"]"#, 2.0, ALL), window].join(","));
    assert_eq!(cells(&seen(&interior, EYE, DVec3::X)), [0, 1]);
    let out = seen(&interior, EYE, DVec3::NEG_X);
    assert_eq!(cells(&out), [0]);
    assert_eq!((out.passes.len(), out.passes[0].into), (1, None));
    // In a cell without a portal one sees no other.
    assert_eq!(cells(&seen(&interior, EYE.with_x(5.0), DVec3::NEG_X)), [2]);
    // Outside, all may be seen.
    assert_eq!(
        cells(&seen(&interior, EYE.with_x(-5.0), DVec3::X)),
        [0, 1, 2]
    );
    assert_eq!(
        cells(&seen(&interior, EYE.with_x(f64::NAN), DVec3::X)),
        [0, 1, 2]
    );
    let whole = visible(&interior, Some(CellId(99)), &view(EYE, DVec3::ZERO, [8, 8]));
    assert_eq!(cells(&whole), [0, 1, 2]);
}

#[test]
fn openings_seen_edge_on_show_nothing_and_doorways_show_both_sides() {
    let interior = row(&door("1", r#"["a", "b"]"#, 2.0, ALL));
    // In the wall's plane beside the opening.
    let beside = DVec3::new(2.0, 1.0, 0.2);
    for cell in [0, 1] {
        let view = view(beside, beside + DVec3::Z, [64, 48]);
        assert_eq!(
            cells(&visible(&interior, Some(CellId(cell)), &view)),
            [cell]
        );
    }
    // In the doorway, on either side of its plane or on it, whichever cell one is thought to be
    // in, one sees both cells.
    for off in [0.0, 1e-13, -1e-13] {
        let eye = DVec3::new(2.0 + off, 1.0, 1.0);
        for (cell, other) in [(0, 1), (1, 0)] {
            for direction in [DVec3::X, DVec3::NEG_X, DVec3::Z] {
                let view = view(eye, eye + direction, [64, 48]);
                let seen = visible(&interior, Some(CellId(cell)), &view);
                assert_eq!(cells(&seen), [cell, other]);
                assert_eq!(regions(&seen, other), [Region::of(&view)]);
            }
        }
    }
}

#[test]
fn rings_of_cells_end_and_many_passes_do_not_take_for_ever() {
    // Two openings in one wall: A → B → A is no way that light takes.
    let two = [
        door("1", r#"["a", "b"]"#, 2.0, [0.0, 0.9]),
        door("2", r#"["a", "b"]"#, 2.0, [1.1, 2.0]),
    ];
    let interior = row(&two.join(","));
    let found = seen(&interior, EYE, DVec3::X);
    assert_eq!(cells(&found), [0, 1]);
    assert_eq!(found.passes.len(), 2);
    assert_eq!(regions(&found, 1).len(), 2);
    // Two cells that share many portals one behind the other: more ways than can be followed.
    let many: Vec<String> = (0..40)
        .map(|i| {
            let between = if i % 2 == 0 {
                r#"["a", "b"]"#
            } else {
                r#"["b", "a"]"#
            };
            door(&i.to_string(), between, 2.0 + 0.01 * f64::from(i), ALL)
        })
        .collect();
    let mut interior = row(&many.join(","));
    // All lead on from either cell.
    for (i, portal) in interior.portals.iter_mut().enumerate() {
        let ids = [
            Some(CellId((i % 2) as u32)),
            Some(CellId(1 - (i % 2) as u32)),
        ];
        let is_front = portal.polygon.normal().x < 0.0;
        portal.cells = if is_front { ids } else { [ids[1], ids[0]] };
    }
    let found = visible(
        &interior,
        Some(CellId(0)),
        &view(EYE, EYE + DVec3::X, [64, 48]),
    );
    assert!(cells(&found).starts_with(&[0, 1]));
}

#[test]
fn openings_need_not_be_convex() {
    // An L; what is seen through it is the L and no more.
    let l = r#"{"name": "l", "between": ["a", "b"], "polygon": [[2, 0.2, 0.2], [2, 0.2, 1.8],
        [2, 0.8, 1.8], [2, 0.8, 0.8], [2, 1.8, 0.8], [2, 1.8, 0.2]]}"#;
    let interior = row(l);
    let found = seen(&interior, EYE, DVec3::X);
    assert_eq!(cells(&found), [0, 1]);
    let contains = |y: f64, z: f64| {
        let direction = DVec3::new(2.0, y, z) - EYE;
        regions(&found, 1).iter().any(|r| r.contains(direction))
    };
    assert!(contains(0.5, 0.5) && contains(0.5, 1.7) && contains(1.55, 0.5));
    assert!(!contains(1.2, 1.2) && !contains(0.5, 0.1) && !contains(1.55, 0.9));
}

#[test]
fn the_regions_of_a_view_have_its_pixels() {
    for lens in [
        Lens::pinhole(DVec2::splat(40.0), DVec2::new(30.0, 25.0)),
        Lens::new(
            DVec2::splat(40.0),
            DVec2::new(32.0, 24.0),
            calibrate::Distortion::of_opencv(&[-0.2, 0.05, 0.01, -0.01]).unwrap(),
        ),
    ] {
        let mut view = view(EYE, DVec3::new(2.0, 1.3, 0.2), [64, 48]);
        view.lens = lens;
        let region = Region::of(&view);
        assert!(!region.is_all());
        assert!(rays(&view).iter().all(|ray| region.contains(*ray)));
        assert!(!region.contains(-view.forward()));
        assert_eq!(region.corners().len(), 4);
    }
}

proptest! {
    #[test]
    fn what_is_seen_is_the_same_wherever_the_house_stands(
        x in 0.2..1.8, y in 0.2..1.8, z in 0.2..1.8, turn in -1.5..1.5, far in 0.0..1e6,
    ) {
        let doors = [
            door("1", r#"["a", "b"]"#, 2.0, [0.0, 1.5]),
            door("2", r#"["b", "c"]"#, 4.0, [0.5, 2.0]),
        ];
        let interior = row(&doors.join(","));
        let eye = DVec3::new(x, y, z);
        let direction = DVec3::new(f64::cos(turn), 0.0, f64::sin(turn));
        let here = seen(&interior, eye, direction);
        let offset = DVec3::new(far, -far, 0.5 * far);
        let mut moved = interior.clone();
        for portal in &mut moved.portals {
            let corners = portal.polygon.corners().iter().map(|p| *p + offset).collect();
            portal.polygon = Polygon::new(corners).unwrap();
        }
        let there = eye + offset;
        let there = visible(&moved, Some(CellId(0)), &view(there, there + direction, [64, 48]));
        // Rounding may hide or show the last sliver of a cell.
        for cell in 0..3 {
            let directions = |v: &Visibility| {
                let regions = regions(v, cell);
                rays(&view(eye, eye + direction, [64, 48]))
                    .into_iter()
                    .filter(|ray| regions.iter().any(|r| r.contains(*ray)))
                    .count() as i64
            };
            prop_assert!((directions(&here) - directions(&there)).abs() <= 2);
        }
    }
}
