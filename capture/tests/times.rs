//! When photos were taken.

use capture::{read_exif, read_times, times_of_names};
use std::collections::BTreeMap;
use std::fs;
use tempfile::TempDir;

/// The start of a JPEG file that says when it was taken.
fn jpeg_with_exif(taken: &str, fraction: Option<&str>) -> Vec<u8> {
    // One entry of a directory: tag, ASCII, and its text at an offset, or within.
    let entry = |tag: u16, text: &[u8], at: u32| {
        let mut bytes = tag.to_be_bytes().to_vec();
        bytes.extend([0, 2]);
        bytes.extend((text.len() as u32).to_be_bytes());
        match text.len() {
            0..=4 => bytes.extend(text.iter().chain(&[0; 4]).take(4)),
            _ => bytes.extend(at.to_be_bytes()),
        }
        bytes
    };
    let mut tiff = b"MM\0\x2a\0\0\0\x08".to_vec();
    // The first directory points to EXIF's own, right behind it.
    tiff.extend([0, 1, 0x87, 0x69, 0, 4, 0, 0, 0, 1, 0, 0, 0, 26, 0, 0, 0, 0]);
    let taken = [taken.as_bytes(), b"\0"].concat();
    let fraction = fraction.map(|digits| [digits.as_bytes(), b"\0"].concat());
    let count = 1 + usize::from(fraction.is_some());
    let text_at = 26 + 2 + 12 * count as u32 + 4;
    tiff.extend([0, count as u8]);
    tiff.extend(entry(0x9003, &taken, text_at));
    if let Some(digits) = &fraction {
        tiff.extend(entry(0x9291, digits, text_at + taken.len() as u32));
    }
    tiff.extend([0; 4]);
    tiff.extend(&taken);
    tiff.extend(fraction.unwrap_or_default());
    let mut jpeg = vec![0xff, 0xd8, 0xff, 0xe1];
    jpeg.extend((8 + tiff.len() as u16).to_be_bytes());
    jpeg.extend(b"Exif\0\0");
    jpeg.extend(tiff);
    jpeg.extend([0xff, 0xd9]);
    jpeg
}

#[test]
fn cameras_write_the_time_to_a_fraction_of_a_second() {
    let folder = TempDir::new().unwrap();
    let time_of = |bytes: &[u8]| {
        let path = folder.path().join("a.jpg");
        fs::write(&path, bytes).unwrap();
        read_exif(&path).unwrap().taken_s
    };
    const THEN: f64 = 1_706_715_902.0;
    let taken = "2024:01:31 15:45:02";
    assert_eq!(time_of(&jpeg_with_exif(taken, None)), Some(THEN));
    assert_eq!(
        time_of(&jpeg_with_exif(taken, Some("25"))),
        Some(THEN + 0.25)
    );
    assert_eq!(
        time_of(&jpeg_with_exif(taken, Some("062500"))),
        Some(THEN + 0.0625)
    );
    assert_eq!(time_of(&jpeg_with_exif(taken, Some("  "))), Some(THEN));
    for unset in ["0000:00:00 00:00:00", "2024:02:30 15:45:02", "yesterday"] {
        assert_eq!(time_of(&jpeg_with_exif(unset, None)), None, "{unset}");
    }
    // Nothing there, nothing whole, nothing at all.
    let whole = jpeg_with_exif(taken, Some("062500"));
    for end in 0..whole.len() - 2 {
        assert_eq!(time_of(&whole[..end]), None, "{end}");
    }
    assert!(read_exif(&folder.path().join("none.jpg")).is_err());
}

#[test]
fn names_of_one_kind_give_times() {
    let dates = [
        "IMG_20240131_154502.jpg",
        "a.jpg",
        "IMG_20240131_154500.jpg",
    ];
    assert_eq!(times_of_names(&dates), [Some(2.0), None, Some(0.0)]);
    let seconds = ["00012.500.jpg", "00003.000.jpg"];
    assert_eq!(times_of_names(&seconds), [Some(12.5), Some(3.0)]);
    let both = ["IMG_20240131_154502.jpg", "00003.000.jpg"];
    assert_eq!(times_of_names(&both), [None, None]);
    assert_eq!(times_of_names(&["frame_000001.jpg"]), [None]);
}

fn read(text: &str) -> Result<BTreeMap<String, f64>, String> {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("times.csv");
    fs::write(&path, text).unwrap();
    let is_photo = |name: &str| ["a.jpg", "b/b.jpg", "c,d.jpg"].contains(&name);
    read_times(&path, is_photo).map_err(|error| {
        let text = error.to_string();
        text.replace(&format!("{}", path.display()), "times.csv")
    })
}

#[test]
fn lists_are_read_with_or_without_a_header() {
    let expected = BTreeMap::from([("a.jpg".to_owned(), 1.5), ("b/b.jpg".to_owned(), -2e-1)]);
    for text in [
        "a.jpg,1.5\nb/b.jpg,-0.2",
        "name,seconds\na.jpg,1.5\nb/b.jpg,-0.2\n",
        "\u{feff}# by hand\r\n\r\nphoto, time in s\r\n a.jpg , 1.5 \r\n\"b/b.jpg\",-2e-1\r\n",
        "name,seconds\ra.jpg,1.5\r\rb/b.jpg,-0.2\r",
        "\"name\",\"seconds\"\r\n\"a.jpg\",\"1.5\"\r\n\"b/b.jpg\" , \" -0.2\" \r\n",
    ] {
        assert_eq!(read(text).unwrap(), expected, "{text}");
    }
    for text in ["\"c,d.jpg\",3\n", "\"c,d.jpg\",\"3\"\n"] {
        assert_eq!(read(text).unwrap()["c,d.jpg"], 3.0);
    }
}

#[test]
fn mistakes_in_lists_are_told_by_line() {
    for (text, said) in [
        (
            "",
            "times.csv: no photo has a time here; expected lines such as a.jpg,12.5 (name,seconds)",
        ),
        (
            "name,seconds\n",
            "times.csv: no photo has a time here; expected lines such as a.jpg,12.5 (name,seconds)",
        ),
        (
            "a.jpg 1.5\n",
            "times.csv, line 1: found \"a.jpg 1.5\"; expected name,seconds, as in a.jpg,12.5",
        ),
        (
            "name,seconds\na.jpg,soon\n",
            "times.csv, line 2: the time of a.jpg is \"soon\"; expected seconds",
        ),
        (
            "a.jpg,soon\n",
            "times.csv, line 1: the time of a.jpg is \"soon\"; expected seconds",
        ),
        (
            "a.jpg,inf\n",
            "times.csv, line 1: the time of a.jpg is \"inf\"; expected seconds",
        ),
        (
            "a.jpg,1\n\nx.jpg,2\n",
            "times.csv, line 3: there is no photo x.jpg; names are paths within the photo folder",
        ),
        (
            "a.jpg,1\r\rx.jpg,2\r",
            "times.csv, line 3: there is no photo x.jpg; names are paths within the photo folder",
        ),
        (
            "a.jpg,1\na.jpg,2\n",
            "times.csv, line 2: photo a.jpg has a time on line 1 already; keep one",
        ),
    ] {
        assert_eq!(read(text).unwrap_err(), said, "{text}");
    }
    let error = read_times("nowhere.csv".as_ref(), |_| true)
        .unwrap_err()
        .to_string();
    assert!(
        error.starts_with("nowhere.csv: cannot read the times: "),
        "{error}"
    );
    // As some shells and spreadsheets write text: the path is right.
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("times.csv");
    let text = "\u{feff}a.jpg,1\r\n".encode_utf16();
    fs::write(&path, text.flat_map(u16::to_le_bytes).collect::<Vec<u8>>()).unwrap();
    let error = read_times(&path, |_| true).unwrap_err().to_string();
    assert!(
        error.ends_with("times.csv: the times are not in UTF-8; save the list as UTF-8"),
        "{error}"
    );
}

/// Spreadsheets write semicolons where numbers have decimal commas, and tabs.
#[test]
fn other_separators_than_commas_are_named() {
    let remedy = "; expected a comma, and a point in numbers, as in a.jpg,12.5: save the list anew, \
                  or replace them";
    for (text, line, separator) in [
        ("a.jpg;1\n", 1, "semicolon"),
        ("a.jpg;1,5\n", 1, "semicolon"),
        ("Name;Zeit, s\n\"b/b.jpg\";1,5\n", 2, "semicolon"),
        ("a.jpg\t1.5\n", 1, "tab"),
        ("c,d.jpg \t1.5\n", 1, "tab"),
    ] {
        let expected = format!(
            "times.csv, line {line}: name and seconds are separated by a {separator}{remedy}"
        );
        assert_eq!(read(text).unwrap_err(), expected, "{text}");
    }
    // Names may have them.
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("times.csv");
    fs::write(&path, "a.jpg;1.jpg,2\n").unwrap();
    let times = read_times(&path, |name| ["a.jpg", "a.jpg;1.jpg"].contains(&name)).unwrap();
    assert_eq!(times, BTreeMap::from([("a.jpg;1.jpg".to_owned(), 2.0)]));
}
