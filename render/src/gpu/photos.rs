//! The photos and the masks on the device: a texture array each, filled as frames ask.

use crate::RenderError;
use crate::frame::Frame;
use crate::pyramid::MAX_LEVELS;
use crate::visibility::{DistanceMap, REDUCTION};
use image::{ImageBuffer, Luma, Pixel};

/// What a texture array holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Content {
    /// Premultiplied RGBA.
    Photos,
    /// The ignore masks of the views that have one.
    Masks,
    /// Distance maps, half as large as the photos.
    Distances,
}

impl Content {
    /// Tells what the layers were made from.
    fn id(self, frame: &Frame<'_>) -> u64 {
        match (self, &frame.lumigraph.visibility) {
            (Self::Distances, Some(visibility)) => visibility.id(),
            _ => frame.lumigraph.photos.id(),
        }
    }
}

/// A texture array with the photo, or the mask, of one source view a layer.
///
/// Layers are as large as the largest photo, rounded up so that every mip level halves
/// exactly; smaller ones repeat their border once, so that filtering never mixes in
/// anything else.
#[derive(Debug)]
pub(crate) struct Layers {
    content: Content,
    texture: wgpu::Texture,
    pub view: wgpu::TextureView,
    pub size: [u32; 2],
    /// Of what the layers came from.
    store_id: u64,
    /// By source view.
    layers: Vec<Option<u32>>,
    used_layers: u32,
    capacity: u32,
}

/// Both sides of the array are multiples of this, the texel of the coarsest level.
const ALIGNMENT: u32 = 1 << (MAX_LEVELS - 1);

impl Layers {
    /// Makes sure that the photos or masks of the given source views are on the device.
    /// Those that are there already stay.
    pub(crate) fn ensure(
        current: &mut Option<Self>,
        content: Content,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        frame: &Frame<'_>,
        wanted: &[usize],
    ) -> Result<(), RenderError> {
        let store_id = content.id(frame);
        let of_this_store = current.as_ref().filter(|p| p.store_id == store_id);
        let missing = |p: &Self| wanted.iter().filter(|&&i| p.layers[i].is_none()).count() as u32;
        if of_this_store.is_none_or(|p| p.used_layers + missing(p) > p.capacity) {
            // A new array, with room for what is there and what is wanted, and some more.
            let mut keep: Vec<usize> = of_this_store.map_or_else(Vec::new, |p| {
                (0..p.layers.len())
                    .filter(|&i| p.layers[i].is_some())
                    .collect()
            });
            keep.extend(wanted);
            keep.sort_unstable();
            keep.dedup();
            let total = frame.lumigraph.sources.len() as u32;
            let needed = (keep.len() as u32).max(1);
            let capacity = needed.next_multiple_of(8).min(total.max(1));
            *current = None;
            let mut layers = Self::allocate(content, device, frame, store_id, capacity)?;
            layers.fill(queue, frame, &keep)?;
            *current = Some(layers);
            return Ok(());
        }
        match current {
            Some(layers) => layers.fill(queue, frame, wanted),
            None => Ok(()),
        }
    }

    fn allocate(
        content: Content,
        device: &wgpu::Device,
        frame: &Frame<'_>,
        store_id: u64,
        capacity: u32,
    ) -> Result<Self, RenderError> {
        let sources = &frame.lumigraph.sources;
        let largest = |side: fn(&calibrate::View) -> u32| {
            let longest = sources.iter().map(|s| side(&s.view)).max().unwrap_or(1);
            longest.next_multiple_of(ALIGNMENT)
        };
        let size = [largest(|v| v.width), largest(|v| v.height)];
        let limits = device.limits();
        let side = limits.max_texture_dimension_2d;
        if size[0] > side || size[1] > side || capacity > limits.max_texture_array_layers {
            return Err(RenderError::Gpu(format!(
                "{capacity} photos of {} × {} do not fit a texture array of this device \
                 (at most {} of {side} × {side}); use --device cpu",
                size[0], size[1], limits.max_texture_array_layers
            )));
        }
        let (label, format) = match content {
            Content::Photos => ("photos", wgpu::TextureFormat::Rgba8Unorm),
            Content::Masks => ("masks", wgpu::TextureFormat::R8Unorm),
            Content::Distances => ("distances", wgpu::TextureFormat::R16Float),
        };
        let (size, mip_level_count) = match content {
            Content::Photos | Content::Masks => (size, MAX_LEVELS as u32),
            Content::Distances => (size.map(|side| side / REDUCTION), 1),
        };
        let texture = device.create_texture(&wgpu::TextureDescriptor {
            label: Some(label),
            size: wgpu::Extent3d {
                width: size[0],
                height: size[1],
                depth_or_array_layers: capacity,
            },
            mip_level_count,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        let view = array_view(&texture);
        let layers = vec![None; sources.len()];
        Ok(Self {
            content,
            texture,
            view,
            size,
            store_id,
            layers,
            used_layers: 0,
            capacity,
        })
    }

    fn fill(
        &mut self,
        queue: &wgpu::Queue,
        frame: &Frame<'_>,
        wanted: &[usize],
    ) -> Result<(), RenderError> {
        for &source_idx in wanted {
            if self.layers[source_idx].is_none() {
                let photos = &frame.lumigraph.photos;
                match self.content {
                    Content::Photos => self.upload(queue, &photos.get(source_idx)?.levels),
                    Content::Masks => match photos.try_mask(source_idx)? {
                        Some(mask) => self.upload(queue, &mask.levels),
                        None => continue,
                    },
                    Content::Distances => match &frame.lumigraph.visibility {
                        Some(visibility) => self.upload_map(queue, visibility.map(source_idx)),
                        None => continue,
                    },
                }
                self.layers[source_idx] = Some(self.used_layers);
                self.used_layers += 1;
            }
        }
        Ok(())
    }

    /// Fills the first layer that is free.
    fn upload<P: Pixel<Subpixel = u8>>(
        &self,
        queue: &wgpu::Queue,
        levels: &[ImageBuffer<P, Vec<u8>>],
    ) {
        for level in 0..MAX_LEVELS {
            // What is one texel sooner stays one.
            let image = &levels[level.min(levels.len() - 1)];
            let padded = pad(image, self.size[0] >> level, self.size[1] >> level);
            let texel_bytes = u32::from(P::CHANNEL_COUNT);
            self.write(
                queue,
                level as u32,
                padded.dimensions(),
                padded.as_raw(),
                texel_bytes,
            );
        }
    }

    /// Fills the first layer that is free with half floats.
    fn upload_map(&self, queue: &wgpu::Queue, map: &DistanceMap) {
        let halves = map.values.iter().map(|v| half::f16::from_f32(*v).to_bits());
        let image: ImageBuffer<Luma<u16>, Vec<u16>> =
            ImageBuffer::from_raw(map.size[0], map.size[1], halves.collect())
                .expect("as many values as texels");
        let padded = pad(&image, self.size[0], self.size[1]);
        let bytes = bytemuck::cast_slice(padded.as_raw());
        self.write(queue, 0, padded.dimensions(), bytes, 2);
    }

    /// Writes the corner of a level of the first layer that is free.
    fn write(
        &self,
        queue: &wgpu::Queue,
        mip_level: u32,
        (width, height): (u32, u32),
        bytes: &[u8],
        texel_bytes: u32,
    ) {
        let origin = wgpu::Origin3d {
            x: 0,
            y: 0,
            z: self.used_layers,
        };
        queue.write_texture(
            wgpu::TexelCopyTextureInfo {
                texture: &self.texture,
                mip_level,
                origin,
                aspect: wgpu::TextureAspect::All,
            },
            bytes,
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(width * texel_bytes),
                rows_per_image: Some(height),
            },
            wgpu::Extent3d {
                width,
                height,
                depth_or_array_layers: 1,
            },
        );
    }

    /// The layer of a source view, if it is on the device.
    pub(crate) fn layer(&self, source_idx: usize) -> Option<u32> {
        self.layers[source_idx]
    }

    /// The source views on the device, by layer.
    pub(crate) fn by_layer(&self) -> Vec<usize> {
        let mut sources = vec![0; self.used_layers as usize];
        for (source_idx, layer) in self.layers.iter().enumerate() {
            if let Some(layer) = layer {
                sources[*layer as usize] = source_idx;
            }
        }
        sources
    }

    /// Whether all of the given source views' photos are on the device.
    pub(crate) fn holds(&self, store_id: u64, mut wanted: impl Iterator<Item = usize>) -> bool {
        self.store_id == store_id && wanted.all(|i| self.layers[i].is_some())
    }
}

/// What stands in for an array that nothing is read from.
pub(crate) fn no_layers(device: &wgpu::Device) -> wgpu::TextureView {
    array_view(&device.create_texture(&wgpu::TextureDescriptor {
        label: Some("no layers"),
        size: wgpu::Extent3d::default(),
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::R8Unorm,
        usage: wgpu::TextureUsages::TEXTURE_BINDING,
        view_formats: &[],
    }))
}

fn array_view(texture: &wgpu::Texture) -> wgpu::TextureView {
    texture.create_view(&wgpu::TextureViewDescriptor {
        dimension: Some(wgpu::TextureViewDimension::D2Array),
        ..Default::default()
    })
}

/// Repeats the last column and row once, where there is room.
fn pad<P: Pixel>(
    image: &ImageBuffer<P, Vec<P::Subpixel>>,
    room_width: u32,
    room_height: u32,
) -> ImageBuffer<P, Vec<P::Subpixel>> {
    let (width, height) = image.dimensions();
    let padded_width = (width + 1).min(room_width);
    let padded_height = (height + 1).min(room_height);
    ImageBuffer::from_fn(padded_width, padded_height, |x, y| {
        *image.get_pixel(x.min(width - 1), y.min(height - 1))
    })
}
