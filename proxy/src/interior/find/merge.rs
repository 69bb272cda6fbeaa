//! Regions that are no rooms of their own: those with hardly a wall between them, and small ones.

use super::FindOptions;
use super::columns::Columns;
use super::openings::{Opening, meet, open_pairs, openings};
use super::regions::{Grown, Labels, grown, renumber};
use super::thick::drop_hollows;
use std::collections::BTreeMap;

/// Rooms up to the middle of their walls, and the openings between them, out of regions: no two with
/// hardly a wall between them are left, and none that is too small.
///
/// Growing takes time with the floor, so all that one pass finds is done before the next. It comes to
/// what one at a time would: of two that became one, what parts and what touches a third is added up.
/// Only walls beside several small ones move at once.
pub(super) fn rooms(
    columns: &Columns,
    labels: Labels,
    options: &FindOptions,
) -> (Grown, Vec<Opening>) {
    // Of a capture, what nobody saw is of the rooms around it, and so depends on which are one.
    let at_once = match columns.seen {
        Some(_) => 1,
        None => usize::MAX,
    };
    rooms_by(columns, labels, options, at_once)
}

/// The same with no more than so many done in a pass.
fn rooms_by(
    columns: &Columns,
    mut labels: Labels,
    options: &FindOptions,
    at_once: usize,
) -> (Grown, Vec<Opening>) {
    loop {
        let grown = grown(columns, &labels);
        let sides = openings(columns, &grown);
        let pairs = open_pairs(columns, &sides, at_once);
        if !pairs.is_empty() {
            join(&mut labels, &pairs);
        } else if !drop_small(columns, &mut labels, &grown, options, at_once)
            && !drop_hollows(columns, &mut labels, &grown)
        {
            let openings = sides.into_iter().flat_map(|side| side.openings);
            let mut openings: Vec<Opening> = openings.collect();
            meet(columns, &mut openings);
            return (grown, openings);
        }
    }
}

/// Makes regions one, the second of each pair by the name of the first, which is less.
fn join(found: &mut Labels, pairs: &[(u32, u32)]) {
    let mut names: Vec<u32> = (0..=found.count).collect();
    for (a, b) in pairs {
        names[*b as usize] = *a;
    }
    rename(found, names);
}

/// Gives each region the name of the one that its name leads to. Names lead to lesser ones; 0 is none.
fn rename(found: &mut Labels, mut names: Vec<u32>) {
    for label in 0..names.len() {
        // Lesser ones have their last names already.
        names[label] = names[names[label] as usize];
    }
    for label in &mut found.labels {
        *label = names[*label as usize];
    }
    renumber(found);
}

/// Joins regions that are too small for rooms to the one they touch most, or drops them, one after
/// the other and no more than so many; whether there was one.
fn drop_small(
    columns: &Columns,
    found: &mut Labels,
    grown: &Grown,
    options: &FindOptions,
    at_once: usize,
) -> bool {
    // 1. How large each is, in squares; and of how many sides it shares with which others.
    let count = found.count as usize + 1;
    let mut sizes = vec![0_usize; count];
    for label in &grown.labels {
        sizes[*label as usize] += 1;
    }
    let mut touched: Vec<BTreeMap<u32, usize>> = vec![BTreeMap::new(); count];
    for i in (0..columns.count()).filter(|i| found.labels[*i] != 0) {
        for j in columns.beside(i) {
            let (own, other) = (found.labels[i], found.labels[j]);
            if other != 0 && other != own {
                *touched[own as usize].entry(other).or_default() += 1;
            }
        }
    }
    // 2. The first that is small, as long as there is one. A name is that of the first of those joined.
    let square = columns.step_m * columns.step_m;
    let mut names: Vec<u32> = (0..=found.count).collect();
    let mut dropped = 0;
    while dropped < at_once {
        let is_small = |label: &u32| {
            let i = *label as usize;
            names[i] == *label && (sizes[i] as f64) * square < options.min_area
        };
        let Some(small) = (1..=found.count).find(is_small) else {
            break;
        };
        dropped += 1;
        let of = &touched[small as usize];
        let into = of.iter().max_by_key(|(label, n)| (**n, u32::MAX - **label));
        let Some(into) = into.map(|(label, _)| *label) else {
            names[small as usize] = 0;
            continue;
        };
        let (kept, gone) = (small.min(into), small.max(into));
        names[gone as usize] = kept;
        sizes[kept as usize] += sizes[gone as usize];
        for (other, n) in std::mem::take(&mut touched[gone as usize]) {
            touched[other as usize].remove(&gone);
            if other != kept {
                *touched[kept as usize].entry(other).or_default() += n;
                *touched[other as usize].entry(kept).or_default() += n;
            }
        }
    }
    if dropped > 0 {
        rename(found, names);
    }
    dropped > 0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Mesh;
    use crate::interior::find::{Evidence, level, regions};
    use glam::DVec3;

    /// A block from one corner to the other.
    fn block(mesh: &mut Mesh, min: [f64; 3], max: [f64; 3]) {
        let first = mesh.positions.len() as u32;
        let corner = |i: usize| {
            let at = |k: usize| if i >> k & 1 == 1 { max[k] } else { min[k] };
            DVec3::new(at(0), at(1), at(2))
        };
        mesh.positions.extend((0..8).map(corner));
        for [a, b, c, d] in [
            [0, 1, 3, 2],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 3, 7, 6],
            [0, 2, 6, 4],
            [1, 3, 7, 5],
        ] {
            let triangles = [[a, b, c], [a, c, d]];
            mesh.triangles
                .extend(triangles.map(|t| t.map(|i| first + i)));
        }
    }

    /// A hall below two beams, with three closets in it and three niches behind narrow openings.
    fn hall() -> Mesh {
        let mut mesh = Mesh::default();
        for (min, max) in [
            ([0.0, 0.0, 0.0], [16.0, 0.0, 8.0]),
            ([0.0, 2.5, 0.0], [16.0, 2.5, 8.0]),
            ([0.0, 0.0, -0.1], [16.0, 2.5, 0.0]),
            ([0.0, 0.0, 8.0], [16.0, 2.5, 8.1]),
            ([-0.1, 0.0, 0.0], [0.0, 2.5, 8.0]),
            ([16.0, 0.0, 0.0], [16.1, 2.5, 8.0]),
            ([5.0, 2.2, 0.0], [5.1, 2.5, 8.0]),
            ([10.0, 2.2, 0.0], [10.1, 2.5, 8.0]),
        ] {
            block(&mut mesh, min, max);
        }
        for x in [2.0, 7.0, 12.0] {
            for (z, stub) in [(2.0, 0.6), (5.0, 0.3)] {
                let mut wall = |[x0, z0]: [f64; 2], [x1, z1]: [f64; 2]| {
                    let (min, max) = ([x + x0, 0.0, z + z0], [x + x1, 2.5, z + z1]);
                    block(&mut mesh, min, max);
                };
                wall([0.0, 0.0], [0.1, 1.3]);
                wall([1.1, 0.0], [1.2, 1.3]);
                wall([0.0, 1.2], [1.2, 1.3]);
                wall([0.0, 0.0], [stub, 0.1]);
                wall([1.2 - stub, 0.0], [1.2, 0.1]);
            }
        }
        mesh
    }

    #[test]
    fn all_of_a_pass_at_once_comes_to_what_one_at_a_time_does() {
        let mesh = hall();
        let evidence = Evidence {
            mesh: &mesh,
            cameras: &[],
            sights: &[],
        };
        let options = FindOptions::default();
        let level = level::estimate(&evidence, &options).unwrap().level;
        let columns = Columns::new(&evidence, &level, &options).unwrap();
        let labels = || regions::regions(&columns, &options);
        let all = labels().count;
        assert!(all >= 6, "{all}");
        let [fast, slow] = [usize::MAX, 1].map(|n| rooms_by(&columns, labels(), &options, n));
        assert_eq!(fast.0.count, 1);
        assert!(fast.0.labels == slow.0.labels && fast.1 == slow.1);
        // It takes two passes: the beams' three parts, and then all that is small.
        let mut labels = labels();
        let sides = openings(&columns, &grown(&columns, &labels));
        let pairs = open_pairs(&columns, &sides, usize::MAX);
        assert_eq!(pairs.len(), 2);
        join(&mut labels, &pairs);
        assert_eq!(labels.count, all - 2);
        let grown = grown(&columns, &labels);
        let is_any = drop_small(&columns, &mut labels, &grown, &options, usize::MAX);
        assert_eq!((is_any, labels.count), (true, 1));
    }

    #[test]
    fn names_lead_to_the_last() {
        let mut found = Labels {
            labels: vec![0, 3, 1, 2, 4, 5],
            count: 5,
        };
        // 4 is dropped, and 5 is of 3, which is of 1.
        rename(&mut found, vec![0, 1, 2, 1, 0, 3]);
        assert_eq!(found.labels, [0, 1, 1, 2, 0, 1]);
        assert_eq!(found.count, 2);
    }
}
