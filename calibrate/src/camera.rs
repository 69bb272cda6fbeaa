use crate::{Distortion, Lens};
use glam::DVec2;
use std::f64::consts::{FRAC_PI_2, PI};

/// The id of a camera in a reconstruction: sparse, chosen by whoever made it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct CameraId(pub u32);

impl From<CameraId> for u64 {
    fn from(id: CameraId) -> u64 {
        id.0.into()
    }
}

/// A camera as calibration files store it: a named model and its parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Which formula.
    pub model: ModelKind,
    /// Image width in pixels.
    pub width: u32,
    /// Image height in pixels.
    pub height: u32,
    /// In the order of [`ModelKind::parameter_names`].
    pub params: Vec<f64>,
}

/// What makes a camera unusable.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CameraError {
    /// The number of parameters does not fit the model.
    #[error("{} has {} parameters ({}), found {found}",
        model.name(), model.parameter_names().len(), model.parameter_names().join(", "))]
    ParameterCount {
        /// The model.
        model: ModelKind,
        /// How many were given.
        found: usize,
    },
    /// A parameter is NaN or infinite.
    #[error("parameter {name} of {} is {value}, not a finite number", model.name())]
    NotFinite {
        /// The model.
        model: ModelKind,
        /// Which parameter.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// A focal length is zero or negative.
    #[error("focal length {name} of {} is {value}; it must be positive", model.name())]
    Focal {
        /// The model.
        model: ModelKind,
        /// Which parameter.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// A parameter lies outside what its formula allows.
    #[error("parameter {name} of {} is {value}; it must be {expected}", model.name())]
    Range {
        /// The model.
        model: ModelKind,
        /// Which parameter.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What it must be, in words.
        expected: &'static str,
    },
    /// The image has no pixels.
    #[error("the image size is {width} × {height}")]
    Size {
        /// Pixels.
        width: u32,
        /// Pixels.
        height: u32,
    },
}

macro_rules! models {
    ($($variant:ident $id:expr, $name:literal [$($param:literal),*] $doc:literal;)*) => {
        /// COLMAP's camera models, by COLMAP's own names, ids and parameter orders, and three
        /// that COLMAP lacks, by names of ours.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum ModelKind { $(#[doc = $doc] $variant,)* }

        impl ModelKind {
            /// Every model this version reads.
            pub const ALL: &[Self] = &[$(Self::$variant,)*];

            /// COLMAP's numeric id; none for a model that COLMAP lacks.
            pub fn colmap_id(self) -> Option<i32> {
                match self { $(Self::$variant => $id,)* }
            }

            /// COLMAP's name, or ours.
            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => $name,)* }
            }

            /// The parameters' names, in order.
            pub fn parameter_names(self) -> &'static [&'static str] {
                match self { $(Self::$variant => &[$($param),*],)* }
            }
        }
    };
}

models! {
    SimplePinhole Some(0), "SIMPLE_PINHOLE" ["f", "cx", "cy"] "One focal length, no distortion.";
    Pinhole Some(1), "PINHOLE" ["fx", "fy", "cx", "cy"] "Two focal lengths, no distortion.";
    SimpleRadial Some(2), "SIMPLE_RADIAL" ["f", "cx", "cy", "k"] "One radial term.";
    Radial Some(3), "RADIAL" ["f", "cx", "cy", "k1", "k2"] "Two radial terms.";
    OpenCv Some(4), "OPENCV" ["fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"]
        "Two radial and two tangential terms.";
    OpenCvFisheye Some(5), "OPENCV_FISHEYE" ["fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"]
        "Equidistant with a polynomial in the angle.";
    FullOpenCv Some(6), "FULL_OPENCV"
        ["fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"]
        "A rational radial term and two tangential ones.";
    Fov Some(7), "FOV" ["fx", "fy", "cx", "cy", "omega"] "The field-of-view model.";
    SimpleRadialFisheye Some(8), "SIMPLE_RADIAL_FISHEYE" ["f", "cx", "cy", "k"]
        "Equidistant with one radial term.";
    RadialFisheye Some(9), "RADIAL_FISHEYE" ["f", "cx", "cy", "k1", "k2"]
        "Equidistant with two radial terms.";
    ThinPrismFisheye Some(10), "THIN_PRISM_FISHEYE"
        ["fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "sx1", "sy1"]
        "Equidistant with radial, tangential and thin-prism terms.";
    RadTanThinPrismFisheye Some(11), "RAD_TAN_THIN_PRISM_FISHEYE"
        ["fx", "fy", "cx", "cy", "k0", "k1", "k2", "k3", "k4", "k5", "p0", "p1",
            "s0", "s1", "s2", "s3"]
        "Equidistant with radial terms, then tangential and thin-prism ones.";
    SimpleDivision Some(12), "SIMPLE_DIVISION" ["f", "cx", "cy", "k"]
        "The division model with one focal length.";
    Division Some(13), "DIVISION" ["fx", "fy", "cx", "cy", "k"]
        "The division model with two focal lengths.";
    SimpleFisheye Some(14), "SIMPLE_FISHEYE" ["f", "cx", "cy"] "Equidistant with one focal length.";
    Fisheye Some(15), "FISHEYE" ["fx", "fy", "cx", "cy"] "Equidistant with two focal lengths.";
    Eucm Some(16), "EUCM" ["fx", "fy", "cx", "cy", "alpha", "beta"]
        "The enhanced unified camera model.";
    Equirectangular Some(17), "EQUIRECTANGULAR" ["w", "h"]
        "All round, by azimuth and elevation; the parameters are the image's size.";
    OpenCvTilted None, "OPENCV_TILTED"
        ["fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6",
            "s1", "s2", "s3", "s4", "tauX", "tauY"]
        "OpenCV's thin prisms and tilted sensor.";
    OpenCvSkewedFisheye None, "OPENCV_SKEWED_FISHEYE"
        ["fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4", "skew"]
        "OpenCV's fisheye with skew.";
    InverseRadial None, "INVERSE_RADIAL" ["fx", "fy", "cx", "cy", "k"]
        "One radial term that straightens: VisualSFM's model.";
}

impl ModelKind {
    /// The model with COLMAP's numeric id, if this version reads it.
    pub fn from_colmap_id(id: i32) -> Option<Self> {
        Self::ALL
            .iter()
            .copied()
            .find(|model| model.colmap_id() == Some(id))
    }

    /// The model of a name, if this version reads it.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|model| model.name() == name)
    }
}

impl Camera {
    /// A lens as a camera of the simplest model with two focal lengths that holds it, COLMAP's
    /// where there is one. [`Camera::lens`] gives the same lens back.
    pub fn of(lens: &Lens, width: u32, height: u32) -> Self {
        let (f, c) = (lens.focal, lens.principal);
        let (model, own): (_, Vec<f64>) = match lens.distortion() {
            Distortion::None => (ModelKind::Pinhole, Vec::new()),
            Distortion::Rational { k, p } if k[2..] == [0.0; 4] => {
                (ModelKind::OpenCv, vec![k[0], k[1], p[0], p[1]])
            }
            Distortion::Rational { k, p } => (ModelKind::FullOpenCv, in_opencvs_order(k, p)),
            Distortion::Tilted { k, p, s, tau } => {
                let own = [&in_opencvs_order(k, p)[..], &s, &tau].concat();
                (ModelKind::OpenCvTilted, own)
            }
            Distortion::Fisheye { k } => (ModelKind::OpenCvFisheye, k.to_vec()),
            Distortion::SkewedFisheye { k, alpha } => {
                (ModelKind::OpenCvSkewedFisheye, [&k[..], &[alpha]].concat())
            }
            Distortion::ThinPrismFisheye { k, p, s } => {
                let own = [&k[..2], &p, &k[2..], &s].concat();
                (ModelKind::ThinPrismFisheye, own)
            }
            Distortion::RadTanThinPrismFisheye { k, p, s } => {
                let own = [&k[..], &p, &s].concat();
                (ModelKind::RadTanThinPrismFisheye, own)
            }
            Distortion::Fov { omega } => (ModelKind::Fov, vec![omega]),
            Distortion::Division { k } => (ModelKind::Division, vec![k]),
            Distortion::InverseRadial { k } => (ModelKind::InverseRadial, vec![k]),
            Distortion::Eucm { alpha, beta } => (ModelKind::Eucm, vec![alpha, beta]),
            Distortion::Equirectangular => (ModelKind::Equirectangular, Vec::new()),
        };
        let common = match model {
            ModelKind::Equirectangular => vec![2.0 * c.x, 2.0 * c.y],
            _ => vec![f.x, f.y, c.x, c.y],
        };
        Self {
            model,
            width,
            height,
            params: [common, own].concat(),
        }
    }

    /// Checks the parameters and returns the lens they describe.
    ///
    /// # Errors
    /// A wrong number of parameters, one that is not finite or not in its range, a focal
    /// length that is not positive, or an empty image.
    pub fn lens(&self) -> Result<Lens, CameraError> {
        let (model, p) = (self.model, &self.params);
        let names = model.parameter_names();
        if p.len() != names.len() {
            return Err(CameraError::ParameterCount {
                model,
                found: p.len(),
            });
        }
        for (&value, &name) in p.iter().zip(names) {
            if !value.is_finite() {
                return Err(CameraError::NotFinite { model, name, value });
            }
            if name.starts_with('f') && value <= 0.0 {
                return Err(CameraError::Focal { model, name, value });
            }
            if let Some(expected) = violated_range(name, value) {
                return Err(CameraError::Range {
                    model,
                    name,
                    value,
                    expected,
                });
            }
        }
        if self.width == 0 || self.height == 0 {
            return Err(CameraError::Size {
                width: self.width,
                height: self.height,
            });
        }
        let one_focal =
            |distortion| Lens::new(DVec2::splat(p[0]), DVec2::new(p[1], p[2]), distortion);
        let two_focals =
            |distortion| Lens::new(DVec2::new(p[0], p[1]), DVec2::new(p[2], p[3]), distortion);
        let radial = |k1, k2| Distortion::Rational {
            k: [k1, k2, 0.0, 0.0, 0.0, 0.0],
            p: [0.0; 2],
        };
        let fisheye = |k| Distortion::Fisheye { k };
        Ok(match model {
            ModelKind::SimplePinhole => one_focal(Distortion::None),
            ModelKind::Pinhole => two_focals(Distortion::None),
            ModelKind::SimpleRadial => one_focal(radial(p[3], 0.0)),
            ModelKind::Radial => one_focal(radial(p[3], p[4])),
            ModelKind::OpenCv => two_focals(Distortion::Rational {
                k: [p[4], p[5], 0.0, 0.0, 0.0, 0.0],
                p: [p[6], p[7]],
            }),
            ModelKind::OpenCvFisheye => two_focals(fisheye([p[4], p[5], p[6], p[7]])),
            ModelKind::FullOpenCv => two_focals(Distortion::Rational {
                k: [p[4], p[5], p[8], p[9], p[10], p[11]],
                p: [p[6], p[7]],
            }),
            ModelKind::Fov => two_focals(Distortion::Fov { omega: p[4] }),
            ModelKind::SimpleRadialFisheye => one_focal(fisheye([p[3], 0.0, 0.0, 0.0])),
            ModelKind::RadialFisheye => one_focal(fisheye([p[3], p[4], 0.0, 0.0])),
            ModelKind::ThinPrismFisheye => two_focals(Distortion::ThinPrismFisheye {
                k: [p[4], p[5], p[8], p[9]],
                p: [p[6], p[7]],
                s: [p[10], p[11]],
            }),
            ModelKind::RadTanThinPrismFisheye => two_focals(Distortion::RadTanThinPrismFisheye {
                k: [p[4], p[5], p[6], p[7], p[8], p[9]],
                p: [p[10], p[11]],
                s: [p[12], p[13], p[14], p[15]],
            }),
            ModelKind::SimpleDivision => one_focal(Distortion::Division { k: p[3] }),
            ModelKind::Division => two_focals(Distortion::Division { k: p[4] }),
            ModelKind::SimpleFisheye => one_focal(fisheye([0.0; 4])),
            ModelKind::Fisheye => two_focals(fisheye([0.0; 4])),
            ModelKind::OpenCvTilted => two_focals(Distortion::Tilted {
                k: [p[4], p[5], p[8], p[9], p[10], p[11]],
                p: [p[6], p[7]],
                s: [p[12], p[13], p[14], p[15]],
                tau: [p[16], p[17]],
            }),
            ModelKind::OpenCvSkewedFisheye => two_focals(Distortion::SkewedFisheye {
                k: [p[4], p[5], p[6], p[7]],
                alpha: p[8],
            }),
            ModelKind::InverseRadial => two_focals(Distortion::InverseRadial { k: p[4] }),
            ModelKind::Eucm => two_focals(Distortion::Eucm {
                alpha: p[4],
                beta: p[5],
            }),
            // Azimuth runs from −π to π over the width, elevation from −π/2 to π/2 over
            // the height.
            ModelKind::Equirectangular => Lens::new(
                DVec2::new(0.5 * p[0], p[1]) / PI,
                DVec2::new(0.5 * p[0], 0.5 * p[1]),
                Distortion::Equirectangular,
            ),
        })
    }
}

/// k₁ k₂ p₁ p₂ k₃ k₄ k₅ k₆.
fn in_opencvs_order(k: [f64; 6], p: [f64; 2]) -> Vec<f64> {
    [&k[..2], &p, &k[2..]].concat()
}

/// What a parameter must be, if its value is something else. Names mean the same in every
/// model that has them.
fn violated_range(name: &str, value: f64) -> Option<&'static str> {
    let (holds, expected) = match name {
        "omega" => (value.abs() < PI, "an angle in radians between −π and π"),
        "tauX" | "tauY" => (
            value.abs() < FRAC_PI_2,
            "an angle in radians between −π/2 and π/2",
        ),
        "alpha" => ((0.0..=1.0).contains(&value), "between 0 and 1"),
        "beta" => (value > 0.0, "positive"),
        "w" | "h" => (value > 0.0, "the image's size, which is positive"),
        _ => (true, ""),
    };
    (!holds).then_some(expected)
}
