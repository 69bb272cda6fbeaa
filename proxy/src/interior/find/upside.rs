//! Whether a storey may have been found upside down.

use super::Level;
use crate::mesh::Mesh;

/// Surfaces this near to level are tops of things; degrees.
const LEVEL: f64 = 8.0;
/// What is nearer to the floor's height is floor; metres.
const FLOOR: f64 = 0.15;
/// Things stand on the floor, and hang from the ceiling, between these distances; metres.
const THINGS: [f64; 2] = [0.25, 1.2];
/// The mean height of all between floor and ceiling is more than this, in heights of the ceiling: upright houses with
/// things in them have 0.44 to 0.46, empty ones 0.50, and those that are upside down 0.54 or more.
const MEAN: f64 = 0.53;
/// So many times as much lies level below the ceiling as over the floor, and so much of the floor's area.
const TIMES: f64 = 2.0;
const LEAST: f64 = 0.2;

/// Whether more hangs from a ceiling at a height over the floor, in world units, than stands on the floor, by far.
pub(super) fn is_upside_down(mesh: &Mesh, level: &Level, ceiling: f64, meter: f64) -> bool {
    let [near, far] = THINGS.map(|distance| distance * meter);
    let least = LEVEL.to_radians().cos();
    let [mut floor, mut below, mut above] = [0.0; 3];
    let [mut all, mut moment] = [0.0; 2];
    for i in 0..mesh.triangles.len() {
        let [a, b, c] = mesh.corners(i);
        let across = (b - a).cross(c - a);
        let area = 0.5 * across.length();
        if !(area > 0.0 && area.is_finite()) {
            continue;
        }
        let height = level.height((a + b + c) / 3.0);
        let down = ceiling - height;
        if height > near && down > near {
            all += area;
            moment += area * height;
        }
        if across.dot(level.up()).abs() < least * across.length() {
            continue;
        }
        if height.abs() < FLOOR * meter {
            floor += area;
        }
        if height > near && height < far {
            below += area;
        }
        if down > near && down < far {
            above += area;
        }
    }
    moment > MEAN * all * ceiling && above > TIMES * below && above > LEAST * floor
}
