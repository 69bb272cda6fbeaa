use crate::synthetic::small;
use calibrate::colmap::{find_model, write_binary, write_text};
use std::fs;

#[test]
fn the_usual_places_are_tried_in_order() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    for place in ["", "model", "dense/sparse", "sparse", "sparse/0"] {
        let place = root.join(place);
        write_text(&small(), &place).unwrap();
        let found = find_model(root).unwrap();
        assert_eq!(found.components().as_path(), place.components().as_path());
    }
}

#[test]
fn no_model_says_where_it_looked_and_what_is_missing() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    write_binary(&small(), &root.join("sparse/0")).unwrap();
    fs::remove_file(root.join("sparse/0/points3D.bin")).unwrap();
    let error = find_model(root).unwrap_err().to_string();
    let expected = "ROOT: no COLMAP model here; looked for cameras, images and points3D (all \
        three as .bin or all three as .txt) in ROOT/sparse/0, ROOT/sparse, ROOT/dense/sparse, \
        ROOT/model, ROOT, ROOT/0; ROOT/sparse/0 lacks points3D.bin; give the folder that holds the three \
        files, or make them with `colmap mapper` or `colmap model_converter`";
    assert_eq!(error.replace(&*root.to_string_lossy(), "ROOT"), expected);
}

#[test]
fn a_missing_folder_is_said_to_be_missing() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path().join("nowhere");
    assert_eq!(
        find_model(&root).unwrap_err().to_string(),
        format!(
            "{}: there is no such folder; check the path",
            root.display()
        )
    );
}
