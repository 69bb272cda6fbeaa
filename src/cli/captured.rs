//! An interior opened, with the photos that show its cells.

use super::budget;
use super::damaged::{leave_out, left_out_text};
use super::exposure::{ExposureArgs, ExposureUsed};
use super::inputs::{files_of, files_of_mesh};
use super::interior::{open, said};
use super::options::{compared, drop_weak_of_interior, print_warnings};
use super::output::say;
use anyhow::{Context, bail};
use calibrate::View;
use lumigraph::scene::{Scene, Truth};
use proxy::interior::{Contents, Interior};
use proxy::mesh::{Model, read_model};
use proxy::{MeshKind, Proxy, Solid};
use render::interior::{Captured, Painter};
use render::{DeviceChoice, Engine, FieldOptions, Method};
use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// An interior, its model, and what shows it.
pub(super) struct Opened {
    /// The interior's file.
    pub(super) file: PathBuf,
    pub(super) interior: Interior,
    pub(super) model: Model,
    /// How many triangles its file has: [`Self::painter`] may add others.
    pub(super) triangles: usize,
    /// What of the model each cell has.
    pub(super) contents: Contents,
    /// None where no cell is a scene.
    pub(super) photos: Option<Photos>,
}

impl Opened {
    /// Opens an interior, given by its folder or its file; `exposure` says how its photos' are
    /// matched, `None` that photos are of no interest. `warn` is told what is odd.
    pub(super) fn new(
        given: &Path,
        exposure: Option<&ExposureArgs>,
        warn: impl Fn(String),
    ) -> anyhow::Result<Self> {
        let (file, interior) = open(given)?;
        let (model, warnings) = model_of(&file, &interior)?;
        warnings.into_iter().for_each(&warn);
        let named = || file.display().to_string();
        let (contents, warnings) = Contents::new(&interior, &model).with_context(named)?;
        said(&warnings).into_iter().for_each(&warn);
        let photos = match exposure {
            Some(exposure) => Photos::open(&file, &interior, exposure)?,
            None => None,
        };
        Ok(Self {
            file,
            interior,
            triangles: model.mesh.triangles.len(),
            model,
            contents,
            photos,
        })
    }

    /// The files that it was read from, those beside its model's included, and its photos'.
    pub(super) fn files(&self) -> Vec<PathBuf> {
        let photos = self.photos.iter().flat_map(Photos::files);
        let model = model_file(&self.file, &self.interior);
        let model = model.into_iter().flat_map(files_of_mesh);
        photos.chain(model).chain([self.file.clone()]).collect()
    }

    /// What draws it, from its photos if there are any, with so many bytes for those that are
    /// decoded. What is seen behind all surfaces is added to the model.
    pub(super) fn painter(
        &mut self,
        device: DeviceChoice,
        budget: Option<u64>,
    ) -> anyhow::Result<Painter> {
        let Some(photos) = &self.photos else {
            return Ok(Painter::open(device, &self.model));
        };
        let (contents, model) = (&mut self.contents, &mut self.model);
        photos.painter(device, budget, &self.interior, contents, model)
    }
}

/// The model of an interior whose file is `path`.
pub(super) fn model_file(path: &Path, interior: &Interior) -> Option<PathBuf> {
    let name = interior.model.as_ref()?;
    Some(path.parent().unwrap_or(Path::new("")).join(name))
}

/// That model, and what is odd about it.
pub(super) fn model_of(path: &Path, interior: &Interior) -> anyhow::Result<(Model, Vec<String>)> {
    let Some(file) = model_file(path, interior) else {
        bail!(
            "{}: it names no model, and cells are drawn from one; make it with `lumigraph interior`",
            path.display()
        );
    };
    if !file.is_file() {
        bail!(
            "{}: there is no file {}, which its `model` names; put the model there, or correct `model`",
            path.display(),
            file.display()
        );
    }
    let of_interior = || format!("{}: its `model`", path.display());
    let (model, warnings) = read_model(&file).with_context(of_interior)?;
    let named = |warning| format!("{}: {warning}", file.display());
    Ok((model, warnings.into_iter().map(named).collect()))
}

/// The scene whose photos show an interior's cells.
pub(super) struct Photos {
    scene: Scene,
    held_out: BTreeSet<String>,
    /// Those, and those found damaged as exposures were matched.
    without: BTreeSet<String>,
    pub(super) exposure: ExposureUsed,
}

/// The hash of Fowler, Noll and Vo, 1a: the same on every machine.
struct Fnv(u64);

impl Write for Fnv {
    fn write_str(&mut self, text: &str) -> std::fmt::Result {
        for byte in text.bytes() {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
        Ok(())
    }
}

impl Fnv {
    fn new() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }
}

/// A number that another text would most likely not have.
pub(super) fn hash_of(text: &str) -> String {
    let mut hash = Fnv::new();
    // Writing to it fails never.
    let _ = hash.write_str(text);
    format!("{:016x}", hash.0)
}

/// Cells across the image's width of the blending field's grid.
const GRID: u32 = 32;

impl Photos {
    /// Opens the scene that an interior's cells name; `None` where none does. `file` is the
    /// interior's.
    fn open(
        file: &Path,
        interior: &Interior,
        exposure: &ExposureArgs,
    ) -> anyhow::Result<Option<Self>> {
        let folders = interior.cells.iter().filter_map(|c| c.content.scene());
        let folders: BTreeSet<&str> = folders.collect();
        let folder = match folders.iter().collect::<Vec<_>>()[..] {
            [] => return Ok(None),
            [folder] => file.parent().unwrap_or(Path::new("")).join(folder),
            [first, second, ..] => bail!(
                "{}: its cells name more than one scene ({first}, {second}); an interior is drawn \
                 from one: import all photos into one scene",
                file.display()
            ),
        };
        let named = || format!("{}: the scene of its cells", file.display());
        let (mut scene, warnings) = Scene::open(&folder, false).with_context(named)?;
        print_warnings(&warnings);
        drop_weak_of_interior(&mut scene);
        let known: BTreeSet<String> = scene.names().into_iter().collect();
        let held_out = interior
            .held_out
            .iter()
            .filter(|name| known.contains(*name));
        let held_out: BTreeSet<String> = held_out.cloned().collect();
        let gone = interior.held_out.iter();
        let gone: Vec<&String> = gone.filter(|name| !known.contains(*name)).collect();
        if let [first, more @ ..] = &gone[..] {
            let more = match more.len() {
                0 => String::new(),
                more => format!(" and {more} more"),
            };
            say!(
                "warning: {}: its `held_out` has {first}{more}, which the scene of its cells does not; correct or \
                 remove what is not there",
                file.display()
            );
        }
        let exposure = exposure.choose(&mut scene, &held_out);
        let mut without = held_out.clone();
        leave_out(&scene, &exposure.left_out, &mut without, false)?;
        Ok(Some(Self {
            scene,
            held_out,
            without,
            exposure,
        }))
    }

    /// What was said of photos that were found damaged as exposures were matched.
    pub(super) fn left_out(&self) -> impl Iterator<Item = String> {
        self.exposure.left_out.iter().map(left_out_text)
    }

    /// The scene's files; see [`files_of`].
    fn files(&self) -> Vec<PathBuf> {
        files_of(&self.scene)
    }

    /// A number that other cameras, sparse points, gains, scales of depth or photos left out would most likely
    /// not have: calibrations come in files of many kinds.
    pub(super) fn fingerprint(&self) -> String {
        let mut hash = Fnv::new();
        let known = &self.scene.reconstruction;
        let images = known.images.values();
        let images = images.map(|i| (&i.name, i.camera_id, i.camera_from_world));
        let photos = self.scene.photos.iter();
        let photos = photos.map(|p| (&p.name, p.gain, p.depth_scale, p.depth_bounds));
        let points = known.points.values().map(|point| point.position);
        // Writing to it fails never.
        let _ = write!(hash, "{:?}", known.cameras);
        images.for_each(|image| _ = write!(hash, "{image:?}"));
        photos.for_each(|photo| _ = write!(hash, "{photo:?}"));
        points.for_each(|point| _ = write!(hash, "{point:?}"));
        let left_out = self.exposure.left_out.keys();
        left_out.for_each(|name| _ = write!(hash, "{name:?}"));
        format!("{:016x}", hash.0)
    }

    /// What draws the model's surface from them, with so many bytes for decoded photos. What is
    /// seen where there is no surface is added to the model; see [`Scene::add_backdrop`].
    pub(super) fn painter(
        &self,
        device: DeviceChoice,
        budget: Option<u64>,
        interior: &Interior,
        contents: &mut Contents,
        model: &mut Model,
    ) -> anyhow::Result<Painter> {
        let backdrop = self.scene.add_backdrop(&self.without, model, contents)?;
        let solid = Solid::new(MeshKind::Depth, model.mesh.clone());
        let mut lumigraph = self
            .scene
            .lumigraph(&self.without, Proxy::Mesh(Arc::new(solid)))?;
        lumigraph.photos.set_budget(budget::of_photos(budget));
        let captured = Captured::new(
            lumigraph,
            Engine::open(device)?,
            FieldOptions::default(),
            Method::Triangulated { cells_across: GRID },
            interior,
            contents,
            model,
            backdrop,
        );
        captured.prepare();
        let depth_maps = self.scene.depth_maps(&self.without);
        Ok(Painter::of_photos(captured.with_depth_maps(depth_maps?)))
    }

    /// The photos that were held out, to compare pictures with: as large as those, which may be of a size
    /// that is asked for. All of them are kept; those that are corrupt are left out, with a warning.
    pub(super) fn held_out(
        &self,
        size: Option<(u32, u32)>,
    ) -> anyhow::Result<Vec<(String, View, Truth)>> {
        let mut found = Vec::new();
        for name in &self.held_out {
            let view = compared(name, self.scene.view(name)?, size)?;
            match self.scene.truth(name, &self.without)? {
                Ok(truth) => {
                    let truth = truth.resized(view.width, view.height);
                    found.push((name.clone(), view, truth));
                }
                Err(error) => say!("warning: photo {name} is left out: {error}"),
            }
        }
        Ok(found)
    }
}

#[cfg(test)]
mod tests {
    use super::super::inputs::files_behind;
    use super::*;
    use image::RgbaImage;

    /// A triangle; its corners and its texture lie beside it.
    const WALL: &str = r#"{"asset": {"version": "2.0"}, "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "textures": [{"source": 0}], "images": [{"uri": "wall.png"}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"byteLength": 36, "uri": "wall.bin"}]}"#;
    const ROOM: &str = r#"{"version": 1, "model": "wall.gltf", "up": [0, 1, 0], "eye_height": 1.6,
        "cells": [{"name": "room", "box": {"min": [-1, -1, -1], "max": [2, 2, 2]}}], "portals": []}"#;

    #[test]
    fn what_lies_beside_a_model_is_among_an_interiors_files() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let corners: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        let corners: Vec<u8> = corners.into_iter().flat_map(f32::to_le_bytes).collect();
        std::fs::write(at("wall.bin"), corners).unwrap();
        RgbaImage::new(1, 1).save(at("wall.png")).unwrap();
        std::fs::write(at("wall.gltf"), WALL).unwrap();
        std::fs::write(at("interior.json"), ROOM).unwrap();
        let opened = Opened::new(folder.path(), None, |_| {}).unwrap();
        let mut files = opened.files();
        files.sort();
        let of_model = ["wall.bin", "wall.gltf", "wall.png"].map(at);
        assert_eq!(files[0], at("interior.json"));
        assert_eq!(files[1..], of_model);
        // Of a mesh that an option names, too.
        let mut files = files_behind([at("wall.gltf")], &[]);
        files.sort();
        assert_eq!(files, of_model);
    }
}
