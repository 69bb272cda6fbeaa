//! Any model with any parameters: a camera is refused, or the pixels and rays that its lens
//! gives are finite, and no ray is without a direction.
#![no_main]
use calibrate::{Camera, ModelKind, Pixel};
use glam::DVec3;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let Some((&which, data)) = data.split_first() else {
        return;
    };
    let mut numbers = data
        .chunks_exact(8)
        .map(|bytes| f64::from_le_bytes(bytes.try_into().expect("eight")));
    let mut next = || numbers.next().unwrap_or(0.25);
    let model = ModelKind::ALL[usize::from(which) % ModelKind::ALL.len()];
    let camera = Camera {
        model,
        width: 640,
        height: 480,
        params: model.parameter_names().iter().map(|_| next()).collect(),
    };
    let Ok(lens) = camera.lens() else {
        return;
    };
    let point = DVec3::new(next(), next(), next());
    let pixel = Pixel::new(next(), next());
    if let Some(pixel) = lens.project(point) {
        assert!(
            pixel.x.is_finite() && pixel.y.is_finite(),
            "{camera:?} {point} {pixel:?}"
        );
    }
    if let Some(projection) = lens.project_with_gradients(point) {
        assert!(
            projection.pixel.x.is_finite(),
            "{camera:?} {point} {projection:?}"
        );
    }
    if let Some(ray) = lens.unproject(pixel) {
        assert!(ray.is_finite(), "{camera:?} {pixel:?} {ray}");
        assert!(ray.length() > 0.0, "{camera:?} {pixel:?} {ray}");
    }
});
