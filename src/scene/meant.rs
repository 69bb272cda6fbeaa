//! Which photos a calibration means by names that no photo has to the letter.

use super::home::IMAGES;
use super::import::ENOUGH;
use super::resized::is_resized;
use super::{Photo, Scene, Warning};
use calibrate::Reconstruction;
use capture::{
    CaptureError, Matched, PhotoFile, PhotoSet, as_argument, name_key, photo_size, stem_key,
};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// What lies there for such names.
#[derive(Debug, Default)]
pub(super) struct Meant {
    /// By the calibration's name: the photo that it surely means.
    pub(super) photos: BTreeMap<String, PhotoFile>,
    /// By the calibration's name: what is called nearly so and why it is not used, for messages.
    pub(super) near: BTreeMap<String, String>,
}

impl Meant {
    /// Looks for the photos of all names that none of those `found` has. Names that lead to one past other
    /// folders, as `../images/a.jpg`, become the photo's own, and so do those that all begin in a folder
    /// around the photos', as `images/a.jpg` do.
    ///
    /// A photo is meant where its name and the calibration's are the only ones that differ in letters'
    /// case or in how their marks are written alone, or else in what they end in, too, and it is as large
    /// as was calibrated. A `\` in its name is the `/` that calibrations' readers make of one.
    ///
    /// Of names that lead to photos from a folder within alone a message says how to import those: `home` is
    /// the folder that they are looked for in, and `calibration` where that is.
    pub(super) fn of(
        whole: &mut Reconstruction,
        found: &PhotoSet,
        home: &Path,
        calibration: &Path,
    ) -> Self {
        let names = whole.images.values_mut().map(|image| &mut image.name);
        name_as_found(&mut names.collect::<Vec<_>>(), found);
        // 1. Names without a photo, and photos without a name.
        let sizes = whole.images.values().map(|image| {
            let camera = &whole.cameras[&image.camera_id];
            (image.name.as_str(), (camera.width, camera.height))
        });
        let sizes: BTreeMap<&str, (u32, u32)> = sizes.collect();
        let names = sizes.keys().copied();
        let missing: Vec<&str> = names.filter(|name| found.find(name).is_none()).collect();
        let mut meant = Self::default();
        if missing.is_empty() {
            return meant;
        }
        let within = folder_within(&missing, found).filter(|_| missing.len() == sizes.len());
        let elsewhere = within.map_or_else(
            || IN_ANOTHER_FOLDER.to_owned(),
            |within| way_there(within, &sizes, found, home, calibration),
        );
        let is_free = |photo: &&PhotoFile| !sizes.contains_key(photo.name.as_str());
        let free: Vec<&PhotoFile> = found.photos.iter().filter(is_free).collect();

        // 2. Which of them belong together, the most alike first.
        let mut taken: BTreeSet<&str> = BTreeSet::new();
        let keys: [fn(&str) -> String; 3] = [name_key, stem_key, last_key];
        for (i, key) in keys.into_iter().enumerate() {
            let open = missing.iter().copied();
            let open = open.filter(|name| !meant.photos.contains_key(*name));
            let open = by_key(open, |name| key(name));
            let files = free.iter().copied();
            let files = files.filter(|photo| !taken.contains(photo.name.as_str()));
            let files = by_key(files, |photo| key(&photo.name.replace('\\', "/")));
            for (key, names) in open {
                let Some(files) = files.get(&key) else {
                    continue;
                };
                let why_not = match (&names[..], &files[..]) {
                    _ if keys.len() == i + 1 => elsewhere.clone(),
                    ([name], [file]) => match photo_size(&file.path) {
                        Ok(size) if size == sizes[name] => {
                            meant.photos.insert((*name).to_owned(), (*file).clone());
                            taken.insert(&file.name);
                            continue;
                        }
                        Ok((width, height)) => {
                            let (w, h) = sizes[name];
                            format!(
                                "called nearly so, but has {width} × {height} pixels where {w} × {h} \
                                 were calibrated"
                            )
                        }
                        Err(_) => "called nearly so, but cannot be read".to_owned(),
                    },
                    _ => NOT_ALONE.to_owned(),
                };
                let example = files[0].name.as_str();
                for name in names {
                    let near = || format!("{example} is {why_not}");
                    meant.near.entry(name.to_owned()).or_insert_with(near);
                }
            }
        }
        let Self { photos, near } = &mut meant;
        near.retain(|name, _| !photos.contains_key(name));
        meant
    }

    /// What belongs to photos, as `matching` finds it by names: by the calibration's, or else by that of the
    /// file that is meant.
    pub(super) fn matched(
        &self,
        names: &[&str],
        matching: impl Fn(&[&str]) -> Result<Matched, CaptureError>,
    ) -> Result<Matched, CaptureError> {
        let mut matched = matching(names)?;
        let mut open: BTreeMap<&str, &str> = BTreeMap::new();
        for (name, file) in &self.photos {
            if !matched.by_photo.contains_key(name) {
                open.insert(&file.name, name);
            }
        }
        if open.is_empty() {
            return Ok(matched);
        }
        let files: Vec<&str> = open.keys().copied().collect();
        let Matched {
            by_photo,
            unmatched,
        } = matching(&files)?;
        let taken: BTreeSet<PathBuf> = matched.by_photo.values().cloned().collect();
        for (file, path) in by_photo {
            if !taken.contains(&path) {
                let name = open[file.as_str()].to_owned();
                matched.by_photo.insert(name, path);
            }
        }
        let unmatched: BTreeSet<String> = unmatched.into_iter().collect();
        matched.unmatched.retain(|name| unmatched.contains(name));
        Ok(matched)
    }

    /// What to say of photos that are used under another name, if there are any.
    pub(super) fn note(&self, total: usize) -> Option<Warning> {
        let (name, photo) = self.photos.first_key_value()?;
        let has_other_slash = |photo: &PhotoFile| photo.name.contains('\\');
        let slashes = match self.photos.values().any(has_other_slash) {
            true => " in `\\` for `/`,",
            false => "",
        };
        Some(Warning::Note(format!(
            "{} of {total} photos are used though their files' names differ from the calibration's in \
             letters' case,{slashes} in how marks are written, or in what they end in ({} for {name}, for one)",
            self.photos.len(),
            photo.name
        )))
    }
}

impl Scene {
    /// Gives names that a calibration of this scene's photos has for them those that the import gives them:
    /// `../images/a.jpg`, which leads to a photo past other folders, and `images/a.jpg`, where all names begin
    /// so, become `a.jpg`. Names of anything else stay.
    pub fn name_as_photos(&self, names: &mut [&mut String]) {
        if let Some(found) = self.as_found() {
            name_as_found(names, &found);
        }
    }

    /// The photos where the capture has them; `None` where that is not known.
    fn as_found(&self) -> Option<PhotoSet> {
        if self.settings.undistorted {
            // These lie elsewhere.
            return Self::photos_of(self.capture.as_ref()?).ok();
        }
        let root_of = |name: &str, path: &Path| {
            let depth = Path::new(name).components().count();
            let root = path.ancestors().nth(depth)?;
            path.ends_with(name).then(|| root.to_owned())
        };
        let mut photos = self.photos.iter();
        let root = photos.find_map(|photo| root_of(&photo.name, &photo.path))?;
        // A scene's photos are named by the way from its own folder.
        let root = if self.folder.is_some() {
            root.canonicalize().unwrap_or(root)
        } else {
            root
        };
        let file = |photo: &Photo| PhotoFile {
            name: photo.name.clone(),
            path: photo.path.clone(),
        };
        let photos = self.photos.iter().map(file).collect();
        Some(PhotoSet { root, photos })
    }
}

/// Why a photo is not used that is called nearly as one is that is missing.
const NOT_ALONE: &str =
    "called nearly so, but others are, too: give the one that is meant that very name";
const IN_ANOTHER_FOLDER: &str =
    "called so in another folder: names in a calibration begin in the folder of all photos";

/// The one folder within the photos' from which names lead to photos, where there is no other, and how many do;
/// `None` if they are too few for a scene.
fn folder_within<'f>(names: &[&str], found: &'f PhotoSet) -> Option<(&'f str, usize)> {
    let names: BTreeSet<&str> = names.iter().copied().collect();
    let mut folders: BTreeMap<&str, usize> = BTreeMap::new();
    for photo in &found.photos {
        for (at, _) in photo.name.match_indices('/') {
            if names.contains(&photo.name[at + 1..]) {
                *folders.entry(&photo.name[..at]).or_default() += 1;
            }
        }
    }
    let (folder, count) = folders.pop_first()?;
    (folders.is_empty() && count >= ENOUGH).then_some((folder, count))
}

/// How to have so many of all photos used that names, each with the size that was calibrated, lead to from a folder
/// within the photos'.
fn way_there(
    (folder, count): (&str, usize),
    sizes: &BTreeMap<&str, (u32, u32)>,
    found: &PhotoSet,
    home: &Path,
    calibration: &Path,
) -> String {
    let folder = found.root.join(folder);
    let is_reduced = |(name, calibrated): (&&str, &(u32, u32))| {
        let size = photo_size(&folder.join(name));
        size.is_ok_and(|size| is_resized(size, *calibrated))
    };
    let option = match sizes.iter().any(is_reduced) {
        true => " --resized",
        false => "",
    };
    // What lies beside the photos is found again only where they are called so.
    let rename = if found.root == home && option.is_empty() {
        let images = home.join(IMAGES);
        format!("rename {} to {}, or ", folder.display(), images.display())
    } else {
        String::new()
    };
    format!(
        "called so in another folder, as {count} of {} are: {rename}`lumigraph import {} \
         --calibration {}{option} -o SCENE`",
        sizes.len(),
        as_argument(&folder),
        as_argument(calibration)
    )
}

/// Of what a name ends in after its last `/`.
fn last_key(name: &str) -> String {
    name_key(name.rsplit('/').next().unwrap_or(name))
}

fn by_key<T>(
    items: impl Iterator<Item = T>,
    key: impl Fn(&T) -> String,
) -> BTreeMap<String, Vec<T>> {
    let mut all: BTreeMap<String, Vec<T>> = BTreeMap::new();
    for item in items {
        all.entry(key(&item)).or_default().push(item);
    }
    all
}

/// Makes names what the photos are called that they mean without doubt.
fn name_as_found(names: &mut [&mut String], found: &PhotoSet) {
    name_directly(names, found);
    name_from_within(names, found);
}

/// Makes names that lead to a photo past other folders, or to where one is missing, that photo's own, unless
/// another has it.
fn name_directly(names: &mut [&mut String], found: &PhotoSet) {
    let is_detour = |name: &str| name.split('/').any(|part| matches!(part, "" | "." | ".."));
    if !names.iter().any(|name| is_detour(name.as_str())) {
        return;
    }
    let mut taken: BTreeSet<String> = names.iter().map(|name| (**name).clone()).collect();
    let real = |path: &Path| path.canonicalize().ok();
    let files = found.photos.iter();
    let files = files.filter_map(|photo| Some((real(&photo.path)?, photo.name.as_str())));
    let files: BTreeMap<PathBuf, &str> = files.collect();
    let root = real(&found.root);
    for name in names.iter_mut() {
        if !is_detour(name.as_str()) {
            continue;
        }
        let path = found.root.join(name.as_str());
        let file = real(&path);
        let own = file.and_then(|file| files.get(&file).map(|own| (*own).to_owned()));
        let own = own.or_else(|| name_in(root.as_deref()?, &path));
        if let Some(own) = own.filter(|own| taken.insert(own.clone())) {
            **name = own;
        }
    }
}

/// What a file is called in a folder that it lies in, or would; `/` between the parts.
fn name_in(real_folder: &Path, file: &Path) -> Option<String> {
    let around = file.parent()?.canonicalize().ok()?;
    let name = around.strip_prefix(real_folder).ok()?;
    let name = name.join(file.file_name()?);
    let parts: Option<Vec<&str>> = name.iter().map(|part| part.to_str()).collect();
    Some(parts?.join("/"))
}

/// Shortens names that all begin in one of the folders around the photos, where COLMAP was given that: in the
/// folder `images`, `images/a.jpg` is `a.jpg`.
fn name_from_within(names: &mut [&mut String], found: &PhotoSet) {
    let Some(start) = start_outside(names, found) else {
        return;
    };
    for name in names {
        name.drain(..start.len());
    }
}

/// What all names begin with that leads to the photos' folder from one around it; `None` unless with it none is
/// found, and without it some are.
fn start_outside(names: &[&mut String], found: &PhotoSet) -> Option<String> {
    let names: Vec<&str> = names.iter().map(|name| name.as_str()).collect();
    let is_found = |name: &str| found.find(name).is_some();
    if names.iter().any(|name| is_found(name)) {
        return None;
    }
    let root = std::path::absolute(&found.root).ok()?;
    let mut start = String::new();
    for folder in root.iter().rev() {
        start.insert_str(0, &format!("{}/", folder.to_str()?));
        let rests = names.iter().map(|name| name.strip_prefix(start.as_str()));
        let rests: Option<Vec<&str>> = rests.collect();
        if rests.is_some_and(|rests| rests.into_iter().any(is_found)) {
            return Some(start);
        }
    }
    None
}
