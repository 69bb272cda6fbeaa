//! Usage: exit code 2, and what to do. What is said of options and paths that do not do what was meant.

use crate::run::{lumigraph, run, with_wall};

#[test]
fn threads_of_a_variable_are_as_many_as_of_the_option() {
    let folder = with_wall();
    for (count, code) in [("100000", 2), ("3", 0), ("0", 0), ("many", 0)] {
        let variables = [("RAYON_NUM_THREADS", count)];
        let ran = run(folder.path(), &["info", "wall"], &variables);
        assert_eq!(ran.code, code, "{count}: {}", ran.stderr);
        let is_told = ran
            .stderr
            .contains("RAYON_NUM_THREADS=100000: expected a whole number in 1..=");
        assert_eq!(is_told, code == 2, "{}", ran.stderr);
    }
}

#[test]
fn usage_errors_exit_with_2() {
    let folder = with_wall();
    for (line, said) in [
        ("evalute wall", "'evaluate'"),
        (
            "render wall -o out",
            "--views <MODEL|FILE>|--path <KIND|FILE>",
        ),
        (
            "render wall --views a --path b -o out",
            "cannot be used with",
        ),
        ("render wall --path circle -o out", "orbit, dolly, sweep"),
        ("render wall --path orbit --size 0x9 -o out", "1..=16384"),
        ("render wall --path orbit --frames 0 -o out", "--frames"),
        ("evaluate wall --k 17", "1..=16"),
        ("evaluate wall --k nan", "expected a whole number in 1..=16"),
        ("evaluate wall --grid 0", "a whole number above zero"),
        ("evaluate wall --grid x", "a whole number above zero"),
        ("evaluate wall --threads 0", "a whole number in 1..="),
        ("evaluate wall --threads 100000", "a whole number in 1..="),
        ("import wall --frames 1 -o out", "a whole number above one"),
        ("evaluate wall --beta -1", "zero or more"),
        ("evaluate wall --beta 1e39", "zero or more, up to 1e6"),
        ("evaluate wall --proxy sphere", "plane, dominant-plane"),
        ("evaluate wall --every 1", "--every"),
        (
            "evaluate wall --every 1",
            "a whole number above one, as in 8",
        ),
        (
            "evaluate wall --every -3",
            "a whole number above one, as in 8",
        ),
        (
            "field wall --view frame_0001 --path orbit --frames 0..2/3 -o f.png",
            "expected a number of frames up to 100000, as in 60; --view names one of them",
        ),
        ("proxy wall plane", "-o"),
        ("proxy wall plane --point 1,2,3", "--normal"),
        (
            "proxy wall plane --point 1,2,3 --normal 0,0,0 -o p.json",
            "the plane's normal is zero",
        ),
        ("proxy wall sphere", "plane, dominant-plane"),
        ("proxy wall mesh -o m.ply", "mesh FILE"),
        (
            "proxy wall tunnel house.obj -o m.ply",
            "belong to the kind `mesh`",
        ),
        (
            "proxy wall tunnel --through 1,2,3 -o m.ply",
            "write `plane`",
        ),
        ("proxy wall plane --through 1,2,3 -o m.ply", "three points"),
        ("proxy wall plane --focus a.jpg -o p.json", "PHOTO:X,Y"),
        (
            "proxy wall mesh a.obj --transform 1,2 -o m.ply",
            "expected 16",
        ),
        (
            "proxy wall mesh a.obj --transform 1,0,0,0,0,1,0,0,0,0,1,0,1,2,3,1 -o m.ply",
            "its last row is [1.0, 2.0, 3.0, 1.0], not 0, 0, 0, 1; it seems to be column by column: transpose it",
        ),
        (
            "proxy wall mesh a.obj --transform 1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,2 -o m.ply",
            "its last row is [0.0, 0.0, 0.0, 2.0], not 0, 0, 0, 1; expected 16 numbers, row by row",
        ),
        (
            "proxy wall mesh a.obj --transform 1,0,0,5,0,1,0,0,0,0,1,0,0,0,0.5,1 -o m.ply",
            "its last row is [0.0, 0.0, 0.5, 1.0], not 0, 0, 0, 1; expected 16 numbers, row by row",
        ),
        ("generate moon -o moon", "shelf, wall, helicopter"),
    ] {
        let ran = lumigraph(folder.path(), line);
        assert_eq!(ran.code, 2, "{line}: {}", ran.stderr);
        assert!(ran.stderr.contains(said), "{line}: {}", ran.stderr);
        assert_eq!(ran.stdout, "", "{line}");
        // If with a usage, with that command's own.
        let command = line.split(' ').next().unwrap_or_default();
        let own = ran.stderr.contains(&format!("Usage: lumigraph {command} "));
        let has_usage = ran.stderr.contains("Usage: ") && command != "evalute";
        assert!(own || !has_usage, "{line}: {}", ran.stderr);
    }
}

#[test]
fn options_that_change_nothing_are_said_to() {
    let folder = with_wall();
    let said = |line: &str| lumigraph(folder.path(), line).ok().stderr;
    let grid = "note: --grid changes nothing: --renderer exact has no grid";
    let field = "field wall --proxy plane --view 0004.png --size 24x18 -o f.png";
    let evaluate = "evaluate wall --proxy plane --size 24x18";
    for (line, is_idle) in [
        (format!("{evaluate} --renderer exact --grid 32"), true),
        (format!("{evaluate} --renderer exact"), false),
        (format!("{evaluate} --grid 32"), false),
        (format!("{field} --renderer exact --grid 8"), true),
        (
            format!("{field} --renderer exact --grid 8 --triangulation t.svg"),
            false,
        ),
    ] {
        let stderr = said(&line);
        assert_eq!(stderr.contains(grid), is_idle, "{line}: {stderr}");
    }
    let held_out =
        "note: --hold-out changes nothing: a surface that is given by hand rests on no photos\n";
    let through = "--through 0,0,4 --through 1,0,4 --through 0,1,4";
    said("proxy wall tunnel -o tunnel.ply");
    for (surface, is_idle) in [
        ("plane --point 0,0,4 --normal 0,0,1".to_owned(), true),
        (format!("plane {through}"), true),
        ("mesh tunnel.ply".to_owned(), true),
        ("plane --focus 0004.png:48,36".to_owned(), false),
        ("plane".to_owned(), false),
    ] {
        let line = format!("proxy wall {surface} -o p.glb");
        assert!(!said(&line).contains("--hold-out"), "{line}");
        let line = format!("{line} --hold-out wall/split.json");
        assert_eq!(said(&line).contains(held_out), is_idle, "{line}");
    }
    let gpu = "note: --gpu-memory changes nothing: no graphics processor draws";
    let stderr = said(&format!("{evaluate} --gpu-memory 1GB"));
    assert!(stderr.contains(gpu), "{stderr}");
    assert!(!said(&format!("{evaluate} --cpu-memory 1GB")).contains("changes nothing"));
    for (options, start) in [
        ("--fisheye", "--fisheye changes"),
        ("--distortion D", "--distortion changes"),
        (
            "--camera-matrix K --fisheye",
            "--camera-matrix and --fisheye change",
        ),
    ] {
        let stderr = said(&format!("import wall {options} --force -o scene"));
        let note = format!("note: {start} nothing: the calibration is the COLMAP model in ");
        assert!(stderr.contains(&note), "{stderr}");
    }
}

/// A path that lies elsewhere.
const FAR: &str = r#"{"version": 1, "fps": 30, "frames": [{"name": "far", "camera_from_world":
    [1, 0, 0, 9000, 0, 1, 0, 9000, 0, 0, 1, 9000, 0, 0, 0, 1],
    "width": 32, "height": 24, "model": "PINHOLE", "params": [30, 30, 16, 12]}]}"#;

#[test]
fn frames_that_show_nothing_are_told() {
    let folder = with_wall();
    let but_one: Vec<String> = (0..8).map(|i| format!("\"000{i}.png\"")).collect();
    let split = format!("{{\"test\": [{}]}}", but_one.join(", "));
    std::fs::write(folder.path().join("far.json"), FAR).unwrap();
    std::fs::write(folder.path().join("one.json"), split).unwrap();
    let run = |line: &str| {
        let line = format!("{line} --proxy points --size 32x24 --json");
        let ran = lumigraph(folder.path(), &line).ok();
        let report = &ran.json()["report"];
        let notes = report["notes"].as_array().unwrap().iter();
        let notes: Vec<String> = notes.map(|n| n.as_str().unwrap().to_owned()).collect();
        for note in &notes {
            assert!(ran.stderr.contains(&format!("note: {note}\n")), "{note}");
        }
        (report["frames_empty"].as_u64().unwrap(), notes.join("\n"))
    };
    let render = |options: &str| run(&format!("render wall -o out {options}"));
    let (empty, notes) = render("--path far.json");
    let lost = "1 of 1 frames show nothing: does the path lie in this scene's world?";
    assert_eq!((empty, notes.as_str()), (1, lost));
    let (empty, notes) = render("--path orbit --frames 2 --hold-out one.json");
    assert_eq!(empty, 2);
    assert!(
        notes.contains("2 of 2 frames show nothing: one photo alone"),
        "{notes}"
    );
    assert_eq!(render("--path orbit --frames 2"), (0, String::new()));
    let (empty, notes) = run("evaluate wall --hold-out one.json");
    let alone = "8 of 8 pictures show nothing: one photo alone does not tell where things are";
    assert_eq!((empty, notes.as_str()), (8, alone));
    assert_eq!(run("evaluate wall"), (0, String::new()));
}

#[test]
fn why_frames_may_show_nothing_depends_on_where_their_path_is_from() {
    let folder = with_wall();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("far.json", FAR);
    let turn = r#"{"transform": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]], "scale": 1}"#;
    write("dp.json", turn);
    // Behind all cameras.
    write(
        "behind.obj",
        "v -1 -1 -50\nv 1 -1 -50\nv 0 1 -50\nf 1 2 3\n",
    );
    let line = "path far.json --format nerfstudio -o theirs.json";
    lumigraph(folder.path(), line).ok();
    let lost = "does the path lie in this scene's world";
    for (options, why) in [
        (
            "--path theirs.json",
            format!("{lost} (see --dataparser-transforms)?"),
        ),
        (
            "--path theirs.json --dataparser-transforms dp.json",
            format!("{lost}?"),
        ),
        (
            "--path orbit --frames 1",
            "no proxy lies before their cameras; try another --proxy".to_owned(),
        ),
    ] {
        let line = format!("render wall --proxy behind.obj --size 32x24 {options} -o out");
        let said = lumigraph(folder.path(), &line).ok().stderr;
        let note = format!("note: 1 of 1 frames show nothing: {why}\n");
        assert!(said.contains(&note), "{options}: {said}");
    }
}

/// The help of a command, its words separated by single spaces.
fn help_of(command: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let ran = lumigraph(folder.path(), &format!("{command} --help")).ok();
    let said: Vec<&str> = ran.stdout.split_whitespace().collect();
    said.join(" ")
}

#[test]
fn the_help_says_what_limits_memory_where_nobody_does() {
    for command in ["walk", "ldis"] {
        let said = help_of(command);
        let expected = "[default: no limit for images, half of the machine's memory for photos]";
        assert!(said.contains(expected), "{said}");
    }
}

#[cfg(feature = "window")]
#[test]
fn the_help_of_the_window_speaks_of_the_window() {
    let said = help_of("view");
    for expected in [
        "<SCENE> A scene written by `import`, a capture (photos with a calibration), or an interior",
        "--size <WxH> Size of the window [default: 1280x800]",
    ] {
        assert!(said.contains(expected), "{said}");
    }
    let of_pictures = "Size of the pictures in pixels [default: each view's own]";
    assert!(help_of("render").contains(of_pictures));
}

/// Of portraits, too: the width is their shorter side.
#[test]
fn the_help_says_along_which_side_a_grid_is_counted() {
    let said = help_of("render");
    assert!(said.contains("grid across the image's width;"), "{said}");
}

#[test]
fn the_help_says_that_exposed_pictures_are_clipped_at_white() {
    let said = help_of("evaluate");
    let expected = "multiplied by what fits best by least squares, and then clipped at white)";
    assert!(said.contains(expected), "{said}");
}

#[test]
fn the_demo_ends_with_scores_and_files() {
    let folder = with_wall();
    let old = folder.path().join("lumigraph-demo");
    std::fs::create_dir_all(old.join("frames")).unwrap();
    // One was killed as it wrote a frame.
    let unfinished = "frames/.frame_0001.png.123.tmp";
    for file in [
        "lumigraph-demo.txt",
        "frames/frame_0000.png",
        unfinished,
        "mine.txt",
    ] {
        std::fs::write(old.join(file), "").unwrap();
    }
    lumigraph(folder.path(), "import wall -o lumigraph-demo/scene").ok();
    let ran = lumigraph(folder.path(), "demo").ok();
    let (_, end) = ran.stdout.split_once("psnr_covered").unwrap();
    assert!(end.contains("\nmean "), "{end}");
    for part in ["capture", "scene", "frames", "field.png", "evaluation"] {
        assert!(
            end.contains(&format!("\n  lumigraph-demo/{part} ")),
            "{end}"
        );
        assert!(old.join(part).exists());
    }
    assert!(old.join("mine.txt").exists());
    assert!(!old.join(unfinished).exists());
    let frame = std::fs::metadata(old.join("frames/frame_0000.png")).unwrap();
    assert!(frame.len() > 0);

    // What somebody put there since is neither removed nor in the way for good.
    let before = crate::run::files(&old);
    for own in [
        "capture/masks/a.png",
        "capture/images/0020.png",
        "scene/painted/a.txt",
        "scene/model/notes.txt",
        "frames/film.mp4",
        "frames/frame_0012.png",
        "evaluation/in/0001.png",
    ] {
        let file = old.join(own);
        std::fs::create_dir_all(file.parent().unwrap()).unwrap();
        std::fs::write(&file, "mine").unwrap();
        let error = lumigraph(folder.path(), "demo").error(1);
        let (_, last) = own.split_once('/').unwrap();
        let named = last.split('/').next().unwrap();
        assert!(error.contains(named), "{own}: {error}");
        assert_eq!(std::fs::read_to_string(&file).unwrap(), "mine");
        std::fs::remove_file(&file).unwrap();
        // Of a scene, a folder that is none of its parts is in the way, too.
        let _ = std::fs::remove_dir(file.parent().unwrap());
        assert!(crate::run::files(&old) == before, "{own}");
    }
}

#[test]
fn a_demo_replaces_its_own_output_alone() {
    let folder = with_wall();
    let before = crate::run::files(folder.path());
    let error = lumigraph(folder.path(), "demo -o wall").error(1);
    assert!(error.contains("other than an earlier demo"), "{error}");
    assert!(crate::run::files(folder.path()) == before);
}
