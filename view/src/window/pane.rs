//! A window with what draws in it.

use super::ViewError;
use super::panels::{Panels, TEXTURE_SIDE};
use crate::screen::Screen;
use egui::RawInput;
use std::sync::Arc;
use winit::event_loop::OwnedDisplayHandle;
use winit::window::Window;

/// What it takes a while to open.
pub(super) struct Opened {
    screen: Screen,
    panels: Panels,
}

impl Opened {
    /// Opens a device for a window, and draws the letters meanwhile.
    ///
    /// # Errors
    /// None can show anything in it.
    pub(super) fn of(window: &Arc<Window>, display: OwnedDisplayHandle) -> Result<Self, ViewError> {
        let (scale, size) = (window.scale_factor() as f32, window.inner_size().into());
        let (screen, panels) = std::thread::scope(|scope| {
            let panels = scope.spawn(move || Panels::warm(scale, size, TEXTURE_SIDE));
            let screen = Screen::open(window, display).map_err(ViewError::NoDevice);
            (screen, panels.join())
        });
        let screen = screen?;
        let side = texture_side(&screen);
        let panels = match panels {
            Ok(panels) if side == TEXTURE_SIDE => panels,
            _ => Panels::warm(scale, size, side),
        };
        Ok(Self { screen, panels })
    }
}

fn texture_side(screen: &Screen) -> usize {
    screen.max_texture_side().min(TEXTURE_SIDE)
}

/// A window with what draws in it.
pub(super) struct Pane {
    pub(super) window: Arc<Window>,
    pub(super) screen: Screen,
    pub(super) panels: Panels,
    pub(super) input: egui_winit::State,
}

impl Pane {
    /// Puts together what was opened.
    pub(super) fn new(window: Arc<Window>, opened: Opened) -> Self {
        let Opened { screen, panels } = opened;
        let input = input_for(&window, &panels, &screen);
        Self {
            window,
            screen,
            panels,
            input,
        }
    }

    /// Goes on with panels that have other letters.
    pub(super) fn replace(&mut self, mut panels: Panels) {
        panels.take_over(&self.panels);
        self.input = input_for(&self.window, &panels, &self.screen);
        self.panels = panels;
    }

    /// The longest side that textures may have, in texels.
    pub(super) fn texture_side(&self) -> usize {
        texture_side(&self.screen)
    }

    /// Of pictures, in pixels: as large as the window, or as a texture may be.
    pub(super) fn size(&self) -> (u32, u32) {
        let most = self.texture_side() as u32;
        let size = self.window.inner_size();
        (size.width.min(most), size.height.min(most))
    }

    /// What hands did since the last frame.
    pub(super) fn take_input(&mut self) -> RawInput {
        let mut input = self.input.take_egui_input(&self.window);
        let size = self.window.inner_size();
        self.panels.fit(&mut input, size.into());
        input
    }
}

fn input_for(window: &Window, panels: &Panels, screen: &Screen) -> egui_winit::State {
    let mut input = egui_winit::State::new(
        panels.context().clone(),
        egui::ViewportId::ROOT,
        window,
        Some(panels.scale()),
        None,
        Some(texture_side(screen)),
    );
    input.egui_input_mut().focused = window.has_focus();
    input
}
