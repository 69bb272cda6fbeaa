//! What a triangulation must be, checked on chosen and on adversarial scenes.

use std::collections::{BTreeSet, HashMap, HashSet, VecDeque};

use proptest::prelude::*;

use super::cell::{Triangle, delaunay};
use super::lattice::{in_circle, orient};
use super::*;

type Edges = Vec<[DVec2; 2]>;

#[derive(Clone, Debug)]
struct Scene {
    width: u32,
    height: u32,
    grid: Grid,
    points: Vec<DVec2>,
    edges: Edges,
}

impl Scene {
    fn new(width: u32, height: u32, columns: u32, rows: u32) -> Self {
        let grid = Grid { columns, rows };
        Self {
            width,
            height,
            grid,
            points: Vec::new(),
            edges: Vec::new(),
        }
    }

    fn lines(&self) -> Lines {
        Lines::new(self.width, self.height, self.grid).unwrap()
    }

    fn triangulate(&self) -> Triangulation {
        let constraints = Constraints {
            points: &self.points,
            edges: &self.edges,
        };
        triangulate(self.width, self.height, self.grid, &constraints).unwrap()
    }

    fn arrange(&self) -> Arrangement {
        let constraints = Constraints {
            points: &self.points,
            edges: &self.edges,
        };
        arrange(self.lines(), &constraints).unwrap()
    }
}

/// Everything a triangulation promises. Returns it for further questions.
fn check(scene: &Scene) -> Triangulation {
    let arrangement = scene.arrange();
    let lines = &arrangement.lines;
    let result = scene.triangulate();
    assert_eq!(result.constraints_declined, 0);
    assert_eq!(
        result.cells_plain + result.cells_triangulated,
        lines.columns() * lines.rows()
    );

    // Vertices are lattice points, each once.
    let points: Vec<Point> = result.vertices.iter().map(|&v| Point::snap(v)).collect();
    assert!(
        points
            .iter()
            .zip(&result.vertices)
            .all(|(p, &v)| p.to_pixel() == v)
    );
    let id: HashMap<Point, u32> = points.iter().zip(0..).map(|(&p, i)| (p, i)).collect();
    assert_eq!(id.len(), points.len());
    let at = |i: u32| points[i as usize];

    // Triangles turn one way, none is degenerate, and together they cover the image.
    let mut area = 0;
    for &[a, b, c] in &result.triangles {
        let twice = orient(at(a), at(b), at(c));
        assert!(twice > 0);
        area += i128::from(twice);
    }
    assert_eq!(
        area,
        2 * i128::from(lines.size().x) * i128::from(lines.size().y)
    );

    // Every edge has a twin or lies on the image's border: no gap, overlap, T-junction.
    let mut apex_of: HashMap<(u32, u32), u32> = HashMap::new();
    for &[a, b, c] in &result.triangles {
        for (from, to, apex) in [(a, b, c), (b, c, a), (c, a, b)] {
            assert!(
                apex_of.insert((from, to), apex).is_none(),
                "two triangles on one side"
            );
        }
    }
    let used: HashSet<u32> = result.triangles.iter().flatten().copied().collect();
    assert_eq!(used.len(), points.len(), "every vertex is used");
    for &(from, to) in apex_of.keys() {
        let (a, b, size) = (at(from), at(to), lines.size());
        let on_border = (a.x == b.x && (a.x == 0 || a.x == size.x))
            || (a.y == b.y && (a.y == 0 || a.y == size.y));
        assert_eq!(apex_of.contains_key(&(to, from)), !on_border);
    }

    // Pieces are edges, and given points are vertices.
    let mut constrained: BTreeSet<Piece> = BTreeSet::new();
    for &piece in arrangement.pieces.iter().flat_map(|(_, pieces)| pieces) {
        let [a, b] = piece.map(|p| id[&p]);
        assert!(apex_of.contains_key(&(a, b)), "{piece:?} is missing");
        constrained.insert(piece);
    }
    for point in scene.points.iter().map(|&p| Point::snap(p)) {
        assert_eq!(id.contains_key(&point), lines.contains(point));
    }

    // Every triangle passes the empty-circle test across edges that are not constraints;
    // where four points tie, the diagonal starts at the smallest.
    for (&(from, to), &apex) in &apex_of {
        let piece = cut::ordered([at(from), at(to)]);
        if lines.is_along(piece) {
            constrained.insert(piece);
        }
        if constrained.contains(&piece) {
            continue;
        }
        let opposite = at(apex_of[&(to, from)]);
        let inside = in_circle(at(from), at(to), at(apex), opposite);
        assert!(inside <= 0);
        assert!(
            inside < 0 || piece[0] < opposite.min(at(apex)),
            "a tie went the other way"
        );
    }

    check_chains(scene, &points, &id, &apex_of);
    assert_eq!(set_of(&result), whole_plane(&points, &constrained));
    result
}

/// Every given edge is a chain of edges that never strays from it.
fn check_chains(
    scene: &Scene,
    points: &[Point],
    id: &HashMap<Point, u32>,
    edges: &HashMap<(u32, u32), u32>,
) {
    /// Lattice steps: cutting at the grid and splitting each move a line by up to 1/√2.
    const CORRIDOR: f64 = 1.5;
    let mut neighbours: HashMap<u32, Vec<u32>> = HashMap::new();
    for &(a, b) in edges.keys() {
        neighbours.entry(a).or_default().push(b);
        neighbours.entry(b).or_default().push(a);
    }
    for edge in &scene.edges {
        let constraints = Constraints {
            points: &[],
            edges: &[*edge],
        };
        let stops = cut::cut(&scene.lines(), &constraints).unwrap().vertices;
        let (Some(first), Some(last)) = (stops.first(), stops.last()) else {
            continue;
        };
        let close = |i: u32| distance(points[i as usize], [*first, *last]) < CORRIDOR;
        let (mut seen, mut queue) = (HashSet::from([id[first]]), VecDeque::from([id[first]]));
        while let Some(next) = queue.pop_front() {
            for &neighbour in &neighbours[&next] {
                if close(neighbour) && seen.insert(neighbour) {
                    queue.push_back(neighbour);
                }
            }
        }
        assert!(seen.contains(&id[last]), "no chain for {edge:?}");
    }
}

/// From a point to a segment, in lattice steps.
fn distance(p: Point, [a, b]: Piece) -> f64 {
    let vector = |p: Point| DVec2::new(p.x as f64, p.y as f64);
    let (p, a, b) = (vector(p), vector(a), vector(b));
    let t = (p - a).dot(b - a) / (b - a).length_squared().max(1.0);
    p.distance(a + (b - a) * t.clamp(0.0, 1.0))
}

/// The slow twin: one triangulation of the whole plane with the grid among its constraints.
fn whole_plane(points: &[Point], constrained: &BTreeSet<Piece>) -> BTreeSet<[Point; 3]> {
    let mut sorted = points.to_vec();
    sorted.sort_unstable();
    let pieces: Vec<Piece> = constrained.iter().copied().collect();
    let (triangles, declined) = delaunay(&sorted, &pieces);
    assert_eq!(declined, 0);
    triangles.iter().map(|t| corners(t, &sorted)).collect()
}

fn set_of(result: &Triangulation) -> BTreeSet<[Point; 3]> {
    let points: Vec<Point> = result.vertices.iter().map(|&v| Point::snap(v)).collect();
    result
        .triangles
        .iter()
        .map(|t| corners(t, &points))
        .collect()
}

/// A triangle's corners, the smallest first.
fn corners(triangle: &Triangle, points: &[Point]) -> [Point; 3] {
    let mut corners = triangle.map(|i| points[i as usize]);
    let smallest = (0..3).min_by_key(|&k| corners[k]).unwrap();
    corners.rotate_left(smallest);
    corners
}

fn p(x: f64, y: f64) -> DVec2 {
    DVec2::new(x, y)
}

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

/// A coordinate along a side: anywhere, on grid lines, where others are, a lattice step or
/// much less from there, or far outside.
fn coordinate(side: u32, cells: u32) -> impl Strategy<Value = f64> {
    let (side, cells) = (f64::from(side), f64::from(cells));
    let part = move |parts: f64| (0..=parts as u32).prop_map(move |i| f64::from(i) * side / parts);
    prop_oneof![
        6 => (-0.3..1.3).prop_map(move |t| t * side),
        3 => part(cells),
        3 => part(4.0),
        2 => (part(4.0), -2..=2).prop_map(|(x, steps)| x + f64::from(steps) / 64.0),
        1 => (part(cells), -1..=1).prop_map(|(x, steps)| x + f64::from(steps) * 1e-9),
        1 => prop::sample::select(vec![1e4, -1e4, 1e9, -1e9, 1e15, -1e15, 1e40, -1e300]),
    ]
}

/// Edges as adversaries and meshes make them.
fn edges(position: BoxedStrategy<DVec2>) -> impl Strategy<Value = Edges> {
    let vector = (-50.0..50.0, -50.0..50.0).prop_map(|(x, y)| p(x, y));
    prop_oneof![
        // Any two ends.
        3 => prop::collection::vec([position.clone(), position.clone()], 0..12),
        // A strip of triangles.
        1 => prop::collection::vec(position.clone(), 3..8).prop_map(|v| {
            let edge = |i: usize, j: usize| [v[i], v[j]];
            (1..v.len()).map(|i| edge(i - 1, i)).chain((2..v.len()).map(|i| edge(i - 2, i))).collect()
        }),
        // Through one point.
        1 => (position.clone(), prop::collection::vec(vector.clone(), 2..20))
            .prop_map(|(c, d)| d.iter().map(|&d| [c - d, c + d]).collect()),
        // Nearly the same edge, over and over.
        1 => (position.clone(), vector.clone(), prop::collection::vec([-3..=3, -3..=3, -3..=3], 2..10))
            .prop_map(|(a, d, jitter)| {
                let step = |i: i32| f64::from(i) / 64.0;
                let edge = |[x, y, z]: [i32; 3]| [a + p(step(x), step(y)), a + d + p(step(z), step(y))];
                jitter.into_iter().map(edge).collect()
            }),
        // On one line, overlapping.
        1 => (position, vector, prop::collection::vec((-8..8, -8..8), 2..8))
            .prop_map(|(a, d, parts)| {
                let at = |i: i32| a + d.round() * f64::from(i) / 8.0;
                parts.into_iter().map(|(i, j)| [at(i), at(j)]).collect()
            }),
    ]
}

fn scene() -> impl Strategy<Value = Scene> {
    let side = || prop_oneof![1 => Just(1_u32), 4 => 2..200_u32];
    (side(), side(), 1..9_u32, 1..9_u32).prop_flat_map(|(width, height, columns, rows)| {
        let position = (coordinate(width, columns), coordinate(height, rows))
            .prop_map(|(x, y)| p(x, y))
            .boxed();
        let points = prop::collection::vec(position.clone(), 0..12);
        let edges = prop::collection::vec(edges(position), 0..4);
        (points, edges).prop_map(move |(points, edges)| Scene {
            points,
            edges: edges.concat(),
            ..Scene::new(width, height, columns, rows)
        })
    })
}

proptest! {
    /// PROPTEST_CASES=10000 asks for more.
    #[test]
    fn adversarial_scenes_keep_every_promise(scene in scene()) {
        check(&scene);
    }

    #[test]
    fn the_order_of_the_input_changes_nothing(
        (scene, points, edges) in scene().prop_flat_map(|scene| (
            Just(scene.points.clone()).prop_shuffle(),
            Just(scene.edges.clone()).prop_shuffle(),
            Just(scene),
        ).prop_map(|(points, edges, scene)| (scene, points, edges)))
    ) {
        let mut shuffled = Scene { points, edges, ..scene.clone() };
        shuffled.edges.iter_mut().step_by(2).for_each(|edge| edge.reverse());
        prop_assert_eq!(scene.triangulate(), shuffled.triangulate());
    }
}
