//! Frames of earlier walks: counted, gone on with, and never mixed with others.

use crate::interior::{HALVES, with_house};
use crate::run::{files, lumigraph, with_generated};
use serde_json::Value;

#[test]
fn frames_from_before_are_counted_by_kind() {
    let folder = with_house();
    let here = folder.path();
    let line = "walk house --portals ldi,warp1 --frames 6 --size 32x24 --reference-size 24x24 \
                -o out --resume";
    let said = lumigraph(here, line).ok().stdout;
    assert!(said.contains("out: 6 frames, drawn by CPU"), "{said}");
    for i in [1, 4] {
        std::fs::remove_file(here.join(format!("out/ldi/frame_000{i}.png"))).unwrap();
    }
    let said = lumigraph(here, line).ok().stdout;
    let expected = "out: 6 frames, from before 4 of ldi, 6 of warp1, drawn by";
    assert!(said.contains(expected), "{said}");
    let svg = std::fs::read_to_string(here.join("out/times.svg")).unwrap();
    assert!(svg.contains(">ldi<") && !svg.contains(">warp1<"), "{svg}");
}

#[test]
fn images_and_layered_images_are_counted_apart_and_those_made_ahead_with_them() {
    let folder = with_house();
    let here = folder.path();
    let line = "walk house --portals warp1,ldi --frames 12 --size 32x24 --reference-size 24x24 \
                --ldi-views 3 --json -o out";
    let report = lumigraph(here, line).ok().json();
    let [warp, ldi] = [0_usize, 1].map(|i| &report["walks"][i]);
    let count = |of: &Value, what: &str| of[what].as_u64().unwrap();
    for walk in [warp, ldi] {
        let sum = |what: &str| -> u64 {
            let frames = walk["frames"].as_array().unwrap();
            frames.iter().map(|frame| count(frame, what)).sum()
        };
        for what in ["ldis_made", "ldis_read", "ldis_ahead"] {
            assert_eq!(count(walk, what), sum(what), "{what}");
        }
        let made = sum("references_made") + count(walk, "references_made_ahead");
        assert_eq!(count(walk, "references_made"), made);
        assert!(count(walk, "references_used") <= count(&report, "references_possible"));
    }
    let of_walks = [warp, ldi].map(|walk| count(walk, "references_made"));
    assert_eq!(
        of_walks.iter().sum::<u64>(),
        count(&report, "references_made")
    );
    let used = |of: &Value| [count(of, "references_used") > 0, count(of, "ldis_used") > 0];
    assert_eq!((used(warp), used(ldi)), ([true, false], [false, true]));
    let ahead = ["references_made_ahead", "ldis_ahead"].map(|what| count(warp, what));
    assert_eq!(ahead, [0, 0]);
}

#[test]
fn frames_of_a_capture_calibrated_anew_are_not_mixed_in() {
    let folder = with_generated("hallway --size 96x72 -o hall");
    let here = folder.path();
    std::fs::write(here.join("halves.json"), HALVES).unwrap();
    lumigraph(here, "interior hall --rooms halves.json -o house").ok();
    let frame = r#"{"transform": [[1,0,0,0],[0,1,0,0],[0,0,1,0]], "scale": 1}"#;
    std::fs::write(here.join("frame.json"), frame).unwrap();
    lumigraph(here, "walk house --frames 2 --size 32x24 -o tour").ok();
    let named = "--path tour/path.json --dataparser-transforms frame.json";
    let cases = [
        ("--frames 2", "house/../hall/sparse/0/images.bin"),
        (named, "frame.json"),
    ];
    for (i, (more, file)) in cases.into_iter().enumerate() {
        let line = format!("walk house {more} --size 32x24 -o out{i} --resume");
        lumigraph(here, &line).ok();
        let again = lumigraph(here, &line).ok().stdout;
        assert!(again.contains("2 frames, 2 of them from before"), "{again}");
        let path = here.join(file);
        std::fs::write(&path, std::fs::read(&path).unwrap()).unwrap();
        let error = lumigraph(here, &line).error(1);
        let expected = format!("made of other files: {file} was written since;");
        assert!(error.contains(&expected), "{error}");
    }
}

#[test]
fn a_tour_is_written_over_no_path_but_a_tour() {
    let folder = with_house();
    let here = folder.path();
    let film = here.join("film/path.json");
    let tour = |frames: u32| format!("walk house --frames {frames} --size 32x24 -o film");
    // Another tour takes the place of one, of whatever length, size and house.
    lumigraph(here, &tour(3)).ok();
    let first = std::fs::read(&film).unwrap();
    lumigraph(here, &tour(3)).ok();
    assert!(std::fs::read(&film).unwrap() == first);
    lumigraph(here, &tour(2)).ok();
    assert!(std::fs::read(&film).unwrap() != first);
    let other = "generate house --rooms 2 --triangles 1 --seed 2 -o house-2";
    lumigraph(here, other).ok();
    lumigraph(here, "walk house-2 --frames 2 --size 24x24 -o film").ok();
    // So does it where an earlier version, which made no mark, wrote the very path.
    lumigraph(here, &tour(3)).ok();
    let mut path = render::path::read(&film).unwrap();
    assert!(path.extra.remove("tour").is_some());
    render::path::write(&film, &path).unwrap();
    lumigraph(here, &tour(3)).ok();
    assert!(std::fs::read(&film).unwrap() == first);
    // What people made stays: keyframes, as `view` saves them, a path, a tour that was changed, and
    // what is no path at all.
    let keyframe = |t_s: f64, frame: &render::PathFrame| render::path::Keyframe {
        t_s,
        camera_from_world: frame.view.camera_from_world,
        camera: frame.camera.clone(),
        time_s: None,
    };
    let keyframes = render::path::KeyframeFile {
        fps: 30.0,
        keyframes: vec![
            keyframe(0.0, &path.frames[0]),
            keyframe(1.0, &path.frames[1]),
        ],
        interpolation: render::path::Interpolation::Linear,
    };
    let own = here.join("own.json");
    render::path::write_keyframes(&own, &keyframes).unwrap();
    let saved = std::fs::read(&own).unwrap();
    path.frames.truncate(2);
    render::path::write(&own, &path).unwrap();
    let part = std::fs::read(&own).unwrap();
    let changed = String::from_utf8(first).unwrap();
    let changed = changed
        .replacen("\"fps\": 15", "\"fps\": 16", 1)
        .into_bytes();
    for kept in [saved, part, changed, b"thesis".to_vec()] {
        std::fs::write(&film, &kept).unwrap();
        let _ = std::fs::remove_file(here.join("film/frame_0000.png"));
        let error = lumigraph(here, &tour(3)).error(1);
        assert!(error.contains("--path film/path.json, or"), "{error}");
        assert!(std::fs::read(&film).unwrap() == kept);
        assert!(!here.join("film/frame_0000.png").exists());
    }
}

#[test]
fn no_frames_are_drawn_into_an_interiors_folder() {
    let folder = with_house();
    let here = folder.path();
    let before = files(&here.join("house"));
    for (from, line) in [
        ("", "walk house --frames 1 --size 16x12 -o house"),
        ("house", "walk interior.json --frames 1 --size 16x12 -o ."),
    ] {
        let error = lumigraph(&here.join(from), line).error(1);
        let said = ": this folder holds an interior, and what else lies there keeps it from being \
                    replaced; choose another -o";
        assert!(error.contains(said), "{error}");
    }
    assert!(files(&here.join("house")) == before);
}

#[test]
fn a_walk_that_is_refused_leaves_the_tour_of_the_frames_that_are_there() {
    let folder = with_house();
    let here = folder.path();
    let walk = "walk house --size 24x18";
    lumigraph(here, &format!("{walk} --frames 2 -o film --resume")).ok();
    let before = files(&here.join("film"));
    let error = lumigraph(here, &format!("{walk} --frames 3 -o film --resume")).error(1);
    assert!(error.contains("another command line"), "{error}");
    assert!(files(&here.join("film")) == before);
    // Of several kinds, where one alone is refused: the others are not begun.
    let both = format!("{walk} --portals geometry,whole");
    lumigraph(here, &format!("{both} --frames 2 -o both")).ok();
    let tour = std::fs::read(here.join("both/path.json")).unwrap();
    std::fs::remove_dir_all(here.join("both/geometry")).unwrap();
    let error = lumigraph(here, &format!("{both} --frames 3 -o both --resume")).error(1);
    assert!(
        error.contains("both/whole: there are frames here"),
        "{error}"
    );
    assert!(std::fs::read(here.join("both/path.json")).unwrap() == tour);
    assert!(!here.join("both/geometry/frame_0000.png").exists());
}

#[test]
fn pictures_of_an_earlier_walk_are_told_of() {
    let folder = with_house();
    let told = |options: &str| {
        let line = format!("walk house --size 16x12 {options} -o out");
        let said = lumigraph(folder.path(), &line).ok().stderr;
        let told = said.lines().filter(|line| line.contains("of this run"));
        told.map(str::to_owned).collect::<Vec<String>>()
    };
    assert_eq!(told("--frames 3"), [""; 0]);
    let one = "note: frame_0002.png in out is not of this run";
    assert_eq!(told("--frames 2"), [one]);
    // Those of other parts are not of other walks.
    assert_eq!(told("--frames 0..1/3"), [""; 0]);
    let all = "note: 3 pictures in out are not of this run, as frame_0000.png";
    assert_eq!(told("--frames 2 --portals geometry,whole"), [all]);
    let of_kind = |kind: &str| {
        format!("note: 2 pictures in out/{kind} are not of this run, as frame_0000.png")
    };
    let others = [of_kind("geometry"), of_kind("whole")];
    assert_eq!(told("--frames 3 --portals whole"), others);
}
