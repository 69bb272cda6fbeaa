use crate::{Distortion, Lens, Pixel, View};
use glam::DVec3;

/// Rays that make a smaller cosine with the axis have next to no depth along it: beyond 87°.
const LEAST_COS: f64 = 0.05;

/// What the depth maps of a lens say: how far along its axis things are, or along each pixel's ray where the
/// image reaches beyond 90° from the axis, as nothing there has a depth along it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DepthAlong {
    /// z in the camera's frame.
    Axis,
    /// The distance from the camera's centre.
    Ray,
}

impl DepthAlong {
    /// For images of a size. Along rays for [`Distortion::Equirectangular`], and for all whose corners, or what is
    /// seen nearest to them, lie behind the camera.
    pub fn of(lens: &Lens, width: u32, height: u32) -> Self {
        let sees_back = lens.distortion() == Distortion::Equirectangular
            || [(0, 0), (width, 0), (0, height), (width, height)]
                .into_iter()
                .any(|(x, y)| {
                    let corner = Pixel::new(x.into(), y.into());
                    match lens.unproject(corner) {
                        Some(ray) => ray.z < 0.0,
                        // The lens ends within the image: does it end behind the camera?
                        None => lens.project(DVec3::new(1.0, 0.0, -1e-3)).is_some(),
                    }
                });
        if sees_back { Self::Ray } else { Self::Axis }
    }

    /// For a view.
    pub fn of_view(view: &View) -> Self {
        Self::of(&view.lens, view.width, view.height)
    }

    /// The depth of a point in the camera's frame.
    pub fn depth(self, point_in_camera: DVec3) -> f64 {
        match self {
            Self::Axis => point_in_camera.z,
            Self::Ray => point_in_camera.length(),
        }
    }

    /// What a depth is multiplied by to give the point in a direction of unit length, in the camera's frame:
    /// with z = 1, or of unit length. `None` where depths along the axis say nothing.
    pub fn ray(self, direction: DVec3) -> Option<DVec3> {
        match self {
            Self::Axis => (direction.z > LEAST_COS).then(|| direction / direction.z),
            Self::Ray => Some(direction),
        }
    }

    /// The inverse depth along the axis of what has an inverse depth along one of the rays of [`Self::ray`];
    /// zero where that says nothing.
    pub fn inverse_along_axis(self, ray: DVec3, inverse_depth: f64) -> f64 {
        match self {
            Self::Axis => inverse_depth,
            Self::Ray if ray.z > LEAST_COS => inverse_depth / ray.z,
            Self::Ray => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec2;

    #[test]
    fn depth_is_along_rays_where_images_reach_behind_the_camera() {
        let middle = DVec2::new(200.0, 150.0);
        let along = |focal: f64, distortion: Distortion| {
            let lens = Lens::new(DVec2::splat(focal), middle, distortion);
            DepthAlong::of(&lens, 400, 300)
        };
        let fisheye = Distortion::Fisheye { k: [0.0; 4] };
        // 250 pixels from the middle to a corner: 89 and 91 degrees.
        assert_eq!(along(161.0, fisheye), DepthAlong::Axis);
        assert_eq!(along(157.0, fisheye), DepthAlong::Ray);
        // A circle within the image, which ends behind the camera, and one that ends before it.
        assert_eq!(along(40.0, fisheye), DepthAlong::Ray);
        let barrel = Distortion::Rational {
            k: [-0.3, 0.0, 0.0, 0.0, 0.0, 0.0],
            p: [0.0; 2],
        };
        assert_eq!(along(100.0, barrel), DepthAlong::Axis);
        assert_eq!(along(5.0, Distortion::None), DepthAlong::Axis);
        assert_eq!(along(63.7, Distortion::Equirectangular), DepthAlong::Ray);
    }

    #[test]
    fn a_depth_times_its_ray_is_the_point() {
        for (along, point) in [
            (DepthAlong::Axis, DVec3::new(1.0, -2.0, 3.0)),
            (DepthAlong::Ray, DVec3::new(1.0, -2.0, 3.0)),
            (DepthAlong::Ray, DVec3::new(1.0, -2.0, -3.0)),
        ] {
            let ray = along.ray(point.normalize()).unwrap();
            assert!((ray * along.depth(point) - point).length() < 1e-12);
            let inverse = along.inverse_along_axis(ray, along.depth(point).recip());
            let expected = if point.z > 0.0 { point.z.recip() } else { 0.0 };
            assert!((inverse - expected).abs() < 1e-12, "{along:?}, {point}");
        }
        assert_eq!(DepthAlong::Axis.ray(DVec3::X), None);
        assert_eq!(DepthAlong::Axis.ray(DVec3::NEG_Z), None);
    }
}
