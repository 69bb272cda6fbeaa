//! Photos without distortion: the pinhole camera that takes a lens's place, and where each
//! of its pixels was in the photo.
//!
//! The optical axis stays, and so does the resolution on it. A lens that sees no further
//! than [`MAX_SLOPE`] to the sides gets the largest picture that its photo fills. A wider
//! one would be stretched out of all proportion: what lies beyond that slope is left out,
//! and within it the photo need not fill the picture.

use crate::{
    Camera, CameraError, CameraId, Distortion, Keypoint, Lens, ModelKind, Pixel, Reconstruction,
};
use glam::{DMat2, DVec2};
use std::collections::BTreeMap;

/// How far to the side of the axis a picture reaches at most, on the plane at distance 1:
/// 60°, where a pinhole picture is stretched fourfold outwards.
pub const MAX_SLOPE: f64 = 1.732_050_807_568_877_2;

/// A picture's sides are at most so many times the photo's: where a calibration asks for more, it is wrong.
const MOST_TIMES: f64 = 8.0;
/// And at most so many pixels, as a JPEG's.
const LONGEST_SIDE: f64 = 65_535.0;

/// Places on each side of the photo that stand for its border.
const BORDER_SAMPLES: u32 = 256;

/// Why a photo has no picture without distortion.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum UndistortError {
    /// The camera is unusable.
    #[error("camera {camera_id}: {source}")]
    Camera {
        /// The camera.
        camera_id: u32,
        /// What is wrong with it.
        source: CameraError,
    },
    /// A camera that looks every way.
    #[error(
        "camera {0} is EQUIRECTANGULAR: no pinhole picture holds what it sees all round; cut its \
         panoramas into views first"
    )]
    AllRound(u32),
    /// Nothing of the photo is seen.
    #[error(
        "camera {0} sees next to nothing around its optical axis; check its principal point and \
         its distortion"
    )]
    Nothing(u32),
    /// The picture would be larger than memory or files hold.
    #[error(
        "camera {camera_id} is {} with the parameters {}: without this distortion its photos of {} × {} \
         pixels would become {width} × {height}, expected at most 8 times the sides and 65,535 pixels; \
         check its focal length and its distortion, or calibrate again with fewer coefficients",
        camera.model.name(), list(&camera.params), camera.width, camera.height
    )]
    TooLarge {
        /// The camera's id.
        camera_id: u32,
        /// The camera.
        camera: Camera,
        /// What the picture's width would be, in pixels.
        width: f64,
        /// And its height.
        height: f64,
    },
}

fn list(numbers: &[f64]) -> String {
    let numbers: Vec<String> = numbers.iter().map(f64::to_string).collect();
    numbers.join(", ")
}

/// How the photos of one camera become a pinhole's.
#[derive(Clone, Debug, PartialEq)]
pub struct Undistortion {
    lens: Lens,
    photo_size: DVec2,
    pinhole: Lens,
    size: (u32, u32),
}

/// Where a pixel of the undistorted picture was in the photo.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaceInPhoto {
    /// In the photo.
    pub pixel: Pixel,
    /// How that place moves as the undistorted pixel does.
    pub jacobian: DMat2,
}

impl Undistortion {
    /// The pinhole camera for a lens.
    ///
    /// # Errors
    /// A camera without a lens; one that looks all round; one that sees nothing; one whose
    /// distortion makes more pixels of a photo than can be meant.
    pub fn new(id: CameraId, camera: &Camera) -> Result<Self, UndistortError> {
        let lens = camera.lens().map_err(|source| UndistortError::Camera {
            camera_id: id.0,
            source,
        })?;
        let photo_size = DVec2::new(f64::from(camera.width), f64::from(camera.height));
        let mut whole = Self {
            lens,
            photo_size,
            pinhole: lens,
            size: (camera.width, camera.height),
        };
        match lens.distortion() {
            Distortion::None => return Ok(whole),
            Distortion::Equirectangular => return Err(UndistortError::AllRound(id.0)),
            _ => {}
        }
        // 1. The part of the plane at distance 1 that the picture shows.
        let border = whole.border();
        let reach = border.iter().map(|p| p.abs().max_element());
        let (low, high) = if reach.fold(0.0, f64::max) < whole.reach() {
            largest_rectangle(&border).ok_or(UndistortError::Nothing(id.0))?
        } else {
            let low = border.iter().copied().reduce(DVec2::min);
            let high = border.iter().copied().reduce(DVec2::max);
            low.zip(high).ok_or(UndistortError::Nothing(id.0))?
        };
        // 2. In whole pixels, as large on the axis as they were.
        let focal = lens.focal * (lens.mean_focal() / (lens.focal.x * lens.focal.y).sqrt());
        let extent = (high - low) * focal;
        // A rounding error below a whole number is no reason to lose a row.
        let size = (extent + 1e-6).floor();
        if !size.cmpge(DVec2::ONE).all() {
            return Err(UndistortError::Nothing(id.0));
        }
        let most = (MOST_TIMES * photo_size).min(DVec2::splat(LONGEST_SIDE));
        if !size.cmple(most).all() {
            return Err(UndistortError::TooLarge {
                camera_id: id.0,
                camera: camera.clone(),
                width: size.x,
                height: size.y,
            });
        }
        let principal = -low * focal - 0.5 * (extent - size);
        whole.pinhole = Lens::pinhole(focal, principal);
        whole.size = (size.x as u32, size.y as u32);
        Ok(whole)
    }

    /// Whether the photo is a pinhole's already.
    pub fn is_identity(&self) -> bool {
        self.lens.distortion() == Distortion::None
    }

    /// The photo's lens.
    pub fn lens(&self) -> &Lens {
        &self.lens
    }

    /// The pinhole camera.
    pub fn camera(&self) -> Camera {
        let Lens {
            focal, principal, ..
        } = self.pinhole;
        Camera {
            model: ModelKind::Pinhole,
            width: self.size.0,
            height: self.size.1,
            params: vec![focal.x, focal.y, principal.x, principal.y],
        }
    }

    /// Where a pixel of the undistorted picture was in the photo; `None` where that is
    /// outside it.
    pub fn in_photo(&self, undistorted: Pixel) -> Option<PlaceInPhoto> {
        let Lens {
            focal, principal, ..
        } = self.pinhole;
        let point = (DVec2::new(undistorted.x, undistorted.y) - principal) / focal;
        let projected = self.lens.project_with_gradients(point.extend(1.0))?;
        let pixel = projected.pixel;
        let inside = (0.0..=self.photo_size.x).contains(&pixel.x)
            && (0.0..=self.photo_size.y).contains(&pixel.y);
        let [by_x, by_y] = projected.gradients.map(|g| g.truncate() / focal);
        inside.then_some(PlaceInPhoto {
            pixel,
            jacobian: DMat2::from_cols(by_x, by_y).transpose(),
        })
    }

    /// Where a pixel of the photo is in the undistorted picture, or beside it; `None` for
    /// what a pinhole camera cannot see.
    pub fn undistorted(&self, in_photo: Pixel) -> Option<Pixel> {
        self.pinhole.project(self.lens.unproject(in_photo)?)
    }

    /// Whether every pixel of the undistorted picture was in the photo.
    pub fn is_filled(&self) -> bool {
        let (width, height) = self.size;
        (0..height).all(|row| {
            (0..width).all(|column| self.in_photo(Pixel::center_of(column, row)).is_some())
        })
    }

    /// The furthest that a picture through this lens may reach.
    fn reach(&self) -> f64 {
        let limit = self.lens.limit();
        let limit = match self.lens.distortion() {
            Distortion::None | Distortion::Rational { .. } | Distortion::Tilted { .. } => limit,
            _ if limit < std::f64::consts::FRAC_PI_2 => limit.tan(),
            _ => f64::INFINITY,
        };
        limit.min(MAX_SLOPE)
    }

    /// The photo's border on the plane at distance 1, no further out than the reach.
    fn border(&self) -> Vec<DVec2> {
        let reach = self.reach();
        let on_plane = |at: DVec2| {
            let ray = self.lens.unproject(Pixel::new(at.x, at.y));
            let point = ray.filter(|ray| ray.z > 0.0).map(|r| r.truncate() / r.z);
            point.map_or_else(
                || {
                    let outwards = (at - self.lens.principal) / self.lens.focal;
                    outwards * (reach / outwards.abs().max_element())
                },
                |point| point.clamp(DVec2::splat(-reach), DVec2::splat(reach)),
            )
        };
        let size = self.photo_size;
        let steps = (0..=BORDER_SAMPLES).map(|i| f64::from(i) / f64::from(BORDER_SAMPLES));
        steps
            .flat_map(|t| {
                let (x, y) = (t * size.x, t * size.y);
                [
                    DVec2::new(x, 0.0),
                    DVec2::new(x, size.y),
                    DVec2::new(0.0, y),
                    DVec2::new(size.x, y),
                ]
            })
            .map(on_plane)
            .collect()
    }
}

/// The largest rectangle along the axes that holds the origin and none of the points of a
/// curve around it; `None` where the curve does not surround the origin.
fn largest_rectangle(curve: &[DVec2]) -> Option<(DVec2, DVec2)> {
    // For each bottom (or top), how far the rectangle may reach left and right.
    let bounds = |sign: f64| {
        let mut points: Vec<DVec2> = curve
            .iter()
            .map(|p| DVec2::new(p.x, p.y * sign))
            .filter(|p| p.y >= 0.0)
            .collect();
        points.sort_by(|a, b| a.y.total_cmp(&b.y));
        let (mut left, mut right) = (f64::NEG_INFINITY, f64::INFINITY);
        let bound = |p: DVec2| {
            let bound = (p.y, left, right);
            if p.x < 0.0 {
                left = left.max(p.x);
            } else {
                right = right.min(p.x);
            }
            bound
        };
        points.into_iter().map(bound).collect::<Vec<_>>()
    };
    let (above, below) = (bounds(-1.0), bounds(1.0));
    let mut best = None;
    let mut best_area = 0.0;
    for &(top, left_above, right_above) in &above {
        for &(bottom, left_below, right_below) in &below {
            let (left, right) = (left_above.max(left_below), right_above.min(right_below));
            let area = (right - left) * (top + bottom);
            if area.is_finite() && area > best_area && left < 0.0 && right > 0.0 {
                best_area = area;
                best = Some((DVec2::new(left, -top), DVec2::new(right, bottom)));
            }
        }
    }
    best
}

/// The reconstruction as its undistorted photos have it, and how each camera's photos are
/// undistorted.
///
/// Poses and points stay. Keypoints move with what they show; those that no pinhole camera
/// can see go, also from their points' tracks, and a point goes that loses all but one of its
/// observations so, be they of one image or several. The points' errors are computed anew where they were known.
///
/// # Errors
/// A camera that has no undistorted picture.
pub fn undistort(
    reconstruction: &Reconstruction,
) -> Result<(Reconstruction, BTreeMap<CameraId, Undistortion>), UndistortError> {
    let mut whole = reconstruction.clone();
    let mut undistortions = BTreeMap::new();
    for (&id, camera) in &mut whole.cameras {
        let undistortion = Undistortion::new(id, camera)?;
        *camera = undistortion.camera();
        undistortions.insert(id, undistortion);
    }

    // 1. Keypoints, and what the tracks call them from now on.
    let mut renumbered = BTreeMap::new();
    for (&id, image) in &mut whole.images {
        let undistortion = &undistortions[&image.camera_id];
        let mut moved = Vec::with_capacity(image.keypoints.len());
        for (old_idx, keypoint) in image.keypoints.iter().enumerate() {
            if let Some(Pixel { x, y }) =
                undistortion.undistorted(Pixel::new(keypoint.x, keypoint.y))
            {
                renumbered.insert((id, old_idx as u32), moved.len() as u32);
                let point = keypoint.point;
                moved.push(Keypoint { x, y, point });
            }
        }
        image.keypoints = moved;
    }
    whole.points.retain(|_, point| {
        let seen_before = point.track.len();
        point.track = point
            .track
            .iter()
            .filter_map(|&(id, old_idx)| Some((id, *renumbered.get(&(id, old_idx))?)))
            .collect();
        point.track.len() == seen_before || point.track.len() >= 2
    });
    for keypoint in whole.images.values_mut().flat_map(|i| &mut i.keypoints) {
        keypoint.point = keypoint.point.filter(|id| whole.points.contains_key(id));
    }

    // 2. The points' errors, in the new pixels.
    for point in whole.points.values_mut().filter(|p| p.error_px >= 0.0) {
        let errors = point.track.iter().filter_map(|&(id, keypoint_idx)| {
            let image = &whole.images[&id];
            let keypoint = image.keypoints[keypoint_idx as usize];
            let pinhole = &undistortions[&image.camera_id].pinhole;
            let projected = pinhole.project(image.camera_from_world * point.position)?;
            Some(projected.distance(Pixel::new(keypoint.x, keypoint.y)))
        });
        let (sum, count) = errors.fold((0.0, 0_u32), |(sum, n), error| (sum + error, n + 1));
        if count > 0 {
            point.error_px = sum / f64::from(count);
        }
    }
    Ok((whole, undistortions))
}
