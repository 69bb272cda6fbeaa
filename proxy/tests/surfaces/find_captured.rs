//! Rooms found in depth maps of captures, against what is known of them.

use crate::common;
use crate::find::{bounds, find, look_at};

use glam::DVec3;
use proxy::interior::find::{Evidence, FindOptions, FoundInterior, find_interior, sights};
use proxy::interior::{Interior, compare, parse_rooms};

/// Rooms found in a capture's fused depth maps.
fn found_in(name: &str) -> Option<(FoundInterior, Vec<[DVec3; 2]>)> {
    let capture = common::capture(&common::find_capture(name)?);
    let all: Vec<_> = capture.used.iter().chain(&capture.held_out).collect();
    let frame = |i: usize| common::decode(all[i]);
    let options = proxy::depth::Options {
        voxel_size: Some(0.05),
        ..proxy::depth::Options::default()
    };
    let fusion = proxy::depth::fuse(all.len(), frame, &options).unwrap();
    let cameras: Vec<_> = all.iter().map(|(v, _)| (v.center(), v.up())).collect();
    let mut lines = Vec::new();
    for each in &all {
        let (view, map) = common::decode(each).unwrap();
        lines.extend(sights(&view, &map, 4));
    }
    let evidence = Evidence {
        mesh: &fusion.mesh,
        cameras: &cameras,
        sights: &lines,
    };
    let found = find_interior(&evidence, "model.glb", &FindOptions::default()).unwrap();
    look_at(&found, name);
    for (i, cell) in found.interior.cells.iter().enumerate() {
        eprintln!("{name}: {} {:?}", cell.name, bounds(&found, i));
    }
    for portal in &found.interior.portals {
        let width = portal.width(found.interior.up);
        eprintln!(
            "{name}: {} at {} width {width:.2}",
            portal.name,
            portal.polygon.center()
        );
    }
    Some((found, lines))
}

#[test]
fn a_capture_of_the_house_has_the_same_rooms_as_its_model() {
    let Some((found, sights)) = found_in("house-walk") else {
        return;
    };
    let Some(folder) = common::find_capture("interior-house") else {
        return;
    };
    assert!(found.interior.up.dot(DVec3::Y) > 0.999);
    assert!((found.interior.eye_height - 1.55).abs() < 0.1);
    let (model, _) = proxy::mesh::read_model(&folder.join("house.glb")).unwrap();
    let model = find(&model.mesh, &FindOptions::default()).unwrap();
    assert_eq!(found.interior.cells.len(), model.interior.cells.len());
    // 1. Cells: their sides are within 0.2 m, but where no photo saw as far.
    let mut west = f64::NEG_INFINITY;
    for i in 0..model.interior.cells.len() {
        let truth = bounds(&model, i);
        let off = |j: &usize| {
            let of = bounds(&found, *j);
            (of.max - truth.max).length() + (of.min.z - truth.min.z).abs()
        };
        let nearest = (0..found.interior.cells.len()).min_by(|a, b| off(a).total_cmp(&off(b)));
        let of = bounds(&found, nearest.unwrap());
        let (min, max) = (of.min - truth.min, of.max - truth.max);
        eprintln!("cell {i}: {min:.2} {max:.2}");
        let same = [min.z, max.x, max.z, min.y, max.y];
        assert!(same.iter().all(|d| d.abs() <= 0.2), "{truth:?} {of:?}");
        if min.x.abs() > 0.2 {
            // Nothing was seen between what was found and the true wall: no line of sight ends there.
            let is_in = |p: &DVec3| p.x < of.min.x - 0.2 && p.z > of.min.z && p.z < of.max.z;
            let beyond = sights.iter().filter(|s| is_in(&s[1])).count();
            let farthest = sights
                .iter()
                .map(|s| s[1])
                .filter(|p| p.z > of.min.z && p.z < of.max.z);
            let farthest = farthest.map(|p| p.x).fold(f64::INFINITY, f64::min);
            eprintln!(
                "cell {i}: {beyond} of {} sights end beyond, the farthest {farthest:.2}",
                sights.len()
            );
            assert_eq!(beyond, 0);
            west = west.max(of.min.x);
        }
    }
    // 2. Portals, as far as photos saw.
    let extent = |interior: &Interior, i: usize| {
        let corners = interior.portals[i].polygon.corners().iter();
        corners.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| {
            (l.min(*p), h.max(*p))
        })
    };
    let mut left: Vec<usize> = (0..found.interior.portals.len()).collect();
    for i in 0..model.interior.portals.len() {
        let (low, high) = extent(&model.interior, i);
        if high.x < west {
            eprintln!("portal {i}: never seen");
            continue;
        }
        let seen = |low: DVec3| low.with_x(low.x.max(west));
        let worst = |j: usize| {
            let (l, h) = extent(&found.interior, j);
            (seen(l) - seen(low))
                .abs()
                .max((h - high).abs())
                .max_element()
        };
        let best = left
            .iter()
            .copied()
            .min_by(|a, b| worst(*a).total_cmp(&worst(*b)));
        let best = best.unwrap();
        eprintln!("portal {i}: {:.2}", worst(best));
        assert!(
            worst(best) <= 0.2,
            "{low} {high} {:?}",
            extent(&found.interior, best)
        );
        left.retain(|j| *j != best);
    }
    assert!(left.is_empty(), "{left:?}");
}

#[test]
fn the_hall_of_an_office_is_found() {
    let Some((found, _)) = found_in("office-walk") else {
        return;
    };
    let rooms = include_bytes!("../data/office-walk-rooms.json");
    let (truth, _) = parse_rooms("rooms.json".as_ref(), rooms, "model.glb").unwrap();
    let compared = compare(&truth, &found.interior, 0.3, 1.0);
    eprint!("office-walk\n{compared}");
    assert!(found.interior.up.dot(DVec3::Y) > 0.999);
    assert!(compared.cells[0].iou > 0.9 && compared.cells[1].iou > 0.6);
    assert!(compared.extra_cells.is_empty());
    // The corridor's mouth is as wide as it; above it nothing was seen.
    let [said, mouth] = [&truth, &found.interior].map(|i| &i.portals[0]);
    let off = mouth.polygon.center() - said.polygon.center();
    assert!(off.with_y(0.0).length() < 0.2, "{off}");
    assert!((mouth.width(DVec3::Y) - said.width(DVec3::Y)).abs() < 0.1);
}
