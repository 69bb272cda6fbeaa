//! Frames made a film, and films that are refused.

#[cfg(unix)]
use crate::run::with_script;
use crate::run::{files, lumigraph, run, with_wall};
use calibrate::{Camera, ModelKind, Rigid3};
use render::path::{CameraPath, PathFrame};

#[test]
fn a_film_is_shared_resumed_and_made() {
    let folder = with_wall();
    let render = "render wall --proxy plane --path sweep --size 47x35 --background #204060";
    let whole = format!("{render} --frames 6 -o whole --video films/sweep.mp4 --fps 12");
    lumigraph(folder.path(), &whole).ok();
    let frames = files(&folder.path().join("whole"));
    assert_eq!(frames.len(), 6);
    let some = image::open(
        folder
            .path()
            .join("whole")
            .join(frames.keys().next().unwrap()),
    );
    assert!(some.unwrap().to_rgba8().pixels().all(|p| p.0[3] == 255));
    // Others can tell what is in it.
    let film = folder.path().join("films/sweep.mp4");
    let probe = std::process::Command::new("ffprobe")
        .args(["-v", "error", "-count_frames", "-show_entries"])
        .args([
            "stream=nb_read_frames,width,height,r_frame_rate",
            "-of",
            "csv=p=0",
        ])
        .arg(&film)
        .output()
        .unwrap();
    let probed = String::from_utf8_lossy(&probe.stdout).trim().to_owned();
    assert_eq!(probed, "48,36,12/1,6");
    assert_eq!(files(&folder.path().join("films")).len(), 1);
    // It is larger by what the frames end in, not by black.
    let shown = std::process::Command::new("ffmpeg")
        .args(["-v", "error", "-i"])
        .arg(&film)
        .args(["-frames:v", "1", "-f", "rawvideo", "-pix_fmt", "rgb24", "-"])
        .output()
        .unwrap();
    assert_eq!(shown.stdout.len(), 3 * 48 * 36);
    let brightness = |x: usize, y: usize| -> i32 {
        let at = 3 * (48 * y + x);
        shown.stdout[at..at + 3].iter().map(|c| i32::from(*c)).sum()
    };
    let beside = |off: i32| assert!(off.abs() < 3 * 32, "{off}");
    (0..36).for_each(|y| beside(brightness(47, y) - brightness(46, y)));
    (0..48).for_each(|x| beside(brightness(x, 35) - brightness(x, 34)));

    // In parts, and after an interruption, the bytes are the same.
    for part in ["0..2/6", "2..6/6"] {
        let line = format!("{render} --frames {part} -o parts --resume");
        lumigraph(folder.path(), &line).ok();
    }
    let lost = folder
        .path()
        .join("parts")
        .join(frames.keys().nth(3).unwrap());
    std::fs::remove_file(&lost).unwrap();
    let line = format!("{render} --frames 6 -o parts --resume");
    let again = lumigraph(folder.path(), &line).ok();
    assert!(
        again.stdout.contains("6 frames, 5 of them from before"),
        "{}",
        again.stdout
    );
    let mut parts = files(&folder.path().join("parts"));
    assert!(parts.remove(std::path::Path::new("resume.json")).is_some());
    assert!(parts == frames);

    // Frames of something else are not mixed in.
    let other = format!("{render} --frames 6 --k 2 -o parts --resume");
    let error = lumigraph(folder.path(), &other).error(1);
    assert!(error.contains("another command line"), "{error}");
    let photo = folder.path().join("wall/images/0000.png");
    let bytes = std::fs::read(&photo).unwrap();
    std::fs::write(&photo, bytes).unwrap();
    let error = lumigraph(folder.path(), &line).error(1);
    assert!(
        error.contains("made of other files: wall/images/0000.png was written since"),
        "{error}"
    );
    let error = lumigraph(
        folder.path(),
        &format!("{render} --frames 6 -o whole --resume"),
    )
    .error(1);
    assert!(error.contains("without --resume"), "{error}");
    // Which is said before the scene is looked at.
    for (part, count) in [("5..7/6", 6), ("2..99", 30)] {
        let line = format!("render gone --path sweep --frames {part} -o beyond");
        let beyond = lumigraph(folder.path(), &line);
        assert_eq!(beyond.code, 2, "{part}");
        let said = format!("--frames {part}: the path has {count} frames");
        assert!(beyond.stderr.contains(&said), "{}", beyond.stderr);
    }
}

#[test]
fn without_ffmpeg_a_film_fails_before_anything_is_drawn() {
    let folder = with_wall();
    let line = "render wall --proxy plane --path sweep -o frames --video film.mp4";
    let words: Vec<&str> = line.split(' ').collect();
    let error = run(folder.path(), &words, &[("PATH", "/nowhere")]).error(1);
    assert!(error.contains("apt-get install ffmpeg"), "{error}");
    assert!(!folder.path().join("frames").exists());
}

/// An ffmpeg that always reports success, though it left nothing, or what it cannot read.
#[cfg(unix)]
#[test]
fn a_film_that_ffmpeg_leaves_empty_or_unreadable_is_none() {
    // The film that is tried first, of 16 × 16 pixels with a whole path, is well.
    let script = |left: &str| {
        format!(
            r#"#!/bin/sh
case "$*" in
-version | *"-i file:/"*) exit ;;
*"-i file:"*) echo 'no film at all' >&2; exit 1 ;;
esac
cat >/dev/null
case "$*" in *16x16*) film='a film' ;; *) film='{left}' ;; esac
for last; do :; done
printf '%s' "$film" >"${{last#file:}}"
"#
        )
    };
    let folder = with_wall();
    let here = folder.path();
    std::fs::write(here.join("film.mp4"), "the film before").unwrap();
    let line =
        "render wall --proxy plane --path sweep --frames 2 --size 48x36 -o out --video film.mp4";
    let words: Vec<&str> = line.split(' ').collect();
    for (left, said) in [
        (
            "",
            "film.mp4: ffmpeg left no film, or an empty file; check that the disk",
        ),
        (
            "half a film",
            "film.mp4: ffmpeg cannot read the film that it made; check that the disk is not full, and that this ffmpeg \
             has a decoder",
        ),
    ] {
        let path = with_script(here, "ffmpeg", &script(left));
        let error = run(here, &words, &[("PATH", &path)]).error(1);
        assert!(error.starts_with(said), "{error}");
        let film = std::fs::read(here.join("film.mp4")).unwrap();
        assert_eq!(film, b"the film before");
        let left = files(here).into_keys();
        assert!(
            !left
                .map(|name| name.display().to_string())
                .any(|name| name.contains("partial"))
        );
    }
}

#[test]
fn a_film_by_no_name_of_films_is_refused_before_anything_is_drawn() {
    let folder = with_wall();
    let render = |video: &str| {
        let line = "render wall --proxy plane --path sweep --frames 2 --size 48x36 -o out --video";
        lumigraph(folder.path(), &format!("{line} {video}"))
    };
    // A name of pictures is good for one frame at most.
    for video in ["a", "a.xyz", "a.png"] {
        let error = render(video).error(2);
        let said = format!(
            "--video {video}: ffmpeg makes no film of that name; films end in .mp4, .webm, .mkv,"
        );
        assert!(error.starts_with(&said), "{error}");
        assert!(!folder.path().join("out").exists(), "{video}");
    }
    for video in ["a.MP4", "a.mov"] {
        render(video).ok();
        assert!(folder.path().join(video).is_file(), "{video}");
    }
}

#[test]
fn frames_of_several_sizes_are_no_film_and_none_is_drawn() {
    let folder = with_wall();
    let frame = |name: &str, width: u32| {
        let camera = Camera {
            model: ModelKind::Pinhole,
            width,
            height: 36,
            params: vec![40.0, 40.0, 24.0, 18.0],
        };
        PathFrame::new(name.to_owned(), camera, Rigid3::IDENTITY, None).unwrap()
    };
    let path = CameraPath::new(30.0, vec![frame("a", 48), frame("b", 48), frame("c", 64)]);
    render::path::write(&folder.path().join("path.json"), &path.unwrap()).unwrap();
    let film = |options: &str| {
        let line =
            format!("render wall --proxy plane --path path.json -o out --video f.mp4{options}");
        lumigraph(folder.path(), &line)
    };
    let error = film("").error(2);
    assert_eq!(
        error,
        "--video f.mp4: frames of a film are of one size, but a has 48x36 pixels and c 64x36; give --size"
    );
    assert!(!folder.path().join("out").exists());
    // Those that are not drawn are not in the film, and all can be of one size.
    film(" --frames 0..2").ok();
    film(" --size 32x24").ok();
}

#[test]
fn a_film_is_no_folder() {
    let folder = with_wall();
    let before = files(folder.path());
    for (video, output) in [
        ("x.mp4", "x.mp4"),
        ("./x.mp4", "x.mp4/frames"),
        ("wall", "out"),
    ] {
        let line = format!("render wall --path orbit --video {video} -o {output}");
        let error = lumigraph(folder.path(), &line).error(2);
        let said = format!("--video {video}: a folder has that name, or would have it");
        assert!(error.starts_with(&said), "{line}: {error}");
        assert!(files(folder.path()) == before, "{line}");
    }
}
