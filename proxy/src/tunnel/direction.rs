//! Which way a tunnel may go: along the cameras' path, or where they look.

use super::fitting::ASTRAY_SIGMAS;
use crate::cloud::median;
use calibrate::View;
use glam::{DMat3, DQuat, DVec3};

/// Turns about the vertical tried around each guess of the direction, in degrees.
const TURNS: [f64; 7] = [0.0, -8.0, 8.0, -16.0, 16.0, -30.0, 30.0];

/// Guesses of the tunnel's axes in the world, as columns: right, down, along.
pub(super) fn guesses(views: &[&View], centers: &[DVec3], points: &[DVec3]) -> Vec<DMat3> {
    let mean = |of: fn(&View) -> DVec3| views.iter().map(|v| of(v)).sum::<DVec3>();
    let forward = mean(View::forward).normalize_or(DVec3::Z);
    let up = mean(View::up).normalize_or(forward.any_orthonormal_vector());
    // The path counts where it is long enough to have a direction.
    let distance = median(points.iter().map(|p| p.length()).collect());
    let path = principal_direction(centers)
        .filter(|(_, spread)| *spread > 0.05 * distance)
        .map(|(d, _)| if d.dot(forward) < 0.0 { -d } else { d });
    let mut guesses = Vec::new();
    for along in path.into_iter().chain([forward]) {
        let right = along.cross(up);
        let right = if right.length() > 0.2 {
            right.normalize()
        } else {
            // Going up or down: any way across will do.
            along.any_orthonormal_vector()
        };
        let down = along.cross(right);
        for turn in TURNS {
            let turn = DMat3::from_quat(DQuat::from_axis_angle(down, turn.to_radians()));
            guesses.push(turn * DMat3::from_cols(right, down, along));
        }
    }
    guesses
}

/// The direction of the way through most of the places, and how far they spread along it
/// (standard deviation).
pub(super) fn principal_direction(places: &[DVec3]) -> Option<(DVec3, f64)> {
    let mut kept = places.to_vec();
    let mut found = None;
    for _ in 0..5 {
        let count = kept.len() as f64;
        let mean = kept.iter().sum::<DVec3>() / count;
        let mut covariance = nalgebra::Matrix3::<f64>::zeros();
        for place in &kept {
            let d = nalgebra::Vector3::from((*place - mean).to_array());
            covariance += d * d.transpose() / count;
        }
        let eigen = nalgebra::SymmetricEigen::new(covariance);
        let most = eigen.eigenvalues.imax();
        let d = eigen.eigenvectors.column(most);
        let direction = DVec3::new(d[0], d[1], d[2]).try_normalize()?;
        found = Some((direction, eigen.eigenvalues[most].max(0.0).sqrt()));
        // Without those off the way.
        let aside = |p: &DVec3| (*p - mean).reject_from_normalized(direction).length();
        let limit = 2.0 * ASTRAY_SIGMAS * median(places.iter().map(aside).collect());
        let next: Vec<DVec3> = places
            .iter()
            .copied()
            .filter(|p| aside(p) <= limit)
            .collect();
        if next == kept {
            break;
        }
        kept = next;
    }
    found
}
