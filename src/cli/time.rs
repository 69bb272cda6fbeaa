//! Options for scenes that move, and the moment at which a view is drawn.

use super::options::positive;
use super::output::say;
use super::session::spinner;
use anyhow::{Context, anyhow, bail};
use clap::Args;
use render::{Lumigraph, Moment};
use serde_json::{Value, json};

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
    window_s: Option<f64>,
}

impl Clock {
    /// The clock asked for; `None` where no option speaks of time. Looks for the period in
    /// the photos with `--period auto`.
    pub(super) fn of(
        args: &TimeArgs,
        time_s: Option<f64>,
        lumigraph: &Lumigraph,
    ) -> anyhow::Result<Option<Self>> {
        if args.period.is_none() && args.time_window.is_none() && time_s.is_none() {
            return Ok(None);
        }
        if lumigraph.sources.iter().all(|s| s.time_s.is_none()) {
            bail!(
                "no photo has a time; import the photos with --times FILE.csv (name,seconds) \
                 or --frame-rate F"
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
            window_s: args.time_window,
        }))
    }

    /// The moment of a view that has a time of its own, or has none.
    pub(super) fn moment(&self, name: &str, own: Option<f64>) -> anyhow::Result<Moment> {
        let time_s = self.time_s.or(own);
        let time_s =
            time_s.ok_or_else(|| anyhow!("{name} has no time; give one, or --time for all"))?;
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
