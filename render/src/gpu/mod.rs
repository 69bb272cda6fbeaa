//! The wgpu engine: frames of the triangulated or the exact field, several on their way at once.

mod device;
mod drawing;
mod groups;
mod layout;
mod load;
mod passes;
mod photos;
mod pipelines;
mod raster;
mod room;
#[cfg(test)]
mod shader_tests;
mod tables;
mod target;
mod timing;
mod warp;

pub use device::DeviceLimits;
pub use drawing::{Drawing, Drawn};
pub use load::Loaded;
pub use pipelines::ShadeBy;
pub use raster::GpuRaster;
pub use warp::GpuWarp;

use crate::RenderError;
use crate::field::TriangulatedField;
use crate::frame::Frame;
use crate::options::Method;
use crate::photos::PhotoStore;
use crate::residency::Residency;
use calibrate::Lens;
use device::Trouble;
use drawing::Slots;
use image::RgbaImage;
use photos::{Layers, Maker};
use pipelines::Pipelines;
use std::fmt;
use std::time::Duration;

/// A graphics device with all that it keeps between frames: pipelines, photos, the last
/// lens' rays and the picture's buffers.
pub struct Gpu {
    device: wgpu::Device,
    queue: wgpu::Queue,
    info: wgpu::AdapterInfo,
    description: String,
    asked: DeviceLimits,
    /// Whether software drivers were passed over.
    is_real: bool,
    /// The device's, within what was asked.
    limits: wgpu::Limits,
    /// Layers that the photos' array may have: fewer once memory ran out, until other photos come.
    photo_layers: u32,
    pipelines: Pipelines,
    sampler: wgpu::Sampler,
    photos: Option<Layers>,
    residency: Residency,
    /// Of the store whose photos came last, which of them ever did.
    ever_loaded: (u64, Vec<bool>),
    masks: Option<Layers>,
    distances: Option<Layers>,
    no_layers: wgpu::TextureView,
    rays: Option<(Lens, [u32; 2], wgpu::TextureView)>,
    slots: Slots,
    timestamps: bool,
    device_time: Option<Duration>,
    trouble: Trouble,
    /// See [`Self::lose`].
    gone: bool,
}

impl fmt::Debug for Gpu {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Gpu({})", self.description)
    }
}

impl Gpu {
    /// Opens the best device there is; a software driver if there is nothing better.
    ///
    /// # Errors
    /// No driver answers, or each lacks something, which the message names.
    pub fn open() -> Result<Self, RenderError> {
        Self::open_within(DeviceLimits::default())
    }

    /// As [`Self::open`], but no software driver.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub fn open_real() -> Result<Self, RenderError> {
        Self::open_any(DeviceLimits::default(), true)
    }

    /// As [`Self::open`], with tighter limits than the device's own. Pictures have the same bytes.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub fn open_within(asked: DeviceLimits) -> Result<Self, RenderError> {
        Self::open_any(asked, false)
    }

    fn open_any(asked: DeviceLimits, real: bool) -> Result<Self, RenderError> {
        let device::Opened {
            device,
            queue,
            info,
            mut limits,
            timestamps,
            trouble,
        } = device::open(&asked, real)?;
        if info.backend == wgpu::Backend::Gl && limits.max_texture_array_layers.is_multiple_of(6) {
            // One more would be needed: see `Maker::layers_of_array`.
            limits.max_texture_array_layers -= 1;
        }
        let shade_by = asked.shade_by.unwrap_or(match info.device_type {
            wgpu::DeviceType::Cpu => ShadeBy::Fragments,
            _ => ShadeBy::Workgroups,
        });
        let pipelines = Pipelines::new(&device, shade_by);
        let sampler = device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("photos"),
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            mipmap_filter: wgpu::MipmapFilterMode::Linear,
            ..Default::default()
        });
        let no_layers = photos::no_layers(&device);
        Ok(Self {
            description: device::describe(&info),
            device,
            queue,
            info,
            asked,
            is_real: real,
            photo_layers: limits.max_texture_array_layers,
            limits,
            pipelines,
            sampler,
            photos: None,
            residency: Residency::default(),
            ever_loaded: (u64::MAX, Vec::new()),
            masks: None,
            distances: None,
            no_layers,
            rays: None,
            slots: Slots::default(),
            timestamps,
            device_time: None,
            trouble,
            gone: false,
        })
    }

    /// Opens a device of the same kind again in place of one that was lost. What was on it is brought again when
    /// it is needed; budget and counts go on.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub fn reopen(&mut self) -> Result<(), RenderError> {
        if self.gone {
            return Err(RenderError::Gpu("no graphics driver answers".to_owned()));
        }
        let fresh = Self::open_any(self.asked, self.is_real)?;
        let old = std::mem::replace(self, fresh);
        self.residency = Residency {
            held: 0,
            ..old.residency
        };
        self.ever_loaded = old.ever_loaded;
        Ok(())
    }

    /// Gives the device up, as if its driver had: every drawing fails until [`Self::reopen`], and
    /// that fails, too, if it is gone `for_good`.
    pub fn lose(&mut self, for_good: bool) {
        self.gone = for_good;
        self.device.destroy();
        // Tells the callback.
        let _ = self.device.poll(wgpu::PollType::Poll);
    }

    /// The most bytes that photos may take on the device; `None` for as many as there are.
    /// Masks and distance maps come on top.
    pub fn set_budget(&mut self, bytes: Option<u64>) {
        self.residency.budget = bytes;
    }

    /// What photos took on the device so far.
    pub fn residency(&self) -> Residency {
        self.residency
    }

    /// Whether a photo was ever brought to the device.
    pub fn was_loaded(&self, photos: &PhotoStore, source_idx: usize) -> bool {
        self.ever_loaded.0 == photos.id() && self.ever_loaded.1[source_idx]
    }

    /// The source views whose photos are on the device, in no order.
    pub fn resident(&self, photos: &PhotoStore) -> Vec<usize> {
        let layers = self.photos.as_ref();
        layers.map_or_else(Vec::new, |layers| layers.resident(photos.id()))
    }

    /// The device's name and its driver, for people.
    pub fn description(&self) -> &str {
        &self.description
    }

    /// Whether the device tells the time.
    pub fn tells_time(&self) -> bool {
        self.timestamps
    }

    /// How long the device took to draw the last frame that was waited for at once; `None` where it does not tell. Marking
    /// and uploading are not part of it.
    pub fn device_time(&self) -> Option<Duration> {
        self.device_time
    }

    /// Draws a frame.
    ///
    /// # Errors
    /// A photo that is needed cannot be decoded; the triangulation refuses the view; the
    /// device fails, is lost, or its limits do not suffice.
    pub fn render(&mut self, frame: &Frame<'_>, method: Method) -> Result<RgbaImage, RenderError> {
        match method {
            Method::Exact => {
                let loaded = self.load(frame, None)?;
                self.draw(frame, None, &loaded)
            }
            Method::Triangulated { cells_across } => {
                let field = TriangulatedField::new(frame, cells_across)?;
                frame.check_masks()?;
                self.render_field(frame, &field)
            }
        }
    }

    /// Draws a triangulated field. Only photos in its lists are decoded and uploaded.
    ///
    /// # Errors
    /// As [`Self::render`].
    pub fn render_field(
        &mut self,
        frame: &Frame<'_>,
        field: &TriangulatedField,
    ) -> Result<RgbaImage, RenderError> {
        let loaded = self.load(frame, Some(field))?;
        self.draw(frame, Some(field), &loaded)
    }

    fn maker(&self) -> Maker<'_> {
        Maker {
            device: &self.device,
            queue: &self.queue,
            opengl: self.info.backend == wgpu::Backend::Gl,
            array_bytes: self.asked.array_bytes,
        }
    }

    /// A result, or what the device said meanwhile: that it is lost before anything else.
    fn told<T>(&self, result: Result<T, RenderError>) -> Result<T, RenderError> {
        if matches!(result, Err(RenderError::Photo(_))) && self.trouble.lost().is_none() {
            return result;
        }
        match (self.trouble.take(), result) {
            (Err(lost @ RenderError::DeviceLost(_)), _) => Err(lost),
            (_, Err(error)) => Err(error),
            (said, result) => said.and(result),
        }
    }
}
