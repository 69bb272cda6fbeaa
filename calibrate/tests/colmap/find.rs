use crate::synthetic::small;
#[cfg(unix)]
use calibrate::colmap::{ColmapError, read_model};
use calibrate::colmap::{find_model, find_models, side_by_side, write_binary, write_text};
use std::collections::BTreeSet;
use std::fs;
use std::path::PathBuf;

#[test]
fn the_usual_places_are_tried_in_order() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    assert_eq!(find_models(root), Vec::<PathBuf>::new());
    let mut places = [
        "colmap/sparse",
        "colmap/sparse/0",
        "0",
        "",
        "model",
        "dense/0/sparse",
        "dense/sparse",
        "sparse",
        "sparse/0",
    ];
    for place in places {
        let place = root.join(place);
        write_text(&small(), &place).unwrap();
        let found = find_model(root).unwrap();
        assert_eq!(found.components().as_path(), place.components().as_path());
    }
    // All of them, but one place by another name.
    places.reverse();
    let all = places.map(|place| root.join(place).components().as_path().to_owned());
    assert_eq!(find_models(root), all);
    #[cfg(unix)]
    {
        fs::remove_dir_all(root.join("model")).unwrap();
        std::os::unix::fs::symlink(root.join("sparse/0"), root.join("model")).unwrap();
        let others = all.into_iter().filter(|place| !place.ends_with("model"));
        assert_eq!(find_models(root), others.collect::<Vec<_>>());
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
        ROOT/dense/0/sparse, ROOT/model, ROOT, ROOT/0, ROOT/colmap/sparse/0, ROOT/colmap/sparse; \
        ROOT/sparse/0 lacks points3D.bin; give the folder that holds the three \
        files, or make them with `colmap mapper` or `colmap model_converter`";
    assert_eq!(error.replace(&*root.to_string_lossy(), "ROOT"), expected);
}

/// As `colmap automatic_reconstructor` leaves them.
#[test]
fn undistorted_models_are_found_from_around_and_from_within() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    let dense = root.join("dense");
    let at = |number: u32| dense.join(number.to_string()).join("sparse");
    let whole = small();
    let part = whole.without_images(&BTreeSet::from(["a.jpg".to_owned()]));
    write_binary(&part, &at(0)).unwrap();
    write_binary(&whole, &at(1)).unwrap();
    for given in ["", "dense", "dense/1"] {
        let found = find_model(&root.join(given)).unwrap();
        assert_eq!(found.components().as_path(), at(1));
    }
    let models = side_by_side(&at(1)).into_iter();
    let counts: Vec<(PathBuf, Option<u64>)> = models.map(|m| (m.folder, m.images)).collect();
    assert_eq!(counts, [(at(0), Some(1)), (at(1), Some(2))]);

    // Elsewhere numbered folders are captures of their own.
    fs::rename(&dense, root.join("houses")).unwrap();
    assert!(find_model(&root.join("houses")).is_err());
}

#[test]
fn what_a_run_of_ours_works_on_is_no_model_yet() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    write_binary(&small(), &root.join("colmap/sparse/0")).unwrap();
    assert_eq!(find_model(root).unwrap(), root.join("colmap/sparse/0"));
    fs::write(root.join("colmap/run.json"), "{}").unwrap();
    assert!(find_model(root).is_err());
}

/// Photos would be calibrated anew, in another world, for want of a disk or of leave to look.
#[cfg(unix)]
#[test]
fn a_place_that_cannot_be_looked_into_is_not_taken_for_one_without_a_model() {
    use std::os::unix::fs::{PermissionsExt, symlink};
    let is_closed = |error: &ColmapError, place: &PathBuf| {
        let ColmapError::Closed { path, .. } = error else {
            return false;
        };
        path == place
    };
    for link in [
        "sparse", "sparse/0", "sparse/3", "dense", "dense/0", "model", "0", "colmap",
    ] {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        let place = root.join(link);
        fs::create_dir_all(place.parent().unwrap()).unwrap();
        symlink("/nonexistent/model", &place).unwrap();
        let error = find_model(root).unwrap_err();
        assert!(is_closed(&error, &place), "{link}: {error}");
        let said = "it is a link to /nonexistent/model, which is not there; see that";
        assert!(error.to_string().contains(said), "{link}: {error}");
    }

    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    let [first, second] = ["sparse/0", "sparse/1"].map(|model| root.join(model));
    write_binary(&small(), &first).unwrap();
    // A link that leads to a model, and one that is never come to, do no harm.
    symlink("/nonexistent/model", root.join("model")).unwrap();
    fs::rename(&first, root.join("elsewhere")).unwrap();
    symlink("../elsewhere", &first).unwrap();
    assert_eq!(find_model(root).unwrap(), first);
    // It might be larger.
    symlink("/nonexistent/model", &second).unwrap();
    assert!(is_closed(&find_model(root).unwrap_err(), &second));
    fs::remove_file(&second).unwrap();
    // One file alone.
    let images = root.join("elsewhere/images.bin");
    fs::remove_file(&images).unwrap();
    symlink("/nonexistent/images.bin", &images).unwrap();
    let at_first = first.join("images.bin");
    assert!(is_closed(&find_model(root).unwrap_err(), &at_first));
    assert!(is_closed(&read_model(&first).unwrap_err(), &at_first));

    // Of a folder that may not be searched; whoever may do everything can.
    write_binary(&small(), &second).unwrap();
    fs::remove_file(&first).unwrap();
    assert_eq!(find_model(root).unwrap(), second);
    let set_mode = |mode| fs::set_permissions(&second, fs::Permissions::from_mode(mode)).unwrap();
    set_mode(0o600);
    let found = find_model(root);
    let is_open = fs::metadata(second.join("images.bin")).is_ok();
    set_mode(0o700);
    if is_open {
        eprintln!("SKIPPED: permissions bind nobody here");
        return;
    }
    let error = found.unwrap_err();
    assert!(is_closed(&error, &second.join("cameras.bin")), "{error}");
    assert!(error.to_string().contains("Permission denied"), "{error}");
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

#[test]
fn of_several_models_the_one_with_the_most_images_is_taken() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    let at = |number: u32| root.join("sparse").join(number.to_string());
    let whole = small();
    let part = whole.without_images(&BTreeSet::from(["a.jpg".to_owned()]));
    assert_eq!((whole.images.len(), part.images.len()), (2, 1));

    // One alone, whatever its number.
    write_text(&part, &at(3)).unwrap();
    assert_eq!(find_model(root).unwrap(), at(3));
    // Of equals the first, and numbers count as numbers.
    write_binary(&part, &at(20)).unwrap();
    assert_eq!(find_model(root).unwrap(), at(3));
    write_text(&whole, &at(100)).unwrap();
    assert_eq!(find_model(root).unwrap(), at(100));
    write_binary(&whole, &at(4)).unwrap();
    assert_eq!(find_model(root).unwrap(), at(4));
    assert_eq!(find_model(&root.join("sparse")).unwrap(), at(4));
    let counts = || -> Vec<(PathBuf, Option<u64>)> {
        let models = side_by_side(&at(4)).into_iter();
        models.map(|m| (m.folder, m.images)).collect()
    };
    let counted = [(3, 1), (4, 2), (20, 1), (100, 2)];
    assert_eq!(counts(), counted.map(|(n, images)| (at(n), Some(images))));

    // A damaged one is not the largest, whatever it says of itself.
    fs::write(at(4).join("images.bin"), [0xff; 64]).unwrap();
    assert_eq!(find_model(root).unwrap(), at(100));
    assert_eq!(counts()[1], (at(4), None));
    // Others are none: incomplete, or not called by a number.
    fs::remove_file(at(100).join("cameras.txt")).unwrap();
    write_text(&whole, &root.join("sparse/best")).unwrap();
    assert_eq!(find_model(root).unwrap(), at(3));
    assert!(side_by_side(&root.join("sparse/best")).is_empty());
}
