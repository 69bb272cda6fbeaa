use crate::Beside;
use std::io;
use std::path::PathBuf;

/// Why a photo or a set of them could not be used.
#[derive(Debug, thiserror::Error)]
pub enum CaptureError {
    /// A folder cannot be listed.
    #[error("{}: cannot list the folder: {source}; check the path", folder.display())]
    List {
        /// The folder.
        folder: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A folder without photos.
    #[error(
        "{}: no photos here or in the folders within; files ending in .jpg, .jpeg or .png are \
         read: give another folder, or convert the photos",
        folder.display()
    )]
    NoPhotos {
        /// The folder.
        folder: PathBuf,
    },
    /// A file's name cannot be the name of a photo.
    #[error("{}: the name is not UTF-8 text; rename the file", path.display())]
    Name {
        /// The file.
        path: PathBuf,
    },
    /// A file cannot be read.
    #[error(
        "{}: cannot read the picture: {source}; check that it is there and may be read",
        path.display()
    )]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A file is something other than a JPEG or PNG picture.
    #[error(
        "{}: found {found}, expected a JPEG or PNG picture; convert it, or leave it out",
        path.display()
    )]
    Format {
        /// The file.
        path: PathBuf,
        /// What it seems to be.
        found: String,
    },
    /// A JPEG of a rare kind.
    #[error(
        "{}: found a JPEG of {kind}, which is not read; save it as an ordinary JPEG or as a PNG, or leave it out",
        path.display()
    )]
    Jpeg {
        /// The file.
        path: PathBuf,
        /// What it has that others have not.
        kind: &'static str,
    },
    /// A picture that is damaged or cut short.
    #[error(
        "cannot decode {}: {problem}; the file may be truncated: copy it again or leave it out",
        path.display()
    )]
    Decode {
        /// The file.
        path: PathBuf,
        /// What the decoder says.
        problem: String,
    },
    /// A picture that would fill the memory.
    #[error(
        "{}: decoding {width} × {height} pixels takes more memory than the 512 MiB allowed for \
         one photo; reduce it, or leave it out",
        path.display()
    )]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Pixels.
        width: u32,
        /// Pixels.
        height: u32,
    },
    /// A picture of another size than its calibration speaks about.
    #[error(
        "{}: the photo has {} × {} pixels, expected {} × {} as calibrated; {}",
        path.display(), found.0, found.1, expected.0, expected.1, size_remedy(*found, *expected)
    )]
    Size {
        /// The file.
        path: PathBuf,
        /// Width and height in pixels.
        found: (u32, u32),
        /// Width and height in pixels.
        expected: (u32, u32),
    },
    /// A mask, matte or depth map of another size than its photo.
    #[error(
        "{}: the {kind} has {} × {} pixels and its photo {photo} {} × {}; make it as large as \
         the photo, or leave it out",
        path.display(), found.0, found.1, photo_size.0, photo_size.1
    )]
    SizeBeside {
        /// What it is.
        kind: Beside,
        /// The file.
        path: PathBuf,
        /// Its width and height in pixels.
        found: (u32, u32),
        /// The photo's name.
        photo: String,
        /// Width and height in pixels.
        photo_size: (u32, u32),
    },
    /// A depth map that does not hold depths.
    #[error(
        "{}: found {channels} channels of {bits} bits, expected a depth map of one channel of \
         16 bits; write depths as 16-bit grey PNG, or leave it out",
        path.display()
    )]
    DepthFormat {
        /// The file.
        path: PathBuf,
        /// A channel's.
        bits: u16,
        /// How many.
        channels: u8,
    },
    /// A file that belongs to two photos by its name.
    #[error(
        "{}: belongs to {} and {} alike by its name; call it {}.png if it is the former's",
        path.display(), photos[0], photos[1], photos[0]
    )]
    Ambiguous {
        /// The file.
        path: PathBuf,
        /// Two photos' names.
        photos: [String; 2],
    },
    /// A picture cannot be written.
    #[error("{}: cannot write the picture: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
}

fn size_remedy(found: (u32, u32), expected: (u32, u32)) -> &'static str {
    if found.0 != found.1 && found == (expected.1, expected.0) {
        "width and height are exchanged: EXIF orientation is not applied here, but a program may \
         have turned the photos by it before or after they were calibrated; use the photos that \
         were calibrated"
    } else {
        "use the photos that were calibrated, or calibrate these"
    }
}
