//! Photos of a turntable's object, without a calibration.

use crate::run::{files, lumigraph, with_wall};
use crate::turned::turn;
use datasets::{Dataset, Options, by_name, render_view};
use image::{DynamicImage, Rgb, RgbImage};
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// From photo to photo.
const STEP: usize = 15;

fn car() -> Dataset {
    let options = Options {
        size: Some((320, 240)),
        views: Some(360 / STEP),
        samples_per_side: Some(2),
    };
    by_name("car", &options).unwrap()
}

/// The focal length of a scene's only camera.
fn focal(folder: &Path, scene: &str) -> f64 {
    let info = lumigraph(folder, &format!("info {scene} --json"))
        .ok()
        .json();
    assert_eq!(info["cameras"].as_array().unwrap().len(), 1);
    assert_eq!(info["points"], 0);
    assert_eq!(info["proxy"]["kind"], "hull");
    info["cameras"][0]["params"][0].as_f64().unwrap()
}

fn scene_json(folder: &Path, scene: &str) -> serde_json::Value {
    serde_json::from_slice(&fs::read(folder.join(scene).join("scene.json")).unwrap()).unwrap()
}

#[test]
fn a_turntable_needs_no_calibration() {
    let here = tempfile::tempdir().unwrap();
    let folder = here.path();
    datasets::write(&car(), &folder.join("car")).unwrap();
    lumigraph(folder, "import car -o calibrated").ok();
    // What scores that needs a calibration; each scene is measured in its own world.
    let psnr = |scene: &str| {
        let line = format!("evaluate {scene} --every 6 --proxy hull --json");
        let result = lumigraph(folder, &line).ok().json();
        assert_eq!(result["photos"].as_array().unwrap().len(), 4);
        result["mean"]["psnr"].as_f64().unwrap()
    };
    let with_truth = psnr("calibrated");

    fs::remove_dir_all(folder.join("car/sparse")).unwrap();
    let ran = lumigraph(folder, &format!("import car --turntable {STEP} -o scene")).ok();
    assert!(ran.stderr.contains("focal length"), "{}", ran.stderr);
    // Depth in metres is of no use in a world whose unit is the circle's radius.
    assert!(!ran.stdout.contains("depth maps"), "{}", ran.stdout);
    let found = focal(folder, "scene");
    assert!((found / 480.0 - 1.0).abs() < 0.02, "{found}");
    let without = psnr("scene");
    println!("focal length {found:.2} of 480 px; {without:.2} dB, {with_truth:.2} with the truth");
    assert!(without > with_truth - 1.5, "{without} {with_truth}");

    // An ordinary scene, whose proxy is chosen once.
    lumigraph(folder, "proxy scene auto").ok();
    lumigraph(folder, "render scene --path orbit --frames 2 -o frames").ok();
    assert!(folder.join("frames/frame_0001.png").exists());
    lumigraph(folder, "export scene --format transforms -o t.json").ok();
    lumigraph(
        folder,
        "evaluate scene --every 6 --size 80x60 --proxy plane",
    )
    .ok();
    assert_eq!(
        scene_json(folder, "scene")["settings"]["turntable_degrees"],
        15.0
    );
}

/// The car before a grey sheet, in the order of its photos reversed, under names whose numbers
/// have no leading zeros.
fn before_a_sheet(folder: &TempDir) -> PathBuf {
    let dataset = car();
    let photos = folder.path().join("photos");
    fs::create_dir(&photos).unwrap();
    let last = dataset.photos.len();
    for (i, photo) in dataset.photos.iter().enumerate() {
        let picture = DynamicImage::from(render_view(&dataset.scene, &photo.view, 1)).into_rgba8();
        let sheet = RgbImage::from_fn(320, 240, |x, y| {
            let noise = (x * 7919 + y * 104_729) % 5;
            let [r, g, b, alpha] = picture.get_pixel(x, y).0;
            if alpha > 0 {
                Rgb([r, g, b])
            } else {
                Rgb([180 + noise as u8, 200, 210])
            }
        });
        sheet
            .save(photos.join(format!("p{}.png", last - i)))
            .unwrap();
    }
    photos
}

#[test]
fn a_plain_background_will_do_and_the_table_may_turn_either_way() {
    let here = tempfile::tempdir().unwrap();
    let folder = here.path();
    let photos = before_a_sheet(&here);
    let line = format!("import photos --turntable -{STEP} -o scene");
    lumigraph(folder, &line).ok();
    let found = focal(folder, "scene");
    assert!((found / 480.0 - 1.0).abs() < 0.02, "{found}");
    // The silhouettes that were found are kept, and serve the hull.
    let of_p10 = folder.join("scene/silhouettes/p10.png.png");
    assert!(of_p10.exists());
    let json = scene_json(folder, "scene");
    assert_eq!(json["photos"][1]["silhouette"], "silhouettes/p10.png.png");
    lumigraph(folder, "proxy scene hull").ok();
    let before = files(&folder.join("scene"));
    lumigraph(folder, &format!("{line} --force")).ok();
    assert_eq!(files(&folder.join("scene")).keys().count(), before.len());

    // One that cannot be decoded is left out, and the others stay where they are.
    let bytes = fs::read(photos.join("p7.png")).unwrap();
    fs::write(photos.join("p7.png"), &bytes[..bytes.len() / 2]).unwrap();
    let ran = lumigraph(folder, &format!("{line} --force")).ok();
    assert!(
        ran.stderr.contains("warning: photo p7.png is left out"),
        "{}",
        ran.stderr
    );
    let found = focal(folder, "scene");
    assert!((found / 480.0 - 1.0).abs() < 0.02, "{found}");
    let error = lumigraph(folder, &format!("{line} --strict --force")).error(1);
    assert!(error.contains("p7.png"), "{error}");
    fs::write(photos.join("p7.png"), bytes).unwrap();

    // What is no such circle is told, with a remedy, and leaves nothing; and what may be why.
    turn(&photos.join("p1.png"));
    let turned = "; 1 of 24 photos are stored turned or mirrored (EXIF orientation; 6 in p1.png, for one): \
                  photos must stand upright, as `mogrify -auto-orient` makes them";
    for (step, said) in [("-11", "the step"), ("15", "turn the step's sign")] {
        let error = lumigraph(folder, &format!("import photos --turntable {step} -o no")).error(1);
        assert!(
            error.starts_with("photos: no turntable's cameras"),
            "{error}"
        );
        assert!(error.contains(said), "{step}: {error}");
        assert!(error.ends_with(turned), "{error}");
        assert!(!folder.join("no").exists());
    }
    // Another size; then too few.
    let small = RgbImage::new(160, 120);
    small.save(photos.join("p8.png")).unwrap();
    let error = lumigraph(folder, &line.replace("-o scene", "-o no")).error(1);
    assert!(
        error.starts_with("photos/p8.png: the photo has 160 × 120"),
        "{error}"
    );
    for i in 4..=24 {
        fs::remove_file(photos.join(format!("p{i}.png"))).unwrap();
    }
    let error = lumigraph(folder, &line.replace("-o scene", "-o no")).error(1);
    assert!(error.contains("a turntable needs 4"), "{error}");
    assert!(!folder.join("no").exists());
}

#[test]
fn what_is_no_turntable_is_told() {
    let folder = with_wall();
    for (line, said) in [
        ("import wall --turntable 0 -o s", "0.1 to 120 degrees"),
        ("import wall --turntable -200 -o s", "0.1 to 120 degrees"),
        ("import wall --turntable NaN -o s", "0.1 to 120 degrees"),
        (
            "import wall --turntable 10 --calibration wall -o s",
            "cannot be used with",
        ),
        (
            "import wall --turntable 10 --undistort -o s",
            "cannot be used with",
        ),
        (
            "import wall --turntable 10 --frames 20 -o s",
            "cannot be used with",
        ),
        (
            "import wall/README.md --turntable 10 -o s",
            "a folder of photos",
        ),
    ] {
        let ran = lumigraph(folder.path(), line);
        assert_eq!(ran.code, 2, "{line}: {}", ran.stderr);
        assert!(ran.stderr.contains(said), "{line}: {}", ran.stderr);
    }
    // A photo that is missing moves all after it.
    let has_gap = |said: &str| {
        said.contains("0003.png is followed by 0005.png: each photo counts as one step")
    };
    fs::rename(
        folder.path().join("wall/images/0004.png"),
        folder.path().join("0004.png"),
    )
    .unwrap();
    let mattes = folder.path().join("mattes");
    fs::create_dir(&mattes).unwrap();
    let matte = |i: usize| mattes.join(format!("{i:04}.png"));
    let object = image::GrayImage::from_fn(96, 72, |x, y| {
        let is_in = (30..60).contains(&x) && (20..50).contains(&y);
        image::Luma([if is_in { 255 } else { 0 }])
    });
    (0..9).for_each(|i| object.save(matte(i)).unwrap());
    let line = "import wall --turntable 10 --mattes mattes -o t --force";
    let said = lumigraph(folder.path(), line).stderr;
    assert!(has_gap(&said), "{said}");
    fs::write(folder.path().join("wall/images/0004.png"), "").unwrap();
    let said = lumigraph(folder.path(), line).stderr;
    assert!(!has_gap(&said), "{said}");
    fs::rename(
        folder.path().join("0004.png"),
        folder.path().join("wall/images/0004.png"),
    )
    .unwrap();
    // Bricks are no background.
    let error = lumigraph(folder.path(), "import wall --turntable 10 -o s").error(1);
    assert!(
        error.starts_with("photo 000") && error.contains("--mattes"),
        "{error}"
    );
    let error = lumigraph(folder.path(), "import nowhere --turntable 10 -o s").error(1);
    assert!(error.starts_with("nowhere: "), "{error}");
    assert!(!folder.path().join("s").exists());
}
