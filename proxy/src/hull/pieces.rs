//! The pieces of a hull that its silhouettes need.

use super::Silhouette;
use super::measure::{Rays, cover};
use crate::Mesh;
use calibrate::View;
use rayon::prelude::*;

/// Pieces of at least this part of the whole volume always stay.
const LARGE: f64 = 0.01;

/// The mesh without its cavities, which no photo sees, and without small pieces that cover no
/// pixel of any silhouette but those that large ones cover: where lines of sight cross beside
/// the object, silhouettes leave specks that are nothing.
pub(super) fn needed(mesh: &Mesh, views: &[&View], silhouettes: &[&Silhouette]) -> Mesh {
    let pieces = pieces(mesh);
    let volumes: Vec<f64> = pieces.iter().map(|piece| volume(mesh, piece)).collect();
    let whole: f64 = volumes.iter().filter(|v| **v > 0.0).sum();
    let is_large = |i: usize| volumes[i] >= LARGE * whole;
    let large: Vec<[u32; 3]> = (0..pieces.len())
        .filter(|i| is_large(*i))
        .flat_map(|i| pieces[i].iter().copied())
        .collect();
    let small: Vec<usize> = (0..pieces.len())
        .filter(|i| !is_large(*i) && volumes[*i] > 0.0)
        .collect();
    if large.is_empty() {
        return mesh.clone();
    }
    // For each photo, which of the small pieces it needs.
    let needed_by_photo: Vec<Vec<bool>> = views
        .par_iter()
        .zip(silhouettes)
        .map(|(view, silhouette)| {
            let rays = Rays::of(view);
            let mut missing = silhouette.inside().to_vec();
            cover(mesh, &large, view, &rays, |pixel| missing[pixel] = false);
            small
                .iter()
                .map(|i| {
                    let mut needed = false;
                    cover(mesh, &pieces[*i], view, &rays, |pixel| {
                        needed |= missing[pixel]
                    });
                    needed
                })
                .collect()
        })
        .collect();
    let mut triangles = large;
    for (k, i) in small.iter().enumerate() {
        if needed_by_photo.iter().any(|needed| needed[k]) {
            triangles.extend(&pieces[*i]);
        }
    }
    compact(mesh, &triangles)
}

/// The triangles of each connected piece, in the order of their first ones.
fn pieces(mesh: &Mesh) -> Vec<Vec<[u32; 3]>> {
    fn root(parent: &mut [u32], mut i: u32) -> u32 {
        while parent[i as usize] != i {
            parent[i as usize] = parent[parent[i as usize] as usize];
            i = parent[i as usize];
        }
        i
    }
    let mut parent: Vec<u32> = (0..mesh.positions.len() as u32).collect();
    for triangle in &mesh.triangles {
        let first = root(&mut parent, triangle[0]);
        for corner in &triangle[1..] {
            let other = root(&mut parent, *corner);
            parent[other as usize] = first;
        }
    }
    let mut piece_of = vec![usize::MAX; mesh.positions.len()];
    let mut pieces: Vec<Vec<[u32; 3]>> = Vec::new();
    for triangle in &mesh.triangles {
        let piece = &mut piece_of[root(&mut parent, triangle[0]) as usize];
        if *piece == usize::MAX {
            *piece = pieces.len();
            pieces.push(Vec::new());
        }
        pieces[*piece].push(*triangle);
    }
    pieces
}

fn volume(mesh: &Mesh, triangles: &[[u32; 3]]) -> f64 {
    let from = mesh.positions[triangles[0][0] as usize];
    let tetrahedron = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|i| mesh.positions[i as usize] - from);
        a.dot(b.cross(c)) / 6.0
    };
    triangles.iter().map(tetrahedron).sum()
}

/// Some of a mesh's triangles, and the positions that they use.
fn compact(mesh: &Mesh, triangles: &[[u32; 3]]) -> Mesh {
    let mut moved_to = vec![u32::MAX; mesh.positions.len()];
    let mut part = Mesh::default();
    for triangle in triangles {
        part.triangles.push(triangle.map(|i| {
            let to = &mut moved_to[i as usize];
            if *to == u32::MAX {
                *to = part.positions.len() as u32;
                part.positions.push(mesh.positions[i as usize]);
            }
            *to
        }));
    }
    part
}
