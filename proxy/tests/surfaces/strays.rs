//! Lines of sight past portals: what portals hide though it is seen is found, and found rooms reach as far
//! as is seen.

use crate::common;
use crate::find::{find, open_box};
use crate::house::{self, small_house, view, viewpoint};

use glam::{DMat4, DVec3};
use proxy::interior::find::FindOptions;
use proxy::interior::{
    Contents, Interior, InteriorWarning, Polygon, compare, fit_to_sight, interior_from_nodes,
    strays, visible,
};
use proxy::mesh::{Material, Model, ModelNode, Part};
use proxy::{Mesh, MeshKind, Solid};

/// How far walls' boxes and openings may be moved here, in metres.
const REACH: f64 = 0.35;

/// How many pixels of views from random places in an interior see what portals hide.
fn hidden_pixels(interior: &Interior, model: &Model, views: u64) -> usize {
    let from = (0..views).map(|seed| viewpoint(interior, seed));
    hidden_from(interior, model, from)
}

/// The same of views from one place to another.
fn hidden_from(
    interior: &Interior,
    model: &Model,
    views: impl Iterator<Item = (DVec3, DVec3)>,
) -> usize {
    let (contents, _) = Contents::new(interior, model).unwrap();
    let solid = Solid::new(MeshKind::Mesh, model.mesh.clone());
    let hidden = |(eye, target): (DVec3, DVec3)| {
        let Some(cell) = contents.locate(interior, eye) else {
            return 0;
        };
        let view = view(eye, target, [64, 48]);
        let visibility = visible(interior, Some(cell), &view);
        let is_hidden = |ray: &&DVec3| {
            let Some(hit) = solid.first_hit(eye, **ray) else {
                return false;
            };
            let has = |id: usize| {
                contents.triangles[id]
                    .binary_search(&hit.triangle_idx)
                    .is_ok()
            };
            let mut seen_there = visibility.cells.iter().filter(|visible| {
                let mut regions = visible.regions.iter();
                has(visible.cell.0 as usize) && regions.any(|region| region.contains(**ray))
            });
            contents.elsewhere.binary_search(&hit.triangle_idx).is_err()
                && seen_there.next().is_none()
        };
        house::rays(&view).iter().filter(is_hidden).count()
    };
    views.map(hidden).sum()
}

#[test]
fn found_rooms_and_openings_reach_as_far_as_is_seen() {
    for (rooms, seed) in [(2, 1), (5, 2)] {
        let (house, _) = small_house(rooms, seed);
        // Where they are known to the last bit nothing is hidden, nor changed.
        let mut known = house.interior.clone();
        let none = fit_to_sight(&mut known, &house.model, REACH).unwrap();
        assert_eq!(none.found, []);
        assert!(none.tried > 10_000 && !none.is_cut);
        assert_eq!(known, house.interior);

        let found = find(&house.model.mesh, &FindOptions::default())
            .unwrap()
            .interior;
        let mut fitted = found.clone();
        let before = strays(&fitted, &house.model).unwrap();
        assert!(!before.found.is_empty());
        let left = fit_to_sight(&mut fitted, &house.model, REACH).unwrap();
        assert_eq!(left.found, []);
        assert_eq!(left, strays(&fitted, &house.model).unwrap());
        assert_eq!(left.warning(&fitted), None);
        // By no more than they were off, and then next to nothing that is seen is left out.
        let compared = compare(&house.interior, &fitted, 0.1, 1.0);
        assert!(compared.portals.iter().all(|p| p.is_found), "{compared}");
        let [before, after] = [&found, &fitted].map(|i| hidden_pixels(i, &house.model, 200));
        eprintln!("{rooms} rooms: {before} pixels of 200 views were hidden, {after} are");
        assert!(before > 0 && 100 * after <= before, "{before} {after}");
    }
}

/// A portal narrower by so much on one side, as if by hand.
fn narrowed(mut interior: Interior, by: f64) -> Interior {
    let up = interior.up;
    let is_joint = |portal: &&mut proxy::interior::Portal| portal.cells.iter().all(Option::is_some);
    let portal = interior.portals.iter_mut().find(is_joint).unwrap();
    let across = up.cross(portal.polygon.normal()).normalize();
    let corners = portal.polygon.corners().to_vec();
    let last = corners
        .iter()
        .map(|p| p.dot(across))
        .fold(f64::MIN, f64::max);
    let moved = |p: DVec3| p - (p.dot(across) - (last - by)).max(0.0) * across;
    portal.polygon = Polygon::new(corners.into_iter().map(moved).collect()).unwrap();
    interior
}

#[test]
fn what_a_portal_hides_is_told_and_one_that_is_too_narrow_widened() {
    let (house, _) = small_house(2, 1);
    let narrow = narrowed(house.interior.clone(), 0.2);
    let told = strays(&narrow, &house.model).unwrap();
    let warning = told.warning(&narrow).unwrap();
    assert!(
        matches!(warning, InteriorWarning::Hidden { hidden, tried, .. }
            if hidden == told.found.len() && 0 < hidden && hidden < tried / 10),
        "{warning}"
    );
    // What would have to move farther than it may stays.
    let mut kept = narrow.clone();
    let left = fit_to_sight(&mut kept, &house.model, 1e-4).unwrap();
    assert_eq!(kept, narrow);
    assert_eq!(left, told);

    let mut wide = narrow.clone();
    let left = fit_to_sight(&mut wide, &house.model, REACH).unwrap();
    assert_eq!(left.found, []);
    assert!(hidden_pixels(&narrow, &house.model, 100) > 0);
    assert_eq!(hidden_pixels(&wide, &house.model, 100), 0);
    let compared = compare(&house.interior, &wide, 0.05, 1.0);
    assert!(compared.portals.iter().all(|p| p.is_found), "{compared}");
}

#[test]
fn past_folded_leaves_a_modelled_house_is_seen_through_wider_openings() {
    let Some(folder) = common::find_capture("interior-house") else {
        return;
    };
    let (model, _) = proxy::mesh::read_model(&folder.join("house.glb")).unwrap();
    let found = find(&model.mesh, &FindOptions::default()).unwrap();
    let mut fitted = found.interior.clone();
    let before = strays(&fitted, &model).unwrap();
    assert!(before.found.len() > 100, "{}", before.found.len());
    let left = fit_to_sight(&mut fitted, &model, REACH).unwrap();
    assert_eq!(left.found, []);
    let [before, after] = [&found.interior, &fitted].map(|i| hidden_pixels(i, &model, 200));
    eprintln!("{before} pixels of 200 views were hidden, {after} are");
    assert!(before > 0 && 100 * after <= before, "{before} {after}");
    // Leaves stand beside the sliding doors' opening, up to where they were, drawn by hand, too.
    for portal in &fitted.portals {
        let x = portal.polygon.center().x;
        let is_there = |p: &DVec3| p.z > -1.5 && p.z < 3.8;
        assert!((x + 2.5).abs() > 0.2 || portal.polygon.corners().iter().all(is_there));
    }
}

/// A model so many times as large, and what is found in it as if its units were metres, as far as is seen.
fn fitted_as_metres(mut model: Model, times: f64) -> (Interior, Vec<InteriorWarning>) {
    let larger = DMat4::from_scale(DVec3::splat(times));
    model.mesh.transform(&larger);
    let found = find(&model.mesh, &FindOptions::default()).unwrap();
    let mut fitted = found.interior;
    let left = fit_to_sight(&mut fitted, &model, REACH).unwrap();
    assert_eq!(left, strays(&fitted, &model).unwrap());
    (fitted, found.warnings)
}

#[test]
fn what_stays_hidden_of_a_house_whose_units_are_no_metres_ends_the_fitting() {
    let (house, _) = small_house(2, 1);
    let (in_feet, warnings) = fitted_as_metres(house.model.clone(), 3.28084);
    in_feet.check().unwrap();
    let told = InteriorWarning::TallWalls(6.0);
    assert!(warnings.contains(&told), "{warnings:?}");
    // A little larger than it is.
    if let Some(folder) = common::find_capture("interior-house") {
        let (model, _) = proxy::mesh::read_model(&folder.join("house.glb")).unwrap();
        let (larger, _) = fitted_as_metres(model, 1.2);
        larger.check().unwrap();
    }
}

/// Least and greatest coordinates of a block.
type Block = ([f64; 3], [f64; 3]);

fn built_of(blocks: &[Block]) -> Model {
    let mut mesh = Mesh::default();
    for (min, max) in blocks {
        let [min, max] = [*min, *max].map(DVec3::from_array);
        mesh.append(&open_box(min, max, &[0, 1, 2, 3, 4, 5]));
    }
    Model {
        mesh,
        ..Model::default()
    }
}

/// Two rooms of 5 × 5 m, and in the wall of 0.15 m between them a doorway, which may be walled up, and a closed
/// door whose leaf lies so along x; the middle of the wall is at 5.
fn rooms_with_leaf([from, to]: [f64; 2], is_open: bool) -> Model {
    let mut blocks = vec![
        ([-0.1, -0.1, -0.1], [10.1, 0.0, 5.1]),
        ([-0.1, 2.5, -0.1], [10.1, 2.6, 5.1]),
        ([-0.1, 0.0, -0.1], [0.0, 2.5, 5.1]),
        ([10.0, 0.0, -0.1], [10.1, 2.5, 5.1]),
        ([0.0, 0.0, -0.1], [10.0, 2.5, 0.0]),
        ([0.0, 0.0, 5.0], [10.0, 2.5, 5.1]),
        ([4.925, 0.0, 0.0], [5.075, 2.5, 0.5]),
        ([4.925, 2.0, 0.5], [5.075, 2.5, 1.4]),
        ([4.925, 0.0, 1.4], [5.075, 2.5, 3.2]),
        ([4.925, 2.0, 3.2], [5.075, 2.5, 4.1]),
        ([4.925, 0.0, 4.1], [5.075, 2.5, 5.0]),
        ([from, 0.0, 3.2], [to, 2.0, 4.1]),
    ];
    if !is_open {
        blocks.push(([4.925, 0.0, 0.5], [5.075, 2.0, 1.4]));
    }
    built_of(&blocks)
}

#[test]
fn closed_doors_beyond_the_middle_of_their_walls_are_seen_from_both_rooms() {
    for (leaf, is_open, is_past) in [
        ([5.035, 5.075], true, true),
        ([5.01, 5.05], true, true),
        ([4.925, 4.965], true, true),
        ([4.98, 5.02], true, false),
        ([5.035, 5.075], false, true),
    ] {
        let model = rooms_with_leaf(leaf, is_open);
        let found = find(&model.mesh, &FindOptions::default()).unwrap().interior;
        assert_eq!(found.cells.len(), 2);
        assert_eq!(found.portals.len(), usize::from(is_open));
        let mut fitted = found.clone();
        let left = fit_to_sight(&mut fitted, &model, REACH).unwrap();
        assert_eq!(left.found, []);
        assert_eq!(left, strays(&fitted, &model).unwrap());
        // From anywhere between the walls.
        let views = || {
            (0..150).map(|seed| {
                let mut random = house::random(seed);
                let west = DVec3::new(0.05, 0.05, 0.05);
                let size = DVec3::new(4.8, 2.4, 4.9);
                let eye = west + size * DVec3::new(random(), random(), random());
                let across = if random() < 0.5 { 0.0 } else { 5.1 };
                let eye = eye + across * DVec3::X;
                let way = DVec3::new(random() - 0.5, 0.6 * (random() - 0.5), random() - 0.5);
                (eye, eye + way)
            })
        };
        let [before, after] = [&found, &fitted].map(|i| hidden_from(i, &model, views()));
        eprintln!("{leaf:?}: {before} pixels of 150 views were hidden, {after} are");
        assert!(!is_past || before > 100, "{before}");
        assert!(100 * after <= before, "{before} {after}");
    }
}

/// Two rooms of 5 × 5 m with a doorway in the wall of 0.15 m between them, and a hatch of 2 m that is too low to be found
/// as an opening, which may be walled up. Floors, ceilings and walls are of strips of 0.5 m.
fn rooms_with_hatch(is_open: bool) -> Model {
    let mut blocks = vec![
        ([-0.1, 0.0, 0.0], [0.0, 2.5, 5.0]),
        ([10.0, 0.0, 0.0], [10.1, 2.5, 5.0]),
        ([4.925, -0.1, 0.0], [5.075, 0.0, 5.0]),
        ([4.925, 0.0, 0.0], [5.075, 2.5, 0.5]),
        ([4.925, 2.0, 0.5], [5.075, 2.5, 1.4]),
        ([4.925, 0.0, 1.4], [5.075, 2.5, 2.8]),
        ([4.925, 0.0, 2.8], [5.075, 1.0, 4.8]),
        ([4.925, 1.25, 2.8], [5.075, 2.5, 4.8]),
        ([4.925, 0.0, 4.8], [5.075, 2.5, 5.0]),
    ];
    if !is_open {
        blocks.push(([4.925, 1.0, 2.8], [5.075, 1.25, 4.8]));
    }
    for first in [-0.1, 5.075] {
        for strip in 0..10 {
            let [from, to] = [strip, strip + 1].map(|n| first + 0.5025 * f64::from(n));
            blocks.extend([
                ([from, -0.1, -0.1], [to, 0.0, 5.1]),
                ([from, 2.5, -0.1], [to, 2.6, 5.1]),
                ([from, 0.0, -0.1], [to, 2.5, 0.0]),
                ([from, 0.0, 5.0], [to, 2.5, 5.1]),
            ]);
        }
    }
    built_of(&blocks)
}

#[test]
fn rooms_do_not_creep_over_each_other_through_what_is_no_portal() {
    for (is_open, farthest) in [(false, 0.1), (true, 4.05 * REACH)] {
        let model = rooms_with_hatch(is_open);
        let found = find(&model.mesh, &FindOptions::default()).unwrap().interior;
        assert_eq!((found.cells.len(), found.portals.len()), (2, 1));
        let mut fitted = found.clone();
        let left = fit_to_sight(&mut fitted, &model, REACH).unwrap();
        for (before, after) in found.cells.iter().zip(&fitted.cells) {
            let [before, after] = [before, after].map(|cell| cell.content.room().unwrap());
            let farther = (before.min - after.min).max(after.max - before.max);
            assert!(farther.max_element() < farthest + 0.01, "{after:?}");
        }
        // What is seen through it is told.
        assert_eq!(left.warning(&fitted).is_some(), is_open);
    }
}

/// Two rooms of 4 × 3 m, each a box of its own and a node: their walls, with a doorway in both, are so far apart.
fn boxes_as_nodes(apart: f64) -> Model {
    type Face<'a> = ([f64; 3], [f64; 3], &'a [usize]);
    let [a, b, middle] = [4.0, 4.0 + apart, 4.0 + 0.5 * apart];
    let nodes: [(&str, &[Face<'_>]); 3] = [
        (
            "cell:a",
            &[
                ([0.0, 0.0, 0.0], [a, 2.5, 3.0], &[0, 2, 3, 4, 5]),
                ([a, 0.0, 0.0], [a, 2.5, 1.0], &[0]),
                ([a, 2.0, 1.0], [a, 2.5, 2.0], &[0]),
                ([a, 0.0, 2.0], [a, 2.5, 3.0], &[0]),
            ],
        ),
        (
            "cell:b",
            &[
                ([b, 0.0, 0.0], [8.0, 2.5, 3.0], &[1, 2, 3, 4, 5]),
                ([b, 0.0, 0.0], [b, 2.0, 1.0], &[0]),
                ([b, 2.0, 0.0], [b, 2.5, 3.0], &[0]),
                ([b, 0.0, 2.0], [b, 2.0, 3.0], &[0]),
            ],
        ),
        (
            "portal:a|b",
            &[([middle, 0.0, 1.0], [middle, 2.0, 2.0], &[0])],
        ),
    ];
    let mut model = Model {
        materials: vec![Material::default()],
        ..Model::default()
    };
    for (node_idx, (name, faces)) in (0..).zip(nodes) {
        let first = model.mesh.triangles.len() as u32;
        for (min, max, which) in faces {
            let [min, max] = [*min, *max].map(DVec3::from_array);
            model.mesh.append(&open_box(min, max, which));
        }
        model.parts.push(Part {
            triangles: first..model.mesh.triangles.len() as u32,
            node_idx,
            material_idx: 0,
        });
        model.nodes.push(ModelNode {
            name: name.to_owned(),
            parent_idx: None,
        });
    }
    model.uvs = vec![[0.0; 2]; model.mesh.positions.len()];
    model.colors = vec![[255; 4]; model.mesh.positions.len()];
    model
}

#[test]
fn walls_of_two_rooms_in_one_plane_hide_nothing() {
    for (apart, is_hidden) in [(0.0, false), (0.1, true)] {
        let model = boxes_as_nodes(apart);
        let (interior, _) = interior_from_nodes(&model, "m.glb", 1.0).unwrap();
        assert_eq!((interior.cells.len(), interior.portals.len()), (2, 1));
        let told = strays(&interior, &model).unwrap();
        assert!(told.tried > 10_000, "{}", told.tried);
        // Where they are apart, each is seen past the other's doorway.
        let found = told.found.len();
        assert_eq!(found > 0, is_hidden, "{apart} m: {found}");
    }
}
