//! A mesh's corners coloured from photos.

use super::Mesh;
use calibrate::{DepthAlong, Pixel, View};
use capture::DepthMap;
use glam::DVec3;
use image::RgbaImage;
use rayon::prelude::*;

/// Photos that a corner's colour is the mean of.
const BEST: usize = 4;
/// A corner is what a depth map shows if its depth differs by no more than this share of it, or
/// than the tolerance that was given.
const SAME_DEPTH: f64 = 0.02;
/// Photos that see a surface at more than 80° are not asked.
const LEAST_COS: f64 = 0.17;
/// Alpha from which on a pixel is a surface's colour: masks that are JPEG are not quite white.
const OPAQUE: u8 = 250;
/// Rounds in which corners that no photo sees take their neighbours' colours.
const ROUNDS: usize = 64;
const UNSEEN: [u8; 4] = [128, 128, 128, 255];

/// The best views of one side of a corner so far: how good, and the colour.
type Best = [(f64, [f64; 3]); BEST];

/// Colours gathered photo by photo, so that one is held at a time.
pub struct Painting<'a> {
    mesh: &'a Mesh,
    normals: Vec<DVec3>,
    /// For each corner, from where it winds counter-clockwise and from behind.
    best: Vec<[Best; 2]>,
    tolerance: f64,
    front_only: bool,
}

impl<'a> Painting<'a> {
    /// Nothing yet. `tolerance` is how far the mesh may be from what depth maps say, in world
    /// units; with `front_only` photos that see triangles clockwise are not asked.
    pub fn new(mesh: &'a Mesh, tolerance: f64, front_only: bool) -> Self {
        let mut normals = vec![DVec3::ZERO; mesh.positions.len()];
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|i| mesh.positions[i as usize]);
            let across = (b - a).cross(c - a);
            triangle.iter().for_each(|i| normals[*i as usize] += across);
        }
        Self {
            mesh,
            normals,
            best: vec![[[(0.0, [0.0; 3]); BEST]; 2]; mesh.positions.len()],
            tolerance,
            front_only,
        }
    }

    /// Takes in a photo where its depth map shows the mesh: frontal and near is better. The
    /// photo and the map are as large as the view; depths are what [`DepthAlong`] says.
    pub fn add(&mut self, view: &View, photo: &RgbaImage, depth: &DepthMap) {
        let size = (view.width, view.height);
        if photo.dimensions() != size || (depth.width, depth.height) != size {
            return;
        }
        let (center, along) = (view.center(), DepthAlong::of_view(view));
        let (tolerance, front_only) = (self.tolerance, self.front_only);
        let corners = self.mesh.positions.par_iter().zip(&self.normals);
        let corners = self.best.par_iter_mut().zip(corners);
        corners.for_each(|(best, (position, normal))| {
            let depth_there = along.depth(view.camera_from_world * *position);
            let Some(pixel) = view.project(*position).filter(|p| view.contains(*p)) else {
                return;
            };
            let (x, y) = (pixel.x as u32, pixel.y as u32);
            let (x, y) = (x.min(size.0 - 1), y.min(size.1 - 1));
            let i = y as usize * depth.width as usize + x as usize;
            let shown = f64::from(depth.depths[i]);
            let is_shown =
                (shown - depth_there).abs() <= tolerance.max(SAME_DEPTH * depth_there.abs());
            if shown == 0.0 || !is_shown {
                return;
            }
            let toward = center - *position;
            let distance = toward.length();
            let cos = normal.normalize_or_zero().dot(toward) / distance;
            let goodness = cos.abs() / distance;
            let is_back = cos < 0.0;
            let is_seen = cos.abs() > LEAST_COS && !(is_back && front_only);
            if !(is_seen && goodness.is_finite()) {
                return;
            }
            let best = &mut best[usize::from(is_back)];
            let worst = (0..BEST).fold(0, |w, k| if best[k].0 < best[w].0 { k } else { w });
            if goodness > best[worst].0
                && let Some(color) = sample(photo, pixel)
            {
                best[worst] = (goodness, color);
            }
        });
    }

    /// The corners' colours: means of the best photos; where none saw a corner, those of its
    /// neighbours, or grey.
    ///
    /// Files' meshes wind either way, so the side that photos saw more of is taken for the front, and
    /// a corner has the other's colours only where its front was not seen: through a thin wall, or
    /// where one corner stands for both sides, photos of the wrong room say nothing.
    pub fn colors(&self) -> Vec<[u8; 4]> {
        let seen_of = |side: usize| -> f64 {
            let seen = self.best.iter().flat_map(|best| &best[side]);
            seen.map(|(goodness, _)| goodness).sum()
        };
        let front = usize::from(seen_of(1) > seen_of(0));
        let mean_of = |best: &Best| {
            let seen = best.iter().filter(|b| b.0 > 0.0);
            let (sum, weight) = seen.fold((DVec3::ZERO, 0.0), |(s, w), (goodness, color)| {
                (s + *goodness * DVec3::from_array(*color), w + goodness)
            });
            (weight > 0.0).then(|| sum / weight)
        };
        let mean = |best: &[Best; 2]| mean_of(&best[front]).or_else(|| mean_of(&best[1 - front]));
        let mut colors: Vec<Option<DVec3>> = self.best.iter().map(mean).collect();
        for _ in 0..ROUNDS {
            let mut sums = vec![(DVec3::ZERO, 0.0); colors.len()];
            let mut is_more = false;
            for triangle in &self.mesh.triangles {
                let of = triangle.map(|i| colors[i as usize]);
                for (k, i) in triangle
                    .iter()
                    .enumerate()
                    .filter(|(k, _)| of[*k].is_none())
                {
                    for color in [of[(k + 1) % 3], of[(k + 2) % 3]].into_iter().flatten() {
                        sums[*i as usize].0 += color;
                        sums[*i as usize].1 += 1.0;
                        is_more = true;
                    }
                }
            }
            if !is_more {
                break;
            }
            for (color, (sum, count)) in colors.iter_mut().zip(sums) {
                if color.is_none() && count > 0.0 {
                    *color = Some(sum / count);
                }
            }
        }
        let code = |color: Option<DVec3>| match color {
            Some(c) => {
                let [r, g, b] = c.to_array().map(|x| x.round().clamp(0.0, 255.0) as u8);
                [r, g, b, 255]
            }
            None => UNSEEN,
        };
        colors.into_iter().map(code).collect()
    }
}

/// Bilinear; nothing where a mask makes it transparent.
fn sample(photo: &RgbaImage, pixel: Pixel) -> Option<[f64; 3]> {
    let (x, y) = (pixel.x - 0.5, pixel.y - 0.5);
    let (left, top) = (x.floor(), y.floor());
    let (s, t) = (x - left, y - top);
    let at = |column: f64, row: f64| {
        let column = column.clamp(0.0, f64::from(photo.width() - 1)) as u32;
        let row = row.clamp(0.0, f64::from(photo.height() - 1)) as u32;
        photo.get_pixel(column, row).0
    };
    let corners = [
        (at(left, top), (1.0 - s) * (1.0 - t)),
        (at(left + 1.0, top), s * (1.0 - t)),
        (at(left, top + 1.0), (1.0 - s) * t),
        (at(left + 1.0, top + 1.0), s * t),
    ];
    let is_opaque = corners.iter().all(|(color, _)| color[3] >= OPAQUE);
    let channel = |c: usize| {
        corners
            .iter()
            .map(|(color, w)| w * f64::from(color[c]))
            .sum()
    };
    is_opaque.then(|| [channel(0), channel(1), channel(2)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use calibrate::{Lens, Rigid3};
    use glam::DVec2;
    use image::Rgba;

    const RED: [u8; 4] = [200, 10, 10, 255];
    const BLUE: [u8; 4] = [10, 10, 200, 255];

    /// A square across the z axis, wound counter-clockwise as it is seen from where z is greater.
    fn square(z: f64) -> Mesh {
        let corner = |x: f64, y: f64| DVec3::new(x, y, z);
        Mesh {
            positions: vec![
                corner(-0.5, -0.5),
                corner(0.5, -0.5),
                corner(0.5, 0.5),
                corner(-0.5, 0.5),
            ],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        }
    }

    fn turned_over(mut mesh: Mesh) -> Mesh {
        mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        mesh
    }

    /// What a camera on the z axis sees that looks along it, or back: a depth, and a colour.
    fn add(painting: &mut Painting<'_>, z: f64, toward: f64, depth: f32, color: [u8; 4]) {
        let (center, target) = (DVec3::Z * z, DVec3::Z * (z + toward));
        let view = View {
            lens: Lens::pinhole(DVec2::splat(50.0), DVec2::splat(50.0)),
            width: 100,
            height: 100,
            camera_from_world: Rigid3::looking_at(center, target, DVec3::Y),
        };
        let map = DepthMap {
            width: 100,
            height: 100,
            depths: vec![depth; 100 * 100],
        };
        let photo = RgbaImage::from_pixel(100, 100, Rgba(color));
        painting.add(&view, &photo, &map);
    }

    #[test]
    fn meshes_that_wind_either_way_have_their_photos_colours() {
        let toward_photo = turned_over(square(2.0));
        for (mesh, front_only, expected) in [
            (toward_photo.clone(), false, RED),
            (toward_photo, true, RED),
            (square(2.0), false, RED),
            // Of free space before a solid, that is its inside.
            (square(2.0), true, UNSEEN),
        ] {
            let mut painting = Painting::new(&mesh, 0.0, front_only);
            add(&mut painting, 0.0, 1.0, 2.0, RED);
            assert_eq!(painting.colors(), [expected; 4]);
        }
    }

    #[test]
    fn the_sides_of_a_thin_wall_keep_their_colours_apart() {
        // Each side is as deep as the other, nearly.
        let mut wall = turned_over(square(2.0));
        wall.append(&square(2.02));
        for wall in [wall.clone(), turned_over(wall)] {
            let mut painting = Painting::new(&wall, 0.0, false);
            add(&mut painting, 0.0, 1.0, 2.0, RED);
            add(&mut painting, 4.02, -1.0, 2.0, BLUE);
            assert_eq!(painting.colors(), [[RED; 4], [BLUE; 4]].concat());
        }
    }

    #[test]
    fn what_is_transparent_colours_nothing() {
        let mesh = square(2.0);
        for (alpha, expected) in [(0, UNSEEN), (128, UNSEEN), (254, RED)] {
            let mut painting = Painting::new(&mesh, 0.0, false);
            add(
                &mut painting,
                0.0,
                1.0,
                2.0,
                [RED[0], RED[1], RED[2], alpha],
            );
            assert_eq!(painting.colors(), [expected; 4]);
        }
    }
}
