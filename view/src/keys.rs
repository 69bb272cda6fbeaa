//! Which key does what, by its place on the keyboard.

use crate::picture::Layer;
use crate::state::{Action, Mode, Motion};
use winit::keyboard::{KeyCode, ModifiersState};

/// What a key does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Key {
    /// As long as it is held.
    Hold(Motion),
    /// Once.
    Act(Action),
    /// Shows a layer, or the picture again.
    Layer(Layer),
    /// The field's triangulation.
    Triangulation,
    /// Other cameras' centres.
    Epipoles,
    /// The proxy's edges.
    Wireframe,
    /// The exact field, or the triangulated one.
    Exact,
    /// Which photos paint the pixel under the cursor.
    Weights,
    /// The nearest photo beside the picture.
    Wipe,
    /// The photos' cameras, or the portals.
    Frusta,
    /// The floor plan.
    Plan,
    /// The panel.
    Panel,
    /// Times.
    Hud,
    /// Which key does what.
    Help,
    /// A screenshot.
    Shoot,
    /// Saves the path.
    SavePath,
    /// Lets the graphics device be lost, where frames are traced: for tests.
    LoseDevice,
    /// Closes the help where it is open, and the window where it is not.
    Escape,
    /// Closes the window.
    Close,
}

impl Key {
    /// Whether it does something in interiors, too: of theirs there is neither a blending field nor a
    /// proxy, and no photo beside the picture.
    pub(crate) fn is_of_interiors(self) -> bool {
        match self {
            Self::Layer(layer) => layer.is_of_interiors(),
            Self::Triangulation
            | Self::Epipoles
            | Self::Wireframe
            | Self::Exact
            | Self::Weights
            | Self::Wipe => false,
            _ => true,
        }
    }
}

/// What a key does, with those that are held beside it.
pub(crate) fn of(code: KeyCode, held: ModifiersState) -> Option<Key> {
    if held.control_key() || held.super_key() {
        return match code {
            KeyCode::KeyS => Some(Key::SavePath),
            KeyCode::KeyQ => Some(Key::Close),
            KeyCode::F12 => Some(Key::LoseDevice),
            _ => None,
        };
    }
    Some(match code {
        KeyCode::KeyW => Key::Hold(Motion::Forward),
        KeyCode::KeyS => Key::Hold(Motion::Back),
        KeyCode::KeyA => Key::Hold(Motion::Left),
        KeyCode::KeyD => Key::Hold(Motion::Right),
        KeyCode::PageUp => Key::Hold(Motion::Up),
        KeyCode::PageDown => Key::Hold(Motion::Down),
        KeyCode::ArrowLeft => Key::Hold(Motion::TurnLeft),
        KeyCode::ArrowRight => Key::Hold(Motion::TurnRight),
        KeyCode::ArrowUp => Key::Hold(Motion::TurnUp),
        KeyCode::ArrowDown => Key::Hold(Motion::TurnDown),
        KeyCode::ShiftLeft | KeyCode::ShiftRight => Key::Hold(Motion::Fast),
        KeyCode::Digit1 => Key::Act(Action::Move(Mode::Orbit)),
        KeyCode::Digit2 => Key::Act(Action::Move(Mode::Fly)),
        KeyCode::Digit3 => Key::Act(Action::Move(Mode::Walk)),
        KeyCode::KeyN => Key::Act(Action::Next),
        KeyCode::KeyB => Key::Act(Action::Previous),
        KeyCode::KeyR => Key::Act(Action::Home),
        KeyCode::KeyK => Key::Act(Action::AddKeyframe),
        KeyCode::KeyU => Key::Act(Action::PlaceKeyframe),
        KeyCode::Delete => Key::Act(Action::DeleteKeyframe),
        KeyCode::BracketLeft => Key::Act(Action::StepKeyframe(false)),
        KeyCode::BracketRight => Key::Act(Action::StepKeyframe(true)),
        KeyCode::Space => Key::Act(Action::Play),
        KeyCode::KeyF => Key::Layer(Layer::Field),
        KeyCode::KeyZ => Key::Layer(Layer::Depth),
        KeyCode::KeyC => Key::Layer(Layer::Coverage),
        KeyCode::KeyL => Key::Layer(Layer::Shaded),
        KeyCode::KeyT => Key::Triangulation,
        KeyCode::KeyE => Key::Epipoles,
        KeyCode::KeyG => Key::Wireframe,
        KeyCode::KeyX => Key::Exact,
        KeyCode::KeyI => Key::Weights,
        KeyCode::KeyO => Key::Wipe,
        KeyCode::KeyV => Key::Frusta,
        KeyCode::KeyM => Key::Plan,
        KeyCode::Tab => Key::Panel,
        KeyCode::KeyH => Key::Hud,
        KeyCode::F1 => Key::Help,
        KeyCode::KeyP => Key::Shoot,
        KeyCode::Escape => Key::Escape,
        _ => return None,
    })
}
