use super::{ColmapError, Format, STEMS, binary, check, find, text};
use crate::Reconstruction;
use capture::folder::exchange;
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
/// The files are written to a folder within and moved once all three are complete; where that fails, those of an
/// earlier model stay.
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
/// The files are written to a folder within and moved once all three are complete; where that fails, those of an
/// earlier model stay.
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

    let failed = |path: &Path| {
        let path = path.to_owned();
        move |source| ColmapError::Write { path, source }
    };
    let further = FURTHER.map(|stem| folder.join(format!("{stem}.{}", format.extension())));
    if let Some(path) = further.into_iter().find(|file| file.exists()) {
        return Err(ColmapError::Rigs { path });
    }

    // Files of an earlier model are removed in the end. A folder of such a name is none, and may hold anything.
    let is_folder = |file: &&PathBuf| fs::symlink_metadata(file).is_ok_and(|file| file.is_dir());
    if let Some(path) = files.iter().find(is_folder) {
        return Err(failed(path)(io::ErrorKind::IsADirectory.into()));
    }

    // 2. Write beside the final names.
    fs::create_dir_all(folder).map_err(failed(folder))?;
    let work = Work::new(folder).map_err(failed(folder))?;
    let names = STEMS.map(|stem| format!("{stem}.{}", format.extension()));
    for (name, write_file) in names.iter().zip(write_files) {
        let path = work.new.join(name);
        write_one(&path, |out| write_file(reconstruction, out)).map_err(failed(&path))?;
    }

    // 3. All three are complete: they take the places of an earlier model's. Its points go first, and the new ones come
    // last, so that a process which is killed between them leaves no model, rather than one of both.
    exchange(&names, &work.new, folder, &work.old).map_err(failed(folder))?;
    // There is nothing to do about it where this fails.
    let _ = fs::remove_dir_all(&work.old);
    Ok(())
}

fn write_one(path: &Path, write: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
    let mut out = BufWriter::new(File::create(path)?);
    write(&mut out)?;
    out.flush()
}

/// A hidden folder for files that are to take the places of others, and for those. It goes at the end, unless there are
/// still some of the others in it.
struct Work {
    itself: PathBuf,
    new: PathBuf,
    old: PathBuf,
}

impl Work {
    /// One within a folder. A process that was killed may have left one, and in containers processes share their
    /// numbers.
    fn new(folder: &Path) -> io::Result<Self> {
        let mut number = std::process::id();
        let itself = loop {
            let itself = folder.join(format!(".model.{number}.tmp"));
            match fs::create_dir(&itself) {
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
                    number = number.wrapping_add(1);
                }
                made => {
                    made?;
                    break itself;
                }
            }
        };
        let [new, old] = ["new", "old"].map(|name| itself.join(name));
        let work = Self { itself, new, old };
        fs::create_dir(&work.new)?;
        fs::create_dir(&work.old)?;
        Ok(work)
    }
}

impl Drop for Work {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.new);
        // Only empty ones go this way.
        let _ = fs::remove_dir(&self.old);
        let _ = fs::remove_dir(&self.itself);
    }
}
