//! Kinds of surface, and the choice between them.

use crate::run::{files, lumigraph, with_generated, with_wall};
use serde_json::Value;
use std::path::Path;

/// A folder with a small capture of the given scene.
fn with(name: &str) -> tempfile::TempDir {
    with_generated(&format!("{name} --size 96x72 -o {name}"))
}

#[test]
fn the_best_kind_is_chosen_by_photos_held_out_for_it() {
    let folder = with("shelf");
    let line = "evaluate shelf --every 4 --json";
    let ran = lumigraph(folder.path(), line).ok();
    assert!(
        ran.stderr.contains("by photos held out for it: plane "),
        "{}",
        ran.stderr
    );
    let proxy = ran.json()["proxy"].clone();
    let trials = proxy["trials"].as_array().unwrap().clone();
    let score = |t: &Value| t["psnr"].as_f64().unwrap_or(f64::NEG_INFINITY);
    let best = trials.iter().map(score).fold(f64::NEG_INFINITY, f64::max);
    let chosen = trials.iter().find(|t| t["kind"] == proxy["kind"]).unwrap();
    assert!(score(chosen) >= best - 0.1, "{proxy}");
    // What the scene has no means for is not tried.
    assert!(trials.iter().all(|t| t["kind"] != "hull"), "{proxy}");
    // The same again.
    assert_eq!(lumigraph(folder.path(), line).ok().json()["proxy"], proxy);
}

#[test]
fn a_mesh_that_its_numbers_have_lost_is_told_and_why() {
    let folder = with_wall();
    lumigraph(folder.path(), "import wall -o scene").ok();
    // A square of the size of 32 bits' steps there.
    let corners = [(0.0, 0.0), (0.5, 0.0), (0.5, 0.5), (0.0, 0.5)];
    let line = |(x, y)| format!("v {} {} 100\n", 500_000.0 + x, 5_000_000.0 + y);
    let text = corners.map(line).concat() + "f 1 2 3 4\n";
    std::fs::write(folder.path().join("far.obj"), text).unwrap();
    let lost = "far.obj: its corners lie up to 5000000 from the origin, where its numbers are 0.5 apart or more";
    let ran = lumigraph(folder.path(), "proxy scene mesh far.obj -o far.ply").ok();
    assert!(ran.stderr.contains(lost), "{}", ran.stderr);
    assert!(
        !ran.stderr.contains("if its axes or units"),
        "{}",
        ran.stderr
    );
    let line = "render wall --proxy far.obj --path sweep --frames 1 --size 24x18 -o out";
    let ran = lumigraph(folder.path(), line).ok();
    assert!(ran.stderr.contains(lost), "{}", ran.stderr);
}

#[test]
fn a_scene_keeps_any_kind_and_draws_from_it() {
    let folder = with("shelf");
    lumigraph(folder.path(), "import shelf -o scene").ok();
    for (kind, file) in [
        ("dominant-plane", "proxy.json"),
        ("view-plane", "proxy.json"),
        ("carved", "proxy.ply"),
        ("dense", "proxy.json"),
        ("carved-dense", "proxy.ply"),
    ] {
        let ran = lumigraph(folder.path(), &format!("proxy scene {kind}")).ok();
        assert!(ran.stdout.contains(file), "{kind}: {}", ran.stdout);
        let result = lumigraph(
            folder.path(),
            "evaluate scene --every 3 --json --proxy scene/FILE"
                .replace("FILE", file)
                .as_str(),
        )
        .ok()
        .json();
        let of_plane = if kind == "dominant-plane" {
            "plane"
        } else {
            kind
        };
        assert_eq!(result["proxy"]["kind"], of_plane);
        assert!(
            result["mean"]["coverage"].as_f64().unwrap() > 0.95,
            "{kind}: {result}"
        );
        let info = lumigraph(folder.path(), "info scene --json").ok().json();
        assert_eq!(info["proxy"]["kind"], of_plane);
    }
    let left: Vec<_> = files(&folder.path().join("scene")).into_keys().collect();
    assert!(
        !left.iter().any(|f| f.to_string_lossy().ends_with(".tmp")),
        "{left:?}"
    );
}

#[test]
fn a_scene_whose_own_proxy_is_lost_or_damaged_takes_another() {
    let folder = with_wall();
    let here = folder.path();
    lumigraph(here, "import wall -o scene").ok();
    lumigraph(here, "proxy scene plane").ok();
    let file = here.join("scene/proxy.json");
    let whole = std::fs::read(&file).unwrap();
    let draw = "render scene --path sweep --frames 1 --size 24x18 -o out";
    for (left, problem) in [
        (None, "No such file"),
        (Some(&whole[..20]), "not a proxy file: "),
    ] {
        match left {
            None => std::fs::remove_file(&file).unwrap(),
            Some(bytes) => std::fs::write(&file, bytes).unwrap(),
        }
        // 1. Who asks for it is told, and what to do.
        let error = lumigraph(here, draw).error(1);
        let said = format!("scene/proxy.json: {problem}");
        assert!(error.starts_with(&said), "{error}");
        let remedy = "; fit another with `lumigraph proxy scene KIND`";
        assert!(error.ends_with(remedy), "{error}");
        let ran = lumigraph(here, "info scene").ok();
        let note = format!("note: {error}");
        assert!(ran.stderr.contains(&note), "{}", ran.stderr);
        let said = "\nproxy    proxy.json, which cannot be read\n";
        assert!(ran.stdout.contains(said), "{}", ran.stdout);
        let info = lumigraph(here, "info scene --json").ok().json();
        assert_eq!(info["proxy"]["error"], error);
        // 2. Who does not has all else.
        lumigraph(here, &format!("{draw} --proxy plane")).ok();
        lumigraph(here, "export scene --format transforms -o t.json").ok();
        // 3. So it is mended.
        lumigraph(here, "proxy scene plane").ok();
        assert!(std::fs::read(&file).unwrap() == whole);
        lumigraph(here, draw).ok();
    }
}

#[test]
fn photos_without_sparse_points_are_compared() {
    // 1. As nerfstudio's format has it: cameras and poses.
    let folder = with("shelf");
    let line = "export shelf --format transforms -o shelf/transforms.json";
    lumigraph(folder.path(), line).ok();
    std::fs::remove_dir_all(folder.path().join("shelf/sparse")).unwrap();
    let ran = lumigraph(folder.path(), "evaluate shelf --every 4 --json").ok();
    let proxy = ran.json()["proxy"].clone();
    let trials = proxy["trials"].as_array().unwrap().clone();
    let score = |kind: &str| {
        let of_kind = trials.iter().filter(|t| t["kind"] == kind);
        let scores = of_kind.filter_map(|t| t["psnr"].as_f64());
        scores.fold(f64::NEG_INFINITY, f64::max)
    };
    let best = score("dense").max(score("carved-dense"));
    assert!(best > score("plane") + 1.0, "{proxy}");
    assert!(
        ["dense", "carved-dense"]
            .iter()
            .any(|kind| proxy["kind"] == *kind)
    );
    // 2. What is made of sparse points says what else there is.
    let error = lumigraph(folder.path(), "proxy shelf points -o p.json").error(1);
    assert!(
        error.contains("no sparse points") && error.contains("try dense"),
        "{error}"
    );
}

/// Writes a capture's model as programs do that tell points but not who observes them; or without points, too.
/// How many points there were.
fn forget_tracks(capture: &Path, and_points: bool) -> usize {
    let sparse = capture.join("sparse");
    let mut model = calibrate::colmap::read_model(&sparse.join("0")).unwrap();
    let count = model.points.len();
    for image in model.images.values_mut() {
        image.keypoints.clear();
    }
    for point in model.points.values_mut() {
        point.track.clear();
    }
    if and_points {
        model.points.clear();
    }
    std::fs::remove_dir_all(&sparse).unwrap();
    calibrate::colmap::write_text(&model, &sparse.join("0")).unwrap();
    count
}

#[test]
fn points_that_no_photo_observes_count_for_where_they_are_alone() {
    let folder = with_wall();
    let here = folder.path();
    lumigraph(here, "proxy wall view-plane -o views.json").ok();
    let count = forget_tracks(&here.join("wall"), false);
    // 1. What is made of who observes which cannot be, and that is why.
    for kind in ["points", "view-plane", "carved"] {
        let error = lumigraph(here, &format!("evaluate wall --proxy {kind}")).error(1);
        let told = format!("no photo observes any of the {count} sparse points");
        assert!(
            error.contains(&told) && error.contains("try dense"),
            "{error}"
        );
    }
    // 2. What is made of where they are can.
    let ran = lumigraph(here, "proxy wall dominant-plane -o plane.json").ok();
    assert!(!ran.stderr.contains("no photo observes"), "{}", ran.stderr);
    // 3. A plane for every view, as it was made before, is that of all photos.
    let evaluate = |proxy: &str| {
        let ran = lumigraph(here, &format!("evaluate wall --proxy {proxy} --json")).ok();
        let mean = ran.json()["mean"].clone();
        let number = |name: &str| mean[name].as_f64().unwrap();
        (number("psnr"), number("coverage"), ran.stderr)
    };
    let (_, coverage, said) = evaluate("views.json");
    assert!(coverage > 0.8);
    let note = format!("note: no photo observes any of the {count} sparse points (");
    assert!(said.contains(&note), "{said}");
    assert!(said.contains("; in its place is the plane"), "{said}");
    // 4. Photos are compared as if there were no points.
    let (with, _, said) = evaluate("dense");
    let note = format!("note: no photo observes {count} of {count} sparse points");
    assert_eq!(said.matches(&note).count(), 1, "{said}");
    forget_tracks(&here.join("wall"), true);
    let (without, _, said) = evaluate("dense");
    assert!(with == without && with > 30.0, "{with} {without}");
    assert!(!said.contains("no photo observes"), "{said}");
}

#[test]
fn tracks_that_only_the_images_tell_serve_as_points_own() {
    let folder = with_wall();
    let here = folder.path();
    let evaluate = || lumigraph(here, "evaluate wall --proxy points --size 32x24 --json").ok();
    let whole = evaluate();
    let sparse = here.join("wall/sparse/0");
    let mut model = calibrate::colmap::read_model(&sparse).unwrap();
    for point in model.points.values_mut() {
        point.track.clear();
    }
    std::fs::remove_dir_all(&sparse).unwrap();
    calibrate::colmap::write_text(&model, &sparse).unwrap();
    let bare = evaluate();
    for key in ["psnr", "ssim", "coverage", "coverage_points"] {
        let [bare, whole] = [&bare, &whole].map(|ran| ran.json()["mean"][key].as_f64().unwrap());
        assert!((bare - whole).abs() < 1e-9, "{key}: {bare} and {whole}");
    }
    let said = "note: wall/sparse/0: no point of points3D has a track; who observes which is taken from the ";
    assert!(bare.stderr.contains(said), "{}", bare.stderr);
    assert!(!whole.stderr.contains(said), "{}", whole.stderr);
}

#[test]
fn points_that_photos_left_do_not_share_are_told() {
    let folder = with_wall();
    let here = folder.path();
    lumigraph(here, "import wall -o scene").ok();
    lumigraph(here, "proxy scene points").ok();
    lumigraph(here, "proxy wall points -o points.json").ok();
    // What lies where its file goes stays.
    std::fs::remove_file(here.join("scene/proxy.json")).unwrap();
    std::fs::create_dir(here.join("scene/proxy.json")).unwrap();
    std::fs::write(here.join("scene/proxy.json/mine"), "").unwrap();
    let error = lumigraph(here, "proxy scene points").error(1);
    let said = "scene/proxy.json: cannot replace the proxy: a folder is in its place: move it away";
    assert_eq!(error, said);
    assert!(here.join("scene/proxy.json/mine").exists());
    std::fs::remove_dir_all(here.join("scene/proxy.json")).unwrap();
    lumigraph(here, "proxy scene points").ok();
    let names: Vec<String> = (1..9).map(|i| format!("{i:04}.png")).collect();
    let split = serde_json::json!({"test": names}).to_string();
    std::fs::write(here.join("all-but-one.json"), split).unwrap();
    let draw = |options: &str| {
        let line = format!("field scene --view 0000.png -o f.png{options}");
        lumigraph(here, &line)
    };
    let told = "note: the photos that are left share none of the ";
    for proxy in ["", " --proxy points.json", " --proxy points"] {
        let held = " --hold-out all-but-one.json";
        let said = draw(&format!("{held}{proxy}")).ok().stderr;
        assert_eq!(said.matches(told).count(), 1, "{said}");
        assert!(said.contains("; in its place is the plane"), "{said}");
        let said = draw(proxy).ok().stderr;
        assert!(!said.contains("in its place"), "{said}");
    }
}

#[test]
fn files_that_cannot_hold_a_kind_are_refused_before_it_is_fitted() {
    let folder = with("shelf");
    // It has no masks for a hull, which fitting would say.
    for (line, told) in [
        ("hull -o h.json", "h.json: a mesh is written as .ply"),
        ("hull -o h.obj", "h.obj: proxies are read from"),
        ("points -o p.ply", "p.ply: the points proxy is made anew"),
        ("plane -o p.ply", "p.ply: a plane is written as .json"),
        ("auto -o p.obj", "p.obj: proxies are read from"),
    ] {
        let error = lumigraph(folder.path(), &format!("proxy shelf {line}")).error(1);
        assert!(error.contains(told), "{line}: {error}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn what_is_chosen_among_all_kinds_is_written_beside_a_file_that_cannot_hold_it() {
    let folder = with("shelf");
    let written = |name: &str| {
        let ran = lumigraph(folder.path(), &format!("proxy shelf auto -o {name}")).ok();
        let (file, _) = ran.stdout.split_once(": ").unwrap();
        assert!(folder.path().join(file).is_file(), "{}", ran.stdout);
        assert_eq!(ran.stderr.contains("it goes to"), file != name);
        file.to_owned()
    };
    let both = [written("a.ply"), written("b.json")];
    // It is one kind, of which either or the other can hold it.
    let expected = match both[0].as_str() {
        "a.ply" => ["a.ply", "b.ply"],
        _ => ["a.json", "b.json"],
    };
    assert_eq!(both, expected);
    // What is there already is not written over unasked, nor is the choice lost.
    let (bad, there, free) = match both[0].as_str() {
        "a.ply" => ("c.json", "c.ply", "c_2.ply"),
        _ => ("c.ply", "c.json", "c_2.json"),
    };
    std::fs::write(folder.path().join(there), "mine").unwrap();
    assert_eq!(written(bad), free);
    let kept = std::fs::read(folder.path().join(there)).unwrap();
    assert_eq!(kept, b"mine");
}

#[test]
fn meshes_go_out_and_come_in() {
    let folder = with("shelf");
    lumigraph(folder.path(), "proxy shelf carved -o carved.glb").ok();
    lumigraph(folder.path(), "proxy shelf carved -o carved.ply").ok();
    let score = |line: &str| {
        let ran = lumigraph(
            folder.path(),
            &format!("evaluate shelf --every 3 --json {line}"),
        )
        .ok();
        let result = ran.json();
        (
            result["proxy"]["kind"].clone(),
            result["mean"]["psnr"].as_f64().unwrap(),
        )
    };
    let (kind, exact) = score("--proxy carved.ply");
    assert_eq!(kind, "carved");
    let (kind, rounded) = score("--proxy carved.glb");
    assert_eq!(kind, "carved");
    assert!((exact - rounded).abs() < 0.05, "{exact} {rounded}");

    // As if it came from elsewhere, its axes and units changed.
    let line = "proxy shelf mesh carved.ply --transform 1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1 -o m.ply";
    let ran = lumigraph(folder.path(), line).ok();
    assert!(
        ran.stdout.contains("meets it") && !ran.stderr.contains("warning"),
        "{}",
        ran.stderr
    );
    let obj = "v 900 900 900\nv 901 900 900\nv 900 901 900\nf 1 2 3\n";
    std::fs::write(folder.path().join("far.obj"), obj).unwrap();
    let ran = lumigraph(folder.path(), "proxy shelf mesh far.obj -o far.ply").ok();
    assert!(ran.stderr.contains("--transform"), "{}", ran.stderr);
}

#[test]
fn a_proxy_is_not_written_over_what_it_is_made_of() {
    let folder = with("shelf");
    let here = folder.path();
    lumigraph(here, "import shelf -o scene").ok();
    lumigraph(here, "proxy scene plane").ok();
    lumigraph(here, "proxy shelf carved -o h.glb").ok();
    std::fs::write(here.join("sp.json"), r#"{"test": ["0003.png"]}"#).unwrap();
    std::fs::write(here.join("shelf/split.json"), r#"{"test": ["0003.png"]}"#).unwrap();
    let before = files(here);
    for (line, output) in [
        ("shelf mesh h.glb", "h.glb"),
        ("scene mesh h.glb", "scene/../h.glb"),
        ("scene plane", "scene/scene.json"),
        ("scene plane", "scene/proxy.json"),
        ("scene plane", "shelf/split.json"),
        ("shelf plane", "shelf/split.json"),
        ("shelf plane --hold-out sp.json", "sp.json"),
    ] {
        let error = lumigraph(here, &format!("proxy {line} -o {output}")).error(1);
        let said = format!("{output}: the proxy is made of this very file; nothing was written");
        assert!(error.starts_with(&said), "{line}: {error}");
        assert!(files(here) == before, "{line}");
    }
    // One of before is nothing that it is made of.
    for _ in 0..2 {
        lumigraph(here, "proxy scene plane -o p.json").ok();
    }
}

#[test]
fn dense_points_do_without_depth_maps_that_are_damaged() {
    let folder = with("wall");
    let map = folder.path().join("wall/depth/0001.png");
    let whole = std::fs::read(&map).unwrap();
    std::fs::write(&map, &whole[..whole.len() / 2]).unwrap();
    for (kind, file) in [("dense", "p.json"), ("carved-dense", "p.ply")] {
        let ran = lumigraph(folder.path(), &format!("proxy wall {kind} -o {file}")).ok();
        let said = "note: a depth map is left out: cannot decode wall/depth/0001.png: ";
        assert!(ran.stderr.contains(said), "{kind}: {}", ran.stderr);
        assert!(folder.path().join(file).exists());
    }
}

#[test]
fn what_a_scene_has_no_means_for_is_told() {
    let folder = with("wall");
    std::fs::remove_dir_all(folder.path().join("wall/depth")).unwrap();
    for (kind, said) in [("hull", "--mattes"), ("depth", "--depth")] {
        let ran = lumigraph(folder.path(), &format!("proxy wall {kind} -o p.ply"));
        assert_eq!(ran.code, 1, "{kind}");
        assert!(ran.stderr.contains(said), "{kind}: {}", ran.stderr);
        assert!(!folder.path().join("p.ply").exists());
    }
}

#[test]
fn dense_points_of_other_photos_are_refused() {
    let folder = with_wall();
    let line = "evaluate wall --proxy d.json --size 24x18";
    let evaluate = |views: &str| {
        let text = format!(
            r#"{{"version": 1, "kind": "dense", "views": [{views}],
                "points": [[0, 0, 1], [1, 0, 1], [0, 1, 1]], "seen_by": [[0], [0], [0]]}}"#
        );
        std::fs::write(folder.path().join("d.json"), text).unwrap();
        lumigraph(folder.path(), line)
    };
    let error = evaluate(r#""nope.jpg""#).error(1);
    let said = "d.json: its points were found in nope.jpg, and the scene has none of these photos, but 0000.png, ";
    assert!(error.starts_with(said), "{error}");
    // Some may be held out, or of a larger capture.
    evaluate(r#""0001.png", "nope.jpg""#).ok();

    // A scene's own likewise.
    let here = folder.path();
    lumigraph(here, "import wall -o scene").ok();
    lumigraph(here, "proxy scene plane").ok();
    let said_by_info = || lumigraph(here, "info scene").ok().stderr;
    assert!(!said_by_info().contains("its points"));
    evaluate(r#""nope.jpg""#).error(1);
    std::fs::copy(here.join("d.json"), here.join("scene/proxy.json")).unwrap();
    let said = format!("scene/proxy.{}", &said[2..]);
    let note = said_by_info();
    assert!(note.contains(&format!("note: {said}")), "{note}");
    let error = lumigraph(here, "render scene --path orbit -o out").error(1);
    assert!(error.starts_with(&said), "{error}");
}

#[test]
fn a_photo_that_is_held_out_is_not_focused_on() {
    let folder = with_wall();
    let focus = |name: &str| {
        let line = format!(
            "proxy wall plane --focus {name}:48,36 --hold-out wall/split.json -o {name}.json"
        );
        lumigraph(folder.path(), &line)
    };
    let error = focus("0000.png").error(1);
    let said = "cannot focus on 0000.png:48,36: 0000.png is held out by wall/split.json; focus on \
                another photo";
    assert_eq!(error, said);
    focus("0001.png").ok();
}
