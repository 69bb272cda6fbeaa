//! What measuring needs: which settings nothing beats, how time grows, and photo sets of any size.

mod doorways;
mod exponent;
mod front;
pub mod made_up;
mod random;
pub mod stress;

pub use doorways::before_doorways;
pub use exponent::{Exponent, fit_exponent};
pub use front::{Cost, front};
pub use random::Random;

/// The middle one of some values, the mean of the two in the middle where they are even in
/// number; `None` of nothing.
pub fn median(values: &[f64]) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let upper = sorted.get(sorted.len() / 2)?;
    let lower = sorted[(sorted.len() - 1) / 2];
    Some(0.5 * (lower + upper))
}

#[cfg(test)]
mod tests {
    use super::median;

    #[test]
    fn medians() {
        assert_eq!(median(&[]), None);
        assert_eq!(median(&[3.0]), Some(3.0));
        assert_eq!(median(&[9.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median(&[4.0, 1.0, 2.0, 9.0]), Some(3.0));
    }
}
