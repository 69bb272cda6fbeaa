//! Which photos count at a moment: Buehler et al. 2001, §5, Helicopter, with photos that
//! come and go smoothly, as the paper suggests.

/// A moment of a scene that moves, and how far from it photos still count.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// In seconds, as the source views' times.
    pub time_s: f64,
    /// After so many seconds everything repeats; `None` where nothing does.
    pub period_s: Option<f64>,
    /// Photos this far away, in seconds, no longer count; `None` for [`WINDOW_TURNS`] of a
    /// period, or without one for as little as gives k photos. It widens where it holds
    /// fewer than k: see [`Moment::window_s`].
    pub window_s: Option<f64>,
}

/// The default window, in periods: a sixteenth either way.
pub const WINDOW_TURNS: f64 = 0.0625;
/// A photo halfway to the window's edge is as good as one at the moment that differs by a
/// third of this in angle, in radians.
pub const TIME_COST: f64 = 0.2;
/// A widened window reaches this much further than the k-th nearest photo: at its edge a
/// photo would count for nothing.
const REACH: f64 = 1.5;

impl Moment {
    /// Whether every number makes sense.
    ///
    /// # Errors
    /// A sentence that names the option, its value and its range.
    pub fn check(&self) -> Result<(), String> {
        if !self.time_s.is_finite() {
            return Err(format!("the time is {}; it must be finite", self.time_s));
        }
        let options = [("period", self.period_s), ("time window", self.window_s)];
        for (name, seconds) in options {
            if let Some(seconds) = seconds.filter(|s| !(*s > 0.0 && s.is_finite())) {
                return Err(format!("the {name} is {seconds} s; it must be positive"));
            }
        }
        Ok(())
    }

    /// Seconds between a photo's time and this moment; around the period where there is
    /// one, |((tᵢ − t + P/2) mod P) − P/2|.
    pub fn distance_s(&self, time_s: f64) -> f64 {
        let Some(period_s) = self.period_s else {
            return (time_s - self.time_s).abs();
        };
        // Phases are integers that wrap around: a whole period more changes no bit.
        let phase = |t: f64| ((t / period_s).rem_euclid(1.0) * TURN).round() as u64 as u32;
        let apart = phase(time_s).wrapping_sub(phase(self.time_s)) as i32;
        f64::from(apart.unsigned_abs()) / TURN * period_s
    }

    /// The window among photos of these times: the one asked for, but at least
    /// 3/2 of the distance of the k-th nearest photo, so that k photos count whatever the
    /// moment. It changes continuously with the moment.
    pub fn window_s(&self, times_s: &[f64], k: usize) -> f64 {
        let mut distances: Vec<f64> = times_s.iter().map(|&t| self.distance_s(t)).collect();
        distances.sort_by(f64::total_cmp);
        let nearest = distances.get(..k.max(1)).unwrap_or(&distances);
        let needed = REACH * nearest.last().copied().unwrap_or(0.0);
        let asked = self.window_s.or(self.period_s.map(|p| WINDOW_TURNS * p));
        asked.unwrap_or(0.0).max(needed)
    }

    /// What each photo's time adds to its difference: γ·τ/(1 − τ) with τ = (Δt/window)²,
    /// γ = [`TIME_COST`]. Zero at this moment, and beyond all bounds towards the window's
    /// edge; infinite there, and for a photo without a time.
    pub fn penalties(&self, times_s: &[Option<f64>], k: usize) -> Vec<f64> {
        let known: Vec<f64> = times_s.iter().copied().flatten().collect();
        let window_s = self.window_s(&known, k);
        let penalty = |time_s: f64| {
            let distance_s = self.distance_s(time_s);
            if distance_s == 0.0 {
                return 0.0;
            }
            let tau = (distance_s / window_s).powi(2);
            if tau < 1.0 {
                TIME_COST * tau / (1.0 - tau)
            } else {
                f64::INFINITY
            }
        };
        let penalties = times_s.iter();
        penalties
            .map(|time_s| time_s.map_or(f64::INFINITY, penalty))
            .collect()
    }
}

/// A whole turn, as phases count.
const TURN: f64 = (1_u64 << 32) as f64;
