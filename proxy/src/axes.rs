//! The plane where a reconstruction has no observations of sparse points: through what the cameras look at.

use crate::Plane;
use crate::condition::thinnest;
use crate::fit::{FitBasis, FitError, PlaneFit, forward, forward_or, mean_forward};
use calibrate::{Reconstruction, outer};
use glam::{DMat3, DVec3};
use std::collections::BTreeMap;

/// Optical axes whose directions spread less than this (the sine of the angle, by root mean
/// square, in the direction that tells depths) are parallel: 2°, about what hand-held photos
/// of one thing turn by without meaning to.
const LEAST_SPREAD: f64 = 0.035;
/// Centres nearer to one another than this share of how far they are from the world's origin are one place: a rotation
/// and a translation, as they are written, tell them no better. Paths stand still by the same.
pub const PLACE_ROUNDING: f64 = 1e-10;
/// How far from photos of one place their plane lies, in world units: as good as any other.
const ANY_DISTANCE: f64 = 100.0;
/// Cosine of the widest angle between where photos of one place look and where they do on the whole, for one plane to
/// lie before all: 80°, beyond which hardly half of a photo meets it.
const BEFORE: f64 = 0.17;

/// The plane through the point that is nearest to all optical axes, in the least-squares
/// sense: x with Σ (I − d dᵀ)(x − c) = 0 over the cameras' centres c and axes d. Parallel to
/// the mean image plane; where cameras look every way, across the direction in which their
/// centres spread least.
///
/// Where the axes are as good as parallel, or meet behind the cameras or in [one place](is_one_place) of
/// them all, the harmonic mean of the depths in `depth_bounds` (nearest and farthest, by image name) is the
/// plane's distance.
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
            (pose.center() - origin, forward(image))
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

    // 1. Where the axes meet, unless it is where they begin: before or behind is a matter of rounding there.
    if !is_one_place(reconstruction)
        && let Some((point, along)) = nearest_to(&rays)
    {
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

/// Whether all images were taken from one place but for rounding, as one alone was. Of none it is not so.
pub fn is_one_place(reconstruction: &Reconstruction) -> bool {
    let images = reconstruction.images.values();
    let mut centers = images.map(|image| image.camera_from_world.center());
    let Some(first) = centers.next() else {
        return false;
    };
    centers.all(|center| {
        let apart = center.distance(first);
        apart.is_finite() && apart <= PLACE_ROUNDING * center.length().max(first.length())
    })
}

/// The plane before images that were all taken from [one place](is_one_place), where nothing tells how far away things are:
/// whatever its distance, a viewer there sees the same. It lies across where they look on the whole, 100 world units away.
///
/// # Errors
/// No images; [`FitError::AllAround`] of such as look past any plane.
pub fn plane_of_one_place(reconstruction: &Reconstruction) -> Result<PlaneFit, FitError> {
    let images = &reconstruction.images;
    let Some(first) = images.values().next() else {
        return Err(FitError::NoPoints);
    };
    let normal = mean_forward(reconstruction).normalize_or_zero();
    if images
        .values()
        .any(|image| forward(image).dot(normal) < BEFORE)
    {
        return Err(FitError::AllAround);
    }
    let point = first.camera_from_world.center() + ANY_DISTANCE * normal;
    Ok(PlaneFit {
        plane: Plane::new(point, normal)?,
        distance: ANY_DISTANCE,
        basis: FitBasis::OnePlace {
            cameras: images.len(),
        },
        condition: 1.0,
    })
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

    /// Cameras at one place that look so far to the side, in degrees.
    fn turned(place: DVec3, sides: &[f64]) -> Reconstruction {
        let rays: Vec<(DVec3, DVec3)> = sides
            .iter()
            .map(|side| {
                let (sin, cos) = side.to_radians().sin_cos();
                (place, place + DVec3::new(sin, 0.0, cos))
            })
            .collect();
        looking(&rays)
    }

    #[test]
    fn a_plane_lies_before_cameras_of_one_place_unless_they_look_all_around() {
        for place in [
            DVec3::ZERO,
            DVec3::new(0.1, -0.3, 7.0),
            DVec3::new(4e5, 5e6, 120.0),
        ] {
            let whole = turned(place, &[-70.0, -20.0, 20.0, 70.0]);
            assert!(is_one_place(&whole));
            // The axes meet, if anywhere, where they begin.
            let error = plane_across_axes(&whole, &BTreeMap::new()).unwrap_err();
            assert_eq!(error, FitError::NoPoints);
            let fit = plane_of_one_place(&whole).unwrap();
            assert_eq!(fit.basis, FitBasis::OnePlace { cameras: 4 });
            assert!((fit.plane.signed_distance(place) + fit.distance).abs() < 1e-6);
            assert!(fit.plane.normal().z > 1.0 - 1e-6, "{fit:?}");
            for around in [
                &[0.0, 90.0, 180.0, 270.0][..],
                &[0.0, 120.0, 240.0],
                &[-85.0, 85.0],
            ] {
                let fit = plane_of_one_place(&turned(place, around));
                assert_eq!(fit.unwrap_err(), FitError::AllAround, "{around:?}");
            }
        }
        assert!(!is_one_place(&looking(&ring(DVec3::ZERO, 1e-3))));
        assert!(!is_one_place(&Reconstruction::default()));
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
