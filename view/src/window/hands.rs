//! What keys, buttons and the wheel do to the window and its state.

use super::App;
use crate::keys::{self, Key};
use crate::overlay::clicked;
use crate::panel::Command;
use crate::state::{Action, Button};
use calibrate::Pixel;
use winit::event::{ElementState, MouseButton, MouseScrollDelta, WindowEvent};
use winit::event_loop::ActiveEventLoop;
use winit::keyboard::{ModifiersState, PhysicalKey};

/// What is said where a key shows what interiors do not have.
const OF_SCENES: &str =
    "this key is for scenes: an interior has no field, no proxy and no photo beside it";

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
        let is_interior = self.state.space().is_some_and(|space| space.is_interior);
        if is_interior && !key.is_of_interiors() {
            self.status.said = Some(OF_SCENES.to_owned());
            return;
        }
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
            Key::Close | Key::Escape => {}
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

    /// Esc: closes the help where it is open; whether it is the window that is to be closed.
    fn escape(&mut self) -> bool {
        match &mut self.shows {
            Some(shows) => !std::mem::take(&mut shows.help),
            None => true,
        }
    }

    fn on_escape(&mut self, event_loop: &ActiveEventLoop) {
        if self.escape() {
            self.close(event_loop);
        }
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

    /// Whether the pointer is, where it is now.
    fn is_over_panels(&self) -> bool {
        let pane_and_pointer = self.pane.as_ref().zip(self.pointer);
        pane_and_pointer.is_some_and(|(pane, at)| pane.panels.takes(at))
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
                    // Held, it would close the help and then the window.
                    Some(Key::Escape) if is_down && !consumed && !event.repeat => {
                        self.on_escape(event_loop);
                    }
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
                if !is_down || !self.is_over_panels() {
                    self.on_button(button, is_down);
                }
            }
            WindowEvent::MouseWheel { delta, .. } if !self.is_over_panels() => {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::content::Space;
    use crate::content::tests::two_rooms;
    use crate::loader::Progress;
    use crate::panel::Shows;
    use crate::picture::Layer;
    use crate::window::tests::app;
    use std::path::PathBuf;
    use std::sync::Arc;
    use std::time::Duration;

    #[test]
    fn escape_closes_the_help_before_the_window() {
        let mut app = app(PathBuf::new(), None);
        assert!(app.escape(), "nothing is shown yet");
        app.shows = Some(Shows::fitting(2000.0));
        app.do_key(Key::Help, true, false);
        assert!(!app.escape());
        assert_eq!(app.shows, Some(Shows::fitting(2000.0)));
        assert!(app.escape());
        app.worker.end(Duration::from_secs(10));
    }

    #[test]
    fn what_interiors_do_not_have_no_key_shows() {
        let content = two_rooms();
        let space = Arc::new(Space::of(&content));
        let mut app = app(PathBuf::new(), None);
        app.shows = Some(Shows::fitting(2000.0));
        // Before anybody knows what it is.
        for key in [Key::Layer(Layer::Field), Key::Wipe] {
            app.do_key(key, true, false);
        }
        app.progress(Progress::Show(content, space));
        assert_eq!(app.state.look.layer, Layer::Picture);
        assert_eq!((app.state.wipe, &app.status.said), (None, &None));
        let before = app.state.look.clone();
        for key in [
            Key::Layer(Layer::Field),
            Key::Layer(Layer::Shaded),
            Key::Triangulation,
            Key::Wireframe,
            Key::Exact,
            Key::Epipoles,
            Key::Weights,
            Key::Wipe,
        ] {
            app.status.said = None;
            app.do_key(key, true, false);
            assert_eq!(app.status.said.as_deref(), Some(OF_SCENES), "{key:?}");
            assert_eq!(app.state.look, before, "{key:?}");
        }
        assert!(app.state.wipe.is_none() && !app.state.tells_weights);
        assert_eq!(app.shows, Some(Shows::fitting(2000.0)));
        // What they have, keys show.
        app.do_key(Key::Layer(Layer::Depth), true, false);
        assert_eq!(app.state.look.layer, Layer::Depth);
        app.worker.end(Duration::from_secs(10));
    }
}
