//! Which source views see a proxy point, and which have something before it.

use crate::lumigraph::SourceView;
use crate::pyramid::MAX_LEVELS;
use calibrate::{Pixel, View};
use half::f16;
use proxy::{Proxy, Rays, Solid};
use std::fmt;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};

/// The fourth root of what is left of a source view that something hides a point from: of a
/// thousandth, which is nothing beside a view that sees it, and something where no view does.
/// There it counts how views stand to one another, so each power of ten from one to a thousandth
/// has about a third of the way: only so does a view that begins to see take over smoothly.
pub(crate) const HIDDEN_ROOT: f64 = 0.177_827_941_003_892_3;

/// How much farther than what a source view sees a point may lie, relatively, before it
/// starts to count as hidden. Meshes are not exact, and slanted surfaces change within a texel.
pub(crate) const TOLERANCE: f64 = 0.02;

/// How much farther still until it is hidden, in tolerances.
pub(crate) const FADE: f64 = 1.75;

/// How many times as far as the nearest a texel may be with its distance stored to a quarter of the
/// tolerance: the smallest numbers of 16 bits are 2⁻²⁴ apart.
const WIDEST: f64 = 1.6e5;

/// Where more are farther than one in so many, the first of those counts as far, and the unit is so
/// many times as near. That leaves it three digits, and what is a thousand times as far two; what is
/// more than six million times as near is stored as if it were not.
const FAR_SHARE: usize = 16;
const FAR_UNITS: f64 = 100.0;

/// The largest value stored; 16 bits hold it just as it is.
const MOST: f64 = 6e4;

/// What is more than so many times as near as what is a texel beside it takes that texel, too.
const MUCH_NEARER: f32 = 2.5;

/// Photo pixels a texel of a map, across and down, at least.
const REDUCTION: u32 = 2;

/// Twice as many where maps would have more texels along their longer side, and so on: surfaces are no finer
/// than the reduced photos that they were found from.
const LARGEST_SIDE: u32 = 1536;

/// How far the proxy is in each direction that a source view sees: a texel for some pixels.
#[derive(Clone, PartialEq)]
pub struct DistanceMap {
    /// In texels.
    pub size: [u32; 2],
    /// Photo pixels a texel, across and down: a power of two.
    pub reduction: u32,
    /// Row by row, 1/distance over [`Self::unit`]; zero where there is nothing. They fit 16 bits:
    /// at most one as a rule, and 6e4 where something all but touches the camera.
    ///
    /// Each is that of its own ray. Between a near texel and a far one what is filtered is nearer
    /// than the far one nearly all the way, so less than a texel beside something near counts as
    /// hidden by it. Not more may: what a photo shows beside a silhouette other photos nearby show
    /// beside it, too, and were none of them to count, what far ones show would be drawn there as a line.
    ///
    /// But beside something much nearer a texel has that thing's: of what is far behind it the photo has its blurred
    /// rim there, and from where the far place is drawn, that would be anywhere, an outline in the air.
    pub values: Vec<f32>,
    /// What the values are in units of, 1/world units.
    pub unit: f64,
    /// The largest of 2 × 2 values, of 4 × 4 and so on to the whole.
    largest: Vec<Vec<f32>>,
}

/// What the source views see of a proxy that can occlude itself, by way of a distance map
/// for each, made when first needed.
pub struct Visibility {
    id: u64,
    solid: Arc<Solid>,
    views: Vec<View>,
    /// [`DistanceMap::reduction`] of all.
    reduction: u32,
    /// Those of the first view, which as a rule has the lens that all have.
    rays: Option<Rays>,
    maps: Vec<OnceLock<DistanceMap>>,
}

impl Visibility {
    /// Tells it from every other in the program, for caches.
    pub(crate) fn id(&self) -> u64 {
        self.id
    }

    /// Of a proxy; `None` for one that cannot hide any part of itself.
    pub fn of(proxy: &Proxy, sources: &[SourceView]) -> Option<Self> {
        static NEXT_ID: AtomicU64 = AtomicU64::new(0);
        match proxy {
            Proxy::Mesh(solid) if solid.occludes() => {
                let views: Vec<View> = sources.iter().map(|s| s.view.clone()).collect();
                let reduction = reduction_of(&views);
                let rays = |view| Rays::reduced(view, reduction);
                Some(Self {
                    id: NEXT_ID.fetch_add(1, Ordering::Relaxed),
                    solid: Arc::clone(solid),
                    reduction,
                    rays: views.first().and_then(rays),
                    views,
                    maps: sources.iter().map(|_| OnceLock::new()).collect(),
                })
            }
            _ => None,
        }
    }

    /// Photo pixels a texel of the maps, across and down.
    pub(crate) fn reduction(&self) -> u32 {
        self.reduction
    }

    /// The map of a source view. It is made by the thread that first asks for it, alone, while others wait.
    pub fn map(&self, source_idx: usize) -> &DistanceMap {
        self.maps[source_idx].get_or_init(|| {
            let (view, first) = (&self.views[source_idx], &self.views[0]);
            let alike = |view: &View| (view.lens, view.width, view.height);
            if alike(view) == alike(first) {
                DistanceMap::new(&self.solid, view, self.rays.as_ref(), self.reduction)
            } else {
                let rays = Rays::reduced_alone(view, self.reduction);
                DistanceMap::new(&self.solid, view, rays.as_ref(), self.reduction)
            }
        })
    }
}

impl fmt::Debug for Visibility {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let made = self.maps.iter().filter(|m| m.get().is_some()).count();
        write!(f, "Visibility({made} of {} maps)", self.maps.len())
    }
}

impl DistanceMap {
    /// Finds what each texel, so many pixels across and down, sees, on this thread alone: by scanning along their
    /// rays, else ray by ray.
    fn new(solid: &Solid, view: &View, rays: Option<&Rays>, reduction: u32) -> Self {
        let size = [view.width, view.height].map(|side| side.div_ceil(reduction));
        let [width, height] = size.map(|side| side as usize);
        let scan = rays.map(|rays| (rays, solid.scan_alone(view, rays)));
        let center = view.center();
        let world_from_camera = view.camera_from_world.rotation.conjugate();
        let inverse_distance = |x: usize, y: usize| {
            if let Some((rays, scan)) = &scan {
                let ray = rays.at(x, y)?.extend(1.0);
                return Some(scan.inverse_depth[y * width + x] / ray.length());
            }
            let at = |i: usize| (i as f64 + 0.5) * f64::from(reduction);
            let ray = view.lens.unproject(Pixel::new(at(x), at(y)))?;
            let hit = solid.first_hit(center, world_from_camera * ray)?;
            Some(1.0 / (hit.along * ray.length()))
        };
        let row = |y: usize| -> Vec<f64> {
            let texel = |x| inverse_distance(x, y).unwrap_or(0.0);
            (0..width).map(texel).collect()
        };
        let rows: Vec<Vec<f64>> = (0..height).map(row).collect();

        Self::of(size, &rows, reduction)
    }

    /// Of the inverse distances of texels, row by row.
    fn of(size: [u32; 2], rows: &[Vec<f64>], reduction: u32) -> Self {
        // The unit keeps the values within what 16 bits hold.
        let unit = unit_of(rows);
        let stored = |value: &f64| f16::from_f64((value / unit).min(MOST)).to_f32();
        let values: Vec<f32> = rows.iter().flatten().map(stored).collect();
        let values = with_rims(&values, size[0] as usize);
        Self {
            size,
            reduction,
            largest: largest_of(&values, size[0] as usize),
            values,
            unit,
        }
    }

    /// At least the inverse distance in every direction between two corners of a rectangle of
    /// pixels of the photo.
    pub(crate) fn largest_within(&self, [left, top]: [f64; 2], [right, bottom]: [f64; 2]) -> f64 {
        // Filtering takes in the texels beside.
        let texel = |at: f64, beside: f64, side: u32| {
            (at / f64::from(self.reduction) + beside).clamp(0.0, f64::from(side - 1)) as usize
        };
        let [width, height] = self.size;
        let (mut x0, mut x1) = (texel(left, -0.5, width), texel(right, 0.5, width));
        let (mut y0, mut y1) = (texel(top, -0.5, height), texel(bottom, 0.5, height));
        // As fine as a few texels allow.
        const ACROSS: usize = 4;
        let (mut values, mut columns) = (&self.values, width as usize);
        let mut coarser = self.largest.iter();
        while x1 - x0 >= ACROSS || y1 - y0 >= ACROSS {
            let Some(next) = coarser.next() else { break };
            (x0, x1, y0, y1) = (x0 / 2, x1 / 2, y0 / 2, y1 / 2);
            (values, columns) = (next, columns.div_ceil(2));
        }
        let rows = (y0..=y1).map(|y| &values[y * columns + x0..=y * columns + x1]);
        self.unit * f64::from(rows.flatten().copied().fold(0.0, f32::max))
    }

    /// The inverse distance in a direction, given by a pixel of the photo; bilinear.
    pub(crate) fn inverse_distance(&self, pixel: Pixel) -> f64 {
        let reduction = f64::from(self.reduction);
        self.unit
            * f64::from(self.sample((pixel.x / reduction) as f32, (pixel.y / reduction) as f32))
    }

    /// The value at a position in texels.
    pub(crate) fn sample(&self, x: f32, y: f32) -> f32 {
        let [width, height] = self.size;
        let (x, y) = (x - 0.5, y - 0.5);
        let (left, top) = (x.floor(), y.floor());
        let (fx, fy) = (x - left, y - top);
        let column = |x: f32| x.clamp(0.0, (width - 1) as f32) as usize;
        let row = |y: f32| y.clamp(0.0, (height - 1) as f32) as usize * width as usize;
        let (x0, x1, y0, y1) = (column(left), column(left + 1.0), row(top), row(top + 1.0));
        let across = |y: usize| {
            let (a, b) = (self.values[y + x0], self.values[y + x1]);
            a + fx * (b - a)
        };
        let (upper, lower) = (across(y0), across(y1));
        upper + fy * (lower - upper)
    }
}

/// How many pixels a texel has, across and down, in the maps of these views: the same for all, as devices sample
/// them by their photos' places, and by the smallest, whose texels are then none too large.
fn reduction_of(views: &[View]) -> u32 {
    let sides = views.iter().map(|view| view.width.max(view.height));
    let least = sides.min().unwrap_or(0);
    let mut reduction = REDUCTION;
    while least.div_ceil(reduction) > LARGEST_SIDE && reduction < 1 << (MAX_LEVELS - 1) {
        reduction *= 2;
    }
    reduction
}

/// The values of a map that is so wide, where something much nearer is beside them, that. Nothing stays nothing.
fn with_rims(values: &[f32], width: usize) -> Vec<f32> {
    // The greatest of three across, then of three of those down.
    let across = |row: &[f32]| -> Vec<f32> {
        let beside = |x: usize| row[x.saturating_sub(1)..(x + 2).min(width)].iter();
        let greatest = |x: usize| beside(x).copied().fold(0.0, f32::max);
        (0..width).map(greatest).collect()
    };
    let rows: Vec<Vec<f32>> = values.chunks(width).map(across).collect();
    let beside = |x: usize, y: usize| {
        let rows = rows[y.saturating_sub(1)..(y + 2).min(rows.len())].iter();
        rows.map(|row| row[x]).fold(0.0, f32::max)
    };
    let with_rim = |(i, &value): (usize, &f32)| {
        let greatest = beside(i % width, i / width);
        match value > 0.0 && greatest > MUCH_NEARER * value {
            true => greatest,
            false => value,
        }
    };
    values.iter().enumerate().map(with_rim).collect()
}

/// What inverse distances are stored in units of: the nearest, or less where that is so near that
/// 16 bits would not tell the rest from nothing.
fn unit_of(rows: &[Vec<f64>]) -> f64 {
    let seen = || rows.iter().flatten().copied().filter(|s| *s > 0.0);
    // On the proxy itself it is infinite.
    let nearest = seen().filter(|s| s.is_finite()).fold(0.0, f64::max);
    if nearest == 0.0 {
        return 1.0;
    }
    if nearest <= WIDEST * seen().fold(f64::INFINITY, f64::min) {
        return nearest;
    }
    // Rather than the farthest of all, which may be a speck at the horizon.
    let mut all: Vec<f64> = seen().collect();
    let rank = all.len() / FAR_SHARE;
    let (_, &mut far, _) = all.select_nth_unstable_by(rank, f64::total_cmp);
    if nearest <= WIDEST * far {
        nearest
    } else {
        FAR_UNITS * far
    }
}

/// The largest of 2 × 2 values of a map that is so wide, of 2 × 2 of those, and so on to the whole.
fn largest_of(values: &[f32], mut width: usize) -> Vec<Vec<f32>> {
    let mut levels: Vec<Vec<f32>> = Vec::new();
    loop {
        let last = levels.last().map_or(values, Vec::as_slice);
        let height = last.len() / width;
        if last.len() <= 1 {
            return levels;
        }
        let columns = width.div_ceil(2);
        let mut next = vec![0.0_f32; columns * height.div_ceil(2)];
        for (i, &value) in last.iter().enumerate() {
            let largest = &mut next[(i / width / 2) * columns + i % width / 2];
            *largest = largest.max(value);
        }
        levels.push(next);
        width = columns;
    }
}

/// How much of a source view counts at a point at the given inverse distance from it, in a
/// direction in which the proxy's is `nearest`.
pub(crate) fn visible(inverse_distance: f64, nearest: f64) -> f64 {
    // Multiplied through by `nearest`: at infinity both are zero.
    let slack = nearest * TOLERANCE;
    let beyond = nearest - inverse_distance;
    if beyond <= slack {
        return 1.0;
    }
    let r = ((beyond - slack) / (FADE * slack)).clamp(0.0, 1.0);
    let root = 1.0 - (1.0 - HIDDEN_ROOT) * r * r * (3.0 - 2.0 * r);
    (root * root) * (root * root)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A map of a wall at a distance, but for some texels in the upper left corner.
    fn map(distance: f64, corner: usize, inverse_distance: f64) -> DistanceMap {
        let at = |x: usize, y: usize| match x.max(y) < corner {
            true => inverse_distance,
            false => 1.0 / distance,
        };
        let row = |y| (0..32).map(|x| at(x, y)).collect();
        let rows: Vec<Vec<f64>> = (0..24).map(row).collect();
        DistanceMap::of([32, 24], &rows, REDUCTION)
    }

    #[test]
    fn the_unit_is_the_nearest() {
        for inverse_distance in [0.0, 0.3, 1.0, 1e4] {
            let map = map(5.0, 3, inverse_distance);
            assert_eq!(map.unit, inverse_distance.max(0.2));
            let value = |s: f64| f16::from_f64(s / map.unit).to_f32();
            assert_eq!(map.values[0], value(inverse_distance));
            assert_eq!(map.values[31], value(0.2));
        }
        // Nor does a speck at the horizon change it.
        let map = map(5.0, 1, 1e-9);
        assert_eq!(map.unit, 0.2);
        assert_eq!(
            DistanceMap::of([2, 1], &[vec![0.0; 2]], REDUCTION).unit,
            1.0
        );
    }

    #[test]
    fn maps_of_large_photos_have_larger_texels() {
        let view = |width: u32, height: u32| View {
            lens: calibrate::Lens::pinhole(glam::DVec2::splat(100.0), glam::DVec2::splat(50.0)),
            width,
            height,
            camera_from_world: calibrate::Rigid3::IDENTITY,
        };
        let of = |sizes: &[(u32, u32)]| {
            let views: Vec<View> = sizes.iter().map(|&(w, h)| view(w, h)).collect();
            reduction_of(&views)
        };
        assert_eq!(of(&[]), 2);
        assert_eq!([of(&[(3072, 64)]), of(&[(64, 3073)])], [2, 4]);
        assert_eq!([of(&[(6144, 4096)]), of(&[(6145, 4096)])], [4, 8]);
        // As the smallest ask for.
        assert_eq!(of(&[(8000, 6000), (640, 480)]), 2);
        // The coarsest that devices have.
        assert_eq!(of(&[(u32::MAX, 1)]), 64);
    }

    #[test]
    fn what_lies_beside_something_nearer_is_seen() {
        // Four texels are eight pixels of the photo.
        let map = map(5.0, 4, 0.4);
        let at = |x: f64, distance: f64| {
            let nearest = map.inverse_distance(Pixel::new(x, 3.0));
            visible(1.0 / distance, nearest)
        };
        // The wall, right behind its edge and up to half a texel beyond; what is before it, up to there.
        for x in [1.0, 5.0, 7.0, 8.0, 8.5] {
            assert!(at(x, 5.0) < 2e-3, "{x}: {}", at(x, 5.0));
            assert_eq!(at(x, 2.5), 1.0, "{x}");
        }
        for x in [9.0, 10.0, 11.0, 20.0] {
            assert_eq!(at(x, 5.0), 1.0, "{x}");
        }
    }

    #[test]
    fn what_lies_beside_something_much_nearer_is_its_rim() {
        let at = |nearer: f64, x: f64| {
            let nearest = map(5.0, 4, nearer / 5.0).inverse_distance(Pixel::new(x, 3.0));
            visible(0.2, nearest)
        };
        for x in [7.0, 9.0, 10.0] {
            assert!(at(2.6, x) < 2e-3, "{x}: {}", at(2.6, x));
        }
        assert_eq!(at(2.4, 9.0), 1.0);
        for x in [11.0, 20.0] {
            assert_eq!(at(2.6, x), 1.0, "{x}");
        }
        // Nothing has no place before which anything is.
        let values = [0.0, 1.0, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1];
        let rimmed = [0.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.1, 0.1, 0.1];
        assert_eq!(with_rims(&values, 3), rimmed);
    }

    #[test]
    fn a_camera_that_touches_the_proxy_does_not_see_through_the_rest() {
        for distance in [0.05, 5.0, 5e6] {
            for nearer in [1e4, 1e5, 1e6, 1e8, 1e12, f64::INFINITY] {
                for corner in [1, 4, 12, 20] {
                    let map = map(distance, corner, nearer / distance);
                    let stored = map.inverse_distance(Pixel::new(62.0, 46.0));
                    assert!((stored * distance - 1.0).abs() < 0.3 * TOLERANCE);
                    assert_eq!(visible(1.0 / distance, stored), 1.0);
                    assert!(visible(0.9 / distance, stored) < 1e-2);
                    // The corner hides what is behind it.
                    let near = map.inverse_distance(Pixel::new(1.0, 1.0));
                    assert!(near.is_finite() && visible(1.0 / distance, near) < 1e-2);
                    assert!(visible(nearer / distance, near) > 0.99);
                    assert!(map.values.iter().all(|v| f64::from(*v) <= MOST));
                    assert!(map.largest_within([0.0, 0.0], [60.0, 40.0]) >= near);
                }
            }
        }
    }
}
