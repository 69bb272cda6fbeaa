//! Which views to render.

use super::Usage;
use super::output::say;
use super::path::has_times;
use super::report::UNSHOWN;
use anyhow::bail;
use calibrate::formats::{self, Format};
use calibrate::{Reconstruction, View, colmap};
use capture::as_argument;
use glam::DVec3;
use lumigraph::scene::{Scene, SceneError, Sizes, calibration_in, read_bare};
use render::Lumigraph;
use render::path::{self, CameraPath, KeyframeFile, NerfstudioFrame, PathFrame};
use render::trajectory::{self, Trajectory};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::path::{Component, Path, PathBuf};

/// Which views to render.
#[derive(clap::Args)]
#[group(required = true, multiple = false)]
pub(super) struct ViewArgs {
    /// The views of a COLMAP model, of a transforms.json (NeRF's transforms_test.json, say), of a path file, or of
    /// a screenshot of `view`
    #[arg(long, value_name = "MODEL|FILE")]
    pub(super) views: Option<PathBuf>,
    /// A path derived from where the photos were taken, or a path file, nerfstudio's too. orbit goes around,
    /// dolly towards the scene, back and beyond, sweep along the photos and back; all end where they
    /// begin, and two frames of dolly or sweep are its ends
    #[arg(long, value_name = "KIND|FILE")]
    pub(super) path: Option<String>,
}

/// The kind of derived path that has a name.
pub(super) fn derived(asked: &str) -> Option<Trajectory> {
    match asked {
        "orbit" => Some(Trajectory::Orbit),
        "dolly" => Some(Trajectory::Dolly),
        "sweep" => Some(Trajectory::Sweep),
        _ => None,
    }
}

/// Whether what is no kind of path cannot be meant as a file either.
fn is_misspelt(asked: &str) -> bool {
    let file = Path::new(asked);
    file.is_dir() || file.extension().is_none() && !file.exists()
}

/// A view to render and what to call it.
pub(super) struct NamedView {
    pub(super) name: String,
    pub(super) view: View,
    /// Seconds, where its file or path says.
    pub(super) time_s: Option<f64>,
}

/// The views asked for, read as far as they can be before anything is known of a scene.
pub(super) enum Asked {
    /// Those of a file or model.
    Read {
        /// In order.
        views: Vec<NamedView>,
        /// How many a second a film shows.
        fps: f64,
        /// Whether they are a model's images, which may call photos otherwise than the scene does.
        are_images: bool,
        /// Whether the frames of a path, or a screenshot, are as of times of the scene.
        has_times: bool,
        /// What gives one a time that has none, for people.
        untimed: &'static str,
    },
    /// A path that the photos' places are needed for.
    Derived(Trajectory),
}

impl Asked {
    /// Reads what is asked for; `frame` is where nerfstudio's paths lie.
    ///
    /// # Errors
    /// It cannot be read.
    pub(super) fn new(args: &ViewArgs, frame: &NerfstudioFrame) -> anyhow::Result<Self> {
        let Some(views) = &args.views else {
            return Self::path(args.path.as_deref().unwrap_or_default(), frame);
        };
        if !views.exists() {
            let message = format!(
                "--views {}: there is no such file; expected the folder of a COLMAP model, a \
                 transforms.json, a path file (.json), or a screenshot of `view` (.png)",
                views.display()
            );
            return Err(Usage(message).into());
        }
        let (views, untimed) = match transforms_of(views) {
            Some(file) => (of_transforms(&file)?, "give its frame a \"time\""),
            None if views.is_dir() => {
                let untimed = "give the photo of its name one (`import --times FILE.csv`)";
                (of_model(views)?, untimed)
            }
            None if colmap::is_part(views) => {
                let folder = views.parent().filter(|folder| *folder != Path::new(""));
                bail!(
                    "{}: a file of a COLMAP model; its views are those of its folder: --views {}",
                    views.display(),
                    as_argument(folder.unwrap_or(Path::new(".")))
                );
            }
            None => return of_file(views, frame),
        };
        Ok(Self::Read {
            views,
            fps: FPS,
            are_images: true,
            has_times: false,
            untimed,
        })
    }

    /// The same of a path: a kind of derived path, or a file.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub(super) fn path(asked: &str, frame: &NerfstudioFrame) -> anyhow::Result<Self> {
        if let Some(kind) = derived(asked) {
            return Ok(Self::Derived(kind));
        }
        if is_misspelt(asked) {
            let message = format!("--path {asked}: expected orbit, dolly, sweep or a path file");
            return Err(Usage(message).into());
        }
        of_file(Path::new(asked), frame)
    }

    /// The same, where a model's images are called as the scene calls its photos, and views without a time have
    /// that of the photo of their name, as a model's may.
    pub(super) fn in_scene(mut self, scene: &Scene) -> Self {
        let mut times: BTreeMap<&str, f64> = BTreeMap::new();
        for photo in &scene.photos {
            let Some(time_s) = photo.time_s else { continue };
            // Undistorted ones as in the capture, too.
            times.extend(photo.original.as_deref().map(|name| (name, time_s)));
            times.insert(&photo.name, time_s);
        }
        if let Self::Read {
            views, are_images, ..
        } = &mut self
        {
            if *are_images {
                let names = views.iter_mut().map(|view| &mut view.name);
                scene.name_as_photos(&mut names.collect::<Vec<_>>());
                views.sort_by(|a, b| a.name.cmp(&b.name));
            }
            for view in views {
                let of_photo = times.get(view.name.as_str()).copied();
                view.time_s = view.time_s.or(of_photo);
            }
        }
        self
    }

    /// Whether it is a derived path, which has as many frames as one asks for.
    pub(super) fn is_derived(&self) -> bool {
        matches!(self, Self::Derived(_))
    }

    /// Whether the frames of a path, or a screenshot, are as of times of the scene.
    pub(super) fn has_times(&self) -> bool {
        matches!(
            self,
            Self::Read {
                has_times: true,
                ..
            }
        )
    }

    /// What gives a view a time that has none, for people; those of derived paths have one.
    pub(super) fn untimed(&self) -> &'static str {
        match self {
            Self::Read { untimed, .. } => untimed,
            Self::Derived(_) => "",
        }
    }

    /// Why frames may show nothing, for people: where they see no proxy, and where no photo shows what they see of
    /// it; `is_unplaced` where nobody says where nerfstudio's world lies, whose path it is.
    pub(super) fn why_empty(&self, is_unplaced: bool) -> [&'static str; 2] {
        let is_elsewhere = match self {
            Self::Derived(_) => {
                let unseen = "no proxy lies before their cameras; try another --proxy";
                return [unseen, UNSHOWN];
            }
            Self::Read { .. } if is_unplaced => {
                "does the path lie in this scene's world (see --dataparser-transforms)?"
            }
            Self::Read { .. } => "does the path lie in this scene's world?",
        };
        // A plane is seen from other worlds, too.
        [is_elsewhere; 2]
    }

    /// The views, and how many a second a film shows: of a derived path so many, `points_in_world` are
    /// the sparse points.
    ///
    /// # Errors
    /// They cannot be derived.
    pub(super) fn frames(
        self,
        count: u32,
        lumigraph: &Lumigraph,
        points_in_world: impl FnOnce() -> Vec<DVec3>,
    ) -> anyhow::Result<(Vec<NamedView>, f64)> {
        let kind = match self {
            Self::Read { views, fps, .. } => return Ok((views, fps)),
            Self::Derived(kind) => kind,
        };
        let (sources, proxy) = (&lumigraph.sources, &lumigraph.proxy);
        let (points, count) = (points_in_world(), count as usize);
        let path = trajectory::derive(kind, sources, &points, proxy, count, FPS)?;
        Ok(named(path))
    }
}

/// What to say of the frames of a derived path if they are all alike, where there are so many photos.
pub(super) fn note_of_still(frames: &[NamedView], photos: usize) -> Option<&'static str> {
    let pose = |frame: &NamedView| frame.view.camera_from_world;
    let is_still = |pair: &[NamedView]| pose(&pair[0]) == pose(&pair[1]);
    (frames.len() > 1 && frames.windows(2).all(is_still)).then_some(match photos {
        1 => "there is one photo alone: the path stands still",
        _ => "all photos were taken from one place: the path stands still",
    })
}

/// How far apart the moments of frames are that follow one another, in the mean; `None` of fewer than two, and where
/// one has none.
pub(super) fn apart_s(frames: &[NamedView]) -> Option<f64> {
    let (first, last) = (frames.first()?.time_s?, frames.last()?.time_s?);
    (frames.len() > 1).then(|| (last - first) / (frames.len() - 1) as f64)
}

/// Frames of a derived path where nobody says.
pub(super) const FRAMES: u32 = 30;

/// Frames a second where no path says. Only a film made of the frames would show it.
const FPS: f64 = 30.0;

/// The `transforms.json` that is given: a file, or that of a capture which has no COLMAP model.
fn transforms_of(given: &Path) -> Option<PathBuf> {
    let file = match given.is_dir() {
        true if colmap::find_model(given).is_ok() => None,
        true => calibration_in(given),
        // A pipe can be read once.
        false => Some(given.to_owned()),
    };
    file.filter(|file| file.is_file() && formats::detect(file) == Some(Format::Transforms))
}

/// The images of a COLMAP model, by name.
fn of_model(folder: &Path) -> anyhow::Result<Vec<NamedView>> {
    let model = colmap::read_model(&colmap::find_model(folder)?)?;
    of_images(&model, &BTreeMap::new())
}

/// The frames of a `transforms.json`, by name, where and as large as an import has them.
fn of_transforms(file: &Path) -> anyhow::Result<Vec<NamedView>> {
    let (whole, sizes) = read_bare(Format::Transforms, file)?;
    if sizes == Sizes::Unknown {
        bail!(
            "{}: neither it nor pictures where its frames name them say how large these are; give it \"w\" and \"h\", \
             the width and height in pixels",
            file.display()
        );
    }
    let mut views = of_images(&whole, &formats::read_files_beside(file)?.times)?;
    name_from_shared(&mut views, file)?;
    views.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(views)
}

/// Where names lead out of their file's folder, as those of a scene's photos do, has all views called by the way from
/// the deepest folder that all of them share.
fn name_from_shared(views: &mut [NamedView], file: &Path) -> anyhow::Result<()> {
    let leads_out = |view: &NamedView| {
        let mut parts = Path::new(&view.name).components();
        !parts.all(|part| matches!(part, Component::Normal(_) | Component::CurDir))
    };
    if !views.iter().any(leads_out) {
        return Ok(());
    }
    let whole = std::path::absolute(file)?;
    let folder = whole.parent().unwrap_or(&whole);
    let pictures = views.iter().map(|view| straight(&folder.join(&view.name)));
    let pictures: Vec<PathBuf> = pictures.collect();
    let around = pictures.first().and_then(|picture| picture.parent());
    let mut shared = around.map_or_else(PathBuf::new, Path::to_owned);
    for picture in &pictures {
        while !picture.starts_with(&shared) && shared.pop() {}
    }
    for (view, picture) in views.iter_mut().zip(&pictures) {
        if let Ok(way) = picture.strip_prefix(&shared) {
            let parts: Vec<Cow<'_, str>> = way.iter().map(OsStr::to_string_lossy).collect();
            view.name = parts.join("/");
        }
    }
    Ok(())
}

/// An absolute path without the folders that it enters and leaves again.
fn straight(path: &Path) -> PathBuf {
    let mut straight = PathBuf::new();
    for part in path.components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir => {
                straight.pop();
            }
            part => straight.push(part),
        }
    }
    straight
}

/// The images of a calibration, by name; `times`, in seconds, are by name, too.
fn of_images(
    whole: &Reconstruction,
    times: &BTreeMap<String, f64>,
) -> anyhow::Result<Vec<NamedView>> {
    let mut views = Vec::new();
    for image in whole.images.values() {
        let camera = &whole.cameras[&image.camera_id];
        let lens = camera.lens().map_err(|source| SceneError::Camera {
            name: image.name.clone(),
            source,
        })?;
        views.push(NamedView {
            name: image.name.clone(),
            view: View {
                lens,
                width: camera.width,
                height: camera.height,
                camera_from_world: image.camera_from_world,
            },
            time_s: times.get(&image.name).copied(),
        });
    }
    views.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(views)
}

/// Reads a path's file, and says so where no frame shows its last keyframe.
pub(super) fn read_path(file: &Path, frame: &NerfstudioFrame) -> anyhow::Result<CameraPath> {
    Ok(read_with_keyframes(file, frame)?.0)
}

/// The same, with the keyframes, where it has some: a screenshot has one.
fn read_with_keyframes(
    file: &Path,
    frame: &NerfstudioFrame,
) -> anyhow::Result<(CameraPath, Option<KeyframeFile>)> {
    let (path, keyframes) = path::read_with_keyframes(file, frame)?;
    let cut_short = keyframes
        .as_ref()
        .and_then(|keyframes| keyframes.cut_short_s(&path));
    if let Some([last_s, shown_s]) = cut_short {
        say!(
            "note: {}: no frame shows the last keyframe, at {last_s:.3} s: the path ends at {shown_s:.3} s, with its \
             last frame of {} a second",
            file.display(),
            path.fps
        );
    }
    Ok((path, keyframes))
}

/// The frames of a path file, or the one that a screenshot was taken of.
fn of_file(file: &Path, frame: &NerfstudioFrame) -> anyhow::Result<Asked> {
    let (path, keyframes) = read_with_keyframes(file, frame)?;
    let has_times = match keyframes {
        // Frames between keyframes without times of their own have those of the path.
        Some(read) => read.keyframes.iter().any(|k| k.time_s.is_some()),
        None => has_times(path.frames.iter().map(|frame| frame.time_s), path.fps),
    };
    let (views, fps) = named(path);
    Ok(Asked::Read {
        views,
        fps,
        are_images: false,
        has_times,
        untimed: "give it a \"time_s\"",
    })
}

fn named(path: CameraPath) -> (Vec<NamedView>, f64) {
    let fps = path.fps;
    let named = |frame: PathFrame| NamedView {
        name: frame.name,
        view: frame.view,
        time_s: frame.time_s,
    };
    (path.frames.into_iter().map(named).collect(), fps)
}
