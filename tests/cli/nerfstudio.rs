//! Masks and depth maps out to nerfstudio's `transforms.json`, and in from it.

use crate::run::{lumigraph, with_wall};
use image::{GrayImage, ImageBuffer, Luma};
use serde_json::Value;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

const SIZE: (u32, u32) = (96, 72);

/// Masks for the first photos of the wall that keep all from a column on.
fn save_masks(folder: &Path, count: u32, first_column: u32) {
    fs::create_dir_all(folder).unwrap();
    for i in 0..count {
        let kept = |x, _| Luma([if x < first_column { 0 } else { 255 }]);
        let mask = GrayImage::from_fn(SIZE.0, SIZE.1, kept);
        mask.save(folder.join(format!("{i:04}.png.png"))).unwrap();
    }
}

fn scene_json(folder: &TempDir, scene: &str) -> Value {
    let file = folder.path().join(scene).join("scene.json");
    serde_json::from_slice(&fs::read(file).unwrap()).unwrap()
}

/// A folder with the wall, masks and depth maps beside it, calibrated by a `transforms.json`, whose text is given, too.
fn wall_as_transforms() -> (TempDir, String) {
    let folder = with_wall();
    let run = |line: &str| lumigraph(folder.path(), line).ok();
    let wall = folder.path().join("wall");
    save_masks(&wall.join("masks"), 9, 16);
    run("import wall -o scene");
    let ran = run("export scene --format transforms -o wall/transforms.json");
    assert!(!ran.stderr.contains("note: "), "{}", ran.stderr);
    fs::remove_dir_all(wall.join("sparse")).unwrap();
    let text = fs::read_to_string(wall.join("transforms.json")).unwrap();
    (folder, text)
}

#[test]
fn what_a_transforms_file_names_beside_the_photos_is_used() {
    // 1. Out with all of them.
    let (folder, text) = wall_as_transforms();
    let here = folder.path();
    let at = |path: &str| here.join(path);
    let run = |line: &str| lumigraph(here, line).ok();
    let write = |text: &str| fs::write(at("wall/transforms.json"), text).unwrap();

    // 2. In from folders that are not looked into.
    fs::rename(at("wall/masks"), at("wall/msk")).unwrap();
    fs::rename(at("wall/depth"), at("wall/dpt")).unwrap();
    let text = text.replace("\"masks/", "\"msk/");
    let text = text.replace("\"depth/", "\"dpt/");
    write(&text);
    let ran = run("import wall -o back");
    let counts = ", 9 ignore masks, 9 depth maps\n";
    assert!(ran.stdout.ends_with(counts), "{}", ran.stdout);
    assert!(!ran.stderr.contains("transforms.json"), "{}", ran.stderr);
    let photo = scene_json(&folder, "back")["photos"][3].clone();
    assert_eq!(photo["ignore_mask"], "../wall/msk/0003.png.png");
    assert_eq!(photo["depth_map"], "../wall/dpt/0003.png");
    assert_eq!(photo["depth_scale"], 0.001);

    // 3. What is asked for goes first.
    let ran = run("import wall --no-masks --depth wall/dpt --depth-scale 0.25 -o asked");
    assert!(ran.stdout.ends_with(" points, 9 depth maps\n"));
    assert_eq!(
        scene_json(&folder, "asked")["photos"][3]["depth_scale"],
        0.25
    );
    run("import wall --mattes wall/msk -o cut");
    let photo = scene_json(&folder, "cut")["photos"][3].clone();
    assert_eq!(photo["object_matte"], "../wall/msk/0003.png.png");
    assert!(photo.get("ignore_mask").is_none(), "{photo}");

    // 4. Depths are in the units that the poses had before they were scaled.
    let applied = "\"applied_transform\"";
    write(&text.replace(applied, &format!("\"applied_scale\": 0.5, {applied}")));
    run("import wall -o scaled");
    assert_eq!(
        scene_json(&folder, "scaled")["photos"][3]["depth_scale"],
        0.0005
    );
}

#[test]
fn masks_and_depth_maps_among_the_photos_are_not_counted_as_such() {
    let (folder, mut text) = wall_as_transforms();
    let here = folder.path();
    let at = |path: &str| here.join(path);
    let run = |line: &str| lumigraph(here, line).ok();
    for (from, to) in [("images", "rgb"), ("masks", "msk"), ("depth", "dpt")] {
        fs::rename(at("wall").join(from), at("wall").join(to)).unwrap();
        text = text.replace(&format!("\"{from}/"), &format!("\"{to}/"));
    }
    fs::write(at("wall/transforms.json"), text).unwrap();
    let ran = run("import wall -o back");
    let counts = ", 9 ignore masks, 9 depth maps\n";
    assert!(ran.stdout.ends_with(counts), "{}", ran.stdout);
    assert!(
        !ran.stderr.contains("not in the calibration"),
        "{}",
        ran.stderr
    );

    fs::copy(at("wall/rgb/0003.png"), at("wall/rgb/more.png")).unwrap();
    let ran = run("import wall --no-masks -o more");
    let note =
        "note: 1 of 10 photos are not in the calibration and stay unused (rgb/more.png, for one)\n";
    assert!(ran.stderr.contains(note), "{}", ran.stderr);
}

#[test]
fn depth_maps_of_instant_ngp_are_read_in_its_scale() {
    let folder = with_wall();
    let here = folder.path();
    let at = |path: &str| here.join(path);
    let run = |line: &str| lumigraph(here, line).ok();
    run("export wall --format transforms -o wall/transforms.json");
    fs::remove_dir_all(at("wall/sparse")).unwrap();
    fs::rename(at("wall/depth"), at("wall/dpt")).unwrap();
    let text = fs::read_to_string(at("wall/transforms.json")).unwrap();
    let text = text.replace("depth_file_path", "depth_path");
    let text = text.replace("\"depth/", "\"dpt/");
    let frames = "\"frames\"";
    let scale_of = |more: &str, options: &str| {
        let text = text.replacen(frames, &format!("{more}{frames}"), 1);
        fs::write(at("wall/transforms.json"), text).unwrap();
        let ran = run(&format!("import wall {options}-o scene --force"));
        let scale = scene_json(&folder, "scene")["photos"][3]["depth_scale"].as_f64();
        (scale, ran.stderr)
    };
    let scaled = "\"integer_depth_scale\": 0.002, \"applied_scale\": 0.5, ";
    assert_eq!(scale_of(scaled, "").0, Some(0.002));
    for asked in [0.25, 0.001] {
        let (scale, _) = scale_of(scaled, &format!("--depth-scale {asked} "));
        assert_eq!(scale, Some(asked));
    }
    let note =
        "note: wall/transforms.json names 9 depth maps (depth_path) that are not used: it lacks";
    let (scale, said) = scale_of("", "");
    assert!(scale.is_none() && said.contains(note), "{said}");
    let off = format!("\"enable_depth_loading\": false, {scaled}");
    let (scale, said) = scale_of(&off, "");
    assert!(scale.is_none() && !said.contains("depth_path"), "{said}");
}

#[test]
fn what_a_transforms_file_names_and_cannot_be_used_is_told() {
    let folder = with_wall();
    let here = folder.path();
    let at = |path: &str| here.join(path);
    let run = |line: &str| lumigraph(here, line).ok();
    save_masks(&at("wall/masks"), 9, 16);
    run("export wall --format transforms -o wall/transforms.json");
    fs::remove_dir_all(at("wall/sparse")).unwrap();
    fs::rename(at("wall/masks"), at("wall/msk")).unwrap();
    fs::rename(at("wall/depth"), at("wall/dpt")).unwrap();
    let text = fs::read_to_string(at("wall/transforms.json")).unwrap();
    let text = text.replace("\"masks/", "\"msk/");
    let text = text.replace("\"depth/", "\"dpt/");
    let applied = "\"applied_transform\"";
    let text = text.replace(
        applied,
        &format!("\"ply_file_path\": \"points.ply\", {applied}"),
    );
    fs::write(at("wall/transforms.json"), text).unwrap();
    fs::write(at("wall/points.ply"), "ply\n").unwrap();
    fs::remove_file(at("wall/msk/0003.png.png")).unwrap();
    // Other programs make them fit.
    let small: ImageBuffer<Luma<u16>, Vec<u16>> = ImageBuffer::new(48, 36);
    small.save(at("wall/dpt/0004.png")).unwrap();
    let ran = run("import wall -o scene");
    let counts = ", 8 ignore masks, 8 depth maps\n";
    assert!(ran.stdout.ends_with(counts), "{}", ran.stdout);
    for note in [
        "note: wall/transforms.json names 1 ignore masks that are not there \
         (wall/msk/0003.png.png, for one); nothing is ignored in their photos\n",
        "note: wall/transforms.json names 1 depth maps that are not used, for one: \
         wall/dpt/0004.png: the depth map has 48 × 36 pixels and its photo 0004.png 96 × 72",
        "note: wall/transforms.json names the sparse points in wall/points.ply, which are not read",
    ] {
        assert!(ran.stderr.contains(note), "{}", ran.stderr);
    }

    // Of another size than their photos masks are an error, which says how to do without.
    let small = GrayImage::from_pixel(48, 36, Luma([255]));
    small.save(at("wall/msk/0005.png.png")).unwrap();
    let error = lumigraph(here, "import wall -o small").error(1);
    let told = "wall/msk/0005.png.png: the ignore mask has 48 × 36 pixels and its photo 0005.png \
                96 × 72; make it as large as the photo, or leave it out; `import --no-masks` does \
                without any";
    assert_eq!(error, told);
    let ran = run("import wall --no-masks -o unmasked");
    assert!(!ran.stdout.contains("ignore masks"), "{}", ran.stdout);

    // Silhouettes are taken for what they are, wherever they lie.
    save_masks(&at("wall/msk"), 9, 64);
    let ran = run("import wall -o object");
    assert!(ran.stderr.contains("--mattes msk cuts"), "{}", ran.stderr);
    assert!(!ran.stdout.contains("ignore masks"), "{}", ran.stdout);
}

#[test]
fn exports_say_what_they_leave_out() {
    let folder = with_wall();
    let here = folder.path();
    let export = |options: &str, format: &str| {
        let line = format!("import wall {options}-o scene --force");
        lumigraph(here, &line).ok();
        let line = format!("export scene --format {format} --force -o out/t");
        let ran = lumigraph(here, &line).ok();
        let text = fs::read_to_string(here.join("out/t")).unwrap_or_default();
        let notes = ran.stderr.lines().filter(|line| line.starts_with("note: "));
        (notes.collect::<Vec<_>>().join("\n"), text)
    };
    let no_place = "note: left out: 9 depth maps; the format has no place for them";
    assert_eq!(export("", "opencv").0, no_place);

    save_masks(&here.join("some"), 4, 16);
    let (notes, text) = export("--masks some ", "transforms");
    let partly =
        "note: 4 of 9 photos have an ignore mask; nerfstudio wants one for each or for none";
    assert_eq!(notes, partly);
    assert_eq!(text.matches("mask_path").count(), 4);
    assert_eq!(text.matches("depth_file_path").count(), 9);
    let (notes, _) = export("--mattes some ", "transforms");
    let mattes = "note: left out: 4 object mattes; the format has no place for them";
    assert_eq!(notes, mattes);

    let (notes, text) = export("--depth-scale 0.25 ", "transforms");
    let steps = "note: the depth maps are in steps of 0.25 world units, which the file cannot say: \
                 give nerfstudio-data --depth-unit-scale-factor 0.25, or --depth-scale 0.25 to \
                 `import`";
    assert_eq!(notes, steps);
    assert_eq!(text.matches("depth_file_path").count(), 9);

    fs::remove_file(here.join("wall/depth/0004.png")).unwrap();
    let (notes, text) = export("", "transforms");
    let fewer = "note: left out: 8 depth maps; nerfstudio wants one for each of the 9 photos, all in \
                 the same steps";
    assert_eq!(notes, fewer);
    assert!(!text.contains("depth_file_path"), "{text}");
}
