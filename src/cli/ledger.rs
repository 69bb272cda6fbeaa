//! What time goes into, stage by stage and frame by frame.

use cpu_time::ProcessTime;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// What is done for a frame, in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stage {
    /// The photos' cameras relative to the view, and the proxy as it sees it.
    Surface,
    /// The triangulated field.
    Field,
    /// Decoding photos while the frame before is drawn.
    Ahead,
    /// Decoding the rest and bringing them to a graphics device.
    Load,
    /// Drawing. On the CPU photos that were not decoded ahead are decoded meanwhile.
    Draw,
    /// Drawing pixels anew at which the proxy jumps.
    Edges,
    /// Drawing what no photo shows softly, and what they contradict each other of.
    Soften,
    /// Writing the picture.
    Write,
}

const STAGES: [(Stage, &str); 8] = [
    (Stage::Surface, "surface"),
    (Stage::Field, "field"),
    (Stage::Ahead, "ahead"),
    (Stage::Load, "load"),
    (Stage::Draw, "draw"),
    (Stage::Edges, "edges"),
    (Stage::Soften, "soften"),
    (Stage::Write, "write"),
];

#[derive(Clone, Copy, Debug, Default)]
struct Spent {
    wall: Duration,
    cpu: Duration,
}

/// What each stage of a frame, or of all, has taken.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Stages([Spent; STAGES.len()]);

impl Stages {
    fn add(&mut self, other: &Self) {
        for (spent, more) in self.0.iter_mut().zip(other.0) {
            spent.wall += more.wall;
            spent.cpu += more.cpu;
        }
    }

    pub(super) fn json(&self) -> Value {
        let each = STAGES.iter().zip(self.0).map(|((_, name), spent)| {
            let of = json!({
                "seconds": spent.wall.as_secs_f64(),
                "cpu_seconds": spent.cpu.as_secs_f64(),
            });
            ((*name).to_owned(), of)
        });
        Value::Object(each.collect::<Map<String, Value>>())
    }

    /// `field 0.2 (0.4)`, for those that took any time.
    pub(super) fn text(&self) -> String {
        let each = STAGES.iter().zip(self.0).filter(|(_, s)| !s.wall.is_zero());
        let text = each.map(|((_, name), spent)| {
            let [wall, cpu] = [spent.wall, spent.cpu].map(|t| t.as_secs_f64());
            format!("{name} {wall:.2} ({cpu:.2})")
        });
        text.collect::<Vec<_>>().join(", ")
    }
}

/// Takes the time of stages that may run at once. The processor's time is the process': where
/// two stages run at once, each is given half of it, so that their sum is what was spent.
#[derive(Debug)]
pub(super) struct Ledger(Mutex<Book>);

#[derive(Debug)]
struct Book {
    /// Up to which the processor's time is shared out.
    then: ProcessTime,
    active: Vec<(usize, Stage)>,
    frames: BTreeMap<usize, Stages>,
}

impl Ledger {
    pub(super) fn new() -> Self {
        Self(Mutex::new(Book {
            then: ProcessTime::now(),
            active: Vec::new(),
            frames: BTreeMap::new(),
        }))
    }

    /// Does a frame's stage and takes the time.
    pub(super) fn time<T>(&self, frame_idx: usize, stage: Stage, work: impl FnOnce() -> T) -> T {
        let entry = (frame_idx, stage);
        self.turn(|book| book.active.push(entry));
        let start = Instant::now();
        let done = work();
        let wall = start.elapsed();
        self.turn(|book| {
            if let Some(at) = book.active.iter().position(|active| *active == entry) {
                book.active.swap_remove(at);
            }
            book.of(entry).wall += wall;
        });
        done
    }

    /// Shares out the processor's time until now, then changes what is going on.
    fn turn(&self, change: impl FnOnce(&mut Book)) {
        let mut book = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let now = ProcessTime::now();
        let passed = now.duration_since(book.then);
        book.then = now;
        let active = book.active.clone();
        for entry in &active {
            book.of(*entry).cpu += passed / active.len() as u32;
        }
        change(&mut book);
    }

    pub(super) fn of_frame(&self, frame_idx: usize) -> Stages {
        let book = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        book.frames.get(&frame_idx).copied().unwrap_or_default()
    }

    pub(super) fn total(&self) -> Stages {
        let book = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let mut total = Stages::default();
        book.frames.values().for_each(|stages| total.add(stages));
        total
    }
}

impl Book {
    fn of(&mut self, (frame_idx, stage): (usize, Stage)) -> &mut Spent {
        &mut self.frames.entry(frame_idx).or_default().0[stage as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stages_that_run_at_once_share_the_processors_time() {
        let ledger = Ledger::new();
        let before = ProcessTime::now();
        let work = || (0..3_000_000_u64).fold(1_u64, |a, i| a.wrapping_mul(i | 1) ^ i);
        ledger.time(0, Stage::Draw, || {
            work();
            std::thread::scope(|scope| {
                scope.spawn(|| ledger.time(1, Stage::Field, work));
            });
            ledger.time(1, Stage::Field, work);
        });
        let spent = before.elapsed();
        let total = ledger.total();
        let sum: Duration = total.0.iter().map(|s| s.cpu).sum();
        assert!(sum <= spent && !sum.is_zero());
        assert!(total.0[Stage::Draw as usize].wall >= ledger.of_frame(0).0[4].wall);
        assert!(ledger.of_frame(0).0[Stage::Field as usize].wall.is_zero());
        let json = total.json();
        assert!(json["field"]["seconds"].as_f64() > Some(0.0), "{json}");
        assert!(total.text().starts_with("field "), "{}", total.text());
    }

    #[test]
    fn stages_are_named_in_their_order() {
        for (i, (stage, _)) in STAGES.iter().enumerate() {
            assert_eq!(*stage as usize, i);
        }
    }
}
