//! Frames and where they come from.

use crate::interior::with_house;
use crate::run::{files, lumigraph, run, with_wall};
use calibrate::{Camera, ModelKind, Rigid3, colmap};
use render::path::{CameraPath, PathFrame};
use std::fs;

#[test]
fn a_source_view_gives_its_photo_back() {
    let folder = with_wall();
    lumigraph(
        folder.path(),
        "render wall --proxy plane --views wall/sparse/0 -o frames",
    )
    .ok();
    let open = |name: &str| image::open(folder.path().join(name)).unwrap().into_rgba8();
    for i in 0..9 {
        let photo = open(&format!("wall/images/000{i}.png"));
        let frame = open(&format!("frames/000{i}.png"));
        let score = render::score::score(&frame, &photo).unwrap();
        assert!(score.psnr_covered.unwrap() >= 50.0, "{i}: {score:?}");
    }
}

#[test]
fn held_out_photos_do_not_paint() {
    let folder = with_wall();
    let render = |options: &str, out: &str| {
        let line = format!("render wall --proxy plane --views wall --json -o {out}{options}");
        lumigraph(folder.path(), &line).ok().json()
    };
    assert_eq!(render("", "all")["report"]["photos_total"], 9);
    let rest = render(" --hold-out wall/split.json", "rest");
    assert_eq!(rest["report"]["photos_total"], 7);
    let frame = |folder: &std::path::Path| fs::read(folder.join("0008.png")).unwrap();
    assert_ne!(
        frame(&folder.path().join("all")),
        frame(&folder.path().join("rest"))
    );
}

#[test]
fn path_files_render_what_they_say() {
    let folder = with_wall();
    let model = colmap::read_model(&folder.path().join("wall/sparse/0")).unwrap();
    let frames: Vec<PathFrame> = model
        .images
        .values()
        .map(|image| {
            let camera = model.cameras[&image.camera_id].clone();
            let name = format!("sub/{}", image.name);
            PathFrame::new(name, camera, image.camera_from_world, None).unwrap()
        })
        .collect();
    let path = CameraPath::new(30.0, frames).unwrap();
    render::path::write(&folder.path().join("path.json"), &path).unwrap();

    lumigraph(
        folder.path(),
        "render wall --proxy plane --views wall -o model",
    )
    .ok();
    lumigraph(
        folder.path(),
        "render wall --proxy plane --views path.json -o views",
    )
    .ok();
    lumigraph(
        folder.path(),
        "render wall --proxy plane --path path.json -o path",
    )
    .ok();
    let [of_model, of_views, of_path] =
        ["model", "views/sub", "path/sub"].map(|out| files(&folder.path().join(out)));
    assert_eq!(of_model.len(), 9);
    assert!(of_views == of_path);
    // A path's rotations are matrices: the last digit of a pose may differ, no more.
    for (name, bytes) in &of_model {
        let open = |bytes: &[u8]| image::load_from_memory(bytes).unwrap().into_rgba8();
        let (a, b) = (open(bytes), open(&of_path[name]));
        let off = a.iter().zip(b.iter()).filter(|(a, b)| a.abs_diff(**b) > 2);
        assert!(off.count() * 1000 < a.len(), "{}", name.display());
    }

    fs::write(folder.path().join("bad.json"), "{}").unwrap();
    let error = lumigraph(
        folder.path(),
        "render wall --proxy plane --path bad.json -o bad",
    )
    .error(1);
    assert!(error.starts_with("bad.json: "), "{error}");
    assert!(!folder.path().join("bad").exists());
}

#[test]
fn derived_paths_stay_within_cover() {
    let folder = with_wall();
    for kind in ["orbit", "dolly", "sweep"] {
        let line = format!(
            "render wall --proxy plane --path {kind} --frames 4 --size 64x48 --json -o {kind}"
        );
        let result = lumigraph(folder.path(), &line).ok().json();
        assert_eq!(result["frames"].as_array().unwrap().len(), 4);
        let frames = files(&folder.path().join(kind));
        assert_eq!(frames.len(), 4);
        for bytes in frames.values() {
            let frame = image::load_from_memory(bytes).unwrap().into_rgba8();
            assert_eq!(frame.dimensions(), (64, 48));
            let covered = frame.pixels().filter(|p| p.0[3] > 127).count();
            assert!(covered * 10 > 64 * 48 * 8, "{kind}: {covered}");
        }
    }
}

#[test]
fn names_that_clash_are_refused_before_rendering() {
    let folder = with_wall();
    let mut model = colmap::read_model(&folder.path().join("wall/sparse/0")).unwrap();
    let names = ["a/x.png", "a/x.jpg", "a/x.jpg.png"];
    for (image, name) in model.images.values_mut().zip(names) {
        image.name = name.to_owned();
    }
    colmap::write_text(&model, &folder.path().join("views")).unwrap();
    let error = lumigraph(
        folder.path(),
        "render wall --proxy plane --views views -o out",
    )
    .error(1);
    assert!(
        error.contains("a/x.jpg and a/x.jpg.png") && error.contains("rename"),
        "{error}"
    );
    assert!(!folder.path().join("out").exists());

    model.images.values_mut().next().unwrap().name = "../../x.png".to_owned();
    colmap::write_text(&model, &folder.path().join("views")).unwrap();
    let error = lumigraph(
        folder.path(),
        "render wall --proxy plane --views views -o out",
    )
    .error(1);
    assert!(error.contains("leads out of the output folder"), "{error}");
}

#[test]
fn parts_of_a_path_agree_on_what_files_are_called() {
    let folder = with_wall();
    let mut model = colmap::read_model(&folder.path().join("wall/sparse/0")).unwrap();
    for (image, name) in model.images.values_mut().zip(["a/x.png", "a/x.jpg"]) {
        image.name = name.to_owned();
    }
    colmap::write_text(&model, &folder.path().join("views")).unwrap();
    // The last of nine, by name.
    for part in ["7..8", "8..9"] {
        let line =
            format!("render wall --proxy plane --views views --frames {part} --size 32x24 -o out");
        lumigraph(folder.path(), &line).ok();
    }
    let written: Vec<_> = files(&folder.path().join("out")).into_keys().collect();
    assert_eq!(
        written,
        ["a/x.jpg.png", "a/x.png"].map(std::path::Path::new)
    );
}

#[test]
fn only_photos_in_use_are_decoded() {
    let folder = with_wall();
    let mut model = colmap::read_model(&folder.path().join("wall/sparse/0")).unwrap();
    // From a source photo's place through a longer lens: that photo alone paints it all.
    let first = *model.images.keys().next().unwrap();
    model.images.retain(|id, _| *id == first);
    model.images.get_mut(&first).unwrap().keypoints.clear();
    model.points.clear();
    for camera in model.cameras.values_mut() {
        camera.params[..2].fill(480.0);
    }
    colmap::write_text(&model, &folder.path().join("one")).unwrap();
    let render = |options: &str| {
        let line = format!("render wall --proxy plane --views one --json -o out{options}");
        lumigraph(folder.path(), &line).ok().json()["report"].clone()
    };
    let lazy = render("");
    for what in ["photos", "views", "lenses", "views,lenses"] {
        let named = render(&format!("-{what} --no-skip={what}"));
        let decoded = if what == "photos" { 9 } else { 1 };
        assert_eq!(named["photos_decoded"], decoded, "{what}");
        let of = |name: &str| files(&folder.path().join(name));
        assert!(of("out") == of(&format!("out-{what}")), "{what}");
    }
    let eager = render("-all --no-skip");
    assert_eq!(eager["photos_decoded"], 9);
    assert_eq!(lazy["photos_decoded"], 1);
    assert!(files(&folder.path().join("out")) == files(&folder.path().join("out-all")));
    if cfg!(target_os = "linux") {
        assert!(lazy["peak_memory_bytes"].as_u64() > Some(1 << 20), "{lazy}");
    }
}

#[test]
fn a_view_that_sees_nothing_is_transparent() {
    let folder = with_wall();
    let model = colmap::read_model(&folder.path().join("wall/sparse/0")).unwrap();
    let image = model.images.values().next().unwrap();
    let camera = model.cameras[&image.camera_id].clone();
    // Turned around.
    let about = Rigid3::new(
        glam::DQuat::from_rotation_y(std::f64::consts::PI),
        glam::DVec3::ZERO,
    );
    let pose = about * image.camera_from_world;
    let frame = PathFrame::new("back".to_owned(), camera, pose, None).unwrap();
    let path = CameraPath::new(30.0, vec![frame]).unwrap();
    render::path::write(&folder.path().join("path.json"), &path).unwrap();
    lumigraph(
        folder.path(),
        "render wall --proxy plane --path path.json -o out",
    )
    .ok();
    let frame = image::open(folder.path().join("out/back.png"))
        .unwrap()
        .into_rgba8();
    assert!(frame.pixels().all(|p| p.0 == [0; 4]));
}

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
fn without_ffmpeg_a_film_fails_before_anything_is_drawn() {
    let folder = with_wall();
    let line = "render wall --proxy plane --path sweep -o frames --video film.mp4";
    let words: Vec<&str> = line.split(' ').collect();
    let error = run(folder.path(), &words, &[("PATH", "/nowhere")]).error(1);
    assert!(error.contains("apt-get install ffmpeg"), "{error}");
    assert!(!folder.path().join("frames").exists());
}

#[test]
fn a_path_with_its_own_frames_is_not_asked_for_so_many() {
    let folder = with_wall();
    let line = |frames: &str, out: &str| {
        format!("render wall --proxy plane --views wall --frames {frames} --size 48x36 -o {out}")
    };
    let error = lumigraph(folder.path(), &line("2", "all")).error(2);
    assert!(error.contains("--frames 0..2"), "{error}");
    lumigraph(folder.path(), &line("0..2", "two")).ok();
    assert_eq!(files(&folder.path().join("two")).len(), 2);
    // A kind that is misspelt is no file.
    let misspelt = "render wall --proxy plane --path orbti --frames 2 -o out";
    let error = lumigraph(folder.path(), misspelt).error(2);
    assert!(error.contains("--path orbti: expected orbit"), "{error}");
}

#[test]
fn of_a_path_that_is_not_there_no_frames_are_told() {
    let folder = with_wall();
    for (views, code, said) in [
        ("--path nowhere.json", 1, "nowhere.json: No such file"),
        ("--path wall", 2, "--path wall: expected orbit"),
        (
            "--views nowhere",
            2,
            "--views nowhere: there is no such file",
        ),
    ] {
        let line = format!("render wall --proxy plane {views} --frames 2 -o out");
        let error = lumigraph(folder.path(), &line).error(code);
        assert!(
            error.contains(said) && !error.contains("--frames"),
            "{views}: {error}"
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

#[cfg(target_os = "linux")]
#[test]
fn json_holds_paths_that_are_not_utf_8_with_that_replaced() {
    use std::os::unix::ffi::OsStringExt;
    // ODD stands for such a name.
    let json = |folder: &std::path::Path, line: &str| -> serde_json::Value {
        let word = |word: &str| {
            let parts: Vec<&[u8]> = word.split("ODD").map(str::as_bytes).collect();
            std::ffi::OsString::from_vec(parts.join(&b"odd\xff"[..]))
        };
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_lumigraph"));
        command.current_dir(folder).args(line.split(' ').map(word));
        let ran = command
            .args(["--device", "cpu", "--json"])
            .output()
            .unwrap();
        assert!(
            ran.status.success(),
            "{}",
            String::from_utf8_lossy(&ran.stderr)
        );
        serde_json::from_slice(&ran.stdout).unwrap()
    };
    let folder = with_wall();
    let views = "--views wall --frames 0..1 --size 48x36";
    let line = format!("render wall --proxy plane {views} -o ODD --video ODD.mp4");
    let result = json(folder.path(), &line);
    assert_eq!(result["frames"][0]["file"], "odd\u{fffd}/0000.png");
    assert_eq!(result["video"], "odd\u{fffd}.mp4");

    let folder = with_house();
    let odd = std::ffi::OsString::from_vec(b"odd\xff".to_vec());
    fs::rename(folder.path().join("house"), folder.path().join(odd)).unwrap();
    let result = json(folder.path(), "ldis ODD --reference-size 24x24");
    assert_eq!(result["folder"], "odd\u{fffd}/ldi");
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
