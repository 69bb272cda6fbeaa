//! A scene, what a ray meets in it, and the colour it sees there.

use crate::shading::lamp_points;
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
    /// Whether it can stand between the lamp and others: no need to ask of a wall.
    pub casts_shadow: bool,
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
    pub(crate) objects: Vec<Object>,
    pub(crate) lighting: Lighting,
    pub(crate) finest: f64,
    /// For each object, what rays are tested against first.
    pub(crate) placed: Vec<Placed>,
    pub(crate) lamp_points: Vec<DVec3>,
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
pub(crate) struct Placed {
    shape_from_world: DMat3,
    origin: DVec3,
    ball_center: DVec3,
    ball_radius: f64,
}

/// A ray's origin is not on the surface it left: nearer hits are rounding errors.
const NEAREST: f64 = 1e-9;

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
        let direction = direction.normalize();
        let seen = self.look(origin, direction)?;
        Some(Hit {
            point: seen.point,
            normal: seen.normal,
            color: self.shade(&seen, direction, self.light(&seen)).to_array(),
            distance: seen.distance,
            object_idx: seen.object_idx,
        })
    }

    /// How far a ray goes before it meets something, in world units.
    pub fn distance(&self, origin: DVec3, direction: DVec3) -> Option<f64> {
        self.look(origin, direction.normalize())
            .map(|seen| seen.distance)
    }

    /// How far a point is from the nearest surface, in world units; zero inside a solid
    /// object (box, cylinder, prism).
    pub fn distance_to(&self, point: DVec3) -> f64 {
        (0..self.objects.len())
            .map(|i| self.distance_to_object(i, point))
            .fold(f64::INFINITY, f64::min)
    }

    /// Every object with its distance from a viewpoint, the nearest first.
    pub(crate) fn by_distance(&self, viewpoint: DVec3) -> Vec<(f64, usize)> {
        let mut order: Vec<(f64, usize)> = (0..self.objects.len())
            .map(|i| (self.distance_to_object(i, viewpoint), i))
            .collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0));
        order
    }

    /// What a ray from a viewpoint meets first (unit direction), where all objects but
    /// the `candidates` are known to be missed, and these come with their distances in
    /// order.
    pub(crate) fn look_in_order(
        &self,
        viewpoint: DVec3,
        direction: DVec3,
        candidates: &[(f64, usize)],
    ) -> Option<Seen> {
        let mut best: Option<(usize, Touch)> = None;
        for &(distance, i) in candidates {
            // All further objects lie behind what was found.
            if best.is_some_and(|(_, nearest)| nearest.t < distance) {
                break;
            }
            let touch = self.meet(i, viewpoint, direction);
            if let Some(touch) = touch
                && best.is_none_or(|(_, nearest)| touch.t < nearest.t)
            {
                best = Some((i, touch));
            }
        }
        let (object_idx, touch) = best?;
        Some(self.seen(object_idx, &touch, direction))
    }

    /// What a ray (unit direction) meets first.
    pub(crate) fn look(&self, origin: DVec3, direction: DVec3) -> Option<Seen> {
        let touches =
            (0..self.objects.len()).filter_map(|i| Some((i, self.meet(i, origin, direction)?)));
        let (object_idx, touch) = touches.min_by(|a, b| a.1.t.total_cmp(&b.1.t))?;
        Some(self.seen(object_idx, &touch, direction))
    }

    /// Where a ray (unit direction) meets one object.
    pub(crate) fn meet(&self, i: usize, origin: DVec3, direction: DVec3) -> Option<Touch> {
        let it = &self.placed[i];
        if !it.near_ray(origin, direction, 0.0, 0.0) {
            return None;
        }
        self.objects[i].shape.meet(
            it.shape_from_world * (origin - it.origin),
            it.shape_from_world * direction,
            NEAREST,
        )
    }

    /// How far a point outside it is from one object.
    pub(crate) fn distance_to_object(&self, i: usize, point: DVec3) -> f64 {
        let it = &self.placed[i];
        self.objects[i]
            .shape
            .distance(it.shape_from_world * (point - it.origin))
    }

    fn seen(&self, object_idx: usize, touch: &Touch, direction: DVec3) -> Seen {
        let it = &self.placed[object_idx];
        let world_from_shape = it.shape_from_world.transpose();
        let outwards = world_from_shape * touch.normal;
        let inside = outwards.dot(direction) > 0.0;
        Seen {
            object_idx,
            surface: self.objects[object_idx]
                .shape
                .surface(touch.point, touch.face),
            point: world_from_shape * touch.point + it.origin,
            normal: if inside { -outwards } else { outwards },
            inside,
            distance: touch.t,
        }
    }
}

/// A place that a ray has met, ready for shading.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Seen {
    pub(crate) object_idx: usize,
    pub(crate) surface: Surface,
    pub(crate) point: DVec3,
    /// Towards the viewer.
    pub(crate) normal: DVec3,
    /// Whether that is the side towards which the shape is hollow.
    pub(crate) inside: bool,
    pub(crate) distance: f64,
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
        }
    }

    /// Whether some ray may meet the ball, of those that start within `slack` of `origin`
    /// and stay within the cone around the unit vector `axis`.
    pub(crate) fn near_ray(&self, origin: DVec3, axis: DVec3, sin_angle: f64, slack: f64) -> bool {
        let to_center = self.ball_center - origin;
        let ahead = to_center.dot(axis);
        let distance_squared = to_center.length_squared();
        let reach = if sin_angle > 0.0 {
            self.ball_radius + slack + sin_angle * distance_squared.sqrt()
        } else {
            self.ball_radius + slack
        };
        ahead > -reach && distance_squared - ahead * ahead <= reach * reach
    }

    /// A lower bound of the distance from a point to the object.
    pub(crate) fn at_least(&self, point: DVec3) -> f64 {
        point.distance(self.ball_center) - self.ball_radius
    }
}
