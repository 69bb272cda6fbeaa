//! Photos of which only decoding shows that they are damaged.

use crate::run::{Ran, lumigraph};
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
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
    lumigraph(here, &line).ok()
}

#[test]
fn photos_in_the_time_window_are_those_that_pictures_are_made_of() {
    let folder = with_tele();
    let more = "--frames 1..2 --time 0 --time-window 100 --json -o out";
    let ran = render(folder.path(), "split.json", more);
    let warning = format!("warning: photo {DAMAGED} is left out: ");
    assert_eq!(ran.stderr.matches(&warning).count(), 1, "{}", ran.stderr);
    let time = &ran.json()["report"]["time"];
    assert_eq!(time["photos_in_window"], serde_json::json!([5, 5]));
}
