//! A blending field as numpy's `.npz`.

use glam::DVec3;
use render::blend::Contributor;
use std::io::{Cursor, Write};
use zip::write::FileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

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
    let [height, width] = [field.height, field.width].map(|side| side as usize);
    let by_slot = [height, width, slots];
    let longest = field.camera_names.iter().map(|name| name.chars().count());
    let longest = longest.max().unwrap_or_default().max(1);

    let mut archive = Archive(ZipWriter::new(Cursor::new(Vec::new())));
    let names = field.camera_names.iter().flat_map(|name| {
        // UTF-32, filled up with zeros.
        let letters = name.chars().map(u32::from).chain(std::iter::repeat(0));
        letters.take(longest).flat_map(u32::to_le_bytes)
    });
    let text = format!("<U{longest}");
    archive.add("camera_names", &text, &[field.camera_names.len()], names)?;
    let ids = ids.into_iter().flat_map(i32::to_le_bytes);
    archive.add("ids", "<i4", &by_slot, ids)?;
    let weights = weights.into_iter().flat_map(f32::to_le_bytes);
    archive.add("weights", "<f4", &by_slot, weights)?;
    let points = field.points.iter().flat_map(|p| p.to_array());
    let points = points.flat_map(f64::to_le_bytes);
    archive.add("points", "<f8", &[height, width, 3], points)?;
    Ok(archive.0.finish()?.into_inner())
}

/// The arrays so far, each a file of numpy's `.npy`, version 1.0.
struct Archive(ZipWriter<Cursor<Vec<u8>>>);

impl Archive {
    /// Adds an array by its type in numpy's words, its shape and its bytes, the last axis
    /// fastest.
    fn add(
        &mut self,
        name: &str,
        kind: &str,
        shape: &[usize],
        bytes: impl Iterator<Item = u8>,
    ) -> anyhow::Result<()> {
        // The same field gives the same bytes: no time of day.
        let options = FileOptions::default()
            .compression_method(CompressionMethod::Deflated)
            .last_modified_time(DateTime::default());
        self.0.start_file(format!("{name}.npy"), options)?;
        let bytes: Vec<u8> = header(kind, shape).into_iter().chain(bytes).collect();
        Ok(self.0.write_all(&bytes)?)
    }
}

/// What a `.npy` file begins with: a Python dictionary after ten bytes, all of it filled up with
/// spaces to a multiple of 64.
fn header(kind: &str, shape: &[usize]) -> Vec<u8> {
    let sides: Vec<String> = shape.iter().map(usize::to_string).collect();
    let mut sides = sides.join(", ");
    if shape.len() == 1 {
        sides.push(',');
    }
    let about = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({sides}), }}");
    let length = (10 + about.len() + 1).next_multiple_of(64) - 10;
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((length as u16).to_le_bytes());
    bytes.extend(about.bytes());
    bytes.resize(10 + length - 1, b' ');
    bytes.push(b'\n');
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_are_whole_lines_of_64_bytes() {
        let header = header("<f4", &[3, 40, 5]);
        assert_eq!(header.len(), 128);
        assert_eq!(header[8..10], [118, 0]);
        let text = std::str::from_utf8(&header[10..]).unwrap();
        let about = "{'descr': '<f4', 'fortran_order': False, 'shape': (3, 40, 5), }";
        assert!(text.starts_with(about) && text.ends_with(" \n"), "{text}");
    }
}
