//! Scenes that try to break things, and what must hold of every one.

mod layered;
mod rounding;
mod scene;

pub use rounding::{Rounding, quantile};
pub use scene::{Case, Placement};

use super::Random;
use glam::DVec3;
use image::RgbaImage;
use render::blend::SAME_RAY;
use render::score::on_black;
use render::{FieldOptions, Frame, MAX_CONTRIBUTORS, Method, RenderError, Skips, cpu, reference};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

/// What became of a scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// All held.
    Held,
    /// What did not, with figures.
    Broken(String),
    /// Its message.
    Panicked(String),
    /// Nothing came back.
    Hung,
}

/// Of pixels that differ by more than [`STEPS`] between two drawings that should be the same, the
/// share allowed: edges of what a photo has, or of a surface, fall on one side of a pixel's centre
/// or the other.
const SHARE: f64 = 0.02;
const STEPS: u8 = 3;
/// Where the smallest change may change what is seen, and f32 says otherwise than f64.
const SHARE_ON_EDGE: f64 = 0.05;
const STEPS_ON_EDGE: u8 = 10;
/// Differences that are nearer to one another, relatively, f32 may take for any of them.
const TIED: f64 = 1e-4;
/// Where the surface is made anew for each view out of few points, one of which may come or go.
const SHARE_OF_POINTS: f64 = 0.1;

/// Draws a scene in every way and checks what must hold:
///
/// - weights are finite, not negative and sum to one, or there are none;
/// - the CPU's exact picture is the reference's;
/// - the triangulated picture can be drawn, and is the same bytes on one thread and with every view
///   asked;
/// - the world moved, turned and scaled, and the photos in another order, give the same picture.
///
/// Of a layered depth image, too: see `layered.rs`.
///
/// The last, and f32 against f64, is not asked of pixels where more views tie than may contribute, nor
/// are worlds moved where the smallest change changes what is seen.
///
/// # Errors
/// What does not hold, with figures.
pub fn check(seed: u64) -> Result<(), String> {
    layered::check(seed)?;
    let case = Case::new(seed, &Placement::OWN);
    let named = |what: &str| format!("{}: {what}", case.name);
    let drawn = |error: RenderError| named(&error.to_string());
    let frame = Frame::new(
        &case.lumigraph,
        case.desired.clone(),
        FieldOptions::default(),
    );
    weights(&frame, seed).map_err(|what| named(&what))?;

    let exact = cpu::render(&frame, Method::Exact).map_err(drawn)?;
    let truth = reference::render_exact(&frame).map_err(|e| named(&e.to_string()))?;
    let share = if case.lumigraph.points.is_empty() {
        SHARE
    } else {
        SHARE_OF_POINTS
    };
    let tied = tied(&frame);
    let rounded = match case.is_on_edge {
        true => (SHARE_ON_EDGE, STEPS_ON_EDGE),
        false => (SHARE, STEPS),
    };
    same(&exact, &truth, &tied, rounded)
        .map_err(|what| named(&format!("CPU and reference: {what}")))?;

    // The triangulation refuses views that are too wide; what it draws it draws the same.
    let again = Frame::new(
        &case.lumigraph,
        case.desired.clone(),
        FieldOptions::default(),
    );
    match (
        cpu::render(&frame, Method::TRIANGULATED),
        on_one_thread(|| cpu::render(&again, Method::TRIANGULATED))?,
    ) {
        (Ok(many), Ok(one)) if many == one => {}
        (Err(RenderError::Triangulation(_)), Err(RenderError::Triangulation(_))) => {}
        (many, one) => {
            let text = |r: Result<RgbaImage, RenderError>| r.err().map(|e| e.to_string());
            let (many, one) = (text(many), text(one));
            return Err(named(&format!("threads matter: {many:?}, {one:?}")));
        }
    }
    let asking = Frame::new(
        &case.lumigraph,
        case.desired.clone(),
        FieldOptions::default(),
    );
    let asking = cpu::render(&asking.skipping(Skips::NONE), Method::Exact).map_err(drawn)?;
    if asking != exact {
        return Err(named("a skip changes the picture"));
    }

    let other = exact_picture(&Case::reversed(seed)).map_err(drawn)?;
    same(&other, &exact, &tied, (share, STEPS)).map_err(|what| named(&format!("order: {what}")))?;
    if case.is_on_edge {
        return Ok(());
    }
    let placement = placement(seed);
    let moved = exact_picture(&Case::new(seed, &placement)).map_err(drawn)?;
    same(&moved, &exact, &tied, (share, STEPS))
        .map_err(|what| named(&format!("moved by {placement:?}: {what}")))
}

/// [`check`] on a thread of its own, given up after a while. (A thread that hangs goes on.)
pub fn watched(seed: u64, patience: Duration) -> Outcome {
    let (sender, receiver) = channel();
    let body = move || {
        // Fails only where nobody waits any more.
        let _ = sender.send(check(seed));
    };
    let builder = std::thread::Builder::new().name(format!("stress {seed}"));
    let thread = match builder.spawn(body) {
        Ok(thread) => thread,
        Err(error) => return Outcome::Broken(error.to_string()),
    };
    match receiver.recv_timeout(patience) {
        Ok(Ok(())) => Outcome::Held,
        Ok(Err(what)) => Outcome::Broken(what),
        Err(RecvTimeoutError::Timeout) => Outcome::Hung,
        Err(RecvTimeoutError::Disconnected) => {
            let panic = thread.join().err();
            let text = panic.and_then(|panic| {
                let text = panic.downcast_ref::<String>().cloned();
                text.or_else(|| panic.downcast_ref::<&str>().map(|t| (*t).to_owned()))
            });
            Outcome::Panicked(text.unwrap_or_default())
        }
    }
}

fn exact_picture(case: &Case) -> Result<RgbaImage, RenderError> {
    let options = FieldOptions::default();
    let frame = Frame::new(&case.lumigraph, case.desired.clone(), options);
    cpu::render(&frame, Method::Exact)
}

fn on_one_thread<T: Send>(work: impl FnOnce() -> T + Send) -> Result<T, String> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    Ok(pool.map_err(|error| error.to_string())?.install(work))
}

/// Far off, or another size; both together take more digits than there are.
fn placement(seed: u64) -> Placement {
    let mut random = Random(!seed);
    let is_far = random.below(2) == 0;
    let scale = if is_far {
        1.0
    } else {
        10.0_f64.powf(random.within(-6.0, 6.0))
    };
    let reach = if is_far {
        10.0_f64.powf(random.within(0.0, 7.0))
    } else {
        scale
    };
    Placement {
        scale,
        rotation: random.rotation(),
        translation: random.vector(1.0).normalize_or(DVec3::X) * reach,
    }
}

/// Where more views tie than may contribute, pixel by pixel: the first in order do.
fn tied(frame: &Frame<'_>) -> Vec<bool> {
    let (width, height) = (frame.desired.width, frame.desired.height);
    let places = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let is_tied_at = |(x, y): (u32, u32)| {
        let point = frame.proxy_point(calibrate::Pixel::center_of(x, y))?;
        let sees = |i: &usize| {
            let pixel = frame.project(*i, &point);
            pixel.is_some_and(|pixel| frame.fov_blend(*i, pixel) > 0.0)
        };
        let seeing = frame.taking_part().filter(sees);
        let mut diffs: Vec<f64> = seeing.map(|i| frame.difference(i, &point)).collect();
        diffs.sort_by(f64::total_cmp);
        let beyond = *diffs.get(MAX_CONTRIBUTORS)?;
        (beyond <= SAME_RAY.max(diffs[0] * (1.0 + TIED))).then_some(())
    };
    places.map(|place| is_tied_at(place).is_some()).collect()
}

fn weights(frame: &Frame<'_>, seed: u64) -> Result<(), String> {
    let mut random = Random(seed ^ 0x5eed);
    for _ in 0..40 {
        let (width, height) = (frame.desired.width, frame.desired.height);
        let pixel = calibrate::Pixel::new(
            random.within(0.0, f64::from(width)),
            random.within(0.0, f64::from(height)),
        );
        let Some(point) = frame.proxy_point(pixel) else {
            continue;
        };
        let contributors = reference::blend_at(frame, &point);
        let sum: f64 = contributors.iter().map(|c| c.weight).sum();
        let is_sound = |c: &render::blend::Contributor| c.weight >= 0.0 && c.weight.is_finite();
        if !contributors.iter().all(is_sound) {
            return Err(format!("weights at {pixel:?}: {contributors:?}"));
        }
        if !contributors.is_empty() && (sum - 1.0).abs() > 1e-9 {
            return Err(format!("weights at {pixel:?} sum to {sum}"));
        }
    }
    Ok(())
}

/// `share`: of the pixels, so many may be off by more than so many steps. Those that are tied may be off.
fn same(
    ours: &RgbaImage,
    theirs: &RgbaImage,
    tied: &[bool],
    (share, steps): (f64, u8),
) -> Result<(), String> {
    let colors = on_black(ours).into_iter().zip(on_black(theirs));
    let of_color = colors.map(|(a, b)| (0..3).map(|c| a[c].abs_diff(b[c])).fold(0, u8::max));
    let alphas = ours.pixels().zip(theirs.pixels());
    let of_alpha = alphas.map(|(a, b)| a.0[3].abs_diff(b.0[3]));
    let apart = of_color.zip(of_alpha).map(|(c, a)| c.max(a));
    let asked: Vec<u8> = apart
        .zip(tied)
        .filter_map(|(apart, tied)| (!tied).then_some(apart))
        .collect();
    let off = asked.iter().filter(|d| **d > steps).count();
    let most = asked.iter().max().copied().unwrap_or(0);
    if off as f64 > share * tied.len() as f64 {
        let of = asked.len();
        return Err(format!(
            "{off} of {of} pixels differ by more than {steps}, by {most} at most"
        ));
    }
    Ok(())
}
