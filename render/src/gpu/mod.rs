//! The wgpu engine: the triangulated field in one draw, the exact field in another.

mod layout;
mod photos;
mod pipelines;
mod room;
#[cfg(test)]
mod shader_tests;
mod target;

use crate::RenderError;
use crate::field::{FieldEntry, TriangulatedField};
use crate::frame::Frame;
use crate::options::Method;
use crate::photos::PhotoStore;
use crate::rays::RayMap;
use crate::residency::Residency;
use crate::surface::Surface;
use calibrate::Lens;
use image::RgbaImage;
use layout::{Corner, Entry, Params, Source, Special};
use photos::Layers;
use pipelines::{Pass, Pipelines};
use room::Content;
use std::fmt;
use std::sync::{Arc, Mutex};
use target::Target;
use wgpu::util::DeviceExt;

/// A graphics device with all that it keeps between frames: pipelines, photos, the last
/// lens' rays and the picture's buffers.
pub struct Gpu {
    device: wgpu::Device,
    queue: wgpu::Queue,
    info: wgpu::AdapterInfo,
    description: String,
    pipelines: Pipelines,
    sampler: wgpu::Sampler,
    photos: Option<Layers>,
    residency: Residency,
    masks: Option<Layers>,
    distances: Option<Layers>,
    no_layers: wgpu::TextureView,
    rays: Option<(Lens, [u32; 2], wgpu::TextureView)>,
    target: Option<Target>,
    failure: Arc<Mutex<Option<String>>>,
}

/// How the shaders number source views.
#[derive(Clone, Copy)]
enum Order {
    /// As the lumigraph does, passing over those that take no part in the frame.
    AsGiven,
    /// By their layer of the photos' array, those that have one.
    ByLayer,
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
    /// No driver answers.
    pub fn open() -> Result<Self, RenderError> {
        let instance =
            wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle_from_env());
        let adapter = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions {
            power_preference: wgpu::PowerPreference::HighPerformance,
            ..Default::default()
        }))
        .map_err(|e| RenderError::Gpu(format!("no graphics driver answers ({e})")))?;
        let info = adapter.get_info();
        let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("lumigraph"),
            required_limits: adapter.limits(),
            ..Default::default()
        }))
        .map_err(|e| RenderError::Gpu(format!("{}: {e}", info.name)))?;

        // Errors that no call returns are kept for the next one that can.
        let failure = Arc::new(Mutex::new(None));
        let first_failure = Arc::clone(&failure);
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            if let Ok(mut slot) = first_failure.lock() {
                slot.get_or_insert(error.to_string());
            }
        }));

        let pipelines = Pipelines::new(&device);
        let sampler = device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("photos"),
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            mipmap_filter: wgpu::MipmapFilterMode::Linear,
            ..Default::default()
        });
        let no_layers = photos::no_layers(&device);
        let description = format!("{} ({:?})", info.name, info.backend);
        Ok(Self {
            device,
            queue,
            info,
            description,
            pipelines,
            sampler,
            photos: None,
            residency: Residency::default(),
            masks: None,
            distances: None,
            no_layers,
            rays: None,
            target: None,
            failure,
        })
    }

    /// Whether the driver imitates a graphics processor in software.
    pub fn is_software(&self) -> bool {
        self.info.device_type == wgpu::DeviceType::Cpu
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

    /// The source views whose photos are on the device, in no order.
    pub fn resident(&self, photos: &PhotoStore) -> Vec<usize> {
        let layers = self.photos.as_ref();
        layers.map_or_else(Vec::new, |layers| layers.resident(photos.id()))
    }

    /// The device's name and its driver, for people.
    pub fn description(&self) -> &str {
        &self.description
    }

    /// Draws a frame.
    ///
    /// # Errors
    /// A photo that is needed cannot be decoded; the triangulation refuses the view; the
    /// device fails or its limits do not suffice.
    pub fn render(&mut self, frame: &Frame<'_>, method: Method) -> Result<RgbaImage, RenderError> {
        match method {
            Method::Exact => self.render_exact(frame),
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
        let shared = self.prepare(frame, &field.listed(), Order::ByLayer)?;

        let corners_of = |bordered: bool| -> Vec<Corner> {
            let triangles = field.triangles.iter().filter(|t| t.bordered == bordered);
            triangles
                .flat_map(|triangle| {
                    let list = [triangle.first_entry, triangle.entry_count];
                    let pixel = |i: u32| field.vertices[i as usize].as_vec2().to_array();
                    triangle.corners.map(|i| Corner {
                        pixel: pixel(i),
                        list,
                    })
                })
                .collect()
        };
        let plain = corners_of(false);
        let bordered = corners_of(true);
        let photos = self.photos.as_ref().expect("prepared above");
        let entry = |e: &FieldEntry| Entry {
            source_idx: photos.layer(e.source_idx as usize).unwrap_or(0) as f32,
            values: e.values,
        };
        let entries: Vec<Entry> = field.entries.iter().map(entry).collect();
        let plain_buffer = self.buffer("corners", &plain, wgpu::BufferUsages::VERTEX);
        let bordered_buffer = self.buffer("corners", &bordered, wgpu::BufferUsages::VERTEX);
        let entries = self.table("entries", bytemuck::cast_slice(&entries), layout::ENTRY_ROW);
        let photos = self.photos.as_ref().expect("prepared above");
        let own =
            self.pipelines
                .triangulated_group(&self.device, &photos.view, &self.sampler, &entries);
        let special = Special::of(frame);
        self.pipelines
            .ensure(&self.device, Pass::Triangles, special);
        self.pipelines
            .ensure(&self.device, Pass::BorderedTriangles, special);
        self.draw(frame, |pass, pipelines| {
            pass.set_bind_group(0, &shared, &[]);
            pass.set_bind_group(1, &own, &[]);
            pass.set_pipeline(pipelines.get(Pass::Triangles, special));
            pass.set_vertex_buffer(0, plain_buffer.slice(..));
            pass.draw(0..plain.len() as u32, 0..1);
            pass.set_pipeline(pipelines.get(Pass::BorderedTriangles, special));
            pass.set_vertex_buffer(0, bordered_buffer.slice(..));
            pass.draw(0..bordered.len() as u32, 0..1);
        })
    }

    /// Draws the exact field. A first pass finds the photos that it samples, unless all
    /// that take part are on the device already.
    fn render_exact(&mut self, frame: &Frame<'_>) -> Result<RgbaImage, RenderError> {
        let store_id = frame.lumigraph.photos.id();
        let taking_part: Vec<usize> = frame.taking_part().collect();
        let photos = self.photos.as_ref();
        // More of them than there is room for are never there in full.
        let limits = self.device.limits();
        let fit = room::fit(frame, taking_part.len(), self.residency.budget, &limits);
        if !fit || !photos.is_some_and(|p| p.holds(store_id, &taking_part)) {
            let used = self.mark(frame)?;
            self.prepare(frame, &used, Order::AsGiven)?;
        }
        let shared = self.prepare(frame, &[], Order::AsGiven)?;
        let photos = self.photos.as_ref().expect("prepared above");
        let own = self
            .pipelines
            .exact_group(&self.device, &photos.view, &self.sampler);
        let special = Special::of(frame);
        self.pipelines.ensure(&self.device, Pass::Exact, special);
        self.draw(frame, |pass, pipelines| {
            pass.set_pipeline(pipelines.get(Pass::Exact, special));
            pass.set_bind_group(0, &shared, &[]);
            pass.set_bind_group(1, &own, &[]);
            pass.draw(0..3, 0..1);
        })
    }

    /// The source views that the exact field samples anywhere in the picture.
    fn mark(&mut self, frame: &Frame<'_>) -> Result<Vec<usize>, RenderError> {
        let shared = self.prepare(frame, &[], Order::AsGiven)?;
        let zeros = vec![0_u32; frame.sources.len().max(1)];
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
        let used = self.buffer("used photos", &zeros, usage);
        let own = self.pipelines.mark_group(&self.device, &used);
        let readback = target::readback_buffer(&self.device, used.size());
        let mut encoder = self.device.create_command_encoder(&Default::default());
        {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(self.pipelines.mark(&self.device, Special::of(frame)));
            pass.set_bind_group(0, &shared, &[]);
            pass.set_bind_group(1, &own, &[]);
            let (width, height) = (frame.desired.width, frame.desired.height);
            pass.dispatch_workgroups(width.div_ceil(8), height.div_ceil(8), 1);
        }
        encoder.copy_buffer_to_buffer(&used, 0, &readback, 0, used.size());
        self.queue.submit([encoder.finish()]);
        let bytes = target::read(&self.device, &readback);
        self.check()?;
        let flags: Vec<u32> = bytemuck::pod_collect_to_vec(&bytes?);
        let flagged = frame.taking_part().zip(flags);
        Ok(flagged
            .filter(|(_, flag)| *flag != 0)
            .map(|(source_idx, _)| source_idx)
            .collect())
    }

    /// Brings photos, masks, source views and parameters to the device; returns the bind
    /// group that all shaders share.
    fn prepare(
        &mut self,
        frame: &Frame<'_>,
        wanted: &[usize],
        order: Order,
    ) -> Result<wgpu::BindGroup, RenderError> {
        let (device, queue) = (&self.device, &self.queue);
        if !wanted.is_empty() {
            frame.lumigraph.photos.begin_frame();
        }
        Layers::ensure(
            &mut self.photos,
            &mut self.residency,
            Content::Photos,
            device,
            queue,
            frame,
            wanted,
        )?;
        // The exact field weighs all views, and asks all masks and distance maps.
        let store = &frame.lumigraph.photos;
        let weighed: Vec<usize> = match order {
            Order::AsGiven => (0..frame.sources.len()).collect(),
            Order::ByLayer => wanted.to_vec(),
        };
        if frame.lumigraph.visibility.is_some() {
            Layers::ensure(
                &mut self.distances,
                &mut Residency::default(),
                Content::Distances,
                device,
                queue,
                frame,
                &weighed,
            )?;
        } else {
            self.distances = None;
        }
        let mut masked = weighed;
        masked.retain(|&i| store.is_masked(i));
        if store.any_masked() {
            Layers::ensure(
                &mut self.masks,
                &mut Residency::default(),
                Content::Masks,
                device,
                queue,
                frame,
                &masked,
            )?;
        } else {
            self.masks = None;
        }
        let rays = self.rays(frame)?;
        let photos = self.photos.as_ref().expect("ensured above");
        let (masks, distances) = (self.masks.as_ref(), self.distances.as_ref());
        let params = Params::of(frame, photos.size, photos.finest);
        let source = |i| {
            let layer_of = |layers: Option<&Layers>| layers.and_then(|layers| layers.layer(i));
            Source::of(
                frame,
                i,
                [photos.layer(i), layer_of(masks), layer_of(distances)],
            )
        };
        let listed = match order {
            Order::AsGiven => frame.taking_part().collect(),
            Order::ByLayer => photos.by_layer(),
        };
        let sources: Vec<Source> = listed.into_iter().map(source).collect();
        let planes = self.planes(frame);
        let params = self.buffer("params", &[params], wgpu::BufferUsages::STORAGE);
        let sources = self.table(
            "sources",
            bytemuck::cast_slice(&sources),
            layout::SOURCE_ROW,
        );
        let view = |layers: Option<&'_ Layers>| layers.map_or(&self.no_layers, |l| &l.view).clone();
        Ok(self.pipelines.shared_group(
            &self.device,
            &params,
            &sources,
            &rays,
            &planes,
            &view(masks),
            &self.sampler,
            &view(distances),
        ))
    }

    /// The table of rays of a lens that is not a pinhole; a single texel otherwise.
    fn rays(&mut self, frame: &Frame<'_>) -> Result<wgpu::TextureView, RenderError> {
        let desired = &frame.desired;
        let size = [desired.width, desired.height];
        if let Some((lens, of_size, view)) = &self.rays
            && (*lens, *of_size) == (desired.lens, size)
        {
            return Ok(view.clone());
        }
        let (width, height, texels) = match RayMap::of(desired) {
            RayMap::Pinhole { .. } => (1, 1, vec![[0.0; 4]]),
            RayMap::Table { mut rays, .. } => {
                // Shaders may assume there are no NaNs: no ray is the zero vector there.
                rays.iter_mut()
                    .filter(|r| r[0].is_nan())
                    .for_each(|r| *r = [0.0; 4]);
                (size[0], size[1], rays)
            }
        };
        let side = self.device.limits().max_texture_dimension_2d;
        if size[0] > side || size[1] > side {
            return Err(RenderError::Gpu(format!(
                "a picture of {} × {} is more than this device draws ({side} × {side}); \
                 use --device cpu or a smaller --size",
                size[0], size[1]
            )));
        }
        let view = self.texels("rays", width, height, &texels);
        self.rays = Some((desired.lens, size, view.clone()));
        Ok(view)
    }

    /// The plane that each pixel sees; a single texel where all see the same.
    fn planes(&self, frame: &Frame<'_>) -> wgpu::TextureView {
        let Surface::Facets(map) = &frame.surface else {
            return self.texels("planes", 1, 1, &[[0.0; 4]]);
        };
        let texels: Vec<[f32; 4]> = map
            .planes()
            .map(|plane| plane.map_or([0.0; 4], |q| q.as_vec3().extend(1.0).to_array()))
            .collect();
        self.texels("planes", frame.desired.width, frame.desired.height, &texels)
    }

    /// A list of texels as a texture of rows of `row` texels; never empty.
    fn table(&self, label: &str, texels: &[[f32; 4]], row: u32) -> wgpu::TextureView {
        let height = (texels.len() as u32).div_ceil(row).max(1);
        let mut texels = texels.to_vec();
        texels.resize((row * height) as usize, [0.0; 4]);
        self.texels(label, row, height, &texels)
    }

    fn texels(
        &self,
        label: &str,
        width: u32,
        height: u32,
        texels: &[[f32; 4]],
    ) -> wgpu::TextureView {
        let descriptor = wgpu::TextureDescriptor {
            label: Some(label),
            size: wgpu::Extent3d {
                width,
                height,
                depth_or_array_layers: 1,
            },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba32Float,
            usage: wgpu::TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        };
        let order = wgpu::util::TextureDataOrder::LayerMajor;
        let bytes = bytemuck::cast_slice(texels);
        let texture = self
            .device
            .create_texture_with_data(&self.queue, &descriptor, order, bytes);
        texture.create_view(&Default::default())
    }

    fn buffer<T: bytemuck::Pod>(
        &self,
        label: &str,
        contents: &[T],
        usage: wgpu::BufferUsages,
    ) -> wgpu::Buffer {
        // Bindings may not be empty.
        let empty = [0_u8; 16];
        let contents: &[u8] = if contents.is_empty() {
            &empty
        } else {
            bytemuck::cast_slice(contents)
        };
        let descriptor = wgpu::util::BufferInitDescriptor {
            label: Some(label),
            contents,
            usage,
        };
        self.device.create_buffer_init(&descriptor)
    }

    /// One render pass over a cleared picture, and the picture.
    fn draw(
        &mut self,
        frame: &Frame<'_>,
        record: impl FnOnce(&mut wgpu::RenderPass<'_>, &Pipelines),
    ) -> Result<RgbaImage, RenderError> {
        let (width, height) = (frame.desired.width, frame.desired.height);
        if self
            .target
            .as_ref()
            .is_none_or(|t| t.size != [width, height])
        {
            let bytes = u64::from(width.next_multiple_of(64)) * u64::from(height) * 4;
            let limit = self.device.limits().max_buffer_size;
            if bytes > limit {
                return Err(RenderError::Gpu(format!(
                    "a picture of {width} × {height} takes {bytes} bytes, more than this device \
                     reads back at once ({limit}); use --device cpu or a smaller --size"
                )));
            }
            self.target = Some(Target::new(&self.device, width, height));
        }
        let target = self.target.as_ref().expect("made above");
        let mut encoder = self.device.create_command_encoder(&Default::default());
        {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("frame"),
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: &target.view,
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations {
                        load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                        store: wgpu::StoreOp::Store,
                    },
                })],
                ..Default::default()
            });
            record(&mut pass, &self.pipelines);
        }
        target.copy_to_readback(&mut encoder);
        self.queue.submit([encoder.finish()]);
        let picture = target.read(&self.device);
        self.check()?;
        picture
    }

    /// The first failure that the device has reported, once.
    fn check(&self) -> Result<(), RenderError> {
        let failure = self.failure.lock().ok().and_then(|mut slot| slot.take());
        failure.map_or(Ok(()), |message| Err(RenderError::Gpu(message)))
    }
}
