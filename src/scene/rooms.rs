//! An interior out of a capture's depth maps: a coloured model, its rooms and doorways.

use super::fit::unfit;
use super::{Photo, Scene, SceneError};
use calibrate::View;
use glam::DVec3;
use proxy::depth;
use proxy::interior::find::{Evidence, FindOptions, FoundInterior, find_interior, sights};
use proxy::mesh::{Material, Model, ModelNode, Painting, Part};
use std::collections::BTreeSet;

/// An interior that was found in a capture.
#[derive(Debug)]
pub struct SceneInterior {
    /// The fused depth maps, corners coloured from the photos.
    pub model: Model,
    /// Its rooms and doorways.
    pub found: FoundInterior,
    /// Photos whose depth maps were fused.
    pub maps: usize,
}

/// The model's triangles at most.
const MOST_TRIANGLES: usize = 600_000;
/// Every so-manieth column and row of a depth map is a line of sight.
const SIGHTS: u32 = 4;
/// A photo's colours are a corner's within so many voxels.
const SAME_PLACE: f64 = 3.0;

impl Scene {
    /// Fuses the photos' depth maps, colours what comes out and finds its rooms. `model` is the
    /// name that the model's file will have.
    ///
    /// # Errors
    /// Photos without depth maps, depth maps without a surface, a surface without rooms.
    pub fn interior(
        &self,
        model: &str,
        options: &FindOptions,
    ) -> Result<SceneInterior, SceneError> {
        let sources = self.sources(&BTreeSet::new())?;
        let with_maps: Vec<&(&Photo, View)> = sources
            .iter()
            .filter(|(photo, _)| photo.depth_map.is_some())
            .collect();
        if with_maps.is_empty() {
            return Err(unfit(
                "the photos have no depth maps, which rooms are found in: give their folder with \
                 `import --depth`, or a mesh of the place (.glb) instead of the photos",
            ));
        }
        let frame = |i: usize| -> Result<(View, capture::DepthMap), SceneError> {
            let (photo, view) = with_maps[i];
            let map = photo.decode_depth((view.width, view.height))?;
            let map = map.ok_or_else(|| unfit(format!("{}: no depth map", photo.name)))?;
            Ok((view.clone(), map))
        };
        // 1. The surface.
        let fusing = depth::Options {
            max_triangles: Some(MOST_TRIANGLES),
            ..depth::Options::default()
        };
        let fusion = depth::fuse(with_maps.len(), frame, &fusing).map_err(unfit)?;
        // 2. Its colours, and what cameras saw past.
        let mesh = fusion.mesh;
        let mut painting = Painting::new(&mesh, SAME_PLACE * fusion.voxel_size);
        let mut lines = Vec::new();
        for (i, (photo, view)) in with_maps.iter().enumerate() {
            let (_, map) = frame(i)?;
            lines.extend(sights(view, &map, SIGHTS));
            painting.add(view, &photo.decode((view.width, view.height))?, &map);
        }
        let colors = painting.colors();
        // 3. Rooms.
        let cameras: Vec<(DVec3, DVec3)> =
            sources.iter().map(|(_, v)| (v.center(), v.up())).collect();
        let evidence = Evidence {
            mesh: &mesh,
            cameras: &cameras,
            sights: &lines,
        };
        let found = find_interior(&evidence, model, options).map_err(unfit)?;
        let count = mesh.triangles.len() as u32;
        let model = Model {
            uvs: vec![[0.0; 2]; mesh.positions.len()],
            colors,
            parts: vec![Part {
                triangles: 0..count,
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
        };
        Ok(SceneInterior {
            model,
            found,
            maps: with_maps.len(),
        })
    }
}
