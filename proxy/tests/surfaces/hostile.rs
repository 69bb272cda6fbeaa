//! Files of interiors and models with something wrong in them: an error that names the file, or
//! something that can be used, and no panic.

use glam::DVec3;
use image::{Rgba, RgbaImage};
use proptest::prelude::*;
use proxy::interior::{
    Contents, Interior, SemicircleOptions, interior_from_nodes, parse_interior, parse_rooms,
    semicircles,
};
use proxy::mesh::{
    Material, Mesh, Model, ModelNode, Part, Texture, Wrap, model_to_glb, parse_model,
};
use serde_json::Value;
use std::path::Path;
use std::sync::OnceLock;

const INTERIOR: &str = r#"{"version": 1, "model": "m.glb", "up": [0, 1, 0], "eye_height": 1.6,
    "cells": [{"name": "a", "box": {"min": [0, 0, 0], "max": [2, 2, 2]}},
        {"name": "b", "nodes": ["cell:b"], "floor": [[2, 0, 0], [2, 0, 2], [4, 0, 2]]},
        {"name": "c", "scene": "../c"}],
    "portals": [{"name": "p", "cells": ["a", "b"], "radius": 1.5,
            "polygon": [[2, 0, 1], [2, 0, 0], [2, 1, 0], [2, 0.5, 0.5]]},
        {"name": "w", "cells": ["c", null], "polygon": [[5, 0, 1], [5, 0, 0], [5, 1, 0]]}]}"#;
const ROOMS: &str = r#"{"version": 1, "up": [0, 2, 0], "eye_height": 1.5, "rooms": [
        {"name": "a", "min": [0, 0, 0], "max": [2, 2, 2]},
        {"name": "b", "min": [2, 0, 0], "max": [4, 2, 2],
            "floor": [[2, 0, 0], [2, 0, 2], [4, 0, 2]]}],
    "openings": [{"name": "p", "between": ["a", "b"], "radius": 2,
        "polygon": [[2, 0, 1], [2, 0, 0], [2, 1, 0], [2, 0.5, 0.5]]}]}"#;

/// What a value may become. Numbers that JSON cannot say are what a careless program would write.
const WORSE: [&str; 18] = [
    "0",
    "-1",
    "1e308",
    "-1e308",
    "1e-320",
    "1e400",
    "NaN",
    "4294967296",
    "18446744073709551615",
    "0.1",
    "null",
    "true",
    "\"\"",
    "\"a\"",
    "[]",
    "{}",
    "[[]]",
    "[1e308, -1e308, 1e308]",
];

/// The same text with the `which`th of its values replaced, or left out.
fn with_a_worse_value(text: &str, which: usize, worse: usize) -> String {
    const MARK: &str = "\u{1}";
    let mut value: Value = serde_json::from_str(text).unwrap();
    let mut left = which % count(&value);
    replace(&mut value, &mut left, MARK);
    let text = value.to_string();
    let mark = serde_json::to_string(MARK).unwrap();
    text.replacen(&mark, WORSE[worse % WORSE.len()], 1)
}

fn children(value: &mut Value) -> Vec<&mut Value> {
    match value {
        Value::Array(items) => items.iter_mut().collect(),
        Value::Object(entries) => entries.values_mut().collect(),
        _ => Vec::new(),
    }
}

fn count(value: &Value) -> usize {
    1 + match value {
        Value::Array(items) => items.iter().map(count).sum(),
        Value::Object(entries) => entries.values().map(count).sum(),
        _ => 0,
    }
}

fn replace(value: &mut Value, left: &mut usize, mark: &str) -> bool {
    if *left == 0 {
        *value = Value::String(mark.to_owned());
        return true;
    }
    *left -= 1;
    children(value)
        .into_iter()
        .any(|child| replace(child, left, mark))
}

/// Bytes changed, and the end cut off.
fn spoiled(bytes: &[u8], changes: &[(usize, u8)], cut: usize) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for (at, byte) in changes {
        let at = at % bytes.len();
        bytes[at] = *byte;
    }
    if cut < bytes.len() {
        bytes.truncate(bytes.len() - cut);
    }
    bytes
}

fn check_interior(bytes: &[u8]) {
    let path = Path::new("folder/house.json");
    let read = [
        parse_interior(path, bytes),
        parse_rooms(path, bytes, "m.glb"),
    ];
    for read in read {
        match read {
            Ok((interior, _)) => use_interior(&interior),
            Err(error) => {
                let text = error.to_string();
                assert!(text.starts_with("folder/house.json: "), "{text}");
            }
        }
    }
}

fn use_interior(interior: &Interior) {
    assert!(interior.check().is_ok() && !interior.cells.is_empty());
    for portal in &interior.portals {
        assert!((portal.polygon.normal().length() - 1.0).abs() < 1e-9);
        assert!(!portal.polygon.convex_pieces().is_empty());
    }
    let options = SemicircleOptions {
        views: 3,
        ..SemicircleOptions::default()
    };
    let contents = Contents::new(interior, model());
    if let Ok((contents, _)) = &contents {
        contents.locate(interior, DVec3::new(1.0, 1.0, 1.0));
    }
    // Overflowing sums make places of no use, and no panic.
    let (contents, _) = contents.unwrap_or_default();
    semicircles(interior, &contents, &options);
}

fn model() -> &'static Model {
    static MODEL: OnceLock<Model> = OnceLock::new();
    MODEL.get_or_init(|| {
        let texture = RgbaImage::from_fn(4, 2, |x, y| Rgba([60 * x as u8, 100 * y as u8, 7, 255]));
        let node = |name: &str, parent_idx| ModelNode {
            name: name.to_owned(),
            parent_idx,
        };
        let part = |triangles, node_idx| Part {
            triangles,
            node_idx,
            material_idx: 0,
        };
        Model {
            mesh: Mesh {
                positions: vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z],
                triangles: vec![[0, 1, 2], [0, 2, 3], [1, 2, 3]],
            },
            uvs: vec![[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]],
            colors: vec![[255; 4], [0, 1, 2, 255], [9; 4], [254, 255, 0, 255]],
            parts: vec![part(0..1, 0), part(1..2, 1), part(2..3, 2)],
            nodes: vec![
                node("cell:a", None),
                node("cell:b", None),
                node("portal:a|b", None),
            ],
            materials: vec![Material {
                texture_idx: Some(0),
                wrap: [Wrap::Clamp, Wrap::Mirror],
                ..Material::default()
            }],
            textures: vec![Texture::new(texture)],
        }
    })
}

fn glb() -> &'static [u8] {
    static GLB: OnceLock<Vec<u8>> = OnceLock::new();
    GLB.get_or_init(|| model_to_glb(model()).unwrap())
}

/// A GLB with another JSON chunk.
fn with_json(glb: &[u8], change: impl FnOnce(&str) -> String) -> Vec<u8> {
    let word = |at: usize| u32::from_le_bytes(glb[at..at + 4].try_into().unwrap()) as usize;
    let end = 20 + word(12);
    let mut json = change(std::str::from_utf8(&glb[20..end]).unwrap());
    while !json.len().is_multiple_of(4) {
        json.push(' ');
    }
    let length = 20 + json.len() + glb.len() - end;
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend((length as u32).to_le_bytes());
    bytes.extend((json.len() as u32).to_le_bytes());
    bytes.extend(b"JSON");
    bytes.extend(json.as_bytes());
    bytes.extend(&glb[end..]);
    bytes
}

fn check_model(bytes: &[u8]) {
    let path = Path::new("absent/house.glb");
    match parse_model(path, bytes) {
        Ok((model, warnings)) => {
            assert!(!model.mesh.triangles.is_empty());
            let corners = model.mesh.positions.len();
            assert_eq!([model.uvs.len(), model.colors.len()], [corners; 2]);
            assert!(model.mesh.positions.iter().all(|p| p.is_finite()));
            assert!(model.uvs.iter().flatten().all(|x| x.is_finite()));
            let indices = model.mesh.triangles.as_flattened();
            assert!(indices.iter().all(|i| (*i as usize) < corners));
            for i in 0..model.mesh.triangles.len() as u32 {
                for footprint in [0.0, 0.3, f64::INFINITY] {
                    let color = model.color(i, [0.2, 0.3, 0.5], footprint);
                    assert!(color.iter().all(|c| (0.0..=255.0).contains(c)), "{color:?}");
                }
            }
            assert!(warnings.iter().all(|w| !w.is_empty()));
            // Names of nodes say what they like.
            if let Ok((interior, _)) = interior_from_nodes(&model, "house.glb", 1.0) {
                assert!(Contents::new(&interior, &model).is_ok());
            }
        }
        Err(error) => {
            let text = error.to_string();
            assert!(text.starts_with("absent/"), "{text}");
        }
    }
}

#[test]
fn every_value_of_an_interior_may_be_anything() {
    check_interior(INTERIOR.as_bytes());
    assert!(parse_interior(Path::new("i"), INTERIOR.as_bytes()).is_ok());
    assert!(parse_rooms(Path::new("r"), ROOMS.as_bytes(), "m.glb").is_ok());
    for text in [INTERIOR, ROOMS] {
        for which in 0..count(&serde_json::from_str(text).unwrap()) {
            for worse in 0..WORSE.len() {
                check_interior(with_a_worse_value(text, which, worse).as_bytes());
            }
        }
        for end in 0..text.len() {
            check_interior(&text.as_bytes()[..end]);
        }
    }
}

#[test]
fn every_value_of_a_model_may_be_anything() {
    assert!(parse_model(Path::new("m.glb"), glb()).is_ok());
    let mut values = 0;
    with_json(glb(), |json| {
        values = count(&serde_json::from_str(json).unwrap());
        json.to_owned()
    });
    for which in 0..values {
        for worse in 0..WORSE.len() {
            check_model(&with_json(glb(), |json| {
                with_a_worse_value(json, which, worse)
            }));
        }
    }
    for end in 0..glb().len() {
        check_model(&glb()[..end]);
    }
}

/// CRC-32 as PNG has it.
fn crc(bytes: &[u8]) -> u32 {
    let step = |crc: u32, _| (crc >> 1) ^ (0xedb8_8320 & (crc & 1).wrapping_neg());
    let byte = |crc: u32, byte: &u8| (0..8).fold(crc ^ u32::from(*byte), step);
    !bytes.iter().fold(!0, byte)
}

#[test]
fn pictures_are_bounded_together() {
    // A picture of few bytes that says it is large, once and again.
    let json = |images: usize| {
        with_json(glb(), |json| {
            let mut value: Value = serde_json::from_str(json).unwrap();
            let image = value["images"][0].clone();
            let (material, primitive) = (
                value["materials"][0].clone(),
                value["meshes"][0]["primitives"][0].clone(),
            );
            for (key, entry) in [("images", image), ("textures", Value::Null)] {
                value[key] = (0..images)
                    .map(|i| match entry {
                        Value::Null => serde_json::json!({"source": i}),
                        _ => entry.clone(),
                    })
                    .collect();
            }
            let mut materials = Vec::new();
            let mut primitives = Vec::new();
            for i in 0..images {
                let mut material = material.clone();
                material["pbrMetallicRoughness"]["baseColorTexture"]["index"] = i.into();
                materials.push(material);
                let mut primitive = primitive.clone();
                primitive["material"] = i.into();
                primitives.push(primitive);
            }
            value["materials"] = materials.into();
            value["meshes"][0]["primitives"] = primitives.into();
            value.to_string()
        })
    };
    let enlarge = |mut bytes: Vec<u8>| {
        let header = bytes.windows(4).position(|w| w == b"IHDR").unwrap();
        bytes[header + 4..header + 12].copy_from_slice(&[0, 0, 0x40, 0, 0, 0, 0x3f, 0]);
        let sum = crc(&bytes[header..header + 17]);
        bytes[header + 17..header + 21].copy_from_slice(&sum.to_be_bytes());
        bytes
    };
    check_model(&json(3));
    assert!(parse_model(Path::new("m.glb"), &json(3)).is_ok());
    let error = parse_model(Path::new("m.glb"), &enlarge(json(8))).unwrap_err();
    let text = error.to_string();
    assert!(
        text.starts_with("m.glb, image ") && text.contains("make the model's pictures smaller"),
        "{text}"
    );
}

proptest! {
    #[test]
    fn spoiled_interiors_are_no_trouble(
        changes in prop::collection::vec((any::<usize>(), any::<u8>()), 0..6),
        values in prop::collection::vec((any::<usize>(), any::<usize>()), 0..3),
        cut in 0_usize..2000,
    ) {
        for text in [INTERIOR, ROOMS] {
            let mut text = text.to_owned();
            for (which, worse) in &values {
                // Not where it is no JSON any more.
                if serde_json::from_str::<Value>(&text).is_ok() {
                    text = with_a_worse_value(&text, *which, *worse);
                }
            }
            check_interior(text.as_bytes());
            check_interior(&spoiled(text.as_bytes(), &changes, if cut < 1000 { cut } else { 0 }));
        }
    }

    #[test]
    fn spoiled_models_are_no_trouble(
        changes in prop::collection::vec((any::<usize>(), any::<u8>()), 0..6),
        cut in 0_usize..2000,
    ) {
        check_model(&spoiled(glb(), &changes, if cut < 1000 { cut } else { 0 }));
    }
}
