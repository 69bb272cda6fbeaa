//! Wrong input in every format that has room for it: an error that names the file, the
//! place and what was found; or, where the meaning is plain, the right reading.

mod numbers;
mod records;
mod samples;

use samples::{Sample, read};

/// What one edit of a whole file must lead to: an error with all of these passages.
type Case = (Sample, &'static str, &'static str, &'static [&'static str]);

#[track_caller]
fn refused(cases: &[Case]) {
    let mut wrong = Vec::new();
    for &(sample, from, to, passages) in cases {
        match read(sample, from, to) {
            Ok(_) => wrong.push(format!("{sample:?}, {from:?} → {to:?}: accepted")),
            Err(error) if passages.iter().all(|passage| error.contains(passage)) => {}
            Err(error) => wrong.push(format!("{sample:?}, {from:?} → {to:?}: {error}")),
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[track_caller]
fn accepted(cases: &[(Sample, &str, &str)]) {
    for &(sample, from, to) in cases {
        if let Err(error) = read(sample, from, to) {
            panic!("{sample:?}, {from:?} → {to:?}: {error}");
        }
    }
}

use Sample::*;

#[test]
fn samples_are_whole() {
    accepted(&Sample::ALL.map(|sample| (sample, "", "")));
}

#[test]
fn files_of_nothing() {
    for sample in Sample::ALL {
        if sample == Points {
            // COLMAP itself asks for such a file where poses are known.
            continue;
        }
        let error = samples::parse(sample, b"").unwrap_err();
        assert!(error.contains(sample.file()), "{sample:?}: {error}");
    }
}

#[test]
fn what_editors_and_other_systems_do_to_text() {
    for sample in Sample::ALL {
        let text = sample.text();
        let plain = samples::parse(sample, text.as_bytes()).unwrap();
        let marked = format!("\u{feff}{text}");
        assert_eq!(
            samples::parse(sample, marked.as_bytes()).as_ref(),
            Ok(&plain),
            "{sample:?} with a mark"
        );
        let returns = text.replace('\n', "\r\n");
        assert_eq!(
            samples::parse(sample, returns.as_bytes()).as_ref(),
            Ok(&plain),
            "{sample:?} with returns"
        );
    }
    // What is made of lines, as old Macs end them.
    for sample in [Cameras, Images, Points, Nvm, NvmFixed, Bundler] {
        let text = sample.text();
        let plain = samples::parse(sample, text.as_bytes()).unwrap();
        let returns = text.replace('\n', "\r");
        assert_eq!(
            samples::parse(sample, returns.as_bytes()).as_ref(),
            Ok(&plain),
            "{sample:?} with returns alone"
        );
    }
}

#[test]
fn names_of_any_kind() {
    for (sample, from) in [
        (Images, "a.jpg"),
        (Nvm, "a\"b.jpg"),
        (Transforms, "d.jpg"),
        (Meshroom, "images\\\\a.jpg"),
        (OpenMvg, "a.jpg"),
    ] {
        for (stored, name) in [
            ("dir/two words.jpg", "dir/two words.jpg"),
            ("ordner\\größe 写真.jpg", "ordner/größe 写真.jpg"),
        ] {
            let is_json = sample.text().starts_with('{');
            let written = if is_json {
                stored.replace('\\', "\\\\")
            } else {
                stored.to_owned()
            };
            let whole = read(sample, from, &written).unwrap();
            let names: Vec<&str> = whole.images.values().map(|i| i.name.as_str()).collect();
            assert!(names.contains(&name), "{sample:?}: {names:?}");
        }
    }
}

#[test]
fn principal_points_may_lie_far_outside() {
    // Photos are cropped, and that is no reason to refuse them.
    accepted(&[
        (Cameras, "90 50 40", "90 -5000 1e6"),
        (Transforms, "\"fl_x\": 90", "\"fl_x\": 90, \"cx\": -5000"),
        (OpenMvg, "51.5, 38.0", "-5000, 1e6"),
        (Yaml, "320., 0., 510., 240.", "-5000., 0., 510., 1e6"),
    ]);
}
