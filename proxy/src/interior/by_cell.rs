//! The portals of each cell.

use super::{CellId, Interior, PortalId};

/// The portals of each cell of an interior, to ask for again and again: [`Interior::portals_of`] goes through all
/// portals each time. It is of no use any more once a portal is added or joins other cells.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct PortalsByCell {
    /// By cell where its portals begin; and where the last one's end.
    begins: Vec<u32>,
    ids: Vec<PortalId>,
}

impl PortalsByCell {
    pub(super) fn new(interior: &Interior) -> Self {
        let count = interior.cells.len();
        // 1. How many each has; where they begin.
        let sides = || {
            let portals = (0..).map(PortalId).zip(&interior.portals);
            portals.flat_map(move |(id, portal)| {
                let [front, back] = portal.cells;
                let both = [front, back.filter(|_| back != front)];
                let cells = both.into_iter().flatten().map(|cell| cell.0 as usize);
                let cells = cells.filter(move |cell| *cell < count);
                cells.map(move |cell| (cell, id))
            })
        };
        let mut begins = vec![0; count + 1];
        for (cell, _) in sides() {
            begins[cell + 1] += 1;
        }
        let mut total = 0;
        for begin in &mut begins {
            total += *begin;
            *begin = total;
        }
        // 2. Which.
        let mut next = begins.clone();
        let mut ids = vec![PortalId(0); total as usize];
        for (cell, id) in sides() {
            ids[next[cell] as usize] = id;
            next[cell] += 1;
        }
        Self { begins, ids }
    }

    /// Those of a cell, in order; none of one that is not there.
    pub(super) fn of(&self, cell: CellId) -> &[PortalId] {
        match self.begins.get(cell.0 as usize..) {
            Some(&[begin, end, ..]) => &self.ids[begin as usize..end as usize],
            _ => &[],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::interior::parse_rooms;
    use std::path::Path;

    /// A row of cells, with an opening between each and the next, and one to nowhere in the last.
    fn row(count: usize) -> Interior {
        let rooms = (0..count).map(|i| {
            let [from, to] = [i, i + 1].map(|i| 2 * i);
            format!(r#"{{"name": "{i}", "min": [{from}, 0, 0], "max": [{to}, 2, 2]}}"#)
        });
        let openings = (1..=count).map(|i| {
            let between = match i < count {
                true => format!(r#""{}", "{i}""#, i - 1),
                false => format!(r#""{}", null"#, i - 1),
            };
            let x = 2 * i;
            format!(
                r#"{{"name": "to {i}", "between": [{between}],
                    "polygon": [[{x}, 0, 0.5], [{x}, 0, 1.5], [{x}, 1.8, 1.5], [{x}, 1.8, 0.5]]}}"#
            )
        });
        let [rooms, openings] = [
            rooms.collect::<Vec<_>>().join(","),
            openings.collect::<Vec<_>>().join(","),
        ];
        let text = format!(r#"{{"version": 1, "rooms": [{rooms}], "openings": [{openings}]}}"#);
        let read = parse_rooms(Path::new("rooms.json"), text.as_bytes(), "m.glb");
        read.unwrap().0
    }

    #[test]
    fn cells_have_the_portals_that_join_them_in_order_and_no_others_are_gone_through() {
        let mut interior = row(60);
        // In another order than the cells', and two of one cell on both sides.
        interior.portals.reverse();
        interior.portals[7].cells = [Some(CellId(3)); 2];
        let by_cell = PortalsByCell::new(&interior);
        for cell in (0..60).map(CellId) {
            let found = interior.portals_of(Some(cell)).map(|(id, _)| id);
            assert_eq!(by_cell.of(cell), found.collect::<Vec<_>>(), "{cell:?}");
        }
        // All cells together go through each side of a portal once.
        let sides = interior.portals.iter().flat_map(|portal| portal.cells);
        assert_eq!(by_cell.ids.len(), sides.flatten().count() - 1);
        assert!(by_cell.of(CellId(60)).is_empty() && by_cell.of(CellId(u32::MAX)).is_empty());
        interior.cells.clear();
        assert!(PortalsByCell::new(&interior).of(CellId(0)).is_empty());
    }
}
