//! Small captures imported: which files the names in a calibration lead to.

use super::{ImportOptions, Scene, SceneError, calibration_in};
use calibrate::{Camera, CameraId, Image, ImageId, ModelKind, Reconstruction, Rigid3, colmap};
use image::{GrayImage, Luma, RgbImage};
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

const SIZE: (u32, u32) = (8, 6);

/// A capture of a wall in photos of 64 × 48, and the folder that it lies in.
pub(super) fn wall(views: usize, samples_per_side: u32) -> (TempDir, PathBuf) {
    let options = datasets::Options {
        size: Some((64, 48)),
        views: Some(views),
        samples_per_side: Some(samples_per_side),
    };
    let folder = tempfile::tempdir().unwrap();
    let capture = folder.path().join("wall");
    let made = datasets::by_name("wall", &options).unwrap();
    datasets::write(&made, &capture).unwrap();
    (folder, capture)
}

/// A folder to put captures together in.
struct Captures(TempDir);

impl Captures {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn at(&self, path: &str) -> PathBuf {
        self.0.path().join(path)
    }

    /// Makes the folder around a file.
    fn room_for(&self, path: &str) -> PathBuf {
        let path = self.at(path);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        path
    }

    fn photos(&self, folder: &str, names: &[&str], (width, height): (u32, u32)) {
        for name in names {
            let path = self.room_for(&format!("{folder}/{name}"));
            RgbImage::new(width, height).save(path).unwrap();
        }
    }

    /// Saves a model of photos that are [`SIZE`] large.
    fn model(&self, place: &str, names: &[&str]) {
        let id = CameraId(1);
        let camera = Camera {
            model: ModelKind::SimplePinhole,
            width: SIZE.0,
            height: SIZE.1,
            params: vec![8.0, 4.0, 3.0],
        };
        let image = |(i, name): (u32, &&str)| {
            let image = Image {
                name: (*name).to_owned(),
                camera_id: id,
                camera_from_world: Rigid3::IDENTITY,
                keypoints: Vec::new(),
            };
            (ImageId(i), image)
        };
        let model = Reconstruction {
            cameras: [(id, camera)].into(),
            images: (1..).zip(names).map(image).collect(),
            ..Reconstruction::default()
        };
        colmap::write_text(&model, &self.at(place)).unwrap();
    }

    /// Saves a transforms.json of frames that have these keys beside their poses.
    fn transforms(&self, path: &str, keys: &[String]) {
        let pose = "[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]";
        let frames = keys.iter();
        let frames = frames.map(|keys| format!("{{{keys}, \"transform_matrix\": {pose}}}"));
        let frames: Vec<String> = frames.collect();
        let text = format!("{{\"fl_x\": 8, \"frames\": [{}]}}", frames.join(", "));
        fs::write(self.room_for(path), text).unwrap();
    }

    /// Imports one of them, with what is said of it.
    fn try_import(&self, capture: &str) -> Result<(Scene, Vec<String>), SceneError> {
        let (scene, warnings) = Scene::import(&self.at(capture), &ImportOptions::default())?;
        let root = self.0.path().display().to_string();
        let texts = warnings
            .iter()
            .map(|w| w.to_string().replace(&root, "ROOT"));
        Ok((scene, texts.collect()))
    }

    fn import(&self, capture: &str) -> (Scene, Vec<String>) {
        self.try_import(capture).unwrap()
    }
}

#[test]
fn names_may_begin_in_a_folder_around_the_photos() {
    let captures = Captures::new();
    captures.photos("wall/images", &["a.png", "b.png"], SIZE);
    for around in ["images", "wall/images"] {
        let names = ["a", "b", "c"].map(|name| format!("{around}/{name}.png"));
        captures.model("wall/sparse/0", &names.each_ref().map(String::as_str));
        let (scene, said) = captures.import("wall");
        assert_eq!(scene.names(), ["a.png", "b.png"]);
        assert_eq!(scene.left_out, ["c.png"]);
        assert_eq!(said.len(), 1, "{said:?}");
    }
    // Of folders elsewhere nothing is known.
    captures.model("wall/sparse/0", &["pictures/a.png", "pictures/b.png"]);
    let error = captures.try_import("wall").unwrap_err().to_string();
    assert!(
        error.contains("a.png is called so in another folder"),
        "{error}"
    );
}

#[test]
fn photos_in_a_folder_of_another_name_are_told_how_to_be_found() {
    let captures = Captures::new();
    let names = ["a.png", "b.png", "c.png"];
    captures.photos("wall/Images", &names[..2], SIZE);
    captures.model("wall/sparse/0", &names);
    let error = || captures.try_import("wall").unwrap_err().to_string();
    let error = || error().replace(&captures.at("").display().to_string(), "");
    let said = "Images/a.png is called so in another folder, as 2 of 3 are: rename wall/Images to wall/images, \
                or `lumigraph import wall/Images --calibration wall/sparse/0 -o SCENE`; ";
    assert!(error().contains(said), "{}", error());

    // Either does.
    let options = ImportOptions {
        calibration: Some(captures.at("wall/sparse/0")),
        ..ImportOptions::default()
    };
    let (scene, _) = Scene::import(&captures.at("wall/Images"), &options).unwrap();
    assert_eq!(scene.names(), names[..2]);
    fs::rename(captures.at("wall/Images"), captures.at("wall/images")).unwrap();
    assert_eq!(captures.import("wall").0.names(), names[..2]);

    // Within a folder of the right name only the latter would.
    fs::rename(captures.at("wall/images"), captures.at("wall/all")).unwrap();
    fs::create_dir(captures.at("wall/images")).unwrap();
    fs::rename(captures.at("wall/all"), captures.at("wall/images/all")).unwrap();
    let said = "as 2 of 3 are: `lumigraph import wall/images/all --calibration";
    assert!(error().contains(said), "{}", error());
    // As a shell takes it.
    fs::rename(
        captures.at("wall/images/all"),
        captures.at("wall/images/cam 1"),
    )
    .unwrap();
    let said = "`lumigraph import 'wall/images/cam 1' --calibration wall/sparse/0 -o SCENE`";
    assert!(error().contains(said), "{}", error());

    // Of two folders nobody knows which is meant.
    captures.photos("wall/images/small", &names[..2], SIZE);
    let said = "in another folder: names in a calibration begin";
    assert!(error().contains(said), "{}", error());
}

#[test]
fn names_may_lead_past_other_folders_to_photos_that_are_missing() {
    let captures = Captures::new();
    captures.photos("wall/images", &["a.png", "late/b.png"], SIZE);
    let ways = ["../images/a.png", "./late/b.png", "../images/late/../c.png"];
    captures.model("wall/sparse/0", &[ways[0], ways[1], ways[2], "../d.png"]);
    let (scene, _) = captures.import("wall");
    assert_eq!(scene.names(), ["a.png", "late/b.png"]);
    assert_eq!(scene.left_out, ["../d.png", "c.png"]);

    // So it is where something else calls them so.
    let mut names = [ways[2], ways[0], "../d.png", "x.png"].map(str::to_owned);
    scene.name_as_photos(&mut names.each_mut());
    assert_eq!(names, ["c.png", "a.png", "../d.png", "x.png"]);
    // Undistorted photos lie in their scene.
    let mut flat = scene;
    flat.settings.undistorted = true;
    flat.photos.clear();
    let mut name = ways[0].to_owned();
    flat.name_as_photos(&mut [&mut name]);
    assert_eq!(name, "a.png");
}

#[test]
fn photos_that_colmap_undistorted_are_those_of_the_model_beside_them() {
    let captures = Captures::new();
    let names = ["a.png", "b.png"];
    // Its own size, so that others would be refused.
    captures.photos("wall/dense/images", &names, SIZE);
    captures.model("wall/dense/sparse", &names);
    let folder_of = |scene: &Scene| {
        let folder = scene.photos[0].path.parent().unwrap();
        let folder = folder.strip_prefix(captures.at("wall")).unwrap();
        folder.to_owned()
    };
    for capture in ["wall", "wall/dense"] {
        let (scene, said) = captures.import(capture);
        assert_eq!(folder_of(&scene), Path::new("dense/images"));
        assert!(said.is_empty(), "{said:?}");
    }

    // What lies beside the originals is not theirs.
    captures.photos("wall/images", &names, (9, 7));
    captures.photos("wall/masks", &names, (9, 7));
    let (scene, said) = captures.import("wall");
    assert_eq!(folder_of(&scene), Path::new("dense/images"));
    let note = "the photos are those in ROOT/wall/dense/images, beside their COLMAP model; not used: \
                ROOT/wall/images, ROOT/wall/masks";
    assert_eq!(said, [note]);

    // Those that are given are used, aloud.
    captures.photos("others", &names, SIZE);
    let options = ImportOptions {
        calibration: Some(captures.at("wall/dense")),
        ..ImportOptions::default()
    };
    let (scene, warnings) = Scene::import(&captures.at("others"), &options).unwrap();
    assert_eq!(scene.photos[0].path, captures.at("others/a.png"));
    let said = warnings[0].to_string();
    assert!(
        said.contains("and may be of those: `lumigraph import "),
        "{said}"
    );

    // Of each model's photos in a numbered folder.
    captures.model("wall/dense/3/sparse", &names);
    captures.photos("wall/dense/3/images", &names, SIZE);
    fs::remove_dir_all(captures.at("wall/dense/sparse")).unwrap();
    for capture in ["wall", "wall/dense", "wall/dense/3"] {
        let (scene, _) = captures.import(capture);
        assert_eq!(folder_of(&scene), Path::new("dense/3/images"));
    }

    // A model of the photos as they were goes first.
    captures.model("wall/sparse/0", &names);
    let error = captures.try_import("wall").unwrap_err().to_string();
    assert!(error.contains("wall/images/a.png"), "{error}");
}

#[test]
fn photos_called_otherwise_keep_what_is_called_like_their_files() {
    let captures = Captures::new();
    captures.photos("wall/images", &["a.png", "b.png"], SIZE);
    captures.model("wall/sparse/0", &["a.jpg", "b.jpg"]);
    let times = |text: &str| fs::write(captures.at("wall/times.csv"), text).unwrap();
    let masks_of = |scene: &Scene| -> Vec<PathBuf> {
        let masks = scene.photos.iter().filter_map(|p| p.ignore_mask.as_ref());
        let name = |mask: &PathBuf| PathBuf::from(mask.file_name().unwrap());
        masks.map(name).collect()
    };
    let times_of =
        |scene: &Scene| -> Vec<Option<f64>> { scene.photos.iter().map(|p| p.time_s).collect() };

    // Like the files; one that is like the calibration's name goes first.
    for name in ["a.png.png", "b.png.png", "b.jpg.png"] {
        let path = captures.room_for(&format!("wall/masks/{name}"));
        GrayImage::from_pixel(SIZE.0, SIZE.1, Luma([255]))
            .save(path)
            .unwrap();
    }
    times("a.png,3\nb.jpg,5\n");
    let (scene, said) = captures.import("wall");
    assert_eq!(
        masks_of(&scene),
        ["a.png.png", "b.jpg.png"].map(PathBuf::from)
    );
    assert_eq!(times_of(&scene), [Some(3.0), Some(5.0)]);
    assert!(
        said[0].contains("2 of 2 photos are used though"),
        "{said:?}"
    );
    let astray = "ROOT/wall/masks: 1 files belong to no calibrated photo (b.png.png, for one)";
    assert_eq!(said[1..], [astray]);

    // Without the photo's own extension either name is the same.
    fs::remove_dir_all(captures.at("wall/masks")).unwrap();
    fs::remove_file(captures.at("wall/times.csv")).unwrap();
    let path = captures.room_for("wall/masks/a.png");
    GrayImage::from_pixel(SIZE.0, SIZE.1, Luma([255]))
        .save(path)
        .unwrap();
    let (scene, said) = captures.import("wall");
    assert_eq!(masks_of(&scene), [PathBuf::from("a.png")]);
    assert_eq!(
        said[1..],
        ["ROOT/wall/masks: 1 of 2 photos have their ignore mask here"]
    );
}

#[test]
fn times_that_only_some_photos_have_are_told() {
    let captures = Captures::new();
    let names = ["20240131_154500.png", "20240131_154502.png", "c.png"];
    captures.photos("wall", &names, SIZE);
    captures.model("wall/sparse/0", &names);
    let (scene, said) = captures.import("wall");
    let times: Vec<Option<f64>> = scene.photos.iter().map(|p| p.time_s).collect();
    assert_eq!(times, [Some(0.0), Some(2.0), None]);
    let note = "the photos' names: no time for 1 of 3 photos (c.png, for one): in views at a moment \
                they take no part";
    assert_eq!(said, [note]);

    // None at all is no news.
    captures.photos("shelf", &["a.png", "b.png"], SIZE);
    captures.model("shelf/sparse/0", &["a.png", "b.png"]);
    let (_, said) = captures.import("shelf");
    assert!(said.is_empty(), "{said:?}");
}

#[test]
fn times_of_frames_are_read() {
    let captures = Captures::new();
    captures.photos("wall/train", &["a.png", "b.png", "c.png"], SIZE);
    let frames = |times: [&str; 3]| {
        let frames = ["a", "b", "c"].into_iter().zip(times);
        let frames = frames
            .map(|(name, time)| format!("\"file_path\": \"./train/{name}\", \"time\": {time}"));
        let frames: Vec<String> = frames.collect();
        captures.transforms("wall/transforms_train.json", &frames);
    };
    let times_of =
        |scene: &Scene| -> Vec<Option<f64>> { scene.photos.iter().map(|p| p.time_s).collect() };

    frames(["0", "0.5", "null"]);
    let (scene, said) = captures.import("wall");
    assert_eq!(times_of(&scene), [Some(0.0), Some(0.5), None]);
    let file = "ROOT/wall/transforms_train.json";
    assert_eq!(
        said,
        [
            format!("{file} names times of the photos, from 0 to 0.5, which are taken as seconds"),
            format!(
                "{file}: no time for 1 of 3 photos (train/c.png, for one): in views at a moment they \
                 take no part"
            ),
        ]
    );

    // A list says more, and one time for all says nothing.
    fs::write(captures.at("wall/times.csv"), "train/c.png,7\n").unwrap();
    let (scene, _) = captures.import("wall");
    assert_eq!(times_of(&scene), [None, None, Some(7.0)]);
    fs::remove_file(captures.at("wall/times.csv")).unwrap();
    frames(["0", "0", "0"]);
    let (scene, said) = captures.import("wall");
    assert_eq!(times_of(&scene), [None; 3]);
    assert!(said.is_empty(), "{said:?}");
}

#[test]
fn of_a_data_set_s_parts_that_to_train_on_goes_first() {
    let captures = Captures::new();
    let frames = |part: &str| ["a", "b"].map(|name| format!("\"file_path\": \"./{part}/{name}\""));
    for part in ["test", "train", "val"] {
        captures.photos(&format!("wall/{part}"), &["a.png", "b.png"], SIZE);
        captures.transforms(&format!("wall/transforms_{part}.json"), &frames(part));
    }
    let (scene, said) = captures.import("wall");
    assert_eq!(scene.names(), ["train/a.png", "train/b.png"]);
    let note = "the calibration is ROOT/wall/transforms_train.json; `lumigraph import ROOT/wall --calibration PATH -o \
                SCENE` takes another: ROOT/wall/transforms_test.json, ROOT/wall/transforms_val.json";
    assert_eq!(said[0], note);
    let first = calibration_in(&captures.at("wall"));
    assert_eq!(first, Some(captures.at("wall/transforms_train.json")));

    captures.transforms("wall/transforms.json", &frames("val"));
    let (scene, _) = captures.import("wall");
    assert_eq!(scene.names(), ["val/a.png", "val/b.png"]);
}

#[test]
fn models_of_colmap_in_other_places_are_told() {
    let captures = Captures::new();
    captures.photos("wall/images", &["a.png", "b.png"], SIZE);
    captures.model("wall/sparse/0", &["a.png", "b.png"]);
    captures.model("wall/model", &["a.png"]);
    let (scene, said) = captures.import("wall");
    assert_eq!(scene.names(), ["a.png", "b.png"]);
    let note = "the calibration is the COLMAP model in ROOT/wall/sparse/0; `lumigraph import ROOT/wall --calibration \
                ROOT/wall/model -o SCENE` takes that in ROOT/wall/model";
    assert_eq!(said, [note]);
}

/// As nerfstudio's `ns-process-data` leaves it.
#[test]
fn colmap_s_work_for_another_program_is_used_where_that_left_nothing() {
    let captures = Captures::new();
    captures.photos("wall/images", &["a.png", "b.png"], SIZE);
    captures.model("wall/colmap/sparse/0", &["a.png", "b.png"]);
    let (scene, said) = captures.import("wall");
    assert_eq!(scene.names(), ["a.png", "b.png"]);
    assert!(said.is_empty(), "{said:?}");
    let first = || calibration_in(&captures.at("wall"));
    assert_eq!(first(), Some(captures.at("wall/colmap/sparse/0")));

    let frames = ["a", "b"].map(|name| format!("\"file_path\": \"images/{name}.png\""));
    captures.transforms("wall/transforms.json", &frames);
    let (scene, said) = captures.import("wall");
    assert_eq!(scene.names(), ["a.png", "b.png"]);
    let note = "the calibration is ROOT/wall/transforms.json; `lumigraph import ROOT/wall --calibration \
                ROOT/wall/colmap/sparse/0 -o SCENE` takes that in ROOT/wall/colmap/sparse/0 (the COLMAP model in \
                ROOT/wall/colmap/sparse/0 may have sparse points, which this has not)";
    assert_eq!(said, [note]);
    assert_eq!(first(), Some(captures.at("wall/transforms.json")));
}
