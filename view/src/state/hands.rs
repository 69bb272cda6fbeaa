//! What hands do: keys that are held, dragging, clicking, the wheel.

use super::{Button, Mode, Motion, State};
use crate::camera::{level_axes, moved, orbited, turned, zoomed};
use crate::picture::on_ray;
use calibrate::{Pixel, View};
use glam::DVec3;

/// Radians a pixel of dragging turns.
const TURN_PER_PIXEL: f64 = 0.005;
/// Radians a second that an arrow key turns.
const TURN_PER_SECOND: f64 = 1.2;
/// The share of the way to what is under the cursor that a notch of the wheel goes.
const ZOOM_PER_NOTCH: f64 = 0.12;
/// How much faster with Shift.
const FAST: f64 = 4.0;
/// What is under the cursor counts as so far away at most, in typical depths, or in distances from
/// where photos were taken.
const FAR: f64 = 2.5;

/// A button that is held.
pub(super) struct Drag {
    button: Button,
    at: Pixel,
    start: Pixel,
    /// What was under the cursor.
    pivot_in_world: DVec3,
    /// Its depth.
    depth: f64,
    /// Whether Shift was held.
    is_pan: bool,
}

impl State {
    /// A key was pressed or released.
    pub fn hold(&mut self, motion: Motion, is_down: bool) {
        if is_down {
            self.held.insert(motion);
        } else {
            self.held.remove(&motion);
        }
    }

    /// All keys and buttons are released, as when another window comes to the front.
    pub fn let_go(&mut self) {
        self.held.clear();
        self.drag = None;
    }

    /// The pointer is over a pixel, or left.
    pub fn point(&mut self, at: Option<Pixel>) {
        self.pointer = at;
        let Some(at) = at else {
            return;
        };
        let Some(mut drag) = self.drag.take() else {
            return;
        };
        let (dx, dy) = (at.x - drag.at.x, at.y - drag.at.y);
        drag.at = at;
        if let (Some(view), Some(space)) = (self.view(), &self.space) {
            let up = space.up;
            let (yaw, pitch) = (TURN_PER_PIXEL * dx, TURN_PER_PIXEL * dy);
            let scale = drag.depth / view.lens.mean_focal();
            let pose = match (drag.is_pan, self.mode) {
                (true, Mode::Orbit | Mode::Fly) => {
                    moved(&self.pose, DVec3::new(-dx * scale, -dy * scale, 0.0))
                }
                // Nobody walks upwards.
                (true, Mode::Walk) => {
                    let (_, right) = level_axes(&self.pose, up);
                    self.walked(-dx * scale * right)
                }
                // What is under the cursor comes along.
                (false, Mode::Orbit) => orbited(&self.pose, drag.pivot_in_world, up, -yaw, pitch),
                (false, Mode::Fly | Mode::Walk) => turned(&self.pose, up, -yaw, -pitch),
            };
            self.be_at(pose);
        }
        self.drag = Some(drag);
    }

    /// A button was pressed over a pixel.
    pub fn press(&mut self, button: Button, at: Pixel, is_shift: bool) {
        self.glide = None;
        let depth = self.space.as_ref().map_or(1.0, |s| s.depth);
        let (pivot_in_world, depth) = match self.view() {
            Some(view) => {
                let point = self.under(&view, at, depth);
                (point, (view.camera_from_world * point).z.max(1e-9 * depth))
            }
            None => (DVec3::ZERO, depth),
        };
        self.drag = Some(Drag {
            button,
            at,
            start: at,
            pivot_in_world,
            depth,
            is_pan: is_shift || button == Button::Other,
        });
    }

    /// A button was released; where it was pressed, if the pointer did not move in between.
    pub fn release(&mut self, button: Button) -> Option<Pixel> {
        let drag = self.drag.take_if(|drag| drag.button == button)?;
        (drag.at.distance(drag.start) < 3.0).then_some(drag.start)
    }

    /// The wheel was turned, towards what is under the cursor or away from it.
    pub fn wheel(&mut self, notches: f64, at: Pixel) {
        let (Some(view), Some(space)) = (self.view(), &self.space) else {
            return;
        };
        let depth = space.depth;
        let pose = if self.mode == Mode::Walk {
            self.walked(self.pose.rotation.conjugate() * DVec3::Z * 0.25 * notches * space.speed)
        } else {
            let point = self.under(&view, at, depth);
            let share = 1.0 - (1.0 - ZOOM_PER_NOTCH).powf(notches.clamp(-20.0, 20.0));
            zoomed(&self.pose, point, share)
        };
        self.be_at(pose);
    }

    /// The point of the world at a pixel, by the last picture's depths.
    pub(super) fn under(&self, view: &View, at: Pixel, otherwise: f64) -> DVec3 {
        let Some((of, depths)) = &self.depths else {
            return on_ray(view, at, otherwise);
        };
        let mut point = on_ray(view, at, otherwise);
        // That picture may be of a while ago: what lies where the point would be in it tells a
        // better depth.
        for _ in 0..8 {
            let Some(pixel) = of.project(point) else {
                break;
            };
            let seen = depths.point(of, pixel, otherwise);
            let depth = (view.camera_from_world * seen).z;
            if !(depth > 1e-6 * otherwise) {
                break;
            }
            point = on_ray(view, at, depth);
        }
        // About a far dome one would be flung around.
        let depth = (view.camera_from_world * point).z;
        on_ray(view, at, depth.min(FAR * self.reach(view).max(otherwise)))
    }

    /// How far away the middle of all stops is.
    fn reach(&self, view: &View) -> f64 {
        let stops = self.space.as_ref().map_or(&[][..], |s| &s.stops);
        let sum: DVec3 = stops.iter().map(|s| s.view.center()).sum();
        let reach = (sum / stops.len().max(1) as f64).distance(view.center());
        if reach.is_finite() { reach } else { 0.0 }
    }

    /// Lets some time pass with the keys that are held.
    pub(super) fn move_by_keys(&mut self, seconds: f64) {
        let Some(space) = &self.space else {
            return;
        };
        let axis = |more: Motion, less: Motion| {
            let held = |m| f64::from(u8::from(self.held.contains(&m)));
            held(more) - held(less)
        };
        let speed = if self.held.contains(&Motion::Fast) {
            FAST
        } else {
            1.0
        };
        let way = DVec3::new(
            axis(Motion::Right, Motion::Left),
            axis(Motion::Down, Motion::Up),
            axis(Motion::Forward, Motion::Back),
        );
        let yaw = axis(Motion::TurnRight, Motion::TurnLeft);
        let pitch = axis(Motion::TurnDown, Motion::TurnUp);
        if way == DVec3::ZERO && yaw == 0.0 && pitch == 0.0 {
            return;
        }
        let up = space.up;
        let length = speed * space.speed * seconds;
        let angle = TURN_PER_SECOND * seconds;
        let mut pose = turned(&self.pose, up, yaw * angle, pitch * angle);
        if way != DVec3::ZERO {
            let way = way.normalize() * length;
            pose = match self.mode {
                Mode::Orbit | Mode::Fly => moved(&pose, way),
                Mode::Walk => {
                    let (forward, right) = level_axes(&pose, up);
                    // Who turns moves, though walls let one go nowhere.
                    if yaw != 0.0 || pitch != 0.0 {
                        self.be_at(pose);
                    }
                    self.walked(forward * way.z + right * way.x)
                }
            };
        }
        self.glide = None;
        self.playing = None;
        self.be_at(pose);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::content::Space;
    use crate::content::tests::two_rooms;
    use crate::picture::Look;
    use std::sync::Arc;

    #[test]
    fn who_turns_before_a_wall_moves() {
        let content = two_rooms();
        let space = Arc::new(Space::of(&content));
        let mut state = State::new(Look::default());
        state.resize(320, 240);
        let _ = state.show(content, space);
        assert_eq!(state.mode, Mode::Walk);
        // Into a corner, and against the ceiling: nobody walks upwards.
        state.hold(Motion::Forward, true);
        for _ in 0..500 {
            state.step(0.02);
        }
        for way in [Motion::Forward, Motion::Up] {
            state.let_go();
            state.hold(way, true);
            state.hold(Motion::TurnLeft, true);
            for _ in 0..100 {
                // As if one had stood at a stop.
                (state.stop, state.still_s) = (Some(0), 1.0);
                let before = state.pose.rotation;
                state.step(0.02);
                assert!(state.pose.rotation != before);
                assert_eq!((state.stop, state.still_s), (None, 0.0), "{way:?}");
                assert!(state.wanted().is_some_and(|request| request.is_moving));
            }
        }
    }
}
