use glam::DVec3;
use proxy::interior::{Contents, Interior, SemicircleOptions, SemicircleView, semicircles};

/// How far from its cell's sides an eye stands, in metres: cells reach into their walls.
const IN_WALL: f64 = 0.3;

/// Views through an interior's portals from so many times the radius of their semicircles, where
/// somebody can stand.
pub fn before_doorways(
    interior: &Interior,
    contents: &Contents,
    radii: f64,
    options: &SemicircleOptions,
) -> Vec<SemicircleView> {
    let mut wide = interior.clone();
    for portal in &mut wide.portals {
        portal.radius = Some(radii * portal.semicircle_radius(interior.up));
    }
    let is_free = |place: &SemicircleView| {
        let eye = place.camera_from_world.center();
        let bounds = place.from.and_then(|id| contents.bounds[id.0 as usize]);
        let stands = bounds.is_some_and(|room| {
            let within = IN_WALL * (DVec3::ONE - interior.up.abs());
            let (low, high) = (room.min + within, room.max - within);
            low.cmple(high).all() && eye.clamp(low, high) == eye
        });
        stands && contents.locate(interior, eye) == place.from
    };
    let mut places = semicircles(&wide, contents, options);
    places.retain(is_free);
    places
}
