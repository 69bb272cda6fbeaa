//! Run time against error.

use crate::run::{files, lumigraph, with_wall};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;

const LINE: &str = "bench wall --device cpu --long-side 64 -o out --json";

#[test]
fn a_scene_is_measured_once_and_the_report_is_whole() {
    let folder = with_wall();
    let result = lumigraph(folder.path(), LINE).ok().json();
    let subject = &result["subjects"][0];
    assert_eq!(subject["name"], "wall");
    let settings = subject["settings"].as_array().unwrap();
    let of = |name: &str| {
        let found = settings.iter().find(|s| s["name"] == name);
        found.unwrap_or_else(|| panic!("{name} was not measured"))
    };
    let number = |name: &str, key: &str| of(name)[key].as_f64().unwrap();
    for setting in settings {
        assert!(setting["frame"]["cpu_ms"].as_f64() > Some(0.0), "{setting}");
        assert!(setting["image_bytes"].as_u64() > Some(0), "{setting}");
        let [least, most] = [0, 1].map(|i| setting["cpu_ms_range"][i].as_f64().unwrap());
        let median = setting["frame"]["cpu_ms"].as_f64().unwrap();
        assert!(least <= median && median <= most, "{setting}");
    }
    // What is known of the wall, which is a plane.
    assert_eq!(number("renderer exact", "steps_from_exact"), 0.0);
    assert!(number("default", "steps_from_exact") < 1.0);
    assert!(number("default", "psnr") > number("photos 1/2", "psnr"));
    assert!(number("photos 1/2", "image_bytes") < 0.5 * number("default", "image_bytes"));
    let skips = subject["skips"].as_array().unwrap();
    let names: Vec<&str> = skips.iter().map(|s| s["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["photos", "views", "lenses"]);
    for skip in skips {
        assert_eq!(skip["same_bytes"], true, "{skip}");
        assert!(skip["without"]["cpu_ms"].as_f64() > Some(0.0), "{skip}");
    }
    assert!(subject["start_up"]["decode_ms"].as_f64() > Some(0.0));

    let out = folder.path().join("out");
    assert_eq!(
        files(&out).into_keys().collect::<Vec<_>>(),
        [
            "measured/wall.json",
            "report.html",
            "results.csv",
            "results.json"
        ]
        .map(PathBuf::from)
    );
    let written: Value =
        serde_json::from_slice(&fs::read(out.join("results.json")).unwrap()).unwrap();
    assert_eq!(written, result);
    let csv = fs::read_to_string(out.join("results.csv")).unwrap();
    let columns = csv.lines().next().unwrap().split(',').count();
    assert!(
        csv.lines().all(|line| line.split(',').count() == columns),
        "{csv}"
    );
    assert_eq!(csv.lines().count(), 1 + settings.len());

    // One page that fetches nothing and runs nothing.
    let html = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(!html.contains("<script") && !html.contains("@import"));
    for attribute in ["src=\"", "href=\"", "url("] {
        for address in html.split(attribute).skip(1) {
            assert!(
                address.starts_with("data:"),
                "{attribute}{}",
                &address[..40]
            );
        }
    }
    for tag in ["table", "figure", "svg", "h2", "tr", "td", "p"] {
        let (open, close) = (format!("<{tag}"), format!("</{tag}>"));
        let opened =
            html.matches(&format!("{open} ")).count() + html.matches(&format!("{open}>")).count();
        assert_eq!(opened, html.matches(&close).count(), "{tag}");
    }

    for bad in [">NaN", "\"NaN", "inf ", ">inf"] {
        assert!(!html.contains(bad), "{bad}");
    }

    // A setting's dots have one colour in both plots.
    let mut colors: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for dot in html.split("r=\"4\" fill=\"").skip(1) {
        let (color, rest) = dot.split_once("\"><title>").unwrap();
        colors
            .entry(rest.split(':').next().unwrap())
            .or_default()
            .push(color);
    }
    assert!(colors.values().any(|colors| colors.len() == 2));
    for (name, colors) in colors {
        assert!(colors.iter().all(|c| *c == colors[0]), "{name}: {colors:?}");
    }

    // What is there is not measured again; other pictures are.
    let again = lumigraph(folder.path(), LINE).ok();
    assert_eq!(again.json(), result);
    assert!(
        again.stderr.contains("wall: measured before"),
        "{}",
        again.stderr
    );
    let other = lumigraph(folder.path(), &LINE.replace("64", "48")).ok();
    assert!(
        !other.stderr.contains("measured before"),
        "{}",
        other.stderr
    );
    assert_eq!(other.json()["subjects"][0]["size"][0], 48);
}

#[test]
fn a_scene_that_changed_is_measured_anew_with_the_gains_it_has() {
    let folder = with_wall();
    let here = folder.path();
    // Photos of two exposures, which the scene is to leave as they are.
    for i in [1, 3, 5, 7] {
        let path = here.join(format!("wall/images/{i:04}.png"));
        let mut photo = image::open(&path).unwrap().into_rgb8();
        photo.iter_mut().for_each(|value| *value /= 2);
        photo.save(&path).unwrap();
    }
    lumigraph(here, "import wall --no-exposure -o scene").ok();
    let line = LINE.replace("wall", "scene");
    let result = lumigraph(here, &line).ok().json();
    let settings = result["subjects"][0]["settings"].as_array().unwrap();
    let psnr = |name: &str| settings.iter().find(|s| s["name"] == name).unwrap()["psnr"].as_f64();
    assert_eq!(psnr("default"), psnr("exposure off"));

    let split = here.join("wall/split.json");
    let written = fs::read(&split).unwrap();
    let one = r#"{"test": ["0004.png"]}"#;
    fs::write(&split, one).unwrap();
    let other = lumigraph(here, &line).ok();
    let (said, result) = (&other.stderr, other.json());
    assert!(!said.contains("measured before"), "{said}");
    assert!(said.contains("wall/split.json has"), "{said}");
    assert_eq!(result["subjects"][0]["views"][0], "0004.png");
    let again = lumigraph(here, &line).ok().stderr;
    assert!(again.contains("scene: measured before"), "{again}");

    // A surface of its own, and the calibration.
    fs::write(&split, written).unwrap();
    lumigraph(here, "proxy scene plane").ok();
    let images = here.join("scene/model/images.txt");
    fs::write(&images, fs::read(&images).unwrap()).unwrap();
    let said = lumigraph(here, &line).ok().stderr;
    for file in ["scene/proxy.json is new", "images.txt was written since"] {
        assert!(said.contains(file), "{file}: {said}");
    }
}

#[test]
fn an_interior_is_measured_by_what_portals_show() {
    let folder = tempfile::tempdir().unwrap();
    let line = "generate house --rooms 2 --triangles 2000 -o house";
    lumigraph(folder.path(), line).ok();
    let result = lumigraph(folder.path(), &LINE.replace("wall", "house"))
        .ok()
        .json();
    let settings = result["subjects"][0]["settings"].as_array().unwrap();
    let of = |name: &str| settings.iter().find(|s| s["name"] == name).unwrap();
    assert_eq!(of("default")["steps_from_exact"], 0.0);
    assert_eq!(of("default")["holes"], 0.0);
    let psnr = |name: &str| of(name)["psnr"].as_f64().unwrap();
    assert!(psnr("portals ldi") > psnr("portals texture"));
    assert!(of("portals ldi")["images_made"].as_u64() > Some(2));
    let skips = result["subjects"][0]["skips"].as_array().unwrap();
    let names: Vec<&str> = skips.iter().map(|s| s["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["cells", "columns"]);
    assert!(skips.iter().all(|s| s["same_bytes"] == true), "{skips:?}");
}

#[test]
fn scenes_of_one_name_and_none_are_refused() {
    let folder = with_wall();
    fs::create_dir(folder.path().join("other")).unwrap();
    fs::rename(folder.path().join("wall"), folder.path().join("other/wall")).unwrap();
    let missing = lumigraph(folder.path(), "bench wall -o out").error(1);
    assert_eq!(missing, "wall: there is no such folder; check the path");
    let twice = lumigraph(folder.path(), "bench other/wall other/../other/wall -o out");
    let twice = twice.error(2);
    assert!(twice.contains("have the same name"), "{twice}");
    assert!(!folder.path().join("out").exists());
}

#[test]
fn scenes_that_try_to_break_things_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let line = "bench --stress 0.01 --seed 7 --json --device cpu -o out";
    let ran = lumigraph(folder.path(), line).ok();
    let said = "note: --device and --output change nothing: --stress writes no report, and draws by all that there is\n";
    assert!(ran.stderr.contains(said), "{}", ran.stderr);
    assert!(!folder.path().join("out").exists());
    let result = ran.json();
    assert_eq!(result["first"], 7);
    assert!(result["scenes"].as_u64() > Some(0) && result["bad"].as_array().unwrap().is_empty());
    let both = lumigraph(folder.path(), "bench wall --stress 1");
    assert_eq!(both.code, 2);
}
