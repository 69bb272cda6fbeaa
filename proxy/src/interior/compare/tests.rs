use super::*;
use crate::interior::{Content, Polygon, RoomBox, parse_rooms};
use glam::DVec3;
use std::path::Path;

/// Two rooms, and a doorway in the wall between them; those that are asked for are nodes.
fn rooms(nodes: &[usize]) -> Interior {
    let text = r#"{"version": 1, "rooms": [
        {"name": "hall", "min": [0, 0, 0], "max": [4, 2.5, 3]},
        {"name": "study", "min": [4, 0, 0], "max": [8, 2.5, 3]}],
        "openings": [{"name": "door", "between": ["hall", "study"],
            "polygon": [[4, 0, 1], [4, 0, 2], [4, 2, 2], [4, 2, 1]]}]}"#;
    let read = parse_rooms(Path::new("rooms.json"), text.as_bytes(), "m.glb");
    let mut interior = read.unwrap().0;
    for i in nodes {
        let cell = &mut interior.cells[*i];
        cell.content = Content::Nodes(vec![format!("cell:{}", cell.name)]);
        cell.floor = None;
    }
    interior
}

#[test]
fn rooms_that_are_nodes_are_told_and_not_counted() {
    let said = |known: &[usize], found: &[usize]| {
        compare(&rooms(known), &rooms(found), 0.3, 1.0).to_string()
    };
    let door = "door: found; door is 0.00 m off and 0.00 m wider\n";
    let left_out = |whose: &str, names: &str| {
        format!("{whose} rooms that are not compared, as nodes have no boxes: {names}\n")
    };
    let [known, found] = ["known", "found"].map(|whose| left_out(whose, "hall, study"));
    let neither = format!("{known}{found}{door}0 of 0 rooms, 1 of 1 portals found\n");
    // What has a box may be what has none.
    assert_eq!(said(&[0, 1], &[]), neither);
    assert_eq!(said(&[], &[0, 1]), neither);
    assert_eq!(said(&[0, 1], &[0, 1]), neither);
    let study = "study: study, IoU 1.000, sides 0.00 m apart at most\n";
    let [known, found] = ["known", "found"].map(|whose| left_out(whose, "hall"));
    let one = format!("{study}{known}{found}{door}1 of 1 rooms, 1 of 1 portals found\n");
    assert_eq!(said(&[0], &[]), one);
    assert_eq!(said(&[], &[0]), one);
}

#[test]
fn a_portal_is_found_only_where_it_joins_the_same_cells() {
    let known = rooms(&[]);
    let mut found = rooms(&[]);
    let said = |found: &Interior| compare(&known, found, 0.3, 1.0).to_string();
    let place = "door is 0.00 m off and 0.00 m wider";
    // Either way round.
    found.portals[0].cells.reverse();
    assert!(said(&found).contains(&format!("door: found; {place}\n")));
    found.portals[0].cells[0] = None;
    let told = said(&found);
    let line = format!("door: not found; {place}, but joins the outside and hall\n");
    assert!(told.contains(&line), "{told}");
    assert!(told.contains("2 of 2 rooms, 0 of 1 portals found\n"));
    // One in the same place that does is it, wherever it is in the list.
    let mut right = known.portals[0].clone();
    right.name = "doorway".to_owned();
    found.portals.push(right);
    let told = said(&found);
    let line = "door: found; doorway is 0.00 m off and 0.00 m wider\ndoor: no such portal\n";
    assert!(told.contains(line), "{told}");
    // Rooms that were found as one are that one.
    let (mut one, mut parts) = (rooms(&[]), rooms(&[]));
    one.cells.truncate(1);
    one.cells[0].content = Content::Box(RoomBox {
        min: DVec3::ZERO,
        max: DVec3::new(8.0, 2.5, 3.0),
    });
    for (interior, cell) in [(&mut one, CellId(0)), (&mut parts, CellId(1))] {
        interior.portals[0].cells = [Some(cell), None];
    }
    let told = compare(&parts, &one, 0.3, 1.0).to_string();
    assert!(
        told.contains("1 of 2 rooms, 1 of 1 portals found\n"),
        "{told}"
    );
}

#[test]
fn a_room_that_shares_a_sliver_is_another() {
    let mut found = rooms(&[]);
    let beside = &mut found.cells[1];
    beside.name = "attic".to_owned();
    beside.floor = None;
    beside.content = Content::Box(RoomBox {
        min: DVec3::new(7.75, 0.0, 0.0),
        max: DVec3::new(11.75, 2.5, 3.0),
    });
    let told = compare(&rooms(&[]), &found, 0.3, 1.0).to_string();
    for line in [
        "hall: hall, IoU 1.000, sides 0.00 m apart at most\n",
        "study: not found; attic has IoU 0.0",
        "attic: no such room\n",
        "1 of 2 rooms, 0 of 1 portals found\n",
    ] {
        assert!(told.contains(line), "{told}");
    }
}

#[test]
fn rooms_of_other_storeys_are_others_whatever_order_they_are_in() {
    let storeys = |rooms: &[(&str, f64, f64)]| {
        let mut interior = self::rooms(&[]);
        interior.portals.clear();
        let cell = interior.cells.remove(0);
        interior.cells = rooms
            .iter()
            .map(|(name, low, high)| Cell {
                name: (*name).to_owned(),
                content: Content::Box(RoomBox {
                    min: DVec3::new(0.0, *low, 0.0),
                    max: DVec3::new(4.0, *high, 3.0),
                }),
                ..cell.clone()
            })
            .collect();
        interior
    };
    let [lower, upper] = [("lower", 0.0, 2.5), ("upper", 2.5, 5.0)];
    let found = storeys(&[("room 1", 2.4, 5.08)]);
    for known in [[lower, upper], [upper, lower]] {
        let told = compare(&storeys(&known), &found, 0.3, 1.0).to_string();
        let line = "upper: room 1, IoU 1.000, sides 0.10 m apart at most\n";
        assert!(told.contains(line), "{told}");
        assert!(told.contains("lower: not found\n"), "{told}");
    }
    // A hall of both storeys is the one room that was found of it.
    let hall = storeys(&[("hall", 0.0, 5.0)]);
    let told = compare(&hall, &found, 0.3, 1.0).to_string();
    assert!(told.contains("hall: room 1, IoU 1.000"), "{told}");
}

#[test]
fn a_portal_is_where_it_is_however_many_corners_its_lintel_has() {
    let mut found = rooms(&[]);
    let [low, lower, high, higher] = [
        DVec3::new(4.0, 0.0, 1.0),
        DVec3::new(4.0, 0.0, 2.0),
        DVec3::new(4.0, 2.0, 2.0),
        DVec3::new(4.0, 2.0, 1.0),
    ];
    let lintel = (0..20).map(|k| high.lerp(higher, f64::from(k) / 20.0));
    let corners = [low, lower].into_iter().chain(lintel).chain([higher]);
    found.portals[0].polygon = Polygon::new(corners.collect()).unwrap();
    let told = compare(&rooms(&[]), &found, 0.3, 1.0).to_string();
    let line = "door: found; door is 0.00 m off and 0.00 m ";
    assert!(told.contains(line), "{told}");
}

/// What is said of a room and a door in a world of which a metre has so many units; lengths are in metres.
fn said(wider: f64, meter: f64) -> String {
    let cell = ComparedCell {
        name: "hall".to_owned(),
        found: Some("room 1".to_owned()),
        iou: 0.97,
        nearest: None,
        apart: Some(0.13 * meter),
    };
    let portal = ComparedPortal {
        name: "door".to_owned(),
        nearest: Some(("doorway 2".to_owned(), 0.65 * meter, wider * meter)),
        is_found: false,
        joins: None,
    };
    let comparison = Comparison {
        cells: vec![cell],
        extra_cells: Vec::new(),
        not_compared: [Vec::new(), Vec::new()],
        portals: vec![portal],
        extra_portals: Vec::new(),
        meter,
    };
    comparison.to_string()
}

#[test]
fn a_portal_is_wider_or_narrower() {
    let narrow = "\ndoor: not found; doorway 2 is 0.65 m off and 3.20 m narrower\n";
    assert!(said(-3.2, 1.0).contains(narrow), "{}", said(-3.2, 1.0));
    assert!(said(0.1, 1.0).contains(" m off and 0.10 m wider\n"));
}

#[test]
fn lengths_are_told_in_metres_whatever_the_units() {
    let in_metres = said(0.1, 1.0);
    let hall = "hall: room 1, IoU 0.970, sides 0.13 m apart at most\n";
    assert!(in_metres.starts_with(hall), "{in_metres}");
    for meter in [0.001, 1000.0] {
        assert_eq!(said(0.1, meter), in_metres);
    }
}
