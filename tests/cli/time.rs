//! Scenes that move, through the command line.

use crate::run::{files, folder_with, lumigraph, with_wall};
use calibrate::{View, colmap};
use datasets::Options;
use image::RgbaImage;
use render::path::{Interpolation, Keyframe, KeyframeFile, ShotLook, write_keyframes, write_shot};
use std::fs;
use tempfile::TempDir;

/// A folder with `helicopter`, a capture of sixty 64 × 48 photos with times.
fn with_helicopter() -> TempDir {
    folder_with("a small helicopter", |folder| {
        let options = Options {
            size: Some((64, 48)),
            views: Some(60),
            samples_per_side: Some(2),
        };
        let helicopter = datasets::by_name("helicopter", &options).unwrap();
        datasets::write(&helicopter, &folder.join("helicopter")).unwrap();
    })
}

#[test]
fn held_out_photos_score_better_at_their_own_times() {
    let folder = with_helicopter();
    let evaluate = |options: &str| {
        let line = format!("evaluate helicopter --proxy points --json{options}");
        lumigraph(folder.path(), &line).ok()
    };
    let psnr = |options: &str| evaluate(options).json()["mean"]["psnr"].as_f64().unwrap();
    let (plain, given) = (psnr(""), psnr(" --period 1.37"));
    let ran = evaluate(" --period auto");
    let found = ran.json();
    assert!(found.get("time").is_none(), "it is in the report");
    let time = &found["report"]["time"];
    let period = time["period_s"].as_f64().unwrap();
    assert!((period / 1.37 - 1.0).abs() < 0.01, "{period}");
    assert!(ran.stderr.contains("period: 1.3"), "{}", ran.stderr);
    let automatic = found["mean"]["psnr"].as_f64().unwrap();
    println!("ignoring time {plain:.2} dB, period given {given:.2}, found {automatic:.2}");
    assert!(given > plain + 1.5 && automatic > plain + 1.5);
    let [fewest, most] = [0, 1].map(|i| time["photos_in_window"][i].as_u64().unwrap());
    assert!(
        5 <= fewest && fewest <= most && most < 30,
        "{fewest} to {most}"
    );
}

#[test]
fn frames_show_their_moment() {
    let folder = with_helicopter();
    let render = |options: &str, out: &str| {
        let line = format!(
            "render helicopter --proxy points --path orbit --frames 2 -o {out} --json{options}"
        );
        let ran = lumigraph(folder.path(), &line).ok();
        (files(&folder.path().join(out)), ran.json())
    };
    let (plain, report) = render("", "plain");
    assert_eq!(report["report"]["time"], serde_json::Value::Null);
    let (early, report) = render(" --period 1.37 --time 0.25", "early");
    assert_eq!(report["report"]["time"]["period_s"], 1.37);
    // The one that is in force without --time-window.
    assert_eq!(report["report"]["time"]["window_s"], 1.37 / 16.0);
    assert!(plain != early);
    assert!(
        render(" --period 1.37 --time 1.62", "turn").0 == early,
        "a whole turn later"
    );
    assert!(render(" --period 1.37 --time 0.9", "late").0 != early);
    // Without --time, each frame has the path's own.
    let (own, _) = render(" --period 1.37", "own");
    let (zero, _) = render(" --period 1.37 --time 0", "zero");
    let frame = |files: &std::collections::BTreeMap<_, Vec<u8>>, i: usize| {
        files.values().nth(i).unwrap().clone()
    };
    assert!(frame(&own, 0) == frame(&zero, 0) && frame(&own, 1) != frame(&zero, 1));
    // Without a period: the photos nearest in time.
    let (_, report) = render(" --time 4", "nearest");
    assert!(report["report"]["time"]["window_s"].is_null());
    assert!(report["report"]["time"]["photos_in_window"][1].as_u64() < Some(9));
    lumigraph(
        folder.path(),
        "field helicopter --view 0008.png --period 1.37 -o field.png",
    )
    .ok();

    // A model's views are of the photos of their names.
    let views = |line: &str, out: &str| {
        let line = format!("render {line} --proxy plane --size 32x24 -o {out}");
        lumigraph(folder.path(), &line)
    };
    let photos = "helicopter --views helicopter --frames 2..3 --period 1.37";
    views(photos, "views").ok();
    views(&format!("{photos} --time 0.4"), "same").ok();
    views(&format!("{photos} --time 0.9"), "other").ok();
    let made = |out: &str| files(&folder.path().join(out));
    assert!(made("views") == made("same") && made("views") != made("other"));

    // What plays no part is not decoded, and decoding it changes nothing.
    let (eager, _) = render(" --period 1.37 --time 0.25 --no-skip", "eager");
    assert!(eager == early);
}

#[test]
fn photos_that_are_all_of_one_time_are_told_where_times_count() {
    let folder = with_wall();
    let here = folder.path();
    let said = |times: [f64; 9], options: &str| {
        let line = |(i, time_s): (usize, f64)| format!("{i:04}.png,{time_s}\n");
        let lines: String = times.into_iter().enumerate().map(line).collect();
        fs::write(here.join("wall/times.csv"), lines).unwrap();
        let line = format!(
            "render wall --proxy plane --size 24x18 -o out --views wall --frames 3..4{options}"
        );
        lumigraph(here, &line).ok().stderr
    };
    let note = "note: all 9 photos that have a time have the same, 7.500 s";
    for (options, is_told) in [
        (" --period 1.37 --time 4.2", true),
        (" --time-window 1", true),
        ("", false),
    ] {
        let said = said([7.5; 9], options);
        assert_eq!(said.contains(note), is_told, "{options}: {said}");
    }
    let mut times = [7.5; 9];
    times[4] = 8.0;
    assert!(!said(times, " --period 1.37 --time 4.2").contains("have the same"));
}

#[test]
fn times_of_frames_that_change_nothing_are_told() {
    let folder = with_helicopter();
    let here = folder.path();
    let model = colmap::find_model(&here.join("helicopter")).unwrap();
    let model = colmap::read_model(&model).unwrap();
    let image = model.images.values().next().unwrap();
    let camera = &model.cameras[&image.camera_id];
    let view = View {
        lens: camera.lens().unwrap(),
        width: camera.width,
        height: camera.height,
        camera_from_world: image.camera_from_world,
    };
    // As the window takes them.
    let look = ShotLook {
        layer: "picture".to_owned(),
        options: String::new(),
        meanwhile: String::new(),
    };
    let picture = RgbaImage::new(camera.width, camera.height);
    // The first photo's time is that of a window that was just opened.
    for (name, time_s) in [
        ("timed.png", Some(0.5)),
        ("first.png", Some(0.0)),
        ("plain.png", None),
    ] {
        write_shot(&here.join(name), &picture, &view, time_s, &look).unwrap();
    }
    // A path may begin when it likes: that is no time of the scene's.
    for (name, time_s) in [("timed.json", Some(0.5)), ("plain.json", None)] {
        let keyframe = Keyframe {
            t_s: 5.0,
            camera_from_world: image.camera_from_world,
            camera: camera.clone(),
            time_s,
        };
        let file = KeyframeFile {
            fps: 2.0,
            keyframes: vec![keyframe],
            interpolation: Interpolation::Spline,
        };
        write_keyframes(&here.join(name), &file).unwrap();
    }
    let note = ": its times of the scene change nothing without --period,";
    for (options, is_told) in [
        ("timed.png", true),
        ("timed.png --period 1.37", false),
        ("timed.png --time-window 0.5", false),
        ("timed.png --time 0.5", false),
        ("first.png", true),
        ("plain.png", false),
        ("timed.json", true),
        ("plain.json", false),
    ] {
        let line = format!("render helicopter --proxy plane -o out --views {options}");
        let said = lumigraph(here, &line).ok().stderr;
        let name = options.split(' ').next().unwrap();
        let note = format!("note: {name}{note}");
        assert_eq!(said.contains(&note), is_told, "{options}: {said}");
    }
    // So does a path's view in the blending field.
    for (options, is_told) in [
        ("timed.json", true),
        ("timed.json --time-window 0.5", false),
        ("timed.json --time 0.5", false),
        ("plain.json", false),
    ] {
        let line =
            format!("field helicopter --proxy plane -o f.png --view frame_0000 --path {options}");
        let said = lumigraph(here, &line).ok().stderr;
        let note = format!("note: timed.json{note}");
        assert_eq!(said.contains(&note), is_told, "{options}: {said}");
    }
}

#[test]
fn films_that_show_motion_at_another_speed_are_told() {
    let folder = with_helicopter();
    let render = "render helicopter --proxy plane --path orbit --frames 2 --size 32x24 -o out";
    for (options, speed) in [
        ("--period 1.37 --fps 5", Some("6 times slower")),
        ("--period 1.37 --fps 45", Some("1.5 times faster")),
        ("--period 1.37 --fps 30", None),
        ("--period 1.37", None),
        ("--period 1.37 --time 0.5 --fps 5", None),
        ("--fps 5", None),
    ] {
        let line = format!("{render} --video f.mp4 {options}");
        let said = lumigraph(folder.path(), &line).ok().stderr;
        let path =
            ": frames show the moments of a path of 30 frames a second: in the film what moves is ";
        let note = speed.map(|speed| format!("{path}{speed}\n"));
        assert_eq!(said.contains(path), note.is_some(), "{options}: {said}");
        assert!(note.is_none_or(|note| said.contains(&note)), "{said}");
    }
    // Of a path's own moments those count, not its rate.
    let mut path: serde_json::Value = serde_json::from_str(UNTIMED).unwrap();
    let mut second = path["frames"][0].clone();
    second["name"] = "f1".into();
    path["frames"].as_array_mut().unwrap().push(second);
    for (apart_s, speed) in [
        (0.2, None),
        (
            0.1,
            Some("frames a second: in the film what moves is 2 times slower"),
        ),
        (0.0, None),
    ] {
        path["frames"][0]["time_s"] = 0.0.into();
        path["frames"][1]["time_s"] = apart_s.into();
        fs::write(folder.path().join("timed.json"), path.to_string()).unwrap();
        let line = "render helicopter --proxy plane --path timed.json --size 32x24 -o timed --video t.mp4 \
                    --period 1.37 --fps 5";
        let said = lumigraph(folder.path(), line).ok().stderr;
        let told = "in the film what moves is ";
        assert_eq!(said.contains(told), speed.is_some(), "{apart_s}: {said}");
        assert!(speed.is_none_or(|speed| said.contains(speed)), "{said}");
    }
}

#[test]
fn a_moment_beyond_all_photos_is_told_and_shown_by_the_nearest() {
    let folder = with_helicopter();
    let render = |options: &str, out: &str| {
        let line = format!(
            "render helicopter --proxy plane --path orbit --frames 2 --size 48x36 -o {out} --json \
             {options}"
        );
        let ran = lumigraph(folder.path(), &line).ok();
        let counts = ran.json()["report"]["time"]["photos_in_window"].clone();
        let most = counts[1].as_u64().unwrap();
        (ran.stderr, most, files(&folder.path().join(out)))
    };
    // Of sixty photos in 11.8 s.
    let told = "is to be as of 900.000 s, but photos were taken from 0.000 to 11.800 s";
    let (said, most, late) = render("--time 900 --time-window 0.05", "late");
    assert_eq!(said.matches(told).count(), 1, "{said}");
    assert!(most < 10, "{most}");
    let (_, _, later) = render("--time 90000", "later");
    assert!(late == later);
    let (said, ..) = render("--time 11.8", "end");
    assert!(!said.contains("is to be as of"), "{said}");
    let (said, most, _) = render("--time 900 --period 1.37", "turning");
    assert!(!said.contains("is to be as of") && most < 30, "{said}");
}

#[test]
fn times_are_imported_from_lists_names_and_frame_rates() {
    let folder = with_helicopter();
    let times = |scene: &str| -> Vec<Option<f64>> {
        let text = fs::read_to_string(folder.path().join(scene).join("scene.json")).unwrap();
        let scene: serde_json::Value = serde_json::from_str(&text).unwrap();
        let photos = scene["photos"].as_array().unwrap();
        photos.iter().map(|p| p["time_s"].as_f64()).collect()
    };
    let import = |options: &str, out: &str| {
        let line = format!("import helicopter -o {out}{options}");
        lumigraph(folder.path(), &line)
    };
    import("", "own").ok();
    assert_eq!(times("own")[..3], [0.0, 0.2, 0.4].map(Some));
    import(" --frame-rate 8", "rate").ok();
    assert_eq!(times("rate")[..3], [0.0, 0.125, 0.25].map(Some));
    fs::write(folder.path().join("two.csv"), "0001.png,7\n0002.png,9\n").unwrap();
    let ran = import(" --times two.csv", "list").ok();
    let note = "two.csv: no time for 58 of 60 photos (";
    assert!(ran.stderr.contains(note), "{}", ran.stderr);
    assert_eq!(times("list")[..4], [None, Some(7.0), Some(9.0), None]);
    let info = lumigraph(folder.path(), "info list --json").ok().json();
    assert_eq!(
        info["times"],
        serde_json::json!({"photos": 2, "range_s": [7.0, 9.0]})
    );
    let text = lumigraph(folder.path(), "info list").ok().stdout;
    let line = "\ntimes    of 2 photos, 7.000 to 9.000 s\n";
    assert!(text.contains(line), "{text}");

    fs::write(folder.path().join("bad.csv"), "0001.png,7\n0001.jpg,9\n").unwrap();
    let error = import(" --times bad.csv", "bad").error(1);
    assert!(
        error.starts_with("bad.csv, line 2: there is no photo 0001.jpg"),
        "{error}"
    );
    assert!(!folder.path().join("bad").exists());
    for (options, said) in [
        (" --frame-rate 0", "above zero"),
        (" --frame-rate 8 --times two.csv", "cannot be used with"),
    ] {
        let ran = import(options, "usage");
        assert!(ran.code == 2 && ran.stderr.contains(said), "{}", ran.stderr);
    }
    // A held-out photo without a time cannot be drawn at its own.
    let error = lumigraph(folder.path(), "evaluate list --every 2 --time-window 1").error(1);
    let said = "photo 0000.png has no time; `import --times FILE.csv` gives it one; or hold out photos that have one";
    assert_eq!(error, said);
    // Nor can others that have none: it is said what gives them one, and where.
    fs::write(folder.path().join("path.json"), UNTIMED).unwrap();
    lumigraph(
        folder.path(),
        "export helicopter --format transforms -o t.json",
    )
    .ok();
    let text = fs::read_to_string(folder.path().join("t.json")).unwrap();
    let text = text.replace("\"time\"", "\"no_time\"");
    fs::write(folder.path().join("t.json"), text).unwrap();
    for (line, said) in [
        (
            "render list --views helicopter --frames 0..1 -o out",
            "helicopter: 0000.png has no time; give the photo of its name one (`import --times FILE.csv`), or --time \
             for all",
        ),
        (
            "render list --path path.json -o out",
            "path.json: f0 has no time; give it a \"time_s\", or --time for all",
        ),
        (
            "render list --views t.json -o out",
            "t.json: 0000.png has no time; give its frame a \"time\", or --time for all",
        ),
        (
            "field list --view 0000.png -o f.png",
            "photo 0000.png has no time; `import --times FILE.csv` gives it one, or give --time",
        ),
        (
            "field list --path path.json --view f0 -o f.png",
            "path.json: f0 has no time; give it a \"time_s\", or give --time",
        ),
    ] {
        let line = format!("{line} --time-window 1");
        assert_eq!(lumigraph(folder.path(), &line).error(1), said);
    }
    assert!(!folder.path().join("out").exists());
}

/// A path of one frame that has no time.
const UNTIMED: &str = r#"{"version": 1, "fps": 24, "frames": [{"name": "f0", "camera_from_world":
    [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1],
    "width": 32, "height": 24, "model": "PINHOLE", "params": [30, 30, 16, 12]}]}"#;

#[test]
fn a_scene_without_times_or_period_says_so() {
    let folder = with_wall();
    let info = lumigraph(folder.path(), "info wall --json").ok().json();
    assert!(info["times"].is_null());
    for line in [
        "evaluate wall --proxy plane --period 2",
        "render wall --proxy plane --path orbit --time 1 -o out",
    ] {
        let error = lumigraph(folder.path(), line).error(1);
        assert!(
            error.starts_with("no photo has a time; import the photos with --times"),
            "{error}"
        );
    }
    let error = lumigraph(folder.path(), "import wall --frame-rate 2 -o scene").ok();
    assert!(error.stdout.contains("scene: 9 photos"));
    let error = lumigraph(folder.path(), "evaluate scene --proxy plane --period auto").error(1);
    assert!(
        error.contains("7 photos with different times; at least 12"),
        "{error}"
    );
    let ran = lumigraph(folder.path(), "evaluate scene --proxy plane --period never");
    assert!(
        ran.code == 2 && ran.stderr.contains("or auto"),
        "{}",
        ran.stderr
    );
}
