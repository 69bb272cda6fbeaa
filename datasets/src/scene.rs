//! A scene, what a ray meets in it, and the colour it sees there.

use crate::shape::{Shape, Surface, Touch};
use crate::texture::Texture;
use calibrate::Rigid3;
use glam::{DMat3, DVec3};

/// A shape somewhere in the world, and what it is made of.
#[derive(Clone, Debug, PartialEq)]
pub struct Object {
    /// In its own frame.
    pub shape: Shape,
    /// Where that frame lies.
    pub world_from_shape: Rigid3,
    /// Its looks.
    pub material: Material,
}

/// How a surface looks.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// The diffuse colour from place to place.
    pub texture: Texture,
    /// How it answers light.
    pub finish: Finish,
}

/// How a surface answers light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Finish {
    /// Its texture is what one sees, whatever the light: the same from everywhere.
    Flat,
    /// Lit, and the same from everywhere.
    Matte,
    /// Matte with a highlight that moves with the viewer (Blinn–Phong), and a mirror
    /// image of the scene (Schlick's approximation of Fresnel's law).
    Glossy {
        /// Radiance of the highlight relative to the light's.
        highlight: f64,
        /// Blinn's exponent: larger is smaller and sharper.
        exponent: f64,
        /// The part of light mirrored at right angles to the surface, 0 to 1.
        mirror: f64,
    },
}

/// One round lamp and light from all around.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lighting {
    /// The lamp's centre.
    pub lamp: DVec3,
    /// The lamp's radius: the larger, the softer the shadows.
    pub lamp_radius: f64,
    /// Irradiance/π that the lamp gives a surface facing it at the world's origin; it
    /// falls with the square of the distance.
    pub lamp_color: DVec3,
    /// Light from above (`up`).
    pub sky: DVec3,
    /// Light from below.
    pub ground: DVec3,
    /// Which way is up.
    pub up: DVec3,
    /// Corners darken where something is nearer than this.
    pub corner_reach: f64,
}

/// Objects under a light. Colours are linear light; 1 is what a photo shows as white.
#[derive(Clone, Debug)]
pub struct Scene {
    objects: Vec<Object>,
    lighting: Lighting,
    finest: f64,
    /// For each object, what rays are tested against first.
    placed: Vec<Placed>,
    lamp_points: Vec<DVec3>,
}

/// What a ray meets first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// In the world.
    pub point: DVec3,
    /// Unit length, on the side the ray came from.
    pub normal: DVec3,
    /// The light that leaves it along the ray: linear, red, green and blue; highlights
    /// may exceed 1.
    pub color: [f64; 3],
    /// From the ray's origin, in world units.
    pub distance: f64,
    /// Index into [`Scene::objects`].
    pub object_idx: usize,
}

#[derive(Clone, Debug)]
struct Placed {
    shape_from_world: DMat3,
    origin: DVec3,
    ball_center: DVec3,
    ball_radius: f64,
    /// Too large to be worth testing its ball.
    unbounded: bool,
}

/// A ray's origin is not on the surface it left: nearer hits are rounding errors.
const NEAREST: f64 = 1e-9;
/// Shadow rays start this far above the surface (world units).
const LIFT: f64 = 1e-6;
/// Shadows are sampled at so many fixed points of the lamp: a pure function of the place,
/// so that two photos agree about it.
const LAMP_POINTS: usize = 20;
/// Where above a surface one looks for things that darken a corner, as parts of
/// `corner_reach`, and how much each counts.
const CORNER_TAPS: [(f64, f64); 4] = [(0.07, 0.35), (0.22, 0.28), (0.5, 0.22), (1.0, 0.15)];

impl Scene {
    /// A scene; `finest` is the shortest wavelength its textures may draw, in world
    /// units: a few pixels' worth, so that photos don't alias.
    pub fn new(objects: Vec<Object>, lighting: Lighting, finest: f64) -> Self {
        let placed = objects.iter().map(Placed::new).collect();
        Self {
            placed,
            lamp_points: lamp_points(&lighting),
            objects,
            lighting,
            finest,
        }
    }

    /// What is in it.
    pub fn objects(&self) -> &[Object] {
        &self.objects
    }

    /// Its light.
    pub fn lighting(&self) -> &Lighting {
        &self.lighting
    }

    /// What a ray meets first; `direction` need not have unit length.
    pub fn trace(&self, origin: DVec3, direction: DVec3) -> Option<Hit> {
        self.trace_among(origin, direction, &self.all())
    }

    /// How far a ray goes before it meets something, in world units.
    pub fn distance(&self, origin: DVec3, direction: DVec3) -> Option<f64> {
        let (_, touch) = self.nearest(origin, direction.normalize(), &self.all())?;
        Some(touch.t)
    }

    /// The objects that some ray from `origin` within the cone around the unit vector
    /// `axis` could meet.
    pub(crate) fn within_cone(
        &self,
        origin: DVec3,
        axis: DVec3,
        sin_angle: f64,
        found: &mut Vec<usize>,
    ) {
        found.clear();
        found.extend((0..self.placed.len()).filter(|&i| {
            let it = &self.placed[i];
            it.unbounded || it.near_ray(origin, axis, sin_angle)
        }));
    }

    /// [`Scene::trace`] where all objects but some are known to be missed.
    pub(crate) fn trace_among(
        &self,
        origin: DVec3,
        direction: DVec3,
        candidates: &[usize],
    ) -> Option<Hit> {
        let direction = direction.normalize();
        let (object_idx, touch) = self.nearest(origin, direction, candidates)?;
        let seen = self.seen(object_idx, &touch, direction);
        Some(Hit {
            point: seen.point,
            normal: seen.normal,
            color: self.shade(&seen, direction, true).to_array(),
            distance: touch.t,
            object_idx,
        })
    }

    fn all(&self) -> Vec<usize> {
        (0..self.objects.len()).collect()
    }

    fn nearest(
        &self,
        origin: DVec3,
        direction: DVec3,
        candidates: &[usize],
    ) -> Option<(usize, Touch)> {
        let mut best: Option<(usize, Touch)> = None;
        for &i in candidates {
            let it = &self.placed[i];
            if !it.unbounded && !it.near_ray(origin, direction, 0.0) {
                continue;
            }
            let touch = it.meet(&self.objects[i].shape, origin, direction);
            if let Some(touch) = touch
                && best.is_none_or(|(_, nearest)| touch.t < nearest.t)
            {
                best = Some((i, touch));
            }
        }
        best
    }

    fn seen(&self, object_idx: usize, touch: &Touch, direction: DVec3) -> Seen {
        let it = &self.placed[object_idx];
        let world_from_shape = it.shape_from_world.transpose();
        let normal = world_from_shape * touch.normal;
        Seen {
            object_idx,
            surface: self.objects[object_idx]
                .shape
                .surface(touch.point, touch.face),
            point: world_from_shape * touch.point + it.origin,
            normal: if normal.dot(direction) > 0.0 {
                -normal
            } else {
                normal
            },
        }
    }

    /// The light that leaves a surface against `direction` (unit length).
    fn shade(&self, seen: &Seen, direction: DVec3, mirrors: bool) -> DVec3 {
        let material = &self.objects[seen.object_idx].material;
        let albedo = material.texture.color(&seen.surface, self.finest);
        if material.finish == Finish::Flat {
            return albedo;
        }
        let light = &self.lighting;
        // 1. Light from all around, less in corners.
        let open = self.openness(seen);
        let upwards = 0.5 + 0.5 * seen.normal.dot(light.up);
        let around = light.ground.lerp(light.sky, upwards) * open;
        // 2. Light from the lamp, less in shadows.
        let to_lamp = light.lamp - seen.point;
        let towards_lamp = to_lamp.normalize();
        let cosine = seen.normal.dot(towards_lamp).max(0.0);
        let falloff = light.lamp.length_squared() / to_lamp.length_squared();
        let from_lamp = if cosine > 0.0 {
            light.lamp_color * (falloff * self.lamp_visibility(seen))
        } else {
            DVec3::ZERO
        };
        let diffuse = albedo * (around + from_lamp * cosine);
        let Finish::Glossy {
            highlight,
            exponent,
            mirror,
        } = material.finish
        else {
            return diffuse;
        };
        // 3. The highlight (Blinn 1977).
        let halfway = (towards_lamp - direction).normalize();
        let shine = highlight * seen.normal.dot(halfway).max(0.0).powf(exponent);
        let color = diffuse + from_lamp * (shine * cosine.sqrt());
        // 4. The mirror image (Schlick 1994).
        let facing = -seen.normal.dot(direction);
        if !mirrors || mirror <= 0.0 {
            return color;
        }
        let mirrored = mirror + (1.0 - mirror) * (1.0 - facing).clamp(0.0, 1.0).powi(5);
        let reflected = direction + 2.0 * facing * seen.normal;
        let lifted = seen.point + LIFT * seen.normal;
        let image = self
            .nearest(lifted, reflected, &self.all())
            .map_or(DVec3::ZERO, |(i, touch)| {
                self.shade(&self.seen(i, &touch, reflected), reflected, false)
            });
        color * (1.0 - mirrored) + image * mirrored * (0.4 + 0.6 * open)
    }

    /// The part of the lamp that a place sees, 0 to 1.
    fn lamp_visibility(&self, seen: &Seen) -> f64 {
        let lifted = seen.point + LIFT * seen.normal;
        let to_lamp = self.lighting.lamp - lifted;
        let distance = to_lamp.length();
        let axis = to_lamp / distance;
        let sin_angle = self.lighting.lamp_radius / distance;
        // 1. What stands near the way to the lamp? Mostly nothing.
        let mut casters = [0_usize; 16];
        let mut count = 0;
        for (i, it) in self.placed.iter().enumerate() {
            let itself = i == seen.object_idx && self.objects[i].shape.is_convex();
            if it.unbounded || itself || count == casters.len() {
                continue;
            }
            if it.near_ray(lifted, axis, sin_angle) {
                casters[count] = i;
                count += 1;
            }
        }
        if count == 0 {
            return 1.0;
        }
        // 2. Count the points of the lamp that it hides.
        let lit = self.lamp_points.iter().filter(|&&point| {
            let direction = (point - lifted).normalize();
            !casters[..count].iter().any(|&i| {
                let it = &self.placed[i];
                it.near_ray(lifted, direction, 0.0)
                    && it
                        .meet(&self.objects[i].shape, lifted, direction)
                        .is_some_and(|touch| touch.t < distance)
            })
        });
        lit.count() as f64 / self.lamp_points.len() as f64
    }

    /// How open to its surroundings a place is, 0 to 1: the nearer other surfaces are to
    /// points straight above it, the darker (Evans 2006, with distances in place of a
    /// distance field).
    fn openness(&self, seen: &Seen) -> f64 {
        let reach = self.lighting.corner_reach;
        let mut nearest = CORNER_TAPS.map(|(part, _)| part * reach);
        for (i, it) in self.placed.iter().enumerate() {
            let shape = &self.objects[i].shape;
            let too_far = it.ball_radius + 2.0 * reach;
            let away = seen.point.distance_squared(it.ball_center) > too_far * too_far;
            if away || (i == seen.object_idx && shape.is_convex()) {
                continue;
            }
            for (tap, (part, _)) in CORNER_TAPS.iter().enumerate() {
                let above = seen.point + part * reach * seen.normal;
                let distance = shape.distance(it.shape_from_world * (above - it.origin));
                nearest[tap] = nearest[tap].min(distance);
            }
        }
        let closed: f64 = CORNER_TAPS
            .iter()
            .zip(nearest)
            .map(|((part, weight), distance)| weight * (1.0 - distance / (part * reach)))
            .sum();
        1.0 - 0.9 * closed
    }
}

/// A place that a ray has met, ready for shading.
struct Seen {
    object_idx: usize,
    surface: Surface,
    point: DVec3,
    normal: DVec3,
}

impl Placed {
    fn new(object: &Object) -> Self {
        let world_from_shape = object.world_from_shape.matrix();
        let origin = object.world_from_shape.translation;
        let (center, radius) = object.shape.ball();
        Self {
            shape_from_world: world_from_shape.transpose(),
            origin,
            ball_center: world_from_shape * center + origin,
            // Rounding must not cut off a silhouette.
            ball_radius: radius * (1.0 + 1e-9),
            unbounded: radius > 1.5,
        }
    }

    /// Whether some ray within the cone around (`origin`, unit `axis`) may meet the ball.
    fn near_ray(&self, origin: DVec3, axis: DVec3, sin_angle: f64) -> bool {
        let to_center = self.ball_center - origin;
        let ahead = to_center.dot(axis);
        let distance_squared = to_center.length_squared();
        let reach = if sin_angle > 0.0 {
            self.ball_radius + sin_angle * distance_squared.sqrt()
        } else {
            self.ball_radius
        };
        ahead > -reach && distance_squared - ahead * ahead <= reach * reach
    }

    fn meet(&self, shape: &Shape, origin: DVec3, direction: DVec3) -> Option<Touch> {
        shape.meet(
            self.shape_from_world * (origin - self.origin),
            self.shape_from_world * direction,
            NEAREST,
        )
    }
}

/// Points spread evenly over the lamp's disc as the origin sees it: a sunflower's spiral.
fn lamp_points(lighting: &Lighting) -> Vec<DVec3> {
    let (x, y) = lighting.lamp.normalize_or(DVec3::Y).any_orthonormal_pair();
    let golden_angle = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    (0..LAMP_POINTS)
        .map(|i| {
            let part = (i as f64 + 0.5) / LAMP_POINTS as f64;
            let (sin, cos) = (golden_angle * i as f64).sin_cos();
            let radius = lighting.lamp_radius * part.sqrt();
            lighting.lamp + radius * (cos * x + sin * y)
        })
        .collect()
}
