use image::{ImageBuffer, Luma, Rgba, RgbaImage};

/// Where a pixel of a warped picture comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Footprint {
    /// The place in the source picture that the pixel's centre shows, in its pixels: x, y.
    pub center: [f64; 2],
    /// How that place moves with the pixel: `jacobian[i][j]` is the derivative of source
    /// coordinate i by destination coordinate j.
    pub jacobian: [[f64; 2]; 2],
}

/// What weighs the source pixels around a place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kernel {
    /// A tent.
    Bilinear,
    /// Keys' cubic with a = −1/2 (IEEE Trans. ASSP 29 (6), 1981, eq. 15).
    CatmullRom,
    /// A sinc under the middle lobe of another, three times as wide.
    Lanczos3,
}

impl Kernel {
    fn radius(self) -> f64 {
        match self {
            Self::Bilinear => 1.0,
            Self::CatmullRom => 2.0,
            Self::Lanczos3 => 3.0,
        }
    }

    fn at(self, x: f64) -> f64 {
        let x = x.abs();
        match self {
            _ if x >= self.radius() => 0.0,
            Self::Bilinear => 1.0 - x,
            Self::CatmullRom if x < 1.0 => (1.5 * x - 2.5) * x * x + 1.0,
            Self::CatmullRom => ((-0.5 * x + 2.5) * x - 4.0) * x + 2.0,
            Self::Lanczos3 if x < 1e-9 => 1.0,
            Self::Lanczos3 => {
                let t = std::f64::consts::PI * x;
                3.0 * t.sin() * (t / 3.0).sin() / (t * t)
            }
        }
    }
}

/// The picture resampled: pixel (column, row) of the result shows the place that
/// `footprint_of` names, black and opaque where that is nowhere.
///
/// Where the result is coarser than the source the kernel grows with the footprint, along
/// each axis of the source by itself, so that nothing aliases; it never shrinks. Colours
/// are weighed by their alpha. The border's pixels go on outside.
pub fn warp(
    source: &RgbaImage,
    (width, height): (u32, u32),
    kernel: Kernel,
    footprint_of: impl Fn(u32, u32) -> Option<Footprint>,
) -> RgbaImage {
    let (mut across, mut down) = (Vec::new(), Vec::new());
    RgbaImage::from_fn(width, height, |column, row| {
        let Some(Footprint {
            center: [x, y],
            jacobian,
        }) = footprint_of(column, row)
        else {
            return Rgba([0, 0, 0, 255]);
        };
        let [wide, tall] = jacobian.map(|[a, b]| a.hypot(b).max(1.0));
        taps(kernel, x, wide, source.width(), &mut across);
        taps(kernel, y, tall, source.height(), &mut down);
        let mut sum = [0.0; 4];
        for &(j, weight_y) in &down {
            let mut row_sum = [0.0; 4];
            for &(i, weight_x) in &across {
                let [r, g, b, a] = source.get_pixel(i, j).0.map(f64::from);
                let weight = weight_x * a;
                for (sum, value) in row_sum.iter_mut().zip([r, g, b, 1.0]) {
                    *sum += weight * value;
                }
            }
            for (sum, value) in sum.iter_mut().zip(row_sum) {
                *sum += weight_y * value;
            }
        }
        let [r, g, b, a] = sum;
        let byte = |value: f64| value.clamp(0.0, 255.0).round_ties_even() as u8;
        if byte(a) == 0 {
            return Rgba([0; 4]);
        }
        Rgba([byte(r / a), byte(g / a), byte(b / a), byte(a)])
    })
}

/// A depth map resampled as [`warp`] does a picture, by the nearest pixel: depths in between
/// would be those of neither surface. 0, unknown, where `footprint_of` is nowhere.
pub fn warp_depth_steps(
    source: &ImageBuffer<Luma<u16>, Vec<u16>>,
    (width, height): (u32, u32),
    footprint_of: impl Fn(u32, u32) -> Option<Footprint>,
) -> ImageBuffer<Luma<u16>, Vec<u16>> {
    ImageBuffer::from_fn(width, height, |column, row| {
        footprint_of(column, row).map_or(Luma([0]), |Footprint { center: [x, y], .. }| {
            let index = |place: f64, side: u32| place.clamp(0.0, f64::from(side - 1)) as u32;
            *source.get_pixel(index(x, source.width()), index(y, source.height()))
        })
    })
}

/// The source pixels along one axis that make up a place, with weights of sum 1.
fn taps(kernel: Kernel, center: f64, scale: f64, side: u32, taps: &mut Vec<(u32, f64)>) {
    taps.clear();
    let reach = kernel.radius() * scale;
    // A pixel's centre is half a pixel from its index.
    let (first, last) = (
        (center - reach - 0.5).ceil(),
        (center + reach - 0.5).floor(),
    );
    let mut total = 0.0;
    let mut index = first;
    while index <= last {
        let weight = kernel.at((index + 0.5 - center) / scale);
        total += weight;
        taps.push((index.clamp(0.0, f64::from(side - 1)) as u32, weight));
        index += 1.0;
    }
    for (_, weight) in taps {
        *weight /= total;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const KERNELS: [Kernel; 3] = [Kernel::Bilinear, Kernel::CatmullRom, Kernel::Lanczos3];

    /// A pixel of the result shows the same pixel, `scale` times as large and moved.
    fn stretched(scale: f64, shift: f64) -> impl Fn(u32, u32) -> Option<Footprint> {
        move |column, row| {
            Some(Footprint {
                center: [column, row].map(|i| (f64::from(i) + 0.5) * scale + shift),
                jacobian: [[scale, 0.0], [0.0, scale]],
            })
        }
    }

    fn noise(width: u32, height: u32) -> RgbaImage {
        let mut state = 1_u32;
        RgbaImage::from_fn(width, height, |_, _| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let [r, g, b, a] = state.to_be_bytes();
            Rgba([r, g, b, a.max(1)])
        })
    }

    #[test]
    fn what_stays_in_place_stays_the_same() {
        let source = noise(13, 9);
        for kernel in KERNELS {
            assert_eq!(
                warp(&source, (13, 9), kernel, stretched(1.0, 0.0)),
                source,
                "{kernel:?}"
            );
        }
    }

    #[test]
    fn whole_steps_move_pixels_and_the_border_goes_on() {
        let source = noise(13, 9);
        let moved = warp(&source, (13, 9), Kernel::CatmullRom, stretched(1.0, 2.0));
        assert_eq!(moved.get_pixel(3, 4), source.get_pixel(5, 6));
        assert_eq!(moved.get_pixel(12, 8), source.get_pixel(12, 8));
    }

    #[test]
    fn one_colour_stays_one_colour() {
        let source = RgbaImage::from_pixel(32, 32, Rgba([10, 200, 77, 255]));
        for kernel in KERNELS {
            for (scale, shift) in [(0.3, 0.7), (1.0, 0.25), (2.7, -0.1)] {
                let same = warp(&source, (11, 11), kernel, stretched(scale, shift));
                assert!(same.pixels().all(|p| p.0 == [10, 200, 77, 255]));
            }
        }
    }

    #[test]
    fn reducing_averages_where_point_samples_would_alias() {
        // Columns black and white in turn: a third as wide they are grey.
        let source = RgbaImage::from_fn(96, 96, |x, _| {
            Rgba([[0, 0, 0, 255], [255; 4]][x as usize % 2])
        });
        for kernel in KERNELS {
            let grey = warp(&source, (16, 16), kernel, stretched(4.0, 16.0));
            for pixel in grey.pixels() {
                assert!((120..=135).contains(&pixel.0[0]), "{kernel:?}: {pixel:?}");
            }
        }
    }

    #[test]
    fn what_is_transparent_lends_no_colour() {
        let source = RgbaImage::from_fn(16, 16, |x, _| {
            Rgba([[255, 0, 0, 0], [0, 0, 200, 255]][usize::from(x >= 8)])
        });
        for kernel in KERNELS {
            let moved = warp(&source, (15, 15), kernel, stretched(1.0, 0.5));
            let edge = moved.get_pixel(7, 7).0;
            assert_eq!(edge[..3], [0, 0, 200], "{kernel:?}");
            // Half of 255.
            assert!((127..=128).contains(&edge[3]), "{kernel:?}");
            assert_eq!(moved.get_pixel(1, 1).0, [0; 4]);
        }
    }

    #[test]
    fn depth_is_of_the_nearest_pixel() {
        let source = ImageBuffer::from_fn(4, 3, |x, y| Luma([(1000 * x + 60_000 * y) as u16]));
        let same = warp_depth_steps(&source, (4, 3), stretched(1.0, 0.0));
        assert_eq!(same, source);
        for shift in [1.49, 0.51] {
            let moved = warp_depth_steps(&source, (4, 3), stretched(1.0, shift));
            assert_eq!(moved.get_pixel(1, 0), source.get_pixel(2, 1), "{shift}");
            assert_eq!(moved.get_pixel(3, 2), source.get_pixel(3, 2), "{shift}");
        }
        let nowhere = warp_depth_steps(&source, (2, 1), |_, _| None);
        assert!(nowhere.pixels().all(|p| p.0 == [0]));
    }

    #[test]
    fn nowhere_is_black() {
        let nowhere = warp(&noise(4, 4), (2, 1), Kernel::Lanczos3, |_, _| None);
        assert!(nowhere.pixels().all(|p| p.0 == [0, 0, 0, 255]));
    }
}
