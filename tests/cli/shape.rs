//! Sizes of another shape than the photos'.

use crate::run::{lumigraph, with_wall};
use image::imageops::crop_imm;

#[test]
fn a_frame_of_another_shape_is_the_middle_of_the_view() {
    let folder = with_wall();
    let here = folder.path();
    let line = "render wall --proxy plane --views wall/sparse/0 --size 72x72 -o out";
    let said = lumigraph(here, line).ok().stderr;
    let note = "note: 72x72 has another shape than views of 96x72: pictures show the middle 75 % of \
                their width, cut and not stretched; 72x54 shows all\n";
    assert_eq!(said.matches(note).count(), 1, "{said}");
    for name in ["0000.png", "0004.png"] {
        let open = |folder: &str| image::open(here.join(folder).join(name)).unwrap();
        let (frame, photo) = (open("out").into_rgba8(), open("wall/images").into_rgba8());
        let middle = crop_imm(&photo, 12, 0, 72, 72).to_image();
        let score = render::score::score(&frame, &middle).unwrap();
        assert!(score.psnr_covered.unwrap() >= 45.0, "{name}: {score:?}");
    }
    // Of the views' own shape nothing is said, and all is shown.
    let line = "render wall --proxy plane --path orbit --frames 1 --size 47x35 -o small";
    let said = lumigraph(here, line).ok().stderr;
    assert!(!said.contains("another shape"), "{said}");
}

#[test]
fn pictures_that_are_compared_keep_the_photos_shape() {
    let folder = with_wall();
    let here = folder.path();
    let line = "evaluate wall --proxy plane --json -o out --size";
    let square = lumigraph(here, &format!("{line} 72x72")).ok();
    let note = "note: 72x72 has another shape than photos of 96x72: pictures that are compared with \
                them have 72x54 pixels\n";
    assert_eq!(square.stderr.matches(note).count(), 1, "{}", square.stderr);
    let picture = image::open(here.join("out/0008.png")).unwrap();
    assert_eq!((picture.width(), picture.height()), (72, 54));
    let fitting = lumigraph(here, &format!("{line} 72x54")).ok();
    let psnr = |json: serde_json::Value| json["mean"]["psnr"].as_f64().unwrap();
    assert_eq!(psnr(square.json()), psnr(fitting.json()));
    assert!(!fitting.stderr.contains("another shape"));
}
