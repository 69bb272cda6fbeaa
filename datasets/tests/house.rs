//! The procedural house: what it is made of, and that its truth is the truth.

use calibrate::{Lens, Rigid3, View};
use datasets::DatasetError;
use datasets::house::{self, House, HouseOptions, INTERIOR_FILE, MODEL_FILE, house};
use glam::{DVec2, DVec3};
use proxy::interior::{Content, Contents, RoomBox, read_interior};
use proxy::mesh::read_model;

fn small(rooms: usize, seed: u32) -> House {
    let triangles = Some(1);
    let options = HouseOptions {
        rooms,
        triangles,
        seed,
    };
    house(&options).unwrap()
}

fn room(house: &House, i: usize) -> RoomBox {
    match house.interior.cells[i].content {
        Content::Box(room) => room,
        _ => panic!("a house's cells are boxes"),
    }
}

fn view(eye: DVec3, target: DVec3) -> View {
    View {
        lens: Lens::pinhole(DVec2::splat(60.0), DVec2::new(48.0, 32.0)),
        width: 96,
        height: 64,
        camera_from_world: Rigid3::looking_at(eye, target, DVec3::Y),
    }
}

#[test]
fn a_house_is_closed_lit_and_furnished() {
    let house = small(5, 1);
    let model = &house.model;
    assert_eq!(house.interior.check().unwrap(), []);
    let (contents, warnings) = Contents::new(&house.interior, model).unwrap();
    assert_eq!(warnings, []);
    assert!(contents.triangles.iter().all(|t| t.len() > 1000));
    assert!(
        model
            .mesh
            .positions
            .iter()
            .all(|p| *p == p.as_vec3().as_dvec3())
    );
    assert_eq!(
        model.parts.last().unwrap().triangles.end as usize,
        model.mesh.triangles.len()
    );
    // Not everything fits in every room; much does.
    let things = [
        "sofa",
        "bed",
        "bookshelf",
        "desk",
        "cabinet",
        "counter",
        "wardrobe",
    ];
    let is_there = |name: &&&str| model.nodes.iter().any(|n| n.name == **name);
    assert!(things.iter().filter(is_there).count() >= 4);
    for i in 0..5 {
        let room = room(&house, i);
        let eye = room.min + DVec3::new(0.5, 1.6, 0.5);
        let middle = room.min.midpoint(room.max);
        let (picture, depths) = house::render(&house, &view(eye, middle));
        // Every ray meets something, and within the house.
        assert!(depths.iter().all(|z| (0.01..60.0).contains(z)));
        assert!(picture.pixels().all(|p| p.0[3] == 255));
        // Neither dark nor burnt out nor all the same.
        let values: Vec<f64> = picture.pixels().map(|p| f64::from(p.0[1])).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let spread = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64;
        assert!(
            (50.0..220.0).contains(&mean) && spread.sqrt() > 15.0,
            "{mean} {spread}"
        );
    }
}

#[test]
fn depth_is_along_z() {
    let house = small(2, 3);
    let room = room(&house, 0);
    // Straight up: the ceiling is at one depth, but for the lamp.
    let eye = DVec3::new(room.min.x + 0.5, 1.6, room.min.z + 0.5);
    let (_, depths) = house::render(&house, &view(eye, eye + DVec3::Y * 0.9));
    let on_ceiling = depths.iter().filter(|z| (**z - 1.15).abs() < 1e-9).count();
    assert!(on_ceiling > depths.len() / 10, "{on_ceiling}");
    assert!(depths.iter().all(|z| *z < 1.15 + 1e-9));
}

#[test]
fn what_is_written_is_what_was_built() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("house");
    let house = small(3, 2);
    house::write(&house, &path).unwrap();
    let (interior, warnings) = read_interior(&path.join(INTERIOR_FILE)).unwrap();
    assert_eq!(warnings, []);
    assert_eq!(interior, house.interior);
    let (model, warnings) = read_model(&path.join(MODEL_FILE)).unwrap();
    assert_eq!(warnings, [""; 0]);
    assert_eq!(model.mesh.triangles.len(), house.model.mesh.triangles.len());
    assert_eq!(model.textures.len(), house.model.textures.len());
    assert_eq!(model.nodes.len(), house.model.nodes.len());
    // Triangle by triangle: where it is and what colour it has.
    let shares = [0.2, 0.5, 0.3];
    let mut worst = 0.0_f64;
    let mut corners: Vec<_> = (0..model.mesh.triangles.len())
        .map(|i| sorted(&model, i))
        .collect();
    let mut expected: Vec<_> = (0..model.mesh.triangles.len())
        .map(|i| sorted(&house.model, i))
        .collect();
    corners.sort_unstable();
    expected.sort_unstable();
    assert!(corners == expected);
    // The order of parts is by node; within a part it stays.
    for (part, other) in model.parts.iter().zip(&house.model.parts) {
        if part == other {
            let (a, b) = (
                model.color(part.triangles.start, shares, 0.0),
                house.model.color(other.triangles.start, shares, 0.0),
            );
            worst = (0..3).fold(worst, |w, k| w.max((a[k] - b[k]).abs()));
        }
    }
    assert!(worst < 1e-3, "{worst}");
    // A folder with something in it stays as it is.
    let error = house::write(&house, &path).unwrap_err();
    assert!(matches!(error, DatasetError::NotEmpty { .. }), "{error}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

/// A triangle's corners and their colours, to compare.
fn sorted(model: &proxy::mesh::Model, i: usize) -> Vec<([u64; 3], [u32; 2], [u8; 4])> {
    let corner = |k: u32| {
        let k = k as usize;
        let position = model.mesh.positions[k]
            .to_array()
            .map(|x| (x + 0.0).to_bits());
        (
            position,
            model.uvs[k].map(|x| (x + 0.0).to_bits()),
            model.colors[k],
        )
    };
    model.mesh.triangles[i].map(corner).to_vec()
}

#[test]
fn a_house_is_the_same_on_any_number_of_threads_and_as_fine_as_asked() {
    let one = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .unwrap();
    let alone = one.install(|| small(2, 4));
    let together = small(2, 4);
    assert!(alone.model == together.model);
    assert_eq!(alone.interior, together.interior);
    let options = HouseOptions {
        rooms: 2,
        triangles: Some(60_000),
        seed: 4,
    };
    let fine = house(&options).unwrap();
    assert!((60_000..75_000).contains(&fine.model.mesh.triangles.len()));
    assert_eq!(fine.interior, together.interior);
    for (rooms, triangles) in [(1, 1), (65, 1), (2, 30_000_000)] {
        let options = HouseOptions {
            rooms,
            triangles: Some(triangles),
            seed: 1,
        };
        assert!(matches!(house(&options), Err(DatasetError::Option { .. })));
    }
}
