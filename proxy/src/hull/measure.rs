//! How well a closed mesh fills silhouettes.

use super::Silhouette;
use crate::Mesh;
use calibrate::{Distortion, Pixel, View};
use glam::{DVec2, DVec3};
use rayon::prelude::*;

/// How a mesh and silhouettes compare, all photos together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measures {
    /// The share of the silhouettes' pixels whose rays (through their centres) meet the mesh.
    pub coverage: f64,
    /// The pixels that silhouettes and mesh share, over those that either has.
    pub iou: f64,
    /// The mesh's triangles.
    pub faces: usize,
}

/// Compares a mesh with silhouettes. Without any pixels both shares are one.
///
/// Silhouettes must be as large as their views.
pub fn measure(mesh: &Mesh, views: &[View], silhouettes: &[Silhouette]) -> Measures {
    let (views, silhouettes): (Vec<&View>, Vec<&Silhouette>) =
        views.iter().zip(silhouettes).unzip();
    compare(mesh, &views, &silhouettes)
}

pub(super) fn compare(mesh: &Mesh, views: &[&View], silhouettes: &[&Silhouette]) -> Measures {
    let counts: Vec<[usize; 3]> = views
        .par_iter()
        .zip(silhouettes)
        .map(|(view, silhouette)| {
            let drawn = outline(mesh, view);
            let pairs = drawn.inside().iter().zip(silhouette.inside());
            pairs.fold([0; 3], |[wanted, both, either], (drawn, inside)| {
                [
                    wanted + usize::from(*inside),
                    both + usize::from(*drawn && *inside),
                    either + usize::from(*drawn || *inside),
                ]
            })
        })
        .collect();
    let sum = |i: usize| counts.iter().map(|c| c[i]).sum::<usize>() as f64;
    let share = |part: f64, whole: f64| if whole > 0.0 { part / whole } else { 1.0 };
    Measures {
        coverage: share(sum(1), sum(0)),
        iou: share(sum(1), sum(2)),
        faces: mesh.triangles.len(),
    }
}

/// The silhouette of a mesh: the pixels whose rays, through their centres, meet it.
pub fn outline(mesh: &Mesh, view: &View) -> Silhouette {
    let mut drawn = vec![false; view.width as usize * view.height as usize];
    cover(mesh, &mesh.triangles, view, &Rays::of(view), |pixel| {
        drawn[pixel] = true;
    });
    Silhouette::new(view.width, view.height, drawn).expect("a value a pixel")
}

/// Calls `hit` with every pixel of the view whose ray meets one of a mesh's triangles.
///
/// A ray d meets the triangle (a, b, c), in the camera's frame, where d = αa + βb + γc with
/// none of α, β, γ negative. These are the determinants |d b c|, |a d c|, |a b d| over
/// |a b c|, which neighbouring triangles compute from the same cross products: no ray slips
/// through between them, whatever the lens.
pub(super) fn cover(
    mesh: &Mesh,
    triangles: &[[u32; 3]],
    view: &View,
    rays: &Rays,
    mut hit: impl FnMut(usize),
) {
    let width = view.width as usize;
    for triangle in triangles {
        let corners = triangle.map(|i| view.camera_from_world * mesh.positions[i as usize]);
        let Some((low, high)) = reach(view, corners) else {
            continue;
        };
        let [a, b, c] = corners;
        let normals = [b.cross(c), c.cross(a), a.cross(b)];
        let volume = a.dot(normals[0]);
        if volume == 0.0 {
            continue;
        }
        let sign = volume.signum();
        for row in low[1]..high[1] {
            for column in low[0]..high[0] {
                let Some(ray) = rays.at(column, row, width) else {
                    continue;
                };
                if normals.iter().all(|n| sign * n.dot(ray) >= 0.0) {
                    hit(row * width + column);
                }
            }
        }
    }
}

fn project(view: &View, point_in_camera: DVec3) -> Option<DVec2> {
    let pixel = view.lens.project(point_in_camera)?;
    Some(DVec2::new(pixel.x, pixel.y))
}

/// The first column and row that a triangle may cover, and those after the last; `None`
/// outside the image.
fn reach(view: &View, corners: [DVec3; 3]) -> Option<([usize; 2], [usize; 2])> {
    let size = DVec2::new(f64::from(view.width), f64::from(view.height));
    let (mut low, mut high) = (DVec2::ZERO, size);
    let pinhole = view.lens.distortion() == Distortion::None;
    if pinhole && corners.iter().all(|c| c.z <= 0.0) {
        return None;
    }
    // A triangle partly behind the camera may reach any pixel.
    if let [Some(a), Some(b), Some(c)] = corners.map(|c| project(view, c)) {
        (low, high) = (a.min(b).min(c), a.max(b).max(c));
        if !pinhole {
            let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
            // Edges are curves: they are followed in steps of about 8 pixels.
            let steps = (longest / 8.0).ceil().clamp(1.0, 256.0) as usize;
            let ends = corners.iter().zip(corners.iter().cycle().skip(1));
            for (from, to) in ends {
                for step in 1..steps {
                    match project(view, from.lerp(*to, step as f64 / steps as f64)) {
                        Some(pixel) => (low, high) = (low.min(pixel), high.max(pixel)),
                        None => (low, high) = (DVec2::ZERO, size),
                    }
                }
            }
            low -= 1.0;
            high += 1.0;
        }
    }
    // Centres lie half a pixel inside.
    let low = (low - 0.5).ceil().clamp(DVec2::ZERO, size);
    let high = (high - 0.5 + 1e-9).floor().clamp(-DVec2::ONE, size - 1.0) + 1.0;
    let whole = |v: DVec2| [v.x as usize, v.y as usize];
    (low.x < high.x && low.y < high.y).then(|| (whole(low), whole(high)))
}

/// The rays through the centres of a view's pixels, in its camera's frame.
pub(super) enum Rays {
    /// (x, y, 1) = origin + column · step.x + row · step.y.
    Pinhole {
        origin: DVec2,
        step: DVec2,
    },
    Lens(Vec<Option<DVec3>>),
}

impl Rays {
    pub(super) fn of(view: &View) -> Self {
        if view.lens.distortion() == Distortion::None {
            return Self::Pinhole {
                origin: (0.5 - view.lens.principal) / view.lens.focal,
                step: 1.0 / view.lens.focal,
            };
        }
        let pixels = (0..view.height).flat_map(|row| (0..view.width).map(move |c| (c, row)));
        let ray = |(column, row): (u32, u32)| view.lens.unproject(Pixel::center_of(column, row));
        Self::Lens(pixels.map(ray).collect())
    }

    fn at(&self, column: usize, row: usize, width: usize) -> Option<DVec3> {
        match self {
            Self::Pinhole { origin, step } => {
                let at = DVec2::new(column as f64, row as f64);
                Some((*origin + at * *step).extend(1.0))
            }
            Self::Lens(rays) => rays[row * width + column],
        }
    }
}
