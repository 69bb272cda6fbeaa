//! The sparse points as a surface of their own, made anew for each desired view.
//!
//! The points that the source views most like the desired one observe, by part of its picture, are
//! triangulated over the directions around the desired centre. Inside a triangle inverse distance is
//! linear, so each is flat. A ring of anchors beyond the image's corners, and one behind the
//! viewer, make the surface complete. Where next to no points are in sight, a plane does. It is the proxy that asks least of a capture: no closed mesh, no agreement
//! between far views.

mod alike;
mod chart;
mod clean;
mod few;
mod nearest;

use crate::Facets;
use alike::Alike;
pub(crate) use alike::{EASY_ANGLE, unlikeness};
use calibrate::{Pixel, View};
use chart::{Chart, distinct};
use clean::{faded, without_odd};
pub use few::plane_without_facets;
use glam::{DVec2, DVec3};
use nearest::{Asked, Nearest};

/// A sparse point and who sees it.
#[derive(Clone, Debug, PartialEq)]
pub struct SparsePoint {
    /// In the world.
    pub position: DVec3,
    /// Indices of the source views that observe it.
    pub seen_by: Vec<u32>,
}

/// Anchors around the image, and how many points decide where each lies, as their shares add up.
const ANCHORS: usize = 32;
const ANCHORED_TO: f64 = 4.5;
/// The ring's angle from the axis over that of the image's farthest corner; beyond it no
/// point counts.
const MARGIN: f64 = 1.1;
/// The widest ring; what lies behind it is not seen.
const WIDEST: f64 = 2.8;

/// A point as the desired view sees it: a unit vector in its frame, and 1/distance.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Node {
    direction: DVec3,
    inverse_distance: f64,
    /// How much of it is there, 0…1: points come and go with the desired view.
    weight: f64,
}

impl Node {
    /// Its place in the chart in which everything is triangulated: the stereographic
    /// projection from straight behind. A circle there is a circle on the sphere, so the
    /// triangulation is Delaunay for any lens.
    fn chart(&self) -> DVec2 {
        self.direction.truncate() / (1.0 + self.direction.z)
    }
}

/// The surface through the points that the `sources` most like `desired` observe, by part of its
/// picture; `None` where fewer than three are in sight: see [`plane_without_facets`].
///
/// Outliers go: points of which half the neighbours lie clearly nearer are taken to be hidden by
/// them, and points that stick out of all their neighbours go, too.
pub fn facets(desired: &View, sources: &[View], points: &[SparsePoint]) -> Option<Facets> {
    // 1. The points in sight.
    let reach = reach(desired);
    let center = desired.center();
    let seen = |point: &SparsePoint| {
        let offset = desired.camera_from_world.rotation * (point.position - center);
        let node = Node {
            direction: offset / offset.length(),
            inverse_distance: 1.0 / offset.length(),
            weight: 1.0,
        };
        let finite = node.direction.is_finite() && node.inverse_distance > 0.0;
        (finite && node.direction.z > reach.cos()).then_some(node)
    };
    let in_sight: Vec<(Node, &SparsePoint)> =
        points.iter().filter_map(|p| Some((seen(p)?, p))).collect();

    // 2. Those that the views most like this one observe.
    let alike = Alike::new(center, reach, sources, &in_sight);
    let nodes: Vec<Node> = in_sight
        .iter()
        .map(|(node, point)| Node {
            weight: alike.weight(node, point),
            ..*node
        })
        .filter(|node| node.weight > 0.0)
        .collect();
    let nodes = without_odd(&distinct(nodes));
    if nodes.len() < 3 {
        return None;
    }
    // What fades stays where it is in the chart.
    let nearest = Nearest::new(&nodes);
    let (chart, mut faded) = rayon::join(|| Chart::new(&nodes), || faded(&nodes, &nearest));
    let mut chart = chart?;

    // 3. Anchors, at the distance of the points nearest to them.
    let mut asked = Asked::default();
    let mut anchors = Vec::with_capacity(ANCHORS);
    for k in 0..ANCHORS {
        let turn = std::f64::consts::TAU * (k as f64 + 0.5) / ANCHORS as f64;
        let across = DVec2::from_angle(turn) * reach.sin();
        let mut anchor = Node {
            direction: across.extend(reach.cos()),
            inverse_distance: 0.0,
            weight: 1.0,
        };
        // By the inverse squares of their distances.
        let (mut sum, mut shares) = (0.0, 0.0);
        for near in nearest.around(anchor.chart(), 1.0, ANCHORED_TO, &mut asked) {
            let share = near.share / near.offset.length_squared();
            sum += share * faded[near.index].inverse_distance;
            shares += share;
        }
        anchor.inverse_distance = sum / shares;
        chart.insert(&anchor, nodes.len() + k)?;
        anchors.push(anchor);
    }
    faded.extend(anchors);
    let mut nodes = faded;

    // 4. Straight behind is the chart's infinity: with it the triangulation closes.
    let (mut triangles, rim) = chart.triangles();
    let behind = Node {
        direction: DVec3::NEG_Z,
        inverse_distance: nodes[nodes.len() - 1].inverse_distance,
        weight: 1.0,
    };
    let beyond = |[from, to]: [u32; 2]| [to, from, nodes.len() as u32];
    triangles.extend(rim.into_iter().map(beyond));
    nodes.push(behind);
    Some(Facets::new(
        nodes.iter().map(|n| n.direction).collect(),
        nodes.iter().map(|n| n.inverse_distance).collect(),
        triangles,
    ))
}

/// The angle from the axis within which all of the image lies, and a margin.
fn reach(view: &View) -> f64 {
    const STEPS: u32 = 8;
    let (width, height) = (f64::from(view.width), f64::from(view.height));
    let angle = |x: f64, y: f64| {
        let ray = view.lens.unproject(Pixel::new(x, y))?;
        Some(ray.truncate().length().atan2(ray.z))
    };
    let border = (0..=STEPS).flat_map(|i| {
        let share = f64::from(i) / f64::from(STEPS);
        let (x, y) = (share * width, share * height);
        [(x, 0.0), (x, height), (0.0, y), (width, y)]
    });
    let widest = border.filter_map(|(x, y)| angle(x, y)).fold(0.0, f64::max);
    (widest * MARGIN).clamp(0.1, WIDEST)
}

#[cfg(test)]
mod tests;
