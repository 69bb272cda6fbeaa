#![no_main]
use libfuzzer_sys::fuzz_target;
use lumigraph_fuzz::within_memory;
use proxy::interior::{Contents, interior_from_nodes};
use proxy::mesh::{Model, Texture, parse_model};
use std::path::Path;

// Pictures are as large as they say, within bounds of their own; decoding takes as much again, and making
// smaller ones four times as much.
fn pictures(model: &Model) -> usize {
    let texels = |t: &Texture| t.texels().len();
    24 * model.textures.iter().map(texels).sum::<usize>()
}

fuzz_target!(|data: &[u8]| {
    let path = Path::new("absent/house.glb");
    // A picture that is large by its own words and then fails takes its share, too.
    let read = within_memory(
        data.len(),
        || parse_model(path, data),
        |read| match read {
            Ok((model, _)) => pictures(model),
            Err(_) => 1 << 30,
        },
    );
    match read {
        Ok((model, _)) => {
            let corners = model.mesh.positions.len();
            assert_eq!([model.uvs.len(), model.colors.len()], [corners; 2]);
            assert!(model.mesh.positions.iter().all(|p| p.is_finite()));
            for i in 0..model.mesh.triangles.len() as u32 {
                for footprint in [0.0, 0.3, f64::INFINITY] {
                    let color = model.color(i, [0.2, 0.3, 0.5], footprint);
                    assert!(color.iter().all(|c| (0.0..=255.0).contains(c)));
                }
            }
            if let Ok((interior, _)) = interior_from_nodes(&model, "house.glb", 1.0) {
                assert!(Contents::new(&interior, &model).is_ok());
            }
        }
        Err(error) => assert!(error.to_string().starts_with("absent/")),
    }
});
