//! What `--resume` keeps beside a film's frames: what all of them are made of, and without.

use super::super::output::{make_parent, write_file};
use super::super::stamp::{Stamp, changes, in_unicode, stamps};
use anyhow::{Context, anyhow, bail};
use capture::hold::hold;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{ErrorKind, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// What the frames of a folder were made with.
#[derive(Serialize, Deserialize)]
struct Plan {
    version: String,
    arguments: Vec<String>,
    /// All frames of the film, from its folder; none of earlier versions.
    #[serde(default)]
    frames: Vec<PathBuf>,
    /// None of earlier versions.
    #[serde(default)]
    inputs: Vec<Stamp>,
    /// Photos among them that were found damaged, with what is wrong with each: frames are made without.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    left_out: BTreeMap<String, String>,
}

/// Where a run says what it makes.
fn file_in(folder: &Path) -> PathBuf {
    folder.join("resume.json")
}

/// A picture as a plan in a folder names it.
fn name_in(folder: &Path, picture: &Path) -> PathBuf {
    in_unicode(picture.strip_prefix(folder).unwrap_or(picture))
}

impl Plan {
    /// This run's, for a film of these frames in a folder, without what decides no pixel.
    fn own(folder: &Path, frames: &[PathBuf], inputs: &[PathBuf]) -> Self {
        const ALONE: [&str; 3] = ["--resume", "--json", "--no-ldi-files"];
        const WITH_VALUE: [&str; 4] = ["--video", "--fps", "--threads", "--frames"];
        let mut arguments = Vec::new();
        // `--fps=30` is `--fps 30`.
        let apart = |argument: String| match argument.split_once('=') {
            Some((name, value)) if name.starts_with("--") => {
                vec![name.to_owned(), value.to_owned()]
            }
            _ => vec![argument],
        };
        // What is no Unicode is replaced: paths may be anything.
        let given = std::env::args_os().skip(1);
        let given = given.map(|argument| argument.to_string_lossy().into_owned());
        let mut given = given.flat_map(apart);
        while let Some(argument) = given.next() {
            if WITH_VALUE.contains(&argument.as_str()) {
                // How many frames a derived path has does.
                let value = given.next();
                let all = value.filter(|_| argument == "--frames");
                let all = all.map(|v| v.split_once('/').map_or(v.clone(), |(_, n)| n.to_owned()));
                arguments.extend(all.filter(|v| !v.contains("..")));
            } else if !ALONE.contains(&argument.as_str()) {
                arguments.push(argument);
            }
        }
        let mut inputs = stamps(inputs, in_unicode);
        inputs.dedup();
        Self {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            arguments,
            frames: frames.iter().map(|frame| name_in(folder, frame)).collect(),
            inputs,
            left_out: BTreeMap::new(),
        }
    }

    fn of(folder: &Path) -> anyhow::Result<Self> {
        let file = file_in(folder);
        let named = || file.display().to_string();
        let bytes = std::fs::read(&file).with_context(named)?;
        serde_json::from_slice(&bytes).with_context(named)
    }

    /// The same of a film that this run has begun: that the plan is gone is said with what to do.
    fn of_begun(folder: &Path) -> anyhow::Result<Self> {
        Self::of(folder).map_err(|error| {
            let io = error.downcast_ref::<std::io::Error>();
            if io.is_none_or(|io| io.kind() != ErrorKind::NotFound) {
                return error;
            }
            anyhow!(
                "{}: resume.json is gone: a run without --resume put a picture in the place of one of these frames \
                 meanwhile. What this run drew stays; draw the others again with --frames and without --resume, or \
                 the film in another folder",
                folder.display()
            )
        })
    }

    fn write(&self, folder: &Path) -> anyhow::Result<()> {
        write_file(&file_in(folder), &serde_json::to_vec_pretty(self)?)
    }
}

/// Begins a film of these frames, all that it has, made of the files `inputs`, in a folder, or goes on with it.
///
/// # Errors
/// What is there was made by another command line, or of other files.
pub(super) fn begin(folder: &Path, frames: &[PathBuf], inputs: &[PathBuf]) -> anyhow::Result<()> {
    let file = file_in(folder);
    let own = Plan::own(folder, frames, inputs);
    make_parent(&file)?;
    let _held = hold(folder);
    match std::fs::read(&file) {
        Ok(bytes) => {
            let plan: Option<Plan> = serde_json::from_slice(&bytes).ok();
            let is_same = |p: &Plan| p.version == own.version && p.arguments == own.arguments;
            let Some(mut plan) = plan.filter(is_same) else {
                bail!(
                    "{}: the frames in this folder were made by another command line; choose \
                     another folder, or remove this one",
                    file.display()
                );
            };
            let changes = changes(&plan.inputs, &own.inputs);
            if !(plan.inputs.is_empty() || changes.is_empty()) {
                bail!(
                    "{}: the frames in this folder were made of other files: {changes}; choose \
                     another folder, or remove this one",
                    file.display()
                );
            }
            if plan.frames == own.frames {
                return Ok(());
            }
            plan.frames = own.frames;
            plan.write(folder)
        }
        Err(_) if frames.iter().any(|f| f.exists()) => bail!(
            "{}: there are frames here, but no resume.json: a run without --resume made some of them; choose \
             another folder, or remove this one",
            folder.display()
        ),
        Err(_) => own.write(folder),
    }
}

/// A film that was given up, and a hold on its folder.
pub(super) struct GivenUp {
    pub(super) folder: PathBuf,
    _held: Option<File>,
}

/// Gives up the films, in the folders that a picture is to lie in, that have it for a frame, as it takes that frame's
/// place, whether or not it is drawn yet: [`begin`] refuses to go on with them. What comes back is to be kept until the
/// picture is written, so that no run begins before. What is no plan is somebody else's file, and stays.
///
/// # Errors
/// A film's plan cannot be removed.
pub(super) fn give_up(picture: &Path) -> anyhow::Result<Vec<GivenUp>> {
    let whole = std::path::absolute(picture).unwrap_or_else(|_| picture.to_owned());
    let mut given_up = Vec::new();
    for folder in whole.ancestors().skip(1) {
        let name = name_in(folder, &whole);
        let is_frame = || Plan::of(folder).is_ok_and(|plan| plan.frames.contains(&name));
        if !is_frame() {
            continue;
        }
        let held = hold(folder);
        // Another run may have given it up meanwhile.
        if is_frame() {
            remove(&[file_in(folder)])?;
            given_up.push(GivenUp {
                folder: folder.to_owned(),
                _held: held,
            });
        }
    }
    Ok(given_up)
}

/// The photos that the frames in a folder are made without, as some run found them damaged: by name, with what is
/// wrong with each.
///
/// # Errors
/// The file beside the frames cannot be read, or is gone, as another run has given the film up.
pub(super) fn left_out(folder: &Path) -> anyhow::Result<BTreeMap<String, String>> {
    Ok(Plan::of_begun(folder)?.left_out)
}

/// Goes on without photos that were found damaged, for all runs that share a folder: where none of them knew,
/// every frame of the film that is there (`all`) is removed, and else those of this run (`own`).
///
/// # Errors
/// Files cannot be read, written or removed; as [`left_out`], and then no frame is removed.
pub(super) fn leave_out(
    damaged: &BTreeMap<String, String>,
    folder: &Path,
    own: &[PathBuf],
    all: &[PathBuf],
) -> anyhow::Result<()> {
    let _held = hold(folder);
    let mut plan = Plan::of_begun(folder)?;
    let known = plan.left_out.len();
    plan.left_out.extend(damaged.clone());
    if plan.left_out.len() == known {
        return remove(own);
    }
    // Before, so that none stays if it ends here; and after, as another run may not have known it.
    remove(all)?;
    plan.write(folder)?;
    remove(all)
}

/// Whether a frame is there, and begins and ends as a PNG. It takes its name only when it is complete, but after a loss
/// of power, or where a copy was cut short, it may be empty, or end early.
pub(super) fn is_whole(frame: &Path) -> bool {
    const BEGIN: [u8; 8] = *b"\x89PNG\r\n\x1a\n";
    const END: [u8; 12] = *b"\0\0\0\0IEND\xaeB`\x82";
    let read = || -> std::io::Result<bool> {
        let mut file = File::open(frame)?;
        let mut begin = [0; BEGIN.len()];
        file.read_exact(&mut begin)?;
        file.seek(SeekFrom::End(-(END.len() as i64)))?;
        let mut end = [0; END.len()];
        file.read_exact(&mut end)?;
        Ok(begin == BEGIN && end == END)
    };
    read().unwrap_or(false)
}

/// Removes those frames that are there.
pub(super) fn remove(frames: &[PathBuf]) -> anyhow::Result<()> {
    for frame in frames {
        match std::fs::remove_file(frame) {
            Err(error) if error.kind() != ErrorKind::NotFound => {
                return Err(error).with_context(|| format!("{}: cannot remove", frame.display()));
            }
            _ => {}
        }
    }
    Ok(())
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::sync::Barrier;

    #[test]
    fn what_several_runs_find_at_once_is_all_kept() {
        let folder = tempfile::tempdir().unwrap();
        begin(folder.path(), &[], &[]).unwrap();
        let names: Vec<String> = (0..8).map(|i| format!("{i}.png")).collect();
        let start = Barrier::new(names.len());
        std::thread::scope(|scope| {
            for name in &names {
                let (start, folder) = (&start, folder.path());
                scope.spawn(move || {
                    let damaged = BTreeMap::from([(name.clone(), "cut short".to_owned())]);
                    start.wait();
                    leave_out(&damaged, folder, &[], &[]).unwrap();
                });
            }
        });
        assert!(left_out(folder.path()).unwrap().keys().eq(&names));
    }

    #[test]
    fn a_run_whose_film_is_given_up_keeps_its_frames_and_says_what_to_do() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let frames = ["cam0/0.png", "cam0/1.png"].map(|name| folder.join(name));
        begin(folder, &frames, &[]).unwrap();
        std::fs::create_dir(folder.join("cam0")).unwrap();
        std::fs::write(&frames[0], "a frame").unwrap();
        // Of other names, or beside it.
        for other in ["cam0/2.png", "0.png", "cam0/0.svg", "cam0/cam0/0.png"] {
            assert!(give_up(&folder.join(other)).unwrap().is_empty(), "{other}");
        }
        assert_eq!(left_out(folder).unwrap(), BTreeMap::new());
        // Which is not there yet.
        let given_up = give_up(&frames[1]).unwrap();
        assert_eq!(given_up.len(), 1);
        assert_eq!(given_up[0].folder, folder);
        drop(given_up);
        assert!(give_up(&frames[1]).unwrap().is_empty());
        let damaged = BTreeMap::from([("a.png".to_owned(), "cut short".to_owned())]);
        let errors = [
            left_out(folder).unwrap_err(),
            leave_out(&damaged, folder, &frames, &frames).unwrap_err(),
        ];
        for error in errors.map(|error| error.to_string()) {
            let said = format!("{}: resume.json is gone: ", folder.display());
            assert!(error.starts_with(&said), "{error}");
        }
        assert!(frames[0].exists());
        let error = begin(folder, &frames, &[]).unwrap_err().to_string();
        assert!(error.contains("but no resume.json"), "{error}");
    }
}
