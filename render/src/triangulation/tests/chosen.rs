//! Triangulations of chosen scenes.

use super::*;

#[test]
fn a_bare_grid_is_two_triangles_a_cell() {
    let result = check(&Scene::new(100, 70, 7, 3));
    assert_eq!(result.vertices.len(), 8 * 4);
    assert_eq!(result.triangles.len(), 2 * 7 * 3);
    assert_eq!((result.cells_plain, result.cells_triangulated), (21, 0));
    assert_eq!(
        result.triangles[..2],
        [[0, 1, 9], [0, 9, 8]],
        "diagonal from the smallest"
    );
}

#[test]
fn a_point_in_a_cell_a_line_or_a_corner_serves_all_cells_that_have_it() {
    let mut scene = Scene::new(40, 30, 4, 3);
    scene.points = vec![p(13.0, 14.0), p(20.0, 24.0), p(30.0, 20.0), p(0.0, 5.0)];
    let result = check(&scene);
    assert_eq!(
        result.vertices.len(),
        5 * 4 + 3,
        "the corner was there already"
    );
    assert_eq!(result.cells_triangulated, 1 + 2 + 1);
    assert_eq!(result.triangles.len(), 24 + 2 + 2 + 1);
}

#[test]
fn points_outside_are_left_out() {
    let mut scene = Scene::new(40, 30, 4, 3);
    scene.points = vec![p(-1.0, 5.0), p(40.1, 5.0), p(5.0, 1e300), p(-1e300, -1e300)];
    assert_eq!(check(&scene), Scene::new(40, 30, 4, 3).triangulate());
}

#[test]
fn edges_get_a_vertex_where_they_cross() {
    let mut scene = Scene::new(100, 100, 1, 1);
    scene.edges = vec![
        [p(10.0, 50.0), p(90.0, 50.0)],
        [p(50.0, 10.0), p(50.0, 90.0)],
    ];
    let result = check(&scene);
    assert_eq!(result.vertices.len(), 4 + 4 + 1);
    assert!(result.vertices.contains(&p(50.0, 50.0)));
}

#[test]
fn an_edge_from_far_away_crosses_where_it_should() {
    // y = x + 8 through an image of 64 × 48, from 10¹⁵ px away: exact all the same.
    let mut scene = Scene::new(64, 48, 4, 3);
    scene.edges = vec![[p(-1e15, -1e15 + 8.0), p(1e15, 1e15 + 8.0)]];
    let result = check(&scene);
    for x in [0.0, 8.0, 16.0, 24.0, 32.0, 40.0] {
        assert!(result.vertices.contains(&p(x, x + 8.0)), "at x = {x}");
    }
    // Beyond that it is no longer exact, but still sound.
    for far in [1e16, 1e100, f64::MAX] {
        scene.edges = vec![[p(-far, -far), p(far, far)], [p(far, 1.0), p(-far, 30.0)]];
        check(&scene);
    }
}

#[test]
fn overlapping_edges_and_edges_on_the_grid_are_one() {
    let mut scene = Scene::new(40, 30, 4, 3);
    scene.edges = vec![
        [p(-5.0, 10.0), p(50.0, 10.0)],
        [p(40.0, 30.0), p(40.0, 0.0)],
        [p(10.0, 0.0), p(10.0, 20.0)],
        [p(10.0, 20.0), p(10.0, 0.0)],
    ];
    assert_eq!(check(&scene), Scene::new(40, 30, 4, 3).triangulate());
    let once = Scene {
        edges: vec![[p(2.0, 3.0), p(34.0, 27.0)]],
        ..scene.clone()
    };
    let thrice = Scene {
        edges: vec![
            [p(2.0, 3.0), p(26.0, 21.0)],
            [p(34.0, 27.0), p(10.0, 9.0)],
            [p(2.0, 3.0), p(34.0, 27.0)],
        ],
        points: vec![p(26.0, 21.0), p(10.0, 9.0)],
        ..scene.clone()
    };
    let points = vec![p(10.0, 9.0), p(26.0, 21.0)];
    assert_eq!(check(&thrice), Scene { points, ..once }.triangulate());
}

#[test]
fn many_edges_through_one_point_settle() {
    let mut scene = Scene::new(64, 64, 3, 3);
    let center = p(30.37, 33.61);
    for i in 0..60 {
        let direction = DVec2::from_angle(f64::from(i) * 0.0523);
        scene
            .edges
            .push([center - 50.0 * direction, center + 40.0 * direction]);
    }
    check(&scene);
}

/// Splitting one crossing at a time never ended here: two edges cross at a flat angle.
#[test]
fn nearly_parallel_edges_settle() {
    let mut scene = Scene::new(1, 12, 2, 6);
    scene.edges = vec![
        [p(0.515625, 3.2015491533852254), p(0.71875, 5.96875)],
        [p(1.0, 10.0), p(0.5784590717646271, 4.0)],
        [
            p(-5.688753483668788, -34.49283428229592),
            p(8.169628681599864, 52.49283428229592),
        ],
        [p(1.2404375989655376, 9.0), p(1.2404375989655376, 9.0)],
    ];
    check(&scene);
}

#[test]
fn more_edges_than_lattice_points_settle() {
    let mut scene = Scene::new(1, 1, 1, 1);
    for i in 0..300 {
        let angle = f64::from(i);
        let start = p(0.5, 0.5) + 0.8 * DVec2::from_angle(angle);
        scene
            .edges
            .push([start, p(0.5, 0.5) + 0.6 * DVec2::from_angle(angle * 1.618)]);
    }
    check(&scene);
}

#[test]
fn the_smallest_image_works() {
    for (columns, rows) in [(1, 1), (64, 64), (3, 7)] {
        let mut scene = Scene::new(1, 1, columns, rows);
        scene.points = vec![p(0.5, 0.5), p(0.51, 0.5), p(1.0, 1.0)];
        scene.edges = vec![[p(-1.0, 0.3), p(2.0, 0.8)], [p(0.1, 0.9), p(0.9, 0.1)]];
        check(&scene);
    }
}

#[test]
fn the_largest_image_overflows_nothing() {
    let side = lattice::MAX_SIDE;
    let mut scene = Scene::new(side, side, 2, 3);
    let far = f64::from(side);
    scene.points = vec![p(far, far), p(far - 1.0 / 64.0, 0.3), p(0.0, far / 2.0)];
    for i in 0..12 {
        let start = f64::from(i) * far / 11.0;
        scene.edges.push([p(start, -1e15), p(far - start, 1e15)]);
        scene.edges.push([p(0.0, start), p(far, far - start + 0.7)]);
    }
    check(&scene);
}

#[test]
fn grids_have_square_cells() {
    assert_eq!(
        Grid::for_image(1000, 1000, 10),
        Grid {
            columns: 10,
            rows: 10
        }
    );
    assert_eq!(
        Grid::for_image(1000, 10, 10),
        Grid {
            columns: 10,
            rows: 1
        }
    );
    assert_eq!(
        Grid::for_image(10, 1000, 64),
        Grid {
            columns: 10,
            rows: 1000
        }
    );
    assert_eq!(
        Grid::for_image(640, 480, 0),
        Grid {
            columns: 1,
            rows: 1
        }
    );
}

#[test]
fn errors_name_what_is_wrong() {
    let message = |scene: &Scene| {
        let constraints = Constraints {
            points: &scene.points,
            edges: &scene.edges,
        };
        triangulate(scene.width, scene.height, scene.grid, &constraints)
            .unwrap_err()
            .to_string()
    };
    assert_eq!(
        message(&Scene::new(0, 5, 1, 1)),
        "cannot triangulate an image of 0x5 pixels: each side must be from 1 to 1048576"
    );
    assert_eq!(
        message(&Scene::new(2, 5, 129, 0)),
        "cannot lay a grid of 129x0 cells over an image of 2x5 pixels: expected at least one \
         cell, at most 64 to a pixel each way and 16777216 in all; try fewer cells"
    );
    let mut scene = Scene::new(4, 4, 1, 1);
    scene.points = vec![p(1.0, 1.0), p(f64::NAN, 2.0)];
    assert_eq!(
        message(&scene),
        "point 1 is not finite: (NaN, 2); leave out epipoles at infinity"
    );
    scene.points.clear();
    scene.edges = vec![[p(0.0, 0.0), p(1.0, f64::INFINITY)]];
    assert_eq!(
        message(&scene),
        "edge 0 is not finite: (0, 0) to (1, inf); clip proxy edges at the near plane"
    );
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let mut scene = Scene::new(320, 240, 16, 12);
    for i in 0..40 {
        let angle = f64::from(i);
        scene.edges.push([
            p(160.0, 120.0) + 150.0 * DVec2::from_angle(angle),
            p(160.0, 120.0) + 140.0 * DVec2::from_angle(angle * 1.7),
        ]);
    }
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| scene.triangulate())
    };
    assert_eq!(with(1), with(5));
}

#[test]
fn a_picture_has_a_path_for_each_triangle_and_a_dot_for_each_point() {
    let mut scene = Scene::new(40, 30, 4, 3);
    scene.points = vec![p(13.5, 14.0)];
    let result = scene.triangulate();
    let fills = vec![[255, 128, 0]; result.triangles.len()];
    let svg = to_svg(&result, 40, 30, Some(&fills), &scene.points);
    assert_eq!(svg.matches("<path ").count(), 26);
    assert_eq!(svg.matches("fill=\"#ff8000\"").count(), 26);
    assert!(svg.contains("<path d=\"M0 0L10 0L10 10Z\" fill=\"#ff8000\"/>"));
    assert!(svg.contains("<circle cx=\"13.5\" cy=\"14\""));
    assert!(!to_svg(&result, 40, 30, None, &[]).contains("circle"));
}
