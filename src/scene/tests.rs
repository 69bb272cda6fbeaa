//! Small captures imported: which files the names in a calibration lead to.

use super::{ImportOptions, Scene, SceneError};
use calibrate::{Camera, CameraId, Image, ImageId, ModelKind, Reconstruction, Rigid3, colmap};
use image::RgbImage;
use std::fs;
use std::path::PathBuf;
use tempfile::TempDir;

const SIZE: (u32, u32) = (8, 6);

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
