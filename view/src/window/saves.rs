//! The path in files: saved when asked for, and at the end where it would be lost.

use super::{App, Event};
use crate::keyframes::Keyframes;
use crate::shot::make_folder;
use render::path::{
    CameraPath, KeyframeFile, NerfstudioFrame, read_keyframes, write_keyframes, write_nerfstudio,
};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

/// What of the path is in files.
pub(super) struct Saves {
    kept: Arc<Mutex<Kept>>,
    /// What writes the last one.
    thread: Option<JoinHandle<()>>,
    /// The folder for what cannot be written to the session's own at the end.
    elsewhere: PathBuf,
}

/// What was written, or opened.
struct Kept {
    /// The files' names, as soon as there are some.
    number: Option<u32>,
    /// The path as it was saved or opened last.
    path: Keyframes,
}

impl Saves {
    /// Of a path that was opened.
    pub(super) fn opened(path: Keyframes) -> Self {
        let kept = Kept { number: None, path };
        Self {
            kept: Arc::new(Mutex::new(kept)),
            thread: None,
            elsewhere: std::env::temp_dir().join(format!("lumigraph-view-{}", std::process::id())),
        }
    }

    /// Waits until all is written.
    pub(super) fn wait(&mut self) {
        if let Some(thread) = self.thread.take() {
            // A panic there was said on stderr.
            let _ = thread.join();
        }
    }
}

fn locked(kept: &Mutex<Kept>) -> MutexGuard<'_, Kept> {
    kept.lock().unwrap_or_else(PoisonError::into_inner)
}

impl App {
    /// On another thread: disks may be slow.
    pub(super) fn save_path(&mut self) {
        let Some(file) = self.path_file() else {
            self.status.said = Some("there is no view to save a path for".to_owned());
            return;
        };
        let folder = self.options.worker.output.clone();
        let tell = Arc::clone(&self.tell);
        let frame = self.options.nerfstudio;
        let opened = self.options.keyframes.clone();
        let kept = Arc::clone(&self.saves.kept);
        let path = self.state.keyframes.clone();
        let before = self.saves.thread.take();
        self.saves.thread = Some(std::thread::spawn(move || {
            // The last one asked for is the last one written.
            if let Some(before) = before {
                let _ = before.join();
            }
            let mut kept = locked(&kept);
            let of_session = kept.number;
            let number =
                of_session.unwrap_or_else(|| path_number(&folder, opened.as_ref(), &frame));
            let written = write_path(&folder, number, &file, &frame);
            if written.is_ok() {
                let number = Some(number);
                *kept = Kept { number, path };
            }
            let (Ok(said) | Err(said)) = written;
            tell(Event::Said(said));
        }));
    }

    fn path_file(&self) -> Option<KeyframeFile> {
        let keyframes = &self.state.keyframes;
        // Where there is nothing to show yet, or nothing to draw on, as of a window that is minimised.
        let view = self.state.view().or_else(|| keyframes.framing());
        let view = view.or_else(|| self.shown.as_ref().map(|shown| shown.view.clone()))?;
        Some(KeyframeFile {
            fps: keyframes.fps,
            keyframes: keyframes.stored(&view),
            interpolation: keyframes.interpolation,
        })
    }

    /// Saves a path that is in no file, to one of its own: nobody asked. Where the session's folder cannot be written
    /// to by now, it goes elsewhere, since nobody can choose another any more. What people should know of it, or why it
    /// is lost.
    pub(super) fn rescue_path(&mut self) -> Option<Result<String, String>> {
        self.saves.wait();
        let path = &self.state.keyframes;
        if path.is_empty() || path.is_same_path(&locked(&self.saves.kept).path) {
            return None;
        }
        let file = self.path_file()?;
        let frame = &self.options.nerfstudio;
        let write = |folder: &Path| {
            let number = path_number(folder, None, frame);
            write_path(folder, number, &file, frame)
        };
        let written = match write(&self.options.worker.output) {
            Ok(said) => Ok(said),
            Err(why) => match write(&self.saves.elsewhere) {
                Ok(said) => Ok(format!("{said}; where it was to be it cannot: {why}")),
                Err(other) => Err(format!("{why}; {other}")),
            },
        };
        if written.is_ok() {
            locked(&self.saves.kept).path = path.clone();
        }
        Some(written)
    }
}

/// The files of a path in a folder: `path.json`, `path_2.json` and so on, and nerfstudio's.
fn path_files(folder: &Path, number: u32) -> [PathBuf; 2] {
    ["path", "camera_path"].map(|name| match number {
        1 => folder.join(format!("{name}.json")),
        _ => folder.join(format!("{name}_{number}.json")),
    })
}

/// The first number whose files are not there, or are those that were opened.
fn path_number(folder: &Path, opened: Option<&KeyframeFile>, frame: &NerfstudioFrame) -> u32 {
    let is_opened = |path: &Path| {
        opened.is_some() && read_keyframes(path, frame).is_ok_and(|file| file.as_ref() == opened)
    };
    let is_ours = |number: &u32| match path_files(folder, *number) {
        // The other was written with it.
        [own, _] if own.exists() => is_opened(&own),
        [_, other] => !other.exists() || is_opened(&other),
    };
    (1..u32::MAX).find(is_ours).unwrap_or(u32::MAX)
}

/// Writes a path to a folder, and for nerfstudio beside it where it can have such lenses; what people
/// should know of it, or why it is not written.
fn write_path(
    folder: &Path,
    number: u32,
    file: &KeyframeFile,
    frame: &NerfstudioFrame,
) -> Result<String, String> {
    let [own, other] = path_files(folder, number);
    make_folder(folder)?;
    write_keyframes(&own, file).map_err(|error| error.to_string())?;
    let sampled = CameraPath::from_keyframes(&file.keyframes, file.interpolation, file.fps);
    let sampled = sampled.map_err(|error| format!("{}: {error}", own.display()))?;
    let written = write_nerfstudio(&other, &own, &sampled, Some(file), frame);
    let own = own.display();
    Ok(match written {
        Ok(()) => {
            let name = other.file_name().unwrap_or_default().to_string_lossy();
            format!("saved {own}; {name} is nerfstudio's")
        }
        Err(error) => format!("saved {own}, but not for nerfstudio: {error}"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::state::Action;
    use crate::window::tests::app;
    use calibrate::{Camera, Lens, ModelKind, Rigid3, View};
    use glam::DVec2;

    fn path(apart_s: f64) -> KeyframeFile {
        let view = View {
            lens: Lens::pinhole(DVec2::splat(40.0), DVec2::new(20.0, 15.0)),
            width: 40,
            height: 30,
            camera_from_world: Rigid3::IDENTITY,
        };
        let mut keyframes = Keyframes::default();
        keyframes.apart_s = apart_s;
        keyframes.add(Rigid3::IDENTITY, None);
        keyframes.add(Rigid3::IDENTITY, None);
        KeyframeFile {
            fps: keyframes.fps,
            keyframes: keyframes.stored(&view),
            interpolation: keyframes.interpolation,
        }
    }

    fn read(path: &Path) -> KeyframeFile {
        let read = read_keyframes(path, &NerfstudioFrame::default());
        read.unwrap().unwrap()
    }

    #[test]
    fn a_path_is_saved_over_no_other_than_the_one_opened() {
        let folder = tempfile::tempdir().unwrap();
        let (folder, frame) = (folder.path(), NerfstudioFrame::default());
        let number = |opened: Option<&KeyframeFile>| path_number(folder, opened, &frame);
        let [first, second] = [path(1.0), path(2.0)];
        assert_eq!(number(None), 1);
        let said = write_path(folder, 1, &first, &frame).unwrap();
        assert!(said.contains("path.json; camera_path.json"), "{said}");
        assert_eq!(number(None), 2);
        let said = write_path(folder, 2, &second, &frame).unwrap();
        assert!(said.contains("path_2.json; camera_path_2.json"), "{said}");
        assert_eq!((number(None), number(Some(&path(3.0)))), (3, 3));
        assert_eq!((number(Some(&first)), number(Some(&second))), (1, 2));
        // A path of nerfstudio's own viewer.
        std::fs::write(folder.join("camera_path_3.json"), "{}").unwrap();
        assert_eq!(number(None), 4);
    }

    #[test]
    fn what_was_opened_is_saved_as_it_was() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("path.json");
        let mut opened = path(2.0);
        for (keyframe, (t_s, focal)) in opened.keyframes.iter_mut().zip([(0.5, 40.0), (7.0, 80.0)])
        {
            keyframe.t_s = t_s;
            keyframe.camera = Camera {
                model: ModelKind::OpenCv,
                width: 400,
                height: 300,
                params: vec![focal, focal, 20.0, 15.0, 0.01, 0.0, 0.0, 0.0],
            };
        }
        write_keyframes(&file, &opened).unwrap();
        let mut app = app(folder.path().to_owned(), Some(read(&file)));
        app.save_path();
        app.saves.wait();
        assert_eq!(read(&file), opened);
        // Nerfstudio has no such lens.
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        app.end();
        assert_eq!(app.said, None);
    }

    #[test]
    fn what_is_in_no_file_is_saved_beside_at_the_end() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("path.json");
        write_keyframes(&file, &path(2.0)).unwrap();
        let mut app = app(folder.path().to_owned(), Some(read(&file)));
        app.state.act(Action::DeleteKeyframe);
        app.end();
        let said = app.said.take().unwrap();
        assert!(said.contains("path_2.json"), "{said}");
        let beside = read(&folder.path().join("path_2.json"));
        assert_eq!(beside.keyframes, path(2.0).keyframes[..1]);
        assert_eq!(read(&file), path(2.0));
        // Once is enough.
        app.end();
        assert!(app.said.is_none() && app.error.is_none());
        assert!(!folder.path().join("path_3.json").exists());
    }

    #[test]
    fn a_save_that_failed_keeps_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let in_the_way = folder.path().join("file");
        std::fs::write(&in_the_way, "").unwrap();
        let mut app = app(in_the_way.join("out"), Some(path(2.0)));
        app.saves.elsewhere = in_the_way.join("either");
        app.state.keyframes.apart_s = 3.0;
        app.save_path();
        app.saves.wait();
        // At the end it is tried again, and told where that fails, too.
        app.end();
        let error = app.error.take().unwrap().to_string();
        assert!(app.said.is_none() && error.contains("lost"), "{error}");
        let out = folder.path().join("out");
        app.options.worker.output = out.clone();
        let said = app.rescue_path().unwrap().unwrap();
        assert!(said.contains("path.json"), "{said}");
        assert_eq!(read(&out.join("path.json")), path(3.0));
        assert_eq!(app.rescue_path(), None);
    }

    #[test]
    fn what_cannot_be_saved_where_it_was_to_be_is_saved_elsewhere() {
        let folder = tempfile::tempdir().unwrap();
        let in_the_way = folder.path().join("file");
        std::fs::write(&in_the_way, "").unwrap();
        let mut app = app(in_the_way.clone(), Some(path(2.0)));
        let elsewhere = folder.path().join("elsewhere");
        app.saves.elsewhere = elsewhere.clone();
        app.state.keyframes.apart_s = 3.0;
        app.end();
        assert!(app.error.is_none());
        let said = app.said.take().unwrap();
        let file = elsewhere.join("path.json");
        assert!(
            said.starts_with(&format!("saved {}", file.display())),
            "{said}"
        );
        let why = format!("{}: this folder cannot be made", in_the_way.display());
        assert!(said.contains(&why), "{said}");
        assert_eq!(read(&file), path(3.0));
    }
}
