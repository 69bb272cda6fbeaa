//! What goes wrong around the program while it works.
#![cfg(unix)]

use crate::run::{Ran, files, lumigraph, run, with_script, with_wall};
use crate::uncalibrated::is_installed;
use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

const PROGRAM: &str = env!("CARGO_BIN_EXE_lumigraph");

/// Starts the program in a folder.
fn start(folder: &Path, line: &str) -> Child {
    let mut command = Command::new(PROGRAM);
    command.current_dir(folder).args(line.split(' '));
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    command.spawn().unwrap()
}

/// Waits until there is something in a folder, or the program has ended.
fn wait_for(child: &mut Child, folder: &Path) {
    let start = Instant::now();
    let is_empty = || fs::read_dir(folder).map_or(true, |mut entries| entries.next().is_none());
    while is_empty() && child.try_wait().unwrap().is_none() {
        let waited = start.elapsed();
        assert!(waited < Duration::from_secs(120), "{}", folder.display());
        std::thread::sleep(Duration::from_millis(2));
    }
}

fn stderr_of(mut child: Child) -> (Option<i32>, String) {
    let mut text = String::new();
    child
        .stderr
        .take()
        .unwrap()
        .read_to_string(&mut text)
        .unwrap();
    (child.wait().unwrap().code(), text)
}

/// Every picture with a picture's name can be read: nothing is half there.
fn all_whole(folder: &Path) -> usize {
    let pngs = files(folder)
        .into_keys()
        .filter(|f| f.extension().is_some_and(|e| e == "png"));
    let pngs: Vec<PathBuf> = pngs.collect();
    for png in &pngs {
        image::open(folder.join(png)).unwrap_or_else(|e| panic!("{}: {e}", png.display()));
    }
    pngs.len()
}

/// Runs the program where no file may grow beyond a kilobyte: a full disk, but for its error.
fn on_a_full_disk(folder: &Path, line: &str) -> Ran {
    with_room_for(1, folder, line)
}

/// Runs the program where no file may grow beyond so many kilobytes.
fn with_room_for(kilobytes: u32, folder: &Path, line: &str) -> Ran {
    let script = format!("trap '' XFSZ; ulimit -f {kilobytes}; exec {PROGRAM} {line}");
    let output = Command::new("bash")
        .args(["-c", &script])
        .current_dir(folder)
        .output()
        .unwrap();
    Ran {
        code: output.status.code().expect("the program was not killed"),
        stdout: String::from_utf8(output.stdout).unwrap(),
        stderr: String::from_utf8(output.stderr).unwrap(),
    }
}

#[test]
fn a_full_disk_is_told_and_leaves_nothing_half_written() {
    let folder = with_wall();
    let lines = [
        "import wall -o scene",
        "render wall --proxy plane --path sweep --frames 3 --device cpu -o frames",
        "proxy wall carved -o carved.glb",
        "generate shelf --size 64x48 -o shelf",
        "export wall --format transforms -o transforms.json",
    ];
    for line in lines {
        let before = files(folder.path());
        let ran = on_a_full_disk(folder.path(), line);
        let error = ran.error(1);
        assert!(error.contains("File too large"), "{line}: {error}");
        let after = files(folder.path());
        let left: Vec<_> = after.keys().filter(|f| !before.contains_key(*f)).collect();
        assert!(left.is_empty(), "{line}: {left:?}");
        all_whole(folder.path());
        // With room again the same command works.
        lumigraph(folder.path(), line).ok();
    }
    // Whoever reads may not be able to take it all.
    let script = format!("{PROGRAM} info wall --json > /dev/full");
    let output = Command::new("bash")
        .args(["-c", &script])
        .current_dir(folder.path())
        .output();
    let output = output.unwrap();
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{text}");
    let said = "error: standard output: cannot write: No space left";
    assert!(text.contains(said), "{text}");
}

/// Short films are written as they end, of which ffmpeg's exit status says nothing unless it is asked to.
#[test]
fn a_film_that_finds_no_room_leaves_the_one_before() {
    if !is_installed(&capture::video::ffmpeg()) {
        return;
    }
    let folder = with_wall();
    let here = folder.path();
    let render = "render wall --proxy plane --path sweep --frames 12 --size 96x72 --device cpu --resume -o out";
    for film in ["film.mp4", "film.mkv"] {
        let line = format!("{render} --video {film}");
        lumigraph(here, &line).ok();
        let before = files(here);
        // There is room for the film of two small frames that is tried first.
        assert!(before[Path::new(film)].len() > 3 * 1024, "{film}");
        let error = with_room_for(3, here, &line).error(1);
        assert!(
            error.starts_with(&format!("{film}: `ffmpeg` failed")),
            "{error}"
        );
        assert!(files(here) == before, "{film}");
    }
}

/// What a script in the place of COLMAP or ffmpeg does as it comes to its work: it waits for a file `go`, or for `at-work`
/// to be taken away.
const AT_WORK: &str = "mkdir -p at-work; touch at-work/it
    while [ -e at-work ] && [ ! -e go ]; do sleep 0.02; done";

#[test]
fn two_imports_do_not_share_the_work_of_colmap() {
    let folder = with_wall();
    let here = folder.path();
    fs::rename(here.join("wall/sparse/0"), here.join("model")).unwrap();
    let script = format!(
        r#"#!/bin/sh
if [ "$1" = help ]; then echo 'COLMAP 3.8 -- a script'; exit; fi
if [ "$2" = -h ]; then exit; fi
case "$1" in
feature_extractor) {AT_WORK} ;;
mapper)
    while [ "$1" != --output_path ]; do shift; done
    cp -r model "$2/0" ;;
esac
"#
    );
    let path = with_script(here, "colmap", &script);
    let words = ["import", "wall", "-o", "scene"];
    let begin = || {
        let mut command = Command::new(PROGRAM);
        command.current_dir(here).args(words).env("PATH", &path);
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        command.spawn().unwrap()
    };
    let at_work = here.join("at-work");

    // One that is killed holds nothing, though its COLMAP is at work.
    let mut killed = begin();
    wait_for(&mut killed, &at_work);
    killed.kill().unwrap();
    killed.wait().unwrap();
    fs::remove_dir_all(&at_work).unwrap();

    let mut first = begin();
    wait_for(&mut first, &at_work);
    let error = run(here, &words, &[("PATH", &path)]).error(1);
    assert_eq!(
        error,
        "scene: another import is at work here; wait until it has ended, or choose another -o"
    );
    fs::write(here.join("go"), "").unwrap();
    let (code, said) = stderr_of(first);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("COLMAP placed 9 of 9 photos"), "{said}");
    lumigraph(here, "info scene").ok();
}

#[test]
fn two_imports_do_not_take_frames_into_one_folder() {
    let here = tempfile::tempdir().unwrap();
    let here = here.path();
    fs::write(here.join("sweep.mp4"), "a video").unwrap();
    let script = format!(
        r#"#!/bin/sh
case "$*" in *showinfo*)
    {AT_WORK}
    echo 'no video' >&2; exit 1 ;;
esac
"#
    );
    let path = with_script(here, "ffmpeg", &script);
    let words = ["import", "sweep.mp4", "-o", "new/scene"];
    let mut command = Command::new(PROGRAM);
    command.current_dir(here).args(words).env("PATH", &path);
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut first = command.spawn().unwrap();
    wait_for(&mut first, &here.join("at-work"));
    let error = run(here, &words, &[("PATH", &path)]).error(1);
    assert_eq!(
        error,
        "new/scene: another import is at work here; wait until it has ended, or choose another -o"
    );
    fs::write(here.join("go"), "").unwrap();
    let (code, said) = stderr_of(first);
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("cannot decode this as a video"), "{said}");
    assert!(!here.join("new").exists());
}

#[test]
fn without_a_folder_for_a_while_it_is_said_where_one_is_expected() {
    let folder = with_wall();
    let here = folder.path();
    let path = with_script(here, "ffmpeg", "#!/bin/sh\n");
    let film = "render wall --path sweep --frames 2 --size 48x36 -o out --video film.mp4";
    for (line, whose) in [(film, "--video film.mp4"), ("bench -o out", "shelf")] {
        let words: Vec<&str> = line.split(' ').collect();
        let variables = [("PATH", path.as_str()), ("TMPDIR", "/nonexistent/tmp")];
        let error = run(here, &words, &variables).error(1);
        let said = format!("{whose}: /nonexistent/tmp: cannot make a folder for what is needed");
        assert!(error.starts_with(&said), "{line}: {error}");
        assert!(error.contains("; have the variable TMPDIR name"), "{error}");
        assert!(!here.join("out").exists(), "{line}");
    }
}

/// Of what is written the proxy finds room, and `scene.json`, which says what it rests on, finds none.
#[test]
fn a_scene_keeps_its_proxy_where_there_is_no_room_for_another() {
    let folder = with_wall();
    let here = folder.path();
    lumigraph(here, "import wall -o scene").ok();
    lumigraph(here, "proxy scene plane --hold-out wall/split.json").ok();
    let path = here.join("scene/scene.json");
    let mut file: serde_json::Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    file["later"] = serde_json::json!("x".repeat(2000));
    fs::write(&path, file.to_string()).unwrap();
    let before = files(here);
    let names = names_in(&here.join("scene"));

    let error = on_a_full_disk(here, "proxy scene plane").error(1);
    assert!(
        error.contains("scene.json: cannot write: File too large"),
        "{error}"
    );
    assert!(files(here) == before);
    assert_eq!(names_in(&here.join("scene")), names);
    // With room again it is another.
    lumigraph(here, "proxy scene plane").ok();
    let own = lumigraph(here, "info scene --json").ok().json()["proxy"].clone();
    assert_eq!(own["fitted_without"], serde_json::json!([]));
    assert_eq!(names_in(&here.join("scene")), names);
    lumigraph(here, "import wall -o scene --force").ok();
}

/// Runs the program with so many kilobytes to map.
fn within_memory(folder: &Path, kilobytes: u64, line: &str) -> std::process::Output {
    let script = format!("ulimit -c 0; ulimit -v {kilobytes}; exec {PROGRAM} {line}");
    let mut command = Command::new("bash");
    command.args(["-c", &script]).current_dir(folder);
    command.output().unwrap()
}

/// How many kilobytes the program itself needs, to one part in eight.
fn own_memory(folder: &Path) -> u64 {
    let mut own = 32 << 10;
    while !within_memory(folder, own, "--threads 2 info wall")
        .status
        .success()
    {
        own += own / 8;
        assert!(own < 64 << 20, "{own} kB are not enough");
    }
    own
}

#[test]
fn too_little_memory_is_told_and_leaves_nothing_half_written() {
    let folder = with_wall();
    let own = own_memory(folder.path());
    let large = "--threads 2 render wall --proxy plane --path sweep --frames 1 --size 6000x4500 \
                 --device cpu -o frames";
    let usual =
        "--threads 2 render wall --proxy plane --path sweep --frames 1 --device cpu -o frames";
    let before = files(folder.path());
    let mut told = 0;
    // From what hardly lets it begin to less than the picture takes.
    for more in [0, 4 << 10, 16 << 10, 48 << 10, 80 << 10] {
        let output = within_memory(folder.path(), own + more, large);
        let text = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{own} and {more} kB: {text}");
        let said = text
            .lines()
            .filter(|line| line.starts_with("error: "))
            .count();
        assert!(
            said == 1 && !text.contains("panicked"),
            "{own} and {more} kB: {text}"
        );
        let is_told = text.contains("out of memory") && text.contains("--size");
        assert!(
            is_told || text.contains("threads cannot be started"),
            "{text}"
        );
        told += usize::from(is_told);
        let after = files(folder.path());
        assert!(
            after.keys().all(|file| before.contains_key(file)),
            "{after:?}"
        );
    }
    assert!(told >= 2, "{told}");
    // With a smaller picture there is enough, in the same folder.
    let output = within_memory(folder.path(), own + (256 << 10), usual);
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{text}");
    assert_eq!(all_whole(&folder.path().join("frames")), 1);
}

/// Who paints each pixel takes some 170 bytes of it, and a picture 4.
#[test]
fn a_field_is_pictured_in_little_more_memory_than_its_picture_takes() {
    let folder = with_wall();
    let here = folder.path();
    let own = own_memory(here);
    let field =
        "--threads 2 field wall --proxy plane --view 0004.png --without-view -o f.png --size";
    let output = within_memory(here, own + (192 << 10), &format!("{field} 1600x1200"));
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{text}");
    assert_eq!(
        image::image_dimensions(here.join("f.png")).unwrap(),
        (1600, 1200)
    );
    fs::remove_file(here.join("f.png")).unwrap();
    // Of what takes less only options that it has are named.
    let output = within_memory(here, own + (16 << 10), &format!("{field} 6000x4500"));
    let text = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{text}");
    let is_told =
        text.contains("try a smaller --size, fewer --threads, or a higher limit (ulimit -v)");
    assert!(is_told && !text.contains("--cpu-memory"), "{text}");
    assert!(!here.join("f.png").exists());
}

#[test]
fn weights_that_find_no_room_leave_nothing_half_written() {
    let folder = with_wall();
    let here = folder.path();
    let line = "field wall --proxy plane --view 0004.png --size 48x36 -o f.png";
    lumigraph(here, line).ok();
    let before = files(here);
    let ran = with_room_for(5, here, &format!("{line} --weights w.npz"));
    let error = ran.error(1);
    assert!(
        error.starts_with("w.npz: cannot write: File too large"),
        "{error}"
    );
    assert!(!ran.stderr.contains("ZipWriter"), "{}", ran.stderr);
    assert!(files(here) == before);
}

#[test]
fn what_stands_in_the_way_of_the_output_is_named() {
    let folder = with_wall();
    fs::write(folder.path().join("taken"), "a file").unwrap();
    for line in [
        "render wall --proxy plane --path sweep --frames 2 -o taken/frames",
        "import wall -o taken/scene",
        "bench wall --device cpu --long-side 48 -o taken/out",
    ] {
        let error = lumigraph(folder.path(), line).error(1);
        assert!(error.contains("taken"), "{line}: {error}");
    }
    assert_eq!(fs::read(folder.path().join("taken")).unwrap(), b"a file");
}

#[test]
fn a_photo_that_goes_away_meanwhile_is_left_out() {
    let folder = with_wall();
    // A budget of nothing: every frame decodes its photos again.
    let line = "render wall --proxy plane --path sweep --frames 40 --device cpu --cpu-memory 1 \
                --json -o frames";
    let mut child = start(
        folder.path(),
        &line.split_whitespace().collect::<Vec<_>>().join(" "),
    );
    wait_for(&mut child, &folder.path().join("frames"));
    let photos = folder.path().join("wall/images");
    fs::remove_file(photos.join("0003.png")).unwrap();
    let cut = fs::read(photos.join("0004.png")).unwrap();
    fs::write(photos.join("0004.png"), &cut[..cut.len() / 2]).unwrap();
    let (code, text) = stderr_of(child);
    assert_eq!(code, Some(0), "{text}");
    assert!(!text.contains("panicked"), "{text}");
    assert_eq!(all_whole(&folder.path().join("frames")), 40);
}

#[test]
fn a_command_that_is_stopped_leaves_whole_files_and_can_be_run_again() {
    let folder = with_wall();
    let house = "generate house --rooms 2 --triangles 2000 -o house";
    lumigraph(folder.path(), house).ok();
    for (line, first) in [
        (
            "render wall --proxy plane --path sweep --frames 300 --device cpu -o frames",
            "frames",
        ),
        (
            "walk house --frames 300 --size 64x48 --device cpu -o walk",
            "walk",
        ),
        // At once: it has hardly begun.
        ("generate shelf --size 320x240 -o shelf", "."),
        (
            "bench wall house --device cpu --long-side 64 -o bench",
            "bench",
        ),
    ] {
        let mut child = start(folder.path(), line);
        wait_for(&mut child, &folder.path().join(first));
        assert!(child.try_wait().unwrap().is_none(), "{line}: it has ended");
        let mut stop = Command::new("kill");
        stop.args(["-TERM", &child.id().to_string()]);
        assert!(stop.status().unwrap().success());
        stderr_of(child);
        all_whole(folder.path());
    }
    for line in [
        "render wall --proxy plane --path sweep --frames 2 --device cpu -o frames",
        "walk house --frames 2 --size 64x48 --device cpu -o walk",
        "generate shelf --size 64x48 -o shelf",
    ] {
        lumigraph(folder.path(), line).ok();
    }
    all_whole(folder.path());
}

/// By whatever command, and whatever the path to them.
#[test]
fn photos_are_not_written_over() {
    let folder = with_wall();
    let here = folder.path();
    let before = files(here);
    let size = "--proxy plane --size 48x36";
    let line = format!("field wall --view 0000.png {size} -o wall/images/0000.png");
    let error = lumigraph(here, &line).error(1);
    assert!(
        error.contains("0000.png: pictures are made of this"),
        "{error}"
    );
    // Nor do pictures lie among them, which an import would take for photos.
    for line in [
        format!("evaluate wall --every 3 {size} -o wall/images"),
        format!("render wall --views wall {size} -o wall/../wall/images"),
        format!("render wall --path sweep --frames 1 {size} -o wall/images/new"),
        format!("render wall --path sweep --frames 1 {size} -o wall/depth"),
    ] {
        let error = lumigraph(here, &line).error(1);
        assert!(error.contains("of this scene lie in"), "{error}");
        assert!(files(here) == before, "{line}");
    }
    // Nor one that is left out.
    let damaged = here.join("wall/images/0008.png");
    fs::write(&damaged, b"no picture any more").unwrap();
    let line = format!("field wall --view 0000.png {size} -o wall/images/0008.png");
    let error = lumigraph(here, &line).error(1);
    assert!(error.contains("pictures are made of this"), "{error}");
    assert_eq!(fs::read(&damaged).unwrap(), b"no picture any more");
    // Beside their folder is room.
    let line = format!("render wall --path sweep --frames 1 {size} -o wall/frames");
    lumigraph(here, &line).ok();
    // A capture may be one flat folder.
    fs::rename(here.join("wall/images"), here.join("flat")).unwrap();
    fs::rename(here.join("wall/sparse"), here.join("flat/sparse")).unwrap();
    let line = format!("render flat --path sweep --frames 1 {size} -o flat");
    let error = lumigraph(here, &line).error(1);
    assert!(error.contains("of this scene lie in"), "{error}");
    lumigraph(here, &format!("{line}/frames")).ok();
}

/// A folder of photos is one by what lies there, and not by its name.
#[test]
fn pictures_may_be_drawn_again_into_a_folder_called_images() {
    let folder = with_wall();
    let here = folder.path();
    let options = "--proxy plane --size 48x36";
    lumigraph(here, "import wall -o scene").ok();
    for line in [
        format!("render scene --path sweep --frames 2 {options} -o scene/images"),
        format!("evaluate scene --every 3 {options} -o scene/images"),
        format!("render scene --path sweep --frames 2 {options} -o scene"),
    ] {
        lumigraph(here, &line).ok();
        lumigraph(here, &line).ok();
    }
    // Where there are copies of the photos, they and the capture's are not to be joined by others.
    lumigraph(here, "import wall --undistort -o copies").ok();
    for folder in ["copies", "wall"] {
        let line = "render copies --path sweep --frames 2";
        let line = format!("{line} {options} -o {folder}/images");
        let error = lumigraph(here, &line).error(1);
        assert!(error.contains("of this scene lie in"), "{error}");
    }
}

/// As with photos that are links into the scene's folder.
#[test]
fn photos_are_not_replaced_by_their_scene() {
    let folder = with_wall();
    let here = folder.path();
    lumigraph(here, "import wall --undistort -o flat").ok();
    let photo = here.join("wall/images/0003.png");
    fs::remove_file(&photo).unwrap();
    std::os::unix::fs::symlink("../../flat/images/0003.png", photo).unwrap();
    let before = files(here);
    let error = lumigraph(here, "import wall -o flat --force").error(1);
    assert!(
        error.contains("0003.png, which would be replaced"),
        "{error}"
    );
    assert!(files(here) == before);
}

/// The names of all that is in a folder, hidden or not.
fn names_in(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap();
    let names = entries.map(|entry| entry.unwrap().file_name().display().to_string());
    let mut names: Vec<String> = names.collect();
    names.sort();
    names
}

#[test]
fn a_scene_may_lie_on_another_disk_and_nothing_is_left_beside_it() {
    let folder = with_wall();
    let here = folder.path();
    let other = tempfile::tempdir_in("/dev/shm").unwrap_or_else(|error| {
        eprintln!("SKIPPED: another disk: {error}");
        tempfile::tempdir().unwrap()
    });
    std::os::unix::fs::symlink(other.path(), here.join("scene")).unwrap();
    for line in ["import wall -o scene", "import wall -o scene --force"] {
        lumigraph(here, line).ok();
        assert_eq!(names_in(other.path()), ["model", "scene.json"]);
    }
    assert_eq!(names_in(here), ["scene", "wall"]);
    // An import that fails takes along what it made, and nothing else.
    on_a_full_disk(here, "import wall -o deep/er/scene").error(1);
    on_a_full_disk(here, "import wall -o scene --force").error(1);
    assert_eq!(names_in(here), ["scene", "wall"]);
    assert_eq!(names_in(other.path()), ["model", "scene.json"]);
    lumigraph(here, "info scene").ok();
    // What a killed one leaves is in nobody's way.
    fs::create_dir_all(here.join("new/.lumigraph-abc/scene")).unwrap();
    lumigraph(here, "import wall -o new").ok();
}

#[test]
fn where_results_cannot_go_is_said_before_any_work() {
    let folder = with_wall();
    let here = folder.path();
    fs::write(here.join("file"), "mine").unwrap();
    for line in [
        "render wall --path sweep --frames 1 -o file",
        "render wall --path sweep --frames 1 -o file/frames",
        "evaluate wall -o file",
        "walk wall --frames 1 -o file",
        "import wall -o file",
        "export wall --format colmap -o file",
        "export wall --format transforms -o file/t.json",
        "demo -o file",
        "path p.json --format lumigraph -o file/p.json",
        "interior wall -o file",
        "bench wall -o file",
        "generate house -o file",
        "generate wall -o file/capture",
        "proxy wall plane -o file/p.json",
        "field wall --view 0004.png -o file/f.png",
        "field wall --view 0004.png -o f.png --weights file/f.npz",
        "render wall --path sweep --frames 1 -o out --video file/film.mp4",
    ] {
        let error = lumigraph(here, line).error(1);
        assert!(
            error.contains("file: a file is where the folder"),
            "{error}"
        );
    }
    // Nor where something else lies already: no model was looked at.
    fs::create_dir(here.join("mine")).unwrap();
    fs::write(here.join("mine/thesis.txt"), "mine").unwrap();
    fs::write(here.join("none.glb"), "").unwrap();
    for more in ["", " --force"] {
        let error = lumigraph(here, &format!("interior none.glb -o mine{more}")).error(1);
        assert!(
            error.starts_with("mine: the folder is not empty"),
            "{error}"
        );
    }
    if cfg!(target_os = "linux") {
        for line in [
            "proxy wall plane -o /proc/p.json",
            "path p.json --format lumigraph -o /proc/p.json",
            "bench wall -o /proc/measured",
            "interior none.glb -o /proc/interior",
        ] {
            let error = lumigraph(here, line).error(1);
            assert!(error.starts_with("/proc: cannot write: "), "{error}");
            assert!(error.ends_with("; choose another -o"), "{error}");
        }
    }
    let line = "render wall --path sweep --frames 1 -o out --video film.nothing";
    let error = lumigraph(here, line).error(2);
    assert!(error.contains("--video film.nothing"), "{error}");
    assert!(!here.join("out").exists());
    assert_eq!(fs::read(here.join("file")).unwrap(), b"mine");
}

#[cfg(target_os = "linux")]
#[test]
fn frames_of_an_interrupted_run_are_kept_whatever_their_folder_is_called() {
    use std::os::unix::ffi::OsStrExt;
    let folder = with_wall();
    // No Unicode.
    let [wall, out] = [&b"wall\xff"[..], b"out\xff"].map(std::ffi::OsStr::from_bytes);
    fs::rename(folder.path().join("wall"), folder.path().join(wall)).unwrap();
    let line = "--proxy plane --path sweep --frames 2 --size 48x36 --device cpu --resume -o";
    for kept in [false, true] {
        let mut command = Command::new(PROGRAM);
        command.current_dir(folder.path()).arg("render").arg(wall);
        let output = command.args(line.split(' ')).arg(out).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{said}");
        let said = String::from_utf8_lossy(&output.stdout);
        assert_eq!(said.contains("2 of them from before"), kept, "{said}");
    }
}
