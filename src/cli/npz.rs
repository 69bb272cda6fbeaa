//! A blending field as numpy's `.npz`.

use glam::DVec3;
use render::Contributions;
use std::fs::File;
use std::io::{self, ErrorKind, Seek, Write};
use std::mem::ManuallyDrop;
use zip::result::ZipError;
use zip::write::FileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

/// A field over the pixels of a picture.
pub(super) struct Weights<'a> {
    pub(super) width: u32,
    /// By source view.
    pub(super) camera_names: Vec<&'a str>,
    /// From the top.
    pub(super) rows: &'a [Row],
}

/// Who paints the pixels of a row: source views and their weights, the largest weight first.
pub(super) struct Row {
    shares: Vec<(i32, f32)>,
    /// By pixel, where its shares end.
    ends: Vec<u32>,
}

impl Row {
    pub(super) fn of(lists: &Contributions) -> Self {
        let mut row = Self {
            shares: Vec::with_capacity(lists.flat().len()),
            ends: Vec::new(),
        };
        for list in lists.iter() {
            let mut list = list.to_vec();
            list.sort_by(|a, b| b.weight.total_cmp(&a.weight));
            let shares = list.iter().map(|c| (c.source_idx as i32, c.weight as f32));
            row.shares.extend(shares);
            row.ends.push(row.shares.len() as u32);
        }
        row.ends.shrink_to_fit();
        row
    }

    /// By pixel.
    fn lists(&self) -> impl Iterator<Item = &[(i32, f32)]> {
        let mut begin = 0;
        self.ends.iter().map(move |end| {
            let end = *end as usize;
            &self.shares[std::mem::replace(&mut begin, end)..end]
        })
    }

    /// Of each pixel so many values, each of a share or of none.
    fn bytes(&self, slots: usize, value: impl Fn(Option<&(i32, f32)>) -> [u8; 4]) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(4 * slots * self.ends.len());
        for list in self.lists() {
            bytes.extend((0..slots).flat_map(|slot| value(list.get(slot))));
        }
        bytes
    }
}

/// Writes the file. `point` tells the proxy point of a pixel in the world, NaN where there is none. Arrays:
///
/// - `camera_names`: N strings;
/// - `ids`: H × W × K, i32, indices into `camera_names`, the largest weight first, −1 where
///   unused;
/// - `weights`: H × W × K, f32, 0 where unused;
/// - `points`: H × W × 3, f64.
pub(super) fn write_npz(
    file: &File,
    field: &Weights<'_>,
    point: impl Fn(u32, u32) -> DVec3,
) -> io::Result<()> {
    let lengths = field.rows.iter().flat_map(Row::lists).map(<[_]>::len);
    let slots = lengths.max().unwrap_or_default().max(1);
    let [height, width] = [field.rows.len(), field.width as usize];
    let by_slot = [height, width, slots];
    let longest = field.camera_names.iter().map(|name| name.chars().count());
    let longest = longest.max().unwrap_or_default().max(1);

    // One that is dropped before its end tries to write that, and says on stderr that it cannot.
    let mut archive = ManuallyDrop::new(Archive(ZipWriter::new(file)));
    let names = field.camera_names.iter().map(|name| {
        // UTF-32, filled up with zeros.
        let letters = name.chars().map(u32::from).chain(std::iter::repeat(0));
        let bytes = letters.take(longest).flat_map(u32::to_le_bytes);
        bytes.collect::<Vec<u8>>()
    });
    let kind = (format!("<U{longest}"), 4 * longest);
    archive.add("camera_names", kind, &[field.camera_names.len()], names)?;
    let id = |share: Option<&(i32, f32)>| share.map_or(-1, |share| share.0).to_le_bytes();
    let ids = field.rows.iter().map(|row| row.bytes(slots, id));
    archive.add("ids", ("<i4".to_owned(), 4), &by_slot, ids)?;
    let weight = |share: Option<&(i32, f32)>| share.map_or(0.0, |share| share.1).to_le_bytes();
    let weights = field.rows.iter().map(|row| row.bytes(slots, weight));
    archive.add("weights", ("<f4".to_owned(), 4), &by_slot, weights)?;
    let points = (0..height as u32).map(|y| {
        let numbers = (0..field.width).flat_map(|x| point(x, y).to_array());
        numbers.flat_map(f64::to_le_bytes).collect::<Vec<u8>>()
    });
    archive.add("points", ("<f8".to_owned(), 8), &[height, width, 3], points)?;
    archive.0.finish().map_err(io_error)?;
    drop(ManuallyDrop::into_inner(archive));
    Ok(())
}

/// The arrays so far, each a file of numpy's `.npy`, version 1.0.
struct Archive<W: Write + Seek>(ZipWriter<W>);

/// Arrays of more bytes may not have their size in 32 bits, compressed or not.
const LARGE: u64 = 0xf000_0000;

/// How many bytes the compressor is shown at once, as long as there are as many. It makes of no more than this what it
/// passes on at once, 32 KiB, be it as much smaller as deflate can make it, about 1,030 times, and what it holds
/// back. So it never comes to the end of what it is shown before the end of all, and makes the same bytes as if
/// it was shown all: where it is cut short it begins anew, with other bytes.
const AHEAD: usize = 40 << 20;

impl<W: Write + Seek> Archive<W> {
    /// Adds an array by its type in numpy's words and the bytes that a value has, its shape, and all of its bytes in
    /// parts, the last axis fastest.
    fn add(
        &mut self,
        name: &str,
        (kind, size): (String, usize),
        shape: &[usize],
        parts: impl Iterator<Item = Vec<u8>>,
    ) -> io::Result<()> {
        let bytes = shape.iter().fold(size as u64, |n, side| n * *side as u64);
        // The same field gives the same bytes: no time of day.
        let options = FileOptions::default()
            .compression_method(CompressionMethod::Deflated)
            .last_modified_time(DateTime::default())
            .large_file(bytes > LARGE);
        let started = self.0.start_file(format!("{name}.npy"), options);
        started.map_err(io_error)?;
        write_in_parts(&mut self.0, AHEAD, header(&kind, shape), parts)
    }
}

/// Writes what comes first, and then parts, showing the writer more than so many bytes at once until the end of all.
fn write_in_parts(
    to: &mut impl Write,
    ahead: usize,
    first: Vec<u8>,
    parts: impl Iterator<Item = Vec<u8>>,
) -> io::Result<()> {
    let mut waiting = first;
    for part in parts {
        waiting.extend(part);
        if waiting.len() < 2 * ahead {
            continue;
        }
        let mut done = 0;
        while waiting.len() - done > ahead {
            match to.write(&waiting[done..])? {
                0 => return Err(ErrorKind::WriteZero.into()),
                count => done += count,
            }
        }
        waiting.drain(..done);
    }
    to.write_all(&waiting)
}

/// As the system told it.
fn io_error(error: ZipError) -> io::Error {
    match error {
        ZipError::Io(error) => error,
        other => other.into(),
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
    use std::io::Cursor;

    /// An archive of one file.
    fn archive(write: impl FnOnce(&mut ZipWriter<Cursor<Vec<u8>>>)) -> Vec<u8> {
        let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
        let options = FileOptions::default().last_modified_time(DateTime::default());
        archive.start_file("a.npy", options).unwrap();
        write(&mut archive);
        archive.finish().unwrap().into_inner()
    }

    #[test]
    fn what_is_written_in_parts_has_the_bytes_of_the_whole() {
        // Some of it new, some as it was not long before, which compresses tenfold at most.
        let mut state = 1_u32;
        let mut noise = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 24) as u8
        };
        let block =
            |noise: &mut dyn FnMut() -> u8| -> Vec<u8> { (0..700).map(|_| noise()).collect() };
        let mut parts: Vec<Vec<u8>> = Vec::new();
        for i in 0..4000 {
            let part = match i % 8 {
                0 => block(&mut noise),
                k => parts[i - k]
                    .iter()
                    .map(|v| (v & 0xfc) | (k as u8 & 3))
                    .collect(),
            };
            parts.push(part);
        }
        let whole = parts.concat();
        let expected = archive(|to| to.write_all(&whole).unwrap());
        let ahead = 1 << 19;
        assert!(whole.len() > 4 * ahead && expected.len() > whole.len() / 10);
        let (first, rest) = parts.split_first().unwrap();
        let found = archive(|to| {
            write_in_parts(to, ahead, first.clone(), rest.iter().cloned()).unwrap();
        });
        assert!(found == expected);
    }

    #[test]
    fn lists_have_the_largest_weight_first_and_stand_side_by_side() {
        let row = Row {
            shares: vec![(4, 0.75), (1, 0.25), (2, 1.0)],
            ends: vec![2, 2, 3],
        };
        let lists: Vec<&[(i32, f32)]> = row.lists().collect();
        let expected: [&[(i32, f32)]; 3] = [&[(4, 0.75), (1, 0.25)], &[], &[(2, 1.0)]];
        assert_eq!(lists, expected);
        let ids = row.bytes(2, |share| share.map_or(-1, |share| share.0).to_le_bytes());
        let ids: Vec<i32> = ids
            .as_chunks()
            .0
            .iter()
            .map(|b| i32::from_le_bytes(*b))
            .collect();
        assert_eq!(ids, [4, 1, -1, -1, 2, -1]);
    }

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
