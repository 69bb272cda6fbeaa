use crate::broken::damage;
use crate::captures::{angle_between, capture};
use calibrate::colmap::{find_model, read_model};
use calibrate::formats::{FormatError, read_llff, read_llff_bounds};
use calibrate::{Reconstruction, Rigid3};
use glam::DVec3;
use std::path::Path;

const ROW: [f64; 17] = [
    0.0, 1.0, 0.0, 1.0, 40.0, //
    -1.0, 0.0, 0.0, 2.0, 60.0, //
    0.0, 0.0, 1.0, 3.0, 50.0, //
    0.5, 9.0,
];

fn npy(descr: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(data);
    bytes
}

fn doubles(rows: &[[f64; 17]]) -> Vec<u8> {
    rows.iter()
        .flatten()
        .flat_map(|v| v.to_le_bytes())
        .collect()
}

fn named(names: &[&str]) -> Vec<String> {
    names.iter().map(|&name| name.to_owned()).collect()
}

fn parse(
    bytes: &[u8],
    names: &[&str],
    size: Option<(u32, u32)>,
) -> Result<Reconstruction, FormatError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("poses_bounds.npy");
    std::fs::write(&path, bytes).unwrap();
    read_llff(&path, &named(names), &|_| size)
}

fn error(bytes: &[u8], names: &[&str], size: Option<(u32, u32)>) -> String {
    let error = parse(bytes, names, size).unwrap_err().to_string();
    let (_, rest) = error.split_once("poses_bounds.npy, ").unwrap();
    rest.to_owned()
}

#[test]
fn fern_turns_as_its_colmap_model_does() {
    let (Some(path), Some(fern)) = (
        capture("other-formats/llff-fern/poses_bounds.npy"),
        capture("fern"),
    ) else {
        return;
    };
    let model = read_model(&find_model(&fern).unwrap()).unwrap();
    let names: Vec<String> = model.images.values().map(|i| i.name.clone()).collect();
    let whole = read_llff(&path, &names, &|_| Some((1000, 750))).unwrap();
    let pair = |name: &str| {
        let of = |whole: &Reconstruction| -> Rigid3 {
            let image = whole.images.values().find(|image| image.name == name);
            image.unwrap().camera_from_world
        };
        (of(&whole), of(&model))
    };
    // The frames differ by a similarity, which cancels between two cameras.
    let (first, first_twin) = pair(&names[0]);
    let (mut worst_turn, mut ratios) = (0.0_f64, Vec::new());
    for name in &names[1..] {
        let (pose, twin) = pair(name);
        let (step, twin_step) = (pose * first.inverse(), twin * first_twin.inverse());
        worst_turn = worst_turn.max(angle_between(step, twin_step));
        ratios.push(step.translation.length() / twin_step.translation.length());
        let along = step
            .translation
            .normalize()
            .dot(twin_step.translation.normalize());
        assert!(along > 0.99, "{name}: {along}");
    }
    ratios.sort_by(f64::total_cmp);
    println!("fern: worst turn {worst_turn:.4} rad, scales {ratios:.3?}");
    assert!(worst_turn < 0.02, "{worst_turn}");
    assert!(ratios[ratios.len() - 1] < 1.1 * ratios[0]);
    let camera = whole.cameras.values().next().unwrap();
    let stored = model.cameras.values().next().unwrap();
    assert!((camera.params[0] / stored.params[0] - 1.0).abs() < 0.02);
}

#[test]
fn axes_are_down_right_back_and_names_are_sorted() {
    let mut second = ROW;
    second[3] = 7.0;
    let bytes = npy("<f8", "(2, 17)", &doubles(&[ROW, second]));
    let whole = parse(&bytes, &["b.jpg", "a.jpg"], None).unwrap();
    let images: Vec<_> = whole.images.values().collect();
    assert_eq!([&*images[0].name, &*images[1].name], ["a.jpg", "b.jpg"]);
    let pose = images[0].camera_from_world;
    assert!((pose * DVec3::new(1.0, 2.0, -7.0)).distance(DVec3::Z * 10.0) < 1e-12);
    assert!((pose * DVec3::new(1.0, -3.0, 3.0)).distance(DVec3::Y * 5.0) < 1e-12);
    assert!((pose * DVec3::new(5.0, 2.0, 3.0)).distance(DVec3::X * 4.0) < 1e-12);
    let camera = whole.cameras.values().next().unwrap();
    assert_eq!((camera.width, camera.height), (60, 40));
    assert_eq!(camera.params, [50.0, 50.0, 30.0, 20.0]);
    // Smaller photos, and single precision.
    let floats: Vec<u8> = ROW.iter().flat_map(|&v| (v as f32).to_le_bytes()).collect();
    let bytes = npy("<f4", "(1, 17)", &floats);
    let whole = parse(&bytes, &["a.jpg"], Some((30, 20))).unwrap();
    let camera = whole.cameras.values().next().unwrap();
    assert_eq!(camera.params, [25.0, 25.0, 15.0, 10.0]);
}

#[test]
fn errors_name_the_row_and_a_remedy() {
    let whole = npy("<f8", "(1, 17)", &doubles(&[ROW]));
    assert_eq!(
        error(&whole, &["a.jpg", "b.jpg"], None),
        "header: found 1 poses for 2 photos; give the folder with the very photos that the \
         poses were computed for"
    );
    assert_eq!(
        error(&whole, &["a.jpg"], Some((40, 60))),
        "row 0 (a.jpg): the photo is 40 × 60, but the pose is for 60 × 40; give the photos that \
         the poses were computed for, or scaled copies of them"
    );
    for (descr, shape) in [(">f8", "(1, 17)"), ("<f8", "(17, 1)"), ("|O", "(1, 17)")] {
        let error = error(&npy(descr, shape, &doubles(&[ROW])), &["a.jpg"], None);
        assert!(
            error.contains("expected float64 or float32, little-endian"),
            "{error}"
        );
    }
    let huge = npy("<f8", "(99999999999999999, 17)", &doubles(&[ROW]));
    assert!(error(&huge, &["a.jpg"], None).contains("found 136 bytes of numbers"));
    let mut row = ROW;
    row[14] = f64::NAN;
    let nan = npy("<f8", "(1, 17)", &doubles(&[row]));
    assert!(error(&nan, &["a.jpg"], None).starts_with("row 0 (a.jpg): found ["));
    row[14] = -1.0;
    let negative = npy("<f8", "(1, 17)", &doubles(&[row]));
    assert!(error(&negative, &["a.jpg"], None).contains("must be positive"));
}

#[test]
fn depths_lie_before_the_camera_and_apart() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("poses_bounds.npy");
    let bounds = |near: f64, far: f64| {
        let mut row = ROW;
        (row[15], row[16]) = (near, far);
        std::fs::write(&path, npy("<f8", "(1, 17)", &doubles(&[row]))).unwrap();
        read_llff_bounds(&path).map_err(|error| error.to_string())
    };
    assert_eq!(bounds(0.5, 9.0), Ok(vec![[0.5, 9.0]]));
    for (near, far) in [(0.0, 9.0), (9.0, 0.5), (3.0, 3.0), (0.5, f64::INFINITY)] {
        let error = bounds(near, far).unwrap_err();
        let said = "expected 0 < nearest < farthest";
        assert!(error.contains("row 0") && error.contains(said), "{error}");
    }
}

#[test]
fn damaged_files_are_refused() {
    let bytes = npy("<f8", "(1, 17)", &doubles(&[ROW]));
    let names = named(&["a.jpg"]);
    damage(&bytes, bytes.len(), |path: &Path| {
        read_llff(path, &names, &|_| None)
    });
}
