use crate::Scene;
use calibrate::Rigid3;
use glam::{DQuat, DVec3};
use std::f64::consts::TAU;

/// What moves in a scene: some of its objects turn evenly about an axis, all as one.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// Indices into [`Scene::objects`], which has them at time 0.
    pub object_idxs: Vec<usize>,
    /// A point of the axis, in the world.
    pub center: DVec3,
    /// Along the axis (unit length); they turn counter-clockwise as seen from its tip.
    pub axis: DVec3,
    /// Seconds a turn.
    pub period_s: f64,
}

impl Motion {
    /// The scene at a moment, from the scene at time 0.
    pub fn scene_at(&self, scene: &Scene, time_s: f64) -> Scene {
        let angle = TAU * (time_s / self.period_s).rem_euclid(1.0);
        let rotation = DQuat::from_axis_angle(self.axis, angle);
        let turn = Rigid3::new(rotation, self.center - rotation * self.center);
        let mut objects = scene.objects.clone();
        for &object_idx in &self.object_idxs {
            let object = &mut objects[object_idx];
            object.world_from_shape = turn * object.world_from_shape;
        }
        Scene::new(objects, scene.lighting, scene.finest)
    }

    /// Whether an object takes part.
    pub fn moves(&self, object_idx: usize) -> bool {
        self.object_idxs.contains(&object_idx)
    }
}
