//! Small models made here.

use calibrate::{
    Camera, CameraId, Image, ImageId, Keypoint, ModelKind, Point3D, Point3DId, Reconstruction,
    Rigid3,
};
use glam::{DQuat, DVec3};

/// Two cameras, two images, two points; ids with gaps.
pub(crate) fn small() -> Reconstruction {
    let keypoint = |x, y, point: Option<u64>| Keypoint {
        x,
        y,
        point: point.map(Point3DId),
    };
    let image = |name: &str, camera, turn, keypoints| Image {
        name: name.to_owned(),
        camera_id: CameraId(camera),
        camera_from_world: Rigid3::new(DQuat::from_rotation_y(turn), DVec3::new(0.5, -1.0, 2.0)),
        keypoints,
    };
    let point = |x, track: &[(u32, u32)]| Point3D {
        position: DVec3::new(x, 2.0, 3.0),
        color: [10, 20, 30],
        error_px: 0.25,
        track: track.iter().map(|&(i, k)| (ImageId(i), k)).collect(),
    };
    let camera = |model, params: &[f64]| Camera {
        model,
        width: 640,
        height: 480,
        params: params.to_vec(),
    };
    Reconstruction {
        cameras: [
            (
                CameraId(1),
                camera(ModelKind::SimplePinhole, &[500.0, 320.0, 240.0]),
            ),
            (
                CameraId(4),
                camera(ModelKind::SimpleRadial, &[510.0, 320.0, 240.0, -0.1]),
            ),
        ]
        .into(),
        images: [
            (
                ImageId(3),
                image(
                    "a.jpg",
                    1,
                    0.1,
                    vec![
                        keypoint(10.5, 20.25, Some(7)),
                        keypoint(0.0, 1.0, None),
                        keypoint(5.0, 6.0, Some(9)),
                    ],
                ),
            ),
            (
                ImageId(8),
                image("b/c d.jpg", 4, -0.7, vec![keypoint(11.5, 21.25, Some(7))]),
            ),
        ]
        .into(),
        points: [
            (Point3DId(7), point(0.1, &[(3, 0), (8, 0)])),
            (Point3DId(9), point(-4.0, &[(3, 2)])),
        ]
        .into(),
    }
}
