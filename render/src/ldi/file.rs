//! LDIs as files, version 3. `docs/ldi.md` says the same at length, for who reads them elsewhere.
//!
//! Little-endian, every part at a multiple of 8 bytes:
//!
//! | bytes | |
//! |---|---|
//! | 8 | `LUMI-LDI` |
//! | 4, 4 | version; length of the header up to the row offsets |
//! | 7 × 8 | `camera_from_world`: quaternion x, y, z, w, translation |
//! | 4 × 8 | focal lengths, principal point, in pixels |
//! | 8 | near: the least depth, world units |
//! | 4 × 4 | portal, width, height, checksum of all bytes but its own |
//! | 4 × (height + 1) | how many samples are before each row; all |
//! | width × height | how many samples each pixel has |
//! | 12 each | samples, back to front: rgb8, a byte of [`Ends`], f32 inverse depth, two i8 offsets, u16 look |

use super::layered::pinhole_view;
use super::{Ends, Layered, LdiError, Look, Sample};
use bytemuck::{Pod, Zeroable};
use calibrate::Rigid3;
use glam::{DQuat, DVec2, DVec3};
use proxy::interior::SemicircleView;
use std::io::Write;
use std::mem::offset_of;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Why a file is no LDI.
#[derive(Debug, thiserror::Error)]
pub enum LdiFileError {
    /// It cannot be read.
    #[error("{}: {source}", .path.display())]
    Io {
        /// Of the file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// It cannot be written.
    #[error("{}: cannot write: {source}", .path.display())]
    Write {
        /// Of the file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// It begins otherwise.
    #[error("{}: no LDI: it does not begin with LUMI-LDI", .0.display())]
    Magic(PathBuf),
    /// Of a version that this program does not know.
    #[error("{}: LDI version {found}; expected {VERSION}; make it again", .path.display())]
    Version {
        /// Of the file.
        path: PathBuf,
        /// In the file.
        found: u32,
    },
    /// Its size is not what its header says.
    #[error("{}: {found} bytes, expected {expected} for {what}; make it again", .path.display())]
    Size {
        /// Of the file.
        path: PathBuf,
        /// Bytes in the file.
        found: u64,
        /// Bytes that it should have.
        expected: u64,
        /// What the file was to hold.
        what: String,
    },
    /// A row begins elsewhere than its pixels' counts say.
    #[error("{}: row {row} begins at sample {found}, expected {expected}; make it again", .path.display())]
    Row {
        /// Of the file.
        path: PathBuf,
        /// From 0; its height stands for the end.
        row: u32,
        /// In the file.
        found: u32,
        /// The sum of the counts before.
        expected: u64,
    },
    /// It is of another portal, or of its other side.
    #[error("{}: an LDI of {found}, expected {expected}; make it again", .path.display())]
    Side {
        /// Of the file.
        path: PathBuf,
        /// What it is of.
        found: String,
        /// What it was to be of.
        expected: String,
    },
    /// Its bytes are not those that were written.
    #[error("{}: damaged: its checksum is another; make it again", .0.display())]
    Checksum(PathBuf),
    /// The quaternion of its camera's rotation is none.
    #[error(
        "{}: its camera's rotation is a quaternion of length {length}, expected 1; make it again",
        .path.display()
    )]
    Rotation {
        /// Of the file.
        path: PathBuf,
        /// As in the file.
        length: f64,
    },
    /// What it holds is no LDI.
    #[error("{}: {source}; make it again", .path.display())]
    Content {
        /// Of the file.
        path: PathBuf,
        /// Why.
        source: LdiError,
    },
}

/// What is wrong, of what a [`LdiFileError`] says: without that the file is to be made again, for who does that,
/// or tells how.
pub fn fault(said: &str) -> &str {
    said.strip_suffix("; make it again").unwrap_or(said)
}

const MAGIC: [u8; 8] = *b"LUMI-LDI";
const VERSION: u32 = 3;

/// As the file begins.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Header {
    magic: [u8; 8],
    version: u32,
    length: u32,
    /// As bits, for machines of either order.
    pose: [u64; 7],
    lens: [u64; 4],
    near: u64,
    portal: u32,
    width: u32,
    height: u32,
    checksum: u32,
}

const HEADER: usize = size_of::<Header>();
/// Where the checksum is.
const CHECKSUM: Range<usize> = offset_of!(Header, checksum)..HEADER;

/// A sample as the file has it.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Record {
    color: [u8; 3],
    ends: u8,
    inverse_depth: u32,
    offset: [i8; 2],
    look: u16,
}

/// Rounded up to a multiple of 8.
fn padded(bytes: u64) -> u64 {
    bytes.div_ceil(8).saturating_mul(8)
}

/// Reads an LDI.
///
/// # Errors
/// A file that cannot be read, or is none, or contradicts itself, or has other bytes than were written.
pub fn read(path: &Path) -> Result<Layered, LdiFileError> {
    let io = |source| LdiFileError::Io {
        path: path.to_owned(),
        source,
    };
    let content = std::fs::read(path).map_err(io)?;
    let ldi = parse(path, &content)?;
    if content[CHECKSUM] != checksum(&content).to_le_bytes() {
        return Err(LdiFileError::Checksum(path.to_owned()));
    }
    Ok(ldi)
}

/// Reads an LDI whose camera stands at a place before a portal.
///
/// # Errors
/// As [`read`]; an LDI of another place.
pub fn read_before(path: &Path, place: &SemicircleView) -> Result<Layered, LdiFileError> {
    let ldi = read(path)?;
    let (found, expected) = (ldi.view.camera_from_world, place.camera_from_world);
    if ldi.portal == place.portal.0 && found == expected {
        return Ok(ldi);
    }
    let named = |portal: u32, pose: Rigid3| format!("portal {portal} from {:.3}", pose.center());
    Err(LdiFileError::Side {
        path: path.to_owned(),
        found: named(ldi.portal, found),
        expected: named(place.portal.0, expected),
    })
}

/// Reads an LDI from a file's content, whatever its checksum; `path` is for errors.
///
/// # Errors
/// As [`read`], but for bytes that were changed and make an LDI all the same.
pub fn parse(path: &Path, content: &[u8]) -> Result<Layered, LdiFileError> {
    let path = || path.to_owned();
    let size = |expected: u64, what: &str| LdiFileError::Size {
        path: path(),
        found: content.len() as u64,
        expected,
        what: what.to_owned(),
    };
    let is_magic = content.starts_with(&MAGIC);
    if !is_magic {
        return Err(LdiFileError::Magic(path()));
    }
    let head = content
        .get(..HEADER)
        .ok_or_else(|| size(HEADER as u64, "a header"))?;
    let header: Header = bytemuck::pod_read_unaligned(head);
    let version = u32::from_le(header.version);
    if version != VERSION {
        return Err(LdiFileError::Version {
            path: path(),
            found: version,
        });
    }
    // Sizes, before anything is made as large as they say.
    let start = u64::from(u32::from_le(header.length));
    let [width, height] = [header.width, header.height].map(u32::from_le);
    let what = format!("an LDI of {width} × {height} pixels");
    let pixels = u64::from(width) * u64::from(height);
    let counts_at = start + padded(4 * (u64::from(height) + 1));
    let samples_at = counts_at.saturating_add(padded(pixels));
    let found = content.len() as u64;
    if start < HEADER as u64 || start % 8 != 0 || found < samples_at {
        return Err(size(samples_at.max(HEADER as u64), &what));
    }
    let part = |from: u64, bytes: u64| &content[from as usize..(from + bytes) as usize];
    let counts = part(counts_at, pixels);
    let total: u64 = counts.iter().map(|n| u64::from(*n)).sum();
    let bytes = total * size_of::<Record>() as u64;
    if found != samples_at + bytes {
        let what = format!("{what} and {total} samples");
        return Err(size(samples_at + bytes, &what));
    }
    // Rows.
    let rows = part(start, 4 * (u64::from(height) + 1)).chunks_exact(4);
    let mut expected = 0_u64;
    for (row, offset) in rows.enumerate() {
        let found = u32::from_le(bytemuck::pod_read_unaligned(offset));
        if u64::from(found) != expected {
            return Err(LdiFileError::Row {
                path: path(),
                row: row as u32,
                found,
                expected,
            });
        }
        let pixels = counts.chunks(width.max(1) as usize).nth(row).unwrap_or(&[]);
        expected += pixels.iter().map(|n| u64::from(*n)).sum::<u64>();
    }
    // The camera and the samples.
    let number = |bits: u64| f64::from_bits(u64::from_le(bits));
    let [x, y, z, w, tx, ty, tz] = header.pose.map(number);
    let [fx, fy, cx, cy] = header.lens.map(number);
    let pose = Rigid3 {
        rotation: DQuat::from_xyzw(x, y, z, w),
        translation: DVec3::new(tx, ty, tz),
    };
    let content_error = |source| LdiFileError::Content {
        path: path(),
        source,
    };
    let length = pose.rotation.length();
    if !((length - 1.0).abs() < 1e-6) {
        return Err(LdiFileError::Rotation {
            path: path(),
            length,
        });
    }
    let view = pinhole_view(
        pose,
        DVec2::new(fx, fy),
        DVec2::new(cx, cy),
        [width, height],
    );
    let records = part(samples_at, bytes).chunks_exact(size_of::<Record>());
    let samples = records.map(|bytes| {
        let record: Record = bytemuck::pod_read_unaligned(bytes);
        let [r, g, b] = record.color;
        Sample {
            color: [r, g, b, 255],
            inverse_depth: f32::from_bits(u32::from_le(record.inverse_depth)),
            offset: record.offset,
            look: Look(u16::from_le(record.look)),
            ends: Ends(record.ends & 15),
        }
    });
    Layered::new(view, u32::from_le(header.portal), counts, samples).map_err(content_error)
}

/// Writes an LDI: to a temporary name beside it, the process's own, which is then renamed.
///
/// # Errors
/// The file cannot be written.
pub fn write(path: &Path, ldi: &Layered) -> Result<(), LdiFileError> {
    let beside = path.with_extension(format!("{}.ldi.part", std::process::id()));
    let written = std::fs::File::create(&beside)
        .and_then(|mut file| file.write_all(&bytes(ldi)))
        .and_then(|()| std::fs::rename(&beside, path));
    written.map_err(|source| {
        // What is half written is no use; that it cannot be removed no other error.
        let _ = std::fs::remove_file(&beside);
        LdiFileError::Write {
            path: path.to_owned(),
            source,
        }
    })
}

fn bytes(ldi: &Layered) -> Vec<u8> {
    let [width, height] = ldi.size();
    let (pose, lens) = (&ldi.view.camera_from_world, &ldi.view.lens);
    let (q, t) = (pose.rotation, pose.translation);
    let bits = |v: f64| v.to_bits().to_le();
    let header = Header {
        magic: MAGIC,
        version: VERSION.to_le(),
        length: (HEADER as u32).to_le(),
        pose: [q.x, q.y, q.z, q.w, t.x, t.y, t.z].map(bits),
        lens: [
            lens.focal.x,
            lens.focal.y,
            lens.principal.x,
            lens.principal.y,
        ]
        .map(bits),
        near: bits(ldi.near),
        portal: ldi.portal.to_le(),
        width: width.to_le(),
        height: height.to_le(),
        // Once there are all bytes.
        checksum: 0,
    };
    let mut bytes = bytemuck::bytes_of(&header).to_vec();
    let pad = |bytes: &mut Vec<u8>| bytes.resize(padded(bytes.len() as u64) as usize, 0);
    for row in 0..=height {
        let before = match row < height {
            true => ldi.samples_of(0..0, row).start,
            false => ldi.len(),
        };
        bytes.extend((before as u32).to_le_bytes());
    }
    pad(&mut bytes);
    bytes.extend(ldi.counts());
    pad(&mut bytes);
    for sample in ldi.samples() {
        let [r, g, b, _] = sample.color;
        let record = Record {
            color: [r, g, b],
            ends: sample.ends.0,
            inverse_depth: sample.inverse_depth.to_bits().to_le(),
            offset: sample.offset,
            look: sample.look.0.to_le(),
        };
        bytes.extend(bytemuck::bytes_of(&record));
    }
    let sum = checksum(&bytes).to_le_bytes();
    bytes[CHECKSUM].copy_from_slice(&sum);
    bytes
}

/// Of a file's bytes but its own, against damage, not people. In words of 8 bytes, so that it takes a small part of
/// what reading them does; each step has an inverse, so that no change of one word leaves the sum, but for the half
/// of it that is cut off in the end.
fn checksum(content: &[u8]) -> u32 {
    const FACTOR: u64 = 0x9e37_79b9_7f4a_7c15;
    let (before, rest) = content.split_at(CHECKSUM.start);
    let mut sum = content.len() as u64;
    let mut add = |word: [u8; 8]| {
        sum = (sum ^ u64::from_le_bytes(word)).wrapping_mul(FACTOR);
        sum ^= sum >> 32;
    };
    for part in [before, &rest[CHECKSUM.len()..]] {
        let (words, end) = part.as_chunks();
        words.iter().for_each(|word| add(*word));
        let mut last = [0; 8];
        last[..end.len()].copy_from_slice(end);
        add(last);
    }
    sum as u32
}
