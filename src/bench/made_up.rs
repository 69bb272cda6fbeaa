//! Photo sets of any size, made up: cameras spread like those of photos held by hand, before a
//! surface that is painted by place.

use calibrate::{Lens, Pixel, Rigid3, View};
use glam::{DVec2, DVec3, Vec3Swizzles};
use image::RgbaImage;
use proxy::{Mesh, MeshKind, Plane, Proxy, Solid};
use render::{Lumigraph, PhotoStore, SourceView, Visibility};
use std::sync::Arc;

/// What the photos show.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Surroundings {
    /// A plane, four units ahead.
    Plane,
    /// A box along z, two units wide, walked through.
    Tunnel,
    /// A ball of one unit's radius, looked at from all around, of so many faces: 2·n·(n − 1).
    Ball {
        /// Sectors, and rings.
        sides: u32,
    },
    /// A ball of 480 faces, looked at from one place by all.
    Crowd,
}

impl Surroundings {
    /// A ball of 480 faces.
    pub const BALL: Self = Self::Ball { sides: 16 };

    /// In a word.
    pub fn name(self) -> &'static str {
        match self {
            Self::Plane => "plane",
            Self::Tunnel => "tunnel",
            Self::Ball { .. } => "hull",
            Self::Crowd => "crowd",
        }
    }

    fn proxy(self) -> Proxy {
        match self {
            Self::Ball { sides } => {
                let ball = ball(DVec3::ZERO, 1.0, sides.max(3), sides.max(3));
                Proxy::Mesh(Arc::new(Solid::new(MeshKind::Hull, ball)))
            }
            Self::Crowd => Self::BALL.proxy(),
            Self::Tunnel => Proxy::Mesh(Arc::new(Solid::new(MeshKind::Tunnel, hallway()))),
            Self::Plane => {
                let plane = Plane::new(DVec3::Z * 4.0, DVec3::NEG_Z);
                Proxy::Plane(plane.expect("a finite plane"))
            }
        }
    }
}

/// Evenly in −1…1: the fractional parts of multiples of an irrational number.
fn spread(i: usize, step: f64) -> f64 {
    2.0 * ((i + 1) as f64 * step).fract() - 1.0
}

/// Places around the origin, spread like photos held by hand: more across than ahead.
fn place(i: usize) -> DVec3 {
    let [x, y, z] = [0.819_172_513_4, 0.671_043_606_7, 0.549_700_477_9].map(|s| spread(i, s));
    DVec3::new(x, 0.6 * y, 0.3 * z)
}

/// So many photos of `photo_size` pixels, made when they are first asked for. Photos of a ball look
/// at it from all around, all others along z.
pub fn lumigraph(kind: Surroundings, count: usize, photo_size: (u32, u32)) -> Lumigraph {
    let pose = |i: usize| {
        let v = place(i);
        let target = 0.3 * DVec3::new(spread(i, 0.381_966), spread(i, 0.267_949), 0.0);
        match kind {
            Surroundings::Ball { .. } => {
                // As many from every side.
                let (cos, around) = (v.x, std::f64::consts::TAU * spread(i, 0.754_877_666_2));
                let aside = (1.0 - cos * cos).sqrt();
                let direction = DVec3::new(aside * around.cos(), aside * around.sin(), cos);
                let center = direction * (3.0 + 0.5 * v.z);
                Rigid3::looking_at(center, 0.3 * target, DVec3::Y)
            }
            Surroundings::Crowd => {
                Rigid3::looking_at(DVec3::new(0.9, -0.2, -3.0), 0.3 * target, DVec3::Y)
            }
            Surroundings::Tunnel => {
                let center = DVec3::new(0.3 * v.x, 0.3 * v.y, 10.0 * v.z);
                Rigid3::looking_at(center, center + DVec3::Z + target, DVec3::Y)
            }
            Surroundings::Plane => Rigid3::looking_at(v, v + DVec3::Z + 0.5 * target, DVec3::Y),
        }
    };
    let (width, height) = photo_size;
    let size = DVec2::new(f64::from(width), f64::from(height));
    let lens = Lens::pinhole(DVec2::splat(0.8 * size.x), 0.5 * size);
    let source = |i: usize| SourceView {
        name: format!("{i}"),
        view: View {
            lens,
            width,
            height,
            camera_from_world: pose(i),
        },
        gain: [1.0; 3],
        time_s: None,
        quarters: 0,
    };
    let sources: Vec<SourceView> = (0..count).map(source).collect();
    let proxy = kind.proxy();
    Lumigraph {
        points: Vec::new(),
        visibility: Visibility::of(&proxy, &sources),
        photos: {
            let views: Vec<View> = sources.iter().map(|s| s.view.clone()).collect();
            let proxy = proxy.clone();
            PhotoStore::new(count, move |i| Ok(photo(&views[i], &proxy)))
        },
        sources,
        proxy,
    }
}

/// What a view sees of the proxy, painted by place: photos agree but for their resolution.
fn photo(view: &View, proxy: &Proxy) -> RgbaImage {
    let center = view.center();
    let world_from_camera = view.camera_from_world.rotation.conjugate();
    RgbaImage::from_fn(view.width, view.height, |x, y| {
        let ray = view
            .lens
            .unproject(Pixel::center_of(x, y))
            .expect("a pinhole");
        let ray = world_from_camera * ray;
        let along = match proxy {
            Proxy::Mesh(solid) => solid.first_hit(center, ray).map(|hit| hit.along),
            _ => Some((4.0 - center.z) / ray.z),
        };
        let Some(along) = along else {
            return image::Rgba([20, 20, 20, 255]);
        };
        let p = center + ray * along;
        let wave = |turned: DVec3| 127.0 + 70.0 * (9.0 * turned.x).sin() * (7.0 * turned.y).cos();
        let fine = 30.0 * (61.0 * p.x).sin() * (53.0 * (p.y + p.z)).sin();
        let [r, g, b] = [p, p.yzx(), p.zxy()].map(|turned| (wave(turned) + fine) as u8);
        image::Rgba([r, g, b, 255])
    })
}

/// A ball of 2·around·(down − 1) faces.
pub(super) fn ball(center: DVec3, radius: f64, around: u32, down: u32) -> Mesh {
    let mut mesh = Mesh::default();
    for row in 0..=down {
        for column in 0..around {
            let theta = std::f64::consts::PI * f64::from(row) / f64::from(down);
            let phi = std::f64::consts::TAU * f64::from(column) / f64::from(around);
            let (sin, cos) = theta.sin_cos();
            let out = DVec3::new(sin * phi.cos(), cos, sin * phi.sin());
            mesh.positions.push(center + radius * out);
        }
    }
    for row in 0..down {
        for column in 0..around {
            let at = |r: u32, c: u32| r * around + c % around;
            let (a, b) = (at(row, column), at(row, column + 1));
            let (c, d) = (at(row + 1, column), at(row + 1, column + 1));
            if row > 0 {
                mesh.triangles.push([a, b, c]);
            }
            if row + 1 < down {
                mesh.triangles.push([b, d, c]);
            }
        }
    }
    mesh
}

/// A box along z.
fn hallway() -> Mesh {
    let corner = |i: u32| {
        let side = |bit: u32, reach: f64| if i & bit == 0 { -reach } else { reach };
        DVec3::new(side(1, 1.0), side(2, 1.0), side(4, 12.0))
    };
    Mesh {
        positions: (0..8).map(corner).collect(),
        triangles: [
            [0, 1, 3, 2],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 3, 7, 6],
            [0, 2, 6, 4],
            [1, 3, 7, 5],
        ]
        .iter()
        .flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]])
        .collect(),
    }
}

/// A view of so many pixels from among the photos, with their field of view along the longer
/// side.
pub fn desired(kind: Surroundings, (width, height): (u32, u32)) -> View {
    let size = DVec2::new(f64::from(width), f64::from(height));
    let pose = match kind {
        Surroundings::Ball { .. } | Surroundings::Crowd => {
            Rigid3::looking_at(DVec3::new(0.4, 0.3, -3.1), DVec3::ZERO, DVec3::Y)
        }
        Surroundings::Plane | Surroundings::Tunnel => {
            let center = DVec3::new(0.03, -0.02, -0.05);
            Rigid3::looking_at(center, center + DVec3::Z, DVec3::Y)
        }
    };
    View {
        lens: Lens::pinhole(DVec2::splat(0.8 * size.x), 0.5 * size),
        width,
        height,
        camera_from_world: pose,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use render::{FieldOptions, Frame, Method, cpu};

    #[test]
    fn every_photo_set_covers_its_view() {
        let all = [
            Surroundings::Plane,
            Surroundings::Tunnel,
            Surroundings::BALL,
        ];
        for kind in all {
            let set = lumigraph(kind, 12, (48, 36));
            assert_eq!(set.sources.len(), 12);
            let view = desired(kind, (48, 36));
            let frame = Frame::new(&set, view, FieldOptions::default());
            let picture = cpu::render(&frame, Method::TRIANGULATED).unwrap();
            let covered = picture.pixels().filter(|p| p.0[3] > 127).count();
            let share = covered as f64 / (48.0 * 36.0);
            // The ball leaves the corners empty.
            let least = if kind == Surroundings::BALL { 0.2 } else { 0.9 };
            assert!(share > least, "{}: {share}", kind.name());
        }
    }
}
