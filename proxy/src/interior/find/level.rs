//! Which way is up, how high the floor is, and which way walls run.

use super::columns::LEAST_CEILING;
use super::{Evidence, FindError, FindOptions};
use glam::{DMat3, DVec2, DVec3};

/// The frame of a storey: two axes along its walls, the third up; its origin on the floor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Level {
    /// A point of the floor, in the world.
    pub origin: DVec3,
    /// The axes as columns: right-handed, unit length.
    pub world_from_level: DMat3,
}

impl Level {
    /// Up, in the world.
    pub fn up(&self) -> DVec3 {
        self.world_from_level.z_axis
    }

    /// How far a point is over the floor, in world units.
    pub fn height(&self, point: DVec3) -> f64 {
        (point - self.origin).dot(self.up())
    }

    /// A point of the world in this frame: along both walls, and over the floor.
    pub fn to_level(&self, point: DVec3) -> DVec3 {
        self.world_from_level.transpose() * (point - self.origin)
    }

    /// A place on the plan and a height over the floor, in the world.
    pub fn to_world(&self, place: DVec2, height: f64) -> DVec3 {
        self.origin + self.direction(place) + height * self.up()
    }

    /// A direction on the plan, in the world.
    pub fn direction(&self, along: DVec2) -> DVec3 {
        self.world_from_level * along.extend(0.0)
    }
}

/// A triangle, as far as it matters here.
struct Facet {
    normal: DVec3,
    area: f64,
    /// Relative to the mesh's first bound.
    middle: DVec3,
}

/// Normals that are this near to a direction are of surfaces across it.
const NEAR: f64 = 8.0;
/// A direction that a file format or cameras say is right if this much lies across it,
/// compared with the best.
const TRUST: f64 = 0.4;
/// Cameras agree on what is up if their mean is longer.
const AGREED: f64 = 0.3;
/// Where the best has so many times as much, it is told, if rooms would not be as high as most; if they would
/// be either way, from so much on. Corridors and narrow houses have more wall than floor, too.
const DOUBT: f64 = 1.3;
const FAR_BETTER: f64 = 2.0;
/// Most rooms are no higher; metres.
const USUAL: f64 = 3.65;
/// Planes with so much of what the fullest bin has may be a floor and a ceiling.
const FULL: f64 = 0.25;
/// Heights of planes that are compared are kept in bins of this; metres.
const BIN: f64 = 0.1;

/// Directions this near to an axis of the world are that axis; radians.
const SAME_AXIS: f64 = 0.003;

fn as_world_axis(direction: DVec3) -> DVec3 {
    let axes = [DVec3::X, DVec3::Y, DVec3::Z].into_iter();
    let near = axes
        .flat_map(|a| [a, -a])
        .find(|a| a.dot(direction) > SAME_AXIS.cos());
    near.unwrap_or(direction)
}

/// A storey's frame, and what speaks against it.
pub(super) struct Estimate {
    pub(super) level: Level,
    /// What speaks against up, where that is taken to be y for no other reason than habit.
    pub(super) better: Option<Better>,
}

/// A direction that more lies across than across up.
pub(super) struct Better {
    pub(super) direction: DVec3,
    /// Whether rooms would not be as high as most, or far more may be floor; else it is to be told if rooms have
    /// little of the model.
    pub(super) is_likely: bool,
}

pub(super) fn estimate(evidence: &Evidence, options: &FindOptions) -> Result<Estimate, FindError> {
    let mesh = evidence.mesh;
    let finite = mesh.positions.iter().filter(|p| p.is_finite());
    let base = finite
        .copied()
        .reduce(DVec3::min)
        .ok_or(FindError::NoSurface)?;
    let facet = |i: usize| {
        let [a, b, c] = mesh.corners(i);
        let across = (b - a).cross(c - a);
        let area = 0.5 * across.length();
        (area > 0.0 && area.is_finite()).then(|| Facet {
            normal: across.normalize(),
            area,
            middle: (a + b + c) / 3.0 - base,
        })
    };
    let facets: Vec<Facet> = (0..mesh.triangles.len()).filter_map(facet).collect();
    if facets.is_empty() {
        return Err(FindError::NoSurface);
    }
    let (up, better) = up(&facets, evidence, options);
    let up = as_world_axis(up);
    let (height, has_floor) = floor(&facets, up, base, evidence, options);
    if !has_floor {
        return Err(FindError::NoFloor(options.meter));
    }
    let along = as_world_axis(wall_direction(&facets, up));
    let along = along.reject_from_normalized(up).normalize();
    let axes = DMat3::from_cols(along, up.cross(along), up);
    let level = Level {
        origin: base + height * up,
        world_from_level: axes,
    };
    Ok(Estimate { level, better })
}

/// Where normals near a direction, either way round, point on average.
fn refined(facets: &[Facet], direction: DVec3) -> DVec3 {
    let mut best = direction;
    for degrees in [20.0_f64, 10.0, 5.0, 3.0, 3.0] {
        let least = degrees.to_radians().cos();
        let near = facets.iter().filter_map(|f| {
            let cos = f.normal.dot(best);
            (cos.abs() >= least).then(|| f.area * cos.signum() * f.normal)
        });
        let mean: DVec3 = near.sum();
        best = mean.try_normalize().unwrap_or(best);
    }
    best
}

/// The area of the two fullest planes across a direction: floors and ceilings are few and
/// large, while walls are on many planes.
fn level_area(facets: &[Facet], direction: DVec3, bin: f64) -> f64 {
    let (_, _, bins) = heights(facets, direction, bin);
    let mut sums: Vec<f64> = (0..bins.len())
        .map(|i| bins[i] + bins.get(i + 1).copied().unwrap_or(0.0))
        .collect();
    let mut total = 0.0;
    for _ in 0..2 {
        let top = (0..sums.len()).fold(0, |b, i| if sums[i] > sums[b] { i } else { b });
        total += sums.get(top).copied().unwrap_or(0.0);
        let end = sums.len().min(top + 2);
        sums[top.saturating_sub(1)..end].fill(0.0);
    }
    total
}

const MOST_BINS: usize = 1 << 16;

/// The area of surfaces across a direction, by height; before it the height of the first bin, and how high bins
/// are: as asked, unless that makes too many.
fn heights(facets: &[Facet], direction: DVec3, bin: f64) -> (f64, f64, Vec<f64>) {
    let all = facets.iter().map(|f| f.middle.dot(direction));
    let (low, high) = all.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| {
        (l.min(x), h.max(x))
    });
    let bin = bin.max((high - low) / MOST_BINS as f64);
    let mut bins = vec![0.0; ((high - low) / bin) as usize + 1];
    let least = NEAR.to_radians().cos();
    for f in facets
        .iter()
        .filter(|f| f.normal.dot(direction).abs() >= least)
    {
        bins[((f.middle.dot(direction) - low) / bin) as usize] += f.area;
    }
    (low, bin, bins)
}

/// How high rooms are if a direction is up: how far apart full planes across it are.
struct RoomHeights {
    /// Of the two that are farthest apart; metres.
    most: f64,
    /// Whether any two are as most floors and ceilings.
    is_usual: bool,
}

impl RoomHeights {
    fn new(facets: &[Facet], up: DVec3, meter: f64) -> Self {
        let (_, bin, bins) = heights(facets, up, BIN * meter);
        let step = bin / meter;
        let fullest = bins.iter().copied().fold(0.0, f64::max);
        let is_full = |i: usize| bins.get(i).is_some_and(|area| *area >= FULL * fullest);
        let full: Vec<usize> = (0..bins.len()).filter(|i| is_full(*i)).collect();
        let [first, last] = [full.first(), full.last()].map(|i| i.copied().unwrap_or(0));
        let [low, high] = [(LEAST_CEILING / step).ceil(), (USUAL / step).floor()];
        let has_ceiling = |i: &usize| (i + low as usize..=i + high as usize).any(is_full);
        Self {
            most: step * (last - first) as f64,
            is_usual: full.iter().any(has_ceiling),
        }
    }
}

/// Whether rooms may lie on their side with a direction up that less lies across than a rival, and how much.
fn is_likely(
    facets: &[Facet],
    (up, area): (DVec3, f64),
    (rival, most): (DVec3, f64),
    meter: f64,
) -> bool {
    let [own, other] = [up, rival].map(|up| RoomHeights::new(facets, up, meter));
    let is_far_better = other.is_usual && most > FAR_BETTER * area;
    other.most >= LEAST_CEILING && (!own.is_usual || is_far_better)
}

/// Which way was up for cameras ([`Evidence::cameras`]), unit length; `None` where they do not agree.
pub fn up_of_cameras(cameras: &[(DVec3, DVec3)]) -> Option<DVec3> {
    let sum: DVec3 = cameras.iter().map(|(_, up)| *up).sum();
    let agreed = sum.length() > AGREED * cameras.len() as f64;
    sum.try_normalize().filter(|_| agreed)
}

/// Up: given, as cameras had it, or the direction that most floor lies across; y, if that is
/// about as good, and then the best one, if that is far better.
fn up(facets: &[Facet], evidence: &Evidence, options: &FindOptions) -> (DVec3, Option<Better>) {
    let bin = BIN * options.meter;
    if let Some(up) = options.up.and_then(DVec3::try_normalize) {
        return match refined(facets, up) {
            // What was said is meant, but nobody says it to the last digit.
            near if near.dot(up) > 0.99 && level_area(facets, near, bin) > 0.0 => (near, None),
            _ => (up, None),
        };
    }
    // 1. The best direction: of normals of large areas, each tried once.
    let mut best = (DVec3::Y, -1.0);
    let mut tried: Vec<DVec3> = Vec::new();
    let mut order: Vec<usize> = (0..facets.len()).collect();
    order.sort_by(|a, b| facets[*b].area.total_cmp(&facets[*a].area));
    for i in order.into_iter().take(4000) {
        let normal = facets[i].normal;
        let is_new = !tried.iter().any(|t| t.dot(normal).abs() > 0.97);
        if is_new && tried.len() < 64 {
            tried.push(normal);
            let direction = refined(facets, normal);
            let area = level_area(facets, direction, bin);
            if area > best.1 {
                best = (direction, area);
            }
        }
    }
    // 2. What cameras, or the habit of files, say.
    let cameras = up_of_cameras(evidence.cameras);
    let hint = cameras.unwrap_or(DVec3::Y);
    let near = refined(facets, hint);
    let area = level_area(facets, near, bin);
    if near.dot(hint) > 0.9 && area >= TRUST * best.1 {
        let is_better = evidence.cameras.is_empty() && best.1 > DOUBT * area;
        let better = is_better.then(|| Better {
            direction: as_world_axis(best.0),
            is_likely: is_likely(facets, (near, area), best, options.meter),
        });
        return (near, better);
    }
    if cameras.is_some() {
        let up = match best.0.dot(hint) {
            cos if cos.abs() > 0.7 => best.0 * cos.signum(),
            _ => hint,
        };
        return (up, None);
    }
    // 3. Things stand on the floor: more is below the middle than above.
    let direction = best.0;
    let (low, high) = facets
        .iter()
        .map(|f| f.middle.dot(direction))
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| {
            (l.min(x), h.max(x))
        });
    let inner = 0.04 * (high - low);
    let between = facets.iter().filter_map(|f| {
        let at = f.middle.dot(direction);
        (at > low + inner && at < high - inner).then_some((f.area, at))
    });
    let (area, moment) = between.fold((0.0, 0.0), |(s, m), (a, at)| (s + a, m + a * at));
    let is_down = area > 0.0 && moment / area > 0.5 * (low + high);
    (if is_down { -direction } else { direction }, None)
}

/// The floor's height over the base: the fullest level surface, under the cameras or in the
/// lower half; and whether there is one.
fn floor(
    facets: &[Facet],
    up: DVec3,
    base: DVec3,
    evidence: &Evidence,
    options: &FindOptions,
) -> (f64, bool) {
    let bin = 0.02 * options.meter;
    let (low, bin, bins) = heights(facets, up, bin);
    let high = facets.iter().map(|f| f.middle.dot(up)).fold(low, f64::max);
    let mut eyes: Vec<f64> = evidence
        .cameras
        .iter()
        .map(|(c, _)| (*c - base).dot(up))
        .collect();
    eyes.sort_by(f64::total_cmp);
    let (from, to) = match eyes.get(eyes.len() / 2) {
        // Under whoever holds a camera.
        Some(eye) => (eye - 2.4 * options.meter, eye - 0.5 * options.meter),
        None => (low, 0.5 * (low + high) + bin),
    };
    let reach = 2;
    let around = |i: usize| {
        let range = i.saturating_sub(reach)..bins.len().min(i + reach + 1);
        bins[range].iter().sum::<f64>()
    };
    let at = |i: usize| low + (i as f64 + 0.5) * bin;
    let within: Vec<usize> = (0..bins.len())
        .filter(|i| at(*i) >= from - bin && at(*i) <= to)
        .collect();
    let best = within
        .iter()
        .copied()
        .reduce(|best, i| if around(i) > around(best) { i } else { best });
    let Some(best) = best.filter(|i| around(*i) > 0.0) else {
        return (0.0, false);
    };
    // Its mean height.
    let near = NEAR.to_radians().cos();
    let close = facets.iter().filter(|f| {
        f.normal.dot(up).abs() >= near
            && (f.middle.dot(up) - at(best)).abs() <= (reach as f64 + 0.5) * bin
    });
    let (area, moment) = close.fold((0.0, 0.0), |(s, m), f| {
        (s + f.area, m + f.area * f.middle.dot(up))
    });
    (moment / area, area > 0.0)
}

/// The direction that most walls run along or across: angles count by four times themselves.
fn wall_direction(facets: &[Facet], up: DVec3) -> DVec3 {
    // The world's axis that is least upright, so that nothing turns where walls agree with it.
    let axes = [DVec3::X, DVec3::Z, DVec3::Y];
    let first = axes
        .into_iter()
        .min_by(|a, b| a.dot(up).abs().total_cmp(&b.dot(up).abs()))
        .unwrap_or(DVec3::X);
    let x = first.reject_from_normalized(up).normalize();
    let y = up.cross(x);
    let angle_of = |n: DVec3| n.dot(y).atan2(n.dot(x));
    let walls = || {
        facets
            .iter()
            .filter(|f| f.normal.dot(up).abs() < (90.0_f64 - 15.0).to_radians().cos())
    };
    // 1. The fullest degree of ninety, with its neighbours.
    let mut degrees = [0.0; 90];
    for f in walls() {
        let degree = angle_of(f.normal).to_degrees().rem_euclid(90.0);
        degrees[(degree.round() as usize) % 90] += f.area;
    }
    let smooth = |i: usize| degrees[(i + 89) % 90] + 2.0 * degrees[i] + degrees[(i + 1) % 90];
    let best = (0..90).fold(0, |b, i| if smooth(i) > smooth(b) { i } else { b });
    // 2. The mean around it.
    let (sum, weight) = walls().fold((0.0, 0.0), |(s, w), f| {
        let off = (angle_of(f.normal).to_degrees() - best as f64 + 45.0).rem_euclid(90.0) - 45.0;
        match off.abs() < 3.0 {
            true => (s + f.area * off, w + f.area),
            false => (s, w),
        }
    });
    let degrees = match weight > 0.0 {
        true => best as f64 + sum / weight,
        false => 0.0,
    };
    let turn = (degrees + 45.0).rem_euclid(90.0) - 45.0;
    let (sin, cos) = turn.to_radians().sin_cos();
    (cos * x + sin * y).normalize()
}
