//! A window with what draws in it.

use super::ViewError;
use crate::picture::Shown;
use crate::screen::Screen;
use egui::{TextureHandle, TextureOptions, TexturesDelta};
use std::sync::Arc;
use std::thread::JoinHandle;
use winit::event_loop::ActiveEventLoop;
use winit::window::Window;

/// The longest side of egui's textures, in texels. With another, fonts would be read again.
const TEXTURE_SIDE: usize = 8192;

/// Panels, and what is to be brought to a device before they can be painted.
pub(super) type Warm = (egui::Context, TexturesDelta);

/// A window with what draws in it.
pub(super) struct Pane {
    pub(super) window: Arc<Window>,
    pub(super) screen: Screen,
    pub(super) context: egui::Context,
    pub(super) input: egui_winit::State,
    pub(super) picture: Option<TextureHandle>,
    pub(super) photo: Option<TextureHandle>,
    /// What is to be brought to the device before the next frame's.
    pub(super) textures: TexturesDelta,
}

impl Drop for Pane {
    fn drop(&mut self) {
        (self.picture, self.photo) = (None, None);
        // egui insists that nothing is left to be done.
        self.context.tex_manager().write().take_delta().clear();
        self.textures.clear();
    }
}

impl Pane {
    /// Opens a device for a window.
    ///
    /// # Errors
    /// None can show anything in it.
    pub(super) fn open(
        event_loop: &ActiveEventLoop,
        window: Arc<Window>,
        warm: Option<JoinHandle<Warm>>,
    ) -> Result<Self, ViewError> {
        let screen = Screen::open(&window, event_loop.owned_display_handle());
        let screen = screen.map_err(ViewError::NoDevice)?;
        let (context, textures) = match warm.map(JoinHandle::join) {
            Some(Ok(warm)) => warm,
            _ => warm_context(),
        };
        let input = egui_winit::State::new(
            context.clone(),
            egui::ViewportId::ROOT,
            &window,
            Some(window.scale_factor() as f32),
            None,
            Some(screen.max_texture_side().min(TEXTURE_SIDE)),
        );
        Ok(Self {
            window,
            screen,
            context,
            input,
            picture: None,
            photo: None,
            textures,
        })
    }

    /// Of pictures, in pixels: as large as the window, or as a texture may be.
    pub(super) fn size(&self) -> (u32, u32) {
        let most = self.screen.max_texture_side().min(TEXTURE_SIDE) as u32;
        let size = self.window.inner_size();
        (size.width.min(most), size.height.min(most))
    }

    /// Brings a picture to the textures.
    pub(super) fn show(&mut self, shown: &Shown) {
        let options = TextureOptions::LINEAR;
        let context = &self.context;
        let set =
            |handle: &mut Option<TextureHandle>, name: &str, image: &Arc<egui::ColorImage>| {
                match handle {
                    Some(handle) => handle.set(Arc::clone(image), options),
                    None => *handle = Some(context.load_texture(name, Arc::clone(image), options)),
                }
            };
        set(&mut self.picture, "picture", &shown.image);
        match &shown.photo {
            Some((_, photo)) => set(&mut self.photo, "photo", photo),
            None => self.photo = None,
        }
    }
}

/// Panels that have their fonts: reading them takes longer than a frame may.
pub(super) fn warm_context() -> Warm {
    let context = egui::Context::default();
    context.set_theme(egui::Theme::Dark);
    let all: String = (' '..='~').collect();
    let input = egui::RawInput {
        max_texture_side: Some(TEXTURE_SIDE),
        ..egui::RawInput::default()
    };
    let mut output = context.run_pass(input, |context| {
        egui::Area::new(egui::Id::unique("all")).show(context, |ui| {
            ui.heading(&all);
            ui.label(&all);
            ui.label(egui::RichText::new(&all).size(12.0));
        });
    });
    (context, std::mem::take(&mut output.textures_delta))
}
