//! Gains of all photos beside better ones of some.

/// The gains that some photos have by a better estimate, and of the others those by one of `all`, relative to the same
/// photos: only ratios of gains are seen, so that two estimates differ by a factor in each channel.
///
/// Both are by photo.
pub fn completed(better: &[Option<[f64; 3]>], all: &[[f64; 3]]) -> Vec<[f64; 3]> {
    let factor: [f64; 3] = std::array::from_fn(|c| {
        let both = better.iter().zip(all);
        let logs = both.filter_map(|(better, all)| Some((better.as_ref()?[c] / all[c]).ln()));
        let (sum, count) = logs.fold((0.0_f64, 0_u32), |(sum, count), log| (sum + log, count + 1));
        (sum / f64::from(count.max(1))).exp()
    });
    let other = |all: &[f64; 3]| std::array::from_fn(|c| factor[c] * all[c]);
    let each = better.iter().zip(all);
    each.map(|(better, all)| better.unwrap_or_else(|| other(all)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_others_keep_their_ratio_to_those_that_are_known() {
        let all = [[1.0, 2.0, 0.5], [2.0, 2.0, 2.0], [0.5, 0.25, 1.0]];
        let better = [Some([1.5, 2.0, 0.25]), None, Some([0.75, 0.25, 0.5])];
        let found = completed(&better, &all);
        assert_eq!([found[0], found[2]], [[1.5, 2.0, 0.25], [0.75, 0.25, 0.5]]);
        for (found, expected) in found[1].iter().zip([3.0, 2.0, 1.0]) {
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        }
        assert_eq!(completed(&[None; 3], &all), all);
        assert!(completed(&[], &[]).is_empty());
    }
}
