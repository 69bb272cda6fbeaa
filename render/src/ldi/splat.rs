//! The stamps that samples leave.

/// How large a sample is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Stamp {
    /// One pixel.
    One,
    /// 2 × 2.
    Two,
    /// 3 × 3.
    Three,
    /// The pixel and its four neighbours (Rafferty et al. 1998, "Images for accelerating
    /// architectural walkthroughs", §4.2).
    #[default]
    Five,
    /// 1, 3, 5 or 7 pixels each way by the sample's normal and distance, its rim 1/2 and its
    /// corners 1/4 opaque (Gortler et al. 1997). A rim over nothing is opaque.
    Sized,
}

/// How much of a stamp's pixel shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Share {
    Whole,
    Half,
    Quarter,
}

impl Stamp {
    /// How many pixels it may reach from the one that it is at.
    pub fn reach(self) -> u32 {
        match self {
            Self::One => 0,
            Self::Two | Self::Three | Self::Five => 1,
            Self::Sized => 3,
        }
    }

    /// Subtracted from a place before the pixel it is in is taken.
    pub(super) fn shift(self) -> f32 {
        // A stamp of 2 × 2 lies around the nearest corner.
        if self == Self::Two { 0.5 } else { 0.0 }
    }

    /// The class of a patch of that half width and height, in pixels: how many pixels it reaches.
    #[inline(always)]
    pub(super) fn class(half: [f32; 2]) -> u8 {
        // The side of a square of the same area.
        let area = 4.0 * half[0] * half[1];
        u8::from(area > 1.5 * 1.5) + u8::from(area > 3.0 * 3.0) + u8::from(area > 5.0 * 5.0)
    }

    /// Hands the pixels of a stamp at one to `put`.
    #[inline(always)]
    pub(super) fn draw(
        self,
        at: usize,
        class: u8,
        stride: usize,
        mut put: impl FnMut(usize, Share),
    ) {
        let whole = Share::Whole;
        match self {
            Self::One => put(at, whole),
            Self::Two => {
                for i in [at, at + 1, at + stride, at + stride + 1] {
                    put(i, whole);
                }
            }
            Self::Three => {
                for row in [at - stride, at, at + stride] {
                    put(row - 1, whole);
                    put(row, whole);
                    put(row + 1, whole);
                }
            }
            Self::Five => {
                for i in [at - stride, at - 1, at, at + 1, at + stride] {
                    put(i, whole);
                }
            }
            Self::Sized => {
                let n = usize::from(class);
                let last = 2 * n;
                let corner = at - n * stride - n;
                for y in 0..=last {
                    for x in 0..=last {
                        let (across, down) = (x == 0 || x == last, y == 0 || y == last);
                        let share = match (n, across, down) {
                            (0, ..) | (_, false, false) => whole,
                            (_, true, true) => Share::Quarter,
                            _ => Share::Half,
                        };
                        put(corner + y * stride + x, share);
                    }
                }
            }
        }
    }
}

/// A pixel's colour and inverse depth in one number; 0 is nothing.
#[inline(always)]
pub(super) fn pack(color: [u8; 4], inverse_depth: f32) -> u64 {
    u64::from(u32::from_le_bytes(color)) << 32 | u64::from(inverse_depth.to_bits())
}

#[inline(always)]
pub(super) fn unpack(value: u64) -> ([u8; 4], f32) {
    (
        ((value >> 32) as u32).to_le_bytes(),
        f32::from_bits(value as u32),
    )
}

/// What a pixel becomes where a stamp covers a share of it. Depths are not mixed: the nearer half
/// has its own.
#[inline(always)]
pub(super) fn blend(below: u64, above: u64, share: Share) -> u64 {
    if share == Share::Whole || below == 0 {
        return above;
    }
    // The mean of each byte.
    let mean = |a: u32, b: u32| (a & b) + (((a ^ b) & 0xfefe_fefe) >> 1);
    let (a, b) = ((below >> 32) as u32, (above >> 32) as u32);
    let half = mean(a, b);
    match share {
        Share::Half => u64::from(half) << 32 | above & 0xffff_ffff,
        _ => u64::from(mean(a, half)) << 32 | below & 0xffff_ffff,
    }
}
