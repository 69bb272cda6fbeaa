//! Corridors that open into a room as wide as they are.
//!
//! Their mouths are no bottlenecks: the distance to walls grows all the way into the room. But they
//! are long, closed at the other end, have walls, and widen at once.

use super::FindOptions;
use super::columns::Columns;
use super::regions::Labels;
use std::ops::Range;

/// A corridor is longer than this many times its width.
const LONG: f64 = 1.5;
/// Where it is wider than this many times its width it is no corridor any more, and the room that it
/// opens into is so wide soon after.
const WIDER: f64 = 1.3;
const WIDE: f64 = 2.0;
const SOON: f64 = 0.6;
/// So much of its sides is wall: what is seen through a window has none.
const WALLED: f64 = 0.35;

/// Makes dead ends that are corridors rooms of their own.
pub(super) fn split(columns: &Columns, found: &mut Labels, options: &FindOptions) {
    for axis in 0..2 {
        let [length, lines] = match axis {
            0 => columns.size,
            _ => [columns.size[1], columns.size[0]],
        };
        for is_back in [false, true] {
            let across = Across {
                columns,
                axis,
                length,
                lines,
                is_back,
            };
            for line in 0..lines {
                for run in across.runs(line, &found.labels) {
                    let Some(part) = across.corridor(line, run, &found.labels, options) else {
                        continue;
                    };
                    found.count += 1;
                    part.into_iter().for_each(|i| found.labels[i] = found.count);
                }
            }
        }
    }
}

/// The grid as lines across a corridor, one after the other along it.
struct Across<'a> {
    columns: &'a Columns,
    axis: usize,
    length: usize,
    lines: usize,
    is_back: bool,
}

impl Across<'_> {
    fn index(&self, line: usize, k: usize) -> usize {
        let line = if self.is_back {
            self.lines - 1 - line
        } else {
            line
        };
        match self.axis {
            0 => line * self.columns.size[0] + k,
            _ => k * self.columns.size[0] + line,
        }
    }

    /// A line's squares of one room each.
    fn runs(&self, line: usize, labels: &[u32]) -> Vec<Range<usize>> {
        let label = |k: usize| labels[self.index(line, k)];
        let mut runs = Vec::new();
        let mut start = 0;
        for k in 1..=self.length {
            if k == self.length || label(k) != label(start) {
                if label(start) != 0 {
                    runs.push(start..k);
                }
                start = k;
            }
        }
        runs
    }

    /// The longest of a line's runs beside one of the line before.
    fn beside(&self, line: usize, run: &Range<usize>, labels: &[u32], label: u32) -> Range<usize> {
        let is_mine = |r: &Range<usize>| {
            labels[self.index(line, r.start)] == label && r.start < run.end && run.start < r.end
        };
        let runs = self.runs(line, labels).into_iter().filter(is_mine);
        runs.max_by_key(|r| r.len()).unwrap_or(0..0)
    }

    /// The squares of a corridor whose closed end is a run.
    fn corridor(
        &self,
        first: usize,
        end: Range<usize>,
        labels: &[u32],
        options: &FindOptions,
    ) -> Option<Vec<usize>> {
        let columns = self.columns;
        let label = labels[self.index(first, end.start)];
        let most = columns.squares(options.max_passage);
        if first == 0 || end.len() as f64 > most {
            return None;
        }
        if !self.beside(first - 1, &end, labels, label).is_empty() {
            return None;
        }
        // 1. Along it to its mouth.
        let start = end.clone();
        let (mut run, mut line) = (end, first);
        let mut widths: Vec<usize> = Vec::new();
        let mut walls = 0;
        let width = loop {
            widths.push(run.len());
            let sides = [run.start.saturating_sub(1), run.end.min(self.length - 1)];
            let is_wall = |k: &usize| {
                let i = self.index(line, *k);
                columns.is_wall(i) || columns.is_lintel(i)
            };
            walls += sides.iter().filter(|k| is_wall(k)).count();
            if line + 1 == self.lines {
                return None;
            }
            let next = self.beside(line + 1, &run, labels, label);
            let mut sorted = widths.clone();
            sorted.sort_unstable();
            let width = sorted[sorted.len() / 2] as f64;
            let is_long = widths.len() as f64 >= LONG * width;
            if next.is_empty() || (!is_long && next.len() as f64 > most) {
                return None;
            }
            if is_long && next.len() as f64 > WIDER * width {
                break width;
            }
            (run, line) = (next, line + 1);
        };
        // 2. Whether what is beyond is wide, and this is walled.
        let mut beyond = run.clone();
        let mut widest = 0;
        for after in line + 1..self.lines.min(line + 1 + columns.squares(SOON) as usize) {
            beyond = self.beside(after, &beyond, labels, label);
            widest = widest.max(beyond.len());
        }
        let is_walled = walls as f64 >= WALLED * 2.0 * widths.len() as f64;
        if !is_walled || width > most || (widest as f64) < WIDE * width {
            return None;
        }
        // 3. All that is on this side of the mouth, which is where it is narrowest, and hangs together.
        let near = widths.len().saturating_sub(columns.squares(SOON) as usize);
        let narrowest = (near..widths.len()).rev().min_by_key(|k| widths[*k]);
        let mouth = first + narrowest.unwrap_or(near);
        let mut run = start;
        for line in first + 1..=mouth {
            run = self.beside(line, &run, labels, label);
        }
        let line_of = |i: usize| {
            let [x, y] = [i % columns.size[0], i / columns.size[0]];
            let line = if self.axis == 0 { y } else { x };
            if self.is_back {
                self.lines - 1 - line
            } else {
                line
            }
        };
        let mut is_in = vec![false; columns.count()];
        let mut part = vec![self.index(mouth, run.start)];
        is_in[part[0]] = true;
        let mut next = 0;
        while let Some(i) = part.get(next).copied() {
            next += 1;
            for j in columns.beside(i) {
                if labels[j] == label && !is_in[j] && line_of(j) <= mouth {
                    is_in[j] = true;
                    part.push(j);
                }
            }
        }
        let size = part.len() as f64;
        let area = size * columns.step_m * columns.step_m;
        // Another way into the room, and it is no dead end.
        let is_dead_end = size <= WIDER * width * widths.len() as f64;
        (is_dead_end && area >= options.min_area).then_some(part)
    }
}
