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
mod tests;
