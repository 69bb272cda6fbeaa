//! What ignore masks hide of photos with depth maps is neither surface nor colour.

use crate::run::{lumigraph, with_wall};
use calibrate::colmap;
use glam::DVec3;
use image::{GrayImage, Luma};
use proxy::mesh::read_model;
use std::fs;
use std::path::Path;

/// Whether a row of every photo shows what is to be ignored: the first few lie on the wall by their
/// depth, the last ones far before it.
fn is_hidden(row: u32) -> bool {
    row < 8 || is_near(row)
}

fn is_near(row: u32) -> bool {
    row >= 48
}

/// Paints over what is to be ignored, moves some of it towards the cameras, and masks it.
fn hide_rows(wall: &Path) {
    fs::create_dir(wall.join("masks")).unwrap();
    for i in 0..9 {
        let path = wall.join(format!("images/{i:04}.png"));
        let mut photo = image::open(&path).unwrap().into_rgb8();
        let (width, height) = photo.dimensions();
        for (_, y, pixel) in photo.enumerate_pixels_mut() {
            if is_hidden(y) {
                pixel.0 = [255, 0, 255];
            }
        }
        photo.save(path).unwrap();
        let path = wall.join(format!("depth/{i:04}.png"));
        let mut depth = image::open(&path).unwrap().into_luma16();
        let near = depth.pixels().map(|p| p.0[0]).min().unwrap() / 2;
        for (_, y, pixel) in depth.enumerate_pixels_mut() {
            if is_near(y) {
                pixel.0 = [near];
            }
        }
        depth.save(path).unwrap();
        let used = |_: u32, y: u32| Luma([if is_hidden(y) { 0_u8 } else { 255 }]);
        let mask = GrayImage::from_fn(width, height, used);
        mask.save(wall.join(format!("masks/{i:04}.png.png")))
            .unwrap();
    }
}

#[test]
fn what_masks_hide_is_neither_surface_nor_colour() {
    let folder = with_wall();
    let here = folder.path();
    let rooms = r#"{"version": 1,
        "rooms": [{"name": "all", "min": [-99, -99, -99], "max": [99, 99, 99]}]}"#;
    fs::write(here.join("rooms.json"), rooms).unwrap();
    let reconstruction = colmap::read_model(&here.join("wall/sparse/0")).unwrap();
    let images = reconstruction.images.values();
    let centers: Vec<DVec3> = images.map(|i| i.camera_from_world.center()).collect();
    // How much of a model is painted over, and how near to a camera it comes.
    let made = |scene: &str| -> (f64, f64) {
        let out = format!("made-{scene}");
        lumigraph(
            here,
            &format!("interior {scene} --rooms rooms.json -o {out}"),
        )
        .ok();
        let (model, _) = read_model(&here.join(out).join("model.glb")).unwrap();
        let is_painted_over = |c: &&[u8; 4]| c[0] > 180 && c[1] < 90 && c[2] > 180;
        let painted_over = model.colors.iter().filter(is_painted_over).count();
        let positions = model.mesh.positions.iter();
        let distances = positions.flat_map(|p| centers.iter().map(move |c| c.distance(*p)));
        let nearest = distances.fold(f64::INFINITY, f64::min);
        (painted_over as f64 / model.colors.len() as f64, nearest)
    };
    let (_, wall) = made("wall");
    hide_rows(&here.join("wall"));
    lumigraph(here, "import wall --no-masks -o without").ok();
    let (painted_over, nearest) = made("without");
    assert!(painted_over > 0.1, "{painted_over}");
    assert!(nearest < 0.5 * wall, "{nearest} of {wall}");
    // The same photos with their masks: the wall alone.
    fs::rename(here.join("wall"), here.join("masked")).unwrap();
    let (painted_over, nearest) = made("masked");
    assert_eq!(painted_over, 0.0);
    assert!(nearest > 0.95 * wall, "{nearest} of {wall}");
}
