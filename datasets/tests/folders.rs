//! What becomes of the folders that datasets are written into.

use datasets::{DatasetError, in_new_folder};
use std::fs;
use std::path::Path;

/// What a folder holds, by name.
fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap();
    let names = entries.map(|e| e.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<String> = names.collect();
    names.sort();
    names
}

/// Fills a folder with a file of this name.
fn fill(folder: &Path, may_go: bool, file: &str) -> Result<(), DatasetError> {
    let put = |partial: &Path| {
        fs::write(partial.join(file), file).unwrap();
        Ok(())
    };
    in_new_folder(folder, |_| may_go, put)
}

#[test]
fn a_folder_is_filled_and_replaced_whatever_its_path_ends_in() {
    let here = tempfile::tempdir().unwrap();
    let at = |path: &str| here.path().join(path);
    for (i, spelling) in ["house", "house/.", "house/inner/.."].iter().enumerate() {
        let [first, second] = [0, 1].map(|k| format!("{i} {k}"));
        // `..` leads back from a folder only where that is.
        fs::create_dir_all(at("house/inner")).unwrap();
        let error = fill(&at(spelling), false, &first).unwrap_err();
        assert!(matches!(error, DatasetError::NotEmpty { .. }), "{error}");
        assert!(names(&at("house")).contains(&"inner".to_owned()));
        fill(&at(spelling), true, &first).unwrap();
        assert_eq!(names(&at("house")), [first], "{spelling}");
        // What fails leaves all as it was.
        fs::create_dir_all(at("house/inner")).unwrap();
        let fails = |_: &Path| Err(DatasetError::NoPlace);
        in_new_folder(&at(spelling), |_| true, fails).unwrap_err();
        assert!(names(&at("house")).contains(&"inner".to_owned()));
        fill(&at(spelling), true, &second).unwrap();
        assert_eq!(names(&at("house")), [second], "{spelling}");
        assert_eq!(names(here.path()), ["house"], "{spelling}");
    }
    // What has no name.
    let error = fill(Path::new("/"), true, "a").unwrap_err().to_string();
    let said = "/: cannot write: no folder's name";
    assert!(error.starts_with(said), "{error}");
}

#[cfg(target_os = "linux")]
#[test]
fn what_a_killed_process_left_is_removed_by_the_next() {
    let here = tempfile::tempdir().unwrap();
    let mut gone = std::process::Command::new("true").spawn().unwrap();
    gone.wait().unwrap();
    let gone = gone.id();
    let left = format!(".house.partial-{gone}");
    let theirs = [
        // The first process runs as long as the system does.
        ".house.partial-1".to_owned(),
        format!(".house.partial-{gone}-mine"),
        ".house.partial-".to_owned(),
        format!(".house.replaced-{gone}"),
        format!(".houses.partial-{gone}"),
        format!("house.partial-{gone}"),
    ];
    for name in theirs.iter().chain([&left]) {
        fs::create_dir(here.path().join(name)).unwrap();
        fs::write(here.path().join(name).join("half"), "").unwrap();
    }
    fill(&here.path().join("house"), false, "whole").unwrap();
    let mut expected = theirs.to_vec();
    expected.push("house".to_owned());
    expected.sort();
    assert_eq!(names(here.path()), expected);
    assert_eq!(names(&here.path().join("house")), ["whole"]);
}

#[test]
fn what_others_write_meanwhile_stays() {
    let here = tempfile::tempdir().unwrap();
    let house = here.path().join("house");
    let meanwhile = |partial: &Path| {
        fs::write(partial.join("ours"), "").unwrap();
        fs::create_dir(&house).unwrap();
        fs::write(house.join("theirs"), "").unwrap();
        Ok(())
    };
    let error: DatasetError = in_new_folder(&house, |_| false, meanwhile).unwrap_err();
    assert!(matches!(error, DatasetError::NotEmpty { .. }), "{error}");
    assert_eq!(names(&house), ["theirs"]);
    assert_eq!(names(here.path()), ["house"]);
}
