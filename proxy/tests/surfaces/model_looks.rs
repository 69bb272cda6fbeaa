//! Looks of textured models: what colours a place, and what is told of what is not shown.

use crate::model_files::{changed, read, small, small_view};

use image::{Rgba, RgbaImage};
use proxy::mesh::{self, Texture};
use serde_json::{Value, json};

#[test]
fn colours_are_products_of_what_colours_a_place() {
    let model = small();
    // At the corner (1, 1): the texture's top right pixel, by the corner's colour.
    let color = model.color(0, [0.0, 0.0, 1.0], 0.0);
    let expected = [180.0 * 128.0 / 255.0, 0.0, 7.0 * 3.0 / 255.0];
    for (a, b) in color.iter().zip(expected) {
        assert!((a - b).abs() < 1e-9, "{color:?}");
    }
    let color = model.color(1, [1.0, 0.0, 0.0], 0.0);
    assert_eq!(color, [127.5, 63.75, 255.0]);
    // The twin that is made ready once for all places.
    for idx in 0..model.mesh.triangles.len() as u32 {
        let skin = mesh::Skin::new(&model, model.part_of(idx), idx);
        for i in 0..=20 {
            for j in 0..=20 - i {
                let [b, c] = [i, j].map(|n| f64::from(n) / 20.0);
                let footprint = [0.0, 0.1, 0.4, 1e9];
                let places = mesh::Neighbours {
                    second: [b; mesh::FEW],
                    third: [c; mesh::FEW],
                    footprint,
                };
                let mut found = [[0; 4]; mesh::FEW];
                let mut put = |number: u32, code| found[number as usize] = code;
                let mut coloring = mesh::Coloring::default();
                coloring.add(&skin, &places, 0, mesh::FEW, &mut put);
                coloring.finish(&mut put);
                for (found, footprint) in found.into_iter().zip(footprint) {
                    let expected = model.color(idx, [1.0 - b - c, b, c], footprint);
                    assert_eq!(found[3], 255);
                    for k in 0..3 {
                        assert!(
                            (f64::from(found[k]) - expected[k]).abs() < 0.5 + 1e-3,
                            "{idx} {b} {c} {footprint}"
                        );
                    }
                }
            }
        }
    }
}

#[test]
fn what_is_missing_is_a_plain_colour_and_told() {
    let bytes = mesh::model_to_glb(&small()).unwrap();
    let (plain, warnings) = read(&changed(&bytes, |t| {
        t.replace("\"source\":0", "\"source\":9")
    }))
    .unwrap();
    assert_eq!(
        warnings,
        ["texture 0 has no picture that can be read: a plain colour instead"]
    );
    assert_eq!(plain.materials[0].texture_idx, None);
    // A picture in a file that is not there.
    let view = small_view(&bytes);
    let elsewhere = changed(&bytes, |t| t.replace(&view, "\"uri\":\"gone.png\""));
    let (plain, warnings) = read(&elsewhere).unwrap();
    let said = "image 0: its bytes cannot be read from gone.png: ";
    assert!(warnings[0].starts_with(said), "{warnings:?}");
    let remedy = "; put that file there, or export the model again as .glb with all that it uses inside: a plain colour instead";
    assert!(warnings[0].ends_with(remedy), "{warnings:?}");
    assert_eq!(plain.materials[0].texture_idx, None);
    let (_, warnings) = read(&changed(&bytes, |t| {
        t.replace("\"material\":1", "\"material\":7")
    }))
    .unwrap();
    assert_eq!(warnings, ["there is no material 7: it is white"]);
}

#[test]
fn what_has_no_triangles_takes_nobodys_looks() {
    let model = small();
    let bytes = mesh::model_to_glb(&model).unwrap();
    // Corners without a triangle, before all others.
    let with_none = changed(&bytes, |text| {
        let mut json: serde_json::Value = serde_json::from_str(&text).unwrap();
        let mut none = json["meshes"][0]["primitives"][0].clone();
        let indices = none["indices"].as_u64().unwrap() as usize;
        let mut one = json["accessors"][indices].clone();
        one["count"] = 1.into();
        let accessors = json["accessors"].as_array_mut().unwrap();
        accessors.push(one);
        none["indices"] = (accessors.len() - 1).into();
        let primitives = json["meshes"][0]["primitives"].as_array_mut().unwrap();
        primitives.insert(0, none);
        json.to_string()
    });
    let (plain, _) = read(&bytes).unwrap();
    let (read, _) = read(&with_none).unwrap();
    assert!(read.mesh.positions.len() > plain.mesh.positions.len());
    assert_eq!(read.uvs.len(), read.mesh.positions.len());
    assert_eq!(read.colors.len(), read.mesh.positions.len());
    let shares = [0.2, 0.3, 0.5];
    for i in 0..plain.mesh.triangles.len() as u32 {
        assert_eq!(read.color(i, shares, 0.0), plain.color(i, shares, 0.0));
    }
}

/// The file with its materials changed.
fn with_materials(bytes: &[u8], change: impl Fn(&mut Value)) -> Vec<u8> {
    changed(bytes, |text| {
        let mut json: Value = serde_json::from_str(&text).unwrap();
        change(&mut json["materials"]);
        json.to_string()
    })
}

#[test]
fn specular_glossiness_is_read_as_base_colour() {
    let bytes = mesh::model_to_glb(&small()).unwrap();
    let (plain, _) = read(&bytes).unwrap();
    let name = "KHR_materials_pbrSpecularGlossiness";
    let both = with_materials(&bytes, |materials| {
        let texture = materials[0]["pbrMetallicRoughness"]["baseColorTexture"].take();
        materials[0]["pbrMetallicRoughness"] = json!({"baseColorFactor": [0, 0, 1, 1]});
        materials[0]["extensions"] = json!({name: {"diffuseTexture": texture}});
        materials[1]["extensions"] =
            json!({name: {"diffuseFactor": [1, 0, 0, 1], "glossinessFactor": 0.5}});
    });
    let required = changed(&both, |text| {
        let mut json: Value = serde_json::from_str(&text).unwrap();
        json["extensionsRequired"] = json!([name]);
        json.to_string()
    });
    for bytes in [both, required] {
        let (read, warnings) = read(&bytes).unwrap();
        assert_eq!(warnings, [""; 0]);
        assert_eq!(read.materials[0], plain.materials[0]);
        assert_eq!(read.textures, plain.textures);
        assert_eq!(read.materials[1].base_color, [1.0, 0.0, 0.0]);
    }
}

#[test]
fn what_shines_is_shown_where_it_was_black_and_told_elsewhere() {
    let bytes = mesh::model_to_glb(&small()).unwrap();
    let (plain, _) = read(&bytes).unwrap();
    // A screen, and a lamp that is brighter than white.
    let lamps = with_materials(&bytes, |materials| {
        let black = json!({"baseColorFactor": [0, 0, 0, 1]});
        let texture = materials[0]["pbrMetallicRoughness"]["baseColorTexture"].take();
        materials[0]["pbrMetallicRoughness"] = black.clone();
        materials[0]["emissiveTexture"] = texture;
        materials[0]["emissiveFactor"] = json!([1, 1, 1]);
        materials[1]["pbrMetallicRoughness"] = black;
        materials[1]["emissiveFactor"] = json!([0.5, 0.25, 0]);
        materials[1]["extensions"] =
            json!({"KHR_materials_emissive_strength": {"emissiveStrength": 8}});
    });
    let (model, warnings) = read(&lamps).unwrap();
    assert_eq!(warnings, [""; 0]);
    assert_eq!(model.materials[0], plain.materials[0]);
    assert_eq!(model.textures, plain.textures);
    let [r, g, b] = model.materials[1].base_color;
    assert!(r == 1.0 && (g - 0.7354).abs() < 1e-3 && b == 0.0, "{g}");
    // Corners' colours are none of it.
    assert!(model.colors.iter().all(|color| *color == [255; 4]));
    assert!(!plain.colors.iter().all(|color| *color == [255; 4]));
    // What has a colour keeps it.
    let shining = |more: Value| {
        let changed = with_materials(&bytes, |materials| {
            for material in materials.as_array_mut().unwrap() {
                material["emissiveFactor"] = json!([0, 0, 1]);
                material["extensions"] = more.clone();
            }
            materials[1]["name"] = "neon".into();
        });
        read(&changed).unwrap()
    };
    let (model, warnings) = shining(json!({}));
    assert_eq!(
        warnings,
        ["what shines by itself is drawn as if it did not (2 materials: number 0, `neon`)"]
    );
    assert_eq!(
        (&model.materials, &model.colors),
        (&plain.materials, &plain.colors)
    );
    let (_, warnings) = shining(json!({"KHR_materials_unlit": {}}));
    assert_eq!(warnings, [""; 0]);
}

#[test]
fn what_bones_would_pose_is_told_once() {
    let bytes = mesh::model_to_glb(&small()).unwrap();
    let (plain, _) = read(&bytes).unwrap();
    let skinned = |nodes: &[usize], name: &str| {
        let changed = changed(&bytes, |text| {
            let mut json: Value = serde_json::from_str(&text).unwrap();
            json["skins"] = json!([{"joints": [0]}]);
            for node in nodes {
                json["nodes"][*node]["skin"] = 0.into();
            }
            json["nodes"][1]["name"] = name.into();
            json.to_string()
        });
        read(&changed).unwrap()
    };
    let said = |of: &str| {
        format!(
            "what bones pose (a skin) is drawn as it was modelled, in its rest pose; apply the pose before \
             exporting ({of})"
        )
    };
    for (nodes, name, of) in [
        (vec![1], "man", "1 node: `man`"),
        (vec![1], "", "1 node: number 1"),
        (vec![0, 1], "man", "2 nodes: `cell:a`, `man`"),
    ] {
        let (model, warnings) = skinned(&nodes, name);
        assert_eq!(warnings, [said(of)]);
        assert_eq!(model.mesh, plain.mesh);
    }
    // A skin that no node has poses nothing.
    let (_, warnings) = skinned(&[], "man");
    assert_eq!(warnings, [""; 0]);
}

#[test]
fn what_the_file_hides_is_left_out_and_told() {
    let bytes = mesh::model_to_glb(&small()).unwrap();
    let (plain, _) = read(&bytes).unwrap();
    let hiding = |node: usize, visible: Value| {
        changed(&bytes, |text| {
            let mut json: Value = serde_json::from_str(&text).unwrap();
            json["extensionsRequired"] = json!(["KHR_node_visibility"]);
            json["nodes"][node]["extensions"] = json!({"KHR_node_visibility": visible});
            json.to_string()
        })
    };
    let (model, warnings) = read(&hiding(1, json!({"visible": false}))).unwrap();
    assert_eq!(
        warnings,
        [
            "what the file hides (KHR_node_visibility) is left out; unhide it before exporting to have it drawn \
          (1 node: `chair`)"
        ]
    );
    assert_eq!(model.mesh.triangles, plain.mesh.triangles[..1]);
    assert_eq!(
        (&model.nodes, &model.parts[..]),
        (&plain.nodes, &plain.parts[..1])
    );
    // Shown, as it is where nothing is said.
    for visible in [json!({"visible": true}), json!({})] {
        let (model, warnings) = read(&hiding(0, visible)).unwrap();
        assert_eq!((model.parts, warnings), (plain.parts.clone(), vec![]));
    }
    // With a node all below it.
    let all = hiding(0, json!({"visible": false}));
    let error = read(&all).unwrap_err();
    assert!(
        error.starts_with("m.glb: all nodes that have triangles (2) are hidden"),
        "{error}"
    );
    // Openings are not drawn: their outline counts.
    let opening = changed(&all, |t| t.replace("\"cell:a\"", "\"portal:a|\""));
    let (model, warnings) = read(&opening).unwrap();
    assert_eq!((model.parts, warnings), (plain.parts, vec![]));
}

#[test]
fn what_is_drawn_smoother_than_the_file_asks_for_is_told() {
    let bytes = mesh::model_to_glb(&small()).unwrap();
    let (plain, _) = read(&bytes).unwrap();
    let hard = changed(&bytes, |t| {
        t.replace("\"magFilter\":9729", "\"magFilter\":9728")
    });
    let (model, warnings) = read(&hard).unwrap();
    assert_eq!(model, plain);
    assert_eq!(
        warnings,
        [
            "1 texture: number 0: drawn smoothly, though the file asks for hard texels (NEAREST); enlarge the \
          picture for sharper ones"
        ]
    );
}

#[test]
fn what_alpha_makes_invisible_is_left_out_and_told() {
    let bytes = mesh::model_to_glb(&small()).unwrap();
    let (plain, _) = read(&bytes).unwrap();
    let with_alpha = |alpha: f64, mode: Value| {
        with_materials(&bytes, |materials| {
            let glass = &mut materials[1];
            glass["name"] = "glass".into();
            glass["pbrMetallicRoughness"]["baseColorFactor"][3] = alpha.into();
            for (key, value) in mode.as_object().unwrap() {
                glass[key] = value.clone();
            }
        })
    };
    for (alpha, mode) in [
        (0.0, json!({"alphaMode": "BLEND"})),
        (0.001, json!({"alphaMode": "BLEND"})),
        (0.4, json!({"alphaMode": "MASK"})),
        (0.8, json!({"alphaMode": "MASK", "alphaCutoff": 0.9})),
    ] {
        let (model, warnings) = read(&with_alpha(alpha, mode)).unwrap();
        assert_eq!(
            warnings,
            ["1 triangle is left out as invisible by alpha (1 material: `glass`)"]
        );
        assert_eq!(model.parts, plain.parts[..1]);
        assert_eq!(model.mesh.triangles, plain.mesh.triangles[..1]);
        assert_eq!(model.mesh.positions.len(), 3);
        assert_eq!((model.uvs.len(), model.colors.len()), (3, 3));
        assert_eq!(model.nodes, plain.nodes);
    }
    // What is opaque all the same.
    for mode in [
        json!({}),
        json!({"alphaMode": "OPAQUE"}),
        json!({"alphaMode": "MASK", "alphaCutoff": 0.0}),
    ] {
        let (model, warnings) = read(&with_alpha(0.0, mode)).unwrap();
        assert_eq!((model.parts, warnings), (plain.parts.clone(), vec![]));
    }
    // Openings are not drawn: their outline counts.
    let invisible = with_alpha(0.0, json!({"alphaMode": "BLEND"}));
    let opening = changed(&invisible, |t| t.replace("\"cell:a\"", "\"portal:a|\""));
    let (model, warnings) = read(&opening).unwrap();
    assert_eq!((model.parts, warnings), (plain.parts.clone(), vec![]));
    // Nothing is left.
    let nothing = changed(&invisible, |t| {
        t.replace("\"material\":0", "\"material\":1")
    });
    let error = read(&nothing).unwrap_err();
    assert!(
        error.starts_with("m.glb: all its triangles (2) are invisible"),
        "{error}"
    );
}

#[test]
fn what_is_not_opaque_is_told_once() {
    let warnings_of = |alpha: u8, materials: [Value; 2]| {
        let mut model = small();
        // Corners are written as opaque.
        let picture = RgbaImage::from_fn(2, 1, |x, _| {
            Rgba([9, 9, 9, if x == 0 { 255 } else { alpha }])
        });
        model.textures = vec![Texture::new(picture)];
        let bytes = mesh::model_to_glb(&model).unwrap();
        let changed = with_materials(&bytes, |all| {
            for (material, more) in all.as_array_mut().unwrap().iter_mut().zip(&materials) {
                for (key, value) in more.as_object().unwrap() {
                    material[key] = value.clone();
                }
            }
        });
        read(&changed).unwrap().1
    };
    let opaque = |of: &str| format!("what is transparent or cut out is drawn opaque ({of})");
    let (blend, mask) = (
        json!({"alphaMode": "BLEND"}),
        json!({"alphaMode": "MASK", "name": "leaf"}),
    );
    let half = json!({"alphaMode": "BLEND", "name": "glass",
        "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0.5]}});
    for (alpha, materials, expected) in [
        // They may be opaque whatever they are said to be.
        (255, [blend.clone(), blend.clone()], vec![]),
        (128, [mask.clone(), json!({})], vec![]),
        (0, [json!({}), json!({})], vec![]),
        // A texture, a factor, both.
        (
            254,
            [blend.clone(), json!({})],
            vec![opaque("1 material: number 0")],
        ),
        (
            127,
            [mask.clone(), json!({})],
            vec![opaque("1 material: `leaf`")],
        ),
        (
            255,
            [json!({}), half.clone()],
            vec![opaque("1 material: `glass`")],
        ),
        (
            0,
            [mask, half],
            vec![opaque("2 materials: `leaf`, `glass`")],
        ),
    ] {
        assert_eq!(warnings_of(alpha, materials), expected);
    }
    // Extensions: those that change no colour without light are no loss.
    let clear = json!({"name": "pane", "extensions": {
        "KHR_materials_ior": {"ior": 1.5}, "KHR_materials_transmission": {"transmissionFactor": 0.9}}});
    let unlit = json!({"extensions": {"KHR_materials_unlit": {}}});
    assert_eq!(
        warnings_of(255, [unlit, clear.clone()]),
        ["KHR_materials_transmission is not applied (1 material: `pane`)"]
    );
    assert_eq!(
        warnings_of(255, [clear.clone(), clear]),
        ["KHR_materials_transmission is not applied (2 materials: `pane`, `pane`)"]
    );
}

#[test]
fn textures_are_stretched_turned_and_moved() {
    let bytes = mesh::model_to_glb(&small()).unwrap();
    let of = |name: &str, extension: Value| {
        let changed = with_materials(&bytes, |materials| {
            let texture = &mut materials[0]["pbrMetallicRoughness"]["baseColorTexture"];
            texture["extensions"] = json!({name: extension});
        });
        read(&changed).unwrap()
    };
    let name = "KHR_texture_transform";
    let uvs = |model: &mesh::Model, triangle: usize| {
        let corners = model.mesh.triangles[triangle];
        corners.map(|corner| model.uvs[corner as usize])
    };
    let (plain, _) = read(&bytes).unwrap();
    let quarter = std::f64::consts::FRAC_PI_2;
    type Moved = fn([f32; 2]) -> [f32; 2];
    let cases: [(Value, Moved); 6] = [
        (json!({}), |uv| uv),
        (
            json!({"offset": [0, 0], "rotation": 0, "scale": [1, 1], "texCoord": 0}),
            |uv| uv,
        ),
        (json!({"offset": [0.25, -2]}), |[u, v]| [u + 0.25, v - 2.0]),
        (json!({"scale": [3, -1]}), |[u, v]| [3.0 * u, -v]),
        (json!({"rotation": quarter}), |[u, v]| [v, -u]),
        // The lower left quarter of the picture, as the extension's own example says.
        (
            json!({"offset": [0, 1], "rotation": quarter, "scale": [0.5, 0.5]}),
            |[u, v]| [0.5 * v, 1.0 - 0.5 * u],
        ),
    ];
    for (extension, moved) in cases {
        let (model, warnings) = of(name, extension.clone());
        assert_eq!(warnings, [""; 0]);
        let pairs = uvs(&model, 0).into_iter().zip(uvs(&plain, 0).map(moved));
        for (found, expected) in pairs {
            for (found, expected) in found.into_iter().zip(expected) {
                assert!((found - expected).abs() < 1e-6, "{extension}");
            }
        }
        assert_eq!(uvs(&model, 1), uvs(&plain, 1));
    }
    let (_, warnings) = of(name, json!({"texCoord": 1}));
    let said = " has a texture but no texture coordinates";
    assert!(
        warnings.len() == 1 && warnings[0].ends_with(said),
        "{warnings:?}"
    );
    // Nobody knows what another does.
    let said = "texture 0: EXT_other is not applied";
    assert_eq!(of("EXT_other", json!({})).1, [said]);
}

#[test]
fn pictures_of_other_kinds_are_told_once_a_kind() {
    let bytes = mesh::model_to_glb(&small()).unwrap();
    let warnings_of = |name: &str, source: &str| {
        let changed = changed(&bytes, |text| {
            let extensions = format!("\"extensions\":{{\"{name}\":{{\"source\":0}}}}{source}");
            let texture = text.replace("\"source\":0", &extensions);
            let mut json: Value = serde_json::from_str(&texture).unwrap();
            // A second one, that the other material has.
            let second = json["textures"][0].clone();
            json["textures"].as_array_mut().unwrap().push(second);
            let material = &mut json["materials"][1]["pbrMetallicRoughness"];
            material["baseColorTexture"] = json!({"index": 1});
            json.to_string()
        });
        read(&changed).unwrap().1
    };
    for (name, kind) in [
        ("EXT_texture_webp", "WebP"),
        ("KHR_texture_basisu", "KTX2"),
        ("EXT_other", "another kind"),
    ] {
        let said = format!(
            "2 textures: number 0, number 1: a plain colour instead of a picture that is {kind} alone ({name}), \
             which is not read; export the model again with PNG or JPEG textures"
        );
        assert_eq!(warnings_of(name, ""), [said]);
        // With another picture for those that do not know it.
        let known = warnings_of(name, ",\"source\":0");
        assert!(known.iter().all(|said| !said.contains(name)), "{known:?}");
    }
}

#[test]
fn extensions_that_are_not_known_may_hold_anything() {
    let bytes = mesh::model_to_glb(&small()).unwrap();
    let anything = [
        json!(true),
        json!(null),
        json!([1]),
        json!({"offset": 1, "rotation": [0, 0, 0, 1], "scale": 2.0, "texCoord": "second"}),
        json!({"diffuseFactor": 1, "diffuseTexture": "a.png", "emissiveStrength": [1]}),
    ];
    for extension in anything {
        let warnings_of = |change: fn(&mut Value, Value)| {
            let changed = with_materials(&bytes, |materials| {
                change(&mut materials[0], extension.clone());
            });
            read(&changed).unwrap().1
        };
        let of_texture = warnings_of(|material, extension| {
            let texture = &mut material["pbrMetallicRoughness"]["baseColorTexture"];
            texture["extensions"] = json!({"EXT_other": extension});
        });
        assert_eq!(of_texture, ["texture 0: EXT_other is not applied"]);
        let of_material = warnings_of(|material, extension| {
            material["extensions"] = json!({"EXT_other": extension});
        });
        assert_eq!(of_material.len(), 1, "{of_material:?}");
        assert!(of_material[0].starts_with("EXT_other is not applied (1 material: "));
        // Told, too, where it is not what was expected; one without anything of a transform moves nothing.
        let of_transform = warnings_of(|material, extension| {
            let texture = &mut material["pbrMetallicRoughness"]["baseColorTexture"];
            texture["extensions"] = json!({"KHR_texture_transform": extension});
        });
        let said = "texture 0: KHR_texture_transform is not applied";
        let moves_nothing = extension.get("diffuseFactor").is_some();
        assert_eq!(of_transform.iter().any(|w| w == said), !moves_nothing);
    }
}
