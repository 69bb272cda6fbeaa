//! How well what is fitted follows from what it is fitted to.

use glam::DVec3;
use nalgebra::{DMatrix, Matrix3, SymmetricEigen};

/// Beyond this condition number a fit is ill-posed: relative errors of what it rests on come out
/// that many times as large, a thousandth as three per cent.
pub const ILL_CONDITIONED: f64 = 30.0;

/// The direction in which a cloud is thinnest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Thinnest {
    /// A unit vector.
    pub(crate) direction: DVec3,
    /// By how much errors of the points, relative to the cloud's extent, turn it, in radians: 1 for a
    /// disc; infinite for a ball and a line, which have no such direction.
    pub(crate) condition: f64,
}

/// `None` without a point.
pub(crate) fn thinnest(points: impl Iterator<Item = DVec3> + Clone) -> Option<Thinnest> {
    let first = points.clone().next()?;
    let count = points.clone().count() as f64;
    let mean = first + points.clone().map(|p| p - first).sum::<DVec3>() / count;
    let mut covariance = Matrix3::<f64>::zeros();
    for point in points {
        let d = nalgebra::Vector3::from((point - mean).to_array());
        covariance += d * d.transpose();
    }
    let eigen = SymmetricEigen::new(covariance);
    let thinnest = eigen.eigenvectors.column(eigen.eigenvalues.imin());
    let mut spread: Vec<f64> = eigen.eigenvalues.iter().copied().collect();
    spread.sort_by(f64::total_cmp);
    // An eigenvector turns by errors over the gap to the next (Stewart and Sun 1990, §V.2).
    let condition = (spread[2] / (spread[1] - spread[0])).sqrt();
    Some(Thinnest {
        direction: DVec3::new(thinnest[0], thinnest[1], thinnest[2]),
        condition: if condition.is_nan() {
            f64::INFINITY
        } else {
            condition
        },
    })
}

/// The condition number of least squares with these normal equations, whatever the unknowns' units:
/// of the matrix scaled to ones on its diagonal (van der Sluis 1969), the root of its eigenvalues'
/// ratio. Unknowns that nothing tells of are left out.
pub(crate) fn of_normal_equations(matrix: &DMatrix<f64>) -> f64 {
    let told: Vec<usize> = (0..matrix.nrows())
        .filter(|&i| matrix[(i, i)] > 0.0)
        .collect();
    if told.is_empty() {
        return f64::INFINITY;
    }
    let scaled = DMatrix::from_fn(told.len(), told.len(), |i, j| {
        let (i, j) = (told[i], told[j]);
        matrix[(i, j)] / (matrix[(i, i)] * matrix[(j, j)]).sqrt()
    });
    let values = SymmetricEigen::new(scaled).eigenvalues;
    let condition = (values.max() / values.min().max(0.0)).sqrt();
    if condition.is_nan() {
        f64::INFINITY
    } else {
        condition
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_disc_has_a_thinnest_direction_and_a_needle_none() {
        let ellipse = |short: f64| {
            (0..100).map(move |i| {
                let (sin, cos) = f64::from(i).sin_cos();
                DVec3::new(cos, short * sin, 1e-4 * f64::from(i % 3))
            })
        };
        let disc = thinnest(ellipse(1.0)).unwrap();
        assert!(disc.direction.z.abs() > 0.999_999 && disc.condition < 1.1);
        let needle = thinnest(ellipse(1e-3)).unwrap();
        assert!(needle.condition > 500.0, "{}", needle.condition);
        let line = (0..9).map(|i| DVec3::splat(f64::from(i)));
        assert!(thinnest(line).unwrap().condition > 1e6);
        assert_eq!(
            thinnest([DVec3::ONE; 4].into_iter()).unwrap().condition,
            f64::INFINITY
        );
        assert_eq!(thinnest(std::iter::empty()), None);
    }

    #[test]
    fn units_do_not_change_how_well_posed_equations_are() {
        let of =
            |unit: f64| DMatrix::from_row_slice(2, 2, &[1.0, 0.6 * unit, 0.6 * unit, unit * unit]);
        let expected = (1.6_f64 / 0.4).sqrt();
        for unit in [1e-6, 1.0, 1e6] {
            assert!((of_normal_equations(&of(unit)) - expected).abs() < 1e-9);
        }
        let mut more = of(1.0).insert_row(2, 0.0).insert_column(2, 0.0);
        assert!((of_normal_equations(&more) - expected).abs() < 1e-9);
        more.fill(1.0);
        assert!(of_normal_equations(&more) > 1e6);
        assert_eq!(of_normal_equations(&DMatrix::zeros(3, 3)), f64::INFINITY);
    }
}
