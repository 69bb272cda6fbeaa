//! The window's own graphics device: pictures and panels are put on the screen with it.

use egui::{ClippedPrimitive, TexturesDelta};
use egui_wgpu::{Renderer, RendererOptions, ScreenDescriptor};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use wgpu::CurrentSurfaceTexture;
use winit::event_loop::OwnedDisplayHandle;
use winit::window::Window;

/// A device that shows things in a window.
pub(crate) struct Screen {
    surface: wgpu::Surface<'static>,
    device: wgpu::Device,
    queue: wgpu::Queue,
    configuration: wgpu::SurfaceConfiguration,
    renderer: Renderer,
    is_lost: Arc<AtomicBool>,
    /// The processor draws.
    is_software: bool,
    /// The surface must be configured anew before the next frame.
    is_stale: bool,
}

/// What became of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Presented {
    /// It is on the screen.
    Yes,
    /// Not now: there is no place for it.
    NotNow,
    /// Not yet: the surface changed.
    Again,
    /// The device is gone for good.
    Lost,
}

impl Screen {
    /// Opens a device for a window.
    ///
    /// # Errors
    /// None can show anything in it, and why.
    pub(crate) fn open(window: &Arc<Window>, display: OwnedDisplayHandle) -> Result<Self, String> {
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle_from_env();
        descriptor.display = Some(Box::new(display));
        let instance = wgpu::Instance::new(descriptor);
        let surface = instance.create_surface(Arc::clone(window));
        let surface = surface.map_err(|error| error.to_string())?;
        let adapter = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions {
            power_preference: wgpu::PowerPreference::HighPerformance,
            compatible_surface: Some(&surface),
            ..Default::default()
        }));
        let adapter = adapter.map_err(|error| error.to_string())?;
        // Pictures are as large as the window.
        let limits = wgpu::Limits {
            max_texture_dimension_2d: adapter.limits().max_texture_dimension_2d,
            ..wgpu::Limits::downlevel_webgl2_defaults()
        };
        let opened = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("window"),
            required_limits: limits,
            ..Default::default()
        }));
        let (device, queue) = opened.map_err(|error| error.to_string())?;
        let is_lost = Arc::new(AtomicBool::new(false));
        let of_loss = Arc::clone(&is_lost);
        device.set_device_lost_callback(move |_, _| of_loss.store(true, Ordering::Release));
        // What goes wrong in a frame is that frame's; a device that is gone says so above.
        device.on_uncaptured_error(Arc::new(|_| {}));
        let size = window.inner_size();
        let mut configuration = surface
            .get_default_config(&adapter, size.width.max(1), size.height.max(1))
            .ok_or("the device cannot show anything in a window")?;
        // egui's colours are sRGB values as they are.
        let formats = surface.get_capabilities(&adapter).formats;
        let plain = formats.iter().find(|format| !format.is_srgb());
        configuration.format = plain.copied().unwrap_or(configuration.format);
        configuration.present_mode = wgpu::PresentMode::AutoVsync;
        configuration.desired_maximum_frame_latency = 1;
        let renderer = Renderer::new(
            &device,
            configuration.format,
            RendererOptions {
                dithering: false,
                ..RendererOptions::default()
            },
        );
        Ok(Self {
            surface,
            device,
            queue,
            configuration,
            renderer,
            is_lost,
            is_software: adapter.get_info().device_type == wgpu::DeviceType::Cpu,
            is_stale: true,
        })
    }

    /// The longest side of a texture, in texels.
    pub(crate) fn max_texture_side(&self) -> usize {
        self.device.limits().max_texture_dimension_2d as usize
    }

    /// Another size of the window, in pixels.
    pub(crate) fn resize(&mut self, width: u32, height: u32) {
        let most = self.max_texture_side() as u32;
        let size = (width.min(most), height.min(most));
        if size != (self.configuration.width, self.configuration.height) {
            (self.configuration.width, self.configuration.height) = size;
            self.is_stale = true;
        }
    }

    /// Lets the device be lost, as a driver's reset would: for tests.
    pub(crate) fn lose(&self) {
        self.device.destroy();
        self.is_lost.store(true, Ordering::Release);
    }

    /// Brings textures to the device.
    pub(crate) fn upload(&mut self, textures: &TexturesDelta) {
        if self.is_lost.load(Ordering::Acquire) {
            return;
        }
        for (id, deltas) in &textures.set {
            for delta in deltas {
                self.renderer
                    .update_texture(&self.device, &self.queue, *id, delta);
            }
        }
    }

    /// Lets textures go that the frame before was the last to need.
    pub(crate) fn free(&mut self, textures: &TexturesDelta) {
        for id in &textures.free {
            self.renderer.free_texture(id);
        }
    }

    /// Draws a frame and shows it.
    pub(crate) fn present(
        &mut self,
        primitives: &[ClippedPrimitive],
        pixels_per_point: f32,
    ) -> Presented {
        if self.is_lost.load(Ordering::Acquire) {
            return Presented::Lost;
        }
        let size = [self.configuration.width, self.configuration.height];
        if size.contains(&0) {
            return Presented::NotNow;
        }
        if std::mem::take(&mut self.is_stale) {
            self.surface.configure(&self.device, &self.configuration);
        }
        let frame = match self.surface.get_current_texture() {
            CurrentSurfaceTexture::Success(frame) => frame,
            CurrentSurfaceTexture::Suboptimal(frame) => {
                self.is_stale = true;
                frame
            }
            CurrentSurfaceTexture::Outdated => {
                self.is_stale = true;
                return Presented::Again;
            }
            // A new surface needs a new instance all the same.
            CurrentSurfaceTexture::Lost => return Presented::Lost,
            CurrentSurfaceTexture::Timeout
            | CurrentSurfaceTexture::Occluded
            | CurrentSurfaceTexture::Validation => {
                return match self.is_lost.load(Ordering::Acquire) {
                    true => Presented::Lost,
                    false => Presented::NotNow,
                };
            }
        };
        let descriptor = ScreenDescriptor {
            size_in_pixels: size,
            pixels_per_point,
        };
        let view = frame
            .texture
            .create_view(&wgpu::TextureViewDescriptor::default());
        let mut encoder = self
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let mut commands = self.renderer.update_buffers(
            &self.device,
            &self.queue,
            &mut encoder,
            primitives,
            &descriptor,
        );
        let pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("window"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                    store: wgpu::StoreOp::Store,
                },
            })],
            ..Default::default()
        });
        let mut pass = pass.forget_lifetime();
        self.renderer.render(&mut pass, primitives, &descriptor);
        drop(pass);
        commands.push(encoder.finish());
        self.queue.submit(commands);
        self.queue.present(frame);
        if self.is_software {
            // Its threads would take the cores from the next frame's steps.
            let _ = self.device.poll(wgpu::PollType::wait_indefinitely());
        }
        Presented::Yes
    }
}
