//! A frame on its way: told to the device, drawn there, and read back when it is done.

use super::groups::Part;
use super::load::Loaded;
use super::passes::Turn;
use super::pipelines::{PICTURE_FORMAT, SEEN_FORMAT};
use super::target::{Arrival, Target, texture};
use super::timing::Stopwatch;
use super::{Gpu, Trouble};
use crate::RenderError;
use crate::field::TriangulatedField;
use crate::frame::Frame;
use image::RgbaImage;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// A frame that a device was told to draw. It may be waited for on any thread, while others are drawn.
#[must_use = "a frame is read back by waiting for it"]
pub struct Drawing {
    device: wgpu::Device,
    queue: wgpu::Queue,
    trouble: Trouble,
    slot: Slot,
    parts: usize,
    picture: Arrival,
    times: Option<Arrival>,
    slots: Slots,
}

/// A frame that was drawn.
#[derive(Clone, Debug)]
pub struct Drawn {
    /// Straight alpha, alpha = coverage.
    pub picture: RgbaImage,
    /// How long the device took; `None` where it does not tell. Marking and uploading are not part of it.
    pub device_time: Option<Duration>,
}

/// Where a frame is drawn to. Kept for others of its size.
pub(super) struct Slot {
    pub target: Target,
    /// Which triangle each pixel sees.
    pub seen: wgpu::TextureView,
    pub stopwatch: Option<Stopwatch>,
}

/// What no drawing uses.
#[derive(Clone, Default)]
pub(super) struct Slots(Arc<Mutex<Vec<Slot>>>);

impl std::fmt::Debug for Drawing {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [width, height] = self.slot.target.size;
        write!(f, "Drawing({width} × {height})")
    }
}

impl Slots {
    /// One of the size; those of other sizes go.
    fn take(&self, size: [u32; 2]) -> Option<Slot> {
        let mut free = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        free.retain(|slot| slot.target.size == size);
        free.pop()
    }

    fn give(&self, slot: Slot) {
        let mut free = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        free.push(slot);
    }
}

impl Gpu {
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
        let drawn = self.begin(frame, field, loaded)?.finish()?;
        self.device_time = drawn.device_time;
        Ok(drawn.picture)
    }

    /// Tells the device to draw a frame, or the field of it, that was loaded before, and does not
    /// wait for it: the next may be prepared, loaded and begun meanwhile. Each that is on its way has
    /// a picture on the device.
    ///
    /// # Errors
    /// As [`Self::render`].
    pub fn begin(
        &mut self,
        frame: &Frame<'_>,
        field: Option<&TriangulatedField>,
        loaded: &Loaded,
    ) -> Result<Drawing, RenderError> {
        let begun = self.try_begin(frame, field, loaded);
        self.told(begun)
    }

    fn try_begin(
        &mut self,
        frame: &Frame<'_>,
        field: Option<&TriangulatedField>,
        loaded: &Loaded,
    ) -> Result<Drawing, RenderError> {
        self.device_time = None;
        let tables = self.tables(frame)?;
        let size = [frame.desired.width, frame.desired.height];
        let parts = loaded.groups.len();
        let slot = self.slot(size, parts);
        let mut last: Option<wgpu::CommandEncoder> = None;
        for (part_idx, group) in loaded.groups.iter().enumerate() {
            let turn = Turn {
                part_idx,
                slot: &slot,
            };
            if let Some(encoder) = last.take() {
                // Before the next part's photos come.
                self.queue.submit([encoder.finish()]);
            }
            self.bring(frame, loaded.room, &group.sources)?;
            last = match (&group.part, field) {
                (Part::Triangles(range), Some(field)) => {
                    Some(self.draw_triangles(frame, &tables, field, range.clone(), turn)?)
                }
                (Part::Pixels(rect), _) => Some(self.draw_pixels(frame, &tables, *rect, turn)?),
                (Part::Triangles(_), None) => None,
            };
        }
        let mut encoder =
            last.unwrap_or_else(|| self.device.create_command_encoder(&Default::default()));
        slot.target.copy(&mut encoder, 0);
        if let Some(stopwatch) = &slot.stopwatch {
            stopwatch.copy(&mut encoder);
        }
        let submitted = self.queue.submit([encoder.finish()]);
        Ok(Drawing {
            device: self.device.clone(),
            queue: self.queue.clone(),
            trouble: self.trouble.clone(),
            parts,
            picture: slot.target.ask(submitted.clone()),
            times: slot.stopwatch.as_ref().map(|s| s.ask(submitted)),
            slot,
            slots: self.slots.clone(),
        })
    }

    fn slot(&self, size: [u32; 2], parts: usize) -> Slot {
        let made = || {
            use wgpu::TextureUsages as Usages;
            let (most_bytes, seen) = (self.limits.max_buffer_size, Usages::TEXTURE_BINDING);
            let picture = Usages::STORAGE_BINDING | Usages::COPY_SRC;
            Slot {
                target: Target::new(&self.device, PICTURE_FORMAT, size, picture, most_bytes),
                seen: texture(&self.device, SEEN_FORMAT, size, seen)
                    .create_view(&Default::default()),
                stopwatch: None,
            }
        };
        let mut slot = self.slots.take(size).unwrap_or_else(made);
        slot.stopwatch = slot.stopwatch.filter(|s| s.is_for(parts));
        if self.timestamps && slot.stopwatch.is_none() {
            slot.stopwatch = Some(Stopwatch::new(&self.device, parts));
        }
        slot
    }
}

impl Drawing {
    /// Waits for the picture.
    ///
    /// # Errors
    /// The device fails, or is lost.
    pub fn finish(self) -> Result<Drawn, RenderError> {
        let mut picture = RgbaImage::default();
        let device_time = self.finish_into(&mut picture)?;
        Ok(Drawn {
            picture,
            device_time,
        })
    }

    /// As [`Self::finish`], into the memory of a picture before it, which is empty after an error.
    ///
    /// # Errors
    /// As [`Self::finish`].
    pub fn finish_into(self, picture: &mut RgbaImage) -> Result<Option<Duration>, RenderError> {
        let trouble = self.trouble.clone();
        let finished = self.read(picture);
        // What the device said goes before what came of it; that it is lost before anything else.
        trouble.take().and(finished)
    }

    fn read(self, picture: &mut RgbaImage) -> Result<Option<Duration>, RenderError> {
        let (slot, device, queue) = (self.slot, &self.device, &self.queue);
        let [width, height] = slot.target.size;
        let mut pixels = std::mem::take(picture).into_raw();
        pixels.clear();
        pixels.reserve_exact(4 * width as usize * height as usize);
        let take = |row: &[u8]| pixels.extend_from_slice(row);
        slot.target.read_rows(device, queue, self.picture, take)?;
        *picture = RgbaImage::from_raw(width, height, pixels).expect("one row each");
        let device_time = match (&slot.stopwatch, self.times) {
            (Some(stopwatch), Some(times)) => stopwatch.read(device, queue, times, self.parts)?,
            _ => None,
        };
        self.slots.give(slot);
        Ok(device_time)
    }
}
