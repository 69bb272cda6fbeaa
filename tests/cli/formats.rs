//! Calibrations of other programs, from file to picture.

use crate::run::{files, lumigraph, with_wall};
use calibrate::{ImageId, Point3DId, Reconstruction, colmap};
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::fs;
use std::path::Path;

/// The wall's COLMAP model as a transforms.json: world from camera, y up and z back.
fn transforms(model: &Path) -> Value {
    let model = colmap::read_model(model).unwrap();
    let frames = model.images.values().map(|image| {
        let world_from_camera = image.camera_from_world.inverse();
        let r = world_from_camera.matrix();
        let t = world_from_camera.translation;
        let row = |i: usize| [r.row(i).x, -r.row(i).y, -r.row(i).z, t[i]];
        json!({
            "file_path": format!("./images/{}", image.name),
            "transform_matrix": [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]],
        })
    });
    let camera = model.cameras.values().next().unwrap();
    let lens = camera.lens().unwrap();
    json!({
        "w": camera.width, "h": camera.height,
        "fl_x": lens.focal.x, "fl_y": lens.focal.y,
        "cx": lens.principal.x, "cy": lens.principal.y,
        "frames": frames.collect::<Vec<_>>(),
    })
}

#[test]
fn a_transforms_file_gives_the_pictures_of_the_model_it_was_made_from() {
    let folder = with_wall();
    let at = |path: &str| folder.path().join(path);
    lumigraph(folder.path(), "proxy wall plane -o plane.json").ok();
    let file = transforms(&at("wall/sparse/0"));
    fs::write(at("wall/transforms.json"), file.to_string()).unwrap();

    // Beside a COLMAP model it is passed over, aloud.
    let both = lumigraph(folder.path(), "evaluate wall --proxy plane.json --json").ok();
    let note = "`lumigraph import wall --calibration wall/transforms.json -o SCENE` takes that in \
                wall/transforms.json\n";
    assert!(both.stderr.contains(note), "{}", both.stderr);
    let line = "import wall --calibration wall/transforms.json -o scene";
    let taken = lumigraph(folder.path(), line).ok();
    assert!(!taken.stderr.contains("takes that"), "{}", taken.stderr);

    // Alone it serves.
    fs::remove_dir_all(at("wall/sparse")).unwrap();
    let alone = lumigraph(folder.path(), "evaluate wall --proxy plane.json --json").ok();
    let scores = |ran: &crate::run::Ran| -> Vec<f64> {
        let photos = ran.json()["photos"].as_array().unwrap().clone();
        photos.iter().map(|p| p["psnr"].as_f64().unwrap()).collect()
    };
    for (a, b) in scores(&both).into_iter().zip(scores(&alone)) {
        assert!((a - b).abs() < 1e-3, "{a} dB and {b} dB");
    }
}

/// `export` writes the file where it is told to, and names photos where they are.
#[test]
fn photos_that_a_calibration_names_elsewhere_are_told_of() {
    let folder = with_wall();
    let here = folder.path();
    fs::create_dir(here.join("other")).unwrap();
    lumigraph(
        here,
        "export wall --format transforms -o other/transforms.json",
    )
    .ok();
    let error = lumigraph(here, "import other -o scene").error(1);
    let line = "import other/../wall/images --calibration other/transforms.json -o";
    assert!(
        error.contains(&format!("`lumigraph {line} SCENE`")),
        "{error}"
    );
    lumigraph(here, &format!("{line} scene")).ok();
}

#[test]
fn frames_of_a_transforms_file_are_views() {
    let folder = with_wall();
    let at = |path: &str| folder.path().join(path);
    let draw = |views: &str, out: &str| {
        let line = format!("render wall --proxy plane --views {views} -o {out}");
        lumigraph(folder.path(), &line)
    };
    let mut file = transforms(&at("wall/sparse/0"));
    fs::write(at("all.json"), file.to_string()).unwrap();
    draw("wall", "model").ok();
    draw("all.json", "frames").ok();
    let names = |out: &str| files(&at(out)).into_keys().collect::<Vec<_>>();
    assert_eq!(names("frames"), names("model"));
    let apart = |a: &str, b: &str| {
        let [a, b] = [a, b].map(|file| image::open(at(file)).unwrap().into_rgba8());
        assert_eq!(a.dimensions(), b.dimensions());
        let bytes = a.as_raw().iter().zip(b.as_raw());
        bytes.map(|(a, b)| a.abs_diff(*b)).max().unwrap()
    };
    assert!(apart("frames/0003.png", "model/0003.png") <= 1);

    // As NeRF writes a split: without sizes, and names without what files end in. A capture's folder stands for
    // its file, too.
    let angle = 2.0 * (0.5 * 96.0 / file["fl_x"].as_f64().unwrap()).atan();
    let mut frame = file["frames"][3].clone();
    frame["file_path"] = json!("./test/r_3");
    file = json!({"camera_angle_x": angle, "frames": [frame]});
    fs::create_dir(at("nerf")).unwrap();
    fs::write(at("nerf/transforms_test.json"), file.to_string()).unwrap();
    let error = draw("nerf/transforms_test.json", "split").error(1);
    assert!(
        error.starts_with(
            "nerf/transforms_test.json: neither it nor pictures where its frames name them"
        ),
        "{error}"
    );
    fs::create_dir(at("nerf/test")).unwrap();
    fs::copy(at("wall/images/0003.png"), at("nerf/test/r_3.png")).unwrap();
    draw("nerf/transforms_test.json", "split").ok();
    assert_eq!(names("split"), [Path::new("test/r_3.png")]);
    assert!(apart("split/test/r_3.png", "model/0003.png") <= 1);
    fs::rename(at("nerf/transforms_test.json"), at("nerf/transforms.json")).unwrap();
    draw("nerf", "folder").ok();
    assert_eq!(apart("folder/test/r_3.png", "split/test/r_3.png"), 0);
}

#[test]
fn bad_records_are_named() {
    let folder = with_wall();
    let at = |path: &str| folder.path().join(path);
    let mut file = transforms(&at("wall/sparse/0"));
    file["frames"][3]["transform_matrix"][0][0] = json!(7.0);
    fs::write(at("wall/transforms.json"), file.to_string()).unwrap();
    fs::remove_dir_all(at("wall/sparse")).unwrap();
    let error = lumigraph(folder.path(), "info wall").error(1);
    let record = "wall/transforms.json, frames[3] (images/0003.png).transform_matrix: ";
    assert!(error.starts_with(record), "{error}");
}

/// The places of a model's images in files that count them.
fn places(model: &Reconstruction) -> BTreeMap<ImageId, usize> {
    model.images.keys().copied().zip(0..).collect()
}

/// The pixels that observe a model's points, relative to the middle of their photos, as NVM
/// counts them; with `up` −1, as Bundler does.
fn points(model: &Reconstruction, up: f64, separator: &str) -> String {
    let places = places(model);
    let mut text = String::new();
    for point in model.points.values() {
        let [x, y, z] = point.position.to_array();
        let [r, g, b] = point.color;
        let seen = point.track.len();
        let words = [
            format!("{x} {y} {z}"),
            format!("{r} {g} {b}"),
            seen.to_string(),
        ];
        text += &words.join(separator);
        for (id, index) in &point.track {
            let image = &model.images[id];
            let camera = &model.cameras[&image.camera_id];
            let keypoint = &image.keypoints[*index as usize];
            let x = keypoint.x - f64::from(camera.width) / 2.0;
            let y = up * (keypoint.y - f64::from(camera.height) / 2.0);
            let _ = write!(text, " {} {index} {x} {y}", places[id]);
        }
        text += "\n";
    }
    text
}

/// The model as a bundle.out; its list of photos is that of the names.
fn bundle(model: &Reconstruction) -> String {
    let (images, points_text) = (&model.images, points(model, -1.0, "\n"));
    let mut text = format!(
        "# Bundle file v0.3\n{} {}\n",
        images.len(),
        model.points.len()
    );
    for image in images.values() {
        let focal = model.cameras[&image.camera_id].params[0];
        let (r, t) = (
            image.camera_from_world.matrix(),
            image.camera_from_world.translation,
        );
        let _ = writeln!(text, "{focal} 0 0");
        for (i, sign) in [1.0, -1.0, -1.0].into_iter().enumerate() {
            let row = r.row(i) * sign;
            let _ = writeln!(text, "{} {} {}", row.x, row.y, row.z);
        }
        let _ = writeln!(text, "{} {} {}", t.x, -t.y, -t.z);
    }
    text + &points_text
}

/// The model as VisualSFM's file.
fn nvm(model: &Reconstruction) -> String {
    let mut text = format!("NVM_V3\n\n{}\n", model.images.len());
    for image in model.images.values() {
        let focal = model.cameras[&image.camera_id].params[0];
        let [x, y, z, w] = image.camera_from_world.rotation.to_array();
        let c = image.camera_from_world.center();
        let name = &image.name;
        let _ = writeln!(
            text,
            "{name} {focal} {w} {x} {y} {z} {} {} {} 0 0",
            c.x, c.y, c.z
        );
    }
    let points_text = points(model, 1.0, " ");
    format!("{text}\n{}\n{points_text}", model.points.len())
}

#[test]
fn pixels_that_count_from_elsewhere_are_told() {
    let folder = with_wall();
    let at = |path: &str| folder.path().join(path);
    let model = colmap::read_model(&at("wall/sparse/0")).unwrap();
    fs::remove_dir_all(at("wall/sparse")).unwrap();
    let info = |[x, y]: [f64; 2]| {
        let mut moved = model.clone();
        let images = moved.images.values_mut();
        for keypoint in images.flat_map(|image| &mut image.keypoints) {
            keypoint.x += x;
            keypoint.y += y;
        }
        fs::write(at("wall/model.nvm"), nvm(&moved)).unwrap();
        lumigraph(folder.path(), "info wall").ok().stderr
    };
    let corner = "from the photos' corners, as COLMAP";
    let misfit = "see the sparse points";
    let usual = info([0.0, 0.0]);
    assert!(
        !usual.contains(corner) && !usual.contains(misfit),
        "{usual}"
    );
    // From the corner of a photo of 96 × 72 they are read as they are meant.
    let colmaps = info([48.0, 36.0]);
    assert!(
        colmaps.contains(corner) && !colmaps.contains(misfit),
        "{colmaps}"
    );
    let wrong = info([-30.0, 30.0]);
    let note = "note: photos see the sparse points 42 pixels (the median) from where";
    assert!(wrong.contains(note) && !wrong.contains(corner), "{wrong}");
}

/// As one that was never aligned, in a model that lies far from the world's origin.
#[test]
fn a_photo_that_is_misplaced_is_named_and_harms_no_others() {
    let folder = with_wall();
    let here = folder.path();
    let model_folder = here.join("wall/sparse/0");
    let scored = |more: &str| -> (f64, String) {
        let ran = lumigraph(here, &format!("evaluate wall --proxy points --json{more}"));
        let ran = ran.ok();
        (ran.json()["mean"]["psnr"].as_f64().unwrap(), ran.stderr)
    };
    let (usual, said) = scored("");
    let named = "photo 0003.png sees most of its sparse points behind it, beyond its lens, or more than 10 pixels";
    assert!(!said.contains(named), "{said}");
    let mut model = colmap::read_model(&model_folder).unwrap();
    let mut images = model.images.values_mut();
    let stray = images.find(|image| image.name == "0003.png").unwrap();
    stray.camera_from_world.translation.x += 1e5;
    fs::remove_dir_all(&model_folder).unwrap();
    colmap::write_text(&model, &model_folder).unwrap();
    let info = lumigraph(here, "info wall").ok();
    assert!(info.stderr.contains(named), "{}", info.stderr);
    // Exported, with it and with the option that changes nothing there.
    let idle = "note: --keep-weak changes nothing: all photos and points are exported\n";
    for (more, is_idle) in [("", false), (" --keep-weak", true)] {
        let line = format!("export wall --format transforms -o t.json{more}");
        let said = lumigraph(here, &line).ok().stderr;
        assert!(said.contains(named), "{said}");
        assert!(said.contains("; exported all the same, though"), "{said}");
        assert_eq!(said.contains(idle), is_idle, "{said}");
    }
    // Left out, and used: where it is says nothing of how large the scene is.
    let (without, said) = scored("");
    assert!(
        said.contains(named) && said.contains("; --keep-weak uses them"),
        "{said}"
    );
    let (with, said) = scored(" --keep-weak");
    assert!(!said.contains(named), "{said}");
    assert!(
        without > usual - 1.0 && with > usual - 1.0,
        "{usual} dB, {without} without it, {with} with it"
    );
}

/// As wrong matches have them.
#[test]
fn points_that_all_their_photos_contradict_are_left_out() {
    let folder = with_wall();
    let here = folder.path();
    let model_folder = here.join("wall/sparse/0");
    let mut model = colmap::read_model(&model_folder).unwrap();
    let write = |model: &Reconstruction| {
        fs::remove_dir_all(&model_folder).unwrap();
        colmap::write_text(model, &model_folder).unwrap();
    };
    let scored = |more: &str| -> (f64, String) {
        let ran = lumigraph(here, &format!("evaluate wall --proxy points --json{more}"));
        let ran = ran.ok();
        (ran.json()["mean"]["psnr"].as_f64().unwrap(), ran.stderr)
    };
    let wrong: BTreeSet<Point3DId> = model.points.keys().step_by(10).copied().collect();
    for id in &wrong {
        model.points.get_mut(id).unwrap().position.x += 30.0;
    }
    write(&model);
    let named = format!(
        "{} of {} sparse points, which all photos",
        wrong.len(),
        model.points.len()
    );
    let info = lumigraph(here, "info wall").ok();
    assert!(info.stderr.contains(&named), "{}", info.stderr);
    for (format, has_points) in [("colmap", true), ("transforms", false)] {
        let line = format!("export wall --format {format} -o {format}");
        let said = lumigraph(here, &line).ok().stderr;
        assert_eq!(said.contains(&named), has_points, "{said}");
    }
    let (left_out, said) = scored("");
    let note = format!("note: left out, as wrong: {named}");
    assert!(said.contains(&note), "{said}");
    let (_, said) = scored(" --keep-weak");
    assert!(!said.contains(&named), "{said}");

    // They make no difference.
    model.remove_points(&wrong);
    write(&model);
    let (without, said) = scored("");
    assert!(!said.contains("left out, as wrong"), "{said}");
    assert!(
        (left_out - without).abs() < 1e-9,
        "{left_out} and {without} dB"
    );
}

/// Of formats that leave sizes to the photos.
#[test]
fn photos_that_are_missing_or_corrupt_are_left_out_whatever_the_format() {
    let folder = with_wall();
    let here = folder.path();
    let at = |path: &str| here.join(path);
    let model = colmap::read_model(&at("wall/sparse/0")).unwrap();
    let mut sizeless = transforms(&at("wall/sparse/0"));
    for key in ["w", "h"] {
        assert!(sizeless.as_object_mut().unwrap().remove(key).is_some());
    }
    lumigraph(here, "export wall --format opencv -o cal.yml").ok();
    let opencv = fs::read_to_string(at("cal.yml")).unwrap();
    let is_size = |line: &&str| line.starts_with("image_width") || line.starts_with("image_height");
    let opencv: Vec<&str> = opencv.lines().filter(|line| !is_size(line)).collect();
    let list: Vec<&str> = model.images.values().map(|i| i.name.as_str()).collect();
    fs::write(at("wall/list.txt"), list.join("\n")).unwrap();
    fs::remove_dir_all(at("wall/sparse")).unwrap();
    fs::write(at("wall/images/0000.png"), "not a picture").unwrap();
    fs::remove_file(at("wall/images/0003.png")).unwrap();
    let gone = ["0000.png", "0003.png"].map(str::to_owned);
    let rest = model.without_images(&BTreeSet::from(gone));
    let seen = |model: &Reconstruction| -> usize {
        let tracks = model.points.values().map(|point| point.track.len());
        tracks.sum()
    };
    for (name, text, has_points) in [
        ("cal.yml", opencv.join("\n"), false),
        ("transforms.json", sizeless.to_string(), false),
        ("bundle.out", bundle(&model), true),
        ("model.nvm", nvm(&model), true),
    ] {
        let file = at("wall").join(name);
        fs::write(&file, text).unwrap();
        let ran = lumigraph(here, "import wall -o scene --force").ok();
        assert!(ran.stdout.starts_with("scene: 7 photos"), "{}", ran.stdout);
        for warning in [
            "warning: photo 0000.png is left out: wall/images/0000.png: found no picture format",
            "warning: photo 0003.png is left out: wall/images/0003.png: cannot read the picture",
        ] {
            assert!(ran.stderr.contains(warning), "{name}: {}", ran.stderr);
        }
        // Points keep what the other photos see of them.
        let kept = colmap::read_model(&at("scene/model")).unwrap();
        assert_eq!(kept.images.len(), 7);
        if has_points {
            assert_eq!(kept.points.len(), rest.points.len(), "{name}");
            assert_eq!(seen(&kept), seen(&rest), "{name}");
        }
        for camera in kept.cameras.values() {
            assert_eq!((camera.width, camera.height), (96, 72), "{name}");
        }
        let error = lumigraph(here, "info wall --strict").error(1);
        assert!(error.starts_with("photo 0000.png: "), "{name}: {error}");
        fs::remove_file(file).unwrap();
    }
}

#[test]
fn bundlers_own_folder_is_looked_into() {
    let folder = with_wall();
    let at = |path: &str| folder.path().join(path);
    let model = colmap::read_model(&at("wall/sparse/0")).unwrap();
    let list: Vec<String> = model
        .images
        .values()
        .map(|i| format!("./{}", i.name))
        .collect();
    fs::write(at("wall/list.txt"), list.join("\n")).unwrap();
    fs::create_dir(at("wall/bundle")).unwrap();
    fs::write(at("wall/bundle/bundle.out"), bundle(&model)).unwrap();
    // Others go first.
    let ran = lumigraph(folder.path(), "info wall").ok();
    let note = "`lumigraph import wall --calibration wall/bundle/bundle.out -o SCENE` takes that";
    assert!(ran.stderr.contains(note), "{}", ran.stderr);
    fs::remove_dir_all(at("wall/sparse")).unwrap();
    let ran = lumigraph(folder.path(), "import wall -o scene").ok();
    assert!(ran.stdout.starts_with("scene: 9 photos"), "{}", ran.stdout);
}

#[test]
fn a_calibration_in_place_of_photos_is_told_to_be_one() {
    let folder = with_wall();
    let here = folder.path();
    let file = transforms(&here.join("wall/sparse/0"));
    fs::write(here.join("t.json"), file.to_string()).unwrap();
    fs::write(here.join("camera.yml"), "%YAML:1.0\n---\n").unwrap();
    fs::write(here.join("model.nvm"), "").unwrap();
    for file in [
        "t.json",
        "camera.yml",
        "model.nvm",
        "wall/sparse/0/images.bin",
    ] {
        let error = lumigraph(here, &format!("import {file} -o scene")).error(1);
        let said = format!(
            "{file}: a calibration, or no video at any rate; give its photos: `lumigraph import PHOTOS \
             --calibration {file} -o scene`"
        );
        assert_eq!(error, said);
    }
    assert!(!here.join("scene").exists());

    // OpenCV's matrices are one, whatever their file is called; other programs' JSON is none.
    lumigraph(here, "export wall --format opencv -o cal.json").ok();
    let error = lumigraph(here, "import cal.json -o scene").error(1);
    assert!(error.starts_with("cal.json: a calibration, or"), "{error}");
    lumigraph(here, "import wall -o made").ok();
    lumigraph(here, "proxy made plane -o plane.json").ok();
    fs::write(here.join("split.json"), r#"{"test": ["0003.png"]}"#).unwrap();
    for (file, said) in [
        ("made/scene.json", "the file of a scene, whose folder can"),
        ("plane.json", "no video, nor a calibration"),
        ("split.json", "no video, nor a calibration"),
    ] {
        let error = lumigraph(here, &format!("import {file} -o scene")).error(1);
        assert!(error.starts_with(&format!("{file}: {said}")), "{error}");
        assert!(!error.contains("--calibration"), "{error}");
    }
}
