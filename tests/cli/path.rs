//! `lumigraph path`, and paths of nerfstudio.

use crate::interior::with_house;
use crate::run::{files, lumigraph, with_wall};
use image::RgbaImage;
use render::path::{ShotLook, read, write_shot};
use serde_json::{Value, json};
use std::path::Path;

fn pixels(path: &Path) -> RgbaImage {
    image::open(path).unwrap().into_rgba8()
}

fn most_apart(a: &RgbaImage, b: &RgbaImage) -> u8 {
    let pairs = a.as_raw().iter().zip(b.as_raw());
    pairs.map(|(a, b)| a.abs_diff(*b)).max().unwrap()
}

/// A path of two keyframes before the wall.
fn keyframes() -> Value {
    let keyframe = |t_s: f64, x: f64| {
        json!({"t_s": t_s, "camera_from_world": [1, 0, 0, x, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1],
            "width": 64, "height": 48, "model": "PINHOLE", "params": [60, 60, 32, 24]})
    };
    json!({"version": 1, "fps": 2, "keyframes": [keyframe(0.0, 0.0), keyframe(1.0, 0.1)]})
}

#[test]
fn two_frames_of_a_derived_path_show_two_places() {
    let folder = with_wall();
    for kind in ["orbit", "dolly", "sweep"] {
        let line =
            format!("render wall --proxy plane --path {kind} --frames 2 --size 48x36 -o {kind}");
        lumigraph(folder.path(), &line).ok();
        let frames: Vec<Vec<u8>> = files(&folder.path().join(kind)).into_values().collect();
        assert!(frames.len() == 2 && frames[0] != frames[1], "{kind}");
    }
}

#[test]
fn a_last_keyframe_between_frames_is_told() {
    let folder = with_wall();
    let here = folder.path();
    for (t_s, is_shown) in [(1.0, true), (1.0 + 1e-9, true), (1.2, false)] {
        let mut path = keyframes();
        path["keyframes"][1]["t_s"] = json!(t_s);
        std::fs::write(here.join("own.json"), path.to_string()).unwrap();
        let note = "note: own.json: no frame shows the last keyframe, at 1.200 s: the path ends at 1.000 s, with its \
                    last frame of 2 a second\n";
        for line in [
            "path own.json --format lumigraph -o frames.json",
            "path own.json --format nerfstudio -o theirs.json",
            "render wall --proxy plane --path own.json --size 24x18 -o frames",
        ] {
            let said = lumigraph(here, line).ok().stderr;
            let told = said.matches(note).count();
            assert_eq!(told, usize::from(!is_shown), "{t_s}: {line}: {said}");
            assert_eq!(said.contains("last keyframe"), !is_shown, "{line}: {said}");
        }
        let read = read(&here.join("frames.json")).unwrap();
        assert_eq!(read.frames.len(), 3, "{t_s}");
    }
}

#[test]
fn paths_go_to_nerfstudio_and_back() {
    let folder = with_wall();
    let here = folder.path();
    std::fs::write(here.join("own.json"), keyframes().to_string()).unwrap();
    // Its world is turned, moved and scaled.
    let transform = json!({"transform": [[0, -1, 0, 3], [1, 0, 0, 4], [0, 0, 1, 5]], "scale": 0.2});
    std::fs::write(here.join("dp.json"), transform.to_string()).unwrap();
    let there = "--dataparser-transforms dp.json";
    let line = format!("path own.json --format nerfstudio {there} -o theirs/path.json");
    let said = lumigraph(here, &line).ok().stdout;
    assert_eq!(said, "theirs/path.json: 3 frames, 2 a second\n");
    let text = std::fs::read(here.join("theirs/path.json")).unwrap();
    let theirs: Value = serde_json::from_slice(&text).unwrap();
    let fov = theirs["camera_path"][0]["fov"].as_f64().unwrap();
    assert!((fov - 2.0 * (24.0_f64 / 60.0).atan().to_degrees()).abs() < 1e-9);
    assert_eq!(theirs["keyframes"].as_array().unwrap().len(), 2);
    // The same pictures, by either, and by what comes back.
    let back = format!("path theirs/path.json --format lumigraph {there} -o back.json");
    lumigraph(here, &back).ok();
    let render = "render wall --proxy plane --path";
    lumigraph(here, &format!("{render} own.json -o own")).ok();
    lumigraph(here, &format!("{render} theirs/path.json {there} -o b")).ok();
    lumigraph(here, &format!("{render} back.json -o c")).ok();
    for name in ["frame_0000.png", "frame_0001.png", "frame_0002.png"] {
        let own = pixels(&here.join("own").join(name));
        for other in ["b", "c"] {
            let other = pixels(&here.join(other).join(name));
            assert!(most_apart(&own, &other) <= 1, "{name}");
        }
    }
    // Elsewhere it is seen from elsewhere.
    lumigraph(here, &format!("{render} theirs/path.json -o d")).ok();
    let [a, d] = ["own", "d"].map(|folder| pixels(&here.join(folder).join("frame_0001.png")));
    assert!(most_apart(&a, &d) > 50);

    let mut fisheye = theirs;
    fisheye["camera_type"] = json!("fisheye");
    std::fs::write(here.join("fisheye.json"), fisheye.to_string()).unwrap();
    let error = lumigraph(here, &format!("{render} fisheye.json -o x")).error(1);
    assert!(error.contains("only \"perspective\" is read"), "{error}");
    let error = lumigraph(
        here,
        &format!("{render} own.json --dataparser-transforms own.json -o x"),
    );
    assert!(error.error(1).contains("dataparser_transforms.json"));
}

#[test]
fn a_calibration_is_no_path_and_its_error_says_what_draws_its_poses() {
    let folder = with_wall();
    let here = folder.path();
    lumigraph(here, "export wall --format transforms -o t.json").ok();
    std::fs::write(here.join("model.nvm"), "NVM_V3\n").unwrap();
    lumigraph(here, "export wall --format opencv -o cv.yml").ok();
    let render = "render wall --proxy plane --size 48x36";
    let error = lumigraph(here, &format!("{render} --path t.json -o x")).error(1);
    let said = "t.json: a calibration, not a path file; `lumigraph render SCENE --views t.json -o FRAMES` draws";
    assert!(error.contains(said), "{error}");
    for (option, file) in [
        ("--views", "model.nvm"),
        ("--path", "model.nvm"),
        ("--views", "cv.yml"),
    ] {
        let error = lumigraph(here, &format!("{render} {option} {file} -o x")).error(1);
        let said = format!(
            "{file}: a calibration, not a path file; with its photos, `lumigraph import PHOTOS --calibration {file} \
             -o SCENE` and `lumigraph export SCENE --format colmap -o MODEL` make a model"
        );
        assert!(error.contains(&said), "{error}");
    }
    lumigraph(here, "import wall/images --calibration t.json -o scene").ok();
    lumigraph(here, "export scene --format colmap -o model").ok();
    lumigraph(here, &format!("{render} --views model -o theirs")).ok();
    lumigraph(here, &format!("{render} --views wall -o own")).ok();
    let [own, theirs] = ["own", "theirs"].map(|folder| pixels(&here.join(folder).join("0003.png")));
    assert!(most_apart(&own, &theirs) <= 1);
}

#[test]
fn a_screenshot_is_a_path_wherever_one_is_read() {
    let folder = with_house();
    let here = folder.path();
    // As the window writes one: of a tour's frame, whatever it shows.
    lumigraph(here, "walk house --frames 2 --size 32x24 -o tour").ok();
    let tour = read(&here.join("tour/path.json")).unwrap();
    let view = &tour.frames[1].view;
    let picture = pixels(&here.join("tour/frame_0001.png"));
    let shoot = |layer: &str, options: &str| {
        let look = ShotLook {
            layer: layer.to_owned(),
            options: options.to_owned(),
            meanwhile: String::new(),
        };
        write_shot(&here.join("shot_0001.png"), &picture, view, None, &look).unwrap();
    };
    shoot("picture", "");
    // Interiors are drawn again, and it goes where paths go.
    lumigraph(here, "walk house --path shot_0001.png -o again").ok();
    assert!(pixels(&here.join("again/shot_0001.png")) == picture);
    for format in ["lumigraph", "nerfstudio"] {
        let line = format!("path shot_0001.png --format {format} -o {format}.json");
        let said = lumigraph(here, &line).ok().stdout;
        assert_eq!(said, format!("{format}.json: 1 frames, 30 a second\n"));
    }
    let again = read(&here.join("lumigraph.json")).unwrap();
    assert_eq!(again.frames[0].view, *view);
    // Which is no calibration.
    for (file, frames) in [
        ("shot_0001.png", "one frame"),
        ("lumigraph.json", "one frame"),
        ("nerfstudio.json", "one frame"),
        ("tour/path.json", "2 frames"),
    ] {
        let error = lumigraph(here, &format!("info {file}")).error(1);
        assert_eq!(
            error,
            format!(
                "{file}: a camera path of {frames}, no calibration; `lumigraph render SCENE --path {file} -o \
                 FRAMES` draws it, or of an interior `lumigraph walk INTERIOR --path {file} -o FRAMES`"
            )
        );
    }
    // What it shows and is not drawn is told.
    let notes = |output: &str| {
        let line = format!("walk house --path shot_0001.png --reference-size 8x8 -o {output}");
        let said = lumigraph(here, &line).ok().stderr;
        let of_shot = said
            .lines()
            .filter(|line| line.starts_with("note: shot_0001.png: "));
        of_shot.map(str::to_owned).collect::<Vec<_>>()
    };
    assert!(notes("alike").is_empty());
    shoot("picture", "--portals texture");
    assert_eq!(
        notes("geometry"),
        [
            "note: shot_0001.png: it was drawn with --portals texture; with default options the \
          picture is another"
        ]
    );
    shoot("picture", "--portals ldi --ldi-views 3");
    assert!(notes("views --portals ldi --ldi-views 3").is_empty());
    assert_eq!(
        notes("ldi --portals ldi"),
        [
            "note: shot_0001.png: it was drawn with --portals ldi --ldi-views 3; with --portals ldi the \
          picture is another"
        ]
    );
    shoot("depth", "");
    assert_eq!(
        notes("picture"),
        ["note: shot_0001.png: it shows the depth of its view; what is drawn is the picture"]
    );
    // Pictures from elsewhere are not.
    let error = lumigraph(here, "walk house --path tour/frame_0001.png -o x").error(1);
    let expected = "tour/frame_0001.png: no pose is stored in it; expected a screenshot";
    assert!(error.starts_with(expected), "{error}");
}

#[test]
fn a_path_is_not_written_over_what_it_is_made_of() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    std::fs::write(here.join("own.json"), keyframes().to_string()).unwrap();
    let transform = json!({"transform": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]], "scale": 1});
    std::fs::write(here.join("dp.json"), transform.to_string()).unwrap();
    let there = "--dataparser-transforms dp.json";
    let line = format!("path own.json --format nerfstudio {there} -o theirs.json");
    lumigraph(here, &line).ok();
    let before = files(here);
    for (path, format, output) in [
        ("own.json", "lumigraph", "own.json"),
        ("own.json", "nerfstudio", "./own.json"),
        ("theirs.json", "lumigraph", "theirs.json"),
        ("theirs.json", "nerfstudio", "theirs.json"),
        ("theirs.json", "lumigraph", "dp.json"),
    ] {
        let line = format!("path {path} --format {format} {there} -o {output}");
        let error = lumigraph(here, &line).error(1);
        let said = format!("{output}: the path is made of this very file; nothing was written");
        assert!(error.starts_with(&said), "{line}: {error}");
        assert!(files(here) == before, "{line}");
    }
}

#[test]
fn lenses_that_nerfstudio_does_not_know_are_told_of_the_path_that_has_them() {
    let folder = tempfile::tempdir().unwrap();
    let mut path = keyframes();
    path["keyframes"][0]["params"] = json!([60, 60, 33, 24]);
    std::fs::write(folder.path().join("own.json"), path.to_string()).unwrap();
    let line = "path own.json --format nerfstudio -o theirs.json";
    let error = lumigraph(folder.path(), line).error(1);
    assert!(
        error.starts_with("own.json: frame 0: its camera"),
        "{error}"
    );
}

#[test]
fn times_of_the_scene_that_are_lost_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let run = |times: [Option<f64>; 2], format: &str| {
        let mut path = keyframes();
        for (keyframe, time_s) in path["keyframes"]
            .as_array_mut()
            .unwrap()
            .iter_mut()
            .zip(times)
        {
            if let Some(time_s) = time_s {
                keyframe["time_s"] = json!(time_s);
            }
        }
        std::fs::write(here.join("own.json"), path.to_string()).unwrap();
        lumigraph(
            here,
            &format!("path own.json --format {format} -o {format}.json"),
        )
    };
    let note = "note: left out: the scene's times; nerfstudio's format has no place for them";
    for (times, format, is_told) in [
        ([None, None], "nerfstudio", false),
        // Those of the film.
        ([Some(0.0), Some(1.0)], "nerfstudio", false),
        ([Some(0.0), Some(0.7)], "nerfstudio", true),
        ([Some(0.0), Some(0.7)], "lumigraph", false),
    ] {
        let said = run(times, format).ok().stderr;
        assert_eq!(said.contains(note), is_told, "{times:?} {format}: {said}");
    }
    // A path may begin when it likes.
    let mut late = keyframes();
    for keyframe in late["keyframes"].as_array_mut().unwrap() {
        keyframe["t_s"] = json!(keyframe["t_s"].as_f64().unwrap() + 5.0);
    }
    std::fs::write(here.join("late.json"), late.to_string()).unwrap();
    let line = "path late.json --format nerfstudio -o late_theirs.json";
    let said = lumigraph(here, line).ok().stderr;
    assert!(!said.contains("left out"), "{said}");
    // With one of them nobody would know the other.
    let error = run([Some(0.7), None], "lumigraph").error(1);
    let expected = "own.json: keyframe 1: it has no time_s, though keyframe 0 has one; give one to all \
                    keyframes, or to none";
    assert_eq!(error, expected);
}

#[test]
fn what_cannot_be_drawn_is_said_with_its_file_and_what_to_do() {
    let folder = with_wall();
    let here = folder.path();
    for (name, size) in [("large.json", 100_000), ("small.json", 64)] {
        let mut frame = keyframes()["keyframes"][0].take();
        frame.as_object_mut().unwrap().remove("t_s");
        frame["name"] = json!("f0");
        for side in ["width", "height"] {
            frame[side] = json!(size);
        }
        let path = json!({"version": 1, "fps": 2, "frames": [frame]});
        std::fs::write(here.join(name), path.to_string()).unwrap();
    }
    let render = "render wall --proxy plane -o x";
    for (line, said) in [
        (
            format!("{render} --path large.json"),
            "large.json: frame f0 has 100000 x 100000 pixels; at most 16384 are drawn each way: give --size",
        ),
        (
            format!("{render} --views wall/sparse/0/images.bin"),
            "wall/sparse/0/images.bin: a file of a COLMAP model; its views are those of its folder: --views wall/sparse/0",
        ),
        #[cfg(feature = "window")]
        (
            "view wall --path small.json".to_owned(),
            "small.json: it has frames, not keyframes, which alone can be moved here; `lumigraph render wall --path \
             small.json -o FRAMES` draws it",
        ),
    ] {
        assert_eq!(lumigraph(here, &line).error(1), said);
    }
    assert!(!here.join("x").exists());
}

#[test]
fn transforms_that_no_path_needs_are_told() {
    let folder = with_wall();
    let here = folder.path();
    std::fs::write(here.join("own.json"), keyframes().to_string()).unwrap();
    let transform = json!({"transform": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]], "scale": 1});
    std::fs::write(here.join("dp.json"), transform.to_string()).unwrap();
    let there = "--dataparser-transforms dp.json";
    lumigraph(here, "path own.json --format nerfstudio -o theirs.json").ok();
    let render = "render wall --proxy plane --size 32x24 -o out";
    for (line, is_idle) in [
        (
            "path own.json --format lumigraph -o a.json".to_owned(),
            true,
        ),
        (
            "path own.json --format nerfstudio -o b.json".to_owned(),
            false,
        ),
        (
            "path theirs.json --format lumigraph -o c.json".to_owned(),
            false,
        ),
        (format!("{render} --path sweep --frames 2"), true),
        (format!("{render} --path own.json"), true),
        (format!("{render} --views wall/sparse/0"), true),
        (format!("{render} --path theirs.json"), false),
    ] {
        let said = lumigraph(here, &format!("{line} {there}")).ok().stderr;
        let note =
            "note: --dataparser-transforms changes nothing: there is no path of nerfstudio's\n";
        assert_eq!(said.contains(note), is_idle, "{line}: {said}");
    }
}

#[test]
fn derived_paths_are_no_files() {
    let folder = with_wall();
    for kind in ["orbit", "dolly", "sweep"] {
        let line = format!("path {kind} --format nerfstudio -o theirs.json");
        let error = lumigraph(folder.path(), &line).error(2);
        let said = format!("{kind}: no file is called so; paths of that name are derived");
        assert!(error.starts_with(&said), "{error}");
        let remedy =
            format!("`lumigraph render SCENE --path {kind} -o FRAMES`; give a path's file");
        assert!(error.ends_with(&remedy), "{error}");
    }
    let house = with_house();
    let error = lumigraph(house.path(), "walk house --path orbit -o frames").error(2);
    let said = "orbit: no file is called so; paths of that name are derived";
    assert!(error.starts_with(said), "{error}");
    let remedy = "or leave out --path, to walk a tour through all rooms";
    assert!(error.ends_with(remedy), "{error}");
    let error = lumigraph(house.path(), "walk house --path nowhere.json -o frames").error(1);
    assert_eq!(
        error,
        "nowhere.json: there is no such file or folder; check the path"
    );
}

#[test]
fn what_is_no_path_is_told_what_one_is() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(
        folder.path().join("cameras.txt"),
        "1 PINHOLE 96 72 60 60 48 36\n",
    )
    .unwrap();
    let line = "path cameras.txt --format nerfstudio -o x.json";
    let error = lumigraph(folder.path(), line).error(1);
    let expected = "expected an object with version, fps, and frames or keyframes";
    assert!(error.contains(expected), "{error}");
}
