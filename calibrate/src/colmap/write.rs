use super::{ColmapError, Format, STEMS, binary, check, find, text};
use crate::Reconstruction;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// Writes `cameras.txt`, `images.txt` and `points3D.txt` into `folder`, which is made
/// where it is missing. Every number reads back to the last bit, every id is kept. Cameras
/// that no model of COLMAP's describes have names of our own ([`ModelKind::colmap_id`] is
/// none): we read them again, COLMAP does not.
///
/// [`ModelKind::colmap_id`]: crate::ModelKind::colmap_id
///
/// The files are written under temporary names and renamed once all three are complete.
///
/// # Errors
/// What [`read_model`](super::read_model) would refuse is refused here, before anything
/// is written; so is a name with a line break or with white space at its ends, and a
/// folder with a binary model, which would be read instead, or with `rigs.txt` or
/// `frames.txt`. Files that cannot be written.
pub fn write_text(reconstruction: &Reconstruction, folder: &Path) -> Result<(), ColmapError> {
    if find::format_in(folder)? == Some(Format::Binary) {
        return Err(ColmapError::Hidden {
            folder: folder.to_owned(),
        });
    }
    write(
        reconstruction,
        folder,
        Format::Text,
        fits_text,
        [text::write_cameras, text::write_images, text::write_points],
    )
}

/// Whether a text model can hold a photo's name: one without line breaks, `\` and white space at its ends.
pub fn fits_text(name: &str) -> bool {
    !name.contains(['\n', '\r', '\\']) && name.trim() == name
}

/// Writes `cameras.bin`, `images.bin` and `points3D.bin` into `folder`, which is made
/// where it is missing. Every number reads back to the last bit, every id is kept.
///
/// The files are written under temporary names and renamed once all three are complete.
///
/// # Errors
/// What [`read_model`](super::read_model) would refuse is refused here, before anything
/// is written; so is a name with a zero byte, a camera of a model that COLMAP lacks, and a
/// folder with `rigs.bin` or `frames.bin`. Files that cannot be written.
pub fn write_binary(reconstruction: &Reconstruction, folder: &Path) -> Result<(), ColmapError> {
    let mut cameras = reconstruction.cameras.iter();
    if let Some((id, camera)) = cameras.find(|(_, camera)| camera.model.colmap_id().is_none()) {
        return Err(ColmapError::NotColmaps {
            folder: folder.to_owned(),
            camera_id: id.0,
            model: camera.model,
        });
    }
    write(
        reconstruction,
        folder,
        Format::Binary,
        |name| !name.contains(['\0', '\\']),
        [
            binary::write_cameras,
            binary::write_images,
            binary::write_points,
        ],
    )
}

/// What COLMAP 4 writes beside the three files: they hold the ids of their own model's images and cameras.
const FURTHER: [&str; 2] = ["rigs", "frames"];

type WriteFile = fn(&Reconstruction, &mut dyn Write) -> io::Result<()>;

fn write(
    reconstruction: &Reconstruction,
    folder: &Path,
    format: Format,
    name_fits: impl Fn(&str) -> bool,
    write_files: [WriteFile; 3],
) -> Result<(), ColmapError> {
    // 1. Refuse what could not be read again, here or by COLMAP.
    let files = format.files(folder);
    check::references(reconstruction, &files)?;
    for (id, image) in &reconstruction.images {
        if image.name.trim().is_empty() || !name_fits(&image.name) {
            return Err(ColmapError::Name {
                path: files[1].clone(),
                image_id: id.0,
                name: image.name.clone(),
            });
        }
    }

    let further = FURTHER.map(|stem| folder.join(format!("{stem}.{}", format.extension())));
    if let Some(path) = further.into_iter().find(|file| file.exists()) {
        return Err(ColmapError::Rigs { path });
    }

    // 2. Write beside the final names.
    let failed = |path: &Path| {
        let path = path.to_owned();
        move |source| ColmapError::Write { path, source }
    };
    fs::create_dir_all(folder).map_err(failed(folder))?;
    let mut temporary = Temporary(Vec::new());
    for (stem, write_file) in STEMS.into_iter().zip(write_files) {
        let path = folder.join(format!(
            ".{stem}.{}.{}.tmp",
            format.extension(),
            std::process::id()
        ));
        temporary.0.push(path.clone());
        write_one(&path, |out| write_file(reconstruction, out)).map_err(failed(&path))?;
    }

    // 3. All three are complete: give them their names. One of an earlier model's goes first, so that a process which is
    // killed between them leaves no model, rather than one of both.
    let [.., points] = &files;
    match fs::remove_file(points) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(failed(points)(error)),
        _ => {}
    }
    for (path, file) in temporary.0.iter().zip(&files) {
        fs::rename(path, file).map_err(failed(file))?;
    }
    Ok(())
}

fn write_one(path: &Path, write: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
    let mut out = BufWriter::new(File::create(path)?);
    write(&mut out)?;
    out.flush()
}

/// Temporary files, removed at the end where they still exist.
struct Temporary(Vec<PathBuf>);

impl Drop for Temporary {
    fn drop(&mut self) {
        for path in &self.0 {
            // Renamed files are no longer there: nothing to remove is the usual case.
            let _ = fs::remove_file(path);
        }
    }
}
