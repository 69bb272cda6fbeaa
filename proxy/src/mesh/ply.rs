//! PLY, the Stanford triangle format: text and both binary orders.

use super::obj::shown;
use super::ply_header::{self, Element, Format, Scalar};
use super::polygon::{Fan, Fans, Strip};
use super::{Mesh, MeshFileError};
use capture::without_byte_order_mark;
use glam::DVec3;
use std::path::Path;

/// Reads corners, faces and strips of triangles; other elements and properties are skipped.
pub(super) fn parse(path: &Path, bytes: &[u8]) -> Result<Mesh, MeshFileError> {
    let mesh = parse_named(path, bytes, ["vertex", "face"], Some("tristrips"))?;
    mesh.ok_or_else(|| {
        let problem = "it has no element `vertex`";
        MeshFileError::File(path.to_owned(), problem.to_owned())
    })
}

/// What [`to_ply`] calls the elements of the hull around a mesh.
const OF_HULL: [&str; 2] = ["hull_vertex", "hull_face"];

/// Reads the hull around a mesh, if the file has one.
///
/// # Errors
/// The file, the record and what is wrong with it.
pub fn ply_hull(path: &Path, bytes: &[u8]) -> Result<Option<Mesh>, MeshFileError> {
    parse_named(path, bytes, OF_HULL, None)
}

/// Reads the corners, faces and strips that go by these names; none if there are no corners.
fn parse_named(
    path: &Path,
    bytes: &[u8],
    [corners, faces]: [&str; 2],
    strips: Option<&str>,
) -> Result<Option<Mesh>, MeshFileError> {
    let bytes = without_byte_order_mark(bytes);
    let header = ply_header::parse(bytes).map_err(|(line, problem)| MeshFileError::Line {
        path: path.to_owned(),
        line,
        problem,
    })?;
    let mut numbers = Numbers {
        format: header.format,
        bytes: &bytes[header.length..],
        line: header.lines + 1,
        line_end: header.line_end,
    };
    let mut mesh = Mesh::default();
    // The greatest index and the element, record and line that have it: faces may come first.
    let mut greatest = (0, 0, 0, 0);
    let mut fans = Fans::default();
    let mut has_corners = false;
    for (number, element) in header.elements.iter().enumerate() {
        if element.properties.is_empty() {
            continue;
        }
        let columns = Columns::of(element);
        let is_corner = element.name == corners;
        if is_corner && columns.position.is_none() {
            let problem = "its corners have no properties x, y and z";
            return Err(MeshFileError::File(path.to_owned(), problem.to_owned()));
        }
        has_corners |= is_corner;
        for record in 0..element.count {
            let line = numbers.line_of_next();
            let read = match element.name.as_str() {
                name if name == corners => {
                    corner(&mut numbers, element, &columns, &mut mesh.positions)
                }
                name if name == faces => {
                    let first = mesh.triangles.len();
                    let read = face(&mut numbers, element, &columns, &mut mesh.triangles);
                    fans.note(first..mesh.triangles.len());
                    read.map(|index| greatest = greatest.max((index, number, record, line)))
                }
                name if strips == Some(name) => {
                    let read = strip(&mut numbers, element, &columns, &mut mesh.triangles);
                    read.map(|index| greatest = greatest.max((index, number, record, line)))
                }
                _ => skip(&mut numbers, element),
            };
            read.map_err(|problem| bad(path, header.format, element, record, line, problem))?;
        }
    }
    if !has_corners {
        return Ok(None);
    }
    let (index, number, record, line) = greatest;
    if !mesh.triangles.is_empty() && index as usize >= mesh.positions.len() {
        let problem = format!(
            "it uses corner {index}, but there are {} (the first is 0); is the file cut off?",
            mesh.positions.len()
        );
        let element = &header.elements[number];
        return Err(bad(path, header.format, element, record, line, problem));
    }
    fans.mend(&mut mesh);
    Ok(Some(mesh))
}

fn bad(
    path: &Path,
    format: Format,
    element: &Element,
    record: u64,
    line: usize,
    problem: String,
) -> MeshFileError {
    let path = path.to_owned();
    match format {
        Format::Ascii => MeshFileError::Line {
            path,
            line,
            problem,
        },
        _ => {
            let record = format!("{} {record}", shown(&element.name));
            MeshFileError::Record {
                path,
                record,
                problem,
            }
        }
    }
}

/// Where an element has what a mesh is made of.
struct Columns {
    position: Option<[usize; 3]>,
    indices: Option<usize>,
}

impl Columns {
    fn of(element: &Element) -> Self {
        let find = |names: &[&str], is_list: bool| {
            let is_it = |p: &ply_header::Property| {
                names.contains(&p.name.as_str()) && p.length.is_some() == is_list
            };
            element.properties.iter().position(is_it)
        };
        let position = || {
            Some([
                find(&["x"], false)?,
                find(&["y"], false)?,
                find(&["z"], false)?,
            ])
        };
        Self {
            position: position(),
            indices: find(&["vertex_indices", "vertex_index"], true),
        }
    }
}

fn corner(
    numbers: &mut Numbers,
    element: &Element,
    columns: &Columns,
    positions: &mut Vec<DVec3>,
) -> Result<(), String> {
    let mut position = DVec3::NAN;
    for (i, property) in element.properties.iter().enumerate() {
        let axis = columns
            .position
            .and_then(|p| p.iter().position(|j| *j == i));
        match (property.length, axis) {
            (None, Some(axis)) => position[axis] = numbers.real(property.scalar)?,
            (None, None) => numbers.skip(property.scalar, 1)?,
            (Some(length), _) => skip_list(numbers, length, property.scalar)?,
        }
    }
    if !position.is_finite() {
        return Err("a coordinate is not finite; remove the corner and its faces".to_owned());
    }
    positions.push(position);
    Ok(())
}

/// Reads a face; its greatest index.
fn face(
    numbers: &mut Numbers,
    element: &Element,
    columns: &Columns,
    triangles: &mut Vec<[u32; 3]>,
) -> Result<u32, String> {
    let mut greatest = 0;
    let mut polygon = Fan::default();
    indices(numbers, element, columns, |index| {
        let index = corner_of(index)?;
        greatest = greatest.max(index);
        polygon.corner(index, triangles);
        Ok(())
    })?;
    Ok(greatest)
}

/// Reads strips of triangles, one after the other, as those of scans from Stanford; their greatest index.
fn strip(
    numbers: &mut Numbers,
    element: &Element,
    columns: &Columns,
    triangles: &mut Vec<[u32; 3]>,
) -> Result<u32, String> {
    let mut greatest = 0;
    let mut strip = Strip::default();
    indices(numbers, element, columns, |index| {
        // -1 begins another, whatever type it is written as.
        if index == -1 || index == i64::from(u32::MAX) {
            strip = Strip::default();
            return Ok(());
        }
        let index = corner_of(index)?;
        greatest = greatest.max(index);
        strip.corner(index, triangles);
        Ok(())
    })?;
    Ok(greatest)
}

fn corner_of(index: i64) -> Result<u32, String> {
    u32::try_from(index).map_err(|_| format!("it uses corner {index}; corners count from 0"))
}

/// Hands on the numbers of a record's list of indices.
fn indices(
    numbers: &mut Numbers,
    element: &Element,
    columns: &Columns,
    mut take: impl FnMut(i64) -> Result<(), String>,
) -> Result<(), String> {
    for (i, property) in element.properties.iter().enumerate() {
        match property.length {
            Some(length) if columns.indices == Some(i) => {
                for _ in 0..numbers.length(length)? {
                    take(numbers.whole(property.scalar)?)?;
                }
            }
            Some(length) => skip_list(numbers, length, property.scalar)?,
            None => numbers.skip(property.scalar, 1)?,
        }
    }
    Ok(())
}

fn skip(numbers: &mut Numbers, element: &Element) -> Result<(), String> {
    for property in &element.properties {
        match property.length {
            Some(length) => skip_list(numbers, length, property.scalar)?,
            None => numbers.skip(property.scalar, 1)?,
        }
    }
    Ok(())
}

fn skip_list(numbers: &mut Numbers, length: Scalar, scalar: Scalar) -> Result<(), String> {
    let length = numbers.length(length)?;
    numbers.skip(scalar, length)
}

const CUT_OFF: &str = "the file ends here; it is cut off";

/// The numbers after the header.
struct Numbers<'a> {
    format: Format,
    bytes: &'a [u8],
    /// Of a text file, from 1.
    line: usize,
    /// The last byte of each line.
    line_end: u8,
}

impl Numbers<'_> {
    /// The line that the next word is on.
    fn line_of_next(&mut self) -> usize {
        if self.format == Format::Ascii {
            let blank = self.bytes.iter().take_while(|b| b.is_ascii_whitespace());
            let mut length = 0;
            for byte in blank {
                self.line += usize::from(*byte == self.line_end);
                length += 1;
            }
            self.bytes = &self.bytes[length..];
        }
        self.line
    }

    fn word(&mut self) -> Result<&str, String> {
        self.line_of_next();
        let length = self
            .bytes
            .iter()
            .take_while(|b| !b.is_ascii_whitespace())
            .count();
        let (word, rest) = self.bytes.split_at(length);
        self.bytes = rest;
        match std::str::from_utf8(word) {
            Ok("") => Err(CUT_OFF.to_owned()),
            Ok(word) => Ok(word),
            Err(_) => Err("this is no text, but the header says `format ascii`".to_owned()),
        }
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N], String> {
        let (taken, rest) = self.bytes.split_first_chunk::<N>().ok_or(CUT_OFF)?;
        self.bytes = rest;
        Ok(match self.format {
            Format::Big => {
                let mut reversed = *taken;
                reversed.reverse();
                reversed
            }
            _ => *taken,
        })
    }

    fn real(&mut self, scalar: Scalar) -> Result<f64, String> {
        if self.format == Format::Ascii {
            let word = self.word()?;
            return word
                .parse()
                .map_err(|_| format!("`{}` is no number", shown(word)));
        }
        Ok(match scalar {
            Scalar::F32 => f32::from_le_bytes(self.take()?).into(),
            Scalar::F64 => f64::from_le_bytes(self.take()?),
            whole => self.whole(whole)? as f64,
        })
    }

    fn whole(&mut self, scalar: Scalar) -> Result<i64, String> {
        if self.format == Format::Ascii {
            let word = self.word()?;
            let failed = || format!("`{}` is no whole number", shown(word));
            return word.parse().map_err(|_| failed());
        }
        Ok(match scalar {
            Scalar::I8 => i8::from_le_bytes(self.take()?).into(),
            Scalar::U8 => u8::from_le_bytes(self.take()?).into(),
            Scalar::I16 => i16::from_le_bytes(self.take()?).into(),
            Scalar::U16 => u16::from_le_bytes(self.take()?).into(),
            Scalar::I32 => i32::from_le_bytes(self.take()?).into(),
            Scalar::U32 => u32::from_le_bytes(self.take()?).into(),
            Scalar::F32 | Scalar::F64 => {
                let value = self.real(scalar)?;
                if value.fract() != 0.0 || value.abs() > 1e15 {
                    return Err(format!("{value} is no whole number"));
                }
                value as i64
            }
        })
    }

    fn length(&mut self, scalar: Scalar) -> Result<u64, String> {
        let length = self.whole(scalar)?;
        u64::try_from(length).map_err(|_| format!("a list of {length} entries"))
    }

    fn skip(&mut self, scalar: Scalar, count: u64) -> Result<(), String> {
        if self.format == Format::Ascii {
            return (0..count).try_for_each(|_| self.word().map(|_| ()));
        }
        let bytes = usize::try_from(count)
            .ok()
            .and_then(|n| n.checked_mul(scalar.size()));
        let rest = bytes.and_then(|n| self.bytes.get(n..)).ok_or(CUT_OFF)?;
        self.bytes = rest;
        Ok(())
    }
}

/// A mesh as binary PLY (little-endian), its positions in double precision: every digit. The hull
/// around it, if there is one, is in elements of its own, which other programs skip.
/// `comment` goes into its header, and should be one line.
pub fn to_ply(mesh: &Mesh, hull: Option<&Mesh>, comment: &str) -> Vec<u8> {
    let meshes = || {
        [(mesh, ["vertex", "face"])]
            .into_iter()
            .chain(hull.map(|hull| (hull, OF_HULL)))
    };
    let mut header = format!("ply\nformat binary_little_endian 1.0\ncomment {comment}\n");
    for (mesh, [corners, faces]) in meshes() {
        header += &format!(
            "element {corners} {}\nproperty double x\nproperty double y\nproperty double z\n\
             element {faces} {}\nproperty list uchar uint vertex_indices\n",
            mesh.positions.len(),
            mesh.triangles.len()
        );
    }
    header += "end_header\n";
    let size = |(mesh, _): (&Mesh, _)| 24 * mesh.positions.len() + 13 * mesh.triangles.len();
    let mut bytes = Vec::with_capacity(header.len() + meshes().map(size).sum::<usize>());
    bytes.extend(header.into_bytes());
    for (mesh, _) in meshes() {
        for position in &mesh.positions {
            bytes.extend(position.to_array().iter().flat_map(|x| x.to_le_bytes()));
        }
        for triangle in &mesh.triangles {
            bytes.push(3);
            bytes.extend(triangle.iter().flat_map(|i| i.to_le_bytes()));
        }
    }
    bytes
}
