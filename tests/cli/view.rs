//! `lumigraph view` in a real window on a virtual screen, with real keys and a real mouse.

use crate::interior::with_house;
use crate::run::{lumigraph, with_wall};
use crate::screen::{SIZE, Screen, Window, has_tools, is_settled, pixels, says, triple};
use calibrate::{Camera, Lens, Rigid3};
use glam::{DVec2, DVec3};
use image::{Rgba, RgbaImage};
use proxy::interior::{Interior, Portal, read_interior};
use render::path::{
    Interpolation, Keyframe, KeyframeFile, NerfstudioFrame, PathFrame, read_keyframes,
    write_keyframes,
};
use serde_json::Value;
use std::path::Path;
use std::process::Command;
use tempfile::TempDir;

/// The mean difference of colours in columns of two pictures, in steps of 255.
fn difference(a: &RgbaImage, b: &RgbaImage, columns: std::ops::Range<u32>) -> f64 {
    let rows = 0..a.height();
    let all = rows.flat_map(|y| columns.clone().map(move |x| (x, y)));
    let off = |p: &Rgba<u8>, q: &Rgba<u8>| -> u32 {
        (0..3).map(|c| u32::from(p.0[c].abs_diff(q.0[c]))).sum()
    };
    let (mut sum, mut count) = (0.0, 0.0);
    for (x, y) in all {
        sum += f64::from(off(a.get_pixel(x, y), b.get_pixel(x, y))) / 3.0;
        count += 1.0;
    }
    sum / count
}

/// A pose that its file gives back to the last bit.
fn keyframe(t_s: f64, eye: DVec3, ahead: DVec3, up: DVec3) -> Keyframe {
    let (width, height) = SIZE;
    let size = DVec2::new(f64::from(width), f64::from(height));
    let lens = Lens::pinhole(DVec2::splat(0.7 * size.x), 0.5 * size);
    let camera = Camera::of(&lens, width, height);
    let pose = Rigid3::looking_at(eye, eye + ahead, up);
    let frame = PathFrame::new("a".to_owned(), camera.clone(), pose, None).unwrap();
    Keyframe {
        t_s,
        camera_from_world: frame.view.camera_from_world,
        camera,
        time_s: None,
    }
}

/// What is said in a folder without a display, when no window can be opened.
#[track_caller]
fn said_without_a_display(folder: &TempDir, line: &str) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_lumigraph"))
        .current_dir(folder.path())
        .args(line.split(' '))
        .env_remove("DISPLAY")
        .env_remove("WAYLAND_DISPLAY")
        .env_remove("WAYLAND_SOCKET")
        .output()
        .unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{said}");
    said
}

#[test]
fn without_a_display_one_line_says_what_to_do() {
    let folder = with_wall();
    let said = said_without_a_display(&folder, "view wall --proxy plane");
    assert!(
        said.starts_with("error: no display to open a window on"),
        "{said}"
    );
    assert_eq!(said.lines().count(), 1, "{said}");
    // What is wrong with the data is said first.
    let error = lumigraph(folder.path(), "view nothing").error(1);
    assert!(error.contains("nothing"), "{error}");
    let error = lumigraph(folder.path(), "view wall --portals mirrors");
    assert_eq!(error.code, 2, "{}", error.stderr);
}

#[test]
fn a_folder_that_cannot_be_is_told_before_there_is_a_window() {
    let folder = with_wall();
    std::fs::write(folder.path().join("film"), "").unwrap();
    for output in ["film", "film/today"] {
        let line = format!("view wall --proxy plane -o {output}");
        let said = said_without_a_display(&folder, &line);
        let expected = "error: film: a file is where the folder was to be; choose another -o\n";
        assert_eq!(said, expected, "{line}");
    }
}

#[test]
fn a_folder_that_nobody_named_keeps_nobody_from_looking() {
    let folder = with_wall();
    std::fs::write(folder.path().join("lumigraph-view"), "").unwrap();
    let said = said_without_a_display(&folder, "view wall --proxy plane");
    let note = "note: lumigraph-view: a file is where the folder was to be; to save screenshots or a path, choose \
                another -o\nerror: no display to open a window on";
    assert!(said.starts_with(note), "{said}");
    // Named, it is asked for.
    let line = "view wall --proxy plane -o lumigraph-view";
    let said = said_without_a_display(&folder, line);
    assert!(said.starts_with("error: lumigraph-view: "), "{said}");
}

#[test]
fn options_that_change_nothing_are_told() {
    let (wall, house) = (with_wall(), with_house());
    let of_time = "--period auto --proxy tunnel --renderer exact --grid 8";
    for (folder, line, expected) in [
        (
            &house,
            format!("view house {of_time} --portals ldi --ldi-views 3"),
            Some("--proxy, --renderer, --grid and --period change nothing: house is an interior"),
        ),
        (
            &house,
            "view house/interior.json --strict --cpu-memory 1GB".to_owned(),
            Some("--strict changes nothing: house/interior.json is an interior"),
        ),
        (&house, "view house --portals warp1".to_owned(), None),
        (
            &wall,
            "view wall --proxy plane --portals ldi --ldi-views 3".to_owned(),
            Some("--portals and --ldi-views change nothing: wall is no interior"),
        ),
        (
            &wall,
            "view wall --renderer exact --grid 8".to_owned(),
            Some("--grid changes nothing: --renderer exact has no grid"),
        ),
        (&wall, "view wall --k 3 --strict".to_owned(), None),
    ] {
        let said = said_without_a_display(folder, &line);
        let notes: Vec<&str> = said.lines().filter(|l| l.contains("nothing: ")).collect();
        let expected = expected.map(|expected| format!("note: {expected}"));
        assert_eq!(notes, Vec::from_iter(expected.as_deref()), "{line}");
    }
    // The pictures would show what was to be held out.
    let ran = lumigraph(house.path(), "view house --hold-out split.json");
    assert_eq!(ran.code, 2, "{}", ran.stderr);
    let remedy = "`lumigraph interior CAPTURE --hold-out SPLIT.json` makes one";
    assert!(ran.stderr.contains(remedy), "{}", ran.stderr);
}

#[test]
fn a_capture_is_looked_at_and_filmed() {
    if !has_tools() {
        return;
    }
    let folder = with_wall();
    let here = folder.path();
    let screen = Screen::open();
    let mut window = Window::open(&screen, here, "view wall --proxy plane -o out");
    // It begins at the first photo, and `render` draws the same picture.
    let shot = window.shoot(1);
    let line = "render wall --proxy plane --views out/shot_0001.png -o again";
    lumigraph(here, line).ok();
    let first = pixels(&here.join("out").join(&shot));
    assert_eq!(first.dimensions(), SIZE);
    assert!(
        first == pixels(&here.join("again").join(&shot)),
        "not the same picture"
    );
    let photo = |name: &str| {
        let photo = pixels(&here.join("wall/images").join(name));
        image::imageops::resize(
            &photo,
            SIZE.0,
            SIZE.1,
            image::imageops::FilterType::Triangle,
        )
    };
    let off = difference(&first, &photo("0000.png"), 8..312);
    assert!(off < 6.0, "not the first photo: {off}");
    // The next camera, and a wipe to its photo over the field in colours.
    window.key("n");
    window.wait("the second camera", |f| is_settled(f) && f["stop"] == 1);
    window.key("f o");
    window.wait("the wipe", |f| is_settled(f) && f["picture"]["photo"] == 1);
    let seen = screen.look(here);
    let (left, right) = (
        difference(&seen, &photo("0001.png"), 8..150),
        difference(&seen, &photo("0001.png"), 170..312),
    );
    assert!(right < 6.0 && left > 20.0, "{left} {right}");
    window.key("f o");
    let before = window.wait("no wipe", |f| {
        is_settled(f) && f["picture"]["photo"].is_null()
    });
    // Dragging goes around, the wheel goes nearer.

    screen.do_all("mousemove 160 120 mousedown 1 mousemove 190 125 mouseup 1");
    let around = window.wait("going around", |f| {
        is_settled(f) && triple(f, "center").distance(triple(&before, "center")) > 0.1
    });
    assert!(triple(&around, "forward").dot(triple(&before, "forward")) < 0.995);
    screen.do_all("click 4");
    let near = window.wait("going nearer", |f| {
        is_settled(f) && triple(f, "center").distance(triple(&around, "center")) > 0.1
    });
    let way = triple(&near, "center") - triple(&around, "center");
    assert!(way.normalize().dot(triple(&around, "forward")) > 0.9);
    // A path through two cameras, saved, and back to its beginning.
    window.key("k");
    window.key("r");
    window.wait("a camera", |f| is_settled(f) && !f["stop"].is_null());
    window.key("k");
    window.key("ctrl+s");
    window.wait("the path", |f| says(f, "path.json") && f["keyframes"] == 2);
    window.key("bracketleft");
    window.wait("the beginning", |f| {
        is_settled(f) && triple(f, "center").distance(triple(&near, "center")) < 1e-9
    });
    let shot = window.shoot(2);
    window.key("space");
    window.wait("the film", |f| f["is_playing"] == true);
    window.wait("its end", |f| f["is_playing"] == false && is_settled(f));
    let last = window.shoot(3);
    let line = "render wall --proxy plane --path out/path.json -o film";
    lumigraph(here, line).ok();
    let filmed = |name: &str| pixels(&here.join("film").join(name));
    let shown = |name: &str| pixels(&here.join("out").join(name));
    assert!(
        shown(&shot) == filmed("frame_0000.png"),
        "the beginning differs"
    );
    assert!(shown(&last) == filmed("frame_0060.png"), "the end differs");
    // Five keyframes make a film, and nerfstudio can have them, too.
    for stop in ["n", "n", "b"] {
        window.key(stop);
        window.wait("a camera", |f| is_settled(f) && !f["stop"].is_null());
        window.key("k");
    }
    window.key("ctrl+s");
    window.wait("the path", |f| f["keyframes"] == 5 && says(f, "nerfstudio"));
    let render = "render wall --proxy plane --size 80x60 --path out";
    let line = format!("{render}/path.json -o five --video five.mp4");
    lumigraph(here, &line).ok();
    let five = |i: usize| format!("frame_{i:04}.png");
    assert!(here.join("five.mp4").is_file() && here.join("five").join(five(240)).is_file());
    assert!(!here.join("five").join(five(241)).exists());
    let line = format!("{render}/camera_path.json --frames 100..104 -o theirs");
    lumigraph(here, &line).ok();
    for i in 100..104 {
        let [own, theirs] =
            ["five", "theirs"].map(|folder| pixels(&here.join(folder).join(five(i))));
        assert!(difference(&own, &theirs, 0..80) < 0.01, "frame {i}");
    }
    // What windows go through: another scale, another size, out of sight, a device that is lost.
    screen.set_dpi(144);
    window.wait("larger letters", |f| f["scale"] == 1.5 && is_settled(f));
    screen.set_dpi(96);
    window.wait("the old ones", |f| f["scale"] == 1.0 && is_settled(f));
    screen.do_all("search --name lumigraph windowsize 200 1");
    window.wait("a sliver", |f| f["size"] == serde_json::json!([200, 1]));
    screen.do_all("search --name lumigraph windowsize 200 150");
    window.wait("another size", |f| is_settled(f) && f["size"][1] == 150);
    window.key("ctrl+F12");
    window.wait("another device", |f| is_settled(f) && f["losses"] == 1);
    screen.do_all("search --name lumigraph windowunmap windowmap --sync windowfocus --sync");
    window.key("n");
    window.wait("it back", |f| is_settled(f) && !f["stop"].is_null());
    // Esc closes the help first; at the end what is in no file is saved beside what is.
    window.key("F1 Escape k");
    window.wait("one more keyframe", |f| f["keyframes"] == 6);
    assert!(window.close().success());
    let kept = |name: &str| {
        let file = read_keyframes(&here.join("out").join(name), &NerfstudioFrame::default());
        file.unwrap().unwrap().keyframes.len()
    };
    assert_eq!((kept("path.json"), kept("path_2.json")), (5, 6));
    traced_times_are_there(&here.join("trace.jsonl"));
    // What cannot be loaded is said in the window, and at its end.
    let mut window = Window::start(&screen, here, "view five");
    window.wait("what is wrong", |f| f["failed"].is_string());
    window.focus();
    assert_eq!(window.close().code(), Some(1));
}

/// How long is not asserted: machines differ.
fn traced_times_are_there(trace: &Path) {
    let text = std::fs::read_to_string(trace).unwrap();
    let mut longest = 0.0_f64;
    for line in text.lines() {
        let frame: Value = serde_json::from_str(line).unwrap();
        for step in ["events", "step", "panels", "tessellate"] {
            longest = longest.max(frame["steps_ms"][step].as_f64().unwrap());
            assert!(frame["steps_cpu_ms"][step].as_f64().unwrap() >= 0.0);
        }
        assert!(frame["upload_ms"].as_f64().unwrap() >= 0.0);
        assert!(frame["draw_ms"].as_f64().unwrap() > 0.0);
    }
    assert!(longest > 0.0);
}

/// A door that leads from room to room.
fn door(interior: &Interior) -> &Portal {
    let is_door = |p: &&Portal| {
        let corners = p.polygon.corners();
        p.cells.iter().all(Option::is_some)
            && corners.iter().any(|c| c.dot(interior.up).abs() < 1e-6)
    };
    interior.portals.iter().find(is_door).unwrap()
}

#[test]
fn a_house_is_walked_through() {
    if !has_tools() {
        return;
    }
    let folder = with_house();
    let here = folder.path();
    let (interior, _) = read_interior(&here.join("house/interior.json")).unwrap();
    // Before a door, and before the wall beside it.
    let (portal, up) = (door(&interior), interior.up);
    let name = |i: usize| interior.cell(portal.cells[i].unwrap()).name.clone();
    let normal = portal.polygon.normal();
    let (center, along) = (portal.polygon.center(), up.cross(normal));
    let eye = center + up * (interior.eye_height - center.dot(up));
    let aside = 0.5 * portal.width(up) + 0.4;
    let before = |side: f64| eye + 0.7 * normal + side * along;
    let keyframes = vec![
        keyframe(0.0, before(0.0), -normal, up),
        keyframe(2.0, before(aside), -normal, up),
    ];
    let file = KeyframeFile {
        fps: 30.0,
        keyframes,
        interpolation: Interpolation::Linear,
    };
    write_keyframes(&here.join("path.json"), &file).unwrap();
    let screen = Screen::open();
    let line = "view house --path path.json -o out";
    let mut window = Window::open(&screen, here, line);
    let height = |point: DVec3| portal.polygon.height(point);
    // Through the door.
    window.key("bracketright");
    window.wait("the door", |f| {
        is_settled(f) && f["cell"] == name(0).as_str()
    });
    screen.do_all("keydown w");
    let through = window.wait("the next room", |f| f["cell"] == name(1).as_str());
    screen.do_all("keyup w");
    assert!(height(triple(&through, "center")) < 0.0);
    // Not through the wall.
    window.key("bracketright");
    let from = window.wait("the wall", |f| {
        is_settled(f) && f["cell"] == name(0).as_str()
    });
    screen.do_all("keydown w");
    let start = height(triple(&from, "center"));
    window.wait("a wall that is near", |f| {
        height(triple(f, "center")) < start - 0.3
    });
    let mut last = DVec3::NAN;
    for _ in 0..50 {
        let frame = window.wait("a frame", |_| true);
        assert_eq!(frame["cell"], name(0).as_str());
        last = triple(&frame, "center");
        assert!(height(last) > 0.15, "{}", height(last));
    }
    screen.do_all("keyup w");
    let frame = window.wait("rest", is_settled);
    assert!(triple(&frame, "center").distance(last) < 0.05);
    // And what is seen there is what `walk` draws.
    let shot = window.shoot(1);
    lumigraph(here, &format!("walk house --path out/{shot} -o again")).ok();
    let again = pixels(&here.join("again").join(&shot));
    assert!(
        pixels(&here.join("out").join(&shot)) == again,
        "not the same picture"
    );
    assert!(window.close().success());
}
