//! A house on disk: the model and its interior, as a user would have them.

use super::{House, INTERIOR_FILE, MODEL_FILE};
use crate::DatasetError;
use crate::write::{in_new_folder, io};
use proxy::interior::write_interior;
use proxy::mesh::model_to_glb;
use std::path::Path;

/// Writes `house.glb`, `interior.json` and `README.md` into a folder that appears complete or
/// not at all.
///
/// # Errors
/// The folder exists and is not empty, or something cannot be written.
pub fn write(house: &House, folder: &Path) -> Result<(), DatasetError> {
    let fill = |folder: &Path| {
        let path = folder.join(MODEL_FILE);
        let glb = model_to_glb(&house.model).map_err(|source| DatasetError::Model {
            path: path.clone(),
            source,
        })?;
        std::fs::write(&path, glb).map_err(|source| io(&path, source))?;
        write_interior(&folder.join(INTERIOR_FILE), &house.interior)?;
        let path = folder.join("README.md");
        std::fs::write(&path, readme(house)).map_err(|source| io(&path, source))
    };
    in_new_folder(folder, |_| false, fill)
}

fn readme(house: &House) -> String {
    let (interior, model) = (&house.interior, &house.model);
    format!(
        "# house\n\
         \n\
         - Source: `lumigraph generate house`, a procedural house. Licence: as the program's.\n\
         - {MODEL_FILE}: {triangles} triangles, {textures} textures; light is baked into the \
         corners' colours; metres, y up.\n\
         - {INTERIOR_FILE}: {cells} cells, {portals} portals. A cell's box reaches to the middle \
         of its walls, where the portals are.\n",
        triangles = model.mesh.triangles.len(),
        textures = model.textures.len(),
        cells = interior.cells.len(),
        portals = interior.portals.len(),
    )
}
