//! The distortion coefficients of a camera matrix, and which model they are of.

use super::OpenCvError;
use super::cameras::{Keys, asked, model_name};
use super::values::{Named, Values, plain};

/// The distortion coefficients that belong to a camera matrix.
pub(super) fn coefficients_for<'a>(
    values: &Values<'a>,
    camera: &Named<'_>,
    keys: &Keys,
    notes: &mut Vec<String>,
) -> Result<Option<(Named<'a>, Vec<f64>)>, OpenCvError> {
    // 1. Those asked for; else those of the same side, in the same map.
    let named = match keys.distortion.as_deref() {
        Some("none") => return Ok(None),
        Some(key) => Some(asked(values, key)?),
        None => {
            let side = camera.role.as_ref().map_or("", |(_, side)| side);
            values.distortion(camera.prefix(), side)
        }
    };
    if let Some(named) = named
        && let Some(matrix) = named.node.matrix()
    {
        if matrix.channels != 1 || (matrix.rows > 1 && matrix.cols > 1) {
            let problem = format!(
                "the distortion is {}, expected one row or column of coefficients",
                matrix.shape()
            );
            return Err(values.refuse(named, problem));
        }
        if let Some(bad) = matrix.data.iter().find(|x| !x.is_finite()) {
            let problem = format!("the distortion holds {bad}, expected finite numbers");
            return Err(values.refuse(named, problem));
        }
        return Ok(Some((named.clone(), matrix.data)));
    }
    // 2. There may be some under a name that nobody knows.
    if let Some(named) = values.unknown_coefficients() {
        let problem = format!(
            "these may be the distortion coefficients of {}, for which none have a name known \
             here; choose with --distortion KEY, or say --distortion none",
            camera.path
        );
        return Err(values.refuse(named, problem));
    }
    notes.push(format!(
        "{} has no distortion coefficients: taken as a pinhole camera",
        camera.path
    ));
    Ok(None)
}

/// Whether coefficients are those of `cv::fisheye`: as OpenCV's samples say it, then by
/// the model's or the matrices' names (the camera's first), then by the file's.
pub(super) fn is_fisheye(
    values: &Values<'_>,
    keys: &Keys,
    matrices: [&Named<'_>; 2],
    count: usize,
    notes: &mut Vec<String>,
) -> bool {
    let says_so = |text: &str| {
        let text = plain(text);
        ["fisheye", "equidistant", "kannala"]
            .iter()
            .any(|m| text.contains(m))
    };
    if keys.fisheye {
        return true;
    }
    let prefix = matrices[0].prefix();
    let flag = values.find_for(prefix, &["fisheyemodel", "usefisheye", "isfisheye"]);
    if let Some(flag) = flag.and_then(|flag| flag.node.number()) {
        return flag != 0.0;
    }
    if let Some(model) = model_name(values, prefix) {
        return says_so(model);
    }
    if matrices.iter().any(|named| says_so(&named.path)) {
        return true;
    }
    if count != 4 {
        return false;
    }
    let file = values
        .file
        .file_name()
        .unwrap_or_default()
        .to_string_lossy();
    let by_file = says_so(&file);
    notes.push(if by_file {
        format!("the 4 coefficients are taken as a fisheye's, by the file's name {file}")
    } else {
        "the 4 coefficients are taken as k1 k2 p1 p2; if cv::fisheye computed them, say --fisheye"
            .to_owned()
    });
    by_file
}
