//! The folders that interiors are written into, however they are spelt.

use crate::interior::{ROOMS, names, with_house};
use crate::run::{files, lumigraph, with_wall};
use image::{Rgba, RgbaImage};
use proxy::mesh::read_model;

#[test]
fn the_folder_one_stands_in_is_filled_and_replaced_like_any_other() {
    let folder = with_house();
    let here = folder.path();
    std::fs::write(here.join("rooms.json"), ROOMS).unwrap();
    let line = "interior house/house.glb --rooms rooms.json -o one";
    lumigraph(here, line).ok();
    let expected = files(&here.join("one"));
    let two = here.join("two");
    std::fs::create_dir(&two).unwrap();
    let from_two = "interior ../house/house.glb --rooms ../rooms.json";
    for output in [".", ". --force", "../two/. --force", "../two --force"] {
        lumigraph(&two, &format!("{from_two} -o {output}")).ok();
        assert!(files(&two) == expected, "{output}");
        // Nothing is left beside it.
        let left = ["house", "one", "rooms.json", "two"];
        assert_eq!(names(here), left, "{output}");
    }
    // From within: what is not an interior's stays.
    std::fs::create_dir(two.join("mine")).unwrap();
    let from_mine = "interior ../../house/house.glb --rooms ../../rooms.json -o .. --force";
    let error = lumigraph(&two.join("mine"), from_mine).error(1);
    assert!(error.contains("..: the folder is not empty"), "{error}");
    assert_eq!(names(&two), ["house.glb", "interior.json", "mine"]);
    assert!(files(&two) == expected);
}

#[test]
fn a_models_name_may_end_in_capitals() {
    let folder = with_house();
    let here = folder.path();
    std::fs::write(here.join("rooms.json"), ROOMS).unwrap();
    std::fs::copy(here.join("house/house.glb"), here.join("HOUSE.GLB")).unwrap();
    let line = "interior HOUSE.GLB --rooms rooms.json -o one";
    lumigraph(here, line).ok();
    let expected = files(&here.join("one"));
    lumigraph(here, &format!("{line} --force")).ok();
    assert!(files(&here.join("one")) == expected);
    let walk = "walk one --tour --frames 1 --size 16x16 -o one/frames";
    let error = lumigraph(here, walk).error(1);
    assert!(error.contains("one holds an interior"), "{error}");
}

#[test]
fn a_generated_house_is_replaced_with_what_it_says_of_itself_and_nothing_of_ones_own() {
    let folder = with_house();
    let here = folder.path();
    let house = here.join("house");
    let replace = "interior house/house.glb --find -o house";
    let error = lumigraph(here, replace).error(1);
    assert!(error.contains("replace it with --force"), "{error}");
    // What somebody wrote is in the way, and named, before --force is advised.
    let own = std::fs::read_to_string(house.join("README.md")).unwrap();
    for (file, text) in [
        ("README.md", "# house\n\nMine.\n".to_owned()),
        ("README.md", format!("{own}- My notes.\n")),
        ("notes.txt", String::new()),
    ] {
        std::fs::write(house.join(file), text).unwrap();
        let before = files(&house);
        for force in ["", " --force"] {
            let error = lumigraph(here, &format!("{replace}{force}")).error(1);
            let said = format!("house: the folder is not empty: it holds an interior, and {file};");
            assert!(error.contains(&said), "{error}");
        }
        assert!(files(&house) == before);
        std::fs::write(house.join("README.md"), &own).unwrap();
    }
    std::fs::remove_file(house.join("notes.txt")).unwrap();
    lumigraph(here, &format!("{replace} --force")).ok();
    let expected = [
        "floor-plan.png",
        "floor-plan.svg",
        "house.glb",
        "interior.json",
    ];
    assert_eq!(names(&house), expected);
}

#[test]
fn nothing_else_is_written_into_an_interiors_folder() {
    let folder = with_wall();
    let here = folder.path();
    lumigraph(here, "generate house --rooms 2 --triangles 1 -o house").ok();
    let house = here.join("house");
    let before = files(&house);
    let render = "--proxy plane --path sweep --frames 1 --size 16x12";
    let evaluate = "evaluate wall --proxy plane --size 16x12";
    let field = "field wall --view 0000.png --proxy plane";
    let walk = "--frames 1 --size 16x12";
    let others = [
        "demo -o house/demo",
        "bench wall -o house/measured",
        "generate wall -o house/wall",
        "import wall -o house/scene",
        "export wall --format colmap -o house/model",
        "export wall --format transforms -o house/t.json",
        "proxy wall plane -o house/p.json",
        "path p.json --format lumigraph -o house/new/er/p.json",
        "interior house/house.glb --find -o house/found",
    ];
    let others = others.map(|line| ("", line.to_owned()));
    let pictures = [
        ("", format!("render wall {render} -o house")),
        ("", format!("render wall {render} -o house/new/er")),
        ("house", format!("render ../wall {render} -o .")),
        ("", format!("{evaluate} -o house")),
        ("", format!("{field} -o house/field.png")),
        (
            "",
            format!("{field} -o field.png --weights house/field.npz"),
        ),
        ("", format!("walk house {walk} -o house/walk")),
        ("house", format!("walk . {walk} -o ldi")),
        ("", "view wall --proxy plane -o house/film".to_owned()),
        ("house", "view .".to_owned()),
    ];
    for (from, line) in pictures.into_iter().chain(others) {
        let error = lumigraph(&here.join(from), &line).error(1);
        let option = match line.contains("--weights") {
            true => "--weights",
            false => "-o",
        };
        let said = format!(
            "house holds an interior, and what else lies there keeps it from being replaced; \
             choose another {option}"
        );
        assert!(error.contains(&said), "{line}: {error}");
        assert!(files(&house) == before, "{line}");
    }
    // Beside it is room, also as seen from within.
    let film = format!("walk house {walk} -o walk --video house/film.mp4");
    let error = lumigraph(here, &film).error(1);
    assert!(error.ends_with("choose another --video"), "{error}");
    lumigraph(&house, &format!("walk . {walk} -o ../walk")).ok();
    assert!(files(&house) == before);
    assert!(here.join("walk/frame_0000.png").exists());
}

#[cfg(unix)]
#[test]
fn who_stands_in_a_folder_that_is_replaced_stays_in_it() {
    use std::os::unix::fs::MetadataExt;
    let folder = with_house();
    let here = folder.path();
    std::fs::create_dir(here.join("two")).unwrap();
    let number = || std::fs::metadata(here.join("two")).unwrap().ino();
    let before = number();
    std::fs::write(here.join("rooms.json"), ROOMS).unwrap();
    for force in ["", " --force"] {
        let line = "interior ../house/house.glb --rooms ../rooms.json -o .";
        lumigraph(&here.join("two"), &format!("{line}{force}")).ok();
        assert_eq!(number(), before);
    }
}

/// A triangle; its corners and its texture lie beside it.
const WALL: &str = r#"{"asset": {"version": "2.0"}, "nodes": [{"name": "wall", "mesh": 0}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "material": 0}]}],
    "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
    "textures": [{"source": 0}], "images": [{"uri": "in/wall.png"}],
    "accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3},
        {"bufferView": 1, "componentType": 5126, "type": "VEC2", "count": 3}],
    "bufferViews": [{"buffer": 0, "byteLength": 36},
        {"buffer": 0, "byteOffset": 36, "byteLength": 24}],
    "buffers": [{"byteLength": 60, "uri": "wall.bin"}]}"#;

#[test]
fn what_a_model_has_beside_it_is_in_its_copy() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let mut text = WALL.as_bytes().to_vec();
    text.resize(text.len().next_multiple_of(4), b' ');
    let length = text.len() as u32;
    let glb = [
        b"glTF".as_slice(),
        &2_u32.to_le_bytes(),
        &(20 + length).to_le_bytes(),
        &length.to_le_bytes(),
        b"JSON",
        text.as_slice(),
    ]
    .concat();
    std::fs::write(here.join("wall.glb"), glb).unwrap();
    let corners: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let uvs: [f32; 6] = [0.0, 1.0, 1.0, 1.0, 0.0, 0.0];
    let numbers = corners.into_iter().chain(uvs);
    let numbers: Vec<u8> = numbers.flat_map(f32::to_le_bytes).collect();
    std::fs::write(here.join("wall.bin"), numbers).unwrap();
    std::fs::create_dir(here.join("in")).unwrap();
    let picture = RgbaImage::from_fn(4, 4, |x, y| Rgba([60 * x as u8, 60 * y as u8, 9, 255]));
    picture.save(here.join("in/wall.png")).unwrap();
    std::fs::write(here.join("rooms.json"), ROOMS).unwrap();
    let ran = lumigraph(here, "interior wall.glb --rooms rooms.json -o room").ok();
    assert_eq!(ran.stderr, "");
    // Nothing else is needed, and it looks the same.
    assert_eq!(names(&here.join("room")), ["interior.json", "wall.glb"]);
    let (model, warnings) = read_model(&here.join("room/wall.glb")).unwrap();
    assert_eq!(warnings, [""; 0]);
    let (given, _) = read_model(&here.join("wall.glb")).unwrap();
    assert_eq!(model.textures.len(), 1);
    assert!(model == given);
}
