//! LDIs made as files, and walks that read them.

use crate::interior::{names, with_house};
use crate::run::{files, lumigraph, with_generated};
use serde_json::Value;
use std::path::Path;

const WALK: &str = "walk house --portals ldi --frames 8 --size 48x36 --reference-size 24x24 --json";
const MAKE: &str = "ldis house --reference-size 24x24";

/// Walks, and returns the frames' bytes, how many LDIs were made and read, and what was said.
fn walked(here: &Path, more: &str) -> (Vec<Vec<u8>>, [u64; 2], String) {
    let out = here.join("out");
    let _ = std::fs::remove_dir_all(&out);
    let ran = lumigraph(here, &format!("{WALK}{more} -o out")).ok();
    let report: Value = ran.json();
    let walk = &report["walks"][0];
    let frames = walk["frames"].as_array().unwrap();
    let sum = |what: &str| -> u64 { frames.iter().filter_map(|f| f[what].as_u64()).sum() };
    assert_eq!(sum("ldis_read"), walk["ldis_read"].as_u64().unwrap());
    let pictures = names(&out).into_iter().filter(|n| n.ends_with(".png"));
    let pictures = pictures.map(|name| std::fs::read(out.join(name)).unwrap());
    let made = sum("ldis_made") + sum("ldis_ahead");
    (pictures.collect(), [made, sum("ldis_read")], ran.stderr)
}

fn ldis(folder: &Path) -> Vec<String> {
    let all = names(folder).into_iter();
    all.filter(|name| name.ends_with(".ldi")).collect()
}

#[test]
fn walks_read_the_layered_images_that_were_made_for_them() {
    let folder = with_house();
    let here = folder.path();
    for more in ["", " --ldi-views 3"] {
        let (pictures, [made, read], _) = walked(here, &format!("{more} --no-ldi-files"));
        assert!(pictures.len() == 8 && made > 0 && read == 0);
        let ran = lumigraph(here, &format!("{MAKE}{more} --json")).ok();
        let report = ran.json();
        let all = ldis(&here.join("house/ldi"));
        assert_eq!(report["files"], all.len());
        assert_eq!(
            (&report["made"], &report["none"]),
            (&report["files"], &0.into())
        );
        assert_eq!(
            ran.stderr.contains("note: "),
            !more.is_empty(),
            "{}",
            ran.stderr
        );
        let size = |name: &String| here.join("house/ldi").join(name).metadata().unwrap().len();
        assert_eq!(report["bytes"], all.iter().map(size).sum::<u64>());
        // Read, nothing made, by any threads, from another folder, with little memory.
        for other in ["", " --threads 1", " --cpu-memory 1"] {
            let (again, [made, read], said) = walked(here, &format!("{more}{other}"));
            assert!(again == pictures && made == 0 && read > 0, "{more}{other}");
            assert!(!said.contains("note: "), "{said}");
        }
        let inside = WALK.replace("walk house", "walk interior.json");
        let ran = lumigraph(&here.join("house"), &format!("{inside}{more} -o ../out")).ok();
        assert_eq!(ran.json()["walks"][0]["ldis_made"], 0, "{}", ran.stderr);
        // Again, byte for byte, on one thread.
        let before = files(&here.join("house/ldi"));
        let said = lumigraph(here, &format!("{MAKE}{more}")).ok().stdout;
        let expected = format!("house/ldi: {0} LDIs, {0} of them from before, ", all.len());
        assert!(said.starts_with(&expected), "{said}");
        std::fs::remove_dir_all(here.join("house/ldi")).unwrap();
        lumigraph(here, &format!("--threads 1 {MAKE}{more}")).ok();
        assert!(files(&here.join("house/ldi")) == before);
    }
    // An interior made anew takes them with it, but nothing else that lies there.
    let again = "interior house/house.glb -o found --force";
    lumigraph(here, again).ok();
    lumigraph(here, "ldis found --reference-size 24x24").ok();
    let mine = here.join("found/ldi/mine.txt");
    std::fs::write(&mine, "").unwrap();
    let error = lumigraph(here, again).error(1);
    let said = "found: the folder is not empty: it holds an interior, and ldi/mine.txt;";
    assert!(error.contains(said), "{error}");
    std::fs::remove_file(mine).unwrap();
    // Nor is what a run that was killed left in the way; the next one removes it.
    let left = here.join("found/ldi/.made.json.4711.tmp");
    std::fs::write(&left, "{").unwrap();
    lumigraph(here, "ldis found --reference-size 24x24").ok();
    assert!(!left.exists());
    std::fs::write(&left, "{").unwrap();
    lumigraph(here, again).ok();
    assert!(!here.join("found/ldi").exists());
}

#[test]
fn what_is_missing_or_broken_is_made_again() {
    let folder = with_house();
    let here = folder.path();
    let (pictures, ..) = walked(here, "");
    lumigraph(here, MAKE).ok();
    let own = here.join("house/ldi");
    let before = files(&own);
    let all = ldis(&own);
    // 1. Interrupted, with another's file beside.
    std::fs::remove_file(own.join(&all[0])).unwrap();
    std::fs::write(own.join("mine.txt"), "").unwrap();
    let (again, [made, read], _) = walked(here, "");
    assert!(again == pictures && made <= 1 && read > 0);
    let said = lumigraph(here, &format!("{MAKE} --json")).ok().json();
    assert_eq!(
        (&said["made"], &said["files"]),
        (&1.into(), &all.len().into())
    );
    // 2. Broken.
    let whole = std::fs::read(own.join(&all[0])).unwrap();
    for name in &all {
        std::fs::write(own.join(name), &whole[..99]).unwrap();
    }
    let error = lumigraph(here, &format!("{WALK} -o out")).error(1);
    assert!(
        error.contains("house/ldi/0") && error.contains("99 bytes"),
        "{error}"
    );
    assert!(error.contains("`lumigraph ldis` makes it again"), "{error}");
    assert!(!error.contains("make it again"), "{error}");
    // Of something else, under another's name.
    for name in &all[1..] {
        std::fs::write(own.join(name), &whole).unwrap();
    }
    // A bit of its last sample is another.
    let mut damaged = whole.clone();
    *damaged.last_mut().unwrap() ^= 1;
    std::fs::write(own.join(&all[1]), damaged).unwrap();
    let ran = lumigraph(here, &format!("{MAKE} --json")).ok();
    assert_eq!(ran.json()["made"], all.len());
    assert!(ran.stderr.contains("expected portal "), "{}", ran.stderr);
    let said = "damaged: its checksum is another; it is made again";
    assert!(ran.stderr.contains(said), "{}", ran.stderr);
    assert!(!ran.stderr.contains("; make it again"), "{}", ran.stderr);
    std::fs::remove_file(own.join("mine.txt")).unwrap();
    assert!(files(&own) == before);
    assert!(walked(here, "").0 == pictures);
}

#[test]
fn layered_images_of_other_files_or_options_are_not_used() {
    let folder = with_house();
    let here = folder.path();
    let own = here.join("house/ldi");
    lumigraph(here, MAKE).ok();
    let unused = |more: &str, said: &str| {
        let (pictures, [made, read], notes) = walked(here, more);
        assert!(made > 0 && read == 0, "{more}");
        assert!(notes.contains(said), "{notes}");
        let without = walked(here, &format!("{more} --no-ldi-files"));
        assert!(pictures == without.0 && !without.2.contains("note: "));
    };
    // 1. Options.
    let (views, size) = (" --ldi-views 3", " --reference-views 5");
    unused(
        views,
        "made with other options: ldi_views was none, is 3; make it again",
    );
    unused(
        size,
        "note: house/ldi was made with other options: views was 13, is 5;",
    );
    // Of before cameras stood over floors that the triangles of nodes tell.
    let file = own.join("made.json");
    let bytes = std::fs::read(&file).unwrap();
    let mut made: Value = serde_json::from_slice(&bytes).unwrap();
    made["version"] = 6.into();
    std::fs::write(&file, made.to_string()).unwrap();
    unused("", "made with other options: version was 6, is ");
    std::fs::write(&file, bytes).unwrap();
    assert!(walked(here, "").1[0] == 0);
    // 2. Files: written again, longer, the same to the byte.
    for file in ["house.glb", "interior.json"] {
        let path = here.join("house").join(file);
        let bytes = std::fs::read(&path).unwrap();
        std::fs::write(&path, &bytes).unwrap();
        unused(
            "",
            &format!("was made of other files: {file} was written since; make it again"),
        );
        let ran = lumigraph(here, MAKE).ok();
        let said =
            format!("house/ldi was made of other files: {file} was written since; it is made anew");
        assert!(ran.stderr.contains(&said), "{}", ran.stderr);
        assert!(walked(here, "").1[0] == 0);
    }
    // 3. What was interrupted after a change, and what nobody knows.
    std::fs::write(own.join("mine.txt"), "").unwrap();
    std::fs::write(own.join("of-old.ldi"), "").unwrap();
    std::fs::write(own.join("half.ldi.part"), "").unwrap();
    std::fs::write(own.join("made.json"), "{}").unwrap();
    unused(
        "",
        "house/ldi has a made.json that this program does not know; make it again",
    );
    let ran = lumigraph(here, MAKE).ok();
    assert!(ran.stderr.contains("it is made anew"), "{}", ran.stderr);
    let left = names(&own);
    assert!(left.contains(&"mine.txt".to_owned()) && left.len() == ldis(&own).len() + 2);
    assert!(walked(here, "").1[0] == 0);
    std::fs::remove_file(own.join("made.json")).unwrap();
    unused(
        "",
        "note: house/ldi has LDIs and no made.json; make it again with `lumigraph ldis`",
    );
    // Nothing is said of what was never begun.
    let aside = here.join("aside");
    std::fs::rename(&own, &aside).unwrap();
    let (_, [made, read], notes) = walked(here, "");
    assert!(
        made > 0 && read == 0 && !notes.contains("note: "),
        "{notes}"
    );
    std::fs::rename(&aside, &own).unwrap();
    let ran = lumigraph(here, MAKE).ok();
    assert!(
        ran.stderr.contains("has LDIs and no made.json"),
        "{}",
        ran.stderr
    );
    assert_eq!(lumigraph(here, "ldis house --reference-views 4").code, 2);
    assert!(
        lumigraph(here, "ldis nowhere")
            .error(1)
            .contains("nowhere: ")
    );
}

#[test]
fn layered_images_of_photos_are_read_by_walks_with_the_same_photos() {
    let folder = with_generated("hallway --size 96x72 -o hall");
    let here = folder.path();
    std::fs::write(here.join("halves.json"), crate::interior::HALVES).unwrap();
    lumigraph(here, "interior hall --rooms halves.json -o house").ok();
    for more in ["", " --ldi-from views --ldi-views 5", " --no-photos"] {
        let (pictures, [made, _], _) = walked(here, more);
        assert!(made > 0, "{more}");
        lumigraph(here, &format!("{MAKE}{more}")).ok();
        let (again, [made, read], said) = walked(here, more);
        assert!(again == pictures && made == 0 && read > 0, "{more}: {said}");
    }
    lumigraph(here, MAKE).ok();
    assert_eq!(walked(here, "").1[0], 0);
    for (more, said) in [
        (" --no-exposure", "exposure was "),
        (" --cpu-memory 1MB", "cpu_memory was none, is 1000000"),
        (" --ldi-from views", "ldi_from was photos, is views"),
        (" --no-photos", "calibration was "),
    ] {
        let (_, [made, read], notes) = walked(here, more);
        assert!(made > 0 && read == 0 && notes.contains(said), "{notes}");
    }
    // A depth map that is away for a while: of photos without one less is known.
    let map = names(&here.join("hall/depth")).remove(0);
    let [there, aside] = [here.join("hall/depth").join(&map), here.join("aside.png")];
    std::fs::rename(&there, &aside).unwrap();
    let notes = walked(here, "").2;
    let said = format!("was made of other files: ../hall/depth/{map} is gone; make it again");
    assert!(notes.contains(&said), "{notes}");
    std::fs::rename(&aside, &there).unwrap();
    assert_eq!(walked(here, "").1[0], 0);
    // A photo, and a camera of the calibration by its last bit.
    let photo = names(&here.join("hall/images")).remove(0);
    let photo = here.join("hall/images").join(photo);
    std::fs::write(&photo, std::fs::read(&photo).unwrap()).unwrap();
    let notes = walked(here, "").2;
    assert!(notes.contains("of other files: ../hall/images/"), "{notes}");
    lumigraph(here, MAKE).ok();
    let cameras = here.join("hall/sparse/0/cameras.bin");
    let mut bytes = std::fs::read(&cameras).unwrap();
    let last_number = bytes.len() - 8;
    bytes[last_number] ^= 1;
    std::fs::write(&cameras, bytes).unwrap();
    let notes = walked(here, "").2;
    assert!(notes.contains("other options: calibration was "), "{notes}");
}

#[test]
fn options_that_change_nothing_of_a_captures_rooms_are_said_to() {
    let folder = with_generated("hallway --size 96x72 -o hall");
    let here = folder.path();
    std::fs::write(here.join("halves.json"), crate::interior::HALVES).unwrap();
    lumigraph(here, "interior hall --rooms halves.json -o house").ok();
    let walk = WALK.replace("--frames 8", "--frames 1");
    // Of one view, so that they are made at once.
    let small = "--reference-views 1";
    let of_photos = "note: --ldi-views changes nothing: LDIs are made of photos (--ldi-from views)";
    let without = "note: --no-exposure and --ldi-from change nothing: --no-photos draws the model's own colours";
    for (line, expected) in [
        (format!("{walk} --ldi-views 3 -o made"), Some(of_photos)),
        (format!("{MAKE} --ldi-views 3"), Some(of_photos)),
        // With those files, too.
        (format!("{walk} --ldi-views 3 -o read"), Some(of_photos)),
        (format!("{walk} -o all"), None),
        (
            format!("{walk} {small} --ldi-from views --ldi-views 3 -o views"),
            None,
        ),
        (
            format!("{walk} {small} --no-photos --ldi-views 3 -o plain"),
            None,
        ),
        (
            format!("{walk} {small} --no-photos --no-exposure --ldi-from views -o plain"),
            Some(without),
        ),
    ] {
        let said = lumigraph(here, &line).ok().stderr;
        let notes: Vec<&str> = said.lines().filter(|l| l.contains("nothing: ")).collect();
        assert_eq!(notes, Vec::from_iter(expected), "{line}");
    }
    for line in [walk.as_str(), MAKE] {
        let out = if line == MAKE { "" } else { " -o none" };
        let ran = lumigraph(here, &format!("{line} --no-photos --ldi-from photos{out}"));
        assert_eq!(
            ran.error(2),
            "--ldi-from photos: with --no-photos there are none; leave out one of them"
        );
    }
}

#[test]
fn that_making_one_takes_more_than_the_budget_is_told() {
    let folder = with_house();
    let here = folder.path();
    let walk = "walk house --frames 1 --size 32x24 --reference-size 24x24 -o out";
    let said = "note: making a layered depth image of 13 views of 24 × 24 pixels may take ";
    for (line, is_told) in [
        (format!("{walk} --portals ldi --cpu-memory 100kB"), true),
        (format!("{walk} --portals ldi --cpu-memory 1MB"), false),
        (format!("{walk} --portals ldi"), false),
        (format!("{walk} --portals warp2 --cpu-memory 100kB"), false),
        (format!("{MAKE} --cpu-memory 100kB"), true),
    ] {
        let ran = lumigraph(here, &line).ok();
        assert_eq!(ran.stderr.contains(said), is_told, "{line}: {}", ran.stderr);
    }
}
