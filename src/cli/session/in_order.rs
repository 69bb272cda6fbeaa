//! Views drawn one after the other, each prepared while the one before is drawn.

use super::super::ledger::Stage;
use super::{Session, frame, say_notes};
use anyhow::bail;
use calibrate::View;
use image::RgbaImage;
use render::{Bounded, Method, Moment, decode_ahead, prepare_within};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::ScopedJoinHandle;

impl Session {
    /// Draws views, those that `order` names in that order from its place `done` on, which it moves, and gives
    /// each picture to `take`.
    ///
    /// # Errors
    /// The engine's, of the view at that place; of `take`.
    pub(super) fn draw_in_order(
        &mut self,
        views: &[(View, Option<Moment>)],
        order: &[usize],
        done: &mut usize,
        take: &mut impl FnMut(usize, RgbaImage) -> anyhow::Result<()>,
    ) -> anyhow::Result<()> {
        let Some(engine) = &mut self.engine else {
            bail!("the engine was opened above");
        };
        let (lumigraph, options, method) = (&self.lumigraph, self.options, self.method);
        let (skips, max_error) = (self.skips, self.max_error);
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
        let mut next = order.get(*done).map(|i| ready(*i));
        while let Some((frame, prepared)) = next {
            let current = order[*done];
            let chosen = prepared?;
            let prepared = &chosen.prepared;
            let mut without = engine.resident(&lumigraph.photos);
            without.extend(prepared.listed());
            let drawn = AtomicBool::new(false);
            // A mask that cannot be decoded must be found by the frame that asks for it.
            // Photos that are measured would take the current frame's room.
            let samples = max_error.is_some_and(f64::is_finite) && self.cpu_memory.is_some();
            let ahead = !lumigraph.photos.any_masked() && !samples;
            let coming = order.get(*done + 1).copied().filter(|_| ahead);
            let (picture, coming) = std::thread::scope(|scope| {
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
                // Where there is no thread for it the next frame is prepared in its turn.
                let thread = std::thread::Builder::new();
                let coming =
                    coming.and_then(|i| thread.spawn_scoped(scope, move || prepare(i)).ok());
                let ready = ledger.time(current, Stage::Load, || engine.ready(&frame, prepared));
                let picture = ready.and_then(|ready| {
                    let draw = || engine.draw_ready(&frame, prepared, &ready);
                    let picture = ledger.time(current, Stage::Draw, draw)?;
                    Ok((picture, ready))
                });
                drawn.store(true, Ordering::Relaxed);
                (picture, coming.map(ScopedJoinHandle::join))
            });
            say_notes(engine, &mut self.notes_said);
            let (mut picture, was_ready) = picture?;
            if views[current].1.is_some() {
                self.in_window.note(frame.taking_part().count());
            }
            self.costs
                .note(current, &frame, &chosen, engine, &was_ready, &picture);
            let smooth = || engine.smooth(&frame, prepared, self.edge_samples, &mut picture);
            let edge_pixels = ledger.time(current, Stage::Edges, smooth)?;
            self.costs.note_edges(current, edge_pixels);
            if !self.sharp {
                let soften = || engine.soften(&frame, prepared, &mut picture);
                let softened = ledger.time(current, Stage::Soften, soften)?;
                self.costs.note_softened(current, softened);
            }
            ledger.time(current, Stage::Write, || take(current, picture))?;
            *done += 1;
            next = match coming.transpose() {
                Ok(None) => order.get(*done).map(|i| ready(*i)),
                Ok(next) => next,
                Err(panic) => std::panic::resume_unwind(panic),
            };
        }
        Ok(())
    }
}
