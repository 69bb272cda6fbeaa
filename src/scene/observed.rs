//! Sparse points that no photo observes: models of other programs have points without tracks. Where it matters who
//! sees what they count as none; where it does not, they are as good as any.

use super::fit::{Kind, unfit};
use super::{Scene, SceneError};
use calibrate::View;
use proxy::SparsePoint;
use std::collections::BTreeSet;

impl Kind {
    /// Whether observations of sparse points have a say in it.
    fn asks_who_observes(self) -> bool {
        match self {
            Self::Plane
            | Self::ViewPlane
            | Self::Points
            | Self::Carved
            | Self::Dense
            | Self::CarvedDense => true,
            // Made of where points are, or of none.
            Self::DominantPlane | Self::Tunnel | Self::Hull | Self::Depth => false,
        }
    }
}

impl Scene {
    /// [`Self::sparse_points`], those alone that one of the named photos observes.
    pub(super) fn observed_points(
        &self,
        without: &BTreeSet<String>,
        names: &[String],
    ) -> Vec<SparsePoint> {
        observed(self.sparse_points(without, names))
    }

    /// [`Self::sparse`], those points alone that one of the views observes.
    pub(super) fn observed(
        &self,
        without: &BTreeSet<String>,
    ) -> Result<(Vec<View>, Vec<SparsePoint>), SceneError> {
        let (views, points) = self.sparse(without)?;
        Ok((views, observed(points)))
    }

    /// How many of the sparse points any photo observes.
    pub(super) fn observed_count(&self) -> usize {
        let points = self.reconstruction.points.values();
        points.filter(|point| !point.track.is_empty()).count()
    }

    /// Fails where there is nothing that a kind of proxy is made of: sparse points, and who observes them.
    pub(super) fn needs_observed(&self, kind: Kind) -> Result<(), SceneError> {
        let name = kind.name();
        let others = "try dense, carved-dense or plane";
        match (self.reconstruction.points.len(), self.observed_count()) {
            (0, _) => Err(unfit(format!(
                "the scene has no sparse points, which the {name} proxy is made of; {others}"
            ))),
            (count, 0) => Err(unfit(format!(
                "no photo observes any of the {count} sparse points (the calibration has no tracks of \
                 them), and the {name} proxy is made of who observes which; {others}"
            ))),
            _ => Ok(()),
        }
    }

    /// What people should know of points that no photo observes, where they might expect a kind of proxy (`None`
    /// for the choice among all) to use them.
    pub fn note_of_unobserved(&self, kind: Option<Kind>) -> Option<String> {
        let count = self.reconstruction.points.len();
        let unobserved = count - self.observed_count();
        if unobserved == 0 || kind.is_some_and(|kind| !kind.asks_who_observes()) {
            return None;
        }
        Some(format!(
            "no photo observes {unobserved} of {count} sparse points (the calibration has no tracks of \
             them): dominant-plane and tunnel are fitted to them, other proxies as if they were not there"
        ))
    }
}

fn observed(mut points: Vec<SparsePoint>) -> Vec<SparsePoint> {
    points.retain(|point| !point.seen_by.is_empty());
    points
}
