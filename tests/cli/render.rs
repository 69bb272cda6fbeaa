//! Frames and where they come from.

use crate::interior::with_house;
use crate::run::{files, lumigraph, with_wall};
use calibrate::{Rigid3, colmap};
use render::path::{CameraPath, PathFrame};
use std::fs;
use std::path::{Path, PathBuf};

#[test]
fn a_source_view_gives_its_photo_back() {
    let folder = with_wall();
    lumigraph(
        folder.path(),
        "render wall --proxy plane --views wall/sparse/0 -o frames",
    )
    .ok();
    let open = |name: &str| image::open(folder.path().join(name)).unwrap().into_rgba8();
    for i in 0..9 {
        let photo = open(&format!("wall/images/000{i}.png"));
        let frame = open(&format!("frames/000{i}.png"));
        let score = render::score::score(&frame, &photo).unwrap();
        assert!(score.psnr_covered.unwrap() >= 50.0, "{i}: {score:?}");
    }
}

#[test]
fn held_out_photos_do_not_paint() {
    let folder = with_wall();
    let render = |options: &str, out: &str| {
        let line = format!("render wall --proxy plane --views wall --json -o {out}{options}");
        lumigraph(folder.path(), &line).ok().json()
    };
    assert_eq!(render("", "all")["report"]["photos_total"], 9);
    let rest = render(" --hold-out wall/split.json", "rest");
    assert_eq!(rest["report"]["photos_total"], 7);
    let frame = |folder: &std::path::Path| fs::read(folder.join("0008.png")).unwrap();
    assert_ne!(
        frame(&folder.path().join("all")),
        frame(&folder.path().join("rest"))
    );
}

#[test]
fn path_files_render_what_they_say() {
    let folder = with_wall();
    let model = colmap::read_model(&folder.path().join("wall/sparse/0")).unwrap();
    let frames: Vec<PathFrame> = model
        .images
        .values()
        .map(|image| {
            let camera = model.cameras[&image.camera_id].clone();
            let name = format!("sub/{}", image.name);
            PathFrame::new(name, camera, image.camera_from_world, None).unwrap()
        })
        .collect();
    let path = CameraPath::new(30.0, frames).unwrap();
    render::path::write(&folder.path().join("path.json"), &path).unwrap();

    lumigraph(
        folder.path(),
        "render wall --proxy plane --views wall -o model",
    )
    .ok();
    lumigraph(
        folder.path(),
        "render wall --proxy plane --views path.json -o views",
    )
    .ok();
    lumigraph(
        folder.path(),
        "render wall --proxy plane --path path.json -o path",
    )
    .ok();
    let [of_model, of_views, of_path] =
        ["model", "views/sub", "path/sub"].map(|out| files(&folder.path().join(out)));
    assert_eq!(of_model.len(), 9);
    assert!(of_views == of_path);
    // A path's rotations are matrices: the last digit of a pose may differ, no more.
    for (name, bytes) in &of_model {
        let open = |bytes: &[u8]| image::load_from_memory(bytes).unwrap().into_rgba8();
        let (a, b) = (open(bytes), open(&of_path[name]));
        let off = a.iter().zip(b.iter()).filter(|(a, b)| a.abs_diff(**b) > 2);
        assert!(off.count() * 1000 < a.len(), "{}", name.display());
    }

    fs::write(folder.path().join("bad.json"), "{}").unwrap();
    let error = lumigraph(
        folder.path(),
        "render wall --proxy plane --path bad.json -o bad",
    )
    .error(1);
    assert!(error.starts_with("bad.json: "), "{error}");
    assert!(!folder.path().join("bad").exists());
}

#[test]
fn derived_paths_stay_within_cover() {
    let folder = with_wall();
    for kind in ["orbit", "dolly", "sweep"] {
        let line = format!(
            "render wall --proxy plane --path {kind} --frames 4 --size 64x48 --json -o {kind}"
        );
        let result = lumigraph(folder.path(), &line).ok().json();
        assert_eq!(result["frames"].as_array().unwrap().len(), 4);
        let frames = files(&folder.path().join(kind));
        assert_eq!(frames.len(), 4);
        for bytes in frames.values() {
            let frame = image::load_from_memory(bytes).unwrap().into_rgba8();
            assert_eq!(frame.dimensions(), (64, 48));
            let covered = frame.pixels().filter(|p| p.0[3] > 127).count();
            assert!(covered * 10 > 64 * 48 * 8, "{kind}: {covered}");
        }
    }
}

#[test]
fn names_that_clash_are_refused_before_rendering() {
    let folder = with_wall();
    let mut model = colmap::read_model(&folder.path().join("wall/sparse/0")).unwrap();
    let names = ["a/x.png", "a/x.jpg", "a/x.jpg.png"];
    for (image, name) in model.images.values_mut().zip(names) {
        image.name = name.to_owned();
    }
    colmap::write_text(&model, &folder.path().join("views")).unwrap();
    let error = lumigraph(
        folder.path(),
        "render wall --proxy plane --views views -o out",
    )
    .error(1);
    assert!(
        error.contains("a/x.jpg and a/x.jpg.png") && error.contains("rename"),
        "{error}"
    );
    assert!(!folder.path().join("out").exists());

    model.images.values_mut().next().unwrap().name = "../../x.png".to_owned();
    colmap::write_text(&model, &folder.path().join("views")).unwrap();
    let error = lumigraph(
        folder.path(),
        "render wall --proxy plane --views views -o out",
    )
    .error(1);
    assert!(error.contains("leads out of the output folder"), "{error}");
}

#[test]
fn views_of_an_exported_calibration_are_called_as_its_photos() {
    let folder = with_wall();
    let here = folder.path();
    lumigraph(here, "import wall -o scene").ok();
    // Its photos lie outside its own folder.
    lumigraph(
        here,
        "export scene --format transforms -o scene/transforms.json",
    )
    .ok();
    let text = std::fs::read_to_string(here.join("scene/transforms.json")).unwrap();
    assert!(text.contains("\"../wall/images/0000.png\""), "{text}");
    let line = "render wall --proxy plane --size 32x24 --views scene/transforms.json -o out";
    lumigraph(here, line).ok();
    let written: Vec<_> = files(&here.join("out")).into_keys().collect();
    let expected = (0..9).map(|i| PathBuf::from(format!("000{i}.png")));
    assert_eq!(written, expected.collect::<Vec<_>>());
    // From the deepest folder that holds all of them.
    let text = text.replace("../wall/images/0000.png", "../other/a/../0000.png");
    std::fs::write(here.join("scene/transforms.json"), text).unwrap();
    lumigraph(here, &format!("{line} --frames 0..2")).ok();
    let written = files(&here.join("out"));
    for name in ["other/0000.png", "wall/images/0001.png"] {
        assert!(written.contains_key(Path::new(name)), "{name}");
    }
}

#[test]
fn parts_of_a_path_agree_on_what_files_are_called() {
    let folder = with_wall();
    let mut model = colmap::read_model(&folder.path().join("wall/sparse/0")).unwrap();
    for (image, name) in model.images.values_mut().zip(["a/x.png", "a/x.jpg"]) {
        image.name = name.to_owned();
    }
    colmap::write_text(&model, &folder.path().join("views")).unwrap();
    // The last of nine, by name.
    for part in ["7..8", "8..9"] {
        let line =
            format!("render wall --proxy plane --views views --frames {part} --size 32x24 -o out");
        lumigraph(folder.path(), &line).ok();
    }
    let written: Vec<_> = files(&folder.path().join("out")).into_keys().collect();
    assert_eq!(
        written,
        ["a/x.jpg.png", "a/x.png"].map(std::path::Path::new)
    );
}

#[test]
fn only_photos_in_use_are_decoded() {
    let folder = with_wall();
    let mut model = colmap::read_model(&folder.path().join("wall/sparse/0")).unwrap();
    // From a source photo's place through a longer lens: that photo alone paints it all.
    let first = *model.images.keys().next().unwrap();
    model.images.retain(|id, _| *id == first);
    model.images.get_mut(&first).unwrap().keypoints.clear();
    model.points.clear();
    for camera in model.cameras.values_mut() {
        camera.params[..2].fill(480.0);
    }
    colmap::write_text(&model, &folder.path().join("one")).unwrap();
    let render = |options: &str| {
        let line = format!("render wall --proxy plane --views one --json -o out{options}");
        lumigraph(folder.path(), &line).ok().json()["report"].clone()
    };
    let lazy = render("");
    for what in ["photos", "views", "lenses", "views,lenses"] {
        let named = render(&format!("-{what} --no-skip={what}"));
        let decoded = if what == "photos" { 9 } else { 1 };
        assert_eq!(named["photos_decoded"], decoded, "{what}");
        let of = |name: &str| files(&folder.path().join(name));
        assert!(of("out") == of(&format!("out-{what}")), "{what}");
    }
    let eager = render("-all --no-skip");
    assert_eq!(eager["photos_decoded"], 9);
    assert_eq!(lazy["photos_decoded"], 1);
    assert!(files(&folder.path().join("out")) == files(&folder.path().join("out-all")));
    if cfg!(target_os = "linux") {
        assert!(lazy["peak_memory_bytes"].as_u64() > Some(1 << 20), "{lazy}");
    }
}

#[test]
fn a_view_that_sees_nothing_is_transparent() {
    let folder = with_wall();
    let model = colmap::read_model(&folder.path().join("wall/sparse/0")).unwrap();
    let image = model.images.values().next().unwrap();
    let camera = model.cameras[&image.camera_id].clone();
    // Turned around.
    let about = Rigid3::new(
        glam::DQuat::from_rotation_y(std::f64::consts::PI),
        glam::DVec3::ZERO,
    );
    let pose = about * image.camera_from_world;
    let frame = PathFrame::new("back".to_owned(), camera, pose, None).unwrap();
    let path = CameraPath::new(30.0, vec![frame]).unwrap();
    render::path::write(&folder.path().join("path.json"), &path).unwrap();
    lumigraph(
        folder.path(),
        "render wall --proxy plane --path path.json -o out",
    )
    .ok();
    let frame = image::open(folder.path().join("out/back.png"))
        .unwrap()
        .into_rgba8();
    assert!(frame.pixels().all(|p| p.0 == [0; 4]));
}

#[test]
fn a_path_with_its_own_frames_is_not_asked_for_so_many() {
    let folder = with_wall();
    let line = |frames: &str, out: &str| {
        format!("render wall --proxy plane --views wall --frames {frames} --size 48x36 -o {out}")
    };
    let error = lumigraph(folder.path(), &line("2", "all")).error(2);
    assert!(error.contains("--frames 0..2"), "{error}");
    lumigraph(folder.path(), &line("0..2", "two")).ok();
    assert_eq!(files(&folder.path().join("two")).len(), 2);
    // A kind that is misspelt is no file.
    let misspelt = "render wall --proxy plane --path orbti --frames 2 -o out";
    let error = lumigraph(folder.path(), misspelt).error(2);
    assert!(error.contains("--path orbti: expected orbit"), "{error}");
}

#[test]
fn of_a_path_that_is_not_there_no_frames_are_told() {
    let folder = with_wall();
    for (views, code, said) in [
        ("--path nowhere.json", 1, "nowhere.json: No such file"),
        ("--path wall", 2, "--path wall: expected orbit"),
        (
            "--views nowhere",
            2,
            "--views nowhere: there is no such file",
        ),
    ] {
        let line = format!("render wall --proxy plane {views} --frames 2 -o out");
        let error = lumigraph(folder.path(), &line).error(code);
        assert!(
            error.contains(said) && !error.contains("--frames"),
            "{views}: {error}"
        );
    }
}

#[cfg(target_os = "linux")]
#[test]
fn json_holds_paths_that_are_not_utf_8_with_that_replaced() {
    use std::os::unix::ffi::OsStringExt;
    // ODD stands for such a name.
    let json = |folder: &std::path::Path, line: &str| -> serde_json::Value {
        let word = |word: &str| {
            let parts: Vec<&[u8]> = word.split("ODD").map(str::as_bytes).collect();
            std::ffi::OsString::from_vec(parts.join(&b"odd\xff"[..]))
        };
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_lumigraph"));
        command.current_dir(folder).args(line.split(' ').map(word));
        let ran = command
            .args(["--device", "cpu", "--json"])
            .output()
            .unwrap();
        assert!(
            ran.status.success(),
            "{}",
            String::from_utf8_lossy(&ran.stderr)
        );
        serde_json::from_slice(&ran.stdout).unwrap()
    };
    let folder = with_wall();
    let views = "--views wall --frames 0..1 --size 48x36";
    let line = format!("render wall --proxy plane {views} -o ODD --video ODD.mp4");
    let result = json(folder.path(), &line);
    assert_eq!(result["frames"][0]["file"], "odd\u{fffd}/0000.png");
    assert_eq!(result["video"], "odd\u{fffd}.mp4");

    let folder = with_house();
    let odd = std::ffi::OsString::from_vec(b"odd\xff".to_vec());
    fs::rename(folder.path().join("house"), folder.path().join(odd)).unwrap();
    let result = json(folder.path(), "ldis ODD --reference-size 24x24");
    assert_eq!(result["folder"], "odd\u{fffd}/ldi");
}
