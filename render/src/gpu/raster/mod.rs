//! The geometry of cells on a graphics device: the twin of [`crate::interior::Raster`].
//!
//! One pass finds which triangle each pixel sees, a second colours each pixel once, by the same
//! formulas as the CPU's in f32. Tables are textures, as for the rest of the device, and vertices
//! read them, too: a list of triangles is all that a frame brings.

mod list;
mod pipelines;
mod tables;

use super::DeviceLimits;
use super::GpuWarp;
use super::device::{self, Opened};
use super::target::{Target as Picture, texture};
use crate::RenderError;
use crate::interior::{Pinhole, Runs, Target, Window};
use bytemuck::{Pod, Zeroable};
use list::List;
use pipelines::{DEPTH, DRAWN, Pipelines, SEEN};
use proxy::mesh::Model;
use std::fmt;
use tables::{Held, Tables};

/// A graphics device that draws a model's triangles. The model is brought to it once.
pub struct GpuRaster {
    opened: Opened,
    description: String,
    pipelines: Pipelines,
    held: Held,
    frame: Option<FrameTextures>,
}

/// What a picture's size makes.
struct FrameTextures {
    drawn: Picture,
    seen: wgpu::TextureView,
    depth: wgpu::TextureView,
}

/// As the shader has it.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Camera {
    rotation: [[f32; 4]; 3],
    eye: [f32; 4],
    eye_rest: [f32; 4],
    lens: [f32; 4],
    picture: [f32; 4],
    row_bits: [u32; 4],
}

/// Nearer than this nothing is drawn, in units of about the model's size.
const NEAR: f64 = 1.0 / (1 << 20) as f64;
impl fmt::Debug for GpuRaster {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "GpuRaster({})", self.description)
    }
}

impl GpuRaster {
    /// Opens the best device there is, a software driver only if not a `real` one is asked for,
    /// and brings a model to it.
    ///
    /// # Errors
    /// No driver answers, or each lacks something; the model is more than the device holds.
    pub fn open(model: &Model, asked: &DeviceLimits, real: bool) -> Result<Self, RenderError> {
        let opened = device::open(asked, real)?;
        let tables = tables_of(&opened);
        let held = tables.hold(model)?;
        opened.queue.submit([]);
        let pipelines = Pipelines::new(&opened.device);
        opened.trouble.take()?;
        Ok(Self {
            description: device::describe(&opened.info),
            opened,
            pipelines,
            held,
            frame: None,
        })
    }

    /// Whether any device answers, however little it holds.
    pub(crate) fn is_there(asked: &DeviceLimits, real: bool) -> bool {
        device::open(asked, real).is_ok()
    }

    /// Whether the device is gone for good.
    pub(crate) fn is_lost(&self) -> bool {
        self.opened.trouble.lost().is_some()
    }

    /// The device's name and its driver, for people.
    pub fn description(&self) -> &str {
        &self.description
    }

    /// What draws layered depth images on the same device.
    ///
    /// # Errors
    /// The device lacks something.
    pub(crate) fn warp(&self) -> Result<GpuWarp, RenderError> {
        GpuWarp::on(self.opened.clone())
    }

    /// Gives the device up, as if its driver had: every drawing fails.
    pub fn lose(&mut self) {
        self.opened.device.destroy();
        // Tells the callback.
        let _ = self.opened.device.poll(wgpu::PollType::Poll);
    }

    /// Draws triangles where windows let them, over nothing. `model` is the one that was
    /// brought to the device.
    ///
    /// # Errors
    /// A picture or a list larger than the device takes; the device fails, or is lost.
    pub fn draw(
        &mut self,
        model: &Model,
        parts: &[(Runs<'_>, Window)],
        camera: &Pinhole,
        into: &mut Target,
    ) -> Result<(), RenderError> {
        let drawn = self.try_draw(model, parts, camera, into);
        // What the device said goes before what came of it.
        let drawn = self.opened.trouble.take().and(drawn);
        if drawn.is_err() {
            // Where memory ran out they are no pictures, nor would be for later frames.
            self.frame = None;
        }
        drawn
    }

    fn try_draw(
        &mut self,
        model: &Model,
        parts: &[(Runs<'_>, Window)],
        camera: &Pinhole,
        into: &mut Target,
    ) -> Result<(), RenderError> {
        let (width, height) = (camera.width, camera.height);
        let side = self.opened.limits.max_texture_dimension_2d;
        if width.max(height) > side {
            return Err(RenderError::Gpu(format!(
                "a picture of {width} × {height} is more than this device draws ({side} × \
                 {side}); use --device cpu or a smaller --size"
            )));
        }
        // 1. What is drawn.
        let tables = tables_of(&self.opened);
        let list = List::new(model, parts, camera, &self.held);
        let in_front = match self.opened.info.backend {
            // Depths go from -1 to 1 there, and lose the digits of what is far.
            wgpu::Backend::Gl => 0,
            _ => list.in_front,
        };
        let count = list.entries.len();
        let entries = tables.table("triangles of a frame", &list.entries)?;
        let windows = tables.table("rows of windows", &list.rows)?;
        let uniform = self.camera(camera, tables.row_bits());
        let (device, queue) = (&self.opened.device, &self.opened.queue);
        // Written rather than mapped: mapping panics on a device that is lost.
        let buffer = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("camera"),
            size: size_of::<Camera>() as u64,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        queue.write_buffer(&buffer, 0, bytemuck::bytes_of(&uniform));
        let uniform = buffer;
        // 2. Where to.
        let most_bytes = self.opened.limits.max_buffer_size;
        if self
            .frame
            .as_ref()
            .is_none_or(|f| f.drawn.size != [width, height])
        {
            self.frame = Some(FrameTextures::new(device, [width, height], most_bytes));
        }
        let frame = self.frame.as_ref().expect("made above");
        // 3. The passes.
        let held = &self.held;
        let pipelines = &self.pipelines;
        let of_model = pipelines.model(device, &uniform, [&held.triangles, &held.places]);
        let of_list = pipelines.list(device, [&entries, &windows]);
        let tables = [&frame.seen, &held.uvs, &held.materials, &held.texels];
        let of_looks = pipelines.looks(device, tables);
        let mut encoder = device.create_command_encoder(&Default::default());
        {
            let mut pass = pass(&mut encoder, "met", &frame.seen, Some(&frame.depth));
            pass.set_bind_group(0, &of_model, &[]);
            pass.set_bind_group(1, &of_list, &[]);
            let vertices = |triangles: usize| 3 * triangles as u32;
            if in_front > 0 {
                pass.set_pipeline(match list.rows.is_empty() {
                    true => &pipelines.in_front,
                    false => &pipelines.in_front_in_window,
                });
                pass.draw(0..vertices(in_front), 0..1);
            }
            if count > in_front {
                pass.set_pipeline(&pipelines.across);
                pass.draw(vertices(in_front)..vertices(count), 0..1);
            }
        }
        {
            let mut pass = pass(&mut encoder, "shade", &frame.drawn.view, None);
            pass.set_bind_group(0, &of_model, &[]);
            pass.set_bind_group(1, &of_list, &[]);
            pass.set_bind_group(2, &of_looks, &[]);
            pass.set_pipeline(&pipelines.shade);
            pass.draw(0..3, 0..1);
        }
        frame.drawn.copy(&mut encoder, 0);
        let submitted = queue.submit([encoder.finish()]);
        self.opened.trouble.take()?;
        // 4. The way back.
        let arrival = frame.drawn.ask(submitted);
        into.clear(width, height);
        let (colors, depths) = (into.color.iter_mut(), into.inverse_depth.iter_mut());
        let mut pixels = colors.zip(depths);
        frame.drawn.read_rows(device, queue, arrival, |row| {
            for (pixel, (color, depth)) in row.as_chunks::<8>().0.iter().zip(&mut pixels) {
                let [r, g, b, a, depth_bits @ ..] = *pixel;
                *color = [r, g, b, a];
                *depth = f32::from_le_bytes(depth_bits);
            }
        })
    }

    fn camera(&self, camera: &Pinhole, row_bits: u32) -> Camera {
        let units = &self.held.units;
        let row = |v: glam::DVec3| v.as_vec3().extend(0.0).to_array();
        let rows = camera.rotation.transpose();
        let [eye, eye_rest] = units
            .place(camera.center)
            .map(|[x, y, z]| [x, y, z, 0.0_f32]);
        let (focal, principal) = (camera.focal.as_vec2(), camera.principal.as_vec2());
        Camera {
            rotation: [rows.x_axis, rows.y_axis, rows.z_axis].map(row),
            eye,
            eye_rest,
            lens: [focal.x, focal.y, principal.x, principal.y],
            picture: [
                camera.width as f32,
                camera.height as f32,
                NEAR as f32,
                units.world_per_unit as f32,
            ],
            row_bits: [row_bits, 0, 0, 0],
        }
    }
}

fn tables_of(opened: &Opened) -> Tables<'_> {
    Tables {
        device: &opened.device,
        queue: &opened.queue,
        side: opened.limits.max_texture_dimension_2d,
        most_bytes: opened.limits.max_buffer_size,
    }
}

/// A pass over pictures that are empty before it.
fn pass<'a>(
    encoder: &'a mut wgpu::CommandEncoder,
    label: &'static str,
    into: &wgpu::TextureView,
    depth: Option<&wgpu::TextureView>,
) -> wgpu::RenderPass<'a> {
    encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        label: Some(label),
        color_attachments: &[Some(wgpu::RenderPassColorAttachment {
            view: into,
            depth_slice: None,
            resolve_target: None,
            ops: wgpu::Operations {
                load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                store: wgpu::StoreOp::Store,
            },
        })],
        depth_stencil_attachment: depth.map(|view| wgpu::RenderPassDepthStencilAttachment {
            view,
            depth_ops: Some(wgpu::Operations {
                load: wgpu::LoadOp::Clear(0.0),
                store: wgpu::StoreOp::Discard,
            }),
            stencil_ops: None,
        }),
        ..Default::default()
    })
}

impl FrameTextures {
    fn new(device: &wgpu::Device, size: [u32; 2], most_bytes: u64) -> Self {
        use wgpu::TextureUsages as Usages;
        let texture = |format, usage| {
            let texture = texture(device, format, size, usage);
            texture.create_view(&Default::default())
        };
        Self {
            drawn: Picture::new(device, DRAWN, size, Usages::COPY_SRC, most_bytes),
            seen: texture(SEEN, Usages::TEXTURE_BINDING),
            depth: texture(DEPTH, Usages::empty()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use calibrate::{Lens, Rigid3, View};
    use glam::{DVec2, DVec3};
    use naga::valid::{Capabilities, ValidationFlags, Validator};
    use proxy::mesh::Mesh;
    use std::mem::size_of;

    #[test]
    fn the_shader_is_valid_and_has_the_camera_as_it_is() {
        let module = naga::front::wgsl::parse_str(pipelines::SHADER)
            .unwrap_or_else(|e| panic!("{}", e.emit_to_string(pipelines::SHADER)));
        let mut validator = Validator::new(ValidationFlags::all(), Capabilities::empty());
        let info = validator.validate(&module);
        assert!(
            info.is_ok(),
            "{}",
            info.unwrap_err().emit_to_string(pipelines::SHADER)
        );
        let is_it = |ty: &naga::Type| ty.name.as_deref() == Some("Camera");
        let (_, ty) = module.types.iter().find(|(_, ty)| is_it(ty)).unwrap();
        let naga::TypeInner::Struct { span, .. } = ty.inner else {
            panic!("a struct");
        };
        assert_eq!(span as usize, size_of::<Camera>());
    }
    #[test]
    fn after_an_error_a_frame_is_made_again() {
        let model = Model {
            mesh: Mesh {
                positions: vec![DVec3::ZERO, DVec3::X, DVec3::Y],
                triangles: vec![[0, 1, 2]],
            },
            uvs: vec![[0.0; 2]; 3],
            colors: vec![[255; 4]; 3],
            ..Model::default()
        };
        let mut raster = match GpuRaster::open(&model, &DeviceLimits::default(), false) {
            Ok(raster) => raster,
            Err(error) if std::env::var("LUMIGRAPH_REQUIRE_GPU").as_deref() == Ok("1") => {
                panic!("LUMIGRAPH_REQUIRE_GPU is 1, but: {error}")
            }
            Err(error) => {
                eprintln!("SKIPPED: rasters on the graphics device: {error}");
                return;
            }
        };
        let camera = Pinhole::new(&View {
            lens: Lens::pinhole(DVec2::splat(16.0), DVec2::new(8.0, 6.0)),
            width: 16,
            height: 12,
            camera_from_world: Rigid3::looking_at(DVec3::NEG_Z, DVec3::Z, DVec3::Y),
        });
        let camera = camera.unwrap();
        let mut into = Target::new(16, 12);
        raster.draw(&model, &[], &camera, &mut into).unwrap();
        assert!(raster.frame.is_some());
        let full = RenderError::DeviceFull("full".to_owned());
        raster.opened.trouble.say(full.clone());
        let drawn = raster.draw(&model, &[], &camera, &mut into);
        assert!(drawn == Err(full) && raster.frame.is_none());
        raster.draw(&model, &[], &camera, &mut into).unwrap();
        assert!(raster.frame.is_some());
    }
}
