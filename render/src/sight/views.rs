//! Source views that are asked only about what they may see.

use super::reach::{Beam, Reach, Stretch, may_within, reaches};
use super::{sees, sees_well};
use crate::frame::FrameSource;
use glam::DVec3;
use std::sync::OnceLock;
#[cfg(test)]
use std::sync::atomic::{AtomicU64, Ordering};

/// A frame's source views.
pub(crate) struct Views<'a> {
    pub(super) sources: &'a [FrameSource],
    /// Made when first asked for.
    reaches: OnceLock<Vec<Reach>>,
    /// How often one was asked whether it sees a point.
    #[cfg(test)]
    pub(super) asked: AtomicU64,
}

impl<'a> Views<'a> {
    pub(crate) fn new(sources: &'a [FrameSource]) -> Self {
        Self {
            sources,
            reaches: OnceLock::new(),
            #[cfg(test)]
            asked: AtomicU64::new(0),
        }
    }

    fn reaches(&self) -> &[Reach] {
        // No other thread takes part in making it: those that ask meanwhile wait, and for little.
        self.reaches.get_or_init(|| reaches(self.sources))
    }

    /// Those that may see something within a beam: all that do are among them; in order.
    pub(super) fn within(&self, beam: &Beam) -> impl Iterator<Item = u32> {
        let numbered = (0..).zip(self.reaches());
        let may = may_within(beam);
        numbered.filter_map(move |(i, reach)| may(reach).then_some(i))
    }

    /// The first so many of some of which that is true.
    pub(super) fn first_within(&self, among: &[u32], beam: &Beam, most: usize) -> Vec<u32> {
        let reaches = self.reaches();
        let may = may_within(beam);
        let may = among.iter().filter(|i| may(&reaches[**i as usize]));
        may.take(most).copied().collect()
    }

    /// Those of some that may see something along a ray, up to an inverse distance; and where on it; in order.
    pub(super) fn along(
        &self,
        among: &[u32],
        ray: DVec3,
        nearest: f64,
        found: &mut Vec<(u32, Stretch)>,
    ) {
        let reaches = self.reaches();
        let stretch = |i: &u32| (*i, reaches[*i as usize].along(ray));
        found.clear();
        let all = among.iter().map(stretch);
        found.extend(all.filter(|(_, stretch)| stretch.has_any(nearest)));
    }

    /// Whether one, if there is that many, sees the point at ray / s.
    pub(super) fn sees(&self, view: usize, ray: DVec3, s: f64) -> bool {
        let asked = self.sources.get(view);
        asked.is_some_and(|source| {
            self.count();
            sees(source, ray, s)
        })
    }

    /// The first of some that sees the point at ray / s, where s is zero or more.
    pub(super) fn first(
        &self,
        among: impl IntoIterator<Item = u32>,
        ray: DVec3,
        s: f64,
    ) -> Option<usize> {
        let reaches = self.reaches();
        let mut views = among.into_iter().map(|i| i as usize);
        views.find(|&i| reaches[i].along(ray).has(s) && self.sees(i, ray, s))
    }

    /// The first of those along a ray that has the point at ray / s beyond doubt of rounding.
    pub(super) fn first_well(&self, along: &[(u32, Stretch)], ray: DVec3, s: f64) -> Option<usize> {
        let mut views = along.iter().filter(|(_, stretch)| stretch.has(s));
        let found = views.find(|(i, _)| {
            self.count();
            sees_well(&self.sources[*i as usize], ray, s)
        });
        found.map(|(i, _)| *i as usize)
    }

    fn count(&self) {
        #[cfg(test)]
        {
            self.asked.fetch_add(1, Ordering::Relaxed);
        }
    }
}
