//! The plane where a reconstruction has no observations of sparse points: through what the cameras look at.

use crate::Plane;
use crate::condition::thinnest;
use crate::fit::{FitBasis, FitError, PlaneFit, forward_or};
use calibrate::{Reconstruction, outer};
use glam::{DMat3, DVec3};
use std::collections::BTreeMap;

/// Optical axes whose directions spread less than this (the sine of the angle, by root mean
/// square, in the direction that tells depths) are parallel: 2°, about what hand-held photos
/// of one thing turn by without meaning to.
const LEAST_SPREAD: f64 = 0.035;

/// The plane through the point that is nearest to all optical axes, in the least-squares
/// sense: x with Σ (I − d dᵀ)(x − c) = 0 over the cameras' centres c and axes d. Parallel to
/// the mean image plane; where cameras look every way, across the direction in which their
/// centres spread least.
///
/// Where the axes are as good as parallel, or meet behind the cameras, the harmonic mean of
/// the depths in `depth_bounds` (nearest and farthest, by image name) is the plane's
/// distance.
///
/// # Errors
/// Axes that meet nowhere before the cameras, and no bounds.
pub fn plane_across_axes(
    reconstruction: &Reconstruction,
    depth_bounds: &BTreeMap<String, [f64; 2]>,
) -> Result<PlaneFit, FitError> {
    let images: Vec<_> = reconstruction.images.values().collect();
    let Some(first) = images.first() else {
        return Err(FitError::NoPoints);
    };
    let count = images.len() as f64;
    // Around one of the centres, so that far from the world's origin no digits are lost.
    let origin = first.camera_from_world.center();
    let rays: Vec<(DVec3, DVec3)> = images
        .iter()
        .map(|image| {
            let pose = &image.camera_from_world;
            (pose.center() - origin, pose.rotation.conjugate() * DVec3::Z)
        })
        .collect();
    let mean_center = rays.iter().map(|(c, _)| *c).sum::<DVec3>() / count;
    let (normal, across) = forward_or(reconstruction, || thinnest(rays.iter().map(|(c, _)| *c)));
    let at = |distance: f64, point: DVec3, basis: FitBasis, condition: f64| {
        Ok(PlaneFit {
            plane: Plane::new(origin + point, normal)?,
            distance,
            basis,
            condition,
        })
    };

    // 1. Where the axes meet.
    if let Some((point, along)) = nearest_to(&rays) {
        let depths: Vec<f64> = rays.iter().map(|(c, d)| d.dot(point - *c)).collect();
        if depths.iter().all(|depth| *depth > 0.0) {
            let distance = count / depths.iter().map(|depth| 1.0 / depth).sum::<f64>();
            return at(
                distance,
                point,
                FitBasis::Axes {
                    cameras: images.len(),
                },
                across.max(along),
            );
        }
    }
    // 2. Else at the depths that the calibration gives.
    let bounds: Vec<&[f64; 2]> = images
        .iter()
        .filter_map(|image| depth_bounds.get(&image.name))
        .collect();
    if bounds.is_empty() {
        return Err(FitError::NoPoints);
    }
    let inverse = bounds
        .iter()
        .map(|[near, far]| 0.5 * (1.0 / near + 1.0 / far));
    let distance = bounds.len() as f64 / inverse.sum::<f64>();
    let point = mean_center + normal * distance;
    at(
        distance,
        point,
        FitBasis::DepthBounds {
            cameras: bounds.len(),
        },
        across,
    )
}

/// The point nearest to all rays, and its condition number; `None` where they are parallel.
fn nearest_to(rays: &[(DVec3, DVec3)]) -> Option<(DVec3, f64)> {
    let (mut across, mut right_side) = (DMat3::ZERO, DVec3::ZERO);
    for &(center, axis) in rays {
        let projector = DMat3::IDENTITY - outer(axis);
        across += projector;
        right_side += projector * center;
    }
    // The mean projector's least eigenvalue is the mean square of the sines between the axes
    // and the direction in which they agree best.
    let mean = across * (1.0 / rays.len() as f64);
    let eigen =
        nalgebra::SymmetricEigen::new(nalgebra::Matrix3::from_column_slice(&mean.to_cols_array()));
    let (least, most) = (eigen.eigenvalues.min(), eigen.eigenvalues.max());
    let parallel = least < LEAST_SPREAD * LEAST_SPREAD;
    (!parallel).then(|| (across.inverse() * right_side, (most / least).sqrt()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use calibrate::{Camera, CameraId, Image, ImageId, ModelKind, Rigid3};

    /// Cameras at places that look at places.
    fn looking(rays: &[(DVec3, DVec3)]) -> Reconstruction {
        let mut whole = Reconstruction::default();
        let camera = Camera {
            model: ModelKind::SimplePinhole,
            width: 100,
            height: 100,
            params: vec![100.0, 50.0, 50.0],
        };
        whole.cameras.insert(CameraId(1), camera);
        for (i, &(center, target)) in rays.iter().enumerate() {
            let image = Image {
                name: format!("{i}.png"),
                camera_id: CameraId(1),
                camera_from_world: Rigid3::looking_at(center, target, DVec3::new(0.1, 1.0, 0.2)),
                keypoints: Vec::new(),
            };
            whole.images.insert(ImageId(i as u32), image);
        }
        whole
    }

    fn ring(center: DVec3, radius: f64) -> Vec<(DVec3, DVec3)> {
        (0..8)
            .map(|i| {
                let (sin, cos) = (f64::from(i) * std::f64::consts::FRAC_PI_4).sin_cos();
                (center + radius * DVec3::new(cos, 0.0, sin), center)
            })
            .collect()
    }

    #[test]
    fn a_ring_of_cameras_looks_at_its_middle_wherever_it_lies() {
        for middle in [DVec3::new(1.0, 2.0, 3.0), DVec3::new(4e5, 5e6, 120.0)] {
            let whole = looking(&ring(middle, 4.0));
            let fit = plane_across_axes(&whole, &BTreeMap::new()).unwrap();
            assert!(fit.plane.signed_distance(middle).abs() < 1e-6, "{fit:?}");
            assert!((fit.distance - 4.0).abs() < 1e-6);
            // Looking every way: the plane is that of the ring.
            assert!(fit.plane.normal().y.abs() > 1.0 - 1e-6, "{fit:?}");
            assert_eq!(fit.basis, FitBasis::Axes { cameras: 8 });
        }
    }

    #[test]
    fn a_ring_that_looks_down_has_the_plane_below_it() {
        for above in [0.4, -0.4] {
            let mut rays = ring(DVec3::ZERO, 4.0);
            rays.iter_mut().for_each(|(center, _)| center.y = above);
            // Above the plane that they look at, so that the normal points away from them.
            let fit = plane_across_axes(&looking(&rays), &BTreeMap::new()).unwrap();
            assert!(fit.plane.signed_distance(DVec3::ZERO).abs() < 1e-6);
            assert!(fit.plane.normal().y * above.signum() < -0.999, "{fit:?}");
        }
    }

    #[test]
    fn cameras_that_look_one_way_have_the_plane_across_it() {
        let target = DVec3::new(0.0, 0.0, 5.0);
        let rays: Vec<_> = [-1.0, -0.3, 0.4, 0.9]
            .map(|x| (DVec3::X * x, target))
            .to_vec();
        let fit = plane_across_axes(&looking(&rays), &BTreeMap::new()).unwrap();
        assert!(fit.plane.signed_distance(target).abs() < 1e-9);
        assert!(fit.plane.normal().z > 0.99, "{fit:?}");
    }

    #[test]
    fn parallel_axes_need_the_depths() {
        let rays: Vec<_> = [-1.0, 0.0, 1.0]
            .map(|x| (DVec3::X * x, DVec3::new(x, 0.0, 1.0)))
            .to_vec();
        let whole = looking(&rays);
        let error = plane_across_axes(&whole, &BTreeMap::new()).unwrap_err();
        assert_eq!(error, FitError::NoPoints);
        let bounds = ["0.png", "2.png", "elsewhere.png"].map(|n| (n.to_owned(), [2.0, 6.0]));
        let fit = plane_across_axes(&whole, &bounds.into()).unwrap();
        assert!((fit.distance - 3.0).abs() < 1e-12, "{fit:?}");
        assert!((fit.plane.signed_distance(DVec3::ZERO) + 3.0).abs() < 1e-9);
        assert_eq!(fit.basis, FitBasis::DepthBounds { cameras: 2 });
    }

    #[test]
    fn axes_that_meet_behind_the_cameras_mean_nothing() {
        let outwards: Vec<_> = ring(DVec3::ZERO, 1.0)
            .into_iter()
            .map(|(c, _)| (c, 2.0 * c))
            .collect();
        let error = plane_across_axes(&looking(&outwards), &BTreeMap::new()).unwrap_err();
        assert_eq!(error, FitError::NoPoints);
    }
}
