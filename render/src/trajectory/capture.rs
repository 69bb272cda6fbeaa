//! What a path needs to know of a capture's geometry.

use super::ring::Ring;
use super::upright::fitted;
use super::{PI, Standing, gaze};
use crate::lumigraph::SourceView;
use crate::path::{fitted_rotation, mean_rotation};
use calibrate::{Rigid3, View, outer, principal_axes};
use glam::{DMat3, DQuat, DVec3};
use proxy::{PLACE_ROUNDING, Proxy, geometric_median};

/// Positions here are relative to the reference camera's centre, axes are the world's.
pub(super) struct Capture {
    /// The reference camera's centre.
    pub(super) origin_in_world: DVec3,
    pub(super) centers: Vec<DVec3>,
    /// Where most photos have it in the world; see [`Standing`].
    up: Option<DVec3>,
    /// `camera_from_world`, as they stand upright, their z axes what photos have in the middle.
    rotations: Vec<DQuat>,
    /// The camera nearest to the middle of them all.
    reference_idx: usize,
    /// Principal axes of the centres, the longest first; right-handed.
    pub(super) axes: [DVec3; 3],
    /// Half of the range of the centres along each.
    pub(super) half_extents: [f64; 3],
    /// Whether they lie further apart than rounding errors, and than the scene would show.
    has_extent: bool,
    /// The median focal length, in shares of the photos' longer sides.
    relative_focal: f64,
    /// Distance to the third-nearest camera, in the median.
    pub(super) spacing: f64,
    /// What the reference camera looks at.
    pub(super) focus: DVec3,
    /// The distance to the nearer of proxy and median point ahead of it.
    pub(super) nearest_scene: f64,
}

/// Cameras nearer to one another than this, in shares of their distance from the middle one, in the median, are
/// at one place.
const SAME_PLACE: f64 = 1e-4;
/// So are all of them where half of their range is no more than this, in shares of the distance to the scene: in
/// a picture of 1000 pixels that is a thousandth of one.
const ONE_PLACE: f64 = 1e-6;
/// Lenses whose focal length is so many times the photos' longer side, or more, are long: they see 23° or less.
/// The mean rotation of cameras about a place near the end of a row is that of a place farther in, which may differ by
/// more than they see. Wider ones show much the same, and the mean is smoother than a fit.
const LONG: f64 = 2.5;
/// The sine of 25°: a camera that looks straight up or down but for that need not be level to stand as the photos do, nor
/// one beside it, which looks at the same place another way.
const STEEP: f64 = 0.42;
/// Photos look at a place that is no farther from their middles than this, in the median, in shares of their longer
/// sides: a third of the way to the nearer border, of 4 : 3. For photos that go around one thing it is 0 (renderings) to 0.07
/// (held in hand), for those of rooms and of a street 0.2 and more.
const AIMED: f64 = 0.125;
/// More than this many are thinned out where all pairs are looked at.
const MANY: usize = 512;

impl Capture {
    pub(super) fn new(
        sources: &[SourceView],
        standing: &Standing,
        points_in_world: &[DVec3],
        proxy: &Proxy,
    ) -> Self {
        // 1. The middle, robustly, and the camera nearest to it.
        let first = sources[0].view.center();
        let centers: Vec<DVec3> = sources.iter().map(|s| s.view.center() - first).collect();
        let reference_idx = nearest(&centers, geometric_median(&centers));
        let reference = &sources[reference_idx].view;
        let origin_in_world = reference.center();
        let centers: Vec<DVec3> = sources
            .iter()
            .map(|s| s.view.center() - origin_in_world)
            .collect();
        let rotation = standing.photos[reference_idx].rotation;
        let forward = rotation.conjugate() * DVec3::Z;

        // 2. Principal axes. Ties are broken in favour of the reference camera's x axis,
        // signs by it and by its y axis.
        let mean = centers.iter().sum::<DVec3>() / centers.len() as f64;
        let right = rotation.conjugate() * DVec3::X;
        let mut covariance = DMat3::ZERO;
        for c in &centers {
            covariance += outer(*c - mean);
        }
        let trace = covariance.x_axis.x + covariance.y_axis.y + covariance.z_axis.z;
        covariance += outer(right) * (0.01 * trace);
        let mut axes = principal_axes(covariance).map(|(_, v)| v);
        let signed = |v: DVec3, like: DVec3| if v.dot(like) < 0.0 { -v } else { v };
        axes[0] = signed(axes[0], right + 0.5 * forward);
        axes[1] = signed(axes[1], rotation.conjugate() * (DVec3::Y + 0.5 * DVec3::Z));
        axes[2] = axes[0].cross(axes[1]);
        let half_extents = axes.map(|a| {
            let along = || centers.iter().map(|c| c.dot(a));
            0.5 * (along().fold(f64::NEG_INFINITY, f64::max)
                - along().fold(f64::INFINITY, f64::min))
        });
        let farthest = centers.iter().map(|c| c.length()).fold(0.0, f64::max);
        let rounding = PLACE_ROUNDING * origin_in_world.length();

        // 3. How far the scene is ahead of the reference camera.
        let (to_points, to_proxy) = distances_ahead(reference, forward, points_in_world, proxy);
        // With nothing ahead, as far as the capture is wide.
        let unknown = if farthest > rounding {
            2.0 * farthest
        } else {
            1.0
        };
        let distance = to_points.or(to_proxy).unwrap_or(unknown);

        Self {
            origin_in_world,
            rotations: standing.photos.iter().map(|one| one.rotation).collect(),
            up: standing.up,
            reference_idx,
            axes,
            half_extents,
            has_extent: half_extents[0] > rounding.max(ONE_PLACE * distance) && farthest > 0.0,
            relative_focal: relative_focal(sources).unwrap_or(1.0),
            spacing: spacing(&centers),
            focus: forward * distance,
            nearest_scene: to_proxy.map_or(distance, |d| d.min(distance)),
            centers,
        }
    }

    pub(super) fn has_extent(&self) -> bool {
        self.has_extent
    }

    /// The reference camera's pose as it stands upright, its centre the origin.
    pub(super) fn reference_pose(&self) -> Rigid3 {
        Rigid3::new(self.rotations[self.reference_idx], DVec3::ZERO)
    }

    pub(super) fn reference_up(&self) -> DVec3 {
        self.rotations[self.reference_idx].conjugate() * DVec3::NEG_Y
    }

    /// Up for cameras about the reference camera that look much as it does: across what is level in photos, or
    /// where it looks steeply up or down as it has it.
    pub(super) fn up_at_reference(&self) -> DVec3 {
        let forward = self.rotations[self.reference_idx].conjugate() * DVec3::Z;
        let up = self.up.and_then(|up| fitted(&self.rotations, up));
        up.filter(|up| forward.cross(*up).length() > STEEP)
            .unwrap_or_else(|| self.reference_up())
    }

    pub(super) fn distance_to_nearest(&self, at: DVec3) -> f64 {
        let distances = self.centers.iter().map(|c| c.distance(at));
        distances.fold(f64::INFINITY, f64::min)
    }

    /// Gaussian weights of the cameras about a place, by index. The window is as wide as
    /// the cameras are sparse: it holds a few wherever it is.
    fn weights(&self, at: DVec3) -> Vec<f64> {
        let squares: Vec<f64> = self
            .centers
            .iter()
            .map(|c| c.distance_squared(at))
            .collect();
        let mut sorted = squares.clone();
        let third = 2.min(sorted.len() - 1);
        let third_nearest = *sorted.select_nth_unstable_by(third, f64::total_cmp).1;
        let width = third_nearest.max(self.spacing * self.spacing);
        // At a place where all cameras are, each counts as much as any.
        let width = width.max(f64::MIN_POSITIVE);
        squares.iter().map(|s| (-0.5 * s / width).exp()).collect()
    }

    pub(super) fn mean_center(&self, at: DVec3) -> DVec3 {
        let weights = self.weights(at);
        let weighted = self.centers.iter().zip(&weights).map(|(&c, &w)| c * w);
        weighted.sum::<DVec3>() / weights.iter().sum::<f64>()
    }

    /// The mean rotation of the cameras about a place that look much the same way as
    /// `like` does; of long lenses as it is at that place along the longest axis.
    pub(super) fn mean_rotation(&self, at: DVec3, like: DQuat) -> DQuat {
        let forward = |q: DQuat| q.conjugate() * DVec3::Z;
        let ahead = forward(like);
        let weighted: Vec<(f64, DQuat)> = self
            .weights(at)
            .into_iter()
            .zip(&self.rotations)
            .map(|(w, &q)| (w * (4.0 * (forward(q).dot(ahead) - 1.0)).exp(), q))
            .collect();
        let mean = if self.relative_focal >= LONG {
            let along = self.centers.iter().map(|c| (*c - at).dot(self.axes[0]));
            let placed = weighted.iter().zip(along).map(|(&(w, q), x)| (w, x, q));
            fitted_rotation(&placed.collect::<Vec<_>>())
        } else {
            mean_rotation(&weighted)
        };
        mean.unwrap_or(like)
    }

    /// Whether most photos have a place about their middle; see [`AIMED`].
    pub(super) fn is_looked_at(&self, place: DVec3) -> bool {
        let cameras = self.centers.iter().zip(&self.rotations);
        let off = |(c, q): (&DVec3, &DQuat)| (*q * (place - *c)).angle_between(DVec3::Z);
        let off = median(cameras.map(off).collect());
        off.is_some_and(|off| off * self.relative_focal <= AIMED)
    }

    /// The ring of cameras around an object, if that is what they are: most look at one
    /// place, from directions more than 120° apart; those of cameras that look down on it may be
    /// nearer to one another, if they are so far apart in plan with others in between.
    pub(super) fn ring(&self) -> Option<Ring> {
        let forwards: Vec<DVec3> = self
            .rotations
            .iter()
            .map(|q| q.conjugate() * DVec3::Z)
            .collect();
        let count = forwards.len() as f64;

        // 1. The place nearest to all optical axes: Σ (I − ddᵀ)(x − c) = 0.
        let (mut a, mut b) = (DMat3::ZERO, DVec3::ZERO);
        for (d, c) in forwards.iter().zip(&self.centers) {
            let across = DMat3::IDENTITY - outer(*d);
            a += across;
            b += across * *c;
        }
        let [_, _, (smallest, _)] = principal_axes(a);
        if !self.has_extent || smallest < 0.05 * count {
            return None; // Their axes are all but parallel.
        }
        let focus = a.inverse() * b;
        let looking = forwards.iter().zip(&self.centers);
        let looking = looking.filter(|(d, c)| d.angle_between(focus - **c) < PI / 4.0);
        if (looking.count() as f64) < 0.7 * count {
            return None;
        }
        let step = self.centers.len().div_ceil(MANY);
        let from_focus = self.centers.iter().step_by(step);
        let from_focus: Vec<DVec3> = from_focus
            .filter_map(|c| (*c - focus).try_normalize())
            .collect();
        let apart = |(i, u): (usize, &DVec3)| from_focus[..i].iter().any(|v| u.dot(*v) < -0.5);
        let is_opposed = from_focus.iter().enumerate().any(apart);

        // 2. Its axis: up as the cameras have it, or else across the ring.
        let across = || self.axes[2] * self.axes[2].dot(self.reference_up()).signum();
        let up = self.up.unwrap_or_else(across);

        // 3. The cameras in spherical coordinates about it.
        let toward = -focus;
        let zero = toward - up * toward.dot(up);
        let zero = zero.try_normalize().unwrap_or(up.any_orthonormal_vector());
        let quarter = up.cross(zero);
        let spherical = |c: &DVec3| {
            let v = *c - focus;
            let (x, y, z) = (v.dot(zero), v.dot(quarter), v.dot(up));
            [y.atan2(x), z.atan2(x.hypot(y)), v.length()]
        };
        let ring = Ring {
            focus,
            up,
            zero,
            quarter,
            cameras: self.centers.iter().map(spherical).collect(),
        };
        // Without an up azimuths are about the line of sight, as likely as not.
        (is_opposed || self.up.is_some() && ring.surrounds()).then_some(ring)
    }
}

/// How far the scene is ahead of a camera that looks along a direction: the median depth of the points in its
/// photo, and the distance to the proxy; each where there is one.
pub(super) fn distances_ahead(
    view: &View,
    forward: DVec3,
    points_in_world: &[DVec3],
    proxy: &Proxy,
) -> (Option<f64>, Option<f64>) {
    let center = view.center();
    let depth = |p: &DVec3| {
        let pixel = view.project(*p)?;
        let depth = forward.dot(*p - center);
        (p.is_finite() && view.contains(pixel)).then_some(depth)
    };
    let to_points = median(points_in_world.iter().filter_map(depth).collect());
    let hit = match proxy {
        Proxy::Plane(plane) => plane.intersect(center, forward),
        // Made of points, it lies where they do.
        Proxy::ViewPlane | Proxy::Points { .. } | Proxy::Dense(_) => None,
        Proxy::Mesh(solid) => {
            let hit = solid.first_hit(center, forward);
            hit.map(|hit| center + forward * hit.along)
        }
    };
    (to_points, hit.map(|p| p.distance(center)))
}

/// The median focal length, in shares of the photos' longer sides.
pub(super) fn relative_focal(sources: &[SourceView]) -> Option<f64> {
    let relative =
        |s: &SourceView| gaze::mean_focal(&s.view) / f64::from(s.view.width.max(s.view.height));
    median(sources.iter().map(relative).collect())
}

/// The camera nearest to a place, by index.
pub(super) fn nearest(centers: &[DVec3], to: DVec3) -> usize {
    let distances = || centers.iter().map(|c| c.distance(to));
    let nearest = distances().fold(f64::INFINITY, f64::min);
    // The first of those that are equally near but for rounding.
    distances()
        .position(|d| d <= nearest * (1.0 + 1e-6))
        .unwrap_or(0)
}

pub(super) fn median(mut values: Vec<f64>) -> Option<f64> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// The distance to the third-nearest point elsewhere, in the median: cameras of a rig, and photos of one
/// place by several exposures, are at one place.
fn spacing(points: &[DVec3]) -> f64 {
    // A camera that is misplaced by far makes no others one.
    let typical = median(points.iter().map(|p| p.length()).collect());
    let same_place = SAME_PLACE * typical.unwrap_or(0.0);
    let step = points.len().div_ceil(MANY).max(1);
    let distance = |at: &DVec3| {
        let distances = points.iter().map(|p| p.distance(*at));
        let mut elsewhere: Vec<f64> = distances.filter(|d| *d > same_place).collect();
        let third = 2.min(elsewhere.len().checked_sub(1)?);
        Some(*elsewhere.select_nth_unstable_by(third, f64::total_cmp).1)
    };
    let sampled = points.iter().step_by(step);
    median(sampled.filter_map(distance).collect()).unwrap_or(0.0)
}
