use super::*;
use proptest::prelude::*;

/// A sphere of the given radius, its poles along y.
fn globe(center: DVec3, radius: f64) -> Mesh {
    let (around, down) = (48_u32, 24_u32);
    let mut mesh = Mesh::default();
    for row in 0..=down {
        for column in 0..around {
            let theta = std::f64::consts::PI * f64::from(row) / f64::from(down);
            let phi = std::f64::consts::TAU * f64::from(column) / f64::from(around);
            let at = DVec3::new(
                theta.sin() * phi.cos(),
                theta.cos(),
                theta.sin() * phi.sin(),
            );
            mesh.positions.push(center + radius * at);
        }
    }
    for row in 0..down {
        for column in 0..around {
            let at = |r: u32, c: u32| r * around + c % around;
            let (a, b) = (at(row, column), at(row, column + 1));
            let (c, d) = (at(row + 1, column), at(row + 1, column + 1));
            mesh.triangles.extend([[a, b, c], [b, d, c]]);
        }
    }
    mesh
}

proptest! {
    #[test]
    fn from_inside_a_closed_surface_every_ray_meets_it(
        x in -0.9..0.9, y in -0.3..0.3, theta in 0.0..std::f64::consts::PI,
        phi in 0.0..std::f64::consts::TAU, scale in -6..6, shift in 0.0..1e7,
    ) {
        // Far from the world's origin, at any scale; along seams of the mesh, too.
        let radius = 10_f64.powi(scale);
        let center = DVec3::new(shift, -shift, 0.5 * shift) * radius;
        let solid = Solid::new(MeshKind::Mesh, globe(center, radius));
        let from = center + radius * DVec3::new(x, y, 0.1);
        let ray = DVec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin());
        let seam = DVec3::new(0.0, (theta * 8.0).round() / 8.0, -1.0);
        for direction in [ray, seam, DVec3::Y, DVec3::X] {
            let hit = solid.first_hit(from, direction);
            prop_assert!(hit.is_some());
            let at = from + direction * hit.unwrap().along;
            let off = (at - center).length() / radius;
            prop_assert!((0.98..1.001).contains(&off), "{off}");
        }
        let beside = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::NEG_ONE];
        let together = beside.map(|beside| ray + 0.01 * beside);
        let alone = together.map(|direction| solid.first_hit(from, direction));
        prop_assert_eq!(solid.first_hits(from, together), alone);
    }
}

#[test]
fn the_nearest_counts_and_a_dome_far_away_takes_no_digits() {
    let mut mesh = globe(DVec3::new(1e6, 0.0, 0.0), 1.0);
    let near = mesh.triangles.len() as u32;
    mesh.append(&globe(DVec3::new(1e6, 0.0, 0.0), 1e5));
    let solid = Solid::new(MeshKind::Mesh, mesh);
    let from = DVec3::new(1e6, 0.0, -3.0);
    let hit = solid.first_hit(from, DVec3::Z * 2.0).unwrap();
    assert!(hit.triangle_idx < near);
    assert!((hit.along - 1.0).abs() < 0.01, "{}", hit.along);
    let beyond = solid.first_hit(from, DVec3::NEG_Z).unwrap();
    assert!(beyond.triangle_idx >= near);
}

#[test]
fn sizes_beyond_f32_are_met_as_others() {
    for radius in [1e-90, 1e-40, 1e39, 1e90] {
        let solid = Solid::new(MeshKind::Mesh, globe(DVec3::ZERO, radius));
        let from = DVec3::new(0.1, 0.2, -3.0) * radius;
        let hit = solid.first_hit(from, DVec3::Z).unwrap();
        let off = (from + DVec3::Z * hit.along).length() / radius;
        assert!((0.98..1.001).contains(&off), "{radius}: {off}");
        assert_eq!(solid.first_hit(from, DVec3::X), None);
        let met = |share: f64| solid.own_hits_until(from, DVec3::Z, share * radius).len();
        assert_eq!(met(1.5), 0, "{radius}");
        assert!(met(2.5) > 0 && met(5.0) > met(2.5), "{radius}");
    }
    // What is too far away for the rest of the mesh is met, too, but no ray begins there.
    let mut mesh = globe(DVec3::ZERO, 1.0);
    let own = mesh.triangles.len() as u32;
    mesh.append(&globe(DVec3::ZERO, 1e30));
    mesh.append(&globe(DVec3::ZERO, 0.5));
    let solid = Solid::new(MeshKind::Mesh, mesh);
    let from = DVec3::new(0.1, 0.2, -3.0);
    assert!(solid.first_hit(from, DVec3::Z).unwrap().triangle_idx < own);
    let beyond = solid.first_hit(from, DVec3::NEG_Z).unwrap();
    assert!((own..2 * own).contains(&beyond.triangle_idx), "{beyond:?}");
    assert_eq!(solid.first_hit(DVec3::Z * 1e39, DVec3::NEG_Z), None);
}

#[test]
fn out_of_what_was_not_carved_one_sees_what_lies_beyond() {
    // Solid around a view, in a free space with a wall around it.
    let mut mesh = globe(DVec3::ZERO, 1.0);
    let own = mesh.triangles.len() as u32;
    let mut wall = globe(DVec3::ZERO, 10.0);
    wall.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    mesh.append(&wall);
    let carved = Solid::new(MeshKind::Carved, mesh.clone());
    let far = carved.first_hit(DVec3::ZERO, DVec3::Z).unwrap();
    assert!(far.triangle_idx >= own && far.along > 9.0, "{far:?}");
    // From free space it is met.
    let near = carved.first_hit(DVec3::Z * 5.0, DVec3::NEG_Z).unwrap();
    assert!(near.triangle_idx < own, "{near:?}");
    // A file's triangles may be any way round.
    let any = Solid::new(MeshKind::Mesh, mesh);
    let near = any.first_hit(DVec3::ZERO, DVec3::Z).unwrap();
    assert!(near.triangle_idx < own, "{near:?}");
}

#[test]
fn nothing_is_met_where_there_is_nothing() {
    let empty = Solid::new(MeshKind::Mesh, Mesh::default());
    assert_eq!(empty.first_hit(DVec3::ZERO, DVec3::Z), None);
    let flat = Mesh {
        positions: vec![DVec3::ZERO, DVec3::X, DVec3::X * 2.0],
        triangles: vec![[0, 1, 2]],
    };
    let flat = Solid::new(MeshKind::Mesh, flat);
    assert_eq!(flat.first_hit(DVec3::NEG_Z, DVec3::Z), None);
    let globe = Solid::new(MeshKind::Mesh, globe(DVec3::ZERO, 1.0));
    assert_eq!(globe.first_hit(DVec3::Z * 3.0, DVec3::Z), None);
    assert_eq!(globe.first_hit(DVec3::Z * 3.0, DVec3::ZERO), None);
    assert_eq!(globe.first_hit(DVec3::NAN, DVec3::Z), None);
}

/// Copies of a triangle, triangles that are points, and pages of a book: all have one box.
#[test]
fn many_triangles_in_one_place_take_no_more_time_than_elsewhere() {
    const COUNT: u32 = 100_000;
    let mut mesh = Mesh {
        positions: vec![
            DVec3::new(5.0, 5.0, 1.0),
            DVec3::new(6.0, 5.0, 1.0),
            DVec3::new(5.0, 6.0, 1.0),
            DVec3::ZERO,
            DVec3::ONE,
        ],
        triangles: vec![[3; 3]; COUNT as usize],
    };
    for i in 0..COUNT {
        mesh.triangles.push([0, 1, 2]);
        // Along one side of a cube's diagonal, away from its faces.
        let share = 0.1 + 0.4 * f64::from(i) / f64::from(COUNT);
        mesh.triangles.push([3, 4, mesh.positions.len() as u32]);
        mesh.positions.push(DVec3::new(share, 0.2, 0.8));
    }
    // It took minutes.
    let solid = Solid::new(MeshKind::Mesh, mesh);
    let hit = |x: f64, y: f64| solid.first_hit(DVec3::new(x, y, -1.0), DVec3::Z);
    let copy = hit(5.2, 5.2).unwrap();
    assert_eq!(copy.triangle_idx, COUNT);
    assert!((copy.along - 2.0).abs() < 1e-12, "{copy:?}");
    assert!(hit(0.4, 0.3).is_some());
    assert_eq!(hit(0.0, 0.5), None);
    assert!(solid.boxed.triangles.len() <= 1 + COUNT as usize);
}

proptest! {
    /// Of corners on few places many triangles are equal, have equal boxes, or no area.
    #[test]
    fn a_ray_meets_the_first_of_all_triangles(
        triangles in prop::collection::vec(prop::array::uniform3(0..27_u32), 1..60),
        from in prop::array::uniform3(-3.0..3.0), direction in prop::array::uniform3(-1.0..1.0),
        carved: bool,
    ) {
        let place = |i: u32| DVec3::new(f64::from(i % 3), f64::from(i / 3 % 3), f64::from(i / 9));
        let mesh = Mesh { positions: (0..27).map(place).collect(), triangles };
        let kind = if carved { MeshKind::Carved } else { MeshKind::Mesh };
        let solid = Solid::new(kind, mesh.clone());
        let (from, direction) = (DVec3::from_array(from), DVec3::from_array(direction));
        let unit = direction / direction.length();
        let meets = |i: usize| {
            let [a, b, c] = mesh.triangles[i];
            let corners = mesh.corners(i).map(|p| p - from);
            let along = meet(corners, unit, carved).filter(|_| a != b && b != c && c != a);
            along.map(|along| (along, i as u32))
        };
        let all: Vec<(f64, u32)> = (0..mesh.triangles.len()).filter_map(meets).collect();
        let nearest = all.iter().copied();
        let nearest = nearest.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let found = solid.first_hit(from, direction).map(|hit| hit.triangle_idx);
        prop_assert_eq!(found, nearest.map(|(_, i)| i));
        // Several at once meet what they do alone.
        let others = [DVec3::X, -DVec3::ONE, DVec3::NAN, DVec3::new(0.3, 0.0, -0.1)];
        for (i, other) in others.into_iter().enumerate() {
            let mut together = [direction, direction + other, other, DVec3::ZERO];
            together.rotate_right(i);
            let alone = together.map(|direction| solid.first_hit(from, direction));
            prop_assert_eq!(solid.first_hits(from, together), alone);
        }
        // And all that are as near, but for those with the same corners.
        let along = nearest.map_or(0.0, |(along, _)| along);
        let until = along * (1.0 + 1e-9) / direction.length();
        let met = solid.own_hits_until(from, direction, until);
        for (_, i) in all.iter().filter(|(there, _)| *there <= along) {
            let is_it = |k: &u32| mesh.corners(*k as usize) == mesh.corners(*i as usize);
            prop_assert!(met.iter().any(is_it), "{i} of {met:?}");
        }
    }
}
