//! Interiors out of photos: the same as of the model, and drawn from the photos.

use crate::interior::{HALVES, apart, corners, names, with_house};
use crate::run::{lumigraph, with_generated};
use crate::uncalibrated::is_installed;
use calibrate::{ModelKind, Reconstruction, colmap};
use glam::DQuat;
use proxy::interior::find::{Evidence, FindOptions, find_interior};
use proxy::interior::{read_interior, surface_of, write_interior};
use proxy::mesh::read_model;
use serde_json::Value;
use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::path::Path;

/// Makes an interior of a model, and one of photos with depth taken all around in its rooms, and
/// looks for each cell and portal of either in the other.
fn same_from_model_and_photos(here: &Path, model: &Path, survey: &str) {
    // As found: what is walked through reaches as far as lines of sight in the model do.
    let (read, _) = read_model(&here.join(model)).unwrap();
    let evidence = Evidence {
        mesh: &surface_of(&read),
        cameras: &[],
        sights: &[],
    };
    let found = find_interior(&evidence, "model.glb", &FindOptions::default()).unwrap();
    std::fs::create_dir(here.join("found")).unwrap();
    std::fs::copy(here.join(model), here.join("found/model.glb")).unwrap();
    write_interior(&here.join("found/interior.json"), &found.interior).unwrap();
    lumigraph(
        here,
        &format!("generate survey --of found {survey} -o survey"),
    )
    .ok();
    let ran = lumigraph(here, "interior survey --compare found -o photos").ok();
    let (model, photos) = (corners(&here.join("found")), corners(&here.join("photos")));
    let [rooms, openings] = [&model[0], &model[1]].map(Vec::len);
    let said = format!("{rooms} of {rooms} rooms, {openings} of {openings} portals found");
    assert!(ran.stdout.contains(&said), "{}", ran.stdout);
    for (of_model, of_photos) in model.iter().zip(&photos) {
        assert_eq!(of_model.len(), of_photos.len(), "{}", ran.stdout);
        for (some, others) in [(of_model, of_photos), (of_photos, of_model)] {
            for one in some {
                let nearest = others.iter().map(|other| apart(one, other));
                let nearest = nearest.fold(f64::INFINITY, f64::min);
                assert!(nearest <= 0.2, "{nearest}: {one:?}\n{}", ran.stdout);
            }
        }
    }
}

#[test]
fn photos_of_a_house_give_the_cells_and_portals_of_its_model() {
    let folder = with_house();
    let (model, survey) = ("house/house.glb", "--photos 48 --size 128x96");
    same_from_model_and_photos(folder.path(), Path::new(model), survey);
}

#[test]
fn photos_of_another_house_do_so_too() {
    let captures = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/captures"));
    let model = captures.join("interior-house/house.glb");
    if !model.exists() {
        eprintln!("SKIPPED: {} is not there", model.display());
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let survey = "--photos 120 --size 128x96";
    same_from_model_and_photos(folder.path(), &model, survey);
}

/// Photos of the hallway, whose model is changed, in `hall`.
fn hallway(here: &Path, change: impl FnOnce(&mut Reconstruction)) {
    lumigraph(here, "generate hallway --size 48x36 -o hall").ok();
    let model = here.join("hall/sparse/0");
    let mut whole = colmap::read_model(&model).unwrap();
    change(&mut whole);
    colmap::write_binary(&whole, &model).unwrap();
}

#[test]
fn held_out_photos_of_lenses_that_bend_are_told_with_what_helps() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    hallway(here, |whole| {
        for camera in whole.cameras.values_mut() {
            assert_eq!(camera.model, ModelKind::SimplePinhole);
            camera.model = ModelKind::SimpleRadial;
            camera.params.push(0.01);
        }
    });
    std::fs::write(here.join("halves.json"), HALVES).unwrap();
    let made = "--rooms halves.json --hold-out hall/split.json";
    let remedy = "import the photos with --undistort, and make the interior of that scene";
    let ran = lumigraph(here, &format!("interior hall {made} -o bent")).ok();
    let note = "note: photo 0000.png is held out, and its lens is distorted";
    assert!(ran.stderr.contains(note), "{}", ran.stderr);
    assert!(ran.stderr.contains(remedy), "{}", ran.stderr);
    let walk = |interior: &str| {
        let line = format!("walk {interior} --held-out --portals geometry -o {interior}-scored");
        lumigraph(here, &line)
    };
    let error = walk("bent").error(1);
    let said = "bent: photo 0000.png: its lens is distorted; ";
    assert!(
        error.starts_with(said) && error.ends_with(remedy),
        "{error}"
    );
    // It does help.
    lumigraph(here, "import hall --undistort -o flat").ok();
    let ran = lumigraph(here, &format!("interior flat {made} -o straight")).ok();
    assert!(!ran.stderr.contains("distorted"), "{}", ran.stderr);
    walk("straight").ok();
}

#[test]
fn a_captures_rooms_are_drawn_from_its_photos() {
    let folder = with_generated("hallway --size 96x72 -o hall");
    let here = folder.path();
    std::fs::write(here.join("halves.json"), HALVES).unwrap();
    let made = "interior hall --rooms halves.json --hold-out hall/split.json -o two";
    let ran = lumigraph(here, made).ok();
    assert!(ran.stderr.contains("24 depth maps fused"), "{}", ran.stderr);
    // Photos are named, not copied.
    assert_eq!(names(&here.join("two")), ["interior.json", "model.glb"]);
    let file: Value =
        serde_json::from_slice(&std::fs::read(here.join("two/interior.json")).unwrap()).unwrap();
    assert_eq!(file["cells"][1]["scene"], "../hall");
    assert_eq!(file["held_out"].as_array().unwrap().len(), 4);
    // Held-out photos are close to what is drawn, much closer than with the model's own colours.
    let line = "walk two --held-out --portals geometry,ldi,whole --device cpu --json";
    let scores = |more: &str| -> Vec<f64> {
        let report = lumigraph(here, &format!("{line} {more}")).ok().json();
        let walks = report["walks"].as_array().unwrap().clone();
        assert!(
            walks
                .iter()
                .all(|w| w["frames"].as_array().unwrap().len() == 4)
        );
        let score = |w: &Value| w["mean"]["psnr"].as_f64().unwrap();
        walks.iter().map(score).collect()
    };
    let photos = scores("-o scored");
    let plain = scores("--no-photos -o plain");
    assert!(
        photos[0] > 26.0 && photos[0] > plain[0] + 3.0,
        "{photos:?} {plain:?}"
    );
    assert_eq!(photos[0], photos[2]);
    // So small photos are coarser than the views that are made of several of them.
    let of_views = scores("--ldi-from views -o views");
    assert!(of_views[1] > photos[2] - 0.5, "{of_views:?}");
    assert!(photos[1] > photos[2] - 1.2, "{photos:?}");
    // A walk, byte for byte on one thread.
    let walk = "walk two --tour --frames 2 --size 48x32 --reference-size 32x32 --portals ldi";
    lumigraph(here, &format!("{walk} -o a")).ok();
    lumigraph(here, &format!("--threads 1 {walk} -o b")).ok();
    for file in ["frame_0000.png", "frame_0001.png"] {
        let read = |folder: &str| std::fs::read(here.join(folder).join(file)).unwrap();
        assert!(read("a") == read("b"), "{file}");
    }
    // Each photo counts once, however often it was decoded.
    let walk =
        "walk two --tour --frames 8 --size 48x36 --reference-size 32x32 --portals ldi --device cpu";
    let line = format!("{walk} --cpu-memory 60kB --json -o few");
    let report = lumigraph(here, &line).ok().json();
    let whole = &report["report"];
    let loads = whole["cpu_memory"]["loads"].as_u64();
    assert!(loads > whole["photos_decoded"].as_u64(), "{whole}");
    assert_eq!(report["photos_decoded"], whole["photos_decoded"]);
    // Triangles are the model's, without the shell that is drawn behind them.
    let (model, _) = read_model(&here.join("two/model.glb")).unwrap();
    assert_eq!(report["triangles"], model.mesh.triangles.len());
    let drawn = report["walks"][0]["frames"][0]["triangles_in_cells"].as_u64();
    assert!(drawn > report["triangles"].as_u64(), "{report}");
    // Held-out photos that the scene does not have are told by name, with the file to correct.
    let path = here.join("two/interior.json");
    let held_out = file["held_out"].as_array().unwrap();
    for (gone, named) in [
        (&["nope.jpg"][..], "nope.jpg"),
        (&["nope.jpg", "lost.jpg"][..], "nope.jpg and 1 more"),
    ] {
        let mut changed = file.clone();
        let mut all = held_out.clone();
        all.extend(gone.iter().map(|name| Value::from(*name)));
        changed["held_out"] = Value::from(all);
        std::fs::write(&path, changed.to_string()).unwrap();
        let said = lumigraph(here, "walk two --tour --frames 1 --size 48x32 -o told").ok();
        let warning = format!("warning: two/interior.json: its `held_out` has {named}, which ");
        let is_told = said.stderr.lines().any(|line| line.starts_with(&warning));
        assert!(is_told, "{}", said.stderr);
    }
    std::fs::write(&path, file.to_string()).unwrap();
    // Photos that are gone are missed by name.
    std::fs::rename(here.join("hall"), here.join("gone")).unwrap();
    let error = lumigraph(here, "walk two --tour --frames 1 -o c").error(1);
    assert!(error.contains("the scene of its cells"), "{error}");
    lumigraph(
        here,
        "walk two --tour --frames 1 --size 48x32 --no-photos -o c",
    )
    .ok();
}

/// Photos that were taken there look the other way than the tour does.
#[test]
fn rooms_that_photos_show_little_of_are_named_after_a_walk() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    hallway(here, |_| {});
    // All photos look along -z, half of them from the back.
    let rooms = r#"{"version": 1, "rooms": [
        {"name": "front", "min": [-1, 0, -6], "max": [1, 2.4, 2]},
        {"name": "back", "min": [-1, 0, 2], "max": [1, 2.4, 6]}],
        "openings": [{"name": "across", "between": ["front", "back"], "radius": 0.5,
            "polygon": [[-1, 0, 2], [1, 0, 2], [1, 2.4, 2], [-1, 2.4, 2]]}]}"#;
    std::fs::write(here.join("rooms.json"), rooms).unwrap();
    lumigraph(here, "interior hall --rooms rooms.json -o two").ok();
    let walk = |more: &str| {
        let line = format!("walk two {more} --device cpu --json");
        let ran = lumigraph(here, &line).ok();
        let report = ran.json();
        let notes = report["report"]["notes"].as_array().unwrap().iter();
        let notes = notes.map(|note| note.as_str().unwrap());
        let little = notes.filter(|note| note.starts_with("frames show little in "));
        let little: Vec<String> = little.map(str::to_owned).collect();
        for note in &little {
            let line = format!("note: {note}\n");
            assert!(ran.stderr.contains(&line), "{}", ran.stderr);
        }
        (report, little)
    };
    // The tour goes from front to back.
    let (report, notes) = walk("--frames 12 --size 48x36 -o tour");
    let frames = report["walks"][0]["frames"].as_array().unwrap().iter();
    let in_back = frames.filter(|frame| frame["cell"] == "back");
    let shown = in_back.map(|frame| {
        let file = here.join(frame["file"].as_str().unwrap());
        let picture = image::open(file).unwrap().into_rgba8();
        let alphas = picture.pixels().map(|pixel| f64::from(pixel.0[3]));
        alphas.sum::<f64>() / (255.0 * 48.0 * 36.0)
    });
    let shown: Vec<f64> = shown.collect();
    let percent = 100.0 * shown.iter().sum::<f64>() / shown.len() as f64;
    assert!(percent > 30.0 && percent < 65.0, "{percent}");
    let said = format!(
        "frames show little in back ({percent:.0} % of the pixels of {} frames; photos taken there: 14 of 28): take more \
         photos of what one sees from there, or give a --path that stays out or looks another way",
        shown.len()
    );
    assert_eq!(notes, [said]);
    // Of who looks as the photos do nothing is said, nor without photos.
    let mut path = render::path::read(&here.join("tour/path.json")).unwrap();
    path.extra.clear();
    for frame in &mut path.frames {
        let turn = calibrate::Rigid3::new(DQuat::from_rotation_y(PI), glam::DVec3::ZERO);
        frame.view.camera_from_world = turn * frame.view.camera_from_world;
    }
    render::path::write(&here.join("ahead.json"), &path).unwrap();
    let none: [String; 0] = [];
    assert_eq!(walk("--path ahead.json --size 48x36 -o ahead").1, none);
    assert_eq!(walk("--frames 2 --size 48x36 --no-photos -o plain").1, none);
}

#[test]
fn a_capture_without_depth_needs_a_mesh() {
    let folder = with_generated("hallway --size 96x72 -o hall");
    let here = folder.path();
    std::fs::remove_dir_all(here.join("hall/depth")).unwrap();
    let error = lumigraph(here, "interior hall -o none").error(1);
    assert!(error.contains("no depth maps"), "{error}");
    assert!(error.contains("lumigraph proxy SCENE tunnel"), "{error}");
    lumigraph(here, "import hall -o scene").ok();
    lumigraph(here, "proxy scene tunnel").ok();
    std::fs::write(here.join("halves.json"), HALVES).unwrap();
    lumigraph(here, "interior scene --rooms halves.json -o two").ok();
    lumigraph(here, "walk two --tour --frames 2 --size 48x32 -o walk").ok();
    let error = lumigraph(here, "walk two --held-out -o x").error(1);
    assert!(error.contains("no photos were held out"), "{error}");
    // Of a video that the scene's photos were taken out of no film takes the place, whatever is drawn.
    let path = here.join("scene/scene.json");
    let mut scene: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    scene["settings"]["video"] = "../hall.mp4".into();
    std::fs::write(&path, scene.to_string()).unwrap();
    std::fs::write(here.join("hall.mp4"), "a video").unwrap();
    let films = is_installed(&capture::video::ffmpeg());
    for photos in ["", " --no-photos"].into_iter().filter(|_| films) {
        let line = "walk two --tour --frames 2 --size 48x32 -o film --video hall.mp4";
        let error = lumigraph(here, &format!("{line}{photos}")).error(1);
        let said = "hall.mp4: the film is made of this very file; nothing was written: choose another --video";
        assert_eq!(error, said);
    }
    let line = "interior scene --hold-out hall/split.json -o other";
    let error = lumigraph(here, line).error(1);
    assert!(error.contains("which is held out"), "{error}");
}

#[test]
fn rooms_of_photos_that_do_not_say_what_is_up_have_what_cameras_had() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    // In a world where y points down: turned half round about x.
    hallway(here, |whole| {
        let half = DQuat::from_rotation_x(PI);
        for image in whole.images.values_mut() {
            image.camera_from_world.rotation *= half;
        }
        for point in whole.points.values_mut() {
            point.position = half * point.position;
        }
    });
    let rooms = r#"{"version": 1, UP "rooms": [
        {"name": "front", "min": [-9, -9, 2], "max": [9, 9, 99]},
        {"name": "back", "min": [-9, -9, -99], "max": [9, 9, 2]}],
        "openings": [{"name": "across", "between": ["front", "back"], "radius": 0.5,
            "polygon": [[-1, 0, 2], [1, 0, 2], [1, -2.4, 2], [-1, -2.4, 2]]}]}"#;
    for (given, up, is_told) in [
        ("", [0.0, -1.0, 0.0], false),
        (r#""up": [0, -1, 0],"#, [0.0, -1.0, 0.0], false),
        (r#""up": [0, 1, 0],"#, [0.0, 1.0, 0.0], true),
    ] {
        std::fs::write(here.join("rooms.json"), rooms.replace("UP", given)).unwrap();
        let line = "interior hall --rooms rooms.json -o two --force";
        let said = lumigraph(here, line).ok().stderr;
        let (interior, _) = read_interior(&here.join("two/interior.json")).unwrap();
        assert_eq!(interior.up.to_array(), up, "{given}");
        let warning =
            "warning: `up` is [0, 1, 0], but the photos were held with about [0, -1, 0] up";
        assert_eq!(said.contains(warning), is_told, "{said}");
        assert_eq!(said.contains("`up` is"), is_told, "{said}");
    }
}

#[test]
fn triangles_in_no_cell_are_counted_alike_where_rooms_are_made_and_walked_through() {
    let folder = with_generated("hallway --size 96x72 -o hall");
    let here = folder.path();
    let rooms = |high: f64| {
        let text = format!(
            r#"{{"version": 1, "rooms": [{{"name": "low", "min": [-9, -9, -9], "max": [8, {high}, 8]}}]}}"#
        );
        std::fs::write(here.join("rooms.json"), text).unwrap();
        let line = "interior hall --rooms rooms.json -o one --force";
        lumigraph(here, line).ok().stderr
    };
    rooms(2.0);
    // Planes that most triangles are on and above of, as f32 has them.
    let (model, _) = read_model(&here.join("one/model.glb")).unwrap();
    let mut planes: BTreeMap<u64, usize> = BTreeMap::new();
    for i in 0..model.mesh.triangles.len() {
        let low = model.mesh.corners(i).map(|corner| corner.y);
        let low = low.into_iter().fold(f64::INFINITY, f64::min);
        *planes.entry(low.to_bits()).or_default() += 1;
    }
    let mut planes: Vec<(usize, f64)> = planes
        .into_iter()
        .map(|(bits, count)| (count, f64::from_bits(bits)))
        .collect();
    planes.sort_by(|a, b| b.0.cmp(&a.0).then(b.1.total_cmp(&a.1)));
    let told = |said: &str| {
        let is_told = |line: &&str| line.contains("triangles are in no cell");
        said.lines().find(is_told).map(str::to_owned)
    };
    for (_, plane) in &planes[..3] {
        // A box has what is this much beyond it, too: by rounding these triangles, or not.
        let made = told(&rooms(plane - 9.0 * f64::from(f32::EPSILON)));
        let line = "walk one --frames 1 --size 16x12 -o frames";
        let walked = told(&lumigraph(here, line).ok().stderr);
        assert!(made.is_some());
        assert_eq!(made, walked, "{plane}");
    }
}
