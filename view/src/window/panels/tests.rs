use super::*;
use crate::content::{Content, Space, Times};
use crate::state::Action;
use egui::TextureId;
use proxy::Proxy;

/// There is no device to bring anything to.
fn discard(mut painted: Painted) {
    painted.textures.clear();
}

/// Whether a frame brings new letters to the device.
fn has_new_letters(painted: &Painted) -> bool {
    painted.textures.set.contains_key(&TextureId::default())
}

fn frame(panels: &mut Panels, size: (u32, u32), status: &Status, shows: &mut Shows) -> Painted {
    let mut state = State::new(Look::default());
    state.resize(size.0, size.1);
    for _ in 0..5 {
        state.act(Action::AddKeyframe);
    }
    let mut input = RawInput {
        max_texture_side: Some(TEXTURE_SIDE),
        ..RawInput::default()
    };
    panels.fit(&mut input, size);
    let sight = Sight {
        state: &mut state,
        shows,
        status,
        shown: None,
        plan: None,
    };
    panels.run(input, sight)
}

fn all_shown() -> Shows {
    Shows {
        help: true,
        ..Shows::fitting(2000.0)
    }
}

#[test]
fn warm_panels_draw_no_letter_anew() {
    for scale in [1.0, 1.25, 2.0] {
        let size = (1280, 800);
        let mut panels = Panels::warm(scale, size, TEXTURE_SIDE);
        let mut status = Status {
            said: Some("saved affine/official/façade_0123 – 4 × 5 … 7°".to_owned()),
            failed: Some("The quick brown fox JUMPS over; 8 \"lazy\" dogs? {[@#]}".to_owned()),
            ..Status::default()
        };
        let mut shows = all_shown();
        let first = frame(&mut panels, size, &status, &mut shows);
        assert!(has_new_letters(&first), "those that were drawn before");
        assert!(!first.primitives.is_empty());
        discard(first);
        for i in 0..5 {
            status.doing = Some(format!("{i} fitting, shuffling {:.3} ms", 1.7_f64.powi(i)));
            status.step_ms = f64::from(i) * 1.234;
            let next = frame(&mut panels, size, &status, &mut shows);
            assert!(!has_new_letters(&next), "scale {scale}, frame {i}");
            discard(next);
        }
    }
}

#[test]
fn where_panels_are_the_scene_has_no_buttons() {
    let size = (1280, 800);
    for scale in [1.0, 1.5] {
        let mut panels = Panels::warm(scale, size, TEXTURE_SIDE);
        let status = Status::default();
        let mut shows = all_shown();
        // More than once, as egui lays out by what was before; nobody points at anything.
        let mut lay_out = |shows: &mut Shows| {
            for _ in 0..3 {
                discard(frame(&mut panels, size, &status, shows));
            }
            let places = [(1150.0, 200.0), (640.0, 400.0), (40.0, 400.0)];
            places.map(|(x, y)| panels.takes(Pixel::new(x, y)))
        };
        assert_eq!(lay_out(&mut shows), [true, true, false], "panel and help");
        shows.panel = false;
        assert_eq!(lay_out(&mut shows), [false, true, false], "the help alone");
    }
}

#[test]
fn sliders_leave_alone_what_nobody_moves() {
    let size = (1280, 1600);
    let lumigraph = render::Lumigraph {
        points: Vec::new(),
        sources: Vec::new(),
        photos: render::PhotoStore::from_images(Vec::new()),
        proxy: proxy::Plane::new(glam::DVec3::Z, glam::DVec3::Z)
            .map(Proxy::Plane)
            .unwrap(),
        visibility: None,
    };
    let mut space = Space::of_scene(&lumigraph);
    let moment = render::Moment {
        time_s: 7.0,
        period_s: Some(2.0),
        window_s: None,
    };
    space.times = Some(Times {
        moment,
        range_s: [0.0, 2.0],
    });
    let method = render::Method::Triangulated { cells_across: 256 };
    let mut state = State::new(Look {
        method,
        exposure_stops: 0.05,
        ..Look::default()
    });
    state.resize(size.0, size.1);
    let _ = state.show(Content::Scene(Arc::new(lumigraph)), Arc::new(space));
    (state.alpha, state.beta) = (20.0, 5.0);
    state.keyframes.add(calibrate::Rigid3::IDENTITY, None);
    state.keyframes.apart_s = 15.03;
    let mut panels = Panels::warm(1.0, size, TEXTURE_SIDE);
    for _ in 0..3 {
        let mut input = RawInput {
            max_texture_side: Some(TEXTURE_SIDE),
            ..RawInput::default()
        };
        panels.fit(&mut input, size);
        let sight = Sight {
            state: &mut state,
            shows: &mut all_shown(),
            status: &Status::default(),
            shown: None,
            plan: None,
        };
        discard(panels.run(input, sight));
    }
    assert_eq!((state.alpha, state.beta), (20.0, 5.0));
    assert_eq!(state.keyframes.apart_s, 15.03);
    let look = &state.look;
    assert_eq!((look.method, look.moment), (method, Some(moment)));
    assert_eq!(look.exposure_stops, 0.05);
}

#[test]
fn any_size_and_scale_is_laid_out() {
    let status = Status {
        failed: Some("nothing\nto show".to_owned()),
        ..Status::default()
    };
    for scale in [0.5, 1.0, 3.0] {
        let mut panels = Panels::warm(scale, (300, 200), TEXTURE_SIDE);
        let before = Panels::warm(1.0, (0, 0), TEXTURE_SIDE);
        panels.take_over(&before);
        for size in [(0, 0), (1, 1), (0, 200), (200, 0), (16384, 3), (300, 200)] {
            for mut shows in [all_shown(), Shows::fitting(size.0 as f32)] {
                let painted = frame(&mut panels, size, &status, &mut shows);
                assert_eq!(painted.pixels_per_point, scale);
                let places = painted.primitives.iter().map(|p| p.clip_rect);
                assert!(places.into_iter().all(|rect| !rect.any_nan()));
                discard(painted);
            }
        }
    }
}
