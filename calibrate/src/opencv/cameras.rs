//! The cameras of a storage file.

use super::OpenCvError;
use super::coefficients::{coefficients_for, is_fisheye};
use super::flat::{of_scalars, size};
use super::storage::{Matrix, Node, Value};
use super::values::{Named, Role, Values, plain};
use crate::{Camera, CameraError, Distortion, Lens};
use glam::DVec2;
use std::collections::HashMap;

/// Which of a file's matrices to use, where its names leave that open.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Keys {
    /// What the camera matrix is called; within maps, with their names and dots before it.
    pub camera_matrix: Option<String>,
    /// What the distortion coefficients are called; `none`: there are none.
    pub distortion: Option<String>,
    /// Four coefficients are those of `cv::fisheye`.
    pub fisheye: bool,
}

/// A camera that OpenCV calibrated.
#[derive(Clone, Debug, PartialEq)]
pub struct OpenCvCamera {
    /// What the file calls its matrix.
    pub name: String,
    /// Intrinsics.
    pub lens: Lens,
    /// Width and height in pixels, where the file says.
    pub size: Option<(u32, u32)>,
}

/// The cameras of a file, and what had to be guessed.
pub(super) fn cameras(
    values: &Values<'_>,
    keys: &Keys,
    notes: &mut Vec<String>,
) -> Result<Vec<OpenCvCamera>, OpenCvError> {
    refuse_other_models(values, keys)?;
    let mut cameras = if let Some(key) = &keys.camera_matrix {
        vec![of_matrix(values, asked(values, key)?, keys, notes)?]
    } else {
        of_known_names(values, keys, notes)?
    };
    if cameras.is_empty() {
        cameras = of_scalars(values, keys)?;
    }
    if cameras.is_empty() {
        return Err(OpenCvError::NoCamera {
            path: values.file.clone(),
            found: values.matrices(),
        });
    }
    Ok(cameras)
}

/// What says which model the distortion is of.
const DISTORTION_MODEL: [&str; 2] = ["distortionmodel", "distortiontype"];
/// And which the camera is of: Kalibr writes `pinhole` for all of its distortions.
const CAMERA_MODEL: [&str; 5] = [
    "modeltype",
    "cameratype",
    "camera1type",
    "cameramodel",
    "calibrationmodel",
];

/// The models of other programs that keep their calibration in storage files.
fn refuse_other_models(values: &Values<'_>, keys: &Keys) -> Result<(), OpenCvError> {
    let refuse = |model: String| {
        Err(OpenCvError::Model {
            path: values.file.clone(),
            model,
        })
    };
    let xi = values
        .find_within(&["xi"])
        .and_then(|v| v.node.matrix_or_number());
    let xi = xi.unwrap_or(0.0);
    // Of all cameras, or of the one that is asked for.
    let key = keys.camera_matrix.as_deref();
    let prefix = key.map(|key| &key[..key.rfind('.').map_or(0, |at| at + 1)]);
    let names = [&CAMERA_MODEL[..], &DISTORTION_MODEL].concat();
    for named in values.called(&names) {
        let Some(model) = named.node.text() else {
            continue;
        };
        if prefix.is_some_and(|prefix| values.is_of_another(prefix, named)) {
            continue;
        }
        let plain = plain(model);
        if ["mei", "omni", "scaramuzza", "ocam", "eucm"]
            .iter()
            .any(|m| plain.contains(m))
        {
            return refuse(format!("{model} (omnidirectional, with a mirror)"));
        }
    }
    if xi != 0.0 {
        return refuse(format!("omnidirectional (Mei's, xi = {xi})"));
    }
    Ok(())
}

/// What the file calls the model of the distortion of a camera whose matrix has a prefix, if it says;
/// else that of the camera.
pub(super) fn model_name<'a>(values: &Values<'a>, prefix: &str) -> Option<&'a str> {
    let text = |names: &[&str]| values.find_for(prefix, names)?.node.text();
    text(&DISTORTION_MODEL).or_else(|| text(&CAMERA_MODEL))
}

pub(super) fn asked<'v, 'a>(
    values: &'v Values<'a>,
    key: &str,
) -> Result<&'v Named<'a>, OpenCvError> {
    let found = values
        .exactly(key)
        .filter(|named| named.node.matrix().is_some());
    found.ok_or_else(|| OpenCvError::NoSuchKey {
        path: values.file.clone(),
        key: key.to_owned(),
        found: values.matrices(),
    })
}

/// Cameras whose matrices have names known here: one, or one a side.
fn of_known_names(
    values: &Values<'_>,
    keys: &Keys,
    notes: &mut Vec<String>,
) -> Result<Vec<OpenCvCamera>, OpenCvError> {
    let mut found: Vec<(String, &Named<'_>, Matrix)> = Vec::new();
    let mut by_group: HashMap<String, usize> = HashMap::new();
    for named in &values.all {
        let Some((Role::CameraMatrix, side)) = &named.role else {
            continue;
        };
        let Some(matrix) = folded(named.node) else {
            continue;
        };
        // Short names are often something else; a long one is meant.
        let certain = named.plain().len() > 4;
        if !certain && (matrix.rows, matrix.cols) != (3, 3) {
            continue;
        }
        let group = format!("{}{side}", plain(named.prefix()));
        match by_group.get(&group).map(|&i| &found[i]) {
            None => {
                by_group.insert(group.clone(), found.len());
                found.push((group, named, matrix));
            }
            Some((_, _, same)) if same.data == matrix.data => {}
            Some((_, earlier, _)) => {
                let problem = format!(
                    "another camera matrix stands in line {} ({}); choose with --camera-matrix \
                     KEY, or remove one",
                    earlier.node.line, earlier.path
                );
                return Err(values.refuse(named, problem));
            }
        }
    }
    found.sort_by(|a, b| a.0.cmp(&b.0));
    let of = |(_, named, _): &(String, &Named<'_>, Matrix)| of_matrix(values, named, keys, notes);
    found.iter().map(of).collect()
}

fn of_matrix(
    values: &Values<'_>,
    named: &Named<'_>,
    keys: &Keys,
    notes: &mut Vec<String>,
) -> Result<OpenCvCamera, OpenCvError> {
    let k = intrinsics(values, named)?;
    let coefficients = coefficients_for(values, named, keys, notes)?;
    let distortion = match &coefficients {
        None => Some(Distortion::None),
        Some((of, c)) if is_fisheye(values, keys, [named, of], c.len(), notes) => {
            let refuse = || {
                let problem = format!(
                    "a fisheye's distortion has {} coefficients, expected 4 (k1 k2 k3 k4)",
                    c.len()
                );
                values.refuse(of, problem)
            };
            Some(Distortion::SkewedFisheye {
                k: c.as_slice().try_into().map_err(|_| refuse())?,
                alpha: k.skew / k.focal.x,
            })
        }
        Some((_, c)) => Distortion::of_opencv(c),
    };
    let Some(distortion) = distortion else {
        let (of, c) = coefficients.unwrap_or((named.clone(), Vec::new()));
        let problem = format!(
            "distortion has {} coefficients, expected 0, 4, 5, 8, 12 or 14; choose others with \
             --distortion KEY, or none with --distortion none",
            c.len()
        );
        return Err(values.refuse(&of, problem));
    };
    // OpenCV's own functions ignore skew but for the fisheye.
    if k.skew != 0.0 && !matches!(distortion, Distortion::SkewedFisheye { .. }) {
        let problem = format!(
            "the camera matrix has skew {}, which OpenCV's pinhole model does not have; set it \
             to 0, or say --fisheye if cv::fisheye computed it",
            k.skew
        );
        return Err(values.refuse(named, problem));
    }
    let lens = Lens::new(k.focal, k.principal + 0.5, distortion);
    // What a model cannot have, such as a sensor tilted by a right angle. The size is not known yet.
    if let Err(error) = Camera::of(&lens, 1, 1).lens() {
        let wrong = match (&error, &coefficients) {
            (CameraError::Range { .. }, Some((of, _))) => of,
            _ => named,
        };
        return Err(values.refuse(wrong, format!("{error}; calibrate again")));
    }
    Ok(OpenCvCamera {
        name: named.path.clone(),
        lens,
        size: size(values, named.prefix())?,
    })
}

/// A matrix. A plain list of nine numbers that is a camera matrix row by row, as in ROS's CameraInfo, is 3 × 3;
/// what says of itself that it has another shape keeps that.
fn folded(node: &Node) -> Option<Matrix> {
    let matrix = node.matrix()?;
    let is_list = matches!(node.value, Value::Sequence(_)) && matrix.rows == 1;
    if is_list && matrix.cols == 9 && matrix.data[6..] == [0.0, 0.0, 1.0] {
        let (rows, cols) = (3, 3);
        return Some(Matrix {
            rows,
            cols,
            ..matrix
        });
    }
    Some(matrix)
}

/// What a camera matrix says, in OpenCV's pixels.
struct Intrinsics {
    focal: DVec2,
    principal: DVec2,
    skew: f64,
}

fn intrinsics(values: &Values<'_>, named: &Named<'_>) -> Result<Intrinsics, OpenCvError> {
    let refuse = |problem: String| Err(values.refuse(named, problem));
    let Some(matrix) = folded(named.node) else {
        return refuse("no matrix, expected a 3 × 3 camera matrix".to_owned());
    };
    let m = &matrix.data;
    if let Some(bad) = m.iter().find(|x| !x.is_finite()) {
        return refuse(format!(
            "the camera matrix holds {bad}, expected finite numbers"
        ));
    }
    let [fx, skew, cx, fy, cy] = match (matrix.rows, matrix.cols, matrix.channels) {
        (3, 3, 1) => {
            let below = [m[3], m[6], m[7], m[8]];
            if below != [0.0, 0.0, 0.0, 1.0] {
                let transposed = m[2] == 0.0 && m[5] == 0.0 && m[6] != 0.0 && m[7] != 0.0;
                return refuse(format!(
                    "the camera matrix is [{} {} {}; {} {} {}; {} {} {}], expected \
                     [fx 0 cx; 0 fy cy; 0 0 1]{}",
                    m[0],
                    m[1],
                    m[2],
                    m[3],
                    m[4],
                    m[5],
                    m[6],
                    m[7],
                    m[8],
                    if transposed { "; transpose it" } else { "" }
                ));
            }
            [m[0], m[1], m[2], m[4], m[5]]
        }
        // fx fy cx cy, as some write it.
        (1, 4, 1) | (4, 1, 1) => [m[0], 0.0, m[2], m[1], m[3]],
        _ => {
            return refuse(format!(
                "the camera matrix is {}, expected 3 × 3; choose another with --camera-matrix \
                 KEY",
                matrix.shape()
            ));
        }
    };
    for (name, f) in [("fx", fx), ("fy", fy)] {
        if f <= 0.0 {
            return refuse(format!(
                "the focal length {name} is {f}, expected a positive number; calibrate again"
            ));
        }
    }
    Ok(Intrinsics {
        focal: DVec2::new(fx, fy),
        principal: DVec2::new(cx, cy),
        skew,
    })
}

impl super::Node {
    /// A number, or the only one of a matrix (OpenCV writes `xi` both ways).
    fn matrix_or_number(&self) -> Option<f64> {
        match &self.value {
            Value::Matrix(m) if m.data.len() == 1 => Some(m.data[0]),
            _ => self.number(),
        }
    }
}
