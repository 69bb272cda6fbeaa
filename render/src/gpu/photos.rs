//! The photos and the masks on the device: a texture array each, filled as frames ask.

use super::room::{Content, Room, array_size};
use crate::RenderError;
use crate::frame::Frame;
use crate::pyramid::MAX_LEVELS;
use crate::residency::Residency;
use crate::visibility::DistanceMap;
use image::{ImageBuffer, Luma, Pixel};
use rayon::prelude::*;

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
    /// Of a whole layer in texels, whether or not its finest level is there.
    pub size: [u32; 2],
    /// The photos' mip level that is the array's finest.
    pub finest: usize,
    /// Of what the layers came from.
    store_id: u64,
    /// By source view.
    layers: Vec<Option<u32>>,
    /// By layer.
    slots: Vec<Slot>,
    capacity: u32,
    /// Counts frames.
    clock: u64,
}

/// What a layer holds.
#[derive(Clone, Copy, Debug)]
struct Slot {
    /// `None` where the upload failed.
    source_idx: Option<usize>,
    last_used: u64,
}

impl Layers {
    /// Makes sure that the photos or masks of the given source views are on the device, within
    /// the budget and the device's limits. Those that are there already stay if there is room,
    /// else the least recently used go. Of more photos than there is room for in full, only
    /// coarser mip levels are there.
    pub(crate) fn ensure(
        current: &mut Option<Self>,
        residency: &mut Residency,
        content: Content,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        frame: &Frame<'_>,
        wanted: &[usize],
    ) -> Result<(), RenderError> {
        let store_id = content.id(frame);
        if wanted.is_empty() && current.as_ref().is_some_and(|p| p.store_id == store_id) {
            return Ok(());
        }
        if wanted.is_empty() {
            // Something must be there to be bound, however small.
            let old = current.take();
            residency.change(0, old.as_ref().map_or(0, Self::bytes));
            let finest = content.coarsest();
            let layers = Self::allocate(content, device, frame, store_id, finest, 1)?;
            residency.change(layers.bytes(), 0);
            *current = Some(layers);
            return Ok(());
        }
        let size = array_size(frame);
        let room = Room::of(
            content,
            size,
            wanted.len() as u32,
            residency.budget,
            &device.limits(),
        )?;
        residency.note_frame(room.finest);
        let most = room.most.min(frame.lumigraph.sources.len().max(1) as u32);
        let fits =
            |p: &Self| p.store_id == store_id && p.finest == room.finest && p.capacity <= room.most;
        let missing = |p: &Self| wanted.iter().filter(|&&i| p.layers[i].is_none()).count() as u32;
        let enough = |p: &Self| p.used() + missing(p) <= p.capacity || p.capacity >= most;
        if !current.as_ref().is_some_and(|p| fits(p) && enough(p)) {
            // A new array, with room for what is wanted, what is there and some more.
            let old = current.take();
            let keep = old
                .as_ref()
                .filter(|p| fits(p))
                .map_or_else(Vec::new, |p| p.by_age(wanted));
            let keep_count = keep.len().min(most as usize - wanted.len());
            residency.change(0, old.as_ref().map_or(0, Self::bytes));
            residency.evictions += old.map_or(0, |p| p.others(wanted) - keep_count as u64);
            let needed = (wanted.len() + keep_count).max(1) as u32;
            let capacity = match residency.budget {
                // Made once, it need not be filled again when more comes.
                Some(_) => most,
                None => needed.next_multiple_of(8).min(most),
            };
            let mut layers =
                Self::allocate(content, device, frame, store_id, room.finest, capacity)?;
            residency.change(layers.bytes(), 0);
            let mut all = keep[keep.len() - keep_count..].to_vec();
            all.extend(wanted);
            all.sort_unstable();
            let filled = layers.fill(device, queue, frame, residency, &all);
            layers.touch(wanted);
            *current = Some(layers);
            return filled;
        }
        let Some(layers) = current else { return Ok(()) };
        layers.touch(wanted);
        layers.fill(device, queue, frame, residency, wanted)
    }

    fn allocate(
        content: Content,
        device: &wgpu::Device,
        frame: &Frame<'_>,
        store_id: u64,
        finest: usize,
        capacity: u32,
    ) -> Result<Self, RenderError> {
        let (label, format) = match content {
            Content::Photos => ("photos", wgpu::TextureFormat::Rgba8Unorm),
            Content::Masks => ("masks", wgpu::TextureFormat::R8Unorm),
            Content::Distances => ("distances", wgpu::TextureFormat::R16Float),
        };
        let size = content.layer_size(array_size(frame));
        let out_of_memory = device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let refused = device.push_error_scope(wgpu::ErrorFilter::Validation);
        let texture = device.create_texture(&wgpu::TextureDescriptor {
            label: Some(label),
            size: wgpu::Extent3d {
                width: size[0] >> finest,
                height: size[1] >> finest,
                depth_or_array_layers: capacity,
            },
            mip_level_count: content.levels(finest),
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        let refused = pollster::block_on(refused.pop());
        if let Some(error) = pollster::block_on(out_of_memory.pop()).or(refused) {
            return Err(RenderError::Gpu(format!(
                "no room for {capacity} {label} of {} × {} ({error}); use --gpu-memory or \
                 --device cpu",
                size[0] >> finest,
                size[1] >> finest
            )));
        }
        let view = array_view(&texture);
        Ok(Self {
            content,
            texture,
            view,
            size,
            finest,
            store_id,
            layers: vec![None; frame.lumigraph.sources.len()],
            slots: Vec::new(),
            capacity,
            clock: 0,
        })
    }

    fn used(&self) -> u32 {
        self.slots.len() as u32
    }

    /// Bytes on the device.
    fn bytes(&self) -> u64 {
        self.content.layer_bytes(self.size, self.finest) * u64::from(self.capacity)
    }

    /// The source views that have a layer and are not wanted, the least recently used first.
    fn by_age(&self, wanted: &[usize]) -> Vec<usize> {
        let slots = self.slots.iter();
        let mut by_age: Vec<(u64, usize)> = slots
            .filter_map(|slot| Some((slot.last_used, slot.source_idx?)))
            .filter(|(_, i)| !wanted.contains(i))
            .collect();
        by_age.sort_unstable();
        by_age.into_iter().map(|(_, i)| i).collect()
    }

    /// How many layers hold what is not wanted.
    fn others(&self, wanted: &[usize]) -> u64 {
        self.by_age(wanted).len() as u64
    }

    fn touch(&mut self, wanted: &[usize]) {
        self.clock += 1;
        for layer in wanted.iter().filter_map(|&i| self.layers[i]) {
            self.slots[layer as usize].last_used = self.clock;
        }
    }

    /// Uploads what is missing, in place of the least recently used where no layer is free.
    fn fill(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        frame: &Frame<'_>,
        residency: &mut Residency,
        wanted: &[usize],
    ) -> Result<(), RenderError> {
        let missing: Vec<usize> = wanted
            .iter()
            .copied()
            .filter(|&i| self.layers[i].is_none())
            .collect();
        let mut old = self.by_age(wanted).into_iter();
        // As many at a time as there are threads to decode them.
        for some in missing.chunks(rayon::current_num_threads().max(1)) {
            let photos = &frame.lumigraph.photos;
            let decoded: Vec<_> = match self.content {
                Content::Photos => some.par_iter().map(|&i| photos.get(i).map(Some)).collect(),
                Content::Masks | Content::Distances => vec![Ok(None); some.len()],
            };
            for (&source_idx, photo) in some.iter().zip(decoded) {
                let layer = self.free_layer(&mut old, residency);
                match (self.content, photo?) {
                    (Content::Photos, Some(photo)) => self.upload(queue, layer, &photo.levels),
                    (Content::Photos, None) => continue,
                    (Content::Masks, _) => match photos.try_mask(source_idx)? {
                        Some(mask) => self.upload(queue, layer, &mask.levels),
                        None => continue,
                    },
                    (Content::Distances, _) => match &frame.lumigraph.visibility {
                        Some(visibility) => {
                            self.upload_map(queue, layer, visibility.map(source_idx));
                        }
                        None => continue,
                    },
                }
                residency.loads += 1;
                self.slots[layer as usize] = Slot {
                    source_idx: Some(source_idx),
                    last_used: self.clock,
                };
                self.layers[source_idx] = Some(layer);
            }
            // What waits to be uploaded is in memory twice.
            queue.submit([]);
            device.poll(wgpu::PollType::Poll).map_err(|e| {
                RenderError::Gpu(format!(
                    "the device does not answer while photos go to it: {e}"
                ))
            })?;
        }
        Ok(())
    }

    /// A layer that holds nothing: one never used, one whose upload failed, or the oldest.
    fn free_layer(
        &mut self,
        old: &mut impl Iterator<Item = usize>,
        residency: &mut Residency,
    ) -> u32 {
        let nothing = Slot {
            source_idx: None,
            last_used: 0,
        };
        if let Some(layer) = self.slots.iter().position(|s| s.source_idx.is_none()) {
            return layer as u32;
        }
        if self.used() < self.capacity {
            self.slots.push(nothing);
            return self.used() - 1;
        }
        let layer = old.next().and_then(|i| self.layers[i].take()).unwrap_or(0);
        self.slots[layer as usize] = nothing;
        residency.evictions += 1;
        layer
    }

    /// Fills a layer.
    fn upload<P: Pixel<Subpixel = u8>>(
        &self,
        queue: &wgpu::Queue,
        layer: u32,
        levels: &[ImageBuffer<P, Vec<u8>>],
    ) {
        for level in self.finest..MAX_LEVELS {
            // What is one texel sooner stays one.
            let image = &levels[level.min(levels.len() - 1)];
            let padded = pad(image, self.size[0] >> level, self.size[1] >> level);
            let texel_bytes = u32::from(P::CHANNEL_COUNT);
            self.write(
                queue,
                layer,
                (level - self.finest) as u32,
                padded.dimensions(),
                padded.as_raw(),
                texel_bytes,
            );
        }
    }

    /// Fills a layer with half floats.
    fn upload_map(&self, queue: &wgpu::Queue, layer: u32, map: &DistanceMap) {
        let halves = map.values.iter().map(|v| half::f16::from_f32(*v).to_bits());
        let image: ImageBuffer<Luma<u16>, Vec<u16>> =
            ImageBuffer::from_raw(map.size[0], map.size[1], halves.collect())
                .expect("as many values as texels");
        let padded = pad(&image, self.size[0], self.size[1]);
        let bytes = bytemuck::cast_slice(padded.as_raw());
        self.write(queue, layer, 0, padded.dimensions(), bytes, 2);
    }

    /// Writes the corner of a level of a layer.
    fn write(
        &self,
        queue: &wgpu::Queue,
        layer: u32,
        mip_level: u32,
        (width, height): (u32, u32),
        bytes: &[u8],
        texel_bytes: u32,
    ) {
        let origin = wgpu::Origin3d {
            x: 0,
            y: 0,
            z: layer,
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

    /// The source views on the device, by layer; any for a layer that holds nothing.
    pub(crate) fn by_layer(&self) -> Vec<usize> {
        let slots = self.slots.iter();
        slots.map(|slot| slot.source_idx.unwrap_or(0)).collect()
    }

    /// The source views of a store that have a layer.
    pub(crate) fn resident(&self, store_id: u64) -> Vec<usize> {
        let slots = self.slots.iter().filter(|_| self.store_id == store_id);
        slots.filter_map(|slot| slot.source_idx).collect()
    }

    /// Whether all of the given source views' photos are on the device in full.
    pub(crate) fn holds(&self, store_id: u64, wanted: &[usize]) -> bool {
        self.store_id == store_id
            && self.finest == 0
            && wanted.iter().all(|&i| self.layers[i].is_some())
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
