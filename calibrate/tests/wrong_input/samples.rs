//! A small whole file of each format; the fuzz targets begin from the same ones.

use calibrate::opencv::{self, FileStorage, Keys};
use calibrate::{Reconstruction, colmap, formats};
use std::path::Path;

const COLMAP: [&str; 3] = [
    "1 SIMPLE_RADIAL 100 80 90 50 40 -0.1\n# comment\n7 PINHOLE 64 48 60 61 32 24\n",
    "1 1 0 0 0 0 0 0 1 a.jpg\n55 40 3 10 20 -1\n\
     2 0.7071067811865476 0 0.7071067811865476 0 -1 0.5 2 7 dir\\b c.jpg\n32 24 3\n",
    "3 1 0 10 1 2 255 0.5 1 0 2 0\n",
];
const RIG: &str = r#"{
  "M1": [[500,0,320],[0,500,240],[0,0,1]], "D1": [0,0,0,0,0],
  "M2": [[500,0,320],[0,500,240],[0,0,1]], "D2": [0,0,0,0,0],
  "R": [[1,0,0],[0,1,0],[0,0,1]],
  "T": [-0.1, 0, 0]
}
"#;

/// A file of a format; of COLMAP's and Bundler's the others stay as they are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Sample {
    Cameras,
    Images,
    Points,
    Nvm,
    NvmFixed,
    Bundler,
    Transforms,
    Meshroom,
    OpenMvg,
    Yaml,
    Xml,
    Json,
    JsonRig,
}

use Sample::*;

macro_rules! seed {
    ($name:literal) => {
        include_str!(concat!("../../../fuzz/seeds/", $name))
    };
}

impl Sample {
    pub(crate) const ALL: [Sample; 13] = [
        Cameras, Images, Points, Nvm, NvmFixed, Bundler, Transforms, Meshroom, OpenMvg, Yaml, Xml,
        Json, JsonRig,
    ];

    pub(crate) fn file(self) -> &'static str {
        match self {
            Cameras => "cameras.txt",
            Images => "images.txt",
            Points => "points3D.txt",
            Nvm | NvmFixed => "model.nvm",
            Bundler => "bundle.out",
            Transforms => "transforms.json",
            Meshroom => "cameras.sfm",
            OpenMvg => "sfm_data.json",
            Yaml => "camera.yml",
            Xml => "camera.xml",
            Json => "camera.json",
            JsonRig => "rig.json",
        }
    }

    pub(crate) fn text(self) -> String {
        match self {
            Cameras => COLMAP[0].to_owned(),
            Images => COLMAP[1].to_owned(),
            Points => COLMAP[2].to_owned(),
            Nvm => seed!("nvm/own").to_owned(),
            NvmFixed => seed!("nvm/fixed").to_owned(),
            Bundler => bundle().1.to_owned(),
            Transforms => seed!("transforms/own").to_owned(),
            Meshroom => seed!("meshroom/own").to_owned(),
            OpenMvg => seed!("openmvg/own").to_owned(),
            Yaml => seed!("opencv_yaml/own").to_owned(),
            Xml => format!(
                "<?xml version=\"1.0\"?>\n<opencv_storage>\n{}",
                seed!("opencv_xml/own")
            ),
            Json => format!("{{{}", seed!("opencv_json/own")),
            JsonRig => RIG.to_owned(),
        }
    }
}

/// Bundler's list and model.
fn bundle() -> (&'static str, &'static str) {
    seed!("bundler/own")
        .split_once('\0')
        .expect("a list and a model")
}

/// Reads a sample with the first `from` replaced.
pub(crate) fn read(sample: Sample, from: &str, to: &str) -> Result<Reconstruction, String> {
    let text = sample.text();
    assert!(text.contains(from), "{sample:?} lacks {from:?}");
    parse(sample, text.replacen(from, to, 1).as_bytes())
}

/// Reads the content of a sample's file.
pub(crate) fn parse(sample: Sample, bytes: &[u8]) -> Result<Reconstruction, String> {
    let path = Path::new(sample.file());
    let size_of = |_: &str| Some((100, 80));
    let whole = match sample {
        Cameras | Images | Points => {
            let mut files = COLMAP.map(str::as_bytes);
            files[sample as usize] = bytes;
            return colmap::parse_text(Path::new("model"), files).map_err(|e| e.to_string());
        }
        Nvm | NvmFixed => formats::parse_nvm(path, bytes, &size_of, &mut Vec::new()),
        Bundler => {
            let list = (Path::new("list.txt"), bundle().0.as_bytes());
            formats::parse_bundler(path, bytes, list, &size_of)
        }
        Transforms => formats::parse_transforms(path, bytes, &size_of),
        Meshroom => formats::parse_meshroom(path, bytes),
        OpenMvg => formats::parse_openmvg(path, bytes),
        Yaml | Xml | Json | JsonRig => {
            let storage = FileStorage::parse(path, bytes).map_err(|e| e.to_string())?;
            let read = opencv::calibration(path, &storage, &Keys::default());
            let calibration = read.map_err(|e| e.to_string())?;
            let count = calibration.photo_poses().len();
            let names: Vec<String> = (0..count).map(|i| format!("{i}.jpg")).collect();
            return Ok(calibration.reconstruction(&names, (640, 480)));
        }
    };
    whole.map_err(|e| e.to_string())
}
