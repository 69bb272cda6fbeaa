//! Times in photos' names.

/// A time that a name tells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NameTime {
    /// A date and time of day, as seconds since 1970 by the camera's own clock.
    Date(f64),
    /// Seconds from somewhere.
    Seconds(f64),
}

impl NameTime {
    /// Its seconds, whatever they count from.
    pub fn seconds(self) -> f64 {
        match self {
            Self::Date(seconds) | Self::Seconds(seconds) => seconds,
        }
    }
}

/// The time in a photo's name, if exactly one is there beyond doubt; folders and extension
/// do not count.
///
/// Dates: `IMG_20240131_154502`, `PXL_20240131_154502123` (milliseconds),
/// `2024-01-31T15-45-02.250`, `2024-01-31 15.45.02`. Seconds: a name that is nothing but
/// `00012.500`, or that ends in `t12.500s` or `t12s`. Bare numbers (`frame_000123`) are
/// counts, not times.
///
/// ```
/// use capture::{NameTime, time_in_name};
/// assert_eq!(time_in_name("a/00012.500.jpg"), Some(NameTime::Seconds(12.5)));
/// assert_eq!(time_in_name("frame_000123.jpg"), None);
/// ```
pub fn time_in_name(name: &str) -> Option<NameTime> {
    let stem = stem(name);
    let bytes = stem.as_bytes();
    let mut dates = (0..bytes.len()).filter_map(|at| date_at(bytes, at));
    match (dates.next(), dates.next()) {
        (Some(date), None) => return Some(NameTime::Date(date)),
        (Some(_), Some(_)) => return None,
        (None, _) => {}
    }
    let plain = |text: &str| {
        let (whole, fraction) = text.split_once('.')?;
        (is_digits(whole) && is_digits(fraction)).then(|| text.parse().ok())?
    };
    if let Some(seconds) = plain(stem) {
        return Some(NameTime::Seconds(seconds));
    }
    let marked = stem.strip_suffix('s')?;
    let (before, number) = marked.rsplit_once('t')?;
    let apart = before.is_empty() || before.ends_with(['_', '-', ' ']);
    let whole = || is_digits(number).then(|| number.parse().ok())?;
    let seconds = apart.then(|| plain(number).or_else(whole))??;
    Some(NameTime::Seconds(seconds))
}

/// The last number in a photo's name, and the name around it: `frame_000123.jpg` is 123 and
/// `frame_`, `.jpg`. `None` without one, or where it has more than 15 digits.
pub fn number_in_name(name: &str) -> Option<(u64, (&str, &str))> {
    let end = name.rfind('/').map_or(0, |slash| slash + 1) + stem(name).len();
    let is_digit = |c: char| c.is_ascii_digit();
    let last = name[..end].rfind(is_digit)? + 1;
    let first = name[..last].rfind(|c| !is_digit(c)).map_or(0, |i| {
        i + name[i..].chars().next().map_or(1, char::len_utf8)
    });
    let digits = &name[first..last];
    let number = (digits.len() <= 15).then(|| digits.parse().ok())??;
    Some((number, (&name[..first], &name[last..])))
}

/// Without folders and extension.
fn stem(name: &str) -> &str {
    let file = name.rsplit('/').next().unwrap_or(name);
    file.rsplit_once('.').map_or(file, |(stem, _)| stem)
}

fn is_digits(text: &str) -> bool {
    !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit())
}

/// A number of exactly `digits` digits, and what follows.
fn number(bytes: &[u8], digits: usize) -> Option<(u32, &[u8])> {
    let (head, rest) = bytes.split_at_checked(digits)?;
    let value = head.iter().try_fold(0, |value, b| {
        b.is_ascii_digit().then(|| 10 * value + u32::from(b - b'0'))
    });
    Some((value?, rest))
}

/// One of the separators, or none at all, and what follows.
fn separator<'a>(bytes: &'a [u8], known: &[u8]) -> (Option<u8>, &'a [u8]) {
    match bytes.split_first() {
        Some((first, rest)) if known.contains(first) => (Some(*first), rest),
        _ => (None, bytes),
    }
}

/// The date and time of day that begins at a byte of a name.
fn date_at(name: &[u8], at: usize) -> Option<f64> {
    if at > 0 && name[at - 1].is_ascii_digit() {
        return None;
    }
    let (year, rest) = number(&name[at..], 4)?;
    let (first, rest) = separator(rest, b"-_.");
    let (month, rest) = number(rest, 2)?;
    let (second, rest) = separator(rest, b"-_.");
    let (day, rest) = number(rest, 2)?;
    let (between, rest) = separator(rest, b"T_- ");
    let (hour, rest) = number(rest, 2)?;
    let (third, rest) = separator(rest, b"-_.:");
    let (minute, rest) = number(rest, 2)?;
    let (fourth, rest) = separator(rest, b"-_.:");
    let (seconds, rest) = number(rest, 2)?;
    if first != second || third != fourth || between.is_none() {
        return None;
    }
    // Milliseconds: after a point, or right behind where nothing separates.
    let digits = |bytes: &[u8]| bytes.iter().take_while(|b| b.is_ascii_digit()).count();
    let (fraction, count) = match rest.split_first() {
        Some((b'.', behind)) if digits(behind) > 0 => (behind, digits(behind)),
        _ => (rest, digits(rest)),
    };
    let direct = fraction.len() == rest.len();
    if count > 9 || (direct && !(count == 0 || (count == 3 && third.is_none()))) {
        return None;
    }
    let fraction = std::str::from_utf8(&fraction[..count]).ok()?;
    let fraction: f64 = format!("0.{fraction}0").parse().ok()?;
    Some(seconds_since_1970(year, [month, day, hour, minute, seconds])? + fraction)
}

/// Seconds from 1970 to a date (month, day, hour, minute, second); `None` where there is no
/// such date.
pub(crate) fn seconds_since_1970(year: u32, rest: [u32; 5]) -> Option<f64> {
    let [month, day, hour, minute, second] = rest;
    let leap = year.is_multiple_of(4) && (!year.is_multiple_of(100) || year.is_multiple_of(400));
    let february = if leap { 29 } else { 28 };
    let lengths = [31, february, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31];
    let length = *lengths.get(month.checked_sub(1)? as usize)?;
    let known = (1970..2100).contains(&year) && (1..=length).contains(&day);
    if !known || hour > 23 || minute > 59 || second > 60 {
        return None;
    }
    let leap_days = (1970..year)
        .filter(|y| y.is_multiple_of(4) && (!y.is_multiple_of(100) || y.is_multiple_of(400)))
        .count() as u32;
    let before: u32 = lengths[..month as usize - 1].iter().sum();
    let days = 365 * (year - 1970) + leap_days + before + day - 1;
    Some(f64::from(days) * 86400.0 + f64::from(hour * 3600 + minute * 60 + second))
}

#[cfg(test)]
mod tests {
    use super::*;
    use NameTime::{Date, Seconds};

    #[test]
    fn names_tell_times_only_where_they_are_sure() {
        // As `date -u -d "2024-01-31 15:45:02" +%s` has it.
        const THEN: f64 = 1_706_715_902.0;
        for (name, expected) in [
            ("IMG_20240131_154502.jpg", Some(Date(THEN))),
            ("day/PXL_20240131_154502123.jpg", Some(Date(THEN + 0.123))),
            ("2024-01-31T15-45-02.250.png", Some(Date(THEN + 0.25))),
            ("2024-01-31 15.45.02.jpg", Some(Date(THEN))),
            ("20240131-154502_burst.jpg", Some(Date(THEN))),
            ("20240229_000000.jpg", Some(Date(1_709_164_800.0))),
            ("20000301_000001.jpg", Some(Date(951_868_801.0))),
            ("00012.500.jpg", Some(Seconds(12.5))),
            (
                "1305031102.175304.png",
                Some(Seconds(1_305_031_102.175_304)),
            ),
            ("cam_t12.500s.jpg", Some(Seconds(12.5))),
            ("t3s.png", Some(Seconds(3.0))),
            // Counts, words, and what could be one thing or another.
            ("frame_000123.jpg", None),
            ("0012.jpg", None),
            ("lights.jpg", None),
            ("shot12s.jpg", None),
            ("20230229_120000.jpg", None),
            ("20241331_120000.jpg", None),
            ("20240131154502.jpg", None),
            ("120240131_154502.jpg", None),
            ("20240131_15450212.jpg", None),
            ("2024-01_31_154502.jpg", None),
            ("20240131_154502-20240131_154503.jpg", None),
            ("v1.2.3.jpg", None),
            ("é_t1.5.jpg", None),
            ("", None),
        ] {
            assert_eq!(time_in_name(name), expected, "{name}");
        }
    }

    #[test]
    fn the_last_number_counts() {
        let found = number_in_name("cam2/frame_000123.jpg");
        assert_eq!(found, Some((123, ("cam2/frame_", ".jpg"))));
        assert_eq!(number_in_name("é7é.jp2"), Some((7, ("é", "é.jp2"))));
        assert_eq!(number_in_name("a.jpg"), None);
        assert_eq!(number_in_name("1234567890123456.jpg"), None);
    }
}
