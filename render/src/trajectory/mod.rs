//! Camera paths derived from a capture, such that they stay where its photos can support
//! them.
//!
//! Nothing here looks at the world's axes: a capture that is moved, turned or scaled has
//! its paths moved, turned and scaled.

mod capture;
mod gaze;
mod ring;
mod stray;
mod upright;

pub use upright::{Standing, Upright, upright};

use crate::lumigraph::SourceView;
use crate::path::{CameraPath, Curve, Interpolation, PathError, PathFrame, default_name};
use calibrate::{Camera, ModelKind, Rigid3, View};
use capture::Capture;
use glam::DVec3;
use proxy::Proxy;
use ring::Ring;
use std::f64::consts::{PI, TAU};
use stray::without_strays;
use upright::turned;

/// The kinds of path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trajectory {
    /// Around the object, where the cameras surround one; otherwise a small ellipse in the
    /// plane of the cameras, looking at the same place all the while.
    Orbit,
    /// From the middle of the capture towards the scene, back and beyond, and to the middle again;
    /// where the cameras were walked forwards, along the walk.
    Dolly,
    /// Along the longest direction of the camera positions and back, looking as the cameras there do, or at the object that
    /// they surround and look at. Around half of it, or along their arc, where they are few or that way would lead inside
    /// them or over its top.
    Sweep,
}

/// Why there is no path.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TrajectoryError {
    /// There is nothing to go by.
    #[error("the capture has no source views")]
    NoSources,
    /// A pose is NaN or infinite.
    #[error("the pose of {0} is not finite")]
    NotFinite(String),
    /// The frames do not make a path.
    #[error(transparent)]
    Path(#[from] PathError),
}

/// The part of the capture's half-extent that a dolly or a small orbit goes from its
/// middle.
const REACH: f64 = 0.5;
/// They also go no further than this part of the distance to the scene: beyond it the
/// photos' resolution and parallax no longer carry.
const REACH_TO_SCENE: f64 = 0.25;
/// Knots of a sweep's curve, and points of an orbit's.
const SWEEP_KNOTS: usize = 64;
const ORBIT_POINTS: usize = 720;

/// A path of `frames` frames that repeats without a jump: after the last frame comes the
/// first. Where it goes back the way it came, frames of the way back lie between those of the way
/// there, and both ends have one: two frames are the ends.
///
/// `points_in_world` are the sparse points, or nothing. All frames have one camera: a
/// pinhole with the median focal length of the source views, their most common image
/// size, and the principal point in its centre. The path of a capture of one place, or of one photo, stands
/// still. Photos stand as their cameras say ([`SourceView::quarters`]), and those taken with the camera turned
/// count as if they stood as most do; see [`upright()`]. Where most lie ([`Standing::lying`]) the path is that of photos that
/// stand, and its frames lie as those do.
/// What a photo looks at is in its middle, wherever its principal point is.
/// Photos whose cameras are misplaced by far do not count.
///
/// # Errors
/// No source views, a pose that is not finite, no frames, a frame rate that is not positive.
pub fn derive(
    kind: Trajectory,
    sources: &[SourceView],
    points_in_world: &[DVec3],
    proxy: &Proxy,
    frames: usize,
    fps: f64,
) -> Result<CameraPath, TrajectoryError> {
    if sources.is_empty() {
        return Err(TrajectoryError::NoSources);
    }
    let not_finite = |s: &&SourceView| !s.view.camera_from_world.is_finite();
    if let Some(source) = sources.iter().find(not_finite) {
        return Err(TrajectoryError::NotFinite(source.name.clone()));
    }

    let sources = without_strays(sources, points_in_world, proxy);
    let views: Vec<&View> = sources.iter().map(|s| &s.view).collect();
    let stand = |turn: u8| {
        let shown = sources.iter().map(|s| (&s.view, (s.quarters + turn) % 4));
        upright(&shown.collect::<Vec<_>>())
    };
    let mut standing = stand(0);
    // Where most lie the path is as if they stood, and then its frames lie as they do.
    let lying = standing.lying;
    if lying != 0 {
        standing = stand(lying);
    }
    for (photo, view) in standing.photos.iter_mut().zip(&views) {
        photo.rotation = gaze::centered(view, photo.rotation);
    }
    let capture = Capture::new(&sources, &standing, points_in_world, proxy);
    let poses: Vec<Rigid3> = match kind {
        Trajectory::Orbit => orbit(&capture, frames),
        Trajectory::Dolly => dolly(&capture, frames),
        Trajectory::Sweep => sweep(&capture, frames),
    };

    let camera = typical_camera(&sources, &standing.photos, lying);
    let frame = |(index, pose): (usize, &Rigid3)| {
        // The capture's poses are relative to its reference camera's centre.
        let center = pose.center() + capture.origin_in_world;
        let rotation = turned(pose.rotation, (4 - lying) % 4);
        let camera_from_world = Rigid3::new(rotation, -(rotation * center));
        let time_s = Some(index as f64 / fps);
        PathFrame::new(
            default_name(index),
            camera.clone(),
            camera_from_world,
            time_s,
        )
        .map_err(|error| PathError::Camera {
            kind: "frame",
            index,
            error,
        })
    };
    let frames = poses.iter().enumerate().map(frame);
    Ok(CameraPath::new(fps, frames.collect::<Result<_, _>>()?)?)
}

/// Where frames are on a way that ends where it began, in even shares of it.
fn all_around(frames: usize) -> impl Iterator<Item = f64> {
    (0..frames).map(move |i| i as f64 / frames as f64)
}

/// Where frames are that go along a way, from 0 to 1, and back, from rest to rest: no two of them at one
/// place, as those of the way back lie between the others, and one at each end. One alone is halfway.
fn there_and_back(frames: usize) -> Vec<f64> {
    if frames == 1 {
        return vec![0.5];
    }
    let there = (0..frames).step_by(2);
    let back = (0..frames).rev().filter(|place| place % 2 == 1);
    let eased = |place: usize| {
        let share = place as f64 / (frames - 1) as f64;
        0.5 - 0.5 * (PI * share).cos()
    };
    there.chain(back).map(eased).collect()
}

fn sweep(capture: &Capture, frames: usize) -> Vec<Rigid3> {
    let shares = there_and_back(frames);
    let ring = capture.ring();
    // The mean of few cameras around something would be in the midst of it.
    if let Some(ring) = ring.as_ref().filter(|r| r.is_sparse(capture.spacing)) {
        return half_around(ring, shares);
    }
    let Some(mut way) = along_the_cameras(capture) else {
        return vec![capture.reference_pose(); frames];
    };
    // The mean of gazes that meet in one place, of cameras side by side and one above the other, meets nothing.
    if let Some(ring) = ring.filter(|ring| capture.is_looked_at(ring.focus)) {
        let is_beside = |(_, pose): &(f64, Rigid3)| ring.is_beside(pose.center());
        match way.knots.iter().all(is_beside) {
            // Where they do not go around it in plan there are none to go around.
            false if ring.surrounds() => return half_around(&ring, shares),
            false => {}
            true => {
                for (_, pose) in &mut way.knots {
                    *pose = Rigid3::looking_at(pose.center(), ring.focus, ring.up);
                }
            }
        }
    }
    let length = way.length();
    let curve = way.curve();
    let places = shares.into_iter().map(|share| length * share);
    places.map(|place| curve.at(place)).collect()
}

/// Around the half of the object that the reference camera is in the middle of, or along the cameras' arc.
fn half_around(ring: &Ring, shares: Vec<f64>) -> Vec<Rigid3> {
    let (from, to) = match ring.arc() {
        (_, _, true) => (-0.5 * PI, 0.5 * PI),
        (from, to, false) => (from, to),
    };
    along_the_ring(ring, from, to, shares)
}

fn dolly(capture: &Capture, frames: usize) -> Vec<Rigid3> {
    if !capture.has_extent() {
        return vec![capture.reference_pose(); frames];
    }
    let reach = (REACH * capture.half_extents[0]).min(REACH_TO_SCENE * capture.nearest_scene);
    let pose = capture.reference_pose();
    let forward = pose.rotation.conjugate() * DVec3::Z;
    // From −1 to 1 and back, begun about halfway there.
    let mut shares = there_and_back(frames);
    shares.rotate_left(frames / 4);
    let along = shares.into_iter().map(|share| 2.0 * share - 1.0);

    // A walk forwards: mostly one direction, and that of the gaze.
    let long = capture.half_extents[0] > 3.0 * capture.half_extents[1];
    if long
        && capture.axes[0].dot(forward).abs() > 0.8
        && let Some(way) = along_the_cameras(capture)
    {
        let middle = way.middle;
        let reach = reach.min(middle).min(way.length() - middle);
        let curve = way.curve();
        return along.map(|t| curve.at(middle + reach * t)).collect();
    }
    along
        .map(|t| {
            let center = forward * (reach * t);
            Rigid3::new(pose.rotation, -(pose.rotation * center))
        })
        .collect()
}

/// A way through the middle of the cameras.
struct Way {
    /// Poses by arc length.
    knots: Vec<(f64, Rigid3)>,
    /// Where it passes the reference camera.
    middle: f64,
}

impl Way {
    fn length(&self) -> f64 {
        self.knots.last().map_or(0.0, |last| last.0)
    }

    fn curve(self) -> Curve {
        Curve::new(self.knots, Interpolation::Spline)
    }
}

/// The way through the middle of the cameras, from 10 % to 90 % of their extent along the
/// principal axis. `None` where the cameras have no extent.
///
/// It starts at the reference camera and follows the cameras about it both ways, so that
/// of a ring it takes one side rather than the middle between both.
fn along_the_cameras(capture: &Capture) -> Option<Way> {
    let axis = capture.axes[0];
    if !capture.has_extent() {
        return None;
    }
    // 1. March both ways from the reference camera.
    let along = |c: &DVec3| c.dot(axis);
    let least = capture
        .centers
        .iter()
        .map(along)
        .fold(f64::INFINITY, f64::min);
    let most = capture
        .centers
        .iter()
        .map(along)
        .fold(f64::NEG_INFINITY, f64::max);
    let step = 0.8 * (most - least) / SWEEP_KNOTS as f64;
    let place = |k: usize| least + 0.1 * (most - least) + step * k as f64;
    let start = (0..=SWEEP_KNOTS).min_by(|&i, &j| place(i).abs().total_cmp(&place(j).abs()))?;
    let middle_of_cameras = |guess: DVec3, k: usize| {
        let at = guess + axis * (place(k) - guess.dot(axis));
        let mean = capture.mean_center(at);
        mean + axis * (place(k) - mean.dot(axis))
    };
    let mut centers = vec![DVec3::ZERO; SWEEP_KNOTS + 1];
    let mut rotations = vec![capture.reference_pose().rotation; SWEEP_KNOTS + 1];
    centers[start] = middle_of_cameras(DVec3::ZERO, start);
    rotations[start] = capture.mean_rotation(centers[start], rotations[start]);
    let upwards = (start + 1..=SWEEP_KNOTS).map(|k| (k, k - 1));
    let downwards = (0..start).rev().map(|k| (k, k + 1));
    for (k, before) in upwards.chain(downwards) {
        centers[k] = middle_of_cameras(centers[before], k);
        rotations[k] = capture.mean_rotation(centers[k], rotations[before]);
    }

    // 2. Smooth the places.
    for _ in 0..4 {
        let rough = centers.clone();
        for k in 1..SWEEP_KNOTS {
            let reach = 3.min(k).min(SWEEP_KNOTS - k);
            let window = &rough[k - reach..=k + reach];
            centers[k] = window.iter().sum::<DVec3>() / window.len() as f64;
        }
    }

    // 3. By arc length.
    let mut knots = Vec::with_capacity(SWEEP_KNOTS + 1);
    let mut length = 0.0;
    for k in 0..=SWEEP_KNOTS {
        if k > 0 {
            length += centers[k].distance(centers[k - 1]);
        }
        let rotation = rotations[k];
        knots.push((length, Rigid3::new(rotation, -(rotation * centers[k]))));
    }
    let middle = knots[start].0;
    Some(Way { knots, middle })
}

fn orbit(capture: &Capture, frames: usize) -> Vec<Rigid3> {
    match capture.ring() {
        Some(ring) => orbit_around(&ring, frames),
        None => small_orbit(capture, frames),
    }
}

/// An ellipse about the reference camera, in the plane of the two longest directions of
/// the camera positions.
fn small_orbit(capture: &Capture, frames: usize) -> Vec<Rigid3> {
    if !capture.has_extent() {
        return vec![capture.reference_pose(); frames];
    }
    let limit = REACH_TO_SCENE * capture.nearest_scene;
    let mut radii = [0, 1].map(|i| (REACH * capture.half_extents[i]).min(limit));
    let at = |radii: [f64; 2], phase: f64| {
        let (sin, cos) = (TAU * phase).sin_cos();
        capture.axes[0] * (radii[0] * cos) + capture.axes[1] * (radii[1] * sin)
    };
    // It shrinks until the cameras are near all around.
    for _ in 0..20 {
        let near =
            |i: u32| capture.distance_to_nearest(at(radii, f64::from(i) / 64.0)) <= capture.spacing;
        if (0..64).all(near) {
            break;
        }
        radii = radii.map(|r| 0.8 * r);
    }
    let up = capture.up_at_reference();
    all_around(frames)
        .map(|t| Rigid3::looking_at(at(radii, t), capture.focus, up))
        .collect()
}

/// Around the object at even speed, as far from it and as high as the cameras thereabouts;
/// to and fro where they leave a gap.
fn orbit_around(ring: &Ring, frames: usize) -> Vec<Rigid3> {
    let (from, to, closed) = ring.arc();
    let shares: Vec<f64> = match closed {
        true => all_around(frames).collect(),
        false => there_and_back(frames),
    };
    along_the_ring(ring, from, to, shares)
}

/// At shares of the way between two azimuths, looking at the object.
fn along_the_ring(ring: &Ring, from: f64, to: f64, shares: Vec<f64>) -> Vec<Rigid3> {
    let azimuth = |i: usize| from + (to - from) * i as f64 / ORBIT_POINTS as f64;
    let centers: Vec<DVec3> = (0..=ORBIT_POINTS).map(|i| ring.at(azimuth(i))).collect();
    let mut lengths = vec![0.0];
    for pair in centers.windows(2) {
        lengths.push(lengths[lengths.len() - 1] + pair[0].distance(pair[1]));
    }
    let length = lengths[ORBIT_POINTS];
    shares
        .into_iter()
        .map(|share| {
            let wanted = share * length;
            let after = lengths
                .partition_point(|&l| l <= wanted)
                .clamp(1, ORBIT_POINTS);
            let (l0, l1) = (lengths[after - 1], lengths[after]);
            let between = if l1 > l0 {
                (wanted - l0) / (l1 - l0)
            } else {
                0.0
            };
            let i = (after - 1) as f64 + between;
            let center = ring.at(from + (to - from) * i / ORBIT_POINTS as f64);
            Rigid3::looking_at(center, ring.focus, ring.up)
        })
        .collect()
}

/// A pinhole with the median focal length (relative to the longer side) and the most
/// common image size, of photos as they stand upright, turned back by so many quarters; of equally common ones the first.
fn typical_camera(sources: &[SourceView], upright: &[Upright], lying: u8) -> Camera {
    let mut counts: Vec<((u32, u32), usize)> = Vec::new();
    for (source, upright) in sources.iter().zip(upright) {
        let (width, height) = (source.view.width, source.view.height);
        let size = match upright.sides_exchanged == lying.is_multiple_of(2) {
            true => (height, width),
            false => (width, height),
        };
        match counts.iter_mut().find(|c| c.0 == size) {
            Some(count) => count.1 += 1,
            None => counts.push((size, 1)),
        }
    }
    let mut common = counts[0];
    for &count in &counts {
        if count.1 > common.1 {
            common = count;
        }
    }
    let (width, height) = common.0;
    let focal = capture::relative_focal(sources).map_or(1.0, |f| f * f64::from(width.max(height)));
    Camera {
        model: ModelKind::Pinhole,
        width,
        height,
        params: vec![
            focal,
            focal,
            0.5 * f64::from(width),
            0.5 * f64::from(height),
        ],
    }
}

#[cfg(test)]
mod tests;
