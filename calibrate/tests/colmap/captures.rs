//! Real models.

use calibrate::colmap::{find_model, read_model, write_binary, write_text};
use calibrate::{Pixel, Point3D, Reconstruction};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

const CAPTURES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/captures");

/// The folder of captures, or a loud `None`.
fn captures() -> Option<PathBuf> {
    let folder = PathBuf::from(CAPTURES);
    if !folder.is_dir() {
        eprintln!("SKIPPED: {CAPTURES} is absent");
        return None;
    }
    Some(folder)
}

/// Distance in pixels between keypoints and their points' projections: the mean over the
/// points of the mean over each one's track. That is COLMAP's mean reprojection error.
fn mean_reprojection_error(model: &Reconstruction) -> f64 {
    let lenses: BTreeMap<_, _> = model
        .cameras
        .iter()
        .map(|(id, camera)| (*id, camera.lens().unwrap()))
        .collect();
    let of_point = |point: &Point3D| {
        let distances = point.track.iter().map(|(image_id, keypoint)| {
            let image = &model.images[image_id];
            let keypoint = image.keypoints[*keypoint as usize];
            lenses[&image.camera_id]
                .project(image.camera_from_world * point.position)
                .unwrap()
                .distance(Pixel::new(keypoint.x, keypoint.y))
        });
        distances.sum::<f64>() / point.track.len() as f64
    };
    model.points.values().map(of_point).sum::<f64>() / model.points.len() as f64
}

/// The number of points and the mean reprojection error that a capture's README states.
fn stated(readme: &str) -> (usize, f64) {
    let (points, rest) = readme.split_once(" points, mean track length ").unwrap();
    let points = points.rsplit(' ').next().unwrap();
    let (_, rest) = rest.split_once("mean reprojection error ").unwrap();
    let (error_px, _) = rest.split_once(" px").unwrap();
    (points.parse().unwrap(), error_px.parse().unwrap())
}

#[test]
fn every_capture_reads_and_reprojects_as_its_readme_states() {
    let Some(folder) = captures() else { return };
    let mut read = 0;
    for entry in fs::read_dir(folder).unwrap() {
        let capture = entry.unwrap().path();
        if !capture.join("sparse/0").is_dir() {
            continue;
        }
        let place = find_model(&capture).unwrap();
        assert_eq!(place, capture.join("sparse").join("0"));
        let model = read_model(&place).unwrap();
        let readme = fs::read_to_string(capture.join("README.md")).unwrap();

        let error_px = mean_reprojection_error(&model);
        let (points, stated_px) = stated(&readme);
        println!(
            "{}: {} images, {} points, {error_px:.4} px (README {stated_px})",
            capture.file_name().unwrap().display(),
            model.images.len(),
            model.points.len(),
        );
        assert_eq!(model.points.len(), points, "{capture:?}");
        assert!((error_px - stated_px).abs() <= 0.01, "{capture:?}");

        // Tracks and keypoints tell the same story.
        for (id, point) in &model.points {
            for (image_id, keypoint) in &point.track {
                let keypoint = model.images[image_id].keypoints[*keypoint as usize];
                assert_eq!(keypoint.point, Some(*id), "{capture:?}");
            }
        }
        read += 1;
    }
    assert!(read >= 11, "only {read} captures");
}

/// Each capture's name and reprojection error in pixels, from the table of the captures'
/// README: the first cell of a row, and the one under "reproj. error (px)".
fn table(readme: &str) -> Vec<(String, f64)> {
    let cells = |line: &str| -> Vec<String> {
        let inner = line.trim().trim_matches('|');
        inner.split('|').map(|c| c.trim().to_owned()).collect()
    };
    let mut rows = readme.lines().filter(|line| line.starts_with('|'));
    let header = cells(rows.next().expect("a table"));
    let column = header
        .iter()
        .position(|c| c == "reproj. error (px)")
        .expect("a column of errors");
    // After the header comes the ruling.
    rows.skip(1)
        .map(cells)
        .map(|row| (row[0].clone(), row[column].parse().unwrap()))
        .collect()
}

/// The table's figure is the mean over the *points* of each point's mean distance, as
/// COLMAP's analyser reports it, and so the mean of the errors that the points carry. The
/// mean over all *observations*, which weighs long tracks more, is another number: larger
/// on most captures, since long tracks fit worse.
#[test]
fn every_capture_imports_at_the_error_of_the_captures_table() {
    let Some(folder) = captures() else { return };
    let rows = table(&fs::read_to_string(folder.join("README.md")).unwrap());
    assert!(rows.len() >= 11, "{rows:?}");
    let mut told_apart = 0;
    for (name, stated_px) in rows {
        let model = read_model(&folder.join(&name).join("sparse/0")).unwrap();
        let of_points_px = mean_reprojection_error(&model);
        let cameras = model.cameras.keys();
        let observations_px: Vec<f64> = cameras
            .flat_map(|id| model.reprojection_errors_px(*id).unwrap())
            .collect();
        let of_observations_px = observations_px.iter().sum::<f64>() / observations_px.len() as f64;
        let kept = model.points.values().map(|p| p.error_px);
        let kept_px = kept.sum::<f64>() / model.points.len() as f64;
        println!(
            "{name}: stated {stated_px}, points {of_points_px:.4}, observations \
             {of_observations_px:.4}, stored with the points {kept_px:.4}"
        );
        assert!((of_points_px - stated_px).abs() <= 0.01, "{name}");
        told_apart += usize::from((of_observations_px - stated_px).abs() > 0.01);
    }
    assert!(told_apart > 0, "either mean would do");
}

#[test]
fn every_capture_is_written_byte_for_byte_as_it_was_read() {
    let Some(folder) = captures() else { return };
    let here = tempfile::tempdir().unwrap();
    let mut compared = 0;
    for entry in fs::read_dir(folder).unwrap() {
        let capture = entry.unwrap().path();
        let Ok(source) = find_model(&capture) else {
            continue;
        };
        let name = capture.file_name().unwrap().to_owned();
        let model = read_model(&source).unwrap();

        // Binary: the very bytes.
        let binary = here.path().join("binary").join(&name);
        write_binary(&model, &binary).unwrap();
        for file in ["cameras.bin", "images.bin", "points3D.bin"] {
            let (ours, theirs) = (binary.join(file), source.join(file));
            let same = fs::read(ours).unwrap() == fs::read(theirs).unwrap();
            assert!(same, "{file} of {capture:?}");
        }

        // Text: every bit of every number, twice.
        let (text, again) = (here.path().join("text"), here.path().join("again"));
        let (text, again) = (text.join(&name), again.join(&name));
        write_text(&model, &text).unwrap();
        let read = read_model(&text).unwrap();
        assert_eq!(bits(&read), bits(&model), "{capture:?}");
        write_text(&read, &again).unwrap();
        for file in ["cameras.txt", "images.txt", "points3D.txt"] {
            let same = fs::read(text.join(file)).unwrap() == fs::read(again.join(file)).unwrap();
            assert!(same, "{file} of {capture:?}");
        }
        compared += 1;
    }
    assert!(compared >= 11, "only {compared} captures");
}

/// A model as COLMAP's bytes, which tell 0 from −0.
fn bits(model: &Reconstruction) -> Vec<Vec<u8>> {
    let folder = tempfile::tempdir().unwrap();
    write_binary(model, folder.path()).unwrap();
    ["cameras.bin", "images.bin", "points3D.bin"]
        .map(|file| fs::read(folder.path().join(file)).unwrap())
        .to_vec()
}

#[test]
fn the_text_model_says_what_the_binary_one_says() {
    let Some(folder) = captures() else { return };
    let castle = folder.join("sceaux-castle");
    let binary = read_model(&castle.join("sparse/0")).unwrap();
    let text = read_model(&castle.join("sparse-txt/0")).unwrap();
    // 17 digits say everything about an f64; reading may normalise a quaternion.
    assert_eq!(binary.cameras, text.cameras);
    assert_eq!(binary.points, text.points);
    assert_eq!(binary.images.len(), text.images.len());
    for (id, ours) in &binary.images {
        let theirs = &text.images[id];
        assert_eq!(ours.name, theirs.name);
        assert_eq!(ours.camera_id, theirs.camera_id);
        assert_eq!(ours.keypoints, theirs.keypoints);
        let (ours, theirs) = (ours.camera_from_world, theirs.camera_from_world);
        assert!((ours.rotation - theirs.rotation).length() < 1e-15);
        assert!((ours.translation - theirs.translation).length() < 1e-15);
    }
}

#[test]
fn a_model_without_its_folder_is_refused() {
    assert!(read_model(Path::new("no-such-folder")).is_err());
}
