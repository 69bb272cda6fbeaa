//! Names that differ as file systems and programs make them differ.

/// What is left of a name once letters' case is gone, and whether their marks are part of them: macOS
/// takes an `ü` apart, others keep it whole, and neither can be seen. Known are Latin letters with one mark, kana
/// and Hangul; all others are taken as they are written.
pub fn name_key(name: &str) -> String {
    let mut key = String::with_capacity(name.len());
    for c in name.chars() {
        let (base, marks) = apart(c);
        key.extend(base.to_lowercase());
        key.extend(marks.into_iter().flatten());
    }
    key
}

/// The same without what a name ends in after its last dot, if that looks like a kind of file.
pub fn stem_key(name: &str) -> String {
    let is_kind = |end: &str| {
        let is_short = (1..=5).contains(&end.len());
        is_short
            && end.bytes().all(|b| b.is_ascii_alphanumeric())
            && end.bytes().any(|b| b.is_ascii_alphabetic())
    };
    match name.rsplit_once('.') {
        Some((stem, end)) if is_kind(end) => name_key(stem),
        _ => name_key(name),
    }
}

/// A letter and what is added to it.
fn apart(c: char) -> (char, [Option<char>; 2]) {
    if c.is_ascii() {
        return (c, [None; 2]);
    }
    // Hangul syllables, in the order of their parts (Unicode, chapter 3.12).
    if ('가'..='힣').contains(&c) {
        let syllable = c as u32 - '가' as u32;
        let part = |first: u32, i: u32| char::from_u32(first + i);
        let tail = syllable % 28;
        return (
            part(0x1100, syllable / 588).unwrap_or(c),
            [
                part(0x1161, syllable % 588 / 28),
                part(0x11A7, tail).filter(|_| tail > 0),
            ],
        );
    }
    let known = MARKED.iter().find_map(|(mark, bases, whole)| {
        let at = whole.chars().position(|letter| letter == c)?;
        Some((bases.chars().nth(at)?, *mark))
    });
    match known {
        Some((base, mark)) => (base, [Some(mark), None]),
        None => (c, [None; 2]),
    }
}

/// Marks, the letters that bear them, and both in one.
#[rustfmt::skip]
const MARKED: [(char, &str, &str); 15] = [
    ('\u{300}', "AEINOUaeinou", "ÀÈÌǸÒÙàèìǹòù"),
    ('\u{301}', "ACEGILNORSUYZacegilnorsuyz", "ÁĆÉǴÍĹŃÓŔŚÚÝŹáćéǵíĺńóŕśúýź"),
    ('\u{302}', "ACEGHIJOSUWYaceghijosuwy", "ÂĈÊĜĤÎĴÔŜÛŴŶâĉêĝĥîĵôŝûŵŷ"),
    ('\u{303}', "AINOUainou", "ÃĨÑÕŨãĩñõũ"),
    ('\u{304}', "AEIOUYaeiouy", "ĀĒĪŌŪȲāēīōūȳ"),
    ('\u{306}', "AEGIOUaegiou", "ĂĔĞĬŎŬăĕğĭŏŭ"),
    ('\u{307}', "ACEGIOZacegoz", "ȦĊĖĠİȮŻȧċėġȯż"),
    ('\u{308}', "AEIOUYaeiouy", "ÄËÏÖÜŸäëïöüÿ"),
    ('\u{30A}', "AUau", "ÅŮåů"),
    ('\u{30B}', "OUou", "ŐŰőű"),
    ('\u{30C}', "ACDEGHIKLNORSTUZacdeghijklnorstuz", "ǍČĎĚǦȞǏǨĽŇǑŘŠŤǓŽǎčďěǧȟǐǰǩľňǒřšťǔž"),
    ('\u{327}', "CEGKLNRSTcegklnrst", "ÇȨĢĶĻŅŖŞŢçȩģķļņŗşţ"),
    ('\u{328}', "AEIOUaeiou", "ĄĘĮǪŲąęįǫų"),
    ('\u{3099}', "うかきくけこさしすせそたちつてとはひふへほゝウカキクケコサシスセソタチツテトハヒフヘホワヰヱヲヽ", "ゔがぎぐげござじずぜぞだぢづでどばびぶべぼゞヴガギグゲゴザジズゼゾダヂヅデドバビブベボヷヸヹヺヾ"),
    ('\u{309A}', "はひふへほハヒフヘホ", "ぱぴぷぺぽパピプペポ"),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_with_marks_are_those_letters_and_those_marks() {
        for (mark, bases, whole) in MARKED {
            assert_eq!(bases.chars().count(), whole.chars().count(), "{mark:?}");
            for (base, letter) in bases.chars().zip(whole.chars()) {
                let apart = format!("{base}{mark}");
                assert_eq!(name_key(&letter.to_string()), name_key(&apart), "{letter}");
            }
        }
        let apart = "S\u{FC}d/\u{1112}\u{1161}\u{11AB}\u{1100}\u{1173}\u{11AF}.jpg";
        assert_eq!(name_key("Su\u{308}D/한글.JPG"), name_key(apart));
        assert_ne!(name_key("ü.jpg"), name_key("u.jpg"));
        assert_ne!(name_key("ü.jpg"), name_key("ö.jpg"));
    }

    #[test]
    fn what_a_name_ends_in_is_a_kind_of_file_or_part_of_it() {
        assert_eq!(stem_key("a/IMG_1.JPG"), "a/img_1");
        for whole in ["frame.001", "a.b/c", "Dr. No", "a.", "a"] {
            assert_eq!(stem_key(whole), name_key(whole));
        }
    }
}
