//! What the fuzz targets share: the bound on memory, inputs that stand for several files,
//! and what must hold of whatever a parser accepts.

pub mod model;

use calibrate::Reconstruction;
use calibrate::opencv::{self, FileStorage, Keys};
use peak_alloc::PeakAlloc;
use proxy::Proxy;
use std::path::Path;

#[global_allocator]
static ALLOCATED: PeakAlloc = PeakAlloc;

/// Bytes that a parser may hold at once for every byte of its input. Each `0,` of a JSON
/// array is a value of 32 bytes in a vector that doubles; an object of one empty name, 7
/// bytes of text, is the most expensive.
pub const BYTES_PER_BYTE: usize = 256;
/// Bytes that it may hold besides: tables, messages.
const BYTES_BESIDES: usize = 1 << 20;
/// Bytes that making a mesh ready for rays may hold for each of its triangles: several boxes
/// each, sorted. A byte of a file may be a triangle.
const BYTES_PER_TRIANGLE: usize = 1 << 10;

/// Runs a parser and panics where it held more than its share of memory; `allowed` is what
/// it may hold beyond `input` bytes' share, judged by its result.
pub fn within_memory<T>(
    input: usize,
    work: impl FnOnce() -> T,
    allowed: impl Fn(&T) -> usize,
) -> T {
    let before = ALLOCATED.current_usage();
    ALLOCATED.reset_peak_usage();
    let result = work();
    let held = ALLOCATED.peak_usage().saturating_sub(before);
    let share = input * BYTES_PER_BYTE + BYTES_BESIDES + allowed(&result);
    assert!(
        held <= share,
        "{held} bytes held for {input} bytes read, expected {share}"
    );
    result
}

/// Runs a parser of reconstructions, and checks what it accepts.
pub fn reconstruction<E: std::error::Error>(
    input: usize,
    parse: impl FnOnce() -> Result<Reconstruction, E>,
) {
    match within_memory(input, parse, |_| 0) {
        Ok(whole) => check(&whole),
        Err(error) => assert!(!error.to_string().is_empty()),
    }
}

/// What [`calibrate`] promises of every reconstruction.
fn check(whole: &Reconstruction) {
    assert!(!whole.images.is_empty());
    for camera in whole.cameras.values() {
        camera.lens().expect("every camera has a lens");
    }
    let mut names = std::collections::BTreeSet::new();
    for image in whole.images.values() {
        assert!(names.insert(&image.name), "no two images share a name");
        assert!(whole.cameras.contains_key(&image.camera_id));
        let pose = image.camera_from_world;
        assert!(pose.is_finite());
        assert!((pose.rotation.length() - 1.0).abs() < 1e-12);
        for keypoint in &image.keypoints {
            assert!(keypoint.x.is_finite() && keypoint.y.is_finite());
            assert!(
                keypoint
                    .point
                    .is_none_or(|id| whole.points.contains_key(&id))
            );
        }
    }
    for point in whole.points.values() {
        assert!(point.position.is_finite() && point.error_px.is_finite());
        for (image, keypoint) in &point.track {
            assert!((*keypoint as usize) < whole.images[image].keypoints.len());
        }
    }
}

/// A storage file that begins with `start`, and the calibration in it.
pub fn opencv(start: &[u8], data: &[u8], bytes_per_byte: usize) {
    let path = Path::new("camera");
    let bytes = [start, data].concat();
    let parse = || {
        let storage = FileStorage::parse(path, &bytes).ok()?;
        Some(opencv::calibration(path, &storage, &Keys::default()))
    };
    let calibration = match within_memory(bytes.len() * bytes_per_byte, parse, |_| 0) {
        None => return,
        Some(Err(error)) => return assert!(!error.to_string().is_empty()),
        Some(Ok(calibration)) => calibration,
    };
    let names: Vec<String> = (0..calibration.photo_poses().len())
        .map(|i| i.to_string())
        .collect();
    let whole = calibration.reconstruction(&names, (640, 480));
    if !whole.images.is_empty() {
        check(&whole);
    }
}

/// The three files that an input stands for: after the lengths of the first two as u16.
pub fn three(data: &[u8]) -> [&[u8]; 3] {
    let Some((lengths, rest)) = data.split_first_chunk::<4>() else {
        return [data, &[], &[]];
    };
    let length = |i: usize| usize::from(u16::from_le_bytes([lengths[i], lengths[i + 1]]));
    let (first, rest) = rest.split_at(length(0).min(rest.len()));
    let (second, third) = rest.split_at(length(2).min(rest.len()));
    [first, second, third]
}

/// The input that stands for three files, where they are short enough.
pub fn joined(files: [&[u8]; 3]) -> Option<Vec<u8>> {
    let [first, second, third] = files;
    let mut joined = Vec::new();
    for file in [first, second] {
        joined.extend(u16::try_from(file.len()).ok()?.to_le_bytes());
    }
    joined.extend([first, second, third].concat());
    Some(joined)
}

/// Sizes of photos by name: one in four is unknown.
pub fn size_of(name: &str) -> Option<(u32, u32)> {
    let side = name.bytes().fold(0_u32, |sum, byte| {
        sum.wrapping_mul(31).wrapping_add(byte.into())
    });
    (side % 4 != 0).then_some((1 + side % 5000, 1 + side / 5000 % 5000))
}

/// A mesh file of that name, read and checked.
pub fn mesh(name: &str, data: &[u8]) {
    let parse = || proxy::mesh::parse(Path::new(name), data);
    match within_memory(data.len(), parse, |_| 0) {
        Ok(mesh) => {
            assert!(!mesh.triangles.is_empty());
            assert!(mesh.positions.iter().all(|p| p.is_finite()));
            let indices = mesh.triangles.as_flattened();
            assert!(indices.iter().all(|i| (*i as usize) < mesh.positions.len()));
        }
        Err(error) => assert!(!error.to_string().is_empty()),
    }
}

/// A proxy's file of that name, read and checked: a mesh, and the hull around it if there is one.
pub fn solid(name: &str, data: &[u8]) {
    let parse = || proxy::parse(Path::new(name), data);
    let read = within_memory(data.len(), parse, |read| match read {
        Ok(Proxy::Mesh(solid)) => BYTES_PER_TRIANGLE * solid.triangle_count(),
        _ => 0,
    });
    match read {
        Ok(Proxy::Mesh(solid)) => {
            assert!(!solid.mesh().triangles.is_empty());
            for i in 0..solid.triangle_count() {
                assert!(solid.corners(i).iter().all(|p| p.is_finite()));
            }
        }
        Ok(other) => panic!("a mesh's file is no {}", other.kind()),
        Err(error) => assert!(!error.to_string().is_empty()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proxy::MeshKind;

    #[test]
    fn the_seed_of_a_proxy_has_all_that_its_file_may() {
        let seed = include_bytes!("../seeds/mesh_ply/hull");
        solid("seed.ply", seed);
        let Ok(Proxy::Mesh(read)) = proxy::parse(Path::new("seed.ply"), seed) else {
            panic!("a mesh");
        };
        assert_eq!((read.kind(), read.occludes()), (MeshKind::Carved, false));
        let hull = read.within().expect("a hull");
        assert_eq!((hull.kind(), hull.triangle_count()), (MeshKind::Hull, 4));
        assert_eq!(read.triangle_count(), 5);
    }
}
