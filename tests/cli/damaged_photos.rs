//! Photos of which only decoding shows that they are damaged.

use crate::run::{Ran, files, lumigraph, with_wall};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// The photos' names, where along a wall they were taken, how far before it, and focal lengths in pixels. The
/// last two are to be held out.
const PHOTOS: [(&str, f64, f64, f64); 8] = [
    ("p0.png", -1.0, 2.0, 90.0),
    ("p1.png", -0.5, 3.0, 90.0),
    ("p2.png", 0.0, 2.0, 90.0),
    ("p3.png", 0.5, 3.0, 90.0),
    ("p4.png", 1.0, 2.0, 90.0),
    (DAMAGED, 9.0, 3.0, 900.0),
    ("q0.png", 0.1, 2.4, 300.0),
    ("q1.png", 8.9, 2.4, 300.0),
];
/// It shows another part of the wall than all others that are not held out, but as its lens is the longest,
/// those are weighed otherwise with it than without.
const DAMAGED: &str = "p5.png";

/// A folder with `tele`, a scene of the photos, one of which is damaged, and beside it `wall.json`, their proxy;
/// `path.json`, whose first and third frames are the same view, and whose second shows what that photo does;
/// `split.json`, and `fewer.json`, which holds out the damaged one, too.
fn with_tele() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let write = |file: &str, text: &str| fs::write(folder.path().join(file), text).unwrap();
    for part in ["tele/img", "tele/model"] {
        fs::create_dir_all(folder.path().join(part)).unwrap();
    }
    let (mut cameras, mut images, mut photos) = (String::new(), String::new(), Vec::new());
    for (i, (name, x, before, focal_px)) in PHOTOS.into_iter().enumerate() {
        let id = i + 1;
        writeln!(cameras, "{id} PINHOLE 96 72 {focal_px} {focal_px} 48 36").unwrap();
        writeln!(images, "{id} 1 0 0 0 {} 0 {before} {id} {name}\n", -x).unwrap();
        photos.push(format!(
            r#"{{"name": "{name}", "path": "img/{name}", "time_s": {i}}}"#
        ));
        let value = |x: u32, y: u32| (x * 7919 + y * 104_729 + id as u32 * 31) % 251;
        let pixel = |x: u32, y: u32| image::Rgb([value(x / 9, y / 9) as u8, 30 * id as u8, 99]);
        let photo = image::RgbImage::from_fn(96, 72, pixel);
        photo
            .save(folder.path().join("tele/img").join(name))
            .unwrap();
    }
    damage(&folder.path().join("tele/img").join(DAMAGED));
    write("tele/model/cameras.txt", &cameras);
    write("tele/model/images.txt", &images);
    write("tele/model/points3D.txt", "");
    let photos = photos.join(", ");
    let scene = format!(r#"{{"version": 1, "photos": [{photos}], "model": "model"}}"#);
    write("tele/scene.json", &scene);
    let wall = r#"{"version": 1, "kind": "plane", "point": [0, 0, 0], "normal": [0, 0, 1]}"#;
    write("wall.json", wall);
    let frame = |name: &str, x: f64| {
        format!(
            r#"{{"name": "{name}", "camera_from_world": [1, 0, 0, {}, 0, 1, 0, 0.05, 0, 0, 1, 2.4, 0, 0, 0, 1],
            "width": 96, "height": 72, "model": "PINHOLE", "params": [300, 300, 48, 36]}}"#,
            -x
        )
    };
    let frames = [frame("a", 0.1), frame("b", 8.9), frame("c", 0.1)].join(", ");
    let path = format!(r#"{{"version": 1, "fps": 30, "frames": [{frames}]}}"#);
    write("path.json", &path);
    write("split.json", r#"{"test": ["q0.png", "q1.png"]}"#);
    let fewer = format!(r#"{{"test": ["{DAMAGED}", "q0.png", "q1.png"]}}"#);
    write("fewer.json", &fewer);
    folder
}

/// Cuts a picture's end off, of which its header tells nothing.
fn damage(picture: &Path) {
    let whole = fs::read(picture).unwrap();
    fs::write(picture, &whole[..whole.len() * 2 / 3]).unwrap();
}

/// Renders the path without the photos of a split.
fn render(here: &Path, split: &str, more: &str) -> Ran {
    let line = format!(
        "render tele --proxy wall.json --hold-out {split} --path path.json --beta 0.5 {more}"
    );
    lumigraph(here, &line)
}

/// The same, and the frames.
fn frames(here: &Path, split: &str, more: &str, out: &str) -> (Ran, BTreeMap<PathBuf, Vec<u8>>) {
    let ran = render(here, split, &format!("{more} -o {out}")).ok();
    (ran, files(&here.join(out)))
}

/// How often a run says that it does without the damaged photo.
fn told(ran: &Ran) -> usize {
    let warning = format!("warning: photo {DAMAGED} is left out: ");
    ran.stderr.matches(&warning).count()
}

#[test]
fn photos_in_the_time_window_are_those_that_pictures_are_made_of() {
    let folder = with_tele();
    let more = "--frames 1..2 --time 0 --time-window 100 --json -o out";
    let ran = render(folder.path(), "split.json", more).ok();
    assert_eq!(told(&ran), 1, "{}", ran.stderr);
    let time = &ran.json()["report"]["time"];
    assert_eq!(time["photos_in_window"], serde_json::json!([5, 5]));
}

#[test]
fn all_frames_are_drawn_of_the_same_photos() {
    let folder = with_tele();
    let here = folder.path();
    let ways = [
        "--renderer triangulated",
        "--renderer exact",
        "--max-error 1",
        "--device reference",
        "--device gpu",
    ];
    for (i, way) in ways.into_iter().enumerate() {
        let fewer = format!("fewer{i}");
        let tried = render(here, "fewer.json", &format!("{way} -o {fewer}"));
        if way.contains("gpu") && tried.code == 1 && tried.stderr.contains("graphics device") {
            assert!(
                std::env::var_os("LUMIGRAPH_REQUIRE_GPU").is_none(),
                "a graphics device is required: {}",
                tried.stderr
            );
            eprintln!("SKIPPED: no graphics device: {}", tried.stderr);
            continue;
        }
        tried.ok();
        let expected = files(&here.join(fewer));
        // The damaged photo is found by the second of three frames.
        let more = format!("{way} --json");
        let (ran, whole) = frames(here, "split.json", &more, &format!("whole{i}"));
        assert!(whole == expected, "{way}");
        assert_eq!(told(&ran), 1, "{way}: {}", ran.stderr);
        // What is told is of the frames that stay.
        let said = "note: 1 of 3 frames show nothing: does the path lie in this scene's world?\n";
        assert!(ran.stderr.contains(said), "{way}: {}", ran.stderr);
        let json = ran.json();
        assert_eq!(json["report"]["photos_total"], 5, "{way}");
        assert_eq!(json["report"]["frames_empty"], 1, "{way}");
        for frame in json["frames"].as_array().unwrap() {
            let cost = &frame["cost"];
            let cameras = ["cameras_scored", "cameras_never_scored"];
            let cameras = cameras.map(|key| cost[key].as_u64().unwrap());
            assert_eq!(cameras.iter().sum::<u64>(), 5, "{way}: {frame}");
        }
        let more = format!("{way} --no-skip");
        let (_, all) = frames(here, "split.json", &more, &format!("all{i}"));
        assert!(all == expected, "{way}");
    }
}

#[test]
fn a_damaged_photo_that_no_frame_asks_for_changes_nothing_with_no_skip() {
    let folder = with_tele();
    let here = folder.path();
    let (ran, some) = frames(here, "split.json", "--frames 0..1", "some");
    assert_eq!(told(&ran), 0, "{}", ran.stderr);
    let (_, all) = frames(here, "split.json", "--frames 0..1 --no-skip", "all");
    assert!(some == all);
    let line = "--frames 0..1 --no-skip --strict -o strict";
    let error = render(here, "split.json", line).error(1);
    assert!(error.starts_with("photo p5.png: "), "{error}");
}

#[test]
fn parts_of_a_film_in_one_folder_are_drawn_of_the_same_photos() {
    let folder = with_tele();
    let here = folder.path();
    let (_, expected) = frames(here, "fewer.json", "--k 5", "expected");
    let part = |which: &str| {
        let more = format!("--k 5 --frames {which} --resume");
        let (ran, mut frames) = frames(here, "split.json", &more, "parts");
        assert!(frames.remove(Path::new("resume.json")).is_some());
        (ran, frames)
    };
    // 1. Parts that do not ask for the damaged photo know nothing of it.
    for (which, count) in [("2..3", 1), ("0..1", 2)] {
        let (ran, frames) = part(which);
        assert_eq!((told(&ran), frames.len()), (0, count), "{}", ran.stderr);
        assert!(frames.iter().all(|(file, bytes)| expected[file] != *bytes));
    }
    // 2. The part that does draws its own again, whether or not they were there.
    let (ran, frames) = part("0..2");
    assert_eq!((told(&ran), frames.len()), (1, 2), "{}", ran.stderr);
    assert!(frames.iter().all(|(file, bytes)| expected[file] == *bytes));
    let said = "note: other runs made frames of this film with that photo: 1 removed from parts;";
    assert!(ran.stderr.contains(said), "{}", ran.stderr);
    // 3. Others begin without it.
    let (ran, frames) = part("0..3");
    assert!(
        ran.stdout.contains("3 frames, 2 of them from before"),
        "{}",
        ran.stdout
    );
    assert_eq!(told(&ran), 1, "{}", ran.stderr);
    assert!(frames == expected);
    // 4. Repaired it is another photo, with which no frame was made.
    let other = here.join("tele/img/p4.png");
    fs::copy(other, here.join("tele/img").join(DAMAGED)).unwrap();
    let again = "--k 5 --frames 0..3 --resume -o parts";
    let error = render(here, "split.json", again).error(1);
    assert!(
        error.contains("made of other files: tele/img/p5.png "),
        "{error}"
    );
}

#[test]
fn all_photos_are_scored_by_pictures_of_the_same_others() {
    let folder = with_tele();
    let scores = |split: &str| {
        let line = format!("evaluate tele --proxy wall.json --hold-out {split} --beta 0.5 --json");
        let ran = lumigraph(folder.path(), &line).ok();
        assert_eq!(told(&ran), 1, "{}", ran.stderr);
        let mut scores = ran.json()["photos"].clone();
        for photo in scores.as_array_mut().unwrap() {
            photo.as_object_mut().unwrap().remove("cpu_ms");
        }
        scores
    };
    // The damaged photo is found as the second is drawn; held out, it cannot be scored.
    assert_eq!(scores("split.json"), scores("fewer.json"));
}

#[test]
fn photos_are_left_out_as_long_as_two_others_remain() {
    let folder = with_wall();
    let here = folder.path();
    let photo = |i: u32| here.join(format!("wall/images/{i:04}.png"));
    let frames = "render wall --proxy plane --no-exposure --path sweep --frames 2 --size 48x36";
    let check = |line: &str, count: &str| {
        let error = lumigraph(here, line).error(1);
        let said = format!(
            "{count} calibrated photos cannot be used, and too few remain (at least 2 are needed): "
        );
        assert!(error.starts_with(&said), "{line}: {error}");
        let said =
            "; copy such photos (in wall/images), or such masks, again from where they came from";
        assert!(error.ends_with(said), "{line}: {error}");
    };
    // 1. Two remain, of which none may be held out.
    (1..8).for_each(|i| damage(&photo(i)));
    let exposed = frames.replace(" --no-exposure", "");
    let ran = lumigraph(here, &format!("{exposed} --json -o two")).ok();
    assert_eq!(ran.json()["report"]["photos_total"], 2, "{}", ran.stderr);
    let evaluate = "evaluate wall --proxy plane --no-exposure --every 8 --size 48x36";
    check(evaluate, "7 of 7");
    // 2. None is whole: a frame finds all that it asks for.
    [0, 8].into_iter().for_each(|i| damage(&photo(i)));
    check(&format!("{frames} -o none"), "9 of 9");
    // What is found before any frame is, is found at once.
    let exposed = format!("{exposed} -o none");
    for line in [
        exposed.as_str(),
        "render wall --proxy dense --no-exposure --path sweep --frames 2 -o none",
        "proxy wall auto -o proxy.json",
        "proxy wall dense -o proxy.json",
        "field wall --view 0000.png -o field.png",
    ] {
        check(line, "9 of 9");
    }
}

#[test]
fn what_is_found_damaged_as_photos_are_compared_is_told_and_shows_in_no_frame() {
    let folder = with_wall();
    let here = folder.path();
    damage(&here.join("wall/images/0003.png"));
    for line in [
        "proxy wall dense -o dense.json",
        "render wall --proxy dense --no-exposure --path sweep --frames 0..1/2 --json -o out",
        "evaluate wall --proxy dense --no-exposure --every 8 --json",
    ] {
        let ran = lumigraph(here, line).ok();
        let said = "warning: photo 0003.png is left out: ";
        assert_eq!(ran.stderr.matches(said).count(), 1, "{}", ran.stderr);
        if line.contains("--json") {
            let held_out = if line.contains("--every") { 2 } else { 0 };
            assert_eq!(ran.json()["report"]["photos_total"], 8 - held_out, "{line}");
        }
        let error = lumigraph(here, &format!("{line} --strict")).error(1);
        assert!(error.starts_with("photo 0003.png: "), "{error}");
    }
}

#[test]
fn what_is_found_damaged_as_exposures_are_matched_shows_in_no_frame() {
    let folder = with_wall();
    let here = folder.path();
    damage(&here.join("wall/images/0008.png"));
    let line = "render wall --proxy plane --path sweep --frames 0..1/3 --json -o out";
    let ran = lumigraph(here, line).ok();
    let said = "photo 0008.png is left out: ";
    assert_eq!(ran.stderr.matches(said).count(), 1, "{}", ran.stderr);
    let report = ran.json()["report"].clone();
    assert_eq!(report["photos_total"], 8);
    assert_eq!(report["cpu_memory"]["loads"], report["photos_decoded"]);
    let note = report["notes"][0].as_str().unwrap();
    assert!(note.starts_with(said), "{note}");
    // A scene keeps it.
    let ran = lumigraph(here, "import wall -o scene").ok();
    let said = "note: for matching exposures, photo 0008.png is left out: ";
    assert!(ran.stderr.contains(said), "{}", ran.stderr);
}
