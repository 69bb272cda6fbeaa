//! Held-out scores.

use crate::run::{files, lumigraph, with_wall};
use serde_json::Value;
use std::fs;

fn names(result: &Value) -> Vec<&str> {
    let photos = result["photos"].as_array().unwrap();
    photos.iter().map(|p| p["name"].as_str().unwrap()).collect()
}

#[test]
fn the_json_is_as_documented() {
    let folder = with_wall();
    let line = "evaluate wall --proxy plane --json -o frames";
    let ran = lumigraph(folder.path(), line).ok();
    let result = ran.json();
    assert_eq!(names(&result), ["0000.png", "0008.png"]);
    let keys = |value: &Value| {
        value
            .as_object()
            .unwrap()
            .keys()
            .cloned()
            .collect::<Vec<_>>()
    };
    let scores = [
        "psnr",
        "psnr_exposed",
        "ssim",
        "psnr_covered",
        "coverage",
        "coverage_points",
        "seams",
        "cpu_ms",
    ];
    for photo in result["photos"].as_array().unwrap() {
        assert_eq!(keys(photo)[1..], scores);
        assert!(scores.iter().all(|&score| photo[score].is_f64()), "{photo}");
        // The wall is a plane, so the other photos must give it back.
        assert_eq!(photo["coverage_points"], 1.0, "{photo}");
        assert!(photo["psnr_covered"].as_f64().unwrap() > 30.0, "{photo}");
    }
    for score in scores {
        let photos = result["photos"].as_array().unwrap();
        let sum: f64 = photos.iter().map(|p| p[score].as_f64().unwrap()).sum();
        assert!((result["mean"][score].as_f64().unwrap() - sum / 2.0).abs() < 1e-9);
    }
    assert_eq!(result["proxy"]["kind"], "plane");
    let frames = files(&folder.path().join("frames"));
    assert_eq!(frames.len(), 2);
}

/// A car before nothing: its alpha is its matte.
#[test]
fn an_object_and_its_background_are_covered_each_by_itself() {
    let folder = tempfile::tempdir().unwrap();
    let line = "generate car --size 96x72 -o car";
    lumigraph(folder.path(), line).ok();
    let of = |kind: &str| {
        let line = format!("evaluate car --every 12 --json --proxy {kind}");
        let result = lumigraph(folder.path(), &line).ok().json();
        let keys: Vec<&String> = result["photos"][0].as_object().unwrap().keys().collect();
        assert_eq!(keys[6..8], ["coverage_points", "psnr_masked"]);
        assert_eq!(keys[10..12], ["coverage_matte", "coverage_background"]);
        assert_eq!(keys[12..14], ["covered_matte", "covered_background"]);
        for key in [
            "coverage_matte",
            "coverage_background",
            "coverage_points",
            "covered_matte",
            "covered_background",
        ] {
            let photos = result["photos"].as_array().unwrap();
            let sum: f64 = photos.iter().map(|p| p[key].as_f64().unwrap()).sum();
            assert!((result["mean"][key].as_f64().unwrap() - sum / 3.0).abs() < 1e-9);
        }
        let mean = |key: &str| result["mean"][key].as_f64().unwrap();
        // Nothing of the photo is ignored, so inside its mask is inside its matte.
        assert_eq!(mean("coverage_matte"), mean("coverage_masked"));
        [
            mean("coverage_matte"),
            mean("coverage_background"),
            mean("coverage_points"),
        ]
    };
    // What the silhouettes leave is the car and nothing else; a plane smears it.
    let [matte, background, points] = of("hull");
    assert!(
        matte > 0.95 && background < 0.05 && points > 0.95,
        "{matte} {background} {points}"
    );
    let [_, smeared, _] = of("plane");
    assert!(smeared > background, "{smeared} {background}");
    let table = lumigraph(folder.path(), "evaluate car --every 12 --proxy hull")
        .ok()
        .stdout;
    let heads: Vec<&str> = table.lines().next().unwrap().split_whitespace().collect();
    assert_eq!(heads[5..7], ["coverage", "coverage_points"]);
    assert_eq!(
        heads[9..12],
        ["coverage_masked", "coverage_matte", "coverage_background"]
    );
    let cells = table.lines().map(|line| line.split_whitespace().count());
    let cells: Vec<usize> = cells.collect();
    // "cpu ms" is two words.
    assert_eq!(cells, [15, 14, 14, 14, 14]);
}

#[test]
fn pictures_too_small_to_be_scored_are_refused_before_any_is_drawn() {
    let folder = with_wall();
    let line = "evaluate wall --proxy plane --size 8x6 -o out";
    let error = lumigraph(folder.path(), line).error(1);
    assert_eq!(
        error,
        "photo 0000.png: the pictures have 8 × 6 pixels; SSIM needs at least 11 × 11; give a larger --size"
    );
    assert!(!folder.path().join("out").exists());
}

#[test]
fn which_photos_are_held_out() {
    let folder = with_wall();
    let evaluated = |line: &str| {
        let result = lumigraph(
            folder.path(),
            &format!("evaluate {line} --proxy plane --json"),
        )
        .ok()
        .json();
        names(&result).join(" ")
    };
    assert_eq!(evaluated("wall --every 3"), "0000.png 0003.png 0006.png");
    fs::write(
        folder.path().join("s.json"),
        r#"{"test": ["0005.png"], "train": []}"#,
    )
    .unwrap();
    assert_eq!(evaluated("wall --hold-out s.json"), "0005.png");
    // The capture's own split serves a scene made of it too.
    fs::copy(
        folder.path().join("s.json"),
        folder.path().join("wall/split.json"),
    )
    .unwrap();
    lumigraph(folder.path(), "import wall -o scene").ok();
    assert_eq!(evaluated("wall"), "0005.png");
    assert_eq!(evaluated("scene"), "0005.png");
    // Of one whose photos lie within, where the capture is not there to be asked, that is said.
    lumigraph(folder.path(), "import wall --undistort -o flat").ok();
    let score = "evaluate flat --proxy plane --size 48x36";
    let has_note = |stderr: &str| stderr.contains(", which the scene was made of, is not there: ");
    assert!(!has_note(&lumigraph(folder.path(), score).ok().stderr));
    fs::rename(folder.path().join("wall"), folder.path().join("moved")).unwrap();
    for (options, is_told) in [("", true), (" --every 3", false)] {
        let ran = lumigraph(folder.path(), &format!("{score}{options}")).ok();
        assert_eq!(has_note(&ran.stderr), is_told, "{options}: {}", ran.stderr);
    }
    let own = folder.path().join("flat/split.json");
    fs::copy(folder.path().join("moved/split.json"), &own).unwrap();
    assert!(!has_note(&lumigraph(folder.path(), score).ok().stderr));
    fs::rename(folder.path().join("moved"), folder.path().join("wall")).unwrap();
    fs::remove_file(folder.path().join("wall/split.json")).unwrap();
    assert_eq!(evaluated("wall"), "0000.png 0008.png");
}

#[test]
fn what_the_import_left_out_of_a_split_is_noted_and_the_rest_scored() {
    let folder = with_wall();
    let here = folder.path();
    fs::remove_file(here.join("wall/images/0008.png")).unwrap();
    lumigraph(here, "import wall -o scene").ok();
    lumigraph(here, "import wall --undistort -o flat").ok();
    for scene in ["wall", "scene", "flat"] {
        let ran = lumigraph(here, &format!("evaluate {scene} --proxy plane --json")).ok();
        let result = ran.json();
        assert_eq!(names(&result), ["0000.png"], "{scene}");
        let note = "wall/split.json: left out of the scene, and not scored: 0008.png";
        assert!(ran.stderr.contains(note), "{scene}: {}", ran.stderr);
    }
    let info = lumigraph(here, "info scene --json").ok().json();
    assert_eq!(info["left_out"][0], "0008.png");

    // Of what nothing explains it is said how to go on.
    let file = here.join("scene/scene.json");
    let mut scene: Value = serde_json::from_slice(&fs::read(&file).unwrap()).unwrap();
    scene.as_object_mut().unwrap().remove("left_out").unwrap();
    fs::write(&file, scene.to_string()).unwrap();
    let error = lumigraph(here, "evaluate scene --proxy plane").error(1);
    assert!(error.contains("the scene has no 0008.png"), "{error}");
    assert!(
        error.contains("--hold-out FILE") && error.contains("--every N"),
        "{error}"
    );
}

#[test]
fn held_out_photos_are_nowhere_used() {
    let folder = with_wall();
    let evaluate = |out: &str| {
        let line =
            format!("evaluate wall --proxy plane --hold-out wall/split.json --json -o {out}");
        lumigraph(folder.path(), &line).ok().json()
    };
    let honest = evaluate("a");
    // With the held-out photos blackened the renderings and the proxy stay the same.
    for name in ["0000.png", "0008.png"] {
        let path = folder.path().join("wall/images").join(name);
        image::RgbImage::new(96, 72).save(path).unwrap();
    }
    let blackened = evaluate("b");
    assert!(files(&folder.path().join("a")) == files(&folder.path().join("b")));
    assert_eq!(honest["proxy"], blackened["proxy"]);
    assert_ne!(honest["mean"]["psnr"], blackened["mean"]["psnr"]);
}

#[test]
fn a_proxy_that_saw_held_out_photos_is_fitted_again() {
    let folder = with_wall();
    lumigraph(folder.path(), "import wall -o scene").ok();
    let plane = lumigraph(folder.path(), "evaluate scene --proxy plane --json");
    let plane = plane.ok().json();
    lumigraph(folder.path(), "proxy scene plane").ok();
    let ran = lumigraph(folder.path(), "evaluate scene --json").ok();
    assert!(
        ran.stderr.contains("fitted with held-out 0000.png"),
        "{}",
        ran.stderr
    );
    assert_eq!(ran.json()["proxy"], plane["proxy"]);

    let line = "proxy scene plane --hold-out wall/split.json";
    lumigraph(folder.path(), line).ok();
    let ran = lumigraph(folder.path(), "evaluate scene --json").ok();
    assert_eq!(ran.json()["proxy"]["from"], "the scene's own");
    assert_eq!(ran.json()["proxy"]["point"], plane["proxy"]["point"]);
    // What is made for each view anew is made of those that are there then.
    for (kind, is_told) in [("points", true), ("view-plane", true), ("plane", false)] {
        let line = format!("proxy wall {kind} --hold-out wall/split.json -o p.json");
        let said = lumigraph(folder.path(), &line).ok().stderr;
        assert_eq!(
            said.contains("--hold-out changes nothing"),
            is_told,
            "{said}"
        );
    }
}

#[test]
fn what_is_scored_is_the_kind_of_surface_that_the_scene_has() {
    let folder = with_wall();
    let here = folder.path();
    lumigraph(here, "import wall -o scene").ok();
    for kind in ["plane", "dominant-plane", "carved", "points", "view-plane"] {
        let line = format!("evaluate scene --proxy {kind} --json");
        let asked = lumigraph(here, &line).ok().json();
        lumigraph(here, &format!("proxy scene {kind}")).ok();
        let ran = lumigraph(here, "evaluate scene --json").ok();
        let scored = ran.json();
        assert_eq!(scored["mean"]["psnr"], asked["mean"]["psnr"], "{kind}");
        if ["points", "view-plane"].contains(&kind) {
            // Fitted with nothing before there is a view.
            assert_eq!(scored["proxy"]["from"], "the scene's own", "{kind}");
            assert!(!ran.stderr.contains("held-out"), "{}", ran.stderr);
        } else {
            assert_eq!(scored["proxy"], asked["proxy"], "{kind}");
            let said = format!("held-out 0000.png; fitting another {kind} without");
            assert!(ran.stderr.contains(&said), "{}", ran.stderr);
        }
    }
    // Only `auto` makes a mesh that hides nothing: without these photos it may choose otherwise.
    lumigraph(here, "proxy scene carved").ok();
    let file = here.join("scene/proxy.ply");
    let bytes = fs::read(&file).unwrap();
    let named = b"comment lumigraph proxy carved";
    let at = bytes.windows(named.len()).position(|w| w == named).unwrap() + named.len();
    let open = [&bytes[..at], &b" without occlusion"[..], &bytes[at..]].concat();
    fs::write(&file, open).unwrap();
    let ran = lumigraph(here, "evaluate scene --json").ok();
    let said = "held-out 0000.png; fitting another without";
    assert!(ran.stderr.contains(said), "{}", ran.stderr);
    assert!(ran.json()["proxy"]["trials"].is_array());
}

#[test]
fn smaller_pictures_score_against_reduced_photos() {
    let folder = with_wall();
    let line = "evaluate wall --proxy plane --size 48x36 --json -o small";
    let result = lumigraph(folder.path(), line).ok().json();
    assert!(
        result["mean"]["psnr_covered"].as_f64().unwrap() > 30.0,
        "{result}"
    );
    let frame = image::open(folder.path().join("small/0008.png")).unwrap();
    assert_eq!((frame.width(), frame.height()), (48, 36));
}

#[test]
fn every_renderer_and_blend_scores_about_alike() {
    let folder = with_wall();
    let psnr = |options: &str| {
        let line = format!("evaluate wall --proxy plane --json {options}");
        let result = lumigraph(folder.path(), &line).ok().json();
        result["mean"]["psnr_covered"].as_f64().unwrap()
    };
    let usual = psnr("--device cpu");
    for options in [
        "--renderer exact --device cpu",
        "--renderer exact --device reference",
        "--renderer triangulated --device reference",
        "--grid 8 --device cpu",
        "--blend paper --k 3 --beta 0 --resolution length --device cpu",
    ] {
        let other = psnr(options);
        assert!(
            (other - usual).abs() < 1.5,
            "{options}: {other} and {usual} dB"
        );
    }
}

#[test]
fn pictures_of_an_earlier_run_are_told_of() {
    let folder = with_wall();
    let said = |every: u32| {
        let line = format!("evaluate wall --proxy plane --size 24x18 --every {every} -o out");
        lumigraph(folder.path(), &line).ok().stderr
    };
    let first = said(3);
    assert!(!first.contains("of this run"), "{first}");
    let then = said(8);
    let note = "note: 2 pictures in out are not of this run, as 0003.png\n";
    assert!(then.contains(note), "{then}");
}
