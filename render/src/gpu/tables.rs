//! What shaders read besides photos: parameters and tables, made for each frame or part of one.

use super::Gpu;
use super::device::error_of;
use super::groups::Rect;
use super::layout::{self, Params, Source};
use super::load::Order;
use super::photos::Layers;
use super::target::flat;
use crate::RenderError;
use crate::frame::Frame;
use crate::rays::RayMap;
use crate::surface::{Packed, Surface};
use wgpu::util::DeviceExt;

/// Four numbers a texel.
const FLOATS: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Float;

/// The tables that all parts of a frame share.
pub(super) struct Tables {
    pub rays: wgpu::TextureView,
    pub planes: wgpu::TextureView,
    pub facets: wgpu::TextureView,
    table_row_bits: u32,
}

impl Gpu {
    pub(super) fn tables(&mut self, frame: &Frame<'_>) -> Result<Tables, RenderError> {
        let size = [frame.desired.width, frame.desired.height];
        let side = self.limits.max_texture_dimension_2d;
        if size[0] > side || size[1] > side {
            return Err(RenderError::Gpu(format!(
                "a picture of {} × {} is more than this device draws ({side} × {side}); \
                 use --device cpu or a smaller --size",
                size[0], size[1]
            )));
        }
        let rows = frame
            .sources
            .len()
            .div_ceil(layout::SOURCES_PER_ROW as usize);
        if rows > side as usize {
            return Err(RenderError::Gpu(format!(
                "{} photos are more than this device weighs; use --device cpu",
                frame.sources.len()
            )));
        }
        let table_row_bits = side.ilog2();
        let [planes, facets] = self.planes(frame, table_row_bits)?;
        Ok(Tables {
            rays: self.rays(frame)?,
            planes,
            facets,
            table_row_bits,
        })
    }

    /// The bind group that all shaders share, with the photos on the device and what lies beside
    /// them. `rect` is the part whose photos are marked.
    pub(super) fn shared_group(
        &mut self,
        frame: &Frame<'_>,
        tables: &Tables,
        order: Order,
        rect: Rect,
    ) -> Result<wgpu::BindGroup, RenderError> {
        self.bring_beside(frame, order)?;
        let photos = self.photos.as_ref().expect("brought before");
        let (masks, distances) = (self.masks.as_ref(), self.distances.as_ref());
        let params = Params::of(
            frame,
            photos.size,
            photos.finest,
            rect,
            tables.table_row_bits,
        );
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
        let mut sources: Vec<Source> = listed.into_iter().map(source).collect();
        let count = sources.len() as f32;
        sources.iter_mut().for_each(|source| source.count = count);
        let params = self.buffer("params", &[params], wgpu::BufferUsages::UNIFORM);
        let sources = bytemuck::cast_slice(&sources);
        let sources = self.table("sources", FLOATS, sources, layout::SOURCE_ROW);
        let view = |layers: Option<&'_ Layers>| layers.map_or(&self.no_layers, |l| &l.view).clone();
        Ok(self.pipelines.shared_group(
            &self.device,
            &params,
            &sources,
            tables,
            &view(masks),
            &self.sampler,
            &view(distances),
        ))
    }

    /// The table of rays of a lens that is not a pinhole; a single texel otherwise.
    ///
    /// # Errors
    /// The device has no room for it. It is not kept then.
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
        let out_of_memory = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let refused = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let view = self.texels("rays", width, height, &texels);
        // What follows from a lack of memory is refused, too: the lack goes before.
        let refused = pollster::block_on(refused.pop());
        if let Some(error) = pollster::block_on(out_of_memory.pop()).or(refused) {
            return Err(error_of(&error));
        }
        self.rays = Some((desired.lens, size, view.clone()));
        Ok(view)
    }

    /// The planes that pixels see, after that of none, and which of them each pixel sees, as [`Packed`]
    /// says it; a single texel each where all see the same.
    fn planes(
        &self,
        frame: &Frame<'_>,
        row_bits: u32,
    ) -> Result<[wgpu::TextureView; 2], RenderError> {
        let format = wgpu::TextureFormat::R32Uint;
        let Surface::Facets(map) = &frame.surface else {
            let planes = self.texels("planes", 1, 1, &[[0.0; 4]]);
            return Ok([planes, self.texture("facets", [1, 1], format, &[0; 4])]);
        };
        let Packed {
            planes,
            mut numbers,
        } = map.packed(self.pipelines.shade_by.looks_up_tiles());
        let (row, side) = (1 << row_bits, self.limits.max_texture_dimension_2d);
        let most = row as usize * side as usize;
        if planes.len() >= most || numbers.len() > most {
            return Err(RenderError::Gpu(format!(
                "a picture of {} facets is more than this device draws; use --device cpu or a smaller --size",
                planes.len()
            )));
        }
        let seen = planes.iter().map(|q| q.as_vec3().extend(1.0).to_array());
        let texels: Vec<[f32; 4]> = std::iter::once([0.0; 4]).chain(seen).collect();
        let planes = self.table("planes", FLOATS, bytemuck::cast_slice(&texels), row);
        let size = match self.pipelines.shade_by.looks_up_tiles() {
            true => [row, (numbers.len() as u32).div_ceil(row)],
            false => [frame.desired.width, frame.desired.height],
        };
        numbers.resize(size[0] as usize * size[1] as usize, 0);
        let numbers = bytemuck::cast_slice(&numbers);
        Ok([planes, self.texture("facets", size, format, numbers)])
    }

    /// A list of texels as a texture of rows of `row` texels; never empty.
    pub(super) fn table(
        &self,
        label: &str,
        format: wgpu::TextureFormat,
        texels: &[[u32; 4]],
        row: u32,
    ) -> wgpu::TextureView {
        let height = (texels.len() as u32).div_ceil(row).max(1);
        let mut texels = texels.to_vec();
        texels.resize((row * height) as usize, [0; 4]);
        self.texture(label, [row, height], format, bytemuck::cast_slice(&texels))
    }

    fn texels(
        &self,
        label: &str,
        width: u32,
        height: u32,
        texels: &[[f32; 4]],
    ) -> wgpu::TextureView {
        self.texture(label, [width, height], FLOATS, bytemuck::cast_slice(texels))
    }

    fn texture(
        &self,
        label: &str,
        size: [u32; 2],
        format: wgpu::TextureFormat,
        bytes: &[u8],
    ) -> wgpu::TextureView {
        let descriptor = flat(label, format, size, wgpu::TextureUsages::TEXTURE_BINDING);
        let order = wgpu::util::TextureDataOrder::LayerMajor;
        let texture = self
            .device
            .create_texture_with_data(&self.queue, &descriptor, order, bytes);
        texture.create_view(&Default::default())
    }

    pub(super) fn buffer<T: bytemuck::Pod>(
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
        // Written rather than mapped: mapping panics on a device that is lost.
        let buffer = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size: contents.len() as u64,
            usage: usage | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        self.queue.write_buffer(&buffer, 0, contents);
        buffer
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::every_lens;
    use crate::gpu::DeviceLimits;

    #[test]
    fn rays_that_a_device_refused_are_asked_for_again() {
        let lumigraph = every_lens::lumigraph();
        let frame = every_lens::frame(&lumigraph);
        let wide = |side: u32| {
            let view = frame.desired.resized(side, side);
            let camera = calibrate::Camera {
                model: calibrate::ModelKind::SimpleFisheye,
                width: side,
                height: side,
                params: vec![
                    f64::from(side),
                    0.5 * f64::from(side),
                    0.5 * f64::from(side),
                ],
            };
            let lens = camera.lens().unwrap();
            Frame::new(&lumigraph, calibrate::View { lens, ..view }, frame.options)
        };
        let limits = DeviceLimits {
            texture_side: Some(64),
            ..DeviceLimits::default()
        };
        let mut gpu = match Gpu::open_within(limits) {
            Ok(gpu) => gpu,
            Err(error) if std::env::var("LUMIGRAPH_REQUIRE_GPU").as_deref() == Ok("1") => {
                panic!("LUMIGRAPH_REQUIRE_GPU is 1, but: {error}")
            }
            Err(error) => {
                eprintln!("SKIPPED: tables on the graphics device: {error}");
                return;
            }
        };
        let (large, small) = (wide(100), wide(40));
        for _ in 0..2 {
            assert!(gpu.rays(&large).is_err() && gpu.rays.is_none());
        }
        gpu.rays(&small).unwrap();
        assert!(gpu.rays.is_some());
        // Whoever asked was told, and nobody else is.
        gpu.trouble.take().unwrap();
    }
}
