//! Field pictures, weights and triangulations.

use crate::run::{files, lumigraph, with_wall};
use std::collections::BTreeSet;
use std::fs::File;
use std::io::Read;
use std::path::Path;
use zip::ZipArchive;

/// An array's type and shape in numpy's words, and its bytes.
fn array(file: &Path, name: &str) -> (String, Vec<u8>) {
    let mut archive = ZipArchive::new(File::open(file).unwrap()).unwrap();
    let mut bytes = Vec::new();
    let mut array = archive.by_name(&format!("{name}.npy")).unwrap();
    array.read_to_end(&mut bytes).unwrap();
    assert_eq!(&bytes[..8], b"\x93NUMPY\x01\x00");
    let values = bytes.split_off(10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]])));
    let about = String::from_utf8(bytes.split_off(10)).unwrap();
    assert!(about.ends_with(" \n") && (10 + about.len()).is_multiple_of(64));
    (about.trim_end().to_owned(), values)
}

/// The shape of an array of a type, and its values.
fn numbers<T, const N: usize>(
    file: &Path,
    (name, kind): (&str, &str),
    value: impl Fn([u8; N]) -> T,
) -> (Vec<usize>, Vec<T>) {
    let (about, bytes) = array(file, name);
    let begin = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': (");
    let shape = about.strip_prefix(&begin).unwrap();
    let shape = shape.strip_suffix("), }").unwrap();
    let shape: Vec<usize> = shape.split(", ").map(|n| n.parse().unwrap()).collect();
    let values = bytes.chunks(N).map(|b| value(b.try_into().unwrap()));
    let values: Vec<T> = values.collect();
    assert_eq!(values.len(), shape.iter().product::<usize>());
    (shape, values)
}

fn ids(file: &Path) -> (Vec<usize>, Vec<i32>) {
    numbers(file, ("ids", "<i4"), i32::from_le_bytes)
}

fn weights(file: &Path) -> Vec<f32> {
    numbers(file, ("weights", "<f4"), f32::from_le_bytes).1
}

#[test]
fn weights_are_complete_and_points_lie_on_the_proxy() {
    let folder = with_wall();
    for renderer in ["exact", "triangulated"] {
        let line = format!(
            "field wall --proxy plane --view 0004.png --without-view --renderer {renderer} -o f.png \
             --weights w.npz --triangulation t.svg"
        );
        let line = line.split_whitespace().collect::<Vec<_>>().join(" ");
        let ran = lumigraph(folder.path(), &line).ok();
        assert_eq!(ran.stdout, "f.png\nw.npz\nt.svg\n");
        let file = folder.path().join("w.npz");

        // UTF-32: a letter and three zeros.
        let (about, names) = array(&file, "camera_names");
        assert!(about.contains("'<U8'") && about.contains("(8,)"), "{about}");
        let names: Vec<u8> = names.into_iter().filter(|letter| *letter > 0).collect();
        let names = String::from_utf8(names).unwrap();
        let others = (0..9).filter(|i| *i != 4).map(|i| format!("000{i}.png"));
        assert_eq!(names, others.collect::<String>());
        let (shape, ids) = ids(&file);
        assert_eq!(shape[..2], [72, 96]);
        let slots = shape[2];
        let weights = weights(&file);
        let (shape, points) = numbers(&file, ("points", "<f8"), f64::from_le_bytes);
        assert_eq!(shape, [72, 96, 3]);

        for (ids, weights) in ids.chunks(slots).zip(weights.chunks(slots)) {
            let used: Vec<i32> = ids.iter().copied().filter(|&id| id >= 0).collect();
            let distinct: BTreeSet<i32> = used.iter().copied().collect();
            assert_eq!(distinct.len(), used.len());
            assert!(used.iter().all(|&id| id < 8));
            assert!(ids[used.len()..].iter().all(|&id| id == -1));
            assert!(weights[used.len()..].iter().all(|&w| w == 0.0));
            assert!(weights.is_sorted_by(|a, b| a >= b));
            let sum: f32 = weights.iter().sum();
            assert!(used.is_empty() || (sum - 1.0).abs() < 1e-5, "{sum}");
        }
        let truth = lumigraph(folder.path(), "evaluate wall --proxy plane --json").ok();
        assert_eq!(truth.json()["proxy"]["kind"], "plane");
        assert!(
            points.iter().all(|v| v.is_finite()),
            "a wall fills the view"
        );

        let picture = image::open(folder.path().join("f.png")).unwrap();
        assert_eq!((picture.width(), picture.height()), (96, 72));
        let svg = std::fs::read_to_string(folder.path().join("t.svg")).unwrap();
        assert!(svg.starts_with("<svg ") && svg.contains("<path "));
    }
}

#[test]
fn a_photo_paints_its_own_view_alone() {
    let folder = with_wall();
    lumigraph(
        folder.path(),
        "field wall --proxy plane --view 0004.png -o f.png --weights w.npz",
    )
    .ok();
    let file = folder.path().join("w.npz");
    let ((shape, ids), weights) = (ids(&file), weights(&file));
    let slots = shape[2];
    // Within the feather others share.
    let at = |x: usize, y: usize| (y * 96 + x) * slots;
    for (x, y) in [(48, 36), (10, 10), (85, 60)] {
        assert_eq!(ids[at(x, y)], 4);
        assert_eq!(weights[at(x, y)], 1.0);
    }
}

#[test]
fn files_are_called_what_they_are() {
    let folder = with_wall();
    for (options, said) in [
        (
            "-o f.jpg",
            "--output f.jpg: expected a file name that ends in .png",
        ),
        ("-o f", "--output f: expected a file name that ends in .png"),
        (
            "-o f.png --weights w.txt",
            "--weights w.txt: expected a file name that ends in .npz",
        ),
        (
            "-o f.png --triangulation t.png",
            "--triangulation t.png: expected a file name that ends in .svg",
        ),
    ] {
        let line = format!("field wall --proxy plane --view 0004.png {options}");
        assert_eq!(lumigraph(folder.path(), &line).error(2), said);
    }
    let names = files(folder.path());
    assert!(names.keys().all(|name| name.starts_with("wall")));
    let line = "field wall --proxy plane --view 0004.png --size 48x36 -o F.PNG";
    lumigraph(folder.path(), line).ok();
}

#[test]
fn unknown_views_are_named() {
    let folder = with_wall();
    let error = lumigraph(
        folder.path(),
        "field wall --proxy plane --view 4.png -o f.png",
    )
    .error(1);
    assert_eq!(
        error,
        "no photo is called 4.png; the scene has 0000.png, 0001.png and 7 more"
    );
    // Before a proxy is fitted, for which this scene has no silhouettes.
    for (options, count) in [("", 30), (" --frames 12", 12)] {
        let line =
            format!("field wall --proxy hull --path orbit{options} --view frame_0030 -o f.png");
        let error = lumigraph(folder.path(), &line).error(1);
        let said = format!(
            "--view frame_0030: the path has {count} frames of other names: frame_0000, frame_0001, …"
        );
        assert_eq!(error, said);
    }
}

#[test]
fn a_path_with_frames_of_its_own_takes_no_number_of_them() {
    let folder = with_wall();
    let path = r#"{"version": 1, "fps": 30, "frames": [{"name": "first", "camera_from_world":
        [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1],
        "width": 32, "height": 24, "model": "PINHOLE", "params": [30, 30, 16, 12]}]}"#;
    std::fs::write(folder.path().join("path.json"), path).unwrap();
    let line = "field wall --proxy plane --path path.json --view first -o f.png";
    let error = lumigraph(folder.path(), &format!("{line} --frames 5")).error(2);
    assert_eq!(
        error,
        "--frames 5: the path has its own frames; leave it out"
    );
    assert!(!folder.path().join("f.png").exists());
    lumigraph(folder.path(), line).ok();
}
