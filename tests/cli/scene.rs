//! The scene's folder.

use crate::memory::PHOTO;
use crate::run::{files, lumigraph, with_wall};
use calibrate::colmap;
use image::{GrayImage, Luma};
use serde_json::{Value, json};
use std::fs;
use std::path::Path;

fn read(path: &Path) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

#[test]
fn a_scene_renders_like_its_capture_and_copies_no_photo() {
    let folder = with_wall();
    lumigraph(folder.path(), "import wall -o deep/scene").ok();
    let scene = folder.path().join("deep/scene");
    let names: Vec<String> = files(&scene)
        .into_keys()
        .map(|p| p.display().to_string())
        .collect();
    assert_eq!(
        names,
        [
            "model/cameras.txt",
            "model/images.txt",
            "model/points3D.txt",
            "scene.json"
        ]
    );
    let file = read(&scene.join("scene.json"));
    assert_eq!(file["version"], 1);
    assert_eq!(file["photos"][0]["path"], "../../wall/images/0000.png");
    assert_eq!(file["settings"]["capture"], "../../wall");

    let line = |scene: &str, out: &str| {
        format!("render {scene} --proxy plane --path sweep --frames 3 -o {out}")
    };
    lumigraph(folder.path(), &line("wall", "a")).ok();
    lumigraph(folder.path(), &line("deep/scene", "b")).ok();
    let frames = files(&folder.path().join("a"));
    assert_eq!(frames.len(), 3);
    assert!(frames == files(&folder.path().join("b")));
}

#[test]
fn photos_and_calibration_may_lie_apart() {
    let folder = with_wall();
    fs::rename(
        folder.path().join("wall/sparse"),
        folder.path().join("model"),
    )
    .unwrap();
    let line = "import wall/images --calibration model/0 -o scene";
    lumigraph(folder.path(), line).ok();
    let info = lumigraph(folder.path(), "info scene --json").ok().json();
    assert_eq!(info["photos"], 9);
}

#[test]
fn unknown_keys_survive() {
    let folder = with_wall();
    lumigraph(folder.path(), "import wall -o scene").ok();
    let path = folder.path().join("scene/scene.json");
    let mut file = read(&path);
    file["later"] = json!({"deep": [1, 0.1]});
    file["photos"][2]["mood"] = json!("gloomy");
    file["photos"][2]["gain"] = json!([1.0, 0.1, 1.0 / 3.0]);
    file["settings"]["masks"] = json!("m");
    fs::write(&path, file.to_string()).unwrap();

    lumigraph(folder.path(), "proxy scene plane").ok();
    let mut after = read(&path);
    assert_eq!(after["proxy"]["kind"], "plane");
    assert_eq!(after["proxy"]["fitted_without"], json!([]));
    after.as_object_mut().unwrap().remove("proxy");
    assert_eq!(after, file);
}

#[test]
fn an_earlier_scene_is_replaced_only_by_force_and_other_folders_never() {
    let folder = with_wall();
    lumigraph(folder.path(), "import wall -o scene").ok();
    let error = lumigraph(folder.path(), "import wall -o scene").error(1);
    assert!(error.contains("--force"), "{error}");
    // What a capture cannot give again is said to be gone.
    let again = || lumigraph(folder.path(), "import wall -o scene --force").ok();
    assert!(!again().stderr.contains("proxy"));
    lumigraph(folder.path(), "proxy scene plane --focus 0004.png:40,30").ok();
    let said = again().stderr;
    let note = "note: scene: its own proxy (plane) is gone with the scene that was here; `lumigraph proxy` gives it another\n";
    assert!(said.ends_with(note), "{said}");
    assert!(!again().stderr.contains("proxy"));

    let before = files(folder.path());
    let error = lumigraph(folder.path(), "import wall -o wall --force").error(1);
    assert!(error.contains("no part of a scene"), "{error}");
    assert!(files(folder.path()) == before);
}

#[test]
fn a_scene_is_not_made_of_what_it_replaces() {
    let folder = with_wall();
    lumigraph(folder.path(), "import wall --undistort -o flat").ok();
    let before = files(folder.path());
    for inputs in [
        "flat",
        "flat --undistort",
        "flat/images --calibration flat/model",
        "wall/images --calibration flat",
        "wall --depth flat/depth",
    ] {
        let line = format!("import {inputs} -o flat --force");
        let error = lumigraph(folder.path(), &line).error(1);
        let is_told = error.starts_with("flat: ") && error.contains("would be replaced");
        assert!(is_told, "{line}: {error}");
        assert!(files(folder.path()) == before, "{line}");
    }
    lumigraph(folder.path(), "import flat -o thin").ok();
    lumigraph(folder.path(), "import flat -o thin --force").ok();
    lumigraph(folder.path(), "import wall -o flat --force").ok();
}

#[test]
fn a_model_or_a_proxy_of_somebodys_own_stays() {
    let folder = with_wall();
    let at = |path: &str| folder.path().join(path);
    let whole = colmap::read_model(&at("wall/sparse/0")).unwrap();
    fs::create_dir(at("ws")).unwrap();
    fs::rename(at("wall/images"), at("ws/photos")).unwrap();
    let refused = |line: &str, said: &str| {
        let before = files(folder.path());
        let error = lumigraph(folder.path(), line).error(1);
        assert!(error.contains(said), "{line}: {error}");
        assert!(files(folder.path()) == before, "{line}");
    };
    let line = "import ws/photos --calibration ws -o ws";
    colmap::write_binary(&whole, &at("ws/model")).unwrap();
    refused(line, "ws: holds model, which is no part of a scene");
    fs::remove_dir_all(at("ws/model")).unwrap();
    colmap::write_text(&whole, &at("ws/model")).unwrap();
    refused(line, "ws/model, which would be replaced");

    let line = "import ws/photos --calibration ws -o scene";
    fs::create_dir(at("scene")).unwrap();
    fs::write(at("scene/proxy.json"), "mine").unwrap();
    refused(line, "scene: holds proxy.json, which is no part of a scene");
    fs::remove_file(at("scene/proxy.json")).unwrap();
    // What an import that was killed has left is in nobody's way.
    lumigraph(folder.path(), line).ok();
    lumigraph(folder.path(), "proxy scene plane").ok();
    fs::remove_file(at("scene/scene.json")).unwrap();
    lumigraph(folder.path(), line).ok();
    assert!(!at("scene/proxy.json").exists());
}

#[test]
fn what_is_somebodys_own_within_a_scenes_parts_stays() {
    let folder = with_wall();
    let here = folder.path();
    lumigraph(here, "import wall --undistort -o flat").ok();
    lumigraph(here, "import wall -o thin").ok();
    for file in [
        "flat/masks/0000.png.png",
        "flat/images/mine.png",
        "flat/images/deep/er/notes.txt",
        "flat/depth/mine.txt",
        "flat/mattes",
        "flat/model/mine.txt",
        "thin/model/fr/frame_0000.png",
        "thin/silhouettes/0000.png",
        "thin/proxy.json",
        "thin/proxy.ply",
        "thin/proxy.json/mine.txt",
    ] {
        let path = here.join(file);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, "mine").unwrap();
        let before = files(here);
        let (scene, name) = file.split_once('/').unwrap();
        for more in ["", " --force", " --undistort --force"] {
            let error = lumigraph(here, &format!("import wall{more} -o {scene}")).error(1);
            let said = format!("{scene}: holds {name}, which the scene does not name and would");
            assert!(error.starts_with(&said), "{more}: {error}");
            assert!(files(here) == before, "{file}");
        }
        fs::remove_file(path).unwrap();
    }
    // Empty folders are no matter.
    lumigraph(here, "import wall --undistort --force -o flat").ok();
    lumigraph(here, "import wall --force -o thin").ok();
    assert!(!here.join("flat/images/deep").exists());

    // Nor is anything written there that would be in the way.
    let before = files(here);
    let size = "--proxy plane --size 48x36";
    let film = format!("render wall --path sweep --frames 2 {size}");
    for line in [
        format!("{film} -o thin/model/fr"),
        format!("{film} -o thin/silhouettes"),
        format!("{film} -o thin/proxy.json/new"),
        format!("{film} -o flat/images/new"),
        format!("evaluate wall --every 3 {size} -o flat/masks"),
        format!("field wall --view 0000.png {size} -o thin/model/field.png"),
        format!("field wall --view 0000.png {size} -o f.png --weights flat/depth/f.npz"),
        "proxy wall plane -o thin/model/p.json".to_owned(),
        "proxy wall plane -o thin/proxy.json".to_owned(),
        "proxy thin plane -o thin/proxy.json".to_owned(),
    ] {
        let error = lumigraph(here, &line).error(1);
        assert!(error.contains(" is part of a scene, and"), "{error}");
        assert!(files(here) == before, "{line}");
    }
}

#[test]
fn a_scene_s_own_proxy_leaves_none_before_it_and_replaces_none_of_somebody_s() {
    let folder = with_wall();
    let here = folder.path();
    lumigraph(here, "import wall -o scene").ok();
    let [plane, mesh] = ["proxy.json", "proxy.ply"].map(|name| here.join("scene").join(name));
    for (kind, is_mesh) in [("plane", false), ("carved", true), ("plane", false)] {
        lumigraph(here, &format!("proxy scene {kind}")).ok();
        assert_eq!([plane.exists(), mesh.exists()], [!is_mesh, is_mesh]);
    }
    fs::write(&mesh, "mine").unwrap();
    let before = files(here);
    let error = lumigraph(here, "proxy scene carved").error(1);
    let said = "scene/proxy.ply: the scene does not name it, and it would be replaced; move it away, or give a file with -o";
    assert_eq!(error, said);
    assert!(files(here) == before);
    lumigraph(here, "proxy scene dominant-plane").ok();
}

#[test]
fn what_is_left_of_a_photo_that_is_left_out_is_no_part_of_the_scene() {
    let folder = with_wall();
    let here = folder.path();
    // Silhouettes, of which a damaged one is found when the photo itself is written already.
    let masks = here.join("wall/masks");
    fs::create_dir(&masks).unwrap();
    let object = GrayImage::from_fn(96, 72, |x, y| {
        let is_in = (30..60).contains(&x) && (20..50).contains(&y);
        Luma([if is_in { 255 } else { 0 }])
    });
    for i in 0..9 {
        object.save(masks.join(format!("{i:04}.png"))).unwrap();
    }
    let damaged = masks.join("0003.png");
    let bytes = fs::read(&damaged).unwrap();
    fs::write(&damaged, &bytes[..bytes.len() / 2]).unwrap();
    lumigraph(here, "import wall --undistort -o flat").ok();
    let left = ["images/0003.png", "images/.DS_Store"].map(|file| here.join("flat").join(file));
    assert!(!left[0].exists());
    lumigraph(here, "import wall --undistort --force -o flat").ok();
    // Earlier versions let it lie there, as systems do what they leave.
    for file in &left {
        fs::write(file, "").unwrap();
    }
    lumigraph(here, "import wall --undistort --force -o flat").ok();
    assert!(!left.iter().any(|file| file.exists()));
}

/// Nothing is put back where folders cannot be locked.
#[cfg(unix)]
#[test]
fn a_scene_that_was_to_be_replaced_is_put_back_where_that_was_killed() {
    let folder = with_wall();
    let here = folder.path();
    lumigraph(here, "import wall --undistort -o flat").ok();
    lumigraph(here, "proxy flat plane").ok();
    lumigraph(here, "import wall -o thin").ok();
    let copy = |from: &str, to: &Path| {
        for (name, bytes) in files(&here.join(from)) {
            let path = to.join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, bytes).unwrap();
        }
    };
    // In the order in which they take their places.
    let parts = |scene: &str| -> Vec<&'static str> {
        let all = ["images", "depth", "model", "proxy.json", "scene.json"].into_iter();
        all.filter(|part| here.join(scene).join(part).exists())
            .collect()
    };
    let scene = here.join("scene");
    let work = scene.join(".lumigraph-abc");
    let [new, old] = ["scene", "old"].map(|name| work.join(name));
    // What an import leaves that is killed after so many renames.
    let kill = |before: Option<&str>, after: &str, renames: usize| {
        copy(after, &new);
        fs::create_dir(&old).unwrap();
        if let Some(before) = before {
            copy(before, &scene);
        }
        let leaving = before.map_or(Vec::new(), parts).into_iter().rev();
        let leaving = leaving.map(|part| (scene.join(part), old.join(part)));
        let coming = parts(after).into_iter();
        let coming = coming.map(|part| (new.join(part), scene.join(part)));
        let all: Vec<_> = leaving.chain(coming).collect();
        for (from, to) in &all[..renames] {
            fs::rename(from, to).unwrap();
        }
        all.len()
    };
    for (before, after) in [("flat", "thin"), ("thin", "flat"), ("flat", "flat")] {
        let all = parts(before).len() + parts(after).len();
        for renames in 1..all {
            assert_eq!(kill(Some(before), after, renames), all);
            let error = lumigraph(here, "info scene").error(1);
            assert!(error.contains("scene: the scene lies aside"), "{error}");
            let ran = lumigraph(here, "import wall -o scene");
            let said = "note: scene: an import was stopped as its scene took the place of another here; that one is back";
            assert!(ran.stderr.contains(said), "{}", ran.stderr);
            let error = ran.error(1);
            assert!(error.contains("holds a scene already"), "{error}");
            assert!(!work.exists());
            let is_back = files(&scene) == files(&here.join(before));
            assert!(is_back, "{before}, {after}, {renames}");
            fs::remove_dir_all(&scene).unwrap();
        }
    }
    // A first import has nothing to go back to.
    for renames in [1, 4] {
        kill(None, "flat", renames);
        let ran = lumigraph(here, "import wall -o scene").ok();
        assert!(!ran.stderr.contains("an import was"), "{}", ran.stderr);
        assert!(!scene.join("images").exists() && !work.exists());
        fs::remove_dir_all(&scene).unwrap();
    }
}

#[test]
fn a_scene_whose_photos_went_or_that_lies_says_so() {
    let folder = with_wall();
    lumigraph(folder.path(), "import wall -o scene").ok();
    let path = folder.path().join("scene/scene.json");
    let whole = read(&path);
    let error = |file: &Value| {
        fs::write(&path, file.to_string()).unwrap();
        lumigraph(folder.path(), "info scene").error(1)
    };
    let mut file = whole.clone();
    file["version"] = json!(2);
    assert_eq!(
        error(&file),
        "scene/scene.json: scene version 2; this program reads version 1"
    );
    let mut file = whole.clone();
    file["photos"][0]["name"] = json!("x.png");
    assert!(error(&file).contains("photo x.png is not in the model"));
    let mut file = whole.clone();
    file["photos"][0] = file["photos"][1].clone();
    assert!(error(&file).contains("photo 0001.png is listed twice"));
    for [near, far] in [[0.0, 0.0], [4.5, 2.5], [-1.0, 3.0], [3.0, 3.0]] {
        let mut file = whole.clone();
        file["photos"][1]["depth_bounds"] = json!([near, far]);
        let said = format!(
            "scene/scene.json: photo 0001.png: the depth bounds are {near} and {far}, expected 0 < nearest < farthest; \
             import the photos again"
        );
        assert_eq!(error(&file), said);
    }
    for gain in [0.0, -1.0, 1e300] {
        let mut file = whole.clone();
        file["photos"][1]["gain"] = json!([1.0, gain, 1.0]);
        let said = "scene/scene.json: photo 0001.png: a gain must be positive, and between 0.000001 and 1000000; \
                    import the photos again";
        assert_eq!(error(&file), said);
    }
    for orientation in [0, 9] {
        let mut file = whole.clone();
        file["photos"][1]["orientation"] = json!(orientation);
        let said =
            format!("photo 0001.png: the orientation is {orientation}, expected EXIF's 1 to 8");
        assert!(error(&file).contains(&said));
    }
    let mut file = whole.clone();
    file.as_object_mut().unwrap().remove("photos");
    assert!(error(&file).contains("missing field `photos`"));

    fs::write(&path, whole.to_string()).unwrap();
    fs::remove_file(folder.path().join("wall/images/0002.png")).unwrap();
    let ran = lumigraph(folder.path(), "info scene --json").ok();
    assert!(
        ran.stderr.contains("0002.png is left out"),
        "{}",
        ran.stderr
    );
    assert_eq!(ran.json()["photos"], 8);
    // Setting a proxy meanwhile forgets no photo.
    lumigraph(folder.path(), "proxy scene plane").ok();
    assert_eq!(read(&path)["photos"], whole["photos"]);
}

#[test]
fn photos_without_calibration_are_counted() {
    let folder = with_wall();
    for name in ["extra.png", "sub/more.png"] {
        let path = folder.path().join("wall/images").join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        image::RgbImage::new(4, 4).save(path).unwrap();
    }
    let ran = lumigraph(folder.path(), "info wall").ok();
    assert!(
        ran.stderr.contains(
            "note: 2 of 11 photos are not in the calibration and stay unused (extra.png, for one)"
        ),
        "{}",
        ran.stderr
    );
}

#[test]
fn info_measures() {
    let folder = with_wall();
    let info = lumigraph(folder.path(), "info wall --json").ok().json();
    assert_eq!(info["cameras"][0]["model"], "PINHOLE");
    assert_eq!(info["cameras"][0]["width"], 96);
    assert_eq!(info["cameras"][0]["photos"], 9);
    let error = &info["cameras"][0]["reprojection_px"];
    assert!(error["mean"].as_f64().unwrap() < 1e-9, "{error}");
    assert!(error["median"].as_f64().unwrap() < 1e-9);
    assert!(error["observations"].as_u64().unwrap() > 1000);
    assert!(info["spacing"].as_f64().unwrap() > 0.0);
    assert_eq!(info["isolated"], 0);
    assert_eq!(info["memory_bytes"], 9 * PHOTO);
    assert!(info["proxy"].is_null());
    let text = lumigraph(folder.path(), "info wall").ok().stdout;
    assert!(
        text.starts_with("photos   9\ncamera   1: PINHOLE 96×72 ["),
        "{text}"
    );
}

#[test]
fn a_plane_by_hand_reads_back_to_the_last_digit() {
    let folder = with_wall();
    lumigraph(folder.path(), "import wall -o scene").ok();
    let by_hand = "plane --point -0.1,2e-3,3 --normal -1,0.1,-2";
    lumigraph(folder.path(), &format!("proxy scene {by_hand}")).ok();
    lumigraph(folder.path(), &format!("proxy wall {by_hand} -o p.glb")).ok();
    let own = lumigraph(folder.path(), "info scene --json").ok().json()["proxy"].clone();
    assert_eq!(own["point"], json!([-0.1, 2e-3, 3.0]));
    assert!(own["fitted_without"].is_null());
    let used = lumigraph(folder.path(), "evaluate wall --proxy p.glb --json")
        .ok()
        .json();
    assert_eq!(used["proxy"]["point"], own["point"]);
    assert_eq!(used["proxy"]["normal"], own["normal"]);
}

#[test]
fn frames_that_are_imported_again_keep_the_name_of_their_video() {
    let folder = with_wall();
    let here = folder.path();
    lumigraph(here, "import wall -o scene").ok();
    // As if they had been taken out of one.
    let file = here.join("scene/scene.json");
    let mut scene = read(&file);
    scene["settings"]["video"] = "../sweep.mp4".into();
    fs::write(&file, scene.to_string()).unwrap();
    fs::create_dir(here.join("scene/photos")).unwrap();
    for (name, bytes) in files(&here.join("wall/images")) {
        fs::write(here.join("scene/photos").join(name), bytes).unwrap();
    }
    let line = "import scene/photos --calibration wall/sparse/0 --force -o scene";
    for _ in 0..2 {
        lumigraph(here, line).ok();
        assert_eq!(read(&file)["settings"]["video"], "../sweep.mp4");
    }
    // Others are of no video.
    lumigraph(here, "import wall --force -o scene").ok();
    assert!(read(&file)["settings"]["video"].is_null());
}
