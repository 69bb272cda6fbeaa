//! Numbers in a glTF file, every bound checked.

use super::buffers::Buffers;
use crate::mesh::MeshFileError;
use glam::DVec3;
use serde::Deserialize;
use std::path::Path;

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Accessor {
    buffer_view: Option<usize>,
    #[serde(default)]
    byte_offset: usize,
    component_type: u32,
    #[serde(default)]
    normalized: bool,
    count: usize,
    #[serde(rename = "type")]
    kind: Kind,
    sparse: Option<Box<Sparse>>,
}

/// Elements of an accessor that are not where the others are, which may all be 0.
#[derive(Deserialize)]
struct Sparse {
    count: usize,
    /// Which they are.
    indices: SparsePart,
    values: SparsePart,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct SparsePart {
    buffer_view: usize,
    #[serde(default)]
    byte_offset: usize,
    /// Of values, the accessor's.
    component_type: Option<u32>,
}

#[derive(Deserialize, PartialEq)]
#[serde(rename_all = "UPPERCASE")]
enum Kind {
    Scalar,
    Vec2,
    Vec3,
    Vec4,
    #[serde(other)]
    Other,
}

impl Kind {
    fn components(&self) -> usize {
        match self {
            Self::Vec2 => 2,
            Self::Vec3 => 3,
            Self::Vec4 => 4,
            Self::Scalar | Self::Other => 1,
        }
    }
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct BufferView {
    buffer: usize,
    #[serde(default)]
    byte_offset: usize,
    byte_length: usize,
    byte_stride: Option<usize>,
}

pub(super) struct Accessors<'a> {
    pub(super) path: &'a Path,
    pub(super) accessors: &'a [Accessor],
    pub(super) views: &'a [BufferView],
    pub(super) buffers: Buffers<'a>,
}

/// Where numbers are in the file, as it says.
struct Layout {
    view: Option<usize>,
    byte_offset: usize,
    component_type: u32,
    /// Of each element.
    components: usize,
    count: usize,
}

/// Where the elements of an accessor lie.
struct Elements<'a> {
    bytes: &'a [u8],
    stride: usize,
    accessor: &'a Accessor,
}

impl Elements<'_> {
    /// The bytes of one, from its beginning.
    fn at(&self, i: usize) -> &[u8] {
        self.bytes.get(i * self.stride..).unwrap_or_default()
    }

    /// The first three numbers of one.
    fn triple(&self, i: usize) -> DVec3 {
        let (kind, is_normalized) = (self.accessor.component_type, self.accessor.normalized);
        let component = |k: usize| real(self.at(i), kind, is_normalized, k);
        DVec3::new(component(0), component(1), component(2))
    }
}

impl Accessor {
    fn layout(&self) -> Layout {
        Layout {
            view: self.buffer_view,
            byte_offset: self.byte_offset,
            component_type: self.component_type,
            components: self.kind.components(),
            count: self.count,
        }
    }
}

impl SparsePart {
    fn layout(&self, component_type: u32, components: usize, count: usize) -> Layout {
        Layout {
            view: Some(self.buffer_view),
            byte_offset: self.byte_offset,
            component_type,
            components,
            count,
        }
    }
}

impl Accessors<'_> {
    fn failed(&self, number: usize, problem: impl Into<String>) -> MeshFileError {
        MeshFileError::Record {
            path: self.path.to_owned(),
            record: format!("accessor {number}"),
            problem: problem.into(),
        }
    }

    /// How many elements an accessor has, all of them in the file.
    pub(super) fn count(&mut self, number: usize) -> Result<usize, MeshFileError> {
        self.elements(number)
            .map(|elements| elements.accessor.count)
    }

    fn elements(&mut self, number: usize) -> Result<Elements<'_>, MeshFileError> {
        let accessors = self.accessors;
        let Some(accessor) = accessors.get(number) else {
            return Err(self.failed(number, "there is no such accessor"));
        };
        if accessor.sparse.is_some() {
            let problem =
                "it is sparse, which is not read; export the mesh again without sparse accessors";
            return Err(self.failed(number, problem));
        }
        self.located(number, accessor, &accessor.layout())
    }

    /// The elements of an accessor that lie so.
    fn located<'b>(
        &'b mut self,
        number: usize,
        accessor: &'b Accessor,
        layout: &Layout,
    ) -> Result<Elements<'b>, MeshFileError> {
        let view = layout.view.and_then(|i| self.views.get(i));
        let Some(view) = view else {
            let remedy = self.buffers.remedy();
            let problem = format!("it has no numbers in the file (no buffer view){remedy}");
            return Err(self.failed(number, problem));
        };
        let Some(size) = size(layout.component_type).map(|size| layout.components * size) else {
            let problem = format!("unknown component type {}", layout.component_type);
            return Err(self.failed(number, problem));
        };
        let stride = view.byte_stride.unwrap_or(size);
        if stride < size {
            let problem = format!("elements of {size} bytes, {stride} bytes apart");
            return Err(self.failed(number, problem));
        }
        // Of the accessor within the view, and of the view within the buffer.
        let length = match layout.count.checked_sub(1) {
            None => Some(0),
            Some(others) => others.checked_mul(stride).and_then(|n| n.checked_add(size)),
        };
        let end = length.and_then(|n| n.checked_add(layout.byte_offset));
        let from = view.byte_offset.checked_add(layout.byte_offset);
        let is_within = end.is_some_and(|end| end <= view.byte_length);
        let (buffer, views) = (view.buffer, self.views.len());
        let range = match (from, length, is_within) {
            (Some(from), Some(length), true) => from..from.saturating_add(length),
            _ => {
                let problem = format!(
                    "its {} elements do not fit into their buffer view (of {views}); is the \
                     file cut off?",
                    layout.count
                );
                return Err(self.failed(number, problem));
            }
        };
        let path = self.path;
        let bytes = self.buffers.bytes(buffer)?;
        match bytes.get(range) {
            Some(bytes) => Ok(Elements {
                bytes,
                stride,
                accessor,
            }),
            None => Err(MeshFileError::Record {
                path: path.to_owned(),
                record: format!("accessor {number}"),
                problem: format!(
                    "its elements lie beyond the {} bytes of buffer {buffer}; is the file cut \
                     off?",
                    bytes.len()
                ),
            }),
        }
    }

    /// Three numbers each, as positions are; `what` they are.
    pub(super) fn triples(
        &mut self,
        number: usize,
        what: &str,
    ) -> Result<impl Iterator<Item = DVec3>, MeshFileError> {
        self.check_kind(number, Kind::Vec3, what)?;
        let elements = self.elements(number)?;
        let accessor = elements.accessor;
        Ok((0..accessor.count).map(move |i| elements.triple(i)))
    }

    /// Three numbers each of so many elements, which may be sparse; `what` they are.
    pub(super) fn filled_triples(
        &mut self,
        number: usize,
        count: usize,
        what: &str,
    ) -> Result<Vec<DVec3>, MeshFileError> {
        self.check_kind(number, Kind::Vec3, what)?;
        let accessors = self.accessors;
        let Some(accessor) = accessors.get(number) else {
            return Err(self.failed(number, "there is no such accessor"));
        };
        if accessor.count != count {
            let problem = format!("{} {what} for {count} corners", accessor.count);
            return Err(self.failed(number, problem));
        }
        let Some(sparse) = &accessor.sparse else {
            return Ok(self.triples(number, what)?.collect());
        };
        // 1. What all are that are not listed.
        let mut filled: Vec<DVec3> = match accessor.buffer_view {
            Some(_) => {
                let elements = self.located(number, accessor, &accessor.layout())?;
                (0..count).map(|i| elements.triple(i)).collect()
            }
            None => vec![DVec3::ZERO; count],
        };
        // 2. Those that are.
        let kind = sparse.indices.component_type.unwrap_or_default();
        if !INDEX_KINDS.contains(&kind) {
            return Err(self.failed(number, "indices must be unsigned whole numbers"));
        }
        let listed = sparse.indices.layout(kind, 1, sparse.count);
        let elements = self.located(number, accessor, &listed)?;
        let index = |i: usize| real(elements.at(i), kind, false, 0) as usize;
        let indices: Vec<usize> = (0..sparse.count).map(index).collect();
        if let Some(beyond) = indices.iter().find(|index| **index >= count) {
            let problem = format!("it lists element {beyond}, but has only {count}");
            return Err(self.failed(number, problem));
        }
        let components = accessor.kind.components();
        let listed = &sparse.values;
        let listed = listed.layout(accessor.component_type, components, sparse.count);
        let elements = self.located(number, accessor, &listed)?;
        for (i, index) in indices.into_iter().enumerate() {
            filled[index] = elements.triple(i);
        }
        Ok(filled)
    }

    /// Four numbers each, as rotations are; `what` they are.
    pub(super) fn quadruples(
        &mut self,
        number: usize,
        what: &str,
    ) -> Result<impl Iterator<Item = [f64; 4]>, MeshFileError> {
        self.check_kind(number, Kind::Vec4, what)?;
        self.vectors(number)
    }

    /// Whether an accessor, if it is there, has vectors of a kind.
    fn check_kind(&self, number: usize, kind: Kind, what: &str) -> Result<(), MeshFileError> {
        match self.accessors.get(number) {
            Some(accessor) if accessor.kind != kind => {
                let problem = format!("{what} must be of type VEC{}", kind.components());
                Err(self.failed(number, problem))
            }
            _ => Ok(()),
        }
    }

    /// Two to four numbers each; those that an accessor lacks are 1.
    pub(super) fn vectors(
        &mut self,
        number: usize,
    ) -> Result<impl Iterator<Item = [f64; 4]>, MeshFileError> {
        let elements = self.elements(number)?;
        let accessor = elements.accessor;
        let components = accessor.kind.components();
        let (kind, is_normalized) = (accessor.component_type, accessor.normalized);
        Ok((0..accessor.count).map(move |i| {
            let component = |k: usize| match k < components {
                true => real(elements.at(i), kind, is_normalized, k),
                false => 1.0,
            };
            [0, 1, 2, 3].map(component)
        }))
    }

    /// The bytes of a buffer view, as a picture has them.
    pub(super) fn view_bytes(&mut self, number: usize) -> Result<&[u8], MeshFileError> {
        let failed = |problem: &str| MeshFileError::Record {
            path: self.path.to_owned(),
            record: format!("buffer view {number}"),
            problem: problem.to_owned(),
        };
        let view = self.views.get(number);
        let view = view.ok_or_else(|| failed("there is no such buffer view"))?;
        let end = view.byte_offset.checked_add(view.byte_length);
        let beyond = failed("it lies beyond its buffer; is the file cut off?");
        let bytes = self.buffers.bytes(view.buffer)?;
        let range = end.map(|end| view.byte_offset..end);
        range.and_then(|r| bytes.get(r)).ok_or(beyond)
    }

    /// Whole numbers.
    pub(super) fn indices(
        &mut self,
        number: usize,
    ) -> Result<impl Iterator<Item = u32>, MeshFileError> {
        let fits = |a: &Accessor| a.kind == Kind::Scalar && INDEX_KINDS.contains(&a.component_type);
        if self.accessors.get(number).is_some_and(|a| !fits(a)) {
            return Err(self.failed(number, "indices must be unsigned whole numbers"));
        }
        let elements = self.elements(number)?;
        let kind = elements.accessor.component_type;
        Ok((0..elements.accessor.count).map(move |i| real(elements.at(i), kind, false, 0) as u32))
    }
}

/// Component types of whole numbers that are not negative.
const INDEX_KINDS: [u32; 3] = [5121, 5123, 5125];

/// Bytes of a component.
fn size(component_type: u32) -> Option<usize> {
    match component_type {
        5120 | 5121 => Some(1),
        5122 | 5123 => Some(2),
        5125 | 5126 => Some(4),
        _ => None,
    }
}

/// Component `k` of an element; whole numbers in -1…1 or 0…1 where they are normalised. NaN
/// where the element is short, which [`Accessors::elements`] excludes.
fn real(element: &[u8], component_type: u32, is_normalized: bool, k: usize) -> f64 {
    fn at<const N: usize>(bytes: &[u8], k: usize) -> Option<[u8; N]> {
        bytes.get(k * N..)?.first_chunk().copied()
    }
    let (value, most) = match component_type {
        5120 => (at(element, k).map(|b| i8::from_le_bytes(b).into()), 127.0),
        5121 => (at(element, k).map(|b| u8::from_le_bytes(b).into()), 255.0),
        5122 => (
            at(element, k).map(|b| i16::from_le_bytes(b).into()),
            32767.0,
        ),
        5123 => (
            at(element, k).map(|b| u16::from_le_bytes(b).into()),
            65535.0,
        ),
        5125 => (
            at(element, k).map(|b| u32::from_le_bytes(b).into()),
            f64::from(u32::MAX),
        ),
        _ => (at(element, k).map(|b| f32::from_le_bytes(b).into()), 1.0),
    };
    let value: f64 = value.unwrap_or(f64::NAN);
    let is_whole = component_type != 5126;
    if is_normalized && is_whole {
        (value / most).max(-1.0)
    } else {
        value
    }
}
