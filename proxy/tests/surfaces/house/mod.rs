//! What the tests of interiors share. Each of them uses a part.
#![allow(dead_code)]

use crate::once::Once;
use calibrate::{Lens, Pixel, Rigid3, View};
use datasets::house::{House, HouseOptions, house};
use glam::{DVec2, DVec3};
use proxy::interior::{CellId, Contents, Interior, Region, RoomBox, Visibility};

pub(crate) fn view(eye: DVec3, target: DVec3, [width, height]: [u32; 2]) -> View {
    let size = DVec2::new(f64::from(width), f64::from(height));
    View {
        lens: Lens::pinhole(DVec2::splat(0.6 * size.x), 0.5 * size),
        width,
        height,
        camera_from_world: Rigid3::looking_at(eye, target, DVec3::Y),
    }
}

/// Numbers from 0 to 1, the same every time: SplitMix64.
pub(crate) fn random(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (state ^ (state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
}

pub(crate) fn room(interior: &Interior, cell: usize) -> RoomBox {
    let room = interior.cells[cell].content.room();
    room.expect("a house's cells are boxes")
}

/// A viewpoint anywhere in a house, one in eight in a doorway, some on portals' planes.
pub(crate) fn viewpoint(interior: &Interior, seed: u64) -> (DVec3, DVec3) {
    let mut r = random(seed);
    let eye = if seed.is_multiple_of(8) {
        let i = (r() * interior.portals.len() as f64) as usize;
        let portal = &interior.portals[i];
        let corners = portal.polygon.corners();
        let (s, t) = (0.05 + 0.9 * r(), 0.05 + 0.9 * r());
        let at = corners[0]
            .lerp(corners[1], s)
            .lerp(corners[3].lerp(corners[2], s), t);
        let off = [0.0, 1e-12, -1e-12, 1e-7, -1e-5, 0.01, -0.05, 0.06];
        at + portal.polygon.normal() * off[(r() * 8.0) as usize]
    } else {
        let room = room(interior, (r() * interior.cells.len() as f64) as usize);
        let inset = DVec3::splat(0.1);
        let share = DVec3::new(r(), r(), r());
        room.min + inset + (room.max - room.min - 2.0 * inset) * share
    };
    let target = DVec3::new(r() - 0.5, 0.6 * (r() - 0.5), r() - 0.5);
    (eye, eye + target)
}

/// A house of few triangles and what its cells contain: made once, as many tests walk through the same.
pub(crate) fn small_house(rooms: usize, seed: u32) -> (&'static House, Contents) {
    static MADE: Once<(usize, u32), (House, Contents)> = Once::new();
    let (house, contents) = MADE.get((rooms, seed), || own_house(rooms, seed));
    (house, contents.clone())
}

/// The same, to change it.
pub(crate) fn own_house(rooms: usize, seed: u32) -> (House, Contents) {
    let options = HouseOptions {
        rooms,
        triangles: Some(1),
        seed,
    };
    let house = house(&options).unwrap();
    let (contents, warnings) = Contents::new(&house.interior, &house.model).unwrap();
    assert_eq!(warnings, []);
    (house, contents)
}

/// The directions of a view's pixels, in the world.
pub(crate) fn rays(view: &View) -> Vec<DVec3> {
    let world_from_camera = view.camera_from_world.rotation.conjugate();
    let pixels = (0..view.height).flat_map(|y| (0..view.width).map(move |x| (x, y)));
    let ray = |(x, y)| view.lens.unproject(Pixel::center_of(x, y)).unwrap();
    pixels.map(|p| world_from_camera * ray(p)).collect()
}

/// The triangles to draw where these cells are visible, in order, none twice.
pub(crate) fn visible_triangles(contents: &Contents, visibility: &Visibility) -> Vec<u32> {
    let of = |id: CellId| &contents.triangles[id.0 as usize];
    let mut all: Vec<u32> = contents.elsewhere.clone();
    all.extend(visibility.cells.iter().flat_map(|c| of(c.cell)));
    all.sort_unstable();
    all.dedup();
    all
}

/// Where one sees a cell; nowhere, if it is not visible.
pub(crate) fn regions(visibility: &Visibility, cell: u32) -> &[Region] {
    let found = visibility.cells.iter().find(|c| c.cell == CellId(cell));
    found.map_or(&[], |c| &c.regions)
}
