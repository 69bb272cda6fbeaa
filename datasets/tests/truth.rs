//! What the datasets promise: everything about them is exact, on disk as in memory.

use calibrate::Pixel;
use datasets::{
    DEPTH_STEPS_PER_UNIT, Dataset, DatasetError, Finish, Options, by_name, files, names,
    render_depth, render_view, srgb_from_linear, write,
};
use glam::DVec3;
use std::path::{Path, PathBuf};

fn small(name: &str, views: usize) -> Dataset {
    let options = Options {
        size: Some((160, 120)),
        views: Some(views),
        samples_per_side: Some(2),
    };
    by_name(name, &options).unwrap()
}

#[test]
fn keypoints_are_the_projections_of_their_points() {
    for name in names() {
        let dataset = small(name, 9);
        let reconstruction = &dataset.reconstruction;
        assert!(reconstruction.points.len() > 500, "{name}");
        let mut observations = 0;
        for (id, point) in &reconstruction.points {
            assert!(point.track.len() >= 2);
            assert_eq!(point.error_px, 0.0);
            for (image_id, keypoint_idx) in &point.track {
                let image = &reconstruction.images[image_id];
                let keypoint = image.keypoints[*keypoint_idx as usize];
                assert_eq!(keypoint.point, Some(*id));
                let photo = dataset
                    .photos
                    .iter()
                    .find(|p| p.name == image.name)
                    .unwrap();
                let pixel = photo.view.project(point.position).unwrap();
                assert!(photo.view.contains(pixel));
                assert!(pixel.distance(Pixel::new(keypoint.x, keypoint.y)) < 1e-9);
                observations += 1;
            }
        }
        let keypoints: usize = reconstruction
            .images
            .values()
            .map(|i| i.keypoints.len())
            .sum();
        assert_eq!(observations, keypoints, "every keypoint belongs to a point");
    }
}

#[test]
fn depth_maps_agree_with_rays_and_with_points() {
    for name in names() {
        let dataset = small(name, 2);
        let photo = &dataset.photos[1];
        let view = &photo.view;
        let scene = dataset.scene_of(photo);
        let depth = render_depth(&scene, view);
        for row in (0..view.height).step_by(7) {
            for column in (0..view.width).step_by(7) {
                let found = depth[(row * view.width + column) as usize];
                let ray = view.lens.unproject(Pixel::center_of(column, row)).unwrap();
                let direction = view.camera_from_world.rotation.conjugate() * ray;
                let Some(hit) = scene.trace(view.center(), direction) else {
                    assert!(dataset.matte && found.is_nan());
                    continue;
                };
                let expected = (view.camera_from_world * hit.point).z;
                assert!(
                    (found - expected).abs() < 1e-12,
                    "{name} at {column}, {row}"
                );
                let back = view.project(hit.point).unwrap();
                assert!(back.distance(Pixel::center_of(column, row)) < 1e-9);
            }
        }
        // A sparse point lies on the surface that the map has around its keypoint.
        let image = reconstruction_image(&dataset, &photo.name);
        let mut near = 0;
        for keypoint in &image.keypoints {
            let point = &dataset.reconstruction.points[&keypoint.point.unwrap()];
            let z = (view.camera_from_world * point.position).z;
            let (column, row) = (
                (keypoint.x as u32).min(view.width - 1),
                (keypoint.y as u32).min(view.height - 1),
            );
            // Seen from aside, a wall's depth changes much from pixel to pixel.
            let around = |x: u32, last: u32| x.saturating_sub(1)..=(x + 1).min(last);
            let (mut least, mut most) = (f64::INFINITY, 0.0_f64);
            for row in around(row, view.height - 1) {
                for column in around(column, view.width - 1) {
                    let found = depth[(row * view.width + column) as usize];
                    (least, most) = (least.min(found), most.max(found));
                }
            }
            near += usize::from((0.99 * least..1.01 * most).contains(&z));
        }
        // All but those within half a pixel of a silhouette: the car has many.
        let share = if dataset.matte { 88 } else { 93 };
        let all = image.keypoints.len();
        assert!(near * 100 > all * share, "{name}: {near} of {all}");
    }
}

fn reconstruction_image<'a>(dataset: &'a Dataset, name: &str) -> &'a calibrate::Image {
    let mut images = dataset.reconstruction.images.values();
    images.find(|image| image.name == name).unwrap()
}

#[test]
fn every_photo_is_full_and_shows_what_rays_find() {
    for name in names() {
        let dataset = small(name, 3);
        let photo = &dataset.photos[2];
        let (view, scene) = (&photo.view, dataset.scene_of(photo));
        let picture = render_view(&scene, view, 1);
        for (column, row, rgba) in picture.enumerate_pixels() {
            if dataset.matte && rgba.0[3] == 0 {
                continue;
            }
            assert_eq!(rgba.0[3], 255, "{name} at {column}, {row}");
            if (column + row) % 5 != 0 {
                continue;
            }
            let ray = view.lens.unproject(Pixel::center_of(column, row)).unwrap();
            let direction = view.camera_from_world.rotation.conjugate() * ray;
            let hit = scene.trace(view.center(), direction).unwrap();
            let expected = srgb_from_linear(hit.color);
            for (found, expected) in rgba.0.iter().zip(expected) {
                assert!(found.abs_diff(expected) <= 1, "{name} at {column}, {row}");
            }
        }
    }
}

/// The light at a place is the same from everywhere on what is matte, and is not on what
/// is glossy.
#[test]
fn highlights_move_with_the_viewer_and_nothing_else_does() {
    let dataset = small("shelf", 20);
    let views: Vec<_> = dataset.photos.iter().map(|photo| &photo.view).collect();
    let (mut matte, mut most) = (0, 0.0_f64);
    for point in dataset.reconstruction.points.values() {
        let colors: Vec<(DVec3, usize)> = point
            .track
            .iter()
            .map(|(image_id, _)| {
                let center = views[image_id.0 as usize - 1].center();
                let hit = dataset.scene.trace(center, point.position - center);
                let hit = hit.unwrap();
                (DVec3::from_array(hit.color), hit.object_idx)
            })
            .collect();
        let change = colors
            .iter()
            .map(|(color, _)| (*color - colors[0].0).abs().max_element())
            .fold(0.0, f64::max);
        match dataset.scene.objects()[colors[0].1].material.finish {
            // Shadows are counted at points: rounding may hide one more or less.
            Finish::Flat | Finish::Matte => {
                assert!(change < 0.07, "{change} at {}", point.position);
                matte += usize::from(change < 1e-6);
            }
            Finish::Glossy { .. } => most = most.max(change),
        }
    }
    assert!(matte > 1000, "{matte} points look the same from everywhere");
    assert!(most > 0.2, "the brightest change is {most}");
}

#[test]
fn the_same_bytes_come_from_any_number_of_threads() {
    let dataset = small("shelf", 2);
    let view = &dataset.photos[0].view;
    let with_threads = |count| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(count)
            .build()
            .unwrap();
        pool.install(|| render_view(&dataset.scene, view, 2).into_raw())
    };
    let one = with_threads(1);
    assert_eq!(one, with_threads(2));
    assert_eq!(one, with_threads(3));
    let again = small("shelf", 2);
    assert_eq!(again.reconstruction, dataset.reconstruction);
    assert_eq!(one, render_view(&again.scene, view, 2).into_raw());
}

#[test]
fn what_is_written_reads_back_equal() {
    let folder = tempfile::tempdir().unwrap();
    for name in names() {
        let dataset = small(name, 9);
        let destination = folder.path().join(name);
        let written = write(&dataset, &destination).unwrap();
        assert_eq!((written.photos, written.held_out), (9, 2));
        let model = calibrate::colmap::read_model(&destination.join("sparse/0")).unwrap();
        assert_eq!(model, dataset.reconstruction);

        let photo = &dataset.photos[8];
        let picture = image::open(destination.join("images/0008.png")).unwrap();
        let rendered = render_view(&dataset.scene_of(photo), &photo.view, 2);
        assert_eq!(picture.color().has_alpha(), dataset.matte);
        assert_eq!(picture.to_rgba8(), rendered);

        let steps = image::open(destination.join("depth/0008.png")).unwrap();
        let steps = steps.as_luma16().expect("16 bits").as_raw();
        let depth = render_depth(&dataset.scene_of(photo), &photo.view);
        for (&steps, depth) in steps.iter().zip(depth) {
            let depth = if depth.is_nan() { 0.0 } else { depth };
            let error = f64::from(steps) / DEPTH_STEPS_PER_UNIT - depth;
            assert!(error.abs() <= 0.5001 / DEPTH_STEPS_PER_UNIT);
        }
        let split = std::fs::read_to_string(destination.join("split.json")).unwrap();
        assert_eq!(
            split,
            "{\n \"test\": [\n  \"0000.png\",\n  \"0008.png\"\n ]\n}\n"
        );
        let readme = std::fs::read_to_string(destination.join("README.md")).unwrap();
        assert!(readme.contains("9 images of 160 x 120"), "{readme}");
        let mut listed = files(&dataset);
        listed.sort();
        assert_eq!(listed, all_below(&destination, Path::new("")));
    }
    // Nothing else was left.
    assert_eq!(
        std::fs::read_dir(folder.path()).unwrap().count(),
        names().len()
    );
}

/// All files in a folder within another, and in those within it, by path from that other one, sorted.
fn all_below(folder: &Path, within: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder.join(within)).unwrap() {
        let path = within.join(entry.unwrap().file_name());
        match folder.join(&path).is_dir() {
            true => found.extend(all_below(folder, &path)),
            false => found.push(path),
        }
    }
    found.sort();
    found
}

#[test]
fn a_folder_that_holds_something_is_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    let dataset = small("wall", 2);
    std::fs::write(folder.path().join("precious.txt"), "mine").unwrap();
    let error = write(&dataset, folder.path()).unwrap_err();
    assert!(matches!(error, DatasetError::NotEmpty { .. }));
    assert_eq!(
        error.to_string(),
        format!(
            "{}: the folder is not empty; choose another or remove it first",
            folder.path().display()
        )
    );
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    // An empty one will do.
    let empty = tempfile::tempdir().unwrap();
    write(&dataset, empty.path()).unwrap();
    assert!(empty.path().join("sparse/0/cameras.bin").exists());
}

#[test]
fn mistakes_are_told() {
    let error = by_name("shelv", &Options::default()).unwrap_err();
    assert_eq!(
        error.to_string(),
        "no dataset is called \"shelv\"; there are: shelf, wall, helicopter, knick-knacks, \
         hallway, car, house, survey"
    );
    let one_view = Options {
        views: Some(1),
        ..Options::default()
    };
    assert_eq!(
        by_name("wall", &one_view).unwrap_err().to_string(),
        "the number of photos is 1; expected 2 to 9999"
    );
}

/// After a whole turn all is as it was, and not before; the sparse points never move.
#[test]
fn what_moves_repeats_and_carries_no_points() {
    let dataset = small("helicopter", 9);
    let motion = dataset.motion.as_ref().unwrap();
    let view = &dataset.photos[3].view;
    let at = |time_s: f64| render_depth(&motion.scene_at(&dataset.scene, time_s), view);
    let off = |a: &[f64], b: &[f64]| {
        let apart = a.iter().zip(b).filter(|(a, b)| (**a - **b).abs() > 1e-6);
        apart.count()
    };
    let start = at(0.3);
    assert!(off(&start, &at(0.3 + 2.0 * motion.period_s)) < 5);
    assert!(off(&start, &at(0.3 + 0.5 * motion.period_s)) > 300);
    for point in dataset.reconstruction.points.values() {
        for (image_id, _) in &point.track {
            let photo = &dataset.photos[image_id.0 as usize - 1];
            let center = photo.view.center();
            let hit = dataset
                .scene_of(photo)
                .trace(center, point.position - center);
            assert!(!motion.moves(hit.unwrap().object_idx));
        }
    }
    let folder = tempfile::tempdir().unwrap();
    write(&dataset, &folder.path().join("h")).unwrap();
    let times = std::fs::read_to_string(folder.path().join("h/times.csv")).unwrap();
    assert!(
        times.starts_with("name,seconds\n0000.png,0\n0001.png,0.2\n"),
        "{times}"
    );
    assert_eq!(times.lines().count(), 10);
}

/// The car's cameras lie on a perfect circle and look at one point of its axis; every photo
/// shows the whole car, and its points lie on it.
#[test]
fn the_car_is_whole_in_every_photo_of_a_circle() {
    let car = small("car", 12);
    let centers: Vec<DVec3> = car.photos.iter().map(|p| p.view.center()).collect();
    let mean = centers.iter().sum::<DVec3>() / centers.len() as f64;
    for (photo, center) in car.photos.iter().zip(&centers) {
        assert!((center.distance(mean) - centers[0].distance(mean)).abs() < 1e-12);
        assert!((center.y - mean.y).abs() < 1e-12);
        let to_axis = (mean.with_y(0.05) - center).normalize();
        assert!((photo.view.forward() - to_axis).length() < 1e-12);
        let picture = render_view(&car.scene, &photo.view, 2);
        let (width, height) = picture.dimensions();
        let covered = picture.pixels().filter(|p| p.0[3] > 127).count();
        let share = covered as f64 / f64::from(width * height);
        assert!((0.05..0.5).contains(&share), "{}: {share}", photo.name);
        for (column, row, rgba) in picture.enumerate_pixels() {
            let border = column == 0 || row == 0 || column + 1 == width || row + 1 == height;
            assert!(!border || rgba.0[3] == 0, "{}", photo.name);
        }
    }
    for point in car.reconstruction.points.values() {
        assert!(car.scene.distance_to(point.position) < 1e-12);
    }
    assert!((car.scene.distance_to(DVec3::new(0.0, 1.113, 0.0)) - 1.0).abs() < 0.01);
    assert_eq!(car.scene.distance_to(DVec3::new(0.0, 0.05, 0.0)), 0.0);
}

/// A plane proxy is exact on the wall, and fair on the shelf.
#[test]
fn depth_stays_within_its_promised_range() {
    let wall = small("wall", 9);
    let frame = wall.scene.objects()[0].world_from_shape.inverse();
    for point in wall.reconstruction.points.values() {
        assert!((frame * point.position).z.abs() < 1e-12);
    }
    let shelf = small("shelf", 20);
    let mut furthest = 0.0_f64;
    for photo in &shelf.photos {
        let depth = render_depth(&shelf.scene, &photo.view);
        let mean = depth.iter().sum::<f64>() / depth.len() as f64;
        let off = depth.iter().map(|depth| (depth / mean - 1.0).abs());
        furthest = furthest.max(off.fold(0.0, f64::max));
    }
    assert!(
        furthest < 0.15,
        "depth is up to {furthest} of its mean away"
    );
}
