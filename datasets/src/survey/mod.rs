//! A survey of an interior: photos of its model with depth, from all around in every room.
//!
//! What a careful person with a depth camera would bring home. Where rooms and doorways are
//! known exactly, it shows what can be made of photos of them.
//!
//! ```
//! use datasets::house::{HouseOptions, house};
//! use datasets::{Options, survey};
//!
//! let house = house(&HouseOptions { rooms: 2, ..HouseOptions::default() }).unwrap();
//! let options = Options { size: Some((80, 64)), views: Some(48), ..Options::default() };
//! let survey = survey(&house.interior, &house.model, &options).unwrap();
//! assert_eq!(survey.photos.len(), 48);
//! ```

mod places;

use crate::dataset::{posed, settled};
use crate::house::EYE_HEIGHT;
use crate::model_picture::{look, render_model};
use crate::points::{Seen, sparse_points};
use crate::write::{Capture, in_new_folder};
use crate::{DatasetError, Options, Photo, Written};
use calibrate::{Camera, ModelKind, Reconstruction, Rigid3, View};
use glam::{DQuat, DVec3};
use image::DynamicImage;
use proxy::interior::{Contents, Interior};
use proxy::mesh::Model;
use proxy::{MeshKind, Solid};
use std::f64::consts::TAU;
use std::path::Path;

/// Photos of the rooms of a model. Only their cameras and sparse points are worked out here:
/// [`write_survey`] renders them one by one.
#[derive(Debug)]
pub struct Survey<'a> {
    /// In the order of their names.
    pub photos: Vec<Photo>,
    /// Names of the photos kept aside for scoring: one in eight.
    pub held_out: Vec<String>,
    /// Cameras, poses and sparse points, all exact.
    pub reconstruction: Reconstruction,
    /// Depth maps hold this many steps to a world unit: the power of ten that comes nearest to
    /// millimetres, by how high eyes are over the floor.
    pub depth_steps_per_unit: f64,
    model: &'a Model,
    solid: Solid,
    samples_per_side: u32,
}

/// Directions looked into from a place, an eighth of a turn apart; each photo is twice as wide.
const HEADINGS: usize = 8;
/// How far up every other photo looks, and how far down those between.
const PITCH_DEGREES: [f64; 2] = [12.0, -24.0];
/// What the photos of a room come to, unless told otherwise: four places.
const VIEWS_PER_ROOM: usize = 4 * HEADINGS;
const SAMPLES_PER_SIDE: u32 = 2;
const POINTS_PER_VIEW: usize = 60;
const SEED: u32 = 31;

/// Plans photos of an interior's model: in each room from its middle, then from wherever one is
/// farthest from all places so far, at eye height, clear of walls and furniture, all around in
/// steps of 45°, by turns a little up and down, with a field of view of 90°.
///
/// By default 32 for each room, of 320 × 256 pixels; rooms have none for which fewer than eight
/// a room are too few.
///
/// # Errors
/// An option out of its range; cells that the model lacks; no room has a place to stand in.
pub fn survey<'a>(
    interior: &Interior,
    model: &'a Model,
    options: &Options,
) -> Result<Survey<'a>, DatasetError> {
    let samples = options.samples_per_side.or(Some(SAMPLES_PER_SIDE));
    let options = Options {
        samples_per_side: samples,
        ..*options
    };
    let rooms = interior.cells.len().max(1);
    let chosen = options.or_defaults((320, 256), (VIEWS_PER_ROOM * rooms).min(9999))?;
    let (contents, _) = Contents::new(interior, model)?;
    let solid = Solid::new(MeshKind::Mesh, model.mesh.clone());
    let wanted = chosen.views.div_ceil(HEADINGS);
    let places = places::places(interior, &contents, &solid, wanted)?;

    // 1. Cameras.
    let (width, height) = (f64::from(chosen.width), f64::from(chosen.height));
    let camera = Camera {
        model: ModelKind::SimplePinhole,
        width: chosen.width,
        height: chosen.height,
        params: vec![0.5 * width, 0.5 * width, 0.5 * height],
    };
    let lens = camera.lens().expect("a survey's own camera is valid");
    let up = interior.up.normalize_or(DVec3::Y);
    let photo = |i: usize| {
        let view = View {
            lens,
            width: chosen.width,
            height: chosen.height,
            camera_from_world: settled(pose(&places, i, up)),
        };
        Photo {
            name: format!("{i:04}.png"),
            camera: camera.clone(),
            view,
            time_s: None,
        }
    };
    let photos: Vec<Photo> = (0..chosen.views).map(photo).collect();

    // 2. What structure from motion would leave.
    let mut reconstruction = posed(&camera, &photos);
    let views: Vec<&View> = photos.iter().map(|photo| &photo.view).collect();
    let seen = SeenInModel {
        model,
        solid: &solid,
    };
    let count = POINTS_PER_VIEW * photos.len();
    sparse_points(&views, &seen, count, SEED, &mut reconstruction);

    // 3. Of each place one photo is held out, each time in another direction.
    let is_held_out = |i: usize| i % HEADINGS == (i / HEADINGS) % HEADINGS;
    let held_out = (0..photos.len()).filter(|i| is_held_out(*i));
    Ok(Survey {
        held_out: held_out.map(|i| photos[i].name.clone()).collect(),
        photos,
        reconstruction,
        depth_steps_per_unit: depth_steps_per_unit(interior.eye_height),
        model,
        solid,
        samples_per_side: chosen.samples_per_side,
    })
}

/// The power of ten of steps to a world unit that comes nearest to millimetres.
fn depth_steps_per_unit(eye_height: f64) -> f64 {
    let meter = eye_height / EYE_HEIGHT;
    10_f64.powi((1000.0 / meter).log10().round() as i32)
}

/// The camera of photo `i`.
fn pose(places: &[DVec3], i: usize, up: DVec3) -> Rigid3 {
    let (place, heading) = (i / HEADINGS, i % HEADINGS);
    let center = places[place % places.len()];
    // Neighbouring places do not look in the same directions.
    let turn = (heading as f64 / HEADINGS as f64 + 0.618 * place as f64 / HEADINGS as f64) * TAU;
    let pitch = PITCH_DEGREES[heading % 2].to_radians();
    let level = DQuat::from_axis_angle(up, turn) * up.any_orthonormal_vector();
    let ahead = pitch.cos() * level + pitch.sin() * up;
    Rigid3::looking_at(center, center + ahead, up)
}

struct SeenInModel<'a> {
    model: &'a Model,
    solid: &'a Solid,
}

impl Seen for SeenInModel<'_> {
    fn trace(&self, _: usize, from: DVec3, direction: DVec3) -> Option<(DVec3, [u8; 3])> {
        let (point, _, color) = look(self.model, self.solid, from, direction)?;
        Some((point, color.map(|c| c.round() as u8)))
    }

    fn distance(&self, _: usize, from: DVec3, direction: DVec3) -> Option<f64> {
        let hit = self.solid.first_hit(from, direction)?;
        Some(hit.along * direction.length())
    }
}

/// Renders and writes a survey as [`write`](crate::write()) does a dataset.
///
/// # Errors
/// `folder` exists and is not empty, or something cannot be written; then nothing stays behind.
pub fn write_survey(survey: &Survey, folder: &Path) -> Result<Written, DatasetError> {
    let capture = Capture {
        photos: &survey.photos,
        held_out: &survey.held_out,
        reconstruction: &survey.reconstruction,
        depth_steps_per_unit: survey.depth_steps_per_unit,
        readme: readme(survey),
    };
    in_new_folder(
        folder,
        |_| false,
        |partial| {
            capture.fill(partial, |photo: &Photo| {
                let (picture, depths) = render_model(
                    survey.model,
                    &survey.solid,
                    &photo.view,
                    survey.samples_per_side,
                );
                (DynamicImage::from(picture).into_rgb8().into(), depths)
            })
        },
    )?;
    Ok(capture.written(folder))
}

fn readme(survey: &Survey) -> String {
    let points = &survey.reconstruction.points;
    let camera = &survey.photos[0].camera;
    format!(
        "# survey\n\
         \n\
         - Source: `lumigraph generate survey`, photos of an interior's model. Licence: as the \
         model's.\n\
         - Kind: RGB-D, all around from places in every room.\n\
         - {photos} images of {width} x {height} (images/), depth/; {held_out} held out in \
         split.json (one of each place).\n\
         - Calibration: poses, {points} points and depth are exact. depth/NAME.png is 16-bit \
         along z at pixel centres, {step} world units a step (`import --depth-scale {step}`), \
         0 = no surface within {reach}.\n",
        photos = survey.photos.len(),
        width = camera.width,
        height = camera.height,
        held_out = survey.held_out.len(),
        points = points.len(),
        step = 1.0 / survey.depth_steps_per_unit,
        reach = f64::from(u16::MAX) / survey.depth_steps_per_unit,
    )
}
