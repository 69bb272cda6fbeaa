//! What a view looks at that sees too few points for a surface of them.

use super::SparsePoint;
use crate::{Plane, fit_plane, fit_plane_for_view, plane_across_axes};
use calibrate::{CameraId, Image, ImageId, Point3D, Point3DId, Reconstruction, View};
use std::collections::BTreeMap;

/// A plane to look at where [`facets`](super::facets()) finds no surface, though photos may show all of it: a white
/// wall has no points. It is the plane that fits what points there are before the view, in its image or
/// beside it; without any, the plane that fits all of them, or else lies where the sources' axes come
/// closest. `None` where that is nowhere, too.
///
/// It does not pass into the facets: a view that moves to where it sees enough points jumps from one to
/// the other.
pub fn plane_without_facets(
    desired: &View,
    sources: &[View],
    points: &[SparsePoint],
) -> Option<Plane> {
    let of_view = fit_plane_for_view(desired, sources, points);
    of_view.or_else(|| plane_of_all(sources, points))
}

/// The plane of the capture as a whole, as far as sources and points tell it.
fn plane_of_all(sources: &[View], points: &[SparsePoint]) -> Option<Plane> {
    let image = |(i, source): (u32, &View)| {
        let image = Image {
            name: String::new(),
            camera_id: CameraId(0),
            camera_from_world: source.camera_from_world,
            keypoints: Vec::new(),
        };
        (ImageId(i), image)
    };
    let point = |(i, point): (u64, &SparsePoint)| {
        let point = Point3D {
            position: point.position,
            color: [0; 3],
            error_px: 0.0,
            track: point.seen_by.iter().map(|&i| (ImageId(i), 0)).collect(),
        };
        (Point3DId(i), point)
    };
    let whole = Reconstruction {
        cameras: BTreeMap::new(),
        images: (0..).zip(sources).map(image).collect(),
        points: (0..).zip(points).map(point).collect(),
    };
    let fit = fit_plane(&whole).or_else(|_| plane_across_axes(&whole, &BTreeMap::new()));
    fit.ok().map(|fit| fit.plane)
}
