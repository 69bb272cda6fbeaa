//! When photos were taken: by a list, by their names, or by what the camera wrote.

mod list;
mod name;

pub use list::{TimeListError, read_times};
pub(crate) use name::seconds_since_1970;
pub use name::{NameTime, number_in_name, time_in_name};

/// Times found for a photo set, in its order.
pub type Times = Vec<Option<f64>>;

/// The times that photos' names tell, in seconds. Dates count from the earliest of them.
///
/// All of one kind: where some names hold dates and others seconds, neither is sure, and
/// no photo has a time.
pub fn times_of_names(names: &[&str]) -> Times {
    let found: Vec<Option<NameTime>> = names.iter().map(|name| time_in_name(name)).collect();
    let dates = found.iter().flatten().map(|t| match t {
        NameTime::Date(seconds) => Some(*seconds),
        NameTime::Seconds(_) => None,
    });
    let dates: Vec<Option<f64>> = dates.collect();
    if dates.iter().all(Option::is_some) {
        return from_earliest(found.iter().map(|t| t.map(NameTime::seconds)).collect());
    }
    if dates.iter().any(Option::is_some) {
        return vec![None; names.len()];
    }
    found.iter().map(|t| t.map(NameTime::seconds)).collect()
}

/// The same times with the earliest at zero, to a microsecond: what is counted from 1970 is no finer.
pub fn from_earliest(times_s: Times) -> Times {
    let earliest = times_s.iter().flatten().copied().reduce(f64::min);
    let since = |t: f64| ((t - earliest.unwrap_or(0.0)) * 1e6).round() / 1e6;
    times_s.into_iter().map(|t| t.map(since)).collect()
}
