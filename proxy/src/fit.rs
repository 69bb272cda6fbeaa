//! The plane proxy of Buehler et al. 2001, §5 (Pond): "oriented (roughly) parallel to the
//! camera image planes and placed at the average 1/z distance from the cameras".

use crate::cloud::{isolated_points, median};
use crate::condition::{Thinnest, thinnest};
use crate::{Plane, PlaneError};
use calibrate::{Image, Reconstruction};
use glam::DVec3;
use std::fmt;

/// A fitted plane and what it rests on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaneFit {
    /// The plane. Its normal points away from the cameras.
    pub plane: Plane,
    /// The harmonic mean distance from the cameras to it, in world units.
    pub distance: f64,
    /// What it rests on.
    pub basis: FitBasis,
    /// How many times as large errors of that come out, at most; see [`crate::ILL_CONDITIONED`].
    pub condition: f64,
}

/// What decided a plane's distance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FitBasis {
    /// Observations of sparse points.
    Points {
        /// Those that decided.
        observations: usize,
        /// Those left out: of isolated points, behind their camera, or far from the typical
        /// inverse depth.
        outliers: usize,
    },
    /// Where the optical axes come closest to each other.
    Axes {
        /// How many.
        cameras: usize,
    },
    /// The nearest and farthest depths that the calibration gives.
    DepthBounds {
        /// For how many.
        cameras: usize,
    },
    /// Nothing but where photos from one place look, which any distance suits.
    OnePlace {
        /// How many.
        cameras: usize,
    },
}

impl fmt::Display for FitBasis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Points {
                observations,
                outliers,
            } => write!(
                f,
                "{observations} observations of points, {outliers} outliers left out"
            ),
            Self::Axes { cameras } => write!(
                f,
                "where the optical axes of {cameras} photos come closest, as they observe no sparse \
                 points"
            ),
            Self::DepthBounds { cameras } => write!(
                f,
                "the nearest and farthest depths of {cameras} photos, as they observe no sparse \
                 points"
            ),
            Self::OnePlace { cameras } => write!(
                f,
                "what {cameras} photos show from one place, where any distance serves, as they \
                 observe no sparse points"
            ),
        }
    }
}

/// Why no plane could be fitted.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FitError {
    /// There is nothing to fit to.
    #[error(
        "the reconstruction's cameras observe no sparse points in front of them to fit a plane to, and \
         their optical axes do not meet there; give the plane by hand (`proxy SCENE plane --point X,Y,Z --normal X,Y,Z`)"
    )]
    NoPoints,
    /// All images were taken from one place, and look too far apart for one plane.
    #[error(
        "all photos were taken from one place and look all around, which no one plane lies before; try carved, \
         a dome around them"
    )]
    AllAround,
    /// The points make no plane.
    #[error(transparent)]
    Plane(#[from] PlaneError),
}

/// Below this length of the mean forward axis the cameras look every way (an orbit), and
/// their mean says nothing.
const COMMON_DIRECTION: f64 = 0.2;
/// Inverse depths farther from their median than this many standard deviations (by the
/// median absolute deviation) do not count.
const OUTLIER_SIGMAS: f64 = 3.0;

/// Fits the plane: parallel to the mean image plane, at the mean inverse depth.
///
/// Each observation of a point by an image counts once, so that what many photos see
/// weighs more. Robust: isolated points go first, then inverse depths beyond three
/// deviations of the median. Where the cameras look every way the orientation is that of
/// least spread among the points, and the plane lies on the side of the cameras on which most of
/// what they observe does.
///
/// # Errors
/// No observation of a point in front of its camera.
pub fn fit_plane(reconstruction: &Reconstruction) -> Result<PlaneFit, FitError> {
    // 1. Orientation: the mean of the forward axes.
    let positions: Vec<DVec3> = reconstruction.points.values().map(|p| p.position).collect();
    let isolated = isolated_points(&positions);
    let (normal, condition) = forward_or(reconstruction, || {
        let kept = positions
            .iter()
            .zip(&isolated)
            .filter(|(_, alone)| !**alone);
        thinnest(kept.map(|(p, _)| *p))
    });

    // 2. Inverse depths along it, one an observation; and the observing cameras' mean.
    let mut observed: Vec<(f64, DVec3)> = Vec::new();
    let (mut total, mut ahead) = (0, 0.0);
    for (point, alone) in reconstruction.points.values().zip(&isolated) {
        for (image_id, _) in &point.track {
            let Some(image) = reconstruction.images.get(image_id) else {
                continue;
            };
            total += 1;
            let in_front = (image.camera_from_world * point.position).z > 0.0;
            let center = image.camera_from_world.center();
            let depth = normal.dot(point.position - center);
            if in_front && !alone && depth.abs() > 0.0 {
                observed.push((1.0 / depth.abs(), center));
                ahead += depth.signum();
            }
        }
    }
    if observed.is_empty() {
        return Err(FitError::NoPoints);
    }
    // Of a direction of least spread the sign says nothing: the points say on which side they are.
    let normal = if ahead < 0.0 { -normal } else { normal };

    // 3. Drop what is far from the middle, and average the rest.
    let middle = median(observed.iter().map(|o| o.0).collect());
    let deviation = 1.4826 * median(observed.iter().map(|o| (o.0 - middle).abs()).collect());
    observed.retain(|o| (o.0 - middle).abs() <= OUTLIER_SIGMAS * deviation);
    let count = observed.len() as f64;
    let distance = count / observed.iter().map(|o| o.0).sum::<f64>();
    let origin = observed[0].1;
    let mean_center = origin + observed.iter().map(|o| o.1 - origin).sum::<DVec3>() / count;

    let plane = Plane::new(mean_center + normal * distance, normal)?;
    Ok(PlaneFit {
        plane,
        distance,
        basis: FitBasis::Points {
            observations: observed.len(),
            outliers: total - observed.len(),
        },
        condition,
    })
}

/// A plane's normal and condition: where the cameras look on the whole, or else the direction in
/// which something is thinnest, the way that they look along it rather than against it.
pub(crate) fn forward_or(
    reconstruction: &Reconstruction,
    thinnest: impl FnOnce() -> Option<Thinnest>,
) -> (DVec3, f64) {
    let mean = mean_forward(reconstruction);
    if mean.length() >= COMMON_DIRECTION {
        return (mean.normalize(), 1.0 / mean.length());
    }
    let Some(Thinnest {
        direction,
        condition,
    }) = thinnest()
    else {
        return (DVec3::Z, f64::INFINITY);
    };
    let is_against = direction.dot(mean) < 0.0;
    (if is_against { -direction } else { direction }, condition)
}

/// The mean of the unit vectors that the cameras look along.
pub(crate) fn mean_forward(reconstruction: &Reconstruction) -> DVec3 {
    let images = reconstruction.images.values();
    let sum: DVec3 = images.map(forward).sum();
    sum / reconstruction.images.len().max(1) as f64
}

/// The unit vector that an image's camera looks along.
pub(crate) fn forward(image: &Image) -> DVec3 {
    image.camera_from_world.rotation.conjugate() * DVec3::Z
}

#[cfg(test)]
mod tests {
    use super::*;
    use calibrate::{Camera, CameraId, ImageId, ModelKind, Point3D, Point3DId, Rigid3};
    use glam::DQuat;

    /// Four cameras at z = 0 looking along +z at points on z = `depth`.
    fn capture(depth: f64, world_from_scene: Rigid3) -> Reconstruction {
        let mut r = Reconstruction::default();
        let params = vec![100.0, 50.0, 50.0];
        let camera = Camera {
            model: ModelKind::SimplePinhole,
            width: 100,
            height: 100,
            params,
        };
        r.cameras.insert(CameraId(1), camera);
        for i in 0..4 {
            let center = DVec3::new(f64::from(i % 2), f64::from(i / 2), 0.0);
            let camera_from_scene = Rigid3::new(DQuat::IDENTITY, -center);
            r.images.insert(
                ImageId(i),
                Image {
                    name: format!("{i}.png"),
                    camera_id: CameraId(1),
                    camera_from_world: camera_from_scene * world_from_scene.inverse(),
                    keypoints: Vec::new(),
                },
            );
        }
        for i in 0..100 {
            let scene = DVec3::new(f64::from(i % 10) * 0.1, f64::from(i / 10) * 0.1, depth);
            add_point(&mut r, i, world_from_scene * scene);
        }
        r
    }

    fn add_point(r: &mut Reconstruction, id: u32, position: DVec3) {
        let track = r.images.keys().map(|id| (*id, 0)).collect();
        let point = Point3D {
            position,
            color: [0; 3],
            error_px: 0.0,
            track,
        };
        r.points.insert(Point3DId(u64::from(id)), point);
    }

    #[test]
    fn the_plane_of_the_points_is_found_wherever_the_world_lies() {
        let far = Rigid3::new(DQuat::from_rotation_x(1.1), DVec3::new(3e5, -5e6, 200.0));
        for world_from_scene in [Rigid3::IDENTITY, far] {
            let fit = fit_plane(&capture(5.0, world_from_scene)).unwrap();
            for scene in [DVec3::new(0.0, 0.0, 5.0), DVec3::new(9.0, -7.0, 5.0)] {
                let distance = fit.plane.signed_distance(world_from_scene * scene);
                assert!(distance.abs() < 1e-7, "{distance}");
            }
            assert!((fit.distance - 5.0).abs() < 1e-7);
            let basis = FitBasis::Points {
                observations: 400,
                outliers: 0,
            };
            assert_eq!(fit.basis, basis);
        }
    }

    #[test]
    fn outliers_do_not_move_it() {
        let mut r = capture(5.0, Rigid3::IDENTITY);
        for (i, far) in [1e9, 1e4, 4e3].into_iter().enumerate() {
            add_point(&mut r, 1000 + i as u32, DVec3::new(0.0, far, far));
        }
        add_point(&mut r, 2000, DVec3::new(0.3, 0.3, -2.0));
        add_point(&mut r, 2001, DVec3::new(0.3, 0.3, 0.01));
        let fit = fit_plane(&r).unwrap();
        assert!((fit.distance - 5.0).abs() < 1e-9, "{fit:?}");
        let FitBasis::Points { outliers, .. } = fit.basis else {
            panic!("{fit:?}");
        };
        assert_eq!(outliers, 20);
    }

    #[test]
    fn the_distance_is_the_harmonic_mean() {
        let mut r = capture(2.0, Rigid3::IDENTITY);
        for i in 0..100 {
            let x = f64::from(i % 10) * 0.1;
            add_point(&mut r, 500 + i, DVec3::new(x, f64::from(i / 10) * 0.1, 4.0));
        }
        let fit = fit_plane(&r).unwrap();
        assert!(
            (1.0 / fit.distance - (0.5 + 0.25) / 2.0).abs() < 1e-12,
            "{fit:?}"
        );
    }

    /// Eight cameras around a disc of points that look at its middle from above, or from below.
    #[test]
    fn cameras_that_look_every_way_have_the_plane_where_the_points_are() {
        let far = Rigid3::new(DQuat::from_rotation_z(2.0), DVec3::new(4e5, 5e6, 120.0));
        for (above, world_from_scene) in [(0.4, Rigid3::IDENTITY), (-0.4, Rigid3::IDENTITY)]
            .into_iter()
            .flat_map(|(above, same)| [(above, same), (above, far)])
        {
            let mut r = capture(5.0, world_from_scene);
            r.points.clear();
            let image = r.images[&ImageId(0)].clone();
            let around = |i: u32, turn: f64, radius: f64, y: f64| {
                let (sin, cos) = (f64::from(i) * turn).sin_cos();
                DVec3::new(radius * cos, y, radius * sin)
            };
            let centers = (0..8).map(|i| around(i, std::f64::consts::FRAC_PI_4, 4.0, above));
            let centers: Vec<DVec3> = centers.collect();
            r.images = (0..)
                .zip(&centers)
                .map(|(i, center)| {
                    let pose = Rigid3::looking_at(*center, DVec3::ZERO, DVec3::Y);
                    let camera_from_world = pose * world_from_scene.inverse();
                    let image = Image {
                        camera_from_world,
                        ..image.clone()
                    };
                    (ImageId(i), image)
                })
                .collect();
            for i in 0..200 {
                let scene = around(i, 2.4, 0.1 * f64::from(i).sqrt(), 1e-3 * f64::from(i % 3));
                add_point(&mut r, i, world_from_scene * scene);
            }
            let plane = fit_plane(&r).unwrap().plane;
            for at in [DVec3::ZERO, DVec3::X, DVec3::Z] {
                let off = plane.signed_distance(world_from_scene * at);
                assert!(off.abs() < 0.01, "{above}: {off}, {plane:?}");
            }
            let behind = |center: &DVec3| plane.signed_distance(world_from_scene * *center) < 0.0;
            assert!(centers.iter().all(behind), "{above}: {plane:?}");
        }
    }

    #[test]
    fn without_points_the_remedy_is_named() {
        let mut r = capture(5.0, Rigid3::IDENTITY);
        r.points.clear();
        assert_eq!(
            fit_plane(&r).unwrap_err().to_string(),
            "the reconstruction's cameras observe no sparse points in front of them to fit a plane to, \
             and their optical axes do not meet there; give the plane by hand (`proxy SCENE plane --point X,Y,Z --normal X,Y,Z`)"
        );
    }
}
