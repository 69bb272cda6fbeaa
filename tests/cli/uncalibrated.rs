//! Photos without a calibration, and videos, with COLMAP and ffmpeg themselves.

use crate::run::{files, lumigraph, run, with_wall};
use calibrate::{Camera, Reconstruction, Rigid3, colmap};
use capture::Tool;
use glam::{DQuat, DVec3, DVec4};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// Whether a program is installed; where it is not, says so, or fails if the environment
/// has `LUMIGRAPH_REQUIRE_TOOLS=1`.
pub(crate) fn is_installed(tool: &Tool) -> bool {
    match tool.text(&["-h"]) {
        Ok(_) => true,
        Err(error) if std::env::var("LUMIGRAPH_REQUIRE_TOOLS").as_deref() == Ok("1") => {
            panic!("LUMIGRAPH_REQUIRE_TOOLS is 1, but: {error}")
        }
        Err(error) => {
            eprintln!("SKIPPED: {error}");
            false
        }
    }
}

/// Poses by name.
fn poses(model: &Reconstruction) -> BTreeMap<&str, Rigid3> {
    let images = model.images.values();
    images
        .map(|i| (i.name.as_str(), i.camera_from_world))
        .collect()
}

/// How far poses are from the truth after the best similarity: the largest angle between
/// camera frames, and the largest distance of centres relative to their spread.
fn pose_errors(found: &Reconstruction, truth: &Reconstruction) -> (f64, f64) {
    let truth = poses(truth);
    let pairs: Vec<(Rigid3, Rigid3)> = poses(found)
        .iter()
        .map(|(name, pose)| (*pose, truth[name]))
        .collect();
    // 1. Each photo tells the rotation between the worlds: their mean.
    let turns: Vec<DQuat> = pairs
        .iter()
        .map(|(found, truth)| (truth.rotation.conjugate() * found.rotation).normalize())
        .collect();
    let same_side = |q: &DQuat| DVec4::from(*q) * q.dot(turns[0]).signum();
    let turn = DQuat::from_vec4(turns.iter().map(same_side).sum()).normalize();
    let angle = turns
        .iter()
        .map(|q| q.angle_between(turn))
        .fold(0.0, f64::max);
    // 2. Scale and shift, from the centres.
    let count = pairs.len() as f64;
    let mean = |centers: &[DVec3]| centers.iter().sum::<DVec3>() / count;
    let ours: Vec<DVec3> = pairs.iter().map(|(f, _)| turn * f.center()).collect();
    let theirs: Vec<DVec3> = pairs.iter().map(|(_, t)| t.center()).collect();
    let (our_mean, their_mean) = (mean(&ours), mean(&theirs));
    let spread = |centers: &[DVec3], mean: DVec3| {
        let squares = centers.iter().map(|c| c.distance_squared(mean));
        (squares.sum::<f64>() / count).sqrt()
    };
    let (our_spread, their_spread) = (spread(&ours, our_mean), spread(&theirs, their_mean));
    let scale = their_spread / our_spread;
    let shifted = ours.iter().map(|c| their_mean + scale * (*c - our_mean));
    let distances = shifted.zip(&theirs).map(|(a, b)| a.distance(*b));
    (angle, distances.fold(0.0, f64::max) / their_spread)
}

/// The photos of the shelf alone, and the truth about them.
fn shelf_photos(folder: &Path, size: &str) -> Reconstruction {
    let line = format!("generate shelf --size {size} --photos 9 -o shelf");
    lumigraph(folder, &line).ok();
    let truth = colmap::read_model(&folder.join("shelf/sparse/0")).unwrap();
    fs::rename(folder.join("shelf/images"), folder.join("photos")).unwrap();
    truth
}

#[test]
fn colmap_places_all_photos_of_the_shelf() {
    if !is_installed(&colmap::run::colmap()) {
        return;
    }
    let here = tempfile::tempdir().unwrap();
    let truth = shelf_photos(here.path(), "640x480");
    fs::write(here.path().join("photos/notes.jpg"), "not a photo").unwrap();

    let ran = lumigraph(here.path(), "import photos -o scene").ok();
    let said = "warning: photo notes.jpg is not placed: COLMAP cannot use it";
    assert!(ran.stderr.contains(said), "{}", ran.stderr);
    assert!(
        ran.stderr.contains("COLMAP placed 9 of 10 photos"),
        "{}",
        ran.stderr
    );
    let found = colmap::read_model(&here.path().join("scene/model")).unwrap();
    assert_eq!(found.images.len(), 9);
    let (angle, distance) = pose_errors(&found, &truth);
    // Of six runs the farthest: 2.2 % of the spread; of photos of 480 x 360 up to 5.6.
    assert!(angle.to_degrees() < 0.5, "{}°", angle.to_degrees());
    assert!(distance < 0.05, "{distance} of the spread");
    let info = lumigraph(here.path(), "info scene --json").ok().json();
    let error_px = info["cameras"][0]["reprojection_px"]["mean"].as_f64();
    assert!(error_px.unwrap() < 0.5, "{error_px:?} px");

    // Nothing is done again, and the scene is the same.
    let before = files(&here.path().join("scene"));
    let ran = lumigraph(here.path(), "import photos -o scene --force").ok();
    for step in ["finding features", "matching", "placing photos"] {
        let said = format!("note: {step} was finished by an earlier run");
        assert!(ran.stderr.contains(&said), "{}", ran.stderr);
    }
    assert!(files(&here.path().join("scene")) == before);

    // Photos that changed are another set.
    fs::remove_file(here.path().join("photos/notes.jpg")).unwrap();
    fs::remove_file(here.path().join("photos/0001.png")).unwrap();
    for i in 3..9 {
        fs::remove_file(here.path().join(format!("photos/000{i}.png"))).unwrap();
    }
    let ran = lumigraph(here.path(), "import photos -o scene --force");
    assert!(ran.stderr.contains("it starts over"), "{}", ran.stderr);
}

#[test]
fn photos_of_nothing_give_no_model_and_no_scene() {
    if !is_installed(&colmap::run::colmap()) {
        return;
    }
    let here = tempfile::tempdir().unwrap();
    fs::create_dir(here.path().join("photos")).unwrap();
    for name in ["a.png", "b.png"] {
        let grey = image::GrayImage::from_pixel(64, 64, image::Luma([90]));
        grey.save(here.path().join("photos").join(name)).unwrap();
    }
    let ran = lumigraph(here.path(), "import photos -o scene");
    let error = ran.error(1);
    assert!(error.contains("`colmap mapper` failed"), "{error}");
    assert!(ran.stderr.contains("photos need overlap"), "{}", ran.stderr);
    assert!(!here.path().join("scene/scene.json").exists());
    assert!(here.path().join("scene/colmap/mapping.log").is_file());
}

#[test]
fn without_the_programs_it_says_how_to_get_them() {
    let folder = with_wall();
    fs::remove_dir_all(folder.path().join("wall/sparse")).unwrap();
    fs::write(folder.path().join("sweep.mp4"), "").unwrap();
    let before = files(folder.path());
    let nowhere = [("PATH", "/nowhere")];
    for (what, program) in [("wall", "colmap"), ("sweep.mp4", "ffmpeg")] {
        let words = ["import", what, "-o", "scene"];
        let error = run(folder.path(), &words, &nowhere).error(1);
        assert!(
            error.contains(&format!("apt-get install {program}")),
            "{error}"
        );
    }
    assert!(files(folder.path()) == before);
}

#[test]
fn options_that_do_not_fit_are_refused_or_noted() {
    let folder = with_wall();
    let ran = lumigraph(folder.path(), "import wall --frames 5 -o scene");
    assert_eq!(ran.code, 2);
    assert!(ran.stderr.contains("for a video's file"), "{}", ran.stderr);
    for wrong in [
        "--fps 0",
        "--frames 1",
        "--frames 5 --fps 2",
        "--matching some",
    ] {
        let line = format!("import a.mp4 {wrong} -o scene");
        assert_eq!(lumigraph(folder.path(), &line).code, 2, "{wrong}");
    }
    let ran = lumigraph(folder.path(), "import wall --matching exhaustive -o scene").ok();
    assert!(
        ran.stderr.contains("--matching changes nothing"),
        "{}",
        ran.stderr
    );
    // Not after an hour's work.
    let error = lumigraph(folder.path(), "import gone.mp4 -o scene").error(1);
    assert!(error.contains("--force"), "{error}");
}

#[test]
fn a_video_becomes_a_scene_with_times() {
    let ffmpeg = capture::video::ffmpeg();
    if !is_installed(&ffmpeg) {
        return;
    }
    let here = tempfile::tempdir().unwrap();
    let truth = shelf_photos(here.path(), "320x240");
    let names: Vec<&str> = poses(&truth).into_keys().collect();
    // Every photo is there twice, the second time out of focus.
    for (i, name) in names.iter().enumerate() {
        let photo = image::open(here.path().join("photos").join(name)).unwrap();
        let at = |i: usize| here.path().join(format!("{i}.png"));
        photo.to_rgb8().save(at(2 * i)).unwrap();
        photo.to_rgb8().save(at(2 * i + 1)).unwrap();
        let blurred = image::imageops::blur(&photo.to_rgb8(), 2.0);
        blurred.save(at(2 * i + 1)).unwrap();
    }
    let at = |path: &str| here.path().join(path).display().to_string();
    let (pictures, video) = (at("%d.png"), at("sweep.mp4"));
    let words = format!("-v error -framerate 4 -i {pictures} -crf 12 -pix_fmt yuv420p {video}");
    let words: Vec<&str> = words.split(' ').collect();
    ffmpeg
        .run(&words, &here.path().join("log"), &mut |_| {})
        .unwrap();

    // The truth about the frames, by their names: what is tested is the frames' choice and
    // their times.
    let mut model = truth.clone();
    for image in model.images.values_mut() {
        let i = names.iter().position(|name| *name == image.name).unwrap();
        image.name = format!("{:010.3}s.jpg", i as f64 / 2.0);
    }
    colmap::write_text(&model, &here.path().join("model")).unwrap();
    let line = "import sweep.mp4 --frames 9 --calibration model -o scene";
    lumigraph(here.path(), line).ok();
    let scene = fs::read(here.path().join("scene/scene.json")).unwrap();
    let scene: serde_json::Value = serde_json::from_slice(&scene).unwrap();
    let photos = scene["photos"].as_array().unwrap();
    assert_eq!(photos.len(), 9);
    for (i, photo) in photos.iter().enumerate() {
        assert_eq!(photo["time_s"].as_f64(), Some(i as f64 / 2.0), "{photo}");
        let path = format!("photos/{}", photo["name"].as_str().unwrap());
        assert_eq!(photo["path"], path.as_str());
    }

    // The video is no film's to be.
    assert_eq!(scene["settings"]["video"], "../sweep.mp4");
    let before = fs::read(&video).unwrap();
    let render = "render scene --proxy plane --path sweep --frames 2 --size 48x36 -o out --video";
    let error = lumigraph(here.path(), &format!("{render} sweep.mp4")).error(1);
    let said = "sweep.mp4: the film is made of this very file";
    assert!(error.starts_with(said), "{error}");
    assert!(fs::read(&video).unwrap() == before && !here.path().join("out").exists());

    // Interrupted before the scene was written, and again with --force: the frames stay.
    let frames = files(&here.path().join("scene/photos"));
    fs::remove_file(here.path().join("scene/scene.json")).unwrap();
    let ran = lumigraph(here.path(), line).ok();
    assert!(
        ran.stderr.contains("taken by an earlier run"),
        "{}",
        ran.stderr
    );
    lumigraph(here.path(), &format!("{line} --force")).ok();
    assert!(files(&here.path().join("scene/photos")) == frames);

    // Other frames take their place with the scene that is made of them, and not before.
    let visible = || {
        let mut files = files(&here.path().join("scene"));
        files.retain(|path, _| {
            !path
                .to_string_lossy()
                .starts_with(".photos.replaced-failed")
        });
        files
    };
    let before = visible();
    for (options, said) in [
        ("--frames 5 --calibration nowhere", "nowhere"),
        // One photo is none that anybody can place.
        ("--fps 0.01", "photo"),
    ] {
        let line = format!("import sweep.mp4 {options} -o scene --force");
        let error = lumigraph(here.path(), &line).error(1);
        assert!(error.contains(said), "{error}");
        assert!(visible() == before, "{options}");
    }
    let line = "import sweep.mp4 --frames 5 --calibration model -o scene --force";
    let ran = lumigraph(here.path(), line).ok();
    assert!(ran.stdout.contains("5 photos"), "{}", ran.stdout);
    assert_eq!(files(&here.path().join("scene/photos")).len(), 6);
    assert!(!here.path().join("scene/.photos.replaced-scene").exists());

    // As of slow motion.
    let list: String = model
        .images
        .values()
        .map(|i| format!("{},{}\n", i.name, 100 + i.name.len()))
        .collect();
    fs::write(here.path().join("times.csv"), list).unwrap();
    let line = "import sweep.mp4 --frames 9 --calibration model --times times.csv -o slow";
    lumigraph(here.path(), line).ok();
    let scene = fs::read(here.path().join("slow/scene.json")).unwrap();
    let scene: serde_json::Value = serde_json::from_slice(&scene).unwrap();
    assert_eq!(scene["photos"][3]["time_s"].as_f64(), Some(115.0));
    let line = "import sweep.mp4 --frame-rate 4 -o rate";
    let error = lumigraph(here.path(), line).error(2);
    assert!(error.contains("a video tells its times itself"), "{error}");
}

/// What other programs calibrate is mostly frames as they are stored, whatever players make of them.
#[test]
fn frames_that_are_not_square_have_the_shape_that_is_calibrated() {
    let ffmpeg = capture::video::ffmpeg();
    if !is_installed(&ffmpeg) {
        return;
    }
    let folder = with_wall();
    let here = folder.path();
    let pictures = here.join("wall/images/%04d.png").display().to_string();
    let video = here.join("squeezed.mp4").display().to_string();
    let words = format!(
        "-v error -framerate 2 -i {pictures} -vf scale=72:72,setsar=4/3 -crf 12 -pix_fmt yuv420p {video}"
    );
    let words: Vec<&str> = words.split(' ').collect();
    ffmpeg.run(&words, &here.join("log"), &mut |_| {}).unwrap();
    let mut shown = colmap::read_model(&here.join("wall/sparse/0")).unwrap();
    for image in shown.images.values_mut() {
        let number: f64 = image.name.trim_end_matches(".png").parse().unwrap();
        image.name = format!("{:010.3}s.jpg", number / 2.0);
    }
    colmap::write_text(&shown, &here.join("shown")).unwrap();
    let mut stored = shown.clone();
    for camera in stored.cameras.values_mut() {
        let lens = camera.lens().unwrap().scaled(0.75, 1.0);
        *camera = Camera::of(&lens, 72, 72);
    }
    colmap::write_text(&stored, &here.join("stored")).unwrap();
    let note = "its pixels are not square, so its frames of 72 × 72 are drawn out to 96 × 72";
    for (model, size, is_told) in [("shown", (96, 72), true), ("stored", (72, 72), false)] {
        let line = format!("import squeezed.mp4 --frames 9 --calibration {model} -o {model}-scene");
        let said = lumigraph(here, &line).ok().stderr;
        assert_eq!(said.contains(note), is_told, "{said}");
        let photo = here.join(format!("{model}-scene/photos/000002.000s.jpg"));
        assert_eq!(capture::photo_size(&photo).unwrap(), size, "{model}");
    }
}
