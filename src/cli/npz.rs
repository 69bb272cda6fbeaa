//! A blending field as numpy's `.npz`.

use glam::DVec3;
use npyz::npz::NpzWriter;
use npyz::{DType, TypeStr, WriterBuilder};
use render::blend::Contributor;
use std::io::Cursor;
use zip::DateTime;
use zip::write::FileOptions;

/// A field over the pixels of a picture, row by row.
pub(super) struct Weights<'a> {
    pub(super) width: u32,
    pub(super) height: u32,
    /// By source view.
    pub(super) camera_names: Vec<&'a str>,
    pub(super) contributors: &'a [Vec<Contributor>],
    /// The proxy point in the world, NaN where there is none.
    pub(super) points: &'a [DVec3],
}

/// The file's bytes. Arrays:
///
/// - `camera_names`: N strings;
/// - `ids`: H × W × K, i32, indices into `camera_names`, the largest weight first, −1 where
///   unused;
/// - `weights`: H × W × K, f32, 0 where unused;
/// - `points`: H × W × 3, f64.
pub(super) fn npz(field: &Weights<'_>) -> anyhow::Result<Vec<u8>> {
    let most = field.contributors.iter().map(Vec::len).max();
    let slots = most.unwrap_or_default().max(1);
    let mut ids = Vec::with_capacity(field.contributors.len() * slots);
    let mut weights = Vec::with_capacity(field.contributors.len() * slots);
    for list in field.contributors {
        let mut list = list.clone();
        list.sort_by(|a, b| b.weight.total_cmp(&a.weight));
        for slot in 0..slots {
            let contributor = list.get(slot);
            ids.push(contributor.map_or(-1, |c| c.source_idx as i32));
            weights.push(contributor.map_or(0.0, |c| c.weight as f32));
        }
    }
    let (height, width) = (u64::from(field.height), u64::from(field.width));
    let by_slot = [height, width, slots as u64];

    // The same field gives the same bytes: no time of day.
    let options = FileOptions::default().last_modified_time(DateTime::default());
    let mut archive = NpzWriter::new(Cursor::new(Vec::new()));
    let longest = field.camera_names.iter().map(|name| name.chars().count());
    let text: TypeStr = format!("<U{}", longest.max().unwrap_or_default().max(1)).parse()?;
    let mut names = archive
        .array::<str>("camera_names", options)?
        .dtype(DType::new_scalar(text))
        .shape(&[field.camera_names.len() as u64])
        .begin_nd()?;
    for name in &field.camera_names {
        names.push(name)?;
    }
    names.finish()?;
    let mut array = archive
        .array("ids", options)?
        .default_dtype()
        .shape(&by_slot)
        .begin_nd()?;
    array.extend(ids)?;
    array.finish()?;
    let mut array = archive
        .array("weights", options)?
        .default_dtype()
        .shape(&by_slot)
        .begin_nd()?;
    array.extend(weights)?;
    array.finish()?;
    let mut array = archive
        .array("points", options)?
        .default_dtype()
        .shape(&[height, width, 3])
        .begin_nd()?;
    array.extend(field.points.iter().flat_map(|p| p.to_array()))?;
    array.finish()?;
    Ok(archive.zip_writer().finish()?.into_inner())
}
