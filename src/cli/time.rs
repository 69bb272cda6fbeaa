//! Options for scenes that move, and the moment at which a view is drawn.

use super::options::positive;
use super::output::say;
use super::session::spinner;
use anyhow::{Context, anyhow, bail};
use clap::Args;
use lumigraph::scene::Scene;
use render::{Lumigraph, Moment, WINDOW_TURNS};
use serde_json::{Value, json};
use std::sync::Once;

/// For scenes that move. With either option photos count by their times, too.
#[derive(Args, Clone)]
pub(super) struct TimeArgs {
    /// Everything repeats after so many seconds; auto finds the period in the photos
    #[arg(long, value_name = "SECONDS|auto", value_parser = period)]
    period: Option<PeriodChoice>,
    /// Photos count within so many seconds of the moment, and the k nearest in time always
    /// [default: a sixteenth of the period, else just the k nearest]
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    time_window: Option<f64>,
}

/// One moment for all views.
#[derive(Args, Clone)]
pub(super) struct AtArgs {
    /// Show the scene as it was at this time, in seconds [default: each frame's time_s, if
    /// there is a period or a time window]
    #[arg(long, value_name = "SECONDS", value_parser = finite)]
    pub(super) time: Option<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum PeriodChoice {
    Auto,
    Seconds(f64),
}

fn period(text: &str) -> Result<PeriodChoice, String> {
    if text == "auto" {
        return Ok(PeriodChoice::Auto);
    }
    let seconds = positive(text).map_err(|_| "expected seconds above zero, or auto")?;
    Ok(PeriodChoice::Seconds(seconds))
}

fn finite(text: &str) -> Result<f64, String> {
    let seconds = text.parse().ok().filter(|s: &f64| s.is_finite());
    seconds.ok_or_else(|| "expected a number of seconds".to_owned())
}

/// What the options come to for a scene.
#[derive(Clone, Copy, Debug)]
pub(super) struct Clock {
    /// One moment for all views.
    time_s: Option<f64>,
    period_s: Option<f64>,
    /// The one asked for, or the default of the period; `None` where just the k nearest photos count.
    window_s: Option<f64>,
    photos: Span,
}

/// When photos were taken, in seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Span {
    first_s: f64,
    last_s: f64,
    /// From one to the next, on average.
    apart_s: f64,
}

impl Span {
    /// Of photos of these times; `None` without any.
    fn of(times_s: &[f64]) -> Option<Self> {
        let first_s = times_s.iter().copied().min_by(f64::total_cmp)?;
        let last_s = times_s.iter().copied().max_by(f64::total_cmp)?;
        let steps = times_s.len().max(2) - 1;
        Some(Self {
            first_s,
            last_s,
            apart_s: (last_s - first_s) / steps as f64,
        })
    }

    /// The moment nearest to a given one that photos tell something of: as far beyond all of them as they lie
    /// apart, or as the window reaches. From farther away all photos are as good as at one moment, and a
    /// window that holds the nearest would hold them all.
    fn nearest_s(&self, time_s: f64, window_s: Option<f64>) -> f64 {
        let beyond_s = window_s.unwrap_or(0.0).max(self.apart_s);
        time_s.clamp(self.first_s - beyond_s, self.last_s + beyond_s)
    }
}

impl TimeArgs {
    /// Whether photos count by their times; `time_s` is the moment for all views, if there is one.
    pub(super) fn plays_a_part(&self, time_s: Option<f64>) -> bool {
        self.period.is_some() || self.time_window.is_some() || time_s.is_some()
    }

    /// What to say of views that have times of the scene, where those of its photos do not count.
    pub(super) fn note_of_unused(
        &self,
        time_s: Option<f64>,
        scene: &Scene,
    ) -> Option<&'static str> {
        let has_times = scene.photos.iter().any(|photo| photo.time_s.is_some());
        let is_unused = has_times && !self.plays_a_part(time_s);
        is_unused.then_some(
            "its times of the scene change nothing without --period, --time-window or --time: all photos count, \
             whenever they were taken",
        )
    }

    /// Fails early where a scene's photos have no times though they count by them; and, where no time is given
    /// for all, where one of the views, of such names and times, has none of its own: a remedy is what gives it one.
    pub(super) fn check(
        &self,
        time_s: Option<f64>,
        scene: &Scene,
        views: impl IntoIterator<Item = (String, Option<f64>)>,
        remedy: &str,
    ) -> anyhow::Result<()> {
        if !self.plays_a_part(time_s) {
            return Ok(());
        }
        if scene.photos.iter().all(|photo| photo.time_s.is_none()) {
            return Err(no_times());
        }
        let mut views = views.into_iter();
        match views.find(|(_, own)| own.or(time_s).is_none()) {
            Some((name, _)) => bail!("{name} has no time; {remedy}"),
            None => Ok(()),
        }
    }
}

fn no_times() -> anyhow::Error {
    anyhow!(
        "no photo has a time; import the photos with --times FILE.csv (name,seconds) \
         or --frame-rate F"
    )
}

impl Clock {
    /// The clock asked for; `None` where no option speaks of time. Looks for the period in
    /// the photos with `--period auto`.
    pub(super) fn of(
        args: &TimeArgs,
        time_s: Option<f64>,
        lumigraph: &Lumigraph,
    ) -> anyhow::Result<Option<Self>> {
        if !args.plays_a_part(time_s) {
            return Ok(None);
        }
        let times_s: Vec<f64> = lumigraph.sources.iter().filter_map(|s| s.time_s).collect();
        let Some(photos) = Span::of(&times_s) else {
            return Err(no_times());
        };
        if times_s.len() > 1 && photos.first_s == photos.last_s {
            say!(
                "note: all {} photos that have a time have the same, {:.3} s: no moment differs from another; import \
                 the photos with --times FILE.csv (name,seconds) or --frame-rate F",
                times_s.len(),
                photos.first_s
            );
        }
        let period_s = match args.period {
            None => None,
            Some(PeriodChoice::Seconds(seconds)) => Some(seconds),
            Some(PeriodChoice::Auto) => Some(find_period(lumigraph)?),
        };
        Ok(Some(Self {
            time_s,
            period_s,
            window_s: args.time_window.or(period_s.map(|p| WINDOW_TURNS * p)),
            photos,
        }))
    }

    /// The moment of a view that has a time of its own, or has none. One far beyond all photos is the nearest
    /// that they tell something of, which is said once a run.
    pub(super) fn moment(&self, name: &str, own: Option<f64>) -> anyhow::Result<Moment> {
        static SAID: Once = Once::new();
        let asked_s = self.time_s.or(own);
        // Which [`TimeArgs::check`] has said before, and how it gets one.
        let asked_s = asked_s.with_context(|| format!("{name} has no time"))?;
        let mut time_s = asked_s;
        if self.period_s.is_none() {
            time_s = self.photos.nearest_s(asked_s, self.window_s);
        }
        if time_s != asked_s {
            let Span {
                first_s, last_s, ..
            } = self.photos;
            SAID.call_once(|| {
                say!(
                    "warning: {name} is to be as of {asked_s:.3} s, but photos were taken from \
                     {first_s:.3} to {last_s:.3} s: those nearest in time show it; give --period if \
                     everything repeats"
                );
            });
        }
        Ok(Moment {
            time_s,
            period_s: self.period_s,
            window_s: self.window_s,
        })
    }
}

fn find_period(lumigraph: &Lumigraph) -> anyhow::Result<f64> {
    let bar = spinner("looking for the period");
    let snapshots = render::snapshots(lumigraph);
    let found = calibrate::find_period(&snapshots);
    bar.finish_and_clear();
    let found = found.context("--period auto")?;
    say!(
        "period: {:.4} s, which explains {:.0} % of how the photos differ",
        found.period_s,
        100.0 * found.explained
    );
    Ok(found.period_s)
}

/// How many photos counted at the moments drawn so far.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct InWindow {
    counts: Option<(usize, usize)>,
}

impl InWindow {
    pub(super) fn note(&mut self, count: usize) {
        let (fewest, most) = self.counts.unwrap_or((count, count));
        self.counts = Some((fewest.min(count), most.max(count)));
    }

    /// With the period and the window, for `--json`.
    pub(super) fn json(&self, clock: &Clock) -> Value {
        json!({
            "period_s": clock.period_s,
            "window_s": clock.window_s,
            "photos_in_window": self.counts.map(|(fewest, most)| [fewest, most]),
        })
    }

    /// For people; empty where time plays no part.
    pub(super) fn text(&self) -> String {
        match self.counts {
            None => String::new(),
            Some((fewest, most)) if fewest == most => {
                format!(", {most} photos in the time window")
            }
            Some((fewest, most)) => {
                format!(", {fewest} to {most} photos in the time window")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_far_beyond_all_photos_are_the_nearest_that_they_tell_of() {
        let photos = Span::of(&[0.2, 3.2, 0.0, 1.0]).unwrap();
        assert_eq!((photos.first_s, photos.last_s), (0.0, 3.2));
        let clock = |period_s, window_s| Clock {
            time_s: None,
            period_s,
            window_s,
            photos,
        };
        let shown = |clock: Clock, time_s| clock.moment("a", Some(time_s)).unwrap().time_s;
        let plain = clock(None, Some(0.05));
        let last_s = 3.2 + photos.apart_s;
        for (asked_s, expected) in [(60.0, last_s), (-9.0, -photos.apart_s)] {
            assert_eq!(shown(plain, asked_s), expected);
        }
        // Between them, or hardly beyond, all is as it is asked.
        for asked_s in [0.0, 1.7, 3.2, 4.0, -1.0] {
            assert_eq!(shown(plain, asked_s), asked_s);
        }
        // A wide window says how far photos count, and with a period there is no beyond.
        assert_eq!(shown(clock(None, Some(100.0)), 60.0), 60.0);
        assert_eq!(shown(clock(Some(1.5), None), 60.0), 60.0);
        // All at one moment.
        let photos = Span::of(&[7.0]).unwrap();
        assert_eq!(photos.nearest_s(9.0, None), 7.0);
        assert_eq!(Span::of(&[]), None);
    }
}
