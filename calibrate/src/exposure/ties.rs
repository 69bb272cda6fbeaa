//! How firmly points tie photos to one another, two by two: the matrix of the gains' least squares, points eliminated.

/// What each two photos have in common in the points that few photos see. A point whose weights are wᵢ and add up to W
/// ties photos i and j by wᵢ·wⱼ / W, and what it says of gains x are the sums Σⱼ wᵢ·wⱼ / W · (xᵢ − xⱼ). Many points have
/// their photos in common, so that to go through ties takes less than through observations.
///
/// A point that n photos see has n² / 2 pairs, however: where they would be more than there are observations, those that
/// most photos see stay out of it.
#[derive(Clone, Debug)]
pub(super) struct Ties {
    /// Of each photo: its observations of the points that few photos see, each with its point, in order.
    seen: Vec<Vec<(usize, usize)>>,
    /// In order of the earlier photo, then of the later.
    ties: Vec<Tie>,
    /// The points that are left out, in order.
    rest: Vec<usize>,
}

#[derive(Clone, Copy, Debug)]
struct Tie {
    earlier: u32,
    later: u32,
    weight: f64,
}

/// Points that more photos see are left out: their pairs take as long to weigh as it takes to go through the points at
/// each iteration of a typical solution. Where ties are too many it is the next number; points of three have no more
/// pairs than observations.
const MOST_PHOTOS: [usize; 5] = [48, 24, 12, 6, 3];

impl Ties {
    /// Those of observations whose photos are `photo`, ordered by point; `start` says where each point's begin, and where the
    /// last one's end. All weights are zero until they are [weighed](Self::weigh).
    pub(super) fn new(photo_count: usize, photo: &[usize], start: &[usize]) -> Self {
        let found = MOST_PHOTOS
            .iter()
            .find_map(|&most| Self::of_points(photo_count, photo, start, most));
        found.expect("three observations are three pairs")
    }

    /// Those of the points that no more than `most` photos see; `None` where they are more than the observations.
    pub(super) fn of_points(
        photo_count: usize,
        photo: &[usize],
        start: &[usize],
        most: usize,
    ) -> Option<Self> {
        let count = |point: usize| start[point + 1] - start[point];
        let points = 0..start.len() - 1;
        let (few, rest): (Vec<usize>, Vec<usize>) = points.partition(|&p| count(p) <= most);
        let mut seen = vec![Vec::new(); photo_count];
        for point in few {
            for i in start[point]..start[point + 1] {
                seen[photo[i]].push((i, point));
            }
        }

        let mut ties: Vec<Tie> = Vec::new();
        let mut is_tied = vec![false; photo_count];
        for (earlier, seen) in seen.iter().enumerate() {
            let first = ties.len();
            for &(i, point) in seen {
                for &later in &photo[i + 1..start[point + 1]] {
                    if !std::mem::replace(&mut is_tied[later], true) {
                        ties.push(Tie {
                            earlier: earlier as u32,
                            later: later as u32,
                            weight: 0.0,
                        });
                    }
                }
            }
            if ties.len() > photo.len() {
                return None;
            }
            let new = &mut ties[first..];
            new.sort_unstable_by_key(|tie| tie.later);
            new.iter()
                .for_each(|tie| is_tied[tie.later as usize] = false);
        }
        Some(Self { seen, ties, rest })
    }

    /// The points left out, in order.
    pub(super) fn rest(&self) -> &[usize] {
        &self.rest
    }

    /// How many there are.
    #[cfg(test)]
    pub(super) fn len(&self) -> usize {
        self.ties.len()
    }

    /// Has them rest on these weights of the observations, which add up to `totals` by point.
    pub(super) fn weigh(
        &mut self,
        photo: &[usize],
        start: &[usize],
        weights: &[f64],
        totals: &[f64],
    ) {
        let mut sums = vec![0.0; self.seen.len()];
        let mut ties = self.ties.iter_mut().peekable();
        for (earlier, seen) in self.seen.iter().enumerate() {
            for &(i, point) in seen {
                if !(totals[point] > 0.0) {
                    continue;
                }
                let share = weights[i] / totals[point];
                for k in i + 1..start[point + 1] {
                    sums[photo[k]] += share * weights[k];
                }
            }
            while let Some(tie) = ties.next_if(|tie| tie.earlier as usize == earlier) {
                tie.weight = std::mem::take(&mut sums[tie.later as usize]);
            }
        }
    }

    /// Adds to each photo's sum its differences from those tied to it, times the ties' weights.
    pub(super) fn add_differences(&self, x: &[f64], sums: &mut [f64]) {
        for tie in &self.ties {
            let (i, j) = (tie.earlier as usize, tie.later as usize);
            let difference = tie.weight * (x[i] - x[j]);
            sums[i] += difference;
            sums[j] -= difference;
        }
    }
}
