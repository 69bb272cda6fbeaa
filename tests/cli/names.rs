//! Photos that a calibration calls otherwise than their files, or that lie where it does not say.

use crate::run::{files, lumigraph, with_wall};
use calibrate::colmap;
use serde_json::Value;
use std::fs;
use std::path::PathBuf;
use tempfile::TempDir;

fn at(folder: &TempDir, path: &str) -> PathBuf {
    folder.path().join(path)
}

/// The wall, whose model calls photos otherwise.
fn called(name: impl Fn(&str) -> String) -> TempDir {
    let folder = with_wall();
    call(&folder, name);
    folder
}

/// Has the wall's model call photos otherwise than it does.
fn call(folder: &TempDir, name: impl Fn(&str) -> String) {
    let model = at(folder, "wall/sparse/0");
    let mut whole = colmap::read_model(&model).unwrap();
    for image in whole.images.values_mut() {
        image.name = name(&image.name);
    }
    fs::remove_dir_all(&model).unwrap();
    colmap::write_text(&whole, &model).unwrap();
}

/// Of its photos, the number `i`.
fn photo(folder: &TempDir, i: usize) -> PathBuf {
    at(folder, &format!("wall/images/000{i}.png"))
}

/// The wall, as taken by two cameras that have a folder each: those of even numbers, and of odd ones.
fn rig() -> TempDir {
    let camera = |name: &str| format!("cam{}", name.as_bytes()[3] % 2);
    let folder = called(|name| format!("{}/{name}", camera(name)));
    for i in 0..9 {
        let name = format!("000{i}.png");
        let place = at(&folder, "wall").join(camera(&name));
        fs::create_dir_all(&place).unwrap();
        fs::rename(photo(&folder, i), place.join(name)).unwrap();
    }
    fs::remove_dir(at(&folder, "wall/images")).unwrap();
    folder
}

/// The same with a `transforms.json` in place of COLMAP's model, and with the cameras' folders in `images`.
fn listed_rig() -> TempDir {
    let folder = rig();
    let line = "export wall --format transforms -o wall/transforms.json";
    lumigraph(folder.path(), line).ok();
    fs::remove_dir_all(at(&folder, "wall/sparse")).unwrap();
    fs::create_dir(at(&folder, "wall/images")).unwrap();
    for camera in ["cam0", "cam1"] {
        let place = at(&folder, "wall/images").join(camera);
        fs::rename(at(&folder, "wall").join(camera), place).unwrap();
    }
    rewrite(&folder, "\"cam", "\"images/cam");
    folder
}

/// Replaces text in its `transforms.json`.
fn rewrite(folder: &TempDir, from: &str, to: &str) {
    let file = at(folder, "wall/transforms.json");
    let text = fs::read_to_string(&file).unwrap();
    assert!(text.contains(from), "{text}");
    fs::write(file, text.replace(from, to)).unwrap();
}

#[test]
fn another_photo_does_not_stand_in_for_one_that_is_missing() {
    let folder = listed_rig();
    let ran = lumigraph(folder.path(), "import wall --strict -o whole").ok();
    assert!(ran.stdout.contains("9 photos"), "{}", ran.stdout);
    fs::remove_file(at(&folder, "wall/images/cam0/0004.png")).unwrap();
    for stray in ["0004.png", "0004.jpg"] {
        let stray = at(&folder, "wall/images").join(stray);
        image::RgbImage::new(96, 72).save(&stray).unwrap();
        let error = lumigraph(folder.path(), "import wall --strict -o strict").error(1);
        assert!(error.contains("photo cam0/0004.png: "), "{error}");
        let ran = lumigraph(folder.path(), "import wall --force -o scene").ok();
        assert!(ran.stdout.contains("8 photos"), "{}", ran.stdout);
        let warning = "photo cam0/0004.png is left out: wall/images/cam0/0004.png: ";
        assert!(ran.stderr.contains(warning), "{}", ran.stderr);
        fs::remove_file(stray).unwrap();
    }
}

#[test]
fn two_poses_of_one_photo_are_named() {
    let folder = listed_rig();
    rewrite(&folder, "images/cam1/0003.png", "images/cam0/0002");
    let error = lumigraph(folder.path(), "import wall -o scene").error(1);
    let said = "wall/transforms.json: the file holds two poses whose paths both end in that of the photo cam0/0002.png, \
                images/cam0/0002.png and images/cam0/0002; remove one of them, or give";
    assert!(error.starts_with(said), "{error}");
}

#[test]
fn missing_photos_are_called_as_the_others_are() {
    let folder = listed_rig();
    // Two that are called alike but for their folders.
    fs::remove_file(at(&folder, "wall/images/cam0/0004.png")).unwrap();
    fs::remove_file(at(&folder, "wall/images/cam1/0003.png")).unwrap();
    rewrite(&folder, "cam1/0003", "cam1/0004");
    let ran = lumigraph(folder.path(), "import wall -o scene").ok();
    for name in ["cam0/0004.png", "cam1/0004.png"] {
        let warning = format!("photo {name} is left out: wall/images/{name}: ");
        assert!(ran.stderr.contains(&warning), "{}", ran.stderr);
    }

    // None is where the file says.
    fs::rename(at(&folder, "wall/images"), at(&folder, "wall/photos")).unwrap();
    let error = lumigraph(folder.path(), "info wall").error(1);
    let line = "import wall/photos --calibration wall/transforms.json -o";
    assert!(
        error.contains(&format!("`lumigraph {line} SCENE`")),
        "{error}"
    );
    let ran = lumigraph(folder.path(), &format!("{line} scene --force")).ok();
    assert!(ran.stdout.contains("7 photos"), "{}", ran.stdout);
}

#[test]
fn pictures_of_an_earlier_run_are_told_of_in_each_cameras_folder() {
    let folder = rig();
    let said = |every: u32| {
        let line = format!("evaluate wall --proxy plane --size 24x18 --every {every} -o out");
        let said = lumigraph(folder.path(), &line).ok().stderr;
        let told = said.lines().filter(|line| line.contains("of this run"));
        told.map(str::to_owned).collect::<Vec<String>>()
    };
    assert_eq!(said(2), [""; 0]);
    let expected = [
        "note: 2 pictures in out/cam0 are not of this run, as 0004.png",
        "note: 0007.png in out/cam1 is not of this run",
    ];
    assert_eq!(said(3), expected);
}

#[test]
fn each_camera_of_a_rig_may_have_a_folder() {
    let folder = rig();
    // What lies beside photos is none.
    let mattes = at(&folder, "wall/mattes/cam0");
    fs::create_dir_all(&mattes).unwrap();
    image::GrayImage::new(96, 72)
        .save(mattes.join("0000.png"))
        .unwrap();
    let ran = lumigraph(folder.path(), "import wall -o scene").ok();
    assert!(ran.stdout.contains("9 photos"), "{}", ran.stdout);
    assert!(
        !ran.stderr.contains("not in the calibration"),
        "{}",
        ran.stderr
    );
    let line = "render wall --proxy plane --path sweep --frames 2 --size 32x24 -o frames";
    lumigraph(folder.path(), line).ok();

    fs::remove_dir_all(at(&folder, "wall/cam0")).unwrap();
    fs::remove_dir_all(at(&folder, "wall/cam1")).unwrap();
    let error = lumigraph(folder.path(), "info wall").error(1);
    assert!(
        error.contains("or other folders within; give the"),
        "{error}"
    );
}

#[test]
fn names_may_differ_in_case_in_marks_and_in_what_they_end_in() {
    let folder = called(|name| name.replace("0004", "S\u{FC}d-4"));
    let images = |name: &str| at(&folder, "wall/images").join(name);
    let shrunk = |i: usize, to: &str, size: (u32, u32)| {
        let picture = image::open(photo(&folder, i)).unwrap();
        let filter = image::imageops::FilterType::Nearest;
        let picture = picture.resize_exact(size.0, size.1, filter).into_rgb8();
        picture.save(images(to)).unwrap();
        fs::remove_file(photo(&folder, i)).unwrap();
    };
    // Those that are used.
    fs::rename(photo(&folder, 3), images("0003.PNG")).unwrap();
    fs::rename(photo(&folder, 4), images("Su\u{308}d-4.png")).unwrap();
    shrunk(5, "0005.jpg", (96, 72));
    // One of which two may be meant, one of another size, one elsewhere.
    fs::copy(photo(&folder, 6), images("0006.JPEG")).unwrap();
    fs::rename(photo(&folder, 6), images("0006.jpg")).unwrap();
    shrunk(7, "0007.jpg", (95, 72));
    fs::create_dir(images("late")).unwrap();
    fs::rename(photo(&folder, 8), images("late/0008.png")).unwrap();

    let ran = lumigraph(folder.path(), "import wall -o scene").ok();
    for said in [
        "note: 3 of 9 photos are used though their files' names differ from the calibration's in \
         letters' case, in how marks are written, or in what they end in (0003.PNG for 0003.png, \
         for one)\n",
        "note: 4 of 10 photos are not in the calibration and stay unused (0006.JPEG, for one)\n",
        "0006.JPEG is called nearly so, but others are, too: give the one that is meant that very",
        "0007.jpg is called nearly so, but has 95 × 72 pixels where 96 × 72 were calibrated",
        "late/0008.png is called so in another folder: ",
    ] {
        assert!(ran.stderr.contains(said), "{said}: {}", ran.stderr);
    }
    let scene = fs::read(at(&folder, "scene/scene.json")).unwrap();
    let scene: Value = serde_json::from_slice(&scene).unwrap();
    let photos = scene["photos"].as_array().unwrap().iter();
    let files: Vec<&str> = photos.map(|p| p["path"].as_str().unwrap()).collect();
    let used = [
        "0000.png",
        "0001.png",
        "0002.png",
        "0003.PNG",
        "0005.jpg",
        "Su\u{308}d-4.png",
    ];
    assert_eq!(files, used.map(|name| format!("../wall/images/{name}")));
    let error = lumigraph(folder.path(), "info wall --strict").error(1);
    assert!(
        error.contains("photo 0006.png: ") && error.contains("0006.JPEG is called nearly so"),
        "{error}"
    );
}

#[cfg(unix)]
#[test]
fn names_may_have_backslashes() {
    let folder = called(|name| name.replace("0004", "on/4"));
    fs::rename(photo(&folder, 4), at(&folder, "wall/images/on\\4.png")).unwrap();
    let ran = lumigraph(folder.path(), "import wall --strict -o scene").ok();
    assert!(ran.stdout.contains("9 photos"), "{}", ran.stdout);
    let note = "note: 1 of 9 photos are used though their files' names differ from the calibration's in letters' \
                case, in `\\` for `/`, in how marks are written, or in what they end in (on\\4.png for on/4.png, for \
                one)\n";
    assert!(ran.stderr.contains(note), "{}", ran.stderr);
    assert!(
        !ran.stderr.contains("not in the calibration"),
        "{}",
        ran.stderr
    );
    let ran = lumigraph(folder.path(), "info scene --strict").ok();
    assert!(!ran.stderr.contains("left out"), "{}", ran.stderr);
}

#[test]
fn names_may_lead_past_other_folders() {
    let folder = called(|name| format!("../images/{name}"));
    let ran = lumigraph(folder.path(), "evaluate wall --proxy plane --json").ok();
    assert!(
        !ran.stderr.contains("not in the calibration"),
        "{}",
        ran.stderr
    );
    // As the split calls them.
    assert_eq!(ran.json()["photos"][0]["name"], "0000.png");
}

#[test]
fn a_photo_whose_name_a_scene_cannot_hold_is_left_out() {
    let folder = with_wall();
    let model = at(&folder, "wall/sparse/0");
    let mut whole = colmap::read_model(&model).unwrap();
    let mut images = whole.images.values_mut();
    let image = images.find(|image| image.name == "0004.png").unwrap();
    image.name = " 0004.png".to_owned();
    fs::remove_dir_all(&model).unwrap();
    colmap::write_binary(&whole, &model).unwrap();
    fs::rename(photo(&folder, 4), at(&folder, "wall/images/ 0004.png")).unwrap();
    let ran = lumigraph(folder.path(), "import wall -o scene").ok();
    let warning = "photo  0004.png is left out: a scene cannot hold its name, which begins";
    assert!(ran.stderr.contains(warning), "{}", ran.stderr);
    assert!(ran.stdout.contains("8 photos"), "{}", ran.stdout);
    let error = lumigraph(folder.path(), "import wall --strict -o strict").error(1);
    assert!(error.contains("photo  0004.png: "), "{error}");
    // Where nothing is written it serves.
    let line = "render wall --proxy plane --path sweep --frames 2 --size 32x24 -o frames";
    let ran = lumigraph(folder.path(), line).ok();
    assert!(!ran.stderr.contains("is left out"), "{}", ran.stderr);
}

#[test]
fn views_of_a_captures_own_model_are_called_as_its_photos() {
    let folder = with_wall();
    let times: String = (0..9).map(|i| format!("000{i}.png,{i}\n")).collect();
    fs::write(at(&folder, "wall/times.csv"), times).unwrap();
    lumigraph(folder.path(), "import wall -o scene").ok();
    let own = at(&folder, "wall/images").display().to_string();
    for (i, around) in ["../images", own.as_str(), "images"].iter().enumerate() {
        call(&folder, |name| {
            format!("{around}/{}", &name[name.len() - "0000.png".len()..])
        });
        for scene in ["wall", "scene"] {
            let out = format!("{scene}{i}");
            let line = format!(
                "render {scene} --proxy plane --views wall/sparse/0 --frames 7..9 --size 32x24 \
                 --time-window 3 -o {out}"
            );
            lumigraph(folder.path(), &line).ok();
            let written: Vec<PathBuf> = files(&at(&folder, &out)).into_keys().collect();
            assert_eq!(
                written,
                ["0007.png", "0008.png"].map(PathBuf::from),
                "{around}"
            );
        }
    }
}

#[test]
fn a_scene_that_was_moved_says_so() {
    let folder = with_wall();
    lumigraph(folder.path(), "import wall -o scene").ok();
    fs::create_dir(at(&folder, "deep")).unwrap();
    fs::rename(at(&folder, "scene"), at(&folder, "deep/scene")).unwrap();
    let error = lumigraph(folder.path(), "info deep/scene").error(1);
    assert!(error.starts_with("9 of 9 calibrated photos"), "{error}");
    assert!(
        error.ends_with("move them or the scene back, or import them again"),
        "{error}"
    );
}
