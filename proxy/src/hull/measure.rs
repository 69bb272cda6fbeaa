//! How well a closed mesh fills silhouettes.

use super::Silhouette;
use crate::Mesh;
use calibrate::{Distortion, Lens, Pixel, View};
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
                let Some(ray) = rays.at(column, row) else {
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
    Lens(Box<LensRays>),
}

impl Rays {
    pub(super) fn of(view: &View) -> Self {
        match view.lens.distortion() {
            Distortion::None => Self::Pinhole {
                origin: (0.5 - view.lens.principal) / view.lens.focal,
                step: 1.0 / view.lens.focal,
            },
            _ => Self::Lens(Box::new(LensRays::of(view))),
        }
    }

    fn at(&self, column: usize, row: usize) -> Option<DVec3> {
        match self {
            Self::Pinhole { origin, step } => {
                let at = DVec2::new(column as f64, row as f64);
                Some((*origin + at * *step).extend(1.0))
            }
            Self::Lens(rays) => rays.at(column, row),
        }
    }
}

/// Of a lens' rays so many pixels apart are kept, across and down: all of them would take many times the
/// memory of the photo, and most of the time that measuring takes.
const BLOCK: usize = 8;
/// Between them they are interpolated where that is off by no more than this in the middle of a side, in
/// pixels.
const OFF_PX: f64 = 0.02;

/// The rays of a lens with distortion, some of which may lead backwards.
pub(super) struct LensRays {
    lens: Lens,
    /// How many blocks there are side by side.
    across: usize,
    /// Those through the first pixels of all blocks and of those that would come next, of unit length; NaN
    /// where there is none.
    nodes: Vec<DVec3>,
    /// Which blocks' rays may be interpolated.
    is_smooth: Vec<bool>,
}

impl LensRays {
    fn of(view: &View) -> Self {
        let lens = view.lens;
        let [across, down] = [view.width, view.height].map(|side| (side as usize).div_ceil(BLOCK));
        // In halves of a block.
        let ray = |x: usize, y: usize| {
            let [x, y] = [x, y].map(|i| (i * BLOCK / 2) as f64 + 0.5);
            lens.unproject(Pixel::new(x, y)).unwrap_or(DVec3::NAN)
        };
        let all = (0..=down).flat_map(|j| (0..=across).map(move |i| (i, j)));
        let nodes: Vec<DVec3> = all.map(|(i, j)| ray(2 * i, 2 * j)).collect();
        let is_smooth = |(i, j): (usize, usize)| {
            let node = j * (across + 1) + i;
            let [from, right, below] = [node, node + 1, node + across + 1].map(|k| nodes[k]);
            let off = |to: DVec3, middle: DVec3| {
                let half_way = (0.5 * (from + to)).normalize();
                half_way.distance(middle) * BLOCK as f64 / from.distance(to)
            };
            // A NaN is no ray.
            off(right, ray(2 * i + 1, 2 * j)) <= OFF_PX
                && off(below, ray(2 * i, 2 * j + 1)) <= OFF_PX
                && nodes[node + across + 2].is_finite()
        };
        let blocks = (0..down).flat_map(|j| (0..across).map(move |i| (i, j)));
        let is_smooth = blocks.map(is_smooth).collect();
        Self {
            lens,
            across,
            nodes,
            is_smooth,
        }
    }

    fn at(&self, column: usize, row: usize) -> Option<DVec3> {
        let (i, j) = (column / BLOCK, row / BLOCK);
        if !self.is_smooth[j * self.across + i] {
            let pixel = Pixel::center_of(column as u32, row as u32);
            return self.lens.unproject(pixel);
        }
        let [x, y] = [column, row].map(|k| (k % BLOCK) as f64 / BLOCK as f64);
        let above = j * (self.across + 1) + i;
        let below = above + self.across + 1;
        let between = |node: usize| self.nodes[node].lerp(self.nodes[node + 1], x);
        Some(between(above).lerp(between(below), y))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use calibrate::Rigid3;

    /// The share of blocks in which rays are interpolated; none of them may be off.
    fn checked(focal: f64, size: [u32; 2], distortion: Distortion) -> f64 {
        let [width, height] = size;
        let middle = 0.5 * DVec2::new(f64::from(width), f64::from(height)) + 1.3;
        let view = View {
            lens: Lens::new(DVec2::splat(focal), middle, distortion),
            width,
            height,
            camera_from_world: Rigid3::IDENTITY,
        };
        let rays = LensRays::of(&view);
        for row in (0..height).step_by(3) {
            for column in 0..width {
                let pixel = Pixel::center_of(column, row);
                let expected = view.lens.unproject(pixel);
                let found = rays.at(column as usize, row as usize);
                assert_eq!(found.is_some(), expected.is_some(), "{column}, {row}");
                let (Some(found), Some(expected)) = (found, expected) else {
                    continue;
                };
                let off = found.normalize().distance(expected) * focal;
                assert!(off < 0.5, "{column}, {row}: {off}");
                if let Some(seen) = view.lens.project(found) {
                    let off = (seen.x - pixel.x).hypot(seen.y - pixel.y);
                    assert!(off < 0.08, "{column}, {row}: {off}");
                }
            }
        }
        let smooth = rays.is_smooth.iter().filter(|smooth| **smooth).count();
        let share = smooth as f64 / rays.is_smooth.len() as f64;
        println!("{focal} {size:?}: {share:.3}");
        share
    }

    #[test]
    fn rays_between_those_kept_are_the_lens_own() {
        let barrel = |k: f64| Distortion::Rational {
            k: [k, 0.0, 0.0, 0.0, 0.0, 0.0],
            p: [0.002, -0.001],
        };
        let fisheye = Distortion::Fisheye {
            k: [0.02, 0.0, 0.0, 0.0],
        };
        assert!(checked(900.0, [1001, 750], barrel(-0.15)) > 0.95);
        assert!(checked(600.0, [641, 480], barrel(0.2)) > 0.5);
        checked(300.0, [321, 240], barrel(0.2));
        // One that sees what is behind it, and one that sees nothing beyond its limit.
        assert!(checked(300.0, [1203, 600], fisheye) > 0.3);
        checked(90.0, [321, 240], barrel(-0.3));
    }
}
