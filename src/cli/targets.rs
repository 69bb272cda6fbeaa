//! What a command is about to write: not over what it reads, and only where it can.

use super::inputs::photo_folders;
use super::interior::check_outside;
use anyhow::{Context, bail};
use lumigraph::scene::{Photo, Scene};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Fails where a folder that `-o` names cannot be made or written to, or would lie in that of an interior, before
/// anything is.
pub(super) fn check_folder(folder: &Path) -> anyhow::Result<()> {
    check_writable(folder, "choose another -o")?;
    check_outside(folder, "-o")
}

/// What to say of the window's folder that nobody named where it cannot be made or written to: that is no matter as long
/// as nothing is saved. Fails where it would lie in that of an interior.
#[cfg(feature = "window")]
pub(super) fn note_of_unasked_folder(folder: &Path) -> anyhow::Result<Option<String>> {
    check_outside(folder, "-o")?;
    let writable = check_writable(folder, "to save screenshots or a path, choose another -o");
    Ok(writable.err().map(|error| error.to_string()))
}

/// Fails where there is no writing to a scene's own folder, into which a command writes what has no `-o`.
pub(super) fn check_scene_folder(folder: &Path) -> anyhow::Result<()> {
    check_writable(folder, "give a file elsewhere with -o")
}

/// The same of a file that an option names, and of the folder that it is to lie in.
pub(super) fn check_file(file: &Path, option: &str) -> anyhow::Result<()> {
    if file.is_dir() {
        bail!(
            "{}: a folder is where the file was to be; choose another {option}",
            file.display()
        );
    }
    // It would be another file in the place of a device or a pipe: of `/dev/stdout` for all that write there.
    let is_link = file.is_symlink() && file.starts_with("/dev");
    if is_link || (file.exists() && !file.is_file()) {
        bail!(
            "{}: no file, and would be replaced by one; choose another {option}",
            file.display()
        );
    }
    let folder = file.parent().unwrap_or(Path::new(""));
    check_writable(folder, &format!("choose another {option}"))?;
    check_outside(file, option)
}

/// Fails where [`datasets::in_new_folder`] would for the folder that `-o` names, as far as can be told before
/// long work, or where that is to lie in the folder of an interior. It may be such a folder itself.
pub(super) fn check_new_folder(
    folder: &Path,
    may_be_replaced: impl Fn(&Path) -> bool,
) -> anyhow::Result<()> {
    let real = folder.canonicalize().ok();
    match real.as_deref().and_then(Path::parent) {
        // It is made beside its place, which it takes.
        Some(above) if folder.is_dir() => check_folder(above)?,
        _ => check_folder(folder)?,
    }
    Ok(datasets::check_free(folder, may_be_replaced)?)
}

/// `remedy` is what to do where that cannot be.
fn check_writable(folder: &Path, remedy: &str) -> anyhow::Result<()> {
    // In the place of a link that leads nowhere nothing can be made.
    let mut missing = folder.ancestors().take_while(|path| !path.exists());
    if let Some(link) = missing.find(|path| path.is_symlink()) {
        bail!(
            "{}: a link is where the folder was to be, and what it leads to is not there; {remedy}",
            link.display()
        );
    }
    // The folder itself, or that which it would be made in.
    let there = folder.ancestors().find(|path| path.exists());
    let there = there.unwrap_or(Path::new("."));
    let named = there.display();
    if !there.is_dir() {
        bail!("{named}: a file is where the folder was to be; {remedy}");
    }
    // By a file without a name, which nobody sees.
    match tempfile::tempfile_in(there) {
        Ok(_) => Ok(()),
        Err(error) => bail!("{named}: cannot write: {error}; {remedy}"),
    }
}

/// Fails where a file to be written is one of those that pictures are made of, by whatever path.
pub(super) fn check_inputs<'a>(
    files: impl IntoIterator<Item = &'a Path>,
    inputs: &[PathBuf],
) -> anyhow::Result<()> {
    check_apart("pictures are", "-o", files, inputs)
}

/// The same of the film that frames become, which is to be no part of a scene either.
pub(super) fn check_film(file: Option<&Path>, inputs: &[PathBuf]) -> anyhow::Result<()> {
    check_apart("the film is", "--video", file, inputs)?;
    match file {
        None => Ok(()),
        Some(file) => check_file_in_no_part(file, "--video"),
    }
}

/// The same of whatever else is made: `what` begins the sentence, as in `the path is`, and `option` names the file.
pub(super) fn check_apart<'a>(
    what: &str,
    option: &str,
    files: impl IntoIterator<Item = &'a Path>,
    inputs: &[PathBuf],
) -> anyhow::Result<()> {
    let there: Vec<&Path> = files.into_iter().filter(|file| file.exists()).collect();
    if there.is_empty() {
        return Ok(());
    }
    let whole = |path: &Path| std::fs::canonicalize(path).ok();
    let inputs: BTreeSet<PathBuf> = inputs.iter().filter_map(|path| whole(path)).collect();
    let is_input = |file: &&&Path| whole(file).is_some_and(|file| inputs.contains(&file));
    match there.iter().find(is_input) {
        None => Ok(()),
        Some(file) => bail!(
            "{}: {what} made of this very file; nothing was written: choose another {option}",
            file.display()
        ),
    }
}

/// Fails where files are to be written into a folder that is a part of a scene, or lies in one: that scene could not be
/// imported again, as they would go with it. The option names it.
pub(super) fn check_in_no_part(folder: &Path, option: &str) -> anyhow::Result<()> {
    let whole = std::path::absolute(folder).unwrap_or_else(|_| PathBuf::from("."));
    check_no_part_around(&whole, folder, option)
}

/// The same of a file, and of the folder that it is to lie in.
pub(super) fn check_file_in_no_part(file: &Path, option: &str) -> anyhow::Result<()> {
    check_no_part_around(&std::path::absolute(file)?, file, option)
}

/// The same of an absolute path to a folder; `named` is what is to be written, as it was given.
fn check_no_part_around(whole: &Path, named: &Path, option: &str) -> anyhow::Result<()> {
    // With what is to be made in what is there.
    let there = whole.ancestors().find(|path| path.exists());
    let real = there.and_then(|there| {
        let missing = whole.strip_prefix(there).ok()?;
        Some(there.canonicalize().ok()?.join(missing))
    });
    let real = real.unwrap_or_else(|| whole.to_owned());
    match real.ancestors().find(|path| Scene::is_part(path)) {
        None => Ok(()),
        Some(part) => bail!(
            "{}: {} is part of a scene, and what else lies there keeps that from being imported again; choose another \
             {option}",
            named.display(),
            part.display()
        ),
    }
}

/// The innermost of the folders that a path is, or lies in, that is such a one, links followed.
pub(super) fn holder(path: &Path, is_such: impl Fn(&Path) -> bool) -> Option<PathBuf> {
    let whole = std::path::absolute(path).ok()?;
    // What is to be made, `house/film` or `../film`, lies in what is there.
    let there = whole.ancestors().find_map(|p| p.canonicalize().ok())?;
    let holder = there.ancestors().find(|folder| is_such(folder));
    holder.map(Path::to_owned)
}

/// Fails where pictures would lie among a scene's photos, masks or depth maps, for more of which an import would
/// take them.
pub(super) fn check_no_photos(folder: &Path, scene: &Scene) -> anyhow::Result<()> {
    // 1. Folders that hold nothing but photos, in whatever folders within. (Who keeps photos and model in one folder draws
    // beside them, too: an import tells of what is no photo there.)
    let of_photos = photo_folders(scene).into_iter();
    let of_photos = of_photos.filter(|folder| scene.capture.as_ref() != Some(folder));
    let of_photos: BTreeSet<PathBuf> = of_photos.filter_map(|f| f.canonicalize().ok()).collect();
    // 2. Those that some lie in directly, as masks, or photos of a flat capture.
    let folders_of = |photo: &Photo| {
        let beside = [
            &photo.ignore_mask,
            &photo.object_matte,
            &photo.silhouette,
            &photo.depth_map,
        ];
        let folder = |file: &PathBuf| file.parent().map(Path::to_owned);
        let beside = beside.into_iter().flatten().filter_map(folder);
        beside.chain(folder(&photo.path)).collect::<Vec<_>>()
    };
    let direct: BTreeSet<PathBuf> = scene.photos.iter().flat_map(folders_of).collect();
    let itself = folder.canonicalize().ok();
    let is_direct = |folder: &&PathBuf| {
        direct
            .iter()
            .any(|f| f.canonicalize().is_ok_and(|f| f == **folder))
    };
    let holds = holder(folder, |folder| of_photos.contains(folder));
    match holds.as_ref().or(itself.as_ref().filter(is_direct)) {
        None => Ok(()),
        Some(holds) => bail!(
            "{}: photos, masks or depth maps of this scene lie in {}, and an import would take pictures there for more \
             of them; choose another -o",
            folder.display(),
            holds.display()
        ),
    }
}

/// What to say of pictures that are none of those just written, for each folder that has some: of these folders, as
/// far as they are there, and those that files were written to. Films of all that lies there would show them, too.
///
/// # Errors
/// A folder cannot be read.
pub(super) fn others<'a>(
    folders: impl IntoIterator<Item = &'a Path>,
    files: &'a [PathBuf],
) -> anyhow::Result<Vec<String>> {
    let own: BTreeSet<&Path> = files.iter().map(PathBuf::as_path).collect();
    let written_to = files.iter().filter_map(|file| file.parent());
    let folders: BTreeSet<&Path> = folders.into_iter().chain(written_to).collect();
    let mut notes = Vec::new();
    for folder in folders.into_iter().filter(|folder| folder.is_dir()) {
        notes.extend(others_in(folder, &own)?);
    }
    Ok(notes)
}

/// The same of one folder, without those that lie in it.
fn others_in(folder: &Path, own: &BTreeSet<&Path>) -> anyhow::Result<Option<String>> {
    let failed = || folder.display().to_string();
    let mut others = Vec::new();
    for entry in std::fs::read_dir(folder).with_context(failed)? {
        let path = entry.with_context(failed)?.path();
        let is_picture = path.extension().is_some_and(|e| e == "png");
        if is_picture && !own.contains(path.as_path()) {
            others.extend(path.file_name().map(|name| name.display().to_string()));
        }
    }
    others.sort();
    let Some(first) = others.first() else {
        return Ok(None);
    };
    let folder = folder.display();
    Ok(Some(match others.len() {
        1 => format!("{first} in {folder} is not of this run"),
        count => format!("{count} pictures in {folder} are not of this run, as {first}"),
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn nothing_is_made_where_a_link_leads_nowhere() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::os::unix::fs::symlink("later", at("link")).unwrap();
        let said = "link: a link is where the folder was to be, and what it leads to is not there; choose another ";
        for (checked, option) in [
            (check_folder(&at("link")), "-o"),
            (check_folder(&at("link/scene")), "-o"),
            (check_new_folder(&at("link"), |_| false), "-o"),
            (check_file(&at("link/f.png"), "--video"), "--video"),
        ] {
            let error = checked.unwrap_err().to_string();
            assert!(error.ends_with(&format!("{said}{option}")), "{error}");
        }
        std::fs::create_dir(at("later")).unwrap();
        assert!(check_folder(&at("link/scene")).is_ok());
    }

    #[test]
    fn what_is_read_is_not_written_over() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::create_dir(at("images")).unwrap();
        std::fs::write(at("images/a.png"), "a").unwrap();
        let inputs = [at("images/a.png"), at("gone.png")];
        let check = |file: PathBuf| check_inputs([file.as_path()], &inputs);
        let error = check(at("images/../images/a.png")).unwrap_err().to_string();
        assert!(
            error.contains("a.png: pictures are made of this"),
            "{error}"
        );
        assert!(check(at("images/b.png")).is_ok());
        assert!(check(at("gone.png")).is_ok());

        assert!(check_folder(&at("new/er")).is_ok());
        assert!(check_folder(&at("images")).is_ok());
        let error = check_folder(&at("images/a.png/b")).unwrap_err().to_string();
        assert!(
            error.ends_with("a.png: a file is where the folder was to be; choose another -o"),
            "{error}"
        );
        // Nor is anything made.
        assert!(!at("new").exists());
        let names = |folder: &str| std::fs::read_dir(at(folder)).unwrap().count();
        assert_eq!(names("images"), 1);
        assert!(check_folder(Path::new("new")).is_ok());
        for (file, said) in [
            ("images/a.png/b", "a file is where the folder was to be"),
            ("images", "a folder is where the file was to be"),
        ] {
            let error = check_file(&at(file), "--video").unwrap_err().to_string();
            assert!(
                error.ends_with(&format!("{said}; choose another --video")),
                "{error}"
            );
        }
        assert!(check_file(&at("images/b.png"), "-o").is_ok());
        assert!(check_file(Path::new("b.png"), "-o").is_ok());
        if cfg!(target_os = "linux") {
            let error = check_file(Path::new("/proc/b.png"), "-o").unwrap_err();
            assert!(error.to_string().starts_with("/proc: cannot write: "));
            let error = check_scene_folder(Path::new("/proc")).unwrap_err();
            assert!(
                error
                    .to_string()
                    .ends_with("; give a file elsewhere with -o")
            );
            for device in ["/dev/null", "/dev/stdout"] {
                let error = check_file(Path::new(device), "-o").unwrap_err();
                let said = format!("{device}: no file, and would be replaced by one; ");
                assert!(error.to_string().starts_with(&said), "{error}");
            }
        }
        assert!(check_new_folder(&at("new/er"), |_| false).is_ok());
        assert!(check_new_folder(&at("images"), |_| true).is_ok());
        let error = check_new_folder(&at("images"), |_| false).unwrap_err();
        assert!(error.to_string().contains("the folder is not empty"));

        std::fs::create_dir(at("images/cam0")).unwrap();
        std::fs::write(at("images/cam0/b.png"), "b").unwrap();
        let others = |files: &[PathBuf]| {
            let notes = others([at("images").as_path()], files).unwrap();
            let first = |note: &String| note.split(" in ").next().unwrap().to_owned();
            notes.iter().map(first).collect::<Vec<String>>()
        };
        assert_eq!(others(&[at("images/a.png")]), [""; 0]);
        assert_eq!(others(&[]), ["a.png"]);
        // Folders within are others' unless something was written there.
        assert_eq!(others(&[at("images/cam0/a.png")]), ["a.png", "b.png"]);
        assert_eq!(others(&[at("images/gone/a.png")]), ["a.png"]);
    }
}
