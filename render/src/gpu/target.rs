//! The picture on the device, and the way back.

use crate::RenderError;
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

/// A picture to draw into and the buffer it is read back through, as many rows at a time as
/// that takes.
#[derive(Debug)]
pub(crate) struct Target {
    pub size: [u32; 2],
    pub view: wgpu::TextureView,
    texture: wgpu::Texture,
    readback: wgpu::Buffer,
    bytes_per_pixel: u32,
    bytes_per_row: u32,
    rows: u32,
}

impl Target {
    /// A picture for some usages besides passes. `most_bytes` are those of a buffer.
    pub(crate) fn new(
        device: &wgpu::Device,
        format: wgpu::TextureFormat,
        [width, height]: [u32; 2],
        usage: wgpu::TextureUsages,
        most_bytes: u64,
    ) -> Self {
        let texture = texture(device, format, [width, height], usage);
        let view = texture.create_view(&Default::default());
        let bytes_per_pixel = format.block_copy_size(None).unwrap_or(4);
        let bytes_per_row =
            (width * bytes_per_pixel).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let rows = (most_bytes / u64::from(bytes_per_row)).clamp(1, u64::from(height.max(1)));
        let readback = readback_buffer(device, u64::from(bytes_per_row) * rows);
        Self {
            size: [width, height],
            view,
            texture,
            readback,
            bytes_per_pixel,
            bytes_per_row,
            rows: rows as u32,
        }
    }

    /// Tells the device to copy rows from `y` on, as many as are read at a time, to where they are read.
    pub(crate) fn copy(&self, encoder: &mut wgpu::CommandEncoder, y: u32) {
        let [width, height] = self.size;
        let rows = self.rows.min(height - y);
        encoder.copy_texture_to_buffer(
            wgpu::TexelCopyTextureInfo {
                origin: wgpu::Origin3d { x: 0, y, z: 0 },
                ..self.texture.as_image_copy()
            },
            wgpu::TexelCopyBufferInfo {
                buffer: &self.readback,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(self.bytes_per_row),
                    rows_per_image: Some(rows),
                },
            },
            wgpu::Extent3d {
                width,
                height: rows,
                depth_or_array_layers: 1,
            },
        );
    }

    /// Asks for the rows that a submission copies.
    pub(crate) fn ask(&self, submitted: wgpu::SubmissionIndex) -> Arrival {
        Arrival::of(&self.readback, self.readback.size(), submitted)
    }

    /// Waits for the first rows and for all that follow, and gives each row's bytes to `take`.
    pub(crate) fn read_rows(
        &self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        first: Arrival,
        mut take: impl FnMut(&[u8]),
    ) -> Result<(), RenderError> {
        let [width, height] = self.size;
        let row_bytes = width as usize * self.bytes_per_pixel as usize;
        let mut arrival = first;
        let mut y = 0;
        loop {
            let rows = self.rows.min(height - y);
            arrival.wait(device)?;
            let bytes = mapped(&self.readback, self.readback.size())?;
            let padded = bytes.chunks_exact(self.bytes_per_row as usize);
            padded
                .take(rows as usize)
                .for_each(|row| take(&row[..row_bytes]));
            drop(bytes);
            self.readback.unmap();
            y += rows;
            if y >= height {
                return Ok(());
            }
            let mut encoder = device.create_command_encoder(&Default::default());
            self.copy(&mut encoder, y);
            arrival = self.ask(queue.submit([encoder.finish()]));
        }
    }
}

/// A picture that passes write, for some usages more.
pub(crate) fn texture(
    device: &wgpu::Device,
    format: wgpu::TextureFormat,
    size: [u32; 2],
    usage: wgpu::TextureUsages,
) -> wgpu::Texture {
    let usage = usage | wgpu::TextureUsages::RENDER_ATTACHMENT;
    device.create_texture(&flat("picture", format, size, usage))
}

/// A texture of one layer and one level.
pub(crate) fn flat(
    label: &str,
    format: wgpu::TextureFormat,
    [width, height]: [u32; 2],
    usage: wgpu::TextureUsages,
) -> wgpu::TextureDescriptor<'_> {
    wgpu::TextureDescriptor {
        label: Some(label),
        size: wgpu::Extent3d {
            width,
            height,
            depth_or_array_layers: 1,
        },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage,
        view_formats: &[],
    }
}

/// Bytes of a buffer that were asked for.
#[derive(Debug)]
pub(crate) struct Arrival {
    answer: Receiver<Result<(), wgpu::BufferAsyncError>>,
    submitted: wgpu::SubmissionIndex,
}

impl Arrival {
    /// Asks for so many bytes of a buffer, a multiple of four, as a submission leaves them.
    pub(crate) fn of(buffer: &wgpu::Buffer, bytes: u64, submitted: wgpu::SubmissionIndex) -> Self {
        let (sender, answer) = channel();
        buffer.map_async(wgpu::MapMode::Read, ..bytes, move |result| {
            // The receiver may be gone with the drawing that it was for.
            let _ = sender.send(result);
        });
        Self { answer, submitted }
    }

    /// Waits for the device, but for nothing that it was told later.
    pub(crate) fn wait(self, device: &wgpu::Device) -> Result<(), RenderError> {
        let polled = device.poll(wgpu::PollType::Wait {
            submission_index: Some(self.submitted),
            timeout: None,
        });
        polled.map_err(|e| failed(e.to_string()))?;
        // The device has called back by now, or another thread that waits is about to; unless it is gone.
        let answer = self.answer.recv_timeout(MOST_PATIENCE);
        answer
            .map_err(|_| failed("the device does not answer".to_owned()))?
            .map_err(|e| failed(e.to_string()))
    }
}

/// A callback comes at once after what it waits for, unless the device is gone.
const MOST_PATIENCE: Duration = Duration::from_secs(10);

fn failed(what: String) -> RenderError {
    RenderError::Gpu(format!("reading back failed: {what}"))
}

fn mapped(buffer: &wgpu::Buffer, bytes: u64) -> Result<wgpu::BufferView, RenderError> {
    let view = buffer.get_mapped_range(..bytes);
    view.map_err(|e| failed(e.to_string()))
}

pub(crate) fn readback_buffer(device: &wgpu::Device, size: u64) -> wgpu::Buffer {
    device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("readback"),
        size,
        usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
        mapped_at_creation: false,
    })
}

/// Waits for the device and reads so many bytes of a buffer, a multiple of four.
pub(crate) fn read(
    device: &wgpu::Device,
    buffer: &wgpu::Buffer,
    bytes: u64,
    submitted: wgpu::SubmissionIndex,
) -> Result<Vec<u8>, RenderError> {
    arrived(device, buffer, bytes, Arrival::of(buffer, bytes, submitted))
}

/// Waits for bytes of a buffer that were asked for.
pub(crate) fn arrived(
    device: &wgpu::Device,
    buffer: &wgpu::Buffer,
    bytes: u64,
    arrival: Arrival,
) -> Result<Vec<u8>, RenderError> {
    arrival.wait(device)?;
    let read = mapped(buffer, bytes)?.to_vec();
    buffer.unmap();
    Ok(read)
}
