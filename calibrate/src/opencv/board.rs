//! The calibration board: its corners in the world, where z = 0, and in each photo.

use super::cameras::OpenCvCamera;
use super::values::Values;
use crate::{Pixel, Rigid3};
use glam::DVec3;

/// A calibration board and where its corners were found.
#[derive(Clone, Debug, PartialEq)]
pub struct Board {
    /// The corners in the world, in the units of the board's squares.
    pub corners: Vec<DVec3>,
    /// For each view the same corners' pixels, the first pixel's centre at (0.5, 0.5).
    pub found: Vec<Vec<Pixel>>,
}

/// Where half of the corners miss by more, they are those of another pattern (circles in a
/// quincunx, a board counted the other way round), which would miss by squares.
const MEDIAN_ERROR_PX: f64 = 5.0;

/// The board of a file whose corners project to where they were found; else nothing, with
/// a note if the file seemed to have one.
pub(super) fn board(
    values: &Values<'_>,
    camera: &OpenCvCamera,
    poses: &[Rigid3],
    notes: &mut Vec<String>,
) -> Option<Board> {
    let found = values.find_within(&["imagepoints"])?.node.matrix()?;
    let count = found.cols;
    if (found.channels, found.rows) != (2, poses.len()) || found.data.is_empty() {
        return None;
    }
    let board = Board {
        corners: corners(values, count)?,
        found: found
            .data
            .chunks_exact(2 * count)
            .map(|row| {
                row.chunks_exact(2)
                    .map(|p| Pixel::new(p[0] + 0.5, p[1] + 0.5))
                    .collect()
            })
            .collect(),
    };
    let numbers = found.data.iter().all(|v| v.is_finite());
    if !numbers || !board.corners.iter().all(|c| c.is_finite()) {
        notes.push(
            "the board's corners, or where they were found, are not all numbers: they are left out"
                .to_owned(),
        );
        return None;
    }
    let error = median_error_px(&board, camera, poses);
    if error <= MEDIAN_ERROR_PX {
        return Some(board);
    }
    notes.push(format!(
        "half of the board's corners miss their images by {error:.1} pixels or more: they are \
         left out, and the board may not be a chessboard of the width and height that the file says"
    ));
    None
}

/// The corners as given, else row by row with the file's square size.
fn corners(values: &Values<'_>, count: usize) -> Option<Vec<DVec3>> {
    let given = values.find_within(&["gridpoints", "objectpoints"]);
    if let Some(given) = given.and_then(|named| named.node.matrix())
        && given.data.len() == 3 * count
    {
        return Some(given.data.chunks_exact(3).map(DVec3::from_slice).collect());
    }
    let number = |names: &[&str]| values.find_within(names)?.node.number();
    let width = number(&["boardwidth"])?;
    let height = number(&["boardheight"])?;
    let (dx, dy) = match number(&["squaresize"]) {
        Some(size) => (size, size),
        None => (number(&["squarewidth"])?, number(&["squareheight"])?),
    };
    if width * height != count as f64 || width < 1.0 || width.fract() != 0.0 {
        return None;
    }
    let width = width as usize;
    let corner = |i: usize| DVec3::new((i % width) as f64 * dx, (i / width) as f64 * dy, 0.0);
    Some((0..count).map(corner).collect())
}

fn median_error_px(board: &Board, camera: &OpenCvCamera, poses: &[Rigid3]) -> f64 {
    let mut errors = Vec::new();
    for (pose, found) in poses.iter().zip(&board.found) {
        for (corner, pixel) in board.corners.iter().zip(found) {
            let projected = camera.lens.project(*pose * *corner);
            errors.push(projected.map_or(f64::INFINITY, |p| p.distance(*pixel)));
        }
    }
    errors.sort_by(f64::total_cmp);
    errors[errors.len() / 2]
}
