//! Photos that only decoding finds damaged: what is fitted to the others goes on without them.

use super::fit::unfit;
use super::import::ENOUGH;
use super::{Fitted, Photo, Scene, SceneError};
use calibrate::View;
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

impl Scene {
    /// Checks that enough photos remain without those of the given names, nor those that were found `damaged`, by
    /// name with what is wrong with each. Where none was, those that remain are as few as somebody chose.
    ///
    /// # Errors
    /// [`SceneError::TooFew`].
    pub fn check_enough(
        &self,
        without: &BTreeSet<String>,
        damaged: &BTreeMap<String, String>,
    ) -> Result<(), SceneError> {
        let is_damaged = |photo: &&Photo| damaged.contains_key(&photo.name);
        let (gone, others): (Vec<&Photo>, Vec<&Photo>) = self.photos.iter().partition(is_damaged);
        let rest = others.iter().filter(|p| !without.contains(&p.name)).count();
        match gone.first() {
            Some(first) if rest < ENOUGH => Err(SceneError::TooFew {
                left_out: gone.len(),
                total: gone.len() + rest,
                name: first.name.clone(),
                reason: damaged[&first.name].clone(),
                remedy: format!(
                    "copy such photos (in {}), or such masks, again from where they came from",
                    first.path.parent().unwrap_or(Path::new("")).display()
                ),
            }),
            _ => Ok(()),
        }
    }

    /// What `fit` makes without the photos of the given names, nor those that it finds damaged,
    /// as long as enough others remain.
    ///
    /// # Errors
    /// As `fit`; too few photos that can be decoded.
    pub(super) fn fit_without_damaged(
        &self,
        without: &BTreeSet<String>,
        fit: impl Fn(&BTreeSet<String>) -> Result<Fitted, SceneError>,
    ) -> Result<Fitted, SceneError> {
        let mut fewer = without.clone();
        let mut left_out = BTreeMap::new();
        loop {
            match fit(&fewer) {
                Ok(fitted) => return Ok(Fitted { left_out, ..fitted }),
                Err(SceneError::Damaged(damaged)) => {
                    fewer.extend(damaged.keys().cloned());
                    left_out.extend(damaged);
                    let rest = self.photos.iter().filter(|p| !fewer.contains(&p.name));
                    if rest.count() < ENOUGH {
                        return Err(SceneError::Damaged(left_out));
                    }
                }
                Err(error) if left_out.is_empty() => return Err(error),
                // Nobody was told of them yet, and it may be for the lack of them.
                Err(error) => {
                    let damaged = damaged_text(&left_out);
                    return Err(unfit(format!("{error}; left out: {damaged}")));
                }
            }
        }
    }
}

/// What is found in each photo by decoding it.
///
/// # Errors
/// All that cannot be decoded; if all can, the first photo's error, whichever thread is the first
/// to meet one.
pub(super) fn of_each<T: Send>(
    sources: &[(&Photo, View)],
    find: impl Fn(&Photo, (u32, u32)) -> Result<T, SceneError> + Sync,
) -> Result<Vec<T>, SceneError> {
    let found: Vec<Result<T, SceneError>> = sources
        .par_iter()
        .map(|(photo, view)| find(photo, (view.width, view.height)))
        .collect();
    let mut damaged = BTreeMap::new();
    for ((photo, _), found) in sources.iter().zip(&found) {
        if let Err(SceneError::Capture(error)) = found {
            damaged.insert(photo.name.clone(), error.to_string());
        }
    }
    if damaged.is_empty() {
        found.into_iter().collect()
    } else {
        Err(SceneError::Damaged(damaged))
    }
}

/// The first of damaged photos and what is wrong with it, for people.
pub(super) fn damaged_text(damaged: &BTreeMap<String, String>) -> String {
    let Some((name, reason)) = damaged.first_key_value() else {
        return "no photo".to_owned();
    };
    match damaged.len() {
        1 => format!("photo {name}: {reason}"),
        count => format!("photo {name}: {reason}; and {} more", count - 1),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Kind;
    use datasets::Options;
    use tempfile::TempDir;

    /// A scene of made photos, which are in `made/images` of the folder.
    fn with(name: &str, size: (u32, u32), views: Option<usize>) -> (TempDir, Scene) {
        let options = Options {
            size: Some(size),
            views,
            samples_per_side: Some(2),
        };
        let folder = tempfile::tempdir().unwrap();
        let made = datasets::by_name(name, &options).unwrap();
        let capture = folder.path().join("made");
        datasets::write(&made, &capture).unwrap();
        let (scene, _) = Scene::open(&capture, false).unwrap();
        (folder, scene)
    }

    /// Cuts a file's end off, of which its header tells nothing.
    fn damage(file: &Path) {
        let whole = std::fs::read(file).unwrap();
        std::fs::write(file, &whole[..whole.len() * 2 / 3]).unwrap();
    }

    fn named(names: &[&str]) -> BTreeSet<String> {
        names.iter().map(|name| (*name).to_owned()).collect()
    }

    fn left_out(fitted: &Fitted) -> BTreeSet<String> {
        fitted.left_out.keys().cloned().collect()
    }

    #[test]
    fn a_damaged_photo_has_no_say_in_which_proxy_is_best() {
        let (folder, scene) = with("wall", (32, 24), None);
        // One that judges none, and is found as the first kind is drawn.
        let without = scene.fit_best(&named(&["0004.png"])).unwrap();
        assert!(without.left_out.is_empty());
        assert!(without.trials.iter().filter(|t| t.score.is_ok()).count() > 3);
        damage(&folder.path().join("made/images/0004.png"));
        let fitted = scene.fit_best(&BTreeSet::new()).unwrap();
        assert_eq!(left_out(&fitted), named(&["0004.png"]));
        let reason = &fitted.left_out["0004.png"];
        assert!(reason.contains("0004.png"), "{reason}");
        assert_eq!(fitted.trials, without.trials);
        assert_eq!(fitted.proxy.kind(), without.proxy.kind());
    }

    #[test]
    fn photos_are_compared_without_those_that_cannot_be_decoded() {
        let (folder, mut scene) = with("wall", (64, 48), None);
        let damaged = named(&["0003.png", "0006.png"]);
        for name in &damaged {
            damage(&folder.path().join("made/images").join(name));
        }
        for kind in [Kind::Dense, Kind::CarvedDense] {
            let fitted = scene.fit(kind, &BTreeSet::new()).unwrap();
            assert_eq!(left_out(&fitted), damaged, "{}", kind.name());
            let without = scene.fit(kind, &damaged).unwrap();
            assert!(without.left_out.is_empty());
            assert_eq!(fitted.how, without.how);
        }
        // All of them are found at once, whether or not points tell which go together.
        for with_points in [true, false] {
            if !with_points {
                scene.reconstruction.points.clear();
                for image in scene.reconstruction.images.values_mut() {
                    image.keypoints.clear();
                }
            }
            let found = scene.matching(&BTreeSet::new()).map(|_| ()).unwrap_err();
            assert!(matches!(found, SceneError::Damaged(all) if all.len() == 2));
        }
    }

    #[test]
    fn photos_that_nothing_can_be_judged_by_leave_it_at_the_usual_kind() {
        // SSIM needs more pixels.
        let (_folder, scene) = with("wall", (10, 8), None);
        let fitted = scene.fit_best(&BTreeSet::new()).unwrap();
        assert_eq!(fitted.proxy.kind(), "points");
        assert!(!fitted.trials.is_empty() && fitted.trials.iter().all(|t| t.score.is_err()));
        let note = fitted.note.unwrap();
        assert!(note.contains("no kind of proxy"), "{note}");
    }

    #[test]
    fn what_is_cut_out_is_bounded_by_the_photos_that_can_be_decoded() {
        let (folder, scene) = with("car", (96, 72), Some(8));
        let file = |i: u32| folder.path().join(format!("made/images/{i:04}.png"));
        damage(&file(2));
        damage(&file(5));
        let damaged = named(&["0002.png", "0005.png"]);
        for kind in [Kind::Points, Kind::Carved, Kind::Hull] {
            let fitted = scene.fit(kind, &BTreeSet::new()).unwrap();
            assert_eq!(left_out(&fitted), damaged, "{}", kind.name());
            assert_eq!(kind == Kind::Hull, fitted.proxy.within().is_none());
            // They have no part in it, and those that are held out are not even asked.
            let without = scene.fit(kind, &damaged).unwrap();
            assert!(without.left_out.is_empty());
            assert_eq!(fitted.how, without.how);
        }
        // One alone bounds nothing.
        for i in [1, 3, 4, 6, 7] {
            damage(&file(i));
        }
        let error = scene.fit(Kind::Hull, &BTreeSet::new()).unwrap_err();
        let text = error.to_string();
        assert!(matches!(error, SceneError::Damaged(all) if all.len() == 7));
        assert!(
            text.starts_with("photo 0001.png: ") && text.ends_with("; and 6 more"),
            "{text}"
        );
    }
}
