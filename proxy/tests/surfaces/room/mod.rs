//! A room with boxes in it, known exactly: cameras, points that they see, and rays.

use calibrate::{Lens, Rigid3, View};
use glam::{DVec2, DVec3};
use proxy::SparsePoint;

/// Axis-aligned: the room's own box is seen from within, the others from without.
pub(crate) struct Room {
    pub boxes: Vec<[DVec3; 2]>,
    pub views: Vec<View>,
}

/// Numbers from 0 to 1 that look random and are always the same.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn unit(&mut self) -> f64 {
        let next = self.0.wrapping_mul(6_364_136_223_846_793_005);
        self.0 = next.wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn within(&mut self, [low, high]: [DVec3; 2]) -> DVec3 {
        low + (high - low) * DVec3::new(self.unit(), self.unit(), self.unit())
    }
}

impl Room {
    /// 10 × 8 × 3 metres (z up), a table, a pillar and a cupboard, and photos all around.
    pub(crate) fn new(photos: usize) -> Self {
        let v = DVec3::new;
        let boxes = vec![
            [v(0.0, 0.0, 0.0), v(10.0, 8.0, 3.0)],
            [v(4.0, 3.0, 0.0), v(6.0, 5.0, 0.9)],
            [v(2.0, 6.0, 0.0), v(2.5, 6.5, 3.0)],
            [v(8.0, 0.0, 0.0), v(10.0, 1.0, 2.0)],
        ];
        let view = |i: usize| {
            let turn = std::f64::consts::TAU * i as f64 / photos as f64;
            let outwards = DVec3::new(turn.cos(), turn.sin(), 0.0);
            let center = v(5.0, 4.0, 1.6) + outwards * v(2.3, 2.3, 0.0);
            // Every other photo looks across the table.
            let target = if i.is_multiple_of(2) {
                center + outwards - 0.1 * DVec3::Z
            } else {
                v(5.0, 4.0, 0.9)
            };
            View {
                lens: Lens::pinhole(DVec2::splat(200.0), DVec2::new(200.0, 150.0)),
                width: 400,
                height: 300,
                camera_from_world: Rigid3::looking_at(center, target, DVec3::Z),
            }
        };
        Self {
            views: (0..photos).map(view).collect(),
            boxes,
        }
    }

    /// How far a ray goes, as a multiple of its vector.
    pub(crate) fn distance(&self, origin: DVec3, ray: DVec3) -> f64 {
        let span = |[low, high]: [DVec3; 2]| {
            let (a, b) = ((low - origin) / ray, (high - origin) / ray);
            (a.min(b).max_element(), a.max(b).min_element())
        };
        let walls = span(self.boxes[0]).1;
        let hits = self.boxes[1..].iter().filter_map(|b| {
            let (enter, leave) = span(*b);
            (enter > 0.0 && enter <= leave).then_some(enter)
        });
        hits.fold(walls, f64::min)
    }

    /// The distance of a place from the nearest surface.
    pub(crate) fn off_surface(&self, place: DVec3) -> f64 {
        let to_box = |[low, high]: &[DVec3; 2]| {
            let outside = (*low - place).max(place - *high).max(DVec3::ZERO).length();
            let inside = (place - *low).min(*high - place).min_element();
            if outside > 0.0 { outside } else { inside }
        };
        self.boxes.iter().map(to_box).fold(f64::INFINITY, f64::min)
    }

    /// Points on what the photos show, each seen by all photos that it is in sight of and off
    /// by up to `noise` in each coordinate.
    pub(crate) fn points(&self, count: usize, noise: f64, random: &mut Random) -> Vec<SparsePoint> {
        let mut points = Vec::with_capacity(count);
        for turn in 0.. {
            if points.len() == count {
                break;
            }
            let view = &self.views[turn % self.views.len()];
            let corner = DVec3::new(1.0, 0.75, 0.0);
            let ray = random.within([-corner, corner]) + DVec3::Z;
            let ray = view.camera_from_world.rotation.conjugate() * ray;
            let place = view.center() + ray * self.distance(view.center(), ray);
            let sees = |view: &View| {
                let in_image = view.project(place).is_some_and(|p| view.contains(p));
                in_image && self.distance(view.center(), place - view.center()) > 1.0 - 1e-9
            };
            let seen_by = (0..self.views.len()).filter(|i| sees(&self.views[*i]));
            let seen_by: Vec<u32> = seen_by.map(|i| i as u32).collect();
            if seen_by.len() < 2 {
                continue;
            }
            points.push(SparsePoint {
                position: place + random.within([DVec3::splat(-noise), DVec3::splat(noise)]),
                seen_by,
            });
        }
        points
    }
}
