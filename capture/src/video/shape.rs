//! Frames whose pixels are not square, as HDV's, DV's and DVDs' are.

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
        let (width, height) = words.next()?.strip_prefix("s:")?.split_once('x')?;
        Some(Self {
            size: (width.parse().ok()?, height.parse().ok()?),
            aspect: wide.parse::<f64>().ok()? / high.parse::<f64>().ok()?,
        })
    }

    /// The size to draw frames out to; `None` where they stay as they are stored.
    pub(super) fn stretched(&self, wanted: FrameShape) -> Option<(u32, u32)> {
        let (width, height) = self.size;
        let is_kept = match wanted {
            FrameShape::Square => false,
            FrameShape::Calibrated(w, h) => (w, h) == self.size,
            FrameShape::Stored => true,
        };
        let by = self.aspect.max(1.0 / self.aspect);
        if is_kept || !(LEAST_STRETCH..=MOST_STRETCH).contains(&by) {
            return None;
        }
        let longer = |side: u32| (f64::from(side) * by).round() as u32;
        Some(if self.aspect > 1.0 {
            (longer(width), height)
        } else {
            (width, longer(height))
        })
    }
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
            Shape::parse(&line).unwrap().stretched(wanted)
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
