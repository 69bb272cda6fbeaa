//! Frames of earlier runs: gone on with where they are the same, and never mixed with others.

use crate::run::{files, lumigraph, with_wall};
use std::fs;

#[test]
fn frames_that_a_run_without_resume_made_are_not_taken_for_those_of_before() {
    let folder = with_wall();
    let here = folder.path();
    let resume = here.join("out/resume.json");
    let render = "render wall --proxy plane --path sweep --size 48x36 --frames 2 -o out";
    lumigraph(here, &format!("{render} --resume")).ok();
    assert!(resume.exists());
    let told = "note: out: frames that runs with --resume left here are no longer gone on with";
    let ran = lumigraph(here, &format!("{render} --k 2")).ok();
    assert!(ran.stderr.contains(told), "{}", ran.stderr);
    let frames = files(&here.join("out"));
    assert_eq!(frames.len(), 2);
    let ran = lumigraph(here, &format!("{render} --k 2")).ok();
    assert!(!ran.stderr.contains(told), "{}", ran.stderr);
    let error = lumigraph(here, &format!("{render} --resume")).error(1);
    let said = "out: there are frames here, but no resume.json: a run without --resume made some";
    assert!(error.contains(said), "{error}");
    assert!(files(&here.join("out")) == frames);
    // A file that only has that name stays.
    fs::write(&resume, r#"{"work": []}"#).unwrap();
    lumigraph(here, render).ok();
    assert_eq!(fs::read(&resume).unwrap(), br#"{"work": []}"#);
}

#[test]
fn a_film_is_gone_on_with_as_long_as_none_of_its_frames_is_another_runs() {
    let folder = with_wall();
    let here = folder.path();
    let render = "render wall --proxy plane --size 48x36 -o out";
    let film = |frames: &str| format!("{render} --path sweep --frames {frames} --resume");
    lumigraph(here, &film("0..2/3")).ok();
    let before = files(&here.join("out"));
    let is_kept = || {
        let now = files(&here.join("out"));
        before.iter().all(|(file, bytes)| now[file] == *bytes)
    };
    // One that draws other frames, and one that draws none.
    let ran = lumigraph(here, &format!("{render} --views wall/sparse/0")).ok();
    assert!(!ran.stderr.contains("no longer gone on"), "{}", ran.stderr);
    assert!(is_kept());
    lumigraph(here, &film("0..2/3")).ok();
    let photo = here.join("wall/images/0003.png");
    let bytes = fs::read(&photo).unwrap();
    fs::write(&photo, &bytes[..bytes.len() / 2]).unwrap();
    let other = format!("{render} --path sweep --frames 3");
    let error = lumigraph(here, &format!("{other} --strict")).error(1);
    assert!(error.contains("0003.png"), "{error}");
    assert!(is_kept());
    // One that draws a frame that the film has not drawn yet.
    fs::write(&photo, &bytes).unwrap();
    let ran = lumigraph(
        here,
        &format!("{render} --path sweep --frames 2..3/3 --k 2"),
    )
    .ok();
    assert!(ran.stderr.contains("no longer gone on"), "{}", ran.stderr);
    let error = lumigraph(here, &film("3")).error(1);
    assert!(error.contains("but no resume.json"), "{error}");
}

#[test]
fn pictures_that_other_commands_make_are_not_taken_for_frames_of_before() {
    let folder = with_wall();
    let here = folder.path();
    let render = "render wall --proxy plane --size 48x36 --resume";
    for (film, other, told) in [
        (
            "--views wall/sparse/0 -o views",
            "evaluate wall --proxy plane --size 48x36 --every 4 --no-exposure -o views",
            "note: views: frames that",
        ),
        (
            "--path sweep --frames 0..1/2 -o sweep",
            "field wall --proxy plane --view 0004.png -o sweep/frame_0000.png",
            "note: sweep: frames that",
        ),
        (
            "--path sweep --frames 0..1/2 -o other",
            "field wall --proxy plane --view 0004.png -o other/../other/frame_0001.png",
            "other: frames that",
        ),
    ] {
        lumigraph(here, &format!("{render} {film}")).ok();
        let ran = lumigraph(here, other).ok();
        let notes = ran.stderr.matches("runs with --resume left here");
        assert_eq!(notes.count(), 1, "{}", ran.stderr);
        assert!(ran.stderr.contains(told), "{}", ran.stderr);
        let error = lumigraph(here, &format!("{render} {film}")).error(1);
        assert!(error.contains("but no resume.json"), "{error}");
    }
}

#[test]
fn frames_made_of_other_files_are_not_mixed_in() {
    let folder = with_wall();
    let here = folder.path();
    let write = |file: &str, text: &str| std::fs::write(here.join(file), text).unwrap();
    write("split.json", r#"{"test": ["0004.png"]}"#);
    let frame = r#"{"transform": [[1,0,0,0],[0,1,0,0],[0,0,1,0]], "scale": 1}"#;
    write("frame.json", frame);
    lumigraph(here, "import wall -o scene").ok();
    lumigraph(here, "proxy wall plane -o plane.json").ok();
    let lines = [
        "scene --proxy plane.json --hold-out split.json --views wall --frames 0..2",
        "wall --proxy=plane.json --path sweep --frames 2 --dataparser-transforms=frame.json",
    ];
    let times: String = (0..9).map(|i| format!("{i:04}.png,{i}\n")).collect();
    let cases = [
        (0, "plane.json"),
        (0, "split.json"),
        (0, "wall/sparse/0/images.bin"),
        (0, "scene/model/images.txt"),
        (1, "plane.json"),
        (1, "frame.json"),
        (1, "wall/sparse/0/points3D.bin"),
        (1, "wall/times.csv"),
    ];
    for (i, (line, file)) in cases.into_iter().enumerate() {
        let line = format!("render {} --size 48x36 -o out{i} --resume", lines[line]);
        lumigraph(here, &line).ok();
        // With all as it was, frames stay.
        let again = lumigraph(here, &line).ok().stdout;
        assert!(again.contains("2 frames, 2 of them from before"), "{again}");
        let path = here.join(file);
        let bytes = std::fs::read(&path).unwrap_or_else(|_| times.clone().into_bytes());
        let how = match path.exists() {
            true => "was written since",
            false => "is new",
        };
        std::fs::write(&path, bytes).unwrap();
        let error = lumigraph(here, &line).error(1);
        let expected = format!("made of other files: {file} {how};");
        assert!(error.contains(&expected), "{file}: {error}");
    }
}

#[test]
fn frames_of_an_earlier_run_are_told_of() {
    let folder = with_wall();
    let run = |count: u32| {
        let line =
            format!("render wall --proxy plane --path sweep --frames {count} --size 48x36 -o out");
        lumigraph(folder.path(), &line).ok().stderr
    };
    assert!(!run(3).contains("not of this run"));
    let said = run(2);
    let expected = "note: frame_0002.png in out is not of this run";
    assert!(said.contains(expected), "{said}");
}
