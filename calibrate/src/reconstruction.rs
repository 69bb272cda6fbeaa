use crate::{Camera, CameraError, CameraId, Lens, Pixel, Reprojection, Rigid3};
use glam::{DVec2, DVec3};
use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};

/// So many observations, spread over all images, tell how well a model fits its photos.
const JUDGED: usize = 500;
/// So many observations of one image tell how well its pose fits.
const JUDGED_OF_EACH: usize = 50;

/// The id of an image in a reconstruction: sparse, chosen by whoever made it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ImageId(pub u32);

/// The id of a sparse point: sparse, chosen by whoever made it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Point3DId(pub u64);

impl From<ImageId> for u64 {
    fn from(id: ImageId) -> u64 {
        id.0.into()
    }
}

impl From<Point3DId> for u64 {
    fn from(id: Point3DId) -> u64 {
        id.0
    }
}

/// A calibrated photo set: cameras, posed images and sparse points, as structure from
/// motion leaves them. Units are the capture's own.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reconstruction {
    /// Camera models; several images may share one.
    pub cameras: BTreeMap<CameraId, Camera>,
    /// Posed images.
    pub images: BTreeMap<ImageId, Image>,
    /// Sparse points.
    pub points: BTreeMap<Point3DId, Point3D>,
}

/// One posed photo.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// The photo's path relative to the photo folder, `/` between its parts.
    pub name: String,
    /// Which of the reconstruction's cameras took it.
    pub camera_id: CameraId,
    /// Its pose.
    pub camera_from_world: Rigid3,
    /// The features found in it. A point's track refers to them by index.
    pub keypoints: Vec<Keypoint>,
}

/// A feature found in an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Keypoint {
    /// Pixels, the first pixel's centre at (0.5, 0.5).
    pub x: f64,
    /// Pixels.
    pub y: f64,
    /// The sparse point it is an observation of, if any.
    pub point: Option<Point3DId>,
}

/// A sparse point.
#[derive(Clone, Debug, PartialEq)]
pub struct Point3D {
    /// In the world.
    pub position: DVec3,
    /// sRGB.
    pub color: [u8; 3],
    /// Mean reprojection error in pixels; negative where it was never computed.
    pub error_px: f64,
    /// The images that see it, each with the index of its keypoint there.
    pub track: Vec<(ImageId, u32)>,
}

impl Reconstruction {
    /// What is left when the images of these names were never taken: all as it is where it has none of them, and
    /// else a copy, as [`Self::remove_images`] leaves it.
    #[must_use]
    pub fn without_images(&self, names: &BTreeSet<String>) -> Cow<'_, Self> {
        if !self.images.values().any(|i| names.contains(&i.name)) {
            return Cow::Borrowed(self);
        }
        let mut rest = self.clone();
        rest.remove_images(names);
        Cow::Owned(rest)
    }

    /// Takes the images of these names out, as if they were never taken: a sparse point that they saw stays
    /// only where two or more of the remaining images see it, and a keypoint of one that
    /// went loses its link. Cameras stay. Unknown names are no matter.
    pub fn remove_images(&mut self, names: &BTreeSet<String>) {
        let images = self.images.iter();
        let gone: BTreeSet<ImageId> = images
            .filter(|(_, image)| names.contains(&image.name))
            .map(|(id, _)| *id)
            .collect();
        if gone.is_empty() {
            return;
        }
        self.images.retain(|id, _| !gone.contains(id));
        let mut lost = BTreeSet::new();
        for (id, point) in &mut self.points {
            let seen_before = point.track.len();
            point.track.retain(|(image_id, _)| !gone.contains(image_id));
            if point.track.len() < seen_before && !is_seen_by_two(&point.track) {
                lost.insert(*id);
            }
        }
        self.remove_points(&lost);
    }

    /// The sparse points that every image observing them has farther than so many pixels from where it observes them, or
    /// behind it or beyond its lens. Points that no image observes are none of them, nor those of which one observation cannot be
    /// judged: its keypoint is not there, or its camera has no lens.
    pub fn contradicted_points(&self, limit_px: f64) -> BTreeSet<Point3DId> {
        let cameras = self.cameras.iter();
        let lenses: BTreeMap<CameraId, Lens> = cameras
            .filter_map(|(id, camera)| Some((*id, camera.lens().ok()?)))
            .collect();
        let error = |(image_id, keypoint_idx): &(ImageId, u32)| {
            let image = self.images.get(image_id)?;
            let keypoint = image.keypoints.get(*keypoint_idx as usize)?;
            let lens = lenses.get(&image.camera_id)?;
            self.error_px(image, lens, keypoint, DVec2::ZERO)
        };
        let is_contradicted = |point: &Point3D| {
            let mut errors = point.track.iter().map(error);
            !point.track.is_empty() && errors.all(|px| px.is_some_and(|px| px > limit_px))
        };
        let points = self.points.iter();
        points
            .filter(|(_, point)| is_contradicted(point))
            .map(|(id, _)| *id)
            .collect()
    }

    /// Takes sparse points out, and their keypoints' links.
    pub fn remove_points(&mut self, gone: &BTreeSet<Point3DId>) {
        if gone.is_empty() {
            return;
        }
        self.points.retain(|id, _| !gone.contains(id));
        for keypoint in self
            .images
            .values_mut()
            .flat_map(|image| &mut image.keypoints)
        {
            keypoint.point = keypoint.point.filter(|id| !gone.contains(id));
        }
    }

    /// Makes the sparse points' tracks of the keypoints that name them, where no point has a track of its own: some
    /// programs write who observes which into the images alone. How many observations these are.
    pub fn take_tracks_from_keypoints(&mut self) -> usize {
        if self.points.values().any(|point| !point.track.is_empty()) {
            return 0;
        }
        let mut count = 0;
        for (id, image) in &self.images {
            for (keypoint_idx, keypoint) in image.keypoints.iter().enumerate() {
                let Some(point_id) = keypoint.point else {
                    continue;
                };
                if let Some(point) = self.points.get_mut(&point_id) {
                    point.track.push((*id, keypoint_idx as u32));
                    count += 1;
                }
            }
        }
        count
    }

    /// Where the sparse points that a camera's keypoints observe fall beside these.
    ///
    /// # Errors
    /// The camera has no lens.
    pub fn reprojections(&self, camera_id: CameraId) -> Result<Vec<Reprojection>, CameraError> {
        let Some(camera) = self.cameras.get(&camera_id) else {
            return Ok(Vec::new());
        };
        let lens = camera.lens()?;
        let mut reprojections = Vec::new();
        for image in self.images.values().filter(|i| i.camera_id == camera_id) {
            let of = |keypoint| self.reprojection(image, &lens, keypoint, DVec2::ZERO);
            reprojections.extend(image.keypoints.iter().filter_map(of));
        }
        Ok(reprojections)
    }

    /// The distances in pixels between a camera's keypoints and the projections of the
    /// sparse points that they observe; infinite where a point projects nowhere: behind the camera, or beyond
    /// what its lens maps one to one.
    ///
    /// # Errors
    /// The camera has no lens.
    pub fn reprojection_errors_px(&self, camera_id: CameraId) -> Result<Vec<f64>, CameraError> {
        let reprojections = self.reprojections(camera_id)?;
        Ok(reprojections.into_iter().map(Reprojection::px).collect())
    }

    /// The median of the distances in pixels between the keypoints of all images and the projections of
    /// the sparse points that they observe, judged by some hundreds of them spread evenly; infinite where
    /// most points project nowhere, `None` where no keypoint observes any. Images of cameras
    /// without a lens have no say.
    pub fn median_error_px(&self) -> Option<f64> {
        self.median_error_px_from(|_| DVec2::ZERO)
    }

    /// The same where keypoints count from a pixel of their camera.
    pub(crate) fn median_error_px_from(&self, origin_of: impl Fn(&Camera) -> DVec2) -> Option<f64> {
        let observations = || {
            self.images.values().flat_map(|image| {
                let observing = image.keypoints.iter().filter(|k| k.point.is_some());
                observing.map(move |keypoint| (image, keypoint))
            })
        };
        // How far a lens maps rays one to one takes long to find out.
        let mut lenses: BTreeMap<CameraId, Option<Lens>> = BTreeMap::new();
        let error = |(image, keypoint): (&Image, &Keypoint)| {
            let camera = self.cameras.get(&image.camera_id)?;
            let lens = lenses.entry(image.camera_id);
            let lens = lens.or_insert_with(|| camera.lens().ok()).as_ref()?;
            self.error_px(image, lens, keypoint, origin_of(camera))
        };
        let step = observations().count().div_ceil(JUDGED).max(1);
        let mut errors: Vec<f64> = observations().step_by(step).filter_map(error).collect();
        errors.sort_by(f64::total_cmp);
        errors.get(errors.len() / 2).copied()
    }

    /// The median of the distances of each image's own keypoints likewise, the lower of two, judged by some
    /// tens of them spread evenly. Images with fewer observations than `fewest` are left out, and those of cameras
    /// without a lens.
    pub fn median_errors_px(&self, fewest: usize) -> BTreeMap<ImageId, f64> {
        let mut lenses: BTreeMap<CameraId, Option<Lens>> = BTreeMap::new();
        let median = |(id, image): (&ImageId, &Image)| {
            let camera = self.cameras.get(&image.camera_id)?;
            let lens = lenses.entry(image.camera_id);
            let lens = lens.or_insert_with(|| camera.lens().ok()).as_ref()?;
            let observing = || image.keypoints.iter().filter(|k| k.point.is_some());
            let count = observing().count();
            if count < fewest {
                return None;
            }
            let step = count.div_ceil(JUDGED_OF_EACH).max(1);
            let error = |keypoint| self.error_px(image, lens, keypoint, DVec2::ZERO);
            let mut errors: Vec<f64> = observing().step_by(step).filter_map(error).collect();
            errors.sort_by(f64::total_cmp);
            Some((*id, *errors.get(errors.len().checked_sub(1)? / 2)?))
        };
        self.images.iter().filter_map(median).collect()
    }

    /// How far a keypoint, counted from `origin`, is from the projection of the sparse point that it
    /// observes, in pixels; infinite where that projects nowhere, `None` where there is none.
    fn error_px(
        &self,
        image: &Image,
        lens: &Lens,
        keypoint: &Keypoint,
        origin: DVec2,
    ) -> Option<f64> {
        let reprojection = self.reprojection(image, lens, keypoint, origin);
        reprojection.map(Reprojection::px)
    }

    /// Where the sparse point that a keypoint, counted from `origin`, observes falls beside it; `None` where there
    /// is none.
    fn reprojection(
        &self,
        image: &Image,
        lens: &Lens,
        keypoint: &Keypoint,
        origin: DVec2,
    ) -> Option<Reprojection> {
        let point = self.points.get(&keypoint.point?)?;
        let point_in_camera = image.camera_from_world * point.position;
        let observed = Pixel::new(keypoint.x + origin.x, keypoint.y + origin.y);
        Some(Reprojection::of(lens, point_in_camera, observed))
    }
}

/// Whether a track is of two images or more.
fn is_seen_by_two(track: &[(ImageId, u32)]) -> bool {
    track.iter().any(|(id, _)| *id != track[0].0)
}

#[cfg(test)]
mod tests;
