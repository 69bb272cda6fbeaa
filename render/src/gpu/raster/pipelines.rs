//! The passes that draw a model.

use crate::gpu::pipelines::group;
use wgpu::{BindGroupLayout, Device, ShaderStages, TextureFormat};

/// Which triangle a pixel sees, and in which window.
pub(super) const SEEN: TextureFormat = TextureFormat::Rg32Uint;
/// A pixel's colour and the bits of its inverse depth.
pub(super) const DRAWN: TextureFormat = TextureFormat::Rg32Uint;
/// The nearer the greater, and 0 where nothing is.
pub(super) const DEPTH: TextureFormat = TextureFormat::Depth32Float;

pub(super) const SHADER: &str = include_str!("raster.wgsl");

/// What exists once a device.
pub(super) struct Pipelines {
    pub in_front: wgpu::RenderPipeline,
    pub in_front_in_window: wgpu::RenderPipeline,
    pub across: wgpu::RenderPipeline,
    pub shade: wgpu::RenderPipeline,
    layouts: [BindGroupLayout; 3],
}

impl Pipelines {
    pub(super) fn new(device: &Device) -> Self {
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("raster"),
            source: wgpu::ShaderSource::Wgsl(SHADER.into()),
        });
        let uniform = wgpu::BindingType::Buffer {
            ty: wgpu::BufferBindingType::Uniform,
            has_dynamic_offset: false,
            min_binding_size: None,
        };
        let table = wgpu::BindingType::Texture {
            sample_type: wgpu::TextureSampleType::Uint,
            view_dimension: wgpu::TextureViewDimension::D2,
            multisampled: false,
        };
        let layout = |label, bindings: &[wgpu::BindingType]| {
            let entry = |(binding, ty): (usize, &wgpu::BindingType)| wgpu::BindGroupLayoutEntry {
                binding: binding as u32,
                visibility: ShaderStages::VERTEX_FRAGMENT,
                ty: *ty,
                count: None,
            };
            let entries: Vec<_> = bindings.iter().enumerate().map(entry).collect();
            device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
                label: Some(label),
                entries: &entries,
            })
        };
        let layouts = [
            layout("model", &[uniform, table, table]),
            layout("list", &[table; 2]),
            layout("looks", &[table; 4]),
        ];
        let pipeline = |vertex, fragment, groups: [Option<&BindGroupLayout>; 3], format, depth| {
            device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some(fragment),
                layout: Some(
                    &device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                        label: Some(fragment),
                        bind_group_layouts: &groups,
                        immediate_size: 0,
                    }),
                ),
                vertex: wgpu::VertexState {
                    module: &module,
                    entry_point: Some(vertex),
                    compilation_options: Default::default(),
                    buffers: &[],
                },
                // Both sides of triangles are seen.
                primitive: wgpu::PrimitiveState::default(),
                depth_stencil: depth,
                multisample: wgpu::MultisampleState::default(),
                fragment: Some(wgpu::FragmentState {
                    module: &module,
                    entry_point: Some(fragment),
                    compilation_options: Default::default(),
                    targets: &[Some(wgpu::TextureFormat::into(format))],
                }),
                multiview_mask: None,
                cache: None,
            })
        };
        let met = |fragment| {
            let depth = wgpu::DepthStencilState {
                format: DEPTH,
                depth_write_enabled: Some(true),
                // Of two as near the first, which has the lower index.
                depth_compare: Some(wgpu::CompareFunction::Greater),
                stencil: Default::default(),
                bias: Default::default(),
            };
            let groups = [Some(&layouts[0]), Some(&layouts[1]), None];
            pipeline("corner", fragment, groups, SEEN, Some(depth))
        };
        let looks = [0, 1, 2].map(|i| Some(&layouts[i]));
        Self {
            in_front: met("in_front"),
            in_front_in_window: met("in_front_in_window"),
            across: met("across"),
            shade: pipeline("whole_picture", "shade", looks, DRAWN, None),
            layouts,
        }
    }

    pub(super) fn model(
        &self,
        device: &Device,
        camera: &wgpu::Buffer,
        tables: [&wgpu::TextureView; 2],
    ) -> wgpu::BindGroup {
        let camera = camera.as_entire_binding();
        let [triangles, places] = tables.map(wgpu::BindingResource::TextureView);
        group(device, &self.layouts[0], [camera, triangles, places])
    }

    pub(super) fn list(&self, device: &Device, tables: [&wgpu::TextureView; 2]) -> wgpu::BindGroup {
        let tables = tables.map(wgpu::BindingResource::TextureView);
        group(device, &self.layouts[1], tables)
    }

    pub(super) fn looks(
        &self,
        device: &Device,
        tables: [&wgpu::TextureView; 4],
    ) -> wgpu::BindGroup {
        let tables = tables.map(wgpu::BindingResource::TextureView);
        group(device, &self.layouts[2], tables)
    }
}
