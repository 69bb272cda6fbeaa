//! Shaders, pipelines and bind groups: what exists once per device.

use super::layout::{Corner, Special};
use super::tables::Tables;
use std::collections::BTreeMap;
use wgpu::{BindGroup, BindGroupLayout, BindingResource, Device, ShaderStages};

/// What pictures are drawn in: stored sRGB values, blended as they are; a byte each of red, green, blue and
/// alpha, from the lowest.
pub(crate) const PICTURE_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::R32Uint;
/// Of which triangle each pixel sees.
pub(crate) const SEEN_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::R32Uint;

const COMMON: &str = include_str!("common.wgsl");
const TRIANGULATED: &str = include_str!("triangulated.wgsl");
const SEEN: &str = include_str!("seen.wgsl");
const EXACT: &str = include_str!("exact.wgsl");
const EXACT_DRAW: &str = include_str!("exact_draw.wgsl");
const EXACT_MARK: &str = include_str!("exact_mark.wgsl");

/// Every shader as it is compiled: its name and its parts, in order.
pub(crate) const SHADERS: [(&str, &[&str]); 4] = [
    ("seen", &[SEEN]),
    ("triangulated", &[COMMON, SEEN, TRIANGULATED]),
    ("exact_draw", &[COMMON, EXACT, EXACT_DRAW]),
    ("exact_mark", &[COMMON, EXACT, EXACT_MARK]),
];

/// By what colours are computed. The arithmetic is the same, and so are the bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShadeBy {
    /// Fragments of what is drawn: half the time on drivers that only imitate a graphics processor.
    Fragments,
    /// Workgroups, a pixel a thread, for which the rasteriser only numbers the pixels: processors made for computing
    /// have many units that can compute, and few that can draw.
    Workgroups,
}

impl ShadeBy {
    /// Whether what a pixel sees is looked up by tiles: there is less to bring, and one more fetch a pixel, which costs
    /// drivers that imitate a graphics processor more.
    pub(crate) fn looks_up_tiles(self) -> bool {
        self == Self::Workgroups
    }

    /// Whether a pixel keeps where it samples each photo that may count, rather than to find it again for the few
    /// that do: graphics processors have memory of their own for little, which imitations need not have.
    fn keeps_texels(self) -> bool {
        self == Self::Fragments
    }
}

/// What a pipeline computes at each pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Pass {
    /// The triangulated field where no photo's border is.
    Triangles,
    /// The triangulated field where a photo's border crosses.
    BorderedTriangles,
    /// The exact field.
    Exact,
    /// Which photos the exact field samples.
    Mark,
}

/// The pipelines made so far, and all that it takes to make more. Each exists once for
/// everything that shaders are specialised to.
pub(crate) struct Pipelines {
    pub shade_by: ShadeBy,
    computing: BTreeMap<(Pass, Special), wgpu::ComputePipeline>,
    drawing: BTreeMap<(Pass, Special), wgpu::RenderPipeline>,
    /// Numbers the pixels of triangles.
    pub seen: wgpu::RenderPipeline,
    shaders: [wgpu::ShaderModule; 4],
    shared_layout: BindGroupLayout,
    triangulated_layout: BindGroupLayout,
    exact_layout: BindGroupLayout,
    mark_layout: BindGroupLayout,
    /// What workgroups read and write besides.
    seen_layout: BindGroupLayout,
    picture_layout: BindGroupLayout,
}

impl Pipelines {
    pub(crate) fn new(device: &Device, shade_by: ShadeBy) -> Self {
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
        // Not the vertices', which read no table.
        let all = ShaderStages::FRAGMENT | ShaderStages::COMPUTE;
        let compute = ShaderStages::COMPUTE;
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
        let numbers = wgpu::BindingType::Texture {
            sample_type: wgpu::TextureSampleType::Uint,
            view_dimension: wgpu::TextureViewDimension::D2,
            multisampled: false,
        };
        let writable = buffer(Storage { read_only: false });
        let picture = wgpu::BindingType::StorageTexture {
            access: wgpu::StorageTextureAccess::WriteOnly,
            format: PICTURE_FORMAT,
            view_dimension: wgpu::TextureViewDimension::D2,
        };
        let shader = |(name, parts): (&str, &[&str])| {
            device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(name),
                source: wgpu::ShaderSource::Wgsl(parts.concat().into()),
            })
        };
        let shaders = SHADERS.map(shader);
        let shared = [
            buffer(Uniform),
            table,
            table,
            table,
            photos,
            sampler,
            photos,
            numbers,
        ];
        let triangulated = [photos, sampler, table, numbers];
        Self {
            shade_by,
            computing: BTreeMap::new(),
            drawing: BTreeMap::new(),
            seen: drawing(device, None, [&shaders[0]; 2], "number", SEEN_FORMAT, &[]),
            shaders,
            shared_layout: layout("shared", all, &shared),
            triangulated_layout: layout("triangulated", all, &triangulated),
            exact_layout: layout("exact", all, &[photos, sampler]),
            mark_layout: layout("mark", compute, &[writable]),
            seen_layout: layout("seen", compute, &[numbers, picture]),
            picture_layout: layout("picture", compute, &[picture]),
        }
    }

    /// Makes sure that there is a pipeline for a frame.
    pub(crate) fn ensure(&mut self, device: &Device, pass: Pass, special: Special) {
        let key = (pass, special);
        if self.computing.contains_key(&key) || self.drawing.contains_key(&key) {
            return;
        }
        let (own, picture, module) = match pass {
            Pass::Triangles | Pass::BorderedTriangles => (
                &self.triangulated_layout,
                Some(&self.seen_layout),
                &self.shaders[1],
            ),
            Pass::Exact => (
                &self.exact_layout,
                Some(&self.picture_layout),
                &self.shaders[2],
            ),
            Pass::Mark => (&self.mark_layout, None, &self.shaders[3]),
        };
        let layout = |groups: &[Option<&BindGroupLayout>]| {
            device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: None,
                bind_group_layouts: groups,
                immediate_size: 0,
            })
        };
        let shared = &self.shared_layout;
        let mut constants = special.constants().to_vec();
        let flag = |set: bool| f64::from(u8::from(set));
        constants.push(("BY_TILES", flag(self.shade_by.looks_up_tiles())));
        if matches!(pass, Pass::Triangles | Pass::BorderedTriangles) {
            constants.push(("KEEPS_TEXELS", flag(self.shade_by.keeps_texels())));
        }
        match (self.shade_by, pass) {
            (ShadeBy::Fragments, Pass::Triangles | Pass::BorderedTriangles | Pass::Exact) => {
                let (corners, name) = match pass {
                    Pass::Triangles => (&self.shaders[0], "plain_fragment"),
                    Pass::BorderedTriangles => (&self.shaders[0], "bordered_fragment"),
                    _ => (module, "draw_fragment"),
                };
                let layout = layout(&[Some(shared), Some(own)]);
                let modules = [corners, module];
                let made = drawing(
                    device,
                    Some(&layout),
                    modules,
                    name,
                    PICTURE_FORMAT,
                    &constants,
                );
                self.drawing.insert(key, made);
            }
            _ => {
                let name = match pass {
                    Pass::Triangles => "plain",
                    Pass::BorderedTriangles => "bordered",
                    Pass::Exact => "draw",
                    Pass::Mark => "mark",
                };
                let groups = [Some(shared), Some(own), picture];
                let layout = layout(&groups[..2 + usize::from(picture.is_some())]);
                let made = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                    label: Some(name),
                    layout: Some(&layout),
                    module,
                    entry_point: Some(name),
                    compilation_options: wgpu::PipelineCompilationOptions {
                        constants: &constants,
                        ..Default::default()
                    },
                    cache: None,
                });
                self.computing.insert(key, made);
            }
        }
    }

    /// A pipeline of workgroups that [`Self::ensure`] made.
    pub(crate) fn computing(&self, pass: Pass, special: Special) -> &wgpu::ComputePipeline {
        &self.computing[&(pass, special)]
    }

    /// A pipeline of fragments that [`Self::ensure`] made.
    pub(crate) fn drawing(&self, pass: Pass, special: Special) -> &wgpu::RenderPipeline {
        &self.drawing[&(pass, special)]
    }

    pub(crate) fn shared_group(
        &self,
        device: &Device,
        params: &wgpu::Buffer,
        sources: &wgpu::TextureView,
        tables: &Tables,
        masks: &wgpu::TextureView,
        sampler: &wgpu::Sampler,
        distances: &wgpu::TextureView,
    ) -> BindGroup {
        let resources = [
            params.as_entire_binding(),
            BindingResource::TextureView(sources),
            BindingResource::TextureView(&tables.rays),
            BindingResource::TextureView(&tables.planes),
            BindingResource::TextureView(masks),
            BindingResource::Sampler(sampler),
            BindingResource::TextureView(distances),
            BindingResource::TextureView(&tables.facets),
        ];
        group(device, &self.shared_layout, resources)
    }

    pub(crate) fn triangulated_group(
        &self,
        device: &Device,
        photos: &wgpu::TextureView,
        sampler: &wgpu::Sampler,
        [entries, triangles]: [&wgpu::TextureView; 2],
    ) -> BindGroup {
        let resources = [
            BindingResource::TextureView(photos),
            BindingResource::Sampler(sampler),
            BindingResource::TextureView(entries),
            BindingResource::TextureView(triangles),
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

    /// For workgroups: `seen` and `picture` are of one size.
    pub(crate) fn seen_group(
        &self,
        device: &Device,
        seen: &wgpu::TextureView,
        picture: &wgpu::TextureView,
    ) -> BindGroup {
        let resources = [seen, picture].map(BindingResource::TextureView);
        group(device, &self.seen_layout, resources)
    }

    /// For workgroups.
    pub(crate) fn picture_group(&self, device: &Device, picture: &wgpu::TextureView) -> BindGroup {
        let resources = [BindingResource::TextureView(picture)];
        group(device, &self.picture_layout, resources)
    }

    pub(crate) fn mark_group(&self, device: &Device, used: &wgpu::Buffer) -> BindGroup {
        group(device, &self.mark_layout, [used.as_entire_binding()])
    }
}

/// A pipeline of triangles, or of one that covers the image: `fragment` says which.
fn drawing(
    device: &Device,
    layout: Option<&wgpu::PipelineLayout>,
    [vertices, fragments]: [&wgpu::ShaderModule; 2],
    fragment: &str,
    format: wgpu::TextureFormat,
    constants: &[(&str, f64)],
) -> wgpu::RenderPipeline {
    let corners = [Some(wgpu::VertexBufferLayout {
        array_stride: size_of::<Corner>() as u64,
        step_mode: wgpu::VertexStepMode::Vertex,
        attributes: &wgpu::vertex_attr_array![0 => Float32x2],
    })];
    let (vertex, buffers): (_, &[_]) = match fragment {
        "draw_fragment" => ("whole_image", &[]),
        _ => ("corner", &corners),
    };
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(fragment),
        layout,
        vertex: wgpu::VertexState {
            module: vertices,
            entry_point: Some(vertex),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            buffers,
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: None,
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module: fragments,
            entry_point: Some(fragment),
            compilation_options: wgpu::PipelineCompilationOptions {
                constants,
                ..Default::default()
            },
            targets: &[Some(format.into())],
        }),
        multiview_mask: None,
        cache: None,
    })
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
