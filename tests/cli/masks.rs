//! Masks, mattes and depth maps beside the photos.

use crate::memory::{MASK, PHOTO};
use crate::run::{lumigraph, with_wall};
use image::{GrayImage, ImageBuffer, Luma, Rgba, RgbaImage};
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

pub(crate) const SIZE: (u32, u32) = (96, 72);

pub(crate) fn save(path: PathBuf, mask: &GrayImage) {
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    mask.save(path).unwrap();
}

/// Whether someone stands in a pixel of photo `i`.
pub(crate) fn someone(i: u32, x: u32, y: u32) -> bool {
    let left = 8 + (i * 37) % 60;
    (left..left + 16).contains(&x) && (20..60).contains(&y)
}

pub(crate) fn mask_of(i: u32) -> GrayImage {
    GrayImage::from_fn(SIZE.0, SIZE.1, |x, y| {
        Luma([if someone(i, x, y) { 0 } else { 255 }])
    })
}

/// The wall with someone in front of it in every photo.
fn with_crowd() -> TempDir {
    let folder = with_wall();
    for i in 0..9 {
        let path = folder.path().join(format!("wall/images/{i:04}.png"));
        let mut photo = image::open(&path).unwrap().into_rgb8();
        for (x, y, pixel) in photo.enumerate_pixels_mut() {
            if someone(i, x, y) {
                pixel.0 = [255, 0, 255];
            }
        }
        photo.save(path).unwrap();
    }
    folder
}

pub(crate) fn at(folder: &TempDir, path: &str) -> PathBuf {
    folder.path().join(path)
}

fn scene_json(folder: &TempDir) -> Value {
    serde_json::from_slice(&fs::read(at(folder, "scene/scene.json")).unwrap()).unwrap()
}

fn magenta(folder: &Path) -> usize {
    let entries = fs::read_dir(folder).unwrap();
    let frames = entries.map(|e| image::open(e.unwrap().path()).unwrap().into_rgba8());
    let is_magenta = |p: &Rgba<u8>| p.0[0] > 180 && p.0[1] < 90 && p.0[2] > 180 && p.0[3] > 0;
    frames
        .map(|f| f.pixels().filter(|p| is_magenta(p)).count())
        .sum()
}

#[test]
fn what_masks_cover_is_not_seen() {
    let folder = with_crowd();
    for i in 0..9 {
        save(
            at(&folder, &format!("wall/masks/{i:04}.png.png")),
            &mask_of(i),
        );
    }
    let ran = lumigraph(folder.path(), "import wall -o scene").ok();
    assert!(ran.stdout.contains("9 photos"), "{}", ran.stdout);
    assert!(
        ran.stdout.contains(", 9 ignore masks, 9 depth maps\n"),
        "{}",
        ran.stdout
    );
    assert_eq!(
        scene_json(&folder)["photos"][3]["ignore_mask"],
        "../wall/masks/0003.png.png"
    );
    lumigraph(folder.path(), "import wall --no-masks -o without").ok();

    let clean = lumigraph(with_wall().path(), "evaluate wall --proxy plane --json")
        .ok()
        .json();
    let clean = clean["mean"]["psnr"].as_f64().unwrap();
    for device in ["cpu", "reference"] {
        let evaluate = |scene: &str, out: &str| {
            let line = format!("evaluate {scene} --proxy plane --json --device {device} -o {out}");
            lumigraph(folder.path(), &line).ok().json()
        };
        let with = evaluate("scene", &format!("with-{device}"));
        let without = evaluate("without", &format!("without-{device}"));
        let [first, ..] = &with["photos"].as_array().unwrap()[..] else {
            panic!("{with}");
        };
        let keys: Vec<&str> = first
            .as_object()
            .unwrap()
            .keys()
            .map(String::as_str)
            .collect();
        let scores = [
            "psnr",
            "psnr_exposed",
            "ssim",
            "psnr_covered",
            "coverage",
            "coverage_points",
        ];
        let masked = ["psnr_masked", "ssim_masked", "coverage_masked"];
        assert_eq!(
            keys,
            [&["name"], &scores[..], &masked, &["seams", "cpu_ms"]].concat()
        );
        // Past the people all is as if there were none.
        let inside = with["mean"]["psnr_masked"].as_f64().unwrap();
        assert!(
            (inside - clean).abs() < 1.5,
            "{inside} dB, clean {clean} dB"
        );
        assert!(without["mean"].get("psnr_masked").is_none(), "{without}");
        assert!(with["mean"]["psnr"].as_f64() > without["mean"]["psnr"].as_f64());
        assert_eq!(magenta(&at(&folder, &format!("with-{device}"))), 0);
        assert!(magenta(&at(&folder, &format!("without-{device}"))) > 500);
    }
    let table = lumigraph(folder.path(), "evaluate scene --proxy plane")
        .ok()
        .stdout;
    let head = table.lines().next().unwrap();
    for key in ["psnr_masked", "ssim_masked", "coverage_masked"] {
        assert!(head.contains(key), "{table}");
    }
    let info = lumigraph(folder.path(), "info scene --json").ok().json();
    assert_eq!(info["ignore_masks"], 9);
    assert_eq!(info["object_mattes"], 0);
    assert_eq!(info["memory_bytes"], 9 * (PHOTO + MASK));
    let text = lumigraph(folder.path(), "info wall").ok().stdout;
    assert!(
        text.contains("\nwith     9 ignore masks, 9 depth maps\n"),
        "{text}"
    );
}

#[test]
fn masks_go_by_several_names_and_may_be_missing() {
    let folder = with_wall();
    for (i, name) in [
        "0000.png.png",
        "0001.PNG.PNG",
        "0002.png",
        "0003.png.PNG",
        "stray.png",
    ]
    .into_iter()
    .enumerate()
    {
        save(
            at(&folder, &format!("elsewhere/{name}")),
            &mask_of(i as u32),
        );
    }
    let ran = lumigraph(folder.path(), "import wall --masks elsewhere -o scene").ok();
    for note in [
        "note: elsewhere: 4 of 9 photos have their ignore mask here\n",
        "note: elsewhere: 1 files belong to no calibrated photo (stray.png, for one)\n",
    ] {
        assert!(ran.stderr.contains(note), "{}", ran.stderr);
    }
    let file = scene_json(&folder);
    let masks = (0..5).map(|i| file["photos"][i]["ignore_mask"].clone());
    assert_eq!(
        masks.collect::<Vec<_>>(),
        [
            json!("../elsewhere/0000.png.png"),
            json!("../elsewhere/0001.PNG.PNG"),
            json!("../elsewhere/0002.png"),
            json!("../elsewhere/0003.png.PNG"),
            Value::Null
        ]
    );
    lumigraph(folder.path(), "evaluate scene --proxy plane").ok();
}

#[test]
fn masks_may_be_jpegs_and_are_not_looked_for_in_alpha() {
    let folder = with_wall();
    for i in 0..9 {
        save(at(&folder, &format!("wall/masks/{i:04}.jpg")), &mask_of(i));
    }
    let ran = lumigraph(folder.path(), "import wall -o scene").ok();
    assert!(ran.stdout.contains(", 9 ignore masks"), "{}", ran.stdout);

    // Pictures in colour are none, nor is depth.
    for i in 0..9 {
        let photo = image::open(at(&folder, &format!("wall/images/{i:04}.png"))).unwrap();
        fs::remove_file(at(&folder, &format!("wall/depth/{i:04}.png"))).unwrap();
        for to in ["masks", "depth"] {
            let file = at(&folder, &format!("wall/{to}/{i:04}.jpg"));
            photo.to_rgb8().save(file).unwrap();
        }
    }
    let ran = lumigraph(folder.path(), "info wall").ok();
    for said in [
        "note: wall/masks: 9 of 9 photos have a file of their name here that is no ignore mask \
         (0000.png, for one): the JPEG files are not black and white: write PNG\n",
        "that is no depth map (0000.png, for one): depth does not fit into JPEG files: write 16-bit",
    ] {
        assert!(ran.stderr.contains(said), "{said}: {}", ran.stderr);
    }

    for i in 0..9 {
        let mask = mask_of(i);
        let mask = RgbaImage::from_fn(SIZE.0, SIZE.1, |x, y| {
            Rgba([255, 255, 255, mask.get_pixel(x, y).0[0]])
        });
        let file = at(&folder, &format!("people/{i:04}.png"));
        fs::create_dir_all(file.parent().unwrap()).unwrap();
        mask.save(file).unwrap();
    }
    let ran = lumigraph(folder.path(), "import wall --masks people -o again").ok();
    let said = "note: people/0000.png: an ignore mask of one colour all over, whose alpha channel";
    assert!(ran.stderr.contains(said), "{}", ran.stderr);
}

#[test]
fn mattes_cut_the_photos_out() {
    let folder = with_wall();
    // Everything but the left third is the object.
    for i in 0..9 {
        let matte = GrayImage::from_fn(SIZE.0, SIZE.1, |x, _| Luma([if x < 32 { 0 } else { 255 }]));
        save(at(&folder, &format!("wall/masks/{i:04}.png")), &matte);
    }
    lumigraph(folder.path(), "import wall --mattes masks -o scene").ok();
    let photo = scene_json(&folder)["photos"][2].clone();
    assert_eq!(photo["object_matte"], "../wall/masks/0002.png");
    assert!(photo.get("ignore_mask").is_none(), "{photo}");
    let result = lumigraph(
        folder.path(),
        "evaluate scene --proxy plane --json -o frames",
    )
    .ok()
    .json();
    // Outside the matte the held-out photo is black, and so is most of what is drawn there.
    let coverage = result["mean"]["coverage"].as_f64().unwrap();
    assert!((0.4..0.9).contains(&coverage), "{result}");
    assert!(
        result["mean"]["coverage_masked"].as_f64().unwrap() > 0.8,
        "{result}"
    );
    let frame = image::open(at(&folder, "frames/0008.png"))
        .unwrap()
        .into_rgba8();
    assert!(frame.pixels().any(|p| p.0[3] == 0) && frame.pixels().any(|p| p.0[3] == 255));

    // Both kinds, each from its own folder.
    for i in 0..9 {
        save(at(&folder, &format!("people/{i:04}.png")), &mask_of(i));
    }
    let line = "import wall --mattes masks --masks people -o both";
    let ran = lumigraph(folder.path(), line).ok();
    let counts = ", 9 ignore masks, 9 object mattes, 9 depth maps\n";
    assert!(ran.stdout.ends_with(counts), "{}", ran.stdout);
    lumigraph(folder.path(), "evaluate both --proxy plane").ok();
}

#[test]
fn depth_maps_are_recorded_with_their_scale() {
    let folder = with_wall();
    let ran = lumigraph(folder.path(), "import wall -o scene").ok();
    assert!(!ran.stderr.contains("--depth-scale"), "{}", ran.stderr);
    let photo = scene_json(&folder)["photos"][1].clone();
    assert_eq!(photo["depth_map"], "../wall/depth/0001.png");
    assert_eq!(photo["depth_scale"], 0.001);
    let line = "import wall --depth wall/depth --depth-scale 0.25 -o scene --force";
    let ran = lumigraph(folder.path(), line).ok();
    assert_eq!(scene_json(&folder)["photos"][1]["depth_scale"], 0.25);
    let note = "250 times those of the sparse points";
    assert!(ran.stderr.contains(note), "{}", ran.stderr);
    let remedy = "--depth-scale 0.001 makes them agree";
    assert!(ran.stderr.contains(remedy), "{}", ran.stderr);

    // Bytes are no depths.
    save(at(&folder, "wall/depth/0001.png"), &mask_of(1));
    let asked = "import wall --depth wall/depth -o other";
    assert_eq!(
        lumigraph(folder.path(), asked).error(1),
        "wall/depth/0001.png: found 1 channels of 8 bits, expected a depth map of one channel of \
         16 bits; write depths as 16-bit grey PNG, or leave it out; `import --no-depth` does without any"
    );
    let small: ImageBuffer<Luma<u16>, Vec<u16>> = ImageBuffer::new(48, 36);
    small.save(at(&folder, "wall/depth/0001.png")).unwrap();
    let error = lumigraph(folder.path(), asked).error(1);
    assert!(
        error.contains("the depth map has 48 × 36 pixels and its photo 0001.png"),
        "{error}"
    );
}
