//! Wavefront OBJ: the corners and faces.

use super::polygon::{Fan, Fans};
use super::{Mesh, MeshFileError};
use crate::shown_name;
use capture::{byte_lines, without_byte_order_mark};
use glam::DVec3;
use std::path::Path;

/// Reads `v` and `f`, which some write as capitals; all else is for looks and left alone.
pub(super) fn parse(path: &Path, bytes: &[u8]) -> Result<Mesh, MeshFileError> {
    if bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) {
        let problem = "its text is UTF-16, which is not read; save it as UTF-8";
        return Err(MeshFileError::File(path.to_owned(), problem.to_owned()));
    }
    let bytes = without_byte_order_mark(bytes);
    let mut mesh = Mesh::default();
    // The greatest index so far and the line that has it: corners may follow their faces.
    let mut greatest = (0, 0);
    let mut fans = Fans::default();
    for (number, line) in byte_lines(bytes).enumerate() {
        let line_number = number + 1;
        let failed = |problem: String| MeshFileError::Line {
            path: path.to_owned(),
            line: line_number,
            problem,
        };
        // Comments and names may be in any encoding.
        let line = line.split(|b| *b == b'#').next().unwrap_or_default();
        let is_ours = |line: &[u8]| matches!(line, [b'v' | b'V' | b'f' | b'F', b' ' | b'\t', ..]);
        let line = line.trim_ascii();
        if !is_ours(line) {
            continue;
        }
        let text = std::str::from_utf8(line)
            .map_err(|_| failed("this is no text; is the file an OBJ?".to_owned()))?;
        if text.ends_with('\\') {
            return Err(failed(
                "it goes on in the next line, which is not read; export the mesh again with \
                 each face on a line"
                    .to_owned(),
            ));
        }
        let mut words = text.split_ascii_whitespace();
        match words.next() {
            Some("v" | "V") => {
                let mut coordinate = || {
                    let word = words
                        .next()
                        .ok_or_else(|| failed("a corner needs three coordinates".to_owned()))?;
                    let value: f64 = word.parse().map_err(|_| {
                        failed(format!("expected a coordinate, found `{}`", shown(word)))
                    })?;
                    match value.is_finite() {
                        true => Ok(value),
                        false => Err(failed(format!(
                            "the coordinate {} is not finite; remove the corner and its faces",
                            shown(word)
                        ))),
                    }
                };
                mesh.positions
                    .push(DVec3::new(coordinate()?, coordinate()?, coordinate()?));
            }
            _ => {
                let first = mesh.triangles.len();
                let mut polygon = Fan::default();
                for word in words {
                    let index = index(word, mesh.positions.len()).map_err(&failed)?;
                    greatest = greatest.max((index, line_number));
                    polygon.corner(index, &mut mesh.triangles);
                }
                fans.note(first..mesh.triangles.len());
            }
        }
    }
    let corners = mesh.positions.len();
    if !mesh.triangles.is_empty() && greatest.0 as usize >= corners {
        return Err(MeshFileError::Line {
            path: path.to_owned(),
            line: greatest.1,
            problem: format!(
                "a face uses corner {}, but the file has {corners}; is it cut off?",
                u64::from(greatest.0) + 1
            ),
        });
    }
    fans.mend(&mut mesh);
    Ok(mesh)
}

/// The corner that `7`, `7/1`, `7//3`, `7/1/3` or `-1` names, from 0.
fn index(word: &str, corners: usize) -> Result<u32, String> {
    let position = word.split('/').next().unwrap_or_default();
    let number: i64 = position
        .parse()
        .map_err(|_| format!("expected a corner such as 7/1/3, found `{}`", shown(word)))?;
    let index = match number {
        1.. => number - 1,
        0 => return Err("corners are counted from 1; this face uses 0".to_owned()),
        _ => corners as i64 + number,
    };
    u32::try_from(index).map_err(|_| {
        format!("a face uses corner {number}, but {corners} come before it; is the file cut off?")
    })
}

/// A word as messages show it.
pub(super) fn shown(word: &str) -> String {
    match word.char_indices().nth(40) {
        Some((end, _)) => format!("{}…", shown_name(&word[..end])),
        None => shown_name(word),
    }
}
