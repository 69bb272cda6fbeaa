//! How directions and places are spread.

use glam::{DMat3, DVec3};
use nalgebra::{Matrix3, SymmetricEigen};

/// A vector times itself: summed over many, how they are spread.
pub fn outer(v: DVec3) -> DMat3 {
    DMat3::from_cols(v * v.x, v * v.y, v * v.z)
}

/// Eigenvalues and unit eigenvectors of a symmetric matrix, the largest first. Of one that is not finite zeros, and the
/// axes as they are.
pub fn principal_axes(spread: DMat3) -> [(f64, DVec3); 3] {
    if !spread.is_finite() {
        return [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| (0.0, axis));
    }
    let eigen = SymmetricEigen::new(Matrix3::from_column_slice(&spread.to_cols_array()));
    let mut pairs = [0, 1, 2].map(|i| {
        let v = eigen.eigenvectors.column(i);
        (eigen.eigenvalues[i], DVec3::new(v[0], v[1], v[2]))
    });
    pairs.sort_by(|x, y| y.0.total_cmp(&x.0));
    pairs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_those_along_which_places_are_spread() {
        let turn = glam::DQuat::from_euler(glam::EulerRot::XYZ, 0.4, -1.1, 0.3);
        let along = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| turn * axis);
        let spread = outer(along[0] * 2.0) + outer(along[1] * 3.0) + outer(along[2]);
        for ((value, axis), (expected, along)) in principal_axes(spread).into_iter().zip([
            (9.0, along[1]),
            (4.0, along[0]),
            (1.0, along[2]),
        ]) {
            assert!((value - expected).abs() < 1e-12);
            assert!(axis.cross(along).length() < 1e-12);
        }
        assert_eq!(principal_axes(outer(DVec3::NAN))[0], (0.0, DVec3::X));
    }
}
