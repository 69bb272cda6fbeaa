use crate::ModelKind;
use capture::{CaptureError, PhotoSet, is_sequence, photo_size, read_exif};

/// Which pairs of photos are matched.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Matching {
    /// Each with those near it in the order of names.
    Sequential,
    /// All.
    Exhaustive,
}

/// How COLMAP is run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Options {
    /// Which pairs of photos are matched.
    pub matching: Matching,
    /// One camera took all photos, at one focal length. Otherwise COLMAP tells cameras
    /// apart by EXIF data, and a photo without has one of its own.
    pub shared_camera: bool,
    /// The lens of the cameras.
    pub lens: ModelKind,
}

/// Of fewer photos all pairs are matched: a sequence's ten neighbours on either side and
/// those at powers of two leave few pairs out.
const SEQUENCE_AT_LEAST: usize = 30;

/// Photos that hold the eight parameters of one camera well.
const ENOUGH_FOR_OPENCV: usize = 20;

/// Focal lengths nearer than this are one: zooms report them coarsely.
const SAME_FOCAL_LENGTH: f64 = 1e-3;

impl Options {
    /// What suits a photo set. Pairs: all, or the neighbours in a long sequence, be it that
    /// `is_video` or by [`is_sequence`]. Cameras: one for photos of one size whose EXIF focal lengths, if
    /// any, agree. Lens: `OPENCV` for one camera with twenty photos or more, else
    /// `SIMPLE_RADIAL`.
    ///
    /// # Errors
    /// A photo cannot be read.
    pub fn for_photos(photos: &PhotoSet, is_video: bool) -> Result<Self, CaptureError> {
        let shared_camera = is_one_camera(photos)?;
        let count = photos.photos.len();
        let in_sequence = count >= SEQUENCE_AT_LEAST && (is_video || is_sequence(photos)?);
        Ok(Self {
            matching: match in_sequence {
                true => Matching::Sequential,
                false => Matching::Exhaustive,
            },
            shared_camera,
            lens: match shared_camera && count >= ENOUGH_FOR_OPENCV {
                true => ModelKind::OpenCv,
                false => ModelKind::SimpleRadial,
            },
        })
    }
}

fn is_one_camera(photos: &PhotoSet) -> Result<bool, CaptureError> {
    let mut first = None;
    for photo in &photos.photos {
        // One that cannot be decoded takes no part.
        let Ok(size) = photo_size(&photo.path) else {
            continue;
        };
        let focal_length_mm = read_exif(&photo.path)?.focal_length_mm;
        let &mut (first_size, first_mm) = first.get_or_insert((size, focal_length_mm));
        let is_same_focal_length = match (first_mm, focal_length_mm) {
            (Some(a), Some(b)) => (a / b - 1.0).abs() < SAME_FOCAL_LENGTH,
            (a, b) => a.is_none() && b.is_none(),
        };
        if size != first_size || !is_same_focal_length {
            return Ok(false);
        }
    }
    Ok(true)
}
