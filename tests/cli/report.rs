//! What a run says of its cost.

use crate::run::{files, lumigraph, with_wall};
use serde_json::Value;

/// A report's counts: all but times and memory.
fn counts(ran: &Value) -> Vec<Value> {
    let of_frames = ran["frames"].as_array().unwrap().iter().map(|frame| {
        let mut cost = frame["cost"].clone();
        for time in ["stages", "device_seconds"] {
            cost.as_object_mut().unwrap().remove(time).unwrap();
        }
        cost
    });
    let report = &ran["report"];
    let of_all = ["skipped", "photos_used_per_frame", "frames_by_cpu", "notes"];
    of_frames
        .chain(of_all.map(|name| report[name].clone()))
        .collect()
}

#[test]
fn a_frame_says_what_it_took_and_the_run_what_all_did() {
    let folder = with_wall();
    for renderer in ["triangulated", "exact"] {
        let render = |options: &str, out: &str| {
            let line = format!(
                "render wall --proxy plane --path sweep --frames 3 --k 2 --renderer {renderer} \
                 --json -o {out}{options}"
            );
            lumigraph(folder.path(), &line).ok().json()
        };
        let ran = render("", renderer);
        let report = &ran["report"];
        assert_eq!(report["frames_by_cpu"], 3);
        let slow = render(" --device reference", &format!("{renderer}-slow"));
        assert_eq!(slow["report"]["frames_by_cpu"], 3);
        let frames = slow["frames"].as_array().unwrap().iter();
        let by_cpu = frames.filter(|frame| frame["cost"]["drawn_by_cpu"] == true);
        assert_eq!(by_cpu.count(), 3);
        let mut sums = [0.0; 6];
        for frame in ran["frames"].as_array().unwrap() {
            let cost = &frame["cost"];
            let stages = ["surface", "field", "ahead", "load", "draw", "write"];
            for (sum, stage) in sums.iter_mut().zip(stages) {
                *sum += cost["stages"][stage]["seconds"].as_f64().unwrap();
                assert!(cost["stages"][stage]["cpu_seconds"].as_f64().unwrap() >= 0.0);
            }
            assert!(cost["stages"]["draw"]["seconds"].as_f64() > Some(0.0));
            let used = cost["photos_used"].as_u64().unwrap();
            assert!((1..=9).contains(&used), "{used}");
            let scored = cost["cameras_scored"].as_u64().unwrap();
            assert!(used <= scored, "{cost}");
            assert_eq!(scored + cost["cameras_never_scored"].as_u64().unwrap(), 9);
            assert_eq!(
                (&cost["parts"], &cost["drawn_by_cpu"]),
                (&1.into(), &true.into())
            );
            assert!(cost["device_seconds"].is_null());
        }
        let draw = report["stages"]["draw"]["seconds"].as_f64().unwrap();
        assert!((draw - sums[4]).abs() < 1e-6, "{draw}, {sums:?}");
        let skipped = &report["skipped"];
        let decoded = report["photos_decoded"].as_u64().unwrap();
        let never = skipped["photos_never_decoded"].as_u64().unwrap();
        assert_eq!(never + decoded, 9);
        // With 7 mip levels.
        let photo = 4 * (96 * 72 + 48 * 36 + 24 * 18 + 12 * 9 + 6 * 5 + 3 * 3 + 2 * 2);
        assert_eq!(skipped["bytes_never_decoded"], never * photo);
        assert!(skipped["photos_never_uploaded"].is_null());
        assert!(skipped["scorings_omitted"].as_u64() > Some(0), "{skipped}");
        assert_eq!(skipped["visibility_tests_omitted_photos"], 9);
        assert_eq!(skipped["mask_tests_omitted_photos"], 9);

        // Counts do not depend on the threads.
        for threads in [1, 3] {
            let again = render(
                &format!(" --threads {threads}"),
                &format!("{renderer}-{threads}"),
            );
            assert_eq!(
                counts(&again),
                counts(&ran),
                "{renderer}, {threads} threads"
            );
        }
        let all = render(" --no-skip", &format!("{renderer}-all"));
        let skipped = &all["report"]["skipped"];
        assert_eq!(skipped["photos_never_decoded"], 0);
        assert_eq!(skipped["bytes_never_decoded"], 0);
        for what in [
            "cameras_never_scored",
            "scorings_omitted",
            "lens_maths_omitted_photos",
        ] {
            assert_eq!(skipped[what], 0, "{renderer}, {what}");
        }
        // Of one thing alone the other is left out.
        for (kept, left_out) in [
            ("views", "lens_maths_omitted_photos"),
            ("lenses", "scorings_omitted"),
        ] {
            let out = format!("{renderer}-{kept}");
            let some = render(&format!(" --no-skip={kept}"), &out);
            let skipped = &some["report"]["skipped"];
            assert!(
                skipped[left_out].as_u64() > Some(0),
                "{renderer}: {skipped}"
            );
        }
    }
    let line = "render wall --proxy plane --path sweep --frames 2 -o text";
    let said = lumigraph(folder.path(), line).ok().stderr;
    for what in [
        "seconds (CPU) by stage: surface ",
        "draw ",
        "; no graphics device draws; ",
        "skipped: ",
        "visibility tests of 9 photos",
    ] {
        assert!(said.contains(what), "{what}: {said}");
    }
}

#[test]
fn a_graphics_device_says_what_it_never_got() {
    let folder = with_wall();
    let line = "render wall --proxy plane --path sweep --frames 3 --k 2 --device gpu --json -o out";
    let ran = lumigraph(folder.path(), line);
    if ran.code == 1 && ran.stderr.contains("graphics device") {
        assert!(
            std::env::var_os("LUMIGRAPH_REQUIRE_GPU").is_none(),
            "a graphics device is required: {}",
            ran.stderr
        );
        eprintln!("SKIPPED: no graphics device: {}", ran.stderr);
        return;
    }
    let ran = ran.ok().json();
    let report = &ran["report"];
    println!("{report}");
    let skipped = &report["skipped"];
    let loads = report["gpu_memory"]["loads"].as_u64().unwrap();
    assert_eq!(skipped["photos_never_uploaded"], 9 - loads);
    assert_eq!(report["frames_by_cpu"], 0);
    assert!(report["notes"].as_array().unwrap().is_empty());
    for frame in ran["frames"].as_array().unwrap() {
        let device = &frame["cost"]["device_seconds"];
        assert!(device.is_null() || device.as_f64() > Some(0.0), "{device}");
        assert_eq!(frame["cost"]["drawn_by_cpu"], false);
        assert!(frame["cost"]["photos_used"].as_u64() <= Some(loads));
    }
}

#[test]
fn a_bound_on_the_error_chooses_frame_by_frame() {
    let folder = with_wall();
    let render = |options: &str, out: &str| {
        let line = format!(
            "render wall --proxy plane --path sweep --frames 3 --size 240x180 --json -o {out}{options}"
        );
        let ran = lumigraph(folder.path(), &line).ok().json();
        (ran, files(&folder.path().join(out)))
    };
    let (default, by_default) = render("", "default");
    assert!(default["report"].get("max_error").is_none());
    assert_eq!(default["frames"][0]["cost"]["grid"], 32);
    let (_, exact) = render(" --renderer exact", "exact");
    assert!(exact != by_default);

    let (none, pictures) = render(" --max-error inf", "none");
    assert!(pictures == by_default);
    let of_run = &none["report"]["max_error"];
    assert!(of_run["bound"].is_null() && of_run["error_at_most"].is_null());
    assert_eq!(of_run["frames_by_grid"]["32"], 3);

    let (zero, pictures) = render(" --max-error 0", "zero");
    assert!(pictures == exact);
    assert_eq!(zero["report"]["max_error"]["frames_exact"], 3);

    let (half, pictures) = render(" --max-error 0.5", "half");
    let of_run = &half["report"]["max_error"];
    let most = of_run["error_at_most"].as_f64().unwrap();
    assert!(most > 0.0 && most <= 0.5, "{of_run}");
    let each = half["frames"].as_array().unwrap().iter();
    let errors = each.map(|frame| frame["cost"]["error_at_most"].as_f64().unwrap());
    assert_eq!(errors.fold(0.0, f64::max), most);
    // Neither what draws nor the threads have a say.
    for (options, out) in [
        (" --device reference", "reference"),
        (" --threads 1", "one"),
    ] {
        let (again, of_again) = render(&format!(" --max-error 0.5{options}"), out);
        assert_eq!(&again["report"]["max_error"], of_run, "{options}");
        assert!(of_again == pictures || out == "reference");
    }

    for wrong in ["-1", "NaN", "50dB"] {
        let line = format!("render wall --proxy plane --path orbit -o out --max-error {wrong}");
        let error = lumigraph(folder.path(), &line).error(2);
        assert!(error.contains("steps of 255"), "{error}");
    }
    for other in ["--grid 16", "--renderer exact"] {
        let line = format!("render wall --proxy plane --path orbit -o out --max-error 1 {other}");
        assert!(
            lumigraph(folder.path(), &line)
                .error(2)
                .contains("cannot be used with")
        );
    }
}

#[test]
fn whatever_draws_ends_with_a_report_and_all_notes_on_what_draws() {
    let folder = with_wall();
    for line in [
        "render wall --path sweep --frames 2 -o out",
        "evaluate wall --every 5",
    ] {
        let line = format!("{line} --proxy plane --size 48x36 --json --device auto");
        let ran = lumigraph(folder.path(), &format!("{line} --gpu-memory 1GB")).ok();
        let report = &ran.json()["report"];
        assert!(report["seconds"].as_f64() > Some(0.0), "{line}: {report}");
        assert!(report["photos_decoded"].as_u64() > Some(0), "{line}");
        assert_eq!(report["frames_empty"], 0, "{line}");
        let notes = report["notes"].as_array().unwrap().iter();
        let notes: Vec<&str> = notes.map(|note| note.as_str().unwrap()).collect();
        for said in [
            "no graphics processor answers; drawing on the CPU",
            "--gpu-memory changes nothing: no graphics processor draws",
        ] {
            let is_said = ran.stderr.contains(&format!("note: {said}\n"));
            assert_eq!(notes.contains(&said), is_said, "{line}: {}", ran.stderr);
            // Without a device both are, and with one neither.
            let by_cpu = report["frames_by_cpu"].as_u64() > Some(0);
            assert_eq!(by_cpu, is_said, "{line}: {report}");
        }
    }
}
