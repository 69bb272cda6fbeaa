//! The pinhole camera that takes a lens's place.

use calibrate::undistort::{MAX_SLOPE, UndistortError, Undistortion, undistort};
use calibrate::{
    Camera, CameraId, Image, ImageId, Keypoint, ModelKind, Pixel, Point3D, Point3DId,
    Reconstruction, Rigid3, colmap,
};
use glam::{DQuat, DVec2, DVec3};
use std::path::Path;

fn camera(model: ModelKind, params: &[f64]) -> Camera {
    Camera {
        model,
        width: 640,
        height: 480,
        params: params.to_vec(),
    }
}

fn of(camera: &Camera) -> Undistortion {
    Undistortion::new(CameraId(1), camera).unwrap()
}

/// Lenses that see no further than the largest slope, bent every way.
fn moderate() -> Vec<Camera> {
    use ModelKind::*;
    vec![
        camera(SimpleRadial, &[500.0, 320.0, 240.0, -0.2]),
        camera(SimpleRadial, &[500.0, 300.0, 260.0, 0.2]),
        camera(
            OpenCv,
            &[510.0, 480.0, 310.0, 250.0, -0.25, 0.05, 1e-3, 2e-3],
        ),
        camera(Fov, &[400.0, 400.0, 320.0, 240.0, 0.9]),
        camera(Division, &[500.0, 510.0, 320.0, 240.0, -0.2]),
        camera(Fisheye, &[500.0, 500.0, 320.0, 240.0]),
        camera(Eucm, &[400.0, 400.0, 320.0, 240.0, 0.5, 1.1]),
        camera(
            ThinPrismFisheye,
            &[
                500.0, 500.0, 320.0, 240.0, 0.01, 0.0, 1e-3, 1e-3, 0.0, 0.0, 1e-3, 1e-3,
            ],
        ),
    ]
}

fn wide() -> Vec<Camera> {
    vec![
        // 141° across the photo's width and 106° across its height; 180° across its height.
        camera(ModelKind::Fisheye, &[260.0, 260.0, 320.0, 240.0]),
        camera(ModelKind::SimpleFisheye, &[152.8, 320.0, 240.0]),
        // An OpenCV lens that folds over within the photo.
        camera(
            ModelKind::OpenCv,
            &[400.0, 400.0, 320.0, 240.0, -0.6, 0.0, 0.0, 0.0],
        ),
    ]
}

#[test]
fn a_sensor_that_is_hardly_tilted_reaches_as_far_as_one_that_is_not() {
    // It folds over within the photo.
    let own = [400.0, 400.0, 320.0, 240.0, -0.6, 0.0, 0.0, 0.0];
    let straight = of(&camera(ModelKind::OpenCv, &own)).camera();
    let rest = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1e-12, 0.0];
    let params = [&own[..], &rest[..]].concat();
    let tilted = of(&camera(ModelKind::OpenCvTilted, &params)).camera();
    let size = |camera: &Camera| (camera.width, camera.height);
    assert_eq!(size(&tilted), size(&straight));
}

#[test]
fn there_and_back_is_the_same_pixel() {
    for camera in [moderate(), wide()].concat() {
        let undistortion = of(&camera);
        let size = undistortion.camera();
        for column in (0..size.width).step_by(37) {
            for row in (0..size.height).step_by(31) {
                let pixel = Pixel::center_of(column, row);
                let Some(place) = undistortion.in_photo(pixel) else {
                    continue;
                };
                let back = undistortion.undistorted(place.pixel).unwrap();
                assert!(back.distance(pixel) < 1e-6, "{camera:?}, {pixel:?}");

                let h = 1e-4;
                for (j, step) in [DVec2::new(h, 0.0), DVec2::new(0.0, h)]
                    .into_iter()
                    .enumerate()
                {
                    let moved = |sign: f64| {
                        let at = Pixel::new(pixel.x + sign * step.x, pixel.y + sign * step.y);
                        undistortion.in_photo(at).map(|p| p.pixel)
                    };
                    if let (Some(a), Some(b)) = (moved(1.0), moved(-1.0)) {
                        let slope = DVec2::new(a.x - b.x, a.y - b.y) / (2.0 * h);
                        let off = (slope - place.jacobian.col(j)).length();
                        assert!(off < 1e-5, "{camera:?}, {pixel:?}: {off}");
                    }
                }
            }
        }
    }
}

#[test]
fn the_axis_keeps_its_resolution() {
    for camera in [moderate(), wide()].concat() {
        let undistortion = of(&camera);
        let new = undistortion.camera();
        let axis = Pixel::new(new.params[2], new.params[3]);
        let place = undistortion.in_photo(axis).unwrap();
        let principal = camera.lens().unwrap().principal;
        assert!(place.pixel.distance(Pixel::new(principal.x, principal.y)) < 1e-9);
        let area = place.jacobian.determinant();
        assert!((area - 1.0).abs() < 1e-6, "{camera:?}: {area}");
    }
}

#[test]
fn the_photo_fills_the_picture_and_no_larger_one() {
    for camera in moderate() {
        let undistortion = of(&camera);
        assert!(undistortion.is_filled(), "{camera:?}");
        // Two pixels further out on any side, something of that side is missing.
        let new = undistortion.camera();
        let (w, h) = (f64::from(new.width), f64::from(new.height));
        let missing = |at: &dyn Fn(f64) -> Pixel| {
            (0..=1000).any(|i| undistortion.in_photo(at(f64::from(i) / 1000.0)).is_none())
        };
        let sides = [
            missing(&|t| Pixel::new(-2.0, t * h)),
            missing(&|t| Pixel::new(w + 2.0, t * h)),
            missing(&|t| Pixel::new(t * w, -2.0)),
            missing(&|t| Pixel::new(t * w, h + 2.0)),
        ];
        assert_eq!(sides, [true; 4], "{camera:?} as {new:?}");
    }
}

#[test]
fn wide_lenses_end_at_the_largest_slope() {
    for camera in wide() {
        let new = of(&camera).camera();
        let lens = new.lens().unwrap();
        let low = -lens.principal / lens.focal;
        let high =
            (DVec2::new(f64::from(new.width), f64::from(new.height)) - lens.principal) / lens.focal;
        assert!(low.min_element() > -MAX_SLOPE - 1e-9 && high.max_element() < MAX_SLOPE + 1e-9);
    }
    // 180° across the height of the photo: the whole square is seen.
    assert!(of(&wide()[1]).is_filled());
    let square = of(&wide()[1]).camera();
    let side = (2.0 * MAX_SLOPE * 152.8).floor();
    assert_eq!(
        (f64::from(square.width), f64::from(square.height)),
        (side, side)
    );
    assert!(!of(&wide()[0]).is_filled());
    assert!(!of(&wide()[2]).is_filled());
}

#[test]
fn a_pinhole_stays_as_it_is() {
    let pinhole = camera(ModelKind::SimplePinhole, &[500.0, 321.0, 239.0]);
    let undistortion = of(&pinhole);
    assert!(undistortion.is_identity() && undistortion.is_filled());
    let new = undistortion.camera();
    assert_eq!(
        (new.width, new.height, new.params),
        (640, 480, vec![500.0, 500.0, 321.0, 239.0])
    );
}

#[test]
fn what_has_no_undistorted_picture_is_refused() {
    let all_round = camera(ModelKind::Equirectangular, &[640.0, 480.0]);
    assert_eq!(
        Undistortion::new(CameraId(7), &all_round)
            .unwrap_err()
            .to_string(),
        "camera 7 is EQUIRECTANGULAR: no pinhole picture holds what it sees all round; cut its \
         panoramas into views first"
    );
    let beside = camera(ModelKind::SimpleRadial, &[500.0, -3000.0, 240.0, -0.01]);
    assert_eq!(
        Undistortion::new(CameraId(7), &beside),
        Err(UndistortError::Nothing(7))
    );
}

/// A distortion that no lens has would fill terabytes.
#[test]
fn a_picture_many_times_as_large_as_its_photo_is_refused() {
    let absurd = camera(
        ModelKind::InverseRadial,
        &[1e6, 1e6, 320.0, 240.0, 100_000_000_000.0],
    );
    assert_eq!(
        Undistortion::new(CameraId(7), &absurd)
            .unwrap_err()
            .to_string(),
        "camera 7 is INVERSE_RADIAL with the parameters 1000000, 1000000, 320, 240, 100000000000: \
         without this distortion its photos of 640 × 480 pixels would become 3464101 × 3464101, \
         expected at most 8 times the sides and 65,535 pixels; check its focal length and its \
         distortion, or calibrate again with fewer coefficients"
    );
    // The side alone of a photo that is large itself.
    let large = Camera {
        width: 40_000,
        ..camera(
            ModelKind::InverseRadial,
            &[1e5, 1e5, 20_000.0, 240.0, 100.0],
        )
    };
    let error = Undistortion::new(CameraId(7), &large).unwrap_err();
    assert!(
        matches!(error, UndistortError::TooLarge { width, .. } if width > 65_535.0),
        "{error}"
    );
}

/// Two fisheye images of points before and beside them.
fn two_images() -> Reconstruction {
    let mut whole = Reconstruction::default();
    let camera = camera(ModelKind::Fisheye, &[150.0, 150.0, 320.0, 240.0]);
    let lens = camera.lens().unwrap();
    whole.cameras.insert(CameraId(1), camera);
    for (i, position) in [
        DVec3::new(0.3, 0.2, 4.0),
        DVec3::new(5.0, 0.0, -1.0), // behind the first camera, but seen by the fisheye
        DVec3::new(-1.0, 0.5, 3.0),
    ]
    .into_iter()
    .enumerate()
    {
        let point = Point3D {
            position,
            color: [1, 2, 3],
            error_px: [0.5, 0.5, -1.0][i],
            track: Vec::new(),
        };
        whole.points.insert(Point3DId(i as u64), point);
    }
    for i in 0..2 {
        let camera_from_world = Rigid3::new(DQuat::IDENTITY, DVec3::X * f64::from(i));
        let mut keypoints = Vec::new();
        for (&id, point) in &mut whole.points {
            let pixel = lens.project(camera_from_world * point.position).unwrap();
            point.track.push((ImageId(i), keypoints.len() as u32));
            keypoints.push(Keypoint {
                x: pixel.x + 0.4,
                y: pixel.y,
                point: Some(id),
            });
        }
        let image = Image {
            name: format!("{i}.jpg"),
            camera_id: CameraId(1),
            camera_from_world,
            keypoints,
        };
        whole.images.insert(ImageId(i), image);
    }
    whole
}

#[test]
fn observations_move_with_what_they_show() {
    let before = two_images();
    let (after, _) = undistort(&before).unwrap();
    // What only a fisheye sees is gone, and everything refers to what it referred to.
    let ids: Vec<u64> = after.points.keys().map(|id| id.0).collect();
    assert_eq!(ids, [0, 2]);
    for (id, point) in &after.points {
        assert_eq!(point.track.len(), 2);
        for (image_id, keypoint_idx) in &point.track {
            let keypoint = after.images[image_id].keypoints[*keypoint_idx as usize];
            assert_eq!(keypoint.point, Some(*id));
        }
        assert_eq!(point.position, before.points[id].position);
    }
    // A pinhole's pixels are larger by 1/cos², here by 1 % and by 10 %, than a fisheye's.
    assert!((after.points[&Point3DId(0)].error_px - 0.42).abs() < 0.01);
    assert_eq!(after.points[&Point3DId(2)].error_px, -1.0);
    let folder = tempfile::tempdir().unwrap();
    colmap::write_binary(&after, folder.path()).unwrap();
}

#[test]
fn captures_reproject_as_they_did() {
    let captures = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/captures");
    if !captures.is_dir() {
        eprintln!("SKIPPED: {} is absent", captures.display());
        return;
    }
    for name in ["desk-sweep", "opencv-chessboard", "fern", "can-orbit"] {
        let before = colmap::read_model(&captures.join(name).join("sparse/0")).unwrap();
        let (after, undistortions) = undistort(&before).unwrap();
        let mean = |model: &Reconstruction| {
            let ids = model.cameras.keys();
            let errors: Vec<f64> = ids
                .flat_map(|id| model.reprojection_errors_px(*id).unwrap())
                .collect();
            errors.iter().sum::<f64>() / errors.len() as f64
        };
        let (was, is) = (mean(&before), mean(&after));
        let size = after.cameras.values().next().unwrap();
        println!(
            "{name}: {was:.4} px, undistorted {is:.4} px, {} × {}",
            size.width, size.height
        );
        assert!((is / was - 1.0).abs() < 0.06, "{name}: {was} and {is} px");
        assert_eq!(after.points.len(), before.points.len());
        assert!(undistortions.values().all(Undistortion::is_filled));
    }
}
