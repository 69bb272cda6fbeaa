/// How source views are weighted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldOptions {
    /// How many source views share a ray, roughly: Buehler's k. At least 1.
    pub k: usize,
    /// β/α: radians of angular difference that a doubling of the pixel footprint is worth. At most [`MAX_BETA`].
    pub beta: f64,
    /// The formula for the weights.
    pub blend: Blend,
    /// What a source view's lack of resolution is measured by.
    pub resolution: Resolution,
    /// The width over which a source view fades towards its border, as a fraction of the
    /// shorter side of its image.
    pub feather: f64,
}

/// At most this many source views contribute to a ray. Large k meet this limit, and weights
/// jump there: by up to 9 % at k = 16, not at all at k = 5.
pub const MAX_CONTRIBUTORS: usize = 16;

/// β/α is no more than this, which is far beyond what makes any difference: engines multiply it in 32 bits with
/// differences of resolution, which are lengths in world units with [`Resolution::Length`], and of what is not finite no
/// weights follow.
pub const MAX_BETA: f64 = 1e6;

impl Default for FieldOptions {
    fn default() -> Self {
        Self {
            k: 5,
            beta: 0.1,
            blend: Blend::Consistent,
            resolution: Resolution::Footprint,
            feather: 0.02,
        }
    }
}

impl FieldOptions {
    /// m of the consistent blend: the sum of relevance that fixes the threshold.
    pub fn full_weight(&self) -> f64 {
        self.k as f64 / 3.0
    }

    /// Whether of so many source views one alone paints each ray, so that colours jump where another does: Buehler's
    /// t is that of the second view at most, which leaves it no weight.
    pub(crate) fn is_of_one(&self, views: usize) -> bool {
        self.blend == Blend::Paper && views > 1 && self.k.min(views) <= 2
    }

    /// Whether every number makes sense.
    ///
    /// # Errors
    /// A sentence that names the option, its value and its range.
    pub fn check(&self) -> Result<(), String> {
        if !(1..=MAX_CONTRIBUTORS).contains(&self.k) {
            return Err(format!(
                "k is {}; it must lie in 1..={MAX_CONTRIBUTORS}",
                self.k
            ));
        }
        if !(self.beta >= 0.0 && self.beta <= MAX_BETA) {
            return Err(format!(
                "beta is {}; it must be zero or more, up to {MAX_BETA:e}",
                self.beta
            ));
        }
        if !(self.feather >= 0.0 && self.feather <= 0.5) {
            return Err(format!(
                "feather is {}; it must lie in 0..=0.5",
                self.feather
            ));
        }
        Ok(())
    }

    /// What of these and of a method is not the default, as the command line spells it:
    /// `--k 11 --grid 64`; empty where all is.
    pub fn spelled(&self, method: Method) -> String {
        let default = Self::default();
        let mut words = Vec::new();
        if self.k != default.k {
            words.push(format!("--k {}", self.k));
        }
        if self.beta != default.beta {
            words.push(format!("--beta {}", self.beta));
        }
        words.extend(match self.blend {
            Blend::Consistent => None,
            Blend::Paper => Some("--blend paper".to_owned()),
        });
        words.extend(match self.resolution {
            Resolution::Footprint => None,
            Resolution::Distance => Some("--resolution distance".to_owned()),
            Resolution::Length => Some("--resolution length".to_owned()),
        });
        words.extend(match method {
            Method::Exact => Some("--renderer exact".to_owned()),
            Method::TRIANGULATED => None,
            Method::Triangulated { cells_across } => Some(format!("--grid {cells_across}")),
        });
        words.join(" ")
    }
}

/// The formula for the weights.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Blend {
    /// aᵢ · max(0, 1 − diffᵢ/t) / diffᵢ with t such that Σ aᵢ · max(0, 1 − diffᵢ/t) = k/3:
    /// exact at a source view's own centre, and continuous where views come and go.
    Consistent,
    /// Buehler 2001, §4.1, literally: aᵢ · max(0, 1 − diffᵢ/t), t the k-th smallest diff.
    Paper,
}

/// What a source view's lack of resolution is measured by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Resolution {
    /// The ratio of pixel footprints on the proxy, less one, or 0 where that is less. With equal focal lengths it
    /// is [`Self::Distance`]. The desired view's focal length counts up to the longest of the source views'.
    Footprint,
    /// max(0, |p − c|/|p − d| − 1).
    Distance,
    /// max(0, |p − c| − |p − d|) in world units: Buehler 2001, §4.1, literally.
    Length,
}

/// What is left out where a frame does not need it. Pictures are the same, with and without each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Skips {
    /// Only views that can count are asked about a ray.
    pub views: bool,
    /// On the CPU, lenses without distortion take no more than a division.
    pub lenses: bool,
}

impl Skips {
    /// Whatever can be left out.
    pub const ALL: Self = Self {
        views: true,
        lenses: true,
    };
    /// Nothing.
    pub const NONE: Self = Self {
        views: false,
        lenses: false,
    };
}

/// How the blending field is evaluated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// At every pixel.
    Exact,
    /// At the vertices of a triangulation of the image plane, and interpolated
    /// (Buehler 2001, §4.2).
    Triangulated {
        /// Cells of the regular grid across the image's width; down it, as many as make them about square.
        cells_across: u32,
    },
}

impl Method {
    /// The triangulated field at the default grid.
    pub const TRIANGULATED: Self = Self::Triangulated { cells_across: 32 };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn beta_is_what_32_bits_hold() {
        let check = |beta: f64| {
            let options = FieldOptions {
                beta,
                ..FieldOptions::default()
            };
            options.check()
        };
        for beta in [0.0, 0.1, MAX_BETA] {
            assert_eq!(check(beta), Ok(()));
        }
        for beta in [-0.1, 1.1e6, 1e39, f64::INFINITY, f64::NAN] {
            let problem = check(beta).unwrap_err();
            assert!(
                problem.ends_with("; it must be zero or more, up to 1e6"),
                "{problem}"
            );
        }
    }
}
