//! The folders that interiors are written into, however they are spelt.

use crate::interior::{ROOMS, names, with_house};
use crate::run::{files, lumigraph};

#[test]
fn the_folder_one_stands_in_is_filled_and_replaced_like_any_other() {
    let folder = with_house();
    let here = folder.path();
    std::fs::write(here.join("rooms.json"), ROOMS).unwrap();
    let line = "interior house/house.glb --rooms rooms.json -o one";
    lumigraph(here, line).ok();
    let expected = files(&here.join("one"));
    let two = here.join("two");
    std::fs::create_dir(&two).unwrap();
    let from_two = "interior ../house/house.glb --rooms ../rooms.json";
    for output in [".", ". --force", "../two/. --force", "../two --force"] {
        lumigraph(&two, &format!("{from_two} -o {output}")).ok();
        assert!(files(&two) == expected, "{output}");
        // Nothing is left beside it.
        let left = ["house", "one", "rooms.json", "two"];
        assert_eq!(names(here), left, "{output}");
    }
    // From within: what is not an interior's stays.
    std::fs::create_dir(two.join("mine")).unwrap();
    let from_mine = "interior ../../house/house.glb --rooms ../../rooms.json -o .. --force";
    let error = lumigraph(&two.join("mine"), from_mine).error(1);
    assert!(error.contains("..: the folder is not empty"), "{error}");
    assert_eq!(names(&two), ["house.glb", "interior.json", "mine"]);
    assert!(files(&two) == expected);
}

#[test]
fn a_generated_house_is_replaced_with_what_it_says_of_itself_and_nothing_of_ones_own() {
    let folder = with_house();
    let here = folder.path();
    let house = here.join("house");
    let replace = "interior house/house.glb --find -o house";
    let error = lumigraph(here, replace).error(1);
    assert!(error.contains("replace it with --force"), "{error}");
    // What somebody wrote is in the way, and named, before --force is advised.
    let own = std::fs::read_to_string(house.join("README.md")).unwrap();
    for (file, text) in [
        ("README.md", "# house\n\nMine.\n".to_owned()),
        ("README.md", format!("{own}- My notes.\n")),
        ("notes.txt", String::new()),
    ] {
        std::fs::write(house.join(file), text).unwrap();
        let before = files(&house);
        for force in ["", " --force"] {
            let error = lumigraph(here, &format!("{replace}{force}")).error(1);
            let said = format!("house: the folder is not empty: it holds an interior, and {file};");
            assert!(error.contains(&said), "{error}");
        }
        assert!(files(&house) == before);
        std::fs::write(house.join("README.md"), &own).unwrap();
    }
    std::fs::remove_file(house.join("notes.txt")).unwrap();
    lumigraph(here, &format!("{replace} --force")).ok();
    let expected = [
        "floor-plan.png",
        "floor-plan.svg",
        "house.glb",
        "interior.json",
    ];
    assert_eq!(names(&house), expected);
}

#[cfg(unix)]
#[test]
fn who_stands_in_a_folder_that_is_replaced_stays_in_it() {
    use std::os::unix::fs::MetadataExt;
    let folder = with_house();
    let here = folder.path();
    std::fs::create_dir(here.join("two")).unwrap();
    let number = || std::fs::metadata(here.join("two")).unwrap().ino();
    let before = number();
    std::fs::write(here.join("rooms.json"), ROOMS).unwrap();
    for force in ["", " --force"] {
        let line = "interior ../house/house.glb --rooms ../rooms.json -o .";
        lumigraph(&here.join("two"), &format!("{line}{force}")).ok();
        assert_eq!(number(), before);
    }
}
