//! What one photo says of a place: how far inside its silhouette it lies.

use super::Silhouette;
use calibrate::{Distortion, Lens, Pixel, View};
use glam::{DMat3, DVec2, DVec3};
use std::f64::consts::PI;

/// What a photo says of a place that it does not see though its object may go on there.
const UNKNOWN_PX: f64 = 1e6;
/// What a photo says of a place where the object, which it shows whole, is not.
const ELSEWHERE_PX: f64 = -1e6;
/// Balls that are this large for their distance from a camera are not judged, only divided.
const TOO_NEAR: f64 = 0.5;
/// For lenses with distortion, whose second derivative has no closed bound: how much farther
/// than by its first derivative a ball's points may fall.
const CURVATURE: f64 = 1.5;
/// Rounding, in pixels.
const SLACK_PX: f64 = 1e-3;

/// A posed photo and its silhouette as a function of space.
///
/// At a point of the world it is the signed distance, in pixels, of the point's projection
/// from the silhouette's border: positive inside, and `tolerance_px` more everywhere. A photo
/// whose silhouette stays clear of the image's border shows the whole object, so nothing of
/// it lies outside its field of view. Of a photo that cuts the object off nothing is known
/// out there.
#[derive(Clone, Debug)]
pub(crate) struct Witness {
    camera: Camera,
    width: u32,
    height: u32,
    /// The camera's axis and centre, in the world.
    forward: DVec3,
    center: DVec3,
    /// All that the photo sees lies within this angle of the axis, in radians.
    half_angle: f64,
    /// At pixel centres, row by row, tolerance included.
    distances_px: Vec<f32>,
    /// What it says of what it does not see.
    beyond_px: f64,
}

#[derive(Clone, Debug)]
enum Camera {
    Pinhole {
        camera_from_world: DMat3,
        translation: DVec3,
        focal: DVec2,
        principal: DVec2,
    },
    Lens(Box<View>),
}

/// Where a ball falls in an image.
enum Footprint {
    /// Within a disc: centre and radius in pixels.
    Disc(DVec2, f64),
    /// Nowhere: it lies behind the camera or beyond what the lens sees.
    Unseen,
    /// Too near to say.
    Anywhere,
}

impl Witness {
    /// The silhouette must be as large as the view and have a border.
    pub(crate) fn new(view: &View, silhouette: &Silhouette, tolerance_px: f64) -> Self {
        let mut distances_px = silhouette.signed_distances_px();
        for distance in &mut distances_px {
            *distance += tolerance_px as f32;
        }
        let cut_off = silhouette.reaches_border(tolerance_px.ceil() as u32 + 1);
        let pose = view.camera_from_world;
        let camera = match view.lens.distortion() {
            Distortion::None => Camera::Pinhole {
                camera_from_world: pose.matrix(),
                translation: pose.translation,
                focal: view.lens.focal,
                principal: view.lens.principal,
            },
            _ => Camera::Lens(Box::new(view.clone())),
        };
        Self {
            camera,
            width: view.width,
            height: view.height,
            forward: view.forward(),
            center: view.center(),
            half_angle: half_angle(view),
            distances_px,
            beyond_px: if cut_off { UNKNOWN_PX } else { ELSEWHERE_PX },
        }
    }

    /// How far inside the silhouette a point of the world falls, in pixels.
    pub(crate) fn at(&self, point_in_world: DVec3) -> f64 {
        match self.project(point_in_world) {
            Some(pixel) if self.sees(pixel) => self.interpolated(pixel),
            _ => self.beyond_px,
        }
    }

    /// Bounds of [`Self::at`] over a ball.
    ///
    /// Distances of neighbouring pixels differ by at most one, so between pixel centres,
    /// where they are interpolated bilinearly, the gradient is at most √2 long. Over longer
    /// ways they change as true distances do, by one a pixel, but for what interpolation
    /// (√2/2 at either end) and the half pixels at the border add.
    pub(crate) fn range(&self, center_in_world: DVec3, radius: f64) -> (f64, f64) {
        let beyond = self.beyond_px;
        let (pixel, radius_px) = match self.footprint(center_in_world, radius) {
            Footprint::Anywhere => return (ELSEWHERE_PX, UNKNOWN_PX),
            Footprint::Unseen => return (beyond, beyond),
            Footprint::Disc(pixel, radius_px) => (pixel, radius_px + SLACK_PX),
        };
        let size = DVec2::new(f64::from(self.width), f64::from(self.height));
        let outside = (-pixel).max(pixel - size).max(DVec2::ZERO).length();
        if outside > radius_px {
            return (beyond, beyond);
        }
        let nearest = pixel.clamp(DVec2::ZERO, size);
        let middle = self.interpolated(nearest);
        let reach = radius_px + outside;
        let change = (std::f64::consts::SQRT_2 * reach).min(reach + 2.5) + SLACK_PX;
        let (low, high) = (middle - change, middle + change);
        let within =
            (pixel - radius_px).cmpge(DVec2::ZERO).all() && (pixel + radius_px).cmple(size).all();
        match within {
            true => (low, high),
            false => (low.min(beyond), high.max(beyond)),
        }
    }

    /// Radians that a pixel covers, about.
    pub(crate) fn pixel_angle(&self) -> f64 {
        match &self.camera {
            Camera::Pinhole { focal, .. } => (focal.x * focal.y).sqrt().recip(),
            Camera::Lens(view) => view.lens.mean_focal().recip(),
        }
    }

    fn project(&self, point_in_world: DVec3) -> Option<DVec2> {
        match &self.camera {
            Camera::Pinhole {
                camera_from_world,
                translation,
                focal,
                principal,
            } => {
                let point = *camera_from_world * point_in_world + *translation;
                let pixel = point.truncate() / point.z * *focal + *principal;
                (point.z > 0.0 && pixel.is_finite()).then_some(pixel)
            }
            Camera::Lens(view) => view.project(point_in_world).map(|p| DVec2::new(p.x, p.y)),
        }
    }

    fn footprint(&self, center_in_world: DVec3, radius: f64) -> Footprint {
        let to_center = center_in_world - self.center;
        let distance = to_center.length();
        if radius < distance {
            let off_axis = to_center.cross(self.forward).length();
            let angle = off_axis.atan2(to_center.dot(self.forward));
            if angle - (radius / distance).asin() > self.half_angle {
                return Footprint::Unseen;
            }
        }
        match &self.camera {
            Camera::Pinhole {
                camera_from_world,
                translation,
                focal,
                principal,
            } => {
                let center = *camera_from_world * center_in_world + *translation;
                let nearest = center.z - radius;
                if !(nearest > 0.1 * radius) {
                    return Footprint::Anywhere;
                }
                // Of a point c + δ, |δ| ≤ r: u(c + δ) − u(c) = (δ_xy − u·δ_z)/(z + δ_z), which
                // is at most r·√(1 + |u|²)/(z − r) long.
                let u = center.truncate() / center.z;
                let moved = radius * (1.0 + u.length_squared()).sqrt() / nearest;
                Footprint::Disc(u * *focal + *principal, moved * focal.max_element())
            }
            Camera::Lens(view) => {
                let center = view.camera_from_world * center_in_world;
                if !(radius < TOO_NEAR * distance) {
                    return Footprint::Anywhere;
                }
                let Some(seen) = view.lens.project_with_gradients(center) else {
                    return Footprint::Anywhere;
                };
                let [gx, gy] = seen.gradients;
                let steepest = (gx.length_squared() + gy.length_squared()).sqrt();
                let stretched = CURVATURE * radius * distance / (distance - radius);
                Footprint::Disc(DVec2::new(seen.pixel.x, seen.pixel.y), steepest * stretched)
            }
        }
    }

    fn sees(&self, pixel: DVec2) -> bool {
        pixel.x >= 0.0
            && pixel.y >= 0.0
            && pixel.x <= f64::from(self.width)
            && pixel.y <= f64::from(self.height)
    }

    /// The distance at a place of the image, bilinearly between pixel centres.
    fn interpolated(&self, pixel: DVec2) -> f64 {
        let (width, height) = (self.width as usize, self.height as usize);
        let within = |x: f64, size: usize| {
            let x = (x - 0.5).clamp(0.0, (size - 1) as f64);
            let i = (x as usize).min(size.saturating_sub(2));
            (i, x - i as f64)
        };
        let ((column, fx), (row, fy)) = (within(pixel.x, width), within(pixel.y, height));
        let right = usize::from(width > 1);
        let below = if height > 1 { width } else { 0 };
        let i = row * width + column;
        let at = |i: usize| f64::from(self.distances_px[i]);
        let lerp = |a: f64, b: f64, t: f64| a + (b - a) * t;
        let above = lerp(at(i), at(i + right), fx);
        let under = lerp(at(i + below), at(i + below + right), fx);
        lerp(above, under, fy)
    }
}

/// The largest angle from a view's axis at which its image shows anything: that of its border,
/// or the lens' limit where the border lies beyond it.
fn half_angle(view: &View) -> f64 {
    let (width, height) = (view.width, view.height);
    let across = (0..=width).flat_map(|x| [(x, 0), (x, height)]);
    let down = (0..=height).flat_map(|y| [(0, y), (width, y)]);
    let angle = |(x, y): (u32, u32)| {
        let ray = view.lens.unproject(Pixel::new(f64::from(x), f64::from(y)));
        ray.map_or(PI, |ray| ray.truncate().length().atan2(ray.z))
    };
    let border = across.chain(down).map(angle).fold(0.0, f64::max);
    let limit = match view.lens.distortion() {
        Distortion::None | Distortion::Rational { .. } | Distortion::Tilted { .. } => {
            view.lens.limit().atan()
        }
        _ => view.lens.limit(),
    };
    border.min(limit) + 1e-9
}

/// The lens of a photo reduced by a whole number: each of its pixels takes the place of
/// `factor`² pixels.
pub(crate) fn reduced(view: &View, factor: u32) -> View {
    let scale = f64::from(factor).recip();
    let lens: Lens = view.lens.scaled(scale, scale);
    View {
        lens,
        width: view.width.div_ceil(factor),
        height: view.height.div_ceil(factor),
        camera_from_world: view.camera_from_world,
    }
}

/// The ray through the middle of what a silhouette shows, in the world.
pub(crate) fn middle_ray(view: &View, silhouette: &Silhouette) -> Option<DVec3> {
    let width = silhouette.size().0 as usize;
    let mut sum = DVec2::ZERO;
    let mut count = 0.0;
    for (i, _) in silhouette.inside().iter().enumerate().filter(|i| *i.1) {
        sum += DVec2::new((i % width) as f64 + 0.5, (i / width) as f64 + 0.5);
        count += 1.0;
    }
    let middle = sum / count;
    let ray = view.lens.unproject(Pixel::new(middle.x, middle.y))?;
    Some(view.camera_from_world.rotation.conjugate() * ray)
}
