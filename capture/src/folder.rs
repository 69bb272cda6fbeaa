//! Folders that are made beside their place, and take it once they are complete.

use std::borrow::Cow;
use std::ffi::{OsStr, OsString};
use std::fs;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::io;
use std::path::{Path, PathBuf};

/// Where a folder is or is to be: without links, and with a name, so that another can lie beside
/// it. `.`, `..` and `DIR/.` do not say that. Folders above it are made where they are missing.
///
/// # Errors
/// The path ends in no name, as `/` does; a folder above it cannot be made.
pub fn place_of(folder: &Path) -> io::Result<PathBuf> {
    let nameless = || {
        let text = "no folder's name is at the path's end; choose a folder within it";
        io::Error::new(io::ErrorKind::InvalidInput, text)
    };
    let place = match folder.canonicalize() {
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            let name = folder.file_name().ok_or_else(nameless)?;
            let above = folder.parent().filter(|p| !p.as_os_str().is_empty());
            let above = above.unwrap_or(Path::new("."));
            fs::create_dir_all(above)?;
            above.canonicalize()?.join(name)
        }
        place => place?,
    };
    match place.file_name() {
        Some(_) => Ok(place),
        None => Err(nameless()),
    }
}

/// A hidden path beside a place, which is as [`place_of`] gives it. Whatever the length of the place's name, that of
/// this one is one that disks take, up to a `what` of some fifty bytes.
pub fn beside(place: &Path, what: &str) -> PathBuf {
    let name = place.file_name().unwrap_or_default().to_string_lossy();
    place.with_file_name(format!(".{}.{what}", shortened(&name)))
}

/// What processes that are gone have left beside a place, as [`beside`] names it of `partial-PROCESS` and whatever
/// follows: each path, and what follows the process' number. Processes of other containers and machines count as gone.
pub fn left_beside(place: &Path) -> Vec<(PathBuf, String)> {
    let unnumbered = beside(place, "partial-");
    let unnumbered = unnumbered.file_name().and_then(OsStr::to_str);
    let (Some(unnumbered), Some(above)) = (unnumbered, place.parent()) else {
        return Vec::new();
    };
    let above = match above.as_os_str().is_empty() {
        true => Path::new("."),
        false => above,
    };
    let mut left = Vec::new();
    for entry in fs::read_dir(above).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let numbered = name.to_str().and_then(|name| name.strip_prefix(unnumbered));
        let Some(numbered) = numbered else { continue };
        let end = numbered.trim_start_matches(|c: char| c.is_ascii_digit());
        let process = &numbered[..numbered.len() - end.len()];
        if is_gone(process) {
            left.push((entry.path(), end.to_owned()));
        }
    }
    left
}

/// Whether a process of that number is known not to run. Linux alone tells, where its `/proc` is to be seen.
fn is_gone(process: &str) -> bool {
    let all = Path::new("/proc");
    let tells = cfg!(target_os = "linux") && all.join("self").exists();
    tells && !process.is_empty() && !all.join(process).exists()
}

/// How long the part of another name may be that a hidden one has, in bytes: disks take 255 for the whole.
const LONGEST: usize = 200;

/// A name, or the beginning of one that is longer than [`LONGEST`], and a hash of all of it.
fn shortened(name: &str) -> Cow<'_, str> {
    if name.len() <= LONGEST {
        return Cow::Borrowed(name);
    }
    let mut hasher = DefaultHasher::new();
    name.hash(&mut hasher);
    let hash = format!("~{:016x}", hasher.finish());
    let end = (0..=LONGEST - hash.len())
        .rev()
        .find(|end| name.is_char_boundary(*end));
    Cow::Owned(name[..end.unwrap_or(0)].to_owned() + &hash)
}

/// Gives a new folder the place of another, which goes, if there is one. `place` is as
/// [`place_of`] gives it, and the new folder lies beside it. Nothing is removed before the new one
/// is there: a process that is killed leaves the old one, at worst beside its place as
/// `.NAME.replaced-NUMBER`.
///
/// # Errors
/// Something cannot be moved: then all is as before, or the error says where the old one is.
pub fn take_place(new: &Path, place: &Path) -> io::Result<()> {
    if !place.exists() {
        return fs::rename(new, place);
    }
    let old = free_beside(place);
    if is_stood_in(place) {
        // With another name it would still be the folder that one stands in: it stays, and what is
        // in it goes.
        fs::create_dir(&old)?;
        let exchanged =
            names_in(&[place, new]).and_then(|names| exchange(&names, new, place, &old));
        if let Err(error) = exchanged {
            // Only an empty one goes this way.
            let _ = fs::remove_dir(&old);
            return Err(error);
        }
        let _ = fs::remove_dir(new);
    } else {
        fs::rename(place, &old)?;
        if let Err(error) = fs::rename(new, place) {
            return Err(match fs::rename(&old, place) {
                Ok(()) => error,
                Err(_) => left_in(&old, &error),
            });
        }
    }
    fs::remove_dir_all(&old).map_err(|error| {
        let text = format!(
            "it is complete, but what it replaces cannot be removed: {}: {error}",
            old.display()
        );
        io::Error::new(error.kind(), text)
    })
}

/// Puts entries of a new folder into a place, and those of these names that were there into an
/// empty folder `old`. The last name is the first to leave and the last to come. An entry that
/// neither has is no matter.
///
/// # Errors
/// Something cannot be moved: then all is as before, or the error says that `old` still has some.
pub fn exchange<N: AsRef<Path>>(
    names: &[N],
    new: &Path,
    place: &Path,
    old: &Path,
) -> io::Result<()> {
    let coming: Vec<&Path> = names.iter().map(AsRef::as_ref).collect();
    let leaving: Vec<&Path> = coming.iter().rev().copied().collect();
    let exchanged = move_all(&leaving, place, old).and_then(|()| {
        move_all(&coming, new, place).inspect_err(|_| {
            // The first error is the one to tell.
            let _ = move_all(&coming, old, place);
        })
    });
    exchanged.map_err(|error| match names_in(&[old]) {
        Ok(left) if left.is_empty() => error,
        _ => left_in(old, &error),
    })
}

/// Moves entries of a folder into another that has none of these names: all that there are, or
/// none.
fn move_all(names: &[&Path], from: &Path, to: &Path) -> io::Result<()> {
    for (i, name) in names.iter().enumerate() {
        if let Err(error) = move_one(name, from, to) {
            for name in names[..i].iter().rev() {
                // The first error is the one to tell.
                let _ = move_one(name, to, from);
            }
            let text = format!("{}: {error}", name.display());
            return Err(io::Error::new(error.kind(), text));
        }
    }
    Ok(())
}

/// Moves an entry, if there is one. A link is moved, wherever it leads.
fn move_one(name: &Path, from: &Path, to: &Path) -> io::Result<()> {
    match fs::symlink_metadata(from.join(name)) {
        Ok(_) => fs::rename(from.join(name), to.join(name)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        Err(error) => Err(error),
    }
}

fn names_in(folders: &[&Path]) -> io::Result<Vec<OsString>> {
    let mut names = Vec::new();
    for folder in folders {
        for entry in fs::read_dir(folder)? {
            names.push(entry?.file_name());
        }
    }
    Ok(names)
}

/// A path beside a place that nothing has yet. A process that was killed may have left one, and
/// in containers processes share their numbers.
fn free_beside(place: &Path) -> PathBuf {
    let mut number = std::process::id();
    loop {
        let path = beside(place, &format!("replaced-{number}"));
        if fs::symlink_metadata(&path).is_err() {
            return path;
        }
        number = number.wrapping_add(1);
    }
}

/// Whether this process stands in a folder, or in one within it.
fn is_stood_in(place: &Path) -> bool {
    let here = std::env::current_dir().and_then(|here| here.canonicalize());
    here.is_ok_and(|here| here.starts_with(place))
}

fn left_in(old: &Path, error: &io::Error) -> io::Error {
    let text = format!("{error}; what was there is in {}", old.display());
    io::Error::new(error.kind(), text)
}
