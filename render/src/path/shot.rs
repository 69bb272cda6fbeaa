//! Screenshots that know where they were taken from: PNG files with a text chunk that holds the
//! pose as a path of one frame, so that whatever reads paths can make the same picture again.

use super::file::parse_own;
use super::{
    CameraPath, Interpolation, Keyframe, KeyframeFile, PathError, PathFileError, PathFrame, text,
};
use calibrate::View;
use image::RgbaImage;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead, BufReader, BufWriter, Cursor, Seek};
use std::path::Path;

/// The text chunk's keyword.
pub const SHOT_KEYWORD: &str = "lumigraph path";
/// Those of the chunks that say what of its view the picture shows.
const LAYER_KEYWORD: &str = "lumigraph layer";
const OPTIONS_KEYWORD: &str = "lumigraph options";
const MEANWHILE_KEYWORD: &str = "lumigraph meanwhile";
/// What a PNG begins with.
const SIGNATURE: [u8; 8] = *b"\x89PNG\r\n\x1a\n";

/// Whether a file's content is a PNG.
pub(super) fn is_png(bytes: &[u8]) -> bool {
    bytes.starts_with(&SIGNATURE)
}

/// What a screenshot shows of its view.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ShotLook {
    /// "picture", or another layer's name.
    pub layer: String,
    /// The options that it was drawn with and that are not the defaults, as the command line spells
    /// them: `--k 11 --grid 64`.
    pub options: String,
    /// Of one taken while loading went on: the options that stand for what was not chosen by then, as
    /// `--proxy points --no-exposure`. Else empty.
    pub meanwhile: String,
}

/// Writes a picture with the view that it was drawn for, the time that it shows the scene as of, in
/// seconds, if time plays a part, and what of it is shown. The file appears complete or not at all.
///
/// # Errors
/// A file that cannot be written; a view or a time that no file can hold.
pub fn write_shot(
    file: &Path,
    picture: &RgbaImage,
    view: &View,
    time_s: Option<f64>,
    look: &ShotLook,
) -> Result<(), PathFileError> {
    let io = |error| PathFileError::Write(file.to_owned(), error);
    let png = |error: png::EncodingError| match error {
        png::EncodingError::IoError(error) => io(error),
        other => PathFileError::Png(file.to_owned(), other.to_string()),
    };
    let of_path = |error| PathFileError::Path(file.to_owned(), error);
    let mut frame = PathFrame::of_view("frame_0000".to_owned(), view).map_err(|error| {
        of_path(PathError::Camera {
            kind: "frame",
            index: 0,
            error,
        })
    })?;
    frame.time_s = time_s;
    let one = CameraPath::new(30.0, vec![frame]).map_err(of_path)?;
    let text = text(&one)?;
    let mut temporary = file.as_os_str().to_owned();
    temporary.push(".tmp");
    let written = (|| {
        let out = BufWriter::new(File::create(&temporary).map_err(io)?);
        let mut encoder = png::Encoder::new(out, picture.width(), picture.height());
        encoder.set_color(png::ColorType::Rgba);
        encoder.set_depth(png::BitDepth::Eight);
        for (keyword, text) in [
            (SHOT_KEYWORD, &text),
            (LAYER_KEYWORD, &look.layer),
            (OPTIONS_KEYWORD, &look.options),
            (MEANWHILE_KEYWORD, &look.meanwhile),
        ] {
            if keyword == MEANWHILE_KEYWORD && text.is_empty() {
                continue;
            }
            encoder
                .add_text_chunk(keyword.to_owned(), text.clone())
                .map_err(png)?;
        }
        let mut writer = encoder.write_header().map_err(png)?;
        writer.write_image_data(picture.as_raw()).map_err(png)?;
        writer.finish().map_err(png)?;
        std::fs::rename(&temporary, file).map_err(io)
    })();
    if written.is_err() {
        // The error at hand is the one to report.
        let _ = std::fs::remove_file(&temporary);
    }
    written
}

/// What a file shows of its view if it is a screenshot; what cannot be read is none.
pub fn read_shot_look(file: &Path) -> Option<ShotLook> {
    let mut texts = texts(BufReader::new(File::open(file).ok()?)).ok()?;
    Some(ShotLook {
        layer: texts.remove(LAYER_KEYWORD)?,
        options: texts.remove(OPTIONS_KEYWORD)?,
        meanwhile: texts.remove(MEANWHILE_KEYWORD).unwrap_or_default(),
    })
}

/// A PNG's texts by their keywords, of several the first: those before its pixels.
fn texts(png: impl BufRead + Seek) -> Result<BTreeMap<String, String>, png::DecodingError> {
    let mut decoder = png::Decoder::new(png);
    // It may be large beyond all measure, and says nothing of the pose.
    decoder.set_ignore_iccp_chunk(true);
    let reader = decoder.read_info()?;
    let mut texts = BTreeMap::new();
    for chunk in &reader.info().uncompressed_latin1_text {
        let text = texts.entry(chunk.keyword.clone());
        text.or_insert_with(|| chunk.text.clone());
    }
    Ok(texts)
}

/// The view that a screenshot was drawn for, as a path of one frame that is called as the file.
///
/// # Errors
/// A damaged PNG, or one without a pose.
pub(super) fn parse_shot(file: &Path, bytes: &[u8]) -> Result<CameraPath, PathFileError> {
    let texts = texts(Cursor::new(bytes));
    let texts = texts.map_err(|error| PathFileError::Png(file.to_owned(), error.to_string()))?;
    let text = texts.get(SHOT_KEYWORD);
    let text = text.ok_or_else(|| PathFileError::NoPose(file.to_owned()))?;
    let (mut path, _) = parse_own(file, text.as_bytes())?;
    if let ([frame], Some(stem)) = (path.frames.as_mut_slice(), file.file_stem()) {
        frame.name = stem.to_string_lossy().into_owned();
    }
    Ok(path)
}

/// A screenshot's frame as a keyframe, to begin a path with.
pub(super) fn keyframes(shot: &CameraPath) -> KeyframeFile {
    let keyframe = |(index, frame): (usize, &PathFrame)| Keyframe {
        t_s: index as f64 / shot.fps,
        camera_from_world: frame.view.camera_from_world,
        camera: frame.camera.clone(),
        time_s: frame.time_s,
    };
    KeyframeFile {
        fps: shot.fps,
        keyframes: shot.frames.iter().enumerate().map(keyframe).collect(),
        interpolation: Interpolation::Spline,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::path::{NerfstudioFrame, is_nerfstudio, read, read_keyframes};
    use calibrate::{Lens, Rigid3};
    use glam::{DVec2, DVec3};
    use image::Rgba;

    fn view() -> View {
        let (center, target) = (DVec3::new(0.1, 1e6, -3.7), DVec3::new(0.3, 1e6, 5.0));
        let view = View {
            lens: Lens::pinhole(DVec2::splat(31.7), DVec2::new(16.0, 12.0)),
            width: 32,
            height: 24,
            camera_from_world: Rigid3::looking_at(center, target, DVec3::Y),
        };
        PathFrame::of_view("a".to_owned(), &view).unwrap().view
    }

    fn look() -> ShotLook {
        ShotLook {
            layer: "picture".to_owned(),
            options: "--k 11 --beta 0.05".to_owned(),
            meanwhile: String::new(),
        }
    }

    #[test]
    fn a_shot_gives_its_view_and_its_pixels_back() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("shot_0001.png");
        let picture = RgbaImage::from_fn(32, 24, |x, y| Rgba([x as u8, y as u8, 7, (x * y) as u8]));
        write_shot(&file, &picture, &view(), Some(1.5), &look()).unwrap();
        assert_eq!(image::open(&file).unwrap().into_rgba8(), picture);
        let path = read(&file).unwrap();
        assert_eq!(path.frames.len(), 1);
        assert_eq!(path.frames[0].view, view());
        assert_eq!(path.frames[0].time_s, Some(1.5));
        assert_eq!(path.frames[0].name, "shot_0001");
        assert_eq!(read_shot_look(&file), Some(look()));
        let early = ShotLook {
            meanwhile: "--proxy points".to_owned(),
            ..look()
        };
        let other = folder.path().join("shot_0002.png");
        write_shot(&other, &picture, &view(), None, &early).unwrap();
        assert_eq!(read_shot_look(&other), Some(early));
        // It begins a path of keyframes, too.
        let begun = read_keyframes(&file, &NerfstudioFrame::default());
        let KeyframeFile {
            fps,
            keyframes,
            interpolation,
        } = begun.unwrap().unwrap();
        assert_eq!(keyframes.len(), 1);
        let again = CameraPath::from_keyframes(&keyframes, interpolation, fps).unwrap();
        assert_eq!(again.frames[0].view, view());
        assert!(!is_nerfstudio(&file));
    }

    #[test]
    fn other_files_are_said_to_be_others() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.png");
        RgbaImage::new(2, 2).save(&file).unwrap();
        assert_eq!(read_shot_look(&file), None);
        assert!(matches!(read(&file), Err(PathFileError::NoPose(_))));
        std::fs::write(&file, SIGNATURE).unwrap();
        assert!(matches!(read(&file), Err(PathFileError::Png(..))));
        std::fs::write(&file, "no picture").unwrap();
        assert!(matches!(read(&file), Err(PathFileError::Json(..))));
        assert_eq!(read_shot_look(&file), None);
        let gone = folder.path().join("gone/b.png");
        assert_eq!(read_shot_look(&gone), None);
        assert!(matches!(read(&gone), Err(PathFileError::Io(..))));
        let failed = write_shot(&gone, &RgbaImage::new(32, 24), &view(), None, &look());
        assert!(matches!(failed, Err(PathFileError::Write(..))));
    }
}
