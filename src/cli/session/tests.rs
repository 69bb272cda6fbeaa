//! Sessions whose photos turn out damaged.

use super::*;
use clap::Parser;
use std::path::{Path, PathBuf};

/// What a session is told beside its scene.
#[derive(Parser)]
struct Given {
    #[command(flatten)]
    proxy: ProxyArgs,
    #[command(flatten)]
    exposure: ExposureArgs,
    #[command(flatten)]
    field: FieldArgs,
    #[command(flatten)]
    draw: DrawArgs,
    #[command(flatten)]
    time: TimeArgs,
}

/// A session of a capture's points, on the CPU, without the photos of the given names.
fn session(capture: &Path, without: &BTreeSet<String>) -> Session {
    let line = "render --proxy points --no-exposure --device cpu";
    let given = Given::try_parse_from(line.split(' ')).unwrap();
    let (scene, _) = Scene::open(capture, false).unwrap();
    Session::new(
        scene,
        without.clone(),
        false,
        &given.proxy,
        &given.exposure,
        &given.field,
        &given.draw,
        &given.time,
        None,
    )
    .unwrap()
}

/// A capture of nine photos.
fn wall(folder: &Path) -> PathBuf {
    let capture = folder.join("wall");
    let options = datasets::Options {
        size: Some((96, 72)),
        samples_per_side: Some(1),
        ..datasets::Options::default()
    };
    let wall = datasets::by_name("wall", &options).unwrap();
    datasets::write(&wall, &capture).unwrap();
    capture
}

/// Two views that all nine photos have a part in, and how often they were begun anew: each time all that is drawn
/// from is made again.
fn drawn(session: &mut Session) -> (Vec<RgbaImage>, usize) {
    let photo = |name: &str| session.scene.view(name).unwrap();
    let between = |a: &str, b: &str| (photo(a).between(&photo(b), 0.4), None);
    let views = [
        between("0000.png", "0008.png"),
        between("0001.png", "0003.png"),
    ];
    let mut pictures = BTreeMap::new();
    let mut anew = 0;
    let take = |i: usize, picture: RgbaImage| {
        pictures.insert(i, picture);
        anyhow::Ok(())
    };
    let again = |_: &BTreeMap<String, String>| {
        anew += 1;
        anyhow::Ok(())
    };
    session
        .draw_all(&views, &mut [false; 2], take, again)
        .unwrap();
    (pictures.into_values().collect(), anew)
}

#[test]
fn all_damaged_photos_that_a_picture_asks_for_are_left_out_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let capture = wall(folder.path());
    let damaged: BTreeSet<String> = [2, 4, 5, 7].map(|i| format!("{i:04}.png")).into();
    let (expected, anew) = drawn(&mut session(&capture, &damaged));
    assert_eq!((expected.len(), anew), (2, 0));

    // 1. The first picture finds four.
    for name in &damaged {
        let file = capture.join("images").join(name);
        let whole = std::fs::read(&file).unwrap();
        std::fs::write(&file, &whole[..whole.len() * 2 / 3]).unwrap();
    }
    let none = BTreeSet::new();
    let mut finding = session(&capture, &none);
    let (pictures, anew) = drawn(&mut finding);
    assert!(pictures == expected);
    assert_eq!(anew, 1);
    assert!(finding.left_out.keys().eq(&damaged));

    // 2. They are known beforehand.
    let mut knowing = session(&capture, &none);
    let known = finding.left_out;
    assert!(knowing.leave_out_known(&known).unwrap());
    assert_eq!(knowing.lumigraph().sources.len(), 5);
    assert!(!knowing.leave_out_known(&known).unwrap());
    let (pictures, anew) = drawn(&mut knowing);
    assert!(pictures == expected);
    assert_eq!(anew, 0);
}

#[test]
fn pictures_are_taken_in_order_and_none_after_one_that_was_not() {
    let folder = tempfile::tempdir().unwrap();
    let mut session = session(&wall(folder.path()), &BTreeSet::new());
    let view = |name: &str| (session.scene.view(name).unwrap(), None);
    let views = ["0000.png", "0004.png", "0008.png", "0002.png"].map(view);
    for full_at in [0, 2, 3, 4] {
        let mut taken = Vec::new();
        let take = |i: usize, _: RgbaImage| {
            taken.push(i);
            anyhow::ensure!(i < full_at, "no room for picture {i}");
            Ok(())
        };
        let drawn = session.draw_all(&views, &mut [false; 4], take, |_| Ok(()));
        let expected: Vec<usize> = (0..=full_at).take(views.len()).collect();
        assert_eq!(taken, expected);
        match drawn {
            Ok(()) => assert_eq!(full_at, 4),
            Err(error) => assert_eq!(error.to_string(), format!("no room for picture {full_at}")),
        }
    }
}
