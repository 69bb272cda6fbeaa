use crate::{CaptureError, jpeg, profile, reduced_size, resize};
use image::{DynamicImage, ImageDecoder, ImageError, ImageFormat, ImageReader, Limits, RgbaImage};
use std::fs::{self, File};
use std::io::{self, BufRead, BufReader, Cursor, Read, Seek};
use std::path::Path;

/// Size of the first part of a JPEG in which its size and EXIF data are looked for; more only
/// where that does not hold them.
const HEAD_BYTES: u64 = 1 << 16;

/// Width and height of a photo as stored, from the start of the file alone.
///
/// # Errors
/// A file that cannot be read, or is no JPEG or PNG picture.
pub fn photo_size(path: &Path) -> Result<(u32, u32), CaptureError> {
    let file = open(path).map_err(read_failed(path))?;
    content_size(path, BufReader::new(file))
}

/// The same for a photo's content, read from where `file` stands, its beginning; `path` is
/// only named in errors.
///
/// # Errors
/// As for [`photo_size`].
pub fn content_size(
    path: &Path,
    mut file: impl BufRead + Seek,
) -> Result<(u32, u32), CaptureError> {
    let failed = read_failed(path);
    let start = start(&mut file).map_err(&failed)?;
    match format_of(path, &start)? {
        ImageFormat::Jpeg => find_in_head(&mut file, jpeg::size)
            .map_err(&failed)?
            .ok_or_else(|| decode_error(path, "the JPEG data do not state a size")),
        format => ImageReader::with_format(file, format)
            .into_dimensions()
            .map_err(|error| decode_failed(path, &error, None)),
    }
}

/// A file's first bytes, as many as tell its format; it stands at its beginning again.
pub(crate) fn start(file: &mut (impl Read + Seek)) -> io::Result<Vec<u8>> {
    let mut start = Vec::new();
    Read::by_ref(file).take(64).read_to_end(&mut start)?;
    file.rewind()?;
    Ok(start)
}

/// What `find` makes of a file's first part, of which it is given more until it finds something; `None` where it
/// finds nothing in the whole file.
pub(crate) fn find_in_head<T>(
    file: &mut impl Read,
    find: impl Fn(&[u8]) -> Option<T>,
) -> io::Result<Option<T>> {
    let mut head = Vec::new();
    let mut wanted = HEAD_BYTES;
    loop {
        let missing = wanted - head.len() as u64;
        let got = Read::by_ref(file).take(missing).read_to_end(&mut head)?;
        if let Some(found) = find(&head) {
            return Ok(Some(found));
        }
        if (got as u64) < missing {
            // That was the whole file.
            return Ok(None);
        }
        wanted *= 4;
    }
}

/// Decodes a photo as 8-bit sRGB with alpha, not premultiplied: the stored pixel grid, EXIF
/// orientation not applied. Grey, palette and 16-bit pictures are converted, and so are
/// colours of another profile (Display P3, Adobe RGB, ...); what sRGB does not reach is cut off.
/// A picture without alpha is opaque.
///
/// # Errors
/// A file that cannot be read, is no JPEG or PNG picture, or a JPEG of a rare kind, is damaged
/// or cut short, needs more than 512 MiB, or has another size than `expected_size`.
pub fn decode(path: &Path, expected_size: Option<(u32, u32)>) -> Result<RgbaImage, CaptureError> {
    let bytes = read(path).map_err(read_failed(path))?;
    decode_content(path, &bytes, expected_size)
}

/// Decodes a photo's content; `path` is only named in errors.
///
/// # Errors
/// As for [`decode`].
pub fn decode_content(
    path: &Path,
    bytes: &[u8],
    expected_size: Option<(u32, u32)>,
) -> Result<RgbaImage, CaptureError> {
    let check = |found| match expected_size {
        Some(expected) if found != expected => Err(CaptureError::Size {
            path: path.to_owned(),
            found,
            expected,
        }),
        _ => Ok(()),
    };
    let format = format_of(path, bytes)?;
    let (picture, icc) = decode_with_profile(path, bytes, format, check)?;
    let transform = match picture.color().has_color() {
        true => profile::to_srgb(icc.as_deref(), format, bytes),
        false => None,
    };
    let mut picture = picture.into_rgba8();
    if let Some(transform) = transform {
        profile::apply(&*transform, &mut picture);
    }
    Ok(picture)
}

/// Decodes a picture's content, its numbers as stored, once `check` accepts its size. See [`decode`].
pub(crate) fn decode_any(
    path: &Path,
    bytes: &[u8],
    check: impl Fn((u32, u32)) -> Result<(), CaptureError>,
) -> Result<DynamicImage, CaptureError> {
    let format = format_of(path, bytes)?;
    Ok(decode_with_profile(path, bytes, format, check)?.0)
}

/// The same, and the ICC profile that it embeds.
fn decode_with_profile(
    path: &Path,
    bytes: &[u8],
    format: ImageFormat,
    check: impl Fn((u32, u32)) -> Result<(), CaptureError>,
) -> Result<(DynamicImage, Option<Vec<u8>>), CaptureError> {
    // 1. The size first: a picture of the wrong one is not worth decoding.
    let size = match format {
        ImageFormat::Jpeg => jpeg::size(bytes),
        _ => None,
    };
    let size = match size {
        Some(size) => size,
        None => ImageReader::with_format(Cursor::new(bytes), format)
            .into_dimensions()
            .map_err(|error| decode_failed(path, &error, None))?,
    };
    check(size)?;

    // 2. The JPEG decoder would make stripes of some, and paint what is missing grey.
    if format == ImageFormat::Jpeg
        && let Some(kind) = jpeg::unread(bytes)
    {
        let path = path.to_owned();
        return Err(CaptureError::Jpeg { path, kind });
    }
    if format == ImageFormat::Jpeg && !jpeg::is_complete(bytes) {
        return Err(decode_error(path, "the JPEG data have no end"));
    }

    // 3. The pixels.
    let failed = |error: ImageError| decode_failed(path, &error, Some(size));
    let reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut decoder = reader.into_decoder().map_err(failed)?;
    let mut limits = Limits::default();
    limits.reserve(decoder.total_bytes()).map_err(failed)?;
    decoder.set_limits(limits).map_err(failed)?;
    let icc = decoder.icc_profile().map_err(failed)?;
    let picture = DynamicImage::from_decoder(decoder).map_err(failed)?;

    // 4. It makes something of damaged data, too.
    if format == ImageFormat::Jpeg
        && let Some(share) = jpeg::damage(bytes)
    {
        return Err(decode_error(path, damaged(share)));
    }
    Ok((picture, icc))
}

/// What is wrong with a JPEG that shows damage after a share of the picture.
fn damaged(share: f64) -> String {
    match (100.0 * share).floor() {
        percent if percent < 100.0 => format!(
            "the JPEG data are damaged, at most the first {percent} % of the picture are whole"
        ),
        _ => "the JPEG data are damaged, they do not end with the picture".to_owned(),
    }
}

/// Decodes a photo and reduces it so that its longer side is at most `max_side` pixels;
/// a smaller one comes as it is. See [`decode`] and [`reduced_size`].
///
/// # Errors
/// As [`decode`]; `expected_size` is the size before the reduction.
pub fn decode_reduced(
    path: &Path,
    expected_size: Option<(u32, u32)>,
    max_side: u32,
) -> Result<RgbaImage, CaptureError> {
    let picture = decode(path, expected_size)?;
    let (width, height) = reduced_size(picture.dimensions(), max_side);
    if (width, height) == picture.dimensions() {
        return Ok(picture);
    }
    Ok(resize(&picture, width, height))
}

/// Opens a regular file; anything else but a folder, as a pipe that nobody writes to, might be waited for
/// without end.
pub(crate) fn open(path: &Path) -> io::Result<File> {
    let found = fs::metadata(path)?;
    if !(found.is_file() || found.is_dir()) {
        return Err(io::Error::other("it is no regular file"));
    }
    File::open(path)
}

/// The content of a file that [`open`] opens.
pub(crate) fn read(path: &Path) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open(path)?.read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// JPEG or PNG, by a file's first bytes: its extension may be wrong.
pub(crate) fn format_of(path: &Path, bytes: &[u8]) -> Result<ImageFormat, CaptureError> {
    if bytes.is_empty() {
        return Err(decode_error(path, "the file is empty (0 bytes)"));
    }
    let found = match image::guess_format(bytes) {
        Ok(format @ (ImageFormat::Jpeg | ImageFormat::Png)) => return Ok(format),
        Ok(other) => format!("a file that seems to be {other:?}"),
        Err(_) => "no picture format known here".to_owned(),
    };
    Err(CaptureError::Format {
        path: path.to_owned(),
        found,
    })
}

pub(crate) fn read_failed(path: &Path) -> impl Fn(std::io::Error) -> CaptureError {
    move |source| CaptureError::Read {
        path: path.to_owned(),
        source,
    }
}

fn decode_error(path: &Path, problem: impl Into<String>) -> CaptureError {
    CaptureError::Decode {
        path: path.to_owned(),
        problem: problem.into(),
    }
}

fn decode_failed(path: &Path, error: &ImageError, size: Option<(u32, u32)>) -> CaptureError {
    match (error, size) {
        (ImageError::Limits(_), Some((width, height))) => CaptureError::TooLarge {
            path: path.to_owned(),
            width,
            height,
        },
        _ => decode_error(path, error.to_string()),
    }
}
