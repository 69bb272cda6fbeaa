use super::*;
use crate::content::Times;
use crate::content::tests::two_rooms;
use crate::picture::{Lines, Support};
use calibrate::Camera;
use egui::ColorImage;
use image::RgbaImage;
use proxy::{Plane, Proxy};
use render::path::{Interpolation, Keyframe};
use render::{Lumigraph, Moment, PhotoStore, SourceView};

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
        quarters: 0,
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
        mesh: Arc::default(),
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
fn a_film_with_lenses_of_its_own_zooms() {
    let mut state = looking_at_a_wall();
    let focal = |state: &State| state.view().unwrap().lens.mean_focal();
    let own = focal(&state);
    // On the spot, so that nothing but the lens changes; half as large as the window.
    let pose = state.view().unwrap().camera_from_world;
    let keyframe = |t_s: f64, focal: f64| Keyframe {
        t_s,
        camera_from_world: pose,
        camera: Camera::of(
            &Lens::pinhole(DVec2::splat(focal), DVec2::new(100.0, 75.0)),
            200,
            150,
        ),
        time_s: None,
    };
    let file = [keyframe(0.0, 100.0), keyframe(1.0, 300.0)];
    state.keyframes.load(&file, Interpolation::Linear, 10.0);
    let _ = state.wanted();
    state.act(Action::StepKeyframe(true));
    assert_eq!(focal(&state), 200.0);
    step(&mut state, 1.0);
    let _ = state.wanted();
    state.act(Action::Play);
    let (mut last, mut zooms) = (0.0, 0);
    while state.is_playing() {
        state.step(0.1);
        zooms += u32::from(focal(&state) > last);
        last = focal(&state);
        if last > 200.0 {
            assert!(state.wanted().is_some_and(|request| request.is_moving));
        }
    }
    assert_eq!((last, zooms), (600.0, 11));
    // Where one goes then one has the window's lens again.
    assert_eq!(state.pose(), &pose);
    state.hold(Motion::Left, true);
    step(&mut state, 0.1);
    state.let_go();
    assert_eq!(focal(&state), own);
    state.act(Action::StepKeyframe(false));
    assert_eq!(focal(&state), 600.0);
    state.act(Action::Go(0));
    assert_eq!(focal(&state), own);
}

#[test]
fn keyframes_are_of_the_moment_shown_and_show_theirs() {
    let content = wall();
    let mut space = Space::of(&content);
    space.times = Some(Times {
        moment: Moment {
            time_s: 0.5,
            period_s: Some(1.5),
            window_s: None,
        },
        range_s: [0.0, 2.0],
    });
    let mut state = State::new(Look::default());
    state.resize(400, 300);
    let _ = state.show(content, Arc::new(space));
    let shown_s = |state: &State| state.look.moment.unwrap().time_s;
    // As the slider does it.
    let slide = |state: &mut State, time_s| state.look.moment.as_mut().unwrap().time_s = time_s;
    // 1. Added and moved, on the spot.
    state.act(Action::AddKeyframe);
    slide(&mut state, 1.0);
    state.act(Action::AddKeyframe);
    let view = state.view().unwrap();
    let kept = |state: &State| -> Vec<Option<f64>> {
        let stored = state.keyframes.stored(&view).into_iter();
        stored.map(|keyframe| keyframe.time_s).collect()
    };
    assert_eq!(kept(&state), [0.5, 1.0].map(Some));
    slide(&mut state, 1.25);
    state.act(Action::PlaceKeyframe);
    assert_eq!(kept(&state), [0.5, 1.25].map(Some));
    // 2. One after the other.
    let _ = state.wanted();
    step(&mut state, 1.0);
    state.act(Action::StepKeyframe(false));
    let asked = state.wanted().unwrap();
    assert_eq!(asked.look.moment.unwrap().time_s, 0.5);
    assert!(asked.is_moving, "another moment");
    // 3. As a film.
    state.act(Action::Play);
    let mut times = Vec::new();
    while state.is_playing() {
        state.step(0.1);
        times.push(shown_s(&state));
    }
    assert!(times.is_sorted_by(|a, b| a < b), "{times:?}");
    assert_eq!((times[0], times.last()), (0.5, Some(&1.25)));
    // 4. Those without times leave the moment alone, and have none beside them.
    let mut untimed = state.keyframes.stored(&view);
    untimed
        .iter_mut()
        .for_each(|keyframe| keyframe.time_s = None);
    state.keyframes.load(&untimed, Interpolation::Linear, 30.0);
    state.act(Action::StepKeyframe(true));
    state.act(Action::Play);
    state.step(0.1);
    state.step(0.1);
    assert_eq!(shown_s(&state), 1.25);
    state.act(Action::AddKeyframe);
    assert_eq!(kept(&state), [None; 3]);
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
    // By the command line's greatest and the slider's least, too.
    (state.alpha, state.beta) = (0.1, render::MAX_BETA);
    let asked = state.wanted().unwrap();
    assert_eq!(asked.look.options.check(), Ok(()));
}

#[test]
fn the_grid_comes_back_with_the_triangulated_field() {
    let fine = Method::Triangulated { cells_across: 256 };
    let mut state = State::new(Look {
        method: fine,
        ..Look::default()
    });
    for is_exact in [true, true, false, false] {
        state.set_exact(is_exact);
        assert_eq!(state.look.method == Method::Exact, is_exact);
    }
    assert_eq!(state.look.method, fine);
    // It was exact from the beginning.
    let mut state = State::new(Look {
        method: Method::Exact,
        ..Look::default()
    });
    state.set_exact(false);
    assert_eq!(state.look.method, Method::TRIANGULATED);
}

#[test]
fn one_walks_in_a_house_at_eye_height() {
    let mut state = State::new(Look::default());
    state.resize(320, 240);
    state.show_alone(two_rooms());
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

#[test]
fn who_walks_is_dragged_aside_and_does_not_turn() {
    let mut state = State::new(Look::default());
    state.resize(320, 240);
    state.show_alone(two_rooms());
    let stops = state.space().unwrap().stops.clone();
    let at = Pixel::new(160.0, 120.0);
    let mut farthest = 0.0_f64;
    for stop in &stops {
        for aside in [-60.0, 60.0] {
            let start = stop.view.camera_from_world;
            state.be_at(start);
            state.press(Button::Other, at, false);
            state.point(Some(Pixel::new(at.x + aside, at.y + 20.0)));
            state.release(Button::Other);
            let rotation = state.pose().rotation;
            assert!(rotation.abs_diff_eq(start.rotation, 1e-9), "{rotation}");
            let way = state.pose().center() - start.center();
            assert!(way.y.abs() < 1e-9, "{way}");
            // What is under the cursor comes along.
            let right = start.rotation.conjugate() * DVec3::X;
            farthest = farthest.max(-aside.signum() * way.dot(right));
        }
    }
    assert!(farthest > 0.1, "{farthest}");
}

#[test]
fn in_a_room_its_own_stop_is_the_nearest_wherever_one_looks() {
    let content = two_rooms();
    let mut state = State::new(Look::default());
    state.resize(320, 240);
    state.show_alone(content.clone());
    let Content::Interior(house) = content else {
        unreachable!("two rooms are no photos");
    };
    let stops = state.space().unwrap().stops.clone();
    assert_eq!(stops.len(), 2);
    let poses = [0, 1].map(|i: usize| stops[i].view.camera_from_world);
    for here in [0, 1] {
        let (own, other) = (poses[here], poses[1 - here]);
        // As near to the other room as one gets, and looking as its stop does.
        let on_way = |share: f64| own.center().lerp(other.center(), share);
        let is_own = |eye: DVec3| {
            let cell = house.contents.locate(&house.interior, eye);
            cell.is_some() && cell == stops[here].cell
        };
        let shares = (0..=100).map(|i| f64::from(i) / 100.0);
        let last = shares.take_while(|share| is_own(on_way(*share))).last();
        let eye = on_way(last.unwrap());
        state.be_at(pose_of(other.rotation, eye));
        assert_eq!((state.stop(), state.nearest()), (None, Some(here)));
        state.act(Action::Home);
        step(&mut state, 2.0);
        assert!(state.pose().center().distance(own.center()) < 1e-9);
        // The next one is the other.
        state.be_at(pose_of(other.rotation, eye));
        state.act(Action::Next);
        assert_eq!(state.stop(), Some(1 - here));
        // Outside it is the nearest by place.
        let outside = own.center() + 50.0 * (own.center() - other.center());
        state.be_at(pose_of(other.rotation, outside));
        assert_eq!((state.cell(), state.nearest()), (None, Some(here)));
    }
}
