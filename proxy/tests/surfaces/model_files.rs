//! Textured models: that they come back from their files, and what is said of bad ones.

use crate::common;

use glam::DVec3;
use image::{Rgba, RgbaImage};
use proxy::mesh::{self, Material, Mesh, Model, ModelNode, Part, Texture, Wrap};
use serde_json::{Value, json};
use std::path::Path;

/// Two nodes, one below the other; a texture, a base colour and corners' colours.
pub(crate) fn small() -> Model {
    let texture = RgbaImage::from_fn(4, 2, |x, y| Rgba([60 * x as u8, 100 * y as u8, 7, 255]));
    let corner = |x: f64, y: f64| DVec3::new(x, y, 0.25);
    Model {
        mesh: Mesh {
            positions: vec![
                corner(0.0, 0.0),
                corner(1.0, 0.0),
                corner(1.0, 1.0),
                corner(0.0, 1.0),
            ],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        },
        uvs: vec![[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]],
        colors: vec![
            [255; 4],
            [0, 1, 2, 255],
            [128, 127, 3, 255],
            [254, 255, 0, 255],
        ],
        parts: vec![
            Part {
                triangles: 0..1,
                node_idx: 0,
                material_idx: 0,
            },
            Part {
                triangles: 1..2,
                node_idx: 1,
                material_idx: 1,
            },
        ],
        nodes: vec![
            ModelNode {
                name: "cell:a".to_owned(),
                parent_idx: None,
            },
            ModelNode {
                name: "chair".to_owned(),
                parent_idx: Some(0),
            },
        ],
        materials: vec![
            Material {
                texture_idx: Some(0),
                wrap: [Wrap::Clamp, Wrap::Mirror],
                ..Material::default()
            },
            Material {
                base_color: [0.5, 0.25, 1.0],
                ..Material::default()
            },
        ],
        textures: vec![Texture::new(texture)],
    }
}

pub(crate) fn read(bytes: &[u8]) -> Result<(Model, Vec<String>), String> {
    mesh::parse_model(Path::new("m.glb"), bytes).map_err(|e| e.to_string())
}

#[test]
fn a_model_comes_back_from_its_file() {
    let model = small();
    let bytes = mesh::model_to_glb(&model).unwrap();
    let (back, warnings) = read(&bytes).unwrap();
    assert_eq!(warnings, [""; 0]);
    assert_eq!(
        (&back.nodes, &back.textures),
        (&model.nodes, &model.textures)
    );
    // Parts share no corners in a file.
    let by_corner = |model: &Model| -> Vec<_> {
        let corners = model.mesh.triangles.as_flattened().iter();
        corners
            .map(|i| *i as usize)
            .map(|i| (model.mesh.positions[i], model.uvs[i], model.colors[i]))
            .collect()
    };
    assert_eq!(by_corner(&back), by_corner(&model));
    assert_eq!(back.parts, model.parts);
    assert_eq!(back.materials[0], model.materials[0]);
    for (a, b) in back.materials[1].base_color.iter().zip([0.5, 0.25, 1.0]) {
        assert!((a - b).abs() < 1e-6);
    }
    assert_eq!(back.nodes, model.nodes);
    // The geometry is what the reader of meshes finds.
    let mesh = mesh::parse(Path::new("m.glb"), &bytes).unwrap();
    assert_eq!(mesh, back.mesh);
}

#[test]
fn factors_and_corners_colours_are_linear_in_files_and_codes_in_models() {
    // Positions as corners' colours: three numbers of 32 bits, as many programs write them, a quarter for blue.
    let bytes = changed(&mesh::model_to_glb(&small()).unwrap(), |text| {
        let mut json: Value = serde_json::from_str(&text).unwrap();
        for mesh in json["meshes"].as_array_mut().unwrap() {
            let attributes = &mut mesh["primitives"][0]["attributes"];
            attributes["COLOR_0"] = attributes["POSITION"].clone();
        }
        let factor = json!([1.0, 0.25, 0.0, 1.0]);
        json["materials"][1]["pbrMetallicRoughness"]["baseColorFactor"] = factor;
        json.to_string()
    });
    let (model, warnings) = read(&bytes).unwrap();
    assert_eq!(warnings, [""; 0]);
    for (position, color) in model.mesh.positions.iter().zip(&model.colors) {
        // A quarter of the light is the code 137 of 255.
        let code = |x: f64| if x == 0.25 { 137 } else { 255 * x as u8 };
        assert_eq!(color[..3], position.to_array().map(code));
    }
    let [r, g, b] = model.materials[1].base_color;
    assert!(r == 1.0 && (g - 0.5371).abs() < 1e-4 && b == 0.0, "{g}");

    // All codes come back as they were.
    let mut all = small();
    for first in 0..64 {
        for (corner, color) in all.colors.iter_mut().enumerate() {
            *color = [(4 * first + corner) as u8, 0, 255, 255];
        }
        let (back, _) = read(&mesh::model_to_glb(&all).unwrap()).unwrap();
        let codes = |model: &Model| -> Vec<[u8; 4]> {
            let corners = model.mesh.triangles.as_flattened().iter();
            corners.map(|i| model.colors[*i as usize]).collect()
        };
        assert_eq!(codes(&back), codes(&all));
    }
}

/// The small model, stretched and moved.
fn small_at(size: DVec3, place: DVec3) -> Model {
    let mut model = small();
    for position in &mut model.mesh.positions {
        *position = *position * size + place;
    }
    model
}

#[test]
fn a_model_far_from_the_origin_keeps_its_digits() {
    // In UTM metres f32 tells heights apart by 0.03, and northings by half a metre.
    let place = DVec3::new(500_000.1, 5_400_000.3, 300.7);
    let model = small_at(DVec3::new(1.5, 1.1, 1.0), place);
    let bytes = mesh::model_to_glb(&model).unwrap();
    let (back, warnings) = read(&bytes).unwrap();
    assert_eq!(warnings, [""; 0]);
    assert_eq!((&back.nodes, &back.parts), (&model.nodes, &model.parts));
    let corners = |model: &Model| -> Vec<DVec3> {
        let corners = model.mesh.triangles.as_flattened().iter();
        corners.map(|i| model.mesh.positions[*i as usize]).collect()
    };
    for (a, b) in corners(&back).iter().zip(corners(&model)) {
        assert!((*a - b).length() < 1e-7, "{a} for {b}");
    }
    // It stands on the node that has no parent, and does so if it is written again.
    let text = String::from_utf8_lossy(&bytes);
    assert_eq!(text.matches("\"translation\"").count(), 1);
    let again = mesh::model_to_glb(&back).unwrap();
    assert_eq!(corners(&read(&again).unwrap().0), corners(&back));
}

#[test]
fn a_model_stays_in_the_worlds_frame_where_f32_holds_it() {
    for (size, place) in [
        // Sixteenths of a metre, however far away.
        (1.25, DVec3::new(4096.0625, -70_000.5, 12.0)),
        // What is around the origin is rounded there.
        (1.3, DVec3::new(-0.7, 0.1, 0.3)),
    ] {
        let model = small_at(DVec3::splat(size), place);
        let bytes = mesh::model_to_glb(&model).unwrap();
        let text = String::from_utf8_lossy(&bytes);
        assert!(!text.contains("\"translation\""));
        let (back, _) = read(&bytes).unwrap();
        let rounded = |p: &DVec3| p.as_vec3().as_dvec3();
        let position = |model: &Model, i: usize| {
            let corners = model.mesh.triangles.as_flattened();
            model.mesh.positions[corners[i] as usize]
        };
        for i in 0..6 {
            assert_eq!(position(&back, i), rounded(&position(&model, i)));
        }
    }
}

/// The file with its JSON changed.
pub(crate) fn changed(bytes: &[u8], change: impl Fn(String) -> String) -> Vec<u8> {
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let text = String::from_utf8(bytes[20..20 + length].to_vec()).unwrap();
    let mut text = change(text.trim_end().to_owned()).into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let rest = &bytes[20 + length..];
    let total = (20 + text.len() + rest.len()) as u32;
    let mut out = [
        b"glTF".as_slice(),
        &2_u32.to_le_bytes(),
        &total.to_le_bytes(),
    ]
    .concat();
    out.extend((text.len() as u32).to_le_bytes());
    out.extend(b"JSON");
    out.extend(text);
    out.extend(rest);
    out
}

/// How the file names its picture's bytes.
pub(crate) fn small_view(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(bytes);
    let images = &text[text.find("\"images\"").unwrap()..];
    let from = images.find("\"bufferView\"").unwrap();
    let length = images[from..].find([',', '}']).unwrap();
    images[from..from + length].to_owned()
}

#[test]
fn what_is_corrupt_is_named() {
    let bytes = mesh::model_to_glb(&small()).unwrap();
    let at = bytes.windows(4).position(|w| w == b"IDAT").unwrap();
    let mut corrupt = bytes.clone();
    corrupt[at + 6] ^= 0xff;
    // A picture alone, as one that is missing, is no reason to do without the rest.
    let (plain, warnings) = read(&corrupt).unwrap();
    assert_eq!((plain.textures.len(), warnings.len()), (1, 1));
    assert!(
        warnings[0].starts_with("image 0 cannot be decoded ("),
        "{warnings:?}"
    );
    assert!(
        warnings[0].ends_with("): a plain colour instead"),
        "{warnings:?}"
    );
    let error = read(&bytes[..bytes.len() / 2]).unwrap_err();
    assert!(
        error.starts_with("m.glb: not a glTF file: it is cut off"),
        "{error}"
    );
    let error = read(&changed(&bytes, |t| {
        t.replace("\"TEXCOORD_0\":1", "\"TEXCOORD_0\":99")
    }));
    assert!(
        error
            .unwrap_err()
            .contains("accessor 99: there is no such accessor")
    );
    let error = read(&changed(&bytes, |t| {
        t.replace("\"materials\":[", "\"materials\":[5,")
    }));
    assert!(error.unwrap_err().contains("its materials"));
    let empty = br#"{"asset": {"version": "2.0"}}"#;
    let error = mesh::parse_model(Path::new("e.gltf"), empty).unwrap_err();
    assert!(
        error
            .to_string()
            .starts_with("e.gltf: its default scene has no triangle")
    );
    let error = mesh::read_model(Path::new("e.ply"))
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("textured models are read from .glb and .gltf"),
        "{error}"
    );
}

#[test]
fn files_beside_a_model_are_known_by_what_it_names() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let listed = |name: &str, bytes: &[u8]| {
        std::fs::write(at(name), bytes).unwrap();
        mesh::files_beside(&at(name)).unwrap()
    };
    let bytes = mesh::model_to_glb(&small()).unwrap();
    assert!(listed("m.glb", &bytes).is_empty());
    let view = small_view(&bytes);
    let with_uri = |uri: &str| changed(&bytes, |t| t.replace(&view, &format!("\"uri\":\"{uri}\"")));
    // Those that are read, there or not.
    assert_eq!(listed("m.glb", &with_uri("a%20b.png")), [at("a b.png")]);
    let (_, warnings) = mesh::read_model(&at("m.glb")).unwrap();
    assert!(warnings[0].contains("a b.png: "), "{warnings:?}");
    let white = RgbaImage::from_pixel(1, 1, Rgba([255; 4]));
    white.save(at("a b.png")).unwrap();
    assert_eq!(mesh::read_model(&at("m.glb")).unwrap().1, [""; 0]);
    for elsewhere in [
        "../a.png",
        "https://example.org/a.png",
        "data:image/png;base64,AAAA",
    ] {
        assert!(
            listed("m.glb", &with_uri(elsewhere)).is_empty(),
            "{elsewhere}"
        );
    }
    let text = br#"{"buffers": [{"uri": "m.bin", "byteLength": 4}, {"byteLength": 4}],
        "images": [{"uri": "b.png"}, {"bufferView": 0}, {"uri": "in/a.png"}, {"uri": "b.png"}]}"#;
    let expected = ["b.png", "in/a.png", "m.bin"].map(at);
    assert_eq!(listed("m.gltf", text), expected);
    // Other meshes' files are whole; and what is no glTF file is said.
    assert!(listed("m.ply", text).is_empty());
    std::fs::write(at("m.gltf"), "ply").unwrap();
    let error = mesh::files_beside(&at("m.gltf")).unwrap_err().to_string();
    assert!(error.contains("m.gltf: not a glTF file: "), "{error}");
}

#[test]
fn the_captured_house_has_its_textures() {
    let Some(folder) = common::find_capture("interior-house") else {
        return;
    };
    let (model, warnings) = mesh::read_model(&folder.join("house.glb")).unwrap();
    assert_eq!(warnings, [""; 0]);
    assert_eq!((model.nodes.len(), model.parts.len()), (105, 105));
    assert_eq!(model.textures.len(), 44);
    assert_eq!(model.mesh.positions.len(), model.uvs.len());
    assert_eq!(
        model.parts.last().unwrap().triangles.end as usize,
        model.mesh.triangles.len()
    );
    for triangle in (0..model.mesh.triangles.len() as u32).step_by(97) {
        let color = model.color(triangle, [0.2, 0.3, 0.5], 0.0);
        assert!(color.iter().all(|c| (0.0..=255.0).contains(c)), "{color:?}");
    }
}
