use super::*;
use calibrate::{Lens, ModelKind};
use glam::{DVec2, DVec3};
use render::PathFrame;

fn view(x: f64) -> View {
    let view = View {
        lens: Lens::pinhole(DVec2::splat(31.7), DVec2::new(16.0, 12.0)),
        width: 32,
        height: 24,
        camera_from_world: Rigid3::looking_at(DVec3::X * x, DVec3::new(0.3, 0.2, 5.0), DVec3::Y),
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
    keyframes.place(view(9.0).camera_from_world, None);
    assert_eq!((keyframes.chosen(), keyframes.step(true)), (None, None));
    for x in [1.0, 2.0, 3.0] {
        keyframes.add(view(x).camera_from_world, None);
    }
    keyframes.choose(0);
    keyframes.add(view(5.0).camera_from_world, None);
    assert_eq!(
        (xs(&keyframes), keyframes.chosen()),
        (vec![1, 5, 2, 3], Some(1))
    );
    keyframes.shift(true);
    assert_eq!(xs(&keyframes), [1, 2, 5, 3]);
    keyframes.place(view(7.0).camera_from_world, None);
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
        keyframes.add(view(x).camera_from_world, None);
    }
    let film = keyframes.film(&view(0.0)).unwrap();
    assert_eq!(film.frames.len(), 121);
    for (i, x) in [(0, 0.0), (60, 1.0), (120, 3.0)] {
        assert_eq!(film.frames[i].view, view(x));
    }
    let stored = keyframes.stored(&view(0.0));
    let mut again = Keyframes::default();
    again.load(&stored, Interpolation::Spline, 30.0);
    assert_eq!(again.poses(), keyframes.poses());
    assert_eq!(again.chosen(), keyframes.chosen());
    // In whatever window.
    let mut larger = view(0.0);
    (larger.width, larger.height) = (64, 48);
    assert_eq!(again.stored(&larger), stored);
    assert_eq!(again.film(&larger), keyframes.film(&view(0.0)));
    for mut keyframes in [keyframes, again] {
        let same = keyframes.clone();
        keyframes.choose(0);
        assert!(keyframes.is_same_path(&same) && keyframes != same);
        keyframes.shift(true);
        assert!(!keyframes.is_same_path(&same));
    }
}

#[test]
fn lenses_and_times_of_a_file_stay_as_they_are() {
    let keyframe = |t_s: f64, focal: f64| Keyframe {
        t_s,
        camera_from_world: view(t_s).camera_from_world,
        camera: Camera {
            model: ModelKind::OpenCv,
            width: 64,
            height: 48,
            params: vec![focal, focal, 32.0, 24.0, 0.01, 0.0, 0.0, 0.0],
        },
        time_s: None,
    };
    let file = [(1.0, 30.0), (1.5, 60.0), (4.0, 45.0)].map(|(t_s, f)| keyframe(t_s, f));
    let mut keyframes = Keyframes::default();
    assert!(!keyframes.has_lenses() && keyframes.framing().is_none());
    keyframes.load(&file, Interpolation::Linear, 4.0);
    assert_eq!(keyframes.stored(&view(0.0)), file);
    assert_eq!(keyframes.duration_s(), 3.0);
    let film = CameraPath::from_keyframes(&file, Interpolation::Linear, 4.0);
    assert_eq!(keyframes.film(&view(0.0)), film);
    assert_eq!(film.unwrap().frames[1].camera.params[0], 45.0);
    assert_eq!(keyframes.framing().unwrap().lens.mean_focal(), 45.0);
    // Longer ways, each in its proportion.
    let passed_s = |keyframes: &Keyframes| {
        let stored = keyframes.stored(&view(0.0));
        let rounded = stored.iter().map(|k| (1e6 * k.t_s).round() / 1e6);
        rounded.collect::<Vec<_>>()
    };
    let mut longer = keyframes.clone();
    longer.apart_s *= 2.0;
    assert_eq!(passed_s(&longer), [1.0, 2.0, 7.0]);
    assert!(!longer.is_same_path(&keyframes));
    longer.apart_s = keyframes.apart_s;
    assert_eq!(longer, keyframes);
    // Another has the chosen one's lens, and takes as long as others do in the mean.
    keyframes.choose(1);
    keyframes.add(view(9.0).camera_from_world, None);
    assert_eq!(passed_s(&keyframes), [1.0, 1.5, 3.0, 5.5]);
    let focal = |k: &Keyframe| k.camera.params[0];
    let focals = |keyframes: &Keyframes| -> Vec<f64> {
        keyframes.stored(&view(0.0)).iter().map(focal).collect()
    };
    assert_eq!(focals(&keyframes), [30.0, 60.0, 60.0, 45.0]);
    assert!(keyframes.film(&view(0.0)).is_ok());
    // Lenses go with their keyframes, times stay with their places.
    keyframes.shift(true);
    assert_eq!(focals(&keyframes), [30.0, 60.0, 45.0, 60.0]);
    assert_eq!(passed_s(&keyframes), [1.0, 1.5, 3.0, 5.5]);
    keyframes.delete();
    keyframes.choose(0);
    keyframes.delete();
    assert_eq!(focals(&keyframes), [60.0, 45.0]);
    assert_eq!(passed_s(&keyframes), [1.0, 2.5]);
    // Where none is left, those that come have the window's.
    keyframes.delete();
    keyframes.delete();
    keyframes.add(view(0.0).camera_from_world, None);
    assert!(!keyframes.has_lenses() && keyframes.duration_s() == 0.0);
}

#[test]
fn the_scenes_times_go_with_their_keyframes() {
    let mut keyframes = Keyframes::default();
    for x in [0.0, 1.0, 2.0] {
        keyframes.add(view(x).camera_from_world, None);
    }
    let mut stored = keyframes.stored(&view(0.0));
    for (i, keyframe) in stored.iter_mut().enumerate() {
        keyframe.time_s = Some(10.0 * i as f64);
    }
    keyframes.load(&stored, Interpolation::Spline, 30.0);
    assert_eq!(keyframes.stored(&view(0.0)), stored);
    keyframes.choose(1);
    keyframes.shift(false);
    keyframes.add(view(5.0).camera_from_world, None);
    keyframes.choose(3);
    keyframes.delete();
    assert_eq!(xs(&keyframes), [1, 5, 0]);
    let times = keyframes.stored(&view(0.0)).into_iter().map(|k| k.time_s);
    assert_eq!(times.collect::<Vec<_>>(), [10.0, 10.0, 0.0].map(Some));
}

#[test]
fn the_times_shown_are_kept_where_all_have_one() {
    let mut keyframes = Keyframes::default();
    let times = |keyframes: &Keyframes| -> Vec<Option<f64>> {
        let stored = keyframes.stored(&view(0.0)).into_iter();
        stored.map(|k| k.time_s).collect()
    };
    assert!(!keyframes.has_scene_times() && keyframes.scene_time_s().is_none());
    for time_s in [Some(3.0), Some(4.0), None] {
        keyframes.add(view(0.0).camera_from_world, time_s);
    }
    assert_eq!(times(&keyframes), [3.0, 4.0, 4.0].map(Some));
    keyframes.place(view(1.0).camera_from_world, Some(9.0));
    assert_eq!(keyframes.scene_time_s(), Some(9.0));
    keyframes.place(view(2.0).camera_from_world, None);
    assert_eq!(times(&keyframes), [3.0, 4.0, 9.0].map(Some));
    assert!(keyframes.has_scene_times() && keyframes.film(&view(0.0)).is_ok());
    // Beside those that have none nothing has one.
    let mut keyframes = Keyframes::default();
    keyframes.add(view(0.0).camera_from_world, None);
    keyframes.add(view(0.0).camera_from_world, Some(5.0));
    keyframes.place(view(1.0).camera_from_world, Some(5.0));
    assert_eq!(times(&keyframes), [None, None]);
    keyframes.delete();
    keyframes.place(view(1.0).camera_from_world, Some(5.0));
    assert_eq!(times(&keyframes), [Some(5.0)]);
}
