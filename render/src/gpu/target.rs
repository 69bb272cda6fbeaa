//! The picture on the device, and the way back.

use crate::RenderError;
use image::RgbaImage;

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
    /// `most_bytes` are those of a buffer.
    pub(crate) fn new(device: &wgpu::Device, width: u32, height: u32, most_bytes: u64) -> Self {
        let format = super::pipelines::PICTURE_FORMAT;
        Self::of(device, format, [width, height], most_bytes)
    }

    /// A picture of any format whose texels are read one by one.
    pub(crate) fn of(
        device: &wgpu::Device,
        format: wgpu::TextureFormat,
        [width, height]: [u32; 2],
        most_bytes: u64,
    ) -> Self {
        let texture = device.create_texture(&wgpu::TextureDescriptor {
            label: Some("picture"),
            size: wgpu::Extent3d {
                width,
                height,
                depth_or_array_layers: 1,
            },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        });
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

    /// Waits for the device and reads the picture.
    pub(crate) fn read(
        &self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
    ) -> Result<RgbaImage, RenderError> {
        let [width, height] = self.size;
        let pixels = self.read_bytes(device, queue)?;
        Ok(RgbaImage::from_raw(width, height, pixels).expect("one row each"))
    }

    /// Waits for the device and reads the pixels, row by row.
    pub(crate) fn read_bytes(
        &self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
    ) -> Result<Vec<u8>, RenderError> {
        let [width, height] = self.size;
        let row_bytes = width as usize * self.bytes_per_pixel as usize;
        let mut pixels = Vec::with_capacity(row_bytes * height as usize);
        for y in (0..height).step_by(self.rows as usize) {
            let rows = self.rows.min(height - y);
            let mut encoder = device.create_command_encoder(&Default::default());
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
            queue.submit([encoder.finish()]);
            let bytes = read(device, &self.readback)?;
            let padded = bytes.chunks_exact(self.bytes_per_row as usize);
            for row in padded.take(rows as usize) {
                pixels.extend_from_slice(&row[..row_bytes]);
            }
        }
        Ok(pixels)
    }
}

pub(crate) fn readback_buffer(device: &wgpu::Device, size: u64) -> wgpu::Buffer {
    device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("readback"),
        size,
        usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
        mapped_at_creation: false,
    })
}

/// Waits for the device and reads a buffer.
pub(crate) fn read(device: &wgpu::Device, buffer: &wgpu::Buffer) -> Result<Vec<u8>, RenderError> {
    read_first(device, buffer, buffer.size())
}

/// Waits for the device and reads so many bytes of a buffer, a multiple of four.
pub(crate) fn read_first(
    device: &wgpu::Device,
    buffer: &wgpu::Buffer,
    bytes: u64,
) -> Result<Vec<u8>, RenderError> {
    let failed = |what: String| RenderError::Gpu(format!("reading back failed: {what}"));
    let (sender, receiver) = std::sync::mpsc::channel();
    buffer.map_async(wgpu::MapMode::Read, ..bytes, move |result| {
        // The receiver waits below; if it is gone there is no one to tell.
        let _ = sender.send(result);
    });
    device
        .poll(wgpu::PollType::wait_indefinitely())
        .map_err(|e| failed(e.to_string()))?;
    // The device has called back by now, unless it is gone.
    receiver
        .try_recv()
        .map_err(|_| failed("the device does not answer".to_owned()))?
        .map_err(|e| failed(e.to_string()))?;
    let bytes = buffer
        .get_mapped_range(..bytes)
        .map_err(|e| failed(e.to_string()))?
        .to_vec();
    buffer.unmap();
    Ok(bytes)
}
