//! Proxies in glTF 2.0 binary: what a file says of itself, and a plane to look at.

use crate::Plane;
use crate::mesh::Mesh;
use glam::DVec3;

/// The extras of the first node, as JSON text, if it has any.
pub(crate) fn extras(bytes: &[u8]) -> Result<Option<String>, String> {
    // gltf 1.4 takes the header's 12 bytes off the length that it states, however short.
    if let Some([b'g', b'l', b'T', b'F', _, _, _, _, length @ ..]) = bytes.first_chunk::<12>()
        && (u32::from_le_bytes(*length) as usize) < 12
    {
        return Err("not a glTF file: its header states a length without itself".to_owned());
    }
    // Only the extras matter, and the check of the rest looks up what may not be there.
    let gltf = gltf::Gltf::from_slice_without_validation(bytes)
        .map_err(|e| format!("not a glTF file: {e}"))?;
    let extras = gltf.nodes().next().and_then(|node| node.extras().clone());
    Ok(extras.map(|raw| raw.get().to_owned()))
}

/// The part of a plane around the given points, as a square of two triangles.
///
/// The exact plane travels in the file's `extras`: glTF has no doubles.
pub(crate) fn quad(plane: &Plane, shown: &[DVec3]) -> Mesh {
    // A square large enough for the points' feet on the plane, leaving out the farthest
    // few per cent, which may be anywhere.
    let across = plane.normal().any_orthonormal_vector();
    let along = plane.normal().cross(across);
    let mut reach: Vec<f64> = shown
        .iter()
        .map(|p| *p - plane.point())
        .map(|v| v.dot(across).hypot(v.dot(along)))
        .collect();
    reach.retain(|r| r.is_finite());
    reach.sort_by(f64::total_cmp);
    let half = match reach.len() {
        0 => 1.0,
        n => (reach[(n * 95 / 100).min(n - 1)] * 1.2).max(1e-6),
    };
    let corner = |x: f64, y: f64| plane.point() + across * (x * half) + along * (y * half);
    let positions = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
    Mesh {
        positions: positions.map(|(x, y)| corner(x, y)).to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
    }
}
