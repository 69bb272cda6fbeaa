//! What is measured of a scene or an interior.

use super::times::Times;
use image::RgbaImage;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// How much is measured.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Effort {
    /// Every value of every knob, every kind of surface; else the most telling.
    pub(super) thorough: bool,
    /// Pixels along the longer side of the pictures.
    pub(super) long_side: u32,
    /// Held-out photos that are drawn, at most.
    pub(super) views: usize,
    /// Interleaved repeats, of which the median counts.
    pub(super) repeats: usize,
}

/// What became of a setting.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Measured {
    pub(super) name: String,
    pub(super) knob: String,
    pub(super) value: String,
    /// A frame's, photos decoded before: the median of the repeats' means over the views.
    pub(super) frame: Times,
    /// The least and the greatest repeat's CPU time, in milliseconds.
    pub(super) cpu_ms_range: [f64; 2],
    /// The first view's from photos on disk; of interiors with making its images, of photos that were decoded before.
    pub(super) first: Times,
    /// What the photos decoded, or of interiors images made, for that first view took, and their number.
    pub(super) image_bytes: u64,
    pub(super) images_made: usize,
    /// Against the photos held out, or the truth: means over the views.
    pub(super) psnr: f64,
    pub(super) ssim: f64,
    pub(super) coverage: f64,
    /// The share of pixels that nothing paints and something should; of interiors.
    pub(super) holes: Option<f64>,
    /// The root mean square difference from the same setting's exact picture, in steps of 255,
    /// and the same as PSNR; zero and [`PSNR_CAP_DB`] of the exact one.
    pub(super) steps_from_exact: f64,
    pub(super) psnr_to_exact: f64,
}

impl Measured {
    /// Takes the medians of repeats.
    pub(super) fn set_times(&mut self, repeats: &[Times]) {
        self.frame = Times::median(repeats);
        let cpu = repeats.iter().map(|t| t.cpu_ms);
        self.cpu_ms_range = [
            cpu.clone().fold(f64::INFINITY, f64::min),
            cpu.fold(0.0, f64::max),
        ];
    }

    pub(super) fn is_default(&self) -> bool {
        self.knob == "default"
    }
}

/// From the command to the first picture, in milliseconds of wall time.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct StartUp {
    /// Reading the calibration and finding the photos.
    pub(super) read_ms: f64,
    /// Matching exposures.
    pub(super) exposure_ms: f64,
    /// Fitting the default surface.
    pub(super) fit_ms: f64,
    /// Preparing the first frame: distance maps, surface and field.
    pub(super) prepare_ms: f64,
    /// Drawing it, with decoding its photos.
    pub(super) draw_ms: f64,
    /// Of that, the floor: decoding the photos that it uses, once, on all threads.
    pub(super) decode_ms: f64,
    pub(super) photos_used: usize,
}

/// What leaving one thing out is worth, for the first view.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Skip {
    /// As `--no-skip` has it.
    pub(super) name: String,
    /// What was left out, for people; `None` where there was nothing to leave out.
    pub(super) fired: Option<String>,
    /// A picture's, with and without.
    pub(super) with: Times,
    pub(super) without: Times,
    /// Whether the bytes are the same.
    pub(super) same_bytes: bool,
}

impl Skip {
    /// CPU time without it over that with it.
    pub(super) fn ratio(&self) -> f64 {
        self.without.cpu_ms / self.with.cpu_ms.max(1e-6)
    }
}

/// All that was measured of a scene or an interior.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Subject {
    pub(super) name: String,
    pub(super) is_interior: bool,
    /// What it is and what was drawn, for people.
    pub(super) about: String,
    pub(super) views: Vec<String>,
    pub(super) size: [u32; 2],
    pub(super) start_up: Option<StartUp>,
    pub(super) skips: Vec<Skip>,
    pub(super) settings: Vec<Measured>,
    /// Settings that could not be measured, and why.
    pub(super) failed: BTreeMap<String, String>,
}

impl Subject {
    pub(super) fn psnr_title(&self) -> &'static str {
        match self.is_interior {
            true => "PSNR against the model drawn whole, dB",
            false => "PSNR of held-out photos, dB",
        }
    }

    pub(super) fn steps_title(&self) -> &'static str {
        match self.is_interior {
            true => "difference from the model drawn whole, steps of 255 (rms)",
            false => "difference from the exact field, steps of 255 (rms)",
        }
    }
}

/// Pictures of a view for the report.
pub(super) struct Pictures {
    pub(super) truth: RgbaImage,
    /// By which setting, and what it drew.
    pub(super) setting: String,
    pub(super) drawn: RgbaImage,
    /// The exact one, where that is not the truth.
    pub(super) exact: Option<RgbaImage>,
}
