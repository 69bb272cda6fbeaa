//! Sparse points that no photo observes: models of other programs have points without tracks. Where it matters who
//! sees what they count as none; where it does not, they are as good as any.

use super::fit::{Kind, unfit};
use super::{Scene, SceneError};
use calibrate::{Reconstruction, View};
use proxy::{FitError, Proxy, SparsePoint};
use std::collections::BTreeSet;

/// What does without sparse points.
const INSTEAD: &str = "try dense, carved-dense or plane";

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
        match self.lack_of_observed(kind.name(), &BTreeSet::new())? {
            Some(lack) => Err(unfit(format!("{lack}; {INSTEAD}"))),
            None => Ok(()),
        }
    }

    /// Why no plane can be fitted to those photos that are left in a part of the reconstruction: that of the points
    /// which they saw with others they share none, or that there is nothing to fit to.
    pub(super) fn lack_of_plane(&self, rest: &Reconstruction) -> SceneError {
        let is_observed = rest.points.values().any(|point| !point.track.is_empty());
        if is_observed || self.observed_count() == 0 {
            return FitError::NoPoints.into();
        }
        let [all, left] = [&self.reconstruction, rest].map(|some| some.images.len());
        let count = self.reconstruction.points.len();
        unfit(format!(
            "the photos that are left ({left} of {all}) share none of the {count} sparse points to fit a plane to, and \
             their optical axes do not meet; leave out fewer, or give the plane by hand (`proxy SCENE plane \
             --point X,Y,Z --normal X,Y,Z`)"
        ))
    }

    /// What people should know of a proxy that is made for every view of the sparse points which the photos but those
    /// of the given names observe: that these observe none, and another surface is drawn.
    ///
    /// # Errors
    /// A camera has no lens.
    pub fn note_of_lack(
        &self,
        proxy: &Proxy,
        without: &BTreeSet<String>,
    ) -> Result<Option<String>, SceneError> {
        if !matches!(proxy, Proxy::ViewPlane | Proxy::Points { .. }) {
            return Ok(None);
        }
        let lack = self.lack_of_observed(proxy.kind(), without)?;
        let left = self.photos.iter().filter(|p| !without.contains(&p.name));
        // One alone agrees with none on what it looks at, whatever the kind.
        let is_alone = left.count() < 2;
        let instead = match is_alone {
            true => String::new(),
            false => format!(": {INSTEAD}"),
        };
        Ok(lack.map(|lack| {
            format!(
                "{lack}; in its place is the plane across what these photos look at, if they tell of one{instead}"
            )
        }))
    }

    /// Why a proxy of a kind's name cannot be made of the sparse points that the photos but those of the given names
    /// observe, if these observe none.
    fn lack_of_observed(
        &self,
        name: &str,
        without: &BTreeSet<String>,
    ) -> Result<Option<String>, SceneError> {
        let observed = self.observed_count();
        let left = match without.is_empty() {
            true => observed,
            false => self.observed(without)?.1.len(),
        };
        let lack = match (self.reconstruction.points.len(), observed, left) {
            (0, ..) => {
                format!("the scene has no sparse points, which the {name} proxy is made of")
            }
            (count, 0, _) => format!(
                "no photo observes any of the {count} sparse points (the calibration has no tracks of \
                 them), and the {name} proxy is made of who observes which"
            ),
            (count, _, 0) => format!(
                "the photos that are left share none of the {count} sparse points, which the {name} \
                 proxy is made of"
            ),
            _ => return Ok(None),
        };
        Ok(Some(lack))
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

#[cfg(test)]
mod tests {
    use super::super::tests::wall;
    use super::*;

    #[test]
    fn photos_that_are_left_may_share_no_points() {
        let (_folder, capture) = wall(6, 1);
        let (scene, _) = Scene::open(&capture, false).unwrap();
        let none = BTreeSet::new();
        let all_but =
            |count: usize| -> BTreeSet<String> { scene.names().into_iter().skip(count).collect() };
        let lack = |without: &BTreeSet<String>| {
            [Proxy::ViewPlane, Proxy::Points { within: None }]
                .map(|proxy| scene.note_of_lack(&proxy, without).unwrap())
        };

        // 1. Two share some. Of one alone, nobody else saw any.
        for without in [&none, &all_but(2)] {
            assert_eq!(lack(without), [None, None]);
        }
        let count = scene.reconstruction.points.len();
        let notes = ["view-plane", "points"].map(|name| {
            Some(format!(
                "the photos that are left share none of the {count} sparse points, which the {name} proxy is made of; \
                 in its place is the plane across what these photos look at, if they tell of one"
            ))
        });
        assert_eq!(lack(&all_but(1)), notes);

        // 2. Other kinds are made before there is a view.
        let plane = scene.fit(Kind::Plane, &none).unwrap().proxy;
        assert_eq!(scene.note_of_lack(&plane, &all_but(1)).unwrap(), None);

        // 3. If they can be: of one alone there is nothing to fit to, though the scene has points.
        let others = all_but(1);
        let fitted = [scene.fit(Kind::Plane, &others), scene.fit_best(&others)];
        let said = format!(
            "the photos that are left (1 of 6) share none of the {count} sparse points to fit a plane to, and their \
             optical axes do not meet; leave out fewer, or give the plane by hand"
        );
        for fitted in fitted {
            let error = fitted.unwrap_err().to_string();
            assert!(error.starts_with(&said), "{error}");
        }
        // Where it has none, that is why.
        let mut bare = scene;
        bare.reconstruction.points.clear();
        let error = bare.fit(Kind::Plane, &others).unwrap_err().to_string();
        assert!(
            error.contains("cameras observe no sparse points"),
            "{error}"
        );
    }
}
