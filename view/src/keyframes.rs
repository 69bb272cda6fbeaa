//! A path in the making: keyframes, and where the preview is between them.

use calibrate::{Camera, Rigid3, View};
use render::path::{CameraPath, Interpolation, Keyframe, PathError};

/// Seconds from one keyframe to the next, unless one says otherwise.
const APART_S: f64 = 2.0;

/// What a file gave a keyframe beside its pose.
#[derive(Clone, Debug, Default, PartialEq)]
struct Given {
    /// Its lens and size; those without one have the window's. All have one, or none has.
    camera: Option<Camera>,
    /// The scene's own time. All have one, or none has: those of a few would not count.
    time_s: Option<f64>,
}

/// Keyframes in order, and which is chosen.
#[derive(Clone, Debug, PartialEq)]
pub struct Keyframes {
    poses: Vec<Rigid3>,
    given: Vec<Given>,
    /// When each is passed, in seconds, as long as `apart_s` is `paced_s`.
    passed_s: Vec<f64>,
    paced_s: f64,
    /// Which one, while there are any.
    chosen: usize,
    /// Seconds from one to the next; of a file's, which may be uneven, the mean. Another value makes
    /// all ways between them longer, or shorter, in the same proportion.
    pub apart_s: f64,
    /// Frames a second.
    pub fps: f64,
    /// What happens between them.
    pub interpolation: Interpolation,
}

impl Default for Keyframes {
    fn default() -> Self {
        Self {
            poses: Vec::new(),
            given: Vec::new(),
            passed_s: Vec::new(),
            paced_s: APART_S,
            chosen: 0,
            apart_s: APART_S,
            fps: 30.0,
            interpolation: Interpolation::Spline,
        }
    }
}

impl Keyframes {
    /// How many there are.
    pub fn len(&self) -> usize {
        self.poses.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.poses.is_empty()
    }

    /// Which is chosen.
    pub fn chosen(&self) -> Option<usize> {
        (!self.poses.is_empty()).then_some(self.chosen)
    }

    /// Their poses, in order.
    pub fn poses(&self) -> &[Rigid3] {
        &self.poses
    }

    /// Whether it is the same path, whichever keyframe is chosen.
    pub fn is_same_path(&self, other: &Self) -> bool {
        let with_its_choice = Self {
            chosen: other.chosen,
            ..self.clone()
        };
        with_its_choice == *other
    }

    /// Adds one after the chosen one, and chooses it. Its lens is that of the chosen one: all lenses of
    /// a path are of one model and size. Its time of the scene's is `time_s`, in seconds, or without
    /// that the chosen one's; where the others have none, it has none.
    pub fn add(&mut self, pose: Rigid3, time_s: Option<f64>) {
        (self.passed_s, self.paced_s) = (self.times_s(), self.apart_s);
        let at = self.chosen().map_or(0, |i| i + 1);
        let mut given = self.given.get(self.chosen).cloned().unwrap_or_default();
        if self.have_times_but(None) {
            given.time_s = time_s.or(given.time_s);
        }
        let before_s = at.checked_sub(1).map(|i| self.passed_s[i]);
        for later_s in &mut self.passed_s[at..] {
            *later_s += self.apart_s;
        }
        let passed_s = before_s.map_or(0.0, |before_s| before_s + self.apart_s);
        self.poses.insert(at, pose);
        self.given.insert(at, given);
        self.passed_s.insert(at, passed_s);
        self.chosen = at;
    }

    /// Deletes the chosen one, and the way to it; the one before is chosen.
    pub fn delete(&mut self) {
        let at = self.chosen;
        if at < self.poses.len() {
            // To the first there is no way, but from it.
            let from = at.saturating_sub(1);
            let to_s = self.passed_s.get(from + 1).copied();
            let way_s = to_s.map_or(0.0, |to_s| to_s - self.passed_s[from]);
            self.poses.remove(at);
            self.given.remove(at);
            self.passed_s.remove(at);
            for later_s in &mut self.passed_s[at..] {
                *later_s -= way_s;
            }
        }
        self.chosen = at.saturating_sub(1);
    }

    /// Moves the chosen one to a pose, and to a time of the scene's, in seconds, if there is one and the
    /// others have some, too.
    pub fn place(&mut self, pose: Rigid3, time_s: Option<f64>) {
        let have_times = self.have_times_but(Some(self.chosen));
        if let Some(chosen) = self.poses.get_mut(self.chosen) {
            *chosen = pose;
            let given = &mut self.given[self.chosen];
            given.time_s = time_s.filter(|_| have_times).or(given.time_s);
        }
    }

    /// Whether all have a time of the scene's, but for one that is not asked.
    fn have_times_but(&self, other: Option<usize>) -> bool {
        let mut given = self.given.iter().enumerate();
        given.all(|(i, given)| given.time_s.is_some() || Some(i) == other)
    }

    /// Moves the chosen one to an earlier or later place in the order. When places are passed stays
    /// as it is.
    pub fn shift(&mut self, later: bool) {
        let to = match later {
            true => self.chosen + 1,
            false => self.chosen.wrapping_sub(1),
        };
        if to < self.poses.len() {
            self.poses.swap(self.chosen, to);
            self.given.swap(self.chosen, to);
            self.chosen = to;
        }
    }

    /// Chooses one by its place in the order.
    pub fn choose(&mut self, index: usize) {
        self.chosen = index.min(self.poses.len().saturating_sub(1));
    }

    /// Chooses the next or the one before, round and round; its pose.
    pub fn step(&mut self, later: bool) -> Option<Rigid3> {
        let count = self.poses.len();
        if count > 0 {
            let by = if later { 1 } else { count - 1 };
            self.chosen = (self.chosen + by) % count;
        }
        self.poses.get(self.chosen).copied()
    }

    /// Whether they have lenses of their own.
    pub fn has_lenses(&self) -> bool {
        self.given.iter().any(|given| given.camera.is_some())
    }

    /// Whether they have times of the scene's.
    pub fn has_scene_times(&self) -> bool {
        self.given.iter().any(|given| given.time_s.is_some())
    }

    /// The scene's time at the chosen one, in seconds, where it has one.
    pub fn scene_time_s(&self) -> Option<f64> {
        self.given.get(self.chosen)?.time_s
    }

    /// The chosen one's view, where it has a lens of its own.
    pub fn framing(&self) -> Option<View> {
        let camera = self.given.get(self.chosen)?.camera.as_ref()?;
        Some(View {
            lens: camera.lens().ok()?,
            width: camera.width,
            height: camera.height,
            camera_from_world: *self.poses.get(self.chosen)?,
        })
    }

    /// When each is passed, in seconds.
    fn times_s(&self) -> Vec<f64> {
        let first_s = self.passed_s.first().copied().unwrap_or(0.0);
        let time_s = |passed_s: &f64| match self.apart_s == self.paced_s {
            // To the last bit.
            true => *passed_s,
            false => first_s + (passed_s - first_s) / self.paced_s * self.apart_s,
        };
        self.passed_s.iter().map(time_s).collect()
    }

    /// Seconds from the first to the last.
    pub fn duration_s(&self) -> f64 {
        match self.times_s()[..] {
            [first_s, .., last_s] => last_s - first_s,
            _ => 0.0,
        }
    }

    /// As path files have them; those without a lens of their own have that of `view`, and its size.
    pub fn stored(&self, view: &View) -> Vec<Keyframe> {
        let of_view = || Camera::of(&view.lens, view.width, view.height);
        let keyframe = |((pose, given), t_s): ((&Rigid3, &Given), f64)| Keyframe {
            t_s,
            camera_from_world: *pose,
            camera: given.camera.clone().unwrap_or_else(of_view),
            time_s: given.time_s,
        };
        let keyframes = self.poses.iter().zip(&self.given).zip(self.times_s());
        keyframes.map(keyframe).collect()
    }

    /// The frames of the film.
    ///
    /// # Errors
    /// No keyframes; numbers that make no path.
    pub fn film(&self, view: &View) -> Result<CameraPath, PathError> {
        CameraPath::from_keyframes(&self.stored(view), self.interpolation, self.fps)
    }

    /// Takes over keyframes of a file, with their lenses and times.
    pub fn load(&mut self, keyframes: &[Keyframe], interpolation: Interpolation, fps: f64) {
        self.poses = keyframes.iter().map(|k| k.camera_from_world).collect();
        let given = |k: &Keyframe| Given {
            camera: Some(k.camera.clone()),
            time_s: k.time_s,
        };
        self.given = keyframes.iter().map(given).collect();
        self.passed_s = keyframes.iter().map(|k| k.t_s).collect();
        self.chosen = self.poses.len().saturating_sub(1);
        self.interpolation = interpolation;
        self.fps = fps;
        if let ([first, .., last], count) = (keyframes, keyframes.len()) {
            self.apart_s = (last.t_s - first.t_s) / (count - 1) as f64;
        }
        self.paced_s = self.apart_s;
    }
}

#[cfg(test)]
mod tests;
