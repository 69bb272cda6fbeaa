//! The photos and the masks on the device: a texture array each, filled as frames ask.

use super::room::{Content, Room};
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
    /// How many layers there is memory for: `u32::MAX` until it was once for fewer than asked.
    affordable: u32,
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

/// Where arrays are made.
#[derive(Clone, Copy)]
pub(crate) struct Maker<'a> {
    pub device: &'a wgpu::Device,
    pub queue: &'a wgpu::Queue,
    /// Whether it is OpenGL.
    pub opengl: bool,
    /// Bytes that an array of photos may take, if something says so.
    pub array_bytes: Option<u64>,
}

impl Maker<'_> {
    /// How many layers to ask for so that there are as many, and they are an array.
    ///
    /// A texture of OpenGL is made as one of a kind, and wgpu guesses which: one layer is no
    /// array, and six squares, or twelve, are cubes. Sampled as arrays both are black.
    fn layers_of_array(&self, count: u32, square: bool) -> u32 {
        let guessed_wrong = count == 1 || (square && count.is_multiple_of(6));
        count + u32::from(self.opengl && guessed_wrong)
    }
}

/// Why photos are not on the device.
#[derive(Debug)]
pub(crate) enum Shortage {
    /// There is no memory for so many layers in one array.
    Memory { count: u32, message: String },
    /// Anything else.
    Render(RenderError),
}

impl From<Shortage> for RenderError {
    fn from(shortage: Shortage) -> Self {
        match shortage {
            Shortage::Memory { message, .. } => Self::DeviceFull(message),
            Shortage::Render(error) => error,
        }
    }
}

impl From<RenderError> for Shortage {
    fn from(error: RenderError) -> Self {
        Self::Render(error)
    }
}

/// Layers of an array that so many need: half as many more, because each time that it grows all of
/// them are brought again.
fn grown(needed: u32) -> u32 {
    (needed + needed / 2).next_multiple_of(8)
}

/// Layers to make do with where there is no memory for `count`: three quarters as many, though not
/// at once fewer than any of `stops` that are less.
fn fewer(count: u32, stops: [u32; 3]) -> u32 {
    let stops = stops.into_iter().filter(|stop| *stop < count);
    stops.fold(count - count.div_ceil(4), u32::max)
}

impl Layers {
    /// Makes sure that the photos or masks of the given source views are on the device, within
    /// the room that their frame has. Those that are there already stay if there is room, else
    /// the least recently used go.
    ///
    /// # Errors
    /// A photo or a mask cannot be decoded; there is no memory for so many, which
    /// [`Shortage::Memory`] counts.
    pub(crate) fn ensure(
        current: &mut Option<Self>,
        residency: &mut Residency,
        content: Content,
        maker: Maker<'_>,
        frame: &Frame<'_>,
        room: Room,
        wanted: &[usize],
    ) -> Result<(), Shortage> {
        let store_id = content.id(frame);
        if wanted.is_empty() && current.as_ref().is_some_and(|p| p.store_id == store_id) {
            return Ok(());
        }
        if wanted.is_empty() {
            // Something must be there to be bound, however small.
            Self::release(current, residency, maker);
            let finest = content.coarsest();
            let layers = Self::allocate(content, maker, frame, store_id, finest, 1)?;
            residency.change(layers.bytes(), 0);
            *current = Some(layers);
            return Ok(());
        }
        let mut most = room.most.min(frame.lumigraph.sources.len().max(1) as u32);
        let size = content.layer_size(frame);
        if wanted.len() < most as usize && maker.layers_of_array(most, size[0] == size[1]) > most {
            // One less rather than one that nothing is in.
            most -= 1;
        }
        if wanted.len() > most as usize {
            // The same words for every such frame, so that they are said once.
            return Err(Shortage::Render(RenderError::Gpu(format!(
                "more {} are needed at once than this device holds; use --device cpu",
                content.name()
            ))));
        }
        let alike = |p: &Self| p.store_id == store_id && p.finest == room.finest;
        let known = current.as_ref().filter(|p| alike(p));
        let (mut affordable, there) = known.map_or((u32::MAX, 0), |p| (p.affordable, p.capacity));
        if !room.grouped {
            // To try for more again would cost all that is there, frame after frame.
            most = most.min(affordable.max(wanted.len() as u32));
        }
        let fits = |p: &Self| alike(p) && p.capacity <= room.most;
        let missing = |p: &Self| wanted.iter().filter(|&&i| p.layers[i].is_none()).count() as u32;
        let enough = |p: &Self| p.used() + missing(p) <= p.capacity || p.capacity >= most;
        if !current.as_ref().is_some_and(|p| fits(p) && enough(p)) {
            // A new array, with room for what is wanted, what is there and some more.
            let old = current.as_ref();
            let keep = old
                .filter(|p| fits(p))
                .map_or_else(Vec::new, |p| p.by_age(wanted));
            let keep_count = keep.len().min(most as usize - wanted.len());
            let others = old.map_or(0, |p| p.others(wanted));
            Self::release(current, residency, maker);
            let least = wanted.len() as u32;
            let needed = least + keep_count as u32;
            let mut capacity = if residency.budget.is_some() || room.grouped {
                // Made once, it need not be filled again when more comes.
                most
            } else {
                grown(needed).min(most)
            };
            let allocate =
                |count| Self::allocate(content, maker, frame, store_id, room.finest, count);
            let mut layers = loop {
                match allocate(capacity) {
                    Err(Shortage::Memory { .. }) if capacity > least && !room.grouped => {
                        capacity = fewer(capacity, [needed, there, least]);
                        affordable = capacity;
                    }
                    made => break made?,
                }
            };
            layers.affordable = affordable.max(capacity);
            let keep_count = keep_count.min((capacity - least) as usize);
            residency.evictions += others - keep_count as u64;
            residency.change(layers.bytes(), 0);
            let mut all = keep[keep.len() - keep_count..].to_vec();
            all.extend(wanted);
            all.sort_unstable();
            let filled = layers.fill(maker, frame, residency, &all);
            layers.touch(wanted);
            *current = Some(layers);
            return filled.map_err(Shortage::Render);
        }
        let Some(layers) = current else { return Ok(()) };
        layers.touch(wanted);
        layers
            .fill(maker, frame, residency, wanted)
            .map_err(Shortage::Render)
    }

    /// Gives an array's memory back, at once rather than when nobody can ask for it any more.
    fn release(current: &mut Option<Self>, residency: &mut Residency, maker: Maker<'_>) {
        if let Some(old) = current.take() {
            residency.change(0, old.bytes());
            old.texture.destroy();
            // Whatever it says, the next call will hear it, too.
            let _ = maker.device.poll(wgpu::PollType::Poll);
        }
    }

    fn allocate(
        content: Content,
        maker: Maker<'_>,
        frame: &Frame<'_>,
        store_id: u64,
        finest: usize,
        capacity: u32,
    ) -> Result<Self, Shortage> {
        let Maker { device, .. } = maker;
        let (label, format) = match content {
            Content::Photos => ("photos", wgpu::TextureFormat::Rgba8Unorm),
            Content::Masks => ("masks", wgpu::TextureFormat::R8Unorm),
            Content::Distances => ("distances", wgpu::TextureFormat::R16Float),
        };
        let size = content.layer_size(frame);
        let [width, height] = size.map(|side| side >> finest);
        let short = |why: &str| Shortage::Memory {
            count: capacity,
            message: format!(
                "no room for {capacity} {} of {width} × {height} ({why}); use --gpu-memory or \
                 --device cpu",
                content.name()
            ),
        };
        let bytes = content.layer_bytes(size, finest) * u64::from(capacity);
        if content == Content::Photos && maker.array_bytes.is_some_and(|most| bytes > most) {
            return Err(short("more bytes than allowed"));
        }
        let out_of_memory = device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let refused = device.push_error_scope(wgpu::ErrorFilter::Validation);
        let texture = device.create_texture(&wgpu::TextureDescriptor {
            label: Some(label),
            size: wgpu::Extent3d {
                width,
                height,
                depth_or_array_layers: maker.layers_of_array(capacity, width == height),
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
            return Err(short(&error.to_string()));
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
            affordable: u32::MAX,
            clock: 0,
        })
    }

    fn used(&self) -> u32 {
        self.slots.len() as u32
    }

    /// Bytes on the device.
    fn bytes(&self) -> u64 {
        let layers = u64::from(self.texture.depth_or_array_layers());
        self.content.layer_bytes(self.size, self.finest) * layers
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
        Maker { device, queue, .. }: Maker<'_>,
        frame: &Frame<'_>,
        residency: &mut Residency,
        wanted: &[usize],
    ) -> Result<(), RenderError> {
        let missing: Vec<usize> = wanted
            .iter()
            .copied()
            .filter(|&i| self.layers[i].is_none())
            .collect();
        if missing.is_empty() {
            return Ok(());
        }
        let mut old = self.by_age(wanted).into_iter();
        // As many at a time as there are threads to decode them.
        for some in missing.chunks(rayon::current_num_threads().max(1)) {
            let photos = &frame.lumigraph.photos;
            let decoded: Vec<_> = match self.content {
                Content::Photos => some.par_iter().map(|&i| photos.get(i).map(Some)).collect(),
                Content::Masks | Content::Distances => vec![Ok(None); some.len()],
            };
            if decoded.iter().any(Result::is_err) {
                photos.find_missed(&missing);
            }
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

    /// The source views that were wanted last, in no order.
    pub(crate) fn recent(&self) -> Vec<usize> {
        let slots = self.slots.iter();
        let recent = slots.filter(|slot| slot.last_used == self.clock);
        recent.filter_map(|slot| slot.source_idx).collect()
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
        // OpenGL knows no array of one; see `Maker::layers_of_array`.
        size: wgpu::Extent3d {
            depth_or_array_layers: 2,
            ..wgpu::Extent3d::default()
        },
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrays_grow_by_half() {
        let (mut capacity, mut loads) = (0, 0);
        while capacity < 2000 {
            capacity = grown(capacity + 1);
            loads += capacity;
        }
        assert!(capacity < 3000 && loads < 3 * capacity + 100, "{loads}");
        assert_eq!((grown(1), grown(6), grown(9)), (8, 16, 16));
    }

    #[test]
    fn without_memory_fewer_layers_are_tried_until_the_least() {
        let tried = |from, stops: [u32; 3]| {
            let next = |&count: &u32| (count > stops[2]).then(|| fewer(count, stops));
            std::iter::successors(Some(from), next).collect::<Vec<_>>()
        };
        assert_eq!(tried(48, [30, 0, 10]), [48, 36, 30, 22, 16, 12, 10]);
        // Also just as many as are needed, and as there were.
        assert_eq!(tried(16, [9, 8, 6]), [16, 12, 9, 8, 6]);
        assert_eq!(tried(16, [9, 9, 9]), [16, 12, 9]);
        assert_eq!(tried(2, [1, 0, 1]), [2, 1]);
        for (from, stops) in [(450, [300, 250, 1]), (7, [6, 7, 5]), (8, [1, 0, 1])] {
            let tried = tried(from, stops);
            assert!(tried.is_sorted_by(|a, b| a > b) && tried.contains(&stops[0]));
            assert_eq!(tried.last(), Some(&stops[2]));
        }
    }
}
