//! The panels with their fonts. Reading fonts and drawing letters for the first time takes longer
//! than a frame may, so both are done on another thread, before the panels are seen.

use super::paint::paint;
use crate::panel::{self, Command, Shows, Status};
use crate::picture::{Look, Shown};
use crate::plan::Plan;
use crate::state::State;
use crate::trace::{Took, Watch};
use calibrate::Pixel;
use egui::{
    ClippedPrimitive, Color32, Context, FontId, Order, PlatformOutput, Pos2, RawInput, Rect,
    TextStyle, TextureHandle, TextureOptions, TexturesDelta, ViewportId, vec2,
};
use std::sync::Arc;
use std::time::Duration;

/// The longest side of textures, in texels: with another, letters would be drawn again.
pub(super) const TEXTURE_SIDE: usize = 8192;
/// Beside ASCII and Latin-1: what our texts have, and pairs that fonts have one letter for.
const OTHER_LETTERS: &str = "–—…αβ×°→←≥≤fi fl ff ffi ffl fj";
/// Sizes of letters that no style has, in points.
const OTHER_SIZES: [f32; 1] = [12.0];

/// Panels, and what they paint with.
pub(super) struct Panels {
    context: Context,
    /// Pixels a point that their letters were drawn for.
    scale: f32,
    picture: Option<TextureHandle>,
    photo: Option<TextureHandle>,
    /// What is to be brought to the device before the next frame's.
    textures: TexturesDelta,
}

impl Drop for Panels {
    fn drop(&mut self) {
        (self.picture, self.photo) = (None, None);
        // egui insists that nothing is left to be done.
        self.context.tex_manager().write().take_delta().clear();
        self.textures.clear();
    }
}

/// What there is to see.
pub(super) struct Sight<'a> {
    pub(super) state: &'a mut State,
    pub(super) shows: &'a mut Shows,
    pub(super) status: &'a Status,
    pub(super) shown: Option<&'a Shown>,
    pub(super) plan: Option<&'a Plan>,
}

/// A frame that is ready for the device.
pub(super) struct Painted {
    pub(super) primitives: Vec<ClippedPrimitive>,
    pub(super) pixels_per_point: f32,
    pub(super) textures: TexturesDelta,
    pub(super) platform: PlatformOutput,
    /// When the panels want another frame.
    pub(super) delay: Option<Duration>,
    /// What they want done.
    pub(super) commands: Vec<Command>,
    /// Laying the panels out, and making triangles of them.
    pub(super) took: [Took; 2],
}

impl Panels {
    /// Panels for a window of a size in pixels, at `scale` pixels a point, that have drawn every
    /// letter of our texts; this takes a while.
    pub(super) fn warm(scale: f32, size: (u32, u32), texture_side: usize) -> Self {
        let context = Context::default();
        context.set_theme(egui::Theme::Dark);
        // Letters stand on whole pixels: a quarter as many are to be drawn, and they are sharper.
        context.all_styles_mut(|style| style.visuals.text_options.subpixel_binning = false);
        // Another zoom would need other letters.
        context.options_mut(|options| options.zoom_with_keyboard = false);
        let mut panels = Self {
            context,
            scale,
            picture: None,
            photo: None,
            textures: TexturesDelta::default(),
        };
        let input = |panels: &Self| {
            let mut input = RawInput {
                max_texture_side: Some(texture_side),
                ..RawInput::default()
            };
            panels.fit(&mut input, size);
            input
        };
        // 1. The letters.
        let first = input(&panels);
        let mut output = panels.context.run_pass(first, draw_letters);
        panels
            .textures
            .append(std::mem::take(&mut output.textures_delta));
        // 2. What the window shows at first, twice, as egui lays it out by what it was before.
        let mut state = State::new(Look::default());
        state.resize(size.0, size.1);
        let mut shows = Shows::fitting(size.0 as f32 / scale);
        let status = Status {
            doing: Some(String::from("opening")),
            ..Status::default()
        };
        for _ in 0..2 {
            let input = input(&panels);
            let mut painted = panels.run(
                input,
                Sight {
                    state: &mut state,
                    shows: &mut shows,
                    status: &status,
                    shown: None,
                    plan: None,
                },
            );
            panels
                .textures
                .append(std::mem::take(&mut painted.textures));
        }
        panels
    }

    /// Pixels a point that they were made for.
    pub(super) fn scale(&self) -> f32 {
        self.scale
    }

    /// For egui's other half.
    pub(super) fn context(&self) -> &Context {
        &self.context
    }

    /// Goes on where other panels were: what is open, and where.
    pub(super) fn take_over(&mut self, before: &Self) {
        let memory = before.context.memory(Clone::clone);
        self.context.memory_mut(|own| *own = memory);
    }

    /// Makes input one for a window of a size in pixels, and for the letters that there are: those
    /// of another scale are drawn behind, and until then panels are as many pixels large as before.
    pub(super) fn fit(&self, input: &mut RawInput, (width, height): (u32, u32)) {
        let viewport = input.viewports.entry(ViewportId::ROOT).or_default();
        viewport.native_pixels_per_point = Some(self.scale);
        let size = vec2(width as f32, height as f32) / self.scale;
        let is_there = width > 0 && height > 0;
        input.screen_rect = is_there.then(|| Rect::from_min_size(Pos2::ZERO, size));
    }

    /// Whether a button or the wheel at a pixel is for the panels, as they were laid out last. What egui
    /// says of that when it is told is by where the pointer was then.
    pub(super) fn takes(&self, at: Pixel) -> bool {
        let place = Pos2::new(at.x as f32, at.y as f32) / self.scale;
        let layer = self.context.layer_id_at(place);
        let is_over = layer.is_some_and(|layer| layer.order != Order::Background);
        is_over || self.context.egui_is_using_pointer()
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

    /// One frame.
    pub(super) fn run(&mut self, input: RawInput, sight: Sight<'_>) -> Painted {
        let Sight {
            state,
            shows,
            status,
            shown,
            plan,
        } = sight;
        let watch = Watch::start();
        let mut commands = Vec::new();
        let textures = [&self.picture, &self.photo].map(|t| t.as_ref().map(TextureHandle::id));
        let mut output = self.context.run_pass(input, |context| {
            paint(context, state, shows, shown, plan, textures);
            panel::texts(context, state, shows, status, shown);
            if shows.panel {
                commands.extend(panel::panel(context, state, shows, shown));
            }
            panel::help(context, shows);
        });
        let panels = watch.took();
        let watch = Watch::start();
        let pixels_per_point = output.pixels_per_point;
        let shapes = std::mem::take(&mut output.shapes);
        let primitives = self.context.tessellate(shapes, pixels_per_point);
        let tessellate = watch.took();
        let root = output.viewport_output.get(&ViewportId::ROOT);
        // Far away is never.
        let delay = root
            .map(|v| v.repaint_delay)
            .filter(|delay| *delay < Duration::from_secs(60));
        let mut textures = std::mem::take(&mut self.textures);
        textures.append(std::mem::take(&mut output.textures_delta));
        Painted {
            primitives,
            pixels_per_point,
            textures,
            platform: std::mem::take(&mut output.platform_output),
            delay,
            commands,
            took: [panels, tessellate],
        }
    }
}

fn draw_letters(context: &Context) {
    let letters = (' '..='~').chain('\u{a1}'..='\u{ff}');
    let letters: String = letters.chain(OTHER_LETTERS.chars()).collect();
    let styles = [TextStyle::Body, TextStyle::Button, TextStyle::Heading];
    let mut fonts: Vec<FontId> = styles
        .map(|style| style.resolve(&context.global_style()))
        .to_vec();
    fonts.extend(OTHER_SIZES.map(FontId::proportional));
    for font in fonts {
        let text = letters.clone();
        context.fonts_mut(|fonts| fonts.layout_no_wrap(text, font, Color32::WHITE));
    }
}

#[cfg(test)]
mod tests;
