//! Calibrations by OpenCV, from file to picture.

use crate::run::{Ran, lumigraph, run};
use calibrate::colmap;
use calibrate::{Distortion, Lens, View};
use datasets::Options;
use glam::{DVec2, DVec3};
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

fn chessboard() -> Option<PathBuf> {
    let folder = Path::new(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../shared/captures/opencv-chessboard"
    ));
    if !folder.is_dir() {
        eprintln!("SKIPPED: {} is not there", folder.display());
        return None;
    }
    Some(folder.canonicalize().unwrap())
}

/// A folder with `capture`: the photos, their list and OpenCV's file, without COLMAP's.
fn with_chessboard(source: &Path) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let capture = folder.path().join("capture");
    fs::create_dir_all(capture.join("images")).unwrap();
    for entry in fs::read_dir(source.join("images")).unwrap() {
        let entry = entry.unwrap();
        fs::copy(entry.path(), capture.join("images").join(entry.file_name())).unwrap();
    }
    for file in ["out_camera_data.yml", "images.yml", "split.json"] {
        fs::copy(source.join(file), capture.join(file)).unwrap();
    }
    folder
}

fn import(folder: &TempDir, line: &str) -> Ran {
    lumigraph(folder.path(), &format!("import {line} -o scene"))
}

/// Between the outermost of the board's 9 × 6 corners, 0.025 apart.
const INNER: (f64, f64) = (8.0 * 0.025, 5.0 * 0.025);

/// Where a pixel's ray meets the board's plane, z = 0.
fn on_plane(view: &View, column: u32, row: u32) -> Option<glam::DVec3> {
    let ray = view
        .lens
        .unproject(calibrate::Pixel::center_of(column, row))?;
    let world_from_camera = view.camera_from_world.inverse();
    let direction = world_from_camera.rotation * ray;
    let center = view.center();
    Some(center - direction * (center.z / direction.z))
}

/// PSNR over the pixels between the board's outer corners, and how many there are.
fn psnr_inside(view: &View, frame: &Path, photo: &Path) -> (f64, usize) {
    let frame = image::open(frame).unwrap().to_rgba8();
    let photo = image::open(photo).unwrap().to_rgba8();
    let (mut squares, mut count) = (0.0, 0);
    for (column, row, pixel) in photo.enumerate_pixels() {
        let Some(p) = on_plane(view, column, row) else {
            continue;
        };
        if !((0.0..=INNER.0).contains(&p.x) && (0.0..=INNER.1).contains(&p.y)) {
            continue;
        }
        let drawn = frame.get_pixel(column, row);
        assert_eq!(drawn[3], 255, "the board is covered at {column}, {row}");
        count += 1;
        for channel in 0..3 {
            let off = f64::from(drawn[channel]) - f64::from(pixel[channel]);
            squares += off * off / 3.0;
        }
    }
    (
        10.0 * (255.0_f64.powi(2) * count as f64 / squares).log10(),
        count,
    )
}

#[test]
fn held_out_views_match_inside_the_board() {
    let Some(source) = chessboard() else { return };
    let folder = with_chessboard(&source);
    let line = "capture/images --calibration capture/out_camera_data.yml";
    let ran = import(&folder, line).ok();
    assert_eq!(ran.stdout, "scene: 13 photos, 54 points\n");
    assert!(
        ran.stderr
            .contains("note: the order of the photos is from images.yml"),
        "{}",
        ran.stderr
    );

    // The same cameras as COLMAP's model of the set says.
    let ours = colmap::read_model(&folder.path().join("scene/model")).unwrap();
    let theirs = colmap::read_model(&source.join("sparse/0")).unwrap();
    let params = |model: &calibrate::Reconstruction| {
        let camera = model.cameras.values().next().unwrap();
        (
            camera.model,
            camera.width,
            camera.height,
            camera.params.clone(),
        )
    };
    let (a, b) = (params(&ours), params(&theirs));
    assert_eq!((a.0, a.1, a.2), (b.0, b.1, b.2));
    assert!(a.3.iter().zip(&b.3).all(|(x, y)| (x - y).abs() < 1e-9));
    let info = lumigraph(folder.path(), "info scene --json").ok().json();
    let error = info["cameras"][0]["reprojection_px"]["mean"]
        .as_f64()
        .unwrap();
    assert!((error - 0.175).abs() < 0.01, "{error}");

    // Held-out views over the board's plane.
    let plane = "proxy scene plane --point 0,0,0 --normal 0,0,1";
    lumigraph(folder.path(), plane).ok();
    let split = "capture/split.json";
    let line = format!("evaluate scene --hold-out {split} --json -o frames");
    let result = lumigraph(folder.path(), &line).ok().json();
    let photos = result["photos"].as_array().unwrap();
    assert_eq!(photos.len(), 2);
    for photo in photos {
        let name = photo["name"].as_str().unwrap();
        let image = ours.images.values().find(|i| i.name == name).unwrap();
        let camera = &ours.cameras[&image.camera_id];
        let view = View {
            lens: camera.lens().unwrap(),
            width: camera.width,
            height: camera.height,
            camera_from_world: image.camera_from_world,
        };
        let frame = folder
            .path()
            .join("frames")
            .join(name)
            .with_extension("png");
        let (psnr, pixels) = psnr_inside(&view, &frame, &source.join("images").join(name));
        println!("{name}: {psnr:.2} dB over {pixels} pixels");
        assert!(pixels > 20_000, "{name}: {pixels} pixels");
        // Measured 25.8 and 24.9 dB.
        assert!(psnr > 23.5, "{name}: {psnr} dB");
    }
}

#[test]
fn a_capture_with_nothing_but_opencvs_file_is_imported() {
    let Some(source) = chessboard() else { return };
    let folder = with_chessboard(&source);
    let ran = import(&folder, "capture").ok();
    assert_eq!(ran.stdout, "scene: 13 photos, 54 points\n");

    // Of two, one is chosen, and that is said.
    let file = |name: &str| folder.path().join("capture").join(name);
    fs::copy(file("out_camera_data.yml"), file("second.yml")).unwrap();
    let ran = import(&folder, "capture --force").ok();
    let said = "note: the calibration is capture/out_camera_data.yml; `lumigraph import capture \
                --calibration capture/second.yml -o SCENE` takes that in capture/second.yml";
    assert!(ran.stderr.contains(said), "{}", ran.stderr);
    fs::remove_file(file("second.yml")).unwrap();
    let both = source.display();
    let ran = import(&folder, &format!("{both} --force")).ok();
    let said = format!(
        "note: the calibration is the COLMAP model in {both}/sparse/0; `lumigraph import {both} \
         --calibration {both}/out_camera_data.yml -o SCENE` takes that in {both}/out_camera_data.yml"
    );
    assert!(ran.stderr.contains(&said), "{}", ran.stderr);

    // Without a list the photos' names decide, as long as there are as many.
    fs::remove_file(file("images.yml")).unwrap();
    let ran = import(&folder, "capture --force").ok();
    let said = "note: the 13 poses in capture/out_camera_data.yml are taken to be of the photos \
                in the order of their names";
    assert!(ran.stderr.contains(said), "{}", ran.stderr);
    fs::remove_file(file("images/left05.jpg")).unwrap();
    let error = import(&folder, "capture --force").error(1);
    assert!(
        error.starts_with(
            "capture/out_camera_data.yml: the file holds 13 poses, but capture/images has 12 \
             photos, and no list says which are meant; put the list"
        ),
        "{error}"
    );
}

const CAMERA: &str = "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\nKamera: \
    !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 500, 0, 319.5, 0, 500, 239.5, \
    0, 0, 1 ]\nPoly: !!opencv-matrix\n   rows: 1\n   cols: 14\n   dt: d\n   data: [ 0.1, 0, 0, 0, \
    0, 0, 0, 0, 0, 0, 0, 0, 0, 0 ]\n";

/// A matrix as OpenCV writes it.
fn matrix(name: &str, rows: usize, values: &[f64]) -> String {
    let cols = values.len() / rows;
    format!(
        "{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {cols}\n   dt: d\n   data: \
         {values:?}\n"
    )
}

/// A folder with `photos` of a brick wall through a lens, and as `c.yml` OpenCV's file with
/// these matrices and the photos' poses; and options for `proxy` that give the wall.
fn wall_through(lens: Lens, matrices: &str) -> (TempDir, String) {
    let (width, height) = (120, 90);
    let options = Options {
        size: Some((width, height)),
        ..Options::default()
    };
    let wall = datasets::by_name("wall", &options).unwrap();
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("photos")).unwrap();
    let (mut names, mut rvecs, mut tvecs) = (Vec::new(), Vec::new(), Vec::new());
    for photo in &wall.photos {
        let pose = photo.view.camera_from_world;
        names.push(photo.name.clone());
        rvecs.push(pose.rotation.to_scaled_axis().to_array());
        tvecs.push(pose.translation.to_array());
        let view = View {
            lens,
            ..photo.view.clone()
        };
        let picture = datasets::render_view(&wall.scene, &view, 3);
        let path = folder.path().join("photos").join(&photo.name);
        picture.save(path).unwrap();
    }
    let text = format!(
        "%YAML:1.0\n---\nimage_width: {width}\nimage_height: {height}\n{matrices}\
         rvecs: {rvecs:?}\ntvecs: {tvecs:?}\nimages: {names:?}\n"
    );
    fs::write(folder.path().join("c.yml"), text).unwrap();
    let world_from_wall = wall.scene.objects()[0].world_from_shape;
    let list = |v: DVec3| format!("{},{},{}", v.x, v.y, v.z);
    let point = list(world_from_wall * DVec3::ZERO);
    let normal = list(world_from_wall.rotation * DVec3::Z);
    (folder, format!("--point {point} --normal {normal}"))
}

fn psnr(drawn: &Path, photo: &Path) -> f64 {
    let open = |path: &Path| image::open(path).unwrap().to_rgba8().into_raw();
    let (drawn, photo) = (open(drawn), open(photo));
    assert_eq!(drawn.len(), photo.len());
    let squares = drawn.iter().zip(&photo).map(|(&a, &b)| {
        let off = f64::from(a) - f64::from(b);
        off * off
    });
    10.0 * (255.0_f64.powi(2) * photo.len() as f64 / squares.sum::<f64>()).log10()
}

/// Photos through lenses that COLMAP has no model of are imported and drawn from as they are.
#[test]
fn opencvs_own_lenses_are_drawn_through() {
    let tilted = [
        0.2143, -0.0912, 0.0009, -0.0014, 0.0121, 0.3017, -0.0286, 0.0081, 0.0117, -0.0025,
        -0.0111, 0.0013, 0.0613, -0.0847,
    ];
    let fisheye = [-0.0213, 0.0092, -0.0047, 0.0011];
    let skewed = Distortion::SkewedFisheye {
        k: fisheye,
        alpha: 0.02,
    };
    let mut held_out = Vec::new();
    for (model, distortion, coefficients, skew, option) in [
        ("PINHOLE", Distortion::None, &[0.0; 5][..], 0.0, ""),
        (
            "OPENCV_TILTED",
            Distortion::of_opencv(&tilted).unwrap(),
            &tilted[..],
            0.0,
            "",
        ),
        (
            "OPENCV_SKEWED_FISHEYE",
            skewed,
            &fisheye[..],
            0.02 * 110.0,
            " --fisheye",
        ),
    ] {
        // 1. Photos and OpenCV's file, in OpenCV's pixels.
        let lens = Lens::new(
            DVec2::new(110.0, 108.0),
            DVec2::new(61.5, 44.25),
            distortion,
        );
        let camera = [110.0, skew, 61.0, 0.0, 108.0, 43.75, 0.0, 0.0, 1.0];
        let matrices = matrix("camera_matrix", 3, &camera)
            + &matrix("distortion_coefficients", 1, coefficients);
        let (folder, wall) = wall_through(lens, &matrices);
        import(&folder, &format!("photos --calibration c.yml{option}")).ok();
        let cameras = fs::read_to_string(folder.path().join("scene/model/cameras.txt")).unwrap();
        let line = format!("1 {model} 120 90 110 108 61.5 44.25");
        assert!(cameras.contains(&line), "{cameras}");
        let line = format!("proxy scene plane {wall}");
        lumigraph(folder.path(), &line).ok();

        // 2. At a photo's own place the photo comes out.
        for (device, renderer) in [
            ("reference", "exact"),
            ("cpu", "exact"),
            ("cpu", "triangulated"),
        ] {
            let out = format!("{device}-{renderer}");
            let options = format!("--device {device} --renderer {renderer} -o {out}");
            let line = format!("render scene --views scene/model {options}");
            lumigraph(folder.path(), &line).ok();
            for name in ["0000.png", "0005.png"] {
                let [drawn, photo] = [&*out, "photos"].map(|f| folder.path().join(f).join(name));
                let psnr = psnr(&drawn, &photo);
                println!("{model}, {out}, {name}: {psnr:.1} dB");
                assert!(psnr >= 50.0, "{model}, {out}, {name}: {psnr} dB");
            }
        }

        // 3. A photo that the others know nothing of comes out as well as through a pinhole.
        fs::write(
            folder.path().join("split.json"),
            r#"{"test": ["0004.png"]}"#,
        )
        .unwrap();
        let line = "evaluate scene --hold-out split.json --json";
        let result = lumigraph(folder.path(), line).ok().json();
        held_out.push(result["photos"][0]["psnr_covered"].as_f64().unwrap());
    }
    println!("held out, pinhole first: {held_out:.1?} dB");
    for psnr in &held_out[1..] {
        assert!(*psnr > held_out[0] - 1.0, "{held_out:?}");
    }
}

#[test]
fn info_reads_a_bare_calibration() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("c.yml");
    fs::write(&path, CAMERA).unwrap();
    let error = lumigraph(folder.path(), "info c.yml").error(1);
    assert!(
        error.contains("the file holds Kamera (3 × 3), Poly (1 × 14); choose with"),
        "{error}"
    );
    let line = "info c.yml --camera-matrix Kamera --distortion Poly";
    let text = lumigraph(folder.path(), line).ok().stdout;
    assert_eq!(
        text,
        "camera   Kamera: OPENCV 640×480 [500.0,500.0,320.0,240.0,0.1,0.0,0.0,0.0]\n\
         poses    0, 0 photos named\npoints   0\n"
    );
    // The tilted model is no model of COLMAP's.
    fs::write(&path, CAMERA.replace("0, 0 ]\n", "0.01, 0 ]\n")).unwrap();
    let words: Vec<&str> = line.split(' ').chain(["--json"]).collect();
    let info = run(folder.path(), &words, &[]).ok().json();
    let camera = &info["cameras"][0];
    assert_eq!(camera["model"], "OPENCV_TILTED");
    assert_eq!(camera["params"][16], 0.01);
}

#[test]
fn what_cannot_be_imported_is_said() {
    let folder = crate::run::with_wall();
    let path = folder.path().join("c.yml");
    let error = |text: &str| {
        fs::write(&path, text).unwrap();
        let keys = "--camera-matrix Kamera --distortion Poly";
        let line = format!("wall/images --calibration c.yml {keys}");
        let error = import(&folder, &line).error(1);
        assert!(!folder.path().join("scene").exists());
        error
    };
    assert!(
        error(CAMERA).starts_with("c.yml: the file holds cameras, but no poses; expected"),
        "{}",
        error(CAMERA)
    );
    let poses = "rvecs: [[0, 0, 0], [0, 0, 1]]\ntvecs: [[0, 0, 1], [0, 0, 2]]\n";
    let listed = format!("{CAMERA}{poses}images: [ a/0001.png, \"b\\\\0001.png\" ]\n");
    assert!(
        error(&listed).contains("names 0001.png twice"),
        "{}",
        error(&listed)
    );
    let tilted = CAMERA.replace("0, 0 ]\n", "2, 0 ]\n");
    let tilted = format!("{tilted}{poses}images: [ 0001.png, 0002.png ]\n");
    assert_eq!(
        error(&tilted),
        "c.yml, line 10: Poly: parameter tauX of OPENCV_TILTED is 2; it must be an angle in \
         radians between −π/2 and π/2; calibrate again"
    );
    let other_size = format!("{CAMERA}{poses}images: [ 0001.png, 0002.png ]\n");
    assert!(
        error(&other_size).contains("640 × 480"),
        "{}",
        error(&other_size)
    );
    assert!(error("%YAML:1.0\nK: [").starts_with("c.yml, line 2: the file ends"));
}
