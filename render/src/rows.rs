//! Who paints the pixels of a picture, row by row.

use crate::blend::Contributor;
use crate::field::TriangulatedField;
use crate::frame::Frame;
use crate::raster::{NO_TRIANGLE, Raster};
use calibrate::Pixel;
use rayon::prelude::*;

/// Who paints each of some pixels, one list after the other: of a large picture lists that are each on their own
/// take several times as much memory.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Contributions {
    all: Vec<Contributor>,
    /// By pixel, where its list ends.
    ends: Vec<usize>,
}

impl Contributions {
    /// The lists, by pixel.
    pub fn iter(&self) -> impl Iterator<Item = &[Contributor]> {
        (0..self.ends.len()).map(|pixel_idx| self.list(pixel_idx))
    }

    /// A pixel's list; empty where nobody paints it.
    pub fn list(&self, pixel_idx: usize) -> &[Contributor] {
        let begin = pixel_idx.checked_sub(1).map_or(0, |i| self.ends[i]);
        &self.all[begin..self.ends[pixel_idx]]
    }

    /// All lists, one after the other.
    pub fn flat(&self) -> &[Contributor] {
        &self.all
    }

    fn push(&mut self, list: &[Contributor]) {
        self.all.extend_from_slice(list);
        self.ends.push(self.all.len());
    }
}

/// A frame's blending field at the pixels of its picture, which is worked out a row at a time: exact, or interpolated
/// over triangles.
pub struct FieldRows<'a> {
    frame: &'a Frame<'a>,
    triangles: Option<(&'a TriangulatedField, Raster)>,
}

impl<'a> FieldRows<'a> {
    /// Of a frame, and its field where that is triangulated.
    pub fn new(frame: &'a Frame<'a>, field: Option<&'a TriangulatedField>) -> Self {
        if field.is_none() {
            // Before threads ask for it.
            frame.view_tree();
        }
        Self {
            frame,
            triangles: field.map(|field| (field, Raster::new(field))),
        }
    }

    /// Width and height of the picture.
    pub fn size(&self) -> [u32; 2] {
        [self.frame.desired.width, self.frame.desired.height]
    }

    /// Who paints the pixels of a row. Lists are empty where the desired view does not see the proxy.
    pub fn row(&self, y: u32) -> Contributions {
        let [width, _] = self.size();
        let mut triangles = vec![NO_TRIANGLE; width as usize];
        if let Some((_, raster)) = &self.triangles {
            raster.cover(y as usize, &mut Vec::new(), &mut triangles);
        }
        let mut row = Contributions::default();
        for (x, triangle) in (0..width).zip(triangles) {
            let point = self.frame.proxy_point(Pixel::center_of(x, y));
            let list = match (point, &self.triangles) {
                (Some(point), None) => self.frame.blend_at(&point),
                (Some(point), Some((field, raster))) if triangle != NO_TRIANGLE => {
                    let triangle_idx = triangle as usize;
                    let shares = raster.barycentric(triangle_idx, x as usize, y as usize);
                    field.interpolate(self.frame, triangle_idx, shares.map(f64::from), &point)
                }
                _ => Vec::new(),
            };
            row.push(&list);
        }
        row
    }

    /// Who paints all pixels, row by row.
    pub fn all(&self) -> Contributions {
        let [_, height] = self.size();
        let rows = (0..height).into_par_iter().map(|y| self.row(y));
        let rows: Vec<Contributions> = rows.collect();
        let mut all = Contributions::default();
        all.all
            .reserve_exact(rows.iter().map(|row| row.all.len()).sum());
        for row in &rows {
            row.iter().for_each(|list| all.push(list));
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::{field_picture, field_picture_and, palette};
    use crate::{FieldOptions, Lumigraph, PhotoStore, SourceView};
    use calibrate::{Lens, Rigid3, View};
    use glam::{DVec2, DVec3};
    use image::RgbaImage;
    use proxy::{Plane, Proxy};

    /// Three views of a wall, of which a fourth, here, sees more.
    fn lumigraph() -> (Lumigraph, View) {
        let view = |center: DVec3, width: u32, height: u32| {
            let size = DVec2::new(f64::from(width), f64::from(height));
            View {
                lens: Lens::pinhole(DVec2::splat(size.x), 0.5 * size),
                width,
                height,
                camera_from_world: Rigid3::looking_at(center, center + DVec3::Z, DVec3::NEG_Y),
            }
        };
        let source = |x: f64| SourceView {
            name: format!("{x}"),
            view: view(DVec3::new(x, 0.1 * x, 0.0), 40, 30),
            gain: [1.0; 3],
            time_s: None,
            quarters: 0,
        };
        let wall = Plane::new(DVec3::new(0.0, 0.0, 4.0), DVec3::Z).unwrap();
        let lumigraph = Lumigraph {
            points: Vec::new(),
            sources: vec![source(-1.0), source(0.2), source(1.0)],
            photos: PhotoStore::from_images(vec![RgbaImage::new(40, 30); 3]),
            proxy: Proxy::Plane(wall),
            visibility: None,
        };
        (lumigraph, view(DVec3::new(0.3, 0.1, -3.0), 61, 47))
    }

    #[test]
    fn rows_are_those_of_the_whole_picture_and_hold_nothing_twice() {
        let (lumigraph, desired) = lumigraph();
        let frame = Frame::new(&lumigraph, desired, FieldOptions::default());
        let field = TriangulatedField::new(&frame, 16).unwrap();
        let (width, height) = (61, 47);
        let raster = Raster::new(&field);
        let mut map = vec![NO_TRIANGLE; width * height];
        for (y, triangles) in map.chunks_exact_mut(width).enumerate() {
            raster.cover(y, &mut Vec::new(), triangles);
        }
        let point = |i: usize| {
            let (x, y) = ((i % width) as u32, (i / width) as u32);
            frame.proxy_point(Pixel::center_of(x, y))
        };
        let exact = |i: usize| point(i).map_or_else(Vec::new, |point| frame.blend_at(&point));
        let interpolated = |i: usize| {
            let shown = point(i).filter(|_| map[i] != NO_TRIANGLE);
            shown.map_or_else(Vec::new, |point| {
                let triangle_idx = map[i] as usize;
                let shares = raster.barycentric(triangle_idx, i % width, i / width);
                field.interpolate(&frame, triangle_idx, shares.map(f64::from), &point)
            })
        };
        let lists = |of: &dyn Fn(usize) -> Vec<Contributor>| -> Vec<Vec<Contributor>> {
            (0..width * height).map(of).collect()
        };
        let colors = palette(3);
        for (field, expected) in [(None, lists(&exact)), (Some(&field), lists(&interpolated))] {
            let rows = FieldRows::new(&frame, field);
            let all = rows.all();
            assert!(all.iter().eq(expected.iter().map(Vec::as_slice)));
            assert!(expected.iter().any(Vec::is_empty));
            let count: usize = expected.iter().map(Vec::len).sum();
            assert_eq!((all.flat().len(), all.ends.len()), (count, width * height));
            let (picture, kept) = field_picture_and(&rows, &colors, Contributions::clone);
            assert_eq!(picture, field_picture(&rows, &colors));
            assert_eq!(kept.len(), height);
            for (y, row) in kept.iter().enumerate() {
                assert!(row.iter().eq((0..width).map(|x| all.list(y * width + x))));
            }
        }
    }
}
