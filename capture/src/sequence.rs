use crate::{CaptureError, PhotoSet, read_exif};

/// Photos of a sequence follow each other at least this fast, nearly always. A person who
/// composes each photo is slower.
const LONGEST_STEP_S: f64 = 2.0;

/// Whether the photos are the frames of one sweep, each taken next to the one before it in
/// the order of names: the names differ in one number only, which rises by equal steps,
/// and three quarters of the photos were taken within two seconds of the one before. Photos
/// of which none says when it was taken pass by their names alone, as frames of a video do.
///
/// # Errors
/// A photo cannot be read.
pub fn is_sequence(photos: &PhotoSet) -> Result<bool, CaptureError> {
    let names: Vec<&str> = photos.photos.iter().map(|p| p.name.as_str()).collect();
    if !are_numbered(&names) {
        return Ok(false);
    }
    let mut taken = Vec::new();
    for photo in &photos.photos {
        taken.extend(read_exif(&photo.path)?.taken_s);
    }
    Ok(taken.is_empty() || (taken.len() == names.len() && is_swift(&taken)))
}

fn are_numbered(names: &[&str]) -> bool {
    let split: Option<Vec<(&str, u64, &str)>> = names.iter().map(|name| split(name)).collect();
    let Some(split) = split.filter(|split| split.len() > 1) else {
        return false;
    };
    let step = |pair: &[(&str, u64, &str)]| pair[1].1.checked_sub(pair[0].1);
    let first = step(&split);
    split.windows(2).all(|pair| {
        (pair[0].0, pair[0].2) == (pair[1].0, pair[1].2) && step(pair) == first && first > Some(0)
    })
}

/// A name's last number, and what is before and behind it.
fn split(name: &str) -> Option<(&str, u64, &str)> {
    let is_digit = |c: char| c.is_ascii_digit();
    let end = name.rfind(is_digit)? + 1;
    let start = name[..end].rfind(|c| !is_digit(c)).map_or(0, |at| {
        at + name[at..].chars().next().map_or(1, char::len_utf8)
    });
    Some((&name[..start], name[start..end].parse().ok()?, &name[end..]))
}

fn is_swift(taken_s: &[f64]) -> bool {
    let swift = taken_s
        .windows(2)
        .filter(|pair| (0.0..=LONGEST_STEP_S).contains(&(pair[1] - pair[0])));
    4 * swift.count() >= 3 * (taken_s.len() - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_rise_by_equal_steps_and_nothing_else_changes() {
        assert!(are_numbered(&["f01.jpg", "f02.jpg", "f03.jpg"]));
        assert!(are_numbered(&[
            "100_7100.jpg",
            "100_7110.jpg",
            "100_7120.jpg"
        ]));
        assert!(are_numbered(&["é9é", "é10é"]));
        assert!(!are_numbered(&["f01.jpg", "f02.jpg", "f04.jpg"]));
        assert!(!are_numbered(&["a1.jpg", "b2.jpg"]));
        assert!(!are_numbered(&["a1.jpg"]));
        assert!(!are_numbered(&["left.jpg", "right.jpg"]));
        assert!(!are_numbered(&["a1.jpg", "a1.jpg"]));
        assert!(!are_numbered(&["9".repeat(30).as_str(), "a1"]));
    }

    #[test]
    fn a_sweep_is_taken_at_one_go() {
        assert!(is_swift(&[0.0, 0.5, 1.0, 1.5, 60.0]));
        assert!(!is_swift(&[0.0, 5.0, 9.0, 10.0]));
        assert!(!is_swift(&[3.0, 2.0, 1.0]));
    }
}
