//! Cameras and image sizes that are written as plain numbers.

use super::OpenCvError;
use super::cameras::{Keys, OpenCvCamera, model_name};
use super::values::{Named, Values, around, plain};
use crate::{Distortion, Lens};
use glam::DVec2;

/// Cameras written as numbers: ORB-SLAM's `Camera.fx`, camodocal's
/// `projection_parameters`.
pub(super) fn of_scalars(
    values: &Values<'_>,
    keys: &Keys,
) -> Result<Vec<OpenCvCamera>, OpenCvError> {
    let mut cameras = Vec::new();
    for named in &values.all {
        let own = named.plain();
        if !(own == "fx" || own == "mu") || named.node.number().is_none() {
            continue;
        }
        let prefix = named.prefix();
        let value = |prefix: &str, names: &[&str]| {
            let path = |name: &&str| values.exactly(&format!("{prefix}{name}"));
            let found = names.iter().find_map(path)?;
            Some((found, found.node.number()?))
        };
        let kannala = own == "mu";
        let all = [
            value(prefix, &["fx", "mu"]),
            value(prefix, &["fy", "mv"]),
            value(prefix, &["cx", "u0"]),
            value(prefix, &["cy", "v0"]),
        ];
        let [Some((_, fx)), Some((_, fy)), Some(cx), Some(cy)] = all else {
            continue;
        };
        if !(fx > 0.0 && fy > 0.0 && fx.is_finite() && fy.is_finite()) {
            let problem = format!(
                "the focal lengths are {fx} and {fy}, expected positive numbers; calibrate again"
            );
            return Err(values.refuse(named, problem));
        }
        let finite = |what: &str, (named, number): (&Named<'_>, f64)| match number.is_finite() {
            true => Ok(number),
            false => {
                let problem =
                    format!("the {what} is {number}, expected a finite number; calibrate again");
                Err(values.refuse(named, problem))
            }
        };
        let (cx, cy) = (
            finite("principal point", cx)?,
            finite("principal point", cy)?,
        );
        let of = prefix.replace("projection_parameters", "distortion_parameters");
        let terms = |names: &[&str]| -> Result<Vec<f64>, OpenCvError> {
            // A fisheye of camodocal's has them beside its focal lengths.
            let found = |name: &str| value(prefix, &[name]).or_else(|| value(&of, &[name]));
            let term = |name: &&str| match found(name) {
                Some(term) => finite("distortion", term),
                None => Ok(0.0),
            };
            names.iter().map(term).collect()
        };
        let says_fisheye = model_name(values, prefix).is_some_and(|model| {
            let model = plain(model);
            model.contains("kannala") || model.contains("fisheye") || model.contains("equi")
        });
        let distortion = if kannala || says_fisheye || keys.fisheye {
            let names = if kannala {
                ["k2", "k3", "k4", "k5"]
            } else {
                ["k1", "k2", "k3", "k4"]
            };
            let k = terms(&names)?;
            Distortion::Fisheye {
                k: [k[0], k[1], k[2], k[3]],
            }
        } else {
            let k = terms(&["k1", "k2", "k3", "k4", "k5", "k6"])?;
            let p = terms(&["p1", "p2"])?;
            Distortion::Rational {
                k: [k[0], k[1], k[2], k[3], k[4], k[5]],
                p: [p[0], p[1]],
            }
        };
        cameras.push(OpenCvCamera {
            name: prefix.trim_end_matches('.').to_owned(),
            lens: Lens::new(DVec2::new(fx, fy), DVec2::new(cx, cy) + 0.5, distortion),
            size: size(values, prefix)?,
        });
    }
    Ok(cameras)
}

/// The image size, the camera's own if it has one.
pub(super) fn size(values: &Values<'_>, prefix: &str) -> Result<Option<(u32, u32)>, OpenCvError> {
    let own = plain(prefix);
    let one = |name: &str| {
        let with_prefix = format!("{own}{name}");
        let found = values.find(&[with_prefix.as_str()]);
        let found = found.or_else(|| {
            let names = [
                format!("image{name}"),
                format!("img{name}"),
                format!("camera{name}"),
            ];
            let names: Vec<&str> = names.iter().map(String::as_str).chain([name]).collect();
            values.find(&names)
        });
        found.filter(|named| named.node.number().is_some())
    };
    let pixels = |named: &Named<'_>, n: f64| {
        // No picture is larger than this.
        if (1.0..=1e6).contains(&n) && n.fract() == 0.0 {
            return Ok(n as u32);
        }
        let problem = format!("the image size is {n}, expected a whole number of pixels");
        Err(values.refuse(named, problem))
    };
    if let (Some(width), Some(height)) = (one("width"), one("height")) {
        let of = |named: &Named<'_>| pixels(named, named.node.number().unwrap_or(0.0));
        return Ok(Some((of(width)?, of(height)?)));
    }
    // What else has a size, such as a board, lies in a map of its own.
    const OF_IMAGE: [&str; 4] = ["imagesize", "imgsize", "calibimagesize", "framesize"];
    const OF_ANYTHING: [&str; 2] = ["resolution", "size"];
    let near = around(prefix).find_map(|map| {
        let of_image = values.find_in(map, &OF_IMAGE);
        of_image.or_else(|| values.find_in(map, &OF_ANYTHING))
    });
    let Some(named) = near.or_else(|| values.find_for(prefix, &OF_IMAGE)) else {
        return Ok(None);
    };
    match named.node.matrix().map(|m| m.data).as_deref() {
        Some(&[width, height]) => Ok(Some((pixels(named, width)?, pixels(named, height)?))),
        _ => Ok(None),
    }
}
