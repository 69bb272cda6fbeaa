//! Shaders, pipelines and bind groups: what exists once per device.

use super::layout::Corner;
use wgpu::{BindGroup, BindGroupLayout, BindingResource, Device, ShaderStages};

/// What pictures are drawn in: stored sRGB values, blended as they are.
pub(crate) const PICTURE_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;

const COMMON: &str = include_str!("common.wgsl");
const TRIANGULATED: &str = include_str!("triangulated.wgsl");
const EXACT: &str = include_str!("exact.wgsl");
const EXACT_DRAW: &str = include_str!("exact_draw.wgsl");
const EXACT_MARK: &str = include_str!("exact_mark.wgsl");

/// Every shader as it is compiled: its name and its parts, in order.
pub(crate) const SHADERS: [(&str, &[&str]); 3] = [
    ("triangulated", &[COMMON, TRIANGULATED]),
    ("exact_draw", &[COMMON, EXACT, EXACT_DRAW]),
    ("exact_mark", &[COMMON, EXACT, EXACT_MARK]),
];

/// Pipelines and the layouts of what they read.
pub(crate) struct Pipelines {
    pub triangles: wgpu::RenderPipeline,
    pub bordered_triangles: wgpu::RenderPipeline,
    pub exact: wgpu::RenderPipeline,
    pub mark: wgpu::ComputePipeline,
    shared_layout: BindGroupLayout,
    triangulated_layout: BindGroupLayout,
    exact_layout: BindGroupLayout,
    mark_layout: BindGroupLayout,
}

impl Pipelines {
    pub(crate) fn new(device: &Device) -> Self {
        use wgpu::BufferBindingType::{Storage, Uniform};
        let buffer = |ty| wgpu::BindingType::Buffer {
            ty,
            has_dynamic_offset: false,
            min_binding_size: None,
        };
        let texture = |view_dimension, filterable| wgpu::BindingType::Texture {
            sample_type: wgpu::TextureSampleType::Float { filterable },
            view_dimension,
            multisampled: false,
        };
        let layout = |label, visibility, bindings: &[wgpu::BindingType]| {
            let entry = |(binding, ty): (usize, &wgpu::BindingType)| wgpu::BindGroupLayoutEntry {
                binding: binding as u32,
                visibility,
                ty: *ty,
                count: None,
            };
            let entries: Vec<_> = bindings.iter().enumerate().map(entry).collect();
            device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
                label: Some(label),
                entries: &entries,
            })
        };
        let read_only = buffer(Storage { read_only: true });
        let photos = texture(wgpu::TextureViewDimension::D2Array, true);
        let sampler = wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering);
        let fragment = ShaderStages::FRAGMENT;
        let rays = texture(wgpu::TextureViewDimension::D2, false);
        let shared_layout = layout(
            "shared",
            ShaderStages::VERTEX_FRAGMENT | ShaderStages::COMPUTE,
            &[buffer(Uniform), read_only, rays],
        );
        let triangulated_layout = layout("triangulated", fragment, &[photos, sampler, read_only]);
        let exact_layout = layout("exact", fragment, &[photos, sampler]);
        let writable = buffer(Storage { read_only: false });
        let mark_layout = layout("mark", ShaderStages::COMPUTE, &[writable]);

        let shader = |(name, parts): (&str, &[&str])| {
            device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(name),
                source: wgpu::ShaderSource::Wgsl(parts.concat().into()),
            })
        };
        let [triangulated, exact_draw, exact_mark] = SHADERS.map(shader);
        let pipeline_layout = |own: &BindGroupLayout| {
            device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: None,
                bind_group_layouts: &[Some(&shared_layout), Some(own)],
                immediate_size: 0,
            })
        };
        let render = |own, module, vertex, fragment, buffers: &[_]| {
            device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some(fragment),
                layout: Some(&pipeline_layout(own)),
                vertex: wgpu::VertexState {
                    module,
                    entry_point: Some(vertex),
                    compilation_options: Default::default(),
                    buffers,
                },
                primitive: wgpu::PrimitiveState::default(),
                depth_stencil: None,
                multisample: wgpu::MultisampleState::default(),
                fragment: Some(wgpu::FragmentState {
                    module,
                    entry_point: Some(fragment),
                    compilation_options: Default::default(),
                    targets: &[Some(PICTURE_FORMAT.into())],
                }),
                multiview_mask: None,
                cache: None,
            })
        };
        let corner_layout = wgpu::VertexBufferLayout {
            array_stride: size_of::<Corner>() as u64,
            step_mode: wgpu::VertexStepMode::Vertex,
            attributes: &wgpu::vertex_attr_array![0 => Float32x2, 1 => Uint32x2],
        };
        let field_pipeline = |fragment| {
            let corners = [Some(corner_layout.clone())];
            render(
                &triangulated_layout,
                &triangulated,
                "corner",
                fragment,
                &corners,
            )
        };
        Self {
            triangles: field_pipeline("triangle"),
            bordered_triangles: field_pipeline("bordered_triangle"),
            exact: render(&exact_layout, &exact_draw, "whole_image", "draw", &[]),
            mark: device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some("mark"),
                layout: Some(&pipeline_layout(&mark_layout)),
                module: &exact_mark,
                entry_point: Some("mark"),
                compilation_options: Default::default(),
                cache: None,
            }),
            shared_layout,
            triangulated_layout,
            exact_layout,
            mark_layout,
        }
    }

    pub(crate) fn shared_group(
        &self,
        device: &Device,
        params: &wgpu::Buffer,
        sources: &wgpu::Buffer,
        rays: &wgpu::TextureView,
    ) -> BindGroup {
        let resources = [
            params.as_entire_binding(),
            sources.as_entire_binding(),
            BindingResource::TextureView(rays),
        ];
        group(device, &self.shared_layout, resources)
    }

    pub(crate) fn triangulated_group(
        &self,
        device: &Device,
        photos: &wgpu::TextureView,
        sampler: &wgpu::Sampler,
        entries: &wgpu::Buffer,
    ) -> BindGroup {
        let resources = [
            BindingResource::TextureView(photos),
            BindingResource::Sampler(sampler),
            entries.as_entire_binding(),
        ];
        group(device, &self.triangulated_layout, resources)
    }

    pub(crate) fn exact_group(
        &self,
        device: &Device,
        photos: &wgpu::TextureView,
        sampler: &wgpu::Sampler,
    ) -> BindGroup {
        let resources = [
            BindingResource::TextureView(photos),
            BindingResource::Sampler(sampler),
        ];
        group(device, &self.exact_layout, resources)
    }

    pub(crate) fn mark_group(&self, device: &Device, used: &wgpu::Buffer) -> BindGroup {
        group(device, &self.mark_layout, [used.as_entire_binding()])
    }
}

fn group<const N: usize>(
    device: &Device,
    layout: &BindGroupLayout,
    resources: [BindingResource<'_>; N],
) -> BindGroup {
    let entries: Vec<_> = resources
        .into_iter()
        .enumerate()
        .map(|(binding, resource)| wgpu::BindGroupEntry {
            binding: binding as u32,
            resource,
        })
        .collect();
    device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout,
        entries: &entries,
    })
}
