//! Walks through rooms that photos show.

use crate::house;

use calibrate::View;
use datasets::house::House;
use glam::DVec3;
use house::{own_house, room, view, viewpoint};
use image::{Rgba, RgbaImage};
use proxy::interior::{Contents, Portal};
use proxy::mesh::Mesh;
use proxy::{MeshKind, Proxy, Solid};
use render::interior::{Captured, Painter, PortalFill, Walk, WalkError, WalkOptions};
use render::score::score;
use render::{
    DeviceChoice, Engine, FieldOptions, Lumigraph, Method, PhotoStore, RenderError, SourceView,
    Visibility,
};
use std::ops::Range;
use std::sync::Arc;

const SIZE: [u32; 2] = [128, 96];

/// A house whose model is white, and photos of the house as it was.
struct Capture {
    house: House,
    contents: Contents,
    photos: Vec<(View, RgbaImage)>,
    backdrop: Range<u32>,
}

/// Photos from some places of each room, around.
fn capture(rooms: usize, around: u32) -> Capture {
    let (mut house, mut contents) = own_house(rooms, 2);
    let mut photos = Vec::new();
    for cell in 0..house.interior.cells.len() {
        let bounds = room(&house.interior, cell);
        let middle = bounds.min.midpoint(bounds.max);
        for i in 0..around {
            let turn = std::f64::consts::TAU * f64::from(i) / f64::from(around);
            let out = DVec3::new(turn.cos(), 0.0, turn.sin());
            let eye = middle - 0.2 * (bounds.max - bounds.min).min_element() * out;
            let photo = view(eye, eye + out, SIZE);
            let (pixels, _) = datasets::house::render(&house, &photo);
            photos.push((photo, pixels));
        }
    }
    // Only photos know the colours; only a photo knows the sky.
    house.interior.show_photos("photos");
    house.model.colors.iter_mut().for_each(|c| *c = [255; 4]);
    for material in &mut house.model.materials {
        *material = proxy::mesh::Material::default();
    }
    let far = 1e3;
    let sky = Mesh {
        positions: vec![
            DVec3::new(-far, far, -far),
            DVec3::new(far, far, -far),
            DVec3::new(0.0, far, far),
        ],
        triangles: vec![[0, 1, 2]],
    };
    let backdrop = house.model.append(&sky, "backdrop");
    contents.elsewhere.extend(backdrop.clone());
    Capture {
        house,
        contents,
        photos,
        backdrop,
    }
}

impl Capture {
    /// A walk drawn from the photos; those that `is_lost` says cannot be decoded.
    fn walk(&self, is_lost: impl Fn(usize) -> bool + Send + Sync + 'static) -> Walk<'_> {
        self.walk_by(is_lost, None)
    }

    /// The same, by LDIs of so many views where not of all.
    fn walk_by(
        &self,
        is_lost: impl Fn(usize) -> bool + Send + Sync + 'static,
        ldi_views: Option<usize>,
    ) -> Walk<'_> {
        let source = |(i, (view, _)): (usize, &(View, RgbaImage))| SourceView {
            name: format!("{i}.jpg"),
            view: view.clone(),
            gain: [1.0; 3],
            time_s: None,
            quarters: 0,
        };
        let sources: Vec<SourceView> = self.photos.iter().enumerate().map(source).collect();
        let solid = Solid::new(MeshKind::Depth, self.house.model.mesh.clone());
        let proxy = Proxy::Mesh(Arc::new(solid));
        let pixels: Vec<RgbaImage> = self.photos.iter().map(|(_, p)| p.clone()).collect();
        let lumigraph = Lumigraph {
            visibility: Visibility::of(&proxy, &sources),
            photos: PhotoStore::new(sources.len(), move |i| match is_lost(i) {
                true => Err(format!("{i}.jpg: not a picture")),
                false => Ok(pixels[i].clone()),
            }),
            sources,
            proxy,
            points: Vec::new(),
        };
        let captured = Captured::new(
            lumigraph,
            Engine::open(DeviceChoice::Cpu).unwrap(),
            FieldOptions::default(),
            Method::Triangulated { cells_across: 32 },
            &self.house.interior,
            &self.contents,
            &self.house.model,
            self.backdrop.clone(),
        );
        captured.prepare();
        let mut options = WalkOptions::default();
        options.library.size = [96; 2];
        options.library.semicircles.views = 5;
        options.library.ldi_views = ldi_views;
        let (house, painter) = (&self.house, Painter::of_photos(captured));
        Walk::with(
            painter,
            &house.interior,
            &self.contents,
            &house.model,
            options,
        )
    }
}

#[test]
fn rooms_look_as_their_photos_do() {
    let capture = capture(2, 6);
    let mut walk = capture.walk(|_| false);
    for (view, photo) in capture.photos.iter().step_by(3) {
        walk.draw(view, PortalFill::Geometry).unwrap();
        let psnr = score(&walk.picture().picture(), photo).unwrap().psnr;
        assert!(psnr > 30.0, "{psnr}");
    }
    assert!(walk.painter().description().contains("12 photos"));
    assert_eq!(walk.painter().notes(), [""; 0]);
}

/// Rooms of captures are found, and their walls may be open where no portal is: nothing is lost.
#[test]
fn portals_hide_nothing_of_a_capture() {
    let mut capture = capture(3, 4);
    capture.house.interior.portals.truncate(1);
    let mut walk = capture.walk(|_| false);
    for seed in 0..6 {
        let (eye, target) = viewpoint(&capture.house.interior, seed);
        let desired = view(eye, target, SIZE);
        walk.draw(&desired, PortalFill::Geometry).unwrap();
        let some = walk.picture().clone();
        walk.draw(&desired, PortalFill::Whole).unwrap();
        assert!(some == *walk.picture(), "{seed}");
    }
}

#[test]
fn images_before_portals_are_made_of_photos() {
    let capture = capture(2, 6);
    let interior = &capture.house.interior;
    let mut walk = capture.walk(|_| false);
    let (mut filled, mut worst) = (0, f64::INFINITY);
    for seed in 0..24 {
        let (eye, _) = viewpoint(interior, seed);
        let portal = &interior.portals[seed as usize % interior.portals.len()];
        let desired = view(eye, portal.polygon.center(), SIZE);
        let of_whole = {
            walk.draw(&desired, PortalFill::Whole).unwrap();
            walk.picture().picture()
        };
        for fill in [PortalFill::Warp2, PortalFill::Ldi] {
            let cost = walk.draw(&desired, fill).unwrap();
            filled += cost.filled;
            let psnr = score(&walk.picture().picture(), &of_whole).unwrap().psnr;
            worst = worst.min(psnr);
        }
        if filled > 3 {
            break;
        }
    }
    assert!(filled > 0);
    // A white model in a portal would be some 10 dB.
    assert!(worst > 20.0, "{worst}");
}

/// Coming through a portal one sees all as geometry, on either side.
#[test]
fn nothing_pops_where_cells_change() {
    let capture = capture(4, 4);
    let interior = &capture.house.interior;
    let mut walk = capture.walk(|_| false);
    let mut changes = 0;
    let inner = |p: &&Portal| p.cells.iter().all(Option::is_some);
    for portal in interior.portals.iter().filter(inner).take(3) {
        let (center, normal) = (portal.polygon.center(), portal.polygon.normal());
        let mut pictures = Vec::new();
        for side in [1e-4, -1e-4] {
            let eye = center + side * normal;
            let desired = view(eye, eye - normal + DVec3::new(0.3, 0.0, 0.2), SIZE);
            let cost = walk.draw(&desired, PortalFill::Ldi).unwrap();
            pictures.push((cost.cell, walk.picture().picture()));
        }
        let [(cell, before), (other, after)] = &pictures[..] else {
            unreachable!("two sides");
        };
        changes += usize::from(cell != other);
        let psnr = score(after, before).unwrap().psnr;
        assert!(psnr > 45.0, "{}: {psnr}", portal.name);
    }
    assert!(changes > 0);
}

#[test]
fn what_no_photo_shows_has_the_models_colour_and_no_sky() {
    let mut capture = capture(2, 4);
    // One photo, of one room.
    capture.photos.truncate(1);
    let mut walk = capture.walk(|_| false);
    let (photo, _) = capture.photos[0].clone();
    let eye = photo.center();
    let ahead = photo.camera_from_world.rotation.conjugate() * DVec3::Z;
    // The other way all is white.
    let behind = view(eye, eye - ahead, SIZE);
    walk.draw(&behind, PortalFill::Geometry).unwrap();
    let picture = walk.picture().picture();
    let white = picture.pixels().filter(|p| **p == Rgba([255; 4])).count();
    let share = white as f64 / f64::from(SIZE[0] * SIZE[1]);
    assert!(share > 0.3, "{share}");
    // Over the roof is the backdrop, which no photo has seen.
    let roof = DVec3::new(0.0, 50.0, 0.0);
    walk.draw(
        &view(roof, DVec3::new(1.0, 100.0, 0.0), SIZE),
        PortalFill::Geometry,
    )
    .unwrap();
    for (pixel, depth) in walk
        .picture()
        .color
        .iter()
        .zip(&walk.picture().inverse_depth)
    {
        assert!(pixel[3] == 0 || *depth > 0.0);
    }
}

#[test]
fn photos_that_cannot_be_decoded_are_left_out() {
    let capture = capture(2, 4);
    let desired = capture.photos[0].0.clone();
    let mut walk = capture.walk(|i| i == 0);
    walk.draw(&desired, PortalFill::Geometry).unwrap();
    let notes = walk.painter().notes().join("; ");
    assert!(notes.contains("photo 0.jpg is left out"), "{notes}");
    let again = walk.picture().clone();
    walk.draw(&desired, PortalFill::Geometry).unwrap();
    assert!(again == *walk.picture());
    let mut none = capture.walk(|_| true);
    let failed = none.draw(&desired, PortalFill::Geometry);
    let is_photo = matches!(failed, Err(WalkError::Photos(RenderError::Photo(_))));
    assert!(is_photo, "{failed:?}");
}

#[test]
fn ldis_of_the_nearest_views_are_made_of_photos_too_ahead_or_not() {
    let capture = capture(2, 4);
    let views: Vec<View> = (1..9)
        .map(|seed| {
            let (eye, target) = viewpoint(&capture.house.interior, seed);
            view(eye, target, [64, 48])
        })
        .collect();
    let draw = |walk: &mut Walk<'_>| -> Vec<_> {
        let draw = |view: &View| {
            let cost = walk.draw(view, PortalFill::Ldi).unwrap();
            (walk.picture().clone(), cost.filled)
        };
        // Again, as what was made ahead comes in with later frames.
        [&views, &views].into_iter().flatten().map(draw).collect()
    };
    let alone = draw(&mut capture.walk_by(|_| false, Some(2)));
    assert!(alone.iter().any(|(_, filled)| *filled > 0));
    std::thread::scope(|scope| {
        let mut walk = capture.walk_by(|_| false, Some(2));
        walk.make_ahead(scope).unwrap();
        assert!(draw(&mut walk) == alone);
    });
}
