use super::*;
use image::codecs::jpeg::JpegEncoder;
use image::{ExtendedColorType, ImageEncoder};

/// 56 × 40 pixels of three components, chroma halved, in scans of all kinds (libjpeg's cjpeg
/// -progressive), and with a restart every two MCUs (-restart 2B).
const IN_SCANS: &[u8] = include_bytes!("progressive.jpg");
const IN_INTERVALS: &[u8] = include_bytes!("restarts.jpg");

/// A baseline picture that repeats nowhere.
fn baseline(width: u32, height: u32, color: ExtendedColorType) -> Vec<u8> {
    let channels = u32::from(color.channel_count());
    let wave = |i: u32| 90.0 * f64::from(i % 977).sin() * f64::from(i % 31);
    let pixels: Vec<u8> = (0..width * height * channels)
        .map(|i| 127.0 + wave(i / channels) + f64::from(i % channels))
        .map(|value| value as u8)
        .collect();
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, 90)
        .write_image(&pixels, width, height, color)
        .unwrap();
    bytes
}

fn color(width: u32, height: u32) -> Vec<u8> {
    baseline(width, height, ExtendedColorType::Rgb8)
}

/// All kinds of file that are read here.
fn kinds() -> [Vec<u8>; 4] {
    let gray = baseline(45, 30, ExtendedColorType::L8);
    [
        color(45, 30),
        gray,
        IN_SCANS.to_vec(),
        IN_INTERVALS.to_vec(),
    ]
}

/// Where the data of the first scan begin.
fn first_scan(bytes: &[u8]) -> usize {
    let mut markers = markers(bytes);
    markers.find(|&(marker, _)| marker == START_OF_SCAN);
    bytes.len() - markers.rest.len()
}

/// The bytes with others put in at a place.
fn with(bytes: &[u8], at: usize, others: &[u8]) -> Vec<u8> {
    [&bytes[..at], others, &bytes[at..]].concat()
}

/// Numbers as random as tests need, below 2³¹ (Numerical Recipes' generator).
fn random() -> impl FnMut() -> usize {
    let mut state = 1_u32;
    move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 1) as usize >> 7
    }
}

#[test]
fn whole_pictures_are_not_damaged() {
    for bytes in kinds() {
        assert_eq!(damage(&bytes), None);
    }
    for (width, height) in [(1, 1), (7, 17), (8, 8), (16, 9), (130, 3)] {
        assert_eq!(damage(&color(width, height)), None, "{width} × {height}");
    }
}

#[test]
fn zeros_or_ones_in_the_middle_are_found_and_where() {
    let bytes = color(160, 120);
    let middle = (first_scan(&bytes) + bytes.len()) / 2;
    for value in [0, 0xFF] {
        let mut damaged = bytes.clone();
        damaged[middle..middle + 512].fill(value);
        let share = damage(&damaged).expect("damaged");
        assert!((0.4..=1.0).contains(&share), "{value}: {share}");
    }
    // In a first band of coefficients, in further bits of one, and amid restarts.
    for (bytes, from) in [(IN_SCANS, 710), (IN_SCANS, 1220), (IN_INTERVALS, 710)] {
        let mut damaged = bytes.to_vec();
        damaged[from..from + 60].fill(0);
        assert!(damage(&damaged).is_some(), "{from}");
    }
}

#[test]
fn bytes_that_are_missing_or_twice_there_are_found() {
    for bytes in [color(160, 120), IN_INTERVALS.to_vec()] {
        let (from, to) = (first_scan(&bytes) + 100, first_scan(&bytes) + 300);
        let missing = [&bytes[..from], &bytes[to..]].concat();
        assert!(damage(&missing).is_some());
        let twice = with(&bytes, to, &bytes[from..to]);
        assert!(damage(&twice).is_some());
    }
    // A copy that was cut short and was given an end.
    for bytes in [color(160, 120), IN_SCANS.to_vec()] {
        let ended = [&bytes[..bytes.len() / 2], &[0xFF, END_OF_IMAGE]].concat();
        let share = damage(&ended).expect("damaged");
        assert!(share < 1.0, "{share}");
    }
}

#[test]
fn padding_and_what_programs_put_behind_scans_is_no_damage() {
    let text = b"a camera's own remarks on exposure, lens and weather".repeat(8);
    for bytes in kinds() {
        let end = bytes.len() - 2;
        for others in [
            &[0x00; 700][..],
            &[0xFF; 700],
            &[0x55; 700],
            &[0x12, 0x9A, 0x04],
            &[0xFF, 0xD3],
            &text,
        ] {
            assert_eq!(damage(&with(&bytes, end, others)), None);
        }
    }
    // Between scans, and before restarts, FF may be repeated, too.
    for (bytes, marker) in [(IN_SCANS, HUFFMAN_TABLE), (IN_INTERVALS, 0xD0)] {
        let from = first_scan(bytes);
        let next = bytes[from..].windows(2).position(|b| b == [0xFF, marker]);
        let next = from + next.unwrap();
        for others in [&[0; 50][..], &[0xFF; 50], &[7, 0x80]] {
            assert_eq!(damage(&with(bytes, next, others)), None);
        }
    }
}

#[test]
fn what_cannot_be_judged_is_not_called_damaged() {
    let bytes = color(64, 48);
    let whole = |bytes: &[u8]| assert_eq!(damage(bytes), None);
    let frame = bytes
        .windows(2)
        .position(|b| b == [0xFF, BASELINE])
        .unwrap();
    let scan = first_scan(&bytes);
    let changed = |changes: &[(usize, u8)]| {
        let mut changed = bytes.clone();
        changed[scan + 50..scan + 90].fill(0);
        assert!(damage(&changed).is_some());
        changes.iter().for_each(|&(at, value)| changed[at] = value);
        changed
    };
    // Arithmetic coding, lossless coding, 12 bits.
    whole(&changed(&[(frame + 1, 0xC9)]));
    whole(&changed(&[(frame + 1, 0xC3)]));
    whole(&changed(&[(frame + 4, 12)]));
    // No height, and one that is told behind the scan: 56 lines are announced.
    whole(&changed(&[(frame + 6, 0)]));
    let mut lines = bytes.clone();
    lines[frame + 6] = 56;
    assert_eq!(damage(&lines), Some(48.0 / 56.0));
    let told = [0xFF, NUMBER_OF_LINES, 0, 4, 0, 48];
    whole(&with(&lines, bytes.len() - 2, &told));
    // Fewer lines than there are.
    lines[frame + 6] = 40;
    whole(&lines);
    // A decoder's own tables.
    let mut tableless = changed(&[]);
    while let Some(at) = tableless
        .windows(2)
        .position(|b| b == [0xFF, HUFFMAN_TABLE])
    {
        let length = u16::from_be_bytes([tableless[at + 2], tableless[at + 3]]);
        tableless.drain(at..at + 2 + usize::from(length));
    }
    whole(&tableless);
    // Restarts that are announced, and none is there.
    let interval = [0xFF, RESTART_INTERVAL, 0, 4, 0, 4];
    whole(&with(&bytes, frame, &interval));
}

#[test]
fn whatever_the_bytes_are_they_can_be_judged() {
    let judge = |bytes: &[u8]| {
        let share = damage(bytes);
        assert!(share.is_none_or(|share| (0.0..=1.0).contains(&share)));
    };
    let mut random = random();
    for bytes in kinds() {
        for length in 0..bytes.len() {
            let cut = &bytes[..length];
            judge(cut);
            judge(&[cut, &[0xFF, END_OF_IMAGE]].concat());
        }
        for _ in 0..3000 {
            let mut changed = bytes.clone();
            for _ in 0..1 + random() % 4 {
                let at = random() % bytes.len();
                changed[at] = match random() % 3 {
                    0 => 0,
                    1 => 0xFF,
                    _ => random() as u8,
                };
            }
            judge(&changed);
        }
    }
}
