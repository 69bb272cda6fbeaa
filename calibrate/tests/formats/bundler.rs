use crate::broken::damage;
use crate::captures::{capture, mean, reprojection_errors_px};
use calibrate::formats::{FormatError, read_bundler};
use calibrate::{ModelKind, Reconstruction};
use glam::DVec3;
use std::path::Path;

/// Camera 0 is not registered; camera 1 at (1, 2, 3) looks along −z with y up.
const BUNDLE: &str = "# Bundle file v0.3
2 1
0 0 0
0 0 0
0 0 0
0 0 0
0 0 0
100 -0.1 0.01
1 0 0
0 1 0
0 0 1
-1 -2 -3
2 4 -7
10 20 30
2 0 5 1 1 1 7 9.95025 19.9005
";

fn size_of(name: &str) -> Option<(u32, u32)> {
    (name != "gone.jpg").then_some((640, 480))
}

fn parse(bundle: &str, list: &str) -> Result<Reconstruction, FormatError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bundle.out");
    std::fs::write(&path, bundle).unwrap();
    std::fs::write(folder.path().join("list.txt"), list).unwrap();
    read_bundler(&path, &size_of)
}

fn error(bundle: &str, list: &str) -> String {
    let error = parse(bundle, list).unwrap_err().to_string();
    let (_, rest) = error.split_once("bundle.out, ").unwrap();
    rest.to_owned()
}

#[test]
fn platypus_reprojects_as_its_readme_states() {
    let Some(path) = capture("other-formats/bundler-platypus/bundle.out") else {
        return;
    };
    let whole = read_bundler(&path, &|_| Some((1000, 667))).unwrap();
    assert_eq!((whole.images.len(), whole.points.len()), (6, 3217));
    let error_px = mean(&reprojection_errors_px(&whole));
    println!("platypus: {error_px:.4} px");
    assert!((error_px - 0.083).abs() < 0.001, "{error_px}");
}

/// A file without line breaks is no reason to print all of it.
#[test]
fn errors_quote_only_the_beginning_of_long_lines() {
    let long = "é".repeat(100_000);
    let list = "a.jpg\nb.jpg\n";
    let shown = format!("found \"{}…\", expected", "é".repeat(40));
    for bundle in [
        long.clone(),
        BUNDLE.replacen("100 -0.1", &long, 1),
        BUNDLE.to_owned() + &long,
    ] {
        let error = error(&bundle, list);
        assert!(error.contains(&shown), "{error:.300}");
        assert!(error.len() < 500, "{} bytes", error.len());
    }
}

#[test]
fn axes_and_pixels_are_bundler_s() {
    let whole = parse(BUNDLE, "a b.jpg 0 700.5\n./d\\c 1.jpg\n").unwrap();
    let (id, image) = whole.images.iter().next().unwrap();
    assert_eq!((id.0, image.name.as_str()), (1, "d/c 1.jpg"));
    assert_eq!(whole.images.len(), 1, "camera 0 was not registered");
    assert_eq!(
        image.camera_from_world * DVec3::new(1.0, 2.0, -7.0),
        DVec3::Z * 10.0
    );
    assert_eq!(
        image.camera_from_world * DVec3::new(1.0, 5.0, 3.0),
        DVec3::Y * -3.0
    );
    let camera = &whole.cameras[&image.camera_id];
    assert_eq!(camera.model, ModelKind::Radial);
    assert_eq!(camera.params, [100.0, 320.0, 240.0, -0.1, 0.01]);
    // p = (0.1, 0.2), |p|² = 0.05, 1 + k₁|p|² + k₂|p|⁴ = 0.995025; upwards in the image.
    let keypoint = image.keypoints[0];
    assert_eq!(image.keypoints.len(), 1);
    assert!((keypoint.x - 329.95025).abs() < 1e-12 && (keypoint.y - 220.0995).abs() < 1e-12);
    let errors = reprojection_errors_px(&whole);
    assert!(errors[0] < 1e-12, "{errors:?}");
    let point = whole.points.values().next().unwrap();
    assert_eq!((point.color, point.track.len()), ([10, 20, 30], 1));
}

#[test]
fn errors_name_the_line_and_a_remedy() {
    let again = "copy the file again, or export it again from the program it is from";
    let list = "a.jpg\nb.jpg\n";
    assert_eq!(
        error(BUNDLE, "a.jpg\n"),
        "line 2 (header): found 2 cameras, but the list has 1 photos; put the list that this \
         model was made from beside it, as list.txt"
    );
    assert_eq!(
        error(BUNDLE, "a.jpg\ngone.jpg 0 12.5\n"),
        "line 12 (camera 1, gone.jpg): the format does not say the size of \"gone.jpg\", and no \
         such photo was found; give the folder that holds the photos"
    );
    assert_eq!(
        error(&BUNDLE.replace("100 -0.1", "-100 -0.1"), list),
        "line 8 (camera 1, b.jpg): focal length f of RADIAL is -100; it must be positive; \
         calibrate it again, or leave its images out"
    );
    assert_eq!(
        error(&BUNDLE.replace("2 4 -7", "2 NaN -7"), list),
        format!(
            "line 13 (point 0): found NaN in a position of three numbers, expected finite numbers; {again}"
        )
    );
    assert_eq!(
        error(&BUNDLE.replace("1 7 9.9", "2 7 9.9"), list),
        format!("line 15 (point 0): found camera 2, expected less than 2; {again}")
    );
    // Counts are not trusted for allocation.
    assert_eq!(
        error(&BUNDLE.replace("2 0 5 1 1", "9999999999999 0 5 1 1"), list),
        format!("line 15 (point 0): the file ends, expected a camera's number; {again}")
    );
}

#[test]
fn damaged_files_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("list.txt"), "a.jpg\nb.jpg\n").unwrap();
    let read = |path: &Path| {
        let beside = folder.path().join(path.file_name().unwrap());
        std::fs::copy(path, &beside).unwrap();
        let result = read_bundler(&beside, &size_of);
        std::fs::remove_file(beside).unwrap();
        result
    };
    // Cut within the last number, a shorter number is left.
    damage(BUNDLE.as_bytes(), BUNDLE.len() - "9.9005\n".len() - 1, read);
}
