/// How a time grows with a size: time ∝ size^`exponent`.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Exponent {
    /// The slope of log time over log size.
    pub exponent: f64,
    /// Half the width of its 95 % confidence interval; `None` of two sizes, which leave nothing
    /// to tell it from.
    pub confidence: Option<f64>,
}

/// 97.5 % of Student's t distribution with 1, 2, … degrees of freedom.
const STUDENT: [f64; 10] = [
    12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228,
];
/// And with ever more.
const NORMAL: f64 = 1.960;

/// The power law nearest to some (size, time) pairs: least squares of the logarithms, with
/// Student's interval around the slope. `None` where fewer than two sizes differ or a value is
/// not above zero.
pub fn fit_exponent(points: &[(f64, f64)]) -> Option<Exponent> {
    let is_sound = |v: f64| v > 0.0 && v.is_finite();
    if !points
        .iter()
        .all(|&(size, time)| is_sound(size) && is_sound(time))
    {
        return None;
    }
    let logs: Vec<(f64, f64)> = points.iter().map(|(s, t)| (s.ln(), t.ln())).collect();
    let count = logs.len() as f64;
    let mean_x = logs.iter().map(|p| p.0).sum::<f64>() / count;
    let mean_y = logs.iter().map(|p| p.1).sum::<f64>() / count;
    let spread: f64 = logs.iter().map(|p| (p.0 - mean_x).powi(2)).sum();
    if !(spread > 1e-12) {
        return None;
    }
    let common: f64 = logs.iter().map(|p| (p.0 - mean_x) * (p.1 - mean_y)).sum();
    let exponent = common / spread;
    let off = |p: &(f64, f64)| p.1 - mean_y - exponent * (p.0 - mean_x);
    let left: f64 = logs.iter().map(|p| off(p).powi(2)).sum();
    let freedom = logs.len() - 2;
    let confidence = (freedom > 0).then(|| {
        let quantile = STUDENT.get(freedom - 1).copied().unwrap_or(NORMAL);
        quantile * (left / freedom as f64 / spread).sqrt()
    });
    Some(Exponent {
        exponent,
        confidence,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_power_law_is_found_exactly() {
        let points = [1.0, 10.0, 100.0, 1e3].map(|n: f64| (n, 3.0 * n.powf(0.4)));
        let fit = fit_exponent(&points).unwrap();
        assert!((fit.exponent - 0.4).abs() < 1e-12);
        assert!(fit.confidence.unwrap() < 1e-9);
        assert_eq!(fit_exponent(&points[..2]).unwrap().confidence, None);
    }

    #[test]
    fn what_is_no_law_has_a_wide_interval_or_none() {
        let noisy = [(1.0, 1.0), (10.0, 30.0), (100.0, 9.0)];
        let fit = fit_exponent(&noisy).unwrap();
        assert!(fit.confidence.unwrap() > fit.exponent.abs());
        assert_eq!(fit_exponent(&[]), None);
        assert_eq!(fit_exponent(&[(2.0, 1.0), (2.0, 3.0)]), None);
        assert_eq!(fit_exponent(&[(2.0, 1.0), (4.0, 0.0)]), None);
    }
}
