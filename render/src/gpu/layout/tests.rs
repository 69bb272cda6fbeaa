use super::super::groups::Rect;
use super::super::{Gpu, target};
use super::{Params, SOURCE_ROW, Source, lens_kind};
use crate::frame::every_lens::{self, TOLERANCE_PX};
use crate::frame::{Frame, depth_for_area};
use glam::{DVec3, Vec3};
use wgpu::{BindingResource, BufferBindingType, BufferUsages, ShaderStages};

const SHADER: &str = concat!(include_str!("../common.wgsl"), include_str!("project.wgsl"));

/// common.wgsl's `see` and `fov_blend`, for points of one photo at a time.
struct Projector<'a> {
    gpu: &'a Gpu,
    module: wgpu::ShaderModule,
    layouts: [wgpu::BindGroupLayout; 2],
    params: wgpu::Buffer,
    sources: wgpu::TextureView,
}

impl<'a> Projector<'a> {
    fn new(gpu: &'a Gpu, frame: &Frame<'_>) -> Self {
        let sources: Vec<Source> = (0..frame.sources.len())
            .map(|i| Source::of(frame, i, [None; 3]))
            .collect();
        let layout = |bindings: &[(u32, wgpu::BindingType)]| {
            let entry = |&(binding, ty): &(u32, wgpu::BindingType)| wgpu::BindGroupLayoutEntry {
                binding,
                visibility: ShaderStages::COMPUTE,
                ty,
                count: None,
            };
            let entries: Vec<_> = bindings.iter().map(entry).collect();
            gpu.device
                .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
                    label: None,
                    entries: &entries,
                })
        };
        let buffer = |ty| wgpu::BindingType::Buffer {
            ty,
            has_dynamic_offset: false,
            min_binding_size: None,
        };
        let storage = |read_only| buffer(BufferBindingType::Storage { read_only });
        let table = wgpu::BindingType::Texture {
            sample_type: wgpu::TextureSampleType::Float { filterable: false },
            view_dimension: wgpu::TextureViewDimension::D2,
            multisampled: false,
        };
        Self {
            gpu,
            module: gpu
                .device
                .create_shader_module(wgpu::ShaderModuleDescriptor {
                    label: Some("project"),
                    source: wgpu::ShaderSource::Wgsl(SHADER.into()),
                }),
            layouts: [
                layout(&[(0, buffer(BufferBindingType::Uniform)), (1, table)]),
                layout(&[(0, storage(true)), (1, storage(false))]),
            ],
            params: gpu.buffer(
                "params",
                &[Params::of(frame, [1; 2], 0, Rect::whole(0, 0), 0)],
                BufferUsages::UNIFORM,
            ),
            sources: gpu.table(
                "sources",
                wgpu::TextureFormat::Rgba32Float,
                bytemuck::cast_slice(&sources),
                SOURCE_ROW,
            ),
        }
    }

    /// Pixel, fovBlend and depth of each point; `lens` specialises the shader.
    fn see(&self, source_idx: usize, lens: f32, points: &[[f32; 4]]) -> Vec<[f32; 4]> {
        let Self { gpu, .. } = self;
        let device = &gpu.device;
        let [first, second] = &self.layouts;
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: None,
            bind_group_layouts: &[Some(first), Some(second)],
            immediate_size: 0,
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("project"),
            layout: Some(&layout),
            module: &self.module,
            entry_point: Some("project"),
            compilation_options: wgpu::PipelineCompilationOptions {
                constants: &[
                    ("COMMON_LENS", f64::from(lens)),
                    ("LENS_EDGES", 1.0),
                    ("SOURCE_IDX", source_idx as f64),
                ],
                ..Default::default()
            },
            cache: None,
        });
        let input = gpu.buffer("points", points, BufferUsages::STORAGE);
        let zeros = vec![[0.0_f32; 4]; points.len()];
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC;
        let output = gpu.buffer("sights", &zeros, usage);
        let entry = |binding, resource| wgpu::BindGroupEntry { binding, resource };
        let group = |layout, entries: &[wgpu::BindGroupEntry<'_>]| {
            device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: None,
                layout,
                entries,
            })
        };
        let sources = BindingResource::TextureView(&self.sources);
        let params = self.params.as_entire_binding();
        let first = group(first, &[entry(0, params), entry(1, sources)]);
        let (read, written) = (input.as_entire_binding(), output.as_entire_binding());
        let second = group(second, &[entry(0, read), entry(1, written)]);
        let readback = target::readback_buffer(device, output.size());
        let mut encoder = device.create_command_encoder(&Default::default());
        {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(&pipeline);
            pass.set_bind_group(0, &first, &[]);
            pass.set_bind_group(1, &second, &[]);
            pass.dispatch_workgroups((points.len() as u32).div_ceil(64), 1, 1);
        }
        encoder.copy_buffer_to_buffer(&output, 0, &readback, 0, output.size());
        let submitted = gpu.queue.submit([encoder.finish()]);
        let bytes = target::read(device, &readback, readback.size(), submitted);
        gpu.trouble.take().unwrap();
        bytemuck::pod_collect_to_vec(&bytes.unwrap())
    }
}

/// The shaders' projection, specialised to the lens and for any, against the f64 model's.
#[test]
fn every_lens_projects_as_the_f64_model_does() {
    let gpu = match Gpu::open() {
        Ok(gpu) => gpu,
        Err(error) if std::env::var("LUMIGRAPH_REQUIRE_GPU").as_deref() == Ok("1") => {
            panic!("LUMIGRAPH_REQUIRE_GPU is 1, but: {error}")
        }
        Err(error) => {
            eprintln!("SKIPPED: lenses on the graphics device: {error}");
            return;
        }
    };
    let lumigraph = every_lens::lumigraph();
    let frame = every_lens::frame(&lumigraph);
    let projector = Projector::new(&gpu, &frame);
    for (source_idx, view) in lumigraph.sources.iter().enumerate() {
        let name = &view.name;
        let source = &frame.sources[source_idx];
        let area = frame.area_scale(source_idx, super::common_plane(&frame));
        let expected = every_lens::points(&frame, source_idx);
        let points: Vec<[f32; 4]> = expected.iter().map(|(point, _)| *point).collect();
        let unseen = every_lens::unseen(&frame, source_idx);
        for lens in [lens_kind(source.lens.distortion()), -1.0] {
            let mut worst = 0.0_f64;
            let sights = projector.see(source_idx, lens, &points);
            for ((sight, (point, pixel)), at) in sights.iter().zip(&expected).zip(0..) {
                let [u, v, fov, depth] = *sight;
                worst = worst.max(every_lens::distance(source, [u, v], *pixel));
                assert!(fov > 0.0, "{name}: {pixel:?}");
                every_lens::check_fov(source, [u, v], fov, name);
                // The depth that levels of detail go by, in the areas' scale.
                if at % 97 == 0 {
                    let ray: DVec3 = Vec3::from_slice(point).as_dvec3();
                    let inverse_distance = f64::from(point[3]);
                    let there = source.rotation * ray + source.translation * inverse_distance;
                    let expected = depth_for_area(&source.lens, there) / area.cbrt();
                    let error = (f64::from(depth) - expected).abs();
                    assert!(error < 1e-5 * there.length(), "{name}: {depth}, {expected}");
                }
            }
            println!("{name}, as {lens}: {worst:.5} px");
            assert!(worst < TOLERANCE_PX, "{name}, as {lens}: {worst} px");
            for [_, _, fov, _] in projector.see(source_idx, lens, &unseen) {
                assert_eq!(fov, 0.0, "{name}, as {lens}");
            }
        }
    }
}
