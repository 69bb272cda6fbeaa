//! From a scene to what the engine draws from.

use super::carved_points::on_surface;
use super::{Photo, Scene, SceneError};
use calibrate::{Image, ImageId, View};
use proxy::{DensePoints, Proxy, SparsePoint};
use render::interior::DepthMaps;
use render::{Lumigraph, PhotoStore, SourceView, Visibility};
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::Path;
use std::sync::Arc;

impl Scene {
    /// A photo's camera and pose; [`Self::views`] are those of many.
    ///
    /// # Errors
    /// No such photo, or its camera has no lens.
    pub fn view(&self, name: &str) -> Result<View, SceneError> {
        let image = self.reconstruction.images.values().find(|i| i.name == name);
        self.view_of(image.ok_or_else(|| self.unknown_photo(name))?)
    }

    /// Photos' cameras and poses, in the order of the names.
    ///
    /// # Errors
    /// As [`Self::view`].
    pub fn views<'n>(
        &self,
        names: impl IntoIterator<Item = &'n String>,
    ) -> Result<Vec<View>, SceneError> {
        let images = self.images_by_name();
        let view = |name: &'n String| {
            let image = images.get(name.as_str());
            self.view_of(image.ok_or_else(|| self.unknown_photo(name))?)
        };
        names.into_iter().map(view).collect()
    }

    /// The error of a name that no photo has.
    pub(super) fn unknown_photo(&self, name: &str) -> SceneError {
        SceneError::UnknownPhoto {
            name: name.to_owned(),
            known: self.names(),
        }
    }

    /// When a photo was taken, in seconds, where known.
    pub fn time_s(&self, name: &str) -> Option<f64> {
        self.photos.iter().find(|p| p.name == name)?.time_s
    }

    fn view_of(&self, image: &Image) -> Result<View, SceneError> {
        let camera = &self.reconstruction.cameras[&image.camera_id];
        let lens = camera.lens().map_err(|source| SceneError::Camera {
            name: image.name.clone(),
            source,
        })?;
        Ok(View {
            lens,
            width: camera.width,
            height: camera.height,
            camera_from_world: image.camera_from_world,
        })
    }

    /// Its posed images by name.
    pub(super) fn images_by_name(&self) -> BTreeMap<&str, &Image> {
        let images = self.reconstruction.images.values();
        images.map(|image| (image.name.as_str(), image)).collect()
    }

    /// Everything that views are rendered from: the photos but those of the given names,
    /// in the order of their names, decoded when first needed.
    ///
    /// # Errors
    /// No photo is left, or a camera has no lens.
    pub fn lumigraph(
        &self,
        without: &BTreeSet<String>,
        proxy: Proxy,
    ) -> Result<Lumigraph, SceneError> {
        self.reduced_lumigraph(without, proxy, u32::MAX)
    }

    /// The same, its photos reduced to `long_side` pixels along the longer side; what masks ignore does not bleed
    /// into what is used.
    ///
    /// # Errors
    /// As [`Self::lumigraph`].
    pub fn reduced_lumigraph(
        &self,
        without: &BTreeSet<String>,
        proxy: Proxy,
        long_side: u32,
    ) -> Result<Lumigraph, SceneError> {
        let mut sources = Vec::new();
        let mut files = Vec::new();
        for (photo, view) in self.sources(without)? {
            let own = (view.width, view.height);
            let reduced = capture::reduced_size(own, long_side);
            files.push((photo.clone(), own, reduced));
            sources.push(SourceView {
                name: photo.name.clone(),
                view: view.resized(reduced.0, reduced.1),
                gain: photo.gain.unwrap_or([1.0; 3]),
                time_s: photo.time_s,
                quarters: photo.orientation.map_or(0, capture::quarters_of),
            });
        }
        if sources.is_empty() {
            return Err(SceneError::NothingLeft(self.photos.len()));
        }
        let masked: Vec<bool> = files
            .iter()
            .map(|(p, ..)| p.ignore_mask.is_some())
            .collect();
        let files = Arc::new(files);
        let of_masks = Arc::clone(&files);
        let photos = PhotoStore::new(files.len(), move |source_idx| {
            let (photo, own, reduced) = &files[source_idx];
            let pixels = photo.decode(*own).map_err(|error| error.to_string())?;
            let (width, height) = *reduced;
            if own == reduced {
                return Ok(pixels);
            }
            // A mask that cannot be decoded is told where it is asked for itself.
            Ok(match photo.decode_ignore_mask(*own).ok().flatten() {
                Some(used) => capture::resize_used(&pixels, &used, width, height),
                None => capture::resize(&pixels, width, height),
            })
        });
        let photos = photos.with_masks(&masked, move |source_idx| {
            let (photo, own, reduced) = &of_masks[source_idx];
            let mask = photo.decode_ignore_mask(*own);
            let mask = mask.map_err(|error| error.to_string())?;
            let mask = mask.ok_or_else(|| format!("{}: no ignore mask", photo.name))?;
            Ok(match own == reduced {
                true => mask,
                false => capture::resize_mask(&mask, reduced.0, reduced.1),
            })
        });
        let points = match &proxy {
            Proxy::Plane(_) | Proxy::Mesh(_) => Vec::new(),
            Proxy::ViewPlane => self.observed_points(without, &names_of(&sources)),
            Proxy::Points { .. } => {
                let views: Vec<View> = sources.iter().map(|s| s.view.clone()).collect();
                on_surface(&views, self.observed_points(without, &names_of(&sources)))
            }
            Proxy::Dense(dense) => renamed(dense, &names_of(&sources)),
        };
        let visibility = Visibility::of(&proxy, &sources);
        Ok(Lumigraph {
            sources,
            photos,
            proxy,
            points,
            visibility,
        })
    }

    /// Whether a proxy that was read from a file is of photos of the scene: of dense points that were found in none
    /// of them no view sees any.
    ///
    /// # Errors
    /// It names photos, and none of the scene's.
    pub fn check_proxy(&self, proxy: &Proxy, file: &Path) -> Result<(), SceneError> {
        let Proxy::Dense(dense) = proxy else {
            return Ok(());
        };
        let known: BTreeSet<&String> = self.photos.iter().map(|photo| &photo.name).collect();
        match dense.names.iter().any(|name| known.contains(name)) {
            true => Ok(()),
            false => Err(SceneError::OtherPhotos {
                path: file.to_owned(),
                names: dense.names.clone(),
                known: self.names(),
            }),
        }
    }

    /// As [`Self::check_proxy`], of the scene's own, if it has one.
    ///
    /// # Errors
    /// It is lost or damaged; it names photos, and none of the scene's.
    pub fn check_own_proxy(&self) -> Result<(), SceneError> {
        let Some(own) = &self.proxy else {
            return Ok(());
        };
        let folder = self.folder.clone().unwrap_or_default();
        self.check_proxy(own.surface()?, &folder.join(&own.file))
    }

    /// The depth maps of the photos of [`Self::lumigraph`], decoded when they are asked for.
    ///
    /// # Errors
    /// A camera has no lens.
    pub fn depth_maps(&self, without: &BTreeSet<String>) -> Result<DepthMaps, SceneError> {
        let sources = self.sources(without)?.into_iter();
        let files: Vec<(Photo, (u32, u32))> = sources
            .map(|(photo, view)| (photo.clone(), (view.width, view.height)))
            .collect();
        let has = files.iter().map(|(p, _)| p.depth_map.is_some()).collect();
        Ok(DepthMaps::new(has, move |source_idx| {
            let (photo, size) = &files[source_idx];
            let map = photo.decode_depth(*size);
            let map = map.map_err(|error| error.to_string())?;
            map.ok_or_else(|| format!("{}: no depth map", photo.name))
        }))
    }

    /// The photos but those of the given names, with their cameras, in the order of their
    /// names.
    ///
    /// # Errors
    /// A camera has no lens.
    pub(super) fn sources(
        &self,
        without: &BTreeSet<String>,
    ) -> Result<Vec<(&Photo, View)>, SceneError> {
        let images = self.images_by_name();
        let rest = self.photos.iter().filter(|p| !without.contains(&p.name));
        rest.map(|photo| Ok((photo, self.view_of(images[photo.name.as_str()])?)))
            .collect()
    }

    /// The sparse points that do not rest on photos left out, each with those of the named
    /// photos that observe it: of some models none.
    pub(super) fn sparse_points(
        &self,
        without: &BTreeSet<String>,
        names: &[String],
    ) -> Vec<SparsePoint> {
        let rest = self.reconstruction.without_images(without);
        let by_name: BTreeMap<&str, u32> = names.iter().map(String::as_str).zip(0..).collect();
        // There are millions of observations, and names are long.
        let index = |(id, image): (&ImageId, &Image)| {
            let index = by_name.get(image.name.as_str())?;
            Some((*id, *index))
        };
        let index_of: HashMap<ImageId, u32> = rest.images.iter().filter_map(index).collect();
        let seen_by = |track: &[(ImageId, u32)]| {
            let mut seen = Vec::with_capacity(track.len());
            seen.extend(track.iter().filter_map(|(id, _)| index_of.get(id).copied()));
            seen.sort_unstable();
            seen.dedup();
            seen
        };
        let points = rest.points.values().filter(|p| p.position.is_finite());
        points
            .map(|point| SparsePoint {
                position: point.position,
                seen_by: seen_by(&point.track),
            })
            .collect()
    }
}

fn names_of(sources: &[SourceView]) -> Vec<String> {
    sources.iter().map(|s| s.name.clone()).collect()
}

/// The points with the views of other names; points that none of them sees are left out.
fn renamed(dense: &DensePoints, names: &[String]) -> Vec<SparsePoint> {
    let index_of: BTreeMap<&str, u32> = names.iter().map(String::as_str).zip(0..).collect();
    let index = |i: &u32| index_of.get(dense.names[*i as usize].as_str()).copied();
    let point = |point: &SparsePoint| {
        let mut seen_by: Vec<u32> = point.seen_by.iter().filter_map(index).collect();
        seen_by.sort_unstable();
        (!seen_by.is_empty()).then_some(SparsePoint {
            position: point.position,
            seen_by,
        })
    };
    dense.points.iter().filter_map(point).collect()
}

#[cfg(test)]
mod tests {
    use super::super::tests::wall;
    use super::*;

    #[test]
    fn sparse_points_name_the_photos_that_observe_them_by_their_places() {
        let (_folder, capture) = wall(5, 1);
        let (mut scene, _) = Scene::open(&capture, false).unwrap();
        // Some programs have several observations of a point by one photo.
        for point in scene.reconstruction.points.values_mut() {
            let first = point.track.first().copied();
            point.track.extend(first);
        }
        let names = scene.names();
        let cases: [(&[String], &[String]); 4] = [
            (&[], &names),
            (&[], &names[1..3]),
            (&names[..2], &names[2..]),
            (&names[3..4], &[]),
        ];
        for (without, asked) in cases {
            let without: BTreeSet<String> = without.iter().cloned().collect();
            // Name by name, as it is meant.
            let rest = scene.reconstruction.without_images(&without);
            let place = |(id, _): &(ImageId, u32)| {
                let name = &rest.images[id].name;
                Some(asked.iter().position(|asked| asked == name)? as u32)
            };
            let of_point = |point: &calibrate::Point3D| SparsePoint {
                position: point.position,
                seen_by: {
                    let places: BTreeSet<u32> = point.track.iter().filter_map(place).collect();
                    places.into_iter().collect()
                },
            };
            let expected: Vec<SparsePoint> = rest.points.values().map(of_point).collect();
            assert!(!expected.is_empty());
            assert_eq!(scene.sparse_points(&without, asked), expected);
        }
    }

    #[test]
    fn views_are_those_of_the_names_one_by_one() {
        let (_folder, capture) = wall(5, 1);
        let (scene, _) = Scene::open(&capture, false).unwrap();
        let mut names = scene.names();
        names.swap(1, 3);
        names.push(names[0].clone());
        let one_by_one: Vec<View> = names.iter().map(|n| scene.view(n).unwrap()).collect();
        assert_eq!(scene.views(&names).unwrap(), one_by_one);
        names.push("other.png".to_owned());
        let errors = [
            scene.views(&names).map(|_| ()),
            scene.view("other.png").map(|_| ()),
        ];
        let [of_all, of_one] = errors.map(|error| error.unwrap_err().to_string());
        assert!(of_one.contains("other.png"), "{of_one}");
        assert_eq!(of_all, of_one);
    }
}
