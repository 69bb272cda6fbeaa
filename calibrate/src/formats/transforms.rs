//! `transforms.json`, as instant-ngp's `colmap2nerf.py` and nerfstudio write it.
//!
//! - Poses are `transform_matrix`, camera to world, in OpenGL's axes: x right, y up, z
//!   back. The world is the file's own: `applied_transform` and `applied_scale` say what
//!   was done to the poses that are in the file, so they are not applied again.
//! - Pixels are COLMAP's, as ours: both programs copy `cx` and `cy` from it and send the
//!   ray of the first pixel through (0.5, 0.5). Without them the centre is w/2, h/2.
//! - Focal lengths are `fl_x`, `fl_y` in pixels, else `x_fov`, `y_fov` in degrees, else
//!   `camera_angle_x`, `camera_angle_y` in radians. What a frame says goes before what is
//!   said for all; each may say one of the two axes. With only one of the two axes, or one here
//!   before both for all, pixels are square.
//! - Numbers that are no pixels but shares of the sides, as some scripts write them, are refused: which
//!   they are shares of differs.
//! - Distortion is OpenCV's; with `camera_model` OPENCV_FISHEYE or `is_fisheye` its
//!   fisheye's. nerfstudio's r⁸ term of a lens that is no fisheye (`k4`) must be zero, and so
//!   must `k5` and `k6` of all but FULL_OPENCV. `distortion_params`, a list of nerfstudio's in
//!   the order k1 k2 k3 k4 p1 p2, goes before the single coefficients beside it.
//! - With EQUIRECTANGULAR a photo goes all round, azimuth across and elevation down, its middle ahead; what
//!   nerfstudio has for focal lengths is then half the width, and the height.

use super::build::{self, Builder, SizeOf};
use super::error::{FormatError, Problem};
use super::json::{self, Json};
use crate::{Camera, ImageId, ModelKind, Reconstruction};
use glam::{DMat3, DVec3};
use std::path::Path;

/// Lenses of instant-ngp that no model here can represent.
const FOREIGN_LENSES: [&str; 4] = ["ftheta_p0", "latlong", "equirectangular", "rolling_shutter"];
/// nerfstudio's name for photos that go all round.
const PANORAMA: &str = "EQUIRECTANGULAR";
/// So many pixels may a panorama's numbers lie beside those of one that goes all round.
const MOST_BESIDE: f64 = 1.0;
const COEFFICIENTS: [&str; 8] = ["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"];

/// A principal point of so few pixels in both coordinates is in the photo's corner, or no pixels at all.
const MOST_OF_SHARES: f64 = 1.0;
/// And so is a focal length of so few pixels and of so small a share of its side, a field of view of 169°: shares
/// of long lenses are no more.
const MOST_OF_FOCAL_SHARES: f64 = 3.0;
const LEAST_FOCAL: f64 = 0.05;

/// Reads a `transforms.json`. Images are numbered from 1 in the order of `frames`; their
/// names are as in the file (`./` left out), which may lack the photo's extension.
/// `size_of` is asked where the file does not say `w` and `h`.
///
/// # Errors
/// An unreadable file, a pose that is no rotation, intrinsics that are missing,
/// impossible or of a lens that is not read here, two frames of one name.
pub fn read_transforms(path: &Path, size_of: SizeOf<'_>) -> Result<Reconstruction, FormatError> {
    parse_transforms(path, &build::read(path)?, size_of)
}

/// Reads the content of a file; `path` is only named in errors.
///
/// # Errors
/// As for [`read_transforms`].
pub fn parse_transforms(
    path: &Path,
    bytes: &[u8],
    size_of: SizeOf<'_>,
) -> Result<Reconstruction, FormatError> {
    let value = json::parse(path, bytes)?;
    let root = Json::root(path, &value);
    let mut builder = Builder::new(path);
    for (index, frame) in root.field("frames")?.items()?.enumerate() {
        let file_path = frame.field("file_path")?;
        let name = build::name(file_path.text()?).map_err(|p| file_path.error(p))?;
        let frame = frame.called(&name);

        let matrix = frame.field("transform_matrix")?;
        let (world_from_camera, center) = camera_to_world(&matrix)?;
        let pose = build::pose(world_from_camera, center).map_err(|p| matrix.error(p))?;

        let camera = Intrinsics {
            frame: &frame,
            root: &root,
        }
        .camera(|| build::size(size_of, &name))?;
        let camera_id = builder.camera(&frame.record, camera)?;
        let id = ImageId(index as u32 + 1);
        builder.image(&frame.record, id, &name, camera_id, pose)?;
    }
    builder.finish("frames")
}

/// The camera's axes (right, down, forward) and centre in the world.
fn camera_to_world(matrix: &Json<'_>) -> Result<(DMat3, DVec3), FormatError> {
    let rows: Vec<_> = matrix.items()?.collect();
    if !(3..=4).contains(&rows.len()) {
        return Err(matrix.error(Problem::broken(format!(
            "found {} rows, expected 4 of 4 numbers",
            rows.len()
        ))));
    }
    let mut m = [[0.0; 4]; 3];
    for (numbers, row) in m.iter_mut().zip(&rows) {
        *numbers = row.numbers()?;
    }
    if let Some(last) = rows.get(3)
        && last.numbers()? != [0.0, 0.0, 0.0, 1.0]
    {
        return Err(last.error(Problem::broken(format!(
            "found {:?} as last row, expected [0, 0, 0, 1]",
            last.numbers::<4>()?
        ))));
    }
    let column = |j: usize| DVec3::new(m[0][j], m[1][j], m[2][j]);
    // OpenGL's y is up and its z back.
    let axes = DMat3::from_cols(column(0), -column(1), -column(2));
    Ok((axes, column(3)))
}

/// A frame's own intrinsics, and those said for all frames.
struct Intrinsics<'a> {
    frame: &'a Json<'a>,
    root: &'a Json<'a>,
}

impl<'a> Intrinsics<'a> {
    fn get(&self, key: &str) -> Option<Json<'a>> {
        self.frame.optional(key).or_else(|| self.root.optional(key))
    }

    fn number_or(&self, key: &str, default: f64) -> Result<f64, FormatError> {
        self.get(key).map_or(Ok(default), |json| json.number())
    }

    fn camera(
        &self,
        size: impl FnOnce() -> Result<(u32, u32), Problem>,
    ) -> Result<Camera, FormatError> {
        for key in FOREIGN_LENSES {
            if let Some(json) = self.get(key)
                && !is_nothing(&json)
            {
                return Err(json.error(Problem::new(
                    "found a lens or shutter that is not read here, expected OpenCV's models",
                    "undistort the photos and export them as PINHOLE",
                )));
            }
        }
        let (width, height) = match (self.get("w"), self.get("h")) {
            (Some(w), Some(h)) => (w.whole()?, h.whole()?),
            _ => size().map_err(|problem| self.frame.error(problem))?,
        };
        if self.model()? == Some(PANORAMA) {
            return self.panorama(width, height);
        }
        let (fx, fy) = self.focals(width, height)?;
        let cx = self.number_or("cx", f64::from(width) / 2.0)?;
        let cy = self.number_or("cy", f64::from(height) / 2.0)?;
        self.check_principal(cx, cy, (width, height))?;
        let (model, distortion) = self.lens()?;
        let mut params = vec![fx, fy, cx, cy];
        params.extend(distortion);
        Ok(Camera {
            model,
            width,
            height,
            params,
        })
    }

    /// What the file calls the lens.
    fn model(&self) -> Result<Option<&'a str>, FormatError> {
        let named = self.get("camera_model");
        named.map(|json| json.text()).transpose()
    }

    /// The camera of a panorama, which goes all round.
    fn panorama(&self, width: u32, height: u32) -> Result<Camera, FormatError> {
        let (w, h) = (f64::from(width), f64::from(height));
        for (key, expected) in [
            ("fl_x", 0.5 * w),
            ("fl_y", h),
            ("cx", 0.5 * w),
            ("cy", 0.5 * h),
        ] {
            let Some(json) = self.get(key) else {
                continue;
            };
            let found = json.number()?;
            if (found - expected).abs() > MOST_BESIDE {
                let problem = format!(
                    "found {found}, expected {expected}: a panorama of {width} × {height} pixels that goes all round"
                );
                let remedy =
                    "remove the key if it does, or cut it into views and export these as PINHOLE";
                return Err(json.error(Problem::new(problem, remedy)));
            }
        }
        let mut coefficients = COEFFICIENTS.iter().zip(self.coefficients()?);
        if let Some((key, value)) = coefficients.find(|(_, value)| *value != 0.0) {
            let problem = format!("found {PANORAMA} with {key} = {value}, which a panorama lacks");
            return Err(self
                .frame
                .error(Problem::new(problem, "remove the coefficients")));
        }
        Ok(Camera {
            model: ModelKind::Equirectangular,
            width,
            height,
            params: vec![w, h],
        })
    }

    /// Fails of a principal point that is no pixels.
    fn check_principal(&self, cx: f64, cy: f64, (w, h): (u32, u32)) -> Result<(), FormatError> {
        let is_share = |c: f64| c > 0.0 && c <= MOST_OF_SHARES;
        let Some(json) = self.get("cx").or_else(|| self.get("cy")) else {
            return Ok(());
        };
        if w.min(h) <= 2 || !(is_share(cx) && is_share(cy)) {
            return Ok(());
        }
        let problem = format!("cx is {cx} and cy is {cy}, expected pixels of {w} × {h}");
        Err(json.error(Problem::new(problem, PIXELS)))
    }

    /// The focal lengths in pixels along x and y.
    fn focals(&self, width: u32, height: u32) -> Result<(f64, f64), FormatError> {
        let at = |level: &Json<'_>| -> Result<(Option<f64>, Option<f64>), FormatError> {
            Ok((focal(level, "x", width)?, focal(level, "y", height)?))
        };
        let own = at(self.frame)?;
        if let (Some(x), Some(y)) = own {
            return Ok((x, y));
        }
        let (x, y) = match (own, at(self.root)?) {
            // One axis here, the other for all frames.
            ((Some(x), None), (None, Some(y))) | ((None, Some(y)), (Some(x), None)) => {
                (Some(x), Some(y))
            }
            ((None, None), shared) => shared,
            // Both for all frames, and a focal length here that goes before them.
            _ => own,
        };
        if let Some(known) = x.or(y) {
            return Ok((x.unwrap_or(known), y.unwrap_or(known)));
        }
        Err(self.frame.error(Problem::new(
            "there is no focal length, neither here nor for all frames",
            "add fl_x and fl_y in pixels, or camera_angle_x in radians",
        )))
    }

    /// The model and the parameters that follow the focal lengths and the centre.
    fn lens(&self) -> Result<(ModelKind, Vec<f64>), FormatError> {
        let c = self.coefficients()?;
        let [k1, k2, p1, p2, k3, k4, k5, k6] = c;
        let nonzero = COEFFICIENTS.iter().zip(c).find(|(_, value)| *value != 0.0);
        let named = self.get("camera_model");
        let name = named.as_ref().map(|json| json.text()).transpose()?;
        let is_fisheye = self.get("is_fisheye").map_or(Ok(false), |f| f.flag())?;
        let undistort = "undistort the photos and export them as PINHOLE";
        let refuse = |problem: String, remedy: &str| {
            let place = named.as_ref().unwrap_or(self.frame);
            Err(place.error(Problem::new(problem, remedy)))
        };
        match name {
            _ if is_fisheye => {}
            None | Some("OPENCV" | "FULL_OPENCV" | "SIMPLE_RADIAL" | "RADIAL") => {
                if name == Some("FULL_OPENCV") && c[5..] != [0.0; 3] {
                    return Ok((ModelKind::FullOpenCv, c.to_vec()));
                }
                if [k5, k6] != [0.0; 2] {
                    return refuse(
                        format!("k5 is {k5} and k6 is {k6}, which FULL_OPENCV alone has"),
                        "set camera_model to FULL_OPENCV if it is one, or undistort the photos",
                    );
                }
                if k4 != 0.0 {
                    return refuse(
                        format!(
                            "k4 is {k4}, an r⁸ term (or a fisheye's), which OpenCV's model lacks"
                        ),
                        "set camera_model to OPENCV_FISHEYE if it is one, or undistort the photos",
                    );
                }
                return Ok(if nonzero.is_none() {
                    (ModelKind::Pinhole, Vec::new())
                } else if k3 == 0.0 {
                    (ModelKind::OpenCv, vec![k1, k2, p1, p2])
                } else {
                    (
                        ModelKind::FullOpenCv,
                        vec![k1, k2, p1, p2, k3, 0.0, 0.0, 0.0],
                    )
                });
            }
            Some(pinhole @ ("PINHOLE" | "SIMPLE_PINHOLE")) => {
                return match nonzero {
                    None => Ok((ModelKind::Pinhole, Vec::new())),
                    Some((key, value)) => refuse(
                        format!("found {pinhole} with {key} = {value}, which a pinhole lacks"),
                        "set camera_model to OPENCV, or remove the coefficients",
                    ),
                };
            }
            Some("OPENCV_FISHEYE") => {}
            Some(other) => {
                return refuse(
                    format!(
                        "found the camera model {other:?}, expected PINHOLE, OPENCV, \
                         OPENCV_FISHEYE or {PANORAMA}"
                    ),
                    undistort,
                );
            }
        }
        if p1 != 0.0 || p2 != 0.0 {
            return refuse(
                format!("found a fisheye with p1 = {p1} and p2 = {p2}, expected none"),
                undistort,
            );
        }
        if [k5, k6] != [0.0; 2] {
            return refuse(
                format!("found a fisheye with k5 = {k5} and k6 = {k6}, expected none"),
                undistort,
            );
        }
        Ok((ModelKind::OpenCvFisheye, vec![k1, k2, k3, k4]))
    }

    /// The coefficients, in the order of [`COEFFICIENTS`]; zero where nothing is said.
    fn coefficients(&self) -> Result<[f64; 8], FormatError> {
        for level in [self.frame, self.root] {
            if let Some(list) = level.optional("distortion_params") {
                let [k1, k2, k3, k4, p1, p2] = list.numbers()?;
                return Ok([k1, k2, p1, p2, k3, k4, 0.0, 0.0]);
            }
            // A frame's own go before a list for all.
            if COEFFICIENTS.iter().any(|key| level.optional(key).is_some()) {
                break;
            }
        }
        let mut c = [0.0; 8];
        for (value, key) in c.iter_mut().zip(COEFFICIENTS) {
            *value = self.number_or(key, 0.0)?;
        }
        Ok(c)
    }
}

/// What to do about intrinsics that are no pixels.
const PIXELS: &str = "if these are shares of the photo's sides, multiply cx and fl_x by the width and cy and fl_y by \
                      the height";

/// A focal length in pixels along an axis, where a level says it.
fn focal(level: &Json<'_>, axis: &str, resolution: u32) -> Result<Option<f64>, FormatError> {
    if let Some(json) = level.optional(&format!("fl_{axis}")) {
        let focal = json.number()?;
        let side = f64::from(resolution);
        if focal > 0.0 && focal <= MOST_OF_FOCAL_SHARES && focal < LEAST_FOCAL * side {
            let problem = format!("found {focal}, expected pixels of {resolution}");
            return Err(json.error(Problem::new(problem, PIXELS)));
        }
        return Ok(Some(focal));
    }
    let degrees = level.optional(&format!("{axis}_fov"));
    let (json, angle) = match (degrees, level.optional(&format!("camera_angle_{axis}"))) {
        (Some(json), _) => (json.clone(), json.number()?.to_radians()),
        (None, Some(json)) => (json.clone(), json.number()?),
        (None, None) => return Ok(None),
    };
    if !(angle > 0.0 && angle < std::f64::consts::PI) {
        return Err(json.error(Problem::broken(format!(
            "the field of view is {angle} radians, expected more than 0 and less than π"
        ))));
    }
    Ok(Some(0.5 * f64::from(resolution) / (0.5 * angle).tan()))
}

/// Whether a key that asks for something special asks for nothing: false, or all zeros.
fn is_nothing(json: &Json<'_>) -> bool {
    match json.items() {
        Ok(items) => items.into_iter().all(|item| is_nothing(&item)),
        Err(_) => matches!(json.flag(), Ok(false)),
    }
}
