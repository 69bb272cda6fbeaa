//! Where one is, how one moves, and what is to be shown: plain data, without a window.

use crate::camera::{Glide, level_axes, moved, orbited, pose_of, turned, zoomed};
use crate::compose::nearest_stop;
use crate::content::{Content, Space};
use crate::keyframes::Keyframes;
use crate::picture::{DepthGrid, Look, Request, Shown, on_ray};
use calibrate::{Lens, Pixel, Rigid3, View};
use glam::{DVec2, DVec3};
use proxy::interior::CellId;
use render::PathFrame;
use std::collections::BTreeSet;
use std::sync::Arc;

/// How hands move the camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Dragging goes around what is under the cursor.
    Orbit,
    /// Dragging looks around.
    Fly,
    /// As flying, at eye height, and walls are in the way.
    Walk,
}

impl Mode {
    /// For people, and for the trace.
    pub fn name(self) -> &'static str {
        match self {
            Self::Orbit => "orbit",
            Self::Fly => "fly",
            Self::Walk => "walk",
        }
    }
}

/// What is done as long as a key is held.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Motion {
    /// Along the line of sight.
    Forward,
    /// Against it.
    Back,
    /// Aside, to the left.
    Left,
    /// Aside, to the right.
    Right,
    /// Upwards.
    Up,
    /// Downwards.
    Down,
    /// On the spot, to the left.
    TurnLeft,
    /// On the spot, to the right.
    TurnRight,
    /// On the spot, upwards.
    TurnUp,
    /// On the spot, downwards.
    TurnDown,
    /// All of that faster.
    Fast,
}

/// A button of the mouse.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Button {
    /// The one that goes around, or looks around.
    Left,
    /// Those that move aside.
    Other,
}

/// What is done once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Action {
    /// Go to a photo's camera, or a room.
    Go(usize),
    /// Go to the next.
    Next,
    /// Go to the one before.
    Previous,
    /// Go back to what the photos show.
    Home,
    /// Move in another way.
    Move(Mode),
    /// Add a keyframe here.
    AddKeyframe,
    /// Delete the chosen keyframe.
    DeleteKeyframe,
    /// Move the chosen keyframe here.
    PlaceKeyframe,
    /// Go to the next keyframe, or the one before.
    StepKeyframe(bool),
    /// Show the film, or stop it.
    Play,
}

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
/// A stall must not become a leap, in seconds.
const LONGEST_STEP_S: f64 = 0.1;
/// For so long one must be still before the picture is drawn in full; and longer where that takes
/// long, as it holds up what comes next, in shares of its time.
const STILL_S: f64 = 0.12;
const STILL_SHARE: f64 = 0.25;
const STILL_MOST_S: f64 = 0.8;

/// A preview of the film.
struct Playing {
    poses: Vec<Rigid3>,
    fps: f64,
    at_s: f64,
}

struct Drag {
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

/// Where one is, how one moves, and what is to be shown.
pub struct State {
    content: Option<Content>,
    space: Option<Arc<Space>>,
    pose: Rigid3,
    /// In pixels.
    size: (u32, u32),
    /// How hands move the camera.
    pub mode: Mode,
    /// How it is drawn.
    pub look: Look,
    /// α of the field: only β/α counts.
    pub alpha: f64,
    /// β of the field.
    pub beta: f64,
    /// Where the wipe is, in shares of the width: left of it is the picture, right of it the photo.
    pub wipe: Option<f64>,
    /// Whether more is to be said of the pixel under the cursor.
    pub tells_weights: bool,
    /// The path in the making.
    pub keyframes: Keyframes,
    playing: Option<Playing>,
    held: BTreeSet<Motion>,
    drag: Option<Drag>,
    glide: Option<Glide>,
    /// Which stop one went to last.
    stop: Option<usize>,
    pointer: Option<Pixel>,
    /// For how long nothing moved, in seconds.
    still_s: f64,
    asked: Option<Request>,
    asked_count: u64,
    /// What a picture in full takes, about, in seconds.
    full_s: f64,
    /// Of the last picture shown.
    depths: Option<(View, DepthGrid)>,
    /// See [`Support::share`](crate::picture::Support::share); 1 where unknown.
    pub support: f64,
}

impl State {
    /// Nothing to show yet.
    pub fn new(look: Look) -> Self {
        Self {
            content: None,
            space: None,
            pose: Rigid3::IDENTITY,
            size: (0, 0),
            mode: Mode::Orbit,
            alpha: 1.0,
            beta: look.options.beta,
            look,
            wipe: None,
            tells_weights: false,
            keyframes: Keyframes::default(),
            playing: None,
            held: BTreeSet::new(),
            drag: None,
            glide: None,
            stop: None,
            pointer: None,
            still_s: STILL_MOST_S,
            asked: None,
            asked_count: 0,
            full_s: 0.0,
            depths: None,
            support: 1.0,
        }
    }

    /// Shows a content: the first from its first photo's camera or in its first room, others from
    /// where one is.
    ///
    /// Returns what was shown before: letting go of it may take a while.
    pub fn show(&mut self, content: Content, space: Arc<Space>) -> Option<Content> {
        if self.space.is_none() {
            if let Some(first) = space.stops.first() {
                self.pose = first.view.camera_from_world;
                self.stop = Some(0);
            }
            if space.is_interior {
                self.mode = Mode::Walk;
            }
        }
        self.space = Some(space);
        // Its pictures differ.
        self.asked = None;
        self.content.replace(content)
    }

    /// What is known of the space one moves in.
    pub fn space(&self) -> Option<&Space> {
        self.space.as_deref()
    }

    /// What is shown.
    pub fn content(&self) -> Option<&Content> {
        self.content.as_ref()
    }

    /// Another size, in pixels; none while there is nothing to draw on.
    pub fn resize(&mut self, width: u32, height: u32) {
        self.size = (width, height);
    }

    /// The view that is wanted; none while there is nothing to show or nothing to draw on.
    ///
    /// A pinhole that shows as much as the first photo's camera does.
    pub fn view(&self) -> Option<View> {
        let (width, height) = self.size;
        let first = &self.space.as_ref()?.stops.first()?.view;
        if width == 0 || height == 0 {
            return None;
        }
        let (w, h) = (f64::from(width), f64::from(height));
        let fit = (w / f64::from(first.width)).min(h / f64::from(first.height));
        // Fisheyes and panoramas see more than a pinhole can.
        let focal = (first.lens.mean_focal() * fit).max(0.35 * w.max(h));
        let view = View {
            lens: Lens::pinhole(DVec2::splat(focal), DVec2::new(0.5 * w, 0.5 * h)),
            width,
            height,
            camera_from_world: self.pose,
        };
        // As files give it back, so that others draw just this.
        let frame = PathFrame::of_view(String::new(), &view);
        frame.ok().map(|frame| frame.view)
    }

    /// Which cell of an interior one is in.
    pub fn cell(&self) -> Option<CellId> {
        match &self.content {
            Some(Content::Interior(house)) => {
                house.contents.locate(&house.interior, self.pose.center())
            }
            _ => None,
        }
    }

    /// Where one is.
    pub fn pose(&self) -> &Rigid3 {
        &self.pose
    }

    /// Which stop one went to last, if one did not move since.
    pub fn stop(&self) -> Option<usize> {
        self.stop
    }

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
            let pose = match (drag.is_pan, self.mode) {
                (true, Mode::Orbit | Mode::Fly) => {
                    let scale = drag.depth / view.lens.mean_focal();
                    moved(&self.pose, DVec3::new(-dx * scale, -dy * scale, 0.0))
                }
                // What is under the cursor comes along.
                (false, Mode::Orbit) => orbited(&self.pose, drag.pivot_in_world, up, -yaw, pitch),
                (_, Mode::Fly | Mode::Walk) => turned(&self.pose, up, -yaw, -pitch),
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
    fn under(&self, view: &View, at: Pixel, otherwise: f64) -> DVec3 {
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

    /// Does something once.
    pub fn act(&mut self, action: Action) {
        let stops = self.space.as_ref().map_or(0, |s| s.stops.len());
        match action {
            Action::Go(stop) => self.go(stop),
            Action::Next if stops > 0 => {
                let next = self.stop.or_else(|| self.nearest()).map_or(0, |i| i + 1);
                self.go(next % stops);
            }
            Action::Previous if stops > 0 => {
                let at = self.stop.or_else(|| self.nearest()).unwrap_or(0);
                self.go((at + stops - 1) % stops);
            }
            Action::Next | Action::Previous => {}
            Action::Home => {
                if let Some(nearest) = self.nearest() {
                    self.go(nearest);
                }
            }
            Action::Move(mode) => {
                let is_interior = self.space.as_ref().is_some_and(|s| s.is_interior);
                if mode == Mode::Walk && is_interior {
                    // On the ground again.
                    let pose = self.walked(DVec3::ZERO);
                    self.be_at(pose);
                }
                if mode != Mode::Walk || is_interior {
                    self.mode = mode;
                }
            }
            Action::AddKeyframe => {
                if let Some(view) = self.view() {
                    self.keyframes.add(view.camera_from_world);
                }
            }
            Action::PlaceKeyframe => {
                if let Some(view) = self.view() {
                    self.keyframes.place(view.camera_from_world);
                }
            }
            Action::DeleteKeyframe => self.keyframes.delete(),
            Action::StepKeyframe(is_later) => {
                self.playing = None;
                self.glide = None;
                if let Some(pose) = self.keyframes.step(is_later) {
                    self.be_at(pose);
                }
            }
            Action::Play => {
                self.glide = None;
                self.playing = match (self.playing.take(), self.view()) {
                    (None, Some(view)) => self.keyframes.film(&view).ok().map(|film| Playing {
                        poses: film
                            .frames
                            .iter()
                            .map(|f| f.view.camera_from_world)
                            .collect(),
                        fps: film.fps,
                        at_s: 0.0,
                    }),
                    _ => None,
                };
            }
        }
    }

    /// The stop that is nearest to where one is.
    pub fn nearest(&self) -> Option<usize> {
        let space = self.space.as_ref()?;
        nearest_stop(&space.stops, &self.view()?, space.depth)
    }

    fn go(&mut self, stop: usize) {
        let (Some(view), Some(space)) = (self.view(), &self.space) else {
            return;
        };
        let Some(to) = space.stops.get(stop) else {
            return;
        };
        let target = View {
            camera_from_world: to.view.camera_from_world,
            ..view.clone()
        };
        let far = view.center().distance(target.center()) / space.depth;
        let angle = view.forward().dot(target.forward()).clamp(-1.0, 1.0).acos();
        let duration_s = (0.3 + 0.3 * (far + angle)).min(1.2);
        self.playing = None;
        self.glide = Some(Glide::new(view, target, duration_s));
        self.stop = Some(stop);
    }

    /// Where one is after walking.
    fn walked(&self, motion_in_world: DVec3) -> Rigid3 {
        let Some(Content::Interior(house)) = &self.content else {
            return self.pose;
        };
        let at = house.obstacles.walk(self.pose.center(), motion_in_world);
        let cell = house.contents.locate(&house.interior, at);
        pose_of(self.pose.rotation, house.obstacles.at_eye_height(cell, at))
    }

    fn be_at(&mut self, pose: Rigid3) {
        if pose != self.pose {
            self.pose = pose;
            self.stop = None;
            self.still_s = 0.0;
        }
    }

    /// Lets some time pass.
    pub fn step(&mut self, seconds: f64) {
        let seconds = seconds.clamp(0.0, LONGEST_STEP_S);
        self.still_s += seconds;
        if let Some(mut glide) = self.glide.take() {
            let (pose, is_done) = glide.step(seconds);
            let stop = self.stop;
            self.be_at(pose);
            self.stop = stop;
            self.glide = (!is_done).then_some(glide);
        }
        self.play(seconds);
        self.move_by_keys(seconds);
    }

    fn play(&mut self, seconds: f64) {
        let Some(mut playing) = self.playing.take() else {
            return;
        };
        let last = playing.poses.len() - 1;
        let index = ((playing.at_s * playing.fps).round() as usize).min(last);
        self.be_at(playing.poses[index]);
        playing.at_s += seconds;
        self.playing = (index < last).then_some(playing);
    }

    fn move_by_keys(&mut self, seconds: f64) {
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
                    self.pose = pose;
                    self.walked(forward * way.z + right * way.x)
                }
            };
        }
        self.glide = None;
        self.playing = None;
        // Walking into a wall turns nothing.
        let (before, stop) = (self.pose, self.stop);
        self.be_at(pose);
        if before == self.pose {
            self.stop = stop;
        }
    }

    /// Whether the film is shown.
    pub fn is_playing(&self) -> bool {
        self.playing.is_some()
    }

    /// Whether something moves by itself, so that time must go on.
    pub fn is_restless(&self) -> bool {
        let drawn_in_haste = self.asked.as_ref().is_some_and(|asked| asked.is_moving);
        !self.held.is_empty() || self.glide.is_some() || self.playing.is_some() || drawn_in_haste
    }

    /// The picture to ask for, if it is another than the one asked for last.
    pub fn wanted(&mut self) -> Option<Request> {
        let view = self.view()?;
        self.look.options.beta = self.beta / self.alpha.max(1e-6);
        self.look.photo = self.wipe.is_some();
        let is_moving = self.still_s < (STILL_SHARE * self.full_s).clamp(STILL_S, STILL_MOST_S);
        let pointer = self.pointer.filter(|_| self.tells_weights && !is_moving);
        let (count, look) = (self.asked_count + 1, self.look.clone());
        let request = Request {
            id: count,
            view,
            look,
            is_moving,
            hover: pointer,
        };
        if let Some(asked) = &self.asked {
            let is_same = asked.view == request.view
                && asked.look == request.look
                && asked.hover == request.hover;
            // What was drawn in haste is drawn again at leisure.
            if is_same && (!asked.is_moving || is_moving) {
                return None;
            }
        }
        self.asked_count = count;
        self.asked = Some(request.clone());
        Some(request)
    }

    /// Takes note of a picture that is shown now.
    pub fn shown(&mut self, shown: &Shown) {
        self.depths = Some((shown.view.clone(), shown.depths.clone()));
        self.support = shown.support.map_or(1.0, |s| s.share());
        let pixels = f64::from(shown.reduction).powi(2);
        self.full_s = 1e-3 * shown.time_ms() * pixels;
    }

    /// Whether a picture is the last one asked for, in full.
    pub fn is_settled(&self, shown: &Shown) -> bool {
        let is_last = self.asked.as_ref().is_some_and(|a| a.id == shown.id);
        is_last && shown.reduction == 1 && !self.is_restless()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::content::House;
    use crate::picture::{Lines, Support};
    use datasets::house::{HouseOptions, house};
    use egui::ColorImage;
    use image::RgbaImage;
    use proxy::interior::Contents;
    use proxy::{Plane, Proxy};
    use render::{Lumigraph, PhotoStore, SourceView};

    fn wall() -> Content {
        let source = |x: f64| SourceView {
            name: format!("{x}"),
            view: View {
                lens: Lens::pinhole(DVec2::splat(40.0), DVec2::new(20.0, 15.0)),
                width: 40,
                height: 30,
                camera_from_world: Rigid3::looking_at(
                    DVec3::X * x,
                    DVec3::new(x, 0.0, 4.0),
                    DVec3::NEG_Y,
                ),
            },
            gain: [1.0; 3],
            time_s: None,
        };
        Content::Scene(Arc::new(Lumigraph {
            points: Vec::new(),
            sources: vec![source(0.0), source(1.0), source(2.0)],
            photos: PhotoStore::from_images(vec![RgbaImage::new(40, 30); 3]),
            proxy: Proxy::Plane(Plane::new(DVec3::new(0.0, 0.0, 4.0), DVec3::Z).unwrap()),
            visibility: None,
        }))
    }

    fn looking_at_a_wall() -> State {
        let mut state = State::new(Look::default());
        state.resize(400, 300);
        state.show_alone(wall());
        state
    }

    impl State {
        fn show_alone(&mut self, content: Content) {
            let space = Arc::new(Space::of(&content));
            let _ = self.show(content, space);
        }
    }

    fn step(state: &mut State, seconds: f64) {
        for _ in 0..(seconds / 0.02) as usize {
            state.step(0.02);
        }
    }

    #[test]
    fn it_begins_at_the_first_photo_and_stays_when_more_is_known() {
        let mut state = State::new(Look::default());
        assert!(state.view().is_none() && state.wanted().is_none());
        state.show_alone(wall());
        assert!(state.view().is_none(), "nothing to draw on");
        state.resize(400, 300);
        let view = state.view().unwrap();
        assert_eq!((view.width, view.height, state.stop()), (400, 300, Some(0)));
        assert!((view.lens.mean_focal() - 400.0).abs() < 1e-9);
        // A wide window shows the photo's height.
        state.resize(4000, 300);
        assert!((state.view().unwrap().lens.mean_focal() - 1400.0).abs() < 1e-9);
        state.resize(0, 300);
        assert!(state.view().is_none());
        state.resize(400, 300);
        let first = state.wanted().unwrap();
        assert!(!first.is_moving && state.wanted().is_none());
        state.act(Action::Go(2));
        step(&mut state, 2.0);
        let there = *state.pose();
        state.show_alone(wall());
        assert_eq!(*state.pose(), there);
        assert!(state.wanted().is_some(), "the new content's picture");
    }

    #[test]
    fn cameras_are_gone_to_smoothly_one_after_the_other() {
        let mut state = looking_at_a_wall();
        let mut last = 0.0;
        state.act(Action::Next);
        while state.is_restless() {
            state.step(0.02);
            let _ = state.wanted();
            let x = state.pose().center().x;
            assert!(x >= last && x - last < 0.15, "{x}");
            last = x;
        }
        assert_eq!((last, state.stop()), (1.0, Some(1)));
        for (action, x) in [
            (Action::Next, 2.0),
            (Action::Next, 0.0),
            (Action::Previous, 2.0),
        ] {
            state.act(action);
            step(&mut state, 2.0);
            assert!((state.pose().center().x - x).abs() < 1e-12);
        }
        // From wherever, back to the nearest.
        state.hold(Motion::Left, true);
        step(&mut state, 1.0);
        state.hold(Motion::Left, false);
        assert_eq!(state.stop(), None);
        let nearest = state.nearest().unwrap();
        state.act(Action::Home);
        step(&mut state, 2.0);
        assert_eq!(state.stop(), Some(nearest));
        state.act(Action::Go(99));
        step(&mut state, 2.0);
        assert_eq!(state.stop(), Some(nearest));
    }

    #[test]
    fn what_is_drawn_in_haste_is_drawn_again_at_leisure() {
        let mut state = looking_at_a_wall();
        let _ = state.wanted();
        state.hold(Motion::Forward, true);
        state.step(0.02);
        assert!(state.wanted().unwrap().is_moving);
        state.hold(Motion::Forward, false);
        state.step(0.02);
        assert!(state.wanted().is_none() && state.is_restless());
        step(&mut state, 0.3);
        let last = state.wanted().unwrap();
        assert!(!last.is_moving);
        assert!(!state.is_restless());
        // A stall is no leap.
        let before = state.pose().center();
        state.hold(Motion::Forward, true);
        state.step(1e9);
        let speed = state.space().unwrap().speed;
        assert!(state.pose().center().distance(before) <= 0.11 * speed);
        state.let_go();
        assert!(state.held.is_empty());
    }

    /// As if a picture of the wall was shown.
    fn with_depths(state: &mut State) {
        let view = state.view().unwrap();
        let shown = Shown {
            id: 1,
            depths: DepthGrid::new(view.width, view.height, |_| Some(0.25)),
            view,
            reduction: 1,
            image: Arc::new(ColorImage::default()),
            photo: None,
            lines: Lines::default(),
            support: Some(Support {
                covered: 0.0,
                difference: 0.0,
            }),
            hover: None,
            cell: None,
            stages: Vec::new(),
            skipped: String::new(),
            device: String::new(),
            revision: 1,
        };
        state.shown(&shown);
    }

    #[test]
    fn what_is_under_the_cursor_stays_there() {
        let mut state = looking_at_a_wall();
        with_depths(&mut state);
        assert_eq!(state.support, 0.0);
        let at = Pixel::new(300.0, 100.0);
        let view = state.view().unwrap();
        let point = state.under(&view, at, 4.0);
        assert!((point.z - 4.0).abs() < 1e-9);
        let seen = |state: &State| state.view().unwrap().project(point).unwrap();
        // The wheel.
        state.wheel(2.0, at);
        assert!(seen(&state).distance(at) < 1e-6 && state.pose().center().z > 0.5);
        // Aside.
        state.press(Button::Left, at, true);
        state.point(Some(Pixel::new(320.0, 130.0)));
        assert!(seen(&state).distance(Pixel::new(320.0, 130.0)) < 1.0);
        assert_eq!(state.release(Button::Left), None, "no click");
        // Around.
        let before = seen(&state);
        state.press(Button::Left, before, false);
        state.point(Some(Pixel::new(before.x - 60.0, before.y)));
        assert!(seen(&state).distance(before) < 1.0);
        assert!(state.pose().center().x > 0.2, "dragging left goes right");
        state.release(Button::Left);
        // A click.
        state.press(Button::Left, at, false);
        assert_eq!(state.release(Button::Other), None);
        assert_eq!(state.release(Button::Left), Some(at));
        // Looking around stays on the spot.
        state.act(Action::Move(Mode::Fly));
        let center = state.pose().center();
        state.press(Button::Left, at, false);
        state.point(Some(Pixel::new(10.0, 10.0)));
        assert!(state.pose().center().distance(center) < 1e-12);
        state.act(Action::Move(Mode::Walk));
        assert_eq!(state.mode, Mode::Fly, "there is no floor");
    }

    #[test]
    fn a_film_is_shown_frame_by_frame_and_ends_at_its_end() {
        let mut state = looking_at_a_wall();
        state.act(Action::Play);
        assert!(!state.is_playing(), "nothing to show");
        for stop in [0, 2] {
            state.act(Action::Go(stop));
            step(&mut state, 2.0);
            state.act(Action::AddKeyframe);
        }
        state.act(Action::Play);
        let mut frames = 0;
        while state.is_playing() {
            state.step(1.0 / 30.0);
            frames += 1;
        }
        assert!((60..=62).contains(&frames), "{frames}");
        assert_eq!(state.pose(), &state.keyframes.poses()[1]);
        state.act(Action::StepKeyframe(false));
        assert_eq!(state.pose(), &state.keyframes.poses()[0]);
    }

    #[test]
    fn weights_and_sliders_reach_the_request() {
        let mut state = looking_at_a_wall();
        let _ = state.wanted();
        state.tells_weights = true;
        state.point(Some(Pixel::new(5.0, 6.0)));
        assert_eq!(state.wanted().unwrap().hover, Some(Pixel::new(5.0, 6.0)));
        (state.alpha, state.beta, state.wipe) = (2.0, 0.5, Some(0.5));
        let asked = state.wanted().unwrap();
        assert!((asked.look.options.beta - 0.25).abs() < 1e-12 && asked.look.photo);
        assert_eq!(asked.look.options.check(), Ok(()));
    }

    #[test]
    fn one_walks_in_a_house_at_eye_height() {
        let options = HouseOptions {
            rooms: 2,
            triangles: Some(1),
            ..HouseOptions::default()
        };
        let made = house(&options).unwrap();
        let contents = Contents::new(&made.interior, &made.model).unwrap().0;
        let house = House::new(made.interior, contents, made.model);
        let mut state = State::new(Look::default());
        state.resize(320, 240);
        state.show_alone(Content::Interior(Arc::new(house)));
        assert_eq!(state.mode, Mode::Walk);
        assert!(state.cell().is_some());
        let start = state.pose().center();
        assert!((start.y - 1.6).abs() < 1e-9);
        for motion in [Motion::Forward, Motion::TurnDown, Motion::TurnLeft] {
            state.hold(motion, true);
        }
        step(&mut state, 3.0);
        let end = state.pose().center();
        assert!((end.y - 1.6).abs() < 1e-9 && end.distance(start) > 0.1);
        assert!(state.cell().is_some());
        // The wheel walks, too.
        state.let_go();
        state.wheel(-1.0, Pixel::new(1.0, 1.0));
        assert!((state.pose().center().y - 1.6).abs() < 1e-9);
        state.act(Action::Next);
        step(&mut state, 2.0);
        assert_eq!(state.stop(), Some(1));
    }
}
