//! Layered depth images: made, drawn, clipped, kept in files.

mod device;
mod files;
use crate::house;
mod made;
mod places;
mod seen;
mod spared;

use calibrate::{Lens, Rigid3, View};
use datasets::house::House;
use glam::{DQuat, DVec2, DVec3};
use house::{random, small_house, view};
use proptest::prelude::*;
use proxy::interior::{
    CellId, Contents, Interior, PortalId, Region, SemicircleOptions, SemicircleView, semicircles,
    visible,
};
use render::interior::{
    Beyond, CellGeometry, Pinhole, Reference, Splat, Target, Warp, Window, warp,
};
use render::ldi::{
    ClipTree, Clipped, Conflict, ConstructOptions, Ends, Free, FreeOptions, Layered, Look, Ordered,
    OrderedOptions, Sample, Stamp, construct, free, layers, ordered, parse, read, write,
};
use std::path::Path;

/// A house and the images before its portals, side by side.
struct Set {
    house: &'static House,
    contents: Contents,
    sides: Vec<Vec<Reference>>,
}

fn set(rooms: usize, seed: u32, size: u32, views: usize, step: usize) -> Set {
    let (house, contents) = small_house(rooms, seed);
    let geometry = CellGeometry::new(&house.model, &contents);
    let options = SemicircleOptions {
        views,
        ..SemicircleOptions::default()
    };
    let places = semicircles(&house.interior, &contents, &options);
    let make =
        |p: &SemicircleView| Reference::new(&house.interior, &house.model, &geometry, p, [size; 2]);
    let side = |side: &[SemicircleView]| side.iter().map(make).collect();
    let sides = places.chunks(views).step_by(step).map(side).collect();
    Set {
        house,
        contents,
        sides,
    }
}

/// Options that no one would ask for.
fn nonsense() -> FreeOptions {
    FreeOptions {
        tolerance: f32::NAN,
        deviation: f32::NAN,
        end: f32::NAN,
        grow: f32::INFINITY,
        least: -1.0,
        wide: f32::NAN,
        least_wide: 1e9,
        most: f32::NAN,
        fill: u32::MAX,
    }
}

/// As Rafferty et al. make LDIs: the smaller patch wins whatever its colour, and colours are those seen.
fn of_the_papers() -> ConstructOptions {
    ConstructOptions {
        conflict: Conflict::SmallerPatch { same_color: 255 },
        fit: false,
        ..ConstructOptions::default()
    }
}

fn ldi_of(side: &[Reference]) -> Layered {
    let images: Vec<&Reference> = side.iter().collect();
    construct(&images, &ConstructOptions::default())
        .unwrap()
        .ldi
}

/// Where one sees through a portal; nowhere if one doesn't.
fn window(interior: &Interior, from: Option<CellId>, portal: PortalId, view: &View) -> Window {
    let camera = Pinhole::new(view).unwrap();
    let visibility = visible(interior, from, view);
    let is_meant = |pass: &&proxy::interior::Pass| pass.depth == 0 && pass.portal == portal;
    let pass = visibility.passes.iter().find(is_meant);
    pass.map_or_else(Window::default, |pass| Window::of(&pass.region, &camera))
}

fn drawn_free(ldi: &Layered, columns: &Clipped, camera: &Pinhole, window: &Window) -> Target {
    let mut target = Target::new(camera.width, camera.height);
    let options = FreeOptions::default();
    free(
        ldi,
        columns,
        camera,
        window,
        &options,
        &mut Free::default(),
        &mut target,
    );
    target
}

fn drawn_ordered(
    ldi: &Layered,
    columns: &Clipped,
    camera: &Pinhole,
    window: &Window,
    stamp: Stamp,
    fragments: usize,
) -> Target {
    let mut target = Target::new(camera.width, camera.height);
    let options = OrderedOptions { stamp, fragments };
    ordered(
        ldi,
        columns,
        camera,
        window,
        &options,
        &mut Ordered::default(),
        &mut target,
    );
    target
}
