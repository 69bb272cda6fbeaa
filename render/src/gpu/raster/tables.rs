//! A model as tables of texels, which shaders read from whatever stage.
//!
//! Places are two f32 each, from the model's middle and in units of about its size: 48 bits, so
//! that the eye can be subtracted before anything is rounded to 24.

use crate::RenderError;
use crate::gpu::target::flat;
use glam::DVec3;
use proxy::mesh::{Material, Model, Wrap};
use rayon::prelude::*;
use wgpu::TextureFormat;

/// A model on a device.
pub(super) struct Held {
    pub triangles: wgpu::TextureView,
    pub places: wgpu::TextureView,
    pub uvs: wgpu::TextureView,
    pub materials: wgpu::TextureView,
    pub texels: wgpu::TextureView,
    pub units: Units,
    /// How many triangles it has.
    pub count: usize,
}

/// Where zero is and what one is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Units {
    origin: DVec3,
    /// World units; a power of two, so that no digit is lost.
    pub world_per_unit: f64,
}

impl Units {
    /// The model's middle, and about its size.
    pub(super) fn of(model: &Model) -> Self {
        let (low, high) = model.mesh.bounds().unwrap_or_default();
        let size = (high - low).max_element();
        let exponent = if size > 0.0 {
            size.log2().ceil().clamp(-100.0, 100.0)
        } else {
            0.0
        };
        Self {
            origin: low.midpoint(high),
            world_per_unit: exponent.exp2(),
        }
    }

    /// A point of the world as the nearest numbers, and what is left.
    pub(super) fn place(&self, point_in_world: DVec3) -> [[f32; 3]; 2] {
        let place = (point_in_world - self.origin) / self.world_per_unit;
        let near = place.as_vec3();
        [near, (place - near.as_dvec3()).as_vec3()].map(|v| v.to_array())
    }
}

/// Makes tables on a device.
#[derive(Clone, Copy)]
pub(super) struct Tables<'a> {
    pub device: &'a wgpu::Device,
    pub queue: &'a wgpu::Queue,
    /// Texels along a texture's side.
    pub side: u32,
    /// Bytes of a buffer, through which textures are written.
    pub most_bytes: u64,
}

impl Tables<'_> {
    /// Bits of the index within a row.
    pub(super) fn row_bits(&self) -> u32 {
        self.side.max(1).ilog2()
    }

    /// A table of entries of some words each; never empty.
    ///
    /// # Errors
    /// More than a texture holds; `what` they are.
    pub(super) fn table<const WORDS: usize>(
        &self,
        what: &'static str,
        entries: &[[u32; WORDS]],
    ) -> Result<wgpu::TextureView, RenderError> {
        let format = match WORDS {
            1 => TextureFormat::R32Uint,
            2 => TextureFormat::Rg32Uint,
            _ => TextureFormat::Rgba32Uint,
        };
        let row = 1 << self.row_bits();
        let rows = entries.len().div_ceil(row).max(1);
        if rows > self.side as usize {
            return Err(RenderError::Gpu(format!(
                "{} {what} are more than a texture holds ({}); use --device cpu",
                entries.len(),
                row * self.side as usize
            )));
        }
        let width = entries.len().clamp(1, row);
        let usage = wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST;
        let size = [width as u32, rows as u32];
        let texture = self.device.create_texture(&flat(what, format, size, usage));
        // Some rows at a time: each write goes through a buffer.
        let row_bytes = (row * WORDS * 4) as u64;
        let at_once = (self.most_bytes.min(1 << 26) / row_bytes).max(1) as usize;
        for (i, part) in entries.chunks(row * at_once).enumerate() {
            let write = |first: usize, entries: &[[u32; WORDS]], width: usize, rows: usize| {
                self.queue.write_texture(
                    wgpu::TexelCopyTextureInfo {
                        origin: wgpu::Origin3d {
                            x: 0,
                            y: first as u32,
                            z: 0,
                        },
                        ..texture.as_image_copy()
                    },
                    bytemuck::cast_slice(entries.as_flattened()),
                    wgpu::TexelCopyBufferLayout {
                        offset: 0,
                        bytes_per_row: Some((width * WORDS * 4) as u32),
                        rows_per_image: Some(rows as u32),
                    },
                    wgpu::Extent3d {
                        width: width as u32,
                        height: rows as u32,
                        depth_or_array_layers: 1,
                    },
                );
            };
            let (whole, rest) = part.split_at(part.len() / row * row);
            let (first, rows) = (i * at_once, whole.len() / row);
            if rows > 0 {
                write(first, whole, row, rows);
            }
            if !rest.is_empty() {
                write(first + rows, rest, rest.len(), 1);
            }
        }
        Ok(texture.create_view(&Default::default()))
    }

    /// Brings a model to the device.
    ///
    /// # Errors
    /// More of something than a texture holds.
    pub(super) fn hold(&self, model: &Model) -> Result<Held, RenderError> {
        let units = Units::of(model);
        let corners = model.mesh.positions.len();
        if corners.max(model.mesh.triangles.len()) > MOST {
            return Err(RenderError::Gpu(format!(
                "a model of {corners} corners and {} triangles is more than it draws ({MOST} of \
                 each); use --device cpu",
                model.mesh.triangles.len()
            )));
        }
        let plain = model.materials.len() as u32;
        let triangle = |i: u32| {
            let [a, b, c] = model.mesh.triangles[i as usize];
            let material = model.part_of(i).map(|part| part.material_idx);
            [a, b, c, material.filter(|m| *m < plain).unwrap_or(plain)]
        };
        let all = (0..model.mesh.triangles.len() as u32).into_par_iter();
        let triangles: Vec<[u32; 4]> = all.map(triangle).collect();
        let triangles = self.table("triangles", &triangles)?;
        let place = |i: usize| {
            let [near, rest] = units.place(model.mesh.positions[i]);
            let color = u32::from_le_bytes(model.colors[i]);
            let [[x, y, z], [u, v, w]] = [near, rest].map(|p| p.map(f32::to_bits));
            [[x, y, z, color], [u, v, w, 0]]
        };
        let places: Vec<[[u32; 4]; 2]> = (0..corners).into_par_iter().map(place).collect();
        let places = self.table("corners", places.as_flattened())?;
        let uvs: Vec<[u32; 2]> = model.uvs.iter().map(|uv| uv.map(f32::to_bits)).collect();
        let uvs = self.table("corners", &uvs)?;
        // Textures one after the other, each with its levels.
        let mut texels: Vec<[u32; 1]> = Vec::new();
        let mut firsts = Vec::new();
        for texture in &model.textures {
            if texels.len() + texture.texels().len() > MOST {
                return Err(RenderError::Gpu(format!(
                    "textures of more than {MOST} pixels together are more than it draws; use \
                     --device cpu"
                )));
            }
            let finest = texture.levels().first();
            let [width, height] = finest.map_or([0; 2], |level| [level.width, level.height]);
            let count = texture.levels().len() as u32;
            firsts.push([texels.len() as u32, width, height, count]);
            texels.extend(texture.texels().iter().map(|t| [u32::from_le_bytes(*t)]));
        }
        let texels = self.table("pixels of textures", &texels)?;
        let plain = Material::default();
        let materials = model.materials.iter().chain([&plain]);
        let materials: Vec<[[u32; 4]; 2]> = materials.map(|m| material(m, &firsts)).collect();
        let materials = self.table("materials", materials.as_flattened())?;
        Ok(Held {
            triangles,
            places,
            uvs,
            materials,
            texels,
            units,
            count: model.mesh.triangles.len(),
        })
    }
}

/// Entries are counted in 32 bits, two a corner; three vertices are drawn a triangle.
const MOST: usize = 1 << 30;

fn material(material: &Material, textures: &[[u32; 4]]) -> [[u32; 4]; 2] {
    let wrap = material.wrap.map(|wrap| match wrap {
        Wrap::Repeat => 0,
        Wrap::Mirror => 1,
        Wrap::Clamp => 2,
    });
    let [r, g, b] = material.base_color.map(f32::to_bits);
    let texture = material.texture_idx.and_then(|i| textures.get(i as usize));
    [
        [r, g, b, wrap[0] | wrap[1] << 2],
        texture.copied().unwrap_or_default(),
    ]
}
