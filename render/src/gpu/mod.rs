//! The wgpu engine.

use crate::RenderError;
use crate::frame::Frame;
use crate::options::Method;
use image::RgbaImage;

/// A graphics device.
#[derive(Debug)]
pub struct Gpu {
    description: String,
}

impl Gpu {
    /// Opens the best device there is.
    ///
    /// # Errors
    /// No driver answers.
    pub fn open() -> Result<Self, RenderError> {
        Err(RenderError::Gpu("no graphics driver answers".to_owned()))
    }

    /// Whether the driver imitates a graphics processor in software.
    pub fn is_software(&self) -> bool {
        true
    }

    /// The device's name and its driver, for people.
    pub fn description(&self) -> &str {
        &self.description
    }

    /// Draws a frame.
    ///
    /// # Errors
    /// A photo that is needed cannot be decoded; the device fails.
    pub fn render(&mut self, _: &Frame<'_>, _: Method) -> Result<RgbaImage, RenderError> {
        Err(RenderError::Gpu("no graphics driver answers".to_owned()))
    }
}
