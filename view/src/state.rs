//! Where one is, how one moves, and what is to be shown: plain data, without a window.

mod hands;

use crate::camera::{Glide, angle_between, pose_of};
use crate::compose::nearest_stop;
use crate::content::{Content, Space, Stop};
use crate::keyframes::Keyframes;
use crate::picture::{DepthGrid, Layer, Look, Request, Shown};
use calibrate::{Lens, Pixel, Rigid3, View};
use glam::{DVec2, DVec3};
use hands::Drag;
use proxy::interior::CellId;
use render::path::CameraPath;
use render::{MAX_BETA, Method, PathFrame};
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

/// A stall must not become a leap, in seconds.
const LONGEST_STEP_S: f64 = 0.1;
/// For so long one must be still before the picture is drawn in full; and longer where that takes
/// long, as it holds up what comes next, in shares of its time.
const STILL_S: f64 = 0.12;
const STILL_SHARE: f64 = 0.25;
const STILL_MOST_S: f64 = 0.8;

/// A preview of the film.
struct Playing {
    film: CameraPath,
    /// Whether its lenses are a file's, and not the window's.
    has_lenses: bool,
    /// Whether its frames' times are the scene's, and not just the film's.
    has_times: bool,
    at_s: f64,
}

/// Where one is, how one moves, and what is to be shown.
pub struct State {
    content: Option<Content>,
    space: Option<Arc<Space>>,
    pose: Rigid3,
    /// As much as this view is shown in place of what the first photo's camera shows: a keyframe that
    /// has a lens of its own, or a frame of the film between such. Until one moves.
    framing: Option<View>,
    /// In pixels.
    size: (u32, u32),
    /// How hands move the camera.
    pub mode: Mode,
    /// How it is drawn.
    pub look: Look,
    /// Of the triangulated field, while the exact one is shown.
    cells_across: Option<u32>,
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
            framing: None,
            size: (0, 0),
            mode: Mode::Orbit,
            alpha: 1.0,
            beta: look.options.beta,
            look,
            cells_across: None,
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
                // What was chosen before anybody knew.
                self.wipe = None;
                if !self.look.layer.is_of_interiors() {
                    self.look.layer = Layer::default();
                }
            }
        }
        self.look.moment = self.look.moment.or(space.times.map(|times| times.moment));
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
    /// A pinhole that shows as much as the first photo's camera does, or the keyframe that one is at
    /// with its own lens.
    pub fn view(&self) -> Option<View> {
        let (width, height) = self.size;
        let first = &self.space.as_ref()?.stops.first()?.view;
        let framing = self.framing.as_ref().unwrap_or(first);
        if width == 0 || height == 0 {
            return None;
        }
        let (w, h) = (f64::from(width), f64::from(height));
        let fit = (w / f64::from(framing.width)).min(h / f64::from(framing.height));
        // Fisheyes and panoramas see more than a pinhole can.
        let focal = (framing.lens.mean_focal() * fit).max(0.35 * w.max(h));
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
                    let time_s = self.look.moment.map(|moment| moment.time_s);
                    self.keyframes.add(view.camera_from_world, time_s);
                }
            }
            Action::PlaceKeyframe => {
                if let Some(view) = self.view() {
                    let time_s = self.look.moment.map(|moment| moment.time_s);
                    self.keyframes.place(view.camera_from_world, time_s);
                }
            }
            Action::DeleteKeyframe => self.keyframes.delete(),
            Action::StepKeyframe(is_later) => {
                self.playing = None;
                self.glide = None;
                if let Some(pose) = self.keyframes.step(is_later) {
                    self.be_at(pose);
                    self.frame(self.keyframes.framing());
                    self.be_when(self.keyframes.scene_time_s());
                }
            }
            Action::Play => {
                self.glide = None;
                self.playing = match (self.playing.take(), self.view()) {
                    (None, Some(view)) => self.keyframes.film(&view).ok().map(|film| Playing {
                        film,
                        has_lenses: self.keyframes.has_lenses(),
                        has_times: self.keyframes.has_scene_times(),
                        at_s: 0.0,
                    }),
                    _ => None,
                };
            }
        }
    }

    /// Shows the exact field, or the triangulated one, at the grid that it had before.
    pub fn set_exact(&mut self, is_exact: bool) {
        self.look.method = match (self.look.method, is_exact) {
            (Method::Triangulated { cells_across }, true) => {
                self.cells_across = Some(cells_across);
                Method::Exact
            }
            (Method::Exact, false) => match self.cells_across {
                Some(cells_across) => Method::Triangulated { cells_across },
                None => Method::TRIANGULATED,
            },
            (same, _) => same,
        };
    }

    /// The stop that is nearest to where one is: a photo's camera by place and direction; in an interior that of the room
    /// one is in, wherever one looks, and outside all of them the nearest by place alone.
    pub fn nearest(&self) -> Option<usize> {
        let space = self.space.as_ref()?;
        if !space.is_interior {
            return nearest_stop(&space.stops, &self.view()?, space.depth);
        }
        let cell = self.cell();
        let own = |stop: &Stop| cell.is_some() && stop.cell == cell;
        space.stops.iter().position(own).or_else(|| {
            let eye = self.pose.center();
            let ways = space.stops.iter().map(|stop| stop.view.center() - eye);
            let ways = ways.map(DVec3::length).enumerate();
            ways.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(i, _)| i)
        })
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
        let angle = angle_between(view.forward(), target.forward());
        let duration_s = (0.3 + 0.3 * (far + angle)).min(1.2);
        self.playing = None;
        self.glide = Some(Glide::new(view, target, duration_s));
        self.stop = Some(stop);
        self.frame(None);
    }

    /// Where one is after walking.
    fn walked(&self, motion_in_world: DVec3) -> Rigid3 {
        let Some(Content::Interior(house)) = &self.content else {
            return self.pose;
        };
        let eye = self.pose.center();
        let cell = house.contents.locate(&house.interior, eye);
        let at = house.obstacles.walk(cell, eye, motion_in_world);
        let cell = house.contents.locate(&house.interior, at);
        pose_of(self.pose.rotation, house.obstacles.at_eye_height(cell, at))
    }

    fn be_at(&mut self, pose: Rigid3) {
        if pose != self.pose {
            self.pose = pose;
            self.framing = None;
            self.stop = None;
            self.still_s = 0.0;
        }
    }

    /// Shows as much as a view does, until one moves; without one, as ever.
    fn frame(&mut self, framing: Option<View>) {
        if framing != self.framing {
            self.framing = framing;
            self.still_s = 0.0;
        }
    }

    /// Shows a scene where time plays a part as of a time, in seconds; without one, as before.
    fn be_when(&mut self, time_s: Option<f64>) {
        if let (Some(time_s), Some(moment)) = (time_s, &mut self.look.moment)
            && moment.time_s != time_s
        {
            moment.time_s = time_s;
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
        let last = playing.film.frames.len() - 1;
        let index = ((playing.at_s * playing.film.fps).round() as usize).min(last);
        let frame = &playing.film.frames[index];
        self.be_at(frame.view.camera_from_world);
        self.frame(playing.has_lenses.then(|| frame.view.clone()));
        self.be_when(frame.time_s.filter(|_| playing.has_times));
        playing.at_s += seconds;
        self.playing = (index < last).then_some(playing);
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
        self.look.options.beta = (self.beta / self.alpha.max(1e-6)).min(MAX_BETA);
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
mod tests;
