//! Frames whose pixels are not square, as HDV's, DV's and DVDs' are.

use std::fmt;

/// How frames whose pixels are not square are taken out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FrameShape {
    /// As players show them: wider or higher than they are stored, with square pixels.
    #[default]
    Square,
    /// The same, but as they are stored where they have this width and height: that a calibration is of.
    Calibrated(u32, u32),
    /// As they are stored.
    Stored,
}

/// By less, pixels are not square only because a size was rounded.
const LEAST_STRETCH: f64 = 1.005;
/// And by more they are so by mistake.
const MOST_STRETCH: f64 = 4.0;

/// How a frame is stored.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Shape {
    /// Width and height in pixels.
    pub(super) size: (u32, u32),
    /// A pixel's width by its height; 0 or no number where it is not known.
    aspect: f64,
}

impl Shape {
    /// From a line that the filter `showinfo` prints of a frame.
    pub(super) fn parse(line: &str) -> Option<Self> {
        let (_, told) = line.split_once(" sar:")?;
        let mut words = told.split_whitespace();
        let (wide, high) = words.next()?.split_once('/')?;
        Some(Self {
            size: size(words.next()?.strip_prefix("s:")?)?,
            aspect: wide.parse::<f64>().ok()? / high.parse::<f64>().ok()?,
        })
    }

    /// The frames' sizes where their pixels are not square.
    pub(super) fn oblong(&self) -> Option<Oblong> {
        let (width, height) = self.size;
        let by = self.aspect.max(1.0 / self.aspect);
        if !(LEAST_STRETCH..=MOST_STRETCH).contains(&by) {
            return None;
        }
        let longer = |side: u32| (f64::from(side) * by).round() as u32;
        let shown = if self.aspect > 1.0 {
            (longer(width), height)
        } else {
            (width, longer(height))
        };
        Some(Oblong {
            stored: self.size,
            shown,
        })
    }
}

/// Frames whose pixels are not square: their width and height in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Oblong {
    pub(super) stored: (u32, u32),
    /// As players show them.
    pub(super) shown: (u32, u32),
}

impl Oblong {
    /// The size to draw frames out to; `None` where they stay as they are stored.
    pub(super) fn drawn_out(&self, wanted: FrameShape) -> Option<(u32, u32)> {
        let is_kept = match wanted {
            FrameShape::Square => false,
            FrameShape::Calibrated(width, height) => (width, height) == self.stored,
            FrameShape::Stored => true,
        };
        (!is_kept).then_some(self.shown)
    }

    /// From the text that it is printed as.
    pub(super) fn parse(text: &str) -> Option<Self> {
        let (stored, shown) = text.split_once(SHOWN_AS)?;
        Some(Self {
            stored: size(stored)?,
            shown: size(shown)?,
        })
    }
}

impl fmt::Display for Oblong {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [(width, height), (shown_width, shown_height)] = [self.stored, self.shown];
        write!(f, "{width}x{height}{SHOWN_AS}{shown_width}x{shown_height}")
    }
}

const SHOWN_AS: &str = " shown as ";

/// A width and height out of `1920x1080`.
pub(super) fn size(text: &str) -> Option<(u32, u32)> {
    let (width, height) = text.split_once('x')?;
    Some((width.parse().ok()?, height.parse().ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_grow_to_square_pixels() {
        let stretched = |sar: &str, size: &str, wanted: FrameShape| {
            let line = format!(
                "[Parsed_showinfo_0 @ 0x5] n: 0 pts_time:0 fmt:yuv420p sar:{sar} s:{size} i:P"
            );
            let oblong = Shape::parse(&line).unwrap().oblong();
            oblong.and_then(|oblong| oblong.drawn_out(wanted))
        };
        let square = |sar: &str, size: &str| stretched(sar, size, FrameShape::Square);
        assert_eq!(square("4/3", "1440x1080"), Some((1920, 1080)));
        assert_eq!(square("16/11", "720x576"), Some((1047, 576)));
        assert_eq!(square("8/9", "720x480"), Some((720, 540)));
        // Square, unknown, rounded, mistaken.
        for sar in ["1/1", "0/1", "0/0", "1280/1281", "4294967295/1"] {
            assert_eq!(square(sar, "854x480"), None, "{sar}");
        }
        let calibrated = |w, h| stretched("4/3", "360x360", FrameShape::Calibrated(w, h));
        assert_eq!(calibrated(360, 360), None);
        assert_eq!(calibrated(480, 360), Some((480, 360)));
        assert_eq!(stretched("4/3", "360x360", FrameShape::Stored), None);
        assert_eq!(Shape::parse("[showinfo] pts_time:0"), None);
    }
}
