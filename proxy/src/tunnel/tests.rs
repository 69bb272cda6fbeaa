use super::*;
use calibrate::colmap::read_model;
use calibrate::{Reconstruction, View};
use std::path::PathBuf;

/// Views and points of a capture, or a loud `None`.
fn capture(name: &str) -> Option<(Vec<View>, Vec<DVec3>)> {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../shared/captures");
    let model = folder.join(name).join("sparse/0");
    if !model.is_dir() {
        eprintln!("SKIPPED: {} is absent", model.display());
        return None;
    }
    Some(views_and_points(&read_model(&model).unwrap()))
}

fn views_and_points(whole: &Reconstruction) -> (Vec<View>, Vec<DVec3>) {
    let view = |image: &calibrate::Image| {
        let camera = &whole.cameras[&image.camera_id];
        View {
            lens: camera.lens().unwrap(),
            width: camera.width,
            height: camera.height,
            camera_from_world: image.camera_from_world,
        }
    };
    let points = whole.points.values().map(|p| p.position);
    (whole.images.values().map(view).collect(), points.collect())
}

#[test]
fn show() {
    for name in [
        "corridor",
        "fern",
        "sceaux-castle",
        "south-building",
        "temple-ring",
        "lego",
        "office-walk",
        "desk-sweep",
        "can-orbit",
        "opencv-chessboard",
        "house-walk",
    ] {
        let Some((views, points)) = capture(name) else {
            continue;
        };
        let start = std::time::Instant::now();
        let tunnel = fit(&views, &points);
        println!("{name}: {:.2?}", start.elapsed());
        match tunnel {
            Ok(t) => {
                println!(
                    "   {:.3} x {:.3} x {:.3} share {:.3} on {:?} of {} hallway {}",
                    t.width(),
                    t.height(),
                    t.length(),
                    t.share_on_walls,
                    t.points_on,
                    t.points,
                    t.is_hallway()
                );
                if let Ok(folder) = std::env::var("DUMP") {
                    let mut text = String::new();
                    text += &format!(
                        "{} {} {} {} {} {} 0\n",
                        t.min.x, t.min.y, t.min.z, t.max.x, t.max.y, t.max.z
                    );
                    for v in &views {
                        let c = t.tunnel_from_world * v.center();
                        text += &format!("1 {} {} {} 0 0 0\n", c.x, c.y, c.z);
                    }
                    for p in &points {
                        let c = t.tunnel_from_world * *p;
                        text += &format!("2 {} {} {} {} 0 0\n", c.x, c.y, c.z, t.distance(*p));
                    }
                    std::fs::write(format!("{folder}/{name}.txt"), text).unwrap();
                }
            }
            Err(e) => println!("   {e}"),
        }
    }
}
