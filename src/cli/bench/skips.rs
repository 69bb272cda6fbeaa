//! What it takes to begin, and what leaving things out is worth.

use super::measured::{Skip, StartUp};
use super::settings::Setting;
use super::times::{Times, timed};
use super::variants::Variants;
use calibrate::{Distortion, View};
use image::RgbaImage;
use render::{DeviceChoice, Engine, Frame, Lumigraph, Method, Prepared, Skips, SourceView};
use std::time::Instant;

/// From the command to the first picture; some of it was timed before.
pub(super) fn start_up(
    engine: &mut Engine,
    variants: &Variants<'_>,
    view: &View,
    [read_ms, exposure_ms, fit_ms]: [f64; 3],
) -> anyhow::Result<StartUp> {
    let default = &Setting::default_one();
    let start = Instant::now();
    let lumigraph = variants.lumigraph(default)?;
    let frame = Frame::new(&lumigraph, view.clone(), default.options);
    let prepared = Prepared::new(&frame, Method::TRIANGULATED)?;
    let prepare_ms = 1e3 * start.elapsed().as_secs_f64();
    let (drawn, draw) = timed(|| engine.draw(&frame, &prepared));
    drawn?;
    // The floor.
    let fresh = variants.lumigraph(default)?;
    let used: Vec<usize> = (0..lumigraph.photos.len())
        .filter(|&i| lumigraph.photos.was_decoded(i))
        .collect();
    let decode_ms = decode_all(&fresh, &used)?;
    Ok(StartUp {
        read_ms,
        exposure_ms,
        fit_ms,
        prepare_ms,
        draw_ms: draw.wall_ms,
        decode_ms,
        photos_used: used.len(),
    })
}

/// Wall time of decoding photos on all threads, in milliseconds.
fn decode_all(lumigraph: &Lumigraph, photos: &[usize]) -> anyhow::Result<f64> {
    use rayon::prelude::*;
    let decode = |&i: &usize| lumigraph.photos.get(i).map(drop);
    let (decoded, times) = timed(|| photos.par_iter().map(decode).collect::<Result<(), _>>());
    decoded?;
    Ok(times.wall_ms)
}

/// Of skips that are measured, repeats.
const SKIP_REPEATS: usize = 5;

/// Draws a picture with and without something left out, in turn: their times, the pictures' bytes.
pub(super) fn skip(
    name: &str,
    fired: Option<String>,
    mut draw: impl FnMut(bool) -> anyhow::Result<(RgbaImage, Times)>,
) -> anyhow::Result<Skip> {
    let same_bytes = draw(true)?.0 == draw(false)?.0;
    let (mut with, mut without) = (Vec::new(), Vec::new());
    for _ in 0..SKIP_REPEATS {
        with.push(draw(true)?.1);
        without.push(draw(false)?.1);
    }
    Ok(Skip {
        name: name.to_owned(),
        fired,
        with: Times::median(&with),
        without: Times::median(&without),
        same_bytes,
    })
}

/// Each on its own, of the first view's triangulated picture by the CPU.
pub(super) fn skips(variants: &Variants<'_>, view: &View) -> anyhow::Result<Vec<Skip>> {
    let default = &Setting::default_one();
    let lumigraph = variants.lumigraph(default)?;
    let render = |lumigraph: &Lumigraph, skips: Skips| {
        let frame = Frame::new(lumigraph, view.clone(), default.options).skipping(skips);
        let picture = Engine::open(DeviceChoice::Cpu)?.render(&frame, Method::TRIANGULATED)?;
        Ok::<_, anyhow::Error>((picture, frame.scored().scorings))
    };
    let drawn = |skips: Skips| {
        let (drawn, times) = timed(|| render(&lumigraph, skips));
        Ok((drawn?.0, times))
    };
    let (_, few) = render(&lumigraph, Skips::ALL)?;
    let views = Skips {
        views: false,
        ..Skips::ALL
    };
    let (_, all) = render(&lumigraph, views)?;
    let (used, photos) = (lumigraph.photos.decoded(), lumigraph.photos.len());
    let pinhole = |s: &&SourceView| s.view.lens.distortion() == Distortion::None;
    let pinholes = lumigraph.sources.iter().filter(pinhole).count();
    let lenses = Skips {
        lenses: false,
        ..Skips::ALL
    };
    let or = |skips: bool, others: Skips| if skips { Skips::ALL } else { others };
    Ok(vec![
        // From photos on disk.
        skip(
            "photos",
            (used < photos).then(|| format!("{} of {photos} photos", photos - used)),
            |skips| {
                let fresh = variants.lumigraph(default)?;
                let (drawn, times) = timed(|| {
                    if !skips {
                        decode_all(&fresh, &(0..photos).collect::<Vec<_>>())?;
                    }
                    render(&fresh, Skips::ALL)
                });
                Ok((drawn?.0, times))
            },
        )?,
        skip(
            "views",
            (few < all).then(|| format!("{} of {all} scorings", all - few)),
            |skips| drawn(or(skips, views)),
        )?,
        skip(
            "lenses",
            (pinholes > 0).then(|| format!("{pinholes} of {photos} lenses")),
            |skips| drawn(or(skips, lenses)),
        )?,
    ])
}
