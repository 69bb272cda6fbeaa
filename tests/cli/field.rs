//! Field pictures, weights and triangulations.

use crate::run::{lumigraph, with_wall};
use npyz::npz::NpzArchive;
use std::collections::BTreeSet;
use std::path::Path;

/// An array's shape and values.
fn array<T: npyz::Deserialize>(file: &Path, name: &str) -> (Vec<u64>, Vec<T>) {
    let mut archive = NpzArchive::open(file).unwrap();
    let array = archive.by_name(name).unwrap().unwrap();
    (array.shape().to_vec(), array.into_vec().unwrap())
}

#[test]
fn weights_are_complete_and_points_lie_on_the_proxy() {
    let folder = with_wall();
    for renderer in ["exact", "triangulated"] {
        let line = format!(
            "field wall --view 0004.png --without-view --renderer {renderer} -o f.png \
             --weights w.npz --triangulation t.svg"
        );
        let line = line.split_whitespace().collect::<Vec<_>>().join(" ");
        let ran = lumigraph(folder.path(), &line).ok();
        assert_eq!(ran.stdout, "f.png\nw.npz\nt.svg\n");
        let file = folder.path().join("w.npz");

        let (_, names) = array::<String>(&file, "camera_names");
        assert_eq!(names.len(), 8);
        assert!(!names.contains(&"0004.png".to_owned()));
        let (shape, ids) = array::<i32>(&file, "ids");
        assert_eq!(shape[..2], [72, 96]);
        let slots = shape[2] as usize;
        let (_, weights) = array::<f32>(&file, "weights");
        let (shape, points) = array::<f64>(&file, "points");
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
        "field wall --view 0004.png -o f.png --weights w.npz",
    )
    .ok();
    let file = folder.path().join("w.npz");
    let (shape, ids) = array::<i32>(&file, "ids");
    let (_, weights) = array::<f32>(&file, "weights");
    let slots = shape[2] as usize;
    // Within the feather others share.
    let at = |x: usize, y: usize| (y * 96 + x) * slots;
    for (x, y) in [(48, 36), (10, 10), (85, 60)] {
        assert_eq!(ids[at(x, y)], 4);
        assert_eq!(weights[at(x, y)], 1.0);
    }
}

#[test]
fn unknown_views_are_named() {
    let folder = with_wall();
    let error = lumigraph(folder.path(), "field wall --view 4.png -o f.png").error(1);
    assert_eq!(
        error,
        "no photo is called 4.png; the scene has 0000.png, 0001.png and 7 more"
    );
}
