//! A small COLMAP model in both formats, and a small textured one.

use calibrate::colmap;
use std::path::Path;

/// `cameras.txt`, `images.txt` and `points3D.txt`.
pub const TEXT: [&str; 3] = [
    "# comment\n1 SIMPLE_RADIAL 100 80 90 50 40 -0.1\n7 PINHOLE 64 48 60 61 32 24\n",
    "1 1 0 0 0 0 0 0 1 a.jpg\n55 40 3 10 20 -1\n\
     2 0.7071067811865476 0 0.7071067811865476 0 -1 0.5 2 7 dir\\b c.jpg\n32 24 3\n",
    "3 1 0 10 1 2 255 0.5 1 0 2 0\n",
];

/// The same as `cameras.bin`, `images.bin` and `points3D.bin`.
pub fn binary() -> &'static [Vec<u8>; 3] {
    static BINARY: std::sync::OnceLock<[Vec<u8>; 3]> = std::sync::OnceLock::new();
    BINARY.get_or_init(|| {
        let whole = colmap::parse_text(Path::new("model"), TEXT.map(str::as_bytes));
        written(
            &whole.expect("a model that is whole"),
            colmap::write_binary,
            "bin",
        )
    })
}

/// The three files that `write` makes of a reconstruction.
pub fn written(
    whole: &calibrate::Reconstruction,
    write: fn(&calibrate::Reconstruction, &Path) -> Result<(), colmap::ColmapError>,
    extension: &str,
) -> [Vec<u8>; 3] {
    let folder = std::env::temp_dir().join(format!("lumigraph-fuzz-{}", std::process::id()));
    write(whole, &folder).expect("the temporary folder takes files");
    let files = ["cameras", "images", "points3D"].map(|stem| {
        std::fs::read(folder.join(stem).with_extension(extension)).expect("just written")
    });
    std::fs::remove_dir_all(folder).expect("just written");
    files
}

/// Two rooms, an opening and a texture, as .glb.
pub fn textured_glb() -> Vec<u8> {
    use proxy::mesh::{Material, Mesh, Model, ModelNode, Part, Texture, model_to_glb};
    let node = |name: &str| ModelNode {
        name: name.to_owned(),
        parent_idx: None,
    };
    let part = |i: u32| Part {
        triangles: i..i + 1,
        node_idx: i,
        material_idx: 0,
    };
    let model = Model {
        mesh: Mesh {
            positions: vec![
                glam::DVec3::ZERO,
                glam::DVec3::X,
                glam::DVec3::Y,
                glam::DVec3::Z,
            ],
            triangles: vec![[0, 1, 2], [0, 2, 3], [1, 2, 3]],
        },
        uvs: vec![[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]],
        colors: vec![[255; 4], [0, 1, 2, 255], [9, 9, 9, 255], [254, 255, 0, 255]],
        parts: vec![part(0), part(1), part(2)],
        nodes: vec![node("cell:a"), node("cell:b"), node("portal:a|b")],
        materials: vec![Material {
            texture_idx: Some(0),
            ..Material::default()
        }],
        textures: vec![Texture::new(image::RgbaImage::from_fn(4, 2, |x, y| {
            image::Rgba([60 * x as u8, 100 * y as u8, 7, 255])
        }))],
    };
    model_to_glb(&model).expect("a model that is whole")
}
