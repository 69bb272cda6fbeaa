//! What a glTF file says of its materials, and what of that is not shown.

use crate::mesh::model::srgb_from_linear;
use crate::mesh::obj::shown;
use glam::{DAffine2, DVec2};
use serde::Deserialize;
use serde::de::IgnoredAny;
use serde_json::Value;
use std::collections::BTreeMap;

/// A material of the file.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct MaterialEntry {
    #[serde(default)]
    name: String,
    #[serde(default)]
    pbr_metallic_roughness: Roughness,
    #[serde(default)]
    alpha_mode: AlphaMode,
    alpha_cutoff: Option<f64>,
    #[serde(default)]
    emissive_factor: [f64; 3],
    emissive_texture: Option<TextureUse>,
    #[serde(default)]
    extensions: Extensions,
}

#[derive(Default, Deserialize)]
#[serde(rename_all = "camelCase")]
struct Roughness {
    base_color_factor: Option<[f64; 4]>,
    base_color_texture: Option<TextureUse>,
}

#[derive(Default, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
enum AlphaMode {
    Mask,
    Blend,
    #[default]
    #[serde(other)]
    Opaque,
}

/// The extensions of a material.
#[derive(Default, Deserialize)]
struct Extensions {
    /// Its diffuse colour stands in place of the base colour.
    #[serde(rename = "KHR_materials_pbrSpecularGlossiness")]
    glossiness: Option<Glossiness>,
    /// Multiplies what shines.
    #[serde(rename = "KHR_materials_emissive_strength")]
    strength: Option<Strength>,
    /// All others, by name, whatever they hold.
    #[serde(flatten)]
    other: BTreeMap<String, IgnoredAny>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Glossiness {
    diffuse_factor: Option<[f64; 4]>,
    diffuse_texture: Option<TextureUse>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Strength {
    emissive_strength: Option<f64>,
}

/// A texture that a material uses.
#[derive(Clone, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct TextureUse {
    pub(super) index: usize,
    #[serde(default)]
    tex_coord: u32,
    /// By name, whatever they hold.
    #[serde(default)]
    extensions: BTreeMap<String, Value>,
}

/// What [`TRANSFORM`] holds.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Transform {
    offset: Option<[f64; 2]>,
    rotation: Option<f64>,
    scale: Option<[f64; 2]>,
    tex_coord: Option<u32>,
}

/// The extension that moves, turns and stretches a texture.
const TRANSFORM: &str = "KHR_texture_transform";

impl TextureUse {
    /// What [`TRANSFORM`] says, if it is there and can be read.
    fn transform(&self) -> Option<Transform> {
        Transform::deserialize(self.extensions.get(TRANSFORM)?).ok()
    }

    /// Which of a primitive's texture coordinates it has.
    pub(super) fn coordinates(&self) -> u32 {
        let other = self.transform().and_then(|transform| transform.tex_coord);
        other.unwrap_or(self.tex_coord)
    }

    /// Places in the picture from these coordinates.
    pub(super) fn picture_from_coordinates(&self) -> DAffine2 {
        let transform = self.transform();
        transform.map_or(DAffine2::IDENTITY, |transform| transform.affine())
    }

    /// The extensions that are not applied.
    pub(super) fn not_applied(&self) -> impl Iterator<Item = &str> {
        let is_read = self.transform().is_some();
        let names = self.extensions.keys().map(String::as_str);
        names.filter(move |name| *name != TRANSFORM || !is_read)
    }
}

impl Transform {
    /// Stretches, then turns, then moves. As v counts downwards, a turn that is counter-clockwise where it is drawn
    /// is the inverse of the matrix that the extension's text has, and what its example and viewers show.
    fn affine(&self) -> DAffine2 {
        let [sx, sy] = self.scale.unwrap_or([1.0; 2]);
        let (sin, cos) = self.rotation.unwrap_or(0.0).sin_cos();
        let offset = DVec2::from(self.offset.unwrap_or_default());
        DAffine2::from_cols(
            sx * DVec2::new(cos, -sin),
            sy * DVec2::new(sin, cos),
            offset,
        )
    }
}

/// The extension of what has its base colour in any light, and shines with nothing else.
const UNLIT: &str = "KHR_materials_unlit";

/// Other extensions that leave colour and opacity without light as they are.
const NO_LOSS: [&str; 10] = [
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_dispersion",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    UNLIT,
    // What another lets through.
    "KHR_materials_volume",
    "KHR_xmp_json_ld",
];

/// What no picture of eight bits shows.
const LEAST_ALPHA: f64 = 0.5 / 255.0;

impl MaterialEntry {
    fn glossiness(&self) -> Option<&Glossiness> {
        self.extensions.glossiness.as_ref()
    }

    fn base_factor(&self) -> Option<[f64; 4]> {
        match self.glossiness() {
            Some(glossiness) => glossiness.diffuse_factor,
            None => self.pbr_metallic_roughness.base_color_factor,
        }
    }

    /// What it shines with by itself, linear; no part is more than 1, but the hue is the file's.
    fn emission(&self) -> [f64; 3] {
        let strength = self.extensions.strength.as_ref();
        let strength = strength.and_then(|s| s.emissive_strength).unwrap_or(1.0);
        let light = self
            .emissive_factor
            .map(|x| (strength * x).clamp(0.0, f64::MAX));
        let brightest = light.into_iter().fold(1.0, f64::max);
        light.map(|x| x / brightest)
    }

    fn shines(&self) -> bool {
        !is_black(self.emission()) && !self.extensions.other.contains_key(UNLIT)
    }

    /// Whether what it shines with stands in place of its base colour, which is black.
    pub(super) fn shows_emission(&self) -> bool {
        let base = self.base_factor();
        self.shines() && base.is_some_and(|[r, g, b, _]| is_black([r, g, b]))
    }

    /// Colour and alpha, linear, where they are not 1.
    pub(super) fn factor(&self) -> Option<[f64; 4]> {
        match self.shows_emission() {
            true => {
                let [r, g, b] = self.emission();
                Some([r, g, b, self.alpha()])
            }
            false => self.base_factor(),
        }
    }

    /// The texture of the colour.
    pub(super) fn texture(&self) -> Option<&TextureUse> {
        match self.glossiness() {
            _ if self.shows_emission() => self.emissive_texture.as_ref(),
            Some(glossiness) => glossiness.diffuse_texture.as_ref(),
            None => self.pbr_metallic_roughness.base_color_texture.as_ref(),
        }
    }

    /// Its own, which textures and corners multiply.
    fn alpha(&self) -> f64 {
        self.base_factor().map_or(1.0, |[.., alpha]| alpha)
    }

    fn cutoff(&self) -> f64 {
        self.alpha_cutoff.unwrap_or(0.5)
    }

    /// Whether nothing with it can be seen, whatever its texture and corners have.
    pub(super) fn is_invisible(&self) -> bool {
        match self.alpha_mode {
            AlphaMode::Opaque => false,
            AlphaMode::Mask => self.alpha() < self.cutoff(),
            AlphaMode::Blend => self.alpha() <= LEAST_ALPHA,
        }
    }

    /// Whether something is to be seen through it somewhere; `least_alpha` is the least that its
    /// texture and corners have, multiplied.
    fn is_seen_through(&self, least_alpha: f64) -> bool {
        let alpha = self.alpha() * least_alpha;
        match self.alpha_mode {
            AlphaMode::Opaque => false,
            AlphaMode::Mask => alpha < self.cutoff(),
            AlphaMode::Blend => alpha < 1.0 - LEAST_ALPHA,
        }
    }
}

/// Whether no picture of eight bits shows any of it.
fn is_black(linear: [f64; 3]) -> bool {
    linear.iter().all(|x| srgb_from_linear(*x) < LEAST_ALPHA)
}

/// What is not shown of a file's materials as it says, each kind once. `hidden` are triangles left
/// out, by material; `drawn` is the least alpha of what is drawn, that of textures and corners,
/// by material.
pub(super) fn not_shown(
    materials: &[MaterialEntry],
    hidden: &BTreeMap<usize, usize>,
    drawn: &BTreeMap<usize, f64>,
) -> Vec<String> {
    let mut warnings = Vec::new();
    // 1. What is not there.
    if !hidden.is_empty() {
        let count: usize = hidden.values().sum();
        let triangles = match count {
            1 => "1 triangle is".to_owned(),
            _ => format!("{count} triangles are"),
        };
        let numbers: Vec<usize> = hidden.keys().copied().collect();
        let of = listed(materials, &numbers);
        warnings.push(format!("{triangles} left out as invisible by alpha ({of})"));
    }
    // 2. What hides what is behind it.
    let mut seen_through = Vec::new();
    let mut shining = Vec::new();
    let mut extended: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    for (number, least_alpha) in drawn {
        let Some(material) = materials.get(*number) else {
            continue;
        };
        if material.is_seen_through(*least_alpha) {
            seen_through.push(*number);
        }
        if material.shines() && !material.shows_emission() {
            shining.push(*number);
        }
        let names = material.extensions.other.keys().map(String::as_str);
        for name in names.filter(|name| !NO_LOSS.contains(name)) {
            extended.entry(name).or_default().push(*number);
        }
    }
    if !seen_through.is_empty() {
        let of = listed(materials, &seen_through);
        warnings.push(format!(
            "what is transparent or cut out is drawn opaque ({of})"
        ));
    }
    // 3. What may look otherwise.
    if !shining.is_empty() {
        let of = listed(materials, &shining);
        warnings.push(format!(
            "what shines by itself is drawn as if it did not ({of})"
        ));
    }
    for (name, numbers) in extended {
        let of = listed(materials, &numbers);
        warnings.push(format!("{} is not applied ({of})", shown(name)));
    }
    warnings
}

/// Materials as messages show them.
fn listed(materials: &[MaterialEntry], numbers: &[usize]) -> String {
    super::listed("material", numbers, |number| {
        materials.get(number).map(|material| material.name.as_str())
    })
}
