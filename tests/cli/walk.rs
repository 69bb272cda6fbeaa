//! Walks through a house, frame by frame and as films.

use crate::interior::{names, with_house};
use crate::run::lumigraph;
use serde_json::Value;
use std::path::Path;

#[test]
fn options_of_what_portals_do_not_show_are_said_to_change_nothing() {
    let folder = with_house();
    let walk = "walk house --frames 1 --size 16x12 --reference-size 8x8";
    let said = |options: &str| {
        let line = format!("{walk} {options} -o out");
        let stderr = lumigraph(folder.path(), &line).ok().stderr;
        let notes = stderr.lines().filter(|line| line.contains("nothing: "));
        notes.map(str::to_owned).collect::<Vec<_>>()
    };
    let images = "--persist and --reference-size change nothing: portals show no images \
         (--portals texture, warp1, warp2, ldi or all)";
    let splat = "--splat changes nothing: no image is warped (--portals warp1, warp2 or all)";
    let ldis = "--ldi-views changes nothing: portals show no LDIs (--portals ldi or all)";
    let given = "--persist --splat 2 --ldi-views 3";
    for (portals, expected) in [
        ("geometry,whole", &[images, splat, ldis][..]),
        ("texture", &[splat, ldis]),
        ("geometry,warp2", &[ldis]),
        ("ldi", &[splat]),
        ("all", &[]),
    ] {
        let expected: Vec<String> = expected.iter().map(|e| format!("note: {e}")).collect();
        let found = said(&format!("{given} --portals {portals}"));
        assert_eq!(found, expected, "{portals}");
    }
    assert_eq!(said("--portals ldi --near 0.5"), Vec::<String>::new());
    // Columns are of LDIs, cells of all.
    let columns =
        "note: --no-skip=columns changes nothing: portals show no LDIs (--portals ldi or all)";
    assert_eq!(said("--portals texture --no-skip=columns"), [columns]);
    for all in [
        "--portals texture --no-skip",
        "--portals texture --no-skip=cells,columns",
        "--portals ldi --no-skip=columns",
    ] {
        assert_eq!(said(all), [""; 0], "{all}");
    }
    // Of a model there are no photos.
    let of_photos = "--no-photos --no-exposure --portals ldi --ldi-from views";
    let why = "nothing: house is of a model, not of photos";
    let all = format!("note: --no-photos, --no-exposure and --ldi-from change {why}");
    assert_eq!(said(of_photos), [all]);
    let one = format!("note: --no-photos changes {why}");
    assert_eq!(said("--portals texture --no-photos"), [one]);
    let ran = lumigraph(
        folder.path(),
        "ldis house --reference-size 8x8 --ldi-from views",
    )
    .ok();
    let of_ldis = format!("note: --ldi-from changes {why}\n");
    assert!(ran.stderr.contains(&of_ldis), "{}", ran.stderr);
    assert_eq!(said("--persist"), [format!("note: {images}")]);
    // What changes nothing is in no way of drawing a part, either.
    let part = "walk house --frames 0..1/2 --size 16x12 --persist -o part";
    let stderr = lumigraph(folder.path(), part).ok().stderr;
    let note = "note: --persist changes nothing";
    assert!(stderr.contains(note), "{stderr}");
}

#[test]
fn a_house_is_walked_through() {
    let folder = with_house();
    let here = folder.path();
    let line =
        "walk house --portals all --frames 6 --size 64x48 --reference-size 32x32 --json -o out";
    let ran = lumigraph(here, line).ok();
    let report = ran.json();
    let walks = report["walks"].as_array().unwrap();
    let kinds: Vec<&str> = walks
        .iter()
        .map(|w| w["portals"].as_str().unwrap())
        .collect();
    assert_eq!(kinds, ["geometry", "texture", "warp1", "warp2", "ldi"]);
    let mut skipped = 0;
    for walk in walks {
        let frames = walk["frames"].as_array().unwrap();
        assert_eq!(frames.len(), 6);
        for frame in frames {
            let picture = image::open(here.join(frame["file"].as_str().unwrap())).unwrap();
            assert_eq!((picture.width(), picture.height()), (64, 48));
            assert!(frame["cell"].is_string() && frame["ms"].as_f64().unwrap() > 0.0);
            skipped += frame["triangles_skipped"].as_u64().unwrap();
        }
        let [images, ldis] = ["references_used", "ldis_used"].map(|of| walk[of].as_u64().unwrap());
        let kind = walk["portals"].as_str().unwrap();
        assert_eq!(images > 0, ["texture", "warp1", "warp2"].contains(&kind));
        assert_eq!(ldis > 0, kind == "ldi");
    }
    assert!(skipped > 0);
    // Images are made once for all kinds.
    let made = |walk: &Value| walk["references_made"].as_u64().unwrap();
    let [texture, warp1, warp2] = [1, 2, 3].map(|i| &walks[i]);
    assert!(made(texture) > 0 && made(warp1) == 0);
    assert_eq!(made(texture), texture["references_used"].as_u64().unwrap());
    let of_images: u64 = walks[..4].iter().map(made).sum();
    assert_eq!(of_images, warp2["references_used"].as_u64().unwrap());
    // Of each LDI's 13 those that are there serve it, too.
    let ldi = &walks[4];
    assert!(made(ldi) > 0 && made(ldi) < 13 * ldi["ldis_used"].as_u64().unwrap());
    assert_eq!(of_images + made(ldi), made(&report));
    assert_eq!(report["device"], "CPU");
    let svg = std::fs::read_to_string(here.join("out/times.svg")).unwrap();
    // Drawing alone, and with making images.
    assert_eq!(svg.matches("<polyline").count(), 2 * 5);
    // Its path once more, byte for byte, on one thread; one kind needs no folder of its own.
    // Nor does a budget for images show.
    let again = "--threads 1 walk house/interior.json --path out/path.json --portals warp2 \
                 --reference-size 32x32 --cpu-memory 1 -o again";
    let ran = lumigraph(here, again).ok();
    assert!(ran.stdout.contains("again: 6 frames"), "{}", ran.stdout);
    let read = |file: &str| std::fs::read(here.join(file)).unwrap();
    for i in 0..6 {
        let there = read(&format!("out/warp2/frame_{i:04}.png"));
        assert!(read(&format!("again/frame_{i:04}.png")) == there);
    }
    // A model without triangles, and cells without portals.
    let nothing = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{}]}"#;
    let padded = format!("{nothing:<64}");
    let mut glb = b"glTF".to_vec();
    for word in [2_u32, 12 + 8 + 64, 64] {
        glb.extend(word.to_le_bytes());
    }
    glb.extend(b"JSON");
    glb.extend(padded.as_bytes());
    std::fs::create_dir(here.join("empty")).unwrap();
    std::fs::write(here.join("empty/house.glb"), glb).unwrap();
    let interior = r#"{"version": 1, "model": "house.glb", "up": [0, 1, 0], "eye_height": 1.6,
        "cells": [{"name": "a", "box": {"min": [0, 0, 0], "max": [4, 3, 4]}}], "portals": []}"#;
    std::fs::write(here.join("empty/interior.json"), interior).unwrap();
    let ran = lumigraph(
        here,
        "walk empty --frames 2 --size 16x16 --portals warp1 -o none",
    );
    assert!(
        ran.code == 0 || ran.stderr.contains("error: "),
        "{}",
        ran.stderr
    );
    assert!(!ran.stderr.contains("panicked"), "{}", ran.stderr);
    // Wherever there is no graphics device there are pictures, and a note.
    let by_device = "walk house --path out/path.json --device gpu -o device";
    let ran = lumigraph(here, by_device).ok();
    let noted = ran.stderr.contains("note: graphics device: ");
    assert_eq!(noted, ran.stdout.contains("drawn by CPU"), "{}", ran.stdout);
    assert_eq!(names(&here.join("device")).len(), 7);
    // What is wrong is said, of a frame that cannot be drawn before others are.
    let path: Value = serde_json::from_slice(&read("out/path.json")).unwrap();
    let mut bent = path.clone();
    bent["frames"][1]["model"] = "OPENCV_FISHEYE".into();
    bent["frames"][1]["params"] = [45, 45, 32, 24, 1, 0, 0, 0].to_vec().into();
    let mut large = path;
    large["frames"][1]["width"] = 100_000.into();
    for (path, said) in [
        (
            bent,
            "its lens is distorted; interiors are drawn for cameras without distortion: give the frame the model PINHOLE",
        ),
        (large, "its picture has 100000 × 48 pixels"),
    ] {
        std::fs::write(here.join("odd.json"), path.to_string()).unwrap();
        let error = lumigraph(here, "walk house --path odd.json -o odd").error(1);
        let expected = format!("odd.json: frame frame_0001: {said}");
        assert!(error.contains(&expected), "{error}");
        assert!(!here.join("odd").exists());
    }
    let scenes = r#"{"version": 1, "up": [0, 1, 0], "eye_height": 1.6,
        "cells": [{"name": "a", "scene": "../a"}], "portals": []}"#;
    std::fs::write(here.join("interior.json"), scenes).unwrap();
    let ran = lumigraph(here, "walk interior.json -o out");
    assert!(ran.error(1).contains("it names no model"), "{}", ran.stderr);
}

#[test]
fn a_walk_ends_with_a_report() {
    let folder = with_house();
    let line = "walk house --frames 2 --size 16x12 --reference-size 8x8 --portals texture -o out";
    let ran = lumigraph(folder.path(), &format!("{line} --json")).ok();
    let report = &ran.json()["report"];
    assert_eq!(report["device"], "CPU");
    assert_eq!(report["notes"], Value::Array(Vec::new()));
    assert!(report["seconds"].as_f64() > Some(0.0), "{report}");
    assert!(report["references_memory"]["loads"].is_u64(), "{report}");
    // No photos colour a model.
    assert!(report.get("photos_total").is_none(), "{report}");
    let said = lumigraph(folder.path(), line).ok().stderr;
    assert!(
        said.contains(" at most, ") && said.contains(" CPU s) on CPU"),
        "{said}"
    );
}

#[test]
fn frames_that_show_nothing_are_told() {
    let folder = with_house();
    let here = folder.path();
    let ran = lumigraph(here, "walk house --frames 3 --size 16x12 --json -o out").ok();
    assert_eq!(ran.json()["report"]["frames_empty"], 0);
    // A path of another world, in part: far above the house.
    let mut path = render::path::read(&here.join("out/path.json")).unwrap();
    for frame in &mut path.frames[1..] {
        let pose = &mut frame.view.camera_from_world;
        pose.translation -= pose.rotation * glam::DVec3::new(0.0, 500.0, 0.0);
    }
    render::path::write(&here.join("far.json"), &path).unwrap();
    let walk = "walk house --path far.json --size 16x12 --portals geometry,whole --json -o far";
    let ran = lumigraph(here, walk).ok();
    let said = "4 of 6 frames show nothing: their eyes are in no cell; does the path lie in this \
                interior's world?";
    assert!(
        ran.stderr.contains(&format!("note: {said}\n")),
        "{}",
        ran.stderr
    );
    let report = &ran.json()["report"];
    assert_eq!(report["frames_empty"], 4);
    assert_eq!(report["notes"].as_array().unwrap()[..], [said]);
}

#[test]
fn a_walk_becomes_a_film() {
    let folder = with_house();
    let here = folder.path();
    let walk = "walk house --size 47x36 --background #204060";
    let whole = format!("{walk} --frames 6 -o whole --video films/tour.mp4");
    lumigraph(here, &whole).ok();
    assert_eq!(names(&here.join("films")), ["tour.mp4"]);
    let frame = |folder: &str, i: usize| {
        let file = here.join(folder).join(format!("frame_{i:04}.png"));
        std::fs::read(&file).unwrap()
    };
    let picture = image::load_from_memory(&frame("whole", 0)).unwrap();
    assert!(picture.to_rgba8().pixels().all(|p| p.0[3] == 255));
    // In parts, and after an interruption, the bytes are the same.
    for part in ["0..2/6", "2..6/6"] {
        lumigraph(here, &format!("{walk} --frames {part} -o parts --resume")).ok();
    }
    std::fs::remove_file(here.join("parts/frame_0003.png")).unwrap();
    std::fs::write(here.join("parts/frame_0004.png"), "").unwrap();
    let again = format!("{walk} --frames 6 -o parts --resume");
    let said = lumigraph(here, &again).ok().stdout;
    assert!(said.contains("6 frames, 4 of them from before"), "{said}");
    for i in 0..6 {
        assert!(frame("whole", i) == frame("parts", i), "frame {i}");
    }
    // Frames of something else are not mixed in.
    let house = here.join("house/interior.json");
    let mut text = std::fs::read_to_string(&house).unwrap();
    text.push('\n');
    std::fs::write(&house, text).unwrap();
    let error = lumigraph(here, &again).error(1);
    assert!(
        error.contains("made of other files: house/interior.json has"),
        "{error}"
    );
    for (more, said) in [
        ("--video f.mp4 --portals geometry,ldi", "one kind"),
        ("--persist --frames 1..2 --portals ldi", "--persist"),
        ("--persist --resume", "cannot be used with"),
        ("--frames 1..9/6", "the path has 6 frames"),
        ("--fps 3", "--video"),
    ] {
        let ran = lumigraph(here, &format!("{walk} -o x {more}"));
        assert!(
            ran.code == 2 && ran.stderr.contains(said),
            "{more}: {}",
            ran.stderr
        );
    }
}

/// What a plot says of its frames, and how far right the points of each of its lines are.
fn plotted(file: &Path) -> (String, Vec<Vec<String>>) {
    let svg = std::fs::read_to_string(file).unwrap();
    let lines = svg.split("<polyline points=\"").skip(1);
    let x = |point: &str| point.split(',').next().unwrap().to_owned();
    let points = lines.map(|line| line.split('"').next().unwrap().split(' ').map(x).collect());
    let across = svg.split(">frame ").nth(1).unwrap();
    let across = across.split('<').next().unwrap().to_owned();
    (across, points.collect())
}

#[test]
fn times_are_plotted_where_frames_are_in_their_path_and_stay_where_none_is_drawn() {
    let folder = with_house();
    let here = folder.path();
    let walk = "walk house --size 32x24";
    let film = format!("{walk} --frames 6 -o film --resume");
    lumigraph(here, &film).ok();
    let times = here.join("film/times.svg");
    let whole = std::fs::read(&times).unwrap();
    let (across, lines) = plotted(&times);
    assert_eq!(across, "(0 to 5)");
    assert_eq!(
        lines,
        [["64.0", "238.4", "412.8", "587.2", "761.6", "936.0"]]
    );
    // Nothing is drawn.
    let said = lumigraph(here, &film).ok().stdout;
    assert!(said.contains("6 frames, 6 of them from before"), "{said}");
    let row = said.lines().find(|line| line.starts_with("geometry"));
    let cells: Vec<&str> = row.unwrap().split_whitespace().skip(1).collect();
    assert_eq!(cells, ["-"; 9]);
    let report = lumigraph(here, &format!("{film} --json")).ok().json();
    assert!(report["walks"][0]["median_ms"].is_null(), "{report}");
    assert!(std::fs::read(&times).unwrap() == whole);
    // Some are.
    for i in [0, 1, 3] {
        std::fs::remove_file(here.join(format!("film/frame_000{i}.png"))).unwrap();
    }
    lumigraph(here, &film).ok();
    let (across, lines) = plotted(&times);
    assert_eq!(across, "(0 to 5)");
    assert_eq!(lines, [["64.0", "238.4"], ["587.2", "587.2"]]);
    // A part of a path.
    lumigraph(here, &format!("{walk} --frames 2..5/6 -o part")).ok();
    let (across, lines) = plotted(&here.join("part/times.svg"));
    assert_eq!(across, "(2 to 4)");
    assert_eq!(lines, [["64.0", "500.0", "936.0"]]);
}

#[test]
fn layered_images_of_the_nearest_views_are_the_same_in_parts() {
    let folder = with_house();
    let here = folder.path();
    let walk = "walk house --portals ldi --size 48x36 --reference-size 24x24";
    let nearest = format!("{walk} --ldi-views 3");
    let report = lumigraph(here, &format!("{nearest} --frames 8 --json -o whole")).ok();
    let report = report.json();
    let frames = report["walks"][0]["frames"].as_array().unwrap();
    let count = |what: &str| -> u64 { frames.iter().filter_map(|f| f[what].as_u64()).sum() };
    assert!(count("ldis_made") + count("ldis_ahead") > 0, "{report}");
    assert!(frames.iter().all(|f| f["waited_ms"].is_number()));
    for part in ["5..8/8", "0..5/8"] {
        lumigraph(
            here,
            &format!("{nearest} --frames {part} --threads 1 -o parts"),
        )
        .ok();
    }
    let read = |file: &Path| std::fs::read(here.join(file)).unwrap();
    let frames = names(&here.join("whole")).into_iter();
    let frames: Vec<String> = frames.filter(|name| name.ends_with(".png")).collect();
    assert_eq!(frames.len(), 8);
    for name in &frames {
        let [whole, part] = ["whole", "parts"].map(|folder| read(&Path::new(folder).join(name)));
        assert!(whole == part, "{name}");
    }
    // Frames with LDIs of other views are not mixed in.
    lumigraph(here, &format!("{nearest} --frames 8 -o film --resume")).ok();
    let error = lumigraph(here, &format!("{walk} --frames 8 -o film --resume")).error(1);
    assert!(error.contains("another command line"), "{error}");
    let ran = lumigraph(here, &format!("{walk} --ldi-views 0 -o x"));
    assert_eq!(ran.code, 2, "{}", ran.stderr);
}

#[test]
fn whoever_stands_in_a_doorway_sees_what_is_beyond_the_rooms_other_portals() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    lumigraph(here, "generate house --rooms 4 --triangles 1 -o house").ok();
    // In two doorways' planes but for rounding, by which they seem to lie behind the eye.
    let matrices = [
        "0.5000000000000001, 0, -0.8660254037844386, -0.21065791128141106,
         0.04324724487786694, -0.9987523388778446, 0.02496880847194615, 1.2177352708120381,
         -0.8649448975573378, -0.04993761694389229, -0.49937616943892243, 7.685269614960485,
         0, 0, 0, 1",
        "0, 0, 1, -3.25,
         -0.049937616943892274, -0.9987523388778446, 0, 1.748440813248027,
         0.9987523388778446, -0.049937616943892274, 0, -2.9288412337592797,
         0, 0, 0, 1",
        "0.25881904510252074, 0, 0.9659258262890683, -3.918951308810816,
         -0.04823603390943612, -0.9987523388778445, 0.012924806332113658, 1.7013091737773585,
         0.9647206781887215, -0.049937616943892274, -0.25849612664227295, -1.9862084443459092,
         0, 0, 0, 1",
    ];
    let frames = matrices.map(|matrix| {
        format!(
            r#"{{"camera_from_world": [{matrix}], "width": 64, "height": 48, "model": "PINHOLE",
                "params": [40, 40, 32, 24]}}"#
        )
    });
    let path = format!(
        r#"{{"version": 1, "fps": 30, "frames": [{}]}}"#,
        frames.join(",")
    );
    std::fs::write(here.join("path.json"), path).unwrap();
    let line = "walk house --path path.json --portals texture,ldi --reference-size 64x64 -o out";
    lumigraph(here, line).ok();
    for kind in ["texture", "ldi"] {
        for i in 0..matrices.len() {
            let file = here.join(format!("out/{kind}/frame_{i:04}.png"));
            let picture = image::open(file).unwrap().into_rgba8();
            let open = picture.pixels().filter(|p| p.0[3] < u8::MAX).count();
            // One eighth of the pixels and more where the doorway hides the others.
            assert!(open <= 3, "{kind} {i}: {open}");
        }
    }
}
