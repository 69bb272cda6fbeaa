use crate::picture::srgb_from_linear;
use crate::points::{Seen, sparse_points};
use crate::{Finish, Motion, Scene, car, hallway, helicopter, knick_knacks, shelf, wall};
use calibrate::{Camera, CameraId, Image, ImageId, Lens, ModelKind, Reconstruction, Rigid3, View};
use glam::{DQuat, DVec3};
use std::borrow::Cow;
use std::path::PathBuf;

/// A scene, its photos' cameras, and a reconstruction without error.
#[derive(Clone, Debug)]
pub struct Dataset {
    /// What [`by_name`] calls it.
    pub name: &'static str,
    /// What the photos show; where something moves, at time 0.
    pub scene: Scene,
    /// What moves, if anything.
    pub motion: Option<Motion>,
    /// In the order of their names.
    pub photos: Vec<Photo>,
    /// Rays for each side of a pixel.
    pub samples_per_side: u32,
    /// Whether photos show an object before nothing: their alpha, the part of a pixel that
    /// the object covers, is written, too.
    pub matte: bool,
    /// Names of the photos kept aside for scoring: every 8th.
    pub held_out: Vec<String>,
    /// Cameras, poses and sparse points, all exact.
    pub reconstruction: Reconstruction,
    /// What it is, in a line for its README.
    pub kind: &'static str,
    /// What it is hard or easy for, in a sentence or two for its README.
    pub stresses: &'static str,
}

/// One photo of a dataset.
#[derive(Clone, Debug, PartialEq)]
pub struct Photo {
    /// Its file name, with extension.
    pub name: String,
    /// The camera as calibration files store it.
    pub camera: Camera,
    /// The same, posed.
    pub view: View,
    /// When it was taken, in seconds, where something moves.
    pub time_s: Option<f64>,
}

impl Dataset {
    /// The scene as it was when a photo was taken.
    pub fn scene_of(&self, photo: &Photo) -> Cow<'_, Scene> {
        scene_at(&self.scene, self.motion.as_ref(), photo.time_s)
    }
}

fn scene_at<'a>(scene: &'a Scene, motion: Option<&Motion>, time_s: Option<f64>) -> Cow<'a, Scene> {
    match (motion, time_s) {
        (Some(motion), Some(time_s)) => Cow::Owned(motion.scene_at(scene, time_s)),
        _ => Cow::Borrowed(scene),
    }
}

/// What can be chosen about a dataset; `None` is the dataset's own choice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Options {
    /// Width and height of the photos in pixels. The field of view stays.
    pub size: Option<(u32, u32)>,
    /// How many photos, at least two.
    pub views: Option<usize>,
    /// Each pixel is the mean of this number squared of rays, 1 to 16.
    pub samples_per_side: Option<u32>,
}

/// Why a dataset cannot be made or written.
#[derive(Debug, thiserror::Error)]
pub enum DatasetError {
    /// No dataset has this name.
    #[error("no dataset is called {name:?}; there are: {}, house, survey", names().join(", "))]
    UnknownName {
        /// What was asked for.
        name: String,
    },
    /// An option is out of its range.
    #[error("{option} is {found}; expected {expected}")]
    Option {
        /// Which option.
        option: &'static str,
        /// Its value.
        found: String,
        /// Its range.
        expected: &'static str,
    },
    /// Rooms without a place to stand in.
    #[error(
        "no place to take photos from: at eye height no room has one that is clear of walls and \
         furniture"
    )]
    NoPlace,
    /// The destination holds something already.
    #[error("{}: the folder is not empty; choose another or remove it first", folder.display())]
    NotEmpty {
        /// The destination.
        folder: PathBuf,
    },
    /// A file or folder could not be written.
    #[error("{}: cannot write: {source}", path.display())]
    Io {
        /// Which one.
        path: PathBuf,
        /// What went wrong.
        source: std::io::Error,
    },
    /// A picture could not be written.
    #[error("{}: cannot write the picture: {source}", path.display())]
    Picture {
        /// Which one.
        path: PathBuf,
        /// What went wrong.
        source: image::ImageError,
    },
    /// A model could not be written.
    #[error("{}: {source}", path.display())]
    Model {
        /// Which one.
        path: PathBuf,
        /// What went wrong.
        source: proxy::mesh::ExportError,
    },
    /// An interior could not be written.
    #[error(transparent)]
    Interior(#[from] proxy::interior::InteriorFileError),
    /// An interior that does not go with its model.
    #[error(transparent)]
    Cells(#[from] proxy::interior::InteriorError),
    /// The COLMAP model could not be written.
    #[error(transparent)]
    Colmap(#[from] calibrate::colmap::ColmapError),
}

type Build = fn(&Options) -> Result<Dataset, DatasetError>;

const DATASETS: [(&str, Build); 6] = [
    ("shelf", shelf),
    ("wall", wall),
    ("helicopter", helicopter),
    ("knick-knacks", knick_knacks),
    ("hallway", hallway),
    ("car", car),
];

/// The names that [`by_name`] knows.
pub fn names() -> Vec<&'static str> {
    DATASETS.iter().map(|(name, _)| *name).collect()
}

/// The dataset of that name.
///
/// # Errors
/// An unknown name, or an option out of its range.
pub fn by_name(name: &str, options: &Options) -> Result<Dataset, DatasetError> {
    let (_, build) = DATASETS
        .iter()
        .find(|(known, _)| *known == name)
        .ok_or_else(|| DatasetError::UnknownName {
            name: name.to_owned(),
        })?;
    build(options)
}

/// [`Options`] with a dataset's defaults filled in and checked.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Chosen {
    pub(crate) width: u32,
    pub(crate) height: u32,
    pub(crate) views: usize,
    pub(crate) samples_per_side: u32,
}

impl Options {
    pub(crate) fn or_defaults(
        &self,
        size: (u32, u32),
        views: usize,
    ) -> Result<Chosen, DatasetError> {
        let (width, height) = self.size.unwrap_or(size);
        let chosen = Chosen {
            width,
            height,
            views: self.views.unwrap_or(views),
            samples_per_side: self.samples_per_side.unwrap_or(3),
        };
        let refuse = |option, found: String, expected| {
            Err(DatasetError::Option {
                option,
                found,
                expected,
            })
        };
        if !(8..=16_384).contains(&width) || !(8..=16_384).contains(&height) {
            let found = format!("{width} × {height}");
            return refuse("the photos' size", found, "8 to 16384 pixels a side");
        }
        if !(2..=9999).contains(&chosen.views) {
            let found = chosen.views.to_string();
            return refuse("the number of photos", found, "2 to 9999");
        }
        if !(1..=16).contains(&chosen.samples_per_side) {
            let found = chosen.samples_per_side.to_string();
            return refuse(
                "the number of rays for each side of a pixel",
                found,
                "1 to 16",
            );
        }
        Ok(chosen)
    }
}

/// What tells one dataset from another, before its photos and points are worked out.
pub(crate) struct Plan {
    pub(crate) name: &'static str,
    pub(crate) kind: &'static str,
    pub(crate) stresses: &'static str,
    pub(crate) scene: Scene,
    pub(crate) model: ModelKind,
    /// In the model's order.
    pub(crate) params: Vec<f64>,
    pub(crate) poses: Vec<Rigid3>,
    /// When each photo is taken; empty where nothing moves.
    pub(crate) times_s: Vec<f64>,
    pub(crate) motion: Option<Motion>,
    pub(crate) points: usize,
    pub(crate) matte: bool,
    pub(crate) seed: u32,
}

impl Plan {
    pub(crate) fn into_dataset(self, chosen: &Chosen) -> Dataset {
        let camera = Camera {
            model: self.model,
            width: chosen.width,
            height: chosen.height,
            params: self.params,
        };
        let lens: Lens = camera.lens().expect("a dataset's own camera is valid");
        let photos: Vec<Photo> = self
            .poses
            .into_iter()
            .enumerate()
            .map(|(i, camera_from_world)| Photo {
                name: format!("{i:04}.png"),
                camera: camera.clone(),
                view: View {
                    lens,
                    width: chosen.width,
                    height: chosen.height,
                    camera_from_world: settled(camera_from_world),
                },
                time_s: self.times_s.get(i).copied(),
            })
            .collect();
        let mut reconstruction = posed(&camera, &photos);
        let motion = self.motion.as_ref();
        let scenes = photos.iter();
        let seen = SeenInScenes {
            scenes: scenes
                .map(|photo| scene_at(&self.scene, motion, photo.time_s))
                .collect(),
            motion,
        };
        let views: Vec<&View> = photos.iter().map(|photo| &photo.view).collect();
        sparse_points(&views, &seen, self.points, self.seed, &mut reconstruction);
        Dataset {
            name: self.name,
            scene: self.scene,
            motion: self.motion,
            samples_per_side: chosen.samples_per_side,
            matte: self.matte,
            held_out: photos.iter().step_by(8).map(|p| p.name.clone()).collect(),
            photos,
            reconstruction,
            kind: self.kind,
            stresses: self.stresses,
        }
    }
}

/// The camera and the poses of photos that it took, without points.
pub(crate) fn posed(camera: &Camera, photos: &[Photo]) -> Reconstruction {
    let mut reconstruction = Reconstruction::default();
    let camera_id = CameraId(1);
    reconstruction.cameras.insert(camera_id, camera.clone());
    for (i, photo) in photos.iter().enumerate() {
        let image = Image {
            name: photo.name.clone(),
            camera_id,
            camera_from_world: photo.view.camera_from_world,
            keypoints: Vec::new(),
        };
        reconstruction.images.insert(ImageId(i as u32 + 1), image);
    }
    reconstruction
}

/// The scene that each photo shows; points lie on what stays where it is.
struct SeenInScenes<'a> {
    scenes: Vec<Cow<'a, Scene>>,
    motion: Option<&'a Motion>,
}

impl Seen for SeenInScenes<'_> {
    fn trace(&self, view_idx: usize, from: DVec3, direction: DVec3) -> Option<(DVec3, [u8; 3])> {
        let scene = &self.scenes[view_idx];
        let hit = scene.trace(from, direction)?;
        // Mirrors show places that are elsewhere: fine for a photo, not for a feature.
        let mirrors = matches!(
            scene.objects()[hit.object_idx].material.finish,
            Finish::Glossy { mirror, .. } if mirror > 0.5
        );
        let moves = self.motion.is_some_and(|m| m.moves(hit.object_idx));
        (!mirrors && !moves).then(|| (hit.point, srgb_from_linear(hit.color)))
    }

    fn distance(&self, view_idx: usize, from: DVec3, direction: DVec3) -> Option<f64> {
        self.scenes[view_idx].distance(from, direction)
    }
}

/// The same pose with a quaternion that normalising leaves as it is and whose real part
/// is not negative: so it reads back from a file bit for bit.
pub(crate) fn settled(pose: Rigid3) -> Rigid3 {
    let mut rotation = pose.rotation;
    if rotation.w < 0.0 {
        rotation = -rotation;
    }
    for _ in 0..8 {
        let next: DQuat = rotation.normalize();
        if next == rotation {
            break;
        }
        rotation = next;
    }
    Rigid3 { rotation, ..pose }
}
