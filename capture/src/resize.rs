use crate::{apply_matte, take_usable_colors};
use fast_image_resize::{FilterType, ResizeAlg, ResizeOptions, Resizer};
use image::{DynamicImage, GrayImage, RgbaImage};

/// The size of a photo reduced so that its longer side is at most `max_side` pixels (at
/// least one); its own size where it is small enough. The shape is kept to within half a
/// pixel of the shorter side.
pub fn reduced_size((width, height): (u32, u32), max_side: u32) -> (u32, u32) {
    let (longer, max_side) = (width.max(height), max_side.max(1));
    if longer <= max_side {
        return (width, height);
    }
    let reduce = |side: u32| {
        let (side, longer, max_side) = (u64::from(side), u64::from(longer), u64::from(max_side));
        // Rounded to the nearest; not more than `max_side`, so it fits.
        ((2 * side * max_side + longer) / (2 * longer)).max(1) as u32
    };
    (reduce(width), reduce(height))
}

/// The picture stretched to another size; its corners stay corners. Colours are weighed
/// by their alpha, so that what is transparent does not bleed in.
///
/// Where both sides shrink by whole factors a pixel is the mean of those it covers.
///
/// # Panics
/// If a side of `image` is zero and one of the result is not.
pub fn resize(image: &RgbaImage, width: u32, height: u32) -> RgbaImage {
    let mut resized = RgbaImage::new(width, height);
    let options = ResizeOptions::new()
        .resize_alg(ResizeAlg::Convolution(filter(
            image.dimensions(),
            (width, height),
        )))
        .use_alpha(true);
    Resizer::new()
        .resize(image, &mut resized, &options)
        .expect("two RGBA pictures of non-zero size");
    resized
}

/// As [`resize`], with a mask of what to use (255) and what to ignore (0): what is ignored does not bleed in, either.
/// Alpha, and where nothing is used colours, are as without.
///
/// # Panics
/// As [`resize`], and if the mask has another size than `image`.
pub fn resize_used(image: &RgbaImage, used: &GrayImage, width: u32, height: u32) -> RgbaImage {
    let mut resized = resize(image, width, height);
    let mut usable = image.clone();
    apply_matte(&mut usable, used);
    take_usable_colors(&mut resized, &resize(&usable, width, height));
    resized
}

/// As [`resize`], of a mask or a matte.
///
/// # Panics
/// If either size is zero.
pub fn resize_mask(mask: &GrayImage, width: u32, height: u32) -> GrayImage {
    let pixels = DynamicImage::from(mask.clone()).into_rgba8();
    DynamicImage::from(resize(&pixels, width, height)).into_luma8()
}

/// The sharpest filter that puts every pixel where it belongs.
fn filter(from: (u32, u32), to: (u32, u32)) -> FilterType {
    let whole = |from: u32, to: u32| to > 0 && from.is_multiple_of(to);
    if whole(from.0, to.0) && whole(from.1, to.1) {
        // Elsewhere this library's box takes pixels wholly or not at all, which would
        // shift details by up to half a source pixel.
        FilterType::Box
    } else if to.0 <= from.0 && to.1 <= from.1 {
        FilterType::Hamming
    } else {
        FilterType::Bilinear
    }
}
