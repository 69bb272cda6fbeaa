//! Photos whose numbers mean other colours than sRGB's: phones store Display P3, cameras that are set so Adobe RGB.

use crate::jpeg;
use exif::{In, Reader, Tag, Value};
use image::{ImageFormat, RgbaImage};
use moxcms::{
    ColorProfile, DataColorSpace, Layout, RenderingIntent, Transform8BitExecutor, TransformOptions,
};
use std::sync::Arc;

/// Up to how many steps of 255 what a profile makes of a colour is not told from the colour: sRGB's own come in editions
/// that round, and cut off, differently.
const SAME_STEPS: u8 = 3;
/// Values of each channel that a profile is tried on.
const TRIED_VALUES: usize = 18;

/// What makes sRGB's numbers of a photo's, where these mean other colours: by the ICC profile that its file embeds; of a
/// JPEG without one, by Adobe RGB if its EXIF data say so as cameras do (DCF 2.0, the optional colour space). `None` for
/// sRGB itself and for what is no profile of RGB that can be read: such numbers are taken as they are stored.
pub(crate) fn to_srgb(
    embedded: Option<&[u8]>,
    format: ImageFormat,
    bytes: &[u8],
) -> Option<Arc<Transform8BitExecutor>> {
    let profile = match embedded {
        Some(icc) => ColorProfile::new_from_slice(icc).ok()?,
        None if format == ImageFormat::Jpeg && says_adobe_rgb(bytes) => {
            ColorProfile::new_adobe_rgb()
        }
        None => return None,
    };
    if profile.color_space != DataColorSpace::Rgb {
        return None;
    }
    let options = TransformOptions {
        rendering_intent: RenderingIntent::RelativeColorimetric,
        ..TransformOptions::default()
    };
    let srgb = ColorProfile::new_srgb();
    let layout = Layout::Rgba;
    let transform = profile.create_transform_8bit(layout, &srgb, layout, options);
    transform.ok().filter(|it| changes_colors(&**it))
}

/// Whether a transform changes any colour of a grid by more than [`SAME_STEPS`].
fn changes_colors(transform: &Transform8BitExecutor) -> bool {
    let values = || (0..TRIED_VALUES).map(|i| (255 / (TRIED_VALUES - 1) * i) as u8);
    let of_red = |r| values().flat_map(move |g| values().flat_map(move |b| [r, g, b, 255]));
    let stored: Vec<u8> = values().flat_map(of_red).collect();
    let mut shown = vec![0; stored.len()];
    let is_made = transform.transform(&stored, &mut shown).is_ok();
    let mut both = stored.iter().zip(&shown);
    is_made && both.any(|(stored, shown)| stored.abs_diff(*shown) > SAME_STEPS)
}

/// Gives a picture the colours that a transform makes of its numbers; alpha stays.
pub(crate) fn apply(transform: &Transform8BitExecutor, picture: &mut RgbaImage) {
    let row_bytes = 4 * picture.width() as usize;
    let mut stored = vec![0; row_bytes];
    for row in picture.chunks_exact_mut(row_bytes) {
        stored.copy_from_slice(row);
        // Rows are of whole pixels and of one length, which is all that it asks for.
        if transform.transform(&stored, row).is_err() {
            row.copy_from_slice(&stored);
        }
    }
}

/// Whether a JPEG's EXIF data say that it is in Adobe RGB: no colour space of EXIF's own, and the index `R03`.
fn says_adobe_rgb(bytes: &[u8]) -> bool {
    let data = jpeg::exif(bytes).unwrap_or_default();
    let Ok(tags) = Reader::new().read_raw(data.to_vec()) else {
        return false;
    };
    let value = |tag: Tag| tags.get_field(tag, In::PRIMARY).map(|field| &field.value);
    let space = value(Tag::ColorSpace).and_then(|value| value.get_uint(0));
    let index = match value(Tag::InteroperabilityIndex) {
        Some(Value::Ascii(parts)) => parts.first(),
        _ => None,
    };
    space == Some(0xFFFF) && index.is_some_and(|index| index.starts_with(b"R03"))
}
