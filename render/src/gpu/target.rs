//! The picture on the device, and the way back.

use crate::RenderError;
use image::RgbaImage;

/// A picture to draw into and the buffer it is read back through.
#[derive(Debug)]
pub(crate) struct Target {
    pub size: [u32; 2],
    pub view: wgpu::TextureView,
    texture: wgpu::Texture,
    readback: wgpu::Buffer,
    bytes_per_row: u32,
}

impl Target {
    pub(crate) fn new(device: &wgpu::Device, width: u32, height: u32) -> Self {
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
            format: super::pipelines::PICTURE_FORMAT,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        });
        let view = texture.create_view(&Default::default());
        let bytes_per_row = (width * 4).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let readback = readback_buffer(device, u64::from(bytes_per_row) * u64::from(height));
        Self {
            size: [width, height],
            view,
            texture,
            readback,
            bytes_per_row,
        }
    }

    pub(crate) fn copy_to_readback(&self, encoder: &mut wgpu::CommandEncoder) {
        encoder.copy_texture_to_buffer(
            self.texture.as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer: &self.readback,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(self.bytes_per_row),
                    rows_per_image: Some(self.size[1]),
                },
            },
            self.texture.size(),
        );
    }

    pub(crate) fn read(&self, device: &wgpu::Device) -> Result<RgbaImage, RenderError> {
        let bytes = read(device, &self.readback)?;
        let row = self.size[0] as usize * 4;
        let rows = bytes.chunks_exact(self.bytes_per_row as usize);
        let pixels: Vec<u8> = rows.flat_map(|padded| &padded[..row]).copied().collect();
        Ok(RgbaImage::from_raw(self.size[0], self.size[1], pixels).expect("one row each"))
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
    let failed = |what: String| RenderError::Gpu(format!("reading back failed: {what}"));
    let (sender, receiver) = std::sync::mpsc::channel();
    buffer.map_async(wgpu::MapMode::Read, .., move |result| {
        // The receiver waits below; if it is gone there is no one to tell.
        let _ = sender.send(result);
    });
    device
        .poll(wgpu::PollType::wait_indefinitely())
        .map_err(|e| failed(e.to_string()))?;
    receiver
        .recv()
        .map_err(|e| failed(e.to_string()))?
        .map_err(|e| failed(e.to_string()))?;
    let bytes = buffer
        .get_mapped_range(..)
        .map_err(|e| failed(e.to_string()))?
        .to_vec();
    buffer.unmap();
    Ok(bytes)
}
