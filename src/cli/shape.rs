//! Pictures of a size that is asked for: whatever its shape, pixels stay square.

use super::output::say;
use anyhow::anyhow;
use calibrate::View;
use glam::DVec2;
use render::score::check_size;
use std::sync::Once;

/// Stretching by so little comes of rounding, and nobody sees it.
const UNSEEN: f64 = 0.01;

/// The view with so many pixels, where a size is asked for: of another shape than the view's own the middle
/// of it, cut out, as photos may show nothing of what is beside it. That is said, once a run.
pub(super) fn cut(view: View, asked: Option<(u32, u32)>) -> View {
    static SAID: Once = Once::new();
    let own = (view.width, view.height);
    let Some((width, height)) = asked.filter(|asked| *asked != own) else {
        return view;
    };
    if is_alike(own, (width, height)) {
        return view.resized(width, height);
    }
    let (own_size, size) = (sides(own), sides((width, height)));
    let scale = (size / own_size).max_element();
    let mut lens = view.lens.scaled(scale, scale);
    let gone = scale * own_size - size;
    lens.principal -= 0.5 * gone;
    SAID.call_once(|| {
        let shown = 100.0 * (size / (scale * own_size)).min_element();
        let side = if gone.x > gone.y { "width" } else { "height" };
        let (whole_width, whole_height) = within(own, (width, height));
        say!(
            "note: {width}x{height} has another shape than views of {}x{}: pictures show the middle \
             {shown:.0} % of their {side}, cut and not stretched; {whole_width}x{whole_height} shows all",
            own.0,
            own.1
        );
    });
    View {
        lens,
        width,
        height,
        ..view
    }
}

/// The view of a photo of this name that a picture is to be compared with, with so many pixels, where a size
/// is asked for: of another shape than the photo's, with as many as fit in it. That is said, once a run.
///
/// # Errors
/// Those are too few to be compared.
pub(super) fn compared(name: &str, view: View, asked: Option<(u32, u32)>) -> anyhow::Result<View> {
    let view = resized(view, asked);
    let remedy = match asked {
        Some(_) => "give a larger --size",
        None => "hold out larger photos",
    };
    check_size(view.width, view.height)
        .map_err(|error| anyhow!("photo {name}: {error}; {remedy}"))?;
    Ok(view)
}

fn resized(view: View, asked: Option<(u32, u32)>) -> View {
    static SAID: Once = Once::new();
    let own = (view.width, view.height);
    let Some(asked) = asked.filter(|asked| *asked != own) else {
        return view;
    };
    let (width, height) = match is_alike(own, asked) {
        true => asked,
        false => within(own, asked),
    };
    if (width, height) != asked {
        SAID.call_once(|| {
            say!(
                "note: {}x{} has another shape than photos of {}x{}: pictures that are compared \
                 with them have {width}x{height} pixels",
                asked.0,
                asked.1,
                own.0,
                own.1
            );
        });
    }
    view.resized(width, height)
}

fn sides((width, height): (u32, u32)) -> DVec2 {
    DVec2::new(width.into(), height.into())
}

/// Whether sizes have one shape, but for what rounding them to whole pixels does.
fn is_alike(own: (u32, u32), asked: (u32, u32)) -> bool {
    let (own, asked) = (sides(own), sides(asked));
    let scale = asked / own;
    let off = (asked - own * DVec2::new(scale.y, scale.x)).abs();
    (scale.x / scale.y - 1.0).abs() < UNSEEN || off.min_element() <= 0.5
}

/// The largest size of a shape that fits in another.
fn within(own: (u32, u32), asked: (u32, u32)) -> (u32, u32) {
    let (own, asked) = (sides(own), sides(asked));
    let size = (own * (asked / own).min_element()).round().max(DVec2::ONE);
    (size.x as u32, size.y as u32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use calibrate::{Distortion, Lens, Pixel, Rigid3};
    use glam::{DQuat, DVec3};

    fn view(width: u32, height: u32) -> View {
        let size = sides((width, height));
        let barrel = Distortion::Rational {
            k: [-0.1, 0.01, 0.0, 0.0, 0.0, 0.0],
            p: [1e-3, 0.0],
        };
        View {
            lens: Lens::new(
                DVec2::new(860.0, 855.0),
                size * DVec2::new(0.48, 0.51),
                barrel,
            ),
            width,
            height,
            camera_from_world: Rigid3::new(DQuat::from_rotation_y(0.3), DVec3::X),
        }
    }

    #[test]
    fn of_another_shape_the_middle_is_cut_out_and_nothing_is_stretched() {
        for (own, asked) in [
            ((562, 1000), (1280, 720)),
            ((1280, 720), (400, 300)),
            ((400, 300), (90, 320)),
        ] {
            let whole = view(own.0, own.1);
            let cut = cut(whole.clone(), Some(asked));
            assert_eq!((cut.width, cut.height), asked);
            let ratio = |view: &View| view.lens.focal.x / view.lens.focal.y;
            assert!((ratio(&cut) - ratio(&whole)).abs() < 1e-12);
            // What it shows at its borders, the whole view shows, too: along one side just so.
            let seen = |x: f64, y: f64| {
                let ray = cut.lens.unproject(Pixel::new(x, y)).unwrap();
                whole.lens.project(ray).unwrap()
            };
            let (first, last) = (seen(0.0, 0.0), seen(asked.0.into(), asked.1.into()));
            let size = sides(own);
            let margins = [first.x, first.y, size.x - last.x, size.y - last.y];
            assert!(margins.iter().all(|margin| *margin > -1e-6), "{margins:?}");
            let is_close = |a: f64, b: f64| (a - b).abs() < 1e-6;
            assert!(is_close(margins[0], margins[2]) && is_close(margins[1], margins[3]));
            assert!(margins[0].min(margins[1]) < 1e-6, "{margins:?}");
        }
    }

    #[test]
    fn sizes_of_one_shape_are_as_large_as_asked() {
        for (own, asked) in [
            ((640, 480), (80, 60)),
            ((96, 72), (47, 35)),
            ((1000, 751), (400, 300)),
            ((562, 1000), (9, 16)),
            ((97, 72), (97, 72)),
        ] {
            let whole = view(own.0, own.1);
            let expected = whole.resized(asked.0, asked.1);
            assert_eq!(resized(whole.clone(), Some(asked)), expected);
            assert_eq!(cut(whole, Some(asked)), expected);
        }
        let whole = view(97, 72);
        assert_eq!(cut(whole.clone(), None), whole);
        assert_eq!(resized(whole.clone(), None), whole);
    }

    #[test]
    fn beside_a_photo_a_picture_has_its_shape() {
        for (own, asked, expected) in [
            ((1000, 562), (320, 240), (320, 180)),
            ((562, 1000), (320, 240), (135, 240)),
            ((4000, 3), (100, 100), (100, 1)),
        ] {
            let whole = view(own.0, own.1);
            let found = resized(whole.clone(), Some(asked));
            assert_eq!(found, whole.resized(expected.0, expected.1));
        }
    }

    #[test]
    fn what_is_too_small_to_be_compared_is_told_with_what_helps() {
        let error = |asked| {
            let found = compared("a.png", view(100, 8), asked);
            found.unwrap_err().to_string()
        };
        assert_eq!(
            error(Some((50, 4))),
            "photo a.png: the pictures have 50 × 4 pixels; SSIM needs at least 11 × 11; give a larger \
             --size"
        );
        assert!(error(None).ends_with("; hold out larger photos"));
        let found = compared("a.png", view(100, 80), Some((50, 40)));
        assert_eq!(found.unwrap(), view(100, 80).resized(50, 40));
    }
}
