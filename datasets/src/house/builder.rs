//! Triangles, as walls and furniture are made of them.

use super::textures::Picture;
use glam::{DVec2, DVec3};
use proxy::mesh::{Material, Mesh, Model, ModelNode, Part, Texture};
use std::f64::consts::{PI, TAU};

/// A material: what picture, how it is tinted, and whether it shines by itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Look {
    pub(super) picture: Option<Picture>,
    /// 0xrrggbb, sRGB.
    pub(super) tint: u32,
    /// Not lit: it is as bright as it can be.
    pub(super) shines: bool,
}

/// Coloured, without a picture.
pub(super) const fn plain(tint: u32) -> Look {
    Look {
        picture: None,
        tint,
        shines: false,
    }
}

pub(super) const fn pictured(picture: Picture, tint: u32) -> Look {
    Look {
        picture: Some(picture),
        tint,
        shines: false,
    }
}

/// Where an item stands: its origin, and a quarter turn about y.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stand {
    pub(super) origin: DVec3,
    /// Where its z points, a unit vector along x or z.
    pub(super) front: DVec3,
}

impl Stand {
    fn turn(&self, v: DVec3) -> DVec3 {
        DVec3::Y.cross(self.front) * v.x + DVec3::Y * v.y + self.front * v.z
    }
}

pub(super) const IN_PLACE: Stand = Stand {
    origin: DVec3::ZERO,
    front: DVec3::Z,
};

/// What is being built.
pub(super) struct Builder {
    /// Sides of triangles for each metre.
    density: f64,
    pub(super) stand: Stand,
    positions: Vec<DVec3>,
    pub(super) normals: Vec<DVec3>,
    uvs: Vec<[f32; 2]>,
    /// Of each corner: whether it shines.
    pub(super) shines: Vec<bool>,
    triangles: Vec<[u32; 3]>,
    parts: Vec<Part>,
    nodes: Vec<ModelNode>,
    looks: Vec<Look>,
}

impl Builder {
    pub(super) fn new(density: f64) -> Self {
        Self {
            density,
            stand: IN_PLACE,
            positions: Vec::new(),
            normals: Vec::new(),
            uvs: Vec::new(),
            shines: Vec::new(),
            triangles: Vec::new(),
            parts: Vec::new(),
            nodes: Vec::new(),
            looks: Vec::new(),
        }
    }

    pub(super) fn triangle_count(&self) -> usize {
        self.triangles.len()
    }

    /// From here on things belong to a new node.
    pub(super) fn node(&mut self, name: String, parent_idx: Option<u32>) -> u32 {
        self.nodes.push(ModelNode { name, parent_idx });
        self.nodes.len() as u32 - 1
    }

    fn segments(&self, length: f64) -> u32 {
        ((length * self.density).ceil() as u32).max(1)
    }

    /// For something round.
    fn around(&self, radius: f64) -> u32 {
        8 + 2 * (PI * radius * self.density) as u32
    }

    fn push(&mut self, position: DVec3, normal: DVec3, uv: DVec2, look: Look) -> u32 {
        // As the file will have it.
        let position = self.stand.origin + self.stand.turn(position);
        self.positions.push(position.as_vec3().as_dvec3());
        self.normals
            .push(self.stand.turn(normal).normalize_or(DVec3::Y));
        self.uvs.push(uv.as_vec2().to_array());
        self.shines.push(look.shines);
        self.positions.len() as u32 - 1
    }

    /// Counts triangles from here on as a part.
    fn part(&mut self, look: Look, from: usize) {
        let material_idx = match self.looks.iter().position(|l| *l == look) {
            Some(i) => i,
            None => {
                self.looks.push(look);
                self.looks.len() - 1
            }
        } as u32;
        let node_idx = (self.nodes.len() as u32).saturating_sub(1);
        let end = self.triangles.len() as u32;
        match self.parts.last_mut() {
            Some(last) if last.node_idx == node_idx && last.material_idx == material_idx => {
                last.triangles.end = end;
            }
            _ => self.parts.push(Part {
                triangles: from as u32..end,
                node_idx,
                material_idx,
            }),
        }
    }

    /// A grid of corners as triangles, facing along their normals where it is turned so.
    fn grid(&mut self, first: u32, across: u32, down: u32, is_turned: bool) {
        for row in 0..down {
            for column in 0..across {
                let at = |r: u32, c: u32| first + r * (across + 1) + c;
                let (a, b) = (at(row, column), at(row, column + 1));
                let (c, d) = (at(row + 1, column), at(row + 1, column + 1));
                for t in [[a, b, d], [a, d, c]] {
                    let t = if is_turned { [t[0], t[2], t[1]] } else { t };
                    let [p, q, r] = t.map(|i| self.positions[i as usize]);
                    // At a pole two corners are one.
                    if p != q && q != r && r != p {
                        self.triangles.push(t);
                    }
                }
            }
        }
    }

    /// A rectangle from a corner along two sides, seen from where `towards` points.
    pub(super) fn rectangle(
        &mut self,
        corner: DVec3,
        [along, up]: [DVec3; 2],
        towards: DVec3,
        look: Look,
    ) {
        let from = self.triangles.len();
        let (across, down) = (self.segments(along.length()), self.segments(up.length()));
        let metres = look.picture.map_or(Some(1.0), Picture::metres);
        let first = self.positions.len() as u32;
        for row in 0..=down {
            for column in 0..=across {
                let (s, t) = (
                    f64::from(column) / f64::from(across),
                    f64::from(row) / f64::from(down),
                );
                let at = corner + s * along + t * up;
                let uv = match metres {
                    None => DVec2::new(s, 1.0 - t),
                    Some(metres) => {
                        let place = |side: DVec3| at.dot(side.normalize()) / metres;
                        DVec2::new(place(along), -place(up))
                    }
                };
                self.push(at, towards, uv, look);
            }
        }
        let is_turned = along.cross(up).dot(towards) < 0.0;
        self.grid(first, across, down, is_turned);
        self.part(look, from);
    }

    /// A box, all around.
    pub(super) fn cuboid(&mut self, min: DVec3, max: DVec3, look: Look) {
        let size = max - min;
        for axis in 0..3 {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            // Upright things have upright pictures.
            let (u, v) = if u == 1 { (v, u) } else { (u, v) };
            let side = |k: usize| DVec3::AXES[k] * size[k];
            for (corner, sign) in [(min, -1.0), (min + side(axis), 1.0)] {
                let towards = DVec3::AXES[axis] * sign;
                self.rectangle(corner, [side(u), side(v)], towards, look);
            }
        }
    }

    /// A box whose edges are rounded: 1 is an ellipsoid, near 0 a box.
    pub(super) fn cushion(&mut self, middle: DVec3, half: DVec3, roundness: f64, look: Look) {
        let from = self.triangles.len();
        let around = self.around(half.max_element()).max(12);
        let down = (around / 2).max(6);
        let power = |x: f64| x.signum() * x.abs().powf(roundness);
        let steep = |x: f64| x.signum() * x.abs().powf(2.0 / roundness - 1.0);
        let first = self.positions.len() as u32;
        for row in 0..=down {
            let theta = PI * f64::from(row) / f64::from(down);
            let (sin, cos) = match row {
                0 => (0.0, 1.0),
                r if r == down => (0.0, -1.0),
                _ => theta.sin_cos(),
            };
            for column in 0..=around {
                let phi = TAU * f64::from(column % around) / f64::from(around);
                let unit = DVec3::new(
                    power(sin) * power(phi.cos()),
                    power(cos),
                    power(sin) * power(phi.sin()),
                );
                let normal = DVec3::new(steep(unit.x), steep(unit.y), steep(unit.z)) / half;
                let metres = look.picture.and_then(Picture::metres).unwrap_or(1.0);
                let uv = DVec2::new(
                    f64::from(column) / f64::from(around) * 4.0 * half.x.max(half.z),
                    theta / PI * 2.0 * half.x.max(half.z),
                );
                self.push(middle + unit * half, normal, uv / metres, look);
            }
        }
        self.grid(first, around, down, false);
        self.part(look, from);
    }

    /// What turning a profile of radius and height about the upright through `foot` makes; from
    /// below to above, the outside to the right.
    pub(super) fn lathe(&mut self, foot: DVec3, profile: &[(f64, f64)], look: Look) {
        let from = self.triangles.len();
        let widest = profile.iter().fold(0.0_f64, |w, p| w.max(p.0));
        let around = self.around(widest);
        for pair in profile.windows(2) {
            let [(r0, y0), (r1, y1)] = [pair[0], pair[1]];
            let length = (r1 - r0).hypot(y1 - y0);
            let down = self.segments(length);
            let first = self.positions.len() as u32;
            for row in 0..=down {
                let t = f64::from(row) / f64::from(down);
                let (r, y) = (r0 + t * (r1 - r0), y0 + t * (y1 - y0));
                for column in 0..=around {
                    let phi = TAU * f64::from(column % around) / f64::from(around);
                    let (sin, cos) = phi.sin_cos();
                    let out = DVec3::new(cos, 0.0, sin);
                    let normal = out * (y1 - y0) + DVec3::Y * (r0 - r1);
                    let uv = DVec2::new(f64::from(column) / f64::from(around), y);
                    self.push(foot + out * r + DVec3::Y * y, normal, uv, look);
                }
            }
            self.grid(first, around, down, true);
        }
        self.part(look, from);
    }

    /// The model, with colours for its corners.
    pub(super) fn model(self, colors: Vec<[u8; 4]>) -> Model {
        let mut pictures: Vec<Picture> = Vec::new();
        let mut materials = Vec::new();
        for look in &self.looks {
            let texture_idx = look.picture.map(|picture| {
                let known = pictures.iter().position(|p| *p == picture);
                known.unwrap_or_else(|| {
                    pictures.push(picture);
                    pictures.len() - 1
                }) as u32
            });
            let byte = |shift: u32| (look.tint >> shift & 0xff) as f32 / 255.0;
            materials.push(Material {
                base_color: [byte(16), byte(8), byte(0)],
                texture_idx,
                ..Material::default()
            });
        }
        let pictures = pictures.into_iter();
        Model {
            mesh: Mesh {
                positions: self.positions,
                triangles: self.triangles,
            },
            uvs: self.uvs,
            colors,
            parts: self.parts,
            nodes: self.nodes,
            materials,
            textures: pictures.map(|p| Texture::new(p.draw())).collect(),
        }
    }

    /// The triangles alone.
    pub(super) fn mesh(&self) -> Mesh {
        Mesh {
            positions: self.positions.clone(),
            triangles: self.triangles.clone(),
        }
    }
}
