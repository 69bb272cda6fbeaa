//! What may be wrong with an interior, in words.

use proxy::interior::InteriorWarning;
use std::collections::HashMap;
use std::mem::discriminant;

/// Of so many cells or portals the same is said one by one: where the scale is wrong, it is true of most.
const MAX_ALIKE: usize = 16;

/// Puts what may be wrong with the scale before all else, and what is said of single cells and portals, many of them
/// where it is wrong, after.
pub(super) fn put_causes_first(warnings: &mut [InteriorWarning]) {
    use InteriorWarning::{Away, NoPortal, Overlap, TallWalls, Turned, UpsideDown};
    warnings.sort_by_key(|warning| match warning {
        TallWalls(_) | UpsideDown(_) => 0,
        NoPortal(_) => 3,
        Overlap(..) | Away { .. } | Turned(_) => 2,
        _ => 1,
    });
}

/// Warnings in words, in order. Where there are many of a kind the last that is told has how many more there are; of
/// overlaps all are told, as no more than some are looked for.
pub(in crate::cli) fn said(warnings: &[InteriorWarning]) -> Vec<String> {
    let mut counts = HashMap::new();
    for warning in warnings {
        *counts.entry(discriminant(warning)).or_insert(0_usize) += 1;
    }
    let mut texts = Vec::new();
    let mut before = HashMap::new();
    for warning in warnings {
        let kind = discriminant(warning);
        let number = before.entry(kind).or_insert(0_usize);
        *number += 1;
        let is_overlap = matches!(warning, InteriorWarning::Overlap(..));
        let more = counts[&kind].saturating_sub(MAX_ALIKE);
        if is_overlap || more == 0 || *number < MAX_ALIKE {
            texts.push(warning.to_string());
        } else if *number == MAX_ALIKE {
            texts.push(format!("{warning} (and {more} more of this kind)"));
        }
    }
    texts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_may_be_wrong_with_all_is_told_before_what_follows_from_it() {
        let alone = |name: &str| InteriorWarning::NoPortal(name.to_owned());
        let tall = InteriorWarning::TallWalls(25.0);
        let storey = InteriorWarning::Storey(3.0);
        let mut warnings = vec![
            alone("room 1"),
            alone("room 2"),
            tall.clone(),
            storey.clone(),
        ];
        put_causes_first(&mut warnings);
        let expected = [
            tall.clone(),
            storey.clone(),
            alone("room 1"),
            alone("room 2"),
        ];
        assert_eq!(warnings, expected);
        let turned = InteriorWarning::Turned("door".to_owned());
        let mut warnings = [
            alone("room 1"),
            turned.clone(),
            storey.clone(),
            tall.clone(),
        ];
        put_causes_first(&mut warnings);
        assert_eq!(warnings, [tall, storey, turned, alone("room 1")]);
    }

    #[test]
    fn of_many_warnings_of_a_kind_the_first_are_said_and_how_many_more_there_are() {
        let alone = |i: usize| InteriorWarning::NoPortal(format!("room {i}"));
        let mut warnings: Vec<InteriorWarning> = (0..MAX_ALIKE).map(alone).collect();
        let each = |warnings: &[InteriorWarning]| -> Vec<String> {
            warnings.iter().map(|w| w.to_string()).collect()
        };
        assert_eq!(said(&warnings), each(&warnings));
        let first = each(&warnings);
        warnings.extend((0..84).map(|i| alone(MAX_ALIKE + i)));
        warnings.push(InteriorWarning::Elsewhere(7));
        let texts = said(&warnings);
        assert_eq!(texts.len(), MAX_ALIKE + 1);
        assert_eq!(texts[..MAX_ALIKE - 1], first[..MAX_ALIKE - 1]);
        let last = format!("{} (and 84 more of this kind)", first[MAX_ALIKE - 1]);
        assert_eq!(texts[MAX_ALIKE - 1], last);
        assert!(texts[MAX_ALIKE].starts_with("7 triangles"));
    }
}
