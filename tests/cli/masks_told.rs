//! What is said of masks and mattes that hide all, do not fit, or are meant as something else.

use crate::masks::{SIZE, at, mask_of, save, someone};
use crate::run::{lumigraph, with_wall};
use image::{GrayImage, Luma, RgbaImage};
use std::fs;

#[test]
fn masks_that_hide_everything_are_told_and_what_is_empty_for_them() {
    let folder = with_wall();
    for i in 0..9 {
        save(
            at(&folder, &format!("none/{i:04}.png")),
            &GrayImage::new(SIZE.0, SIZE.1),
        );
    }
    let ran = lumigraph(folder.path(), "import wall --masks none -o scene").ok();
    let said = "note: the ignore masks of 9 photos leave nothing of them, as far as some of them tell (0000.png, \
                for one); they are to be 0 where";
    assert!(ran.stderr.contains(said), "{}", ran.stderr);
    // The proxy is there.
    let render = "render scene --proxy plane --path orbit --frames 1 --size 32x24 -o out";
    let why = "show nothing: no photo shows what they see of the proxy: it lies outside all photos, or masks, ";
    for line in [render, "evaluate scene --proxy plane --size 32x24"] {
        let ran = lumigraph(folder.path(), line).ok();
        assert!(ran.stderr.contains(why), "{}", ran.stderr);
    }

    // Nothing that is drawn in place of nothing is no good picture.
    let ran = lumigraph(folder.path(), "import wall --mattes none -o cut").ok();
    let said = "note: the mattes or alpha channels of 9 photos leave nothing of them";
    assert!(ran.stderr.contains(said), "{}", ran.stderr);
    let evaluate = "evaluate cut --proxy plane --size 32x24";
    let table = lumigraph(folder.path(), evaluate).ok().stdout;
    assert!(!table.contains("99.00"), "{table}");
    let json = lumigraph(folder.path(), &format!("{evaluate} --json"))
        .ok()
        .json();
    for scores in [&json["mean"], &json["photos"][0]] {
        assert!(
            scores["psnr"].is_null() && scores["ssim"].is_null(),
            "{scores}"
        );
        assert_eq!(scores["coverage"], 0.0, "{scores}");
    }
    // Some that do are no mistake.
    save(at(&folder, "none/0004.png"), &mask_of(4));
    let ran = lumigraph(folder.path(), "import wall --masks none -o some").ok();
    assert!(!ran.stderr.contains("leave nothing"), "{}", ran.stderr);
}

#[test]
fn masks_and_depth_maps_of_kinds_that_are_not_read_are_told() {
    let folder = with_wall();
    fs::remove_dir_all(at(&folder, "wall/depth")).unwrap();
    let write = |name: String| {
        let file = at(&folder, &name);
        fs::create_dir_all(file.parent().unwrap()).unwrap();
        fs::write(file, "of another program").unwrap();
    };
    for i in 0..9 {
        write(format!("wall/masks/{i:04}.png.bmp"));
        write(format!("wall/depth/{i:04}.EXR"));
    }
    // What belongs to no photo, or is hidden, is none's.
    write("wall/depth/list.txt".to_owned());
    write("wall/depth/.0000.txt".to_owned());
    let of_masks = "9 of 9 photos have a file of their name here that is no ignore mask (0000.png.bmp, for one): \
                    only PNG is read, and JPEG in black and white: convert them";
    let of_depth = "9 of 9 photos have a file of their name here that is no depth map (0000.EXR, for one): only \
                    16-bit grey PNG is read: write depths so";
    let ran = lumigraph(folder.path(), "info wall").ok();
    let notes: Vec<&str> = ran.stderr.lines().collect();
    assert_eq!(
        notes,
        [
            format!("note: wall/masks: {of_masks}"),
            format!("note: wall/depth: {of_depth}")
        ]
    );
    // Of folders that were asked for it is the error.
    for (option, kind, said) in [
        ("--masks wall/masks", "ignore mask", of_masks),
        ("--depth wall/depth", "depth map", of_depth),
    ] {
        let (_, place) = option.split_once(' ').unwrap();
        let error = lumigraph(folder.path(), &format!("import wall {option} -o s")).error(1);
        let expected = format!(
            "{place}: no {kind} for any photo here; that of 0000.png would be called 0000.png.png, or so \
             without its own extension; {said}"
        );
        assert_eq!(error, expected);
    }
    fs::create_dir(at(&folder, "bare")).unwrap();
    let error = lumigraph(folder.path(), "import wall --mattes bare -o s").error(1);
    assert!(
        error.starts_with("bare: no object matte for any photo here; "),
        "{error}"
    );

    // Where some photos have a mask, what others have in its place.
    for i in 0..7 {
        save(
            at(&folder, &format!("wall/masks/{i:04}.png.png")),
            &mask_of(i),
        );
    }
    let ran = lumigraph(folder.path(), "info wall").ok();
    for said in [
        "note: wall/masks: 7 of 9 photos have their ignore mask here\n",
        "note: wall/masks: 2 of 9 photos have a file of their name here that is no ignore mask (0007.png.bmp, \
         for one)",
    ] {
        assert!(ran.stderr.contains(said), "{said}: {}", ran.stderr);
    }
}

#[test]
fn masks_that_do_not_fit_or_cannot_be_read_are_errors() {
    let folder = with_wall();
    let mask = at(&folder, "wall/masks/0003.png.png");
    save(mask.clone(), &GrayImage::new(72, 96));
    for line in [
        "import wall -o out",
        "info wall",
        "render wall --proxy plane --path orbit -o out",
    ] {
        assert_eq!(
            lumigraph(folder.path(), line).error(1),
            "wall/masks/0003.png.png: the ignore mask has 72 × 96 pixels and its photo 0003.png \
             96 × 72; make it as large as the photo, or leave it out; `import --no-masks` does \
             without any"
        );
    }
    for (bytes, problem) in [
        (&b"not a picture"[..], "found no picture format known here"),
        (b"", "the file is empty (0 bytes)"),
        (
            b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR",
            "cannot decode wall/masks/0003.png.png",
        ),
    ] {
        fs::write(&mask, bytes).unwrap();
        let error = lumigraph(folder.path(), "import wall -o out").error(1);
        assert!(error.contains("wall/masks/0003.png.png"), "{error}");
        assert!(error.contains(problem), "{error}");
        assert!(!at(&folder, "out").exists());
    }
    lumigraph(folder.path(), "import wall --no-masks -o scene").ok();

    // Damage that only decoding shows: the photo cannot be used.
    save(mask.clone(), &mask_of(3));
    let whole = fs::read(&mask).unwrap();
    fs::write(&mask, &whole[..whole.len() / 2]).unwrap();
    let ran = lumigraph(folder.path(), "evaluate wall --proxy plane").ok();
    let warning = "warning: photo 0003.png is left out: cannot decode wall/masks/0003.png.png";
    assert!(ran.stderr.contains(warning), "{}", ran.stderr);
    let error = lumigraph(folder.path(), "evaluate wall --proxy plane --strict").error(1);
    assert!(error.contains("wall/masks/0003.png.png"), "{error}");
    let line = "field wall --proxy plane --view 0004.png --without-view -o f.png";
    let error = lumigraph(folder.path(), line).error(1);
    assert!(error.contains("wall/masks/0003.png.png"), "{error}");
}

#[test]
fn masks_that_repeat_the_alpha_are_pointed_out() {
    let folder = with_wall();
    for i in 0..9 {
        let path = at(&folder, &format!("wall/images/{i:04}.png"));
        let mut photo: RgbaImage = image::open(&path).unwrap().into_rgba8();
        let mask = mask_of(i);
        for (pixel, mask) in photo.pixels_mut().zip(mask.pixels()) {
            pixel.0[3] = mask.0[0];
        }
        photo.save(path).unwrap();
        save(at(&folder, &format!("wall/masks/{i:04}.png.png")), &mask);
    }
    let note = "the ignore masks repeat the photos' alpha (0000.png, for one)";
    let ran = lumigraph(folder.path(), "import wall -o a").ok();
    assert!(ran.stderr.contains(note), "{}", ran.stderr);
    let ran = lumigraph(folder.path(), "import wall --mattes masks -o b").ok();
    assert!(!ran.stderr.contains(note), "{}", ran.stderr);
    // A matte that repeats the alpha changes nothing.
    lumigraph(folder.path(), "import wall --no-masks -o c").ok();
    let ran = lumigraph(folder.path(), "import wall --masks masks -o d").ok();
    assert!(ran.stderr.contains(note), "{}", ran.stderr);
    assert!(ran.stdout.contains("9 ignore masks"), "{}", ran.stdout);
    let evaluated = |scene: &str| {
        let line = format!("evaluate {scene} --proxy plane --json");
        lumigraph(folder.path(), &line).ok().json()["mean"]["psnr"].clone()
    };
    assert_eq!(evaluated("b"), evaluated("c"));
    // Nobody asked for the masks: they were left out.
    assert_eq!(evaluated("a"), evaluated("c"));
}

#[test]
fn silhouettes_are_no_ignore_masks_unless_asked_for() {
    let folder = with_wall();
    for i in 0..9 {
        let object =
            GrayImage::from_fn(SIZE.0, SIZE.1, |x, _| Luma([if x < 40 { 255 } else { 0 }]));
        save(at(&folder, &format!("wall/masks/{i:04}.png")), &object);
    }
    let whose = "; --mattes and --masks are options of `lumigraph import wall -o SCENE`\n";
    for line in ["info wall", "proxy wall plane -o plane.json"] {
        let ran = lumigraph(folder.path(), line).ok();
        let note = format!("--masks masks ignores all else{whose}");
        assert!(ran.stderr.contains(&note), "{line}: {}", ran.stderr);
    }
    let ran = lumigraph(folder.path(), "import wall -o a").ok();
    assert!(ran.stderr.contains("--mattes masks cuts"), "{}", ran.stderr);
    assert!(!ran.stderr.contains(whose), "{}", ran.stderr);
    assert!(!ran.stdout.contains("ignore masks"), "{}", ran.stdout);
    let ran = lumigraph(folder.path(), "import wall --masks masks -o b").ok();
    assert!(!ran.stderr.contains("--mattes"), "{}", ran.stderr);
    assert!(ran.stdout.contains("9 ignore masks"), "{}", ran.stdout);
}

#[test]
fn masks_whose_values_are_labels_are_told() {
    let folder = with_wall();
    let label = |is_used: &dyn Fn(u32, u32, u32) -> bool| {
        for i in 0..9 {
            let mask = GrayImage::from_fn(SIZE.0, SIZE.1, |x, y| {
                Luma([if is_used(i, x, y) { 3 } else { 0 }])
            });
            save(at(&folder, &format!("wall/masks/{i:04}.png")), &mask);
        }
    };
    let note = "note: wall/masks/0000.png: the greatest value of the ignore mask is 3, of 255 for what is used: ";
    let silhouettes = "--mattes masks cuts";

    // What is not 0 is most of each photo.
    label(&|i, x, y| !someone(i, x, y));
    for masks in ["", " --masks wall/masks"] {
        let ran = lumigraph(
            folder.path(),
            &format!("import wall{masks} -o scene --force"),
        )
        .ok();
        assert_eq!(ran.stderr.matches(note).count(), 1, "{}", ran.stderr);
        assert!(!ran.stderr.contains(silhouettes), "{}", ran.stderr);
        assert!(ran.stdout.contains(", 9 ignore masks"), "{}", ran.stdout);
    }
    // Or less than half.
    label(&|_, x, _| x < 40);
    let ran = lumigraph(folder.path(), "info wall").ok();
    for said in [note, silhouettes] {
        assert!(ran.stderr.contains(said), "{}", ran.stderr);
    }
    // One that is ignored all over has no labels.
    label(&|_, _, _| false);
    let ran = lumigraph(
        folder.path(),
        "import wall --masks wall/masks -o scene --force",
    )
    .ok();
    assert!(!ran.stderr.contains("greatest"), "{}", ran.stderr);
}

#[test]
fn what_is_asked_for_must_make_sense() {
    let folder = with_wall();
    let code = |line: &str| lumigraph(folder.path(), line).code;
    assert_eq!(code("import wall --masks wall/depth --no-masks -o s"), 2);
    assert_eq!(code("import wall --depth-scale 0 -o s"), 2);
    let error = lumigraph(folder.path(), "import wall --mattes nowhere -o s").error(1);
    assert_eq!(error, "nowhere: there is no such folder; check the path");
    save(at(&folder, "stray/other.png"), &mask_of(0));
    assert_eq!(
        lumigraph(folder.path(), "import wall --masks stray -o s").error(1),
        "stray: no ignore mask for any photo here; that of 0000.png would be called \
         0000.png.png, or so without its own extension"
    );
}
