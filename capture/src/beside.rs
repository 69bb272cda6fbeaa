//! Pictures beside the photos: masks, mattes and depth maps, matched to photos by name.

use crate::decode::{format_of, read_failed};
use crate::photo_set::other_files;
use crate::{CaptureError, PhotoFile, PhotoSet, decode};
use image::{
    ColorType, DynamicImage, GrayImage, ImageBuffer, ImageDecoder, ImageFormat, ImageReader, Luma,
    Rgb, RgbaImage,
};
use std::collections::BTreeMap;
use std::fmt;
use std::io::{BufReader, Cursor, Read};
use std::path::{Path, PathBuf};

/// What a picture beside a photo says about it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Beside {
    /// What to ignore (people, cars): 0 = ignore, 255 = use.
    IgnoreMask,
    /// The object that the photo is about: its coverage, as an alpha channel.
    ObjectMatte,
    /// Depth along z, or along the ray of a lens that sees behind itself, in steps of 16 bits; 0 = none.
    DepthMap,
}

impl fmt::Display for Beside {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::IgnoreMask => "ignore mask",
            Self::ObjectMatte => "object matte",
            Self::DepthMap => "depth map",
        })
    }
}

/// The pictures of a folder that belong to photos.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Matched {
    /// By the photo's name.
    pub by_photo: BTreeMap<String, PathBuf>,
    /// Files of the kind asked for that belong to no photo, by their name in the folder.
    pub unmatched: Vec<String>,
}

/// Finds the PNG files in a folder (and the folders within) that belong to photos: for the
/// photo `sub/a.jpg` that is `sub/a.jpg.png`, as COLMAP names masks, or else `sub/a.png`.
/// The case of extensions does not matter.
///
/// # Errors
/// A folder that cannot be listed or holds no pictures; a file that two photos could claim.
pub fn match_by_name(folder: &Path, photos: &[&str]) -> Result<Matched, CaptureError> {
    match_kind(folder, photos, |kind| kind == "png")
}

/// The same of JPEG files: masks and mattes may be such, but photos lie in folders as well (see
/// [`is_black_and_white`]).
///
/// # Errors
/// As for [`match_by_name`].
pub fn match_jpegs_by_name(folder: &Path, photos: &[&str]) -> Result<Matched, CaptureError> {
    match_kind(folder, photos, |kind| kind != "png")
}

/// The same of files of any other kind, which are not read: `sub/a.jpg.tif` or else `sub/a.tif`, where there
/// are any.
///
/// # Errors
/// A folder that cannot be listed; a file whose name is not UTF-8, or that two photos could claim.
pub fn match_others_by_name(folder: &Path, photos: &[&str]) -> Result<Matched, CaptureError> {
    let called = |file: PhotoFile| {
        let (name, extension) = file.name.rsplit_once('.')?;
        // The point may be a folder's.
        let is_own = !extension.contains('/');
        let name = is_own.then(|| with_lower_extension(name))?;
        Some((name, file))
    };
    let files = other_files(folder)?;
    match_files(files.into_iter().filter_map(called), photos)
}

fn match_kind(
    folder: &Path,
    photos: &[&str],
    is_wanted: impl Fn(&str) -> bool,
) -> Result<Matched, CaptureError> {
    let called = |file: PhotoFile| {
        let (name, kind) = split_extension(&file.name);
        let is_it = kind.is_some_and(&is_wanted);
        let name = is_it.then(|| with_lower_extension(name))?;
        Some((name, file))
    };
    let files = PhotoSet::open(folder)?.photos;
    match_files(files.into_iter().filter_map(called), photos)
}

/// Which of files belong to photos; each comes with its name less its own extension.
fn match_files(
    called: impl Iterator<Item = (String, PhotoFile)>,
    photos: &[&str],
) -> Result<Matched, CaptureError> {
    let mut files: BTreeMap<String, (String, PathBuf)> = BTreeMap::new();
    for (called, file) in called {
        files.entry(called).or_insert((file.name, file.path));
    }
    let mut claimed: BTreeMap<&str, &str> = BTreeMap::new();
    let mut by_photo = BTreeMap::new();
    for &photo in photos {
        let stem = split_extension(photo).0.to_owned();
        let found = [with_lower_extension(photo), stem]
            .iter()
            .find_map(|name| files.get(name));
        let Some((name, path)) = found else {
            continue;
        };
        if let Some(other) = claimed.insert(name, photo) {
            return Err(CaptureError::Ambiguous {
                path: path.clone(),
                photos: [other.to_owned(), photo.to_owned()],
            });
        }
        by_photo.insert(photo.to_owned(), path.clone());
    }
    let names = files.values().map(|(name, _)| name);
    let unmatched = names.filter(|name| !claimed.contains_key(name.as_str()));
    let unmatched = unmatched.cloned().collect();
    Ok(Matched {
        by_photo,
        unmatched,
    })
}

/// A name and its extension, if that is one of a photo's, in lower case.
fn split_extension(name: &str) -> (&str, Option<&'static str>) {
    let known = crate::photo_set::EXTENSIONS.into_iter().find_map(|known| {
        let at = name.len().checked_sub(known.len() + 1)?;
        let (stem, extension) = (name.get(..at)?, name.get(at + 1..)?);
        let is_it = name.as_bytes()[at] == b'.' && extension.eq_ignore_ascii_case(known);
        is_it.then_some((stem, Some(known)))
    });
    known.unwrap_or((name, None))
}

fn with_lower_extension(name: &str) -> String {
    match split_extension(name) {
        (stem, Some(extension)) => format!("{stem}.{extension}"),
        (stem, None) => stem.to_owned(),
    }
}

/// Checks, from its header alone, that a picture beside a photo is what its kind needs and
/// as large as the photo.
///
/// # Errors
/// A file that cannot be read or is no PNG or JPEG picture; another size than `photo_size`;
/// a depth map that is not 16-bit grey.
pub fn check_beside(
    kind: Beside,
    path: &Path,
    photo: &str,
    photo_size: (u32, u32),
) -> Result<(), CaptureError> {
    let failed = read_failed(path);
    let mut reader = BufReader::new(decode::open(path).map_err(&failed)?);
    let mut head = Vec::new();
    Read::by_ref(&mut reader)
        .take(16)
        .read_to_end(&mut head)
        .map_err(&failed)?;
    let format = format_of(path, &head)?;
    let file = BufReader::new(decode::open(path).map_err(&failed)?);
    let decoder = ImageReader::with_format(file, format)
        .into_decoder()
        .map_err(|error| CaptureError::Decode {
            path: path.to_owned(),
            problem: error.to_string(),
        })?;
    check_size(kind, path, decoder.dimensions(), photo, photo_size)?;
    if kind == Beside::DepthMap {
        check_depth_format(path, decoder.color_type())?;
    }
    Ok(())
}

/// From black and from white, what compression makes of them in JPEG files, at the most.
const JPEG_NOISE: u8 = 32;
const WHITE: u8 = 255 - JPEG_NOISE;

/// Whether a picture is black and white, as masks are, but for what compression makes of that: 95 % of it,
/// and at least 1 % white.
///
/// # Errors
/// As for [`crate::decode()`].
pub fn is_black_and_white(path: &Path) -> Result<bool, CaptureError> {
    let bytes = decode::read(path).map_err(read_failed(path))?;
    let picture = decode::decode_any(path, &bytes, |_| Ok(()))?.into_rgb8();
    let count = |is_it: fn(u8) -> bool| {
        let is_it = |pixel: &&Rgb<u8>| pixel.0.iter().all(|value| is_it(*value));
        picture.pixels().filter(is_it).count()
    };
    let black = count(|value| value <= JPEG_NOISE);
    let white = count(|value| value >= WHITE);
    let all = picture.pixels().len();
    Ok(20 * (black + white) >= 19 * all && 100 * white >= all)
}

/// Whether a mask or a matte says nothing but in its alpha channel, which is not read: its colour is one all
/// over, and its alpha is not.
///
/// # Errors
/// As for [`crate::decode()`].
pub fn is_in_alpha(path: &Path) -> Result<bool, CaptureError> {
    let bytes = decode::read(path).map_err(read_failed(path))?;
    let reader = ImageReader::with_format(Cursor::new(&bytes), format_of(path, &bytes)?);
    let has_alpha = reader.into_decoder().map(|d| d.color_type().has_alpha());
    // What is wrong with the file decoding says.
    if has_alpha.is_ok_and(|has_alpha| !has_alpha) {
        return Ok(false);
    }
    let picture = decode::decode_any(path, &bytes, |_| Ok(()))?.into_rgba8();
    let first = picture.get_pixel(0, 0).0;
    let is_one_color = picture.pixels().all(|pixel| pixel.0[..3] == first[..3]);
    Ok(is_one_color && picture.pixels().any(|pixel| pixel.0[3] != first[3]))
}

/// Decodes an ignore mask or an object matte, 0…255; colours by their brightness. A
/// picture of nothing but zeros and ones means 0 and 255; in a JPEG file what is nearly black or
/// white is.
///
/// # Errors
/// As for [`crate::decode()`], and another size than its photo's.
pub fn decode_mask(
    kind: Beside,
    path: &Path,
    photo: &str,
    photo_size: (u32, u32),
) -> Result<GrayImage, CaptureError> {
    let (picture, format) = decode_beside(kind, path, photo, photo_size)?;
    let ones = deep_zeros_and_ones(&picture);
    let mut mask = ones.unwrap_or_else(|| picture.into_luma8());
    if format == ImageFormat::Jpeg {
        mask.iter_mut().for_each(|value| match *value {
            ..=JPEG_NOISE => *value = 0,
            WHITE.. => *value = 255,
            _ => {}
        });
    } else if mask.iter().all(|&value| value <= 1) {
        mask.iter_mut().for_each(|value| *value *= 255);
    }
    Ok(mask)
}

/// A picture of 16 bits that has nothing but zeros and ones, as they are: of 8 bits both would be zero.
fn deep_zeros_and_ones(picture: &DynamicImage) -> Option<GrayImage> {
    let color = picture.color();
    if color.bytes_per_pixel() == color.channel_count() {
        return None;
    }
    let deep = picture.to_luma16();
    let is_it = deep.iter().all(|value| *value <= 1);
    let value = |x, y| Luma([u8::from(deep.get_pixel(x, y).0[0] != 0)]);
    is_it.then(|| GrayImage::from_fn(deep.width(), deep.height(), value))
}

/// Cuts a photo out by a matte: its alpha becomes the lesser of the two, so that a matte
/// which repeats an alpha channel changes nothing.
///
/// # Panics
/// If the sizes differ.
pub fn apply_matte(photo: &mut RgbaImage, matte: &GrayImage) {
    assert_eq!(photo.dimensions(), matte.dimensions());
    for (pixel, matte) in photo.pixels_mut().zip(matte.pixels()) {
        pixel.0[3] = pixel.0[3].min(matte.0[0]);
    }
}

/// Gives a picture that was resampled the colours of `usable`, the same resampled with what is to be ignored transparent:
/// nothing of that bleeds into what is used. Where nothing usable is, and in alpha, the picture stays.
///
/// # Panics
/// If the sizes differ.
pub fn take_usable_colors(picture: &mut RgbaImage, usable: &RgbaImage) {
    assert_eq!(picture.dimensions(), usable.dimensions());
    for (pixel, usable) in picture.pixels_mut().zip(usable.pixels()) {
        let [r, g, b, alpha] = usable.0;
        if alpha > 0 {
            pixel.0 = [r, g, b, pixel.0[3]];
        }
    }
}

/// Depth at each pixel's centre: along the camera's z axis, or along the pixel's ray where the photo reaches
/// behind the camera (`calibrate::DepthAlong`).
#[derive(Clone, Debug, PartialEq)]
pub struct DepthMap {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// In world units, row by row; 0 where unknown.
    pub depths: Vec<f32>,
}

impl DepthMap {
    /// The depth at a pixel, if it is known.
    ///
    /// # Panics
    /// If the pixel lies outside.
    pub fn at(&self, column: u32, row: u32) -> Option<f32> {
        assert!(column < self.width && row < self.height);
        let depth = self.depths[row as usize * self.width as usize + column as usize];
        (depth > 0.0).then_some(depth)
    }
}

/// Decodes a depth map: a 16-bit grey picture whose values times `units_per_step` are
/// world units, 0 where the depth is unknown.
///
/// # Errors
/// As for [`crate::decode()`]; another size than its photo's; not 16-bit grey.
pub fn decode_depth(
    path: &Path,
    photo: &str,
    photo_size: (u32, u32),
    units_per_step: f64,
) -> Result<DepthMap, CaptureError> {
    let (width, height) = photo_size;
    let steps = decode_depth_steps(path, photo, photo_size)?.into_raw();
    let depths = steps
        .into_iter()
        .map(|steps| (f64::from(steps) * units_per_step) as f32);
    Ok(DepthMap {
        width,
        height,
        depths: depths.collect(),
    })
}

/// Decodes a depth map's values as they are stored: see [`decode_depth`].
///
/// # Errors
/// As for [`decode_depth`].
pub fn decode_depth_steps(
    path: &Path,
    photo: &str,
    photo_size: (u32, u32),
) -> Result<ImageBuffer<Luma<u16>, Vec<u16>>, CaptureError> {
    let (picture, _) = decode_beside(Beside::DepthMap, path, photo, photo_size)?;
    check_depth_format(path, picture.color())?;
    Ok(picture.into_luma16())
}

fn decode_beside(
    kind: Beside,
    path: &Path,
    photo: &str,
    photo_size: (u32, u32),
) -> Result<(DynamicImage, ImageFormat), CaptureError> {
    let check = |found| check_size(kind, path, found, photo, photo_size);
    let bytes = decode::read(path).map_err(read_failed(path))?;
    let picture = decode::decode_any(path, &bytes, check)?;
    Ok((picture, format_of(path, &bytes)?))
}

fn check_size(
    kind: Beside,
    path: &Path,
    found: (u32, u32),
    photo: &str,
    photo_size: (u32, u32),
) -> Result<(), CaptureError> {
    if found == photo_size {
        return Ok(());
    }
    Err(CaptureError::SizeBeside {
        kind,
        path: path.to_owned(),
        found,
        photo: photo.to_owned(),
        photo_size,
    })
}

fn check_depth_format(path: &Path, found: ColorType) -> Result<(), CaptureError> {
    if found == ColorType::L16 {
        return Ok(());
    }
    Err(CaptureError::DepthFormat {
        path: path.to_owned(),
        bits: found.bits_per_pixel() / u16::from(found.channel_count()),
        channels: found.channel_count(),
    })
}
