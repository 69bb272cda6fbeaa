//! What stands over each square of a floor grid.

use super::distance::squared_distances;
use super::grid::Grid;
use super::outline::{Bounds, squares};
use super::stubs;
use super::{Evidence, FindError, FindOptions, Level};
use glam::{DVec2, DVec3};
use rayon::prelude::*;

/// Heights are kept in bins of this, in metres, from [`BELOW`] the floor on.
pub(super) const BIN: f64 = 0.05;
const BELOW: f64 = 0.4;
const BINS: usize = 128;
/// What is lower or higher is nothing to a storey; in metres over the floor.
pub(super) const REACH: [f64; 2] = [-BELOW, BINS as f64 * BIN - BELOW];
/// What is taken here cannot be looked over by who stands; in metres over the floor.
pub(super) const EYE_BAND: [f64; 2] = [1.3, 1.9];
/// Lintels and beams begin at this, and so far below the ceiling.
const LINTEL: f64 = 2.15;
const BELOW_CEILING: [f64; 2] = [0.6, 0.12];
/// Ceilings are this high or higher.
pub(super) const LEAST_CEILING: f64 = 2.05;
/// A ceiling between these is too low to stand under, and the room's all the same, as below a sloped roof; metres.
const LOW_CEILING: [f64; 2] = [1.3, LEAST_CEILING];
/// So many bins of a column are of a slope at most, and not of something upright.
const SLOPE: u32 = 4;
/// Things at eye height that are joined to no wall and smaller than this do not divide a room.
const LOOSE: f64 = 1.5;
/// What is taken all the way up here is wall or screen; metres over the floor.
const TALL: [f64; 2] = [0.2, 2.0];
/// The floor under furniture is not there in a scan; so much of it is filled in.
const HIDDEN: f64 = 0.4;
/// Gaps between lines of sight are filled up to twice this; metres.
const UNSEEN: f64 = 0.15;
/// In a place whose floor has a ceiling over this share of it, where there is none is outside.
const CEILED: f64 = 0.5;

/// The bits of heights in metres.
pub(super) fn band([from, to]: [f64; 2]) -> u128 {
    let bin = |h: f64| ((h + BELOW) / BIN).round().clamp(0.0, BINS as f64) as u32;
    let below = |n: u32| match n {
        128.. => u128::MAX,
        n => (1_u128 << n) - 1,
    };
    below(bin(to)) & !below(bin(from))
}

/// The height of a bin's lower end in metres.
pub(super) fn height_of(bin: usize) -> f64 {
    bin as f64 * BIN - BELOW
}

/// The first bin at a height in metres, or after it.
pub(super) fn bin_at(height: f64) -> usize {
    ((height + BELOW) / BIN - 1e-6)
        .ceil()
        .clamp(0.0, BINS as f64) as usize
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum State {
    Unknown,
    Free,
    Wall,
    Lintel,
}

/// A floor grid with what is over it.
pub(super) struct Columns {
    pub(super) level: Level,
    pub(super) size: [usize; 2],
    /// Of the first square's first corner, in the level's frame.
    pub(super) origin: DVec2,
    /// The squares' side, in world units.
    pub(super) step: f64,
    /// In metres.
    pub(super) step_m: f64,
    pub(super) meter: f64,
    /// Bits of heights where there is surface.
    pub(super) taken: Vec<u128>,
    /// Bits of heights that cameras saw through, if any did.
    pub(super) seen: Option<Vec<u128>>,
    /// In metres over the floor.
    pub(super) ceiling: Option<f64>,
    state: Vec<State>,
    /// Whether there is floor, and a ceiling too low to stand under; nowhere of a capture.
    is_low: Vec<bool>,
}

impl Columns {
    pub(super) fn new(
        evidence: &Evidence,
        level: &Level,
        options: &FindOptions,
    ) -> Result<Self, FindError> {
        // 1. The grid.
        let positions = evidence.mesh.positions.par_iter();
        let places: Vec<DVec3> = positions.map(|p| level.to_level(*p)).collect();
        let grid = Grid::new(evidence, &places, level, options)?;
        let Grid { size, origin, step } = grid;
        let mut columns = Self {
            level: *level,
            size,
            origin,
            step,
            step_m: step / options.meter,
            meter: options.meter,
            taken: vec![0; size[0] * size[1]],
            seen: None,
            ceiling: None,
            state: Vec::new(),
            is_low: Vec::new(),
        };
        // 2. What is where.
        for triangle in &evidence.mesh.triangles {
            columns.add(&grid, triangle.map(|i| places[i as usize]));
        }
        if !evidence.sights.is_empty() {
            columns.seen = Some(columns.sighted(evidence.sights));
        }
        columns.ceiling = columns.find_ceiling();
        columns.classify();
        Ok(columns)
    }

    pub(super) fn count(&self) -> usize {
        self.size[0] * self.size[1]
    }

    pub(super) fn is_wall(&self, i: usize) -> bool {
        self.state[i] == State::Wall
    }

    pub(super) fn is_lintel(&self, i: usize) -> bool {
        self.state[i] == State::Lintel
    }

    pub(super) fn is_free(&self, i: usize) -> bool {
        self.state[i] == State::Free
    }

    /// Whether there is floor there with a ceiling so low that nobody stands below it.
    pub(super) fn is_low(&self, i: usize) -> bool {
        self.is_low[i] && self.state[i] == State::Unknown
    }

    /// The squares that share a side with one.
    pub(super) fn beside(&self, i: usize) -> impl Iterator<Item = usize> + use<> {
        let [width, height] = self.size;
        let (x, y) = (i % width, i / width);
        let all = [
            (x > 0).then(|| i - 1),
            (x + 1 < width).then_some(i + 1),
            (y > 0).then(|| i - width),
            (y + 1 < height).then_some(i + width),
        ];
        all.into_iter().flatten()
    }

    /// The squares on the straight way from one to another.
    pub(super) fn between(&self, from: usize, to: usize) -> impl Iterator<Item = usize> + use<> {
        let width = self.size[0];
        let place = |i: usize| DVec2::new((i % width) as f64, (i / width) as f64);
        let (from, to) = (place(from), place(to));
        let count = (to - from).abs().max_element() as usize;
        (1..count).map(move |k| {
            let at = from.lerp(to, k as f64 / count as f64).round();
            at.y as usize * width + at.x as usize
        })
    }

    /// Metres as squares.
    pub(super) fn squares(&self, metres: f64) -> f64 {
        metres / self.step_m
    }

    /// The column and the bin of a point of the level's frame.
    fn bin_of(&self, p: DVec3) -> Option<(usize, u32)> {
        let place = (p.truncate() - self.origin) / self.step;
        let bin = (p.z / self.meter + BELOW) / BIN;
        let is_in = place.x >= 0.0 && place.y >= 0.0 && bin >= 0.0 && bin < BINS as f64;
        let (x, y) = (place.x as usize, place.y as usize);
        (is_in && x < self.size[0] && y < self.size[1]).then(|| (y * self.size[0] + x, bin as u32))
    }

    /// How far apart samples are along the plan, in world units, and how lengths are stretched so
    /// that samples of the same distance are near enough in height.
    fn sampling(&self) -> (f64, DVec3) {
        // Half of what is less, a square or a bin; where squares are coarse, a quarter of one.
        let in_height = 0.5 * self.step.min(BIN * self.meter);
        let in_plan = in_height.max(0.25 * self.step);
        (in_plan, DVec3::new(1.0, 1.0, in_plan / in_height))
    }

    /// Marks what a triangle touches.
    fn add(&mut self, grid: &Grid, corners: [DVec3; 3]) {
        if !corners.iter().all(|p| p.is_finite()) {
            return;
        }
        let heights = corners.map(|p| p.z / self.meter);
        let is_off = heights.iter().all(|h| *h < -BELOW)
            || heights.iter().all(|h| *h > BINS as f64 * BIN - BELOW);
        if is_off {
            return;
        }
        if grid.has(&corners) {
            self.mark(corners);
        } else {
            grid.part_of(corners).into_iter().for_each(|t| self.mark(t));
        }
    }

    /// Marks what a triangle over the grid touches, by samples.
    fn mark(&mut self, corners: [DVec3; 3]) {
        let (apart, stretch) = self.sampling();
        // 1. Rows along the longest side.
        let length = |i: usize| (stretch * (corners[(i + 1) % 3] - corners[i])).length();
        let longest = (1..3).fold(0, |b, i| if length(i) > length(b) { i } else { b });
        let [a, b, c] = [0, 1, 2].map(|k| corners[(longest + k) % 3]);
        let along = length(longest);
        let [ab, ac] = [b - a, c - a].map(|side| stretch * side);
        let across = ab.cross(ac).length() / along.max(f64::MIN_POSITIVE);
        let steps = |x: f64| (x / apart).ceil().clamp(1.0, 1e5) as usize;
        let rows = steps(across);
        // 2. Of each only what is between the lowest bin and the highest, and a bin more: there is
        // little to mark of a tower.
        let reach = [-BELOW - BIN, (BINS + 1) as f64 * BIN - BELOW].map(|h| h * self.meter);
        for row in 0..=rows {
            let t = row as f64 / rows as f64;
            let (from, to) = (a.lerp(c, t), b.lerp(c, t));
            let count = steps(along * (1.0 - t));
            // Infinite where it is level.
            let [low, high] = reach.map(|h| (h - from.z) / (to.z - from.z) * count as f64);
            let first = low.min(high).max(0.0) as usize;
            let last = low.max(high).min(count as f64) as usize;
            for k in first..=last {
                let point = from.lerp(to, k as f64 / count as f64);
                if let Some((i, bin)) = self.bin_of(point) {
                    self.taken[i] |= 1 << bin;
                }
            }
        }
    }

    /// What lines of sight pass, but for their last bit.
    fn sighted(&self, sights: &[[DVec3; 2]]) -> Vec<u128> {
        let (apart, stretch) = self.sampling();
        let parts = sights.par_chunks(sights.len().div_ceil(8).max(1));
        let parts: Vec<Vec<u128>> = parts
            .map(|part| {
                let mut seen = vec![0_u128; self.count()];
                for sight in part {
                    let [from, to] = sight.map(|p| self.level.to_level(p));
                    let length = from.distance(to);
                    let free = length - 1.5 * self.step;
                    if !(free > 0.0 && length.is_finite()) {
                        continue;
                    }
                    let apart = apart * (length / (stretch * (to - from)).length());
                    let count = (free / apart).min(1e5) as usize;
                    for k in 0..=count {
                        let at = from.lerp(to, k as f64 * apart / length);
                        if let Some((i, bin)) = self.bin_of(at) {
                            seen[i] |= 1 << bin;
                        }
                    }
                }
                seen
            })
            .collect();
        let mut all = vec![0; self.count()];
        for part in parts {
            all.iter_mut().zip(part).for_each(|(a, b)| *a |= b);
        }
        all
    }

    /// The height with the most columns whose lowest surface overhead is there; without any, that
    /// of the walls.
    fn find_ceiling(&self) -> Option<f64> {
        let over = band([LEAST_CEILING, f64::INFINITY]);
        let floor = band([-0.2, 0.2]);
        let mut counts = [0_usize; BINS];
        let mut floors = 0;
        for taken in self.taken.iter().filter(|t| *t & floor != 0) {
            floors += 1;
            // Walls go on from below; a ceiling has air under it.
            let free_below = taken & band([LEAST_CEILING - 0.3, LEAST_CEILING]) == 0;
            if free_below && taken & over != 0 {
                counts[(taken & over).trailing_zeros() as usize] += 1;
            }
        }
        // 1. The first bin of the fullest two, and how many columns have it.
        let fullest = |counts: &[usize; BINS]| {
            let sum = |i: usize| counts[i] + counts.get(i + 1).copied().unwrap_or(0);
            let best = (0..BINS).fold(0, |b, i| if sum(i) > sum(b) { i } else { b });
            let (low, high) = (counts[best] as f64, sum(best) as f64);
            let share = (high - low) / high.max(1.0);
            (sum(best), height_of(best) + BIN * (0.5 + share))
        };
        let (count, height) = fullest(&counts);
        if count > 0 && 10 * count >= floors {
            return Some(height);
        }
        // 2. No ceiling: where most walls end, for models that are open above.
        let eye = band(EYE_BAND);
        let mut tops = [0_usize; BINS];
        let is_tall = |t: &&u128| (*t & eye).count_ones() >= 10 && *t & over != 0;
        let walls = self.taken.iter().filter(is_tall);
        let mut all = 0;
        for taken in walls {
            all += 1;
            tops[BINS - 1 - taken.leading_zeros() as usize] += 1;
        }
        let (count, height) = fullest(&tops);
        (count > 0 && 3 * count >= all).then_some(height)
    }

    /// Where lintels and beams are, if there is a ceiling that leaves room for them.
    pub(super) fn lintel_band(&self) -> Option<u128> {
        let ceiling = self.ceiling?;
        let from = (ceiling - BELOW_CEILING[0]).max(LINTEL);
        let to = ceiling - BELOW_CEILING[1];
        (to - from > 0.14).then(|| band([from, to]))
    }

    fn classify(&mut self) {
        let eye = band(EYE_BAND);
        let top = self.lintel_band().unwrap_or(0);
        let has_top = |t: u128| top != 0 && 2 * (t & top).count_ones() >= top.count_ones();
        let has_eye = |t: u128| (t & eye).count_ones() >= 3;
        // 1. What stops eyes, but for loose things.
        let mut is_wall: Vec<bool> = self.taken.iter().map(|t| has_eye(*t)).collect();
        self.drop_loose(&mut is_wall, |t| top != 0 && has_top(t));
        // 2. Where one may be.
        let (inside, is_low) = match &self.seen {
            Some(seen) => {
                let inside = self.closed(UNSEEN, |i| (seen[i] & eye).count_ones() >= 2);
                (inside, vec![false; self.count()])
            }
            None => self.floored(),
        };
        let [width, height] = self.size;
        let is_border = |i: usize| {
            let (x, y) = (i % width, i / width);
            x == 0 || y == 0 || x + 1 == width || y + 1 == height
        };
        let state = |i: usize| {
            if is_border(i) {
                State::Unknown
            } else if is_wall[i] {
                State::Wall
            } else if has_top(self.taken[i]) {
                State::Lintel
            } else if inside[i] {
                State::Free
            } else {
                State::Unknown
            }
        };
        self.state = (0..self.count()).map(state).collect();
        self.is_low = is_low;
        stubs::close(self);
    }

    /// Takes a free square for one below a lintel.
    pub(super) fn close(&mut self, i: usize) {
        if self.state[i] == State::Free {
            self.state[i] = State::Lintel;
        }
    }

    /// Takes small things at eye height for free that are not joined to anything above.
    fn drop_loose(&self, is_wall: &mut [bool], has_top: impl Fn(u128) -> bool) {
        let mut is_done = vec![false; self.count()];
        let tall = band(TALL);
        for first in 0..self.count() {
            if is_done[first] || !is_wall[first] {
                continue;
            }
            is_done[first] = true;
            let mut piece = vec![first];
            let mut next = 0;
            let [mut low, mut high] = [[usize::MAX; 2], [0; 2]];
            let mut is_fast = false;
            let mut tall_count = 0;
            while let Some(i) = piece.get(next).copied() {
                next += 1;
                let place = [i % self.size[0], i / self.size[0]];
                low = [low[0].min(place[0]), low[1].min(place[1])];
                high = [high[0].max(place[0]), high[1].max(place[1])];
                is_fast |= has_top(self.taken[i]);
                let of = (self.taken[i] & tall).count_ones();
                tall_count += usize::from(4 * of >= 3 * tall.count_ones());
                for j in self.beside(i) {
                    if is_wall[j] && !is_done[j] {
                        is_done[j] = true;
                        piece.push(j);
                    }
                }
            }
            let extent = (high[0] - low[0]).max(high[1] - low[1]) + 1;
            // Doors' leaves and screens go up from the floor.
            is_fast |= 2 * tall_count > piece.len();
            if !is_fast && (extent as f64) < self.squares(LOOSE) {
                piece.iter().for_each(|i| is_wall[*i] = false);
            }
        }
    }

    /// Where there is floor, holes filled, and ceiling, if most of the floor has one; and where there is floor
    /// below a low ceiling.
    fn floored(&self) -> (Vec<bool>, Vec<bool>) {
        let floor = band([-0.2, 0.2]);
        let over = band([LEAST_CEILING, f64::INFINITY]);
        let (below, low) = (band([0.3, LOW_CEILING[0]]), band(LOW_CEILING));
        let is_floor = |i: usize| self.taken[i] & floor != 0;
        let has_ceiling = |i: usize| self.taken[i] & over != 0;
        let has_low = |i: usize| {
            let taken = self.taken[i];
            let is_slope = (1..=SLOPE).contains(&(taken & low).count_ones());
            is_slope && taken & (over | below) == 0
        };
        let floors = (0..self.count()).filter(|i| is_floor(*i));
        let (all, ceiled) = floors.fold((0, 0), |(a, c), i| {
            (a + 1, c + usize::from(has_ceiling(i) || has_low(i)))
        });
        let need_ceiling = ceiled as f64 > CEILED * f64::from(all);
        let closed = self.closed(HIDDEN, is_floor);
        let inside = |i: usize| closed[i] && (!need_ceiling || has_ceiling(i));
        let is_low = |i: usize| closed[i] && has_low(i);
        let all = 0..self.count();
        (all.clone().map(inside).collect(), all.map(is_low).collect())
    }

    /// A set with its gaps narrower than twice a radius (metres) filled.
    pub(super) fn closed(&self, radius: f64, is_in: impl Fn(usize) -> bool) -> Vec<bool> {
        let reach = self.squares(radius).powi(2);
        let (out, _) = squared_distances(self.size, is_in);
        let (back, _) = squared_distances(self.size, |i| out[i] > reach);
        back.iter().map(|d| *d > reach).collect()
    }

    /// How high the box of a room within bounds must be, in metres over the floor.
    pub(super) fn top_of(&self, labels: &[u32], label: u32, bounds: &Bounds) -> f64 {
        if let Some(ceiling) = self.ceiling {
            return ceiling;
        }
        let of = squares(self.size[0], labels, label, bounds);
        let mut tops: Vec<u32> = of.map(|i| 128 - self.taken[i].leading_zeros()).collect();
        tops.sort_unstable();
        let top = tops.get(tops.len() * 19 / 20).copied().unwrap_or(0);
        height_of(top as usize).clamp(2.2, 4.0)
    }

    /// Bits of heights that cameras saw through at a square or beside it along a wall across an axis,
    /// or a bin higher or lower: lines of sight are samples, with gaps between them.
    pub(super) fn seen_near(&self, at: usize, along: usize, axis: usize) -> u128 {
        let Some(seen) = &self.seen else { return 0 };
        let last = self.size[1 - axis] - 1;
        let of = |along: usize| match axis {
            0 => seen[along * self.size[0] + at],
            _ => seen[at * self.size[0] + along],
        };
        let all = of(along) | of(along.saturating_sub(1)) | of((along + 1).min(last));
        all | all << 1 | all >> 1
    }

    /// Whether who stands there sees past a column.
    pub(super) fn is_open_at_eye(&self, taken: u128) -> bool {
        (taken & band(EYE_BAND)).count_ones() < 3
    }
}
