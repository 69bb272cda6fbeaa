//! Usage: exit code 2, and what to do.

use crate::run::{lumigraph, with_wall};

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
        ("evaluate wall --beta -1", "zero or more"),
        ("evaluate wall --proxy sphere", "plane, dominant-plane"),
        ("evaluate wall --every 1", "--every"),
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
fn the_demo_ends_with_scores_and_files() {
    let folder = tempfile::tempdir().unwrap();
    let old = folder.path().join("lumigraph-demo");
    std::fs::create_dir_all(old.join("frames")).unwrap();
    for file in ["lumigraph-demo.txt", "frames/of-last-time.png", "mine.txt"] {
        std::fs::write(old.join(file), "").unwrap();
    }
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
    assert!(!old.join("frames/of-last-time.png").exists());
}

#[test]
fn a_demo_replaces_its_own_output_alone() {
    let folder = with_wall();
    let before = crate::run::files(folder.path());
    let error = lumigraph(folder.path(), "demo -o wall").error(1);
    assert!(error.contains("other than an earlier demo"), "{error}");
    assert!(crate::run::files(folder.path()) == before);
}
