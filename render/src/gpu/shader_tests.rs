//! The shaders, and the Rust side of every struct and number that they share.

use super::layout::{self, Corner, ENTRY_ROW, Entry, Params, SOURCE_ROW, Source, Triangle};
use super::pipelines::SHADERS;
use crate::blend::SAME_RAY;
use crate::field::MAX_LISTED;
use crate::options::MAX_CONTRIBUTORS;
use naga::proc::Layouter;
use naga::valid::{Capabilities, ValidationFlags, Validator};
use naga::{Expression, Literal, Module, TypeInner};
use std::collections::BTreeMap;
use std::mem::offset_of;

fn parse((name, parts): (&str, &[&str])) -> Module {
    let source = parts.concat();
    naga::front::wgsl::parse_str(&source)
        .unwrap_or_else(|error| panic!("{name}: {}", error.emit_to_string(&source)))
}

/// Whether it begins with common.wgsl.
fn has_common((_, parts): &(&str, &[&str])) -> bool {
    parts.len() > 1
}

fn shader(name: &str) -> Module {
    let found = SHADERS.into_iter().find(|shader| shader.0 == name);
    parse(found.expect("SHADERS has it"))
}

/// A module's `const`s that are numbers.
fn constants(module: &Module) -> BTreeMap<String, f64> {
    let value = |constant: &naga::Constant| match module.global_expressions[constant.init] {
        Expression::Literal(Literal::U32(v)) => Some(f64::from(v)),
        Expression::Literal(Literal::F32(v)) => Some(f64::from(v)),
        _ => None,
    };
    let named = module.constants.iter();
    named
        .filter_map(|(_, constant)| Some((constant.name.clone()?, value(constant)?)))
        .collect()
}

/// A struct's members with their offsets, and its size.
fn members(module: &Module, name: &str) -> (Vec<(String, usize)>, usize) {
    let is_it = |ty: &naga::Type| ty.name.as_deref() == Some(name);
    let (handle, ty) = module.types.iter().find(|(_, ty)| is_it(ty)).unwrap();
    let TypeInner::Struct { members, .. } = &ty.inner else {
        panic!("{name} is no struct");
    };
    let mut layouter = Layouter::default();
    layouter.update(module.to_ctx()).unwrap();
    let named = members.iter();
    (
        named
            .map(|m| (m.name.clone().unwrap(), m.offset as usize))
            .collect(),
        layouter[handle].size as usize,
    )
}

#[test]
fn every_shader_is_valid() {
    for shader in SHADERS {
        let module = parse(shader);
        let mut validator = Validator::new(ValidationFlags::all(), Capabilities::empty());
        if let Err(error) = validator.validate(&module) {
            panic!("{}: {}", shader.0, error.emit_to_string(&shader.1.concat()));
        }
    }
}

#[test]
fn every_entry_point_that_pipelines_name_exists() {
    for (name, expected) in [
        ("seen", &["corner", "number"][..]),
        (
            "triangulated",
            &[
                "corner",
                "number",
                "plain",
                "plain_fragment",
                "bordered",
                "bordered_fragment",
            ],
        ),
        ("exact_draw", &["draw", "whole_image", "draw_fragment"]),
        ("exact_mark", &["mark"]),
    ] {
        let module = shader(name);
        let names: Vec<&str> = module
            .entry_points
            .iter()
            .map(|e| e.name.as_str())
            .collect();
        assert_eq!(names, expected, "{name}");
    }
}

#[test]
fn params_lie_where_the_shaders_read_them() {
    macro_rules! offsets {
        ($($field:ident)*) => {
            vec![$((stringify!($field).to_owned(), offset_of!(Params, $field)),)*]
        };
    }
    let expected = offsets!(
        plane beta ray_scale ray_offset image array_size part_origin part_size full_weight k finest
        plane_seen
        table_row_bits tiles_across
    );
    for shader in SHADERS.into_iter().filter(has_common) {
        let (found, size) = members(&parse(shader), "Params");
        assert_eq!(found, expected, "{}", shader.0);
        assert_eq!(size, size_of::<Params>(), "{}", shader.0);
    }
}

#[test]
fn a_source_is_the_texels_that_the_shaders_name() {
    const TEXEL: usize = size_of::<[f32; 4]>();
    for shader in SHADERS.into_iter().filter(has_common) {
        let constants = constants(&parse(shader));
        let texels = constants["SOURCE_TEXELS"] as usize;
        assert_eq!(size_of::<Source>(), texels * TEXEL);
        assert_eq!(
            SOURCE_ROW as usize,
            constants["SOURCES_PER_ROW"] as usize * texels
        );
        for (name, offset) in [
            ("X_AXIS", offset_of!(Source, axes)),
            ("Y_AXIS", offset_of!(Source, axes) + TEXEL),
            ("Z_AXIS", offset_of!(Source, axes) + 2 * TEXEL),
            ("CENTER", offset_of!(Source, center)),
            ("PINHOLE", offset_of!(Source, focal)),
            ("IMAGE", offset_of!(Source, image)),
            ("LENS", offset_of!(Source, lens)),
            ("LENS_REST", offset_of!(Source, lens_rest)),
            ("KIND", offset_of!(Source, kind)),
            ("EXPOSURE", offset_of!(Source, exposure)),
            ("PRISM", offset_of!(Source, prism)),
            ("SENSOR", offset_of!(Source, shear)),
            ("REST", offset_of!(Source, mask_layer)),
        ] {
            assert_eq!(constants[name] as usize * TEXEL, offset, "{name}");
        }
    }
    // What shares a texel, by component.
    let within = |field: usize, texel: usize| (field - texel) / size_of::<f32>();
    let exposure = offset_of!(Source, exposure);
    assert_eq!(within(offset_of!(Source, count), exposure), 3);
    let kind = offset_of!(Source, kind);
    assert_eq!(within(offset_of!(Source, layer), kind), 1);
    assert_eq!(within(offset_of!(Source, footprint_excess), kind), 2);
    assert_eq!(within(offset_of!(Source, edge), kind), 3);
    let rest = offset_of!(Source, mask_layer);
    assert_eq!(within(offset_of!(Source, time_penalty), rest), 1);
    let pinhole = offset_of!(Source, focal);
    assert_eq!(within(offset_of!(Source, principal), pinhole), 2);
    let sensor = offset_of!(Source, shear);
    assert_eq!(within(offset_of!(Source, horizon), sensor), 2);
}

#[test]
fn corners_and_entries_are_what_the_shaders_take() {
    let module = shader("triangulated");
    assert_eq!(constants(&module)["ENTRIES_PER_ROW"] as u32, ENTRY_ROW);
    assert_eq!(constants(&module)["TILE"] as usize, crate::tiles::TILE);
    // An entry is one texel: the source view in x, the corners' values in y, z and w.
    assert_eq!(size_of::<Entry>(), size_of::<[f32; 4]>());
    assert_eq!(offset_of!(Entry, source_idx), 0);
    assert_eq!(offset_of!(Entry, values), size_of::<f32>());
    // A triangle is two: its corners, then two integers.
    assert_eq!(size_of::<Triangle>(), 2 * size_of::<[u32; 4]>());
    assert_eq!(offset_of!(Triangle, corners), 0);
    assert_eq!(offset_of!(Triangle, first_entry), 24);
    assert_eq!(offset_of!(Triangle, count_and_bordered), 28);
    assert_eq!(ENTRY_ROW % 2, 0);
    assert_eq!(size_of::<Corner>(), 8);
}

#[test]
fn shared_numbers_are_the_same() {
    let triangulated = constants(&shader("triangulated"));
    assert_eq!(triangulated["LISTED"] as usize, MAX_LISTED);
    for name in ["exact_draw", "exact_mark"] {
        let exact = constants(&shader(name));
        assert_eq!(exact["LISTED"] as usize, MAX_CONTRIBUTORS + 1, "{name}");
    }
    for shader in SHADERS.into_iter().filter(has_common) {
        let constants = constants(&parse(shader));
        for (name, value) in [
            ("CONTRIBUTORS", MAX_CONTRIBUTORS as f64),
            ("SAME_RAY", f64::from(SAME_RAY as f32)),
            ("LEVEL_BIAS", crate::LEVEL_BIAS),
            ("SHOULDER", crate::frame::SHOULDER),
            ("TRANSPARENT", crate::frame::TRANSPARENT),
            ("LEAST_PX", f64::from(crate::lens_edge::LEAST_PX)),
            ("IGNORED", f64::from(crate::mask::IGNORED)),
            ("LENS_PINHOLE", f64::from(layout::LENS_PINHOLE)),
            ("LENS_RATIONAL", f64::from(layout::LENS_RATIONAL)),
            ("LENS_FISHEYE", f64::from(layout::LENS_FISHEYE)),
            ("LENS_BROWN", f64::from(layout::LENS_BROWN)),
            ("LENS_THIN_PRISM", f64::from(layout::LENS_THIN_PRISM)),
            ("LENS_BENT_PRISM", f64::from(layout::LENS_BENT_PRISM)),
            ("LENS_FOV", f64::from(layout::LENS_FOV)),
            ("LENS_DIVISION", f64::from(layout::LENS_DIVISION)),
            ("LENS_EUCM", f64::from(layout::LENS_EUCM)),
            (
                "LENS_EQUIRECTANGULAR",
                f64::from(layout::LENS_EQUIRECTANGULAR),
            ),
            (
                "LENS_INVERSE_RADIAL",
                f64::from(layout::LENS_INVERSE_RADIAL),
            ),
            ("LENS_TILTED", f64::from(layout::LENS_TILTED)),
            (
                "LENS_SKEWED_FISHEYE",
                f64::from(layout::LENS_SKEWED_FISHEYE),
            ),
        ] {
            // Only a typed constant is left in the module.
            let found = constants.get(name).copied().unwrap_or(f64::NAN);
            assert!(
                (found - value).abs() <= 1e-6 * value.abs(),
                "{}: {name} is {found}, not {value}",
                shader.0
            );
        }
    }
}
