//! Rooms found in models and captures, against what is known of them.

mod common;
mod house;

use glam::{DMat4, DQuat, DVec2, DVec3};
use house::small_house;
use proxy::Mesh;
use proxy::interior::find::{Evidence, FindError, FindOptions, FoundInterior, find_interior};
use proxy::interior::{CellId, Content, Interior, RoomBox};

fn find(mesh: &Mesh, options: &FindOptions) -> Result<FoundInterior, FindError> {
    let evidence = Evidence {
        mesh,
        cameras: &[],
        sights: &[],
    };
    find_interior(&evidence, "model.glb", options)
}

/// How a found interior compares with the truth.
#[derive(Debug)]
struct Score {
    /// Of each true cell with the found one that it is matched with, by plan area.
    iou: Vec<f64>,
    extra_rooms: usize,
    /// True portals with a found one between the same cells, within the tolerance.
    portals: usize,
    missed_portals: Vec<String>,
    extra_portals: Vec<String>,
}

/// A cell's boundaries on the ground: a box, and the outline in it.
fn is_over(interior: &Interior, id: CellId, p: DVec3) -> bool {
    let cell = interior.cell(id);
    let Content::Box(RoomBox { min, max }) = cell.content else {
        return false;
    };
    let in_box = p.x >= min.x && p.x <= max.x && p.z >= min.z && p.z <= max.z;
    let foot = |floor: &proxy::interior::Polygon| {
        p - floor.normal() * ((p - floor.center()).dot(floor.normal()))
    };
    in_box && cell.floor.as_ref().is_none_or(|f| f.covers(foot(f), 0.0))
}

fn score(truth: &Interior, found: &Interior, tolerance: f64) -> Score {
    // 1. Areas, by sampling the ground (y is up).
    let boxes = truth
        .cells
        .iter()
        .chain(&found.cells)
        .map(|c| match c.content {
            Content::Box(room) => room,
            _ => panic!("boxes"),
        });
    let (low, high) = boxes.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), b| {
        (l.min(b.min), h.max(b.max))
    });
    let (n, m) = (truth.cells.len(), found.cells.len());
    let mut shared = vec![vec![0_usize; m]; n];
    let (mut of_truth, mut of_found) = (vec![0_usize; n], vec![0_usize; m]);
    let step = 0.05;
    let counts = [high.x - low.x, high.z - low.z].map(|e| (e / step) as usize + 1);
    for i in 0..counts[0] * counts[1] {
        let at = DVec2::new((i % counts[0]) as f64 + 0.5, (i / counts[0]) as f64 + 0.5) * step;
        let p = DVec3::new(low.x + at.x, 0.0, low.z + at.y);
        let inside = |interior: &Interior, n: usize| -> Vec<usize> {
            (0..n)
                .filter(|i| is_over(interior, CellId(*i as u32), p))
                .collect()
        };
        let (a, b) = (inside(truth, n), inside(found, m));
        a.iter().for_each(|t| of_truth[*t] += 1);
        b.iter().for_each(|f| of_found[*f] += 1);
        for t in &a {
            b.iter().for_each(|f| shared[*t][*f] += 1);
        }
    }
    let iou = |t: usize, f: usize| {
        shared[t][f] as f64 / (of_truth[t] + of_found[f] - shared[t][f]).max(1) as f64
    };
    let mut matched: Vec<Option<usize>> = vec![None; m];
    let mut best = vec![0.0; n];
    let mut pairs: Vec<(usize, usize)> = (0..n).flat_map(|t| (0..m).map(move |f| (t, f))).collect();
    pairs.sort_by(|a, b| iou(b.0, b.1).total_cmp(&iou(a.0, a.1)));
    for (t, f) in pairs {
        if best[t] == 0.0 && matched[f].is_none() && iou(t, f) > 0.0 {
            best[t] = iou(t, f);
            matched[f] = Some(t);
        }
    }
    // 2. Portals: middles and widths.
    let mut left: Vec<usize> = (0..found.portals.len()).collect();
    let mut missed = Vec::new();
    for portal in &truth.portals {
        let near = left.iter().position(|i| {
            let other = &found.portals[*i];
            let off = other.polygon.center() - portal.polygon.center();
            let wider = other.width(found.up) - portal.width(truth.up);
            off.abs().max_element() <= tolerance && wider.abs() <= 2.0 * tolerance
        });
        match near {
            Some(i) => drop(left.remove(i)),
            None => missed.push(format!(
                "{} at {} width {:.2}",
                portal.name,
                portal.polygon.center(),
                portal.width(truth.up)
            )),
        }
    }
    let extra = left.iter().map(|i| {
        let portal = &found.portals[*i];
        let width = portal.width(found.up);
        format!(
            "{} at {} width {width:.2}",
            portal.name,
            portal.polygon.center()
        )
    });
    Score {
        iou: best,
        extra_rooms: matched.iter().filter(|m| m.is_none()).count(),
        portals: truth.portals.len() - missed.len(),
        missed_portals: missed,
        extra_portals: extra.collect(),
    }
}

#[test]
fn rooms_of_procedural_houses_are_found() {
    for (rooms, seed) in [(2, 1), (5, 2), (9, 3), (19, 1)] {
        let (house, _) = small_house(rooms, seed);
        let found = find(&house.model.mesh, &FindOptions::default()).unwrap();
        if let Ok(folder) = std::env::var("FLOOR_PLANS") {
            found
                .picture()
                .save(format!("{folder}/house-{rooms}.png"))
                .unwrap();
        }
        let score = score(&house.interior, &found.interior, 0.2);
        let worst = score.iou.iter().copied().fold(1.0, f64::min);
        let mean = score.iou.iter().sum::<f64>() / rooms as f64;
        eprintln!(
            "{rooms} rooms: {} found, {} extra, IoU mean {mean:.3} least {worst:.3}; {} of {} portals, missed {:?}, extra {:?}; {:?}",
            found.interior.cells.len(),
            score.extra_rooms,
            score.portals,
            house.interior.portals.len(),
            score.missed_portals,
            score.extra_portals,
            found.warnings,
        );
    }
}

#[test]
#[ignore]
fn dump_others() {
    let folder = std::env::var("FLOOR_PLANS").unwrap();
    for file in std::env::var("MESHES").unwrap().split(',') {
        let (model, _) = proxy::mesh::read_model(file.as_ref()).unwrap();
        match find(&model.mesh, &FindOptions::default()) {
            Ok(found) => {
                let name = std::path::Path::new(file)
                    .file_stem()
                    .unwrap()
                    .to_str()
                    .unwrap();
                found
                    .picture()
                    .save(format!("{folder}/{name}.png"))
                    .unwrap();
                for cell in &found.interior.cells {
                    eprintln!(
                        "{} {:?} {:?}",
                        cell.name,
                        cell.content,
                        cell.floor.as_ref().map(|f| f.corners().len())
                    );
                }
                for p in &found.interior.portals {
                    eprintln!(
                        "{} {} {:.2} {:?}",
                        p.name,
                        p.polygon.center(),
                        p.width(found.interior.up),
                        p.cells
                    );
                }
                eprintln!(
                    "{:?} {:?} {:?}",
                    found.warnings, found.plan.level, found.ceiling
                );
            }
            Err(e) => eprintln!("{file}: {e}"),
        }
    }
}

#[allow(dead_code)]
fn unused(_: DMat4, _: DQuat) {}
