//! How a found interior compares with a known one.

mod floor;

use super::{Cell, CellId, Interior};
use crate::shown_name;
use floor::Shared;
use std::fmt;

/// A cell of the known interior, and the found one that is the same.
#[derive(Clone, Debug, PartialEq)]
pub struct ComparedCell {
    /// The known one's name.
    pub name: String,
    /// The found one's; each is matched once.
    pub found: Option<String>,
    /// Floor area that both have, over floor area that either has, up to rounding.
    pub iou: f64,
    /// Where none is: the one that shares most with it all the same, and floor that both have over floor that either has.
    pub nearest: Option<(String, f64)>,
    /// How far apart the same sides of their boxes are at most, in world units.
    pub apart: Option<f64>,
}

/// A portal of the known interior, and the found one where it is.
#[derive(Clone, Debug, PartialEq)]
pub struct ComparedPortal {
    /// The known one's name.
    pub name: String,
    /// The one that it is found as, or the nearest found one that none nearer has; its middle's greatest distance along
    /// an axis of the world, and by how much it is wider; in world units.
    pub nearest: Option<(String, f64, f64)>,
    /// Whether that is within the tolerance, and twice the tolerance in width, and joins the same cells.
    pub is_found: bool,
    /// What it joins, where that alone is why it is not.
    pub joins: Option<[String; 2]>,
}

/// How a found interior compares with a known one.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// By cell of the known one that has a box.
    pub cells: Vec<ComparedCell>,
    /// Found cells that are matched with none.
    pub extra_cells: Vec<String>,
    /// Cells of the known one, and of the found one, that are in neither list: without a box, as nodes of a model, or
    /// matched with none where the other interior has cells without.
    pub not_compared: [Vec<String>; 2],
    /// By portal of the known one.
    pub portals: Vec<ComparedPortal>,
    /// Found portals that are none of them.
    pub extra_portals: Vec<String>,
    /// A metre in world units: lengths are printed in metres.
    pub meter: f64,
}

/// Compares cells with boxes by the floor that they share, and portals by where their middles are and what they join: a
/// cell is the same where half of the smaller one's floor is shared, or where one has no box. Boxes share floor only where
/// they share half of the lower one's height, too: rooms of two storeys have none in common.
/// `tolerance` is in world units, of which a metre has so many; of interiors without any box there is nothing to
/// compare but portals.
pub fn compare(known: &Interior, found: &Interior, tolerance: f64, meter: f64) -> Comparison {
    let shared = Shared::new(known, found);
    let (n, m) = (known.cells.len(), found.cells.len());
    let iou = |t: usize, f: usize| shared.iou(t, f);
    // 1. Cells, those that share most first.
    let mut pairs: Vec<(usize, usize)> = (0..n).flat_map(|t| (0..m).map(move |f| (t, f))).collect();
    pairs.retain(|(t, f)| iou(*t, *f) > 0.0 && shared.is_half(*t, *f));
    pairs.sort_by(|a, b| iou(b.0, b.1).total_cmp(&iou(a.0, a.1)));
    let (mut of_known, mut is_matched) = (vec![None; n], vec![false; m]);
    for (t, f) in pairs {
        if of_known[t].is_none() && !is_matched[f] {
            of_known[t] = Some(f);
            is_matched[f] = true;
        }
    }
    let has_box = |cell: &Cell| cell.content.room().is_some();
    let [is_all_known, is_all_found] = [known, found].map(|i| i.cells.iter().all(has_box));
    let name = |f: usize| found.cells[f].name.clone();
    let name_of_known = |t: usize| known.cells[t].name.clone();
    // What is matched with none may be one of those without a box.
    let (told, untold): (Vec<usize>, Vec<usize>) =
        (0..n).partition(|t| of_known[*t].is_some() || (is_all_found && has_box(&known.cells[*t])));
    let unmatched = (0..m).filter(|f| !is_matched[*f]);
    let (extra, uncertain): (Vec<usize>, Vec<usize>) =
        unmatched.partition(|f| is_all_known && has_box(&found.cells[*f]));
    let nearest = |t: usize| {
        let sharing = (0..m).map(|f| (f, iou(t, f))).filter(|(_, iou)| *iou > 0.0);
        let (f, iou) = sharing.max_by(|a, b| a.1.total_cmp(&b.1))?;
        Some((name(f), iou))
    };
    let cells = told.into_iter().map(|t| ComparedCell {
        name: name_of_known(t),
        found: of_known[t].map(name),
        iou: of_known[t].map_or(0.0, |f| iou(t, f)),
        nearest: nearest(t).filter(|_| of_known[t].is_none()),
        apart: of_known[t].and_then(|f| apart(&known.cells[t], &found.cells[f])),
    });
    let cells = cells.collect();
    let extra_cells = extra.into_iter().map(name).collect();
    let not_compared = [
        untold.into_iter().map(name_of_known).collect(),
        uncertain.into_iter().map(name).collect(),
    ];
    // 2. Portals: which pairs are the same.
    let is_same = |t: Option<CellId>, f: Option<CellId>| match (t, f) {
        (Some(t), Some(f)) => {
            let have_boxes = has_box(known.cell(t)) && has_box(found.cell(f));
            !have_boxes || shared.is_half(t.0 as usize, f.0 as usize)
        }
        (t, f) => t.is_none() && f.is_none(),
    };
    let joins_same = |t: usize, f: usize| {
        let ([a, b], [c, d]) = (known.portals[t].cells, found.portals[f].cells);
        (is_same(a, c) && is_same(b, d)) || (is_same(a, d) && is_same(b, c))
    };
    let off = |t: usize, f: usize| {
        let [a, b] = [&known.portals[t], &found.portals[f]];
        let apart = b.polygon.center() - a.polygon.center();
        let wider = b.width(found.up) - a.width(known.up);
        (apart.abs().max_element(), wider)
    };
    let is_near = |(apart, wider): (f64, f64)| apart <= tolerance && wider.abs() <= 2.0 * tolerance;
    let is_found = |t: usize, f: usize| is_near(off(t, f)) && joins_same(t, f);
    // 3. Those first, and then the nearest.
    let (n, m) = (known.portals.len(), found.portals.len());
    let pairs = (0..n).flat_map(|t| (0..m).map(move |f| (t, f)));
    let mut pairs: Vec<(bool, f64, usize, usize)> = pairs
        .map(|(t, f)| (!is_found(t, f), off(t, f).0, t, f))
        .collect();
    pairs.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let (mut of_known, mut is_matched) = (vec![None; n], vec![false; m]);
    for (_, _, t, f) in pairs {
        if of_known[t].is_none() && !is_matched[f] {
            of_known[t] = Some(f);
            is_matched[f] = true;
        }
    }
    let side = |id: Option<CellId>| {
        id.map_or_else(
            || "the outside".to_owned(),
            |id| found.cell(id).name.clone(),
        )
    };
    let mut is_extra = vec![true; m];
    let mut portals = Vec::new();
    for t in 0..n {
        let nearest: Option<usize> = of_known[t];
        let as_found = nearest.filter(|f| is_found(t, *f));
        if let Some(f) = as_found {
            is_extra[f] = false;
        }
        let elsewhere = nearest.filter(|f| is_near(off(t, *f)) && !joins_same(t, *f));
        portals.push(ComparedPortal {
            name: known.portals[t].name.clone(),
            is_found: as_found.is_some(),
            nearest: nearest.map(|f| {
                let (apart, wider) = off(t, f);
                (found.portals[f].name.clone(), apart, wider)
            }),
            joins: elsewhere.map(|f| found.portals[f].cells.map(side)),
        });
    }
    let extra = (0..m).filter(|f| is_extra[*f]);
    Comparison {
        cells,
        extra_cells,
        not_compared,
        portals,
        extra_portals: extra.map(|f| found.portals[f].name.clone()).collect(),
        meter,
    }
}

/// How far apart the same sides of two cells' boxes are at most.
fn apart(a: &Cell, b: &Cell) -> Option<f64> {
    let (a, b) = (a.content.room()?, b.content.room()?);
    let sides = (a.min - b.min).abs().max((a.max - b.max).abs());
    Some(sides.max_element())
}

impl fmt::Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for cell in &self.cells {
            match &cell.found {
                Some(found) => {
                    let [name, found] = [&cell.name, found].map(|name| shown_name(name));
                    write!(f, "{name}: {found}, IoU {:.3}", cell.iou)?;
                }
                None => {
                    write!(f, "{}: not found", shown_name(&cell.name))?;
                    if let Some((nearest, iou)) = &cell.nearest {
                        write!(f, "; {} has IoU {iou:.3}", shown_name(nearest))?;
                    }
                }
            }
            match cell.apart {
                Some(apart) => writeln!(f, ", sides {:.2} m apart at most", apart / self.meter)?,
                None => writeln!(f)?,
            }
        }
        for name in &self.extra_cells {
            writeln!(f, "{}: no such room", shown_name(name))?;
        }
        for (whose, names) in ["known", "found"].into_iter().zip(&self.not_compared) {
            if !names.is_empty() {
                let names = shown_name(&names.join(", "));
                writeln!(
                    f,
                    "{whose} rooms that are not compared, as nodes have no boxes: {names}"
                )?;
            }
        }
        for portal in &self.portals {
            let said = if portal.is_found {
                "found"
            } else {
                "not found"
            };
            write!(f, "{}: {said}", shown_name(&portal.name))?;
            match &portal.nearest {
                Some((name, apart, wider)) => {
                    let how = if *wider < 0.0 { "narrower" } else { "wider" };
                    let name = shown_name(name);
                    let [apart, by] = [*apart, wider.abs()].map(|length| length / self.meter);
                    write!(f, "; {name} is {apart:.2} m off and {by:.2} m {how}")?;
                    match &portal.joins {
                        Some([a, b]) => {
                            let [a, b] = [a, b].map(|name| shown_name(name));
                            writeln!(f, ", but joins {a} and {b}")?;
                        }
                        None => writeln!(f)?,
                    }
                }
                None => writeln!(f)?,
            }
        }
        for name in &self.extra_portals {
            writeln!(f, "{}: no such portal", shown_name(name))?;
        }
        let (cells, portals) = (self.cells.len(), self.portals.len());
        let found = self.cells.iter().filter(|c| c.found.is_some()).count();
        let seen = self.portals.iter().filter(|p| p.is_found).count();
        writeln!(
            f,
            "{found} of {cells} rooms, {seen} of {portals} portals found"
        )
    }
}

#[cfg(test)]
mod tests {
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
}
