//! Videos whose colours are of a high dynamic range (HLG, PQ), brought to that of photos.
//!
//! ffmpeg applies a table of colours that is made here, so that any ffmpeg will do. A stored colour becomes the light that a
//! screen of 1,000 cd/m² shows of it (ITU-R BT.2100-2, tables 4 and 5). Of the light of white paper, 203 cd/m² (ITU-R BT.2408),
//! four fifths stay as they are, and what is brighter, up to the screen's white, comes into what photos have left, so that
//! paper is nearly white (244 of 255). Colours keep their ratios, until the primaries of sRGB cannot show them.

use glam::{DMat3, DVec3};
use std::fmt::Write as _;

/// By which curve light is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Curve {
    /// Hybrid log-gamma (ARIB STD-B67).
    Hlg,
    /// Perceptual quantisation (SMPTE ST 2084).
    Pq,
}

impl std::fmt::Display for Curve {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Hlg => "HLG",
            Self::Pq => "PQ",
        })
    }
}

/// How a video's colours of a high dynamic range are stored.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct HighRange {
    pub(super) curve: Curve,
    /// From its primaries' light to luminance.
    luminance: DVec3,
    /// And to that of sRGB's.
    to_srgb: DMat3,
    /// Whether it says by which matrix its colours are stored.
    has_matrix: bool,
}

/// Of a screen's white, and of paper's, in cd/m².
const SCREEN: f64 = 1000.0;
const PAPER: f64 = 203.0;
/// Light up to this share of paper's white stays as it is.
const KNEE: f64 = 0.8;
/// Colours along a side of the table.
const SIDE: usize = 65;

/// What `showinfo` calls the curves.
const CURVES: [(&str, Curve); 2] = [("arib-std-b67", Curve::Hlg), ("smpte2084", Curve::Pq)];
/// And primaries, with the chromaticities of red, green and blue, x and y each (ITU-T H.273, table 2); white is D65. The first are those of
/// BT.2020, which are taken where none are told.
const PRIMARIES: [(&str, [f64; 6]); 3] = [
    ("bt2020", [0.708, 0.292, 0.170, 0.797, 0.131, 0.046]),
    ("smpte432", [0.680, 0.320, 0.265, 0.690, 0.150, 0.060]),
    ("bt709", SRGB),
];
const SRGB: [f64; 6] = [0.640, 0.330, 0.300, 0.600, 0.150, 0.060];
const D65: [f64; 2] = [0.3127, 0.3290];

impl HighRange {
    /// What a frame's curve, primaries and matrix are called; `None` where its range is not high.
    pub(super) fn new(curve: &str, primaries: &str, matrix: &str) -> Option<Self> {
        let (_, curve) = CURVES.into_iter().find(|(name, _)| *name == curve)?;
        let known = PRIMARIES.into_iter().find(|(name, _)| *name == primaries);
        let to_xyz = xyz_of(known.unwrap_or(PRIMARIES[0]).1);
        Some(Self {
            curve,
            luminance: to_xyz.row(1),
            to_srgb: xyz_of(SRGB).inverse() * to_xyz,
            has_matrix: matrix != "unknown",
        })
    }

    /// The part of a filter that converts frames by the table in a file, whose name is spelt as filters want it.
    pub(super) fn filter(&self, table: &[u8], exact: &str) -> Vec<u8> {
        let matrix = match self.has_matrix {
            true => "",
            // ffmpeg would take BT.601.
            false => "in_color_matrix=bt2020:",
        };
        let before =
            format!("scale={matrix}{exact},format=gbrp16le,lut3d=interp=tetrahedral:file=");
        [before.as_bytes(), table, b","].concat()
    }

    /// The table, in the format `.cube` (Adobe, Cube LUT Specification 1.0).
    pub(super) fn table(&self) -> String {
        let mut text = format!("LUT_3D_SIZE {SIDE}\n");
        let code = |i: usize| i as f64 / (SIDE - 1) as f64;
        for blue in 0..SIDE {
            for green in 0..SIDE {
                for red in 0..SIDE {
                    let color = self.converted(DVec3::new(code(red), code(green), code(blue)));
                    let [r, g, b] = color.to_array();
                    writeln!(text, "{r:.5} {g:.5} {b:.5}").expect("texts can be written to");
                }
            }
        }
        text
    }

    /// The sRGB code, 0 to 1, of a stored one.
    fn converted(&self, code: DVec3) -> DVec3 {
        let light = match self.curve {
            Curve::Hlg => {
                // What the scene shone with, and what the screen makes of it.
                let scene = code.map(from_hlg);
                scene * self.luminance.dot(scene).powf(0.2) * (SCREEN / PAPER)
            }
            Curve::Pq => code.map(from_pq) / PAPER,
        };
        let light = (self.to_srgb * light).max(DVec3::ZERO);
        let most = light.max_element();
        let shown = match most > KNEE {
            true => light * (toned(most) / most),
            false => light,
        };
        shown.map(to_srgb_code)
    }
}

/// From primaries' light to CIE's XYZ, white being all of each.
fn xyz_of([rx, ry, gx, gy, bx, by]: [f64; 6]) -> DMat3 {
    let xyz = |x: f64, y: f64| DVec3::new(x / y, 1.0, (1.0 - x - y) / y);
    let columns = DMat3::from_cols(xyz(rx, ry), xyz(gx, gy), xyz(bx, by));
    let share = columns.inverse() * xyz(D65[0], D65[1]);
    columns * DMat3::from_diagonal(share)
}

/// The scene's light, 0 to 1, of a code.
fn from_hlg(code: f64) -> f64 {
    const A: f64 = 0.178_832_77;
    const B: f64 = 1.0 - 4.0 * A;
    // 0.5 - A ln(4 A).
    const C: f64 = 0.559_910_73;
    match code <= 0.5 {
        true => code * code / 3.0,
        false => (((code - C) / A).exp() + B) / 12.0,
    }
}

/// The screen's light in cd/m² of a code.
fn from_pq(code: f64) -> f64 {
    const M1: f64 = 2610.0 / 16384.0;
    const M2: f64 = 2523.0 / 4096.0 * 128.0;
    const C1: f64 = 3424.0 / 4096.0;
    const C2: f64 = 2413.0 / 4096.0 * 32.0;
    const C3: f64 = 2392.0 / 4096.0 * 32.0;
    let power = code.powf(1.0 / M2);
    10_000.0 * ((power - C1).max(0.0) / (C2 - C3 * power)).powf(1.0 / M1)
}

/// Light above [`KNEE`], brought below one: a hyperbola that goes on as straight as it comes, and has the screen's white at
/// one.
fn toned(light: f64) -> f64 {
    let most = SCREEN / PAPER;
    let over = (light.min(most) - KNEE) / (most - KNEE);
    // y = (1 - KNEE) · s·t / (1 + (s - 1)·t), whose slope is s in its own units at 0: one in those of light.
    let slope = (most - KNEE) / (1.0 - KNEE);
    KNEE + (1.0 - KNEE) * slope * over / (1.0 + (slope - 1.0) * over)
}

fn to_srgb_code(light: f64) -> f64 {
    match light <= 0.003_130_8 {
        true => 12.92 * light,
        false => 1.055 * light.min(1.0).powf(1.0 / 2.4) - 0.055,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn high(curve: &str) -> HighRange {
        HighRange::new(curve, "bt2020", "bt2020nc").unwrap()
    }

    #[test]
    fn white_of_paper_and_of_the_screen_are_where_standards_have_them() {
        // ITU-R BT.2408, table 1: 203 cd/m² are 75 % of HLG and 58 % of PQ.
        let (hlg, pq) = (high("arib-std-b67"), high("smpte2084"));
        let paper = to_srgb_code(toned(1.0));
        for (range, code) in [(hlg, 0.75), (pq, 0.5807)] {
            let shown = range.converted(DVec3::splat(code));
            assert!((shown - paper).abs().max_element() < 2e-3, "{shown}");
        }
        assert!(paper > 0.93 && paper < 1.0, "{paper}");
        for range in [hlg, pq] {
            assert_eq!(range.converted(DVec3::ZERO), DVec3::ZERO);
            let white = range.converted(DVec3::ONE);
            assert!((white - 1.0).abs().max_element() < 1e-6, "{white}");
        }
    }

    #[test]
    fn colours_that_srgb_has_come_back() {
        for (red, green, blue) in [(0.8, 0.2, 0.3), (0.1, 0.5, 0.2), (0.05, 0.06, 0.7)] {
            let code = DVec3::new(red, green, blue);
            let light = code.map(|c| match c <= 0.04045 {
                true => c / 12.92,
                false => ((c + 0.055) / 1.055_f64).powf(2.4),
            });
            for primaries in ["bt2020", "smpte432", "bt709"] {
                // The inverse of BT.2100's formulas.
                let range = HighRange::new("smpte2084", primaries, "bt2020nc").unwrap();
                let stored = (range.to_srgb.inverse() * light).map(|l| {
                    let power = (l * PAPER / 10_000.0).max(0.0).powf(0.159_301_757_812_5);
                    ((0.835_937_5 + 18.851_562_5 * power) / (1.0 + 18.6875 * power)).powf(78.84375)
                });
                let back = range.converted(stored);
                assert!((back - code).abs().max_element() < 1e-6, "{back} {code}");
            }
        }
    }

    #[test]
    fn brighter_light_is_never_darker_and_bends_smoothly() {
        let mut last = toned(KNEE);
        assert!((last - KNEE).abs() < 1e-12);
        assert!((toned(KNEE + 1e-6) - KNEE - 1e-6).abs() < 1e-10);
        for i in 1..=1000 {
            let now = toned(KNEE + f64::from(i) * 0.005);
            assert!(now >= last && now <= 1.0);
            last = now;
        }
    }

    #[test]
    fn tables_are_read_red_first() {
        let table = high("arib-std-b67").table();
        let rows: Vec<&str> = table.lines().collect();
        assert_eq!(rows.len(), 1 + SIDE * SIDE * SIDE);
        let red: Vec<f64> = rows[SIDE / 2]
            .split(' ')
            .map(|n| n.parse().unwrap())
            .collect();
        assert!(red[0] > 0.1 && red[1] == 0.0 && red[2] == 0.0, "{red:?}");
    }

    #[test]
    fn videos_without_a_high_range_have_none() {
        assert_eq!(HighRange::new("bt709", "bt709", "bt709"), None);
        assert_eq!(HighRange::new("unknown", "unknown", "unknown"), None);
    }
}
