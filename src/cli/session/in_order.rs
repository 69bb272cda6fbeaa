//! Views drawn one after the other, each prepared while the one before is drawn, and written while the next one is.

use super::super::ledger::{Ledger, Stage};
use super::{Session, frame, say_notes};
use anyhow::bail;
use calibrate::View;
use image::RgbaImage;
use render::{Bounded, Method, Moment, decode_ahead, prepare_within};
use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread::ScopedJoinHandle;

/// A picture that was drawn and is yet to be taken, with its view's place.
type Drawn = Mutex<Option<(usize, RgbaImage)>>;

impl Session {
    /// Draws views, those that `order` names in that order from its place `done` on, which it moves, and gives
    /// each picture to `take`, in that order: one while the next one is drawn.
    ///
    /// # Errors
    /// The engine's, of the view at that place; of `take`.
    pub(super) fn draw_in_order(
        &mut self,
        views: &[(View, Option<Moment>)],
        order: &[usize],
        done: &mut usize,
        take: &mut (impl FnMut(usize, RgbaImage) -> anyhow::Result<()> + Send),
    ) -> anyhow::Result<()> {
        let last = Drawn::default();
        let drawn = self.draw_views(views, order, &last, done, take);
        // Whatever became of the next one. It is the earlier of both, and so is its error.
        take_last(&self.ledger, &last, done, take)?;
        drawn
    }

    /// The same, but for the picture that was drawn last.
    fn draw_views(
        &mut self,
        views: &[(View, Option<Moment>)],
        order: &[usize],
        last: &Drawn,
        done: &mut usize,
        take: &mut (impl FnMut(usize, RgbaImage) -> anyhow::Result<()> + Send),
    ) -> anyhow::Result<()> {
        let Some(engine) = &mut self.engine else {
            bail!("the engine was opened above");
        };
        let (lumigraph, options, method) = (&self.lumigraph, self.options, self.method);
        let (skips, max_error) = (self.skips, self.max_error);
        let (edge_samples, sharp) = (self.edge_samples, self.sharp);
        let ledger = &self.ledger;
        let ready = |i: usize| {
            let (view, moment) = &views[i];
            let frame = ledger.time(i, Stage::Surface, || {
                frame(lumigraph, view, options, moment.as_ref(), skips)
            });
            let prepared = match (max_error, method) {
                (None, Method::Exact) => Ok(Bounded::EXACT),
                (None, method) => {
                    ledger.time(i, Stage::Field, || Bounded::unmeasured(&frame, method))
                }
                (Some(max_error), _) => {
                    ledger.time(i, Stage::Field, || prepare_within(&frame, max_error))
                }
            };
            (frame, prepared)
        };
        let mut rest = order[*done..].iter().copied().peekable();
        let mut next = rest.next().map(|i| (i, ready(i)));
        while let Some((current, (frame, prepared))) = next {
            let chosen = prepared?;
            let prepared = &chosen.prepared;
            let mut without = engine.resident(&lumigraph.photos);
            without.extend(prepared.listed());
            let drawn = AtomicBool::new(false);
            // A mask that cannot be decoded must be found by the frame that asks for it.
            // Photos that are measured would take the current frame's room.
            let samples = max_error.is_some_and(f64::is_finite) && self.cpu_memory.is_some();
            let ahead = !lumigraph.photos.any_masked() && !samples;
            let coming = rest.peek().copied().filter(|_| ahead);
            let (picture, coming, taken) = std::thread::scope(|scope| {
                let prepare = |i| {
                    let (frame, prepared) = ready(i);
                    if let Ok(chosen) = &prepared {
                        let listed = chosen.prepared.listed();
                        ledger.time(i, Stage::Ahead, || {
                            decode_ahead(&frame, &listed, &without, &drawn);
                        });
                    }
                    (frame, prepared)
                };
                // Where there is no thread for them the next frame is prepared in its turn, and the last one
                // taken in its.
                let thread = std::thread::Builder::new;
                let coming =
                    coming.and_then(|i| thread().spawn_scoped(scope, move || prepare(i)).ok());
                let take = || take_last(ledger, last, done, take);
                let taken = thread().spawn_scoped(scope, take).ok();
                let mut draw = || -> anyhow::Result<RgbaImage> {
                    let ready =
                        ledger.time(current, Stage::Load, || engine.ready(&frame, prepared));
                    let picture = ready.and_then(|ready| {
                        let draw = || engine.draw_ready(&frame, prepared, &ready);
                        let picture = ledger.time(current, Stage::Draw, draw)?;
                        Ok((picture, ready))
                    });
                    drawn.store(true, Ordering::Relaxed);
                    say_notes(engine, &mut self.notes_said);
                    let (mut picture, was_ready) = picture?;
                    if views[current].1.is_some() {
                        self.in_window.note(frame.taking_part().count());
                    }
                    self.costs
                        .note(current, &frame, &chosen, engine, &was_ready, &picture);
                    let smooth = || engine.smooth(&frame, prepared, edge_samples, &mut picture);
                    let edge_pixels = ledger.time(current, Stage::Edges, smooth)?;
                    self.costs.note_edges(current, edge_pixels);
                    if !sharp {
                        let soften = || engine.soften(&frame, prepared, &mut picture);
                        let softened = ledger.time(current, Stage::Soften, soften)?;
                        self.costs.note_softened(current, softened);
                    }
                    Ok(picture)
                };
                let picture = draw();
                let coming = coming.map(ScopedJoinHandle::join);
                (picture, coming, taken.map(ScopedJoinHandle::join))
            });
            match taken.transpose() {
                Ok(taken) => taken.transpose()?,
                Err(panic) => resume_unwind(panic),
            };
            take_last(ledger, last, done, take)?;
            *locked(last) = Some((current, picture?));
            next = match coming.transpose() {
                Ok(coming) => rest.next().map(|i| (i, coming.unwrap_or_else(|| ready(i)))),
                Err(panic) => resume_unwind(panic),
            };
        }
        Ok(())
    }
}

fn locked(last: &Drawn) -> MutexGuard<'_, Option<(usize, RgbaImage)>> {
    last.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Gives the picture that was drawn last to `take`, if it was not yet, and moves `done`.
fn take_last(
    ledger: &Ledger,
    last: &Drawn,
    done: &mut usize,
    take: &mut impl FnMut(usize, RgbaImage) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    let Some((i, picture)) = locked(last).take() else {
        return Ok(());
    };
    ledger.time(i, Stage::Write, || take(i, picture))?;
    *done += 1;
    Ok(())
}
