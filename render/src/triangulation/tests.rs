//! What a triangulation must be, checked on adversarial scenes.

mod chosen;

use super::cell::{Triangle, delaunay};
use super::lattice::{in_circle, orient};
use super::*;
use proptest::prelude::*;
use std::collections::{BTreeSet, HashMap, HashSet, VecDeque};

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
