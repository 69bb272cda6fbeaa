use crate::broken::damage;
use crate::captures::{capture, mean, reprojection_errors_px};
use calibrate::formats::{FormatError, parse_nvm, read_nvm};
use calibrate::{ModelKind, Pixel, Reconstruction};
use glam::DVec3;
use std::path::Path;

/// Image 1 is turned by 90° about y: it looks along −x.
const MODEL: &str = "NVM_V3

2
a\"b.jpg\t100 1 0 0 0 1 2 3 0.2 0
.\\d\\c 1.jpg 100 0.7071067811865476 0 0.7071067811865476 0 0 0 0 0 0

1
2 4 13 10 20 30 1 0 5 9.5 19
0
";

fn size_of(name: &str) -> Option<(u32, u32)> {
    (name != "gone.jpg").then_some((60, 40))
}

fn parse(model: &str) -> Result<Reconstruction, FormatError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.nvm");
    std::fs::write(&path, model).unwrap();
    read_nvm(&path, &size_of, &mut Vec::new())
}

fn error(from: &str, to: &str) -> String {
    assert!(MODEL.contains(from));
    let error = parse(&MODEL.replacen(from, to, 1)).unwrap_err().to_string();
    let (_, rest) = error.split_once("model.nvm, ").unwrap();
    rest.to_owned()
}

#[test]
fn the_example_reprojects() {
    let Some(path) = capture("other-formats/visualsfm-nvm/model.nvm") else {
        return;
    };
    let size_of = |_: &str| Some((2592, 1944));
    let mut notes = Vec::new();
    let whole = read_nvm(&path, &size_of, &mut notes).unwrap();
    assert!(notes.is_empty(), "{notes:?}");
    assert_eq!((whole.images.len(), whole.points.len()), (22, 853));
    let mut errors = reprojection_errors_px(&whole);
    errors.sort_by(f64::total_cmp);
    let (mean_px, median_px) = (mean(&errors), errors[errors.len() / 2]);
    println!(
        "nvm: mean {mean_px:.3} px, median {median_px:.3} px of {}",
        errors.len()
    );
    assert!(mean_px < 2.0 && median_px < 1.0);
}

#[test]
fn axes_names_and_pixels_are_visualsfm_s() {
    let whole = parse(MODEL).unwrap();
    let images: Vec<_> = whole.images.values().collect();
    assert_eq!(
        [&*images[0].name, &*images[1].name],
        ["a b.jpg", "d/c 1.jpg"]
    );
    let center = images[0].camera_from_world.center();
    assert!(center.distance(DVec3::new(1.0, 2.0, 3.0)) < 1e-15);
    // q turns the world into the camera: −x of the world is ahead.
    let ahead = images[1].camera_from_world * DVec3::new(-1.0, 0.0, 0.0);
    assert!(ahead.distance(DVec3::Z) < 1e-15, "{ahead}");
    let keypoint = images[0].keypoints[0];
    assert_eq!((keypoint.x, keypoint.y), (39.5, 39.0));
    assert_eq!(
        whole.cameras[&images[1].camera_id].model,
        ModelKind::Pinhole
    );
}

/// COLMAP 3.8 writes what VisualSFM counts from the photo's centre from its corner.
#[test]
fn measurements_from_the_corner_are_told_by_where_points_project_to() {
    let read = |origin: [i32; 2]| {
        let mut text = "NVM_V3\n\n1\na.jpg 100 1 0 0 0 0 0 0 0 0\n\n9\n".to_owned();
        for i in -4..5 {
            let (x, y) = (5 * i, 2 * i);
            let [at_x, at_y] = [origin[0] + x, origin[1] + y];
            text += &format!("{x} {y} 100 10 20 30 1 0 7 {at_x} {at_y}\n");
        }
        let mut notes = Vec::new();
        let path = Path::new("a/model.nvm");
        let whole = parse_nvm(path, text.as_bytes(), &size_of, &mut notes).unwrap();
        (whole, notes)
    };
    let (from_center, notes) = read([0, 0]);
    assert!(notes.is_empty(), "{notes:?}");
    let (from_corner, notes) = read([30, 20]);
    assert_eq!(from_corner, from_center);
    let note = "a/model.nvm: measurements are taken to count from the photos' corners, as COLMAP \
                writes them: they are 0.0 pixels from their points (the median), counted from \
                the photos' centres 36.1";
    assert_eq!(notes, [note]);
    // Where neither fits, they count as VisualSFM has them.
    let (_, notes) = read([300, 200]);
    assert!(notes.is_empty(), "{notes:?}");
}

/// VisualSFM writes every model that it could not join with another, then the photos that are
/// in none, then files of points.
#[test]
fn of_several_models_the_one_with_the_most_photos_is_read() {
    let model = |names: &[&str]| {
        let mut text = format!("{}\n", names.len());
        for name in names {
            text += &format!("{name} 100 1 0 0 0 1 2 3 0 0\n");
        }
        text + "\n1\n2 4 13 10 20 30 1 0 5 9.5 19\n\n"
    };
    let unregistered = "3\nx.jpg 0 0 0 0 0 0 0 0 0 0\ny.jpg 0 0 0 0 0 0 0 0 0 0\n\
                        z.jpg 0 0 0 0 0 0 0 0 0 0\n\n0\n\n0\n\n# 1 file\n1 0\n";
    let read = |text: &str| {
        let mut notes = Vec::new();
        let whole = parse_nvm(Path::new("m.nvm"), text.as_bytes(), &size_of, &mut notes).unwrap();
        let mut names = whole.images.into_values().map(|image| image.name);
        (names.next().unwrap(), names.count() + 1, notes)
    };
    let (small, large) = (model(&["a.jpg"]), model(&["b.jpg", "c.jpg"]));
    let holds = "m.nvm: holds 3 models that VisualSFM could not join; the one with 2 photos is \
                 taken, and not those with";
    let broken = "m.nvm: models from line 10 (model 1) on are not used: it cannot be read";
    let expected = |text: &str, name: &str, count: usize, notes: Vec<String>| {
        let text = format!("NVM_V3\n\n{text}");
        assert_eq!(read(&text), (name.to_owned(), count, notes), "{text}");
    };
    expected(&format!("{large}{unregistered}"), "b.jpg", 2, Vec::new());
    let notes = vec![format!("{holds} 1, 2")];
    expected(&format!("{small}{large}{large}0\n"), "b.jpg", 2, notes);
    let notes = vec![format!("{holds} 2, 1")];
    let text = format!("{large}{large}{small}{unregistered}");
    expected(&text, "b.jpg", 2, notes);
    let notes = vec![broken.to_owned()];
    expected(&format!("{small}4\nd.jpg 1 1 0"), "a.jpg", 1, notes);
}

#[test]
fn measurement_distortion_is_undone() {
    for r in [-0.6, -0.05, 1e-7, 0.3, 4.0] {
        let whole = parse(&MODEL.replace("0.2 0\n", &format!("{r} 0\n"))).unwrap();
        let camera = whole.cameras.values().next().unwrap();
        assert_eq!(camera.model, ModelKind::InverseRadial);
        let lens = camera.lens().unwrap();
        for (x, y) in [(3.0, 2.0), (-30.0, 20.0), (30.0, -7.0)] {
            // The definition: the measurement, straightened, is the pinhole's image.
            let (dx, dy) = (x / 100.0, y / 100.0);
            let straight = 1.0 + r * (dx * dx + dy * dy);
            let ray = DVec3::new(dx * straight, dy * straight, 1.0);
            let pixel = lens.project(ray).unwrap();
            let off_px = (pixel.x - 30.0 - x).hypot(pixel.y - 20.0 - y);
            assert!(off_px < 1e-12, "r = {r}: {off_px} px at ({x}, {y})");
        }
    }
}

#[test]
fn nothing_is_seen_beyond_the_fold() {
    let whole = parse(&MODEL.replace("0.2 0\n", "-4 0\n")).unwrap();
    let lens = whole.cameras.values().next().unwrap().lens().unwrap();
    // 1/√12 of the focal length.
    assert!(lens.unproject(Pixel::new(30.0 + 28.8, 20.0)).is_some());
    assert_eq!(lens.unproject(Pixel::new(30.0 + 28.9, 20.0)), None);
}

#[test]
fn a_fixed_calibration_is_shared() {
    let text = MODEL
        .replacen("NVM_V3", "NVM_V3 FixedK 90 31 91 22", 1)
        .replace("0.2 0\n", "0 0\n");
    let whole = parse(&text).unwrap();
    assert_eq!(whole.cameras.len(), 1);
    assert_eq!(
        whole.cameras.values().next().unwrap().params,
        [90.0, 91.0, 31.0, 22.0]
    );
    let keypoint = whole.images.values().next().unwrap().keypoints[0];
    assert_eq!((keypoint.x, keypoint.y), (40.5, 41.0));
}

// Found by fuzzing: turning a finite centre overflows.
#[test]
fn a_centre_too_far_away_for_a_pose_is_told() {
    let error = error("1 0 0 0 1 2 3", "0 1 0 0 1e308 0 0");
    assert!(
        error.starts_with("line 4 (image 0, a b.jpg): the camera's centre is too far away"),
        "{error}"
    );
}

#[test]
fn a_measurement_too_far_away_for_a_pixel_is_told() {
    let text = MODEL
        .replacen("NVM_V3", "NVM_V3 FixedK 90 1e308 91 22", 1)
        .replacen("9.5 19", "1e308 19", 1);
    let error = parse(&text).unwrap_err().to_string();
    let expected = "line 8 (point 0): image 0 observes the point at (inf, 41), expected finite";
    assert!(error.contains(expected), "{error}");
}

#[test]
fn errors_name_the_line_and_a_remedy() {
    let again = "copy the file again, or export it again from the program it is from";
    assert_eq!(
        error("NVM_V3", "NVM_V2"),
        "line 1 (header): found \"NVM_V2\", expected \"NVM_V3\"; save the model again with a \
         VisualSFM of 2011 or later"
    );
    assert_eq!(
        error("1 0 0 0 1 2 3", "2 0 0 0 1 2 3"),
        format!(
            "line 4 (image 0, a b.jpg): the rotation's quaternion (2, 0, 0, 0) has length 2, \
             expected 1; {again}"
        )
    );
    assert_eq!(
        error("100 1 0", "-100 1 0"),
        "line 4 (image 0, a b.jpg): focal length fx of INVERSE_RADIAL is -100; it must be positive; \
         calibrate it again, or leave its images out"
    );
    assert_eq!(
        error("0.2 0\n", "nan 0\n"),
        format!("line 4 (image 0): found \"nan\", expected a finite number; {again}")
    );
    assert_eq!(
        error("1 0 5 9.5", "99999999999 0 5 9.5"),
        format!("line 9 (point 0): the file ends, expected a feature's number; {again}")
    );
    assert_eq!(
        error("1 0 5 9.5", "1 7 5 9.5"),
        format!("line 8 (point 0): found image 7, expected less than 2; {again}")
    );
}

/// A file without line breaks is no reason to print all of it.
#[test]
fn errors_quote_only_the_beginning_of_long_lines() {
    let long = "é".repeat(100_000);
    let shown = |most: usize| format!("found \"{}…\", expected", "é".repeat(most));
    for (from, most) in [
        ("NVM_V3", 40),
        (".\\d\\c 1.jpg 100 0.7071067811865476", 80),
        ("0.7071067811865476", 40),
        ("1 0 5 9.5", 40),
    ] {
        let error = error(from, &long);
        assert!(error.contains(&shown(most)), "{from}: {error:.300}");
        assert!(error.len() < 1000, "{from}: {} bytes", error.len());
    }
    let fixed = error("NVM_V3", &format!("NVM_V3 FixedK {long}"));
    assert!(fixed.contains("\"NVM_V3 FixedK é") && fixed.len() < 500);
}

#[test]
fn damaged_files_are_refused() {
    let needed = MODEL.find("19\n0").unwrap() + 1;
    damage(MODEL.as_bytes(), needed, |path: &Path| {
        read_nvm(path, &size_of, &mut Vec::new())
    });
}
