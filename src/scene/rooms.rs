//! An interior out of a capture: a coloured model, its rooms and doorways, and what photos show of it.

use super::fit::{fuse_depth, unfit};
use super::{Scene, SceneError};
use calibrate::View;
use capture::DepthMap;
use glam::DVec3;
use proxy::interior::Contents;
use proxy::interior::find::{Evidence, FindOptions, FoundInterior, find_interior, sights};
use proxy::mesh::{Material, Mesh, Model, ModelNode, Painting, Part};
use proxy::{Proxy, Solid};
use std::collections::BTreeSet;
use std::ops::Range;

/// The surface of a capture, and what its cameras say of the space between.
#[derive(Debug)]
pub struct SceneSurface {
    /// The fused depth maps, or the scene's own mesh; corners coloured from the photos.
    pub model: Model,
    /// Photos whose depth maps were fused; none where the mesh is the scene's own.
    pub maps: usize,
    /// The photos' centres and which way is up for them.
    cameras: Vec<(DVec3, DVec3)>,
    /// Lines of sight, from a camera to what it saw.
    sights: Vec<[DVec3; 2]>,
}

/// The model's triangles at most.
const MOST_TRIANGLES: usize = 600_000;
/// About so many pixels of a depth map are lines of sight, every so-manieth column and row: one for
/// 0.6° where 70° are seen.
const SIGHTS: f64 = 12_000.0;
/// Holes with a border of so many voxels are closed: sensors miss what is dark or shiny.
const SMALL_HOLE: f64 = 24.0;
/// A photo's colours are a corner's within so many voxels.
const SAME_PLACE: f64 = 3.0;

impl Scene {
    /// Fuses the photos' depth maps and colours what comes out, as if the photos of the given names
    /// had never been taken. Without depth maps it is the scene's own mesh, if it has one.
    ///
    /// # Errors
    /// No depth maps and no mesh, depth maps without a surface, photos that cannot be decoded.
    pub fn surface(&self, without: &BTreeSet<String>) -> Result<SceneSurface, SceneError> {
        let sources = self.sources(without)?;
        let maps = sources
            .iter()
            .filter(|(p, _)| p.depth_map.is_some())
            .count();
        let (mesh, tolerance, own) = match maps {
            0 => {
                let solid = self.own_mesh(without)?;
                // Depths out of the mesh are the mesh's own.
                (solid.mesh().clone(), 0.0, Some(solid))
            }
            _ => {
                let mut fusion = fuse_depth(&sources, MOST_TRIANGLES)?;
                fusion.mesh.close_holes(SMALL_HOLE * fusion.voxel_size);
                (fusion.mesh, SAME_PLACE * fusion.voxel_size, None)
            }
        };
        // Its colours, and what cameras saw past.
        // Fused depth maps wind as cameras saw them.
        let front_only = own.is_none_or(|solid| solid.kind().has_front_sides_only());
        let mut painting = Painting::new(&mesh, tolerance, front_only);
        let mut lines = Vec::new();
        for (photo, view) in &sources {
            let size = (view.width, view.height);
            let map = match own {
                Some(solid) => Some(depth_of(solid, view)),
                None => photo.decode_depth(size)?,
            };
            let Some(map) = map else { continue };
            let pixels = f64::from(map.width) * f64::from(map.height);
            let every = (pixels / SIGHTS).sqrt().round().max(1.0);
            lines.extend(sights(view, &map, every as u32));
            painting.add(view, &photo.decode_usable(size)?, &map);
        }
        let colors = painting.colors();
        let cameras = sources.iter().map(|(_, v)| (v.center(), v.up())).collect();
        Ok(SceneSurface {
            model: model_of(mesh, colors),
            maps,
            cameras,
            sights: lines,
        })
    }

    /// Adds what is seen where a model of this scene has no surface: a shell around everything. It is
    /// in no cell, so drawn whatever is visible. Its triangles' indices.
    ///
    /// # Errors
    /// A camera has no lens.
    pub fn add_backdrop(
        &self,
        without: &BTreeSet<String>,
        model: &mut Model,
        contents: &mut Contents,
    ) -> Result<Range<u32>, SceneError> {
        let (views, points) = self.sparse(without)?;
        let backdrop = model.append(&proxy::shell(&views, &points), "backdrop");
        contents.elsewhere.extend(backdrop.clone());
        Ok(backdrop)
    }

    /// The mesh that was made for the scene without the photos of the given names.
    fn own_mesh(&self, without: &BTreeSet<String>) -> Result<&Solid, SceneError> {
        let own = self
            .proxy
            .as_ref()
            .map(|own| (&own.proxy, &own.fitted_without));
        let Some((Proxy::Mesh(solid), fitted_without)) = own else {
            return Err(unfit(
                "the photos have no depth maps, which rooms are found in: give their folder with \
                 `import --depth`, or import them and make a mesh of the scene (`lumigraph proxy SCENE \
                 tunnel`, or `carved`), or give a model of the place (.glb) instead of the photos",
            ));
        };
        // A mesh given by hand rests on no photo.
        let knows = |name: &&String| fitted_without.as_ref().is_some_and(|n| !n.contains(*name));
        if let Some(name) = without.iter().find(knows) {
            return Err(unfit(format!(
                "the scene's mesh was made with the photo {name}, which is held out; make it anew with \
                 `lumigraph proxy --hold-out`"
            )));
        }
        Ok(solid)
    }
}

impl SceneSurface {
    /// Finds its rooms and doorways. `file` is the name that the model's file will have.
    ///
    /// # Errors
    /// A surface without rooms.
    pub fn rooms(&self, file: &str, options: &FindOptions) -> Result<FoundInterior, SceneError> {
        let evidence = Evidence {
            mesh: &self.model.mesh,
            cameras: &self.cameras,
            sights: &self.sights,
        };
        find_interior(&evidence, file, options).map_err(unfit)
    }
}

/// Corners with colours, as one node.
fn model_of(mesh: Mesh, colors: Vec<[u8; 4]>) -> Model {
    Model {
        uvs: vec![[0.0; 2]; mesh.positions.len()],
        colors,
        parts: vec![Part {
            triangles: 0..mesh.triangles.len() as u32,
            node_idx: 0,
            material_idx: 0,
        }],
        nodes: vec![ModelNode {
            name: "surface".to_owned(),
            parent_idx: None,
        }],
        materials: vec![Material::default()],
        textures: Vec::new(),
        mesh,
    }
}

/// What a view sees of a mesh; nothing where its lens is no pinhole.
fn depth_of(solid: &Solid, view: &View) -> DepthMap {
    let depths = match solid.scan(view, 1) {
        Some(scan) => {
            let depth = |s: &f64| if *s > 0.0 { (1.0 / s) as f32 } else { 0.0 };
            scan.inverse_depth.iter().map(depth).collect()
        }
        None => vec![0.0; view.width as usize * view.height as usize],
    };
    DepthMap {
        width: view.width,
        height: view.height,
        depths,
    }
}
