//! Memory budgets for photos.

use crate::run::{files, lumigraph, with_wall};
use datasets::Options;

/// Bytes of a photo of 96 × 72 with its mip levels.
pub(crate) const PHOTO: u64 = 4 * (96 * 72 + 48 * 36 + 24 * 18 + 12 * 9 + 6 * 5 + 3 * 3 + 2 * 2);
/// Of its mask, with the levels and the ranges of blocks of 8 × 8 pixels, of 2 × 2 such blocks and so on.
pub(crate) const MASK: u64 = PHOTO / 4 + 2 * (12 * 9 + 6 * 5 + 3 * 3 + 2 * 2 + 1);

#[test]
fn the_memory_that_info_tells_is_what_all_photos_take() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    // No level is half as large as the one before.
    let options = Options {
        size: Some((83, 61)),
        samples_per_side: Some(1),
        ..Options::default()
    };
    let wall = datasets::by_name("wall", &options).unwrap();
    datasets::write(&wall, &here.join("wall")).unwrap();
    let info = lumigraph(here, "info wall --json").ok().json();
    let bytes = info["memory_bytes"].as_u64().unwrap();
    let line = format!(
        "render wall --proxy plane --path sweep --frames 2 --size 48x36 --no-skip --cpu-memory {bytes} --json -o out"
    );
    let report = lumigraph(here, &line).ok().json()["report"].clone();
    assert_eq!(report["photos_decoded"], 9);
    assert_eq!(report["photos_bytes"], bytes);
    let took = &report["cpu_memory"];
    assert_eq!(
        (&took["evictions"], &took["level_cap"]),
        (&0.into(), &0.into())
    );
}

#[test]
fn a_budget_that_is_no_size_is_a_usage_error() {
    let folder = with_wall();
    for option in ["--cpu-memory", "--gpu-memory"] {
        for size in [
            "0",
            "-1GiB",
            "much",
            "1XB",
            "1e3",
            "NaN",
            "99999999999TiB",
            "",
        ] {
            for command in [
                "render wall --proxy plane --path orbit -o out",
                "evaluate wall --proxy plane",
            ] {
                let error = lumigraph(folder.path(), &format!("{command} {option} {size}"));
                let error = error.error(2);
                assert!(error.contains(option), "{error}");
                let expected = size.is_empty() || error.contains("as in 512MiB");
                assert!(expected, "{error}");
            }
        }
    }
    assert!(!folder.path().join("out").exists());
}

#[test]
fn a_path_is_drawn_within_the_budget_and_the_report_says_how() {
    let folder = with_wall();
    for renderer in ["triangulated", "exact"] {
        let render = |options: &str, out: &str| {
            let line = format!(
                "render wall --proxy plane --path sweep --frames 4 --size 48x36 --k 2 --renderer {renderer} \
                 --json -o {out}{options}"
            );
            let report = lumigraph(folder.path(), &line).ok().json()["report"].clone();
            (report, files(&folder.path().join(out)))
        };
        let (report, expected) = render("", &format!("{renderer}-free"));
        let took = &report["cpu_memory"];
        // Half of the machine's memory, where that is known: enough for all.
        let budget = took["budget_bytes"].as_u64();
        assert!(budget.is_none_or(|bytes| bytes > 100 * PHOTO), "{took}");
        assert_eq!(budget.is_some(), cfg!(target_os = "linux"));
        assert!(report["gpu_memory"].is_null());
        assert_eq!(
            (&took["evictions"], &took["level_cap"]),
            (&0.into(), &0.into())
        );
        assert_eq!(took["peak_bytes"], report["photos_bytes"]);
        assert_eq!(took["loads"], report["photos_decoded"]);

        // Room for all of them changes nothing.
        let enough = format!(" --cpu-memory {}", 9 * PHOTO);
        let (_, pictures) = render(&enough, &format!("{renderer}-enough"));
        assert!(pictures == expected, "{renderer}");

        // Too little for one frame: two runs agree, whatever the number of threads.
        let little = format!(" --cpu-memory {PHOTO}");
        let (report, pictures) = render(&little, &format!("{renderer}-little"));
        let took = &report["cpu_memory"];
        assert_eq!(took["budget_bytes"], PHOTO);
        assert!(took["peak_bytes"].as_u64().unwrap() <= PHOTO, "{took}");
        assert!(took["level_cap"].as_u64() > Some(0), "{took}");
        assert!(took["capped_drawings"].as_u64() > Some(0), "{took}");
        assert!(pictures.len() == 4 && pictures != expected);
        for threads in [1, 3] {
            let options = format!("{little} --threads {threads}");
            let (_, again) = render(&options, &format!("{renderer}-{threads}"));
            assert!(again == pictures, "{renderer}, {threads} threads");
        }
    }
    let line = "render wall --proxy plane --path sweep --frames 2 --cpu-memory 20kB -o text";
    let said = lumigraph(folder.path(), line).ok().stderr;
    assert!(
        said.contains("too little for 2 drawings: mip levels from"),
        "{said}"
    );
}

#[test]
fn decoding_all_of_them_first_keeps_to_the_budget() {
    let folder = with_wall();
    let render = |options: &str, out: &str| {
        let line = format!(
            "render wall --proxy plane --path sweep --frames 2 --cpu-memory {} --json -o {out}{options}",
            3 * PHOTO
        );
        let report = lumigraph(folder.path(), &line).ok().json()["report"].clone();
        assert!(report["cpu_memory"]["peak_bytes"].as_u64().unwrap() <= 3 * PHOTO);
        (report, files(&folder.path().join(out)))
    };
    let (_, expected) = render("", "lazy");
    let (report, pictures) = render(" --no-skip", "eager");
    assert!(pictures == expected);
    assert_eq!(report["photos_decoded"], 9);
}
