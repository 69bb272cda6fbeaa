//! The geometry of cells on a graphics device: the twin of [`crate::interior::Raster`].
//!
//! One pass finds which triangle each pixel sees, a second colours each pixel once, by the same
//! formulas as the CPU's in f32. Tables are textures, as for the rest of the device, and vertices
//! read them, too: a list of triangles is all that a frame brings.

mod pipelines;
mod tables;

use super::DeviceLimits;
use super::device::{self, Opened};
use super::target::Target as Picture;
use crate::RenderError;
use crate::interior::{Pinhole, Runs, Target, Window};
use bytemuck::{Pod, Zeroable};
use pipelines::{DEPTH, DRAWN, Pipelines, SEEN};
use proxy::mesh::Model;
use rayon::prelude::*;
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
/// Depths of one triangle that differ by more than this factor are not left to the device, whose
/// rounding is relative to the nearest.
const SPREAD: f64 = 4.0;

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
        self.opened.trouble.take().and(drawn)
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
        queue.submit([encoder.finish()]);
        self.opened.trouble.take()?;
        // 4. The way back.
        let bytes = frame.drawn.read_bytes(device, queue)?;
        into.clear(width, height);
        let pixels = bytes.as_chunks::<8>().0.iter();
        for ((pixel, color), depth) in pixels.zip(&mut into.color).zip(&mut into.inverse_depth) {
            let [r, g, b, a, depth_bits @ ..] = *pixel;
            *color = [r, g, b, a];
            *depth = f32::from_le_bytes(depth_bits);
        }
        Ok(())
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
        let texture = |format, usage| {
            let texture = device.create_texture(&wgpu::TextureDescriptor {
                label: Some("seen"),
                size: wgpu::Extent3d {
                    width: size[0],
                    height: size[1],
                    depth_or_array_layers: 1,
                },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: usage | wgpu::TextureUsages::RENDER_ATTACHMENT,
                view_formats: &[],
            });
            texture.create_view(&Default::default())
        };
        Self {
            drawn: Picture::of(device, DRAWN, size, most_bytes),
            seen: texture(SEEN, wgpu::TextureUsages::TEXTURE_BINDING),
            depth: texture(DEPTH, wgpu::TextureUsages::empty()),
        }
    }
}

/// What a frame draws: triangles in the model's order, each once a window.
struct List {
    /// Triangle and window, 0 for everywhere; first those whose depths the device interpolates.
    entries: Vec<[u32; 2]>,
    in_front: usize,
    /// Pixels from … to before of each row, window after window.
    rows: Vec<[u32; 2]>,
}

impl List {
    fn new(model: &Model, parts: &[(Runs<'_>, Window)], camera: &Pinhole, held: &Held) -> Self {
        let unit = held.units.world_per_unit;
        let near = 2.0 * NEAR * unit;
        let is_in_front =
            |nearest: f64, farthest: f64| nearest > near && farthest < SPREAD * nearest;
        let axis = camera.rotation.transpose().z_axis;
        let depth = |p: glam::DVec3| axis.dot(p - camera.center);
        // 1. Which triangles, a bit each: in front, then across; no list need be sorted, and none
        // is drawn twice.
        let words = held.count.div_ceil(64);
        let mut rows: Vec<[u32; 2]> = Vec::new();
        let mut sets: Vec<(u32, [Vec<u64>; 2])> = Vec::new();
        for (runs, window) in parts {
            let which = match window.is_whole(camera.width) {
                true => 0,
                false => {
                    let row = |y: u32| {
                        let open = window.row(y);
                        [open.start, open.end]
                    };
                    rows.extend((0..camera.height).map(row));
                    (rows.len() / camera.height as usize) as u32
                }
            };
            let mut set = [vec![0_u64; words], vec![0_u64; words]];
            let mut add = |class: usize, i: u32| set[class][i as usize / 64] |= 1 << (i % 64);
            // What a run's ball says of all that it holds its triangles would say, too.
            let class = |(list, center, radius): &(&[u32], glam::DVec3, f64)| -> Vec<u8> {
                let middle = depth(*center);
                if is_in_front(middle - radius, middle + radius) {
                    return Vec::new();
                }
                let class = |i: &u32| {
                    let depths = model.mesh.corners(*i as usize).map(depth);
                    let nearest = depths.into_iter().fold(f64::INFINITY, f64::min);
                    let farthest = depths.into_iter().fold(f64::NEG_INFINITY, f64::max);
                    u8::from(!is_in_front(nearest, farthest))
                };
                list.iter().map(class).collect()
            };
            let lists: Vec<_> = runs.balls().collect();
            let classes: Vec<Vec<u8>> = lists.par_iter().with_min_len(64).map(class).collect();
            for ((list, ..), classes) in lists.iter().zip(&classes) {
                for (k, i) in list.iter().enumerate() {
                    add(classes.get(k).copied().unwrap_or(0).into(), *i);
                }
            }
            sets.push((which, set));
        }
        // 2. In order.
        let mut entries = Vec::new();
        let mut in_front = 0;
        for class in 0..2 {
            for word in 0..words {
                let any = sets
                    .iter()
                    .fold(0, |bits, (_, set)| bits | set[class][word]);
                let mut left = any;
                while left != 0 {
                    let bit = left.trailing_zeros();
                    left &= left - 1;
                    for (window, set) in &sets {
                        if set[class][word] >> bit & 1 == 1 {
                            entries.push([64 * word as u32 + bit, *window]);
                        }
                    }
                }
            }
            if class == 0 {
                in_front = entries.len();
            }
        }
        Self {
            entries,
            in_front,
            rows,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use naga::valid::{Capabilities, ValidationFlags, Validator};
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
}
