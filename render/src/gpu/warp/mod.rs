//! The warp of layered depth images on a graphics device: the twin of [`crate::ldi::free`].
//!
//! The same steps and formulas, a thread a sample. Depths are kept by their bits, and weighted
//! colours added up as whole numbers of 64 bits in two words, so pictures do not depend on the order
//! in which a device takes samples. 32-bit atomics are enough, which every device with compute
//! shaders has.

use super::DeviceLimits;
use super::device::{self, Opened};
use super::pipelines::group;
use super::target::{read, readback_buffer};
use crate::RenderError;
use crate::interior::{Pinhole, Target, Window};
use crate::ldi::{Clipped, FreeCost, FreeOptions, Layered, Projection, Sizes, bounds, fill};
use bytemuck::{Pod, Zeroable};
use std::fmt;
use std::ops::Range;

const SHADER: &str = include_str!("warp.wgsl");

/// The passes in the order in which they run: the entry point, and whether splats are the wider ones.
const PASSES: [(&str, bool); 5] = [
    ("near", false),
    ("add", false),
    ("near", true),
    ("add", true),
    ("resolve", false),
];
/// Threads of a group; the shader says the same.
const GROUP: u32 = 64;
/// Words of a sample, and of a pixel: what it shows, its nearest depths, its sums.
const SAMPLE_WORDS: usize = 5;
const PIXEL_WORDS: u64 = 12;
/// What is read back of a pixel.
const SHOWN_WORDS: u64 = 2;
/// LDIs stay on the device as long as all together are smaller.
const MOST_HELD_BYTES: u64 = 256 << 20;
/// Storage buffers of a pass.
const BUFFERS: u32 = 4;

/// A graphics device that draws LDIs, and those that are on it.
pub struct GpuWarp {
    opened: Opened,
    layout: wgpu::BindGroupLayout,
    passes: Vec<wgpu::ComputePipeline>,
    /// Those drawn last at the end.
    held: Vec<Held>,
    /// For as many pixels as were needed so far.
    pixels: Option<Pixels>,
}

/// The samples of an LDI on the device.
struct Held {
    id: u64,
    samples: wgpu::Buffer,
}

/// What is kept of pixels, and the way back.
struct Pixels {
    count: u64,
    words: wgpu::Buffer,
    shown: wgpu::Buffer,
}

/// As the shader has it.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Params {
    per_x: [f32; 4],
    per_y: [f32; 4],
    per_depth: [f32; 4],
    size: [u32; 4],
    patches: [f32; 4],
    wide: [f32; 4],
    end: [f32; 4],
}

impl fmt::Debug for GpuWarp {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "GpuWarp({})", self.description())
    }
}

impl GpuWarp {
    /// Opens the best device there is, a software driver only if not a `real` one is asked for.
    ///
    /// # Errors
    /// No driver answers, or each lacks something.
    pub fn open(asked: &DeviceLimits, real: bool) -> Result<Self, RenderError> {
        Self::on(device::open(asked, real)?)
    }

    /// On a device that is open.
    ///
    /// # Errors
    /// The device lacks something.
    pub(super) fn on(opened: Opened) -> Result<Self, RenderError> {
        let has = opened.limits.max_storage_buffers_per_shader_stage;
        if has < BUFFERS {
            let name = device::describe(&opened.info);
            return Err(RenderError::Gpu(format!(
                "{name} lacks storage buffers at once ({has} of {BUFFERS})"
            )));
        }
        let device = &opened.device;
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("warp"),
            source: wgpu::ShaderSource::Wgsl(SHADER.into()),
        });
        let storage = |read_only| wgpu::BufferBindingType::Storage { read_only };
        let kinds = [
            wgpu::BufferBindingType::Uniform,
            storage(true),
            storage(true),
            storage(true),
            storage(false),
        ];
        let entry = |(binding, ty)| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer {
                ty,
                has_dynamic_offset: false,
                min_binding_size: None,
            },
            count: None,
        };
        let entries: Vec<_> = (0..).zip(kinds).map(entry).collect();
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("warp"),
            entries: &entries,
        });
        let of_all = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("warp"),
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let pass = |(name, is_wide)| {
            let constants = [("is_wide", f64::from(u8::from(is_wide)))];
            device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(name),
                layout: Some(&of_all),
                module: &module,
                entry_point: Some(name),
                compilation_options: wgpu::PipelineCompilationOptions {
                    constants: &constants,
                    ..Default::default()
                },
                cache: None,
            })
        };
        let passes = PASSES.map(pass).into();
        opened.trouble.take()?;
        Ok(Self {
            opened,
            layout,
            passes,
            held: Vec::new(),
            pixels: None,
        })
    }

    /// The device's name and its driver, for people.
    pub fn description(&self) -> String {
        device::describe(&self.opened.info)
    }

    /// Draws the columns of an LDI that are left as a desired camera sees them, in the pixels of a
    /// window, over what is there: as [`free`](crate::ldi::free) does, but for rounding. Nothing is
    /// drawn where the picture's size is not the camera's.
    ///
    /// # Errors
    /// An LDI or a picture larger than the device takes; the device fails, or is lost. Nothing is
    /// drawn then.
    pub fn free(
        &mut self,
        ldi: &Layered,
        columns: &Clipped,
        desired: &Pinhole,
        window: &Window,
        options: &FreeOptions,
        into: &mut Target,
    ) -> Result<FreeCost, RenderError> {
        let mut cost = FreeCost::default();
        if (into.width, into.height) != (desired.width, desired.height) {
            return Ok(cost);
        }
        let Some([across, down]) = bounds(window, into) else {
            return Ok(cost);
        };
        let shown = self.shown(ldi, columns, desired, [&across, &down], options, &mut cost);
        // What the device said goes before what came of it.
        let said = self.opened.trouble.take();
        if said.is_err() {
            self.forget();
        }
        let shown = said.and(shown)?;

        // Into the picture.
        let (words, _) = shown.as_chunks::<4>();
        let (colors, depths) = words.split_at(across.len() * down.len());
        for y in down.clone() {
            let open = window.row(y);
            let open = open.start..open.end.min(across.end);
            let row = (y - down.start) as usize * across.len();
            for x in open.clone() {
                let from = row + (x - across.start) as usize;
                let to = (y * into.width + x) as usize;
                into.color[to] = colors[from];
                into.inverse_depth[to] = f32::from_le_bytes(depths[from]);
                cost.holes += usize::from(colors[from][3] == 0);
            }
            cost.pixels += open.len();
        }
        cost.unfilled = match (options.fill, cost.holes) {
            (0, _) | (_, 0) => cost.holes,
            (reach, _) => fill(window, [&across, &down], reach, into),
        };
        Ok(cost)
    }

    /// The colours, then the inverse depths, of a box of pixels, row by row; zero where nothing is.
    fn shown(
        &mut self,
        ldi: &Layered,
        columns: &Clipped,
        desired: &Pinhole,
        [across, down]: [&Range<u32>; 2],
        options: &FreeOptions,
        cost: &mut FreeCost,
    ) -> Result<Vec<u8>, RenderError> {
        // 1. What there is to draw.
        let origin = [across.start as i32, down.start as i32];
        let projection = Projection::new(ldi, desired, origin);
        let (stretches, samples) = stretches(ldi, columns, &projection);
        cost.samples = samples;
        let [x, y] = [across, down].map(|side| side.len() as u32);
        let pixels = u64::from(x) * u64::from(y);
        let params = params(&projection, options, [x, y], stretches.len() as u32 / 2);
        let sizes = Sizes::new(&ldi.camera, desired);
        self.hold(ldi)?;
        self.make_room(pixels)?;
        let (device, queue) = (&self.opened.device, &self.opened.queue);
        let held = self.held.last().expect("held above");
        let room = self.pixels.as_ref().expect("made above");
        let buffer = |label, usage, bytes: &[u8]| {
            // Never empty, and written rather than mapped: mapping panics on a device that is lost.
            let buffer = device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: bytes.len().max(32) as u64,
                usage: usage | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            });
            queue.write_buffer(&buffer, 0, bytes);
            buffer
        };
        let storage = wgpu::BufferUsages::STORAGE;
        let uniform = wgpu::BufferUsages::UNIFORM;
        let params = buffer("warp", uniform, bytemuck::bytes_of(&params));
        let ranges = buffer("stretches", storage, bytemuck::cast_slice(&stretches));
        let sizes = buffer("sizes", storage, bytemuck::cast_slice(&sizes.words()));
        let all = [&params, &held.samples, &ranges, &sizes, &room.words];
        let all = group(device, &self.layout, all.map(|b| b.as_entire_binding()));

        // 2. The passes.
        let mut encoder = device.create_command_encoder(&Default::default());
        encoder.clear_buffer(&room.words, 0, Some(4 * (PIXEL_WORDS * pixels + 1)));
        {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_bind_group(0, &all, &[]);
            let most = self.opened.limits.max_compute_workgroups_per_dimension;
            for ((name, _), pipeline) in PASSES.iter().zip(&self.passes) {
                let groups = match *name {
                    "resolve" => pixels.div_ceil(u64::from(GROUP)) as u32,
                    _ => stretches.len() as u32 / 2,
                };
                let wide = groups.clamp(1, most);
                pass.set_pipeline(pipeline);
                pass.dispatch_workgroups(wide, groups.div_ceil(wide), 1);
            }
        }
        let shown = 4 * SHOWN_WORDS * pixels;
        encoder.copy_buffer_to_buffer(&room.words, 0, &room.shown, 0, shown);
        let count_at = 4 * PIXEL_WORDS * pixels;
        encoder.copy_buffer_to_buffer(&room.words, count_at, &room.shown, shown, 4);
        let submitted = queue.submit([encoder.finish()]);
        if let Err(error) = self.opened.trouble.take() {
            self.forget();
            return Err(error);
        }

        // 3. The way back.
        let read = read(device, &room.shown, shown + 4, submitted);
        let mut shown = read.inspect_err(|_| self.forget())?;
        let end = (4 * SHOWN_WORDS * pixels) as usize;
        let drawn: [u8; 4] = shown[end..end + 4].try_into().expect("four bytes");
        cost.drawn = u32::from_le_bytes(drawn) as usize;
        shown.truncate(end);
        Ok(shown)
    }

    /// Lets go of all that is on the device. Where an error came with a buffer, the buffer is none,
    /// and whatever used it later would fail as well.
    fn forget(&mut self) {
        self.held.clear();
        self.pixels = None;
    }

    /// Brings an LDI to the device, if it is not there, and to the end of those held. Those that were
    /// drawn longest ago go.
    fn hold(&mut self, ldi: &Layered) -> Result<(), RenderError> {
        if let Some(at) = self.held.iter().position(|held| held.id == ldi.id()) {
            let held = self.held.remove(at);
            self.held.push(held);
            return Ok(());
        }
        let words: Vec<[u32; SAMPLE_WORDS]> = ldi.words().collect();
        let bytes: &[u8] = bytemuck::cast_slice(&words);
        let size = bytes.len().max(32) as u64;
        self.fits("samples of a layered depth image", size)?;
        let mut all = size + self.held.iter().map(|h| h.samples.size()).sum::<u64>();
        while all > MOST_HELD_BYTES && !self.held.is_empty() {
            all -= self.held.remove(0).samples.size();
        }
        let samples = self.opened.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("samples"),
            size,
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        self.opened.queue.write_buffer(&samples, 0, bytes);
        let id = ldi.id();
        self.held.push(Held { id, samples });
        Ok(())
    }

    /// Has room for so many pixels.
    fn make_room(&mut self, pixels: u64) -> Result<(), RenderError> {
        if self
            .pixels
            .as_ref()
            .is_some_and(|room| room.count >= pixels)
        {
            return Ok(());
        }
        let size = 4 * (PIXEL_WORDS * pixels + 1);
        self.fits("pixels of a warp", size)?;
        let device = &self.opened.device;
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        let words = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("pixels of a warp"),
            size,
            usage: usage | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        self.pixels = Some(Pixels {
            count: pixels,
            words,
            shown: readback_buffer(device, 4 * (SHOWN_WORDS * pixels + 1)),
        });
        Ok(())
    }

    fn fits(&self, what: &str, bytes: u64) -> Result<(), RenderError> {
        let limits = &self.opened.limits;
        let most = limits.max_buffer_size;
        let most = most.min(limits.max_storage_buffer_binding_size);
        if bytes <= most {
            return Ok(());
        }
        Err(RenderError::Gpu(format!(
            "the {what} take {bytes} bytes, and this device binds {most} at once"
        )))
    }
}

/// Samples that follow one another in a row, and the row's part of where they fall; and how many
/// samples there are in all.
fn stretches(ldi: &Layered, columns: &Clipped, projection: &Projection) -> (Vec<[u32; 4]>, usize) {
    let (mut stretches, mut samples) = (Vec::new(), 0);
    for row in 0..ldi.size()[1] {
        let [x, y, z] = projection.row(row).map(f32::to_bits);
        for columns in columns.of_row(row) {
            let range = ldi.samples_of(columns.clone(), row);
            if !range.is_empty() {
                samples += range.len();
                stretches.push([range.start as u32, range.end as u32, 0, 0]);
                stretches.push([x, y, z, 0]);
            }
        }
    }
    (stretches, samples)
}

fn params(
    projection: &Projection,
    options: &FreeOptions,
    [width, height]: [u32; 2],
    stretches: u32,
) -> Params {
    let options = options.within_bounds();
    let wide = |[x, y, z]: [f32; 3]| [x, y, z, 0.0];
    Params {
        per_x: wide(projection.per_x),
        per_y: wide(projection.per_y),
        per_depth: wide(projection.per_depth),
        size: [width, height, stretches, projection.turn],
        patches: [options.grow, options.least, options.most, options.nearer],
        wide: [
            options.wide,
            options.least_wide,
            options.deviation,
            crate::ldi::BEYOND,
        ],
        end: [options.end, 0.0, 0.0, 0.0],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ldi::{Ends, Look, Sample};
    use calibrate::{Lens, Rigid3, View};
    use glam::{DVec2, DVec3};
    use naga::valid::{Capabilities, ValidationFlags, Validator};
    use std::collections::HashSet;

    #[test]
    fn the_shader_is_valid_and_has_the_parameters_as_they_are() {
        let module = naga::front::wgsl::parse_str(SHADER)
            .unwrap_or_else(|e| panic!("{}", e.emit_to_string(SHADER)));
        let mut validator = Validator::new(ValidationFlags::all(), Capabilities::empty());
        let info = validator.validate(&module);
        assert!(info.is_ok(), "{}", info.unwrap_err().emit_to_string(SHADER));
        let is_it = |ty: &naga::Type| ty.name.as_deref() == Some("Warp");
        let (_, ty) = module.types.iter().find(|(_, ty)| is_it(ty)).unwrap();
        let naga::TypeInner::Struct { span, .. } = ty.inner else {
            panic!("a struct");
        };
        assert_eq!(span as usize, size_of::<Params>());
        let names = module.entry_points.iter().map(|entry| entry.name.as_str());
        let names: HashSet<_> = names.collect();
        assert_eq!(names, PASSES.iter().map(|(name, _)| *name).collect());
        let groups = module.entry_points.iter().map(|e| e.workgroup_size);
        assert!(groups.into_iter().all(|size| size == [GROUP, 1, 1]));
    }
    /// A wall over the whole picture, a sample a pixel.
    fn wall(side: u32) -> Layered {
        let middle = DVec2::splat(0.5 * f64::from(side));
        let view = View {
            lens: Lens::pinhole(2.0 * middle, middle),
            width: side,
            height: side,
            camera_from_world: Rigid3::looking_at(DVec3::ZERO, DVec3::Z, DVec3::Y),
        };
        let sample = Sample {
            color: [200, 100, 50, 255],
            inverse_depth: 0.5,
            offset: [0; 2],
            look: Look::new(DVec3::NEG_Z, 1.0),
            ends: Ends(0),
        };
        let count = side as usize * side as usize;
        let samples = vec![sample; count].into_iter();
        Layered::new(view, 0, &vec![1; count], samples).unwrap()
    }

    #[test]
    fn after_an_error_an_image_is_brought_again() {
        let limits = DeviceLimits {
            buffer_bytes: Some(1 << 18),
            ..DeviceLimits::default()
        };
        let mut warp = match GpuWarp::open(&limits, false) {
            Ok(warp) => warp,
            Err(error) if std::env::var("LUMIGRAPH_REQUIRE_GPU").as_deref() == Ok("1") => {
                panic!("LUMIGRAPH_REQUIRE_GPU is 1, but: {error}")
            }
            Err(error) => {
                eprintln!("SKIPPED: LDIs on the graphics device: {error}");
                return;
            }
        };
        let (ldi, too_large) = (wall(16), wall(200));
        let camera = ldi.camera.clone();
        let window = Window::whole(16, 16);
        let draw = |warp: &mut GpuWarp, ldi: &Layered| {
            let mut target = Target::new(16, 16);
            let (all, options) = (Clipped::whole(ldi), FreeOptions::default());
            let drawn = warp.free(ldi, &all, &camera, &window, &options, &mut target);
            drawn.map(|_| target)
        };
        let expected = draw(&mut warp, &ldi).unwrap();
        // What is refused before the device was asked leaves what is there.
        draw(&mut warp, &too_large).unwrap_err();
        assert!(warp.held.len() == 1 && warp.pixels.is_some());
        // What the device fails at may have been the making of any of it.
        let full = RenderError::DeviceFull("full".to_owned());
        warp.opened.trouble.say(full.clone());
        assert!(draw(&mut warp, &ldi) == Err(full));
        assert!(warp.held.is_empty() && warp.pixels.is_none());
        assert!(draw(&mut warp, &ldi).unwrap() == expected);
        assert!(warp.held.len() == 1 && warp.pixels.is_some());
    }
}
