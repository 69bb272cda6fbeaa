//! The wgpu engine: the triangulated field in one draw, the exact field in another.

mod device;
mod groups;
mod layout;
mod load;
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
pub use load::Loaded;
pub use raster::GpuRaster;
pub use warp::GpuWarp;

use crate::RenderError;
use crate::field::{FieldEntry, TriangulatedField};
use crate::frame::Frame;
use crate::options::Method;
use crate::photos::PhotoStore;
use crate::residency::Residency;
use calibrate::Lens;
use device::Trouble;
use groups::{Part, Rect};
use image::RgbaImage;
use layout::{Corner, Entry, Special};
use photos::{Layers, Maker};
use pipelines::{Pass, Pipelines};
use std::fmt;
use std::ops::Range;
use std::time::Duration;
use target::Target;
use timing::Stopwatch;

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
    target: Option<Target>,
    timestamps: bool,
    device_time: Option<Duration>,
    trouble: Trouble,
    /// See [`Self::lose`].
    gone: bool,
}

/// Which of a frame's passes.
#[derive(Clone, Copy)]
struct Turn<'a> {
    pass_idx: usize,
    /// Where the device tells the time.
    stopwatch: Option<&'a Stopwatch>,
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
        let pipelines = Pipelines::new(&device);
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
            target: None,
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

    /// How long the device took to draw the last frame; `None` where it does not tell. Marking
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
                frame.lumigraph.photos.check_masks()?;
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

    /// Draws a frame, or the field of it, that was loaded before.
    ///
    /// # Errors
    /// As [`Self::render`].
    pub fn draw(
        &mut self,
        frame: &Frame<'_>,
        field: Option<&TriangulatedField>,
        loaded: &Loaded,
    ) -> Result<RgbaImage, RenderError> {
        let picture = self.try_draw(frame, field, loaded);
        self.told(picture)
    }

    fn try_draw(
        &mut self,
        frame: &Frame<'_>,
        field: Option<&TriangulatedField>,
        loaded: &Loaded,
    ) -> Result<RgbaImage, RenderError> {
        self.device_time = None;
        let tables = self.tables(frame)?;
        let (width, height) = (frame.desired.width, frame.desired.height);
        if self
            .target
            .as_ref()
            .is_none_or(|t| t.size != [width, height])
        {
            let most_bytes = self.limits.max_buffer_size;
            self.target = Some(Target::new(&self.device, width, height, most_bytes));
        }
        let stopwatch = self
            .timestamps
            .then(|| Stopwatch::new(&self.device, loaded.groups.len()));
        for (pass_idx, group) in loaded.groups.iter().enumerate() {
            let turn = Turn {
                pass_idx,
                stopwatch: stopwatch.as_ref(),
            };
            self.bring(frame, loaded.room, &group.sources)?;
            match (&group.part, field) {
                (Part::Triangles(range), Some(field)) => {
                    self.draw_triangles(frame, &tables, field, range.clone(), turn)?;
                }
                (Part::Pixels(rect), _) => self.draw_pixels(frame, &tables, *rect, turn)?,
                (Part::Triangles(_), None) => {}
            }
        }
        let target = self.target.as_ref().expect("made above");
        let picture = target.read(&self.device, &self.queue)?;
        if let Some(stopwatch) = stopwatch {
            self.device_time = stopwatch.read(&self.device, &self.queue)?;
        }
        Ok(picture)
    }

    /// Draws some of a field's triangles with photos that are on the device.
    fn draw_triangles(
        &mut self,
        frame: &Frame<'_>,
        tables: &tables::Tables,
        field: &TriangulatedField,
        range: Range<usize>,
        turn: Turn<'_>,
    ) -> Result<(), RenderError> {
        let shared = self.shared_group(frame, tables, load::Order::ByLayer, Rect::whole(0, 0))?;
        let photos = self.photos.as_ref().expect("brought before");
        let mut entries: Vec<Entry> = Vec::new();
        let mut corners: [Vec<Corner>; 2] = Default::default();
        let size = [frame.desired.width as f32, frame.desired.height as f32];
        for triangle_idx in range {
            let triangle = &field.triangles[triangle_idx];
            let list = [entries.len() as u32, triangle.entry_count];
            let entry = |e: &FieldEntry| Entry {
                source_idx: photos.layer(e.source_idx as usize).unwrap_or(0) as f32,
                values: e.values,
            };
            entries.extend(field.entries_of(triangle_idx).iter().map(entry));
            corners[usize::from(triangle.bordered)].extend(triangle.corners.map(|i| {
                let [x, y] = field.vertices[i as usize].as_vec2().to_array();
                Corner {
                    at: [x / size[0] * 2.0 - 1.0, y / size[1] * -2.0 + 1.0],
                    list,
                }
            }));
        }
        let [plain, bordered] = &corners;
        let buffers = [plain, bordered]
            .map(|corners| self.buffer("corners", corners, wgpu::BufferUsages::VERTEX));
        let entries = self.table("entries", bytemuck::cast_slice(&entries), layout::ENTRY_ROW);
        let own =
            self.pipelines
                .triangulated_group(&self.device, &photos.view, &self.sampler, &entries);
        let special = Special::of(frame);
        for pass in [Pass::Triangles, Pass::BorderedTriangles] {
            self.pipelines.ensure(&self.device, pass, special);
        }
        self.pass(turn, |pass, pipelines| {
            pass.set_bind_group(0, &shared, &[]);
            pass.set_bind_group(1, &own, &[]);
            pass.set_pipeline(pipelines.get(Pass::Triangles, special));
            pass.set_vertex_buffer(0, buffers[0].slice(..));
            pass.draw(0..plain.len() as u32, 0..1);
            pass.set_pipeline(pipelines.get(Pass::BorderedTriangles, special));
            pass.set_vertex_buffer(0, buffers[1].slice(..));
            pass.draw(0..bordered.len() as u32, 0..1);
        });
        self.trouble.take()
    }

    /// Draws a part of the exact field with photos that are on the device.
    fn draw_pixels(
        &mut self,
        frame: &Frame<'_>,
        tables: &tables::Tables,
        rect: Rect,
        turn: Turn<'_>,
    ) -> Result<(), RenderError> {
        let shared = self.shared_group(frame, tables, load::Order::AsGiven, rect)?;
        let photos = self.photos.as_ref().expect("brought before");
        let own = self
            .pipelines
            .exact_group(&self.device, &photos.view, &self.sampler);
        let special = Special::of(frame);
        self.pipelines.ensure(&self.device, Pass::Exact, special);
        self.pass(turn, |pass, pipelines| {
            let ([x, y], [width, height]) = (rect.origin, rect.size);
            pass.set_scissor_rect(x, y, width, height);
            pass.set_pipeline(pipelines.get(Pass::Exact, special));
            pass.set_bind_group(0, &shared, &[]);
            pass.set_bind_group(1, &own, &[]);
            pass.draw(0..3, 0..1);
        });
        self.trouble.take()
    }

    /// One render pass over the picture, which the first of a frame clears.
    fn pass(&self, turn: Turn<'_>, record: impl FnOnce(&mut wgpu::RenderPass<'_>, &Pipelines)) {
        let Some(target) = &self.target else { return };
        let mut encoder = self.device.create_command_encoder(&Default::default());
        {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("frame"),
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: &target.view,
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations {
                        load: match turn.pass_idx {
                            0 => wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                            _ => wgpu::LoadOp::Load,
                        },
                        store: wgpu::StoreOp::Store,
                    },
                })],
                timestamp_writes: turn.stopwatch.map(Stopwatch::of_pass),
                ..Default::default()
            });
            record(&mut pass, &self.pipelines);
        }
        if let Some(stopwatch) = turn.stopwatch {
            stopwatch.keep(&mut encoder, turn.pass_idx);
        }
        self.queue.submit([encoder.finish()]);
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
