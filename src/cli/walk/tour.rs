//! The tour of a walk that is given no path: planned, and kept as a path file.

use super::super::captured::{Opened, hash_of};
use super::super::output::{make_parent, say};
use super::{Args, FPS};
use anyhow::{Context, bail};
use calibrate::{Camera, Lens};
use capture::as_argument;
use glam::DVec2;
use proxy::interior::{CellId, Interior};
use proxy::shown_name;
use render::CameraPath;
use render::interior::Tour;
use render::path::{self, PathFileError};
use std::path::Path;

/// The tour's own size, that of Rafferty et al. 1998.
const SIZE: (u32, u32) = (640, 512);
const FRAMES: u32 = 520;
/// Eye heights a second of who walks: 1.4 m, where eyes are 1.6 m high.
const WALK: f64 = 0.875;
/// Times as fast as that, from which on it is told.
const FAST: f64 = 1.5;
/// Of a tour's camera, over the picture's width.
const FOCAL: f64 = 0.7;
/// The file that keeps it, in the folder for the frames.
const FILE: &str = "path.json";
/// What that file says of itself: a hash of the rest, which a path that people made does not have.
const KEY: &str = "tour";

/// Plans a tour through an interior, and says what is odd about it.
///
/// # Errors
/// There is no tour, or no place for its file; see [`keep`].
pub(super) fn plan(args: &Args, opened: &Opened) -> anyhow::Result<CameraPath> {
    let (interior, contents, model) = (&opened.interior, &opened.contents, &opened.model);
    let (width, height) = args.size.unwrap_or(SIZE);
    let size = DVec2::new(f64::from(width), f64::from(height));
    let lens = Lens::pinhole(DVec2::splat(FOCAL * size.x), 0.5 * size);
    let camera = Camera::of(&lens, width, height);
    let count = args.chosen().count(FRAMES) as usize;
    let planned = Tour::new(interior, contents, model, &camera, count, FPS)
        .with_context(|| args.interior.display().to_string())?;
    let speed = match count == FRAMES as usize {
        true => note_of_speed(length(&planned.path) / interior.eye_height),
        // Who chose another number may have meant it.
        false => None,
    };
    for note in notes_of(&planned, interior).into_iter().chain(speed) {
        say!("note: {note}");
    }
    // Before what may take long.
    check(&args.output.join(FILE), &planned.path)?;
    Ok(planned.path)
}

/// Fails where a tour would be written over a path other than a tour: keyframes that `view` saved lie in such
/// a file.
fn check(file: &Path, tour: &CameraPath) -> anyhow::Result<()> {
    if file.exists() && !may_be_replaced(file, tour) {
        let argument = as_argument(file);
        let file = file.display();
        bail!(
            "{file}: this is no tour that a walk wrote, and the tour would take its place; walk \
             it with --path {argument}, or choose another -o"
        );
    }
    Ok(())
}

/// Writes a tour beside the frames. Its place may be that of an earlier tour, and of nothing else.
pub(super) fn keep(args: &Args, tour: &CameraPath) -> anyhow::Result<()> {
    let file = args.output.join(FILE);
    check(&file, tour)?;
    make_parent(&file)?;
    let mut marked = tour.clone();
    marked.extra.insert(KEY.to_owned(), mark(tour)?.into());
    Ok(path::write(&file, &marked)?)
}

/// Whether a file is a tour as a walk wrote it, or has the same path as a new one.
fn may_be_replaced(file: &Path, tour: &CameraPath) -> bool {
    let Ok(mut found) = path::read(file) else {
        return false;
    };
    let said = found.extra.remove(KEY);
    let Ok(own) = mark(&found) else {
        return false;
    };
    said.is_some_and(|said| said == own) || mark(tour).is_ok_and(|new| new == own)
}

/// A hash of a path's file.
fn mark(path: &CameraPath) -> Result<String, PathFileError> {
    Ok(hash_of(&path::text(path)?))
}

/// How long a path is, in world units.
fn length(path: &CameraPath) -> f64 {
    let steps = path.frames.windows(2);
    steps
        .map(|pair| pair[0].view.center().distance(pair[1].view.center()))
        .sum()
}

/// What to say of a tour so many eye heights long, in as many frames as tours have, if it goes much faster than
/// people walk.
fn note_of_speed(length: f64) -> Option<String> {
    let frames = length / WALK * FPS;
    let faster = frames / f64::from(FRAMES);
    // To whole seconds.
    let enough = (frames / FPS).ceil() * FPS;
    (faster > FAST).then(|| {
        format!(
            "the tour is long: in {FRAMES} frames it goes {faster:.1} times as fast as people walk; --frames \
             {enough:.0} is a walk"
        )
    })
}

/// What is not as one would walk, a line each.
fn notes_of(tour: &Tour, interior: &Interior) -> Vec<String> {
    let cells =
        |ids: &[CellId]| -> Vec<&str> { ids.iter().map(|id| &*interior.cell(*id).name).collect() };
    let mut notes = Vec::new();
    if !tour.left_out.is_empty() {
        let names = shown_name(&cells(&tour.left_out).join(", "));
        notes.push(format!(
            "no opening leads to {names}; the tour leaves them out"
        ));
    }
    let portals = tour.shut.iter().map(|id| &*interior.portal(*id).name);
    let names: Vec<&str> = cells(&tour.blocked).into_iter().chain(portals).collect();
    if !names.is_empty() {
        let names = shown_name(&names.join(", "));
        notes.push(format!(
            "something at eye height is in the way in {names}; the tour goes straight through it"
        ));
    }
    notes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tours_that_go_much_faster_than_people_walk_are_told() {
        // 520 frames are 34.7 s, in which one walks 30 eye heights.
        for length in [0.0, 10.0, 45.0] {
            assert_eq!(note_of_speed(length), None, "{length}");
        }
        let said = note_of_speed(257.5).unwrap();
        let expected = "the tour is long: in 520 frames it goes 8.5 times as fast as people walk; --frames 4425 is \
                        a walk";
        assert_eq!(said, expected);
    }
}
