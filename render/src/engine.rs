//! One door to the three engines.

use crate::cpu::Cpu;
use crate::field::{self, TriangulatedField};
use crate::frame::Frame;
use crate::gpu::Gpu;
use crate::options::Method;
use crate::{RenderError, reference};
use image::RgbaImage;

/// What is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeviceChoice {
    /// A graphics processor if there is a real one, else the processor.
    Auto,
    /// The graphics processor, or any driver that stands in for one.
    Gpu,
    /// The processor.
    Cpu,
    /// Plain f64: slow, the specification.
    Reference,
}

/// An engine, ready to draw.
#[derive(Debug)]
pub enum Engine {
    /// wgpu.
    Gpu(Box<Gpu>),
    /// f32, all threads.
    Cpu(Box<Cpu>),
    /// f64.
    Reference,
}

impl Engine {
    /// Opens an engine. [`DeviceChoice::Auto`] never fails: without a graphics driver, or
    /// with one that only imitates a graphics processor in software, it is the CPU engine.
    ///
    /// # Errors
    /// [`DeviceChoice::Gpu`] where no driver answers.
    pub fn open(choice: DeviceChoice) -> Result<Self, RenderError> {
        Ok(match choice {
            DeviceChoice::Auto => match Gpu::open() {
                Ok(gpu) if !gpu.is_software() => Self::Gpu(Box::new(gpu)),
                _ => Self::Cpu(Box::default()),
            },
            DeviceChoice::Gpu => Self::Gpu(Box::new(Gpu::open()?)),
            DeviceChoice::Cpu => Self::Cpu(Box::default()),
            DeviceChoice::Reference => Self::Reference,
        })
    }

    /// What it draws with, for people.
    pub fn description(&self) -> String {
        match self {
            Self::Gpu(gpu) => gpu.description().to_owned(),
            Self::Cpu(_) => "CPU".to_owned(),
            Self::Reference => "CPU, reference".to_owned(),
        }
    }

    /// Draws a frame: straight alpha, alpha = coverage.
    ///
    /// # Errors
    /// A photo that is needed cannot be decoded; the device fails.
    pub fn render(&mut self, frame: &Frame<'_>, method: Method) -> Result<RgbaImage, RenderError> {
        match (self, method) {
            (Self::Gpu(gpu), method) => gpu.render(frame, method),
            (Self::Cpu(cpu), method) => cpu.render(frame, method),
            (Self::Reference, Method::Exact) => Ok(reference::render_exact(frame)?),
            (Self::Reference, Method::Triangulated { cells_across }) => {
                let field = TriangulatedField::new(frame, cells_across)?;
                Ok(field::render_reference(frame, &field)?)
            }
        }
    }
}
