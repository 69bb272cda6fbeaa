//! The binary format: little endian, each file a count and that many records.
//!
//! No count is believed before the bytes it announces are there.

use super::check;
use super::error::{ColmapError, Place, malformed};
use crate::{
    Camera, CameraId, Image, ImageId, Keypoint, ModelKind, Point3D, Point3DId, Reconstruction,
};
use std::collections::BTreeMap;
use std::io::{self, Write};
use std::path::Path;

/// Stands for "no point" in a keypoint.
const NO_POINT: u64 = u64::MAX;
/// Bytes of a camera without its parameters: id, model, width, height.
const CAMERA_BYTES: usize = 24;
/// Bytes of an image without keypoints: id, pose, camera, a name of its end alone, count.
pub(super) const IMAGE_BYTES: usize = 73;
/// Bytes of a point that no image sees: id, position, colour, error, count.
const POINT_BYTES: usize = 51;
/// Bytes of a keypoint: x, y and a point's id.
const KEYPOINT_BYTES: usize = 24;
/// Bytes of a track's element: an image's id and a keypoint's index.
const TRACK_BYTES: usize = 8;

/// Reads `cameras.bin`.
pub(super) fn read_cameras(
    path: &Path,
    bytes: &[u8],
) -> Result<BTreeMap<CameraId, Camera>, ColmapError> {
    read_records(path, bytes, "camera", CAMERA_BYTES, |cursor| {
        let id = cursor.u32("its id")?;
        let place = cursor.place();
        let model_id = cursor.u32("its model")?.cast_signed();
        let model = ModelKind::from_colmap_id(model_id).ok_or_else(|| {
            let path = path.to_owned();
            ColmapError::UnknownModel {
                path,
                place,
                camera_id: id,
                model: model_id.to_string(),
            }
        })?;
        let width = cursor.side("width")?;
        let height = cursor.side("height")?;
        let params = model
            .parameter_names()
            .iter()
            .map(|name| cursor.f64(name))
            .collect::<Result<_, _>>()?;
        let camera = Camera {
            model,
            width,
            height,
            params,
        };
        Ok((CameraId(id), camera))
    })
}

/// Reads `images.bin`.
pub(super) fn read_images(
    path: &Path,
    bytes: &[u8],
) -> Result<BTreeMap<ImageId, Image>, ColmapError> {
    read_records(path, bytes, "image", IMAGE_BYTES, |cursor| {
        let id = cursor.u32("its id")?;
        let wxyz = cursor.f64s("its rotation")?;
        let translation = cursor.f64s("its translation")?;
        let camera_from_world = cursor.accept(check::pose(wxyz, translation))?;
        let camera_id = CameraId(cursor.u32("its camera's id")?);
        let name = cursor.string("its name")?;
        let name = cursor.accept(check::name(name))?;
        let keypoints = read_keypoints(cursor)?;
        let image = Image {
            name,
            camera_id,
            camera_from_world,
            keypoints,
        };
        Ok((ImageId(id), image))
    })
}

fn read_keypoints(cursor: &mut Cursor<'_>) -> Result<Vec<Keypoint>, ColmapError> {
    let stored = cursor.elements::<KEYPOINT_BYTES>("keypoints")?;
    let mut keypoints = Vec::with_capacity(stored.len());
    for (index, bytes) in stored.iter().enumerate() {
        let (words, _) = bytes.as_chunks();
        let [x, y] = [0, 1].map(|i| f64::from_le_bytes(words[i]));
        let point = u64::from_le_bytes(words[2]);
        let point = (point != NO_POINT).then_some(Point3DId(point));
        keypoints.push(check::keypoint(index, x, y, point).map_err(|problem| {
            cursor.offset -= KEYPOINT_BYTES * (stored.len() - index - 1);
            cursor.malformed(problem)
        })?);
    }
    Ok(keypoints)
}

/// Reads `points3D.bin`.
pub(super) fn read_points(
    path: &Path,
    bytes: &[u8],
) -> Result<BTreeMap<Point3DId, Point3D>, ColmapError> {
    read_records(path, bytes, "point", POINT_BYTES, |cursor| {
        let id = cursor.u64("its id")?;
        let position = check::position(id, cursor.f64s("its position")?);
        let position = cursor.accept(position)?;
        let color = cursor.take("its colour")?;
        let error_px = check::error_px(cursor.f64("its error")?);
        let track = cursor.elements::<TRACK_BYTES>("track elements")?;
        let track = track.iter().map(|bytes| {
            let (words, _) = bytes.as_chunks();
            let [image_id, keypoint] = [0, 1].map(|i| u32::from_le_bytes(words[i]));
            (ImageId(image_id), keypoint)
        });
        let point = Point3D {
            position,
            color,
            error_px,
            track: track.collect(),
        };
        Ok((Point3DId(id), point))
    })
}

/// Reads the count, calls `read` for each record of at least `least_bytes`, and expects
/// nothing after the last, and no id twice.
fn read_records<Id: Copy + Ord + Into<u64>, Record>(
    path: &Path,
    bytes: &[u8],
    kind: &'static str,
    least_bytes: usize,
    mut read: impl FnMut(&mut Cursor<'_>) -> Result<(Id, Record), ColmapError>,
) -> Result<BTreeMap<Id, Record>, ColmapError> {
    let mut cursor = Cursor {
        path,
        bytes,
        offset: 0,
        kind,
        number: 0,
        count: 0,
    };
    cursor.count = cursor.u64("their number")?;
    let room = (cursor.count as usize).min(cursor.left() / least_bytes);
    let mut records = Vec::with_capacity(room);
    let mut ends = Vec::with_capacity(room);
    for number in 1..=cursor.count {
        cursor.number = number;
        records.push(read(&mut cursor)?);
        ends.push(cursor.offset);
    }
    let left = cursor.left();
    if left > 0 {
        let end = format!("{left} bytes follow the last {kind}, expected the file's end");
        return Err(cursor.malformed(end));
    }
    // COLMAP writes them by id, and the map is made in one go; its older versions wrote
    // them in any order.
    if !records.is_sorted_by(|(a, _), (b, _)| a < b) {
        if let Some(twice) = first_repeated(records.iter().map(|&(id, _)| id)) {
            (cursor.number, cursor.offset) = (twice as u64 + 1, ends[twice]);
            return Err(cursor.malformed(check::twice(kind, records[twice].0)));
        }
        records.sort_unstable_by_key(|&(id, _)| id);
    }
    Ok(records.into_iter().collect())
}

/// The index of the first id that was there before.
fn first_repeated<Id: Copy + Ord>(ids: impl Iterator<Item = Id>) -> Option<usize> {
    let mut by_id: Vec<(Id, usize)> = ids.zip(0..).collect();
    by_id.sort_unstable();
    let repeated = by_id.windows(2).filter(|pair| pair[0].0 == pair[1].0);
    repeated.map(|pair| pair[1].1).min()
}

/// The bytes of a file, read from front to back.
struct Cursor<'a> {
    path: &'a Path,
    bytes: &'a [u8],
    offset: usize,
    /// What its records are.
    kind: &'static str,
    /// The record being read, the first being 1; 0 for the file's head.
    number: u64,
    /// How many records the file announces.
    count: u64,
}

impl<'a> Cursor<'a> {
    fn place(&self) -> Place {
        let record = match self.number {
            0 => format!("the number of {}s", self.kind),
            number => format!("{} {number} of {}", self.kind, self.count),
        };
        Place::Byte {
            record,
            offset: self.offset as u64,
        }
    }

    fn malformed(&self, problem: String) -> ColmapError {
        malformed(self.path, self.place(), problem)
    }

    /// Says where a problem is.
    fn accept<T>(&self, checked: Result<T, String>) -> Result<T, ColmapError> {
        checked.map_err(|problem| self.malformed(problem))
    }

    fn left(&self) -> usize {
        self.bytes.len() - self.offset
    }

    fn take<const N: usize>(&mut self, what: &str) -> Result<[u8; N], ColmapError> {
        let Some(&bytes) = self.bytes[self.offset..].first_chunk() else {
            return Err(self.malformed(format!(
                "the file is cut short: {} bytes left, expected {N} for {what}",
                self.left()
            )));
        };
        self.offset += N;
        Ok(bytes)
    }

    fn u32(&mut self, what: &str) -> Result<u32, ColmapError> {
        self.take(what).map(u32::from_le_bytes)
    }

    fn u64(&mut self, what: &str) -> Result<u64, ColmapError> {
        self.take(what).map(u64::from_le_bytes)
    }

    fn f64(&mut self, what: &str) -> Result<f64, ColmapError> {
        self.take(what).map(f64::from_le_bytes)
    }

    fn f64s<const N: usize>(&mut self, what: &str) -> Result<[f64; N], ColmapError> {
        let mut numbers = [0.0; N];
        for number in &mut numbers {
            *number = self.f64(what)?;
        }
        Ok(numbers)
    }

    /// An image's width or height.
    fn side(&mut self, name: &str) -> Result<u32, ColmapError> {
        let place = self.place();
        let side = self.u64(name)?;
        u32::try_from(side).map_err(|_| {
            let problem = format!("the {name} is {side}, expected fewer than 2³² pixels");
            malformed(self.path, place, problem)
        })
    }

    /// A count and as many `elements` of `N` bytes each, if there is room for them.
    fn elements<const N: usize>(&mut self, elements: &str) -> Result<&'a [[u8; N]], ColmapError> {
        let start = self.offset;
        let count = self.u64(elements)?;
        let (room, _) = self.bytes[self.offset..].as_chunks();
        let found = usize::try_from(count)
            .ok()
            .and_then(|count| room.get(..count));
        let found = found.ok_or_else(|| {
            let problem = format!(
                "the file is cut short or garbled: {count} {elements} announced, but the {} \
                 bytes left hold at most {}",
                self.left(),
                room.len()
            );
            self.offset = start;
            self.malformed(problem)
        })?;
        self.offset += N * found.len();
        Ok(found)
    }

    /// A string that ends with a zero byte.
    fn string(&mut self, what: &str) -> Result<&'a str, ColmapError> {
        let rest = &self.bytes[self.offset..];
        let Some(length) = rest.iter().position(|&byte| byte == 0) else {
            return Err(self.malformed(format!(
                "the file is cut short: {what} does not end with a zero byte"
            )));
        };
        let string = str::from_utf8(&rest[..length])
            .map_err(|_| self.malformed(format!("{what} is not UTF-8 text")))?;
        self.offset += length + 1;
        Ok(string)
    }
}

/// Writes `cameras.bin`.
pub(super) fn write_cameras(model: &Reconstruction, out: &mut dyn Write) -> io::Result<()> {
    write_u64(out, model.cameras.len() as u64)?;
    for (id, camera) in &model.cameras {
        write_u32(out, id.0)?;
        let model = camera
            .model
            .colmap_id()
            .ok_or(io::ErrorKind::InvalidInput)?;
        out.write_all(&model.to_le_bytes())?;
        write_u64(out, u64::from(camera.width))?;
        write_u64(out, u64::from(camera.height))?;
        write_f64s(out, &camera.params)?;
    }
    Ok(())
}

/// Writes `images.bin`.
pub(super) fn write_images(model: &Reconstruction, out: &mut dyn Write) -> io::Result<()> {
    write_u64(out, model.images.len() as u64)?;
    for (id, image) in &model.images {
        write_u32(out, id.0)?;
        let [x, y, z, w] = image.camera_from_world.rotation.to_array();
        write_f64s(out, &[w, x, y, z])?;
        write_f64s(out, &image.camera_from_world.translation.to_array())?;
        write_u32(out, image.camera_id.0)?;
        out.write_all(image.name.as_bytes())?;
        out.write_all(&[0])?;
        write_u64(out, image.keypoints.len() as u64)?;
        for &Keypoint { x, y, point } in &image.keypoints {
            write_f64s(out, &[x, y])?;
            write_u64(out, point.map_or(NO_POINT, |point| point.0))?;
        }
    }
    Ok(())
}

/// Writes `points3D.bin`.
pub(super) fn write_points(model: &Reconstruction, out: &mut dyn Write) -> io::Result<()> {
    write_u64(out, model.points.len() as u64)?;
    for (id, point) in &model.points {
        write_u64(out, id.0)?;
        write_f64s(out, &point.position.to_array())?;
        out.write_all(&point.color)?;
        write_f64s(out, &[point.error_px])?;
        write_u64(out, point.track.len() as u64)?;
        for &(image_id, keypoint) in &point.track {
            write_u32(out, image_id.0)?;
            write_u32(out, keypoint)?;
        }
    }
    Ok(())
}

fn write_u32(out: &mut dyn Write, value: u32) -> io::Result<()> {
    out.write_all(&value.to_le_bytes())
}

fn write_u64(out: &mut dyn Write, value: u64) -> io::Result<()> {
    out.write_all(&value.to_le_bytes())
}

fn write_f64s(out: &mut dyn Write, values: &[f64]) -> io::Result<()> {
    for value in values {
        out.write_all(&value.to_le_bytes())?;
    }
    Ok(())
}
