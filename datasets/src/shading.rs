//! The colour of a place: light from all around, from a lamp, highlights and mirror images.

use crate::scene::Seen;
use crate::{Finish, Lighting, Scene};
use glam::DVec3;

/// Shadow rays start this far above the surface (world units).
const LIFT: f64 = 1e-6;
/// Shadows are sampled at so many fixed points of the lamp: a pure function of the place,
/// so that two photos agree about it.
const LAMP_POINTS: usize = 16;
/// Where above a surface one looks for things that darken a corner, as parts of
/// `corner_reach`, and how much each counts.
const CORNER_TAPS: [(f64, f64); 3] = [(0.1, 0.4), (0.35, 0.35), (1.0, 0.25)];

/// The objects that can change the light at some point; all others are too far away. Leaving those out changes nothing but the time it takes.
#[derive(Clone, Debug, Default)]
struct Surroundings {
    /// May stand before the lamp.
    casters: Vec<usize>,
    /// Near enough to darken a corner.
    neighbours: Vec<usize>,
}

/// How much light reaches a place.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Light {
    /// How open it is to its surroundings, 0 to 1.
    open: f64,
    /// The part of the lamp it sees, 0 to 1.
    lamp: f64,
}

impl Scene {
    /// The light at a place.
    pub(crate) fn light(&self, seen: &Seen) -> Light {
        if self.objects[seen.object_idx].material.finish == Finish::Flat {
            return Light {
                open: 1.0,
                lamp: 1.0,
            };
        }
        let near = self.surroundings(seen.point);
        let faces_lamp = seen.normal.dot(self.lighting.lamp - seen.point) > 0.0;
        Light {
            open: self.openness(seen, &near),
            lamp: if faces_lamp {
                self.lamp_visibility(seen, &near)
            } else {
                0.0
            },
        }
    }

    /// What can change the light at a point.
    fn surroundings(&self, point: DVec3) -> Surroundings {
        let slack = 2.0 * LIFT;
        let to_lamp = self.lighting.lamp - point;
        let distance = to_lamp.length();
        let sin_angle = self.lighting.lamp_radius / distance;
        let reach = 2.0 * self.lighting.corner_reach + slack;
        let mut found = Surroundings::default();
        for (i, it) in self.placed.iter().enumerate() {
            if self.objects[i].casts_shadow
                && it.near_ray(point, to_lamp / distance, sin_angle, slack)
            {
                found.casters.push(i);
            }
            if it.at_least(point) < reach {
                found.neighbours.push(i);
            }
        }
        found
    }

    /// The light that leaves a surface against `direction` (unit length).
    pub(crate) fn shade(&self, seen: &Seen, direction: DVec3, light: Light) -> DVec3 {
        let color = self.lit(seen, direction, light);
        let Finish::Glossy { mirror, .. } = self.objects[seen.object_idx].material.finish else {
            return color;
        };
        if mirror <= 0.0 {
            return color;
        }
        // The mirror image, of one reflection (Schlick 1994).
        let facing = -seen.normal.dot(direction);
        let mirrored = mirror + (1.0 - mirror) * (1.0 - facing).clamp(0.0, 1.0).powi(5);
        let reflected = direction + 2.0 * facing * seen.normal;
        let lifted = seen.point + LIFT * seen.normal;
        let image = match self.look(lifted, reflected) {
            Some(there) => self.lit(&there, reflected, self.light(&there)),
            None => DVec3::ZERO,
        };
        // What is hidden from the light is hidden from the reflected room, too.
        color * (1.0 - mirrored) + image * mirrored * (0.4 + 0.6 * light.open)
    }

    /// The light that leaves a surface, mirror images left out.
    fn lit(&self, seen: &Seen, direction: DVec3, light: Light) -> DVec3 {
        let material = &self.objects[seen.object_idx].material;
        let albedo = material.texture.color(&seen.surface, self.finest);
        if material.finish == Finish::Flat {
            return albedo;
        }
        let lighting = &self.lighting;
        // 1. Light from all around, less in corners.
        let upwards = 0.5 + 0.5 * seen.normal.dot(lighting.up);
        let around = lighting.ground.lerp(lighting.sky, upwards) * light.open;
        // 2. Light from the lamp, less in shadows.
        let to_lamp = lighting.lamp - seen.point;
        let towards_lamp = to_lamp.normalize();
        let cosine = seen.normal.dot(towards_lamp).max(0.0);
        let falloff = lighting.lamp.length_squared() / to_lamp.length_squared();
        let from_lamp = lighting.lamp_color * (falloff * light.lamp);
        let diffuse = albedo * (around + from_lamp * cosine);
        let Finish::Glossy {
            highlight,
            exponent,
            ..
        } = material.finish
        else {
            return diffuse;
        };
        // 3. The highlight (Blinn 1977); the root lets it fade towards the shadow line.
        if light.lamp == 0.0 {
            return diffuse;
        }
        let halfway = (towards_lamp - direction).normalize();
        let shine = highlight * seen.normal.dot(halfway).max(0.0).powf(exponent);
        diffuse + from_lamp * (shine * cosine.sqrt())
    }

    /// The part of the lamp that a place sees, 0 to 1.
    fn lamp_visibility(&self, seen: &Seen, near: &Surroundings) -> f64 {
        // An object throws no shadow on its own outside (true of convex ones, nearly
        // true of vases).
        let itself = |i: usize| i == seen.object_idx && !seen.inside;
        if near.casters.iter().all(|&i| itself(i)) {
            return 1.0;
        }
        let lifted = seen.point + LIFT * seen.normal;
        // Mostly the object that hid one point of the lamp hides the next.
        let mut culprit = None;
        let hidden = self.lamp_points.iter().filter(|&&point| {
            let to_point = point - lifted;
            let distance = to_point.length();
            let direction = to_point / distance;
            let hides = |i: usize| {
                !itself(i)
                    && self
                        .meet(i, lifted, direction)
                        .is_some_and(|touch| touch.t < distance)
            };
            if culprit.is_some_and(hides) {
                return true;
            }
            culprit = near.casters.iter().copied().find(|&i| hides(i));
            culprit.is_some()
        });
        1.0 - hidden.count() as f64 / self.lamp_points.len() as f64
    }

    /// How open to its surroundings a place is, 0 to 1: the nearer other surfaces are to
    /// points straight above it, the darker (Evans 2006, with distances to each object in
    /// place of a distance field).
    fn openness(&self, seen: &Seen, near: &Surroundings) -> f64 {
        let reach = self.lighting.corner_reach;
        let mut nearest = CORNER_TAPS.map(|(part, _)| part * reach);
        for &i in &near.neighbours {
            if i == seen.object_idx && !seen.inside {
                continue;
            }
            for (nearest, (part, _)) in nearest.iter_mut().zip(CORNER_TAPS) {
                let above = seen.point + part * reach * seen.normal;
                if self.placed[i].at_least(above) < *nearest {
                    *nearest = nearest.min(self.distance_to_object(i, above));
                }
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

/// Points spread evenly over the lamp's disc as the origin sees it: a sunflower's spiral.
pub(crate) fn lamp_points(lighting: &Lighting) -> Vec<DVec3> {
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
