//! One door to the three engines.

use crate::cpu::Cpu;
use crate::edges::Edges;
use crate::field::{self, TriangulatedField};
use crate::frame::Frame;
use crate::gpu::{self, Gpu};
use crate::options::Method;
use crate::photos::PhotoStore;
use crate::sight::Views;
use crate::soft::{Softened, soften};
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
pub struct Engine {
    by: By,
    /// Draws what the graphics device does not.
    spare: Cpu,
    notes: Vec<String>,
    frames_by_cpu: u64,
    last_by_cpu: bool,
}

#[derive(Debug)]
enum By {
    Gpu(Box<Gpu>),
    Cpu {
        /// Of a device that is gone.
        instead: bool,
    },
    Reference,
}

/// A frame whose photos are where they are needed, as far as is known which; or what a graphics
/// device had to say against it.
#[derive(Clone, Debug)]
pub struct Ready(Result<Option<gpu::Loaded>, RenderError>);

impl Ready {
    /// How many photos a graphics device was told to sample; `None` for other engines, and where
    /// all photos that take part are on the device already.
    pub fn photos_used(&self) -> Option<usize> {
        self.loaded()?.photos_used()
    }

    /// In how many parts a graphics device draws the frame: more than one where its photos do
    /// not fit on the device at once.
    pub fn parts(&self) -> usize {
        self.loaded().map_or(1, gpu::Loaded::parts)
    }

    fn loaded(&self) -> Option<&gpu::Loaded> {
        self.0.as_ref().ok()?.as_ref()
    }
}

impl Engine {
    /// Opens an engine. [`DeviceChoice::Auto`] never fails: without a graphics driver, or
    /// with one that only imitates a graphics processor in software, it is the CPU engine.
    ///
    /// # Errors
    /// [`DeviceChoice::Gpu`] where no driver answers.
    pub fn open(choice: DeviceChoice) -> Result<Self, RenderError> {
        let by = match choice {
            DeviceChoice::Auto => {
                Gpu::open_real().map_or(By::Cpu { instead: false }, |gpu| By::Gpu(Box::new(gpu)))
            }
            DeviceChoice::Gpu => By::Gpu(Box::new(Gpu::open()?)),
            DeviceChoice::Cpu => By::Cpu { instead: false },
            DeviceChoice::Reference => By::Reference,
        };
        Ok(Self::of(by))
    }

    /// An engine that draws with a device that is open.
    pub fn with(gpu: Gpu) -> Self {
        Self::of(By::Gpu(Box::new(gpu)))
    }

    fn of(by: By) -> Self {
        Self {
            by,
            spare: Cpu::default(),
            notes: Vec::new(),
            frames_by_cpu: 0,
            last_by_cpu: false,
        }
    }

    /// What it draws with, for people.
    pub fn description(&self) -> String {
        match &self.by {
            By::Gpu(gpu) => gpu.description().to_owned(),
            By::Cpu { .. } => "CPU".to_owned(),
            By::Reference => "CPU, reference".to_owned(),
        }
    }

    /// The graphics device, where one draws.
    pub fn gpu(&self) -> Option<&Gpu> {
        match &self.by {
            By::Gpu(gpu) => Some(gpu),
            By::Cpu { .. } | By::Reference => None,
        }
    }

    /// See [`Self::gpu`].
    pub fn gpu_mut(&mut self) -> Option<&mut Gpu> {
        match &mut self.by {
            By::Gpu(gpu) => Some(gpu),
            By::Cpu { .. } | By::Reference => None,
        }
    }

    /// What became of the graphics device and what it could not draw, for people; each once.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// How many frames the CPU drew because the graphics device could not, or was gone.
    pub fn frames_by_cpu(&self) -> u64 {
        self.frames_by_cpu
    }

    /// Whether the CPU engine drew the last frame.
    pub fn last_by_cpu(&self) -> bool {
        self.last_by_cpu
    }

    /// Draws a frame: straight alpha, alpha = coverage.
    ///
    /// # Errors
    /// As [`Self::draw_ready`].
    pub fn render(&mut self, frame: &Frame<'_>, method: Method) -> Result<RgbaImage, RenderError> {
        self.draw(frame, &Prepared::new(frame, method)?)
    }

    /// Draws a frame that was prepared before.
    ///
    /// # Errors
    /// As [`Self::draw_ready`].
    pub fn draw(
        &mut self,
        frame: &Frame<'_>,
        prepared: &Prepared,
    ) -> Result<RgbaImage, RenderError> {
        let ready = self.ready(frame, prepared)?;
        self.draw_ready(frame, prepared, &ready)
    }

    /// Brings a frame's photos to the graphics device, decoding those that are not in memory.
    /// Other engines decode what they sample when they sample it.
    ///
    /// # Errors
    /// A photo that is needed cannot be decoded. (What a device has to say against the frame is
    /// kept for [`Self::draw_ready`].)
    pub fn ready(&mut self, frame: &Frame<'_>, prepared: &Prepared) -> Result<Ready, RenderError> {
        let By::Gpu(gpu) = &mut self.by else {
            return Ok(Ready(Ok(None)));
        };
        if prepared.field().is_some() {
            frame.check_masks()?;
        }
        match gpu.load(frame, prepared.field()) {
            Err(error @ (RenderError::Photo(_) | RenderError::Triangulation(_))) => Err(error),
            loaded => Ok(Ready(loaded.map(Some))),
        }
    }

    /// Draws a frame that is [`Self::ready`]. What a graphics device cannot draw the CPU draws.
    /// A device that is lost is opened again; if that is of no use, the CPU goes on.
    ///
    /// # Errors
    /// A photo that is needed cannot be decoded.
    pub fn draw_ready(
        &mut self,
        frame: &Frame<'_>,
        prepared: &Prepared,
        ready: &Ready,
    ) -> Result<RgbaImage, RenderError> {
        self.last_by_cpu = false;
        let gpu = match &mut self.by {
            By::Gpu(gpu) => gpu,
            By::Cpu { instead } => {
                self.frames_by_cpu += u64::from(*instead);
                return self.draw_by_cpu(frame, prepared);
            }
            By::Reference => {
                return Ok(match prepared {
                    Prepared::Exact => reference::render_exact(frame)?,
                    Prepared::Field(field) => field::render_reference(frame, field)?,
                });
            }
        };
        let field = prepared.field();
        let drawn = match &ready.0 {
            Ok(Some(loaded)) => gpu.draw(frame, field, loaded),
            // Made ready by an engine of another kind.
            Ok(None) => draw_anew(gpu, frame, field),
            Err(error) => Err(error.clone()),
        };
        let drawn = match drawn {
            Err(lost @ RenderError::DeviceLost(_)) => {
                let again = gpu.reopen().and_then(|()| draw_anew(gpu, frame, field));
                match &again {
                    Ok(_) => {
                        let name = gpu.description().to_owned();
                        self.note(format!("{lost}; {name} was opened anew and goes on"));
                    }
                    Err(RenderError::Photo(_)) => {}
                    Err(_) => {
                        self.note(format!("{lost}; the CPU goes on"));
                        self.by = By::Cpu { instead: true };
                        self.frames_by_cpu += 1;
                        return self.draw_by_cpu(frame, prepared);
                    }
                }
                again
            }
            drawn => drawn,
        };
        match drawn {
            Err(
                error @ (RenderError::Gpu(_)
                | RenderError::DeviceFull(_)
                | RenderError::DeviceLost(_)),
            ) => {
                self.note(format!("{error}; the CPU draws such frames"));
                self.frames_by_cpu += 1;
                self.draw_by_cpu(frame, prepared)
            }
            drawn => drawn,
        }
    }

    /// Draws those parts of a frame's picture softly that no photo shows, but for a guess, and those of which photos
    /// contradict each other. The CPU looks at these whatever has drawn the picture, with the photos that were prepared for it.
    ///
    /// # Errors
    /// A photo that is needed cannot be decoded.
    pub fn soften(
        &mut self,
        frame: &Frame<'_>,
        prepared: &Prepared,
        picture: &mut RgbaImage,
    ) -> Result<Softened, RenderError> {
        let field = prepared.field();
        let contradictions = match self.by {
            By::Reference => reference::contradictions(frame, field)?,
            By::Cpu { .. } | By::Gpu(_) => self.spare.contradictions(frame, field)?,
        };
        Ok(soften(frame, contradictions.as_ref(), picture))
    }

    /// Draws the pixels of a picture at which its frame's surface jumps anew, as means of so many samples across
    /// and down: outlines without stairs. How many they are. The CPU does so whatever has drawn the picture, with the photos
    /// that were prepared for it; 0 and 1 leave it as it is.
    ///
    /// # Errors
    /// A photo that is needed cannot be decoded.
    pub fn smooth(
        &mut self,
        frame: &Frame<'_>,
        prepared: &Prepared,
        across: u32,
        picture: &mut RgbaImage,
    ) -> Result<usize, RenderError> {
        let views = Views::new(&frame.sources);
        let Some(edges) = Edges::of(frame, &views, picture, across) else {
            return Ok(0);
        };
        match self.by {
            By::Reference => reference::smooth(frame, prepared.field(), &edges, picture)?,
            By::Cpu { .. } | By::Gpu(_) => {
                self.spare
                    .smooth(frame, prepared.field(), &edges, picture)?;
            }
        }
        Ok(edges.count())
    }

    fn draw_by_cpu(
        &mut self,
        frame: &Frame<'_>,
        prepared: &Prepared,
    ) -> Result<RgbaImage, RenderError> {
        self.last_by_cpu = true;
        match prepared {
            Prepared::Exact => self.spare.render(frame, Method::Exact),
            Prepared::Field(field) => self.spare.render_field(frame, field),
        }
    }

    fn note(&mut self, note: String) {
        if !self.notes.contains(&note) {
            self.notes.push(note);
        }
    }

    /// The source views whose photos need no decoding for the next frame: those on the device.
    pub fn resident(&self, photos: &PhotoStore) -> Vec<usize> {
        self.gpu().map_or_else(Vec::new, |gpu| gpu.resident(photos))
    }
}

fn draw_anew(
    gpu: &mut Gpu,
    frame: &Frame<'_>,
    field: Option<&TriangulatedField>,
) -> Result<RgbaImage, RenderError> {
    let loaded = gpu.load(frame, field)?;
    gpu.draw(frame, field, &loaded)
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

    /// The field, if it is interpolated.
    pub fn field(&self) -> Option<&TriangulatedField> {
        match self {
            Self::Exact => None,
            Self::Field(field) => Some(field),
        }
    }

    /// The source views that are sampled, as far as known.
    pub fn listed(&self) -> Vec<usize> {
        match self {
            Self::Exact => Vec::new(),
            Self::Field(field) => field.listed(),
        }
    }
}
