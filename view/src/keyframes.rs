//! A path in the making: keyframes, and where the preview is between them.

use calibrate::{Camera, Rigid3, View};
use render::path::{CameraPath, Interpolation, Keyframe, PathError};

/// Seconds from one keyframe to the next, unless one says otherwise.
const APART_S: f64 = 2.0;

/// Keyframes in order, and which is chosen.
#[derive(Clone, Debug, PartialEq)]
pub struct Keyframes {
    poses: Vec<Rigid3>,
    /// The scene's own time at each, where a file gave one.
    times_s: Vec<Option<f64>>,
    /// Which one, while there are any.
    chosen: usize,
    /// Seconds from one to the next.
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
            times_s: Vec::new(),
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

    /// Adds one after the chosen one, and chooses it. The scene's time is that of the chosen one:
    /// with one keyframe that has none, those of all others would not count.
    pub fn add(&mut self, pose: Rigid3) {
        let at = self.chosen().map_or(0, |i| i + 1);
        let time_s = self.times_s.get(self.chosen).copied().flatten();
        self.poses.insert(at, pose);
        self.times_s.insert(at, time_s);
        self.chosen = at;
    }

    /// Deletes the chosen one; the one before is chosen.
    pub fn delete(&mut self) {
        if self.chosen < self.poses.len() {
            self.poses.remove(self.chosen);
            self.times_s.remove(self.chosen);
        }
        self.chosen = self.chosen.saturating_sub(1);
    }

    /// Moves the chosen one to a pose.
    pub fn place(&mut self, pose: Rigid3) {
        if let Some(chosen) = self.poses.get_mut(self.chosen) {
            *chosen = pose;
        }
    }

    /// Moves the chosen one to an earlier or later place in the order.
    pub fn shift(&mut self, later: bool) {
        let to = match later {
            true => self.chosen + 1,
            false => self.chosen.wrapping_sub(1),
        };
        if to < self.poses.len() {
            self.poses.swap(self.chosen, to);
            self.times_s.swap(self.chosen, to);
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

    /// Seconds from the first to the last.
    pub fn duration_s(&self) -> f64 {
        self.poses.len().saturating_sub(1) as f64 * self.apart_s
    }

    /// As path files have them, for a camera with the lens and size of `view`.
    pub fn stored(&self, view: &View) -> Vec<Keyframe> {
        let camera = Camera::of(&view.lens, view.width, view.height);
        let keyframe = |(i, (pose, time_s)): (usize, (&Rigid3, &Option<f64>))| Keyframe {
            t_s: i as f64 * self.apart_s,
            camera_from_world: *pose,
            camera: camera.clone(),
            time_s: *time_s,
        };
        let keyframes = self.poses.iter().zip(&self.times_s);
        keyframes.enumerate().map(keyframe).collect()
    }

    /// The frames of the film.
    ///
    /// # Errors
    /// No keyframes; numbers that make no path.
    pub fn film(&self, view: &View) -> Result<CameraPath, PathError> {
        CameraPath::from_keyframes(&self.stored(view), self.interpolation, self.fps)
    }

    /// Takes over keyframes of a file, their times made even.
    pub fn load(&mut self, keyframes: &[Keyframe], interpolation: Interpolation, fps: f64) {
        self.poses = keyframes.iter().map(|k| k.camera_from_world).collect();
        self.times_s = keyframes.iter().map(|k| k.time_s).collect();
        self.chosen = self.poses.len().saturating_sub(1);
        self.interpolation = interpolation;
        self.fps = fps;
        if let ([first, .., last], count) = (keyframes, keyframes.len()) {
            self.apart_s = (last.t_s - first.t_s) / (count - 1) as f64;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use calibrate::Lens;
    use glam::{DVec2, DVec3};
    use render::PathFrame;

    fn view(x: f64) -> View {
        let view = View {
            lens: Lens::pinhole(DVec2::splat(31.7), DVec2::new(16.0, 12.0)),
            width: 32,
            height: 24,
            camera_from_world: Rigid3::looking_at(
                DVec3::X * x,
                DVec3::new(0.3, 0.2, 5.0),
                DVec3::Y,
            ),
        };
        PathFrame::of_view(String::new(), &view).unwrap().view
    }

    fn xs(keyframes: &Keyframes) -> Vec<i64> {
        let x = |p: &Rigid3| p.center().x.round() as i64;
        keyframes.poses().iter().map(x).collect()
    }

    #[test]
    fn keyframes_are_added_moved_and_deleted() {
        let mut keyframes = Keyframes::default();
        keyframes.delete();
        keyframes.shift(true);
        keyframes.place(view(9.0).camera_from_world);
        assert_eq!((keyframes.chosen(), keyframes.step(true)), (None, None));
        for x in [1.0, 2.0, 3.0] {
            keyframes.add(view(x).camera_from_world);
        }
        keyframes.choose(0);
        keyframes.add(view(5.0).camera_from_world);
        assert_eq!(
            (xs(&keyframes), keyframes.chosen()),
            (vec![1, 5, 2, 3], Some(1))
        );
        keyframes.shift(true);
        assert_eq!(xs(&keyframes), [1, 2, 5, 3]);
        keyframes.place(view(7.0).camera_from_world);
        keyframes.shift(true);
        keyframes.shift(true);
        assert_eq!(
            (xs(&keyframes), keyframes.chosen()),
            (vec![1, 2, 3, 7], Some(3))
        );
        assert_eq!(keyframes.step(true), Some(view(1.0).camera_from_world));
        assert_eq!(keyframes.step(false), Some(view(7.0).camera_from_world));
        keyframes.delete();
        keyframes.choose(0);
        keyframes.delete();
        assert_eq!((xs(&keyframes), keyframes.chosen()), (vec![2, 3], Some(0)));
        assert_eq!(keyframes.duration_s(), 2.0);
    }

    #[test]
    fn a_film_passes_the_keyframes_themselves() {
        let mut keyframes = Keyframes::default();
        assert!(keyframes.film(&view(0.0)).is_err());
        for x in [0.0, 1.0, 3.0] {
            keyframes.add(view(x).camera_from_world);
        }
        let film = keyframes.film(&view(0.0)).unwrap();
        assert_eq!(film.frames.len(), 121);
        for (i, x) in [(0, 0.0), (60, 1.0), (120, 3.0)] {
            assert_eq!(film.frames[i].view, view(x));
        }
        let mut again = Keyframes::default();
        again.load(&keyframes.stored(&view(0.0)), Interpolation::Spline, 30.0);
        assert_eq!(again, keyframes);
        again.choose(0);
        assert!(again.is_same_path(&keyframes) && again != keyframes);
        again.shift(true);
        assert!(!again.is_same_path(&keyframes));
    }

    #[test]
    fn the_scenes_times_go_with_their_keyframes() {
        let mut keyframes = Keyframes::default();
        for x in [0.0, 1.0, 2.0] {
            keyframes.add(view(x).camera_from_world);
        }
        let mut stored = keyframes.stored(&view(0.0));
        for (i, keyframe) in stored.iter_mut().enumerate() {
            keyframe.time_s = Some(10.0 * i as f64);
        }
        keyframes.load(&stored, Interpolation::Spline, 30.0);
        assert_eq!(keyframes.stored(&view(0.0)), stored);
        keyframes.choose(1);
        keyframes.shift(false);
        keyframes.add(view(5.0).camera_from_world);
        keyframes.choose(3);
        keyframes.delete();
        assert_eq!(xs(&keyframes), [1, 5, 0]);
        let times = keyframes.stored(&view(0.0)).into_iter().map(|k| k.time_s);
        assert_eq!(times.collect::<Vec<_>>(), [10.0, 10.0, 0.0].map(Some));
    }
}
