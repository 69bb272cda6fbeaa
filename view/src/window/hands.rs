//! What keys, buttons and the wheel do to the window and its state.

use super::{App, Event};
use crate::keyframes::Keyframes;
use crate::keys::{self, Key};
use crate::overlay::clicked;
use crate::panel::Command;
use crate::state::{Action, Button};
use calibrate::Pixel;
use render::path::{
    CameraPath, KeyframeFile, NerfstudioFrame, PathFileError, read_keyframes, write_keyframes,
    write_nerfstudio,
};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use winit::event::{ElementState, MouseButton, MouseScrollDelta, WindowEvent};
use winit::event_loop::ActiveEventLoop;
use winit::keyboard::{ModifiersState, PhysicalKey};

/// What of the path is in files.
#[derive(Default)]
pub(super) struct Saves {
    /// The files' names, as soon as there are some.
    number: Arc<Mutex<Option<u32>>>,
    /// The path as it was saved or opened last.
    kept: Keyframes,
    /// What writes the last one.
    thread: Option<JoinHandle<()>>,
}

impl Saves {
    /// Of a path that was opened.
    pub(super) fn opened(kept: Keyframes) -> Self {
        Self {
            kept,
            ..Self::default()
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

/// So near, in pixels, the wipe is taken hold of.
const WIPE_PX: f64 = 8.0;

impl App {
    fn do_key(&mut self, key: Key, is_down: bool, is_repeated: bool) {
        if let Key::Hold(motion) = key {
            self.state.hold(motion, is_down);
            return;
        }
        if !is_down || is_repeated {
            return;
        }
        let Some(shows) = &mut self.shows else {
            return;
        };
        let look = &mut self.state.look;
        let flip = |value: &mut bool| *value = !*value;
        match key {
            Key::Hold(_) => {}
            Key::Act(action) => self.state.act(action),
            Key::Layer(layer) => {
                look.layer = if look.layer == layer {
                    Default::default()
                } else {
                    layer
                };
            }
            Key::Triangulation => flip(&mut look.triangulation),
            Key::Wireframe => flip(&mut look.wireframe),
            Key::Exact => {
                let is_exact = look.method == render::Method::Exact;
                self.state.set_exact(!is_exact);
            }
            Key::Weights => flip(&mut self.state.tells_weights),
            Key::Wipe => {
                self.state.wipe = match self.state.wipe {
                    Some(_) => None,
                    None => Some(0.5),
                }
            }
            Key::Epipoles => flip(&mut shows.epipoles),
            Key::Frusta => flip(&mut shows.frusta),
            Key::Plan => flip(&mut shows.plan),
            Key::Panel => flip(&mut shows.panel),
            Key::Hud => flip(&mut shows.hud),
            Key::Help => flip(&mut shows.help),
            Key::Shoot => self.do_command(Command::Shoot),
            Key::SavePath => self.do_command(Command::SavePath),
            Key::LoseDevice => {
                if let (Some(pane), true) = (&self.pane, self.trace.is_some()) {
                    pane.screen.lose();
                }
            }
            Key::Close => {}
        }
    }

    pub(super) fn do_command(&mut self, command: Command) {
        match command {
            Command::Act(action) => self.state.act(action),
            Command::Shoot => {
                // Of where one is now.
                if let Some(request) = self.state.wanted() {
                    self.worker.ask(request);
                }
                self.worker.shoot();
            }
            Command::SavePath => self.save_path(),
        }
    }

    /// On another thread: disks may be slow.
    fn save_path(&mut self) {
        let Some(file) = self.path_file() else {
            self.status.said = Some("there is no view to save a path for".to_owned());
            return;
        };
        let folder = self.options.worker.output.clone();
        let tell = Arc::clone(&self.tell);
        let frame = self.options.nerfstudio;
        let opened = self.options.keyframes.clone();
        let number = Arc::clone(&self.saves.number);
        let before = self.saves.thread.take();
        self.saves.kept = self.state.keyframes.clone();
        self.saves.thread = Some(std::thread::spawn(move || {
            // The last one asked for is the last one written.
            if let Some(before) = before {
                let _ = before.join();
            }
            let mut number = number.lock().unwrap_or_else(PoisonError::into_inner);
            let of_session =
                number.get_or_insert_with(|| path_number(&folder, opened.as_ref(), &frame));
            let said = write_path(&folder, *of_session, &file, &frame);
            tell(Event::Said(said));
        }));
    }

    fn path_file(&self) -> Option<KeyframeFile> {
        let view = self.state.view()?;
        let keyframes = &self.state.keyframes;
        Some(KeyframeFile {
            fps: keyframes.fps,
            keyframes: keyframes.stored(&view),
            interpolation: keyframes.interpolation,
        })
    }

    /// Saves a path that is in no file, to one of its own: nobody asked. What people should know
    /// of it.
    pub(super) fn rescue_path(&mut self) -> Option<String> {
        let keyframes = &self.state.keyframes;
        if keyframes.is_empty() || keyframes.is_same_path(&self.saves.kept) {
            return None;
        }
        let file = self.path_file()?;
        self.saves.wait();
        let (folder, frame) = (&self.options.worker.output, &self.options.nerfstudio);
        let number = path_number(folder, None, frame);
        let said = write_path(folder, number, &file, frame);
        self.saves.kept = self.state.keyframes.clone();
        Some(said)
    }

    fn width(&self) -> f64 {
        let size = self.window.as_ref().map(|window| window.inner_size());
        size.map_or(1.0, |size| f64::from(size.width.max(1)))
    }

    fn on_pointer(&mut self, at: Option<Pixel>) {
        self.pointer = at;
        match at {
            Some(at) if self.holds_wipe => {
                self.state.wipe = Some((at.x / self.width()).clamp(0.0, 1.0));
            }
            _ => self.state.point(at),
        }
    }

    fn on_button(&mut self, button: MouseButton, is_down: bool) {
        let Some(at) = self.pointer else {
            return;
        };
        let button = match button {
            MouseButton::Left => Button::Left,
            _ => Button::Other,
        };
        if !is_down {
            self.holds_wipe = false;
            let click = self
                .state
                .release(button)
                .filter(|_| button == Button::Left);
            let has_frusta = self.shows.as_ref().is_some_and(|s| s.frusta);
            let view = self.shown.as_ref().map(|s| &s.view);
            if let (Some(at), true, Some(view), Some(space)) =
                (click, has_frusta, view, self.state.space())
                && let Some(stop) = clicked(space, view, at).filter(|_| !space.is_interior)
            {
                self.state.act(Action::Go(stop));
            }
            return;
        }
        let wipe = self.state.wipe.map(|share| share * self.width());
        if wipe.is_some_and(|x| (x - at.x).abs() < WIPE_PX) && button == Button::Left {
            self.holds_wipe = true;
        } else {
            self.state.press(button, at, self.modifiers.shift_key());
        }
    }

    /// Whatever else happens to a window than that it is to be drawn.
    pub(super) fn on_event(&mut self, event_loop: &ActiveEventLoop, event: WindowEvent) {
        let key = match &event {
            // With the focus come keys that were pressed elsewhere.
            WindowEvent::KeyboardInput {
                event,
                is_synthetic: true,
                ..
            } if event.state == ElementState::Pressed => None,
            WindowEvent::KeyboardInput { event, .. } => match event.physical_key {
                // What was pressed must be released, whatever else is held by then.
                PhysicalKey::Code(code) if event.state == ElementState::Released => {
                    keys::of(code, ModifiersState::empty())
                }
                PhysicalKey::Code(code) => keys::of(code, self.modifiers),
                PhysicalKey::Unidentified(_) => None,
            },
            _ => None,
        };
        // egui would move its focus by it.
        let is_ours = key == Some(Key::Panel);
        let consumed = match &mut self.pane {
            Some(pane) if !is_ours => pane.input.on_window_event(&pane.window, &event).consumed,
            _ => false,
        };
        match event {
            WindowEvent::CloseRequested | WindowEvent::Destroyed => self.close(event_loop),
            WindowEvent::Resized(size) => self.resize(size.width, size.height),
            WindowEvent::ScaleFactorChanged { scale_factor, .. } => {
                self.rescale(scale_factor as f32);
            }
            WindowEvent::Focused(false) => self.state.let_go(),
            WindowEvent::ModifiersChanged(modifiers) => self.modifiers = modifiers.state(),
            WindowEvent::KeyboardInput { event, .. } => {
                let is_down = event.state == ElementState::Pressed;
                match key {
                    Some(Key::Close) if is_down && !consumed => self.close(event_loop),
                    Some(key) if !consumed || !is_down => {
                        self.do_key(key, is_down, event.repeat);
                    }
                    _ => {}
                }
            }
            WindowEvent::CursorMoved { position, .. } => {
                let at = Pixel::new(position.x, position.y);
                self.on_pointer((!consumed).then_some(at));
                self.pointer = Some(at);
            }
            WindowEvent::CursorLeft { .. } => self.on_pointer(None),
            WindowEvent::MouseInput { state, button, .. } => {
                let is_down = state == ElementState::Pressed;
                if !consumed || !is_down {
                    self.on_button(button, is_down);
                }
            }
            WindowEvent::MouseWheel { delta, .. } if !consumed => {
                let notches = match delta {
                    MouseScrollDelta::LineDelta(_, y) => f64::from(y),
                    MouseScrollDelta::PixelDelta(by) => by.y / 50.0,
                };
                if let Some(at) = self.pointer {
                    self.state.wheel(notches, at);
                }
            }
            _ => {}
        }
        self.redraw();
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

/// Writes a path to a folder, and for nerfstudio beside it; what people should know of it.
fn write_path(folder: &Path, number: u32, file: &KeyframeFile, frame: &NerfstudioFrame) -> String {
    let [own, other] = path_files(folder, number);
    if let Err(error) = std::fs::create_dir_all(folder) {
        return format!("{}: {error}", folder.display());
    }
    let written = write_keyframes(&own, file).and_then(|()| {
        let sampled = CameraPath::from_keyframes(&file.keyframes, file.interpolation, file.fps);
        let sampled = sampled.map_err(|error| PathFileError::Path(own.clone(), error))?;
        write_nerfstudio(&other, &sampled, Some(file), frame)
    });
    match written {
        Ok(()) => {
            let name = other.file_name().unwrap_or_default().to_string_lossy();
            format!("saved {}; {name} is nerfstudio's", own.display())
        }
        Err(error) => error.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use calibrate::{Lens, Rigid3, View};
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
        keyframes.add(Rigid3::IDENTITY);
        keyframes.add(Rigid3::IDENTITY);
        KeyframeFile {
            fps: keyframes.fps,
            keyframes: keyframes.stored(&view),
            interpolation: keyframes.interpolation,
        }
    }

    #[test]
    fn a_path_is_saved_over_no_other_than_the_one_opened() {
        let folder = tempfile::tempdir().unwrap();
        let (folder, frame) = (folder.path(), NerfstudioFrame::default());
        let number = |opened: Option<&KeyframeFile>| path_number(folder, opened, &frame);
        let [first, second] = [path(1.0), path(2.0)];
        assert_eq!(number(None), 1);
        let said = write_path(folder, 1, &first, &frame);
        assert!(said.contains("path.json; camera_path.json"), "{said}");
        assert_eq!(number(None), 2);
        let said = write_path(folder, 2, &second, &frame);
        assert!(said.contains("path_2.json; camera_path_2.json"), "{said}");
        assert_eq!((number(None), number(Some(&path(3.0)))), (3, 3));
        assert_eq!((number(Some(&first)), number(Some(&second))), (1, 2));
        // A path of nerfstudio's own viewer.
        std::fs::write(folder.join("camera_path_3.json"), "{}").unwrap();
        assert_eq!(number(None), 4);
    }
}
