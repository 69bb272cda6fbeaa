//! Out to other programs' formats and back in.

use crate::run::{files, lumigraph, with_wall};
use calibrate::{ModelKind, Reconstruction, colmap};
use serde_json::json;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

fn model(folder: &TempDir, path: &str) -> Reconstruction {
    colmap::read_model(&folder.path().join(path)).unwrap()
}

/// The same cameras to 1e-12.
#[track_caller]
fn assert_same_cameras(a: &Reconstruction, b: &Reconstruction) {
    assert_eq!(a.images.len(), b.images.len());
    for (a_image, b_image) in a.images.values().zip(b.images.values()) {
        assert_eq!(a_image.name, b_image.name);
        let (p, q) = (a_image.camera_from_world, b_image.camera_from_world);
        assert!((p.rotation * q.rotation.conjugate()).xyz().length() < 1e-12);
        assert!(p.translation.distance(q.translation) < 1e-12 * q.translation.length().max(1.0));
        let (p, q) = (
            &a.cameras[&a_image.camera_id],
            &b.cameras[&b_image.camera_id],
        );
        assert_eq!((p.width, p.height), (q.width, q.height));
        let (p, q) = (p.lens().unwrap(), q.lens().unwrap());
        assert!((p.focal - q.focal).length() < 1e-12 * q.focal.length());
        assert!((p.principal - q.principal).length() < 1e-12 * q.principal.length());
        assert_eq!(p.distortion(), q.distortion());
    }
}

fn png(path: &Path) -> image::RgbaImage {
    image::open(path).unwrap().into_rgba8()
}

#[test]
fn every_format_brings_back_the_cameras_and_the_pictures() {
    let folder = with_wall();
    let run = |line: &str| lumigraph(folder.path(), line).ok();
    run("import wall -o scene");
    run("proxy scene plane -o plane.json");
    let render = |scene: &str, out: &str| {
        let path = "--path sweep --frames 2 --proxy plane.json";
        run(&format!("render {scene} {path} -o {out}"));
    };
    render("scene", "frames");
    let original = model(&folder, "scene/model");
    for (format, file, has_points) in [
        ("colmap", "model-bin", true),
        ("colmap-text", "model-txt", true),
        ("transforms", "out/transforms.json", false),
        ("opencv", "out/camera.yml", false),
    ] {
        run(&format!("export scene --format {format} -o {file}"));
        let back = format!("back-{format}");
        run(&format!(
            "import wall/images --calibration {file} -o {back}"
        ));
        let read = model(&folder, &format!("{back}/model"));
        assert_same_cameras(&read, &original);
        if has_points {
            assert_eq!(read, original, "{format}");
        }
        render(&back, &format!("frames-{format}"));
        for frame in fs::read_dir(folder.path().join("frames")).unwrap() {
            let name = frame.unwrap().file_name();
            let a = png(&folder.path().join("frames").join(&name));
            let b = png(&folder.path().join(format!("frames-{format}")).join(&name));
            let off = a
                .as_raw()
                .iter()
                .zip(b.as_raw())
                .map(|(a, b)| a.abs_diff(*b));
            // Poses that went through a matrix differ in their last bits.
            assert!(off.max().unwrap() <= 1, "{format}: {name:?}");
        }
    }
    // Photos are named as seen from the file, so that it serves where it lies.
    let text = fs::read_to_string(folder.path().join("out/transforms.json")).unwrap();
    assert!(text.contains("\"../wall/images/0000.png\""), "{text}");
}

#[test]
fn times_go_out_where_they_have_a_place_and_are_told_elsewhere() {
    let folder = with_wall();
    let here = folder.path();
    let lines: Vec<String> = (0..9)
        .map(|i| format!("{i:04}.png,{}\n", 0.1 * f64::from(i)))
        .collect();
    fs::write(here.join("wall/times.csv"), lines.concat()).unwrap();
    let run = |line: &str| lumigraph(here, line).ok();
    let scene = |name: &str| -> serde_json::Value {
        let file = here.join(name).join("scene.json");
        serde_json::from_slice(&fs::read(file).unwrap()).unwrap()
    };
    run("import wall -o scene");
    let mut file = scene("scene");
    file["photos"][3]["gain"] = json!([0.5, 0.5, 0.5]);
    fs::write(here.join("scene/scene.json"), file.to_string()).unwrap();
    let notes = |format: &str| {
        let said = run(&format!("export scene --format {format} -o {format}")).stderr;
        let left_out = |line: &&str| line.starts_with("note: left out: ");
        said.lines().filter(left_out).collect::<String>()
    };
    let no_place = "the format has no place for them";
    assert_eq!(
        notes("transforms"),
        format!("note: left out: gains of 1 photos; {no_place}")
    );
    for format in ["colmap", "colmap-text", "opencv"] {
        assert_eq!(
            notes(format),
            format!(
                "note: left out: 9 depth maps, times of 9 photos, gains of 1 photos; {no_place}"
            )
        );
    }
    run("import wall/images --calibration transforms -o back");
    let back = scene("back");
    for i in 0..9_usize {
        let (was, is) = (&file["photos"][i], &back["photos"][i]);
        assert!(was["time_s"].is_f64(), "{was}");
        assert_eq!(was["time_s"], is["time_s"]);
    }
}

#[test]
fn what_a_format_lacks_is_said_and_undistorting_helps() {
    let folder = with_wall();
    let sparse = folder.path().join("wall/sparse/0");
    let mut whole = colmap::read_model(&sparse).unwrap();
    for camera in whole.cameras.values_mut() {
        camera.model = ModelKind::Fov;
        camera.params.push(0.5);
    }
    colmap::write_binary(&whole, &sparse).unwrap();
    let line = "export wall --format transforms -o t.json";
    let error = lumigraph(folder.path(), line).error(1);
    assert_eq!(
        error,
        "camera 1 is FOV, which transforms.json cannot express; import the photos with \
         --undistort and export that scene, or export as colmap"
    );
    assert!(!folder.path().join("t.json").exists());
    lumigraph(folder.path(), "import wall --undistort -o flat").ok();
    lumigraph(folder.path(), "export flat --format transforms -o t.json").ok();
    let usage = lumigraph(folder.path(), "export flat --format opencv -o flat");
    assert_eq!(usage.code, 2);
}

#[test]
fn the_calibration_is_not_written_over() {
    let folder = with_wall();
    let wall = folder.path().join("wall");
    lumigraph(folder.path(), "import wall -o scene").ok();
    let to_file = "export wall --format transforms -o wall/transforms.json";
    // It is not what the photos are read with, as long as there is a model.
    lumigraph(folder.path(), to_file).ok();
    lumigraph(folder.path(), to_file).ok();
    // The pose of a photo that is away for now would be lost.
    fs::rename(wall.join("images/0003.png"), folder.path().join("away.png")).unwrap();
    let refused = |line: &str| {
        let before = files(folder.path());
        let error = lumigraph(folder.path(), line).error(1);
        assert!(error.contains("made of this very file"), "{error}");
        assert!(files(folder.path()) == before, "{line}");
    };
    refused("export wall --format colmap -o wall/sparse/0");
    refused("export wall --format colmap-text -o wall/images/../sparse/0");
    refused("export scene --format colmap -o scene/model");
    refused("export scene --format colmap -o wall/sparse/0");
    fs::remove_dir_all(wall.join("sparse")).unwrap();
    refused(to_file);
    lumigraph(folder.path(), "export wall --format transforms -o t.json").ok();
}

#[test]
fn nothing_that_belongs_to_a_scene_is_written_over() {
    let folder = with_wall();
    let here = folder.path();
    fs::write(here.join("wall/times.csv"), "0000.png,0\n0001.png,1\n").unwrap();
    lumigraph(here, "import wall -o scene").ok();
    lumigraph(here, "import wall -o other").ok();
    lumigraph(here, "import wall --undistort -o flat").ok();
    lumigraph(here, "proxy scene carved").ok();
    // A photo without a camera is a photo, too.
    fs::copy(
        here.join("wall/images/0003.png"),
        here.join("wall/images/more.png"),
    )
    .unwrap();
    let refused = |line: &str, said: &str| {
        let before = files(here);
        let error = lumigraph(here, &format!("export {line}")).error(1);
        assert!(
            error.contains(said) && error.contains("nothing was written"),
            "{error}"
        );
        assert!(files(here) == before, "{line}");
    };
    for (scene, file) in [
        ("wall", "wall/images/0003.png"),
        ("wall", "wall/images/more.png"),
        ("wall", "wall/depth/0003.png"),
        ("wall", "wall/split.json"),
        ("wall", "wall/times.csv"),
        ("scene", "wall/images/0003.png"),
        ("scene", "wall/split.json"),
        ("scene", "scene/scene.json"),
        ("scene", "scene/proxy.ply"),
        ("scene", "other/../scene/model/images.txt"),
        ("flat", "flat/images/0003.png"),
    ] {
        for format in ["transforms", "opencv"] {
            let line = format!("{scene} --format {format} -o {file}");
            refused(&line, &format!("{file}: the scene is made of this very"));
        }
    }
    for format in ["colmap", "colmap-text"] {
        for (folder, what) in [
            ("wall/images", "the scene's photos are in"),
            ("other/model", "a scene's own model is in"),
        ] {
            let line = format!("scene --format {format} -o {folder}");
            refused(&line, &format!("{folder}: {what} this very folder"));
        }
    }
    // Nor the video that photos were taken out of.
    let path = here.join("scene/scene.json");
    let mut scene: serde_json::Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    scene["settings"]["video"] = json!("../sweep.mp4");
    fs::write(&path, scene.to_string()).unwrap();
    fs::write(here.join("sweep.mp4"), "a video").unwrap();
    refused(
        "scene --format opencv -o sweep.mp4",
        "sweep.mp4: the scene is made of this very",
    );
    // Nor is a text to be called as a picture, whoever's it is.
    for name in ["new.png", "wall/copy.JPG", "new.jpeg", "new.webp"] {
        for format in ["transforms", "opencv"] {
            let ran = lumigraph(here, &format!("export scene --format {format} -o {name}"));
            let said = format!("-o {name}: that is a picture's name");
            assert!(
                ran.code == 2 && ran.stderr.contains(&said),
                "{}",
                ran.stderr
            );
            assert!(!here.join(name).exists());
        }
    }
    // What is nobody's is.
    for _ in 0..2 {
        lumigraph(here, "export scene --format transforms -o wall/t.json").ok();
        lumigraph(here, "export scene --format colmap -o other/model/more").ok();
    }
}

#[test]
fn files_may_have_names_as_long_as_disks_take() {
    let folder = with_wall();
    let here = folder.path();
    let name = format!("{}.json", "n".repeat(250));
    lumigraph(here, &format!("export wall --format transforms -o {name}")).ok();
    assert!(here.join(name).is_file());
    let house = "h".repeat(255);
    let line = format!("generate house --rooms 2 --triangles 1 -o {house}");
    lumigraph(here, &line).ok();
    lumigraph(
        here,
        &format!("interior {house}/house.glb --force -o {house}"),
    )
    .ok();
    assert!(here.join(house).join("interior.json").is_file());
}

#[test]
fn another_model_is_replaced_only_by_force() {
    let folder = with_wall();
    let here = folder.path();
    for format in ["colmap", "colmap-text"] {
        // The same as often as one likes.
        let line = format!("export wall --format {format} -o {format}");
        for _ in 0..2 {
            lumigraph(here, &line).ok();
        }
        // One camera differs, by its last bit.
        let own = model(&folder, format);
        let mut other = own.clone();
        let camera = other.cameras.values_mut().next().unwrap();
        camera.params[0] = f64::from_bits(camera.params[0].to_bits() + 1);
        match format {
            "colmap" => colmap::write_binary(&other, &here.join(format)).unwrap(),
            _ => colmap::write_text(&other, &here.join(format)).unwrap(),
        }
        let before = files(here);
        let error = lumigraph(here, &line).error(1);
        let said = format!("{format}: holds cameras.");
        assert!(error.starts_with(&said), "{error}");
        assert!(error.contains("replace it with --force"), "{error}");
        assert!(files(here) == before);
        lumigraph(here, &format!("{line} --force")).ok();
        assert_eq!(model(&folder, format), own);
    }
    // Nor are texts.
    for (format, file) in [("transforms", "transforms.json"), ("opencv", "camera.yml")] {
        let line = format!("export wall --format {format} -o {file}");
        for _ in 0..2 {
            lumigraph(here, &line).ok();
        }
        let own = fs::read(here.join(file)).unwrap();
        fs::write(here.join(file), "another").unwrap();
        let error = lumigraph(here, &line).error(1);
        let said = format!(
            "{file}: holds something else; nothing was written: replace it with --force, or choose another -o"
        );
        assert_eq!(error, said);
        assert_eq!(fs::read(here.join(file)).unwrap(), b"another");
        lumigraph(here, &format!("{line} --force")).ok();
        assert_eq!(fs::read(here.join(file)).unwrap(), own);
    }
    // Of one in part nobody knows what it says.
    fs::create_dir(here.join("part")).unwrap();
    fs::copy(here.join("colmap/images.bin"), here.join("part/images.bin")).unwrap();
    let error = lumigraph(here, "export wall --format colmap -o part").error(1);
    assert!(error.starts_with("part: holds images.bin, of"), "{error}");
}

#[cfg(target_os = "linux")]
#[test]
fn files_name_no_path_that_is_not_utf_8() {
    use std::os::unix::ffi::OsStrExt;
    let folder = with_wall();
    let odd = folder.path().join(std::ffi::OsStr::from_bytes(b"odd\xff"));
    fs::create_dir(&odd).unwrap();
    fs::rename(folder.path().join("wall"), odd.join("wall")).unwrap();
    let before = files(folder.path());
    for line in [
        "import wall -o ../scene",
        "import wall --undistort -o ../scene",
        "import wall/images --calibration wall/sparse/0 -o ../scene",
        "export wall --format transforms -o ../new/t.json",
        "export wall --format opencv -o ../new/camera.yml",
    ] {
        let error = lumigraph(&odd, line).error(1);
        let said = "the path is not UTF-8, and scene files hold UTF-8 names; rename";
        assert!(
            error.contains("/odd\u{fffd}/wall") && error.contains(said),
            "{line}: {error}"
        );
        assert!(files(folder.path()) == before, "{line}");
    }
    // Ways within that folder have no such part.
    lumigraph(&odd, "import wall -o scene").ok();
    let scene = fs::read_to_string(odd.join("scene/scene.json")).unwrap();
    assert!(
        scene.contains("\"../wall/images/0000.png\"") && !scene.contains('\u{fffd}'),
        "{scene}"
    );
    lumigraph(&odd, "export scene --format transforms -o t.json").ok();
    lumigraph(&odd, "export scene --format colmap -o ../model").ok();
}

#[test]
fn names_that_colmap_would_read_in_part_go_out_in_binary_alone() {
    let folder = with_wall();
    let wall = folder.path().join("wall");
    let sparse = wall.join("sparse/0");
    let mut whole = colmap::read_model(&sparse).unwrap();
    for image in whole.images.values_mut().filter(|i| i.name == "0003.png") {
        image.name = "my left.png".to_owned();
    }
    colmap::write_binary(&whole, &sparse).unwrap();
    let images = wall.join("images");
    fs::rename(images.join("0003.png"), images.join("my left.png")).unwrap();
    // Its name is the photo's, too.
    fs::remove_dir_all(wall.join("depth")).unwrap();
    let export = |format: &str| {
        let line = format!("export wall --format {format} -o {format}");
        lumigraph(folder.path(), &line)
    };
    assert_eq!(
        export("colmap-text").error(1),
        "photo \"my left.png\" has white space in its name, where COLMAP ends a name in its text \
         format; export with --format colmap, or rename the photo and import again"
    );
    assert!(!folder.path().join("colmap-text").exists());
    export("colmap").ok();
    assert_same_cameras(&model(&folder, "colmap"), &whole);
    // What a scene keeps for itself is text, and read by nobody else.
    lumigraph(folder.path(), "import wall -o scene").ok();
    let kept = model(&folder, "scene/model");
    assert!(kept.images.values().any(|i| i.name == "my left.png"));
}

#[test]
fn an_undistorted_scene_holds_its_photos() {
    let folder = with_wall();
    let sparse = folder.path().join("wall/sparse/0");
    let mut whole = colmap::read_model(&sparse).unwrap();
    for camera in whole.cameras.values_mut() {
        camera.model = ModelKind::OpenCv;
        camera.params.extend([-0.1, 0.01, 1e-3, 0.0]);
    }
    colmap::write_binary(&whole, &sparse).unwrap();
    // A JPEG photo gets another name; the split still knows it by its own.
    let images = folder.path().join("wall/images");
    let photo = image::open(images.join("0008.png")).unwrap().into_rgb8();
    photo.save(images.join("0008.jpg")).unwrap();
    fs::remove_file(images.join("0008.png")).unwrap();
    for image in whole.images.values_mut().filter(|i| i.name == "0008.png") {
        image.name = "0008.jpg".to_owned();
    }
    colmap::write_binary(&whole, &sparse).unwrap();
    let split = json!({"test": ["0000.png", "0008.jpg"]});
    fs::write(folder.path().join("wall/split.json"), split.to_string()).unwrap();

    let run = |line: &str| lumigraph(folder.path(), line).ok();
    run("import wall --undistort -o flat");
    let scene: serde_json::Value =
        serde_json::from_slice(&fs::read(folder.path().join("flat/scene.json")).unwrap()).unwrap();
    assert_eq!(scene["photos"][8]["name"], "0008.png");
    assert_eq!(scene["photos"][8]["path"], "images/0008.png");
    assert_eq!(scene["photos"][8]["original"], "0008.jpg");
    assert!(scene["photos"][0].get("original").is_none());
    assert_eq!(scene["photos"][8]["depth_map"], "depth/0008.png.png");
    assert_eq!(scene["photos"][8]["depth_scale"], 0.001);
    assert_eq!(scene["settings"]["undistorted"], true);
    let flat = model(&folder, "flat/model");
    let camera = flat.cameras.values().next().unwrap();
    assert_eq!(camera.model, ModelKind::Pinhole);
    assert_eq!(
        png(&folder.path().join("flat/images/0003.png")).dimensions(),
        (camera.width, camera.height)
    );
    let result = run("evaluate flat --json").json();
    assert_eq!(result["photos"].as_array().unwrap().len(), 2);

    // Its own photos may be replaced, those of others never.
    run("import wall --undistort -o flat --force");
    run("import wall -o thin");
    fs::create_dir(folder.path().join("thin/images")).unwrap();
    let error = lumigraph(folder.path(), "import wall -o thin --force").error(1);
    assert!(error.contains("holds images, which is no part"), "{error}");

    // Two photos of one name but for what it ends in, whose depth maps could not be told apart before that.
    fs::remove_dir_all(folder.path().join("wall/depth")).unwrap();
    fs::copy(images.join("0007.png"), images.join("0008.png")).unwrap();
    for image in whole.images.values_mut().filter(|i| i.name == "0007.png") {
        image.name = "0008.png".to_owned();
    }
    colmap::write_binary(&whole, &sparse).unwrap();
    run("import wall --undistort -o both");
    let both = fs::read(folder.path().join("both/scene.json")).unwrap();
    let both: serde_json::Value = serde_json::from_slice(&both).unwrap();
    let (jpeg, png) = (&both["photos"][7], &both["photos"][8]);
    assert_eq!(jpeg["name"], "0008.jpg.png");
    assert_eq!(jpeg["path"], "images/0008.jpg.png");
    assert_eq!(jpeg["original"], "0008.jpg");
    assert_eq!(png["path"], "images/0008.png");
    assert!(png.get("original").is_none());
    let scored = run("evaluate both --proxy plane --json").json();
    assert_eq!(scored["photos"][1]["name"], "0008.jpg.png");
}

#[test]
fn the_keys_that_were_chosen_are_recorded() {
    let folder = with_wall();
    let run = |line: &str| lumigraph(folder.path(), line).ok();
    let said = run("export wall --format opencv -o camera.yml").stdout;
    let expected = "camera.yml: 9 photos, no points: the format has those of a calibration board";
    assert!(said.starts_with(expected), "{said}");
    assert_eq!(run("info camera.yml --json").json()["points"], 0);
    let file = folder.path().join("camera.yml");
    let text = fs::read_to_string(&file).unwrap();
    let text = text
        .replace("camera_matrix:", "Kamera:")
        .replace("distortion_coefficients:", "Poly:");
    fs::write(&file, text).unwrap();
    run(
        "import wall/images --calibration camera.yml --camera-matrix Kamera --distortion Poly -o s",
    );
    let scene: serde_json::Value =
        serde_json::from_slice(&fs::read(folder.path().join("s/scene.json")).unwrap()).unwrap();
    assert_eq!(scene["settings"]["camera_matrix"], "Kamera");
    assert_eq!(scene["settings"]["distortion"], "Poly");
    assert!(scene["settings"].get("fisheye").is_none());
}

fn captures() -> Option<std::path::PathBuf> {
    let captures = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/captures");
    if !captures.is_dir() {
        eprintln!("SKIPPED: {} is absent", captures.display());
        return None;
    }
    Some(captures.canonicalize().unwrap())
}

#[test]
fn info_describes_any_bare_calibration() {
    let Some(captures) = captures() else { return };
    let here = tempfile::tempdir().unwrap();
    for (file, cameras, poses) in [
        ("fern/sparse/0/cameras.bin", 1, 20),
        ("sceaux-castle/sparse-txt/0/images.txt", 1, 11),
        ("sceaux-castle/sparse-txt", 1, 11),
        ("lego/transforms_train.json", 1, 40),
        ("other-formats/instant-ngp-fox/transforms.json", 1, 25),
        ("other-formats/bundler-platypus/bundle.out", 6, 6),
        ("other-formats/visualsfm-nvm/model.nvm", 22, 22),
        ("other-formats/meshroom-sfm/cameras.sfm", 1, 34),
        ("other-formats/llff-fern/poses_bounds.npy", 1, 20),
        ("opencv-chessboard/out_camera_data.yml", 1, 13),
    ] {
        let line = format!("info {} --json", captures.join(file).display());
        let info = lumigraph(here.path(), &line).ok().json();
        assert_eq!(info["cameras"].as_array().unwrap().len(), cameras, "{file}");
        assert_eq!(info["poses"], poses, "{file}");
    }
    // Alone, without the rest of its model.
    fs::copy(
        captures.join("fern/sparse/0/cameras.bin"),
        here.path().join("cameras.bin"),
    )
    .unwrap();
    let text = lumigraph(here.path(), "info cameras.bin").ok().stdout;
    assert!(
        text.starts_with("camera   1: SIMPLE_RADIAL 1000×750 ["),
        "{text}"
    );
}

#[test]
fn without_points_the_plane_is_where_the_cameras_look() {
    let Some(captures) = captures() else { return };
    let here = tempfile::tempdir().unwrap();
    // An object fills a part of its pictures: measured 0.24.
    for (photos, file, said, least_coverage) in [
        (
            "lego/images",
            "lego/transforms_train.json",
            "optical axes of 40",
            0.2,
        ),
        (
            "other-formats/instant-ngp-fox/images",
            "other-formats/instant-ngp-fox/transforms.json",
            "optical axes of 25",
            0.5,
        ),
        (
            "fern/images",
            "other-formats/llff-fern/poses_bounds.npy",
            "of 20 photos",
            0.5,
        ),
    ] {
        let (photos, file) = (captures.join(photos), captures.join(file));
        let line = format!(
            "import {} --calibration {} -o scene --force",
            photos.display(),
            file.display()
        );
        lumigraph(here.path(), &line).ok();
        let ran = lumigraph(here.path(), "proxy scene plane").ok();
        println!("{}", ran.stdout);
        assert!(ran.stdout.contains(said), "{}", ran.stdout);
        let ran = lumigraph(
            here.path(),
            "evaluate scene --proxy plane --every 8 --size 200x150 --json",
        )
        .ok();
        assert!(
            ran.stderr.contains("note: the proxy is a plane fitted to"),
            "{}",
            ran.stderr
        );
        let mean = &ran.json()["mean"];
        println!("{mean}");
        assert!(mean["coverage"].as_f64().unwrap() > least_coverage);
    }
}
