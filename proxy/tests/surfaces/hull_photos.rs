//! Visual hulls of real captures, and what photos tell of themselves: backgrounds and turntables.

use crate::hull::{CAR, Capture, is_closed};
use calibrate::View;
use datasets::Options as Scene;
use proxy::hull::{Options, Silhouette, TurntableError, carve, plain_background, turntable};
use std::path::{Path, PathBuf};

/// A real capture with masks, without the photos held out.
fn captured(name: &str) -> Option<Capture> {
    let folder: PathBuf = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/captures");
    let folder = folder.join(name);
    if !folder.is_dir() {
        eprintln!("SKIPPED: {} is absent", folder.display());
        return None;
    }
    let model = calibrate::colmap::read_model(&folder.join("sparse/0")).unwrap();
    let split = std::fs::read_to_string(folder.join("split.json")).unwrap();
    let (mut views, mut silhouettes) = (Vec::new(), Vec::new());
    for image in model.images.values().filter(|i| !split.contains(&i.name)) {
        let file = folder.join("masks").join(format!("{}.png", image.name));
        let file = if file.exists() {
            file
        } else {
            folder.join("masks").join(&image.name)
        };
        let mask = image::open(file).unwrap().into_luma8();
        let (width, height) = mask.dimensions();
        views.push(View {
            lens: model.cameras[&image.camera_id].lens().unwrap(),
            width,
            height,
            camera_from_world: image.camera_from_world,
        });
        silhouettes.push(Silhouette::from_values(width, height, mask.as_raw()).unwrap());
    }
    Some(Capture { views, silhouettes })
}

/// Masks that contradict one another get the misses they need, others none.
#[test]
fn real_masks_carve_real_hulls() {
    for (name, misses, coverage, iou) in [("lego", 0, 0.999, 0.96), ("temple-ring", 1, 0.98, 0.95)]
    {
        let Some(capture) = captured(name) else {
            continue;
        };
        let options = Options {
            faces: None,
            ..Options::default()
        };
        let hull = carve(&capture.views, &capture.silhouettes, &options).unwrap();
        assert!(is_closed(&hull.mesh), "{name}");
        let carved = hull.carved;
        assert_eq!(hull.misses, misses, "{name}: {carved:?}");
        assert!(carved.coverage >= coverage, "{name}: {carved:?}");
        assert!(carved.iou >= iou, "{name}: {carved:?}");
    }
}

/// However many holes contradictions leave, few faces follow the hull, cover no less, and are
/// worth looking at. Cells are large for the sake of time.
#[test]
fn real_hulls_come_down_to_few_faces() {
    for (name, cell_px, iou) in [("lego", 5.0, 0.8), ("temple-ring", 7.0, 0.75)] {
        let Some(capture) = captured(name) else {
            continue;
        };
        let options = Options {
            cell_px,
            ..Options::default()
        };
        let hull = carve(&capture.views, &capture.silhouettes, &options).unwrap();
        let (carved, measures) = (hull.carved, hull.measures);
        println!("{name}: {carved:?}, {measures:?}");
        assert!(is_closed(&hull.mesh), "{name}");
        assert!(measures.faces <= 500, "{name}: {measures:?}");
        assert!(measures.coverage >= carved.coverage, "{name}: {measures:?}");
        assert!(measures.iou >= iou, "{name}: {measures:?}");
    }
}

#[test]
fn turntables_are_found_without_calibration() {
    let (_, capture) = &*CAR;
    let found = turntable(&capture.silhouettes, 10.0).unwrap();
    assert!(
        (found.focal_px / 960.0 - 1.0).abs() < 0.02,
        "{}",
        found.focal_px
    );
    assert!((found.elevation - 0.30).abs() < 0.01, "{}", found.elevation);
    assert!(found.error_px < 1.0);
    let hull = carve(&found.views, &capture.silhouettes, &Options::default()).unwrap();
    assert!(hull.carved.coverage > 0.995, "{:?}", hull.carved);
    assert!(hull.carved.iou > 0.96, "{:?}", hull.carved);
    // Half a circle of fewer photos does, too.
    let half: Vec<Silhouette> = capture
        .silhouettes
        .iter()
        .take(19)
        .step_by(2)
        .cloned()
        .collect();
    let found = turntable(&half, 20.0).unwrap();
    assert!(
        (found.focal_px / 960.0 - 1.0).abs() < 0.04,
        "{}",
        found.focal_px
    );
}

#[test]
fn what_is_no_turntable_is_refused() {
    let (_, capture) = &*CAR;
    assert!(turntable(&capture.silhouettes, 7.0).is_err());
    assert!(turntable(&capture.silhouettes, -10.0).is_err());
    let few = turntable(&capture.silhouettes[..3], 10.0).unwrap_err();
    assert_eq!(
        few,
        TurntableError::Few {
            photos: 3,
            usable: 3
        }
    );
    assert!(matches!(
        turntable(&capture.silhouettes, 0.0),
        Err(TurntableError::Step { .. })
    ));
}

#[test]
fn plain_backgrounds_are_told_from_others() {
    let (dataset, capture) = &*CAR;
    let (view, truth) = (&capture.views[3], &capture.silhouettes[3]);
    let photo = datasets::render_view(&dataset.scene, view, 1);
    // A grey-blue sheet, darker towards one corner, and noise.
    let mut rgb = Vec::new();
    for (x, y, pixel) in photo.enumerate_pixels() {
        let noise = f64::from((x * 7919 + y * 104_729 + x * y * 31) % 9) - 4.0;
        let light = 1.0 - 0.1 * f64::from(x) / 640.0 - 0.1 * f64::from(y) / 480.0;
        for c in 0..3 {
            let sheet = [190.0, 200.0, 215.0][c] * light + noise;
            rgb.push(if pixel.0[3] > 0 {
                pixel.0[c]
            } else {
                sheet as u8
            });
        }
    }
    let found = plain_background(640, 480, &rgb).unwrap();
    let pairs = || found.inside().iter().zip(truth.inside());
    let both = pairs().filter(|(a, b)| **a && **b).count();
    let either = pairs().filter(|(a, b)| **a || **b).count();
    let iou = both as f64 / either as f64;
    assert!(iou > 0.98, "{iou}");
    // Bricks are not plain; an empty sheet has nothing before it.
    let scene = Scene {
        views: Some(2),
        samples_per_side: Some(1),
        ..Scene::default()
    };
    let wall = datasets::by_name("wall", &scene).unwrap();
    let bricks = datasets::render_view(&wall.scene, &wall.photos[0].view, 1);
    let bricks = image::DynamicImage::from(bricks).into_rgb8();
    let error = plain_background(480, 360, bricks.as_raw()).unwrap_err();
    assert!(
        error.to_string().starts_with("the background is not plain"),
        "{error}"
    );
    let empty = plain_background(64, 48, &[200; 64 * 48 * 3]).unwrap_err();
    assert_eq!(
        empty.to_string(),
        "0.0 % of the photo differs from its border's colour, too little for an object before \
         a plain background; give masks"
    );
    assert!(plain_background(64, 48, &[]).is_err());
}
