//! Writes inputs to begin from into `corpus/TARGET/`: small ones made here, and what a
//! folder of captures holds, models cut down to a few photos and points.
//!
//! `cargo run --no-default-features --example seeds [-- CAPTURES]`, in this folder.

use calibrate::{Reconstruction, colmap, formats, opencv};
use lumigraph_fuzz::{joined, model};
use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// Larger files slow the search down more than they help it.
const LARGEST: u64 = 100_000;

fn main() -> io::Result<()> {
    let corpus = Corpus(PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("corpus"));
    corpus.own()?;
    match std::env::args_os().nth(1) {
        Some(captures) => corpus.captures(Path::new(&captures)),
        None => Ok(()),
    }
}

/// The folder of the targets' inputs.
struct Corpus(PathBuf);

impl Corpus {
    fn add(&self, target: &str, name: &str, bytes: &[u8]) -> io::Result<()> {
        let folder = self.0.join(target);
        fs::create_dir_all(&folder)?;
        fs::write(folder.join(name), bytes)
    }

    /// What cannot be written down as text.
    fn own(&self) -> io::Result<()> {
        self.model(
            "own",
            model::binary().each_ref().map(Vec::as_slice),
            "binary",
        )?;
        self.model("own", model::TEXT.map(str::as_bytes), "text")?;
        let header = "{'descr': '<f8', 'fortran_order': False, 'shape': (1, 17), }\n";
        let row = [
            0., 1., 0., 7., 80., 1., 0., 0., 8., 100., 0., 0., 1., 9., 90., 0.5, 5.0_f64,
        ];
        let mut array = b"\x01\x93NUMPY\x01\x00".to_vec();
        array.extend((header.len() as u16).to_le_bytes());
        array.extend(header.as_bytes());
        array.extend(row.iter().flat_map(|number| number.to_le_bytes()));
        self.add("llff", "own", &array)?;
        self.add("detect", "own-llff", &array[1..])?;
        for (model, camera) in calibrate::ModelKind::ALL.iter().enumerate() {
            let mut numbers: Vec<f64> = camera
                .parameter_names()
                .iter()
                .map(|name| match *name {
                    "f" | "fx" | "fy" => 500.0,
                    "cx" | "w" => 320.0,
                    "cy" | "h" => 240.0,
                    _ => 0.01,
                })
                .collect();
            numbers.extend([0.1, -0.2, 1.0, 300.0, 200.0]);
            let mut bytes = vec![model as u8];
            bytes.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
            self.add("lens", camera.name(), &bytes)?;
        }
        let picture = image::RgbaImage::from_fn(9, 7, |x, y| {
            image::Rgba([x as u8 * 20, y as u8 * 30, 5, 200])
        });
        let picture = image::DynamicImage::from(picture);
        for (name, picture, format) in [
            ("own.png", picture.clone(), image::ImageFormat::Png),
            (
                "own-16.png",
                picture.to_luma16().into(),
                image::ImageFormat::Png,
            ),
            (
                "own.jpg",
                picture.to_rgb8().into(),
                image::ImageFormat::Jpeg,
            ),
            (
                "own-grey.jpg",
                picture.to_luma8().into(),
                image::ImageFormat::Jpeg,
            ),
        ] {
            let mut bytes = io::Cursor::new(Vec::new());
            image::DynamicImage::write_to(&picture, &mut bytes, format)
                .map_err(io::Error::other)?;
            self.add("photo", name, bytes.get_ref())?;
        }
        let plane = proxy::Plane::new(glam::DVec3::Z, glam::DVec3::Z).map_err(io::Error::other)?;
        let file = std::env::temp_dir().join(format!("lumigraph-fuzz-{}.glb", std::process::id()));
        proxy::write(&file, &proxy::Proxy::Plane(plane), &[], &[]).map_err(io::Error::other)?;
        self.add("proxy_glb", "own", &fs::read(&file)?)?;
        fs::remove_file(file)?;
        let square = proxy::Mesh {
            positions: [(0, 0), (1, 0), (1, 1), (0, 1)]
                .map(|(x, y)| glam::DVec3::new(x.into(), y.into(), 0.5))
                .to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        };
        let glb = proxy::mesh::to_glb(&square, &[], None).map_err(io::Error::other)?;
        self.add("mesh_glb", "own", &glb)?;
        self.add("model_glb", "own", &model::textured_glb())?;
        self.add(
            "mesh_ply",
            "own",
            &proxy::mesh::to_ply(&square, None, "by hand"),
        )?;
        let comment = "lumigraph proxy carved";
        let bounded = proxy::mesh::to_ply(&square, Some(&square), comment);
        self.add("mesh_ply", "own-hull", &bounded)
    }

    /// A model's three files, together and each alone.
    fn model(&self, name: &str, files: [&[u8]; 3], format: &str) -> io::Result<()> {
        let target = format!("colmap_{format}");
        for (which, file) in files.iter().enumerate() {
            let alone = [&[which as u8], *file].concat();
            self.add(&target, &format!("{name}-{which}"), &alone)?;
        }
        match joined(files) {
            Some(joined) => self.add(&target, name, &[&[3], joined.as_slice()].concat()),
            None => Ok(()),
        }
    }

    /// Every file below a folder, given to the targets that may like it.
    fn captures(&self, folder: &Path) -> io::Result<()> {
        let mut entries: Vec<PathBuf> = fs::read_dir(folder)?
            .map(|entry| Ok(entry?.path()))
            .collect::<io::Result<_>>()?;
        entries.sort();
        if let Ok(whole) = colmap::read_model(folder) {
            let small = reduced(&whole);
            let name = folder.to_string_lossy().replace(['/', '\\'], "_");
            let binary = model::written(&small, colmap::write_binary, "bin");
            self.model(&name, binary.each_ref().map(Vec::as_slice), "binary")?;
            let text = model::written(&small, colmap::write_text, "txt");
            self.model(&name, text.each_ref().map(Vec::as_slice), "text")?;
        }
        for path in entries {
            if path.is_dir() {
                self.captures(&path)?;
            } else if path.metadata()?.len() <= LARGEST {
                self.file(&path)?;
            }
        }
        Ok(())
    }

    fn file(&self, path: &Path) -> io::Result<()> {
        let bytes = fs::read(path)?;
        let name = path.to_string_lossy().replace(['/', '\\'], "_");
        let extension = path
            .extension()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        if let Some(format) = formats::detect(path) {
            self.add("detect", &name, &bytes)?;
            use formats::Format::{Bundler, Llff, Meshroom, Nvm, OpenMvg, Transforms};
            return match format {
                Bundler => {
                    let list = fs::read(path.with_file_name("list.txt"))?;
                    self.add("bundler", &name, &[&list, &b"\0"[..], &bytes].concat())
                }
                Llff => {
                    let rows = bytes.len().saturating_sub(128) / (17 * 8);
                    self.add("llff", &name, &[&[rows as u8], bytes.as_slice()].concat())
                }
                Meshroom => self.add("meshroom", &name, &bytes),
                Nvm => self.add("nvm", &name, &bytes),
                OpenMvg => self.add("openmvg", &name, &bytes),
                Transforms => self.add("transforms", &name, &bytes),
            };
        }
        match extension.as_str() {
            // Not every photo: they are all alike.
            "jpg" | "png" if bytes.len() < 12_000 => self.add("photo", &name, &bytes),
            "glb" => {
                self.add("mesh_glb", &name, &bytes)?;
                self.add("model_glb", &name, &bytes)?;
                self.add("proxy_glb", &name, &bytes)
            }
            "obj" | "ply" => self.add(&format!("mesh_{extension}"), &name, &bytes),
            "gz" => self.add("opencv_gzip", &name, bytes.get(2..).unwrap_or_default()),
            "yml" | "yaml" | "xml" | "json" if opencv::FileStorage::read(path).is_ok() => {
                let target = format!("opencv_{}", extension.replace("yml", "yaml"));
                if name.ends_with("split.json") {
                    self.add("split_json", &name, &bytes)?;
                }
                // The target begins the file itself.
                let start = match extension.as_str() {
                    "json" => 1,
                    "xml" => bytes
                        .iter()
                        .position(|&b| b == b'\n')
                        .map_or(0, |at| at + 1),
                    _ => 0,
                };
                self.add(&target, &name, &bytes[start..])
            }
            _ => Ok(()),
        }
    }
}

/// The first three photos and few of their points.
fn reduced(whole: &Reconstruction) -> Reconstruction {
    let others: BTreeSet<String> = whole
        .images
        .values()
        .skip(3)
        .map(|image| image.name.clone())
        .collect();
    let mut small = whole.without_images(&others).into_owned();
    let kept: BTreeSet<_> = small.points.keys().take(30).copied().collect();
    small.points.retain(|id, _| kept.contains(id));
    for point in small.points.values_mut() {
        for (image, keypoint) in &mut point.track {
            if let Some(image) = small.images.get_mut(image) {
                image.keypoints[0] = image.keypoints[*keypoint as usize];
            }
            *keypoint = 0;
        }
    }
    for image in small.images.values_mut() {
        image.keypoints.truncate(40);
        for keypoint in &mut image.keypoints {
            keypoint.point = keypoint.point.filter(|id| kept.contains(id));
        }
    }
    small
}
