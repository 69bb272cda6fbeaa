//! Cameras and image sizes that are written as plain numbers.

use super::OpenCvError;
use super::cameras::{Keys, OpenCvCamera, model_name};
use super::values::{Named, Values, plain};
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
        let own = plain(named.last());
        if !(own == "fx" || own == "mu") || named.node.number().is_none() {
            continue;
        }
        let prefix = named.prefix();
        let number = |prefix: &str, names: &[&str]| {
            let path = |name: &&str| values.exactly(&format!("{prefix}{name}"));
            names.iter().find_map(path).and_then(|v| v.node.number())
        };
        let kannala = own == "mu";
        let all = [
            number(prefix, &["fx", "mu"]),
            number(prefix, &["fy", "mv"]),
            number(prefix, &["cx", "u0"]),
            number(prefix, &["cy", "v0"]),
        ];
        let [Some(fx), Some(fy), Some(cx), Some(cy)] = all else {
            continue;
        };
        if !(fx > 0.0 && fy > 0.0 && fx.is_finite() && fy.is_finite()) {
            let problem = format!("the focal lengths are {fx} and {fy}, expected positive numbers");
            return Err(values.refuse(named, problem));
        }
        let of = prefix.replace("projection_parameters", "distortion_parameters");
        let terms = |names: &[&str]| -> Vec<f64> {
            let term = |name: &&str| number(&of, &[*name]).unwrap_or(0.0);
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
            let k = terms(&names);
            Distortion::Fisheye {
                k: [k[0], k[1], k[2], k[3]],
            }
        } else {
            let k = terms(&["k1", "k2", "k3", "k4", "k5", "k6"]);
            let p = terms(&["p1", "p2"]);
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
    let names = [
        "imagesize",
        "imgsize",
        "calibimagesize",
        "framesize",
        "resolution",
        "size",
    ];
    let Some(named) = values.find_for(prefix, &names) else {
        return Ok(None);
    };
    match named.node.matrix().map(|m| m.data).as_deref() {
        Some(&[width, height]) => Ok(Some((pixels(named, width)?, pixels(named, height)?))),
        _ => Ok(None),
    }
}
