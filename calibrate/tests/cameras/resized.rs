//! Cameras that follow photos of another size.

use calibrate::{
    Camera, CameraId, Image, ImageId, Keypoint, ModelKind, Pixel, Point3D, Point3DId,
    Reconstruction, Rigid3,
};
use glam::{DQuat, DVec3};
use std::collections::BTreeMap;

/// Three images, the first two by one camera; a point that the first and the third observe.
fn three(camera: Camera) -> Reconstruction {
    let other = Camera {
        model: ModelKind::Pinhole,
        width: 100,
        height: 80,
        params: vec![90.0, 95.0, 50.0, 40.0],
    };
    let image = |name: &str, id: u32| Image {
        name: name.to_owned(),
        camera_id: CameraId(id),
        camera_from_world: Rigid3::new(DQuat::IDENTITY, DVec3::ZERO),
        keypoints: vec![Keypoint {
            x: 32.0,
            y: 24.5,
            point: Some(Point3DId(1)),
        }],
    };
    let images = [image("a.png", 3), image("b.png", 3), image("c.png", 7)];
    Reconstruction {
        cameras: BTreeMap::from([(CameraId(3), camera), (CameraId(7), other)]),
        images: (1..).map(ImageId).zip(images).collect(),
        points: BTreeMap::from([(
            Point3DId(1),
            Point3D {
                position: DVec3::new(0.1, 0.2, 3.0),
                color: [1, 2, 3],
                error_px: 0.8,
                track: vec![(ImageId(1), 0), (ImageId(3), 0)],
            },
        )]),
    }
}

#[test]
fn what_a_camera_sees_is_where_it_is_in_the_stretched_photo() {
    for (model, params) in [
        (ModelKind::SimplePinhole, vec![300.0, 320.0, 240.0]),
        (ModelKind::SimpleRadial, vec![500.0, 310.0, 250.0, -0.1]),
        (
            ModelKind::OpenCv,
            vec![510.0, 480.0, 310.0, 250.0, -0.2, 0.05, 1e-3, 2e-3],
        ),
        (ModelKind::Fov, vec![400.0, 400.0, 320.0, 240.0, 0.9]),
        (ModelKind::SimpleFisheye, vec![200.0, 320.0, 240.0]),
        (
            ModelKind::OpenCvFisheye,
            vec![200.0, 210.0, 320.0, 240.0, 0.01, 0.0, 1e-3, 0.0],
        ),
        (ModelKind::Equirectangular, vec![640.0, 480.0]),
    ] {
        let camera = Camera {
            model,
            width: 640,
            height: 480,
            params,
        };
        let lens = camera.lens().unwrap();
        let mut whole = three(camera);
        // Rounded down, so that the axes' ratios differ a little; one that there is not, and one as it was.
        let sizes = [(1, (213, 160)), (3, (100, 80)), (9, (1, 1))];
        let sizes = sizes.map(|(id, size)| (ImageId(id), size));
        whole.resize_images(&BTreeMap::from(sizes)).unwrap();
        let ids: Vec<CameraId> = whole.images.values().map(|image| image.camera_id).collect();
        assert_eq!(ids, [8, 3, 7].map(CameraId));
        let resized = &whole.cameras[&CameraId(8)];
        assert_eq!((resized.width, resized.height), (213, 160));
        let resized = resized.lens().unwrap();
        let [sx, sy] = [213.0 / 640.0, 160.0 / 480.0];
        for point in [[0.0, 0.0, 1.0], [0.3, -0.2, 1.0], [-0.5, 0.4, 2.0]] {
            let point = DVec3::from_array(point);
            let was = lens.project(point).unwrap();
            let is = resized.project(point).unwrap();
            let off = is.distance(Pixel::new(was.x * sx, was.y * sy));
            assert!(off < 1e-9, "{model:?} {point}: {off}");
        }
        let keypoints: Vec<[f64; 2]> = whole
            .images
            .values()
            .map(|i| &i.keypoints[0])
            .map(|k| [k.x, k.y])
            .collect();
        assert_eq!(
            keypoints,
            [[32.0 * sx, 24.5 * sy], [32.0, 24.5], [32.0, 24.5]]
        );
        let error = whole.points[&Point3DId(1)].error_px;
        assert!((error - 0.8 * 0.5 * ((sx * sy).sqrt() + 1.0)).abs() < 1e-12);
    }
}

#[test]
fn cameras_are_shared_as_they_were_and_go_with_their_last_image() {
    let camera = Camera {
        model: ModelKind::SimplePinhole,
        width: 64,
        height: 48,
        params: vec![60.0, 32.0, 24.0],
    };
    let mut whole = three(camera.clone());
    let halves = [1, 2].map(|id| (ImageId(id), (32, 24)));
    whole.resize_images(&BTreeMap::from(halves)).unwrap();
    let ids: Vec<CameraId> = whole.images.values().map(|image| image.camera_id).collect();
    assert_eq!(ids, [8, 8, 7].map(CameraId));
    assert_eq!(whole.cameras.len(), 2);
    assert_eq!(whole.cameras[&CameraId(8)].params, [30.0, 30.0, 16.0, 12.0]);

    // What makes no lens stays as it was, and all else.
    let mut whole = three(Camera {
        params: vec![-60.0, 32.0, 24.0],
        ..camera
    });
    let before = whole.clone();
    let sizes = [(2, (32, 24)), (3, (50, 40))].map(|(id, size)| (ImageId(id), size));
    let error = whole.resize_images(&BTreeMap::from(sizes)).unwrap_err();
    assert_eq!(error.0, ImageId(2));
    assert_eq!(whole, before);
}
