//! The proxy as one desired view sees it.

use crate::lumigraph::Lumigraph;
use calibrate::{Pixel, View};
use glam::DVec3;
use proxy::{Facets, Proxy, points};
use rayon::prelude::*;

/// What each pixel of the desired view looks at: a plane, by its vector q (a ray v meets
/// it at v / s with s = q · v), in the desired camera's frame.
#[derive(Clone, Debug, PartialEq)]
pub enum Surface {
    /// Nothing: a plane seen edge on, say.
    Nothing,
    /// One plane all over.
    Plane(DVec3),
    /// A facet of many.
    Facets(FacetMap),
}

/// No facet.
pub const NO_FACET: u32 = u32::MAX;

/// Facets and which of them each pixel sees.
#[derive(Clone, Debug, PartialEq)]
pub struct FacetMap {
    /// The facets, in the desired camera's frame.
    pub facets: Facets,
    /// Row by row, the facet at each pixel's centre; [`NO_FACET`] where the lens has no ray.
    pub facet_of: Vec<u32>,
    size: [u32; 2],
}

impl Surface {
    /// The surface of a lumigraph's proxy from a desired view.
    pub(crate) fn of(lumigraph: &Lumigraph, desired: &View) -> Self {
        match &lumigraph.proxy {
            Proxy::Plane(plane) => plane
                .inverse_distance_from(desired.center())
                .map_or(Self::Nothing, |q| {
                    Self::Plane(desired.camera_from_world.rotation * q)
                }),
            Proxy::Points => {
                let views: Vec<View> = lumigraph.sources.iter().map(|s| s.view.clone()).collect();
                points::facets(desired, &views, &lumigraph.points).map_or(Self::Nothing, |facets| {
                    Self::Facets(FacetMap::new(facets, desired))
                })
            }
        }
    }

    /// q at a position in the desired image, of the pixel around it.
    pub fn plane_at(&self, pixel: Pixel) -> Option<DVec3> {
        match self {
            Self::Nothing => None,
            Self::Plane(q) => Some(*q),
            Self::Facets(map) => {
                let [width, height] = map.size;
                let column = pixel.x.clamp(0.0, f64::from(width - 1)) as usize;
                let row = pixel.y.clamp(0.0, f64::from(height - 1)) as usize;
                self.plane_of(column, row)
            }
        }
    }

    /// q at the centre of a pixel.
    #[inline]
    pub(crate) fn plane_of(&self, column: usize, row: usize) -> Option<DVec3> {
        match self {
            Self::Nothing => None,
            Self::Plane(q) => Some(*q),
            Self::Facets(map) => map.plane_of(map.facet_of[row * map.size[0] as usize + column]),
        }
    }
}

impl FacetMap {
    /// q at every pixel's centre, row by row.
    pub(crate) fn planes(&self) -> impl Iterator<Item = Option<DVec3>> {
        self.facet_of.iter().map(|&facet| self.plane_of(facet))
    }

    fn plane_of(&self, facet: u32) -> Option<DVec3> {
        (facet != NO_FACET).then(|| self.facets.planes[facet as usize])
    }

    fn new(facets: Facets, desired: &View) -> Self {
        let (width, height) = (desired.width as usize, desired.height as usize);
        let row = |y: usize| {
            let mut last = 0;
            (0..width)
                .map(|x| {
                    let center = Pixel::center_of(x as u32, y as u32);
                    let Some(ray) = desired.lens.unproject(center) else {
                        return NO_FACET;
                    };
                    last = facets.locate(ray, last);
                    last
                })
                .collect::<Vec<u32>>()
        };
        let rows: Vec<Vec<u32>> = (0..height).into_par_iter().map(row).collect();
        Self {
            facets,
            facet_of: rows.concat(),
            size: [desired.width, desired.height],
        }
    }
}
