//! Calibrations of other programs, from file to picture.

use crate::run::{lumigraph, with_wall};
use calibrate::colmap;
use serde_json::{Value, json};
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
    let note = "for that in wall/transforms.json say --calibration wall/transforms.json";
    assert!(both.stderr.contains(note), "{}", both.stderr);

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
