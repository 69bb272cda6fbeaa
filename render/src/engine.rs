//! One door to the three engines.

use crate::cpu::Cpu;
use crate::field::{self, TriangulatedField};
use crate::frame::Frame;
use crate::gpu::Gpu;
use crate::options::Method;
use crate::photos::PhotoStore;
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
        self.draw(frame, &Prepared::new(frame, method)?)
    }

    /// Draws a frame that was prepared before.
    ///
    /// # Errors
    /// As [`Self::render`].
    pub fn draw(
        &mut self,
        frame: &Frame<'_>,
        prepared: &Prepared,
    ) -> Result<RgbaImage, RenderError> {
        match (self, prepared) {
            (Self::Gpu(gpu), Prepared::Exact) => gpu.render(frame, Method::Exact),
            (Self::Cpu(cpu), Prepared::Exact) => cpu.render(frame, Method::Exact),
            (Self::Reference, Prepared::Exact) => Ok(reference::render_exact(frame)?),
            (Self::Gpu(gpu), Prepared::Field(field)) => {
                frame.lumigraph.photos.check_masks()?;
                gpu.render_field(frame, field)
            }
            (Self::Cpu(cpu), Prepared::Field(field)) => cpu.render_field(frame, field),
            (Self::Reference, Prepared::Field(field)) => Ok(field::render_reference(frame, field)?),
        }
    }

    /// The source views whose photos need no decoding for the next frame: those on the device.
    pub fn resident(&self, photos: &PhotoStore) -> Vec<usize> {
        match self {
            Self::Gpu(gpu) => gpu.resident(photos),
            Self::Cpu(_) | Self::Reference => Vec::new(),
        }
    }
}

/// What can be made of a frame before any photo is sampled.
#[derive(Clone, Debug)]
pub enum Prepared {
    /// The field is evaluated at every pixel.
    Exact,
    /// It is interpolated.
    Field(TriangulatedField),
}

impl Prepared {
    /// Prepares a frame.
    ///
    /// # Errors
    /// The triangulation refuses the view.
    pub fn new(frame: &Frame<'_>, method: Method) -> Result<Self, RenderError> {
        Ok(match method {
            Method::Exact => Self::Exact,
            Method::Triangulated { cells_across } => {
                Self::Field(TriangulatedField::new(frame, cells_across)?)
            }
        })
    }

    /// The source views that are sampled, as far as known.
    pub fn listed(&self) -> Vec<usize> {
        match self {
            Self::Exact => Vec::new(),
            Self::Field(field) => field.listed(),
        }
    }
}
