/// What a setting costs: the less of either, the better.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cost {
    /// For example in CPU milliseconds.
    pub time: f64,
    /// For example dB less than the best.
    pub error: f64,
}

impl Cost {
    /// Whether this is no worse in either and better in one by more than what counts for nothing:
    /// `time_share` of the other's time, and `error_step`.
    pub fn dominates(&self, other: &Self, time_share: f64, error_step: f64) -> bool {
        let faster = self.time < other.time * (1.0 - time_share);
        let nearer = self.error < other.error - error_step;
        (faster && self.error <= other.error) || (nearer && self.time <= other.time)
    }
}

/// The settings on the Pareto front, fastest first: each has less error than all that are as fast
/// or faster. Of equal ones the first is taken; those with a NaN never are.
pub fn front(costs: &[Cost]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..costs.len())
        .filter(|&i| !costs[i].time.is_nan() && !costs[i].error.is_nan())
        .collect();
    order.sort_by(|&a, &b| {
        let by_time = costs[a].time.total_cmp(&costs[b].time);
        by_time.then(costs[a].error.total_cmp(&costs[b].error))
    });
    let mut least = f64::INFINITY;
    order.retain(|&i| {
        let is_less = costs[i].error < least;
        least = least.min(costs[i].error);
        is_less
    });
    order
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn cost(time: f64, error: f64) -> Cost {
        Cost { time, error }
    }

    #[test]
    fn only_what_nothing_beats_is_on_the_front() {
        let costs = [
            cost(3.0, 1.0),
            cost(1.0, 5.0),
            cost(2.0, 5.0),
            cost(1.0, 6.0),
            cost(4.0, 1.0),
            cost(5.0, 0.5),
            cost(f64::NAN, 0.0),
        ];
        assert_eq!(front(&costs), [1, 0, 5]);
        assert_eq!(front(&[]), [0; 0]);
    }

    #[test]
    fn small_gains_do_not_count() {
        let default = cost(100.0, 1.0);
        assert!(!cost(98.0, 1.0).dominates(&default, 0.05, 0.05));
        assert!(cost(90.0, 1.0).dominates(&default, 0.05, 0.05));
        assert!(!cost(90.0, 1.01).dominates(&default, 0.05, 0.05));
        assert!(!cost(100.0, 0.97).dominates(&default, 0.05, 0.05));
        assert!(cost(100.0, 0.9).dominates(&default, 0.05, 0.05));
        assert!(!default.dominates(&default, 0.0, 0.0));
    }

    proptest! {
        #[test]
        fn what_is_off_the_front_is_beaten_by_something_on_it(
            values in prop::collection::vec((0_u8..20, 0_u8..20), 0..30)
        ) {
            let costs: Vec<Cost> = values.iter().map(|&(t, e)| cost(t.into(), e.into())).collect();
            let on = front(&costs);
            for i in 0..costs.len() {
                let beaten = on.iter().any(|&j| {
                    costs[j].time <= costs[i].time && costs[j].error <= costs[i].error
                });
                prop_assert!(beaten);
            }
            for pair in on.windows(2) {
                prop_assert!(costs[pair[0]].time < costs[pair[1]].time);
                prop_assert!(costs[pair[0]].error > costs[pair[1]].error);
            }
        }
    }
}
