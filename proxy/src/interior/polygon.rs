//! Flat polygons in space.

mod pieces;

use glam::{DVec2, DVec3};
use pieces::{Pieces, STRAIGHT_INSIDE};

/// A flat, simple polygon of three corners or more, convex or not.
#[derive(Clone, Debug, PartialEq)]
pub struct Polygon {
    corners: Vec<DVec3>,
    center: DVec3,
    normal: DVec3,
    size: f64,
    pieces: Pieces,
}

/// Why corners make no polygon.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PolygonError {
    /// Too few to enclose anything, or absurdly many.
    #[error("it has {0} corners; give 3 to {MAX_CORNERS}")]
    Corners(usize),
    /// NaN or infinite.
    #[error("corner {0} is not finite")]
    NotFinite(usize),
    /// It encloses nothing.
    #[error("its corners lie on a line; give an outline that encloses something")]
    Flat,
    /// A corner lies off the plane of the others.
    #[error(
        "corner {corner} lies {off} off the plane of the others, of an extent of {size}; a polygon \
         must be flat: split it, or move the corner"
    )]
    NotPlanar {
        /// From 0.
        corner: usize,
        /// In world units.
        off: f64,
        /// In world units.
        size: f64,
    },
    /// It is no simple polygon.
    #[error("its sides {0} and {1} cross; list its corners in order around it")]
    Crossing(usize, usize),
}

/// Checks take time with the square of their number.
const MAX_CORNERS: usize = 256;
/// How far corners may lie off their plane, in shares of the extent.
const FLATNESS: f64 = 1e-3;
/// What counts as nothing, in shares of the extent.
const NOTHING: f64 = 1e-9;

impl Polygon {
    /// A polygon of corners in order around it.
    ///
    /// # Errors
    /// Corners that are too few, not finite, on a line or off their plane, and sides that cross.
    pub fn new(corners: Vec<DVec3>) -> Result<Self, PolygonError> {
        let count = corners.len();
        if !(3..=MAX_CORNERS).contains(&count) {
            return Err(PolygonError::Corners(count));
        }
        if let Some(i) = corners.iter().position(|p| !p.is_finite()) {
            return Err(PolygonError::NotFinite(i));
        }
        // Relative to a corner: digits far from the world's origin.
        let origin = corners[0];
        let offsets: Vec<DVec3> = corners.iter().map(|p| *p - origin).collect();
        let low = offsets
            .iter()
            .copied()
            .reduce(DVec3::min)
            .unwrap_or_default();
        let high = offsets
            .iter()
            .copied()
            .reduce(DVec3::max)
            .unwrap_or_default();
        let size = (high - low).length();
        if !(size > 0.0 && size.is_finite()) {
            return Err(PolygonError::Flat);
        }
        // Newell's normal, twice the area long; in shares of the extent.
        let scaled: Vec<DVec3> = offsets.iter().map(|p| *p / size).collect();
        let next = |i: usize| (i + 1) % count;
        let newell: DVec3 = (0..count).map(|i| scaled[i].cross(scaled[next(i)])).sum();
        let normal = newell.normalize_or_zero();
        if !(newell.length() > NOTHING) || normal == DVec3::ZERO {
            // Of a figure of eight, too.
            return Err(crossing(&scaled).unwrap_or(PolygonError::Flat));
        }
        let center = offsets.iter().sum::<DVec3>() / count as f64;
        for (corner, p) in offsets.iter().enumerate() {
            let off = (*p - center).dot(normal).abs();
            if !(off <= FLATNESS * size) {
                return Err(PolygonError::NotPlanar { corner, off, size });
            }
        }
        let mut polygon = Self {
            center: origin + center,
            normal,
            size,
            corners,
            pieces: Pieces::default(),
        };
        let flat = polygon.flattened();
        if let Some((a, b)) = crossing_sides(&flat) {
            return Err(PolygonError::Crossing(a, b));
        }
        polygon.center = polygon.middle(&flat);
        Ok(polygon)
    }

    /// The middle of its area, where `flat` are its corners on its plane, from their mean, which its centre is as yet.
    /// Where that is as good, as of a rectangle, it stays to the last bit.
    fn middle(&self, flat: &[DVec2]) -> DVec3 {
        // In shares of the extent.
        let (mut twice, mut moment) = (0.0, DVec2::ZERO);
        for (i, a) in flat.iter().enumerate() {
            let [a, b] = [*a, flat[(i + 1) % flat.len()]].map(|p| p / self.size);
            twice += a.perp_dot(b);
            moment += a.perp_dot(b) * (a + b);
        }
        let off = moment / (3.0 * twice);
        // Farther off than its extent it is where lobes of an outline that touches itself cancel out.
        if !(STRAIGHT_INSIDE..=1.0).contains(&off.length()) {
            return self.center;
        }
        let (x, y) = self.axes();
        self.center + self.size * (off.x * x + off.y * y)
    }

    /// Its corners, counter-clockwise around the normal.
    pub fn corners(&self) -> &[DVec3] {
        &self.corners
    }

    /// The middle of its area, however many corners there are on a side.
    pub fn center(&self) -> DVec3 {
        self.center
    }

    /// Unit length; whoever it points to sees the corners counter-clockwise.
    pub fn normal(&self) -> DVec3 {
        self.normal
    }

    /// The diagonal of its bounds.
    pub fn size(&self) -> f64 {
        self.size
    }

    /// The same seen from behind.
    pub fn reversed(mut self) -> Self {
        self.corners.reverse();
        self.normal = -self.normal;
        self.pieces = Pieces::default();
        self
    }

    /// How far a point is in front of its plane.
    pub fn height(&self, point: DVec3) -> f64 {
        (point - self.center).dot(self.normal)
    }

    /// Whether a point's foot on its plane is inside, or within `margin` of its outline.
    pub fn covers(&self, point: DVec3, margin: f64) -> bool {
        let (x, y) = self.axes();
        let at = DVec2::new((point - self.center).dot(x), (point - self.center).dot(y));
        let corners = self.flattened();
        is_inside(&corners, at) || distance_to_outline(&corners, at) <= margin
    }

    /// How far a point is from the nearest point of it.
    pub fn distance(&self, point: DVec3) -> f64 {
        let height = self.height(point);
        let (x, y) = self.axes();
        let offset = point - self.center;
        let at = DVec2::new(offset.dot(x), offset.dot(y));
        let corners = self.flattened();
        match is_inside(&corners, at) {
            true => height.abs(),
            false => distance_to_outline(&corners, at).hypot(height),
        }
    }

    /// Two axes of its plane, right-handed with the normal.
    fn axes(&self) -> (DVec3, DVec3) {
        let x = self.normal.any_orthonormal_vector();
        (x, self.normal.cross(x))
    }

    /// The corners on its plane, from its centre.
    fn flattened(&self) -> Vec<DVec2> {
        let (x, y) = self.axes();
        let flat = |p: &DVec3| {
            let offset = *p - self.center;
            DVec2::new(offset.dot(x), offset.dot(y))
        };
        self.corners.iter().map(flat).collect()
    }
}

/// Twice the signed area of a triangle.
fn cross(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    (b - a).perp_dot(c - a)
}

/// Even–odd.
fn is_inside(corners: &[DVec2], at: DVec2) -> bool {
    let mut inside = false;
    for (i, a) in corners.iter().enumerate() {
        let b = corners[(i + 1) % corners.len()];
        if (a.y > at.y) != (b.y > at.y) && at.x < a.x + (at.y - a.y) / (b.y - a.y) * (b.x - a.x) {
            inside = !inside;
        }
    }
    inside
}

fn distance_to_outline(corners: &[DVec2], at: DVec2) -> f64 {
    let side = |(i, a): (usize, &DVec2)| {
        let along = corners[(i + 1) % corners.len()] - *a;
        let squared = along.length_squared();
        let share = match squared > 0.0 {
            true => ((at - *a).dot(along) / squared).clamp(0.0, 1.0),
            false => 0.0,
        };
        at.distance(*a + share * along)
    };
    corners
        .iter()
        .enumerate()
        .map(side)
        .fold(f64::INFINITY, f64::min)
}

/// Two sides that cross, and share no corner.
fn crossing_sides(corners: &[DVec2]) -> Option<(usize, usize)> {
    let n = corners.len();
    for i in 0..n {
        for j in i + 1..n {
            let (a, b) = (corners[i], corners[(i + 1) % n]);
            let (c, d) = (corners[j], corners[(j + 1) % n]);
            let splits = |p, q, r, s| cross(p, q, r) * cross(p, q, s) < 0.0;
            if splits(a, b, c, d) && splits(c, d, a, b) {
                return Some((i, j));
            }
        }
    }
    None
}

/// The same of a polygon without a normal, as its longest axes show it.
fn crossing(corners: &[DVec3]) -> Option<PolygonError> {
    let count = corners.len();
    let normal = (0..count)
        .flat_map(|i| (i + 1..count).map(move |j| (i, j)))
        .map(|(i, j)| (corners[i] - corners[0]).cross(corners[j] - corners[0]))
        .max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()))?;
    if !(normal.length() > NOTHING) {
        return None;
    }
    let x = normal.normalize().any_orthonormal_vector();
    let y = normal.normalize().cross(x);
    let flat: Vec<DVec2> = corners
        .iter()
        .map(|p| DVec2::new(p.dot(x), p.dot(y)))
        .collect();
    let (a, b) = crossing_sides(&flat)?;
    Some(PolygonError::Crossing(a, b))
}

/// Leaves out corners of an outline, given with the one before and the one after, that are needless, as
/// long as more than three are left.
pub(super) fn thin<T: Copy>(outline: &mut Vec<T>, is_needless: impl Fn([T; 3]) -> bool) {
    let (mut at, mut kept) = (0, 0);
    while outline.len() > 3 && kept < outline.len() {
        let n = outline.len();
        let i = at % n;
        if is_needless([(i + n - 1) % n, i, (i + 1) % n].map(|k| outline[k])) {
            outline.remove(i);
            kept = 0;
            at = i.saturating_sub(1);
        } else {
            kept += 1;
            at = i + 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn polygon(corners: &[[f64; 3]]) -> Result<Polygon, PolygonError> {
        Polygon::new(corners.iter().map(|p| DVec3::from_array(*p)).collect())
    }

    #[test]
    fn what_is_no_polygon_is_told() {
        let message = |corners: &[[f64; 3]]| polygon(corners).unwrap_err().to_string();
        assert_eq!(
            message(&[[0.0; 3], [1.0; 3]]),
            "it has 2 corners; give 3 to 256"
        );
        assert_eq!(
            message(&[[0.0; 3], [1.0; 3], [0.0, f64::NAN, 0.0]]),
            "corner 2 is not finite"
        );
        let line = "its corners lie on a line; give an outline that encloses something";
        assert_eq!(message(&[[0.0; 3], [1.0; 3], [2.0; 3]]), line);
        assert_eq!(message(&[[1.0; 3], [1.0; 3], [1.0; 3]]), line);
        let bent = [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.3], [0.0, 1.0, 0.0]];
        assert!(message(&bent).contains("off the plane of the others"));
        let eight = [[0.0; 3], [1.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        assert!(message(&eight).contains("cross"), "{}", message(&eight));
    }

    #[test]
    fn its_centre_is_the_middle_of_its_area_however_many_corners_say_so() {
        // Of a rectangle it is the mean of the corners, to the last bit.
        let doorway = [
            [4.05, 0.0, 1.1],
            [4.05, 0.0, 2.3],
            [4.05, 2.1, 2.3],
            [4.05, 2.1, 1.1],
        ];
        let plain = polygon(&doorway).unwrap();
        let offsets = doorway.map(|p| DVec3::from_array(p) - DVec3::from_array(doorway[0]));
        let mean = DVec3::from_array(doorway[0]) + offsets.iter().sum::<DVec3>() / 4.0;
        assert_eq!(plain.center(), mean);
        // With corners along the lintel it is where it was.
        let lintel = (1..20).map(|k| {
            let [from, to] = [doorway[2], doorway[3]].map(DVec3::from_array);
            from.lerp(to, f64::from(k) / 20.0).to_array()
        });
        let corners: Vec<[f64; 3]> = doorway[..3].iter().copied().chain(lintel).collect();
        let with_lintel = polygon(&[&corners[..], &doorway[3..]].concat()).unwrap();
        assert_eq!(with_lintel.corners().len(), 23);
        assert!(with_lintel.center().distance(mean) < 1e-12);
        assert!(with_lintel.reversed().center().distance(mean) < 1e-12);
        // Of an L.
        let l = [
            [0.0, 0.0],
            [2.0, 0.0],
            [2.0, 1.0],
            [1.0, 1.0],
            [1.0, 3.0],
            [0.0, 3.0],
        ];
        let l = Polygon::new(l.map(|[x, y]| DVec3::new(x, y, 7.0)).to_vec()).unwrap();
        assert!(l.center().distance(DVec3::new(0.75, 1.25, 7.0)) < 1e-12);
    }

    #[test]
    fn what_is_inside_and_how_far_off_it_is() {
        // An L, far from the origin.
        let far = DVec3::new(5e5, 5e6, 100.0);
        let l = [
            [0.0, 0.0, 0.0],
            [2.0, 0.0, 0.0],
            [2.0, 1.0, 0.0],
            [1.0, 1.0, 0.0],
            [1.0, 3.0, 0.0],
            [0.0, 3.0, 0.0],
        ];
        let l = Polygon::new(l.iter().map(|p| far + DVec3::from_array(*p)).collect()).unwrap();
        assert!((l.normal() - DVec3::Z).length() < 1e-12);
        let covers = |x, y| l.covers(far + DVec3::new(x, y, 7.0), 0.0);
        assert!(covers(0.5, 2.0) && covers(1.5, 0.5) && !covers(1.5, 1.5));
        assert!(l.covers(far + DVec3::new(1.1, 2.0, 0.0), 0.2));
        for (x, y, z, expected) in [
            (0.5, 2.0, -7.0, 7.0),
            (1.5, 2.0, 0.0, 0.5),
            (1.5, 1.4, 0.3, 0.5),
            (-3.0, 7.0, 0.0, 5.0),
        ] {
            let found = l.distance(far + DVec3::new(x, y, z));
            assert!((found - expected).abs() < 1e-8, "{found} {expected}");
        }
    }
}
