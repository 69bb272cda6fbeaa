//! The photos that show an interior's cells.

use super::exposure::{ExposureArgs, ExposureUsed};
use super::film::files_of;
use super::options::print_warnings;
use super::output::say;
use anyhow::{Context, bail};
use lumigraph::scene::{Scene, Truth};
use proxy::interior::{Contents, Interior};
use proxy::mesh::Model;
use proxy::{MeshKind, Proxy, Solid};
use render::interior::{Captured, Painter};
use render::{DeviceChoice, Engine, FieldOptions, Method};
use std::collections::BTreeSet;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The scene whose photos show an interior's cells.
pub(super) struct Photos {
    scene: Scene,
    without: BTreeSet<String>,
    pub(super) exposure: ExposureUsed,
}

/// Cells across the image's longer side of the blending field's grid.
const GRID: u32 = 32;

impl Photos {
    /// Opens the scene that an interior's cells name; `None` where none does. `file` is the
    /// interior's.
    pub(super) fn open(
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
        let known: BTreeSet<String> = scene.names().into_iter().collect();
        let held_out = interior
            .held_out
            .iter()
            .filter(|name| known.contains(*name));
        let without: BTreeSet<String> = held_out.cloned().collect();
        if without.len() < interior.held_out.len() {
            let gone = interior.held_out.len() - without.len();
            say!("warning: {gone} of the held-out photos are not in the scene");
        }
        let exposure = exposure.choose(&mut scene, &without);
        Ok(Some(Self {
            scene,
            without,
            exposure,
        }))
    }

    /// The scene's files; see [`files_of`].
    pub(super) fn files(&self) -> Vec<PathBuf> {
        files_of(&self.scene)
    }

    /// Adds what is seen where the model has no surface; see [`Scene::add_backdrop`].
    pub(super) fn add_backdrop(
        &self,
        model: &mut Model,
        contents: &mut Contents,
    ) -> anyhow::Result<Range<u32>> {
        Ok(self.scene.add_backdrop(&self.without, model, contents)?)
    }

    /// What draws the model's surface from them, with so many bytes for decoded photos.
    pub(super) fn painter(
        &self,
        device: DeviceChoice,
        budget: Option<u64>,
        interior: &Interior,
        contents: &Contents,
        model: &Model,
        backdrop: Range<u32>,
    ) -> anyhow::Result<Painter> {
        let solid = Solid::new(MeshKind::Depth, model.mesh.clone());
        let mut lumigraph = self
            .scene
            .lumigraph(&self.without, Proxy::Mesh(Arc::new(solid)))?;
        lumigraph.photos.set_budget(budget);
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

    /// The photos that were held out, to compare pictures with. Those that are corrupt are left
    /// out, with a warning.
    pub(super) fn held_out(&self) -> anyhow::Result<Vec<(String, calibrate::View, Truth)>> {
        let mut found = Vec::new();
        for name in &self.without {
            let view = self.scene.view(name)?;
            match self.scene.truth(name, &self.without)? {
                Ok(truth) => found.push((name.clone(), view, truth)),
                Err(error) => say!("warning: photo {name} is left out: {error}"),
            }
        }
        Ok(found)
    }
}
