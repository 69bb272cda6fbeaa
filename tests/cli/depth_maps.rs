//! Depth maps that a capture has and that are not as they should be.

use crate::run::{lumigraph, with_wall};
use image::{GrayImage, ImageBuffer, Luma};
use serde_json::Value;
use std::fs;
use std::ops::Range;
use std::path::Path;

type Steps = ImageBuffer<Luma<u16>, Vec<u16>>;

/// Puts a map of half the photos' size in a file's place.
fn halve(file: &Path) {
    Steps::new(48, 36).save(file).unwrap();
}

fn scene_json(folder: &Path, scene: &str) -> Value {
    serde_json::from_slice(&fs::read(folder.join(scene).join("scene.json")).unwrap()).unwrap()
}

#[test]
fn damaged_maps_that_nobody_named_leave_no_photo_out() {
    let folder = with_wall();
    let here = folder.path();
    let map = here.join("wall/depth/0003.png");
    let whole = fs::read(&map).unwrap();
    fs::write(&map, &whole[..whole.len() / 2]).unwrap();
    let ran = lumigraph(here, "import wall --undistort -o scene").ok();
    let note = "note: 1 of 9 depth maps are not used, for one: cannot decode ";
    let is_told = ran.stderr.contains(note) && ran.stderr.contains("wall/depth/0003.png");
    assert!(is_told, "{}", ran.stderr);
    assert!(!ran.stderr.contains("left out"), "{}", ran.stderr);
    assert!(ran.stdout.contains(": 9 photos, "), "{}", ran.stdout);
    assert!(ran.stdout.ends_with(", 8 depth maps\n"), "{}", ran.stdout);
    let photo = scene_json(here, "scene")["photos"][3].clone();
    assert_eq!(photo["name"], "0003.png");
    assert!(photo.get("depth_map").is_none(), "{photo}");
    assert!(photo.get("depth_scale").is_none(), "{photo}");
    assert!(!here.join("scene/depth/0003.png.png").exists());
    for option in ["--strict", "--depth wall/depth"] {
        let line = format!("import wall --undistort {option} -o none");
        let error = lumigraph(here, &line).error(1);
        assert!(error.contains("wall/depth/0003.png"), "{error}");
        assert!(!here.join("none").exists());
    }
}

#[test]
fn maps_of_another_size_that_nobody_named_are_passed_over() {
    let folder = with_wall();
    let here = folder.path();
    let run = |line: &str| lumigraph(here, line).ok();
    run("import wall -o before");
    halve(&here.join("wall/depth/0003.png"));
    let reason = "wall/depth/0003.png: the depth map has 48 × 36 pixels and its photo 0003.png 96 × 72; make \
                  it as large as the photo, or leave it out";
    let note = format!(
        "note: wall/depth: 1 of 9 depth maps are not used, for one: {reason}; --no-depth leaves all of them out"
    );
    let whose = "; --no-depth is an option of `lumigraph import wall -o SCENE`\n";

    // 1. Others are used.
    let ran = run("import wall -o scene");
    assert!(ran.stderr.contains(&format!("{note}\n")), "{}", ran.stderr);
    assert!(ran.stdout.ends_with(", 8 depth maps\n"), "{}", ran.stdout);
    let photo = scene_json(here, "scene")["photos"][3].clone();
    assert!(photo.get("depth_map").is_none(), "{photo}");
    assert!(photo.get("depth_scale").is_none(), "{photo}");

    // 2. None ends what does without.
    let ran = run("evaluate wall --proxy plane --size 24x18");
    let said = format!("{note}{whose}");
    assert!(ran.stderr.contains(&said), "{}", ran.stderr);
    for i in 0..9 {
        // Not so, either.
        fs::write(here.join(format!("wall/depth/{i:04}.png")), "no picture").unwrap();
    }
    let ran = run("info wall");
    let said = "note: wall/depth: 9 of 9 depth maps are not used, for one: wall/depth/0000.png: ";
    assert!(ran.stderr.contains(said), "{}", ran.stderr);
    assert!(!ran.stdout.contains("depth maps"), "{}", ran.stdout);

    // 3. What is asked for, or named by a scene, is an error.
    halve(&here.join("wall/depth/0000.png"));
    let remedy = "or leave it out; `import --no-depth` does without any";
    for line in ["import wall --depth wall/depth -o asked", "info before"] {
        let error = lumigraph(here, line).error(1);
        assert!(
            error.contains("wall/depth/0000.png: the depth map has 48"),
            "{error}"
        );
        assert!(error.ends_with(remedy), "{error}");
    }

    // 4. Nor is anything said where they are not wanted.
    let ran = run("import wall --no-depth -o without");
    assert!(!ran.stderr.contains("depth"), "{}", ran.stderr);
    assert!(!ran.stdout.contains("depth"), "{}", ran.stdout);
    for option in ["--depth wall/depth", "--depth-scale 2"] {
        let ran = lumigraph(here, &format!("import wall --no-depth {option} -o s"));
        assert_eq!(ran.code, 2, "{}", ran.stderr);
    }
}

#[test]
fn maps_that_a_transforms_file_names_as_well_are_told_once() {
    let folder = with_wall();
    let here = folder.path();
    let run = |line: &str| lumigraph(here, line).ok();
    run("export wall --format transforms -o wall/transforms.json");
    fs::remove_dir_all(here.join("wall/sparse")).unwrap();
    let kept = fs::read(here.join("wall/depth/0004.png")).unwrap();
    halve(&here.join("wall/depth/0004.png"));
    let ran = run("import wall -o scene");
    let told = ran.stderr.matches("depth maps are not used").count();
    let named = ran.stderr.contains("depth maps that are not used");
    assert_eq!((told, named), (1, false), "{}", ran.stderr);
    assert!(ran.stdout.ends_with(", 8 depth maps\n"), "{}", ran.stdout);
    let ran = run("import wall --no-depth -o without");
    assert!(!ran.stdout.contains("depth"), "{}", ran.stdout);

    // One that it names elsewhere takes its place.
    fs::write(here.join("wall/whole.png"), kept).unwrap();
    let file = here.join("wall/transforms.json");
    let text = fs::read_to_string(&file).unwrap();
    assert!(text.contains("\"depth/0004.png\""), "{text}");
    fs::write(&file, text.replace("\"depth/0004.png\"", "\"whole.png\"")).unwrap();
    let ran = run("import wall -o again");
    assert!(ran.stdout.ends_with(", 9 depth maps\n"), "{}", ran.stdout);
    let photo = scene_json(here, "again")["photos"][4].clone();
    assert_eq!(photo["depth_map"], "../wall/whole.png");
}

#[test]
fn a_scale_of_no_maps_is_told() {
    let folder = with_wall();
    let here = folder.path();
    let note = "note: --depth-scale changes nothing: no photo has a depth map\n";
    let said = |options: &str| {
        let line = format!("import wall{options} --force -o scene");
        lumigraph(here, &line).ok().stderr
    };
    assert!(!said(" --depth-scale 0.01").contains(note));
    fs::remove_dir_all(here.join("wall/depth")).unwrap();
    assert!(!said("").contains(note));
    let said = said(" --depth-scale 0.01");
    assert!(said.contains(note), "{said}");
}

#[test]
fn maps_whose_largest_value_may_mean_none_are_told_once() {
    let folder = with_wall();
    let here = folder.path();
    let fill = |photos: Range<u32>, columns: u32| {
        for i in photos {
            let file = here.join(format!("wall/depth/{i:04}.png"));
            let mut map: Steps = image::open(&file).unwrap().into_luma16();
            for (x, _, pixel) in map.enumerate_pixels_mut() {
                if x < columns {
                    pixel.0 = [u16::MAX];
                }
            }
            map.save(file).unwrap();
        }
    };
    let said = "% of the depth map's pixels are 65535";
    // Two of 96 columns may be far away.
    fill(0..9, 2);
    let ran = lumigraph(here, "import wall -o scene").ok();
    assert!(!ran.stderr.contains(said), "{}", ran.stderr);

    // The first, the fourth and the seventh are looked at.
    fill(2..9, 8);
    let ran = lumigraph(here, "import wall -o scene --force").ok();
    let note = format!(
        "note: wall/depth/0003.png: more than 3 {said}, the largest value of 16 bits, as in 2 of 3 depth maps \
         looked at, of 9: it counts as a depth of 65.535 world units; where the depth is unknown write 0\n"
    );
    assert!(ran.stderr.contains(&note), "{}", ran.stderr);
    assert_eq!(ran.stderr.matches(said).count(), 1, "{}", ran.stderr);
    assert!(ran.stdout.ends_with(", 9 depth maps\n"), "{}", ran.stdout);
    let line = "import wall --depth-scale 0.002 -o scene --force";
    let ran = lumigraph(here, line).ok();
    assert!(
        ran.stderr.contains("a depth of 131.07 world units"),
        "{}",
        ran.stderr
    );

    // Where ignored, it is no depth.
    fs::create_dir(here.join("wall/masks")).unwrap();
    let used = |x: u32, _: u32| Luma([if x < 8 { 0_u8 } else { 255 }]);
    for i in 0..9 {
        let file = here.join(format!("wall/masks/{i:04}.png"));
        GrayImage::from_fn(96, 72, used).save(file).unwrap();
    }
    let ran = lumigraph(here, "import wall -o scene --force").ok();
    assert!(!ran.stderr.contains(said), "{}", ran.stderr);
}
