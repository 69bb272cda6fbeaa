//! Shaders, pipelines and bind groups: what exists once per device.

use super::layout::{Corner, Special};
use std::collections::BTreeMap;
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

/// What a pipeline draws or computes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Pass {
    /// The triangulated field where no photo's border is.
    Triangles,
    /// The triangulated field where a photo's border crosses.
    BorderedTriangles,
    /// The exact field.
    Exact,
}

/// The pipelines made so far, and all that it takes to make more. Each exists once for
/// everything that shaders are specialised to.
pub(crate) struct Pipelines {
    made: BTreeMap<(Pass, Special), wgpu::RenderPipeline>,
    mark: BTreeMap<Special, wgpu::ComputePipeline>,
    shaders: [wgpu::ShaderModule; 3],
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
        let photos = texture(wgpu::TextureViewDimension::D2Array, true);
        let sampler = wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering);
        let table = texture(wgpu::TextureViewDimension::D2, false);
        let writable = buffer(Storage { read_only: false });
        // Not the vertices': some devices have no storage buffers for them.
        let all = ShaderStages::FRAGMENT | ShaderStages::COMPUTE;
        let fragment = ShaderStages::FRAGMENT;
        let shader = |(name, parts): (&str, &[&str])| {
            device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(name),
                source: wgpu::ShaderSource::Wgsl(parts.concat().into()),
            })
        };
        Self {
            made: BTreeMap::new(),
            mark: BTreeMap::new(),
            shaders: SHADERS.map(shader),
            shared_layout: layout(
                "shared",
                all,
                &[
                    buffer(Uniform),
                    table,
                    table,
                    table,
                    photos,
                    sampler,
                    photos,
                ],
            ),
            triangulated_layout: layout("triangulated", fragment, &[photos, sampler, table]),
            exact_layout: layout("exact", fragment, &[photos, sampler]),
            mark_layout: layout("mark", ShaderStages::COMPUTE, &[writable]),
        }
    }

    /// Makes sure that [`Self::get`] has a pipeline for a frame.
    pub(crate) fn ensure(&mut self, device: &Device, pass: Pass, special: Special) {
        let key = (pass, special);
        if self.made.contains_key(&key) {
            return;
        }
        let corners = [Some(wgpu::VertexBufferLayout {
            array_stride: size_of::<Corner>() as u64,
            step_mode: wgpu::VertexStepMode::Vertex,
            attributes: &wgpu::vertex_attr_array![0 => Float32x2, 1 => Uint32x2],
        })];
        let (own, module, vertex, fragment, buffers): (_, _, _, _, &[_]) = match pass {
            Pass::Triangles => (
                &self.triangulated_layout,
                &self.shaders[0],
                "corner",
                "triangle",
                &corners,
            ),
            Pass::BorderedTriangles => (
                &self.triangulated_layout,
                &self.shaders[0],
                "corner",
                "bordered_triangle",
                &corners,
            ),
            Pass::Exact => (
                &self.exact_layout,
                &self.shaders[1],
                "whole_image",
                "draw",
                &[],
            ),
        };
        let constants = special.constants();
        let compilation_options = wgpu::PipelineCompilationOptions {
            constants: &constants,
            ..Default::default()
        };
        let pipeline = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(fragment),
            layout: Some(&self.layout(device, own)),
            vertex: wgpu::VertexState {
                module,
                entry_point: Some(vertex),
                compilation_options: compilation_options.clone(),
                buffers,
            },
            primitive: wgpu::PrimitiveState::default(),
            depth_stencil: None,
            multisample: wgpu::MultisampleState::default(),
            fragment: Some(wgpu::FragmentState {
                module,
                entry_point: Some(fragment),
                compilation_options,
                targets: &[Some(PICTURE_FORMAT.into())],
            }),
            multiview_mask: None,
            cache: None,
        });
        self.made.insert(key, pipeline);
    }

    /// A pipeline that [`Self::ensure`] made.
    pub(crate) fn get(&self, pass: Pass, special: Special) -> &wgpu::RenderPipeline {
        &self.made[&(pass, special)]
    }

    /// The pass that marks the photos which the exact field samples.
    pub(crate) fn mark(&mut self, device: &Device, special: Special) -> &wgpu::ComputePipeline {
        let layout = self.layout(device, &self.mark_layout);
        let module = &self.shaders[2];
        self.mark.entry(special).or_insert_with(|| {
            device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some("mark"),
                layout: Some(&layout),
                module,
                entry_point: Some("mark"),
                compilation_options: wgpu::PipelineCompilationOptions {
                    constants: &special.constants(),
                    ..Default::default()
                },
                cache: None,
            })
        })
    }

    fn layout(&self, device: &Device, own: &BindGroupLayout) -> wgpu::PipelineLayout {
        device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: None,
            bind_group_layouts: &[Some(&self.shared_layout), Some(own)],
            immediate_size: 0,
        })
    }

    pub(crate) fn shared_group(
        &self,
        device: &Device,
        params: &wgpu::Buffer,
        sources: &wgpu::TextureView,
        rays: &wgpu::TextureView,
        planes: &wgpu::TextureView,
        masks: &wgpu::TextureView,
        sampler: &wgpu::Sampler,
        distances: &wgpu::TextureView,
    ) -> BindGroup {
        let resources = [
            params.as_entire_binding(),
            BindingResource::TextureView(sources),
            BindingResource::TextureView(rays),
            BindingResource::TextureView(planes),
            BindingResource::TextureView(masks),
            BindingResource::Sampler(sampler),
            BindingResource::TextureView(distances),
        ];
        group(device, &self.shared_layout, resources)
    }

    pub(crate) fn triangulated_group(
        &self,
        device: &Device,
        photos: &wgpu::TextureView,
        sampler: &wgpu::Sampler,
        entries: &wgpu::TextureView,
    ) -> BindGroup {
        let resources = [
            BindingResource::TextureView(photos),
            BindingResource::Sampler(sampler),
            BindingResource::TextureView(entries),
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

pub(super) fn group<const N: usize>(
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
