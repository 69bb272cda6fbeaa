//! Whether a calibration fits its photos at all.

use super::Warning;
use calibrate::Reconstruction;

/// Structure from motion misses what it measured by a pixel or less. What misses it by so many belongs to other
/// photos, or counts pixels another way than was read.
const DOUBTFUL_PX: f64 = 10.0;

/// Says so where sparse points are seen far from where the cameras have them: nothing else tells of poses whose
/// pixels, axes or lenses were taken for what they are not.
pub(super) fn of(whole: &Reconstruction) -> Option<Warning> {
    let median_px = whole.median_error_px()?;
    if median_px <= DOUBTFUL_PX {
        return None;
    }
    let problem = if median_px.is_finite() {
        format!(
            "photos see the sparse points {median_px:.0} pixels (the median) from where the calibration has them"
        )
    } else {
        "most sparse points lie behind the cameras that see them".to_owned()
    };
    Some(Warning::Note(format!(
        "{problem}: pictures will be wrong; check that the calibration belongs to these photos, or export it \
         again in another format"
    )))
}

#[cfg(test)]
mod tests {
    use super::*;
    use calibrate::{
        Camera, CameraId, Image, ImageId, Keypoint, ModelKind, Point3D, Point3DId, Rigid3,
    };
    use glam::DVec3;

    /// A point in the middle of a photo, at a depth, seen by so many pixels to the right.
    fn seen(depth: f64, off_px: f64) -> Reconstruction {
        let mut whole = Reconstruction::default();
        let camera = Camera {
            model: ModelKind::SimplePinhole,
            width: 100,
            height: 100,
            params: vec![100.0, 50.0, 50.0],
        };
        let point = Point3D {
            position: DVec3::new(0.0, 0.0, depth),
            color: [0; 3],
            error_px: -1.0,
            track: vec![(ImageId(1), 0)],
        };
        let image = Image {
            name: "a.jpg".to_owned(),
            camera_id: CameraId(1),
            camera_from_world: Rigid3::IDENTITY,
            keypoints: vec![Keypoint {
                x: 50.0 + off_px,
                y: 50.0,
                point: Some(Point3DId(1)),
            }],
        };
        whole.cameras.insert(CameraId(1), camera);
        whole.points.insert(Point3DId(1), point);
        whole.images.insert(ImageId(1), image);
        whole
    }

    #[test]
    fn what_misses_by_tens_of_pixels_is_told() {
        assert_eq!(of(&seen(2.0, 9.0)), None);
        assert_eq!(of(&Reconstruction::default()), None);
        let note = of(&seen(2.0, 31.0)).unwrap().to_string();
        assert_eq!(
            note,
            "photos see the sparse points 31 pixels (the median) from where the calibration has \
             them: pictures will be wrong; check that the calibration belongs to these photos, or \
             export it again in another format"
        );
        let behind = of(&seen(-2.0, 0.0)).unwrap().to_string();
        assert!(
            behind.starts_with("most sparse points lie behind"),
            "{behind}"
        );
    }
}
