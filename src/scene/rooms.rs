//! An interior out of a capture: a coloured model, its rooms and doorways, and what photos show of it.

use super::fit::{fuse_depth, unfit};
use super::import::ENOUGH;
use super::{Photo, Scene, SceneError, SceneProxy};
use calibrate::{DepthAlong, Pixel, View};
use capture::{DepthMap, quarters_of};
use glam::DVec3;
use proxy::depth::Fusion;
use proxy::interior::Contents;
use proxy::interior::find::{
    Evidence, FindOptions, FoundInterior, find_interior, sights, up_of_cameras,
};
use proxy::mesh::{Material, Mesh, Model, ModelNode, Painting, Part};
use proxy::{Proxy, Solid};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

/// The surface of a capture, and what its cameras say of the space between.
#[derive(Debug)]
pub struct SceneSurface {
    /// The fused depth maps, or the scene's own mesh; corners coloured from the photos.
    pub model: Model,
    /// Photos whose depth maps were fused; none where the mesh is the scene's own.
    pub maps: usize,
    /// Photos that cannot be decoded and colour nothing, by name, with what is wrong with each. Their
    /// depth maps count.
    pub left_out: BTreeMap<String, String>,
    /// Photos whose depth maps cannot be decoded, by name, with what is wrong with each: they count as photos
    /// that have none.
    pub maps_left_out: BTreeMap<String, String>,
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
    /// had never been taken. Without depth maps it is the scene's own mesh, if it has one. Photos and depth
    /// maps that cannot be decoded are left out; see [`SceneSurface::left_out`].
    ///
    /// # Errors
    /// No depth maps and no mesh, depth maps without a surface; fewer than two photos without those that cannot be
    /// decoded, or none that colours anything.
    pub fn surface(&self, without: &BTreeSet<String>) -> Result<SceneSurface, SceneError> {
        let sources = self.sources(without)?;
        let maps = sources
            .iter()
            .filter(|(p, _)| p.depth_map.is_some())
            .count();
        let mut maps_left_out = BTreeMap::new();
        let (mesh, tolerance, own) = match maps {
            0 => {
                let solid = self.own_mesh(without)?;
                // Depths out of the mesh are the mesh's own.
                (solid.mesh().clone(), 0.0, Some(solid))
            }
            _ => {
                let mut fusion = fuse_decodable(&sources, &mut maps_left_out)?;
                fusion.mesh.close_holes(SMALL_HOLE * fusion.voxel_size);
                (fusion.mesh, SAME_PLACE * fusion.voxel_size, None)
            }
        };
        // Its colours, and what cameras saw past.
        // Fused depth maps wind as cameras saw them.
        let front_only = own.is_none_or(|solid| solid.kind().has_front_sides_only());
        let mut painting = Painting::new(&mesh, tolerance, front_only);
        let mut lines = Vec::new();
        let mut left_out = BTreeMap::new();
        let mut painted = 0;
        for (photo, view) in &sources {
            let size = (view.width, view.height);
            let map = match own {
                Some(solid) => Some(depth_of(solid, view)),
                None if maps_left_out.contains_key(&photo.name) => None,
                None => photo.decode_depth(size)?,
            };
            let Some(map) = map else { continue };
            let pixels = f64::from(map.width) * f64::from(map.height);
            let every = (pixels / SIGHTS).sqrt().round().max(1.0);
            lines.extend(sights(view, &map, every as u32));
            match photo.decode_usable(size) {
                Ok(pixels) => {
                    painting.add(view, &pixels, &map);
                    painted += 1;
                }
                Err(error) => {
                    left_out.insert(photo.name.clone(), error.to_string());
                }
            }
        }
        let rest = sources.len() - left_out.len();
        if !left_out.is_empty() && (rest < ENOUGH || painted == 0) {
            return Err(SceneError::Damaged(left_out));
        }
        let colors = painting.colors();
        let camera = |(photo, view): &(&Photo, View)| {
            let quarters = photo.orientation.map_or(0, quarters_of);
            (view.center(), up_as_shown(view, quarters))
        };
        let cameras = sources.iter().map(camera).collect();
        Ok(SceneSurface {
            model: model_of(mesh, colors),
            maps: maps - maps_left_out.len(),
            left_out,
            maps_left_out,
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
        let own = self.proxy.as_ref();
        let surface = own.map(SceneProxy::surface).transpose()?;
        let (Some(Proxy::Mesh(solid)), Some(own)) = (surface, own) else {
            return Err(unfit(
                "the photos have no depth maps, which rooms are found in: give their folder with \
                 `import --depth`, or import them and make a mesh of the scene (`lumigraph proxy SCENE \
                 tunnel`, or `carved`), or give a model of the place (.glb) instead of the photos",
            ));
        };
        // A mesh given by hand rests on no photo.
        let fitted_without = own.fitted_without.as_ref();
        let knows = |name: &&String| fitted_without.is_some_and(|n| !n.contains(*name));
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

    /// Which way was up for its cameras; `None` where they do not agree.
    pub fn up(&self) -> Option<DVec3> {
        up_of_cameras(&self.cameras)
    }
}

/// Which way is up for who looks at a photo that is turned by so many quarters, clockwise, to be shown.
fn up_as_shown(view: &View, quarters: u8) -> DVec3 {
    let as_stored = match quarters {
        1 => DVec3::NEG_X,
        2 => DVec3::Y,
        3 => DVec3::X,
        _ => return view.up(),
    };
    view.camera_from_world.rotation.conjugate() * as_stored
}

/// The surface of those depth maps that can be decoded. What is wrong with the others is added to `left_out`, by
/// their photos' names.
fn fuse_decodable(
    sources: &[(&Photo, View)],
    left_out: &mut BTreeMap<String, String>,
) -> Result<Fusion, SceneError> {
    let decode = |photo: &Photo, (width, height): (u32, u32)| {
        let map = photo.decode_depth((width, height));
        Ok(map.unwrap_or_else(|error| {
            left_out.insert(photo.name.clone(), error.to_string());
            // Nothing is known.
            Some(DepthMap {
                width,
                height,
                depths: vec![0.0; width as usize * height as usize],
            })
        }))
    };
    let fused = fuse_depth(sources, MOST_TRIANGLES, decode);
    fused.map_err(|error| match left_out.first_key_value() {
        None => error,
        Some((name, reason)) => {
            let text = format!("{error}; left out: the depth map of photo {name}: {reason}");
            let more = left_out.len() - 1;
            unfit(match more {
                0 => text,
                _ => format!("{text}; and {more} more"),
            })
        }
    })
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

/// What a view sees of a mesh: depths as [`DepthAlong`] has them.
fn depth_of(solid: &Solid, view: &View) -> DepthMap {
    let along = DepthAlong::of_view(view);
    let depths = match solid.scan(view, 1) {
        Some(scan) if along == DepthAlong::Axis => {
            let depth = |s: &f64| if *s > 0.0 { (1.0 / s) as f32 } else { 0.0 };
            scan.inverse_depth.iter().map(depth).collect()
        }
        _ => depths_by_rays(solid, view, along),
    };
    DepthMap {
        width: view.width,
        height: view.height,
        depths,
    }
}

/// The same where some pixels look aside or back: ray by ray.
fn depths_by_rays(solid: &Solid, view: &View, along: DepthAlong) -> Vec<f32> {
    let center = view.center();
    let world_from_camera = view.camera_from_world.rotation.conjugate();
    let depth = |x: u32, y: u32| {
        let ray = view.lens.unproject(Pixel::center_of(x, y))?;
        let hit = solid.first_hit(center, world_from_camera * ray)?;
        Some(along.depth(hit.along * ray).max(0.0) as f32)
    };
    let row = |y: u32| -> Vec<f32> {
        let columns = 0..view.width;
        columns.map(|x| depth(x, y).unwrap_or(0.0)).collect()
    };
    let rows: Vec<Vec<f32>> = (0..view.height).into_par_iter().map(row).collect();
    rows.concat()
}

#[cfg(test)]
mod tests;
