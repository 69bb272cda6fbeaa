//! VisualSFM's `.nvm` files (NVM_V3; Wu's documentation at ccwu.me/vsfm/doc.html).
//!
//! - A camera has x right, y down, z forward; its line is NAME f q_w q_x q_y q_z c_x c_y
//!   c_z r 0, with q the rotation camera from world and c the centre in the world.
//! - Pixels are relative to the image's centre, y down; SiftGPU, which measures them, puts
//!   the first pixel's centre at (0.5, 0.5) as we do. Sizes are not stored. COLMAP's
//!   `model_converter` (3.8 does) writes them relative to the image's corner: the way that
//!   fits the model is taken.
//! - Distortion acts on the *measurement* (Wu, "Critical configurations for radial
//!   distortion self-calibration", and PBA's `SetNormalizedMeasurementDistortion`): with d
//!   the measured position over f, the undistorted one is u = d·(1 + r·|d|²):
//!   [`crate::ModelKind::InverseRadial`].
//! - With `NVM_V3 FixedK fx cx fy cy` all cameras share that calibration.
//!
//! A file may hold several models, which are not in one frame; then photos that are in none,
//! as a model without points. The model with the most photos is read.

use super::build::{self, Builder, SizeOf};
use super::error::{FormatError, Problem};
use super::words::{LINE, WORD, Words};
use crate::excerpt::excerpt;
use crate::{Camera, Distortion, ImageId, Lens, Pixel, Point3DId, Reconstruction};
use glam::{DMat3, DQuat, DVec2, DVec3};
use std::path::Path;

/// How far from 1 a quaternion's length may be.
const QUATERNION_TOLERANCE: f64 = 1e-3;
/// Of how many of the models that are not taken a note tells the photos.
const SHOWN: usize = 5;

/// Reads the model of an `.nvm` file that has the most images, of equal ones the first.
/// Images and points are numbered from 0, as in the file; keypoints are in the order of the
/// points that they observe. `size_of` is asked for every image of the model, and of the
/// file's first. Where there are other models, or measurements do not count from the images'
/// centres, `notes` say so.
///
/// # Errors
/// An unreadable file, another version, a quaternion that is no rotation, a camera
/// without a lens, a photo of unknown size, two photos of one name.
pub fn read_nvm(
    path: &Path,
    size_of: SizeOf<'_>,
    notes: &mut Vec<String>,
) -> Result<Reconstruction, FormatError> {
    parse_nvm(path, &build::read(path)?, size_of, notes)
}

/// Reads the content of a file; `path` is only named in errors and notes.
///
/// # Errors
/// As for [`read_nvm`].
pub fn parse_nvm(
    path: &Path,
    bytes: &[u8],
    size_of: SizeOf<'_>,
    notes: &mut Vec<String>,
) -> Result<Reconstruction, FormatError> {
    let mut words = Words::new(path, build::text(path, bytes)?);
    let header = words.line().unwrap_or_default();
    let shared = fixed_calibration(header).map_err(|problem| words.error("header", problem))?;
    let mut whole = read_model(path, &mut words, shared, size_of)?;

    // How many photos all models have, how many the largest, and where that begins.
    let mut images = vec![whole.images.len() as u64];
    let mut largest = (images[0], None);
    loop {
        let begin = words.clone();
        match pass_model(&mut words) {
            Next::End => break,
            Next::Model { points: 0, .. } => {}
            Next::Model { images: count, .. } => {
                images.push(count.into());
                if u64::from(count) > largest.0 {
                    largest = (count.into(), Some(begin));
                }
            }
            Next::Broken => {
                notes.push(format!(
                    "{}: models from {} on are not used: it cannot be read",
                    path.display(),
                    words.place(&format!("model {}", images.len()))
                ));
                break;
            }
        }
    }
    if let (_, Some(mut begin)) = largest {
        whole = read_model(path, &mut begin, shared, size_of)?;
    }
    notes.extend(of_several(path, images, largest.0));
    notes.extend(place_keypoints(path, &mut whole));
    Ok(whole)
}

/// What to say where there are several models, by how many photos they and the one that is
/// taken have.
fn of_several(path: &Path, mut images: Vec<u64>, taken: u64) -> Option<String> {
    let count = images.len();
    images.remove(images.iter().position(|&images| images == taken)?);
    let others: Vec<String> = images.iter().take(SHOWN).map(u64::to_string).collect();
    let more = if images.len() > SHOWN { ", …" } else { "" };
    (count > 1).then(|| {
        format!(
            "{}: holds {count} models that VisualSFM could not join; the one with {taken} photos \
             is taken, and not those with {}{more}",
            path.display(),
            others.join(", ")
        )
    })
}

/// What comes after a model.
enum Next {
    /// Another one, or photos that are in none.
    Model {
        images: u32,
        points: u64,
    },
    /// The end of the models.
    End,
    Broken,
}

/// Passes over a model without reading it.
fn pass_model(words: &mut Words<'_>) -> Next {
    // Behind the models' end comes what concerns PLY files, and comments.
    let images = match words.next().map(str::parse::<u32>) {
        Some(Ok(images)) if images > 0 => images,
        _ => return Next::End,
    };
    match pass_content(words, images) {
        Some(points) => Next::Model { images, points },
        None => Next::Broken,
    }
}

/// Passes over images and points: how many points.
fn pass_content(words: &mut Words<'_>, images: u32) -> Option<u64> {
    for _ in 0..images {
        while words.line()?.trim().is_empty() {}
    }
    let points: u64 = words.next()?.parse().ok()?;
    for _ in 0..points {
        let position_and_color = 6;
        for _ in 0..position_and_color {
            words.next()?;
        }
        let measurements: u64 = words.next()?.parse().ok()?;
        for _ in 0..measurements {
            let measurement = 4;
            for _ in 0..measurement {
                words.next()?;
            }
        }
    }
    Some(points)
}

/// Reads a model.
fn read_model(
    path: &Path,
    words: &mut Words<'_>,
    shared: Option<(DVec2, DVec2)>,
    size_of: SizeOf<'_>,
) -> Result<Reconstruction, FormatError> {
    let image_count: u32 = words.parse("header", "the number of images")?;
    let mut builder = Builder::new(path);
    for index in 0..image_count {
        read_image(words, &mut builder, index, shared, size_of)?;
    }
    let point_count: u64 = words.parse("points", "the number of points")?;
    for id in 0..point_count {
        read_point(words, &mut builder, id, image_count)?;
    }
    builder.finish("images")
}

/// Moves measurements to where they count from, and says so where that is not as VisualSFM
/// has it: from the images' corners if so they are less than half as far from what their
/// points project to. The two ways are half an image apart.
fn place_keypoints(path: &Path, whole: &mut Reconstruction) -> Option<String> {
    let from_corner = whole.median_error_px();
    let from_center = whole.median_error_px_from(principal);
    if let (Some(corner_px), Some(center_px)) = (from_corner, from_center)
        && corner_px < center_px / 2.0
    {
        return Some(format!(
            "{}: measurements are taken to count from the photos' corners, as COLMAP writes \
             them: they are {corner_px:.1} pixels from their points (the median), counted from \
             the photos' centres {center_px:.1}",
            path.display()
        ));
    }
    for image in whole.images.values_mut() {
        let origin = principal(&whole.cameras[&image.camera_id]);
        for keypoint in &mut image.keypoints {
            keypoint.x += origin.x;
            keypoint.y += origin.y;
        }
    }
    None
}

/// The principal point is the origin of measurements.
fn principal(camera: &Camera) -> DVec2 {
    DVec2::new(camera.params[2], camera.params[3])
}

/// The calibration that all cameras share, if the first line gives one: (fx, fy) and
/// (cx, cy).
fn fixed_calibration(header: &str) -> Result<Option<(DVec2, DVec2)>, Problem> {
    let mut words = header.split_whitespace();
    if words.next() != Some("NVM_V3") {
        return Err(Problem::new(
            format!("found {}, expected \"NVM_V3\"", excerpt(header, WORD)),
            "save the model again with a VisualSFM of 2011 or later",
        ));
    }
    let rest: Vec<&str> = words.collect();
    if rest.first() != Some(&"FixedK") {
        return Ok(None);
    }
    let numbers: Vec<f64> = rest[1..]
        .iter()
        .filter_map(|word| word.parse().ok())
        .collect();
    match numbers[..] {
        [fx, cx, fy, cy] if rest.len() == 5 => Ok(Some((DVec2::new(fx, fy), DVec2::new(cx, cy)))),
        _ => Err(Problem::broken(format!(
            "found {}, expected \"NVM_V3 FixedK fx cx fy cy\"",
            excerpt(header, LINE)
        ))),
    }
}

fn read_image(
    words: &mut Words<'_>,
    builder: &mut Builder<'_>,
    index: u32,
    shared: Option<(DVec2, DVec2)>,
    size_of: SizeOf<'_>,
) -> Result<(), FormatError> {
    let of = format!("image {index}");
    let line = loop {
        match words.line() {
            None => {
                let problem = Problem::broken("the file ends, expected an image");
                return Err(words.error(&of, problem));
            }
            Some(line) if line.trim().is_empty() => {}
            Some(line) => break line,
        }
    };
    let (name, numbers) = split(line).map_err(|problem| words.error(&of, problem))?;
    let of = format!("image {index}, {name}");
    let refuse = |problem| words.error(&of, problem);
    let [f, w, x, y, z, cx, cy, cz, r] = numbers;

    let rotation = DQuat::from_xyzw(x, y, z, w);
    let length = rotation.length();
    if !((length - 1.0).abs() <= QUATERNION_TOLERANCE) {
        return Err(refuse(Problem::broken(format!(
            "the rotation's quaternion ({w}, {x}, {y}, {z}) has length {length}, expected 1"
        ))));
    }
    let camera_axes = DMat3::from_quat(rotation.normalize().conjugate());
    let pose = build::pose(camera_axes, DVec3::new(cx, cy, cz)).map_err(refuse)?;

    let (width, height) = build::size(size_of, &name).map_err(refuse)?;
    let center = DVec2::new(f64::from(width), f64::from(height)) / 2.0;
    let (focal, center) = shared.unwrap_or((DVec2::splat(f), center));
    let lens = Lens::new(focal, center, Distortion::InverseRadial { k: r });
    let camera = Camera::of(&lens, width, height);
    let place = words.place(&of);
    let camera_id = builder.camera(&place, camera)?;
    builder.image(&place, ImageId(index), &name, camera_id, pose)
}

/// An image's name and its nine numbers that mean something. VisualSFM writes a space in
/// a name as `"`, but other programs leave it.
fn split(line: &str) -> Result<(String, [f64; 9]), Problem> {
    let mut words: Vec<&str> = line.rsplitn(11, char::is_whitespace).collect();
    if line.contains('\t') || words.iter().any(|word| word.is_empty()) {
        // Several blanks in a row: between the numbers they count as one.
        words = line.split_whitespace().rev().take(10).collect();
        let first = words
            .last()
            .map_or(0, |word| word.as_ptr() as usize - line.as_ptr() as usize);
        words.push(&line[..first]);
    }
    if words.len() != 11 {
        return Err(Problem::broken(format!(
            "found {}, expected a name and ten numbers",
            excerpt(line, LINE)
        )));
    }
    let name = build::name(&words[10].replace('"', " "))?;
    let mut numbers = [0.0_f64; 9];
    for (number, word) in numbers.iter_mut().zip(words[1..10].iter().rev()) {
        *number = word
            .parse()
            .ok()
            .filter(|n: &f64| n.is_finite())
            .ok_or_else(|| {
                let found = excerpt(word, WORD);
                Problem::broken(format!("found {found}, expected a finite number"))
            })?;
    }
    Ok((name, numbers))
}

fn read_point(
    words: &mut Words<'_>,
    builder: &mut Builder<'_>,
    id: u64,
    image_count: u32,
) -> Result<(), FormatError> {
    let of = format!("point {id}");
    let position = DVec3::from_array(words.numbers(&of, "a position of three numbers")?);
    let color = words.color(&of)?;
    let measurements: u64 = words.parse(&of, "the number of measurements")?;
    let mut observations = Vec::new();
    for _ in 0..measurements {
        let image: u32 = words.parse(&of, "an image's number")?;
        let _feature: u64 = words.parse(&of, "a feature's number")?;
        let [x, y] = words.numbers(&of, "a measurement's x and y")?;
        let Some(camera) = builder.camera_of(ImageId(image)) else {
            let problem = format!("found image {image}, expected less than {image_count}");
            return Err(words.error(&of, Problem::broken(problem)));
        };
        // Finite measurements and principal points may still overflow together.
        let pixel = principal(camera) + DVec2::new(x, y);
        if !pixel.is_finite() {
            let problem = format!(
                "image {image} observes the point at ({}, {}), expected finite numbers",
                pixel.x, pixel.y
            );
            return Err(words.error(&of, Problem::broken(problem)));
        }
        observations.push((ImageId(image), Pixel::new(x, y)));
    }
    let place = words.place(&of);
    builder.point(&place, Point3DId(id), position, color, &observations)
}
