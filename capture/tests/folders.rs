//! Folders that take the place of others.

use capture::folder::{beside, exchange, place_of, take_place};
use capture::write_whole;
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

/// Makes a folder with a file in it.
fn with_file(folder: &Path, file: &str) {
    fs::create_dir(folder).unwrap();
    fs::write(folder.join(file), file).unwrap();
}

#[test]
fn names_as_long_as_disks_take_have_room_beside_them() {
    let here = tempfile::tempdir().unwrap();
    for name in ["n".repeat(255), "é".repeat(127), "ab".repeat(100)] {
        let path = here.path().join(&name);
        write_whole(&path, |temporary| {
            assert_eq!(temporary.parent(), path.parent());
            fs::write(temporary, "half")?;
            fs::write(temporary, "whole")
        })
        .unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"whole");
        fs::remove_file(&path).unwrap();
        with_file(&path, "old");
        let new = beside(&path, "partial-4194304");
        with_file(&new, "new");
        take_place(&new, &path).unwrap();
        assert_eq!(names(&path), ["new"]);
        assert_eq!(names(here.path()), [name.as_str()]);
        fs::remove_dir_all(&path).unwrap();
        // Of another name that begins so it is another.
        let mut other = name;
        other.pop();
        let other = path.with_file_name(other + "x");
        assert_ne!(beside(&path, "tmp"), beside(&other, "tmp"));
    }
}

#[test]
fn every_spelling_of_a_folder_is_one_place() {
    let here = tempfile::tempdir().unwrap();
    let at = |path: &str| here.path().join(path);
    fs::create_dir_all(at("house/ldi")).unwrap();
    let house = at("house").canonicalize().unwrap();
    for spelling in ["house", "house/", "house/.", "house/ldi/.."] {
        assert_eq!(place_of(&at(spelling)).unwrap(), house, "{spelling}");
    }
    let beside_it = beside(&house, "partial");
    assert_eq!(beside_it, house.with_file_name(".house.partial"));
    // What is not there yet.
    for spelling in ["above/new", "above/new/."] {
        let place = place_of(&at(spelling)).unwrap();
        let above = at("above").canonicalize().unwrap();
        assert_eq!(place, above.join("new"), "{spelling}");
    }
    assert_eq!(names(&at("above")), [""; 0]);
    // What has no name.
    for nameless in [Path::new("/"), at("gone/..").as_path()] {
        // Some systems resolve names, not folders.
        if cfg!(windows) {
            continue;
        }
        let error = place_of(nameless).unwrap_err().to_string();
        assert!(error.contains("choose a folder within it"), "{error}");
    }
}

#[cfg(unix)]
#[test]
fn a_link_is_the_place_that_it_leads_to() {
    let here = tempfile::tempdir().unwrap();
    let at = |path: &str| here.path().join(path);
    fs::create_dir(at("house")).unwrap();
    std::os::unix::fs::symlink(at("house"), at("link")).unwrap();
    assert_eq!(
        place_of(&at("link")).unwrap(),
        at("house").canonicalize().unwrap()
    );
}

#[test]
fn a_new_folder_takes_the_place_of_nothing_and_of_another() {
    let here = tempfile::tempdir().unwrap();
    let at = |path: &str| here.path().join(path);
    for file in ["one", "two"] {
        with_file(&at("new"), file);
        take_place(&at("new"), &at("house")).unwrap();
        assert_eq!(names(&at("house")), [file]);
        assert_eq!(names(here.path()), ["house"]);
    }
    // One that is not there takes no place.
    assert!(take_place(&at("new"), &at("house")).is_err());
    assert_eq!(names(&at("house")), ["two"]);
    assert_eq!(names(here.path()), ["house"]);
    // What a killed process left is not written over.
    let number = std::process::id();
    with_file(&at(&format!(".house.replaced-{number}")), "left");
    with_file(&at("new"), "three");
    take_place(&at("new"), &at("house")).unwrap();
    let left = format!(".house.replaced-{number}");
    assert_eq!(names(here.path()), [left.clone(), "house".to_owned()]);
    assert_eq!(names(&at(&left)), ["left"]);
    assert_eq!(names(&at("house")), ["three"]);
}

#[test]
fn entries_are_exchanged_all_or_none() {
    let here = tempfile::tempdir().unwrap();
    let at = |path: &str| here.path().join(path);
    with_file(&at("place"), "both");
    fs::write(at("place/mine"), "mine").unwrap();
    with_file(&at("new"), "both");
    fs::write(at("new/more"), "more").unwrap();
    fs::create_dir_all(at("new/deep")).unwrap();
    fs::write(at("new/deep/part"), "part").unwrap();
    fs::create_dir(at("old")).unwrap();
    let try_all = |names: &[&str]| exchange(names, &at("new"), &at("place"), &at("old"));
    // There is no `deep` to put this into.
    let error = try_all(&["both", "more", "deep/part"]).unwrap_err();
    assert!(error.to_string().contains("deep/part"), "{error}");
    assert_eq!(names(&at("place")), ["both", "mine"]);
    assert_eq!(names(&at("new")), ["both", "deep", "more"]);
    assert_eq!(names(&at("old")), [""; 0]);
    // Others' entries stay.
    try_all(&["both", "neither", "more"]).unwrap();
    assert_eq!(names(&at("place")), ["both", "mine", "more"]);
    assert_eq!(names(&at("new")), ["deep"]);
    assert_eq!(names(&at("old")), ["both"]);
}
